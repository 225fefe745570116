use super::super::{RglBrdf, read};
use super::*;
use crate::geometry::Side;
use crate::gonio::directional::tests::Sheet;
use crate::gonio::measurement::direction_deg;
use crate::gonio::{Band, Coverage, directional_hemispherical};

/// A Lambertian sheet that sends light back to the lamp, in a lobe 8 deg wide (one sigma).
struct Retro {
    bands: Vec<Band>,
}

impl Directional for Retro {
    fn bands(&self) -> &[Band] {
        &self.bands
    }
    fn coverage(&self) -> Coverage {
        Coverage { reflection_adaxial: true, ..Coverage::default() }
    }
    fn bsdf(&self, wi: DVec3, wo: DVec3, values: &mut [f64]) -> bool {
        let angle_deg = wi.angle_between(wo).to_degrees();
        for (i, v) in values.iter_mut().enumerate() {
            *v = 0.1 / PI + (0.3 - 0.1 * i as f64) * (-0.5 * (angle_deg / 8.0).powi(2)).exp();
        }
        wi.z > 0.0 && wo.z > 0.0
    }
}

fn retro() -> Retro {
    Retro { bands: vec![Band::nm(620.0), Band::nm(440.0)] }
}

fn written(table: &dyn Directional) -> RglBrdf {
    let bytes = write(table, Resolution::for_bands(table.bands().len()), "test").unwrap();
    assert!(bytes.len() < 10_000_000, "{}", bytes.len());
    read(&bytes).unwrap()
}

/// Largest |f' - f| cos(theta_o) over pairs of directions within 80 deg, in units of the largest f cos(theta_o).
fn largest_error(table: &dyn Directional, file: &RglBrdf, band: usize, file_band: usize) -> f64 {
    let (mut a, mut b) = (vec![0.0; table.bands().len()], vec![0.0; file.bands().len()]);
    let (mut worst, mut top) = (0.0f64, 0.0f64);
    for ti in [0.0, 1.0, 20.0, 43.0, 61.0, 80.0] {
        for to in 0..=16 {
            for phi in 0..36 {
                let (wi, wo) = (
                    direction_deg(ti, 77.0),
                    direction_deg(5.0 * f64::from(to), 77.0 + 10.0 * f64::from(phi)),
                );
                assert!(table.bsdf(wi, wo, &mut a) && file.bsdf(wi, wo, &mut b), "{ti} {to} {phi}");
                worst = worst.max((a[band] - b[file_band]).abs() * wo.z);
                top = top.max(a[band] * wo.z);
            }
        }
    }
    worst / top
}

#[test]
fn a_written_sheet_is_read_back() {
    let sheet = Sheet::new(0.4, 0.1, 0.3);
    let file = written(&sheet);
    assert_eq!((file.description(), file.bands(), file.is_isotropic()), ("test", sheet.bands(), true));
    let e = largest_error(&sheet, &file, 1, 1);
    assert!(e < 0.01, "{e}");
    // A narrow retro lobe; its bands are put in order.
    let retro = retro();
    let file = written(&retro);
    assert_eq!(file.bands()[0].wavelength_nm, Some(440.0));
    let e = largest_error(&retro, &file, 0, 1);
    assert!(e < 0.05, "{e}");
}

#[test]
fn the_total_reflectance_survives() {
    for (name, table) in [
        ("lambert", &Sheet::new(0.2, 0.0, 0.0) as &dyn Directional),
        ("sheet", &Sheet::new(0.4, 0.1, 0.3)),
        ("retro", &retro()),
    ] {
        let file = written(table);
        // Bands of the retro table change places.
        let turned = name == "retro";
        for (t, tolerance) in [(0.0, 0.002), (30.0, 0.002), (60.0, 0.002), (75.0, 0.004), (85.0, 0.015)] {
            let wi = direction_deg(t, 10.0);
            let ours = directional_hemispherical(table, wi, Side::Adaxial, (100, 200));
            let theirs = directional_hemispherical(&file, wi, Side::Adaxial, (100, 200));
            let e = theirs[usize::from(turned)] / ours[0] - 1.0;
            assert!(e.abs() < tolerance, "{name} {t}: {e}");
        }
    }
}

#[test]
fn luminance_is_the_density_of_the_light() {
    let sheet = Sheet::new(0.4, 0.1, 0.0);
    let resolution = Resolution { lamps: 4, grid: 64 };
    let bytes = write(&sheet, resolution, "").unwrap();
    let fields = tensor::read(&bytes).unwrap();
    let values = super::super::numbers(&fields["luminance"], "luminance").unwrap();
    for (lamp, t) in [0.0, 30.0, 60.0].into_iter().enumerate() {
        // Its integral over the square is the light that leaves: the trapezoidal rule, for zeros stand at the rim.
        let sum: f64 = values[lamp * 4096..][..4096].iter().map(|v| f64::from(*v)).sum();
        let total = directional_hemispherical(&sheet, direction_deg(t, 0.0), Side::Adaxial, (40, 40));
        let expected = 0.5 * (total[0] + total[1]);
        assert!((sum / 63.0 / 63.0 / expected - 1.0).abs() < 0.05, "{t}: {} {expected}", sum / 63.0 / 63.0);
    }
}

#[test]
fn what_cannot_be_written_is_an_error() {
    let fails = |table: &dyn Directional, resolution: Resolution, word: &str| {
        let e = write(table, resolution, "").unwrap_err().to_string();
        assert!(e.contains(word), "{e}");
    };
    let small = Resolution { lamps: 3, grid: 8 };
    let mut sheet = Sheet::new(0.4, 0.1, 0.0);
    fails(&sheet, Resolution { lamps: 1, grid: 8 }, "1 lamps");
    fails(&sheet, Resolution { lamps: 3, grid: usize::MAX }, "8 to 1024 nodes");
    sheet.bands[1] = Band::named("CIE-Y");
    fails(&sheet, small, "band CIE-Y has no wavelength");
    sheet.bands[1] = Band::nm(450.0);
    fails(&sheet, small, "two bands at 450 nm");
    sheet.bands.clear();
    fails(&sheet, small, "no band");
    // One band and black are no errors.
    sheet.bands = vec![Band::nm(550.0)];
    assert_eq!(read(&write(&sheet, small, "").unwrap()).unwrap().bands().len(), 1);
    let black = read(&write(&Sheet::new(0.0, 0.0, 0.0), small, "").unwrap()).unwrap();
    let mut v = [1.0; 2];
    assert!(black.bsdf(direction_deg(20.0, 0.0), direction_deg(50.0, 9.0), &mut v) && v == [0.0; 2]);
}

/// An anisotropic table: its mean over the lamp's azimuth is Lambertian.
struct Brushed(Sheet);

impl Directional for Brushed {
    fn bands(&self) -> &[Band] {
        &self.0.bands
    }
    fn coverage(&self) -> Coverage {
        self.0.coverage()
    }
    fn is_isotropic(&self) -> bool {
        false
    }
    fn bsdf(&self, wi: DVec3, _: DVec3, values: &mut [f64]) -> bool {
        let phi = wi.y.atan2(wi.x);
        values.fill(0.1 * (1.0 + (2.0 * phi).cos()));
        true
    }
}

#[test]
fn anisotropic_tables_are_averaged() {
    let file = written(&Brushed(Sheet::new(0.0, 0.0, 0.0)));
    let mut v = [0.0; 2];
    assert!(file.bsdf(direction_deg(40.0, 0.0), direction_deg(30.0, 100.0), &mut v));
    assert!((v[0] - 0.1).abs() < 1e-4, "{v:?}");
}

/// Files for `scripts/foreign_rgl.py`, each with a list of directions: what the table is and what our reader says.
#[test]
#[ignore = "writes files for another program's reader"]
fn files_for_other_programs() {
    let folder =
        std::path::PathBuf::from(std::env::var("FOREIGN_RGL").unwrap_or("target/foreign_rgl".into()));
    std::fs::create_dir_all(&folder).unwrap();
    let save = |name: &str, bytes: &[u8], table: Option<&dyn Directional>| {
        let file = read(bytes).unwrap();
        let bands: Vec<f64> = file.bands().iter().map(|b| b.wavelength_nm.unwrap()).collect();
        let mut csv =
            String::from("wi_x,wi_y,wi_z,wo_x,wo_y,wo_z,wavelength_nm,source_per_sr,reader_per_sr\n");
        let unit = |i: u32| f64::from(crate::math::sampler::hash(i)) / f64::from(u32::MAX);
        // Pair 0 would be the normal itself, where the azimuth means nothing.
        for i in 1..=1000 {
            // Even in sin^2 theta up to 80 deg.
            let direction = |k: u32| {
                let theta = (unit(4 * i + k) * 80f64.to_radians().sin().powi(2)).sqrt().asin();
                direction_deg(theta.to_degrees(), 360.0 * unit(4 * i + k + 1))
            };
            let (wi, wo) = (direction(0), direction(2));
            let mut ours = vec![0.0; bands.len()];
            assert!(file.bsdf(wi, wo, &mut ours));
            let mut source = vec![f64::NAN; bands.len()];
            if let Some(table) = table {
                let mut values = vec![0.0; bands.len()];
                table.bsdf(wi, wo, &mut values);
                for (band, value) in table.bands().iter().zip(values) {
                    let at = bands.iter().position(|nm| Some(*nm) == band.wavelength_nm).unwrap();
                    source[at] = value;
                }
            }
            for ((nm, ours), source) in bands.iter().zip(ours).zip(source) {
                let [a, b, c] = wi.to_array();
                let [d, e, f] = wo.to_array();
                csv += &format!("{a},{b},{c},{d},{e},{f},{nm},{source},{ours}\n");
            }
        }
        std::fs::write(folder.join(format!("{name}.bsdf")), bytes).unwrap();
        std::fs::write(folder.join(format!("{name}.csv")), csv).unwrap();
    };
    let mut one = Sheet::new(0.5, 0.1, 0.0);
    one.bands = vec![Band::nm(550.0)];
    for (name, table) in [
        ("lambert", &Sheet::new(0.2, 0.0, 0.0) as &dyn Directional),
        ("sheet", &Sheet::new(0.4, 0.1, 0.3)),
        ("retro", &retro()),
        ("one_band", &one),
    ] {
        let bytes = write(table, Resolution::for_bands(table.bands().len()), name).unwrap();
        save(name, &bytes, Some(table));
    }
    for turns in [1, 2, 4] {
        save(&format!("anisotropic_{turns}"), &super::super::tests::anisotropic(turns), None);
    }
}

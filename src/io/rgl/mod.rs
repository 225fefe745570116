//! RGL `.bsdf`: a measured BRDF in the adaptive parameterisation, as Mitsuba's `measured` material reads it.
//!
//! Model: f cos(theta_o) = spectra(s) * ndf(u_m) / (4 sigma(u_i)), 1/sr, with the half vector m = (wi + wo) normalised,
//! its place u_m = (sqrt(2 theta_m / pi), (phi + pi) / 2 pi) on the unit square, s = inverse of the warp `vndf` at u_m,
//! and u_i the place of wi. phi is the azimuth of m, in isotropic files counted from that of wi. Without the flag
//! `jacobian` the factor ndf / (4 sigma) is left out.
//!
//! | symbol | field | shape | unit |
//! |---|---|---|---|
//! | lamp's nodes | `phi_i`, `theta_i` | 1 each | rad |
//! | wavelengths | `wavelengths` (or `rgb` in place of `spectra`) | 1 | nm |
//! | density of normals, times nothing | `ndf` | rows phi, columns theta | 1/sr |
//! | projected area of the normals | `sigma` | rows phi, columns theta | 1 |
//! | warp | `vndf` | phi_i, theta_i, rows, columns | any |
//! | values | `spectra` | phi_i, theta_i, wavelength, rows, columns | 1 |
//! | for sampling only | `luminance` | phi_i, theta_i, rows, columns | any |
//!
//! Limits: reflection of the adaxial side. Files of one or two lamp azimuths are isotropic; of a half or a quarter turn,
//! the lamp is mirrored into it. The cosine is divided out, so that next to the horizon (cos < 1e-4) values are held
//! down; negative values count as zero. Guarded by `evaluates_the_published_formula`, `half_and_quarter_turns_are_mirrored`
//! and `damaged_files_are_errors`; against Mitsuba by `scripts/foreign_rgl.py`. Source: Dupuy2018.

mod table;
mod tensor;
mod write;

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

use self::table::{Table, Warp};
use self::tensor::{F32, Field, U8};
pub use self::write::{Resolution, write};
use super::invalid;
use crate::Result;
use crate::gonio::{Band, Coverage, Directional};

/// What errors are said to be in.
const FORMAT: &str = "RGL bsdf";

/// A BRDF that was read from an RGL file.
#[derive(Clone, Debug, PartialEq)]
pub struct RglBrdf {
    description: String,
    bands: Vec<Band>,
    phis: Vec<f32>,
    thetas: Vec<f32>,
    ndf: Table,
    sigma: Table,
    vndf: Warp,
    spectra: Table,
    jacobian: bool,
}

/// Reads a file, spectral or RGB, isotropic or not.
pub fn read(bytes: &[u8]) -> Result<RglBrdf> {
    let fields = tensor::read(bytes)?;
    let phis = increasing(&fields, "phi_i")?;
    let thetas = increasing(&fields, "theta_i")?;
    let (values, bands) = if fields.contains_key("spectra") {
        let bands = increasing(&fields, "wavelengths")?.iter().map(|nm| Band::nm(f64::from(*nm))).collect();
        ("spectra", bands)
    } else {
        ("rgb", ["R", "G", "B"].map(Band::named).to_vec())
    };
    let lamps = [phis.len(), thetas.len()];
    let description = array(&fields, "description", U8)?;
    let jacobian = array(&fields, "jacobian", U8)?;
    let [jacobian] = jacobian.bytes[..] else {
        return Err(invalid(FORMAT, format_args!("jacobian has {} values, not 1", jacobian.bytes.len())));
    };
    Ok(RglBrdf {
        description: String::from_utf8_lossy(&description.bytes).into_owned(),
        ndf: table(&fields, "ndf", &[])?,
        sigma: table(&fields, "sigma", &[])?,
        vndf: Warp::new(table(&fields, "vndf", &lamps)?, "vndf")?,
        spectra: table(&fields, values, &[phis.len(), thetas.len(), bands.len()])?,
        bands,
        phis,
        thetas,
        jacobian: jacobian != 0,
    })
}

/// A field of the right type.
fn array<'a>(fields: &'a BTreeMap<String, Field<'a>>, name: &str, dtype: u8) -> Result<&'a Field<'a>> {
    let field = fields.get(name).ok_or_else(|| invalid(FORMAT, format_args!("{name} is missing")))?;
    if field.dtype != dtype {
        let what = format!("{name} has values of type {}, not {dtype}", field.dtype);
        return Err(invalid(FORMAT, what));
    }
    Ok(field)
}

/// Finite numbers.
fn numbers(field: &Field<'_>, name: &str) -> Result<Vec<f32>> {
    let values: Vec<f32> = field.bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    match values.iter().position(|v| !v.is_finite()) {
        Some(at) => Err(invalid(FORMAT, format_args!("{name}: value {at} is {}", values[at]))),
        None => Ok(values),
    }
}

/// Nodes of an axis.
fn increasing(fields: &BTreeMap<String, Field<'_>>, name: &str) -> Result<Vec<f32>> {
    let field = array(fields, name, F32)?;
    let nodes = numbers(field, name)?;
    if field.shape.len() != 1 || nodes.is_empty() || nodes.windows(2).any(|p| p[0] >= p[1]) {
        return Err(invalid(FORMAT, format_args!("{name} is not a list of increasing numbers")));
    }
    Ok(nodes)
}

/// A table of `slices` and two more dimensions, rows and columns.
fn table(fields: &BTreeMap<String, Field<'_>>, name: &str, slices: &[usize]) -> Result<Table> {
    let field = array(fields, name, F32)?;
    match field.shape.split_last_chunk::<2>() {
        Some((outer, &[rows, columns])) if outer == slices && rows >= 2 && columns >= 2 => {
            Ok(Table { columns, rows, values: numbers(field, name)? })
        }
        _ => {
            let what = format!("{name} has shape {:?}, not {slices:?} and at least 2 x 2", field.shape);
            Err(invalid(FORMAT, what))
        }
    }
}

/// Place of a polar angle and an azimuth on the unit square.
fn place(theta: f64, phi: f64) -> (f64, f64) {
    ((theta / FRAC_PI_2).sqrt(), (phi + PI) / TAU)
}

fn polar(w: DVec3) -> (f64, f64) {
    (w.x.hypot(w.y).atan2(w.z), w.y.atan2(w.x))
}

impl RglBrdf {
    /// What the file says of itself.
    pub fn description(&self) -> &str {
        &self.description
    }

    /// The lamp in the part of the circle that the file has, and the viewer mirrored with it.
    fn mirrored(&self, mut wi: DVec3, mut wo: DVec3) -> (DVec3, DVec3) {
        let span = f64::from(self.phis[self.phis.len() - 1] - self.phis[0]);
        let parts = if self.is_isotropic() { 1.0 } else { (TAU / span).round() };
        if parts >= 2.0 {
            // Files of half a turn have azimuths from -180 to 0 deg, of a quarter from -180 to -90. Zero counts as
            // positive, so that an azimuth of 0 becomes -180, not 180.
            let flip = |x: f64| if x.is_sign_negative() { 1.0 } else { -1.0 };
            let y = flip(wi.y);
            let x = if parts == 4.0 { flip(wi.x) } else { y };
            let mirror = DVec3::new(x, y, 1.0);
            (wi, wo) = (wi * mirror, wo * mirror);
        }
        (wi, wo)
    }
}

impl Directional for RglBrdf {
    fn bands(&self) -> &[Band] {
        &self.bands
    }

    fn coverage(&self) -> Coverage {
        Coverage { reflection_adaxial: true, ..Coverage::default() }
    }

    fn is_isotropic(&self) -> bool {
        self.phis.len() <= 2
    }

    fn bsdf(&self, wi: DVec3, wo: DVec3, values: &mut [f64]) -> bool {
        values.fill(0.0);
        if !(wi.z > 0.0 && wo.z > 0.0) {
            return false;
        }
        let (wi, wo) = self.mirrored(wi, wo);
        let ((theta_i, phi_i), (theta_m, phi_m)) = (polar(wi), polar((wi + wo).normalize_or_zero()));
        let (x, y) = place(theta_m, if self.is_isotropic() { phi_m - phi_i } else { phi_m });
        let y = y - y.floor();
        let lamp = table::lamp(&self.phis, &self.thetas, phi_i, theta_i);
        let Some((s, t)) = self.vndf.invert(&lamp, x, y) else { return false };
        let factor = if self.jacobian {
            let (ui, vi) = place(theta_i, phi_i);
            self.ndf.eval([(0, 1.0)], x, y) / (4.0 * self.sigma.eval([(0, 1.0)], ui, vi))
        } else {
            1.0
        };
        // A file may say that no normal faces the lamp.
        if !(factor.is_finite() && factor >= 0.0) {
            return false;
        }
        let bands = self.bands.len();
        for (band, v) in values.iter_mut().enumerate().take(bands) {
            let slices = lamp.map(|(slice, weight)| (slice * bands + band, weight));
            *v = (self.spectra.eval(slices, s, t) * factor / wo.z.max(1e-4)).max(0.0);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::measurement::direction_deg;
    use crate::io::damage::damage;
    use crate::math::sampler::hash;

    /// Fields of a file whose numbers are all random, with the lamp's azimuths over one `turns`th of the circle.
    fn fields(turns: usize) -> Vec<(&'static str, Field<'static>)> {
        let random = |seed: u32, shape: &[usize]| {
            let n = shape.iter().product::<usize>() as u32;
            let values: Vec<f32> =
                (0..n).map(|i| 0.5 + (hash(i + 1000 * seed) >> 8) as f32 / 1.7e7).collect();
            Field::f32s(shape, &values)
        };
        let phis: Vec<f32> = (0..4).map(|i| (-PI + TAU * f64::from(i) / 3.0 / turns as f64) as f32).collect();
        vec![
            ("description", Field::u8s(b"random numbers")),
            ("phi_i", Field::f32s(&[4], &phis)),
            ("theta_i", Field::f32s(&[3], &[0.0, 0.6, 1.5])),
            ("wavelengths", Field::f32s(&[2], &[500.0, 600.0])),
            ("ndf", random(1, &[5, 4])),
            ("sigma", random(2, &[6, 5])),
            ("vndf", random(3, &[4, 3, 6, 7])),
            ("luminance", random(4, &[4, 3, 8, 8])),
            ("spectra", random(5, &[4, 3, 2, 8, 8])),
            ("jacobian", Field::u8s(&[1])),
        ]
    }

    pub(super) fn anisotropic(turns: usize) -> Vec<u8> {
        tensor::write(&fields(turns))
    }

    /// `fields(1)` with one of them replaced.
    fn with(name: &'static str, field: Field<'static>) -> Vec<u8> {
        let mut fields = fields(1);
        fields.iter_mut().filter(|f| f.0 == name).for_each(|f| f.1 = field.clone());
        tensor::write(&fields)
    }

    #[test]
    fn evaluates_the_published_formula() {
        // No warp, ndf 3, sigma 2, spectra that grow with column, row, lamp angle and band.
        let spectra: Vec<f32> = (0..2 * 2 * 16)
            .map(|i| (i % 4) as f32 / 3.0 + (i / 4 % 4) as f32 * 10.0 / 3.0 + (i / 16) as f32 * 100.0)
            .collect();
        let file = |jacobian: u8| {
            tensor::write(&[
                ("description", Field::u8s(b"x")),
                ("phi_i", Field::f32s(&[1], &[0.0])),
                ("theta_i", Field::f32s(&[2], &[0.0, 1.0])),
                ("wavelengths", Field::f32s(&[2], &[500.0, 600.0])),
                ("ndf", Field::f32s(&[2, 2], &[3.0; 4])),
                ("sigma", Field::f32s(&[2, 2], &[2.0; 4])),
                ("vndf", Field::f32s(&[1, 2, 2, 2], &[0.7; 8])),
                ("spectra", Field::f32s(&[1, 2, 2, 4, 4], &spectra)),
                ("jacobian", Field::u8s(&[jacobian])),
            ])
        };
        let (wi, wo) = (direction_deg(30.0, 200.0), direction_deg(50.0, 290.0));
        let m = (wi + wo).normalize();
        let x = (m.z.acos() * 2.0 / PI).sqrt();
        let y = (m.y.atan2(m.x).rem_euclid(TAU) - 200f64.to_radians() + PI) / TAU;
        let mut v = [0.0; 2];
        for (jacobian, factor) in [(0, 1.0), (1, 3.0 / 8.0)] {
            let brdf = read(&file(jacobian)).unwrap();
            assert!(brdf.bsdf(wi, wo, &mut v) && brdf.is_isotropic());
            for (band, v) in v.iter().enumerate() {
                let spectra = x + 10.0 * y + 200.0 * 30f64.to_radians() + 100.0 * band as f64;
                let expected = spectra * factor / wo.z;
                assert!((v / expected - 1.0).abs() < 1e-5, "{band}: {v} {expected}");
            }
        }
        assert!(!read(&file(1)).unwrap().bsdf(wi, -wo, &mut v) && v == [0.0; 2]);
    }

    #[test]
    fn half_and_quarter_turns_are_mirrored() {
        let value = |brdf: &RglBrdf, wi: DVec3, wo: DVec3| {
            let mut v = [0.0; 2];
            assert!(brdf.bsdf(wi, wo, &mut v));
            v
        };
        let (wi, wo) = (direction_deg(50.0, 215.0), direction_deg(30.0, 100.0));
        for (turns, mirrors) in [(2, vec![[-1.0, -1.0]]), (4, vec![[-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])] {
            let brdf = read(&anisotropic(turns)).unwrap();
            assert!(!brdf.is_isotropic());
            // Azimuth 0 stands at the first node, -180 deg, not at the last.
            let (ahead, back) = (direction_deg(50.0, 0.0), DVec3::new(-50f64.to_radians().sin(), -0.0, wi.z));
            assert_eq!(value(&brdf, ahead, wo), value(&brdf, back, DVec3::new(-1.0, -1.0, 1.0) * wo));
            for [x, y] in mirrors {
                let mirror = DVec3::new(x, y, 1.0);
                assert_eq!(value(&brdf, wi, wo), value(&brdf, mirror * wi, mirror * wo), "{turns} {mirror}");
            }
        }
        let whole = read(&anisotropic(1)).unwrap();
        assert_ne!(value(&whole, wi, wo), value(&whole, DVec3::new(-1.0, -1.0, 1.0) * wi, wo));
    }

    #[test]
    fn rgb_files_are_read() {
        let mut all = fields(1);
        all.retain(|f| f.0 != "wavelengths" && f.0 != "spectra");
        all.push(("rgb", Field::f32s(&[4, 3, 3, 2, 2], &[1.0; 144])));
        let brdf = read(&tensor::write(&all)).unwrap();
        assert_eq!(brdf.bands()[2], Band::named("B"));
    }

    #[test]
    fn damaged_files_are_errors() {
        let valid = anisotropic(1);
        damage(&valid, 400, |bytes| {
            if let Ok(brdf) = read(bytes) {
                let mut v = vec![0.0; brdf.bands().len()];
                brdf.bsdf(direction_deg(30.0, 10.0), direction_deg(80.0, 50.0), &mut v);
                assert!(v.iter().all(|v| *v >= 0.0 && v.is_finite()), "{v:?}");
            }
        });
        let fails = |bytes: &[u8], word: &str| {
            let e = read(bytes).unwrap_err().to_string();
            assert!(e.contains(word), "{e}");
        };
        for name in
            ["phi_i", "theta_i", "wavelengths", "ndf", "sigma", "vndf", "spectra", "jacobian", "description"]
        {
            let mut without = fields(1);
            without.retain(|f| f.0 != name);
            let missing = if name == "spectra" { "rgb" } else { name };
            fails(&tensor::write(&without), &format!("{missing} is missing"));
        }
        fails(&with("theta_i", Field::f32s(&[3], &[0.0, 1.0, 1.0])), "theta_i is not a list of increasing");
        fails(&with("theta_i", Field::f32s(&[2], &[0.0, 1.0])), "vndf has shape [4, 3, 6, 7]");
        fails(&with("theta_i", Field::u8s(&[0, 1, 2])), "theta_i has values of type 1, not 10");
        fails(&with("sigma", Field::f32s(&[1, 4], &[1.0; 4])), "at least 2 x 2");
        fails(&with("ndf", Field::f32s(&[2, 2], &[1.0, 1.0, f32::NAN, 1.0])), "ndf: value 2 is NaN");
        fails(&with("vndf", Field::f32s(&[4, 3, 2, 2], &[0.0; 48])), "vndf: slice 0 integrates to 0");
        fails(&with("jacobian", Field::u8s(&[1, 1])), "jacobian has 2 values");
    }
}

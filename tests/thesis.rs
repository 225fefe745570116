//! The thesis' claims on its own petal: geometry, retro-reflection, and stochastic sampling.

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::{Mat3, UVec2, Vec3};
use rosarium::bsdf::{Bsdf, Phong, Scatter};
use rosarium::gonio::{Estimate, GonioTable, Goniophotometer};
use rosarium::math::Sampler;
use rosarium::math::frame::spherical;
use rosarium::math::stats::{Welford, sidak, z_test};
use rosarium::micro::shading::{CellPetal, Footprint, Layer};
use rosarium::micro::{CellDescription, CellField, Profile};
use rosarium::scene::MemoryAssets;
use rosarium::scene::description::PetalDescription;
use rosarium::spectrum::{LANES, SampledSpectrum, SampledWavelengths};
use rosarium::validate;

fn thesis() -> PetalDescription {
    PetalDescription::default()
}

fn compile(d: &PetalDescription) -> CellPetal {
    d.compile("", &MemoryAssets::default()).unwrap()
}

fn measure(petal: &dyn Scatter, incident_deg: &[f64], rays: u64) -> GonioTable {
    let instrument = Goniophotometer {
        incident_deg: incident_deg.to_vec(),
        rays,
        bands_nm: vec![620.0],
        ..Default::default()
    };
    instrument.measure(petal, &|_, _| ControlFlow::Continue(())).unwrap()
}

fn lambda() -> SampledWavelengths {
    SampledWavelengths::given([620.0; LANES])
}

/// Mean of the estimate of f over `n` samples of `points` points.
fn estimate(petal: &CellPetal, wo: Vec3, wi: Vec3, points: u32, n: u32, seed: u64) -> Welford {
    let mut mean = Welford::default();
    for i in 0..n {
        let mut sampler = Sampler::new(seed, UVec2::ZERO, i);
        let f = petal.estimate(wo, wi, &lambda(), Footprint::WIDE, points, &mut sampler);
        mean.push(f64::from(f[0]));
    }
    mean
}

#[test]
fn cells_have_the_published_size() {
    let d = CellDescription::default();
    assert_eq!((d.pitch_um, d.height_um), (23.0, 37.0));
    let cells = CellField::new(&d).unwrap();
    let hexagon = 3f64.sqrt() / 2.0 * 23.0 * 23.0;
    assert!((cells.cell_area_um2(0) - hexagon).abs() < 1e-9);
    assert!((cells.max_height_um() - 37.0).abs() < 1e-12);
}

#[test]
fn petals_send_light_back_to_the_lamp_and_flat_phong_does_not() {
    let mut d = thesis();
    let domes = measure(&compile(&d), &[60.0], 200_000).summary().incidences[0].mean.retro_index.unwrap();
    d.cells.profile = Profile::Flat;
    let flat = measure(&compile(&d), &[60.0], 200_000).summary().incidences[0].mean.retro_index.unwrap();
    assert!(domes > 1.5, "{domes}");
    assert!(flat < 0.9, "{flat}");
}

#[test]
fn retro_index_grows_with_incidence_for_every_profile() {
    for profile in
        [Profile::Cosine, Profile::CosineInner, Profile::RaisedCosine, Profile::Paraboloid, Profile::Cone]
    {
        let cells = CellField::new(&CellDescription { profile, ..CellDescription::default() }).unwrap();
        let petal = CellPetal::lambert(Arc::new(cells), 0.5.into()).unwrap();
        let table = measure(&petal, &[30.0, 60.0, 75.0], 100_000);
        let index: Vec<f64> =
            table.summary().incidences.iter().map(|i| i.mean.retro_index.unwrap()).collect();
        assert!(1.2 < index[0] && index[0] < index[1] && index[1] < index[2], "{profile:?} {index:?}");
    }
}

/// A sample turned about its normal, so that the lamp's azimuth is `degrees` from the lattice's rows.
struct Turned(CellPetal, Mat3);

impl Scatter for Turned {
    fn scatter(
        &self,
        wi: Vec3,
        lambda: &SampledWavelengths,
        sampler: &mut Sampler,
    ) -> Option<(Vec3, SampledSpectrum)> {
        let (wo, weight) = self.0.scatter(self.1 * wi, lambda, sampler)?;
        Some((self.1.transpose() * wo, weight))
    }
}

/// Along its rows a regular lattice lets more light on towards the mirror than across them.
#[test]
fn a_regular_lattice_has_a_direction() {
    let index = |degrees: f32| {
        let petal = Turned(compile(&thesis()), Mat3::from_rotation_z(degrees.to_radians()));
        measure(&petal, &[75.0], 200_000).incidences[0].mean.retro_index.unwrap()
    };
    let (along, across, again) = (index(0.0), index(30.0), index(60.0));
    let apart = |a: Estimate, b: Estimate| (a.value - b.value) / a.standard_error.hypot(b.standard_error);
    assert!(apart(across, along) > 4.0, "{along:?} {across:?}");
    // The lattice has six rows through each cell.
    assert!(apart(again, along).abs() < 3.0, "{along:?} {again:?}");
}

#[test]
fn white_domes_lose_no_light_and_grey_domes_trap_it() {
    let cells = Arc::new(CellField::new(&CellDescription::default()).unwrap());
    for (albedo, low, high) in [(1.0, 0.9999, 1.0001), (0.5, 0.15, 0.45)] {
        let petal = CellPetal::lambert(cells.clone(), albedo.into()).unwrap();
        for i in measure(&petal, &[0.0, 60.0, 80.0], 50_000).summary().incidences {
            assert!((low..high).contains(&i.mean.reflectance), "{albedo} {}", i.mean.reflectance);
        }
    }
}

#[test]
fn energy_is_accounted_for_on_both_sides() {
    for side in [rosarium::geometry::Side::Adaxial, rosarium::geometry::Side::Abaxial] {
        let instrument =
            Goniophotometer { rays: 50_000, side, bands_nm: vec![450.0, 550.0, 650.0], ..Default::default() };
        let table = instrument.measure(&compile(&thesis()), &|_, _| ControlFlow::Continue(())).unwrap();
        assert!(table.ledger_error() < 1e-9, "{}", table.ledger_error());
        for i in table.summary().incidences {
            assert!(i.mean.absorptance > 0.0 && i.mean.transmittance > 0.0);
        }
    }
    let report = validate::check_scatter("petal", &compile(&thesis()), &validate::Settings::default());
    assert!(report.passed(), "{report:?}");
}

/// Each bin of the table, against the mean of estimates for directions spread over the bin.
#[test]
fn estimate_converges_to_the_table() {
    let petal = compile(&thesis());
    let incident = 45.0f64;
    let table = measure(&petal, &[incident], 1_000_000);
    let lamp = spherical(incident.to_radians() as f32, 0.0);
    let incidence = &table.incidences[0];
    let grid = &table.grid;
    let mut tests = 0;
    let mut worst = f64::INFINITY;
    let bins: Vec<usize> = (0..grid.len())
        .filter(|&b| grid.centre_deg(b).0 < 80.0 || grid.centre_deg(b).0 > 100.0)
        .step_by(7)
        .collect();
    for &bin in &bins {
        let (low, high) = grid.theta_limits_deg(bin);
        let (_, phi) = grid.centre_deg(bin);
        let phi_step = 360.0 / grid.phis() as f64;
        let mut mean = Welford::default();
        for i in 0..4000 {
            let mut sampler = Sampler::new(77, UVec2::new(bin as u32, 0), i);
            // The table's mean over a bin is weighed by the projected solid angle: uniform in sin^2 theta.
            let u = sampler.next_2d().as_dvec2();
            let sin2 = |deg: f64| deg.to_radians().sin().powi(2);
            let s2 = sin2(low) + (sin2(high) - sin2(low)) * u.x;
            let mut theta = s2.sqrt().asin();
            if low >= 90.0 {
                theta = std::f64::consts::PI - theta;
            }
            let phi = (phi + (u.y - 0.5) * phi_step).to_radians();
            let viewer = spherical(theta as f32, phi as f32);
            let f = petal.estimate(viewer, lamp, &lambda(), Footprint::WIDE, 4, &mut sampler);
            mean.push(f64::from(f[0]));
        }
        let measured = incidence.bsdf[bin];
        let variance = mean.standard_error().powi(2) + measured.standard_error.powi(2);
        worst = worst.min(z_test(mean.mean() - measured.value, variance).p_value);
        tests += 1;
    }
    assert!(tests > 50);
    assert!(worst > sidak(0.01, tests), "p = {worst} in {tests} bins");
}

#[test]
fn estimate_is_reciprocal() {
    let petal = compile(&thesis());
    let pairs = [(0.3, 0.2, 1.2, 2.0), (1.0, 0.0, 1.0, 3.1), (1.3, 0.0, 0.4, 0.3), (0.1, 1.0, 0.8, 5.0)];
    for (k, (theta_a, phi_a, theta_b, phi_b)) in pairs.into_iter().enumerate() {
        let (a, b) = (spherical(theta_a, phi_a), spherical(theta_b, phi_b));
        let there = estimate(&petal, a, b, 4, 20_000, 1);
        let back = estimate(&petal, b, a, 4, 20_000, 2);
        let variance = there.standard_error().powi(2) + back.standard_error().powi(2);
        let p = z_test(there.mean() - back.mean(), variance).p_value;
        assert!(p > sidak(0.01, pairs.len()), "pair {k}: {} {} p = {p}", there.mean(), back.mean());
        assert!(there.standard_error() < 0.02 * there.mean());
    }
    // Through the sheet and below it the value is closed.
    let (up, down) = (spherical(0.5, 0.0), spherical(2.5, 1.0));
    let value = |a, b| estimate(&petal, a, b, 1, 1, 0).mean();
    assert_eq!(value(up, down), value(down, up));
    assert!(value(down, spherical(2.0, 2.0)) > 0.0);
}

#[test]
fn flat_cells_are_two_phongs() {
    let cells =
        CellField::new(&CellDescription { profile: Profile::Flat, ..CellDescription::default() }).unwrap();
    let layer = |kd: f32, ks: f32, exponent| Layer {
        diffuse: kd.into(),
        specular: ks.into(),
        exponent,
        transmittance: 0.5.into(),
    };
    let petal =
        CellPetal::new(Arc::new(cells), &layer(0.1, 0.2, 15.0), &layer(0.3, 0.1, 2.0), 0.4.into()).unwrap();
    let (e, s) =
        (Phong::new(0.1.into(), 0.2.into(), 15.0).unwrap(), Phong::new(0.3.into(), 0.1.into(), 2.0).unwrap());
    for i in 0..50 {
        let (wo, wi) = (spherical(0.03 * i as f32, 0.0), spherical(1.0, 0.3 * i as f32));
        let exact = (e.eval(wo, wi, &lambda()) + s.eval(wo, wi, &lambda()))[0];
        let got = estimate(&petal, wo, wi, 3, 1, 4).mean();
        assert!((got / f64::from(exact) - 1.0).abs() < 1e-4, "{got} {exact}");
    }
}

/// Same mean, but with few points most hits miss the highlight and the median is darker.
#[test]
fn few_points_are_duller() {
    let petal = compile(&thesis());
    let (wo, wi) = (spherical(0.2, 0.0), spherical(0.9, 1.0));
    let statistics = |points| {
        let mut values: Vec<f64> = (0..4001)
            .map(|i| {
                let mut sampler = Sampler::new(8, UVec2::new(i, 0), 0);
                f64::from(petal.estimate(wo, wi, &lambda(), Footprint::WIDE, points, &mut sampler)[0])
            })
            .collect();
        values.sort_by(f64::total_cmp);
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let spread = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt();
        (values[2000] / mean, spread / mean, mean)
    };
    let (few, many) = (statistics(1), statistics(64));
    assert!((few.2 / many.2 - 1.0).abs() < 0.1, "the mean does not depend on the number: {few:?} {many:?}");
    assert!(few.0 < 0.95 && many.0 > 0.97, "medians over means {few:?} {many:?}");
    assert!(few.1 > 4.0 * many.1, "spreads {few:?} {many:?}");
}

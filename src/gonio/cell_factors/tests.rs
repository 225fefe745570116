use std::sync::Arc;

use super::*;
use crate::gonio::measurement::direction_deg;
use crate::math::Sampler;
use crate::math::quadrature::GaussLegendre;
use crate::math::sampler::hash_to_unit;
use crate::math::stats::{normal_quantile, sidak};
use crate::micro::Profile;
use crate::micro::shading::{CellPetal, Footprint, Layer};
use crate::spectrum::SampledWavelengths;

fn settings(points: u32, first: [usize; 3], later: [usize; 3]) -> FactorSettings {
    let nodes = |[thetas, ratios, azimuths]: [usize; 3]| AngleNodes { thetas, ratios, azimuths };
    FactorSettings { points, facets: points / 32, seed: 7, first: nodes(first), later: nodes(later) }
}

fn compute(cells: &CellDescription, settings: &FactorSettings) -> CellFactors {
    CellFactors::compute(cells, settings, &|_, _| ControlFlow::Continue(())).unwrap()
}

fn small() -> CellFactors {
    compute(&CellDescription::default(), &settings(64, [4, 4, 4], [4, 4, 4]))
}

fn petal(cells: &CellDescription, kd: f64, ks: f64, n: f64) -> CellPetal {
    let layer = |kd: f64, ks: f64, n: f64| Layer {
        diffuse: (kd as f32).into(),
        specular: (ks as f32).into(),
        exponent: n as f32,
        transmittance: 0.0.into(),
    };
    let field = Arc::new(CellField::new(cells).unwrap());
    CellPetal::new(field, &layer(kd, ks, n), &layer(0.0, 0.0, 1.0), 0.0.into()).unwrap()
}

/// Mean over the lattice's azimuth and both senses, with its standard error.
fn estimate(petal: &CellPetal, (i, o, phi): (f64, f64, f64), points: u32) -> (f64, f64) {
    let lambda = SampledWavelengths::visible(0.5);
    let turns = 48;
    let values: Vec<f64> = (0..turns)
        .map(|t| {
            let turn = 360.0 * hash_to_unit(1000 + t);
            let phi = if t % 2 == 0 { phi } else { -phi };
            let [wi, wo] = [(i, turn), (o, turn + phi)].map(|(t, p)| direction_deg(t, p).as_vec3());
            let mut sampler = Sampler::new(77, glam::UVec2::new(3, t), 0);
            f64::from(petal.estimate(wo, wi, &lambda, Footprint::WIDE, points, &mut sampler)[0])
        })
        .collect();
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let square = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n * (n - 1.0));
    (mean, square.sqrt())
}

/// Table against petal at pseudo-random geometries and coefficients.
fn compare(cells: &CellDescription, seed: u32) {
    let table = compute(cells, &settings(2048, [14, 8, 11], [7, 5, 6]));
    let rounds = 12;
    let mut bounds = Vec::new();
    let z_limit = -normal_quantile(sidak(0.001, 4 * rounds as usize) / 2.0);
    for round in 0..rounds {
        let u = |k: u32| hash_to_unit(seed + 100 * round + k);
        let (i, o, phi) = (80.0 * u(0), 80.0 * u(1), 180.0 * u(2));
        let (kd, ks, n) = (0.9 * u(3), 0.3 * u(4), 2.0 * 50f64.powf(u(5)));
        let kd = kd.min(0.95 - ks);
        let (expected, noise) = estimate(&petal(cells, kd, ks, n), (i, o, phi), 256);
        let (wi, wo) = (direction_deg(i, 0.0), direction_deg(o, phi));
        let factors = table.factors(&[(wi, wo, 1.0)]);
        let (f, diffuse) = (factors.eval(kd, ks, n).f, factors.eval(kd, 0.0, n).f);
        let error = table.standard_error(wi, wo, kd, ks, n).hypot(noise);
        let rung = ((2.0 * n.log2()).round() as usize).min(EXPONENTS - 1);
        let of = table.interpolation_error();
        let lobe = (f - diffuse).abs().max(ks / std::f64::consts::PI);
        let between = 3.0 * (of.diffuse * diffuse + of.specular[rung] * lobe);
        assert!(
            (f - expected).abs() < z_limit * error + between,
            "{:?} at {i:.1} {o:.1} {phi:.1}, kd {kd:.3} ks {ks:.3} n {n:.1}: {f} +- {error}, {between}; {expected}",
            cells.profile
        );
        bounds.push((error + between) / expected);
    }
    // The bounds mean something.
    bounds.sort_by(f64::total_cmp);
    assert!(bounds[bounds.len() / 2] < 0.35, "{bounds:?}");
}

#[test]
fn agrees_with_the_petal() {
    compare(&CellDescription::default(), 1);
    compare(&CellDescription { profile: Profile::CosineInner, height_um: 15.0, ..Default::default() }, 2);
}

#[test]
fn agrees_with_a_disordered_petal() {
    let disorder = CellDescription {
        profile: Profile::Papilla,
        height_um: 20.0,
        center_disorder: 0.1,
        height_disorder: 0.15,
        tile_cells: 8,
        ..Default::default()
    };
    compare(&disorder, 3);
    compare(&CellDescription { tilt_disorder_deg: 5.0, profile: Profile::RaisedCosine, ..disorder }, 4);
}

#[test]
fn flat_cells_are_closed_forms() {
    let cells = CellDescription { profile: Profile::Flat, ..Default::default() };
    let table = compute(&cells, &settings(64, [5, 4, 5], [4, 4, 4]));
    for (i, o, phi) in [(0.0, 0.0, 0.0), (40.0, 41.0, 179.0), (70.0, 20.0, 100.0), (85.0, 60.0, 30.0)] {
        let (wi, wo) = (direction_deg(i, 0.0), direction_deg(o, phi));
        let cos = DVec3::new(-wi.x, -wi.y, wi.z).dot(wo).max(0.0);
        for (kd, ks, n) in [(0.5, 0.3, 100.0), (0.1, 0.9, 1.0), (0.0, 0.2, 17.3)] {
            let exact = (kd + ks * (n + 2.0) * 0.5 * cos.powf(n)) * std::f64::consts::FRAC_1_PI;
            let f = table.factors(&[(wi, wo, 1.0)]).eval(kd, ks, n).f;
            assert!((f - exact).abs() < 1e-5 * exact.max(0.01), "{i} {o} {phi}: {f} {exact}");
        }
    }
}

/// More points, less noise; and the noise that is told is the noise between seeds.
#[test]
fn noise_is_what_it_says() {
    let cells = CellDescription::default();
    let of =
        |points, seed| compute(&cells, &FactorSettings { seed, ..settings(points, [8, 6, 7], [5, 4, 4]) });
    let (few, many) = (of(256, 1), of(4096, 1));
    assert!(many.relative_noise(0.4, 0.1, 10.0) < 0.5 * few.relative_noise(0.4, 0.1, 10.0));
    let tables: Vec<CellFactors> = (0..8).map(|seed| of(256, seed)).collect();
    let (mut told, mut seen) = (0.0, 0.0);
    for k in 0..30 {
        let u = |j: u32| hash_to_unit(50 * k + j);
        let (wi, wo) = (direction_deg(75.0 * u(0), 0.0), direction_deg(75.0 * u(1), 180.0 * u(2)));
        let values: Vec<f64> =
            tables.iter().map(|t| t.factors(&[(wi, wo, 1.0)]).eval(0.4, 0.1, 10.0).f).collect();
        let mean = values.iter().sum::<f64>() / 8.0;
        seen += values.iter().map(|v| (v / mean - 1.0).powi(2)).sum::<f64>() / 7.0;
        told += (few.standard_error(wi, wo, 0.4, 0.1, 10.0) / mean).powi(2);
    }
    // Never too small; errors of parts are added as if they went together, so it may be too large.
    let ratio = (told / seen).sqrt();
    assert!((0.8..3.0).contains(&ratio), "{ratio}");
}

/// Integral of the table over the hemisphere against walks that leave the domes.
#[test]
fn albedo_is_the_goniophotometers() {
    let cells = CellDescription::default();
    let table = compute(&cells, &settings(4096, [14, 8, 11], [7, 5, 6]));
    let lambda = SampledWavelengths::visible(0.5);
    for (theta, kd, ks, n) in [(20.0, 0.6, 0.2, 8.0), (60.0, 0.95, 0.0, 1.0), (60.0, 0.2, 0.3, 20.0)] {
        let wi = direction_deg(theta, 0.0);
        let mut albedo = 0.0;
        for (s2, w) in GaussLegendre::new(16).on(0.0, 1.0) {
            for k in 0..24 {
                let phi = (f64::from(k) + 0.5) * 7.5;
                let wo = direction_deg(s2.sqrt().asin().to_degrees(), phi);
                let f = table.factors(&[(wi, wo, 1.0)]).eval(kd, ks, n).f;
                albedo += w * std::f64::consts::PI / 24.0 * f;
            }
        }
        let petal = petal(&cells, kd, ks, n);
        let walks = 30_000;
        let weights: Vec<f64> = (0..walks)
            .map(|k| {
                let wi = direction_deg(theta, 360.0 * hash_to_unit(k)).as_vec3();
                let mut sampler = Sampler::new(3, glam::UVec2::ONE, k);
                petal
                    .scatter_at(wi, &lambda, Footprint::WIDE, &mut sampler)
                    .map_or(0.0, |s| f64::from(s.1[0]))
            })
            .collect();
        let mean = weights.iter().sum::<f64>() / f64::from(walks);
        let error = (weights.iter().map(|w| (w - mean).powi(2)).sum::<f64>()).sqrt() / f64::from(walks);
        assert!(
            (albedo - mean).abs() < 4.0 * error + 0.01 * mean,
            "{theta} {kd} {ks}: {albedo} {mean} +- {error}"
        );
    }
}

#[test]
fn reciprocal_to_the_bit() {
    let table = small();
    for k in 0..20 {
        let u = |j: u32| hash_to_unit(50 * k + j);
        let (a, b) = (direction_deg(88.0 * u(0), 360.0 * u(1)), direction_deg(88.0 * u(2), 360.0 * u(3)));
        let [f, g] = [(a, b, 1.0), (b, a, 1.0)].map(|pair| table.factors(&[pair]).eval(0.4, 0.2, 9.0).f);
        assert_eq!(f.to_bits(), g.to_bits());
    }
}

#[test]
fn same_bytes_at_any_thread_count() {
    let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
    let [one, three] = [1, 3].map(|n| pool(n).install(small).to_bytes());
    assert_eq!(one, three);
    let other = FactorSettings { seed: 8, ..*small().settings() };
    assert_ne!(one, compute(&CellDescription::default(), &other).to_bytes());
}

#[test]
fn scale_does_not_matter() {
    let table = small();
    let cells = CellDescription { pitch_um: 46.0, height_um: 74.0, ..Default::default() };
    let double = compute(&cells, table.settings());
    for k in 0..10 {
        let u = |j: u32| hash_to_unit(50 * k + j);
        let pair = (direction_deg(80.0 * u(0), 0.0), direction_deg(80.0 * u(1), 180.0 * u(2)), 1.0);
        let [f, g] = [&table, &double].map(|t| t.factors(&[pair]).eval(0.4, 0.2, 9.0).f);
        assert!((f / g - 1.0).abs() < 1e-4, "{f} {g}");
    }
}

#[test]
fn interpolation_error_warns() {
    let low = CellDescription { height_um: 2.0, ..Default::default() };
    let settings = settings(1024, [8, 6, 8], [4, 4, 4]);
    let [low, domes] = [low, CellDescription::default()].map(|c| compute(&c, &settings).interpolation);
    // n = 2, then n = 256, narrower than 10 degrees.
    assert!(low.specular[16] > 0.3 && low.specular[2] < 0.1, "{low:?}");
    assert!(domes.specular[2] < 0.1 && domes.diffuse < 0.1, "{domes:?}");
}

#[test]
fn stops_when_asked_and_refuses_nonsense() {
    let cells = CellDescription::default();
    let stopped = CellFactors::compute(&cells, &small().settings, &|_, _| ControlFlow::Break(()));
    assert!(matches!(stopped, Err(Error::Cancelled)));
    for (bad, key) in [
        (settings(0, [4; 3], [4; 3]), "factors.points"),
        (settings(64, [3, 4, 4], [4; 3]), "factors.first.thetas"),
        (settings(64, [4; 3], [4, 4, 65]), "factors.later.azimuths"),
    ] {
        let error = bad.validate().expect_err(key).to_string();
        assert!(error.starts_with(key), "{error}");
    }
    let bad = CellDescription { pitch_um: -1.0, ..cells };
    assert!(CellFactors::compute(&bad, &small().settings, &|_, _| ControlFlow::Continue(())).is_err());
}

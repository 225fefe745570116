use std::sync::Arc;

use glam::UVec2;

use super::super::Layer;
use super::*;
use crate::math::frame::spherical;
use crate::math::stats::{Welford, sidak, z_test};
use crate::micro::dome::Profile;
use crate::micro::{CellDescription, CellField};
use crate::spectrum::LANES;

fn petal(cells: CellDescription, (kd, ks): (f32, f32), exponent: f32) -> CellPetal {
    let layer = |kd: f32, ks: f32| Layer {
        diffuse: kd.into(),
        specular: ks.into(),
        exponent,
        transmittance: 0.4.into(),
    };
    CellPetal::new(Arc::new(CellField::new(&cells).unwrap()), &layer(kd, ks), &layer(0.0, 0.0), 0.1.into())
        .unwrap()
}

fn of(profile: Profile) -> CellDescription {
    CellDescription { profile, ..CellDescription::default() }
}

/// Estimates by `points`, each from numbers of its own.
fn estimates(
    petal: &CellPetal,
    pair: (Vec3, Vec3),
    footprint: Footprint,
    points: Points,
    n: u32,
    key: u32,
) -> Welford {
    let lambda = SampledWavelengths::given([550.0; LANES]);
    let mut mean = Welford::default();
    for k in 0..n {
        let mut sampler = Sampler::new(3, UVec2::new(k, key), 0);
        let f = petal.estimate(pair.0, pair.1, &lambda, footprint, points, &mut sampler);
        mean.push(f64::from(f[0]));
    }
    mean
}

const PAIRS: [(f32, f32, f32, f32); 5] = [
    (0.2, 0.0, 0.9, 1.0),
    (0.7, 0.0, 0.7, std::f32::consts::PI),
    (1.3, 0.0, 0.5, 0.4),
    (0.05, 0.0, 1.4, 2.0),
    (0.0, 0.0, 0.0, 0.0),
];

fn pair((a, b, c, d): (f32, f32, f32, f32)) -> (Vec3, Vec3) {
    (spherical(a, b), spherical(c, d))
}

#[test]
fn aimed_points_find_the_same_light() {
    // Every profile, with lobes from wide to sharp; cones, plains and disordered cells have no aimed points.
    let disordered = CellDescription { tilt_disorder_deg: 5.0, tile_cells: 4, ..CellDescription::default() };
    let mut tests = Vec::new();
    for (k, cells) in Profile::ALL.into_iter().map(of).chain([disordered]).enumerate() {
        for exponent in [2.0, 20.0, 100.0] {
            let petal = petal(cells.clone(), (0.2, 0.1), exponent);
            for pair in PAIRS.map(pair) {
                let key = 10 * k as u32;
                let random = estimates(&petal, pair, Footprint::WIDE, 4.into(), 3000, key);
                let aimed =
                    estimates(&petal, pair, Footprint::WIDE, Points { random: 1, aimed: 2 }, 3000, key + 1);
                let variance = random.standard_error().powi(2) + aimed.standard_error().powi(2);
                let rounding = (1e-5 * random.mean()).powi(2);
                tests.push(z_test(random.mean() - aimed.mean(), variance + rounding).p_value);
            }
        }
    }
    let worst = tests.iter().fold(1.0f64, |a, b| a.min(*b));
    assert!(worst > sidak(0.01, tests.len()), "p = {worst} of {}", tests.len());
}

#[test]
fn aimed_points_quiet_the_highlight() {
    // A dark pigment: what the domes return is the highlight.
    let petal = petal(CellDescription::default(), (0.0, 0.03), 20.0);
    for pair in [PAIRS[0], PAIRS[4]].map(pair) {
        let [random, aimed] = [Points::from(5), Points { random: 4, aimed: 1 }]
            .map(|points| estimates(&petal, pair, Footprint::WIDE, points, 2000, 7));
        assert!(aimed.variance() < 0.5 * random.variance(), "{} {}", aimed.variance(), random.variance());
    }
}

#[test]
fn points_of_a_pixel_fill_the_cell() {
    // 16 samples of 4 points whose footprints lie anywhere: 64 cells of an 8 x 8 grid of the unit cell, once each.
    let petal = petal(CellDescription::default(), (0.2, 0.1), 20.0);
    for radius_um in [13.0, 100.0, f64::INFINITY] {
        let mut seen = [0; 64];
        for sample in 0..16 {
            let center_um = DVec2::new(1e3 * f64::from(sample).sin(), 77.7 * f64::from(sample));
            let mut sampler = Sampler::new(1, UVec2::new(4, 5), sample);
            for i in 0..4 {
                let at = petal.place(Footprint { center_um, radius_um }, &mut sampler.fork(i, 4));
                let b = at.y / (23.0 * 0.75f64.sqrt());
                let a = at.x / 23.0 - 0.5 * b;
                // Points lie on a grid of 2^-24.
                let cell = |x: f64| ((x + 1e-9).rem_euclid(1.0) * 8.0) as usize;
                seen[8 * cell(b) + cell(a)] += 1;
            }
        }
        assert!(seen.iter().all(|&n| n == 1), "{radius_um}: {seen:?}");
    }
}

#[test]
fn footprints_keep_their_second_moment() {
    let petal = petal(CellDescription::default(), (0.2, 0.1), 20.0);
    for radius_um in [5.0, 12.2, 20.0, 150.0] {
        let center_um = DVec2::new(500.0, -300.0);
        let mut moments = [Welford::default(); 3];
        for i in 0..1 << 12 {
            let mut sampler = Sampler::new(1, UVec2::ZERO, i);
            let d = petal.place(Footprint { center_um, radius_um }, &mut sampler) - center_um;
            assert!(d.length() < 1.5 * radius_um, "{radius_um}: {d}");
            moments.iter_mut().zip([d.x * d.x, d.y * d.y, d.x * d.y]).for_each(|(m, x)| m.push(x));
        }
        let exact = 0.25 * radius_um * radius_um;
        for (moment, exact) in moments.iter().zip([exact, exact, 0.0]) {
            assert!((moment.mean() - exact).abs() < 4.0 * moment.standard_error(), "{radius_um}: {moment:?}");
        }
    }
}

//! A petal of cells is simulated and has only an unbiased estimate of its value: do both tell of the same petal?
//!
//! | test | claim | statistic |
//! |---|---|---|
//! | `sample`, `energy` | those of [`check_scatter`] | |
//! | `weight` | `E[W g(w)] = integral of E[estimate] g(w) cos dw`, W and w from the walk | smallest p value of z tests |
//! | `reciprocity` | `E[estimate(a, b)] = E[estimate(b, a)]` | smallest p value of z tests |
//! | `grazing` | the estimate is finite and not negative down to cos = 1e-6 | bad values |
//!
//! g runs over 1 on the viewer's side, 1 on the other side, `max(0, w . wo)^4` and `max(0, w . mirror(wo))^4`: how
//! much light there is, and whether it goes back to the lamp or on. The integral is estimated from directions
//! uniform on the sphere, where `estimate cos` is bounded; under the cosine's density its variance would not be.
//! Guarded by `estimators_that_do_not_match_are_rejected` in `tests/validate_rejects.rs`.

use std::f64::consts::PI;

use glam::{UVec2, Vec3};

use super::grazing::{COSINES, at_cosine};
use super::{Bound, Case, Report, Row, Settings, Test, Worst, check_scatter};
use crate::bsdf::Scatter;
use crate::math::Sampler;
use crate::math::frame::{mirror, same_side};
use crate::math::stats::{Welford, sidak, z_test};
use crate::math::warp::square_to_sphere;
use crate::micro::shading::{CellPetal, Footprint};
use crate::spectrum::{LANES, SampledSpectrum, SampledWavelengths};

/// Unbiased estimate of `f(wo, wi)`.
pub type Estimate<'a> = &'a (dyn Fn(Vec3, Vec3, &SampledWavelengths, &mut Sampler) -> SampledSpectrum + Sync);

/// Pairs of directions per incidence and side whose order is reversed.
const PAIRS: u32 = 8;
/// Relative rounding error of f32 estimates, beside the noise.
const ROUNDING: f64 = 1e-5;
const MOMENTS: usize = 4;

/// Everything that can be said of a petal of cells, far away: its points anywhere on the petal.
pub fn check_petal(name: &str, petal: &CellPetal, settings: &Settings) -> Report {
    let estimate = |wo: Vec3, wi: Vec3, lambda: &SampledWavelengths, sampler: &mut Sampler| {
        petal.estimate(wo, wi, lambda, Footprint::WIDE, 1, sampler)
    };
    check_estimator(name, petal, &estimate, settings)
}

/// [`check_scatter`], and that `estimate` tells of the same surface as `scatter`.
pub fn check_estimator(name: &str, scatter: &dyn Scatter, estimate: Estimate, settings: &Settings) -> Report {
    let mut report = check_scatter(name, scatter, settings);
    report.rows.push(estimate_matches_walk(scatter, estimate, settings));
    report.rows.push(estimate_is_reciprocal(estimate, settings));
    report.rows.push(estimate_is_finite_at_grazing(estimate, settings));
    report
}

fn moments(wo: Vec3, w: Vec3) -> [f64; MOMENTS] {
    let towards = |d: Vec3| f64::from(w.dot(d).max(0.0)).powi(4);
    let here = if same_side(wo, w) { 1.0 } else { 0.0 };
    [here, 1.0 - here, towards(wo), towards(mirror(wo))]
}

fn estimate_matches_walk(scatter: &dyn Scatter, estimate: Estimate, settings: &Settings) -> Row {
    let lambda = SampledWavelengths::visible(0.5);
    let level = sidak(settings.significance, Case::count(settings) * MOMENTS * LANES);
    let mut worst = Worst::new(Bound::AtLeast(level));
    for case in Case::all(settings) {
        let mut walked = [[Welford::default(); LANES]; MOMENTS];
        let mut estimated = walked;
        let push = |sums: &mut [[Welford; LANES]; MOMENTS], w: Vec3, value: SampledSpectrum, scale: f64| {
            for (sum, g) in sums.iter_mut().zip(moments(case.wo, w)) {
                sum.iter_mut().zip(value.0).for_each(|(s, v)| s.push(f64::from(v) * scale * g));
            }
        };
        for k in 0..settings.samples {
            let mut sampler = Sampler::new(settings.seed, UVec2::new(k, case.index), 5);
            let (w, weight) = scatter.scatter(case.wo, &lambda, &mut sampler).unwrap_or_default();
            push(&mut walked, w, weight, 1.0);
            let mut sampler = Sampler::new(settings.seed, UVec2::new(k, case.index), 6);
            let wi = square_to_sphere(sampler.next_2d());
            let f = estimate(case.wo, wi, &lambda, &mut sampler);
            push(&mut estimated, wi, f, 4.0 * PI * f64::from(wi.z.abs()));
        }
        for (moment, (walks, estimates)) in walked.iter().zip(&estimated).enumerate() {
            for (w, e) in walks.iter().zip(estimates) {
                worst.see(p_value(w, e), || {
                    let what = ["reflected", "transmitted", "towards the lamp", "towards the mirror"][moment];
                    format!(
                        "p value, {what}: walk {:.5}, estimate {:.5} at {}",
                        w.mean(),
                        e.mean(),
                        case.describe()
                    )
                });
            }
        }
    }
    worst.row(Test::Weight)
}

fn estimate_is_reciprocal(estimate: Estimate, settings: &Settings) -> Row {
    let lambda = SampledWavelengths::visible(0.5);
    let level = sidak(settings.significance, Case::count(settings) * PAIRS as usize * LANES);
    let mut worst = Worst::new(Bound::AtLeast(level));
    for case in Case::all(settings) {
        for pair in 0..PAIRS {
            let u = Sampler::new(settings.seed, UVec2::new(pair, case.index), 7).next_2d();
            let (a, b) = (case.wo, square_to_sphere(u));
            let mean = |a: Vec3, b: Vec3, order: u32| {
                let mut lanes = [Welford::default(); LANES];
                for k in 0..settings.samples / 16 {
                    let key = UVec2::new(k, case.index * PAIRS + pair);
                    let f = estimate(a, b, &lambda, &mut Sampler::new(settings.seed, key, order));
                    lanes.iter_mut().zip(f.0).for_each(|(l, v)| l.push(f64::from(v)));
                }
                lanes
            };
            for (there, back) in mean(a, b, 8).iter().zip(&mean(b, a, 9)) {
                worst.see(p_value(there, back), || {
                    format!(
                        "p value, f({a:.3}, {b:.3}) = {:.5}, its reverse {:.5}",
                        there.mean(),
                        back.mean()
                    )
                });
            }
        }
    }
    worst.row(Test::Reciprocity)
}

fn p_value(a: &Welford, b: &Welford) -> f64 {
    let rounding = ROUNDING * a.mean().abs().max(b.mean().abs());
    let variance = a.standard_error().powi(2) + b.standard_error().powi(2) + rounding * rounding;
    z_test(a.mean() - b.mean(), variance).p_value
}

fn estimate_is_finite_at_grazing(estimate: Estimate, settings: &Settings) -> Row {
    let lambda = SampledWavelengths::visible(0.5);
    let cosines: Vec<f32> = COSINES.iter().flat_map(|&c| [c, -c]).collect();
    let mut bad = 0.0;
    let mut first = String::from("bad values");
    for k in 0..settings.pairs {
        let mut sampler = Sampler::new(settings.seed, UVec2::new(k, 0), 10);
        let pick = |i: u32| cosines[i as usize % cosines.len()];
        let a = at_cosine(pick(k), 1.1 * k as f32);
        let grazing = at_cosine(pick(k / cosines.len() as u32), sampler.next_1d() * std::f32::consts::TAU);
        for b in [grazing, square_to_sphere(sampler.next_2d())] {
            for (wo, wi) in [(a, b), (b, a)] {
                let f = estimate(wo, wi, &lambda, &mut sampler);
                if !f.0.iter().all(|v| v.is_finite() && *v >= 0.0) {
                    if bad == 0.0 {
                        first = format!("bad values; the first is {:?} for wo = {wo:?}, wi = {wi:?}", f.0);
                    }
                    bad += 1.0;
                }
            }
        }
    }
    let mut worst = Worst::new(Bound::AtMost(0.0));
    worst.see(bad, || first);
    worst.row(Test::Grazing)
}

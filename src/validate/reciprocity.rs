//! Is f(a, b) = f(b, a)?
//!
//! Pairs: one direction at each incidence, the other uniform on the whole sphere (so half of the pairs go
//! through the sheet) or drawn by `sample` (so narrow lobes are met); and pairs with both uniform. The
//! statistic is the largest `|f(a, b) - f(b, a)| / max(f(a, b), f(b, a))` over pairs and wavelengths.

use glam::{UVec2, Vec3};

use super::{Bound, Case, Row, Settings, Test, Worst};
use crate::bsdf::Bsdf;
use crate::math::Sampler;
use crate::math::warp::square_to_sphere;
use crate::spectrum::{LANES, SampledWavelengths};

/// Relative; leaves room for f32 and for interpolation in tables.
const TOLERANCE: f64 = 1e-3;
/// Values below this (1/sr) are compared absolutely: nobody sees them, and rounding rules there.
const FLOOR_PER_SR: f64 = 1e-6;

pub(super) fn is_reciprocal(bsdf: &dyn Bsdf, settings: &Settings) -> Row {
    let lambda = SampledWavelengths::visible(0.5);
    let mut worst = Worst::new(Bound::AtMost(TOLERANCE));
    for case in Case::all(settings) {
        for k in 0..settings.pairs {
            let mut sampler = Sampler::new(settings.seed, UVec2::new(k, case.index), 1);
            let (u, u_lobe, v) = (sampler.next_2d(), sampler.next_1d(), sampler.next_2d());
            let (a, b) = match k % 3 {
                0 => (case.wo, Some(square_to_sphere(u))),
                1 => (case.wo, bsdf.sample(case.wo, &lambda, u_lobe, u).map(|s| s.wi)),
                _ => (square_to_sphere(v), Some(square_to_sphere(u))),
            };
            let Some(b) = b else { continue };
            worst.see(difference(bsdf, a, b, &lambda), || {
                format!("relative difference between f({a:.3}, {b:.3}) and its reverse")
            });
        }
    }
    worst.row(Test::Reciprocity)
}

fn difference(bsdf: &dyn Bsdf, a: Vec3, b: Vec3, lambda: &SampledWavelengths) -> f64 {
    let (there, back) = (bsdf.eval(a, b, lambda), bsdf.eval(b, a, lambda));
    let lane = |i: usize| {
        let (f, g) = (f64::from(there[i]), f64::from(back[i]));
        (f - g).abs() / f.abs().max(g.abs()).max(FLOOR_PER_SR)
    };
    // NaN must come through: f64::max would drop it.
    (0..LANES).map(lane).fold(0.0, |m, d| if d > m || d.is_nan() { d } else { m })
}

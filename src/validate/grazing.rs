//! Finite and not negative where a direction nearly lies in the surface.
//!
//! Viewer and light at cosines 1e-3, 1e-4, 1e-5 and 1e-6 on both sides, alone and together, and samples from
//! there; exactly in the surface f is zero. The statistic is the number of bad values.

use glam::{UVec2, Vec3};

use super::{Bound, Case, Row, Settings, Test, Worst};
use crate::bsdf::Bsdf;
use crate::math::Sampler;
use crate::math::warp::square_to_sphere;
use crate::spectrum::{SampledSpectrum, SampledWavelengths};

pub(super) const COSINES: [f32; 4] = [1e-3, 1e-4, 1e-5, 1e-6];

pub(super) fn is_finite_at_grazing(bsdf: &dyn Bsdf, settings: &Settings) -> Row {
    let lambda = SampledWavelengths::visible(0.5);
    let grazing: Vec<Vec3> = COSINES
        .iter()
        .flat_map(|&c| [c, -c])
        .enumerate()
        .map(|(i, cos)| at_cosine(cos, 1.1 * i as f32))
        .collect();
    let mut bad = 0.0;
    let mut first = String::from("bad values");
    let mut complain = |what: &str, wo: Vec3, wi: Vec3| {
        if bad == 0.0 {
            first = format!("bad values; the first is {what} for wo = {wo:?}, wi = {wi:?}");
        }
        bad += 1.0;
    };
    for k in 0..settings.pairs {
        let mut sampler = Sampler::new(settings.seed, UVec2::new(k, 0), 3);
        let wo = grazing[k as usize % grazing.len()];
        let other = grazing[(k as usize / grazing.len()) % grazing.len()];
        let turned = glam::Quat::from_rotation_z(sampler.next_1d() * std::f32::consts::TAU) * other;
        for (a, b) in [(wo, turned), (wo, square_to_sphere(sampler.next_2d()))] {
            for (wo, wi) in [(a, b), (b, a)] {
                if !good(bsdf.eval(wo, wi, &lambda)) {
                    complain("f", wo, wi);
                }
                if !is_good(bsdf.pdf(wo, wi, &lambda)) {
                    complain("pdf", wo, wi);
                }
            }
        }
        let u_lobe = sampler.next_1d();
        if let Some(s) = bsdf.sample(wo, &lambda, u_lobe, sampler.next_2d())
            && !(good(s.f) && good(s.weight()) && is_good(s.pdf_per_sr) && s.wi.is_finite())
        {
            complain("a sample", wo, s.wi);
        }
    }
    for case in Case::all(settings) {
        for (wo, wi) in [(case.wo, Vec3::X), (Vec3::X, case.wo), (Vec3::X, Vec3::Y)] {
            if !bsdf.eval(wo, wi, &lambda).is_zero() {
                complain("f in the surface", wo, wi);
            }
        }
    }
    let mut worst = Worst::new(Bound::AtMost(0.0));
    worst.see(bad, || first);
    worst.row(Test::Grazing)
}

pub(super) fn at_cosine(cos: f32, phi: f32) -> Vec3 {
    let sin = (1.0 - cos * cos).sqrt();
    Vec3::new(sin * phi.cos(), sin * phi.sin(), cos)
}

fn good(f: SampledSpectrum) -> bool {
    f.0.into_iter().all(is_good)
}

fn is_good(v: f32) -> bool {
    v.is_finite() && v >= 0.0
}

//! Models with one deliberate fault each, which the suite must reject for that fault.

use glam::{Vec2, Vec3};

use super::{Flaw, Shipped, Test};
use crate::bsdf::{Bsdf, BsdfSample, Lobe};
use crate::math::frame::same_side;
use crate::math::warp::{cosine_hemisphere_pdf, square_to_cosine_hemisphere};
use crate::spectrum::{SampledSpectrum, SampledWavelengths};

use std::f32::consts::{FRAC_1_PI, TAU};

/// A diffuse reflector of albedo 0.8 with a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrong {
    /// Draws from the cosine density and claims the uniform one.
    Pdf,
    /// Depends on the viewer's angle and not on the light's.
    NonReciprocal,
    /// Returns 2 % more light than it receives.
    Albedo,
}

impl Bsdf for Wrong {
    fn eval(&self, wo: Vec3, wi: Vec3, _lambda: &SampledWavelengths) -> SampledSpectrum {
        if !same_side(wo, wi) {
            return SampledSpectrum::ZERO;
        }
        let albedo = match self {
            Wrong::Pdf => 0.8,
            Wrong::NonReciprocal => 0.4 * (1.0 + wo.z.abs()),
            Wrong::Albedo => 1.02,
        };
        SampledSpectrum::splat(albedo * FRAC_1_PI)
    }

    fn sample(&self, wo: Vec3, lambda: &SampledWavelengths, _u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let up = square_to_cosine_hemisphere(u);
        let wi = if wo.z < 0.0 { -up } else { up };
        let pdf_per_sr = self.pdf(wo, wi, lambda);
        (pdf_per_sr > 0.0).then(|| BsdfSample {
            wi,
            f: self.eval(wo, wi, lambda),
            pdf_per_sr,
            lobe: Lobe::DiffuseReflection,
        })
    }

    fn pdf(&self, wo: Vec3, wi: Vec3, _lambda: &SampledWavelengths) -> f32 {
        match (same_side(wo, wi), self) {
            (false, _) => 0.0,
            (true, Wrong::Pdf) => 1.0 / TAU,
            (true, _) => cosine_hemisphere_pdf(wi.abs()),
        }
    }
}

/// All of them, with the test that must reject each.
pub fn all() -> Vec<Shipped> {
    let entry = |name, wrong, test, reason| Shipped {
        name,
        bsdf: Box::new(wrong) as Box<dyn Bsdf>,
        expected_to_fail: Some(Flaw { test, reason }),
    };
    vec![
        entry("wrong pdf", Wrong::Pdf, Test::ChiSquare, "samples the cosine, claims the uniform density"),
        entry(
            "wrong reciprocity",
            Wrong::NonReciprocal,
            Test::Reciprocity,
            "depends on the viewer's angle only",
        ),
        entry("wrong albedo", Wrong::Albedo, Test::Energy, "reflects 1.02 of the light"),
    ]
}

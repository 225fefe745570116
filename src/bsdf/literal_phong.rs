//! Phong as the textbooks print it: kept to show what is wrong with it, never to render a petal.
//!
//! Equation: reflected intensity = `kd cos(theta_i) + ks max(0, cos alpha)^n`; as a BSDF
//! `f(wo, wi) = kd / pi + ks max(0, cos alpha)^n / cos(theta_i)` where `wo` and `wi` leave the same side,
//! else 0.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | kd | `diffuse` | share of the incident light, 0 to 1 | none |
//! | ks | `specular` | pure number, 0 to 1 | none |
//! | n | `exponent` | pure number, 0 to 1e5 | none |
//!
//! Limits: the division by one cosine makes it non-reciprocal, and it grows without bound as the light
//! goes to grazing; without the factor (n + 2) / (2 pi) its energy depends on n and exceeds 1 for a broad
//! lobe. `rosarium check` flags it. Guarded by `literal_phong_is_flagged` in `tests/validate_rejects.rs`.
//! Source: Phong, Illumination for computer generated pictures, CACM 18:6, 1975; our reading as a BSDF.

use glam::{Vec2, Vec3};

use super::phong::{PhongSampling, cos_alpha_power};
use super::{Bsdf, BsdfSample, Lobe};
use crate::Result;
use crate::geometry::Side;
use crate::math::frame::same_side;
use crate::spectrum::{SampledSpectrum, SampledWavelengths, Spectrum};

use std::f32::consts::FRAC_1_PI;

/// Unnormalised, non-reciprocal Phong, the same on both sides.
#[derive(Clone, Debug, PartialEq)]
pub struct LiteralPhong {
    diffuse: Spectrum,
    specular: Spectrum,
    sampling: PhongSampling,
}

impl LiteralPhong {
    /// Each coefficient from 0 to 1 at every nm, `exponent` from 0 to 1e5. Their sum is free: nothing
    /// bounds the energy of this model.
    pub fn new(diffuse: Spectrum, specular: Spectrum, exponent: f32) -> Result<Self> {
        let sampling = PhongSampling::new(&diffuse, &specular, exponent)?;
        Ok(Self { diffuse, specular, sampling })
    }

    /// kd.
    pub fn diffuse(&self) -> &Spectrum {
        &self.diffuse
    }

    /// ks.
    pub fn specular(&self) -> &Spectrum {
        &self.specular
    }

    /// The lobe alone, 1/sr.
    fn eval_lobe(&self, wo: Vec3, wi: Vec3, lambda: &SampledWavelengths) -> SampledSpectrum {
        if !same_side(wo, wi) {
            return SampledSpectrum::ZERO;
        }
        self.specular.sample(lambda) * (cos_alpha_power(wo, wi, self.sampling.exponent) / wi.z.abs())
    }

    /// n.
    pub fn exponent(&self) -> f32 {
        self.sampling.exponent
    }
}

impl Bsdf for LiteralPhong {
    fn eval(&self, wo: Vec3, wi: Vec3, lambda: &SampledWavelengths) -> SampledSpectrum {
        if !same_side(wo, wi) {
            return SampledSpectrum::ZERO;
        }
        self.diffuse.sample(lambda) * FRAC_1_PI + self.eval_lobe(wo, wi, lambda)
    }

    fn sample(&self, wo: Vec3, lambda: &SampledWavelengths, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let (wi, pdf_per_sr, lobe) = self.sampling.sample(wo, u_lobe, u)?;
        Some(BsdfSample { wi, f: self.eval(wo, wi, lambda), pdf_per_sr, lobe })
    }

    fn pdf(&self, wo: Vec3, wi: Vec3, _lambda: &SampledWavelengths) -> f32 {
        self.sampling.pdf(wo, wi)
    }

    fn diffuse(&self, _side: Side, lambda: &SampledWavelengths) -> [SampledSpectrum; 2] {
        [self.diffuse.sample(lambda), SampledSpectrum::ZERO]
    }

    fn eval_rest(&self, wo: Vec3, wi: Vec3, lambda: &SampledWavelengths) -> SampledSpectrum {
        self.eval_lobe(wo, wi, lambda)
    }

    fn sample_rest(
        &self,
        wo: Vec3,
        lambda: &SampledWavelengths,
        _u_lobe: f32,
        u: Vec2,
    ) -> Option<BsdfSample> {
        let wi = self.sampling.draw_lobe(wo, u);
        let pdf_per_sr = self.pdf_rest(wo, wi, lambda);
        (pdf_per_sr > 0.0).then(|| BsdfSample {
            wi,
            f: self.eval_lobe(wo, wi, lambda),
            pdf_per_sr,
            lobe: Lobe::GlossyReflection,
        })
    }

    fn pdf_rest(&self, wo: Vec3, wi: Vec3, _lambda: &SampledWavelengths) -> f32 {
        self.sampling.pdf_lobe(wo, wi)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::frame::{mirror, spherical};

    #[test]
    fn radiance_of_the_highlight_is_the_coefficient() -> Result<()> {
        // The textbook: what the eye sees of a unit light is ks in the mirror direction at any angle.
        let b = LiteralPhong::new(0.0.into(), 0.4.into(), 30.0)?;
        let lambda = SampledWavelengths::visible(0.5);
        for theta in [0.1, 0.8, 1.4] {
            let wi = spherical(theta, 1.0);
            let seen = b.eval(mirror(wi), wi, &lambda)[0] * wi.z;
            assert!((seen - 0.4).abs() < 1e-5, "{theta}: {seen}");
        }
        Ok(())
    }
}

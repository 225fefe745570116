//! Modified Phong: a diffuse part and a normalised, reciprocal cosine-power lobe around the mirror
//! direction.
//!
//! Equation: `f(wo, wi) = kd / pi + ks (n + 2) / (2 pi) max(0, cos alpha)^n` where `wo` and `wi` leave the
//! same side, else 0; alpha is the angle between the mirror direction of `wo` and `wi`.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | kd | `diffuse` | share of the incident light, 0 to 1 | none |
//! | ks | `specular` | same; the lobe's albedo at normal incidence | none |
//! | n | `exponent` | pure number, 0 to 1e5 | none |
//!
//! The lobe's albedo is ks at normal incidence and falls towards grazing, where the surface cuts the lobe;
//! kd + ks <= 1, checked at every nm, therefore conserves energy at every angle.
//!
//! Sampling: diffuse or lobe in proportion to the means of kd and ks over the visible range; the lobe is
//! drawn as (n + 1) / (2 pi) cos^n(alpha), and a direction below the surface is rejected (`None`), so the
//! density integrates to the probability of success.
//! Limits: no Fresnel effect, no retro-reflection, the lobe darkens at grazing where real gloss brightens.
//! Guarded by `lobe_albedo_is_specular_at_normal_incidence_and_less_elsewhere` and `tests/conformance.rs`.
//! Source: Lafortune and Willems, Using the modified Phong reflectance model for physically based
//! rendering, K.U. Leuven CW 197, 1994.

use glam::{Vec2, Vec3};

use super::albedo::{check_share, check_sum};
use super::{Bsdf, BsdfSample, Lobe, on_side};
use crate::geometry::Side;
use crate::math::Frame;
use crate::math::frame::{mirror, same_side};
use crate::math::warp::{cosine_hemisphere_pdf, square_to_cosine_hemisphere, square_to_power_cosine};
use crate::spectrum::{SampledSpectrum, SampledWavelengths, Spectrum};
use crate::{Error, Result};

use std::f32::consts::{FRAC_1_PI, TAU};

/// Sharper lobes are narrower than what f32 directions resolve.
const MAX_EXPONENT: f32 = 1e5;

/// Diffuse and glossy reflection, the same on both sides.
#[derive(Clone, Debug, PartialEq)]
pub struct Phong {
    diffuse: Spectrum,
    specular: Spectrum,
    sampling: PhongSampling,
}

impl Phong {
    /// `diffuse` + `specular` <= 1 at every nm, `exponent` from 0 to 1e5.
    pub fn new(diffuse: Spectrum, specular: Spectrum, exponent: f32) -> Result<Self> {
        let sampling = PhongSampling::new(&diffuse, &specular, exponent)?;
        check_sum("specular", "diffuse + specular", &diffuse, &specular)?;
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

    /// n.
    pub fn exponent(&self) -> f32 {
        self.sampling.exponent
    }

    /// The lobe alone, 1/sr.
    pub fn eval_lobe(&self, wo: Vec3, wi: Vec3, lambda: &SampledWavelengths) -> SampledSpectrum {
        if !same_side(wo, wi) {
            return SampledSpectrum::ZERO;
        }
        let n = self.sampling.exponent;
        self.specular.sample(lambda) * ((n + 2.0) / TAU * cos_alpha_power(wo, wi, n))
    }
}

impl Bsdf for Phong {
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

/// `max(0, cos alpha)^n`. The cosine comes from the chord between the mirror direction and `wi`, because
/// their dot product loses the digits of 1 - cos that a large exponent brings forward. Symmetric to the bit.
pub(super) fn cos_alpha_power(wo: Vec3, wi: Vec3, exponent: f32) -> f32 {
    let versine = 0.5 * (mirror(wo) - wi).length_squared();
    if versine >= 1.0 { 0.0 } else { (exponent * (-versine).ln_1p()).exp() }
}

/// How Phong's two parts are sampled; shared with the literal Phong.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PhongSampling {
    pub(super) exponent: f32,
    /// Probability of the lobe; `None` where both parts are black.
    glossy: Option<f32>,
}

impl PhongSampling {
    /// Checks each share and the exponent, not their sum.
    pub(super) fn new(diffuse: &Spectrum, specular: &Spectrum, exponent: f32) -> Result<Self> {
        check_share("diffuse", diffuse)?;
        check_share("specular", specular)?;
        if !(0.0..=MAX_EXPONENT).contains(&exponent) {
            return Err(Error::invalid(
                "exponent",
                format!("{exponent}; it lies between 0 and {MAX_EXPONENT}"),
            ));
        }
        let (d, s) = (diffuse.mean(), specular.mean());
        Ok(Self { exponent, glossy: (d + s > 0.0).then(|| s / (d + s)) })
    }

    /// Direction, density, lobe.
    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<(Vec3, f32, Lobe)> {
        let (wi, lobe) = if u_lobe < self.glossy? {
            (self.draw_lobe(wo, u), Lobe::GlossyReflection)
        } else {
            (on_side(square_to_cosine_hemisphere(u), wo.z), Lobe::DiffuseReflection)
        };
        let pdf_per_sr = self.pdf(wo, wi);
        (pdf_per_sr > 0.0).then_some((wi, pdf_per_sr, lobe))
    }

    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let Some(glossy) = self.glossy else { return 0.0 };
        if !same_side(wo, wi) {
            return 0.0;
        }
        let lobe = (self.exponent + 1.0) / TAU * cos_alpha_power(wo, wi, self.exponent);
        glossy * lobe + (1.0 - glossy) * cosine_hemisphere_pdf(wi.abs())
    }

    /// Direction in the lobe, which may lie below the surface.
    pub(super) fn draw_lobe(&self, wo: Vec3, u: Vec2) -> Vec3 {
        Frame::from_normal(mirror(wo)).to_world(square_to_power_cosine(u, self.exponent))
    }

    /// Density of [`PhongSampling::draw_lobe`] above the surface; zero where there is no lobe.
    pub(super) fn pdf_lobe(&self, wo: Vec3, wi: Vec3) -> f32 {
        if !same_side(wo, wi) || self.glossy.is_none_or(|g| g <= 0.0) {
            return 0.0;
        }
        (self.exponent + 1.0) / TAU * cos_alpha_power(wo, wi, self.exponent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Sampler;
    use crate::math::frame::spherical;

    fn mean_weight(b: &Phong, wo: Vec3) -> f64 {
        let lambda = SampledWavelengths::visible(0.5);
        let n = 1 << 14;
        let sum: f64 = (0..n)
            .filter_map(|i| {
                let mut s = Sampler::new(1, glam::UVec2::ZERO, i);
                b.sample(wo, &lambda, s.next_1d(), s.next_2d()).map(|s| f64::from(s.weight()[0]))
            })
            .sum();
        sum / f64::from(n)
    }

    #[test]
    fn lobe_albedo_is_specular_at_normal_incidence_and_less_elsewhere() -> Result<()> {
        for exponent in [0.0, 1.0, 12.0, 300.0, 1e5] {
            let b = Phong::new(0.0.into(), 0.8.into(), exponent)?;
            let normal = mean_weight(&b, Vec3::Z);
            assert!((normal - 0.8).abs() < 2e-3, "{exponent}: {normal}");
            let mut previous = normal;
            for theta in [0.5, 1.0, 1.3, 1.5] {
                let albedo = mean_weight(&b, spherical(theta, 0.3));
                assert!(albedo < previous + 2e-3, "{exponent} at {theta}: {albedo} after {previous}");
                previous = albedo;
            }
        }
        Ok(())
    }

    #[test]
    fn peak_is_the_closed_form() -> Result<()> {
        let b = Phong::new(0.3.into(), 0.6.into(), 40.0)?;
        let lambda = SampledWavelengths::visible(0.5);
        let w = spherical(0.7, 0.2);
        for wo in [w, -w] {
            let f = b.eval(wo, mirror(wo), &lambda)[3];
            assert!((f - (0.3 * FRAC_1_PI + 0.6 * 42.0 / TAU)).abs() < 1e-4, "{f}");
        }
        Ok(())
    }

    #[test]
    fn bad_parameters_are_errors() {
        assert!(Phong::new(0.5.into(), 0.6.into(), 10.0).is_err());
        assert!(Phong::new(0.5.into(), 0.5.into(), 10.0).is_ok());
        for exponent in [-1.0, 2e5, f32::NAN] {
            assert!(Phong::new(0.5.into(), 0.5.into(), exponent).is_err(), "{exponent}");
        }
    }
}

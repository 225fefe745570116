//! Lambert: each side sends the same radiance into every direction of its own hemisphere.
//!
//! Equation: `f(wo, wi) = rho / pi` where `wo` and `wi` leave the same side, else 0.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | rho | `reflectance`, adaxial and abaxial | share of the incident light, 0 to 1 | none |
//!
//! Sampling: cosine-weighted on the side of `wo`, so the weight is exactly rho.
//! Limits: no light passes through; no dependence on angle. Guarded by `albedo_is_the_reflectance` here
//! and by `tests/conformance.rs`.
//! Source: J. H. Lambert, Photometria, 1760.

use glam::{Vec2, Vec3};

use super::albedo::check_share;
use super::{Bsdf, BsdfSample, Lobe, on_side};
use crate::Result;
use crate::geometry::Side;
use crate::math::frame::same_side;
use crate::math::warp::{cosine_hemisphere_pdf, square_to_cosine_hemisphere};
use crate::spectrum::{SampledSpectrum, SampledWavelengths, Spectrum};

use std::f32::consts::FRAC_1_PI;

/// Opaque diffuse reflection on both sides.
#[derive(Clone, Debug, PartialEq)]
pub struct Lambert {
    reflectance: [Spectrum; 2],
    black: [bool; 2],
}

impl Lambert {
    /// The same reflectance on both sides. Fails where it leaves [0, 1].
    pub fn new(reflectance: Spectrum) -> Result<Self> {
        check_share("reflectance", &reflectance)?;
        Ok(Self::from_checked([reflectance.clone(), reflectance]))
    }

    /// Own reflectance on each side. Fails where one leaves [0, 1].
    pub fn two_sided(adaxial: Spectrum, abaxial: Spectrum) -> Result<Self> {
        check_share("reflectance_adaxial", &adaxial)?;
        check_share("reflectance_abaxial", &abaxial)?;
        Ok(Self::from_checked([adaxial, abaxial]))
    }

    fn from_checked(reflectance: [Spectrum; 2]) -> Self {
        let black = [reflectance[0].max() <= 0.0, reflectance[1].max() <= 0.0];
        Self { reflectance, black }
    }

    /// Reflectance of a side.
    pub fn reflectance(&self, side: Side) -> &Spectrum {
        &self.reflectance[side as usize]
    }
}

impl Bsdf for Lambert {
    fn eval(&self, wo: Vec3, wi: Vec3, lambda: &SampledWavelengths) -> SampledSpectrum {
        if !same_side(wo, wi) {
            return SampledSpectrum::ZERO;
        }
        self.reflectance(Side::of(wo)).sample(lambda) * FRAC_1_PI
    }

    fn sample(&self, wo: Vec3, lambda: &SampledWavelengths, _u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let wi = on_side(square_to_cosine_hemisphere(u), wo.z);
        let pdf_per_sr = self.pdf(wo, wi, lambda);
        (pdf_per_sr > 0.0).then(|| BsdfSample {
            wi,
            f: self.eval(wo, wi, lambda),
            pdf_per_sr,
            lobe: Lobe::DiffuseReflection,
        })
    }

    fn pdf(&self, wo: Vec3, wi: Vec3, _lambda: &SampledWavelengths) -> f32 {
        if !same_side(wo, wi) || self.black[Side::of(wo) as usize] {
            return 0.0;
        }
        cosine_hemisphere_pdf(wi.abs())
    }

    fn diffuse(&self, side: Side, lambda: &SampledWavelengths) -> [SampledSpectrum; 2] {
        [self.reflectance(side).sample(lambda), SampledSpectrum::ZERO]
    }

    fn eval_rest(&self, _wo: Vec3, _wi: Vec3, _lambda: &SampledWavelengths) -> SampledSpectrum {
        SampledSpectrum::ZERO
    }

    fn sample_rest(
        &self,
        _wo: Vec3,
        _lambda: &SampledWavelengths,
        _u_lobe: f32,
        _u: Vec2,
    ) -> Option<BsdfSample> {
        None
    }

    fn pdf_rest(&self, _wo: Vec3, _wi: Vec3, _lambda: &SampledWavelengths) -> f32 {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn albedo_is_the_reflectance() -> Result<()> {
        let ramp = Spectrum::from_fn(|nm| (nm - 380.0) / 400.0);
        let b = Lambert::two_sided(ramp.clone(), 0.25.into())?;
        let lambda = SampledWavelengths::visible(0.4);
        for (z, expected) in [(0.3, ramp.sample(&lambda)), (-0.9, SampledSpectrum::splat(0.25))] {
            let wo = Vec3::new((1.0f32 - z * z).sqrt(), 0.0, z);
            let s = b.sample(wo, &lambda, 0.5, Vec2::new(0.3, 0.8)).expect("not black");
            assert!(s.wi.z * z > 0.0);
            let error = (s.weight() - expected).map(f32::abs).max();
            assert!(error < 1e-6, "{error}");
        }
        Ok(())
    }

    #[test]
    fn a_black_side_scatters_nothing() -> Result<()> {
        let b = Lambert::two_sided(0.5.into(), 0.0.into())?;
        let lambda = SampledWavelengths::visible(0.5);
        assert!(b.sample(-Vec3::Z, &lambda, 0.5, Vec2::splat(0.3)).is_none());
        assert_eq!(b.pdf(-Vec3::Z, -Vec3::Z, &lambda), 0.0);
        assert!(b.sample(Vec3::X, &lambda, 0.5, Vec2::splat(0.3)).is_none(), "in the surface");
        Ok(())
    }

    #[test]
    fn impossible_reflectances_are_errors() {
        for bad in [-0.1, 1.1, f32::NAN, f32::INFINITY] {
            assert!(Lambert::new(bad.into()).is_err(), "{bad}");
        }
        let message =
            Lambert::two_sided(0.5.into(), Spectrum::from_fn(|nm| nm / 600.0)).unwrap_err().to_string();
        assert!(message.contains("abaxial") && message.contains("601 nm"), "{message}");
    }
}

//! Diffuse sheet: each side reflects, and passes on to the other side, without a preferred direction.
//!
//! Equation: `f(wo, wi) = rho_side / pi` where `wo` and `wi` leave the same side, `tau / pi` across.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | rho | `reflectance`, adaxial and abaxial | share of the incident light, 0 to 1 | none |
//! | tau | `transmittance` | share of the incident light, 0 to 1 | none |
//!
//! One transmittance serves both ways, because reciprocity, f(a, b) = f(b, a), demands it. The sum
//! rho + tau <= 1 is checked at every nm for each side when the model is made.
//!
//! Sampling: reflection or transmission in proportion to the mean of rho and tau over the visible range,
//! then a cosine-weighted direction; where the model is grey the weight is exactly rho + tau.
//! Limits: no dependence on angle, no direct (unscattered) transmission. Guarded by
//! `both_sides_share_the_transmittance`, `more_light_out_than_in_is_an_error` and `tests/conformance.rs`.
//! Source: the Lambertian sheet with transmission of Rushmeier and Torrance, ACM Trans. Graph. 9:1, 1990.

use glam::{Vec2, Vec3};

use super::albedo::{check_share, check_sum};
use super::{Bsdf, BsdfSample, Lobe, on_side};
use crate::Result;
use crate::geometry::Side;
use crate::math::frame::same_side;
use crate::math::warp::{cosine_hemisphere_pdf, square_to_cosine_hemisphere};
use crate::spectrum::{SampledSpectrum, SampledWavelengths, Spectrum};

use std::f32::consts::FRAC_1_PI;

/// Diffuse reflection and transmission of a thin sheet.
#[derive(Clone, Debug, PartialEq)]
pub struct DiffuseTransmission {
    reflectance: [Spectrum; 2],
    transmittance: Spectrum,
    /// Probability of transmission by side of `wo`; `None` where the side is black.
    transmit: [Option<f32>; 2],
}

impl DiffuseTransmission {
    /// Reflectance of each side and the transmittance. Fails where a share leaves [0, 1], or where on a
    /// side reflectance + transmittance exceeds 1.
    pub fn new(
        reflectance_adaxial: Spectrum,
        reflectance_abaxial: Spectrum,
        transmittance: Spectrum,
    ) -> Result<Self> {
        check_share("reflectance_adaxial", &reflectance_adaxial)?;
        check_share("reflectance_abaxial", &reflectance_abaxial)?;
        check_share("transmittance", &transmittance)?;
        let sides = [("adaxial", &reflectance_adaxial), ("abaxial", &reflectance_abaxial)];
        for (side, reflectance) in sides {
            let what = format!("reflectance + transmittance on the {side} side");
            check_sum("transmittance", &what, reflectance, &transmittance)?;
        }
        let transmit = [&reflectance_adaxial, &reflectance_abaxial].map(|reflectance| {
            let (r, t) = (reflectance.mean(), transmittance.mean());
            (r + t > 0.0).then(|| t / (r + t))
        });
        Ok(Self { reflectance: [reflectance_adaxial, reflectance_abaxial], transmittance, transmit })
    }

    /// Reflectance of a side.
    pub fn reflectance(&self, side: Side) -> &Spectrum {
        &self.reflectance[side as usize]
    }

    /// Transmittance, the same both ways.
    pub fn transmittance(&self) -> &Spectrum {
        &self.transmittance
    }
}

impl Bsdf for DiffuseTransmission {
    fn eval(&self, wo: Vec3, wi: Vec3, lambda: &SampledWavelengths) -> SampledSpectrum {
        if wo.z == 0.0 || wi.z == 0.0 {
            return SampledSpectrum::ZERO;
        }
        let share = if same_side(wo, wi) { self.reflectance(Side::of(wo)) } else { &self.transmittance };
        share.sample(lambda) * FRAC_1_PI
    }

    fn sample(&self, wo: Vec3, lambda: &SampledWavelengths, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let transmit = u_lobe < self.transmit[Side::of(wo) as usize]?;
        let wi = on_side(square_to_cosine_hemisphere(u), if transmit { -wo.z } else { wo.z });
        let pdf_per_sr = self.pdf(wo, wi, lambda);
        (pdf_per_sr > 0.0).then(|| BsdfSample {
            wi,
            f: self.eval(wo, wi, lambda),
            pdf_per_sr,
            lobe: if transmit { Lobe::DiffuseTransmission } else { Lobe::DiffuseReflection },
        })
    }

    fn pdf(&self, wo: Vec3, wi: Vec3, _lambda: &SampledWavelengths) -> f32 {
        let Some(transmit) = self.transmit[Side::of(wo) as usize] else { return 0.0 };
        if wo.z == 0.0 {
            return 0.0;
        }
        let choice = if same_side(wo, wi) { 1.0 - transmit } else { transmit };
        choice * cosine_hemisphere_pdf(wi.abs())
    }

    fn diffuse(&self, side: Side, lambda: &SampledWavelengths) -> [SampledSpectrum; 2] {
        [self.reflectance(side).sample(lambda), self.transmittance.sample(lambda)]
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
    fn both_sides_share_the_transmittance() -> Result<()> {
        let b =
            DiffuseTransmission::new(0.3.into(), 0.5.into(), Spectrum::from_fn(|nm| (nm - 380.0) / 800.0))?;
        let lambda = SampledWavelengths::visible(0.1);
        let (up, down) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, 0.8, -0.6));
        assert_eq!(b.eval(up, down, &lambda), b.eval(down, up, &lambda));
        assert_eq!(b.eval(up, up, &lambda).0, [0.3 * FRAC_1_PI; 8]);
        assert_eq!(b.eval(down, down, &lambda).0, [0.5 * FRAC_1_PI; 8]);
        Ok(())
    }

    #[test]
    fn grey_sheets_have_constant_weight() -> Result<()> {
        let b = DiffuseTransmission::new(0.3.into(), 0.5.into(), 0.4.into())?;
        let lambda = SampledWavelengths::visible(0.1);
        for (wo, total) in [(Vec3::Z, 0.7), (-Vec3::Z, 0.9)] {
            for u_lobe in [0.0, 0.3, 0.6, 0.99] {
                let s = b.sample(wo, &lambda, u_lobe, Vec2::new(0.2, 0.9)).expect("scatters");
                assert!((s.weight()[0] - total).abs() < 1e-6);
                assert_eq!(s.wi.z * wo.z < 0.0, s.lobe == Lobe::DiffuseTransmission);
            }
        }
        Ok(())
    }

    #[test]
    fn more_light_out_than_in_is_an_error() {
        let red = Spectrum::from_fn(|nm| if nm < 640.0 { 0.1 } else { 0.6 });
        let message = DiffuseTransmission::new(0.2.into(), red.clone(), red).unwrap_err().to_string();
        assert!(message.contains("abaxial side") && message.contains("640 nm"), "{message}");
        assert!(DiffuseTransmission::new(0.6.into(), 0.6.into(), 0.4.into()).is_ok());
        assert!(DiffuseTransmission::new(0.6.into(), 0.6.into(), (-0.1).into()).is_err());
        assert!(DiffuseTransmission::new(0.6.into(), 0.6.into(), f32::NAN.into()).is_err());
    }
}

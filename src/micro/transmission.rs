//! Light through the petal that keeps a direction: straight on, or reflected once inside an epidermal cell.
//!
//! Equation, on opposite sides, else 0: `f(wo, wi) = k (m + 2) / (2 pi) max(0, cos a)^m` with a the angle between
//! `wo` and the way of the light from `wi = (x, y, z)`:
//!
//! ```text
//! direct    (-x, -y, -z)   straight on
//! indirect  ( x,  y, -z)   straight on, its horizontal part turned round
//! ```
//!
//! Domes are higher than wide, so the inner wall that faces the lamp stands upright: it turns the ray's horizontal
//! part round and leaves its depth.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | k | `share` | share of the light that falls upright on the sheet, 0 to 1 | none |
//! | m | `exponent` | pure number, 0 to 1e5 | none |
//!
//! Reciprocal; the lobe passes k at normal incidence and less elsewhere, where the sheet's plane cuts it
//! (`transmitted_shares_are_exact_at_normal_incidence`). Sampling: (m + 1) / (2 pi) cos^m(a); a direction back to the
//! lamp's side is rejected (`None`). Limits: the domes do not bend the light, so its width is the exponent's to say;
//! the same formula is fitted (Guarded by `fitted_transmission_is_the_rendered_one`), and walk and value are of one
//! petal (`petals_estimate_what_they_scatter`). Source: the division into direct and once-reflected light is
//! Tachino's (master's thesis, JAIST, 2000; only its table of contents could be read); the equations are our reading.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};

use crate::math::Frame;
use crate::math::frame::{mirror, same_side};
use crate::math::warp::square_to_power_cosine;
use crate::spectrum::{SampledSpectrum, SampledWavelengths, Spectrum};
use crate::{Error, Result};

/// Sharper lobes are narrower than what f32 directions resolve.
const MAX_EXPONENT: f32 = 1e5;

/// Which way the light goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Straight on.
    Direct,
    /// Reflected once at an upright inner wall.
    Indirect,
}

/// A lobe of light on the other side of the sheet.
#[derive(Clone, Debug, PartialEq)]
pub struct TransmissionLobe {
    way: Way,
    share: Spectrum,
    exponent: f32,
}

impl TransmissionLobe {
    /// `share` from 0 to 1 at every nm, `exponent` from 0 to 1e5. Errors name `direct`, `indirect` or their exponent.
    pub fn new(way: Way, share: Spectrum, exponent: f32) -> Result<Self> {
        let name = match way {
            Way::Direct => "direct",
            Way::Indirect => "indirect",
        };
        // Written so that NaN is an error.
        let each = |v: f32| (0.0..=1.0 + 1e-5).contains(&v);
        if !(each(share.min()) && each(share.max()) && each(share.mean())) {
            return Err(Error::invalid(name, "a share of the light lies between 0 and 1"));
        }
        if !(0.0..=MAX_EXPONENT).contains(&exponent) {
            let what = format!("{exponent}; it lies between 0 and {MAX_EXPONENT}");
            return Err(Error::invalid(format!("{name}_exponent"), what));
        }
        Ok(Self { way, share, exponent })
    }

    /// k.
    pub fn share(&self) -> &Spectrum {
        &self.share
    }

    /// m.
    pub fn exponent(&self) -> f32 {
        self.exponent
    }

    /// The middle of the lobe.
    fn axis(&self, wi: Vec3) -> Vec3 {
        match self.way {
            Way::Direct => -wi,
            Way::Indirect => -mirror(wi),
        }
    }

    /// 1/sr, without the cosine.
    pub fn eval(&self, wo: Vec3, wi: Vec3, lambda: &SampledWavelengths) -> SampledSpectrum {
        // From the chord, as in Phong's lobe: it keeps the digits of 1 - cos.
        let versine = 0.5 * (self.axis(wi) - wo).length_squared();
        if same_side(wo, wi) || wo.z == 0.0 || wi.z == 0.0 || versine >= 1.0 {
            return SampledSpectrum::ZERO;
        }
        let m = self.exponent;
        self.share.sample(lambda) * ((m + 2.0) / TAU * (m * (-versine).ln_1p()).exp())
    }

    /// Where light from `wi` goes, with `f |cos| / pdf`; `None` where the lobe is cut.
    pub fn scatter(&self, wi: Vec3, lambda: &SampledWavelengths, u: Vec2) -> Option<(Vec3, SampledSpectrum)> {
        let m = self.exponent;
        let local = square_to_power_cosine(u, m);
        let out = Frame::from_normal(self.axis(wi)).to_world(local);
        (out.z * wi.z < 0.0).then(|| (out, self.share.sample(lambda) * ((m + 2.0) / (m + 1.0) * out.z.abs())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::frame::spherical;
    use crate::math::quadrature::sphere_rule;

    #[test]
    fn transmitted_shares_are_exact_at_normal_incidence() {
        let lambda = SampledWavelengths::visible(0.5);
        let rule = sphere_rule(96, 192);
        for way in [Way::Direct, Way::Indirect] {
            for exponent in [0.0, 3.0, 60.0] {
                let lobe = TransmissionLobe::new(way, 0.4.into(), exponent).unwrap();
                let albedo = |wi: Vec3| -> f64 {
                    rule.iter().map(|&(w, sr)| sr * f64::from(w.z.abs() * lobe.eval(w, wi, &lambda)[0])).sum()
                };
                for wi in [Vec3::Z, -Vec3::Z] {
                    assert!((albedo(wi) - 0.4).abs() < 1e-4, "{way:?} {exponent}: {}", albedo(wi));
                }
                assert!(albedo(spherical(1.2, 0.7)) < 0.4);
            }
        }
    }

    #[test]
    fn light_goes_straight_on_or_turned_round() {
        let lambda = SampledWavelengths::visible(0.5);
        let wi = Vec3::new(0.6, 0.0, 0.8);
        for (way, middle) in
            [(Way::Direct, Vec3::new(-0.6, 0.0, -0.8)), (Way::Indirect, Vec3::new(0.6, 0.0, -0.8))]
        {
            let lobe = TransmissionLobe::new(way, 0.5.into(), 300.0).unwrap();
            let peak = lobe.eval(middle, wi, &lambda)[0];
            assert!((peak - 0.5 * 302.0 / TAU).abs() < 1e-3, "{way:?} {peak}");
            let (out, _) = lobe.scatter(wi, &lambda, Vec2::splat(0.4)).unwrap();
            assert!(out.dot(middle) > 0.98, "{way:?} {out}");
            assert_eq!(lobe.eval(Vec3::new(-0.6, 0.0, 0.8), wi, &lambda)[0], 0.0);
        }
    }

    #[test]
    fn impossible_lobes_are_errors() {
        for (share, exponent) in [(1.5, 3.0), (-0.1, 3.0), (f32::NAN, 3.0), (0.5, -1.0), (0.5, f32::NAN)] {
            let e = TransmissionLobe::new(Way::Indirect, share.into(), exponent).unwrap_err().to_string();
            assert!(e.starts_with("indirect"), "{e}");
        }
    }
}

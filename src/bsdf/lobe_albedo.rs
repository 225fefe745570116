//! What the surface leaves of a cosine-power lobe that it cuts.
//!
//! Model: the lobe of exponent n stands around an axis at the angle theta from the normal (the mirror direction of
//! Phong, the straight way of a transmission lobe); what points below the surface is lost. With alpha the angle
//! from the axis and z the cosine from the normal,
//!
//! ```text
//! A(theta) = (n + 2) / (2 pi) integral over z > 0 of max(0, cos alpha)^n z dw     normalised lobe: A(0) = 1
//! B(theta) =                  integral over z > 0 of max(0, cos alpha)^n   dw     the textbook's lobe
//! ```
//!
//! On a ring of one alpha, z = a + b cos psi with a = cos alpha cos theta and b = sin alpha sin theta, so the means of
//! max(0, z) and of (z > 0) over psi are `(a psi0 + b sin psi0) / pi` and `psi0 / pi`, psi0 = acos(-a / b) (pi where
//! a > b). What is left is one integral over t = cos^(n+1) alpha, in which the lobe is uniform, by the midpoint rule.
//!
//! | symbol | argument | unit |
//! |---|---|---|
//! | n | `exponent` | pure number, 0 to 1e5 |
//! | cos theta | `cos` | pure number, 0 to 1 |
//!
//! Guarded by `lobe_albedo_is_the_integral`. Source: elementary; the lobe is Lafortune and Willems' of 1994.

use std::f64::consts::{PI, TAU};

/// Points of the midpoint rule: an error below 1e-4 of the albedo even where the ring's mean has a kink.
const POINTS: u32 = 1024;

/// Means of max(0, z) and of (z > 0) over the lobe, drawn as `cos^n`.
fn means(exponent: f64, cos: f64) -> (f64, f64) {
    let cos = cos.clamp(0.0, 1.0);
    let sin = (1.0 - cos * cos).sqrt();
    let (mut height, mut above) = (0.0, 0.0);
    for i in 0..POINTS {
        let t = (f64::from(i) + 0.5) / f64::from(POINTS);
        let cos_alpha = t.powf(1.0 / (exponent + 1.0));
        let (a, b) = (cos_alpha * cos, (1.0 - cos_alpha * cos_alpha).max(0.0).sqrt() * sin);
        if a >= b {
            height += a;
            above += 1.0;
        } else {
            let psi = (-a / b).acos();
            height += (a * psi + b * psi.sin()) / PI;
            above += psi / PI;
        }
    }
    (height / f64::from(POINTS), above / f64::from(POINTS))
}

/// A: albedo of the normalised lobe, `(n + 2) / (2 pi) cos^n(alpha)`, for light at this cosine from the normal.
pub fn lobe_albedo(exponent: f32, cos: f32) -> f32 {
    let n = f64::from(exponent);
    ((n + 2.0) / (n + 1.0) * means(n, f64::from(cos)).0).min(1.0) as f32
}

/// B: integral of `cos^n(alpha)` over the directions above the surface, sr.
pub fn lobe_solid_angle_sr(exponent: f32, cos: f32) -> f32 {
    let n = f64::from(exponent);
    (TAU / (n + 1.0) * means(n, f64::from(cos)).1) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::phong::cos_alpha_power;
    use crate::math::frame::spherical;
    use crate::math::quadrature::integrate_hemisphere;

    #[test]
    fn lobe_albedo_is_the_integral() {
        for exponent in [0.0f32, 1.0, 7.5, 60.0] {
            for theta in [0.0f32, 0.5, 1.0, 1.4, 1.57] {
                let wi = spherical(theta, 0.3);
                let lobe = |wo| f64::from(cos_alpha_power(wo, wi, exponent));
                let n = f64::from(exponent);
                let a = integrate_hemisphere(300, 600, |wo| lobe(wo) * f64::from(wo.z)) * (n + 2.0) / TAU;
                let b = integrate_hemisphere(300, 600, lobe);
                let found = (lobe_albedo(exponent, wi.z), lobe_solid_angle_sr(exponent, wi.z));
                assert!((f64::from(found.0) - a).abs() < 2e-4, "n {exponent}, {theta}: {} {a}", found.0);
                assert!(
                    (f64::from(found.1) / b - 1.0).abs() < 2e-3,
                    "n {exponent}, {theta}: {} {b}",
                    found.1
                );
            }
        }
        assert!((lobe_albedo(1e5, 1.0) - 1.0).abs() < 1e-6 && (lobe_albedo(1e5, 0.0) - 0.5).abs() < 0.51);
    }
}

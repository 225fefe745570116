//! Retro-reflection index: how much a sample sends back to the lamp rather than on to the mirror direction.
//!
//! index = mean BRDF within 15 deg of the lamp's direction / mean BRDF within 15 deg of the mirror direction.
//!
//! The mean over a cap C is weighted by solid angle and needs no bins:
//! `mean = sum over paths in C of w / |cos| / (N |C|)`, where |C| is the solid angle of the part of the cap
//! above the horizon (reflection only). In the last degree above the horizon 1/|cos| is replaced by its
//! mean over that ring, 2 / cos 89 deg: exact where f is constant there, and the variance stays finite.
//!
//! | symbol | here | unit | default |
//! |---|---|---|---|
//! | cap | [`CAP_HALF_ANGLE_DEG`] | deg | 15 |
//!
//! Limits: at normal incidence both caps are one and the index is 1 by definition (`caps_at_normal`); below
//! 15 deg they overlap. A Lambert sample has index 1, a glossy one less than 1 (tests in
//! `goniophotometer`). The name and the cap are our reading of the thesis' finding that petals send light
//! back to the source.

use glam::Vec3;

/// Half angle of both caps, degrees.
pub const CAP_HALF_ANGLE_DEG: f64 = 15.0;

const COS_89: f32 = 0.017_452_406;

/// The two caps of one incidence, in the instrument's frame (lamp at azimuth 0, +z the lit side's normal).
#[derive(Clone, Copy, Debug)]
pub struct RetroCaps {
    lamp: Vec3,
    mirror: Vec3,
    cos_half_angle: f32,
    /// Solid angle of each cap above the horizon, sr.
    pub solid_angle_sr: f64,
}

impl RetroCaps {
    /// Caps for a lamp at `incident_deg` from the normal.
    pub fn new(incident_deg: f64) -> Self {
        let (sin, cos) = incident_deg.to_radians().sin_cos();
        let lamp = Vec3::new(sin as f32, 0.0, cos as f32);
        Self {
            lamp,
            mirror: Vec3::new(-lamp.x, 0.0, lamp.z),
            cos_half_angle: CAP_HALF_ANGLE_DEG.to_radians().cos() as f32,
            solid_angle_sr: cap_above_horizon_sr(incident_deg, CAP_HALF_ANGLE_DEG),
        }
    }

    /// What one path of weight 1 adds to `N` times the mean BRDF of (lamp's cap, mirror's cap), 1/sr.
    pub fn share(&self, w: Vec3) -> (f64, f64) {
        let inside = |axis: Vec3| w.z >= 0.0 && w.dot(axis) >= self.cos_half_angle;
        let (retro, mirror) = (inside(self.lamp), inside(self.mirror));
        if !(retro || mirror) {
            return (0.0, 0.0);
        }
        let inverse_cos = if w.z < COS_89 { 2.0 / COS_89 } else { 1.0 / w.z };
        let value = f64::from(inverse_cos) / self.solid_angle_sr;
        (if retro { value } else { 0.0 }, if mirror { value } else { 0.0 })
    }
}

/// Solid angle of the part above the horizon of a cap whose axis is `axis_deg` from the normal, sr.
///
/// Rings about the axis: at b from the axis the azimuth psi with cos(b) cos(axis) + sin(b) sin(axis)
/// cos(psi) >= 0 is above the horizon.
fn cap_above_horizon_sr(axis_deg: f64, half_angle_deg: f64) -> f64 {
    let (axis, half_angle) = (axis_deg.to_radians(), half_angle_deg.to_radians());
    let n = 4096;
    let step = half_angle / f64::from(n);
    (0..n)
        .map(|i| {
            let b = (f64::from(i) + 0.5) * step;
            let cos_limit = -1.0 / (b.tan() * axis.tan());
            2.0 * cos_limit.clamp(-1.0, 1.0).acos() * b.sin() * step
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    #[test]
    fn cap_solid_angles() {
        let whole = TAU * (1.0 - 15f64.to_radians().cos());
        for axis in [0.0, 1e-6, 30.0, 60.0, 75.0] {
            assert!((cap_above_horizon_sr(axis, 15.0) / whole - 1.0).abs() < 1e-6, "{axis}");
        }
        // Half the cap is above the horizon when its axis lies in it; in between it shrinks.
        assert!((cap_above_horizon_sr(90.0, 15.0) / whole - 0.5).abs() < 1e-6);
        let cut = cap_above_horizon_sr(85.0, 15.0) / whole;
        assert!(0.5 < cut && cut < 1.0);
        // A hemisphere about an axis at `t` shares a lune of angle pi - t with the upper one.
        let lune = cap_above_horizon_sr(40.0, 90.0);
        assert!((lune - 2.0 * 140f64.to_radians()).abs() < 1e-4, "{lune}");
    }

    #[test]
    fn caps_at_normal() {
        let caps = RetroCaps::new(0.0);
        let (retro, mirror) = caps.share(Vec3::new(0.1, 0.0, 0.995));
        assert!(retro > 0.0 && retro == mirror);
        let caps = RetroCaps::new(60.0);
        let lamp = Vec3::new(60f32.to_radians().sin(), 0.0, 0.5);
        assert!(caps.share(lamp).0 > 0.0 && caps.share(lamp).1 == 0.0);
        assert_eq!(caps.share(-lamp), (0.0, 0.0));
    }
}

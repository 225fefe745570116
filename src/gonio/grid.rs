//! Bins of exitant directions, with their exact measures.
//!
//! Grid: bins of equal polar angle and equal azimuth over the whole sphere. Theta runs 0-180 deg from the
//! normal of the lit side; above 90 is transmission. Azimuth bins are centred on multiples of the step, so
//! that lamp (0) and mirror (180) lie in the middle of a bin.
//!
//! - solid angle = d_phi (cos t0 - cos t1), sr
//! - projected solid angle = integral of |cos| = d_phi |sin^2 t1 - sin^2 t0| / 2, sr
//!
//! Scan: a strip of constant half width h about the plane of incidence, cut at equal signed angles. With
//! the direction w = (cos d sin a, sin d, cos d cos a), a is the signed angle in the plane (positive on the
//! lamp's side, beyond +-90 deg transmission) and d the elevation out of it, |d| <= h. Unlike a wedge of
//! azimuth, the strip does not shrink to nothing at the normal.
//!
//! - solid angle = 2 sin(h) d_a, sr
//! - projected solid angle = (h + sin h cos h) |sin a1 - sin a0|, sr
//!
//! Limits: steps divide 90 deg, so that no bin straddles the horizon (`rejects_bad_steps`). Measures are
//! guarded by `measures_add_up`, look-up by `every_direction_has_its_bin`.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::{Error, Result};

/// Equal steps of theta and phi over the sphere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExitantGrid {
    /// Polar step, degrees; divides 90.
    pub theta_step_deg: f64,
    /// Azimuth step, degrees; divides 360.
    pub phi_step_deg: f64,
}

impl Default for ExitantGrid {
    fn default() -> Self {
        Self { theta_step_deg: 5.0, phi_step_deg: 10.0 }
    }
}

/// Number of whole steps in `span`, if it is a positive whole number.
fn steps(span_deg: f64, step_deg: f64) -> Option<usize> {
    let n = (span_deg / step_deg).round();
    let fits = step_deg > 0.0 && (1.0..=36_000.0).contains(&n) && (n * step_deg - span_deg).abs() < 1e-9;
    fits.then_some(n as usize)
}

impl ExitantGrid {
    /// A grid whose steps fit, or an error that names the key.
    pub fn new(theta_step_deg: f64, phi_step_deg: f64) -> Result<Self> {
        let grid = Self { theta_step_deg, phi_step_deg };
        grid.validate()?;
        Ok(grid)
    }

    /// Checks that theta steps divide 90 deg and phi steps 360 deg.
    pub fn validate(&self) -> Result<()> {
        if steps(90.0, self.theta_step_deg).is_none() {
            let what = format!("{} does not divide 90 deg", self.theta_step_deg);
            return Err(Error::invalid("gonio.theta_step_deg", what));
        }
        if steps(360.0, self.phi_step_deg).is_none() {
            let what = format!("{} does not divide 360 deg", self.phi_step_deg);
            return Err(Error::invalid("gonio.phi_step_deg", what));
        }
        Ok(())
    }

    /// Polar bins over 0-180 deg.
    pub fn thetas(&self) -> usize {
        (180.0 / self.theta_step_deg).round() as usize
    }

    /// Azimuth bins.
    pub fn phis(&self) -> usize {
        (360.0 / self.phi_step_deg).round() as usize
    }

    /// Number of bins; bin `i` is polar bin `i / phis`, azimuth bin `i % phis`.
    pub fn len(&self) -> usize {
        self.thetas() * self.phis()
    }

    /// Never true for a valid grid.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bin of a unit direction. A direction in the surface counts as reflection.
    pub fn bin(&self, w: Vec3) -> usize {
        let (thetas, phis) = (self.thetas(), self.phis());
        let [x, y, z] = w.as_dvec3().to_array();
        let theta_deg = x.hypot(y).atan2(z).to_degrees();
        let row = (theta_deg / self.theta_step_deg) as usize;
        // Rounding must not carry a direction through the horizon.
        let row = if z >= 0.0 { row.min(thetas / 2 - 1) } else { row.clamp(thetas / 2, thetas - 1) };
        let phi = y.atan2(x).to_degrees() / self.phi_step_deg;
        let column = (phi + phis as f64 + 0.5) as usize % phis;
        row * phis + column
    }

    /// Polar limits of a bin, degrees.
    pub fn theta_limits_deg(&self, bin: usize) -> (f64, f64) {
        let row = (bin / self.phis()) as f64;
        (row * self.theta_step_deg, (row + 1.0) * self.theta_step_deg)
    }

    /// Centre `(theta, phi)` of a bin, degrees.
    pub fn centre_deg(&self, bin: usize) -> (f64, f64) {
        let (t0, t1) = self.theta_limits_deg(bin);
        ((t0 + t1) / 2.0, (bin % self.phis()) as f64 * self.phi_step_deg)
    }

    /// Solid angle of a bin, sr.
    pub fn solid_angle_sr(&self, bin: usize) -> f64 {
        let (t0, t1) = self.theta_limits_deg(bin);
        // cos t0 - cos t1 without cancellation at the poles.
        let (mid, half) = ((t0 + t1).to_radians() / 2.0, (t1 - t0).to_radians() / 2.0);
        self.phi_step_deg.to_radians() * 2.0 * mid.sin() * half.sin()
    }

    /// Integral of |cos(theta)| over a bin, sr.
    pub fn projected_solid_angle_sr(&self, bin: usize) -> f64 {
        let (t0, t1) = self.theta_limits_deg(bin);
        // sin^2 t1 - sin^2 t0 = sin(t1 + t0) sin(t1 - t0).
        let (sum, difference) = ((t0 + t1).to_radians(), (t1 - t0).to_radians());
        self.phi_step_deg.to_radians() * (sum.sin() * difference.sin()).abs() / 2.0
    }
}

/// Equal steps of the signed angle in the plane of incidence, over the full circle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlaneScan {
    /// Step of the signed angle, degrees; divides 90.
    pub step_deg: f64,
    /// Half width of the strip, degrees out of the plane.
    pub half_width_deg: f64,
}

impl Default for PlaneScan {
    fn default() -> Self {
        Self { step_deg: 2.5, half_width_deg: 6.0 }
    }
}

impl PlaneScan {
    /// Checks that the step divides 90 deg and the width is an angle.
    pub fn validate(&self) -> Result<()> {
        if steps(90.0, self.step_deg).is_none() {
            return Err(Error::invalid(
                "gonio.scan_step_deg",
                format!("{} does not divide 90 deg", self.step_deg),
            ));
        }
        if !(self.half_width_deg > 0.0 && self.half_width_deg <= 45.0) {
            return Err(Error::invalid(
                "gonio.scan_half_width_deg",
                format!("{} is not in 0-45 deg", self.half_width_deg),
            ));
        }
        Ok(())
    }

    /// Number of bins from -180 to 180 deg.
    pub fn len(&self) -> usize {
        (360.0 / self.step_deg).round() as usize
    }

    /// Never true for a valid scan.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bin of a unit direction; `None` outside the strip.
    pub fn bin(&self, w: Vec3) -> Option<usize> {
        let [x, y, z] = w.as_dvec3().to_array();
        if y.abs() > self.half_width_deg.to_radians().sin() {
            return None;
        }
        let n = self.len();
        let i = ((x.atan2(z).to_degrees() + 180.0) / self.step_deg) as usize;
        let reflected = n / 4..3 * n / 4;
        Some(match (z >= 0.0, x >= 0.0) {
            (true, _) => i.clamp(reflected.start, reflected.end - 1),
            (false, true) => i.clamp(reflected.end, n - 1),
            (false, false) => i.min(reflected.start - 1),
        })
    }

    /// Signed angle at the middle of a bin, degrees: positive on the lamp's side, beyond +-90 transmission.
    pub fn centre_deg(&self, bin: usize) -> f64 {
        (bin as f64 + 0.5) * self.step_deg - 180.0
    }

    /// Solid angle of every bin, sr.
    pub fn solid_angle_sr(&self) -> f64 {
        2.0 * self.half_width_deg.to_radians().sin() * self.step_deg.to_radians()
    }

    /// Integral of |cos(theta)| over a bin, sr.
    pub fn projected_solid_angle_sr(&self, bin: usize) -> f64 {
        let h = self.half_width_deg.to_radians();
        // sin a1 - sin a0 = 2 cos(mid) sin(half).
        let (mid, half) = (self.centre_deg(bin).to_radians(), self.step_deg.to_radians() / 2.0);
        (h + h.sin() * h.cos()) * 2.0 * mid.cos().abs() * half.sin()
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::math::frame::spherical;

    #[test]
    fn measures_add_up() {
        for (t, p) in [(5.0, 10.0), (2.5, 7.5), (90.0, 360.0), (1.0, 1.0)] {
            let g = ExitantGrid::new(t, p).unwrap();
            let solid: f64 = (0..g.len()).map(|i| g.solid_angle_sr(i)).sum();
            let projected: f64 = (0..g.len()).map(|i| g.projected_solid_angle_sr(i)).sum();
            assert!((solid - 4.0 * PI).abs() < 1e-10 && (projected - 2.0 * PI).abs() < 1e-10);
        }
        // The whole strip: area 2 sin(h) 2 pi; against a midpoint rule for the projected part.
        let s = PlaneScan { step_deg: 3.0, half_width_deg: 10.0 };
        let h = 10f64.to_radians();
        assert!((s.solid_angle_sr() * s.len() as f64 - 4.0 * PI * h.sin()).abs() < 1e-12);
        for bin in [0, 31, 60, 88, 89, 90] {
            let (mut sum, n) = (0.0, 400);
            for i in 0..n {
                let d = h * (2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0);
                for j in 0..n {
                    let a = s.centre_deg(bin) + 3.0 * ((f64::from(j) + 0.5) / f64::from(n) - 0.5);
                    sum += (d.cos() * d.cos() * a.to_radians().cos()).abs();
                }
            }
            let numeric = sum * 2.0 * h * 3f64.to_radians() / f64::from(n * n);
            assert!((numeric / s.projected_solid_angle_sr(bin) - 1.0).abs() < 1e-4, "{bin}");
        }
    }

    #[test]
    fn every_direction_has_its_bin() {
        let (g, s) = (ExitantGrid::default(), PlaneScan::default());
        for bin in 0..g.len() {
            let (theta, phi) = g.centre_deg(bin);
            for (dt, dp) in [(0.0, 0.0), (2.4, 4.9), (-2.4, -4.9)] {
                let w = spherical((theta + dt).to_radians() as f32, (phi + dp).to_radians() as f32);
                assert_eq!(g.bin(w), bin, "{theta} {phi}");
            }
        }
        for bin in 0..s.len() {
            let a = s.centre_deg(bin).to_radians() as f32;
            assert_eq!(s.bin(Vec3::new(a.sin(), 0.0, a.cos())), Some(bin));
            assert_eq!(s.bin(Vec3::new(0.99 * a.sin(), 0.13, 0.99 * a.cos())), None);
        }
        // The horizon and the poles belong to a definite side.
        let half = g.len() / 2;
        assert!(g.bin(Vec3::X) < half && g.bin(Vec3::new(-1.0, 0.0, -0.0)) < half);
        assert!(g.bin(Vec3::new(1.0, 0.0, -1e-9)) >= half && g.bin(-Vec3::Z) < g.len());
        assert_eq!(s.centre_deg(s.bin(Vec3::X).unwrap()), 88.75);
        assert_eq!(s.centre_deg(s.bin(-Vec3::X).unwrap()), -88.75);
        assert_eq!(s.centre_deg(s.bin(Vec3::new(-1.0, 0.0, -1e-9)).unwrap()), -91.25);
        assert!(s.bin(-Vec3::Z).is_some());
    }

    #[test]
    fn rejects_bad_steps() {
        for (t, p) in [(0.0, 10.0), (7.0, 10.0), (5.0, -1.0), (f64::NAN, 10.0), (5.0, 361.0)] {
            assert!(ExitantGrid::new(t, p).is_err(), "{t} {p}");
        }
        assert!(PlaneScan { step_deg: 2.0, half_width_deg: 0.0 }.validate().is_err());
        assert!(PlaneScan { step_deg: 2.7, half_width_deg: 5.0 }.validate().is_err());
    }
}

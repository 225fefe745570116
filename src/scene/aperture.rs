//! The opening of a lens: a disc, or the polygon that straight blades leave.
//!
//! Model: points uniform by area over a disc of radius R, or over the regular polygon of n corners on its circle,
//! the first of them at the angle `rotation` from the picture's right:
//!
//! ```text
//! disc     x = R concentric(u)
//! polygon  x = R (b1 c_k + b2 c_(k+1)),  k = floor(n u.x),  (b0, b1, b2) uniform on the triangle (0, c_k, c_(k+1))
//! ```
//!
//! A point of light out of focus is seen as this shape, seen upside down behind the sharp plane. Real blades are a
//! little curved and the opening's light falls off towards its rim; both are left out.
//! Guarded by `points_are_uniform_within_the_blades`. Source: our reading.

use std::f32::consts::TAU;

use glam::Vec2;

use crate::math::warp;

/// An opening around the lens' axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Aperture {
    /// Radius of the circle around it, mm; 0 is a pinhole.
    pub radius_mm: f32,
    /// Corners; 0 is a disc.
    pub blades: u32,
    /// Angle of the first corner from the picture's right, radians.
    pub rotation: f32,
}

impl Aperture {
    /// A point of it, mm.
    pub fn sample(&self, u: Vec2) -> Vec2 {
        if self.blades < 3 {
            return warp::square_to_disc(u) * self.radius_mm;
        }
        let n = self.blades as f32;
        let k = (u.x * n).floor().min(n - 1.0);
        let corner = |k: f32| Vec2::from_angle(self.rotation + TAU * k / n);
        let b = warp::square_to_triangle(Vec2::new(u.x * n - k, u.y));
        (corner(k) * b.y + corner(k + 1.0) * b.z) * self.radius_mm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_uniform_within_the_blades() {
        for blades in [3u32, 5, 6, 9] {
            let aperture = Aperture { radius_mm: 2.0, blades, rotation: 0.3 };
            let sector = TAU / blades as f32;
            // Distance of the sides from the middle.
            let inner = 2.0 * (sector / 2.0).cos();
            let n = 180;
            let (mut moment, mut mean) = (0.0f64, Vec2::ZERO);
            for i in 0..n * n {
                let p = aperture.sample(Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32);
                let angle = (p.to_angle() - 0.3).rem_euclid(sector) - sector / 2.0;
                assert!(p.length() * angle.cos() <= inner + 1e-4, "{blades} blades: {p}");
                moment += f64::from(p.length_squared());
                mean += p;
            }
            let count = f64::from(n * n);
            // Second moment of the regular polygon about its middle: (R^2 / 2)(1 - 2/3 sin^2(pi / n)).
            let expected = 2.0 * (1.0 - 2.0 / 3.0 * f64::from((sector / 2.0).sin()).powi(2));
            assert!((moment / count / expected - 1.0).abs() < 2e-3, "{blades} blades: {moment}");
            assert!(mean.length() / (count as f32) < 5e-3, "{blades} blades: {mean}");
        }
        let disc = Aperture { radius_mm: 2.0, blades: 0, rotation: 0.0 };
        assert!((disc.sample(Vec2::new(1.0, 0.5)) - Vec2::new(2.0, 0.0)).length() < 1e-6);
    }
}

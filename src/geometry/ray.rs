//! Rays, and leaving a surface without hitting it again.

use glam::Vec3;

/// Half line from `origin` along the unit vector `direction`, up to `t_max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Start, mm.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Largest distance, mm.
    pub t_max: f32,
}

impl Ray {
    /// Unbounded ray.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, direction, t_max: f32::INFINITY }
    }

    /// Point at distance `t`.
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }
}

/// Moves `p` off a surface with geometric normal `ng` to the side of `direction`, by a distance that grows
/// with the rounding error of `p`: an integer step of the floats' bits away from the origin, a fixed step
/// near it (Waechter and Binder, Ray Tracing Gems 2019, chapter 6).
pub fn offset_origin(p: Vec3, ng: Vec3, direction: Vec3) -> Vec3 {
    const ORIGIN: f32 = 1.0 / 32.0;
    const FLOAT_SCALE: f32 = 1.0 / 65536.0;
    const INT_SCALE: f32 = 256.0;
    let n = if ng.dot(direction) >= 0.0 { ng } else { -ng };
    let step = |p: f32, n: f32| {
        if p.abs() < ORIGIN {
            p + FLOAT_SCALE * n
        } else {
            let of = (INT_SCALE * n) as i32;
            f32::from_bits((p.to_bits() as i32).wrapping_add(if p < 0.0 { -of } else { of }) as u32)
        }
    };
    Vec3::new(step(p.x, n.x), step(p.y, n.y), step(p.z, n.z))
}

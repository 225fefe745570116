//! Watertight ray-triangle intersection.
//!
//! Model: the ray is sheared so that it runs along +z from the origin; three 2D edge functions decide. An edge
//! shared by two triangles gives exactly opposite values, so no ray passes between them; a value of exactly
//! zero is computed again in f64 (Woop, Benthin, Wald 2013, "Watertight ray/triangle intersection", JCGT 2:1).
//! Guarded by `closed_mesh_has_no_leaks`.

use glam::Vec3;

use super::ray::Ray;

/// A ray with its shear, computed once for all triangles.
#[derive(Clone, Copy, Debug)]
pub struct ShearedRay {
    origin: Vec3,
    axes: [usize; 3],
    shear: Vec3,
}

/// Distance and barycentric coordinates of a hit: `p = b0 p0 + b1 p1 + b2 p2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// Distance, in the unit of the ray.
    pub t: f32,
    /// Barycentric coordinates.
    pub b: Vec3,
}

impl ShearedRay {
    /// Prepares `ray`.
    pub fn new(ray: &Ray) -> Self {
        let d = ray.direction;
        let z = d.abs().max_position();
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        // Keep the winding, so that the signs of the edge functions mean the same for all rays.
        if d[z] < 0.0 {
            std::mem::swap(&mut x, &mut y);
        }
        Self { origin: ray.origin, axes: [x, y, z], shear: Vec3::new(d[x] / d[z], d[y] / d[z], 1.0 / d[z]) }
    }

    /// Nearest hit with `0 < t < t_max`, from either side.
    #[inline]
    pub fn intersect(&self, corners: &[Vec3; 3], t_max: f32) -> Option<TriangleHit> {
        let [kx, ky, kz] = self.axes;
        let sheared = corners.map(|p| {
            let p = p - self.origin;
            (p[kx] - self.shear.x * p[kz], p[ky] - self.shear.y * p[kz], p[kz])
        });
        let [a, b, c] = sheared;
        let mut u = c.0 * b.1 - c.1 * b.0;
        let mut v = a.0 * c.1 - a.1 * c.0;
        let mut w = b.0 * a.1 - b.1 * a.0;
        if u == 0.0 || v == 0.0 || w == 0.0 {
            let cross = |p: (f32, f32, f32), q: (f32, f32, f32)| {
                (f64::from(p.0) * f64::from(q.1) - f64::from(p.1) * f64::from(q.0)) as f32
            };
            u = cross(c, b);
            v = cross(a, c);
            w = cross(b, a);
        }
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let det = u + v + w;
        if det == 0.0 {
            return None;
        }
        let t = self.shear.z * (u * a.2 + v * b.2 + w * c.2) / det;
        // Written so that NaN misses.
        if t > 0.0 && t < t_max { Some(TriangleHit { t, b: Vec3::new(u, v, w) / det }) } else { None }
    }
}

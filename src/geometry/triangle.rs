//! Watertight ray-triangle intersection.
//!
//! Model: the ray is sheared so that it runs along +z from the origin; three 2D edge functions decide. An edge
//! shared by two triangles gives exactly opposite values, so no ray passes between them; a value of exactly
//! zero is computed again in f64 (Woop, Benthin, Wald 2013, "Watertight ray/triangle intersection", JCGT 2:1). A
//! distance that may be a rounding error (Pharr, Jakob, Humphreys 2016, section 3.9) is computed again too.
//! Guarded by `closed_mesh_has_no_leaks`, `large_triangles_are_left_for_good`.

use glam::Vec3;

use super::ray::Ray;

/// A ray with its shear, computed once for all triangles.
#[derive(Clone, Copy, Debug)]
pub struct ShearedRay {
    origin: Vec3,
    direction: Vec3,
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
        Self {
            origin: ray.origin,
            direction: d,
            axes: [x, y, z],
            shear: Vec3::new(d[x] / d[z], d[y] / d[z], 1.0 / d[z]),
        }
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
        let mut t = self.shear.z * (u * a.2 + v * b.2 + w * c.2) / det;
        if t.abs() <= self.error_of_t(&sheared, [u, v, w], det) {
            t = self.exact_distance(corners);
        }
        // Written so that NaN misses.
        if t > 0.0 && t < t_max { Some(TriangleHit { t, b: Vec3::new(u, v, w) / det }) } else { None }
    }

    /// Distance to the triangle's plane in f64.
    #[cold]
    fn exact_distance(&self, corners: &[Vec3; 3]) -> f32 {
        let [a, b, c] = corners.map(|p| p.as_dvec3());
        let n = (b - a).cross(c - a);
        (n.dot(a - self.origin.as_dvec3()) / n.dot(self.direction.as_dvec3())) as f32
    }

    /// Bound on the rounding error of the distance. A nearer hit may lie behind the origin: taken as it is, a ray
    /// that leaves a large triangle at a grazing angle would meet that triangle again.
    fn error_of_t(&self, sheared: &[(f32, f32, f32); 3], edges: [f32; 3], det: f32) -> f32 {
        let largest = |f: fn(&(f32, f32, f32)) -> f32| sheared.iter().map(f).fold(0.0, f32::max);
        let x = largest(|p| p.0.abs());
        let y = largest(|p| p.1.abs());
        let z = largest(|p| p.2.abs()) * self.shear.z.abs();
        let edge = edges.into_iter().map(f32::abs).fold(0.0, f32::max);
        let (error_x, error_y, error_z) = (gamma(5) * (x + z), gamma(5) * (y + z), gamma(3) * z);
        let error_edge = 2.0 * (gamma(2) * x * y + error_y * x + error_x * y);
        3.0 * (gamma(3) * edge * z + error_edge * z + error_z * edge) / det.abs()
    }
}

/// Bound on the relative error of n roundings (Higham 2002).
const fn gamma(n: u32) -> f32 {
    let e = n as f32 * (f32::EPSILON / 2.0);
    e / (1.0 - e)
}

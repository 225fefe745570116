//! Watertight ray-triangle intersection.
//!
//! Model: the ray is sheared so that it runs along +z from the origin; three 2D edge functions decide. An edge
//! shared by two triangles gives exactly opposite values, so no ray passes between them; a value of exactly
//! zero is computed again in f64 (Woop, Benthin, Wald 2013, "Watertight ray/triangle intersection", JCGT 2:1). A
//! distance that may be a rounding error (Pharr, Jakob, Humphreys 2016, section 3.9) is computed again too.
//! Guarded by `closed_mesh_has_no_leaks`, `large_triangles_are_left_for_good`.

use glam::{Mat3A, Vec3, Vec3A};

use super::ray::Ray;

/// A ray with its shear, computed once for all triangles.
#[derive(Clone, Copy, Debug)]
pub struct ShearedRay {
    origin: Vec3A,
    direction: Vec3A,
    /// To coordinates where the ray is the +z axis and z its distance.
    shear: Mat3A,
    /// Which axes become x, y and z, and how much of the third is added to, or is, each.
    axes: [usize; 3],
    slopes: [f32; 3],
}

/// Triangles that are tested at a time.
pub const WIDTH: usize = 8;

/// Triangles side by side: `[corner][axis][triangle]`; not a number where there is none.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct Packet(pub [[[f32; WIDTH]; 3]; 3]);

impl Packet {
    /// At most [`WIDTH`] triangles; the others are left out.
    pub fn new(triangles: impl IntoIterator<Item = [Vec3A; 3]>) -> Self {
        let mut out = [[[f32::NAN; WIDTH]; 3]; 3];
        for (lane, corners) in triangles.into_iter().take(WIDTH).enumerate() {
            for (to, corner) in out.iter_mut().zip(corners) {
                for (to, from) in to.iter_mut().zip(corner.to_array()) {
                    to[lane] = from;
                }
            }
        }
        Self(out)
    }

    #[inline(always)]
    fn triangle(&self, lane: usize) -> [Vec3A; 3] {
        self.0.map(|corner| Vec3A::new(corner[0][lane], corner[1][lane], corner[2][lane]))
    }
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
        let mut columns = [Vec3A::ZERO; 3];
        columns[x].x = 1.0;
        columns[y].y = 1.0;
        let slopes = [-d[x] / d[z], -d[y] / d[z], 1.0 / d[z]];
        columns[z] = slopes.into();
        let shear = Mat3A::from_cols(columns[0], columns[1], columns[2]);
        Self { origin: ray.origin.into(), direction: d.into(), shear, axes: [x, y, z], slopes }
    }

    /// Nearest hit with `0 < t < t_max` of the triangles of a packet, and which one. The same arithmetic as that of one triangle
    /// finds those whose edges the ray may pass between; they are few, and tested one by one.
    #[inline(always)]
    pub fn intersect_packet(&self, packet: &Packet, t_max: f32) -> Option<(usize, TriangleHit)> {
        let origin = self.origin.to_array();
        let ([x, y, z], [slope_x, slope_y, _]) = (self.axes, self.slopes);
        let mut sheared = [[[0.0f32; WIDTH]; 2]; 3];
        for (to, corner) in sheared.iter_mut().zip(&packet.0) {
            for lane in 0..WIDTH {
                let along = corner[z][lane] - origin[z];
                to[0][lane] = (corner[x][lane] - origin[x]) + slope_x * along;
                to[1][lane] = (corner[y][lane] - origin[y]) + slope_y * along;
            }
        }
        let [a, b, c] = &sheared;
        let mut between = [false; WIDTH];
        for lane in 0..WIDTH {
            let u = c[0][lane] * b[1][lane] - c[1][lane] * b[0][lane];
            let v = a[0][lane] * c[1][lane] - a[1][lane] * c[0][lane];
            let w = b[0][lane] * a[1][lane] - b[1][lane] * a[0][lane];
            // An edge of exactly zero is to be looked at again, whatever the others are.
            let zero = (u == 0.0) | (v == 0.0) | (w == 0.0);
            let front = (u > 0.0) & (v > 0.0) & (w > 0.0);
            let back = (u < 0.0) & (v < 0.0) & (w < 0.0);
            between[lane] = zero | front | back;
        }
        let mut nearest: Option<(usize, TriangleHit)> = None;
        if between == [false; WIDTH] {
            return nearest;
        }
        for lane in (0..WIDTH).filter(|lane| between[*lane]) {
            let t_max = nearest.map_or(t_max, |n| n.1.t);
            if let Some(hit) = self.intersect(&packet.triangle(lane), t_max) {
                nearest = Some((lane, hit));
            }
        }
        nearest
    }

    /// Nearest hit with `0 < t < t_max`, from either side.
    #[inline(always)]
    pub fn intersect(&self, corners: &[Vec3A; 3], t_max: f32) -> Option<TriangleHit> {
        // A product with a zero or a one is exact: the only roundings are those of the shear.
        let [a, b, c] = corners.map(|p| self.shear * (p - self.origin));
        let mut u = c.x * b.y - c.y * b.x;
        let mut v = a.x * c.y - a.y * c.x;
        let mut w = b.x * a.y - b.y * a.x;
        if u == 0.0 || v == 0.0 || w == 0.0 {
            [u, v, w] = [(c, b), (a, c), (b, a)].map(|(p, q)| exact_edge(p, q));
        }
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let det = u + v + w;
        if det == 0.0 {
            return None;
        }
        let mut t = (u * a.z + v * b.z + w * c.z) / det;
        // Far hits first: most triangles that a ray's line meets lie behind or beyond.
        if t.is_nan() || t >= t_max {
            return None;
        }
        let largest = a.abs().max(b.abs()).max(c.abs());
        if t.abs() <= error_of_t(largest, u.abs().max(v.abs()).max(w.abs()), det) {
            t = self.exact_distance(corners);
        }
        if t > 0.0 && t < t_max { Some(TriangleHit { t, b: Vec3::new(u, v, w) / det }) } else { None }
    }

    /// Distance to the triangle's plane in f64.
    #[cold]
    fn exact_distance(&self, corners: &[Vec3A; 3]) -> f32 {
        let [a, b, c] = corners.map(|p| p.as_dvec3());
        let n = (b - a).cross(c - a);
        (n.dot(a - self.origin.as_dvec3()) / n.dot(self.direction.as_dvec3())) as f32
    }
}

/// An edge function in f64.
#[cold]
fn exact_edge(p: Vec3A, q: Vec3A) -> f32 {
    (f64::from(p.x) * f64::from(q.y) - f64::from(p.y) * f64::from(q.x)) as f32
}

/// Bound on the rounding error of the distance, from the largest sheared coordinates and edge function. A nearer
/// hit may lie behind the origin: taken as it is, a ray that leaves a large triangle at a grazing angle would meet
/// that triangle again.
fn error_of_t(largest: Vec3A, edge: f32, det: f32) -> f32 {
    let Vec3 { x, y, z } = largest.into();
    let (error_x, error_y, error_z) = (gamma(5) * (x + z), gamma(5) * (y + z), gamma(3) * z);
    let error_edge = 2.0 * (gamma(2) * x * y + error_y * x + error_x * y);
    3.0 * (gamma(3) * edge * z + error_edge * z + error_z * edge) / det.abs()
}

/// Bound on the relative error of n roundings (Higham 2002).
const fn gamma(n: u32) -> f32 {
    let e = n as f32 * (f32::EPSILON / 2.0);
    e / (1.0 - e)
}

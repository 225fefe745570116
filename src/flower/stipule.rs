//! Stipules: two narrow wings grown to the foot of a leaf's stalk, each with a free point.
//!
//! Model: a strip along the side of the stalk, t from 0 at its foot to 1: its outer edge stands off the stalk by
//! width (0.5 + 0.5 t) sin(pi t / 1.6)^0.5, its inner edge touches the stalk up to t = 0.82 and then leaves it, so that
//! the last part is a free point that turns outwards. Our reading of garden roses.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use crate::flower::leaf::StalkPoint;
use crate::flower::sheet::{Sheet, mesh};
use crate::geometry::Mesh;

/// One stipule on its stalk.
pub struct Stipule<'a> {
    /// 1 = right of the stalk, -1 = left.
    pub side: f64,
    /// Length, mm.
    pub length_mm: f64,
    /// Width, mm.
    pub width_mm: f64,
    /// Where it begins along the stalk, mm.
    pub start_mm: f64,
    /// The stalk, by the distance along it.
    pub stalk: &'a dyn Fn(f64) -> StalkPoint,
    /// How far from the middle of the stalk it begins, by the distance along it, mm.
    pub radius_mm: &'a dyn Fn(f64) -> f64,
}

/// Where the free point begins.
const FREE: f64 = 0.82;

impl Stipule<'_> {
    /// Meshes it.
    pub fn mesh(&self, detail: f64) -> Mesh {
        let n = |n: f64| ((n * detail).round() as usize).max(2);
        mesh(self, n(2.0), n(9.0), 1.0)
    }

    /// Inner and outer edge, mm from the stalk's surface.
    fn edges_mm(&self, t: f64) -> (f64, f64) {
        let free = ((t - FREE) / (1.0 - FREE)).max(0.0);
        let outer = self.width_mm * (0.5 + 0.5 * t) * (0.05 + (PI * t / 1.6).sin().max(0.0)).sqrt();
        let inner = outer * free.powf(0.7);
        (inner.min(outer - 0.06), outer + 0.5 * self.width_mm * free * free)
    }
}

impl Sheet for Stipule<'_> {
    fn at(&self, u: f64, v: f64) -> DVec3 {
        let s = self.start_mm + v * self.length_mm;
        let p = (self.stalk)(s);
        // From left to right seen from above, on either side.
        let part = if self.side > 0.0 { u } else { 1.0 - u };
        let (inner, outer) = self.edges_mm(v);
        let x = inner + (outer - inner) * part;
        let rise = 0.22 * x + 0.05 * self.width_mm * (9.0 * v).sin() * part;
        p.at + p.side * (self.side * ((self.radius_mm)(s) + x)) + p.up * rise
    }

    fn uv(&self, u: f64, v: f64) -> DVec2 {
        DVec2::new(u, v)
    }

    fn uv_scale_mm(&self) -> [f32; 2] {
        [self.width_mm as f32, self.length_mm as f32]
    }
}

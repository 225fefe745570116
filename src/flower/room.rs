//! The room that petals leave: outside for sepals, inside for stamens.
//!
//! Model: for slices of 0.5 mm along the axis, the smallest and the largest distance from the axis of all
//! triangles that reach into the slice or its neighbours, so that nothing between two slices is missed; between the
//! middles of slices linear. Guarded by `room_holds_no_petal`. Our reading.

use glam::{Vec2, Vec3};

use crate::geometry::Mesh;

/// Height of a slice, mm.
const SLICE_MM: f64 = 0.5;

/// Distances from the axis that petals take up, by height.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Room {
    low_mm: f64,
    /// Smallest and largest distance per slice; infinite and 0 where nothing is.
    slices: Vec<Slice>,
}

/// Smallest and largest distance from the axis.
type Slice = (f64, f64);

impl Room {
    /// The room around and inside these meshes.
    pub fn new<'a>(petals: impl IntoIterator<Item = &'a Mesh> + Clone) -> Self {
        Self::near(petals, f64::INFINITY)
    }

    /// The room around and inside the parts of these meshes that are nearer to the axis than this.
    pub fn near<'a>(petals: impl IntoIterator<Item = &'a Mesh> + Clone, radius_mm: f64) -> Self {
        let (low, high) = petals
            .clone()
            .into_iter()
            .map(Mesh::bounds)
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), (a, b)| (l.min(a.z), h.max(b.z)));
        if low.is_nan() || high.is_nan() || low > high {
            return Self::default();
        }
        let low_mm = f64::from(low) - 2.0 * SLICE_MM;
        let count = ((f64::from(high) - low_mm) / SLICE_MM).ceil() as usize + 3;
        let mut slices = vec![(f64::INFINITY, 0f64); count];
        let slice = |z: f32| (((f64::from(z) - low_mm) / SLICE_MM) as usize).min(count - 1);
        for mesh in petals {
            for face in 0..mesh.triangles.len() {
                let corners = mesh.corners(face);
                let [a, b, c] = corners.map(|p| p.z);
                let (near, far) = distances(&corners);
                if near > radius_mm {
                    continue;
                }
                let span =
                    slice(a.min(b).min(c)).saturating_sub(1)..=(slice(a.max(b).max(c)) + 1).min(count - 1);
                for s in &mut slices[span] {
                    *s = (s.0.min(near), s.1.max(far));
                }
            }
        }
        Self { low_mm, slices }
    }

    /// Distance from the axis within which no petal is at this height, mm; infinite above and below them.
    pub fn inner_mm(&self, z_mm: f64) -> f64 {
        self.between(z_mm).map_or(f64::INFINITY, |(a, b, t)| {
            // Half way to a slice without petals there may still be one.
            if a.0.is_finite() && b.0.is_finite() { a.0 + (b.0 - a.0) * t } else { a.0.min(b.0) }
        })
    }

    /// Distance from the axis beyond which no petal is at this height, mm; 0 above and below them.
    pub fn outer_mm(&self, z_mm: f64) -> f64 {
        self.between(z_mm).map_or(0.0, |(a, b, t)| a.1 + (b.1 - a.1) * t)
    }

    /// The slices below and above a height, and the part of the way from one to the other.
    fn between(&self, z_mm: f64) -> Option<(Slice, Slice, f64)> {
        let at = (z_mm - self.low_mm) / SLICE_MM - 0.5;
        if !(at >= 0.0 && at < self.slices.len() as f64 - 1.0) {
            return None;
        }
        let k = at as usize;
        Some((self.slices[k], self.slices[k + 1], at.fract()))
    }
}

/// Smallest and largest distance of a triangle from the axis.
fn distances(corners: &[Vec3; 3]) -> (f64, f64) {
    let p = corners.map(|c| c.truncate());
    let far = p.iter().map(|p| p.length()).fold(0.0, f32::max);
    let side = |i: usize| p[i].perp_dot(p[(i + 1) % 3]);
    let sides = [side(0), side(1), side(2)];
    if sides.iter().all(|s| *s > 0.0) || sides.iter().all(|s| *s < 0.0) {
        return (0.0, f64::from(far));
    }
    let edge = |a: Vec2, b: Vec2| {
        let along = b - a;
        let t = (-a.dot(along) / along.length_squared().max(1e-20)).clamp(0.0, 1.0);
        (a + along * t).length()
    };
    let near = edge(p[0], p[1]).min(edge(p[1], p[2])).min(edge(p[2], p[0]));
    (f64::from(near), f64::from(far))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flower::{OrganKind, RoseDescription, grow};

    #[test]
    fn room_holds_no_petal() {
        for name in ["hybrid_tea", "wild"] {
            let d = RoseDescription { detail: 0.4, ..name.parse().expect("a preset") };
            let flower = grow(&d).expect("grows");
            let petals: Vec<&Mesh> = flower.of_kind(OrganKind::Petal).map(|o| &o.mesh).collect();
            let room = Room::new(petals.iter().copied());
            let (mut least, mut most) = (f64::INFINITY, 0f64);
            for m in petals {
                for f in 0..m.triangles.len() {
                    let [a, b, c] = m.corners(f).map(|p| p.as_dvec3());
                    for (s, t) in [(0.0, 0.0), (0.5, 0.5), (0.3, 0.3), (0.9, 0.05), (0.0, 1.0)] {
                        let p = a + (b - a) * s + (c - a) * t;
                        let r = p.truncate().length();
                        assert!(
                            r > room.inner_mm(p.z) - 1e-5 && r < room.outer_mm(p.z) + 1e-5,
                            "{name}: {p}"
                        );
                        (least, most) = (least.min(r), most.max(r));
                    }
                }
            }
            // It is no larger than it must be.
            let slices = (0..200).map(|k| f64::from(k) * 0.5 - 30.0);
            let widest = slices.map(|z| room.outer_mm(z)).fold(0.0, f64::max);
            assert!((widest - most).abs() < 1.0, "{widest} {most}");
            assert_eq!((room.outer_mm(1e3), room.inner_mm(-1e3)), (0.0, f64::INFINITY));
        }
        assert_eq!(Room::new([]).outer_mm(0.0), 0.0);
    }
}

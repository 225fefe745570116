//! Tubes along a curve: stems, stalks of leaves, prickles, filaments.
//!
//! Model: rings of elliptic section stand across the curve; their frame is carried along it by projection, so
//! that it does not twist. Triangles are counter-clockwise seen from outside; u runs around, v along. The first
//! ring can be moved onto another organ ([`Seat`]), so that a tube stands on it without a gap and without
//! entering it; there the tube is open, elsewhere closed.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3, Vec2, Vec3};

use crate::geometry::Mesh;

/// A section of a tube.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ring {
    /// Its middle, mm.
    pub centre_mm: DVec3,
    /// Half axes along the frame's normal and across it, mm.
    pub radii_mm: DVec2,
}

impl Ring {
    /// A circle.
    pub fn circle(centre_mm: DVec3, radius_mm: f64) -> Self {
        Self { centre_mm, radii_mm: DVec2::splat(radius_mm) }
    }
}

/// A straight cylinder on which a tube stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seat {
    /// A point of the cylinder's axis, mm.
    pub centre_mm: DVec3,
    /// Unit vector along the axis.
    pub axis: DVec3,
    /// Radius, mm.
    pub radius_mm: f64,
    /// Unit direction in which the tube leaves.
    pub along: DVec3,
}

impl Seat {
    /// Distance of a point from the axis, mm.
    fn distance(&self, p: DVec3) -> f64 {
        (p - self.centre_mm).cross(self.axis).length()
    }

    /// The point on the cylinder to which `p` slides along the tube; `p` where it would miss the cylinder.
    pub fn place(&self, p: DVec3) -> DVec3 {
        let across = |v: DVec3| v - self.axis * v.dot(self.axis);
        let (from, step) = (across(p - self.centre_mm), across(self.along));
        let (a, b, c) =
            (step.length_squared(), from.dot(step), from.length_squared() - self.radius_mm * self.radius_mm);
        let root = b * b - a * c;
        if a < 1e-12 || root < 0.0 { p } else { p + self.along * ((root.sqrt() - b) / a) }
    }
}

/// Tube through at least two rings, closed but for a seat. `normal` is roughly the direction of the sections' first half axis.
pub fn tube(rings: &[Ring], normal: DVec3, around: usize, seat: Option<&Seat>) -> Mesh {
    let mut m = Mesh::default();
    let last = rings.len() - 1;
    let mut push = |p: DVec3, u: f64, v: f64| {
        m.positions.push(p.as_vec3());
        m.uvs.push(Vec2::new(u as f32, v as f32));
    };
    let mut normal = normal;
    // A seated ring stands off as far as its chords would otherwise cut into the cylinder.
    let mut foot = seat.copied();
    for (k, ring) in rings.iter().enumerate() {
        let ahead = rings[(k + 1).min(last)].centre_mm - rings[k.saturating_sub(1)].centre_mm;
        let tangent = ahead.normalize_or(DVec3::Z);
        normal = (normal - tangent * normal.dot(tangent)).normalize_or(tangent.any_orthonormal_vector());
        let across = tangent.cross(normal);
        if let (0, Some(s)) = (k, &mut foot) {
            s.radius_mm += (0..around)
                .map(|i| {
                    let [a, b] = [i, i + 1].map(|i| {
                        let (sin, cos) = (TAU * i as f64 / around as f64).sin_cos();
                        let (x, y) = (cos * ring.radii_mm.x, sin * ring.radii_mm.y);
                        s.place(ring.centre_mm + normal * x + across * y)
                    });
                    s.radius_mm - s.distance(0.5 * (a + b))
                })
                .fold(0.0, f64::max);
        }
        for i in 0..=around {
            // The seam is two columns of vertices at the same place, bit for bit.
            let (sin, cos) = (TAU * (i % around) as f64 / around as f64).sin_cos();
            let p = ring.centre_mm + normal * (cos * ring.radii_mm.x) + across * (sin * ring.radii_mm.y);
            let p = if k == 0 { foot.map_or(p, |s| s.place(p)) } else { p };
            push(p, i as f64 / around as f64, k as f64 / last as f64);
        }
    }
    push(rings[0].centre_mm, 0.5, 0.0);
    push(rings[last].centre_mm, 0.5, 1.0);
    let vertex = |i: usize, k: usize| (k * (around + 1) + i) as u32;
    let caps = (rings.len() * (around + 1)) as u32;
    for i in 0..around {
        for k in 0..last {
            let [a, b, c, d] = [vertex(i, k), vertex(i + 1, k), vertex(i, k + 1), vertex(i + 1, k + 1)];
            m.triangles.extend([[a, b, d], [a, d, c]]);
        }
        // A tube that stands on something needs no floor.
        if seat.is_none() {
            m.triangles.push([caps, vertex(i + 1, 0), vertex(i, 0)]);
        }
        m.triangles.push([caps + 1, vertex(i, last), vertex(i + 1, last)]);
    }
    m.compute_normals();
    for k in 0..rings.len() {
        let (a, b) = (vertex(0, k) as usize, vertex(around, k) as usize);
        let n = (m.normals[a] + m.normals[b]).normalize_or(Vec3::X);
        m.normals[a] = n;
        m.normals[b] = n;
    }
    m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seated_tube_touches_its_cylinder() {
        let along = DVec3::new(0.8, 0.0, 0.6);
        let seat = Seat { centre_mm: DVec3::new(0.0, 0.0, 3.0), axis: DVec3::Z, radius_mm: 2.0, along };
        let rings = [2.0, 6.0].map(|s| Ring::circle(along * s, 1.0));
        let m = tube(&rings, DVec3::Y, 16, Some(&seat));
        for p in &m.positions[..17] {
            let r = p.truncate().length();
            assert!((2.0..2.02).contains(&r) && p.x > 1.0, "{p}");
        }
        for p in &m.positions[17..34] {
            assert!(p.x > 3.0);
        }
        assert_eq!(m.triangles.len(), 16 * 3);
        // Beside the cylinder nothing is moved.
        assert_eq!(seat.place(DVec3::new(0.0, 3.0, 0.0)), DVec3::new(0.0, 3.0, 0.0));
    }

    #[test]
    fn a_bent_tube_does_not_twist() {
        let rings: Vec<Ring> = (0..40)
            .map(|k| {
                let (sin, cos) = (0.04 * f64::from(k)).sin_cos();
                Ring { centre_mm: DVec3::new(10.0 * sin, 0.0, 10.0 * cos), radii_mm: DVec2::new(0.5, 1.0) }
            })
            .collect();
        let m = tube(&rings, DVec3::Y, 12, None);
        m.validate("tube").expect("valid");
        // The first column stays in front, the circle lies in the plane y = 0.
        for k in 0..40 {
            assert!((m.positions[13 * k].y - 0.5).abs() < 1e-5);
        }
    }
}

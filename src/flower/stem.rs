//! Receptacle and stem: closed solids of revolution about a curve.
//!
//! Model: the receptacle is an urn (the later hip) whose rim carries petals and sepals; the stem is a tube
//! that leaves it downwards and bends a little, as a parabola of the depth. Triangles are counter-clockwise
//! seen from outside; u runs around, v from bottom to top.
//!
//! Sizes: hip 8-16 mm wide at bloom, flower stems 4-8 mm thick (our reading).

use std::f64::consts::TAU;

use glam::{DVec2, DVec3, Vec2, Vec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::flower::rose::check;
use crate::geometry::Mesh;

/// Receptacle and stem.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StemDescription {
    /// Length below the receptacle, mm (default 220).
    pub length_mm: f64,
    /// Radius of the stem, mm (default 2.6).
    pub radius_mm: f64,
    /// Sideways offset of the foot of the stem, mm (default 14).
    pub bend_mm: f64,
    /// Radius of the receptacle at the rim, mm (default 6).
    pub receptacle_radius_mm: f64,
    /// Height of the receptacle, mm (default 13).
    pub receptacle_height_mm: f64,
}

impl Default for StemDescription {
    fn default() -> Self {
        Self {
            length_mm: 220.0,
            radius_mm: 2.6,
            bend_mm: 14.0,
            receptacle_radius_mm: 6.0,
            receptacle_height_mm: 13.0,
        }
    }
}

impl StemDescription {
    /// Checks every key; `at` is the dotted path of this table.
    pub fn validate(&self, at: &str) -> Result<()> {
        check(at, "length_mm", self.length_mm, 1.0, 2000.0)?;
        check(at, "radius_mm", self.radius_mm, 0.1, 20.0)?;
        check(at, "bend_mm", self.bend_mm, -500.0, 500.0)?;
        check(at, "receptacle_radius_mm", self.receptacle_radius_mm, 1.0, 30.0)?;
        check(at, "receptacle_height_mm", self.receptacle_height_mm, 1.0, 60.0)
    }

    /// The receptacle, from the stem to the dome inside the petals.
    pub fn receptacle(&self, around: usize) -> (Mesh, [f32; 2]) {
        let (radius, height) = (self.receptacle_radius_mm, self.receptacle_height_mm);
        // (radius, height): a neck, the swollen hip, the rim, and the dome that carries the petals.
        let profile = [
            (0.95 * self.radius_mm, -height),
            (1.25 * self.radius_mm, -0.94 * height),
            (0.80 * radius, -0.80 * height),
            (1.02 * radius, -0.60 * height),
            (1.08 * radius, -0.40 * height),
            (1.02 * radius, -0.20 * height),
            (0.97 * radius, -0.08 * height),
            (0.90 * radius, -0.03 * height),
            (0.70 * radius, 0.05 * radius),
            (0.40 * radius, 0.28 * radius),
        ];
        let rings: Vec<_> = profile.iter().map(|&(r, z)| (DVec3::new(0.0, 0.0, z), r)).collect();
        (tube(&rings, around), [(TAU * radius) as f32, (1.4 * height) as f32])
    }

    /// The stem, from its foot to just inside the receptacle.
    pub fn stem(&self, around: usize, along: usize) -> (Mesh, [f32; 2]) {
        let rings: Vec<_> = (0..=along)
            .map(|k| {
                let depth = 1.0 - k as f64 / along as f64;
                let z = -0.9 * self.receptacle_height_mm - depth * self.length_mm;
                (DVec3::new(self.bend_mm * depth * depth, 0.0, z), self.radius_mm * (1.0 + 0.2 * depth))
            })
            .collect();
        (tube(&rings, around), [(TAU * self.radius_mm) as f32, self.length_mm as f32])
    }
}

/// Closed tube through horizontal circles (centre, radius) from bottom to top.
fn tube(rings: &[(DVec3, f64)], around: usize) -> Mesh {
    let mut m = Mesh::default();
    let last = (rings.len() - 1) as f64;
    let mut push = |p: DVec3, uv: DVec2| {
        m.positions.push(p.as_vec3());
        m.uvs.push(Vec2::new(uv.x as f32, uv.y as f32));
    };
    for (k, &(centre, r)) in rings.iter().enumerate() {
        for i in 0..=around {
            let u = i as f64 / around as f64;
            // The seam is two columns of vertices at the same place, bit for bit.
            let (sin, cos) = (TAU * (i % around) as f64 / around as f64).sin_cos();
            push(centre + DVec3::new(r * cos, r * sin, 0.0), DVec2::new(u, k as f64 / last));
        }
    }
    let (foot, top) = (rings[0].0, rings[rings.len() - 1].0);
    push(foot, DVec2::new(0.5, 0.0));
    push(top, DVec2::new(0.5, 1.0));
    let vertex = |i: usize, k: usize| (k * (around + 1) + i) as u32;
    let caps = (rings.len() * (around + 1)) as u32;
    for i in 0..around {
        for k in 0..rings.len() - 1 {
            let [a, b, c, d] = [vertex(i, k), vertex(i + 1, k), vertex(i, k + 1), vertex(i + 1, k + 1)];
            m.triangles.extend([[a, b, d], [a, d, c]]);
        }
        m.triangles.push([caps, vertex(i + 1, 0), vertex(i, 0)]);
        m.triangles.push([caps + 1, vertex(i, rings.len() - 1), vertex(i + 1, rings.len() - 1)]);
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

    /// Signed volume: positive if faces are counter-clockwise seen from outside.
    fn volume(m: &Mesh) -> f32 {
        (0..m.triangles.len())
            .map(|f| {
                let [a, b, c] = m.corners(f);
                a.dot(b.cross(c)) / 6.0
            })
            .sum()
    }

    #[test]
    fn solids_are_closed_and_face_outwards() {
        let d = StemDescription { bend_mm: 0.0, ..Default::default() };
        let (stem, _) = d.stem(64, 8);
        let (receptacle, _) = d.receptacle(64);
        // The frustum's volume, less what 64 sides cut off the circle (0.16 %).
        let (r, s) = (d.radius_mm, d.radius_mm * 1.2);
        let frustum = std::f64::consts::PI * d.length_mm / 3.0 * (r * r + r * s + s * s);
        assert!((f64::from(volume(&stem)) / frustum - 1.0).abs() < 0.003, "{} {frustum}", volume(&stem));
        assert!(volume(&receptacle) > 0.0);
        for m in [stem, receptacle] {
            m.validate("stem").expect("valid");
            // Each edge, by place, is walked once in each direction.
            let key = |i: u32| m.positions[i as usize].to_array().map(f32::to_bits);
            let mut edges = std::collections::HashMap::new();
            for t in &m.triangles {
                for e in 0..3 {
                    let (a, b) = (key(t[e]), key(t[(e + 1) % 3]));
                    *edges.entry(if a < b { (a, b) } else { (b, a) }).or_insert(0) +=
                        if a < b { 1 } else { -1 };
                }
            }
            assert!(edges.values().all(|&n| n == 0));
        }
    }
}

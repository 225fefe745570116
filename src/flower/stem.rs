//! Receptacle and stem: closed solids of revolution about a curve.
//!
//! Model: the receptacle is an urn (the later hip) whose rim carries petals and sepals; the stem is a tube
//! that leaves it downwards.
//!
//! Equation, with the depth d below the receptacle and the length L:
//! centre(d) = (bend (d / L)^2 cos a, bend (d / L)^2 sin a, -height - d), a = bend azimuth,
//! radius(d) = radius (1 + 0.2 d / L) (1 + 0.13 sum over nodes exp(-((d - node) / 3 mm)^2)).
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | L, bend | `length_mm`, `bend_mm` | mm | 220, 14 |
//! | bend azimuth | `bend_azimuth_deg` | deg | 0 |
//! | radius | `radius_mm` | mm | 2.6 |
//! | receptacle | `receptacle_radius_mm`, `receptacle_height_mm` | mm | 6, 13 |
//!
//! Limits: both solids are closed and do not enter each other: `solids_are_closed_and_face_outwards`,
//! `green_parts_do_not_cross`.
//!
//! Sizes: hip 8-16 mm wide at bloom, flower stems 4-8 mm thick (our reading).

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::flower::rose::check;
use crate::flower::tube::{Ring, Seat, tube};
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
    /// Azimuth of that offset, deg (default 0).
    pub bend_azimuth_deg: f64,
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
            bend_azimuth_deg: 0.0,
            receptacle_radius_mm: 6.0,
            receptacle_height_mm: 13.0,
        }
    }
}

/// Space between two organs that stand on each other, mm: too small to be seen, enough for the rounding of
/// coordinates and for the chords of a mesh.
pub(crate) const CONTACT_MM: f64 = 0.04;

impl StemDescription {
    /// Checks every key; `at` is the dotted path of this table.
    pub fn validate(&self, at: &str) -> Result<()> {
        check(at, "length_mm", self.length_mm, 1.0, 2000.0)?;
        check(at, "radius_mm", self.radius_mm, 0.1, 20.0)?;
        check(at, "bend_mm", self.bend_mm, -500.0, 500.0)?;
        check(at, "bend_azimuth_deg", self.bend_azimuth_deg, -360.0, 360.0)?;
        check(at, "receptacle_radius_mm", self.receptacle_radius_mm, 1.0, 30.0)?;
        check(at, "receptacle_height_mm", self.receptacle_height_mm, 1.0, 60.0)
    }

    /// The receptacle, from the stem to the dome inside the petals.
    pub fn receptacle(&self, around: usize) -> (Mesh, [f32; 2]) {
        let (radius, height) = (self.receptacle_radius_mm, self.receptacle_height_mm);
        // (radius, height): a neck, the swollen hip, the rim, and the dome that carries the petals.
        let mut profile = vec![
            (self.radius_mm, -height),
            (1.25 * self.radius_mm, -0.94 * height),
            (0.80 * radius, -0.80 * height),
            (1.02 * radius, -0.60 * height),
            (1.08 * radius, -0.40 * height),
            (1.02 * radius, -0.20 * height),
            (0.97 * radius, -0.08 * height),
        ];
        profile.extend(self.dome_mm());
        let rings: Vec<Ring> =
            profile.iter().map(|&(r, z)| Ring::circle(DVec3::new(0.0, 0.0, z), r)).collect();
        (tube(&rings, DVec3::X, around, None), [(TAU * radius) as f32, (1.4 * height) as f32])
    }

    /// The dome inside the petals, from its rim to its flat top: (distance from the axis, height), mm.
    pub fn dome_mm(&self) -> [(f64, f64); 3] {
        let (radius, height) = (self.receptacle_radius_mm, self.receptacle_height_mm);
        [(0.90 * radius, -0.03 * height), (0.70 * radius, 0.05 * radius), (0.40 * radius, 0.28 * radius)]
    }

    /// The curve of the stem, with leaves at these depths.
    pub fn axis(&self, nodes_mm: &[f64]) -> StemAxis {
        StemAxis { form: self.clone(), nodes_mm: nodes_mm.to_vec() }
    }
}

/// The stem: where it runs and how thick it is, by the depth below the receptacle.
#[derive(Clone, Debug, PartialEq)]
pub struct StemAxis {
    form: StemDescription,
    nodes_mm: Vec<f64>,
}

impl StemAxis {
    /// Middle of the stem, mm.
    pub fn centre_mm(&self, depth_mm: f64) -> DVec3 {
        let f = &self.form;
        let part = depth_mm / f.length_mm;
        (self.aside() * (f.bend_mm * part * part)).extend(-f.receptacle_height_mm - depth_mm)
    }

    /// Unit vector along the stem, upwards.
    pub fn up(&self, depth_mm: f64) -> DVec3 {
        let f = &self.form;
        let slope = -2.0 * f.bend_mm * depth_mm / (f.length_mm * f.length_mm);
        // Zero instead of minus zero where the stem does not bend.
        (self.aside() * slope + DVec2::ZERO).extend(1.0).normalize()
    }

    /// Unit vector in which the foot lies aside.
    fn aside(&self) -> DVec2 {
        DVec2::from_angle(self.form.bend_azimuth_deg.to_radians())
    }

    /// Unit vector across the stem, at an azimuth.
    pub fn outwards(&self, depth_mm: f64, azimuth_deg: f64) -> DVec3 {
        let (sin, cos) = azimuth_deg.to_radians().sin_cos();
        let (up, out) = (self.up(depth_mm), DVec3::new(cos, sin, 0.0));
        (out - up * out.dot(up)).normalize_or(DVec3::X)
    }

    /// Radius, mm.
    pub fn radius_mm(&self, depth_mm: f64) -> f64 {
        let swell: f64 = self.nodes_mm.iter().map(|n| (-((depth_mm - n) / 3.0).powi(2)).exp()).sum();
        self.form.radius_mm * (1.0 + 0.2 * depth_mm / self.form.length_mm) * (1.0 + 0.13 * swell)
    }

    /// Depth of the foot, mm.
    pub fn length_mm(&self) -> f64 {
        self.form.length_mm
    }

    /// The surface of the stem near a depth, for a tube that leaves in the direction `along`.
    pub fn seat(&self, depth_mm: f64, along: DVec3) -> Seat {
        Seat {
            centre_mm: self.centre_mm(depth_mm),
            axis: self.up(depth_mm),
            radius_mm: self.radius_mm(depth_mm) + CONTACT_MM,
            along,
        }
    }

    /// The mesh, from its foot to the receptacle.
    pub fn mesh(&self, around: usize, along: usize) -> (Mesh, [f32; 2]) {
        let length = self.form.length_mm;
        let mut depths: Vec<f64> = (0..=along).map(|k| length * k as f64 / along as f64).collect();
        for node in &self.nodes_mm {
            depths.extend([-6.0, -4.0, -2.5, -1.2, 0.0, 1.2, 2.5, 4.0, 6.0].map(|d| node + d));
        }
        depths.retain(|d| (0.0..=length).contains(d));
        depths.sort_by(|a, b| b.total_cmp(a));
        depths.dedup_by(|a, b| (*a - *b).abs() < 0.2 && *a > 0.0);
        let rings: Vec<Ring> = depths
            .iter()
            .map(|&d| {
                // The top stands just below the receptacle.
                let gap = DVec3::Z * (0.5 * CONTACT_MM * (-d).exp());
                Ring::circle(self.centre_mm(d) - gap, self.radius_mm(d))
            })
            .collect();
        let scale = [(TAU * self.form.radius_mm) as f32, length as f32];
        (tube(&rings, DVec3::X, around, None), scale)
    }
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
        let (stem, _) = d.axis(&[]).mesh(64, 8);
        let (receptacle, _) = d.receptacle(64);
        // The frustum's volume, less what 64 sides cut off the circle (0.16 %).
        let (r, s) = (d.radius_mm, d.radius_mm * 1.2);
        let frustum = std::f64::consts::PI * d.length_mm / 3.0 * (r * r + r * s + s * s);
        assert!((f64::from(volume(&stem)) / frustum - 1.0).abs() < 0.003, "{} {frustum}", volume(&stem));
        assert!(volume(&receptacle) > 0.0);
        let bent = StemDescription::default().axis(&[70.0, 110.0]).mesh(24, 24).0;
        assert_eq!(crate::geometry::crossings::crossing_pairs(&stem, &receptacle), 0);
        for m in [stem, receptacle, bent] {
            m.validate("stem").expect("valid");
            assert_eq!(crate::geometry::crossings::self_crossing_pairs(&m), 0);
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

    #[test]
    fn the_foot_lies_where_the_stem_bends_to() {
        let d = StemDescription { bend_mm: 60.0, bend_azimuth_deg: 120.0, ..Default::default() };
        let foot = d.axis(&[]).centre_mm(d.length_mm);
        assert!((foot.truncate().length() - 60.0).abs() < 1e-9);
        assert!((foot.y.atan2(foot.x).to_degrees() - 120.0).abs() < 1e-9);
        let step = d.axis(&[]).centre_mm(99.99) - d.axis(&[]).centre_mm(100.01);
        assert!(step.normalize().dot(d.axis(&[]).up(100.0)) > 1.0 - 1e-9);
    }
}

//! Prickles: curved, flattened cones of the stem's skin, hooked downwards.
//!
//! Model: the base is an ellipse along the stem; at the height t of its length the middle has moved down by
//! hook t^1.7 and the section has shrunk to (1 - t)^0.75 of the base along the stem, (1 - t)^0.9 across.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | number per 100 mm of stem | `per_100_mm` | - | 7 |
//! | length | `length_mm` | mm | 6 |
//! | base along and across the stem | `base_mm`, `base_width_mm` | mm | 6.5, 2.2 |
//! | hook | `hook` | of the length | 0.5 |
//!
//! Places are drawn one after another; one that comes too near to an earlier prickle or to a leaf is drawn again, at
//! most 40 times. Limits: prickles touch neither each other nor leaves nor the stem (`green_parts_do_not_cross`), and
//! stand on it (`prickles_stand_on_the_stem_apart_from_each_other`). Size and the
//! downward curve: prickles of hybrid teas are about 5 mm long (Kwantlen Polytechnic University plant database, "Rosa cvs.");
//! the rest is our reading.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::flower::leaf::Growth;
use crate::flower::phyllotaxis::vary;
use crate::flower::rose::check;
use crate::flower::stem::StemAxis;
use crate::flower::tube::{Ring, tube};
use crate::geometry::Mesh;

/// The prickles of the stem.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PrickleDescription {
    /// Number per 100 mm of stem (default 7).
    pub per_100_mm: f64,
    /// Length of the largest, mm (default 6).
    pub length_mm: f64,
    /// Base of the largest along the stem, mm (default 6.5).
    pub base_mm: f64,
    /// Base of the largest across the stem, mm (default 2.2).
    pub base_width_mm: f64,
    /// How far the point lies below the base's middle, as a part of the length (default 0.5).
    pub hook: f64,
    /// Length of the stem below the flower without prickles, mm (default 22).
    pub first_mm: f64,
}

impl Default for PrickleDescription {
    fn default() -> Self {
        Self { per_100_mm: 7.0, length_mm: 6.0, base_mm: 6.5, base_width_mm: 2.2, hook: 0.5, first_mm: 22.0 }
    }
}

/// Where a prickle stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PricklePlace {
    /// Depth below the receptacle, mm.
    pub depth_mm: f64,
    /// Azimuth, deg.
    pub azimuth_deg: f64,
    /// Size, 1 = the largest.
    pub size: f64,
}

impl PrickleDescription {
    /// Checks every key; `at` is the dotted path of this table.
    pub fn validate(&self, at: &str) -> Result<()> {
        check(at, "per_100_mm", self.per_100_mm, 0.0, 500.0)?;
        check(at, "length_mm", self.length_mm, 0.1, 50.0)?;
        check(at, "base_mm", self.base_mm, 0.1, 50.0)?;
        check(at, "base_width_mm", self.base_width_mm, 0.1, 20.0)?;
        check(at, "hook", self.hook, -2.0, 2.0)?;
        check(at, "first_mm", self.first_mm, 0.0, 1000.0)
    }

    /// Where prickles stand: clear of each other and of `leaves` (depth and azimuth).
    pub fn places(&self, stem: &StemAxis, leaves: &[(f64, f64)], growth: &Growth) -> Vec<PricklePlace> {
        let seed = growth.seed ^ 0x7_0e17;
        let length = stem.length_mm() - self.first_mm - self.base_mm;
        let count = (self.per_100_mm * length.max(0.0) / 100.0).round() as u32;
        let mut places: Vec<PricklePlace> = Vec::new();
        for index in 0..count {
            for attempt in 0..40u32 {
                let draw = |k: u32| 0.5 + 0.5 * vary(seed, index, 64 * k + attempt);
                let place = PricklePlace {
                    depth_mm: self.first_mm + length * draw(0),
                    azimuth_deg: 360.0 * draw(1),
                    size: 0.55 + 0.45 * draw(2) * draw(2).sqrt(),
                };
                let radius = stem.radius_mm(place.depth_mm);
                // Distance along the skin in units of what two bases need.
                let near = |depth: f64, azimuth: f64, along: f64, across: f64| {
                    let turn = (place.azimuth_deg - azimuth + 180.0).rem_euclid(360.0) - 180.0;
                    ((place.depth_mm - depth) / along).hypot(turn.to_radians() * radius / across) < 1.0
                };
                let (along, across) = (1.2 * self.base_mm + 1.0, 1.2 * self.base_width_mm + 1.0);
                let clear = !places.iter().any(|p| near(p.depth_mm, p.azimuth_deg, along, across))
                    && !leaves.iter().any(|l| near(l.0, l.1, 0.8 * along + 6.0, across + 2.2 * radius));
                if clear {
                    places.push(place);
                    break;
                }
            }
        }
        places
    }

    /// One prickle.
    pub fn mesh(&self, place: &PricklePlace, stem: &StemAxis, growth: &Growth) -> Mesh {
        let out = stem.outwards(place.depth_mm, place.azimuth_deg);
        let up = stem.up(place.depth_mm);
        let mut seat = stem.seat(place.depth_mm, out);
        let (length, n) =
            (self.length_mm * place.size, ((8.0 * growth.detail.sqrt()).round() as usize).max(3));
        let half =
            place.size * DVec2::new(0.5 * self.base_mm, 0.5 * self.base_width_mm.min(1.6 * seat.radius_mm));
        // The stem may be thicker elsewhere below the base than in its middle.
        let thick = (-4..=4).map(|k| stem.radius_mm(place.depth_mm + 0.25 * f64::from(k) * half.x));
        seat.radius_mm += thick.fold(0.0, f64::max) - stem.radius_mm(place.depth_mm);
        let foot = seat.centre_mm + out * seat.radius_mm;
        let rings: Vec<Ring> = (0..=n)
            .map(|k| {
                let t = (k as f64 / n as f64).powf(0.9);
                let down = up * (-self.hook * length * t.powf(1.7));
                let shrink = DVec2::new((1.0 - t).powf(0.75), (1.0 - t).powf(0.9));
                Ring { centre_mm: foot + out * (t * length) + down, radii_mm: half * shrink + 0.015 }
            })
            .collect();
        // Sections stay parallel to the skin as long as the cone is thick: the seat's direction is outwards.
        tube(&rings, up, growth.around(10.0), Some(&seat))
    }

    /// All prickles of a stem as one mesh; empty if there is none.
    pub fn grow(&self, stem: &StemAxis, leaves: &[(f64, f64)], growth: &Growth) -> (Mesh, [f32; 2]) {
        let mut all = Mesh::default();
        for place in self.places(stem, leaves, growth) {
            all.append(&self.mesh(&place, stem, growth));
        }
        (all, [(2.2 * (self.base_mm + self.base_width_mm)) as f32, self.length_mm as f32])
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::flower::stem::StemDescription;
    use crate::geometry::crossings::{crossing_pairs, self_crossing_pairs};

    #[test]
    fn prickles_stand_on_the_stem_apart_from_each_other() {
        let d = PrickleDescription { per_100_mm: 25.0, ..Default::default() };
        let stem = StemDescription::default().axis(&[70.0]);
        let growth = Growth { seed: 5, irregularity: 1.0, detail: 1.0 };
        let places = d.places(&stem, &[(70.0, 10.0)], &growth);
        assert!((20..=50).contains(&places.len()), "{}", places.len());
        let (all, _) = d.grow(&stem, &[(70.0, 10.0)], &growth);
        let (skin, _) = stem.mesh(24, 24);
        assert_eq!(crossing_pairs(&all, &skin), 0);
        assert_eq!(self_crossing_pairs(&all), 0);
        for place in &places {
            let m = d.mesh(place, &stem, &growth);
            m.validate("prickle").expect("valid");
            let seat = stem.seat(place.depth_mm, DVec3::X);
            let off = |p: glam::Vec3| {
                let arm = p.as_dvec3() - seat.centre_mm;
                (arm - seat.axis * arm.dot(seat.axis)).length() - seat.radius_mm
            };
            let around = growth.around(10.0);
            assert!(m.positions[..around].iter().all(|&p| (-1e-4..0.2).contains(&off(p))));
            // The point is as far out as the prickle is long, and below its base.
            let tip = m.positions[m.positions.len() - 1];
            assert!((off(tip) - d.length_mm * place.size).abs() < 0.5, "{}", off(tip));
            assert!((tip.as_dvec3() - seat.centre_mm).dot(seat.axis) < -0.4 * d.length_mm * place.size);
        }
    }
}

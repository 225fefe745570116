//! Leaves of the stem: odd-pinnate, with stipules, in a spiral of 2/5.
//!
//! Model: a leaf is a stalk (petiole and rachis, a bent tube on the stem) with pairs of leaflets and one at its end
//! ([`crate::flower::leaflet`]). Leaves stand `internode` apart along the stem, each 144 deg from the last, the
//! first one below the bare stalk of the flower; the two uppermost are smaller and the first has three leaflets.
//!
//! Equation: leaflets of pair k of K, from the stem, have the size (0.72 + 0.16 k / (K - 1)) of the terminal one and
//! stand at petiole + k spacing; the angle of the stalk from the stem is insertion + arch s / length.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | leaves | `count` | - | 4 |
//! | leaflets | `leaflets` | - | 5 |
//! | terminal leaflet | `length_mm`, `width_mm` | mm | 52, 33 |
//! | petiole, spacing | `petiole_mm`, `spacing_mm` | mm | 26, 29 |
//! | insertion, arch | `insertion_deg`, `arch_deg` | deg | 48, 38 |
//!
//! Limits: no leaf on the flower's own stalk, five ranks (`leaves_stand_in_five_ranks_below_the_bare_stalk`); leaves
//! cross neither each other nor the stem (`green_parts_do_not_cross`). Sizes: hybrid teas have 3 to 7 leaflets of 1 to
//! 9 by 2 to 6 cm, the terminal one the largest (Kwantlen Polytechnic University plant database, "Rosa cvs."); the rest is
//! our reading.

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::flower::leaflet::{LeafletForm, LeafletPlace, LeafletSurface};
use crate::flower::phyllotaxis::{Spiral, vary};
use crate::flower::rose::check;
use crate::flower::sheet::Sheet;
use crate::flower::stem::{CONTACT_MM, StemAxis};
use crate::flower::stipule::Stipule;
use crate::flower::tube::{Ring, Seat, tube};
use crate::geometry::Mesh;

/// The leaves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LeafDescription {
    /// Largest number of leaves; those for which the stem is too short do not grow (default 4).
    pub count: u32,
    /// Leaflets of a leaf, odd (default 5).
    pub leaflets: u32,
    /// Length of the terminal leaflet, mm (default 52).
    pub length_mm: f64,
    /// Width of the terminal leaflet, mm (default 33).
    pub width_mm: f64,
    /// Teeth of each margin of a leaflet (default 22).
    pub teeth: u32,
    /// Height of a tooth, mm (default 0.9).
    pub tooth_mm: f64,
    /// Side veins of each half of a leaflet (default 9).
    pub veins: u32,
    /// Height of the blade between its side veins, mm (default 0.3).
    pub relief_mm: f64,
    /// Rise of the halves of a leaflet from its midrib, deg (default 12).
    pub fold_deg: f64,
    /// Waves of a leaflet's margin, mm (default 0.9).
    pub wave_mm: f64,
    /// How much a leaflet's tip hangs, deg (default 28).
    pub droop_deg: f64,
    /// Stem to the first pair of leaflets, mm (default 26).
    pub petiole_mm: f64,
    /// Distance between two pairs, mm; as much more as wide leaflets need (default 29).
    pub spacing_mm: f64,
    /// Angle between stem and stalk where the leaf stands, deg (default 48).
    pub insertion_deg: f64,
    /// How much the stalk bends outwards and down, deg (default 38).
    pub arch_deg: f64,
    /// Length of the stem below the flower without leaves, mm (default 62).
    pub first_mm: f64,
    /// Distance between two leaves along the stem, mm (default 42).
    pub internode_mm: f64,
}

impl Default for LeafDescription {
    fn default() -> Self {
        Self {
            count: 4,
            leaflets: 5,
            length_mm: 52.0,
            width_mm: 33.0,
            teeth: 22,
            tooth_mm: 0.9,
            veins: 9,
            relief_mm: 0.12,
            fold_deg: 12.0,
            wave_mm: 0.9,
            droop_deg: 28.0,
            petiole_mm: 26.0,
            spacing_mm: 29.0,
            insertion_deg: 48.0,
            arch_deg: 38.0,
            first_mm: 62.0,
            internode_mm: 42.0,
        }
    }
}

impl LeafDescription {
    /// Checks every key; `at` is the dotted path of this table.
    pub fn validate(&self, at: &str) -> Result<()> {
        check(at, "count", f64::from(self.count), 0.0, 100.0)?;
        check(at, "leaflets", f64::from(self.leaflets), 1.0, 15.0)?;
        if self.leaflets.is_multiple_of(2) {
            let key = if at.is_empty() { "leaflets".to_owned() } else { format!("{at}.leaflets") };
            return Err(crate::Error::invalid(
                key,
                format!("{} is even; one leaflet ends the leaf", self.leaflets),
            ));
        }
        check(at, "length_mm", self.length_mm, 2.0, 300.0)?;
        check(at, "width_mm", self.width_mm, 1.0, 200.0)?;
        check(at, "teeth", f64::from(self.teeth), 0.0, 200.0)?;
        check(at, "tooth_mm", self.tooth_mm, 0.0, 10.0)?;
        check(at, "veins", f64::from(self.veins), 0.0, 40.0)?;
        check(at, "relief_mm", self.relief_mm, 0.0, 2.0)?;
        check(at, "fold_deg", self.fold_deg, -60.0, 60.0)?;
        check(at, "wave_mm", self.wave_mm, 0.0, 10.0)?;
        check(at, "droop_deg", self.droop_deg, -120.0, 120.0)?;
        check(at, "petiole_mm", self.petiole_mm, 3.0, 200.0)?;
        check(at, "spacing_mm", self.spacing_mm, 1.0, 200.0)?;
        check(at, "insertion_deg", self.insertion_deg, 10.0, 120.0)?;
        check(at, "arch_deg", self.arch_deg, -90.0, 120.0)?;
        check(at, "first_mm", self.first_mm, 5.0, 1000.0)?;
        check(at, "internode_mm", self.internode_mm, 5.0, 500.0)
    }

    /// Depths of the leaves on a stem of this length, mm.
    pub fn nodes_mm(&self, stem_mm: f64) -> Vec<f64> {
        (0..self.count)
            .map(|k| self.first_mm + f64::from(k) * self.internode_mm)
            .take_while(|d| *d < stem_mm - 8.0)
            .collect()
    }

    /// Where the leaves stand around the stem.
    pub fn spiral(&self, seed: u64, irregularity: f64) -> Spiral {
        Spiral { divergence_deg: 144.0, jitter_deg: 7.0 * irregularity, seed: seed ^ 0x1eaf }
    }

    /// Grows leaf `index` (0 is the uppermost) at a depth of the stem.
    pub fn grow(&self, index: u32, depth_mm: f64, stem: &StemAxis, growth: &Growth) -> Leaf {
        let seed = growth.seed ^ 0x1eaf;
        let v = |k| growth.irregularity * vary(seed, index, k);
        // Towards the flower leaves get smaller and simpler.
        let (size, leaflets) = match index {
            0 => (0.66, self.leaflets.min(3)),
            1 => (0.86, self.leaflets),
            _ => (1.0, self.leaflets),
        };
        let size = size * (1.0 + 0.08 * v(1));
        let pairs = (leaflets - 1) / 2;
        let azimuth = self.spiral(growth.seed, growth.irregularity).azimuth_deg(index);
        // The mean width of two neighbours, seen along the stalk.
        let spacing_mm = self.spacing_mm.max(0.86 * self.width_mm / SIDEWAYS_DEG.to_radians().sin() + 0.5);
        let stalk = Stalk {
            start: stem.centre_mm(depth_mm),
            up: stem.up(depth_mm),
            out: stem.outwards(depth_mm, azimuth),
            insertion: (self.insertion_deg + 6.0 * v(2)).to_radians(),
            arch: (self.arch_deg + 8.0 * v(3)).to_radians(),
            sway: 0.09 * v(4),
            length_mm: size * (self.petiole_mm + spacing_mm * (f64::from(pairs) - 0.42).max(0.0)),
            foot_mm: stem.radius_mm(depth_mm),
        };
        let radius = |s_mm: f64| {
            let part = s_mm / stalk.length_mm;
            let foot = 0.55 * stem.radius_mm(depth_mm);
            let slim = (0.85 - 0.4 * part) * size.sqrt();
            slim.min(foot) + (foot - slim.min(foot)) * (-(s_mm / (2.2 * size)).powi(2)).exp()
        };
        let seat = stem.seat(depth_mm, stalk.at(0.0).along);
        let mut leaf = Leaf {
            stalk: stalk.mesh(radius, &seat, growth.detail),
            leaflets: Vec::new(),
            stipules: Mesh::default(),
        };
        let blade = |number: u32, scale: f64, place: LeafletPlace| {
            let form =
                self.leaflet(scale * size, seed ^ (u64::from(index) << 20), number, growth.irregularity);
            let surface = LeafletSurface::new(form, place, growth.detail);
            (surface.mesh(), surface.uv_scale_mm())
        };
        for pair in 0..pairs {
            let along_mm = size * (self.petiole_mm + spacing_mm * f64::from(pair));
            let at = stalk.at(along_mm);
            let older = if pairs > 1 { f64::from(pair) / f64::from(pairs - 1) } else { 1.0 };
            for (k, side) in [-1.0, 1.0].into_iter().enumerate() {
                let number = 1 + 2 * pair + k as u32;
                let w = |j| growth.irregularity * vary(seed, 100 * index + number, j);
                let angle = (SIDEWAYS_DEG + 4.0 * w(5)).to_radians();
                let aside = at.side * side;
                let along =
                    (at.along * angle.cos() + aside * angle.sin() + at.up * (0.16 + 0.08 * w(6))).normalize();
                let up = at.up - along * at.up.dot(along) + aside * (0.10 * w(7));
                let stalklet_mm = 1.8 * size;
                let thin = 0.42 * size.sqrt();
                let begin = at.at + aside * (radius(along_mm) + CONTACT_MM);
                let rings: Vec<Ring> = [0.0, 0.5, 1.0]
                    .map(|t| Ring::circle(begin + along * (t * stalklet_mm), thin * (1.1 - 0.35 * t)))
                    .to_vec();
                let seat = Seat {
                    centre_mm: at.at,
                    axis: at.along,
                    radius_mm: radius(along_mm) + 2.0 * CONTACT_MM,
                    along,
                };
                leaf.stalk.0.append(&tube(&rings, at.up, growth.around(6.0), Some(&seat)));
                let base_mm = begin + along * (stalklet_mm + CONTACT_MM);
                let size = 0.72 + 0.16 * older;
                leaf.leaflets.push(blade(
                    number,
                    size * (1.0 + 0.05 * w(8)),
                    LeafletPlace { base_mm, along, up },
                ));
            }
        }
        let end = stalk.at(stalk.length_mm);
        let base_mm = end.at + end.along * CONTACT_MM;
        leaf.leaflets.push(blade(0, 1.0, LeafletPlace { base_mm, along: end.along, up: end.up }));
        let start_mm = stalk.clear_mm(radius(0.0)) + 0.2;
        let room_mm = size * self.petiole_mm - start_mm - 3.0;
        for side in [-1.0, 1.0].into_iter().filter(|_| room_mm > 1.0) {
            let stipule = Stipule {
                side,
                length_mm: room_mm.min(0.55 * size * self.petiole_mm),
                width_mm: 2.6 * size,
                stalk: &|s| stalk.at(s),
                radius_mm: &|s| radius(s) + 1.5 * CONTACT_MM,
                start_mm,
            };
            leaf.stipules.append(&stipule.mesh(growth.detail));
        }
        leaf
    }

    fn leaflet(&self, scale: f64, seed: u64, number: u32, irregularity: f64) -> LeafletForm {
        let v = |k| irregularity * vary(seed, number, k);
        LeafletForm {
            length_mm: self.length_mm * scale,
            width_mm: self.width_mm * scale * (1.0 + 0.05 * v(11)),
            widest: 0.42 + 0.02 * v(12),
            teeth: (f64::from(self.teeth) * scale.sqrt()).round() as u32,
            tooth_mm: self.tooth_mm * scale.sqrt(),
            arch_deg: self.droop_deg + 12.0 * v(13),
            fold_deg: self.fold_deg + 4.0 * v(14),
            wave_mm: self.wave_mm * scale,
            veins: self.veins,
            relief_mm: self.relief_mm * scale.sqrt(),
            seed: seed.wrapping_add(u64::from(number) << 8),
            irregularity,
        }
    }
}

/// Angle between the stalk and its side leaflets, deg.
const SIDEWAYS_DEG: f64 = 66.0;

/// How organs of a flower grow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    /// Seed of what differs between two flowers.
    pub seed: u64,
    /// Size of the seeded differences: 1 = natural.
    pub irregularity: f64,
    /// Fineness of the meshes: 1 = usual.
    pub detail: f64,
}

impl Growth {
    /// Sides of a tube that has `n` at detail 1.
    pub fn around(&self, n: f64) -> usize {
        ((n * self.detail.sqrt()).round() as usize).max(4)
    }
}

/// Meshes of one leaf.
#[derive(Clone, Debug)]
pub struct Leaf {
    /// Petiole, rachis and the stalks of the leaflets, with mm per unit of its texture coordinates.
    pub stalk: (Mesh, [f32; 2]),
    /// Blades, the terminal one last, likewise.
    pub leaflets: Vec<(Mesh, [f32; 2])>,
    /// Both stipules.
    pub stipules: Mesh,
}

/// The curve of a leaf's stalk.
struct Stalk {
    start: DVec3,
    up: DVec3,
    out: DVec3,
    insertion: f64,
    arch: f64,
    sway: f64,
    length_mm: f64,
    /// Radius of the stem: the curve starts at its axis.
    foot_mm: f64,
}

/// A point of a stalk with its frame.
#[derive(Clone, Copy, Debug)]
pub struct StalkPoint {
    /// Place, mm.
    pub at: DVec3,
    /// Unit direction towards the tip.
    pub along: DVec3,
    /// Unit normal of the upper side.
    pub up: DVec3,
    /// Unit vector to the right, up x along.
    pub side: DVec3,
}

impl Stalk {
    /// The point at a distance from the surface of the stem.
    fn at(&self, s_mm: f64) -> StalkPoint {
        // From the stem's axis to its surface the stalk is straight.
        // A stalk that jitter lays along the stem still starts beside it.
        let inside = self.foot_mm / self.insertion.tan().max(0.2);
        let turn = self.arch / self.length_mm;
        let angle = self.insertion + turn * s_mm.max(0.0);
        let (out, rise) = if turn.abs() < 1e-9 {
            (s_mm * self.insertion.sin(), s_mm * self.insertion.cos())
        } else {
            ((self.insertion.cos() - angle.cos()) / turn, (angle.sin() - self.insertion.sin()) / turn)
        };
        let across = self.up.cross(self.out);
        let bow = self.sway * s_mm * s_mm / self.length_mm;
        let at = self.start + self.out * (out + self.foot_mm) + self.up * (rise + inside) + across * bow;
        let along = (self.out * angle.sin()
            + self.up * angle.cos()
            + across * (2.0 * self.sway * s_mm / self.length_mm))
            .normalize();
        let up = self.up * angle.sin() - self.out * angle.cos();
        let up = (up - along * up.dot(along)).normalize();
        StalkPoint { at, along, up, side: up.cross(along) }
    }

    /// Where a stalk of that radius stands clear of the stem on all sides.
    fn clear_mm(&self, radius_mm: f64) -> f64 {
        radius_mm / self.insertion.tan().max(0.2) + 0.4
    }

    fn mesh(&self, radius: impl Fn(f64) -> f64, seat: &Seat, detail: f64) -> (Mesh, [f32; 2]) {
        let n = ((20.0 * detail.sqrt()).round() as usize).max(8);
        let clear = self.clear_mm(radius(0.0));
        let rings: Vec<Ring> = (0..=n)
            .map(|k| {
                let part = (k.saturating_sub(1) as f64 / (n - 1) as f64).powf(1.3);
                let s = if k == 0 { 0.0 } else { clear + (self.length_mm - clear) * part };
                Ring::circle(self.at(s).at, radius(s))
            })
            .collect();
        let around = ((8.0 * detail.sqrt()).round() as usize).max(4);
        (tube(&rings, self.up, around, Some(seat)), [4.0, self.length_mm as f32])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flower::stem::StemDescription;

    #[test]
    fn leaves_stand_in_five_ranks_below_the_bare_stalk() {
        let d = LeafDescription { count: 7, internode_mm: 30.0, ..Default::default() };
        let s = StemDescription { length_mm: 260.0, bend_mm: 0.0, ..Default::default() };
        let nodes = d.nodes_mm(s.length_mm);
        assert_eq!(nodes.len(), 7);
        assert_eq!(d.nodes_mm(100.0), [62.0]);
        let stem = s.axis(&nodes);
        let growth = Growth { seed: 3, irregularity: 0.0, detail: 0.5 };
        let tip = |k: u32| {
            let leaf = d.grow(k, nodes[k as usize], &stem, &growth);
            assert_eq!(leaf.leaflets.len(), if k == 0 { 3 } else { 5 });
            let m = &leaf.leaflets.last().expect("a terminal leaflet").0;
            let tip = m.positions[m.positions.len() - m.positions.len() / 200 - 1];
            assert!(f64::from(m.bounds().1.z) < -s.receptacle_height_mm, "above the receptacle");
            f64::from(tip.y.atan2(tip.x)).to_degrees()
        };
        for k in 0..6 {
            assert!(((tip(k + 1) - tip(k)).rem_euclid(360.0) - 144.0).abs() < 3.0, "{k}");
        }
        assert!(((tip(6) - tip(1) + 180.0).rem_euclid(360.0) - 180.0).abs() < 1.0);
    }

    #[test]
    fn an_even_number_of_leaflets_is_refused() {
        let e =
            LeafDescription { leaflets: 4, ..Default::default() }.validate("rose.leaves").expect_err("even");
        assert!(e.to_string().starts_with("rose.leaves.leaflets: 4"), "{e}");
    }
}

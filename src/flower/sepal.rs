//! Sepals: lances with a drawn-out leafy tip and side lobes, upright around the bud, bent back under the open flower.
//!
//! Model of the five: they follow one spiral of 2/5 and overlap as it goes: the first two lie outside on both margins,
//! the last two inside, the third is half covered. A margin that is covered in the bud has no lobes ("five brothers": two
//! bearded, two beardless, one with half a beard). Guarded by `five_brothers`.
//!
//! Model of one: half width(v) = width/2 b(v), a belly below v = 0.4, then a tail that widens a little before its tip.
//! The midline is a curve in the plane of the axis, of arc length s, whose heading from the axis is
//!
//! ```text
//! heading(s) = bud + (open(s) - bud) w,   bud = -14 deg,   open(s) = start + (end - start) s / length,
//! w = o (2 - o) up to openness o = 1, beyond it w = 1 and `end` grows by 35 deg per unit
//! ```
//!
//! but nowhere so small that the curve would enter the cup of the petals, `outer_radius_mm(z)`: around a bud it follows the
//! bud. Across, a sepal is wound around the axis. Guarded by `sepals_hug_the_bud_and_bend_back`.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | length, width | `length_mm`, `width_mm` | mm | 34, 10.5 |
//! | start, end | `start_deg`, `end_deg` | deg | 100, 160 |
//! | lobes per margin, their length | `lobes`, `lobe_mm` | -, mm | 3, 8 |
//!
//! Sizes and lobes: our reading of hybrid teas and dog roses.

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::flower::leaf::Growth;
use crate::flower::phyllotaxis::{GOLDEN_ANGLE_DEG, Spiral, vary};
use crate::flower::rose::check;
use crate::flower::sheet::{Sheet, mesh_on};
use crate::flower::smooth_step;
use crate::flower::stem::{CONTACT_MM, StemDescription};
use crate::geometry::Mesh;

/// The sepals.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SepalDescription {
    /// Number of sepals (default 5).
    pub count: u32,
    /// Length, mm (default 34).
    pub length_mm: f64,
    /// Width, mm (default 10.5).
    pub width_mm: f64,
    /// Angle from the flower's axis at the base when the flower is open, deg (default 100).
    pub start_deg: f64,
    /// Angle from the flower's axis at the tip when the flower is open, deg (default 160).
    pub end_deg: f64,
    /// Lobes of a margin that is not covered in the bud (default 3).
    pub lobes: u32,
    /// Length of the longest lobe, mm (default 8).
    pub lobe_mm: f64,
}

impl Default for SepalDescription {
    fn default() -> Self {
        Self {
            count: 5,
            length_mm: 34.0,
            width_mm: 10.5,
            start_deg: 100.0,
            end_deg: 160.0,
            lobes: 3,
            lobe_mm: 8.0,
        }
    }
}

impl SepalDescription {
    /// Checks every key; `at` is the dotted path of this table.
    pub fn validate(&self, at: &str) -> Result<()> {
        check(at, "count", f64::from(self.count), 0.0, 20.0)?;
        check(at, "length_mm", self.length_mm, 1.0, 200.0)?;
        check(at, "width_mm", self.width_mm, 0.5, 100.0)?;
        check(at, "start_deg", self.start_deg, 0.0, 180.0)?;
        check(at, "end_deg", self.end_deg, 0.0, 180.0)?;
        check(at, "lobes", f64::from(self.lobes), 0.0, 12.0)?;
        check(at, "lobe_mm", self.lobe_mm, 0.1, 60.0)
    }

    /// Lobes of the left and right margin of sepal `index`, seen from the axis.
    pub fn lobes_of(&self, index: u32) -> [u32; 2] {
        match index {
            _ if self.count != 5 => [self.lobes; 2],
            0 | 1 => [self.lobes; 2],
            // Its neighbours are the first sepal, which covers it, and the fifth.
            2 => [self.lobes, 0],
            _ => [0; 2],
        }
    }

    /// Layers of sepals below sepal `index` where they overlap.
    fn rank(&self, index: u32) -> f64 {
        if self.count == 5 { [2.0, 2.0, 1.0, 0.0, 0.0][index as usize % 5] } else { f64::from(index % 3) }
    }

    /// Grows sepal `index` of a flower of that openness (0 = bud, 1 = bloom, 1.3 = overblown).
    /// `outer_radius_mm(z)` is the distance from the axis that the petals fill at the height z; 0 below them.
    pub fn grow(
        &self,
        index: u32,
        openness: f64,
        stem: &StemDescription,
        outer_radius_mm: &dyn Fn(f64) -> f64,
        growth: &Growth,
    ) -> (Mesh, [f32; 2]) {
        let seed = growth.seed ^ 0x5e9a1;
        let v = |k| growth.irregularity * vary(seed, index, k);
        let mut form = self.clone();
        form.length_mm *= 1.0 + 0.1 * v(1);
        let divergence_deg = if self.count == 5 { 144.0 } else { GOLDEN_ANGLE_DEG };
        let spiral = Spiral { divergence_deg, jitter_deg: 4.0 * growth.irregularity, seed };
        let midline = Midline {
            radius_mm: stem.receptacle_radius_mm,
            height_mm: -0.14 * stem.receptacle_height_mm,
            rank: self.rank(index),
            bend_deg: 14.0 * v(2),
            openness,
        };
        let surface = SepalSurface {
            points: midline.trace(&form, stem, outer_radius_mm),
            azimuth: spiral.azimuth_deg(index).to_radians(),
            free: smooth_step(0.0, 0.8, openness),
            twist: 0.35 * v(3),
            form,
        };
        (surface.mesh(self.lobes_of(index), seed ^ u64::from(index) << 8, growth), surface.uv_scale_mm())
    }
}

/// What gives a sepal's midline its course.
struct Midline {
    radius_mm: f64,
    height_mm: f64,
    rank: f64,
    bend_deg: f64,
    openness: f64,
}

/// Heading in the bud, deg.
const BUD_DEG: f64 = -14.0;
/// Steps of a midline.
const STEPS: usize = 160;
/// Slope of the cone below a bud that sepals stay out of.
const SWELL: f64 = 0.8;
/// Distance of a sepal from the petals and from the next sepal, mm.
const LAYER_MM: f64 = 0.35;

impl Midline {
    /// Heading where nothing is in the way, radians; `v` is the part of the length.
    fn wish(&self, form: &SepalDescription, v: f64) -> f64 {
        let o = self.openness.clamp(0.0, 1.0);
        let beyond = (self.openness - 1.0).max(0.0);
        let end = form.end_deg + self.bend_deg * o + 35.0 * beyond;
        let open = form.start_deg + (end - form.start_deg) * v;
        // In the bud the tails stand apart.
        let bud = BUD_DEG + (6.0 - BUD_DEG) * smooth_step(0.6, 1.0, v);
        (bud + (open - bud) * o * (2.0 - o)).min(176.0).to_radians()
    }

    /// Points (distance from the axis, height) at equal steps, and the heading there.
    fn trace(
        &self,
        form: &SepalDescription,
        stem: &StemDescription,
        outer_radius_mm: &dyn Fn(f64) -> f64,
    ) -> Vec<(DVec2, f64)> {
        let step = form.length_mm / STEPS as f64;
        let hip = |z: f64| {
            // The urn, seen from outside, and the stem below it.
            let inside = z < 0.0 && z > -stem.receptacle_height_mm;
            if inside {
                1.1 * stem.receptacle_radius_mm
            } else if z < 0.0 {
                1.3 * stem.radius_mm
            } else {
                0.0
            }
        };
        let mut p = DVec2::new(self.radius_mm + CONTACT_MM + 0.2 * self.rank, self.height_mm);
        let mut points = Vec::with_capacity(STEPS + 1);
        for k in 0..=STEPS {
            let s = k as f64 * step;
            let settled = smooth_step(0.0, 4.0, s);
            let off = CONTACT_MM + (0.2 + (LAYER_MM - 0.2) * settled) * self.rank + LAYER_MM * settled;
            let clear = |q: DVec2| {
                // Below a bud that is wider than the receptacle the sepals swell towards it.
                let petals = (0..=8)
                    .map(|k| 0.5 * f64::from(k))
                    .map(|above| outer_radius_mm(q.y + above) - SWELL * above)
                    .fold(outer_radius_mm(q.y + off), f64::max);
                let petals = if petals > 0.0 { petals + off } else { 0.0 };
                let low = if settled < 1.0 { self.radius_mm * 0.985 } else { hip(q.y) } + off;
                q.x >= petals.max(low).max(0.8 + LAYER_MM * self.rank)
            };
            let ahead = |heading: f64| p + step * DVec2::new(heading.sin(), heading.cos());
            let wish = self.wish(form, s / form.length_mm);
            let mut heading = wish;
            if !clear(ahead(wish)) {
                // The smallest turn outwards that stays clear; pressed from all sides it goes straight out.
                let (mut low, mut high) = (wish, std::f64::consts::FRAC_PI_2.max(wish));
                if clear(ahead(high)) {
                    for _ in 0..30 {
                        let middle = 0.5 * (low + high);
                        if clear(ahead(middle)) { high = middle } else { low = middle }
                    }
                }
                heading = high;
            }
            points.push((p, heading));
            p = ahead(heading);
        }
        points
    }
}

/// The mid-surface of one sepal.
struct SepalSurface {
    form: SepalDescription,
    points: Vec<(DVec2, f64)>,
    azimuth: f64,
    /// How far the sepal has left the bud, 0 to 1.
    free: f64,
    /// Turn of the tail about its midline, radians.
    twist: f64,
}

impl SepalSurface {
    /// Half width, mm.
    fn half_width_mm(&self, v: f64) -> f64 {
        let belly = 0.68 + 0.32 * (std::f64::consts::PI * (v / 0.46).min(1.0)).sin();
        let tail = 1.0 - 0.87 * smooth_step(0.16, 0.66, v);
        let leafy = 0.10 * (-((v - 0.84) / 0.10).powi(2)).exp();
        let tip = (1.0 - v.powi(10)).max(0.0).sqrt();
        0.04 + 0.5 * self.form.width_mm * (belly * tail + leafy) * tip
    }

    /// Folds the flat sepal (across, along) into space.
    fn bend(&self, p: DVec2) -> DVec3 {
        let at = (p.y / self.form.length_mm).clamp(0.0, 1.0) * STEPS as f64;
        let k = (at as usize).min(STEPS - 1);
        let ((a, _), (b, _)) = (self.points[k], self.points[k + 1]);
        let q = a + (b - a) * (at - k as f64);
        // Smooth headings: the curve turns by steps.
        let window = 3;
        let from = k.saturating_sub(window);
        let to = (k + window).min(STEPS);
        let heading = self.points[from..=to].iter().map(|p| p.1).sum::<f64>() / (to - from + 1) as f64;
        let v = p.y / self.form.length_mm;
        let (sin, cos) = heading.sin_cos();
        // Adaxial normal in the plane of the axis: (-cos, sin). Across, the sepal is wound around the axis as far as
        // it lies along it, with a shallow trough towards the adaxial side; the tail twists.
        let trough = 0.10 * p.x * p.x / (0.5 * self.form.width_mm) * smooth_step(0.0, 0.3, v) * self.free;
        let keel = -0.25 * (-(p.x / 0.6).powi(2)).exp() * (1.0 - v);
        let twist = self.twist * self.free * smooth_step(0.45, 1.0, v);
        let x = p.x * twist.cos();
        let lift = trough + keel * smooth_step(0.0, 0.15, v) + p.x * twist.sin();
        let (r, z) = (q.x - lift * cos, q.y + lift * sin);
        let wind = (2.2 * self.form.width_mm).min(q.x.max(2.0));
        let turn = x / wind;
        let (out, across) = (r + wind * (turn.cos() - 1.0), wind * turn.sin());
        let (sin, cos) = self.azimuth.sin_cos();
        DVec3::new(out * cos - across * sin, out * sin + across * cos, z)
    }

    fn mesh(&self, lobes: [u32; 2], seed: u64, growth: &Growth) -> Mesh {
        let n = |n: f64| ((n * growth.detail).round() as usize).max(3);
        let grid =
            |n: usize, power: f64| (0..=n).map(|j| (j as f64 / n as f64).powf(power)).collect::<Vec<f64>>();
        let across = 2 * n(4.0);
        let mut all = mesh_on(self, &grid(across, 1.0), &grid(n(26.0), 1.0));
        for (margin, count) in lobes.into_iter().enumerate() {
            for k in 0..count {
                let side = if margin == 0 { -1.0 } else { 1.0 };
                let part = (f64::from(k) + 0.5) / f64::from(count);
                let wild = growth.irregularity * vary(seed, k, margin as u32 + 7);
                let lobe = Lobe {
                    sepal: self,
                    side,
                    start_mm: self.form.length_mm * (0.20 + 0.36 * part + 0.02 * wild),
                    room_mm: 0.08 * self.form.length_mm / f64::from(count),
                    length_mm: self.form.lobe_mm * (1.0 - 0.45 * part) * (1.0 + 0.3 * wild),
                };
                all.append(&mesh_on(&lobe, &grid(n(1.0).max(2), 1.0), &grid(n(10.0), 1.0)));
            }
        }
        all
    }
}

impl Sheet for SepalSurface {
    fn at(&self, u: f64, v: f64) -> DVec3 {
        self.bend(DVec2::new((2.0 * u - 1.0) * self.half_width_mm(v), v * self.form.length_mm))
    }

    fn uv(&self, u: f64, v: f64) -> DVec2 {
        let [w, _] = self.uv_scale_mm().map(f64::from);
        DVec2::new((2.0 * u - 1.0) * self.half_width_mm(v) / w + 0.5, v)
    }

    fn uv_scale_mm(&self) -> [f32; 2] {
        [(1.1 * self.form.width_mm + 3.0 * self.form.lobe_mm) as f32, self.form.length_mm as f32]
    }
}

/// Distance of a lobe's foot from the margin, mm: what two meshes of one surface need to stay apart.
const APART_MM: f64 = 0.1;

/// A narrow lobe of a sepal's margin, in the same surface.
struct Lobe<'a> {
    sepal: &'a SepalSurface,
    side: f64,
    start_mm: f64,
    length_mm: f64,
    /// Largest half width, mm.
    room_mm: f64,
}

impl Lobe<'_> {
    /// Distance from the margin by v alone and place along it by u: no part lies on another or on the sepal.
    fn flat(&self, u: f64, v: f64) -> DVec2 {
        let part = if self.side > 0.0 { u } else { 1.0 - u };
        let half = (0.055 * self.length_mm + 0.28).min(self.room_mm);
        let form = &self.sepal.form;
        let margin = |y: f64| self.sepal.half_width_mm((y / form.length_mm).clamp(0.0, 1.0));
        // The middle leaves the margin outwards and bends forward.
        let (sin, cos) = (0.85 - 0.3 * v).sin_cos();
        // A lance; u runs from the rear edge, which faces outwards, to the front edge.
        let width = half * (1.0 - v.powi(3)).max(0.0).sqrt() * (1.0 - 0.35 * v) + 0.03;
        let y = self.start_mm + v * self.length_mm * cos + (1.0 - 2.0 * part) * width / sin;
        DVec2::new(self.side * (margin(y) + APART_MM + v * self.length_mm * sin), y)
    }
}

impl Sheet for Lobe<'_> {
    fn at(&self, u: f64, v: f64) -> DVec3 {
        self.sepal.bend(self.flat(u, v))
    }

    fn uv(&self, u: f64, v: f64) -> DVec2 {
        let [w, l] = self.sepal.uv_scale_mm().map(f64::from);
        let p = self.flat(u, v);
        DVec2::new(p.x / w + 0.5, (p.y / l).clamp(0.0, 1.0))
    }

    fn uv_scale_mm(&self) -> [f32; 2] {
        self.sepal.uv_scale_mm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::crossings::{crossing_pairs, crossings};

    const GROWTH: Growth = Growth { seed: 1, irregularity: 1.0, detail: 1.0 };

    /// An egg 32 mm high and 24 mm wide on the receptacle.
    fn bud(z: f64) -> f64 {
        let x = (z - 15.0) / 17.4;
        if (0.0..32.4).contains(&z) { 12.0 * (1.0 - x * x).max(0.0).sqrt() } else { 0.0 }
    }

    fn all(openness: f64, outer: &dyn Fn(f64) -> f64) -> Vec<Mesh> {
        let (d, stem) = (SepalDescription::default(), StemDescription::default());
        (0..5).map(|k| d.grow(k, openness, &stem, outer, &GROWTH).0).collect()
    }

    #[test]
    fn five_brothers() {
        let d = SepalDescription::default();
        let lobes: Vec<u32> =
            (0..5).map(|k| d.lobes_of(k).into_iter().filter(|n| *n > 0).count() as u32).collect();
        assert_eq!(lobes, [2, 2, 1, 0, 0]);
        // A margin has lobes where the neighbour on that side lies further in: left is the smaller azimuth.
        for k in 0..5u32 {
            for (margin, turn) in [(0, 288), (1, 72)] {
                let neighbour =
                    (0..5).find(|j| (144 * j) % 360 == (144 * k + turn) % 360).expect("one of five");
                let outside = d.rank(k) > d.rank(neighbour);
                assert_eq!(d.lobes_of(k)[margin] > 0, outside, "sepal {k}, neighbour {neighbour}");
            }
        }
        let meshes = all(1.0, &|_| 0.0);
        assert!(meshes[0].triangles.len() > meshes[2].triangles.len());
        assert!(meshes[2].triangles.len() > meshes[4].triangles.len());
    }

    #[test]
    fn sepals_hug_the_bud_and_bend_back() {
        for m in all(0.0, &bud) {
            m.validate("sepal").expect("valid");
            for p in &m.positions {
                let (r, z) = (f64::from(p.truncate().length()), f64::from(p.z));
                let out = bud(z);
                assert!(r > out - 0.05 && (!(1.0..=24.0).contains(&z) || r < out + 4.0), "{p}: {r} {out}");
            }
            assert!(m.bounds().1.z > 25.0);
        }
        for m in all(1.0, &|z| if z > 0.0 { 40.0 } else { 0.0 }) {
            assert!(m.bounds().1.z < 0.5 && m.bounds().0.z < -15.0, "{:?}", m.bounds());
        }
        // No jump on the way.
        let mut last = all(0.0, &|_| 0.0);
        for k in 1..=65 {
            let next = all(0.02 * f64::from(k), &|_| 0.0);
            for (a, b) in last.iter().zip(&next) {
                let moved =
                    a.positions.iter().zip(&b.positions).map(|(p, q)| p.distance(*q)).fold(0.0, f32::max);
                assert!(moved < 3.5, "openness {}: {moved} mm", 0.02 * f64::from(k));
            }
            last = next;
        }
    }

    #[test]
    fn sepals_do_not_cross() {
        let stem = StemDescription::default();
        let hip = stem.receptacle(32).0;
        for openness in [0.0, 0.25, 0.5, 0.75, 1.0, 1.3] {
            let outer = |z: f64| if openness < 0.4 { bud(z) * (1.0 + openness) } else { 0.0 };
            let meshes = all(openness, &outer);
            let found = crossings(&meshes.iter().collect::<Vec<_>>());
            assert!(found.is_empty(), "openness {openness}: {} pairs, first {:?}", found.len(), found[0]);
            assert!(meshes.iter().all(|m| crossing_pairs(m, &hip) == 0), "openness {openness}");
        }
    }
}

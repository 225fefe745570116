//! The pattern of a petal: factors on the pigments of its two epidermes, and where it is thin or withered.
//!
//! Model: for each side, at a place of the petal ([`crate::flower::petal_map`]: u, v, d, n and the petal's age a),
//!
//! ```text
//! c = course(v) spot(u, v) (1 + strength n) band(d) (inner + (outer - inner) a) (1 + amplitude b(p))
//! course: claw, middle, rim at v = 0, 1/2, 1;  S(x) = x^2 (3 - 2 x) between
//! spot   = 1 + (factor - 1) (1 - S((v / e - 0.55) / 0.45)),   e = extent (1 + irregularity b(9 u, 3 v))
//! band   = 1 + (factor - 1) (1 - S((d / w - 0.5) / 0.5)),     w = width (1 + irregularity b(p / 5 mm))
//!
//! thickness h = 1 - (1 - margin) (1 - S(d / width)) + veins n,    share that is thin = (h1 - h) / (h1 - h0)
//! withered share = S((b(p / 9 mm) - 1 + 2 extent a) / 0.3) (1 - S((d / w - 0.6) / 0.4)),   w = width (0.7 + 0.3 b(p / 2 mm))
//! ```
//!
//! with b a smooth noise within -1 and 1, different on every petal; h1 = 1 + veins and h0 = margin are the thicknesses of two measured
//! petals, between which the BSDF is linear.
//!
//! | symbol | key of `[petal.pattern]` | unit | default |
//! |---|---|---|---|
//! | claw, middle, rim, by side | `adaxial`, `abaxial` | | 1 |
//! | factor, extent, irregularity | `claw_spot` | | no spot |
//! | strength by side, width | `veins` | -, mm | no veins |
//! | factor, width, irregularity | `margin` | -, mm, - | no band |
//! | inner, outer | `age` | | 1 |
//! | amplitude, size of b | `blotches` | -, mm | none |
//! | margin, width, veins | `thickness` | -, mm, - | 1 everywhere |
//! | extent, width | `withered` | -, mm | none |
//!
//! What is known: the pigments of a petal sit in its epidermes, and the two differ (Biran et al. 1974, J. Exp. Bot. 25:614, on
//! 'Baccara'); veins are coloured where the cells over them make anthocyanin (`Venosa` in Antirrhinum: Shang et al. 2011, New
//! Phytol. 189:602); picotee margins and basal blotches are the same pathway switched on or off by place (Davies, Albert,
//! Schwinn 2012, Funct. Plant Biol. 39:619). All forms and numbers here are our reading. Factors scale all pigments
//! of an epidermis alike: what shows where they are taken away is the mesophyll and its own pigments.
//!
//! Petals are thinner towards the margin; how they thin out is our reading, as is where they wither. A place that is partly
//! withered is a mixture of both by area.
//!
//! Limits: factors lie within [`Pattern::ranges`] (`factors_keep_their_range`); the two sides take theirs apart
//! (`sides_differ_as_asked`); energy and reciprocity hold at the largest factors (`extreme_pigment_keeps_the_laws`); petals thin out
//! and wither at their margins (`margins_are_thin_and_old_ones_wither`).

use glam::Vec2;

use super::description::{CourseDescription, PatternDescription, WitheredDescription};
use super::key::Key;
use crate::Result;
use crate::flower::petal_map::Place;
use crate::flower::veins::Veins;
use crate::flower::{PetalMap, PetalTraits};
use crate::math::sampler::{hash, hash_to_unit};

/// Factors on the pigments of the two epidermes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PigmentFactors {
    /// Of the upper one.
    pub adaxial: f32,
    /// Of the lower one.
    pub abaxial: f32,
}

impl PigmentFactors {
    /// As the tissue says.
    pub const ONE: Self = Self::both(1.0);

    /// The same on both sides.
    pub const fn both(factor: f32) -> Self {
        Self { adaxial: factor, abaxial: factor }
    }

    /// Each side times `factor`.
    pub fn times(self, factor: f32) -> Self {
        Self { adaxial: self.adaxial * factor, abaxial: self.abaxial * factor }
    }
}

/// What a place of a petal is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TissueState {
    /// Factors on its pigments.
    pub pigment: PigmentFactors,
    /// 0 as thick as it gets, 1 as thin.
    pub thin: f32,
    /// Share of it that is dead and brown.
    pub withered: f32,
}

impl TissueState {
    /// As the tissue says.
    pub const SOUND: Self = Self::of(PigmentFactors::ONE);

    /// Sound tissue with these factors on its pigments.
    pub const fn of(pigment: PigmentFactors) -> Self {
        Self { pigment, thin: 0.0, withered: 0.0 }
    }

    /// Of no tissue: where means begin.
    pub const NOTHING: Self = Self::of(PigmentFactors::both(0.0));

    /// Each number times `factor`.
    pub fn times(self, factor: f32) -> Self {
        Self {
            pigment: self.pigment.times(factor),
            thin: self.thin * factor,
            withered: self.withered * factor,
        }
    }

    /// The sum of each number.
    pub fn plus(self, other: Self) -> Self {
        let pigment = PigmentFactors {
            adaxial: self.pigment.adaxial + other.pigment.adaxial,
            abaxial: self.pigment.abaxial + other.pigment.abaxial,
        };
        Self { pigment, thin: self.thin + other.thin, withered: self.withered + other.withered }
    }

    /// Shares of thick, of thin and of withered tissue.
    pub fn shares(self) -> [f32; 3] {
        let sound = 1.0 - self.withered;
        [sound * (1.0 - self.thin), sound * self.thin, self.withered]
    }
}

/// A checked pattern.
#[derive(Clone, Debug, Default)]
pub struct Pattern {
    description: PatternDescription,
}

/// Size of the variations of the margin's width, mm.
const MARGIN_SCALE_MM: f32 = 5.0;
/// Sizes of what withers, and of its edge's variations, mm.
const WITHERED_SCALES_MM: [f32; 2] = [9.0, 2.0];
/// Rays of the claw spot across the petal, and their shape along it.
const RAYS: Vec2 = Vec2::new(9.0, 3.0);

impl Pattern {
    /// Checks a pattern; errors name the key.
    pub(super) fn new(d: &PatternDescription, key: &Key) -> Result<Self> {
        let factor = |key: Key, value: f64| key.within(value, 0.0..=100.0, "within 0 to 100").map(|_| ());
        for (name, course) in [("adaxial", d.adaxial), ("abaxial", d.abaxial)] {
            let key = key.at(name);
            factor(key.at("claw"), course.claw)?;
            factor(key.at("middle"), course.middle)?;
            factor(key.at("rim"), course.rim)?;
        }
        if let Some(spot) = d.claw_spot {
            let key = key.at("claw_spot");
            factor(key.at("factor"), spot.factor)?;
            key.at("extent").within(spot.extent, 0.01..=1.0, "within 0.01 to 1")?;
            key.at("irregularity").within(spot.irregularity, 0.0..=1.0, "within 0 to 1")?;
        }
        if let Some(veins) = d.veins {
            let key = key.at("veins");
            for (name, value) in [("adaxial", veins.adaxial), ("abaxial", veins.abaxial)] {
                key.at(name).within(value, -1.0..=20.0, "within -1 to 20")?;
            }
            key.at("width_mm").within(veins.width_mm, 0.05..=5.0, "within 0.05 to 5 mm")?;
        }
        if let Some(margin) = d.margin {
            let key = key.at("margin");
            factor(key.at("factor"), margin.factor)?;
            key.at("width_mm").within(margin.width_mm, 0.1..=100.0, "within 0.1 to 100 mm")?;
            key.at("irregularity").within(margin.irregularity, 0.0..=1.0, "within 0 to 1")?;
        }
        if let Some(age) = d.age {
            factor(key.at("age").at("inner"), age.inner)?;
            factor(key.at("age").at("outer"), age.outer)?;
        }
        if let Some(blotches) = d.blotches {
            let key = key.at("blotches");
            key.at("amplitude").within(blotches.amplitude, 0.0..=1.0, "within 0 to 1")?;
            key.at("scale_mm").within(blotches.scale_mm, 0.2..=100.0, "within 0.2 to 100 mm")?;
        }
        if let Some(thickness) = d.thickness {
            let key = key.at("thickness");
            key.at("margin").within(thickness.margin, 0.2..=1.0, "within 0.2 to 1")?;
            key.at("width_mm").within(thickness.width_mm, 0.1..=100.0, "within 0.1 to 100 mm")?;
            key.at("veins").within(thickness.veins, 0.0..=2.0, "within 0 to 2")?;
        }
        if let Some(withered) = d.withered {
            let key = key.at("withered");
            key.at("extent").within(withered.extent, 0.0..=1.0, "within 0 to 1")?;
            key.at("width_mm").within(withered.width_mm, 0.1..=100.0, "within 0.1 to 100 mm")?;
            key.at("brown").within(withered.brown, 0.0..=100.0, "within 0 to 100")?;
            key.at("pigment").within(withered.pigment, 0.0..=10.0, "within 0 to 10")?;
        }
        Ok(Self { description: d.clone() })
    }

    /// What the pattern needs to know of a grown petal.
    pub fn map(&self, traits: &PetalTraits) -> PetalMap {
        let d = &self.description;
        let veins = match (d.veins, d.thickness) {
            (Some(v), _) => Some(Veins { width_mm: v.width_mm, ..traits.veins }),
            (None, Some(thickness)) if thickness.veins > 0.0 => Some(traits.veins),
            _ => None,
        };
        PetalMap::new(traits, veins.as_ref())
    }

    /// Least and largest thickness, in parts of the tissue's; `None` where all is as thick.
    pub fn thicknesses(&self) -> Option<(f64, f64)> {
        let t = self.description.thickness?;
        (t.margin < 1.0 || t.veins > 0.0).then_some((t.margin, 1.0 + t.veins))
    }

    /// What withered patches are made of.
    pub fn withered(&self) -> Option<&WitheredDescription> {
        self.description.withered.as_ref()
    }

    /// What there is at texture coordinates, on a grown petal or on another shape.
    pub fn state(&self, uv: Vec2, petal: Option<&PetalMap>) -> TissueState {
        let place = place(uv, petal);
        let (mut thin, mut withered) = (0.0, 0.0);
        if let (Some(t), Some((least, most))) = (self.description.thickness, self.thicknesses()) {
            let near = 1.0 - within(place.margin_mm / t.width_mm as f32, 0.0, 0.0);
            let thickness = 1.0 - (1.0 - t.margin as f32) * near + t.veins as f32 * place.vein;
            thin = ((most as f32 - thickness) / (most - least) as f32).clamp(0.0, 1.0);
        }
        if let (Some(w), Some(petal)) = (self.description.withered, petal) {
            let [patch, edge] = [0, 1]
                .map(|k| noise(place.flat_mm / WITHERED_SCALES_MM[k], petal.seed ^ [0x3d1e, 0x0d9e][k]));
            let dead = ((patch - 1.0 + 2.0 * w.extent as f32 * petal.age) / 0.3).clamp(0.0, 1.0);
            let width = w.width_mm as f32 * (0.7 + 0.3 * edge);
            let band = 1.0 - within(place.margin_mm / width.max(1e-3), 0.6, 0.0);
            withered = dead * dead * (3.0 - 2.0 * dead) * band;
        }
        TissueState { pigment: self.factors(&place, petal), thin, withered }
    }

    /// The factors at a place.
    fn factors(&self, place: &Place, petal: Option<&PetalMap>) -> PigmentFactors {
        let seed = petal.map_or(0, |p| p.seed);
        let d = &self.description;
        let mut both = 1.0;
        if let Some(spot) = d.claw_spot {
            let rays = noise(Vec2::new(place.across, place.along) * RAYS, seed ^ 0x51a1);
            let extent = spot.extent as f32 * (1.0 + spot.irregularity as f32 * rays);
            both *= within(place.along / extent.max(1e-3), 0.55, spot.factor);
        }
        if let Some(margin) = d.margin {
            let wider = margin.irregularity as f32 * noise(place.flat_mm / MARGIN_SCALE_MM, seed ^ 0x3a71);
            let width = margin.width_mm as f32 * (1.0 + wider);
            both *= within(place.margin_mm / width.max(1e-3), 0.5, margin.factor);
        }
        if let (Some(age), Some(petal)) = (d.age, petal) {
            both *= age.inner as f32 + (age.outer - age.inner) as f32 * petal.age;
        }
        if let (Some(blotches), Some(_)) = (d.blotches, petal) {
            let patch = noise(place.flat_mm / blotches.scale_mm as f32, seed ^ 0xb107);
            both *= 1.0 + blotches.amplitude as f32 * patch;
        }
        let on_vein = |strength: f64| 1.0 + strength as f32 * place.vein;
        let (up, down) = d.veins.map_or((1.0, 1.0), |v| (on_vein(v.adaxial), on_vein(v.abaxial)));
        PigmentFactors {
            adaxial: (course(&d.adaxial, place.along) * both * up).max(0.0),
            abaxial: (course(&d.abaxial, place.along) * both * down).max(0.0),
        }
    }

    /// Bounds of the factors of the upper and of the lower side: the least and the largest.
    pub fn ranges(&self) -> [(f32, f32); 2] {
        let d = &self.description;
        let ends = |a: f64, b: f64| (a.min(b), a.max(b));
        let both = [
            d.claw_spot.map_or((1.0, 1.0), |s| ends(1.0, s.factor)),
            d.margin.map_or((1.0, 1.0), |m| ends(1.0, m.factor)),
            // Other shapes have no age.
            d.age.map_or((1.0, 1.0), |a| (a.inner.min(a.outer).min(1.0), a.inner.max(a.outer).max(1.0))),
            d.blotches.map_or((1.0, 1.0), |b| (1.0 - b.amplitude, 1.0 + b.amplitude)),
        ];
        let strengths = d.veins.map_or([0.0; 2], |v| [v.adaxial, v.abaxial]);
        [(d.adaxial, strengths[0]), (d.abaxial, strengths[1])].map(|(c, strength)| {
            let course = (c.claw.min(c.middle).min(c.rim), c.claw.max(c.middle).max(c.rim));
            let of_side = [course, ends(1.0, 1.0 + strength)];
            let (low, high) = both.iter().chain(&of_side).fold((1.0, 1.0), |p, r| (p.0 * r.0, p.1 * r.1));
            (low as f32, high as f32)
        })
    }
}

/// Where texture coordinates lie; on a shape that is no grown petal, far from any margin.
fn place(uv: Vec2, petal: Option<&PetalMap>) -> Place {
    match petal {
        Some(petal) => petal.at(uv),
        None => Place {
            across: uv.x.clamp(0.0, 1.0),
            along: uv.y.clamp(0.0, 1.0),
            margin_mm: f32::INFINITY,
            vein: 0.0,
            flat_mm: Vec2::ZERO,
        },
    }
}

/// Claw, middle and rim at v = 0, 1/2, 1.
fn course(c: &CourseDescription, v: f32) -> f32 {
    let (a, b, t) = if v < 0.5 { (c.claw, c.middle, 2.0 * v) } else { (c.middle, c.rim, 2.0 * v - 1.0) };
    a as f32 + (b - a) as f32 * t * t * (3.0 - 2.0 * t)
}

/// `factor` for `x` up to `full`, 1 from 1 on.
fn within(x: f32, full: f32, factor: f64) -> f32 {
    let t = ((x - full) / (1.0 - full)).clamp(0.0, 1.0);
    1.0 + (factor as f32 - 1.0) * (1.0 - t * t * (3.0 - 2.0 * t))
}

/// Smooth noise within -1 and 1 whose patches are about 1 wide: values at the points of two lattices, one of them turned
/// and twice as fine.
fn noise(p: Vec2, seed: u32) -> f32 {
    let turned = Vec2::new(1.6 * p.x - 1.2 * p.y, 1.2 * p.x + 1.6 * p.y);
    (2.0 / 3.0) * lattice(p, seed) + (1.0 / 3.0) * lattice(turned, hash(seed ^ 0x9e37_79b9))
}

fn lattice(p: Vec2, seed: u32) -> f32 {
    let (low, t) = (p.floor(), p - p.floor());
    let s = t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let at = |dx: i32, dy: i32| {
        let (x, y) = (low.x as i32 + dx, low.y as i32 + dy);
        2.0 * hash_to_unit(hash(seed ^ hash(x as u32)) ^ hash(y as u32 ^ 0x85eb_ca6b)) as f32 - 1.0
    };
    let (a, b) = (at(0, 0) + (at(1, 0) - at(0, 0)) * s.x, at(0, 1) + (at(1, 1) - at(0, 1)) * s.x);
    a + (b - a) * s.y
}

#[cfg(test)]
mod tests;

//! Several roses by rule: a vase with a few cut stems, a bush whose canes arch out of one place.
//!
//! Model: the middle of a stem or cane is the parabola of [`crate::flower::stem`], given by its foot F, the direction D in which
//! it leaves the foot, and its neck N below the flower. The flower looks along the tangent at the neck, so a stem that
//! bends outwards lets its flower nod. Feet of a bush stand on the ground around its origin; stems in a vase lean on each other as
//! in a spiral bouquet, straight lines of one family of a hyperboloid, which do not meet.
//!
//! Equation: with m = |N - F|^2 and q = D.(N - F), the control point of the parabola (a quadratic Bezier curve whose two
//! tangents have equal parts along the flower's axis T) is
//! C = F + t D, t = (3 q - sqrt(9 q^2 - 8 m)) / 4, T = (N - C) / |N - C|, stem length = 2 |N - C|.
//!
//! Places: each rose tries [`CANDIDATES`] places of a low-discrepancy sequence and takes the one farthest from the flowers placed
//! before, of those where spheres around flowers stay clear of each other and of all stems; if a rose finds none, the
//! whole arrangement spreads by [`WIDER`] and begins again. Then leaves that still run into a neighbour are taken off
//! (`clearing`).
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | kind, number | `kind`, `count` | - | vase, 3 (bush 9) |
//! | first to last openness | `openness` | - | 0.35, 0.95 |
//! | highest flower above the opening or the ground | `height_mm` | mm | 150 (bush 620) |
//! | lean to begin with | `spread_deg` | deg | 3 (bush 44) |
//! | opening above the foot, its radius | `opening_height_mm`, `opening_radius_mm` | mm | 170, 26 |
//!
//! Limits: no petal meets anything of another rose (`petals_of_neighbours_do_not_meet`); stems pass the opening
//! (`stems_pass_the_opening`). Prickles may touch a neighbour's leaf; nothing keeps leaves off the vase or the ground.
//! Memory: all roses are held at once, about 75 bytes a triangle; a rose of detail 1 with leaves has some 10^5.
//!
//! Our reading.

mod clearing;
mod stand;

use glam::{DQuat, DVec3};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::flower::phyllotaxis::{GOLDEN_ANGLE_DEG, vary};
use crate::flower::rose::{RoseDescription, check};
use crate::flower::{Flower, OrganKind, grow};
use crate::{Error, Result};
use stand::Stand;

/// What an arrangement is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ArrangementKind {
    /// Cut stems that lean out of one opening.
    #[default]
    Vase,
    /// Canes that arch outwards and up from one place on the ground.
    Bush,
}

/// Several roses by rule. Frame: +z is up; the origin is the foot of the vase, or where the bush leaves the ground.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ArrangementDescription {
    /// Vase or bush.
    pub kind: ArrangementKind,
    /// Number of roses; `None` is 3 in a vase, 9 on a bush.
    pub count: Option<u32>,
    /// Seed of all that differs between two arrangements of one kind.
    pub seed: u64,
    /// Openness of the most closed and of the most open rose; the others lie evenly between.
    pub openness: [f64; 2],
    /// Height of the highest flower above the opening or the ground; `None` is 150 mm, for a bush 620.
    pub height_mm: Option<f64>,
    /// How far stems bend or canes lean at first; `None` is 3 deg, for a bush 44. It grows until the roses fit.
    pub spread_deg: Option<f64>,
    /// Vase: height of the opening above the foot, mm.
    pub opening_height_mm: f64,
    /// Vase: radius of the opening, mm.
    pub opening_radius_mm: f64,
}

/// A rose of an arrangement.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedRose {
    /// How it grows.
    pub rose: RoseDescription,
    /// Place of the point where its petals grow, mm.
    pub position_mm: DVec3,
    /// How it is turned.
    pub rotation: DQuat,
}

/// Places that a rose tries.
pub const CANDIDATES: u32 = 192;
/// Factor on the spread when a rose finds no place.
pub const WIDER: f64 = 1.12;
/// Times that an arrangement spreads.
const SPREADS: u32 = 30;
/// Fineness of the flowers whose size is measured before they are placed.
const MEASURED_DETAIL: f64 = 0.4;
/// Most roses.
const MOST_ROSES: f64 = 64.0;

impl ArrangementDescription {
    /// Number of roses.
    pub fn count(&self) -> u32 {
        self.count.unwrap_or(match self.kind {
            ArrangementKind::Vase => 3,
            ArrangementKind::Bush => 9,
        })
    }

    /// Height of the highest flower above the opening or the ground, mm.
    pub fn height_mm(&self) -> f64 {
        self.height_mm.unwrap_or(match self.kind {
            ArrangementKind::Vase => 150.0,
            ArrangementKind::Bush => 620.0,
        })
    }

    /// Spread to begin with, deg.
    pub fn spread_deg(&self) -> f64 {
        self.spread_deg.unwrap_or(match self.kind {
            ArrangementKind::Vase => 3.0,
            ArrangementKind::Bush => 44.0,
        })
    }

    /// Checks every key; `at` is the dotted path of this table.
    pub fn validate(&self, at: &str) -> Result<()> {
        check(at, "count", f64::from(self.count()), 1.0, MOST_ROSES)?;
        for end in self.openness {
            check(at, "openness", end, 0.0, crate::flower::bloom::OVERBLOWN)?;
        }
        check(at, "height_mm", self.height_mm(), 40.0, 1500.0)?;
        check(at, "spread_deg", self.spread_deg(), 0.5, 70.0)?;
        check(at, "opening_height_mm", self.opening_height_mm, 20.0, 1000.0)?;
        check(at, "opening_radius_mm", self.opening_radius_mm, 5.0, 500.0)
    }

    /// The roses with their places; `rose` is what they have in common.
    pub fn place(&self, rose: &RoseDescription) -> Result<Vec<PlacedRose>> {
        self.validate("arrangement")?;
        rose.validate("rose")?;
        let roses: Vec<RoseDescription> = (0..self.count()).map(|k| self.one(rose, k)).collect();
        let flowers = roses.par_iter().map(measure).collect::<Result<Vec<Sphere>>>()?;
        let mut spread_deg = self.spread_deg();
        for _ in 0..SPREADS {
            let stand = Stand { arrangement: self, roses: &roses, flowers: &flowers, spread_deg };
            if let Some(placed) = stand.fill() {
                return Ok(placed);
            }
            spread_deg *= WIDER;
        }
        Err(Error::invalid(
            "arrangement",
            format!(
                "{} roses find no place without touching; fewer, smaller or more closed ones, longer stems or a wider opening do",
                roses.len()
            ),
        ))
    }

    /// Grows the roses, in their places, without the leaves that would run into a neighbour.
    pub fn grow(&self, rose: &RoseDescription) -> Result<Vec<Flower>> {
        let placed = self.place(rose)?;
        let mut flowers = placed.par_iter().map(PlacedRose::grow).collect::<Result<Vec<Flower>>>()?;
        clearing::clear(&mut flowers);
        Ok(flowers)
    }

    /// Rose `k` before it has its stem. The most open ones come first and so find the most space.
    fn one(&self, rose: &RoseDescription, k: u32) -> RoseDescription {
        let [low, high] = self.openness;
        let part = f64::from(k) / f64::from(self.count().max(2) - 1);
        let seed = rose.seed.wrapping_add(self.seed.wrapping_mul(1009)).wrapping_add(u64::from(k));
        RoseDescription { seed, openness: high + (low - high) * part, ..rose.clone() }
    }

    /// Turn of rose `k` about its own axis, radians.
    fn turn(&self, k: u32) -> f64 {
        (f64::from(k) * GOLDEN_ANGLE_DEG + 180.0 * vary(self.seed, k, 1)).to_radians()
    }
}

impl PlacedRose {
    /// Grows the rose in its place.
    pub fn grow(&self) -> Result<Flower> {
        let mut flower = grow(&self.rose)?;
        for organ in &mut flower.organs {
            for p in &mut organ.mesh.positions {
                *p = (self.rotation * p.as_dvec3() + self.position_mm).as_vec3();
            }
            for n in &mut organ.mesh.normals {
                *n = (self.rotation * n.as_dvec3()).as_vec3();
            }
        }
        Ok(flower)
    }
}

/// A sphere around the petals and sepals of a rose, its middle on the axis.
#[derive(Clone, Copy, Debug)]
struct Sphere {
    height_mm: f64,
    radius_mm: f64,
}

fn measure(rose: &RoseDescription) -> Result<Sphere> {
    let mut small = RoseDescription { detail: rose.detail.min(MEASURED_DETAIL), ..rose.clone() };
    small.leaves.count = 0;
    small.stem.length_mm = 10.0;
    let flower = grow(&small)?;
    let points = || {
        let bloom = flower.organs.iter().filter(|o| matches!(o.kind, OrganKind::Petal | OrganKind::Sepal));
        bloom.flat_map(|o| &o.mesh.positions).map(|p| p.as_dvec3())
    };
    let (low, high) = points().fold((0.0, 0.0), |(low, high): (f64, f64), p| (low.min(p.z), high.max(p.z)));
    let height_mm = (low + high) / 2.0;
    let radius_mm = points().map(|p| p.distance(DVec3::Z * height_mm)).fold(0.0, f64::max);
    Ok(Sphere { height_mm, radius_mm })
}

#[cfg(test)]
mod tests;

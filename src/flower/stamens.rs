//! The heart of an open rose: whorls of stamens around a tuft of styles.
//!
//! Model: stamen k of n stands on the disc inside the petals at the radius rim (0.5 + 0.5 k/n)^0.5 in a golden spiral;
//! its filament leaves the axis at an angle from `inner_deg` to `outer_deg` and bends back towards it by two fifths of that; the
//! outer ones are longer. Each ends in an anther of two lobes. Styles stand upright on the middle of the disc, each with a
//! stigma. Where the petals leave less room, `inner_radius_mm(z)`, all lean together as far as needed; what then
//! finds no place does not grow.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | n | `count` | - | 80 |
//! | filament of the outer whorl, radius | `filament_mm`, `filament_radius_mm` | mm | 9, 0.09 |
//! | angles | `inner_deg`, `outer_deg` | deg | 12, 64 |
//! | anther | `anther_mm` | mm | 1.5 |
//! | styles | `styles`, `style_mm` | -, mm | 18, 4.5 |
//!
//! Limits: no stamen touches another, a style or the petals (`stamens_keep_apart_and_inside`). Numbers: a dog rose has
//! 60-150 stamens (our reading).

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::flower::leaf::Growth;
use crate::flower::phyllotaxis::{GOLDEN_ANGLE_DEG, vary};
use crate::flower::rose::check;
use crate::flower::tube::{Ring, tube};
use crate::geometry::Mesh;

/// Stamens and styles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StamenDescription {
    /// Largest number of stamens (default 80).
    pub count: u32,
    /// Length of the outermost filaments, mm (default 9).
    pub filament_mm: f64,
    /// Radius of a filament, mm (default 0.09).
    pub filament_radius_mm: f64,
    /// Angle of the innermost stamens from the axis, deg (default 12).
    pub inner_deg: f64,
    /// Angle of the outermost stamens from the axis, deg (default 64).
    pub outer_deg: f64,
    /// Length of an anther, mm (default 1.5).
    pub anther_mm: f64,
    /// Largest number of styles (default 18).
    pub styles: u32,
    /// Length of a style, mm (default 4.5).
    pub style_mm: f64,
}

impl Default for StamenDescription {
    fn default() -> Self {
        Self {
            count: 80,
            filament_mm: 9.0,
            filament_radius_mm: 0.09,
            inner_deg: 12.0,
            outer_deg: 64.0,
            anther_mm: 1.5,
            styles: 18,
            style_mm: 4.5,
        }
    }
}

impl StamenDescription {
    /// Checks every key; `at` is the dotted path of this table.
    pub fn validate(&self, at: &str) -> Result<()> {
        check(at, "count", f64::from(self.count), 0.0, 1000.0)?;
        check(at, "filament_mm", self.filament_mm, 0.5, 50.0)?;
        check(at, "filament_radius_mm", self.filament_radius_mm, 0.01, 2.0)?;
        check(at, "inner_deg", self.inner_deg, 0.0, 120.0)?;
        check(at, "outer_deg", self.outer_deg, 0.0, 120.0)?;
        check(at, "anther_mm", self.anther_mm, 0.1, 20.0)?;
        check(at, "styles", f64::from(self.styles), 0.0, 500.0)?;
        check(at, "style_mm", self.style_mm, 0.2, 50.0)
    }
}

/// Where stamens can stand.
pub struct StamenRoom<'a> {
    /// Height of the disc that they stand on at a distance from the axis, mm.
    pub disc_mm: &'a dyn Fn(f64) -> f64,
    /// Radius of the disc, mm.
    pub rim_mm: f64,
    /// Distance from the axis that the petals leave free at a height, mm.
    pub inner_radius_mm: &'a dyn Fn(f64) -> f64,
}

/// Meshes of the heart; empty where nothing grows.
#[derive(Clone, Debug, Default)]
pub struct Heart {
    /// All filaments.
    pub filaments: Mesh,
    /// All anthers.
    pub anthers: Mesh,
    /// All styles with their stigmas.
    pub styles: Mesh,
}

/// A curve with its thickness: what others must keep away from.
struct Rod {
    points: Vec<DVec3>,
    radius_mm: Vec<f64>,
}

/// Smallest distance between two rods' surfaces and to the petals, mm.
const APART_MM: f64 = 0.06;
/// Points of a filament.
const STEPS: usize = 10;

impl Rod {
    fn touches(&self, other: &Self) -> bool {
        let reach = |r: &Self| r.radius_mm.iter().copied().fold(0.0, f64::max);
        let ends = |r: &Self| {
            (r.points[0] + r.points[r.points.len() - 1], r.points[0].distance(r.points[r.points.len() - 1]))
        };
        let ((a, long), (b, length)) = (ends(self), ends(other));
        if 0.5 * a.distance(b) > 0.7 * (long + length) + reach(self) + reach(other) + 1.0 {
            return false;
        }
        self.points.iter().zip(&self.radius_mm).any(|(&p, &r)| {
            // Distance from the point to each piece of the other rod.
            other.points.windows(2).zip(&other.radius_mm).any(|(q, &s)| {
                let along = q[1] - q[0];
                let t = ((p - q[0]).dot(along) / along.length_squared()).clamp(0.0, 1.0);
                p.distance(q[0] + along * t) < r + s + APART_MM
            })
        })
    }

    fn fits(&self, room: &StamenRoom<'_>) -> bool {
        self.points.iter().zip(&self.radius_mm).all(|(p, r)| {
            let free = (room.inner_radius_mm)(p.z + r).min((room.inner_radius_mm)(p.z - r));
            p.truncate().length() + r + APART_MM < free
        })
    }
}

impl StamenDescription {
    /// Grows stamens and styles.
    pub fn grow(&self, room: &StamenRoom<'_>, growth: &Growth) -> Heart {
        let mut heart = Heart::default();
        let mut rods: Vec<Rod> = Vec::new();
        let n = |n: f64| ((n * growth.detail.sqrt()).round() as usize).max(3);
        for index in 0..self.styles {
            let rod = self.style(index, room, growth);
            if rod.fits(room) && !rods.iter().any(|r| r.touches(&rod)) {
                heart.styles.append(&rod_mesh(&rod, n(5.0)));
                rods.push(rod);
            }
        }
        let spread = self.spread(room, growth);
        for index in 0..self.count {
            // A stamen in the way of another leans a little to the side.
            for attempt in 0..12 {
                let rod = self.stamen(index, attempt, spread, room, growth);
                if rod.fits(room) && !rods.iter().any(|r| r.touches(&rod)) {
                    let filament = Rod {
                        points: rod.points[..=STEPS].to_vec(),
                        radius_mm: (0..=STEPS)
                            .map(|k| self.filament_radius_mm * (1.15 - 0.4 * k as f64 / STEPS as f64))
                            .collect(),
                    };
                    heart.filaments.append(&rod_mesh(&filament, n(5.0)));
                    let turn = TAU * vary(growth.seed ^ 0xa17e, index, 5);
                    self.anther(&rod, turn, n(6.0), &mut heart.anthers);
                    rods.push(rod);
                    break;
                }
            }
        }
        heart
    }

    /// Factor on all angles with which the outermost stamens still fit.
    fn spread(&self, room: &StamenRoom<'_>, growth: &Growth) -> f64 {
        let still = Growth { irregularity: 0.0, ..*growth };
        let fits = |spread: f64| {
            (self.count.saturating_sub(8)..self.count)
                .all(|k| self.stamen(k, 0, spread, room, &still).fits(room))
        };
        if fits(1.0) {
            return 1.0;
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..12 {
            let middle = 0.5 * (low + high);
            if fits(middle) { low = middle } else { high = middle }
        }
        low
    }

    fn style(&self, index: u32, room: &StamenRoom<'_>, growth: &Growth) -> Rod {
        let v = |k| growth.irregularity * vary(growth.seed ^ 0x57e1, index, k);
        let part = (f64::from(index) + 0.5) / f64::from(self.styles.max(1));
        let radius = 0.30 * room.rim_mm * part.sqrt();
        let azimuth = (f64::from(index) * GOLDEN_ANGLE_DEG).to_radians();
        let out = DVec2::from_angle(azimuth);
        let length = self.style_mm * (1.0 - 0.25 * part + 0.12 * v(1));
        let lean = 0.45 * part.sqrt() * (1.0 + 0.3 * v(2));
        let foot = (room.disc_mm)(radius) + 0.02;
        let points = (0..=STEPS)
            .map(|k| {
                let t = k as f64 / STEPS as f64;
                let r = radius + length * lean * t * t;
                (out * r).extend(foot + length * t)
            })
            .collect();
        let radius_mm = (0..=STEPS)
            .map(|k| {
                let t = k as f64 / STEPS as f64;
                // The stigma is a knob.
                self.filament_radius_mm * (0.95 + 1.3 * (-((t - 0.94) / 0.05).powi(2)).exp())
            })
            .collect();
        Rod { points, radius_mm }
    }

    /// Filament and anther as one rod: points up to `STEPS` are the filament, the rest the anther.
    fn stamen(&self, index: u32, attempt: u32, spread: f64, room: &StamenRoom<'_>, growth: &Growth) -> Rod {
        let v = |k| growth.irregularity * vary(growth.seed ^ 0xa17e, index, k + 16 * attempt);
        let part = (f64::from(index) + 0.5) / f64::from(self.count.max(1));
        let radius = room.rim_mm * (0.26 + 0.74 * part).sqrt();
        let azimuth =
            (f64::from(index) * GOLDEN_ANGLE_DEG).to_radians() + (0.10 + 0.03 * f64::from(attempt)) * v(1);
        let length = self.filament_mm * (0.62 + 0.38 * part) * (1.0 + 0.2 * v(2));
        let angle =
            spread * (self.inner_deg + (self.outer_deg - self.inner_deg) * part + 6.0 * v(3)).to_radians();
        let back = 0.4 * angle * (1.0 + 0.4 * v(4));
        let (out, side) = (DVec2::from_angle(azimuth), 0.12 * v(6));
        let foot = (room.disc_mm)(radius) + 0.02;
        let (mut r, mut z) = (radius, foot);
        let mut points = vec![(out * r).extend(z)];
        let mut radii = vec![1.15 * self.filament_radius_mm];
        let step = length / STEPS as f64;
        for k in 1..=STEPS {
            let t = (k as f64 - 0.5) / STEPS as f64;
            let heading =
                0.35 * angle + 0.65 * angle * (t / 0.35).min(1.0) - back * ((t - 0.5) / 0.5).max(0.0);
            r += step * heading.sin();
            z += step * heading.cos();
            let t = k as f64 / STEPS as f64;
            let p = out.rotate(DVec2::from_angle(side * t * t)) * r;
            points.push(p.extend(z));
            radii.push(self.filament_radius_mm * (1.15 - 0.4 * t));
        }
        // The anther, in the direction of the filament's end.
        let end = points[STEPS];
        let along = (end - points[STEPS - 1]).normalize_or(DVec3::Z);
        for t in [0.1, 0.5, 0.9] {
            points.push(end + along * (t * self.anther_mm));
            radii.push(0.37 * self.anther_mm);
        }
        Rod { points, radius_mm: radii }
    }

    /// Two lobes side by side at the end of a filament.
    fn anther(&self, rod: &Rod, turn: f64, around: usize, all: &mut Mesh) {
        let end = rod.points[STEPS];
        let along = (rod.points[STEPS + 2] - end).normalize_or(DVec3::Z);
        let normal = along.any_orthonormal_vector();
        let aside = normal * turn.cos() + along.cross(normal) * turn.sin();
        let (length, half) = (self.anther_mm, 0.155 * self.anther_mm);
        for side in [-1.0, 1.0] {
            let count = around.max(4);
            let rings: Vec<Ring> = (0..=count)
                .map(|k| {
                    let t = k as f64 / count as f64;
                    let thick = (4.0 * (0.015 + 0.97 * t) * (0.985 - 0.97 * t)).sqrt();
                    // Lobes spread a little at both ends, as a grain of coffee does.
                    let bow = 1.04 + 0.25 * (2.0 * t - 1.0).powi(2) * thick;
                    Ring {
                        centre_mm: end + along * (0.02 + t * length) + aside * (side * half * bow),
                        radii_mm: DVec2::new(half, 1.25 * half) * thick,
                    }
                })
                .collect();
            all.append(&tube(&rings, aside, around, None));
        }
    }
}

fn rod_mesh(rod: &Rod, around: usize) -> Mesh {
    let rings: Vec<Ring> = rod.points.iter().zip(&rod.radius_mm).map(|(&p, &r)| Ring::circle(p, r)).collect();
    tube(&rings, DVec3::X, around, None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::crossings::crossings;

    #[test]
    fn stamens_keep_apart_and_inside() {
        let growth = Growth { seed: 2, irregularity: 1.0, detail: 1.0 };
        let d = StamenDescription::default();
        for (name, slope, least) in [("wide", 3.0, 60), ("narrow", 0.5, 10), ("closed", 0.0, 0)] {
            let inner = |z: f64| 3.0 + slope * z.max(0.0);
            let room = StamenRoom { disc_mm: &|_| 0.0, rim_mm: 2.6, inner_radius_mm: &inner };
            let heart = d.grow(&room, &growth);
            let per_lobe = |m: &Mesh| m.triangles.len() / (2 * (2 * 6 * 6 + 2 * 6));
            assert!(per_lobe(&heart.anthers) >= least, "{name}: {}", per_lobe(&heart.anthers));
            for m in [&heart.filaments, &heart.anthers, &heart.styles] {
                for p in &m.positions {
                    assert!(f64::from(p.truncate().length()) < inner(f64::from(p.z)), "{name}: {p}");
                }
            }
            let found = crossings(&[&heart.filaments, &heart.anthers, &heart.styles]);
            assert!(found.is_empty(), "{name}: {} pairs, {:?}", found.len(), found[0]);
        }
    }
}

//! The flat petal: a narrow claw and a broad blade, before it is bent.
//!
//! Model, x across and y along in mm, u and v in [0, 1], a = 2 u - 1:
//!
//! ```text
//! x = half(v) sin(a k) / sin k,   half(v) = (claw + (width - claw) sin(pi/2 v^0.85)) / 2,   k = 0.95 pi/2
//! y = v length (widest + (1 - widest) (cos(a k) - cos k) / (1 - cos k)) + tip v^3 exp(-(a / 0.22)^2) - nicks
//! ```
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | length, width, claw | `length_mm`, `width_mm`, `claw_width_mm` | mm | by age, see [`crate::flower::rose`] |
//! | widest | `widest` | part of the length | 0.6 |
//! | tip: point (positive) or notch (negative) | `tip_mm` | mm | |
//! | nicks: small tears of the rim | `nicks_mm` | mm | 0 |
//!
//! Limits: the rim ends a little short of tangent to the sides, so that the grid has no empty corner; the outline
//! has no fold (`the_flat_petal_has_no_fold`). Our reading: no measured outline of a hybrid tea's petal is used.

use std::f64::consts::FRAC_PI_2;

use glam::DVec2;

use crate::flower::phyllotaxis::vary;

/// Size and shape of a flat petal.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// Claw to rim along the middle, mm.
    pub length_mm: f64,
    /// Largest width, mm.
    pub width_mm: f64,
    /// Width at the receptacle, mm.
    pub claw_width_mm: f64,
    /// Where it is widest, as a part of the length.
    pub widest: f64,
    /// Point (positive) or notch (negative) at the middle of the rim, mm.
    pub tip_mm: f64,
    /// Depth of the largest tear of the rim, mm.
    pub nicks_mm: f64,
    /// Seed of the tears.
    pub seed: u64,
}

const RIM_SPAN: f64 = 0.95 * FRAC_PI_2;
const NICKS: u32 = 7;

impl Outline {
    /// The point (across, along) in mm.
    pub fn at(&self, u: f64, v: f64) -> DVec2 {
        let across = 2.0 * u - 1.0;
        let (sin, cos) = (across * RIM_SPAN).sin_cos();
        let end = RIM_SPAN.cos();
        let rim = self.widest + (1.0 - self.widest) * (cos - end) / (1.0 - end);
        let tip = self.tip_mm * (-(across / 0.22).powi(2)).exp() * v * v * v;
        let nick = self.nick(u) * v.powi(12);
        DVec2::new(self.half_width_mm(v) * sin / RIM_SPAN.sin(), v * self.length_mm * rim + tip - nick)
    }

    /// The place (u, v) of a point of the flat petal, as if its rim had no tears. Beyond the sides u goes on as it runs
    /// there; v is held at 0 and 1. Guarded by `the_inverse_finds_the_place`.
    pub fn inverse(&self, p: DVec2) -> DVec2 {
        let smooth = |v: f64| {
            let part = p.x / self.half_width_mm(v);
            let across = (part.clamp(-1.0, 1.0) * RIM_SPAN.sin()).asin() / RIM_SPAN;
            (across + part - part.clamp(-1.0, 1.0), self.along_mm(across, v))
        };
        // y grows with v on every line of constant x, since the fan widens.
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..24 {
            let v = 0.5 * (low + high);
            *if smooth(v).1 < p.y { &mut low } else { &mut high } = v;
        }
        let v = 0.5 * (low + high);
        DVec2::new(0.5 + 0.5 * smooth(v).0, v)
    }

    /// u of a point across, in parts of the half width from -1 to 1 at its height; held at the sides.
    pub(crate) fn across(part: f32) -> f32 {
        const SPAN: f32 = RIM_SPAN as f32;
        // sin(SPAN)
        const SIN: f32 = 0.996_917_3;
        0.5 + 0.5 * ((part.clamp(-1.0, 1.0) * SIN).asin() * (1.0 / SPAN)).clamp(-1.0, 1.0)
    }

    /// y at a place across from -1 to 1 and along, without tears, mm.
    fn along_mm(&self, across: f64, v: f64) -> f64 {
        let end = RIM_SPAN.cos();
        let rim = self.widest + (1.0 - self.widest) * ((across * RIM_SPAN).cos() - end) / (1.0 - end);
        v * self.length_mm * rim + self.tip_mm * (-(across / 0.22).powi(2)).exp() * v * v * v
    }

    /// Half of the width at `v`, mm.
    pub fn half_width_mm(&self, v: f64) -> f64 {
        let belly = (FRAC_PI_2 * v.clamp(0.0, 1.0).powf(0.85)).sin();
        0.5 * (self.claw_width_mm + (self.width_mm - self.claw_width_mm) * belly)
    }

    /// Height of the rim at a place across, mm.
    pub fn rim_mm(&self, across_mm: f64) -> f64 {
        let across = (2.0 * across_mm / self.width_mm).clamp(-1.0, 1.0);
        let cos = (1.0 - across * across * RIM_SPAN.sin().powi(2)).sqrt();
        let end = RIM_SPAN.cos();
        self.length_mm * (self.widest + (1.0 - self.widest) * (cos - end) / (1.0 - end))
            + self.tip_mm.max(0.0)
    }

    /// How far the blade reaches in the direction `normal`, mm.
    pub fn support_mm(&self, normal: DVec2) -> f64 {
        let smooth = Self { nicks_mm: 0.0, tip_mm: self.tip_mm.min(0.0), ..self.clone() };
        (0..=64)
            .flat_map(|i| {
                let t = f64::from(i) / 64.0;
                [smooth.at(t, 1.0), smooth.at(0.0, t), smooth.at(1.0, t)]
            })
            .map(|p| p.dot(normal))
            .fold(f64::NEG_INFINITY, f64::max)
    }

    /// Tears: narrow notches at random places of the rim.
    fn nick(&self, u: f64) -> f64 {
        if self.nicks_mm == 0.0 {
            return 0.0;
        }
        (0..NICKS)
            .map(|k| {
                let v = |trait_id: u32| 0.5 + 0.5 * vary(self.seed, k, 40 + trait_id);
                let (at, depth, wide) = (0.08 + 0.84 * v(0), v(1).powi(3), 0.012 + 0.03 * v(2));
                self.nicks_mm * depth * (1.0 - ((u - at) / wide).abs()).max(0.0)
            })
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_finds_the_place() {
        for tip_mm in [3.0, -4.0] {
            let o = Outline {
                length_mm: 50.0,
                width_mm: 54.0,
                claw_width_mm: 9.0,
                widest: 0.6,
                tip_mm,
                nicks_mm: 0.0,
                seed: 3,
            };
            for k in 0..400 {
                let place = DVec2::new(f64::from(k % 20) / 19.0, f64::from(k / 20) / 19.0);
                let found = o.inverse(o.at(place.x, place.y));
                assert!(found.distance(place) < 1e-4, "{place} {found}");
            }
            // Beyond the border.
            assert!(o.inverse(DVec2::new(0.0, 80.0)).y > 0.999 && o.inverse(DVec2::new(0.0, -5.0)).y < 1e-6);
            assert!(o.inverse(DVec2::new(40.0, 20.0)).x > 1.0 && o.inverse(DVec2::new(-40.0, 20.0)).x < 0.0);
        }
    }

    #[test]
    fn the_flat_petal_has_no_fold() {
        for (tip_mm, widest) in [(3.0, 0.6), (-5.0, 0.7), (0.0, 0.5)] {
            let o = Outline {
                length_mm: 50.0,
                width_mm: 54.0,
                claw_width_mm: 9.0,
                widest,
                tip_mm,
                nicks_mm: 1.5,
                seed: 3,
            };
            let n = 60;
            for i in 0..n {
                for j in 0..n {
                    let p = |a: i32, b: i32| o.at(f64::from(a) / f64::from(n), f64::from(b) / f64::from(n));
                    let cell = (p(i + 1, j) - p(i, j)).perp_dot(p(i, j + 1) - p(i, j));
                    assert!(cell > 0.0, "{i} {j}: {cell}");
                }
            }
        }
    }
}

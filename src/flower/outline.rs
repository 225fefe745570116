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

//! The veins of a petal: a fan from the claw that forks again and again on the way to the rim.
//!
//! Model: in the coordinates (u, v) of the flat petal lines of constant u fan out from the claw. Generation 0 has
//! `first` veins; a vein of generation g leaves its parent at v_g and runs half-way between its neighbours:
//!
//! ```text
//! u(v) = parent + (own - parent) smooth((v - v_g) / spread),   own = (k + 1/2 + jitter) / (first 2^g)
//! ```
//!
//! and thins on the way: width(v) = `width_mm` 0.75^g (1 - 0.55 v).
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | first | [`Veins::first`] | - | 7 |
//! | generations | [`Veins::generations`] | - | 4 |
//! | width | [`Veins::width_mm`] | mm | 0.35 |
//!
//! Limits: an open fan, no cross veins; every point of a vein is found (`veins_reach_the_rim`). Source: open dichotomous venation of rose petals is
//! described in every flora; numbers and places are our reading.

use crate::flower::outline::Outline;
use crate::flower::phyllotaxis::vary;

/// A fan of forking veins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Veins {
    /// Veins that enter the blade.
    pub first: u32,
    /// Times that they fork.
    pub generations: u32,
    /// Width of the midrib at the claw, mm.
    pub width_mm: f64,
    /// Seed of the irregularities.
    pub seed: u64,
}

impl Default for Veins {
    fn default() -> Self {
        Self { first: 7, generations: 4, width_mm: 0.35, seed: 0 }
    }
}

impl Veins {
    /// How much of a point is vein, 0 to 1: the profile of the nearest vein, of Gaussian shape.
    pub fn at(&self, outline: &Outline, u: f64, v: f64) -> f64 {
        let span_mm = 2.0 * outline.half_width_mm(v);
        let mut most: f64 = 0.0;
        for generation in 0..=self.generations {
            let count = self.first << generation;
            let near = (u * f64::from(count)).floor() as i64;
            let width = self.width_at_mm(generation, v);
            for k in near - 2..=near + 2 {
                if k < 0 || k >= i64::from(count) {
                    continue;
                }
                let Some(at) = self.line(generation, k as u32, v) else { continue };
                let d = (u - at) * span_mm / (0.5 * width);
                most = most.max((-d * d).exp());
            }
        }
        most
    }

    /// Every vein that there is at `v`: where it is and half its width, both in u, on this petal. As [`Veins::at`], for
    /// a whole line of constant v at once.
    pub fn across(&self, outline: &Outline, v: f64) -> Vec<(f64, f64)> {
        let span_mm = 2.0 * outline.half_width_mm(v);
        let mut all = Vec::new();
        let mut parents: Vec<Option<f64>> = Vec::new();
        for generation in 0..=self.generations {
            let lines: Vec<Option<f64>> = (0..self.first << generation)
                .map(|k| match generation {
                    0 => Some(self.own(0, k)),
                    _ => self.forked(generation, k, v, || parents[(k / 2) as usize]),
                })
                .collect();
            let half = 0.5 * self.width_at_mm(generation, v) / span_mm;
            all.extend(lines.iter().flatten().map(|&u| (u, half)));
            parents = lines;
        }
        all
    }

    /// Width of the veins of a generation at `v`, mm.
    fn width_at_mm(&self, generation: u32, v: f64) -> f64 {
        self.width_mm * 0.75f64.powi(generation as i32) * (1.0 - 0.55 * v)
    }

    /// Where vein `k` of a generation is at `v`; `None` before it has left its parent.
    fn line(&self, generation: u32, k: u32, v: f64) -> Option<f64> {
        match generation {
            0 => Some(self.own(0, k)),
            _ => self.forked(generation, k, v, || self.line(generation - 1, k / 2, v)),
        }
    }

    /// The same for a vein that leaves its `parent`.
    fn forked(&self, generation: u32, k: u32, v: f64, parent: impl FnOnce() -> Option<f64>) -> Option<f64> {
        let id = (generation << 16) | k;
        let leaves = 0.62 * (1.0 - 0.6f64.powi(generation as i32)) + 0.10 * vary(self.seed, id, 21) - 0.08;
        if v < leaves {
            return None;
        }
        let (own, parent) = (self.own(generation, k), parent()?);
        let t = ((v - leaves) / 0.28).min(1.0);
        Some(parent + (own - parent) * t * t * (3.0 - 2.0 * t))
    }

    fn own(&self, generation: u32, k: u32) -> f64 {
        let count = f64::from(self.first << generation);
        let id = (generation << 16) | k;
        (f64::from(k) + 0.5 + 0.25 * vary(self.seed, id, 20)) / count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn veins_reach_the_rim() {
        let outline = Outline {
            length_mm: 50.0,
            width_mm: 54.0,
            claw_width_mm: 9.0,
            widest: 0.6,
            tip_mm: 0.0,
            nicks_mm: 0.0,
            seed: 0,
        };
        let veins = Veins::default();
        let count = |v: f64| {
            let on: Vec<bool> =
                (0..20_000).map(|i| veins.at(&outline, f64::from(i) / 20_000.0, v) > 0.5).collect();
            on.windows(2).filter(|w| !w[0] && w[1]).count() as u32
        };
        // No more veins than there are lines, and most of them apart from each other near the rim.
        let all: u32 = (0..=veins.generations).map(|g| veins.first << g).sum();
        assert!(count(0.95) <= all && count(0.95) > all / 2, "{} of {all}", count(0.95));
        assert!(count(0.02) < count(0.5) && count(0.5) < count(0.95));
    }
}

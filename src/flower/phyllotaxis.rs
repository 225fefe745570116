//! Where organs stand around the axis: spiral phyllotaxis.
//!
//! Model: consecutive organs of one spiral are turned by a constant divergence angle; in most plants, roses
//! among them, it is close to the golden angle.
//!
//! Equation: azimuth(i) = i * divergence + jitter(i), with the golden angle 360 (1 - 1/phi) = 137.50776 deg.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | divergence | `divergence_deg` | deg | 137.50776 |
//! | jitter, largest | `jitter_deg` | deg | 4 |
//!
//! Limits: divergence 2/5 of a turn (144 deg) puts organs in five ranks, guarded by
//! `two_fifths_makes_five_ranks`. Source: Prusinkiewicz and Lindenmayer, The Algorithmic Beauty of Plants,
//! chapter 4 (1990); the size of the jitter is our reading.

use crate::math::sampler::{hash, hash_to_unit};

/// The golden angle.
pub const GOLDEN_ANGLE_DEG: f64 = 137.507_764_050_037_85;

/// One spiral of organs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spiral {
    /// Angle from one organ to the next, deg.
    pub divergence_deg: f64,
    /// Largest deviation of one organ, deg.
    pub jitter_deg: f64,
    /// Seed of the deviations.
    pub seed: u64,
}

impl Spiral {
    /// Azimuth of organ `index` in [0, 360).
    pub fn azimuth_deg(&self, index: u32) -> f64 {
        let jitter = self.jitter_deg * vary(self.seed, index, 0);
        (f64::from(index) * self.divergence_deg + jitter).rem_euclid(360.0)
    }
}

/// Uniform number in [-1, 1) that belongs to a trait of an organ: a flower grows the same whatever order its
/// organs are made in.
pub fn vary(seed: u64, organ: u32, trait_id: u32) -> f64 {
    let key = hash(hash(seed as u32 ^ 0x85eb_ca6b) ^ (seed >> 32) as u32) ^ hash(organ ^ 0xc2b2_ae35);
    2.0 * hash_to_unit(key.wrapping_add(trait_id.wrapping_mul(0x9e37_79b9))) - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn consecutive_organs_are_one_divergence_apart() {
        let exact = Spiral { divergence_deg: GOLDEN_ANGLE_DEG, jitter_deg: 0.0, seed: 1 };
        let jittered = Spiral { jitter_deg: 4.0, ..exact };
        for i in 0..60 {
            let step = |s: &Spiral| (s.azimuth_deg(i + 1) - s.azimuth_deg(i)).rem_euclid(360.0);
            assert!((step(&exact) - 137.507_764).abs() < 1e-6);
            assert!((step(&jittered) - 137.507_764).abs() < 8.0);
        }
    }

    #[test]
    fn two_fifths_makes_five_ranks() {
        let s = Spiral { divergence_deg: 144.0, jitter_deg: 0.0, seed: 0 };
        for i in 0..20 {
            let apart = (s.azimuth_deg(i + 5) - s.azimuth_deg(i) + 180.0).rem_euclid(360.0) - 180.0;
            assert!(apart.abs() < 1e-9);
        }
    }

    #[test]
    fn traits_are_independent_and_keyed() {
        let mean = |f: &dyn Fn(u32) -> f64| (0..4000).map(f).sum::<f64>() / 4000.0;
        assert!(mean(&|i| vary(3, i, 1)).abs() < 0.04);
        assert!(mean(&|i| vary(3, i, 1) * vary(3, i, 2)).abs() < 0.025);
        assert!(mean(&|i| vary(3, i, 1) * vary(4, i, 1)).abs() < 0.025);
        assert!(mean(&|i| vary(3, i, 1) * vary(3 | 1 << 40, i, 1)).abs() < 0.025);
    }
}

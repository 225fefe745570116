//! A stream of independent uniform numbers, for walks whose length nobody knows beforehand.
//!
//! Model: SplitMix64: a counter in steps of the golden ratio through a mixing function of two rounds (Steele, Lea,
//! Flood 2014, "Fast splittable pseudorandom number generators", OOPSLA). Stratified numbers ([`super::Sampler`])
//! gain nothing after a few dimensions of such a walk. A stream depends only on its key, so any thread draws the same.
//! Guarded by `uniform_and_keyed`.

use glam::DVec2;

/// Draws one number after another.
#[derive(Clone, Debug)]
pub struct Stream {
    state: u64,
}

impl Stream {
    /// The stream of walk `index` of family `family`.
    pub fn new(seed: u64, family: u64, index: u64) -> Self {
        let key = mix(seed ^ mix(family ^ 0x6a09_e667_f3bc_c909));
        Self { state: mix(key ^ mix(index.wrapping_add(0xbb67_ae85_84ca_a73b))) }
    }

    /// Uniform in [0, 1), 53 bits.
    #[inline]
    #[expect(clippy::should_implement_trait, reason = "a stream has no end, so it is no iterator")]
    pub fn next(&mut self) -> f64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (mix(self.state) >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    /// Two numbers.
    #[inline]
    pub fn next_2d(&mut self) -> DVec2 {
        let x = self.next();
        DVec2::new(x, self.next())
    }

    /// An exponentially distributed number of mean one.
    #[inline]
    pub fn exponential(&mut self) -> f64 {
        // 1 - u is never zero.
        -(1.0 - self.next()).ln()
    }
}

#[inline]
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uniform_and_keyed() {
        // Chi-square of first numbers of many streams, and of many numbers of one: 255 degrees of freedom.
        let n = 1 << 18;
        let mut one = Stream::new(1, 2, 3);
        let mut counts = [[0.0f64; 256]; 2];
        for i in 0..n {
            counts[0][(one.next() * 256.0) as usize] += 1.0;
            counts[1][(Stream::new(1, 2, i).next() * 256.0) as usize] += 1.0;
        }
        let expected = n as f64 / 256.0;
        for c in counts {
            let chi2: f64 = c.iter().map(|c| (c - expected).powi(2) / expected).sum();
            assert!((170.0..350.0).contains(&chi2), "{chi2}");
        }
        let mean: f64 = (0..n).map(|_| one.exponential()).sum::<f64>() / n as f64;
        assert!((mean - 1.0).abs() < 4.0 / (n as f64).sqrt(), "{mean}");
        let first = |s, f, i| Stream::new(s, f, i).next();
        assert!(first(0, 0, 1) != first(0, 1, 0) && first(1, 0, 0) != first(0, 0, 0));
    }
}

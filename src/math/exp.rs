//! The exponential of many f32 at once.
//!
//! Model: `e^x = 2^n e^r`, n the whole number nearest to `x / ln 2`, |r| <= ln 2 / 2, and `e^r` by its Taylor polynomial of
//! degree 7, whose remainder is below 6e-9. No branch and no call, so that a compiler makes it a few vector instructions.
//!
//! Limits: relative error at most 2e-7 for x from -87 to 88; beyond, the value at the end of that range. Guarded by
//! `agrees_with_the_exact_exponential`.
//! Source: our reading.

use std::f32::consts::LOG2_E;

/// ln 2 in two parts, the first with so few digits that `n` times it is exact.
const LN_2: (f32, f32) = (0.693_359_4, -2.121_944_4e-4);
/// Adding it to a number below 2^22 leaves the number's nearest whole number in the last bits.
const ROUND: f32 = 12_582_912.0;

/// `e^x` of each.
#[inline]
pub fn exp<const N: usize>(x: [f32; N]) -> [f32; N] {
    x.map(|x| {
        let x = x.clamp(-87.0, 88.0);
        let shifted = x * LOG2_E + ROUND;
        let n = shifted - ROUND;
        let r = x - n * LN_2.0 - n * LN_2.1;
        let mut e = 1.0 / 5040.0;
        for c in [1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0] {
            e = e * r + c;
        }
        let exponent = shifted.to_bits().wrapping_sub(ROUND.to_bits()).wrapping_add(127);
        e * f32::from_bits(exponent << 23)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_exact_exponential() {
        let mut worst = 0.0f64;
        for i in 0..=1_750_000 {
            let x = -87.0 + i as f32 * 1e-4;
            let found = exp([x, 0.0]);
            worst = worst.max((f64::from(found[0]) / f64::from(x).exp() - 1.0).abs());
            assert_eq!(found[1], 1.0);
        }
        assert!(worst < 2e-7, "{worst}");
        let [low, high, end] = exp([-1e30, 1e30, f32::NEG_INFINITY]);
        assert!(low > 0.0 && low < 2e-38 && high.is_finite() && end == low);
    }
}

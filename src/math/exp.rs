//! The exponential and the logarithm of many f32 at once.
//!
//! Model: `ln y = n ln 2 + 2 artanh((m - 1) / (m + 1))`, y = 2^n m with m within sqrt(1/2) and sqrt 2, by the series of artanh up to
//! the ninth power, whose remainder is below 3e-9; `e^x = 2^n e^r`, n the whole number nearest to `x / ln 2`, |r| <= ln 2 / 2, and `e^r` by its Taylor polynomial of
//! degree 7, whose remainder is below 6e-9. No branch and no call, so that a compiler makes it a few vector instructions.
//!
//! Limits: relative error of the exponential at most 2e-7 for x from -87 to 88; beyond, the value at the end of that range
//! (`agrees_with_the_exact_exponential`). Error of the logarithm of normal positive numbers at most 2e-7, absolute or relative,
//! whichever is larger (`agrees_with_the_exact_logarithm`).
//! Source: our reading.

use std::f32::consts::{FRAC_1_SQRT_2, LOG2_E};

/// ln 2 in two parts, the first with so few digits that `n` times it is exact.
const LN_2: (f32, f32) = (0.693_359_4, -2.121_944_4e-4);
/// Adding it to a number below 2^22 leaves the number's nearest whole number in the last bits.
const ROUND: f32 = 12_582_912.0;

// Plain loops over arrays of known length: those a compiler makes vector instructions of.

/// `e^x` of each.
#[inline(always)]
pub fn exp<const N: usize>(x: [f32; N]) -> [f32; N] {
    let mut out = [0.0; N];
    for i in 0..N {
        let x = x[i].clamp(-87.0, 88.0);
        let shifted = x * LOG2_E + ROUND;
        let n = shifted - ROUND;
        let r = x - n * LN_2.0 - n * LN_2.1;
        let high = 1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0 + r * (1.0 / 5040.0)));
        let e = 1.0 + r * (1.0 + r * (0.5 + r * (1.0 / 6.0 + r * high)));
        let exponent = shifted.to_bits().wrapping_sub(ROUND.to_bits()).wrapping_add(127);
        out[i] = e * f32::from_bits(exponent << 23);
    }
    out
}

/// `ln y` of each; y is a normal positive number.
#[inline(always)]
pub fn ln<const N: usize>(y: [f32; N]) -> [f32; N] {
    const ROOT_HALF: u32 = FRAC_1_SQRT_2.to_bits();
    let mut out = [0.0; N];
    for i in 0..N {
        // The exponent of y over sqrt(1/2), so that the rest lies around one.
        let bits = y[i].to_bits().wrapping_sub(ROOT_HALF);
        let n = ((bits as i32) >> 23) as f32;
        let m = f32::from_bits((bits & 0x007f_ffff).wrapping_add(ROOT_HALF));
        let s = (m - 1.0) / (m + 1.0);
        let q = s * s;
        let series = 1.0 + q * (1.0 / 3.0 + q * (0.2 + q * (1.0 / 7.0 + q * (1.0 / 9.0))));
        out[i] = n * LN_2.0 + (n * LN_2.1 + 2.0 * s * series);
    }
    out
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

    #[test]
    fn agrees_with_the_exact_logarithm() {
        let mut worst = 0.0f64;
        for i in 0..2_000_000u32 {
            // Every magnitude, and the neighbourhood of one.
            for y in [f32::from_bits(0x0080_0000 + i * 1060), 1.0 + (i as f32 - 1e6) * 1e-7] {
                let exact = f64::from(y).ln();
                worst = worst.max((f64::from(ln([y])[0]) - exact).abs() / exact.abs().max(1.0));
            }
        }
        assert!(worst < 2e-7, "{worst}");
        assert_eq!(ln([1.0]), [0.0]);
    }
}

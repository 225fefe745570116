//! Comparison of images as plain slices: how far apart, and whether noise explains it.
//!
//! `rmse = sqrt(mean (x - r)^2)`, `relmse = mean (x - r)^2 / (r^2 + epsilon)` (the usual measure of rendering
//! error, which weighs dark and bright pixels alike). The z test takes the variance of each pixel's mean in
//! both images; it looks at the worst pixel, with Sidak's correction for their number, and at the mean over
//! all pixels, which finds a bias far below the noise of one pixel; [`accepted_share`] forgives a few pixels.
//! Guarded by `noise_passes_and_bias_does_not`.

use crate::math::stats::{sidak, z_test};
use crate::{Error, Result};

/// Root of the mean squared difference.
pub fn rmse(image: &[f32], reference: &[f32]) -> Result<f64> {
    let squared = |x: f64, r: f64| (x - r) * (x - r);
    Ok(mean_of_pairs(image, reference, squared)?.sqrt())
}

/// Mean of `(x - r)^2 / (r^2 + epsilon)`; 1e-2 is the customary `epsilon` for images of luminance near one.
pub fn relmse(image: &[f32], reference: &[f32], epsilon: f64) -> Result<f64> {
    mean_of_pairs(image, reference, |x, r| (x - r) * (x - r) / (r * r + epsilon))
}

/// Outcome of [`z_test_images`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageTest {
    /// z of the worst pixel, with sign.
    pub largest_z: f64,
    /// Its index.
    pub pixel: usize,
    /// Probability of so large a |z| somewhere in an image of this many pixels.
    pub p_largest: f64,
    /// z of the mean difference over all pixels.
    pub mean_z: f64,
    /// Its two-sided probability.
    pub p_mean: f64,
}

impl ImageTest {
    /// Does noise explain the differences? `significance` is shared by the two tests.
    pub fn passed(&self, significance: f64) -> bool {
        let level = sidak(significance, 2);
        self.p_largest >= level && self.p_mean >= level
    }
}

/// Are two noisy images of the same thing the same? `*_variance` is the variance of each pixel's mean; pixels
/// are supposed independent (filter importance sampling) and their means nearly normal. A reference without
/// noise has variance zero.
pub fn z_test_images(a: &[f32], a_variance: &[f32], b: &[f32], b_variance: &[f32]) -> Result<ImageTest> {
    for other in [a_variance, b, b_variance] {
        check_lengths(a, other)?;
    }
    let mut test = ImageTest { largest_z: 0.0, pixel: 0, p_largest: 1.0, mean_z: 0.0, p_mean: 1.0 };
    let (mut difference, mut variance, mut p_pixel) = (0.0, 0.0, 1.0);
    for i in 0..a.len() {
        let d = f64::from(a[i]) - f64::from(b[i]);
        let v = f64::from(a_variance[i]) + f64::from(b_variance[i]);
        let r = z_test(d, v);
        if r.statistic.is_nan() || v < 0.0 {
            return Err(Error::invalid(format!("pixel {i}"), format!("difference {d}, variance {v}")));
        }
        if r.statistic.abs() > test.largest_z.abs() {
            (test.largest_z, test.pixel, p_pixel) = (r.statistic, i, r.p_value);
        }
        difference += d;
        variance += v;
    }
    // 1 - (1 - p)^n without cancellation.
    test.p_largest = -(a.len() as f64 * (-p_pixel).ln_1p()).exp_m1();
    let mean = z_test(difference, variance);
    (test.mean_z, test.p_mean) = (mean.statistic, mean.p_value);
    Ok(test)
}

/// Share of the pixels whose difference noise explains, each tested at Sidak's level, so that in two right images
/// all of them pass with probability `1 - significance`. For images whose noise has longer tails than a normal
/// distribution's, which a few of many pixels show.
pub fn accepted_share(
    a: &[f32],
    a_variance: &[f32],
    b: &[f32],
    b_variance: &[f32],
    significance: f64,
) -> Result<f64> {
    for other in [a_variance, b, b_variance] {
        check_lengths(a, other)?;
    }
    let level = sidak(significance, a.len());
    let explained = |i: &usize| {
        let variance = f64::from(a_variance[*i]) + f64::from(b_variance[*i]);
        // NaN is not explained.
        z_test(f64::from(a[*i]) - f64::from(b[*i]), variance).p_value >= level
    };
    Ok((0..a.len()).filter(explained).count() as f64 / a.len() as f64)
}

fn mean_of_pairs(image: &[f32], reference: &[f32], f: impl Fn(f64, f64) -> f64) -> Result<f64> {
    check_lengths(image, reference)?;
    let sum: f64 = image.iter().zip(reference).map(|(&x, &r)| f(f64::from(x), f64::from(r))).sum();
    Ok(sum / image.len() as f64)
}

fn check_lengths(a: &[f32], b: &[f32]) -> Result<()> {
    if a.is_empty() || a.len() != b.len() {
        return Err(Error::invalid("image", format!("{} values against {}", a.len(), b.len())));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Sampler;
    use crate::math::stats::{Welford, normal_quantile};
    use glam::UVec2;

    /// 4096 pixels, each the mean of 64 normal numbers around its index' brightness, with its variance.
    fn noisy(seed: u64, gain: f32) -> (Vec<f32>, Vec<f32>) {
        (0..4096)
            .map(|i| {
                let truth = 0.2 + 0.001 * i as f32;
                let w: Welford = (0..64)
                    .map(|k| {
                        let u = Sampler::new(seed, UVec2::new(i, k), 0).next_1d();
                        f64::from(truth) * (1.0 + 0.3 * normal_quantile(f64::from(u) + 1e-9))
                    })
                    .collect();
                // The true variance, so that the test is exact.
                (w.mean() as f32 * gain, (0.3 * truth).powi(2) / 64.0)
            })
            .unzip()
    }

    #[test]
    fn noise_passes_and_bias_does_not() -> Result<()> {
        let ((a, va), (b, vb)) = (noisy(1, 1.0), noisy(2, 1.0));
        assert!(z_test_images(&a, &va, &b, &vb)?.passed(1e-3));
        // 0.5 % bias under 3.75 % noise per pixel: the mean finds it.
        let (c, vc) = noisy(2, 1.005);
        let t = z_test_images(&a, &va, &c, &vc)?;
        assert!(t.p_largest > 1e-3 && !t.passed(1e-3), "{t:?}");
        // One firefly.
        let mut d = b.clone();
        d[77] *= 1.5;
        assert_eq!(accepted_share(&b, &vb, &a, &va, 1e-3)?, 1.0);
        assert_eq!(accepted_share(&d, &vb, &a, &va, 1e-3)?, 1.0 - 1.0 / 4096.0);
        d[78] = f32::NAN;
        assert_eq!(accepted_share(&d, &vb, &a, &va, 1e-3)?, 1.0 - 2.0 / 4096.0);
        d[78] = b[78];
        let t = z_test_images(&d, &vb, &a, &va)?;
        assert!(t.pixel == 77 && t.largest_z > 6.0 && !t.passed(1e-3), "{t:?}");
        Ok(())
    }

    #[test]
    fn distances() -> Result<()> {
        assert_eq!(rmse(&[1.0, 2.0], &[1.0, 4.0])?, 2f64.sqrt());
        assert_eq!(relmse(&[1.0, 3.0], &[2.0, 0.0], 0.5)?, 0.5 * (1.0 / 4.5 + 9.0 / 0.5));
        assert!(rmse(&[1.0], &[]).is_err() && rmse(&[], &[]).is_err());
        Ok(())
    }
}

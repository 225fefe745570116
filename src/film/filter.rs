//! `Filter`: reconstruction filters, drawn from by importance sampling.
//!
//! A filter is `f(x) f(y)` with x, y the distance from the pixel centre over the radius, in [-1, 1]:
//!
//! | name              | f(x) up to a factor                                            | radius, pixels |
//! |-------------------|----------------------------------------------------------------|------|
//! | `box`             | 1                                                              | 0.5  |
//! | `tent`            | 1 - abs(x)                                                     | 1    |
//! | `gaussian`        | exp(-4.5 x^2) - exp(-4.5): the radius is 3 standard deviations | 1.5  |
//! | `mitchell`        | Mitchell and Netravali 1988 with B = C = 1/3                   | 2    |
//! | `blackman_harris` | the 4-term window (Harris 1978)                                | 1.5  |
//!
//! Offsets have density `abs(f) / integral abs(f)`, weights are `sign(f) integral abs(f) / integral f`, so that
//! a pixel's mean of weight times light estimates the filtered picture. Only `mitchell` has negative lobes; the
//! other weights are 1. Density is `f` itself for box and tent, its interpolation in 512 steps for the others.
//! Guarded by `offsets_follow_the_filter`, `weights_average_one`.

use std::sync::LazyLock;

use glam::Vec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::math::warp::uniform_to_tent;

/// Reconstruction filter, by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Filter {
    /// Constant over the pixel: sharp, with visible steps at edges.
    Box,
    /// Linear fall to the centres of the neighbours.
    Tent,
    /// Truncated normal distribution: soft.
    Gaussian,
    /// Cubic with negative lobes: crisp edges; bright points get dark rings.
    Mitchell,
    /// A smooth window without negative lobes: as sharp as a positive filter gets without steps.
    #[default]
    BlackmanHarris,
}

/// Where in the picture plane to sample, and how much it counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterSample {
    /// Offset from the pixel's centre, pixels.
    pub offset: Vec2,
    /// Factor for the sample's light; its mean is 1.
    pub weight: f32,
}

impl Filter {
    /// All filters.
    pub const ALL: [Self; 5] = [Self::Box, Self::Tent, Self::Gaussian, Self::Mitchell, Self::BlackmanHarris];

    /// Half width that the filter is designed for, pixels.
    pub fn default_radius_px(self) -> f32 {
        match self {
            Self::Box => 0.5,
            Self::Tent => 1.0,
            Self::Gaussian | Self::BlackmanHarris => 1.5,
            Self::Mitchell => 2.0,
        }
    }

    /// Draws an offset with the default radius.
    pub fn sample(self, u: Vec2) -> FilterSample {
        self.sample_radius(u, self.default_radius_px())
    }

    /// Draws an offset with another radius (pixels) than the default.
    pub fn sample_radius(self, u: Vec2, radius_px: f32) -> FilterSample {
        let (x, wx) = self.sample_axis(u.x);
        let (y, wy) = self.sample_axis(u.y);
        FilterSample { offset: Vec2::new(x, y) * radius_px, weight: wx * wy }
    }

    /// Value at x in units of the radius, up to a factor; zero outside [-1, 1].
    pub fn value(self, x: f32) -> f32 {
        let x = x.abs();
        if x > 1.0 {
            return 0.0;
        }
        match self {
            Self::Box => 1.0,
            Self::Tent => 1.0 - x,
            Self::Gaussian => (-4.5 * x * x).exp() - (-4.5f32).exp(),
            Self::Mitchell => {
                let x = 2.0 * x;
                if x < 1.0 {
                    (7.0 * x - 12.0) * x * x + 16.0 / 3.0
                } else {
                    ((-7.0 / 3.0 * x + 12.0) * x - 20.0) * x + 32.0 / 3.0
                }
            }
            Self::BlackmanHarris => {
                let a = std::f32::consts::PI * x;
                let sum =
                    0.358_75 + 0.488_29 * a.cos() + 0.141_28 * (2.0 * a).cos() + 0.011_68 * (3.0 * a).cos();
                sum.max(0.0)
            }
        }
    }

    /// Offset in units of the radius and weight, increasing in `u`.
    fn sample_axis(self, u: f32) -> (f32, f32) {
        static GAUSSIAN: LazyLock<Table> = LazyLock::new(|| Table::new(Filter::Gaussian));
        static MITCHELL: LazyLock<Table> = LazyLock::new(|| Table::new(Filter::Mitchell));
        static BLACKMAN_HARRIS: LazyLock<Table> = LazyLock::new(|| Table::new(Filter::BlackmanHarris));
        let table = match self {
            Self::Box => return (2.0 * u - 1.0, 1.0),
            Self::Tent => return (uniform_to_tent(u, 1.0), 1.0),
            Self::Gaussian => &GAUSSIAN,
            Self::Mitchell => &MITCHELL,
            Self::BlackmanHarris => &BLACKMAN_HARRIS,
        };
        let centred = 2.0 * u - 1.0;
        let x = table.invert(centred.abs());
        (x.copysign(centred), table.weight.copysign(self.value(x)))
    }
}

/// Steps of a table over [0, 1].
const STEPS: usize = 512;

/// The half x >= 0 of an even filter: its absolute value at the steps and the integral up to them.
struct Table {
    value: [f32; STEPS + 1],
    cdf: [f32; STEPS + 1],
    weight: f32,
}

impl Table {
    fn new(filter: Filter) -> Self {
        let signed = std::array::from_fn::<f32, { STEPS + 1 }, _>(|i| filter.value(i as f32 / STEPS as f32));
        let value = signed.map(f32::abs);
        let integral = |f: &[f32; STEPS + 1]| {
            let mut sum = 0.0;
            let mut cdf = [0.0; STEPS + 1];
            for i in 0..STEPS {
                sum += 0.5 * (f64::from(f[i]) + f64::from(f[i + 1]));
                cdf[i + 1] = sum;
            }
            cdf
        };
        let cdf = integral(&value);
        let total = cdf[STEPS];
        Self {
            // In units of probability per step, as `invert` needs it.
            value: value.map(|v| (f64::from(v) / total) as f32),
            cdf: cdf.map(|c| (c / total) as f32),
            weight: (total / integral(&signed)[STEPS]) as f32,
        }
    }

    /// x at which the share `u` of the filter lies below, for the linear interpolation of the values.
    fn invert(&self, u: f32) -> f32 {
        let step = self.cdf.partition_point(|&c| c <= u).clamp(1, STEPS) - 1;
        let (low, high) = (self.value[step], self.value[step + 1]);
        let rest = u - self.cdf[step];
        // low t + (high - low) t^2 / 2 = rest, in the form that does not cancel.
        let root = (low * low + 2.0 * (high - low) * rest).max(0.0).sqrt();
        let t = if low + root > 0.0 { (2.0 * rest / (low + root)).clamp(0.0, 1.0) } else { 0.0 };
        (step as f32 + t) / STEPS as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 400_000;

    fn axis(filter: Filter) -> impl Iterator<Item = (f32, f32)> {
        (0..N).map(move |i| filter.sample_axis((i as f32 + 0.5) / N as f32))
    }

    #[test]
    fn offsets_follow_the_filter() {
        for filter in Filter::ALL {
            const BINS: usize = 50;
            let mut seen = [0.0f64; BINS];
            for (x, _) in axis(filter) {
                assert!((-1.0..=1.0).contains(&x), "{filter:?}: {x}");
                seen[(((x + 1.0) / 2.0 * BINS as f32) as usize).min(BINS - 1)] += 1.0 / N as f64;
            }
            // Independent of the table: midpoint rule on the definition.
            let fine = |i: usize| f64::from(filter.value((i as f32 + 0.5) / 5000.0 - 1.0).abs());
            let total: f64 = (0..10_000).map(fine).sum();
            for (bin, &seen) in seen.iter().enumerate() {
                let expected = (bin * 200..(bin + 1) * 200).map(fine).sum::<f64>() / total;
                assert!((seen - expected).abs() < 2e-5, "{filter:?} bin {bin}: {seen} {expected}");
            }
        }
    }

    #[test]
    fn weights_average_one() {
        for filter in Filter::ALL {
            let (mut weight, mut offset, mut second) = (0.0f64, 0.0f64, 0.0f64);
            for (x, w) in axis(filter) {
                weight += f64::from(w) / N as f64;
                offset += f64::from(w * x) / N as f64;
                second += f64::from(w * x * x) / N as f64;
            }
            assert!((weight - 1.0).abs() < 1e-4, "{filter:?}: mean weight {weight}");
            assert!(offset.abs() < 1e-5, "{filter:?}: mean offset {offset}");
            let moment = |k: i32| -> f64 {
                (0..10_000)
                    .map(|i| (i as f32 + 0.5) / 5000.0 - 1.0)
                    .map(|x| f64::from(filter.value(x) * x.powi(k)))
                    .sum()
            };
            let expected = moment(2) / moment(0);
            assert!((second - expected).abs() < 1e-4, "{filter:?}: second moment {second} {expected}");
        }
    }

    #[test]
    fn mitchell_is_the_published_cubic() {
        // With B = C = 1/3, times 6: k(0) = 16/3, k(1) = 1/3, k(2) = 0, and negative between 1 and 2.
        let k = |x: f32| Filter::Mitchell.value(x / 2.0);
        assert!((k(0.0) - 16.0 / 3.0).abs() < 1e-5 && (k(1.0) - 1.0 / 3.0).abs() < 1e-5);
        assert!(k(2.0).abs() < 1e-5 && k(1.5) < -0.1);
        assert!((k(1.0 - 1e-4) - k(1.0 + 1e-4)).abs() < 1e-3);
        // Shifted copies sum to one: a constant stays constant.
        for x in [0.0, 0.2, 0.5, 0.9] {
            let sum: f32 = (-2..=2).map(|i| k(x + i as f32)).sum();
            assert!((sum / 6.0 - 1.0).abs() < 1e-5, "{x}: {sum}");
        }
        assert!(axis(Filter::Mitchell).any(|(_, w)| w < 0.0));
    }

    #[test]
    fn scaled_by_the_radius() {
        for filter in Filter::ALL {
            let r = filter.default_radius_px();
            let s = filter.sample(Vec2::new(0.999_999_9, 0.0));
            assert!((s.offset - Vec2::new(r, -r)).abs().max_element() < 0.05 * r, "{filter:?}: {s:?}");
            let half = filter.sample_radius(Vec2::new(0.7, 0.4), r / 2.0);
            assert!((half.offset * 2.0 - filter.sample(Vec2::new(0.7, 0.4)).offset).length() < 1e-6);
            assert_eq!(filter.sample(Vec2::splat(0.5)).offset.length(), 0.0, "{filter:?}");
        }
    }

    #[test]
    fn names_are_snake_case() {
        let names: Vec<_> = Filter::ALL.iter().map(|f| serde_json::to_value(f).unwrap()).collect();
        assert_eq!(names, ["box", "tent", "gaussian", "mitchell", "blackman_harris"]);
    }
}

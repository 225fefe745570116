//! The eye's filters of FLIP ([Andersson2020](https://doi.org/10.1145/3406183)), as products of filters along rows and along columns.
//!
//! Contrast sensitivity, from its transform, a sum of Gaussians of the distance in degrees; `p` pixels per degree:
//! ```text
//! g(x, y) = sum_i a_i sqrt(pi / b_i) exp(-pi^2 (x^2 + y^2) / b_i),   sum over the window = 1
//! ```
//! with (a, b) = (1, 0.0047) for lightness, (1, 0.0053) for red-green, (34.1, 0.04) and (13.5, 0.025) for
//! blue-yellow; the window reaches three standard deviations of the widest. Features: derivatives of a Gaussian of
//! half of 0.082 deg, `-x G` and `(x^2 / s^2 - 1) G`, whose positive values sum to 1 and the negative ones to -1.
//! All are products of a function of x and one of y, or sums of two such products. Guarded by
//! `filters_keep_grey_and_answer_to_steps`.

use std::f64::consts::PI;

/// Rows of one channel.
#[derive(Clone, Debug)]
pub(super) struct Plane {
    pub(super) width: usize,
    pub(super) data: Vec<f32>,
}

impl Plane {
    pub(super) fn new(width: usize) -> Self {
        Self { width, data: Vec::new() }
    }
}

/// All filters for a number of pixels per degree.
pub(super) struct Filters {
    /// Rows that they reach beyond their own.
    pub(super) halo: usize,
    lightness: Vec<f32>,
    red_green: Vec<f32>,
    /// Two, with the share of each.
    blue_yellow: [(Vec<f32>, f32); 2],
    gauss: Vec<f32>,
    first: Vec<f32>,
    second: Vec<f32>,
}

/// Coefficient a and width b (deg^2) of a Gaussian of the contrast sensitivity.
const LIGHTNESS_B: f64 = 0.0047;
const RED_GREEN_B: f64 = 0.0053;
const BLUE_YELLOW: [(f64, f64); 2] = [(34.1, 0.04), (13.5, 0.025)];
/// Width of a feature, degrees.
const FEATURE_DEG: f64 = 0.082;

impl Filters {
    pub(super) fn new(pixels_per_degree: f64) -> Self {
        let widest = BLUE_YELLOW[0].1;
        let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as usize;
        // Not normalised, with its sum.
        let window = |b: f64| {
            let taps = offsets(radius).map(|x| (-PI * PI * (x / pixels_per_degree).powi(2) / b).exp());
            let taps: Vec<f64> = taps.collect();
            let sum: f64 = taps.iter().sum();
            (taps, sum)
        };
        let unit = |b: f64| {
            let (taps, sum) = window(b);
            taps.into_iter().map(|v| (v / sum) as f32).collect::<Vec<f32>>()
        };
        // Each Gaussian's share of the window's sum; a two-dimensional sum is the square of a row's.
        let weight = BLUE_YELLOW.map(|(a, b)| a * (PI / b).sqrt() * window(b).1.powi(2));
        let share = |i: usize| (weight[i] / (weight[0] + weight[1])) as f32;
        let deviation = 0.5 * FEATURE_DEG * pixels_per_degree;
        let reach = (3.0 * deviation).ceil() as usize;
        let gauss = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
        Self {
            halo: radius.max(reach),
            lightness: unit(LIGHTNESS_B),
            red_green: unit(RED_GREEN_B),
            blue_yellow: [(unit(BLUE_YELLOW[0].1), share(0)), (unit(BLUE_YELLOW[1].1), share(1))],
            gauss: balanced(offsets(reach).map(gauss)),
            first: balanced(offsets(reach).map(|x| -x * gauss(x))),
            second: balanced(offsets(reach).map(|x| ((x / deviation).powi(2) - 1.0) * gauss(x))),
        }
    }

    pub(super) fn achromatic(&self, y: &Plane, rows: usize) -> Plane {
        self.apply(y, &self.lightness, &self.lightness, rows)
    }

    pub(super) fn red_green(&self, cx: &Plane, rows: usize) -> Plane {
        self.apply(cx, &self.red_green, &self.red_green, rows)
    }

    pub(super) fn blue_yellow(&self, cz: &Plane, rows: usize) -> Plane {
        let [(wide, wide_share), (narrow, narrow_share)] = &self.blue_yellow;
        let mut sum = self.apply(cz, wide, wide, rows);
        let narrow = self.apply(cz, narrow, narrow, rows);
        for (a, b) in sum.data.iter_mut().zip(&narrow.data) {
            *a = *a * wide_share + b * narrow_share;
        }
        sum
    }

    /// Lengths of the first (edges) and of the second derivatives (points) of the lightness of `y`.
    pub(super) fn features(&self, y: &Plane, rows: usize) -> (Vec<f32>, Vec<f32>) {
        let mut lightness = y.clone();
        lightness.data.iter_mut().for_each(|v| *v = (*v + 16.0) / 116.0);
        let blurred = along_rows(&lightness, &self.gauss);
        let length = |derivative: &[f32]| {
            let across = self.along_columns(&along_rows(&lightness, derivative), &self.gauss, rows);
            let down = self.along_columns(&blurred, derivative, rows);
            across.data.iter().zip(&down.data).map(|(a, b)| (a * a + b * b).sqrt()).collect()
        };
        (length(&self.first), length(&self.second))
    }

    fn apply(&self, plane: &Plane, across: &[f32], down: &[f32], rows: usize) -> Plane {
        self.along_columns(&along_rows(plane, across), down, rows)
    }

    /// The `rows` rows that have a halo on both sides.
    fn along_columns(&self, plane: &Plane, taps: &[f32], rows: usize) -> Plane {
        let width = plane.width;
        let mut out = vec![0.0; rows * width];
        let start = self.halo - taps.len() / 2;
        for (row, out) in out.chunks_mut(width).enumerate() {
            for (k, tap) in taps.iter().enumerate() {
                let from = (start + row + k) * width;
                add_scaled(out, &plane.data[from..from + width], *tap);
            }
        }
        Plane { width, data: out }
    }
}

/// Every row; its ends repeat.
fn along_rows(plane: &Plane, taps: &[f32]) -> Plane {
    let (width, radius) = (plane.width, taps.len() / 2);
    let mut out = vec![0.0; plane.data.len()];
    let mut padded = vec![0.0; width + 2 * radius];
    for (row, out) in plane.data.chunks(width).zip(out.chunks_mut(width)) {
        padded[..radius].fill(row[0]);
        padded[radius..radius + width].copy_from_slice(row);
        padded[radius + width..].fill(row[width - 1]);
        for (k, tap) in taps.iter().enumerate() {
            add_scaled(out, &padded[k..k + width], *tap);
        }
    }
    Plane { width, data: out }
}

fn add_scaled(out: &mut [f32], values: &[f32], factor: f32) {
    for (o, v) in out.iter_mut().zip(values) {
        *o += factor * v;
    }
}

fn offsets(radius: usize) -> impl Iterator<Item = f64> {
    (0..=2 * radius).map(move |i| i as f64 - radius as f64)
}

/// Positive values sum to 1, negative ones to -1.
fn balanced(taps: impl Iterator<Item = f64>) -> Vec<f32> {
    let taps: Vec<f64> = taps.collect();
    let positive: f64 = taps.iter().filter(|v| **v > 0.0).sum();
    let negative: f64 = -taps.iter().filter(|v| **v < 0.0).sum::<f64>();
    taps.iter()
        .map(|&v| (v / if v > 0.0 { positive } else { negative.max(f64::MIN_POSITIVE) }) as f32)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filters_keep_grey_and_answer_to_steps() {
        for pixels_per_degree in [1.0, 5.0, 67.0, 300.0] {
            let f = Filters::new(pixels_per_degree);
            let rows = 3;
            let plane = |value: &dyn Fn(usize) -> f32| {
                let width = 4 * f.halo + 2;
                let data = (0..(rows + 2 * f.halo) * width).map(|i| value(i % width)).collect();
                Plane { width, data }
            };
            let grey = plane(&|_| 0.25);
            for filtered in [f.achromatic(&grey, rows), f.red_green(&grey, rows), f.blue_yellow(&grey, rows)]
            {
                assert!(filtered.data.iter().all(|v| (v - 0.25).abs() < 1e-6), "{pixels_per_degree}");
            }
            let (edges, points) = f.features(&grey, rows);
            assert!(edges.iter().chain(&points).all(|v| v.abs() < 1e-6), "{pixels_per_degree}");
            // A step from black (-16) to white (100): the derivative's positive half is on one side.
            let middle = 2 * f.halo + 1;
            let step = plane(&|x| if x < middle { -16.0 } else { 100.0 });
            let (edges, _) = f.features(&step, rows);
            let largest = edges.iter().copied().fold(0.0, f32::max);
            assert!((0.9..=1.0 + 1e-5).contains(&largest), "{pixels_per_degree}: {largest}");
            let mean = f.achromatic(&step, rows).data.iter().sum::<f32>() / (rows * step.width) as f32;
            assert!((mean - 42.0).abs() < 1e-3, "{pixels_per_degree}: {mean}");
        }
    }
}

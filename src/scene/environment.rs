//! An image of the surroundings, and choosing directions in proportion to its light.
//!
//! Model: equirectangular, +z up. Row v in [0, 1] runs from the zenith down, `theta = pi v`; column u in
//! [0, 1] runs to the right as seen from inside, `azimuth = rotation + 2 pi (1/2 - u)`. Values are linear
//! sRGB, bilinear between the pixels' middles, around the seam and clamped at the poles.
//!
//! Sampling: a pixel with probability proportional to its mean luminance (of the bilinear function, so that
//! the light of its neighbours counts) times its exact solid angle
//! `2 pi / width (cos theta_0 - cos theta_1)`, then uniform in solid angle within the pixel. The density is
//! read from the same rounded table that sampling searches, so both agree to the last digit of f32.
//! Guarded by `density_integrates_to_one`, `samples_follow_the_density`.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use crate::spectrum::color::luminance;
use crate::{Error, Result};

/// An equirectangular image with the tables for sampling it.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    width: usize,
    height: usize,
    pixels: Vec<[f32; 3]>,
    rotation: f32,
    /// Per row `width + 1` values from 0 to 1.
    columns: Vec<f32>,
    /// `height + 1` values from 0 to 1.
    rows: Vec<f32>,
    mean_luminance: f32,
}

impl Environment {
    /// From rows of linear sRGB, top first. `rotation` (radians) is the azimuth of the middle column.
    pub fn new(width: usize, height: usize, pixels: Vec<[f32; 3]>, rotation: f32) -> Result<Self> {
        let bad = |what: String| Err(Error::invalid("file", what));
        if width != 2 * height || height == 0 {
            return bad(format!(
                "the image is {width} x {height}; an equirectangular one is twice as wide as high"
            ));
        }
        if pixels.len() != width * height {
            return bad(format!("{} pixels for {width} x {height}", pixels.len()));
        }
        if let Some(i) = pixels.iter().position(|p| p.iter().any(|v| !v.is_finite() || *v < 0.0)) {
            return bad(format!(
                "pixel {}, {} is negative or not a finite number: {:?}",
                i % width,
                i / width,
                pixels[i]
            ));
        }
        let mut env = Self {
            width,
            height,
            pixels,
            rotation,
            columns: Vec::with_capacity((width + 1) * height),
            rows: vec![0.0],
            mean_luminance: 0.0,
        };
        let mut row_sums = Vec::with_capacity(height);
        for y in 0..height {
            let weights: Vec<f64> = (0..width).map(|x| env.smoothed_luminance(x, y)).collect();
            let mut cumulative = Vec::new();
            let sum = accumulate(&weights, &mut cumulative);
            env.columns.extend(cumulative);
            row_sums.push(sum * f64::from(env.row_solid_angle(y)) / width as f64);
        }
        let mut rows = Vec::new();
        let total = accumulate(&row_sums, &mut rows);
        if total <= 0.0 {
            return bad("the image is black".to_owned());
        }
        env.rows = rows;
        env.mean_luminance = (total / (4.0 * std::f64::consts::PI)) as f32;
        Ok(env)
    }

    /// Mean luminance over all directions.
    pub fn mean_luminance(&self) -> f32 {
        self.mean_luminance
    }

    /// Linear sRGB radiance integrated over all directions.
    pub fn integral(&self) -> [f32; 3] {
        let mut sum = [0.0f64; 3];
        for y in 0..self.height {
            let (top, bottom) = self.row_cosines(y);
            let share = f64::from(TAU) * f64::from(top - bottom) / self.width as f64;
            for pixel in &self.pixels[y * self.width..(y + 1) * self.width] {
                for (s, v) in sum.iter_mut().zip(pixel) {
                    *s += share * f64::from(*v);
                }
            }
        }
        sum.map(|s| s as f32)
    }

    /// Linear sRGB radiance from a unit direction (towards the surroundings).
    pub fn rgb(&self, direction: Vec3) -> Vec3 {
        let uv = self.uv(direction);
        let x = uv.x * self.width as f32 - 0.5;
        let y = (uv.y * self.height as f32 - 0.5).clamp(0.0, (self.height - 1) as f32);
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let column = |i: f32| (i as isize).rem_euclid(self.width as isize) as usize;
        let y0 = y0 as usize;
        let y1 = (y0 + 1).min(self.height - 1);
        let at = |x: f32, y: usize| Vec3::from(self.pixels[y * self.width + column(x)]);
        at(x0, y0).lerp(at(x0 + 1.0, y0), fx).lerp(at(x0, y1).lerp(at(x0 + 1.0, y1), fx), fy)
    }

    /// A direction in proportion to the light, with its density, 1/sr.
    pub fn sample(&self, u: Vec2) -> Option<(Vec3, f32)> {
        let (y, v) = search(&self.rows, u.y);
        let row = self.row(y);
        let (x, s) = search(row, u.x);
        let (top, bottom) = self.row_cosines(y);
        let cos = top + (bottom - top) * v;
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let azimuth = self.rotation + TAU * (0.5 - (x as f32 + s) / self.width as f32);
        let pdf = self.pixel_pdf(x, y);
        (pdf > 0.0).then(|| ((Vec2::from_angle(azimuth) * sin).extend(cos), pdf))
    }

    /// Density of [`Environment::sample`] for a unit direction, 1/sr.
    pub fn pdf(&self, direction: Vec3) -> f32 {
        let uv = self.uv(direction);
        let x = ((uv.x * self.width as f32) as usize).min(self.width - 1);
        let mut y = ((uv.y * self.height as f32) as usize).min(self.height - 1);
        // acos rounds; the cosine decides, as in sampling.
        while y > 0 && direction.z > self.row_cosines(y).0 {
            y -= 1;
        }
        while y + 1 < self.height && direction.z < self.row_cosines(y).1 {
            y += 1;
        }
        self.pixel_pdf(x, y)
    }

    fn pixel_pdf(&self, x: usize, y: usize) -> f32 {
        let row = self.row(y);
        let p = (self.rows[y + 1] - self.rows[y]) * (row[x + 1] - row[x]);
        p * self.width as f32 / self.row_solid_angle(y)
    }

    fn row(&self, y: usize) -> &[f32] {
        &self.columns[y * (self.width + 1)..(y + 1) * (self.width + 1)]
    }

    /// cos(theta) at the upper and the lower edge of a row.
    fn row_cosines(&self, y: usize) -> (f32, f32) {
        let cos = |edge: usize| (PI * (edge as f32 / self.height as f32)).cos();
        (cos(y), cos(y + 1))
    }

    fn row_solid_angle(&self, y: usize) -> f32 {
        let (top, bottom) = self.row_cosines(y);
        TAU * (top - bottom)
    }

    fn uv(&self, direction: Vec3) -> Vec2 {
        let azimuth = direction.y.atan2(direction.x);
        let u = (0.5 - (azimuth - self.rotation) / TAU).rem_euclid(1.0);
        Vec2::new(u, direction.z.clamp(-1.0, 1.0).acos() / PI)
    }

    /// Mean luminance of the bilinear function over a pixel: weights 1/8, 6/8, 1/8 along each axis.
    fn smoothed_luminance(&self, x: usize, y: usize) -> f64 {
        const WEIGHTS: [f64; 3] = [0.125, 0.75, 0.125];
        let mut sum = 0.0;
        for (j, wy) in WEIGHTS.iter().enumerate() {
            let row = (y + j).saturating_sub(1).min(self.height - 1);
            for (i, wx) in WEIGHTS.iter().enumerate() {
                let column = (x + i + self.width - 1) % self.width;
                sum += wx * wy * f64::from(luminance(self.pixels[row * self.width + column]));
            }
        }
        sum
    }
}

/// Cumulative distribution from 0 to 1, `n + 1` values; all alike when there is no weight. Returns the sum of the
/// weights. A weight far below the mean counts a little more than its share: beside the sun, f32 would round its
/// interval to nothing, and what only light sampling finds would never be lit by it.
fn accumulate(weights: &[f64], out: &mut Vec<f32>) -> f64 {
    let light: f64 = weights.iter().sum();
    let least = 1e-2 * light / weights.len() as f64;
    let raised = |w: f64| if w > 0.0 { w.max(least) } else { 0.0 };
    let total: f64 = weights.iter().copied().map(raised).sum();
    out.push(0.0);
    let mut sum = 0.0;
    for (i, &w) in weights.iter().enumerate() {
        sum += raised(w);
        let share = if total > 0.0 { sum / total } else { (i + 1) as f64 / weights.len() as f64 };
        out.push(if i + 1 == weights.len() { 1.0 } else { share as f32 });
    }
    light
}

/// Interval of a cumulative distribution that holds `u`, and the place in it, in [0, 1].
pub(super) fn search(cumulative: &[f32], u: f32) -> (usize, f32) {
    let n = cumulative.len() - 1;
    // The last interval that begins at or before u; u < 1, so it has a width.
    let i = cumulative.partition_point(|&c| c <= u).saturating_sub(1).min(n - 1);
    let (low, high) = (cumulative[i], cumulative[i + 1]);
    (i, if high > low { ((u - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Sampler, warp};
    use glam::UVec2;

    /// A soft gradient, one very bright pixel, a black patch.
    fn image() -> Environment {
        let (w, h) = (32, 16);
        let mut pixels: Vec<[f32; 3]> =
            (0..w * h).map(|i| [0.2 + (i % w) as f32 / 40.0, 0.3, (i / w) as f32 / 16.0]).collect();
        pixels[5 * w + 20] = [60.0, 50.0, 40.0];
        for y in 8..12 {
            for x in 2..9 {
                pixels[y * w + x] = [0.0; 3];
            }
        }
        Environment::new(w, h, pixels, 0.4).unwrap()
    }

    #[test]
    fn middle_column_faces_the_rotation() {
        let (w, h) = (64, 32);
        let pixels = (0..w * h).map(|i| [(i % w) as f32, (i / w) as f32, 0.0]).collect();
        let env = Environment::new(w, h, pixels, 0.0).unwrap();
        let middle = env.rgb(Vec3::X);
        assert!((middle.x - 31.5).abs() < 1e-3 && (middle.y - 15.5).abs() < 1e-3, "{middle}");
        // From inside, looking along +x with z up, +y is to the left and the zenith at the top.
        assert!(env.rgb(Vec3::new(1.0, 0.3, 0.0).normalize()).x < 31.0);
        assert!(env.rgb(Vec3::new(1.0, 0.0, 0.3).normalize()).y < 15.0);
        assert_eq!(env.rgb(Vec3::Z).y, 0.0);
    }

    #[test]
    fn density_integrates_to_one() {
        let env = image();
        // Two samples per column; many per row, whose edges fall between the samples.
        let (rows, columns) = (16384, 64);
        let mut sum = 0.0;
        for i in 0..rows {
            for j in 0..columns {
                let u = Vec2::new((i as f32 + 0.5) / rows as f32, (j as f32 + 0.5) / columns as f32);
                sum += f64::from(env.pdf(warp::square_to_sphere(u)) / warp::SPHERE_PDF);
            }
        }
        let mean = sum / f64::from(rows * columns);
        assert!((mean - 1.0).abs() < 1e-3, "{mean}");
    }

    #[test]
    fn samples_follow_the_density() {
        let env = image();
        let n = 200_000u32;
        let (nz, na) = (8, 8);
        let cell = |w: Vec3| {
            let u = warp::sphere_to_square(w);
            ((u.x * nz as f32) as usize).min(nz - 1) * na + ((u.y * na as f32) as usize).min(na - 1)
        };
        let mut seen = vec![0.0f64; nz * na];
        for i in 0..n {
            let mut s = Sampler::new(i.into(), UVec2::new(7, 7), 0);
            let (w, pdf) = env.sample(s.next_2d()).unwrap();
            assert!((w.length() - 1.0).abs() < 1e-5);
            assert!((env.pdf(w) / pdf - 1.0).abs() < 1e-3 || on_an_edge(&env, w), "{w}");
            seen[cell(w)] += 1.0;
        }
        let mut expected = vec![0.0f64; nz * na];
        let m = 800;
        for i in 0..m * m {
            let u = Vec2::new(((i % m) as f32 + 0.5) / m as f32, ((i / m) as f32 + 0.5) / m as f32);
            let w = warp::square_to_sphere(u);
            expected[cell(w)] += f64::from(env.pdf(w) / warp::SPHERE_PDF) * f64::from(n) / f64::from(m * m);
        }
        let chi2: f64 = seen.iter().zip(&expected).map(|(s, e)| (s - e) * (s - e) / e).sum();
        // 63 degrees of freedom: 99.9 % of the time below 103.4 (and the expectation is itself a sum).
        assert!(chi2 < 110.0, "{chi2}");
    }

    fn on_an_edge(env: &Environment, w: Vec3) -> bool {
        let uv = env.uv(w) * Vec2::new(env.width as f32, env.height as f32);
        (uv - uv.round()).abs().min_element() < 1e-3
    }

    #[test]
    fn estimates_the_irradiance() {
        let env = image();
        let n = 400;
        let (mut by_light, mut by_sphere) = (0.0f64, 0.0f64);
        for i in 0..n * n {
            let u = Vec2::new(((i % n) as f32 + 0.5) / n as f32, ((i / n) as f32 + 0.5) / n as f32);
            let e = |w: Vec3, pdf: f32| f64::from(env.rgb(w).y * w.z.max(0.0) / pdf);
            let (w, pdf) = env.sample(u).unwrap();
            by_light += e(w, pdf);
            by_sphere += e(warp::square_to_sphere(u), warp::SPHERE_PDF);
        }
        assert!((by_light / by_sphere - 1.0).abs() < 3e-3, "{by_light} {by_sphere}");
    }

    #[test]
    fn the_sun_does_not_hide_the_sky() {
        // 1e9 times as bright as the sky: the sky's pixels in its row and the other rows keep a density.
        let (w, h) = (1024, 512);
        let mut pixels = vec![[1.0; 3]; w * h];
        pixels[100 * w + 300] = [1e9; 3];
        let env = Environment::new(w, h, pixels, 0.0).unwrap();
        for i in 0..10_000 {
            let mut s = Sampler::new(4, UVec2::ZERO, i);
            let direction = warp::square_to_sphere(s.next_2d());
            assert!(env.pdf(direction) > 0.0, "{direction}");
        }
        for x in 0..w {
            assert!(env.pixel_pdf(x, 100) > 0.0, "{x}");
        }
    }

    #[test]
    fn refuses_wrong_images() {
        let message = |w, h, p: Vec<[f32; 3]>| Environment::new(w, h, p, 0.0).unwrap_err().to_string();
        assert!(message(4, 4, vec![[1.0; 3]; 16]).contains("4 x 4"));
        assert!(message(4, 2, vec![[0.0; 3]; 8]).contains("black"));
        let mut p = vec![[1.0; 3]; 8];
        p[5][1] = f32::NAN;
        assert!(message(4, 2, p).contains("pixel 1, 1"));
    }
}

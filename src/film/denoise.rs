//! A film without its noise, by a filter that knows the noise.
//!
//! Model: non-local means over the light per albedo, `u = light / (albedo + e)`. A pixel becomes the mean of the pixels q of a
//! window whose surroundings look like its own, and whose normals and albedo do:
//!
//! ```text
//! d2(p, q) = mean over patch and channels of ((u_p - u_q)^2 - (v_p + min(v_p, v_q))) / (1e-10 + k^2 (v_p + v_q))
//! g2(p, q) = max over channels of (guide_p - guide_q)^2 / s^2
//! w(p, q) = min(exp(-max(0, d2)), exp(-g2_normal), exp(-g2_albedo)),        light_p = (albedo_p + e) sum w u_q / sum w
//! ```
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | u, v | light per albedo, variance of its mean (of the film, smoothed over 3 x 3 pixels) | radiance, its square | |
//! | k | `STRENGTH` | 1 | 0.6 |
//! | window, patch | `WINDOW_PX`, `PATCH_PX` | half widths, pixels | 7, 1 |
//! | s | `NORMAL`, `ALBEDO` | 1 | 0.1, 0.04 |
//!
//! Subtracting what the noise alone would give makes like pixels alike however noisy they are. What has no noise stays as it is.
//! Limits: noise that few samples have not met yet is not in their variance, so single bright samples ("fireflies") survive;
//! light that changes without a guide and within the noise, such as a soft shadow, is blurred a little. Needs at least 2 samples per
//! pixel: with fewer there is no variance and the film is returned as it is. Guarded by `noise_falls_and_edges_stay`,
//! `what_has_no_noise_stays`, `bytes_do_not_depend_on_threads`.
//! Source: F. Rousselle, C. Knaus, M. Zwicker, Adaptive rendering with non-local means filtering, ACM Trans. Graph. 31(6), 2012; with
//! guides F. Rousselle, M. Manzi, M. Zwicker, Robust denoising using feature and color information, Pacific Graphics 2013.

use rayon::prelude::*;

use super::film::{Film, Pixel};

/// Half width of the window that pixels are taken from.
const WINDOW_PX: usize = 7;
/// Half width of the patches that are compared.
const PATCH_PX: usize = 1;
/// How much of the noise a difference may be.
const STRENGTH: f32 = 0.6;
/// Difference of normals that counts as another surface.
const NORMAL: f32 = 0.1;
/// Difference of albedo that counts as another surface.
const ALBEDO: f32 = 0.04;
/// Added to the albedo before light is divided by it.
const DARK: f32 = 0.02;

/// What a denoiser knows of a picture, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Noisy {
    width: usize,
    height: usize,
    light: Vec<[f32; 3]>,
    variance: Vec<[f32; 3]>,
    albedo: Vec<[f32; 3]>,
    normal: Vec<[f32; 3]>,
}

impl Noisy {
    /// Of a film.
    pub fn new(film: &Film) -> Self {
        let pixels = film.pixels();
        let layer = |get: fn(&Pixel) -> [f32; 3]| pixels.iter().map(get).collect();
        Self {
            width: film.width() as usize,
            height: film.height() as usize,
            light: layer(Pixel::beauty),
            variance: layer(Pixel::variance),
            // The filter's weights may be negative at an edge.
            albedo: layer(|p| p.albedo().map(|v| v.clamp(0.0, 1.0))),
            normal: layer(|p| p.normal().to_array().map(|v| v.clamp(-1.0, 1.0))),
        }
    }

    /// Columns and rows.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// All light, linear sRGB.
    pub fn light(&self) -> &[[f32; 3]] {
        &self.light
    }

    /// Reflectance and transmittance of the first surface, linear sRGB, 0 to 1.
    pub fn albedo(&self) -> &[[f32; 3]] {
        &self.albedo
    }

    /// Normal of the first surface, world; shorter than 1 at edges.
    pub fn normal(&self) -> &[[f32; 3]] {
        &self.normal
    }
}

/// The light without noise, row by row, linear sRGB.
pub fn denoise(noisy: &Noisy) -> Vec<[f32; 3]> {
    let (width, height) = noisy.size();
    if noisy.variance.iter().flatten().all(|v| *v == 0.0) {
        return noisy.light.clone();
    }
    let divisor: Vec<[f32; 3]> = noisy.albedo.iter().map(|a| a.map(|a| a + DARK)).collect();
    let zip = |a: &[[f32; 3]], f: fn(f32, f32) -> f32| -> Vec<[f32; 3]> {
        a.iter().zip(&divisor).map(|(a, d)| [0, 1, 2].map(|c| f(a[c], d[c]))).collect()
    };
    let u = zip(&noisy.light, |light, d| light / d);
    let v = smoothed(&zip(&noisy.variance, |variance, d| variance / (d * d)), width, height);
    let filter = Filter { noisy, u, v };
    let mut out = vec![[0.0; 3]; width * height];
    out.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.iter_mut().enumerate() {
            let d = divisor[y * width + x];
            let mean = filter.pixel(x, y);
            *pixel = [0, 1, 2].map(|c| mean[c] * d[c]);
        }
    });
    out
}

struct Filter<'a> {
    noisy: &'a Noisy,
    u: Vec<[f32; 3]>,
    v: Vec<[f32; 3]>,
}

impl Filter<'_> {
    fn pixel(&self, x: usize, y: usize) -> [f32; 3] {
        let (width, height) = self.noisy.size();
        let p = y * width + x;
        let (mut sum, mut weights) = ([0.0f32; 3], 0.0f32);
        for qy in y.saturating_sub(WINDOW_PX)..(y + WINDOW_PX + 1).min(height) {
            for qx in x.saturating_sub(WINDOW_PX)..(x + WINDOW_PX + 1).min(width) {
                let q = qy * width + qx;
                let guides = self.guides(p, q);
                // The patch is the dear part; below this a pixel does not count.
                if guides < 1e-3 {
                    continue;
                }
                let w = guides.min((-self.patch((x, y), (qx, qy)).max(0.0)).exp());
                weights += w;
                for (s, u) in sum.iter_mut().zip(self.u[q]) {
                    *s += w * u;
                }
            }
        }
        // The pixel itself has weight one.
        sum.map(|s| s / weights)
    }

    fn guides(&self, p: usize, q: usize) -> f32 {
        let distance = |guide: &[[f32; 3]], scale: f32| {
            let most = (0..3).map(|c| (guide[p][c] - guide[q][c]).abs()).fold(0.0, f32::max) / scale;
            most * most
        };
        (-distance(&self.noisy.normal, NORMAL).max(distance(&self.noisy.albedo, ALBEDO))).exp()
    }

    /// Mean over the patches, of the parts that lie in the picture for both.
    fn patch(&self, (px, py): (usize, usize), (qx, qy): (usize, usize)) -> f32 {
        let (width, height) = self.noisy.size();
        let range = |p: usize, q: usize, size: usize| {
            let low = PATCH_PX.min(p).min(q);
            let high = PATCH_PX.min(size - 1 - p).min(size - 1 - q);
            (low, low + high + 1)
        };
        let ((left, columns), (up, rows)) = (range(px, qx, width), range(py, qy, height));
        let mut sum = 0.0;
        for row in 0..rows {
            let first_p = (py - up + row) * width + px - left;
            let first_q = (qy - up + row) * width + qx - left;
            for column in 0..columns {
                let (a, b) = (first_p + column, first_q + column);
                for c in 0..3 {
                    let (va, vb) = (self.v[a][c], self.v[b][c]);
                    let difference = self.u[a][c] - self.u[b][c];
                    sum += (difference * difference - (va + va.min(vb)))
                        / (1e-10 + STRENGTH * STRENGTH * (va + vb));
                }
            }
        }
        sum / (3 * rows * columns) as f32
    }
}

/// Mean over 3 x 3 pixels, fewer at the border: the variance of few samples is noisy itself.
fn smoothed(values: &[[f32; 3]], width: usize, height: usize) -> Vec<[f32; 3]> {
    let mut out = Vec::with_capacity(values.len());
    for y in 0..height {
        for x in 0..width {
            let (mut sum, mut count) = ([0.0f32; 3], 0.0f32);
            for row in y.saturating_sub(1)..(y + 2).min(height) {
                for v in &values[row * width + x.saturating_sub(1)..row * width + (x + 2).min(width)] {
                    count += 1.0;
                    for (s, v) in sum.iter_mut().zip(v) {
                        *s += v;
                    }
                }
            }
            out.push(sum.map(|s| s / count));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use glam::{UVec2, Vec3};

    use super::*;
    use crate::film::{FilmSample, PixelRect};
    use crate::math::Stream;

    /// Two surfaces side by side, with a shadow across both; 16 samples of noise in proportion to the light. And the truth.
    fn film(noise: f32) -> (Film, Vec<[f32; 3]>) {
        let size = UVec2::new(48, 40);
        let mut film = Film::new(size, PixelRect::full(size)).unwrap();
        let mut truth = Vec::new();
        for k in 0..film.pixels().len() {
            let p = film.position(k);
            let right = p.x >= 24;
            let albedo = if right { [0.5, 0.1, 0.05] } else { [0.2, 0.4, 0.1] };
            let light = if p.y < 20 { 1.0 } else { 0.3 };
            let true_rgb = albedo.map(|a: f32| a * light);
            truth.push(true_rgb);
            let mut stream = Stream::new(5, 1, k as u64);
            for _ in 0..16 {
                let factor = 1.0 + noise * (stream.next() as f32 * 2.0 - 1.0) * 3f32.sqrt();
                film.pixels_mut()[k].add(&FilmSample {
                    direct: true_rgb.map(|v| v * factor),
                    albedo,
                    normal: if right { Vec3::X } else { Vec3::Y },
                    alpha: 1.0,
                    ..FilmSample::default()
                });
            }
        }
        (film, truth)
    }

    fn error(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
        let squares = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| f64::from(a - b).powi(2));
        squares.sum::<f64>() / (3 * a.len()) as f64
    }

    #[test]
    fn noise_falls_and_edges_stay() {
        let (film, truth) = film(1.0);
        let clean = denoise(&Noisy::new(&film));
        let (before, after) = (error(&film.beauty(), &truth), error(&clean, &truth));
        assert!(after < 0.1 * before, "{before:e} {after:e}");
        // No light is made or lost on the whole, and none crosses the edge of the surfaces.
        let mean = |p: &[[f32; 3]]| p.iter().map(|p| f64::from(p[0])).sum::<f64>();
        assert!((mean(&clean) / mean(&film.beauty()) - 1.0).abs() < 0.01);
        for y in [5, 30] {
            for (x, c) in [(23, 1), (24, 0)] {
                let k = y * 48 + x;
                assert!(
                    (clean[k][c] / truth[k][c] - 1.0).abs() < 0.2,
                    "{x} {y}: {:?} {:?}",
                    clean[k],
                    truth[k]
                );
            }
        }
    }

    #[test]
    fn what_has_no_noise_stays() {
        let (film, truth) = film(0.0);
        assert!(error(&denoise(&Noisy::new(&film)), &truth) < 1e-12);
        // One sample has no variance.
        let size = UVec2::new(3, 2);
        let mut single = Film::new(size, PixelRect::full(size)).unwrap();
        for (k, pixel) in single.pixels_mut().iter_mut().enumerate() {
            pixel.add(&FilmSample { direct: [k as f32; 3], ..FilmSample::default() });
        }
        assert_eq!(denoise(&Noisy::new(&single)), single.beauty());
    }

    #[test]
    fn bytes_do_not_depend_on_threads() {
        let noisy = Noisy::new(&film(1.0).0);
        let with = |threads: usize| {
            rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| denoise(&noisy))
        };
        assert_eq!(with(1), with(5));
    }
}

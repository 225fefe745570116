//! `Film`: one accumulator per pixel of a crop of the full picture.
//!
//! Samples of a pixel are drawn around its centre from the reconstruction filter ([`super::filter`]), so each
//! counts in its own pixel only (Ernst, Stamminger and Greiner 2006, "Filter importance sampling"). Pixels are
//! therefore independent: any thread, crop or pass gives the same sums, as long as the samples of one pixel are
//! added in the order of their index.
//!
//! Mean of n samples x_i: `m = sum x_i / n`. Variance of that mean, per beauty channel:
//! `v = (sum x_i^2 - n m^2) / (n (n - 1))`, zero for n < 2. Sums of light are f64, so the difference keeps about
//! 8 digits of an f32 picture; sums of the guides (albedo, normal, ...) are f32.
//! Guarded by `mean_and_variance_match_two_passes`, `passes_do_not_change_the_sums`.

use glam::{UVec2, Vec2, Vec3};

use crate::{Error, Result};

/// Longest side of a picture, pixels.
pub const MAX_SIDE: u32 = 1 << 16;

/// Most pixels that a film holds: 2^26 pixels of 136 bytes are 8.5 GiB.
pub const MAX_PIXELS: u64 = 1 << 26;

/// Rectangle of pixels in the full picture: `x0 <= x < x1`, `y0 <= y < y1`, y downwards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelRect {
    /// First column.
    pub x0: u32,
    /// First row.
    pub y0: u32,
    /// Column after the last.
    pub x1: u32,
    /// Row after the last.
    pub y1: u32,
}

impl PixelRect {
    /// The whole picture.
    pub fn full(resolution: UVec2) -> Self {
        Self { x0: 0, y0: 0, x1: resolution.x, y1: resolution.y }
    }

    /// Part of the picture given as fractions of its sides. Edges are rounded to pixel edges, so crops that
    /// share an edge neither overlap nor leave a gap.
    pub fn from_fractions(resolution: UVec2, x: (f64, f64), y: (f64, f64)) -> Result<Self> {
        let edges = |(low, high): (f64, f64), size: u32, axis: &str| {
            if !(0.0 <= low && low < high && high <= 1.0) {
                return Err(Error::invalid(
                    "crop",
                    format!("{axis} range {low} to {high} is not an increasing range inside 0 to 1"),
                ));
            }
            let edge = |f: f64| (f * f64::from(size)).round() as u32;
            if edge(low) == edge(high) {
                return Err(Error::invalid("crop", format!("{axis} range {low} to {high} holds no pixel")));
            }
            Ok((edge(low), edge(high)))
        };
        let (x0, x1) = edges(x, resolution.x, "x")?;
        let (y0, y1) = edges(y, resolution.y, "y")?;
        Ok(Self { x0, y0, x1, y1 })
    }

    /// Columns.
    pub fn width(&self) -> u32 {
        self.x1.saturating_sub(self.x0)
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.y1.saturating_sub(self.y0)
    }
}

/// What one camera path brings home.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FilmSample {
    /// Light after at most one scattering event, and light sources seen directly; linear sRGB.
    pub direct: [f32; 3],
    /// All other light; linear sRGB. Beauty is `direct + indirect`.
    pub indirect: [f32; 3],
    /// Reflectance plus transmittance of the first surface, linear sRGB.
    pub albedo: [f32; 3],
    /// Shading normal of the first surface, world.
    pub normal: Vec3,
    /// Distance from the camera to the first surface, mm.
    pub depth_mm: f32,
    /// Texture coordinates of the first surface.
    pub uv: Vec2,
    /// Petal that was seen; 0 is none.
    pub petal_id: u32,
    /// Organ that was seen; 0 is none.
    pub organ_id: u32,
    /// 1 where a surface was seen, 0 where the background was.
    pub alpha: f32,
}

impl FilmSample {
    /// The sample times the filter's weight. Only light, albedo, normal and alpha are weighed; depth and
    /// texture coordinates are means over the samples that met a surface.
    #[must_use]
    pub fn weighted(mut self, weight: f32) -> Self {
        self.direct = self.direct.map(|v| v * weight);
        self.indirect = self.indirect.map(|v| v * weight);
        self.albedo = self.albedo.map(|v| v * weight);
        self.normal *= weight;
        self.alpha *= weight;
        self
    }
}

/// Sums over the samples of one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    direct: [f64; 3],
    indirect: [f64; 3],
    beauty_squared: [f64; 3],
    albedo: [f32; 3],
    normal: Vec3,
    depth_mm: f32,
    uv: Vec2,
    alpha: f32,
    samples: u32,
    hits: u32,
    rejected: u32,
    petal_id: u32,
    organ_id: u32,
}

impl Pixel {
    /// Adds the next sample; call in the order of the sample index.
    ///
    /// A sample whose light is not a finite number counts as black and in [`Pixel::rejected`], so that one
    /// failure neither spreads nor hides. Guides that are not finite are left out in the same way.
    pub fn add(&mut self, sample: &FilmSample) {
        if self.samples == 0 {
            self.petal_id = sample.petal_id;
            self.organ_id = sample.organ_id;
        }
        self.samples += 1;
        if sample.direct.iter().chain(&sample.indirect).all(|v| v.is_finite()) {
            for c in 0..3 {
                let (direct, indirect) = (f64::from(sample.direct[c]), f64::from(sample.indirect[c]));
                self.direct[c] += direct;
                self.indirect[c] += indirect;
                self.beauty_squared[c] += (direct + indirect).powi(2);
            }
        } else {
            self.rejected += 1;
        }
        let Vec3 { x, y, z } = sample.normal;
        let guides = [x, y, z, sample.alpha];
        if sample.albedo.iter().chain(&guides).all(|v| v.is_finite()) {
            for c in 0..3 {
                self.albedo[c] += sample.albedo[c];
            }
            self.normal += sample.normal;
            self.alpha += sample.alpha;
        }
        if sample.alpha != 0.0 && sample.depth_mm.is_finite() && sample.uv.is_finite() {
            self.hits += 1;
            self.depth_mm += sample.depth_mm;
            self.uv += sample.uv;
        }
    }

    /// Samples added.
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// Samples whose light was NaN or infinite; they count as black.
    pub fn rejected(&self) -> u32 {
        self.rejected
    }

    /// Mean of all light, linear sRGB.
    pub fn beauty(&self) -> [f32; 3] {
        std::array::from_fn(|c| ((self.direct[c] + self.indirect[c]) * self.inverse()) as f32)
    }

    /// Mean of the direct light, linear sRGB.
    pub fn direct(&self) -> [f32; 3] {
        self.direct.map(|s| (s * self.inverse()) as f32)
    }

    /// Mean of the indirect light, linear sRGB.
    pub fn indirect(&self) -> [f32; 3] {
        self.indirect.map(|s| (s * self.inverse()) as f32)
    }

    /// Estimated variance of each channel of [`Pixel::beauty`] (square of its standard error); 0 for fewer than
    /// two samples.
    pub fn variance(&self) -> [f32; 3] {
        if self.samples < 2 {
            return [0.0; 3];
        }
        let n = f64::from(self.samples);
        std::array::from_fn(|c| {
            let sum = self.direct[c] + self.indirect[c];
            ((self.beauty_squared[c] - sum * sum / n).max(0.0) / (n * (n - 1.0))) as f32
        })
    }

    /// Mean albedo over all samples (background counts 0).
    pub fn albedo(&self) -> [f32; 3] {
        self.albedo.map(|s| s * self.inverse() as f32)
    }

    /// Mean normal over all samples (background counts 0), so it is shorter than 1 at edges.
    pub fn normal(&self) -> Vec3 {
        self.normal * self.inverse() as f32
    }

    /// Mean depth of the samples that met a surface, mm; infinite if none did.
    pub fn depth_mm(&self) -> f32 {
        if self.hits == 0 { f32::INFINITY } else { self.depth_mm / self.hits as f32 }
    }

    /// Mean texture coordinates of the samples that met a surface; zero if none did.
    pub fn uv(&self) -> Vec2 {
        self.uv / self.hits.max(1) as f32
    }

    /// Share of samples that met a surface.
    pub fn alpha(&self) -> f32 {
        self.alpha * self.inverse() as f32
    }

    /// Petal of the pixel's first sample; 0 is none.
    pub fn petal_id(&self) -> u32 {
        self.petal_id
    }

    /// Organ of the pixel's first sample; 0 is none.
    pub fn organ_id(&self) -> u32 {
        self.organ_id
    }

    fn inverse(&self) -> f64 {
        1.0 / f64::from(self.samples.max(1))
    }
}

/// Accumulators for a crop of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    resolution: UVec2,
    crop: PixelRect,
    pixels: Vec<Pixel>,
}

impl Film {
    /// Empty film. `resolution` is that of the full picture (each side at most [`MAX_SIDE`]); memory is 136
    /// bytes for each of the crop's pixels, at most [`MAX_PIXELS`].
    pub fn new(resolution: UVec2, crop: PixelRect) -> Result<Self> {
        if resolution.min_element() == 0 || resolution.max_element() > MAX_SIDE {
            return Err(Error::invalid(
                "film",
                format!("{} x {} pixels: each side must be 1 to {MAX_SIDE}", resolution.x, resolution.y),
            ));
        }
        if crop.x0 >= crop.x1 || crop.y0 >= crop.y1 || crop.x1 > resolution.x || crop.y1 > resolution.y {
            return Err(Error::invalid(
                "crop",
                format!(
                    "columns {} to {} and rows {} to {} do not lie in {} x {} pixels",
                    crop.x0, crop.x1, crop.y0, crop.y1, resolution.x, resolution.y
                ),
            ));
        }
        let count = u64::from(crop.width()) * u64::from(crop.height());
        if count > MAX_PIXELS {
            return Err(Error::invalid(
                "film",
                format!("{count} pixels; at most {MAX_PIXELS} fit in one film"),
            ));
        }
        let mut pixels = Vec::new();
        pixels
            .try_reserve_exact(count as usize)
            .map_err(|_| Error::invalid("film", format!("no memory for {count} pixels")))?;
        pixels.resize(count as usize, Pixel::default());
        Ok(Self { resolution, crop, pixels })
    }

    /// Size of the full picture.
    pub fn resolution(&self) -> UVec2 {
        self.resolution
    }

    /// The part that this film holds.
    pub fn crop(&self) -> PixelRect {
        self.crop
    }

    /// Columns of the crop.
    pub fn width(&self) -> u32 {
        self.crop.width()
    }

    /// Rows of the crop.
    pub fn height(&self) -> u32 {
        self.crop.height()
    }

    /// The crop's pixels, row by row from the top left.
    pub fn pixels(&self) -> &[Pixel] {
        &self.pixels
    }

    /// The crop's pixels, row by row, to add to (in parallel if wanted: they are independent).
    pub fn pixels_mut(&mut self) -> &mut [Pixel] {
        &mut self.pixels
    }

    /// Absolute coordinates of the pixel at an index of [`Film::pixels`].
    pub fn position(&self, index: usize) -> UVec2 {
        let width = self.width() as usize;
        UVec2::new(self.crop.x0 + (index % width) as u32, self.crop.y0 + (index / width) as u32)
    }

    /// The picture: the mean of all light per pixel, row by row, linear sRGB.
    pub fn beauty(&self) -> Vec<[f32; 3]> {
        self.pixels.iter().map(Pixel::beauty).collect()
    }

    /// Samples with NaN or infinite light in the whole film; not zero is a defect of a model or a scene.
    pub fn rejected(&self) -> u64 {
        self.pixels.iter().map(|p| u64::from(p.rejected)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::hash_to_unit;

    fn sample(i: u32) -> FilmSample {
        let v = |k: u32| 1000.0 + hash_to_unit(i * 16 + k) as f32;
        FilmSample {
            direct: [v(0), v(1), v(2)],
            indirect: [v(3), v(4), v(5)],
            albedo: [0.5; 3],
            normal: Vec3::Z,
            depth_mm: 100.0 + (i % 2) as f32,
            uv: Vec2::new(0.25, 0.75),
            petal_id: 7 + i,
            organ_id: 3,
            alpha: 1.0,
        }
    }

    #[test]
    fn mean_and_variance_match_two_passes() {
        let n = 1000;
        let mut pixel = Pixel::default();
        (0..n).for_each(|i| pixel.add(&sample(i)));
        let red = |i| f64::from(sample(i).direct[0]) + f64::from(sample(i).indirect[0]);
        let mean = (0..n).map(red).sum::<f64>() / f64::from(n);
        let variance = (0..n).map(|i| (red(i) - mean).powi(2)).sum::<f64>() / f64::from(n * (n - 1));
        assert!((f64::from(pixel.beauty()[0]) - mean).abs() < 1e-3);
        // Far from zero, where the difference of squares loses most digits; in f32 nothing would be left.
        assert!((f64::from(pixel.variance()[0]) / variance - 1.0).abs() < 1e-5);
        // Two independent uniform numbers: variance 2/12.
        assert!((variance * f64::from(n) / (2.0 / 12.0) - 1.0).abs() < 0.1);
        assert_eq!(pixel.depth_mm(), 100.5);
        assert_eq!((pixel.petal_id(), pixel.organ_id(), pixel.samples()), (7, 3, n));
        assert_eq!((pixel.alpha(), pixel.uv(), pixel.normal()), (1.0, Vec2::new(0.25, 0.75), Vec3::Z));
    }

    #[test]
    fn passes_do_not_change_the_sums() {
        let mut once = Film::new(UVec2::new(4, 4), PixelRect { x0: 1, y0: 2, x1: 3, y1: 4 }).unwrap();
        let mut passes = once.clone();
        let key = |p: UVec2, i: u32| sample(p.x * 64 + p.y * 8 + i);
        for k in 0..4 {
            let p = once.position(k);
            (0..8).for_each(|i| once.pixels_mut()[k].add(&key(p, i)));
        }
        for i in 0..8 {
            for k in (0..4).rev() {
                let p = passes.position(k);
                passes.pixels_mut()[k].add(&key(p, i));
            }
        }
        assert_eq!(once, passes);
        assert_eq!(once.position(3), UVec2::new(2, 3));
    }

    #[test]
    fn non_finite_light_is_counted_and_black() {
        let mut pixel = Pixel::default();
        pixel.add(&FilmSample { direct: [1.0; 3], ..Default::default() });
        pixel.add(&FilmSample { direct: [f32::NAN, 1.0, 1.0], ..Default::default() });
        pixel.add(&FilmSample { indirect: [f32::INFINITY; 3], normal: Vec3::NAN, ..Default::default() });
        assert_eq!((pixel.samples(), pixel.rejected()), (3, 2));
        assert_eq!(pixel.beauty(), [1.0 / 3.0; 3]);
        assert_eq!(pixel.normal(), Vec3::ZERO);
        assert_eq!(pixel.depth_mm(), f32::INFINITY);
    }

    #[test]
    fn bad_sizes_are_errors() {
        let full = |w, h| PixelRect::full(UVec2::new(w, h));
        for (w, h) in [(0, 4), (4, 0), (MAX_SIDE + 1, 1), (MAX_SIDE, MAX_SIDE)] {
            assert!(Film::new(UVec2::new(w, h), full(w, h)).is_err(), "{w} x {h}");
        }
        for (x0, y0, x1, y1) in [(0, 0, 5, 4), (0, 0, 4, 5), (2, 0, 2, 4), (3, 0, 2, 4)] {
            assert!(Film::new(UVec2::new(4, 4), PixelRect { x0, y0, x1, y1 }).is_err());
        }
        for x in [(-0.1, 1.0), (0.5, 0.5), (0.5, 0.2), (0.0, 1.1), (f64::NAN, 1.0), (0.5, 0.5001)] {
            assert!(PixelRect::from_fractions(UVec2::new(8, 8), x, (0.0, 1.0)).is_err(), "{x:?}");
        }
    }

    #[test]
    fn neighbouring_crops_tile_the_picture() {
        let resolution = UVec2::new(7, 3);
        let left = PixelRect::from_fractions(resolution, (0.0, 0.3), (0.0, 1.0)).unwrap();
        let right = PixelRect::from_fractions(resolution, (0.3, 1.0), (0.0, 1.0)).unwrap();
        assert_eq!((left.x1, right.x1, left.y1), (right.x0, 7, 3));
    }
}

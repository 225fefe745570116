//! Two pictures compared by every measure at once: what `rosarium compare` prints.
//!
//! | measure | equation, over pixels and channels of linear sRGB | where |
//! |---|---|---|
//! | `rmse`, `relmse` | root of mean (x - r)^2; mean (x - r)^2 / (r^2 + epsilon) | [`compare`](super::compare) |
//! | `means` | mean x / mean r - 1, per channel and for the luminance | here |
//! | `flip` | what an eye sees: HDR-FLIP if both are pictures of light, else LDR-FLIP | [`flip`](super::flip) |
//! | `noise` | z tests against the pictures' own variance | [`NoiseTest`] |
//!
//! Pictures of a screen (PNG, JPEG) are decoded to linear light first; all is linear but FLIP. Pictures that
//! `rosarium render` writes bring the variance of each pixel. Guarded by `noise_is_no_difference_and_bias_is`.

use super::compare::{ImageTest, accepted_share, relmse, rmse, z_test_images};
use super::flip::{Exposures, PIXELS_PER_DEGREE, Pooled, hdr_flip, ldr_flip, pool};
use crate::film::{Film, Pixel, PixelRect};
use crate::io::{exr, image};
use crate::spectrum::color::luminance;
use crate::{Error, Result};

/// A picture, and what is known of its noise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Column and row of the first pixel in the full picture, where the file says so.
    pub origin: (i32, i32),
    /// Linear sRGB, row by row from the top.
    pub rgb: Vec<[f32; 3]>,
    /// Variance of each value's mean, where the picture has it and is not without any noise.
    pub variance: Option<Vec<[f32; 3]>>,
    /// Of light of any brightness (EXR, Radiance HDR), not of a screen.
    pub is_light: bool,
}

impl Picture {
    /// Reads EXR, HDR, PNG or JPEG. `layer` names channels `LAYER.R`, `.G` and `.B` of an EXR; the empty one is the picture.
    pub fn read(bytes: &[u8], layer: &str, max_pixels: u64) -> Result<Self> {
        if !exr::is_exr(bytes) {
            if !layer.is_empty() {
                return Err(Error::invalid(format!("layer {layer}"), "only EXR pictures have layers"));
            }
            let image::Image { width, height, rgb } = image::read(bytes, max_pixels)?;
            let is_light = image::is_light(bytes);
            return Ok(Self { width, height, origin: (0, 0), rgb, variance: None, is_light });
        }
        exr::check_chromaticities(bytes)?;
        let channels = exr::read_channels(bytes, max_pixels)?;
        let noisy = |v: &Vec<[f32; 3]>| v.as_flattened().iter().any(|&v| v != 0.0);
        let variance = if layer.is_empty() { channels.rgb("variance").ok().filter(noisy) } else { None };
        if let Some(bad) = variance.iter().flatten().flatten().find(|v| !(v.is_finite() && **v >= 0.0)) {
            return Err(Error::invalid("layer variance", format!("{bad} is no variance")));
        }
        let rgb = channels.rgb(layer)?;
        let exr::Channels { width, height, origin, .. } = channels;
        Ok(Self { width, height, origin, rgb, variance, is_light: true })
    }

    /// A part of the picture.
    pub fn crop(&self, part: PixelRect) -> Result<Self> {
        let [x0, x1, y0, y1] = [part.x0, part.x1, part.y0, part.y1].map(|v| v as usize);
        if x1 > self.width || y1 > self.height || x0 >= x1 || y0 >= y1 {
            return Err(Error::invalid(
                "crop",
                format!("{part:?} of {} x {} pixels", self.width, self.height),
            ));
        }
        let cut = |pixels: &Vec<[f32; 3]>| -> Vec<[f32; 3]> {
            let rows = pixels.chunks(self.width).skip(y0).take(y1 - y0);
            rows.flat_map(|row| &row[x0..x1]).copied().collect()
        };
        Ok(Self {
            width: x1 - x0,
            height: y1 - y0,
            origin: (self.origin.0 + x0 as i32, self.origin.1 + y0 as i32),
            rgb: cut(&self.rgb),
            variance: self.variance.as_ref().map(cut),
            is_light: self.is_light,
        })
    }

    /// How many pixels are not finite numbers, and column and row of the first of them.
    pub fn not_finite(&self) -> Option<(usize, (usize, usize))> {
        let bad = |i: &usize| self.rgb[*i].iter().any(|v| !v.is_finite());
        let first = (0..self.rgb.len()).find(bad)?;
        Some(((first..self.rgb.len()).filter(bad).count(), (first % self.width, first / self.width)))
    }

    fn channel(pixels: &[[f32; 3]], c: usize) -> Vec<f32> {
        pixels.iter().map(|v| v[c]).collect()
    }

    /// Means of red, green, blue and luminance.
    fn means(&self) -> [f64; 4] {
        let mean = |get: &dyn Fn([f32; 3]) -> f32| {
            self.rgb.iter().map(|&rgb| f64::from(get(rgb))).sum::<f64>() / self.rgb.len() as f64
        };
        [mean(&|v| v[0]), mean(&|v| v[1]), mean(&|v| v[2]), mean(&luminance)]
    }
}

impl From<&Film> for Picture {
    fn from(film: &Film) -> Self {
        Self {
            width: film.width() as usize,
            height: film.height() as usize,
            origin: (film.crop().x0 as i32, film.crop().y0 as i32),
            rgb: film.beauty(),
            variance: Some(film.pixels().iter().map(Pixel::variance).collect()),
            is_light: true,
        }
    }
}

/// How to compare.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// What keeps relative errors of dark pixels small, squared light. Default 1e-2.
    pub epsilon: f64,
    /// Pixels per degree of the viewer's eye, for FLIP. Default [`PIXELS_PER_DEGREE`].
    pub pixels_per_degree: f32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { epsilon: 1e-2, pixels_per_degree: PIXELS_PER_DEGREE }
    }
}

/// Means of one quantity over two pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Means {
    /// Of the picture.
    pub image: f64,
    /// Of the reference.
    pub reference: f64,
}

impl Means {
    /// `image / reference - 1`; 0 where both are zero.
    pub fn relative(&self) -> f64 {
        if self.image == self.reference { 0.0 } else { self.image / self.reference - 1.0 }
    }
}

/// Does noise explain the difference? z tests of each channel: the worst pixel with Sidak's correction, and the mean.
///
/// The variance of a difference is the sum of both pictures' variances, and of the rounding to 32 bits. A picture without
/// variances counts as exact. Variances of few samples are themselves noisy and a pixel's mean is then not normal: with less
/// than some hundred samples per pixel the worst pixel of right pictures may fail, while the mean is reliable.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseTest {
    /// Red, green, blue.
    pub channels: [ImageTest; 3],
    /// Probability of means so different if noise is all: of the worst channel, corrected for three.
    pub p_mean: f64,
    /// Probability of so bad a worst pixel, corrected for three channels.
    pub p_largest: f64,
    /// Least share of the pixels of a channel that noise explains, each at Sidak's level of 1e-3.
    pub explained: f64,
}

impl NoiseTest {
    /// Probability of either test's outcome.
    pub fn p(&self) -> f64 {
        any_of(self.p_mean.min(self.p_largest), 2)
    }

    /// The channel and the test with the worst pixel.
    pub fn worst(&self) -> (usize, ImageTest) {
        let [r, g, b] = self.channels;
        [(0, r), (1, g), (2, b)]
            .into_iter()
            .max_by(|a, b| a.1.largest_z.abs().total_cmp(&b.1.largest_z.abs()))
            .unwrap_or((0, r))
    }
}

/// 1 - (1 - p)^n without cancellation.
fn any_of(p: f64, n: usize) -> f64 {
    -(n as f64 * (-p).ln_1p()).exp_m1()
}

/// All measures of two pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Root of the mean squared difference.
    pub rmse: f64,
    /// Mean squared relative difference.
    pub relmse: f64,
    /// Red, green, blue and luminance.
    pub means: [Means; 4],
    /// FLIP over all pixels.
    pub flip: Pooled,
    /// FLIP of each pixel.
    pub flip_map: Vec<f32>,
    /// Exposures of HDR-FLIP; none if it was LDR-FLIP.
    pub exposures: Option<Exposures>,
    /// Where a picture brings its variance.
    pub noise: Option<NoiseTest>,
}

impl Difference {
    /// The largest relative difference of a mean, without sign.
    pub fn largest_mean(&self) -> f64 {
        self.means.iter().map(|m| m.relative().abs()).fold(0.0, f64::max)
    }
}

/// Compares a picture with a reference of the same size; both must be finite.
pub fn difference(image: &Picture, reference: &Picture, settings: &Settings) -> Result<Difference> {
    same_size(image, reference)?;
    if !(settings.epsilon > 0.0 && settings.epsilon.is_finite()) {
        return Err(Error::invalid("epsilon", format!("{} is not a positive number", settings.epsilon)));
    }
    let (a, b, width) = (&image.rgb, &reference.rgb, image.width);
    let (flip_map, exposures) = if image.is_light && reference.is_light {
        let (map, exposures) = hdr_flip(a, b, width, settings.pixels_per_degree)?;
        (map, Some(exposures))
    } else {
        (ldr_flip(a, b, width, settings.pixels_per_degree)?, None)
    };
    let (means_a, means_b) = (image.means(), reference.means());
    Ok(Difference {
        rmse: rmse(a.as_flattened(), b.as_flattened())?,
        relmse: relmse(a.as_flattened(), b.as_flattened(), settings.epsilon)?,
        means: std::array::from_fn(|i| Means { image: means_a[i], reference: means_b[i] }),
        flip: pool(&flip_map),
        flip_map,
        exposures,
        // A tone curve is no noise.
        noise: if exposures.is_some() { noise_test(image, reference)? } else { None },
    })
}

fn same_size(image: &Picture, reference: &Picture) -> Result<()> {
    let sizes = [image, reference].map(|p| (p.width, p.height));
    if sizes[0] != sizes[1] {
        return Err(Error::invalid("picture", format!("{:?} pixels against {:?}", sizes[0], sizes[1])));
    }
    Ok(())
}

/// The z tests alone; none where neither picture brings variances.
pub fn noise_test(image: &Picture, reference: &Picture) -> Result<Option<NoiseTest>> {
    same_size(image, reference)?;
    if image.variance.is_none() && reference.variance.is_none() {
        return Ok(None);
    }
    let mut channels = Vec::new();
    let mut explained = 1.0f64;
    for c in 0..3 {
        let (a, b) = (Picture::channel(&image.rgb, c), Picture::channel(&reference.rgb, c));
        let variance = |p: &Picture, light: &[f32]| -> Vec<f32> {
            // The mean is rounded to 24 bits.
            let rounding = |x: f32| (x * 0.5 * f32::EPSILON).powi(2);
            let pixel = |i: usize| p.variance.as_ref().map_or(0.0, |v| v[i][c]) + rounding(light[i]);
            (0..light.len()).map(pixel).collect()
        };
        let (va, vb) = (variance(image, &a), variance(reference, &b));
        channels.push(z_test_images(&a, &va, &b, &vb)?);
        explained = explained.min(accepted_share(&a, &va, &b, &vb, 1e-3)?);
    }
    let [r, g, b] = channels[..] else { return Ok(None) };
    let channels = [r, g, b];
    let least = |get: fn(&ImageTest) -> f64| any_of(channels.iter().map(get).fold(1.0, f64::min), 3);
    Ok(Some(NoiseTest {
        channels,
        p_mean: least(|t| t.p_mean),
        p_largest: least(|t| t.p_largest),
        explained,
    }))
}

/// Relative difference of the luminance with sign, `(x - r) / sqrt(r^2 + epsilon)` of each pixel: the mean of its square is
/// the luminance's `relmse`.
pub fn signed_map(image: &Picture, reference: &Picture, epsilon: f64) -> Vec<f32> {
    let relative = |(&a, &b): (&[f32; 3], &[f32; 3])| {
        let (a, b) = (f64::from(luminance(a)), f64::from(luminance(b)));
        ((a - b) / (b * b + epsilon).sqrt()) as f32
    };
    image.rgb.iter().zip(&reference.rgb).map(relative).collect()
}

/// A round limit (1, 2 or 5 times a power of ten) that at most a hundredth of the values exceed.
pub fn round_limit(values: &[f32]) -> f32 {
    let mut sizes: Vec<f32> = values.iter().map(|v| v.abs()).filter(|v| v.is_finite()).collect();
    if sizes.is_empty() {
        return 1.0;
    }
    let place = sizes.len() - 1 - sizes.len() / 100;
    let size = f64::from(*sizes.select_nth_unstable_by(place, f32::total_cmp).1);
    // Nothing to see is no reason to show rounding errors.
    let size = size.max(1e-5);
    let power = 10f64.powf(size.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|&l| l >= size * 0.9999).unwrap_or(size) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::hash_to_unit;

    /// Grey of 0.5 with noise of variance 1e-4 of a sum of twelve uniform numbers.
    fn noisy(seed: u32, gain: f32) -> Picture {
        let value = |i: u32| {
            let sum: f64 = (0..12).map(|k| hash_to_unit(seed * 7_000_003 + i * 12 + k)).sum();
            (0.5 + 0.01 * (sum as f32 - 6.0)) * gain
        };
        Picture {
            width: 60,
            height: 40,
            origin: (7, 8),
            rgb: (0..2400).map(|i| [value(3 * i), value(3 * i + 1), value(3 * i + 2)]).collect(),
            variance: Some(vec![[1e-4; 3]; 2400]),
            is_light: true,
        }
    }

    #[test]
    fn noise_is_no_difference_and_bias_is() -> Result<()> {
        let (a, b) = (noisy(1, 1.0), noisy(2, 1.0));
        let d = difference(&a, &b, &Settings::default())?;
        let noise = d.noise.clone().unwrap();
        assert!(noise.p() > 1e-3 && noise.explained == 1.0, "{noise:?}");
        assert!((d.rmse / 2e-4f64.sqrt() - 1.0).abs() < 0.05, "{}", d.rmse);
        assert!((d.relmse / (2e-4 / 0.26) - 1.0).abs() < 0.05, "{}", d.relmse);
        assert!(d.exposures.is_some() && d.flip.mean > 0.0 && d.largest_mean() < 2e-3);
        let biased = difference(&noisy(1, 1.005), &b, &Settings::default())?;
        let noise = biased.noise.unwrap();
        assert!(noise.p_mean < 1e-6 && noise.p_largest > 1e-3 && noise.p() < 1e-5, "{noise:?}");
        // One firefly, found where it is.
        let mut fly = a.clone();
        fly.rgb[1234][2] += 0.2;
        let noise = difference(&fly, &b, &Settings::default())?.noise.unwrap();
        assert_eq!((noise.worst().0, noise.worst().1.pixel), (2, 1234));
        assert!(noise.p_largest < 1e-6 && noise.explained < 1.0);
        // Without variances there is no such test; a screen has no exposures.
        let screen = |p: &Picture| Picture { variance: None, is_light: false, ..p.clone() };
        let d = difference(&screen(&a), &screen(&b), &Settings::default())?;
        assert!(d.noise.is_none() && d.exposures.is_none());
        Ok(())
    }

    #[test]
    fn crops_and_bad_pixels_are_where_they_are() -> Result<()> {
        let mut a = noisy(1, 1.0);
        assert_eq!(a.not_finite(), None);
        a.rgb[2 * 60 + 5][1] = f32::NAN;
        a.rgb[39 * 60 + 59][0] = f32::INFINITY;
        assert_eq!(a.not_finite(), Some((2, (5, 2))));
        assert!(difference(&a, &noisy(2, 1.0), &Settings::default()).is_err());
        let part = a.crop(PixelRect { x0: 5, y0: 2, x1: 8, y1: 40 })?;
        assert_eq!((part.width, part.height, part.rgb.len(), part.origin), (3, 38, 114, (12, 10)));
        assert_eq!(part.variance.as_ref().map(Vec::len), Some(114));
        assert_eq!(part.not_finite(), Some((1, (0, 0))));
        assert!(a.crop(PixelRect { x0: 0, y0: 0, x1: 61, y1: 1 }).is_err());
        assert!(difference(&part, &a, &Settings::default()).is_err());
        let zero = Settings { epsilon: 0.0, ..Settings::default() };
        assert!(difference(&noisy(1, 1.0), &noisy(2, 1.0), &zero).is_err());
        Ok(())
    }

    #[test]
    fn signs_and_limits() {
        let grey = |v: f32| Picture { width: 2, height: 1, rgb: vec![[v; 3]; 2], ..Default::default() };
        let map = signed_map(&grey(0.9), &grey(1.0), 0.0);
        assert!((map[0] + 0.1).abs() < 1e-6 && (round_limit(&map) - 0.1).abs() < 1e-7, "{map:?}");
        let mut values = vec![0.03; 1000];
        values[5] = -100.0;
        assert!((round_limit(&values) - 0.05).abs() < 1e-7);
        assert_eq!((round_limit(&[]), round_limit(&[0.0])), (1.0, 1e-5));
        let means = Means { image: 1.1, reference: 1.0 };
        assert!((means.relative() - 0.1).abs() < 1e-12);
        assert_eq!(Means { image: 0.0, reference: 0.0 }.relative(), 0.0);
    }
}

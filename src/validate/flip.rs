//! FLIP: how large the difference is that a person sees who alternates between two pictures, 0 to 1 per pixel.
//!
//! LDR-FLIP ([Andersson2020](https://doi.org/10.1145/3406183)), for pictures of a screen (linear sRGB, clipped to 0 to 1):
//! ```text
//! E = E_c^(1 - E_f)
//! E_c = HyAB(p, r)^0.7, mapped to [0, 1],   p, r: Lab of the filtered colours, chroma times 0.01 L (Hunt)
//! E_f = sqrt(max(|edges_p - edges_r|, |points_p - points_r|) / sqrt 2)
//! ```
//! Colours are filtered by the eye's contrast sensitivity in YCxCz; edges and points are lengths of the first and
//! second derivatives of the lightness under a Gaussian (`filters`). Both depend on the pixels per degree of the
//! viewer's eye: [`PIXELS_PER_DEGREE`] unless told otherwise.
//!
//! HDR-FLIP ([Andersson2021](https://doi.org/10.2312/egs.20211015)), for light: LDR-FLIP of both pictures at exposures between the one that shows the
//! reference's brightest pixel at 0.85 of white and the one that does so with its median, behind Narkowicz's curve
//! ([Narkowicz2016](https://knarkowicz.wordpress.com/2016/01/06/aces-filmic-tone-mapping-curve/)); the largest value of each pixel over the exposures.
//!
//! | symbol | here | unit | default |
//! |---|---|---|---|
//! | p | `pixels_per_degree` | 1/deg | 67.02 |
//! | c_start, c_stop, N | [`Exposures`] | stops | from the reference |
//!
//! Limits: the white is our integral of D65, not the authors' rounded one; borders repeat their pixels; a pixel's
//! luminance counts as at least 2^-23 where the exposures are found, as in the authors' program, so a dark reference
//! does not ask for endless exposures; negative light, which colours beyond sRGB have, counts as black: FLIP is not defined for it. Guarded by `values_of_the_authors_program`,
//! `equal_pictures_have_no_difference`, `swapped_pictures_have_the_same_difference`, `extremes_are_black_and_white`,
//! `a_dark_reference_has_few_exposures`. `scripts/foreign_flip.py` compares whole pictures with the authors' program.

mod filters;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use self::filters::{Filters, Plane};
use crate::spectrum::Observer;
use crate::spectrum::color::{lab, luminance};
use crate::{Error, Result};

/// A screen of 3840 pixels and 0.7 m width, seen from 0.7 m: 3840 pi / 180.
pub const PIXELS_PER_DEGREE: f32 = 67.020_645;

/// Smallest and largest pixels per degree: the filters' size grows with it.
pub const PIXELS_PER_DEGREE_RANGE: (f32, f32) = (1.0, 1000.0);

/// Exponent of the colour difference, and of the feature difference.
const Q_COLOR: f64 = 0.7;
const Q_FEATURE: f32 = 0.5;
/// Differences below this share of the largest one are spread over [`PT`] of the scale.
const PC: f64 = 0.4;
const PT: f64 = 0.95;
/// Share of white that an exposure brings a pixel to.
const EXPOSED_TO: f64 = 0.85;
/// Least luminance for which an exposure is found.
const LEAST_LUMINANCE: f32 = f32::EPSILON;

/// Exposures of HDR-FLIP, evenly spaced from `start_ev` to `stop_ev`, both among them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposures {
    /// Shows the brightest pixel of the reference, stops.
    pub start_ev: f64,
    /// Shows its median, stops.
    pub stop_ev: f64,
    /// How many.
    pub count: u32,
}

impl Exposures {
    /// Those for a reference picture.
    pub fn of(reference: &[[f32; 3]]) -> Result<Self> {
        check(reference, reference, reference.len(), PIXELS_PER_DEGREE)?;
        let seen = |rgb: &[f32; 3]| luminance(rgb.map(|v| v.max(0.0))).max(LEAST_LUMINANCE);
        let mut light: Vec<f32> = reference.iter().map(seen).collect();
        let brightest = light.iter().copied().fold(0.0, f32::max);
        let half = light.len() / 2;
        let median = *light.select_nth_unstable_by(half, f32::total_cmp).1;
        // The light that the curve shows as t: the positive root of (t d - a) x^2 + (t e - b) x + t f = 0.
        let [a, b, d, e, f] = narkowicz();
        let (p, q) =
            ((EXPOSED_TO * e - b) / (EXPOSED_TO * d - a) / 2.0, EXPOSED_TO * f / (EXPOSED_TO * d - a));
        let shown = (p * p - q).sqrt() - p;
        let stops = |light: f32| (shown / f64::from(light)).log2();
        let (start_ev, stop_ev) = (stops(brightest), stops(median));
        Ok(Self { start_ev, stop_ev, count: ((stop_ev - start_ev).ceil() as u32).max(2) })
    }

    fn gains(self) -> impl Iterator<Item = f64> {
        let step = (self.stop_ev - self.start_ev) / f64::from(self.count.max(2) - 1);
        (0..self.count).map(move |i| (self.start_ev + f64::from(i) * step).exp2())
    }
}

/// LDR-FLIP of each pixel. Both pictures are linear sRGB, row by row, clipped to [0, 1]; symmetric in them.
pub fn ldr_flip(
    image: &[[f32; 3]],
    reference: &[[f32; 3]],
    width: usize,
    pixels_per_degree: f32,
) -> Result<Vec<f32>> {
    check(image, reference, width, pixels_per_degree)?;
    Ok(bands(image, reference, width, pixels_per_degree, &[&|v| v]))
}

/// HDR-FLIP of each pixel of two pictures of light (linear sRGB, row by row), and the exposures that it is the
/// largest value of.
pub fn hdr_flip(
    image: &[[f32; 3]],
    reference: &[[f32; 3]],
    width: usize,
    pixels_per_degree: f32,
) -> Result<(Vec<f32>, Exposures)> {
    check(image, reference, width, pixels_per_degree)?;
    let exposures = Exposures::of(reference)?;
    let [a, b, d, e, f] = narkowicz();
    let screens: Vec<_> = exposures
        .gains()
        .map(|gain| {
            move |v: f64| {
                // Light beyond this is white at any exposure, and its square stays finite.
                let x = (v.max(0.0) * gain).min(1e100);
                x * (a * x + b) / (x * (d * x + e) + f)
            }
        })
        .collect();
    let screens: Vec<&Screen> = screens.iter().map(|s| s as &Screen).collect();
    Ok((bands(image, reference, width, pixels_per_degree, &screens), exposures))
}

/// Many pixels' FLIP in a few numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pooled {
    /// Mean.
    pub mean: f64,
    /// The value that parts the sum of all values in two halves: smaller and larger ones.
    pub weighted_median: f32,
    /// Largest value.
    pub max: f32,
}

/// Mean, weighted median and maximum of a map of differences.
pub fn pool(map: &[f32]) -> Pooled {
    let mut sorted = map.to_vec();
    sorted.sort_unstable_by(f32::total_cmp);
    let sum: f64 = sorted.iter().map(|&v| f64::from(v)).sum();
    let mut below = 0.0;
    let half = sorted.iter().copied().find(|&v| {
        below += f64::from(v);
        below >= 0.5 * sum
    });
    Pooled {
        mean: sum / map.len().max(1) as f64,
        weighted_median: half.unwrap_or(0.0),
        max: sorted.last().copied().unwrap_or(0.0),
    }
}

/// a, b, d, e, f of Narkowicz's curve x (a x + b) / (x (d x + e) + f), with its customary exposure of 0.6 within.
fn narkowicz() -> [f64; 5] {
    [0.36 * 2.51, 0.6 * 0.03, 0.36 * 2.43, 0.6 * 0.59, 0.14]
}

fn check(image: &[[f32; 3]], reference: &[[f32; 3]], width: usize, pixels_per_degree: f32) -> Result<()> {
    if image.len() != reference.len() || width == 0 || image.is_empty() || !image.len().is_multiple_of(width)
    {
        let what = format!("{} and {} pixels, {width} in a row", image.len(), reference.len());
        return Err(Error::invalid("flip", what));
    }
    let (low, high) = PIXELS_PER_DEGREE_RANGE;
    if !(low..=high).contains(&pixels_per_degree) {
        let what = format!("{pixels_per_degree} is not within {low} to {high}");
        return Err(Error::invalid("pixels_per_degree", what));
    }
    for pixels in [image, reference] {
        if let Some(i) = pixels.iter().position(|rgb| rgb.iter().any(|v| !v.is_finite())) {
            let what = format!("{:?} is not a finite number", pixels[i]);
            return Err(Error::invalid(format!("pixel ({}, {})", i % width, i / width), what));
        }
    }
    Ok(())
}

/// From a picture's value to a screen's, 0 to 1 after clipping.
type Screen<'a> = dyn Fn(f64) -> f64 + Sync + 'a;

/// The largest difference over the screens, in bands of rows: the memory for planes is that of a few bands.
fn bands(
    image: &[[f32; 3]],
    reference: &[[f32; 3]],
    width: usize,
    pixels_per_degree: f32,
    screens: &[&Screen<'_>],
) -> Vec<f32> {
    let filters = Filters::new(f64::from(pixels_per_degree));
    let rows = (2 * filters.halo).max(48);
    let colors = Colors::new();
    let mut map = vec![0.0f32; image.len()];
    map.par_chunks_mut(rows * width).enumerate().for_each(|(band, out)| {
        let band = Band { width, first: band * rows, rows: out.len() / width };
        for screen in screens {
            let [a, b] = [image, reference].map(|p| View::new(p, &band, &filters, &colors, screen));
            for (i, value) in out.iter_mut().enumerate() {
                *value = value.max(a.difference(&b, &colors, i));
            }
        }
    });
    map
}

/// Rows of a picture.
struct Band {
    width: usize,
    first: usize,
    rows: usize,
}

/// What an eye has of a band of one picture.
struct View {
    /// Lab after Hunt's adjustment.
    lab: Vec<DVec3>,
    edges: Vec<f32>,
    points: Vec<f32>,
}

impl View {
    fn new(pixels: &[[f32; 3]], band: &Band, filters: &Filters, colors: &Colors, screen: &Screen) -> Self {
        let [mut y, mut cx, mut cz] = [(); 3].map(|()| Plane::new(band.width));
        let last = pixels.len() / band.width - 1;
        for row in 0..band.rows + 2 * filters.halo {
            // Borders repeat.
            let row = (band.first + row).saturating_sub(filters.halo).min(last) * band.width;
            for rgb in &pixels[row..row + band.width] {
                let c = colors.ycxcz(DVec3::from(rgb.map(|v| screen(f64::from(v)).clamp(0.0, 1.0))));
                y.data.push(c.x as f32);
                cx.data.push(c.y as f32);
                cz.data.push(c.z as f32);
            }
        }
        let (edges, points) = filters.features(&y, band.rows);
        let (y, cx, cz) = (
            filters.achromatic(&y, band.rows),
            filters.red_green(&cx, band.rows),
            filters.blue_yellow(&cz, band.rows),
        );
        let lab = (y.data.iter().zip(&cx.data).zip(&cz.data))
            .map(|((&y, &cx), &cz)| colors.hunt_lab(DVec3::new(y.into(), cx.into(), cz.into())))
            .collect();
        Self { lab, edges, points }
    }

    fn difference(&self, other: &Self, colors: &Colors, i: usize) -> f32 {
        let color = hyab(self.lab[i], other.lab[i]).powf(Q_COLOR);
        let bend = PC * colors.largest;
        let color = if color < bend {
            PT / bend * color
        } else {
            PT + (color - bend) / (colors.largest - bend) * (1.0 - PT)
        };
        let difference = |a: &[f32], b: &[f32]| (a[i] - b[i]).abs();
        let feature = difference(&self.edges, &other.edges).max(difference(&self.points, &other.points));
        let feature = (feature * std::f32::consts::FRAC_1_SQRT_2).powf(Q_FEATURE).clamp(0.0, 1.0);
        (color as f32).clamp(0.0, 1.0).powf(1.0 - feature)
    }
}

/// `|dL| + |d(a, b)|`, for large differences of colour.
fn hyab(p: DVec3, r: DVec3) -> f64 {
    let d = p - r;
    d.x.abs() + d.y.hypot(d.z)
}

/// Conversions of colours relative to the white of sRGB.
struct Colors {
    /// Linear sRGB to XYZ over the white's, and back.
    xyz: DMat3,
    rgb: DMat3,
    /// The largest difference that colours of a screen have, green against blue, to the power of [`Q_COLOR`].
    largest: f64,
}

impl Colors {
    fn new() -> Self {
        let white = Observer::Cie1931.white();
        let xyz = DMat3::from_diagonal(white.recip()) * Observer::Cie1931.xyz_from_srgb();
        let mut colors = Self { xyz, rgb: xyz.inverse(), largest: 1.0 };
        let [green, blue] = [DVec3::Y, DVec3::Z].map(|rgb| colors.hunt_lab(colors.ycxcz(rgb)));
        colors.largest = hyab(green, blue).powf(Q_COLOR);
        colors
    }

    fn ycxcz(&self, rgb: DVec3) -> DVec3 {
        let DVec3 { x, y, z } = self.xyz * rgb;
        DVec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
    }

    /// Lab, of a colour inside the cube of sRGB, with the chroma of dark colours lessened.
    fn hunt_lab(&self, ycxcz: DVec3) -> DVec3 {
        let y = (ycxcz.x + 16.0) / 116.0;
        let rgb = self.rgb * DVec3::new(y + ycxcz.y / 500.0, y, y - ycxcz.z / 200.0);
        let lab = lab(self.xyz * rgb.clamp(DVec3::ZERO, DVec3::ONE), DVec3::ONE);
        let adjust = 0.01 * lab.x;
        DVec3::new(lab.x, adjust * lab.y, adjust * lab.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 40;
    const HEIGHT: usize = 24;

    /// Waves of colour; `shift` moves them, `edge` adds a disc. Values within 0.05 to 0.95 of `scale`.
    fn waves(scale: f32, shift: f32, edge: bool) -> Vec<[f32; 3]> {
        let wave = |a: f32| 0.5 + 0.35 * a.sin();
        (0..WIDTH * HEIGHT)
            .map(|i| {
                let (x, y) = ((i % WIDTH) as f32, (i / WIDTH) as f32);
                let disc = edge && (x - 20.0).powi(2) + (y - 12.0).powi(2) < 25.0;
                let lift = if disc { 0.1 } else { 0.0 };
                let rgb = [wave(0.5 * x + shift), wave(0.3 * y - shift), wave(0.2 * (x + y) + 2.0 * shift)];
                rgb.map(|v| (v + lift) * scale)
            })
            .collect()
    }

    fn agree(map: &[f32], [mean, middle, corner]: [f32; 3]) {
        assert!((pool(map).mean - f64::from(mean)).abs() < 1e-5, "{}", pool(map).mean);
        for (found, theirs) in [(map[12 * WIDTH + 20], middle), (map[20 * WIDTH + 3], corner)] {
            assert!((found - theirs).abs() < 5e-5, "{found} {theirs}");
        }
    }

    /// Means and values at (20, 12) and (3, 20) that the authors' flip-evaluator 1.7 gives for the same pictures, which
    /// `scripts/foreign_flip.py` makes again.
    #[test]
    fn values_of_the_authors_program() -> Result<()> {
        let (a, b) = (waves(1.0, 0.1, true), waves(1.0, 0.0, false));
        for (pixels_per_degree, theirs) in [
            (PIXELS_PER_DEGREE, [0.212_908_6, 0.423_867_3, 0.178_502_5]),
            (20.0, [0.213_080_5, 0.340_237_4, 0.176_942_2]),
            (150.0, [0.176_361_6, 0.350_236_6, 0.172_030_7]),
        ] {
            agree(&ldr_flip(&a, &b, WIDTH, pixels_per_degree)?, theirs);
        }
        let (a, b) = (waves(30.0, 0.1, true), waves(30.0, 0.0, false));
        let (map, exposures) = hdr_flip(&a, &b, WIDTH, PIXELS_PER_DEGREE)?;
        agree(&map, [0.158_366_6, 0.283_147_7, 0.133_983_1]);
        assert!((exposures.start_ev + 3.587_728_5).abs() < 1e-4 && exposures.count == 2, "{exposures:?}");
        assert!((exposures.stop_ev + 2.908_943_9).abs() < 1e-4, "{exposures:?}");
        Ok(())
    }

    #[test]
    fn equal_pictures_have_no_difference() -> Result<()> {
        let a = waves(3.0, 0.0, true);
        assert!(ldr_flip(&a, &a, WIDTH, PIXELS_PER_DEGREE)?.iter().all(|&v| v == 0.0));
        let (map, _) = hdr_flip(&a, &a, WIDTH, PIXELS_PER_DEGREE)?;
        assert_eq!(pool(&map), Pooled::default());
        Ok(())
    }

    #[test]
    fn swapped_pictures_have_the_same_difference() -> Result<()> {
        let (a, b) = (waves(1.0, 0.4, true), waves(0.8, 0.0, false));
        let there = ldr_flip(&a, &b, WIDTH, PIXELS_PER_DEGREE)?;
        assert_eq!(there, ldr_flip(&b, &a, WIDTH, PIXELS_PER_DEGREE)?);
        assert!(there.iter().all(|v| (0.0..=1.0).contains(v)) && pool(&there).mean > 0.05);
        Ok(())
    }

    /// The largest colour difference has the value 1 without any feature, and features bring any difference nearer to 1.
    #[test]
    fn extremes_are_black_and_white() -> Result<()> {
        let flat = |rgb: [f32; 3]| vec![rgb; 900];
        let flip = |a: [f32; 3], b: [f32; 3]| -> Result<f64> {
            let map = ldr_flip(&flat(a), &flat(b), 30, PIXELS_PER_DEGREE)?;
            let p = pool(&map);
            assert!((p.mean - f64::from(p.max)).abs() < 1e-5 && (p.weighted_median - p.max).abs() < 1e-5);
            Ok(p.mean)
        };
        assert!((flip([0.0, 1.0, 0.0], [0.0, 0.0, 1.0])? - 1.0).abs() < 1e-5);
        let white = flip([1.0; 3], [0.0; 3])?;
        assert!((0.96..0.98).contains(&white), "{white}");
        // Screens clip.
        assert_eq!(flip([9.0; 3], [-1.0; 3])?, white);
        let mut dot = flat([0.5; 3]);
        dot[15 * 30 + 15] = [1.0; 3];
        let map = ldr_flip(&dot, &flat([0.5; 3]), 30, PIXELS_PER_DEGREE)?;
        assert!(map[15 * 30 + 15] == pool(&map).max && map[0] == 0.0, "a dot is seen where it is");
        Ok(())
    }

    #[test]
    fn a_dark_reference_has_few_exposures() -> Result<()> {
        let mut light = vec![[0.0; 3]; 90];
        let black = Exposures::of(&light)?;
        assert_eq!((black.start_ev, black.count), (black.stop_ev, 2));
        light[..40].fill([1.0; 3]);
        let dark = Exposures::of(&light)?;
        assert!((dark.stop_ev - dark.start_ev - 23.0).abs() < 1e-6 && dark.count == 23, "{dark:?}");
        light[40..].fill([1.0; 3]);
        assert_eq!(Exposures::of(&light)?.count, 2);
        // Any light has a finite difference.
        let odd = [[1e30, -5.0, 0.0], [f32::MAX; 3], [1e-40; 3]].repeat(30);
        for (a, b) in [(&light, &odd), (&odd, &light)] {
            assert!(hdr_flip(a, b, 9, PIXELS_PER_DEGREE)?.0.iter().all(|v| (0.0..=1.0).contains(v)));
        }
        Ok(())
    }

    #[test]
    fn wrong_pictures_are_errors() {
        let a = vec![[0.5; 3]; 12];
        let bad = |image: &[[f32; 3]], width, ppd| {
            assert!(ldr_flip(image, &a, width, ppd).is_err() && hdr_flip(image, &a, width, ppd).is_err());
        };
        bad(&a[1..], 4, 67.0);
        bad(&[], 4, 67.0);
        bad(&a, 0, 67.0);
        bad(&a, 5, 67.0);
        bad(&a, 4, 0.0);
        bad(&a, 4, f32::NAN);
        bad(&a, 4, 1e6);
        let mut nan = a.clone();
        nan[7][1] = f32::NAN;
        bad(&nan, 4, 67.0);
    }

    #[test]
    fn pooled_values_follow_their_definition() {
        let p = pool(&[0.1, 0.9, 0.0, 0.2]);
        assert!((p.mean - 0.3).abs() < 1e-7);
        assert_eq!((p.weighted_median, p.max), (0.9, 0.9));
        assert_eq!(pool(&[]), Pooled::default());
        assert_eq!(pool(&[0.0, 0.5, 0.5, 0.1]).weighted_median, 0.5);
    }
}

//! Numbers as colours: a PNG of one value per pixel, with a bar that says what the colours mean.
//!
//! - [`Scale::Magma`]: from black over purple to light yellow, for what has a zero and no sign; steps of equal number look
//!   equally far apart. [`Scale::Viridis`] does the same from violet over green to yellow.
//! - [`Scale::Signed`]: blue below zero, white at it, red above.
//!
//! Values beyond the ends have the ends' colours, NaN is green. Small pictures are magnified in whole pixels.

use kuva::plot::ColorMap;
use kuva::render::color::Color;
use kuva::render::render::{Primitive, Scene, TextAnchor};

use super::picture::{Picture, label};
use super::{image, png};
use crate::film::ToneMap;
use crate::spectrum::color::srgb_decode;
use crate::{Error, Result};

/// What the colours stand for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// 0 to `max`.
    Magma {
        /// Value of the brightest colour.
        max: f32,
    },
    /// 0 to `max`, from dark violet over green to yellow.
    Viridis {
        /// Value of the brightest colour.
        max: f32,
    },
    /// `-limit` to `limit`.
    Signed {
        /// Value of the full red.
        limit: f32,
    },
}

/// Smaller pictures are magnified to at most this width and height, pixels.
const MAGNIFIED_PX: usize = 480;
/// The bar's picture is drawn at this many pixels per unit.
const BAR_SCALE: usize = 2;
const BAR_HEIGHT: f64 = 50.0;
/// Pieces of the bar.
const STEPS: usize = 128;

impl Scale {
    fn ends(self) -> (f32, f32) {
        match self {
            Scale::Magma { max } | Scale::Viridis { max } => (0.0, max),
            Scale::Signed { limit } => (-limit, limit),
        }
    }

    /// Colour of a share of the way from one end to the other, sRGB levels.
    fn color(self, t: f32) -> [u8; 3] {
        match self {
            Scale::Magma { .. } | Scale::Viridis { .. } => {
                let map =
                    if matches!(self, Scale::Magma { .. }) { ColorMap::Magma } else { ColorMap::Viridis };
                let (r, g, b) = map.map_rgb(f64::from(t)).unwrap_or_default();
                [r, g, b]
            }
            Scale::Signed { .. } => {
                // Levels at the ends; white in the middle.
                let end = if t < 0.5 { [33.0, 102.0, 172.0] } else { [178.0, 24.0, 43.0] };
                let far = (2.0 * t - 1.0).abs();
                end.map(|level: f32| (255.0 + (level - 255.0) * far + 0.5) as u8)
            }
        }
    }

    /// Colour of a value, linear sRGB.
    pub fn linear(self, value: f32) -> [f32; 3] {
        self.color_of(value).map(|level| srgb_decode(f32::from(level) / 255.0))
    }

    fn color_of(self, value: f32) -> [u8; 3] {
        let (low, high) = self.ends();
        if value.is_nan() { [0, 255, 0] } else { self.color(((value - low) / (high - low)).clamp(0.0, 1.0)) }
    }
}

/// The picture of `values`, row by row from the top, as PNG bytes. `caption` says what is shown.
pub fn write(values: &[f32], width: usize, scale: Scale, caption: &str) -> Result<Vec<u8>> {
    let decode: [f32; 256] = std::array::from_fn(|level| srgb_decode(level as f32 / 255.0));
    let colors: Vec<[f32; 3]> =
        values.iter().map(|&v| scale.color_of(v).map(|level| decode[usize::from(level)])).collect();
    write_colors(&colors, width, scale, caption)
}

/// The picture of colours that were taken from a scale by [`Scale::linear`], and perhaps mixed.
pub fn write_colors(colors: &[[f32; 3]], width: usize, scale: Scale, caption: &str) -> Result<Vec<u8>> {
    let (low, high) = scale.ends();
    if !(low.is_finite() && high.is_finite() && low < high) {
        return Err(Error::invalid("scale", format!("{low} to {high} is not a range")));
    }
    if width == 0 || colors.is_empty() || !colors.len().is_multiple_of(width) {
        return Err(Error::invalid("picture", format!("{} values, {width} in a row", colors.len())));
    }
    let height = colors.len() / width;
    let factor = (MAGNIFIED_PX / width).min(MAGNIFIED_PX / height).max(1);
    let columns = (width * factor).max(MAGNIFIED_PX);
    let bar = bar(scale, columns, caption)?;
    let white = [1.0; 3];
    // Around a narrow picture, so that its edges are seen.
    let (grey, margin) = ([0.6; 3], (columns - width * factor) / 2);
    let mut pixels = Vec::with_capacity(columns * (height * factor + bar.height));
    for line in colors.chunks(width) {
        for _ in 0..factor {
            let at = |x: usize| line.get(x.checked_sub(margin)? / factor).copied();
            pixels.extend((0..columns).map(|x| at(x).unwrap_or(grey)));
        }
    }
    for row in bar.rgb.chunks(bar.width) {
        pixels.extend((0..columns).map(|x| row.get(x).copied().unwrap_or(white)));
    }
    let size = |n: usize| u32::try_from(n).map_err(|_| Error::invalid("picture", "too large for PNG"));
    let size = (size(columns)?, size(pixels.len() / columns)?);
    png::write(size, &pixels, ToneMap::Linear, 0.0, png::Depth::Eight)
}

/// The bar with its numbers, about `columns` pixels wide.
fn bar(scale: Scale, columns: usize, caption: &str) -> Result<image::Image> {
    let units = columns as f64 / BAR_SCALE as f64;
    let mut scene = Scene::new(units, BAR_HEIGHT);
    let (left, right) = (24.0, units - 24.0);
    let text = |scene: &mut Scene, x: f64, y: f64, anchor: TextAnchor, content: String| {
        let (size, rotate, bold, color) = (10, None, false, None);
        scene.add(Primitive::Text { x, y, content, size, anchor, rotate, bold, color });
    };
    // A letter takes about 5.5 units.
    let letters = ((right - left) / 5.5) as usize;
    text(&mut scene, left, 14.0, TextAnchor::Start, label(caption, letters));
    let step = (right - left) / STEPS as f64;
    for i in 0..STEPS {
        let [r, g, b] = scale.color((i as f32 + 0.5) / STEPS as f32);
        scene.add(Primitive::Rect {
            x: left + i as f64 * step,
            y: 19.0,
            // No gap between two.
            width: step + if i + 1 < STEPS { 0.5 } else { 0.0 },
            height: 12.0,
            fill: Color::Rgb(r, g, b),
            stroke: None,
            stroke_width: None,
            opacity: None,
        });
    }
    let (low, high) = scale.ends();
    for i in 0..=4 {
        let t = f64::from(i) / 4.0;
        let value = f64::from(low) + t * (f64::from(high) - f64::from(low));
        text(&mut scene, left + t * (right - left), 43.0, TextAnchor::Middle, number(value, low < 0.0));
    }
    image::read(&Picture::new(scene).png()?, image::MAX_PIXELS)
}

/// Three digits, without zeros at the end.
fn number(value: f64, signed: bool) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let short = if (1e-3..1e4).contains(&value.abs()) {
        let decimals = (2.0 - value.abs().log10().floor()).max(0.0) as usize;
        let fixed = format!("{:.decimals$}", value.abs());
        if decimals > 0 { fixed.trim_end_matches('0').trim_end_matches('.').to_owned() } else { fixed }
    } else {
        format!("{:.0e}", value.abs())
    };
    match (value < 0.0, signed) {
        (true, _) => format!("−{short}"),
        (false, true) => format!("+{short}"),
        (false, false) => short,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::color::srgb_encode;

    fn levels(rgb: [f32; 3]) -> [u8; 3] {
        rgb.map(|v| (srgb_encode(v) * 255.0 + 0.5) as u8)
    }

    #[test]
    fn colors_stand_where_their_values_are() {
        let scale = Scale::Signed { limit: 2.0 };
        let values = [-9.0, 0.0, 2.0, f32::NAN, 0.0, 0.0];
        let picture = image::read(&write(&values, 3, scale, "a − b").unwrap(), 1 << 20).unwrap();
        assert_eq!(picture.width, 480);
        // Each pixel is 160 wide and high.
        let at = |x: usize, y: usize| levels(picture.rgb[(y * 160 + 80) * 480 + x * 160 + 80]);
        assert_eq!([at(0, 0), at(1, 0), at(2, 0)], [[33, 102, 172], [255, 255, 255], [178, 24, 43]]);
        assert_eq!([at(0, 1), at(1, 1)], [[0, 255, 0], [255, 255, 255]]);
        assert!(picture.height > 2 * 160 + 80, "the bar is below");
        // A column of two pixels stands in the middle.
        let picture = image::read(&write(&[0.0; 2], 1, scale, "").unwrap(), 1 << 20).unwrap();
        let at = |x: usize| levels(picture.rgb[100 * 480 + x]);
        assert_eq!([at(119), at(120), at(359), at(360)].map(|c| c == [255; 3]), [false, true, true, false]);
        let magma = Scale::Magma { max: 1.0 };
        let picture = image::read(&write(&[0.0; 700], 700, magma, "").unwrap(), 1 << 20).unwrap();
        assert_eq!((picture.width, levels(picture.rgb[650])), (700, [0, 0, 4]));
        assert_eq!(magma.color_of(7.0), [252, 253, 191]);
    }

    #[test]
    fn numbers_are_short() {
        for (value, signed, expected) in [
            (0.0, true, "0"),
            (0.25, false, "0.25"),
            (-0.05, true, "−0.05"),
            (1.0, true, "+1"),
            (1500.0, false, "1500"),
            (2e-5, false, "2e-5"),
            (0.333_333, false, "0.333"),
        ] {
            assert_eq!(number(value, signed), expected);
        }
    }

    #[test]
    fn wrong_pictures_are_errors() {
        let magma = Scale::Magma { max: 1.0 };
        assert!(write(&[], 1, magma, "").is_err() && write(&[0.0; 3], 2, magma, "").is_err());
        for scale in [Scale::Magma { max: 0.0 }, Scale::Signed { limit: f32::NAN }] {
            assert!(write(&[0.0], 1, scale, "").is_err());
        }
    }
}

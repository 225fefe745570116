//! PNG: a picture for the screen.
//!
//! RGB without alpha, 8 or 16 bits per channel, with the `sRGB` chunk (perceptual intent). Rounding is to the
//! nearest level, without dither, so equal films give equal files.

use ::png::{BitDepth, ColorType, Encoder, SrgbRenderingIntent};

use super::invalid;
use crate::Result;
use crate::film::ToneMap;

const FORMAT: &str = "PNG";

/// Levels per channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Depth {
    /// 256 levels.
    #[default]
    Eight,
    /// 65536 levels.
    Sixteen,
}

/// Writes linear sRGB light, row by row, through a tone curve.
pub fn write(
    size: (u32, u32),
    rgb: &[[f32; 3]],
    tone_map: ToneMap,
    exposure_ev: f32,
    depth: Depth,
) -> Result<Vec<u8>> {
    let screen: Vec<[f32; 3]> = rgb.iter().map(|&rgb| tone_map.encode(rgb, exposure_ev)).collect();
    write_screen(size, &screen, depth)
}

/// Writes sRGB-encoded colours, each channel in [0, 1], row by row.
pub fn write_screen((width, height): (u32, u32), rgb: &[[f32; 3]], depth: Depth) -> Result<Vec<u8>> {
    if width == 0 || height == 0 || rgb.len() as u64 != u64::from(width) * u64::from(height) {
        return Err(invalid(FORMAT, format_args!("{} pixels do not make {width} x {height}", rgb.len())));
    }
    let levels = rgb.iter().flatten();
    let data: Vec<u8> = match depth {
        Depth::Eight => levels.map(|v| (v * 255.0 + 0.5) as u8).collect(),
        Depth::Sixteen => levels.flat_map(|v| ((v * 65535.0 + 0.5) as u16).to_be_bytes()).collect(),
    };
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, width, height);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(match depth {
        Depth::Eight => BitDepth::Eight,
        Depth::Sixteen => BitDepth::Sixteen,
    });
    encoder.set_source_srgb(SrgbRenderingIntent::Perceptual);
    let mut writer = encoder.write_header().map_err(|e| invalid(FORMAT, e))?;
    writer.write_image_data(&data).map_err(|e| invalid(FORMAT, e))?;
    writer.finish().map_err(|e| invalid(FORMAT, e))?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::image;

    #[test]
    fn linear_light_round_trips() {
        let rgb: Vec<[f32; 3]> = (0..12).map(|i| [i as f32 / 11.0, 0.5, 1.0 - i as f32 / 11.0]).collect();
        for (depth, tolerance) in [(Depth::Eight, 0.005), (Depth::Sixteen, 2e-5)] {
            let bytes = write((4, 3), &rgb, ToneMap::Linear, 0.0, depth).unwrap();
            assert!(bytes.windows(4).any(|w| w == b"sRGB"));
            let back = image::read(&bytes, 100).unwrap();
            assert_eq!((back.width, back.height), (4, 3));
            for (a, b) in back.rgb.iter().zip(&rgb) {
                assert!((0..3).all(|c| (a[c] - b[c]).abs() <= tolerance), "{depth:?}: {a:?} {b:?}");
            }
        }
    }

    #[test]
    fn wrong_sizes_are_errors() {
        for size in [(0, 0), (2, 2), (3, 0), (u32::MAX, u32::MAX)] {
            assert!(write(size, &[[0.0; 3]; 3], ToneMap::Agx, 0.0, Depth::Eight).is_err(), "{size:?}");
        }
    }

    #[test]
    fn bytes_repeat() {
        let rgb = [[0.1, 0.2, 0.3]; 6];
        let write = || write((3, 2), &rgb, ToneMap::Agx, 0.5, Depth::Eight).unwrap();
        assert_eq!(write(), write());
    }
}

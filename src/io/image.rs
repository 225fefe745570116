//! Pictures in: PNG, JPEG, Radiance HDR and OpenEXR to linear sRGB.
//!
//! The format is known by its first bytes. 8- and 16-bit pictures are taken as sRGB-encoded (colour profiles and
//! gamma chunks are not read), float pictures as linear. Alpha is dropped; grey becomes equal channels.

use std::io::Cursor;

use ::image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::{check_pixels, exr, invalid};
use crate::spectrum::color::srgb_decode;
use crate::{Error, Result};

/// Largest picture that is read unless told otherwise: 8192 x 8192, 768 MiB.
pub const MAX_PIXELS: u64 = 1 << 26;

/// Linear sRGB picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Pixels, row by row from the top left.
    pub rgb: Vec<[f32; 3]>,
}

/// Is it a picture of light, of any brightness (EXR, Radiance HDR), and not of a screen?
pub fn is_light(bytes: &[u8]) -> bool {
    exr::is_exr(bytes) || bytes.starts_with(b"#?")
}

/// Reads a picture of at most `max_pixels` pixels.
pub fn read(bytes: &[u8], max_pixels: u64) -> Result<Image> {
    // The most pixels that one byte of the format can stand for: deflate makes 1032 bytes of 8 grey pixels;
    // JPEG needs at least a bit for 64 pixels; Radiance runs repeat a pixel 2^24 times but pictures do not.
    let (format, name, pixels_per_byte) = match bytes {
        bytes if exr::is_exr(bytes) => return exr::read(bytes, max_pixels),
        [0x89, b'P', b'N', b'G', ..] => (ImageFormat::Png, "PNG", 8256),
        [0xff, 0xd8, 0xff, ..] => (ImageFormat::Jpeg, "JPEG", 1024),
        [b'#', b'?', ..] => (ImageFormat::Hdr, "Radiance HDR", 8256),
        _ => {
            return Err(Error::invalid("picture", "the first bytes are not those of PNG, JPEG, HDR or EXR"));
        }
    };
    let fail = |e: ::image::ImageError| invalid(name, e);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    // 16 bytes per pixel is RGBA in f32; as much again for the decoder's own buffers.
    limits.max_alloc = Some(max_pixels.saturating_mul(32).max(1 << 20));
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(fail)?;
    let (width, height) = decoder.dimensions();
    check_pixels(name, (width.into(), height.into()), max_pixels, (bytes.len(), pixels_per_byte))?;
    let picture = DynamicImage::from_decoder(decoder).map_err(fail)?;
    let rgb: Vec<[f32; 3]> = match picture {
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
            picture.into_rgb32f().pixels().map(|p| p.0).collect()
        }
        DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_) => {
            let decode = |v: u16| srgb_decode(f32::from(v) / 65535.0);
            picture.into_rgb16().pixels().map(|p| p.0.map(decode)).collect()
        }
        _ => {
            let table: [f32; 256] = std::array::from_fn(|i| srgb_decode(i as f32 / 255.0));
            picture.into_rgb8().pixels().map(|p| p.0.map(|v| table[usize::from(v)])).collect()
        }
    };
    Ok(Image { width: width as usize, height: height as usize, rgb })
}

#[cfg(test)]
mod tests {
    use ::image::codecs::hdr::HdrEncoder;
    use ::image::codecs::jpeg::JpegEncoder;
    use ::image::{GrayImage, Rgb};

    use super::*;
    use crate::film::ToneMap;
    use crate::io::damage::damage;
    use crate::io::png::{self, Depth};

    fn hdr() -> Vec<u8> {
        let mut bytes = Vec::new();
        let pixels: Vec<Rgb<f32>> = (0..12 * 9).map(|i| Rgb([i as f32, 0.25, 1000.0])).collect();
        HdrEncoder::new(&mut bytes).encode(&pixels, 12, 9).unwrap();
        bytes
    }

    fn jpeg() -> Vec<u8> {
        let mut bytes = Vec::new();
        let pixels: Vec<u8> = (0..17 * 11).flat_map(|_| [200, 100, 50]).collect();
        JpegEncoder::new_with_quality(&mut bytes, 95)
            .encode(&pixels, 17, 11, ::image::ExtendedColorType::Rgb8)
            .unwrap();
        bytes
    }

    #[test]
    fn formats_are_linear() {
        let picture = read(&hdr(), 1000).unwrap();
        assert_eq!((picture.width, picture.height), (12, 9));
        for (i, rgb) in picture.rgb.iter().enumerate() {
            // Shared exponent: 8 bits of the largest channel.
            assert!((rgb[2] - 1000.0).abs() < 4.0 && (rgb[0] - i as f32).abs() < 4.0, "{i}: {rgb:?}");
        }
        let picture = read(&jpeg(), 1000).unwrap();
        assert_eq!((picture.width, picture.height), (17, 11));
        let expected = [200.0, 100.0, 50.0].map(|v: f32| srgb_decode(v / 255.0));
        assert!(picture.rgb.iter().all(|p| (0..3).all(|c| (p[c] - expected[c]).abs() < 0.02)));

        let mut grey = Vec::new();
        let source = GrayImage::from_fn(5, 2, |x, _| [x as u8 * 50].into());
        source.write_to(&mut Cursor::new(&mut grey), ImageFormat::Png).unwrap();
        assert_eq!(read(&grey, 100).unwrap().rgb[7], [srgb_decode(100.0 / 255.0); 3]);
    }

    #[test]
    fn limits_are_checked_first() {
        assert!(read(&hdr(), 12 * 9 - 1).is_err());
        assert!(read(&jpeg(), 17 * 11 - 1).is_err());
        let mut png = png::write((4, 3), &[[0.5; 3]; 12], ToneMap::Linear, 0.0, Depth::Eight).unwrap();
        assert!(read(&png, 11).is_err());
        assert!(read(&png, 12).is_ok());
        // A header that promises 2^31 - 1 pixels a side.
        png[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff]);
        assert!(read(&png, u64::MAX).is_err());
        let hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 60000 +X 60000\n\x02\x02\xea\x60";
        assert!(read(hdr, u64::MAX).is_err());
        assert!(read(b"", 10).is_err() && read(b"GIF89a", 10).is_err());
    }

    #[test]
    fn damaged_files_are_errors() {
        let png = png::write((4, 3), &[[0.5; 3]; 12], ToneMap::Linear, 0.0, Depth::Eight).unwrap();
        for bytes in [png, hdr(), jpeg()] {
            damage(&bytes, 2000, |b| read(b, 1 << 16));
        }
    }
}

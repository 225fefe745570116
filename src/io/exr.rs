//! OpenEXR: a [`Film`] with all its layers out, pictures and named channels in.
//!
//! One part, scan lines, ZIP (lossless). The data window is the crop, the display window the full picture.
//!
//! | channels                 | type  | what                                                             |
//! |--------------------------|-------|------------------------------------------------------------------|
//! | `R G B A`                | f32   | all light, linear sRGB (`chromaticities` says so); coverage      |
//! | `direct.R` `.G` `.B`     | f32   | light after at most one scattering event                         |
//! | `indirect.R` `.G` `.B`   | f32   | the rest                                                         |
//! | `variance.R` `.G` `.B`   | f32   | variance of the mean of `R G B`                                  |
//! | `albedo.R` `.G` `.B`     | f32   | reflectance + transmittance of the first surface                 |
//! | `N.X` `.Y` `.Z`          | f32   | normal of the first surface, world                               |
//! | `Z`                      | f32   | distance from the camera, mm; infinite where there is no surface |
//! | `uv.U` `.V`              | f32   | texture coordinates                                              |
//! | `petal_id` `organ_id`    | u32   | of the pixel's first sample; 0 is none                           |
//! | `samples`                | u32   | number of samples                                                |
//!
//! A denoised picture has its light without noise in `R G B`, the film's own in `noisy.R` `.G` `.B`, and the variance of that in
//! `noisy_variance.R` `.G` `.B` in place of `variance`.
//!
//! The pixels' bytes depend on the film only. Reading keeps to one flat part without subsampled channels.

use std::collections::BTreeMap;
use std::io::Cursor;

use ::exr::meta::attribute::{AttributeValue, Chromaticities, IntegerBounds, LineOrder, Text};
use ::exr::meta::header::{Header, ImageAttributes, LayerAttributes};
use ::exr::meta::{BlockDescription, MetaData};
use ::exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image as ExrImage, Layer,
    ReadChannels, ReadLayers, Vec2 as Pair, WritableImage, read as reader,
};

use super::{Image, check_pixels, invalid};
use crate::film::{Film, Pixel, PixelRect};
use crate::{Error, Result};

const FORMAT: &str = "EXR";

/// Rec. 709 primaries and D65, as xy.
const SRGB: [(f32, f32); 4] = [(0.64, 0.33), (0.3, 0.6), (0.15, 0.06), (0.3127, 0.329)];

/// How a picture came to be; stored as attributes of the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Metadata {
    /// Attribute `rosarium:version`.
    pub version: String,
    /// Attribute `commandLine`.
    pub command_line: String,
    /// Attribute `seed`, a string of decimal digits (the format has no 64-bit integer).
    pub seed: u64,
    /// Attribute `spp`: samples per pixel that were asked for; the channel `samples` says what was done.
    pub spp: u32,
    /// Attribute `sceneHash`.
    pub scene_hash: String,
    /// Attribute `renderTimeSeconds`.
    pub render_time_s: f32,
    /// Attribute `denoiser`: what took the noise away; none where it is empty.
    pub denoiser: String,
}

/// Samples of one channel, row by row.
#[derive(Clone, Debug, PartialEq)]
pub enum Plane {
    /// 16-bit floats (widened) and 32-bit floats.
    F32(Vec<f32>),
    /// 32-bit unsigned integers.
    U32(Vec<u32>),
}

/// All channels of one part.
#[derive(Clone, Debug, PartialEq)]
pub struct Channels {
    /// Columns of the data window.
    pub width: usize,
    /// Rows of the data window.
    pub height: usize,
    /// Column and row of the data window's top left pixel.
    pub origin: (i32, i32),
    /// Origin, then size, of the display window.
    pub display: ((i32, i32), (usize, usize)),
    /// Samples by the channel's full name.
    pub planes: BTreeMap<String, Plane>,
    /// Text and number attributes that are not part of the format.
    pub attributes: BTreeMap<String, String>,
}

impl Channels {
    /// Float samples of a channel.
    pub fn f32(&self, name: &str) -> Result<&[f32]> {
        match self.planes.get(name) {
            Some(Plane::F32(values)) => Ok(values),
            Some(Plane::U32(_)) => Err(invalid(FORMAT, format_args!("channel `{name}` holds integers"))),
            None => Err(invalid(FORMAT, format_args!("there is no channel `{name}`"))),
        }
    }

    /// Colours of the channels `LAYER.R`, `.G` and `.B`; of the empty layer `R G B`, or grey in `Y`.
    pub fn rgb(&self, layer: &str) -> Result<Vec<[f32; 3]>> {
        let full =
            |channel: &str| if layer.is_empty() { channel.to_owned() } else { format!("{layer}.{channel}") };
        if !layer.is_empty() && !self.planes.contains_key(&full("R")) {
            let layers: Vec<&str> = self.planes.keys().filter_map(|name| name.strip_suffix(".R")).collect();
            let known = if layers.is_empty() { "no layers".to_owned() } else { layers.join(", ") };
            return Err(invalid(
                FORMAT,
                format_args!("there is no layer `{layer}` of colours; the file has {known}"),
            ));
        }
        let grey = layer.is_empty() && self.planes.contains_key("Y") && !self.planes.contains_key("R");
        let [r, g, b] = if grey { ["Y"; 3] } else { ["R", "G", "B"] };
        let (r, g, b) = (self.f32(&full(r))?, self.f32(&full(g))?, self.f32(&full(b))?);
        Ok(r.iter().zip(g).zip(b).map(|((&r, &g), &b)| [r, g, b]).collect())
    }
}

/// Writes a film with all its layers.
pub fn write(film: &Film, metadata: &Metadata) -> Result<Vec<u8>> {
    write_film(film, None, metadata)
}

/// Writes a film with all its layers, and the light of it without noise, linear sRGB.
pub fn write_denoised(film: &Film, denoised: &[[f32; 3]], metadata: &Metadata) -> Result<Vec<u8>> {
    if denoised.len() != film.pixels().len() {
        let what = format_args!("{} pixels for a film of {}", denoised.len(), film.pixels().len());
        return Err(invalid(FORMAT, what));
    }
    write_film(film, Some(denoised), metadata)
}

fn write_film(film: &Film, denoised: Option<&[[f32; 3]]>, metadata: &Metadata) -> Result<Vec<u8>> {
    type Get = fn(&Pixel) -> f32;
    type GetId = fn(&Pixel) -> u32;
    const FLOATS: [(&str, Get); 22] = [
        ("R", |p| p.beauty()[0]),
        ("G", |p| p.beauty()[1]),
        ("B", |p| p.beauty()[2]),
        ("A", Pixel::alpha),
        ("direct.R", |p| p.direct()[0]),
        ("direct.G", |p| p.direct()[1]),
        ("direct.B", |p| p.direct()[2]),
        ("indirect.R", |p| p.indirect()[0]),
        ("indirect.G", |p| p.indirect()[1]),
        ("indirect.B", |p| p.indirect()[2]),
        ("variance.R", |p| p.variance()[0]),
        ("variance.G", |p| p.variance()[1]),
        ("variance.B", |p| p.variance()[2]),
        ("albedo.R", |p| p.albedo()[0]),
        ("albedo.G", |p| p.albedo()[1]),
        ("albedo.B", |p| p.albedo()[2]),
        ("N.X", |p| p.normal().x),
        ("N.Y", |p| p.normal().y),
        ("N.Z", |p| p.normal().z),
        ("Z", Pixel::depth_mm),
        ("uv.U", |p| p.uv().x),
        ("uv.V", |p| p.uv().y),
    ];
    const IDS: [(&str, GetId); 3] =
        [("petal_id", Pixel::petal_id), ("organ_id", Pixel::organ_id), ("samples", Pixel::samples)];

    let pixels = film.pixels();
    let floats = FLOATS.iter().map(|(name, get)| {
        let name = match (*name, denoised) {
            ("R" | "G" | "B", Some(_)) => format!("noisy.{name}"),
            (name, Some(_)) if name.starts_with("variance.") => format!("noisy_{name}"),
            (name, _) => name.to_owned(),
        };
        AnyChannel::new(text(&name), FlatSamples::F32(pixels.iter().map(get).collect()))
    });
    let clean = denoised.into_iter().flat_map(|rgb| {
        ["R", "G", "B"]
            .into_iter()
            .enumerate()
            .map(|(c, name)| AnyChannel::new(name, FlatSamples::F32(rgb.iter().map(|rgb| rgb[c]).collect())))
    });
    let ids = IDS
        .iter()
        .map(|(name, get)| AnyChannel::new(*name, FlatSamples::U32(pixels.iter().map(get).collect())));
    let denoiser =
        (!metadata.denoiser.is_empty()).then(|| ("denoiser", AttributeValue::Text(text(&metadata.denoiser))));
    let PixelRect { x0, y0, .. } = film.crop();
    let resolution = film.resolution();
    let display = IntegerBounds::from_dimensions((resolution.x as usize, resolution.y as usize));
    encode(
        ((x0 as i32, y0 as i32), (film.width() as usize, film.height() as usize)),
        display,
        floats.chain(clean).chain(ids),
        [
            ("rosarium:version", AttributeValue::Text(text(&metadata.version))),
            ("commandLine", AttributeValue::Text(text(&metadata.command_line))),
            ("seed", AttributeValue::Text(text(&metadata.seed.to_string()))),
            ("spp", AttributeValue::I32(i32::try_from(metadata.spp).unwrap_or(i32::MAX))),
            ("sceneHash", AttributeValue::Text(text(&metadata.scene_hash))),
            ("renderTimeSeconds", AttributeValue::F32(metadata.render_time_s)),
        ]
        .into_iter()
        .chain(denoiser),
    )
}

/// Writes named channels, the inverse of [`read_channels`]; attributes become text.
pub fn write_channels(channels: &Channels) -> Result<Vec<u8>> {
    let Channels { width, height, origin, display, planes, attributes } = channels;
    let pixels = width.saturating_mul(*height);
    if pixels == 0 || planes.is_empty() {
        return Err(invalid(FORMAT, "a picture needs pixels and channels"));
    }
    let mut list = Vec::new();
    for (name, plane) in planes {
        let (samples, count) = match plane {
            Plane::F32(v) => (FlatSamples::F32(v.clone()), v.len()),
            Plane::U32(v) => (FlatSamples::U32(v.clone()), v.len()),
        };
        if count != pixels {
            return Err(invalid(
                FORMAT,
                format_args!("channel `{name}` has {count} samples for {pixels} pixels"),
            ));
        }
        list.push(AnyChannel::new(text(name), samples));
    }
    let ((x, y), (w, h)) = *display;
    let attributes =
        attributes.iter().map(|(name, value)| (name.as_str(), AttributeValue::Text(text(value))));
    encode((*origin, (*width, *height)), IntegerBounds::new((x, y), (w, h)), list, attributes)
}

/// One part with a data window (origin, size), linear sRGB.
fn encode<'a>(
    (origin, size): ((i32, i32), (usize, usize)),
    display: IntegerBounds,
    channels: impl IntoIterator<Item = AnyChannel<FlatSamples>>,
    others: impl IntoIterator<Item = (&'a str, AttributeValue)>,
) -> Result<Vec<u8>> {
    let layer = Layer::new(
        Pair(size.0, size.1),
        LayerAttributes::default().with_position(Pair(origin.0, origin.1)),
        Encoding {
            compression: Compression::ZIP16,
            blocks: Blocks::ScanLines,
            line_order: LineOrder::Increasing,
        },
        AnyChannels::sort(channels.into_iter().collect()),
    );
    let mut attributes = ImageAttributes::new(display);
    let [red, green, blue, white] = SRGB.map(|(x, y)| Pair(x, y));
    attributes.chromaticities = Some(Chromaticities { red, green, blue, white });
    attributes.other.extend(others.into_iter().map(|(name, value)| (text(name), value)));
    let mut bytes = Cursor::new(Vec::new());
    ExrImage::new(attributes, layer).write().to_buffered(&mut bytes).map_err(|e| invalid(FORMAT, e))?;
    Ok(bytes.into_inner())
}

/// UTF-8 as it is: the crate's own conversion refuses what is not Latin-1.
fn text(s: &str) -> Text {
    Text::from_slice_unchecked(s.as_bytes())
}

/// Reads the channels of the first part.
pub fn read_channels(bytes: &[u8], max_pixels: u64) -> Result<Channels> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|e| invalid(FORMAT, e))?;
    for header in &meta.headers {
        check_header(header, bytes.len(), max_pixels)?;
    }
    let image = reader()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(|e| invalid(FORMAT, e))?;
    let layer = image.layer_data;
    let planes = layer.channel_data.list.into_iter().map(|channel| {
        let plane = match channel.sample_data {
            FlatSamples::F16(v) => Plane::F32(v.into_iter().map(|v| v.to_f32()).collect()),
            FlatSamples::F32(v) => Plane::F32(v),
            FlatSamples::U32(v) => Plane::U32(v),
        };
        (string(&channel.name), plane)
    });
    let others = image.attributes.other.iter().chain(&layer.attributes.other);
    let attributes = others.filter_map(|(name, value)| {
        let value = match value {
            AttributeValue::Text(t) => string(t),
            AttributeValue::I32(v) => v.to_string(),
            AttributeValue::F32(v) => v.to_string(),
            AttributeValue::F64(v) => v.to_string(),
            _ => return None,
        };
        Some((string(name), value))
    });
    let display = image.attributes.display_window;
    Ok(Channels {
        width: layer.size.width(),
        height: layer.size.height(),
        origin: (layer.attributes.layer_position.x(), layer.attributes.layer_position.y()),
        display: (
            (display.position.x(), display.position.y()),
            (display.size.width(), display.size.height()),
        ),
        planes: planes.collect(),
        attributes: attributes.collect(),
    })
}

/// Do the bytes start as a file of this format does?
pub fn is_exr(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01])
}

/// Reads the picture in `R G B` (or grey in `Y`) of the first part; the data window is the picture.
pub fn read(bytes: &[u8], max_pixels: u64) -> Result<Image> {
    check_chromaticities(bytes)?;
    let channels = read_channels(bytes, max_pixels)?;
    Ok(Image { width: channels.width, height: channels.height, rgb: channels.rgb("")? })
}

/// Refuses pictures whose numbers are not linear sRGB.
pub fn check_chromaticities(bytes: &[u8]) -> Result<()> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|e| invalid(FORMAT, e))?;
    if let Some(c) = meta.headers.first().and_then(|h| h.shared_attributes.chromaticities) {
        let points = [c.red, c.green, c.blue, c.white].map(|p| (p.x(), p.y()));
        let far = |(a, b): &((f32, f32), (f32, f32))| (a.0 - b.0).abs().max((a.1 - b.1).abs()) > 2e-3;
        if points.into_iter().zip(SRGB).any(|pair| far(&pair)) {
            return Err(Error::Unsupported(
                "EXR pictures whose chromaticities are not those of sRGB; convert to linear Rec. 709".into(),
            ));
        }
    }
    Ok(())
}

/// Refuses what would take more memory than the bytes can account for, and what [`read_channels`] cannot read.
fn check_header(header: &Header, bytes: usize, max_pixels: u64) -> Result<()> {
    if header.deep {
        return Err(Error::Unsupported("EXR with deep data".into()));
    }
    let channels = &header.channels.list;
    if channels.iter().any(|c| c.sampling != Pair(1, 1)) {
        return Err(Error::Unsupported("EXR with subsampled channels".into()));
    }
    let bytes_per_pixel: u64 = channels.iter().map(|c| c.sample_type.bytes_per_sample() as u64).sum();
    // Deflate reaches 1032:1 and the other methods less; the offset tables and block headers take from that.
    let pixels_per_byte = (2048 / bytes_per_pixel.max(1)).max(1);
    let Pair(width, height) = header.layer_size;
    check_pixels(FORMAT, (width as u64, height as u64), max_pixels, (bytes, pixels_per_byte))?;
    if let BlockDescription::Tiles(tiles) = header.blocks {
        let Pair(w, h) = tiles.tile_size;
        if (w as u64).saturating_mul(h as u64) > 1 << 24 {
            return Err(invalid(FORMAT, format_args!("tiles of {w} x {h} pixels")));
        }
    }
    Ok(())
}

fn string(text: &Text) -> String {
    String::from_utf8_lossy(text.as_slice()).into_owned()
}

#[cfg(test)]
mod tests {
    use glam::{UVec2, Vec2, Vec3};

    use super::*;
    use crate::film::FilmSample;
    use crate::io::damage::damage;
    use crate::math::sampler::hash_to_unit;

    const LIMIT: u64 = 1 << 20;

    fn film(resolution: UVec2, crop: PixelRect) -> Film {
        let mut film = Film::new(resolution, crop).unwrap();
        for k in 0..film.pixels().len() {
            let p = film.position(k);
            let v = |i: u32| hash_to_unit(p.x * 7919 + p.y * 104_729 + i) as f32;
            for i in 0..3 {
                film.pixels_mut()[k].add(&FilmSample {
                    direct: [v(i), v(i + 10), v(i + 20)],
                    indirect: [v(i + 30), v(i + 40), v(i + 50)],
                    albedo: [0.25, 0.5, 0.75],
                    normal: Vec3::new(0.6, 0.0, 0.8),
                    depth_mm: 100.0 + p.x as f32,
                    uv: Vec2::new(v(60), v(61)),
                    petal_id: p.x,
                    organ_id: u32::MAX - p.y,
                    alpha: if p.x == 5 { 0.0 } else { 1.0 },
                });
            }
        }
        film
    }

    fn example() -> (Film, Metadata) {
        let metadata = Metadata {
            version: "1.2.3".into(),
            command_line: "rosarium render höhe.toml --seed 3".into(),
            seed: u64::MAX,
            spp: 3,
            scene_hash: "abc".into(),
            render_time_s: 1.5,
            denoiser: String::new(),
        };
        (film(UVec2::new(40, 30), PixelRect { x0: 3, y0: 5, x1: 24, y1: 29 }), metadata)
    }

    #[test]
    fn film_round_trip() {
        let (film, metadata) = example();
        let bytes = write(&film, &metadata).unwrap();
        let back = read_channels(&bytes, LIMIT).unwrap();
        assert_eq!((back.width, back.height, back.origin), (21, 24, (3, 5)));
        assert_eq!(back.display, ((0, 0), (40, 30)));
        assert_eq!(back.planes.len(), 25);
        for (k, pixel) in film.pixels().iter().enumerate() {
            for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
                let get = |layer: &str| back.f32(&format!("{layer}{name}")).unwrap()[k];
                assert_eq!(get(""), pixel.beauty()[c]);
                assert_eq!(get("direct."), pixel.direct()[c]);
                assert_eq!(get("indirect."), pixel.indirect()[c]);
                assert_eq!(get("variance."), pixel.variance()[c]);
                assert_eq!(get("albedo."), pixel.albedo()[c]);
            }
            let get = |name: &str| back.f32(name).unwrap()[k];
            assert_eq!([get("N.X"), get("N.Y"), get("N.Z")], pixel.normal().to_array());
            assert_eq!([get("uv.U"), get("uv.V")], pixel.uv().to_array());
            assert_eq!((get("Z"), get("A")), (pixel.depth_mm(), pixel.alpha()));
        }
        let ids = |name: &str, get: fn(&Pixel) -> u32| {
            assert_eq!(back.planes[name], Plane::U32(film.pixels().iter().map(get).collect()), "{name}");
        };
        ids("petal_id", Pixel::petal_id);
        ids("organ_id", Pixel::organ_id);
        ids("samples", Pixel::samples);
        for (name, value) in [
            ("rosarium:version", "1.2.3"),
            ("commandLine", "rosarium render höhe.toml --seed 3"),
            ("seed", "18446744073709551615"),
            ("spp", "3"),
            ("sceneHash", "abc"),
            ("renderTimeSeconds", "1.5"),
        ] {
            assert_eq!(back.attributes[name], value);
        }
        assert_eq!(read_channels(&write_channels(&back).unwrap(), LIMIT).unwrap(), back);
        assert_eq!(back.rgb("albedo").unwrap(), film.pixels().iter().map(Pixel::albedo).collect::<Vec<_>>());
        let error = back.rgb("glow").unwrap_err().to_string();
        assert!(error.contains("albedo, direct, indirect, variance"), "{error}");
        let short = Channels { width: back.width + 1, ..back };
        assert!(write_channels(&short).is_err());
        let picture = read(&bytes, LIMIT).unwrap();
        assert_eq!((picture.width, picture.height, &picture.rgb), (21, 24, &film.beauty()));
        assert!(is_exr(&bytes) && !is_exr(b"v/1"));
    }

    #[test]
    fn denoised_light_keeps_the_noisy() {
        let (film, metadata) = example();
        let clean: Vec<[f32; 3]> = (0..21 * 24).map(|i| [i as f32, 0.5, 2.0]).collect();
        let metadata = Metadata { denoiser: "filter".into(), ..metadata };
        let bytes = write_denoised(&film, &clean, &metadata).unwrap();
        let back = read_channels(&bytes, LIMIT).unwrap();
        assert_eq!(back.rgb("").unwrap(), clean);
        assert_eq!(back.rgb("noisy").unwrap(), film.beauty());
        let variance: Vec<[f32; 3]> = film.pixels().iter().map(Pixel::variance).collect();
        assert_eq!(back.rgb("noisy_variance").unwrap(), variance);
        assert!(!back.planes.contains_key("variance.R") && back.planes.len() == 28);
        assert_eq!(back.attributes["denoiser"], "filter");
        assert!(write_denoised(&film, &clean[1..], &metadata).is_err());
    }

    #[test]
    fn damaged_files_are_errors() {
        let bytes =
            write(&film(UVec2::new(9, 7), PixelRect::full(UVec2::new(9, 7))), &Metadata::default()).unwrap();
        assert!(read_channels(&bytes[..bytes.len() - 1], LIMIT).is_err());
        assert!(read_channels(b"", LIMIT).is_err());
        assert!(read(b"not a picture", LIMIT).is_err());
        damage(&bytes, 3000, |b| read(b, LIMIT));
    }

    #[test]
    fn promises_are_checked_first() {
        let (film, metadata) = example();
        let bytes = write(&film, &metadata).unwrap();
        let window = bytes.windows(10).position(|w| w == b"dataWindow").unwrap();
        let x_max = window + b"dataWindow\0box2i\0".len() + 4 + 8;
        let mut huge = bytes.clone();
        huge[x_max..x_max + 8].copy_from_slice(&[0xff, 0xff, 0xff, 0x2f, 0xff, 0xff, 0xff, 0x2f]);
        assert!(read_channels(&huge, u64::MAX).is_err());
        assert!(read_channels(&bytes, 21 * 24 - 1).is_err());
    }
}

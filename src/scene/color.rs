//! Colours of a description to spectra: reflectances as they are, lights scaled to luminance 1.

use super::assets::Assets;
use super::description::{SpectrumDescription, SpectrumTable};
use super::key::Key;
use crate::Result;
use crate::spectrum::color::srgb_decode;
use crate::spectrum::illuminant::Illuminant;
use crate::spectrum::observer::Observer;
use crate::spectrum::{Spectrum, emission_from_rgb, table, upsample};

/// Share of the light, 0 to 1, that a surface reflects or transmits.
pub(super) fn reflectance(d: &SpectrumDescription, key: &Key, assets: &dyn Assets) -> Result<Spectrum> {
    match (d, rgb(d, key)?) {
        (SpectrumDescription::Constant(v), _) => share(*v, key).map(|v| Spectrum::Constant(v as f32)),
        (_, Some(rgb)) => {
            rgb_shares(rgb, key)?;
            key.name(upsample::reflectance_from_rgb(rgb, ""))
        }
        (SpectrumDescription::Table(t), _) if t.file.is_some() => from_file(t, key, assets),
        _ => Err(key.invalid("a light's spectrum is no reflectance; give a number, a colour or a file")),
    }
}

/// Reflectance and transmittance of one side; colours are made into spectra together.
pub(super) fn reflectance_and_transmittance(
    r: (&SpectrumDescription, &Key),
    t: (&SpectrumDescription, &Key),
    assets: &dyn Assets,
) -> Result<(Spectrum, Spectrum)> {
    // A grey number beside a colour is a colour too; two numbers, or a file, need no fit.
    let colour = |(d, key): (&SpectrumDescription, &Key)| match d {
        SpectrumDescription::Constant(v) => share(*v, key).map(|v| Some([v as f32; 3])),
        _ => rgb(d, key),
    };
    let numbers = matches!((r.0, t.0), (SpectrumDescription::Constant(_), SpectrumDescription::Constant(_)));
    match (colour(r)?, colour(t)?) {
        (Some(rgb_r), Some(rgb_t)) if !numbers => {
            rgb_shares(rgb_r, r.1)?;
            rgb_shares(rgb_t, t.1)?;
            t.1.name(upsample::reflectance_transmittance_from_rgb(rgb_r, rgb_t, ""))
        }
        _ => Ok((reflectance(r.0, r.1, assets)?, reflectance(t.0, t.1, assets)?)),
    }
}

/// Spectrum of a light with luminance 1.
pub(super) fn emission(d: &SpectrumDescription, key: &Key, assets: &dyn Assets) -> Result<Spectrum> {
    let spectrum = match (d, rgb(d, key)?) {
        (SpectrumDescription::Constant(_), _) => Spectrum::Constant(1.0),
        (_, Some(rgb)) => key.name(emission_from_rgb(rgb, &Illuminant::D65, ""))?,
        (SpectrumDescription::Table(t), _) => light_table(t, key, assets)?,
        _ => return Err(key.invalid("not a spectrum")),
    };
    let luminance = Observer::Cie1931.xyz_of(&spectrum)[1];
    if !(luminance > 0.0 && luminance.is_finite()) {
        return Err(key.invalid("this spectrum has no visible light"));
    }
    Ok(spectrum.scaled((1.0 / luminance) as f32))
}

fn light_table(t: &SpectrumTable, key: &Key, assets: &dyn Assets) -> Result<Spectrum> {
    match (&t.file, &t.illuminant, t.blackbody_k) {
        (Some(_), None, None) => from_file(t, key, assets),
        (None, Some(name), None) => {
            let illuminant = name.parse::<Illuminant>();
            key.at("illuminant").says(illuminant.and_then(Illuminant::spectrum))
        }
        (None, None, Some(k)) => key.at("blackbody_k").says(Illuminant::Blackbody(k).spectrum()),
        _ => Err(key.invalid("give exactly one of `file`, `illuminant` and `blackbody_k`")),
    }
}

fn from_file(t: &SpectrumTable, key: &Key, assets: &dyn Assets) -> Result<Spectrum> {
    let (Some(path), None, None) = (&t.file, &t.illuminant, t.blackbody_k) else {
        return Err(key.invalid("give exactly one of `file`, `illuminant` and `blackbody_k`"));
    };
    let key = key.at("file");
    let bytes = key.says(assets.read(path))?;
    let text = String::from_utf8_lossy(&bytes);
    key.says(table::parse(&text, path).and_then(|t_| t_.spectrum(t.column.as_deref())))
}

/// Linear sRGB of a description that is a colour.
fn rgb(d: &SpectrumDescription, key: &Key) -> Result<Option<[f32; 3]>> {
    Ok(match d {
        SpectrumDescription::Rgb(rgb) => Some(rgb.map(|v| v as f32)),
        SpectrumDescription::Hex(text) => Some(hex(text).ok_or_else(|| {
            key.invalid(format!("\"{text}\" is no colour; expected \"#rrggbb\", such as \"#c01030\""))
        })?),
        _ => None,
    })
}

fn hex(text: &str) -> Option<[f32; 3]> {
    let digits = text.strip_prefix('#').filter(|d| d.len() == 6 && d.is_ascii())?;
    let byte = |i: usize| u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).ok();
    Some([byte(0)?, byte(1)?, byte(2)?].map(|b| srgb_decode(f32::from(b) / 255.0)))
}

fn share(v: f64, key: &Key) -> Result<f64> {
    if (0.0..=1.0).contains(&v) { Ok(v) } else { Err(key.invalid(format!("{v} is not within 0 to 1"))) }
}

fn rgb_shares(rgb: [f32; 3], key: &Key) -> Result<()> {
    rgb.iter().try_for_each(|v| share(f64::from(*v), key).map(|_| ()))
}

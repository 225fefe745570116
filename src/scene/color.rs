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
        (SpectrumDescription::Table(t), _) if t.illuminant.is_none() && t.blackbody_k.is_none() => {
            tabulated(t, key, assets)
        }
        _ => {
            Err(key
                .invalid("a light's spectrum is no reflectance; give a number, a colour, values or a file"))
        }
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

const ONE_FORM: &str =
    "give exactly one of `file`, `wavelengths_nm` with `values`, `illuminant` and `blackbody_k`";

fn light_table(t: &SpectrumTable, key: &Key, assets: &dyn Assets) -> Result<Spectrum> {
    let has_values = t.file.is_some() || t.wavelengths_nm.is_some() || t.values.is_some();
    match (&t.illuminant, t.blackbody_k) {
        (None, None) => tabulated(t, key, assets),
        (Some(name), None) if !has_values => {
            let illuminant = name.parse::<Illuminant>();
            key.at("illuminant").says(illuminant.and_then(Illuminant::spectrum))
        }
        (None, Some(k)) if !has_values => key.at("blackbody_k").says(Illuminant::Blackbody(k).spectrum()),
        _ => Err(key.invalid(ONE_FORM)),
    }
}

/// A table of values, in a file or in the description itself.
fn tabulated(t: &SpectrumTable, key: &Key, assets: &dyn Assets) -> Result<Spectrum> {
    match (&t.file, &t.wavelengths_nm, &t.values) {
        (Some(path), None, None) => {
            let key = key.at("file");
            let bytes = key.says(assets.read(path))?;
            let text = String::from_utf8_lossy(&bytes);
            key.says(table::parse(&text, path).and_then(|t_| t_.spectrum(t.column.as_deref())))
        }
        (None, Some(wavelengths_nm), Some(values)) => {
            let (count, expected) = (values.len(), wavelengths_nm.len());
            if count != expected {
                return Err(key.at("values").invalid(format!("{count} values for {expected} wavelengths")));
            }
            if let Some(v) = values.iter().find(|v| !v.is_finite()) {
                return Err(key.at("values").invalid(format!("{v} is not a finite number")));
            }
            let points: Vec<(f64, f64)> =
                wavelengths_nm.iter().copied().zip(values.iter().copied()).collect();
            key.at("wavelengths_nm").name(Spectrum::from_table(&points, ""))
        }
        (None, None, Some(_)) => Err(key.invalid("`values` needs `wavelengths_nm`")),
        (None, Some(_), None) => Err(key.invalid("`wavelengths_nm` needs `values`")),
        _ => Err(key.invalid(ONE_FORM)),
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::assets::MemoryAssets;

    fn described(text: &str) -> SpectrumDescription {
        #[derive(serde::Deserialize)]
        struct File {
            c: SpectrumDescription,
        }
        toml::from_str::<File>(&format!("c = {text}")).expect(text).c
    }

    #[test]
    fn values_are_linear_between_and_held_beyond() {
        let d = described("{ wavelengths_nm = [450, 550, 650], values = [0.1, 0.2, 0.5] }");
        let s = reflectance(&d, &Key::new("c"), &MemoryAssets::default()).unwrap();
        for (nm, value) in [(380.0, 0.1), (450.0, 0.1), (500.0, 0.15), (625.0, 0.425), (780.0, 0.5)] {
            assert!((s.at(nm) - value).abs() < 1e-6, "{nm}: {}", s.at(nm));
        }
        let one = described("{ wavelengths_nm = [550], values = [0.2] }");
        let s = reflectance(&one, &Key::new("c"), &MemoryAssets::default()).unwrap();
        assert_eq!((s.min(), s.max()), (0.2, 0.2));
        let light = emission(&d, &Key::new("c"), &MemoryAssets::default()).unwrap();
        assert!((light.at(650.0) / light.at(450.0) - 5.0).abs() < 1e-5);
    }

    #[test]
    fn wrong_values_name_their_key() {
        for (text, start) in [
            ("{ wavelengths_nm = [450, 550], values = [0.1] }", "p.c.values: 1 values for 2"),
            ("{ wavelengths_nm = [450, 450], values = [0.1, 0.2] }", "p.c.wavelengths_nm: "),
            ("{ wavelengths_nm = [550, 450], values = [0.1, 0.2] }", "p.c.wavelengths_nm: "),
            ("{ wavelengths_nm = [], values = [] }", "p.c.wavelengths_nm: "),
            ("{ wavelengths_nm = [nan], values = [0.1] }", "p.c.wavelengths_nm: "),
            ("{ wavelengths_nm = [0.45, 0.55], values = [0.1, 0.2] }", "p.c.wavelengths_nm: "),
            ("{ wavelengths_nm = [450], values = [inf] }", "p.c.values: inf"),
            ("{ wavelengths_nm = [450] }", "p.c: `wavelengths_nm` needs"),
            ("{ values = [0.1] }", "p.c: `values` needs"),
            ("{ file = \"x.csv\", wavelengths_nm = [450], values = [0.1] }", "p.c: give exactly one"),
            ("{}", "p.c: give exactly one"),
        ] {
            let key = Key::new("p.c");
            let d = described(text);
            for error in [
                reflectance(&d, &key, &MemoryAssets::default()).expect_err(text).to_string(),
                emission(&d, &key, &MemoryAssets::default()).expect_err(text).to_string(),
            ] {
                assert!(error.starts_with(start), "{text}: {error}");
            }
        }
        let both = described("{ wavelengths_nm = [450], values = [0.1], illuminant = \"D65\" }");
        let error = emission(&both, &Key::new("c"), &MemoryAssets::default()).unwrap_err().to_string();
        assert!(error.contains("exactly one"), "{error}");
        assert!(reflectance(&both, &Key::new("c"), &MemoryAssets::default()).is_err());
    }
}

//! A colour or a spectrum, in any of the ways in which people have one.

use std::fmt;

use schemars::JsonSchema;
use serde::de::{self, MapAccess, SeqAccess, Visitor, value::MapAccessDeserializer};
use serde::{Deserialize, Deserializer, Serialize};

/// A function of wavelength.
///
/// A number (the same at every wavelength), `[r, g, b]` (linear sRGB), `"#rrggbb"` (encoded sRGB, as in a
/// colour picker), `{ wavelengths_nm = [450, 550, 650], values = [0.1, 0.2, 0.5] }` (linear in between, the end
/// values outside), `{ file = "x.csv", column = "name" }` (measured; wavelength in nm in the first column),
/// `{ illuminant = "D65" }` or `{ blackbody_k = 5000 }` (lights only).
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum SpectrumDescription {
    /// The same at every wavelength.
    Constant(f64),
    /// Linear sRGB (Rec. 709 primaries, D65 white).
    Rgb([f64; 3]),
    /// `"#rrggbb"`, sRGB with its transfer function.
    Hex(#[schemars(regex(pattern = r"^#[0-9a-fA-F]{6}$"))] String),
    /// Another source.
    Table(SpectrumTable),
}

/// The forms of a spectrum that are a table; exactly one of `file`, `wavelengths_nm` with `values`, `illuminant` and
/// `blackbody_k`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SpectrumTable {
    /// CSV file, relative to the scene file; wavelength in nm in the first column.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Name of the file's column. Needed where it has more than one besides the wavelength.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub column: Option<String>,
    /// Wavelengths of `values`, nm, increasing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wavelengths_nm: Option<Vec<f64>>,
    /// One value per wavelength; linear in between, the end values outside.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub values: Option<Vec<f64>>,
    /// A CIE illuminant: `A`, `D50`, `D65` or `E`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub illuminant: Option<String>,
    /// Temperature of a black body, K.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blackbody_k: Option<f64>,
}

impl SpectrumDescription {
    /// The illuminant of this name.
    pub fn illuminant(name: &str) -> Self {
        Self::Table(SpectrumTable { illuminant: Some(name.to_owned()), ..SpectrumTable::default() })
    }

    /// From `(wavelength_nm, value)` points of increasing wavelength.
    pub fn points(points: &[(f64, f64)]) -> Self {
        let (wavelengths_nm, values) = points.iter().copied().unzip();
        Self::Table(SpectrumTable {
            wavelengths_nm: Some(wavelengths_nm),
            values: Some(values),
            ..SpectrumTable::default()
        })
    }
}

// By hand, because serde's untagged enums only say "did not match any variant".
impl<'de> Deserialize<'de> for SpectrumDescription {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Forms;
        impl<'de> Visitor<'de> for Forms {
            type Value = SpectrumDescription;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(
                    "a number, [r, g, b], \"#rrggbb\", or a table with `file`, `wavelengths_nm` and `values`, \
                     `illuminant` or `blackbody_k`",
                )
            }
            fn visit_f64<E: de::Error>(self, v: f64) -> Result<Self::Value, E> {
                Ok(SpectrumDescription::Constant(v))
            }
            fn visit_i64<E: de::Error>(self, v: i64) -> Result<Self::Value, E> {
                Ok(SpectrumDescription::Constant(v as f64))
            }
            fn visit_u64<E: de::Error>(self, v: u64) -> Result<Self::Value, E> {
                Ok(SpectrumDescription::Constant(v as f64))
            }
            fn visit_str<E: de::Error>(self, v: &str) -> Result<Self::Value, E> {
                Ok(SpectrumDescription::Hex(v.to_owned()))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Self::Value, A::Error> {
                let mut values = Vec::new();
                while let Some(v) = seq.next_element::<f64>()? {
                    values.push(v);
                }
                match <[f64; 3]>::try_from(values) {
                    Ok(rgb) => Ok(SpectrumDescription::Rgb(rgb)),
                    Err(values) => Err(de::Error::invalid_length(values.len(), &"three numbers [r, g, b]")),
                }
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                SpectrumTable::deserialize(MapAccessDeserializer::new(map)).map(SpectrumDescription::Table)
            }
        }
        deserializer.deserialize_any(Forms)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct File {
        colour: SpectrumDescription,
    }

    #[test]
    fn every_form_survives_toml() {
        for text in [
            "0.25",
            "[0.1, 0.2, 0.3]",
            "\"#c01030\"",
            "{ file = \"x.csv\", column = \"red\" }",
            "{ wavelengths_nm = [450, 550.5, 650], values = [0.1, 0.2, 1] }",
            "{ illuminant = \"D65\" }",
            "{ blackbody_k = 5000 }",
        ] {
            let file: File = toml::from_str(&format!("colour = {text}")).expect(text);
            let back: File = toml::from_str(&toml::to_string(&file).expect(text)).expect(text);
            assert_eq!(file, back, "{text}");
        }
        let points = SpectrumDescription::points(&[(450.0, 0.1), (550.5, 0.2), (650.0, 1.0)]);
        let file: File =
            toml::from_str("colour = { wavelengths_nm = [450, 550.5, 650], values = [0.1, 0.2, 1] }")
                .unwrap();
        assert_eq!(file.colour, points);
        assert!(toml::from_str::<File>("colour = { wavelengths = [450], values = [0.1] }").is_err());
    }
}

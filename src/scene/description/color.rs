//! A colour or a spectrum, in any of the ways in which people have one.

use std::fmt;

use schemars::JsonSchema;
use serde::de::{self, MapAccess, SeqAccess, Visitor, value::MapAccessDeserializer};
use serde::{Deserialize, Deserializer, Serialize};

/// A function of wavelength.
///
/// A number (the same at every wavelength), `[r, g, b]` (linear sRGB), `"#rrggbb"` (encoded sRGB, as in a
/// colour picker), `{ file = "x.csv", column = "name" }` (measured; wavelength in nm in the first column),
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

/// The forms of a spectrum that are a table; exactly one of `file`, `illuminant` and `blackbody_k`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SpectrumTable {
    /// CSV file, relative to the scene file; wavelength in nm in the first column.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Name of the file's column. Needed where it has more than one besides the wavelength.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub column: Option<String>,
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
}

// By hand, because serde's untagged enums only say "did not match any variant".
impl<'de> Deserialize<'de> for SpectrumDescription {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Forms;
        impl<'de> Visitor<'de> for Forms {
            type Value = SpectrumDescription;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(
                    "a number, [r, g, b], \"#rrggbb\", or a table with `file`, `illuminant` or `blackbody_k`",
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

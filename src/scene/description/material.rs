//! `[materials.NAME]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::shape::overlay;
use super::{PetalDescription, SpectrumDescription};
use crate::scene::petal::{GREEN, PRESETS, preset as preset_text};

/// `[materials.NAME]`: a material, by `type`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum MaterialDescription {
    /// Diffuse, both sides alike, opaque.
    Lambert(LambertMaterial),
    /// Diffuse plus a reciprocal, normalised Phong lobe; opaque.
    Phong(PhongMaterial),
    /// Phong's formula as written in 1975: neither reciprocal nor energy conserving.
    LiteralPhong(LiteralPhongMaterial),
    /// Diffuse reflection of each side and diffuse transmission.
    Diffuse(DiffuseMaterial),
    /// The thesis' petal of cells, described by `[petal]`.
    Petal(PetalMaterial),
    /// A leaf or another sheet of tissue, beside the scene's petal.
    Tissue(Box<TissueMaterial>),
}

/// `type = "lambert"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LambertMaterial {
    /// Share of the light that is reflected, 0 to 1. Default 0.5.
    pub reflectance: SpectrumDescription,
}

/// `type = "phong"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PhongMaterial {
    /// Diffuse share, 0 to 1. Default 0.5.
    pub diffuse: SpectrumDescription,
    /// Share of the lobe around the mirror direction, 0 to 1; at every wavelength diffuse + specular <= 1.
    /// Default 0.05.
    pub specular: SpectrumDescription,
    /// Exponent of the lobe: the larger, the sharper. Default 20.
    pub exponent: f64,
}

/// `type = "literal_phong"`: a model to compare with, which `check` flags.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LiteralPhongMaterial {
    /// Diffuse coefficient. Default 0.5.
    pub diffuse: SpectrumDescription,
    /// Specular coefficient. Default 0.05.
    pub specular: SpectrumDescription,
    /// Exponent. Default 20.
    pub exponent: f64,
}

/// `type = "diffuse"`: at every wavelength reflectance + transmittance <= 1 on each side. Where they are
/// given as RGB, both are made into spectra together, so that the sum stays within that bound.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DiffuseMaterial {
    /// Reflectance of the adaxial (upper, inner) side, 0 to 1. Default 0.4.
    pub reflectance_adaxial: SpectrumDescription,
    /// Reflectance of the abaxial (lower, outer) side, 0 to 1. Default: as adaxial.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reflectance_abaxial: Option<SpectrumDescription>,
    /// Transmittance, the same in both directions, 0 to 1. Default 0.
    pub transmittance: SpectrumDescription,
}

/// `type = "petal"`: takes everything from `[petal]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PetalMaterial {}

/// `type = "tissue"`: a sheet of cells and mesophyll like the petal, but one of its own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "TissueKeys")]
pub struct TissueMaterial {
    /// Built-in tissue that the keys of `petal` change. Default `leaf`.
    pub preset: String,
    /// What it is made of, as in `[petal]`.
    pub petal: PetalDescription,
}

/// A tissue as written: the keys that are missing come from the preset.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(rename = "TissueMaterial")]
struct TissueKeys {
    /// Built-in tissue that the keys of `petal` change: `leaf`, or a petal. Default `leaf`.
    preset: String,
    /// What it is made of, as in `[petal]`. Default: the preset's values.
    #[schemars(with = "PetalDescription")]
    petal: toml::Table,
}

impl Default for TissueKeys {
    fn default() -> Self {
        Self { preset: "leaf".to_owned(), petal: toml::Table::new() }
    }
}

impl TryFrom<TissueKeys> for TissueMaterial {
    type Error = String;

    fn try_from(keys: TissueKeys) -> Result<Self, String> {
        let TissueKeys { preset, petal } = keys;
        let text = preset_text(&preset).ok_or_else(|| {
            let names: Vec<&str> = GREEN.iter().chain(PRESETS).map(|p| p.0).collect();
            format!("no tissue is called `{preset}`; there are {}", names.join(", "))
        })?;
        let mut table: toml::Table = text.parse().map_err(|e: toml::de::Error| e.message().to_owned())?;
        overlay(&mut table, petal);
        let petal = PetalDescription::deserialize(table).map_err(|e| e.message().to_owned())?;
        Ok(Self { preset, petal })
    }
}

impl Default for LambertMaterial {
    fn default() -> Self {
        Self { reflectance: SpectrumDescription::Constant(0.5) }
    }
}

impl Default for PhongMaterial {
    fn default() -> Self {
        Self {
            diffuse: SpectrumDescription::Constant(0.5),
            specular: SpectrumDescription::Constant(0.05),
            exponent: 20.0,
        }
    }
}

impl Default for LiteralPhongMaterial {
    fn default() -> Self {
        Self {
            diffuse: SpectrumDescription::Constant(0.5),
            specular: SpectrumDescription::Constant(0.05),
            exponent: 20.0,
        }
    }
}

impl Default for DiffuseMaterial {
    fn default() -> Self {
        Self {
            reflectance_adaxial: SpectrumDescription::Constant(0.4),
            reflectance_abaxial: None,
            transmittance: SpectrumDescription::Constant(0.0),
        }
    }
}

//! What a petal file, or the table `[petal]` of a scene, says.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{PatternDescription, SpectrumDescription};
use crate::micro::{CellDescription, TissueDescription};

/// `[petal]`: the thesis' petal, whose light comes from points of its cells.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PetalDescription {
    /// Random points of the cells within the footprint that shade one hit: few look dull and broken, many
    /// shiny and smooth. At least 1. Default 4. `path` and `hybrid` add a point where the highlight is, so that few points look
    /// dull in `raytrace` only.
    pub samples: u32,
    /// Age of the petal, 0 (bud) to 1 (open flower) to 1.3 (full-blown): younger cells are smaller and flatter than `cells`
    /// says, older ones a little higher. Default: as `cells` says, which is age 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub age: Option<f64>,
    /// Cell lattice and domes.
    pub cells: CellDescription,
    /// Coefficients of the light that leaves each layer.
    pub shading: ShadingDescription,
    /// Layers that light walks through. Where they are given they take the place of `shading`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tissue: Option<TissueDescription>,
    /// File of a measured petal (`.optics`), read instead of measuring `tissue`. Where both are given they must be of the
    /// same shape; the pigments are those of `tissue`, which may differ.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub optics: Option<String>,
    /// Walks of light per side that measure `tissue`, 1e4 to 1e9. Default 1e6.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub walks: Option<u64>,
    /// Pigment that changes along the petal. Only with `tissue` or `optics`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gradient: Option<GradientDescription>,
    /// Pattern of the pigment over each petal and from petal to petal. Only with `tissue` or `optics`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pattern: Option<PatternDescription>,
    /// Picture (PNG, JPEG, HDR, EXR) whose brightness multiplies the pigments of both epidermes; bottom row at the claw,
    /// stretched over the petal. 8-bit pictures are sRGB-encoded: 188 is one half. Only with `tissue` or `optics`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub texture: Option<String>,
}

/// `[petal.gradient]`: factors of the pigments of both epidermes, with a smooth course between the petal's ends. A shape
/// without texture coordinates is all claw.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GradientDescription {
    /// At the claw, the narrow lower end; v = 0. 0 to 100. Default 1.
    pub claw: f64,
    /// At the rim; v = 1. 0 to 100. Default 1.
    pub rim: f64,
}

impl Default for GradientDescription {
    fn default() -> Self {
        Self { claw: 1.0, rim: 1.0 }
    }
}

/// Which layers shade the petal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ShadingModel {
    /// The thesis: upper epidermis on the domes plus spongy layer on the base, each Lambert + Phong.
    #[default]
    TwoLayer,
    /// One Lambertian surface on the domes, of `albedo`; no pigment, no transmission.
    Lambert,
}

/// `[petal.shading]`: the light that leaves each layer. All coefficients are shares of the light that falls on
/// the petal, before the pigment takes its part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ShadingDescription {
    /// Model. Default `two_layer`.
    pub model: ShadingModel,
    /// Reflectance of the domes' surface for `model = "lambert"`, 0 to 1. Default 0.5.
    pub albedo: SpectrumDescription,
    /// Upper epidermis, on the domes: a visible highlight.
    pub epidermis: LayerDescription,
    /// Spongy layer, on the base: dull.
    pub spongy: LayerDescription,
    /// Light through the petal that keeps a direction; the layers' `transmittance` is the part that does not.
    pub transmission: TransmissionDescription,
    /// Reflectance of the lower (abaxial) side, 0 to 1. Default 0.45.
    pub abaxial: SpectrumDescription,
    /// Anthocyanin in the upper epidermis, ug/cm2, 0 to 1000. Light that the epidermis scatters crosses it
    /// once, light from the spongy layer twice, light through the petal once; highlights not at all. Default 45.
    pub anthocyanin_ug_per_cm2: f64,
    /// Anthocyanin in the lower epidermis, ug/cm2, 0 to 1000. Light that the lower side reflects crosses it
    /// twice, light through the petal once. Default 20.
    pub anthocyanin_abaxial_ug_per_cm2: f64,
}

/// Lambert + normalised Phong, and what the layer lets through.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LayerDescription {
    /// Lambert coefficient, 0 to 1.
    pub diffuse: SpectrumDescription,
    /// Phong coefficient, 0 to 1.
    pub specular: SpectrumDescription,
    /// Phong exponent: the larger, the sharper the highlight.
    pub exponent: f64,
    /// Share that passes the layer, 0 to 1; the petal lets the product of both layers through.
    pub transmittance: SpectrumDescription,
}

/// `[petal.shading.transmission]`: light that keeps a direction on its way through the petal, before the pigment of
/// both epidermes takes its part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TransmissionDescription {
    /// Share of upright light that goes straight on, 0 to 1. Default 0.
    pub direct: SpectrumDescription,
    /// How sharp it stays: exponent of the cosine, 0 to 1e5. Default 20.
    pub direct_exponent: f64,
    /// Share of upright light that an upright inner wall of an epidermal cell reflects once on its way, so that its
    /// horizontal part is turned round, 0 to 1. Default 0.
    pub indirect: SpectrumDescription,
    /// How sharp it stays: exponent of the cosine, 0 to 1e5. Default 10.
    pub indirect_exponent: f64,
}

impl Default for TransmissionDescription {
    fn default() -> Self {
        Self {
            direct: SpectrumDescription::Constant(0.0),
            direct_exponent: 20.0,
            indirect: SpectrumDescription::Constant(0.0),
            indirect_exponent: 10.0,
        }
    }
}

impl Default for PetalDescription {
    fn default() -> Self {
        Self {
            samples: 4,
            age: None,
            cells: CellDescription::default(),
            shading: ShadingDescription::default(),
            tissue: None,
            optics: None,
            walks: None,
            gradient: None,
            pattern: None,
            texture: None,
        }
    }
}

// The sources of these numbers are in data/petals/thesis.toml, which a test keeps equal to them.
impl Default for ShadingDescription {
    fn default() -> Self {
        let layer = |diffuse, specular, exponent, transmittance| LayerDescription {
            diffuse: SpectrumDescription::Constant(diffuse),
            specular: SpectrumDescription::Constant(specular),
            exponent,
            transmittance: SpectrumDescription::Constant(transmittance),
        };
        Self {
            model: ShadingModel::TwoLayer,
            albedo: SpectrumDescription::Constant(0.5),
            epidermis: layer(0.28, 0.031, 20.0, 0.85),
            spongy: layer(0.18, 0.02, 2.0, 0.45),
            transmission: TransmissionDescription::default(),
            abaxial: SpectrumDescription::Constant(0.45),
            anthocyanin_ug_per_cm2: 45.0,
            anthocyanin_abaxial_ug_per_cm2: 20.0,
        }
    }
}

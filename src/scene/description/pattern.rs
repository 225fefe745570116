//! What a scene file says about the pattern of a petal's pigment.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[petal.pattern]`: factors on the pigments of the two epidermes, over each petal and from petal to petal, and where the
/// petal is thin or withered. All factors multiply each other, `gradient` and `texture`. Only the petals of a grown rose have margin,
/// veins, age, blotches, thickness and withered patches; other shapes have the courses and the claw spot along v.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PatternDescription {
    /// Course along the petal of the upper (inner) epidermis' pigment.
    pub adaxial: CourseDescription,
    /// The same of the lower (outer) epidermis: near 0 it makes a bicolour with a pale reverse.
    pub abaxial: CourseDescription,
    /// Blotch at the base of the petal: the pale heart of many roses, the dark one of a few.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub claw_spot: Option<ClawSpotDescription>,
    /// Pigment along the veins.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub veins: Option<VeinPigmentDescription>,
    /// Band along the margin: a picotee.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub margin: Option<MarginDescription>,
    /// Change from the innermost to the outermost petal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub age: Option<AgeDescription>,
    /// Unevenness of the blade.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blotches: Option<BlotchDescription>,
    /// Thickness of the mesophyll.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thickness: Option<ThicknessDescription>,
    /// Withered patches of the margin.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub withered: Option<WitheredDescription>,
}

/// Factor on the pigment of one epidermis at three places, with a smooth course between them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CourseDescription {
    /// At the claw. 0 to 100. Default 1.
    pub claw: f64,
    /// Half-way along the veins. 0 to 100. Default 1.
    pub middle: f64,
    /// All along the rim. 0 to 100. Default 1.
    pub rim: f64,
}

impl Default for CourseDescription {
    fn default() -> Self {
        Self { claw: 1.0, middle: 1.0, rim: 1.0 }
    }
}

/// Blotch at the base of a petal, both sides.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ClawSpotDescription {
    /// Factor within it. 0 to 100. Default 0.1.
    pub factor: f64,
    /// How far it reaches, as a part of the petal's length. 0.01 to 1. Default 0.3.
    pub extent: f64,
    /// Size of the rays that it sends along the veins, as a part of its extent. 0 to 1. Default 0.3.
    pub irregularity: f64,
}

impl Default for ClawSpotDescription {
    fn default() -> Self {
        Self { factor: 0.1, extent: 0.3, irregularity: 0.3 }
    }
}

/// More or less pigment in the epidermis over veins.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct VeinPigmentDescription {
    /// Added part of the upper epidermis' pigment on a vein: 1 doubles it, -1 leaves none. -1 to 20. Default 0.8.
    pub adaxial: f64,
    /// The same of the lower epidermis. -1 to 20. Default 0.8.
    pub abaxial: f64,
    /// Width of what the midrib colours at the claw, mm; the other veins in proportion. The relief's veins are 0.35 wide. 0.05 to
    /// 5. Default 0.6.
    pub width_mm: f64,
}

impl Default for VeinPigmentDescription {
    fn default() -> Self {
        Self { adaxial: 0.8, abaxial: 0.8, width_mm: 0.6 }
    }
}

/// Band along the sides and the rim, both sides.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MarginDescription {
    /// Factor in the outer half of the band, from where it fades to its inner end. 0 to 100. Default 2.
    pub factor: f64,
    /// Mean width of the band, mm. 0.1 to 100. Default 4.
    pub width_mm: f64,
    /// How much its width varies along the margin, as a part of it. 0 to 1. Default 0.4.
    pub irregularity: f64,
}

impl Default for MarginDescription {
    fn default() -> Self {
        Self { factor: 2.0, width_mm: 4.0, irregularity: 0.4 }
    }
}

/// Factors at the two ends of a flower's spiral of petals, in proportion between.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AgeDescription {
    /// Of the youngest, at the axis. 0 to 100. Default 1.
    pub inner: f64,
    /// Of the oldest, outermost petal. 0 to 100. Default 1.
    pub outer: f64,
}

impl Default for AgeDescription {
    fn default() -> Self {
        Self { inner: 1.0, outer: 1.0 }
    }
}

/// Gentle patches, different on every petal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BlotchDescription {
    /// Largest part of the pigment by which it varies. 0 to 1. Default 0.15.
    pub amplitude: f64,
    /// Size of a patch, mm. 0.2 to 100. Default 6.
    pub scale_mm: f64,
}

impl Default for BlotchDescription {
    fn default() -> Self {
        Self { amplitude: 0.15, scale_mm: 6.0 }
    }
}

/// Thickness of palisade and spongy mesophyll, in parts of the tissue's. Needs `[tissue]`; measures a second one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ThicknessDescription {
    /// At the margin, 0.2 to 1. Default 0.5.
    pub margin: f64,
    /// From how far inside the petal is as thick as the tissue, mm. 0.1 to 100. Default 20.
    pub width_mm: f64,
    /// Added on a vein, 0 to 2. Default 0.3.
    pub veins: f64,
}

impl Default for ThicknessDescription {
    fn default() -> Self {
        Self { margin: 0.5, width_mm: 20.0, veins: 0.3 }
    }
}

/// Dead tissue at the margin of a petal, more of it the older the petal is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct WitheredDescription {
    /// Part of the margin of the outermost petal that has it, 0 to 1; less of it on younger ones. Default 0.3.
    pub extent: f64,
    /// How far it reaches into the petal at most, mm. 0.1 to 100. Default 3.
    pub width_mm: f64,
    /// Brown products per area, PROSPECT's units, 0 to 100. Default 6.
    pub brown: f64,
    /// Factor on what is left of the tissue's own pigments, 0 to 10. Default 0.3.
    pub pigment: f64,
}

impl Default for WitheredDescription {
    fn default() -> Self {
        Self { extent: 0.3, width_mm: 3.0, brown: 6.0, pigment: 0.3 }
    }
}

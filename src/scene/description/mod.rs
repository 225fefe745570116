//! What a scene file says: one plain struct per table, with every key's unit and default.
//!
//! Tables of named things (`[materials.NAME]`, `[lights.NAME]`, `[shapes.NAME]`) are ordered by name, so the
//! same file always compiles to the same scene and `lights.key.radiance` addresses one number.
//! Lengths are millimetres, angles degrees, +z is up. Whether the values make sense is checked by
//! [`compile`](super::compile::compile).

mod arrangement;
mod camera;
mod color;
mod film;
mod light;
mod material;
mod pattern;
mod petal;
mod radiosity;
mod shape;

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use arrangement::ArrangementShape;
pub use camera::CameraDescription;
pub use color::{SpectrumDescription, SpectrumTable};
pub use film::FilmDescription;
pub use light::{
    AreaLight, AreaShape, ConstantLight, DistantLight, EmissionDescription, ImageLight, LightDescription,
    PointLight, SkyLight,
};
pub use material::{
    DiffuseMaterial, LambertMaterial, LiteralPhongMaterial, MaterialDescription, PetalMaterial,
    PhongMaterial, TissueMaterial,
};
pub use pattern::{
    AgeDescription, BlotchDescription, ClawSpotDescription, CourseDescription, MarginDescription,
    PatternDescription, ThicknessDescription, VeinPigmentDescription, WitheredDescription,
};
pub use petal::{
    GradientDescription, LayerDescription, PetalDescription, ShadingDescription, ShadingModel,
    TransmissionDescription,
};
pub use radiosity::RadiosityDescription;
pub use shape::{
    DiscShape, LatheShape, MeshShape, Placement, QuadShape, RoseMaterials, RoseShape, ShapeDescription,
    SphereShape,
};

/// A whole scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SceneDescription {
    /// For editors: the address of this schema. The renderer ignores it.
    #[serde(rename = "$schema", skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// The picture.
    pub film: FilmDescription,
    /// Where it is taken from.
    pub camera: CameraDescription,
    /// How it is computed.
    pub render: RenderDescription,
    /// The cells of every `petal` material.
    pub petal: PetalDescription,
    /// Named materials.
    pub materials: BTreeMap<String, MaterialDescription>,
    /// Named lights.
    pub lights: BTreeMap<String, LightDescription>,
    /// Named shapes.
    pub shapes: BTreeMap<String, ShapeDescription>,
}

/// How light is transported.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum IntegratorName {
    /// Unbiased path tracing with all interreflection and transmission.
    #[default]
    Path,
    /// The thesis' ray tracing: direct light, and shadows that petals attenuate; no interreflection.
    Raytrace,
    /// The radiosity solution itself: diffuse interreflection and transmission, without cells and highlights.
    Radiosity,
    /// Ray tracing for direct light, cells and highlights, and a final gather from the radiosity solution for the light
    /// among petals.
    Hybrid,
}

/// `[render]`: how the picture is computed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RenderDescription {
    /// Integrator. Default `path`.
    pub integrator: IntegratorName,
    /// Samples per pixel, at least 1. Default 64.
    pub spp: u32,
    /// Seed of every random choice of the light paths. Default 0.
    pub seed: u64,
    /// Most scattering events of a path; 1 is direct light only. Default 32.
    pub max_depth: u32,
    /// Scattering events before Russian roulette may end a path. Default 4.
    pub min_depth: u32,
    /// Does a coarse radiosity solution guide `path`? The picture has the same mean, and less noise for the time where light
    /// comes from several lights and by way of petals; the solution takes a second or two. Default false.
    pub guide: bool,
    /// Is the noise filtered from the finished picture? By Open Image Denoise where the command line finds it, by a filter of our
    /// own otherwise; the EXR keeps the noisy light beside it. Default false.
    pub denoise: bool,
    /// The light among petals, for `radiosity` and `hybrid`.
    pub radiosity: RadiosityDescription,
}

impl Default for RenderDescription {
    fn default() -> Self {
        Self {
            integrator: IntegratorName::Path,
            spp: 64,
            seed: 0,
            max_depth: 32,
            min_depth: 4,
            guide: false,
            denoise: false,
            radiosity: RadiosityDescription::default(),
        }
    }
}

/// JSON schema of the scene file.
pub fn schema() -> serde_json::Value {
    let mut schema = schemars::schema_for!(SceneDescription);
    schema.insert("title".to_owned(), "Rosarium scene".into());
    schema.to_value()
}

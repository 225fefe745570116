//! `[shapes.NAME]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    ArrangementShape, DiffuseMaterial, EmissionDescription, LambertMaterial, MaterialDescription,
    SpectrumDescription,
};
use crate::flower::RoseDescription;

/// `[shapes.NAME]`: something that light meets, by `type`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum ShapeDescription {
    /// A rose, grown from its description.
    Rose(Box<RoseShape>),
    /// Triangles from a file.
    Mesh(MeshShape),
    /// A rectangle.
    Quad(QuadShape),
    /// A disc.
    Disc(DiscShape),
    /// A sphere.
    Sphere(SphereShape),
    /// A surface of revolution: a vase, a pot, a plate.
    Lathe(LatheShape),
    /// Several roses by rule.
    Arrangement(Box<ArrangementShape>),
}

/// Where a shape stands: scaled about its own origin, then turned, then moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Translation, mm.
    pub position_mm: [f64; 3],
    /// Turns about +x, then +y, then +z, degrees.
    pub rotation_deg: [f64; 3],
    /// Factor on all lengths.
    pub scale: f64,
}

/// Materials of a rose's organs, by name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RoseMaterials {
    /// Petals. Default `petal`.
    pub petal: String,
    /// Sepals. Default `sepal`.
    pub sepal: String,
    /// Receptacle. Default `stem`.
    pub receptacle: String,
    /// Stem. Default `stem`.
    pub stem: String,
    /// Leaves and stipules. Default `leaf`; a scene without it has green diffuse ones.
    pub leaf: String,
    /// Prickles. Default `prickle`; a scene without it has brown opaque ones.
    pub prickle: String,
    /// Filaments of the stamens. Default `stamen`; a scene without it has pale yellow ones.
    pub stamen: String,
    /// Anthers. Default `anther`; a scene without it has yellow ones.
    pub anther: String,
    /// Styles. Default `style`; a scene without it has pale green ones.
    pub style: String,
}

/// `type = "rose"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "RoseKeys")]
pub struct RoseShape {
    /// Named rose that the keys of `rose` change. Default `hybrid_tea`.
    pub preset: String,
    /// How it grows.
    pub rose: RoseDescription,
    /// What its organs are made of.
    pub materials: RoseMaterials,
    /// Place of the point where the petals grow, mm. Default the origin.
    pub position_mm: [f64; 3],
    /// Turns about +x, then +y, then +z, degrees. Default none.
    pub rotation_deg: [f64; 3],
    /// Factor on all lengths. Default 1.
    pub scale: f64,
}

/// A rose as written: the keys that are missing come from the preset.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(rename = "RoseShape")]
struct RoseKeys {
    /// Named rose that the keys of `rose` change: `hybrid_tea`, `cupped` or `wild`. Default `hybrid_tea`.
    preset: String,
    /// How it grows. Default: the preset's values.
    #[schemars(with = "RoseDescription")]
    rose: toml::Table,
    /// What its organs are made of.
    materials: RoseMaterials,
    /// Place of the point where the petals grow, mm. Default the origin.
    position_mm: [f64; 3],
    /// Turns about +x, then +y, then +z, degrees. Default none.
    rotation_deg: [f64; 3],
    /// Factor on all lengths. Default 1.
    scale: f64,
}

impl Default for RoseKeys {
    fn default() -> Self {
        Self {
            preset: "hybrid_tea".to_owned(),
            rose: toml::Table::new(),
            materials: RoseMaterials::default(),
            position_mm: [0.0; 3],
            rotation_deg: [0.0; 3],
            scale: 1.0,
        }
    }
}

impl TryFrom<RoseKeys> for RoseShape {
    type Error = String;

    fn try_from(keys: RoseKeys) -> Result<Self, String> {
        let RoseKeys { preset, rose, materials, position_mm, rotation_deg, scale } = keys;
        let rose = with_preset(&preset, rose)?;
        Ok(Self { preset, rose, materials, position_mm, rotation_deg, scale })
    }
}

/// A named rose with some keys changed.
pub(super) fn with_preset(preset: &str, rose: toml::Table) -> Result<RoseDescription, String> {
    let preset: RoseDescription = preset.parse().map_err(|e: crate::Error| match e {
        crate::Error::Invalid { what, .. } => what,
        other => other.to_string(),
    })?;
    let mut table = toml::Table::try_from(&preset).map_err(|e| e.to_string())?;
    overlay(&mut table, rose);
    RoseDescription::deserialize(table).map_err(|e| e.message().to_owned())
}

/// Puts the values of `over` into `base`, table by table.
pub(super) fn overlay(base: &mut toml::Table, over: toml::Table) {
    for (key, value) in over {
        match (base.get_mut(&key), value) {
            (Some(toml::Value::Table(below)), toml::Value::Table(above)) => overlay(below, above),
            (_, value) => {
                base.insert(key, value);
            }
        }
    }
}

/// `type = "mesh"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshShape {
    /// Mesh file (.ply, .obj, .glb), relative to the scene file; its unit is taken as mm.
    pub file: String,
    /// Material by name.
    pub material: String,
    /// Place of the file's origin, mm. Default the origin.
    #[serde(default)]
    pub position_mm: [f64; 3],
    /// Turns about +x, then +y, then +z, degrees. Default none.
    #[serde(default)]
    pub rotation_deg: [f64; 3],
    /// Factor on all lengths. Default 1.
    #[serde(default = "one")]
    pub scale: f64,
    /// Makes the surface a light. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emission: Option<EmissionDescription>,
}

/// `type = "quad"`: a rectangle in the xy plane around its origin, normal +z.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct QuadShape {
    /// Size along its x, mm.
    pub width_mm: f64,
    /// Size along its y, mm.
    pub height_mm: f64,
    /// Material by name.
    pub material: String,
    /// Place of the middle, mm. Default the origin.
    #[serde(default)]
    pub position_mm: [f64; 3],
    /// Turns about +x, then +y, then +z, degrees. Default none.
    #[serde(default)]
    pub rotation_deg: [f64; 3],
    /// Makes the surface a light. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emission: Option<EmissionDescription>,
}

/// `type = "disc"`: a disc in the xy plane around its origin, normal +z.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DiscShape {
    /// Radius, mm.
    pub radius_mm: f64,
    /// Material by name.
    pub material: String,
    /// Place of the middle, mm. Default the origin.
    #[serde(default)]
    pub position_mm: [f64; 3],
    /// Turns about +x, then +y, then +z, degrees. Default none.
    #[serde(default)]
    pub rotation_deg: [f64; 3],
    /// Makes the surface a light. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emission: Option<EmissionDescription>,
}

/// `type = "sphere"`: triangles of a subdivided icosahedron with smooth normals that point outwards.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SphereShape {
    /// Radius, mm.
    pub radius_mm: f64,
    /// Subdivisions of the icosahedron, 0 to 7: 20 * 4^n faces. Default 4.
    #[serde(default = "four")]
    pub subdivisions: u32,
    /// Material by name.
    pub material: String,
    /// Place of the middle, mm. Default the origin.
    #[serde(default)]
    pub position_mm: [f64; 3],
    /// Makes the surface a light. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emission: Option<EmissionDescription>,
}

/// `type = "lathe"`: a curve of (radius, height) turned about +z: a vase, a pot, a plate. A wall goes up outside and down inside.
/// Normals point out of the solid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LatheShape {
    /// The curve's points: [radius, height], mm, 2 to 512 of them. Only the first and the last may have radius 0. A point given twice
    /// in a row is a corner of a smooth curve.
    pub profile_mm: Vec<[f64; 2]>,
    /// Does a smooth curve run through the points? Straight pieces otherwise. Default true.
    #[serde(default = "yes")]
    pub smooth: bool,
    /// Sides, 3 to 2048. Default 128.
    #[serde(default = "sides")]
    pub segments: u32,
    /// Material by name.
    pub material: String,
    /// Place of the point at radius 0, height 0, mm. Default the origin.
    #[serde(default)]
    pub position_mm: [f64; 3],
    /// Turns about +x, then +y, then +z, degrees. Default none.
    #[serde(default)]
    pub rotation_deg: [f64; 3],
    /// Factor on all lengths. Default 1.
    #[serde(default = "one")]
    pub scale: f64,
    /// Makes the surface a light. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emission: Option<EmissionDescription>,
}

impl Default for RoseMaterials {
    fn default() -> Self {
        Self {
            petal: "petal".to_owned(),
            sepal: "sepal".to_owned(),
            receptacle: "stem".to_owned(),
            stem: "stem".to_owned(),
            leaf: "leaf".to_owned(),
            prickle: "prickle".to_owned(),
            stamen: "stamen".to_owned(),
            anther: "anther".to_owned(),
            style: "style".to_owned(),
        }
    }
}

impl RoseMaterials {
    /// What a name stands for in a scene that has no material of that name: organs that a scene need not know.
    pub fn built_in(name: &str) -> Option<MaterialDescription> {
        let sheet = |reflectance: [f64; 3], abaxial: [f64; 3], transmittance: [f64; 3]| {
            MaterialDescription::Diffuse(DiffuseMaterial {
                reflectance_adaxial: SpectrumDescription::Rgb(reflectance),
                reflectance_abaxial: Some(SpectrumDescription::Rgb(abaxial)),
                transmittance: SpectrumDescription::Rgb(transmittance),
            })
        };
        let solid = |rgb| {
            MaterialDescription::Lambert(LambertMaterial { reflectance: SpectrumDescription::Rgb(rgb) })
        };
        // Our reading of living roses.
        match name {
            "leaf" => Some(sheet([0.04, 0.11, 0.03], [0.08, 0.16, 0.07], [0.03, 0.09, 0.01])),
            "sepal" => Some(sheet([0.06, 0.14, 0.04], [0.08, 0.16, 0.07], [0.02, 0.06, 0.01])),
            "stem" => Some(solid([0.08, 0.16, 0.05])),
            "prickle" => Some(solid([0.22, 0.10, 0.055])),
            "stamen" => Some(solid([0.55, 0.47, 0.16])),
            "anther" => Some(solid([0.62, 0.38, 0.05])),
            "style" => Some(solid([0.42, 0.45, 0.18])),
            _ => None,
        }
    }
}

impl ShapeDescription {
    /// Where it stands.
    pub fn placement(&self) -> Placement {
        let (position_mm, rotation_deg, scale) = match self {
            Self::Rose(s) => (s.position_mm, s.rotation_deg, s.scale),
            Self::Mesh(s) => (s.position_mm, s.rotation_deg, s.scale),
            Self::Quad(s) => (s.position_mm, s.rotation_deg, 1.0),
            Self::Disc(s) => (s.position_mm, s.rotation_deg, 1.0),
            Self::Sphere(s) => (s.position_mm, [0.0; 3], 1.0),
            Self::Lathe(s) => (s.position_mm, s.rotation_deg, s.scale),
            Self::Arrangement(s) => (s.position_mm, s.rotation_deg, s.scale),
        };
        Placement { position_mm, rotation_deg, scale }
    }

    /// Materials of a shape made of organs.
    pub fn organs(&self) -> Option<&RoseMaterials> {
        match self {
            Self::Rose(s) => Some(&s.materials),
            Self::Arrangement(s) => Some(&s.materials),
            _ => None,
        }
    }

    /// Material and emission of a shape made of one surface; `None` for roses.
    pub fn surface(&self) -> Option<(&str, Option<&EmissionDescription>)> {
        match self {
            Self::Rose(_) | Self::Arrangement(_) => None,
            Self::Mesh(s) => Some((&s.material, s.emission.as_ref())),
            Self::Quad(s) => Some((&s.material, s.emission.as_ref())),
            Self::Disc(s) => Some((&s.material, s.emission.as_ref())),
            Self::Sphere(s) => Some((&s.material, s.emission.as_ref())),
            Self::Lathe(s) => Some((&s.material, s.emission.as_ref())),
        }
    }
}

fn one() -> f64 {
    1.0
}

fn four() -> u32 {
    4
}

fn yes() -> bool {
    true
}

fn sides() -> u32 {
    128
}

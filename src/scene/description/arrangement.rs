//! `type = "arrangement"`: several roses by rule.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::RoseMaterials;
use super::shape::with_preset;
use crate::flower::arrangement::ArrangementKind;
use crate::flower::{ArrangementDescription, RoseDescription};

/// `type = "arrangement"`: several roses by rule, each with its own seed, turn and openness, none running into another. `vase`: cut
/// stems that lean out of one opening, whose vase is a shape of its own. `bush`: canes that arch outwards from one place on the ground,
/// with leaves along them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ArrangementShape {
    /// `vase` or `bush`. Default `vase`.
    pub kind: ArrangementKind,
    /// Number of roses, 1 to 64. Default 3 in a vase, 9 on a bush.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub count: Option<u32>,
    /// Seed of all that differs between two arrangements of one kind. Default 1.
    pub seed: u64,
    /// Openness of the most closed and of the most open rose, 0 to 1.3; the others lie evenly between. Default [0.35, 0.95].
    pub openness: [f64; 2],
    /// Height of the highest flower above the opening of the vase or above the ground, mm. Default 150, 620 for a bush.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub height_mm: Option<f64>,
    /// How far stems bend outwards in the vase, or canes of a bush lean, degrees; it grows until the roses fit. Default 3, 44 for a
    /// bush.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spread_deg: Option<f64>,
    /// `vase`: height of its opening above its foot, mm. Default 170.
    pub opening_height_mm: f64,
    /// `vase`: radius of its opening, mm; stems stay within it all the way down. Default 26.
    pub opening_radius_mm: f64,
    /// Named rose that the keys of `rose` change: `hybrid_tea`, `cupped` or `wild`. Default `hybrid_tea`.
    pub preset: String,
    /// What all roses have in common. Its `openness` and the length and bend of its stem have no effect, `seed` adds to the
    /// arrangement's. Leaves stand along the whole cane of a bush, unless `leaves.count` is 0. Default: the preset's values.
    #[schemars(with = "RoseDescription")]
    pub rose: toml::Table,
    /// What their organs are made of.
    pub materials: RoseMaterials,
    /// Place of the foot of the vase, or of the place where the bush leaves the ground, mm. Default the origin.
    pub position_mm: [f64; 3],
    /// Turns about +x, then +y, then +z, degrees. Default none.
    pub rotation_deg: [f64; 3],
    /// Factor on all lengths. Default 1.
    pub scale: f64,
}

impl Default for ArrangementShape {
    fn default() -> Self {
        Self {
            kind: ArrangementKind::default(),
            count: None,
            seed: 1,
            openness: [0.35, 0.95],
            height_mm: None,
            spread_deg: None,
            opening_height_mm: 170.0,
            opening_radius_mm: 26.0,
            preset: "hybrid_tea".to_owned(),
            rose: toml::Table::new(),
            materials: RoseMaterials::default(),
            position_mm: [0.0; 3],
            rotation_deg: [0.0; 3],
            scale: 1.0,
        }
    }
}

impl ArrangementShape {
    /// What all roses have in common.
    pub fn rose(&self) -> Result<RoseDescription, String> {
        with_preset(&self.preset, self.rose.clone())
    }

    /// How the roses stand.
    pub fn arrangement(&self) -> ArrangementDescription {
        ArrangementDescription {
            kind: self.kind,
            count: self.count,
            seed: self.seed,
            openness: self.openness,
            height_mm: self.height_mm,
            spread_deg: self.spread_deg,
            opening_height_mm: self.opening_height_mm,
            opening_radius_mm: self.opening_radius_mm,
        }
    }
}

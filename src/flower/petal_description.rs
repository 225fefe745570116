//! Description of the petals of a rose: what differs from the centre out has an inner and an outer value.
//!
//! Sizes of single petals are our reading; `sizes_are_those_of_garden_roses` guards the diameter of the flower.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::flower::rose::{check, check_unit_open};

/// Shape of the petals. What differs from the centre out has an inner and an outer value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PetalDescription {
    /// Length of the innermost petal in bloom, mm (default 44).
    pub inner_length_mm: f64,
    /// Length of the outer half of the petals in bloom, mm (default 50).
    pub length_mm: f64,
    /// Width of the innermost petal in bloom, mm (default 18).
    pub inner_width_mm: f64,
    /// Width of the outer half of the petals in bloom, mm (default 56).
    pub width_mm: f64,
    /// Width at the receptacle, mm (default 9).
    pub claw_width_mm: f64,
    /// Where the petal is widest, as a part of its length (default 0.6).
    pub widest: f64,
    /// Point (positive) or notch (negative) in the middle of the rim of the outermost petals, mm
    /// (default 2).
    pub tip_mm: f64,
    /// How far the margins of the innermost petals stand up from their middle, mm (default 1.5).
    pub cup_inner_mm: f64,
    /// How far the margins of the outermost petals stand up from their middle, mm; negative: fall back
    /// (default -3).
    pub cup_outer_mm: f64,
    /// Depth of the fold along the midrib, mm (default 0.6).
    pub fold_mm: f64,
    /// Turn of the rolled margin of the innermost petals, deg (default 35).
    pub roll_inner_deg: f64,
    /// Turn of the rolled margin of the outermost petals, deg (default 170).
    pub roll_outer_deg: f64,
    /// Width of the rolled margin of the outermost petals, mm (default 11).
    pub roll_width_mm: f64,
    /// Straight edges of the rim of the outermost petals, with a cusp between each two (default 3); inner
    /// petals have fewer.
    pub facets: f64,
    /// Size of the rounding of a cusp, mm: thinner petals have sharper ones (default 1.4).
    pub cusp_mm: f64,
    /// Amplitude of the waves of the rim, mm (default 0.9).
    pub ruffle_mm: f64,
    /// Waves along the rim (default 2.5).
    pub ruffle_waves: f64,
    /// Amplitude of the unevenness of the blade, mm (default 0.35).
    pub crumple_mm: f64,
    /// Height of the relief of the veins, mm (default 0.05).
    pub vein_relief_mm: f64,
    /// Depth of the largest tears of the rim, mm (default 0.4).
    pub nicks_mm: f64,
}

impl Default for PetalDescription {
    fn default() -> Self {
        Self {
            inner_length_mm: 44.0,
            length_mm: 50.0,
            inner_width_mm: 18.0,
            width_mm: 56.0,
            claw_width_mm: 9.0,
            widest: 0.6,
            tip_mm: 2.0,
            cup_inner_mm: 1.5,
            cup_outer_mm: -3.0,
            fold_mm: 0.6,
            roll_inner_deg: 35.0,
            roll_outer_deg: 170.0,
            roll_width_mm: 11.0,
            facets: 3.0,
            cusp_mm: 1.4,
            ruffle_mm: 0.9,
            ruffle_waves: 2.5,
            crumple_mm: 0.35,
            vein_relief_mm: 0.05,
            nicks_mm: 0.4,
        }
    }
}

impl PetalDescription {
    /// Checks every key; `at` is the dotted path of this table.
    pub fn validate(&self, at: &str) -> Result<()> {
        check(at, "inner_length_mm", self.inner_length_mm, 1.0, 200.0)?;
        check(at, "length_mm", self.length_mm, 1.0, 200.0)?;
        check(at, "inner_width_mm", self.inner_width_mm, 1.0, 200.0)?;
        check(at, "width_mm", self.width_mm, 1.0, 200.0)?;
        check(at, "claw_width_mm", self.claw_width_mm, 0.5, 100.0)?;
        check_unit_open(at, "widest", self.widest)?;
        check(at, "tip_mm", self.tip_mm, -20.0, 20.0)?;
        check(at, "cup_inner_mm", self.cup_inner_mm, -20.0, 20.0)?;
        check(at, "cup_outer_mm", self.cup_outer_mm, -20.0, 20.0)?;
        check(at, "fold_mm", self.fold_mm, -10.0, 10.0)?;
        check(at, "roll_inner_deg", self.roll_inner_deg, -360.0, 360.0)?;
        check(at, "roll_outer_deg", self.roll_outer_deg, -360.0, 360.0)?;
        check(at, "roll_width_mm", self.roll_width_mm, 0.1, 50.0)?;
        check(at, "facets", self.facets, 1.0, 6.0)?;
        check(at, "cusp_mm", self.cusp_mm, 0.1, 20.0)?;
        check(at, "ruffle_mm", self.ruffle_mm, 0.0, 10.0)?;
        check(at, "ruffle_waves", self.ruffle_waves, 0.0, 20.0)?;
        check(at, "crumple_mm", self.crumple_mm, 0.0, 5.0)?;
        check(at, "vein_relief_mm", self.vein_relief_mm, 0.0, 1.0)?;
        check(at, "nicks_mm", self.nicks_mm, 0.0, 10.0)
    }
}

//! The pigments of one layer of tissue and how they absorb.
//!
//! Model: Beer-Lambert along a path of length l: `exp(-mu_a l)`, `mu_a = sum over pigments of k(lambda) amount / depth`, k the
//! specific absorption coefficient (natural logarithm, cm2/ug), amount per area of petal (ug/cm2), depth the
//! layer's volume per area of petal (um).
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | amount of anthocyanin | `anthocyanin_ug_per_cm2` | ug/cm2 | 0 |
//!
//! Source of k: `super::pigment`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::pigment::{MAX_UG_PER_CM2, anthocyanin_cm2_per_ug};
use crate::{Error, Result};

/// Amounts of the pigments of one layer.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Pigments {
    /// Anthocyanin, ug/cm2 of petal, 0 to 1000. Default 0.
    pub anthocyanin_ug_per_cm2: f64,
}

impl Pigments {
    /// Checks the amounts. `at` is the key of this table in its file.
    pub fn validate(&self, at: &str) -> Result<()> {
        if (0.0..=MAX_UG_PER_CM2).contains(&self.anthocyanin_ug_per_cm2) {
            return Ok(());
        }
        let what = format!("{} is not within 0 to {MAX_UG_PER_CM2} ug/cm2", self.anthocyanin_ug_per_cm2);
        Err(Error::invalid(format!("{at}.anthocyanin_ug_per_cm2"), what))
    }

    /// Absorption coefficient at one wavelength, 1/um, in a layer of `depth_um` (volume per area).
    pub fn absorption_per_um(&self, depth_um: f64, wavelength_nm: f64) -> Result<f64> {
        let k = f64::from(anthocyanin_cm2_per_ug().at(wavelength_nm as f32));
        Ok(k * self.anthocyanin_ug_per_cm2 / depth_um)
    }
}

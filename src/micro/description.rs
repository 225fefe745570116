//! The keys that describe the cells of one petal surface.
//!
//! Source of the defaults: the thesis (pitch 23 um, mean measured height 37 um, regular triangular grid). The
//! disorder keys are our reading of what real epidermis adds; all are zero by default.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::dome::Profile;
use crate::{Error, Result};

/// The upper epidermis as numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CellDescription {
    /// Distance between neighbouring cell centres of the triangular grid, um, 0.1 to 10000. Default 23.
    pub pitch_um: f64,
    /// Height of a dome over its base plane, um; the mean where heights vary. From 0 to 100 pitches. Default 37.
    pub height_um: f64,
    /// Shape of the dome. Default `cosine`.
    pub profile: Profile,
    /// Standard deviation of a cell centre's displacement along x and along y, in units of the pitch,
    /// 0 to 0.15. Gaussian, cut off at 2.7 standard deviations. Default 0.
    pub center_disorder: f64,
    /// Standard deviation of the height, in units of the height, 0 to 0.3. Gaussian, cut off at 2.7 standard
    /// deviations. Default 0.
    pub height_disorder: f64,
    /// Standard deviation of the axis' tilt towards x and towards y, degrees, 0 to 10. Gaussian, cut off at
    /// 2.7 standard deviations. Default 0.
    pub tilt_disorder_deg: f64,
    /// Seed of the disorder. Default 0.
    pub seed: u64,
    /// Cells along each period of the tile that repeats, where cells are disordered: an even number, 4 to 512.
    /// A regular lattice repeats after two cells whatever this says. Default 32.
    pub tile_cells: u32,
}

impl Default for CellDescription {
    fn default() -> Self {
        Self {
            pitch_um: 23.0,
            height_um: 37.0,
            profile: Profile::Cosine,
            center_disorder: 0.0,
            height_disorder: 0.0,
            tilt_disorder_deg: 0.0,
            seed: 0,
            tile_cells: 32,
        }
    }
}

impl CellDescription {
    /// Checks every range. `at` is the key of this description in its file, such as `cells`.
    pub fn validate(&self, at: &str) -> Result<()> {
        let range = |key: &str, value: f64, low: f64, high: f64, unit: &str| {
            if (low..=high).contains(&value) {
                return Ok(());
            }
            Err(Error::invalid(format!("{at}.{key}"), format!("{value} is not within {low} to {high}{unit}")))
        };
        range("pitch_um", self.pitch_um, 0.1, 1e4, " um")?;
        range("height_um", self.height_um, 0.0, 100.0 * self.pitch_um, " um (100 pitches)")?;
        range("center_disorder", self.center_disorder, 0.0, 0.15, " pitches")?;
        range("height_disorder", self.height_disorder, 0.0, 0.3, " heights")?;
        range("tilt_disorder_deg", self.tilt_disorder_deg, 0.0, 10.0, " degrees")?;
        range("tile_cells", f64::from(self.tile_cells), 4.0, 512.0, "")?;
        if self.tile_cells % 2 == 1 {
            return Err(Error::invalid(
                format!("{at}.tile_cells"),
                format!("{} is odd: rows of the grid alternate, so they repeat in pairs", self.tile_cells),
            ));
        }
        Ok(())
    }

    /// Do all cells look the same?
    pub fn is_regular(&self) -> bool {
        self.center_disorder == 0.0 && self.height_disorder == 0.0 && self.tilt_disorder_deg == 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_the_thesis() {
        let cells: CellDescription = toml::from_str("").expect("every key has a default");
        assert_eq!(cells, CellDescription::default());
        assert_eq!((cells.pitch_um, cells.height_um, cells.profile), (23.0, 37.0, Profile::Cosine));
        cells.validate("cells").expect("valid");
    }

    #[test]
    fn names_the_wrong_key() {
        for (toml, key) in [
            ("pitch_um = 0.0", "cells.pitch_um"),
            ("pitch_um = nan", "cells.pitch_um"),
            ("pitch_um = inf", "cells.pitch_um"),
            ("height_um = -1.0", "cells.height_um"),
            ("center_disorder = 0.5", "cells.center_disorder"),
            ("height_disorder = -0.1", "cells.height_disorder"),
            ("tilt_disorder_deg = 45.0", "cells.tilt_disorder_deg"),
            ("tile_cells = 2", "cells.tile_cells"),
            ("tile_cells = 7", "cells.tile_cells"),
        ] {
            let cells: CellDescription = toml::from_str(toml).expect("parses");
            let error = cells.validate("cells").expect_err(toml).to_string();
            assert!(error.starts_with(key), "{toml}: {error}");
        }
    }

    #[test]
    fn refuses_unknown_keys_and_profiles() {
        assert!(toml::from_str::<CellDescription>("pitch = 23.0").is_err());
        assert!(toml::from_str::<CellDescription>("profile = \"sphere\"").is_err());
        let cells: CellDescription = toml::from_str("profile = \"raised_cosine\"").expect("parses");
        assert_eq!(cells.profile, Profile::RaisedCosine);
    }
}

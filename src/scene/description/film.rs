//! `[film]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::film::{Filter, ToneMap};

/// `[film]`: the picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FilmDescription {
    /// Width, pixels, 1 to 32768. Default 640.
    pub width: u32,
    /// Height, pixels, 1 to 32768. Default 640.
    pub height: u32,
    /// Reconstruction filter. Default `blackman_harris`.
    pub filter: Filter,
    /// Radius of the filter, pixels. Default: the filter's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub filter_radius_px: Option<f64>,
    /// Exposure of the PNG, stops. Default 0.
    pub exposure_ev: f64,
    /// Tone curve of the PNG. Default `agx`.
    pub tone_map: ToneMap,
}

impl Default for FilmDescription {
    fn default() -> Self {
        Self {
            width: 640,
            height: 640,
            filter: Filter::BlackmanHarris,
            filter_radius_px: None,
            exposure_ev: 0.0,
            tone_map: ToneMap::default(),
        }
    }
}

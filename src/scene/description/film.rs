//! `[film]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[film]`: the picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FilmDescription {
    /// Width, pixels, 1 to 32768. Default 640.
    pub width: u32,
    /// Height, pixels, 1 to 32768. Default 640.
    pub height: u32,
    /// Reconstruction filter. Default `blackman_harris`.
    pub filter: FilterName,
    /// Radius of the filter, pixels. Default: the filter's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub filter_radius_px: Option<f64>,
    /// Exposure of the PNG, stops. Default 0.
    pub exposure_ev: f64,
    /// Tone curve of the PNG. Default `agx`.
    pub tone_map: ToneMapName,
}

/// Filter by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FilterName {
    /// All samples of the pixel alike.
    Box,
    /// Falls off linearly.
    Tent,
    /// Gaussian, cut off.
    Gaussian,
    /// Mitchell and Netravali's cubic; sharpens.
    Mitchell,
    /// Blackman and Harris' window.
    #[default]
    BlackmanHarris,
}

/// Tone curve by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ToneMapName {
    /// AgX: bright colours go to white gently.
    #[default]
    Agx,
    /// ACES: more contrast.
    Aces,
    /// None: cut off at white.
    Linear,
}

impl Default for FilmDescription {
    fn default() -> Self {
        Self {
            width: 640,
            height: 640,
            filter: FilterName::default(),
            filter_radius_px: None,
            exposure_ev: 0.0,
            tone_map: ToneMapName::default(),
        }
    }
}

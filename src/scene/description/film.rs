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
    /// White balance of the PNG: temperature of the light that is to look white, K, 1500 to 25000 (candle 1900, lamp 2800, sun 5500,
    /// shade 8000). Default: none, which is that of D65, 6504 K.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub white_balance_k: Option<f64>,
    /// White balance across the temperatures, -150 to 150, as photographers' programs count it: above 0 the PNG becomes more magenta,
    /// below 0 greener. Default 0.
    pub tint: f64,
    /// Fall of the PNG's light towards the corners, 0 to 20 times that of a simple lens of the camera's angle (cos^4). Default 0.
    pub vignetting: f64,
    /// Grain of the PNG: relative deviation at middle grey, 0 to 1; 0.02 is mild. It follows `render.seed`. Default 0.
    pub grain: f64,
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
            white_balance_k: None,
            tint: 0.0,
            vignetting: 0.0,
            grain: 0.0,
        }
    }
}

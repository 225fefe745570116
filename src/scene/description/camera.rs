//! `[camera]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Kind of camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CameraType {
    /// Everything is sharp.
    #[default]
    Pinhole,
    /// An ideal lens with a round aperture: sharp in one plane.
    ThinLens,
}

/// `[camera]`: where the picture is taken from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CameraDescription {
    /// `pinhole` or `thin_lens`. Default `pinhole`.
    pub r#type: CameraType,
    /// The eye, mm. Default [0, -300, 150].
    pub position_mm: [f64; 3],
    /// The point in the middle of the picture, mm. Default [0, 0, 60].
    pub target_mm: [f64; 3],
    /// Direction that is up in the picture. Default [0, 0, 1].
    pub up: [f64; 3],
    /// Angle of the picture's height, degrees, in (0, 180). Default 20.
    pub fov_deg: f64,
    /// `thin_lens`: radius of the aperture, mm. This or `f_number`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub aperture_radius_mm: Option<f64>,
    /// `thin_lens`: focal length over aperture's diameter, as on a camera; the focal length follows from
    /// `fov_deg` and `sensor_height_mm`. This or `aperture_radius_mm`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub f_number: Option<f64>,
    /// Height of the sensor behind `f_number`, mm. Default 24 (a full-frame camera held level).
    pub sensor_height_mm: f64,
    /// `thin_lens`: distance from the eye to the sharp plane, mm, along the viewing direction. Default: the
    /// distance to `target_mm`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focus_mm: Option<f64>,
    /// `thin_lens`: a point of the sharp plane, mm, in place of `focus_mm`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focus_point_mm: Option<[f64; 3]>,
}

impl Default for CameraDescription {
    fn default() -> Self {
        Self {
            r#type: CameraType::Pinhole,
            position_mm: [0.0, -300.0, 150.0],
            target_mm: [0.0, 0.0, 60.0],
            up: [0.0, 0.0, 1.0],
            fov_deg: 20.0,
            aperture_radius_mm: None,
            f_number: None,
            sensor_height_mm: 24.0,
            focus_mm: None,
            focus_point_mm: None,
        }
    }
}

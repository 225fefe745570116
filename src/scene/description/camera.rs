//! `[camera]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[camera]`: where the picture is taken from, and with which lens. Without `f_number` everything is sharp; with it, the
/// plane at the focus is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CameraDescription {
    /// The eye, mm. Default [0, -300, 150].
    pub position_mm: [f64; 3],
    /// The point in the middle of the picture, mm. Default [0, 0, 60].
    pub target_mm: [f64; 3],
    /// Direction that is up in the picture. Default [0, 0, 1].
    pub up: [f64; 3],
    /// Angle of the picture's height, degrees, 0.01 to 179. This or `focal_length_mm`. Default 20.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fov_deg: Option<f64>,
    /// Focal length, mm, as engraved on the lens; with `sensor_width_mm` and the distance of the focus it gives the angle
    /// of the picture. This or `fov_deg`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focal_length_mm: Option<f64>,
    /// Width of the picture on the sensor, mm. Default 36, a full-frame camera held level; 24 is one held upright, or cropped
    /// to a square.
    pub sensor_width_mm: f64,
    /// Focal length over the diameter of the lens' opening, as on a camera: 2.8 blurs much, 16 little. Default: everything is
    /// sharp.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub f_number: Option<f64>,
    /// Radius of the lens' opening, mm, in place of `f_number`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub aperture_radius_mm: Option<f64>,
    /// Distance from the eye to the sharp plane, mm, along the viewing direction. Default: the distance to `target_mm`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focus_mm: Option<f64>,
    /// A point of the sharp plane, mm, in place of `focus_mm`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focus_point_mm: Option<[f64; 3]>,
    /// Straight blades of the opening, 3 to 64: lamps out of focus become polygons. Default 0, a round opening.
    pub blades: u32,
    /// Turns the polygon of the blades, degrees. Default 0: a corner points to the picture's right.
    pub blades_rotation_deg: f64,
}

impl Default for CameraDescription {
    fn default() -> Self {
        Self {
            position_mm: [0.0, -300.0, 150.0],
            target_mm: [0.0, 0.0, 60.0],
            up: [0.0, 0.0, 1.0],
            fov_deg: None,
            focal_length_mm: None,
            sensor_width_mm: 36.0,
            f_number: None,
            aperture_radius_mm: None,
            focus_mm: None,
            focus_point_mm: None,
            blades: 0,
            blades_rotation_deg: 0.0,
        }
    }
}

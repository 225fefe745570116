//! `[lights.NAME]`, and the emission of a shape.
//!
//! A light's colour (`spectrum`) is scaled to luminance 1, so `radiance`, `irradiance` and `intensity` are
//! luminance, illuminance and luminous intensity in relative units: a white diffuse sheet lit by irradiance
//! pi has radiance 1, and radiance 1 is display white at exposure 0.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::SpectrumDescription;

/// `[lights.NAME]`: a light, by `type`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum LightDescription {
    /// The same radiance from everywhere.
    Constant(ConstantLight),
    /// An image of the surroundings.
    Image(ImageLight),
    /// A far light, such as the sun.
    Distant(DistantLight),
    /// A light without size.
    Point(PointLight),
    /// A glowing rectangle or disc.
    Area(AreaLight),
    /// A clear sky by day, the sun and the ground.
    Sky(SkyLight),
}

/// `type = "constant"`: the same radiance from every direction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ConstantLight {
    /// Radiance. Default 1.
    pub radiance: f64,
    /// Colour. Default illuminant D65.
    pub spectrum: SpectrumDescription,
}

/// `type = "image"`: an equirectangular image of the surroundings, twice as wide as high, +z up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageLight {
    /// Image (.exr, .hdr, .png, .jpg), relative to the scene file; linear sRGB, where white 1 is radiance 1.
    pub file: String,
    /// Azimuth of the image's middle column, degrees from +x towards +y. Default 0.
    #[serde(default)]
    pub rotation_deg: f64,
    /// Factor on the radiance. Default 1.
    #[serde(default = "one")]
    pub scale: f64,
}

/// `type = "distant"`: parallel light, or a cone of it. Its direction is `azimuth_deg` and `elevation_deg`,
/// or `direction`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DistantLight {
    /// Azimuth of the light, degrees from +x towards +y. Default 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_deg: Option<f64>,
    /// Elevation of the light above the xy plane, degrees. Default 90: from above.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elevation_deg: Option<f64>,
    /// Direction towards the light, any length, in place of the two angles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub direction: Option<[f64; 3]>,
    /// Half of the angle that the light's disc subtends, degrees, below 90; 0 gives sharp shadows.
    /// Default 0.265, the sun's.
    pub angular_radius_deg: f64,
    /// Irradiance on a surface that faces the light. Default 3.14159 (white diffuse gets radiance 1).
    pub irradiance: f64,
    /// Colour. Default illuminant D65.
    pub spectrum: SpectrumDescription,
}

/// `type = "point"`: a light without size.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PointLight {
    /// Place, mm.
    pub position_mm: [f64; 3],
    /// Radiant intensity: irradiance at 1 mm. A light at d mm gives irradiance intensity / d^2.
    pub intensity: f64,
    /// Colour. Default illuminant D65.
    #[serde(default = "d65")]
    pub spectrum: SpectrumDescription,
}

/// Form of an area light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AreaShape {
    /// A rectangle of `width_mm` by `height_mm`.
    #[default]
    Quad,
    /// A disc of `radius_mm`.
    Disc,
}

/// `type = "area"`: a rectangle or disc that glows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AreaLight {
    /// `quad` or `disc`. Default `quad`.
    #[serde(default)]
    pub shape: AreaShape,
    /// Middle of the light, mm.
    pub position_mm: [f64; 3],
    /// Point that the light faces, mm. This or `normal`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target_mm: Option<[f64; 3]>,
    /// Direction that the light faces, any length. This or `target_mm`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal: Option<[f64; 3]>,
    /// `quad`: size across, level where possible, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub width_mm: Option<f64>,
    /// `quad`: size along the other edge, mm. Default: `width_mm`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_mm: Option<f64>,
    /// `disc`: radius, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius_mm: Option<f64>,
    /// Does the back glow too? Default false.
    #[serde(default)]
    pub two_sided: bool,
    /// Radiance in every direction in front. Default 1.
    #[serde(default = "one")]
    pub radiance: f64,
    /// Colour. Default illuminant D65.
    #[serde(default = "d65")]
    pub spectrum: SpectrumDescription,
}

/// `type = "sky"`: a clear sky by day (Preetham's), the sun's disc in it, and the ground below. The sun stands at `azimuth_deg` and
/// `elevation_deg`, or where it was at `date_time` at `latitude_deg` and `longitude_deg`.
///
/// The light is absolute, W m-2 sr-1 nm-1: in clear weather a surface that faces a high sun gets an irradiance of about 1.3. For the
/// picture that a camera would take, `film.exposure_ev` = 15.9 - EV, with EV = log2(N^2 / t) for f-number N and t seconds at ISO 100;
/// "sunny 16" (f/16, 1/100 s) is EV 15, an exposure of 0.9.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SkyLight {
    /// Haze: 2 is very clear, 3 clear, 6 hazy, 10 the most. Default 3.
    pub turbidity: f64,
    /// Azimuth of the sun, degrees from +x towards +y. Default 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_deg: Option<f64>,
    /// Elevation of the sun, degrees, 0 to 90. Default 45.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elevation_deg: Option<f64>,
    /// Date, time and offset from universal time, such as "2026-06-21T15:30+02:00", in place of the two angles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub date_time: Option<String>,
    /// Latitude of the place, degrees, north positive. Goes with `date_time`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latitude_deg: Option<f64>,
    /// Longitude of the place, degrees, east positive. Goes with `date_time`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub longitude_deg: Option<f64>,
    /// Azimuth of north in the scene, degrees from +x towards +y. Goes with `date_time`. Default 90: north is +y, as on a map.
    pub north_deg: f64,
    /// Does the sun's disc shine? Without it the sky lights alone, as in the shade. Default true.
    pub sun: bool,
    /// Reflectance of the ground, which sends light back from below the horizon. Default 0.2.
    pub ground: SpectrumDescription,
    /// Factor on all of the light. Default 1.
    pub scale: f64,
    /// Factor on the sky's own light, beside the sun's: 0.55 is nearer to newer models than Preetham's 1, with deeper shadows.
    /// Default 1.
    pub sky_scale: f64,
}

/// `emission` of a shape: the whole surface glows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EmissionDescription {
    /// Radiance. Default 1.
    pub radiance: f64,
    /// Do both sides glow? Default false: the side of the normal only.
    pub two_sided: bool,
    /// Colour. Default illuminant D65.
    pub spectrum: SpectrumDescription,
}

impl Default for ConstantLight {
    fn default() -> Self {
        Self { radiance: 1.0, spectrum: d65() }
    }
}

impl Default for DistantLight {
    fn default() -> Self {
        Self {
            azimuth_deg: None,
            elevation_deg: None,
            direction: None,
            angular_radius_deg: 0.265,
            irradiance: std::f64::consts::PI,
            spectrum: d65(),
        }
    }
}

impl Default for SkyLight {
    fn default() -> Self {
        Self {
            turbidity: 3.0,
            azimuth_deg: None,
            elevation_deg: None,
            date_time: None,
            latitude_deg: None,
            longitude_deg: None,
            north_deg: 90.0,
            sun: true,
            ground: SpectrumDescription::Constant(0.2),
            scale: 1.0,
            sky_scale: 1.0,
        }
    }
}

impl Default for EmissionDescription {
    fn default() -> Self {
        Self { radiance: 1.0, two_sided: false, spectrum: d65() }
    }
}

fn one() -> f64 {
    1.0
}

fn d65() -> SpectrumDescription {
    SpectrumDescription::illuminant("D65")
}

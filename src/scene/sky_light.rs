//! `type = "sky"`: a described sky to its two lights, the sky with the ground, and the sun's disc.

use glam::{DVec2, DVec3};

use super::assets::Assets;
use super::atmosphere::sun_irradiance;
use super::color::reflectance;
use super::description::SkyLight;
use super::emitter::Emitter;
use super::key::Key;
use super::sky::Sky;
use super::sun_position::sun_position;
use crate::Result;
use crate::math::Frame;
use crate::spectrum::Spectrum;

/// Half the angle of the sun's disc, degrees.
const SUN_RADIUS_DEG: f64 = 0.2665;

/// Checks and compiles a sky.
pub(super) fn compile(d: &SkyLight, key: &Key, assets: &dyn Assets) -> Result<Vec<Emitter>> {
    let turbidity = key.at("turbidity").within(d.turbidity, 2.0..=10.0, "within 2 to 10")?;
    let scale = key.at("scale").not_negative(d.scale)?;
    let sky_scale = key.at("sky_scale").not_negative(d.sky_scale)?;
    let ground = reflectance(&d.ground, &key.at("ground"), assets)?;
    let (azimuth_deg, elevation_deg) = sun_angles(d, key)?;
    let (sin, cos) = elevation_deg.to_radians().sin_cos();
    let towards: DVec3 = (DVec2::from_angle(azimuth_deg.to_radians()) * cos).extend(sin);
    let irradiance = match d.sun {
        true => sun_irradiance(elevation_deg, turbidity).scaled(scale as f32),
        false => Spectrum::Constant(0.0),
    };
    let sky = key.under(Sky::new(towards, turbidity, &irradiance, &ground, scale * sky_scale))?;
    let mut emitters = vec![Emitter::Sky(Box::new(sky))];
    if d.sun {
        let radius = SUN_RADIUS_DEG.to_radians();
        emitters.push(Emitter::Distant {
            frame: Frame::from_normal(towards.as_vec3().normalize()),
            one_minus_cos: (2.0 * (radius / 2.0).sin().powi(2)) as f32,
            value: irradiance.scaled((1.0 / (std::f64::consts::PI * radius.sin().powi(2))) as f32),
        });
    }
    Ok(emitters)
}

/// Azimuth, from +x towards +y, and elevation of the sun, degrees.
fn sun_angles(d: &SkyLight, key: &Key) -> Result<(f64, f64)> {
    let north = key.at("north_deg").finite(d.north_deg)?;
    let Some(date_time) = &d.date_time else {
        for (value, name) in [(d.latitude_deg, "latitude_deg"), (d.longitude_deg, "longitude_deg")] {
            if value.is_some() {
                return Err(key.at(name).invalid("a place needs `date_time`"));
            }
        }
        let elevation = d.elevation_deg.unwrap_or(45.0);
        let elevation = key.at("elevation_deg").within(elevation, 0.0..=90.0, "within 0 to 90 degrees")?;
        return Ok((key.at("azimuth_deg").finite(d.azimuth_deg.unwrap_or(0.0))?, elevation));
    };
    for (value, name) in [(d.elevation_deg, "elevation_deg"), (d.azimuth_deg, "azimuth_deg")] {
        if value.is_some() {
            return Err(key.at(name).invalid(format!("give `{name}` or `date_time`, not both")));
        }
    }
    let place = |value: Option<f64>, name: &str, most: f64| match value {
        Some(v) => key.at(name).within(v, -most..=most, &format!("within -{most} to {most} degrees")),
        None => Err(key.at("date_time").invalid(format!("a date needs a place: missing key `{name}`"))),
    };
    let latitude = place(d.latitude_deg, "latitude_deg", 90.0)?;
    let longitude = place(d.longitude_deg, "longitude_deg", 180.0)?;
    let position = key.under(sun_position(date_time, latitude, longitude))?;
    if position.elevation_deg < 0.0 {
        let below = -position.elevation_deg;
        let what = format!("the sun is {below:.1} degrees below the horizon then; this is the sky by day");
        return Err(key.at("date_time").invalid(what));
    }
    Ok((north - position.azimuth_deg, position.elevation_deg))
}

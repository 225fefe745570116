//! Described lights to emitters.

use glam::{DVec2, Vec3};

use super::assets::Assets;
use super::color::emission;
use super::description::{
    AreaLight, AreaShape, DistantLight, EmissionDescription, ImageLight, LightDescription,
};
use super::emitter::{AreaEmitter, Emitter};
use super::environment::Environment;
use super::key::Key;
use super::shape::{self, place};
use super::sky_light;
use crate::Result;
use crate::geometry::Mesh;
use crate::io;
use crate::math::Frame;
use crate::spectrum::Spectrum;

/// A compiled light; an area light brings the surface that it glows on.
pub(super) struct CompiledLight {
    /// More than one where a described light has several parts.
    pub(super) emitters: Vec<Emitter>,
    pub(super) mesh: Option<Mesh>,
}

/// Checks and compiles a light.
pub(super) fn compile(d: &LightDescription, key: &Key, assets: &dyn Assets) -> Result<CompiledLight> {
    let spectrum = |d| emission(d, &key.at("spectrum"), assets);
    let scaled = |d, name: &str, value: f64| -> Result<Spectrum> {
        Ok(spectrum(d)?.scaled(key.at(name).not_negative(value)? as f32))
    };
    let emitter = match d {
        LightDescription::Constant(l) => {
            Emitter::Constant { radiance: scaled(&l.spectrum, "radiance", l.radiance)? }
        }
        LightDescription::Image(l) => image(l, key, assets)?,
        LightDescription::Distant(l) => distant(l, key, scaled(&l.spectrum, "irradiance", l.irradiance)?)?,
        LightDescription::Point(l) => Emitter::Point {
            position: key.at("position_mm").vector(l.position_mm)?.as_vec3(),
            intensity: scaled(&l.spectrum, "intensity", l.intensity)?,
        },
        LightDescription::Area(l) => {
            let mesh = area_mesh(l, key)?;
            let radiance = scaled(&l.spectrum, "radiance", l.radiance)?;
            let emitter = Emitter::Area(AreaEmitter::new(&mesh, radiance, l.two_sided));
            return Ok(CompiledLight { emitters: vec![emitter], mesh: Some(mesh) });
        }
        LightDescription::Sky(l) => {
            return Ok(CompiledLight { emitters: sky_light::compile(l, key, assets)?, mesh: None });
        }
    };
    Ok(CompiledLight { emitters: vec![emitter], mesh: None })
}

/// The light of a glowing shape.
pub(super) fn of_shape(
    d: &EmissionDescription,
    mesh: &Mesh,
    key: &Key,
    assets: &dyn Assets,
) -> Result<Emitter> {
    let radiance = key.at("radiance").not_negative(d.radiance)? as f32;
    let spectrum = emission(&d.spectrum, &key.at("spectrum"), assets)?;
    Ok(Emitter::Area(AreaEmitter::new(mesh, spectrum.scaled(radiance), d.two_sided)))
}

fn image(l: &ImageLight, key: &Key, assets: &dyn Assets) -> Result<Emitter> {
    let file = key.at("file");
    let bytes = file.says(assets.read(&l.file))?;
    let image = file.says(io::image::read(&bytes, io::image::MAX_PIXELS))?;
    let rotation = key.at("rotation_deg").finite(l.rotation_deg)?.to_radians() as f32;
    let scale = key.at("scale").not_negative(l.scale)? as f32;
    let environment = key.under(Environment::new(image.width, image.height, image.rgb, rotation))?;
    Ok(Emitter::Image { image: Box::new(environment), scale })
}

fn distant(l: &DistantLight, key: &Key, irradiance: Spectrum) -> Result<Emitter> {
    let towards = match (l.direction, l.azimuth_deg, l.elevation_deg) {
        (Some(d), None, None) => key.at("direction").direction(d)?,
        (Some(_), ..) => {
            return Err(key.at("direction").invalid("give the direction or the angles, not both"));
        }
        (None, azimuth, elevation) => {
            let azimuth = key.at("azimuth_deg").finite(azimuth.unwrap_or(0.0))?.to_radians();
            let elevation = elevation.unwrap_or(90.0);
            let elevation =
                key.at("elevation_deg").within(elevation, -90.0..=90.0, "within -90 to 90 degrees")?;
            let (sin, cos) = elevation.to_radians().sin_cos();
            (DVec2::from_angle(azimuth) * cos).extend(sin)
        }
    };
    let radius = key.at("angular_radius_deg").within(
        l.angular_radius_deg,
        0.0..90.0,
        "within 0 to 90 degrees (90 excluded)",
    )?;
    // 1 - cos and sin^2 without losing the digits of small angles. Below 1e-3 degrees, f32 directions do
    // not resolve the cone: the light is parallel.
    let half = (radius.to_radians() / 2.0).sin();
    let one_minus_cos = if radius < 1e-3 { 0.0 } else { (2.0 * half * half) as f32 };
    let projected = std::f64::consts::PI * radius.to_radians().sin().powi(2);
    let value = if one_minus_cos == 0.0 { irradiance } else { irradiance.scaled((1.0 / projected) as f32) };
    Ok(Emitter::Distant { frame: Frame::from_normal(towards.as_vec3().normalize()), one_minus_cos, value })
}

/// The glowing rectangle or disc, its normal towards what it lights.
fn area_mesh(l: &AreaLight, key: &Key) -> Result<Mesh> {
    let position = key.at("position_mm").vector(l.position_mm)?;
    let normal = match (l.target_mm, l.normal) {
        (Some(target), None) => {
            let key = key.at("target_mm");
            (key.vector(target)? - position)
                .try_normalize()
                .ok_or_else(|| key.invalid("the target is the light's own place"))?
        }
        (None, Some(n)) => key.at("normal").direction(n)?,
        _ => return Err(key.invalid("give either `target_mm` or `normal`")),
    };
    let length = |value: Option<f64>, name: &str| match value {
        Some(v) => key.at(name).positive(v),
        None => Err(key.invalid(format!("missing key `{name}`"))),
    };
    let unused = |value: Option<f64>, name: &str, shape: &str| match value {
        Some(_) => Err(key.at(name).invalid(format!("a {shape} has no such size"))),
        None => Ok(()),
    };
    let mesh = match l.shape {
        AreaShape::Quad => {
            unused(l.radius_mm, "radius_mm", "quad")?;
            let width = length(l.width_mm, "width_mm")?;
            shape::quad(width, length(l.height_mm.or(l.width_mm), "height_mm")?)
        }
        AreaShape::Disc => {
            unused(l.width_mm, "width_mm", "disc")?;
            unused(l.height_mm, "height_mm", "disc")?;
            shape::disc(length(l.radius_mm, "radius_mm")?)
        }
    };
    let n = normal.as_vec3().normalize();
    // The width lies level where there is a level direction across the normal.
    let frame = Frame::from_normal_tangent(n, Vec3::Z.cross(n));
    Ok(place(mesh, |p| frame.to_world(p) + position.as_vec3(), |v| frame.to_world(v)))
}

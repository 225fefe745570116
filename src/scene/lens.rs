//! Cameras as photographers describe them, to [`CameraSettings`].
//!
//! Model: a thin lens of focal length f, focused on the plane at distance s, makes its picture at distance v; its
//! opening is a circle of diameter D:
//!
//! ```text
//! 1/f = 1/s + 1/v        tan(angle of width / 2) = w / (2 v)        D = f / N
//! blur of a point at depth d, on the sensor:  c = D f |d - s| / (d (s - f))
//! ```
//!
//! | symbol | key | unit | default |
//! |---|---|---|---|
//! | f | `focal_length_mm` | mm | from `fov_deg`, the angle of the picture's height |
//! | w | `sensor_width_mm` | mm | 36 |
//! | s | `focus_mm`, or the depth of `focus_point_mm` | mm | the target's |
//! | N | `f_number` | 1 | none: everything is sharp |
//! | D/2 | `aperture_radius_mm` | mm | in place of N |
//!
//! So a lens close to its subject sees less than its angle at infinity, as a real one does, and `fov_deg` is the angle
//! that is seen. Limits: a lens does not focus nearer than f; no lens elements, so no distortion, no colour error and
//! no flare. Guarded by `blur_is_the_circle_of_confusion`, `angle_and_focal_length_agree`,
//! `contradictions_are_errors_by_key`. Source: the thin lens equation, any textbook of optics.

use glam::DVec3;

use super::aperture::Aperture;
use super::camera::CameraSettings;
use super::description::CameraDescription;
use super::key::Key;
use crate::Result;

/// Checks a camera and puts its numbers into one form.
pub(super) fn compile(d: &CameraDescription, film_px: [u32; 2]) -> Result<CameraSettings> {
    let key = Key::new("camera");
    let eye = key.at("position_mm").vector(d.position_mm)?;
    let target = key.at("target_mm").vector(d.target_mm)?;
    let forward = (target - eye)
        .try_normalize()
        .ok_or_else(|| key.at("target_mm").invalid("the camera stands on its target, so it looks nowhere"))?;
    let up = key.at("up").direction(d.up)?;
    if forward.cross(up).length() < 1e-6 {
        return Err(key.at("up").invalid("the camera looks along `up`; choose another direction as up"));
    }
    let focus = focus(d, &key, eye, forward, (target - eye).length())?;
    let sensor_width = key.at("sensor_width_mm").positive(d.sensor_width_mm)?;
    let sensor_height = sensor_width * f64::from(film_px[1]) / f64::from(film_px[0]);
    let (tan_half_height, focal_length) = match (d.fov_deg, d.focal_length_mm) {
        (Some(_), Some(_)) => {
            return Err(key.at("focal_length_mm").invalid("give `fov_deg` or `focal_length_mm`, not both"));
        }
        (None, Some(f)) => {
            let key = key.at("focal_length_mm");
            let f = key.positive(f)?;
            if focus <= f {
                let what =
                    format!("a lens of {f} mm cannot focus at {focus:.1} mm, nearer than its focal length");
                return Err(key.invalid(what));
            }
            (sensor_height / 2.0 * (1.0 / f - 1.0 / focus), f)
        }
        (fov, None) => {
            let fov = fov.unwrap_or(20.0);
            let fov = key.at("fov_deg").within(fov, 0.01..=179.0, "within 0.01 to 179 degrees")?;
            let tan = (fov.to_radians() / 2.0).tan();
            (tan, 1.0 / (2.0 * tan / sensor_height + 1.0 / focus))
        }
    };
    Ok(CameraSettings {
        eye: eye.as_vec3(),
        forward: forward.as_vec3().normalize(),
        up: up.as_vec3(),
        fov: (2.0 * tan_half_height.atan()) as f32,
        film_px,
        aperture: aperture(d, &key, focal_length)?,
        focus_mm: focus as f32,
    })
}

/// Distance of the sharp plane along `forward`, mm.
fn focus(d: &CameraDescription, key: &Key, eye: DVec3, forward: DVec3, target_mm: f64) -> Result<f64> {
    match (d.focus_mm, d.focus_point_mm) {
        (None, None) => Ok(target_mm),
        (Some(distance), None) => key.at("focus_mm").positive(distance),
        (None, Some(p)) => {
            let key = key.at("focus_point_mm");
            let depth = (key.vector(p)? - eye).dot(forward);
            key.within(depth, 1e-9.., "in front of the camera")
                .map_err(|_| key.invalid("the point lies behind the camera"))
        }
        (Some(_), Some(_)) => {
            Err(key.at("focus_mm").invalid("give `focus_mm` or `focus_point_mm`, not both"))
        }
    }
}

fn aperture(d: &CameraDescription, key: &Key, focal_length: f64) -> Result<Aperture> {
    let radius = match (d.aperture_radius_mm, d.f_number) {
        (None, None) => 0.0,
        (Some(radius), None) => key.at("aperture_radius_mm").not_negative(radius)?,
        (None, Some(number)) => focal_length / (2.0 * key.at("f_number").positive(number)?),
        (Some(_), Some(_)) => {
            return Err(key.at("f_number").invalid("give `f_number` or `aperture_radius_mm`, not both"));
        }
    };
    let blades = key.at("blades");
    if d.blades != 0 {
        blades.within(d.blades, 3..=64, "0 (round) or within 3 to 64")?;
    }
    if radius == 0.0 && (d.blades != 0 || d.blades_rotation_deg != 0.0) {
        let name = if d.blades != 0 { "blades" } else { "blades_rotation_deg" };
        return Err(key.at(name).invalid("a pinhole has no blades; give `f_number`"));
    }
    let rotation = key.at("blades_rotation_deg").finite(d.blades_rotation_deg)?.to_radians();
    Ok(Aperture { radius_mm: radius as f32, blades: d.blades, rotation: rotation as f32 })
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3};

    use super::super::camera::Camera;
    use super::*;

    fn at_origin() -> CameraDescription {
        CameraDescription {
            position_mm: [0.0; 3],
            target_mm: [0.0, 400.0, 0.0],
            focal_length_mm: Some(90.0),
            f_number: Some(2.8),
            ..CameraDescription::default()
        }
    }

    #[test]
    fn blur_is_the_circle_of_confusion() {
        let (f, n, w) = (90.0, 2.8, 36.0);
        for (s, d) in [(400.0, 300.0), (400.0, 700.0), (250.0, 251.0), (1e4, 800.0), (400.0, 1e6)] {
            let description = CameraDescription { focus_mm: Some(s), ..at_origin() };
            let camera = Camera::new(&compile(&description, [600, 400]).unwrap());
            // The middle of the film's ray through a point of the lens' rim passes the axis at the sharp plane. Where must
            // the film be met, so that this lens point looks at the point at depth d on the axis?
            let seen = |u: Vec2| {
                let lens = camera.ray(Vec2::splat(0.5), u).ray.origin;
                let at_sharp_plane = lens + (Vec3::Y * d as f32 - lens) * (s / d) as f32;
                camera.project(at_sharp_plane).unwrap()
            };
            let (left, right) = (seen(Vec2::new(0.0, 0.5)), seen(Vec2::new(1.0, 0.5)));
            let blur = f64::from((right - left).length()) * w;
            let expected = f / n * f * (d - s).abs() / (d * (s - f));
            assert!(
                (blur / expected - 1.0).abs() < 1e-3 || (blur - expected).abs() < 1e-4,
                "{s} {d}: {blur} {expected}"
            );
        }
    }

    #[test]
    fn angle_and_focal_length_agree() {
        let by_length = compile(&at_origin(), [600, 400]).unwrap();
        // v = 1 / (1/90 - 1/400), height 24 mm.
        let fov = 2.0 * (12.0 * (1.0f64 / 90.0 - 1.0 / 400.0)).atan();
        assert!((f64::from(by_length.fov) - fov).abs() < 1e-6);
        assert!((by_length.aperture.radius_mm - 90.0 / 5.6).abs() < 1e-4);
        let by_angle =
            CameraDescription { fov_deg: Some(fov.to_degrees()), focal_length_mm: None, ..at_origin() };
        let by_angle = compile(&by_angle, [600, 400]).unwrap();
        assert!((by_angle.aperture.radius_mm - by_length.aperture.radius_mm).abs() < 1e-4);
        // Without an f-number the framing is the same and all is sharp.
        let sharp = compile(&CameraDescription { f_number: None, ..at_origin() }, [600, 400]).unwrap();
        assert_eq!((sharp.fov, sharp.aperture.radius_mm), (by_length.fov, 0.0));
    }

    #[test]
    fn contradictions_are_errors_by_key() {
        let message = |change: fn(&mut CameraDescription)| {
            let mut d = at_origin();
            change(&mut d);
            compile(&d, [600, 400]).unwrap_err().to_string()
        };
        let both = message(|d| d.fov_deg = Some(20.0));
        assert!(both.contains("camera.focal_length_mm") && both.contains("`fov_deg`"), "{both}");
        assert!(message(|d| d.focus_mm = Some(80.0)).contains("cannot focus at 80.0 mm"));
        assert!(message(|d| d.aperture_radius_mm = Some(3.0)).contains("camera.f_number"));
        assert!(message(|d| d.f_number = Some(0.0)).contains("camera.f_number"));
        assert!(message(|d| d.f_number = Some(f64::NAN)).contains("camera.f_number"));
        assert!(message(|d| d.focal_length_mm = Some(-1.0)).contains("camera.focal_length_mm"));
        assert!(message(|d| d.sensor_width_mm = 0.0).contains("camera.sensor_width_mm"));
        assert!(message(|d| d.blades = 2).contains("camera.blades"));
        assert!(message(|d| d.blades_rotation_deg = f64::INFINITY).contains("camera.blades_rotation_deg"));
        let pinhole = message(|d| (d.f_number, d.blades) = (None, 6));
        assert!(pinhole.contains("camera.blades") && pinhole.contains("`f_number`"), "{pinhole}");
    }
}

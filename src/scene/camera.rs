//! Pinhole and thin-lens cameras.
//!
//! Model: the picture lies in a plane at unit distance along the viewing direction, its height
//! `2 tan(fov / 2)`; a ray goes from the eye through a point of it. The thin lens moves the ray's start
//! over its opening ([`Aperture`]) and keeps the point where the ray meets the sharp plane.
//!
//! The footprint of one pixel at distance t is taken as the disc of equal area across the ray; its radius is
//! `spread * t`, with `spread = sqrt(A cos^3(theta) / pi)` for a pixel of area A in that plane at angle theta
//! off the axis (a pixel's solid angle is A cos^3). Guarded by `footprint_is_the_pixels_solid_angle`.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::aperture::Aperture;
use crate::geometry::Ray;

/// A ray from the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraRay {
    /// The ray.
    pub ray: Ray,
    /// Growth of the radius of one pixel's footprint per mm along the ray.
    pub spread: f32,
}

/// A camera ready to make rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    eye: Vec3,
    forward: Vec3,
    /// To the right in the picture, as long as half its width at unit distance.
    right: Vec3,
    /// Up in the picture, as long as half its height at unit distance.
    up: Vec3,
    aperture: Aperture,
    focus_mm: f32,
    pixel_area: f32,
}

/// What fixes a camera; checked and made from the description by `compile`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraSettings {
    /// Eye, mm.
    pub eye: Vec3,
    /// Unit viewing direction.
    pub forward: Vec3,
    /// Any direction that is up and not parallel to `forward`.
    pub up: Vec3,
    /// Angle of the picture's height, radians.
    pub fov: f32,
    /// Size of the picture, pixels.
    pub film_px: [u32; 2],
    /// Opening of the lens.
    pub aperture: Aperture,
    /// Distance of the sharp plane along `forward`, mm.
    pub focus_mm: f32,
}

impl Camera {
    /// The camera with these settings.
    pub fn new(s: &CameraSettings) -> Self {
        let [width, height] = s.film_px.map(|n| n as f32);
        let half_height = (s.fov / 2.0).tan();
        let right = s.forward.cross(s.up).normalize_or(Vec3::X);
        Self {
            eye: s.eye,
            forward: s.forward,
            right: right * (half_height * width / height),
            up: right.cross(s.forward) * half_height,
            aperture: s.aperture,
            focus_mm: s.focus_mm,
            pixel_area: (2.0 * half_height / height).powi(2),
        }
    }

    /// The ray through `film`, (0, 0) the upper left and (1, 1) the lower right corner of the picture; `u_lens`
    /// in [0, 1)^2 chooses the point of the aperture.
    pub fn ray(&self, film: Vec2, u_lens: Vec2) -> CameraRay {
        let through = self.forward + self.right * (2.0 * film.x - 1.0) + self.up * (1.0 - 2.0 * film.y);
        let cos = 1.0 / through.length();
        let spread = (self.pixel_area * cos.powi(3) / PI).sqrt();
        if self.aperture.radius_mm == 0.0 {
            return CameraRay { ray: Ray::new(self.eye, through * cos), spread };
        }
        let lens = self.aperture.sample(u_lens);
        let start = self.right.normalize_or_zero() * lens.x + self.up.normalize_or_zero() * lens.y;
        let direction = (through * self.focus_mm - start).normalize_or(self.forward);
        CameraRay { ray: Ray::new(self.eye + start, direction), spread }
    }

    /// The eye, mm.
    pub fn eye(&self) -> Vec3 {
        self.eye
    }

    /// Unit viewing direction.
    pub fn forward(&self) -> Vec3 {
        self.forward
    }

    /// Tangent of half the angle of the picture's height.
    pub fn tan_half_fov(&self) -> f32 {
        self.up.length()
    }

    /// Where a point appears, as `film` of [`Camera::ray`] for the pinhole; `None` behind the eye.
    pub fn project(&self, p: Vec3) -> Option<Vec2> {
        let v = p - self.eye;
        let depth = v.dot(self.forward);
        if depth <= 0.0 {
            return None;
        }
        let x = v.dot(self.right) / (depth * self.right.length_squared());
        let y = v.dot(self.up) / (depth * self.up.length_squared());
        Some(Vec2::new((x + 1.0) / 2.0, (1.0 - y) / 2.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> CameraSettings {
        CameraSettings {
            eye: Vec3::new(10.0, -200.0, 40.0),
            forward: Vec3::new(0.1, 1.0, -0.2).normalize(),
            up: Vec3::Z,
            fov: 0.7,
            film_px: [320, 200],
            aperture: Aperture::default(),
            focus_mm: 150.0,
        }
    }

    #[test]
    fn orientation() {
        // Looking along +y with z up, x is to the right; the film's y runs down.
        let c = Camera::new(&CameraSettings { forward: Vec3::Y, ..settings() });
        let at = |x, y| c.ray(Vec2::new(x, y), Vec2::ZERO).ray.direction;
        assert!((at(0.5, 0.5) - Vec3::Y).length() < 1e-6);
        assert!(at(0.9, 0.5).x > 0.1 && at(0.5, 0.1).z > 0.1);
        // The picture's height spans the angle, its width the aspect ratio.
        assert!((at(0.5, 0.0).angle_between(at(0.5, 1.0)) - 0.7).abs() < 1e-4);
        let half_width = at(0.0, 0.5).angle_between(Vec3::Y).tan();
        assert!((half_width / (0.35f32.tan() * 1.6) - 1.0).abs() < 1e-4);
    }

    #[test]
    fn projection_inverts() {
        let c = Camera::new(&settings());
        for film in [Vec2::new(0.1, 0.2), Vec2::new(0.9, 0.4), Vec2::new(0.5, 0.99)] {
            let p = c.ray(film, Vec2::ZERO).ray.at(123.0);
            assert!((c.project(p).unwrap() - film).length() < 1e-4);
        }
    }

    #[test]
    fn lens_is_sharp_in_its_plane_only() {
        let aperture = Aperture { radius_mm: 5.0, ..Aperture::default() };
        let c = Camera::new(&CameraSettings { aperture, ..settings() });
        let film = Vec2::new(0.8, 0.3);
        let point = |u: Vec2, depth: f32| {
            let r = c.ray(film, u).ray;
            r.at((depth - (r.origin - c.eye).dot(c.forward)) / r.direction.dot(c.forward))
        };
        let corners = [Vec2::new(0.01, 0.5), Vec2::new(0.99, 0.5), Vec2::new(0.5, 0.01), Vec2::new(0.3, 0.9)];
        let sharp = point(Vec2::splat(0.5), 150.0);
        for u in corners {
            assert!((point(u, 150.0) - sharp).length() < 1e-3);
        }
        // At twice the distance the circle of confusion has the aperture's own radius.
        let blur = point(corners[0], 300.0) - point(Vec2::splat(0.5), 300.0);
        assert!((blur.length() - 5.0 * 0.98).abs() < 0.02, "{blur}");
    }

    #[test]
    fn footprint_is_the_pixels_solid_angle() {
        let c = Camera::new(&settings());
        for film in [Vec2::new(0.5, 0.5), Vec2::new(0.02, 0.98)] {
            let px = Vec2::new(1.0 / 320.0, 1.0 / 200.0);
            let d = |dx: f32, dy: f32| c.ray(film + px * Vec2::new(dx, dy), Vec2::ZERO).ray.direction;
            let solid_angle = (d(0.5, 0.0) - d(-0.5, 0.0)).cross(d(0.0, 0.5) - d(0.0, -0.5)).length();
            let spread = c.ray(film, Vec2::ZERO).spread;
            assert!((PI * spread * spread / solid_angle - 1.0).abs() < 1e-2);
        }
    }
}

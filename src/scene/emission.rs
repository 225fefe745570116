//! Light as it leaves the lights: their power, and rays that carry it.
//!
//! Model: for the sphere of radius R around a scene,
//!
//! ```text
//! power = pi R^2 ∫ L dw (constant, image, sky, distant)    4 pi I (point)    pi L A sides (area)
//! mean over rays of their weight = power
//! ```
//!
//! in radiance times mm2 sr. Guarded by `rays_carry_the_power`. Source: definitions of radiance and intensity.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use super::emitter::{Emitter, Lights};
use crate::geometry::Ray;
use crate::geometry::ray::offset_origin;
use crate::math::{Frame, warp};
use crate::spectrum::illuminant::d65;
use crate::spectrum::{RgbBasis, SampledSpectrum, SampledWavelengths};

impl Lights {
    /// Power that light `i` sends into a sphere of `radius_mm` around the scene, radiance times mm2 sr.
    pub fn power(&self, i: usize, radius_mm: f32, lambda: &SampledWavelengths) -> SampledSpectrum {
        let disc = PI * radius_mm * radius_mm;
        match &self.emitters()[i] {
            Emitter::Constant { radiance } => radiance.sample(lambda) * (2.0 * TAU * disc),
            Emitter::Image { image, scale } => {
                let rgb = image.integral().map(|v| v * scale * disc);
                RgbBasis::get().sample(rgb, lambda) * d65().sample(lambda)
            }
            Emitter::Sky(sky) => sky.integral(lambda) * disc,
            Emitter::Distant { one_minus_cos, value, .. } => {
                let solid_angle = if *one_minus_cos > 0.0 { TAU * one_minus_cos } else { 1.0 };
                value.sample(lambda) * (solid_angle * disc)
            }
            Emitter::Point { intensity, .. } => intensity.sample(lambda) * (2.0 * TAU),
            Emitter::Area(area) => {
                area.radiance().sample(lambda) * (PI * area.area_mm2() * area.sides() as f32)
            }
        }
    }

    /// A ray of light `i` with the power that it stands for; the mean of all is [`Lights::power`]. `sphere` is the middle
    /// and the radius, mm, of a sphere around the scene, which light from infinity enters.
    pub fn emit(
        &self,
        i: usize,
        sphere: (Vec3, f32),
        u: [Vec2; 2],
        lambda: &SampledWavelengths,
    ) -> Option<(Ray, SampledSpectrum)> {
        let (middle, radius) = sphere;
        // Light that comes from `w`: through a disc across it.
        let from = |w: Vec3, power_per_sr: SampledSpectrum| {
            let on = warp::square_to_disc(u[1]) * radius;
            let start = middle + Frame::from_normal(w).to_world(on.extend(radius));
            (Ray::new(start, -w), power_per_sr)
        };
        let disc = PI * radius * radius;
        Some(match &self.emitters()[i] {
            Emitter::Constant { .. } => from(warp::square_to_sphere(u[0]), self.power(i, radius, lambda)),
            Emitter::Image { image, scale } => {
                let (w, pdf_per_sr) = image.sample(u[0])?;
                let rgb = (image.rgb(w) * *scale).to_array();
                let radiance = RgbBasis::get().sample(rgb, lambda) * d65().sample(lambda);
                from(w, radiance * (disc / pdf_per_sr))
            }
            Emitter::Sky(sky) => {
                let (w, pdf_per_sr) = sky.sample(u[0])?;
                from(w, sky.radiance(w, lambda) * (disc / pdf_per_sr))
            }
            Emitter::Distant { frame, one_minus_cos, .. } => {
                let w = match *one_minus_cos > 0.0 {
                    true => frame.to_world(warp::square_to_cone(u[0], *one_minus_cos)),
                    false => frame.n,
                };
                from(w, self.power(i, radius, lambda))
            }
            Emitter::Point { position, .. } => {
                (Ray::new(*position, warp::square_to_sphere(u[0])), self.power(i, radius, lambda))
            }
            Emitter::Area(area) => {
                let (p, ng) = area.sample(u[0]);
                let (n, x) = match area.sides() {
                    1 => (ng, u[1].x),
                    _ if u[1].x < 0.5 => (ng, 2.0 * u[1].x),
                    _ => (-ng, 2.0 * u[1].x - 1.0),
                };
                let w =
                    Frame::from_normal(n).to_world(warp::square_to_cosine_hemisphere(Vec2::new(x, u[1].y)));
                (Ray::new(offset_origin(p, n, w), w.normalize()), self.power(i, radius, lambda))
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use glam::UVec2;

    use super::super::emitter::AreaEmitter;
    use super::super::environment::Environment;
    use super::super::shape;
    use super::super::sky::Sky;
    use super::*;
    use crate::math::Sampler;
    use crate::spectrum::Spectrum;

    #[test]
    fn rays_carry_the_power() {
        let value = || Spectrum::from_fn(|nm| nm / 500.0);
        let pixels = (0..16 * 8).map(|i| [0.1 + (i % 16) as f32, 0.5, (i / 16) as f32 * 0.3]).collect();
        let area = |sides: bool| Emitter::Area(AreaEmitter::new(&shape::quad(3.0, 4.0), value(), sides));
        let tilted = Frame::from_normal(Vec3::new(0.3, -0.5, 0.8).normalize());
        let sun = glam::DVec3::new(0.3, -0.4, 0.6).normalize();
        let sky = Sky::new(sun, 3.0, &value(), &Spectrum::Constant(0.2), 2.0).unwrap();
        let lights = Lights::new(
            vec![
                Emitter::Constant { radiance: value() },
                Emitter::Image { image: Box::new(Environment::new(16, 8, pixels, 1.0).unwrap()), scale: 0.5 },
                Emitter::Distant { frame: tilted, one_minus_cos: 0.1, value: value() },
                Emitter::Distant { frame: tilted, one_minus_cos: 0.0, value: value() },
                Emitter::Point { position: Vec3::X, intensity: value() },
                area(false),
                area(true),
                Emitter::Sky(Box::new(sky)),
            ],
            Vec3::ZERO,
            10.0,
        );
        let lambda = SampledWavelengths::visible(0.5);
        let sphere = (Vec3::new(1.0, 2.0, 3.0), 20.0);
        let n = 1 << 14;
        for i in 0..lights.emitters().len() {
            let mut sum = 0.0;
            let mut out = 0;
            for k in 0..n {
                let mut s = Sampler::new(9, UVec2::new(i as u32, 0), k);
                let (ray, weight) = lights.emit(i, sphere, [s.next_2d(), s.next_2d()], &lambda).unwrap();
                assert!((ray.direction.length() - 1.0).abs() < 1e-5);
                out += u32::from(ray.direction.z > 0.0);
                sum += f64::from(weight[3]) / f64::from(n);
            }
            let power = f64::from(lights.power(i, sphere.1, &lambda)[3]);
            assert!((sum / power - 1.0).abs() < 2e-3, "light {i}: {sum} {power}");
            let upward = f64::from(out) / f64::from(n);
            match i {
                0 | 4 | 6 => assert!((upward - 0.5).abs() < 0.01, "light {i}: {upward}"),
                5 => assert_eq!(out, n),
                2 | 3 => assert_eq!(out, 0),
                _ => {}
            }
        }
        // A sky of radiance 1 sends pi through each unit of the sphere's surface.
        let sky = Lights::new(vec![Emitter::Constant { radiance: Spectrum::Constant(1.0) }], Vec3::ZERO, 1.0);
        assert!((sky.power(0, 2.0, &lambda)[0] - PI * 4.0 * PI * 4.0).abs() < 1e-3);
    }
}

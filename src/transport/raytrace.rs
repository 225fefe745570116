//! The thesis' ray tracing: direct light only.
//!
//! Model: each surface that the camera sees is lit by the lights straight through the petals between, every
//! sheet taking its share ([`Scene::transmitted`]); a petal of cells is shaded from `petal.samples` random points of
//! the cells in the ray's footprint. No light goes from petal to petal otherwise.
//!
//! Limits: biased by intent. What a sheet lets through keeps its direction here, where `path` scatters it.
//! Without sheets between, equal to the direct light of `path` (`raytrace_is_the_direct_light_of_path`).

use super::direct::{Came, dimension_of_light, meet};
use super::shade::Shading;
use super::{Incident, Integrator, PixelRay};
use crate::math::Sampler;
use crate::scene::{Drawing, Scene};
use crate::spectrum::SampledWavelengths;

/// Direct light with attenuating shadows.
#[derive(Clone, Copy, Debug, Default)]
pub struct Raytrace;

impl Integrator for Raytrace {
    fn li(
        &self,
        scene: &Scene,
        pixel: &PixelRay,
        lambda: &SampledWavelengths,
        sampler: &mut Sampler,
    ) -> Incident {
        let mut result = Incident::default();
        let ray = pixel.ray;
        let (light, at) = meet(scene, &ray, Came::Camera, Drawing::Each, lambda);
        result.direct = light;
        let Some(at) = at else { return result };
        result.first = Some(at);
        let shading =
            Shading::new(scene, at, -ray.direction, lambda, Some(pixel), scene.petal.samples.into());
        for i in 0..scene.lights.emitters().len() {
            sampler.start_dimension(dimension_of_light(i));
            let u = sampler.next_2d();
            let Some(light) = scene.lights.sample_light(i, Drawing::Each, at.p, u, lambda) else { continue };
            let share = scene.transmitted(&at, light.wi, light.distance_mm, lambda);
            if !share.is_zero() {
                let (f_cos, _) = shading.eval(light.wi, lambda, sampler);
                result.direct += f_cos * light.radiance * share * (1.0 / light.pdf_per_sr);
            }
        }
        result
    }
}

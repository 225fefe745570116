//! Unbiased path tracing.
//!
//! Model: the light transport equation on two-sided sheets, by a random walk from the camera. At each surface
//! one light is sampled (next-event estimation) and one direction of the surface; the two are weighed by the
//! power heuristic (Veach 1997) wherever the surface's density is known. Paths end by Russian roulette with
//! their throughput, from `min_depth` on, and at `max_depth` surfaces, which is the only bias and counts as
//! the scene's own wish.
//!
//! Guarded by the furnace and sheet tests of `tests/analytic.rs`.

use super::shade::Shading;
use super::{Incident, Integrator, PixelRay};
use crate::math::Sampler;
use crate::scene::Scene;
use crate::spectrum::{SampledSpectrum, SampledWavelengths};

/// Path tracing with next-event estimation.
#[derive(Clone, Copy, Debug)]
pub struct Path {
    /// Most surfaces on a path.
    pub max_depth: u32,
    /// Surfaces before roulette may end a path.
    pub min_depth: u32,
}

/// Dimensions that one bounce may draw.
const DIMENSIONS_PER_BOUNCE: u32 = 8;
/// First dimension after those of the camera ([`super::render()`]).
pub(super) const FIRST_DIMENSION: u32 = 4;
/// Largest probability of going on: paths in a white room must end too.
const MAX_SURVIVAL: f32 = 0.98;

/// `a^2 / (a^2 + b^2)`, written for densities that may be large.
pub(super) fn power_heuristic(a: f32, b: f32) -> f32 {
    if a <= 0.0 {
        return 0.0;
    }
    let r = b / a;
    1.0 / (1.0 + r * r)
}

/// How the path came to where it is, which tells how a light that it meets is counted.
enum Came {
    /// From the camera: all of it.
    Camera,
    /// By a BSDF sample with this density: its share against light sampling.
    Density(f32),
    /// By a walk: light sampling counted it already.
    Walk,
}

impl Came {
    fn weight(&self, light_pdf: f32) -> f32 {
        match self {
            Came::Camera => 1.0,
            Came::Density(pdf) => power_heuristic(*pdf, light_pdf),
            Came::Walk => 0.0,
        }
    }
}

impl Integrator for Path {
    fn li(
        &self,
        scene: &Scene,
        pixel: &PixelRay,
        lambda: &SampledWavelengths,
        sampler: &mut Sampler,
    ) -> Incident {
        let mut result = Incident::default();
        let mut ray = pixel.ray;
        let mut throughput = SampledSpectrum::ONE;
        let mut came = Came::Camera;
        for depth in 0..=self.max_depth {
            // Light met now has been scattered `depth` times.
            let sum = if depth <= 1 { &mut result.direct } else { &mut result.indirect };
            let Some(at) = scene.intersect(&ray) else {
                let light = scene.lights.environment(ray.direction, lambda);
                if !light.is_zero() {
                    let w = came.weight(scene.lights.pdf_environment(ray.direction));
                    *sum += throughput * light * w;
                }
                break;
            };
            if let Some(emitter) = scene.shapes[at.shape as usize].emitter {
                let light = scene.lights.emitted(emitter, at.ng, -ray.direction, lambda);
                if !light.is_zero() {
                    let w = came.weight(scene.lights.pdf_area(emitter, ray.origin, at.p, at.ng));
                    *sum += throughput * light * w;
                }
            }
            if depth == 0 {
                result.first = Some(at);
            }
            if depth == self.max_depth {
                break;
            }

            sampler.start_dimension(FIRST_DIMENSION + depth * DIMENSIONS_PER_BOUNCE);
            let points = if depth == 0 { scene.petal.samples } else { 1 };
            let shading = Shading::new(scene, at, -ray.direction, (depth == 0).then_some(pixel), points);
            let u_pick = sampler.next_1d();
            let u_light = sampler.next_2d();
            if let Some(light) = scene.lights.sample(at.p, u_pick, u_light, lambda) {
                let (f_cos, pdf) = shading.eval(light.wi, lambda, sampler);
                if !f_cos.is_zero() && scene.unoccluded(&at, light.wi, light.distance_mm) {
                    let w = match pdf {
                        Some(pdf) if !light.delta => power_heuristic(light.pdf_per_sr, pdf),
                        _ => 1.0,
                    };
                    let sum = if depth == 0 { &mut result.direct } else { &mut result.indirect };
                    *sum += throughput * f_cos * light.radiance * (w / light.pdf_per_sr);
                }
            }

            sampler.start_dimension(FIRST_DIMENSION + depth * DIMENSIONS_PER_BOUNCE + 4);
            let Some(next) = shading.sample(lambda, sampler) else { break };
            throughput *= next.weight;
            if depth + 1 >= self.min_depth {
                sampler.start_dimension(FIRST_DIMENSION + depth * DIMENSIONS_PER_BOUNCE + 7);
                let survive = throughput.max().min(MAX_SURVIVAL);
                if sampler.next_1d() >= survive {
                    break;
                }
                throughput *= 1.0 / survive;
            }
            came = next.pdf_per_sr.map_or(Came::Walk, Came::Density);
            ray = Scene::leave(&at, next.direction);
        }
        result
    }
}

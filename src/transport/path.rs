//! Unbiased path tracing.
//!
//! Model: the light transport equation on two-sided sheets, by a random walk from the camera. At each surface
//! one light is sampled (next-event estimation; every light at the first surface, whose direct light is most
//! of the picture and of its noise) and one direction of the surface; the two are weighed by the
//! power heuristic (Veach 1997) wherever the surface's density is known. Paths end by Russian roulette with
//! their throughput, from `min_depth` on, and at `max_depth` surfaces, which is the only bias and counts as
//! the scene's own wish.
//!
//! Guarded by the furnace and sheet tests of `tests/analytic.rs`.

use super::shade::Shading;
use super::{Incident, Integrator, PixelRay};
use crate::geometry::Interaction;
use crate::math::Sampler;
use crate::scene::{Drawing, LightSample, Scene};
use crate::spectrum::{SampledSpectrum, SampledWavelengths};

/// Path tracing with next-event estimation.
#[derive(Clone, Copy, Debug)]
pub struct Path {
    /// Most surfaces on a path.
    pub max_depth: u32,
    /// Surfaces before roulette may end a path.
    pub min_depth: u32,
}

/// Scenes with more lights than this draw one of them where the camera looks, too.
const MAX_EACH: usize = 8;
/// Dimensions of one light at the first surface: its point, and the points of the cells that it lights.
pub(super) const DIMENSIONS_PER_LIGHT: u32 = 2;
/// Dimensions of one bounce: light's number, point and cells; direction's lobe, angles and walk; roulette.
const DIMENSIONS_PER_BOUNCE: u32 = 7;
/// First dimension after those of the camera ([`super::render()`]).
pub(super) const FIRST_DIMENSION: u32 = 4;
/// First dimension of a bounce; those of all lights at the first surface come before.
fn dimension_of(depth: u32) -> u32 {
    FIRST_DIMENSION + DIMENSIONS_PER_LIGHT * MAX_EACH as u32 + depth * DIMENSIONS_PER_BOUNCE
}

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

impl Path {
    /// Light of one drawn light that the surface sends on, per throughput.
    fn reflected(
        scene: &Scene,
        at: &Interaction,
        shading: &Shading,
        light: &LightSample,
        lambda: &SampledWavelengths,
        sampler: &mut Sampler,
    ) -> SampledSpectrum {
        // A walk through cells costs more than a shadow ray, a formula less.
        let seen = || scene.unoccluded(at, light.wi, light.distance_mm);
        if shading.is_walk() && !seen() {
            return SampledSpectrum::ZERO;
        }
        let (f_cos, pdf) = shading.eval(light.wi, lambda, sampler);
        if f_cos.is_zero() || (!shading.is_walk() && !seen()) {
            return SampledSpectrum::ZERO;
        }
        let weight = match pdf {
            Some(pdf) if !light.delta => power_heuristic(light.pdf_per_sr, pdf),
            _ => 1.0,
        };
        f_cos * light.radiance * (weight / light.pdf_per_sr)
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
        let lights = &scene.lights;
        let mut result = Incident::default();
        let mut ray = pixel.ray;
        let mut throughput = SampledSpectrum::ONE;
        let mut came = Came::Camera;
        let mut drawing = Drawing::One;
        for depth in 0..=self.max_depth {
            // Light met now has been scattered `depth` times.
            let sum = if depth <= 1 { &mut result.direct } else { &mut result.indirect };
            let Some(at) = scene.intersect(&ray) else {
                let light = lights.environment(ray.direction, lambda);
                if !light.is_zero() {
                    let w = came.weight(lights.pdf_environment(ray.direction, drawing));
                    *sum += throughput * light * w;
                }
                break;
            };
            if let Some(emitter) = scene.shapes[at.shape as usize].emitter {
                let light = lights.emitted(emitter, at.ng, -ray.direction, lambda);
                if !light.is_zero() {
                    let w = came.weight(lights.pdf_area(emitter, ray.origin, at.p, at.ng, drawing));
                    *sum += throughput * light * w;
                }
            }
            if depth == 0 {
                result.first = Some(at);
            }
            if depth == self.max_depth {
                break;
            }

            let points = if depth == 0 { scene.petal.samples } else { 1 };
            let shading =
                Shading::new(scene, at, -ray.direction, lambda, (depth == 0).then_some(pixel), points);
            let dimension = dimension_of(depth);
            if depth == 0 && lights.emitters().len() <= MAX_EACH {
                drawing = Drawing::Each;
                for i in 0..lights.emitters().len() {
                    sampler.start_dimension(FIRST_DIMENSION + DIMENSIONS_PER_LIGHT * i as u32);
                    let u = sampler.next_2d();
                    if let Some(light) = lights.sample_light(i, drawing, at.p, u, lambda) {
                        result.direct += Self::reflected(scene, &at, &shading, &light, lambda, sampler);
                    }
                }
            } else {
                drawing = Drawing::One;
                sampler.start_dimension(dimension);
                let u_pick = sampler.next_1d();
                let u = sampler.next_2d();
                if let Some(light) = lights.sample(at.p, u_pick, u, lambda) {
                    let sum = if depth == 0 { &mut result.direct } else { &mut result.indirect };
                    *sum += throughput * Self::reflected(scene, &at, &shading, &light, lambda, sampler);
                }
            }

            sampler.start_dimension(dimension + 3);
            let Some(next) = shading.sample(lambda, sampler) else { break };
            throughput *= next.weight;
            if depth + 1 >= self.min_depth {
                sampler.start_dimension(dimension + 6);
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

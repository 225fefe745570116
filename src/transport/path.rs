//! Unbiased path tracing.
//!
//! Model: the light transport equation on two-sided sheets, by a random walk from the camera. At each surface
//! one light is sampled (next-event estimation; every light at the first surface, whose direct light is most
//! of the picture and of its noise) and one direction of the surface; the two are weighed by the
//! power heuristic (Veach 1997, `direct`) wherever the surface's density is known. Paths end by Russian roulette with
//! their throughput, from `min_depth` on, and at `max_depth` surfaces, which is the only bias and counts as
//! the scene's own wish.
//!
//! A [`Guide`] chooses lights at bounces by what a coarse solution knows of the place: every
//! light keeps a probability above zero, and its light is divided by that.
//!
//! Guarded by the furnace and sheet tests of `tests/analytic.rs`; with a guide `guided_paths_find_the_same_light`,
//! `a_guide_that_knows_nothing_is_harmless`.

use std::sync::Arc;

use super::direct::{
    Came, Onward, chosen_light, dimension_of, first_lights, meet, one_light, points_of, survival,
};
use super::guide::Guide;
use super::shade::Shading;
use super::{Incident, Integrator, PixelRay};
use crate::math::Sampler;
use crate::scene::{Drawing, Scene};
use crate::spectrum::{SampledSpectrum, SampledWavelengths};

/// Path tracing with next-event estimation.
#[derive(Clone, Debug, Default)]
pub struct Path {
    /// Most surfaces on a path.
    pub max_depth: u32,
    /// Surfaces before roulette may end a path.
    pub min_depth: u32,
    /// What is known of the scene's light before paths are traced.
    pub guide: Option<Arc<Guide>>,
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
        let mut drawing = Drawing::One;
        for depth in 0..=self.max_depth {
            // Light met now has been scattered `depth` times.
            let (light, at) = meet(scene, &ray, came, drawing, lambda);
            let sum = if depth <= 1 { &mut result.direct } else { &mut result.indirect };
            *sum += throughput * light;
            let Some(at) = at else { break };
            if depth == 0 {
                result.first = Some(at);
            }
            if depth == self.max_depth {
                break;
            }

            let wo = -ray.direction;
            let points = points_of(scene, depth);
            let shading = Shading::new(scene, at, wo, lambda, (depth == 0).then_some(pixel), points);
            let dimension = dimension_of(depth);
            if depth == 0 {
                let (light, how) = first_lights(scene, &at, &shading, lambda, sampler);
                result.direct += light;
                drawing = how;
            } else if let Some(p) = self.guide.as_ref().and_then(|g| g.pick(scene, &at, wo)) {
                let light = chosen_light(scene, &at, &shading, &p, dimension, lambda, sampler);
                result.indirect += throughput * light;
                drawing = Drawing::Chosen(p);
            } else {
                let light = one_light(scene, &at, &shading, Onward::Whole, dimension, lambda, sampler);
                result.indirect += throughput * light;
                drawing = Drawing::One;
            }

            sampler.start_dimension(dimension + 4);
            let Some(next) = shading.sample(lambda, sampler) else { break };
            throughput *= next.weight;
            if depth + 1 >= self.min_depth {
                sampler.start_dimension(dimension + 7);
                let survive = survival(&throughput);
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

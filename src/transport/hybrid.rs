//! Ray tracing joined to radiosity, each light path counted once.
//!
//! Model: light that goes from surface to surface without a preferred direction is smooth and is taken from a solution
//! ([`IndirectLight`], in practice [`Radiosity`]); all that is sharp is traced: lights seen
//! directly, direct light with its shadows, cells, highlights. The BSDF is `f = D / pi + S`, a diffuse part and the rest
//! ([`crate::bsdf::Bsdf::diffuse`]). At the first surface the whole of f sends one ray on, to gather. What that ray meets
//! sends light by
//!
//! ```text
//! L = integral of f L_lights cos dw  +  (D_r E_ind(own side) + D_t E_ind(other side)) / pi  +  integral of S L_surfaces cos dw
//!     direct light, drawn               from the solution                                      one more ray, by S alone
//! ```
//!
//! **Path grammar**, from the eye E to a light L, with X a scattering by all of f, D by its diffuse part, S by its rest:
//!
//! ```text
//! E L                            lights seen
//! E X L                          direct light of the first surface
//! E X N* S* X L                  direct light of what the gathering ray and those of S meet
//! E X N* S* D [X X* L]           light whose next scattering is on another surface: E_ind
//! ```
//!
//! A path of k scatterings is one of these, and in one way: its first scattering is X; at each further one that is not the
//! last the path goes on by D, and is in the last line, or by S, and the question is asked again. E_ind holds no direct
//! light: that a solution's *whole* irradiance be added to what rays find is the double count that Rushmeier and Torrance
//! warned of. N: a surface met within `near` times the solution's resolution there is one that the solution does not
//! resolve; it sends light on by all of f, as the first surface does, and has no D.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | E_ind | `solution` | irradiance | none |
//! | most scatterings that are traced | `max_depth` | | `render.max_depth` |
//! | | `near` | lengths of an element | 1 |
//!
//! Limits: inside the solution the rest S is carried as diffuse light of the same total, and E_ind has the error of the
//! solution; both are seen through two scatterings at least. E_ind has all orders, whatever `max_depth` is. With an exact
//! E_ind the picture is that of `path` (`hybrid_with_exact_irradiance_is_path`); each line of the grammar by itself
//! (`lines_of_the_grammar`); adding direct light again is found (`counting_direct_light_twice_is_found`).
//! Source: Rushmeier and Torrance, ACM Trans. Graph. 9:1, 1990; final gathering as in Reichert, M.Sc. thesis, Cornell
//! University, 1992; the rest is our reading.

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use super::direct::{Came, Onward, dimension_of, first_lights, meet, one_light, survives};
use super::radiosity::Radiosity;
use super::shade::Shading;
use super::{Incident, Integrator, PixelRay};
use crate::geometry::{Interaction, Side};
use crate::math::Sampler;
use crate::scene::{Drawing, Scene};
use crate::spectrum::{SampledSpectrum, SampledWavelengths};

/// A solution of the light that comes from other surfaces.
pub trait IndirectLight: Sync {
    /// Irradiance of a side at a point by all light that comes from surfaces, but for what they emit.
    fn indirect(&self, at: &Interaction, side: Side, lambda: &SampledWavelengths) -> SampledSpectrum;

    /// Length on the surface within which the solution knows no detail, mm.
    fn resolution_mm(&self, at: &Interaction) -> f32;
}

impl IndirectLight for Radiosity {
    fn indirect(&self, at: &Interaction, side: Side, lambda: &SampledWavelengths) -> SampledSpectrum {
        Radiosity::indirect(self, at, side, lambda)
    }

    fn resolution_mm(&self, at: &Interaction) -> f32 {
        self.elements().hit(at).map_or(0.0, |e| self.elements().list()[e as usize].area_mm2.sqrt())
    }
}

impl<T: IndirectLight + Send> IndirectLight for Arc<T> {
    fn indirect(&self, at: &Interaction, side: Side, lambda: &SampledWavelengths) -> SampledSpectrum {
        (**self).indirect(at, side, lambda)
    }

    fn resolution_mm(&self, at: &Interaction) -> f32 {
        (**self).resolution_mm(at)
    }
}

/// Ray tracing with a final gather from a solution of the indirect light.
#[derive(Clone, Copy, Debug)]
pub struct Hybrid<T> {
    /// Where the diffuse light comes from.
    pub solution: T,
    /// Most scatterings that are traced.
    pub max_depth: u32,
    /// Surfaces nearer than this many lengths of the solution's resolution are traced through.
    pub near: f32,
}

impl<T: IndirectLight> Hybrid<T> {
    /// Light that the diffuse part of the surface sends to the viewer, of what comes from other surfaces.
    fn gathered(&self, at: &Interaction, shading: &Shading, lambda: &SampledWavelengths) -> SampledSpectrum {
        let [reflected, transmitted] = shading.diffuse(lambda);
        let side = shading.side();
        let mut sum = SampledSpectrum::ZERO;
        for (share, side) in [(reflected, side), (transmitted, side.other())] {
            if !share.is_zero() {
                sum += share * self.solution.indirect(at, side, lambda);
            }
        }
        sum * FRAC_1_PI
    }
}

impl<T: IndirectLight> Integrator for Hybrid<T> {
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

            let points = if depth == 0 { scene.petal.samples } else { 1 };
            let shading =
                Shading::new(scene, at, -ray.direction, lambda, (depth == 0).then_some(pixel), points);
            let dimension = dimension_of(depth);
            let mut onward = Onward::Whole;
            if depth == 0 {
                let (light, how) = first_lights(scene, &at, &shading, lambda, sampler);
                result.direct += light;
                drawing = how;
            } else {
                if at.t >= self.near * self.solution.resolution_mm(&at) {
                    onward = Onward::Rest;
                    result.indirect += throughput * self.gathered(&at, &shading, lambda);
                }
                let light = one_light(scene, &at, &shading, onward, dimension, lambda, sampler);
                result.indirect += throughput * light;
                drawing = Drawing::One;
            }

            sampler.start_dimension(dimension + 3);
            let next = match onward {
                Onward::Whole => shading.sample(lambda, sampler),
                Onward::Rest => shading.sample_rest(lambda, sampler),
            };
            let Some(next) = next else { break };
            throughput *= next.weight;
            // The first surface always gathers: its light is most of the picture.
            if depth > 0 {
                sampler.start_dimension(dimension + 6);
                if !survives(&mut throughput, sampler.next_1d()) {
                    break;
                }
            }
            came = next.pdf_per_sr.map_or(Came::Walk, Came::Density);
            ray = Scene::leave(&at, next.direction);
        }
        result
    }
}

#[cfg(test)]
mod tests;

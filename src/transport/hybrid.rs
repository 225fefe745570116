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
//! Next to a glowing shape the ray onward is drawn from all of f, for the light that it meets, and carries S only for what
//! else it meets; elsewhere it is drawn from S, and there is none where S is zero.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | E_ind | `solution` | irradiance | none |
//! | most scatterings that are traced | `max_depth` | | `render.max_depth` |
//! | | `near` | lengths of an element | 1 |
//!
//! On the default scene, 8000 elements, the mean of the picture is that of `path` to 0.04 %; with diffuse petals (20000 elements)
//! to 0.2 %, which is the noise of 64 samples per pixel.
//!
//! Limits: inside the solution the rest S is carried as diffuse light of the same total, and E_ind has the error of the
//! solution; both are seen through two scatterings at least. E_ind has all orders, whatever `max_depth` is. With an exact
//! E_ind the picture is that of `path` (`hybrid_with_exact_irradiance_is_path`); each line of the grammar by itself
//! (`lines_of_the_grammar`); adding direct light again is found (`counting_direct_light_twice_is_found`).
//! Source: Rushmeier and Torrance, ACM Trans. Graph. 9:1, 1990; final gathering as in Reichert, M.Sc. thesis, Cornell
//! University, 1992; the rest is our reading.

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use super::direct::{Came, Onward, dimension_of, first_lights, meet, one_light, points_of, survival};
use super::radiosity::Radiosity;
use super::shade::Shading;
use super::{Incident, Integrator, PixelRay};
use glam::Vec3;

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
#[derive(Clone, Debug)]
pub struct Hybrid<T> {
    /// Where the diffuse light comes from.
    pub solution: T,
    /// Most scatterings that are traced.
    pub max_depth: u32,
    /// Surfaces nearer than this many lengths of the solution's resolution are traced through.
    pub near: f32,
    /// Corners of the boxes around glowing shapes, as wide again as the shape is: in there its light is a large part of the
    /// hemisphere, and points drawn on it alone would give noise without bound.
    glowing: Vec<(Vec3, Vec3)>,
}

impl<T: IndirectLight> Hybrid<T> {
    /// For the scene of the solution.
    pub fn new(scene: &Scene, solution: T, max_depth: u32, near: f32) -> Self {
        let glowing = scene.shapes.iter().filter(|s| s.emitter.is_some()).map(|s| {
            let (low, high) = s.mesh.bounds();
            let around = Vec3::splat((high - low).length());
            (low - around, high + around)
        });
        Self { solution, max_depth, near, glowing: glowing.collect() }
    }

    /// Is the point next to something that glows?
    fn beside_a_light(&self, p: Vec3) -> bool {
        self.glowing.iter().any(|(low, high)| p.cmpge(*low).all() && p.cmple(*high).all())
    }

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
        // What the path brings of a surface, and of a light that it meets: the same, but where `Rest` goes on by the whole BSDF.
        let mut throughput = SampledSpectrum::ONE;
        let mut of_lights = SampledSpectrum::ONE;
        let mut came = Came::Camera;
        let mut drawing = Drawing::One;
        for depth in 0..=self.max_depth {
            let (light, at) = meet(scene, &ray, came, drawing, lambda);
            let sum = if depth <= 1 { &mut result.direct } else { &mut result.indirect };
            *sum += of_lights * light;
            let Some(at) = at else { break };
            if depth == 0 {
                result.first = Some(at);
            }
            if depth == self.max_depth || throughput.is_zero() {
                break;
            }

            let points = points_of(scene, depth);
            let shading =
                Shading::new(scene, at, -ray.direction, lambda, (depth == 0).then_some(pixel), points);
            let dimension = dimension_of(depth);
            let mut onward = Onward::Whole;
            let mut rest_only = false;
            if depth == 0 {
                let (light, how) = first_lights(scene, &at, &shading, lambda, sampler);
                result.direct += light;
                drawing = how;
            } else {
                if at.t >= self.near * self.solution.resolution_mm(&at) {
                    result.indirect += throughput * self.gathered(&at, &shading, lambda);
                    rest_only = true;
                    if shading.is_walk() || !self.beside_a_light(at.p) {
                        onward = Onward::Rest;
                    }
                }
                let light = one_light(scene, &at, &shading, onward, dimension, lambda, sampler);
                result.indirect += throughput * light;
                drawing = Drawing::One;
            }

            sampler.start_dimension(dimension + 4);
            let next = match onward {
                Onward::Whole => shading.sample(lambda, sampler),
                Onward::Rest => shading.sample_rest(lambda, sampler),
            };
            let Some(next) = next else { break };
            of_lights = throughput * next.weight;
            throughput = match (rest_only, onward, next.pdf_per_sr) {
                (true, Onward::Whole, Some(pdf_per_sr)) => {
                    let (rest, _) = shading.eval_rest(next.direction, lambda, sampler);
                    throughput * rest * (1.0 / pdf_per_sr)
                }
                _ => of_lights,
            };
            // The first surface always gathers: its light is most of the picture.
            if depth > 0 {
                sampler.start_dimension(dimension + 7);
                let survive = survival(&of_lights);
                if sampler.next_1d() >= survive {
                    break;
                }
                of_lights *= 1.0 / survive;
                throughput *= 1.0 / survive;
            }
            came = next.pdf_per_sr.map_or(Came::Walk, Came::Density);
            ray = Scene::leave(&at, next.direction);
        }
        result
    }
}

#[cfg(test)]
pub(super) mod tests;

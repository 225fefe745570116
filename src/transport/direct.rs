//! What the integrators share: light that a ray meets, and light that is drawn at a surface.
//!
//! Model: a light reaches a surface by two ways of sampling, a direction drawn to the light and a direction drawn from
//! the surface that happens to meet it; where both densities are known the two are weighed by the power heuristic
//! (Veach 1997), so that each light path is counted once:
//!
//! ```text
//! w_light = p_light^2 / (p_light^2 + p_surface^2),    w_surface = 1 - w_light
//! ```
//!
//! Where light goes on from a part of the BSDF only ([`Onward::Rest`]), the diffuse part has no second way, and its
//! lights are drawn with weight one. Guarded by `sampled_light_is_the_light_that_walks_find` in `tests/transport.rs`.

use super::shade::Shading;
use crate::geometry::{Interaction, Ray};
use crate::math::Sampler;
use crate::micro::shading::Points;
use crate::scene::{Drawing, LightSample, MAX_EACH, Scene};
use crate::spectrum::{SampledSpectrum, SampledWavelengths};

/// Dimensions of one light at the first surface: its point, and the random and the aimed points of the cells that it lights.
const DIMENSIONS_PER_LIGHT: u32 = 3;
/// Dimensions of one bounce: light's number, point and two of cells; direction's lobe, angles and walk; roulette.
const DIMENSIONS_PER_BOUNCE: u32 = 8;
/// First dimension after those of the camera ([`super::render()`]).
const FIRST_DIMENSION: u32 = 4;
/// Largest probability of going on: paths in a white room must end too.
const MAX_SURVIVAL: f32 = 0.98;

/// First dimension of a bounce; those of all lights at the first surface come before.
pub(super) fn dimension_of(depth: u32) -> u32 {
    FIRST_DIMENSION + DIMENSIONS_PER_LIGHT * MAX_EACH as u32 + depth * DIMENSIONS_PER_BOUNCE
}

/// First dimension of light `i` at the first surface.
pub(super) fn dimension_of_light(i: usize) -> u32 {
    FIRST_DIMENSION + DIMENSIONS_PER_LIGHT * i as u32
}

/// Points of a petal's cells that shade a surface: what the scene asks for and one aimed where the camera looks, one random
/// one elsewhere.
pub(super) fn points_of(scene: &Scene, depth: u32) -> Points {
    match depth {
        0 => Points { random: scene.petal.samples, aimed: 1 },
        _ => 1.into(),
    }
}

/// `a^2 / (a^2 + b^2)`, written for densities that may be large.
fn power_heuristic(a: f32, b: f32) -> f32 {
    if a <= 0.0 {
        return 0.0;
    }
    let r = b / a;
    1.0 / (1.0 + r * r)
}

/// How a path came to where it is, which tells how a light that it meets is counted.
#[derive(Clone, Copy, Debug)]
pub(super) enum Came {
    /// From the camera: all of it.
    Camera,
    /// By a sample of the surface with this density: its share against light sampling.
    Density(f32),
    /// By a walk: light sampling counted it already.
    Walk,
}

impl Came {
    fn weight(self, light_pdf: f32) -> f32 {
        match self {
            Came::Camera => 1.0,
            Came::Density(pdf) => power_heuristic(pdf, light_pdf),
            Came::Walk => 0.0,
        }
    }
}

/// The light that a ray meets, with its weight, and the surface if there is one. `drawing` is how lights were drawn
/// where the ray starts.
pub(super) fn meet(
    scene: &Scene,
    ray: &Ray,
    came: Came,
    drawing: Drawing,
    lambda: &SampledWavelengths,
) -> (SampledSpectrum, Option<Interaction>) {
    let lights = &scene.lights;
    let weighed = |light: SampledSpectrum, pdf: &dyn Fn() -> f32| {
        if light.is_zero() { light } else { light * came.weight(pdf()) }
    };
    let Some(at) = scene.intersect(ray) else {
        let light = lights.environment(ray.direction, lambda);
        return (weighed(light, &|| lights.pdf_environment(ray.direction, drawing)), None);
    };
    let light = match scene.shapes[at.shape as usize].emitter {
        Some(emitter) => weighed(lights.emitted(emitter, at.ng, -ray.direction, lambda), &|| {
            lights.pdf_area(emitter, ray.origin, at.p, at.ng, drawing)
        }),
        None => SampledSpectrum::ZERO,
    };
    (light, Some(at))
}

/// What the path's next direction is drawn from, against which drawn lights are weighed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Onward {
    /// The whole BSDF.
    Whole,
    /// All but its diffuse part.
    Rest,
}

/// Light of one drawn light that the surface sends on.
fn reflected(
    scene: &Scene,
    at: &Interaction,
    shading: &Shading,
    light: &LightSample,
    onward: Onward,
    lambda: &SampledWavelengths,
    sampler: &mut Sampler,
) -> SampledSpectrum {
    // A walk through cells costs more than a shadow ray, a formula less.
    let seen = || scene.unoccluded(at, light.wi, light.distance_mm);
    if shading.is_walk() && !seen() {
        return SampledSpectrum::ZERO;
    }
    let (diffuse, (f_cos, pdf)) = match onward {
        Onward::Whole => (SampledSpectrum::ZERO, shading.eval(light.wi, lambda, sampler)),
        Onward::Rest => {
            (shading.eval_diffuse(light.wi, lambda), shading.eval_rest(light.wi, lambda, sampler))
        }
    };
    if (f_cos.is_zero() && diffuse.is_zero()) || (!shading.is_walk() && !seen()) {
        return SampledSpectrum::ZERO;
    }
    let weight = match pdf {
        Some(pdf) if !light.delta => power_heuristic(light.pdf_per_sr, pdf),
        _ => 1.0,
    };
    (diffuse + f_cos * weight) * light.radiance * (1.0 / light.pdf_per_sr)
}

/// Direct light where the camera looks: of every light, or of one where there are many. Says which of the two.
pub(super) fn first_lights(
    scene: &Scene,
    at: &Interaction,
    shading: &Shading,
    lambda: &SampledWavelengths,
    sampler: &mut Sampler,
) -> (SampledSpectrum, Drawing) {
    let count = scene.lights.emitters().len();
    if count > MAX_EACH {
        let sum = one_light(scene, at, shading, Onward::Whole, dimension_of(0), lambda, sampler);
        return (sum, Drawing::One);
    }
    let mut sum = SampledSpectrum::ZERO;
    for i in 0..count {
        sampler.start_dimension(dimension_of_light(i));
        let u = sampler.next_2d();
        if let Some(light) = scene.lights.sample_light(i, Drawing::Each, at.p, u, lambda) {
            sum += reflected(scene, at, shading, &light, Onward::Whole, lambda, sampler);
        }
    }
    (sum, Drawing::Each)
}

/// Direct light by one drawn light; takes four dimensions from `dimension` on.
pub(super) fn one_light(
    scene: &Scene,
    at: &Interaction,
    shading: &Shading,
    onward: Onward,
    dimension: u32,
    lambda: &SampledWavelengths,
    sampler: &mut Sampler,
) -> SampledSpectrum {
    sampler.start_dimension(dimension);
    let u_pick = sampler.next_1d();
    let u = sampler.next_2d();
    match scene.lights.sample(at.p, u_pick, u, lambda) {
        Some(light) => reflected(scene, at, shading, &light, onward, lambda, sampler),
        None => SampledSpectrum::ZERO,
    }
}

/// Direct light by one light drawn with the probabilities `p`; takes four dimensions from `dimension` on.
pub(super) fn chosen_light(
    scene: &Scene,
    at: &Interaction,
    shading: &Shading,
    p: &[f32; MAX_EACH],
    dimension: u32,
    lambda: &SampledWavelengths,
    sampler: &mut Sampler,
) -> SampledSpectrum {
    sampler.start_dimension(dimension);
    let mut u_pick = sampler.next_1d();
    let u = sampler.next_2d();
    let last = scene.lights.emitters().len().min(MAX_EACH) - 1;
    let mut i = 0;
    while i < last && u_pick >= p[i] {
        u_pick -= p[i];
        i += 1;
    }
    match scene.lights.sample_light(i, Drawing::Chosen(*p), at.p, u, lambda) {
        Some(light) => reflected(scene, at, shading, &light, Onward::Whole, lambda, sampler),
        None => SampledSpectrum::ZERO,
    }
}

/// Probability of going on in Russian roulette: the path's throughput. What goes on is divided by it.
pub(super) fn survival(throughput: &SampledSpectrum) -> f32 {
    // A rest may be negative.
    throughput.map(f32::abs).max().min(MAX_SURVIVAL)
}

//! What a path should know of the light before it is traced, from a coarse radiosity solution.
//!
//! Model: for every side n of every element, the luminance that each light i alone makes it send out, as its root mean square
//! over points of the element and of the light:
//!
//! ```text
//! rms_i = sqrt(mean of Y(R_n E_n,i)^2 + mean of Y(T_n' E_n',i)^2)
//! light i is drawn at a bounce with p_i = (1 - floor) rms_i / sum of rms + floor P_i,   floor = 0.3
//! ```
//!
//! P_i is the choice without a guide. None of this enters the picture's light: it tells how often something is drawn, and
//! what is drawn is divided by that, so paths stay unbiased whatever the guide says
//! (`guided_paths_find_the_same_light`, `a_guide_that_knows_nothing_is_harmless`).
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | | [`GuideSettings`] | | 4000 elements of 8 rays, 16 samples of every light |
//!
//! Limits: at most 8 lights are chosen from; scenes with more of them are not guided in that. What was tried and did not pay
//! is in docs/performance.md. Source: our reading; importance of lights per place as in Shirley, Wang and Zimmerman 1996.

use glam::{UVec2, Vec3};
use rayon::prelude::*;

use super::Progress;
use super::radiosity::{self, Quantity, Radiosity, RadiositySettings};
use crate::Result;
use crate::geometry::ray::offset_origin;
use crate::geometry::{Interaction, Ray, Side};
use crate::math::Sampler;
use crate::scene::{Drawing, MAX_EACH, Scene};
use crate::spectrum::{LANES, Observer, SampledSpectrum, SampledWavelengths};

/// Wavelengths of the solution: so many from this one on, evenly.
const FIRST_NM: f32 = 410.0;
const STEP_NM: f32 = 40.0;
/// Share of the choice of a light that stays as it is without a guide.
const FLOOR: f32 = 0.3;
/// Marks the numbers of these samples among others of the seed.
const SEQUENCE: u32 = 0x6f1d_e000;
/// Shadow rays end this share of their length before the light.
const SHADOW_END: f32 = 1.0 - 1e-4;

/// How much work a guide is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GuideSettings {
    /// About how many elements at most. Default 4000.
    pub elements: u32,
    /// Rays from each side of an element. Default 8.
    pub rays: u32,
    /// Samples of every light for each side of an element. Default 16.
    pub light_samples: u32,
    /// Seed of all samples. Default 0.
    pub seed: u64,
}

impl Default for GuideSettings {
    fn default() -> Self {
        Self { elements: 4000, rays: 8, light_samples: 16, seed: 0 }
    }
}

/// What is known of a side of an element; luminance that leaves it.
#[derive(Clone, Copy, Debug, Default)]
struct Known {
    /// By each light, root mean square.
    rms: [f32; MAX_EACH],
}

/// The light that is known before paths are traced.
#[derive(Debug)]
pub struct Guide {
    radiosity: Radiosity,
    /// Per side of each element.
    known: Vec<Known>,
    /// Lights, if all can be chosen from.
    lights: Option<usize>,
}

impl Guide {
    /// Solves for the light of a scene, coarsely. `warnings` gets what is wrong with the scene. Stopped by `progress`, it
    /// gives [`crate::Error::Cancelled`].
    pub fn new(
        scene: &Scene,
        settings: &GuideSettings,
        warnings: &mut Vec<String>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let nm: [f32; LANES] = std::array::from_fn(|k| FIRST_NM + STEP_NM * k as f32);
        let solver = RadiositySettings {
            elements: settings.elements,
            rays: settings.rays,
            // The solution is asked only for the shares that elements send on.
            light_samples: settings.light_samples.min(8),
            light_rays: 64,
            residual: 1e-1,
            seed: settings.seed,
            ..RadiositySettings::default()
        };
        let radiosity = radiosity::solve(scene, &nm, &solver, warnings, progress)?;
        let nodes = 2 * radiosity.elements().len();
        let of = |n: usize, quantity: Quantity| {
            let v = radiosity.element((n / 2) as u32, side(n), quantity);
            SampledSpectrum::from_fn(|k| v[k])
        };
        let ratio = |a: SampledSpectrum, b: SampledSpectrum| {
            SampledSpectrum::from_fn(|k| if b[k] > 0.0 { (a[k] / b[k]).clamp(0.0, 1.0) } else { 0.0 })
        };
        // Reflected and transmitted share of what comes.
        let table: Vec<[SampledSpectrum; 2]> = (0..nodes)
            .map(|n| {
                let (all, through) = (of(n, Quantity::Incident), of(n, Quantity::Transmitted));
                let back = all - of(n, Quantity::Absorbed) - through;
                [ratio(back, all), ratio(through, all)]
            })
            .collect();
        let cmf = nm.map(|nm| Observer::Cie1931.cmf(nm)[1] as f32);
        // Up to a factor, which does not matter for a choice.
        let luminance = |v: SampledSpectrum| (0..LANES).map(|k| v[k] * cmf[k]).sum::<f32>();
        let lights = scene.lights.emitters().len();
        let lights = (lights <= MAX_EACH).then_some(lights);
        let lambda = SampledWavelengths::given(nm);
        let lighting = Lighting { scene, radiosity: &radiosity, lambda: &lambda, settings };
        let squares: Vec<[[f32; 2]; MAX_EACH]> = (0..nodes)
            .into_par_iter()
            .with_min_len(64)
            .map(|n| {
                let mut squares = [[0.0; 2]; MAX_EACH];
                for (i, square) in squares.iter_mut().enumerate().take(lights.unwrap_or(0)) {
                    *square = lighting.on(n, i, &|light| table[n].map(|share| luminance(light * share)));
                }
                squares
            })
            .collect();
        let rms = |n: usize, i: usize| (squares[n][i][0] + squares[n ^ 1][i][1]).sqrt();
        let known = (0..nodes).map(|n| Known { rms: std::array::from_fn(|i| rms(n, i)) }).collect();
        Ok(Self { radiosity, known, lights })
    }

    fn known(&self, at: &Interaction, wo: Vec3) -> Option<&Known> {
        let element = self.radiosity.elements().hit(at)?;
        self.known.get(2 * element as usize + usize::from(at.ng.dot(wo) < 0.0))
    }

    /// Probability of drawing each of the lights at a bounce.
    pub(super) fn pick(&self, scene: &Scene, at: &Interaction, wo: Vec3) -> Option<[f32; MAX_EACH]> {
        let (known, lights) = (self.known(at, wo)?, self.lights?);
        let sum: f32 = known.rms[..lights].iter().sum();
        if sum <= 0.0 {
            return None;
        }
        let of = |i: usize| (1.0 - FLOOR) * known.rms[i] / sum + FLOOR * scene.lights.pick_probability(i);
        Some(std::array::from_fn(|i| if i < lights { of(i) } else { 0.0 }))
    }
}

fn side(node: usize) -> Side {
    if node.is_multiple_of(2) { Side::Adaxial } else { Side::Abaxial }
}

/// What light of single lights is computed from.
struct Lighting<'a> {
    scene: &'a Scene,
    radiosity: &'a Radiosity,
    lambda: &'a SampledWavelengths,
    settings: &'a GuideSettings,
}

impl Lighting<'_> {
    /// Mean squares over points of a node, and of light `i`, of values of the irradiance.
    fn on(&self, node: usize, i: usize, values: &dyn Fn(SampledSpectrum) -> [f32; 2]) -> [f32; 2] {
        let Self { scene, radiosity, lambda, settings } = *self;
        let up = if side(node) == Side::Adaxial { 1.0 } else { -1.0 };
        let mut squares = [0.0; 2];
        for s in 0..settings.light_samples {
            let mut sampler =
                Sampler::new(settings.seed, UVec2::new(node as u32, SEQUENCE.wrapping_add(i as u32)), s);
            let u_facet = sampler.next_1d();
            let at = radiosity.elements().sample(scene, (node / 2) as u32, u_facet, sampler.next_2d());
            let u = sampler.next_2d();
            let Some(l) = scene.lights.sample_light(i, Drawing::Each, at.p, u, lambda) else { continue };
            let normal = at.normal * up;
            let cos = l.wi.dot(normal);
            let ray = Ray {
                t_max: l.distance_mm * SHADOW_END,
                ..Ray::new(offset_origin(at.p, normal, l.wi), l.wi)
            };
            if cos > 0.0 && !scene.bvh.occluded(&ray) {
                let v = values(l.radiance * (cos / l.pdf_per_sr));
                squares.iter_mut().zip(v).for_each(|(s, v)| *s += v * v);
            }
        }
        squares.map(|s| s / settings.light_samples.max(1) as f32)
    }
}

#[cfg(test)]
mod tests;

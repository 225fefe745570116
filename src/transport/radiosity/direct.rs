//! Light that comes to a node straight from the lights.
//!
//! Model: the mean over uniform points x of a node, and over samples of every light,
//!
//! ```text
//! E = mean over x of sum over lights of L(wi) cos(theta) V(x, wi) / pdf(wi)
//! E_r = the same with R(theta),  E_t with T(theta):  what is sent back, and through
//! ```
//!
//! where R and T are the directional-hemispherical totals of the material ([`MaterialTotals`]), so what a sheet does with
//! direct light depends on where that light comes from. Directions to a sky that looks the same all over are drawn by the cosine.
//! Spectral, per nm. Guarded by `sky_and_sun_on_a_floor`.
//! Source: our reading.

use glam::{UVec2, Vec3};
use rayon::prelude::*;

use super::elements::{Elements, node};
use crate::geometry::ray::offset_origin;
use crate::geometry::{Ray, Side};
use crate::math::{Frame, Sampler, warp};
use crate::scene::{Drawing, Emitter, LightSample, MaterialTotals, Scene};
use crate::spectrum::{SampledSpectrum, SampledWavelengths};

/// Scenes with more lights than this draw one of them per point.
const MAX_EACH: usize = 8;
/// Marks the numbers of these samples among others of the seed.
const SEQUENCE: u32 = 0xd14e_c7ed;
/// Shadow rays end this share of their length before the light.
const SHADOW_END: f32 = 1.0 - 1e-4;

/// Direct light of a node at eight wavelengths.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DirectLight {
    /// Irradiance.
    pub(super) incident: SampledSpectrum,
    /// What is reflected of it.
    pub(super) reflected: SampledSpectrum,
    /// What of it leaves from the other side.
    pub(super) transmitted: SampledSpectrum,
}

impl DirectLight {
    /// More light, of which shares are reflected and transmitted.
    pub(super) fn add(&mut self, light: SampledSpectrum, (r, t): (SampledSpectrum, SampledSpectrum)) {
        self.incident += light;
        self.reflected += light * r;
        self.transmitted += light * t;
    }

    fn scale(&mut self, by: f32) {
        self.incident *= by;
        self.reflected *= by;
        self.transmitted *= by;
    }
}

/// What direct light is computed from.
pub(super) struct Lighting<'a> {
    pub(super) scene: &'a Scene,
    pub(super) totals: &'a [MaterialTotals],
    pub(super) chunks: &'a [SampledWavelengths],
    pub(super) samples: u32,
    pub(super) seed: u64,
    /// Are glowing surfaces left to [`super::glow`]?
    pub(super) without_glow: bool,
    /// Number of the sky that is drawn by the cosine, [`even_sky`].
    pub(super) even_sky: Option<usize>,
}

/// What samples are for: those that tell how many are needed are not used again.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    /// The light itself.
    Final = 0,
    /// A first look.
    Look = 1,
}

impl Lighting<'_> {
    /// Direct light of both nodes of each of the elements, `chunks` values per node, from so many samples on each side.
    pub(super) fn on(
        &self,
        elements: &Elements,
        which: &[(u32, [u32; 2])],
        kind: Kind,
        heard: &(dyn Fn(u64) + Sync),
    ) -> (Vec<DirectLight>, Vec<f32>) {
        let per_element = 2 * self.chunks.len();
        let mut out = vec![DirectLight::default(); which.len() * per_element];
        let mut errors = vec![0.0; which.len() * 2];
        out.par_chunks_mut(per_element).zip(errors.par_chunks_mut(2)).zip(which).for_each(
            |((out, errors), (element, samples))| {
                let (adaxial, abaxial) = out.split_at_mut(self.chunks.len());
                errors[0] = self.on_node(elements, *element, Side::Adaxial, (samples[0], kind), adaxial);
                errors[1] = self.on_node(elements, *element, Side::Abaxial, (samples[1], kind), abaxial);
                heard(1);
            },
        );
        (out, errors)
    }

    /// Gives the variance of one sample.
    fn on_node(
        &self,
        elements: &Elements,
        element: u32,
        side: Side,
        (samples, kind): (u32, Kind),
        out: &mut [DirectLight],
    ) -> f32 {
        let Self { scene, totals, chunks, .. } = *self;
        let lights = &scene.lights;
        let e = &elements.list()[element as usize];
        let totals = &totals[scene.shapes[e.shape as usize].material as usize];
        let up = if side == Side::Adaxial { 1.0 } else { -1.0 };
        let sampled = |k: &usize| !(self.without_glow && matches!(lights.emitters()[*k], Emitter::Area(_)));
        let each = self.without_glow || lights.emitters().len() <= MAX_EACH;
        let even = |k: usize| self.even_sky == Some(k);
        let number = node(element, side) as u32;
        let (mut sum, mut squares) = (0.0f64, 0.0f64);
        for i in 0..samples {
            let mut s = Sampler::new(self.seed, UVec2::new(number, SEQUENCE ^ kind as u32), i);
            let u_facet = s.next_1d();
            let at = elements.sample(scene, element, u_facet, s.next_2d());
            let n = at.normal * up;
            let visible = |l: &LightSample| {
                let ray =
                    Ray { t_max: l.distance_mm * SHADOW_END, ..Ray::new(offset_origin(at.p, n, l.wi), l.wi) };
                l.wi.dot(n) > 0.0 && !scene.bvh.occluded(&ray)
            };
            let mut brightness = 0.0;
            let mut take = |sample: &dyn Fn(&SampledWavelengths) -> Option<LightSample>| {
                let Some(first) = sample(&chunks[0]) else { return };
                if !visible(&first) {
                    return;
                }
                let cos = first.wi.dot(n);
                for (c, lambda) in chunks.iter().enumerate() {
                    // The same numbers give the same direction at all wavelengths.
                    let light = if c == 0 { Some(first) } else { sample(lambda) };
                    if let Some(l) = light {
                        let light = l.radiance * (cos / l.pdf_per_sr);
                        brightness += f64::from(light.mean());
                        out[c].add(light, totals.at(e.pigment, cos, side, c));
                    }
                }
            };
            if each {
                for k in (0..lights.emitters().len()).filter(sampled) {
                    let u = s.next_2d();
                    if even(k) {
                        let wi =
                            Frame::from_normal(n).to_world(warp::square_to_cosine_hemisphere(u)).normalize();
                        take(&|lambda| {
                            Some(LightSample {
                                wi,
                                distance_mm: f32::INFINITY,
                                radiance: lights.environment(wi, lambda),
                                pdf_per_sr: warp::cosine_hemisphere_pdf(Vec3::Z * wi.dot(n)),
                                delta: false,
                            })
                        });
                    } else {
                        take(&|lambda| lights.sample_light(k, Drawing::Each, at.p, u, lambda));
                    }
                }
            } else {
                let (u_pick, u) = (s.next_1d(), s.next_2d());
                take(&|lambda| lights.sample(at.p, u_pick, u, lambda));
            }
            sum += brightness;
            squares += brightness * brightness;
        }
        out.iter_mut().for_each(|d| d.scale(1.0 / samples as f32));
        let count = f64::from(samples);
        ((squares / count - (sum / count).powi(2)).max(0.0) / chunks.len().pow(2) as f64) as f32
    }
}

/// The sky that looks the same all over, where it is the only light at infinity that directions are drawn to.
pub(super) fn even_sky(scene: &Scene) -> Option<usize> {
    let far = |e: &Emitter| match e {
        Emitter::Constant { .. } | Emitter::Image { .. } | Emitter::Sky(_) => true,
        Emitter::Distant { one_minus_cos, .. } => *one_minus_cos > 0.0,
        _ => false,
    };
    let mut all = scene.lights.emitters().iter().enumerate().filter(|(_, e)| far(e));
    let first = all.next()?;
    (all.next().is_none() && matches!(first.1, Emitter::Constant { .. })).then_some(first.0)
}

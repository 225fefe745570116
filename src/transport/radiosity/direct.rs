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

use glam::{UVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::elements::{Elements, node};
use super::glow;
use crate::geometry::ray::offset_origin;
use crate::geometry::{Ray, Side};
use crate::math::{Frame, Sampler, warp};
use crate::scene::totals::{COSINES, spread};
use crate::scene::{Drawing, Emitter, LightWay, MAX_EACH, MaterialTotals, Scene};
use crate::spectrum::{SampledSpectrum, SampledWavelengths};

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
    /// Of each light with one spectrum for all ways: that in each chunk, and the sum of its means.
    spectra: Vec<Option<(Vec<SampledSpectrum>, f32)>>,
}

/// What samples are for: those that tell how many are needed are not used again.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    /// The light itself.
    Final = 0,
    /// A first look.
    Look = 1,
}

impl<'a> Lighting<'a> {
    /// Light of a scene at these wavelengths by so many samples of each light in the mean.
    pub(super) fn new(
        scene: &'a Scene,
        totals: &'a [MaterialTotals],
        chunks: &'a [SampledWavelengths],
        (samples, seed): (u32, u64),
    ) -> Self {
        let even_sky = even_sky(scene);
        let spectra = |k: usize| {
            let spectrum = match &scene.lights.emitters()[k] {
                Emitter::Constant { radiance } if even_sky == Some(k) => radiance,
                _ => scene.lights.spectrum(k)?,
            };
            let values: Vec<SampledSpectrum> = chunks.iter().map(|lambda| spectrum.sample(lambda)).collect();
            let mean = values.iter().map(SampledSpectrum::mean).sum();
            Some((values, mean))
        };
        let spectra = (0..scene.lights.emitters().len()).map(spectra).collect();
        let without_glow = glow::is_large(scene);
        Self { scene, totals, chunks, samples, seed, without_glow, even_sky, spectra }
    }

    /// Is every light drawn at each point? Otherwise one of them is.
    fn each(&self) -> bool {
        self.without_glow || self.spectra.len() <= MAX_EACH
    }

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
        let Self { scene, chunks, .. } = *self;
        let lights = &scene.lights;
        let e = &elements.list()[element as usize];
        let totals = &self.totals[scene.shapes[e.shape as usize].material as usize];
        let up = if side == Side::Adaxial { 1.0 } else { -1.0 };
        let number = node(element, side) as u32;
        let mut tallies = [[0.0; COSINES]; MAX_EACH];
        let (mut sum, mut squares) = (0.0f64, 0.0f64);
        for i in 0..samples {
            let mut s = Sampler::new(self.seed, UVec2::new(number, SEQUENCE ^ kind as u32), i);
            let u_facet = s.next_1d();
            let at = elements.sample(scene, element, u_facet, s.next_2d());
            let n = at.normal * up;
            let mut brightness = 0.0;
            let mut take = |light: usize, way: Option<LightWay>, mut tally: Option<&mut [f32; COSINES]>| {
                let Some(way) = way else { return };
                let cos = way.wi.dot(n);
                let end = way.distance_mm * SHADOW_END;
                let ray = Ray { t_max: end, ..Ray::new(offset_origin(at.p, n, way.wi), way.wi) };
                if cos <= 0.0 || scene.bvh.occluded(&ray) {
                    return;
                }
                let weight = cos / way.pdf_per_sr;
                if let (Some(tally), Some((_, mean))) = (&mut tally, &self.spectra[light]) {
                    spread(tally, cos, weight * way.factor);
                    brightness += weight * way.factor * mean;
                    return;
                }
                for (c, lambda) in chunks.iter().enumerate() {
                    let light = lights.arriving(light, &way, lambda) * weight;
                    brightness += light.mean();
                    out[c].add(light, totals.at(e.tissue, cos, side, c));
                }
            };
            if self.each() {
                for (k, emitter) in lights.emitters().iter().enumerate() {
                    if self.without_glow && matches!(emitter, Emitter::Area(_)) {
                        continue;
                    }
                    let u = s.next_2d();
                    let way = match self.even_sky {
                        Some(sky) if sky == k => Some(cosine_way(n, u)),
                        _ => lights.way(k, Drawing::Each, at.p, u),
                    };
                    take(k, way, tallies.get_mut(k));
                }
            } else {
                let (u_pick, u) = (s.next_1d(), s.next_2d());
                if let Some(k) = lights.pick(u_pick) {
                    take(k, lights.way(k, Drawing::One, at.p, u), None);
                }
            }
            sum += f64::from(brightness);
            squares += f64::from(brightness).powi(2);
        }
        for (spectrum, tally) in self.spectra.iter().zip(&tallies) {
            let Some((spectrum, _)) = spectrum else { continue };
            let light: f32 = tally.iter().sum();
            if light == 0.0 {
                continue;
            }
            for (c, (out, spectrum)) in out.iter_mut().zip(spectrum).enumerate() {
                out.incident += *spectrum * light;
                // A first look asks for no more.
                if matches!(kind, Kind::Final) {
                    let (r, t) = totals.of_light(e.tissue, tally, side, c);
                    out.reflected += *spectrum * r;
                    out.transmitted += *spectrum * t;
                }
            }
        }
        out.iter_mut().for_each(|d| d.scale(1.0 / samples as f32));
        let count = f64::from(samples);
        ((squares / count - (sum / count).powi(2)).max(0.0) / chunks.len().pow(2) as f64) as f32
    }
}

/// The way to a sky in a direction drawn by the cosine around `n`.
fn cosine_way(n: Vec3, u: Vec2) -> LightWay {
    let wi = Frame::from_normal(n).to_world(warp::square_to_cosine_hemisphere(u)).normalize();
    let pdf_per_sr = warp::cosine_hemisphere_pdf(Vec3::Z * wi.dot(n));
    LightWay { wi, distance_mm: f32::INFINITY, factor: 1.0, pdf_per_sr, delta: false }
}

/// The sky that looks the same all over, where it is the only light at infinity that directions are drawn to.
fn even_sky(scene: &Scene) -> Option<usize> {
    let far = |e: &Emitter| match e {
        Emitter::Constant { .. } | Emitter::Image { .. } | Emitter::Sky(_) => true,
        Emitter::Distant { one_minus_cos, .. } => *one_minus_cos > 0.0,
        _ => false,
    };
    let mut all = scene.lights.emitters().iter().enumerate().filter(|(_, e)| far(e));
    let first = all.next()?;
    (all.next().is_none() && matches!(first.1, Emitter::Constant { .. })).then_some(first.0)
}

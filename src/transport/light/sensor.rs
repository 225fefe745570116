//! Irradiance at given points.
//!
//! Model: `E = integral of L(w) (n . w) dw` over the hemisphere of the sensor's normal n, estimated by directions of two
//! kinds, weighed by the power heuristic (Veach 1997) where both find the same light:
//!
//! ```text
//! towards each light      L cos / p_light            straight from the lights
//! cosine about n          pi L = B                   B: radiosity of the surface that the ray meets, or the lights' own light
//! ```
//!
//! so direct light has sharp shadows, and light from other surfaces is gathered from the solution. The sensor is not part
//! of the scene: it shades nothing. Its standard error is that of 16 independently scrambled estimates; it does not
//! know the error of the solution.
//!
//! | symbol | here | unit | default |
//! |---|---|---|---|
//! | n | [`Sensor::normal`] | none | |
//! | samples | directions of each kind | | 4096 |
//!
//! Limits: a small light behind a fine grid of shadows needs many samples. Guarded by
//! `sensors_in_known_light`, `a_sensor_on_a_surface_reads_its_irradiance`. Source: our reading.

use std::f32::consts::PI;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::{UVec2, Vec3};
use rayon::prelude::*;

use super::{Readout, lanes};
use crate::geometry::{Interaction, Side};
use crate::io::sensors_csv::{BandReading, Reading, Sensor};
use crate::math::stats::Welford;
use crate::math::{Frame, Sampler, warp};
use crate::scene::{Drawing, Scene};
use crate::spectrum::{LANES, SampledSpectrum, SampledWavelengths};
use crate::transport::Progress;
use crate::transport::radiosity::Quantity;
use crate::{Error, Result};

/// Independent estimates.
const REPLICATES: u32 = 16;
/// Marks the numbers of these samples among others of the seed.
const SEQUENCE: u32 = 0x5e45_0b1d;

fn power_heuristic(a: f32, b: f32) -> f32 {
    if a <= 0.0 { 0.0 } else { 1.0 / (1.0 + (b / a).powi(2)) }
}

impl Readout<'_> {
    /// What sensors read, with about `samples` directions of each kind.
    pub fn sensors(
        &self,
        sensors: &[Sensor],
        samples: u32,
        seed: u64,
        progress: &dyn Progress,
    ) -> Result<Vec<Reading>> {
        let chunks = lanes(self.radiosity.wavelengths_nm());
        let done = AtomicU64::new(0);
        let read = |(k, sensor): (usize, &Sensor)| {
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let reading = self.sensor(k as u32, sensor, samples, seed, &chunks);
            progress.advance(done.fetch_add(1, Ordering::Relaxed) + 1, sensors.len() as u64);
            Ok(reading)
        };
        sensors.par_iter().enumerate().map(read).collect()
    }

    fn sensor(
        &self,
        k: u32,
        sensor: &Sensor,
        samples: u32,
        seed: u64,
        chunks: &[SampledWavelengths],
    ) -> Reading {
        let per = samples.div_ceil(REPLICATES).max(1);
        let bands = self.bands.len();
        let mut means = vec![[Welford::default(); 2]; bands];
        let mut direct = vec![[0.0; 2]; bands];
        for r in 0..REPLICATES {
            let light =
                self.replicate(sensor, per, |i| Sampler::new(seed, UVec2::new(k, SEQUENCE ^ r), i), chunks);
            let values = |all: bool| {
                let (light, per) = (&light, f64::from(per));
                move |i: usize| {
                    let (straight, gathered) = light[i];
                    (straight + if all { gathered } else { 0.0 }) / per
                }
            };
            for b in 0..bands {
                let (all, straight) = (self.flux(b, values(true)), self.flux(b, values(false)));
                for u in 0..2 {
                    means[b][u].push(all[u]);
                    direct[b][u] += straight[u] / f64::from(REPLICATES);
                }
            }
        }
        let band = |(m, direct): (&[Welford; 2], [f64; 2])| BandReading {
            irradiance: [m[0].mean(), m[1].mean()],
            standard_error: [m[0].standard_error(), m[1].standard_error()],
            direct,
        };
        Reading { sensor: sensor.clone(), bands: means.iter().zip(direct).map(band).collect() }
    }

    /// Sums over `samples` directions of the spectral irradiance, per wavelength: from lights and from surfaces.
    fn replicate(
        &self,
        sensor: &Sensor,
        samples: u32,
        sampler: impl Fn(u32) -> Sampler,
        chunks: &[SampledWavelengths],
    ) -> Vec<(f64, f64)> {
        let scene = self.scene;
        let normal = sensor.normal.as_vec3().normalize();
        let frame = Frame::from_normal(normal);
        let at = place(sensor, frame);
        let lights = &scene.lights;
        let mut sum = vec![(0.0, 0.0); self.radiosity.wavelengths_nm().len()];
        let add_light = |sum: &mut Vec<(f64, f64)>, c: usize, light: SampledSpectrum, by: f32| {
            for (s, v) in sum[c * LANES..].iter_mut().zip(light.0) {
                s.0 += f64::from(v) * f64::from(by);
            }
        };
        for i in 0..samples {
            let mut s = sampler(i);
            let u = s.next_2d();
            let w = frame.to_world(warp::square_to_cosine_hemisphere(u));
            let density = |w: Vec3| normal.dot(w).max(0.0) / PI;
            for k in 0..lights.emitters().len() {
                let u = s.next_2d();
                let Some(way) = lights.way(k, Drawing::Each, at.p, u) else { continue };
                let cos = normal.dot(way.wi);
                if cos <= 0.0 || !scene.unoccluded(&at, way.wi, way.distance_mm) {
                    continue;
                }
                let weight = if way.delta { 1.0 } else { power_heuristic(way.pdf_per_sr, density(way.wi)) };
                for (c, l) in chunks.iter().enumerate() {
                    add_light(&mut sum, c, lights.arriving(k, &way, l), cos * weight / way.pdf_per_sr);
                }
            }
            let Some(hit) = scene.intersect(&Scene::leave(&at, w)) else {
                let weight = power_heuristic(density(w), lights.pdf_environment(w, Drawing::Each));
                for (c, l) in chunks.iter().enumerate() {
                    add_light(&mut sum, c, lights.environment(w, l), weight * PI);
                }
                continue;
            };
            if let Some(emitter) = scene.shapes[hit.shape as usize].emitter {
                let pdf = lights.pdf_area(emitter, at.p, hit.p, hit.ng, Drawing::Each);
                let weight = power_heuristic(density(w), pdf) * PI;
                for (c, l) in chunks.iter().enumerate() {
                    add_light(&mut sum, c, lights.emitted(emitter, hit.ng, -w, l), weight);
                }
            }
            self.gather(&hit, w, &mut sum);
        }
        sum
    }

    /// Adds the radiosity of the side of a surface that a ray along `w` meets.
    fn gather(&self, hit: &Interaction, w: Vec3, sum: &mut [(f64, f64)]) {
        let side = if hit.ng.dot(w) < 0.0 { Side::Adaxial } else { Side::Abaxial };
        let Some(element) = self.radiosity.elements().hit(hit) else { return };
        let leaving = self.radiosity.at(element, side, hit.p, Quantity::Leaving);
        for (s, b) in sum.iter_mut().zip(leaving) {
            s.1 += f64::from(b);
        }
    }
}

/// The sensor as a point that rays leave from.
fn place(sensor: &Sensor, frame: Frame) -> Interaction {
    Interaction {
        p: sensor.position_mm.as_vec3(),
        ng: frame.n,
        frame,
        uv: glam::Vec2::ZERO,
        uv_scale_mm: glam::Vec2::ZERO,
        t: 0.0,
        b: Vec3::X,
        shape: 0,
        face: 0,
    }
}

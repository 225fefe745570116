//! The render loop: camera rays for every pixel, in parallel, in passes.
//!
//! A pass takes a range of sample indices over all pixels, so that a stopped picture is a whole picture with
//! fewer samples. Within a pixel samples are added in the order of their index, whatever the passes are, so
//! the result's bytes depend on the scene, the seed and the number of samples only.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::{Mat3, UVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::{Integrator, PixelRay};
use crate::film::{Film, FilmSample, PixelRect};
use crate::math::Sampler;
use crate::scene::Scene;
use crate::spectrum::illuminant::d65;
use crate::spectrum::{Observer, SampledSpectrum, SampledWavelengths};
use crate::{Error, Result};

/// Most samples that one pass adds to a pixel: short passes answer Ctrl-C and show progress.
const MAX_PASS: u32 = 8;

/// What [`render()`] is asked for.
#[derive(Clone, Copy, Debug)]
pub struct RenderSettings {
    /// Samples per pixel.
    pub spp: u32,
    /// Seed of the sequence.
    pub seed: u64,
    /// Part of the picture.
    pub crop: PixelRect,
}

/// Hears how far the picture is, and may stop it. Called from all threads.
pub trait Progress: Sync {
    /// `done` of `total` pixel samples are computed.
    fn advance(&self, done: u64, total: u64);
    /// Should the render stop?
    fn cancelled(&self) -> bool;
}

/// Says nothing and never stops.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoProgress;

impl Progress for NoProgress {
    fn advance(&self, _done: u64, _total: u64) {}
    fn cancelled(&self) -> bool {
        false
    }
}

/// A picture, finished or stopped.
#[derive(Debug)]
pub struct Rendered {
    /// The picture.
    pub film: Film,
    /// Pixel samples computed.
    pub samples: u64,
    /// False when it was stopped before all samples were in.
    pub complete: bool,
}

/// Renders `settings.crop` of the scene's film on the current rayon pool.
pub fn render(
    scene: &Scene,
    integrator: &dyn Integrator,
    settings: &RenderSettings,
    progress: &dyn Progress,
) -> Result<Rendered> {
    if settings.spp == 0 {
        return Err(Error::invalid("spp", "a picture needs at least 1 sample per pixel"));
    }
    let resolution = UVec2::new(scene.film.width, scene.film.height);
    let mut film = Film::new(resolution, settings.crop)?;
    let filter_radius_px =
        scene.film.filter_radius_px.map_or(scene.film.filter.default_radius_px(), |r| r as f32);
    let srgb_from_xyz = Observer::Cie1931.srgb_from_xyz().as_mat3();
    let camera =
        CameraSamples { scene, integrator, filter_radius_px, srgb_from_xyz, resolution, seed: settings.seed };
    let width = settings.crop.width() as usize;
    let total = u64::from(settings.spp) * film.pixels().len() as u64;
    let done = AtomicU64::new(0);
    let mut first = 0;
    while first < settings.spp && !progress.cancelled() {
        let last = (first + first.clamp(1, MAX_PASS)).min(settings.spp);
        film.pixels_mut().par_chunks_mut(width).enumerate().for_each(|(row, pixels)| {
            if progress.cancelled() {
                return;
            }
            let y = settings.crop.y0 + row as u32;
            for (x, pixel) in (settings.crop.x0..).zip(pixels.iter_mut()) {
                for index in first..last {
                    pixel.add(&camera.sample(UVec2::new(x, y), index));
                }
            }
            let added = width as u64 * u64::from(last - first);
            progress.advance(done.fetch_add(added, Ordering::Relaxed) + added, total);
        });
        first = last;
    }
    let samples = done.into_inner();
    Ok(Rendered { film, samples, complete: samples == total })
}

struct CameraSamples<'a> {
    scene: &'a Scene,
    integrator: &'a dyn Integrator,
    filter_radius_px: f32,
    srgb_from_xyz: Mat3,
    resolution: UVec2,
    seed: u64,
}

impl CameraSamples<'_> {
    /// Linear sRGB of radiance.
    fn rgb(&self, radiance: &SampledSpectrum, lambda: &SampledWavelengths) -> [f32; 3] {
        (self.srgb_from_xyz * Vec3::from(Observer::Cie1931.xyz_from_samples(radiance, lambda))).to_array()
    }

    /// Sample `index` of a pixel; draws the dimensions before [`super::path::FIRST_DIMENSION`].
    fn sample(&self, pixel: UVec2, index: u32) -> FilmSample {
        let mut sampler = Sampler::new(self.seed, pixel, index);
        let offset = self.scene.film.filter.sample_radius(sampler.next_2d(), self.filter_radius_px);
        let film = (pixel.as_vec2() + Vec2::splat(0.5) + offset.offset) / self.resolution.as_vec2();
        let camera = self.scene.camera.ray(film, sampler.next_2d());
        let lambda = SampledWavelengths::visible(sampler.next_1d());
        let ray = PixelRay { ray: camera.ray, spread: camera.spread };
        let light = self.integrator.li(self.scene, &ray, &lambda, &mut sampler);
        let mut sample = FilmSample {
            direct: self.rgb(&light.direct, &lambda),
            indirect: self.rgb(&light.indirect, &lambda),
            ..FilmSample::default()
        };
        if let Some(at) = &light.first {
            let shape = &self.scene.shapes[at.shape as usize];
            let wo = at.frame.to_local(-camera.ray.direction);
            let state = self.scene.tissue(at.shape, at.uv);
            let albedo = self.scene.materials[shape.material as usize].albedo(wo, state, &lambda);
            sample.albedo = self.rgb(&(albedo * d65().sample(&lambda)), &lambda);
            sample.normal = at.frame.n;
            sample.depth_mm = at.t;
            sample.uv = at.uv;
            sample.petal_id = shape.petal_id;
            sample.organ_id = shape.organ_id;
            sample.alpha = 1.0;
        }
        sample.weighted(offset.weight)
    }
}

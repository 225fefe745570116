//! Light transport: from a [`Scene`] to a [`Film`](crate::film::Film).
//!
//! An [`Integrator`] estimates the light that a camera ray brings home; [`render()`] draws the rays, runs the
//! integrator in parallel and adds to the film. Every number that a path draws depends only on (seed, pixel,
//! sample index, dimension), so the same scene gives the same bytes at any thread count and in any crop.

mod direct;

pub mod guide;
pub mod hybrid;
pub mod light;
pub mod path;
pub mod radiosity;
pub mod radiosity_view;
pub mod prepare;
pub mod raytrace;
pub mod render;
pub mod shade;

pub use guide::{Guide, GuideSettings};
pub use hybrid::{Hybrid, IndirectLight};
pub use path::Path;
pub use prepare::{Prepared, prepare};
pub use radiosity_view::RadiosityView;
pub use raytrace::Raytrace;
pub use render::{NoProgress, Progress, RenderSettings, Rendered, render};

use crate::geometry::{Interaction, Ray};
use crate::math::Sampler;
use crate::scene::Scene;
use crate::spectrum::{SampledSpectrum, SampledWavelengths};

/// A camera ray with what the footprint of its pixel needs.
#[derive(Clone, Copy, Debug)]
pub struct PixelRay {
    /// The ray.
    pub ray: Ray,
    /// Growth of the pixel's radius per mm along the ray.
    pub spread: f32,
}

/// What a camera ray brings home.
#[derive(Clone, Copy, Debug, Default)]
pub struct Incident {
    /// Light after at most one scattering event, lights seen directly included.
    pub direct: SampledSpectrum,
    /// All other light.
    pub indirect: SampledSpectrum,
    /// First surface.
    pub first: Option<Interaction>,
}

/// A way to estimate the light along a camera ray.
pub trait Integrator: Sync {
    /// Radiance that arrives along `ray` at the wavelengths `lambda`.
    fn li(
        &self,
        scene: &Scene,
        ray: &PixelRay,
        lambda: &SampledWavelengths,
        sampler: &mut Sampler,
    ) -> Incident;
}

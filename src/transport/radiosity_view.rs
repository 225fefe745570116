//! The radiosity solution itself, seen without gathering.
//!
//! Model: what a surface sends to the eye is its own light and its radiosity, in every direction the same:
//!
//! ```text
//! L = L_emitted + B(side of the viewer) / pi
//! ```
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | B | [`Radiosity::leaving`] | irradiance | none |
//!
//! B is linear within an element. Limits: shadows and contacts are as sharp as the elements are small; no highlight, no
//! cells. `result.direct` holds what lights send, `result.indirect` all of B, direct light included. Guarded by
//! `view_of_a_furnace`. Source: Goral et al., SIGGRAPH 1984.

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use super::direct::{Came, meet};
use super::radiosity::Radiosity;
use super::{Incident, Integrator, PixelRay};
use crate::geometry::Side;
use crate::math::Sampler;
use crate::scene::{Drawing, Scene};
use crate::spectrum::SampledWavelengths;

/// Shows a solution.
#[derive(Clone, Debug)]
pub struct RadiosityView {
    /// What to show.
    pub solution: Arc<Radiosity>,
}

impl Integrator for RadiosityView {
    fn li(
        &self,
        scene: &Scene,
        pixel: &PixelRay,
        lambda: &SampledWavelengths,
        _sampler: &mut Sampler,
    ) -> Incident {
        let (direct, first) = meet(scene, &pixel.ray, Came::Camera, Drawing::Each, lambda);
        let mut result = Incident { direct, first, ..Incident::default() };
        if let Some(at) = first {
            let side = Side::of(at.frame.to_local(-pixel.ray.direction));
            result.indirect = self.solution.leaving(&at, side, lambda) * FRAC_1_PI;
        }
        result
    }
}

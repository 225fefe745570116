//! Scattering at a point: the [`Bsdf`] contract and the classical models.
//!
//! All directions are local unit vectors that point away from the surface: `wo` to the viewer, `wi` to the
//! light, +z the adaxial normal. `f` is in 1/sr and WITHOUT the cosine. Every model is reciprocal,
//! `eval(a, b) == eval(b, a)`, and conserves energy; [`literal_phong`] is the named exception that `check`
//! flags. See `docs/conventions.md`.

mod albedo;
pub mod lobe_albedo;
pub mod lambert;
pub mod phong;
pub mod literal_phong;
pub mod diffuse_transmission;

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use crate::geometry::Side;
use crate::math::Sampler;
use crate::math::frame::same_side;
use crate::spectrum::{SampledSpectrum, SampledWavelengths};

pub use diffuse_transmission::DiffuseTransmission;
pub use lambert::Lambert;
pub use literal_phong::LiteralPhong;
pub use phong::Phong;

/// Which part of a BSDF made a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lobe {
    /// Light stays on its side, without a preferred direction.
    DiffuseReflection,
    /// Light stays on its side, around a direction.
    GlossyReflection,
    /// Light passes through the sheet.
    DiffuseTransmission,
}

/// One sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Local direction to the light.
    pub wi: Vec3,
    /// Value of the whole BSDF for it, 1/sr, without the cosine.
    pub f: SampledSpectrum,
    /// Density of the whole sampling method for it, 1/sr.
    pub pdf_per_sr: f32,
    /// The lobe that was chosen.
    pub lobe: Lobe,
}

impl BsdfSample {
    /// `f |cos| / pdf`: what the path's throughput is multiplied by.
    pub fn weight(&self) -> SampledSpectrum {
        self.f * (self.wi.z.abs() / self.pdf_per_sr)
    }
}

/// A BSDF that can be evaluated, sampled and priced.
pub trait Bsdf: Send + Sync {
    /// `f(wo, wi)`, 1/sr, without the cosine. Zero when a direction lies in the surface.
    fn eval(&self, wo: Vec3, wi: Vec3, lambda: &SampledWavelengths) -> SampledSpectrum;

    /// Draws `wi` for `wo`: `u_lobe` chooses the lobe, `u` the direction. `None` where nothing is scattered.
    fn sample(&self, wo: Vec3, lambda: &SampledWavelengths, u_lobe: f32, u: Vec2) -> Option<BsdfSample>;

    /// Density of [`Bsdf::sample`] for `wi`, 1/sr; over the sphere it integrates to one where `sample`
    /// always succeeds, to the probability of success elsewhere.
    fn pdf(&self, wo: Vec3, wi: Vec3, lambda: &SampledWavelengths) -> f32;

    /// The diffuse part D of `f = D / pi + S`: the shares of the light on a side that leave on that side and on the
    /// other without a preferred direction. Which part of a model that is, is the model's choice; light transport
    /// may treat the parts apart. Default: nothing, so that the rest S is all.
    fn diffuse(&self, _side: Side, _lambda: &SampledWavelengths) -> [SampledSpectrum; 2] {
        [SampledSpectrum::ZERO; 2]
    }

    /// S(wo, wi), 1/sr, without the cosine. May be negative where D is a mean.
    fn eval_rest(&self, wo: Vec3, wi: Vec3, lambda: &SampledWavelengths) -> SampledSpectrum {
        if wo.z == 0.0 || wi.z == 0.0 {
            return SampledSpectrum::ZERO;
        }
        let [reflected, transmitted] = self.diffuse(Side::of(wo), lambda);
        let diffuse = if same_side(wo, wi) { reflected } else { transmitted };
        self.eval(wo, wi, lambda) - diffuse * FRAC_1_PI
    }

    /// As [`Bsdf::sample`], for S: `f` of the sample is S. `None` where S is zero.
    fn sample_rest(&self, wo: Vec3, lambda: &SampledWavelengths, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let sample = self.sample(wo, lambda, u_lobe, u)?;
        Some(BsdfSample { f: self.eval_rest(wo, sample.wi, lambda), ..sample })
    }

    /// Density of [`Bsdf::sample_rest`] for `wi`, 1/sr.
    fn pdf_rest(&self, wo: Vec3, wi: Vec3, lambda: &SampledWavelengths) -> f32 {
        self.pdf(wo, wi, lambda)
    }
}

/// What one step of light does in something that may only be simulated, such as a walk through cells.
///
/// [`Scatter::scatter`] follows light that arrives from the local direction `wi` and gives the direction in
/// which it leaves; energy that does not leave was absorbed. Every [`Bsdf`] scatters by sampling.
pub trait Scatter: Send + Sync {
    /// Direction in which the light leaves, with the weight `f |cos| / pdf`, whose mean over many calls is
    /// the directional albedo.
    fn scatter(
        &self,
        wi: Vec3,
        lambda: &SampledWavelengths,
        sampler: &mut Sampler,
    ) -> Option<(Vec3, SampledSpectrum)>;
}

impl<T: Bsdf> Scatter for T {
    fn scatter(
        &self,
        wi: Vec3,
        lambda: &SampledWavelengths,
        sampler: &mut Sampler,
    ) -> Option<(Vec3, SampledSpectrum)> {
        let u_lobe = sampler.next_1d();
        // Reciprocity lets the sampling towards the light serve for the light itself.
        let sample = self.sample(wi, lambda, u_lobe, sampler.next_2d())?;
        Some((sample.wi, sample.weight()))
    }
}

/// The direction of the +z hemisphere turned to the side that `z` is on.
fn on_side(w: Vec3, z: f32) -> Vec3 {
    Vec3::new(w.x, w.y, if z < 0.0 { -w.z } else { w.z })
}

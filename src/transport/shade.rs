//! One scattering event at a surface: the calls that every integrator makes.
//!
//! A BSDF, analytic or tabulated, is evaluated and priced, so that light sampling and BSDF sampling can be weighed against
//! each other. A petal of cells has only an unbiased estimate of its value and a walk: its direct light comes
//! from light sampling alone, and a light that the walk happens to meet is not counted again.
//!
//! The BSDF is also given in two parts, `f = D / pi + S`: what has no preferred direction ([`Bsdf::diffuse`]) and the rest, so
//! that the two may be carried in different ways.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::PixelRay;
use super::direct::Onward;
use crate::bsdf::Bsdf;
use crate::geometry::{Interaction, Side};
use crate::gonio::AtPigment;
use crate::math::Sampler;
use crate::math::frame::same_side;
use crate::math::sampler::{hash, hash_to_unit};
use crate::micro::shading::{CellPetal, Footprint, Points};
use crate::scene::{Petal, Scattering, Scene};
use crate::spectrum::{SampledSpectrum, SampledWavelengths};

/// A surface point seen from `wo`, ready to be shaded.
pub(super) struct Shading<'a> {
    at: Interaction,
    model: Model<'a>,
    wo: Vec3,
    wo_local: Vec3,
    footprint: Footprint,
    points: Points,
}

/// What scatters the light at the point.
#[expect(clippy::large_enum_variant, reason = "one lives at a time, on the stack: a box would be the heap")]
enum Model<'a> {
    Bsdf(&'a dyn Bsdf),
    Tabulated(AtPigment<'a>),
    Cells(&'a CellPetal),
}

/// Where light goes on.
pub(super) struct Next {
    pub(super) direction: Vec3,
    pub(super) weight: SampledSpectrum,
    /// Density of the direction, 1/sr; `None` where only a walk can draw it.
    pub(super) pdf_per_sr: Option<f32>,
}

impl<'a> Shading<'a> {
    /// A point to be shaded at the wavelengths `lambda`. `pixel` is given for what the camera sees directly; `points`
    /// cells shade it.
    pub(super) fn new(
        scene: &'a Scene,
        at: Interaction,
        wo: Vec3,
        lambda: &SampledWavelengths,
        pixel: Option<&PixelRay>,
        points: Points,
    ) -> Self {
        let material = &scene.materials[scene.shapes[at.shape as usize].material as usize];
        let model = match material.scattering() {
            Scattering::Bsdf(bsdf) => Model::Bsdf(bsdf),
            Scattering::Petal(Petal::Cells(petal)) => Model::Cells(petal),
            Scattering::Petal(Petal::Tabulated(petal)) => {
                let state = scene.tissue(at.shape, at.uv);
                let u = if petal.is_pure() { 0.0 } else { number_of(at.p, lambda) };
                Model::Tabulated(petal.pick(state, lambda, u))
            }
        };
        let footprint = match pixel {
            Some(pixel) if at.uv_scale_mm != glam::Vec2::ZERO => {
                // The disc of equal area where the ray's footprint falls on the surface.
                let cos = at.frame.n.dot(wo).abs().max(1e-3);
                Footprint {
                    center_um: (at.uv * at.uv_scale_mm).as_dvec2() * 1000.0,
                    radius_um: f64::from(pixel.spread * at.t / cos.sqrt()) * 1000.0,
                }
            }
            _ => Footprint::WIDE,
        };
        Self { wo_local: at.frame.to_local(wo), at, model, wo, footprint, points }
    }

    /// The sides of a direction by the shading normal and by the real surface must agree, else a smooth normal
    /// would let light through an opaque sheet.
    fn consistent(&self, wi: Vec3, wi_local: Vec3) -> bool {
        let real = self.at.ng.dot(wi) * self.at.ng.dot(self.wo);
        real * (wi_local.z * self.wo_local.z) > 0.0
    }

    /// The viewer's side.
    pub(super) fn side(&self) -> Side {
        Side::of(self.wo_local)
    }

    /// Is the value an estimate from walks through cells?
    pub(super) fn is_walk(&self) -> bool {
        matches!(self.model, Model::Cells(_))
    }

    /// `f |cos|` towards `wi`, and the density with which [`Shading::sample`] draws `wi`; `None` for a walk.
    pub(super) fn eval(
        &self,
        wi: Vec3,
        lambda: &SampledWavelengths,
        sampler: &mut Sampler,
    ) -> (SampledSpectrum, Option<f32>) {
        let wi_local = self.at.frame.to_local(wi);
        if !self.consistent(wi, wi_local) {
            return (SampledSpectrum::ZERO, Some(0.0));
        }
        let cos = wi_local.z.abs();
        match &self.model {
            Model::Bsdf(bsdf) => (
                bsdf.eval(self.wo_local, wi_local, lambda) * cos,
                Some(bsdf.pdf(self.wo_local, wi_local, lambda)),
            ),
            Model::Tabulated(petal) => {
                let (f, pdf_per_sr) = petal.eval_and_pdf(self.wo_local, wi_local);
                (f * cos, Some(pdf_per_sr))
            }
            Model::Cells(petal) => {
                let f = petal.estimate(self.wo_local, wi_local, lambda, self.footprint, self.points, sampler);
                (f * cos, None)
            }
        }
    }

    /// The diffuse part D of the BSDF, `f = D / pi + S`: shares of the light on a side that leave towards the viewer, of the
    /// viewer's own side and of the other.
    pub(super) fn diffuse(&self, lambda: &SampledWavelengths) -> [SampledSpectrum; 2] {
        let side = self.side();
        match &self.model {
            Model::Bsdf(bsdf) => bsdf.diffuse(side, lambda),
            Model::Tabulated(petal) => petal.diffuse(side, lambda),
            Model::Cells(petal) => petal.diffuse(side, lambda),
        }
    }

    /// `D / pi |cos|` towards `wi`.
    pub(super) fn eval_diffuse(&self, wi: Vec3, lambda: &SampledWavelengths) -> SampledSpectrum {
        let wi_local = self.at.frame.to_local(wi);
        if !self.consistent(wi, wi_local) {
            return SampledSpectrum::ZERO;
        }
        let [reflected, transmitted] = self.diffuse(lambda);
        let d = if same_side(self.wo_local, wi_local) { reflected } else { transmitted };
        d * (FRAC_1_PI * wi_local.z.abs())
    }

    /// As [`Shading::eval`], for the rest S.
    pub(super) fn eval_rest(
        &self,
        wi: Vec3,
        lambda: &SampledWavelengths,
        sampler: &mut Sampler,
    ) -> (SampledSpectrum, Option<f32>) {
        let wi_local = self.at.frame.to_local(wi);
        if !self.consistent(wi, wi_local) {
            return (SampledSpectrum::ZERO, Some(0.0));
        }
        let cos = wi_local.z.abs();
        let of = |bsdf: &dyn Bsdf| {
            let pdf_per_sr = bsdf.pdf_rest(self.wo_local, wi_local, lambda);
            (bsdf.eval_rest(self.wo_local, wi_local, lambda) * cos, Some(pdf_per_sr))
        };
        match &self.model {
            Model::Bsdf(bsdf) => of(*bsdf),
            Model::Tabulated(petal) => of(petal),
            Model::Cells(petal) => {
                let (footprint, points) = (self.footprint, self.points);
                let f = petal.estimate_rest(self.wo_local, wi_local, lambda, footprint, points, sampler);
                (f * cos, None)
            }
        }
    }

    /// Draws where light comes from.
    pub(super) fn sample(&self, lambda: &SampledWavelengths, sampler: &mut Sampler) -> Option<Next> {
        self.draw(Onward::Whole, lambda, sampler)
    }

    /// As [`Shading::sample`], for the rest S. `None` where there is none.
    pub(super) fn sample_rest(&self, lambda: &SampledWavelengths, sampler: &mut Sampler) -> Option<Next> {
        self.draw(Onward::Rest, lambda, sampler)
    }

    fn draw(&self, onward: Onward, lambda: &SampledWavelengths, sampler: &mut Sampler) -> Option<Next> {
        let of = |bsdf: &dyn Bsdf, sampler: &mut Sampler| {
            let u_lobe = sampler.next_1d();
            let u = sampler.next_2d();
            let s = match onward {
                Onward::Whole => bsdf.sample(self.wo_local, lambda, u_lobe, u)?,
                Onward::Rest => bsdf.sample_rest(self.wo_local, lambda, u_lobe, u)?,
            };
            Some((s.wi, s.weight(), Some(s.pdf_per_sr)))
        };
        let drawn = match &self.model {
            Model::Bsdf(bsdf) => of(*bsdf, sampler)?,
            Model::Tabulated(petal) => of(petal, sampler)?,
            Model::Cells(petal) => {
                let (wi, weight) = match onward {
                    Onward::Whole => petal.scatter_at(self.wo_local, lambda, self.footprint, sampler)?,
                    Onward::Rest => petal.scatter_rest_at(self.wo_local, lambda, self.footprint, sampler)?,
                };
                (wi, weight, None)
            }
        };
        self.next(drawn)
    }

    fn next(&self, (wi_local, weight, pdf_per_sr): (Vec3, SampledSpectrum, Option<f32>)) -> Option<Next> {
        let direction = self.at.frame.to_world(wi_local).normalize();
        self.consistent(direction, wi_local).then_some(Next { direction, weight, pdf_per_sr })
    }
}

/// A number in [0, 1) for one point of one path, so that what a place is a mixture of is picked without a sample of its own.
fn number_of(p: Vec3, lambda: &SampledWavelengths) -> f32 {
    let all = p.to_array().into_iter().chain([lambda.lambda_nm()[0]]);
    hash_to_unit(all.fold(0x71_55e5, |h, x| hash(h ^ x.to_bits()))) as f32
}

#[cfg(test)]
mod tests;

//! One scattering event at a surface: the two calls that every integrator makes.
//!
//! An analytic BSDF is evaluated and priced, so that light sampling and BSDF sampling can be weighed against
//! each other. A petal of cells has only an unbiased estimate of its value and a walk: its direct light comes
//! from light sampling alone, and a light that the walk happens to meet is not counted again.

use glam::Vec3;

use super::PixelRay;
use crate::geometry::Interaction;
use crate::math::Sampler;
use crate::micro::shading::Footprint;
use crate::scene::{Material, Scene};
use crate::spectrum::{SampledSpectrum, SampledWavelengths};

/// A surface point seen from `wo`, ready to be shaded.
pub(super) struct Shading<'a> {
    at: Interaction,
    material: &'a Material,
    wo: Vec3,
    wo_local: Vec3,
    footprint: Footprint,
    points: u32,
}

/// Where light goes on.
pub(super) struct Next {
    pub(super) direction: Vec3,
    pub(super) weight: SampledSpectrum,
    /// Density of the direction, 1/sr; `None` where only a walk can draw it.
    pub(super) pdf_per_sr: Option<f32>,
}

impl<'a> Shading<'a> {
    /// `pixel` is given for what the camera sees directly; `points` cells shade it.
    pub(super) fn new(
        scene: &'a Scene,
        at: Interaction,
        wo: Vec3,
        pixel: Option<&PixelRay>,
        points: u32,
    ) -> Self {
        let material = &scene.materials[scene.shapes[at.shape as usize].material as usize];
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
        Self { wo_local: at.frame.to_local(wo), at, material, wo, footprint, points }
    }

    /// The sides of a direction by the shading normal and by the real surface must agree, else a smooth normal
    /// would let light through an opaque sheet.
    fn consistent(&self, wi: Vec3, wi_local: Vec3) -> bool {
        let real = self.at.ng.dot(wi) * self.at.ng.dot(self.wo);
        real * (wi_local.z * self.wo_local.z) > 0.0
    }

    /// Is the value an estimate from walks through cells?
    pub(super) fn is_walk(&self) -> bool {
        self.material.bsdf().is_none()
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
        match self.material.bsdf() {
            Some(bsdf) => (
                bsdf.eval(self.wo_local, wi_local, lambda) * wi_local.z.abs(),
                Some(bsdf.pdf(self.wo_local, wi_local, lambda)),
            ),
            None => {
                let petal = self.material.petal();
                let f = petal.map_or(SampledSpectrum::ZERO, |p| {
                    p.estimate(self.wo_local, wi_local, lambda, self.footprint, self.points, sampler)
                });
                (f * wi_local.z.abs(), None)
            }
        }
    }

    /// Draws where light comes from.
    pub(super) fn sample(&self, lambda: &SampledWavelengths, sampler: &mut Sampler) -> Option<Next> {
        let (wi_local, weight, pdf_per_sr) = match (self.material.bsdf(), self.material.petal()) {
            (Some(bsdf), _) => {
                let u_lobe = sampler.next_1d();
                let s = bsdf.sample(self.wo_local, lambda, u_lobe, sampler.next_2d())?;
                (s.wi, s.weight(), Some(s.pdf_per_sr))
            }
            (None, Some(petal)) => {
                let (wi, weight) = petal.scatter_at(self.wo_local, lambda, self.footprint, sampler)?;
                (wi, weight, None)
            }
            (None, None) => return None,
        };
        let direction = self.at.frame.to_world(wi_local).normalize();
        self.consistent(direction, wi_local).then_some(Next { direction, weight, pdf_per_sr })
    }
}

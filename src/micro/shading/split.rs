//! A petal of cells as a diffuse part and the rest.
//!
//! Model: `f = D / pi + S` with D what leaves without a preferred direction, and S all that has one:
//!
//! ```text
//!            D              S
//! above      kd_S           f_E (the domes, every order) + the spongy layer's lobe
//! below      rho_abaxial    0
//! through    T = t_E t_S    f_D + f_I (transmission lobes)
//! ```
//!
//! | symbol | method | unit |
//! |---|---|---|
//! | D | [`CellPetal::diffuse`] | share of the incident light |
//! | S | [`CellPetal::estimate_rest`], [`CellPetal::scatter_rest_at`] | 1/sr |
//!
//! S is drawn as the whole petal is, from the parts that it has: domes, spongy lobe, transmission lobes, in proportion to
//! their means. Guarded by `diffuse_and_rest_are_the_petal` and `rest_is_drawn_as_it_is_estimated`.
//! Source: our reading.

use glam::Vec3;

use super::{CellPetal, Footprint, Points};
use crate::bsdf::lobe_albedo::lobe_albedo;
use crate::geometry::Side;
use crate::math::Frame;
use crate::math::Sampler;
use crate::math::frame::{mirror, same_side};
use crate::math::warp::square_to_power_cosine;
use crate::spectrum::{SampledSpectrum, SampledWavelengths};

/// Means of the parts of S for light from above, and of the transmission lobes alone.
struct Parts {
    domes: f32,
    spongy: f32,
    through: f32,
}

impl CellPetal {
    fn parts(&self, above: bool) -> Parts {
        let through = self.lobes.iter().map(|l| l.share().mean()).sum();
        if !above {
            return Parts { domes: 0.0, spongy: 0.0, through };
        }
        let domes = self.epidermis.diffuse().mean() + self.epidermis.specular().mean();
        Parts { domes, spongy: self.spongy.specular().mean(), through }
    }

    /// The diffuse part on a side: what it sends back, and what crosses the sheet.
    pub fn diffuse(&self, side: Side, lambda: &SampledWavelengths) -> [SampledSpectrum; 2] {
        let reflected = match side {
            Side::Adaxial => self.spongy.diffuse().sample(lambda),
            Side::Abaxial => self.abaxial.sample(lambda),
        };
        [reflected, self.transmittance.sample(lambda)]
    }

    /// Unbiased estimate of S(wo, wi), 1/sr, as [`CellPetal::estimate`].
    pub fn estimate_rest(
        &self,
        wo: Vec3,
        wi: Vec3,
        lambda: &SampledWavelengths,
        footprint: Footprint,
        points: impl Into<Points>,
        sampler: &mut Sampler,
    ) -> SampledSpectrum {
        match (wo.z > 0.0, wi.z > 0.0) {
            (false, false) => SampledSpectrum::ZERO,
            (true, true) => {
                self.estimate_all_domes(wo, wi, lambda, footprint, points.into(), sampler)
                    + self.spongy.eval_lobe(wo, wi, lambda)
            }
            _ => self.lobes.iter().fold(SampledSpectrum::ZERO, |f, lobe| f + lobe.eval(wo, wi, lambda)),
        }
    }

    /// Where S sends light from `wi`, with the weight `S |cos| / pdf`. `None` where nothing is sent on.
    pub fn scatter_rest_at(
        &self,
        wi: Vec3,
        lambda: &SampledWavelengths,
        footprint: Footprint,
        sampler: &mut Sampler,
    ) -> Option<(Vec3, SampledSpectrum)> {
        let (u_lobe, u) = (sampler.next_1d(), sampler.next_2d());
        let parts = self.parts(wi.z > 0.0);
        let total = parts.domes + parts.spongy + parts.through;
        if total <= 0.0 {
            return None;
        }
        let mut rest = u_lobe * total;
        if rest < parts.domes {
            let mut nested = sampler.fork(0, 1);
            let (out, weight) = self.walk_domes(wi, lambda, footprint, &mut nested)?;
            return Some((out, weight * (total / parts.domes)));
        }
        sampler.end_fork();
        rest -= parts.domes;
        if rest < parts.spongy {
            let n = self.spongy.exponent();
            let out = Frame::from_normal(mirror(wi)).to_world(square_to_power_cosine(u, n));
            // The lobe is drawn as (n + 1) / (2 pi) cos^n.
            let weight = self.spongy.specular().sample(lambda) * ((n + 2.0) / (n + 1.0) * out.z.abs());
            return same_side(out, wi).then(|| (out, weight * (total / parts.spongy)));
        }
        rest -= parts.spongy;
        let lobe = self.lobes.iter().find(|l| {
            rest -= l.share().mean();
            rest < 0.0
        })?;
        let (out, weight) = lobe.scatter(wi, lambda, u)?;
        Some((out, weight * (total / lobe.share().mean())))
    }

    /// Shares of light from this side, at this cosine from the normal, that are sent back and that cross the sheet,
    /// all but what the domes send back.
    pub fn albedo_without_domes(
        &self,
        side: Side,
        cos: f32,
        lambda: &SampledWavelengths,
    ) -> [SampledSpectrum; 2] {
        let [mut reflected, mut through] = self.diffuse(side, lambda);
        if side == Side::Adaxial {
            reflected += self.spongy.specular().sample(lambda) * lobe_albedo(self.spongy.exponent(), cos);
        }
        for lobe in &self.lobes {
            through += lobe.share().sample(lambda) * lobe_albedo(lobe.exponent(), cos);
        }
        [reflected, through]
    }

    /// Where the domes send light from above, to any order, with the weight `f_E |cos| / pdf`.
    pub fn scatter_domes(
        &self,
        wi: Vec3,
        lambda: &SampledWavelengths,
        sampler: &mut Sampler,
    ) -> Option<(Vec3, SampledSpectrum)> {
        self.walk_domes(wi, lambda, Footprint::WIDE, sampler)
    }

    /// Most that the domes can send back: what their surface reflects at the first hit.
    pub fn domes_bound(&self, lambda: &SampledWavelengths) -> SampledSpectrum {
        self.epidermis.diffuse().sample(lambda) + self.epidermis.specular().sample(lambda)
    }
}

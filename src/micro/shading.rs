//! The thesis' shading of a petal, carried from cells to the visible scale by stochastic sampling.
//!
//! Model: the light that a petal returns is the sum of two layers' light. The upper epidermis shades the
//! domes, the spongy layer shades the base plane, and both together let light through:
//!
//! ```text
//! f(wo, wi) = f_E(wo, wi) + f_S(wo, wi)         both directions above (adaxial side)
//!           = T / pi + f_D(wo, wi) + f_I(wo, wi), T = t_E t_S    on opposite sides
//!           = rho_abaxial / pi                  both below
//!
//! f_E = 1 / (A cos_o cos_i) ∫ f_e(n; wo, wi) <n.wo>+ <n.wi>+ V(wo) V(wi) dA  +  all orders between domes
//! f_e = kd_E / pi + ks_E (n_E + 2) / (2 pi) cos^n_E(alpha)    about the dome's normal n
//! f_S = kd_S / pi + ks_S (n_S + 2) / (2 pi) cos^n_S(alpha)    about the base's normal, n_S small: dull
//! f_D, f_I: light straight through, and light that an upright inner wall of a cell has turned round
//! ```
//!
//! V is the shadowing and masking by the domes: an exact ray in the cell field. Light that f_e sends to
//! another dome is reflected there by f_e again, to any order; what a later dome does not reflect is
//! absorbed. The normalised, reciprocal lobe replaces the textbook's (`crate::bsdf::phong`).
//!
//! **What is estimated.** Neither integral is solved. [`CellPetal::estimate`] draws points of the cells within
//! the footprint of the viewing ray ([`Footprint`]), uniformly over the petal's plane, follows the viewing ray to the dome that
//! it meets there, and averages `f_e(n; wo, wi) <n.wi>+ V(wi) / cos_i` along the reflections. A point is met with
//! density `<n.wo>+ V(wo) / (A cos_o)` per area of dome, so the average is an unbiased estimate of f for any
//! number of points, and converges to what the goniophotometer tabulates (`estimate_converges_to_the_table`).
//! Few points leave most hits without their highlight and a few with all of it, dull and broken; many points
//! give every hit its share, shiny and smooth (`few_points_are_duller`). Who wants the mean and not the thesis' dull
//! look may have some more points aimed at the highlight ([`Points`]).
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | kd, ks, n, t | [`Layer`] | shares of the incident light; n a pure number | the scene's `petal.shading` |
//! | rho_abaxial | `abaxial` | share of the incident light | the same |
//! | f_D, f_I | [`TransmissionLobe`] | 1/sr | none |
//!
//! Limits: kd_E + ks_E + kd_S + ks_S + t_E t_S + k_D + k_I <= 1 and rho_abaxial + t_E t_S + k_D + k_I <= 1 at every
//! nm (checked; k_D and k_I are the lobes' shares). Flat cells give f_e + f_S exactly (`flat_cells_are_two_phongs`).
//! Reciprocal (`estimate_is_reciprocal`). Our reading: kd_S and ks_S are what leaves the petal, the way through the
//! epidermis included; the spongy layer's light is not shadowed by the domes, as the thesis adds the two terms; the
//! product of the layers' transmittances crosses the sheet and leaves it diffusely; the domes neither shadow nor bend
//! what crosses it. Source: [Terado1999](https://hdl.handle.net/10119/1220), abstract.

mod points;
mod split;

pub use points::{Footprint, Points};

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};

use super::height_field::{CellField, CellHit};
use super::transmission::TransmissionLobe;
use crate::bsdf::{Bsdf, Phong, Scatter};
use crate::math::warp::square_to_cosine_hemisphere;
use crate::math::{Frame, Sampler};
use crate::spectrum::{SampledSpectrum, SampledWavelengths, Spectrum};
use crate::{Error, Result};

/// A walk among domes of albedo one may go on for long; its energy after this many is below rounding.
const MAX_ORDERS: u32 = 1000;
/// From this order on a walk survives with the probability of its throughput.
const ROULETTE_ORDER: u32 = 3;

/// Coefficients of one layer; each a share of the light that falls on the petal.
#[derive(Clone, Debug)]
pub struct Layer {
    /// Lambert, kd.
    pub diffuse: Spectrum,
    /// Phong, ks.
    pub specular: Spectrum,
    /// Phong's exponent, n.
    pub exponent: f32,
    /// Share that the layer lets through, t.
    pub transmittance: Spectrum,
}

/// A petal of cells: simulated, not evaluated, so a [`Scatter`] and no `Bsdf`.
#[derive(Clone, Debug)]
pub struct CellPetal {
    cells: Arc<CellField>,
    epidermis: Phong,
    spongy: Phong,
    transmittance: Spectrum,
    /// Light through the sheet that keeps a direction.
    lobes: Vec<TransmissionLobe>,
    abaxial: Spectrum,
    /// Probabilities of following the epidermis' and the spongy layer's light; the rest is transmission.
    choose: Choose,
}

#[derive(Clone, Copy, Debug)]
struct Choose {
    epidermis: f32,
    spongy: f32,
    abaxial: f32,
    /// Of what crosses the sheet, the part without a direction.
    diffuse: f32,
}

impl CellPetal {
    /// Checks the energy. Errors name `epidermis`, `spongy` or `abaxial`.
    pub fn new(cells: Arc<CellField>, epidermis: &Layer, spongy: &Layer, abaxial: Spectrum) -> Result<Self> {
        Self::with_lobes(cells, epidermis, spongy, abaxial, Vec::new())
    }

    /// A petal that also lets light through around directions.
    pub fn with_lobes(
        cells: Arc<CellField>,
        epidermis: &Layer,
        spongy: &Layer,
        abaxial: Spectrum,
        lobes: Vec<TransmissionLobe>,
    ) -> Result<Self> {
        let lobe = |layer: &Layer, name: &str| {
            Phong::new(layer.diffuse.clone(), layer.specular.clone(), layer.exponent).map_err(|e| match e {
                Error::Invalid { at, what } => Error::invalid(format!("{name}.{at}"), what),
                e => e,
            })
        };
        for (name, layer) in [("epidermis", epidermis), ("spongy", spongy)] {
            let (low, high) =
                (layer.transmittance.zip(&Spectrum::from(0.0), |t, _| -t).max(), layer.transmittance.max());
            if !(low <= 0.0 && high <= 1.0) {
                return Err(Error::invalid(
                    format!("{name}.transmittance"),
                    "a share of the light lies between 0 and 1",
                ));
            }
        }
        let transmittance = epidermis.transmittance.zip(&spongy.transmittance, |a, b| a * b);
        let sum = |a: &Spectrum, b: &Spectrum| a.zip(b, |a, b| a + b);
        // All that crosses the sheet; lobes without light leave it as it is.
        let through = lobes.iter().fold(transmittance.clone(), |t, lobe| sum(&t, lobe.share()));
        let e = sum(&epidermis.diffuse, &epidermis.specular);
        let s = sum(&spongy.diffuse, &spongy.specular);
        let upper = sum(&sum(&e, &s), &through).max();
        if upper.is_nan() || upper > 1.0 + 1e-5 {
            return Err(Error::invalid(
                "epidermis",
                format!(
                    "reflection of both layers and transmission sum to {upper} at some wavelength; at most 1 keeps the energy"
                ),
            ));
        }
        let lower = sum(&abaxial, &through).max();
        if lower.is_nan() || lower > 1.0 + 1e-5 || abaxial.zip(&Spectrum::from(0.0), |a, _| -a).max() > 0.0 {
            return Err(Error::invalid(
                "abaxial",
                format!(
                    "reflection below and transmission sum to {lower} at some wavelength; they lie between 0 and 1"
                ),
            ));
        }
        let (e, s, t, b) = (e.mean(), s.mean(), through.mean(), abaxial.mean());
        let share = |part: f32, whole: f32| if whole > 0.0 { part / whole } else { 0.0 };
        let choose = Choose {
            epidermis: share(e, e + s + t),
            spongy: share(s, e + s + t),
            abaxial: share(b, b + t),
            diffuse: share(transmittance.mean(), t),
        };
        Ok(Self {
            cells,
            epidermis: lobe(epidermis, "epidermis")?,
            spongy: lobe(spongy, "spongy")?,
            transmittance,
            lobes,
            abaxial,
            choose,
        })
    }

    /// Domes of a single Lambertian surface over a black base: the simplest rough petal.
    pub fn lambert(cells: Arc<CellField>, albedo: Spectrum) -> Result<Self> {
        let layer =
            |diffuse| Layer { diffuse, specular: 0.0.into(), exponent: 1.0, transmittance: 0.0.into() };
        Self::new(cells, &layer(albedo), &layer(0.0.into()), 0.0.into())
    }

    /// The cells.
    pub fn cells(&self) -> &CellField {
        &self.cells
    }

    /// Colour of the petal in light from everywhere, without the losses between domes: for denoisers and
    /// masks, not for transport.
    pub fn albedo(&self, wo: Vec3, lambda: &SampledWavelengths) -> SampledSpectrum {
        if wo.z < 0.0 {
            return self.abaxial.sample(lambda);
        }
        let both = |p: &Phong| p.diffuse().sample(lambda) + p.specular().sample(lambda);
        both(&self.epidermis) + both(&self.spongy)
    }

    /// Share of the light that crosses the sheet, where it falls upright on it.
    pub fn transmittance(&self, lambda: &SampledWavelengths) -> SampledSpectrum {
        self.lobes.iter().fold(self.transmittance.sample(lambda), |t, lobe| t + lobe.share().sample(lambda))
    }

    /// Unbiased estimate of `f(wo, wi)`, 1/sr, from `points` of the cells within `footprint`.
    pub fn estimate(
        &self,
        wo: Vec3,
        wi: Vec3,
        lambda: &SampledWavelengths,
        footprint: Footprint,
        points: impl Into<Points>,
        sampler: &mut Sampler,
    ) -> SampledSpectrum {
        match (wo.z > 0.0, wi.z > 0.0) {
            (false, false) => self.abaxial.sample(lambda) * FRAC_1_PI,
            (true, true) => {
                self.estimate_all_domes(wo, wi, lambda, footprint, points.into(), sampler)
                    + self.spongy.eval(wo, wi, lambda)
            }
            _ => self
                .lobes
                .iter()
                .fold(self.transmittance.sample(lambda) * FRAC_1_PI, |f, lobe| f + lobe.eval(wo, wi, lambda)),
        }
    }

    /// One reflection by f_e: the next direction, or `None` where the light is absorbed.
    fn reflect(
        &self,
        at: &CellHit,
        direction: DVec3,
        order: u32,
        lambda: &SampledWavelengths,
        throughput: &mut SampledSpectrum,
        sampler: &mut Sampler,
    ) -> Option<DVec3> {
        let frame = Frame::from_normal(at.normal.as_vec3());
        let local = frame.to_local(-direction.as_vec3());
        let u_lobe = sampler.next_1d();
        let u = sampler.next_2d();
        if local.z <= 0.0 {
            return None;
        }
        let sample = self.epidermis.sample(local, lambda, u_lobe, u)?;
        *throughput *= sample.weight();
        if order + 1 >= ROULETTE_ORDER {
            let survive = throughput.max().min(1.0);
            if sampler.next_1d() >= survive {
                return None;
            }
            *throughput *= 1.0 / survive;
        }
        Some(frame.to_world(sample.wi).as_dvec3().normalize())
    }

    /// Light from above through the domes' reflections until it escapes.
    fn walk_domes(
        &self,
        wi: Vec3,
        lambda: &SampledWavelengths,
        footprint: Footprint,
        sampler: &mut Sampler,
    ) -> Option<(Vec3, SampledSpectrum)> {
        let mut direction = -wi.as_dvec3().normalize();
        let mut at = self.first_hit(direction, footprint, sampler)?;
        let mut throughput = SampledSpectrum::ONE;
        for order in 0..MAX_ORDERS {
            direction = self.reflect(&at, direction, order, lambda, &mut throughput, sampler)?;
            match self.cells.first_hit_from(&at, direction) {
                Some(next) => at = next,
                // A ray that never leaves the domes, nor meets one, is as good as parallel to them: absorbed.
                None if direction.z > 0.0 => return Some((direction.as_vec3(), throughput)),
                None => return None,
            }
        }
        None
    }

    /// [`Scatter::scatter`] for light that falls on the given footprint.
    pub fn scatter_at(
        &self,
        wi: Vec3,
        lambda: &SampledWavelengths,
        footprint: Footprint,
        sampler: &mut Sampler,
    ) -> Option<(Vec3, SampledSpectrum)> {
        let (u_lobe, u) = (sampler.next_1d(), sampler.next_2d());
        let choose = self.choose;
        if wi.z > 0.0 && u_lobe < choose.epidermis {
            let mut nested = sampler.fork(0, 1);
            let (out, weight) = self.walk_domes(wi, lambda, footprint, &mut nested)?;
            return Some((out, weight * (1.0 / choose.epidermis)));
        }
        sampler.end_fork();
        if wi.z > 0.0 && u_lobe < choose.epidermis + choose.spongy {
            let u_spongy = (u_lobe - choose.epidermis) / choose.spongy;
            let sample = self.spongy.sample(wi, lambda, u_spongy.clamp(0.0, 0.999_999_9), u)?;
            return Some((sample.wi, sample.weight() * (1.0 / choose.spongy)));
        }
        let w = square_to_cosine_hemisphere(u);
        if wi.z <= 0.0 && u_lobe < choose.abaxial {
            return Some((-w, self.abaxial.sample(lambda) * (1.0 / choose.abaxial)));
        }
        let through = if wi.z > 0.0 { 1.0 - choose.epidermis - choose.spongy } else { 1.0 - choose.abaxial };
        if through <= 1e-6 {
            return None;
        }
        let u_through = ((u_lobe - (1.0 - through)) / through).clamp(0.0, 0.999_999_9);
        let (out, weight) = self.cross(wi, lambda, u_through, u, w)?;
        Some((out, weight * (1.0 / through)))
    }

    /// Light that crosses the sheet; `w` is the direction of the diffuse part, above.
    fn cross(
        &self,
        wi: Vec3,
        lambda: &SampledWavelengths,
        u_through: f32,
        u: Vec2,
        w: Vec3,
    ) -> Option<(Vec3, SampledSpectrum)> {
        let diffuse = self.choose.diffuse;
        // Where there are no lobes, `diffuse` is one (or nothing crosses the sheet at all).
        if self.lobes.is_empty() || u_through < diffuse {
            let out = if wi.z > 0.0 { -w } else { w };
            let choice = if self.lobes.is_empty() { 1.0 } else { diffuse };
            return Some((out, self.transmittance.sample(lambda) * (1.0 / choice)));
        }
        // The lobes share the rest in proportion to their means.
        let total: f32 = self.lobes.iter().map(|l| l.share().mean()).sum();
        let mut rest = (u_through - diffuse) / (1.0 - diffuse) * total;
        let lobe = self.lobes.iter().find(|l| {
            rest -= l.share().mean();
            rest < 0.0
        })?;
        let (out, weight) = lobe.scatter(wi, lambda, u)?;
        let choice = (1.0 - diffuse) * lobe.share().mean() / total;
        Some((out, weight * (1.0 / choice)))
    }
}

impl Scatter for CellPetal {
    fn scatter(
        &self,
        wi: Vec3,
        lambda: &SampledWavelengths,
        sampler: &mut Sampler,
    ) -> Option<(Vec3, SampledSpectrum)> {
        self.scatter_at(wi, lambda, Footprint::WIDE, sampler)
    }
}

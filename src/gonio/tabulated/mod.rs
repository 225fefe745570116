//! A measured petal as a BSDF, at any wavelength and any amount of pigment.
//!
//! Model: the tables of [`PetalOptics`], linear between the nodes of their angles, with what pigment leaves of each class:
//!
//! ```text
//! f(wo, wi) = s(wo, wi) + sum over k of i_k(wo, wi) e_k(c mu(lambda))
//! a(wo)     = integral of f |cos(wi)| dwi           in closed form, from the tables
//! pdf(wi)   = mean f |cos(wi)| / mean a(wo)         means over the wavelengths of the path
//! ```
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | s, i_k, e_k | [`PetalOptics`] | 1/sr, 1/sr, share | none |
//! | mu_r | `absorption_per_um` | 1/um | none |
//! | c_r | `scale` | pure number | 1 |
//!
//! **Sampling.** f cos is a mixture of products of hats with positive weights: surface or class, reflected or transmitted,
//! one of two incident nodes, exitant node, azimuth's node. Each choice is made in proportion to its weight, then an angle is
//! drawn from its hat, so directions have exactly the density above, and a sample's weight `f cos / pdf` is `a` but for the
//! difference of its colour from the mean. No wavelength's weight exceeds [`LANES`] times the mean albedo.
//!
//! **Energy.** At a node `a` is the measured share, at most one ([`PetalOptics::validate`]); between nodes a linear mixture of two.
//!
//! Limits: reciprocal to the last bit (`reciprocal_to_the_last_bit`); samples follow the pdf and energy is kept
//! (`tests/conformance.rs`); the albedo is the integral of f (`albedo_is_the_integral`); pigment multiplies by Beer-Lambert
//! (`pigment_scales_are_beer_lambert`); the tables that a measurement makes by default stay under 32 MB
//! (`memory_is_bounded`). Single cells are not resolved: the petal is seen from far away. A bin of 5 degrees blurs
//! sharper gloss; next to the normal the azimuth of the first bin is not smoothed.
//! Source: our reading.

mod component;
mod hats;
mod spectral;

use glam::{Vec2, Vec3};

use super::{Part, PetalOptics, Place};
use crate::bsdf::{Bsdf, BsdfSample, Lobe};
use crate::geometry::Side;
use crate::math::exp::{exp, ln};
use crate::math::frame::same_side;
use crate::math::widest;
use crate::micro::{REGIONS, Tissue};
use crate::spectrum::spectra::DENSE_SAMPLES;
use crate::spectrum::{LANES, SampledSpectrum, SampledWavelengths, Spectrum, VISIBLE_NM};
use crate::{Error, Result};

use component::Component;

pub use spectral::{OpticsAtBands, measured_tissue};

/// Most classes of walks that a table may have: what is left of each is kept beside the tables of a hit.
pub const MAX_CLASSES: usize = 128;
/// Most memory of a petal's tables.
pub const MAX_BYTES: usize = 32 << 20;

/// Whether light comes back or passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    Reflected = 0,
    Transmitted = 1,
}

impl Way {
    const BOTH: [Self; 2] = [Way::Reflected, Way::Transmitted];
}

/// Position of what belongs to light on `side` at a polar node that goes a way.
fn index(side: Side, way: Way, node: usize, thetas: usize) -> usize {
    (side as usize * 2 + way as usize) * thetas + node
}

/// The renderable petal.
#[derive(Clone, Debug)]
pub struct TabulatedBsdf {
    surface: Component,
    interior: Component,
    /// Mean way of each class through each region, and the variance of the ways over it, um.
    ways_um: Vec<[(f32, f32); REGIONS]>,
    absorption_per_um: [Spectrum; REGIONS],
    /// e_k at every nm of the visible range.
    remaining: Vec<f32>,
    /// Mean albedo of the interior's classes in light from everywhere: `[side][way][class]`.
    hemispherical: [[Vec<f32>; 2]; 2],
}

impl TabulatedBsdf {
    /// From a measured petal and the absorption of each region at pigment scale one. Errors name the field of the optics
    /// that is wrong.
    pub fn new(optics: &PetalOptics, absorption_per_um: [Spectrum; REGIONS]) -> Result<Self> {
        optics.validate("optics")?;
        if optics.interior.classes > MAX_CLASSES {
            let what = format!("{} classes; at most {MAX_CLASSES} can be rendered", optics.interior.classes);
            return Err(Error::invalid("optics: interior", what));
        }
        for mu in &absorption_per_um {
            if !(mu.min() >= 0.0 && mu.max().is_finite()) {
                return Err(Error::invalid("absorption", "negative or not a finite number"));
            }
        }
        let ways = |(path, spread): (&[f32; REGIONS], &[f32; REGIONS])| {
            // Narrower than this, the ways of a class are all alike.
            let ratio = |l: f32, s: f32| if s > 1e-4 * l { s * s / l } else { 0.0 };
            std::array::from_fn(|r| (path[r], ratio(path[r], spread[r])))
        };
        let interior = Component::new(&optics.interior);
        let mut bsdf = Self {
            surface: Component::new(&optics.surface),
            ways_um: optics.paths_um.iter().zip(&optics.spreads_um).map(ways).collect(),
            absorption_per_um,
            remaining: Vec::new(),
            hemispherical: [Side::Adaxial, Side::Abaxial]
                .map(|side| Way::BOTH.map(|way| interior.hemispherical(side, way))),
            interior,
        };
        bsdf.remaining = bsdf.remaining_at_every_nm();
        if bsdf.bytes() > MAX_BYTES {
            let what =
                format!("its tables would take {} MiB; at most {}", bsdf.bytes() >> 20, MAX_BYTES >> 20);
            return Err(Error::invalid("optics", what));
        }
        Ok(bsdf)
    }

    /// From a measured petal with the pigments of a tissue of the same shape.
    pub fn of_tissue(optics: &PetalOptics, tissue: &Tissue) -> Result<Self> {
        Self::new(optics, spectral::absorption_per_um(tissue)?)
    }

    fn remaining_at_every_nm(&self) -> Vec<f32> {
        let nm = |i: usize| VISIBLE_NM.0 + i as f32;
        let mut all = Vec::with_capacity(DENSE_SAMPLES * self.ways_um.len());
        let mut eight = vec![[0.0; LANES]; self.ways_um.len()];
        for first in (0..DENSE_SAMPLES).step_by(LANES) {
            let lambda = SampledWavelengths::given(std::array::from_fn(|lane| nm(first + lane)));
            remain(
                &std::array::from_fn(|r| self.absorption_per_um[r].sample(&lambda)),
                &self.ways_um,
                &mut eight,
            );
            for lane in 0..LANES.min(DENSE_SAMPLES - first) {
                all.extend(eight.iter().map(|e| e[lane]));
            }
        }
        all
    }

    /// Bytes of the tables.
    pub fn bytes(&self) -> usize {
        self.surface.bytes()
            + self.interior.bytes()
            + size_of_val(&self.ways_um[..])
            + size_of_val(&self.remaining[..])
    }

    /// The petal where its pigments are `scale` times those of its absorption, ready for the wavelengths of a path.
    pub fn at(&self, scale: [f32; REGIONS], lambda: &SampledWavelengths) -> AtPigment<'_> {
        let mut at = AtPigment {
            table: self,
            scale,
            lambda: *lambda,
            remaining: [[0.0; LANES]; MAX_CLASSES],
            mean: [0.0; MAX_CLASSES],
        };
        let remaining = &mut at.remaining[..self.ways_um.len()];
        if scale == [1.0; REGIONS] {
            self.look_up(lambda, remaining);
        } else {
            let mu = std::array::from_fn(|r| self.absorption_per_um[r].sample(lambda) * scale[r].max(0.0));
            remain(&mu, &self.ways_um, remaining);
        }
        for (mean, left) in at.mean.iter_mut().zip(remaining) {
            *mean = left.iter().sum::<f32>() * (1.0 / LANES as f32);
        }
        at
    }

    /// e_k at pigment scale one: linear between whole nm.
    fn look_up(&self, lambda: &SampledWavelengths, remaining: &mut [[f32; LANES]]) {
        let classes = self.ways_um.len();
        for (lane, nm) in lambda.lambda_nm().iter().enumerate() {
            let x = (nm - VISIBLE_NM.0).clamp(0.0, (DENSE_SAMPLES - 1) as f32);
            let i = (x as usize).min(DENSE_SAMPLES - 2);
            let t = x - i as f32;
            let (low, high) = self.remaining[i * classes..(i + 2) * classes].split_at(classes);
            for ((r, low), high) in remaining.iter_mut().zip(low).zip(high) {
                r[lane] = low + (high - low) * t;
            }
        }
    }
}

/// e_k of every class at eight wavelengths: the product over regions of `(1 + mu w)^(-l / w)`, l the mean way and w l the
/// variance of the ways; `exp(-mu l)` where w is small.
fn remain(
    mu: &[SampledSpectrum; REGIONS],
    ways_um: &[[(f32, f32); REGIONS]],
    remaining: &mut [[f32; LANES]],
) {
    widest(
        #[inline(always)]
        || remain_inline(mu, ways_um, remaining),
    );
}

#[inline(always)]
fn remain_inline(
    mu: &[SampledSpectrum; REGIONS],
    ways_um: &[[(f32, f32); REGIONS]],
    remaining: &mut [[f32; LANES]],
) {
    let coloured: [bool; REGIONS] = std::array::from_fn(|r| !mu[r].is_zero());
    for (remaining, ways) in remaining.iter_mut().zip(ways_um) {
        let mut depth = [0.0; LANES];
        for r in 0..REGIONS {
            let ((l, w), mu) = (ways[r], &mu[r].0);
            if !coloured[r] || l == 0.0 {
                continue;
            }
            let mut y = [1.0; LANES];
            for lane in 0..LANES {
                y[lane] += mu[lane] * w;
            }
            let ln = ln(y);
            for lane in 0..LANES {
                let x = mu[lane] * w;
                // ln(1 + x) / x loses its digits near zero, where its series is short.
                let series = 1.0 - x * (0.5 - x * (1.0 / 3.0 - x * (0.25 - x * 0.2)));
                let ratio = if x < 0.03 { series } else { ln[lane] / x };
                depth[lane] -= mu[lane] * l * ratio;
            }
        }
        *remaining = exp(depth);
    }
}

/// Sum of products, in eight sums side by side.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b[..a.len()].chunks_exact(8));
    let rest: f32 = a8.remainder().iter().zip(b8.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a8.zip(b8) {
        for i in 0..8 {
            sums[i] += a[i] * b[i];
        }
    }
    sums.iter().sum::<f32>() + rest
}

/// A [`TabulatedBsdf`] at an amount of pigment. Made for the wavelengths of a path; at others it makes itself anew.
#[derive(Clone, Copy, Debug)]
pub struct AtPigment<'a> {
    table: &'a TabulatedBsdf,
    scale: [f32; REGIONS],
    lambda: SampledWavelengths,
    /// e_k per wavelength.
    remaining: [[f32; LANES]; MAX_CLASSES],
    /// Their means over the wavelengths.
    mean: [f32; MAX_CLASSES],
}

/// Polar angle from the normal of the direction's own side.
fn polar(w: Vec3) -> f32 {
    // Both are exact near their zeros, where acos is not.
    w.truncate().length().atan2(w.z.abs())
}

/// Angle between the azimuths of two directions; that of a direction along the normal is 0.
fn between_azimuths(a: Vec3, b: Vec3) -> f32 {
    let horizontal = |w: Vec3| if w.x == 0.0 && w.y == 0.0 { Vec2::X } else { w.truncate() };
    let (a, b) = (horizontal(a), horizontal(b));
    // Both terms are the same to the last bit when a and b change places.
    a.perp_dot(b).abs().atan2(a.dot(b))
}

/// Where two directions stand in the tables; the same to the last bit when they change places.
fn place(wo: Vec3, wi: Vec3) -> Place {
    let (o, i, phi) = (polar(wo), polar(wi), between_azimuths(wo, wi));
    let (part, theta_a, theta_b) = match (same_side(wo, wi), wo.z > 0.0) {
        // The table is symmetric; one order makes the arithmetic so, too.
        (true, true) => (Part::Adaxial, o.min(i), o.max(i)),
        (true, false) => (Part::Abaxial, o.min(i), o.max(i)),
        (false, true) => (Part::Through, o, i),
        (false, false) => (Part::Through, i, o),
    };
    Place { part, theta_a, theta_b, phi }
}

impl AtPigment<'_> {
    fn value(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        if wo.z == 0.0 || wi.z == 0.0 {
            return SampledSpectrum::ZERO;
        }
        let place = place(wo, wi);
        widest(
            #[inline(always)]
            || self.value_at(&place),
        )
    }

    #[inline(always)]
    fn value_at(&self, place: &Place) -> SampledSpectrum {
        let mut surface = [0.0];
        self.table.surface.add(place, &mut surface);
        let mut interior = [0.0; MAX_CLASSES];
        let interior = &mut interior[..self.table.interior.classes()];
        self.table.interior.add(place, interior);
        let mut f = [surface[0]; LANES];
        for (i, remaining) in interior.iter().zip(&self.remaining) {
            for (f, r) in f.iter_mut().zip(remaining) {
                *f += i * r;
            }
        }
        SampledSpectrum(f)
    }

    /// The light that has been inside the petal, as if it were Lambertian: the shares of light from everywhere on a side
    /// that leave on that side and on the other, per wavelength.
    pub fn interior_diffuse(&self, side: Side) -> [SampledSpectrum; 2] {
        Way::BOTH.map(|way| {
            let mut sum = [0.0; LANES];
            let classes = &self.table.hemispherical[side as usize][way as usize];
            for (a, remaining) in classes.iter().zip(&self.remaining) {
                for (sum, r) in sum.iter_mut().zip(remaining) {
                    *sum += a * r;
                }
            }
            SampledSpectrum(sum)
        })
    }

    /// Share of the light from `wo` that leaves on its side and on the other, per wavelength.
    pub fn albedo(&self, wo: Vec3) -> [SampledSpectrum; 2] {
        let side = Side::of(wo);
        let theta = polar(wo);
        Way::BOTH.map(|way| {
            let mut sum = SampledSpectrum::ZERO;
            for (node, w) in self.table.surface.incident(theta).both() {
                sum += SampledSpectrum::splat(w * self.table.surface.albedo_at(side, way, node)[0]);
            }
            for (node, w) in self.table.interior.incident(theta).both() {
                for (a, r) in self.table.interior.albedo_at(side, way, node).iter().zip(self.remaining) {
                    sum += SampledSpectrum(r) * (w * a);
                }
            }
            sum
        })
    }

    /// Mean albedo over the wavelengths, all ways.
    fn mean_albedo(&self, wo: Vec3) -> f32 {
        let (side, theta) = (Side::of(wo), polar(wo));
        let of = |component: &Component, mean: &[f32]| {
            let mut sum = 0.0;
            for (node, w) in component.incident(theta).both() {
                for way in Way::BOTH {
                    sum += w * dot(component.albedo_at(side, way, node), mean);
                }
            }
            sum
        };
        of(&self.table.surface, &[1.0]) + of(&self.table.interior, &self.mean)
    }

    /// Calls `visit` with the weight of every part of the mixture up to the classes, until it says that it has enough.
    #[inline]
    fn branches(&self, wo: Vec3, mut visit: impl FnMut(f32, Branch) -> bool) {
        let side = Side::of(wo);
        let theta = polar(wo);
        for (is_surface, component) in [(true, &self.table.surface), (false, &self.table.interior)] {
            let [(n0, w0), (n1, w1)] = component.incident(theta).both();
            for way in Way::BOTH {
                let (first, second) =
                    (component.albedo_at(side, way, n0), component.albedo_at(side, way, n1));
                for (class, (a0, a1)) in first.iter().zip(second).enumerate() {
                    let mean = if is_surface { 1.0 } else { self.mean[class] };
                    let weight = (w0 * a0 + w1 * a1) * mean;
                    if visit(weight, Branch { is_surface, way, class }) {
                        return;
                    }
                }
            }
        }
    }

    /// Value and density together.
    pub fn eval_and_pdf(&self, wo: Vec3, wi: Vec3) -> (SampledSpectrum, f32) {
        let f = self.value(wo, wi);
        if f.is_zero() {
            return (f, 0.0);
        }
        let albedo = self.mean_albedo(wo);
        (f, if albedo > 0.0 { f.mean() * wi.z.abs() / albedo } else { 0.0 })
    }

    /// The same petal at other wavelengths.
    fn for_wavelengths<T>(&self, lambda: &SampledWavelengths, f: impl FnOnce(&Self) -> T) -> T {
        if *lambda == self.lambda { f(self) } else { f(&self.table.at(self.scale, lambda)) }
    }

    fn draw(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        let target = u_lobe * self.mean_albedo(wo);
        let (mut sum, mut chosen) = (0.0, None);
        self.branches(wo, |weight, branch| {
            if weight > 0.0 {
                chosen = Some((branch, (target - sum) / weight));
            }
            sum += weight;
            sum > target
        });
        let (branch, within) = chosen?;
        let (side, way) = (Side::of(wo), branch.way);
        let component = if branch.is_surface { &self.table.surface } else { &self.table.interior };
        let nodes = component.incident(polar(wo)).both();
        let [first, second] = nodes.map(|(node, w)| w * component.albedo_at(side, way, node)[branch.class]);
        let node = if within * (first + second) < first { nodes[0].0 } else { nodes[1].0 };
        let (theta, turn) = component.draw((side, way, node, branch.class), u);
        let azimuth = if wo.x == 0.0 && wo.y == 0.0 { 0.0 } else { f64::from(wo.y).atan2(f64::from(wo.x)) };
        let up = if (way == Way::Reflected) == (wo.z > 0.0) { 1.0 } else { -1.0 };
        let wi = glam::DVec3::new(
            theta.sin() * (azimuth + turn).cos(),
            theta.sin() * (azimuth + turn).sin(),
            up * theta.cos(),
        )
        .as_vec3();
        let (f, pdf_per_sr) = self.eval_and_pdf(wo, wi);
        let lobe = match (branch.is_surface, way) {
            (_, Way::Transmitted) => Lobe::DiffuseTransmission,
            (true, Way::Reflected) => Lobe::GlossyReflection,
            (false, Way::Reflected) => Lobe::DiffuseReflection,
        };
        (pdf_per_sr > 0.0).then_some(BsdfSample { wi, f, pdf_per_sr, lobe })
    }
}

/// Which part of the mixture.
#[derive(Clone, Copy)]
struct Branch {
    is_surface: bool,
    way: Way,
    class: usize,
}

impl Bsdf for AtPigment<'_> {
    fn eval(&self, wo: Vec3, wi: Vec3, lambda: &SampledWavelengths) -> SampledSpectrum {
        self.for_wavelengths(lambda, |at| at.value(wo, wi))
    }

    fn sample(&self, wo: Vec3, lambda: &SampledWavelengths, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        self.for_wavelengths(lambda, |at| at.draw(wo, u_lobe, u))
    }

    fn pdf(&self, wo: Vec3, wi: Vec3, lambda: &SampledWavelengths) -> f32 {
        self.for_wavelengths(lambda, |at| at.eval_and_pdf(wo, wi).1)
    }

    /// The light that has been inside is nearly Lambertian; its departure from it is part of the rest.
    fn diffuse(&self, side: Side, lambda: &SampledWavelengths) -> [SampledSpectrum; 2] {
        self.for_wavelengths(lambda, |at| at.interior_diffuse(side))
    }
}

impl Bsdf for TabulatedBsdf {
    fn eval(&self, wo: Vec3, wi: Vec3, lambda: &SampledWavelengths) -> SampledSpectrum {
        self.at([1.0; REGIONS], lambda).value(wo, wi)
    }

    fn sample(&self, wo: Vec3, lambda: &SampledWavelengths, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        self.at([1.0; REGIONS], lambda).draw(wo, u_lobe, u)
    }

    fn pdf(&self, wo: Vec3, wi: Vec3, lambda: &SampledWavelengths) -> f32 {
        self.at([1.0; REGIONS], lambda).eval_and_pdf(wo, wi).1
    }
}

#[cfg(test)]
mod tests;

//! A measured petal as a BSDF, at any wavelength and any amount of pigment.
//!
//! Model: the tables of [`PetalOptics`], linear between the nodes of their angles, with what pigment leaves of each class:
//!
//! ```text
//! f(wo, wi) = s(wo, wi) + sum over k of i_k(wo, wi) E_k,   E_k(lambda) = exp(-sum over regions r of c_r mu_r(lambda) l_kr)
//! a(wo)     = integral of f |cos(wi)| dwi                  in closed form, from the tables
//! pdf(wi)   = mean f |cos(wi)| / mean a(wo)                means over the wavelengths of the path
//! ```
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | s, i_k, l_k | [`PetalOptics`] | 1/sr, um | none |
//! | mu_r | `absorption_per_um` | 1/um | none |
//! | c_r | `scale` | pure number | 1 |
//!
//! **Sampling.** f cos is a mixture of products of hats with positive weights: surface or class, reflected or transmitted,
//! one of two incident nodes, exitant node, azimuth's node. Each choice is made in proportion to its weight, then an angle is
//! drawn from its hat, so directions have exactly the density above, and a sample's weight `f cos / pdf` is `a` but for the
//! difference of its colour from the mean. No wavelength's weight exceeds [`LANES`] times the mean albedo.
//!
//! **Energy.** At a node `a` is the measured share, checked to be at most one; between nodes a linear mixture of two.
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

use std::f32::consts::FRAC_PI_2;

use glam::{Vec2, Vec3};

use super::petal_optics::{Part, PetalOptics};
use crate::bsdf::{Bsdf, BsdfSample, Lobe};
use crate::geometry::Side;
use crate::math::exp::exp;
use crate::math::frame::same_side;
use crate::micro::{REGIONS, Tissue};
use crate::spectrum::{LANES, SampledSpectrum, SampledWavelengths, Spectrum};
use crate::{Error, Result};

use component::{Angles, Component};

pub use spectral::{OpticsAtBands, measured_tissue};

/// Most classes of walks that a table may have: what is left of each is kept beside the tables of a hit.
pub const MAX_CLASSES: usize = 128;
/// Most memory of a petal's tables.
pub const MAX_BYTES: usize = 32 << 20;
/// Rounding of f32 sums over a table.
const ENERGY_TOLERANCE: f32 = 1e-3;

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
    paths_um: Vec<[f32; REGIONS]>,
    absorption_per_um: [Spectrum; REGIONS],
}

impl TabulatedBsdf {
    /// From a measured petal and the absorption of each region at pigment scale one. Errors name the field of the optics
    /// that is wrong.
    pub fn new(optics: &PetalOptics, absorption_per_um: [Spectrum; REGIONS]) -> Result<Self> {
        let surface = Component::new(&optics.surface, "surface")?;
        let interior = Component::new(&optics.interior, "interior")?;
        if surface.classes() != 1 || interior.classes() != optics.paths_um.len() {
            let what = format!(
                "{} paths for {} classes of interior light",
                optics.paths_um.len(),
                interior.classes()
            );
            return Err(Error::invalid("paths_um", what));
        }
        if let Some(l) = optics.paths_um.iter().flatten().find(|l| !(l.is_finite() && **l >= 0.0)) {
            return Err(Error::invalid("paths_um", format!("{l} um is negative or not a finite number")));
        }
        for mu in &absorption_per_um {
            if !(mu.min() >= 0.0 && mu.max().is_finite()) {
                return Err(Error::invalid("absorption", "negative or not a finite number"));
            }
        }
        let bsdf = Self { surface, interior, paths_um: optics.paths_um.clone(), absorption_per_um };
        if bsdf.bytes() > MAX_BYTES {
            let what =
                format!("its tables would take {} MiB; at most {}", bsdf.bytes() >> 20, MAX_BYTES >> 20);
            return Err(Error::invalid("optics", what));
        }
        bsdf.check_energy()?;
        Ok(bsdf)
    }

    /// From a measured petal with the pigments of a tissue of the same shape.
    pub fn of_tissue(optics: &PetalOptics, tissue: &Tissue) -> Result<Self> {
        Self::new(optics, spectral::absorption_per_um(tissue)?)
    }

    /// Between nodes the albedo is between theirs, so the nodes of both tables are all that must be checked.
    fn check_energy(&self) -> Result<()> {
        for side in [Side::Adaxial, Side::Abaxial] {
            let both = |theta: f32| {
                let of = |c: &Component| -> f32 {
                    c.incident(theta).nodes().iter().map(|&(node, w)| w * c.white_albedo(side, node)).sum()
                };
                of(&self.surface) + of(&self.interior)
            };
            for thetas in [self.surface.thetas(), self.interior.thetas()] {
                for i in 0..thetas {
                    let theta = (i as f32 + 0.5) / thetas as f32 * FRAC_PI_2;
                    let a = both(theta);
                    if a > 1.0 + ENERGY_TOLERANCE {
                        let what = format!(
                            "{a} of the light that falls on the {side:?} side at {:.1} deg would leave; at most 1 keeps the energy",
                            theta.to_degrees()
                        );
                        return Err(Error::invalid("interior", what));
                    }
                }
            }
        }
        Ok(())
    }

    /// Bytes of the tables.
    pub fn bytes(&self) -> usize {
        self.surface.bytes() + self.interior.bytes() + size_of_val(&self.paths_um[..])
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
        let mu: [SampledSpectrum; REGIONS] =
            std::array::from_fn(|r| self.absorption_per_um[r].sample(lambda) * -scale[r].max(0.0));
        let classes = at.remaining.iter_mut().zip(&mut at.mean).zip(&self.paths_um);
        for ((remaining, mean), path) in classes {
            let depth = mu.iter().zip(path).fold(SampledSpectrum::ZERO, |sum, (mu, &l)| sum + *mu * l);
            *remaining = exp(depth.0);
            *mean = SampledSpectrum(*remaining).mean();
        }
        at
    }
}

/// A [`TabulatedBsdf`] at an amount of pigment. Made for the wavelengths of a path; at others it makes itself anew.
#[derive(Clone, Copy, Debug)]
pub struct AtPigment<'a> {
    table: &'a TabulatedBsdf,
    scale: [f32; REGIONS],
    lambda: SampledWavelengths,
    /// E_k per wavelength.
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

impl AtPigment<'_> {
    fn angles(wo: Vec3, wi: Vec3) -> Angles {
        let (o, i, phi) = (polar(wo), polar(wi), between_azimuths(wo, wi));
        let (part, a, b) = match (same_side(wo, wi), wo.z > 0.0) {
            // The table is symmetric; one order makes the arithmetic so, too.
            (true, true) => (Part::Adaxial, o.min(i), o.max(i)),
            (true, false) => (Part::Abaxial, o.min(i), o.max(i)),
            (false, true) => (Part::Through, o, i),
            (false, false) => (Part::Through, i, o),
        };
        Angles { part, a, b, phi }
    }

    fn value(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        if wo.z == 0.0 || wi.z == 0.0 {
            return SampledSpectrum::ZERO;
        }
        let angles = Self::angles(wo, wi);
        let mut surface = [0.0];
        self.table.surface.add(&angles, &mut surface);
        let mut interior = [0.0; MAX_CLASSES];
        let interior = &mut interior[..self.table.interior.classes()];
        self.table.interior.add(&angles, interior);
        let mut f = [surface[0]; LANES];
        for (i, remaining) in interior.iter().zip(&self.remaining) {
            for (f, r) in f.iter_mut().zip(remaining) {
                *f += i * r;
            }
        }
        SampledSpectrum(f)
    }

    /// Share of the light from `wo` that leaves on its side and on the other, per wavelength.
    pub fn albedo(&self, wo: Vec3) -> [SampledSpectrum; 2] {
        let side = Side::of(wo);
        let theta = polar(wo);
        Way::BOTH.map(|way| {
            let mut sum = SampledSpectrum::ZERO;
            for (node, w) in self.table.surface.incident(theta).nodes() {
                sum += SampledSpectrum::splat(w * self.table.surface.albedo_at(side, way, node)[0]);
            }
            for (node, w) in self.table.interior.incident(theta).nodes() {
                for (a, r) in self.table.interior.albedo_at(side, way, node).iter().zip(self.remaining) {
                    sum += SampledSpectrum(r) * (w * a);
                }
            }
            sum
        })
    }

    /// Mean albedo over the wavelengths, all ways.
    fn mean_albedo(&self, wo: Vec3) -> f32 {
        let mut sum = 0.0;
        self.branches(wo, |weight, _| {
            sum += weight;
            false
        });
        sum
    }

    /// Calls `visit` with the weight of every part of the mixture up to the classes, until it says that it has enough.
    #[inline]
    fn branches(&self, wo: Vec3, mut visit: impl FnMut(f32, Branch) -> bool) {
        let side = Side::of(wo);
        let theta = polar(wo);
        for (is_surface, component) in [(true, &self.table.surface), (false, &self.table.interior)] {
            let [(n0, w0), (n1, w1)] = component.incident(theta).nodes();
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
        let total = self.mean_albedo(wo);
        let target = u_lobe * total;
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
        let nodes = component.incident(polar(wo)).nodes();
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

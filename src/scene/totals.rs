//! Totals of materials: how much of the light that falls on a sheet it sends back, and how much it lets through.
//!
//! Model: directional-hemispherical reflectance and transmittance of each side, and their means in diffuse light:
//!
//! ```text
//! R(theta, side, lambda) = integral over the side's hemisphere of f(wo, wi) cos(theta_o) dwo,   wi at theta
//! T(theta, side, lambda) = the same over the other hemisphere
//! mean R = 2 integral from 0 to 1 of R cos(theta) dcos(theta)
//! ```
//!
//! | material | how | error |
//! |---|---|---|
//! | Lambert, diffuse | constants | none |
//! | Phong, transmission lobes | [`lobe_albedo`] | 1e-3, linear between 33 cosines |
//! | literal Phong | [`lobe_solid_angle_sr`] | same |
//! | tabulated petal | [`AtPigment::albedo`](crate::gonio::AtPigment::albedo) at 33 factors of its pigment, or 25 x 25 where its sides differ, linear between | 1 % of R; 2 % |
//! | petal of cells | the parts above in closed form; what its domes send back is measured by walks | [`MaterialTotals::standard_error`] |
//!
//! Walks: 2048 per incidence and eight wavelengths, at 16 cosines, all azimuths together, the same random numbers at
//! every wavelength; never more than the domes' surface reflects at once. Below half a second for 32 wavelengths.
//!
//! The textbook's Phong is not reciprocal, and light at grazing incidence comes back from it without bound; its total here
//! is that of the other way, what a viewer gets from white surroundings. Their hemispherical means are the same.
//!
//! R + T > 1 beyond rounding is an error that names the material and the wavelength.
//! Guarded by `totals_are_the_integrals`, `totals_of_cells_are_what_they_scatter`, `totals_follow_the_pigment`, `totals_follow_both_sides`, `totals_follow_the_tissues_of_a_place`,
//! `more_light_than_arrives_is_an_error`. Source: Nicodemus et al., NBS Monograph 160, 1977, for the terms; the tables are
//! our reading.

mod pigment;

use std::sync::Arc;

use glam::{UVec2, Vec3};
use rayon::prelude::*;

use super::compile::Scene;
use super::material::Material;
use super::pattern::{PigmentFactors, TissueState};
use super::tabulated::Petal;
use crate::bsdf::lobe_albedo::{lobe_albedo, lobe_solid_angle_sr};
use crate::geometry::Side;
use crate::gonio::AtPigment;
use crate::math::Sampler;
use crate::micro::shading::CellPetal;
use crate::spectrum::{LANES, SampledSpectrum, SampledWavelengths};
use crate::{Error, Result};
use pigment::Variation;

/// Intervals of the cosine.
const STEPS: usize = 32;
/// Cosines of the tables, 0 to 1.
pub const COSINES: usize = STEPS + 1;
/// Cosines at which domes are measured, in the middle of equal intervals.
const MEASURED: usize = 16;
/// Walks per measured cosine.
const WALKS: u32 = 2048;
/// Shares that sum to one in decimal may exceed it by this in f32.
const ROUNDING: f32 = 1e-4;

/// Reflected and transmitted share.
type Shares = [SampledSpectrum; 2];

/// Totals of one material at fixed wavelengths, eight ([`LANES`]) at a time: a chunk.
#[derive(Clone, Debug)]
pub struct MaterialTotals {
    /// `[chunk][tissue][factor][side][cosine]`.
    directional: Vec<Shares>,
    /// `[chunk][tissue][factor][side]`.
    means: Vec<Shares>,
    /// What chooses among the tables of each tissue of [`TissueState::shares`]; nodes are none where there is no such tissue.
    tissues: [Option<Variation>; 3],
    standard_error: f32,
}

fn cosine(node: usize) -> f32 {
    node as f32 / STEPS as f32
}

/// Integral of a function that is linear between the cosines, times `2 cos`.
fn mean(values: &[Shares]) -> Shares {
    let h = 1.0 / STEPS as f64;
    let weight = |node: usize| match node {
        0 => h * h / 3.0,
        STEPS => h - h * h / 3.0,
        _ => 2.0 * h * h * node as f64,
    };
    [0, 1].map(|way| {
        SampledSpectrum::from_fn(|lane| {
            let terms = values.iter().enumerate().map(|(node, v)| weight(node) * f64::from(v[way][lane]));
            terms.sum::<f64>() as f32
        })
    })
}

fn mix(a: Shares, b: Shares, t: f32) -> Shares {
    [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t]
}

/// The cosine's interval and how far it is in it, 0 to 1.
fn place(cos: f32) -> (usize, f32) {
    let x = cos.abs().min(1.0) * STEPS as f32;
    let node = (x as usize).min(STEPS - 1);
    (node, x - node as f32)
}

/// Adds light that falls at a cosine to what there is at the cosines of the tables, for [`MaterialTotals::of_light`].
pub fn spread(weights: &mut [f32; COSINES], cos: f32, light: f32) {
    let (node, t) = place(cos);
    weights[node] += light * (1.0 - t);
    weights[node + 1] += light * t;
}

impl MaterialTotals {
    /// Totals of `material` at these wavelengths. `key` names it in errors.
    pub fn new(key: &str, material: &Material, wavelengths: &[SampledWavelengths]) -> Result<Self> {
        let tissues = Variation::of_tissues(material);
        let nodes: Vec<(usize, PigmentFactors)> = tissues
            .iter()
            .enumerate()
            .filter_map(|(k, v)| Some((k, v.as_ref()?)))
            .flat_map(|(k, v)| (0..v.nodes()).map(move |node| (k, v.factors(node))))
            .collect();
        let mut standard_error = 0.0f32;
        let mut directional = Vec::with_capacity(wavelengths.len() * nodes.len() * 2 * COSINES);
        let domes = match material {
            Material::Petal(petal) => match &**petal {
                Petal::Cells(cells) => Domes::measure(cells, wavelengths),
                Petal::Tabulated(_) => Vec::new(),
            },
            _ => Vec::new(),
        };
        for (chunk, lambda) in wavelengths.iter().enumerate() {
            for (tissue, factors) in &nodes {
                let coloured = match material {
                    Material::Petal(petal) => match &**petal {
                        Petal::Tabulated(petal) => Some(petal.tissue(*tissue, *factors, lambda)),
                        Petal::Cells(_) => None,
                    },
                    _ => None,
                };
                for side in [Side::Adaxial, Side::Abaxial] {
                    for node in 0..=STEPS {
                        let cos = cosine(node);
                        let shares = match material {
                            Material::Lambert(m) => {
                                [m.reflectance(side).sample(lambda), SampledSpectrum::ZERO]
                            }
                            Material::Phong(m) => {
                                let lobe = m.specular().sample(lambda) * lobe_albedo(m.exponent(), cos);
                                [m.diffuse().sample(lambda) + lobe, SampledSpectrum::ZERO]
                            }
                            Material::LiteralPhong(m) => {
                                let lobe =
                                    m.specular().sample(lambda) * lobe_solid_angle_sr(m.exponent(), cos);
                                [m.diffuse().sample(lambda) + lobe, SampledSpectrum::ZERO]
                            }
                            Material::Diffuse(m) => {
                                [m.reflectance(side).sample(lambda), m.transmittance().sample(lambda)]
                            }
                            Material::Petal(petal) => match &**petal {
                                Petal::Cells(cells) => {
                                    let [mut r, t] = cells.albedo_without_domes(side, cos, lambda);
                                    if side == Side::Adaxial {
                                        r += domes[chunk].at(cos);
                                    }
                                    [r, t]
                                }
                                Petal::Tabulated(_) => coloured
                                    .as_ref()
                                    .map_or([SampledSpectrum::ZERO; 2], |c| tabulated(c, side, cos)),
                            },
                        };
                        check(key, (side, cos), shares, lambda)?;
                        directional.push(shares);
                    }
                }
            }
        }
        for d in &domes {
            standard_error = standard_error.max(d.standard_error);
        }
        let means = directional.chunks(COSINES).map(mean).collect();
        Ok(Self { directional, means, tissues, standard_error })
    }

    /// Totals of every material of a scene, by its id; nothing for those that no shape is made of.
    pub fn of_scene(scene: &Scene, wavelengths: &[SampledWavelengths]) -> Result<Vec<Self>> {
        let mut all: Vec<Self> = Vec::with_capacity(scene.materials.len());
        for (id, material) in scene.materials.iter().enumerate() {
            let same = scene.materials[..id].iter().position(|other| match (other, material) {
                (Material::Petal(a), Material::Petal(b)) => Arc::ptr_eq(a, b),
                _ => false,
            });
            let used = |id: usize| scene.shapes.iter().any(|s| s.material as usize == id);
            let totals = match same {
                _ if !used(id) => Self::nothing(wavelengths.len()),
                Some(first) if used(first) => all[first].clone(),
                _ => Self::new(&scene.material_keys[id], material, wavelengths)?,
            };
            all.push(totals);
        }
        Ok(all)
    }

    /// Black.
    fn nothing(chunks: usize) -> Self {
        let black = [SampledSpectrum::ZERO; 2];
        let directional = vec![black; chunks * 2 * COSINES];
        Self {
            directional,
            means: vec![black; chunks * 2],
            tissues: [Some(Variation::None(PigmentFactors::ONE)), None, None],
            standard_error: 0.0,
        }
    }

    /// Reflected and transmitted share of light that falls on `side` at the cosine `cos` from the normal, where the
    /// tissue is in a state, at the wavelengths of a chunk.
    pub fn at(
        &self,
        state: TissueState,
        cos: f32,
        side: Side,
        chunk: usize,
    ) -> (SampledSpectrum, SampledSpectrum) {
        let (node, t) = place(cos);
        let at = |row: usize| {
            let first = self.row(chunk, row, side) * COSINES + node;
            mix(self.directional[first], self.directional[first + 1], t)
        };
        let [r, t] = self.in_state(state, at);
        (r, t)
    }

    /// The same for much light at once: `weights[k]` of it at the k-th of the tables' cosines ([`spread`]).
    pub fn of_light(
        &self,
        state: TissueState,
        weights: &[f32; COSINES],
        side: Side,
        chunk: usize,
    ) -> (SampledSpectrum, SampledSpectrum) {
        let at = |row: usize| {
            let first = self.row(chunk, row, side) * COSINES;
            let mut sum = [SampledSpectrum::ZERO; 2];
            for (shares, w) in self.directional[first..first + COSINES].iter().zip(weights) {
                if *w != 0.0 {
                    sum[0] += shares[0] * *w;
                    sum[1] += shares[1] * *w;
                }
            }
            sum
        };
        let [r, t] = self.in_state(state, at);
        (r, t)
    }

    /// The same for light from everywhere on that side.
    pub fn mean(&self, state: TissueState, side: Side, chunk: usize) -> (SampledSpectrum, SampledSpectrum) {
        let [r, t] = self.in_state(state, |row| self.means[self.row(chunk, row, side)]);
        (r, t)
    }

    /// The mean over the tissues by their shares; each between the nodes of its pigments.
    fn in_state(&self, state: TissueState, at: impl Fn(usize) -> Shares) -> Shares {
        let mut sum = [SampledSpectrum::ZERO; 2];
        let mut base = 0;
        for (variation, share) in self.tissues.iter().zip(state.shares()) {
            let Some(variation) = variation else { continue };
            if share > 0.0 {
                let [up, down] = variation.place(state.pigment);
                let row = |first: usize| match down.step {
                    0 => at(base + first),
                    step => mix(at(base + first), at(base + first + step), down.weight),
                };
                let [r, t] = match (up.node + down.node, up.step) {
                    (first, 0) => row(first),
                    (first, step) => mix(row(first), row(first + step), up.weight),
                };
                sum = [sum[0] + r * share, sum[1] + t * share];
            }
            base += variation.nodes();
        }
        sum
    }

    fn row(&self, chunk: usize, row: usize, side: Side) -> usize {
        let rows: usize = self.tissues.iter().flatten().map(Variation::nodes).sum();
        (chunk * rows + row) * 2 + side as usize
    }

    /// Largest standard error of a measured share; zero where nothing was measured.
    pub fn standard_error(&self) -> f32 {
        self.standard_error
    }
}

fn tabulated(petal: &AtPigment, side: Side, cos: f32) -> Shares {
    let up = if side == Side::Adaxial { 1.0 } else { -1.0 };
    // A hair above the surface, whose own directions belong to no side.
    let cos = cos.max(1e-4);
    petal.albedo(Vec3::new((1.0 - cos * cos).sqrt(), 0.0, up * cos))
}

fn check(key: &str, (side, cos): (Side, f32), [r, t]: Shares, lambda: &SampledWavelengths) -> Result<()> {
    let sum = r + t;
    match (0..LANES).find(|&lane| !(0.0..=1.0 + ROUNDING).contains(&sum[lane])) {
        None => Ok(()),
        Some(lane) => {
            let side = if side == Side::Adaxial { "adaxial" } else { "abaxial" };
            Err(Error::invalid(
                key,
                format!(
                    "reflectance + transmittance is {} at {} nm for light on the {side} side at {:.0} deg; \
                     at most 1 keeps the energy",
                    sum[lane],
                    lambda.lambda_nm()[lane],
                    cos.acos().to_degrees()
                ),
            ))
        }
    }
}

/// What the domes of a petal send back, to any order.
struct Domes {
    reflected: [SampledSpectrum; MEASURED],
    standard_error: f32,
}

impl Domes {
    /// One for each chunk.
    fn measure(petal: &CellPetal, wavelengths: &[SampledWavelengths]) -> Vec<Self> {
        let jobs: Vec<(&SampledWavelengths, u32)> =
            wavelengths.iter().flat_map(|l| (0..MEASURED as u32).map(move |i| (l, i))).collect();
        let measured: Vec<(SampledSpectrum, f32)> =
            jobs.into_par_iter().map(|(lambda, i)| Self::measure_at(petal, lambda, i)).collect();
        measured
            .chunks(MEASURED)
            .map(|at| Self {
                reflected: std::array::from_fn(|i| at[i].0),
                standard_error: at.iter().map(|m| m.1).fold(0.0, f32::max),
            })
            .collect()
    }

    /// Mean and largest standard error.
    fn measure_at(petal: &CellPetal, lambda: &SampledWavelengths, i: u32) -> (SampledSpectrum, f32) {
        let bound = petal.domes_bound(lambda);
        let mut sums = [[0.0f64; LANES]; 2];
        for walk in 0..if bound.is_zero() { 0 } else { WALKS } {
            // The same walks at all wavelengths, so that errors have no colour of their own.
            let mut sampler = Sampler::new(0x70_7a15, UVec2::new(i, 0), walk);
            let u = sampler.next_2d();
            let cos = (i as f32 + u.x) / MEASURED as f32;
            let sin = (1.0 - cos * cos).max(0.0).sqrt();
            let (y, x) = (std::f32::consts::TAU * u.y).sin_cos();
            let wi = Vec3::new(sin * x, sin * y, cos.max(1e-4));
            let Some((_, weight)) = petal.scatter_domes(wi, lambda, &mut sampler) else { continue };
            for lane in 0..LANES {
                let w = f64::from(weight[lane]);
                sums[0][lane] += w;
                sums[1][lane] += w * w;
            }
        }
        let n = f64::from(WALKS);
        let mean = SampledSpectrum::from_fn(|lane| ((sums[0][lane] / n) as f32).min(bound[lane]));
        let variance = |lane: usize| (sums[1][lane] / n - (sums[0][lane] / n).powi(2)).max(0.0) / n;
        let error = (0..LANES).map(|lane| variance(lane).sqrt() as f32).fold(0.0, f32::max);
        (mean, error)
    }

    /// Linear between the middles of the intervals, held beyond.
    fn at(&self, cos: f32) -> SampledSpectrum {
        let x = (cos * MEASURED as f32 - 0.5).clamp(0.0, (MEASURED - 1) as f32);
        let i = (x as usize).min(MEASURED - 2);
        self.reflected[i] + (self.reflected[i + 1] - self.reflected[i]) * (x - i as f32)
    }
}

#[cfg(test)]
mod tests;

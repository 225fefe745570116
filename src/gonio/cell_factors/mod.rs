//! The geometric factors of the domes' shading: f_E for every coefficient and exponent, without tracing rays again.
//!
//! Model: [`CellPetal`](crate::micro::shading::CellPetal) gives the light of the domes as a sum over reflections
//! between them. Its coefficients kd and ks enter as a polynomial ([`polynomial`]); what multiplies them depends on the
//! directions and the exponent only. [`CellFactors::compute`] finds these factors once per shape of cells, at the nodes
//! of [`angles`], by walks that share their rays ([`walk`]); [`CellFactors::factors`] interpolates them. The tables hold
//! f_E cos(theta_max), which stays smooth towards grazing.
//!
//! ```text
//! f_E(wo, wi; kd, ks, n) = sum over orders of  kd^(m-j) ks^j G_mj(wo, wi; n)
//! ```
//!
//! Averaged over the lattice's azimuth, which a laboratory does not know, and over both senses of the azimuth; so
//! isotropic and reciprocal, exactly (`reciprocal_to_the_bit`).
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | points per viewing angle | `points` | | 65 536 |
//! | nodes | `nodes` | | 15 x 10 x 15 |
//! | seed | `seed` | | 0 |
//!
//! Scale-free: only the ratio of height to pitch, the profile and the disorder matter (`scale_does_not_matter`). One
//! table is 246 numbers per pair of nodes and their errors, 2.4 MB by default; computing it holds about 20 MB more.
//!
//! Limits: noise and interpolation are estimated and kept with the table ([`CellFactors::standard_error`],
//! [`CellFactors::interpolation_error`]); against direct estimates: `agrees_with_the_petal`; energy:
//! `albedo_is_the_goniophotometers`; on a flat surface exact: `flat_cells_are_closed_forms`. Low domes
//! (height below a quarter of the pitch) with n > 50 have lobes narrower than the nodes; their interpolation error says
//! so (`interpolation_error_warns`). Source: our reading.

pub mod angles;
pub mod polynomial;
mod walk;

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use angles::AngleNodes;
pub use polynomial::{Domes, EXPONENTS, Factors};

use super::goniophotometer::Progress;
use crate::micro::{CellDescription, CellField};
use crate::{Error, Result};
use polynomial::{CONSTANTS, FUNCTIONS, NUMBERS, cubic_form};
use walk::{FIRST, PER_ORDER, SUMS, Sums, View, Walker};

/// Independent repetitions that the errors come from.
const REPLICATES: u32 = 8;
/// Viewing angles between the nodes at which the interpolation is checked.
const CHECKS: usize = 3;
/// Errors kept per pair: of the Lambertian light and of the lobe at each rung, relative.
const ERRORS: usize = 1 + EXPONENTS;

/// How a table is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FactorSettings {
    /// Points of the petal per viewing angle, 64 to 2^24.
    pub points: u32,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Nodes of the angles.
    pub nodes: AngleNodes,
}

impl Default for FactorSettings {
    fn default() -> Self {
        Self { points: 1 << 16, seed: 0, nodes: AngleNodes::default() }
    }
}

impl FactorSettings {
    /// Checks the ranges.
    pub fn validate(&self) -> Result<()> {
        if !(64..=1 << 24).contains(&self.points) {
            return Err(Error::invalid("factors.points", format!("{} is not within 64 to 2^24", self.points)));
        }
        self.nodes.validate()
    }
}

/// What the interpolation between the nodes adds, relative, as a root mean square over pairs half way between nodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InterpolationError {
    /// Of the light of Lambertian domes, kd = 0.5.
    pub diffuse: f64,
    /// Of the lobe's light, ks = 0.5, at each rung of the exponents.
    pub specular: Vec<f64>,
}

/// The table of one shape of cells.
#[derive(Clone, Debug, PartialEq)]
pub struct CellFactors {
    cells: CellDescription,
    settings: FactorSettings,
    /// Ratio of the series that the orders from five on are taken for.
    tail_ratio: f64,
    interpolation: InterpolationError,
    /// [`NUMBERS`] per pair.
    numbers: Vec<f32>,
    /// [`ERRORS`] per pair.
    errors: Vec<f32>,
}

impl CellFactors {
    /// Walks among the cells. Depends on the arguments only, not on the number of threads. `progress` hears of points.
    pub fn compute(cells: &CellDescription, settings: &FactorSettings, progress: Progress) -> Result<Self> {
        settings.validate()?;
        let field = CellField::new(cells)?;
        let walker = Walker::new(&field);
        let nodes = &settings.nodes;
        let mut views: Vec<View> = (0..nodes.thetas)
            .map(|i| view(nodes, i as f64, 0..nodes.ratios, 0..nodes.azimuths, 0.0))
            .collect();
        views.extend((1..=CHECKS).map(|c| {
            let i = (c * (nodes.thetas - 2) / CHECKS) as f64 + 0.5;
            view(nodes, i, 0..nodes.ratios - 1, 0..nodes.azimuths - 1, 0.5)
        }));
        let per_task = settings.points.div_ceil(REPLICATES);
        let tasks = views.len() as u64 * u64::from(REPLICATES);
        let (done, cancelled) = (AtomicU64::new(0), AtomicBool::new(false));
        let sums: Vec<Option<Sums>> = (0..tasks)
            .into_par_iter()
            .map(|task| {
                if cancelled.load(Ordering::Relaxed) {
                    return None;
                }
                let (v, r) = (task as usize / REPLICATES as usize, task as u32 % REPLICATES);
                let sums = walker.trace(&views[v], settings.seed, r, per_task);
                let points = u64::from(per_task) * (done.fetch_add(1, Ordering::Relaxed) + 1);
                if progress(points, u64::from(per_task) * tasks) == ControlFlow::Break(()) {
                    cancelled.store(true, Ordering::Relaxed);
                }
                Some(sums)
            })
            .collect();
        let sums: Vec<Sums> = sums.into_iter().collect::<Option<_>>().ok_or(Error::Cancelled)?;
        let tail = sums.iter().fold([0.0, 0.0], |a, s| [a[0] + s.tail[0], a[1] + s.tail[1]]);
        let tail_ratio = if tail[1] > 0.0 { (1.0 - tail[0] / tail[1]).clamp(0.0, 0.98) } else { 0.0 };
        let mut table = Self {
            cells: cells.clone(),
            settings: *settings,
            tail_ratio,
            interpolation: InterpolationError { diffuse: 0.0, specular: vec![0.0; EXPONENTS] },
            numbers: Vec::with_capacity(nodes.pairs() * NUMBERS),
            errors: Vec::with_capacity(nodes.pairs() * ERRORS),
        };
        for (view, replicates) in views.iter().zip(sums.chunks_exact(REPLICATES as usize)) {
            if table.errors.len() < nodes.pairs() * ERRORS {
                table.push(view, replicates);
            }
        }
        let checks = sums.chunks_exact(REPLICATES as usize).skip(nodes.thetas);
        table.interpolation = table.check(views.iter().skip(nodes.thetas).zip(checks));
        Ok(table)
    }

    /// The cells that the table is of.
    pub fn cells(&self) -> &CellDescription {
        &self.cells
    }

    /// How it was computed.
    pub fn settings(&self) -> &FactorSettings {
        &self.settings
    }

    /// Ratio of the series that the orders from five on are taken for.
    pub fn tail_ratio(&self) -> f64 {
        self.tail_ratio
    }

    /// What the interpolation between the nodes adds.
    pub fn interpolation_error(&self) -> &InterpolationError {
        &self.interpolation
    }

    /// The factors for a weighted mean over pairs of directions, all above the surface.
    pub fn factors(&self, pairs: &[(DVec3, DVec3, f64)]) -> Factors {
        let mut numbers = [0.0; NUMBERS];
        let mut flat = Vec::new();
        for &(wi, wo, weight) in pairs {
            let before = numbers[1];
            let stencil = self.settings.nodes.stencil(wi, wo);
            for (index, w) in stencil.nodes {
                let w = w * weight / stencil.cos_max;
                let node = &self.numbers[index * NUMBERS..][..NUMBERS];
                numbers.iter_mut().zip(node).for_each(|(n, &v)| *n += w * f64::from(v));
            }
            let base = numbers[1] - before;
            if base > 0.0 {
                flat.push((base, cos_alpha(wi, wo)));
            }
        }
        Factors::new(&numbers, flat, self.tail_ratio)
    }

    /// One standard deviation of [`Factors::eval`] for a pair of directions by the noise of the walks, 1/sr.
    pub fn standard_error(&self, wi: DVec3, wo: DVec3, kd: f64, ks: f64, n: f64) -> f64 {
        let factors = self.factors(&[(wi, wo, 1.0)]);
        let (all, diffuse) = (factors.eval(kd, ks, n).f, factors.eval(kd, 0.0, n).f);
        let k = ((2.0 * n.max(1.0).log2()).round() as usize).min(EXPONENTS - 1);
        let (mut e_d, mut e_s) = (0.0, 0.0);
        for (index, w) in self.settings.nodes.stencil(wi, wo).nodes {
            let e = &self.errors[index * ERRORS..][..ERRORS];
            e_d += w.abs() * f64::from(e[0]);
            e_s += w.abs() * f64::from(e[1 + k]);
        }
        diffuse * e_d + (all - diffuse).abs() * e_s
    }

    /// Relative standard error by noise, a root mean square over the table: of Lambertian light, and of the lobe's at
    /// each rung of the exponents.
    pub fn noise(&self) -> [f64; ERRORS] {
        let pairs = self.errors.len() / ERRORS;
        std::array::from_fn(|k| {
            let sum: f64 = self.errors.iter().skip(k).step_by(ERRORS).map(|&e| f64::from(e).powi(2)).sum();
            (sum / pairs.max(1) as f64).sqrt()
        })
    }

    /// Adds the pairs of one viewing angle.
    fn push(&mut self, view: &View, replicates: &[Sums]) {
        for lamp in 0..view.lamps.len() * view.azimuths.len() {
            let parts: Vec<[f64; NUMBERS]> = replicates
                .iter()
                .map(|r| numbers(&r.means[lamp * SUMS..][..SUMS], view.theta.cos()))
                .collect();
            self.numbers.extend(mean(&parts).map(|v| v as f32));
            let n = parts.len() as f64;
            let values: Vec<[f64; ERRORS]> = parts.iter().map(|p| self.references(p)).collect();
            for k in 0..ERRORS {
                let mean = values.iter().map(|v| v[k]).sum::<f64>() / n;
                let square = values.iter().map(|v| (v[k] - mean).powi(2)).sum::<f64>() / (n * (n - 1.0));
                self.errors.push(if mean > 0.0 { (square.sqrt() / mean) as f32 } else { 0.0 });
            }
        }
    }

    /// f_E cos at kd = 0.5, and at ks = 0.5 for each rung, without the flat part, which has no noise of its own.
    fn references(&self, numbers: &[f64; NUMBERS]) -> [f64; ERRORS] {
        let factors = Factors::new(numbers, Vec::new(), self.tail_ratio);
        let mut out = [0.0; ERRORS];
        out[0] = factors.eval(0.5, 0.0, 1.0).f;
        for k in 0..EXPONENTS {
            out[1 + k] = factors.eval(0.0, 0.5, polynomial::exponent(k)).f;
        }
        out
    }

    /// Compares the table with walks between its nodes that used the same random numbers.
    fn check<'a>(&self, views: impl Iterator<Item = (&'a View, &'a [Sums])>) -> InterpolationError {
        let (mut squares, mut values) = ([0.0; ERRORS], [0.0; ERRORS]);
        for (view, replicates) in views {
            for (a, azimuth) in view.azimuths.iter().enumerate() {
                for (l, lamp) in view.lamps.iter().enumerate() {
                    let at = (a * view.lamps.len() + l) * SUMS;
                    let parts: Vec<_> =
                        replicates.iter().map(|r| numbers(&r.means[at..][..SUMS], view.theta.cos())).collect();
                    let direct = self.references(&mean(&parts));
                    let wo = DVec3::new(view.theta.sin(), 0.0, view.theta.cos());
                    let wi =
                        DVec3::new(lamp.sin() * azimuth.cos(), lamp.sin() * azimuth.sin(), lamp.cos());
                    let mut interpolated = [0.0; NUMBERS];
                    for (index, w) in self.settings.nodes.stencil(wi, wo).nodes {
                        let node = &self.numbers[index * NUMBERS..][..NUMBERS];
                        interpolated.iter_mut().zip(node).for_each(|(n, &v)| *n += w * f64::from(v));
                    }
                    for (k, (d, i)) in direct.iter().zip(self.references(&interpolated)).enumerate() {
                        squares[k] += (d - i).powi(2);
                        values[k] += d * d;
                    }
                }
            }
        }
        let root = |k: usize| if values[k] > 0.0 { f64::sqrt(squares[k] / values[k]) } else { 0.0 };
        InterpolationError { diffuse: root(0), specular: (1..ERRORS).map(root).collect() }
    }
}

/// The viewing angle at `i` and lamps at the nodes' places plus `shift`.
fn view(
    nodes: &AngleNodes,
    i: f64,
    ratios: std::ops::Range<usize>,
    azimuths: std::ops::Range<usize>,
    shift: f64,
) -> View {
    let theta = nodes.theta(i);
    View {
        theta,
        lamps: ratios.map(|j| theta * nodes.ratio(j as f64 + shift)).collect(),
        azimuths: azimuths.map(|k| nodes.azimuth(k as f64 + shift)).collect(),
    }
}

fn mean(parts: &[[f64; NUMBERS]]) -> [f64; NUMBERS] {
    std::array::from_fn(|k| parts.iter().map(|p| p[k]).sum::<f64>() / parts.len().max(1) as f64)
}

/// Cosine between the mirror direction of one and the other at a flat surface.
fn cos_alpha(wi: DVec3, wo: DVec3) -> f64 {
    let chord = DVec3::new(-wi.x, -wi.y, wi.z) - wo;
    (1.0 - 0.5 * chord.length_squared()).max(0.0)
}

/// A walk's sums at one pair, times the cosine of the view, as coefficients.
fn numbers(sums: &[f32], cos: f64) -> [f64; NUMBERS] {
    let value = |at: usize| f64::from(sums[at]) * cos;
    let order = |m: usize, share: usize, k: usize| {
        let first = FIRST + (m - 2) * PER_ORDER;
        if share == 0 { value(first) } else { value(first + 1 + (share - 1) * EXPONENTS + k) }
    };
    let mut out = [0.0; NUMBERS];
    (out[0], out[1], out[2]) = (value(0), value(1), order(2, 0, 0));
    for m in 3..6 {
        out[m] = order(m, 0, 0);
    }
    for k in 0..EXPONENTS {
        let mut set = |function: usize, v: f64| out[CONSTANTS + function * EXPONENTS + k] = v;
        set(0, value(2 + k));
        let [dd, half, ss] = [order(2, 0, k), order(2, 2, k), order(2, 3, k)];
        set(1, 4.0 * half - dd - ss);
        set(2, ss);
        for m in 3..6 {
            let form = cubic_form(std::array::from_fn(|share| order(m, share, k)));
            for j in 1..4 {
                set(3 * m - 7 + j, form[j]);
            }
        }
    }
    debug_assert_eq!(3 + 9, FUNCTIONS);
    out
}

#[cfg(test)]
mod scratch {
    use super::*;

    #[test]
    fn measure_scratch() {
        let points: u32 = std::env::var("PTS").map(|v| v.parse().unwrap()).unwrap_or(4096);
        let start = std::time::Instant::now();
        let t = CellFactors::compute(
            &CellDescription { ..Default::default() },
            &FactorSettings { points, ..Default::default() },
            &|_, _| ControlFlow::Continue(()),
        )
        .unwrap();
        println!("{:?} r {}", start.elapsed(), t.tail_ratio);
        println!("noise {:.4?}", t.noise());
        println!("interpolation {:.4} {:.4?}", t.interpolation.diffuse, t.interpolation.specular);
        let w = |t: f64, p: f64| crate::gonio::measurement::direction_deg(t, p);
        for (a, b, p) in [(30.0, 30.0, 0.0), (60.0, 60.0, 0.0), (60.0, 60.0, 180.0), (60.0, 20.0, 90.0), (80.0, 75.0, 10.0)] {
            let f = t.factors(&[(w(a, 0.0), w(b, p), 1.0)]);
            println!("{a} {b} {p}: D {:.4?} S16 {:.4?} S181 {:.4?}", f.eval(0.5, 0.0, 1.0).f, f.eval(0.0, 0.5, 16.0).f, f.eval(0.0, 0.5, 181.0).f);
        }
    }
}

//! The geometric factors of the domes' shading: f_E for every coefficient and exponent, without tracing rays again.
//!
//! Model: [`CellPetal`](crate::micro::shading::CellPetal) gives the light of the domes as a sum over reflections
//! between them. Its coefficients kd and ks enter as a polynomial ([`polynomial`]); what multiplies them depends on the
//! directions and the exponent only. [`CellFactors::compute`] finds these factors once per shape of cells, at the nodes
//! of [`angles`], by walks that share their rays; [`CellFactors::factors`] interpolates them. The
//! first order and the later ones have tables of their own.
//!
//! ```text
//! f_E(wo, wi; kd, ks, n) = sum over orders m of  kd^(m-j) ks^j G_mj(wo, wi; n)
//! ```
//!
//! Averaged over the lattice's azimuth, which a laboratory does not know, and over both senses of the azimuth; so
//! isotropic and reciprocal (`reciprocal_to_the_bit`).
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | points per viewing angle | `points` | | 16 384 |
//! | points by their normal, per pair of nodes | `facets` | | 256 |
//! | nodes of order one: larger angle x ratio x azimuth | `first` | | 30 x 16 x 25 |
//! | nodes of the later orders | `later` | | 10 x 7 x 9 |
//! | seed | `seed` | | 0 |
//!
//! Scale-free: only the ratio of height to pitch, the profile and the disorder matter (`scale_does_not_matter`).
//!
//! Limits: noise and interpolation are estimated and kept with the table ([`CellFactors::standard_error`],
//! [`CellFactors::relative_noise`], [`CellFactors::interpolation_error`]; `noise_is_what_it_says`); against direct estimates: `agrees_with_the_petal`; energy:
//! `albedo_is_the_goniophotometers`; a flat surface is exact: `flat_cells_are_closed_forms`. Low domes (height below a
//! quarter of the pitch) with n > 50 have lobes narrower than the nodes, and their interpolation error says so
//! (`interpolation_error_warns`). Source: our reading.

pub mod angles;
pub mod polynomial;
mod facets;
mod file;
mod table;
mod walk;

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use angles::AngleNodes;
pub use polynomial::{Domes, EXPONENTS, Factors};

use super::goniophotometer::Progress;
use super::measurement::direction_deg;
use crate::micro::{CellDescription, CellField};
use crate::{Error, Result};
use polynomial::{FIRST, LATER};
use table::{ERRORS, Table};
use walk::{Part, Sums, View, Walker};

/// Independent repetitions that the errors come from.
const REPLICATES: usize = 8;
/// Viewing angles between the nodes at which the interpolation is checked.
const CHECKS: usize = 3;

/// How a table is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FactorSettings {
    /// Points of the petal per viewing angle, 64 to 2^24.
    pub points: u32,
    /// Points found by their normal, for each pair of nodes of order one: what sharp lobes need. 0 to 2^16.
    pub facets: u32,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Nodes of the light that was reflected once.
    pub first: AngleNodes,
    /// Nodes of the light that was reflected more often: smoother and weaker.
    pub later: AngleNodes,
}

impl Default for FactorSettings {
    fn default() -> Self {
        Self {
            points: 1 << 14,
            facets: 256,
            seed: 0,
            first: AngleNodes { thetas: 30, ratios: 16, azimuths: 25 },
            later: AngleNodes { thetas: 10, ratios: 7, azimuths: 9 },
        }
    }
}

impl FactorSettings {
    /// Checks the ranges.
    pub fn validate(&self) -> Result<()> {
        if !(64..=1 << 24).contains(&self.points) {
            return Err(Error::invalid(
                "factors.points",
                format!("{} is not within 64 to 2^24", self.points),
            ));
        }
        if self.facets > 1 << 16 {
            return Err(Error::invalid("factors.facets", format!("{} is not within 0 to 2^16", self.facets)));
        }
        self.first.validate("factors.first")?;
        self.later.validate("factors.later")
    }
}

/// What the interpolation between the nodes adds, as a root mean square over pairs half way between nodes, relative to
/// that of the values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InterpolationError {
    /// Of the light of Lambertian domes, kd = 0.5.
    pub diffuse: f64,
    /// Of the lobe's light, ks = 0.5, at each rung of the exponents.
    pub specular: Vec<f64>,
}

/// The tables of one shape of cells.
#[derive(Clone, Debug, PartialEq)]
pub struct CellFactors {
    cells: CellDescription,
    settings: FactorSettings,
    /// Ratio of the series that the orders from five on are taken for.
    tail_ratio: f64,
    interpolation: InterpolationError,
    first: Table<FIRST>,
    later: Table<LATER>,
}

impl CellFactors {
    /// Walks among the cells. Depends on the arguments only, not on the number of threads. `progress` hears of points.
    pub fn compute(cells: &CellDescription, settings: &FactorSettings, progress: Progress) -> Result<Self> {
        settings.validate()?;
        let field = CellField::new(cells)?;
        let views = views(settings);
        let sums = trace(&Walker::new(&field), &views, settings, progress)?;
        let tail_ratio = (1.0 - 1.0 / table::tail(&sums)).clamp(0.0, 0.98);
        let mut replicates = views.iter().zip(sums.chunks_exact(REPLICATES));
        let (mut first, mut later) = (Table::new(settings.first), Table::new(settings.later));
        for (view, sums) in replicates.by_ref().take(settings.first.thetas) {
            first.push(view, sums, |first| {
                table::references(&Factors::new(first, &[0.0; LATER], Vec::new(), tail_ratio))
            });
        }
        for (view, sums) in replicates.by_ref().take(settings.later.thetas) {
            later.push(view, sums, |later| {
                table::later_references(&Factors::new(&[0.0; FIRST], later, Vec::new(), tail_ratio))
            });
        }
        let interpolation = InterpolationError { diffuse: 0.0, specular: Vec::new() };
        let mut table =
            Self { cells: cells.clone(), settings: *settings, tail_ratio, interpolation, first, later };
        let checks: Vec<_> = replicates.collect();
        table.interpolation = table.check(&checks);
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
        let (mut first, mut later) = ([0.0; FIRST], [0.0; LATER]);
        let mut flat = Vec::new();
        for &(wi, wo, weight) in pairs {
            let before = first[1];
            self.first.add(wi, wo, weight, &mut first);
            self.later.add(wi, wo, weight, &mut later);
            let base = first[1] - before;
            if base > 0.0 {
                flat.push((base, cos_alpha(wi, wo)));
            }
        }
        Factors::new(&first, &later, flat, self.tail_ratio)
    }

    /// One standard deviation of [`Factors::eval`] for a pair of directions by the noise of the walks, 1/sr.
    pub fn standard_error(&self, wi: DVec3, wo: DVec3, kd: f64, ks: f64, n: f64) -> f64 {
        let k = ((2.0 * n.max(1.0).log2()).round() as usize).min(EXPONENTS - 1);
        let (mut first, mut later) = ([0.0; FIRST], [0.0; LATER]);
        self.first.add(wi, wo, 1.0, &mut first);
        self.later.add(wi, wo, 1.0, &mut later);
        let (e_first, e_later) = (self.first.errors(wi, wo), self.later.errors(wi, wo));
        let once = Factors::new(&first, &[0.0; LATER], Vec::new(), 0.0);
        let more = Factors::new(&[0.0; FIRST], &later, Vec::new(), self.tail_ratio);
        let [diffuse, all, later] =
            [once.eval(kd, 0.0, n), once.eval(kd, ks, n), more.eval(kd, ks, n)].map(|domes| domes.f.abs());
        let once = diffuse * e_first[0] + (all - diffuse).abs() * e_first[1 + k];
        let share = if kd + ks > 0.0 { ks / (kd + ks) / table::NOISE_SHARE } else { 0.0 };
        let more = later * (e_later[0] + share * (e_later[1 + k] - e_later[0]).max(0.0));
        once.hypot(more)
    }

    /// Noise of f_E relative to its value at these coefficients: the root mean square over pairs of directions that fill
    /// the hemisphere up to 80 degrees.
    pub fn relative_noise(&self, kd: f64, ks: f64, n: f64) -> f64 {
        let (mut squares, count) = (0.0, 128);
        for i in 0..count {
            // The generalised golden ratio of three dimensions.
            let [a, b, c] = [0.8192, 0.6710, 0.5497].map(|step: f64| (f64::from(i) * step + 0.5).fract());
            let (wi, wo) = (direction_deg(80.0 * a.sqrt(), 0.0), direction_deg(80.0 * b.sqrt(), 180.0 * c));
            let f = self.factors(&[(wi, wo, 1.0)]).eval(kd, ks, n).f;
            if f > 0.0 {
                squares += (self.standard_error(wi, wo, kd, ks, n) / f).powi(2);
            }
        }
        f64::sqrt(squares / f64::from(count))
    }

    /// Compares the table with walks between its nodes that used the same random numbers.
    fn check(&self, views: &[(&View, &[Sums])]) -> InterpolationError {
        let (mut squares, mut values) = ([0.0; ERRORS], [0.0; ERRORS]);
        for pair in views.chunks_exact(2) {
            let [(view, first), (_, later)] = pair else { continue };
            for lamp in 0..view.lamps.len() * view.azimuths.len() {
                let (l, a) = (view.lamps[lamp % view.lamps.len()], view.azimuths[lamp / view.lamps.len()]);
                let cos = view.theta.cos();
                let mean_first = table::mean::<FIRST>(first, lamp, cos);
                let mean_later = table::mean::<LATER>(later, lamp, cos);
                let wo = DVec3::new(view.theta.sin(), 0.0, cos);
                let wi = DVec3::new(l.sin() * a.cos(), l.sin() * a.sin(), l.cos());
                let (mut first, mut later) = ([0.0; FIRST], [0.0; LATER]);
                self.first.add(wi, wo, cos, &mut first);
                self.later.add(wi, wo, cos, &mut later);
                let [direct, table] = [(mean_first, mean_later), (first, later)]
                    .map(|(f, l)| table::references(&Factors::new(&f, &l, Vec::new(), self.tail_ratio)));
                for k in 0..ERRORS {
                    squares[k] += (direct[k] - table[k]).powi(2);
                    values[k] += direct[k] * direct[k];
                }
            }
        }
        let root = |k: usize| if values[k] > 0.0 { f64::sqrt(squares[k] / values[k]) } else { 0.0 };
        InterpolationError { diffuse: root(0), specular: (1..ERRORS).map(root).collect() }
    }
}

/// Every view that is walked from: the tables' nodes, then, twice each, those that check the interpolation.
fn views(settings: &FactorSettings) -> Vec<View> {
    let FactorSettings { first, later, .. } = settings;
    let all = |nodes: &AngleNodes, part| {
        let nodes = *nodes;
        (0..nodes.thetas).map(move |i| View {
            theta: nodes.theta(i as f64),
            lamps: (0..nodes.ratios).map(|j| nodes.theta(i as f64) * nodes.ratio(j as f64)).collect(),
            azimuths: (0..nodes.azimuths).map(|k| nodes.azimuth(k as f64)).collect(),
            part,
        })
    };
    let mut views: Vec<View> = all(first, Part::First).chain(all(later, Part::Later)).collect();
    for c in 1..=CHECKS {
        let theta = first.theta((c * (first.thetas - 2) / CHECKS) as f64 + 0.5);
        for part in [Part::First, Part::Later] {
            views.push(View {
                theta,
                lamps: (0..first.ratios - 1)
                    .step_by(2)
                    .map(|j| theta * first.ratio(j as f64 + 0.5))
                    .collect(),
                azimuths: (0..first.azimuths - 1).step_by(2).map(|k| first.azimuth(k as f64 + 0.5)).collect(),
                part,
            });
        }
    }
    views
}

/// [`REPLICATES`] sums per view, in the order of the views.
fn trace(
    walker: &Walker,
    views: &[View],
    settings: &FactorSettings,
    progress: Progress,
) -> Result<Vec<Sums>> {
    let [points, facets] = [settings.points, settings.facets].map(|n| n.div_ceil(REPLICATES as u32));
    let tasks = views.len() * REPLICATES;
    let (done, cancelled) = (AtomicU64::new(0), AtomicBool::new(false));
    let sums: Vec<Option<Sums>> = (0..tasks)
        .into_par_iter()
        .map(|task| {
            if cancelled.load(Ordering::Relaxed) {
                return None;
            }
            let (view, replicate) = (task / REPLICATES, (task % REPLICATES) as u32);
            let sums = walker.trace(&views[view], settings.seed, replicate, points, facets);
            let finished = u64::from(points) * (done.fetch_add(1, Ordering::Relaxed) + 1);
            if progress(finished, u64::from(points) * tasks as u64) == ControlFlow::Break(()) {
                cancelled.store(true, Ordering::Relaxed);
            }
            Some(sums)
        })
        .collect();
    sums.into_iter().collect::<Option<_>>().ok_or(Error::Cancelled)
}

/// Cosine between the mirror direction of one and the other at a flat surface.
fn cos_alpha(wi: DVec3, wo: DVec3) -> f64 {
    let chord = DVec3::new(-wi.x, -wi.y, wi.z) - wo;
    (1.0 - 0.5 * chord.length_squared()).max(0.0)
}

#[cfg(test)]
mod tests;

//! From starts to the best minimum.
//!
//! Each search starts with shapes set and gains 1, finds the coefficients by non-negative least squares of the
//! derivatives at zero coefficients (gains then follow by one linear step each, and the coefficients once more), and ends
//! with Levenberg-Marquardt over everything; the best is continued to rounding. The first start has the parameters' own starts; the others spread
//! evenly between the bounds of the shapes (in the logarithm where the parameter says so) by the additive recurrence of
//! the generalised golden ratio, which has no clusters in any number of dimensions; the seed moves all of them. Searches
//! run in parallel and do not know of each other. Guarded by `several_starts_find_the_deeper_minimum`.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::loss::ScaledLoss;
use super::nnls::nnls;
use super::parameters::Layout;
use super::problem::{Problem, Weighted};
use super::progress::Steps;
use super::solve::{Effort, Residuals, Solution, solve};
use crate::math::sampler::{hash, hash_to_unit};
use crate::{Error, Result};

/// Costs are one minimum within this share.
const SAME_MINIMUM: f64 = 1e-6;

/// A problem with its weights and loss: what a search minimises.
pub(crate) struct Objective<'a> {
    pub(crate) problem: &'a Problem,
    pub(crate) weights: Vec<f64>,
    pub(crate) loss: ScaledLoss,
}

/// What the searches found.
pub(crate) struct Found {
    pub(crate) best: Solution,
    /// Where the winner started.
    pub(crate) start: Vec<f64>,
    pub(crate) evaluations: usize,
    pub(crate) starts: usize,
    pub(crate) agreeing: usize,
}

impl Objective<'_> {
    /// The residuals of the measurement itself.
    pub(crate) fn residuals(&self) -> Weighted<'_> {
        self.residuals_of(&self.problem.readings)
    }

    /// The residuals of other readings at the same directions.
    pub(crate) fn residuals_of<'b>(&'b self, readings: &'b [f64]) -> Weighted<'b> {
        Weighted { problem: self.problem, readings, weights: &self.weights }
    }

    /// One search from a full start.
    pub(crate) fn solve(&self, x: &[f64], effort: Effort) -> Solution {
        let (lower, upper) = self.problem.layout.bounds();
        solve(&self.residuals(), x, (&lower, &upper), &self.loss, effort)
    }

    /// Searches from `count` starts.
    pub(crate) fn search(&self, count: usize, seed: u64, steps: &Steps) -> Result<Found> {
        let layout = &self.problem.layout;
        let starts = starts(layout, count, seed);
        steps.add(starts.len() as u64);
        let ends = starts
            .into_par_iter()
            .enumerate()
            .map(|(i, mut x)| {
                self.linear_start(&mut x, i == 0);
                let end = self.solve(&x, Effort::ROUGH);
                steps.done().map(|()| (x, end))
            })
            .collect::<Result<Vec<(Vec<f64>, Solution)>>>()?;
        let least = ends.iter().map(|(_, e)| e.cost).fold(f64::INFINITY, f64::min);
        if !least.is_finite() {
            return Err(Error::invalid("fit", "the model gives no finite values at any start"));
        }
        let same = |e: &Solution| e.cost <= least * (1.0 + SAME_MINIMUM) + self.residuals().floor();
        let evaluations: usize = ends.iter().map(|(_, e)| e.evaluations).sum();
        let (starts, agreeing) = (ends.len(), ends.iter().filter(|(_, e)| same(e)).count());
        // The first of those that agree, converged ones before others: the same whatever finishes first.
        let winner = ends.iter().position(|(_, e)| same(e) && e.converged);
        let winner = winner.or_else(|| ends.iter().position(|(_, e)| same(e))).unwrap_or(0);
        let (start, end) = ends.into_iter().nth(winner).ok_or(Error::Cancelled)?;
        let best = self.solve(&end.x, Effort::EXACT);
        Ok(Found { evaluations: evaluations + best.evaluations, best, start, starts, agreeing })
    }

    /// Coefficients and gains of a start whose shapes are set; `keep` those that the user gave.
    fn linear_start(&self, x: &mut [f64], keep: bool) {
        let layout = &self.problem.layout;
        let (lower, upper) = layout.bounds();
        let given = |v: usize| keep && layout.free_slot(v).start_is_given;
        let of = |coefficient: bool| -> Vec<usize> {
            let is = |v: &usize| {
                if coefficient { layout.is_coefficient(*v) } else { layout.free_slot(*v).is_gain }
            };
            (0..x.len()).filter(|v| is(v) && !given(*v)).collect()
        };
        let (coefficients, gains) = (of(true), of(false));
        let n = self.problem.readings.len();
        let (mut r, mut j) = (vec![0.0; n], DMatrix::zeros(n, x.len()));
        for round in 0..2 {
            if coefficients.is_empty() && gains.is_empty() || round == 1 && gains.is_empty() {
                break;
            }
            for &v in &coefficients {
                x[v] = 0f64.clamp(lower[v], upper[v]);
            }
            self.residuals().eval(x, &mut r, &mut j);
            let b = DVector::from_fn(n, |i, _| -r[i]);
            let found = nnls(&j.select_columns(&coefficients), &b);
            for (&v, c) in coefficients.iter().zip(found.iter()) {
                x[v] = (x[v] + c).clamp(lower[v], upper[v]);
            }
            if round == 0 && !gains.is_empty() {
                self.residuals().eval(x, &mut r, &mut j);
                for &v in &gains {
                    let column = j.column(v);
                    let (top, bottom) = (column.dot(&DVector::from_column_slice(&r)), column.norm_squared());
                    let gain = x[v] - top / bottom;
                    // A gain that would be negative or huge stays.
                    if gain > 1e-3 * x[v] && gain.is_finite() {
                        x[v] = gain.clamp(lower[v], upper[v]);
                    }
                }
            }
        }
    }
}

/// Points to start from: free variables, coefficients at their own starts.
fn starts(layout: &Layout, count: usize, seed: u64) -> Vec<Vec<f64>> {
    let own: Vec<f64> = layout.free.iter().map(|&i| layout.slots[i].parameter.start).collect();
    let spread: Vec<usize> =
        (0..own.len()).filter(|&v| !layout.is_coefficient(v) && !layout.free_slot(v).is_gain).collect();
    if spread.is_empty() {
        return vec![own];
    }
    // The root above 1 of g^(d + 1) = g + 1.
    let d = spread.len() as f64;
    let golden = (0..64).fold(1.5f64, |g, _| (1.0 + g).powf(1.0 / (d + 1.0)));
    let offset =
        |k: usize| hash_to_unit(hash(seed as u32 ^ hash((seed >> 32) as u32)).wrapping_add(k as u32));
    let mut points = vec![own.clone()];
    for i in 1..count {
        let mut x = own.clone();
        for (k, &v) in spread.iter().enumerate() {
            let t = (offset(k) + i as f64 * golden.powi(-(k as i32 + 1))).fract();
            let p = &layout.free_slot(v).parameter;
            x[v] = if p.logarithmic && p.min > 0.0 {
                (p.min.ln() + t * (p.max / p.min).ln()).exp()
            } else {
                p.min + t * (p.max - p.min)
            }
            .clamp(p.min, p.max);
        }
        points.push(x);
    }
    points
}

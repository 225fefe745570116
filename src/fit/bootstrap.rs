//! Bootstrap intervals: the fit repeated on readings that could have been.
//!
//! Model: wild bootstrap. Replicate b has the readings m_i + e_bi r_i / sqrt(1 - h_i), where m is the fitted model, r the
//! residual in 1/sr, h the leverage (a fit pulls its own readings towards it) and e = +1 or -1 with equal chance. Errors
//! keep each reading's own size, so unequal and unknown variances are allowed, and no direction is ever missing. Weights
//! stay; each replicate is fitted from the best values; the interval is between the percentiles of the values.
//! Random signs depend on (seed, replicate, reading) only. Guarded by `bootstrap_agrees_with_the_covariance`.
//! Source: Wu 1986, Annals of Statistics 14:1261; the two-point distribution of Davidson and Flachaire 2008.

use rayon::prelude::*;

use super::progress::Steps;
use super::search::Objective;
use super::solve::{Effort, Solution, solve};
use crate::Result;
use crate::math::sampler::{hash, hash_to_unit};

/// Leverages above this count as this: a reading that determines a parameter alone tells nothing of its error.
const MOST_LEVERAGE: f64 = 0.99;

/// Percentile interval of every slot of the layout, and the evaluations that it took.
pub(crate) fn bootstrap(
    objective: &Objective,
    best: &Solution,
    leverage: &[f64],
    (replicates, seed, level): (u32, u64, f64),
    steps: &Steps,
) -> Result<(Vec<[f64; 2]>, usize)> {
    let problem = objective.problem;
    let layout = &problem.layout;
    let (lower, upper) = layout.bounds();
    let mut modelled = vec![0.0; problem.readings.len()];
    problem.model(&best.x, &mut modelled, None);
    let error: Vec<f64> = problem
        .readings
        .iter()
        .zip(&modelled)
        .zip(leverage)
        .map(|((y, m), h)| (y - m) / (1.0 - h.min(MOST_LEVERAGE)).sqrt())
        .collect();
    let key = hash(seed as u32 ^ hash((seed >> 32) as u32));
    let values = (0..replicates)
        .into_par_iter()
        .map(|b| {
            let key = hash(key ^ hash(b));
            let readings: Vec<f64> = modelled
                .iter()
                .zip(&error)
                .enumerate()
                .map(|(i, (m, e))| {
                    let sign = if hash_to_unit(key.wrapping_add(hash(i as u32))) < 0.5 { -1.0 } else { 1.0 };
                    m + sign * e
                })
                .collect();
            let fit = solve(
                &objective.residuals_of(&readings),
                &best.x,
                (&lower, &upper),
                &objective.loss,
                Effort::WARM,
            );
            steps.done()?;
            Ok((layout.values(&fit.x), fit.evaluations))
        })
        .collect::<Result<Vec<(Vec<f64>, usize)>>>()?;
    let evaluations = values.iter().map(|v| v.1).sum();
    let intervals = (0..layout.slots.len())
        .map(|s| {
            let mut sorted: Vec<f64> = values.iter().map(|v| v.0[s]).collect();
            sorted.sort_by(f64::total_cmp);
            [percentile(&sorted, 0.5 - 0.5 * level), percentile(&sorted, 0.5 + 0.5 * level)]
        })
        .collect();
    Ok((intervals, evaluations))
}

/// Between the order statistics, linearly; `sorted` is not empty.
fn percentile(sorted: &[f64], p: f64) -> f64 {
    let at = p * (sorted.len() - 1) as f64;
    let (low, part) = (at.floor() as usize, at.fract());
    let high = (low + 1).min(sorted.len() - 1);
    sorted[low] + part * (sorted[high] - sorted[low])
}

//! A fit from beginning to end.
//!
//! Weights, searches, intervals, bootstrap and summary in turn. Where the weights follow the model (a relative error), they
//! are set again from the fitted values and the fit repeated until they stay, at most 50 times; a robust loss whose
//! scale is not known takes it from a fit with the linear one.

use rayon::prelude::*;

use super::bootstrap::bootstrap;
use super::covariance::{Knowledge, Uncertainty};
use super::interval::{Ends, Profile};
use super::loss::{Loss, ScaledLoss};
use super::options::{Covariance, Options};
use super::problem::Problem;
use super::progress::{Progress, Steps};
use super::search::{Found, Objective};
use super::solve::Residuals;
use super::summary::{Extras, summary};
use super::weights::Weighting;
use super::{Fit, Interval, Model};
use crate::Result;
use crate::gonio::Measurement;
use crate::math::stats::{normal_quantile, student_t_quantile};

/// Median of |normal| numbers, inverted.
const MAD_TO_SIGMA: f64 = 1.4826;

/// Fits a model to a measurement. `progress` is told `(done, total)` and may stop the fit.
///
/// Errors are for what cannot be fitted at all: no readings, readings or settings that are no numbers, unknown or
/// contradictory names. What the data cannot determine is no error: the [`Fit`] says so.
pub fn fit(
    model: &dyn Model,
    measurement: &Measurement,
    options: &Options,
    progress: Progress<'_>,
) -> Result<Fit> {
    options.check()?;
    let problem = Problem::new(model, measurement, options)?;
    let weighting = Weighting::new(measurement, options)?;
    let steps = Steps::new(0, progress);
    let mut notes = Vec::new();
    let mut objective = Objective {
        problem: &problem,
        weights: weighting.weights(&problem.readings),
        loss: ScaledLoss::LINEAR,
    };
    let robust = options.loss != Loss::Linear;
    let known_scale = options.loss_scale.or(weighting.knows_sigma().then_some(1.0));
    if robust && let Some(scale) = known_scale {
        objective.loss = ScaledLoss { loss: options.loss, scale };
    }
    let mut found = objective.search(options.starts, options.seed, &steps)?;
    if weighting.follows_the_model() {
        reweigh(&weighting, &mut objective, &mut found, &mut notes);
    }
    if robust && known_scale.is_none() {
        let mut sizes: Vec<f64> = found.best.residuals.iter().map(|r| r.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let scale = MAD_TO_SIGMA * sizes[sizes.len() / 2];
        // Most readings met exactly: nothing to be robust against.
        let least = (2.0 * objective.residuals().floor() / sizes.len() as f64).sqrt();
        if scale > 1e6 * least {
            objective.loss = ScaledLoss { loss: options.loss, scale };
            let evaluations = found.evaluations;
            found = objective.search(options.starts, options.seed, &steps)?;
            found.evaluations += evaluations;
        } else {
            notes.push("residuals vanish: the linear loss was kept".into());
        }
    }
    let (lower, upper) = problem.layout.bounds();
    let groups = objective.residuals().groups().to_vec();
    let measure = |f: &Found, o: &Objective| {
        Uncertainty::new(&f.best, (&lower, &upper), &o.loss, options.covariance, &groups)
    };
    let mut uncertainty = measure(&found, &objective);
    let mut intervals = Vec::new();
    if let Some(level) = options.level {
        // A profile may meet a better minimum; then everything starts from there.
        for round in 0..3 {
            let ends = profiles(&objective, &found, &uncertainty, options, level, &steps)?;
            found.evaluations += ends.iter().flatten().map(|e| e.evaluations).sum::<usize>();
            let better = ends.iter().flatten().filter_map(|e| e.better.as_ref());
            let better = better.min_by(|a, b| a.cost.total_cmp(&b.cost));
            let polished = better.map(|b| objective.solve(&b.x));
            intervals = ends
                .iter()
                .map(|e| e.as_ref().map(|e| Interval { level, low: e.low, high: e.high }))
                .collect();
            let Some(polished) = polished.filter(|p| p.cost < found.best.cost) else { break };
            found.evaluations += polished.evaluations;
            found.start.clone_from(&found.best.x);
            (found.best, found.agreeing) = (polished, 0);
            if weighting.follows_the_model() {
                reweigh(&weighting, &mut objective, &mut found, &mut notes);
            }
            uncertainty = measure(&found, &objective);
            let text = match round {
                2 => {
                    "profiles keep finding better minima: the intervals belong to an earlier one; use more starts"
                }
                _ => "a better minimum was met on the way to an interval: use more starts",
            };
            if !notes.iter().any(|n| n == text) {
                notes.push(text.into());
            }
        }
        if intervals.iter().all(Option::is_none) && !intervals.is_empty() {
            notes.push("no intervals: as many parameters as readings".into());
        }
    }
    let mut percentiles = None;
    if let Some(replicates) = options.bootstrap {
        steps.add(u64::from(replicates));
        let settings = (replicates, options.seed, options.level.unwrap_or(0.95));
        let (found_intervals, evaluations) =
            bootstrap(&objective, &found.best, &uncertainty.leverage, settings, &steps)?;
        percentiles = Some(found_intervals);
        found.evaluations += evaluations;
    }
    let extras = Extras { intervals, percentiles, notes };
    Ok(summary(model, measurement, options, &weighting, &objective, found, &uncertainty, extras))
}

/// Weights from the fitted values, and the fit again, until they stay.
fn reweigh(weighting: &Weighting, objective: &mut Objective, found: &mut Found, notes: &mut Vec<String>) {
    let mut modelled = vec![0.0; objective.problem.readings.len()];
    for _ in 0..50 {
        objective.problem.model(&found.best.x, &mut modelled, None);
        let weights = weighting.weights(&modelled);
        let change =
            weights.iter().zip(&objective.weights).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max);
        objective.weights = weights;
        let next = objective.solve(&found.best.x);
        found.evaluations += next.evaluations;
        found.best = next;
        if change < 1e-9 {
            return;
        }
    }
    notes.push("weights that follow the model still changed after 50 rounds".into());
}

/// Profile intervals of all free variables; `None` where no freedom is left.
fn profiles(
    objective: &Objective,
    found: &Found,
    uncertainty: &Uncertainty,
    options: &Options,
    level: f64,
    steps: &Steps,
) -> Result<Vec<Option<Ends>>> {
    let (n, k) = found.best.jacobian.shape();
    let freedom = n as f64 - k as f64;
    let absolute = options.covariance == Covariance::Absolute;
    steps.add(k as u64);
    let chi2: f64 = found.best.residuals.iter().map(|r| r * r).sum();
    let q = 0.5 + 0.5 * level;
    let (t, variance) = match absolute {
        true => (normal_quantile(q), 1.0),
        false if freedom > 0.0 => (student_t_quantile(q, freedom), chi2 / freedom),
        false => return Ok(vec![None; k].into_iter().map(|_: Option<()>| None).collect()),
    };
    (0..k)
        .into_par_iter()
        .map(|variable| {
            let h = uncertainty.inverse[(variable, variable)];
            let c = uncertainty.covariance.as_ref().map_or(0.0, |c| c[(variable, variable)]);
            let determined = uncertainty.knowledge[variable] == Knowledge::Determined && h > 0.0;
            let profile = Profile {
                objective,
                best: &found.best,
                variable,
                rise: t * t * if determined { c / h } else { variance },
                guess: uncertainty.standard_error(variable).map(|s| t * s),
            };
            let ends = profile.ends();
            steps.done()?;
            Ok(Some(ends))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::tests::{line, lobe, measured, noisy_lobe, of, on, wiggle};
    use crate::fit::{State, Weights};

    #[test]
    fn a_noisy_lobe_is_found() {
        let options = Options { level: Some(0.95), bootstrap: Some(100), ..Options::default() };
        let fit = fit(&lobe(), &noisy_lobe(), &options, &on).unwrap();
        for (name, truth) in [("kd", 0.3), ("ks", 0.2), ("n", 25.0)] {
            let p = of(&fit, name);
            assert!((p.value / truth - 1.0).abs() < 0.05 && p.state == State::Free, "{p:?}");
            println!("{p:?}");
        }
        println!("{fit:#?}");
        assert!(fit.converged, "{:?}", fit.messages);
    }

    #[test]
    fn a_straight_line() {
        let m = measured(|_, wo, _, _| 1.0 + 2.0 * wo.z);
        let fit =
            fit(&line(), &m, &Options { weights: Weights::Uniform, ..Options::default() }, &on).unwrap();
        println!("{fit:#?} {}", wiggle(3));
    }
}

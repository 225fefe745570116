//! What a fit found, in the numbers and words of a report.
//!
//! Criteria as lmfit defines them (see [`Fit`]); the mean in R2 is the weighted one, so that the best constant has R2 = 0.

use super::covariance::{Knowledge, Uncertainty};
use super::loss::Loss;
use super::options::{Covariance, Options};
use super::parameters::{Layout, Role};
use super::search::{Found, Objective};
use super::solve::Residuals;
use super::weights::Weighting;
use super::{Correlation, End, Fit, Fitted, Interval, Model, State};
use crate::gonio::Measurement;

/// What was asked for besides the fit itself.
pub(crate) struct Extras {
    /// Of the free variables; empty where none were asked for.
    pub(crate) intervals: Vec<Option<Interval>>,
    /// Of all slots.
    pub(crate) percentiles: Option<Vec<[f64; 2]>>,
    pub(crate) notes: Vec<String>,
}

/// Everything of a [`Fit`].
#[expect(clippy::too_many_arguments, reason = "the one place where all parts meet")]
pub(crate) fn summary(
    model: &dyn Model,
    measurement: &Measurement,
    options: &Options,
    weighting: &Weighting,
    objective: &Objective,
    found: Found,
    uncertainty: &Uncertainty,
    extras: Extras,
) -> Fit {
    let layout = &objective.problem.layout;
    let readings = &objective.problem.readings;
    let best = &found.best;
    let (n, varied) = (readings.len(), layout.free.len());
    let mut modelled = vec![0.0; n];
    objective.problem.model(&best.x, &mut modelled, None);
    let chi2: f64 = best.residuals.iter().map(|r| r * r).sum();
    let freedom = n.saturating_sub(varied);
    let size: f64 = readings.iter().zip(&objective.weights).map(|(y, w)| (y * w).powi(2)).sum();
    let exact = chi2 <= 1e-26 * size;
    let log = n as f64 * (chi2 / n as f64).ln();
    let sum_w2: f64 = objective.weights.iter().map(|w| w * w).sum();
    let mean = readings.iter().zip(&objective.weights).map(|(y, w)| w * w * y).sum::<f64>() / sum_w2;
    let scatter: f64 = readings.iter().zip(&objective.weights).map(|(y, w)| (w * (y - mean)).powi(2)).sum();
    let root_mean = |f: &dyn Fn(usize) -> f64| {
        let total: f64 = weighting.shares.iter().sum();
        ((0..n).map(|i| weighting.shares[i] * f(i).powi(2)).sum::<f64>() / total).sqrt()
    };
    let cube_root = |v: f64, i: usize| (v * measurement.readings[i].wo.z.abs()).cbrt();
    let mut fit = Fit {
        model: model.name().to_string(),
        method: method(options, objective, found.starts),
        weighting: weighting.describe(),
        converged: best.converged,
        messages: Vec::new(),
        evaluations: found.evaluations,
        starts: found.starts,
        agreeing_starts: found.agreeing,
        n,
        varied,
        chi2,
        reduced_chi2: (freedom > 0).then(|| chi2 / freedom as f64),
        aic: (!exact).then_some(log + 2.0 * varied as f64),
        bic: (!exact).then_some(log + (n as f64).ln() * varied as f64),
        r2: (scatter > 1e-24 * size).then(|| 1.0 - chi2 / scatter),
        rmse_per_sr: root_mean(&|i| modelled[i] - readings[i]),
        rmse_cube_root: root_mean(&|i| cube_root(modelled[i], i) - cube_root(readings[i], i)),
        parameters: fitted(layout, &found, uncertainty, &extras),
        correlations: correlations(layout, uncertainty),
        modelled,
        residuals: best.residuals.clone(),
    };
    fit.messages = messages(&fit, layout, uncertainty, objective);
    fit.messages.extend(extras.notes);
    fit
}

fn method(options: &Options, objective: &Objective, starts: usize) -> String {
    let loss = match objective.loss.loss {
        Loss::Linear => "linear loss".to_string(),
        loss => format!("{} loss of scale {:.4e}", loss.name(), objective.loss.scale),
    };
    let covariance = match options.covariance {
        Covariance::Scaled => "errors scaled by the reduced chi2",
        Covariance::Absolute => "errors from the sigmas as given",
        Covariance::Sandwich => "errors by White's sandwich",
    };
    let s = if starts == 1 { "" } else { "s" };
    format!("bounded Levenberg-Marquardt from {starts} start{s}, {loss}, {covariance}")
}

fn fitted(layout: &Layout, found: &Found, uncertainty: &Uncertainty, extras: &Extras) -> Vec<Fitted> {
    let (values, starts) = (layout.values(&found.best.x), layout.values(&found.start));
    let fitted = |(i, slot): (usize, &super::parameters::Slot)| {
        let root = layout.root[i];
        let state = match (&slot.role, root) {
            (Role::Fixed, _) => State::Fixed,
            (Role::Tied { .. }, _) => State::Tied,
            (Role::Free, Some((v, _))) => match uncertainty.knowledge[v] {
                Knowledge::Determined => State::Free,
                Knowledge::AtLower => State::AtLower,
                Knowledge::AtUpper => State::AtUpper,
                Knowledge::NoEffect | Knowledge::OnlyCombined => State::Undetermined,
            },
            (Role::Free, None) => State::Fixed,
        };
        let interval = root.and_then(|(v, factor)| {
            let of_root = extras.intervals.get(v).copied().flatten()?;
            let times = |e: End| match e {
                End::Limit(v) => End::Limit(v * factor),
                End::Bound(v) => End::Bound(v * factor),
            };
            let (low, high) = (times(of_root.low), times(of_root.high));
            let (low, high) = if factor < 0.0 { (high, low) } else { (low, high) };
            Some(Interval { level: of_root.level, low, high })
        });
        Fitted {
            name: slot.name.clone(),
            parameter: slot.parameter.name.clone(),
            meaning: slot.parameter.meaning.clone(),
            band: slot.band,
            value: values[i],
            standard_error: root.and_then(|(v, factor)| Some(uncertainty.standard_error(v)? * factor.abs())),
            start: starts[i],
            min: slot.parameter.min,
            max: slot.parameter.max,
            state,
            tie: match slot.role {
                Role::Tied { to, factor } => Some(format!("{} * {factor}", layout.slots[to].name)),
                _ => None,
            },
            interval,
            bootstrap: extras.percentiles.as_ref().filter(|_| root.is_some()).map(|p| p[i]),
        }
    };
    layout.slots.iter().enumerate().map(fitted).collect()
}

fn correlations(layout: &Layout, uncertainty: &Uncertainty) -> Vec<Correlation> {
    let mut all = Vec::new();
    for a in 0..layout.free.len() {
        for b in a + 1..layout.free.len() {
            if let Some(correlation) = uncertainty.correlation(a, b) {
                all.push(Correlation { a: layout.free[a], b: layout.free[b], correlation });
            }
        }
    }
    all
}

fn messages(fit: &Fit, layout: &Layout, uncertainty: &Uncertainty, objective: &Objective) -> Vec<String> {
    let named = |which: Knowledge| -> Vec<&str> {
        let is = |v: &usize| uncertainty.knowledge[*v] == which;
        (0..layout.free.len()).filter(is).map(|v| layout.free_slot(v).name.as_str()).collect()
    };
    let mut all = Vec::new();
    if layout.free.is_empty() {
        all.push("nothing was varied: all parameters are held".into());
    } else if fit.converged && 0.5 * fit.chi2 <= objective.residuals().floor() {
        all.push("the readings are met exactly".into());
    } else if fit.converged {
        all.push("ended at a minimum".into());
    } else {
        all.push("did not converge: values and errors are not those of a minimum".into());
    }
    if fit.varied > 0 && fit.n <= fit.varied {
        all.push(format!("{} readings cannot give {} parameters and their errors", fit.n, fit.varied));
    }
    for (knowledge, text) in [
        (Knowledge::AtLower, "at the lower bound"),
        (Knowledge::AtUpper, "at the upper bound"),
        (Knowledge::NoEffect, "not determined by the data, no effect on the readings at the best fit"),
        (Knowledge::OnlyCombined, "not determined by the data, which fix only combinations of them"),
    ] {
        let names = named(knowledge);
        if !names.is_empty() {
            all.push(format!("{text}: {}", names.join(", ")));
        }
    }
    if fit.r2.is_none() {
        all.push("all readings are alike: R2 has no meaning".into());
    }
    if fit.starts > 1 && fit.agreeing_starts * 4 < fit.starts {
        let what = format!("only {} of {} starts found this minimum", fit.agreeing_starts, fit.starts);
        all.push(what);
    }
    all
}

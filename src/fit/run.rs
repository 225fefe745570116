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
use super::solve::{Effort, Residuals};
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
    let steps = Steps::new(progress);
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
            let polished = better.map(|b| objective.solve(&b.x, Effort::EXACT));
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
        let next = objective.solve(&found.best.x, Effort::EXACT);
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
            let column = uncertainty.inverse.column(variable);
            let profile = Profile {
                objective,
                best: &found.best,
                variable,
                rise: t * t * if determined { c / h } else { variance },
                direction: column.iter().map(|c| if determined { c / h } else { 0.0 }).collect(),
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
    use std::f64::consts::PI;
    use std::ops::ControlFlow;

    use super::*;
    use crate::fit::tests::*;
    use crate::fit::{Action, End, Kind, Override, State, Weights};

    fn uniform() -> Options {
        Options { weights: Weights::Uniform, ..Options::default() }
    }

    fn wish(name: &str, action: Action) -> Override {
        Override { name: name.into(), action }
    }

    fn relative(value: f64, expected: f64, tolerance: f64) {
        assert!((value / expected - 1.0).abs() < tolerance, "{value} is not {expected}");
    }

    /// `[kd, ks, n]` and their standard errors.
    fn numbers(fit: &Fit) -> ([f64; 3], [f64; 3]) {
        let at = |name| of(fit, name);
        let names = ["kd", "ks", "n"];
        (names.map(|n| at(n).value), names.map(|n| at(n).standard_error.unwrap()))
    }

    #[test]
    fn agrees_with_lmfit() {
        // lmfit.minimize(method='least_squares', xtol = ftol = gtol = 1e-15) on the same residuals:
        // y = (kd / pi + ks c**n) (1 + 0.02 sin(12.9898 i**2)) at kd, ks, n = 0.3, 0.2, 25.
        let fit = fit(&lobe(), &noisy_lobe(), &uniform(), &on).unwrap();
        let (values, errors) = numbers(&fit);
        for (i, v) in [0.29969987613452403, 0.202044322367076, 25.215979686263275].into_iter().enumerate() {
            relative(values[i], v, 1e-7);
        }
        for (i, e) in
            [0.000768590164056338, 0.0010789713786678408, 0.2591778326818086].into_iter().enumerate()
        {
            relative(errors[i], e, 1e-7);
        }
        relative(fit.chi2, 0.00021721417197941421, 1e-12);
        relative(fit.reduced_chi2.unwrap(), 3.148031477962526e-06, 1e-12);
        relative(fit.aic.unwrap(), -909.2130846618097, 1e-12);
        relative(fit.bic.unwrap(), -902.3830863047616, 1e-12);
        relative(fit.r2.unwrap(), 0.9984733862710542, 1e-12);
        let pair = |a: &str, b: &str| {
            let find = |c: &&crate::fit::Correlation| {
                let names = [&fit.parameters[c.a].name, &fit.parameters[c.b].name];
                names.contains(&&a.to_string()) && names.contains(&&b.to_string())
            };
            fit.correlations.iter().find(find).unwrap().correlation
        };
        relative(pair("kd", "ks"), -0.13578988323456753, 1e-6);
        relative(pair("kd", "n"), 0.37755067915135854, 1e-6);
        relative(pair("ks", "n"), 0.4722363100004986, 1e-6);
        assert!(fit.converged && fit.n == 72 && fit.varied == 3 && fit.starts == 8, "{:?}", fit.messages);
        assert!(fit.agreeing_starts >= 6, "{}", fit.agreeing_starts);
    }

    #[test]
    fn robust_losses_agree_with_scipy() {
        // The same readings, every 17th from the fourth 1.5 times too large; scipy.optimize.least_squares(loss, f_scale=0.003,
        // xtol = ftol = gtol = 1e-15); errors of inv(jac.T jac) chi2 / (N - 3), as lmfit reports them.
        let mut m = noisy_lobe();
        m.readings
            .iter_mut()
            .enumerate()
            .filter(|(i, _)| i % 17 == 3)
            .for_each(|(_, r)| r.bsdf_per_sr *= 1.5);
        type Row = (Loss, [f64; 3], [f64; 3], f64);
        let expected: [Row; 4] = [
            (
                Loss::Linear,
                [0.3028253208201245, 0.22574936410656776, 22.286247069688624],
                [0.00818949754543018, 0.011004357628493017, 2.061102950772359],
                0.023959584940473067,
            ),
            (
                Loss::SoftL1,
                [0.29960972326237445, 0.20493489023192885, 24.76617209976137],
                [0.010369175769441198, 0.017001311393206806, 3.5273652948573253],
                0.02850416716857272,
            ),
            (
                Loss::Huber,
                [0.2996117917108891, 0.2043536781609401, 24.784693265032644],
                [0.009072897833448371, 0.01802076985888841, 3.3621567838901996],
                0.028670079918874956,
            ),
            (
                Loss::Cauchy,
                [0.2991010561404022, 0.20390679385614077, 24.898188554038754],
                [0.012033879766778919, 0.028760767369936536, 4.411328976228366],
                0.02902801065521901,
            ),
        ];
        for (loss, values, errors, chi2) in expected {
            let fit = fit(&lobe(), &m, &Options { loss, loss_scale: Some(0.003), ..uniform() }, &on).unwrap();
            let (v, e) = numbers(&fit);
            for i in 0..3 {
                assert!((v[i] / values[i] - 1.0).abs() < 1e-6, "{loss:?}: {v:?} {values:?}");
                assert!((e[i] / errors[i] - 1.0).abs() < 1e-6, "{loss:?}: {e:?} {errors:?}");
            }
            relative(fit.chi2, chi2, 1e-7);
            assert!(fit.converged, "{loss:?} {:?}", fit.messages);
        }
        // Without a scale: that of the residuals. Outliers hardly count.
        let fit = fit(&lobe(), &m, &Options { loss: Loss::Cauchy, ..uniform() }, &on).unwrap();
        let (v, _) = numbers(&fit);
        assert!((v[0] - 0.3).abs() < 0.003 && (v[1] - 0.2).abs() < 0.008, "{v:?}");
    }

    /// A straight line in cos theta with errors of unequal size, and its sums.
    fn straight() -> (Measurement, Vec<f64>, Vec<f64>, Vec<f64>) {
        let mut m = measured(|_, wo, _, _| 1.0 + 2.0 * wo.z);
        for (i, r) in m.readings.iter_mut().enumerate() {
            let sigma = 0.02 + 0.08 * r.wo.z * r.wo.z;
            r.bsdf_per_sr += sigma * 1.4 * wiggle(i);
            r.sigma_per_sr = Some(sigma);
        }
        let x = m.readings.iter().map(|r| r.wo.z).collect();
        let y = m.readings.iter().map(|r| r.bsdf_per_sr).collect();
        let w = m.readings.iter().map(|r| r.sigma_per_sr.unwrap().powi(-2)).collect();
        (m, x, y, w)
    }

    #[test]
    fn a_straight_line_has_the_textbook_covariance() {
        let (m, x, y, w) = straight();
        let sum = |f: &dyn Fn(usize) -> f64| (0..x.len()).map(|i| w[i] * f(i)).sum::<f64>();
        let (s, sx, sxx) = (sum(&|_| 1.0), sum(&|i| x[i]), sum(&|i| x[i] * x[i]));
        let (sy, sxy) = (sum(&|i| y[i]), sum(&|i| x[i] * y[i]));
        let d = s * sxx - sx * sx;
        let (a, b) = ((sxx * sy - sx * sxy) / d, (s * sxy - sx * sy) / d);
        let chi2 = sum(&|i| (y[i] - a - b * x[i]).powi(2));
        let absolute = Options { covariance: Covariance::Absolute, ..Options::default() };
        for (options, scale) in [(absolute, 1.0), (Options::default(), chi2 / (x.len() as f64 - 2.0))] {
            let fit = fit(&line(), &m, &options, &on).unwrap();
            relative(of(&fit, "a").value, a, 1e-11);
            relative(of(&fit, "b").value, b, 1e-11);
            relative(of(&fit, "a").standard_error.unwrap(), (scale * sxx / d).sqrt(), 1e-11);
            relative(of(&fit, "b").standard_error.unwrap(), (scale * s / d).sqrt(), 1e-11);
            relative(fit.correlations[0].correlation, -sx / (s * sxx).sqrt(), 1e-11);
            relative(fit.chi2, chi2, 1e-12);
            assert_eq!(fit.starts, 1);
        }
    }

    #[test]
    fn sandwich_is_whites_estimate() {
        let (m, x, y, _) = straight();
        let n = x.len() as f64;
        let fit = fit(&line(), &m, &Options { covariance: Covariance::Sandwich, ..uniform() }, &on).unwrap();
        let (a, b) = (of(&fit, "a").value, of(&fit, "b").value);
        // (X^T X)^-1 X^T diag(r^2) X (X^T X)^-1 N / (N - 2): of the slope, sum ((x - mean) r)^2 / Sxx^2.
        let mean = x.iter().sum::<f64>() / n;
        let sxx: f64 = x.iter().map(|x| (x - mean).powi(2)).sum();
        let meat: f64 = x.iter().zip(&y).map(|(x, y)| ((x - mean) * (y - a - b * x)).powi(2)).sum();
        relative(of(&fit, "b").standard_error.unwrap(), (meat * n / (n - 2.0)).sqrt() / sxx, 1e-10);
    }

    #[test]
    fn linear_profiles_are_student_intervals() {
        let (m, ..) = straight();
        let check = |options: Options, quantile: f64| {
            let fit = fit(&line(), &m, &options, &on).unwrap();
            for name in ["a", "b"] {
                let p = of(&fit, name);
                let (half, i) = (quantile * p.standard_error.unwrap(), p.interval.unwrap());
                let (End::Limit(low), End::Limit(high)) = (i.low, i.high) else { panic!("{i:?}") };
                relative(p.value - low, half, 3e-6);
                relative(high - p.value, half, 3e-6);
            }
        };
        let level = Some(0.9);
        check(Options { level, ..Options::default() }, student_t_quantile(0.95, 70.0));
        check(
            Options { level, covariance: Covariance::Sandwich, ..uniform() },
            student_t_quantile(0.95, 70.0),
        );
        check(
            Options { level, covariance: Covariance::Absolute, ..Options::default() },
            normal_quantile(0.95),
        );
    }

    #[test]
    fn profiles_agree_with_lmfit() {
        // The F test of lmfit.conf_interval (which stops at 1e-3 of the probability), its roots by scipy.optimize.brentq.
        let fit = fit(&lobe(), &noisy_lobe(), &Options { level: Some(0.95), ..uniform() }, &on).unwrap();
        for (name, low, high) in [
            ("kd", 0.2981642247059511, 0.3012341582665595),
            ("ks", 0.19989069612946822, 0.20420301399224416),
            ("n", 24.701024008002992, 25.74314583774117),
        ] {
            let p = of(&fit, name);
            let i = p.interval.unwrap();
            assert!((i.low.value() - low).abs() < 1e-5 * (high - low), "{name} {i:?}");
            assert!((i.high.value() - high).abs() < 1e-5 * (high - low), "{name} {i:?}");
            assert!(matches!(i.low, End::Limit(_)) && i.level == 0.95);
        }
    }

    #[test]
    fn profiles_stop_at_bounds() {
        // No highlight in the data: its coefficient ends at zero or near it, its exponent is free.
        let mut m = measured(|_, _, _, _| 0.1);
        for (i, r) in m.readings.iter_mut().enumerate() {
            r.bsdf_per_sr +=
                0.001 * wiggle(i) - 0.002 * (r.wi.z * r.wo.z - r.wi.x * r.wo.x).max(0.0).powi(20);
        }
        let options =
            Options { level: Some(0.95), parameters: vec![wish("n", Action::Fix(20.0))], ..uniform() };
        let found = fit(&lobe(), &m, &options, &on).unwrap();
        let ks = of(&found, "ks");
        assert_eq!((ks.value, ks.state, ks.standard_error), (0.0, State::AtLower, None));
        let i = ks.interval.unwrap();
        assert_eq!(i.low, End::Bound(0.0));
        assert!(matches!(i.high, End::Limit(v) if v > 0.0 && v < 0.01), "{i:?}");
        assert!(found.messages.iter().any(|m| m == "at the lower bound: ks"), "{:?}", found.messages);
        // The diffuse part alone: mean and error of a constant.
        let kd = of(&found, "kd");
        let mean = m.readings.iter().map(|r| r.bsdf_per_sr).sum::<f64>() / 72.0;
        relative(kd.value, PI * mean, 1e-12);
        // With the exponent free as well it has no effect, and says so; its interval is its range.
        let free = fit(&lobe(), &m, &Options { level: Some(0.95), ..uniform() }, &on).unwrap();
        let (n, ks) = (of(&free, "n"), of(&free, "ks"));
        if ks.state == State::AtLower {
            assert_eq!((n.state, n.standard_error), (State::Undetermined, None));
            let i = n.interval.unwrap();
            assert_eq!((i.low, i.high), (End::Bound(1.0), End::Bound(1000.0)));
            assert!(free.messages.iter().any(|m| m.starts_with("not determined") && m.ends_with(": n")));
        }
        // A tight upper bound.
        let bounds = Options {
            level: Some(0.95),
            parameters: vec![wish("kd", Action::Bounds(0.0, 0.3)), wish("kd", Action::Start(0.1))],
            ..uniform()
        };
        let held = fit(&lobe(), &measured(|_, _, _, _| 0.1), &bounds, &on).unwrap();
        let kd = of(&held, "kd");
        assert_eq!((kd.value, kd.state, kd.interval.unwrap().high), (0.3, State::AtUpper, End::Bound(0.3)));
    }

    #[test]
    fn bootstrap_agrees_with_the_covariance() {
        let (m, ..) = straight();
        let options =
            Options { bootstrap: Some(2000), covariance: Covariance::Sandwich, seed: 3, ..uniform() };
        let found = fit(&line(), &m, &options, &on).unwrap();
        for name in ["a", "b"] {
            let p = of(&found, name);
            let [low, high] = p.bootstrap.unwrap();
            // 2 x 1.96 sandwich errors, to the accuracy of 2000 replicates and of small samples.
            relative(high - low, 2.0 * 1.96 * p.standard_error.unwrap(), 0.1);
            assert!(low < p.value && p.value < high);
        }
        assert_eq!(fit(&line(), &m, &options, &on).unwrap(), found);
        let other = fit(&line(), &m, &Options { seed: 4, ..options }, &on).unwrap();
        assert_ne!(of(&other, "a").bootstrap, of(&found, "a").bootstrap);
    }

    #[test]
    fn threads_do_not_change_a_fit() {
        let options = Options { level: Some(0.9), bootstrap: Some(50), ..uniform() };
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| fit(&lobe(), &noisy_lobe(), &options, &on).unwrap())
        };
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn several_starts_find_the_deeper_minimum() {
        // A narrow peak at 0.7 and a wide, shallow one at 0.2 of cos theta: the search ends where it starts.
        let peak = |at: f64, width: f64, x: f64| (-((x - at) / width).powi(2)).exp();
        let m =
            measured(|wi, wo, _, _| 0.1 + peak(0.62, 0.02, wi.z * wo.z) + 0.2 * peak(0.9, 0.02, wi.z * wo.z));
        let model = Simple {
            parameters: vec![
                parameter("k", Kind::Coefficient, 0.5, 0.0, 2.0),
                parameter("base", Kind::Coefficient, 0.1, 0.0, 2.0),
                parameter("at", Kind::Shape, 0.9, 0.3, 0.95),
            ],
            formula: |wi, wo, p| {
                let d = (wi.z * wo.z - p[2]) / 0.02;
                let e = (-d * d).exp();
                (p[1] + p[0] * e, vec![e, 1.0, p[0] * e * 2.0 * d / 0.02])
            },
        };
        let one = fit(&model, &m, &Options { starts: 1, ..uniform() }, &on).unwrap();
        let many = fit(&model, &m, &Options { starts: 20, ..uniform() }, &on).unwrap();
        assert!((of(&one, "at").value - 0.9).abs() < 0.05, "{:?}", of(&one, "at"));
        assert!(
            (of(&many, "at").value - 0.62).abs() < 0.01 && many.chi2 < 0.5 * one.chi2,
            "{:?}",
            of(&many, "at")
        );
        assert!(many.agreeing_starts < many.starts && many.agreeing_starts > 0);
    }

    #[test]
    fn ties_bands_and_gains() {
        let model = lobe();
        let truth = [[0.3, 0.2, 25.0], [0.6, 0.1, 25.0]];
        let gains = [1.0, 1.7, 0.4];
        let mut m = measured_in(2, 3, |wi, wo, b, s| gains[s] * (model.formula)(wi, wo, &truth[b]).0);
        let options = Options { gains: true, level: Some(0.95), ..uniform() };
        let exact = fit(&model, &m, &options, &on).unwrap();
        for (name, value) in
            [("n", 25.0), ("kd[450 nm]", 0.3), ("ks[550 nm]", 0.1), ("gain[s1]", 1.7), ("gain[s2]", 0.4)]
        {
            relative(of(&exact, name).value, value, 1e-9);
        }
        assert_eq!(of(&exact, "gain[s0]").state, State::Fixed);
        assert!(
            exact.aic.is_none() && exact.messages[0] == "the readings are met exactly",
            "{:?}",
            exact.messages
        );
        let names: Vec<&str> = exact.parameters.iter().map(|p| p.name.as_str()).collect();
        let order =
            ["n", "kd[450 nm]", "ks[450 nm]", "kd[550 nm]", "ks[550 nm]", "gain[s0]", "gain[s1]", "gain[s2]"];
        assert_eq!(names, order);
        assert_eq!(exact.band_values(&model, 1).len(), 3);
        for (i, r) in m.readings.iter_mut().enumerate() {
            r.bsdf_per_sr *= 1.0 + 0.02 * wiggle(i);
        }
        // Ties that are true: the same minimum with fewer parameters; errors follow the factor.
        let tie = |to: &str, factor| Action::Tie { to: to.into(), factor };
        let parameters = vec![
            wish("kd[550 nm]", tie("kd[450 nm]", 2.0)),
            wish("ks[450 nm]", tie("kd[450 nm]", 2.0 / 3.0)),
        ];
        let tied = fit(&model, &m, &Options { parameters, ..options.clone() }, &on).unwrap();
        let (root, kd, ks) = (of(&tied, "kd[450 nm]"), of(&tied, "kd[550 nm]"), of(&tied, "ks[450 nm]"));
        assert_eq!((kd.state, tied.varied), (State::Tied, 5));
        relative(kd.value, 2.0 * root.value, 1e-14);
        relative(ks.value, root.value * 2.0 / 3.0, 1e-14);
        relative(kd.standard_error.unwrap(), 2.0 * root.standard_error.unwrap(), 1e-14);
        relative(kd.interval.unwrap().low.value(), 2.0 * root.interval.unwrap().low.value(), 1e-14);
        assert_eq!(kd.tie.as_deref(), Some("kd[450 nm] * 2"));
        relative(root.value, 0.3, 0.01);
        // Gains held: with the truth the same minimum, with nonsense a worse one.
        let held = vec![wish("gain[s1]", Action::Fix(1.7)), wish("gain[s2]", Action::Fix(0.4))];
        let good = fit(&model, &m, &Options { parameters: held, ..options }, &on).unwrap();
        let none = fit(&model, &m, &uniform(), &on).unwrap();
        assert!(good.chi2 < 1.01 * tied.chi2 && none.chi2 > 10.0 * good.chi2);
    }

    #[test]
    fn relative_errors_follow_the_model() {
        let m = noisy_lobe();
        let options =
            Options { relative_sigma: Some(0.02), covariance: Covariance::Absolute, ..Options::default() };
        let fit = fit(&lobe(), &m, &options, &on).unwrap();
        for (residual, (model, reading)) in fit.residuals.iter().zip(fit.modelled.iter().zip(&m.readings)) {
            assert!((residual - (model - reading.bsdf_per_sr) / (0.02 * model)).abs() < 1e-6);
        }
        let (v, _) = numbers(&fit);
        assert!(
            (v[0] / 0.3 - 1.0).abs() < 0.01 && (v[2] / 25.0 - 1.0).abs() < 0.05 && fit.converged,
            "{v:?}"
        );
        assert!(fit.weighting.contains("2 % of the model"), "{}", fit.weighting);
    }

    #[test]
    fn identical_lobes_are_undetermined() {
        let model = Simple {
            parameters: vec![
                parameter("kd", Kind::Coefficient, 0.2, -1.0, 1.0),
                parameter("k1", Kind::Coefficient, 0.1, 0.0, 1.0),
                parameter("k2", Kind::Coefficient, 0.1, 0.0, 1.0),
            ],
            formula: |wi, wo, p| {
                let c = (wi.z * wo.z).powi(4);
                (p[0] / PI + (p[1] + p[2]) * c, vec![1.0 / PI, c, c])
            },
        };
        let mut m = measured(|wi, wo, _, _| 0.1 + 0.3 * (wi.z * wo.z).powi(4));
        for (i, r) in m.readings.iter_mut().enumerate() {
            r.bsdf_per_sr += 0.002 * wiggle(i);
        }
        let start = vec![wish("k1", Action::Start(0.1)), wish("k2", Action::Start(0.1))];
        let found =
            fit(&model, &m, &Options { level: Some(0.95), parameters: start, ..uniform() }, &on).unwrap();
        assert_eq!([of(&found, "k1").state, of(&found, "k2").state], [State::Undetermined; 2], "{found:#?}");
        assert!(of(&found, "k1").standard_error.is_none() && of(&found, "k1").interval.is_some());
        assert!((of(&found, "k1").value + of(&found, "k2").value - 0.3).abs() < 0.005);
        assert!(found.messages.iter().any(|m| m.contains("only combinations") && m.ends_with("k1, k2")));
        // The rest is as if there were one lobe.
        let one = vec![wish("k2", Action::Fix(0.0))];
        let one = fit(&model, &m, &Options { parameters: one, ..uniform() }, &on).unwrap();
        relative(of(&found, "kd").value, of(&one, "kd").value, 1e-9);
        let freedom = (69.0f64 / 70.0).sqrt();
        relative(
            of(&found, "kd").standard_error.unwrap() * freedom,
            of(&one, "kd").standard_error.unwrap(),
            1e-9,
        );
    }

    #[test]
    fn poor_data_end_in_words() {
        let options = Options { level: Some(0.95), bootstrap: Some(20), ..Options::default() };
        let whole = noisy_lobe();
        let finite = |fit: &Fit| {
            let json = serde_json::to_string(fit).unwrap();
            assert!(fit.parameters.iter().all(|p| p.value.is_finite()) && fit.chi2.is_finite(), "{json}");
            assert!(fit.rmse_per_sr.is_finite() && fit.rmse_cube_root.is_finite());
        };
        // One point, two, three.
        for n in 1..=3 {
            let m = Measurement { readings: whole.readings[..n].to_vec(), ..whole.clone() };
            for covariance in [Covariance::Scaled, Covariance::Absolute, Covariance::Sandwich] {
                let fit = fit(&lobe(), &m, &Options { covariance, ..options.clone() }, &on).unwrap();
                finite(&fit);
                assert!(fit.reduced_chi2.is_none());
                assert!(
                    fit.messages.iter().any(|m| m.contains("cannot give 3 parameters")),
                    "{:?}",
                    fit.messages
                );
            }
        }
        // All zero, constant, perfect.
        let zero = fit(&lobe(), &measured(|_, _, _, _| 0.0), &options, &on).unwrap();
        finite(&zero);
        assert!(zero.r2.is_none() && zero.aic.is_none() && of(&zero, "kd").value == 0.0, "{zero:#?}");
        let constant = fit(&lobe(), &measured(|_, _, _, _| 0.1), &options, &on).unwrap();
        finite(&constant);
        assert!(constant.r2.is_none() && (of(&constant, "kd").value / PI - 0.1).abs() < 1e-9);
        let model = lobe();
        let perfect = measured(|wi, wo, _, _| (model.formula)(wi, wo, &[0.3, 0.2, 25.0]).0);
        let perfect = fit(&model, &perfect, &options, &on).unwrap();
        finite(&perfect);
        relative(of(&perfect, "n").value, 25.0, 1e-9);
        assert!(of(&perfect, "n").standard_error.unwrap() < 1e-9);
        // Nothing varied.
        let held = ["kd", "ks", "n"].map(|n| wish(n, Action::Fix(1.0))).to_vec();
        let held = fit(&model, &whole, &Options { parameters: held, ..options.clone() }, &on).unwrap();
        finite(&held);
        assert_eq!(
            (held.varied, held.messages[0].as_str()),
            (0, "nothing was varied: all parameters are held")
        );
        // Huge and tiny units.
        for unit in [1e-30, 1e30] {
            let mut m = whole.clone();
            m.readings.iter_mut().for_each(|r| r.bsdf_per_sr *= unit);
            finite(&fit(&model, &m, &options, &on).unwrap());
        }
    }

    #[test]
    fn wrong_input_is_named() {
        let m = noisy_lobe();
        let error = |m: &Measurement, o: Options| fit(&lobe(), m, &o, &on).unwrap_err().to_string();
        assert!(error(&Measurement::default(), uniform()).starts_with("readings: there are none"));
        type Damage = fn(&mut crate::gonio::Reading);
        let damages: [Damage; 6] = [
            |r| r.bsdf_per_sr = f64::NAN,
            |r| r.bsdf_per_sr = f64::INFINITY,
            |r| r.sigma_per_sr = Some(0.0),
            |r| r.wi.x = f64::NAN,
            |r| r.band = 7,
            |r| r.series = 7,
        ];
        for damage in damages {
            let mut m = m.clone();
            damage(&mut m.readings[5]);
            let e = error(&m, uniform());
            assert!(e.starts_with("readings[5]: its"), "{e}");
        }
        let tie = |to: &str, factor| Action::Tie { to: to.into(), factor };
        let wishes: [(Vec<Override>, &str); 12] = [
            (vec![wish("kx", Action::Fix(1.0))], "kx: no such parameter; this fit has n, kd, ks"),
            (vec![wish("kd", Action::Fix(0.1)), wish("kd", tie("ks", 1.0))], "kd: is given twice"),
            (vec![wish("kd", Action::Fix(3.0))], "kd: 3 is not in"),
            (vec![wish("kd", Action::Fix(f64::NAN))], "kd: NaN is not in"),
            (vec![wish("kd", Action::Bounds(0.5, 0.5))], "kd: lower bound 0.5 is not below"),
            (vec![wish("kd", Action::Bounds(0.0, 2.0))], "kd: bounds 0 to 2 reach outside"),
            (vec![wish("kd", Action::Start(2.0))], "kd: start 2 is not in its bounds 0 to 1"),
            (vec![wish("kd", tie("kd", 1.0))], "kd: is tied in a circle"),
            (vec![wish("kd", tie("ks", 1.0)), wish("ks", tie("kd", 1.0))], "kd: is tied in a circle"),
            (vec![wish("kd", tie("kx", 1.0))], "kd: is tied to `kx`"),
            (vec![wish("kd", tie("ks", f64::INFINITY))], "kd: factor inf"),
            (vec![wish("kd", tie("ks", -1.0))], "kd: its bounds leave no room for `ks`"),
        ];
        for (parameters, expected) in wishes {
            let e = error(&m, Options { parameters, ..uniform() });
            assert!(e.starts_with(expected), "{e} is not {expected}");
        }
        for (options, at) in [
            (Options { relative_sigma: Some(-0.1), ..Options::default() }, "relative_sigma"),
            (Options { relative_sigma: Some(0.1), ..uniform() }, "relative_sigma"),
            (Options { loss_scale: Some(0.0), ..uniform() }, "loss_scale"),
            (Options { level: Some(1.0), ..uniform() }, "level"),
            (Options { starts: 0, ..uniform() }, "starts"),
            (Options { bootstrap: Some(3), ..uniform() }, "bootstrap"),
            (Options { weights: Weights::Sigma, ..uniform() }, "weights"),
        ] {
            assert!(error(&m, options).starts_with(at), "{at}");
        }
    }

    #[test]
    fn the_caller_may_stop_it() {
        let stop =
            |done: u64, _: u64| if done > 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let result = fit(&lobe(), &noisy_lobe(), &uniform(), &stop);
        assert!(matches!(result, Err(crate::Error::Cancelled)));
    }
}

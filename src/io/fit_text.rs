//! Fits as text, in the layout that users of lmfit's `fit_report` know.
//!
//! Numbers in the columns take 11 characters. What a fit does not have (an error at a bound, a criterion of an exact fit)
//! is left out or said in words: the text never holds NaN or inf.

use std::fmt::Write as _;

use crate::fit::audit::Covered;
use crate::fit::report;
use crate::fit::{Audit, End, Fit, Fitted, Report, State};

/// Correlations below this are left out.
pub const MIN_CORRELATION: f64 = 0.1;

/// The whole report: data, comparison where there is one, every fit with its audit.
pub fn report(report: &Report, min_correlation: f64) -> String {
    let data = &report.data;
    let mut out = String::from("[[Data]]\n");
    let mut line = |name: &str, value: String| out.push_str(&format!("    {name:<19}= {value}\n"));
    line("file", data.file.clone());
    line("sha256", data.sha256.clone());
    if !data.sample.is_empty() {
        line("sample", data.sample.clone());
    }
    line("quantity", data.quantity.clone());
    let lamps: Vec<String> = data.lamps.iter().map(|l| format!("{}", round(l.incident_deg))).collect();
    line(
        "readings",
        format!(
            "{} ({} bands, {} series, lamp at {} deg)",
            data.readings,
            data.bands.len(),
            data.series.len(),
            shortened(&lamps, 12)
        ),
    );
    data.notes.iter().for_each(|n| line("note", n.clone()));
    if report.fits.len() > 1 {
        let _ = write!(out, "[[Models]]\n{}", indented(&ladder(&report.fits)));
    }
    for fit in &report.fits {
        out.push_str(&fit_report(fit, min_correlation));
        if let Some(found) = report.audit(&fit.model) {
            out.push_str(&audit(found));
        }
    }
    out
}

/// One fit: statistics, variables, intervals, messages, correlations of at least `min_correlation`.
pub fn fit_report(fit: &Fit, min_correlation: f64) -> String {
    let mut out = format!("[[Model]]\n    {}\n[[Fit Statistics]]\n", fit.model);
    let mut line = |name: &str, value: &str| {
        let _ = writeln!(out, "    {name:<19}= {value}");
    };
    line("# fitting method", &fit.method);
    line("# weights", &fit.weighting);
    line("# function evals", &fit.evaluations.to_string());
    line("# starts", &format!("{} ({} ended at the same minimum)", fit.starts, fit.agreeing_starts));
    line("# data points", &fit.n.to_string());
    line("# variables", &fit.varied.to_string());
    for (name, value) in [
        ("chi-square", Some(fit.chi2)),
        ("reduced chi-square", fit.reduced_chi2),
        ("Akaike info crit", fit.aic),
        ("Bayesian info crit", fit.bic),
        ("R-squared", fit.r2),
        ("RMSE, 1/sr", Some(fit.rmse_per_sr)),
        ("RMSE, cube root", Some(fit.rmse_cube_root)),
    ] {
        line(name, &value.and_then(fixed).unwrap_or_else(|| "not defined".into()));
    }
    if !fit.converged {
        out.push_str("    The search did not end at a minimum.\n");
    }
    if !fit.messages.is_empty() {
        out.push_str("[[Messages]]\n");
        fit.messages.iter().for_each(|m| out.push_str(&format!("    {m}\n")));
    }
    variables(&mut out, fit);
    intervals(&mut out, fit);
    correlations(&mut out, fit, min_correlation);
    out
}

/// Length of the longest name with its colon.
fn name_width(fit: &Fit) -> usize {
    fit.parameters.iter().map(|p| p.name.chars().count()).max().unwrap_or(0) + 1
}

fn variables(out: &mut String, fit: &Fit) {
    out.push_str("[[Variables]]\n");
    let width = name_width(fit);
    for p in &fit.parameters {
        let value = fixed(p.value).unwrap_or_else(|| "not defined".into());
        let _ = writeln!(out, "    {:<width$} {value}{}", format!("{}:", p.name), remarks(p));
    }
}

/// What follows a parameter's value.
fn remarks(p: &Fitted) -> String {
    let start = fixed(p.start).map(|_| format!(" (init = {})", general(p.start, 7))).unwrap_or_default();
    let bound = |which: &str, at: f64| format!(" at its {which} bound {}{start}", general(at, 7));
    match p.state {
        State::Fixed => " (fixed)".into(),
        State::Tied => format!(" (tied: {})", p.tie.as_deref().unwrap_or("to another")),
        State::AtLower => bound("lower", p.min),
        State::AtUpper => bound("upper", p.max),
        State::Undetermined => format!(" (not determined by the data){start}"),
        State::Free => match p.standard_error.and_then(|s| fixed(s).map(|text| (s, text))) {
            Some((s, text)) => format!(" +/- {}{}{start}", text.trim_start(), percent(s, p.value)),
            None => start,
        },
    }
}

/// ` (1.23%)`: an error as a share of its value, where there is one.
fn percent(error: f64, value: f64) -> String {
    let share = 100.0 * (error / value).abs();
    if share.is_finite() { format!(" ({share:.2}%)") } else { String::new() }
}

fn intervals(out: &mut String, fit: &Fit) {
    let width = name_width(fit);
    let shown: Vec<_> = fit.parameters.iter().filter_map(|p| p.interval.map(|i| (p, i))).collect();
    if let Some((_, first)) = shown.first() {
        let _ = writeln!(out, "[[Intervals]] (profile likelihood, {}%)", general(100.0 * first.level, 4));
        for (p, i) in &shown {
            let end = |end: End, sign: char, which: &str| match end {
                End::Limit(v) => format!("{sign}{}", general((v - p.value).abs(), 4)),
                End::Bound(v) => format!("{sign}{} ({which} bound)", general((v - p.value).abs(), 4)),
            };
            let value = fixed(p.value).unwrap_or_else(|| "not defined".into());
            let (low, high) = (end(i.low, '-', "lower"), end(i.high, '+', "upper"));
            let _ = writeln!(out, "    {:<width$} {value} {low} {high}", format!("{}:", p.name));
        }
    }
    let shown: Vec<_> = fit.parameters.iter().filter_map(|p| p.bootstrap.map(|b| (p, b))).collect();
    if !shown.is_empty() {
        out.push_str("[[Bootstrap]] (percentile intervals)\n");
        for (p, [low, high]) in shown {
            let (low, high) = (general(low, 6), general(high, 6));
            let _ = writeln!(out, "    {:<width$} {low} to {high}", format!("{}:", p.name));
        }
    }
}

fn correlations(out: &mut String, fit: &Fit, min_correlation: f64) {
    let mut shown: Vec<_> = fit
        .correlations
        .iter()
        .filter(|c| c.correlation.is_finite() && c.correlation.abs() >= min_correlation)
        .filter_map(|c| Some((fit.parameters.get(c.a)?, fit.parameters.get(c.b)?, c.correlation)))
        .collect();
    if shown.is_empty() {
        return;
    }
    shown.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
    let _ = writeln!(out, "[[Correlations]] (unreported correlations are < {min_correlation:.3})");
    let names: Vec<String> = shown.iter().map(|(a, b, _)| format!("C({}, {})", a.name, b.name)).collect();
    let width = names.iter().map(|n| n.chars().count()).max().unwrap_or(0);
    for (name, (_, _, c)) in names.iter().zip(&shown) {
        let _ = writeln!(out, "    {name:<width$} = {c:+.4}");
    }
}

/// An audit: totals per incidence, and what they and the reversed directions say.
pub fn audit(audit: &Audit) -> String {
    let mut out = String::new();
    for band in &audit.bands {
        let _ = writeln!(out, "[[Audit]] ({}, {})", audit.model, band.band);
        let header = ["lamp deg", "R", "T", "R+T", "error", "readings cover", "measured", "model"];
        let mut rows = vec![header.map(str::to_owned).to_vec()];
        for t in &band.totals {
            let side = if t.side == crate::geometry::Side::Abaxial { " abaxial" } else { "" };
            let mut row = vec![
                format!("{}{}{side}", round(t.incident_deg), if t.measured { "*" } else { "" }),
                decimal(t.reflectance),
                decimal(t.transmittance),
                decimal(t.total()),
                format!("{:.0e}", finite(t.error)),
            ];
            let covered = [t.reflected_readings, t.transmitted_readings];
            for part in [
                |c: &Covered| format!("{:.0}%", 100.0 * c.share),
                |c: &Covered| decimal(c.measured),
                |c: &Covered| decimal(c.modelled),
            ] {
                let texts: Vec<String> = covered.iter().flatten().map(part).collect();
                row.push(texts.join("/"));
            }
            rows.push(row);
        }
        out.push_str(&indented(&table(&rows, 0)));
        if band.totals.iter().any(|t| t.measured) {
            out.push_str(
                "    (* the lamp was there; covered, measured, model: over the part that readings cover)\n",
            );
        }
        if let Some(worst) = band.totals.get(band.largest) {
            let verdict = if band.conserves_energy {
                "energy is conserved".to_owned()
            } else {
                format!("ENERGY IS NOT CONSERVED, {} too much", decimal(worst.total() - 1.0))
            };
            let (total, at) = (decimal(worst.total()), round(worst.incident_deg));
            let _ = writeln!(out, "    largest total {total} at {at} deg: {verdict}");
        }
        let [ta, pa, tb, pb] = band.asymmetry_at_deg.map(|a| a.round());
        let difference = format!("{:.1e}", finite(band.largest_asymmetry));
        let verdict = if band.is_reciprocal {
            "reciprocal".to_owned()
        } else {
            format!("NOT RECIPROCAL, worst for ({ta}, {pa}) and ({tb}, {pb}) deg")
        };
        let _ = writeln!(out, "    largest relative |f(a,b) - f(b,a)| {difference}: {verdict}");
    }
    out
}

/// The comparison of models: one row each, in the order given; the best has a star.
pub fn ladder(fits: &[Fit]) -> String {
    let header = ["model", "params", "N", "RMSE 1/sr", "RMSE cbrt", "red. chi2", "AIC", "BIC", "delta AIC"];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    let optional = |x: Option<f64>, decimals: usize| x.map_or("-".to_owned(), |x| format!("{x:.decimals$}"));
    for row in report::ladder(fits) {
        let remark = if row.best { " *" } else { "" };
        let unsure = if row.converged { "" } else { " (not converged)" };
        rows.push(vec![
            format!("{}{remark}{unsure}", row.model),
            row.parameters.to_string(),
            row.n.to_string(),
            general(row.rmse_per_sr, 4),
            general(row.rmse_cube_root, 4),
            row.reduced_chi2.map_or("-".into(), |x| general(x, 4)),
            optional(row.aic, 1),
            optional(row.bic, 1),
            optional(row.delta_aic, 1),
        ]);
    }
    let mut out = table(&rows, 1);
    if rows.iter().any(|r| r[0].contains(" *")) {
        out.push_str("* lowest AIC\n");
    }
    out
}

/// Rows as columns: the first `left` columns flush left, the others flush right.
fn table(rows: &[Vec<String>], left: usize) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |c: usize| rows.iter().filter_map(|r| r.get(c)).map(|s| s.chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut out = String::new();
    for row in rows {
        let cells: Vec<String> = row
            .iter()
            .zip(&widths)
            .enumerate()
            .map(
                |(c, (cell, &width))| {
                    if c < left { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
                },
            )
            .collect();
        out.push_str(cells.join("  ").trim_end());
        out.push('\n');
    }
    out
}

fn indented(text: &str) -> String {
    text.lines().map(|l| format!("    {l}\n")).collect()
}

/// The first `limit` and the last of many, with dots between.
fn shortened(items: &[String], limit: usize) -> String {
    match items {
        [first @ .., last] if items.len() > limit => {
            format!("{}, ..., {last}", first[..limit - 1].join(", "))
        }
        _ => items.join(", "),
    }
}

/// Angles without the noise of arithmetic.
pub(super) fn round(x: f64) -> f64 {
    // Adding zero turns -0 into 0.
    (x * 1e4).round() / 1e4 + 0.0
}

fn finite(x: f64) -> f64 {
    if x.is_finite() { x } else { f64::MAX }
}

/// Four decimals.
fn decimal(x: f64) -> String {
    if x.is_finite() { format!("{x:.4}") } else { "-".into() }
}

/// A number in 11 characters: plain where that shows its digits, else with an exponent. `None` where it is not finite.
pub(super) fn fixed(x: f64) -> Option<String> {
    if !x.is_finite() {
        return None;
    }
    let exponent = if x == 0.0 { 0 } else { x.abs().log10().floor() as i32 };
    let text = if (-4..8).contains(&exponent) {
        // Sign, digits before the point, the point.
        format!("{x:.*}", (8 - exponent.max(0)) as usize)
    } else {
        with_exponent(x, 4)
    };
    Some(format!("{text:>11}"))
}

/// A number with `digits` significant digits, without trailing zeros where it has no exponent; `-` where it is not finite.
pub(super) fn general(x: f64, digits: usize) -> String {
    if !x.is_finite() {
        return "-".into();
    }
    if x == 0.0 {
        return "0".into();
    }
    let digits = digits.max(1);
    // The exponent after rounding: 9.99 with two digits is 10.
    let rounded = format!("{x:.*e}", digits - 1);
    let exponent: i32 = rounded.split_once('e').and_then(|(_, e)| e.parse().ok()).unwrap_or(0);
    if !(-4..digits.max(6) as i32).contains(&exponent) {
        return with_exponent(x, digits - 1);
    }
    let text = format!("{x:.*}", (digits as i32 - 1 - exponent).max(0) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// `1.2346e-05`.
fn with_exponent(x: f64, decimals: usize) -> String {
    let text = format!("{x:.decimals$e}");
    match text.split_once('e') {
        Some((mantissa, exponent)) => {
            let (sign, digits) = match exponent.strip_prefix('-') {
                Some(digits) => ('-', digits),
                None => ('+', exponent),
            };
            format!("{mantissa}e{sign}{digits:0>2}")
        }
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::DataInfo;
    use crate::fit::toy::{self, Toy};
    use crate::gonio::{Band, Measurement};

    /// A fit with every state, and numbers that were made up.
    fn fit() -> Fit {
        let toy = Toy::new(1.0);
        let bands = Measurement { bands: vec![Band::nm(550.0)], ..Default::default() };
        let mut fit = toy::fit(&toy, &bands, &[0.3, 0.0, 0.05, 18.5]);
        fit.parameters[1].bootstrap = Some([0.2912, 0.3089]);
        fit.parameters[3].state = State::Tied;
        fit.parameters[3].tie = Some("kd * 0.5".into());
        fit.parameters[3].interval = None;
        fit.correlations[0].correlation = 0.05;
        fit.messages = vec!["ks[550 nm] ended at its lower bound.".into()];
        Fit {
            n: 42,
            varied: 2,
            chi2: 0.0123,
            reduced_chi2: Some(3.075e-4),
            aic: Some(-337.7312),
            bic: Some(-334.2559),
            r2: Some(0.98765),
            rmse_per_sr: 0.0171,
            rmse_cube_root: 1.5e-5,
            ..fit
        }
    }

    #[test]
    fn the_layout_is_that_of_fit_report() {
        let expected = "\
[[Model]]
    toy
[[Fit Statistics]]
    # fitting method   = bounded Levenberg-Marquardt
    # weights          = uniform
    # function evals   = 124
    # starts           = 8 (7 ended at the same minimum)
    # data points      = 42
    # variables        = 2
    chi-square         =  0.01230000
    reduced chi-square =  0.00030750
    Akaike info crit   = -337.731200
    Bayesian info crit = -334.255900
    R-squared          =  0.98765000
    RMSE, 1/sr         =  0.01710000
    RMSE, cube root    =  1.5000e-05
[[Messages]]
    ks[550 nm] ended at its lower bound.
[[Variables]]
    n:           18.5000000 +/- 0.18500000 (1.00%) (init = 10)
    kd[550 nm]:  0.30000000 +/- 0.00300000 (1.00%) (init = 0.2)
    ks[550 nm]:  0.00000000 at its lower bound 0 (init = 0.1)
    kt[550 nm]:  0.05000000 (tied: kd * 0.5)
[[Intervals]] (profile likelihood, 95%)
    n:           18.5000000 -0.37 +0.3895
    kd[550 nm]:  0.30000000 -0.006 +0.0073
    ks[550 nm]:  0.00000000 -0 (lower bound) +0.001
[[Bootstrap]] (percentile intervals)
    kd[550 nm]: 0.2912 to 0.3089
[[Correlations]] (unreported correlations are < 0.100)
    C(kd[550 nm], kt[550 nm]) = +0.9589
    C(n, kt[550 nm])          = -0.3000
";
        let mut fit = fit();
        fit.correlations[1].correlation = -0.3;
        assert_eq!(fit_report(&fit, MIN_CORRELATION), expected);
    }

    #[test]
    fn the_ladder_is_aligned_and_marks_the_best() {
        let good = fit();
        let mut poor = fit();
        (poor.model, poor.aic, poor.rmse_per_sr) = ("lambert+phong".into(), Some(-20.0), 0.123_456);
        (poor.reduced_chi2, poor.converged) = (None, false);
        let expected = "\
model                          params   N  RMSE 1/sr  RMSE cbrt   red. chi2     AIC     BIC  delta AIC
lambert+phong (not converged)       2  42     0.1235   1.500e-05           -   -20.0  -334.3      317.7
toy *                               2  42     0.0171   1.500e-05  0.0003075  -337.7  -334.3        0.0
* lowest AIC
";
        let text = ladder(&[poor, good]);
        let words = |s: &str| s.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(words(&text), words(expected));
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[..3].iter().all(|l| l.len() == lines[0].len()), "{text}");
    }

    #[test]
    fn degenerate_fits_have_no_nan() {
        let mut fit = fit();
        (fit.reduced_chi2, fit.aic, fit.bic, fit.r2) = (None, Some(f64::NAN), None, None);
        (fit.chi2, fit.rmse_per_sr) = (f64::NEG_INFINITY, f64::NAN);
        for p in &mut fit.parameters {
            (p.value, p.standard_error, p.state) = (f64::NAN, Some(f64::INFINITY), State::Free);
            p.bootstrap = Some([f64::NAN; 2]);
        }
        fit.parameters[0].value = 0.0;
        fit.parameters[2].state = State::Undetermined;
        fit.correlations[0].correlation = f64::NAN;
        let empty = Fit { parameters: Vec::new(), correlations: Vec::new(), ..fit.clone() };
        for fit in [fit, empty] {
            let data = DataInfo::new("a.csv", b"", "BSDF", &Measurement::default());
            let text =
                super::report(&Report::new(None, data, vec![fit.clone(), fit], Vec::new()), MIN_CORRELATION);
            let lower = text.to_lowercase();
            assert!(
                !lower.contains("nan") && !lower.split_whitespace().any(|w| w.contains("inf") && w != "info"),
                "{text}"
            );
        }
    }

    #[test]
    fn an_audit_says_where_a_law_is_broken() {
        let toy = Toy::new(0.9);
        let m = toy::measurement(&toy, &[0.7, 0.0, 0.5, 1.0], &[20.0], &[550.0], &["a"]);
        let fit = toy::fit(&toy, &m, &[0.7, 0.0, 0.5, 1.0]);
        let found = Audit::new(&toy, &fit, &m, &vec![0.03; m.readings.len()]).unwrap();
        let text = audit(&found);
        for part in ["20*", "ENERGY IS NOT CONSERVED", "NOT RECIPROCAL", "81%", "80 "] {
            assert!(text.contains(part), "{part}: {text}");
        }
        let toy = Toy::new(1.0);
        let text = audit(&Audit::new(&toy, &toy::fit(&toy, &m, &[0.3, 0.1, 0.2, 9.0]), &m, &[]).unwrap());
        assert!(text.contains("energy is conserved") && text.contains(": reciprocal"), "{text}");
    }

    #[test]
    fn numbers_keep_their_width() {
        for (x, text) in [
            (0.0, " 0.00000000"),
            (-0.5, "-0.50000000"),
            (12_345.678, " 12345.6780"),
            (12_345_678.0, " 12345678.0"),
            (1e-4, " 0.00010000"),
            (-1.5e-5, "-1.5000e-05"),
            (6.02e123, "6.0200e+123"),
            (f64::MAX, "1.7977e+308"),
        ] {
            assert_eq!(fixed(x).unwrap(), text);
        }
        for (x, text) in [
            (0.0, "0"),
            (9.999, "10"),
            (0.000_123_45, "0.000123"),
            (1234.5, "1234"),
            (1e9, "1.00e+09"),
            (-2e-7, "-2.00e-07"),
        ] {
            assert_eq!(general(x, 3), text);
        }
    }
}

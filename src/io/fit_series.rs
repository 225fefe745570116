//! Several samples, each fitted by the same models: one row per model over all of them, as text.
//!
//! RMSE columns are means over the samples; AIC and BIC are sums, which is what they are for independent samples; `best`
//! counts the samples in which a model's AIC is the lowest. Guarded by `rows_are_means_and_sums`.

use std::fmt::Write as _;

use crate::fit::{LadderRow, Report};

/// Means and sums over the samples, aligned.
pub fn over_series(reports: &[Report]) -> String {
    let Some(first) = reports.first() else { return String::new() };
    let mut out = format!("== all {} samples: means of RMSE, sums of AIC and BIC\n", reports.len());
    let width = first.ladder.iter().map(|r| r.model.len()).max().unwrap_or(5).max(5);
    let _ = writeln!(
        out,
        "{:<width$}  {:>10}  {:>10}  {:>10}  {:>10}  {:>5}",
        "model", "RMSE 1/sr", "RMSE cbrt", "AIC", "BIC", "best"
    );
    for model in first.ladder.iter().map(|r| &r.model) {
        let rows: Vec<&LadderRow> =
            reports.iter().filter_map(|r| r.ladder.iter().find(|row| row.model == *model)).collect();
        let n = rows.len().max(1) as f64;
        let mean = |value: fn(&LadderRow) -> f64| rows.iter().map(|r| value(r)).sum::<f64>() / n;
        let sum = |value: fn(&LadderRow) -> Option<f64>| {
            let total = rows.iter().map(|r| value(r)).sum::<Option<f64>>();
            total.map_or("-".to_owned(), |v| format!("{v:.1}"))
        };
        let _ = writeln!(
            out,
            "{model:<width$}  {:>10.6}  {:>10.6}  {:>10}  {:>10}  {:>5}",
            mean(|r| r.rmse_per_sr),
            mean(|r| r.rmse_cube_root),
            sum(|r| r.aic),
            sum(|r| r.bic),
            rows.iter().filter(|r| r.best).count()
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::DataInfo;
    use crate::gonio::Measurement;

    fn row(model: &str, rmse_per_sr: f64, aic: Option<f64>, best: bool) -> LadderRow {
        LadderRow {
            model: model.into(),
            parameters: 3,
            n: 10,
            rmse_per_sr,
            rmse_cube_root: 2.0 * rmse_per_sr,
            reduced_chi2: None,
            aic,
            bic: aic,
            delta_aic: None,
            best,
            converged: true,
        }
    }

    #[test]
    fn rows_are_means_and_sums() {
        let info = DataInfo::new("t.csv", b"", "bsdf", &Measurement::default());
        let report = |ladder| Report { ladder, ..Report::new(None, info.clone(), Vec::new(), Vec::new()) };
        let reports = [
            report(vec![row("lambert", 0.02, Some(-10.0), false), row("terado", 0.01, Some(-30.0), true)]),
            report(vec![row("lambert", 0.04, Some(-20.0), true), row("terado", 0.03, None, false)]),
        ];
        let text = over_series(&reports);
        let lines: Vec<Vec<&str>> = text.lines().map(|l| l.split_whitespace().collect()).collect();
        assert_eq!(lines[2], ["lambert", "0.030000", "0.060000", "-30.0", "-30.0", "1"]);
        assert_eq!(lines[3], ["terado", "0.020000", "0.040000", "-", "-", "1"]);
        assert!(over_series(&[]).is_empty());
    }
}

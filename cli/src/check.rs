//! `rosarium check`.

use std::fmt::Write;

use rayon::prelude::*;
use rosarium::validate::{self, Report, Settings, Test, check_bsdf, check_petal, wrong};
use rosarium::{Error, Result};
use serde_json::json;

use crate::{Global, Outcome, output, progress};

/// Check every shipped model of scattering against the conformance suite.
///
/// Models that are wrong on purpose are checked too: the suite must reject each of them for its own fault.
/// Exit code 1 if a model fails that should pass, or passes that should fail.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Tests: chi_square (sample draws from pdf), pdf_integral, sample (agrees with eval and pdf), weight (its mean
is the albedo), reciprocity, energy (never more light out than in), grazing (finite near the horizon).

Examples:
  rosarium check
  rosarium check --json | jq '.models[] | select(.as_expected | not)'")]
pub(crate) struct Args {
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
}

/// A model's report and what was expected of it.
struct Verdict {
    name: String,
    report: Report,
    /// The test that must fail, and why.
    flaw: Option<(Test, &'static str)>,
    as_expected: bool,
}

pub(crate) fn run(args: &Args, global: Global) -> Result<Outcome> {
    let settings = Settings::default();
    let mut models = validate::shipped()?;
    models.extend(wrong::all());
    let bar = progress::Bar::new("check");
    let petals = validate::shipped_petals()?;
    let tables = validate::shipped_tables()?;
    let total = (models.len() + petals.len() + tables.len()) as u64;
    let done = std::sync::atomic::AtomicU64::new(0);
    let count = || bar.show(1 + done.fetch_add(1, std::sync::atomic::Ordering::Relaxed), total);
    let mut verdicts: Vec<Verdict> = models
        .par_iter()
        .map(|model| {
            if progress::stopped() {
                return Err(Error::Cancelled);
            }
            let report = check_bsdf(model.name, &*model.bsdf, &settings);
            count();
            Ok(Verdict {
                name: model.name.to_owned(),
                as_expected: model.is_as_expected(&report),
                flaw: model.expected_to_fail.map(|f| (f.test, f.reason)),
                report,
            })
        })
        .collect::<Result<_>>()?;
    let checked: Vec<Verdict> = petals
        .par_iter()
        .map(|(name, petal)| {
            if progress::stopped() {
                return Err(Error::Cancelled);
            }
            let name = format!("petal {name}");
            let report = check_petal(&name, petal, &settings);
            count();
            Ok(Verdict { name, as_expected: report.passed(), flaw: None, report })
        })
        .collect::<Result<_>>()?;
    verdicts.extend(checked);
    let checked: Vec<Verdict> = tables
        .par_iter()
        .map(|(name, petal)| {
            if progress::stopped() {
                return Err(Error::Cancelled);
            }
            let name = format!("tables {name}");
            let report = check_bsdf(&name, petal, &Settings::for_tables());
            count();
            Ok(Verdict { name, as_expected: report.passed(), flaw: None, report })
        })
        .collect::<Result<_>>()?;
    verdicts.extend(checked);
    drop(bar);

    let failures = verdicts.iter().filter(|v| !v.as_expected).count();
    let text = if args.json { for_programs(&verdicts, failures) } else { for_people(&verdicts, failures) };
    output::print(text.as_bytes())?;
    if failures > 0 {
        progress::say(global, &format!("{failures} models are not as expected"));
        return Ok(Outcome::CheckFailed);
    }
    Ok(Outcome::Done)
}

/// One line per model, one column per test. Writing to a String cannot fail.
fn for_people(verdicts: &[Verdict], failures: usize) -> String {
    let mut out = String::new();
    let width = verdicts.iter().map(|v| v.name.len()).max().unwrap_or(0);
    let _ = write!(out, "{:width$}", "");
    for test in Test::ALL {
        let _ = write!(out, "  {}", test.name());
    }
    out.push('\n');
    for v in verdicts {
        let _ = write!(out, "{:width$}", v.name);
        for test in Test::ALL {
            let word = match v.report.row(test) {
                None => "-",
                Some(row) if row.passed => "ok",
                Some(_) => "FAIL",
            };
            let _ = write!(out, "  {word:<w$}", w = test.name().len());
        }
        let verdict = match (v.flaw, v.as_expected) {
            (None, true) => "passed".to_owned(),
            (None, false) => "FAILED".to_owned(),
            (Some((_, reason)), true) => format!("rejected, as it must be: {reason}"),
            (Some((test, _)), false) => format!("NOT REJECTED by {}", test.name()),
        };
        let _ = writeln!(out, "  {verdict}");
    }
    for v in verdicts.iter().filter(|v| !v.as_expected) {
        for row in v.report.rows.iter().filter(|r| v.flaw.is_some() || !r.passed) {
            let _ = writeln!(
                out,
                "\n{}: {} = {:.4e}, bound {:.4e}: {}",
                v.name,
                row.test.name(),
                row.statistic,
                row.tolerance,
                row.detail
            );
        }
    }
    let sound = verdicts.iter().filter(|v| v.flaw.is_none() && v.as_expected).count();
    let flawed = verdicts.iter().filter(|v| v.flaw.is_some() && v.as_expected).count();
    let _ = writeln!(out, "\n{sound} passed, {flawed} rejected as they must be, {failures} not as expected");
    out
}

fn for_programs(verdicts: &[Verdict], failures: usize) -> String {
    let models: Vec<_> = verdicts
        .iter()
        .map(|v| {
            let rows: Vec<_> = v.report.rows.iter().map(|r| {
                json!({ "test": r.test.name(), "passed": r.passed, "statistic": r.statistic, "tolerance": r.tolerance, "detail": r.detail })
            }).collect();
            json!({
                "name": v.name,
                "passed": v.report.passed(),
                "must_fail": v.flaw.map(|(test, _)| test.name()),
                "as_expected": v.as_expected,
                "tests": rows,
            })
        })
        .collect();
    format!("{}\n", json!({ "models": models, "not_as_expected": failures }))
}

//! What a fit leaves: text, reports, plots and a petal.

use rosarium::fit::Model;
use rosarium::fit::report::Report;
use rosarium::gonio::Measurement;
use rosarium::io::fit_plot::{self, FittedModel};
use rosarium::io::picture::Picture;
use rosarium::io::residual_map::residual_map;
use rosarium::io::{fit_html, fit_series, fit_text};
use rosarium::scene::fitted;
use rosarium::{Error, Result};

use crate::cell_model::CellArgs;
use crate::output::Output;
use crate::{Global, progress};

/// The report as text.
pub(crate) fn text(reports: &[Report], compare: bool, min_correlation: f64) -> String {
    let mut out = String::new();
    for report in reports {
        if reports.len() > 1 {
            out.push_str(&format!("== {}\n", report.data.sample));
        }
        if compare {
            // The ladder answers the question; the rest is in the report.
            out.push_str(&fit_text::ladder(&report.fits));
        } else {
            out.push_str(&fit_text::report(report, min_correlation));
        }
        out.push('\n');
    }
    if reports.len() > 1 {
        out.push_str(&fit_series::over_series(reports));
    }
    out
}

/// The reports as JSON.
pub(crate) fn json(reports: &[Report]) -> Result<String> {
    let mut text = match reports {
        [one] => one.to_json()?,
        all => serde_json::to_string_pretty(all).map_err(|e| Error::invalid("--json", e.to_string()))?,
    };
    text.push('\n');
    Ok(text)
}

/// One file of reports.
pub(crate) fn write_report(
    output: &Output,
    reports: &[Report],
    parts: &[Measurement],
    models: &[Box<dyn Model>],
    min_correlation: f64,
    global: Global,
) -> Result<()> {
    let write = |output: &Output, content: &str| -> Result<()> {
        output.write(content.as_bytes())?;
        progress::say(global, &format!("{}: report", output.path().display()));
        Ok(())
    };
    match output.format {
        "json" => write(output, &json(reports)?),
        "txt" => write(output, &text(reports, false, min_correlation)),
        _ => {
            let models: Vec<&dyn Model> = models.iter().map(|m| &**m).collect();
            for (report, part) in reports.iter().zip(parts) {
                let page = fit_html::page(report, part, &models)?;
                if reports.len() == 1 {
                    write(output, &page)?;
                } else {
                    // A page holds one sample: the others stand beside it.
                    write(&output.beside(&file_name(&report.data.sample))?, &page)?;
                }
            }
            Ok(())
        }
    }
}

/// A series' name as part of a file's.
fn file_name(series: &str) -> String {
    series.chars().map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' }).collect()
}

/// The fitted petal, with where it comes from.
pub(crate) fn write_petal(
    output: &Output,
    report: &Report,
    part: &Measurement,
    cells: &CellArgs,
    global: Global,
) -> Result<()> {
    let Some(fit) = report.fits.first() else { return Ok(()) };
    let petal = fitted::petal(fit, part, &cells.description()?)?;
    let text = fitted::to_toml(&petal, fit, &report.data, report.command.as_deref())?;
    output.write(text.as_bytes())?;
    progress::say(global, &format!("{}: petal", output.path().display()));
    Ok(())
}

/// Readings and models in the planes of incidence: one model in several bands, or several models in the middle one.
pub(crate) fn plot(report: &Report, part: &Measurement, models: &[Box<dyn Model>]) -> Result<Picture> {
    let fitted: Vec<FittedModel> =
        models.iter().zip(&report.fits).map(|(model, fit)| FittedModel { model: &**model, fit }).collect();
    let picture = match fitted.as_slice() {
        [only] => fit_plot::in_plane(part, *only)?,
        several => fit_plot::compare(part, several, part.bands.len() / 2)?,
    };
    picture.ok_or_else(|| Error::invalid("--plot", "no reading lies in a plane of incidence"))
}

/// Residuals of the best fit over the hemisphere.
pub(crate) fn residuals(report: &Report, part: &Measurement) -> Result<Picture> {
    let best = report.ladder.iter().position(|r| r.best).unwrap_or(0);
    let picture = report.fits.get(best).and_then(|fit| residual_map(part, fit));
    picture.ok_or_else(|| Error::invalid("--residuals", "there is no reading"))
}

/// Plots, each in the format of its file.
pub(crate) fn write_pictures(outputs: &[Output], picture: &Picture, global: Global) -> Result<()> {
    for output in outputs {
        let bytes = if output.format == "svg" { picture.svg().into_bytes() } else { picture.png()? };
        output.write(&bytes)?;
        progress::say(global, &format!("{}: plot", output.path().display()));
    }
    Ok(())
}

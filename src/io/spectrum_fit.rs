//! A fitted reflectance spectrum as text, as a table and as a picture.
//!
//! - Text: a row per parameter with its standard error, then how well the model meets the data. What is not known is said
//!   in words.
//! - Table (CSV): wavelength, measured, model, residual.
//! - Picture: measured and modelled reflectance over the wavelength, and the residuals below.

use std::fmt::Write as _;

use kuva::prelude::{Figure, Layout, LinePlot, Plot};
use kuva::render::figure::FigureLegendPosition;

use super::picture::{COLORS, GREY, Picture, label, line_entry};
use crate::fit::State;
use crate::fit::spectrum::SpectrumFit;

const PANEL_PX: (f64, f64) = (620.0, 360.0);

/// The parameters with their standard errors, and the quality of the fit.
pub fn text(fit: &SpectrumFit) -> String {
    let mut out = String::from("parameter                      value   standard error\n");
    for p in &fit.parameters {
        let error = match (p.state, p.standard_error) {
            (_, Some(e)) => format!("{e:.4}"),
            (State::Fixed, _) => "held".to_owned(),
            (State::AtLower, _) => "at its lower bound".to_owned(),
            (State::AtUpper, _) => "at its upper bound".to_owned(),
            _ => "not determined".to_owned(),
        };
        // Writing to a String cannot fail.
        let _ = writeln!(out, "{:<24} {:>11.4}   {error}", p.name, p.value);
    }
    let (first, last) = (fit.wavelengths_nm.first(), fit.wavelengths_nm.last());
    if let (Some(first), Some(last)) = (first, last) {
        let _ = writeln!(out, "{} wavelengths from {first} to {last} nm", fit.wavelengths_nm.len());
    }
    let _ = writeln!(
        out,
        "RMSE {:.5}, correlation of neighbouring residuals {:.3}",
        fit.rmse, fit.neighbour_correlation
    );
    let (agreeing, starts) = fit.agreeing_starts;
    let _ = writeln!(
        out,
        "{starts} starts, {agreeing} ended at the same minimum; {} evaluations",
        fit.evaluations
    );
    if !fit.converged {
        out.push_str("the search did not converge\n");
    }
    if fit.cut_off > 1e-3 {
        let _ = writeln!(out, "{:.2} % of the walks were cut off", 100.0 * fit.cut_off);
    }
    out
}

/// Measured and modelled reflectance.
pub fn csv(fit: &SpectrumFit) -> String {
    let mut out = String::from("wavelength_nm,measured,model,residual\n");
    for ((l, m), f) in fit.wavelengths_nm.iter().zip(&fit.measured).zip(&fit.modelled) {
        let _ = writeln!(out, "{l},{m},{f:.6},{:.6}", f - m);
    }
    out
}

/// The picture, called `title`.
pub fn picture(fit: &SpectrumFit, title: &str) -> Picture {
    let line = |values: &[f64], color: &str, width: f64| {
        let points: Vec<(f64, f64)> =
            fit.wavelengths_nm.iter().copied().zip(values.iter().copied()).collect();
        Plot::Line(LinePlot::new().with_data(points).with_color(color).with_stroke_width(width))
    };
    let residuals: Vec<f64> = fit.modelled.iter().zip(&fit.measured).map(|(f, m)| f - m).collect();
    let ends =
        [fit.wavelengths_nm.first(), fit.wavelengths_nm.last()].map(|l| l.copied().unwrap_or_default());
    let above = vec![line(&fit.measured, GREY, 2.4), line(&fit.modelled, COLORS[1], 1.6)];
    let below = vec![line(&vec![0.0; residuals.len()], GREY, 0.8), line(&residuals, COLORS[1], 1.6)];
    let layout = |plots: &[Plot]| {
        Layout::auto_from_plots(plots)
            .with_x_axis_min(ends[0])
            .with_x_axis_max(ends[1])
            .with_x_label("wavelength, nm")
    };
    let top = fit.measured.iter().chain(&fit.modelled).copied().fold(0.0, f64::max);
    let layouts = vec![
        layout(&above).with_y_axis_min(0.0).with_y_axis_max(1.08 * top.max(1e-3)).with_y_label("reflectance"),
        layout(&below).with_y_label("model less measured"),
    ];
    let figure = Figure::new(2, 1)
        .with_plots(vec![above, below])
        .with_layouts(layouts)
        .with_cell_size(PANEL_PX.0, PANEL_PX.1)
        .with_title(format!("{}: RMSE {:.4}", label(title, 60), fit.rmse))
        .with_title_size(17)
        .with_shared_legend_position(FigureLegendPosition::Right)
        .with_shared_legend_entries(vec![
            line_entry("measured", GREY, None),
            line_entry("model", COLORS[1], None),
        ]);
    Picture::new(figure.render())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::spectrum::Value;

    #[test]
    fn says_what_is_known_and_what_is_not() {
        let value = |name, value, standard_error, state| Value { name, value, standard_error, state };
        let fit = SpectrumFit {
            parameters: vec![
                value("anthocyanin_ug_per_cm2", 22.25, Some(0.5), State::Free),
                value("carotenoid_ug_per_cm2", 0.0, None, State::AtLower),
                value("gain", 1.0, None, State::Fixed),
            ],
            wavelengths_nm: vec![420.0, 500.0, 690.0],
            measured: vec![0.1, 0.05, 0.6],
            modelled: vec![0.11, 0.06, 0.58],
            rmse: 0.0141,
            neighbour_correlation: 0.5,
            converged: true,
            evaluations: 100,
            agreeing_starts: (4, 6),
            cut_off: 0.0,
            tissue: Default::default(),
        };
        let text = text(&fit);
        for part in [
            "anthocyanin_ug_per_cm2       22.2500   0.5000",
            "carotenoid_ug_per_cm2         0.0000   at its lower bound",
            "gain                          1.0000   held",
            "3 wavelengths from 420 to 690 nm",
            "RMSE 0.01410",
            "6 starts, 4 ended at the same minimum; 100 evaluations",
        ] {
            assert!(text.contains(part), "{part:?} in {text}");
        }
        assert!(csv(&fit).ends_with("\n690,0.6,0.580000,-0.020000\n"));
        let svg = picture(&fit, "a <rose>").svg();
        assert!(svg.contains("a &lt;rose&gt;: RMSE 0.0141") && !svg.contains("NaN"), "{svg}");
    }
}

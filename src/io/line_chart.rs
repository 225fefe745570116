//! Charts of estimates against one number, as SVG or PNG: a line and its points per series, bars of one standard error.

use kuva::prelude::{Figure, Layout, LinePlot, LineStyle, Plot, ScatterPlot};
use kuva::render::figure::FigureLegendPosition;

use super::picture::{COLORS, Picture, line_entry};
use crate::gonio::Estimate;

const PANEL_PX: (f64, f64) = (620.0, 420.0);
const DASH: &str = "6 4";

/// A line.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// What the legend says.
    pub name: String,
    /// Abscissa and estimate, by increasing abscissa.
    pub points: Vec<(f64, Estimate)>,
    /// Is it a reference, drawn dashed and without points?
    pub dashed: bool,
}

impl Series {
    /// A measured line.
    pub fn new(name: impl Into<String>, points: Vec<(f64, Estimate)>) -> Self {
        Self { name: name.into(), points, dashed: false }
    }

    /// A reference line without errors.
    pub fn reference(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let exact = |(x, value)| (x, Estimate { value, standard_error: 0.0 });
        Self { name: name.into(), points: points.into_iter().map(exact).collect(), dashed: true }
    }
}

/// A chart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    /// Title.
    pub title: String,
    /// Abscissa, with its unit.
    pub x_label: String,
    /// Ordinate, with its unit.
    pub y_label: String,
    /// Is the ordinate logarithmic? Values that are not positive are then left out.
    pub log_y: bool,
    /// Lines.
    pub series: Vec<Series>,
}

/// Draws a chart.
pub fn draw(chart: &Chart) -> Picture {
    let mut plots = Vec::new();
    let mut legend = Vec::new();
    for (series, color) in chart.series.iter().zip(COLORS.iter().cycle()) {
        let seen = |e: &Estimate| e.value.is_finite() && (!chart.log_y || e.value > 0.0);
        let points: Vec<_> = series.points.iter().filter(|(_, e)| seen(e)).collect();
        legend.push(line_entry(series.name.clone(), color, series.dashed.then_some(DASH)));
        if points.is_empty() {
            continue;
        }
        let at = || points.iter().map(|(x, e)| (*x, e.value));
        let mut line = LinePlot::new().with_data(at()).with_color(*color).with_stroke_width(1.6);
        if series.dashed {
            line = line.with_line_style(LineStyle::Custom(DASH.into()));
        }
        plots.push(Plot::Line(line));
        if !series.dashed {
            // On a logarithmic axis a bar may not reach zero.
            let below = |e: &Estimate| {
                if chart.log_y { e.standard_error.min(0.9 * e.value) } else { e.standard_error }
            };
            let errors = points.iter().map(|(_, e)| (below(e), e.standard_error));
            let marks = ScatterPlot::new().with_data(at()).with_color(*color).with_size(3.0);
            plots.push(Plot::Scatter(marks.with_y_err_asymmetric(errors)));
        }
    }
    let layout = Layout::auto_from_plots(&plots)
        .with_x_label(chart.x_label.clone())
        .with_y_label(format!("{} (bars: ±1 standard error)", chart.y_label));
    let layout = if chart.log_y { layout.with_log_y() } else { layout };
    let figure = Figure::new(1, 1)
        .with_plots(vec![plots])
        .with_layouts(vec![layout])
        .with_cell_size(PANEL_PX.0, PANEL_PX.1)
        .with_title(chart.title.clone())
        .with_title_size(15)
        .with_shared_legend_position(FigureLegendPosition::Right)
        .with_shared_legend_entries(legend);
    Picture::new(figure.render())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn charts_name_their_axes_and_lines() {
        let estimate = |value| Estimate { value, standard_error: 0.1 };
        let mut chart = Chart {
            title: "a <law>".into(),
            x_label: "angle, deg".into(),
            y_label: "share".into(),
            log_y: false,
            series: vec![
                Series::new(
                    "dome",
                    vec![(0.0, estimate(1.0)), (10.0, estimate(0.0)), (20.0, estimate(f64::NAN))],
                ),
                Series::reference("none", [(0.0, 1.0), (20.0, 1.0)]),
                Series::new("empty", Vec::new()),
            ],
        };
        for log_y in [false, true] {
            chart.log_y = log_y;
            let svg = draw(&chart).svg();
            for part in ["a &lt;law&gt;", "angle, deg", "share", "dome", "none", "empty", "<circle"] {
                assert!(svg.contains(part), "{log_y}: {part}");
            }
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{log_y}");
        }
        assert!(draw(&chart).png().expect("drawn").starts_with(b"\x89PNG"));
    }
}

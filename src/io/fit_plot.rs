//! Pictures of fits: readings against models in the planes of incidence, standardised residuals, the comparison of models.
//!
//! - Plane of incidence: one panel per lamp. Points are readings with their standard deviation where one is known, gains
//!   taken out; lines are models. With one model colours are bands or, where there is one band, series; with several models
//!   colours are models. Signed angles are positive on the lamp's side; a solid grey line points at the lamp, a dotted one
//!   at the mirror direction. Lines end where they leave the panel, whose height is that of the readings.
//! - Histogram: residuals over the root of the reduced chi2, with the normal curve of the same area.
//! - Comparison: bars of RMSE and of AIC less the lowest.

use kuva::prelude::{Figure, Histogram, Layout, LegendEntry, LinePlot, Plot, ScatterPlot, TickFormat};
use kuva::render::figure::FigureLegendPosition;
use kuva::render::render::{Primitive, Scene, TextAnchor};

use super::fit_text::{general, round};
use super::picture::{
    COLORS, GREY, MIRROR_DASH, Picture, label, lamp_and_mirror, line_entry, point_entry, spread, stretches,
};
use crate::fit::{Fit, Geometry, LadderRow, Model};
use crate::gonio::{Measurement, Plane, Scale};
use crate::{Error, Result};

/// Panels, bands and colours beyond these make a picture that nobody can read: then some, evenly spread, are drawn.
const MAX_PANELS: usize = 9;
const MAX_BANDS: usize = 6;
const PANEL_PX: (f64, f64) = (340.0, 270.0);
/// Colour of what has no colour of its own.
const INK: &str = "#000000";
/// Steps of a model's curve, degrees.
const STEP_DEG: f64 = 0.5;

/// A fit with the model that was fitted.
#[derive(Clone, Copy)]
pub struct FittedModel<'a> {
    /// The model.
    pub model: &'a dyn Model,
    /// The fit of it.
    pub fit: &'a Fit,
}

/// Readings against the model of one fit, in the planes of incidence. `None` where no reading lies in one.
pub fn in_plane(measurement: &Measurement, fitted: FittedModel) -> Result<Option<Picture>> {
    let bands = spread(measurement.bands.len(), MAX_BANDS);
    let by_series = bands.len() == 1 && (2..=COLORS.len()).contains(&measurement.series.len());
    let mut legend = Vec::new();
    let mut layers = Vec::new();
    for (k, &band) in bands.iter().enumerate() {
        let color = if bands.len() == 1 { INK } else { COLORS[k % COLORS.len()] };
        let name = label(&measurement.bands[band].name, 24);
        layers.push(Layer::Points { band, color: if by_series { None } else { Some(color) } });
        layers.push(Layer::Curve { band, fitted, color });
        if bands.len() > 1 {
            legend.push(line_entry(name, color, None));
        }
    }
    if by_series {
        for (s, name) in measurement.series.iter().enumerate() {
            legend.push(point_entry(label(name, 24), COLORS[s]));
        }
    } else if bands.len() == 1 {
        legend.push(point_entry("measured", INK));
    }
    if bands.len() == 1 {
        legend.push(line_entry(label(&fitted.fit.model, 24), INK, None));
    } else {
        legend.insert(0, point_entry("measured", INK));
        legend.insert(1, line_entry(label(&fitted.fit.model, 24), INK, None));
    }
    panels(measurement, fitted.fit, &layers, legend)
}

/// Readings against several models, at one band. `None` where no reading lies in a plane of incidence.
pub fn compare(measurement: &Measurement, fits: &[FittedModel], band: usize) -> Result<Option<Picture>> {
    let Some(first) = fits.first() else { return Err(Error::invalid("fits", "there is none to draw")) };
    if band >= measurement.bands.len() {
        return Err(Error::invalid("band", format!("the measurement has {} bands", measurement.bands.len())));
    }
    let mut layers = vec![Layer::Points { band, color: Some(GREY) }];
    let mut legend = vec![point_entry("measured", GREY)];
    for (fitted, color) in fits.iter().zip(COLORS.iter().take(6).cycle()) {
        layers.push(Layer::Curve { band, fitted: *fitted, color });
        legend.push(line_entry(label(&fitted.fit.model, 24), color, None));
    }
    panels(measurement, first.fit, &layers, legend)
}

/// What is drawn in every panel.
enum Layer<'a> {
    /// Readings of a band; without a colour, every series in its own.
    Points { band: usize, color: Option<&'static str> },
    /// A model at a band.
    Curve { band: usize, fitted: FittedModel<'a>, color: &'static str },
}

/// One panel per lamp that has readings in its plane. Gains are those of `fit`.
fn panels(
    measurement: &Measurement,
    fit: &Fit,
    layers: &[Layer],
    mut legend: Vec<LegendEntry>,
) -> Result<Option<Picture>> {
    let planes: Vec<(Plane, Vec<(f64, usize)>)> = measurement
        .lamps()
        .into_iter()
        .map(|wi| Plane::of(measurement, wi))
        .map(|plane| (plane, plane.readings(measurement)))
        .filter(|(_, readings)| !readings.is_empty())
        .collect();
    if planes.is_empty() {
        return Ok(None);
    }
    let shown = spread(planes.len(), MAX_PANELS);
    let columns = if shown.len() == 4 { 2 } else { shown.len().min(3) };
    let rows = shown.len().div_ceil(columns);
    let (mut plots, mut layouts) = (Vec::new(), Vec::new());
    for &k in &shown {
        let (drawn, layout) = panel(measurement, fit, &planes[k].0, &planes[k].1, layers)?;
        plots.push(drawn);
        layouts.push(layout);
    }
    legend.push(line_entry("to the lamp", GREY, None));
    legend.push(line_entry("to the mirror", GREY, Some(MIRROR_DASH)));
    let mut figure = Figure::new(rows, columns)
        .with_plots(plots)
        .with_layouts(layouts)
        .with_cell_size(PANEL_PX.0, PANEL_PX.1)
        .with_shared_legend_position(FigureLegendPosition::Right)
        .with_shared_legend_entries(legend);
    if shown.len() < planes.len() {
        figure = figure.with_title(format!("{} of {} lamps", shown.len(), planes.len())).with_title_size(13);
    }
    Ok(Some(Picture::new(figure.render())))
}

fn panel(
    measurement: &Measurement,
    fit: &Fit,
    plane: &Plane,
    readings: &[(f64, usize)],
    layers: &[Layer],
) -> Result<(Vec<Plot>, Layout)> {
    let gains: Vec<f64> = measurement.series.iter().map(|s| fit.gain(s)).collect();
    let gain = |i: usize| gains.get(measurement.readings[i].series as usize).copied().unwrap_or(1.0);
    let limit_deg = if readings.iter().any(|(angle, _)| angle.abs() > 90.0) { 180.0 } else { 90.0 };
    let top = readings
        .iter()
        .map(|&(_, i)| {
            let r = &measurement.readings[i];
            (r.bsdf_per_sr + r.sigma_per_sr.unwrap_or(0.0)) / gain(i)
        })
        .filter(|v| v.is_finite())
        .fold(0.0, f64::max);
    let half_angles_deg = [measurement.source_half_angle_deg, measurement.detector_half_angle_deg];
    let mut curves = Vec::new();
    for layer in layers {
        if let Layer::Curve { band, fitted, color } = layer {
            curves.push((curve(plane, fitted, *band, limit_deg, half_angles_deg)?, *color));
        }
    }
    // Where the readings are dark the models set the height.
    let top = if top > 0.0 { top } else { curves.iter().flat_map(|c| &c.0).map(|p| p.1).fold(0.0, f64::max) };
    let top = if top > 0.0 { 1.12 * top } else { 1.0 };
    let lamp_deg = round(plane.lamp_deg());
    let mut plots: Vec<Plot> = lamp_and_mirror(lamp_deg, top, GREY).into();
    for (points, color) in &curves {
        for stretch in stretches(points) {
            for inside in stretch.split(|p| p.1 > top).filter(|s| s.len() > 1) {
                plots.push(Plot::Line(
                    LinePlot::new().with_data(inside.to_vec()).with_color(*color).with_stroke_width(1.6),
                ));
            }
        }
    }
    for layer in layers {
        let Layer::Points { band, color } = layer else { continue };
        for series in 0..measurement.series.len().max(1) {
            let points: Vec<(f64, f64, f64)> = readings
                .iter()
                .filter(|&&(_, i)| {
                    let r = &measurement.readings[i];
                    r.band as usize == *band && r.series as usize == series
                })
                .map(|&(angle, i)| {
                    let (r, gain) = (&measurement.readings[i], gain(i));
                    (angle, r.bsdf_per_sr / gain, r.sigma_per_sr.unwrap_or(0.0) / gain)
                })
                .collect();
            if points.is_empty() {
                continue;
            }
            let mut scatter = ScatterPlot::new()
                .with_data(points.iter().map(|p| (p.0, p.1.clamp(0.0, top))).collect::<Vec<_>>())
                .with_color(color.unwrap_or(COLORS[series % COLORS.len()]))
                .with_size(2.8);
            if points.iter().any(|p| p.2 > 0.0) {
                scatter = scatter.with_y_err_asymmetric(
                    points.iter().map(|p| (p.2.min(p.1.max(0.0)), p.2.min((top - p.1).max(0.0)))),
                );
            }
            plots.push(Plot::Scatter(scatter));
        }
    }
    let layout = Layout::auto_from_plots(&plots)
        .with_title(format!("lamp at {lamp_deg}°{}", if plane.wi.z < 0.0 { ", abaxial" } else { "" }))
        .with_title_size(13)
        .with_label_size(12)
        .with_tick_size(11)
        .with_x_axis_min(-limit_deg)
        .with_x_axis_max(limit_deg)
        .with_x_tick_step(limit_deg / 3.0)
        .with_y_axis_min(0.0)
        .with_y_axis_max(top)
        .with_x_label("exitant angle, deg (+ lamp's side)")
        .with_y_label(match measurement.scale {
            Scale::Absolute => "BSDF, 1/sr",
            Scale::RelativePerSeries => "BSDF / gain",
        });
    Ok((plots, layout))
}

/// A model in the plane of incidence, averaged over the instrument's cones.
fn curve(
    plane: &Plane,
    fitted: &FittedModel,
    band: usize,
    limit_deg: f64,
    half_angles_deg: [f64; 2],
) -> Result<Vec<(f64, f64)>> {
    let n = (limit_deg / STEP_DEG) as i32;
    // Half a step off, so that no direction lies in the surface.
    let angles: Vec<f64> = (-n..n).map(|k| (f64::from(k) + 0.5) * STEP_DEG).collect();
    let [source, detector] = half_angles_deg;
    let cones = |a| Geometry::cones(plane.wi, plane.direction(a), source, detector);
    let geometries: Vec<Geometry> = angles.iter().map(|&a| cones(a)).collect();
    let mut values = vec![0.0; angles.len()];
    fitted.model.prepare(&geometries)?.eval(&fitted.fit.band_values(fitted.model, band), &mut values, None);
    Ok(angles.into_iter().zip(values).filter(|p| p.1.is_finite()).collect())
}

/// Residuals over the root of the reduced chi2: of mean square 1 for a good fit. All zero for an exact one.
pub(super) fn standardised(fit: &Fit) -> Vec<f64> {
    let scale = fit.reduced_chi2.filter(|c| c.is_finite() && *c > 0.0).map_or(1.0, f64::sqrt);
    // An exact fit leaves rounding, which is not to be blown up.
    let exact = fit.aic.is_none() && fit.chi2 <= f64::MIN_POSITIVE;
    fit.residuals.iter().map(|r| if exact || !r.is_finite() { 0.0 } else { r / scale }).collect()
}

/// Histogram of the standardised residuals with the normal curve of the same area.
pub fn histogram(fit: &Fit) -> Picture {
    let residuals = standardised(fit);
    let largest = residuals.iter().fold(0.0f64, |m, r| m.max(r.abs()));
    let limit = largest.ceil().clamp(4.0, 8.0);
    // An odd number, so that zero is in the middle of a bin.
    let bins = ((residuals.len() as f64).sqrt() as usize).clamp(8, 60) / 2 * 2 + 1;
    let width = 2.0 * limit / bins as f64;
    let mut counts = vec![0.0; bins];
    for r in &residuals {
        counts[(((r + limit) / width) as usize).min(bins - 1)] += 1.0;
    }
    let edges: Vec<f64> = (0..=bins).map(|i| -limit + i as f64 * width).collect();
    let normal =
        |x: f64| residuals.len() as f64 * width * (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt();
    let curve: Vec<(f64, f64)> =
        (0..=200).map(|i| -limit + f64::from(i) * limit / 100.0).map(|x| (x, normal(x))).collect();
    let top = 1.1 * counts.iter().copied().fold(normal(0.0), f64::max).max(1.0);
    let plots = vec![
        Plot::Histogram(Histogram::new().with_precomputed(edges, counts).with_color("#8fb8d8")),
        Plot::Line(LinePlot::new().with_data(curve).with_color("#d55e00").with_stroke_width(1.6)),
    ];
    let layout = Layout::auto_from_plots(&plots)
        .with_label_size(12)
        .with_tick_size(11)
        .with_x_axis_min(-limit)
        .with_x_axis_max(limit)
        .with_x_tick_step(if limit > 6.0 { 2.0 } else { 1.0 })
        .with_x_tick_format(TickFormat::Integer)
        .with_y_axis_min(0.0)
        .with_y_axis_max(top)
        .with_x_label("standardised residual (model − reading)")
        .with_y_label("readings");
    let legend = vec![line_entry("normal", "#d55e00", None)];
    Picture::new(
        Figure::new(1, 1)
            .with_plots(vec![plots])
            .with_layouts(vec![layout])
            .with_cell_size(460.0, 320.0)
            .with_shared_legend_position(FigureLegendPosition::Right)
            .with_shared_legend_entries(legend)
            .render(),
    )
}

/// Bars of RMSE and of AIC less the lowest, one row per model; the best in colour.
pub fn ladder(rows: &[LadderRow]) -> Picture {
    const ROW: f64 = 26.0;
    const HEAD: f64 = 30.0;
    const NAME: f64 = 190.0;
    const BAR: f64 = 190.0;
    const VALUE: f64 = 90.0;
    let mut scene = Scene::new(NAME + 2.0 * (BAR + VALUE) + 20.0, HEAD + ROW * rows.len() as f64 + 8.0);
    let text = |x: f64, y: f64, content: String, anchor: TextAnchor, bold: bool| Primitive::Text {
        x,
        y,
        content,
        size: 12,
        anchor,
        rotate: None,
        bold,
        color: Some(INK.into()),
    };
    let rmse: Vec<Option<f64>> = rows.iter().map(|r| Some(r.rmse_per_sr)).collect();
    let delta: Vec<Option<f64>> = rows.iter().map(|r| r.delta_aic).collect();
    let columns = [("RMSE, 1/sr", rmse), ("AIC above the lowest", delta)];
    for (row, k) in rows.iter().zip(0..) {
        let y = HEAD + ROW * f64::from(k);
        scene.add(text(NAME - 10.0, y + 17.0, label(&row.model, 26), TextAnchor::End, row.best));
    }
    for ((title, values), x) in columns.into_iter().zip([NAME, NAME + BAR + VALUE + 10.0]) {
        scene.add(text(x, 18.0, title.into(), TextAnchor::Start, false));
        let values: Vec<_> = values.into_iter().map(|v| v.filter(|v| v.is_finite())).collect();
        let largest = values.iter().flatten().copied().fold(0.0, f64::max);
        for ((row, value), k) in rows.iter().zip(values).zip(0..) {
            let y = HEAD + ROW * f64::from(k);
            let length = value.filter(|_| largest > 0.0).map_or(0.0, |v| (BAR * v / largest).max(0.0));
            scene.add(Primitive::Rect {
                x,
                y: y + 4.0,
                width: length.max(1.0),
                height: ROW - 9.0,
                fill: if row.best { "#0072b2" } else { "#9fb4c4" }.into(),
                stroke: None,
                stroke_width: None,
                opacity: None,
            });
            let shown = value.map_or("–".to_owned(), |v| general(v, 4));
            scene.add(text(x + length + 6.0, y + 17.0, shown, TextAnchor::Start, row.best));
        }
    }
    Picture::new(scene)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::report;
    use crate::fit::toy::{self, Toy};

    /// A picture that any reader of SVG accepts, with some `parts`.
    fn check(picture: &Picture, parts: &[&str]) {
        let svg = picture.svg();
        let mut reader = quick_xml::Reader::from_str(&svg);
        loop {
            match reader.read_event() {
                Ok(quick_xml::events::Event::Eof) => break,
                Ok(_) => {}
                Err(e) => panic!("{e}: {svg}"),
            }
        }
        for part in parts {
            assert!(svg.contains(part), "{part}");
        }
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        assert!(picture.png().unwrap().starts_with(b"\x89PNG"));
    }

    fn fitted(m: &Measurement, values: &[f64]) -> (Toy, Fit) {
        let toy = Toy::new(1.0);
        let fit = toy::fit(&toy, m, values);
        (toy, fit)
    }

    const VALUES: [f64; 4] = [0.3, 0.1, 0.0, 20.0];

    #[test]
    fn readings_meet_the_model_for_one_lamp_and_for_many() {
        let toy = Toy::new(1.0);
        for (lamps, bands, series, part) in [
            (vec![30.0], vec![550.0], vec!["a"], "measured"),
            (vec![0.0, 30.0], vec![450.0, 550.0], vec!["a", "b"], "450 nm"),
            ((0..20).map(|k| f64::from(k) * 4.0).collect(), vec![550.0], vec!["<a>", "b"], "&lt;a&gt;"),
        ] {
            let m = toy::measurement(&toy, &VALUES, &lamps, &bands, &series);
            let (model, fit) = fitted(&m, &VALUES);
            let shown = FittedModel { model: &model, fit: &fit };
            let picture = in_plane(&m, shown).unwrap().unwrap();
            check(&picture, &[part, "lamp at", "to the mirror", "toy"]);
            check(&compare(&m, &[shown, shown], 0).unwrap().unwrap(), &["measured", "toy"]);
            assert!(compare(&m, &[shown], 7).is_err() && compare(&m, &[], 0).is_err());
            check(&histogram(&fit), &["standardised residual"]);
        }
    }

    #[test]
    fn little_and_equal_data_are_drawn() {
        let toy = Toy::new(1.0);
        let mut m = toy::measurement(&toy, &VALUES, &[30.0], &[550.0], &["a"]);
        // All equal, then one reading, in the plane and out of it, then dark.
        m.readings.iter_mut().for_each(|r| (r.bsdf_per_sr, r.sigma_per_sr) = (0.1, None));
        let draw = |m: &Measurement| {
            let (model, mut fit) = fitted(m, &VALUES);
            fit.reduced_chi2 = None;
            check(&histogram(&fit), &[]);
            let picture = in_plane(m, FittedModel { model: &model, fit: &fit }).unwrap();
            picture.iter().for_each(|p| check(p, &[]));
            picture.is_some()
        };
        assert!(draw(&m));
        let in_plane = m.readings[0];
        let out_of_plane = m.readings[4];
        m.readings = vec![in_plane];
        assert!(draw(&m));
        m.readings[0].bsdf_per_sr = 0.0;
        assert!(draw(&m));
        m.readings = vec![out_of_plane];
        assert!(!draw(&m));
        m.readings.clear();
        assert!(!draw(&m));
    }

    #[test]
    fn residuals_are_standardised() {
        let toy = Toy::new(1.0);
        let m = toy::measurement(&toy, &VALUES, &[30.0], &[550.0], &["a"]);
        let (_, mut fit) = fitted(&m, &VALUES);
        let z = standardised(&fit);
        let mean_square = z.iter().map(|z| z * z).sum::<f64>() / (fit.n - fit.varied) as f64;
        assert!((mean_square - 1.0).abs() < 1e-12, "{mean_square}");
        (fit.chi2, fit.aic, fit.reduced_chi2) = (0.0, None, Some(0.0));
        fit.residuals[0] = 1e-300;
        assert!(standardised(&fit).iter().all(|z| *z == 0.0));
    }

    #[test]
    fn the_comparison_has_a_row_per_model() {
        let toy = Toy::new(1.0);
        let m = toy::measurement(&toy, &VALUES, &[30.0], &[550.0], &["a"]);
        let (_, good) = fitted(&m, &VALUES);
        let mut poor = fitted(&m, &[0.5, 0.0, 0.0, 1.0]).1;
        poor.model = "a model with a name that is much too long".into();
        check(&ladder(&report::ladder(&[good.clone(), poor])), &["toy", "a model with a name", "…"]);
        // Without criteria, and without models.
        let mut exact = good;
        (exact.aic, exact.chi2, exact.rmse_per_sr) = (None, 0.0, 0.0);
        check(&ladder(&report::ladder(&[exact])), &["–"]);
        check(&ladder(&[]), &[]);
    }
}

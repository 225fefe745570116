//! Pictures of the plane of incidence, of a goniometer table or of any measurement, as SVG or PNG.
//!
//! - Cartesian panel: BSDF in 1/sr against the signed exitant angle, with a band of one standard error.
//! - Polar panel: BSDF times cos(theta), which is the intensity that a goniometer sees (a Lambert sample is
//!   a circle that touches the origin), against the same angle, the normal upwards.
//!
//! Signed angles are positive on the lamp's side; beyond +-90 deg is transmission, shown where there is any.
//! One colour per incidence; thin straight lines point at the lamp, dotted ones at the mirror direction. Of a
//! measurement, points are the readings in the plane, joined by lines; several series are averaged.

use std::sync::Arc;

use kuva::plot::polar::{PolarMode, PolarPlot, PolarSeries};
use kuva::prelude::{Figure, Layout, LegendEntry, LinePlot, Plot, ScatterPlot, TickFormat};
use kuva::render::figure::FigureLegendPosition;

use super::picture::{
    COLORS, GREY, MIRROR_DASH, Picture, label, lamp_and_mirror, line_entry, spread, stretches, superscript,
};
use crate::gonio::{Estimate, GonioTable, Incidence, Measurement, Plane, Scale};
use crate::{Error, Result};

/// What to draw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LobePlot {
    /// Both panels, side by side.
    #[default]
    Both,
    /// BSDF times cosine against the angle, around the sample.
    Polar,
    /// BSDF against the angle.
    Cartesian,
}

const PANEL_PX: (f64, f64) = (560.0, 500.0);
/// More lamps than this cannot be told apart in one picture.
const MAX_LAMPS: usize = 9;

/// The picture as an SVG document. `band` chooses a wavelength of the table; without it, their mean.
pub fn svg(table: &GonioTable, plot: LobePlot, band: Option<usize>) -> Result<String> {
    Ok(of_table(table, plot, band)?.svg())
}

/// The picture as PNG bytes, at twice the size of the SVG.
pub fn png(table: &GonioTable, plot: LobePlot, band: Option<usize>) -> Result<Vec<u8>> {
    of_table(table, plot, band)?.png()
}

/// The lobes of a table. `band` chooses a wavelength; without it, their mean.
pub fn of_table(table: &GonioTable, plot: LobePlot, band: Option<usize>) -> Result<Picture> {
    let names: Vec<String> = table.bands_nm.iter().map(|b| format!("{b} nm")).collect();
    let bands = band_title(&names, band)?;
    let transmits = table.incidences.iter().any(|i| i.mean.transmittance.value > 0.0);
    let limit_deg = if transmits { 180.0 } else { 90.0 };
    let curves = curves(table, limit_deg, band);
    Ok(draw(&curves, limit_deg, plot, &table.sample, &bands, "BSDF, 1/sr"))
}

fn curves(table: &GonioTable, limit_deg: f64, band: Option<usize>) -> Vec<Curve> {
    let curve = |(i, color): (&Incidence, &&'static str)| Curve {
        incident_deg: i.incident_deg,
        color,
        points: points(table, i, band).into_iter().filter(|p| p.0.abs() <= limit_deg).collect(),
        marks: false,
    };
    table.incidences.iter().zip(COLORS.iter().cycle()).map(curve).collect()
}

/// The polar panel of one band of a table, for a figure of several.
pub(super) fn polar_panel(table: &GonioTable, band: usize) -> (Vec<Plot>, Layout) {
    let (plots, layout, unit) = polar(&curves(table, 180.0, Some(band)), "BSDF, 1/sr");
    (plots, layout.with_x_label(unit))
}

/// The lobes of a measurement: its readings in the planes of incidence. `band` chooses a band; without it, their mean.
pub fn of_measurement(measurement: &Measurement, plot: LobePlot, band: Option<usize>) -> Result<Picture> {
    let names: Vec<String> = measurement.bands.iter().map(|b| label(&b.name, 24)).collect();
    let mut bands = band_title(&names, band)?;
    let lamps = measurement.lamps();
    let planes: Vec<(Plane, Vec<(f64, usize)>)> = lamps
        .iter()
        .map(|&wi| Plane::of(measurement, wi))
        .map(|plane| (plane, plane.readings(measurement)))
        .filter(|(_, readings)| !readings.is_empty())
        .collect();
    if planes.is_empty() {
        return Err(Error::invalid("readings", "none lies in a plane of incidence"));
    }
    let shown = spread(planes.len(), MAX_LAMPS);
    if shown.len() < planes.len() {
        bands.push_str(&format!(", {} of {} lamps", shown.len(), planes.len()));
    }
    let through = planes.iter().flat_map(|(_, r)| r).any(|(angle, _)| angle.abs() > 90.0);
    let curves: Vec<Curve> = shown
        .iter()
        .zip(COLORS.iter().cycle())
        .map(|(&k, color)| Curve {
            incident_deg: super::fit_text::round(planes[k].0.lamp_deg()),
            color,
            points: averaged(measurement, &planes[k].1, band),
            marks: true,
        })
        .collect();
    let quantity = match measurement.scale {
        Scale::Absolute => "BSDF, 1/sr",
        Scale::RelativePerSeries => "BSDF, unknown unit",
    };
    let limit_deg = if through { 180.0 } else { 90.0 };
    Ok(draw(&curves, limit_deg, plot, &measurement.sample, &bands, quantity))
}

/// Mean over bands and series of readings at the same angle.
fn averaged(
    measurement: &Measurement,
    readings: &[(f64, usize)],
    band: Option<usize>,
) -> Vec<(f64, Estimate)> {
    let mut points: Vec<(f64, Estimate, f64)> = Vec::new();
    for &(angle, i) in readings {
        let r = &measurement.readings[i];
        if band.is_some_and(|b| b != r.band as usize) {
            continue;
        }
        if points.last().is_none_or(|p| angle - p.0 > 1e-6) {
            points.push((angle, Estimate::default(), 0.0));
        }
        if let Some((_, e, n)) = points.last_mut() {
            // Bands and series share the instrument's errors: they add up without cancelling.
            e.value += r.bsdf_per_sr;
            e.standard_error += r.sigma_per_sr.unwrap_or(0.0);
            *n += 1.0;
        }
    }
    points.into_iter().map(|(angle, e, n)| (angle, e.scaled(1.0 / n))).collect()
}

/// One incidence in the plane of incidence.
struct Curve {
    incident_deg: f64,
    color: &'static str,
    points: Vec<(f64, Estimate)>,
    /// Are the points few enough to be marked?
    marks: bool,
}

/// What the title says of the bands.
fn band_title(names: &[String], band: Option<usize>) -> Result<String> {
    match band {
        Some(b) => names
            .get(b)
            .cloned()
            .ok_or_else(|| Error::invalid("band", format!("the table has {} bands", names.len()))),
        None => Ok(match names {
            [only] => only.clone(),
            _ => format!("mean of {} bands", names.len()),
        }),
    }
}

fn draw(
    curves: &[Curve],
    limit_deg: f64,
    plot: LobePlot,
    sample: &str,
    bands: &str,
    quantity: &str,
) -> Picture {
    let polar = || {
        let (plots, layout, unit) = polar(curves, quantity);
        (plots, layout.with_x_label(format!("radius: BSDF · cos θ, {unit}; angle: + lamp's side")))
    };
    let panels = match plot {
        LobePlot::Both => vec![polar(), cartesian(curves, limit_deg, quantity)],
        LobePlot::Polar => vec![polar()],
        LobePlot::Cartesian => vec![cartesian(curves, limit_deg, quantity)],
    };
    let columns = panels.len();
    let (plots, layouts) = panels.into_iter().unzip();
    let name = if sample.is_empty() { "sample".to_owned() } else { label(sample, 60) };
    let figure = Figure::new(1, columns)
        .with_plots(plots)
        .with_layouts(layouts)
        .with_cell_size(PANEL_PX.0, PANEL_PX.1)
        .with_title(format!("Plane of incidence: {name}, {bands}"))
        .with_title_size(17)
        .with_shared_legend_position(FigureLegendPosition::Right)
        .with_shared_legend_entries(legend(curves));
    Picture::new(figure.render())
}

/// BSDF against the signed angle, at a band or averaged over the bands.
fn points(table: &GonioTable, incidence: &Incidence, band: Option<usize>) -> Vec<(f64, Estimate)> {
    if let Some(band) = band {
        return table.in_plane(incidence, band);
    }
    let bands = table.bands_nm.len();
    let mut mean: Vec<(f64, Estimate)> = Vec::new();
    for band in 0..bands {
        let curve = table.in_plane(incidence, band);
        mean.resize(curve.len(), (0.0, Estimate::default()));
        for (m, (angle, e)) in mean.iter_mut().zip(curve) {
            // The bands share their paths: their errors add up without cancelling.
            m.0 = angle;
            m.1.value += e.value / bands as f64;
            m.1.standard_error += e.standard_error / bands as f64;
        }
    }
    mean
}

fn legend(curves: &[Curve]) -> Vec<LegendEntry> {
    let mut entries: Vec<_> =
        curves.iter().map(|c| line_entry(format!("lamp at {}°", c.incident_deg), c.color, None)).collect();
    entries.push(line_entry("to the lamp", GREY, None));
    entries.push(line_entry("to the mirror", GREY, Some(MIRROR_DASH)));
    entries
}

fn cartesian(curves: &[Curve], limit_deg: f64, quantity: &str) -> (Vec<Plot>, Layout) {
    // At the horizon a few paths stand for a bin and its error is large: it does not set the scale.
    let top = |precise: bool| {
        curves
            .iter()
            .flat_map(|c| &c.points)
            .filter(|(_, e)| !precise || e.standard_error < 0.1 * e.value)
            .map(|(_, e)| e.value + e.standard_error)
            .fold(0.0, f64::max)
    };
    let top = [top(true), top(false)].into_iter().find(|t| *t > 0.0).unwrap_or(1.0) * 1.08;
    let mut plots = Vec::new();
    for c in curves {
        plots.extend(lamp_and_mirror(c.incident_deg, top, c.color));
    }
    for c in curves {
        for points in stretches(&c.points).into_iter().filter(|points| !points.is_empty()) {
            let clipped = |v: f64| v.clamp(0.0, top);
            plots.push(Plot::Line(
                LinePlot::new()
                    .with_data(points.iter().map(|(a, e)| (*a, clipped(e.value))))
                    .with_color(c.color)
                    .with_band(
                        points.iter().map(|(_, e)| clipped(e.value - e.standard_error)),
                        points.iter().map(|(_, e)| clipped(e.value + e.standard_error)),
                    )
                    .with_stroke_width(1.8),
            ));
            if c.marks {
                let points = points.iter().map(|(a, e)| (*a, e.value)).filter(|p| p.1 <= top);
                plots.push(Plot::Scatter(
                    ScatterPlot::new()
                        .with_data(points.collect::<Vec<_>>())
                        .with_color(c.color)
                        .with_size(2.6),
                ));
            }
        }
    }
    let errors = curves.iter().flat_map(|c| &c.points).any(|(_, e)| e.standard_error > 0.0);
    let layout = Layout::auto_from_plots(&plots)
        .with_x_axis_min(-limit_deg)
        .with_x_axis_max(limit_deg)
        .with_x_tick_step(limit_deg / 6.0)
        .with_y_axis_min(0.0)
        .with_y_axis_max(top)
        .with_x_label(if limit_deg > 90.0 {
            "signed exitant angle, deg (+ lamp's side; beyond ±90 transmission)"
        } else {
            "signed exitant angle, deg (+ lamp's side)"
        })
        .with_y_label(if errors {
            format!("{quantity} (band: ±1 standard error)")
        } else {
            quantity.to_owned()
        });
    (plots, layout)
}

/// Outer radius and number of rings that give round numbers.
const SCALES: [(f64, usize); 10] =
    [(1.0, 4), (1.5, 3), (2.0, 4), (2.5, 5), (3.0, 3), (4.0, 4), (5.0, 5), (6.0, 3), (8.0, 4), (10.0, 5)];

/// The panel, and the unit of its radius.
fn polar(curves: &[Curve], quantity: &str) -> (Vec<Plot>, Layout, String) {
    let intensity = |(a, e): &(f64, Estimate)| e.value * a.to_radians().cos().abs();
    let largest = curves.iter().flat_map(|c| &c.points).map(intensity).fold(0.0, f64::max);
    // The scale is printed with two digits: show 1 to 10 times a power of ten.
    let exponent = if largest > 0.0 { largest.log10().floor() as i32 } else { 0 };
    let scale = 10f64.powi(-exponent);
    let (r_max, rings) =
        SCALES.into_iter().find(|(r, _)| *r >= largest * scale).unwrap_or(SCALES[SCALES.len() - 1]);
    let mut plot = PolarPlot::new().with_theta_divisions(12).with_r_max(r_max).with_r_grid_lines(rings);
    let mut add = |(theta, r): (Vec<f64>, Vec<f64>), color: &str, width: f64, dash: Option<&str>| {
        plot.series.push(PolarSeries {
            r,
            theta,
            color: Some(color.to_owned()),
            mode: PolarMode::Line,
            stroke_width: width,
            line_dash: dash.map(str::to_owned),
            ..Default::default()
        });
    };
    for c in curves {
        for (angle, dash) in [(c.incident_deg, None), (-c.incident_deg, Some(MIRROR_DASH))] {
            add((vec![angle; 2], vec![0.0, r_max]), c.color, 0.8, dash);
        }
    }
    for c in curves {
        // Around the sample the two stretches of transmission are one.
        let [reflection, mirror_side, lamp_side] = stretches(&c.points);
        let at = |p: &(f64, Estimate)| (p.0, intensity(p) * scale);
        add(reflection.iter().map(at).unzip(), c.color, 1.8, None);
        add(lamp_side.iter().chain(mirror_side).map(at).unzip(), c.color, 1.8, None);
    }
    // `1/sr`, or what stands for it.
    let unit = quantity.trim_start_matches("BSDF, ");
    let unit = match (exponent, unit) {
        (0, unit) => unit.to_owned(),
        (_, "1/sr") => format!("10{} /sr", superscript(exponent)),
        (_, unit) => format!("10{}, {unit}", superscript(exponent)),
    };
    let plots = vec![Plot::Polar(plot)];
    let layout = Layout::auto_from_plots(&plots).with_polar_r_label_angle(105.0).with_x_tick_format(
        TickFormat::Custom(Arc::new(|deg| {
            let signed = if deg > 180.0 { deg - 360.0 } else { deg };
            format!("{signed:.0}°")
        })),
    );
    (plots, layout, unit)
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::bsdf::{DiffuseTransmission, Lambert, Scatter};
    use crate::fit::toy::{self, Toy};
    use crate::gonio::Goniophotometer;

    fn table(sample: &dyn Scatter) -> GonioTable {
        let gonio = Goniophotometer {
            incident_deg: vec![0.0, 60.0],
            rays: 20_000,
            bands_nm: vec![450.0, 650.0],
            ..Default::default()
        };
        gonio.measure(sample, &|_, _| ControlFlow::Continue(())).unwrap().described("a <sheet>", "")
    }

    #[test]
    fn pictures_name_their_axes_and_lamps() {
        let t = table(&Lambert::new(0.5.into()).unwrap());
        for plot in [LobePlot::Both, LobePlot::Polar, LobePlot::Cartesian] {
            let svg = svg(&t, plot, None).unwrap();
            let mut parts =
                vec!["lamp at 0°", "lamp at 60°", "to the lamp", "to the mirror", "a &lt;sheet&gt;"];
            if plot != LobePlot::Polar {
                parts.push("BSDF, 1/sr");
            }
            if plot != LobePlot::Cartesian {
                parts.push("radius: BSDF");
            }
            for part in parts {
                assert!(svg.contains(part), "{plot:?}: {part}");
            }
            assert!(!svg.contains("NaN") && !svg.contains("inf"));
        }
        let bytes = png(&t, LobePlot::Both, Some(1)).unwrap();
        assert!(bytes.starts_with(b"\x89PNG"));
        assert!(svg(&t, LobePlot::Both, Some(2)).is_err());
    }

    #[test]
    fn transmission_opens_the_lower_half_and_black_is_drawn() {
        let sheet = DiffuseTransmission::new(0.3.into(), 0.3.into(), 0.2.into()).unwrap();
        assert!(svg(&table(&sheet), LobePlot::Cartesian, None).unwrap().contains("transmission"));
        let black = svg(&table(&Lambert::new(0.0.into()).unwrap()), LobePlot::Both, None).unwrap();
        assert!(!black.contains("transmission") && !black.contains("NaN"));
    }

    #[test]
    fn any_measurement_has_lobes() {
        let toy = Toy::new(1.0);
        let values = [0.3, 0.1, 0.0, 20.0];
        let m = toy::measurement(&toy, &values, &[0.0, 45.0], &[450.0, 650.0], &["a", "b"]);
        let svg = of_measurement(&m, LobePlot::Both, None).unwrap().svg();
        for part in ["lamp at 45°", "rose petal, adaxial, mean of 2 bands", "<circle"] {
            assert!(svg.contains(part), "{part}");
        }
        assert!(of_measurement(&m, LobePlot::Both, Some(2)).is_err());
        let points = averaged(&m, &Plane::of(&m, m.readings[0].wi).readings(&m), Some(1));
        assert_eq!(points.len(), 15);
        // One reading, dark, of unknown scale; then none.
        let mut one = Measurement { readings: vec![m.readings[3]], scale: Scale::RelativePerSeries, ..m };
        one.readings[0].wo = one.readings[0].wi;
        one.readings[0].bsdf_per_sr = 0.0;
        let svg = of_measurement(&one, LobePlot::Both, None).unwrap().svg();
        assert!(svg.contains("unknown unit") && !svg.contains("NaN"));
        one.readings.clear();
        assert!(of_measurement(&one, LobePlot::Both, None).is_err());
    }
}

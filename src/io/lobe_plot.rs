//! Pictures of the plane of incidence of a goniometer table, as SVG or PNG.
//!
//! - Cartesian panel: BSDF in 1/sr against the signed exitant angle, with a band of one standard error.
//! - Polar panel: BSDF times cos(theta), which is the intensity that a goniometer sees (a Lambert sample is
//!   a circle that touches the origin), against the same angle, the normal upwards.
//!
//! Signed angles are positive on the lamp's side; beyond +-90 deg is transmission, shown where there is any.
//! One colour per incidence; thin straight lines point at the lamp, dotted ones at the mirror direction.

use std::sync::Arc;

use kuva::plot::LegendShape;
use kuva::plot::polar::{PolarMode, PolarPlot, PolarSeries};
use kuva::prelude::{Figure, Layout, LegendEntry, LinePlot, LineStyle, Plot, TickFormat};
use kuva::render::figure::FigureLegendPosition;
use kuva::render::render::Scene;

use crate::gonio::{Estimate, GonioTable, Incidence};
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

/// Colours that stay apart for most eyes (Okabe and Ito 2008), without their yellow.
const COLORS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#333333"];
const GREY: &str = "#555555";
const MIRROR_DASH: &str = "3 5";
const PANEL_PX: (f64, f64) = (560.0, 500.0);

/// The picture as an SVG document. `band` chooses a wavelength of the table; without it, their mean.
pub fn svg(table: &GonioTable, plot: LobePlot, band: Option<usize>) -> Result<String> {
    Ok(kuva::backend::svg::SvgBackend::default().render_scene(&scene(table, plot, band)?))
}

/// The picture as PNG bytes, at twice the size of the SVG.
pub fn png(table: &GonioTable, plot: LobePlot, band: Option<usize>) -> Result<Vec<u8>> {
    kuva::backend::png::PngBackend::new()
        .render_scene(&scene(table, plot, band)?)
        .map_err(|e| Error::Unsupported(format!("PNG of this plot: {e}")))
}

/// One incidence in the plane of incidence.
struct Curve {
    incident_deg: f64,
    color: &'static str,
    points: Vec<(f64, Estimate)>,
}

fn scene(table: &GonioTable, plot: LobePlot, band: Option<usize>) -> Result<Scene> {
    if band.is_some_and(|b| b >= table.bands_nm.len()) {
        return Err(Error::invalid("band", format!("the table has {} bands", table.bands_nm.len())));
    }
    let transmits = table.incidences.iter().any(|i| i.mean.transmittance.value > 0.0);
    let limit_deg = if transmits { 180.0 } else { 90.0 };
    let curves: Vec<Curve> = table
        .incidences
        .iter()
        .zip(COLORS.iter().cycle())
        .map(|(i, color)| Curve {
            incident_deg: i.incident_deg,
            color,
            points: points(table, i, band).into_iter().filter(|p| p.0.abs() <= limit_deg).collect(),
        })
        .collect();

    let panels = match plot {
        LobePlot::Both => vec![polar(&curves), cartesian(&curves, limit_deg)],
        LobePlot::Polar => vec![polar(&curves)],
        LobePlot::Cartesian => vec![cartesian(&curves, limit_deg)],
    };
    let columns = panels.len();
    let (plots, layouts) = panels.into_iter().unzip();
    let bands = match band {
        Some(b) => format!("{} nm", table.bands_nm[b]),
        None if table.bands_nm.len() == 1 => format!("{} nm", table.bands_nm[0]),
        None => format!("mean of {} bands", table.bands_nm.len()),
    };
    let name = if table.sample.is_empty() { "sample" } else { &table.sample };
    Ok(Figure::new(1, columns)
        .with_plots(plots)
        .with_layouts(layouts)
        .with_cell_size(PANEL_PX.0, PANEL_PX.1)
        .with_title(format!("Plane of incidence: {name}, {bands}"))
        .with_title_size(17)
        .with_shared_legend_position(FigureLegendPosition::Right)
        .with_shared_legend_entries(legend(&curves))
        .render())
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
    let entry = |label: String, color: &str, dash: Option<&str>| LegendEntry {
        label,
        color: color.to_owned(),
        shape: LegendShape::Line,
        dasharray: dash.map(str::to_owned),
    };
    let mut entries: Vec<_> =
        curves.iter().map(|c| entry(format!("lamp at {}°", c.incident_deg), c.color, None)).collect();
    entries.push(entry("to the lamp".into(), GREY, None));
    entries.push(entry("to the mirror".into(), GREY, Some(MIRROR_DASH)));
    entries
}

impl Curve {
    /// Reflection, transmission on the mirror's side and on the lamp's: no line may cross the horizon.
    fn stretches(&self) -> [&[(f64, Estimate)]; 3] {
        let low = self.points.partition_point(|p| p.0 < -90.0);
        let high = self.points.partition_point(|p| p.0 <= 90.0);
        [&self.points[low..high], &self.points[..low], &self.points[high..]]
    }
}

fn cartesian(curves: &[Curve], limit_deg: f64) -> (Vec<Plot>, Layout) {
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
        for (angle, style) in
            [(c.incident_deg, LineStyle::Solid), (-c.incident_deg, LineStyle::Custom(MIRROR_DASH.into()))]
        {
            plots.push(Plot::Line(
                LinePlot::new()
                    .with_data([(angle, 0.0), (angle, top)])
                    .with_color(c.color)
                    .with_stroke_width(0.8)
                    .with_line_style(style),
            ));
        }
    }
    for c in curves {
        for points in c.stretches().into_iter().filter(|points| !points.is_empty()) {
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
        }
    }
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
        .with_y_label("BSDF, 1/sr (band: ±1 standard error)");
    (plots, layout)
}

/// Outer radius and number of rings that give round numbers.
const SCALES: [(f64, usize); 10] =
    [(1.0, 4), (1.5, 3), (2.0, 4), (2.5, 5), (3.0, 3), (4.0, 4), (5.0, 5), (6.0, 3), (8.0, 4), (10.0, 5)];

fn polar(curves: &[Curve]) -> (Vec<Plot>, Layout) {
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
        let [reflection, mirror_side, lamp_side] = c.stretches();
        let at = |p: &(f64, Estimate)| (p.0, intensity(p) * scale);
        add(reflection.iter().map(at).unzip(), c.color, 1.8, None);
        add(lamp_side.iter().chain(mirror_side).map(at).unzip(), c.color, 1.8, None);
    }
    let unit = if exponent == 0 { "1/sr".to_owned() } else { format!("10{} /sr", superscript(exponent)) };
    let plots = vec![Plot::Polar(plot)];
    let layout = Layout::auto_from_plots(&plots)
        .with_polar_r_label_angle(105.0)
        .with_x_tick_format(TickFormat::Custom(Arc::new(|deg| {
            let signed = if deg > 180.0 { deg - 360.0 } else { deg };
            format!("{signed:.0}°")
        })))
        .with_x_label(format!("radius: BSDF · cos θ, {unit}; angle: + lamp's side"));
    (plots, layout)
}

/// An integer in superscript digits.
fn superscript(n: i32) -> String {
    let raise = |c| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32('⁰' as u32 + (digit as u32 - '0' as u32)).unwrap_or(digit),
    };
    n.to_string().chars().map(raise).collect()
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::bsdf::{DiffuseTransmission, Lambert, Scatter};
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
}

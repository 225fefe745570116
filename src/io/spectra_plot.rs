//! Pictures of a petal's spectra, as SVG or PNG: reflectance and transmittance against the wavelength, one panel per lit side,
//! one colour per angle of the lamp, solid lines for reflectance, dashed ones for transmittance, bands of one standard error.

use kuva::prelude::{Figure, Layout, LinePlot, LineStyle, Plot};
use kuva::render::figure::FigureLegendPosition;

use super::picture::{COLORS, GREY, Picture, label, line_entry};
use crate::geometry::Side;
use crate::gonio::{Estimate, HemisphericalSpectrum};
use crate::{Error, Result};

const PANEL_PX: (f64, f64) = (520.0, 420.0);
const DASH: &str = "7 4";

/// The picture of spectra.
pub fn of_spectra(spectra: &[HemisphericalSpectrum], name: &str) -> Result<Picture> {
    let mut angles: Vec<f64> = Vec::new();
    for s in spectra {
        if !angles.contains(&s.incident_deg) {
            angles.push(s.incident_deg);
        }
    }
    let color = |deg: f64| {
        let k = angles.iter().position(|a| *a == deg).unwrap_or(0);
        COLORS[k % COLORS.len()]
    };
    let sides: Vec<Side> = [Side::Adaxial, Side::Abaxial]
        .into_iter()
        .filter(|side| spectra.iter().any(|s| s.side == *side && !s.points.is_empty()))
        .collect();
    if sides.is_empty() {
        return Err(Error::invalid("spectra", "there is nothing to draw"));
    }
    let (plots, layouts) =
        sides.iter().map(|&side| panel(spectra.iter().filter(|s| s.side == side), side, color)).unzip();
    let mut legend: Vec<_> =
        angles.iter().map(|&deg| line_entry(format!("lamp at {deg}°"), color(deg), None)).collect();
    legend.push(line_entry("reflectance", GREY, None));
    legend.push(line_entry("transmittance", GREY, Some(DASH)));
    let name = if name.is_empty() { "sample".to_owned() } else { label(name, 60) };
    let figure = Figure::new(1, sides.len())
        .with_plots(plots)
        .with_layouts(layouts)
        .with_cell_size(PANEL_PX.0, PANEL_PX.1)
        .with_title(format!("{name}: light that leaves, over the hemisphere"))
        .with_title_size(17)
        .with_shared_legend_position(FigureLegendPosition::Right)
        .with_shared_legend_entries(legend);
    Ok(Picture::new(figure.render()))
}

fn panel<'a>(
    spectra: impl Iterator<Item = &'a HemisphericalSpectrum>,
    side: Side,
    color: impl Fn(f64) -> &'static str,
) -> (Vec<Plot>, Layout) {
    let mut plots = Vec::new();
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for s in spectra {
        for (transmitted, style) in [(false, LineStyle::Solid), (true, LineStyle::Custom(DASH.into()))] {
            let points: Vec<(f64, Estimate)> = s
                .points
                .iter()
                .map(|p| (p.wavelength_nm, if transmitted { p.transmittance } else { p.reflectance }))
                .collect();
            low = points.iter().map(|p| p.0).fold(low, f64::min);
            high = points.iter().map(|p| p.0).fold(high, f64::max);
            let within = |v: f64| v.clamp(0.0, 1.0);
            plots.push(Plot::Line(
                LinePlot::new()
                    .with_data(points.iter().map(|(nm, e)| (*nm, within(e.value))))
                    .with_color(color(s.incident_deg))
                    .with_band(
                        points.iter().map(|(_, e)| within(e.value - e.standard_error)),
                        points.iter().map(|(_, e)| within(e.value + e.standard_error)),
                    )
                    .with_line_style(style)
                    .with_stroke_width(1.8),
            ));
        }
    }
    // One band is a point: it needs an axis of some width.
    let (low, high) = if high > low { (low, high) } else { (low - 1.0, low + 1.0) };
    let layout = Layout::auto_from_plots(&plots)
        .with_title(format!("{} side lit", format!("{side:?}").to_lowercase()))
        .with_x_axis_min(low)
        .with_x_axis_max(high)
        .with_y_axis_min(0.0)
        .with_y_axis_max(1.0)
        .with_x_label("wavelength, nm")
        .with_y_label("share of the light (band: ±1 standard error)");
    (plots, layout)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::SpectrumPoint;

    fn spectrum(side: Side, incident_deg: f64, bands: usize) -> HemisphericalSpectrum {
        let e = |value| Estimate { value, standard_error: 0.01 };
        let points = (0..bands).map(|i| 400.0 + 10.0 * i as f64).map(|wavelength_nm| SpectrumPoint {
            wavelength_nm,
            reflectance: e(0.4),
            transmittance: e(0.3),
        });
        HemisphericalSpectrum { side, incident_deg, points: points.collect() }
    }

    #[test]
    fn pictures_name_sides_angles_and_quantities() {
        let spectra = [
            spectrum(Side::Adaxial, 0.0, 20),
            spectrum(Side::Abaxial, 0.0, 20),
            spectrum(Side::Abaxial, 60.0, 20),
        ];
        let svg = of_spectra(&spectra, "a <rose>").unwrap().svg();
        for part in [
            "adaxial side",
            "abaxial side",
            "lamp at 0°",
            "lamp at 60°",
            "transmittance",
            "wavelength, nm",
            "a &lt;rose&gt;",
        ] {
            assert!(svg.contains(part), "{part}");
        }
        let one = of_spectra(&[spectrum(Side::Adaxial, 8.0, 1)], "").unwrap().svg();
        assert!(one.contains("sample") && !one.contains("abaxial") && !one.contains("NaN"));
        assert!(of_spectra(&[], "").is_err());
    }
}

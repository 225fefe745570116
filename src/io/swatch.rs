//! A sheet of petals: one row each, with what it looks like, its spectra and its lobes.
//!
//! - Balls (`ball`): the upper side lit from the front, the lower side likewise, and the upper side lit from behind, all in the
//!   same exposure, in sRGB. Below each the colour of all light that leaves in that way at the least angle of the lamp.
//! - Spectra: directional-hemispherical reflectance (solid) and transmittance (dashed) at that angle, of both sides.
//! - Lobes: BSDF times cosine in the plane of incidence of the upper side, in two bands: green, where red petals keep only
//!   the light of their surface, and red, where it is mostly the light from within.

use glam::DVec3;
use kuva::prelude::{Figure, Layout, LinePlot, LineStyle, Plot};
use kuva::render::color::Color;
use kuva::render::render::{Primitive, Scene, TextAnchor};

use super::ball::{Lit, ball};
use super::lobe_plot::polar_panel;
use super::picture::{COLORS, Picture, label};
use crate::geometry::Side;
use crate::gonio::{GonioTable, HemisphericalSpectrum};
use crate::spectrum::color::srgb_encode;
use crate::spectrum::object_color::{ObjectColor, band_weights};
use crate::spectrum::{Illuminant, Observer};
use crate::{Error, Result};

const BALL_PX: f64 = 180.0;
const MARGIN_PX: f64 = 24.0;
const PANEL_PX: (f64, f64) = (330.0, 290.0);
const ROW_PX: f64 = 318.0;
const HEAD_PX: f64 = 76.0;
/// Pixels of a ball along each side, two per unit of the picture.
const PIXELS: usize = 360;
/// Behind the balls: dark enough for bright outlines, bright enough for dark ones. sRGB.
const GROUND: u8 = 0x70;
/// Bands of the lobes, nm.
const LOBES_NM: [f64; 2] = [540.0, 680.0];
const DASH: &str = "7 4";

/// A petal, measured from both sides in bands that cover the visible range.
#[derive(Clone, Copy, Debug)]
pub struct Swatch<'a> {
    /// The petal's name.
    pub name: &'a str,
    /// What it is, in a few words.
    pub about: &'a str,
    /// The upper side.
    pub adaxial: &'a GonioTable,
    /// The lower side.
    pub abaxial: &'a GonioTable,
}

/// The sheet.
pub fn sheet(petals: &[Swatch], illuminant: Illuminant) -> Result<Picture> {
    if petals.is_empty() {
        return Err(Error::invalid("swatch", "there is no petal to show"));
    }
    let balls_px = 3.0 * (BALL_PX + MARGIN_PX) + MARGIN_PX;
    let width = balls_px + 3.0 * PANEL_PX.0 + MARGIN_PX;
    let mut scene = Scene::new(width, HEAD_PX + ROW_PX * petals.len() as f64 + MARGIN_PX);
    head(&mut scene, balls_px, petals[0].adaxial, illuminant);
    for (row, petal) in petals.iter().enumerate() {
        let top = HEAD_PX + ROW_PX * row as f64;
        left(&mut scene, petal, illuminant, top)?;
        let lobes = |nm: f64| polar_panel(&with_few_lamps(petal.adaxial), nearest(petal.adaxial, nm));
        let panels = [spectra_panel(petal), lobes(LOBES_NM[0]), lobes(LOBES_NM[1])];
        let (plots, layouts) = panels.into_iter().unzip();
        let figure = Figure::new(1, 3)
            .with_plots(plots)
            .with_layouts(layouts)
            .with_cell_size(PANEL_PX.0, PANEL_PX.1)
            .with_padding(0.0)
            .with_spacing(0.0)
            .render();
        scene.add(Primitive::GroupStart {
            transform: Some(format!("translate({balls_px},{})", top + 10.0)),
            title: None,
            extra_attrs: None,
        });
        scene.elements.extend(figure.elements);
        scene.add(Primitive::GroupEnd);
        scene.defs.extend(figure.defs);
    }
    Ok(Picture::new(scene))
}

/// The table with the lamps whose lobes are shown: at most four, evenly chosen.
fn with_few_lamps(table: &GonioTable) -> GonioTable {
    let mut table = table.clone();
    let step = table.incidences.len().div_ceil(4).max(1);
    let shown: Vec<_> = table.incidences.into_iter().step_by(step).collect();
    table.incidences = shown;
    table
}

fn nearest(table: &GonioTable, nm: f64) -> usize {
    let away = |b: &usize| (table.bands_nm[*b] - nm).abs();
    (0..table.bands_nm.len()).min_by(|a, b| away(a).total_cmp(&away(b))).unwrap_or(0)
}

fn text(scene: &mut Scene, (x, y): (f64, f64), size: u32, bold: bool, content: &str) {
    scene.add(Primitive::Text {
        x,
        y,
        content: content.to_owned(),
        size,
        anchor: TextAnchor::Start,
        rotate: None,
        bold,
        color: None,
    });
}

/// Names of the columns, and the legends of the panels.
fn head(scene: &mut Scene, balls_px: f64, table: &GonioTable, illuminant: Illuminant) {
    let white = "white facing the light is full";
    text(scene, (MARGIN_PX, 28.0), 17, true, &format!("Petals in {illuminant}, parallel light, {white}"));
    for (k, caption) in ["upper side", "lower side", "upper side, lit from behind"].into_iter().enumerate() {
        text(scene, (MARGIN_PX + k as f64 * (BALL_PX + MARGIN_PX), 54.0), 13, false, caption);
    }
    let column = |k: f64| balls_px + k * PANEL_PX.0 + 10.0;
    let least = least_angle(table);
    text(scene, (column(0.0), 28.0), 13, true, &format!("share of the light, lamp at {least}°"));
    let mut line = |x: f64, y: f64, color: &str, dashed: bool, name: &str| {
        // Pieces of a line: not every backend dashes one so short.
        for (from, to) in
            if dashed { vec![(0.0, 6.0), (10.0, 16.0), (20.0, 24.0)] } else { vec![(0.0, 24.0)] }
        {
            scene.add(Primitive::Line {
                x1: x + from,
                y1: y - 4.0,
                x2: x + to,
                y2: y - 4.0,
                stroke: Color::from(color),
                stroke_width: 2.0,
                stroke_dasharray: None,
            });
        }
        text(scene, (x + 29.0, y), 11, false, name);
    };
    line(column(0.0), 48.0, COLORS[0], false, "back, upper side lit");
    line(column(0.0), 66.0, COLORS[1], false, "back, lower side lit");
    line(column(0.47), 48.0, COLORS[0], true, "through, upper side lit");
    line(column(0.47), 66.0, COLORS[1], true, "through, lower side lit");
    let shown = with_few_lamps(table).incidences;
    for (k, (i, color)) in shown.iter().zip(COLORS.iter().cycle()).enumerate() {
        line(column(1.0) + 92.0 * k as f64, 48.0, color, false, &format!("lamp {}°", i.incident_deg));
    }
    text(
        scene,
        (column(1.0), 66.0),
        11,
        false,
        "radius: BSDF · cos θ in the unit below; positive angles: the lamp's side",
    );
    for (k, nm) in LOBES_NM.into_iter().enumerate() {
        let name = format!("lobes of the upper side, {} nm", table.bands_nm[nearest(table, nm)]);
        text(scene, (column(1.0 + k as f64), 28.0), 13, true, &name);
    }
}

fn least_angle(table: &GonioTable) -> f64 {
    table.incidences.iter().map(|i| i.incident_deg).fold(f64::INFINITY, f64::min)
}

/// Spectra at the least angle of the lamp.
fn of_least_angle(table: &GonioTable) -> Option<HemisphericalSpectrum> {
    let least = least_angle(table);
    HemisphericalSpectrum::of_tables([table]).into_iter().find(|s| s.incident_deg == least)
}

/// Name, balls and colours of one row.
fn left(scene: &mut Scene, petal: &Swatch, illuminant: Illuminant, top: f64) -> Result<()> {
    text(scene, (MARGIN_PX, top + 26.0), 19, true, &label(petal.name, 40));
    text(scene, (MARGIN_PX, top + 46.0), 12, false, &label(petal.about, 100));
    let colors = |table: &GonioTable| {
        let spectrum =
            of_least_angle(table).ok_or_else(|| Error::invalid("swatch", "the table has no incidence"))?;
        spectrum.colors(illuminant, Observer::Cie1931)
    };
    let (upper, lower) = (colors(petal.adaxial)?, colors(petal.abaxial)?);
    let views = [
        (petal.adaxial, Lit::Front, &upper.reflected),
        (petal.abaxial, Lit::Front, &lower.reflected),
        // Light that comes from behind falls on the lower side.
        (petal.abaxial, Lit::Behind, &lower.transmitted),
    ];
    for (k, (table, lit, color)) in views.into_iter().enumerate() {
        let corner = (MARGIN_PX + k as f64 * (BALL_PX + MARGIN_PX), top + 58.0);
        let weights = band_weights(&table.bands_nm, illuminant, Observer::Cie1931)?;
        let rgb = table.combined(&weights.iter().map(DVec3::to_array).collect::<Vec<_>>());
        scene.add(pixels(&rgb, lit, corner));
        swatch(scene, color, (corner.0, corner.1 + BALL_PX + 10.0));
    }
    Ok(())
}

fn pixels(rgb: &GonioTable, lit: Lit, corner: (f64, f64)) -> Primitive {
    let decode = |v: u8| f64::from(crate::spectrum::color::srgb_decode(f32::from(v) / 255.0));
    let light = ball(rgb, lit, PIXELS, DVec3::splat(decode(GROUND)));
    let side = BALL_PX / PIXELS as f64;
    let at = |i: usize| (i as f64 * side, side);
    let encode = |v: f64| (srgb_encode(v.clamp(0.0, 1.0) as f32) * 255.0 + 0.5) as u8;
    Primitive::RectBatch {
        x: (0..light.len()).map(|i| corner.0 + at(i % PIXELS).0).collect(),
        y: (0..light.len()).map(|i| corner.1 + at(i / PIXELS).0).collect(),
        w: vec![side; light.len()],
        h: vec![side; light.len()],
        fills: light.iter().map(|c| Color::Rgb(encode(c.x), encode(c.y), encode(c.z))).collect(),
    }
}

/// A patch of a colour, its code and its L*a*b*.
fn swatch(scene: &mut Scene, color: &ObjectColor, (x, y): (f64, f64)) {
    scene.add(Primitive::Rect {
        x,
        y,
        width: 38.0,
        height: 34.0,
        fill: Color::from(color.srgb_hex.as_str()),
        stroke: Some(Color::from("#999999")),
        stroke_width: Some(0.5),
        opacity: None,
    });
    let [l, a, b] = color.lab;
    let beyond = if color.in_srgb { "" } else { ", beyond sRGB" };
    text(scene, (x + 46.0, y + 14.0), 12, false, &format!("{}{beyond}", color.srgb_hex));
    text(scene, (x + 46.0, y + 30.0), 12, false, &format!("L* {l:.0}  a* {a:.0}  b* {b:.0}"));
}

fn spectra_panel(petal: &Swatch) -> (Vec<Plot>, Layout) {
    let mut plots = Vec::new();
    for (table, color) in [(petal.adaxial, COLORS[0]), (petal.abaxial, COLORS[1])] {
        if let Some(spectrum) = of_least_angle(table) {
            for (transmitted, style) in [(false, LineStyle::Solid), (true, LineStyle::Custom(DASH.into()))] {
                let points = spectrum.points.iter().map(|p| {
                    let e = if transmitted { p.transmittance } else { p.reflectance };
                    (p.wavelength_nm, e.value.clamp(0.0, 1.0))
                });
                plots.push(Plot::Line(
                    LinePlot::new()
                        .with_data(points.collect::<Vec<_>>())
                        .with_color(color)
                        .with_line_style(style)
                        .with_stroke_width(1.8),
                ));
            }
        }
    }
    debug_assert_eq!(petal.adaxial.side, Side::Adaxial);
    let layout = Layout::auto_from_plots(&plots)
        .with_x_axis_min(380.0)
        .with_x_axis_max(780.0)
        .with_x_tick_step(100.0)
        .with_y_axis_min(0.0)
        .with_y_axis_max(1.0)
        .with_x_label("wavelength, nm");
    (plots, layout)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::DiffuseTransmission;
    use crate::gonio::{ExitantGrid, Goniophotometer};
    use crate::spectrum::Spectrum;
    use std::ops::ControlFlow;

    #[test]
    fn a_sheet_names_and_shows_its_petals() {
        let red = |low: f64, high: f64| Spectrum::from_fn(move |l| if l > 600.0 { high } else { low });
        let sheet_of = DiffuseTransmission::new(red(0.05, 0.4), red(0.1, 0.5), red(0.0, 0.3)).unwrap();
        let measure = |side| {
            let gonio = Goniophotometer {
                incident_deg: vec![0.0, 60.0],
                side,
                rays: 3000,
                bands_nm: (0..=10).map(|i| 380.0 + 40.0 * f64::from(i)).collect(),
                exitant: ExitantGrid { theta_step_deg: 30.0, phi_step_deg: 60.0 },
                ..Default::default()
            };
            gonio.measure(&sheet_of, &|_, _| ControlFlow::Continue(())).unwrap()
        };
        let (adaxial, abaxial) = (measure(Side::Adaxial), measure(Side::Abaxial));
        let petal = Swatch { name: "red <one>", about: "flat", adaxial: &adaxial, abaxial: &abaxial };
        let picture = sheet(&[petal, petal], Illuminant::D65).unwrap();
        let hex = of_least_angle(&adaxial).unwrap().colors(Illuminant::D65, Observer::Cie1931).unwrap();
        let svg = picture.svg();
        for part in ["red &lt;one&gt;", "lamp 60°", &hex.reflected.srgb_hex, "540 nm", "L* "] {
            assert!(svg.contains(part), "{part}");
        }
        assert!(!svg.contains("NaN"));
        assert!(sheet(&[], Illuminant::D65).is_err());
        // Bands that cannot be a colour.
        let few = Goniophotometer { rays: 100, ..Default::default() };
        let few = few.measure(&sheet_of, &|_, _| ControlFlow::Continue(())).unwrap();
        let petal = Swatch { adaxial: &few, abaxial: &few, ..petal };
        assert!(sheet(&[petal], Illuminant::D65).is_err());
    }
}

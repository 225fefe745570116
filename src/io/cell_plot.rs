//! Pictures of a petal's cells, as SVG or PNG: from above, and in section.
//!
//! - Map: height over the plane by colour, with relief shading (light from the upper left at 45 deg) that is
//!   there for the eye only, the outlines of the Voronoi cells, and an orange line where the section is.
//! - Section: height along that line, which runs through the centres of a row of cells; both axes have the
//!   same scale, so slopes look as steep as they are.

use glam::{DVec2, DVec3};
use kuva::plot::Heatmap;
use kuva::prelude::{Figure, Layout, LinePlot, Plot, TickFormat};
use kuva::render::color::Color;
use kuva::render::render::{Primitive, Scene};

use crate::micro::CellField;
use crate::micro::tile_mesh::voronoi_outlines;
use crate::{Error, Result};

/// Side of the map in pitches.
const VIEW_PITCHES: f64 = 6.0;
/// Points of the map along each side.
const MAP_POINTS: usize = 132;
/// Points of the section.
const SECTION_POINTS: usize = 721;
const WIDTH_PX: f64 = 640.0;
/// Space for the axis on the left and the colour bar on the right, the same in both panels.
const MARGINS_PX: (f64, f64) = (70.0, 90.0);
/// Space for the title above and the axis below, in both panels.
const MARGINS_Y_PX: (f64, f64) = (40.0, 60.0);

/// The picture as an SVG document.
pub fn svg(field: &CellField, name: &str) -> Result<String> {
    Ok(kuva::backend::svg::SvgBackend::default().render_scene(&scene(field, name)))
}

/// The picture as PNG bytes, at twice the size of the SVG.
pub fn png(field: &CellField, name: &str) -> Result<Vec<u8>> {
    kuva::backend::png::PngBackend::new()
        .render_scene(&scene(field, name))
        .map_err(|e| Error::Unsupported(format!("PNG of this plot: {e}")))
}

/// The part of the plane that is shown: a square, its origin one tile away from the field's.
struct View<'a> {
    field: &'a CellField,
    side_um: f64,
    /// Height of the section above the lower edge, um.
    section_um: f64,
}

impl<'a> View<'a> {
    fn new(field: &'a CellField) -> Self {
        let side_um = VIEW_PITCHES * field.description().pitch_um;
        let mut view = Self { field, side_um, section_um: 0.0 };
        let (_, site) = field.cell_at(view.place(DVec2::splat(side_um / 2.0)));
        view.section_um = site.y - field.tile_um().y;
        view
    }

    /// A point of the view on the field.
    fn place(&self, p: DVec2) -> DVec2 {
        p + self.field.tile_um()
    }

    fn height_um(&self, p: DVec2) -> f64 {
        self.field.height_at_um(self.place(p))
    }

    /// Upper end of the section's axis, um.
    fn section_top_um(&self) -> f64 {
        (1.15 * self.field.max_height_um()).max(0.15 * self.side_um)
    }

    /// How bright the relief is around a point, from the slope over a step: 1 where it is level.
    fn relief(&self, p: DVec2, step_um: f64) -> f64 {
        let slope = |axis: DVec2| {
            let d = axis * step_um / 2.0;
            (self.height_um(p + d) - self.height_um(p - d)) / step_um
        };
        let normal = DVec3::new(-slope(DVec2::X), -slope(DVec2::Y), 1.0).normalize();
        let light = DVec3::new(-1.0, 1.0, std::f64::consts::SQRT_2).normalize();
        0.5 + 0.5 * normal.dot(light).max(0.0) / light.z
    }
}

fn scene(field: &CellField, name: &str) -> Scene {
    let view = View::new(field);
    let (map, map_layout) = map(&view);
    let (section, section_layout) = section(&view);
    let d = field.description();
    let plot_px = WIDTH_PX - MARGINS_PX.0 - MARGINS_PX.1;
    let section_px = plot_px * view.section_top_um() / view.side_um;
    let margins_px = MARGINS_Y_PX.0 + MARGINS_Y_PX.1;
    let title =
        format!("{name}: {}, pitch {} µm, height {} µm", profile_name(field), d.pitch_um, d.height_um);
    let mut scene = Figure::new(2, 1)
        .with_plots(vec![map, section])
        .with_layouts(vec![map_layout, section_layout])
        .with_cell_size(WIDTH_PX, plot_px + margins_px)
        .with_row_height(1, section_px.min(1600.0) + margins_px)
        .with_title(title)
        .with_title_size(17)
        .render();
    shade(&mut scene, &view);
    scene
}

/// The profile's name in files.
fn profile_name(field: &CellField) -> String {
    toml::Value::try_from(field.description().profile)
        .ok()
        .and_then(|v| v.as_str().map(|s| s.replace('_', " ")))
        .unwrap_or_default()
}

/// Middles of the map's points, row by row from the bottom.
fn map_points(side_um: f64) -> impl Iterator<Item = DVec2> {
    let at = move |i: usize| (i as f64 + 0.5) * side_um / MAP_POINTS as f64;
    (0..MAP_POINTS * MAP_POINTS).map(move |i| DVec2::new(at(i % MAP_POINTS), at(i / MAP_POINTS)))
}

fn map(view: &View) -> (Vec<Plot>, Layout) {
    let heights: Vec<f64> = map_points(view.side_um).map(|p| view.height_um(p)).collect();
    let side = view.side_um;
    let mut plots = vec![Plot::Heatmap(
        Heatmap::new()
            .with_data(heights.chunks(MAP_POINTS).map(<[f64]>::to_vec))
            .with_x_range(0.0, side)
            .with_y_range(0.0, side)
            .with_cell_size(1.0),
    )];
    let line = |a: DVec2, b: DVec2| {
        LinePlot::new().with_data([(a.x, a.y), (b.x, b.y)]).with_color("#ffffff").with_stroke_width(1.0)
    };
    for (a, b) in outline_edges(view) {
        plots.push(Plot::Line(line(a, b)));
    }
    let y = view.section_um;
    plots.push(Plot::Line(
        line(DVec2::new(0.0, y), DVec2::new(side, y)).with_color("#ff5a1f").with_stroke_width(2.0),
    ));
    let layout = Layout::auto_from_plots(&plots)
        .with_title("From above: height in µm (colour), cell outlines (white), section (orange)")
        .with_title_size(13)
        .with_x_axis_min(0.0)
        .with_x_axis_max(side)
        .with_y_axis_min(0.0)
        .with_y_axis_max(side)
        .with_show_grid(false)
        .with_force_margins(MARGINS_PX.0, MARGINS_PX.1)
        .with_force_margins_y(MARGINS_Y_PX.0, MARGINS_Y_PX.1)
        .with_equal_aspect()
        .with_colorbar_tick_format(TickFormat::Auto)
        .with_x_label("x, µm")
        .with_y_label("y, µm");
    (plots, layout)
}

/// Edges of the Voronoi cells, each once, cut off at the view's border.
fn outline_edges(view: &View) -> Vec<(DVec2, DVec2)> {
    let tile = view.field.tile_um();
    // Cells of the tiles around reach into the view.
    let tiles = (DVec2::splat(view.side_um) / tile).ceil() + 2.0;
    let mut edges = Vec::new();
    for outline in voronoi_outlines(view.field, [tiles.x as u32, tiles.y as u32]) {
        for (i, &a) in outline.iter().enumerate() {
            let b = outline[(i + 1) % outline.len()];
            // The cell beyond has the same edge the other way round.
            let forward = if (b.x - a.x).abs() > 1e-9 * view.side_um { b.x > a.x } else { b.y > a.y };
            if forward {
                edges.extend(clip(a - tile, b - tile, view.side_um));
            }
        }
    }
    edges
}

/// The part of a segment that lies in the square from 0 to `side` (Liang and Barsky).
fn clip(a: DVec2, b: DVec2, side: f64) -> Option<(DVec2, DVec2)> {
    let d = b - a;
    let (mut t0, mut t1) = (0.0f64, 1.0f64);
    for (start, delta) in [(a.x, d.x), (a.y, d.y)] {
        if delta == 0.0 {
            if !(0.0..=side).contains(&start) {
                return None;
            }
            continue;
        }
        let (u, v) = (-start / delta, (side - start) / delta);
        t0 = t0.max(u.min(v));
        t1 = t1.min(u.max(v));
    }
    (t0 < t1).then(|| (a + d * t0, a + d * t1))
}

fn section(view: &View) -> (Vec<Plot>, Layout) {
    let points = (0..SECTION_POINTS).map(|i| {
        let x = view.side_um * i as f64 / (SECTION_POINTS - 1) as f64;
        (x, view.height_um(DVec2::new(x, view.section_um)))
    });
    let line = LinePlot::new()
        .with_data(points.collect::<Vec<_>>())
        .with_color("#d55e00")
        .with_stroke_width(2.0)
        .with_fill()
        .with_fill_opacity(0.15);
    let plots = vec![Plot::Line(line)];
    let layout = Layout::auto_from_plots(&plots)
        .with_title("Section through the centres of a row")
        .with_title_size(13)
        .with_x_axis_min(0.0)
        .with_x_axis_max(view.side_um)
        .with_y_axis_min(0.0)
        .with_y_axis_max(view.section_top_um())
        .with_force_margins(MARGINS_PX.0, MARGINS_PX.1)
        .with_force_margins_y(MARGINS_Y_PX.0, MARGINS_Y_PX.1)
        .with_equal_aspect()
        .with_x_label("x, µm")
        .with_y_label("z, µm");
    (plots, layout)
}

/// Multiplies the map's colours by the relief; the colour bar keeps the pure ones.
fn shade(scene: &mut Scene, view: &View) {
    let step_um = view.side_um / MAP_POINTS as f64;
    let batch = scene.elements.iter_mut().find_map(|e| match e {
        Primitive::RectBatch { fills, .. } if fills.len() == MAP_POINTS * MAP_POINTS => Some(fills),
        _ => None,
    });
    for (fill, p) in batch.into_iter().flatten().zip(map_points(view.side_um)) {
        if let Color::Rgb(r, g, b) = *fill {
            let relief = view.relief(p, step_um);
            let [r, g, b] = [r, g, b].map(|c| (f64::from(c) * relief).clamp(0.0, 255.0) as u8);
            *fill = Color::Rgb(r, g, b);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::micro::{CellDescription, Profile};

    fn field(description: CellDescription) -> CellField {
        CellField::new(&description).expect("valid")
    }

    #[test]
    fn shows_axes_and_colours() {
        let svg = svg(&field(CellDescription::default()), "thesis").expect("svg");
        for text in ["x, µm", "z, µm", "thesis: cosine, pitch 23 µm, height 37 µm"] {
            assert!(svg.contains(text), "{text}");
        }
    }

    #[test]
    fn draws_every_kind_of_field() {
        let disordered = CellDescription {
            center_disorder: 0.1,
            height_disorder: 0.2,
            tile_cells: 4,
            ..Default::default()
        };
        let flat = CellDescription { profile: Profile::Flat, ..Default::default() };
        let low = CellDescription { height_um: 0.0, ..Default::default() };
        for d in [disordered, flat, low] {
            let png = png(&field(d.clone()), "x").expect("png");
            assert!(png.starts_with(b"\x89PNG"), "{d:?}");
        }
    }

    #[test]
    fn outlines_fill_the_view_once() {
        let f = field(CellDescription::default());
        let view = View::new(&f);
        let edges = outline_edges(&view);
        let length: f64 = edges.iter().map(|(a, b)| a.distance(*b)).sum();
        // A hexagon of inner radius p / 2 has 6 sides of p / sqrt 3, each shared by two, on sqrt(3) / 2 p^2.
        let per_um = 3.0 / 3f64.sqrt() / (3f64.sqrt() / 2.0) / 23.0;
        let expected = per_um * view.side_um * view.side_um;
        assert!((length / expected - 1.0).abs() < 0.05, "{length} {expected}");
        let inside = |p: DVec2| p.min_element() >= -1e-9 && p.max_element() <= view.side_um + 1e-9;
        assert!(edges.iter().all(|(a, b)| inside(*a) && inside(*b)));
    }

    #[test]
    fn the_section_runs_over_the_tops() {
        let f = field(CellDescription::default());
        let view = View::new(&f);
        let top = (0..1000)
            .map(|i| view.height_um(DVec2::new(view.side_um * f64::from(i) / 1000.0, view.section_um)))
            .fold(0.0, f64::max);
        assert!(top > 36.9, "{top}");
    }
}

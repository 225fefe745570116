//! Residuals over the hemisphere: where a model is too bright and where too dark.
//!
//! One disc per lamp and side, the hemisphere seen from above: a direction is drawn at (sin theta cos phi, sin theta sin phi),
//! so equal areas are equal projected solid angles. The lamp's side is on the right; a ring marks the lamp, a cross the
//! mirror direction (behind the sheet, straight on). Colour is the standardised residual (model - reading), averaged over bands
//! and series, blue for too dark, red for too bright, white at zero, full at 3.

use std::collections::BTreeMap;

use glam::DVec3;
use kuva::render::render::{Primitive, Scene, TextAnchor};

use super::fit_plot::standardised;
use super::fit_text::round;
use super::picture::{Picture, spread};
use crate::fit::Fit;
use crate::geometry::Side;
use crate::gonio::Measurement;
use crate::gonio::measurement::instrument_deg;

const MAX_DISCS: usize = 12;
const RADIUS: f64 = 92.0;
/// Room of a disc with its title and labels.
const CELL: (f64, f64) = (240.0, 240.0);
const SCALE_WIDTH: f64 = 90.0;
/// Colours are full here.
const LIMIT: f64 = 3.0;
/// Cells across a disc: residuals in one cell are averaged, so that no picture grows without bound.
const CELLS: f64 = 40.0;
const GREY: &str = "#777777";
const RINGS_DEG: [f64; 2] = [30.0, 60.0];

/// The discs of a fit; `None` where there is no reading.
pub fn residual_map(measurement: &Measurement, fit: &Fit) -> Option<Picture> {
    let discs = discs(measurement, &standardised(fit));
    if discs.is_empty() {
        return None;
    }
    let shown = spread(discs.len(), MAX_DISCS);
    let columns = shown.len().min(4);
    let rows = shown.len().div_ceil(columns);
    let head = if shown.len() < discs.len() { 24.0 } else { 0.0 };
    let mut scene = Scene::new(columns as f64 * CELL.0 + SCALE_WIDTH, head + rows as f64 * CELL.1);
    if head > 0.0 {
        let title = format!("{} of {} discs", shown.len(), discs.len());
        scene.add(text(8.0, 17.0, title, TextAnchor::Start, 12));
    }
    for (place, &k) in shown.iter().enumerate() {
        let x = (place % columns) as f64 * CELL.0 + CELL.0 / 2.0;
        let y = head + (place / columns) as f64 * CELL.1 + CELL.1 / 2.0 + 8.0;
        draw(&mut scene, &discs[k], (x, y));
    }
    scale(&mut scene, columns as f64 * CELL.0, head + CELL.1 / 2.0 + 8.0);
    Some(Picture::new(scene))
}

/// Readings of one lamp on one side.
struct Disc {
    incident_deg: f64,
    side: Side,
    transmitted: bool,
    /// Place on the unit disc and residual.
    points: Vec<([f64; 2], f64)>,
}

fn discs(measurement: &Measurement, residuals: &[f64]) -> Vec<Disc> {
    let mut found: Vec<Gathered> = Vec::new();
    for (r, z) in measurement.readings.iter().zip(residuals) {
        let (incident_deg, theta_deg, phi_deg, side) = instrument_deg(r.wi, r.wo);
        let transmitted = theta_deg > 90.0;
        let same = |g: &Gathered| g.disc.transmitted == transmitted && g.wi.distance_squared(r.wi) < 1e-12;
        // Readings of one lamp follow each other, so the last is tried first.
        let at = found.iter().rposition(same).unwrap_or_else(|| {
            let incident_deg = round(incident_deg);
            let disc = Disc { incident_deg, side, transmitted, points: Vec::new() };
            found.push(Gathered { wi: r.wi, disc, cells: BTreeMap::new() });
            found.len() - 1
        });
        let (radius, phi) = (theta_deg.to_radians().sin(), phi_deg.to_radians());
        let place = [radius * phi.cos(), radius * phi.sin()];
        let [column, row] = place.map(|p| (p * CELLS / 2.0).round() as i64);
        let cell = found[at].cells.entry((row, column)).or_default();
        cell.place[0] += place[0];
        cell.place[1] += place[1];
        cell.residual += z;
        cell.n += 1.0;
    }
    let mean = |c: Cell| (c.place.map(|p| p / c.n), c.residual / c.n);
    let finish = |g: Gathered| Disc { points: g.cells.into_values().map(mean).collect(), ..g.disc };
    found.into_iter().map(finish).collect()
}

/// A disc in the making.
struct Gathered {
    wi: DVec3,
    disc: Disc,
    cells: BTreeMap<(i64, i64), Cell>,
}

/// Sums over the readings in one cell of a disc.
#[derive(Default)]
struct Cell {
    place: [f64; 2],
    residual: f64,
    n: f64,
}

fn draw(scene: &mut Scene, disc: &Disc, (x, y): (f64, f64)) {
    let ring = |r: f64, width: f64, color: &str| Primitive::Circle {
        cx: x,
        cy: y,
        r,
        fill: "none".into(),
        fill_opacity: None,
        stroke: Some(color.into()),
        stroke_width: Some(width),
    };
    let line = |x1: f64, y1: f64, x2: f64, y2: f64, color: &str, width: f64| Primitive::Line {
        x1,
        y1,
        x2,
        y2,
        stroke: color.into(),
        stroke_width: width,
        stroke_dasharray: None,
    };
    scene.add(line(x - RADIUS, y, x + RADIUS, y, "#cccccc", 0.8));
    for theta_deg in RINGS_DEG {
        let r = RADIUS * theta_deg.to_radians().sin();
        scene.add(ring(r, 0.8, "#cccccc"));
    }
    scene.add(ring(RADIUS, 1.2, GREY));
    let size = (0.6 * RADIUS * spacing(&disc.points)).clamp(2.2, 9.0);
    for ([px, py], z) in &disc.points {
        scene.add(Primitive::Circle {
            cx: x + RADIUS * px,
            // Seen from above, azimuth runs anticlockwise.
            cy: y - RADIUS * py,
            r: size,
            fill: color(*z).as_str().into(),
            fill_opacity: None,
            stroke: Some(GREY.into()),
            stroke_width: Some(0.4),
        });
    }
    // Between the azimuths that goniometers like, over the points.
    let (sin, cos) = 285f64.to_radians().sin_cos();
    for theta_deg in RINGS_DEG {
        let r = RADIUS * theta_deg.to_radians().sin() - 4.0;
        let label = text(x + r * cos, y - r * sin + 3.0, format!("{theta_deg:.0}°"), TextAnchor::Middle, 9);
        scene.add(label);
    }
    let lamp = RADIUS * disc.incident_deg.to_radians().sin();
    // Above the points, so that both are seen.
    scene.add(Primitive::Circle {
        cx: x + lamp,
        cy: y,
        r: 5.0,
        fill: "none".into(),
        fill_opacity: None,
        stroke: Some("#000000".into()),
        stroke_width: Some(1.6),
    });
    for (dx, dy) in [(4.0, 4.0), (4.0, -4.0)] {
        scene.add(line(x - lamp - dx, y - dy, x - lamp + dx, y + dy, "#000000", 1.6));
    }
    scene.add(text(x + RADIUS + 4.0, y + 4.0, "lamp".into(), TextAnchor::Start, 10));
    let part = if disc.transmitted { "transmitted" } else { "reflected" };
    let side = if disc.side == Side::Abaxial { ", abaxial" } else { "" };
    let title = format!("lamp at {}°{side}, {part}", disc.incident_deg);
    scene.add(text(x, y - RADIUS - 10.0, title, TextAnchor::Middle, 12));
}

/// Median distance of a point to its nearest neighbour.
fn spacing(points: &[([f64; 2], f64)]) -> f64 {
    let distance = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let mut nearest: Vec<f64> = points
        .iter()
        .enumerate()
        .map(|(i, a)| {
            let others = points.iter().enumerate().filter(|(j, _)| *j != i);
            others.map(|(_, b)| distance(a.0, b.0)).fold(2.0, f64::min)
        })
        .collect();
    nearest.sort_by(f64::total_cmp);
    nearest.get(nearest.len() / 2).copied().unwrap_or(2.0)
}

/// The bar of colours at the right.
fn scale(scene: &mut Scene, x: f64, y: f64) {
    const STEPS: i32 = 60;
    let height = 1.5 * RADIUS;
    let at = |z: f64| y - height / 2.0 * z / LIMIT;
    for k in 0..STEPS {
        let z = |k: i32| LIMIT * (2.0 * f64::from(k) / f64::from(STEPS) - 1.0);
        scene.add(Primitive::Rect {
            x: x + 14.0,
            y: at(z(k + 1)),
            width: 12.0,
            height: height / f64::from(STEPS) + 0.3,
            fill: color(0.5 * (z(k) + z(k + 1))).as_str().into(),
            stroke: None,
            stroke_width: None,
            opacity: None,
        });
    }
    for (z, name) in
        [(-3.0, "≤ −3"), (-2.0, "−2"), (-1.0, "−1"), (0.0, "0"), (1.0, "1"), (2.0, "2"), (3.0, "≥ 3")]
    {
        scene.add(text(x + 31.0, at(z) + 4.0, name.into(), TextAnchor::Start, 11));
    }
    scene.add(text(x + 4.0, y - height / 2.0 - 14.0, "too bright".into(), TextAnchor::Start, 11));
    scene.add(text(x + 4.0, y + height / 2.0 + 22.0, "too dark".into(), TextAnchor::Start, 11));
}

fn text(x: f64, y: f64, content: String, anchor: TextAnchor, size: u32) -> Primitive {
    Primitive::Text { x, y, content, size, anchor, rotate: None, bold: false, color: Some("#000000".into()) }
}

/// Blue, white, red.
fn color(z: f64) -> String {
    const STOPS: [[f64; 3]; 5] = [
        [24.0, 78.0, 158.0],
        [126.0, 178.0, 220.0],
        [248.0, 247.0, 244.0],
        [238.0, 150.0, 116.0],
        [170.0, 24.0, 38.0],
    ];
    let t = ((z / LIMIT).clamp(-1.0, 1.0) + 1.0) * 2.0;
    let low = (t as usize).min(3);
    let mix = |c: usize| {
        let f = t - low as f64;
        (STOPS[low][c] * (1.0 - f) + STOPS[low + 1][c] * f).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::toy::{self, Toy};
    use crate::gonio::measurement::direction_deg;

    const VALUES: [f64; 4] = [0.3, 0.1, 0.0, 20.0];

    #[test]
    fn every_lamp_and_side_has_its_disc() {
        let toy = Toy::new(1.0);
        let mut m = toy::measurement(&toy, &VALUES, &[0.0, 30.0], &[450.0, 650.0], &["a", "b"]);
        let mut through = m.readings[0];
        through.wo = direction_deg(150.0, 20.0);
        m.readings.push(through);
        let fit = toy::fit(&toy, &m, &VALUES);
        let found = discs(&m, &standardised(&fit));
        assert_eq!(found.len(), 3);
        // Bands and series share their directions; near the normal and the rim none is merged.
        assert_eq!(found[0].points.len(), 7 * 12 + 1);
        let svg = residual_map(&m, &fit).unwrap().svg();
        for part in ["lamp at 30°, reflected", "lamp at 0°, transmitted", "too bright"] {
            assert!(svg.contains(part), "{part}");
        }
        // Two lamps only fill one row of a few; twenty are thinned out.
        let lamps: Vec<f64> = (0..20).map(|k| f64::from(k) * 4.0).collect();
        let m = toy::measurement(&toy, &VALUES, &lamps, &[550.0], &["a"]);
        let fit = toy::fit(&toy, &m, &VALUES);
        assert!(residual_map(&m, &fit).unwrap().svg().contains("12 of 20 discs"));
        let empty = Measurement::default();
        assert!(residual_map(&empty, &toy::fit(&toy, &empty, &VALUES)).is_none());
    }

    #[test]
    fn places_are_projected_with_the_lamp_on_the_right() {
        let toy = Toy::new(1.0);
        let mut m = toy::measurement(&toy, &VALUES, &[30.0], &[550.0], &["a"]);
        m.readings.truncate(1);
        // Lit from below at azimuth 90, seen on the lamp's side: still on the right.
        (m.readings[0].wi, m.readings[0].wo) = (direction_deg(150.0, 90.0), direction_deg(150.0, 90.0));
        let found = discs(&m, &[1.0]);
        let (place, z) = found[0].points[0];
        assert!((place[0] - 0.5).abs() < 1e-12 && place[1].abs() < 1e-12 && z == 1.0, "{place:?}");
        assert!(found[0].side == Side::Abaxial && !found[0].transmitted);
    }

    #[test]
    fn colours_are_centred_at_zero_and_end_at_three() {
        assert_eq!(color(0.0), "#f8f7f4");
        assert_eq!(color(3.0), color(99.0));
        let red = |z: f64| u8::from_str_radix(&color(z)[1..3], 16).unwrap();
        assert!(red(-3.0) < red(-1.0) && red(-1.0) < red(0.0));
    }
}

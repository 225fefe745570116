//! Law 8, disorder: irregular cells reflect as much as regular ones but spread the light that passes them.
//!
//! Model: directions of the light as it first goes down through the floor of the upper epidermis, lamp at 0 deg, in bins of equal
//! solid angle; the solid angle that they fill evenly, without the noise of counting:
//!
//! ```text
//! Omega = 2 pi / (bins sum n (n - 1) / (N (N - 1)))
//! ```
//!
//! Guarded by `law_8_disorder`. Source: Fritz et al. 2017 (ray tracing of rose petals' cells on a solar cell: disorder of
//! height, orientation and position leaves the antireflection and broadens the transmitted directions). How much disorder is our
//! reading.

use std::f64::consts::TAU;

use glam::DVec3;
use rayon::prelude::*;

use super::walks::{Sample, comes_back, difference, mean, ratio, to_lamp, when};
use super::{Effort, Finding, Law, Wanted};
use crate::Result;
use crate::gonio::Estimate;
use crate::io::line_chart::{Chart, Series};
use crate::math::Stream;

const PARTS: u64 = 8;
const ROWS: usize = 24;
const COLUMNS: usize = 48;
const DISORDERED: [&str; 4] = [
    "cells.center_disorder=0.1",
    "cells.height_disorder=0.15",
    "cells.tilt_disorder_deg=5",
    "cells.tile_cells=32",
];

/// Solid angle that the light below the epidermis fills, sr, and its shares per row (equal steps of the cosine, steepest first).
fn below(petal: &Sample, effort: Effort) -> (Estimate, [Estimate; ROWS]) {
    let part = |k: u64| {
        let mut counts = vec![0.0f64; ROWS * COLUMNS];
        for walk in 0..effort.walks / PARTS {
            let mut stream = Stream::new(effort.seed, k, walk);
            let mut first = None;
            petal.walk.walk_watching_floor(to_lamp(0.0, 0.0), &mut stream, &mut |_, d: DVec3| {
                first.get_or_insert(d);
            });
            let Some(d) = first else { continue };
            let row = (((1.0 - d.z.abs()) * ROWS as f64) as usize).min(ROWS - 1);
            let column = ((d.y.atan2(d.x) / TAU + 0.5) * COLUMNS as f64) as usize;
            counts[row * COLUMNS + column.min(COLUMNS - 1)] += 1.0;
        }
        let n: f64 = counts.iter().sum();
        let pairs: f64 = counts.iter().map(|c| c * (c - 1.0)).sum();
        let rows: [f64; ROWS] =
            std::array::from_fn(|r| counts[r * COLUMNS..(r + 1) * COLUMNS].iter().sum::<f64>() / n);
        (TAU / (counts.len() as f64 * pairs / (n * (n - 1.0))), rows)
    };
    let parts: Vec<_> = (0..PARTS).into_par_iter().map(part).collect();
    let solid_angle = mean(&parts.iter().map(|p| p.0).collect::<Vec<_>>());
    (solid_angle, std::array::from_fn(|r| mean(&parts.iter().map(|p| p.1[r]).collect::<Vec<_>>())))
}

/// Measures the law.
pub fn measure(effort: Effort) -> Result<Law> {
    let petals = [Sample::new("rote_rose", &[])?, Sample::new("rote_rose", &DISORDERED)?];
    let mut reflected = Vec::new();
    let mut spread = Vec::new();
    for petal in &petals {
        let mu = petal.at(650.0)?;
        let mut of = Vec::new();
        for deg in [0.0, 60.0] {
            of.push(petal.tally(deg, effort, |wi, exit| {
                let back = comes_back(wi, exit);
                [when(back, exit.remaining(&mu)), when(exit.is_surface(), 1.0)]
            }));
        }
        reflected.push(of);
        spread.push(below(petal, effort));
    }
    let change = |lamp: usize| difference(reflected[1][lamp][0], reflected[0][lamp][0]);
    let exterior = difference(reflected[1][0][1], reflected[0][0][1]);
    let line = |name: &str, k: usize| {
        let angle = |r: usize| (1.0 - (r as f64 + 0.5) / ROWS as f64).acos().to_degrees();
        let per_sr = ROWS as f64 / TAU;
        Series::new(name, (0..ROWS).map(|r| (angle(r), spread[k].1[r].scaled(per_sr))).collect())
    };
    Ok(Law {
        number: 8,
        name: "Disorder",
        claim: "Disorder in the lattice hardly changes the total reflection but broadens the transmitted directions.",
        source: "Fritz et al. 2017",
        method: "`rote_rose`, regular and with `-D cells.center_disorder=0.1 -D cells.height_disorder=0.15 -D cells.tilt_disorder_deg=5`: \
                 reflectance at 650 nm, exterior light, and the directions in which light first goes down through the floor of the \
                 upper epidermis (lamp at 0 deg), as the solid angle that they fill.",
        findings: vec![
            Finding::new("change of the reflectance, lamp at 0 deg", change(0), Wanted::Between(-0.02, 0.02)),
            Finding::new(
                "change of the reflectance, lamp at 60 deg",
                change(1),
                Wanted::Between(-0.02, 0.02),
            ),
            Finding::new(
                "change of the exterior light, lamp at 0 deg",
                exterior,
                Wanted::Between(-0.01, 0.01),
            ),
            Finding::new(
                "solid angle of the light below, disordered over regular",
                ratio(spread[1].0, spread[0].0),
                Wanted::Above(1.05),
            ),
        ],
        remark: "How irregular a real epidermis is, is our reading.",
        chart: Chart {
            title: "Law 8: directions below the upper epidermis, lamp at 0 deg".into(),
            x_label: "angle from the normal, deg".into(),
            y_label: "mean intensity, 1/sr".into(),
            log_y: true,
            series: vec![line("regular", 0), line("disordered", 1)],
        },
    })
}

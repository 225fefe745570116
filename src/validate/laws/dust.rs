//! Law 7, diamond dust: domes gather light into bright spots on the layer below them, flat cells do not.
//!
//! Model: light of a distant lamp that first reaches the floor of the upper epidermis, counted on a grid over the cells' tile;
//! contrast C of its irradiance E, without the noise of counting:
//!
//! ```text
//! C^2 = var(E) / mean(E)^2 = bins sum n (n - 1) / (N (N - 1)) - 1
//! ```
//!
//! Guarded by `law_7_diamond_dust`. Source: Hayashi 2001 (KAKEN): the sparkle is light that domes focus onto a
//! bright spongy layer. Limits: what is shown is the light that the spongy layer receives; its way back to the eye is not.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::walks::{Sample, mean, ratio, to_lamp};
use super::{Effort, Finding, Law, Wanted};
use crate::gonio::Estimate;
use crate::io::line_chart::{Chart, Series};
use crate::math::Stream;
use crate::micro::CellField;
use crate::{Error, Result};

/// Independent parts of the walks, for standard errors.
const PARTS: u64 = 8;
/// Edge of a bin, um, about.
const BIN_UM: f64 = 1.5;
/// Rings around a cell's centre, for the plot.
const RINGS: usize = 9;
/// Corners of the thesis' hexagons, um.
const OUTERMOST_UM: f64 = 13.28;

/// What reaches the floor.
struct Floor {
    contrast: Estimate,
    /// Share of the light per ring around the cells' centres.
    rings: [Estimate; RINGS],
}

fn floor(petal: &Sample, lamp_deg: f64, effort: Effort) -> Result<Floor> {
    let missing = || Error::invalid("tissue.adaxial", "the petal has no upper epidermis");
    let cells: &CellField = &petal.tissue.adaxial.as_ref().ok_or_else(missing)?.cells;
    let tile = cells.tile_um();
    let size = (tile / BIN_UM).ceil().as_uvec2();
    let part = |k: u64| {
        let mut counts = vec![0.0f64; (size.x * size.y) as usize];
        let mut rings = [0.0f64; RINGS];
        for walk in 0..effort.walks / PARTS {
            let mut stream = Stream::new(effort.seed, k, walk);
            let mut first = None;
            let wi = to_lamp(lamp_deg, 0.0);
            petal.walk.walk_watching_floor(wi, &mut stream, &mut |p: DVec3, _| {
                first.get_or_insert(p.truncate());
            });
            let Some(p) = first else { continue };
            let u = (p / tile - (p / tile).floor()).min(DVec2::splat(1.0 - 1e-12));
            let bin = (u * size.as_dvec2()).as_uvec2();
            counts[(bin.y * size.x + bin.x) as usize] += 1.0;
            let from_centre = (p - cells.cell_at(p).1).length();
            rings[((from_centre / OUTERMOST_UM * RINGS as f64) as usize).min(RINGS - 1)] += 1.0;
        }
        let n: f64 = counts.iter().sum();
        let pairs: f64 = counts.iter().map(|c| c * (c - 1.0)).sum();
        let contrast2 = counts.len() as f64 * pairs / (n * (n - 1.0)) - 1.0;
        (contrast2.max(0.0).sqrt(), rings.map(|r| r / n))
    };
    let parts: Vec<_> = (0..PARTS).into_par_iter().map(part).collect();
    let contrasts: Vec<f64> = parts.iter().map(|p| p.0).collect();
    let ring = |r: usize| mean(&parts.iter().map(|p| p.1[r]).collect::<Vec<f64>>());
    Ok(Floor { contrast: mean(&contrasts), rings: std::array::from_fn(ring) })
}

/// Heights of the domes, in pitches.
const HEIGHTS: [f64; 3] = [0.25, 0.5, 37.0 / 23.0];

/// Measures the law.
pub fn measure(effort: Effort) -> Result<Law> {
    let flat = floor(&Sample::new("rote_rose", &["cells.profile=flat"])?, 0.0, effort)?;
    let mut domes = Vec::new();
    for height in HEIGHTS {
        let petal = Sample::new("rote_rose", &[&format!("cells.height_um={}", height * 23.0)])?;
        domes.push(floor(&petal, 0.0, effort)?);
    }
    // Upright light lights flat cells evenly: a ring's share of it is the ring's area.
    let over_mean = |of: &Floor, r: usize| ratio(of.rings[r], flat.rings[r]);
    let radius = |r: usize| (r as f64 + 0.5) / RINGS as f64 * OUTERMOST_UM;
    let mut series: Vec<Series> = HEIGHTS
        .iter()
        .zip(&domes)
        .map(|(height, of)| {
            let points = (0..RINGS).map(|r| (radius(r), over_mean(of, r))).collect();
            Series::new(format!("domes of {height:.2} pitches"), points)
        })
        .collect();
    series.push(Series::reference("flat", (0..RINGS).map(|r| (radius(r), 1.0))));
    let centre = |k: usize| ratio(domes[k].rings[0], flat.rings[0]);
    let findings = vec![
        Finding::new("contrast under flat cells", flat.contrast, Wanted::Below(0.1)),
        Finding::new("contrast under lenticular domes (0.5 pitches)", domes[1].contrast, Wanted::Above(0.5)),
        Finding::new(
            "contrast under the thesis' domes (1.61 pitches)",
            domes[2].contrast,
            Wanted::Above(0.2),
        ),
        Finding::new(
            "irradiance under the centre of a lenticular dome over the mean",
            centre(1),
            Wanted::Above(2.0),
        ),
        Finding::new(
            "irradiance under the centre of the thesis' dome over the mean",
            centre(2),
            Wanted::Above(2.0),
        ),
    ];
    Ok(Law {
        number: 7,
        name: "Diamond dust",
        claim: "Domes focus light onto the bright spongy layer and make bright spots that a flat epidermis does not make.",
        source: "Hayashi 2001",
        method: "`rote_rose` with domes of several heights and with flat cells, upright light: where it first crosses the floor of the upper \
                 epidermis. Contrast: standard deviation over mean of the irradiance in bins of 1.5 um, without the noise of counting.",
        findings,
        remark: "Domes are lenses. Those of the thesis are strongly curved and focus within the cell, so how bright the middle of the floor \
                 is depends on how deep the floor lies: with `-D tissue.adaxial.depth_um=20` in place of 10 it is no brighter than the mean. What is \
                 measured is the light that the spongy layer receives; that it is seen as sparkle needs it to come back \
                 through the same dome, which depends on how far light spreads in the spongy layer.",
        chart: Chart {
            title: "Law 7: light on the floor of the upper epidermis".into(),
            x_label: "distance from the nearest cell's centre, um".into(),
            y_label: "irradiance over its mean".into(),
            log_y: false,
            series,
        },
    })
}

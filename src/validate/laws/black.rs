//! Law 4, the black rose: the same pigment looks darker in taller, narrower cells.
//!
//! Model: `black` is `rote_rose` with cells of 18 um and 45 um in place of 23 um and 37 um, and the same concentration of
//! anthocyanin in them; their greater volume holds more of it per area. The same cells with the amount per area of
//! `rote_rose` are measured too. Luminance factor Y under D65. Guarded by `law_4_black_rose`. Source: Yasuda 1967, 1968 (extracts of
//! red and black roses have one spectrum; black ones have taller, narrower cells).

use super::walks::{Sample, comes_back, ratio, when};
use super::{Effort, Finding, Law, Wanted};
use crate::Result;
use crate::gonio::Estimate;
use crate::io::line_chart::{Chart, Series};

const PITCH_UM: f64 = 23.0;
/// Height over pitch of the cells of the plot; the third is `rote_rose` itself.
const ASPECTS: [f64; 4] = [0.5, 1.0, 37.0 / PITCH_UM, 2.5];
const LAMPS_DEG: [f64; 2] = [0.0, 45.0];

/// Luminance factors of all light that comes back from a lamp at an angle.
fn luminance(petal: &Sample, lamp_deg: f64, effort: Effort) -> Result<Estimate> {
    let bands = petal.luminous()?;
    let [y] = petal.tally(lamp_deg, effort, |wi, exit| {
        [when(comes_back(wi, exit), bands.iter().map(|(mu, w)| w * exit.remaining(mu)).sum())]
    });
    Ok(y)
}

/// Measures the law.
pub fn measure(effort: Effort) -> Result<Law> {
    let black = Sample::new("black", &[])?;
    let same_amount = Sample::new("rote_rose", &["cells.pitch_um=18", "cells.height_um=45"])?;
    let mut series = Vec::new();
    let mut findings = Vec::new();
    for deg in LAMPS_DEG {
        let mut points = Vec::new();
        for aspect in ASPECTS {
            let height = format!("cells.height_um={}", aspect * PITCH_UM);
            points.push((aspect, luminance(&Sample::new("rote_rose", &[&height])?, deg, effort)?));
        }
        let red = points[2].1;
        let what = format!("Y of `black` over Y of `rote_rose`, lamp at {deg} deg");
        findings.push(Finding::new(what, ratio(luminance(&black, deg, effort)?, red), Wanted::Below(0.8)));
        let what = format!("the same with the red rose's amount per area, lamp at {deg} deg");
        let same = ratio(luminance(&same_amount, deg, effort)?, red);
        findings.push(Finding::new(what, same, Wanted::Below(0.98)));
        let taller = ratio(points[3].1, points[0].1);
        let what = format!("Y at height 2.5 pitches over Y at 0.5 pitches, lamp at {deg} deg");
        findings.push(Finding::new(what, taller, Wanted::Below(0.9)));
        series.push(Series::new(format!("lamp at {deg} deg"), points));
    }
    Ok(Law {
        number: 4,
        name: "Black rose",
        claim: "The same pigment with taller, narrower cells looks darker.",
        source: "Yasuda 1967, 1968",
        method: "Luminance factor Y (D65, all light that comes back) of `black` and of `rote_rose`, which differ in their cells and not in \
                 the concentration of their pigment; the plot changes the height of `rote_rose`'s cells and nothing else: the amount of pigment per area stays.",
        findings,
        remark: "At the same concentration tall cells hold 1.5 times the pigment per area, and that is most of the difference. With the amount per \
                 area held, upright light finds both petals equally dark (second number: the law does not come out there); the \
                 law is then one of slanted light, and most of what tall cells do is done at a height of one pitch.",
        chart: Chart {
            title: "Law 4: the same pigment in taller cells".into(),
            x_label: "height of the cells over their pitch".into(),
            y_label: "luminance factor Y".into(),
            log_y: false,
            series,
        },
    })
}

/// What does not come out (see the remark).
pub const UPRIGHT: &str = "the same with the red rose's amount per area, lamp at 0 deg";

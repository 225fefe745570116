//! Law 1, retro-reflection: domes send more light back to the lamp than flat cells do, the more the lower the lamp stands.
//!
//! Model: retro index = light within 15 deg of the lamp / light within 15 deg of the mirror direction (both caps hold the same
//! solid angle and cosines, so a Lambertian petal has 1). Guarded by `law_1_retro`. Source: Terado 1999; the index is our
//! reading, as in [`crate::gonio::retro`].

use super::walks::{Sample, mirror, near, ratio, when};
use super::{Effort, Finding, Law, Wanted};
use crate::Result;
use crate::gonio::Estimate;
use crate::io::line_chart::{Chart, Series};

const LAMPS_DEG: [f64; 4] = [30.0, 45.0, 60.0, 75.0];
const CAP_DEG: f64 = 15.0;
/// Little pigment absorbs here, and all of it there.
const RED_NM: f64 = 650.0;
const GREEN_NM: f64 = 540.0;

/// Light near the lamp and near the mirror direction, at both wavelengths.
fn caps(petal: &Sample, effort: Effort) -> Result<Vec<[Estimate; 4]>> {
    let (red, green) = (petal.at(RED_NM)?, petal.at(GREEN_NM)?);
    let at = |deg| {
        petal.tally(deg, effort, |wi, exit| {
            let to_lamp = near(exit.direction, wi, CAP_DEG);
            let on = near(exit.direction, mirror(wi), CAP_DEG);
            if !to_lamp && !on {
                return [0.0; 4];
            }
            let (r, g) = (exit.remaining(&red), exit.remaining(&green));
            [when(to_lamp, r), when(on, r), when(to_lamp, g), when(on, g)]
        })
    };
    Ok(LAMPS_DEG.map(at).to_vec())
}

/// Measures the law.
pub fn measure(effort: Effort) -> Result<Law> {
    let domes = caps(&Sample::new("rote_rose", &[])?, effort)?;
    let flat = caps(&Sample::new("rote_rose", &["cells.profile=flat"])?, effort)?;
    let index =
        |of: &[[Estimate; 4]], lamp: usize, band: usize| ratio(of[lamp][2 * band], of[lamp][2 * band + 1]);
    let to_lamp = |lamp: usize| ratio(domes[lamp][0], flat[lamp][0]);
    let line = |name: &str, of: &[[Estimate; 4]], band: usize| {
        Series::new(name, LAMPS_DEG.iter().enumerate().map(|(k, deg)| (*deg, index(of, k, band))).collect())
    };
    let mut series = vec![
        line("domes, 650 nm", &domes, 0),
        line("flat, 650 nm", &flat, 0),
        line("domes, 540 nm", &domes, 1),
        line("flat, 540 nm", &flat, 1),
    ];
    series.push(Series::reference("Lambertian", [(LAMPS_DEG[0], 1.0), (LAMPS_DEG[3], 1.0)]));
    let findings = vec![
        Finding::new("light to the lamp, domes over flat, 75 deg, 650 nm", to_lamp(3), Wanted::Above(1.2)),
        Finding::new(
            "the same at 75 deg over the same at 30 deg",
            ratio(to_lamp(3), to_lamp(0)),
            Wanted::Above(1.2),
        ),
        Finding::new(
            "index of domes over index of flat cells, 60 deg, 650 nm",
            ratio(index(&domes, 2, 0), index(&flat, 2, 0)),
            Wanted::Above(2.0),
        ),
        Finding::new("index of domes, 75 deg, 540 nm", index(&domes, 3, 1), Wanted::Above(1.0)),
        Finding::new(RETRO_PEAK, index(&domes, 2, 0), Wanted::Above(1.2)),
    ];
    Ok(Law {
        number: 1,
        name: "Retro",
        claim: "A domed epidermis returns more light towards the lamp than a flat one, ever more at grazing incidence.",
        source: "Terado 1999",
        method: "`rote_rose` with its domes and with `-D cells.profile=flat`, at 650 nm (little pigment absorbs) and 540 nm (all of it). \
                 Retro index: light within 15 deg of the lamp over light within 15 deg of the mirror direction; a Lambertian \
                 petal has 1.",
        findings,
        remark: "The last number is the thesis' finding in the strict sense, more light back to the lamp than on to the mirror, in the \
                 light that a red petal sends back most. It does not come out: light from within is Lambertian (law 5), it outweighs \
                 the surface's, and domes only take the mirror's highlight away. Where pigment leaves the surface's light alone the index is \
                 far above 1. In the thesis' own model (`thesis.md`) the domes themselves reflect diffusely, and the index exceeds 2.",
        chart: Chart {
            title: "Law 1: light back to the lamp".into(),
            x_label: "lamp's angle from the normal, deg".into(),
            y_label: "retro index".into(),
            log_y: true,
            series,
        },
    })
}

/// What does not come out (see the remark).
pub const RETRO_PEAK: &str = "index of domes, 60 deg, 650 nm";

//! Law 5, light from within: near-Lambertian, coloured by two passes through the epidermis.
//!
//! Model: radiance of the interior light over that of a Lambertian petal of the same reflectance, in bins equal in sin^2 (equal
//! shares for Lambert); its root mean square distance from 1. Passes: mean way in the upper epidermis of the light that
//! comes back over that of the light that goes through. Guarded by `law_5_interior`. Sources: Stavenga et al. 2020 (cosine
//! law); Biran et al. 1974 (through the epidermis, back from the colourless mesophyll).

use super::walks::{Sample, comes_back, ratio, when};
use super::{Effort, Finding, Law, Wanted};
use crate::Result;
use crate::gonio::Estimate;
use crate::io::line_chart::{Chart, Series};

const BINS: usize = 10;

/// Shares of the interior light per bin of sin^2, times the number of bins.
fn profile(petal: &Sample, lamp_deg: f64, effort: Effort) -> [Estimate; BINS] {
    let shares = petal.tally::<BINS>(lamp_deg, effort, |wi, exit| {
        let mut bins = [0.0; BINS];
        if comes_back(wi, exit) && !exit.is_surface() {
            let sin2 = 1.0 - exit.direction.z * exit.direction.z;
            bins[((sin2 * BINS as f64) as usize).min(BINS - 1)] = 1.0;
        }
        bins
    });
    let total: f64 = shares.iter().map(|e| e.value).sum();
    shares.map(|e| e.scaled(BINS as f64 / total))
}

/// Root mean square distance from 1, less what noise adds to it.
fn distance_from_lambert(profile: &[Estimate; BINS]) -> Estimate {
    let n = BINS as f64;
    let square: f64 =
        profile.iter().map(|e| (e.value - 1.0).powi(2) - e.standard_error.powi(2)).sum::<f64>() / n;
    let variance: f64 = profile
        .iter()
        .map(|e| 4.0 * ((e.value - 1.0) * e.standard_error).powi(2) + 2.0 * e.standard_error.powi(4))
        .sum::<f64>()
        / (n * n);
    let value = square.max(0.0).sqrt();
    Estimate {
        value,
        standard_error: if value > 0.0 { variance.sqrt() / (2.0 * value) } else { variance.sqrt().sqrt() },
    }
}

/// Measures the law.
pub fn measure(effort: Effort) -> Result<Law> {
    let petal = Sample::new("rote_rose", &[])?;
    let lamps = [0.0, 45.0];
    let profiles = lamps.map(|deg| profile(&petal, deg, effort));
    let [back, back_way, through, through_way] = petal.tally(0.0, effort, |wi, exit| {
        let back = when(comes_back(wi, exit) && !exit.is_surface(), 1.0);
        let through = when(!comes_back(wi, exit), 1.0);
        [back, back * exit.path_um[0], through, through * exit.path_um[0]]
    });
    let (twice, once) = (ratio(back_way, back), ratio(through_way, through));
    let ways = twice.scaled(1.0 / petal.tissue.depth_um[0]);
    let mut series: Vec<Series> = lamps
        .iter()
        .zip(&profiles)
        .map(|(deg, profile)| {
            let angle = |k: usize| ((k as f64 + 0.5) / BINS as f64).sqrt().asin().to_degrees();
            let points = profile.iter().enumerate().map(|(k, e)| (angle(k), *e)).collect();
            Series::new(format!("lamp at {deg} deg"), points)
        })
        .collect();
    series.push(Series::reference("Lambertian", [(0.0, 1.0), (90.0, 1.0)]));
    Ok(Law {
        number: 5,
        name: "Light from within",
        claim: "Interior light is near-Lambertian; its colour comes from two passes through the pigmented epidermis and the colourless \
                mesophyll.",
        source: "Stavenga et al. 2020, Biran et al. 1974",
        method: "`rote_rose` without its pigment's absorption: directions of the light that entered and came back, in bins that hold equal \
                 shares of a Lambertian petal's light; and the mean way of that light in the upper epidermis over the way of the light \
                 that goes through the petal.",
        findings: vec![
            Finding::new(
                "rms distance from the cosine law, lamp at 0 deg",
                distance_from_lambert(&profiles[0]),
                Wanted::Below(0.15),
            ),
            Finding::new(
                "rms distance from the cosine law, lamp at 45 deg",
                distance_from_lambert(&profiles[1]),
                Wanted::Below(0.15),
            ),
            Finding::new(
                "way in the upper epidermis, light back over light through",
                ratio(twice, once),
                Wanted::Between(1.4, 2.6),
            ),
            Finding::new(
                "way in the upper epidermis of the light that comes back, over its depth",
                ways,
                Wanted::Above(2.0),
            ),
        ],
        remark: "The ratio of ways is below two because light that goes through has been in the upper epidermis more than once, too: the \
                 mesophyll and the walls send part of it up and down again. Ways are slanted, and totally reflected in the domes: each pass is longer than the layer is deep.",
        chart: Chart {
            title: "Law 5: interior light against Lambert's law".into(),
            x_label: "exitant angle, deg".into(),
            y_label: "radiance over Lambertian radiance".into(),
            log_y: false,
            series,
        },
    })
}

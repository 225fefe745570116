//! Law 6, two sides: the upper side is domed and dull, the lower flatter and glossier, and pigments differ by side.
//!
//! Model: gloss is the light that never entered, within 15 deg of the mirror direction (the lower side is rough), lamp at 45 deg;
//! colour is the hue of all light that comes back under D65 (CIE Lab, degrees). Guarded by `law_6_two_sides`. Sources: Biran
//! et al. 1974 ('Baccara': inner side redder, of pelargonin; outer bluer, of cyanin); Zarkovic 2021, Sulborska 2012 (adaxial
//! papillate, abaxial flat).

use glam::DVec3;

use super::walks::{Sample, bands, comes_back, difference, mean, mirror, near, ratio, when, xyz};
use super::{Effort, Finding, Law, Wanted};
use crate::Result;
use crate::gonio::Estimate;
use crate::io::line_chart::{Chart, Series};
use crate::spectrum::{Observer, color, illuminant};

const BANDS: usize = 31;
/// Independent parts of the walks, for the error of the hue.
const PARTS: u64 = 8;
const CAP_DEG: f64 = 15.0;

/// What one side shows.
struct Seen {
    spectrum: Vec<(f64, Estimate)>,
    hue_deg: Estimate,
    gloss: Estimate,
}

fn hue_deg(reflectances: &[Estimate]) -> Result<f64> {
    let white = Observer::Cie1931.xyz_of(illuminant::d65());
    let lab = color::lab(DVec3::from(xyz(reflectances)?), DVec3::from(white));
    Ok(lab.z.atan2(lab.y).to_degrees())
}

fn see(petal: &Sample, lamp_deg: f64, effort: Effort) -> Result<Seen> {
    let mu = bands().map(|nm| petal.at(nm)).collect::<Result<Vec<_>>>()?;
    let measure = |effort: Effort| {
        petal.tally::<BANDS>(lamp_deg, effort, |wi, exit| {
            let back = comes_back(wi, exit);
            std::array::from_fn(|k| when(back, exit.remaining(&mu[k])))
        })
    };
    let part = |k: u64| Effort { walks: effort.walks / PARTS, seed: effort.seed ^ ((k + 1) << 32) };
    let parts: Vec<_> = (0..PARTS).map(|k| measure(part(k))).collect();
    let spectrum = |k: usize| {
        let n = PARTS as f64;
        let value = parts.iter().map(|p| p[k].value).sum::<f64>() / n;
        let variance = parts.iter().map(|p| p[k].standard_error.powi(2)).sum::<f64>();
        Estimate { value, standard_error: variance.sqrt() / n }
    };
    let hues = parts.iter().map(|p| hue_deg(p)).collect::<Result<Vec<_>>>()?;
    let [gloss] = petal.tally(lamp_deg, effort, |wi, exit| {
        [when(exit.is_surface() && near(exit.direction, mirror(wi), CAP_DEG), 1.0)]
    });
    Ok(Seen {
        spectrum: bands().enumerate().map(|(k, nm)| (nm, spectrum(k))).collect(),
        hue_deg: mean(&hues),
        gloss,
    })
}

/// Measures the law.
pub fn measure(effort: Effort) -> Result<Law> {
    let petal = Sample::new("baccara", &[])?;
    let upper = see(&petal, 45.0, effort)?;
    let lower = see(&petal, 135.0, effort)?;
    Ok(Law {
        number: 6,
        name: "Two sides",
        claim: "Adaxial papillate, abaxial flatter; pigments differ by side.",
        source: "Biran et al. 1974, Zarkovic 2021, Sulborska 2012",
        method: "`baccara` lit at 45 deg from above and from below: exterior light within 15 deg of the mirror direction, and the hue \
                 (CIE Lab, D65) of all light that comes back.",
        findings: vec![
            Finding::new(
                "gloss, upper side over lower side",
                ratio(upper.gloss, lower.gloss),
                Wanted::Below(0.2),
            ),
            Finding::new(
                "hue of the upper side less that of the lower, deg",
                difference(upper.hue_deg, lower.hue_deg),
                Wanted::Above(3.0),
            ),
        ],
        remark: "Which pigment lies on which side is put into the preset from Biran et al.; that the two sides then look different, and that \
                 domes alone take the gloss away, is what the walk adds.",
        chart: Chart {
            title: "Law 6: the two sides of 'Baccara'".into(),
            x_label: "wavelength, nm".into(),
            y_label: "reflectance".into(),
            log_y: false,
            series: vec![
                Series::new("upper side", upper.spectrum),
                Series::new("lower side", lower.spectrum),
            ],
        },
    })
}

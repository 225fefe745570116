//! Everything that is told of a fit, as one value: what was fitted, by what, how well. Written as JSON here, as text and
//! as a page by [`crate::io`].
//!
//! Names of the fields are the keys of the JSON and are kept from release to release; `docs/fit.md` explains them.

use serde::Serialize;
use sha2::{Digest, Sha256};

use super::{Audit, Fit};
use crate::geometry::Side;
use crate::gonio::measurement::instrument_deg;
use crate::gonio::{Band, Measurement, Scale};
use crate::{Error, Result};

/// A report on the fits of one or more models to one measurement.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Name of the program.
    pub tool: String,
    /// Its version.
    pub version: String,
    /// The command that made the fits, where there was one.
    pub command: Option<String>,
    /// What was fitted.
    pub data: DataInfo,
    /// The comparison, in the order of `fits`.
    pub ladder: Vec<LadderRow>,
    /// The fits.
    pub fits: Vec<Fit>,
    /// Their audits, each with its model's name; may be fewer.
    pub audits: Vec<Audit>,
}

/// Where readings came from and what they are.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DataInfo {
    /// Name of the file, as the user gave it.
    pub file: String,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
    /// Name of the sample.
    pub sample: String,
    /// Number of readings.
    pub readings: usize,
    /// Bands.
    pub bands: Vec<Band>,
    /// Names of the series.
    pub series: Vec<String>,
    /// Directions of the lamp.
    pub lamps: Vec<LampInfo>,
    /// What the file's numbers are, in words, such as `BRF (pi x BRDF)`.
    pub quantity: String,
    /// Are the values absolute?
    pub scale: Scale,
    /// Half angle of the lamp's cone, degrees.
    pub source_half_angle_deg: f64,
    /// Half angle of the detector's cone, degrees.
    pub detector_half_angle_deg: f64,
    /// Smallest and largest reading, 1/sr.
    pub range_per_sr: [f64; 2],
    /// Have all readings a standard deviation?
    pub has_sigma: bool,
    /// What the reader left out, and why.
    pub notes: Vec<String>,
}

/// One direction of the lamp.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LampInfo {
    /// Angle from the normal of the lit side, degrees.
    pub incident_deg: f64,
    /// The lit side.
    pub side: Side,
}

/// One row of the comparison of models.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LadderRow {
    /// Model's name.
    pub model: String,
    /// Number of varied parameters.
    pub parameters: usize,
    /// Number of readings.
    pub n: usize,
    /// Root of the mean squared residual, weighted by solid angle x cosine, 1/sr.
    pub rmse_per_sr: f64,
    /// The same of cube roots of BSDF x cosine.
    pub rmse_cube_root: f64,
    /// `chi2 / (n - parameters)`.
    pub reduced_chi2: Option<f64>,
    /// Akaike's criterion.
    pub aic: Option<f64>,
    /// Bayes' criterion.
    pub bic: Option<f64>,
    /// AIC less the lowest AIC.
    pub delta_aic: Option<f64>,
    /// The lowest AIC among fits of the same readings with the same weights; at a tie, the fewest parameters.
    pub best: bool,
    /// Did the search end at a minimum?
    pub converged: bool,
}

/// `x`, where it is a number that can be shown.
fn number(x: Option<f64>) -> Option<f64> {
    x.filter(|x| x.is_finite())
}

/// The comparison of fits, in their order. Criteria can only be compared between fits of the same readings with the same
/// weights: where these differ no fit is the best and there are no differences.
pub fn ladder(fits: &[Fit]) -> Vec<LadderRow> {
    let comparable = fits.windows(2).all(|w| w[0].n == w[1].n && w[0].weighting == w[1].weighting);
    // An exact fit has no criterion; nothing fits better.
    let exact = |f: &Fit| number(f.aic).is_none() && f.chi2 <= 0.0 && f.n > 0;
    let rank = |f: &Fit| if exact(f) { Some(f64::NEG_INFINITY) } else { number(f.aic) };
    let best = (0..fits.len())
        .filter(|_| comparable)
        .filter_map(|i| rank(&fits[i]).map(|r| (i, r)))
        .min_by(|a, b| a.1.total_cmp(&b.1).then(fits[a.0].varied.cmp(&fits[b.0].varied)))
        .map(|(i, _)| i);
    let lowest = best.and_then(|i| number(fits[i].aic));
    fits.iter()
        .enumerate()
        .map(|(i, f)| LadderRow {
            model: f.model.clone(),
            parameters: f.varied,
            n: f.n,
            rmse_per_sr: f.rmse_per_sr,
            rmse_cube_root: f.rmse_cube_root,
            reduced_chi2: number(f.reduced_chi2),
            aic: number(f.aic),
            bic: number(f.bic),
            delta_aic: number(f.aic).zip(lowest).map(|(aic, lowest)| aic - lowest),
            best: best == Some(i) && fits.len() > 1,
            converged: f.converged,
        })
        .collect()
}

impl DataInfo {
    /// Describes what was read from `bytes`; `quantity` says in words what the file's numbers are.
    pub fn new(file: &str, bytes: &[u8], quantity: &str, measurement: &Measurement) -> Self {
        let values = measurement.readings.iter().map(|r| r.bsdf_per_sr);
        let least = values.clone().reduce(f64::min).unwrap_or(0.0);
        let most = values.reduce(f64::max).unwrap_or(0.0);
        let lamp = |wi| {
            let (incident_deg, _, _, side) = instrument_deg(wi, wi);
            LampInfo { incident_deg, side }
        };
        let readings = &measurement.readings;
        Self {
            file: file.to_owned(),
            sha256: Sha256::digest(bytes).iter().map(|b| format!("{b:02x}")).collect(),
            sample: measurement.sample.clone(),
            readings: readings.len(),
            bands: measurement.bands.clone(),
            series: measurement.series.clone(),
            lamps: measurement.lamps().into_iter().map(lamp).collect(),
            quantity: quantity.to_owned(),
            scale: measurement.scale,
            source_half_angle_deg: measurement.source_half_angle_deg,
            detector_half_angle_deg: measurement.detector_half_angle_deg,
            range_per_sr: [least, most],
            has_sigma: !readings.is_empty() && readings.iter().all(|r| r.sigma_per_sr.is_some()),
            notes: measurement.notes.clone(),
        }
    }
}

impl Report {
    /// A report of this program on `fits` and their `audits`.
    pub fn new(command: Option<String>, data: DataInfo, fits: Vec<Fit>, audits: Vec<Audit>) -> Self {
        Self {
            tool: env!("CARGO_PKG_NAME").to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            command,
            data,
            ladder: ladder(&fits),
            fits,
            audits,
        }
    }

    /// The report as JSON, indented.
    pub fn to_json(&self) -> Result<String> {
        serde_json::to_string_pretty(self).map_err(|e| Error::Unsupported(format!("report as JSON: {e}")))
    }

    /// The audit of a fit.
    pub fn audit(&self, model: &str) -> Option<&Audit> {
        self.audits.iter().find(|a| a.model == model)
    }

    /// What a reader should know before anything else: failed searches, broken laws, and the fits' own messages, each
    /// with its model's name; then what was left out of the file.
    pub fn warnings(&self) -> Vec<(String, String)> {
        let mut warnings = Vec::new();
        for fit in &self.fits {
            let mut warn = |what: String| warnings.push((fit.model.clone(), what));
            if !fit.converged {
                warn("the search did not end at a minimum: values and errors are not to be trusted".into());
            }
            for band in self.audit(&fit.model).into_iter().flat_map(|a| &a.bands) {
                if let Some(worst) = band.totals.get(band.largest).filter(|_| !band.conserves_energy) {
                    warn(format!(
                        "sends back more light than arrives: {:.4} of it at {:.0}° ({})",
                        worst.total(),
                        worst.incident_deg,
                        band.band
                    ));
                }
                if !band.is_reciprocal {
                    warn(format!(
                        "not reciprocal: light and view exchanged differ by up to {:.1} % ({})",
                        100.0 * band.largest_asymmetry,
                        band.band
                    ));
                }
            }
            // The first only says why the search ended.
            fit.messages.iter().skip(1).for_each(|m| warn(m.clone()));
        }
        warnings.extend(self.data.notes.iter().map(|n| (self.data.file.clone(), n.clone())));
        warnings
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::toy::{self, Toy};

    fn fits() -> (Measurement, Vec<Fit>) {
        let toy = Toy::new(1.0);
        let m = toy::measurement(&toy, &[0.3, 0.1, 0.0, 20.0], &[30.0], &[550.0], &["a"]);
        let good = toy::fit(&toy, &m, &[0.3, 0.1, 0.0, 20.0]);
        let mut bad = toy::fit(&toy, &m, &[0.4, 0.0, 0.0, 20.0]);
        bad.model = "lambert".into();
        (m, vec![bad, good])
    }

    #[test]
    fn the_lowest_criterion_is_the_best() {
        let (_, mut fits) = fits();
        let rows = ladder(&fits);
        assert_eq!(rows.iter().map(|r| r.best).collect::<Vec<_>>(), [false, true]);
        assert_eq!(rows[1].delta_aic, Some(0.0));
        assert_eq!(rows[0].delta_aic.unwrap(), fits[0].aic.unwrap() - fits[1].aic.unwrap());
        // An exact fit has no criterion and is the best.
        (fits[0].aic, fits[0].chi2) = (None, 0.0);
        let rows = ladder(&fits);
        assert!(rows[0].best && rows.iter().all(|r| r.delta_aic.is_none()));
        // Other weights are another scale.
        fits[0].weighting = "sigma".into();
        assert!(ladder(&fits).iter().all(|r| !r.best && r.delta_aic.is_none()));
        // One fit is no comparison.
        assert!(!ladder(&fits[..1])[0].best);
    }

    #[test]
    fn json_has_the_documented_names() {
        let (m, fits) = fits();
        let data = DataInfo::new("a.csv", b"abc", "BSDF", &m);
        let report = Report::new(Some("rosarium fit a.csv".into()), data, fits, Vec::new());
        let json: serde_json::Value = serde_json::from_str(&report.to_json().unwrap()).unwrap();
        // FIPS 180-2, appendix B.1.
        let hash = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(json["data"]["sha256"], hash);
        assert_eq!(json["data"]["lamps"][0]["incident_deg"].as_f64().unwrap().round(), 30.0);
        assert_eq!(json["fits"][0]["parameters"][0]["interval"]["low"]["kind"], "limit");
        let page = std::fs::read_to_string("docs/fit.md").unwrap();
        for object in
            [&json, &json["data"], &json["ladder"][0], &json["fits"][0], &json["fits"][0]["parameters"][0]]
        {
            for key in object.as_object().unwrap().keys() {
                assert!(page.contains(&format!("`{key}`")), "docs/fit.md does not explain {key}");
            }
        }
    }
}

//! What a goniophotometer measured: the BSDF per bin, totals per incidence, and look-up.
//!
//! All directions are in the instrument's frame (see [`crate::gonio`]); values are per band (wavelength),
//! BSDF in 1/sr without the cosine.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::{ExitantGrid, PlaneScan};
use crate::geometry::Side;

/// A mean with its standard error; in files the pair `[value, standard_error]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f64; 2]", into = "[f64; 2]")]
pub struct Estimate {
    /// The mean.
    pub value: f64,
    /// One standard deviation of the mean.
    pub standard_error: f64,
}

impl Estimate {
    /// Mean and standard error of `n >= 2` independent draws from their sum and sum of squares.
    ///
    /// Draws are f32, so the error is never reported below the rounding of the value itself. Paths are
    /// stratified, not independent: for smooth samples the true error is smaller than this.
    pub fn from_sums(sum: f64, sum_of_squares: f64, n: f64) -> Self {
        let value = sum / n;
        let variance = (sum_of_squares / n - value * value).max(0.0) / (n - 1.0);
        let rounding = value * f64::from(f32::EPSILON);
        Self { value, standard_error: (variance + rounding * rounding).sqrt() }
    }

    /// Value and error times a positive factor.
    pub fn scaled(self, factor: f64) -> Self {
        Self { value: self.value * factor, standard_error: self.standard_error * factor }
    }
}

impl From<[f64; 2]> for Estimate {
    fn from([value, standard_error]: [f64; 2]) -> Self {
        Self { value, standard_error }
    }
}

impl From<Estimate> for [f64; 2] {
    fn from(e: Estimate) -> Self {
        [e.value, e.standard_error]
    }
}

/// Hemispherical totals of one incidence, at one band or averaged over the bands.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Totals {
    /// Share of the light that leaves on the lit side.
    pub reflectance: Estimate,
    /// Share of the light that leaves on the other side.
    pub transmittance: Estimate,
    /// Share of the light that does not leave.
    pub absorptance: Estimate,
    /// Mean BRDF within 15 deg of the lamp's direction, 1/sr.
    pub retro_brdf: Estimate,
    /// Mean BRDF within 15 deg of the mirror direction, 1/sr.
    pub mirror_brdf: Estimate,
    /// Their ratio; `None` where nothing went to the mirror direction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub retro_index: Option<Estimate>,
}

/// Energy of one incidence and band, in units of one path. Each entry is summed by itself, path by path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ledger {
    /// Energy of the lamp's paths.
    pub incoming: f64,
    /// Weights of the paths that left on the lit side.
    pub reflected: f64,
    /// Weights of the paths that left on the other side.
    pub transmitted: f64,
    /// What each path lost: one minus its weight.
    pub absorbed: f64,
    /// Paths that were given up before their end, with all their energy: in none of the totals. Only walks have such.
    #[serde(default)]
    pub cut_off: f64,
}

impl Ledger {
    /// `|in - reflected - transmitted - absorbed - cut off| / in`.
    pub fn relative_error(&self) -> f64 {
        let out = self.reflected + self.transmitted + self.absorbed + self.cut_off;
        (self.incoming - out).abs() / self.incoming
    }
}

/// Everything about one direction of the lamp.
#[derive(Clone, Debug, PartialEq)]
pub struct Incidence {
    /// The lamp's angle from the normal of the lit side, degrees.
    pub incident_deg: f64,
    /// Totals averaged over the bands.
    pub mean: Totals,
    /// Totals per band.
    pub bands: Vec<Totals>,
    /// Energy per band.
    pub ledgers: Vec<Ledger>,
    /// BSDF, 1/sr: `bsdf[band * grid.len() + bin]`. A bin that no path reached has the error that one path
    /// of mean weight would have made.
    pub bsdf: Vec<Estimate>,
    /// BSDF in the plane of incidence, 1/sr: `scan[band * scan.len() + bin]`. Empty when read from a table
    /// that has the grid only.
    pub scan: Vec<Estimate>,
}

/// One measurement of one sample: all its incidences.
#[derive(Clone, Debug, PartialEq)]
pub struct GonioTable {
    /// Name of the sample.
    pub sample: String,
    /// Description of the sample, TOML; may be empty.
    pub description: String,
    /// Version of the program that measured.
    pub version: String,
    /// The lit side.
    pub side: Side,
    /// Paths per incidence.
    pub rays: u64,
    /// Seed of the paths.
    pub seed: u64,
    /// Wavelengths of the bands, nm.
    pub bands_nm: Vec<f64>,
    /// Bins of the exitant directions.
    pub grid: ExitantGrid,
    /// Bins of the plane of incidence.
    pub scan: PlaneScan,
    /// Incidences in the order they were asked for.
    pub incidences: Vec<Incidence>,
}

impl GonioTable {
    /// The same table under the sample's name and description (TOML).
    pub fn described(mut self, sample: impl Into<String>, description: impl Into<String>) -> Self {
        self.sample = sample.into();
        self.description = description.into();
        self
    }

    /// Paths of all incidences that were cut off: energy that no total has. One path is the same in every band.
    pub fn cut_off(&self) -> u64 {
        self.incidences.iter().filter_map(|i| i.ledgers.first()).map(|l| l.cut_off as u64).sum()
    }

    /// Largest [`Ledger::relative_error`].
    pub fn ledger_error(&self) -> f64 {
        self.incidences.iter().flat_map(|i| i.ledgers.iter().map(Ledger::relative_error)).fold(0.0, f64::max)
    }

    /// BSDF for any incidence and direction (instrument's frame), 1/sr: linear between incidences, bilinear
    /// between bin centres, never across the horizon; the nearest incidence outside the measured range.
    /// `None` for a band that the table does not have.
    pub fn bsdf(&self, incident_deg: f64, w: Vec3, band: usize) -> Option<f64> {
        if band >= self.bands_nm.len() {
            return None;
        }
        // The measured neighbours below and above; equal where the lamp's angle was measured.
        let below = self.nearest_incidence(|d| (d <= incident_deg).then_some(incident_deg - d));
        let above = self.nearest_incidence(|d| (d >= incident_deg).then_some(d - incident_deg));
        match (below, above) {
            (Some(a), Some(b)) => {
                let span = b.incident_deg - a.incident_deg;
                let t = if span > 0.0 { (incident_deg - a.incident_deg) / span } else { 0.0 };
                Some(self.between_bins(a, w, band) * (1.0 - t) + self.between_bins(b, w, band) * t)
            }
            (Some(a), None) | (None, Some(a)) => Some(self.between_bins(a, w, band)),
            (None, None) => None,
        }
    }

    /// The incidence with the least distance, among those that have one.
    fn nearest_incidence(&self, distance: impl Fn(f64) -> Option<f64>) -> Option<&Incidence> {
        self.incidences
            .iter()
            .filter_map(|i| distance(i.incident_deg).map(|d| (d, i)))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, i)| i)
    }

    fn between_bins(&self, incidence: &Incidence, w: Vec3, band: usize) -> f64 {
        let (thetas, phis) = (self.grid.thetas(), self.grid.phis());
        let [x, y, z] = w.as_dvec3().to_array();
        let (first, last) = if z >= 0.0 { (0, thetas / 2 - 1) } else { (thetas / 2, thetas - 1) };
        let row = x.hypot(y).atan2(z).to_degrees() / self.grid.theta_step_deg - 0.5;
        let row = row.clamp(first as f64, last as f64);
        let column = (y.atan2(x).to_degrees() / self.grid.phi_step_deg).rem_euclid(phis as f64);
        let (r0, c0) = (row as usize, column as usize % phis);
        let (r1, c1) = ((r0 + 1).min(last), (c0 + 1) % phis);
        let (tr, tc) = (row - row.floor(), column - column.floor());
        let at = |r: usize, c: usize| incidence.bsdf[band * self.grid.len() + r * phis + c].value;
        let across = |r| at(r, c0) * (1.0 - tc) + at(r, c1) * tc;
        across(r0) * (1.0 - tr) + across(r1) * tr
    }

    /// The BSDF alone of weighted sums of the bands, one per row of `weights`, whose number stands for its wavelength; errors
    /// add up without cancelling, since the bands share their paths.
    pub fn combined<const N: usize>(&self, weights: &[[f64; N]]) -> GonioTable {
        let bins = self.grid.len();
        let incidence = |i: &Incidence| {
            let sum = |k: usize, bin: usize| {
                let bands =
                    weights.iter().enumerate().filter_map(|(b, w)| Some((w[k], i.bsdf.get(b * bins + bin)?)));
                bands.fold(Estimate::default(), |sum, (w, e)| Estimate {
                    value: sum.value + w * e.value,
                    standard_error: sum.standard_error + w.abs() * e.standard_error,
                })
            };
            let bsdf = (0..N).flat_map(|k| (0..bins).map(move |bin| (k, bin))).map(|(k, bin)| sum(k, bin));
            Incidence {
                bsdf: bsdf.collect(),
                scan: Vec::new(),
                bands: Vec::new(),
                ledgers: Vec::new(),
                ..i.clone()
            }
        };
        GonioTable {
            bands_nm: (0..N).map(|k| k as f64).collect(),
            incidences: self.incidences.iter().map(incidence).collect(),
            ..self.clone()
        }
    }

    /// BSDF against the signed angle in the plane of incidence: degrees from -180 to 180, positive on the
    /// lamp's side, beyond +-90 transmission. From the scan, or from the grid where the table has no scan.
    pub fn in_plane(&self, incidence: &Incidence, band: usize) -> Vec<(f64, Estimate)> {
        if !incidence.scan.is_empty() {
            let n = self.scan.len();
            let row = incidence.scan.iter().skip(band * n).take(n);
            return row.enumerate().map(|(i, &e)| (self.scan.centre_deg(i), e)).collect();
        }
        let phis = self.grid.phis();
        // Azimuth 180 is a bin's centre only where the number of azimuths is even.
        let columns = [(0, 1.0), (phis / 2, -1.0)];
        let mut curve: Vec<_> = columns[..if phis.is_multiple_of(2) { 2 } else { 1 }]
            .iter()
            .flat_map(|&(column, sign)| (0..self.grid.thetas()).map(move |row| (row * phis + column, sign)))
            .filter_map(|(bin, sign)| {
                let e = incidence.bsdf.get(band * self.grid.len() + bin)?;
                Some((sign * self.grid.centre_deg(bin).0, *e))
            })
            .collect();
        curve.sort_by(|a, b| a.0.total_cmp(&b.0));
        curve
    }

    /// The totals as plain numbers, ready to be written as JSON.
    pub fn summary(&self) -> Summary {
        let incidences = self
            .incidences
            .iter()
            .map(|i| IncidenceSummary {
                incident_deg: i.incident_deg,
                mean: TotalsSummary::from(&i.mean),
                bands: self
                    .bands_nm
                    .iter()
                    .zip(&i.bands)
                    .map(|(&wavelength_nm, t)| BandSummary { wavelength_nm, totals: t.into() })
                    .collect(),
            })
            .collect();
        Summary {
            sample: self.sample.clone(),
            side: self.side,
            rays: self.rays,
            seed: self.seed,
            version: self.version.clone(),
            ledger_error: self.ledger_error(),
            cut_off: self.cut_off(),
            incidences,
        }
    }
}

/// [`GonioTable::summary`]: one object per measurement.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Name of the sample.
    pub sample: String,
    /// The lit side.
    pub side: Side,
    /// Paths per incidence.
    pub rays: u64,
    /// Seed of the paths.
    pub seed: u64,
    /// Version of the program that measured.
    pub version: String,
    /// Largest relative difference of energy in and out.
    pub ledger_error: f64,
    /// Paths that were cut off before their end.
    pub cut_off: u64,
    /// One object per incidence.
    pub incidences: Vec<IncidenceSummary>,
}

/// One incidence of a [`Summary`]; its own numbers are means over the bands.
#[derive(Clone, Debug, Serialize)]
pub struct IncidenceSummary {
    /// The lamp's angle, degrees.
    pub incident_deg: f64,
    /// Means over the bands.
    #[serde(flatten)]
    pub mean: TotalsSummary,
    /// The same per band.
    pub bands: Vec<BandSummary>,
}

/// One band of an [`IncidenceSummary`].
#[derive(Clone, Debug, Serialize)]
pub struct BandSummary {
    /// Wavelength, nm.
    pub wavelength_nm: f64,
    /// Its totals.
    #[serde(flatten)]
    pub totals: TotalsSummary,
}

/// [`Totals`] as flat numbers, `_se` the standard errors; `null` where the retro index is undefined.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)]
pub struct TotalsSummary {
    pub reflectance: f64,
    pub reflectance_se: f64,
    pub transmittance: f64,
    pub transmittance_se: f64,
    pub absorptance: f64,
    pub absorptance_se: f64,
    pub retro_index: Option<f64>,
    pub retro_index_se: Option<f64>,
}

impl From<&Totals> for TotalsSummary {
    fn from(t: &Totals) -> Self {
        Self {
            reflectance: t.reflectance.value,
            reflectance_se: t.reflectance.standard_error,
            transmittance: t.transmittance.value,
            transmittance_se: t.transmittance.standard_error,
            absorptance: t.absorptance.value,
            absorptance_se: t.absorptance.standard_error,
            retro_index: t.retro_index.map(|e| e.value),
            retro_index_se: t.retro_index.map(|e| e.standard_error),
        }
    }
}

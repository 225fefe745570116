//! The search for amounts, peak, scattering and gain; `super` says what is fitted.

use std::ops::ControlFlow;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::Serialize;

use super::family::PathFamily;
use super::paths::Setup;
use super::place::{self, FITTED};
use crate::fit::State;
use crate::fit::covariance::{Knowledge, Uncertainty};
use crate::fit::loss::ScaledLoss;
use crate::fit::options::Covariance;
use crate::fit::solve::{Effort, Residuals, Solution, solve};
use crate::micro::{CellDescription, CellWalk, REGIONS, Tissue, TissueDescription, WhiteScatter};
use crate::spectrum::pigment::anthocyanin_moved_cm2_per_ug;
use crate::{Error, Result};

/// Names of the parameters, in the order of a fit.
pub const PARAMETERS: [&str; 6] = [
    "anthocyanin_ug_per_cm2",
    "anthocyanin_peak_nm",
    "carotenoid_ug_per_cm2",
    "chlorophyll_ug_per_cm2",
    "scattering_per_mm",
    "gain",
];
const PEAK: usize = 1;
const SCATTERING: usize = 4;
const GAIN: usize = 5;
/// The fitted pigments among the parameters.
const AMOUNTS: [usize; 3] = [0, 2, 3];
/// Bounds; those of the scattering follow from the petal.
const LOWER: [f64; 6] = [0.0, 500.0, 0.0, 0.0, 0.0, 0.05];
const UPPER: [f64; 6] = [1000.0, 560.0, 200.0, 200.0, 0.0, 20.0];
/// The scattering may be so many times more or less than the petal's.
const SCATTERING_RANGE: f64 = 16.0;
/// Fewest wavelengths.
const MIN_POINTS: usize = 12;
/// Most wavelengths.
const MAX_POINTS: usize = 20_000;
/// Wavelengths and classes of ways of the searches from the starts.
const ROUGH_POINTS: usize = 32;
const ROUGH_CLASSES: usize = 128;
/// Step of the derivative by the peak, nm.
const PEAK_STEP_NM: f64 = 0.01;
/// A full step that promises less than this share of the sum of squares ends at the minimum.
const CONVERGED: f64 = 1e-5;

/// How a spectrum is fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Wavelengths that are used, nm.
    pub range_nm: (f64, f64),
    /// What the spectrometer saw.
    pub setup: Setup,
    /// Walks per scattering coefficient, 100 to 1e6.
    pub walks: u32,
    /// Seed of the walks.
    pub seed: u64,
    /// Parameters of [`PARAMETERS`] that are held, and at which value.
    pub fixed: Vec<(String, f64)>,
}

impl Default for Options {
    fn default() -> Self {
        Self { range_nm: (420.0, 690.0), setup: Setup::default(), walks: 20_000, seed: 0, fixed: Vec::new() }
    }
}

/// A fitted parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Value {
    /// One of [`PARAMETERS`].
    pub name: &'static str,
    /// Best value.
    pub value: f64,
    /// `None` where it is not determined, held or at a bound.
    pub standard_error: Option<f64>,
    /// Why.
    pub state: State,
}

/// What was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SpectrumFit {
    /// In the order of [`PARAMETERS`].
    pub parameters: Vec<Value>,
    /// Wavelengths that were used, nm.
    pub wavelengths_nm: Vec<f64>,
    /// What was measured there.
    pub measured: Vec<f64>,
    /// The model, gain included.
    pub modelled: Vec<f64>,
    /// Root of the mean squared residual.
    pub rmse: f64,
    /// Correlation of neighbouring residuals.
    pub neighbour_correlation: f64,
    /// Did the search end at a minimum?
    pub converged: bool,
    /// Evaluations of the model, all searches together.
    pub evaluations: usize,
    /// Searches that ended at the same minimum, of all.
    pub agreeing_starts: (usize, usize),
    /// Largest share of walks that were cut off.
    pub cut_off: f64,
    /// The petal's layers with what was found.
    pub tissue: TissueDescription,
}

impl SpectrumFit {
    /// Value of a parameter.
    pub fn value(&self, name: &str) -> Option<f64> {
        self.parameters.iter().find(|p| p.name == name).map(|p| p.value)
    }
}

/// Fits a reflectance spectrum, `(wavelength_nm, reflectance)` rows of increasing wavelength, by the layers of a petal.
/// `at` names the petal's tissue and `data` the spectrum in errors; `step` hears how many of the scattering
/// coefficients are done and says whether to go on.
pub fn fit(
    spectrum: &[(f64, f64)],
    data: &str,
    petal: (&TissueDescription, &CellDescription, &str),
    options: &Options,
    step: &dyn Fn(u64, u64) -> ControlFlow<()>,
) -> Result<SpectrumFit> {
    let walk = |tissue: Tissue| Box::new(CellWalk::new(Arc::new(tissue))) as Box<dyn WhiteScatter>;
    fit_with(spectrum, data, petal, options, &walk, step)
}

/// [`fit`] with any walk through a tissue.
pub(crate) fn fit_with(
    spectrum: &[(f64, f64)],
    data: &str,
    (tissue, cells, at): (&TissueDescription, &CellDescription, &str),
    options: &Options,
    walk: &dyn Fn(Tissue) -> Box<dyn WhiteScatter>,
    step: &dyn Fn(u64, u64) -> ControlFlow<()>,
) -> Result<SpectrumFit> {
    let built = Tissue::new(tissue, cells, at)?;
    let Some(spongy) = &tissue.spongy else {
        return Err(Error::invalid(format!("{at}.spongy"), "missing: the fit finds its scattering"));
    };
    let s = spongy.scattering_per_mm;
    if s <= 0.0 {
        let what = format!("{s} 1/mm: the fit looks for values around it; give one above 0");
        return Err(Error::invalid(format!("{at}.spongy.scattering_per_mm"), what));
    }
    let with_scattering = |per_mm: f64| {
        let mut d = tissue.clone();
        if let Some(spongy) = &mut d.spongy {
            spongy.scattering_per_mm = per_mm;
        }
        d
    };
    let range = (s / SCATTERING_RANGE, s * SCATTERING_RANGE);
    let points = chosen(spectrum, data, options)?;
    let layers = Layers::new(&built, &points)?;
    let family = PathFamily::new(
        range,
        |per_mm| Ok(walk(Tissue::new(&with_scattering(per_mm), cells, at)?)),
        options.setup,
        options.walks,
        options.seed,
        step,
    )?;
    let mut found = search(&points, &layers, &family, (range, s), options)?;
    let value = |i: usize| found.parameters[i].value;
    found.tissue = place::put(&with_scattering(value(SCATTERING)), &built, AMOUNTS.map(value), value(PEAK));
    Ok(found)
}

/// The rows within the range.
fn chosen(spectrum: &[(f64, f64)], data: &str, options: &Options) -> Result<Vec<(f64, f64)>> {
    let (low, high) = options.range_nm;
    if low.is_nan() || high.is_nan() || low >= high {
        return Err(Error::invalid("range", format!("{low} to {high} nm is no range")));
    }
    if !(100..=1_000_000).contains(&options.walks) {
        return Err(Error::invalid("walks", format!("{} is not within 100 to 1e6", options.walks)));
    }
    let points: Vec<(f64, f64)> = spectrum.iter().copied().filter(|p| p.0 >= low && p.0 <= high).collect();
    if !(MIN_POINTS..=MAX_POINTS).contains(&points.len()) {
        let what = format!(
            "has {} wavelengths within {low} to {high} nm; a fit needs {MIN_POINTS} to {MAX_POINTS}",
            points.len()
        );
        return Err(Error::invalid(data, what));
    }
    if let Some((l, r)) = points.iter().find(|p| !(p.1 > -1.0 && p.1 <= 5.0)) {
        let what = format!("{r} at {l} nm is no reflectance (a share of the light, not per cent)");
        return Err(Error::invalid(data, what));
    }
    Ok(points)
}

/// Absorption of the regions at the wavelengths.
struct Layers {
    /// Volume per area, um.
    depth_um: [f64; REGIONS],
    shares: [[f64; REGIONS]; 3],
    rows: Vec<Row>,
}

/// What does not change at one wavelength.
struct Row {
    wavelength_nm: f64,
    /// Of what is not fitted, 1/um.
    others: [f64; REGIONS],
    /// Of carotenoid and chlorophyll, cm2/ug.
    k: [f64; 2],
}

impl Layers {
    fn new(tissue: &Tissue, points: &[(f64, f64)]) -> Result<Self> {
        let others = place::others(tissue);
        let row = |&(wavelength_nm, _): &(f64, f64)| {
            // Also an error where the moving band has no data.
            anthocyanin_moved_cm2_per_ug(535.0, wavelength_nm)?;
            let mut mu = tissue.grey_per_um;
            for (r, mu) in mu.iter_mut().enumerate() {
                if tissue.depth_um[r] > 0.0 {
                    *mu += others[r].absorption_per_um(tissue.depth_um[r], wavelength_nm)?;
                }
            }
            let k = [FITTED[1].cm2_per_ug(wavelength_nm)?, FITTED[2].cm2_per_ug(wavelength_nm)?];
            Ok(Row { wavelength_nm, others: mu, k })
        };
        let rows = points.iter().map(row).collect::<Result<_>>()?;
        Ok(Self { depth_um: tissue.depth_um, shares: place::shares(tissue), rows })
    }

    /// R / gain and its derivatives by all parameters but the gain.
    fn reflectance(&self, family: &PathFamily, row: &Row, x: &[f64]) -> (f64, [f64; 5]) {
        let band = |peak: f64| anthocyanin_moved_cm2_per_ug(peak, row.wavelength_nm).unwrap_or(f64::NAN);
        let peak = x[PEAK];
        let k = [band(peak), row.k[0], row.k[1]];
        let by_peak = (band(peak + PEAK_STEP_NM) - band(peak - PEAK_STEP_NM)) / (2.0 * PEAK_STEP_NM);
        // Absorption of region r by one ug/cm2 of pigment p.
        let share = |p: usize, r: usize| {
            if self.depth_um[r] > 0.0 { self.shares[p][r] / self.depth_um[r] } else { 0.0 }
        };
        let mut mu = row.others;
        for (r, mu) in mu.iter_mut().enumerate() {
            *mu += (0..3).map(|p| x[AMOUNTS[p]] * k[p] * share(p, r)).sum::<f64>();
        }
        let found = family.reflectance(x[SCATTERING], &mu);
        let by = |p: usize, per_unit: f64| -> f64 {
            (0..REGIONS).map(|r| found.by_absorption[r] * per_unit * share(p, r)).sum()
        };
        let derivatives =
            [by(0, k[0]), by(0, x[0] * by_peak), by(1, k[1]), by(2, k[2]), found.by_ln_scattering];
        (found.value, derivatives)
    }
}

/// Residuals over the parameters, the scattering by its logarithm.
struct Problem<'a> {
    points: &'a [(f64, f64)],
    layers: &'a Layers,
    family: &'a PathFamily,
    /// Which of the points.
    rows: Vec<usize>,
    groups: Vec<Vec<usize>>,
}

impl Residuals for Problem<'_> {
    fn groups(&self) -> &[Vec<usize>] {
        &self.groups
    }

    fn eval(&self, x: &[f64], residuals: &mut [f64], jacobian: &mut DMatrix<f64>) {
        let found: Vec<(f64, [f64; 5])> = self
            .rows
            .par_iter()
            .map(|&r| self.layers.reflectance(self.family, &self.layers.rows[r], x))
            .collect();
        for (i, (value, by)) in found.iter().enumerate() {
            residuals[i] = x[GAIN] * value - self.points[self.rows[i]].1;
            for (v, d) in by.iter().enumerate() {
                jacobian[(i, v)] = x[GAIN] * d;
            }
            jacobian[(i, GAIN)] = *value;
        }
    }

    fn floor(&self) -> f64 {
        1e-30 * self.points.iter().map(|p| p.1 * p.1).sum::<f64>()
    }
}

/// The best of the searches from six starts.
struct Rough {
    x: Vec<f64>,
    /// How many ended there, and how many there were.
    agreeing: (usize, usize),
    evaluations: usize,
}

/// Searches with some of the wavelengths and classes of many walks.
fn rough(
    points: &[(f64, f64)],
    layers: &Layers,
    family: &PathFamily,
    bounds: (&[f64], &[f64]),
    scattering_per_mm: f64,
) -> Result<Rough> {
    let family = &family.coarse(ROUGH_CLASSES);
    let some = points.len().min(ROUGH_POINTS);
    let rows: Vec<usize> = (0..some).map(|i| i * (points.len() - 1) / (some - 1).max(1)).collect();
    let problem = Problem { points, layers, family, groups: vec![(0..some).collect()], rows };
    let mut ends: Vec<Solution> = Vec::new();
    for factor in [0.4f64, 2.5] {
        for anthocyanin in [3.0, 25.0, 150.0] {
            let mut x = [anthocyanin, 535.0, 1.0, 1.0, (scattering_per_mm * factor).ln(), 1.0];
            for (i, x) in x.iter_mut().enumerate() {
                *x = x.clamp(bounds.0[i], bounds.1[i]);
            }
            // The gain that fits best at these amounts.
            let (mut dot, mut square) = (0.0, 0.0);
            for &r in &problem.rows {
                let value = layers.reflectance(family, &layers.rows[r], &x).0;
                dot += value * points[r].1;
                square += value * value;
            }
            if square > 0.0 {
                x[GAIN] = (dot / square).clamp(bounds.0[GAIN], bounds.1[GAIN]);
            }
            ends.push(solve(&problem, &x, bounds, &ScaledLoss::LINEAR, Effort::NOISY));
        }
    }
    let least = ends.iter().map(|e| e.cost).fold(f64::INFINITY, f64::min);
    let same = |e: &&Solution| e.cost <= least * (1.0 + 1e-3) + problem.floor();
    let agreeing = (ends.iter().filter(same).count(), ends.len());
    let evaluations = ends.iter().map(|e| e.evaluations).sum();
    let best = ends.into_iter().find(|e| e.cost == least).ok_or(Error::Cancelled)?;
    Ok(Rough { x: best.x, agreeing, evaluations })
}

/// The best of six searches. The fit's tissue is left empty.
fn search(
    points: &[(f64, f64)],
    layers: &Layers,
    family: &PathFamily,
    ((low, high), middle): ((f64, f64), f64),
    options: &Options,
) -> Result<SpectrumFit> {
    let (mut lower, mut upper) = (LOWER, UPPER);
    (lower[SCATTERING], upper[SCATTERING]) = (low.ln(), high.ln());
    let mut is_fixed = [false; PARAMETERS.len()];
    for (name, value) in &options.fixed {
        let Some(i) = PARAMETERS.iter().position(|p| p == name) else {
            let what = format!("no such parameter; this fit has {}", PARAMETERS.join(", "));
            return Err(Error::invalid(name, what));
        };
        let x = if i == SCATTERING { value.ln() } else { *value };
        if !(x >= lower[i] && x <= upper[i]) {
            let back = |x: f64| if i == SCATTERING { x.exp() } else { x };
            let what = format!("{value} is not within {:.6} to {:.6}", back(lower[i]), back(upper[i]));
            return Err(Error::invalid(name, what));
        }
        (lower[i], upper[i], is_fixed[i]) = (x, x, true);
    }
    let n = points.len();
    let bounds: (&[f64], &[f64]) = (&lower, &upper);
    let x = rough(points, layers, family, bounds, middle)?;
    let problem = Problem { points, layers, family, rows: (0..n).collect(), groups: vec![(0..n).collect()] };
    let best = solve(&problem, &x.x, bounds, &ScaledLoss::LINEAR, Effort::NOISY);
    if !best.cost.is_finite() {
        return Err(Error::invalid("fit", "the petal reflects nothing at any start"));
    }
    let uncertainty =
        Uncertainty::new(&best, bounds, &ScaledLoss::LINEAR, Covariance::Scaled, &problem.groups);
    let squares: f64 = best.residuals.iter().map(|r| r * r).sum();
    let gradient = best.jacobian.tr_mul(&DVector::from_column_slice(&best.residuals));
    let promise = gradient.dot(&(&uncertainty.inverse * &gradient));
    let rho = if squares > 0.0 {
        best.residuals.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / squares
    } else {
        0.0
    };
    let inflation = {
        let rho = rho.clamp(0.0, 0.999);
        ((1.0 + rho) / (1.0 - rho)).sqrt()
    };
    let parameters = (0..PARAMETERS.len())
        .map(|i| {
            let state = match uncertainty.knowledge[i] {
                _ if is_fixed[i] => State::Fixed,
                Knowledge::Determined => State::Free,
                Knowledge::AtLower => State::AtLower,
                Knowledge::AtUpper => State::AtUpper,
                Knowledge::NoEffect | Knowledge::OnlyCombined => State::Undetermined,
            };
            let (value, unit) = match best.x[i] {
                x if i == SCATTERING => (x.exp(), x.exp()),
                x => (x, 1.0),
            };
            let standard_error = uncertainty.standard_error(i).filter(|_| !is_fixed[i]);
            let standard_error = standard_error.map(|e| e * unit * inflation);
            Value { name: PARAMETERS[i], value, standard_error, state }
        })
        .collect();
    Ok(SpectrumFit {
        parameters,
        wavelengths_nm: points.iter().map(|p| p.0).collect(),
        measured: points.iter().map(|p| p.1).collect(),
        modelled: points.iter().zip(&best.residuals).map(|(p, r)| p.1 + r).collect(),
        rmse: (squares / n as f64).sqrt(),
        neighbour_correlation: rho,
        converged: best.converged || promise <= CONVERGED * squares,
        evaluations: x.evaluations + best.evaluations,
        agreeing_starts: x.agreeing,
        cut_off: family.cut_off(),
        tissue: TissueDescription::default(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::spectrum::paths::tests::Toy;
    use crate::math::Stream;

    const TISSUE: &str =
        "[adaxial]\n[spongy]\nthickness_um = 150.0\nscattering_per_mm = 30.0\nanisotropy = 0.0\n";

    fn description() -> TissueDescription {
        toml::from_str(TISSUE).expect("parses")
    }

    /// The toy in the place of a petal's tissue.
    fn toy(tissue: Tissue) -> Box<dyn WhiteScatter> {
        let scattering_per_mm = tissue.slabs.first().map_or(0.0, |s| 1e3 * s.scattering_per_um);
        Box::new(Toy { scattering_per_mm })
    }

    fn fitted(spectrum: &[(f64, f64)], options: &Options) -> Result<SpectrumFit> {
        let (d, cells) = (description(), CellDescription::default());
        fit_with(spectrum, "rose.csv", (&d, &cells, "tissue"), options, &toy, &|_, _| {
            ControlFlow::Continue(())
        })
    }

    /// Amounts of anthocyanin, peak, carotenoid, chlorophyll, scattering and gain.
    const TRUTH: [f64; 6] = [22.0, 541.0, 3.0, 1.5, 45.0, 1.3];

    /// The toy's reflectance by the closed form, every 3 nm, with `noise` from stream `seed`.
    fn synthetic(truth: [f64; 6], noise: f64, seed: u64) -> Vec<(f64, f64)> {
        let tissue = Tissue::new(&description(), &CellDescription::default(), "tissue").expect("valid");
        let mut stream = Stream::new(seed, 1, 2);
        let [anthocyanin, peak, carotenoid, chlorophyll, s, gain] = truth;
        (420..=690)
            .step_by(3)
            .map(|l| {
                let l = f64::from(l);
                let k = |p: usize| FITTED[p].cm2_per_ug(l).expect("known");
                let band = anthocyanin_moved_cm2_per_ug(peak, l).expect("known");
                let upper = (anthocyanin * band + carotenoid * k(1)) / tissue.depth_um[0];
                let spongy = chlorophyll * k(2) / tissue.depth_um[2];
                let epidermis = 0.5 * ((-40.0 * upper).exp() + (-60.0 * upper).exp());
                let r = 0.04 + 0.96 * s / (s + 20.0) * epidermis / (1.0 + spongy * 2000.0 / (s + 2.0));
                // A sum of twelve uniform numbers has variance one.
                let normal = (0..12).map(|_| stream.next()).sum::<f64>() - 6.0;
                (l, gain * r + noise * normal)
            })
            .collect()
    }

    #[test]
    fn known_amounts_are_recovered() {
        let options = Options { walks: 20_000, ..Options::default() };
        let found = fitted(&synthetic(TRUTH, 0.0, 1), &options).expect("a fit");
        // The walks' noise remains: 0.35 % of R, which gain and scattering take up.
        assert!(found.converged && found.rmse < 0.004 && found.evaluations < 1500, "{found:?}");
        for ((p, truth), tolerance) in
            found.parameters.iter().zip(TRUTH).zip([0.6, 0.3, 0.15, 0.25, 12.0, 0.08])
        {
            assert!((p.value - truth).abs() < tolerance, "{} {} {truth}", p.name, p.value);
            assert_eq!(p.state, State::Free);
        }
        // What was found is in the tissue.
        let d = &found.tissue;
        assert_eq!(d.spongy.as_ref().map(|s| s.scattering_per_mm), found.value("scattering_per_mm"));
        let upper = &d.adaxial.as_ref().expect("there").pigments;
        assert_eq!(Some(upper.anthocyanin_ug_per_cm2), found.value("anthocyanin_ug_per_cm2"));
        assert_eq!(Some(upper.anthocyanin_peak_nm), found.value("anthocyanin_peak_nm"));
        // Without pigment nothing is found, and the band has no place.
        let white = fitted(&synthetic([0.0, 541.0, 0.0, 0.0, 45.0, 1.3], 0.0, 1), &options).expect("a fit");
        for name in ["anthocyanin_ug_per_cm2", "carotenoid_ug_per_cm2", "chlorophyll_ug_per_cm2"] {
            assert!(white.value(name).expect("there") < 0.1, "{white:?}");
        }
        // Held parameters stay.
        let fixed = vec![("gain".to_owned(), 1.3), ("scattering_per_mm".to_owned(), 45.0)];
        let held = fitted(&synthetic(TRUTH, 0.0, 1), &Options { fixed, ..options }).expect("a fit");
        assert_eq!((held.value("gain"), held.parameters[GAIN].state), (Some(1.3), State::Fixed));
        assert!((held.parameters[SCATTERING].value - 45.0).abs() < 1e-9);
        assert!((held.parameters[0].value - 22.0).abs() < 0.6, "{held:?}");
    }

    #[test]
    fn standard_errors_cover() {
        // Thirty noisy copies of one modelled spectrum: each parameter's scatter is its standard error.
        let options = Options {
            walks: 4000,
            fixed: vec![("scattering_per_mm".to_owned(), 45.0)],
            ..Options::default()
        };
        let every_other: Vec<_> = synthetic(TRUTH, 0.0, 1).into_iter().step_by(2).collect();
        let model = fitted(&every_other, &options).expect("a fit");
        let (tissue, cells) = (description(), CellDescription::default());
        let built = Tissue::new(&tissue, &cells, "tissue").expect("valid");
        let clean: Vec<(f64, f64)> =
            model.wavelengths_nm.iter().copied().zip(model.modelled.iter().copied()).collect();
        let layers = Layers::new(&built, &clean).expect("known");
        let range = (30.0 / 16.0, 30.0 * 16.0);
        let make = |s| Ok(Box::new(Toy { scattering_per_mm: s }) as Box<dyn WhiteScatter>);
        let go = |_, _| ControlFlow::Continue(());
        let family =
            PathFamily::new(range, make, options.setup, options.walks, options.seed, &go).expect("a toy");
        let copies = 30;
        let mut z2 = [0.0; 6];
        for c in 0..copies {
            let mut stream = Stream::new(9, 9, c);
            let noisy: Vec<(f64, f64)> = clean
                .iter()
                .map(|p| (p.0, p.1 + 0.003 * ((0..12).map(|_| stream.next()).sum::<f64>() - 6.0)))
                .collect();
            let found = search(&noisy, &layers, &family, (range, 30.0), &options).expect("a fit");
            assert!(found.converged && found.evaluations < 1000, "{found:?}");
            for (i, z2) in z2.iter_mut().enumerate() {
                if let Some(e) = found.parameters[i].standard_error {
                    let z = (found.parameters[i].value - model.parameters[i].value) / e;
                    *z2 += z * z / copies as f64;
                }
            }
        }
        for (i, z2) in z2.iter().enumerate().filter(|(i, _)| *i != SCATTERING) {
            // Mean of z^2 over 30 copies: 1 within 3 standard deviations, and the correction for neighbours only widens.
            assert!((0.2..1.8).contains(z2), "{}: {z2}", PARAMETERS[i]);
        }
    }

    #[test]
    fn contradictions_are_named() {
        let good = synthetic(TRUTH, 0.0, 1);
        let quick = Options { walks: 100, ..Options::default() };
        let fails = |spectrum: &[(f64, f64)], options: &Options, expected: &str| {
            let e = fitted(spectrum, options).expect_err(expected).to_string();
            assert!(e.starts_with(expected), "{expected}: {e}");
        };
        fails(&good[..5], &quick, "rose.csv: has 5 wavelengths within 420 to 690 nm");
        fails(&good, &Options { range_nm: (690.0, 420.0), ..quick.clone() }, "range: ");
        fails(&good, &Options { walks: 0, ..quick.clone() }, "walks: ");
        let percent: Vec<_> = good.iter().map(|p| (p.0, 100.0 * p.1)).collect();
        fails(&percent, &quick, "rose.csv: ");
        let nan: Vec<_> = good.iter().map(|p| (p.0, if p.0 > 500.0 { f64::NAN } else { p.1 })).collect();
        fails(&nan, &quick, "rose.csv: NaN at");
        let held = |name: &str, v: f64| Options { fixed: vec![(name.into(), v)], ..quick.clone() };
        fails(&good, &held("betalain", 1.0), "betalain: no such parameter");
        fails(&good, &held("gain", -1.0), "gain: -1 is not within");
        fails(&good, &held("scattering_per_mm", -1.0), "scattering_per_mm: -1 is not within");
        let ultraviolet: Vec<_> = (0..20).map(|i| (300.0 + f64::from(i), 0.1)).collect();
        let early = Options { range_nm: (290.0, 690.0), ..quick.clone() };
        fails(&ultraviolet, &early, "wavelength: no data for anthocyanin at 300 nm");
        // Tissues that the fit cannot vary, and a user who stops.
        let cells = CellDescription::default();
        let of = |text: &str, go: ControlFlow<()>| {
            let d: TissueDescription = toml::from_str(text).expect("parses");
            let found = fit_with(&good, "rose.csv", (&d, &cells, "tissue"), &quick, &toy, &|_, _| go);
            found.expect_err(text).to_string()
        };
        let go = ControlFlow::Continue(());
        assert!(of("[adaxial]", go).starts_with("tissue.spongy: "));
        let clear = TISSUE.replace("30.0", "0.0");
        assert!(of(&clear, go).starts_with("tissue.spongy.scattering_per_mm: 0"));
        assert_eq!(of(TISSUE, ControlFlow::Break(())), "cancelled");
    }
}

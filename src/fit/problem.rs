//! A model, readings and parameters made into residuals.
//!
//! Model: residual of reading i = weight_i (gain_series(i) m(wi_i, wo_i; p_band(i)) - y_i), with m averaged over the
//! cones of lamp and detector. Directions that readings share (series, bands) are prepared and evaluated once.
//! Guarded by `jacobian_matches_differences`.

use std::collections::HashMap;

use nalgebra::DMatrix;

use super::options::Options;
use super::parameters::Layout;
use super::solve::Residuals;
use super::{Geometry, Model, Prepared};
use crate::gonio::Measurement;
use crate::{Error, Result};

/// Readings x free parameters that one fit may have (their Jacobian is held by every search).
const MAX_JACOBIAN: usize = 20_000_000;

/// Readings of one band.
struct Band {
    /// Which prepared model.
    set: usize,
    /// `(reading, its direction among the prepared)`.
    readings: Vec<(usize, usize)>,
}

/// Everything that does not change during a fit.
pub(crate) struct Problem {
    pub(crate) layout: Layout,
    bands: Vec<Band>,
    /// Prepared models, each with its number of directions.
    sets: Vec<(Box<dyn Prepared>, usize)>,
    /// Slot of each reading's gain.
    gain: Vec<Option<usize>>,
    /// Readings, 1/sr.
    pub(crate) readings: Vec<f64>,
    /// Readings of each band: their rows share few variables.
    groups: Vec<Vec<usize>>,
}

impl Problem {
    pub(crate) fn new(model: &dyn Model, measurement: &Measurement, options: &Options) -> Result<Self> {
        check(measurement)?;
        let mut layout = Layout::new(model, measurement, options)?;
        if measurement.readings.len().saturating_mul(layout.free.len()) > MAX_JACOBIAN {
            let what = format!(
                "{} readings with {} free parameters are too many for one fit: fit fewer bands at once",
                measurement.readings.len(),
                layout.free.len()
            );
            return Err(Error::invalid("readings", what));
        }
        let mut bands: Vec<Band> = Vec::new();
        // Lists of directions, by the bits of their coordinates, that bands may share.
        let mut known: HashMap<Vec<[u64; 6]>, usize> = HashMap::new();
        let mut sets = Vec::new();
        let (source, detector) = (measurement.source_half_angle_deg, measurement.detector_half_angle_deg);
        for b in 0..measurement.bands.len() {
            let mut keys = Vec::new();
            let mut geometries = Vec::new();
            let mut at: HashMap<[u64; 6], usize> = HashMap::new();
            let mut readings = Vec::new();
            for (i, r) in measurement.readings.iter().enumerate().filter(|(_, r)| r.band as usize == b) {
                let key = [r.wi.x, r.wi.y, r.wi.z, r.wo.x, r.wo.y, r.wo.z].map(f64::to_bits);
                let direction = *at.entry(key).or_insert(keys.len());
                if direction == keys.len() {
                    keys.push(key);
                    geometries.push(Geometry::cones(r.wi, r.wo, source, detector));
                }
                readings.push((i, direction));
            }
            if readings.is_empty() {
                continue;
            }
            let set = match known.get(&keys) {
                Some(&set) => set,
                None => {
                    sets.push((model.prepare(&geometries)?, geometries.len()));
                    known.insert(keys, sets.len() - 1);
                    sets.len() - 1
                }
            };
            bands.push(Band { set, readings });
        }
        // Only bands with readings are kept; so are their slots.
        layout.of_band.retain(|slots| !slots.is_empty());
        let groups = bands.iter().map(|b| b.readings.iter().map(|r| r.0).collect()).collect();
        let gain = measurement.readings.iter().map(|r| layout.gain[r.series as usize]).collect();
        let readings = measurement.readings.iter().map(|r| r.bsdf_per_sr).collect();
        Ok(Self { layout, bands, sets, gain, readings, groups })
    }

    /// Model at every reading, gains applied; with `jacobian` its derivatives by the free variables.
    pub(crate) fn model(&self, x: &[f64], modelled: &mut [f64], mut jacobian: Option<&mut DMatrix<f64>>) {
        let all = self.layout.values(x);
        if let Some(j) = jacobian.as_deref_mut() {
            j.fill(0.0);
        }
        let (mut values, mut derivatives) = (Vec::new(), Vec::new());
        for (band, slots) in self.bands.iter().zip(&self.layout.of_band) {
            let (prepared, n) = &self.sets[band.set];
            let p: Vec<f64> = slots.iter().map(|&s| all[s]).collect();
            values.resize(*n, 0.0);
            if jacobian.is_some() {
                derivatives.resize(n * p.len(), 0.0);
                prepared.eval(&p, &mut values, Some(&mut derivatives));
            } else {
                prepared.eval(&p, &mut values, None);
            }
            for &(i, k) in &band.readings {
                let gain = self.gain[i].map_or(1.0, |g| all[g]);
                modelled[i] = gain * values[k];
                let Some(j) = jacobian.as_deref_mut() else { continue };
                for (q, &slot) in slots.iter().enumerate() {
                    if let Some((variable, factor)) = self.layout.root[slot] {
                        j[(i, variable)] += factor * gain * derivatives[q * n + k];
                    }
                }
                if let Some((variable, factor)) = self.gain[i].and_then(|g| self.layout.root[g]) {
                    j[(i, variable)] += factor * values[k];
                }
            }
        }
    }
}

/// What is wrong with readings, by their number from 0.
fn check(measurement: &Measurement) -> Result<()> {
    if measurement.readings.is_empty() {
        return Err(Error::invalid("readings", "there are none to fit"));
    }
    for (i, r) in measurement.readings.iter().enumerate() {
        let at = |what: &str| Err(Error::invalid(format!("readings[{i}]"), what));
        if r.band as usize >= measurement.bands.len() || r.series as usize >= measurement.series.len() {
            return at("its band or series does not exist");
        }
        if !r.bsdf_per_sr.is_finite() || r.bsdf_per_sr.abs() > 1e100 {
            return at("its value is not finite");
        }
        let unit = |l: f64| (l - 1.0).abs() < 1e-3;
        if !(unit(r.wi.length()) && unit(r.wo.length())) {
            return at("its directions are not unit vectors");
        }
        if r.sigma_per_sr.is_some_and(|s| !(s > 0.0 && s < 1e100)) {
            return at("its sigma is not a positive number");
        }
    }
    Ok(())
}

/// Residuals of a problem for some readings and weights.
pub(crate) struct Weighted<'a> {
    pub(crate) problem: &'a Problem,
    pub(crate) readings: &'a [f64],
    pub(crate) weights: &'a [f64],
}

impl Residuals for Weighted<'_> {
    fn groups(&self) -> &[Vec<usize>] {
        &self.problem.groups
    }

    fn eval(&self, x: &[f64], residuals: &mut [f64], jacobian: &mut DMatrix<f64>) {
        self.problem.model(x, residuals, Some(jacobian));
        for ((r, y), w) in residuals.iter_mut().zip(self.readings).zip(self.weights) {
            *r = (*r - y) * w;
        }
        for mut column in jacobian.column_iter_mut() {
            column.iter_mut().zip(self.weights).for_each(|(j, w)| *j *= w);
        }
    }

    fn floor(&self) -> f64 {
        let size: f64 = self.readings.iter().zip(self.weights).map(|(y, w)| (y * w).powi(2)).sum();
        1e-30 * size
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::options::{Action, Override};
    use crate::fit::tests::{lobe, measured_in};

    #[test]
    fn jacobian_matches_differences() {
        let mut measurement = measured_in(2, 2, |_, wo, b, s| 0.1 * wo.z + 0.05 * b as f64 + 0.02 * s as f64);
        measurement.detector_half_angle_deg = 2.0;
        // Two bands, gains, one coefficient tied to another and one to a shape.
        let tie = |name: &str, to: &str, factor| Override {
            name: name.into(),
            action: Action::Tie { to: to.into(), factor },
        };
        let parameters = vec![tie("kd[550 nm]", "kd[450 nm]", 0.5), tie("ks[450 nm]", "n", 0.001)];
        let options = Options { gains: true, parameters, ..Options::default() };
        let problem = Problem::new(&lobe(), &measurement, &options).unwrap();
        let names: Vec<&str> =
            (0..problem.layout.free.len()).map(|v| &*problem.layout.free_slot(v).name).collect();
        assert_eq!(names, ["n", "kd[450 nm]", "ks[550 nm]", "gain[s1]"]);
        let x = [20.0, 0.3, 0.2, 1.3];
        let n = measurement.readings.len();
        let (mut m, mut j) = (vec![0.0; n], DMatrix::zeros(n, 4));
        problem.model(&x, &mut m, Some(&mut j));
        for v in 0..4 {
            let h = 1e-5 * x[v];
            let at = |x: f64, v: usize, mut all: [f64; 4]| {
                let mut m = vec![0.0; n];
                all[v] = x;
                problem.model(&all, &mut m, None);
                m
            };
            let (a, b) = (at(x[v] - h, v, x), at(x[v] + h, v, x));
            for i in 0..n {
                let difference = (b[i] - a[i]) / (2.0 * h);
                assert!((difference - j[(i, v)]).abs() < 1e-8, "{v} {i}: {difference} {}", j[(i, v)]);
            }
        }
    }
}

//! The weight of each residual.
//!
//! Model: weight = 1 / sigma, or sqrt(projected solid angle / its mean), or 1.
//!
//! - sigma -> `Reading::sigma_per_sr` -> 1/sr
//! - a known relative error e -> `Options::relative_sigma`: sigma^2 = (e max(|m|, 0.01 mean |m|))^2 + sigma_i^2 with the
//!   **model's** value m, so that a reading which noise made low is not trusted more for it.
//!
//! Guarded by `weights_follow_the_options`. Our reading.

use super::options::{Options, Weights};
use crate::gonio::Measurement;
use crate::{Error, Result};

/// How weights come about.
pub(crate) struct Weighting {
    kind: Kind,
    sigmas: Vec<Option<f64>>,
    /// Projected solid angles, sr.
    pub(crate) shares: Vec<f64>,
}

enum Kind {
    Sigma,
    Relative(f64),
    Cosine,
    Uniform,
}

impl Weighting {
    pub(crate) fn new(measurement: &Measurement, options: &Options) -> Result<Self> {
        let sigmas: Vec<Option<f64>> = measurement.readings.iter().map(|r| r.sigma_per_sr).collect();
        let missing = sigmas.iter().position(Option::is_none);
        let kind = match (options.relative_sigma, options.weights) {
            (Some(e), _) => Kind::Relative(e),
            (None, Weights::Sigma) if missing.is_some() => {
                let what = format!("reading {} has no sigma to be weighted by", missing.unwrap_or(0));
                return Err(Error::invalid("weights", what));
            }
            (None, Weights::Auto) if missing.is_none() => Kind::Sigma,
            (None, Weights::Sigma) => Kind::Sigma,
            (None, Weights::Auto | Weights::Cosine) => Kind::Cosine,
            (None, Weights::Uniform) => Kind::Uniform,
        };
        Ok(Self { kind, sigmas, shares: measurement.projected_solid_angles_sr() })
    }

    /// Weights, given the model's values (or, to begin with, the readings).
    pub(crate) fn weights(&self, modelled: &[f64]) -> Vec<f64> {
        let n = modelled.len();
        match self.kind {
            Kind::Uniform => vec![1.0; n],
            Kind::Sigma => self.sigmas.iter().map(|s| 1.0 / s.unwrap_or(1.0)).collect(),
            Kind::Cosine => {
                let mean = self.shares.iter().sum::<f64>() / n as f64;
                self.shares.iter().map(|s| (s / mean).sqrt()).collect()
            }
            Kind::Relative(e) => {
                let mean = modelled.iter().map(|m| m.abs()).sum::<f64>() / n as f64;
                // All zero: any weight does.
                let least = if mean > 0.0 { 0.01 * mean } else { 1.0 };
                let sigma = |m: f64, own: Option<f64>| (e * m.abs().max(least)).hypot(own.unwrap_or(0.0));
                modelled.iter().zip(&self.sigmas).map(|(&m, &s)| 1.0 / sigma(m, s)).collect()
            }
        }
    }

    /// Do weights depend on the model's values?
    pub(crate) fn follows_the_model(&self) -> bool {
        matches!(self.kind, Kind::Relative(_))
    }

    /// Are weighted residuals in units of sigma?
    pub(crate) fn knows_sigma(&self) -> bool {
        matches!(self.kind, Kind::Relative(_) | Kind::Sigma)
    }

    /// In words.
    pub(crate) fn describe(&self) -> String {
        match self.kind {
            Kind::Sigma => "1 / sigma of each reading".into(),
            Kind::Relative(e) => format!("1 / sigma, sigma {} % of the model's value", 100.0 * e),
            Kind::Cosine => "root of the projected solid angle of each reading".into(),
            Kind::Uniform => "all readings alike".into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::tests::measured;

    #[test]
    fn weights_follow_the_options() {
        let mut m = measured(|_, _, _, _| 0.1);
        let n = m.readings.len();
        let make = |m: &Measurement, o: &Options| Weighting::new(m, o).map(|w| w.weights(&vec![0.1; n]));
        let auto = make(&m, &Options::default()).unwrap();
        let mean_square = auto.iter().map(|w| w * w).sum::<f64>() / n as f64;
        assert!((mean_square - 1.0).abs() < 1e-12 && auto.iter().any(|w| (w - 1.0).abs() > 0.1));
        let sigma = Options { weights: Weights::Sigma, ..Default::default() };
        assert!(make(&m, &sigma).is_err());
        for r in &mut m.readings {
            r.sigma_per_sr = Some(0.004);
        }
        assert!(make(&m, &sigma).unwrap().iter().all(|w| *w == 250.0));
        assert_eq!(make(&m, &Options::default()).unwrap(), make(&m, &sigma).unwrap());
        let both = Options { relative_sigma: Some(0.03), ..Default::default() };
        assert!(make(&m, &both).unwrap().iter().all(|w| (w - 200.0).abs() < 1e-9));
        // The model's low values do not count as exact, and zeros are no division by zero.
        let w = Weighting::new(&m, &both).unwrap();
        m.readings.iter_mut().for_each(|r| r.sigma_per_sr = None);
        let alone = Weighting::new(&m, &both).unwrap();
        assert!(w.follows_the_model() && alone.weights(&vec![0.0; n]).iter().all(|w| w.is_finite()));
        let mut low = vec![1.0; n];
        low[0] = 1e-9;
        let weights = alone.weights(&low);
        assert!(weights[0] / weights[1] < 103.0 && weights[0] > weights[1]);
    }
}

//! A spectrum: a real function of wavelength.
//!
//! `Dense` holds one value per nm over 380-780 nm, which is what rendering evaluates;
//! tables, formulas and colours become one when a scene is compiled. Between the samples it is linear.
//!
//! Blackbody: Planck's law, L(l) = 2 h c^2 / l^5 / (exp(h c / (l k T)) - 1), W/(m^2 sr nm), with the exact
//! SI constants of 2019; guarded by `blackbody_obeys_wien_and_stefan_boltzmann`.

use std::sync::Arc;

use super::sampled::{SampledSpectrum, SampledWavelengths, VISIBLE_NM};
use super::table::interpolate;
use crate::{Error, Result};

/// Number of samples of a dense spectrum: 380, 381 ... 780 nm.
pub const DENSE_SAMPLES: usize = 401;

/// A function of wavelength; cheap to clone.
#[derive(Clone, Debug, PartialEq)]
pub enum Spectrum {
    /// The same at every wavelength.
    Constant(f32),
    /// `values[i]` at 380 + i nm, linear in between, the end values outside.
    Dense(Arc<[f32; DENSE_SAMPLES]>),
}

impl Spectrum {
    /// Samples `f` (of nm) at every nm of the visible range.
    pub fn from_fn(mut f: impl FnMut(f64) -> f64) -> Self {
        let mut values = [0.0; DENSE_SAMPLES];
        for (i, v) in values.iter_mut().enumerate() {
            *v = f(f64::from(VISIBLE_NM.0) + i as f64) as f32;
        }
        Spectrum::Dense(Arc::new(values))
    }

    /// From `(wavelength_nm, value)` points of increasing wavelength: linear in between, the end values
    /// outside. `at` names the table in errors.
    pub fn from_table(points: &[(f64, f64)], at: &str) -> Result<Self> {
        let (Some(first), Some(last)) = (points.first(), points.last()) else {
            return Err(Error::invalid(at, "a spectrum needs at least one (wavelength_nm, value)"));
        };
        if let Some((l, v)) = points.iter().find(|(l, v)| !(l.is_finite() && *l > 0.0 && v.is_finite())) {
            return Err(Error::invalid(
                at,
                format!("({l} nm, {v}): wavelengths must be positive, values finite"),
            ));
        }
        if let Some(p) = points.windows(2).find(|p| p[1].0 <= p[0].0) {
            return Err(Error::invalid(
                at,
                format!("wavelength {} nm after {} nm: they must increase", p[1].0, p[0].0),
            ));
        }
        // A table in micrometres, or of the infrared only, would silently become a constant.
        if last.0 < f64::from(VISIBLE_NM.0) || first.0 > f64::from(VISIBLE_NM.1) {
            return Err(Error::invalid(
                at,
                format!(
                    "covers {} to {} nm, nothing of the visible {} to {} nm (are the wavelengths in nm?)",
                    first.0, last.0, VISIBLE_NM.0, VISIBLE_NM.1
                ),
            ));
        }
        Ok(Self::from_fn(|l| interpolate(points, l)))
    }

    /// Value at one wavelength.
    pub fn at(&self, lambda_nm: f32) -> f32 {
        match self {
            Spectrum::Constant(v) => *v,
            Spectrum::Dense(values) => {
                let x = (lambda_nm - VISIBLE_NM.0).clamp(0.0, (DENSE_SAMPLES - 1) as f32);
                let i = (x as usize).min(DENSE_SAMPLES - 2);
                let t = x - i as f32;
                values[i] + (values[i + 1] - values[i]) * t
            }
        }
    }

    /// Values at the wavelengths of a path.
    pub fn sample(&self, lambda: &SampledWavelengths) -> SampledSpectrum {
        match self {
            Spectrum::Constant(v) => SampledSpectrum::splat(*v),
            Spectrum::Dense(_) => SampledSpectrum(lambda.lambda_nm().map(|l| self.at(l))),
        }
    }

    /// Largest value over the visible range.
    pub fn max(&self) -> f32 {
        match self {
            Spectrum::Constant(v) => *v,
            Spectrum::Dense(values) => values.iter().copied().fold(f32::NEG_INFINITY, f32::max),
        }
    }

    /// Smallest value over the visible range.
    pub fn min(&self) -> f32 {
        match self {
            Spectrum::Constant(v) => *v,
            Spectrum::Dense(values) => values.iter().copied().fold(f32::INFINITY, f32::min),
        }
    }

    /// Mean over the visible range; used to choose between lobes.
    pub fn mean(&self) -> f32 {
        match self {
            Spectrum::Constant(v) => *v,
            Spectrum::Dense(values) => values.iter().sum::<f32>() / DENSE_SAMPLES as f32,
        }
    }

    /// The spectrum times a number.
    pub fn scaled(&self, factor: f32) -> Spectrum {
        match self {
            Spectrum::Constant(v) => Spectrum::Constant(v * factor),
            Spectrum::Dense(values) => Spectrum::Dense(Arc::new(values.map(|v| v * factor))),
        }
    }

    /// Pointwise combination of two spectra.
    pub fn zip(&self, other: &Spectrum, mut f: impl FnMut(f32, f32) -> f32) -> Spectrum {
        match (self, other) {
            (Spectrum::Constant(a), Spectrum::Constant(b)) => Spectrum::Constant(f(*a, *b)),
            _ => Spectrum::from_fn(|l| f64::from(f(self.at(l as f32), other.at(l as f32)))),
        }
    }
}

impl From<f32> for Spectrum {
    fn from(v: f32) -> Self {
        Spectrum::Constant(v)
    }
}

/// Spectral radiance of a blackbody, W/(m^2 sr nm); zero where it underflows.
pub fn planck_w_per_m2_sr_nm(lambda_nm: f64, temperature_k: f64) -> f64 {
    const H_J_S: f64 = 6.626_070_15e-34;
    const C_M_PER_S: f64 = 299_792_458.0;
    const K_J_PER_K: f64 = 1.380_649e-23;
    let l_m = lambda_nm * 1e-9;
    let x = H_J_S * C_M_PER_S / (l_m * K_J_PER_K * temperature_k);
    2.0 * H_J_S * C_M_PER_S * C_M_PER_S / l_m.powi(5) / x.exp_m1() * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_becomes_dense() {
        let s = Spectrum::from_table(&[(400.0, 0.0), (500.0, 1.0)], "t").unwrap();
        assert_eq!((s.at(390.0), s.at(700.0)), (0.0, 1.0));
        assert!((s.at(425.25) - 0.2525).abs() < 1e-6);
        assert_eq!((s.min(), s.max()), (0.0, 1.0));
        for bad in [
            &[][..],
            &[(500.0, 1.0), (400.0, 0.0)],
            &[(400.0, f64::NAN)],
            &[(-1.0, 0.0), (500.0, 1.0)],
            &[(0.4, 0.0), (0.7, 1.0)],
            &[(1000.0, 0.0), (2500.0, 1.0)],
        ] {
            assert!(Spectrum::from_table(bad, "t").is_err(), "{bad:?}");
        }
    }

    #[test]
    fn blackbody_obeys_wien_and_stefan_boltzmann() {
        for t in [1500.0, 3000.0, 6500.0] {
            let n = 200_000;
            let step = 0.5; // nm, up to 100 um
            let values = (1..n).map(|i| (f64::from(i) * step, planck_w_per_m2_sr_nm(f64::from(i) * step, t)));
            let (peak, _) = values.clone().fold((0.0, 0.0), |m, p| if p.1 > m.1 { p } else { m });
            assert!((peak - 2.897_771_955e6 / t).abs() <= step, "{peak} nm at {t} K");
            let total = values.map(|p| p.1).sum::<f64>() * step * std::f64::consts::PI;
            let expected = 5.670_374_419e-8 * t.powi(4);
            // The tail beyond 100 um holds less than 2e-4 of it at 1500 K.
            assert!((total / expected - 1.0).abs() < 2e-4, "{total} {expected}");
        }
    }
}

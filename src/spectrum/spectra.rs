//! A spectrum: a real function of wavelength.
//!
//! `Dense` holds one value per nm over 380-780 nm, which is what rendering evaluates;
//! tables, formulas and colours become one when a scene is compiled.

use std::sync::Arc;

use super::sampled::{SampledSpectrum, SampledWavelengths, VISIBLE_NM};

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

    /// Mean over the visible range; used to choose between lobes.
    pub fn mean(&self) -> f32 {
        match self {
            Spectrum::Constant(v) => *v,
            Spectrum::Dense(values) => values.iter().sum::<f32>() / DENSE_SAMPLES as f32,
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

//! The wavelengths that one light path carries, and values at them.
//!
//! Model: `LANES` wavelengths per path, stratified over the visible range 380-780 nm and importance-sampled
//! for the eye: p(l) = c / cosh^2(a (l - l0)), a = 0.0072 /nm, l0 = 538 nm (Radziszewski, Boryczko, Alda
//! 2009), with c such that p integrates to one over 380-780 nm. The densities travel with the wavelengths,
//! so that an estimate is `mean(value / pdf)` for any way of sampling them. Guarded by
//! `pdf_integrates_to_one`.

use std::ops::{Add, AddAssign, Div, Index, Mul, MulAssign, Neg, Sub};

/// Wavelengths per path.
pub const LANES: usize = 8;

/// The range of pictures, nm.
pub const VISIBLE_NM: (f32, f32) = (380.0, 780.0);

const SLOPE_PER_NM: f32 = 0.0072;
const PEAK_NM: f32 = 538.0;

/// Wavelengths of one path, nm, with the density that each was drawn with, 1/nm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledWavelengths {
    lambda_nm: [f32; LANES],
    pdf_per_nm: [f32; LANES],
}

impl SampledWavelengths {
    /// Importance-sampled for the eye; `u` in [0, 1) shifts all strata together.
    pub fn visible(u: f32) -> Self {
        let (low, high) = VISIBLE_NM;
        let t0 = (SLOPE_PER_NM * (low - PEAK_NM)).tanh();
        let t1 = (SLOPE_PER_NM * (high - PEAK_NM)).tanh();
        let mut lambda_nm = [0.0; LANES];
        let mut pdf_per_nm = [0.0; LANES];
        for i in 0..LANES {
            let v = (i as f32 + u) / LANES as f32;
            let t = t0 + (t1 - t0) * v;
            lambda_nm[i] = (PEAK_NM + t.atanh() / SLOPE_PER_NM).clamp(low, high);
            // p = a (1 - tanh^2) / (t1 - t0), and 1 - tanh^2 = 1/cosh^2.
            pdf_per_nm[i] = SLOPE_PER_NM * (1.0 - t * t) / (t1 - t0);
        }
        Self { lambda_nm, pdf_per_nm }
    }

    /// Uniform and stratified over `[low_nm, high_nm]`.
    pub fn uniform(u: f32, low_nm: f32, high_nm: f32) -> Self {
        let mut lambda_nm = [0.0; LANES];
        for (i, l) in lambda_nm.iter_mut().enumerate() {
            *l = low_nm + (high_nm - low_nm) * (i as f32 + u) / LANES as f32;
        }
        Self { lambda_nm, pdf_per_nm: [1.0 / (high_nm - low_nm); LANES] }
    }

    /// Given wavelengths with density one: for measurements at chosen wavelengths, where values are read
    /// per lane and not averaged.
    pub fn given(lambda_nm: [f32; LANES]) -> Self {
        Self { lambda_nm, pdf_per_nm: [1.0; LANES] }
    }

    /// The wavelengths, nm.
    #[inline]
    pub fn lambda_nm(&self) -> &[f32; LANES] {
        &self.lambda_nm
    }

    /// Their densities, 1/nm.
    #[inline]
    pub fn pdf_per_nm(&self) -> &[f32; LANES] {
        &self.pdf_per_nm
    }
}

/// A value per wavelength of a [`SampledWavelengths`].
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct SampledSpectrum(pub [f32; LANES]);

impl SampledSpectrum {
    /// Zero everywhere.
    pub const ZERO: Self = Self([0.0; LANES]);
    /// One everywhere.
    pub const ONE: Self = Self([1.0; LANES]);

    /// The same value everywhere.
    #[inline]
    pub const fn splat(v: f32) -> Self {
        Self([v; LANES])
    }

    /// Value by lane.
    #[inline]
    pub fn from_fn(f: impl FnMut(usize) -> f32) -> Self {
        Self(std::array::from_fn(f))
    }

    /// Mean over the lanes.
    #[inline]
    pub fn mean(&self) -> f32 {
        self.0.iter().sum::<f32>() / LANES as f32
    }

    /// Largest lane.
    #[inline]
    pub fn max(&self) -> f32 {
        self.0.iter().copied().fold(f32::NEG_INFINITY, f32::max)
    }

    /// Is every lane exactly zero?
    #[inline]
    pub fn is_zero(&self) -> bool {
        self.0.iter().all(|&v| v == 0.0)
    }

    /// Is every lane finite?
    #[inline]
    pub fn is_finite(&self) -> bool {
        self.0.iter().all(|v| v.is_finite())
    }

    /// Each lane through `f`.
    #[inline]
    pub fn map(self, f: impl FnMut(f32) -> f32) -> Self {
        Self(self.0.map(f))
    }
}

impl Index<usize> for SampledSpectrum {
    type Output = f32;
    #[inline]
    fn index(&self, i: usize) -> &f32 {
        &self.0[i]
    }
}

macro_rules! lanewise {
    ($($trait:ident $method:ident $op:tt),*) => {$(
        impl $trait for SampledSpectrum {
            type Output = Self;
            #[inline]
            fn $method(mut self, rhs: Self) -> Self {
                for (a, b) in self.0.iter_mut().zip(rhs.0) {
                    *a $op b;
                }
                self
            }
        }
        impl $trait<f32> for SampledSpectrum {
            type Output = Self;
            #[inline]
            fn $method(mut self, rhs: f32) -> Self {
                for a in &mut self.0 {
                    *a $op rhs;
                }
                self
            }
        }
    )*};
}
lanewise!(Add add +=, Sub sub -=, Mul mul *=, Div div /=);

impl Neg for SampledSpectrum {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        self.map(|v| -v)
    }
}

impl AddAssign for SampledSpectrum {
    #[inline]
    fn add_assign(&mut self, rhs: Self) {
        *self = *self + rhs;
    }
}

impl MulAssign for SampledSpectrum {
    #[inline]
    fn mul_assign(&mut self, rhs: Self) {
        *self = *self * rhs;
    }
}

impl MulAssign<f32> for SampledSpectrum {
    #[inline]
    fn mul_assign(&mut self, rhs: f32) {
        *self = *self * rhs;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pdf_integrates_to_one() {
        // Mean of 1/p over the samples is the width of the range.
        let n = 4096;
        let mean: f64 = (0..n)
            .flat_map(|i| *SampledWavelengths::visible((i as f32 + 0.5) / n as f32).pdf_per_nm())
            .map(|p| 1.0 / f64::from(p))
            .sum::<f64>()
            / (n * LANES) as f64;
        assert!((mean - 400.0).abs() < 0.1, "{mean}");
    }

    #[test]
    fn strata_are_ordered_and_in_range() {
        for u in [0.0, 0.3, 0.999_999] {
            let w = SampledWavelengths::visible(u);
            assert!(w.lambda_nm().windows(2).all(|p| p[0] < p[1]));
            assert!(w.lambda_nm()[0] >= VISIBLE_NM.0 && w.lambda_nm()[LANES - 1] <= VISIBLE_NM.1);
        }
    }
}

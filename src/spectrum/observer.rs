//! The eye: CIE colour-matching functions, and XYZ of a spectrum.
//!
//! Model: XYZ = integral L(l) (x, y, z)(l) dl / integral y(l) dl over 380-780 nm.
//! So the constant spectrum 1 has Y = 1, and Y of radiance is luminance in the unit of the light's
//! `radiance` key; the photometric constant 683 lm/W appears nowhere.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | x, y, z | [`Observer::cmf`] | none |
//! | L | [`Spectrum`], or [`SampledSpectrum`] with its densities p | any radiance per nm |
//!
//! Exact integral ([`Observer::xyz_of`]): trapezoids of 1 nm. Estimate of one path
//! ([`Observer::xyz_from_samples`]): the mean over the lanes of L (x, y, z) / p, unbiased for every way of
//! sampling the wavelengths. Limits: light outside 380-780 nm counts nothing (the y outside is 4e-5 of the
//! whole). Guarded by `constant_has_luminance_one`, `estimate_is_unbiased`, and by another implementation
//! in `agrees_with_colorimetry`. Source: CIE 015:2018, tables in `data/`.

use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

use super::sampled::{LANES, SampledSpectrum, SampledWavelengths, VISIBLE_NM};
use super::spectra::{DENSE_SAMPLES, Spectrum};
use super::table;

/// Whose eye sees the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Observer {
    /// CIE 1931, 2 degree field.
    #[default]
    Cie1931,
    /// CIE 1964, 10 degree field.
    Cie1964,
}

/// Colour-matching functions at 380, 381 ... 780 nm, divided by the integral of y.
struct Matching {
    /// For one path: padded for alignment, the last entry doubled so that 780 nm interpolates too.
    lanes: [[f32; 4]; DENSE_SAMPLES + 1],
    /// For integrals: with the trapezoid weights.
    weights: [[f64; 3]; DENSE_SAMPLES],
    /// Integral of y, nm.
    y_integral_nm: f64,
}

impl Matching {
    fn parse(text: &str, at: &str) -> crate::Result<Self> {
        let table = table::parse(text, at)?;
        let mut cmf = [[0.0; 3]; DENSE_SAMPLES];
        for (k, name) in ["x_bar", "y_bar", "z_bar"].into_iter().enumerate() {
            let points = table.points(Some(name))?;
            for (i, v) in cmf.iter_mut().enumerate() {
                v[k] = table::interpolate(&points, f64::from(VISIBLE_NM.0) + i as f64);
            }
        }
        let trapezoid = |i: usize| if i == 0 || i == DENSE_SAMPLES - 1 { 0.5 } else { 1.0 };
        let y_integral_nm = cmf.iter().enumerate().map(|(i, v)| v[1] * trapezoid(i)).sum::<f64>();
        let mut lanes = [[0.0; 4]; DENSE_SAMPLES + 1];
        for (i, lane) in lanes.iter_mut().enumerate() {
            let [x, y, z] = cmf[i.min(DENSE_SAMPLES - 1)].map(|v| (v / y_integral_nm) as f32);
            *lane = [x, y, z, 0.0];
        }
        let weights = std::array::from_fn(|i| cmf[i].map(|v| v * trapezoid(i) / y_integral_nm));
        Ok(Self { lanes, weights, y_integral_nm })
    }
}

impl Observer {
    fn matching(self) -> &'static Matching {
        static CIE_1931: OnceLock<Matching> = OnceLock::new();
        static CIE_1964: OnceLock<Matching> = OnceLock::new();
        let (cell, text, at) = match self {
            Observer::Cie1931 => {
                (&CIE_1931, include_str!("../../data/cie_1931_2deg.csv"), "cie_1931_2deg.csv")
            }
            Observer::Cie1964 => {
                (&CIE_1964, include_str!("../../data/cie_1964_10deg.csv"), "cie_1964_10deg.csv")
            }
        };
        cell.get_or_init(|| Matching::parse(text, at).expect("built-in table, read by every colour test"))
    }

    /// Colour-matching functions x, y, z at a wavelength; zero outside 380-780 nm.
    pub fn cmf(self, lambda_nm: f32) -> [f64; 3] {
        let matching = self.matching();
        lookup(matching, lambda_nm).map(|v| f64::from(v) * matching.y_integral_nm)
    }

    /// Integral of y, nm: the width that an equal-energy spectrum of luminance 1 stands for.
    pub fn y_integral_nm(self) -> f64 {
        self.matching().y_integral_nm
    }

    /// Unbiased estimate of XYZ from one path's radiance.
    pub fn xyz_from_samples(self, radiance: &SampledSpectrum, lambda: &SampledWavelengths) -> [f32; 3] {
        let matching = self.matching();
        let mut xyz = [0.0; 3];
        for i in 0..LANES {
            let weight = radiance[i] / (lambda.pdf_per_nm()[i] * LANES as f32);
            let cmf = lookup(matching, lambda.lambda_nm()[i]);
            for k in 0..3 {
                xyz[k] += cmf[k] * weight;
            }
        }
        xyz
    }

    /// XYZ of a spectrum.
    pub fn xyz_of(self, spectrum: &Spectrum) -> [f64; 3] {
        self.integrate(|i| match spectrum {
            Spectrum::Constant(v) => f64::from(*v),
            Spectrum::Dense(values) => f64::from(values[i]),
        })
    }

    /// XYZ of a function of the index of the nm from 380 on.
    pub(super) fn integrate(self, mut f: impl FnMut(usize) -> f64) -> [f64; 3] {
        let mut xyz = [0.0; 3];
        for (i, w) in self.matching().weights.iter().enumerate() {
            let v = f(i);
            for k in 0..3 {
                xyz[k] += w[k] * v;
            }
        }
        xyz
    }

    /// What [`Observer::integrate`] multiplies with, per nm from 380 on.
    pub(super) fn weights(self) -> &'static [[f64; 3]; DENSE_SAMPLES] {
        &self.matching().weights
    }
}

#[inline]
fn lookup(matching: &Matching, lambda_nm: f32) -> [f32; 3] {
    let x = lambda_nm - VISIBLE_NM.0;
    if !(0.0..=(DENSE_SAMPLES - 1) as f32).contains(&x) {
        return [0.0; 3];
    }
    let i = x as usize;
    let t = x - i as f32;
    let (a, b) = (&matching.lanes[i], &matching.lanes[i + 1]);
    [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t]
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOTH: [Observer; 2] = [Observer::Cie1931, Observer::Cie1964];

    #[test]
    fn tabulated_values() {
        // CIE 015:2018 at 555 nm (2 degree) and 555 nm (10 degree), and outside.
        let [x, y, z] = Observer::Cie1931.cmf(555.0);
        assert!((x - 0.512_050_1).abs() < 1e-6 && (y - 1.0).abs() < 1e-6 && (z - 0.005_749_999).abs() < 1e-6);
        assert!((Observer::Cie1964.cmf(555.0)[1] - 0.999_11).abs() < 2e-4);
        for observer in BOTH {
            assert_eq!(observer.cmf(379.9), [0.0; 3]);
            assert_eq!(observer.cmf(780.1), [0.0; 3]);
            assert!(observer.cmf(780.0)[1] > 0.0);
            assert_eq!(observer.cmf(f32::NAN), [0.0; 3]);
        }
    }

    #[test]
    fn constant_has_luminance_one() {
        for observer in BOTH {
            let [x, y, z] = observer.xyz_of(&Spectrum::Constant(1.0));
            assert!((y - 1.0).abs() < 1e-12);
            // Equal energy has chromaticity (1/3, 1/3) by the construction of XYZ.
            assert!((x - 1.0).abs() < 2e-3 && (z - 1.0).abs() < 2e-3, "{x} {z}");
        }
    }

    #[test]
    fn estimate_is_unbiased() {
        // Stratified midpoints make the mean over u converge to the integral, so the tolerance is tight.
        let n = 2000;
        let wiggly = Spectrum::from_fn(|l| 0.5 + 0.4 * (l / 13.0).sin());
        for observer in BOTH {
            for spectrum in [Spectrum::Constant(1.0), wiggly.clone()] {
                let exact = observer.xyz_of(&spectrum);
                for visible in [true, false] {
                    let mut mean = [0.0; 3];
                    for i in 0..n {
                        let u = (i as f32 + 0.5) / n as f32;
                        let lambda = if visible {
                            SampledWavelengths::visible(u)
                        } else {
                            SampledWavelengths::uniform(u, 360.0, 830.0)
                        };
                        let xyz = observer.xyz_from_samples(&spectrum.sample(&lambda), &lambda);
                        for k in 0..3 {
                            mean[k] += f64::from(xyz[k]) / f64::from(n);
                        }
                    }
                    for k in 0..3 {
                        assert!(
                            (mean[k] - exact[k]).abs() < 3e-4,
                            "{observer:?} {visible}: {mean:?} {exact:?}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn white_has_mean_one_within_its_error() {
        // Independent random shifts, as a camera draws them: mean Y of the constant 1 is 1 within 4 sigma.
        let n = 20_000u32;
        let (mut sum, mut sum2) = (0.0, 0.0);
        for i in 0..n {
            let lambda = SampledWavelengths::visible(crate::math::sampler::hash_to_unit(i) as f32);
            let y = f64::from(Observer::Cie1931.xyz_from_samples(&SampledSpectrum::ONE, &lambda)[1]);
            sum += y;
            sum2 += y * y;
        }
        let n = f64::from(n);
        let mean = sum / n;
        let deviation = (sum2 / n - mean * mean).max(0.0).sqrt();
        assert!((mean - 1.0).abs() < 4.0 * deviation / n.sqrt() + 1e-6, "{mean} +- {deviation}");
        // One path of 8 stratified wavelengths already knows the luminance of white to 3 %.
        assert!(deviation < 0.03, "{deviation}");
    }
}

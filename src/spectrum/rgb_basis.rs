//! A linear map from linear sRGB to spectra: for light, and for many colours.
//!
//! Model: three spectra B_i that are positive, sum to one at every wavelength and have the colours (1,0,0),
//! (0,1,0), (0,0,1) under D65 (CIE 1931); the spectrum of a colour is r B_red + g B_green + b B_blue.
//! That such spectra exist for sRGB is the finding of Mallett and Yuksel (2019, "Spectral primary
//! decomposition for rendering with sRGB reflectance", EGSR). Ours have a closed form (our reading):
//! B_i = exp(q_i) / sum exp(q_j), q_red and q_green quadratics in x = (l - 580 nm) / 200 nm, q_blue = 0:
//! six coefficients for six colour equations, solved once on first use.
//!
//! A colour of any brightness costs three products per wavelength and comes back exactly; it suits every
//! pixel of an environment map. Limits: spectra have the steps of the basis near 490 and 590 nm, steeper
//! than those of [`upsample`](super::upsample). Guarded by `basis_is_exact`, `light_of_a_pixel_has_its_colour`.

use std::sync::OnceLock;

use glam::DVec3;

use super::color::{CHANNELS, D65Colour, nm};
use super::illuminant::Illuminant;
use super::sampled::{SampledSpectrum, SampledWavelengths, VISIBLE_NM};
use super::spectra::{DENSE_SAMPLES, Spectrum};
use crate::math::solve::levenberg_marquardt;
use crate::{Error, Result};

/// A light whose colour relative to the illuminant's white is `rgb`, of any brightness: white is the
/// illuminant itself. Under D65 it has exactly this colour.
pub fn emission_from_rgb(rgb: [f32; 3], illuminant: &Illuminant, at: &str) -> Result<Spectrum> {
    let light = illuminant.spectrum()?;
    if rgb[0] == rgb[1] && rgb[1] == rgb[2] && rgb[0].is_finite() && rgb[0] >= 0.0 {
        return Ok(light.scaled(rgb[0]));
    }
    Ok(RgbBasis::get().spectrum(rgb, at)?.zip(&light, |s, l| s * l))
}

/// Three spectra that split white into the primaries of sRGB.
///
/// Because they sum to one, combinations of colours that add up to at most white never pass 1: two
/// textures with r + t <= 1 give R + T <= 1.
pub struct RgbBasis {
    coefficients: [f64; 6],
    /// At 380, 381 ... 780 nm, the last entry doubled so that 780 nm interpolates too.
    lanes: [[f32; 4]; DENSE_SAMPLES + 1],
}

impl RgbBasis {
    /// The basis, solved on first use.
    pub fn get() -> &'static RgbBasis {
        static BASIS: OnceLock<RgbBasis> = OnceLock::new();
        BASIS.get_or_init(|| {
            let (coefficients, _) = levenberg_marquardt([0.0; 6], 1e-12, |c| {
                let mut colours = [DVec3::ZERO; 2];
                for (w, l) in D65Colour::get().iter() {
                    let b = primaries(c, l);
                    colours[0] += w * b.x;
                    colours[1] += w * b.y;
                }
                six(colours[0] - DVec3::X, colours[1] - DVec3::Y)
            });
            let mut lanes = [[0.0; 4]; DENSE_SAMPLES + 1];
            for (i, lane) in lanes.iter_mut().enumerate() {
                let b = primaries(&coefficients, nm(i.min(DENSE_SAMPLES - 1))).as_vec3();
                *lane = [b.x, b.y, b.z, 0.0];
            }
            RgbBasis { coefficients, lanes }
        })
    }

    /// The combination `rgb` at the wavelengths of a path; multiply by the illuminant's values for light.
    /// Negative channels count as zero.
    pub fn sample(&self, rgb: [f32; 3], lambda: &SampledWavelengths) -> SampledSpectrum {
        let [r, g, b] = rgb.map(|v| v.max(0.0));
        SampledSpectrum(lambda.lambda_nm().map(|l| {
            let x = (l - VISIBLE_NM.0).clamp(0.0, (DENSE_SAMPLES - 1) as f32);
            let i = x as usize;
            let t = x - i as f32;
            let (p, q) = (&self.lanes[i], &self.lanes[i + 1]);
            let mix = |k: usize| p[k] + (q[k] - p[k]) * t;
            r * mix(0) + g * mix(1) + b * mix(2)
        }))
    }

    /// The combination `rgb` as a spectrum; channels must be finite and not negative.
    pub fn spectrum(&self, rgb: [f32; 3], at: &str) -> Result<Spectrum> {
        if let Some(i) = (0..3).find(|&i| !(rgb[i].is_finite() && rgb[i] >= 0.0)) {
            return Err(Error::invalid(at, format!("{} is {}: expected 0 or more", CHANNELS[i], rgb[i])));
        }
        let colour = DVec3::from(rgb.map(f64::from));
        Ok(Spectrum::from_fn(|l| colour.dot(self.at(l))))
    }

    /// The three spectra at a wavelength, in f64.
    pub(super) fn at(&self, lambda_nm: f64) -> DVec3 {
        primaries(&self.coefficients, lambda_nm)
    }
}

/// The three basis spectra of the six coefficients.
fn primaries(c: &[f64; 6], lambda_nm: f64) -> DVec3 {
    let q = DVec3::new(quadratic(&c[..3], lambda_nm), quadratic(&c[3..], lambda_nm), 0.0);
    let e = (q - q.max_element()).exp();
    e / e.element_sum()
}

/// The quadratic in x whose coefficients are fitted to colours.
pub(super) fn quadratic(c: &[f64], lambda_nm: f64) -> f64 {
    let x = (lambda_nm - 580.0) / 200.0;
    c[0] + x * (c[1] + x * c[2])
}

/// Two colour errors as the residuals of six coefficients.
pub(super) fn six(a: DVec3, b: DVec3) -> [f64; 6] {
    [a.x, a.y, a.z, b.x, b.y, b.z]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::Observer;
    use crate::spectrum::illuminant::d65;

    /// Linear sRGB of a spectrum under D65.
    fn rgb_of(s: &Spectrum) -> DVec3 {
        Observer::Cie1931.srgb_from_xyz() * DVec3::from(Observer::Cie1931.xyz_of(&s.zip(d65(), |a, b| a * b)))
    }

    #[test]
    fn basis_is_exact() {
        let basis = RgbBasis::get();
        for rgb in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0], [0.2, 30.0, 5.0]] {
            let s = basis.spectrum(rgb, "c").unwrap();
            let error = (rgb_of(&s) - DVec3::from(rgb.map(f64::from))).abs().max_element();
            assert!(s.min() >= 0.0 && error < 1e-6 * 30.0, "{rgb:?}: {error}");
        }
        for i in 0..DENSE_SAMPLES {
            assert!((basis.at(nm(i)).element_sum() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn light_of_a_pixel_has_its_colour() {
        // The path of an environment map: RGB x D65 at sampled wavelengths, back to RGB by the film.
        let rgb = [4.0, 0.5, 1.5];
        let n = 4000;
        let mut mean = DVec3::ZERO;
        for i in 0..n {
            let lambda = SampledWavelengths::visible((i as f32 + 0.5) / n as f32);
            let light = RgbBasis::get().sample(rgb, &lambda) * d65().sample(&lambda);
            let xyz = Observer::Cie1931.xyz_from_samples(&light, &lambda);
            mean += Observer::Cie1931.srgb_from_xyz() * DVec3::from(xyz.map(f64::from)) / f64::from(n);
        }
        assert!((mean - DVec3::new(4.0, 0.5, 1.5)).abs().max_element() < 2e-3, "{mean}");
        let lamp = emission_from_rgb(rgb, &Illuminant::D65, "lamp").unwrap();
        let xyz = DVec3::from(Observer::Cie1931.xyz_of(&lamp));
        let back = Observer::Cie1931.srgb_from_xyz() * xyz;
        assert!((back - DVec3::new(4.0, 0.5, 1.5)).abs().max_element() < 1e-4, "{back}");
        let a = Illuminant::A;
        assert_eq!(emission_from_rgb([2.0; 3], &a, "l").unwrap(), a.spectrum().unwrap().scaled(2.0));
    }

    #[test]
    fn bad_lights_are_named() {
        for bad in [[1.0, f32::NAN, 0.0], [0.0, -1.0, 0.0], [0.0, f32::INFINITY, 0.0]] {
            let e = emission_from_rgb(bad, &Illuminant::D65, "lamp").unwrap_err().to_string();
            assert!(e.starts_with("lamp: ") && e.contains("green"), "{e}");
        }
        assert!(emission_from_rgb([-1.0; 3], &Illuminant::D65, "lamp").is_err());
    }
}

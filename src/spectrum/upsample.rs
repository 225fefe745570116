//! Spectra from linear sRGB colours.
//!
//! **One colour** ([`reflectance_from_rgb`]): the sigmoid of a quadratic of Jakob and Hanika (2019, "A
//! low-dimensional function space for efficient spectral upsampling", Eurographics),
//! S(l) = s(c0 + c1 x + c2 x^2), s(t) = 1/2 + t / (2 sqrt(1 + t^2)), x = (l - 580 nm) / 200 nm,
//! with c fitted to the colour of S under D65 (CIE 1931, L*a*b*) for every colour when it is loaded.
//!
//! **Reflectance and transmittance together** ([`reflectance_transmittance_from_rgb`]): fitted apart, the
//! two pass 1 together at wavelengths that the eye hardly sees (`apart_they_exceed_one`), and a sheet
//! makes light. Here R = A q and T = A (1 - q), with A and q each such a sigmoid, so that R + T = A <= 1 at
//! every wavelength by construction; the six coefficients are fitted to both colours at once (our method).
//!
//! **Light** ([`emission_from_rgb`], [`RgbBasis`]): a linear combination of three spectra that are
//! non-negative, sum to one at every wavelength and have the colours (1,0,0), (0,1,0), (0,0,1) under D65
//! (the idea of Mallett and Yuksel 2019, "Spectral primary decomposition for rendering with sRGB
//! reflectance"). Ours are B_i = exp(q_i) / sum exp(q_j) with q_red and q_green quadratics in x and
//! q_blue = 0: six coefficients for six colour equations, solved once. Any colour of any brightness costs
//! three products per wavelength, and its colour is exact; it suits every pixel of an environment map.
//!
//! Colour error: below [`MAX_DELTA_E`] in L*a*b* for every input, in practice below 1e-3. Where sigmoids
//! cannot reach it (nearly black, pure and opposite colours on the two sides), the combination of
//! [`RgbBasis`] takes their place, which keeps every bound because it is linear and sums to one.
//! Limits: spectra are smooth, and are one guess among all of that colour (`colours_come_back`,
//! `joint_fit_keeps_colours_and_energy`, `basis_is_exact`).

use std::sync::{Arc, OnceLock};

use glam::{DMat3, DVec3};

use super::color::lab;
use super::illuminant::{Illuminant, d65};
use super::observer::Observer;
use super::sampled::{SampledSpectrum, SampledWavelengths, VISIBLE_NM};
use super::spectra::{DENSE_SAMPLES, Spectrum};
use crate::{Error, Result};

/// The largest difference (CIE 1976) between a colour and that of its spectrum under D65.
pub const MAX_DELTA_E: f64 = 0.1;

/// R + T stays this far below 1, so that rounding to f32 and interpolation cannot pass it.
const ROUNDING: f64 = 1e-6;

/// A spectrum in [0, 1] with this linear sRGB colour under D65. `at` names the colour in errors.
pub fn reflectance_from_rgb(rgb: [f32; 3], at: &str) -> Result<Spectrum> {
    for (name, v) in CHANNELS.iter().zip(rgb) {
        if !(0.0..=1.0).contains(&v) {
            return Err(Error::invalid(at, format!("{name} is {v}: expected 0 to 1")));
        }
    }
    if rgb[0] == rgb[1] && rgb[1] == rgb[2] {
        return Ok(Spectrum::Constant(rgb[0]));
    }
    let colour = DVec3::from(rgb.map(f64::from));
    let (c, delta_e) = fit_one(colour);
    if delta_e > MAX_DELTA_E {
        return RgbBasis::get().spectrum(rgb, at);
    }
    Ok(Spectrum::from_fn(|l| sigmoid(quadratic(&c, l))))
}

/// Reflectance and transmittance of a sheet with these colours, with R + T <= 1 at every wavelength.
pub fn reflectance_transmittance_from_rgb(
    r: [f32; 3],
    t: [f32; 3],
    at: &str,
) -> Result<(Spectrum, Spectrum)> {
    for (i, name) in CHANNELS.iter().enumerate() {
        // Sums such as 0.7 + 0.3 pass 1 by a rounding.
        if f64::from(r[i]) + f64::from(t[i]) > 1.0 + 0.5 * ROUNDING {
            return Err(Error::invalid(
                at,
                format!(
                    "reflectance {} + transmittance {} is more than 1 in {name}: the sheet would make light",
                    r[i], t[i]
                ),
            ));
        }
    }
    let grey = |c: [f32; 3]| c[0] == c[1] && c[1] == c[2];
    if grey(r) && grey(t) || r == [0.0; 3] || t == [0.0; 3] {
        let reflectance = reflectance_from_rgb(r, &format!("{at}: reflectance"))?;
        let transmittance = reflectance_from_rgb(t, &format!("{at}: transmittance"))?;
        let most = reflectance.max() + transmittance.max();
        return Ok(if most > 1.0 {
            let scale = ((1.0 - ROUNDING) / f64::from(most)) as f32;
            (reflectance.scaled(scale), transmittance.scaled(scale))
        } else {
            (reflectance, transmittance)
        });
    }
    for (colour, side) in [(r, "reflectance"), (t, "transmittance")] {
        if let Some(i) = (0..3).find(|&i| !(0.0..=1.0).contains(&colour[i])) {
            let what = format!("{side} {} is {}: expected 0 to 1", CHANNELS[i], colour[i]);
            return Err(Error::invalid(at, what));
        }
    }
    let (r64, t64) = (DVec3::from(r.map(f64::from)), DVec3::from(t.map(f64::from)));
    let (c, delta_e) = fit_two(r64, t64);
    let limit = 1.0 - ROUNDING;
    if delta_e > MAX_DELTA_E {
        let basis = RgbBasis::get();
        let part = |c: DVec3| Spectrum::from_fn(|l| limit * c.dot(basis.at(l)));
        return Ok((part(r64), part(t64)));
    }
    let part = |f: fn((f64, f64)) -> f64| Spectrum::from_fn(|l| limit * f(sheet(&c, l)));
    Ok((part(|(r, _)| r), part(|(_, t)| t)))
}

/// A light whose colour relative to the illuminant's white is `rgb`, of any brightness: white is the
/// illuminant itself. Under D65 it has exactly this colour.
pub fn emission_from_rgb(rgb: [f32; 3], illuminant: &Illuminant, at: &str) -> Result<Spectrum> {
    let light = illuminant.spectrum()?;
    if rgb[0] == rgb[1] && rgb[1] == rgb[2] && rgb[0].is_finite() && rgb[0] >= 0.0 {
        return Ok(light.scaled(rgb[0]));
    }
    Ok(RgbBasis::get().spectrum(rgb, at)?.zip(&light, |s, l| s * l))
}

const CHANNELS: [&str; 3] = ["red", "green", "blue"];

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

    fn at(&self, lambda_nm: f64) -> DVec3 {
        primaries(&self.coefficients, lambda_nm)
    }
}

fn nm(i: usize) -> f64 {
    f64::from(VISIBLE_NM.0) + i as f64
}

fn quadratic(c: &[f64], lambda_nm: f64) -> f64 {
    let x = (lambda_nm - 580.0) / 200.0;
    c[0] + x * (c[1] + x * c[2])
}

fn sigmoid(t: f64) -> f64 {
    // For negative t in the form that does not cancel.
    let h = 1.0f64.hypot(t);
    if t < 0.0 { 0.5 / (h * (h - t)) } else { 0.5 + 0.5 * t / h }
}

fn inverse_sigmoid(s: f64) -> f64 {
    let v = 2.0 * s.clamp(0.02, 0.98) - 1.0;
    v / (1.0 - v * v).sqrt()
}

/// R and T of the six coefficients: total A, then share q.
fn sheet(c: &[f64; 6], lambda_nm: f64) -> (f64, f64) {
    let total = sigmoid(quadratic(&c[..3], lambda_nm));
    let share = quadratic(&c[3..], lambda_nm);
    (total * sigmoid(share), total * sigmoid(-share))
}

/// The three basis spectra of the six coefficients.
fn primaries(c: &[f64; 6], lambda_nm: f64) -> DVec3 {
    let q = DVec3::new(quadratic(&c[..3], lambda_nm), quadratic(&c[3..], lambda_nm), 0.0);
    let e = (q - q.max_element()).exp();
    e / e.element_sum()
}

/// Linear sRGB of a reflectance under D65, and L*a*b* of linear sRGB.
struct D65Colour {
    rgb_weights: Arc<[DVec3; DENSE_SAMPLES]>,
    xyz_from_srgb: DMat3,
    white: DVec3,
}

impl D65Colour {
    fn get() -> &'static D65Colour {
        static COLOUR: OnceLock<D65Colour> = OnceLock::new();
        COLOUR.get_or_init(|| {
            let observer = Observer::Cie1931;
            let m = observer.srgb_from_xyz();
            let weights = observer.weights();
            let light = |i: usize| f64::from(d65().at(nm(i) as f32));
            D65Colour {
                rgb_weights: Arc::new(std::array::from_fn(|i| m * DVec3::from(weights[i]) * light(i))),
                xyz_from_srgb: observer.xyz_from_srgb(),
                white: observer.white(),
            }
        })
    }

    /// Weight and wavelength of each nm.
    fn iter(&self) -> impl Iterator<Item = (DVec3, f64)> {
        self.rgb_weights.iter().enumerate().map(|(i, w)| (*w, nm(i)))
    }

    fn lab(&self, rgb: DVec3) -> DVec3 {
        lab(self.xyz_from_srgb * rgb, self.white)
    }
}

fn six(a: DVec3, b: DVec3) -> [f64; 6] {
    [a.x, a.y, a.z, b.x, b.y, b.z]
}

/// Coefficients for one colour, and their colour error.
fn fit_one(rgb: DVec3) -> ([f64; 3], f64) {
    let colour = D65Colour::get();
    let target = colour.lab(rgb);
    levenberg_marquardt([inverse_sigmoid(rgb.element_sum() / 3.0), 0.0, 0.0], 1e-4, |c| {
        let mut sum = DVec3::ZERO;
        for (w, l) in colour.iter() {
            sum += w * sigmoid(quadratic(c, l));
        }
        (colour.lab(sum) - target).to_array()
    })
}

/// Coefficients of total and share for two colours, and the colour error of both together.
fn fit_two(r: DVec3, t: DVec3) -> ([f64; 6], f64) {
    let colour = D65Colour::get();
    let (target_r, target_t) = (colour.lab(r), colour.lab(t));
    let total = r + t;
    let mean_share = r.element_sum() / total.element_sum();
    let share = DVec3::from_array(std::array::from_fn(|i| {
        if total[i] > 1e-6 { (r[i] / total[i]).clamp(1e-4, 1.0 - 1e-4) } else { mean_share }
    }));
    let ([a0, a1, a2], _) = fit_one(total.min(DVec3::ONE));
    let ([q0, q1, q2], _) = fit_one(share);
    levenberg_marquardt([a0, a1, a2, q0, q1, q2], 1e-4, |c| {
        let (mut sum_r, mut sum_t) = (DVec3::ZERO, DVec3::ZERO);
        for (w, l) in colour.iter() {
            let (r, t) = sheet(c, l);
            sum_r += w * r;
            sum_t += w * t;
        }
        six(colour.lab(sum_r) - target_r, colour.lab(sum_t) - target_t)
    })
}

/// Root of `residual` by damped Gauss-Newton steps, with the length of what remains. Numeric derivatives:
/// a colour is fitted once, and the residual is smooth.
fn levenberg_marquardt<const N: usize>(
    mut p: [f64; N],
    goal: f64,
    residual: impl Fn(&[f64; N]) -> [f64; N],
) -> ([f64; N], f64) {
    let square = |r: &[f64; N]| r.iter().map(|v| v * v).sum::<f64>();
    let mut r = residual(&p);
    let mut error = square(&r);
    let mut damping = 1e-2;
    for _ in 0..60 {
        if error <= goal * goal {
            break;
        }
        // jacobian[j][i] = d r_i / d p_j
        let jacobian: [[f64; N]; N] = std::array::from_fn(|j| {
            let h = 1e-6 * (1.0 + p[j].abs());
            let (mut above, mut below) = (p, p);
            above[j] += h;
            below[j] -= h;
            let (a, b) = (residual(&above), residual(&below));
            std::array::from_fn(|i| (a[i] - b[i]) / (2.0 * h))
        });
        let dot = |a: &[f64; N], b: &[f64; N]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let normal: [[f64; N]; N] =
            std::array::from_fn(|i| std::array::from_fn(|j| dot(&jacobian[i], &jacobian[j])));
        let gradient: [f64; N] = std::array::from_fn(|i| -dot(&jacobian[i], &r));
        let trace: f64 = (0..N).map(|i| normal[i][i]).sum();
        let mut improved = false;
        for _ in 0..12 {
            let mut damped = normal;
            for (i, row) in damped.iter_mut().enumerate() {
                row[i] += damping * (row[i] + 1e-9 * trace);
            }
            let step = solve_positive(damped, gradient);
            let next: [f64; N] = std::array::from_fn(|i| p[i] + step[i]);
            let next_r = residual(&next);
            let next_error = square(&next_r);
            if next_error < error {
                (p, r, error) = (next, next_r, next_error);
                damping = (damping / 5.0).max(1e-12);
                improved = true;
                break;
            }
            damping *= 4.0;
        }
        if !improved {
            break;
        }
    }
    (p, error.sqrt())
}

/// Solves a symmetric positive definite system by elimination (which needs no pivoting for these).
fn solve_positive<const N: usize>(mut a: [[f64; N]; N], mut b: [f64; N]) -> [f64; N] {
    for k in 0..N {
        let (pivot, pivot_b) = (a[k], b[k]);
        for i in k + 1..N {
            let f = a[i][k] / pivot[k];
            for (v, p) in a[i].iter_mut().zip(&pivot).skip(k) {
                *v -= f * p;
            }
            b[i] -= f * pivot_b;
        }
    }
    for k in (0..N).rev() {
        for j in k + 1..N {
            b[k] -= a[k][j] * b[j];
        }
        b[k] /= a[k][k];
    }
    b
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Linear sRGB of a spectrum under D65.
    fn rgb_of(s: &Spectrum) -> DVec3 {
        Observer::Cie1931.srgb_from_xyz() * DVec3::from(Observer::Cie1931.xyz_of(&s.zip(d65(), |a, b| a * b)))
    }

    fn delta_e(s: &Spectrum, rgb: [f32; 3]) -> f64 {
        let colour = D65Colour::get();
        (colour.lab(rgb_of(s)) - colour.lab(DVec3::from(rgb.map(f64::from)))).length()
    }

    /// Largest R + T, also between the samples.
    fn most(r: &Spectrum, t: &Spectrum) -> f32 {
        (0..=1600).map(|i| 380.0 + i as f32 * 0.25).map(|l| r.at(l) + t.at(l)).fold(0.0, f32::max)
    }

    #[test]
    fn colours_come_back() {
        let levels = [0.0, 1e-4, 0.003, 0.05, 0.3, 0.7, 0.99, 1.0];
        for r in levels {
            for g in levels {
                for b in levels {
                    let s = reflectance_from_rgb([r, g, b], "c").unwrap();
                    assert!(s.min() >= 0.0 && s.max() <= 1.0);
                    let e = delta_e(&s, [r, g, b]);
                    assert!(e < 2e-3, "{r} {g} {b}: {e}");
                }
            }
        }
    }

    #[test]
    fn greys_are_constant() {
        for v in [0.0, 0.18, 1.0] {
            assert_eq!(reflectance_from_rgb([v; 3], "c").unwrap(), Spectrum::Constant(v));
        }
        let (r, t) = reflectance_transmittance_from_rgb([0.7; 3], [0.3; 3], "c").unwrap();
        assert!(most(&r, &t) <= 1.0 && (r.max() - 0.7).abs() < 1e-5);
        let (r, t) = reflectance_transmittance_from_rgb([0.5; 3], [0.25; 3], "c").unwrap();
        assert_eq!((r, t), (Spectrum::Constant(0.5), Spectrum::Constant(0.25)));
    }

    #[test]
    fn apart_they_exceed_one() {
        let (r, t) = ([0.6, 0.05, 0.05], [0.38, 0.02, 0.03]);
        let apart = (reflectance_from_rgb(r, "r").unwrap(), reflectance_from_rgb(t, "t").unwrap());
        assert!(most(&apart.0, &apart.1) > 1.01, "{}", most(&apart.0, &apart.1));
        let beyond =
            (380..=780).map(|l| l as f32).find(|&l| l > 500.0 && apart.0.at(l) + apart.1.at(l) > 1.0);
        assert!(matches!(beyond, Some(l) if (600.0..680.0).contains(&l)), "{beyond:?}");
        let (joint_r, joint_t) = reflectance_transmittance_from_rgb(r, t, "petal").unwrap();
        assert!(most(&joint_r, &joint_t) <= 1.0);
        assert!(delta_e(&joint_r, r) < 2e-3 && delta_e(&joint_t, t) < 2e-3);
    }

    /// Channels of a sheet: any total and share, with the extremes often.
    fn channel() -> impl Strategy<Value = f32> {
        prop_oneof![3 => 0.0f32..=1.0, 1 => Just(0.0), 1 => Just(1.0), 1 => (0.0f32..=1.0).prop_map(|v| v * 1e-3)]
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 400,
            failure_persistence: None,
            rng_seed: proptest::test_runner::RngSeed::Fixed(7),
            ..ProptestConfig::default()
        })]

        #[test]
        fn joint_fit_keeps_colours_and_energy(
            total in [channel(), channel(), channel()],
            share in [channel(), channel(), channel()],
        ) {
            let r: [f32; 3] = std::array::from_fn(|i| total[i] * share[i]);
            let t: [f32; 3] = std::array::from_fn(|i| total[i] - r[i]);
            let (rs, ts) = reflectance_transmittance_from_rgb(r, t, "sheet").unwrap();
            prop_assert!(rs.min() >= 0.0 && ts.min() >= 0.0);
            prop_assert!(most(&rs, &ts) <= 1.0, "{}", most(&rs, &ts));
            let (er, et) = (delta_e(&rs, r), delta_e(&ts, t));
            prop_assert!(er < MAX_DELTA_E && et < MAX_DELTA_E, "{r:?} {t:?}: {er} {et}");
        }
    }

    #[test]
    fn opposite_pure_colours_use_the_basis() {
        for (r, t) in [([0.9, 0.0, 0.0], [0.0, 0.0, 0.9]), ([1.0, 0.0, 0.0], [0.0, 1.0, 1.0])] {
            let (rs, ts) = reflectance_transmittance_from_rgb(r, t, "sheet").unwrap();
            assert!(most(&rs, &ts) <= 1.0);
            assert!(delta_e(&rs, r) < MAX_DELTA_E && delta_e(&ts, t) < MAX_DELTA_E);
        }
    }

    #[test]
    fn bad_colours_are_named() {
        for bad in [-0.1, 1.1, f32::NAN, f32::INFINITY] {
            let e = reflectance_from_rgb([0.5, bad, 0.5], "petal").unwrap_err().to_string();
            assert!(e.starts_with("petal: ") && e.contains("green"), "{e}");
            assert!(reflectance_transmittance_from_rgb([0.5, 0.4, bad], [0.1, 0.2, 0.3], "p").is_err());
            assert!(reflectance_transmittance_from_rgb([0.1, 0.2, 0.3], [0.5, 0.4, bad], "p").is_err());
            assert!(reflectance_transmittance_from_rgb([0.0; 3], [bad, 0.0, 0.0], "p").is_err());
        }
        assert!(emission_from_rgb([1.0, f32::NAN, 0.0], &Illuminant::D65, "lamp").is_err());
        assert!(emission_from_rgb([-1.0; 3], &Illuminant::D65, "lamp").is_err());
        let e = reflectance_transmittance_from_rgb([0.1, 0.2, 0.6], [0.1, 0.2, 0.5], "p").unwrap_err();
        assert!(e.to_string().contains("blue"), "{e}");
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
}

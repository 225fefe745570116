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
//! Colour error: below [`MAX_DELTA_E`] in L*a*b* for every input, for almost all below 1e-3. Where sigmoids
//! cannot reach it (opposite pure colours on the two sides), the combination of [`RgbBasis`] takes their
//! place, which keeps every bound because it is linear and sums to one.
//! Limits: spectra are smooth, and are one guess among all of that colour (`colours_come_back`,
//! `joint_fit_keeps_colours_and_energy`, `opposite_pure_colours_use_the_basis`).

use glam::DVec3;

use super::color::{CHANNELS, D65Colour};
use super::rgb_basis::{RgbBasis, quadratic, six};
use super::spectra::Spectrum;
use crate::math::solve::levenberg_marquardt;
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

fn sigmoid(t: f64) -> f64 {
    // For negative t in the form that does not cancel.
    let h = (1.0 + t * t).sqrt();
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::spectrum::Observer;
    use crate::spectrum::illuminant::d65;

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
        for (r, t) in [([0.5f32, 0.0, 0.0], [0.0f32, 0.5, 0.0]), ([1.0, 0.0, 0.0], [0.0, 0.0, 0.5])] {
            let wide = |c: [f32; 3]| DVec3::from(c.map(f64::from));
            assert!(fit_two(wide(r), wide(t)).1 > MAX_DELTA_E, "the sigmoids reach this one");
            let (rs, ts) = reflectance_transmittance_from_rgb(r, t, "sheet").unwrap();
            assert!(most(&rs, &ts) <= 1.0);
            assert!(delta_e(&rs, r) < 2e-3 && delta_e(&ts, t) < 2e-3);
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
        let e = reflectance_transmittance_from_rgb([0.1, 0.2, 0.6], [0.1, 0.2, 0.5], "p").unwrap_err();
        assert!(e.to_string().contains("blue"), "{e}");
    }
}

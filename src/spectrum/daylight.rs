//! Daylight: the CIE's three components, and the chromaticities of lights by their temperature.
//!
//! Model: `S(lambda) = S0 + M1 S1 + M2 S2`, the mean of measured daylight and its two main variations, for the
//! chromaticity (x, y):
//!
//! ```text
//! M1 = (-1.3515 - 1.7703 x + 5.9114 y) / d    M2 = (0.0300 - 31.4424 x + 30.0717 y) / d    d = 0.0241 + 0.2562 x - 0.7341 y
//! y = -3 x^2 + 2.870 x - 0.275    on the locus; x(T): two cubics in 1/T, 4000 to 25000 K
//! ```
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | S0, S1, S2 | `components` | relative, 100 at 560 nm for S0 | `data/cie_daylight.csv` |
//! | T | `temperature_k` | K | |
//!
//! Limits: a white below 4000 K is a black body's, above 5000 K it is daylight, between the two it moves from one to the
//! other (our reading; photographers call both by their temperature). Guarded by `d65_is_daylight_of_its_chromaticity`,
//! `whites_of_known_temperatures`. Source: CIE 015:2018, section 4.1.2.

use std::sync::OnceLock;

use super::illuminant::Illuminant;
use super::observer::Observer;
use super::spectra::Spectrum;
use super::table;
use crate::{Error, Result};

/// The three components, with the luminance of each (as [`Observer::xyz_of`] counts it).
#[derive(Debug)]
pub struct Daylight {
    components: [Spectrum; 3],
    luminances: [f64; 3],
}

impl Daylight {
    /// The CIE's tables.
    pub fn get() -> &'static Daylight {
        static DAYLIGHT: OnceLock<Daylight> = OnceLock::new();
        DAYLIGHT.get_or_init(|| {
            let components = table::parse(include_str!("../../data/cie_daylight.csv"), "cie_daylight.csv")
                .and_then(|t| Ok([t.spectrum(Some("s0"))?, t.spectrum(Some("s1"))?, t.spectrum(Some("s2"))?]))
                .expect("built-in table, read by every daylight test");
            let luminances = [0, 1, 2].map(|i| Observer::Cie1931.xyz_of(&components[i])[1]);
            Daylight { components, luminances }
        })
    }

    /// S0, S1, S2.
    pub fn components(&self) -> &[Spectrum; 3] {
        &self.components
    }

    /// Factors of the components for daylight of chromaticity (x, y) and luminance 1.
    pub fn factors(&self, x: f64, y: f64) -> [f64; 3] {
        let d = 0.0241 + 0.2562 * x - 0.7341 * y;
        let m1 = (-1.3515 - 1.7703 * x + 5.9114 * y) / d;
        let m2 = (0.03 - 31.4424 * x + 30.0717 * y) / d;
        let luminance = self.luminances[0] + m1 * self.luminances[1] + m2 * self.luminances[2];
        [1.0, m1, m2].map(|m| m / luminance)
    }
}

/// Range of [`white_of`], K.
pub const WHITE_K: (f64, f64) = (1500.0, 25_000.0);

/// Chromaticity (x, y) of the light that photographers call by this temperature: a black body up to 4000 K, daylight from
/// 5000 K on.
pub fn white_of(temperature_k: f64) -> Result<[f64; 2]> {
    let (low, high) = WHITE_K;
    if !(low..=high).contains(&temperature_k) {
        return Err(Error::invalid(
            "temperature",
            format!("{temperature_k} K is not within {low} to {high} K"),
        ));
    }
    let share = (temperature_k - 4000.0) / 1000.0;
    let daylight = daylight_locus(temperature_k.max(4000.0));
    if share >= 1.0 {
        return Ok(daylight);
    }
    let [x, y, z] = Observer::Cie1931.xyz_of(&Illuminant::Blackbody(temperature_k).spectrum()?);
    let black_body = [x / (x + y + z), y / (x + y + z)];
    Ok([0, 1].map(|i| black_body[i] + (daylight[i] - black_body[i]) * share.max(0.0)))
}

fn daylight_locus(temperature_k: f64) -> [f64; 2] {
    let r = 1e3 / temperature_k;
    let [a, b, c, d] = match temperature_k <= 7000.0 {
        true => [0.244_063, 0.099_11, 2.967_8, -4.607],
        false => [0.237_040, 0.247_48, 1.901_8, -2.006_4],
    };
    let x = a + r * (b + r * (c + r * d));
    [x, -3.0 * x * x + 2.87 * x - 0.275]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::illuminant::d65;

    #[test]
    fn d65_is_daylight_of_its_chromaticity() {
        let daylight = Daylight::get();
        let f = daylight.factors(0.3127, 0.329);
        let ours = |nm: f32| (0..3).map(|i| f[i] * f64::from(daylight.components[i].at(nm))).sum::<f64>();
        for i in 0..=40 {
            let nm = 380.0 + 10.0 * i as f32;
            let theirs = f64::from(d65().at(nm));
            assert!((ours(nm) / theirs - 1.0).abs() < 6e-3, "{nm} nm: {} {theirs}", ours(nm));
        }
    }

    #[test]
    fn whites_of_known_temperatures() {
        // D65 and D50 by their temperatures in today's scale; illuminant A.
        for (k, x, y) in [(6504.0, 0.3127, 0.3290), (5003.0, 0.3457, 0.3585), (2856.0, 0.4476, 0.4075)] {
            let white = white_of(k).unwrap();
            assert!((white[0] - x).abs() < 3e-4 && (white[1] - y).abs() < 3e-4, "{k} K: {white:?}");
        }
        // No jumps, and bluer with temperature.
        let mut last = white_of(1500.0).unwrap();
        for k in (1510..=25_000).step_by(10) {
            let white = white_of(f64::from(k)).unwrap();
            assert!(white[0] < last[0] && last[0] - white[0] < 2e-3, "{k} K: {last:?} {white:?}");
            last = white;
        }
        for bad in [f64::NAN, 0.0, 1499.0, 25_001.0, f64::INFINITY] {
            assert!(white_of(bad).is_err(), "{bad}");
        }
    }
}

//! Standard light sources.
//!
//! Model: relative spectral power, scaled to Y = 1 for the CIE 1931 observer in the convention of
//! [`Observer`]. A light multiplies it by its `radiance` or `irradiance`, which are
//! luminances by that.
//!
//! | name | spectrum | source |
//! |---|---|---|
//! | `A` | Planck's law with c2 = 1.435e-2 m K and T = 2848 K (2856 K today) | CIE 015:2018, eq. 4.1 |
//! | `D65`, `D50` | tables of 5 nm | CIE 015:2018, `data/` |
//! | `E` | constant | CIE 015:2018 |
//! | `blackbody_k` | Planck's law with today's constants | SI 2019 |
//!
//! Limits: blackbodies of 500 to 1e6 K (`unusable_temperatures_are_errors`). Guarded by
//! `luminance_is_one` and, against another implementation, by `agrees_with_colorimetry`.

use std::fmt;
use std::str::FromStr;
use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

use super::observer::Observer;
use super::spectra::{Spectrum, planck_w_per_m2_sr_nm};
use super::table;
use crate::{Error, Result};

/// The spectrum of a light: `"A"`, `"D65"`, `"D50"`, `"E"` or `{ blackbody_k = 3000 }` in files; `A`, `D65`,
/// `D50`, `E` or `3000K` as text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub enum Illuminant {
    /// Tungsten light, 2856 K.
    A,
    /// Noon daylight.
    #[default]
    D65,
    /// Horizon daylight, the graphic arts' reference.
    D50,
    /// Equal energy at every wavelength.
    E,
    /// Thermal radiation at this temperature, K.
    #[serde(rename = "blackbody_k")]
    Blackbody(f64),
}

impl Illuminant {
    /// The spectrum, with Y = 1.
    pub fn spectrum(self) -> Result<Spectrum> {
        Ok(match self {
            Illuminant::A => normalised(|l| {
                let c2_nm_k = 1.435e7;
                let x = |l: f64| (c2_nm_k / (2848.0 * l)).exp_m1();
                (560.0 / l).powi(5) * x(560.0) / x(l)
            }),
            Illuminant::D65 => d65().clone(),
            Illuminant::D50 => {
                static D50: OnceLock<Spectrum> = OnceLock::new();
                D50.get_or_init(|| daylight(include_str!("../../data/cie_d50.csv"), "cie_d50.csv")).clone()
            }
            Illuminant::E => Spectrum::Constant(1.0),
            Illuminant::Blackbody(temperature_k) => {
                if !(500.0..=1e6).contains(&temperature_k) {
                    return Err(Error::invalid(
                        "blackbody_k",
                        format!("{temperature_k} K: expected 500 to 1e6 K"),
                    ));
                }
                normalised(|l| planck_w_per_m2_sr_nm(l, temperature_k))
            }
        })
    }
}

/// D65 with Y = 1: the white of sRGB and of colours given as RGB.
pub fn d65() -> &'static Spectrum {
    static D65: OnceLock<Spectrum> = OnceLock::new();
    D65.get_or_init(|| daylight(include_str!("../../data/cie_d65.csv"), "cie_d65.csv"))
}

fn daylight(text: &str, at: &str) -> Spectrum {
    let points = table::parse(text, at)
        .and_then(|table| table.points(Some("power")))
        .expect("built-in table, read by every illuminant test");
    normalised(|l| table::interpolate(&points, l))
}

/// `f` of nm, scaled to Y = 1 for the CIE 1931 observer.
fn normalised(f: impl Fn(f64) -> f64) -> Spectrum {
    let [_, y, _] = Observer::Cie1931.integrate(|i| f(380.0 + i as f64));
    Spectrum::from_fn(|l| f(l) / y)
}

impl fmt::Display for Illuminant {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Illuminant::Blackbody(temperature_k) => write!(out, "{temperature_k}K"),
            named => write!(out, "{named:?}"),
        }
    }
}

impl FromStr for Illuminant {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let upper = text.trim().to_ascii_uppercase();
        Ok(match upper.as_str() {
            "A" => Illuminant::A,
            "D65" => Illuminant::D65,
            "D50" => Illuminant::D50,
            "E" => Illuminant::E,
            _ => match upper.strip_suffix('K').and_then(|t| t.trim().parse().ok()) {
                Some(temperature_k) => Illuminant::Blackbody(temperature_k),
                None => {
                    return Err(Error::invalid(
                        text,
                        "is no illuminant: expected A, D65, D50, E or a temperature such as 3000K",
                    ));
                }
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOME: [Illuminant; 7] = [
        Illuminant::A,
        Illuminant::D65,
        Illuminant::D50,
        Illuminant::E,
        Illuminant::Blackbody(500.0),
        Illuminant::Blackbody(5000.0),
        Illuminant::Blackbody(1e6),
    ];

    #[test]
    fn luminance_is_one() {
        for illuminant in SOME {
            let spectrum = illuminant.spectrum().unwrap();
            let y = Observer::Cie1931.xyz_of(&spectrum)[1];
            assert!((y - 1.0).abs() < 1e-6, "{illuminant}: {y}");
            assert!(spectrum.min() >= 0.0 && spectrum.max().is_finite());
        }
    }

    #[test]
    fn chromaticities_of_the_cie() {
        // CIE 015:2018, table 3 of chromaticities (2 degree observer).
        for (illuminant, x, y) in [
            (Illuminant::A, 0.44758, 0.40745),
            (Illuminant::D65, 0.31272, 0.32903),
            (Illuminant::D50, 0.34567, 0.35851),
            (Illuminant::E, 1.0 / 3.0, 1.0 / 3.0),
        ] {
            let xyz = Observer::Cie1931.xyz_of(&illuminant.spectrum().unwrap());
            let sum: f64 = xyz.iter().sum();
            assert!(
                (xyz[0] / sum - x).abs() < 1e-4 && (xyz[1] / sum - y).abs() < 1e-4,
                "{illuminant}: {} {}",
                xyz[0] / sum,
                xyz[1] / sum
            );
        }
    }

    #[test]
    fn agrees_with_colorimetry() {
        use colorimetry::illuminant::Illuminant as Other;
        use colorimetry::observer::Observer as OtherEye;
        for (ours, other) in [
            (Illuminant::D65, Other::d65()),
            (Illuminant::D50, Other::d50()),
            (Illuminant::E, Other::equal_energy()),
            (Illuminant::A, Other::planckian(2848.0 * 1.438_777 / 1.435)),
            (Illuminant::Blackbody(3000.0), Other::planckian(3000.0)),
            (Illuminant::Blackbody(9000.0), Other::planckian(9000.0)),
        ] {
            let theirs = OtherEye::Cie1931.xyz(&other, None);
            let xyz = Observer::Cie1931.xyz_of(&ours.spectrum().unwrap());
            for (a, b) in xyz.iter().zip([theirs.x(), theirs.y(), theirs.z()]) {
                assert!((a - b / theirs.y()).abs() < 1e-3, "{ours}: {xyz:?} {theirs:?}");
            }
        }
    }

    #[test]
    fn text_and_files() {
        for illuminant in SOME {
            assert_eq!(illuminant.to_string().parse::<Illuminant>().unwrap(), illuminant);
            let json = serde_json::to_string(&illuminant).unwrap();
            assert_eq!(serde_json::from_str::<Illuminant>(&json).unwrap(), illuminant);
        }
        let toml: std::collections::HashMap<String, Illuminant> =
            toml::from_str("a = \"D50\"\nb = { blackbody_k = 3000 }").unwrap();
        assert_eq!(toml["a"], Illuminant::D50);
        assert_eq!(toml["b"], Illuminant::Blackbody(3000.0));
        assert_eq!("d65".parse::<Illuminant>().unwrap(), Illuminant::D65);
        for bad in ["", "F11", "3000", "K", "hotK"] {
            assert!(bad.parse::<Illuminant>().is_err(), "{bad}");
        }
    }

    #[test]
    fn unusable_temperatures_are_errors() {
        for t in [f64::NAN, f64::INFINITY, -3000.0, 0.0, 499.0, 1.1e6] {
            assert!(Illuminant::Blackbody(t).spectrum().is_err(), "{t}");
        }
    }
}

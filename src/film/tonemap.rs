//! `ToneMap`: from scene-linear light to the numbers of an sRGB screen.
//!
//! ```text
//! screen = curve(2^exposure_ev * rgb),   in and out: Rec. 709 primaries, D65; out: sRGB-encoded, 0 to 1
//! ```
//! - `linear`: no curve, clipped at 1.
//! - `aces`: Hill's fit of the ACES reference rendering and sRGB output transforms (S. Hill, 2016, in "BakingLab"):
//!   `M_out * c(M_in * rgb)`, `c(v) = (v (v + a) - b) / (v (d v + e) + f)`.
//!   Middle grey lands at a tenth of white, as in the reference: about a stop darker than `linear`.
//! - `agx`: Sobotka's AgX (2022): inset matrix, log2 encoding over 16.5 stops around middle grey, sigmoid, outset
//!   matrix, and a 2.2 power display. The matrices are those of Wrensch, "Minimal AgX implementation" (2023). The
//!   sigmoid is the analytic one behind AgX's table: pivot (10/16.5, 0.5), slope 2, powers 3 (toe) and 3.25
//!   (shoulder). Wrensch's polynomial fit of that table is negative at black, so it serves as a check only; ours
//!   stays within 0.0027 of it (root mean square, `agx_sigmoid_matches_the_published_polynomial`).
//! - `agx_punchy`: AgX with the "punchy" look of its authors before the outset, in Wrensch's numbers:
//!   `v = pow(v, 1.35)`, then 1.4 times as far from its Rec. 709 luma: deeper and more saturated, as a finished photograph is.
//!
//! Limits: NaN and negative input is black, infinite input is as bright as 2^24 (`any_input_gives_a_screen_value`).
//! There is no dither: the same film gives the same bytes.

use std::str::FromStr;

use glam::{Mat3, Vec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::spectrum::color::srgb_encode;
use crate::{Error, Result};

/// Curve from scene light to the screen, by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ToneMap {
    /// No curve: the sRGB transfer function only; light above 1 clips.
    Linear,
    /// The film-like curve of the Academy (Hill's fit).
    Aces,
    /// Sobotka's AgX: bright saturated light turns towards white instead of clipping in its own colour.
    #[default]
    Agx,
    /// AgX with more contrast and saturation.
    AgxPunchy,
}

impl ToneMap {
    /// All curves.
    pub const ALL: [Self; 4] = [Self::Linear, Self::Aces, Self::Agx, Self::AgxPunchy];

    /// Name in files and flags.
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Aces => "aces",
            Self::Agx => "agx",
            Self::AgxPunchy => "agx_punchy",
        }
    }

    /// sRGB-encoded screen colour, each channel in [0, 1], of linear sRGB light.
    #[expect(clippy::manual_clamp, reason = "`max` and `min` turn NaN into 0; `clamp` keeps it")]
    pub fn encode(self, rgb: [f32; 3], exposure_ev: f32) -> [f32; 3] {
        let gain = exposure_ev.exp2();
        let light = Vec3::from(rgb.map(|v| {
            // `max` first: it turns NaN into 0, as zero times infinity is.
            (v.max(0.0) * gain).max(0.0).min(MOST_LIGHT)
        }));
        let screen = match self {
            Self::Linear => light,
            Self::Aces => aces(light),
            Self::Agx => agx(light, |v| v),
            Self::AgxPunchy => agx(light, punchy),
        };
        screen.to_array().map(|v| srgb_encode(v.clamp(0.0, 1.0)))
    }
}

impl FromStr for ToneMap {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|t| t.name() == name).ok_or_else(|| {
            Error::invalid("tone map", format!("`{name}` is not one of linear, aces, agx, agx_punchy"))
        })
    }
}

impl std::fmt::Display for ToneMap {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// Light is cut here so that squares stay finite; all curves are flat long before.
const MOST_LIGHT: f32 = 16_777_216.0;

fn aces(light: Vec3) -> Vec3 {
    // Rows of the published matrices are columns here: glam multiplies columns.
    const IN: Mat3 = Mat3::from_cols_array(&[
        0.597_19, 0.076, 0.028_4, 0.354_58, 0.908_34, 0.133_83, 0.048_23, 0.015_66, 0.837_77,
    ]);
    const OUT: Mat3 = Mat3::from_cols_array(&[
        1.604_75, -0.102_08, -0.003_27, -0.531_08, 1.108_13, -0.072_76, -0.073_67, -0.006_05, 1.076_02,
    ]);
    let v = IN * light;
    OUT * ((v * (v + 0.024_578_6) - 0.000_090_537) / (v * (0.983_729 * v + 0.432_951) + 0.238_081))
}

/// The look, on the sigmoid's output.
fn punchy(v: Vec3) -> Vec3 {
    const LUMA: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);
    let v = v.max(Vec3::ZERO).powf(1.35);
    let luma = v.dot(LUMA);
    luma + (v - luma) * 1.4
}

fn agx(light: Vec3, look: impl Fn(Vec3) -> Vec3) -> Vec3 {
    const INSET: Mat3 = Mat3::from_cols_array(&[
        0.842_479_06,
        0.042_328_242,
        0.042_375_654,
        0.078_433_6,
        0.878_468_64,
        0.078_433_6,
        0.079_223_745,
        0.079_166_13,
        0.879_143,
    ]);
    const OUTSET: Mat3 = Mat3::from_cols_array(&[
        1.196_879,
        -0.052_896_854,
        -0.052_971_635,
        -0.098_020_88,
        1.151_903_1,
        -0.098_043_45,
        -0.099_029_74,
        -0.098_961_18,
        1.151_073_7,
    ]);
    let v = (INSET * light).to_array().map(|v| agx_sigmoid(agx_log(v)));
    // The sigmoid's output drives a 2.2 power display; `encode` adds the transfer function of an sRGB file.
    (OUTSET * look(Vec3::from(v))).to_array().map(|v| v.max(0.0).powf(2.2)).into()
}

/// Stops from 10 below to 6.5 above middle grey, as 0 to 1.
fn agx_log(v: f32) -> f32 {
    (((v / 0.18).max(f32::MIN_POSITIVE).log2() + 10.0) / 16.5).clamp(0.0, 1.0)
}

/// `y = y_p + s h(m (x - x_p) / s)`, `h(t) = t / (1 + t^p)^(1/p)`: slope m at the pivot, and s such that the curve
/// ends in (0, 0) on the toe's side and in (1, 1) on the shoulder's.
fn agx_sigmoid(x: f32) -> f32 {
    const PIVOT: (f32, f32) = (10.0 / 16.5, 0.5);
    const SLOPE: f32 = 2.0;
    let (sign, width, height, power) =
        if x < PIVOT.0 { (-1.0, PIVOT.0, PIVOT.1, 3.0) } else { (1.0, 1.0 - PIVOT.0, 1.0 - PIVOT.1, 3.25) };
    let rise = SLOPE * width;
    let s = rise / ((rise / height).powf(power) - 1.0).powf(1.0 / power);
    let t = SLOPE * (x - PIVOT.0).abs() / s;
    PIVOT.1 + sign * s * t / (1.0 + t.powf(power)).powf(1.0 / power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_rises_from_black_to_white() {
        for tone_map in ToneMap::ALL {
            let grey = |v: f32| tone_map.encode([v; 3], 0.0);
            assert!(grey(0.0).iter().all(|&v| v < 1e-6), "{tone_map}: {:?}", grey(0.0));
            assert!(grey(1e6).iter().all(|&v| v > 0.98), "{tone_map}: {:?}", grey(1e6));
            let mut last = [0.0; 3];
            for i in 0..2000 {
                let now = grey((i as f32 * 0.02 - 20.0).exp2());
                for c in 0..3 {
                    assert!(now[c] >= last[c] - 1e-6, "{tone_map} at step {i}: {last:?} {now:?}");
                }
                last = now;
            }
        }
    }

    #[test]
    fn middle_grey_is_in_the_middle() {
        // 0.18 encodes to 0.461. The ACES reference shows it at a tenth of white (0.35); AgX half way up a 2.2
        // power display, 0.5^2.2 (0.504); the punchy look at 0.5^(1.35 * 2.2). Grey stays grey.
        for (tone_map, expected) in [
            (ToneMap::Linear, 0.461),
            (ToneMap::Aces, 0.355),
            (ToneMap::Agx, 0.504),
            (ToneMap::AgxPunchy, 0.395),
        ] {
            let [r, g, b] = tone_map.encode([0.18; 3], 0.0);
            assert!((g - expected).abs() < 0.01, "{tone_map}: {g}");
            assert!((r - g).abs() < 2e-3 && (b - g).abs() < 2e-3, "{tone_map}: {r} {g} {b}");
        }
    }

    #[test]
    fn exposure_is_in_stops() {
        for tone_map in ToneMap::ALL {
            assert_eq!(tone_map.encode([0.1, 0.2, 0.05], 2.0), tone_map.encode([0.4, 0.8, 0.2], 0.0));
        }
    }

    #[test]
    fn any_input_gives_a_screen_value() {
        let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 0.0, 1e-40, 0.5, 3e38];
        for tone_map in ToneMap::ALL {
            for r in odd {
                for g in odd {
                    for ev in [0.0, 200.0, -200.0, f32::NAN, f32::INFINITY] {
                        let out = tone_map.encode([r, g, 0.3], ev);
                        assert!(out.iter().all(|v| (0.0..=1.0).contains(v)), "{tone_map} {r} {g}: {out:?}");
                    }
                }
            }
            let black = tone_map.encode([f32::NAN, -3.0, f32::NEG_INFINITY], 0.0);
            assert!(black.iter().all(|&v| v < 1e-6), "{tone_map}: {black:?}");
        }
    }

    #[test]
    fn agx_sigmoid_matches_the_published_polynomial() {
        let mut square = 0.0;
        for i in 0..=1000 {
            let x = i as f32 / 1000.0;
            let polynomial = [15.5f32, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.002_32]
                .into_iter()
                .fold(0.0, |y, c| y * x + c);
            square += (agx_sigmoid(x) - polynomial).powi(2) / 1001.0;
        }
        // Root mean square 0.0027: 0.7 of a level of 8 bits. Wrensch states 0.0019 against his reference table.
        assert!(square < 8e-6, "{square:e}");
        assert!(agx_sigmoid(0.0).abs() < 1e-6 && (agx_sigmoid(1.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn names_round_trip() {
        for tone_map in ToneMap::ALL {
            assert_eq!(tone_map.name().parse::<ToneMap>().unwrap(), tone_map);
            assert_eq!(serde_json::to_value(tone_map).unwrap(), tone_map.name());
        }
        assert!("filmic".parse::<ToneMap>().is_err());
    }
}

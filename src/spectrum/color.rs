//! Colour spaces: XYZ, linear sRGB, the sRGB curve, CIE L*a*b*.
//!
//! Model: linear sRGB is the mixture of three primaries that gives XYZ, scaled so that D65 of Y = 1 is
//! (1, 1, 1): XYZ = P diag(P^-1 w) rgb, with P the XYZ of the primaries from their chromaticities and w of
//! D65. w is the integral of our own D65 and not the rounded (0.3127, 0.3290) of the standard (they differ
//! by 3e-5), so that a white surface in D65 is exactly neutral. For the CIE 1964 observer the same
//! primaries with its own w (our reading; the standard defines 2 degree only): D65 stays neutral.
//!
//! Curve: IEC 61966-2-1. L*a*b*: CIE 015:2018 section 8.2, f(t) = t^(1/3) above (6/29)^3 and its tangent
//! below. Guarded by `matrix_is_the_standard`, `white_is_neutral`, `agrees_with_colorimetry`.

use std::sync::OnceLock;

use glam::{DMat3, DVec3};

use super::illuminant::d65;
use super::observer::Observer;
use super::sampled::VISIBLE_NM;
use super::spectra::DENSE_SAMPLES;

/// Chromaticities (x, y) of the sRGB (Rec. 709) primaries red, green, blue; ITU-R BT.709-6.
pub const SRGB_PRIMARIES_XY: [(f64, f64); 3] = [(0.64, 0.33), (0.30, 0.60), (0.15, 0.06)];

impl Observer {
    /// XYZ of D65 with Y = 1 for the 2 degree observer.
    pub fn white(self) -> DVec3 {
        DVec3::from(self.xyz_of(d65()))
    }

    /// Matrix from linear sRGB to XYZ.
    pub fn xyz_from_srgb(self) -> DMat3 {
        self.matrices().0
    }

    /// Matrix from XYZ to linear sRGB.
    pub fn srgb_from_xyz(self) -> DMat3 {
        self.matrices().1
    }

    fn matrices(self) -> &'static (DMat3, DMat3) {
        static CIE_1931: OnceLock<(DMat3, DMat3)> = OnceLock::new();
        static CIE_1964: OnceLock<(DMat3, DMat3)> = OnceLock::new();
        let cell = match self {
            Observer::Cie1931 => &CIE_1931,
            Observer::Cie1964 => &CIE_1964,
        };
        cell.get_or_init(|| {
            let [r, g, b] = SRGB_PRIMARIES_XY.map(|(x, y)| DVec3::new(x / y, 1.0, (1.0 - x - y) / y));
            let primaries = DMat3::from_cols(r, g, b);
            let xyz_from_srgb = primaries * DMat3::from_diagonal(primaries.inverse() * self.white());
            (xyz_from_srgb, xyz_from_srgb.inverse())
        })
    }
}

/// Names of the channels, for errors.
pub(super) const CHANNELS: [&str; 3] = ["red", "green", "blue"];

/// Luminance Y of a linear sRGB colour.
pub fn luminance(rgb: [f32; 3]) -> f32 {
    let row = Observer::Cie1931.xyz_from_srgb().row(1);
    (row.x * f64::from(rgb[0]) + row.y * f64::from(rgb[1]) + row.z * f64::from(rgb[2])) as f32
}

/// The sRGB curve: linear light to the stored value, odd for negative light.
pub fn srgb_encode(linear: f32) -> f32 {
    let v = linear.abs();
    let e = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    e.copysign(linear)
}

/// The inverse of [`srgb_encode`].
pub fn srgb_decode(encoded: f32) -> f32 {
    let v = encoded.abs();
    let l = if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
    l.copysign(encoded)
}

/// CIE L*a*b* of a colour seen under `white` (both XYZ in the same scale).
pub fn lab(xyz: DVec3, white: DVec3) -> DVec3 {
    let f = (xyz / white).to_array().map(lab_f);
    DVec3::new(116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2]))
}

fn lab_f(t: f64) -> f64 {
    const D: f64 = 6.0 / 29.0;
    if t > D * D * D { t.cbrt() } else { t / (3.0 * D * D) + 4.0 / 29.0 }
}

/// Colour difference of CIE 1976: the distance in L*a*b*. About 2.3 is just noticeable.
pub fn delta_e_1976(lab_a: DVec3, lab_b: DVec3) -> f64 {
    (lab_a - lab_b).length()
}

/// Linear sRGB of a reflectance under D65, and L*a*b* of linear sRGB.
pub(super) struct D65Colour {
    rgb_weights: Box<[DVec3; DENSE_SAMPLES]>,
    xyz_from_srgb: DMat3,
    white: DVec3,
}

impl D65Colour {
    pub(super) fn get() -> &'static D65Colour {
        static COLOUR: OnceLock<D65Colour> = OnceLock::new();
        COLOUR.get_or_init(|| {
            let observer = Observer::Cie1931;
            let m = observer.srgb_from_xyz();
            let weights = observer.weights();
            let light = |i: usize| f64::from(d65().at(nm(i) as f32));
            D65Colour {
                rgb_weights: Box::new(std::array::from_fn(|i| m * DVec3::from(weights[i]) * light(i))),
                xyz_from_srgb: observer.xyz_from_srgb(),
                white: observer.white(),
            }
        })
    }

    /// Weight and wavelength of each nm.
    pub(super) fn iter(&self) -> impl Iterator<Item = (DVec3, f64)> {
        self.rgb_weights.iter().enumerate().map(|(i, w)| (*w, nm(i)))
    }

    pub(super) fn lab(&self, rgb: DVec3) -> DVec3 {
        lab(self.xyz_from_srgb * rgb, self.white)
    }
}

/// Wavelength of the sample `i` of a dense spectrum, nm.
pub(super) fn nm(i: usize) -> f64 {
    f64::from(VISIBLE_NM.0) + i as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::{Illuminant, Spectrum};

    #[test]
    fn matrix_is_the_standard() {
        // IEC 61966-2-1, four decimals.
        let standard = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];
        let m = Observer::Cie1931.srgb_from_xyz();
        for (i, row) in standard.iter().enumerate() {
            for (j, v) in row.iter().enumerate() {
                assert!((m.row(i)[j] - v).abs() < 1e-3, "{i} {j}: {} {v}", m.row(i)[j]);
            }
        }
        assert!((luminance([0.0, 1.0, 0.0]) - 0.7152).abs() < 2e-4);
        assert!((luminance([1.0, 1.0, 1.0]) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn white_is_neutral() {
        for observer in [Observer::Cie1931, Observer::Cie1964] {
            let rgb = observer.srgb_from_xyz() * observer.white();
            assert!((rgb - DVec3::ONE).length() < 1e-12, "{rgb}");
            assert!(
                delta_e_1976(lab(observer.white(), observer.white()), DVec3::new(100.0, 0.0, 0.0)) < 1e-9
            );
        }
    }

    #[test]
    fn curve_is_continuous_and_inverted() {
        for i in -100..=200 {
            let v = i as f32 / 100.0;
            assert!((srgb_decode(srgb_encode(v)) - v).abs() < 1e-5, "{v}");
        }
        assert!((srgb_encode(0.003_130_8) - srgb_encode(0.003_130_9)).abs() < 1e-5);
        assert!((srgb_encode(0.214_041) - 0.5).abs() < 1e-5);
    }

    #[test]
    fn agrees_with_colorimetry() {
        use colorimetry::observer::Observer as OtherEye;
        let curves: [fn(f64) -> f64; 4] = [
            |_| 0.18,
            |l| 1.0 / (1.0 + (-(l - 600.0) / 12.0).exp()),
            |l| 0.05 + 0.6 * (-((l - 520.0) / 40.0).powi(2)).exp(),
            |l| 0.9 - 0.001 * (l - 380.0),
        ];
        for (i, f) in curves.into_iter().enumerate() {
            let (wavelengths, values): (Vec<f64>, Vec<f64>) =
                (380..=780).map(f64::from).map(|l| (l, f(l))).unzip();
            let theirs = colorimetry::spectrum::Spectrum::linear_interpolate(&wavelengths, &values).unwrap();
            let theirs = colorimetry::colorant::Colorant::new(theirs).unwrap();
            for (eye, other) in
                [(Observer::Cie1931, OtherEye::Cie1931), (Observer::Cie1964, OtherEye::Cie1964)]
            {
                let light = Illuminant::D65.spectrum().unwrap();
                let lit = Spectrum::from_fn(f).zip(&light, |a, b| a * b);
                let ours = lab(DVec3::from(eye.xyz_of(&lit)), eye.white());
                let expected = DVec3::from(other.lab_d65(&theirs).to_array());
                assert!(delta_e_1976(ours, expected) < 0.02, "{i} {eye:?}: {ours} {expected}");
            }
        }
    }
}

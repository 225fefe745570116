//! Colour of an object from its reflectance or transmittance: CIE XYZ, L*a*b*, and a swatch in sRGB.
//!
//! Model: XYZ = 100 integral R S (x, y, z) dl / integral S y dl, S the illuminant, so that the perfect diffuser has Y = 100
//! (CIE 015:2018, section 7); L*a*b* relative to the illuminant's own white. The swatch is what an eye adapted to the
//! illuminant sees, shown on a screen whose white is D65: von Kries' scaling of XYZ in the Bradford cone space (as in ICC
//! profiles), then the sRGB matrix and curve; what sRGB cannot show is cut at 0 and 1 and said.
//!
//! Limits: spectra are known at bands only; between them they are linear, beyond them constant, so bands must reach from 420
//! to 680 nm with gaps of at most 40 nm, which hold 99 % of Y and of X + Z (`bands_must_cover_the_visible_range`). Guarded by
//! `white_is_white_in_any_light` and, against another implementation's L*a*b*, by `agrees_with_colorimetry`.

use glam::{DMat3, DVec3};
use serde::Serialize;

use super::color::{lab, srgb_encode};
use super::{Illuminant, Observer, Spectrum};
use crate::{Error, Result};

/// Bands must reach these, nm.
const REACH_NM: (f64, f64) = (420.0, 680.0);
/// Largest gap between bands, nm.
const MAX_GAP_NM: f64 = 40.0;

/// The colour of an object under a light.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ObjectColor {
    /// CIE XYZ; the perfect diffuser has Y = 100.
    pub xyz: [f64; 3],
    /// CIE L*a*b* relative to the illuminant's white.
    pub lab: [f64; 3],
    /// Swatch: `#rrggbb`.
    pub srgb_hex: String,
    /// Does sRGB hold the colour? If not, the swatch is the nearest by channel.
    pub in_srgb: bool,
}

impl ObjectColor {
    /// The colour of a reflectance or transmittance.
    pub fn new(share: &Spectrum, illuminant: Illuminant, observer: Observer) -> Result<Self> {
        let light = illuminant.spectrum()?;
        let white = DVec3::from(observer.xyz_of(&light));
        let xyz = DVec3::from(observer.xyz_of(&share.zip(&light, |a, b| a * b))) / white.y;
        let white = white / white.y;
        let rgb = observer.srgb_from_xyz() * (adaptation(white, observer.white()) * xyz);
        let within = |v: f64| (-1e-3..=1.001).contains(&v);
        let hex = rgb.to_array().map(|v| (srgb_encode(v.clamp(0.0, 1.0) as f32) * 255.0 + 0.5) as u8);
        Ok(Self {
            xyz: (xyz * 100.0).to_array(),
            lab: lab(xyz, white).to_array(),
            srgb_hex: format!("#{:02x}{:02x}{:02x}", hex[0], hex[1], hex[2]),
            in_srgb: rgb.to_array().into_iter().all(within),
        })
    }
}

/// Linear sRGB (a screen's, as swatches are) that each band adds per unit of its value: the colour of values v is
/// sum over b of v_b weight_b. All values one make white.
pub fn band_weights(bands_nm: &[f64], illuminant: Illuminant, observer: Observer) -> Result<Vec<DVec3>> {
    let light = illuminant.spectrum()?;
    let white = DVec3::from(observer.xyz_of(&light));
    let screen = observer.srgb_from_xyz() * adaptation(white / white.y, observer.white()) / white.y;
    (0..bands_nm.len())
        .map(|b| {
            // What is linear between bands is a sum of hats.
            let hat: Vec<_> = (0..).zip(bands_nm).map(|(i, &nm)| (nm, f64::from(u8::from(i == b)))).collect();
            let hat = spectrum_of_bands(&hat, "bands_nm")?;
            Ok(screen * DVec3::from(observer.xyz_of(&hat.zip(&light, |a, b| a * b))))
        })
        .collect()
}

/// Bands as a spectrum for colours: `(wavelength_nm, value)` in any order.
pub fn spectrum_of_bands(bands: &[(f64, f64)], at: &str) -> Result<Spectrum> {
    let mut points = bands.to_vec();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let ends = points.first().zip(points.last()).map(|(a, b)| (a.0, b.0));
    let reaches = ends.is_some_and(|(low, high)| low <= REACH_NM.0 && high >= REACH_NM.1);
    let inside = |p: &[(f64, f64)]| p[1].0 > REACH_NM.0 && p[0].0 < REACH_NM.1;
    let gap = points.windows(2).filter(|p| inside(p)).map(|p| p[1].0 - p[0].0).fold(0.0, f64::max);
    if !reaches || gap > MAX_GAP_NM {
        let what = format!(
            "no colour from these bands: they must reach from {} to {} nm with gaps of at most {MAX_GAP_NM} nm",
            REACH_NM.0, REACH_NM.1
        );
        return Err(Error::invalid(at, what));
    }
    Spectrum::from_table(&points, at)
}

/// Matrix from XYZ seen by an eye adapted to `from` to XYZ of the same look under `to`.
fn adaptation(from: DVec3, to: DVec3) -> DMat3 {
    // Bradford cone responses (Lam 1985; ICC.1:2010, annex E).
    let cones =
        DMat3::from_cols_array(&[0.8951, -0.7502, 0.0389, 0.2664, 1.7135, -0.0685, -0.1614, 0.0367, 1.0296]);
    cones.inverse() * DMat3::from_diagonal((cones * to) / (cones * from)) * cones
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::color::delta_e_1976;

    #[test]
    fn white_is_white_in_any_light() {
        for light in [Illuminant::D65, Illuminant::A, Illuminant::D50, Illuminant::Blackbody(3000.0)] {
            for observer in [Observer::Cie1931, Observer::Cie1964] {
                let c = ObjectColor::new(&Spectrum::Constant(1.0), light, observer).unwrap();
                assert!((c.xyz[1] - 100.0).abs() < 1e-9, "{light}: {c:?}");
                assert!(delta_e_1976(c.lab.into(), DVec3::new(100.0, 0.0, 0.0)) < 1e-6, "{c:?}");
                assert_eq!((c.srgb_hex.as_str(), c.in_srgb), ("#ffffff", true), "{light} {c:?}");
                let grey = ObjectColor::new(&Spectrum::Constant(0.214_041), light, observer).unwrap();
                assert!(["#7f7f7f", "#808080"].contains(&grey.srgb_hex.as_str()), "{grey:?}");
            }
        }
    }

    #[test]
    fn agrees_with_colorimetry() {
        use colorimetry::observer::Observer as OtherEye;
        let curve = |l: f64| 0.05 + 0.5 / (1.0 + (-(l - 600.0) / 12.0).exp());
        let (wavelengths, values): (Vec<f64>, Vec<f64>) =
            (380..=780).map(f64::from).map(|l| (l, curve(l))).unzip();
        let theirs = colorimetry::spectrum::Spectrum::linear_interpolate(&wavelengths, &values).unwrap();
        let theirs = colorimetry::colorant::Colorant::new(theirs).unwrap();
        let expected = DVec3::from(OtherEye::Cie1931.lab_d65(&theirs).to_array());
        // From bands of 10 nm as a goniophotometer has them, in any order.
        let mut bands: Vec<(f64, f64)> =
            (0..=40).map(|i| 380.0 + 10.0 * f64::from(i)).map(|l| (l, curve(l))).collect();
        bands.reverse();
        let share = spectrum_of_bands(&bands, "bands").unwrap();
        let ours = ObjectColor::new(&share, Illuminant::D65, Observer::Cie1931).unwrap();
        assert!(delta_e_1976(ours.lab.into(), expected) < 0.3, "{ours:?} {expected}");
        let nm: Vec<f64> = bands.iter().map(|p| p.0).collect();
        let weights = band_weights(&nm, Illuminant::A, Observer::Cie1931).unwrap();
        assert!((weights.iter().sum::<DVec3>() - DVec3::ONE).length() < 1e-5);
        let rgb: DVec3 = weights.iter().zip(&bands).map(|(w, p)| *w * p.1).sum();
        let hex = ObjectColor::new(&share, Illuminant::A, Observer::Cie1931).unwrap().srgb_hex;
        let red = (srgb_encode(rgb.x as f32) * 255.0 + 0.5) as u8;
        assert!(hex.starts_with(&format!("#{red:02x}")), "{hex} {rgb}");
        let saturated = Spectrum::from_fn(|l| if l > 620.0 { 1.0 } else { 0.0 });
        assert!(!ObjectColor::new(&saturated, Illuminant::D65, Observer::Cie1931).unwrap().in_srgb);
    }

    #[test]
    fn bands_must_cover_the_visible_range() {
        let some = |nm: &[f64]| spectrum_of_bands(&nm.iter().map(|&l| (l, 0.5)).collect::<Vec<_>>(), "bands");
        let every = |step: usize| (380..=780).step_by(step).map(|l| l as f64).collect::<Vec<_>>();
        assert!(some(&every(40)).is_ok() && some(&every(10)).is_ok());
        for bad in [vec![], vec![550.0], vec![450.0, 550.0, 650.0], every(50), vec![800.0, 900.0]] {
            let e = some(&bad).unwrap_err().to_string();
            assert!(e.starts_with("bands: no colour"), "{e}");
        }
        // The reach holds 99 % of white's X + Y + Z.
        let cut = Spectrum::from_fn(|l| f64::from(u8::from((REACH_NM.0..=REACH_NM.1).contains(&l))));
        let c = ObjectColor::new(&cut, Illuminant::D65, Observer::Cie1931).unwrap();
        let white = ObjectColor::new(&Spectrum::Constant(1.0), Illuminant::D65, Observer::Cie1931).unwrap();
        let share = c.xyz.iter().sum::<f64>() / white.xyz.iter().sum::<f64>();
        assert!((0.97..1.0).contains(&share), "{share}");
    }
}

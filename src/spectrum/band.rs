//! Bands of wavelengths: integrals of spectra over them in watts, in photons and in lumens.
//!
//! Model: the midpoint rule. A band is cut into equal cells of at most `step_nm`, and
//! `W = sum s(l) dl`, `Q = sum s(l) dl l / (N_A h c)` over their midpoints l.
//!
//! | symbol | here | unit | default |
//! |---|---|---|---|
//! | s | any spectral value, such as an irradiance | W m-2 nm-1 | none |
//! | l, dl | [`BandGrid::wavelengths_nm`], [`BandGrid::cells`] | nm | cells of 10 nm |
//! | W | [`BandGrid::power`] | W m-2 | |
//! | Q | [`BandGrid::photons`] | umol m-2 s-1 | |
//! | N_A, h, c | the exact constants of the SI | mol-1, J s, m/s | |
//!
//! Absolute light: a scene's `radiance` and `irradiance` are luminances relative to each other (see
//! [`super::illuminant`]). Read as W m-2 nm-1, an irradiance of 1 stands for [`lux_of_one`] = 683 lm/W x 106.86 nm =
//! 73.0 klx: the ground in full daylight.
//!
//! Limits: bands lie within 380-780 nm, where the spectra of scenes are known (`bands_outside_are_errors`); lines of
//! a lamp that are narrower than a cell are missed or counted for the whole cell. Guarded by
//! `photons_of_known_light`, `bands_add_up` and `one_is_full_daylight`.
//! Source: CODATA 2018 and the SI of 2019; photosynthetic photon flux: McCree 1972 (400-700 nm).

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use super::observer::Observer;
use super::sampled::VISIBLE_NM;
use crate::{Error, Result};

/// Planck's constant, J s.
const PLANCK_J_S: f64 = 6.626_070_15e-34;
/// Speed of light, m/s.
const LIGHT_M_PER_S: f64 = 299_792_458.0;
/// Avogadro's number, 1/mol.
const AVOGADRO_PER_MOL: f64 = 6.022_140_76e23;
/// Luminous efficacy that photometry is fixed by, lm/W.
pub const LUMENS_PER_WATT: f64 = 683.0;

/// Most wavelengths of all bands together.
pub const MAX_WAVELENGTHS: usize = 4096;

/// Photons per energy at a wavelength, umol/J.
pub fn photons_umol_per_j(wavelength_nm: f64) -> f64 {
    // nm and umol: 1e-9 * 1e6.
    wavelength_nm * 1e-3 / (AVOGADRO_PER_MOL * PLANCK_J_S * LIGHT_M_PER_S)
}

/// Illuminance, lx, for which an irradiance of 1 stands where spectral values are W m-2 nm-1.
pub fn lux_of_one() -> f64 {
    LUMENS_PER_WATT * Observer::Cie1931.y_integral_nm()
}

/// A range of wavelengths.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Band {
    /// Lower end, nm.
    pub low_nm: f64,
    /// Upper end, nm.
    pub high_nm: f64,
}

impl Band {
    /// Photosynthetically active radiation.
    pub const PAR: Self = Self { low_nm: 400.0, high_nm: 700.0 };
    /// All of the range of pictures.
    pub const VISIBLE: Self = Self { low_nm: VISIBLE_NM.0 as f64, high_nm: VISIBLE_NM.1 as f64 };

    /// The band; an error outside 380-780 nm.
    pub fn new(low_nm: f64, high_nm: f64) -> Result<Self> {
        let (low, high) = VISIBLE_NM;
        if !(f64::from(low) <= low_nm && low_nm < high_nm && high_nm <= f64::from(high)) {
            return Err(Error::invalid(
                format!("{low_nm}-{high_nm}"),
                format!("a band rises from LOW to HIGH nm within {low} to {high} nm"),
            ));
        }
        Ok(Self { low_nm, high_nm })
    }

    /// Width, nm.
    pub fn width_nm(&self) -> f64 {
        self.high_nm - self.low_nm
    }
}

impl fmt::Display for Band {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.low_nm, self.high_nm)
    }
}

impl FromStr for Band {
    type Err = Error;

    /// `400-700`.
    fn from_str(text: &str) -> Result<Self> {
        let ends = text.split_once('-').and_then(|(low, high)| {
            Some((low.trim().parse::<f64>().ok()?, high.trim().parse::<f64>().ok()?))
        });
        let Some((low_nm, high_nm)) = ends else {
            return Err(Error::invalid(text, "a band is LOW-HIGH in nm, such as 400-700"));
        };
        Self::new(low_nm, high_nm)
    }
}

/// Bands cut into cells; all bands share one list of wavelengths.
#[derive(Clone, Debug, PartialEq)]
pub struct BandGrid {
    bands: Vec<Band>,
    wavelengths_nm: Vec<f32>,
    /// Per band: index of the wavelength and width of its cell, nm.
    cells: Vec<Vec<(usize, f64)>>,
}

impl BandGrid {
    /// Cuts each band into equal cells of at most `step_nm`.
    pub fn new(bands: &[Band], step_nm: f64) -> Result<Self> {
        if bands.is_empty() {
            return Err(Error::invalid("bands", "at least one band is needed"));
        }
        if !(step_nm > 0.0 && step_nm.is_finite()) {
            return Err(Error::invalid("step_nm", format!("{step_nm} nm: expected a positive width")));
        }
        let counts: Vec<f64> =
            bands.iter().map(|b| (b.width_nm() / step_nm - 1e-9).ceil().max(1.0)).collect();
        let total: f64 = counts.iter().sum();
        if total > MAX_WAVELENGTHS as f64 {
            return Err(Error::invalid(
                "step_nm",
                format!("{step_nm} nm makes {total} wavelengths of all bands; at most {MAX_WAVELENGTHS}"),
            ));
        }
        let midpoints = |band: &Band, n: f64| {
            let (low, width) = (band.low_nm, band.width_nm() / n);
            (0..n as usize).map(move |i| ((low + (i as f64 + 0.5) * width) as f32, width))
        };
        let mut wavelengths_nm: Vec<f32> =
            bands.iter().zip(&counts).flat_map(|(b, &n)| midpoints(b, n)).map(|(l, _)| l).collect();
        wavelengths_nm.sort_by(f32::total_cmp);
        wavelengths_nm.dedup();
        let index = |l: f32| wavelengths_nm.partition_point(|&w| w < l);
        let cells = bands
            .iter()
            .zip(&counts)
            .map(|(b, &n)| midpoints(b, n).map(|(l, width)| (index(l), width)).collect())
            .collect();
        Ok(Self { bands: bands.to_vec(), wavelengths_nm, cells })
    }

    /// The same bands and cells, whose wavelengths are found in a longer list that rises.
    pub fn on(&self, wavelengths_nm: &[f32]) -> Result<Self> {
        let place = |l: &f32| {
            let at = wavelengths_nm.partition_point(|w| w < l);
            (wavelengths_nm.get(at) == Some(l)).then_some(at)
        };
        let places: Option<Vec<usize>> = self.wavelengths_nm.iter().map(place).collect();
        let places =
            places.ok_or_else(|| Error::invalid("wavelengths", "those of the bands are not among them"))?;
        let moved = |c: &Vec<(usize, f64)>| c.iter().map(|&(i, width)| (places[i], width)).collect();
        Ok(Self {
            bands: self.bands.clone(),
            wavelengths_nm: wavelengths_nm.to_vec(),
            cells: self.cells.iter().map(moved).collect(),
        })
    }

    /// The bands.
    pub fn bands(&self) -> &[Band] {
        &self.bands
    }

    /// The wavelengths of all bands, rising, each once, nm.
    pub fn wavelengths_nm(&self) -> &[f32] {
        &self.wavelengths_nm
    }

    /// Cells of a band: index into [`BandGrid::wavelengths_nm`], and width in nm.
    pub fn cells(&self, band: usize) -> &[(usize, f64)] {
        &self.cells[band]
    }

    /// Integral over a band of a spectrum, given by its values at [`BandGrid::wavelengths_nm`]: W m-2 from W m-2 nm-1.
    pub fn power(&self, band: usize, value: impl Fn(usize) -> f64) -> f64 {
        self.cells[band].iter().map(|&(i, width)| value(i) * width).sum()
    }

    /// Photons in a band: umol m-2 s-1 from W m-2 nm-1.
    pub fn photons(&self, band: usize, value: impl Fn(usize) -> f64) -> f64 {
        let per_joule = |i: usize| photons_umol_per_j(f64::from(self.wavelengths_nm[i]));
        self.cells[band].iter().map(|&(i, width)| value(i) * width * per_joule(i)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::Illuminant;

    #[test]
    fn photons_of_known_light() {
        // 1 W at 550 nm is 4.5976 umol/s (N_A h c = 0.119626566 J m/mol).
        assert!((photons_umol_per_j(550.0) - 4.597_641).abs() < 1e-5, "{}", photons_umol_per_j(550.0));
        // Equal energy over 400-700 nm: the mean wavelength counts, 550 nm.
        let grid = BandGrid::new(&[Band::PAR], 10.0).unwrap();
        let one = |_| 1.0;
        assert!((grid.power(0, one) - 300.0).abs() < 1e-9);
        assert!((grid.photons(0, one) / 300.0 - photons_umol_per_j(550.0)).abs() < 1e-9);
        // Daylight: about 4.6 umol/J in the literature (4.57, McCree 1972).
        let d65 = Illuminant::D65.spectrum().unwrap();
        let value = |i: usize| f64::from(d65.at(grid.wavelengths_nm()[i]));
        let ratio = grid.photons(0, value) / grid.power(0, value);
        assert!((ratio - 4.57).abs() < 0.05, "{ratio}");
    }

    #[test]
    fn bands_add_up() {
        let bands: Vec<Band> = ["400-700", "400-500", "500-600", "600-700", "655-671.5"]
            .iter()
            .map(|b| b.parse().unwrap())
            .collect();
        let grid = BandGrid::new(&bands, 10.0).unwrap();
        // The thirds share the midpoints of the whole.
        assert_eq!(grid.wavelengths_nm().len(), 30 + 2);
        assert!(grid.wavelengths_nm().is_sorted_by(|a, b| a < b));
        let value = |i: usize| f64::from(grid.wavelengths_nm()[i]).powi(2);
        let thirds: f64 = (1..4).map(|b| grid.power(b, value)).sum();
        assert!((grid.power(0, value) / thirds - 1.0).abs() < 1e-12);
        // The midpoint rule of a parabola errs by width^3 f'' / 24 per cell.
        let exact = (700f64.powi(3) - 400f64.powi(3)) / 3.0;
        assert!((grid.power(0, value) / exact - 1.0).abs() < 1e-4);
        assert_eq!(grid.cells(4).len(), 2);
        assert!((grid.power(4, |_| 1.0) - 16.5).abs() < 1e-9);
        let second = BandGrid::new(&bands[1..2], 10.0).unwrap().on(grid.wavelengths_nm()).unwrap();
        assert_eq!(second.power(0, value), grid.power(1, value));
        assert!(grid.on(second.wavelengths_nm()).is_ok() && grid.on(&[405.0]).is_err());
        assert_eq!(BandGrid::new(&bands[..1], 1e4).unwrap().wavelengths_nm(), [550.0]);
    }

    #[test]
    fn one_is_full_daylight() {
        assert!((lux_of_one() / 683.0 - 106.86).abs() < 0.01, "{}", lux_of_one());
        // Y = 1 of the illuminants means that illuminance, whatever their spectrum is.
        for illuminant in [Illuminant::D65, Illuminant::A] {
            let spectrum = illuminant.spectrum().unwrap();
            let grid = BandGrid::new(&[Band::VISIBLE], 1.0).unwrap();
            let lumens = |i: usize| {
                let l = grid.wavelengths_nm()[i];
                LUMENS_PER_WATT * Observer::Cie1931.cmf(l)[1] * f64::from(spectrum.at(l))
            };
            assert!((grid.power(0, lumens) / lux_of_one() - 1.0).abs() < 1e-4);
        }
    }

    #[test]
    fn bands_outside_are_errors() {
        for text in
            ["", "400", "700-400", "400-400", "300-700", "400-800", "nan-700", "400-inf", "a-b", "-400-700"]
        {
            assert!(text.parse::<Band>().is_err(), "{text}");
        }
        let far = "300-700".parse::<Band>().unwrap_err().to_string();
        assert!(far.contains("300-700") && far.contains("380 to 780"), "{far}");
        assert_eq!("380-780".parse::<Band>().unwrap(), Band::VISIBLE);
        for step in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-3] {
            assert!(BandGrid::new(&[Band::PAR], step).is_err(), "{step}");
        }
        assert!(BandGrid::new(&[], 10.0).is_err());
    }
}

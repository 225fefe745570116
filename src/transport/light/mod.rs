//! What plant scientists ask of a radiosity solution: light per organ, balances, sensors, maps, baked colours.
//!
//! [`Readout`] reads a [`Radiosity`] in bands, in W m-2 and in umol photons m-2 s-1 ([`crate::spectrum::band`]). Values
//! are those of the solution; nothing is fitted or smoothed afterwards.
//!
//! Absolute light: spectral values of lights are W m-2 nm-1 times `unit_lx / lux_of_one()`, so that an irradiance of 1 in
//! a scene stands for `unit_lx` lx. Guarded by `units_scale_light`.

pub mod balance;
pub mod bake;
pub mod sensor;
mod surface;
pub mod table;
pub mod view;

#[cfg(test)]
mod tests;

pub use balance::Balance;
pub use table::Per;

use crate::flower::OrganKind;
use crate::geometry::Side;
use crate::scene::{Scene, Shape};
use crate::spectrum::band::{lux_of_one, photons_umol_per_j};
use crate::spectrum::{Band, BandGrid, LANES, SampledWavelengths};
use crate::transport::radiosity::Radiosity;
use crate::{Error, Result};

/// Both sides, in the order of tables.
const SIDES: [Side; 2] = [Side::Adaxial, Side::Abaxial];

/// A solution, read in bands.
pub struct Readout<'a> {
    scene: &'a Scene,
    radiosity: &'a Radiosity,
    bands: Vec<Band>,
    /// Per band: wavelength, and what its value counts in W m-2 and in umol m-2 s-1.
    weights: Vec<Vec<(usize, [f64; 2])>>,
}

impl<'a> Readout<'a> {
    /// Reads `radiosity`, which was solved at least at the wavelengths of `bands`. An irradiance of 1 stands for
    /// `unit_lx` lx.
    pub fn new(scene: &'a Scene, radiosity: &'a Radiosity, bands: &BandGrid, unit_lx: f64) -> Result<Self> {
        if !(unit_lx > 0.0 && unit_lx.is_finite()) {
            return Err(Error::invalid("unit_lx", format!("{unit_lx} lx: expected a positive number")));
        }
        let grid = bands.on(radiosity.wavelengths_nm())?;
        let unit = unit_lx / lux_of_one();
        let weight = |&(i, width): &(usize, f64)| {
            let power = unit * width;
            (i, [power, power * photons_umol_per_j(f64::from(grid.wavelengths_nm()[i]))])
        };
        let weights = (0..grid.bands().len()).map(|b| grid.cells(b).iter().map(weight).collect()).collect();
        Ok(Self { scene, radiosity, bands: grid.bands().to_vec(), weights })
    }

    /// The bands.
    pub fn bands(&self) -> &[Band] {
        &self.bands
    }

    /// W m-2 and umol m-2 s-1 in a band, of spectral values at all wavelengths of the solution.
    fn flux(&self, band: usize, value: impl Fn(usize) -> f64) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for &(i, weight) in &self.weights[band] {
            let v = value(i);
            sum[0] += v * weight[0];
            sum[1] += v * weight[1];
        }
        sum
    }
}

/// Name of a kind of organ.
pub fn organ_name(kind: OrganKind) -> &'static str {
    match kind {
        OrganKind::Petal => "petal",
        OrganKind::Sepal => "sepal",
        OrganKind::Receptacle => "receptacle",
        OrganKind::Stem => "stem",
        OrganKind::Leaf => "leaf",
        OrganKind::Prickle => "prickle",
        OrganKind::Filament => "filament",
        OrganKind::Anther => "anther",
        OrganKind::Style => "style",
    }
}

/// Organ of a shape, empty where it is none.
fn organ_of(shape: &Shape) -> &'static str {
    shape.organ.map_or("", organ_name)
}

/// Wavelengths in lanes; the last ones are filled up.
fn lanes(wavelengths_nm: &[f32]) -> Vec<SampledWavelengths> {
    let of = |c: &[f32]| SampledWavelengths::given(std::array::from_fn(|l| c[l.min(c.len() - 1)]));
    wavelengths_nm.chunks(LANES).map(of).collect()
}

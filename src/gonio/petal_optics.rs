//! What a petal does with light, for all wavelengths and all amounts of pigment at once.
//!
//! Model: the BSDF of a petal whose azimuth nobody knows (mean over all), as light that never entered it (surface) plus
//! light that did (interior), the latter in K classes of like walks:
//!
//! ```text
//! f(wi, wo; mu) = s(wi, wo) + sum over k of i_k(wi, wo) exp(-sum over regions r of mu_r l_kr)
//! ```
//!
//! `s`, `i_k` (1/sr) are tables over (theta_i, theta_o, phi); `l_k` (um), the classes' codebook, are the mean ways of their
//! walks through the regions. Both are found by a white Monte Carlo measurement.
//!
//! **Tables.** [`AngleGrid`] divides 0-90 deg from the normal of a direction's own side into equal bins, and the angle
//! between the two azimuths, 0-180 deg (0: wo on the lamp's side), too. A value belongs to the bins' centres; between
//! centres it is linear in each angle, beyond the outermost it is constant. Three parts: both directions adaxial, both
//! abaxial, one on each side (the first index is then the adaxial direction's).
//!
//! Reciprocal: reflection parts are symmetric in their two polar angles, and transmission is one table for both ways.
//! Energy: for each polar angle at a bin's centre the integral of the interpolated white f times cos over both sides equals
//! the measured share of the walks that left, at most one; between centres it is between its neighbours'.

use super::Estimate;
use crate::geometry::Side;
use crate::micro::REGIONS;

/// Parts of an [`AngularTable`].
pub const PARTS: usize = 3;

/// Which of the parts two directions belong to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Both directions on the adaxial side.
    Adaxial = 0,
    /// Both on the abaxial side.
    Abaxial = 1,
    /// One on each: the first polar angle is the adaxial direction's.
    Through = 2,
}

/// Bins of the angles of two directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AngleGrid {
    /// Bins of each polar angle over 0-90 deg.
    pub thetas: usize,
    /// Bins of the angle between the azimuths over 0-180 deg.
    pub phis: usize,
}

impl AngleGrid {
    /// Bins of one part.
    pub fn len(&self) -> usize {
        self.thetas * self.thetas * self.phis
    }

    /// Has it no bins?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Values over the angles of two directions: `values[((part * thetas + a) * thetas + b) * phis + p) * classes + k]`.
#[derive(Clone, Debug, PartialEq)]
pub struct AngularTable {
    /// Bins.
    pub grid: AngleGrid,
    /// Values per bin.
    pub classes: usize,
    /// All values, 1/sr.
    pub values: Vec<f32>,
}

impl AngularTable {
    /// A table of zeros.
    pub fn zeros(grid: AngleGrid, classes: usize) -> Self {
        Self { grid, classes, values: vec![0.0; PARTS * grid.len() * classes] }
    }

    /// The values of one bin, one per class.
    pub fn bin(&self, part: Part, a: usize, b: usize, phi: usize) -> &[f32] {
        let AngleGrid { thetas, phis } = self.grid;
        let first = (((part as usize * thetas + a) * thetas + b) * phis + phi) * self.classes;
        &self.values[first..first + self.classes]
    }
}

/// White shares of the light of one incidence that leave on either side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WhiteTotals {
    /// The lit side.
    pub side: Side,
    /// Angle of the lamp from the normal of the lit side, degrees: a bin's centre of the surface's grid; the walks of a bin
    /// come from all its angles.
    pub incident_deg: f64,
    /// Share that the surface sends back.
    pub surface: Estimate,
    /// Share that comes back from within.
    pub interior: Estimate,
    /// Share that leaves on the other side.
    pub transmitted: Estimate,
}

/// The measured petal.
#[derive(Clone, Debug, PartialEq)]
pub struct PetalOptics {
    /// Name of the sample.
    pub sample: String,
    /// The petal file (TOML) that was measured.
    pub description: String,
    /// Version of the program that measured.
    pub version: String,
    /// Walks per side.
    pub walks: u64,
    /// Seed of the walks.
    pub seed: u64,
    /// Walks that were cut off.
    pub cut_off: u64,
    /// Largest relative change that making the tables reciprocal made to a directional total.
    pub asymmetry: f64,
    /// Largest error that the classes make in a directional-hemispherical total, over the amounts it was checked at.
    pub class_error: f64,
    /// l_kr, um.
    pub paths_um: Vec<[f32; REGIONS]>,
    /// s.
    pub surface: AngularTable,
    /// i_k.
    pub interior: AngularTable,
    /// White totals: adaxial side first, each in increasing angle, one per bin of the surface's grid.
    pub totals: Vec<WhiteTotals>,
}

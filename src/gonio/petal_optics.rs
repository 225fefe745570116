//! What a petal does with light, for all wavelengths and all amounts of pigment at once.
//!
//! Model: the BSDF of a petal whose azimuth nobody knows (mean over all), as light that never entered it (surface) plus
//! light that did (interior), the latter in K classes of like walks:
//!
//! ```text
//! f(wi, wo; mu) = s(wi, wo) + sum over k of i_k(wi, wo) e_k(mu)
//! e_k(mu) = product over regions r of (1 + mu_r v_kr / l_kr)^(-l_kr^2 / v_kr)      (exp(-mu_r l_kr) where v_kr = 0)
//! ```
//!
//! `s`, `i_k` (1/sr) are tables over (theta_i, theta_o, phi); `l_k` (um) and `v_k` (um2), the classes' codebook, are the mean and
//! the variance of the ways of their walks through the regions; `e_k`, the share that the pigments leave
//! ([`PetalOptics::remaining`]), takes the ways of a class as gamma distributed: right to second order in mu, and between 0 and 1
//! however large mu is. All are found by a white Monte Carlo measurement.
//!
//! **Tables.** [`AngleGrid`] divides 0-90 deg from the normal of a direction's own side into equal bins, and the angle
//! between the two azimuths, 0-180 deg (0: wo on the lamp's side), too. A value belongs to the bins' centres; between
//! centres it is linear in each angle, beyond the outermost it is constant. Three parts: both directions adaxial, both
//! abaxial, one on each side (the first index is then the adaxial direction's).
//!
//! Reciprocal: reflection parts are symmetric in their two polar angles, and transmission is one table for both ways.
//! Energy: for each polar angle at a bin's centre the integral of the interpolated white f times cos over both sides equals
//! the measured share of the walks that left, at most one; between centres it is between its neighbours'.

use serde::{Deserialize, Serialize};

use super::Estimate;
use crate::geometry::Side;
use crate::micro::REGIONS;
use crate::{Error, Result};

/// Most bins of a polar angle, of an angle between azimuths, and most classes.
pub const MAX_BINS: [usize; 3] = [90, 180, 128];
/// Light that a lamp may seem to gain: rounding.
const GAIN: f64 = 1e-5;

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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
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

    /// Number of values of such a table; an error where it would be empty or absurdly fine.
    pub fn values_of(grid: &AngleGrid, classes: usize) -> Result<usize> {
        let wanted = [("thetas", grid.thetas), ("phis", grid.phis), ("classes", classes)];
        for ((key, count), most) in wanted.into_iter().zip(MAX_BINS) {
            if !(1..=most).contains(&count) {
                return Err(Error::invalid(key, format!("{count} is not within 1 to {most}")));
            }
        }
        Ok(PARTS * grid.len() * classes)
    }

    /// Checks size, sign and reciprocity.
    fn validate(&self, at: &str) -> Result<()> {
        let wrong = |what: String| Err(Error::invalid(at, what));
        let count =
            Self::values_of(&self.grid, self.classes).map_err(|e| Error::invalid(at, e.to_string()))?;
        if self.values.len() != count {
            return wrong(format!("{} values, not {count}", self.values.len()));
        }
        if !self.values.iter().all(|v| v.is_finite() && *v >= 0.0) {
            return wrong("a value is negative or not finite".into());
        }
        let AngleGrid { thetas, phis } = self.grid;
        for part in [Part::Adaxial, Part::Abaxial] {
            for a in 0..thetas {
                for b in 0..a {
                    if (0..phis).any(|p| self.bin(part, a, b, p) != self.bin(part, b, a, p)) {
                        return wrong(format!("{part:?}: polar bins {a} and {b} are not reciprocal"));
                    }
                }
            }
        }
        Ok(())
    }

    /// The values of one bin, one per class.
    pub fn bin(&self, part: Part, a: usize, b: usize, phi: usize) -> &[f32] {
        let AngleGrid { thetas, phis } = self.grid;
        let first = (((part as usize * thetas + a) * thetas + b) * phis + phi) * self.classes;
        &self.values[first..first + self.classes]
    }
}

/// White shares of the light of one incidence that leave on either side.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
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
    /// Standard deviation of the ways of a class: the square root of v_kr, um.
    pub spreads_um: Vec<[f32; REGIONS]>,
    /// s.
    pub surface: AngularTable,
    /// i_k.
    pub interior: AngularTable,
    /// White totals: adaxial side first, each in increasing angle, one per bin of the surface's grid.
    pub totals: Vec<WhiteTotals>,
}

impl PetalOptics {
    /// Checks that the parts fit together and that light is neither negative nor made. Errors begin with `at`.
    pub fn validate(&self, at: &str) -> Result<()> {
        let wrong = |key: &str, what: &str| Err(Error::invalid(format!("{at}: {key}"), what));
        self.surface.validate(&format!("{at}: surface"))?;
        self.interior.validate(&format!("{at}: interior"))?;
        let classes = self.interior.classes;
        if self.surface.classes != 1 || self.paths_um.len() != classes || self.spreads_um.len() != classes {
            return wrong("classes", "the tables and the ways have different numbers of them");
        }
        for (key, codes) in [("paths_um", &self.paths_um), ("spreads_um", &self.spreads_um)] {
            if !codes.as_flattened().iter().all(|l| l.is_finite() && *l >= 0.0) {
                return wrong(key, "a way is negative or not finite");
            }
        }
        let estimates = self.totals.iter().flat_map(|t| [t.surface, t.interior, t.transmitted]);
        let errors = [self.asymmetry, self.class_error].into_iter();
        let numbers = estimates.flat_map(<[f64; 2]>::from).chain(errors);
        if self.totals.len() != 2 * self.surface.grid.thetas
            || !numbers.into_iter().all(|v| v.is_finite() && v >= 0.0)
        {
            return wrong("totals", "one of each polar bin and side, and no negative number");
        }
        for grid in [self.surface.grid, self.interior.grid] {
            for (side, i) in (0..grid.thetas).flat_map(|i| [(Side::Adaxial, i), (Side::Abaxial, i)]) {
                let incident_deg = grid.theta_deg(i);
                let (r, t) = self.reflectance(side, incident_deg, &[0.0; REGIONS]);
                if r + t > 1.0 + GAIN {
                    let what =
                        format!("{:.5} of the light from {incident_deg} deg: more light than came", r + t);
                    return wrong(if side == Side::Adaxial { "adaxial" } else { "abaxial" }, &what);
                }
            }
        }
        Ok(())
    }
}

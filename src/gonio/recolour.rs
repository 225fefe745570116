//! The colour of a measured petal: absorption applied to what was measured without.
//!
//! Model: share of the light from an angle that leaves on one side, for the absorption coefficients mu of the regions
//!
//! ```text
//! R(mu) = S + sum over k of I_k e_k(mu)
//! ```
//!
//! S, I_k the integrals over a hemisphere of the tables of [`PetalOptics`], exact for the values between their nodes
//! ([`super::angular`]) and linear between the lamp's nodes. They are found once; a wavelength then costs K exponentials.
//!
//! Guarded by `recoloured_as_walked`. Source: Beer-Lambert.

use super::{AngularTable, Part, PetalOptics};
use crate::geometry::Side;
use crate::micro::REGIONS;

/// The light of one incidence on its ways out, before absorption.
#[derive(Clone, Debug, PartialEq)]
pub struct LampShares {
    /// Share that never entered and leaves on the lit and on the other side.
    pub surface: [f64; 2],
    /// The same for each class of walks.
    pub interior: Vec<[f64; 2]>,
}

impl LampShares {
    /// Reflectance and transmittance when the pigments leave these shares of the classes ([`PetalOptics::remaining`]).
    pub fn at(&self, remaining: &[f64]) -> (f64, f64) {
        let [mut r, mut t] = self.surface;
        for (share, left) in self.interior.iter().zip(remaining) {
            r += share[0] * left;
            t += share[1] * left;
        }
        (r, t)
    }
}

/// Mean of `exp(-mu l)` over gamma distributed ways of a mean and a standard deviation, as its logarithm.
#[inline]
fn log_remaining(mu: f64, mean: f64, spread: f64) -> f64 {
    // Narrow ways are all alike; the other form would divide by zero.
    if spread <= 1e-4 * mean {
        return -mu * mean;
    }
    let variance = spread * spread;
    -mean * mean / variance * (mu * variance / mean).ln_1p()
}

/// Share that absorption leaves of the walks of a class.
pub(super) fn class_remaining(
    path_um: &[f32; REGIONS],
    spread_um: &[f32; REGIONS],
    absorption_per_um: &[f64; REGIONS],
) -> f64 {
    (0..REGIONS)
        .filter(|r| path_um[*r] > 0.0 && absorption_per_um[*r] > 0.0)
        .map(|r| log_remaining(absorption_per_um[r], f64::from(path_um[r]), f64::from(spread_um[r])))
        .sum::<f64>()
        .exp()
}

impl PetalOptics {
    /// e_k: the share that absorption coefficients, 1/um, leave of the light of each class.
    pub fn remaining(&self, absorption_per_um: &[f64; REGIONS]) -> Vec<f64> {
        let classes = self.paths_um.iter().zip(&self.spreads_um);
        classes.map(|(path, spread)| class_remaining(path, spread, absorption_per_um)).collect()
    }

    /// Shares of the light that arrives at an angle from the normal of the lit side, degrees (held within 0 to 90).
    pub fn lamp_shares(&self, side: Side, incident_deg: f64) -> LampShares {
        let surface = shares(&self.surface, side, incident_deg);
        LampShares {
            surface: surface.first().copied().unwrap_or_default(),
            interior: shares(&self.interior, side, incident_deg),
        }
    }

    /// Reflectance and transmittance of one incidence for absorption coefficients, 1/um.
    pub fn reflectance(
        &self,
        side: Side,
        incident_deg: f64,
        absorption_per_um: &[f64; REGIONS],
    ) -> (f64, f64) {
        self.lamp_shares(side, incident_deg).at(&self.remaining(absorption_per_um))
    }

    /// The same for a whole spectrum.
    pub fn recolour(
        &self,
        side: Side,
        incident_deg: f64,
        absorption_per_um: &[[f64; REGIONS]],
    ) -> Vec<(f64, f64)> {
        let shares = self.lamp_shares(side, incident_deg);
        absorption_per_um.iter().map(|mu| shares.at(&self.remaining(mu))).collect()
    }

    /// Light from within for absorption coefficients, 1/um: the interior table with its classes put together.
    pub fn interior_at(&self, absorption_per_um: &[f64; REGIONS]) -> AngularTable {
        let left: Vec<f32> = self.remaining(absorption_per_um).iter().map(|e| *e as f32).collect();
        let sum = |classes: &[f32]| classes.iter().zip(&left).map(|(v, e)| v * e).sum();
        let values = self.interior.values.chunks_exact(left.len().max(1)).map(sum).collect();
        AngularTable { grid: self.interior.grid, classes: 1, values }
    }
}

/// Integrals over the lit and the other side, per class.
fn shares(table: &AngularTable, side: Side, incident_deg: f64) -> Vec<[f64; 2]> {
    let adaxial = side == Side::Adaxial;
    let own = if adaxial { Part::Adaxial } else { Part::Abaxial };
    let theta = incident_deg.clamp(0.0, 90.0).to_radians() as f32;
    let mut shares = vec![[0.0; 2]; table.classes];
    for (node, weight) in table.grid.theta_nodes(theta).both() {
        let ways = [table.projected(own, node, true), table.projected(Part::Through, node, adaxial)];
        for (way, sums) in ways.iter().enumerate() {
            for (share, sum) in shares.iter_mut().zip(sums) {
                share[way] += f64::from(weight) * sum;
            }
        }
    }
    shares
}

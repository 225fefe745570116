//! The nodes of the table over pairs of directions, and the interpolation between them.
//!
//! Model: an isotropic, reciprocal function of two directions depends on the larger and the smaller angle from the
//! normal and on the difference of the azimuths, folded to 0 to 180 degrees. Three numbers t in \[0, 1\] stand for
//! them, and the nodes are equally spaced in each t:
//!
//! ```text
//! theta_max = 89 deg (1.6 t - 0.6 t^2)         denser towards grazing
//! theta_min / theta_max = t (2 - t)            denser where the two are equal
//! dphi = 90 deg (1 - cos(pi t))                denser towards the lamp's and the mirror's side
//! ```
//!
//! Retro-reflection is a cusp on the line theta_min = theta_max, dphi = 0: in these t its sides are parabolas, which a
//! cubic follows. Between nodes: Lagrange's cubic through the four nearest in each t.
//!
//! Limits: beyond 89 deg the value at 89 deg. Guarded by `nodes_are_found_again` and `cubics_are_exact`.
//! Source: our reading.

use std::f64::consts::PI;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::{Error, Result};

/// The largest angle from the normal, degrees.
pub const MAX_THETA_DEG: f64 = 89.0;

/// How many nodes each of the three has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AngleNodes {
    /// Of the larger angle from the normal, 4 to 64.
    pub thetas: usize,
    /// Of the ratio of the smaller to the larger one, 4 to 64.
    pub ratios: usize,
    /// Of the difference of the azimuths, 4 to 64.
    pub azimuths: usize,
}

/// Nodes around a pair of directions with their weights, which sum to one.
pub(super) struct Stencil {
    /// `(index of the pair, weight)`.
    pub(super) nodes: [(usize, f64); 64],
    /// Cosine of the larger angle, interpolated like everything else: a quotient by it is exact for a constant.
    pub(super) cos_max: f64,
}

impl AngleNodes {
    /// Checks the counts; errors name `at.thetas` and so on.
    pub fn validate(&self, at: &str) -> Result<()> {
        for (key, n) in [("thetas", self.thetas), ("ratios", self.ratios), ("azimuths", self.azimuths)] {
            if !(4..=64).contains(&n) {
                return Err(Error::invalid(format!("{at}.{key}"), format!("{n} is not within 4 to 64")));
            }
        }
        Ok(())
    }

    /// Pairs of directions.
    pub fn pairs(&self) -> usize {
        self.thetas * self.lights()
    }

    /// Pairs with one larger angle.
    pub(super) fn lights(&self) -> usize {
        self.ratios * self.azimuths
    }

    /// Angle of node `k` of the larger angle, radians; `k` need not be whole.
    pub(super) fn theta(&self, k: f64) -> f64 {
        let t = k / (self.thetas - 1) as f64;
        (MAX_THETA_DEG * t * (1.6 - 0.6 * t)).to_radians()
    }

    /// Ratio of node `k`.
    pub(super) fn ratio(&self, k: f64) -> f64 {
        let t = k / (self.ratios - 1) as f64;
        t * (2.0 - t)
    }

    /// Difference of the azimuths of node `k`, radians.
    pub(super) fn azimuth(&self, k: f64) -> f64 {
        0.5 * PI * (1.0 - (PI * k / (self.azimuths - 1) as f64).cos())
    }

    /// The nodes around a pair of directions above the surface. The same bits for `(a, b)` and `(b, a)`.
    pub(super) fn stencil(&self, a: DVec3, b: DVec3) -> Stencil {
        let theta = |w: DVec3| w.x.hypot(w.y).atan2(w.z).min(MAX_THETA_DEG.to_radians());
        let (ta, tb) = (theta(a), theta(b));
        let (max, min) = (ta.max(tb), ta.min(tb));
        let share = max.to_degrees() / MAX_THETA_DEG;
        let t_theta = (1.6 - (2.56 - 2.4 * share).max(0.0).sqrt()) / 1.2;
        let ratio = if max > 0.0 { min / max } else { 1.0 };
        let t_ratio = 1.0 - (1.0 - ratio).max(0.0).sqrt();
        let cross = (a.x * b.y - a.y * b.x).abs();
        let dphi = cross.atan2(a.x * b.x + a.y * b.y);
        let t_phi = (1.0 - 2.0 * dphi / PI).clamp(-1.0, 1.0).acos() / PI;
        let (i0, wi) = cubic(t_theta, self.thetas);
        let (j0, wj) = cubic(t_ratio, self.ratios);
        let (k0, wk) = cubic(t_phi, self.azimuths);
        let nodes = std::array::from_fn(|n| {
            let (i, j, k) = (n / 16, n / 4 % 4, n % 4);
            (self.index(i0 + i, j0 + j, k0 + k), wi[i] * wj[j] * wk[k])
        });
        let cos_max = (0..4).map(|i| wi[i] * self.theta((i0 + i) as f64).cos()).sum();
        Stencil { nodes, cos_max }
    }

    fn index(&self, theta: usize, ratio: usize, azimuth: usize) -> usize {
        (theta * self.azimuths + azimuth) * self.ratios + ratio
    }
}

/// First of four nodes around t in \[0, 1\] and Lagrange's weights.
fn cubic(t: f64, n: usize) -> (usize, [f64; 4]) {
    let x = t.clamp(0.0, 1.0) * (n - 1) as f64;
    let first = (x.floor() as usize).saturating_sub(1).min(n - 4);
    let x = x - first as f64;
    let (a, b, c, d) = (x, x - 1.0, x - 2.0, x - 3.0);
    (first, [-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::measurement::direction_deg;

    fn at(nodes: &AngleNodes, i: f64, j: f64, k: f64) -> (DVec3, DVec3) {
        let theta = nodes.theta(i).to_degrees();
        let b = direction_deg(theta * nodes.ratio(j), 77.0 + nodes.azimuth(k).to_degrees());
        (direction_deg(theta, 77.0), b)
    }

    #[test]
    fn nodes_are_found_again() {
        let nodes = AngleNodes { thetas: 7, ratios: 5, azimuths: 6 };
        for i in 1..7 {
            for j in 1..5 {
                for k in 0..6 {
                    let (a, b) = at(&nodes, f64::from(i), f64::from(j), f64::from(k));
                    let s = nodes.stencil(a, b);
                    let index = nodes.index(i as usize, j as usize, k as usize);
                    let weight: f64 = s.nodes.iter().filter(|n| n.0 == index).map(|n| n.1).sum();
                    assert!((weight - 1.0).abs() < 1e-5, "{i} {j} {k}: {weight}");
                    let swapped = nodes.stencil(b, a);
                    assert_eq!(s.nodes, swapped.nodes);
                }
            }
        }
    }

    #[test]
    fn cubics_are_exact() {
        let nodes = AngleNodes { thetas: 7, ratios: 5, azimuths: 6 };
        let f = |i: f64, j: f64, k: f64| {
            (1.0 + i - 0.3 * i.powi(3)) * (2.0 - j * j) * (0.5 + 0.1 * k.powi(3) - k)
        };
        let table: Vec<f64> = (0..7)
            .flat_map(|i| (0..6).flat_map(move |k| (0..5).map(move |j| f(i as f64, j as f64, k as f64))))
            .collect();
        for n in 0..200 {
            let u = |q: f64| (f64::from(n) * q + 0.31).fract();
            let (i, j, k) = (0.1 + 5.8 * u(0.618), 0.2 + 3.8 * u(0.755), 5.0 * u(0.569));
            let (a, b) = at(&nodes, i, j, k);
            let s = nodes.stencil(a, b);
            let value: f64 = s.nodes.iter().map(|&(index, w)| table[index] * w).sum();
            assert!((value - f(i, j, k)).abs() < 1e-6 * (1.0 + f(i, j, k).abs()), "{i} {j} {k}");
        }
    }
}

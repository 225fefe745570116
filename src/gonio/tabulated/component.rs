//! One table of a petal (surface or interior), ready to be asked and drawn from.
//!
//! A table is a sum of hats ([`super::hats`]) of both polar angles and the azimuth, so for light at an angle between two
//! nodes the density `f cos` of its exit directions is a mixture with positive weights: of the two incident nodes, of the
//! classes, of the exitant nodes. Everything here is the precomputed weights of that mixture.

use super::hats::{Polar, draw_azimuth};
use super::{Way, index};
use crate::geometry::Side;
use crate::gonio::{AngularTable, Nodes, Part, Place};

/// A table with the weights for drawing from it.
#[derive(Clone, Debug)]
pub(super) struct Component {
    table: AngularTable,
    polar: Polar,
    /// Share of the white light of a node that leaves: `[side][way][node][class]`.
    albedo: Vec<f32>,
    /// Cumulative shares per `[side][way][node][class]`: of the exitant polar nodes, then of the azimuth's nodes for
    /// each of them.
    cumulative: Vec<f32>,
}

impl Component {
    /// From a valid table.
    pub(super) fn new(table: &AngularTable) -> Self {
        let mut component = Self {
            table: table.clone(),
            polar: Polar::new(table.grid.thetas),
            albedo: Vec::new(),
            cumulative: Vec::new(),
        };
        component.accumulate();
        component
    }

    /// Bytes of the tables.
    pub(super) fn bytes(&self) -> usize {
        size_of::<f32>() * (self.table.values.len() + self.albedo.len() + self.cumulative.len())
    }

    pub(super) fn classes(&self) -> usize {
        self.table.classes
    }

    fn accumulate(&mut self) {
        let (thetas, phis, classes) = (self.table.grid.thetas, self.table.grid.phis, self.table.classes);
        let (measures, d_phi) = (self.table.grid.theta_measures(), self.table.grid.phi_measure());
        for side in [Side::Adaxial, Side::Abaxial] {
            for way in Way::BOTH {
                for node in 0..thetas {
                    for class in 0..classes {
                        let value = |j: usize, p: usize| f64::from(self.value(side, way, node, j, p, class));
                        let rows: Vec<f64> = (0..thetas)
                            .map(|j| {
                                let sum: f64 = (0..phis).map(|p| value(j, p)).sum();
                                sum * measures[j] * d_phi
                            })
                            .collect();
                        let row = shares(rows.iter().copied());
                        let columns = (0..thetas).flat_map(|j| shares((0..phis).map(move |p| value(j, p))));
                        let columns: Vec<f32> = columns.collect();
                        self.albedo.push(rows.iter().sum::<f64>() as f32);
                        self.cumulative.extend(row);
                        self.cumulative.extend(columns);
                    }
                }
            }
        }
    }

    /// Value of a node for light that falls on `side` at polar node `i`.
    fn value(&self, side: Side, way: Way, i: usize, j: usize, phi: usize, class: usize) -> f32 {
        let (part, a, b) = match (way, side) {
            (Way::Reflected, Side::Adaxial) => (Part::Adaxial, i, j),
            (Way::Reflected, Side::Abaxial) => (Part::Abaxial, i, j),
            (Way::Transmitted, Side::Adaxial) => (Part::Through, i, j),
            (Way::Transmitted, Side::Abaxial) => (Part::Through, j, i),
        };
        self.table.bin(part, a, b, phi)[class]
    }

    /// Adds the interpolated value of each class.
    #[inline(always)]
    pub(super) fn add(&self, place: &Place, sums: &mut [f32]) {
        for (first, weight) in self.table.corners(place) {
            for (sum, v) in sums.iter_mut().zip(&self.table.values[first..first + self.table.classes]) {
                *sum += weight * v;
            }
        }
    }

    /// The two nodes around the polar angle of the incident direction.
    pub(super) fn incident(&self, theta: f32) -> Nodes {
        self.table.grid.theta_nodes(theta)
    }

    /// Albedo of one class at a node.
    pub(super) fn albedo_at(&self, side: Side, way: Way, node: usize) -> &[f32] {
        let first = index(side, way, node, self.table.grid.thetas) * self.table.classes;
        &self.albedo[first..first + self.table.classes]
    }

    /// Mean over the hemisphere, weighted by the cosine, of the albedo of each class.
    pub(super) fn hemispherical(&self, side: Side, way: Way) -> Vec<f32> {
        // The hats' projected solid angles are the weights of the nodes; all azimuths together are 2 pi.
        let measures = self.table.grid.theta_measures();
        let total: f64 = measures.iter().sum();
        let mut sums = vec![0.0f64; self.classes()];
        for (node, measure) in measures.iter().enumerate() {
            for (sum, a) in sums.iter_mut().zip(self.albedo_at(side, way, node)) {
                *sum += measure / total * f64::from(*a);
            }
        }
        sums.into_iter().map(|s| s as f32).collect()
    }

    /// Exitant polar angle and turn of the azimuth (radians, with sign) for light at a node.
    pub(super) fn draw(
        &self,
        (side, way, node, class): (Side, Way, usize, usize),
        u: glam::Vec2,
    ) -> (f64, f64) {
        let (thetas, phis) = (self.table.grid.thetas, self.table.grid.phis);
        let length = thetas + thetas * phis;
        let first = (index(side, way, node, thetas) * self.table.classes + class) * length;
        let (rows, columns) = self.cumulative[first..first + length].split_at(thetas);
        let (j, u_polar) = search(rows, u.x);
        let (p, u_phi) = search(&columns[j * phis..(j + 1) * phis], u.y);
        // Half of the numbers for each turn.
        let (sign, u_phi) = if u_phi < 0.5 { (1.0, 2.0 * u_phi) } else { (-1.0, 2.0 * u_phi - 1.0) };
        (self.polar.draw(j, u_polar), sign * draw_azimuth(phis, p, u_phi))
    }
}

/// Cumulative shares, the last of which is one; all of nothing is equal shares.
fn shares(values: impl Iterator<Item = f64> + Clone) -> Vec<f32> {
    let total: f64 = values.clone().sum();
    let count = values.clone().count();
    let mut sum = 0.0;
    let mut out: Vec<f32> = values
        .map(|v| {
            sum += if total > 0.0 { v / total } else { 1.0 / count as f64 };
            sum as f32
        })
        .collect();
    if let Some(last) = out.last_mut() {
        *last = 1.0;
    }
    out
}

/// The entry of cumulative shares that `u` falls on, and where within it, in [0, 1).
fn search(cumulative: &[f32], u: f32) -> (usize, f64) {
    let i = cumulative.partition_point(|&c| c <= u).min(cumulative.len() - 1);
    let low = f64::from(if i == 0 { 0.0 } else { cumulative[i - 1] });
    let width = f64::from(cumulative[i]) - low;
    // A number of 24 bits stands for the interval that follows it.
    let within = (f64::from(u) + 0.5f64.powi(25) - low) / width.max(f64::MIN_POSITIVE);
    (i, within.clamp(0.0, 1.0 - 1e-9))
}

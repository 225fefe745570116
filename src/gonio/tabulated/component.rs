//! One table of a petal (surface or interior), ready to be asked and drawn from.
//!
//! A table is a sum of hats ([`super::hats`]) of both polar angles and the azimuth, so for light at an angle between two
//! nodes the density `f cos` of its exit directions is a mixture with positive weights: of the two incident nodes, of the
//! classes, of the exitant nodes. Everything here is the precomputed weights of that mixture.

use std::f32::consts::{FRAC_PI_2, PI};

use super::hats::{Between, Polar, azimuth_measure, draw_azimuth};
use super::{MAX_CLASSES, Way, index};
use crate::geometry::Side;
use crate::gonio::petal_optics::{AngularTable, PARTS, Part};
use crate::{Error, Result};

/// Reflection tables may differ from their transpose by this share of their largest value.
const SYMMETRY_TOLERANCE: f32 = 1e-5;

/// Polar angles of two directions and the angle between their azimuths, radians.
#[derive(Clone, Copy, Debug)]
pub(super) struct Angles {
    pub(super) part: Part,
    /// The first index of the table.
    pub(super) a: f32,
    pub(super) b: f32,
    pub(super) phi: f32,
}

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
    pub(super) fn new(table: &AngularTable, at: &str) -> Result<Self> {
        check(table, at)?;
        let mut component = Self {
            table: table.clone(),
            polar: Polar::new(table.grid.thetas),
            albedo: Vec::new(),
            cumulative: Vec::new(),
        };
        component.accumulate();
        Ok(component)
    }

    /// Bytes of the tables.
    pub(super) fn bytes(&self) -> usize {
        size_of::<f32>() * (self.table.values.len() + self.albedo.len() + self.cumulative.len())
    }

    pub(super) fn classes(&self) -> usize {
        self.table.classes
    }

    pub(super) fn thetas(&self) -> usize {
        self.table.grid.thetas
    }

    fn accumulate(&mut self) {
        let (thetas, phis, classes) = (self.table.grid.thetas, self.table.grid.phis, self.table.classes);
        // Both turns of the azimuth.
        let d_phi = 2.0 * azimuth_measure(phis);
        for side in [Side::Adaxial, Side::Abaxial] {
            for way in Way::BOTH {
                for node in 0..thetas {
                    for class in 0..classes {
                        let value = |j: usize, p: usize| f64::from(self.value(side, way, node, j, p, class));
                        let rows: Vec<f64> = (0..thetas)
                            .map(|j| {
                                let sum: f64 = (0..phis).map(|p| value(j, p)).sum();
                                sum * self.polar.measure(j) * d_phi
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
    #[inline]
    pub(super) fn add(&self, at: &Angles, sums: &mut [f32]) {
        let (thetas, phis) = (self.table.grid.thetas, self.table.grid.phis);
        let a = Between::new(at.a, FRAC_PI_2, thetas);
        let b = Between::new(at.b, FRAC_PI_2, thetas);
        let phi = Between::new(at.phi, PI, phis);
        for (i, wa) in a.nodes() {
            for (j, wb) in b.nodes() {
                for (p, wp) in phi.nodes() {
                    let w = wa * wb * wp;
                    // Most corners count; a zero weight costs less than a branch, but not where it doubles a node.
                    for (sum, v) in sums.iter_mut().zip(self.table.bin(at.part, i, j, p)) {
                        *sum += w * v;
                    }
                }
            }
        }
    }

    /// The two nodes around the polar angle of the incident direction.
    pub(super) fn incident(&self, theta: f32) -> Between {
        Between::new(theta, FRAC_PI_2, self.thetas())
    }

    /// Albedo of one class at a node.
    pub(super) fn albedo_at(&self, side: Side, way: Way, node: usize) -> &[f32] {
        let first = index(side, way, node, self.thetas()) * self.table.classes;
        &self.albedo[first..first + self.table.classes]
    }

    /// White share of light at `theta` that leaves, all classes.
    pub(super) fn white_albedo(&self, side: Side, node: usize) -> f32 {
        Way::BOTH.iter().map(|&way| self.albedo_at(side, way, node).iter().sum::<f32>()).sum()
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

fn check(table: &AngularTable, at: &str) -> Result<()> {
    let bad = |what: String| Err(Error::invalid(at, what));
    let (thetas, phis, classes) = (table.grid.thetas, table.grid.phis, table.classes);
    if thetas == 0 || phis == 0 || classes == 0 || classes > MAX_CLASSES {
        return bad(format!(
            "{thetas} x {phis} bins of {classes} classes; at least 1 of each, at most {MAX_CLASSES} classes"
        ));
    }
    let length = thetas.checked_pow(2).and_then(|n| n.checked_mul(phis)?.checked_mul(classes * PARTS));
    if length != Some(table.values.len()) {
        return bad(format!(
            "{} values for {thetas} x {thetas} x {phis} bins of {classes} classes",
            table.values.len()
        ));
    }
    if let Some(v) = table.values.iter().find(|v| !(v.is_finite() && **v >= 0.0)) {
        return bad(format!("the value {v} is negative or not a finite number"));
    }
    let largest = table.values.iter().copied().fold(0.0, f32::max);
    for part in [Part::Adaxial, Part::Abaxial] {
        for a in 0..thetas {
            for b in 0..a {
                for p in 0..phis {
                    let pairs = table.bin(part, a, b, p).iter().zip(table.bin(part, b, a, p));
                    if let Some((v, w)) =
                        pairs.into_iter().find(|(v, w)| (*v - *w).abs() > SYMMETRY_TOLERANCE * largest)
                    {
                        return bad(format!("not reciprocal: {v} from bin {a} to {b}, {w} back"));
                    }
                }
            }
        }
    }
    Ok(())
}

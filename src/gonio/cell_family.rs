//! Tables of geometric factors for a family of cell shapes, so that a fit can vary the shape itself.
//!
//! Model: the factors are smooth in a shape parameter h; between its nodes h_i they are the polynomial through all
//! nodes, and so is the derivative:
//!
//! ```text
//! f_E(h) = sum of L_i(h) f_E(h_i),   h_i = Chebyshev's points of the range, both ends among them
//! ```
//!
//! With two parameters the product of both. All tables share their random numbers, so the noise is nearly the same in
//! each and cancels in differences.
//!
//! Limits: one or two parameters; a range over which the factors bend more than a polynomial of the nodes' number
//! shows oscillations. Guarded by `polynomials_are_exact` and `between_the_nodes_is_the_shape_itself`.
//! Source: our reading; barycentric form of Lagrange's polynomials.

use std::ops::ControlFlow;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::cell_factors::{CellFactors, FactorSettings, Factors};
use super::goniophotometer::Progress;
use crate::micro::CellDescription;
use crate::{Error, Result};

/// A number of the cells' shape that a family varies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShapeParameter {
    /// `cells.height_um`
    HeightUm,
    /// `cells.center_disorder`
    CenterDisorder,
    /// `cells.height_disorder`
    HeightDisorder,
}

impl ShapeParameter {
    /// Its key in the cells' description.
    pub fn name(self) -> &'static str {
        match self {
            ShapeParameter::HeightUm => "height_um",
            ShapeParameter::CenterDisorder => "center_disorder",
            ShapeParameter::HeightDisorder => "height_disorder",
        }
    }

    /// What it is, with its unit.
    pub fn meaning(self) -> &'static str {
        match self {
            ShapeParameter::HeightUm => "height of the domes, um",
            ShapeParameter::CenterDisorder => "standard deviation of the centres, pitches",
            ShapeParameter::HeightDisorder => "standard deviation of the heights, heights",
        }
    }

    fn set(self, cells: &mut CellDescription, value: f64) {
        match self {
            ShapeParameter::HeightUm => cells.height_um = value,
            ShapeParameter::CenterDisorder => cells.center_disorder = value,
            ShapeParameter::HeightDisorder => cells.height_disorder = value,
        }
    }
}

/// One parameter with its range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// What varies.
    pub parameter: ShapeParameter,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Number of tables, 2 to 9.
    pub nodes: usize,
}

impl Axis {
    /// Chebyshev's points from `min` to `max`.
    pub fn values(&self) -> Vec<f64> {
        let last = (self.nodes - 1) as f64;
        (0..self.nodes)
            .map(|i| {
                let x = (std::f64::consts::PI * i as f64 / last).cos();
                self.min + (self.max - self.min) * 0.5 * (1.0 - x)
            })
            .collect()
    }

    /// L_i at a value within the range, and their derivatives.
    fn basis(&self, value: f64) -> Vec<(f64, f64)> {
        let nodes = self.values();
        let x = value.clamp(self.min, self.max);
        // Products, not the barycentric quotient: few nodes, and derivatives without a case at the nodes.
        (0..nodes.len())
            .map(|i| {
                let (mut value, mut slope) = (1.0, 0.0);
                for (j, node) in nodes.iter().enumerate().filter(|(j, _)| *j != i) {
                    debug_assert_ne!(i, j);
                    let scale = 1.0 / (nodes[i] - node);
                    slope = slope * (x - node) * scale + value * scale;
                    value *= (x - node) * scale;
                }
                (value, slope)
            })
            .collect()
    }
}

/// The tables.
#[derive(Clone, Debug)]
pub struct CellFamily {
    axes: Vec<Axis>,
    /// The last axis runs fastest.
    members: Vec<CellFactors>,
    tail_ratio: f64,
}

impl From<CellFactors> for CellFamily {
    /// One shape, nothing varied.
    fn from(factors: CellFactors) -> Self {
        Self { axes: Vec::new(), tail_ratio: factors.tail_ratio(), members: vec![factors] }
    }
}

impl CellFamily {
    /// Computes a table for every node; `progress` hears of all points.
    pub fn compute(
        cells: &CellDescription,
        axes: &[Axis],
        settings: &FactorSettings,
        progress: Progress,
    ) -> Result<Self> {
        let shapes = Self::shapes(cells, axes)?;
        let count = shapes.len() as u64;
        let mut members = Vec::with_capacity(shapes.len());
        for (i, shape) in shapes.iter().enumerate() {
            members.push(CellFactors::compute(shape, settings, &|done, total| {
                progress(done + i as u64 * total, total * count)
            })?);
            if let ControlFlow::Break(()) = progress(i as u64 + 1, count) {
                return Err(Error::Cancelled);
            }
        }
        Ok(Self::of(axes, members))
    }

    /// The shapes that a family needs, in the order of its members: to compute or read each table apart.
    pub fn shapes(cells: &CellDescription, axes: &[Axis]) -> Result<Vec<CellDescription>> {
        if axes.len() > 2 {
            let what = format!("{} shape parameters; a family varies at most two", axes.len());
            return Err(Error::invalid("family", what));
        }
        let mut shapes = vec![cells.clone()];
        for (i, axis) in axes.iter().enumerate() {
            let name = axis.parameter.name();
            let wrong = |what: String| Err(Error::invalid(format!("family.{name}"), what));
            if axes[..i].iter().any(|a| a.parameter == axis.parameter) {
                return wrong("varied twice".into());
            }
            if !(2..=9).contains(&axis.nodes) {
                return wrong(format!("{} nodes; 2 to 9 are possible", axis.nodes));
            }
            if !(axis.min.is_finite() && axis.max.is_finite() && axis.min < axis.max) {
                return wrong(format!("{} to {} is no range", axis.min, axis.max));
            }
            shapes = shapes
                .iter()
                .flat_map(|shape| {
                    axis.values().into_iter().map(|value| {
                        let mut shape = shape.clone();
                        axis.parameter.set(&mut shape, value);
                        shape
                    })
                })
                .collect();
        }
        shapes.iter().try_for_each(|s| s.validate("cells"))?;
        Ok(shapes)
    }

    /// From tables that were computed before, in the order of [`CellFamily::shapes`].
    pub fn from_members(cells: &CellDescription, axes: &[Axis], members: Vec<CellFactors>) -> Result<Self> {
        let shapes = Self::shapes(cells, axes)?;
        if shapes.len() != members.len() || shapes.iter().zip(&members).any(|(s, m)| s != m.cells()) {
            return Err(Error::invalid("family", "the tables are not those of the family's shapes"));
        }
        if members.windows(2).any(|m| m[0].settings() != m[1].settings()) {
            return Err(Error::invalid("family", "the tables were computed with different settings"));
        }
        Ok(Self::of(axes, members))
    }

    fn of(axes: &[Axis], members: Vec<CellFactors>) -> Self {
        let tail_ratio =
            members.iter().map(CellFactors::tail_ratio).sum::<f64>() / members.len().max(1) as f64;
        Self { axes: axes.to_vec(), members, tail_ratio }
    }

    /// What varies.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// The tables; the last axis runs fastest.
    pub fn members(&self) -> &[CellFactors] {
        &self.members
    }

    /// The shape at these values of the axes.
    pub fn shape(&self, values: &[f64]) -> Option<CellDescription> {
        let mut cells = self.members.first()?.cells().clone();
        self.axes.iter().zip(values).for_each(|(axis, &value)| axis.parameter.set(&mut cells, value));
        Some(cells)
    }

    /// Every member's factors for one reading.
    pub fn factors(&self, pairs: &[(DVec3, DVec3, f64)]) -> Vec<Factors> {
        self.members.iter().map(|m| m.factors(pairs).with_tail_ratio(self.tail_ratio)).collect()
    }

    /// Weight of every member at these values of the axes, and its derivative by each axis.
    pub fn weights(&self, values: &[f64]) -> Vec<(f64, [f64; 2])> {
        let mut weights = vec![(1.0, [0.0; 2])];
        for (k, (axis, &value)) in self.axes.iter().zip(values).enumerate() {
            let basis = axis.basis(value);
            weights = weights
                .iter()
                .flat_map(|&(w, dw)| {
                    basis.iter().map(move |&(l, dl)| {
                        let mut slope = dw.map(|d| d * l);
                        slope[k] += w * dl;
                        (w * l, slope)
                    })
                })
                .collect();
        }
        weights
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::cell_factors::AngleNodes;
    use crate::gonio::measurement::direction_deg;

    const AXIS: Axis = Axis { parameter: ShapeParameter::HeightUm, min: 10.0, max: 40.0, nodes: 5 };

    #[test]
    fn polynomials_are_exact() {
        let f = |x: f64| 1.0 - 0.2 * x + 0.03 * x * x - 1e-4 * x.powi(4);
        let df = |x: f64| -0.2 + 0.06 * x - 4e-4 * x.powi(3);
        for x in [10.0, 11.3, 25.0, 33.3, 40.0] {
            let (mut value, mut slope) = (0.0, 0.0);
            for ((l, dl), node) in AXIS.basis(x).into_iter().zip(AXIS.values()) {
                value += l * f(node);
                slope += dl * f(node);
            }
            assert!((value - f(x)).abs() < 1e-9 * f(x).abs().max(1.0), "{x}: {value}");
            assert!((slope - df(x)).abs() < 1e-9 * df(x).abs().max(1.0), "{x}: {slope}");
        }
    }

    #[test]
    fn between_the_nodes_is_the_shape_itself() {
        let nodes = AngleNodes { thetas: 5, ratios: 4, azimuths: 4 };
        let settings = FactorSettings { points: 512, facets: 16, seed: 3, first: nodes, later: nodes };
        let go = |_, _| ControlFlow::Continue(());
        let cells = CellDescription::default();
        let family = CellFamily::compute(&cells, &[AXIS], &settings, &go).unwrap();
        let height = 21.0;
        let shape = family.shape(&[height]).unwrap();
        let direct = CellFactors::compute(&shape, &settings, &go).unwrap();
        let weights = family.weights(&[height]);
        for (wi, wo) in [(50.0, 20.0), (30.0, 30.0), (65.0, 60.0)] {
            let pair = [(direction_deg(wi, 0.0), direction_deg(wo, 40.0), 1.0)];
            let exact = direct.factors(&pair).eval(0.5, 0.1, 3.0).f;
            let f: f64 =
                family.factors(&pair).iter().zip(&weights).map(|(m, w)| w.0 * m.eval(0.5, 0.1, 3.0).f).sum();
            assert!((f / exact - 1.0).abs() < 0.03, "{wi} {wo}: {f} {exact}");
        }
    }

    #[test]
    fn families_that_are_none_are_errors() {
        let cells = CellDescription::default();
        let axis = |parameter, min, max, nodes| Axis { parameter, min, max, nodes };
        use ShapeParameter::{CenterDisorder, HeightDisorder, HeightUm};
        for (axes, key) in [
            (vec![AXIS, axis(CenterDisorder, 0.0, 0.1, 3), axis(HeightDisorder, 0.0, 0.1, 3)], "family:"),
            (vec![AXIS, AXIS], "family.height_um"),
            (vec![axis(HeightUm, 10.0, 40.0, 1)], "family.height_um"),
            (vec![axis(HeightUm, 40.0, 10.0, 5)], "family.height_um"),
            (vec![axis(HeightUm, f64::NAN, 10.0, 5)], "family.height_um"),
            (vec![axis(CenterDisorder, 0.0, 0.5, 3)], "cells.center_disorder"),
        ] {
            let error = CellFamily::shapes(&cells, &axes).expect_err(key).to_string();
            assert!(error.starts_with(key), "{error}");
        }
        let shapes = CellFamily::shapes(&cells, &[AXIS, axis(CenterDisorder, 0.0, 0.1, 3)]).unwrap();
        assert_eq!(shapes.len(), 15);
        assert!(CellFamily::from_members(&cells, &[AXIS], Vec::new()).is_err());
    }
}

//! Bilinear tables over the unit square that depend on the lamp's direction, and the warp that one of them defines.
//!
//! Model: values at a grid of `rows` x `columns` over [0, 1]^2, bilinear in between, one such grid (a slice) per lamp
//! azimuth, lamp angle and plane; linear between the lamp's nodes, held outside them. A [`Warp`] reads a table as
//! density p(x, y): with the row's integral R(y) = integral of p dx, its inverse map sends (x, y) to
//! (integral to x of p(., y) / R(y), integral to y of R / total). Densities and integrals of the lamp's nodes are
//! interpolated linearly, each slice normalised, before they are divided. Guarded by `inverse_map_has_the_density`.
//! Source: [Dupuy2018].

use crate::Result;
use crate::io::invalid;

use super::FORMAT;

/// Up to four slices with their weights: the lamp's azimuth and angle, each between two nodes.
pub(super) type Lamp = [(usize, f64); 4];

/// Where the lamp stands among the nodes: slice numbers `azimuth * angles + angle` and their weights.
pub(super) fn lamp(phis: &[f32], thetas: &[f32], phi: f64, theta: f64) -> Lamp {
    let between = |nodes: &[f32], x: f64| {
        let Some(last) = nodes.len().checked_sub(2) else { return (0, 0, 0.0) };
        let i = nodes.partition_point(|n| f64::from(*n) < x).saturating_sub(1).min(last);
        let (a, b) = (f64::from(nodes[i]), f64::from(nodes[i + 1]));
        (i, i + 1, ((x - a) / (b - a)).clamp(0.0, 1.0))
    };
    let ((p0, p1, tp), (t0, t1, tt)) = (between(phis, phi), between(thetas, theta));
    let n = thetas.len();
    [
        (p0 * n + t0, (1.0 - tp) * (1.0 - tt)),
        (p0 * n + t1, (1.0 - tp) * tt),
        (p1 * n + t0, tp * (1.0 - tt)),
        (p1 * n + t1, tp * tt),
    ]
}

/// The patch of a position: first row or column, and the place in the patch, 0 to 1.
fn patch(x: f64, nodes: usize) -> (usize, f64) {
    let x = x.clamp(0.0, 1.0) * (nodes - 1) as f64;
    let i = (x as usize).min(nodes - 2);
    (i, x - i as f64)
}

/// Values at the nodes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Table {
    pub(super) columns: usize,
    pub(super) rows: usize,
    /// Slices, row by row.
    pub(super) values: Vec<f32>,
}

impl Table {
    /// Bilinear value at `(x, y)` of the slices `(number, weight)`.
    pub(super) fn eval(&self, slices: impl IntoIterator<Item = (usize, f64)>, x: f64, y: f64) -> f64 {
        let ((column, fx), (row, fy)) = (patch(x, self.columns), patch(y, self.rows));
        let corner = row * self.columns + column;
        let mut sum = 0.0;
        for (slice, weight) in slices.into_iter().filter(|s| s.1 > 0.0) {
            let at = slice * self.rows * self.columns + corner;
            let v = |i: usize| f64::from(self.values[at + i]);
            let (top, bottom) =
                (v(0) * (1.0 - fx) + v(1) * fx, v(self.columns) * (1.0 - fx) + v(self.columns + 1) * fx);
            sum += weight * (top * (1.0 - fy) + bottom * fy);
        }
        sum
    }
}

/// A table as a density, with its integrals.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Warp {
    /// Densities; each slice integrates to one.
    density: Table,
    /// Integrals along a row from its start to each node.
    along: Vec<f32>,
    /// Integrals over the rows from the first to each.
    down: Vec<f32>,
}

impl Warp {
    /// From densities of any scale; `what` names the field in errors.
    pub(super) fn new(mut density: Table, what: &str) -> Result<Self> {
        let (columns, rows) = (density.columns, density.rows);
        if density.values.iter().any(|v| *v < 0.0) {
            return Err(invalid(FORMAT, format_args!("{what} has negative densities")));
        }
        let (mut along, mut down) = (Vec::with_capacity(density.values.len()), Vec::new());
        let (dx, dy) = (1.0 / (columns - 1) as f64, 1.0 / (rows - 1) as f64);
        for (number, slice) in density.values.chunks_exact_mut(columns * rows).enumerate() {
            let mut integrals = Vec::with_capacity(slice.len());
            let mut total = 0.0;
            let mut cumulative = Vec::with_capacity(rows);
            let mut above: Option<f64> = None;
            for row in slice.chunks_exact(columns) {
                let mut sum = 0.0;
                integrals.push(0.0);
                for pair in row.windows(2) {
                    sum += 0.5 * dx * (f64::from(pair[0]) + f64::from(pair[1]));
                    integrals.push(sum);
                }
                total += above.map_or(0.0, |a| 0.5 * dy * (a + sum));
                cumulative.push(total);
                above = Some(sum);
            }
            if !(total > 0.0 && total.is_finite()) {
                return Err(invalid(FORMAT, format_args!("{what}: slice {number} integrates to {total}")));
            }
            slice.iter_mut().for_each(|v| *v = (f64::from(*v) / total) as f32);
            along.extend(integrals.iter().map(|v| (v / total) as f32));
            down.extend(cumulative.iter().map(|v| (v / total) as f32));
        }
        Ok(Self { density, along, down })
    }

    /// Density at `(x, y)`.
    pub(super) fn density(&self, lamp: &Lamp, x: f64, y: f64) -> f64 {
        self.density.eval(*lamp, x, y)
    }

    /// Inverse map: where `(x, y)` came from; `None` in a row without density.
    pub(super) fn invert(&self, lamp: &Lamp, x: f64, y: f64) -> Option<(f64, f64)> {
        let (columns, rows) = (self.density.columns, self.density.rows);
        let ((column, fx), (row, fy)) = (patch(x, columns), patch(y, rows));
        let sum = |values: &[f32], size: usize, at: usize| -> f64 {
            lamp.iter().map(|(slice, w)| w * f64::from(values[slice * size + at])).sum()
        };
        let slice = columns * rows;
        // Along the row at y: the integral is bilinear between the rows, quadratic in the patch.
        let along = |r: usize| {
            let at = r * columns + column;
            let v0 = sum(&self.density.values, slice, at);
            let v1 = sum(&self.density.values, slice, at + 1);
            let start = sum(&self.along, slice, at);
            (
                start + (v0 + 0.5 * fx * (v1 - v0)) * fx / (columns - 1) as f64,
                sum(&self.along, slice, (r + 1) * columns - 1),
            )
        };
        let ((part0, whole0), (part1, whole1)) = (along(row), along(row + 1));
        let whole = whole0 * (1.0 - fy) + whole1 * fy;
        let part = part0 * (1.0 - fy) + part1 * fy;
        let down =
            sum(&self.down, rows, row) + (whole0 + 0.5 * fy * (whole1 - whole0)) * fy / (rows - 1) as f64;
        (whole > 0.0).then(|| (part / whole, down))
    }

    /// The map itself: the point whose inverse is `(x, y)`, by bisection to 1e-12.
    pub(super) fn forward(&self, lamp: &Lamp, x: f64, y: f64) -> (f64, f64) {
        let bisect = |below: &dyn Fn(f64) -> bool| {
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..40 {
                let mid = 0.5 * (low + high);
                *(if below(mid) { &mut low } else { &mut high }) = mid;
            }
            0.5 * (low + high)
        };
        // Without density there is nothing to tell left from right: any point will do.
        let v = bisect(&|v| self.invert(lamp, 0.5, v).is_some_and(|(_, back)| back < y));
        (bisect(&|u| self.invert(lamp, u, v).is_some_and(|(back, _)| back < x)), v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_map_has_the_density() {
        // Two angles of the lamp with different densities.
        let values = (0..2 * 3 * 4).map(|i| 0.2 + (i * 7 % 11) as f32).collect();
        let warp = Warp::new(Table { columns: 4, rows: 3, values }, "vndf").unwrap();
        let lamp = lamp(&[0.0], &[0.0, 1.0], 0.3, 0.4);
        assert!((lamp[1].1 - 0.4).abs() < 1e-7 && lamp[3].1 == 0.0);
        let corner = warp.invert(&lamp, 1.0, 1.0).unwrap();
        assert!((corner.0 - 1.0).abs() < 1e-6 && (corner.1 - 1.0).abs() < 1e-6, "{corner:?}");
        let h = 1e-5;
        for (x, y) in [(0.1, 0.2), (0.5, 0.9), (0.8, 0.45), (0.95, 0.6)] {
            let at = |dx: f64, dy: f64| warp.invert(&lamp, x + dx, y + dy).unwrap();
            let ds = (at(h, 0.0).0 - at(-h, 0.0).0) / (2.0 * h);
            let dt = (at(0.0, h).1 - at(0.0, -h).1) / (2.0 * h);
            // t does not depend on x, so the determinant is the product.
            let p = warp.density(&lamp, x, y);
            assert!((ds * dt / p - 1.0).abs() < 1e-4, "{x} {y}: {} {p}", ds * dt);
            let (s, t) = at(0.0, 0.0);
            let back = warp.forward(&lamp, s, t);
            assert!((back.0 - x).abs() < 1e-7 && (back.1 - y).abs() < 1e-7, "{back:?}");
        }
    }

    #[test]
    fn densities_must_be_densities() {
        let table = |values: [f32; 4]| Table { columns: 2, rows: 2, values: values.to_vec() };
        assert!(Warp::new(table([1.0, -1.0, 1.0, 1.0]), "vndf").is_err());
        assert!(Warp::new(table([0.0; 4]), "vndf").is_err());
        // A row of zeros: nothing is known there.
        let half = Warp::new(table([0.0, 0.0, 1.0, 1.0]), "vndf").unwrap();
        let lamp = lamp(&[0.0], &[0.0], 0.0, 0.0);
        assert!(half.invert(&lamp, 0.5, 0.0).is_none() && half.invert(&lamp, 0.5, 0.5).is_some());
    }
}

//! Drawing from the hats of a table's nodes ([`crate::gonio::angular`]).
//!
//! Model: a table that is linear between its nodes is a sum of hats, `f = sum over nodes of f_node hat_node`; drawing from it
//! is drawing a node in proportion to `f_node m_node`, m the measure of its hat, and then an angle with a density in
//! proportion to
//!
//! ```text
//! polar:    hat(theta) cos(theta) sin(theta)   over 0 to 90 deg
//! azimuth:  hat(phi)                           over 0 to 180 deg
//! ```
//!
//! The integrals of both have closed forms; the azimuth's is inverted by a square root, the polar angle's by Newton's
//! method. Guarded by `draws_follow_the_hats`.
//! Source: our reading.

use std::f64::consts::{FRAC_PI_2, PI};

/// The hats of a polar angle, weighted by `cos sin`.
#[derive(Clone, Debug)]
pub(super) struct Polar {
    nodes: usize,
    /// Of each hat: measure up to the node, and in all.
    measures: Vec<(f64, f64)>,
}

impl Polar {
    pub(super) fn new(nodes: usize) -> Self {
        let mut hats = Self { nodes, measures: Vec::new() };
        hats.measures = (0..nodes)
            .map(|i| {
                let below = hats.side(i, false).map_or(0.0, |s| s.integral(s.to));
                let above = hats.side(i, true).map_or(0.0, |s| s.integral(s.to));
                (below, below + above)
            })
            .collect();
        hats
    }

    /// One side of a hat, as a linear function over an interval. The parts beyond the outermost nodes are constant.
    fn side(&self, node: usize, above: bool) -> Option<Piece> {
        let step = FRAC_PI_2 / self.nodes as f64;
        let centre = (node as f64 + 0.5) * step;
        let slope = 1.0 / step;
        Some(match (above, node) {
            (false, 0) => Piece { from: 0.0, to: centre, value: 1.0, slope: 0.0 },
            (false, _) => Piece { from: centre - step, to: centre, value: 0.0, slope },
            (true, n) if n + 1 == self.nodes => Piece { from: centre, to: FRAC_PI_2, value: 1.0, slope: 0.0 },
            (true, _) => Piece { from: centre, to: centre + step, value: 1.0, slope: -slope },
        })
    }

    /// An angle from the hat of a node; `u` in [0, 1).
    pub(super) fn draw(&self, node: usize, u: f64) -> f64 {
        let (below, all) = self.measures[node];
        let target = u * all;
        let above = target >= below;
        match self.side(node, above) {
            Some(piece) => piece.invert(if above { target - below } else { target }),
            None => 0.0,
        }
    }
}

/// `value + slope (theta - from)` over an interval.
struct Piece {
    from: f64,
    to: f64,
    value: f64,
    slope: f64,
}

impl Piece {
    fn hat(&self, theta: f64) -> f64 {
        self.value + self.slope * (theta - self.from)
    }

    /// Integral of the hat times cos sin from the piece's begin to `theta`.
    fn integral(&self, theta: f64) -> f64 {
        // cos sin = sin(2 theta) / 2, whose primitive is -cos(2 theta) / 4.
        let primitive = |t: f64| {
            let (sin, cos) = (2.0 * t).sin_cos();
            -self.hat(t) * cos / 4.0 + self.slope * sin / 8.0
        };
        primitive(theta) - primitive(self.from)
    }

    /// The angle up to which the integral is `target`.
    fn invert(&self, target: f64) -> f64 {
        let (mut low, mut high) = (self.from, self.to);
        let share = target / self.integral(self.to).max(f64::MIN_POSITIVE);
        // Where the density grows from zero the share grows at least as a square.
        let start = if self.value == 0.0 { share.max(0.0).sqrt() } else { share };
        let mut theta = low + (high - low) * start.clamp(0.0, 1.0);
        for _ in 0..40 {
            let error = self.integral(theta) - target;
            if error > 0.0 {
                high = theta;
            } else {
                low = theta;
            }
            let (sin, cos) = theta.sin_cos();
            let density = self.hat(theta) * sin * cos;
            let newton = theta - error / density;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            let done = (next - theta).abs() < 1e-9;
            theta = next;
            if done {
                break;
            }
        }
        theta
    }
}

/// An azimuth from the hat of a node; `u` in [0, 1).
pub(super) fn draw_azimuth(nodes: usize, node: usize, u: f64) -> f64 {
    let step = PI / nodes as f64;
    let centre = (node as f64 + 0.5) * step;
    // Half of every hat lies on each side of its node: a triangle over a bin, or half a bin at an end.
    let v = if u < 0.5 { 2.0 * u } else { 2.0 - 2.0 * u };
    let reach = |at_end: bool| if at_end { 0.5 * (1.0 - v) } else { 1.0 - v.max(0.0).sqrt() };
    if u < 0.5 { centre - step * reach(node == 0) } else { centre + step * reach(node + 1 == nodes) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::{AngleGrid, Nodes};
    use crate::math::quadrature::GaussLegendre;
    use crate::math::stats::chi_square_test;

    fn weight(nodes: Nodes, node: usize) -> f64 {
        nodes.both().iter().filter(|n| n.0 == node).map(|n| f64::from(n.1)).sum()
    }

    #[test]
    fn draws_follow_the_hats() {
        // 4000 equally spaced u: the counts of a right inversion hardly differ from the expected ones, which bounds
        // Pearson's sum far below that of random numbers.
        let (n, bins) = (4000, 36);
        let check = |range: f64, draw: &dyn Fn(f64) -> f64, density: &dyn Fn(f64) -> f64, nodes: usize| {
            let mut counts = vec![0.0; bins];
            for k in 0..n {
                let angle = draw((f64::from(k) + 0.5) / f64::from(n));
                assert!((0.0..=range).contains(&angle), "{angle}");
                counts[((angle / range * bins as f64) as usize).min(bins - 1)] += 1.0;
            }
            let rule = GaussLegendre::new(8);
            let step = range / bins as f64;
            let mass: Vec<f64> =
                (0..bins).map(|i| rule.integrate(i as f64 * step, (i + 1) as f64 * step, density)).collect();
            let all: f64 = mass.iter().sum();
            let expected: Vec<f64> = mass.iter().map(|m| m / all * f64::from(n)).collect();
            let chi2 = chi_square_test(&counts, &expected, 5.0).statistic;
            assert!(chi2 < 1.0, "{nodes}: {chi2}");
        };
        for nodes in [1, 2, 9, 18] {
            let grid = AngleGrid { thetas: nodes, phis: nodes };
            let polar = Polar::new(nodes);
            for (i, measure) in grid.theta_measures().iter().enumerate() {
                assert!((polar.measures[i].1 / measure - 1.0).abs() < 1e-12);
                let density = |t: f64| weight(grid.theta_nodes(t as f32), i) * t.sin() * t.cos();
                check(FRAC_PI_2, &|u| polar.draw(i, u), &density, nodes);
                check(PI, &|u| draw_azimuth(nodes, i, u), &|t| weight(grid.phi_nodes(t as f32), i), nodes);
            }
        }
    }
}

//! Reading an [`AngularTable`] between its nodes, and the exact integrals of what is read.
//!
//! Model: a node stands at the centre of each bin; a value between nodes is the product of linear weights in the two polar
//! angles and the angle phi between the azimuths, each held constant beyond its outermost nodes. Such a weight, as a
//! function of its angle, is a hat h_i, and the sum of all hats is one everywhere. So
//!
//! ```text
//! integral over a hemisphere of f(a, b) cos b db = sum over j, p of f_ijp M_j W_p
//! M_j = integral from 0 to pi/2 of h_j(theta) cos theta sin theta dtheta,   sum of M_j = 1/2
//! W_p = integral from -pi to pi of h_p(|phi|) dphi = 2 pi / phis,           sum of W_p = 2 pi
//! ```
//!
//! is exact for the function that is read, with `a` at node i; between nodes it is linear in the angle of `a`.
//!
//! | symbol | method | unit |
//! |---|---|---|
//! | theta_j | [`AngleGrid::theta_deg`] | deg |
//! | h_j | [`AngleGrid::theta_nodes`], [`AngleGrid::phi_nodes`] | |
//! | M_j | [`AngleGrid::theta_measures`] | |
//! | W_p | [`AngleGrid::phi_measure`] | sr |
//! | bin's projected solid angle, all azimuths | [`AngleGrid::bin_measure`] | sr |
//!
//! Guarded by `hats_integrate_exactly` and `reading_is_linear_and_reciprocal`. Source: our reading.

use std::f32::consts as single;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec3, Vec2, Vec3};

use super::{AngleGrid, AngularTable, Part};

/// The two nodes that an angle lies between; both are the same beyond the outermost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nodes {
    /// Node at the smaller angle.
    pub low: usize,
    /// Node at the larger angle.
    pub high: usize,
    /// Weight of `high`; that of `low` is what is missing to one.
    pub weight_high: f32,
}

impl Nodes {
    /// `bins` are the angle in widths of a bin.
    fn new(bins: f32, count: usize) -> Self {
        let from_first = (bins - 0.5).clamp(0.0, count.saturating_sub(1) as f32);
        let low = from_first as usize;
        Self { low, high: (low + 1).min(count.saturating_sub(1)), weight_high: from_first - low as f32 }
    }

    /// Both nodes with their weights.
    pub fn both(self) -> [(usize, f32); 2] {
        [(self.low, 1.0 - self.weight_high), (self.high, self.weight_high)]
    }
}

impl AngleGrid {
    /// Polar angle of a node, degrees.
    pub fn theta_deg(&self, i: usize) -> f64 {
        90.0 * (i as f64 + 0.5) / self.thetas as f64
    }

    /// Nodes around a polar angle, radians.
    #[inline]
    pub fn theta_nodes(&self, theta: f32) -> Nodes {
        Nodes::new(theta * self.thetas as f32 / single::FRAC_PI_2, self.thetas)
    }

    /// Nodes around an angle between azimuths, radians, 0 to pi.
    #[inline]
    pub fn phi_nodes(&self, phi: f32) -> Nodes {
        Nodes::new(phi * self.phis as f32 / single::PI, self.phis)
    }

    /// M_j of every polar node.
    pub fn theta_measures(&self) -> Vec<f64> {
        let width = FRAC_PI_2 / self.thetas as f64;
        let node = |i: usize| (i as f64 + 0.5) * width;
        (0..self.thetas)
            .map(|j| {
                let (low, high) = (node(j) - width, node(j) + width);
                let rising = if j == 0 {
                    moments(0.0, node(0)).0
                } else {
                    let (m0, m1) = moments(low, node(j));
                    (m1 - low * m0) / width
                };
                let falling = if j + 1 == self.thetas {
                    moments(node(j), FRAC_PI_2).0
                } else {
                    let (m0, m1) = moments(node(j), high);
                    (high * m0 - m1) / width
                };
                rising + falling
            })
            .collect()
    }

    /// W_p, the same for every node.
    pub fn phi_measure(&self) -> f64 {
        TAU / self.phis as f64
    }

    /// Projected solid angle of a polar bin over all azimuths, sr.
    pub fn bin_measure(&self, i: usize) -> f64 {
        let sine = |k: usize| (FRAC_PI_2 * k as f64 / self.thetas as f64).sin();
        PI * (sine(i + 1) - sine(i)) * (sine(i + 1) + sine(i))
    }

    /// Bin of the polar angle of a direction, from the normal of its own side.
    pub fn theta_bin(&self, w: DVec3) -> usize {
        let theta = w.truncate().length().atan2(w.z.abs());
        ((theta / FRAC_PI_2 * self.thetas as f64) as usize).min(self.thetas.saturating_sub(1))
    }

    /// Bin of the angle between the azimuths of two directions.
    pub fn phi_bin(&self, a: DVec3, b: DVec3) -> usize {
        let (a, b) = (a.truncate(), b.truncate());
        let phi = a.perp_dot(b).abs().atan2(a.dot(b));
        ((phi / PI * self.phis as f64) as usize).min(self.phis.saturating_sub(1))
    }
}

/// Integrals of `cos sin` and of `theta cos sin` over an interval.
fn moments(low: f64, high: f64) -> (f64, f64) {
    let zeroth = |t: f64| 0.5 * t.sin().powi(2);
    let first = |t: f64| 0.125 * (2.0 * t).sin() - 0.25 * t * (2.0 * t).cos();
    (zeroth(high) - zeroth(low), first(high) - first(low))
}

/// Where two directions stand in a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Part of the table.
    pub part: Part,
    /// First polar angle, radians, from the normal of its own side; of [`Part::Through`] the adaxial direction's.
    pub theta_a: f32,
    /// Second polar angle, radians.
    pub theta_b: f32,
    /// Angle between the azimuths, radians, 0 to pi.
    pub phi: f32,
}

impl Place {
    /// Place of two local directions; their order does not matter where the table is reciprocal.
    #[inline]
    pub fn new(a: Vec3, b: Vec3) -> Self {
        let theta = |w: Vec3| w.truncate().length().atan2(w.z.abs());
        let (flat_a, flat_b): (Vec2, Vec2) = (a.truncate(), b.truncate());
        let phi = flat_a.perp_dot(flat_b).abs().atan2(flat_a.dot(flat_b));
        let (part, first, second) = match (a.z >= 0.0, b.z >= 0.0) {
            (true, true) => (Part::Adaxial, a, b),
            (false, false) => (Part::Abaxial, a, b),
            (true, false) => (Part::Through, a, b),
            (false, true) => (Part::Through, b, a),
        };
        Self { part, theta_a: theta(first), theta_b: theta(second), phi }
    }
}

impl AngularTable {
    /// Where the values of a bin start in `values`, one per class.
    #[inline]
    pub fn offset(&self, part: Part, a: usize, b: usize, phi: usize) -> usize {
        let AngleGrid { thetas, phis } = self.grid;
        (((part as usize * thetas + a) * thetas + b) * phis + phi) * self.classes
    }

    /// Offsets ([`AngularTable::offset`]) and weights of the eight nodes around a place; the weights sum to one.
    #[inline]
    pub fn corners(&self, place: &Place) -> [(usize, f32); 8] {
        let a = self.grid.theta_nodes(place.theta_a).both();
        let b = self.grid.theta_nodes(place.theta_b).both();
        let p = self.grid.phi_nodes(place.phi).both();
        std::array::from_fn(|c| {
            let ((a, x), (b, y), (p, z)) = (a[c >> 2], b[(c >> 1) & 1], p[c & 1]);
            (self.offset(place.part, a, b, p), x * y * z)
        })
    }

    /// Value of one class between the nodes, 1/sr.
    pub fn at(&self, place: &Place, class: usize) -> f32 {
        self.corners(place).iter().map(|(offset, weight)| self.values[offset + class] * weight).sum()
    }

    /// Integral over the second direction, times its cosine, of each class, with the first at the polar node `node`:
    /// `first_adaxial` tells which of the two of [`Part::Through`] is held. Exact for the values between the nodes.
    pub fn projected(&self, part: Part, node: usize, first_adaxial: bool) -> Vec<f64> {
        let mut sums = vec![0.0; self.classes];
        let phi = self.grid.phi_measure();
        for (j, measure) in self.grid.theta_measures().into_iter().enumerate() {
            let (a, b) = if part == Part::Through && !first_adaxial { (j, node) } else { (node, j) };
            for p in 0..self.grid.phis {
                for (sum, value) in sums.iter_mut().zip(self.bin(part, a, b, p)) {
                    *sum += f64::from(*value) * measure * phi;
                }
            }
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::frame::spherical;
    use crate::math::quadrature::GaussLegendre;
    use crate::math::sampler::hash;

    fn table(grid: AngleGrid, classes: usize) -> AngularTable {
        let mut t = AngularTable::zeros(grid, classes);
        t.values.iter_mut().zip(0..).for_each(|(v, i)| *v = hash(i) as f32 / u32::MAX as f32);
        t
    }

    #[test]
    fn hats_integrate_exactly() {
        for thetas in [1, 2, 9, 18] {
            let grid = AngleGrid { thetas, phis: 5 };
            let measures = grid.theta_measures();
            assert!((measures.iter().sum::<f64>() - 0.5).abs() < 1e-14, "{measures:?}");
            let bins: f64 = (0..thetas).map(|i| grid.bin_measure(i)).sum();
            assert!((bins - PI).abs() < 1e-13);
        }
        // The integral of what `at` reads, by quadrature between the kinks.
        let t = table(AngleGrid { thetas: 4, phis: 3 }, 2);
        let rule = GaussLegendre::new(8);
        let theta_a = t.grid.theta_deg(2).to_radians() as f32;
        for (part, first_adaxial) in
            [(Part::Adaxial, true), (Part::Abaxial, true), (Part::Through, true), (Part::Through, false)]
        {
            let exact = t.projected(part, 2, first_adaxial);
            for (class, exact) in exact.iter().enumerate() {
                let mut sum = 0.0;
                for i in 0..8 {
                    for j in 0..6 {
                        let x = [f64::from(i), f64::from(i + 1)].map(|k| k * FRAC_PI_2 / 8.0);
                        let y = [f64::from(j), f64::from(j + 1)].map(|k| k * PI / 6.0);
                        sum += rule.integrate_rectangle(x, y, &mut |theta, phi| {
                            let (a, b) = (theta_a, theta as f32);
                            let (a, b) =
                                if part == Part::Through && !first_adaxial { (b, a) } else { (a, b) };
                            let place = Place { part, theta_a: a, theta_b: b, phi: phi as f32 };
                            2.0 * f64::from(t.at(&place, class)) * theta.cos() * theta.sin()
                        });
                    }
                }
                assert!((sum - exact).abs() < 1e-5 * exact, "{part:?} {sum} {exact}");
            }
        }
    }

    #[test]
    fn reading_is_linear_and_reciprocal() {
        let grid = AngleGrid { thetas: 3, phis: 4 };
        let mut t = AngularTable::zeros(grid, 1);
        // 2 + theta_a + theta_b - phi / 2 at the nodes: read back between them, held beyond.
        let at = |i: usize| grid.theta_deg(i).to_radians();
        for a in 0..3 {
            for b in 0..3 {
                for p in 0..4 {
                    let value = 2.0 + at(a) + at(b) - (p as f64 + 0.5) * PI / 8.0;
                    for part in [Part::Adaxial, Part::Abaxial, Part::Through] {
                        let o = t.offset(part, a, b, p);
                        t.values[o] = value as f32;
                    }
                }
            }
        }
        for i in 0..500 {
            let u = |k: u32| hash(i * 8 + k) as f32 / u32::MAX as f32;
            let flip = |w: Vec3, k| if u(k) < 0.5 { w * Vec3::new(1.0, 1.0, -1.0) } else { w };
            let (ta, tb, phi) = (u(0) * 1.57, u(1) * 1.57, u(2) * single::TAU);
            let (a, b) = (flip(spherical(ta, 1.0), 3), flip(spherical(tb, 1.0 + phi), 4));
            let held = |v: f32, low: f32, high: f32| v.clamp(low, high);
            let [low, high] = [0.5, 2.5].map(|k| k * single::FRAC_PI_2 / 3.0);
            let folded = phi.min(single::TAU - phi);
            let p = held(folded, single::PI / 8.0, single::PI * 7.0 / 8.0);
            let expected = 2.0 + held(ta, low, high) + held(tb, low, high) - p / 2.0;
            let read = t.at(&Place::new(a, b), 0);
            assert!((read - expected).abs() < 1e-5, "{a} {b}: {read} {expected}");
            assert!((read - t.at(&Place::new(b, a), 0)).abs() < 1e-6);
            let weights: f32 = t.corners(&Place::new(a, b)).iter().map(|c| c.1).sum();
            assert!((weights - 1.0).abs() < 1e-6);
            // The bin of a direction is the one whose node is nearest.
            let bin = grid.theta_bin(a.as_dvec3());
            assert!((grid.theta_deg(bin) - f64::from(ta.to_degrees())).abs() <= 15.001);
            let bin = grid.phi_bin(a.as_dvec3(), b.as_dvec3());
            assert!(((bin as f32 + 0.5) * 45.0 - folded.to_degrees()).abs() <= 22.51);
        }
        // Straight up and exactly grazing.
        for w in [Vec3::Z, Vec3::NEG_Z, Vec3::X, Vec3::new(1.0, 0.0, -0.0)] {
            assert!(t.at(&Place::new(w, w), 0).is_finite());
            assert!(grid.theta_bin(w.as_dvec3()) < 3);
        }
    }
}

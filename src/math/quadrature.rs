//! Integrals by Gauss-Legendre rules: intervals, rectangles, the hemisphere and the sphere.
//!
//! Model: an n-point rule integrates polynomials of degree 2n - 1 exactly; nodes are the roots of the
//! Legendre polynomial P_n, found by Newton's method. On the sphere the polar angle takes a Gauss rule per
//! hemisphere (the horizon, where BSDFs jump, is an end point) and the azimuth the midpoint rule, which
//! converges exponentially for periodic functions. Guarded by `exact_on_polynomials`,
//! `sphere_moments` and `adaptive_finds_a_narrow_peak`.
//! Source: Abramowitz and Stegun 25.4.29.

use glam::Vec3;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// An n-point rule on [-1, 1].
#[derive(Clone, Debug, PartialEq)]
pub struct GaussLegendre {
    /// `(node, weight)` in increasing order of the nodes; the weights sum to 2.
    points: Vec<(f64, f64)>,
}

impl GaussLegendre {
    /// The rule with `n` points; at least one.
    pub fn new(n: usize) -> Self {
        let n = n.max(1);
        let points = (0..n)
            .map(|i| {
                let mut x = -(PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
                let mut slope = 1.0;
                for _ in 0..100 {
                    let (p, dp) = legendre(n, x);
                    slope = dp;
                    let step = p / dp;
                    x -= step;
                    if step.abs() < 1e-15 {
                        break;
                    }
                }
                (x, 2.0 / ((1.0 - x * x) * slope * slope))
            })
            .collect();
        Self { points }
    }

    /// Nodes and weights moved to `[a, b]`; the weights sum to `b - a`.
    pub fn on(&self, a: f64, b: f64) -> impl Iterator<Item = (f64, f64)> + '_ {
        let half = 0.5 * (b - a);
        self.points.iter().map(move |&(x, w)| (a + half * (x + 1.0), half * w))
    }

    /// Integral of `f` over `[a, b]`.
    pub fn integrate(&self, a: f64, b: f64, mut f: impl FnMut(f64) -> f64) -> f64 {
        self.on(a, b).map(|(x, w)| w * f(x)).sum()
    }

    /// Integral of `f(x, y)` over a rectangle, by the product of the rule with itself.
    pub fn integrate_rectangle(&self, x: [f64; 2], y: [f64; 2], f: &mut impl FnMut(f64, f64) -> f64) -> f64 {
        self.integrate(x[0], x[1], |u| self.integrate(y[0], y[1], |v| f(u, v)))
    }

    /// Integral of `f(x, y)` over a rectangle, quartered until a quarter's rule changes the result by at
    /// most `tolerance` (absolute, for the whole rectangle): at least `min_depth` times, so that a narrow
    /// peak is seen, and at most 12 times.
    pub fn integrate_adaptive(
        &self,
        x: [f64; 2],
        y: [f64; 2],
        tolerance: f64,
        min_depth: u32,
        f: &mut impl FnMut(f64, f64) -> f64,
    ) -> f64 {
        let whole = self.integrate_rectangle(x, y, f);
        self.refine(x, y, whole, tolerance, min_depth, 0, f)
    }

    #[allow(clippy::too_many_arguments)] // private recursion: a state struct would say the same twice
    fn refine(
        &self,
        x: [f64; 2],
        y: [f64; 2],
        whole: f64,
        tolerance: f64,
        min_depth: u32,
        depth: u32,
        f: &mut impl FnMut(f64, f64) -> f64,
    ) -> f64 {
        const MAX_DEPTH: u32 = 12;
        let (mx, my) = (0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]));
        let quarters = [
            ([x[0], mx], [y[0], my]),
            ([mx, x[1]], [y[0], my]),
            ([x[0], mx], [my, y[1]]),
            ([mx, x[1]], [my, y[1]]),
        ];
        let parts = quarters.map(|(x, y)| self.integrate_rectangle(x, y, f));
        let sum: f64 = parts.iter().sum();
        let done = depth + 1 >= min_depth && ((sum - whole).abs() <= tolerance || depth + 1 >= MAX_DEPTH);
        if done || !sum.is_finite() {
            return sum;
        }
        quarters
            .into_iter()
            .zip(parts)
            .map(|((x, y), part)| self.refine(x, y, part, tolerance / 4.0, min_depth, depth + 1, f))
            .sum()
    }
}

/// `P_n(x)` and its derivative by the three-term recurrence.
fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut previous, mut p) = (1.0, x);
    for k in 2..=n {
        let k = k as f64;
        (previous, p) = (p, ((2.0 * k - 1.0) * x * p - (k - 1.0) * previous) / k);
    }
    (p, n as f64 * (x * p - previous) / (x * x - 1.0))
}

/// Directions with solid angles (sr) that integrate over the hemisphere around +z: `theta_count` polar
/// angles times `phi_count` azimuths. The weights sum to 2 pi.
pub fn hemisphere_rule(theta_count: usize, phi_count: usize) -> Vec<(Vec3, f64)> {
    let phi_count = phi_count.max(1);
    let mut rule = Vec::with_capacity(theta_count * phi_count);
    for (theta, weight) in GaussLegendre::new(theta_count).on(0.0, FRAC_PI_2) {
        for k in 0..phi_count {
            let phi = TAU * (k as f64 + 0.5) / phi_count as f64;
            rule.push((spherical(theta, phi), weight * theta.sin() * TAU / phi_count as f64));
        }
    }
    rule
}

/// [`hemisphere_rule`] above and its mirror image below. The weights sum to 4 pi.
pub fn sphere_rule(theta_count: usize, phi_count: usize) -> Vec<(Vec3, f64)> {
    let mut rule = hemisphere_rule(theta_count, phi_count);
    rule.extend_from_within(..);
    let half = rule.len() / 2;
    rule[half..].iter_mut().for_each(|(w, _)| w.z = -w.z);
    rule
}

/// Integral of `f` over the hemisphere around +z.
pub fn integrate_hemisphere(theta_count: usize, phi_count: usize, mut f: impl FnMut(Vec3) -> f64) -> f64 {
    hemisphere_rule(theta_count, phi_count).into_iter().map(|(w, weight)| weight * f(w)).sum()
}

/// Integral of `f` over the sphere; `theta_count` polar angles on each hemisphere.
pub fn integrate_sphere(theta_count: usize, phi_count: usize, mut f: impl FnMut(Vec3) -> f64) -> f64 {
    sphere_rule(theta_count, phi_count).into_iter().map(|(w, weight)| weight * f(w)).sum()
}

/// Direction at polar angle and azimuth, computed in f64 and rounded once.
fn spherical(theta: f64, phi: f64) -> Vec3 {
    let (sin_theta, cos_theta) = theta.sin_cos();
    Vec3::new((sin_theta * phi.cos()) as f32, (sin_theta * phi.sin()) as f32, cos_theta as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_on_polynomials() {
        for n in [1, 2, 3, 7, 20, 101] {
            let rule = GaussLegendre::new(n);
            for degree in 0..2 * n.min(12) {
                let value = rule.integrate(1.0, 3.0, |x| x.powi(degree as i32));
                let exact = (3f64.powi(degree as i32 + 1) - 1.0) / (degree as f64 + 1.0);
                assert!((value / exact - 1.0).abs() < 1e-12, "{n} points, degree {degree}: {value} {exact}");
            }
        }
        // Published nodes and weights of the 3-point rule.
        let three: Vec<_> = GaussLegendre::new(3).on(-1.0, 1.0).collect();
        assert!((three[2].0 - 0.6f64.sqrt()).abs() < 1e-14 && (three[1].1 - 8.0 / 9.0).abs() < 1e-14);
    }

    #[test]
    fn sphere_moments() {
        let close = |v: f64, exact: f64| assert!((v - exact).abs() < 1e-5, "{v} is not {exact}");
        close(integrate_hemisphere(12, 16, |w| f64::from(w.z)), PI);
        close(integrate_hemisphere(12, 16, |w| f64::from(w.x * w.x)), TAU / 3.0);
        close(integrate_sphere(12, 16, |_| 1.0), 2.0 * TAU);
        close(integrate_sphere(12, 16, |w| f64::from(w.z)), 0.0);
        close(integrate_sphere(12, 16, |w| f64::from((w.y * w.z).powi(2))), 2.0 * TAU / 15.0);
    }

    #[test]
    fn adaptive_finds_a_narrow_peak() {
        // A Gaussian of standard deviation 0.01 in the unit square, off every node of the first rule.
        let (s, mut calls) = (0.01, 0);
        let value = GaussLegendre::new(4).integrate_adaptive([0.0, 1.0], [0.0, 1.0], 1e-7, 3, &mut |x, y| {
            calls += 1;
            (-((x - 0.31f64).powi(2) + (y - 0.77f64).powi(2)) / (2.0 * s * s)).exp() / (TAU * s * s)
        });
        assert!((value - 1.0).abs() < 1e-6, "{value}");
        // A uniform grid as fine as the peak needs would take a million.
        assert!(calls < 60_000, "{calls}");
    }
}

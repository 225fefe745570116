//! The domes' light as a function of their coefficients, once the geometry is known.
//!
//! Model: with a = kd + ks, the light of order m (m reflections at domes) is a homogeneous polynomial of degree m in
//! kd and ks whose coefficients depend on the directions and on the exponent n:
//!
//! ```text
//! f_E = kd D + ks S(n) + ks b (n + 2) / (2 pi) cos^n(alpha)        once; b, alpha: the flat part of the surface
//!     + kd^2 DD + kd ks DS(n) + ks^2 SS(n)                         twice
//!     + C3 + a C4 + a^2 g(a) C5,   g(a) = (1 - r) / (1 - r a)      three, four, five and more times
//! Cm  = kd^3 Cm0 + kd^2 ks Cm1(n) + kd ks^2 Cm2(n) + ks^3 Cm3(n)
//! ```
//!
//! Orders one to three are complete. Order four is a cubic form times a: right for ks / a = 0, 1/4, 1/2 and 1 and smooth
//! between. Order five and all higher ones together are C5, exact for ks = 0 and a = 1, and in between shared out as a
//! geometric series of ratio r; with lobes, the orders beyond five are to order five as they are without. For a > 1, where light would be made, g goes on as its tangent, so that a search that strays there meets
//! finite values.
//!
//! The exponent lies on a ladder n = 2^(k/2), k = 0 to 19 (1 to 724); between, a cubic spline in log n.
//!
//! Limits: what the spline and the series leave out is guarded by `exponents_between_the_rungs` and
//! `order_series_closes`. Derivatives are those of the interpolated function (`derivatives_are_differences`).
//! Source: our reading.

use std::f64::consts::TAU;

/// Rungs of the ladder of exponents.
pub const EXPONENTS: usize = 20;
/// Numbers of order one: D, b, then S at each rung.
pub(super) const FIRST: usize = 2 + EXPONENTS;
/// Coefficients of the later orders that do not depend on the exponent: DD, C30, C40, C50.
const CONSTANTS: usize = 4;
/// Coefficients that do: S, DS, SS, C31, C32, C33, C41, ..., C53.
const FUNCTIONS: usize = 12;
/// Numbers of the later orders: the constants, then DS and so on, each at every rung.
pub(super) const LATER: usize = CONSTANTS + (FUNCTIONS - 1) * EXPONENTS;

/// Exponent of rung k.
pub fn exponent(k: usize) -> f64 {
    (0.5 * k as f64).exp2()
}

/// The largest exponent.
pub fn max_exponent() -> f64 {
    exponent(EXPONENTS - 1)
}

/// f_E with its derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Domes {
    /// f_E, 1/sr.
    pub f: f64,
    /// d f_E / d kd.
    pub d_kd: f64,
    /// d f_E / d ks.
    pub d_ks: f64,
    /// d f_E / d n.
    pub d_n: f64,
}

/// The coefficients for one reading: a point pair of directions or the mean over a cone's.
#[derive(Clone, Debug)]
pub struct Factors {
    lambert: f64,
    constants: [f64; CONSTANTS],
    /// Value and slope per rung, at each rung.
    rungs: Box<[[[f64; 2]; FUNCTIONS]; EXPONENTS]>,
    /// `(b, cos alpha)` of the flat part, per pair of directions.
    flat: Vec<(f64, f64)>,
    tail_ratio: f64,
}

impl Factors {
    /// From the numbers of the tables, in their order, and the flat part's pairs.
    pub(super) fn new(
        first: &[f64; FIRST],
        later: &[f64; LATER],
        flat: Vec<(f64, f64)>,
        tail_ratio: f64,
    ) -> Self {
        let mut constants = [0.0; CONSTANTS];
        constants.copy_from_slice(&later[..CONSTANTS]);
        let mut rungs = Box::new([[[0.0; 2]; FUNCTIONS]; EXPONENTS]);
        let functions = std::iter::once(&first[2..]).chain(later[CONSTANTS..].chunks_exact(EXPONENTS));
        for (f, y) in functions.enumerate() {
            let slopes = spline_slopes(y);
            for k in 0..EXPONENTS {
                rungs[k][f] = [y[k], slopes[k]];
            }
        }
        Self { lambert: first[0], constants, rungs, flat, tail_ratio }
    }

    /// The same with another ratio of the orders' series.
    pub(crate) fn with_tail_ratio(self, tail_ratio: f64) -> Self {
        Self { tail_ratio, ..self }
    }

    /// f_E at kd, ks >= 0 and an exponent, which is held within the ladder.
    pub fn eval(&self, kd: f64, ks: f64, n: f64) -> Domes {
        let n = n.clamp(1.0, max_exponent());
        let x = 2.0 * n.log2();
        let k = (x.floor() as usize).min(EXPONENTS - 2);
        let t = x - k as f64;
        let dx_dn = 2.0 / (n * std::f64::consts::LN_2);
        // Hermite's basis and its derivative.
        let (t2, s) = (t * t, 1.0 - t);
        let h = [(1.0 + 2.0 * t) * s * s, t * s * s, t2 * (3.0 - 2.0 * t), -t2 * s];
        let dh = [-6.0 * t * s, s * (1.0 - 3.0 * t), 6.0 * t * s, t * (3.0 * t - 2.0)];
        let (low, high) = (&self.rungs[k], &self.rungs[k + 1]);
        let (mut v, mut dv) = ([0.0; FUNCTIONS], [0.0; FUNCTIONS]);
        for f in 0..FUNCTIONS {
            let y = [low[f][0], low[f][1], high[f][0], high[f][1]];
            v[f] = h[0] * y[0] + h[1] * y[1] + h[2] * y[2] + h[3] * y[3];
            dv[f] = (dh[0] * y[0] + dh[1] * y[1] + dh[2] * y[2] + dh[3] * y[3]) * dx_dn;
        }
        for &(b, cos) in &self.flat {
            if cos > 0.0 {
                let lobe = b * cos.powf(n) / TAU;
                v[0] += (n + 2.0) * lobe;
                dv[0] += lobe * (1.0 + (n + 2.0) * cos.ln());
            }
        }
        self.combine(kd, ks, &v, &dv)
    }

    fn combine(&self, kd: f64, ks: f64, v: &[f64; FUNCTIONS], dv: &[f64; FUNCTIONS]) -> Domes {
        let c = &self.constants;
        let (r, a) = (self.tail_ratio, kd + ks);
        let (g, dg) = if a <= 1.0 {
            let open = 1.0 - r * a;
            ((1.0 - r) / open, (1.0 - r) * r / (open * open))
        } else {
            (1.0 + (a - 1.0) * r / (1.0 - r), r / (1.0 - r))
        };
        let mut out = Domes {
            f: kd * self.lambert + ks * v[0] + kd * kd * c[0] + kd * ks * v[1] + ks * ks * v[2],
            d_kd: self.lambert + 2.0 * kd * c[0] + ks * v[1],
            d_ks: v[0] + kd * v[1] + 2.0 * ks * v[2],
            d_n: ks * (dv[0] + kd * dv[1] + ks * dv[2]),
        };
        let (factors, slopes) = ([1.0, a, a * a * g], [0.0, 1.0, a * (2.0 * g + a * dg)]);
        for (m, (factor, slope)) in factors.into_iter().zip(slopes).enumerate() {
            let c0 = c[1 + m];
            let (c1, c2, c3) = (v[3 + 3 * m], v[4 + 3 * m], v[5 + 3 * m]);
            let form = kd * kd * (kd * c0 + ks * c1) + ks * ks * (kd * c2 + ks * c3);
            out.f += factor * form;
            out.d_kd += factor * (3.0 * kd * kd * c0 + 2.0 * kd * ks * c1 + ks * ks * c2) + slope * form;
            out.d_ks += factor * (kd * kd * c1 + 2.0 * kd * ks * c2 + 3.0 * ks * ks * c3) + slope * form;
            let (d1, d2, d3) = (dv[3 + 3 * m], dv[4 + 3 * m], dv[5 + 3 * m]);
            out.d_n += factor * ks * (kd * (kd * d1 + ks * d2) + ks * ks * d3);
        }
        out
    }
}

/// Slopes of the cubic spline through equally spaced values; at the ends those of the cubic through four.
fn spline_slopes(y: &[f64]) -> [f64; EXPONENTS] {
    let n = EXPONENTS;
    let end = |a: f64, b: f64, c: f64, d: f64| (-11.0 * a + 18.0 * b - 9.0 * c + 2.0 * d) / 6.0;
    let mut m = [0.0; EXPONENTS];
    m[0] = end(y[0], y[1], y[2], y[3]);
    m[n - 1] = -end(y[n - 1], y[n - 2], y[n - 3], y[n - 4]);
    // m[i-1] + 4 m[i] + m[i+1] = 3 (y[i+1] - y[i-1]), by elimination.
    let mut above = [0.0; EXPONENTS];
    for i in 1..n - 1 {
        let right = 3.0 * (y[i + 1] - y[i - 1]) - m[i - 1] - if i == n - 2 { m[n - 1] } else { 0.0 };
        let pivot = 4.0 - above[i - 1];
        above[i] = 1.0 / pivot;
        m[i] = right / pivot;
    }
    for i in (1..n - 2).rev() {
        m[i] -= above[i] * m[i + 1];
    }
    m
}

/// Coefficients of `(kd^3, kd^2 ks, kd ks^2, ks^3)` of the cubic form with these values at ks = 0, 1/4, 1/2, 1 and
/// kd = 1 - ks.
pub(super) fn cubic_form([p0, p1, p2, p3]: [f64; 4]) -> [f64; 4] {
    let sum = 8.0 * p2 - p0 - p3;
    let c1 = (64.0 * p1 - 27.0 * p0 - p3 - 3.0 * sum) / 6.0;
    [p0, c1, sum - c1, p3]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Factors of a made-up surface, smooth in the exponent.
    fn made_up(seed: f64, flat: Vec<(f64, f64)>) -> Factors {
        let wave = |at: usize, from: usize| {
            let (f, k) = ((at - from) / EXPONENTS, (at - from) % EXPONENTS);
            0.3 + 0.2 * (0.3 * k as f64 + seed + f as f64 + from as f64).sin()
        };
        let first = std::array::from_fn(|i| if i < 2 { 0.2 } else { wave(i, 2) });
        let later = std::array::from_fn(|i| {
            if i < CONSTANTS { 0.2 + 0.1 * (seed + i as f64).sin() } else { wave(i, CONSTANTS) }
        });
        Factors::new(&first, &later, flat, 0.6)
    }

    #[test]
    fn derivatives_are_differences() {
        for i in 0..60 {
            let u = |q: f64| (f64::from(i) * q + 0.17).fract();
            let factors = made_up(u(0.3), vec![(0.3, 0.9), (0.1, -0.2)]);
            // Beyond a = 1 too, where a search may stray.
            let (kd, ks, n) = (u(0.618) * 1.2, u(0.755), 1.5 + 600.0 * u(0.569).powi(3));
            let at = factors.eval(kd, ks, n);
            let slope = |f: &dyn Fn(f64) -> f64, h: f64| (f(h) - f(-h)) / (2.0 * h);
            let d_kd = slope(&|h| factors.eval(kd + h, ks, n).f, 1e-5);
            let d_ks = slope(&|h| factors.eval(kd, ks + h, n).f, 1e-5);
            let d_n = slope(&|h| factors.eval(kd, ks, n + h).f, 1e-4 * n);
            assert!((at.d_kd - d_kd).abs() < 1e-6 * (1.0 + d_kd.abs()), "{kd} {ks} {n}: {at:?} {d_kd}");
            assert!((at.d_ks - d_ks).abs() < 1e-6 * (1.0 + d_ks.abs()), "{kd} {ks} {n}: {at:?} {d_ks}");
            assert!((at.d_n - d_n).abs() < 1e-5 * (0.01 + d_n.abs()), "{kd} {ks} {n}: {at:?} {d_n}");
        }
    }

    #[test]
    fn exponents_between_the_rungs() {
        // A lobe at one angle, the worst case: domes spread the normals and smooth the dependence.
        for alpha in [0.02f64, 0.1, 0.3, 0.8, 1.3] {
            let lobe = |n: f64| (n + 2.0) * alpha.cos().powf(n);
            let y = std::array::from_fn(|i| if i < 2 { 0.0 } else { lobe(exponent(i - 2)) });
            let factors = Factors::new(&y, &[0.0; LATER], Vec::new(), 0.5);
            let peak = y.iter().fold(0.0, |a: f64, &b| a.max(b));
            for i in 0..200 {
                let n = (0.01 + 0.04 * f64::from(i)).exp2();
                let error = factors.eval(0.0, 1.0, n).f - lobe(n);
                assert!(error.abs() < 2e-3 * peak, "{alpha} {n}: {error} of {peak}");
            }
        }
    }

    #[test]
    fn forms_have_their_values() {
        let c = [0.3, -0.1, 0.7, 0.2];
        let form = |s: f64| {
            let d = 1.0 - s;
            c[0] * d.powi(3) + c[1] * d * d * s + c[2] * d * s * s + c[3] * s.powi(3)
        };
        let found = cubic_form([0.0, 0.25, 0.5, 1.0].map(form));
        assert!(found.iter().zip(c).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
    }

    #[test]
    fn order_series_closes() {
        // Orders that fall by 0.55, 0.6, 0.62, then 0.64 and on: less regular than domes are.
        let (mut first, mut later, mut order) = ([0.0; FIRST], [0.0; LATER], [1.0; 60]);
        for m in 1..60 {
            order[m] = order[m - 1] * [0.55, 0.6, 0.62].get(m - 1).copied().unwrap_or(0.64);
        }
        first[0] = order[0];
        later[..3].copy_from_slice(&order[1..4]);
        later[3] = order[4..].iter().sum();
        let factors = Factors::new(&first, &later, Vec::new(), 0.62);
        for a in [0.1, 0.5, 0.8, 0.95, 1.0f64] {
            let exact: f64 = (0..60).map(|m| order[m] * a.powi(m as i32 + 1)).sum();
            let f = factors.eval(a, 0.0, 10.0).f;
            assert!((f / exact - 1.0).abs() < 2e-3, "{a}: {f} {exact}");
        }
    }
}

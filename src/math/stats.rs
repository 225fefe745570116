//! Running moments and hypothesis tests, in f64.
//!
//! Models: Welford's update and Chan's merge for mean and variance; Pearson's chi-square test with pooling
//! of sparse bins; Student's one-sample t test and the z test, both two-sided; Sidak's correction for many
//! tests; quantiles of the normal and Student's distribution. p values come from the functions of [`super::special`]. Guarded by the tests of this file against
//! published tables.

use super::special::{beta_regularized, erfc, gamma_q};

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// Mean and variance of a stream of numbers, without cancellation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Welford {
    count: u64,
    mean: f64,
    /// Sum of squared deviations from the mean.
    squares: f64,
}

impl Welford {
    /// Adds a number.
    pub fn push(&mut self, x: f64) {
        self.count += 1;
        let before = x - self.mean;
        self.mean += before / self.count as f64;
        self.squares += before * (x - self.mean);
    }

    /// Adds everything that the other has seen.
    pub fn merge(&mut self, other: &Welford) {
        if other.count == 0 {
            return;
        }
        let (n, m) = (self.count as f64, other.count as f64);
        let difference = other.mean - self.mean;
        self.count += other.count;
        self.mean += difference * m / (n + m);
        self.squares += other.squares + difference * difference * n * m / (n + m);
    }

    /// How many numbers.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Their mean; 0 without any.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Unbiased variance of the population they come from; NaN below two numbers.
    pub fn variance(&self) -> f64 {
        if self.count < 2 { f64::NAN } else { self.squares / (self.count - 1) as f64 }
    }

    /// Standard error of the mean of independent numbers; NaN below two numbers.
    pub fn standard_error(&self) -> f64 {
        (self.variance() / self.count as f64).sqrt()
    }
}

impl FromIterator<f64> for Welford {
    fn from_iter<I: IntoIterator<Item = f64>>(numbers: I) -> Self {
        let mut w = Welford::default();
        numbers.into_iter().for_each(|x| w.push(x));
        w
    }
}

/// Outcome of a test: a small p value speaks against the hypothesis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TestResult {
    /// Chi-square, t or z.
    pub statistic: f64,
    /// Degrees of freedom; infinite for the z test.
    pub degrees_of_freedom: f64,
    /// Probability of a statistic at least this extreme if the hypothesis holds.
    pub p_value: f64,
}

/// Pearson's chi-square test of counts against expected counts with the same total.
///
/// Bins are sorted by their expectation and pooled from the smallest until each pool expects at least
/// `min_expected` (5 is customary). With fewer than two pools nothing is left to test: p is 1.
/// A slice that is longer than the other is cut.
pub fn chi_square_test(observed: &[f64], expected: &[f64], min_expected: f64) -> TestResult {
    let mut bins: Vec<(f64, f64)> = expected.iter().copied().zip(observed.iter().copied()).collect();
    bins.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut pools: Vec<(f64, f64)> = Vec::new();
    let mut open = (0.0, 0.0);
    for (e, o) in bins {
        open = (open.0 + e, open.1 + o);
        if open.0 >= min_expected {
            pools.push(open);
            open = (0.0, 0.0);
        }
    }
    // Only where the whole expects too little can a rest remain; it joins the last pool.
    if let Some(last) = pools.last_mut() {
        *last = (last.0 + open.0, last.1 + open.1);
    }
    let statistic: f64 = pools.iter().map(|(e, o)| (o - e) * (o - e) / e).sum();
    let degrees_of_freedom = pools.len().saturating_sub(1) as f64;
    let p_value = if pools.len() < 2 { 1.0 } else { gamma_q(degrees_of_freedom / 2.0, statistic / 2.0) };
    TestResult { statistic, degrees_of_freedom, p_value }
}

/// Student's t test of the mean of independent, nearly normal numbers against `expected`, two-sided.
pub fn student_t_test(sample: &Welford, expected: f64) -> TestResult {
    let difference = sample.mean() - expected;
    let degrees_of_freedom = sample.count().saturating_sub(1) as f64;
    let statistic = if difference == 0.0 { 0.0 } else { difference / sample.standard_error() };
    let p_value = if statistic == 0.0 {
        1.0
    } else {
        let x = degrees_of_freedom / (degrees_of_freedom + statistic * statistic);
        beta_regularized(degrees_of_freedom / 2.0, 0.5, x)
    };
    TestResult { statistic, degrees_of_freedom, p_value }
}

/// z test of a normal difference of known variance against zero, two-sided.
pub fn z_test(difference: f64, variance: f64) -> TestResult {
    let statistic = if difference == 0.0 { 0.0 } else { difference / variance.sqrt() };
    let p_value = erfc(statistic.abs() * FRAC_1_SQRT_2);
    TestResult { statistic, degrees_of_freedom: f64::INFINITY, p_value }
}

/// Probability that a standard normal number is below `x`.
pub fn normal_cdf(x: f64) -> f64 {
    0.5 * erfc(-x * FRAC_1_SQRT_2)
}

/// Inverse of [`normal_cdf`]; NaN outside [0, 1].
///
/// The rational start of Abramowitz and Stegun 26.2.23 and three of Halley's steps on the nearer tail.
pub fn normal_quantile(p: f64) -> f64 {
    if !(0.0..=1.0).contains(&p) {
        return f64::NAN;
    }
    let tail = p.min(1.0 - p);
    if tail == 0.0 {
        return if p == 0.0 { f64::NEG_INFINITY } else { f64::INFINITY };
    }
    let t = (-2.0 * tail.ln()).sqrt();
    let mut x = t
        - (2.515_517 + t * (0.802_853 + t * 0.010_328))
            / (1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308)));
    for _ in 0..3 {
        let density = (-0.5 * x * x).exp() / TAU.sqrt();
        let step = (normal_cdf(-x) - tail) / density;
        x += step / (1.0 - 0.5 * x * step);
    }
    if p < 0.5 { -x } else { x }
}

/// Value that a t-distributed number with these degrees of freedom stays below with probability `p`; NaN outside
/// (0, 1) or without freedom. Infinite freedom is the normal distribution.
///
/// Two-sided tails are I_x(f/2, 1/2) with x = f / (f + t^2): found by bisection of x from the side that keeps
/// precision, so tails down to 1e-300 are right.
pub fn student_t_quantile(p: f64, degrees_of_freedom: f64) -> f64 {
    if !(p > 0.0 && p < 1.0 && degrees_of_freedom > 0.0) {
        return f64::NAN;
    }
    if degrees_of_freedom > 1e10 {
        return normal_quantile(p);
    }
    let tails = 2.0 * p.min(1.0 - p);
    if tails == 1.0 {
        return 0.0;
    }
    let f = degrees_of_freedom;
    let tails_of = |t: f64| beta_regularized(f / 2.0, 0.5, f / (f + t * t));
    // Bracket in t, then halve its logarithm; 200 steps end at neighbouring numbers.
    let (mut low, mut high) = (1e-160f64, 1.0f64);
    while tails_of(high) > tails && high < 1e150 {
        high *= 16.0;
    }
    for _ in 0..200 {
        let middle = if low < 1e-3 * high { (low * high).sqrt() } else { 0.5 * (low + high) };
        if middle <= low || middle >= high {
            break;
        }
        if tails_of(middle) > tails { low = middle } else { high = middle }
    }
    if p < 0.5 { -high } else { high }
}

/// Significance of each of `tests` independent tests, so that all together have `significance` (Sidak 1967).
pub fn sidak(significance: f64, tests: usize) -> f64 {
    -((-significance).ln_1p() / tests.max(1) as f64).exp_m1()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Sampler;
    use glam::UVec2;

    fn close(value: f64, exact: f64, relative: f64) {
        assert!((value / exact - 1.0).abs() < relative, "{value} is not {exact}");
    }

    #[test]
    fn moments_merge() {
        let x: Vec<f64> = (0..1000).map(|i| 1e9 + f64::from(i % 10)).collect();
        let whole: Welford = x.iter().copied().collect();
        close(whole.mean(), 1e9 + 4.5, 1e-15);
        close(whole.variance(), 8.25 * 1000.0 / 999.0, 1e-6);
        for cut in [0, 1, 400, 1000] {
            let mut a: Welford = x[..cut].iter().copied().collect();
            a.merge(&x[cut..].iter().copied().collect());
            assert_eq!(a.count(), 1000);
            close(a.mean(), whole.mean(), 1e-15);
            close(a.variance(), whole.variance(), 1e-6);
        }
        assert!(Welford::default().standard_error().is_nan());
    }

    #[test]
    fn critical_values_of_the_tables() {
        // 5 % and 0.1 % points of chi-square, t and z from the usual tables.
        close(gamma_q(0.5, 3.841_458_821 / 2.0), 0.05, 1e-9);
        close(gamma_q(5.0, 29.588_298_445 / 2.0), 0.001, 1e-9);
        close(gamma_q(50.0, 124.342_113_4 / 2.0), 0.05, 1e-8);
        let with = |n: usize, t: f64| {
            // n numbers with mean 0 whose standard error is 1 by construction, tested against -t.
            let d = ((n * (n - 1)) as f64 / (n - n % 2) as f64).sqrt();
            let sign = |i: usize| {
                if i >= n - n % 2 {
                    0.0
                } else if i.is_multiple_of(2) {
                    1.0
                } else {
                    -1.0
                }
            };
            student_t_test(&(0..n).map(|i| d * sign(i)).collect(), -t)
        };
        close(with(2, 12.706_204_736).p_value, 0.05, 1e-9);
        close(with(11, 2.228_138_852).p_value, 0.05, 1e-9);
        close(with(31, 3.645_958_635).p_value, 0.001, 1e-8);
        close(z_test(1.959_963_985 * 3.0, 9.0).p_value, 0.05, 1e-8);
        assert_eq!(z_test(0.0, 0.0).p_value, 1.0);
        assert_eq!(z_test(0.1, 0.0).p_value, 0.0);
    }

    #[test]
    fn quantile_inverts_cdf() {
        close(normal_quantile(0.975), 1.959_963_984_540_054, 1e-12);
        close(normal_quantile(1e-9), -5.997_807_015_007_686, 1e-12);
        for p in [1e-12, 0.02, 0.4, 0.5, 0.77, 0.999] {
            assert!((normal_cdf(normal_quantile(p)) - p).abs() < 1e-14 + 1e-12 * p, "{p}");
        }
        assert_eq!(normal_quantile(0.0), f64::NEG_INFINITY);
        assert!(normal_quantile(1.5).is_nan());
    }

    #[test]
    fn t_quantiles_of_the_tables() {
        // scipy.stats.t.ppf
        close(student_t_quantile(0.975, 1.0), 12.706_204_736_174_694, 1e-10);
        close(student_t_quantile(0.975, 10.0), 2.228_138_851_986_274, 1e-10);
        close(student_t_quantile(0.995, 30.0), 2.749_995_653_567_225_4, 1e-10);
        close(student_t_quantile(0.025, 158.0), -1.975_092_072_712_084_6, 1e-10);
        close(student_t_quantile(0.975, 1e12), 1.959_963_984_540_054, 1e-10);
        assert_eq!(student_t_quantile(0.5, 7.0), 0.0);
        // Cauchy's distribution has a closed form.
        close(student_t_quantile(0.9, 1.0), (0.4 * std::f64::consts::PI).tan(), 1e-12);
        assert!(student_t_quantile(1.0, 3.0).is_nan() && student_t_quantile(0.9, 0.0).is_nan());
    }

    #[test]
    fn mendels_peas() {
        // 315, 101, 108, 32 against 9:3:3:1: chi-square 0.470, 3 degrees of freedom, p 0.925.
        let expected = [9.0, 3.0, 3.0, 1.0].map(|k| 556.0 * k / 16.0);
        let r = chi_square_test(&[315.0, 101.0, 108.0, 32.0], &expected, 5.0);
        close(r.statistic, 0.470_023_98, 1e-7);
        assert_eq!(r.degrees_of_freedom, 3.0);
        close(r.p_value, 0.925_426, 1e-5);
    }

    #[test]
    fn sparse_bins_are_pooled() {
        let r = chi_square_test(&[1.0, 0.0, 6.0, 2.0, 91.0], &[2.0, 1.5, 2.0, 4.0, 90.5], 5.0);
        // {1.5, 2, 2} and {4, 90.5}: 4 alone is below 5.
        assert_eq!(r.degrees_of_freedom, 1.0);
        close(r.statistic, 2.25 / 5.5 + 2.25 / 94.5, 1e-12);
        assert_eq!(chi_square_test(&[3.0], &[3.0], 5.0).p_value, 1.0);
    }

    #[test]
    fn p_values_are_uniform_under_the_hypothesis() {
        // 400 experiments of 1000 throws into 20 bins, tested for fairness; then the p values themselves.
        let experiments = 400;
        let mut p_bins = [0.0; 10];
        for e in 0..experiments {
            let mut bins = [0.0; 20];
            for i in 0..1000 {
                let u = Sampler::new(17, UVec2::new(i, e), 0).next_1d();
                bins[(u * 20.0) as usize] += 1.0;
            }
            let p = chi_square_test(&bins, &[50.0; 20], 5.0).p_value;
            p_bins[((p * 10.0) as usize).min(9)] += 1.0;
        }
        let r = chi_square_test(&p_bins, &[f64::from(experiments) / 10.0; 10], 5.0);
        assert!(r.p_value > 1e-3, "{p_bins:?} {r:?}");
    }

    #[test]
    fn sidak_undoes_the_many() {
        close(1.0 - (1.0 - sidak(0.05, 20)).powi(20), 0.05, 1e-12);
        close(sidak(1e-3, 1), 1e-3, 1e-12);
    }
}

//! Profile-likelihood intervals: how far a parameter can go while the others make up for it.
//!
//! Model: with the parameter held at v and all others fitted again, 2 cost(v) - 2 cost_min rises from 0; the interval ends where
//! it reaches q c / h, or at the parameter's bound if that comes first.
//!
//! - h: the parameter's diagonal of H^-1, c: of the covariance (see [`super::covariance`]); c / h is the error variance
//!   chi2 / (N - V) for the scaled kind, 1 for the absolute one
//! - q: square of Student's t quantile with N - V degrees of freedom (the F test with 1 and N - V), of the normal one for
//!   the absolute kind
//!
//! For a linear model it is the value +- t standard errors. The rise is nearly quadratic, so its root is nearly linear and the
//! end is found by bracketing and Illinois' rule with at most 100 fits per end, to 1e-6 of the half width; each starts
//! from the line through the minimum and the last fit. Guarded by `linear_profiles_are_student_intervals`, `profiles_stop_at_bounds`,
//! `profiles_agree_with_lmfit`. Source: Venzon and Moolgavkar 1988, Applied Statistics 37:87.

use super::End;
use super::search::Objective;
use super::solve::{Effort, Solution, solve};

/// Fits on the way out of the minimum, and between the brackets.
const OUTWARDS: usize = 60;
const INWARDS: usize = 40;
/// How near to the level an end must be, in half widths.
const TOLERANCE: f64 = 1e-6;

/// A minimum and the rise of 2 cost that ends the interval of one of its variables.
pub(crate) struct Profile<'a> {
    pub(crate) objective: &'a Objective<'a>,
    pub(crate) best: &'a Solution,
    pub(crate) variable: usize,
    pub(crate) rise: f64,
    /// How the other variables follow this one near the minimum.
    pub(crate) direction: Vec<f64>,
    /// Likely half width, if known.
    pub(crate) guess: Option<f64>,
}

/// Both ends, and what the fits on the way brought.
pub(crate) struct Ends {
    pub(crate) low: End,
    pub(crate) high: End,
    pub(crate) evaluations: usize,
    /// A better minimum, if one was met.
    pub(crate) better: Option<Solution>,
}

impl Profile<'_> {
    pub(crate) fn ends(&self) -> Ends {
        let mut ends = Ends {
            low: End::Limit(self.best.x[self.variable]),
            high: End::Limit(self.best.x[self.variable]),
            evaluations: 0,
            better: None,
        };
        ends.low = self.end(-1.0, &mut ends);
        ends.high = self.end(1.0, &mut ends);
        ends
    }

    /// The end on one side.
    fn end(&self, side: f64, met: &mut Ends) -> End {
        let (lower, upper) = self.objective.problem.layout.bounds();
        let value = self.best.x[self.variable];
        let bound = if side < 0.0 { lower[self.variable] } else { upper[self.variable] };
        let room = (bound - value).abs();
        if room == 0.0 {
            return End::Bound(bound);
        }
        if !(self.rise > 0.0 && self.rise.is_finite()) {
            return End::Limit(value);
        }
        let guess = self.guess.filter(|g| *g > 0.0).unwrap_or(0.05 * room);
        let mut distance = guess.min(room);
        // Change of all variables per unit of this one, on this side.
        let mut follow = self.direction.clone();
        // (distance, root of the relative rise)
        let (mut inner, mut outer) = ((0.0, 0.0), None);
        for _ in 0..OUTWARDS {
            let u = self.root_of_rise(value + side * distance, &mut follow, met);
            if u > 1.0 {
                outer = Some((distance, u));
                break;
            }
            inner = (distance, u);
            if distance >= room {
                return End::Bound(bound);
            }
            let factor = if u > 0.0 { (1.1 / u).clamp(1.3, 10.0) } else { 10.0 };
            distance = (distance * factor).min(room);
        }
        let Some(mut outer) = outer else { return End::Limit(value + side * inner.0) };
        let (mut fi, mut fo) = (inner.1 - 1.0, outer.1 - 1.0);
        for _ in 0..INWARDS {
            let at = inner.0 + (outer.0 - inner.0) * (fi / (fi - fo));
            let middle = if at > inner.0 && at < outer.0 { at } else { 0.5 * (inner.0 + outer.0) };
            let f = self.root_of_rise(value + side * middle, &mut follow, met) - 1.0;
            if f.abs() <= TOLERANCE {
                return End::Limit(value + side * middle);
            }
            // Illinois: where one end stays, its weight is halved.
            if f > 0.0 {
                (outer, fo) = ((middle, f), f);
                fi *= 0.5;
            } else {
                (inner, fi) = ((middle, f), f);
                fo *= 0.5;
            }
            if outer.0 - inner.0 <= 1e-12 * room {
                break;
            }
        }
        End::Limit(value + side * inner.0)
    }

    /// sqrt(rise at the value / rise of the level), all other variables fitted again from the line `follow`.
    fn root_of_rise(&self, value: f64, follow: &mut [f64], met: &mut Ends) -> f64 {
        let (mut lower, mut upper) = self.objective.problem.layout.bounds();
        let value = value.clamp(lower[self.variable], upper[self.variable]);
        (lower[self.variable], upper[self.variable]) = (value, value);
        let change = value - self.best.x[self.variable];
        if change == 0.0 {
            return 0.0;
        }
        let guess: Vec<f64> = self.best.x.iter().zip(follow.iter()).map(|(x, f)| x + f * change).collect();
        let residuals = self.objective.residuals();
        let fit = solve(&residuals, &guess, (&lower, &upper), &self.objective.loss, Effort::WARM);
        met.evaluations += fit.evaluations;
        if !fit.cost.is_finite() {
            return 1e6;
        }
        for ((f, x), best) in follow.iter_mut().zip(&fit.x).zip(&self.best.x) {
            *f = (x - best) / change;
        }
        let rise = 2.0 * (fit.cost - self.best.cost);
        let known = met.better.as_ref().map_or(self.best.cost, |b| b.cost);
        if fit.cost < known - 1e-9 * self.best.cost {
            met.better = Some(fit);
        }
        (rise.max(0.0) / self.rise).sqrt()
    }
}

//! How well a minimum is determined: covariance, standard errors, and what the data cannot tell.
//!
//! Model: with J and r (weighted, scaled by the loss) at the minimum, over the V varied parameters that are not at a bound,
//! H = J^T J:
//!
//! - scaled: C = H^-1 chi2 / (N - V) (what lmfit and SciPy's `curve_fit` report)
//! - absolute: C = H^-1
//! - sandwich: C = H^-1 (sum_i r_i^2 J_i^T J_i) H^-1 N / (N - V) (White 1980, HC1)
//!
//! The columns of J are scaled to length one and decomposed into singular values. Those below 1e-8 of the largest
//! belong to combinations that the data do not determine: parameters that take part in them have no standard error,
//! the others' come from the pseudo-inverse. Guarded by `a_straight_line_has_the_textbook_covariance`,
//! `sandwich_is_whites_estimate`, `identical_lobes_are_undetermined`. Source: White 1980, Econometrica 48:817.

use nalgebra::{DMatrix, DVector, SVD};

use super::loss::ScaledLoss;
use super::options::Covariance;
use super::solve::{Solution, triangle};

/// Singular values below this share of the largest are zero.
const RANK: f64 = 1e-8;
/// Share of a parameter's unit vector in undetermined directions from which on it is undetermined.
const SHARE: f64 = 1e-6;

/// What is known of each free variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Knowledge {
    Determined,
    AtLower,
    AtUpper,
    /// The readings do not depend on it.
    NoEffect,
    /// Only together with others.
    OnlyCombined,
}

/// Second moments of a minimum.
pub(crate) struct Uncertainty {
    pub(crate) knowledge: Vec<Knowledge>,
    /// Covariance of all free variables, zero for those not determined; `None` without freedom left.
    pub(crate) covariance: Option<DMatrix<f64>>,
    /// H^-1, likewise.
    pub(crate) inverse: DMatrix<f64>,
    /// Share of each reading in its own fitted value.
    pub(crate) leverage: Vec<f64>,
}

impl Uncertainty {
    pub(crate) fn new(
        at: &Solution,
        (lower, upper): (&[f64], &[f64]),
        loss: &ScaledLoss,
        kind: Covariance,
        groups: &[Vec<usize>],
    ) -> Self {
        let (n, k) = at.jacobian.shape();
        let (mut residuals, mut jacobian) = (at.residuals.clone(), at.jacobian.clone());
        loss.linearise(&mut residuals, &mut jacobian, 0.0);
        let mut knowledge: Vec<Knowledge> = (0..k)
            .map(|i| match at.x[i] {
                x if x <= lower[i] => Knowledge::AtLower,
                x if x >= upper[i] => Knowledge::AtUpper,
                _ => Knowledge::Determined,
            })
            .collect();
        let inside: Vec<usize> = (0..k).filter(|&i| knowledge[i] == Knowledge::Determined).collect();
        let inverse = inverse(&jacobian, &inside, groups, &mut knowledge);
        // (J H^-1) row by row: leverages, and the sandwich's half.
        let influence = &jacobian * &inverse;
        let leverage = (0..n).map(|i| influence.row(i).dot(&jacobian.row(i)).clamp(0.0, 1.0)).collect();
        let freedom = n as f64 - k as f64;
        let covariance = match kind {
            Covariance::Absolute => Some(inverse.clone()),
            _ if freedom <= 0.0 => None,
            Covariance::Scaled => {
                let chi2: f64 = at.residuals.iter().map(|r| r * r).sum();
                Some(&inverse * (chi2 / freedom))
            }
            Covariance::Sandwich => {
                let mut scores = influence;
                for (mut row, r) in scores.row_iter_mut().zip(&residuals) {
                    row.scale_mut(*r);
                }
                Some(scores.tr_mul(&scores) * (n as f64 / freedom))
            }
        };
        Self { knowledge, covariance, inverse, leverage }
    }

    /// Standard error of a free variable.
    pub(crate) fn standard_error(&self, variable: usize) -> Option<f64> {
        if self.knowledge[variable] != Knowledge::Determined {
            return None;
        }
        let variance = self.covariance.as_ref()?[(variable, variable)];
        (variance >= 0.0 && variance.is_finite()).then(|| variance.sqrt())
    }

    /// Correlation of two free variables.
    pub(crate) fn correlation(&self, a: usize, b: usize) -> Option<f64> {
        let product = self.standard_error(a)? * self.standard_error(b)?;
        let covariance = self.covariance.as_ref()?[(a, b)];
        (product > 0.0).then(|| (covariance / product).clamp(-1.0, 1.0))
    }
}

/// Pseudo-inverse of J^T J over the columns `inside`; marks what is not determined and leaves its rows zero.
fn inverse(
    jacobian: &DMatrix<f64>,
    inside: &[usize],
    groups: &[Vec<usize>],
    knowledge: &mut [Knowledge],
) -> DMatrix<f64> {
    let k = jacobian.ncols();
    let mut full = DMatrix::zeros(k, k);
    let length: Vec<f64> = inside.iter().map(|&i| jacobian.column(i).norm()).collect();
    let columns: Vec<usize> = (0..inside.len()).filter(|&c| length[c] > 0.0).collect();
    for c in (0..inside.len()).filter(|c| !columns.contains(c)) {
        knowledge[inside[c]] = Knowledge::NoEffect;
    }
    let used: Vec<usize> = columns.iter().map(|&c| inside[c]).collect();
    let m = used.len();
    if m == 0 {
        return full;
    }
    let (r, _) = triangle(jacobian, &DVector::zeros(jacobian.nrows()), &used, groups);
    // Square, so that V has all directions, also with fewer readings than parameters.
    let unit =
        DMatrix::from_fn(m, m, |i, j| if i < r.nrows() { r[(i, j)] / length[columns[j]] } else { 0.0 });
    let svd = SVD::try_new(unit, false, true, f64::EPSILON, 10_000);
    let parts = svd.and_then(|s| s.v_t.map(|v| (s.singular_values, v)));
    let Some((values, v_t)) = parts else {
        used.iter().for_each(|&i| knowledge[i] = Knowledge::OnlyCombined);
        return full;
    };
    let least = RANK * values.max();
    for j in 0..m {
        let lost: f64 = (0..m).filter(|&s| values[s] <= least).map(|s| v_t[(s, j)].powi(2)).sum();
        if lost > SHARE {
            knowledge[used[j]] = Knowledge::OnlyCombined;
        }
    }
    for a in 0..m {
        for b in 0..m {
            if knowledge[used[a]] != Knowledge::Determined || knowledge[used[b]] != Knowledge::Determined {
                continue;
            }
            let kept = (0..m).filter(|&s| values[s] > least);
            let sum: f64 = kept.map(|s| v_t[(s, a)] * v_t[(s, b)] / (values[s] * values[s])).sum();
            full[(used[a], used[b])] = sum / (length[columns[a]] * length[columns[b]]);
        }
    }
    full
}

//! Classes that say the right thing about every lamp.
//!
//! Model: within a class the ways still depend a little on where light comes from and goes to. Weights of the classes,
//! tau_k(a) sqrt-wise for both directions, i'_k(a, b) = i_k(a, b) sqrt(tau_k(a) tau_k(b)), make the totals of each direction a and way
//! out right for a set of absorption coefficients mu_m (and without any):
//!
//! ```text
//! sum over k of p_k tau_k e_k(mu_m) = measured share left,    p_k: total of class k by the table
//! least sum of p_k (tau_k - 1)^2:  tau_k = 1 + sum over m of c_m e_km,  (E^T P E + eps p I) c = residual
//! ```
//!
//! The square root leaves half of what only one of the directions needs, so this is done several times. The products are
//! symmetric: the table stays reciprocal.
//!
//! | symbol | in code | default |
//! |---|---|---|
//! | eps | `ridge` | 1e-2: less lets single classes run away |
//! | times | `passes` | 8 |
//! | bounds of tau | [`LEAST`], [`MOST`] in one pass | 0.5, 2 |
//!
//! Guarded by `cells_recoloured_as_absorbed_on_the_way`. Source: our reading (calibration of quadrature weights to moments).

use nalgebra::{DMatrix, DVector};

use super::{AngularTable, Part};

const LEAST: f64 = 0.5;
const MOST: f64 = 2.0;

/// Measured share of the walks from a polar bin of a side that is left on a way out (0 back, 1 through), per set of
/// coefficients: `targets[side * thetas + a][way][m]`.
pub(super) type Targets = Vec<[Vec<f64>; 2]>;

/// Totals of each class by the table, in the same order.
pub(super) fn class_totals(table: &AngularTable) -> Vec<[Vec<f64>; 2]> {
    let thetas = table.grid.thetas;
    (0..2 * thetas)
        .map(|i| {
            let (own, adaxial) = if i < thetas { (Part::Adaxial, true) } else { (Part::Abaxial, false) };
            [table.projected(own, i % thetas, true), table.projected(Part::Through, i % thetas, adaxial)]
        })
        .collect()
}

/// Weighs the classes of a table. `left[m][k]` is e_k(mu_m).
pub(super) fn calibrate(
    table: &mut AngularTable,
    left: &[Vec<f64>],
    targets: &Targets,
    (passes, ridge): (usize, f64),
) {
    let thetas = table.grid.thetas;
    let per_bin = table.grid.phis * table.classes;
    for _ in 0..passes {
        let weights: Vec<[Vec<f32>; 2]> = class_totals(table)
            .iter()
            .zip(targets)
            .map(|(totals, targets)| [0, 1].map(|way| weights(&totals[way], left, &targets[way], ridge)))
            .collect();
        for (part, way, first, second) in
            [(Part::Adaxial, 0, 0, 0), (Part::Abaxial, 0, thetas, thetas), (Part::Through, 1, 0, thetas)]
        {
            for a in 0..thetas {
                for b in 0..thetas {
                    let (x, y) = (&weights[first + a][way], &weights[second + b][way]);
                    let start = table.offset(part, a, b, 0);
                    for bin in table.values[start..start + per_bin].chunks_exact_mut(table.classes) {
                        // One product for both orders: the table stays exactly symmetric.
                        bin.iter_mut().zip(x.iter().zip(y)).for_each(|(v, (x, y))| *v *= x * y);
                    }
                }
            }
        }
    }
}

/// Square roots of tau for one direction and way out; one where nothing can be solved.
fn weights(totals: &[f64], left: &[Vec<f64>], targets: &[f64], ridge: f64) -> Vec<f32> {
    let all: f64 = totals.iter().sum();
    let ones = || vec![1.0; totals.len()];
    if all <= 0.0 || targets[0] <= 0.0 {
        return ones();
    }
    let dot = |a: &[f64], b: &[f64]| -> f64 {
        totals.iter().zip(a.iter().zip(b)).map(|(p, (a, b))| p * a * b).sum()
    };
    let n = left.len();
    let damping = |i, j| if i == j { ridge * all } else { 0.0 };
    let matrix = DMatrix::from_fn(n, n, |i, j| dot(&left[i], &left[j]) + damping(i, j));
    let now = |m: usize| -> f64 { totals.iter().zip(&left[m]).map(|(p, e)| p * e).sum() };
    let residual = DVector::from_fn(n, |m, _| targets[m] * all / targets[0] - now(m));
    let Some(factors) = matrix.cholesky() else { return ones() };
    let c = factors.solve(&residual);
    (0..totals.len())
        .map(|k| {
            let tau = 1.0 + (0..n).map(|m| c[m] * left[m][k]).sum::<f64>();
            tau.clamp(LEAST, MOST).sqrt() as f32
        })
        .collect()
}

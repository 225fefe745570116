//! Nonlinear equations: as many unknowns as residuals, a few of each.
//!
//! Model: Levenberg-Marquardt. Each step solves (J^T J + m D) dp = -J^T r with D the diagonal of J^T J; the
//! damping m falls when a step helps and grows when it does not. Derivatives are central differences, so
//! the residual must be smooth and cheap. Where there is no root it ends at a least-squares fit, or after 60
//! steps. Guarded by `finds_a_root`, `without_a_root_it_fits`. Source: Marquardt 1963, SIAM J. 11:431.

/// Root of `residual` from the start `p`, and the length of the residual there; it stops below `goal`.
pub fn levenberg_marquardt<const N: usize>(
    mut p: [f64; N],
    goal: f64,
    residual: impl Fn(&[f64; N]) -> [f64; N],
) -> ([f64; N], f64) {
    let square = |r: &[f64; N]| r.iter().map(|v| v * v).sum::<f64>();
    let mut r = residual(&p);
    let mut error = square(&r);
    let mut damping = 1e-2;
    for _ in 0..60 {
        if error <= goal * goal {
            break;
        }
        // jacobian[j][i] = d r_i / d p_j
        let jacobian: [[f64; N]; N] = std::array::from_fn(|j| {
            let h = 1e-6 * (1.0 + p[j].abs());
            let (mut above, mut below) = (p, p);
            above[j] += h;
            below[j] -= h;
            let (a, b) = (residual(&above), residual(&below));
            std::array::from_fn(|i| (a[i] - b[i]) / (2.0 * h))
        });
        let dot = |a: &[f64; N], b: &[f64; N]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let normal: [[f64; N]; N] =
            std::array::from_fn(|i| std::array::from_fn(|j| dot(&jacobian[i], &jacobian[j])));
        let gradient: [f64; N] = std::array::from_fn(|i| -dot(&jacobian[i], &r));
        let trace: f64 = (0..N).map(|i| normal[i][i]).sum();
        let mut improved = false;
        for _ in 0..12 {
            let mut damped = normal;
            for (i, row) in damped.iter_mut().enumerate() {
                row[i] += damping * (row[i] + 1e-9 * trace);
            }
            let step = solve_positive(damped, gradient);
            let next: [f64; N] = std::array::from_fn(|i| p[i] + step[i]);
            let next_r = residual(&next);
            let next_error = square(&next_r);
            if next_error < error {
                (p, r, error) = (next, next_r, next_error);
                damping = (damping / 5.0).max(1e-12);
                improved = true;
                break;
            }
            damping *= 4.0;
        }
        if !improved {
            break;
        }
    }
    (p, error.sqrt())
}

/// Solves a symmetric positive definite system by elimination (which needs no pivoting for these).
fn solve_positive<const N: usize>(mut a: [[f64; N]; N], mut b: [f64; N]) -> [f64; N] {
    for k in 0..N {
        let (pivot, pivot_b) = (a[k], b[k]);
        for i in k + 1..N {
            let f = a[i][k] / pivot[k];
            for (v, p) in a[i].iter_mut().zip(&pivot).skip(k) {
                *v -= f * p;
            }
            b[i] -= f * pivot_b;
        }
    }
    for k in (0..N).rev() {
        for j in k + 1..N {
            b[k] -= a[k][j] * b[j];
        }
        b[k] /= a[k][k];
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_a_root() {
        // Rosenbrock's valley from its usual start, and a system with a known root.
        let (p, rest) =
            levenberg_marquardt([-1.2, 1.0], 1e-10, |p| [10.0 * (p[1] - p[0] * p[0]), 1.0 - p[0]]);
        assert!(rest <= 1e-10 && (p[0] - 1.0).abs() < 1e-9 && (p[1] - 1.0).abs() < 1e-9, "{p:?} {rest}");
        let (p, rest) = levenberg_marquardt([0.0; 3], 1e-12, |p| {
            [p[0].exp() + p[1] - 1.5, p[1] + p[2] * p[2] - 0.5, p[0] + p[2]]
        });
        assert!(rest < 1e-12 && p[0].abs() < 1e-9 && (p[1] - 0.5).abs() < 1e-9, "{p:?} {rest}");
    }

    #[test]
    fn without_a_root_it_fits() {
        // x = 1 and x = 2: the least squares lie at 1.5; y is free of x.
        let (p, rest) =
            levenberg_marquardt([9.0, 5.0, 0.0], 1e-12, |p| [p[0] - 1.0, p[0] - 2.0, p[1] + p[2]]);
        assert!((p[0] - 1.5).abs() < 1e-6 && (rest - 0.5f64.sqrt()).abs() < 1e-9, "{p:?} {rest}");
    }
}

//! Non-negative least squares.
//!
//! Model: the x >= 0 that minimises |A x - b|, by the active-set method of Lawson and Hanson: columns enter one at a time,
//! the one with the steepest descent first; the entered ones are solved by QR, and leave again where they would turn
//! negative. Columns are scaled to length one, so units do not decide. A column that depends on those that have entered
//! never enters. Guarded by `agrees_with_scipy` and `dependent_columns_are_left_out`. Source: Lawson and Hanson 1974,
//! *Solving Least Squares Problems*, chapter 23.

use nalgebra::{DMatrix, DVector};

/// Descent, relative to the lengths of column and right side, below which no column enters.
const TOLERANCE: f64 = 1e-13;

/// The `x >= 0` that minimises `|a x - b|`. Zero for what is not finite.
pub(crate) fn nnls(a: &DMatrix<f64>, b: &DVector<f64>) -> DVector<f64> {
    let n = a.ncols();
    let mut x = DVector::zeros(n);
    let length: Vec<f64> = a.column_iter().map(|c| c.norm()).collect();
    let size = b.norm();
    if !(size > 0.0 && size.is_finite()) || length.iter().any(|l| !l.is_finite()) {
        return x;
    }
    let mut unit = a.clone();
    for (mut column, l) in unit.column_iter_mut().zip(&length) {
        if *l > 0.0 {
            column.unscale_mut(*l);
        }
    }
    let (mut entered, mut barred): (Vec<usize>, Vec<usize>) = (Vec::new(), Vec::new());
    // Each column may enter a few times; a cycle by rounding ends here with a feasible point.
    for _ in 0..10 * n + 10 {
        let descent = unit.tr_mul(&(b - &unit * &x));
        let next = (0..n)
            .filter(|j| !entered.contains(j) && !barred.contains(j) && descent[*j] > TOLERANCE * size)
            .max_by(|i, j| descent[*i].total_cmp(&descent[*j]));
        let Some(next) = next else { break };
        entered.push(next);
        loop {
            let Some(z) = solve(&unit, &entered, b) else {
                entered.retain(|j| *j != next);
                barred.push(next);
                break;
            };
            // How far from x to z before the first turns negative?
            let blocking = entered
                .iter()
                .zip(z.iter())
                .filter(|(_, z)| **z <= 0.0)
                .map(|(&j, z)| if x[j] > *z { x[j] / (x[j] - z) } else { 0.0 })
                .fold(1.0, |a: f64, t: f64| if a < t { a } else { t });
            let full = z.iter().all(|z| *z > 0.0);
            for (&j, z) in entered.iter().zip(z.iter()) {
                x[j] = if full { *z } else { x[j] + blocking * (z - x[j]) };
            }
            if full {
                break;
            }
            let before = entered.len();
            entered.retain(|&j| {
                let stays = x[j] > 1e-14 * size;
                if !stays {
                    x[j] = 0.0;
                }
                stays
            });
            if entered.is_empty() || entered.len() == before {
                break;
            }
        }
    }
    unscale(x, &length)
}

/// Back to columns of their own length.
fn unscale(mut x: DVector<f64>, length: &[f64]) -> DVector<f64> {
    x.iter_mut().zip(length).for_each(|(x, l)| *x = if *l > 0.0 { *x / l } else { 0.0 });
    x
}

/// Least squares over some columns; `None` where they are dependent.
fn solve(unit: &DMatrix<f64>, columns: &[usize], b: &DVector<f64>) -> Option<DVector<f64>> {
    if columns.len() > unit.nrows() {
        return None;
    }
    let qr = unit.select_columns(columns).qr();
    let r = qr.r();
    if r.diagonal().iter().any(|d| d.abs() < 1e-12) {
        return None;
    }
    let mut rhs = b.clone();
    qr.q_tr_mul(&mut rhs);
    let z = r.solve_upper_triangular(&rhs.rows(0, columns.len()).into_owned())?;
    z.iter().all(|z| z.is_finite()).then_some(z)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `sin(1.3 i + 0.7 j^2 + 0.2 i j) + 0.4` and `cos(0.9 i) + 0.3`, i to 8, j to 5.
    fn problem() -> (DMatrix<f64>, DVector<f64>) {
        let a = DMatrix::from_fn(8, 5, |i, j| {
            let (i, j) = (i as f64, j as f64);
            (1.3 * i + 0.7 * j * j + 0.2 * i * j).sin() + 0.4
        });
        (a, DVector::from_fn(8, |i, _| (0.9 * i as f64).cos() + 0.3))
    }

    fn close(x: &DVector<f64>, expected: &[f64]) {
        let worst = x.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(x.len() == expected.len() && worst < 1e-7, "{x} {expected:?}");
    }

    #[test]
    fn agrees_with_scipy() {
        // scipy.optimize.nnls(A, b)
        let (a, b) = problem();
        let x = nnls(&a, &b);
        close(&x, &[0.68934663, 0.00786154, 0.19598849, 0.16777348, 0.0]);
        assert!(((&a * &x - &b).norm() - 1.401_748_354_325_031).abs() < 1e-12);
        // A = exp(-0.1 i (j + 1)), b = A (1, 0, 2, 0, 0, 0.5) + 0.01 cos(3 i), i to 20, j to 6.
        let a = DMatrix::from_fn(20, 6, |i, j| (-0.1 * i as f64 * (j + 1) as f64).exp());
        let truth = DVector::from_vec(vec![1.0, 0.0, 2.0, 0.0, 0.0, 0.5]);
        let b = &a * truth + DVector::from_fn(20, |i, _| 0.01 * (3.0 * i as f64).cos());
        let x = nnls(&a, &b);
        close(&x, &[0.99351622, 0.0505326, 1.92363263, 0.0, 0.0, 0.53931861]);
    }

    #[test]
    fn dependent_columns_are_left_out() {
        let (mut a, b) = problem();
        let (first, second) = (a.column(0).into_owned(), a.column(1).into_owned());
        a.set_column(3, &(&first * 2.0));
        a.set_column(4, &(&first + &second));
        let x = nnls(&a, &b);
        assert!(x.iter().all(|x| *x >= 0.0 && x.is_finite()), "{x}");
        // The norm of scipy.optimize.nnls; many x have it.
        assert!(((&a * &x - &b).norm() - 1.436_536_978_955_672_1).abs() < 1e-12);
        // A copy of a column takes no part; a column of zeros neither.
        a.set_column(3, &first);
        a.set_column(1, &DVector::zeros(8));
        let x = nnls(&a, &b);
        assert!(x[1] == 0.0 && (x[0] == 0.0 || x[3] == 0.0), "{x}");
    }

    #[test]
    fn odd_input_gives_zeros() {
        let (a, b) = problem();
        close(&nnls(&a, &b.map(|v| -v.abs() - 1.0)), &[0.0; 5]);
        close(&nnls(&a, &DVector::zeros(8)), &[0.0; 5]);
        close(&nnls(&a, &DVector::from_element(8, f64::NAN)), &[0.0; 5]);
        close(&nnls(&DMatrix::zeros(8, 2), &b), &[0.0; 2]);
        // More columns than rows.
        let wide = a.rows(0, 3).into_owned();
        let x = nnls(&wide, &b.rows(0, 3).into_owned());
        assert!(x.iter().all(|x| *x >= 0.0 && x.is_finite()), "{x}");
    }
}

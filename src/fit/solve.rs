//! Nonlinear least squares within bounds.
//!
//! Model: Levenberg-Marquardt. At x with residuals r and Jacobian J (both scaled by the loss) a step s minimises
//! |r + J s|^2 + damping |D s|^2 within lower <= x + s <= upper; D holds the largest lengths that J's columns
//! have had (More 1978). Variables at a bound whose gradient points outward are held until it turns; those that the
//! step would carry through a bound stop there and the others are solved again. The damping falls where the
//! quadratic model foretells the gain and rises where a step fails. Systems are solved by QR, never through J^T J.
//!
//! The exact search ends where no gradient is left (cosine between residual and every free column below 1e-15), where steps or
//! the sum of squares fall below rounding, or after 1000 steps. Near rounding, where sums of squares can no longer be
//! compared, steps continue while that cosine falls: parameters are found to about 1e-9 of their standard errors.
//! Limits: a local minimum, guarded by `valleys_and_bounds`; values that are not finite count as infinitely bad, guarded
//! by `nonsense_ends`. Sources: Marquardt 1963, SIAM J. 11:431; More 1978, *The Levenberg-Marquardt algorithm*.

use nalgebra::{DMatrix, DVector};

use super::loss::ScaledLoss;

/// Steps after which a search ends without convergence.
const MAX_STEPS: usize = 1000;
/// Gain, relative to the cost, below which costs are not compared.
const ROUNDING: f64 = 1e-12;

/// Least curvature of a robust loss, as a share of its slope.
const CURVATURE: f64 = 0.1;
/// How a search begins and ends.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Effort {
    /// Damping of the first step.
    damping: f64,
    /// It ends where a nearly undamped step promises less than this share of the cost.
    stop: f64,
}

impl Effort {
    /// From anywhere, to be continued by `EXACT`.
    pub(crate) const ROUGH: Effort = Effort { damping: 1e-3, stop: 1e-8 };
    /// From near the minimum, as well as intervals need.
    pub(crate) const WARM: Effort = Effort { damping: 1e-8, stop: 1e-10 };
    /// To a few hundredths of a standard error, for models that are tables or sums of random walks.
    pub(crate) const NOISY: Effort = Effort { damping: 1e-3, stop: 1e-6 };
    /// To rounding.
    pub(crate) const EXACT: Effort = Effort { damping: 1e-3, stop: 0.0 };
}

/// What can be fitted.
pub(crate) trait Residuals: Sync {
    /// Rows of the Jacobian in groups that share few variables (the readings of one band).
    fn groups(&self) -> &[Vec<usize>];

    /// Residuals, and their derivatives (a row per residual).
    fn eval(&self, x: &[f64], residuals: &mut [f64], jacobian: &mut DMatrix<f64>);

    /// Cost below which residuals are rounding.
    fn floor(&self) -> f64;
}

/// Where a search ended.
#[derive(Clone, Debug)]
pub(crate) struct Solution {
    pub(crate) x: Vec<f64>,
    /// Half the sum of losses; infinite where the start already was nonsense.
    pub(crate) cost: f64,
    /// Not scaled by the loss.
    pub(crate) residuals: Vec<f64>,
    /// Not scaled by the loss.
    pub(crate) jacobian: DMatrix<f64>,
    pub(crate) evaluations: usize,
    pub(crate) converged: bool,
}

/// Least squares from `start` within `lower..=upper`. Variables whose bounds are equal are held.
pub(crate) fn solve(
    problem: &dyn Residuals,
    start: &[f64],
    (lower, upper): (&[f64], &[f64]),
    loss: &ScaledLoss,
    effort: Effort,
) -> Solution {
    let n: usize = problem.groups().iter().map(Vec::len).sum();
    let k = start.len();
    let x: Vec<f64> = (0..k).map(|i| start[i].clamp(lower[i], upper[i])).collect();
    let mut at = Solution {
        x,
        cost: f64::INFINITY,
        residuals: vec![0.0; n],
        jacobian: DMatrix::zeros(n, k),
        evaluations: 1,
        converged: false,
    };
    problem.eval(&at.x, &mut at.residuals, &mut at.jacobian);
    at.cost = cost(loss, &at);
    if !at.cost.is_finite() {
        return at;
    }
    let mut trial = at.clone();
    let mut longest = vec![0.0f64; k];
    let mut damping = effort.damping;
    let mut linear = Linear::new(problem, &at, loss, (lower, upper));
    'steps: for _ in 0..MAX_STEPS {
        if at.cost <= problem.floor() || linear.cosine <= 1e-15 {
            at.converged = true;
            break;
        }
        for (d, &j) in longest.iter_mut().zip(&linear.length) {
            *d = d.max(j);
        }
        let mut growth = 2.0;
        let mut accepted = false;
        // Damping doubles ever faster: 1e-18 to 1e30 in fewer tries than these.
        for _ in 0..30 {
            let step = linear.step(&at.x, (lower, upper), &longest, damping);
            for i in 0..k {
                trial.x[i] = (at.x[i] + step[i]).clamp(lower[i], upper[i]);
            }
            let taken: Vec<f64> = trial.x.iter().zip(&at.x).map(|(a, b)| a - b).collect();
            let scaled = |v: &[f64]| v.iter().zip(&longest).map(|(v, d)| (v * d).powi(2)).sum::<f64>().sqrt();
            if scaled(&taken) <= 1e-16 * scaled(&at.x) {
                break;
            }
            let expected = linear.gain(&taken);
            if damping <= 1e-4 && expected >= 0.0 && expected < effort.stop * at.cost {
                at.converged = true;
                break 'steps;
            }
            if expected > 0.0 {
                problem.eval(&trial.x, &mut trial.residuals, &mut trial.jacobian);
                trial.cost = cost(loss, &trial);
                at.evaluations += 1;
                let gain = at.cost - trial.cost;
                let noise = expected <= ROUNDING * at.cost;
                if trial.cost.is_finite() && (gain > 0.0 || noise && gain.abs() <= ROUNDING * at.cost) {
                    let next = Linear::new(problem, &trial, loss, (lower, upper));
                    if !noise || next.cosine < linear.cosine {
                        let ratio = gain / expected;
                        damping = match ratio {
                            _ if ratio > 0.75 || noise => (damping * 0.1).max(1e-18),
                            _ if ratio < 0.25 => damping * 3.0,
                            _ => damping,
                        };
                        std::mem::swap(&mut at.x, &mut trial.x);
                        std::mem::swap(&mut at.residuals, &mut trial.residuals);
                        std::mem::swap(&mut at.jacobian, &mut trial.jacobian);
                        at.cost = trial.cost;
                        linear = next;
                        accepted = true;
                        break;
                    }
                }
                if noise {
                    break;
                }
            }
            damping = (damping * growth).min(1e30);
            growth *= 2.0;
        }
        if !accepted {
            // Nothing better in reach: a minimum if the undamped model expects no more than rounding either.
            let newton = linear.step(&at.x, (lower, upper), &longest, 1e-18);
            at.converged = linear.gain(newton.as_slice()) <= 1e-9 * at.cost;
            break;
        }
    }
    at
}

/// Cost of a solution; infinite where a derivative is not finite.
fn cost(loss: &ScaledLoss, at: &Solution) -> f64 {
    if at.jacobian.iter().all(|j| j.is_finite()) { loss.cost(&at.residuals) } else { f64::INFINITY }
}

/// The problem seen from one point, by the triangle of its Jacobian.
struct Linear {
    /// Variables that may move.
    free: Vec<usize>,
    /// R of the free columns' QR.
    r: DMatrix<f64>,
    /// Q^T residuals.
    qtf: DVector<f64>,
    /// Lengths of all columns.
    length: Vec<f64>,
    /// Largest cosine between the residual and a free column.
    cosine: f64,
}

impl Linear {
    fn new(
        problem: &dyn Residuals,
        at: &Solution,
        loss: &ScaledLoss,
        (lower, upper): (&[f64], &[f64]),
    ) -> Self {
        let (mut residuals, mut jacobian) = (at.residuals.clone(), at.jacobian.clone());
        loss.linearise(&mut residuals, &mut jacobian, CURVATURE);
        let f = DVector::from_vec(residuals);
        let gradient = jacobian.tr_mul(&f);
        let length: Vec<f64> = jacobian.column_iter().map(|c| c.norm()).collect();
        let held = |i: usize| {
            lower[i] >= upper[i]
                || at.x[i] <= lower[i] && gradient[i] > 0.0
                || at.x[i] >= upper[i] && gradient[i] < 0.0
        };
        let free: Vec<usize> = (0..length.len()).filter(|&i| !held(i)).collect();
        let size = f.norm();
        let cosine = |i: &usize| {
            let product = length[*i] * size;
            if product > 0.0 { gradient[*i].abs() / product } else { 0.0 }
        };
        let cosine = free.iter().map(cosine).fold(0.0, f64::max);
        let (r, qtf) = triangle(&jacobian, &f, &free, problem.groups());
        Self { free, r, qtf, length, cosine }
    }

    /// The damped step within the bounds, for all variables.
    fn step(
        &self,
        x: &[f64],
        (lower, upper): (&[f64], &[f64]),
        longest: &[f64],
        damping: f64,
    ) -> DVector<f64> {
        let unit = |i: usize| if longest[i] > 0.0 { longest[i] } else { 1.0 };
        let mut step = DVector::zeros(x.len());
        // Positions in `free` that no bound has stopped yet.
        let mut open: Vec<usize> = (0..self.free.len()).collect();
        let mut rhs = -&self.qtf;
        while !open.is_empty() {
            let (rows, o) = (self.r.nrows(), open.len());
            let mut a = DMatrix::zeros(rows + o, o);
            for (c, &p) in open.iter().enumerate() {
                a.view_mut((0, c), (rows, 1)).copy_from(&(self.r.column(p) / unit(self.free[p])));
                a[(rows + c, c)] = damping.sqrt();
            }
            let mut b = DVector::zeros(rows + o);
            b.rows_mut(0, rows).copy_from(&rhs);
            let qr = a.qr();
            qr.q_tr_mul(&mut b);
            let Some(u) = qr.r().solve_upper_triangular(&b.rows(0, o).into_owned()) else { break };
            if u.iter().any(|u| !u.is_finite()) {
                break;
            }
            let mut stopped = Vec::new();
            for (c, &p) in open.iter().enumerate() {
                let i = self.free[p];
                let s = u[c] / unit(i);
                let within = s.clamp(lower[i] - x[i], upper[i] - x[i]);
                if s != within {
                    rhs -= self.r.column(p) * within;
                    stopped.push(p);
                }
                step[i] = within;
            }
            if stopped.is_empty() {
                break;
            }
            open.retain(|p| !stopped.contains(p));
        }
        step
    }

    /// Fall of the cost that the quadratic model expects of a step.
    fn gain(&self, step: &[f64]) -> f64 {
        let s = DVector::from_iterator(self.free.len(), self.free.iter().map(|&i| step[i]));
        let js = &self.r * s;
        -(self.qtf.dot(&js) + 0.5 * js.norm_squared())
    }
}

/// R and Q^T f of some columns. Each group of rows is reduced to a triangle of the columns that it touches first.
pub(crate) fn triangle(
    jacobian: &DMatrix<f64>,
    f: &DVector<f64>,
    columns: &[usize],
    groups: &[Vec<usize>],
) -> (DMatrix<f64>, DVector<f64>) {
    let reduce = |a: DMatrix<f64>, mut b: DVector<f64>| {
        let rows = a.nrows().min(a.ncols());
        let qr = a.qr();
        qr.q_tr_mul(&mut b);
        (qr.r(), b.rows(0, rows).into_owned())
    };
    let all = columns.len();
    let parts: Vec<(Vec<usize>, DMatrix<f64>, DVector<f64>)> = groups
        .iter()
        .map(|rows| {
            let touched: Vec<usize> =
                (0..all).filter(|&c| rows.iter().any(|&r| jacobian[(r, columns[c])] != 0.0)).collect();
            let a =
                DMatrix::from_fn(rows.len(), touched.len(), |i, c| jacobian[(rows[i], columns[touched[c]])]);
            let b = DVector::from_fn(rows.len(), |i, _| f[rows[i]]);
            let (a, b) = if touched.is_empty() { (a, DVector::zeros(0)) } else { reduce(a, b) };
            (touched, a, b)
        })
        .collect();
    let rows: usize = parts.iter().map(|p| p.2.len()).sum();
    let (mut a, mut b) = (DMatrix::zeros(rows, all), DVector::zeros(rows));
    let mut at = 0;
    for (touched, part, right) in &parts {
        for (c, &column) in touched.iter().enumerate() {
            a.view_mut((at, column), (right.len(), 1)).copy_from(&part.column(c));
        }
        b.rows_mut(at, right.len()).copy_from(right);
        at += right.len();
    }
    if rows == 0 || all == 0 { (a, b) } else { reduce(a, b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Residuals and derivatives of a small problem.
    type System = fn(&[f64]) -> (Vec<f64>, Vec<Vec<f64>>);

    struct Test {
        system: System,
        groups: Vec<Vec<usize>>,
    }

    impl Residuals for Test {
        fn groups(&self) -> &[Vec<usize>] {
            &self.groups
        }
        fn eval(&self, x: &[f64], residuals: &mut [f64], jacobian: &mut DMatrix<f64>) {
            let (r, j) = (self.system)(x);
            residuals.copy_from_slice(&r);
            for (i, row) in j.iter().enumerate() {
                row.iter().enumerate().for_each(|(k, v)| jacobian[(i, k)] = *v);
            }
        }
        fn floor(&self) -> f64 {
            0.0
        }
    }

    fn end(system: System, start: &[f64], lower: &[f64], upper: &[f64]) -> Solution {
        let n = system(start).0.len();
        let test = Test { system, groups: vec![(0..n / 2).collect(), (n / 2..n).collect()] };
        let end = solve(&test, start, (lower, upper), &ScaledLoss::LINEAR, Effort::EXACT);
        for i in 0..start.len() {
            assert!(end.x[i] >= lower[i] && end.x[i] <= upper[i], "{:?}", end.x);
        }
        end
    }

    fn close(x: &[f64], expected: &[f64], absolute: f64) {
        assert!(x.iter().zip(expected).all(|(a, b)| (a - b).abs() < absolute), "{x:?} {expected:?}");
    }

    const ROSENBROCK: System =
        |x| (vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]], vec![vec![-20.0 * x[0], 10.0], vec![-1.0, 0.0]]);
    /// Powell's singular function: the Jacobian loses rank at its minimum.
    const POWELL: System = |x| {
        let (a, b) = (x[1] - 2.0 * x[2], x[0] - x[3]);
        let (s5, s10) = (5f64.sqrt(), 10f64.sqrt());
        (
            vec![x[0] + 10.0 * x[1], s5 * (x[2] - x[3]), a * a, s10 * b * b],
            vec![
                vec![1.0, 10.0, 0.0, 0.0],
                vec![0.0, 0.0, s5, -s5],
                vec![0.0, 2.0 * a, -4.0 * a, 0.0],
                vec![2.0 * s10 * b, 0.0, 0.0, -2.0 * s10 * b],
            ],
        )
    };

    #[test]
    fn valleys_and_bounds() {
        let far = [f64::MAX; 4];
        let near = far.map(|v| -v);
        let free = end(ROSENBROCK, &[-1.2, 1.0], &near[..2], &far[..2]);
        assert!(free.converged && free.evaluations < 60, "{}", free.evaluations);
        close(&free.x, &[1.0, 1.0], 1e-12);
        // Held at x0 <= 0.8 the valley's floor is x1 = x0^2; at x1 >= 1.5 the best x0 is a root of the gradient.
        let held = end(ROSENBROCK, &[-1.2, 1.0], &[-2.0, -2.0], &[0.8, 5.0]);
        close(&held.x, &[0.8, 0.64], 1e-12);
        assert!(held.converged);
        // numpy.roots([400, 0, -598, -2])
        let held = end(ROSENBROCK, &[0.5, 4.0], &[-2.0, 1.5], &[2.0, 5.0]);
        close(&held.x, &[1.224370748736352, 1.5], 1e-9);
        // A start at the wrong bound is released.
        let freed = end(ROSENBROCK, &[2.0, -2.0], &[-2.0, -2.0], &[2.0, 2.0]);
        close(&freed.x, &[1.0, 1.0], 1e-12);
        // Equal bounds hold.
        close(&end(ROSENBROCK, &[0.3, 0.3], &[0.5, -9.0], &[0.5, 9.0]).x, &[0.5, 0.25], 1e-12);
        let powell = end(POWELL, &[3.0, -1.0, 0.0, 1.0], &near, &far);
        assert!(powell.cost < 1e-20 && powell.x.iter().all(|x| x.abs() < 1e-4), "{powell:?}");
    }

    #[test]
    fn nonsense_ends() {
        let wide = (&[-1e9, -1e9][..], &[1e9, 1e9][..]);
        let nan: System = |_| (vec![f64::NAN; 2], vec![vec![0.0; 2]; 2]);
        let flat: System = |_| (vec![1.0; 2], vec![vec![0.0; 2]; 2]);
        let lies: System = |x| (vec![x[0], x[1]], vec![vec![-1.0, 0.0], vec![0.0, -1.0]]);
        let cliff: System = |x| {
            let v = if x[0] > 0.5 { f64::INFINITY } else { 1.0 - x[0] };
            (vec![v, x[1]], vec![vec![-1.0, 0.0], vec![0.0, 1.0]])
        };
        let same: System = |x| {
            let r = x[0] + x[1] - 3.0;
            (vec![r, 2.0 * r + 1.0], vec![vec![1.0, 1.0], vec![2.0, 2.0]])
        };
        for system in [nan, flat, lies, cliff, same] {
            let end = end(system, &[0.2, 0.1], wide.0, wide.1);
            assert!(end.x.iter().all(|x| x.is_finite()) && !end.cost.is_nan(), "{end:?}");
            assert!(end.evaluations < 5000, "{}", end.evaluations);
        }
        assert!(end(flat, &[0.2, 0.1], wide.0, wide.1).converged);
        assert!(!end(lies, &[0.2, 0.1], wide.0, wide.1).converged);
        assert_eq!(end(nan, &[0.2, 0.1], wide.0, wide.1).cost, f64::INFINITY);
        // Dependent columns: a step of least length, and the best cost.
        let end = end(same, &[0.2, 0.1], wide.0, wide.1);
        assert!((end.x[0] + end.x[1] - 2.6).abs() < 1e-9 && end.converged, "{end:?}");
    }
}

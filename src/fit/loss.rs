//! Losses: how much a residual costs.
//!
//! Model: cost = C^2 / 2 sum rho((r / C)^2), as SciPy's `least_squares` defines `loss` and `f_scale`.
//!
//! - linear: rho = z
//! - soft l1: rho = 2 (sqrt(1 + z) - 1)
//! - Huber: rho = z where z <= 1, else 2 sqrt(z) - 1
//! - Cauchy: rho = ln(1 + z)
//!
//! C -> `scale` -> unit of the weighted residual. For the solver residuals and rows of the Jacobian are scaled so that
//! their products are the gradient and Triggs' approximation of the Hessian: with s = sqrt(max(rho' + 2 rho'' z, eps))
//! the row is multiplied by s, the residual by rho' / s. Guarded by `derivatives_are_right` and, against SciPy,
//! `robust_losses_agree_with_scipy`. Source: Triggs et al. 2000, "Bundle adjustment - a modern synthesis".

use nalgebra::DMatrix;

/// How a weighted residual is counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Loss {
    /// Its square: right for normal errors.
    #[default]
    Linear,
    /// A smooth mean between square and absolute value.
    SoftL1,
    /// The square below the scale, the absolute value above.
    Huber,
    /// The logarithm: outliers hardly count.
    Cauchy,
}

impl Loss {
    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Loss::Linear => "linear",
            Loss::SoftL1 => "soft L1",
            Loss::Huber => "Huber",
            Loss::Cauchy => "Cauchy",
        }
    }

    /// `[rho, rho', rho'']` at `z >= 0`.
    pub fn rho(self, z: f64) -> [f64; 3] {
        match self {
            Loss::Linear => [z, 1.0, 0.0],
            Loss::SoftL1 => {
                let root = (1.0 + z).sqrt();
                // 2 (root - 1) without cancellation.
                [2.0 * z / (root + 1.0), 1.0 / root, -0.5 / (root * root * root)]
            }
            Loss::Huber if z <= 1.0 => [z, 1.0, 0.0],
            Loss::Huber => {
                let root = z.sqrt();
                [2.0 * root - 1.0, 1.0 / root, -0.5 / (z * root)]
            }
            Loss::Cauchy => [z.ln_1p(), 1.0 / (1.0 + z), -1.0 / ((1.0 + z) * (1.0 + z))],
        }
    }
}

/// A loss with its scale.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScaledLoss {
    pub(crate) loss: Loss,
    /// C, positive.
    pub(crate) scale: f64,
}

impl ScaledLoss {
    pub(crate) const LINEAR: ScaledLoss = ScaledLoss { loss: Loss::Linear, scale: 1.0 };

    /// Half the sum of all losses; infinite where a residual is not finite.
    pub(crate) fn cost(&self, residuals: &[f64]) -> f64 {
        let c2 = self.scale * self.scale;
        let sum: f64 = residuals.iter().map(|r| c2 * self.loss.rho(r * r / c2)[0]).sum();
        if sum.is_finite() { 0.5 * sum } else { f64::INFINITY }
    }

    /// Scales residuals and the rows of their Jacobian: the gradient is exact, the curvature rho' + 2 z rho'' is kept above
    /// `floor` times rho'. With 0 (and rounding) this is SciPy's; where every residual is an outlier its curvature is none
    /// at all, and a search needs some.
    pub(crate) fn linearise(&self, residuals: &mut [f64], jacobian: &mut DMatrix<f64>, floor: f64) {
        if self.loss == Loss::Linear {
            return;
        }
        for (i, r) in residuals.iter_mut().enumerate() {
            let z = (*r / self.scale).powi(2);
            let [_, d1, d2] = self.loss.rho(z);
            let s = (d1 + 2.0 * d2 * z).max(floor * d1).max(f64::EPSILON).sqrt();
            *r *= d1 / s;
            jacobian.row_mut(i).scale_mut(s);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_right() {
        for loss in [Loss::Linear, Loss::SoftL1, Loss::Huber, Loss::Cauchy] {
            for z in [0.01, 0.5, 0.98, 1.02, 7.0, 400.0] {
                let h = 1e-5 * z;
                let (a, b, at) = (loss.rho(z - h), loss.rho(z + h), loss.rho(z));
                assert!(((b[0] - a[0]) / (2.0 * h) - at[1]).abs() < 1e-8, "{loss:?} {z}");
                assert!(((b[1] - a[1]) / (2.0 * h) - at[2]).abs() < 1e-7, "{loss:?} {z}");
            }
            assert_eq!(loss.rho(0.0)[..2], [0.0, 1.0], "{loss:?}");
            assert_eq!(ScaledLoss { loss, scale: 0.1 }.cost(&[f64::NAN]), f64::INFINITY);
        }
    }

    #[test]
    fn a_search_leaves_a_start_where_all_readings_are_outliers() {
        use std::ops::ControlFlow;

        use crate::fit::{self, Action, Options, Override, models};
        use crate::gonio::measurement::direction_deg;
        use crate::gonio::{Band, Measurement, Reading};

        // kd / pi of 0.35 with errors of one sigma and an outlier; sigma is 1 %, so 0.9 is far away for every reading.
        let (value, sigma) = (0.35 / std::f64::consts::PI, 0.0035 / std::f64::consts::PI);
        let readings =
            [0.3, -1.2, 0.8, -0.4, 1.7, -0.9, 0.1, 25.0].iter().enumerate().map(|(i, e)| Reading {
                wi: direction_deg(20.0, 0.0),
                wo: direction_deg(10.0 * i as f64, 90.0),
                series: 0,
                band: 0,
                bsdf_per_sr: value + e * sigma,
                sigma_per_sr: Some(sigma),
            });
        let m = Measurement {
            bands: vec![Band::nm(550.0)],
            series: vec!["a".into()],
            readings: readings.collect(),
            ..Default::default()
        };
        for loss in [Loss::SoftL1, Loss::Huber, Loss::Cauchy] {
            // Cauchy's loss is not convex: from above the search ends in the outlier's own minimum.
            let starts: &[f64] = if loss == Loss::Cauchy { &[0.3] } else { &[0.3, 0.9] };
            for &start in starts {
                let options = Options {
                    loss,
                    loss_scale: Some(1.0),
                    parameters: vec![Override { name: "kd".into(), action: Action::Start(start) }],
                    starts: 1,
                    ..Default::default()
                };
                let model = models::by_name("lambert").unwrap();
                let fit = fit::fit(&*model, &m, &options, &|_, _| ControlFlow::Continue(())).unwrap();
                let cost = |kd: f64| {
                    let of = |r: &Reading| (kd / std::f64::consts::PI - r.bsdf_per_sr) / sigma;
                    let residuals: Vec<f64> = m.readings.iter().map(of).collect();
                    ScaledLoss { loss, scale: 1.0 }.cost(&residuals)
                };
                // The minimum among 2e5 values near the truth.
                let kd = |i: i32| 0.34 + 1e-7 * f64::from(i);
                let best = (0..200_000).min_by(|&a, &b| cost(kd(a)).total_cmp(&cost(kd(b)))).unwrap();
                let found = fit.parameters[0].value;
                assert!(
                    fit.converged && (found - kd(best)).abs() < 2e-7,
                    "{loss:?} {start}: {found} {}",
                    kd(best)
                );
            }
        }
    }
}

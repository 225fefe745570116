//! Does `sample` draw what `pdf` says, and does `pdf` integrate to the probability that it draws at all?
//!
//! Model: the sphere is cut into bins of polar angle and azimuth; the expected share of a bin is the
//! adaptive integral of the pdf over it, the share of the bin "no sample" is one minus their sum. Pearson's
//! test with pooled bins compares them with the counts of independent samples; Sidak's level corrects for
//! the number of incidences and sides. Guarded by `tests/validate_rejects.rs`.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{UVec2, Vec3};

use super::{Bound, Case, Row, Settings, Test, Worst};
use crate::bsdf::Bsdf;
use crate::math::Sampler;
use crate::math::quadrature::GaussLegendre;
use crate::math::stats::{chi_square_test, sidak};
use crate::spectrum::SampledWavelengths;

/// Smallest expected count of a pool of bins.
const MIN_EXPECTED: f64 = 5.0;
/// Error that the integral over the whole sphere may have.
const INTEGRAL_TOLERANCE: f64 = 1e-3;

pub(super) fn sample_matches_pdf(bsdf: &dyn Bsdf, settings: &Settings) -> Row {
    let level = sidak(settings.significance, Case::count(settings));
    let mut worst = Worst::new(Bound::AtLeast(level));
    for case in Case::all(settings) {
        let n = f64::from(settings.samples);
        let mut expected: Vec<f64> = expected_shares(bsdf, &case, settings).iter().map(|p| p * n).collect();
        let mut observed = observed_counts(bsdf, &case, settings);
        let (drawn, predicted) = (observed.iter().sum::<f64>(), expected.iter().sum::<f64>());
        observed.push(n - drawn);
        expected.push((n - predicted).max(0.0));
        let r = chi_square_test(&observed, &expected, MIN_EXPECTED);
        worst.see(r.p_value, || {
            let (chi2, dof) = (r.statistic, r.degrees_of_freedom);
            format!("p value, chi-square {chi2:.1} with {dof} degrees of freedom at {}", case.describe())
        });
    }
    worst.row(Test::ChiSquare)
}

pub(super) fn pdf_integrates_to_success(bsdf: &dyn Bsdf, settings: &Settings) -> Row {
    let mut worst = Worst::new(Bound::AtMost(1.0));
    for case in Case::all(settings) {
        let n = f64::from(settings.samples);
        let integral: f64 = expected_shares(bsdf, &case, settings).iter().sum();
        let success = observed_counts(bsdf, &case, settings).iter().sum::<f64>() / n;
        let sigma = (success * (1.0 - success) / n).sqrt();
        let allowed = 4.0 * sigma + INTEGRAL_TOLERANCE;
        worst.see((integral - success).abs() / allowed, || {
            format!(
                "difference over {allowed:.2e}; pdf integrates to {integral:.5}, {success:.5} of the samples succeed at {}",
                case.describe()
            )
        });
    }
    worst.row(Test::PdfIntegral)
}

/// Integral of the pdf over every bin.
fn expected_shares(bsdf: &dyn Bsdf, case: &Case, settings: &Settings) -> Vec<f64> {
    let lambda = SampledWavelengths::visible(0.5);
    let rule = GaussLegendre::new(4);
    let (theta_bins, phi_bins) = (2 * settings.bins.0, settings.bins.1);
    let mut density = |theta: f64, phi: f64| {
        let ((sin, cos), (sin_phi, cos_phi)) = (theta.sin_cos(), phi.sin_cos());
        let wi = Vec3::new((sin * cos_phi) as f32, (sin * sin_phi) as f32, cos as f32);
        f64::from(bsdf.pdf(case.wo, wi, &lambda)) * sin
    };
    let edge = |i: usize| FRAC_PI_2 * i as f64 / settings.bins.0 as f64;
    let phi_edge = |j: usize| TAU * j as f64 / phi_bins as f64;
    let mut shares = Vec::with_capacity(theta_bins * phi_bins);
    for i in 0..theta_bins {
        for j in 0..phi_bins {
            let (theta, phi) = ([edge(i), edge(i + 1)], [phi_edge(j), phi_edge(j + 1)]);
            shares.push(rule.integrate_adaptive(theta, phi, settings.bin_tolerance, 1, &mut density));
        }
    }
    shares
}

/// Samples that fall into every bin. They are independent, as the test supposes: each is the first point of
/// its own sequence.
fn observed_counts(bsdf: &dyn Bsdf, case: &Case, settings: &Settings) -> Vec<f64> {
    let lambda = SampledWavelengths::visible(0.5);
    let (theta_bins, phi_bins) = (2 * settings.bins.0, settings.bins.1);
    let mut counts = vec![0.0; theta_bins * phi_bins];
    for k in 0..settings.samples {
        let mut sampler = Sampler::new(settings.seed, UVec2::new(k, case.index), 0);
        let u_lobe = sampler.next_1d();
        let Some(s) = bsdf.sample(case.wo, &lambda, u_lobe, sampler.next_2d()) else { continue };
        // The angle from the horizon keeps its sign exactly, so that no rounding crosses it.
        let theta = FRAC_PI_2 - f64::from(s.wi.z).atan2(f64::from(s.wi.truncate().length()));
        let phi = f64::from(s.wi.y).atan2(f64::from(s.wi.x)).rem_euclid(TAU);
        let half = settings.bins.0;
        let row = (theta / FRAC_PI_2 * half as f64) as usize;
        let i = if s.wi.z > 0.0 { row.min(half - 1) } else { row.clamp(half, theta_bins - 1) };
        let j = ((phi / TAU * phi_bins as f64) as usize).min(phi_bins - 1);
        counts[i * phi_bins + j] += 1.0;
    }
    counts
}

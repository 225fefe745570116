//! No more light out than in, and weights that say the same as the BSDF.
//!
//! The directional-hemispherical albedo is `integral of f(wo, wi) |cos(theta_i)| dwi` over the whole sphere,
//! reflection and transmission together, found by quadrature and therefore independent of `sample`.
//! Energy: it is at most 1 at wavelengths over the whole visible range. Weight: the mean of `f |cos| / pdf`
//! over samples equals it (z test, Sidak's level). Sample: what `sample` returns is what `eval` and `pdf`
//! say of the direction, a unit vector.

use glam::UVec2;

use super::{Bound, Case, Row, Settings, Test, Worst};
use crate::bsdf::{Bsdf, BsdfSample};
use crate::math::Sampler;
use crate::math::quadrature::sphere_rule;
use crate::math::stats::{Welford, sidak, z_test};
use crate::spectrum::{LANES, SampledWavelengths, VISIBLE_NM};

use glam::Vec3;

/// Error of the quadrature and of f32.
const ENERGY_TOLERANCE: f64 = 1e-3;
/// The same, as a standard deviation beside that of the samples.
const QUADRATURE_SIGMA: f64 = 1e-4;
/// Between two evaluations of the same f32 formula.
const SAMPLE_TOLERANCE: f64 = 1e-4;

pub(super) fn conserves_energy(bsdf: &dyn Bsdf, settings: &Settings) -> Row {
    let rule = sphere_rule(settings.nodes.0, settings.nodes.1);
    let mut worst = Worst::new(Bound::AtMost(1.0 + ENERGY_TOLERANCE));
    for case in Case::all(settings) {
        for lambda in wavelengths(settings) {
            let albedo = albedo(bsdf, case.wo, &lambda, &rule);
            for (a, nm) in albedo.into_iter().zip(lambda.lambda_nm()) {
                worst.see(a, || format!("largest albedo, at {nm} nm, {}", case.describe()));
            }
        }
    }
    worst.row(Test::Energy)
}

pub(super) fn mean_weight_is_albedo(bsdf: &dyn Bsdf, settings: &Settings) -> Row {
    let lambda = SampledWavelengths::visible(0.5);
    let rule = sphere_rule(settings.nodes.0, settings.nodes.1);
    let level = sidak(settings.significance, Case::count(settings) * LANES);
    let mut worst = Worst::new(Bound::AtLeast(level));
    for case in Case::all(settings) {
        let albedo = albedo(bsdf, case.wo, &lambda, &rule);
        let mut weights = [Welford::default(); LANES];
        for k in 0..settings.samples {
            let weight = sample(bsdf, &case, settings, k, &lambda).map(|s| s.weight()).unwrap_or_default();
            for (w, v) in weights.iter_mut().zip(weight.0) {
                w.push(f64::from(v));
            }
        }
        for (w, a) in weights.iter().zip(albedo) {
            let variance = w.standard_error().powi(2) + QUADRATURE_SIGMA.powi(2);
            let r = z_test(w.mean() - a, variance);
            worst.see(r.p_value, || {
                format!("p value, mean weight {:.5}, albedo {a:.5} at {}", w.mean(), case.describe())
            });
        }
    }
    worst.row(Test::Weight)
}

pub(super) fn sample_is_consistent(bsdf: &dyn Bsdf, settings: &Settings) -> Row {
    let mut worst = Worst::new(Bound::AtMost(SAMPLE_TOLERANCE));
    for case in Case::all(settings) {
        for k in 0..settings.samples.min(settings.pairs) {
            let lambda = SampledWavelengths::visible((k as f32 + 0.5) / settings.pairs as f32);
            let Some(s) = sample(bsdf, &case, settings, k, &lambda) else { continue };
            let f = bsdf.eval(case.wo, s.wi, &lambda);
            let relative =
                |a: f32, b: f32| f64::from((a - b).abs() / a.abs().max(b.abs()).max(f32::MIN_POSITIVE));
            let mut see = |value: f64, what: &str| {
                worst.see(value, || format!("{what} for wi = {:.4} at {}", s.wi, case.describe()));
            };
            see(relative(s.pdf_per_sr, bsdf.pdf(case.wo, s.wi, &lambda)), "relative difference of pdf");
            (0..LANES).for_each(|i| see(relative(s.f[i], f[i]), "relative difference of f"));
            see(f64::from((s.wi.length() - 1.0).abs()), "excess of the length");
            see(if s.pdf_per_sr > 0.0 { 0.0 } else { f64::INFINITY }, "pdf not positive");
        }
    }
    if worst.value.is_none() {
        // A model that absorbs everything draws no sample; there is nothing to be wrong.
        worst.see(0.0, || "no sample was drawn".into());
    }
    worst.row(Test::Sample)
}

/// Sets of wavelengths that cover the visible range at the settings' distance.
fn wavelengths(settings: &Settings) -> Vec<SampledWavelengths> {
    let (low, high) = VISIBLE_NM;
    let count = ((high - low) / settings.wavelength_step_nm.max(0.1)).ceil() as usize + 1;
    let at = |i: usize| (low + (high - low) * i as f32 / (count - 1).max(1) as f32).min(high);
    (0..count.div_ceil(LANES))
        .map(|set| SampledWavelengths::given(std::array::from_fn(|lane| at(set * LANES + lane))))
        .collect()
}

/// Albedo per lane.
pub(super) fn albedo(
    bsdf: &dyn Bsdf,
    wo: Vec3,
    lambda: &SampledWavelengths,
    rule: &[(Vec3, f64)],
) -> [f64; LANES] {
    let mut sum = [0.0; LANES];
    for &(wi, solid_angle_sr) in rule {
        let f = bsdf.eval(wo, wi, lambda);
        let projected = solid_angle_sr * f64::from(wi.z.abs());
        for (s, v) in sum.iter_mut().zip(f.0) {
            *s += projected * f64::from(v);
        }
    }
    sum
}

fn sample(
    bsdf: &dyn Bsdf,
    case: &Case,
    settings: &Settings,
    k: u32,
    lambda: &SampledWavelengths,
) -> Option<BsdfSample> {
    let mut sampler = Sampler::new(settings.seed, UVec2::new(k, case.index), 2);
    let u_lobe = sampler.next_1d();
    bsdf.sample(case.wo, lambda, u_lobe, sampler.next_2d())
}

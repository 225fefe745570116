//! What can be checked of a thing that may only be simulated: directions, weights and energy.

use glam::UVec2;

use super::{Bound, Case, Report, Row, Settings, Test, Worst};
use crate::bsdf::Scatter;
use crate::math::Sampler;
use crate::math::stats::Welford;
use crate::spectrum::{LANES, SampledWavelengths};

/// Energy (mean weight at most 1 within 3 standard errors, per wavelength) and the soundness of what
/// [`Scatter::scatter`] returns (unit directions; weights finite and not negative), at every incidence on
/// both sides.
pub fn check_scatter(name: &str, scatter: &dyn Scatter, settings: &Settings) -> Report {
    let lambda = SampledWavelengths::visible(0.5);
    // f32 weights of a model that absorbs nothing may round above one.
    let mut energy = Worst::new(Bound::AtMost(1.0 + 1e-5));
    let mut bad = 0.0;
    let mut first = String::from("bad directions or weights");
    for case in Case::all(settings) {
        let mut weights = [Welford::default(); LANES];
        for k in 0..settings.samples {
            let mut sampler = Sampler::new(settings.seed, UVec2::new(k, case.index), 4);
            let step = scatter.scatter(case.wo, &lambda, &mut sampler);
            if let Some((w, f)) = step {
                let sound = (w.length() - 1.0).abs() < 1e-4 && f.0.iter().all(|v| v.is_finite() && *v >= 0.0);
                if !sound {
                    if bad == 0.0 {
                        first = format!("the first is {w:?} with weight {:?} at {}", f.0, case.describe());
                    }
                    bad += 1.0;
                }
            }
            let weight = step.map(|(_, f)| f).unwrap_or_default();
            weights.iter_mut().zip(weight.0).for_each(|(w, v)| w.push(f64::from(v)));
        }
        for w in weights {
            energy.see(w.mean() - 3.0 * w.standard_error(), || {
                let (mean, error) = (w.mean(), w.standard_error());
                format!("mean weight {mean:.5} +- {error:.5}, less 3 standard errors, at {}", case.describe())
            });
        }
    }
    let sound = Row { test: Test::Sample, passed: bad == 0.0, statistic: bad, tolerance: 0.0, detail: first };
    Report { name: name.into(), rows: vec![sound, energy.row(Test::Energy)] }
}

//! The suite rejects what is wrong, each fault by the test that is meant to find it.

use glam::{Vec2, Vec3};
use rosarium::bsdf::{Bsdf, BsdfSample, Lambert};
use rosarium::math::Sampler;
use rosarium::spectrum::{SampledSpectrum, SampledWavelengths};
use rosarium::validate::{Report, Settings, Test, check_bsdf, check_estimator, shipped, wrong};

fn report_of(name: &str) -> Report {
    let mut models = shipped().expect("the shipped parameters are valid");
    models.extend(wrong::all());
    let model = models.iter().find(|m| m.name == name).unwrap_or_else(|| panic!("no model named {name}"));
    let report = check_bsdf(name, &*model.bsdf, &Settings::default());
    assert!(model.is_as_expected(&report), "{report:#?}");
    report
}

#[test]
fn wrong_pdf_fails_chi_square() {
    let report = report_of("wrong pdf");
    // A density that is not the sampled one also spoils the weights; nothing else is wrong.
    assert_eq!(report.failed(), [Test::ChiSquare, Test::Weight], "{report:#?}");
}

#[test]
fn wrong_reciprocity_fails_reciprocity_alone() {
    assert_eq!(report_of("wrong reciprocity").failed(), [Test::Reciprocity]);
}

#[test]
fn wrong_albedo_fails_energy_alone() {
    assert_eq!(report_of("wrong albedo").failed(), [Test::Energy]);
}

#[test]
fn literal_phong_is_flagged() {
    let report = report_of("literal phong");
    // Its sampling is right all the same.
    assert_eq!(report.failed(), [Test::Reciprocity], "{report:#?}");
}

#[test]
fn a_right_model_is_not_rejected() {
    assert!(report_of("lambert").passed());
}

/// A sound diffuse reflector whose value, density and samples pass through functions that may spoil them.
struct Spoiled<F, P, S> {
    sound: Lambert,
    f: F,
    pdf: P,
    sample: S,
}

impl<F, P, S> Bsdf for Spoiled<F, P, S>
where
    F: Fn(Vec3, Vec3, &SampledWavelengths, SampledSpectrum) -> SampledSpectrum + Send + Sync,
    P: Fn(f32) -> f32 + Send + Sync,
    S: Fn(BsdfSample) -> BsdfSample + Send + Sync,
{
    fn eval(&self, wo: Vec3, wi: Vec3, lambda: &SampledWavelengths) -> SampledSpectrum {
        (self.f)(wo, wi, lambda, self.sound.eval(wo, wi, lambda))
    }

    fn sample(&self, wo: Vec3, lambda: &SampledWavelengths, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let s = self.sound.sample(wo, lambda, u_lobe, u)?;
        let (f, pdf_per_sr) = (self.eval(wo, s.wi, lambda), self.pdf(wo, s.wi, lambda));
        Some((self.sample)(BsdfSample { f, pdf_per_sr, ..s }))
    }

    fn pdf(&self, wo: Vec3, wi: Vec3, lambda: &SampledWavelengths) -> f32 {
        (self.pdf)(self.sound.pdf(wo, wi, lambda))
    }
}

fn failed(
    f: impl Fn(Vec3, Vec3, &SampledWavelengths, SampledSpectrum) -> SampledSpectrum + Send + Sync,
    pdf: impl Fn(f32) -> f32 + Send + Sync,
    sample: impl Fn(BsdfSample) -> BsdfSample + Send + Sync,
) -> Vec<Test> {
    let sound = Lambert::new(0.8.into()).expect("valid");
    let settings = Settings { samples: 20_000, ..Settings::default() };
    check_bsdf("spoiled", &Spoiled { sound, f, pdf, sample }, &settings).failed()
}

#[test]
fn the_unspoiled_reflector_passes() {
    assert_eq!(failed(|_, _, _, f| f, |p| p, |s| s), []);
}

#[test]
fn a_density_that_loses_a_share_fails_its_integral() {
    let tests = failed(|_, _, _, f| f, |p| 0.97 * p, |s| s);
    assert!(tests.contains(&Test::PdfIntegral), "{tests:?}");
}

#[test]
fn a_sample_that_disagrees_with_eval_or_pdf_is_found() {
    let tests = failed(|_, _, _, f| f, |p| p, |s| BsdfSample { f: s.f * 1.001, ..s });
    assert!(tests.contains(&Test::Sample), "{tests:?}");
    let tests = failed(|_, _, _, f| f, |p| p, |s| BsdfSample { pdf_per_sr: s.pdf_per_sr * 1.001, ..s });
    assert!(tests.contains(&Test::Sample), "{tests:?}");
    let tests = failed(|_, _, _, f| f, |p| p, |s| BsdfSample { wi: s.wi * 1.01, ..s });
    assert!(tests.contains(&Test::Sample), "{tests:?}");
}

#[test]
fn an_infinity_near_the_horizon_is_found() {
    let spoil = |_: Vec3, wi: Vec3, _: &SampledWavelengths, f: SampledSpectrum| {
        if wi.z.abs() < 2e-6 { f / 0.0 } else { f }
    };
    assert_eq!(failed(spoil, |p| p, |s| s).last(), Some(&Test::Grazing));
}

#[test]
fn a_sheet_that_lets_more_light_down_than_up_is_not_reciprocal() {
    let spoil =
        |wo: Vec3, wi: Vec3, _: &SampledWavelengths, f: SampledSpectrum| match (wo.z > 0.0, wi.z > 0.0) {
            (true, false) => f + SampledSpectrum::splat(0.03),
            (false, true) => f + SampledSpectrum::splat(0.02),
            _ => f,
        };
    assert!(failed(spoil, |p| p, |s| s).contains(&Test::Reciprocity));
}

#[test]
fn energy_is_checked_on_both_sides_and_at_every_wavelength() {
    let abaxial = |wo: Vec3, _: Vec3, _: &SampledWavelengths, f: SampledSpectrum| {
        if wo.z < 0.0 { f * 1.3 } else { f }
    };
    assert_eq!(failed(abaxial, |p| p, |s| s), [Test::Energy]);
    // 10 nm of deep red.
    let red = |_: Vec3, _: Vec3, lambda: &SampledWavelengths, f: SampledSpectrum| {
        let gain = lambda.lambda_nm().map(|nm| if (700.0..710.0).contains(&nm) { 1.3 } else { 1.0 });
        f * SampledSpectrum(gain)
    };
    assert_eq!(failed(red, |p| p, |s| s), [Test::Energy]);
}

#[test]
fn estimators_that_do_not_match_are_rejected() {
    let sound = Lambert::new(0.8.into()).expect("valid");
    let settings = Settings { samples: 20_000, ..Settings::default() };
    // Noise that averages out, times what may be wrong.
    let failed = |factor: &(dyn Fn(Vec3, Vec3) -> f32 + Sync)| {
        let estimate = |wo: Vec3, wi: Vec3, lambda: &SampledWavelengths, s: &mut Sampler| {
            sound.eval(wo, wi, lambda) * (2.0 * s.next_1d() * factor(wo, wi))
        };
        check_estimator("spoiled", &sound, &estimate, &settings).failed()
    };
    assert_eq!(failed(&|_, _| 1.0), []);
    assert_eq!(failed(&|_, _| 1.08), [Test::Weight]);
    // As much light, but away from the viewer's azimuth.
    assert_eq!(failed(&|wo, wi| 1.0 - 0.3 * wo.truncate().dot(wi.truncate())), [Test::Weight]);
    assert!(failed(&|wo, _| 1.0 + 0.2 * wo.z.abs()).contains(&Test::Reciprocity));
    assert_eq!(failed(&|wo, _| if wo.z.abs() < 1e-3 { f32::NAN } else { 1.0 }), [Test::Grazing]);
    assert_eq!(failed(&|_, wi| if wi.z.abs() < 1e-5 { -1.0 } else { 1.0 }), [Test::Grazing]);
}

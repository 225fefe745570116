//! The suite rejects what is wrong, each fault by the test that is meant to find it.

use rosarium::validate::{Report, Settings, Test, check_bsdf, shipped, wrong};

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
    assert!(report.failed().contains(&Test::Reciprocity), "{report:#?}");
    // Its sampling is right all the same.
    assert!(!report.failed().contains(&Test::ChiSquare), "{report:#?}");
}

#[test]
fn a_right_model_is_not_rejected() {
    assert!(report_of("lambert").passed());
}

//! Every shipped model against every property of the conformance suite, one named test each.

use rosarium::validate::{
    Settings, Test, check_bsdf, check_petal, check_property, check_scatter, shipped, shipped_petals,
    shipped_tables,
};

fn holds(name: &str, test: Test) {
    let models = shipped().expect("the shipped parameters are valid");
    let model = models.iter().find(|m| m.name == name).unwrap_or_else(|| panic!("no model named {name}"));
    let row = check_property(test, &*model.bsdf, &Settings::default());
    assert!(
        row.passed,
        "{name}: {} = {:.4e} against {:.4e}, {}",
        test.name(),
        row.statistic,
        row.tolerance,
        row.detail
    );
}

macro_rules! bsdf_conformance {
    ($($module:ident: $name:literal),* $(,)?) => {
        $(mod $module {
            use super::*;
            #[test] fn chi_square() { holds($name, Test::ChiSquare) }
            #[test] fn pdf_integral() { holds($name, Test::PdfIntegral) }
            #[test] fn sample() { holds($name, Test::Sample) }
            #[test] fn weight() { holds($name, Test::Weight) }
            #[test] fn reciprocity() { holds($name, Test::Reciprocity) }
            #[test] fn energy() { holds($name, Test::Energy) }
            #[test] fn grazing() { holds($name, Test::Grazing) }
        })*
        const COVERED: &[&str] = &[$($name),*];
    };
}

bsdf_conformance! {
    lambert: "lambert",
    lambert_white: "lambert white",
    lambert_two_sided: "lambert two-sided",
    diffuse_transmission: "diffuse transmission",
    diffuse_transmission_red: "diffuse transmission red",
    phong_dull: "phong dull",
    phong_glossy: "phong glossy",
    phong_sharp: "phong sharp",
}

#[test]
fn every_sound_model_is_covered() {
    let models = shipped().expect("the shipped parameters are valid");
    let sound: Vec<_> = models.iter().filter(|m| m.expected_to_fail.is_none()).map(|m| m.name).collect();
    assert_eq!(sound, COVERED);
}

#[test]
fn scattering_by_a_bsdf_conserves_energy() {
    let white = rosarium::bsdf::DiffuseTransmission::new(0.6.into(), 0.5.into(), 0.4.into()).expect("valid");
    let report = check_scatter("sheet", &white, &Settings { samples: 10_000, ..Settings::default() });
    assert!(report.passed(), "{report:?}");
    let wrong = rosarium::validate::wrong::Wrong::Albedo;
    let report = check_scatter("wrong", &wrong, &Settings { samples: 10_000, ..Settings::default() });
    assert_eq!(report.failed(), [Test::Energy], "{report:?}");
}

#[test]
fn petals_estimate_what_they_scatter() {
    let petals = shipped_petals().expect("the shipped petals are valid");
    assert!(!petals.is_empty());
    for (name, petal) in petals {
        let report = check_petal(name, &petal, &Settings { samples: 40_000, ..Settings::default() });
        assert_eq!(report.rows.len(), 5);
        assert!(report.passed(), "{report:#?}");
    }
}

#[test]
fn tabulated_petals_conform() {
    let tables = shipped_tables().expect("the shipped petals are valid");
    assert!(tables.len() >= 6);
    // All of them are checked by `rosarium check`; here the synthetic one, and one whose two sides differ.
    for (name, petal) in tables.iter().filter(|(name, _)| ["sheet", "baccara"].contains(name)) {
        let report = check_bsdf(name, petal, &Settings::for_tables());
        assert_eq!(report.rows.len(), 7);
        assert!(report.passed(), "{report:#?}");
    }
}

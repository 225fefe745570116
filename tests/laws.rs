//! The laws of petal optics (`docs/laws.md`), with fewer walks than the page and the same bounds.

use rosarium::validate::laws::{self, Effort, Measure};

/// Measures a law: every number holds but those of which the page says that they do not come out.
fn check(measure: Measure, walks: u64, not_coming_out: &[&str]) {
    let law = measure(Effort { walks, seed: 1 }).unwrap();
    let failed: Vec<_> = law.findings.iter().filter(|f| !f.holds()).collect();
    let names: Vec<_> = failed.iter().map(|f| f.what.as_str()).collect();
    assert_eq!(names, not_coming_out, "law {}: {failed:#?}", law.number);
    assert!(law.chart.series.iter().flat_map(|s| &s.points).all(|(_, e)| e.value.is_finite()));
}

#[test]
fn law_1_retro() {
    check(laws::retro::measure, 120_000, &[laws::retro::RETRO_PEAK]);
}

#[test]
fn law_2_gloss() {
    check(laws::gloss::measure, 20_000, &[]);
}

#[test]
fn law_3_velvet() {
    check(laws::velvet::measure, 20_000, &[]);
}

#[test]
fn law_4_black_rose() {
    check(laws::black::measure, 100_000, &[laws::black::UPRIGHT]);
}

#[test]
fn law_5_interior() {
    check(laws::interior::measure, 40_000, &[]);
}

#[test]
fn law_6_two_sides() {
    check(laws::sides::measure, 20_000, &[]);
}

#[test]
fn law_7_diamond_dust() {
    check(laws::dust::measure, 40_000, &[]);
}

#[test]
fn law_8_disorder() {
    check(laws::disorder::measure, 20_000, &[]);
}

#[test]
fn law_10_growth() {
    check(laws::growth::measure, 40_000, &[]);
}

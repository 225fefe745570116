//! Slow: no organ crosses another or itself in any preset, stage and 20 seeds (`cargo test --test flowers -- --ignored`).

use rayon::prelude::*;
use rosarium::flower::crossings::crossings;
use rosarium::flower::{RoseDescription, grow};

#[test]
#[ignore = "a few minutes; scripts/test runs it"]
fn no_organ_crosses_another() {
    let flowers: Vec<(&str, f64, u64)> = RoseDescription::PRESETS
        .iter()
        .flat_map(|name| [0.0, 0.25, 0.5, 0.75, 1.0, 1.3].map(|openness| (*name, openness)))
        .flat_map(|(name, openness)| (1..=20).map(move |seed| (name, openness, seed)))
        .collect();
    let crossing: Vec<String> = flowers
        .par_iter()
        .filter_map(|&(name, openness, seed)| {
            let preset: RoseDescription = name.parse().expect("a preset");
            let flower = grow(&RoseDescription { openness, seed, detail: 0.6, ..preset }).expect("grows");
            let report = crossings(&flower);
            (report.total() > 0).then(|| format!("{name}, openness {openness}, seed {seed}: {report}"))
        })
        .collect();
    assert!(crossing.is_empty(), "{} of {} flowers:\n{}", crossing.len(), flowers.len(), crossing.join("\n"));
}

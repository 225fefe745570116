//! The documents keep up with the code: tests that they name exist, and so do the references that sources cite.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use rosarium::gonio::Goniophotometer;
use rosarium::micro::Profile;
use rosarium::scene::MemoryAssets;
use rosarium::scene::description::PetalDescription;

fn sources() -> BTreeMap<String, String> {
    fn collect(folder: &Path, into: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                collect(&path, into);
            } else if path.extension().is_some_and(|e| e == "rs") {
                into.push(path);
            }
        }
    }
    let mut paths = Vec::new();
    for folder in ["src", "tests", "cli/src", "cli/tests"] {
        collect(Path::new(folder), &mut paths);
    }
    paths.iter().map(|p| (p.to_str().unwrap().replace('\\', "/"), fs::read_to_string(p).unwrap())).collect()
}

/// Names of the functions that follow a `#[test]`.
fn tests_of(source: &str) -> BTreeSet<&str> {
    source
        .split("#[test]")
        .skip(1)
        .filter_map(|rest| {
            let name = rest.split_once("fn ")?.1;
            name.split_once('(').map(|(name, _)| name)
        })
        .collect()
}

/// What stands between backticks.
fn quoted(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

/// The documentation of a file, without its comment marks.
fn module_docs(source: &str) -> String {
    source.lines().filter_map(|l| l.strip_prefix("//!")).map(|l| format!("{}\n", l.trim_start())).collect()
}

/// Tests that a module's documentation names: in a sentence "guarded by", or alone in parentheses.
fn guards(docs: &str) -> BTreeSet<&str> {
    let is_name =
        |s: &&str| s.contains('_') && s.chars().all(|c| c.is_ascii_lowercase() || "_0123456789".contains(c));
    let sentences = docs.match_indices("uarded by").map(|(at, _)| {
        let rest = &docs[at..];
        let end = [". ", ".\n", "\n\n"].iter().filter_map(|e| rest.find(e)).min();
        &rest[..end.unwrap_or(rest.len())]
    });
    let asides = docs.match_indices("(`").filter_map(|(at, _)| {
        let rest = &docs[at + 1..];
        let aside = &rest[..rest.find(')')?];
        let only_names = aside.split(',').all(|s| {
            let name = s.trim().strip_prefix('`').and_then(|s| s.strip_suffix('`'));
            name.is_some_and(|n| is_name(&n) && n.matches('_').count() > 1)
        });
        only_names.then_some(aside)
    });
    sentences.chain(asides).flat_map(quoted).filter(is_name).collect()
}

#[test]
fn tests_of_the_table_exist() {
    let sources = sources();
    let table = fs::read_to_string("docs/validation.md").unwrap();
    let mut rows = 0;
    let mut wrong = Vec::new();
    for row in table.lines().filter(|l| l.starts_with("| ") && l.contains("::")) {
        let cells: Vec<&str> = row.trim_matches('|').split(" | ").collect();
        assert_eq!(cells.len(), 3, "claim, test, tolerance: {row}");
        for test in quoted(cells[1]) {
            rows += 1;
            let found = test
                .split_once("::")
                .is_some_and(|(file, name)| sources.get(file).is_some_and(|s| tests_of(s).contains(name)));
            if !found {
                wrong.push(test);
            }
        }
    }
    assert!(rows > 100, "the test no longer finds the table: {rows}");
    assert!(wrong.is_empty(), "docs/validation.md names tests that do not exist: {wrong:#?}");
}

#[test]
fn guards_of_the_modules_exist_and_have_a_row() {
    let sources = sources();
    let all: BTreeSet<&str> = sources.values().flat_map(|s| tests_of(s)).collect();
    let table = fs::read_to_string("docs/validation.md").unwrap();
    let mut seen = 0;
    let mut wrong = Vec::new();
    for (file, source) in sources.iter().filter(|(file, _)| file.starts_with("src/")) {
        let docs = module_docs(source);
        for name in guards(&docs) {
            seen += 1;
            if !all.contains(name) {
                wrong.push(format!("{file}: there is no test `{name}`"));
            } else if !table.contains(&format!("::{name}`")) {
                wrong.push(format!("{file}: `{name}` has no row in docs/validation.md"));
            }
        }
    }
    assert!(seen > 60, "the test no longer finds the guards: {seen}");
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn references_exist() {
    let references = fs::read_to_string("docs/references.md").unwrap();
    let mut texts = sources();
    for entry in fs::read_dir("docs").unwrap().chain(fs::read_dir("data/petals").unwrap()) {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "md" || e == "toml") {
            texts.insert(path.to_string_lossy().into_owned(), fs::read_to_string(&path).unwrap());
        }
    }
    let mut seen = 0;
    for (file, text) in &texts {
        for (at, _) in text.match_indices('[') {
            let Some(key) = text[at + 1..].split_once(']').map(|(key, _)| key) else { continue };
            let (name, year) = key.split_at(key.find(|c: char| c.is_ascii_digit()).unwrap_or(0));
            let is_key = name.starts_with(|c: char| c.is_ascii_uppercase())
                && name.chars().all(|c| c.is_ascii_alphabetic())
                && year.len() == 4
                && year.chars().all(|c| c.is_ascii_digit());
            if is_key {
                seen += 1;
                assert!(
                    references.contains(&format!("\n| {key} |")),
                    "{file}: [{key}] is not in docs/references.md"
                );
            }
        }
    }
    assert!(seen > 0, "the test no longer finds references");
}

/// The page's first table says what this program measures today, not what it measured once.
#[test]
fn numbers_of_the_thesis_page_are_current() {
    let page = fs::read_to_string("docs/thesis.md").unwrap();
    for (profile, name) in [(Profile::Cosine, "cosine"), (Profile::Flat, "flat")] {
        let start = format!("| `-D cells.profile={name}`");
        let row = page.lines().find(|l| l.starts_with(&start)).unwrap();
        let printed: Vec<Vec<f64>> = row
            .trim_matches('|')
            .split('|')
            .skip(1)
            .map(|cell| cell.split('±').map(|n| n.trim().parse().unwrap()).collect())
            .collect();
        let mut petal = PetalDescription::default();
        petal.cells.profile = profile;
        let instrument = Goniophotometer {
            incident_deg: vec![30.0, 60.0, 75.0],
            rays: 200_000,
            seed: 1,
            bands_nm: vec![450.0, 550.0, 650.0],
            ..Goniophotometer::default()
        };
        let petal = petal.compile("", &MemoryAssets::default()).unwrap();
        let table = instrument.measure(&petal, &|_, _| ControlFlow::Continue(())).unwrap();
        for (cell, incidence) in printed.iter().zip(&table.incidences) {
            let index = incidence.mean.retro_index.unwrap();
            let z = (cell[0] - index.value) / cell[1].hypot(index.standard_error);
            assert!(
                z.abs() < 4.0,
                "{name}, {} deg: {cell:?} {index:?}; run scripts/measure_thesis",
                incidence.incident_deg
            );
        }
    }
}

//! The order of the `pub mod` lines in `src/lib.rs` is the order of dependency: a module uses only modules
//! above it.

use std::fs;
use std::path::{Path, PathBuf};

fn sources(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push(path);
        }
    }
}

/// Modules that a source names as `crate::name`, or inside `crate::{...}`.
fn uses(text: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for (number, line) in text.lines().enumerate() {
        // Documentation may point anywhere.
        if line.trim_start().starts_with("//") {
            continue;
        }
        for (at, _) in line.match_indices("crate::") {
            let rest = &line[at + "crate::".len()..];
            let names = match rest.strip_prefix('{') {
                Some(list) => list.split(',').map(str::trim).collect(),
                None => vec![rest],
            };
            for name in names {
                let word: String = name.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                found.push((number + 1, word));
            }
        }
    }
    found
}

fn modules() -> Vec<String> {
    let lib = fs::read_to_string("src/lib.rs").unwrap();
    lib.lines().filter_map(|l| l.strip_prefix("pub mod ")?.strip_suffix(';')).map(String::from).collect()
}

#[test]
fn modules_use_only_what_is_above_them() {
    let order = modules();
    assert!(order.len() > 10, "{order:?}");
    let mut wrong = Vec::new();
    let mut seen = 0;
    for (level, module) in order.iter().enumerate() {
        let folder = PathBuf::from("src").join(module);
        let mut files = Vec::new();
        if folder.is_dir() {
            sources(&folder, &mut files);
        } else {
            files.push(folder.with_extension("rs"));
        }
        for file in files {
            let text = fs::read_to_string(&file).unwrap();
            // Tests may look upwards: they are not part of the library.
            if file.ends_with("tests.rs") {
                continue;
            }
            let text = text.split("#[cfg(test)]").next().unwrap();
            for (line, used) in uses(text) {
                seen += 1;
                if order.iter().position(|m| *m == used).is_some_and(|l| l > level) {
                    wrong.push(format!("{}:{line}: {module} uses {used}", file.display()));
                }
            }
        }
    }
    assert!(seen > 100, "the test no longer finds what it looks for: {seen}");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_parser_sees_uses() {
    let found = uses("use crate::{Error, scene};\n// crate::io\nlet x = crate::film::Film;");
    let names: Vec<&str> = found.iter().map(|(_, n)| n.as_str()).collect();
    assert_eq!(names, ["Error", "scene", "film"]);
}

#[test]
fn files_are_short() {
    let mut files = Vec::new();
    for folder in ["src", "cli/src"] {
        sources(Path::new(folder), &mut files);
    }
    for file in files {
        let text = fs::read_to_string(&file).unwrap();
        let lines = text.split("#[cfg(test)]").next().unwrap().lines().count();
        assert!(lines <= 500, "{}: {lines} lines without tests; one file, one idea", file.display());
    }
}

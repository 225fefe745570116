//! `reproduce`: the page, the commands on it, bad input.

mod common;

use std::fmt::Write as _;

use common::{command, fails, folder, read, succeeds, write};
use tempfile::TempDir;

/// The commands on a page, as they are shown.
fn commands(page: &str) -> Vec<String> {
    let shown = page.split("<summary>The command</summary><pre>").skip(1);
    shown.filter_map(|rest| rest.split("</pre>").next()).map(str::to_owned).collect()
}

/// Runs a line of the page in the report's folder.
fn run_in_report(dir: &TempDir, line: &str) {
    let arguments: Vec<&str> = line.split_whitespace().skip(1).collect();
    let status = command(dir, &arguments).current_dir(dir.path().join("report")).output().expect("it runs");
    assert!(status.status.success(), "{line}: {}", String::from_utf8_lossy(&status.stderr));
}

#[test]
fn pictures_are_those_of_their_commands_at_any_thread_count() {
    let dir = folder();
    let arguments = "reproduce -o report --section cells,points --size 24 --spp 1 --seed 5 -t 1";
    let output = succeeds(&dir, &arguments.split(' ').collect::<Vec<_>>());
    assert!(output.stdout.is_empty());
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("report/index.html: 2 sections, 5 pictures"), "{said}");
    let page = String::from_utf8(read(&dir, "report/index.html")).expect("UTF-8");
    for id in ["cells", "points"] {
        assert!(page.contains(&format!("<section id=\"{id}\">")), "{id}");
    }
    assert!(page.contains(arguments), "the page tells how it was made");
    let commands = commands(&page);
    assert_eq!(commands.len(), 5);
    assert_eq!(page.matches("src=\"data:image/png;base64,").count(), 5);
    for (picture, k) in [("cells.png", 0), ("points_8.png", 3)] {
        let before = read(&dir, &format!("report/{picture}"));
        assert!(commands[k].contains(picture), "{}", commands[k]);
        std::fs::remove_file(dir.path().join("report").join(picture)).expect("it is there");
        run_in_report(&dir, &commands[k]);
        assert!(read(&dir, &format!("report/{picture}")) == before, "{}", commands[k]);
    }
    assert!(!dir.path().join("report/unfinished.json").exists());
}

#[test]
fn what_is_finished_stays_and_is_not_made_again() {
    let dir = folder();
    let arguments = ["reproduce", "-o", "report", "--section", "cells"];
    let in_the_way = dir.path().join("report/cells_disorder.png");
    std::fs::create_dir_all(&in_the_way).expect("a folder");
    let output = command(&dir, &arguments).output().expect("it runs");
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert!(!dir.path().join("report/index.html").exists());
    assert!(dir.path().join("report/cells.png").is_file());
    std::fs::remove_dir(&in_the_way).expect("it is empty");
    let said = |output: std::process::Output| String::from_utf8_lossy(&output.stderr).into_owned();
    let second = said(succeeds(&dir, &arguments));
    assert!(!second.contains("1 of 2") && second.contains("2 of 2, cells: cells_disorder.png"), "{second}");
    let third = said(succeeds(&dir, &arguments));
    assert!(third.contains("1 of 2"), "a finished page is made anew: {third}");
}

/// A matt sample that sends some light back to the lamp.
fn table() -> String {
    let mut out = String::from("incident_theta,incident_phi,theta,phi,value\n");
    for lamp in [20.0_f64, 50.0] {
        for phi in [0, 90, 180, 270] {
            for theta in [5.0_f64, 25.0, 45.0, 65.0] {
                let back = if phi == 0 { 0.1 * (-((theta - lamp) / 15.0).powi(2)).exp() } else { 0.0 };
                writeln!(out, "{lamp},0,{theta},{phi},{}", 0.1 + back).expect("written");
            }
        }
    }
    out
}

#[test]
fn fits_find_what_is_known_and_take_a_table_of_the_users() {
    let dir = folder();
    write(&dir, "my rose.csv", table());
    let arguments = [
        "reproduce",
        "-o",
        "report",
        "--section",
        "distribution",
        "--rays",
        "20000",
        "--measurement",
        "my rose.csv",
    ];
    let output = command(&dir, &arguments)
        .env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"))
        .output()
        .expect("it runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let page = String::from_utf8(read(&dir, "report/index.html")).expect("UTF-8");
    assert!(page.contains("is synthetic") && page.contains("my rose.csv"), "what is what is said");
    assert_eq!(page.matches("<caption>").count(), 3);
    assert_eq!(page.matches("<tr><td>lambert+phong</td>").count(), 2);
    assert!(page.contains("<tr><td>n_E</td><td>20.00000</td>"));
    // Known and found of a red coefficient that the table determines well.
    let row =
        page.split("<tr><td>kd_E[650 nm]</td>").nth(1).and_then(|r| r.split("</tr>").next()).expect("a row");
    let cells: Vec<f64> =
        row.split("<td>").skip(1).filter_map(|c| c.split('<').next()?.parse().ok()).collect();
    assert!((cells[1] / cells[0] - 1.0).abs() < 0.1, "{row}");
    assert!(read(&dir, "report/measurement.csv") == table().into_bytes());
}

#[test]
fn bad_input_is_said_at_once() {
    let dir = folder();
    write(&dir, "nonsense.csv", "a,b\n1,2\n");
    write(&dir, "file", "");
    let report = |flags: &[&str], words: &[&str]| {
        fails(&dir, &[&["reproduce", "-o", "report"], flags].concat(), words);
    };
    report(&["--measurement", "missing.csv"], &["missing.csv"]);
    report(&["--measurement", "nonsense.csv"], &["nonsense.csv"]);
    report(&["--measurement", "scene.toml"], &["scene.toml"]);
    report(&["--section", "roots"], &["roots", "cells"]);
    report(&["--size", "0"], &["--size"]);
    report(&["--spp", "-1"], &["--spp"]);
    report(&["--walks", "2e4"], &["--walks", "laws"]);
    fails(&dir, &["reproduce", "-o", "file"], &["file"]);
    fails(&dir, &["reproduce", "-o", "file/report"], &["file/report"]);
    fails(&dir, &["reproduce", "laws", "--quick"], &["--quick"]);
    report(&["--rays", "0"], &["--rays"]);
    report(&["--rays", "1e12"], &["--rays"]);
}

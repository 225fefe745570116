//! `fit`, `convert` and `plot` as a laboratory would use them.

mod common;

use std::fmt::Write as _;
use std::path::PathBuf;

use common::{SCENE, command, fails, files, read, succeeds, write};
use serde_json::Value;
use tempfile::TempDir;

/// Where the cells' factors are kept between runs of the tests.
fn cache() -> String {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("rosarium").display().to_string()
}

fn empty() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn stdout(output: &std::process::Output) -> String {
    String::from_utf8(output.stdout.clone()).expect("UTF-8")
}

fn json(output: &std::process::Output) -> Value {
    serde_json::from_slice(&output.stdout).expect("JSON")
}

/// 160 readings of kd / pi + ks (n + 2) / 2 pi cos^n, in the layout of a field spectrometer's goniometer, as BRF.
fn leaf(samples: &[(&str, f64)]) -> String {
    let mut out = String::from("# a synthetic leaf\nsample,sza,vza,vaa,BRF_550nm\n");
    for &(name, kd) in samples {
        for sza in [20.0_f64, 30.0, 40.0, 50.0] {
            for vaa in [0.0_f64, 45.0, 90.0, 135.0, 180.0] {
                for vza in [5.0_f64, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0] {
                    let (i, o, p) = (sza.to_radians(), vza.to_radians(), vaa.to_radians());
                    // The mirror direction is at azimuth 180.
                    let cos = (i.cos() * o.cos() - i.sin() * o.sin() * p.cos()).max(0.0);
                    let pi = std::f64::consts::PI;
                    let bsdf = kd / pi + 0.1 * 14.0 / (2.0 * pi) * cos.powi(12);
                    writeln!(out, "{name},{sza},{vza},{vaa},{}", pi * bsdf).expect("written");
                }
            }
        }
    }
    out
}

const LEAF: [&str; 6] = [
    "--columns",
    "incident_theta=sza,theta=vza,phi=vaa,value=BRF_550nm",
    "--quantity",
    "brf",
    "--azimuth",
    "lamp",
];

fn assert_no_nan(text: &str) {
    let bad = |word: &str| ["NaN", "inf", "-inf"].contains(&word.trim_matches(['(', ')', ',', ':']));
    assert!(!text.split_whitespace().any(bad), "{text}");
}

fn value(fit: &Value, name: &str) -> f64 {
    let all = fit["parameters"].as_array().expect("parameters");
    let found = all.iter().find(|p| p["parameter"] == name).unwrap_or_else(|| panic!("{name}: {fit}"));
    found["value"].as_f64().expect("a number")
}

#[test]
fn known_parameters_come_back_through_a_field_spectrometers_table() {
    let dir = empty();
    write(&dir, "leaf.csv", leaf(&[("a", 0.3)]));
    let arguments = [&["fit", "leaf.csv", "--model", "lambert+phong", "--json"], &LEAF[..]].concat();
    let report = json(&succeeds(&dir, &arguments));
    let fit = &report["fits"][0];
    for (name, truth) in [("kd", 0.3), ("ks", 0.1), ("n", 12.0)] {
        assert!((value(fit, name) / truth - 1.0).abs() < 1e-5, "{name}: {fit}");
    }
    assert_eq!(report["data"]["sha256"].as_str().map(str::len), Some(64));
    // The same table with azimuth 0 on the mirror's side is another leaf: the lobe would be on the lamp's side.
    let wrong =
        [&["fit", "leaf.csv", "--model", "lambert+phong", "--json"], &LEAF[..4], &["--azimuth", "forward"]];
    let other = json(&succeeds(&dir, &wrong.concat()));
    assert!(other["fits"][0]["rmse_per_sr"].as_f64() > Some(0.01), "{other}");
}

#[test]
fn the_ladder_of_every_model_and_every_sample() {
    let dir = empty();
    write(&dir, "leaf.csv", leaf(&[("oak", 0.3), ("elm", 0.2)]));
    let cache = cache();
    let all =
        ["fit", "leaf.csv", "--model", "all", "--series", "sample", "--cache", &cache, "--report", "r.html"];
    let text = stdout(&succeeds(&dir, &[&all[..], &LEAF].concat()));
    for part in ["== oak", "== elm", "== all 2 samples", "RMSE", "AIC", "BIC"] {
        assert!(text.contains(part), "no `{part}` in\n{text}");
    }
    for model in
        ["lambert", "phong", "oren_nayar", "lambert+phong", "blinn", "ggx+lambert", "retro", "terado"]
    {
        assert!(text.lines().filter(|l| l.split(' ').next() == Some(model)).count() >= 3, "{model}\n{text}");
    }
    assert_no_nan(&text);
    for page in ["r-oak.html", "r-elm.html"] {
        assert!(String::from_utf8(read(&dir, page)).expect("UTF-8").contains("<svg"), "{page}");
    }
}

#[test]
fn from_a_measured_petal_to_a_petal_file_that_measures_alike() {
    let dir = empty();
    let cache = cache();
    let white = ["-D", "shading.anthocyanin_ug_per_cm2=0", "-D", "shading.anthocyanin_abaxial_ug_per_cm2=0"];
    let measure = |petal: &str, more: &[&str]| {
        let fixed = ["measure", petal, "--incident", "15,35,55", "--rays", "4e5", "--wavelengths", "550"];
        json(&succeeds(&dir, &[&fixed[..], &["--spin", "--json"], more].concat()))
    };
    let before = measure("thesis", &[&white[..], &["-o", "table.csv"]].concat());
    let fit = ["fit", "table.csv", "--model", "terado", "--cache", &cache, "--report", "report.html"];
    let more = ["--report", "report.json", "--report", "report.txt", "-o", "petal.toml"];
    let text = stdout(&succeeds(&dir, &[&fit[..], &more].concat()));
    for part in
        ["[[Fit Statistics]]", "[[Variables]]", "[[Correlations]]", "kd_E:", "+/-", "energy is conserved"]
    {
        assert!(text.contains(part), "no `{part}` in\n{text}");
    }
    let report: Value = serde_json::from_slice(&read(&dir, "report.json")).expect("JSON");
    let found = &report["fits"][0];
    // The preset's values; the table's bins are 5 x 10 degrees wide and its noise is about 2 %.
    for (name, truth, tolerance) in [("kd_E", 0.28, 0.02), ("kd_S", 0.18, 0.02), ("ks_E", 0.031, 0.015)] {
        assert!((value(found, name) - truth).abs() < tolerance, "{name}: {text}");
    }
    let petal = String::from_utf8(read(&dir, "petal.toml")).expect("UTF-8");
    let hash = report["data"]["sha256"].as_str().expect("a hash");
    assert!(petal.contains(hash), "{petal}");
    let after = measure("petal.toml", &[]);
    for (a, b) in before["incidences"].as_array().unwrap().iter().zip(after["incidences"].as_array().unwrap())
    {
        let (a, b) = (a["reflectance"].as_f64().unwrap(), b["reflectance"].as_f64().unwrap());
        assert!((a / b - 1.0).abs() < 0.01, "{a} {b}");
    }
    // And it renders: the scene's own petal gives another picture.
    write(&dir, "scene.toml", SCENE);
    let render = |more: &[&str]| {
        succeeds(&dir, &[&["render", "scene.toml", "-o", "x.png"], more].concat());
        read(&dir, "x.png")
    };
    assert_ne!(render(&[]), render(&["--petal", "petal.toml"]));
    assert_ne!(
        render(&["--petal", "petal.toml"]),
        render(&["--petal", "petal.toml", "-D", "petal.cells.height_um=5"])
    );
    fails(&dir, &["render", "--petal", "petal.toml", "-D", "petal.cells.height_um=-5"], &["height_um=-5"]);
}

#[test]
fn wishes_for_parameters_are_heard() {
    let dir = empty();
    write(&dir, "leaf.csv", leaf(&[("a", 0.3)]));
    let fit = |more: &[&str]| {
        let fixed = ["fit", "leaf.csv", "--model", "lambert+phong", "--json"];
        json(&succeeds(&dir, &[&fixed[..], &LEAF, more].concat()))["fits"][0].clone()
    };
    assert_eq!(value(&fit(&["--fix", "n=30"]), "n"), 30.0);
    assert_eq!(value(&fit(&["--bounds", "n=20..40"]), "n"), 20.0);
    let tied = fit(&["--tie", "ks=0.5*kd"]);
    assert!((value(&tied, "ks") / value(&tied, "kd") - 0.5).abs() < 1e-12);
    let short = fit(&["--intervals", "0", "--starts", "1"]);
    assert!(short["parameters"][0]["interval"].is_null() && short["starts"] == 1);
    let boot = fit(&["--bootstrap", "40", "--loss", "huber", "--sigma", "2%", "--covariance", "absolute"]);
    assert!(boot["parameters"][0]["bootstrap"].is_array(), "{boot}");
    // The same bytes at any number of threads.
    let text = |t: &str| {
        stdout(&succeeds(&dir, &[&["fit", "leaf.csv", "--model", "retro", "-t", t], &LEAF[..]].concat()))
    };
    let (one, two) = (text("1"), text("2"));
    assert_eq!(one, two);
}

#[test]
fn relative_intensities_have_gains() {
    let dir = empty();
    // The second series is the same leaf seen by an instrument of three times the gain.
    let a = leaf(&[("a", 0.3)]);
    let mut both = a.clone();
    for row in a.lines().skip(2) {
        let mut cells: Vec<String> = row.split(',').map(String::from).collect();
        cells[0] = "b".into();
        cells[4] = (3.0 * cells[4].parse::<f64>().expect("a number")).to_string();
        writeln!(both, "{}", cells.join(",")).expect("written");
    }
    write(&dir, "two.csv", both);
    let columns = "incident_theta=sza,theta=vza,phi=vaa,value=BRF_550nm";
    let fixed =
        ["fit", "two.csv", "--model", "lambert+phong", "--json", "--columns", columns, "--series", "sample"];
    let report =
        json(&succeeds(&dir, &[&fixed[..], &["--quantity", "relative", "--azimuth", "lamp"]].concat()));
    let gains = report["fits"][0]["parameters"].as_array().expect("parameters").iter();
    let gains: Vec<f64> = gains
        .filter(|p| p["name"].as_str().is_some_and(|n| n.starts_with("gain")))
        .map(|p| p["value"].as_f64().expect("a number"))
        .collect();
    assert!(gains.iter().any(|g| (g - 3.0).abs() < 1e-4), "{report}");
}

#[test]
fn formats_lead_to_each_other() {
    let dir = empty();
    let measure = ["measure", "thesis", "--incident", "0,20,40,60,80", "--rays", "1e5", "-o", "table.csv"];
    succeeds(&dir, &measure);
    for (to, head) in [
        ("petal.bsdf", &b"tensor_file\0"[..]),
        ("petal.xml", b"<?xml"),
        ("petal.binary", &[90, 0, 0, 0, 90, 0, 0, 0, 180, 0, 0, 0]),
        ("again.csv", b"#"),
    ] {
        succeeds(&dir, &["convert", "table.csv", to]);
        assert!(read(&dir, to).starts_with(head), "{to}");
        succeeds(&dir, &["plot", to, "-o", "lobes.svg"]);
        assert!(String::from_utf8(read(&dir, "lobes.svg")).expect("UTF-8").contains("<svg"));
    }
    succeeds(&dir, &["convert", "table.csv", "tree.xml", "--form", "tensor-tree"]);
    succeeds(&dir, &["convert", "petal.xml", "from_xml.csv"]);
    let output = succeeds(&dir, &["convert", "table.csv", "lab.dat", "--band", "550"]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("pgII"));
    let lamps: Vec<String> = files(dir.path()).into_keys().filter(|f| f.ends_with(".dat")).collect();
    assert_eq!(lamps.len(), 5, "{lamps:?}");
    let mut arguments = vec!["plot", "-o", "lab.png"];
    arguments.extend(lamps.iter().map(String::as_str));
    succeeds(&dir, &arguments);
    assert!(read(&dir, "lab.png").starts_with(b"\x89PNG"));
}

#[test]
fn wrong_data_says_where() {
    let dir = empty();
    let good = leaf(&[("a", 0.3)]);
    write(&dir, "leaf.csv", &good);
    let fit = |file: &str, words: &[&str]| {
        let arguments = [&["fit", file, "--model", "lambert"], &LEAF[..]].concat();
        fails(&dir, &arguments, words);
    };
    fit("none.csv", &["none.csv", "No such file"]);
    write(&dir, "empty.csv", "");
    fit("empty.csv", &["empty.csv"]);
    write(&dir, "negative.csv", good.replacen(",0.3", ",-0.3", 1));
    fit("negative.csv", &["negative.csv:", "negative"]);
    write(&dir, "steep.csv", good.replacen("a,20,", "a,95,", 1));
    fit("steep.csv", &["steep.csv:3"]);
    write(&dir, "words.csv", good.replacen("a,20,", "a,twenty,", 1));
    fit("words.csv", &["words.csv:3", "twenty"]);
    let missing: String = good
        .lines()
        .map(|l| {
            if l.starts_with("a,") {
                format!("{},NaN\n", l.rsplit_once(',').unwrap().0)
            } else {
                format!("{l}\n")
            }
        })
        .collect();
    write(&dir, "missing.csv", missing);
    fit("missing.csv", &["missing.csv"]);

    let with = |more: &[&str], words: &[&str]| {
        fails(&dir, &[&["fit", "leaf.csv", "--model", "lambert"], &LEAF[..], more].concat(), words);
    };
    with(&["--fix", "kq=1"], &["kq"]);
    with(&["--fix", "kd"], &["--fix kd", "NAME=VALUE"]);
    with(&["--bounds", "kd=1..0"], &["kd"]);
    with(&["--tie", "kd=kd"], &["kd"]);
    with(&["--intervals", "1.5"], &["--intervals"]);
    with(&["--select", "b"], &["--select b"]);
    with(&["--band", "700"], &["--band 700", "550 nm"]);
    with(&["--detector-half-angle", "80"], &["--detector-half-angle", "0-45"]);
    with(&["-o", "petal.csv"], &["petal.csv", ".toml"]);
    let fit = ["fit", "leaf.csv"];
    fails(&dir, &[&fit[..], &["--model", "lembert"], &LEAF].concat(), &["lembert", "lambert", "terado"]);
    fails(&dir, &[&fit[..], &["--model", "terado+transmission"], &LEAF].concat(), &["transmitted"]);
    fails(&dir, &[&fit[..], &["--model", "lambert,phong", "-o", "p.toml"], &LEAF].concat(), &["one fit"]);
    fails(&dir, &[&fit[..], &["--columns", "theta=nope,value=BRF_550nm"]].concat(), &["nope", "vza"]);
    fails(&dir, &[&fit[..], &["--quantity", "brightness"]].concat(), &["--quantity", "brightness", "brf"]);
    fails(&dir, &[&fit[..], &["--azimuth", "north"]].concat(), &["--azimuth", "lamp"]);
    fails(&dir, &["convert", "leaf.csv", "leaf.doc"], &["leaf.doc", ".xml"]);
    write(&dir, "cut.bsdf", b"tensor_file\0\x01\0\xff\xff\xff\xff");
    fails(&dir, &["convert", "cut.bsdf", "out.csv"], &["cut.bsdf"]);
    write(
        &dir,
        "bomb.xml",
        "<?xml version=\"1.0\"?><!DOCTYPE a [<!ENTITY b \"&b;&b;\">]><WindowElement>&b;</WindowElement>",
    );
    fails(&dir, &["plot", "bomb.xml", "-o", "x.svg"], &["bomb.xml"]);
}

#[test]
fn data_that_determine_nothing_are_said_to() {
    let dir = empty();
    let good = leaf(&[("a", 0.3)]);
    let one: String = good.lines().take(3).map(|l| format!("{l}\n")).collect();
    write(&dir, "one.csv", one);
    let constant: String = good
        .lines()
        .map(|l| {
            if l.starts_with("a,") {
                format!("{},0.25\n", l.rsplit_once(',').unwrap().0)
            } else {
                format!("{l}\n")
            }
        })
        .collect();
    write(&dir, "constant.csv", constant);
    for (file, model) in [("one.csv", "lambert+phong"), ("one.csv", "lambert"), ("constant.csv", "retro")] {
        let arguments = [&["fit", file, "--model", model, "--report", "r.html"], &LEAF[..]].concat();
        let output = command(&dir, &arguments).output().expect("it runs");
        let text = stdout(&output);
        assert!(output.status.success(), "{file} {model}: {}", String::from_utf8_lossy(&output.stderr));
        assert_no_nan(&text);
        if model != "lambert" {
            assert!(text.contains("not determine") || text.contains("bound"), "{file} {model}: {text}");
        }
        assert!(!String::from_utf8(read(&dir, "r.html")).expect("UTF-8").contains("NaN"));
    }
}

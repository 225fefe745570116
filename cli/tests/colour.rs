//! `colour` as a laboratory would use it.

mod common;

use std::fmt::Write as _;

use common::{fails, files, read, succeeds, write};

const PETAL: &str = "\
[cells]
profile = \"flat\"
height_um = 0

[tissue.adaxial.pigments]
anthocyanin_ug_per_cm2 = 1.0

[tissue.spongy]
thickness_um = 150.0
scattering_per_mm = 30.0
anisotropy = 0.5
";

/// A pink spectrum: a plateau with a band.
fn spectrum() -> String {
    let mut out = String::from("# made\nwavelength_nm,pink,grey\n");
    for l in (400..=720).step_by(10) {
        let l = f64::from(l);
        let band = (-((l - 540.0) / 40.0).powi(2)).exp();
        let _ = writeln!(out, "{l},{:.4},0.5", 0.5 - 0.35 * band);
    }
    out
}

#[test]
fn a_spectrum_becomes_a_petal() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    write(&dir, "petal.toml", PETAL);
    write(&dir, "flowers.csv", spectrum());
    let base = ["colour", "flowers.csv", "--petal", "petal.toml", "--walks", "400"];
    let arguments = [
        &base[..],
        &["--spectrum", "pink", "-o", "fitted.toml", "--plot", "a.svg", "--table-out", "fit.csv"],
    ]
    .concat();
    let output = succeeds(&dir, &arguments);
    let text = String::from_utf8_lossy(&output.stdout);
    for word in
        ["anthocyanin_ug_per_cm2", "scattering_per_mm", "gain", "RMSE", "28 wavelengths from 420 to 690 nm"]
    {
        assert!(text.contains(word), "{word}: {text}");
    }
    let fitted = String::from_utf8_lossy(&read(&dir, "fitted.toml")).into_owned();
    assert!(fitted.contains("# data    flowers.csv, pink\n") && fitted.contains("# sha256  "), "{fitted}");
    assert!(
        fitted.contains("anthocyanin_peak_nm") && fitted.contains("[tissue.adaxial.pigments]"),
        "{fitted}"
    );
    assert!(read(&dir, "a.svg").starts_with(b"<svg") && read(&dir, "fit.csv").starts_with(b"wavelength_nm,"));
    // What was written is a petal for the next fit, and a held parameter stays.
    let again = ["colour", "flowers.csv", "--petal", "fitted.toml", "--walks", "400", "--spectrum", "pink"];
    let held = [&again[..], &["--fix", "gain=1", "--illumination", "45", "--no-surface", "--json"]].concat();
    let output = succeeds(&dir, &held);
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let gain = &json["parameters"][5];
    assert_eq!((gain["name"].as_str(), gain["value"].as_f64()), (Some("gain"), Some(1.0)), "{gain}");
    assert_eq!((&gain["state"], gain["standard_error"].is_null()), (&"fixed".into(), true), "{gain}");
    assert_eq!(files(dir.path()).len(), 5);
}

#[test]
fn mistakes_are_named() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    write(&dir, "petal.toml", PETAL);
    write(&dir, "flowers.csv", spectrum());
    let run = |more: &[&str], words: &[&str]| {
        fails(&dir, &[&["colour", "flowers.csv", "--walks", "100"], more].concat(), words);
    };
    let petal = ["--petal", "petal.toml"];
    run(&petal, &["flowers.csv", "choose one of pink, grey"]);
    run(&[&petal[..], &["--spectrum", "red"]].concat(), &["flowers.csv", "`red`"]);
    let pink = [&petal[..], &["--spectrum", "pink"]].concat();
    run(&[&pink[..], &["--range", "690..420"]].concat(), &["--range 690..420"]);
    run(&[&pink[..], &["--range", "500..520"]].concat(), &["flowers.csv", "3 wavelengths"]);
    run(&[&pink[..], &["--fix", "betalain=1"]].concat(), &["--fix betalain=1", "carotenoid_ug_per_cm2"]);
    run(&[&pink[..], &["--fix", "gain=99"]].concat(), &["gain", "0.05"]);
    run(&[&pink[..], &["--illumination", "95"]].concat(), &["--illumination"]);
    run(&[&pink[..], &["-o", "a.txt"]].concat(), &["--output a.txt", ".toml"]);
    run(&["--petal", "thesis", "--spectrum", "pink"], &["thesis", "[tissue]"]);
    write(&dir, "bad.toml", PETAL.replace("thickness_um = 150.0", "thickness_um = 0"));
    run(&["--petal", "bad.toml", "--spectrum", "pink"], &["bad.toml:9", "tissue.spongy.thickness_um"]);
    write(&dir, "clear.toml", PETAL.replace("scattering_per_mm = 30.0", "scattering_per_mm = 0"));
    run(
        &["--petal", "clear.toml", "--spectrum", "pink"],
        &["clear.toml:10", "tissue.spongy.scattering_per_mm"],
    );
    write(&dir, "percent.csv", "400,20\n500,30\n600,70\n");
    fails(&dir, &["colour", "percent.csv", "--petal", "petal.toml", "--range", "400..600"], &["percent.csv"]);
    write(&dir, "broken.csv", "400,0.1\n390,0.2\n");
    fails(&dir, &["colour", "broken.csv", "--petal", "petal.toml"], &["broken.csv:2"]);
}

//! `rosarium compare`: measures, tolerances, pictures of the difference, and what cannot be compared.

mod common;

use std::fs;

use common::{command, fails, folder, read, succeeds, write};
use exr::prelude::{SpecificChannels, WritableImage};
use serde_json::Value;
use tempfile::TempDir;

/// A folder with `a.exr` and `b.exr` of the same scene, `dark.exr` with less light, and the first two as `.png`.
fn renders() -> TempDir {
    let dir = folder();
    let render = |name: &str, extra: &[&str]| {
        let outputs = [format!("{name}.exr"), format!("{name}.png")];
        let always = [
            "render",
            "scene.toml",
            "-q",
            "--spp",
            "32",
            "-o",
            outputs[0].as_str(),
            "-o",
            outputs[1].as_str(),
        ];
        succeeds(&dir, &[&always[..], extra].concat());
    };
    render("a", &["--seed", "1"]);
    render("b", &["--seed", "2"]);
    render("dark", &["--seed", "2", "-D", "lights.sky.radiance=0.15"]);
    dir
}

fn json(dir: &TempDir, arguments: &[&str]) -> Value {
    let output = command(dir, &[arguments, &["--json"]].concat()).output().expect("it runs");
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

fn code(dir: &TempDir, arguments: &[&str]) -> Option<i32> {
    command(dir, arguments).output().expect("it runs").status.code()
}

#[test]
fn equal_pictures_are_equal() {
    let dir = renders();
    for name in ["a.exr", "a.png"] {
        let object = json(&dir, &["compare", name, name]);
        assert_eq!((&object["rmse"], &object["flip"]["mean"]), (&0.0.into(), &0.0.into()), "{object}");
        assert_eq!(object["passed"], true);
        for metric in ["flip", "relmse", "rmse", "mean"] {
            let arguments = ["compare", name, name, "--metric", metric, "--tolerance", "0"];
            assert_eq!(code(&dir, &arguments), Some(0), "{metric}");
        }
    }
    let text = String::from_utf8(succeeds(&dir, &["compare", "a.exr", "b.exr"]).stdout).expect("UTF-8");
    for part in
        ["a.exr against b.exr: 16 x 12 pixels", "rmse", "relmse", "luminance", "HDR-FLIP", "worst pixel"]
    {
        assert!(text.contains(part), "no {part} in {text}");
    }
    let text = String::from_utf8(succeeds(&dir, &["compare", "a.png", "b.png"]).stdout).expect("UTF-8");
    assert!(text.contains("LDR-FLIP") && !text.contains("worst pixel"), "{text}");
}

#[test]
fn noise_passes_and_less_light_fails() {
    let dir = renders();
    let z = |b: &str, metric: &str| {
        code(&dir, &["compare", "a.exr", b, "--metric", metric, "--tolerance", "1e-3"])
    };
    assert_eq!(z("b.exr", "z-mean"), Some(0));
    assert_eq!(z("dark.exr", "z-mean"), Some(1));
    assert_eq!(z("dark.exr", "z"), Some(1));
    let object = json(&dir, &["compare", "a.exr", "dark.exr", "--metric", "mean", "--tolerance", "0.02"]);
    assert_eq!((&object["passed"], &object["metric"]), (&false.into(), &"mean".into()), "{object}");
    let luminance = object["mean"]["luminance"]["relative"].as_f64().expect("a number");
    assert!((0.05..0.4).contains(&luminance), "{luminance}");
    let output =
        command(&dir, &["compare", "a.exr", "dark.exr", "--tolerance", "1e-4"]).output().expect("runs");
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("flip: ") && said.contains("beyond the tolerance"), "{said}");
}

#[test]
fn layers_and_crops_are_compared() {
    let dir = renders();
    let rmse = |extra: &[&str]| {
        let object = json(&dir, &[&["compare", "a.exr", "b.exr"][..], extra].concat());
        object["rmse"].as_f64().expect("a number")
    };
    // The albedo does not depend on light: same seed, other light.
    let object = json(&dir, &["compare", "b.exr", "dark.exr", "--layer", "albedo"]);
    assert_eq!(object["rmse"], 0.0, "{object}");
    assert!(object["z"].is_null(), "{object}");
    assert!(rmse(&["--layer", "direct"]) > 0.0);
    // The corner is sky, whose only noise is that of its colour.
    let (corner, middle) = (rmse(&["--crop", "0,0.1,0,0.1"]), rmse(&["--crop", "0.4,0.6,0.4,0.6"]));
    assert!(corner < 1e-3 && middle > 3.0 * corner, "{corner} {middle}");
}

#[test]
fn different_parts_are_noticed() {
    let dir = folder();
    for (name, crop) in [("left.exr", "0,0.5,0,1"), ("right.exr", "0.5,1,0,1")] {
        succeeds(&dir, &["render", "scene.toml", "-q", "--crop", crop, "-o", name]);
    }
    let output = succeeds(&dir, &["compare", "left.exr", "right.exr"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("different parts") && said.contains("(8, 0)"), "{said}");
    assert!(succeeds(&dir, &["compare", "left.exr", "left.exr"]).stderr.is_empty());
}

#[test]
fn a_difference_picture_has_a_bar() {
    let dir = renders();
    for plot in ["flip", "signed"] {
        succeeds(&dir, &["compare", "a.exr", "dark.exr", "--plot", plot, "-o", "d.png"]);
        let png = read(&dir, "d.png");
        let reader = png::Decoder::new(std::io::Cursor::new(&png)).read_info().expect("a PNG");
        // 16 x 12, magnified 30 times, and the bar.
        assert_eq!((reader.info().width, reader.info().height), (480, 12 * 30 + 100), "{plot}");
        fs::remove_file(dir.path().join("d.png")).expect("it is there");
    }
}

#[test]
fn pixels_that_are_no_numbers_fail() {
    let dir = folder();
    let picture = |name: &str, bad: f32| {
        let channels = SpecificChannels::rgb(|at: exr::math::Vec2<usize>| {
            if at == exr::math::Vec2(3, 1) { (0.5f32, bad, 0.5) } else { (0.5, 0.5, 0.5) }
        });
        exr::image::Image::from_channels((6, 4), channels)
            .write()
            .to_file(dir.path().join(name))
            .expect("written");
    };
    picture("good.exr", 0.5);
    picture("bad.exr", f32::NAN);
    assert_eq!(code(&dir, &["compare", "good.exr", "good.exr"]), Some(0));
    for arguments in [["compare", "good.exr", "bad.exr"], ["compare", "bad.exr", "bad.exr"]] {
        let output = command(&dir, &arguments).output().expect("it runs");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("bad.exr: 1 pixels") && said.contains("column 3 of row 1"), "{said}");
    }
    let object = json(&dir, &["compare", "good.exr", "bad.exr"]);
    assert_eq!((&object["passed"], &object["not_finite"]), (&false.into(), &serde_json::json!([0, 1])));
}

#[test]
fn what_cannot_be_compared_is_said() {
    let dir = renders();
    write(&dir, "text.png", "not a picture");
    let exr = read(&dir, "a.exr");
    write(&dir, "short.exr", &exr[..exr.len() / 2]);
    succeeds(&dir, &["render", "scene.toml", "-q", "-D", "film.width=8", "-o", "small.exr"]);
    let odd = SpecificChannels::build()
        .with_channel("B")
        .with_channel("G")
        .with_channel("R")
        .with_channel("variance.B")
        .with_channel("variance.G")
        .with_channel("variance.R")
        .with_pixel_fn(|_| (0.5f32, 0.5f32, 0.5f32, 1e-3f32, 1e-3f32, -1.0f32));
    let odd = exr::image::Image::from_channels((16, 12), odd);
    odd.write().to_file(dir.path().join("odd.exr")).expect("written");
    fails(&dir, &["compare", "a.exr", "odd.exr"], &["odd.exr", "variance", "-1"]);
    fails(&dir, &["compare", "none.exr", "a.exr"], &["none.exr", "No such file"]);
    fails(&dir, &["compare", "a.exr", "none.exr"], &["none.exr", "No such file"]);
    fails(&dir, &["compare", "a.exr", "."], &["directory"]);
    fails(&dir, &["compare", "a.exr", "small.exr"], &["a.exr", "16 x 12", "small.exr", "8 x 12"]);
    fails(&dir, &["compare", "text.png", "a.exr"], &["text.png", "PNG, JPEG, HDR or EXR"]);
    fails(&dir, &["compare", "a.exr", "short.exr"], &["short.exr", "EXR"]);
    fails(&dir, &["compare", "a.png", "b.png", "--layer", "direct"], &["a.png", "only EXR"]);
    fails(&dir, &["compare", "a.exr", "b.exr", "--layer", "glow"], &["a.exr", "glow", "albedo, direct"]);
    fails(
        &dir,
        &["compare", "a.png", "b.png", "--metric", "z", "--tolerance", "0.1"],
        &["--metric z", "variance"],
    );
    fails(&dir, &["compare", "a.exr", "b.exr", "--crop", "0.5,0.51,0,1"], &["--crop", "no pixel"]);
    for (flag, value) in [
        ("--tolerance", "-1"),
        ("--tolerance", "nan"),
        ("--epsilon", "0"),
        ("--epsilon", "-0.01"),
        ("--pixels-per-degree", "0"),
        ("--pixels-per-degree", "1e9"),
        ("--crop", "0,2,0,1"),
    ] {
        fails(&dir, &["compare", "a.exr", "b.exr", flag, value], &[flag, value]);
    }
    fails(&dir, &["compare", "a.exr", "b.exr", "-o", "d.svg"], &["d.svg", ".png"]);
    fails(&dir, &["compare", "a.exr", "b.exr", "-o", "d.png", "--range", "-1"], &["--range"]);
    fails(&dir, &["compare", "a.exr", "b.exr", "--metric", "rmse"], &["--tolerance"]);
    fails(&dir, &["compare", "a.exr", "b.exr", "--plot", "signed"], &["--output"]);
}

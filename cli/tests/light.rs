//! `rosarium light`: tables, maps, meshes, sensors and what it says of bad input.

mod common;

use common::{command, fails, folder, read, succeeds, write};
use serde_json::Value;
use tempfile::TempDir;

/// A small rose of plain sheets over a floor, under a sky and a lamp.
const SCENE: &str = r#"
[film]
width = 32
height = 24

[camera]
position_mm = [0, -160, 90]
target_mm = [0, 0, 10]
fov_deg = 40

[materials.sheet]
type = "diffuse"
reflectance_adaxial = 0.3
reflectance_abaxial = 0.4
transmittance = 0.2

[materials.ground]
type = "lambert"
reflectance = 0.5

[shapes.rose]
type = "rose"
preset = "wild"
materials = { petal = "sheet", sepal = "sheet", receptacle = "ground", stem = "ground", leaf = "sheet" }

[shapes.floor]
type = "quad"
width_mm = 200
height_mm = 200
position_mm = [0, 0, -60]
material = "ground"

[lights.sky]
type = "constant"
radiance = 0.2

[lights.key]
type = "area"
position_mm = [100, -100, 150]
target_mm = [0, 0, 0]
width_mm = 40
height_mm = 40
radiance = 8
"#;

/// Few elements and rays, so that it takes an instant.
const COARSE: [&str; 8] = ["--elements", "600", "--rays", "32", "--light-samples", "16", "--step-nm", "50"];

fn scene() -> TempDir {
    let dir = folder();
    write(&dir, "scene.toml", SCENE);
    dir
}

fn light<'a>(arguments: &[&'a str]) -> Vec<&'a str> {
    [&["light", "scene.toml"], &COARSE[..], arguments].concat()
}

fn json(dir: &TempDir, arguments: &[&str]) -> Value {
    let output = succeeds(dir, &light(&[arguments, &["--json"]].concat()));
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

/// Columns of a CSV by name, after its comments.
fn column(text: &str, name: &str) -> Vec<String> {
    let mut lines = text.lines().filter(|l| !l.starts_with('#'));
    let at = lines.next().and_then(|h| h.split(',').position(|c| c == name));
    let at = at.unwrap_or_else(|| panic!("no column {name} in\n{text}"));
    lines.map(|l| l.split(',').nth(at).unwrap_or("").to_owned()).collect()
}

#[test]
fn tables_of_organs_and_their_balance() {
    let dir = scene();
    let output = succeeds(&dir, &light(&["-o", "light.csv", "-o", "light.nc", "--bands", "400-700,600-700"]));
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    for words in ["converged after", "absorbed by petal, adaxial", "shapes.floor", "600-700 nm", "closure:"] {
        assert!(printed.contains(words), "no `{words}` in\n{printed}");
    }
    let text = String::from_utf8(read(&dir, "light.csv")).expect("text");
    assert!(text.starts_with("# Rosarium") && text.contains("umol photons"), "{text}");
    let (organs, sides) = (column(&text, "organ"), column(&text, "side"));
    assert_eq!(organs.iter().filter(|o| *o == "petal").count(), 5 * 2 * 2);
    assert_eq!(sides.iter().filter(|s| *s == "abaxial").count() * 2, sides.len());
    let numbers = |name: &str| -> Vec<f64> {
        column(&text, name).iter().map(|v| v.parse().expect("a number")).collect()
    };
    let (incident, absorbed, through) =
        (numbers("incident_w_m2"), numbers("absorbed_w_m2"), numbers("transmitted_w_m2"));
    for (k, organ) in organs.iter().enumerate().filter(|(_, o)| *o == "petal") {
        let reflectance = if sides[k] == "adaxial" { 0.3 } else { 0.4 };
        assert!((through[k] / incident[k] - 0.2).abs() < 1e-3, "{organ} {k}");
        assert!((absorbed[k] / incident[k] - (0.8 - reflectance)).abs() < 2e-3, "{organ} {k}");
    }
    assert!(read(&dir, "light.nc").starts_with(b"CDF\x02"));
    // The same bytes again, on one thread.
    succeeds(&dir, &light(&["-o", "again.csv", "--bands", "400-700", "--bands", "600-700", "-t", "1"]));
    assert_eq!(read(&dir, "light.csv"), read(&dir, "again.csv"));
}

#[test]
fn rows_are_what_is_asked_for() {
    let dir = scene();
    let summary = json(&dir, &[]);
    assert!(summary["bands"][0]["closure"].as_f64().expect("a number").abs() < 0.02);
    assert_eq!(summary["converged"], true);
    for (per, index) in [("shape", None), ("petal", None), ("triangle", Some("triangle"))] {
        succeeds(&dir, &light(&["-o", "light.csv", "--per", per, "-q"]));
        let text = String::from_utf8(read(&dir, "light.csv")).expect("text");
        let rows = column(&text, "side").len();
        match per {
            "petal" => assert_eq!(rows, 5 * 2),
            "shape" => assert_eq!(rows, 3 * 2),
            _ => assert!(rows > 500, "{per}: {rows}"),
        }
        let header = text.lines().find(|l| !l.starts_with('#')).unwrap_or("");
        assert_eq!(header.contains("triangle") || header.contains("element"), index.is_some(), "{header}");
    }
    // Twice the unit is twice the light.
    let watts = |summary: &Value| summary["bands"][0]["emitted_w"].as_f64().expect("W");
    let doubled = json(&dir, &["--unit-lx", "145965.84142"]);
    assert!((watts(&doubled) / watts(&summary) - 2.0).abs() < 1e-6);
    assert!((summary["unit_lx"].as_f64().expect("lx") - 72983.0).abs() < 1.0);
}

#[test]
fn maps_and_meshes() {
    let dir = scene();
    let bake = [
        "--plot",
        "light.png",
        "--quantity",
        "absorbed",
        "--photons",
        "--bake",
        "rose.glb",
        "--bake",
        "rose.ply",
    ];
    succeeds(&dir, &light(&bake));
    assert!(read(&dir, "light.png").starts_with(b"\x89PNG"));
    assert!(read(&dir, "rose.glb").starts_with(b"glTF"));
    let ply = read(&dir, "rose.ply");
    assert!(ply.starts_with(b"ply") && ply.windows(18).any(|w| w == b"property uchar red"));
    // The meshes can be shapes of scenes.
    write(
        &dir,
        "baked.toml",
        SCENE.replace(
            "type = \"quad\"\nwidth_mm = 200\nheight_mm = 200",
            "type = \"mesh\"\nfile = \"rose.glb\"",
        ),
    );
    succeeds(&dir, &["render", "baked.toml", "--spp", "1", "-o", "baked.png"]);
}

#[test]
fn sensors_read_the_light() {
    let dir = scene();
    write(&dir, "places.csv", "x_mm,y_mm,z_mm,nx,ny,nz,name\n0,0,150,0,0,1,above\n0,0,150,0,0,-1,below\n");
    let arguments = ["--sensors", "places.csv", "--sensor", "0,-80,-59,0,0,1", "--sensor-samples", "512"];
    let summary = json(&dir, &[&arguments[..], &["-o", "light.csv", "-o", "light.nc"]].concat());
    let value = |k: usize, name: &str| summary["sensors"][k]["bands"][0][name].as_f64().expect("a number");
    assert!(value(0, "irradiance_w_m2") > value(1, "irradiance_w_m2"));
    assert!(value(0, "irradiance_w_m2_se") < 0.05 * value(0, "irradiance_w_m2"));
    // About 4.6 umol/J of daylight.
    assert!((4.2..5.0).contains(&(value(0, "irradiance_umol_m2_s") / value(0, "irradiance_w_m2"))));
    let text = String::from_utf8(read(&dir, "light-sensors.csv")).expect("text");
    assert_eq!(column(&text, "name"), ["above", "below", "3"]);
}

#[test]
fn without_convergence_the_result_is_kept() {
    let dir = scene();
    let arguments = light(&["-o", "light.csv", "--max-orders", "1"]);
    let output = command(&dir, &arguments).output().expect("it runs");
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.status.code(), Some(1), "{err}");
    assert!(out.contains("not converged after 1 orders") && err.contains("still under way"), "{out}{err}");
    assert!(!read(&dir, "light.csv").is_empty());
}

#[test]
fn mistakes_are_named() {
    let dir = scene();
    for (arguments, words) in [
        (&["--bands", "300-700"][..], &["--bands 300-700", "380 to 780"][..]),
        (&["--bands", "700-400"], &["--bands 700-400"]),
        (&["--bands", "blue"], &["--bands blue", "LOW-HIGH"]),
        (&["--step-nm", "0"], &["--step-nm"]),
        (&["--unit-lx", "-1"], &["--unit-lx"]),
        (&["--unit-lx", "nan"], &["--unit-lx"]),
        (&["--elements", "0"], &["elements"]),
        (&["--residual", "2"], &["residual"]),
        (&["--memory", "24MiB"], &["memory", "would fit"]),
        (&["--sensor", "1,2,3"], &["--sensor 1,2,3", "six numbers"]),
        (&["--sensor", "1,2,3,0,0,0"], &["--sensor", "normal"]),
        (&["--sensors", "none.csv"], &["none.csv", "No such file"]),
        (&["-o", "light.txt"], &["--output light.txt", ".csv or .nc"]),
        (&["--bake", "rose.obj"], &["--bake rose.obj"]),
        (&["-o", "nowhere/light.csv"], &["nowhere"]),
        (&["-D", "materials.sheet.transmittance=0.75"], &["materials.sheet"]),
        (&["-D", "lights={}"], &["light"]),
    ] {
        let all: Vec<&str> = [&["light", "scene.toml"], arguments].concat();
        fails(&dir, &all, words);
    }
    write(&dir, "bad.csv", "x_mm,y_mm,z_mm,nx,ny,nz\n0,0,0,0,0,1\n0,0,inf,0,0,1\n");
    fails(&dir, &["light", "scene.toml", "--sensors", "bad.csv"], &["bad.csv:3", "not finite"]);
    let ball = common::SCENE;
    write(&dir, "ball.toml", ball.replace("type = \"petal\"", "type = \"lambert\"\nreflectance = 0.4"));
    fails(&dir, &["light", "ball.toml", "--per", "petal", "-o", "p.csv"], &["--per", "no petal"]);
}

#[test]
fn false_triangles_are_told_and_left_out() {
    let dir = scene();
    // A square of which one half stands there twice, and a triangle without area.
    write(&dir, "flaws.obj", "v 0 0 0\nv 9 0 0\nv 9 9 0\nv 0 9 0\nf 1 2 3\nf 1 3 4\nf 2 3 1\nf 1 1 2\n");
    let mesh = "type = \"mesh\"\nfile = \"flaws.obj\"";
    write(&dir, "flaws.toml", SCENE.replace("type = \"quad\"\nwidth_mm = 200\nheight_mm = 200", mesh));
    let arguments = [&["light", "flaws.toml"], &COARSE[..], &["--json"]].concat();
    let output = succeeds(&dir, &arguments);
    let summary: Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
    let warnings = summary["warnings"].to_string();
    assert!(warnings.contains("no area") && warnings.contains("another one lies"), "{warnings}");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(stderr.contains("no area"), "{stderr}");
}

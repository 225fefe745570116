//! Every command does what its help says.

mod common;

use common::{command, files, folder, read, succeeds};
use serde_json::Value;

fn stdout(output: &std::process::Output) -> String {
    String::from_utf8(output.stdout.clone()).expect("UTF-8")
}

#[test]
fn every_command_explains_itself_with_an_example() {
    let dir = folder();
    for name in [
        "render",
        "measure",
        "swatch",
        "fit",
        "convert",
        "plot",
        "cells",
        "grow",
        "compare",
        "check",
        "schema",
        "completions",
    ] {
        let help = stdout(&succeeds(&dir, &[name, "--help"]));
        assert!(help.contains(&format!("rosarium {name}")) && help.contains("Example"), "{help}");
    }
    let help = stdout(&succeeds(&dir, &["--help"]));
    assert!(help.contains("Exit codes") && help.contains("rosarium render"), "{help}");
    assert!(stdout(&succeeds(&dir, &["--version"])).starts_with("rosarium 0."));
}

#[test]
fn render_writes_both_formats_and_a_summary() {
    let dir = folder();
    let output =
        succeeds(&dir, &["render", "scene.toml", "-o", "a.exr", "-o", "b.png", "--spp", "3", "-t", "2"]);
    assert!(output.stdout.is_empty());
    let summary = String::from_utf8_lossy(&output.stderr);
    for part in ["a.exr, b.png: 16 x 12 pixels, 3 spp", "Msamples/s"] {
        assert!(summary.contains(part), "{summary}");
    }
    let png = read(&dir, "b.png");
    let reader = png::Decoder::new(std::io::Cursor::new(&png)).read_info().expect("a PNG");
    assert_eq!((reader.info().width, reader.info().height), (16, 12));
    assert!(read(&dir, "a.exr").starts_with(&[0x76, 0x2f, 0x31, 0x01]));
    assert_eq!(files(dir.path()).len(), 3, "{:?}", files(dir.path()));
}

#[test]
fn render_without_arguments_is_the_rose() {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let small = ["-D", "film.width=12", "-D", "film.height=12", "--spp", "1", "-q"];
    let output = succeeds(&dir, &[&["render"], &small[..]].concat());
    assert!(output.stderr.is_empty() && output.stdout.is_empty());
    let names: Vec<String> = files(dir.path()).into_keys().collect();
    assert_eq!(names, ["rose.exr", "rose.png"]);
}

#[test]
fn render_flags_change_the_picture() {
    let dir = folder();
    let picture = |extra: &[&str]| {
        succeeds(&dir, &[&["render", "scene.toml", "-o", "x.png"], extra].concat());
        read(&dir, "x.png")
    };
    let plain = picture(&[]);
    assert_eq!(plain, picture(&[]));
    for extra in [
        &["--seed", "5"][..],
        &["--exposure", "-1.5"],
        &["--tone-map", "linear"],
        &["--integrator", "raytrace"],
        &["-D", "lights.sky.radiance=2"],
        &["-D", "film.filter=box"],
    ] {
        assert!(plain != picture(extra), "{extra:?} changes nothing");
    }
}

#[test]
fn a_lambert_petal_loses_energy_among_its_domes() {
    let dir = folder();
    let arguments = "measure thesis -D cells.profile=cosine -D shading.model=lambert -D shading.albedo=0.5 \
                     --incident 60 --rays 2e4 --json";
    let output = succeeds(&dir, &arguments.split_whitespace().collect::<Vec<_>>());
    let text = stdout(&output);
    assert_eq!(text.trim_end().lines().count(), 1, "{text}");
    let json: Value = serde_json::from_str(&text).expect("one JSON object");
    assert_eq!(json["sample"], "thesis");
    let incidence = &json["incidences"][0];
    let number = |key: &str| incidence[key].as_f64().unwrap_or_else(|| panic!("{key} in {incidence}"));
    assert_eq!(number("incident_deg"), 60.0);
    // Light that meets a dome twice is absorbed twice: less than the albedo, but not much less.
    assert!((0.2..0.5).contains(&number("reflectance")), "{incidence}");
    assert_eq!(number("transmittance"), 0.0);
    assert!((number("reflectance") + number("absorptance") - 1.0).abs() < 1e-9, "{incidence}");
    assert!(number("retro_index") > 1.0, "{incidence}");
    for key in ["reflectance_se", "transmittance_se", "retro_index_se"] {
        assert!(number(key) >= 0.0);
    }
    assert_eq!(files(dir.path()).len(), 1);
}

#[test]
fn a_flat_lambert_petal_returns_its_albedo() {
    let dir = folder();
    let arguments = "measure thesis -D cells.profile=flat -D shading.model=lambert -D shading.albedo=0.5 \
                     --incident 0,45 --rays 20000 --json";
    let json: Value =
        serde_json::from_str(&stdout(&succeeds(&dir, &arguments.split_whitespace().collect::<Vec<_>>())))
            .expect("JSON");
    for incidence in json["incidences"].as_array().expect("a list") {
        let (value, error) = (&incidence["reflectance"], &incidence["reflectance_se"]);
        let (value, error) = (value.as_f64().expect("a number"), error.as_f64().expect("a number"));
        assert!((value - 0.5).abs() <= 3.0 * error + 1e-6, "{incidence}");
    }
}

#[test]
fn measure_writes_tables_and_plots() {
    let dir = folder();
    let preset = "[cells]\nheight_um = 20\n";
    common::write(&dir, "mine.toml", preset);
    let output = succeeds(
        &dir,
        &[
            "measure",
            "mine.toml",
            "--incident",
            "0,60",
            "--rays",
            "1e4",
            "--wavelengths",
            "450,550,650,700,750",
            "--side",
            "abaxial",
            "-o",
            "t.csv",
            "--plot",
            "l.svg",
            "--plot",
            "l.png",
        ],
    );
    let table = stdout(&output);
    assert!(table.contains("mine: abaxial side") && table.contains("60 deg"), "{table}");
    let csv = String::from_utf8(read(&dir, "t.csv")).expect("UTF-8");
    assert!(csv.starts_with('#') && csv.contains("height_um = 20"), "{}", &csv[..500]);
    assert!(String::from_utf8_lossy(&read(&dir, "l.svg")).contains("<svg"));
    assert!(read(&dir, "l.png").starts_with(b"\x89PNG"));
}

#[test]
fn a_petal_of_tissue_has_spectra_of_both_sides() {
    let dir = folder();
    let arguments = "measure rote_rose --spectral --incident 0 --rays 3e3 --bands 400..700:20 --json -o t.csv \
                     --spectra s.csv --spectra s.svg";
    let text = stdout(&succeeds(&dir, &arguments.split_whitespace().collect::<Vec<_>>()));
    let report: Value = serde_json::from_str(&text).expect("one JSON object");
    assert_eq!(report["colors"].as_array().map(Vec::len), Some(2));
    // Red pigment: red light comes back, green does not; much goes through in the red.
    let red = report["colors"][0]["reflected"]["lab"][1].as_f64().expect("a number");
    assert!(red > 15.0, "{red}");
    for (side, name) in ["adaxial", "abaxial"].into_iter().enumerate() {
        let bands = &report["measurements"][side]["incidences"][0]["bands"];
        assert_eq!(bands.as_array().map(Vec::len), Some(16));
        assert_eq!(report["measurements"][side]["cut_off"], 0);
        let csv = String::from_utf8(read(&dir, &format!("t-{name}.csv"))).expect("UTF-8");
        assert!(csv.contains(&format!("side = \"{name}\"")), "{name}");
    }
    let csv = String::from_utf8(read(&dir, "s.csv")).expect("UTF-8");
    assert!(csv.contains("abaxial_0deg_transmittance_se") && csv.contains("\n700.0,"), "{csv}");
    assert!(String::from_utf8_lossy(&read(&dir, "s.svg")).contains("abaxial side lit"));
    // Bands that are no colour are said, and the rest is measured.
    let arguments =
        ["measure", "thesis", "--spectral", "--side", "adaxial", "--bands", "550", "--rays", "1e3"];
    assert!(stdout(&succeeds(&dir, &arguments)).contains("no colour from these bands"));
}

#[test]
fn a_sheet_of_petals_is_drawn() {
    let dir = folder();
    common::write(&dir, "mine.toml", "[cells]\nheight_um = 20\n");
    succeeds(&dir, &["swatch", "mine.toml", "white", "--rays", "2e3", "-o", "sheet.svg", "-D", "age=0.5"]);
    let svg = String::from_utf8(read(&dir, "sheet.svg")).expect("UTF-8");
    assert!(svg.contains(">mine<") && svg.contains(">white<") && svg.contains("age 0.5"));
}

#[test]
fn threads_do_not_change_a_measurement() {
    let dir = folder();
    let table = |threads: &str, name: &str| {
        succeeds(
            &dir,
            &["measure", "thesis", "--incident", "30", "--rays", "2e4", "-o", name, "-t", threads],
        );
        read(&dir, name)
    };
    assert!(table("1", "a.csv") == table("2", "b.csv"));
}

#[test]
fn laws_are_measured_plotted_and_written() {
    let dir = folder();
    succeeds(&dir, &["reproduce", "laws", "--walks", "1000", "-o", "docs"]);
    let page = String::from_utf8(read(&dir, "docs/laws.md")).unwrap();
    let plots: Vec<&str> = page.split("](plots/").skip(1).filter_map(|rest| rest.split(')').next()).collect();
    assert_eq!(plots.len(), 9, "{plots:?}");
    for plot in plots {
        let svg = String::from_utf8(read(&dir, &format!("docs/plots/{plot}"))).unwrap();
        assert!(svg.starts_with("<svg") && !svg.contains("NaN"), "{plot}");
    }
    assert!(page.contains("`rosarium reproduce laws --walks 1000 -o docs`"));
}

#[test]
fn cells_are_exported_and_plotted() {
    let dir = folder();
    succeeds(
        &dir,
        &[
            "cells",
            "thesis",
            "-o",
            "c.ply",
            "-o",
            "c.obj",
            "--plot",
            "c.png",
            "--plot",
            "c.svg",
            "--resolution",
            "4",
        ],
    );
    assert!(read(&dir, "c.ply").starts_with(b"ply"));
    assert!(String::from_utf8_lossy(&read(&dir, "c.obj")).lines().any(|l| l.starts_with("f ")));
    assert!(read(&dir, "c.png").starts_with(b"\x89PNG"));
    let svg = String::from_utf8(read(&dir, "c.svg")).expect("UTF-8");
    assert!(svg.contains("pitch 23 µm, height 37 µm"), "{}", &svg[..500]);
    let size = files(dir.path())["c.ply"];
    succeeds(&dir, &["cells", "thesis", "-o", "c.ply", "--resolution", "8"]);
    assert!(files(dir.path())["c.ply"] > 2 * size);
}

#[test]
fn a_rose_grows_in_every_format_and_reads_back() {
    let dir = folder();
    for name in ["r.ply", "r.obj", "r.glb"] {
        succeeds(&dir, &["grow", "-o", name, "-D", "detail=0.3", "--preset", "wild"]);
        let mesh = rosarium::io::read_mesh(&read(&dir, name)).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(mesh.triangles.len() > 500, "{name}: {}", mesh.triangles.len());
    }
    let first = read(&dir, "r.ply");
    succeeds(&dir, &["grow", "-o", "r.ply", "-D", "detail=0.3", "--preset", "wild", "--seed", "99"]);
    assert!(first != read(&dir, "r.ply"), "the seed changes nothing");
}

#[test]
fn a_grown_rose_renders_as_a_mesh() {
    let dir = folder();
    succeeds(&dir, &["grow", "-o", "r.glb", "-D", "detail=0.2"]);
    let scene = common::SCENE.replace(
        "type = \"sphere\"\nradius_mm = 10\nsubdivisions = 2\n",
        "type = \"mesh\"\nfile = \"r.glb\"\n",
    );
    common::write(&dir, "mesh.toml", scene);
    succeeds(&dir, &["render", "mesh.toml", "-o", "m.png"]);
}

#[test]
fn check_passes_and_rejects_what_is_wrong() {
    let dir = folder();
    let json: Value = serde_json::from_str(&stdout(&succeeds(&dir, &["check", "--json"]))).expect("JSON");
    let models = json["models"].as_array().expect("a list");
    let named = |name: &str| models.iter().find(|m| m["name"] == name).unwrap_or_else(|| panic!("{name}"));
    assert_eq!(json["not_as_expected"], 0);
    assert_eq!(named("lambert")["passed"], true);
    assert_eq!(named("petal thesis")["passed"], true);
    for (name, test) in [
        ("literal phong", "reciprocity"),
        ("wrong pdf", "chi_square"),
        ("wrong reciprocity", "reciprocity"),
        ("wrong albedo", "energy"),
    ] {
        let model = named(name);
        assert_eq!(
            (&model["passed"], &model["must_fail"]),
            (&Value::from(false), &Value::from(test)),
            "{model}"
        );
    }
}

#[test]
fn schema_is_json() {
    let dir = folder();
    let json: Value = serde_json::from_str(&stdout(&succeeds(&dir, &["schema"]))).expect("JSON");
    assert!(json["properties"]["film"].is_object(), "{json}");
}

#[test]
fn completions_for_every_shell() {
    let dir = folder();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        assert!(stdout(&succeeds(&dir, &["completions", shell])).contains("measure"), "{shell}");
    }
}

#[test]
fn a_closed_pipe_is_no_error() {
    let dir = folder();
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_rosarium"))
        .arg("schema")
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("it runs");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("it ends");
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    drop(dir);
}

#[test]
fn verbose_tells_about_the_scene() {
    let dir = folder();
    let output = command(&dir, &["render", "scene.toml", "-o", "x.png", "-v"]).output().expect("it runs");
    let log = String::from_utf8_lossy(&output.stderr);
    assert!(log.contains("scene ready") && log.contains("triangles"), "{log}");
}

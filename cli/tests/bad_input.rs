//! Wrong input ends with exit code 2, one message that names the place, and no file.

mod common;

use common::{SCENE, command, fails, folder, write};

/// The scene with one piece of text replaced, and the line where the replacement stands.
fn changed(from: &str, to: &str) -> (String, usize) {
    assert_eq!(SCENE.matches(from).count(), 1, "`{from}` stands in the scene once");
    let line = SCENE.split(from).next().map_or(0, |before| before.matches('\n').count()) + 1;
    (SCENE.replace(from, to), line)
}

#[test]
fn missing_file() {
    let dir = folder();
    fails(&dir, &["render", "none.toml"], &["none.toml", "No such file"]);
    fails(&dir, &["measure", "none.toml"], &["none.toml", "No such file"]);
    fails(&dir, &["cells", "none.toml"], &["none.toml", "No such file"]);
}

#[test]
fn files_that_are_no_scene() {
    let dir = folder();
    write(&dir, "empty.toml", "");
    fails(&dir, &["render", "empty.toml"], &["empty.toml:1", "empty"]);
    fails(&dir, &["measure", "empty.toml"], &["empty.toml:1", "empty"]);
    write(&dir, "binary.toml", b"[film]\nwidth = \xff\xfe");
    fails(&dir, &["render", "binary.toml"], &["binary.toml:2", "UTF-8"]);
    write(&dir, "broken.toml", "[film]\nwidth = = 3\n");
    fails(&dir, &["render", "broken.toml"], &["broken.toml:2"]);
    fails(&dir, &["render", "."], &["directory"]);
}

#[test]
fn wrong_values_name_file_line_and_key() {
    let dir = folder();
    for (from, to, key, offset) in [
        ("width = 16", "width = \"wide\"", "film.width", 0),
        ("width = 16", "width = -16", "film.width", 0),
        ("width = 16", "width = 0", "film.width", 0),
        ("height = 12", "height = 12\nheigth = 3", "film.heigth", 1),
        ("fov_deg = 30", "fov_deg = nan", "camera.fov_deg", 0),
        ("position_mm = [0, -60, 10]", "position_mm = [0, nan, 10]", "camera.position_mm", 0),
        ("spp = 2", "spp = 0", "render.spp", 0),
        ("samples = 2", "samples = 0", "petal.samples", 0),
        ("samples = 2", "cells.height_um = -3", "petal.cells.height_um", 0),
        ("samples = 2", "cells.pitch_um = 0", "petal.cells.pitch_um", 0),
        ("samples = 2", "cells.pitch_um = nan", "petal.cells.pitch_um", 0),
        ("radius_mm = 10", "radius_mm = -1", "shapes.ball.radius_mm", 0),
        ("radiance = 8", "radiance = nan", "lights.key.radiance", 0),
        ("material = \"petal\"", "material = \"petla\"", "shapes.ball.material", 0),
        ("type = \"area\"", "type = \"aera\"", "lights.key.type", 0),
    ] {
        let (text, line) = changed(from, to);
        write(&dir, "bad.toml", text);
        fails(&dir, &["render", "bad.toml"], &[&format!("bad.toml:{}", line + offset), key]);
    }
}

#[test]
fn wrong_petals_name_file_line_and_key() {
    let dir = folder();
    for (text, line, key) in [
        ("[cells]\nheight_um = -1\n", 2, "cells.height_um"),
        ("[cells]\npitch_um = 0\n", 2, "cells.pitch_um"),
        ("[cells]\npitch_um = nan\n", 2, "cells.pitch_um"),
        ("\n[cells]\nprofile = \"sphere\"\n", 3, "cells.profile"),
        ("[cells]\npich_um = 3\n", 2, "cells.pich_um"),
        ("cells = 3\n", 1, "cells"),
    ] {
        write(&dir, "bad.toml", text);
        for name in ["measure", "cells"] {
            fails(&dir, &[name, "bad.toml"], &[&format!("bad.toml:{line}"), key]);
        }
    }
    for (text, key) in [
        ("[shading]\nanthocyanin_ug_per_cm2 = -1\n", "shading.anthocyanin_ug_per_cm2"),
        (
            "[shading.epidermis]\ndiffuse = 1.5\nspecular = 0\nexponent = 1\ntransmittance = 0\n",
            "shading.epidermis.diffuse",
        ),
    ] {
        write(&dir, "bad.toml", text);
        fails(&dir, &["measure", "bad.toml", "--rays", "100"], &["bad.toml:2", key]);
    }
}

#[test]
fn denoisers_that_are_none() {
    let dir = folder();
    let render = ["render", "scene.toml", "-o", "a.png"];
    write(&dir, "wrong.so", "no library");
    fails(&dir, &[&render[..], &["--denoise", "--oidn", "none.so"]].concat(), &["--oidn none.so"]);
    fails(
        &dir,
        &[&render[..], &["--denoise", "--oidn", "wrong.so"]].concat(),
        &["--oidn wrong.so", "is not Open Image"],
    );
    fails(&dir, &[&render[..], &["--denoise", "--oidn", "."]].concat(), &["--oidn .", "does not hold"]);
    fails(&dir, &[&render[..], &["--oidn", "wrong.so"]].concat(), &["--oidn", "goes with --denoise"]);
    let output =
        command(&dir, &[&render[..], &["--denoise"]].concat()).env("OIDN_LIBRARY_PATH", "none").output();
    let output = output.expect("it runs");
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("OIDN_LIBRARY_PATH none"));
}

#[test]
fn unknown_names() {
    let dir = folder();
    fails(&dir, &["measure", "thesys"], &["thesys", "presets are thesis"]);
    fails(&dir, &["cells", "thesys"], &["thesys", "presets are thesis"]);
    fails(&dir, &["grow", "--preset", "tulip"], &["--preset", "tulip", "hybrid_tea"]);
    fails(&dir, &["render", "scene.toml", "--integrator", "magic"], &["--integrator", "magic", "raytrace"]);
    fails(&dir, &["render", "scene.toml", "--tone-map", "hdr"], &["--tone-map", "agx"]);
}

#[test]
fn wrong_overrides() {
    let dir = folder();
    fails(
        &dir,
        &["render", "scene.toml", "-D", "film.widht=3"],
        &["-D film.widht=3", "did you mean `width`"],
    );
    fails(&dir, &["render", "scene.toml", "-D", "film.width=big"], &["-D film.width=big"]);
    fails(&dir, &["render", "scene.toml", "-D", "film.width=0"], &["-D film.width=0"]);
    fails(&dir, &["render", "scene.toml", "-D", "film.width"], &["-D", "KEY=VALUE"]);
    fails(&dir, &["measure", "thesis", "-D", "cells.hight_um=3"], &["-D cells.hight_um=3", "height_um"]);
    fails(&dir, &["measure", "thesis", "-D", "cells.height_um=-3"], &["-D cells.height_um=-3"]);
    fails(&dir, &["cells", "thesis", "-D", "cells.pitch_um=0"], &["-D cells.pitch_um=0"]);
    fails(&dir, &["grow", "-D", "petels=3"], &["-D petels=3", "petals"]);
    fails(&dir, &["grow", "-D", "petals=0"], &["-D petals=0"]);
    fails(&dir, &["grow", "-D", "petal.length_mm=nan"], &["-D petal.length_mm=nan"]);
}

#[test]
fn wrong_meshes() {
    let dir = folder();
    let sphere = "type = \"sphere\"\nradius_mm = 10\nsubdivisions = 2\n";
    let (text, line) = changed(sphere, "type = \"mesh\"\nfile = \"m.ply\"\n");
    write(&dir, "mesh.toml", text);
    let place = format!("mesh.toml:{}", line + 1);
    fails(&dir, &["render", "mesh.toml"], &[&place, "shapes.ball.file", "m.ply", "No such file"]);
    let ply = |faces: &str, count: usize| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
             element face {count}\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n{faces}"
        )
    };
    for content in [
        ply("3 0 1 7\n", 1),
        ply("3 0 1 -2\n", 1),
        ply("", 0),
        ply("3 0 1 2\n", 1000),
        String::new(),
        "ply\nrubbish\n".to_owned(),
        "not a mesh at all\n".to_owned(),
    ] {
        write(&dir, "m.ply", &content);
        fails(&dir, &["render", "mesh.toml"], &[&place, "shapes.ball.file", "m.ply"]);
    }
}

#[test]
fn wrong_images() {
    let dir = folder();
    let (text, line) =
        changed("type = \"constant\"\nradiance = 0.2\n", "type = \"image\"\nfile = \"sky.png\"\n");
    write(&dir, "image.toml", text);
    let place = format!("image.toml:{}", line + 1);
    fails(&dir, &["render", "image.toml"], &[&place, "lights.sky.file", "sky.png", "No such file"]);
    write(&dir, "sky.png", "this is not a picture");
    fails(&dir, &["render", "image.toml"], &[&place, "lights.sky.file", "sky.png"]);
    // An environment spans 360 by 180 degrees: it is twice as wide as high.
    let mut square = Vec::new();
    let mut encoder = png::Encoder::new(&mut square, 4, 4);
    encoder.set_color(png::ColorType::Rgb);
    let mut writer = encoder.write_header().expect("a header");
    writer.write_image_data(&[128; 48]).expect("the data");
    writer.finish().expect("the end");
    write(&dir, "sky.png", &square[..square.len() - 20]);
    fails(&dir, &["render", "image.toml"], &[&place, "sky.png"]);
    write(&dir, "sky.png", &square);
    fails(&dir, &["render", "image.toml"], &[&place, "sky.png", "4 x 4"]);
}

#[test]
fn outputs_are_checked_before_the_work() {
    let dir = folder();
    std::fs::create_dir(dir.path().join("folder.png")).expect("a folder");
    // Work that would take for ever.
    let long = ["render", "scene.toml", "--spp", "4000000000", "-o"];
    for (output, words) in [
        ("nowhere/a.png", &["nowhere/a.png", "No such file"][..]),
        ("folder.png", &["folder.png", "not a file"]),
        ("scene.toml/a.png", &["scene.toml/a.png"]),
        ("a.jpg", &["a.jpg", ".exr or .png"]),
        ("a", &["--output a", ".exr or .png"]),
        ("", &["--output"]),
    ] {
        fails(&dir, &[&long[..], &[output]].concat(), words);
    }
    fails(&dir, &[&long[..], &["a.png", "-o", "a.png"]].concat(), &["a.png", "twice"]);
    let long = ["measure", "thesis", "--rays", "1e15"];
    fails(&dir, &[&long[..], &["-o", "nowhere/t.csv"]].concat(), &["nowhere/t.csv"]);
    fails(&dir, &[&long[..], &["-o", "t.txt"]].concat(), &["t.txt", ".csv"]);
    fails(&dir, &[&long[..], &["--plot", "p.pdf"]].concat(), &["--plot p.pdf", ".svg or .png"]);
    fails(&dir, &["cells", "thesis", "-o", "c.stl"], &["c.stl", ".ply or .obj"]);
    fails(&dir, &["grow", "-o", "nowhere/r.ply"], &["nowhere/r.ply"]);
}

#[test]
fn wrong_numbers_of_flags() {
    let dir = folder();
    for (flag, value) in [
        ("--spp", "0"),
        ("--spp", "-1"),
        ("--spp", "many"),
        ("--threads", "0"),
        ("--seed", "-1"),
        ("--crop", "0,1,0,1.5"),
        ("--crop", "-0.1,1,0,1"),
        ("--crop", "0.5,0.2,0,1"),
        ("--crop", "0,1"),
        ("--crop", "nan,1,0,1"),
        ("--crop", "0.5,0.500001,0,1"),
        ("--exposure", "nan"),
        ("--exposure", "1000"),
    ] {
        fails(&dir, &["render", "scene.toml", flag, value], &[flag]);
    }
    for walks in ["0", "999", "1e12", "many"] {
        fails(&dir, &["reproduce", "laws", "--walks", walks], &["--walks"]);
    }
    for (flag, value) in [
        ("--rays", "0"),
        ("--rays", "1.5"),
        ("--rays", "nan"),
        ("--rays", "-1e6"),
        ("--incident", "90"),
        ("--incident", "-5"),
        ("--incident", "nan"),
        ("--incident", "0,0"),
        ("--incident", ""),
        ("--wavelengths", "0"),
        ("--wavelengths", "green"),
        ("--side", "left"),
    ] {
        fails(&dir, &["measure", "thesis", flag, value], &[flag]);
    }
    fails(&dir, &["cells", "thesis", "--resolution", "0"], &["--resolution"]);
    fails(&dir, &["render", "scene.toml", "-q", "-v"], &["--quiet", "--verbose"]);
    fails(&dir, &["paint"], &["paint"]);
}

//! Mistakes of meaning, each with the place that its message names, and what a compiled scene holds.

use super::*;
use crate::Error;
use crate::error::SourceError;

/// The smallest valid scene.
const SMALL: &str = r#"
[film]
width = 8
height = 8
[camera]
position_mm = [0, -50, 10]
target_mm = [0, 0, 0]
[materials.white]
type = "diffuse"
reflectance_adaxial = 0.5
transmittance = 0.2
[shapes.ground]
type = "quad"
material = "white"
width_mm = 20
height_mm = 20
[lights.sky]
type = "constant"
"#;

fn compiled(text: &str, overrides: &[&str], assets: &dyn Assets) -> Result<Scene, Error> {
    let overrides: Vec<Override> = overrides.iter().map(|o| Override::parse(o).unwrap()).collect();
    let Loaded { description, source } = load::<SceneDescription>(text, "a.toml", &overrides)?;
    compile(&description, assets).map_err(|e| source.locate(e))
}

fn fails_with(text: &str, overrides: &[&str], assets: &dyn Assets) -> SourceError {
    match compiled(text, overrides, assets) {
        Err(Error::Source(e)) => *e,
        Err(e) => panic!("expected an error with a place, got {e}"),
        Ok(_) => panic!("expected an error"),
    }
}

fn fails(text: &str, overrides: &[&str]) -> SourceError {
    fails_with(text, overrides, &MemoryAssets::default())
}

/// Checks that adding `lines` at the end of the small scene fails at its last line, at `key`, saying `what`.
fn last_line_fails(lines: &str, key: &str, what: &str) {
    let text = format!("{SMALL}{lines}");
    let e = fails(&text, &[]);
    assert_eq!(e.key, key, "{e}");
    assert_eq!(e.line, Some(text.trim_end().lines().count()), "{e}");
    assert!(e.what.contains(what), "{e}");
}

#[test]
fn small_scene_compiles() {
    let scene = compiled(SMALL, &[], &MemoryAssets::default()).unwrap();
    assert_eq!((scene.shapes.len(), scene.materials.len(), scene.lights.emitters().len()), (1, 1, 1));
    assert_eq!(scene.bvh.len(), 2);
}

#[test]
fn shipped_scenes_compile() {
    for text in [DEFAULT_SCENE, include_str!("../../scenes/thesis.toml")] {
        let scene = compiled(text, &["shapes.rose.rose.detail=0.3"], &MemoryAssets::default()).unwrap();
        let petals = scene.shapes.iter().filter(|s| s.petal_id > 0).count();
        assert!((30..=45).contains(&petals), "{petals} petals");
        let mut ids: Vec<u32> = scene.shapes.iter().map(|s| s.organ_id).filter(|&i| i > 0).collect();
        ids.sort_unstable();
        assert!(ids.iter().enumerate().all(|(i, id)| *id == i as u32 + 1), "{ids:?}");
        // The camera sees the flower.
        let petal = scene.shapes.iter().find(|s| s.petal_id == 1).unwrap();
        let middle = (petal.mesh.bounds().0 + petal.mesh.bounds().1) / 2.0;
        let film = scene.camera.project(middle).unwrap();
        assert!((film - 0.5).abs().max_element() < 0.3, "{film}");
    }
}

#[test]
fn values_without_meaning() {
    for (text, key, line, what) in [
        ("width = 8", "film.width = 0", 3, "0 is not within 1 to 32768"),
        ("height = 8", "film.height = 99999", 4, "99999"),
        ("position_mm = [0, -50, 10]", "camera.position_mm = [0, nan, 10]", 6, "finite"),
        ("target_mm = [0, 0, 0]", "camera.target_mm = [0, -50, 10]", 7, "looks nowhere"),
        ("transmittance = 0.2", "materials.white.transmittance = 0.7", 11, "at 380 nm"),
        ("transmittance = 0.2", "materials.white.transmittance = -0.1", 11, "not within 0 to 1"),
        ("transmittance = 0.2", "materials.white.transmittance = \"red\"", 11, "no colour"),
        ("transmittance = 0.2", "materials.white.transmittance = [0, 0, 2]", 11, "not within 0 to 1"),
        (
            "transmittance = 0.2",
            "materials.white.transmittance = { illuminant = \"A\" }",
            11,
            "no reflectance",
        ),
        ("material = \"white\"", "shapes.ground.material = \"wite\"", 14, "did you mean `white`?"),
        ("width_mm = 20", "shapes.ground.width_mm = 0", 15, "above 0"),
        ("width_mm = 20", "shapes.ground.width_mm = -3", 15, "above 0"),
        ("height_mm = 20", "shapes.ground.height_mm = nan", 16, "NaN"),
    ] {
        let (path, value) = key.split_once(" = ").unwrap();
        let name = path.rsplit('.').next().unwrap();
        assert_eq!(SMALL.matches(text).count(), 1, "{text}");
        // In the file: the error points at the value.
        let e = fails(&SMALL.replace(text, &format!("{name} = {value}")), &[]);
        assert_eq!((e.key.as_str(), e.line), (path, Some(line)), "{e}");
        assert!(e.to_string().starts_with(&format!("a.toml:{line}: {path}: ")), "{e}");
        assert!(e.what.contains(what), "{e}");
        // A table is marked by its key.
        let marked = if value.starts_with('{') { name } else { value };
        assert_eq!(&e.text[e.span.clone()], marked, "{e}");
        // From outside: it names the argument.
        let e = fails(SMALL, &[&format!("{path}={value}")]);
        assert!(e.to_string().starts_with(&format!("-D {path}={value}: ")), "{e}");
        assert!(e.what.contains(what), "{e}");
    }
}

#[test]
fn defaults_that_do_not_fit_point_at_their_table() {
    let e = fails(&SMALL.replace("transmittance = 0.2\n", ""), &["materials.white.reflectance_adaxial=-1"]);
    assert!(e.to_string().starts_with("-D materials.white.reflectance_adaxial=-1: "), "{e}");
    let text = SMALL.replace("target_mm = [0, 0, 0]\n", "").replace("[0, -50, 10]", "[0, 0, 60]");
    let e = fails(&text, &[]);
    assert_eq!((e.key.as_str(), e.line), ("camera.target_mm", Some(5)), "{e}");
    assert!(e.what.contains("the file does not set this key"), "{e}");
}

#[test]
fn render_and_petal() {
    last_line_fails("[render]\nspp = 0\n", "render.spp", "at least 1");
    last_line_fails("[render]\nmax_depth = 0\n", "render.max_depth", "within 1");
    last_line_fails("[petal]\nsamples = 0\n", "petal.samples", "within 1");
    last_line_fails("[petal.cells]\npitch_um = 0\n", "petal.cells.pitch_um", "");
    assert!(fails(SMALL, &["render.spp=0"]).to_string().starts_with("-D render.spp=0: "));
}

#[test]
fn cameras() {
    let camera = |keys: &str| SMALL.replace("target_mm = [0, 0, 0]", keys);
    for (keys, key, line, what) in [
        ("up = [0, 0, 0]", "camera.up", 7, "points nowhere"),
        ("target_mm = [0, 50, -10]\nup = [0, 5, -1]", "camera.up", 8, "looks along"),
        ("fov_deg = 180", "camera.fov_deg", 7, "179"),
        ("fov_deg = 0", "camera.fov_deg", 7, "0.01"),
        ("f_number = 0", "camera.f_number", 7, "above 0"),
        ("aperture_radius_mm = -1", "camera.aperture_radius_mm", 7, "zero or more"),
        ("f_number = 2\nfocus_mm = 0", "camera.focus_mm", 8, "above 0"),
        ("fov_deg = 9\nfocal_length_mm = 85", "camera.focal_length_mm", 8, "not both"),
        ("f_number = 2\nfocus_point_mm = [0, -90, 10]", "camera.focus_point_mm", 8, "behind"),
    ] {
        let e = fails(&camera(keys), &[]);
        assert_eq!((e.key.as_str(), e.line), (key, Some(line)), "{e}");
        assert!(e.what.contains(what), "{e}");
    }
    let lens = camera("f_number = 2.8\nfov_deg = 30\nblades = 7");
    assert!(compiled(&lens, &[], &MemoryAssets::default()).is_ok());
}

#[test]
fn nothing_to_see_or_no_light() {
    let e = fails(SMALL.split("[lights.sky]").next().unwrap(), &[]);
    assert_eq!((e.key.as_str(), e.line), ("lights", None), "{e}");
    assert!(e.to_string().starts_with("a.toml: lights: the scene has no light"), "{e}");
    let e = fails("[lights.sky]\ntype = \"constant\"\n", &[]);
    assert!(e.to_string().starts_with("a.toml: shapes: the scene has no shape"), "{e}");
}

#[test]
fn lights() {
    last_line_fails("radiance = -1\n", "lights.sky.radiance", "zero or more");
    last_line_fails("radiance = inf\n", "lights.sky.radiance", "zero or more");
    last_line_fails("spectrum = [0, 0, 0]\n", "lights.sky.spectrum", "no visible light");
    last_line_fails("spectrum = { illuminant = \"D66\" }\n", "lights.sky.spectrum.illuminant", "D65");
    last_line_fails("spectrum = { blackbody_k = 3 }\n", "lights.sky.spectrum.blackbody_k", "500");
    last_line_fails(
        "spectrum = { blackbody_k = 3000, illuminant = \"A\" }\n",
        "lights.sky.spectrum",
        "exactly one",
    );
    let sun = "[lights.sun]\ntype = \"distant\"\n";
    last_line_fails(&format!("{sun}elevation_deg = 91\n"), "lights.sun.elevation_deg", "-90 to 90");
    last_line_fails(&format!("{sun}angular_radius_deg = 90\n"), "lights.sun.angular_radius_deg", "excluded");
    last_line_fails(&format!("{sun}direction = [0, 0, 0]\n"), "lights.sun.direction", "nowhere");
    last_line_fails(
        &format!("{sun}azimuth_deg = 3\ndirection = [0, 0, 1]\n"),
        "lights.sun.direction",
        "not both",
    );
    let box_ = "[lights.box]\ntype = \"area\"\nposition_mm = [0, 0, 50]\n";
    last_line_fails(
        &format!("{box_}width_mm = 3\ntarget_mm = [0, 0, 50]\n"),
        "lights.box.target_mm",
        "own place",
    );
    last_line_fails(
        &format!("{box_}target_mm = [0, 0, 0]\nwidth_mm = 0\n"),
        "lights.box.width_mm",
        "above 0",
    );
    last_line_fails(
        &format!("{box_}normal = [0, 0, -1]\nwidth_mm = 1\nradius_mm = 3\n"),
        "lights.box.radius_mm",
        "no such",
    );
    let e = fails(&format!("{SMALL}{box_}normal = [0, 0, -1]\n"), &[]);
    assert_eq!(e.key, "lights.box", "{e}");
    assert!(e.what.contains("missing key `width_mm`"), "{e}");
}

#[test]
fn skies() {
    let sky = "[lights.s]\ntype = \"sky\"\n";
    let dated = "latitude_deg = 52\nlongitude_deg = 13\ndate_time";
    for (keys, key, what) in [
        ("turbidity = 1.9", "turbidity", "2 to 10"),
        ("turbidity = nan", "turbidity", "2 to 10"),
        ("elevation_deg = -1", "elevation_deg", "0 to 90"),
        ("azimuth_deg = inf", "azimuth_deg", "finite"),
        ("scale = -1", "scale", "zero or more"),
        ("sky_scale = inf", "sky_scale", "zero or more"),
        ("ground = 1.5", "ground", ""),
        ("latitude_deg = 50", "latitude_deg", "needs `date_time`"),
        ("date_time = \"2026-06-21T12:00Z\"", "date_time", "`latitude_deg`"),
        ("date_time = \"noon\"\nlongitude_deg = 13\nlatitude_deg = 91", "latitude_deg", "90"),
    ] {
        last_line_fails(&format!("{sky}{keys}\n"), &format!("lights.s.{key}"), what);
    }
    last_line_fails(&format!("{sky}{dated} = \"2026-06-21T12:00\"\n"), "lights.s.date_time", "offset");
    last_line_fails(
        &format!("{sky}{dated} = \"2026-06-21T23:00Z\"\n"),
        "lights.s.date_time",
        "below the horizon",
    );
    let both = format!("{sky}{dated} = \"2026-06-21T12:00Z\"\nelevation_deg = 30\n");
    last_line_fails(&both, "lights.s.elevation_deg", "not both");

    // In June at noon the sun stands in the south, -y, and high; the sky and the sun are two lights.
    let text = format!("{SMALL}{sky}{dated} = \"2026-06-21T11:08Z\"\n");
    let scene = compiled(&text, &[], &MemoryAssets::default()).unwrap();
    let [Emitter::Sky(_), Emitter::Distant { frame, .. }, _] = scene.lights.emitters() else {
        panic!("{:?}", scene.lights.emitters().len())
    };
    assert!(
        frame.n.x.abs() < 0.01 && frame.n.y < 0.0 && (frame.n.z - 61.4f32.to_radians().sin()).abs() < 2e-3
    );
    let shade = compiled(&text, &["lights.s.sun=false"], &MemoryAssets::default()).unwrap();
    assert_eq!(shade.lights.emitters().len(), 2);
}

#[test]
fn views() {
    for (key, value, what) in [
        ("white_balance_k", "1000", "1500"),
        ("white_balance_k", "nan", "1500"),
        ("tint", "151", "-150 to 150"),
        ("vignetting", "-0.1", "0 to 20"),
        ("grain", "nan", "0 to 1"),
    ] {
        let text = format!("[film]\n{key} = {value}\n{SMALL}");
        let text = if SMALL.contains("[film]") {
            SMALL.replace("[film]", &format!("[film]\n{key} = {value}"))
        } else {
            text
        };
        let e = fails(&text, &[]);
        assert_eq!(e.key, format!("film.{key}"), "{e}");
        assert!(e.what.contains(what), "{e}");
    }
}

#[test]
fn files() {
    let text = format!("{SMALL}[lights.world]\ntype = \"image\"\nfile = \"sky.exr\"\n");
    last_line_fails(&text[SMALL.len()..], "lights.world.file", "sky.exr");
    let mut assets = MemoryAssets::default();
    assets.files.insert("sky.exr".to_owned(), b"not an image".to_vec());
    let e = fails_with(&text, &[], &assets);
    assert_eq!((e.key.as_str(), e.line), ("lights.world.file", Some(21)), "{e}");
    let mesh = "[shapes.m]\ntype = \"mesh\"\nmaterial = \"white\"\nfile = \"m.ply\"\n";
    last_line_fails(mesh, "shapes.m.file", "m.ply");
    let table = "[materials.t]\ntype = \"lambert\"\nreflectance = { file = \"r.csv\" }\n";
    last_line_fails(table, "materials.t.reflectance.file", "r.csv");
    assets.files.insert("r.csv".to_owned(), b"nm,r\n400,0.2\n700,oops\n".to_vec());
    let e = fails_with(&format!("{SMALL}{table}"), &[], &assets);
    assert!(e.what.contains("r.csv:3"), "{e}");
    assets.files.insert("r.csv".to_owned(), b"nm,r\n400,0.2\n700,0.6\n".to_vec());
    let scene = compiled(&format!("{SMALL}{table}"), &[], &assets).unwrap();
    let Material::Lambert(t) = &scene.materials[0] else { panic!("materials are in order of their names") };
    assert!((t.reflectance(crate::geometry::Side::Adaxial).at(550.0) - 0.4).abs() < 1e-5);
}

#[test]
fn roses() {
    let rose = "[shapes.r]\ntype = \"rose\"\nmaterials = { petal = \"white\", sepal = \"white\", stem = \"white\", receptacle = \"white\", leaf = \"white\" }\n";
    last_line_fails(&format!("{rose}rose.petals = 0\n"), "shapes.r.rose.petals", "");
    last_line_fails(&format!("{rose}rose.petal.length_mm = nan\n"), "shapes.r.rose.petal.length_mm", "");
    last_line_fails(&format!("{rose}scale = 0\n"), "shapes.r.scale", "above 0");
    let e = fails(&format!("{SMALL}[shapes.r]\ntype = \"rose\"\nmaterials = {{ petal = \"whit\" }}\n"), &[]);
    assert_eq!((e.key.as_str(), e.line), ("shapes.r.materials.petal", Some(21)), "{e}");
    let grow = |keys: &str| {
        let scene = compiled(
            &format!("{SMALL}{rose}{keys}"),
            &["shapes.r.rose.detail=0.3"],
            &MemoryAssets::default(),
        );
        scene.unwrap().shapes.iter().filter(|s| s.petal_id > 0).count()
    };
    // A preset's keys hold unless the file changes them.
    assert_eq!(grow("preset = \"wild\"\n"), 5);
    assert_eq!(grow("preset = \"wild\"\nrose.petals = 6\n"), 6);
}

#[test]
fn colours_of_both_sides_keep_their_energy() {
    let text = SMALL
        .replace(
            "reflectance_adaxial = 0.5",
            "reflectance_adaxial = \"#e01030\"\nreflectance_abaxial = [0.6, 0.2, 0.2]",
        )
        .replace("transmittance = 0.2", "transmittance = [0.25, 0.01, 0.02]");
    let scene = compiled(&text, &[], &MemoryAssets::default()).unwrap();
    let Material::Diffuse(m) = &scene.materials[0] else { panic!("a diffuse material") };
    for side in [crate::geometry::Side::Adaxial, crate::geometry::Side::Abaxial] {
        for nm in 380..=780 {
            assert!(m.reflectance(side).at(nm as f32) + m.transmittance().at(nm as f32) <= 1.0 + 1e-6);
        }
    }
    assert!(m.transmittance().at(680.0) > 0.1);
}

#[test]
fn glowing_shapes_are_lights() {
    let text = format!(
        "{SMALL}[shapes.lamp]\ntype = \"sphere\"\nradius_mm = 2\nmaterial = \"white\"\nemission = {{ radiance = 4 }}\n"
    );
    let scene = compiled(&text, &[], &MemoryAssets::default()).unwrap();
    let lamp = scene.shapes.iter().find(|s| s.key == "shapes.lamp").unwrap();
    assert!(matches!(scene.lights.emitters()[lamp.emitter.unwrap() as usize], Emitter::Area(_)));
}

#[test]
fn the_hash_names_what_is_rendered() {
    let hash = |overrides: &[&str]| compiled(SMALL, overrides, &MemoryAssets::default()).unwrap().scene_hash;
    let plain = hash(&[]);
    assert_eq!(plain, hash(&["render.spp=3", "render.seed=9"]));
    assert_ne!(plain, hash(&["film.width=9"]));
    assert_ne!(plain, hash(&["materials.white.transmittance=0.21"]));
    let text = format!("{SMALL}[materials.t]\ntype = \"lambert\"\nreflectance = {{ file = \"r.csv\" }}\n");
    let of_file = |csv: &str| {
        let mut assets = MemoryAssets::default();
        assets.files.insert("r.csv".to_owned(), csv.as_bytes().to_vec());
        compiled(&text, &[], &assets).unwrap().scene_hash
    };
    assert_ne!(of_file("400,0.2\n700,0.6\n"), of_file("400,0.2\n700,0.7\n"));
}

#[test]
fn unknown_pigments_are_named() {
    let table = "[tissue.adaxial.pigments]\n";
    let read = |lines: &str| -> Result<(), Error> {
        let Loaded { description, source } =
            load::<description::PetalDescription>(&format!("{table}{lines}\n"), "petal.toml", &[])?;
        description.build_tissue("").map(drop).map_err(|e| source.locate(e))
    };
    read("carotenoid_mol_per_l = 0.001\nanthocyanin_ug_per_cm2 = 20").unwrap();
    for (lines, line, key, what) in [
        (
            "betalain_ug_per_cm2 = 3.0",
            2,
            "tissue.adaxial.pigments.betalain_ug_per_cm2",
            "carotenoid_ug_per_cm2",
        ),
        (
            "water_um = 1.0\nflavonol_mol_per_l = 2",
            3,
            "tissue.adaxial.pigments.flavonol_mol_per_l",
            "0 to 1 mol/L",
        ),
        (
            "carotenoid_ug_per_cm2 = 1.0\ncarotenoid_mol_per_l = 0.1",
            3,
            "tissue.adaxial.pigments.carotenoid_mol_per_l",
            "contradictory",
        ),
    ] {
        match read(lines) {
            Err(Error::Source(e)) => {
                assert_eq!((e.key.as_str(), e.line), (key, Some(line)), "{e}");
                assert!(e.what.contains(what), "{e}");
            }
            other => panic!("{lines}: {other:?}"),
        }
    }
}

//! Pictures against stored ones.
//!
//! `tests/golden/NAME.exr` holds each pixel's mean and the variance of that mean, from many samples. A test renders
//! the scene with another seed and few samples and asks whether noise explains the differences: each pixel by
//! a z test at Sidak's level for the picture, of which 99.75 % must pass, and the mean over all pixels. The noise
//! of a pixel is the reference's, scaled by the numbers of samples: where light is rare, few samples see too
//! little of it to know their own variance.
//!
//! `ROSARIUM_BLESS=1 cargo test --test golden` renders the references anew (a minute); see CONTRIBUTING.md.

mod support;

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use rosarium::film::{Film, ToneMap};
use rosarium::io::exr::{Channels, Plane, read_channels, write_channels};
use rosarium::io::{false_color, png};
use rosarium::scene::description::{SceneDescription, SpectrumDescription};
use rosarium::scene::{DEFAULT_SCENE, Scene, compile};
use rosarium::transport::{NoProgress, RenderSettings, render};
use rosarium::validate::pictures::{Picture, noise_test, round_limit, signed_map};

/// Probability that a right picture has one bad pixel, or a wrong mean.
const SIGNIFICANCE: f64 = 1e-3;
const ACCEPTED: f64 = 0.9975;
const REFERENCE_SEED: u64 = 1;
const REFERENCE_SPP: u32 = 4096;

/// Rare bright samples make a pixel's mean far from normal: many samples, and a box filter, where the tail of a
/// window would meet a lit edge beside a dark pixel once in thousands. Other filters are in the other scenes.
const SMALL: [&str; 5] =
    ["film.width=40", "film.height=40", "film.filter=\"box\"", "petal.samples=2", "render.spp=256"];

fn description(name: &str) -> SceneDescription {
    match name {
        "rose" => support::describe(DEFAULT_SCENE, &SMALL),
        "thesis" => support::describe(include_str!("../scenes/thesis.toml"), &SMALL),
        "room" => support::describe(include_str!("golden/room.toml"), &[]),
        "lens" => support::describe(include_str!("golden/lens.toml"), &[]),
        "cells" => support::describe(include_str!("golden/cells.toml"), &[]),
        _ => panic!("no scene named {name}"),
    }
}

fn compiled(description: &SceneDescription) -> Scene {
    compile(description, &support::sky()).unwrap_or_else(|e| panic!("{e}"))
}

fn rendered(scene: &Scene, spp: u32, seed: u64) -> Film {
    let settings = RenderSettings { spp, seed, ..support::whole(scene) };
    let done = render(scene, support::integrator(scene).as_ref(), &settings, &NoProgress).unwrap();
    assert_eq!(done.film.rejected(), 0);
    done.film
}

fn reference_path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("tests/golden/{name}.exr"))
}

/// A picture with the samples per pixel that it is the mean of.
struct Golden {
    picture: Picture,
    spp: u32,
}

impl Golden {
    fn to_exr(&self) -> Vec<u8> {
        let Picture { width, height, rgb, variance, .. } = &self.picture;
        let mut planes = BTreeMap::new();
        for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
            let plane = |pixels: &[[f32; 3]]| Plane::F32(pixels.iter().map(|v| v[c]).collect());
            planes.insert(name.to_owned(), plane(rgb));
            planes.insert(format!("variance.{name}"), plane(variance.as_ref().unwrap()));
        }
        let attributes = BTreeMap::from([("spp".to_owned(), self.spp.to_string())]);
        let (width, height) = (*width, *height);
        let display = ((0, 0), (width, height));
        write_channels(&Channels { width, height, origin: (0, 0), display, planes, attributes }).unwrap()
    }

    fn from_exr(bytes: &[u8]) -> Self {
        let channels = read_channels(bytes, 1 << 20).unwrap();
        let spp = channels.attributes["spp"].parse().unwrap();
        Self { picture: Picture::read(bytes, "", 1 << 20).unwrap(), spp }
    }
}

/// What is wrong with a picture of `spp` samples per pixel; empty where noise explains the differences.
fn differences(picture: &Picture, spp: u32, reference: &Golden) -> Vec<String> {
    let more_noise = reference.spp as f32 / spp as f32;
    let mut variance = reference.picture.variance.clone().unwrap();
    variance.as_flattened_mut().iter_mut().for_each(|v| *v *= more_noise);
    let picture = Picture { variance: Some(variance), ..picture.clone() };
    let noise = noise_test(&picture, &reference.picture).unwrap().unwrap();
    let mut wrong = Vec::new();
    if noise.explained < ACCEPTED {
        wrong.push(format!("noise explains {:.2} % of the pixels", 100.0 * noise.explained));
    }
    if noise.p_mean < SIGNIFICANCE {
        wrong.push(format!("z of the means {:.1?}", noise.channels.map(|t| t.mean_z)));
    }
    wrong
}

/// Writes what a person needs to see what happened, and says where.
fn show(name: &str, picture: &Picture, spp: u32, reference: &Golden) -> String {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("target/test-out");
    fs::create_dir_all(&folder).unwrap();
    let mut said = String::new();
    let mut write = |what: &str, bytes: Vec<u8>| {
        let path = folder.join(format!("{name}-{what}"));
        fs::write(&path, bytes).unwrap();
        said += &format!("\n  {}", path.display());
    };
    let on_screen = |p: &Picture| {
        let size = (p.width as u32, p.height as u32);
        png::write(size, &p.rgb, ToneMap::Linear, 0.0, png::Depth::Eight).unwrap()
    };
    write("picture.exr", Golden { picture: picture.clone(), spp }.to_exr());
    write("picture.png", on_screen(picture));
    write("reference.png", on_screen(&reference.picture));
    let map = signed_map(picture, &reference.picture, 1e-2);
    let scale = false_color::Scale::Signed { limit: round_limit(&map) };
    write("difference.png", false_color::write(&map, picture.width, scale, "Luminance, relative").unwrap());
    said
}

fn reference(name: &str) -> Golden {
    let path = reference_path(name);
    let bytes = fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}; see CONTRIBUTING.md", path.display()));
    Golden::from_exr(&bytes)
}

fn is_golden(name: &str) {
    let scene = compiled(&description(name));
    if std::env::var_os("ROSARIUM_BLESS").is_some() {
        let film = rendered(&scene, REFERENCE_SPP, REFERENCE_SEED);
        let golden = Golden { picture: Picture::from(&film), spp: REFERENCE_SPP };
        fs::write(reference_path(name), golden.to_exr()).unwrap();
        return;
    }
    let spp = scene.render.spp;
    let (picture, reference) = (Picture::from(&rendered(&scene, spp, 2)), reference(name));
    let wrong = differences(&picture, spp, &reference);
    if !wrong.is_empty() {
        let files = show(name, &picture, spp, &reference);
        panic!("{name} has changed: {}\nSee{files}", wrong.join("; "));
    }
    // The test would see 3 % more light.
    let mut brighter = picture;
    brighter.rgb.as_flattened_mut().iter_mut().for_each(|v| *v *= 1.03);
    assert!(!differences(&brighter, spp, &reference).is_empty(), "{name}: the test is blind to 3 % of light");
}

macro_rules! golden {
    ($($name:ident),*) => { $(#[test] fn $name() { is_golden(stringify!($name)) })* };
}
golden!(rose, thesis, room, lens, cells);

#[test]
fn opaque_petals_are_noticed() {
    if std::env::var_os("ROSARIUM_BLESS").is_some() {
        return;
    }
    for name in ["rose", "room", "lens"] {
        let mut opaque = description(name);
        opaque.petal.shading.epidermis.transmittance = SpectrumDescription::Constant(0.0);
        let picture = Picture::from(&rendered(&compiled(&opaque), 64, 2));
        assert!(!differences(&picture, 64, &reference(name)).is_empty(), "{name}");
    }
}

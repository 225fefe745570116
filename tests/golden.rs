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
use rosarium::io::png;
use rosarium::math::stats::sidak;
use rosarium::scene::description::{SceneDescription, SpectrumDescription};
use rosarium::scene::{DEFAULT_SCENE, Scene, compile};
use rosarium::transport::{NoProgress, RenderSettings, render};
use rosarium::validate::compare::{accepted_share, z_test_images};

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

/// Mean and variance of the mean, per channel.
struct Picture {
    width: usize,
    height: usize,
    spp: u32,
    mean: [Vec<f32>; 3],
    variance: [Vec<f32>; 3],
}

impl Picture {
    fn of(film: &Film, spp: u32) -> Self {
        let channel = |get: &dyn Fn(usize) -> f32| (0..film.pixels().len()).map(get).collect::<Vec<f32>>();
        Self {
            width: film.width() as usize,
            height: film.height() as usize,
            spp,
            mean: [0, 1, 2].map(|c| channel(&|i| film.pixels()[i].beauty()[c])),
            variance: [0, 1, 2].map(|c| channel(&|i| film.pixels()[i].variance()[c])),
        }
    }

    fn to_exr(&self) -> Vec<u8> {
        let mut planes = BTreeMap::new();
        for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
            planes.insert(name.to_owned(), Plane::F32(self.mean[c].clone()));
            planes.insert(format!("variance.{name}"), Plane::F32(self.variance[c].clone()));
        }
        let attributes = BTreeMap::from([("spp".to_owned(), self.spp.to_string())]);
        let (width, height) = (self.width, self.height);
        let display = ((0, 0), (width, height));
        write_channels(&Channels { width, height, origin: (0, 0), display, planes, attributes }).unwrap()
    }

    fn from_exr(bytes: &[u8]) -> Self {
        let c = read_channels(bytes, 1 << 20).unwrap();
        let get = |prefix: &str| ["R", "G", "B"].map(|n| c.f32(&format!("{prefix}{n}")).unwrap().to_vec());
        Self {
            width: c.width,
            height: c.height,
            spp: c.attributes["spp"].parse().unwrap(),
            mean: get(""),
            variance: get("variance."),
        }
    }

    fn rgb(&self) -> Vec<[f32; 3]> {
        (0..self.mean[0].len()).map(|i| [0, 1, 2].map(|c| self.mean[c][i])).collect()
    }
}

/// What is wrong with a picture; empty where noise explains the differences.
fn differences(picture: &Picture, reference: &Picture) -> Vec<String> {
    assert_eq!((picture.width, picture.height), (reference.width, reference.height));
    let more_noise = reference.spp as f32 / picture.spp as f32;
    let mut wrong = Vec::new();
    for (c, name) in ["red", "green", "blue"].into_iter().enumerate() {
        let (a, b, variance) = (&picture.mean[c], &reference.mean[c], &reference.variance[c]);
        let noise: Vec<f32> = variance.iter().map(|v| v * more_noise).collect();
        let share = accepted_share(a, &noise, b, variance, SIGNIFICANCE).unwrap();
        if share < ACCEPTED {
            wrong.push(format!("{name}: noise explains {:.2} % of the pixels", 100.0 * share));
        }
        let test = z_test_images(a, &noise, b, variance).unwrap();
        if test.p_mean < sidak(SIGNIFICANCE, 3) {
            let mean = |v: &[f32]| v.iter().sum::<f32>() / v.len() as f32;
            wrong.push(format!("{name}: mean {} against {}, z = {:.1}", mean(a), mean(b), test.mean_z));
        }
    }
    wrong
}

/// Writes what a person needs to see what happened, and says where.
fn show(name: &str, picture: &Picture, reference: &Picture) -> String {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("target/test-out");
    fs::create_dir_all(&folder).unwrap();
    let size = (picture.width as u32, picture.height as u32);
    let mut said = String::new();
    let mut write = |what: &str, bytes: Vec<u8>| {
        let path = folder.join(format!("{name}-{what}"));
        fs::write(&path, bytes).unwrap();
        said += &format!("\n  {}", path.display());
    };
    let on_screen =
        |rgb: &[[f32; 3]]| png::write(size, rgb, ToneMap::Linear, 0.0, png::Depth::Eight).unwrap();
    write("picture.exr", picture.to_exr());
    write("picture.png", on_screen(&picture.rgb()));
    write("reference.png", on_screen(&reference.rgb()));
    // |z| / 8 per channel: black where they agree, white from 8 standard deviations on.
    let more_noise = 1.0 + reference.spp as f32 / picture.spp as f32;
    let error = |i: usize| {
        [0, 1, 2].map(|c| {
            let sigma = (reference.variance[c][i] * more_noise).sqrt().max(1e-12);
            (picture.mean[c][i] - reference.mean[c][i]).abs() / sigma / 8.0
        })
    };
    write("error.png", on_screen(&(0..picture.mean[0].len()).map(error).collect::<Vec<_>>()));
    said
}

fn reference(name: &str) -> Picture {
    let path = reference_path(name);
    let bytes = fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}; see CONTRIBUTING.md", path.display()));
    Picture::from_exr(&bytes)
}

fn is_golden(name: &str) {
    let scene = compiled(&description(name));
    if std::env::var_os("ROSARIUM_BLESS").is_some() {
        let film = rendered(&scene, REFERENCE_SPP, REFERENCE_SEED);
        fs::write(reference_path(name), Picture::of(&film, REFERENCE_SPP).to_exr()).unwrap();
        return;
    }
    let spp = scene.render.spp;
    let (picture, reference) = (Picture::of(&rendered(&scene, spp, 2), spp), reference(name));
    let wrong = differences(&picture, &reference);
    if !wrong.is_empty() {
        let files = show(name, &picture, &reference);
        panic!("{name} has changed: {}\nSee{files}", wrong.join("; "));
    }
    // The test would see 3 % more light.
    let mut brighter = picture;
    brighter.mean.iter_mut().flatten().for_each(|v| *v *= 1.03);
    assert!(!differences(&brighter, &reference).is_empty(), "{name}: the test is blind to 3 % of light");
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
        let picture = Picture::of(&rendered(&compiled(&opaque), 64, 2), 64);
        assert!(!differences(&picture, &reference(name)).is_empty(), "{name}");
    }
}

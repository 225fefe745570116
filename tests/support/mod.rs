//! What the tests of whole pictures share.

#![allow(dead_code, reason = "each test uses a part of it")]

use glam::UVec2;
use rosarium::film::PixelRect;
use rosarium::io::exr::{Channels, Plane, write_channels};
use rosarium::scene::{MemoryAssets, Override, Scene, SceneDescription, compile, load};
use rosarium::transport::{Integrator, NoProgress, RenderSettings, prepare};

/// A scene file with overrides such as `film.width=8`.
pub(crate) fn describe(text: &str, overrides: &[&str]) -> SceneDescription {
    let overrides: Vec<Override> = overrides.iter().map(|o| Override::parse(o).unwrap()).collect();
    load(text, "test", &overrides).unwrap_or_else(|e| panic!("{e}")).description
}

/// Compiles a scene whose files are `assets`.
pub(crate) fn scene_with(text: &str, overrides: &[&str], assets: &MemoryAssets) -> Scene {
    compile(&describe(text, overrides), assets).unwrap_or_else(|e| panic!("{e}"))
}

/// The integrator that a scene asks for.
pub(crate) fn integrator(scene: &Scene) -> Box<dyn Integrator> {
    prepare(scene, &mut Vec::new(), &NoProgress).unwrap_or_else(|e| panic!("{e}")).integrator
}

/// Settings of a scene's whole picture.
pub(crate) fn whole(scene: &Scene) -> RenderSettings {
    RenderSettings {
        spp: scene.render.spp,
        seed: scene.render.seed,
        crop: PixelRect::full(UVec2::new(scene.film.width, scene.film.height)),
    }
}

/// A sky in an EXR file: blue above, a warm patch, dark below.
pub(crate) fn sky() -> MemoryAssets {
    let (width, height) = (32usize, 16usize);
    let value = |channel: usize| {
        let at = |i: usize| {
            let (x, y) = (i % width, i / width);
            let patch = if (4..7).contains(&y) && (20..24).contains(&x) { [9.0, 6.0, 3.0] } else { [0.0; 3] };
            let sky = if y < 8 { [0.2, 0.35, 0.7] } else { [0.06, 0.05, 0.04] };
            sky[channel] + patch[channel]
        };
        Plane::F32((0..width * height).map(at).collect())
    };
    let image = Channels {
        width,
        height,
        origin: (0, 0),
        display: ((0, 0), (width, height)),
        planes: ["R", "G", "B"].iter().enumerate().map(|(c, n)| ((*n).to_owned(), value(c))).collect(),
        attributes: Default::default(),
    };
    let mut assets = MemoryAssets::default();
    assets.files.insert("sky.exr".to_owned(), write_channels(&image).unwrap());
    assets
}

//! A picture from a scene in TOML: a rose whose petals are shaded by their cells, by path tracing.
//!
//! Run it: `cargo run --example 5_picture` (it writes picture.png, 64 x 64).

#![allow(clippy::print_stdout, reason = "an example says what it finds")]

use glam::UVec2;
use rosarium::film::PixelRect;
use rosarium::io::{self, png::Depth};
use rosarium::scene::{MemoryAssets, SceneDescription, compile, load};
use rosarium::transport::{NoProgress, Path, RenderSettings, render};

const SCENE: &str = r#"
[film]
width = 64
height = 64

[camera]
position_mm = [0, -330, 190]
target_mm = [0, 0, 15]
fov_deg = 18

[petal]          # the thesis' cells shade every material of type "petal"
samples = 8

[materials.petal]
type = "petal"

[materials.green]
type = "lambert"
reflectance = [0.07, 0.15, 0.05]

[shapes.rose]
type = "rose"
preset = "hybrid_tea"
rose = { petals = 24, detail = 0.5 }
materials = { petal = "petal", sepal = "green", receptacle = "green", stem = "green", leaf = "green" }

[lights.sky]
type = "constant"
radiance = 0.3

[lights.sun]
type = "distant"
azimuth_deg = -50
elevation_deg = 45
irradiance = 3.0
"#;

fn main() -> rosarium::Result<()> {
    // A wrong key or value would be an error with its line: try `radience = 0.3`.
    let loaded = load::<SceneDescription>(SCENE, "picture.toml", &[])?;
    let scene = compile(&loaded.description, &MemoryAssets::default())?;

    let integrator =
        Path { max_depth: scene.render.max_depth, min_depth: scene.render.min_depth, guide: None };
    let size = UVec2::new(scene.film.width, scene.film.height);
    let settings = RenderSettings { spp: 16, seed: 0, crop: PixelRect::full(size) };
    let picture = render(&scene, &integrator, &settings, &NoProgress)?;
    println!("{} samples of light, {} not finite", picture.samples, picture.film.rejected());

    let light = picture.film.beauty();
    let png = io::png::write((size.x, size.y), &light, scene.film.tone_map, 0.0, Depth::Eight)?;
    std::fs::write("picture.png", png).map_err(|e| rosarium::Error::io("picture.png", e))
}

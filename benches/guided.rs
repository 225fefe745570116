//! Error and CPU seconds of `path` on the default rose, with a guide and without: `cargo bench --bench guided`.
//!
//! 8 x 8 patches of 6 x 6 pixels all over the default picture at its own resolution and samples, on one thread, the two by
//! turns with 48 seeds each. Error: mean over the pixels of the variance of their luminance over (mean^2 + 0.01). CPU
//! seconds are the thread's own (Linux: `/proc/thread-self/schedstat`), and wall clock elsewhere.

#![expect(clippy::print_stdout, reason = "a bench tells what it measures")]

use std::sync::Arc;
use std::time::Instant;

use rosarium::film::PixelRect;
use rosarium::math::stats::Welford;
use rosarium::scene::{DEFAULT_SCENE, MemoryAssets, Scene, SceneDescription, compile, load};
use rosarium::spectrum::color::luminance;
use rosarium::transport::{Guide, GuideSettings, NoProgress, Path, RenderSettings, render};

/// Samples per pixel.
const SPP: u32 = 20;
const GRID: u32 = 8;
const PATCH: u32 = 6;
const SEEDS: u64 = 48;

fn cpu_s(started: Instant) -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let ns = text.and_then(|t| t.split(' ').next()?.parse::<f64>().ok());
    ns.map_or_else(|| started.elapsed().as_secs_f64(), |ns| ns * 1e-9)
}

/// One seed of all patches into `pixels`.
fn pass(scene: &Scene, path: &Path, seed: u64, pixels: &mut [Welford]) {
    let (width, height) = (scene.film.width, scene.film.height);
    let mut pixels = pixels.iter_mut();
    for cell in 0..GRID * GRID {
        let (x, y) =
            ((2 * (cell % GRID) + 1) * width / GRID / 2, (2 * (cell / GRID) + 1) * height / GRID / 2);
        let crop = PixelRect { x0: x, y0: y, x1: x + PATCH, y1: y + PATCH };
        let settings = RenderSettings { spp: SPP, seed, crop };
        let film = render(scene, path, &settings, &NoProgress).expect("spp is not 0").film;
        for (rgb, pixel) in film.beauty().into_iter().zip(&mut pixels) {
            pixel.push(f64::from(luminance(rgb)));
        }
    }
}

/// The error over the pixels, which rare bright paths make uncertain.
fn error(pixels: &[Welford]) -> Welford {
    let mut errors = Welford::default();
    pixels.iter().for_each(|p| errors.push(p.variance() / (p.mean() * p.mean() + 0.01)));
    errors
}

fn compare(scene: &Scene) {
    let started = Instant::now();
    let before = cpu_s(started);
    let guide = Guide::new(scene, &GuideSettings::default(), &mut Vec::new(), &NoProgress)
        .expect("the default scene is solved");
    let built = cpu_s(started) - before;
    let (max_depth, min_depth) = (scene.render.max_depth, scene.render.min_depth);
    let paths = [None, Some(Arc::new(guide))].map(|guide| Path { max_depth, min_depth, guide });
    let mut pixels = [0, 1].map(|_| vec![Welford::default(); (GRID * GRID * PATCH * PATCH) as usize]);
    let mut seconds = [0.0; 2];
    for seed in 0..SEEDS {
        for (k, path) in paths.iter().enumerate() {
            let before = cpu_s(started);
            pass(scene, path, seed + 100 * k as u64, &mut pixels[k]);
            seconds[k] += cpu_s(started) - before;
        }
    }
    let errors = pixels.map(|p| error(&p));
    // What the whole picture would take.
    let share = f64::from(GRID * GRID * PATCH * PATCH) / f64::from(scene.film.width * scene.film.height);
    let whole = seconds.map(|s| s / SEEDS as f64 / share);
    println!("guide: built in {built:.2} CPU s");
    for (name, k) in [("path", 0), ("guided path", 1)] {
        println!(
            "{name}: {:.1} CPU s per picture, error {:.3e} +- {:.0e}",
            whole[k],
            errors[k].mean(),
            errors[k].standard_error()
        );
    }
    let equal = errors[1].mean() / errors[0].mean() * whole[1] + built;
    println!(
        "at the error of path: {equal:.1} CPU s with the guide's own, {:.2} times fewer",
        whole[0] / equal
    );
}

fn main() {
    let loaded = load::<SceneDescription>(DEFAULT_SCENE, "default", &[]).expect("the built-in scene loads");
    let scene = compile(&loaded.description, &MemoryAssets::default()).expect("the built-in scene compiles");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    pool.install(|| compare(&scene));
}

//! Is a guided picture of the default rose the same as one that is not? Slow: `cargo test --test guided -- --ignored`.

use std::sync::Arc;

use rosarium::film::PixelRect;
use rosarium::math::stats::Welford;
use rosarium::scene::{DEFAULT_SCENE, MemoryAssets, Override, Scene, SceneDescription, compile, load};
use rosarium::transport::{Guide, GuideSettings, NoProgress, Path, RenderSettings, render};

const SIZE: u32 = 48;
const BLOCK: u32 = 8;
const SEEDS: u64 = 10;
const SPP: u32 = 16;

fn rose() -> Scene {
    let define = [format!("film.width={SIZE}"), format!("film.height={SIZE}")]
        .map(|d| Override::parse(&d).expect("a key and its value"));
    let loaded =
        load::<SceneDescription>(DEFAULT_SCENE, "default", &define).expect("the built-in scene loads");
    compile(&loaded.description, &MemoryAssets::default()).expect("the built-in scene compiles")
}

/// Means of blocks of pixels over the seeds, and of all; per colour.
fn blocks(scene: &Scene, path: &Path, seed: u64) -> Vec<Welford> {
    let side = SIZE / BLOCK;
    let mut out = vec![Welford::default(); 3 * (side * side + 1) as usize];
    let crop = PixelRect { x0: 0, y0: 0, x1: SIZE, y1: SIZE };
    for seed in seed..seed + SEEDS {
        let film = render(scene, path, &RenderSettings { spp: SPP, seed, crop }, &NoProgress)
            .expect("spp is not 0")
            .film;
        let mut sums = vec![0.0; out.len()];
        for (i, rgb) in film.beauty().iter().enumerate() {
            let (x, y) = (i as u32 % SIZE / BLOCK, i as u32 / SIZE / BLOCK);
            for c in 0..3 {
                sums[3 * (y * side + x) as usize + c] += f64::from(rgb[c]);
                sums[3 * (side * side) as usize + c] += f64::from(rgb[c]);
            }
        }
        out.iter_mut().zip(sums).for_each(|(w, s)| w.push(s));
    }
    out
}

#[test]
#[ignore = "slow: half a minute of rendering"]
fn guided_rose_is_the_rose() {
    let scene = rose();
    let (max_depth, min_depth) = (scene.render.max_depth, scene.render.min_depth);
    let guide = Guide::new(&scene, &GuideSettings::default(), &mut Vec::new(), &NoProgress).expect("solved");
    let plain = blocks(&scene, &Path { max_depth, min_depth, guide: None }, 1);
    let guided = blocks(&scene, &Path { max_depth, min_depth, guide: Some(Arc::new(guide)) }, 1000);
    let z = |(a, b): (&Welford, &Welford)| {
        let sigma = (a.standard_error().powi(2) + b.standard_error().powi(2)).sqrt();
        if sigma > 0.0 { (a.mean() - b.mean()) / sigma } else { 0.0 }
    };
    let z: Vec<f64> = plain.iter().zip(&guided).map(z).collect();
    let square = z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64;
    let worst = z.iter().fold(0.0f64, |m, z| m.max(z.abs()));
    // Student's t of about 18 degrees of freedom; 111 numbers, colours of a block hang together.
    assert!(z[z.len() - 3..].iter().all(|z| z.abs() < 3.0), "{z:?}");
    assert!(square < 1.8 && worst < 4.6, "{square} {worst}");
}

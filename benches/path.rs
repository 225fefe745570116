//! Pixel samples per second of whole pictures, all threads: `cargo bench --bench path`.
//!
//! A crop of the middle of the default scene (petals everywhere, 64 x 64 pixels), by path tracing and by the
//! thesis' ray tracing.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::UVec2;
use rosarium::film::PixelRect;
use rosarium::scene::{DEFAULT_SCENE, MemoryAssets, SceneDescription, compile, load};
use rosarium::transport::{Integrator, NoProgress, Path, Raytrace, RenderSettings, render};

const SPP: u32 = 4;

fn picture(c: &mut Criterion) {
    let loaded = load::<SceneDescription>(DEFAULT_SCENE, "default", &[]).expect("the built-in scene loads");
    let scene = compile(&loaded.description, &MemoryAssets::default()).expect("the built-in scene compiles");
    let size = UVec2::new(scene.film.width, scene.film.height);
    let crop = PixelRect::from_fractions(size, (0.45, 0.55), (0.40, 0.50)).expect("inside the picture");
    let settings = RenderSettings { spp: SPP, seed: 0, crop };
    let path = Path { max_depth: scene.render.max_depth, min_depth: scene.render.min_depth, guide: None };
    let integrators: [(&str, &dyn Integrator); 2] = [("path", &path), ("raytrace", &Raytrace)];

    let mut group = c.benchmark_group("picture");
    let samples = u64::from(crop.width()) * u64::from(crop.height()) * u64::from(SPP);
    group.throughput(Throughput::Elements(samples)).sample_size(10);
    for (name, integrator) in integrators {
        group.bench_function(name, |b| {
            b.iter(|| render(&scene, integrator, &settings, &NoProgress).expect("spp is not 0").samples)
        });
    }
    group.finish();
}

criterion_group!(benches, picture);
criterion_main!(benches);

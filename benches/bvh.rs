//! Rays per second against the default scene, one thread: `cargo bench --bench bvh`.
//!
//! `primary`: camera rays, near to each other. `bounce`: from their hits into random directions of the
//! hemisphere, which is what most rays of a path look like. `shadow`: from the same hits towards the key light,
//! any hit will do.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{UVec2, Vec2, Vec3};
use rosarium::geometry::Ray;
use rosarium::geometry::bvh::Bvh;
use rosarium::math::Sampler;
use rosarium::math::warp::square_to_sphere;
use rosarium::scene::{DEFAULT_SCENE, MemoryAssets, Scene, SceneDescription, compile, load};

const SIDE: u32 = 128;
/// Middle of the key light of the default scene, mm.
const LAMP_MM: Vec3 = Vec3::new(260.0, -230.0, 380.0);

fn scene() -> Scene {
    let loaded = load::<SceneDescription>(DEFAULT_SCENE, "default", &[]).expect("the built-in scene loads");
    compile(&loaded.description, &MemoryAssets::default()).expect("the built-in scene compiles")
}

fn rays(c: &mut Criterion) {
    let scene = scene();
    let primary: Vec<Ray> = (0..SIDE * SIDE)
        .map(|i| {
            let film = (UVec2::new(i % SIDE, i / SIDE).as_vec2() + Vec2::splat(0.5)) / SIDE as f32;
            scene.camera.ray(film, Vec2::splat(0.5)).ray
        })
        .collect();
    let hits: Vec<_> =
        primary.iter().filter_map(|ray| Some((scene.intersect(ray)?, -ray.direction))).collect();
    let bounce: Vec<Ray> = (0..)
        .zip(&hits)
        .map(|(i, (at, wo))| {
            let w = square_to_sphere(Sampler::new(1, UVec2::ZERO, i).next_2d());
            let same_side = w.dot(at.ng) * wo.dot(at.ng) > 0.0;
            Scene::leave(at, if same_side { w } else { -w })
        })
        .collect();
    let shadow: Vec<Ray> = hits
        .iter()
        .map(|(at, _)| Ray {
            t_max: at.p.distance(LAMP_MM),
            ..Scene::leave(at, (LAMP_MM - at.p).normalize())
        })
        .collect();

    let mut group = c.benchmark_group("bvh");
    for (name, rays) in [("primary", &primary), ("bounce", &bounce)] {
        group.throughput(Throughput::Elements(rays.len() as u64));
        group.bench_function(name, |b| {
            b.iter(|| rays.iter().filter(|r| black_box(scene.bvh.intersect(r)).is_some()).count())
        });
    }
    group.throughput(Throughput::Elements(shadow.len() as u64));
    group.bench_function("shadow", |b| {
        b.iter(|| shadow.iter().filter(|r| black_box(scene.bvh.occluded(r))).count())
    });
    let triangles: usize = scene.shapes.iter().map(|s| s.mesh.triangles.len()).sum();
    group.throughput(Throughput::Elements(triangles as u64));
    group.sample_size(10);
    group.bench_function("build", |b| b.iter(|| Bvh::build(scene.shapes.iter().map(|s| &s.mesh))));
    group.finish();
}

criterion_group!(benches, rays);
criterion_main!(benches);

//! Scattering at one point, one thread: `cargo bench --bench bsdf`. Spectra have 8 wavelengths.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{UVec2, Vec3};
use rosarium::bsdf::{Bsdf, Phong};
use rosarium::math::Sampler;
use rosarium::math::warp::square_to_cosine_hemisphere;
use rosarium::micro::shading::{CellPetal, Footprint};
use rosarium::scene::MemoryAssets;
use rosarium::scene::description::PetalDescription;
use rosarium::spectrum::SampledWavelengths;

const CALLS: u32 = 1024;

fn sampler(i: u32) -> Sampler {
    Sampler::new(3, UVec2::ZERO, i)
}

/// Viewer and light above the petal, each cosine-weighted.
fn directions() -> Vec<(Vec3, Vec3)> {
    (0..CALLS)
        .map(|i| {
            let mut s = sampler(i);
            (square_to_cosine_hemisphere(s.next_2d()), square_to_cosine_hemisphere(s.next_2d()))
        })
        .collect()
}

fn phong(c: &mut Criterion) {
    let phong = Phong::new(0.3.into(), 0.5.into(), 40.0).expect("valid");
    let lambda = SampledWavelengths::visible(0.5);
    let pairs = directions();
    let mut group = c.benchmark_group("phong");
    group.throughput(Throughput::Elements(u64::from(CALLS)));
    group.bench_function("eval", |b| {
        b.iter(|| pairs.iter().map(|(wo, wi)| black_box(phong.eval(*wo, *wi, &lambda))[0]).sum::<f32>())
    });
    group.bench_function("sample", |b| {
        b.iter(|| {
            (0..)
                .zip(&pairs)
                .filter_map(|(i, (wo, _))| {
                    let mut s = sampler(i);
                    let u_lobe = s.next_1d();
                    black_box(phong.sample(*wo, &lambda, u_lobe, s.next_2d()))
                })
                .count()
        })
    });
    group.finish();
}

fn petal(c: &mut Criterion) {
    let petal: CellPetal =
        PetalDescription::default().compile("", &MemoryAssets::default()).expect("the thesis' petal");
    let lambda = SampledWavelengths::visible(0.5);
    let pairs = directions();
    let mut group = c.benchmark_group("petal");
    group.throughput(Throughput::Elements(u64::from(CALLS))).sample_size(20);
    for points in [1, 8] {
        group.bench_function(format!("estimate, {points} points"), |b| {
            b.iter(|| {
                (0..)
                    .zip(&pairs)
                    .map(|(i, (wo, wi))| {
                        petal.estimate(*wo, *wi, &lambda, Footprint::WIDE, points, &mut sampler(i))[0]
                    })
                    .sum::<f32>()
            })
        });
    }
    group.bench_function("scatter", |b| {
        b.iter(|| {
            (0..)
                .zip(&pairs)
                .filter_map(|(i, (_, wi))| petal.scatter_at(*wi, &lambda, Footprint::WIDE, &mut sampler(i)))
                .count()
        })
    });
    group.finish();
}

criterion_group!(benches, phong, petal);
criterion_main!(benches);

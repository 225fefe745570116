//! Numbers per second of the sample sequence, one thread: `cargo bench --bench sampler`.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{UVec2, Vec2};
use rosarium::math::Sampler;
use rosarium::spectrum::SampledWavelengths;

const SAMPLES: u32 = 1024;
const DIMENSIONS: u32 = 16;

fn sequence(c: &mut Criterion) {
    let mut group = c.benchmark_group("sampler");
    group.throughput(Throughput::Elements(u64::from(SAMPLES * DIMENSIONS)));
    group.bench_function("next_2d", |b| {
        b.iter(|| {
            let mut sum = Vec2::ZERO;
            for i in 0..SAMPLES {
                let mut s = Sampler::new(0, UVec2::new(3, 5), black_box(i));
                for _ in 0..DIMENSIONS {
                    sum += s.next_2d();
                }
            }
            sum
        })
    });
    group.throughput(Throughput::Elements(u64::from(SAMPLES)));
    group.bench_function("wavelengths", |b| {
        b.iter(|| {
            for i in 0..SAMPLES {
                black_box(SampledWavelengths::visible(i as f32 / SAMPLES as f32));
            }
        })
    });
    group.finish();
}

criterion_group!(benches, sequence);
criterion_main!(benches);

//! White walks and recolouring, one thread: `cargo bench --bench white`. The petal is 'Rote Rose'.
//!
//! `walks`: per core, from all angles of both sides, and the same with counting and tables. `recolour`: reflectance and
//! transmittance of one lamp at 401 wavelengths, and all directions at one wavelength.

use std::hint::black_box;
use std::ops::ControlFlow;
use std::sync::Arc;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use rosarium::geometry::Side;
use rosarium::gonio::WhiteMonteCarlo;
use rosarium::math::Stream;
use rosarium::micro::{CellWalk, Tissue, WhiteScatter};
use rosarium::scene::description::PetalDescription;
use rosarium::scene::{load, petal};

const WALKS: u64 = 4000;

fn rose() -> (CellWalk, Arc<Tissue>) {
    let text = petal::preset("rote_rose").expect("a preset");
    let petal: PetalDescription = load(text, "rote_rose", &[]).expect("loads").description;
    let tissue = Arc::new(petal.build_tissue("").expect("builds").expect("has layers"));
    (CellWalk::new(tissue.clone()), tissue)
}

fn white(c: &mut Criterion) {
    let (walk, tissue) = rose();
    let go = |_, _| ControlFlow::Continue(());
    let mut group = c.benchmark_group("walks");
    group.sample_size(10).throughput(Throughput::Elements(2 * WALKS));
    group.bench_function("alone", |b| {
        b.iter(|| {
            for i in 0..2 * WALKS {
                let mut stream = Stream::new(1, 0, i);
                let cos = stream.next().sqrt().max(1e-3);
                let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
                let wi = DVec3::new((1.0 - cos * cos).sqrt(), 0.0, sign * cos);
                black_box(walk.walk(wi, &mut stream));
            }
        });
    });
    group.throughput(Throughput::Elements(200_000)).bench_function("100000 per side, measured", |b| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
        let settings = WhiteMonteCarlo { walks: 100_000, ..WhiteMonteCarlo::default() };
        b.iter(|| pool.install(|| settings.measure(&walk, tissue.depth_um, &go)).expect("measured"));
    });
    group.finish();

    let settings = WhiteMonteCarlo { walks: 20_000, ..WhiteMonteCarlo::default() };
    let optics = settings.measure(&walk, tissue.depth_um, &go).expect("measured");
    let spectrum: Vec<_> =
        (380..=780).map(|nm| tissue.absorption_per_um(f64::from(nm)).expect("known")).collect();
    let mut group = c.benchmark_group("recolour");
    group.bench_function("one lamp, 401 wavelengths", |b| {
        b.iter(|| optics.recolour(Side::Adaxial, black_box(32.0), &spectrum));
    });
    group.bench_function("all directions, one wavelength", |b| {
        b.iter(|| optics.interior_at(black_box(&spectrum[150])));
    });
    group.finish();
}

criterion_group!(benches, white);
criterion_main!(benches);

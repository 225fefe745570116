//! Speed of the cells' model: to compute a small table of factors, to prepare readings, to evaluate them.

use std::hint::black_box;
use std::ops::ControlFlow;
use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use rosarium::fit::models::Terado;
use rosarium::fit::{Geometry, Model};
use rosarium::gonio::cell_factors::AngleNodes;
use rosarium::gonio::measurement::direction_deg;
use rosarium::gonio::{CellFactors, CellFamily, FactorSettings};
use rosarium::micro::CellDescription;

fn cells(c: &mut Criterion) {
    let first = AngleNodes { thetas: 10, ratios: 8, azimuths: 9 };
    let later = AngleNodes { thetas: 6, ratios: 5, azimuths: 5 };
    let settings = FactorSettings { points: 1024, facets: 32, seed: 1, first, later };
    let cells = CellDescription::default();
    let compute = || CellFactors::compute(&cells, &settings, &|_, _| ControlFlow::Continue(()));
    let mut group = c.benchmark_group("cell_factors");
    group.sample_size(10).bench_function("compute/1024 points, 10 x 8 x 9", |b| b.iter(compute));
    let table = compute().expect("valid");
    let bytes = table.to_bytes();
    group.bench_function("from_bytes", |b| b.iter(|| CellFactors::from_bytes(black_box(&bytes), "table")));
    let model = Terado::new(Arc::new(CellFamily::from(table)));
    let readings: Vec<Geometry> = (0..160)
        .map(|i| {
            let (theta, phi) = (f64::from(i % 16) * 5.0, f64::from(i / 16) * 18.0);
            Geometry::point(direction_deg(50.0, 0.0), direction_deg(theta, phi))
        })
        .collect();
    group.bench_function("prepare/160 readings", |b| b.iter(|| model.prepare(black_box(&readings))));
    let prepared = model.prepare(&readings).expect("valid");
    let p: Vec<f64> = model.parameters().iter().map(|p| p.start).collect();
    let (mut values, mut jacobian) = (vec![0.0; 160], vec![0.0; 160 * p.len()]);
    group.bench_function("eval/160 readings with derivatives", |b| {
        b.iter(|| prepared.eval(black_box(&p), &mut values, Some(&mut jacobian)));
    });
    group.finish();
}

criterion_group!(benches, cells);
criterion_main!(benches);

//! Speed of the goniophotometer itself: 1e5 paths on samples whose scattering costs next to nothing.

use std::hint::black_box;
use std::ops::ControlFlow;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rosarium::bsdf::{Lambert, Phong, Scatter};
use rosarium::gonio::Goniophotometer;

fn measure(c: &mut Criterion) {
    let lambert = Lambert::new(0.5.into()).expect("valid");
    let phong = Phong::new(0.2.into(), 0.4.into(), 30.0).expect("valid");
    let samples: [(&str, &dyn Scatter); 2] = [("lambert", &lambert), ("phong", &phong)];
    let mut group = c.benchmark_group("gonio");
    group.sample_size(20).throughput(Throughput::Elements(100_000));
    for (name, sample) in samples {
        for bands in [1, 8] {
            let gonio = Goniophotometer {
                incident_deg: vec![60.0],
                rays: 100_000,
                bands_nm: (0..bands).map(|i| 400.0 + 40.0 * f64::from(i)).collect(),
                ..Default::default()
            };
            group.bench_function(format!("{name}/{bands} bands"), |b| {
                b.iter(|| gonio.measure(black_box(sample), &|_, _| ControlFlow::Continue(())));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, measure);
criterion_main!(benches);

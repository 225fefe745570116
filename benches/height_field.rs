//! Rays per second of the dome field's first hit, one thread: `cargo bench --bench height_field`.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{DVec2, DVec3};
use rosarium::math::sampler::hash_to_unit;
use rosarium::micro::{CellDescription, CellField, Profile};

const RAYS: u32 = 4096;

fn rays(field: &CellField, incidence_deg: f64) -> Vec<(DVec3, DVec3)> {
    let (sin, cos) = incidence_deg.to_radians().sin_cos();
    (0..RAYS)
        .map(|i| {
            let u = |k| hash_to_unit(3 * i + k);
            let origin = DVec2::new(u(0), u(1)) * field.tile_um();
            let direction = DVec2::from_angle(std::f64::consts::TAU * u(2)) * sin;
            (origin.extend(field.max_height_um()), direction.extend(-cos))
        })
        .collect()
}

fn first_hit(c: &mut Criterion) {
    let regular = CellDescription::default();
    let disordered = CellDescription {
        center_disorder: 0.1,
        height_disorder: 0.1,
        tilt_disorder_deg: 5.0,
        ..regular.clone()
    };
    let raised = CellDescription { profile: Profile::RaisedCosine, ..regular.clone() };
    let mut group = c.benchmark_group("first_hit");
    group.throughput(Throughput::Elements(u64::from(RAYS)));
    for (name, cells) in [("regular", regular), ("disordered", disordered), ("raised_cosine", raised)] {
        let field = CellField::new(&cells).expect("valid");
        for incidence_deg in [0.0, 45.0, 80.0] {
            let rays = rays(&field, incidence_deg);
            group.bench_function(format!("{name}/{incidence_deg}"), |b| {
                b.iter(|| {
                    rays.iter().filter_map(|&(o, d)| field.first_hit(o, d)).map(|h| h.t_um).sum::<f64>()
                })
            });
        }
        // What a path does next: leave the hit towards a random direction of its hemisphere.
        let starts: Vec<_> = rays(&field, 45.0)
            .into_iter()
            .zip(0..)
            .filter_map(|((o, d), i)| {
                let hit = field.first_hit(o, d)?;
                let z = 2.0 * hash_to_unit(7 * i) - 1.0;
                let phi = std::f64::consts::TAU * hash_to_unit(7 * i + 1);
                let w = (DVec2::from_angle(phi) * (1.0 - z * z).sqrt()).extend(z);
                Some((hit, if w.dot(hit.normal) < 0.0 { -w } else { w }))
            })
            .collect();
        group.bench_function(format!("{name}/from_hit"), |b| {
            b.iter(|| starts.iter().filter(|(h, w)| black_box(field.first_hit_from(h, *w)).is_some()).count())
        });
    }
    group.finish();
}

criterion_group!(benches, first_hit);
criterion_main!(benches);

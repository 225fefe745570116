use std::sync::Arc;

use super::*;
use crate::math::stats::Welford;
use crate::transport::hybrid::tests::{THINGS, light, still_life};
use crate::transport::{NoProgress, Path};

const SETTINGS: GuideSettings = GuideSettings { elements: 400, rays: 32, light_samples: 8, seed: 0 };
const PATHS: u32 = 1 << 13;
const PETALS: [&str; 2] = ["[petal]\nsamples = 2\n", "[petal]\noptics = \"sheet.optics\"\n"];

fn guide(scene: &Scene) -> Guide {
    Guide::new(scene, &SETTINGS, &mut Vec::new(), &NoProgress).unwrap_or_else(|e| panic!("{e}"))
}

fn path(guide: Option<Guide>) -> Path {
    Path { max_depth: 12, min_depth: 3, guide: guide.map(Arc::new) }
}

fn same(a: &Welford, b: &Welford, what: &str) {
    let sigma = (a.standard_error().powi(2) + b.standard_error().powi(2)).sqrt();
    let z = (a.mean() - b.mean()) / sigma;
    assert!(z.abs() < 3.0, "{what}: {} and {}, {z} sigma", a.mean(), b.mean());
}

#[test]
fn guided_paths_find_the_same_light() {
    for petal in PETALS {
        let scene = still_life(petal);
        let guided = path(Some(guide(&scene)));
        for thing in THINGS {
            let found = light(&scene, &guided, PATHS, thing);
            same(&found, &light(&scene, &path(None), PATHS, thing), thing.0);
        }
    }
}

#[test]
fn a_guide_that_knows_nothing_is_harmless() {
    let scene = still_life(PETALS[0]);
    let mut empty = guide(&scene);
    empty.known.fill(Known::default());
    let empty = path(Some(empty));
    for thing in THINGS {
        let (a, b) = (light(&scene, &empty, 256, thing), light(&scene, &path(None), 256, thing));
        assert_eq!(a.mean().to_bits(), b.mean().to_bits(), "{}", thing.0);
    }
    // Nor does it matter, but for noise, that it is wrong.
    let mut wrong = guide(&scene);
    for known in &mut wrong.known {
        known.rms = [0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    }
    let wrong = path(Some(wrong));
    for thing in THINGS {
        let found = light(&scene, &wrong, PATHS, thing);
        same(&found, &light(&scene, &path(None), PATHS, thing), thing.0);
    }
}

#[test]
fn warnings_of_the_solution_are_passed_on() {
    let mut scene = still_life(PETALS[0]);
    let mesh = &mut scene.shapes[0].mesh;
    let [a, b, c] = mesh.triangles[0];
    mesh.triangles.extend([[a, b, c], [a, a, b]]);
    scene.bvh = crate::geometry::Bvh::build(scene.shapes.iter().map(|s| &s.mesh));
    let mut warnings = Vec::new();
    Guide::new(&scene, &SETTINGS, &mut warnings, &NoProgress).unwrap();
    assert_eq!(warnings.len(), 2, "{warnings:?}");
}

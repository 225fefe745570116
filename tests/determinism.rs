//! The bytes of a picture depend on the scene, the seed and the number of samples, and on nothing else.

mod support;

use std::sync::atomic::{AtomicBool, Ordering};

use glam::UVec2;
use rosarium::film::{Film, PixelRect};
use rosarium::scene::{DEFAULT_SCENE, MemoryAssets, Scene};
use rosarium::transport::{NoProgress, Progress, RenderSettings, Rendered, render};

/// The rose of cells in three kinds of light.
fn rose(more: &[&str]) -> Scene {
    let text = format!(
        "{DEFAULT_SCENE}\n[lights.sun]\ntype = \"distant\"\nazimuth_deg = -50\nelevation_deg = 45\nirradiance = 2\n"
    );
    let mut overrides = vec![
        "film.width=22",
        "film.height=18",
        "render.spp=8",
        "shapes.rose.rose.detail=0.5",
        "petal.samples=3",
    ];
    overrides.extend(more);
    support::scene_with(&text, &overrides, &MemoryAssets::default())
}

fn rendered(scene: &Scene, settings: &RenderSettings) -> Film {
    let Rendered { film, complete, .. } =
        render(scene, support::integrator(scene).as_ref(), settings, &NoProgress).unwrap();
    assert!(complete && film.rejected() == 0);
    film
}

/// Films are compared by every sum of every pixel, bit by bit: no sum is NaN or -0.
fn in_pool(threads: usize, overrides: &[&str]) -> Film {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
        // Growing, compiling and building the hierarchy are parallel too.
        let scene = rose(overrides);
        rendered(&scene, &support::whole(&scene))
    })
}

#[test]
fn any_number_of_threads_gives_the_same_picture() {
    for integrator in ["render.integrator=\"path\"", "render.integrator=\"raytrace\"", "render.guide=true"] {
        let one = in_pool(1, &[integrator]);
        assert!(one.pixels().iter().any(|p| p.direct()[0] > 0.0 && p.alpha() > 0.5 && p.petal_id() > 0));
        for threads in [2, 3] {
            assert!(in_pool(threads, &[integrator]) == one, "{integrator} by {threads} threads");
        }
    }
}

#[test]
fn crops_put_together_are_the_whole() {
    let scene = rose(&[]);
    let whole = rendered(&scene, &support::whole(&scene));
    let PixelRect { x1, y1, .. } = whole.crop();
    for parts in [
        [PixelRect { x0: 0, y0: 0, x1: 9, y1 }, PixelRect { x0: 9, y0: 0, x1, y1 }],
        [PixelRect { x0: 0, y0: 0, x1, y1: 7 }, PixelRect { x0: 0, y0: 7, x1, y1 }],
    ] {
        let mut seen = 0;
        for crop in parts {
            let part = rendered(&scene, &RenderSettings { crop, ..support::whole(&scene) });
            for (i, pixel) in part.pixels().iter().enumerate() {
                let UVec2 { x, y } = part.position(i);
                assert!(*pixel == whole.pixels()[(y * x1 + x) as usize], "pixel {x}, {y} of {crop:?}");
                seen += 1;
            }
        }
        assert_eq!(seen, whole.pixels().len());
    }
}

#[test]
fn a_stopped_picture_has_the_first_samples() {
    /// Stops as soon as so many samples are done.
    struct StopAfter(u64, AtomicBool);
    impl Progress for StopAfter {
        fn advance(&self, done: u64, _total: u64) {
            self.1.fetch_or(done >= self.0, Ordering::Relaxed);
        }
        fn cancelled(&self) -> bool {
            self.1.load(Ordering::Relaxed)
        }
    }
    let scene = rose(&[]);
    let settings = support::whole(&scene);
    let pixels = u64::from(scene.film.width * scene.film.height);
    let mut counts = std::collections::BTreeSet::new();
    // In the middle of a pass, where rows differ, and at the end of one.
    for stop in [pixels / 2, pixels * 5 / 2, 4 * pixels] {
        let progress = StopAfter(stop, AtomicBool::new(false));
        let stopped = render(&scene, support::integrator(&scene).as_ref(), &settings, &progress).unwrap();
        assert!(!stopped.complete);
        let added: u64 = stopped.film.pixels().iter().map(|p| u64::from(p.samples())).sum();
        assert_eq!(stopped.samples, added);
        for n in [1, 2, 4, 8] {
            let first = rendered(&scene, &RenderSettings { spp: n, ..settings });
            for (a, b) in stopped.film.pixels().iter().zip(first.pixels()).filter(|(a, _)| a.samples() == n) {
                assert!(a == b);
                counts.insert(n);
            }
        }
    }
    assert!(counts.len() >= 3, "{counts:?}");
}

#[test]
fn another_seed_is_another_picture() {
    let scene = rose(&[]);
    let settings = support::whole(&scene);
    let other = rendered(&scene, &RenderSettings { seed: settings.seed + 1, ..settings });
    assert!(rendered(&scene, &settings) != other);
}

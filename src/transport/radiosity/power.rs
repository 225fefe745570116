//! What the lights send into the scene, and what of it meets nothing.
//!
//! Model: rays leave each light as its light does. Light from infinity enters through the sphere of radius R around the
//! scene, so that a direction of radiance L brings `L pi R^2` per sr:
//!
//! | light | power into the scene | rays |
//! |---|---|---|
//! | constant, image | pi R^2 times the integral of L over directions | any direction, a disc across it |
//! | distant | pi R^2 L 2 pi (1 - cos a), or pi R^2 E where it is parallel | its cone, a disc across |
//! | point | 4 pi I | any direction |
//! | area | pi L A, twice where both sides glow | its surface, by the cosine |
//!
//! This is counted at the lights, independently of the light that arrives at the nodes; the energy ledger sets the two
//! side by side. Guarded by `power_arrives_or_escapes`. Source: definitions of radiance and intensity.

use glam::{UVec2, Vec2};
use rayon::prelude::*;

use crate::math::Sampler;
use crate::scene::{Emitter, Scene};
use crate::spectrum::{LANES, SampledSpectrum, SampledWavelengths};

/// Rays that are summed together, so that sums do not depend on the threads.
const BATCH: u32 = 1 << 10;
/// Marks the numbers of these rays among others of the seed.
const SEQUENCE: u32 = 0x90e3_0f1e;

/// Power of all lights.
#[derive(Clone, Debug)]
pub(super) struct Power {
    /// Into the scene, per chunk, radiance times mm2 sr.
    pub(super) emitted: Vec<[f64; LANES]>,
    /// ... of which meets nothing.
    pub(super) escaped: Vec<[f64; LANES]>,
}

/// Point `i` of a sequence that is even in all four dimensions together, which two and two of them would not be: whether a
/// ray meets something hangs on all four. Additive recurrence by the powers of 1 / g, where g^5 = g + 1 (Roberts 2018).
fn point(start: [Vec2; 2], i: u32) -> [Vec2; 2] {
    const G: f64 = 1.167_303_978_261_418_7;
    let at = |start: f32, k: i32| {
        ((f64::from(start) + f64::from(i) * G.powi(-k)).fract() as f32).min(0.999_999_94)
    };
    [Vec2::new(at(start[0].x, 1), at(start[0].y, 2)), Vec2::new(at(start[1].x, 3), at(start[1].y, 4))]
}

/// Shoots `rays` from every light; `without_glow` leaves out the rays, though not the power, of glowing surfaces.
pub(super) fn power(
    scene: &Scene,
    chunks: &[SampledWavelengths],
    (rays, seed): (u32, u64),
    without_glow: bool,
) -> Power {
    let (low, high) = scene.bounds;
    let sphere = ((low + high) / 2.0, ((high - low) / 2.0).length().max(1e-6) * 1.001);
    let none = vec![[0.0; LANES]; chunks.len()];
    let mut out = Power { emitted: none.clone(), escaped: none.clone() };
    let add = |to: &mut [f64; LANES], light: SampledSpectrum, by: f64| {
        for (t, l) in to.iter_mut().zip(light.0) {
            *t += f64::from(l) * by;
        }
    };
    for light in 0..scene.lights.emitters().len() {
        for (to, lambda) in out.emitted.iter_mut().zip(chunks) {
            add(to, scene.lights.power(light, sphere.1, lambda), 1.0);
        }
        if without_glow && matches!(scene.lights.emitters()[light], Emitter::Area(_)) {
            continue;
        }
        let mut s = Sampler::new(seed, UVec2::new(light as u32, SEQUENCE), 0);
        let start = [s.next_2d(), s.next_2d()];
        // Rays of most lights stand for the same power each, so they are only counted.
        let alike = !matches!(scene.lights.emitters()[light], Emitter::Image { .. } | Emitter::Sky(_));
        let batches: Vec<_> = (0..rays.div_ceil(BATCH))
            .into_par_iter()
            .map(|batch| {
                let mut sum = none.clone();
                let mut escaped = 0u32;
                for i in batch * BATCH..((batch + 1) * BATCH).min(rays) {
                    let u = point(start, i);
                    let Some((ray, _)) = scene.lights.emit(light, sphere, u, &chunks[0]) else { continue };
                    if scene.bvh.occluded(&ray) {
                        continue;
                    }
                    escaped += 1;
                    for (to, lambda) in sum.iter_mut().zip(chunks).filter(|_| !alike) {
                        if let Some((_, weight)) = scene.lights.emit(light, sphere, u, lambda) {
                            add(to, weight, 1.0 / f64::from(rays));
                        }
                    }
                }
                for (to, lambda) in sum.iter_mut().zip(chunks).filter(|_| alike) {
                    let power = scene.lights.power(light, sphere.1, lambda);
                    add(to, power, f64::from(escaped) / f64::from(rays));
                }
                sum
            })
            .collect();
        for batch in batches {
            for (to, sum) in out.escaped.iter_mut().zip(batch) {
                for (t, s) in to.iter_mut().zip(sum) {
                    *t += s;
                }
            }
        }
    }
    out
}

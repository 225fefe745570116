//! Light of large glowing surfaces, by form factors.
//!
//! Model: where surfaces that glow make up a good part of all surface, as the walls of a furnace do, sampling points of
//! them is a poor way to find their light: near ones give a few samples of great weight. Then their light goes the way of
//! all diffuse light,
//!
//! ```text
//! E_n = sum over m of F_nm pi L_m        pi L: radiosity of a side that glows with radiance L
//! ```
//!
//! and it counts as direct light all the same. Smaller lights are sampled, since few rays find them.
//! Guarded by `furnace_of_translucent_sheets`. Source: our reading.

use std::f32::consts::PI;

use super::direct::DirectLight;
use super::elements::Elements;
use super::exchange::{Exchange, SETS};
use super::solve::{Shares, total};
use crate::geometry::Side;
use crate::scene::{Emitter, Scene};
use crate::spectrum::{LANES, SampledSpectrum, SampledWavelengths};

/// Glowing surfaces count as large from this share of all sides on.
const LARGE: f32 = 0.2;

/// Do glowing surfaces make up a good part of all surface?
pub(super) fn is_large(scene: &Scene) -> bool {
    let area = |s: &crate::scene::Shape| {
        (0..s.mesh.triangles.len()).map(|f| f64::from(s.mesh.face_area(f))).sum::<f64>()
    };
    let (mut glowing, mut all) = (0.0, 0.0);
    for shape in &scene.shapes {
        let area = area(shape);
        all += 2.0 * area;
        if let Some(Emitter::Area(emitter)) = shape.emitter.map(|e| &scene.lights.emitters()[e as usize]) {
            glowing += area * f64::from(emitter.sides());
        }
    }
    glowing > f64::from(LARGE) * all
}

/// Adds the light of glowing surfaces to the direct light; gives what of it meets nothing, per chunk.
pub(super) fn add(
    scene: &Scene,
    elements: &Elements,
    exchange: &Exchange,
    shares: &[Shares],
    chunks: &[SampledWavelengths],
    direct: &mut [DirectLight],
) -> Vec<[f64; LANES]> {
    let count = chunks.len();
    let sides = [Side::Adaxial, Side::Abaxial];
    let glow: Vec<SampledSpectrum> = (elements.list().iter())
        .flat_map(|e| {
            let emitter = scene.shapes[e.shape as usize].emitter;
            sides.into_iter().flat_map(move |side| {
                let wo = if side == Side::Adaxial { e.normal } else { -e.normal };
                chunks.iter().map(move |lambda| match emitter {
                    Some(light) => scene.lights.emitted(light, e.normal, wo, lambda) * PI,
                    None => SampledSpectrum::ZERO,
                })
            })
        })
        .collect();
    for (i, light) in direct.iter_mut().enumerate() {
        let (n, c) = (i / count, i % count);
        let sum = exchange
            .rows(n)
            .iter()
            .fold(SampledSpectrum::ZERO, |sum, l| sum + glow[l.node as usize * count + c] * l.factor);
        light.add(sum * (1.0 / SETS as f32), shares[i]);
    }
    let areas: Vec<f32> = elements.list().iter().map(|e| e.area_mm2).collect();
    let escape = |n: usize| (0..SETS).map(|set| exchange.escape(n, set)).sum::<f32>() / SETS as f32;
    total(count, &areas, |i| glow[i] * escape(i / count))
}

//! Where elements are halved: half of them by area, the others where light would be sent from the wrong place.
//!
//! Model: an element sends its light as if it were spread over it without edges. What of that goes astray is about the power by which its
//! direct light differs from its neighbours', seen from so near that the place matters:
//!
//! ```text
//! P_e = A_e sum over both sides of max_n |E_e - E_n| v_e,   v = sum over both sides of (mean of 1 / (1 + t / h))^2,   h = sqrt(A_e)
//! ```
//!
//! with t the length of a ray that leaves the side by the cosine, infinite where it meets nothing. In `ROUNDS` rounds those with the largest P
//! are halved: at edges of shadows deep between petals first. `LOOK` samples tell E; then every side of every element is sampled
//! anew, by
//!
//! ```text
//! N = samples c v / (E + floor)^2        v: variance of one sample, E: light, of an element and its neighbours together
//! ```
//!
//! with the c that makes the mean of N `samples`, within `LEAST` to `MOST` times that: in half shadow many samples, in full light
//! few; and more where much of the power is, on top of that mean.
//! Guarded by `elements_follow_a_shadow`, `noisy_light_gets_more_samples`. Source: our reading.

use glam::UVec2;
use rayon::prelude::*;

use super::direct::{DirectLight, Kind, Lighting};
use super::elements::Elements;
use super::facets::Facets;
use super::{Steps, neighbours, smooth};
use crate::math::Sampler;
use crate::scene::Scene;
use crate::{Error, Result};

/// Rounds of halving where light goes astray.
const ROUNDS: usize = 6;
/// Samples that tell where light changes and how much it varies.
const LOOK: u32 = 12;
/// Rays that tell how near other surfaces are.
const NEAR_RAYS: u32 = 8;
/// Marks the numbers of these rays among others of the seed.
const SEQUENCE: u32 = 0xc1ea_7a9c;
/// Light below this share of the mean need not be known relative to itself.
const FLOOR: f64 = 0.003;
/// Least and most times the samples for the sake of relative error.
const LEAST: f64 = 0.25;
const MOST: f64 = 8.0;
/// Most times the samples of an element that gets much light.
const MAX_TIMES: u32 = 32;

/// Elements, their neighbours and direct light: half of the elements by area, the others where light goes astray.
pub(super) fn refine(
    scene: &Scene,
    facets: Facets,
    lighting: &Lighting,
    wanted: u32,
    steps: &Steps,
) -> Result<(Elements, Vec<Vec<u32>>, Vec<DirectLight>)> {
    let chunks = lighting.chunks.len();
    let mut elements = Elements::new(scene, facets, wanted.div_ceil(2));
    let look = LOOK.min(lighting.samples);
    let looked = |which: &[u32]| which.iter().map(|e| (*e, [look; 2])).collect::<Vec<_>>();
    let all: Vec<u32> = (0..elements.len() as u32).collect();
    let (mut light, mut variance) = lighting.on(&elements, &looked(&all), Kind::Look, &|_| ());
    let mut near = nearness(scene, &elements, &all, lighting.seed);
    let mut beside = neighbours::neighbours(&elements);
    for round in 0..ROUNDS {
        let room = (wanted as usize).saturating_sub(elements.len()) / (ROUNDS - round);
        let astray = astray(&elements, &beside, &light, &near, chunks, room);
        if astray.is_empty() || steps.progress.cancelled() {
            break;
        }
        let new = elements.halve(scene, &astray);
        elements.describe(scene, &new);
        let (found, spread) = lighting.on(&elements, &looked(&new), Kind::Look, &|_| ());
        let found_near = nearness(scene, &elements, &new, lighting.seed);
        light.resize(elements.len() * 2 * chunks, DirectLight::default());
        variance.resize(elements.len() * 2, 0.0);
        near.resize(elements.len(), 0.0);
        for (k, e) in new.iter().enumerate() {
            let (e, from) = (*e as usize, 2 * chunks);
            light[e * from..(e + 1) * from].copy_from_slice(&found[k * from..(k + 1) * from]);
            variance[2 * e..2 * e + 2].copy_from_slice(&spread[2 * k..2 * k + 2]);
            near[e] = found_near[k];
        }
        beside = neighbours::neighbours(&elements);
    }
    let heard = |n: u64| steps.add(n);
    let counts = counts(&elements, &beside, &light, &variance, chunks, lighting.samples);
    let (light, spread) = lighting.on(&elements, &counts, Kind::Final, &heard);
    let samples = counts.iter().flat_map(|c| c.1);
    let variance: Vec<f32> = spread.iter().zip(samples).map(|(v, n)| v / n as f32).collect();
    if steps.progress.cancelled() {
        return Err(Error::Cancelled);
    }
    let light = smooth::even_out(&elements, &beside, light, chunks, &variance);
    Ok((elements, beside, light))
}

/// Samples of each side of each element, so that the relative error of the light of each is alike: in proportion to the
/// variance over the square of the light, both as neighbours together have them, `samples` in the mean; and more where
/// much of the power is, so that the sum of all light is known better than that of one element.
fn counts(
    elements: &Elements,
    beside: &[Vec<u32>],
    light: &[DirectLight],
    variance: &[f32],
    chunks: usize,
    samples: u32,
) -> Vec<(u32, [u32; 2])> {
    let brightness: Vec<f64> = light
        .chunks(chunks)
        .map(|l| l.iter().map(|d| f64::from(d.incident.mean())).sum::<f64>() / chunks as f64)
        .collect();
    let areas: Vec<f64> = elements.list().iter().map(|e| f64::from(e.area_mm2)).collect();
    let nodes = brightness.len();
    let power: Vec<f64> = (0..nodes).map(|n| brightness[n] * areas[n / 2]).collect();
    let mean_power = power.iter().sum::<f64>() / nodes.max(1) as f64;
    let mean = power.iter().sum::<f64>() / (2.0 * areas.iter().sum::<f64>()).max(1e-300);
    if mean <= 0.0 {
        // Nothing was seen, so all are alike.
        return (0..elements.len() as u32).map(|e| (e, [samples; 2])).collect();
    }
    let floor = FLOOR * mean;
    let wanted: Vec<f64> = (0..nodes)
        .map(|n| {
            let around = |of: &dyn Fn(usize) -> f64| {
                let beside = &beside[n / 2];
                let sum: f64 = beside.iter().map(|b| of(2 * *b as usize + n % 2)).sum();
                (of(n) + sum) / (1 + beside.len()) as f64
            };
            around(&|n| f64::from(variance[n])) / (around(&|n| brightness[n]) + floor).powi(2)
        })
        .collect();
    let scale = {
        let capped = |scale: f64| {
            wanted.iter().map(|w| (w * scale).clamp(LEAST, MOST)).sum::<f64>() / nodes.max(1) as f64
        };
        // As many in the mean as asked for.
        let (mut low, mut high) = (0.0, 1e6);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if capped(middle) < 1.0 { low = middle } else { high = middle }
        }
        low
    };
    let times = |n: usize| {
        let by_power = (power[n] / mean_power.max(1e-300)).min(f64::from(MAX_TIMES));
        let times = (wanted[n] * scale).clamp(LEAST, MOST).max(by_power);
        ((times * f64::from(samples)).ceil() as u32).max(1)
    };
    (0..elements.len()).map(|e| (e as u32, [times(2 * e), times(2 * e + 1)])).collect()
}

/// What the surfaces before both sides of elements see of where light leaves them: v.
fn nearness(scene: &Scene, elements: &Elements, which: &[u32], seed: u64) -> Vec<f32> {
    let before = |element: u32, side: u32| {
        let width = elements.list()[element as usize].area_mm2.sqrt();
        let sum: f32 = (0..NEAR_RAYS)
            .map(|r| {
                let mut s = Sampler::new(seed, UVec2::new(2 * element + side, SEQUENCE), r);
                let u_facet = s.next_1d();
                let start = elements.sample(scene, element, u_facet, s.next_2d());
                let ray = start.ray(side, s.next_2d());
                scene.bvh.intersect(&ray).map_or(0.0, |hit| 1.0 / (1.0 + hit.t / width))
            })
            .sum();
        (sum / NEAR_RAYS as f32).powi(2)
    };
    which.par_iter().map(|e| before(*e, 0) + before(*e, 1)).collect()
}

/// At most `room` elements of more than one facet, those first from which most light goes astray.
fn astray(
    elements: &Elements,
    beside: &[Vec<u32>],
    light: &[DirectLight],
    near: &[f32],
    chunks: usize,
    room: usize,
) -> Vec<u32> {
    let brightness = |n: usize| {
        light[n * chunks..(n + 1) * chunks].iter().map(|d| d.incident.mean()).sum::<f32>() / chunks as f32
    };
    let change = |n: usize| {
        let here = brightness(n);
        let others = beside[n / 2].iter().take(4);
        others.map(|o| (here - brightness(2 * *o as usize + n % 2)).abs()).fold(0.0, f32::max)
    };
    let mut out: Vec<(f32, u32)> = (0..elements.len())
        .filter(|e| elements.facets_of(*e as u32).len() > 1)
        .map(|e| {
            let power = elements.list()[e].area_mm2 * (change(2 * e) + change(2 * e + 1));
            (power * near[e], e as u32)
        })
        .filter(|(power, _)| *power > 0.0)
        .collect();
    out.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    out.truncate(room);
    out.into_iter().map(|o| o.1).collect()
}

#[cfg(test)]
mod tests {
    use super::super::testing::floor;
    use super::*;

    #[test]
    fn noisy_light_gets_more_samples() {
        let (elements, beside) = floor();
        let nodes = 2 * elements.len();
        let light = |e: f32| DirectLight {
            incident: crate::spectrum::SampledSpectrum::splat(e),
            ..Default::default()
        };
        let noisy = |n: usize| elements.list()[n / 2].centre.x > 0.0;
        let variance: Vec<f32> = (0..nodes).map(|n| if noisy(n) { 0.5 } else { 0.01 }).collect();
        let found = counts(&elements, &beside, &vec![light(1.0); nodes], &variance, 1, 100);
        let of = |far: &dyn Fn(f32) -> bool| {
            let of = found.iter().filter(|(e, _)| far(elements.list()[*e as usize].centre.x));
            let counts: Vec<f64> = of.flat_map(|(_, n)| n.map(f64::from)).collect();
            counts.iter().sum::<f64>() / counts.len() as f64
        };
        let (some, few) = (of(&|x| x > 1.5), of(&|x| x < -1.5));
        assert!(some > 1.5 * few && few >= 25.0, "{some} {few}");
        // In the mean what was asked for, and more only where there is more power than in the mean.
        let all = of(&|_| true);
        assert!((100.0..150.0).contains(&all), "{all}");
        // Where nothing was seen there is nothing to tell nodes apart by.
        let dark = counts(&elements, &beside, &vec![light(0.0); nodes], &vec![0.0; nodes], 1, 100);
        assert!(dark.iter().all(|(_, n)| *n == [100, 100]));
    }
}

//! Where elements are halved: half of them by area, the others where direct light changes.
//!
//! Model: an element whose direct light differs from a neighbour's by more than `CHANGE` of the mean of the two and the scene's mean
//! is halved, those that differ most first, in `ROUNDS` rounds. `LOOK` samples tell that; then every side of every element is sampled
//! anew, by
//!
//! ```text
//! N = samples c v / (E + floor)^2        v: variance of one sample, E: light, of an element and its neighbours together
//! ```
//!
//! with the c that makes the mean of N `samples`, within `LEAST` to `MOST` times that: in half shadow and in the dark many samples, in full light
//! few. Guarded by `elements_follow_a_shadow`. Source: our reading.

use super::direct::{DirectLight, Kind, Lighting};
use super::elements::Elements;
use super::facets::Facets;
use super::{Steps, neighbours, smooth};
use crate::scene::Scene;
use crate::{Error, Result};

/// Rounds of halving where direct light changes.
const ROUNDS: u32 = 4;
/// Elements are halved where direct light differs from a neighbour's by more than this share of the two and of the mean.
const CHANGE: f32 = 0.1;

/// Samples that tell where light changes and how much it varies.
const LOOK: u32 = 16;
/// Light below this share of the mean need not be known relative to itself.
const FLOOR: f64 = 0.003;
/// Least and most times the samples for the sake of relative error.
const LEAST: f64 = 0.5;
const MOST: f64 = 8.0;
/// Most times the samples of an element that gets much light.
const MAX_TIMES: u32 = 32;

/// Elements, their neighbours and direct light: half of the elements by area, the others where direct light changes.
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
    let heard = |n: u64| steps.add(n);
    let (mut light, mut variance) = lighting.on(&elements, &looked(&all), Kind::Look, &|_| ());
    let mut beside = neighbours::neighbours(&elements);
    let mut looked_at = all;
    for _ in 0..ROUNDS {
        let room = (wanted as usize).saturating_sub(elements.len());
        if room == 0 || steps.progress.cancelled() {
            break;
        }
        let mut changing = changing(&elements, &beside, &light, chunks, &looked_at);
        changing.truncate(room);
        if changing.is_empty() {
            break;
        }
        let changing: Vec<u32> = changing.into_iter().map(|c| c.1).collect();
        let new = elements.halve(scene, &changing);
        elements.describe(scene, &new);
        let (found, spread) = lighting.on(&elements, &looked(&new), Kind::Look, &|_| ());
        light.resize(elements.len() * 2 * chunks, DirectLight::default());
        variance.resize(elements.len() * 2, 0.0);
        for (k, e) in new.iter().enumerate() {
            let (e, from) = (*e as usize, 2 * chunks);
            light[e * from..(e + 1) * from].copy_from_slice(&found[k * from..(k + 1) * from]);
            variance[2 * e..2 * e + 2].copy_from_slice(&spread[2 * k..2 * k + 2]);
        }
        beside = neighbours::neighbours(&elements);
        looked_at = new;
    }
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
    let floor = (FLOOR * mean).max(1e-300);
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

/// Elements where direct light changes to a neighbour, the most first: change and element.
fn changing(
    elements: &Elements,
    beside: &[Vec<u32>],
    light: &[DirectLight],
    chunks: usize,
    which: &[u32],
) -> Vec<(f32, u32)> {
    let brightness = |n: usize| {
        light[n * chunks..(n + 1) * chunks].iter().map(|d| d.incident.mean()).sum::<f32>() / chunks as f32
    };
    let area: f64 = elements.list().iter().map(|e| f64::from(e.area_mm2)).sum();
    let mean = (0..2 * elements.len())
        .map(|n| f64::from(brightness(n)) * f64::from(elements.list()[n / 2].area_mm2))
        .sum::<f64>()
        / (2.0 * area.max(1e-300));
    let floor = mean as f32;
    let mut out: Vec<(f32, u32)> = which
        .iter()
        .filter(|e| elements.facets_of(**e).len() > 1)
        .filter_map(|e| {
            let change = (0..2)
                .flat_map(|side| {
                    let here = brightness(2 * *e as usize + side);
                    beside[*e as usize].iter().take(4).map(move |n| {
                        let there = brightness(2 * *n as usize + side);
                        (here - there).abs() / (0.5 * (here + there) + floor).max(1e-30)
                    })
                })
                .fold(0.0, f32::max);
            (change > CHANGE).then_some((change, *e))
        })
        .collect();
    out.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    out
}

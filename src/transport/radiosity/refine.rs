//! Where elements are halved: half of them by area, the others where direct light changes.
//!
//! Model: an element whose direct light differs from a neighbour's by more than `CHANGE` of the mean of the two and the scene's mean
//! is halved, those that differ most first, in `ROUNDS` rounds. Guarded by `elements_follow_a_shadow`. Source: our reading.

use super::direct::{DirectLight, Lighting};
use super::elements::Elements;
use super::facets::Facets;
use super::{Steps, neighbours};
use crate::scene::Scene;
use crate::{Error, Result};

/// Rounds of halving where direct light changes.
const ROUNDS: u32 = 4;
/// Elements are halved where direct light differs from a neighbour's by more than this share of the two and of the mean.
const CHANGE: f32 = 0.1;

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
    let once = |which: &[u32]| which.iter().map(|e| (*e, 1)).collect::<Vec<_>>();
    let all: Vec<u32> = (0..elements.len() as u32).collect();
    let heard = |n: u64| steps.add(n);
    let mut light = lighting.on(&elements, &once(&all), &heard);
    let put = |light: &mut Vec<DirectLight>, which: &[(u32, u32)], found: &[DirectLight]| {
        for ((e, _), values) in which.iter().zip(found.chunks(2 * chunks)) {
            let first = *e as usize * 2 * chunks;
            light[first..first + 2 * chunks].copy_from_slice(values);
        }
    };
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
        let found = lighting.on(&elements, &once(&new), &heard);
        light.resize(elements.len() * 2 * chunks, DirectLight::default());
        put(&mut light, &once(&new), &found);
        beside = neighbours::neighbours(&elements);
        looked_at = new;
    }
    let strong = strong(&elements, &light, chunks);
    let found = lighting.on(&elements, &strong, &|_| ());
    put(&mut light, &strong, &found);
    if steps.progress.cancelled() {
        return Err(Error::Cancelled);
    }
    Ok((elements, beside, light))
}

/// Elements that get more of the direct light than the mean one, with how many times as much (at most `MAX_TIMES`): as
/// many times the samples go there, so that the sum of all light is known better than that of one element.
fn strong(elements: &Elements, light: &[DirectLight], chunks: usize) -> Vec<(u32, u32)> {
    let power: Vec<f64> = light
        .chunks(2 * chunks)
        .zip(elements.list())
        .map(|(l, e)| l.iter().map(|d| f64::from(d.incident.mean())).sum::<f64>() * f64::from(e.area_mm2))
        .collect();
    let mean = power.iter().sum::<f64>() / power.len().max(1) as f64;
    (0u32..)
        .zip(&power)
        .map(|(e, p)| (e, (p / mean.max(1e-300)).min(f64::from(MAX_TIMES)) as u32))
        .filter(|(_, times)| *times > 1)
        .collect()
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

//! The light that is exchanged, order by order.
//!
//! Equation, for each node n of an element whose other node is n', per wavelength, for the light that was scattered k times:
//!
//! ```text
//! B0_n = D_n                                       what the element does with direct light
//! Ek_n = c sum over m of F_nm (Bk_m + g_m . o_nm)  irradiance by the rays of set k mod SETS
//! Bk+1_n = R_n Ek_n + T_n' Ek_n'
//! E_n  = c' sum over m of F_nm (B_m + g_m . o_nm)  in the end, with B = sum of all Bk, by all rays
//! ```
//!
//! where g is the slope of the light along the element and o where the rays from n end on m: sheets that lie closer to each other than
//! their elements are wide pass light straight across, not sideways. The factors c, near one, are the same for all nodes: all that does not escape
//! arrives, and as much is absorbed in the end as was on the way.
//!
//! Every order adds light, so what there is of it is a lower bound, and the last one tells how much is still under way:
//!
//! ```text
//! residual = sum A Bk / sum A E_direct, the largest over the wavelengths
//! ```
//!
//! Guarded by `furnace_of_translucent_sheets`, `parallel_sheets_match_the_series`. Source: Goral et al. 1984;
//! two-sided with transmission, Rushmeier and Torrance 1990.

use rayon::prelude::*;

use super::direct::DirectLight;
use super::exchange::{Exchange, SETS};
use super::slopes::{Range, Stencils};
use crate::spectrum::{LANES, SampledSpectrum};
use crate::transport::Progress;

/// Nodes that one thread takes at a time.
const BATCH: usize = 256;

/// Reflected and transmitted share of diffuse light that falls on a node.
pub(super) type Shares = (SampledSpectrum, SampledSpectrum);

/// Light of all nodes, `chunks` values each.
#[derive(Debug)]
pub(super) struct Solution {
    /// Irradiance from other surfaces.
    pub(super) indirect: Vec<SampledSpectrum>,
    /// The largest share by which the light of an order had to be corrected so that none is lost or made.
    pub(super) imbalance: f64,
    /// About the variance of its brightness that the rays leave, for each node.
    pub(super) variance: Vec<f32>,
    /// Power that has left the scene after being scattered, per wavelength.
    pub(super) escaped: Vec<[f64; LANES]>,
    /// Power that is still under way, per wavelength.
    pub(super) under_way: Vec<[f64; LANES]>,
    /// The largest share of the direct light that is still under way.
    pub(super) residual: f64,
    /// Orders of scattering.
    pub(super) orders: u32,
}

/// Sums of `value(node)` times the area of each node, per chunk, in the order of the nodes.
pub(super) fn total(
    chunks: usize,
    areas_mm2: &[f32],
    value: impl Fn(usize) -> SampledSpectrum,
) -> Vec<[f64; LANES]> {
    let mut sums = vec![[0.0; LANES]; chunks];
    for n in 0..2 * areas_mm2.len() {
        for (c, sum) in sums.iter_mut().enumerate() {
            let v = value(n * chunks + c);
            for (s, v) in sum.iter_mut().zip(v.0) {
                *s += f64::from(v) * f64::from(areas_mm2[n / 2]);
            }
        }
    }
    sums
}

/// Solves until the residual is below `goal`, for at most `max_orders` orders, or until the progress is cancelled.
pub(super) fn solve(
    exchange: &Exchange,
    stencils: &Stencils,
    direct: &[DirectLight],
    shares: &[Shares],
    areas_mm2: &[f32],
    (goal, max_orders): (f64, u32),
    progress: &dyn Progress,
) -> Solution {
    let nodes = 2 * areas_mm2.len();
    let chunks = direct.len() / nodes.max(1);
    let other = |i: usize| ((i / chunks) ^ 1) * chunks + i % chunks;
    let scattered = |irradiance: &[SampledSpectrum]| -> Vec<SampledSpectrum> {
        (0..irradiance.len())
            .into_par_iter()
            .with_min_len(BATCH)
            .map(|i| irradiance[i] * shares[i].0 + irradiance[other(i)] * shares[other(i)].1)
            .collect()
    };
    let absorbed = |irradiance: &[SampledSpectrum]| {
        total(chunks, areas_mm2, |i| irradiance[i] * (SampledSpectrum::ONE - shares[i].0 - shares[i].1))
    };
    let received = total(chunks, areas_mm2, |i| direct[i].incident);
    let none = vec![SampledSpectrum::ZERO; direct.len()];
    // Light of one order, and of all before it.
    let mut next: Vec<SampledSpectrum> =
        (0..direct.len()).map(|i| direct[i].reflected + direct[other(i)].transmitted).collect();
    let (mut radiosity, mut on_the_way) = (none.clone(), none);
    let mut escaped = vec![[0.0; LANES]; chunks];
    let mut imbalance = 0.0f64;
    let mut orders = 0;
    let (mut under_way, mut residual, mut first);
    first = None;
    loop {
        under_way = total(chunks, areas_mm2, |i| next[i]);
        residual = (under_way.as_flattened().iter().zip(received.as_flattened()))
            .filter(|(_, r)| **r > 0.0)
            .map(|(u, r)| u / r)
            .fold(0.0, f64::max);
        let steps = expected_orders(*first.get_or_insert(residual), residual, goal, orders, max_orders);
        progress.advance(u64::from(orders), u64::from(steps));
        if residual <= goal || orders >= max_orders || progress.cancelled() {
            break;
        }
        let set = orders as usize % SETS;
        let mut irradiance = gather(exchange, stencils, &next, chunks, Some(set));
        let escape = total(chunks, areas_mm2, |i| next[i] * exchange.escape(i / chunks, set));
        let arriving = difference(&under_way, &escape);
        let arrived = total(chunks, areas_mm2, |i| irradiance[i]);
        imbalance = imbalance.max(scale(&mut irradiance, &arrived, &arriving, chunks));
        for (sum, e) in escaped.as_flattened_mut().iter_mut().zip(escape.as_flattened()) {
            *sum += e;
        }
        radiosity.iter_mut().zip(&next).for_each(|(sum, b)| *sum += *b);
        on_the_way.iter_mut().zip(&irradiance).for_each(|(sum, e)| *sum += *e);
        next = scattered(&irradiance);
        orders += 1;
    }
    let mut indirect = gather(exchange, stencils, &radiosity, chunks, None);
    let (is, was) = (absorbed(&indirect), absorbed(&on_the_way));
    imbalance = imbalance.max(scale(&mut indirect, &is, &was, chunks));
    let variance = variance(exchange, &radiosity, chunks);
    Solution { indirect, imbalance, variance, escaped, under_way, residual, orders }
}

fn difference(a: &[[f64; LANES]], b: &[[f64; LANES]]) -> Vec<[f64; LANES]> {
    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|l| a[l] - b[l])).collect()
}

/// Scales the light of all nodes alike from what it is in all to what it is to be; gives the largest change.
fn scale(light: &mut [SampledSpectrum], is: &[[f64; LANES]], to_be: &[[f64; LANES]], chunks: usize) -> f64 {
    let by: Vec<SampledSpectrum> = (is.iter().zip(to_be))
        .map(|(is, to_be)| {
            SampledSpectrum::from_fn(|l| if is[l] > 0.0 { (to_be[l] / is[l]) as f32 } else { 1.0 })
        })
        .collect();
    light.par_chunks_mut(chunks).with_min_len(BATCH).for_each(|light| {
        light.iter_mut().zip(&by).for_each(|(e, s)| *e *= *s);
    });
    by.iter().flat_map(|s| s.0).fold(0.0, |most, s| most.max(f64::from(s - 1.0).abs()))
}

/// Irradiance of every node from the others' radiosity, by one set of rays or by all.
fn gather(
    exchange: &Exchange,
    stencils: &Stencils,
    radiosity: &[SampledSpectrum],
    chunks: usize,
    set: Option<usize>,
) -> Vec<SampledSpectrum> {
    let runs = linear(exchange, stencils, radiosity, chunks);
    let mut irradiance = vec![SampledSpectrum::ZERO; radiosity.len()];
    irradiance.par_chunks_mut(BATCH * chunks).enumerate().for_each(|(batch, out)| {
        for (k, e) in out.chunks_mut(chunks).enumerate() {
            let node = batch * BATCH + k;
            let (links, weight) = match set {
                Some(set) => (exchange.row(node, set), 1.0),
                None => (exchange.rows(node), 1.0 / SETS as f32),
            };
            for link in links {
                let from = &runs[link.node as usize * chunks..(link.node as usize + 1) * chunks];
                let factor = link.factor * weight;
                let [x, y] = link.place.map(|p| f32::from(p) * factor);
                for (e, [b, s, t]) in e.iter_mut().zip(from) {
                    *e += *b * factor + *s * x + *t * y;
                }
            }
        }
    });
    irradiance
}

/// The light of every node and chunk: value and slopes, these per step of the links' places and no steeper than leaves all of it positive.
fn linear(
    exchange: &Exchange,
    stencils: &Stencils,
    radiosity: &[SampledSpectrum],
    chunks: usize,
) -> Vec<[SampledSpectrum; 3]> {
    let slopes = stencils.slopes(radiosity, chunks, Range::Free);
    let run = |i: usize| {
        let (node, value) = (i / chunks, radiosity[i]);
        let [s, t] = slopes.of(node, i % chunks).map(|s| s * exchange.step_mm(node));
        let share = SampledSpectrum::from_fn(|l| {
            let fall = s[l].hypot(t[l]) * exchange.farthest(node);
            if fall > value[l] { value[l] / fall } else { 1.0 }
        });
        [value, s * share, t * share]
    };
    (0..radiosity.len()).into_par_iter().with_min_len(BATCH).map(run).collect()
}

/// Variance of the brightness of each node's irradiance: that of the light along its lines, over their number.
fn variance(exchange: &Exchange, radiosity: &[SampledSpectrum], chunks: usize) -> Vec<f32> {
    let bright: Vec<f32> =
        radiosity.chunks(chunks).map(|b| b.iter().map(|b| b.mean()).sum::<f32>() / chunks as f32).collect();
    (0..bright.len())
        .into_par_iter()
        .with_min_len(BATCH)
        .map(|i| {
            let (sum, squares) = exchange.rows(i).iter().fold((0.0f32, 0.0f32), |(sum, squares), l| {
                let b = bright[l.node as usize];
                let share = l.factor / SETS as f32;
                (sum + share * b, squares + share * b * b)
            });
            (squares - sum * sum).max(0.0) / exchange.rays()
        })
        .collect()
}

/// How many orders the goal will take, if the light goes on to fade as it did.
fn expected_orders(first: f64, now: f64, goal: f64, orders: u32, max_orders: u32) -> u32 {
    let fade = (now / first).ln();
    if orders == 0 || fade >= 0.0 {
        return max_orders;
    }
    let more = f64::from(orders) * (goal / first).ln() / fade;
    (more.ceil() as u32).clamp(orders, max_orders)
}

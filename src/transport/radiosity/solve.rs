//! The light that is exchanged, order by order.
//!
//! Equation, for each node n of an element whose other node is n', per wavelength:
//!
//! ```text
//! B_n = D_n + R_n E_n + T_n' E_n',       D_n = what the element does with direct light
//! E_n = sum over m of F_nm B_m           irradiance from other surfaces
//! ```
//!
//! Jacobi iteration from E = 0: step k adds the light that was scattered k times, so every step is a lower bound, and
//! what the last step added tells how much is still under way:
//!
//! ```text
//! residual = sum A (B_k - B_k-1) / sum A E_direct, the largest over the wavelengths
//! ```
//!
//! Guarded by `furnace_of_translucent_sheets`, `parallel_sheets_match_the_series`. Source: Goral et al. 1984;
//! two-sided with transmission, Rushmeier and Torrance 1990.

use rayon::prelude::*;

use super::direct::DirectLight;
use super::exchange::Exchange;
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
    direct: &[DirectLight],
    shares: &[Shares],
    areas_mm2: &[f32],
    (goal, max_orders): (f64, u32),
    progress: &dyn Progress,
) -> Solution {
    let nodes = 2 * areas_mm2.len();
    let chunks = direct.len() / nodes.max(1);
    let other = |i: usize| ((i / chunks) ^ 1) * chunks + i % chunks;
    let sources: Vec<SampledSpectrum> =
        (0..direct.len()).map(|i| direct[i].reflected + direct[other(i)].transmitted).collect();
    let leaving = |indirect: &[SampledSpectrum]| -> Vec<SampledSpectrum> {
        (0..sources.len())
            .into_par_iter()
            .with_min_len(BATCH)
            .map(|i| sources[i] + indirect[i] * shares[i].0 + indirect[other(i)] * shares[other(i)].1)
            .collect()
    };
    let received = total(chunks, areas_mm2, |i| direct[i].incident);
    let mut indirect = vec![SampledSpectrum::ZERO; sources.len()];
    let mut radiosity = vec![SampledSpectrum::ZERO; sources.len()];
    let mut next = sources.clone();
    let mut orders = 0;
    let (mut under_way, mut residual, mut first);
    first = None;
    loop {
        under_way = total(chunks, areas_mm2, |i| next[i] - radiosity[i]);
        residual = (under_way.as_flattened().iter().zip(received.as_flattened()))
            .filter(|(_, r)| **r > 0.0)
            .map(|(u, r)| u / r)
            .fold(0.0, f64::max);
        let steps = expected_orders(*first.get_or_insert(residual), residual, goal, orders, max_orders);
        progress.advance(u64::from(orders), u64::from(steps));
        if residual <= goal || orders >= max_orders || progress.cancelled() {
            break;
        }
        radiosity = next;
        indirect.par_chunks_mut(BATCH * chunks).enumerate().for_each(|(batch, out)| {
            for (k, e) in out.chunks_mut(chunks).enumerate() {
                e.fill(SampledSpectrum::ZERO);
                for (j, f) in exchange.row(batch * BATCH + k) {
                    let from = &radiosity[j as usize * chunks..(j as usize + 1) * chunks];
                    for (e, b) in e.iter_mut().zip(from) {
                        *e += *b * f;
                    }
                }
            }
        });
        next = leaving(&indirect);
        orders += 1;
    }
    let escaped = total(chunks, areas_mm2, |i| radiosity[i] * exchange.escape(i / chunks));
    let variance = variance(exchange, &radiosity, chunks);
    Solution { indirect, variance, escaped, under_way, residual, orders }
}

/// Variance of the brightness of each node's irradiance: that of the light along its lines, over their number.
fn variance(exchange: &Exchange, radiosity: &[SampledSpectrum], chunks: usize) -> Vec<f32> {
    let bright: Vec<f32> =
        radiosity.chunks(chunks).map(|b| b.iter().map(|b| b.mean()).sum::<f32>() / chunks as f32).collect();
    (0..bright.len())
        .into_par_iter()
        .with_min_len(BATCH)
        .map(|i| {
            let (sum, squares) = exchange.row(i).fold((0.0f32, 0.0f32), |(sum, squares), (j, f)| {
                let b = bright[j as usize];
                (sum + f * b, squares + f * b * b)
            });
            (squares - sum * sum).max(0.0) / exchange.lines()
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

//! The light that is exchanged, order by order.
//!
//! Equation, for each node n of an element whose other node is n', per wavelength, for the light that was scattered k times:
//!
//! ```text
//! B0_n = D_n                                       what the element does with direct light
//! Ek_n = c_n sum over m of F_nm (Bk_m + g_m . o_nm)  irradiance by the rays of set k mod SETS
//! Bk+1_n = R_n Ek_n + T_n' Ek_n'
//! E_n  = c'_n sum over m of F_nm (B_m + g_m . o_nm)  in the end, with B = sum of all Bk, by all rays
//! ```
//!
//! where g is the slope of the light along the element and o where the rays from n end on m: sheets that lie closer to each other than
//! their elements are wide pass light straight across, not sideways.
//!
//! How much light arrives is known twice: from the rays of those that send it, B A (1 - escape), which is exact in a closed room, and
//! from the rays of those that get it, the sum of F B A, which is better where small things stand on a wide floor. Their mean by the
//! inverses of their variances is what arrives, the rest escapes, and the factors c make it so; likewise for what is absorbed in the
//! end. They are least squares: what is lacking, D, falls on the nodes whose rays know their light least
//!
//! ```text
//! sum over n of w_n dE_n = D,   sum over n of dE_n^2 / v_n least:   dE_n = D w_n v_n / sum over m of w_m^2 v_m
//! ```
//!
//! with w the area of a node, or the area times what it absorbs, and v the variance that its rays leave.
//!
//! Every order adds light, so what there is of it is a lower bound, and the last one tells how much is still under way:
//!
//! ```text
//! residual = sum A Bk / sum A E_direct, the largest over the wavelengths
//! ```
//!
//! Guarded by `furnace_of_translucent_sheets`, `parallel_sheets_match_the_series`, `corrections_fall_where_light_is_least_known`,
//! `a_wide_floor_does_not_dim_what_stands_on_it`. Source: Goral et al. 1984;
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
    let absorbs = |i: usize| (SampledSpectrum::ONE - shares[i].0 - shares[i].1).map(|v| v.max(0.0));
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
        let sent = difference(&under_way, &escape);
        let arrived = total(chunks, areas_mm2, |i| irradiance[i]);
        let variance = variance(exchange, &next, areas_mm2, chunks, Some(set));
        let trust = trust(exchange, &next, areas_mm2, &variance, chunks);
        let arriving = mean(&arrived, &sent, trust);
        let escape = difference(&under_way, &arriving);
        imbalance = imbalance
            .max(correct(&mut irradiance, &arriving, areas_mm2, &variance, |_| SampledSpectrum::ONE));
        for (sum, e) in escaped.as_flattened_mut().iter_mut().zip(escape.as_flattened()) {
            *sum += e;
        }
        radiosity.iter_mut().zip(&next).for_each(|(sum, b)| *sum += *b);
        on_the_way.iter_mut().zip(&irradiance).for_each(|(sum, e)| *sum += *e);
        next = scattered(&irradiance);
        orders += 1;
    }
    let mut indirect = gather(exchange, stencils, &radiosity, chunks, None);
    let was = total(chunks, areas_mm2, |i| on_the_way[i] * absorbs(i));
    let is = total(chunks, areas_mm2, |i| indirect[i] * absorbs(i));
    let variance = variance(exchange, &radiosity, areas_mm2, chunks, None);
    let trust = trust(exchange, &radiosity, areas_mm2, &variance, chunks);
    let to_be = mean(&is, &was, trust);
    for (sum, d) in escaped.as_flattened_mut().iter_mut().zip(difference(&was, &to_be).as_flattened()) {
        *sum += d;
    }
    imbalance = imbalance.max(correct(&mut indirect, &to_be, areas_mm2, &variance, absorbs));
    Solution { indirect, imbalance, variance, escaped, under_way, residual, orders }
}

fn difference(a: &[[f64; LANES]], b: &[[f64; LANES]]) -> Vec<[f64; LANES]> {
    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|l| a[l] - b[l])).collect()
}

/// `a` with a share of the way to `b`.
fn mean(a: &[[f64; LANES]], b: &[[f64; LANES]], share: f64) -> Vec<[f64; LANES]> {
    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|l| a[l] + (b[l] - a[l]) * share)).collect()
}

/// How much the total of the light by the rays of those that send it counts beside that by the rays of those that get it, 0 to 1: by the
/// inverses of their variances.
fn trust(
    exchange: &Exchange,
    radiosity: &[SampledSpectrum],
    areas_mm2: &[f32],
    variance: &[f32],
    chunks: usize,
) -> f64 {
    let (mut sent, mut got) = (0.0, 0.0);
    for (n, variance) in variance.iter().enumerate() {
        let area = f64::from(areas_mm2[n / 2]);
        let power = f64::from(brightness(radiosity, n, chunks)) * area;
        sent += power * power * f64::from(exchange.doubt(n) / exchange.rays());
        got += area * area * f64::from(*variance);
    }
    if sent > 0.0 { got / (sent + got) } else { 1.0 }
}

/// Mean light of a node over the wavelengths.
fn brightness(light: &[SampledSpectrum], node: usize, chunks: usize) -> f32 {
    light[node * chunks..(node + 1) * chunks].iter().map(|e| e.mean()).sum::<f32>() / chunks as f32
}

/// Passes of the correction.
const PASSES: usize = 5;
/// What is left of a node's light in one pass at least.
const LEAST_LEFT: f32 = 0.1;

/// Changes the light of the nodes so that the sum of `share` of it times their areas is `to_be`, most where it is least known: light is
/// added where it may have been missed, and taken in proportion to its square where it may be too much. The last pass changes all
/// alike. Gives the largest correction, as a share of what there was.
fn correct(
    light: &mut [SampledSpectrum],
    to_be: &[[f64; LANES]],
    areas_mm2: &[f32],
    variance: &[f32],
    share: impl Fn(usize) -> SampledSpectrum + Sync,
) -> f64 {
    let chunks = to_be.len();
    let mut largest = 0.0f64;
    for pass in 0..PASSES {
        let is = total(chunks, areas_mm2, |i| light[i] * share(i));
        let lacking = difference(to_be, &is);
        if pass == 0 {
            let shares = lacking.as_flattened().iter().zip(is.as_flattened());
            largest = shares.filter(|(_, is)| **is > 0.0).map(|(d, is)| (d / is).abs()).fold(0.0, f64::max);
        }
        let last = pass + 1 == PASSES;
        let bright: Vec<f32> = (0..variance.len()).map(|n| brightness(light, n, chunks)).collect();
        // w v of a node, per wavelength.
        let doubt = |i: usize, e: SampledSpectrum| {
            let (n, c) = (i / chunks, i % chunks);
            let all = areas_mm2[n / 2] * variance[n];
            let part = |l: usize| if bright[n] > 0.0 { (e[l] / bright[n]).powi(2) } else { 0.0 };
            let share = share(i);
            SampledSpectrum::from_fn(|l| share[l] * all * if lacking[c][l] < 0.0 { part(l) } else { 1.0 })
        };
        let by = if last { is } else { total(chunks, areas_mm2, |i| doubt(i, light[i]) * share(i)) };
        let rate = |c: usize, l: usize| if by[c][l] > 0.0 { (lacking[c][l] / by[c][l]) as f32 } else { 0.0 };
        let rate: Vec<_> = (0..chunks).map(|c| SampledSpectrum::from_fn(|l| rate(c, l))).collect();
        light.par_iter_mut().with_min_len(BATCH).enumerate().for_each(|(i, e)| {
            let rate = rate[i % chunks];
            if last {
                *e *= SampledSpectrum::ONE + rate;
            } else {
                let more = doubt(i, *e) * rate;
                *e = SampledSpectrum::from_fn(|l| (e[l] + more[l]).max(LEAST_LEFT * e[l]));
            }
        });
    }
    largest
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

/// Variance of the brightness of each node's irradiance: that of the light along its lines, over their number. Rays that others send to the
/// node tell of light that its own few rays may miss: both count, as in [`Exchange::doubt`].
fn variance(
    exchange: &Exchange,
    radiosity: &[SampledSpectrum],
    areas_mm2: &[f32],
    chunks: usize,
    set: Option<usize>,
) -> Vec<f32> {
    let nodes = 2 * areas_mm2.len();
    let bright: Vec<f32> = (0..nodes).map(|n| brightness(radiosity, n, chunks)).collect();
    // Sums of the light and of its square.
    let mut sums = vec![(0.0f32, 0.0f32); nodes];
    let mut add = |n: usize, share: f32, b: f32| {
        sums[n].0 += share * b;
        sums[n].1 += share * b * b;
    };
    for i in 0..nodes {
        let (links, sets) = match set {
            Some(set) => (exchange.row(i, set), 1.0),
            None => (exchange.rows(i), SETS as f32),
        };
        for link in links {
            let j = link.node as usize;
            let (own, other) = (areas_mm2[i / 2], areas_mm2[j / 2]);
            let share = link.factor / sets;
            let balance = 1.0 / (own + other).max(1e-30);
            // Where all rays meet something they miss nothing.
            add(i, if exchange.doubt(i) > 0.0 { share * other * balance } else { share }, bright[j]);
            if exchange.doubt(j) > 0.0 {
                add(j, share * own * balance, bright[i]);
            }
        }
    }
    let rays = exchange.rays() * if set.is_some() { 1.0 / SETS as f32 } else { 1.0 };
    sums.iter().map(|(sum, squares)| (squares - sum * sum).max(0.0) / rays).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corrections_fall_where_light_is_least_known() {
        // Two elements of 1 and 100 mm2, both sides; the wide one's light is known to 30 %, the small one's to 1 %.
        let areas = [1.0, 100.0];
        let variance = [4e-4, 4e-4, 0.36, 0.36];
        let light = vec![SampledSpectrum::splat(2.0); 4];
        let sum = |light: &[SampledSpectrum]| total(1, &areas, |i| light[i])[0][3];
        let corrected = |to_be: f64, variance: &[f32]| {
            let mut out = light.clone();
            let by = correct(&mut out, &[[to_be; LANES]], &areas, variance, |_| SampledSpectrum::ONE);
            assert!((sum(&out) / to_be - 1.0).abs() < 1e-5, "{} {to_be}", sum(&out));
            (out, by)
        };
        // 404 is what there is.
        let (out, by) = corrected(444.4, &variance);
        assert!((by - 0.1).abs() < 1e-6, "{by}");
        assert!((out[0][3] / 2.0 - 1.0).abs() < 1e-4 && (out[2][3] / 2.0 - 1.1).abs() < 2e-3, "{out:?}");
        // More than the least known can take is taken all the same, and nothing becomes negative.
        let (out, _) = corrected(4.0, &variance);
        assert!(out.iter().all(|e| e[3] >= 0.0), "{out:?}");
        // Where every node knows its light, all of it changes alike.
        let (out, _) = corrected(444.4, &[0.0; 4]);
        assert!(out.iter().all(|e| (e[3] / 2.2 - 1.0).abs() < 1e-5), "{out:?}");
    }
}

//! Which share of the light that leaves a node goes to which other one.
//!
//! Model: straight lines between nodes, as rays with cosine-distributed directions from uniform points of every node find
//! them. A line between i and j may be found from either end; with q = rays / area, each one counts
//!
//! ```text
//! S_ij = (n_ij + n_ji) / (q_i + q_j)         A_i F_ij = A_j F_ji = S_ij           (balance heuristic)
//! e_i  = (rays of i that meet nothing) / q_i
//! d_i (sum_j S_ij d_j + e_i) = A_i           d near one: what is left of the rays' noise
//! F_ij = d_i S_ij d_j / A_i,  escape_i = d_i e_i / A_i
//! ```
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | n_ij | rays of node i that meet node j | |
//! | F_ij | share of the light from i that falls on j: form factor | |
//! | A | area of a node | mm2 |
//!
//! So factors are reciprocal, rows with the share that escapes sum to one, and no light is lost or made, whatever the number
//! of rays; how near F is to the truth is their number's matter. Memory: 24 bytes per node and ray, at most. Where rows cannot be balanced (a node
//! of a closed place that too few rays reach) the largest error is told as `imbalance` and stays in the energy ledger.
//!
//! Guarded by `rows_sum_to_one_and_are_reciprocal`, `factors_of_parallel_squares`. Source: balance heuristic, Veach 1997; scaling of rows and columns,
//! Sinkhorn 1967; global lines, Sbert 1993; their union is our reading.

use glam::UVec2;
use rayon::prelude::*;

use super::elements::{Elements, node};
use super::facets::face_normal;
use crate::geometry::ray::offset_origin;
use crate::geometry::{Ray, Side};
use crate::math::{Frame, Sampler, warp};
use crate::scene::Scene;
use crate::transport::Progress;
use crate::{Error, Result};

/// Nothing was met.
const MISS: u32 = u32::MAX;
/// Balancing ends at this largest error of a row.
const BALANCED: f64 = 1e-7;
/// ... or after so many steps.
const MAX_BALANCING: u32 = 300;
/// Marks the numbers of these rays among others of the seed.
const SEQUENCE: u32 = 0x5ad1_0517;
/// Nodes that one thread traces before it tells the progress.
const BATCH: usize = 64;

/// Sparse form factors between the nodes.
#[derive(Debug)]
pub(super) struct Exchange {
    /// First entry of each row; one more at the end.
    rows: Vec<usize>,
    columns: Vec<u32>,
    factors: Vec<f32>,
    escape: Vec<f32>,
    imbalance: f64,
    rays: usize,
}

/// Bytes that the rays and factors of so many nodes take at most.
pub(super) fn bytes(nodes: u64, rays: u64) -> u64 {
    24 * nodes * rays
}

impl Exchange {
    /// Traces `rays` from every node.
    pub(super) fn trace(
        scene: &Scene,
        elements: &Elements,
        rays: u32,
        seed: u64,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let nodes = 2 * elements.len();
        let total = nodes as u64;
        let done = std::sync::atomic::AtomicU64::new(0);
        let mut hits = vec![MISS; nodes * rays as usize];
        hits.par_chunks_mut(rays as usize * BATCH).enumerate().for_each(|(batch, chunk)| {
            if progress.cancelled() {
                return;
            }
            let count = chunk.len() / rays as usize;
            for (k, hits) in chunk.chunks_mut(rays as usize).enumerate() {
                trace_node(scene, elements, (batch * BATCH + k) as u32, seed, hits);
                hits.sort_unstable();
            }
            let before = done.fetch_add(count as u64, std::sync::atomic::Ordering::Relaxed);
            progress.advance(before + count as u64, total);
        });
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let areas: Vec<f64> = elements.list().iter().map(|e| f64::from(e.area_mm2)).collect();
        Ok(Self::of_hits(&hits, rays as usize, &areas))
    }

    /// From the sorted nodes that the rays of each node met. `areas_mm2` are those of the elements.
    fn of_hits(hits: &[u32], rays: usize, areas_mm2: &[f64]) -> Self {
        let nodes = hits.len() / rays;
        // The rays that came to each node, by the node that they came from.
        let mut start = vec![0usize; nodes + 1];
        for h in hits.iter().filter(|h| **h != MISS) {
            start[*h as usize + 1] += 1;
        }
        for n in 0..nodes {
            start[n + 1] += start[n];
        }
        let mut came = vec![0u32; start[nodes]];
        let mut next = start.clone();
        for (i, row) in hits.chunks(rays).enumerate() {
            for h in row.iter().filter(|h| **h != MISS) {
                came[next[*h as usize]] = i as u32;
                next[*h as usize] += 1;
            }
        }
        drop(next);
        let area = |n: usize| areas_mm2[n / 2];
        let density = |n: usize| rays as f64 / area(n);
        let merged: Vec<Vec<(u32, f32)>> = hits
            .par_chunks(rays)
            .enumerate()
            .map(|(i, row)| {
                let sent = row.iter().copied().take_while(|h| *h != MISS);
                runs(merge(sent, came[start[i]..start[i + 1]].iter().copied()))
                    .map(|(j, n)| (j, (n as f64 / (density(i) + density(j as usize))) as f32))
                    .collect()
            })
            .collect();
        drop((came, start));
        let mut rows = Vec::with_capacity(nodes + 1);
        rows.push(0);
        for m in &merged {
            rows.push(rows[rows.len() - 1] + m.len());
        }
        let entries = rows[nodes];
        let (mut columns, mut factors) = (Vec::with_capacity(entries), Vec::with_capacity(entries));
        for m in merged {
            columns.extend(m.iter().map(|e| e.0));
            factors.extend(m.iter().map(|e| e.1));
        }
        let escape = hits
            .chunks(rays)
            .enumerate()
            .map(|(i, row)| (row.iter().filter(|h| **h == MISS).count() as f64 / density(i)) as f32)
            .collect();
        let mut out = Self { rows, columns, factors, escape, imbalance: 0.0, rays };
        out.balance(&area);
        out
    }

    /// Scales rows and columns alike until each row has its area.
    fn balance(&mut self, area: &(dyn Fn(usize) -> f64 + Sync)) {
        let nodes = self.escape.len();
        let mut d = vec![1.0f64; nodes];
        for _ in 0..MAX_BALANCING {
            let sums: Vec<f64> = (0..nodes)
                .into_par_iter()
                .with_min_len(256)
                .map(|i| {
                    let row = self.row(i);
                    let sum: f64 = row.map(|(j, s)| f64::from(s) * d[j as usize]).sum();
                    sum + f64::from(self.escape[i])
                })
                .collect();
            self.imbalance = (0..nodes).map(|i| (d[i] * sums[i] / area(i) - 1.0).abs()).fold(0.0, f64::max);
            if self.imbalance < BALANCED {
                break;
            }
            for i in 0..nodes {
                d[i] = (d[i] * area(i) / sums[i]).sqrt();
            }
        }
        for i in 0..nodes {
            for k in self.rows[i]..self.rows[i + 1] {
                let j = self.columns[k] as usize;
                self.factors[k] = (f64::from(self.factors[k]) * d[i] * d[j] / area(i)) as f32;
            }
            self.escape[i] = (f64::from(self.escape[i]) * d[i] / area(i)) as f32;
        }
    }

    /// Entries of a row: node and factor.
    pub(super) fn row(&self, i: usize) -> impl Iterator<Item = (u32, f32)> {
        let range = self.rows[i]..self.rows[i + 1];
        self.columns[range.clone()].iter().copied().zip(self.factors[range].iter().copied())
    }

    /// Share of the light from a node that meets nothing.
    pub(super) fn escape(&self, i: usize) -> f32 {
        self.escape[i]
    }

    /// About how many lines tell the light of a node: its own rays, and as many that come to it.
    pub(super) fn lines(&self) -> f32 {
        2.0 * self.rays as f32
    }

    /// Number of entries.
    pub(super) fn entries(&self) -> usize {
        self.columns.len()
    }

    /// Largest relative error of a row's sum.
    pub(super) fn imbalance(&self) -> f64 {
        self.imbalance
    }
}

/// Merges two sorted sequences.
fn merge(a: impl Iterator<Item = u32>, b: impl Iterator<Item = u32>) -> impl Iterator<Item = u32> {
    let (mut a, mut b) = (a.peekable(), b.peekable());
    std::iter::from_fn(move || match (a.peek(), b.peek()) {
        (Some(x), Some(y)) if x <= y => a.next(),
        (Some(_), None) => a.next(),
        _ => b.next(),
    })
}

/// Equal neighbours with their number.
fn runs(sorted: impl Iterator<Item = u32>) -> impl Iterator<Item = (u32, u32)> {
    let mut sorted = sorted.peekable();
    std::iter::from_fn(move || {
        let value = sorted.next()?;
        let mut count = 1;
        while sorted.next_if_eq(&value).is_some() {
            count += 1;
        }
        Some((value, count))
    })
}

/// The node at the end of each ray of a node.
fn trace_node(scene: &Scene, elements: &Elements, node: u32, seed: u64, hits: &mut [u32]) {
    let (element, up) = (node / 2, if node.is_multiple_of(2) { 1.0 } else { -1.0 });
    for (r, hit) in hits.iter_mut().enumerate() {
        let mut s = Sampler::new(seed, UVec2::new(node, SEQUENCE), r as u32);
        let u_facet = s.next_1d();
        let start = elements.sample(scene, element, u_facet, s.next_2d());
        let local = warp::square_to_cosine_hemisphere(s.next_2d());
        let direction = Frame::from_normal(start.normal * up).to_world(local).normalize();
        let ray = Ray::new(offset_origin(start.p, start.normal * up, direction), direction);
        *hit = node_hit(scene, elements, &ray).map_or(MISS, |h| h as u32);
    }
}

/// The node that a ray meets first.
pub(super) fn node_hit(scene: &Scene, elements: &Elements, ray: &Ray) -> Option<usize> {
    let hit = scene.bvh.intersect(ray)?;
    let normal = face_normal(&scene.shapes[hit.shape as usize].mesh, hit.face as usize);
    let side = if normal.dot(ray.direction) < 0.0 { Side::Adaxial } else { Side::Abaxial };
    elements.at(hit.shape, hit.face, hit.b).map(|e| node(e, side))
}

#[cfg(test)]
mod tests {
    use super::super::facets::Facets;
    use super::super::testing::scene;
    use super::*;
    use crate::transport::NoProgress;

    fn exchange(text: &str, n: u32, rays: u32) -> (Elements, Exchange) {
        let s = scene(text);
        let elements = Elements::new(&s, Facets::new(&s, n), n);
        let x = Exchange::trace(&s, &elements, rays, 1, &NoProgress).unwrap();
        (elements, x)
    }

    #[test]
    fn rows_sum_to_one_and_are_reciprocal() {
        let (elements, x) = exchange(
            "[shapes.ball]\ntype = \"sphere\"\nradius_mm = 3\nsubdivisions = 3\nmaterial = \"grey\"\n\
             [shapes.floor]\ntype = \"quad\"\nwidth_mm = 400\nheight_mm = 90\nposition_mm = [0, 0, -4]\nmaterial = \"grey\"\n",
            300,
            64,
        );
        assert!(x.imbalance() < 1e-6, "{}", x.imbalance());
        for i in 0..2 * elements.len() {
            let sum: f64 = x.row(i).map(|(_, f)| f64::from(f)).sum::<f64>() + f64::from(x.escape(i));
            assert!((sum - 1.0).abs() < 1e-5, "{i}: {sum}");
            for (j, f) in x.row(i) {
                let back = x.row(j as usize).find(|b| b.0 == i as u32).map_or(0.0, |b| b.1);
                let (a, b) = (elements.list()[i / 2].area_mm2, elements.list()[j as usize / 2].area_mm2);
                assert!((a * f / (b * back) - 1.0).abs() < 1e-4, "{i} {j}");
            }
        }
    }

    #[test]
    fn factors_of_parallel_squares() {
        // Unit squares face to face at distance 1: F = 0.19982 (Howell, catalogue of configuration factors, C-11).
        let (elements, x) = exchange(
            "[shapes.a]\ntype = \"quad\"\nwidth_mm = 10\nheight_mm = 10\nmaterial = \"grey\"\n\
             [shapes.b]\ntype = \"quad\"\nwidth_mm = 10\nheight_mm = 10\nposition_mm = [0, 0, 10]\nmaterial = \"grey\"\n",
            200,
            256,
        );
        let (mut between, mut area) = (0.0, 0.0);
        for i in (0..2 * elements.len()).step_by(2) {
            let e = &elements.list()[i / 2];
            if e.shape == 0 {
                area += f64::from(e.area_mm2);
                between += x.row(i).map(|(_, f)| f64::from(f * e.area_mm2)).sum::<f64>();
                let back = x.row(i + 1).count();
                assert_eq!((back, x.escape(i + 1)), (0, 1.0));
            }
        }
        assert!((between / area - 0.19982).abs() < 1e-3, "{}", between / area);
    }
}

//! Which share of the light that leaves a node goes to which other one.
//!
//! Model: every node looks around, by rays with cosine-distributed directions from uniform points of it:
//!
//! ```text
//! F_ij = (rays of i that meet j) / rays,    escape_i = (those that meet nothing) / rays        the form factors' rows, which sum to one
//! A_i F_ij = A_j F_ji                       but for the noise of the rays
//! ```
//!
//! Nodes that happened to find each other would pass the same light to and fro, again and again, and too little of it would get out. So there are
//! `SETS` sets of rays, which do not know of each other, and light that comes back to a node goes on by another one. For the same reason a ray
//! from i is not taken as one from j. What is lost or made over all nodes, the solution corrects where light is least known ([`super::solve`]).
//!
//! Light runs linearly within an element ([`super::slopes`]), so each ray brings that of the place where it ends; the mean place o_ij of the
//! rays from i to j stands for them.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | F_ij | share of the light that falls on i that j sends; share of the light from i that falls on j: form factor | |
//! | A | area of a node | mm2 |
//! | o_ij | where the rays of i end on j | mm |
//!
//! Memory: 24 bytes per node and ray, at most. Guarded by `rows_sum_to_one`, `factors_are_reciprocal_on_average`,
//! `factors_of_parallel_squares`. Source: Malley's method, see Cohen and Wallace 1993, Radiosity and Realistic Image Synthesis, 4.8.

use glam::{UVec2, Vec2};
use rayon::prelude::*;

use super::elements::{Elements, node};
use super::facets::face_normal;
use super::slopes::Plane;
use crate::geometry::{Ray, Side};
use crate::math::Sampler;
use crate::scene::Scene;
use crate::transport::Progress;
use crate::{Error, Result};

/// Sets of rays. Light comes back after two steps, so two sets would not do.
pub(super) const SETS: usize = 3;
/// Marks the numbers of these rays among others of the seed.
const SEQUENCE: u32 = 0x5ad1_0517;
/// Nodes that one thread traces before it tells the progress.
const BATCH: usize = 64;

/// Places are kept up to this many times the reach of their element.
const FAR: f32 = 1.5;

/// Rays from one node to another.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Link {
    /// The node that they meet.
    pub(super) node: u32,
    /// Their share: form factor.
    pub(super) factor: f32,
    /// Where they end on it, [`Exchange::step_mm`] each.
    pub(super) place: [i16; 2],
}

/// Sparse form factors between the nodes.
#[derive(Debug)]
pub(super) struct Exchange {
    /// First link of each row, set by set of each node; one more at the end.
    rows: Vec<usize>,
    links: Vec<Link>,
    /// Of each row.
    escape: Vec<f32>,
    /// Variance of whether a ray of each node meets anything.
    doubt: Vec<f32>,
    /// What one is in the places of links to an element, mm.
    steps_mm: Vec<f32>,
    /// How far from the centre the lines of a node end at most, in these steps.
    farthest: Vec<f32>,
    rays: usize,
}

/// Bytes that the rays and factors of so many nodes take at most.
pub(super) fn bytes(nodes: u64, rays: u64) -> u64 {
    // What each node finds, and all of it together.
    2 * size_of::<Link>() as u64 * nodes * rays
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
        let total = (nodes * SETS) as u64;
        let done = std::sync::atomic::AtomicU64::new(0);
        let planes: Vec<Plane> = elements.list().iter().map(Plane::of).collect();
        let rays = rays.div_ceil(SETS as u32);
        let found: Vec<Vec<Link>> = (0..nodes * SETS)
            .into_par_iter()
            .with_min_len(BATCH)
            .map(|row| {
                if progress.cancelled() {
                    return Vec::new();
                }
                let (node, set) = ((row / SETS) as u32, (row % SETS) as u32);
                let links = trace_node(scene, elements, &planes, (node, set, seed), rays);
                let before = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                if before.is_multiple_of(BATCH as u64) {
                    progress.advance(before, total);
                }
                links
            })
            .collect();
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        progress.advance(total, total);
        let mut rows = Vec::with_capacity(nodes * SETS + 1);
        rows.push(0);
        let mut links = Vec::with_capacity(found.iter().map(Vec::len).sum());
        let mut escape = Vec::with_capacity(nodes * SETS);
        let mut farthest = vec![0.0f32; nodes];
        for own in found {
            for link in &own {
                let [x, y] = link.place.map(f32::from);
                let far = &mut farthest[link.node as usize];
                *far = far.max(x.hypot(y));
            }
            escape.push((1.0 - own.iter().map(|l| l.factor).sum::<f32>()).max(0.0));
            links.extend(own);
            rows.push(links.len());
        }
        let doubt = doubt(elements, &rows, &links, &escape);
        let steps_mm = planes.iter().map(|p| FAR * p.reach_mm / f32::from(i16::MAX)).collect();
        Ok(Self { rows, links, escape, doubt, steps_mm, farthest, rays: SETS * rays as usize })
    }

    /// Links of a node by one set of rays; their factors and what escapes sum to one.
    pub(super) fn row(&self, node: usize, set: usize) -> &[Link] {
        let row = node * SETS + set;
        &self.links[self.rows[row]..self.rows[row + 1]]
    }

    /// Links of a node by all rays; their factors and what escapes sum to `SETS`.
    pub(super) fn rows(&self, node: usize) -> &[Link] {
        &self.links[self.rows[node * SETS]..self.rows[(node + 1) * SETS]]
    }

    /// What one is in the places of links to a node, mm.
    pub(super) fn step_mm(&self, node: usize) -> f32 {
        self.steps_mm[node / 2]
    }

    /// How far from its centre the lines of a node end at most, in these steps.
    pub(super) fn farthest(&self, node: usize) -> f32 {
        self.farthest[node]
    }

    /// Share of the light from a node that meets nothing, by one set of rays.
    pub(super) fn escape(&self, node: usize, set: usize) -> f32 {
        self.escape[node * SETS + set]
    }

    /// Variance of whether a ray of a node meets anything: p (1 - p).
    pub(super) fn doubt(&self, node: usize) -> f32 {
        self.doubt[node]
    }

    /// How many rays tell the light of a node.
    pub(super) fn rays(&self) -> f32 {
        self.rays as f32
    }

    /// Number of links.
    pub(super) fn entries(&self) -> usize {
        self.links.len()
    }
}

/// p (1 - p) for the share p of the rays of each node that meet something. The few rays of a wide node say little of how often they meet
/// small ones, whose own rays know it well: both count, each by the balance heuristic, weights A_j / (A_i + A_j) for rays of i. None where
/// all rays of a node meet something.
fn doubt(elements: &Elements, rows: &[usize], links: &[Link], escape: &[f32]) -> Vec<f32> {
    let area = |node: usize| elements.list()[node / 2].area_mm2;
    let nodes = 2 * elements.len();
    let mut meets = vec![0.0f32; nodes];
    for i in 0..nodes {
        for link in &links[rows[i * SETS]..rows[(i + 1) * SETS]] {
            let j = link.node as usize;
            let (own, other) = (area(i), area(j));
            let share = link.factor / (SETS as f32 * (own + other).max(1e-30));
            meets[i] += share * other;
            meets[j] += share * own;
        }
    }
    let closed = |node: usize| escape[node * SETS..(node + 1) * SETS].iter().all(|e| *e < 1e-5);
    let of = |(node, p): (usize, &f32)| {
        if closed(node) { 0.0 } else { p.clamp(0.0, 1.0) * (1.0 - p.clamp(0.0, 1.0)) }
    };
    meets.iter().enumerate().map(of).collect()
}

/// What the rays of a node meet, by the number of the node that they meet.
fn trace_node(
    scene: &Scene,
    elements: &Elements,
    planes: &[Plane],
    (node, set, seed): (u32, u32, u64),
    rays: u32,
) -> Vec<Link> {
    let element = node / 2;
    let mut ends = Vec::with_capacity(rays as usize);
    for r in 0..rays {
        let mut s = Sampler::new(seed, UVec2::new(node, SEQUENCE + set), r);
        let u_facet = s.next_1d();
        let start = elements.sample(scene, element, u_facet, s.next_2d());
        let ray = start.ray(node % 2, s.next_2d());
        if let Some((to, t)) = node_hit(scene, elements, &ray) {
            let plane = &planes[to / 2];
            let reach = (FAR * plane.reach_mm).max(1e-30);
            ends.push((to as u32, plane.offset(ray.origin + ray.direction * t) / reach));
        }
    }
    ends.sort_by_key(|end| end.0);
    let link = |same: &[(u32, Vec2)]| {
        let mean = same.iter().map(|end| end.1).sum::<Vec2>() / same.len() as f32;
        // The conversion of a float ends at the bounds.
        let place = (mean * f32::from(i16::MAX)).to_array().map(|x| x.round() as i16);
        Link { node: same[0].0, factor: same.len() as f32 / rays as f32, place }
    };
    ends.chunk_by(|a, b| a.0 == b.0).map(link).collect()
}

/// The node that a ray meets first, and how far away.
pub(super) fn node_hit(scene: &Scene, elements: &Elements, ray: &Ray) -> Option<(usize, f32)> {
    let hit = scene.bvh.intersect(ray)?;
    let normal = face_normal(&scene.shapes[hit.shape as usize].mesh, hit.face as usize);
    let side = if normal.dot(ray.direction) < 0.0 { Side::Adaxial } else { Side::Abaxial };
    elements.at(hit.shape, hit.face, hit.b).map(|e| (node(e, side), hit.t))
}

#[cfg(test)]
mod tests {
    use super::super::facets::Facets;
    use super::super::testing::scene;
    use super::*;
    use crate::transport::NoProgress;

    const BALL_AND_FLOOR: &str = "[shapes.ball]\ntype = \"sphere\"\nradius_mm = 3\nsubdivisions = 3\nmaterial = \"grey\"\n\
         [shapes.floor]\ntype = \"quad\"\nwidth_mm = 400\nheight_mm = 90\nposition_mm = [0, 0, -4]\nmaterial = \"grey\"\n";

    fn exchange(text: &str, n: u32, rays: u32) -> (Elements, Exchange) {
        let s = scene(text);
        let elements = Elements::new(&s, Facets::new(&s, n), n);
        let x = Exchange::trace(&s, &elements, rays, 1, &NoProgress).unwrap();
        (elements, x)
    }

    #[test]
    fn rows_sum_to_one() {
        let (elements, x) = exchange(BALL_AND_FLOOR, 300, 64);
        for i in 0..2 * elements.len() {
            for set in 0..SETS {
                let sum: f32 = x.row(i, set).iter().map(|l| l.factor).sum::<f32>() + x.escape(i, set);
                assert!((sum - 1.0).abs() < 1e-5, "{i}: {sum}");
            }
        }
    }

    #[test]
    fn factors_are_reciprocal_on_average() {
        let (elements, x) = exchange(BALL_AND_FLOOR, 300, 3 * 2048);
        let area = |i: usize| f64::from(elements.list()[i / 2].area_mm2);
        let factor = |i: usize, j: u32| {
            x.rows(i).iter().filter(|l| l.node == j).map(|l| f64::from(l.factor)).sum::<f64>() / SETS as f64
        };
        let mut seen = 0;
        for i in 0..2 * elements.len() {
            for l in x.row(i, 0) {
                let j = l.node as usize;
                let (there, back) = (area(i) * factor(i, l.node), area(j) * factor(j, i as u32));
                // Each is a share of all rays, at most as noisy as if they were not stratified.
                let noise = (there.max(back) * (area(i) + area(j)) / f64::from(x.rays())).sqrt();
                assert!((there - back).abs() < 5.0 * noise, "{i} {j}: {there} {back} {noise}");
                seen += usize::from(there > 3.0 * noise);
            }
        }
        assert!(seen > 200, "{seen}");
    }

    #[test]
    fn factors_of_parallel_squares() {
        // Unit squares face to face at distance 1: F = 0.19982 (Howell, catalogue of configuration factors, C-11).
        let (elements, x) = exchange(
            "[shapes.a]\ntype = \"quad\"\nwidth_mm = 10\nheight_mm = 10\nmaterial = \"grey\"\n\
             [shapes.b]\ntype = \"quad\"\nwidth_mm = 10\nheight_mm = 10\nposition_mm = [0, 0, 10]\nmaterial = \"grey\"\n",
            200,
            6144,
        );
        let (mut between, mut area) = (0.0, 0.0);
        for i in (0..2 * elements.len()).step_by(2) {
            let e = &elements.list()[i / 2];
            if e.shape == 0 {
                area += f64::from(e.area_mm2);
                between +=
                    x.rows(i).iter().map(|l| f64::from(l.factor * e.area_mm2)).sum::<f64>() / SETS as f64;
                assert!(x.rows(i + 1).is_empty() && x.escape(i + 1, 1) == 1.0);
            }
        }
        assert!((between / area - 0.19982).abs() < 1e-3, "{}", between / area);
    }
}

//! How light runs within an element.
//!
//! Model: in the plane of an element the light is linear around its centre of area,
//!
//! ```text
//! E(p) = E_e + l_e g_e . (p - c_e)
//! g_e  = least squares over the neighbours n: sum w_n (E_n - E_e - g . (c_n - c_e))^2,   w = 1 / distance^2
//!      = sum over n of k_n (E_n - E_e)
//! l_e  = the largest factor up to one that keeps E within a range as far as the element reaches:
//!        that of its neighbours, or, where noise must not look like an extreme, of what is not negative
//! ```
//!
//! The mean over the element stays E_e, so no light is made or lost, and a linear course of light is met exactly. Neighbours lie
//! on the same piece of surface: light does not leak along a line where two sheets touch. Guarded by `linear_light_is_met`,
//! `light_stays_in_its_neighbours_range`. Source: limited linear reconstruction, Barth and Jespersen 1989, AIAA 89-0366.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::elements::{Element, Elements};
use crate::math::Frame;
use crate::spectrum::{LANES, SampledSpectrum};

/// The plane of an element, by which places in it are told.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    centre: Vec3,
    s: Vec3,
    t: Vec3,
    /// How far from its centre the element reaches, mm.
    pub(super) reach_mm: f32,
}

impl Plane {
    pub(super) fn of(e: &Element) -> Self {
        let frame = Frame::from_normal(e.normal);
        let reach_mm = e.radius_mm.max((e.area_mm2 / std::f32::consts::PI).sqrt());
        Self { centre: e.centre, s: frame.s, t: frame.t, reach_mm }
    }

    /// `p` relative to the centre, mm.
    pub(super) fn offset(&self, p: Vec3) -> Vec2 {
        let d = p - self.centre;
        Vec2::new(self.s.dot(d), self.t.dot(d))
    }
}

/// Within which range slopes keep the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Range {
    /// Of the neighbours: what is shown has no extremes that the elements have not.
    Neighbours,
    /// None.
    Free,
}

/// Planes of all elements, and what makes slopes of their neighbours' values: the k_n of each.
#[derive(Debug)]
pub(super) struct Stencils {
    planes: Vec<Plane>,
    /// First neighbour of each element; one more at the end.
    first: Vec<u32>,
    neighbours: Vec<(u32, Vec2)>,
}

/// Slopes of the light of every node, in the element's plane.
#[derive(Debug)]
pub(super) struct Slopes {
    /// Per node and chunk, along the two tangents, per mm.
    slopes: Vec<[SampledSpectrum; 2]>,
    chunks: usize,
}

impl Stencils {
    pub(super) fn new(elements: &Elements, neighbours: &[Vec<u32>]) -> Self {
        let list = elements.list();
        let planes: Vec<Plane> = list.iter().map(Plane::of).collect();
        let of: Vec<Vec<(u32, Vec2)>> = (0..list.len())
            .into_par_iter()
            .with_min_len(256)
            .map(|e| {
                let ways: Vec<Vec2> =
                    neighbours[e].iter().map(|n| planes[e].offset(list[*n as usize].centre)).collect();
                let weights = least_squares(&ways);
                neighbours[e].iter().copied().zip(weights).collect()
            })
            .collect();
        let mut first = vec![0];
        let mut flat = Vec::with_capacity(of.iter().map(Vec::len).sum());
        for own in of {
            flat.extend(own);
            first.push(flat.len() as u32);
        }
        Self { planes, first, neighbours: flat }
    }

    /// Slopes of `values`, `chunks` per node.
    pub(super) fn slopes(&self, values: &[SampledSpectrum], chunks: usize, range: Range) -> Slopes {
        let mut slopes = vec![[SampledSpectrum::ZERO; 2]; values.len()];
        slopes.par_chunks_mut(2 * chunks).with_min_len(256).enumerate().for_each(|(e, out)| {
            for (k, out) in out.iter_mut().enumerate() {
                *out = self.slope(e, k / chunks, k % chunks, values, chunks, range);
            }
        });
        Slopes { slopes, chunks }
    }

    fn slope(
        &self,
        e: usize,
        side: usize,
        chunk: usize,
        values: &[SampledSpectrum],
        chunks: usize,
        range: Range,
    ) -> [SampledSpectrum; 2] {
        let value = |e: usize| values[(2 * e + side) * chunks + chunk];
        let here = value(e);
        let (mut s, mut t) = (SampledSpectrum::ZERO, SampledSpectrum::ZERO);
        let (mut low, mut high) = (here, here);
        for (n, k) in &self.neighbours[self.first[e] as usize..self.first[e + 1] as usize] {
            let there = value(*n as usize);
            let rise = there - here;
            s += rise * k.x;
            t += rise * k.y;
            low = SampledSpectrum::from_fn(|l| low[l].min(there[l]));
            high = SampledSpectrum::from_fn(|l| high[l].max(there[l]));
        }
        for l in 0..LANES {
            let change = Vec2::new(s[l], t[l]).length() * self.planes[e].reach_mm;
            let room = match range {
                Range::Neighbours => (high[l] - here[l]).min(here[l] - low[l]),
                Range::Free => f32::INFINITY,
            };
            if change > room {
                let limit = if change > 0.0 { room / change } else { 0.0 };
                s.0[l] *= limit;
                t.0[l] *= limit;
            }
        }
        [s, t]
    }
}

impl Slopes {
    /// Slope of a node's light along the two tangents, per mm.
    pub(super) fn of(&self, node: usize, chunk: usize) -> [SampledSpectrum; 2] {
        self.slopes[node * self.chunks + chunk]
    }

    /// Value at `p` of a node whose own value is `value`; never negative.
    pub(super) fn at(
        &self,
        e: &Element,
        node: usize,
        chunk: usize,
        p: Vec3,
        value: SampledSpectrum,
    ) -> SampledSpectrum {
        let plane = Plane::of(e);
        // Beyond the element the slope is not known.
        let d = plane.offset(p).clamp_length_max(plane.reach_mm);
        let [s, t] = self.of(node, chunk);
        (value + s * d.x + t * d.y).map(|v| v.max(0.0))
    }
}

/// The weights k_n of neighbours that lie `ways` off; zero where they lie in one line and tell no slope across it.
fn least_squares(ways: &[Vec2]) -> Vec<Vec2> {
    let (mut xx, mut xy, mut yy) = (0.0f32, 0.0f32, 0.0f32);
    let weight = |d: &Vec2| 1.0 / d.length_squared().max(1e-20);
    for d in ways {
        xx += weight(d) * d.x * d.x;
        xy += weight(d) * d.x * d.y;
        yy += weight(d) * d.y * d.y;
    }
    let det = xx * yy - xy * xy;
    if det <= 1e-3 * (xx + yy) * (xx + yy) {
        return vec![Vec2::ZERO; ways.len()];
    }
    ways.iter().map(|d| Vec2::new(d.x * yy - d.y * xy, d.y * xx - d.x * xy) * (weight(d) / det)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::testing::floor;
    use super::*;

    #[test]
    fn linear_light_is_met() {
        let (elements, beside) = floor();
        let light = |p: Vec3| SampledSpectrum::from_fn(|l| 5.0 + 0.1 * l as f32 * p.x - 0.2 * p.y);
        let values: Vec<SampledSpectrum> =
            elements.list().iter().flat_map(|e| [light(e.centre), light(-e.centre)]).collect();
        let slopes = Stencils::new(&elements, &beside).slopes(&values, 1, Range::Neighbours);
        let mut seen = 0;
        for (k, e) in elements.list().iter().enumerate() {
            // At the rim the range of the neighbours ends before the element does.
            if e.centre.abs().max_element() > 4.0 {
                continue;
            }
            let p = e.centre + Vec3::new(0.1, 0.12, 0.0);
            let found = slopes.at(e, 2 * k, 0, p, values[2 * k]);
            let error = (found - light(p)).map(f32::abs).max();
            assert!(error < 2e-3, "{error}");
            let below = slopes.at(e, 2 * k + 1, 0, p, values[2 * k + 1]);
            assert!((below - light(-p)).map(f32::abs).max() < 2e-3);
            seen += 1;
        }
        assert!(seen > 50, "{seen}");
    }

    #[test]
    fn light_stays_in_its_neighbours_range() {
        let (elements, beside) = floor();
        // A shadow's edge.
        let values: Vec<SampledSpectrum> = elements
            .list()
            .iter()
            .flat_map(|e| [SampledSpectrum::splat(if e.centre.x > 0.3 { 3.0 } else { 0.0 }); 2])
            .collect();
        let slopes = Stencils::new(&elements, &beside).slopes(&values, 1, Range::Neighbours);
        for (k, e) in elements.list().iter().enumerate() {
            for f in elements.facets_of(k as u32) {
                assert!(elements.of_facet(*f) == k as u32);
            }
            for d in [Vec3::X, -Vec3::X, Vec3::Y, Vec3::new(0.5, 0.5, 0.0)] {
                let v = slopes.at(e, 2 * k, 0, e.centre + d * Plane::of(e).reach_mm, values[2 * k])[0];
                assert!((-1e-5..=3.0 + 1e-5).contains(&v), "{v}");
            }
        }
    }
}

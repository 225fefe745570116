//! Light between the middles of the elements.
//!
//! Model: within an element the light is linear around its centre of area,
//!
//! ```text
//! E(p) = E_e + l_e g_e . (p - c_e)
//! g_e  = least squares over the neighbours n: sum w_n (E_n - E_e - g . (c_n - c_e))^2,   w = 1 / distance^2
//! l_e  = the largest factor up to one that keeps E within the neighbours' range as far as the element reaches
//! ```
//!
//! in the element's plane. Before that, the noise of direct light and of the form factors is evened out by `STEPS` steps of diffusion
//! between neighbours, which keeps the sum of all light and leaves a linear course of it as it is. Light flows freely where two
//! elements differ no more than their noise explains, and hardly across an edge of a shadow:
//!
//! ```text
//! A_e dE_e = sum over n of w_en (E_n - E_e),   w_en = w_ne = min(A_e, A_n) / (2 max(their numbers of neighbours)) a_en
//! a_en = (v_e + v_n) / (v_e + v_n + (E_n - E_e)^2)        v: variance of an element's light
//! ```
//!
//! The mean over the element stays E_e, so no light is made or lost, and a linear course of light
//! is met exactly. Neighbours lie on the same piece of surface: light does not leak along a line
//! where two sheets touch. Guarded by `linear_light_is_met`, `light_stays_in_its_neighbours_range`,
//! `diffusion_keeps_the_light`, `edges_stay`. Source: limited
//! linear reconstruction, Barth and Jespersen 1989, AIAA 89-0366; diffusion that spares edges, Perona and Malik 1990.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::direct::DirectLight;
use super::elements::{Element, Elements};
use crate::math::Frame;
use crate::spectrum::{LANES, SampledSpectrum};

/// Steps of diffusion.
const STEPS: usize = 2;
/// Differences of two elements' light count as noise up to about this many times the variance of their difference.
const ALIKE: f32 = 1.0;

/// Slopes of the light of every node, in the element's plane.
#[derive(Debug)]
pub(super) struct Slopes {
    /// Per node and chunk, along the two tangents, per mm.
    slopes: Vec<[SampledSpectrum; 2]>,
    chunks: usize,
}

fn plane(e: &Element) -> Frame {
    Frame::from_normal(e.normal)
}

/// `p` relative to an element's centre, in its plane, mm.
fn offset(frame: &Frame, e: &Element, p: Vec3) -> Vec2 {
    let d = p - e.centre;
    Vec2::new(frame.s.dot(d), frame.t.dot(d))
}

/// What is evened out: a few kinds of light that flow together.
pub(super) trait Light: Copy + Send + Sync {
    /// What tells how much two elements differ.
    fn brightness(&self) -> f32;
    /// `self` with a share of the difference to `other`.
    fn towards(&self, sum: &mut Self, other: &Self, share: f32);
}

impl Light for SampledSpectrum {
    fn brightness(&self) -> f32 {
        self.mean()
    }
    fn towards(&self, sum: &mut Self, other: &Self, share: f32) {
        *sum += (*other - *self) * share;
    }
}

impl Light for DirectLight {
    fn brightness(&self) -> f32 {
        self.incident.mean()
    }
    fn towards(&self, sum: &mut Self, other: &Self, share: f32) {
        sum.incident += (other.incident - self.incident) * share;
        sum.reflected += (other.reflected - self.reflected) * share;
        sum.transmitted += (other.transmitted - self.transmitted) * share;
    }
}

/// Neighbours that have each other.
fn mutual(neighbours: &[Vec<u32>]) -> Vec<Vec<u32>> {
    let mut mutual: Vec<Vec<u32>> = neighbours.to_vec();
    for (e, beside) in neighbours.iter().enumerate() {
        for n in beside {
            if !neighbours[*n as usize].contains(&(e as u32)) {
                mutual[*n as usize].push(e as u32);
            }
        }
    }
    mutual
}

/// Light of every node after [`STEPS`] of diffusion. `variance` is that of each node's brightness.
pub(super) fn even_out<T: Light>(
    elements: &Elements,
    neighbours: &[Vec<u32>],
    mut values: Vec<T>,
    chunks: usize,
    variance: &[f32],
) -> Vec<T> {
    let list = elements.list();
    let mutual = mutual(neighbours);
    for _ in 0..STEPS {
        let bright: Vec<f32> =
            values.chunks(chunks).map(|v| v.iter().map(T::brightness).sum::<f32>() / chunks as f32).collect();
        let before = &values;
        let after: Vec<T> = (0..bright.len())
            .into_par_iter()
            .with_min_len(1024)
            .flat_map_iter(|node| {
                let (e, side) = (node / 2, node % 2);
                let mut own = before[node * chunks..(node + 1) * chunks].to_vec();
                for n in &mutual[e] {
                    let other = 2 * *n as usize + side;
                    let most = mutual[e].len().max(mutual[*n as usize].len()) as f32;
                    let noise = variance[node] + variance[other];
                    let far = (bright[node] - bright[other]).powi(2);
                    let alike = if far > 0.0 { ALIKE * noise / (ALIKE * noise + far) } else { 1.0 };
                    let share =
                        (list[*n as usize].area_mm2 / list[e].area_mm2).min(1.0) / (2.0 * most) * alike;
                    for (c, sum) in own.iter_mut().enumerate() {
                        before[node * chunks + c].towards(sum, &before[other * chunks + c], share);
                    }
                }
                own
            })
            .collect();
        values = after;
    }
    values
}

impl Slopes {
    /// Slopes of `values`, `chunks` per node.
    pub(super) fn new(
        elements: &Elements,
        neighbours: &[Vec<u32>],
        values: &[SampledSpectrum],
        chunks: usize,
    ) -> Self {
        let list = elements.list();
        let per_element: Vec<Vec<[SampledSpectrum; 2]>> = (0..list.len())
            .into_par_iter()
            .with_min_len(64)
            .map(|e| of_element(e, list, &neighbours[e], values, chunks))
            .collect();
        Self { slopes: per_element.into_iter().flatten().collect(), chunks }
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
        let mut d = offset(&plane(e), e, p);
        // Beyond the element the slope is not known.
        let reach = reach(e);
        if d.length() > reach {
            d *= reach / d.length();
        }
        let [s, t] = self.slopes[node * self.chunks + chunk];
        (value + s * d.x + t * d.y).map(|v| v.max(0.0))
    }
}

/// How far from its centre an element reaches, mm.
fn reach(e: &Element) -> f32 {
    e.radius_mm.max((e.area_mm2 / std::f32::consts::PI).sqrt())
}

fn of_element(
    e: usize,
    list: &[Element],
    neighbours: &[u32],
    values: &[SampledSpectrum],
    chunks: usize,
) -> Vec<[SampledSpectrum; 2]> {
    let own = &list[e];
    let frame = plane(own);
    let ways: Vec<Vec2> = neighbours.iter().map(|n| offset(&frame, own, list[*n as usize].centre)).collect();
    // The normal equations' matrix is the same for both sides and all wavelengths.
    let (mut xx, mut xy, mut yy) = (0.0f32, 0.0f32, 0.0f32);
    for d in &ways {
        let w = 1.0 / d.length_squared().max(1e-20);
        xx += w * d.x * d.x;
        xy += w * d.x * d.y;
        yy += w * d.y * d.y;
    }
    let det = xx * yy - xy * xy;
    // Neighbours in one line, or none, tell no slope across it.
    let solvable = det > 1e-3 * (xx + yy) * (xx + yy);
    let reach = reach(own);
    let mut out = Vec::with_capacity(2 * chunks);
    for i in 2 * e * chunks..2 * (e + 1) * chunks {
        let (side, chunk) = ((i / chunks) % 2, i % chunks);
        let here = values[i];
        if !solvable {
            out.push([SampledSpectrum::ZERO; 2]);
            continue;
        }
        let (mut bx, mut by) = (SampledSpectrum::ZERO, SampledSpectrum::ZERO);
        let (mut low, mut high) = (here, here);
        for (n, d) in neighbours.iter().zip(&ways) {
            let there = values[(2 * *n as usize + side) * chunks + chunk];
            let w = 1.0 / d.length_squared().max(1e-20);
            bx += (there - here) * (w * d.x);
            by += (there - here) * (w * d.y);
            low = SampledSpectrum::from_fn(|l| low[l].min(there[l]));
            high = SampledSpectrum::from_fn(|l| high[l].max(there[l]));
        }
        let (mut sx, mut sy) = ((bx * yy - by * xy) * (1.0 / det), (by * xx - bx * xy) * (1.0 / det));
        for l in 0..LANES {
            let change = Vec2::new(sx[l], sy[l]).length() * reach;
            let room = (high[l] - here[l]).min(here[l] - low[l]);
            if change > room {
                let limit = if change > 0.0 { room / change } else { 0.0 };
                sx.0[l] *= limit;
                sy.0[l] *= limit;
            }
        }
        out.push([sx, sy]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::facets::Facets;
    use super::super::neighbours::neighbours;
    use super::super::testing::scene;
    use super::*;

    fn floor() -> (Elements, Vec<Vec<u32>>) {
        let s = scene("[shapes.f]\ntype = \"quad\"\nwidth_mm = 10\nheight_mm = 10\nmaterial = \"grey\"\n");
        let elements = Elements::new(&s, Facets::new(&s, 200), 200);
        let beside = neighbours(&elements);
        (elements, beside)
    }

    #[test]
    fn linear_light_is_met() {
        let (elements, beside) = floor();
        let light = |p: Vec3| SampledSpectrum::from_fn(|l| 5.0 + 0.1 * l as f32 * p.x - 0.2 * p.y);
        let values: Vec<SampledSpectrum> =
            elements.list().iter().flat_map(|e| [light(e.centre), light(-e.centre)]).collect();
        let slopes = Slopes::new(&elements, &beside, &values, 1);
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
    fn diffusion_keeps_the_light() {
        let (elements, beside) = floor();
        let value = |k: usize| SampledSpectrum::splat(1.0 + ((k * 7919) % 13) as f32);
        let values: Vec<SampledSpectrum> = (0..2 * elements.len()).map(value).collect();
        let after = even_out(&elements, &beside, values.clone(), 1, &vec![1e6; values.len()]);
        let moments = |values: &[SampledSpectrum]| {
            let weigh = |f: &dyn Fn(f64) -> f64| {
                values
                    .iter()
                    .enumerate()
                    .map(|(n, v)| f(v[0].into()) * f64::from(elements.list()[n / 2].area_mm2))
                    .sum::<f64>()
            };
            (weigh(&|v| v), weigh(&|v| v * v))
        };
        let ((sum, squares), (sum_after, squares_after)) = (moments(&values), moments(&after));
        assert!((sum_after / sum - 1.0).abs() < 1e-5, "{sum} {sum_after}");
        assert!(squares_after < 0.85 * squares, "{squares} {squares_after}");
    }

    #[test]
    fn edges_stay() {
        let (elements, beside) = floor();
        let lit = |e: &Element| e.centre.x > 0.3;
        let value = |e: &Element| [SampledSpectrum::splat(if lit(e) { 3.0 } else { 1.0 }); 2];
        let values: Vec<SampledSpectrum> = elements.list().iter().flat_map(value).collect();
        // The mean change of light, where it is known to 1 % or hardly at all.
        let change = |variance: f32| {
            let after = even_out(&elements, &beside, values.clone(), 1, &vec![variance; values.len()]);
            after.iter().zip(&values).map(|(a, b)| (a[0] - b[0]).abs()).sum::<f32>() / values.len() as f32
        };
        let (sharp, soft) = (change(1e-4), change(1e4));
        assert!(sharp < 2e-3 && soft > 0.05, "{sharp} {soft}");
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
        let slopes = Slopes::new(&elements, &beside, &values, 1);
        for (k, e) in elements.list().iter().enumerate() {
            for f in elements.facets_of(k as u32) {
                assert!(elements.of_facet(*f) == k as u32);
            }
            for d in [Vec3::X, -Vec3::X, Vec3::Y, Vec3::new(0.5, 0.5, 0.0)] {
                let v = slopes.at(e, 2 * k, 0, e.centre + d * reach(e), values[2 * k])[0];
                assert!((-1e-5..=3.0 + 1e-5).contains(&v), "{v}");
            }
        }
    }
}

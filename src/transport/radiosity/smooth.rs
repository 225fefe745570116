//! What is left of the noise of direct light and of the form factors, evened out.
//!
//! Model: `STEPS` steps of diffusion between neighbours, which keep the sum of all light and leave a linear course of it as it is.
//! Light flows freely where two elements differ no more than their noise explains, and hardly across an edge of a shadow:
//!
//! ```text
//! A_e dE_e = sum over n of w_en (E_n - E_e),   w_en = w_ne = min(A_e, A_n) / (2 max(their numbers of neighbours)) a_en
//! a_en = (v_e + v_n) / (v_e + v_n + (E_n - E_e)^2)        v: variance of an element's light
//! ```
//!
//! Neighbours lie on the same piece of surface: light does not leak along a line where two sheets touch. Guarded by
//! `diffusion_keeps_the_light`, `edges_stay`. Source: diffusion that spares edges, Perona and Malik 1990.

use rayon::prelude::*;

use super::direct::DirectLight;
use super::elements::Elements;
use crate::spectrum::SampledSpectrum;

/// Steps of diffusion.
const STEPS: usize = 2;
/// Differences of two elements' light count as noise up to about this many times the variance of their difference.
const ALIKE: f32 = 1.0;

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

#[cfg(test)]
mod tests {
    use super::super::elements::Element;
    use super::super::testing::floor;
    use super::*;

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
}

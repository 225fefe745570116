//! Numbers at the nodes, with their noise.
//!
//! A table holds W numbers per pair of directions and, relative, the standard errors of two kinds of light made of them:
//! Lambertian, and with a lobe at each rung of the exponents. The errors come from the scatter of the replicates.
//!
//! The light of order one grows towards grazing retro-reflection as 1 / cos(theta_max), so its table holds f_E cos;
//! later orders stay finite and are held as they are.

use glam::DVec3;

use super::angles::AngleNodes;
use super::polynomial::{EXPONENTS, FIRST, Factors, LATER, cubic_form, exponent};
use super::walk::{PER_ORDER, Sums, View};

/// Errors per pair: of Lambertian light, and of the lobe's at each rung.
pub(super) const ERRORS: usize = 1 + EXPONENTS;

/// Numbers of one part of the light.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Table<const W: usize> {
    pub(super) nodes: AngleNodes,
    /// W per pair.
    pub(super) numbers: Vec<f32>,
    /// [`ERRORS`] per pair.
    pub(super) errors: Vec<f32>,
}

impl<const W: usize> Table<W> {
    pub(super) fn new(nodes: AngleNodes) -> Self {
        let pairs = nodes.pairs();
        Self { nodes, numbers: Vec::with_capacity(pairs * W), errors: Vec::with_capacity(pairs * ERRORS) }
    }

    /// Adds the pairs of one viewing angle.
    pub(super) fn push(
        &mut self,
        view: &View,
        replicates: &[Sums],
        light: impl Fn(&[f64; W]) -> [f64; ERRORS],
    ) {
        let (n, tail) = (replicates.len() as f64, tail(replicates));
        for lamp in 0..view.lamps.len() * view.azimuths.len() {
            let scale = if W == FIRST { view.theta.cos() } else { 1.0 };
            let mean = mean::<W>(replicates, lamp, scale);
            self.numbers.extend(mean.iter().map(|&v| v as f32));
            let values: Vec<[f64; ERRORS]> =
                replicates.iter().map(|r| light(&part(r, lamp, scale, tail))).collect();
            for k in 0..ERRORS {
                let mean = values.iter().map(|v| v[k]).sum::<f64>() / n;
                let square = values.iter().map(|v| (v[k] - mean).powi(2)).sum::<f64>() / (n * (n - 1.0));
                self.errors.push(if mean != 0.0 { (square.sqrt() / mean.abs()) as f32 } else { 0.0 });
            }
        }
    }

    /// Adds the numbers of a pair of directions times `weight`.
    pub(super) fn add(&self, wi: DVec3, wo: DVec3, weight: f64, to: &mut [f64; W]) {
        let stencil = self.nodes.stencil(wi, wo);
        for (index, w) in stencil.nodes {
            let w = if W == FIRST { w * weight / stencil.cos_max } else { w * weight };
            let node = &self.numbers[index * W..][..W];
            to.iter_mut().zip(node).for_each(|(n, &v)| *n += w * f64::from(v));
        }
    }

    /// Relative errors at a pair of directions.
    pub(super) fn errors(&self, wi: DVec3, wo: DVec3) -> [f64; ERRORS] {
        let mut out = [0.0; ERRORS];
        for (index, w) in self.nodes.stencil(wi, wo).nodes {
            let node = &self.errors[index * ERRORS..][..ERRORS];
            out.iter_mut().zip(node).for_each(|(n, &v)| *n += w.abs() * f64::from(v));
        }
        out
    }
}

/// f_E at kd = 0.5, and at ks = 0.5 for each rung.
pub(super) fn references(factors: &Factors) -> [f64; ERRORS] {
    std::array::from_fn(|k| match k {
        0 => factors.eval(0.5, 0.0, 1.0).f,
        k => factors.eval(0.0, 0.5, exponent(k - 1)).f,
    })
}

/// Share of the lobe at which the noise of the later orders is kept.
pub(super) const NOISE_SHARE: f64 = 0.3;

/// Light of the later orders at kd = 0.5, and at a mixture with each rung.
pub(super) fn later_references(factors: &Factors) -> [f64; ERRORS] {
    std::array::from_fn(|k| match k {
        0 => factors.eval(0.5, 0.0, 1.0).f,
        k => factors.eval(0.5 * (1.0 - NOISE_SHARE), 0.5 * NOISE_SHARE, exponent(k - 1)).f,
    })
}

/// Light of order five and more, over that of order five alone, between Lambertian domes.
pub(super) fn tail(replicates: &[Sums]) -> f64 {
    let [five, all] = replicates.iter().fold([0.0, 0.0], |a, s| [a[0] + s.tail[0], a[1] + s.tail[1]]);
    if five > 0.0 { all / five } else { 1.0 }
}

/// Mean of the replicates at one lamp of a view.
pub(super) fn mean<const W: usize>(replicates: &[Sums], lamp: usize, scale: f64) -> [f64; W] {
    let mut mean = [0.0; W];
    let tail = tail(replicates);
    for r in replicates {
        let part: [f64; W] = part(r, lamp, scale, tail);
        mean.iter_mut().zip(part).for_each(|(m, p)| *m += p / replicates.len() as f64);
    }
    mean
}

/// A walk's sums at one lamp, times `scale`, as the table's numbers. With lobes, orders beyond five are to order five as
/// without.
fn part<const W: usize>(sums: &Sums, lamp: usize, scale: f64, tail: f64) -> [f64; W] {
    let mut out = [0.0; W];
    let sums = sums.at(lamp);
    if W == FIRST {
        out.iter_mut().zip(sums).for_each(|(o, &s)| *o = f64::from(s) * scale);
        return out;
    }
    debug_assert_eq!(W, LATER);
    for (m, o) in out[..4].iter_mut().enumerate() {
        *o = f64::from(sums[m * PER_ORDER]) * scale;
    }
    // Of the mixed walks: the share zero, then the others.
    let order = |m: usize, share: usize, k: usize| {
        let at = m * PER_ORDER + 1 + if share == 0 { 0 } else { 1 + (share - 1) * EXPONENTS + k };
        f64::from(sums[at]) * scale * if m == 3 { tail } else { 1.0 }
    };
    for k in 0..EXPONENTS {
        let mut set = |f: usize, v: f64| out[4 + f * EXPONENTS + k] = v;
        let [dd, half, ss] = [0, 2, 3].map(|share| order(0, share, k));
        set(0, 4.0 * half - dd - ss);
        set(1, ss);
        for m in 1..4 {
            let form = cubic_form(std::array::from_fn(|share| order(m, share, k)));
            for (j, &factor) in form.iter().enumerate().skip(1) {
                set(3 * m - 2 + j, factor);
            }
        }
    }
    out
}

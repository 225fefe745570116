//! Reflected light over a range of the spongy layer's scattering.
//!
//! Model: [`ReflectedPaths`] at values of the scattering coefficient s that are equally far apart in ln s, all from the same
//! random numbers; between them R is a cubic in ln s with the slopes of the neighbours' chords (Catmull-Rom; at the ends
//! that of the one chord).
//! Guarded by `between_the_nodes_the_toy_is_followed`. Source: Catmull and Rom 1974, "A class of local interpolating splines".

use super::paths::{ReflectedPaths, Setup};
use crate::micro::{REGIONS, WhiteScatter};
use crate::{Error, Result};

/// Values of the scattering coefficient at which light is followed.
pub(crate) const NODES: usize = 8;

/// R and its derivatives.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Reflectance {
    pub(crate) value: f64,
    pub(crate) by_ln_scattering: f64,
    pub(crate) by_absorption: [f64; REGIONS],
}

/// Paths at several scattering coefficients.
pub(crate) struct PathFamily {
    first_ln: f64,
    step_ln: f64,
    nodes: Vec<ReflectedPaths>,
}

impl PathFamily {
    /// Follows light through what `scatter` makes of each scattering coefficient (1/mm) of `low..=high`.
    pub(crate) fn new(
        (low, high): (f64, f64),
        mut scatter: impl FnMut(f64) -> Result<Box<dyn WhiteScatter>>,
        setup: Setup,
        walks: u32,
        seed: u64,
        step: &dyn Fn(u64, u64) -> std::ops::ControlFlow<()>,
    ) -> Result<Self> {
        let first_ln = low.ln();
        let step_ln = (high / low).ln() / (NODES - 1) as f64;
        let mut nodes = Vec::with_capacity(NODES);
        for i in 0..NODES {
            let per_mm = (first_ln + step_ln * i as f64).exp();
            nodes.push(ReflectedPaths::collect(&*scatter(per_mm)?, setup, walks, seed));
            if step(i as u64 + 1, NODES as u64).is_break() {
                return Err(Error::Cancelled);
            }
        }
        Ok(Self { first_ln, step_ln, nodes })
    }

    /// The same in about `classes` classes per node or less: for searches that are continued with all of them.
    pub(crate) fn coarse(&self, classes: usize) -> Self {
        Self { nodes: self.nodes.iter().map(|n| n.coarse(classes)).collect(), ..*self }
    }

    /// Largest share of walks that were cut off.
    pub(crate) fn cut_off(&self) -> f64 {
        self.nodes.iter().map(|n| n.cut_off).fold(0.0, f64::max)
    }

    /// R at a scattering coefficient and absorption coefficients of the regions.
    pub(crate) fn reflectance(&self, ln_scattering: f64, absorption_per_um: &[f64; REGIONS]) -> Reflectance {
        let last = NODES - 2;
        let x = ((ln_scattering - self.first_ln) / self.step_ln).clamp(0.0, (NODES - 1) as f64);
        let i = (x as usize).min(last);
        let t = x - i as f64;
        // Weights of the two ends' values and slopes, and their derivatives by t.
        let (t2, t3) = (t * t, t * t * t);
        let hermite = [2.0 * t3 - 3.0 * t2 + 1.0, 3.0 * t2 - 2.0 * t3, t3 - 2.0 * t2 + t, t3 - t2];
        let slope = [6.0 * t2 - 6.0 * t, 6.0 * t - 6.0 * t2, 3.0 * t2 - 4.0 * t + 1.0, 3.0 * t2 - 2.0 * t];
        // The same for the values at nodes i - 1 to i + 2.
        let of_nodes = |[a, b, da, db]: [f64; 4]| {
            let mut w = [0.0, a, b, 0.0];
            if i > 0 {
                (w[0], w[2]) = (w[0] - 0.5 * da, w[2] + 0.5 * da);
            } else {
                (w[1], w[2]) = (w[1] - da, w[2] + da);
            }
            if i < last {
                (w[1], w[3]) = (w[1] - 0.5 * db, w[3] + 0.5 * db);
            } else {
                (w[1], w[2]) = (w[1] - db, w[2] + db);
            }
            w
        };
        let (weights, slopes) = (of_nodes(hermite), of_nodes(slope));
        let mut sum = Reflectance::default();
        for (k, (w, d)) in weights.iter().zip(slopes).enumerate() {
            if *w == 0.0 && d == 0.0 {
                continue;
            }
            let Some(node) = (i + k).checked_sub(1).and_then(|n| self.nodes.get(n)) else { continue };
            let (r, by) = node.reflectance(absorption_per_um);
            sum.value += w * r;
            sum.by_ln_scattering += d * r / self.step_ln;
            sum.by_absorption.iter_mut().zip(by).for_each(|(s, b)| *s += w * b);
        }
        sum
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::fit::spectrum::paths::tests::Toy;

    pub(crate) fn family(walks: u32) -> PathFamily {
        let make = |s| Ok(Box::new(Toy { scattering_per_mm: s }) as Box<dyn WhiteScatter>);
        PathFamily::new((2.0, 512.0), make, Setup::default(), walks, 7, &|_, _| ControlFlow::Continue(()))
            .expect("a toy")
    }

    #[test]
    fn between_the_nodes_the_toy_is_followed() {
        let family = family(20_000);
        for s in [2.0f64, 2.5, 7.0, 31.0, 100.0, 444.0, 512.0] {
            let own = ReflectedPaths::collect(&Toy { scattering_per_mm: s }, Setup::default(), 20_000, 7);
            for mu in [[0.0; 4], [0.03, 0.0, 0.004, 0.0]] {
                let r = family.reflectance(s.ln(), &mu);
                let exact = own.reflectance(&mu).0;
                assert!((r.value - exact).abs() < 0.006, "{s} {mu:?}: {} {exact}", r.value);
                let at = |d: f64| family.reflectance(s.ln() + d, &mu).value;
                if s > 2.0 && s < 512.0 {
                    let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
                    assert!((difference - r.by_ln_scattering).abs() < 1e-5, "{s}");
                }
            }
        }
    }
}

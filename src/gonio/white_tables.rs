//! From counts of walks to tables that are reciprocal and keep the energy.
//!
//! Model: of N walks from each polar bin (cosine-weighted within it, all azimuths), C_ab left to bin b, phi. The flux
//! F_ab = integral over both bins of f cos cos = P_a C_ab / N, P the bins' projected solid angle, is the same both ways, so
//! the best estimate from both counts (Poisson: variance proportional to P_a F) is
//!
//! ```text
//! F_ab = (C_ab + C_ba) / (N / P_a + N / P_b),     f_ab = F_ab phis / (P_a P_b) = phis (C_ab + C_ba) / (N (P_a + P_b))
//! ```
//!
//! The function that is read between the nodes has slightly other integrals. Factors s >= 0, one per side and polar
//! node, correct them and keep the symmetry: f'_ab = s_a f_ab s_b with
//!
//! ```text
//! s_a sum over b of M_b K_ab s_b = t_a,   K_ab = sum over phi and classes of W f_ab
//! ```
//!
//! t_a the measured share of the walks from a that left (Sinkhorn's iteration for a symmetric matrix). At the end a factor
//! whose total would still be above t_a is made smaller, which only lowers the others' totals: energy is never
//! gained.
//!
//! | symbol | in code |
//! |---|---|
//! | P | [`AngleGrid::bin_measure`] |
//! | M, W | [`AngleGrid::theta_measures`], [`AngleGrid::phi_measure`] |
//! | s | [`balance`] |
//!
//! Limits: where all light goes through, the totals of the two sides must agree, so those of one end below the measured
//! ones by the noise (`balanced_totals_are_met_and_never_exceeded`). Source: our reading; Sinkhorn, Knopp 1967.

use super::white_counts::ExitBins;
use super::{AngleGrid, AngularTable, Part};

/// Passes of the iteration; each halves the error at least.
const PASSES: usize = 200;
/// Totals stay below the measured ones by this share, so that rounding to f32 does not lift them above.
const ROOM: f64 = 1e-6;

/// Counts of one kind of exits: `counts[side * thetas + a]` are those of the walks from polar bin `a`.
#[derive(Debug)]
pub(super) struct Flux<'a> {
    pub(super) bins: ExitBins,
    pub(super) counts: Vec<&'a [u32]>,
    /// N.
    pub(super) walks: f64,
}

impl Flux<'_> {
    fn grid(&self) -> AngleGrid {
        self.bins.grid
    }

    /// Share of the walks from polar bin `a` of a side (0 adaxial, 1 abaxial) that left as told by `through`.
    pub(super) fn share(&self, side: usize, a: usize, through: bool) -> f64 {
        let first = self.bins.first(through, 0, 0);
        let counts = &self.counts[side * self.grid().thetas + a][first..first + self.bins.len() / 2];
        counts.iter().map(|c| f64::from(*c)).sum::<f64>() / self.walks
    }

    /// f, the same both ways.
    pub(super) fn reciprocal(&self) -> AngularTable {
        let grid = self.grid();
        let mut table = AngularTable::zeros(grid, self.bins.classes);
        for (part, from, through) in
            [(Part::Adaxial, 0, false), (Part::Abaxial, 1, false), (Part::Through, 0, true)]
        {
            // The way back starts on the side where the way there ends.
            let back = if through { 1 } else { from };
            for a in 0..grid.thetas {
                for b in 0..grid.thetas {
                    let measure = grid.bin_measure(a) + grid.bin_measure(b);
                    let per_walk = grid.phis as f64 / (self.walks * measure);
                    let (there, reverse) =
                        (self.counts[from * grid.thetas + a], self.counts[back * grid.thetas + b]);
                    for phi in 0..grid.phis {
                        let (i, j) = (self.bins.first(through, b, phi), self.bins.first(through, a, phi));
                        let offset = table.offset(part, a, b, phi);
                        for k in 0..self.bins.classes {
                            let count = f64::from(there[i + k]) + f64::from(reverse[j + k]);
                            table.values[offset + k] = (count * per_walk) as f32;
                        }
                    }
                }
            }
        }
        table
    }

    /// Share that leaves from each polar bin of each side by a table's values, each held over its bin.
    pub(super) fn shares_of(&self, table: &AngularTable) -> Vec<f64> {
        let grid = self.grid();
        rows(table, |b| grid.bin_measure(b) / (2.0 * std::f64::consts::PI))
            .iter()
            .map(|row| row.iter().sum())
            .collect()
    }
}

/// Matrix over the directions of both sides, adaxial first: K_ab times `measure` of b.
fn rows(table: &AngularTable, measure: impl Fn(usize) -> f64) -> Vec<Vec<f64>> {
    let AngleGrid { thetas, phis } = table.grid;
    let phi_measure = table.grid.phi_measure();
    let sum = |part, a, b| {
        (0..phis).flat_map(|p| table.bin(part, a, b, p)).map(|v| f64::from(*v)).sum::<f64>() * phi_measure
    };
    (0..2 * thetas)
        .map(|i| {
            (0..2 * thetas)
                .map(|j| {
                    let (a, b) = (i % thetas, j % thetas);
                    let value = match (i < thetas, j < thetas) {
                        (true, true) => sum(Part::Adaxial, a, b),
                        (false, false) => sum(Part::Abaxial, a, b),
                        (true, false) => sum(Part::Through, a, b),
                        (false, true) => sum(Part::Through, b, a),
                    };
                    value * measure(b)
                })
                .collect()
        })
        .collect()
}

/// Scales a reciprocal table so that the integrals of the values read between the nodes are `totals`, one per polar node
/// of the adaxial, then of the abaxial side.
pub(super) fn balance(table: &mut AngularTable, totals: &[f64]) {
    let AngleGrid { thetas, phis } = table.grid;
    let measures = table.grid.theta_measures();
    let matrix = rows(table, |b| measures[b]);
    let total = |s: &[f64], i: usize| s[i] * matrix[i].iter().zip(s).map(|(k, s)| k * s).sum::<f64>();
    let mut s: Vec<f64> = totals.iter().map(|t| if *t > 0.0 { 1.0 } else { 0.0 }).collect();
    for _ in 0..PASSES {
        let now: Vec<f64> = (0..2 * thetas).map(|i| total(&s, i)).collect();
        for (i, (s, now)) in s.iter_mut().zip(now).enumerate() {
            if now > 0.0 {
                *s *= (totals[i] / now).sqrt();
            }
        }
    }
    let excess: Vec<f64> = (0..2 * thetas).map(|i| total(&s, i) / (totals[i] * (1.0 - ROOM))).collect();
    s.iter_mut().zip(excess).filter(|(_, e)| *e > 1.0).for_each(|(s, e)| *s /= e);
    for (part, first, second) in
        [(Part::Adaxial, 0, 0), (Part::Abaxial, thetas, thetas), (Part::Through, 0, thetas)]
    {
        for a in 0..thetas {
            for b in 0..thetas {
                // One product for both orders: the table stays exactly symmetric.
                let factor = (s[first + a] * s[second + b]) as f32;
                let start = table.offset(part, a, b, 0);
                table.values[start..start + phis * table.classes].iter_mut().for_each(|v| *v *= factor);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::hash;

    const GRID: AngleGrid = AngleGrid { thetas: 6, phis: 3 };

    /// Counts of N = 1000 walks per bin, at random or zero in one of the two ways out.
    fn counts(keep: impl Fn(bool) -> bool) -> (ExitBins, Vec<Vec<u32>>) {
        let bins = ExitBins { grid: GRID, classes: 2 };
        let counts = (0..12)
            .map(|family: u32| {
                (0..bins.len() as u32)
                    .map(|i| {
                        let through = i as usize >= bins.len() / 2;
                        if keep(through) { hash(family * 7919 + i) % 20 } else { 0 }
                    })
                    .collect()
            })
            .collect();
        (bins, counts)
    }

    fn interpolated_totals(t: &AngularTable) -> Vec<f64> {
        let total = |side: usize, a| {
            let own = if side == 0 { Part::Adaxial } else { Part::Abaxial };
            let sum = |v: Vec<f64>| v.iter().sum::<f64>();
            sum(t.projected(own, a, true)) + sum(t.projected(Part::Through, a, side == 0))
        };
        (0..12).map(|i| total(i / 6, i % 6)).collect()
    }

    #[test]
    fn balanced_totals_are_met_and_never_exceeded() {
        for (keep_through, keep_back) in [(true, true), (false, true), (true, false)] {
            let (bins, counts) = counts(|through| if through { keep_through } else { keep_back });
            let flux = Flux { bins, counts: counts.iter().map(Vec::as_slice).collect(), walks: 1000.0 };
            let mut table = flux.reciprocal();
            let totals: Vec<f64> =
                (0..12).map(|i| flux.share(i / 6, i % 6, false) + flux.share(i / 6, i % 6, true)).collect();
            balance(&mut table, &totals);
            let got = interpolated_totals(&table);
            for (got, wanted) in got.iter().zip(&totals) {
                assert!(*got <= *wanted, "{got} {wanted}");
                // Where all goes through, the sides' totals need not agree, and the smaller one wins.
                let tolerance = if keep_back { 1e-4 } else { 0.1 };
                assert!(*got >= wanted * (1.0 - tolerance), "{keep_through} {keep_back} {got} {wanted}");
            }
            for part in [Part::Adaxial, Part::Abaxial] {
                for (a, b, p) in [(0, 5, 1), (3, 2, 0), (4, 1, 2)] {
                    assert_eq!(table.bin(part, a, b, p), table.bin(part, b, a, p));
                }
            }
        }
    }

    #[test]
    fn a_lambertian_sheet_is_flat() {
        // Expected counts of a sheet that sends back 0.3 (adaxial), 0.5 (abaxial) and lets 0.4 through, rounded.
        let bins = ExitBins { grid: GRID, classes: 1 };
        let walks = 1e8;
        let counts: Vec<Vec<u32>> = (0..12)
            .map(|family| {
                let mut c = vec![0; bins.len()];
                for b in 0..6 {
                    let share = GRID.bin_measure(b) / std::f64::consts::PI / 3.0;
                    for phi in 0..3 {
                        let back = if family < 6 { 0.3 } else { 0.5 };
                        c[bins.first(false, b, phi)] = (walks * share * back) as u32;
                        c[bins.first(true, b, phi)] = (walks * share * 0.4) as u32;
                    }
                }
                c
            })
            .collect();
        let flux = Flux { bins, counts: counts.iter().map(Vec::as_slice).collect(), walks };
        let mut table = flux.reciprocal();
        let shares = flux.shares_of(&table);
        assert!((shares[2] - 0.7).abs() < 1e-5 && (shares[8] - 0.9).abs() < 1e-5, "{shares:?}");
        let totals: Vec<f64> = (0..12).map(|i| if i < 6 { 0.7 } else { 0.9 }).collect();
        balance(&mut table, &totals);
        for (part, value) in [(Part::Adaxial, 0.3), (Part::Abaxial, 0.5), (Part::Through, 0.4)] {
            for (a, b, p) in [(0, 0, 0), (5, 5, 2), (3, 1, 1)] {
                let f = table.bin(part, a, b, p)[0];
                assert!((f - value / std::f32::consts::PI).abs() < 1e-4 * value, "{part:?} {f}");
            }
        }
    }
}

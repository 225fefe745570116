//! A BSDF averaged over pairs of patches, with its hemispherical totals kept.
//!
//! Model: M = mean of f(wi, wo) over the incident and the exitant patch, both by projected solid angle; then each incident
//! patch's values are multiplied by one factor, so that their sum with the patches' projected solid angles is the source's own
//! hemispherical total, averaged over the incident patch.
//!
//! | symbol | here | unit | default |
//! |---|---|---|---|
//! | points per patch and direction | `COARSE`, `FINE`, `PEAK` | - | 2, 3, 5 |
//! | points of a total | `TOTAL_RULES` | - | 96 x 192; where each azimuth has its own, 48 x 96 |
//!
//! Means are by Gauss rules of 2 points each way; where 3 points say something else, and around the mirror's, the lamp's and
//! the straight direction, by 5. Limits: a peak narrower than a fifth of a patch (1 to 3 degrees) can be put unevenly, but its
//! energy stays (`totals_are_the_sources`); the values are as reciprocal as the source's quadrature is. Our reading.

use std::f64::consts::PI;

use glam::DVec3;
use rayon::prelude::*;

use super::klems::AngleBasis;
use super::tensor_tree::{TensorTree, disk_from_square};
use super::window_xml::Part;
use crate::geometry::Side;
use crate::gonio::{Directional, directional_hemispherical};
use crate::math::quadrature::GaussLegendre;

/// Points each way of the two rules that are compared, and of the one for peaks.
const COARSE: usize = 2;
const FINE: usize = 3;
const PEAK: usize = 5;
/// Difference of the two rules that asks for the third, as a share of the value or of the patch's mean exitant light.
const AGREE: f64 = 2e-3;
/// Around the directions that peaks have, degrees.
const PEAK_ANGLE_DEG: f64 = 20.0;

/// Polar and azimuth points of the hemispherical totals where there are few of them, and where there are many.
const TOTAL_RULES: [(usize, usize); 2] = [(96, 192), (48, 96)];

/// Averages, and what happened on the way.
pub(super) struct Averaged<T> {
    /// One per band.
    pub(super) bands: Vec<T>,
    /// Largest hemispherical total.
    pub(super) largest_total: f64,
    /// Share of the asked directions for which the source had no value.
    pub(super) unknown: f64,
}

/// Counts of what was asked and of what was not known.
#[derive(Clone, Copy, Default)]
struct Asked {
    all: u64,
    unknown: u64,
}

/// Adds weight times f to `sum`.
fn add(
    source: &dyn Directional,
    (wi, wo): (DVec3, DVec3),
    weight: f64,
    scratch: &mut [f64],
    sum: &mut [f64],
    asked: &mut Asked,
) {
    asked.all += 1;
    if source.bsdf(wi, wo, scratch) {
        sum.iter_mut().zip(&*scratch).for_each(|(s, v)| *s += weight * v);
    } else {
        asked.unknown += 1;
    }
}

/// The direction of light that travels along the projection of `w`, coming from the side of `sign`.
fn incident(w: DVec3, sign: f64) -> DVec3 {
    DVec3::new(-w.x, -w.y, sign * w.z)
}

fn side(sign: f64) -> Side {
    if sign > 0.0 { Side::Adaxial } else { Side::Abaxial }
}

/// Multiplies the values of one incident patch; `areas` add up to pi.
fn rescale(values: &mut [Vec<f64>], totals: &[f64], areas: impl Fn(usize) -> f64) {
    for (k, total) in totals.iter().enumerate() {
        let sum: f64 = values.iter().enumerate().map(|(p, v)| areas(p) * v[k]).sum();
        if sum > 0.0 {
            values.iter_mut().for_each(|v| v[k] *= total / sum);
        }
    }
}

/// Values of one incident patch: per exitant patch one per band.
struct Slice {
    values: Vec<Vec<f64>>,
    totals: Vec<f64>,
    asked: Asked,
}

fn gather<T>(slices: &[Slice], bands: usize, make: impl Fn(usize) -> T) -> Averaged<T> {
    let sum = |f: fn(&Asked) -> u64| slices.iter().map(|s| f(&s.asked)).sum::<u64>() as f64;
    Averaged {
        bands: (0..bands).map(make).collect(),
        largest_total: slices.iter().flat_map(|s| &s.totals).fold(0.0, |m, t| m.max(*t)),
        unknown: sum(|a| a.unknown) / sum(|a| a.all).max(1.0),
    }
}

/// Mean totals of light from weighted directions.
fn totals(source: &dyn Directional, lamps: &[(DVec3, f64)], exit: Side, few: bool) -> Vec<f64> {
    let rule = TOTAL_RULES[usize::from(!few)];
    let mut totals = vec![0.0; source.bands().len()];
    for &(wi, weight) in lamps {
        let own = directional_hemispherical(source, wi, exit, rule);
        totals.iter_mut().zip(own).for_each(|(t, o)| *t += weight * o);
    }
    totals
}

/// A part on a Klems basis: per band, row by row of the exitant patches.
pub(super) fn klems(source: &dyn Directional, part: Part, basis: &AngleBasis) -> Averaged<Vec<f32>> {
    let (n, bands) = (basis.len(), source.bands().len());
    let (sign_i, sign_o) = part.signs();
    let rules = [COARSE, FINE, PEAK].map(|k| (0..n).map(|p| basis.nodes(p, k)).collect::<Vec<_>>());
    let own_totals = |column: usize| {
        let lamps: Vec<_> =
            rules[0][column].iter().map(|&(w, weight)| (incident(w, sign_i), weight)).collect();
        totals(source, &lamps, side(sign_o), source.is_isotropic())
    };
    // Equal along a ring where the azimuth does not matter.
    let ring_totals: Vec<Vec<f64>> = if source.is_isotropic() {
        let starts: Vec<usize> =
            (0..basis.n_phi.len()).map(|ring| basis.n_phi[..ring].iter().sum()).collect();
        let of_rings: Vec<_> = starts.into_par_iter().map(own_totals).collect();
        of_rings.iter().zip(&basis.n_phi).flat_map(|(t, &k)| vec![t.clone(); k]).collect()
    } else {
        (0..n).into_par_iter().map(own_totals).collect()
    };
    let slices: Vec<Slice> = ring_totals
        .into_par_iter()
        .enumerate()
        .map(|(column, totals)| {
            let mut scratch = vec![0.0; bands];
            let mut asked = Asked::default();
            let mut mean = |row: usize, rule: usize| -> Vec<f64> {
                let mut sum = vec![0.0; bands];
                for &(u, a) in &rules[rule][column] {
                    for &(v, b) in &rules[rule][row] {
                        let pair = (incident(u, sign_i), DVec3::new(v.x, v.y, sign_o * v.z));
                        add(source, pair, a * b, &mut scratch, &mut sum, &mut asked);
                    }
                }
                sum
            };
            let travel = basis.centre(column);
            let near = PEAK_ANGLE_DEG.to_radians().cos();
            let mut values: Vec<Vec<f64>> = (0..n)
                .map(|row| {
                    let w = basis.centre(row);
                    let peak =
                        w.dot(travel) > near || w.dot(DVec3::new(-travel.x, -travel.y, travel.z)) > near;
                    let fine = mean(row, 1);
                    let agree = |coarse: Vec<f64>| {
                        let three = coarse.iter().zip(&fine).zip(&totals);
                        three.into_iter().all(|((c, f), t)| (c - f).abs() <= AGREE * f.max(t / PI))
                    };
                    if peak || !agree(mean(row, 0)) { mean(row, 2) } else { fine }
                })
                .collect();
            rescale(&mut values, &totals, |row| basis.projected_solid_angle_sr(row));
            Slice { values, totals, asked }
        })
        .collect();
    gather(&slices, bands, |band| (0..n * n).map(|k| slices[k % n].values[k / n][band] as f32).collect())
}

/// A part as a tensor tree of 2^`log2` boxes per axis, boxes joined that agree within `tolerance`.
pub(super) fn tree(
    source: &dyn Directional,
    part: Part,
    (rank, log2): (usize, u32),
    tolerance: f64,
) -> Averaged<TensorTree> {
    let (n, bands) = (1usize << log2, source.bands().len());
    let (sign_i, sign_o) = part.signs();
    let rule: Vec<(f64, f64)> = GaussLegendre::new(COARSE).on(0.0, 1.0).collect();
    let width = 1.0 / n as f64;
    // Points of a square of the exitant grid, or of rank 4's incident one.
    let square = |cell: usize| {
        let (i, j) = ((cell / n) as f64, (cell % n) as f64);
        let points = rule.iter().flat_map(|&(u, a)| rule.iter().map(move |&(v, b)| (u, v, a * b)));
        let directions = points.map(|(u, v, weight)| {
            let (x, y) = disk_from_square([(i + u) * width, (j + v) * width]);
            (DVec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt()), weight)
        });
        directions.collect::<Vec<_>>()
    };
    let exits: Vec<Vec<(DVec3, f64)>> = (0..n * n).map(square).collect();
    // An anisotropic source in an isotropic tree is averaged over the azimuth.
    let turns = if rank == 3 && !source.is_isotropic() { 16 } else { 1 };
    let incidents: Vec<Vec<(DVec3, f64)>> = if rank == 3 {
        let ring = |i: usize| {
            let radii = rule.iter().map(move |&(u, a)| (1.0 - 2.0 * (i as f64 + u) * width, a));
            radii.map(|(r, a)| (DVec3::new(r, 0.0, (1.0 - r * r).max(0.0).sqrt()), a)).collect()
        };
        (0..n / 2).map(ring).collect()
    } else {
        exits.clone()
    };
    let turn = |w: DVec3, k: usize| {
        let (s, c) = (2.0 * PI * k as f64 / turns as f64).sin_cos();
        DVec3::new(c * w.x - s * w.y, s * w.x + c * w.y, w.z)
    };
    let slices: Vec<Slice> = incidents
        .par_iter()
        .map(|patch| {
            let (mut scratch, mut asked) = (vec![0.0; bands], Asked::default());
            let lamps: Vec<(DVec3, f64)> = (0..turns)
                .flat_map(|k| patch.iter().map(move |&(w, a)| (k, w, a / turns as f64)))
                .map(|(k, w, a)| (incident(turn(w, k), sign_i), a))
                .collect();
            let mut values = vec![vec![0.0; bands]; n * n];
            for (sum, exit) in values.iter_mut().zip(&exits) {
                for (k, &(wi, a)) in lamps.iter().enumerate() {
                    for &(w, b) in exit {
                        let w = turn(w, k / patch.len());
                        let pair = (wi, DVec3::new(w.x, w.y, sign_o * w.z));
                        add(source, pair, a * b, &mut scratch, sum, &mut asked);
                    }
                }
            }
            let totals = totals(source, &lamps, side(sign_o), rank == 3);
            rescale(&mut values, &totals, |_| PI * width * width);
            Slice { values, totals, asked }
        })
        .collect();
    gather(&slices, bands, |band| {
        let grid: Vec<f32> = slices.iter().flat_map(|s| s.values.iter().map(|v| v[band] as f32)).collect();
        TensorTree::from_grid(rank, log2, &grid, tolerance)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::directional::tests::Sheet;
    use crate::io::klems::Klems;

    #[test]
    fn totals_are_the_sources() {
        let sheet = Sheet::new(0.3, 0.3, 0.25);
        for basis in [Klems::Full, Klems::Half, Klems::Quarter].map(Klems::basis) {
            let n = basis.len();
            let averaged = klems(&sheet, Part::ReflectionAdaxial, &basis);
            for theta_deg in [0.0, 30.0, 60.0, 80.0f64] {
                let column = basis.patch(theta_deg.to_radians().sin(), 0.0, theta_deg.to_radians().cos());
                let total: f64 = (0..n)
                    .map(|row| {
                        basis.projected_solid_angle_sr(row) * f64::from(averaged.bands[1][row * n + column])
                    })
                    .sum();
                let lamps: Vec<_> =
                    basis.nodes(column, 4).iter().map(|&(w, a)| (incident(w, 1.0), a)).collect();
                let own = totals(&sheet, &lamps, Side::Adaxial, true)[1];
                assert!((total / own - 1.0).abs() < 1e-3, "{} {theta_deg}: {total} {own}", basis.name);
            }
            // Reciprocal: exchanging lamp and viewer turns row and column around.
            let opposite = |p: usize| {
                let w = basis.centre(p);
                basis.patch(-w.x, -w.y, w.z)
            };
            for (row, column) in [(3, 40), (20, 33), (n - 1, 2)] {
                let (a, b) = (row * n + column, opposite(column) * n + opposite(row));
                let (a, b) = (averaged.bands[0][a], averaged.bands[0][b]);
                assert!((a / b - 1.0).abs() < 2e-3, "{row} {column}: {a} {b}");
            }
        }
    }

    #[test]
    fn a_lambertian_sheet_is_one_box() {
        let averaged = tree(&Sheet::new(0.3, 0.0, 0.25), Part::TransmissionAbaxial, (4, 3), 0.01);
        assert_eq!(averaged.bands[1].len(), 1);
        assert!((averaged.largest_total - 0.25).abs() < 1e-9 && averaged.unknown == 0.0);
    }
}

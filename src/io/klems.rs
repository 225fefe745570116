//! Klems matrices: a BSDF as constants on pairs of patches of two hemispheres.
//!
//! Model: f(wi, wo) = M\[row of wo\]\[column of wi\]. A basis divides the hemisphere into rings of the polar angle and a ring
//! into equal patches of azimuth, patch 0 around azimuth 0.
//!
//! | symbol | here | unit | default |
//! |---|---|---|---|
//! | ring's limits | [`AngleBasis::theta_max_deg`] | degrees | of the named basis, `data/klems_angle_bases.csv` |
//! | patches of a ring | [`AngleBasis::n_phi`] | - | the same |
//! | M | [`Matrix::values_per_sr`] | 1/sr | - |
//! | projected solid angle pi (sin^2 t1 - sin^2 t0) / n | [`AngleBasis::projected_solid_angle_sr`] | sr | - |
//!
//! Directions: the row is looked up with wo's (x, y), the column with **minus** wi's, which is the direction in which light
//! travels; for the mirror's direction, and for light that goes straight through, row and column are equal
//! (`mirror_and_straight_light_are_on_the_diagonal`).
//!
//! Limits: the published counts of patches are 145, 73 and 41, and the projected solid angles add up to pi
//! (`published_patches`). Half and Quarter have two revisions, see the data file. Source: Radiance's `bsdf_m.c`.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use crate::math::quadrature::GaussLegendre;
use crate::{Error, Result};

/// Rings of patches on a hemisphere.
#[derive(Clone, Debug, PartialEq)]
pub struct AngleBasis {
    /// As the file calls it.
    pub name: String,
    /// Upper polar angle of each ring, degrees, increasing to 90; the first ring begins at the pole.
    pub theta_max_deg: Vec<f64>,
    /// Patches of each ring.
    pub n_phi: Vec<usize>,
}

/// The bases that are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Klems {
    /// 145 patches.
    #[default]
    Full,
    /// 77 patches, as in Radiance since 2022.
    Half,
    /// 41 patches, as in Radiance since 2022.
    Quarter,
}

/// More patches than any basis has; keeps products of counts small.
const MAX_PATCHES: usize = 20_000;

/// Rows of the data file, once per basis.
fn built_in(key: &str) -> Option<AngleBasis> {
    let rows = include_str!("../../data/klems_angle_bases.csv").lines().filter_map(|line| {
        let fields: Vec<&str> = line.split(',').collect();
        let [name, _, theta_max_deg, n_phi, _] = fields[..] else { return None };
        let ring: (f64, usize) = (theta_max_deg.parse().ok()?, n_phi.parse().ok()?);
        (name == key).then_some(ring)
    });
    let (theta_max_deg, n_phi): (Vec<f64>, Vec<usize>) = rows.unzip();
    let name = key.trim_end_matches(" since 2022").to_string();
    (!n_phi.is_empty()).then_some(AngleBasis { name, theta_max_deg, n_phi })
}

impl Klems {
    /// The patches.
    pub fn basis(self) -> AngleBasis {
        let key = match self {
            Klems::Full => "LBNL/Klems Full",
            Klems::Half => "LBNL/Klems Half since 2022",
            Klems::Quarter => "LBNL/Klems Quarter since 2022",
        };
        built_in(key).expect("built-in table, read by every test of this file")
    }
}

impl AngleBasis {
    /// A basis from a file, checked: rings follow each other up to 90 degrees.
    pub fn new(name: &str, theta_max_deg: Vec<f64>, n_phi: Vec<usize>) -> Result<Self> {
        let fail = |what: String| Err(Error::invalid(format!("angle basis `{name}`"), what));
        let mut last = 0.0;
        for &theta in &theta_max_deg {
            if !(theta > last && theta <= 90.0 + 1e-6) {
                return fail(format!("upper angle {theta} deg after {last} deg: expected increasing to 90"));
            }
            last = theta;
        }
        if (last - 90.0).abs() > 1e-6 || theta_max_deg.len() != n_phi.len() {
            return fail(format!("its rings end at {last} deg, not at 90"));
        }
        let total = n_phi.iter().try_fold(0usize, |sum, &n| sum.checked_add(n));
        if n_phi.contains(&0) || total.is_none_or(|t| t > MAX_PATCHES) {
            return fail(format!("expected 1 to {MAX_PATCHES} patches"));
        }
        Ok(Self { name: name.into(), theta_max_deg, n_phi })
    }

    /// Bases that a name without a definition in the file can mean, the likeliest first.
    pub fn named(name: &str) -> Vec<Self> {
        let known = ["LBNL/Klems Full", "LBNL/Klems Half", "LBNL/Klems Quarter"];
        let Some(key) = known.into_iter().find(|k| k.eq_ignore_ascii_case(name.trim())) else {
            return Vec::new();
        };
        [format!("{key} since 2022"), key.to_string()].iter().filter_map(|k| built_in(k)).collect()
    }

    /// Number of patches.
    pub fn len(&self) -> usize {
        self.n_phi.iter().sum()
    }

    /// Never true for a checked basis.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Ring and number in the ring.
    fn ring(&self, patch: usize) -> (usize, usize) {
        let mut k = patch;
        for (ring, &n) in self.n_phi.iter().enumerate() {
            if k < n {
                return (ring, k);
            }
            k -= n;
        }
        (self.n_phi.len() - 1, 0)
    }

    /// sin^2 of the ring's limits.
    fn sin2(&self, ring: usize) -> (f64, f64) {
        let sin2 = |deg: f64| deg.to_radians().sin().powi(2);
        (if ring == 0 { 0.0 } else { sin2(self.theta_max_deg[ring - 1]) }, sin2(self.theta_max_deg[ring]))
    }

    /// Patch of a direction, by its projection (x, y) and |z|.
    pub fn patch(&self, x: f64, y: f64, z: f64) -> usize {
        let theta_deg = x.hypot(y).atan2(z.abs()).to_degrees();
        let ring = self.theta_max_deg.partition_point(|&t| t <= theta_deg).min(self.n_phi.len() - 1);
        let n = self.n_phi[ring];
        let turns = y.atan2(x) / TAU;
        let k = ((turns + 1.0) * n as f64 + 0.5) as usize % n;
        self.n_phi[..ring].iter().sum::<usize>() + k
    }

    /// Integral of the cosine over a patch, sr.
    pub fn projected_solid_angle_sr(&self, patch: usize) -> f64 {
        let (ring, _) = self.ring(patch);
        let (low, high) = self.sin2(ring);
        PI * (high - low) / self.n_phi[ring] as f64
    }

    /// Middle of a patch (the pole for a cap) in the upper hemisphere.
    pub fn centre(&self, patch: usize) -> DVec3 {
        let (ring, k) = self.ring(patch);
        let low = if ring == 0 { 0.0 } else { self.theta_max_deg[ring - 1] };
        let theta_deg =
            if ring == 0 && self.n_phi[0] == 1 { 0.0 } else { 0.5 * (low + self.theta_max_deg[ring]) };
        crate::gonio::measurement::direction_deg(theta_deg, 360.0 * k as f64 / self.n_phi[ring] as f64)
    }

    /// Directions of the upper hemisphere with weights that add up to 1 and average over a patch by projected solid
    /// angle: `n` Gauss points each way, on a cap `n` by `4 n` equal steps of azimuth.
    pub fn nodes(&self, patch: usize, n: usize) -> Vec<(DVec3, f64)> {
        let (ring, k) = self.ring(patch);
        let (low, high) = self.sin2(ring);
        let n_phi = self.n_phi[ring];
        let rule = GaussLegendre::new(n);
        let phis: Vec<(f64, f64)> = if n_phi == 1 {
            (0..4 * n).map(|j| (TAU * (j as f64 + 0.5) / (4 * n) as f64, 1.0 / (4 * n) as f64)).collect()
        } else {
            let (middle, half) = (TAU * k as f64 / n_phi as f64, PI / n_phi as f64);
            rule.on(-1.0, 1.0).map(|(u, w)| (middle + half * u, 0.5 * w)).collect()
        };
        let direction = |s2: f64, phi: f64| {
            let sin = s2.sqrt();
            DVec3::new(sin * phi.cos(), sin * phi.sin(), (1.0 - s2).max(0.0).sqrt())
        };
        rule.on(0.0, 1.0)
            .flat_map(|(u, w)| phis.iter().map(move |&(phi, v)| (low + (high - low) * u, phi, w * v)))
            .map(|(s2, phi, weight)| (direction(s2, phi), weight))
            .collect()
    }
}

/// One part of a BSDF at one band.
#[derive(Clone, Debug, PartialEq)]
pub struct Matrix {
    /// Patches of the incident light, by the direction of travel.
    pub columns: AngleBasis,
    /// Patches of the exitant light.
    pub rows: AngleBasis,
    /// Row by row, 1/sr.
    pub values_per_sr: Vec<f32>,
}

impl Matrix {
    /// The value for two directions of the right sides.
    pub fn at(&self, wi: DVec3, wo: DVec3) -> f64 {
        let column = self.columns.patch(-wi.x, -wi.y, wi.z);
        let row = self.rows.patch(wo.x, wo.y, wo.z);
        self.values_per_sr.get(row * self.columns.len() + column).copied().map_or(0.0, f64::from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::measurement::direction_deg;

    fn all() -> Vec<AngleBasis> {
        ["LBNL/Klems Full", "lbnl/klems half", "LBNL/Klems Quarter"]
            .iter()
            .flat_map(|name| AngleBasis::named(name))
            .collect()
    }

    #[test]
    fn published_patches() {
        let counts: Vec<usize> = all().iter().map(AngleBasis::len).collect();
        assert_eq!(counts, [145, 77, 73, 41, 41]);
        assert_eq!([Klems::Full, Klems::Half, Klems::Quarter].map(|k| k.basis().len()), [145, 77, 41]);
        for basis in all() {
            let sum: f64 = (0..basis.len()).map(|p| basis.projected_solid_angle_sr(p)).sum();
            assert!((sum - PI).abs() < 1e-12, "{}: {sum}", basis.name);
        }
        // The table of Klems and Warner 1995: the projected solid angle of the first and the last ring, sr.
        let full = Klems::Full.basis();
        assert!((full.projected_solid_angle_sr(0) - 0.0239).abs() < 5e-5);
        assert!((full.projected_solid_angle_sr(144) - 0.0175).abs() < 5e-5);
        assert!(AngleBasis::named("LBNL/Klems Double").is_empty());
    }

    #[test]
    fn nodes_lie_in_their_patch_and_average_it() {
        for basis in all() {
            let (mut total, mut cos2) = (0.0, 0.0);
            for patch in 0..basis.len() {
                assert_eq!(
                    basis.patch(basis.centre(patch).x, basis.centre(patch).y, basis.centre(patch).z),
                    patch
                );
                for n in [2, 3, 6] {
                    let nodes = basis.nodes(patch, n);
                    assert!((nodes.iter().map(|w| w.1).sum::<f64>() - 1.0).abs() < 1e-12);
                    assert!(nodes.iter().all(|(w, _)| basis.patch(w.x, w.y, w.z) == patch), "{patch}");
                }
                let area = basis.projected_solid_angle_sr(patch);
                total += area;
                cos2 +=
                    basis.nodes(patch, 2).iter().map(|(w, weight)| area * weight * w.z * w.z).sum::<f64>();
            }
            // Integral of cos^3 over the hemisphere is pi / 2.
            assert!((total - PI).abs() < 1e-12 && (cos2 - PI / 2.0).abs() < 1e-12);
        }
    }

    #[test]
    fn mirror_and_straight_light_are_on_the_diagonal() {
        let basis = Klems::Full.basis();
        let n = basis.len();
        let mut diagonal = vec![0.0; n * n];
        (0..n).for_each(|i| diagonal[i * n + i] = 1.0);
        let m = Matrix { columns: basis.clone(), rows: basis, values_per_sr: diagonal };
        let wi = direction_deg(40.0, 30.0);
        assert_eq!(m.at(wi, direction_deg(40.0, 210.0)), 1.0);
        assert_eq!(m.at(wi, direction_deg(140.0, 210.0)), 1.0);
        assert_eq!(m.at(wi, wi), 0.0);
        assert_eq!(m.at(wi, direction_deg(40.0, 120.0)), 0.0);
    }

    #[test]
    fn wrong_bases_are_errors() {
        for (theta, n) in [
            (vec![45.0], vec![1]),
            (vec![45.0, 30.0], vec![1, 2]),
            (vec![45.0, f64::NAN], vec![1, 2]),
            (vec![45.0, 90.0], vec![1, 0]),
            (vec![90.0], vec![usize::MAX]),
            (vec![45.0, 90.0], vec![usize::MAX, 2]),
            (vec![45.0, 90.0], vec![2]),
            (vec![], vec![]),
        ] {
            assert!(AngleBasis::new("x", theta.clone(), n.clone()).is_err(), "{theta:?} {n:?}");
        }
        assert!(AngleBasis::new("x", vec![45.0, 90.0], vec![1, 2]).is_ok());
    }
}

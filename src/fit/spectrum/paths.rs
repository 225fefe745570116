//! The ways of the light that a petal sends back, for any absorption.
//!
//! Model: of N walks of one without absorption the share `R(mu) = 1/N sum over reflected walks of exp(-sum over regions r of
//! mu_r l_r)` comes back. Walks of like ways are merged into classes: the sorted halves of the widest direction of
//! ln(1 + l / 1 um), again and again, until a part holds at most 8. A class of share n / N, mean way m and variances v counts
//! as `n / N exp(-mu m) (1 + sum over r of mu_r^2 v_r / 2)`, the mean of the exponential to second order. Surface
//! reflection has no way and stays apart.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | mu_r | `absorption_per_um` | 1/um | |
//! | N | `walks` | | 20000 |
//!
//! Limits: Monte Carlo, one standard error of R is at most 1/(2 sqrt N), guarded by `reflectance_of_known_ways`; merging
//! changes R by less than 5e-4, guarded by `merged_walks_reflect_alike`. Walks that were cut off count as lost. Our
//! reading of white Monte Carlo ([`crate::micro::white`]).

use glam::DVec3;
use rayon::prelude::*;

use crate::math::Stream;
use crate::micro::{End, Exit, REGIONS, WhiteScatter};

/// Walks that one class merges at most.
const CLASS: usize = 8;
/// Family of the random streams.
const FAMILY: u64 = 0x7e4a_15c0;

/// From where the light comes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Illumination {
    /// From everywhere above the petal with the same radiance: an integrating sphere.
    Diffuse,
    /// From one angle to the normal, degrees, 0 to 89, all azimuths.
    Direct(f64),
}

/// What a spectrometer saw of a petal's adaxial side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setup {
    /// The lamp. The detector takes all light that comes back: by reciprocity this is also a lamp from everywhere and a
    /// detector at this angle.
    pub illumination: Illumination,
    /// Does the detector see surface reflection (specular included)?
    pub surface: bool,
}

impl Default for Setup {
    fn default() -> Self {
        Self { illumination: Illumination::Diffuse, surface: true }
    }
}

/// Walks of like ways.
#[derive(Clone, Copy, Debug)]
struct Class {
    /// Mean way through each region, um.
    mean: [f64; REGIONS],
    /// Variances of the ways, um^2.
    variance: [f64; REGIONS],
    /// Share of all walks.
    share: f64,
}

/// Reflected light: shares with their ways.
#[derive(Clone, Debug)]
pub(crate) struct ReflectedPaths {
    /// Share that never entered the petal.
    surface: f64,
    classes: Vec<Class>,
    /// Share of the walks that were cut off.
    pub(crate) cut_off: f64,
}

impl ReflectedPaths {
    /// Follows `walks` walks.
    pub(crate) fn collect(scatter: &dyn WhiteScatter, setup: Setup, walks: u32, seed: u64) -> Self {
        let ends: Vec<End> = (0..u64::from(walks))
            .into_par_iter()
            .map(|i| {
                let mut stream = Stream::new(seed, FAMILY, i);
                let u = stream.next_2d();
                let cos = match setup.illumination {
                    Illumination::Diffuse => (1.0 - u.x).sqrt(),
                    Illumination::Direct(deg) => deg.to_radians().cos(),
                };
                let (sin, phi) = ((1.0 - cos * cos).max(0.0).sqrt(), u.y * std::f64::consts::TAU);
                scatter.walk(DVec3::new(sin * phi.cos(), sin * phi.sin(), cos), &mut stream)
            })
            .collect();
        let share = 1.0 / f64::from(walks.max(1));
        let (mut surface, mut cut_off) = (0.0, 0.0);
        let mut ways = Vec::new();
        for end in &ends {
            match end {
                End::CutOff => cut_off += share,
                End::Left(exit) if exit.direction.z <= 0.0 => {}
                End::Left(exit) if exit.is_surface() => surface += share,
                End::Left(Exit { path_um, .. }) => {
                    ways.push(Class { mean: *path_um, variance: [0.0; REGIONS], share });
                }
            }
        }
        let surface = if setup.surface { surface } else { 0.0 };
        Self { surface, classes: merged(ways, CLASS), cut_off }
    }

    /// The same light in about `classes` classes or less: quicker, less exact.
    pub(crate) fn coarse(&self, classes: usize) -> Self {
        let size = self.classes.len().div_ceil(classes.max(1));
        Self { classes: merged(self.classes.clone(), size), ..*self }
    }

    /// R, and its derivative by the absorption of each region.
    pub(crate) fn reflectance(&self, absorption_per_um: &[f64; REGIONS]) -> (f64, [f64; REGIONS]) {
        let mu = absorption_per_um;
        let (mut sum, mut by) = (self.surface, [0.0; REGIONS]);
        for class in &self.classes {
            let (mut depth, mut spread) = (0.0, 1.0);
            for ((mu, mean), variance) in mu.iter().zip(&class.mean).zip(&class.variance) {
                depth += mu * mean;
                spread += 0.5 * mu * mu * variance;
            }
            let left = class.share * (-depth).exp();
            sum += left * spread;
            for (r, by) in by.iter_mut().enumerate() {
                *by += left * (mu[r] * class.variance[r] - class.mean[r] * spread);
            }
        }
        (sum, by)
    }
}

/// Classes of at most `size` of the given ones.
fn merged(mut classes: Vec<Class>, size: usize) -> Vec<Class> {
    let mut out = Vec::new();
    merge(&mut classes, size, &mut out);
    out
}

fn merge(classes: &mut [Class], size: usize, out: &mut Vec<Class>) {
    if classes.is_empty() {
        return;
    }
    let spread = |r: usize| {
        let ends = |(a, b): (f64, f64), c: &Class| (a.min(c.mean[r]), b.max(c.mean[r]));
        let (low, high) = classes.iter().fold((f64::INFINITY, 0f64), ends);
        high.ln_1p() - low.ln_1p()
    };
    let widest = (0..REGIONS).max_by(|a, b| spread(*a).total_cmp(&spread(*b))).unwrap_or(0);
    if classes.len() <= size || spread(widest) == 0.0 {
        let share: f64 = classes.iter().map(|c| c.share).sum();
        let mean_of = |f: &dyn Fn(&Class) -> f64| classes.iter().map(|c| c.share * f(c)).sum::<f64>() / share;
        let mean: [f64; REGIONS] = std::array::from_fn(|r| mean_of(&|c| c.mean[r]));
        let variance = std::array::from_fn(|r| mean_of(&|c| c.variance[r] + (c.mean[r] - mean[r]).powi(2)));
        out.push(Class { mean, variance, share });
        return;
    }
    let half = classes.len() / 2;
    classes.select_nth_unstable_by(half, |a, b| a.mean[widest].total_cmp(&b.mean[widest]));
    let (low, high) = classes.split_at_mut(half);
    merge(low, size, out);
    merge(high, size, out);
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Surface reflection of 4 %; the rest comes back with a share of s/(s + 20) or goes through. The way in the spongy
    /// layer is exponential with mean 2000/(s + 2) um, that in the upper epidermis 40 um or 60 um.
    pub(crate) struct Toy {
        pub(crate) scattering_per_mm: f64,
    }

    impl WhiteScatter for Toy {
        fn walk(&self, _: DVec3, stream: &mut Stream) -> End {
            let s = self.scattering_per_mm;
            let (kind, back, way, upper) =
                (stream.next(), stream.next(), stream.exponential(), stream.next());
            let (z, path_um) = if kind < 0.04 {
                (1.0, [0.0; REGIONS])
            } else {
                let spongy = way * 2000.0 / (s + 2.0);
                let z = if back < s / (s + 20.0) { 1.0 } else { -1.0 };
                (z, [if upper < 0.5 { 40.0 } else { 60.0 }, 0.0, spongy, 0.0])
            };
            End::Left(Exit { direction: DVec3::new(0.0, 0.0, z), path_um })
        }
    }

    /// The toy's reflectance, by hand.
    fn toy(s: f64, mu: [f64; REGIONS]) -> f64 {
        let epidermis = 0.5 * ((-40.0 * mu[0]).exp() + (-60.0 * mu[0]).exp());
        0.04 + 0.96 * s / (s + 20.0) * epidermis / (1.0 + mu[2] * 2000.0 / (s + 2.0))
    }

    #[test]
    fn reflectance_of_known_ways() {
        let s = 30.0;
        let walks = 40_000;
        let paths = ReflectedPaths::collect(&Toy { scattering_per_mm: s }, Setup::default(), walks, 1);
        for mu in [[0.0; 4], [0.02, 0.0, 0.0, 0.0], [0.0, 0.0, 0.01, 0.0], [0.05, 0.0, 0.002, 0.0]] {
            let (r, by) = paths.reflectance(&mu);
            assert!((r - toy(s, mu)).abs() < 4.0 * 0.5 / f64::from(walks).sqrt(), "{r} {}", toy(s, mu));
            for region in [0, 2] {
                let at = |d: f64| {
                    let mut mu = mu;
                    mu[region] += d;
                    paths.reflectance(&mu).0
                };
                let difference = (at(1e-6) - at(-1e-6)) / 2e-6;
                assert!((difference - by[region]).abs() < 1e-6 * difference.abs().max(1.0), "{region}");
            }
        }
        let inside = Setup { surface: false, ..Setup::default() };
        let without = ReflectedPaths::collect(&Toy { scattering_per_mm: s }, inside, walks, 1);
        let difference = paths.reflectance(&[0.0; 4]).0 - without.reflectance(&[0.0; 4]).0;
        assert!((difference - 0.04).abs() < 0.005, "{difference}");
    }

    #[test]
    fn merged_walks_reflect_alike() {
        // Ways in all regions, spread over orders of magnitude.
        let mut stream = Stream::new(3, 4, 5);
        let way = |stream: &mut Stream| [30.0, 100.0, 500.0, 30.0].map(|m| m * stream.exponential());
        let share = 1.0 / 20_000.0;
        let ways: Vec<Class> =
            (0..20_000).map(|_| Class { mean: way(&mut stream), variance: [0.0; REGIONS], share }).collect();
        let classes = merged(ways.clone(), CLASS);
        assert!(classes.len() < 20_000 / 4, "{}", classes.len());
        let paths = ReflectedPaths { surface: 0.0, classes, cut_off: 0.0 };
        let coarse = paths.coarse(256);
        assert!(coarse.classes.len() <= 512, "{}", coarse.classes.len());
        for mu in [[0.0; 4], [1e-3; 4], [0.05, 0.0, 1e-3, 0.05], [0.0, 0.0, 0.1, 0.0], [0.2, 1e-3, 1e-4, 0.0]]
        {
            let left = |c: &Class| (-c.mean.iter().zip(&mu).map(|(l, m)| l * m).sum::<f64>()).exp();
            let exact = ways.iter().map(left).sum::<f64>() / ways.len() as f64;
            let (r, quick) = (paths.reflectance(&mu).0, coarse.reflectance(&mu).0);
            assert!((r - exact).abs() < 5e-4 && (quick - exact).abs() < 0.02, "{mu:?}: {r} {quick} {exact}");
        }
    }
}

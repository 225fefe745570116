//! Measuring a petal once for all wavelengths and all amounts of pigment.
//!
//! Model (white Monte Carlo): walks without absorption from every polar bin of both sides, counted by where they leave and by
//! the class of their ways through the regions; light that never entered is counted by itself.
//!
//! ```text
//! lamp: sin^2 theta uniform within the polar bin (cosine-weighted), azimuth uniform: the mean over all azimuths
//! f(wi, wo; mu) = s(wi, wo) + sum over k of i_k(wi, wo) e_k(mu)       (see petal_optics)
//! ```
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | walks | `walks` (per side, the same number from each polar bin, rounded up) | | 1e6 |
//! | polar bins | `thetas` | | 18 |
//! | bins of the angle between the azimuths | `surface_phis`, `interior_phis` | | 18, 9 |
//! | K | `classes` (at most, of all parts together) | | 96 |
//!
//! Surface and interior share their polar bins: only so the energy of both is kept at every node, also at grazing angles
//! where one takes over from the other. A pilot of other walks makes the classes. Walk i from a bin draws from a stream of
//! its own and chunks of fixed size are summed in order: the same bytes at any number of threads
//! (`same_at_any_thread_count`).
//!
//! Standard error of a total R of one bin: sqrt(R (1 - R) thetas / walks), 0.2 % of 0.5 by default.
//!
//! Limits: a value is the mean of its bin, so what is sharper than a bin is not seen (`a_lambertian_sheet_is_measured` has the
//! case without); the classes are calibrated to the totals of every polar bin and what they
//! still miss is stored as `class_error` (`recoloured_as_walked`).
//! Source: our reading; white Monte Carlo: Alerstam, Andersson-Engels, Svensson 2008.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use glam::DVec3;
use rayon::prelude::*;

use super::goniophotometer::Progress;
use super::path_classes::{PathClasses, Ways, checks, training};
use super::petal_optics::{MAX_BINS, PARTS};
use super::recolour::class_remaining;
use super::white_calibrate::{Targets, calibrate, class_totals};
use super::white_counts::{Counts, ExitBins, Instrument, check, part};
use super::white_tables::{Flux, balance};
use super::{AngleGrid, AngularTable, Estimate, PetalOptics, WhiteTotals};
use crate::geometry::Side;
use crate::math::Stream;
use crate::micro::{End, REGIONS, WhiteScatter};
use crate::{Error, Result};

/// Walks per side of the pilot that makes the classes.
const PILOT: u64 = 20_000;
/// Passes and damping of the classes' calibration.
const CALIBRATION: (usize, f64) = (8, 1e-2);
/// Walks per unit of parallel work.
const CHUNK: u64 = 8192;
/// Units whose counters are held at once: a bound on memory, without effect on the result.
const BATCH: usize = 32;
/// Values that the tables may have: 32 MB of f32, less some for the rest of the file.
const MAX_VALUES: usize = 7_900_000;

/// The instrument and its settings.
#[derive(Clone, Debug, PartialEq)]
pub struct WhiteMonteCarlo {
    /// Walks per side.
    pub walks: u64,
    /// Seed of the walks.
    pub seed: u64,
    /// Bins of the polar angles.
    pub thetas: usize,
    /// Bins of the angle between the azimuths, for light that never entered the petal.
    pub surface_phis: usize,
    /// The same for light that did.
    pub interior_phis: usize,
    /// Largest number of classes of like walks.
    pub classes: usize,
}

impl Default for WhiteMonteCarlo {
    fn default() -> Self {
        Self { walks: 1_000_000, seed: 0, thetas: 18, surface_phis: 18, interior_phis: 9, classes: 96 }
    }
}

impl WhiteMonteCarlo {
    /// Checks the settings; errors name the key.
    pub fn validate(&self) -> Result<()> {
        let at_least_1 = [
            ("thetas", self.thetas, MAX_BINS[0]),
            ("surface_phis", self.surface_phis, MAX_BINS[1]),
            ("interior_phis", self.interior_phis, MAX_BINS[1]),
        ];
        for (key, value, most) in at_least_1 {
            if !(1..=most).contains(&value) {
                let what = format!("{value} is not within 1 to {most}");
                return Err(Error::invalid(format!("white.{key}"), what));
            }
        }
        // Each part has a class at least.
        if !(PARTS..=MAX_BINS[2]).contains(&self.classes) {
            let what = format!("{} is not within {PARTS} to {}", self.classes, MAX_BINS[2]);
            return Err(Error::invalid("white.classes", what));
        }
        // A bin's count has 32 bits.
        let (least, most) = (2 * self.thetas as u64, u64::from(u32::MAX));
        if !(least..=most).contains(&self.walks) {
            let what = format!("{} is not within {least} (2 per polar bin) and {most}", self.walks);
            return Err(Error::invalid("white.walks", what));
        }
        let values = 3 * (self.surface().len() + self.interior().len() * self.classes);
        if values > MAX_VALUES {
            let what = format!("{values} values of bins and classes; at most {MAX_VALUES}");
            return Err(Error::invalid("white.classes", what));
        }
        Ok(())
    }

    fn surface(&self) -> AngleGrid {
        AngleGrid { thetas: self.thetas, phis: self.surface_phis }
    }

    fn interior(&self) -> AngleGrid {
        AngleGrid { thetas: self.thetas, phis: self.interior_phis }
    }

    /// Walks from each polar bin of each side.
    fn walks_per_bin(&self) -> u64 {
        self.walks.div_ceil(self.thetas as u64)
    }

    /// Measures a petal whose regions have the given depths (volume per area; zero: does not exist), um. The result depends
    /// on the settings and the petal only. `progress` is told of walks.
    pub fn measure(
        &self,
        petal: &dyn WhiteScatter,
        depth_um: [f64; REGIONS],
        progress: Progress,
    ) -> Result<PetalOptics> {
        self.validate()?;
        if !depth_um.iter().all(|d| d.is_finite() && *d >= 0.0) {
            return Err(Error::invalid("white.depth_um", format!("{depth_um:?} um")));
        }
        let classes = PathClasses::new(&self.pilot(petal)?, &depth_um, self.classes);
        let bins = |grid, classes| ExitBins { grid, classes };
        let instrument = Instrument {
            surface: bins(self.surface(), 1),
            interior: bins(self.interior(), classes.len()),
            classes,
            training: training(&depth_um),
            checks: checks(&depth_um),
        };
        let counts = self.follow(petal, &instrument, progress)?;
        Ok(self.evaluate(&instrument, &counts, CALIBRATION))
    }

    /// Direction to the lamp for a walk from a bin.
    fn lamp(&self, family: usize, stream: &mut Stream) -> DVec3 {
        let (side, bin) = (family / self.thetas, family % self.thetas);
        let square = |k: usize| (FRAC_PI_2 * k as f64 / self.thetas as f64).sin().powi(2);
        let u = stream.next_2d();
        // Rounding must not make a grazing lamp stand on the other side.
        let sin2 = (square(bin) + u.x * (square(bin + 1) - square(bin))).min(1.0 - 1e-12);
        let z = (1.0 - sin2).sqrt();
        let (sin_phi, cos_phi) = (TAU * u.y).sin_cos();
        DVec3::new(sin2.sqrt() * cos_phi, sin2.sqrt() * sin_phi, if side == 0 { z } else { -z })
    }

    /// Ways of interior walks from all bins, for each part.
    fn pilot(&self, petal: &dyn WhiteScatter) -> Result<[Vec<Ways>; PARTS]> {
        let per_bin = PILOT.div_ceil(self.thetas as u64);
        let bins: Vec<Result<Vec<(usize, Ways)>>> = (0..2 * self.thetas)
            .into_par_iter()
            .map(|family| {
                let mut ways = Vec::new();
                for i in 0..per_bin {
                    let mut stream = Stream::new(self.seed, (1 << 32) + family as u64, i);
                    let wi = self.lamp(family, &mut stream);
                    if let End::Left(exit) = petal.walk(wi, &mut stream) {
                        check(&exit)?;
                        if !exit.is_surface() {
                            ways.push((part(wi, exit.direction) as usize, exit.path_um));
                        }
                    }
                }
                Ok(ways)
            })
            .collect();
        let mut all: [Vec<Ways>; PARTS] = Default::default();
        for ways in bins {
            ways?.into_iter().for_each(|(part, way)| all[part].push(way));
        }
        Ok(all)
    }

    /// The counted walks of every polar bin, adaxial side first.
    fn follow(
        &self,
        petal: &dyn WhiteScatter,
        instrument: &Instrument,
        progress: Progress,
    ) -> Result<Vec<Counts>> {
        let per_bin = self.walks_per_bin();
        let chunks = per_bin.div_ceil(CHUNK);
        let jobs: Vec<(usize, u64)> =
            (0..2 * self.thetas).flat_map(|f| (0..chunks).map(move |c| (f, c))).collect();
        let total = per_bin * 2 * self.thetas as u64;
        let (done, cancelled) = (AtomicU64::new(0), AtomicBool::new(false));
        let mut counts = vec![Counts::new(instrument); 2 * self.thetas];
        for batch in jobs.chunks(BATCH) {
            let parts: Vec<Result<(usize, Counts)>> = batch
                .par_iter()
                .map(|&(family, chunk)| {
                    if cancelled.load(Ordering::Relaxed) {
                        return Err(Error::Cancelled);
                    }
                    let walks = chunk * CHUNK..((chunk + 1) * CHUNK).min(per_bin);
                    let number = walks.end - walks.start;
                    let mut part = Counts::new(instrument);
                    for i in walks {
                        let mut stream = Stream::new(self.seed, family as u64, i);
                        let wi = self.lamp(family, &mut stream);
                        part.count(instrument, wi, petal.walk(wi, &mut stream))?;
                    }
                    let now = done.fetch_add(number, Ordering::Relaxed) + number;
                    if progress(now, total).is_break() {
                        cancelled.store(true, Ordering::Relaxed);
                    }
                    Ok((family, part))
                })
                .collect();
            // Floating-point sums depend on their order: it is that of the chunks.
            for part in parts {
                let (family, part) = part?;
                counts[family].add(&part);
            }
            if cancelled.load(Ordering::Relaxed) {
                return Err(Error::Cancelled);
            }
        }
        Ok(counts)
    }

    fn evaluate(&self, instrument: &Instrument, counts: &[Counts], how: (usize, f64)) -> PetalOptics {
        let walks = self.walks_per_bin() as f64;
        let surface = Flux {
            bins: instrument.surface,
            counts: counts.iter().map(|c| c.surface.as_slice()).collect(),
            walks,
        };
        let interior = Flux {
            bins: instrument.interior,
            counts: counts.iter().map(|c| c.interior.as_slice()).collect(),
            walks,
        };
        let (paths_um, spreads_um) = codebook(instrument, counts);
        let mut tables = [surface.reciprocal(), interior.reciprocal()];
        let made: Vec<f64> = surface
            .shares_of(&tables[0])
            .iter()
            .zip(interior.shares_of(&tables[1]))
            .map(|(s, i)| s + i)
            .collect();
        let bins = || (0..2 * self.thetas).map(|f| (f / self.thetas, f % self.thetas));
        let left = |flux: &Flux| -> Vec<f64> {
            bins().map(|(side, a)| flux.share(side, a, false) + flux.share(side, a, true)).collect()
        };
        let (left_surface, left_interior) = (left(&surface), left(&interior));
        let asymmetry = made
            .iter()
            .zip(left_surface.iter().zip(&left_interior).map(|(s, i)| s + i))
            .filter(|(_, measured)| *measured > 0.0)
            .map(|(made, measured)| (made - measured).abs() / measured)
            .fold(0.0, f64::max);
        balance(&mut tables[0], &left_surface);
        let remaining = |mu: &Ways| -> Vec<f64> {
            let codes = paths_um.iter().zip(&spreads_um);
            codes.map(|(path, spread)| class_remaining(path, spread, mu)).collect()
        };
        // Without absorption, with the training's, with the checks'.
        let none = Ways::default();
        let all = [&none].into_iter().chain(&instrument.training).chain(&instrument.checks);
        let left_of_classes: Vec<Vec<f64>> = all.map(remaining).collect();
        let targets: Targets = bins()
            .zip(counts)
            .map(|((side, a), c)| {
                [0, 1].map(|way| {
                    let white = interior.share(side, a, way == 1);
                    [white].into_iter().chain(c.remaining.iter().map(|r| r[way] / walks)).collect()
                })
            })
            .collect();
        let calibrated = 1 + instrument.training.len();
        calibrate(&mut tables[1], &left_of_classes[..calibrated], &targets, how);
        balance(&mut tables[1], &left_interior);
        let class_error = class_errors(&tables[1], &left_of_classes, &targets)
            .split_off(calibrated)
            .into_iter()
            .fold(0.0, f64::max);
        let estimate = |share: f64| Estimate::from_sums(share * walks, share * walks, walks);
        let totals = bins()
            .map(|(side, a)| WhiteTotals {
                side: if side == 0 { Side::Adaxial } else { Side::Abaxial },
                incident_deg: self.surface().theta_deg(a),
                surface: estimate(surface.share(side, a, false)),
                interior: estimate(interior.share(side, a, false)),
                transmitted: estimate(surface.share(side, a, true) + interior.share(side, a, true)),
            })
            .collect();
        let [surface, interior] = tables;
        PetalOptics {
            sample: String::new(),
            description: String::new(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            walks: self.walks_per_bin() * self.thetas as u64,
            seed: self.seed,
            cut_off: counts.iter().map(|c| c.cut_off).sum(),
            asymmetry,
            class_error,
            paths_um,
            spreads_um,
            surface,
            interior,
            totals,
        }
    }
}

/// One number per region for each class.
type Codes = Vec<[f32; REGIONS]>;

/// Mean and standard deviation of the ways of each class, um.
fn codebook(instrument: &Instrument, counts: &[Counts]) -> (Codes, Codes) {
    let mut sums = vec![(0.0, [Ways::default(); 2]); instrument.classes.len()];
    for c in counts {
        for (i, n) in c.interior.iter().enumerate() {
            sums[i % instrument.classes.len()].0 += f64::from(*n);
        }
        for ((_, sum), ways) in sums.iter_mut().zip(&c.ways_um) {
            sum.as_flattened_mut().iter_mut().zip(ways.as_flattened()).for_each(|(a, b)| *a += b);
        }
    }
    let code = |(n, [sum, squares]): &(f64, [Ways; 2]), r: usize| {
        if *n == 0.0 {
            return (0.0, 0.0);
        }
        let mean = sum[r] / n;
        (mean, (squares[r] / n - mean * mean).max(0.0).sqrt())
    };
    let mean = |s| std::array::from_fn(|r| code(s, r).0 as f32);
    let spread = |s| std::array::from_fn(|r| code(s, r).1 as f32);
    (sums.iter().map(mean).collect(), sums.iter().map(spread).collect())
}

/// For each set of coefficients the largest difference, over the polar bins and the two ways out, between the share that is
/// left of the walks and that of the table's classes, where the table has the measured white share.
fn class_errors(table: &AngularTable, left: &[Vec<f64>], targets: &Targets) -> Vec<f64> {
    let totals = class_totals(table);
    let error = |m: usize| {
        let mut worst = 0.0f64;
        for (totals, targets) in totals.iter().zip(targets) {
            for (totals, targets) in totals.iter().zip(targets) {
                let white: f64 = totals.iter().sum();
                let colored: f64 = totals.iter().zip(&left[m]).map(|(p, e)| p * e).sum();
                if white > 0.0 {
                    worst = worst.max((colored / white * targets[0] - targets[m]).abs());
                }
            }
        }
        worst
    };
    (0..left.len()).map(error).collect()
}

#[cfg(test)]
mod tests;

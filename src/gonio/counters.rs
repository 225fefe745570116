//! What a measurement counts while it runs, and how the sums become estimates.
//!
//! Everything is a plain sum in f64 over paths, so that parts can be added; `goniophotometer` says what the
//! sums mean and fixes the order in which parts are added.

use super::{Estimate, Goniophotometer, Incidence, Ledger, Totals};

/// Sum and sum of squares.
#[derive(Clone, Copy, Default)]
pub(super) struct Sums {
    sum: f64,
    squares: f64,
}

impl Sums {
    pub(super) fn add(&mut self, v: f64) {
        self.sum += v;
        self.squares += v * v;
    }

    pub(super) fn merge(&mut self, other: &Sums) {
        self.sum += other.sum;
        self.squares += other.squares;
    }

    fn estimate(&self, n: f64) -> Estimate {
        Estimate::from_sums(self.sum, self.squares, n)
    }
}

/// What one path adds to the totals.
#[derive(Clone, Copy, Default)]
pub(super) struct PathTotals {
    reflected: f64,
    transmitted: f64,
    absorbed: f64,
    retro: f64,
    mirror: f64,
}

impl PathTotals {
    pub(super) const ABSORBED: Self =
        Self { reflected: 0.0, transmitted: 0.0, absorbed: 1.0, retro: 0.0, mirror: 0.0 };

    pub(super) fn scattered(weight: f64, reflected: bool, retro: f64, mirror: f64) -> Self {
        Self {
            reflected: if reflected { weight } else { 0.0 },
            transmitted: if reflected { 0.0 } else { weight },
            absorbed: 1.0 - weight,
            retro: weight * retro,
            mirror: weight * mirror,
        }
    }

    pub(super) fn add_scaled(&mut self, other: &Self, factor: f64) {
        self.reflected += factor * other.reflected;
        self.transmitted += factor * other.transmitted;
        self.absorbed += factor * other.absorbed;
        self.retro += factor * other.retro;
        self.mirror += factor * other.mirror;
    }
}

/// Sums of [`PathTotals`].
#[derive(Clone, Copy, Default)]
pub(super) struct TotalSums {
    reflected: Sums,
    transmitted: Sums,
    absorbed: Sums,
    retro: Sums,
    mirror: Sums,
    retro_times_mirror: f64,
    scattered: u64,
}

impl TotalSums {
    pub(super) fn add(&mut self, path: &PathTotals) {
        self.reflected.add(path.reflected);
        self.transmitted.add(path.transmitted);
        self.absorbed.add(path.absorbed);
        self.retro.add(path.retro);
        self.mirror.add(path.mirror);
        self.retro_times_mirror += path.retro * path.mirror;
        self.scattered += u64::from(path.reflected + path.transmitted > 0.0);
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.reflected.merge(&other.reflected);
        self.transmitted.merge(&other.transmitted);
        self.absorbed.merge(&other.absorbed);
        self.retro.merge(&other.retro);
        self.mirror.merge(&other.mirror);
        self.retro_times_mirror += other.retro_times_mirror;
        self.scattered += other.scattered;
    }

    fn totals(&self, n: f64, at_normal: bool) -> Totals {
        let (retro, mirror) = (self.retro.estimate(n), self.mirror.estimate(n));
        let retro_index = if at_normal {
            Some(Estimate { value: 1.0, standard_error: 0.0 })
        } else if mirror.value > 0.0 {
            // Ratio of two means of the same paths, to first order.
            let ratio = retro.value / mirror.value;
            let covariance = (self.retro_times_mirror / n - retro.value * mirror.value) / (n - 1.0);
            let variance = retro.standard_error.powi(2) + ratio * ratio * mirror.standard_error.powi(2)
                - 2.0 * ratio * covariance;
            let standard_error = variance.max(0.0).sqrt() / mirror.value;
            Some(Estimate { value: ratio, standard_error })
        } else {
            None
        };
        // One minus a weight is rounded where the weight was.
        let mut absorptance = self.absorbed.estimate(n);
        let rounding = (self.reflected.sum + self.transmitted.sum) / n * f64::from(f32::EPSILON);
        absorptance.standard_error = absorptance.standard_error.hypot(rounding);
        Totals {
            reflectance: self.reflected.estimate(n),
            transmittance: self.transmitted.estimate(n),
            absorptance,
            retro_brdf: retro,
            mirror_brdf: mirror,
            retro_index,
        }
    }
}

/// Everything that is counted; `[bin * bands + band]`, totals per band and last their mean over the bands.
pub(super) struct Counters {
    pub(super) paths: u64,
    /// Paths among them whose end nobody knows.
    pub(super) cut_off: u64,
    pub(super) grid: Vec<Sums>,
    pub(super) scan: Vec<Sums>,
    pub(super) totals: Vec<TotalSums>,
}

impl Counters {
    pub(super) fn new(gonio: &Goniophotometer) -> Self {
        let bands = gonio.bands_nm.len();
        Self {
            paths: 0,
            cut_off: 0,
            grid: vec![Sums::default(); gonio.exitant.len() * bands],
            scan: vec![Sums::default(); gonio.scan.len() * bands],
            totals: vec![TotalSums::default(); bands + 1],
        }
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.paths += other.paths;
        self.cut_off += other.cut_off;
        self.grid.iter_mut().zip(&other.grid).for_each(|(a, b)| a.merge(b));
        self.scan.iter_mut().zip(&other.scan).for_each(|(a, b)| a.merge(b));
        self.totals.iter_mut().zip(&other.totals).for_each(|(a, b)| a.merge(b));
    }

    pub(super) fn into_incidence(self, gonio: &Goniophotometer, incident_deg: f64) -> Incidence {
        let bands = gonio.bands_nm.len();
        let n = self.paths as f64;
        let at_normal = incident_deg == 0.0;
        let bsdf = |sums: &Sums, band: usize, measure_sr: f64| {
            let mut mean = sums.estimate(n);
            if sums.sum == 0.0 {
                // Nothing seen is not nothing there: the error of one path of mean weight.
                let t = &self.totals[band];
                let weight = (t.reflected.sum + t.transmitted.sum) / t.scattered.max(1) as f64;
                mean.standard_error = weight / n;
            }
            mean.scaled(1.0 / measure_sr)
        };
        let by_band = |sums: &[Sums], measure_sr: &dyn Fn(usize) -> f64| -> Vec<Estimate> {
            let bins = sums.len() / bands;
            (0..bands * bins)
                .map(|i| (i / bins, i % bins))
                .map(|(band, bin)| bsdf(&sums[bin * bands + band], band, measure_sr(bin)))
                .collect()
        };
        Incidence {
            incident_deg,
            mean: self.totals[bands].totals(n, at_normal),
            bands: self.totals[..bands].iter().map(|t| t.totals(n, at_normal)).collect(),
            ledgers: self.totals[..bands]
                .iter()
                .map(|t| Ledger {
                    incoming: n,
                    reflected: t.reflected.sum,
                    transmitted: t.transmitted.sum,
                    absorbed: t.absorbed.sum,
                    cut_off: self.cut_off as f64,
                })
                .collect(),
            bsdf: by_band(&self.grid, &|bin| gonio.exitant.projected_solid_angle_sr(bin)),
            scan: by_band(&self.scan, &|bin| gonio.scan.projected_solid_angle_sr(bin)),
        }
    }
}

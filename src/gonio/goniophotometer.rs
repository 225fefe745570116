//! The virtual goniophotometer: a lamp, a sample, and counters around it.
//!
//! Model: N paths from the lamp's direction; each leaves in a direction w with a weight W or is absorbed.
//!
//! - BSDF in bin B = sum of W over paths in B / (N * integral over B of |cos|), 1/sr
//! - standard error = sqrt((mean of W^2 - (mean of W)^2) / (N - 1)) / the same integral
//! - reflectance, transmittance = sum of W on the lit, the other side / N
//! - absorptance = sum of (1 - W) / N, summed path by path, so that the ledger in = reflected + transmitted
//!   + absorbed checks that no path was lost
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | theta_i | `incident_deg` | deg | 0, 30, 60 |
//! | N | `rays` (per incidence) | | 1e6 |
//! | wavelengths | `bands_nm` | nm | 550 |
//! | bins | `exitant`, `scan` | deg | 5 x 10, 2.5 x +-6 |
//! | sample turned about its normal from path to path | `spin` | | no |
//!
//! Path k of incidence i draws from `Sampler::new(seed, (i, side), k)`; chunks of fixed size are summed in
//! their order, so the table has the same bytes at any number of threads (`same_at_any_thread_count`). More
//! than `LANES` bands are measured in groups that share their random numbers; a white walk serves all at once
//! ([`super::white_walks`]).
//!
//! Limits: 0 <= theta_i < 90 deg (`rejects_bad_input`); a regular lattice has a direction, over which `spin` averages
//! (`spin_is_the_mean_over_the_lamps_azimuths`); a bin's value is its average, which differs from
//! the BSDF at its centre where a lobe is narrower than the bin (`bins_match_the_average_of_eval`).

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use rayon::prelude::*;

use super::counters::Counters;
use super::lamp::Lamp;
use super::{ExitantGrid, GonioTable, Incidence, PlaneScan};
use crate::bsdf::Scatter;
use crate::geometry::Side;
use crate::{Error, Result};

/// Bins x bands that one measurement may have.
const MAX_COUNTERS: usize = 4_000_000;

/// The instrument and its settings.
#[derive(Clone, Debug, PartialEq)]
pub struct Goniophotometer {
    /// Angles of the lamp from the normal of the lit side, degrees.
    pub incident_deg: Vec<f64>,
    /// The lit side.
    pub side: Side,
    /// Paths per incidence.
    pub rays: u64,
    /// Seed of the paths.
    pub seed: u64,
    /// Wavelengths, nm.
    pub bands_nm: Vec<f64>,
    /// Bins of the exitant directions.
    pub exitant: ExitantGrid,
    /// Bins of the plane of incidence.
    pub scan: PlaneScan,
    /// Turn the sample about its normal from path to path: the mean over all azimuths, which is what fits assume of a
    /// sample whose cells' rows nobody knows.
    pub spin: bool,
}

impl Default for Goniophotometer {
    fn default() -> Self {
        Self {
            incident_deg: vec![0.0, 30.0, 60.0],
            side: Side::Adaxial,
            rays: 1_000_000,
            seed: 0,
            bands_nm: vec![550.0],
            exitant: ExitantGrid::default(),
            scan: PlaneScan::default(),
            spin: false,
        }
    }
}

/// Called now and then, from any thread, with (paths done, paths in all); `Break` stops the measurement.
pub type Progress<'a> = &'a (dyn Fn(u64, u64) -> ControlFlow<()> + Sync);

/// Follows one path of a lamp and counts it.
pub(super) type Follow<'a> = &'a (dyn Fn(&Lamp, u64, &mut Counters) -> Result<()> + Sync);

impl Goniophotometer {
    /// Checks the settings; errors name the key.
    pub fn validate(&self) -> Result<()> {
        if self.incident_deg.is_empty() {
            return Err(Error::invalid("gonio.incident_deg", "needs at least one angle"));
        }
        for (i, &d) in self.incident_deg.iter().enumerate() {
            if !(0.0..90.0).contains(&d) {
                let what = format!("{d} is not in 0-90 deg (90 excluded)");
                return Err(Error::invalid("gonio.incident_deg", what));
            }
            if self.incident_deg[..i].contains(&d) {
                return Err(Error::invalid("gonio.incident_deg", format!("{d} is given twice")));
            }
        }
        if self.rays < 2 {
            return Err(Error::invalid("gonio.rays", "needs at least 2 rays for a standard error"));
        }
        if self.bands_nm.is_empty() {
            return Err(Error::invalid("gonio.bands_nm", "needs at least one wavelength"));
        }
        for (i, &l) in self.bands_nm.iter().enumerate() {
            if !(100.0..=10_000.0).contains(&l) {
                return Err(Error::invalid("gonio.bands_nm", format!("{l} is not in 100-10000 nm")));
            }
            if self.bands_nm[..i].contains(&l) {
                return Err(Error::invalid("gonio.bands_nm", format!("{l} is given twice")));
            }
        }
        self.exitant.validate()?;
        self.scan.validate()?;
        let counters = self.counters();
        if counters > MAX_COUNTERS {
            let what = format!("{counters} bins x bands; at most {MAX_COUNTERS}");
            return Err(Error::invalid("gonio.theta_step_deg", what));
        }
        Ok(())
    }

    fn counters(&self) -> usize {
        (self.exitant.len() + self.scan.len()) * self.bands_nm.len()
    }

    /// Paths per unit of parallel work: enough to outweigh clearing and adding the counters.
    fn chunk(&self) -> u64 {
        (self.counters() as u64 / 4).max(8192)
    }

    /// Units whose counters are held at once: a bound on memory, without effect on the result.
    fn batch(&self) -> u64 {
        (MAX_COUNTERS / self.counters().max(1)).clamp(4, 32) as u64
    }

    /// Measures a sample. The result depends on the settings and the sample only.
    pub fn measure(&self, sample: &dyn Scatter, progress: Progress) -> Result<GonioTable> {
        self.run(&|lamp, ray, counters| lamp.follow(ray, sample, counters), progress)
    }

    /// The table of paths that `follow` follows and counts one by one.
    pub(super) fn run(&self, follow: Follow, progress: Progress) -> Result<GonioTable> {
        self.validate()?;
        let done = AtomicU64::new(0);
        let incidences = (0..self.incident_deg.len())
            .map(|i| self.measure_incidence(i, follow, &done, progress))
            .collect::<Result<Vec<_>>>()?;
        Ok(GonioTable {
            sample: String::new(),
            description: String::new(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            side: self.side,
            rays: self.rays,
            seed: self.seed,
            bands_nm: self.bands_nm.clone(),
            grid: self.exitant,
            scan: self.scan,
            incidences,
        })
    }

    fn measure_incidence(
        &self,
        index: usize,
        follow: Follow,
        done: &AtomicU64,
        progress: Progress,
    ) -> Result<Incidence> {
        let lamp = Lamp::new(self, index);
        let total = self.rays.saturating_mul(self.incident_deg.len() as u64);
        let cancelled = AtomicBool::new(false);
        let (chunk_rays, batch_chunks) = (self.chunk(), self.batch());
        let chunks = self.rays.div_ceil(chunk_rays);
        let mut counters = Counters::new(self);
        for batch in (0..chunks).step_by(batch_chunks as usize) {
            let parts: Vec<Result<Counters>> = (batch..(batch + batch_chunks).min(chunks))
                .into_par_iter()
                .map(|chunk| {
                    if cancelled.load(Ordering::Relaxed) {
                        return Err(Error::Cancelled);
                    }
                    let rays = chunk * chunk_rays..((chunk + 1) * chunk_rays).min(self.rays);
                    let count = rays.end - rays.start;
                    let mut part = Counters::new(self);
                    for ray in rays {
                        follow(&lamp, ray, &mut part)?;
                    }
                    let now = done.fetch_add(count, Ordering::Relaxed) + count;
                    if progress(now, total).is_break() {
                        cancelled.store(true, Ordering::Relaxed);
                    }
                    Ok(part)
                })
                .collect();
            // Floating-point sums depend on their order: it is that of the chunks.
            for part in parts {
                counters.add(&part?);
            }
            if cancelled.load(Ordering::Relaxed) {
                return Err(Error::Cancelled);
            }
        }
        Ok(counters.into_incidence(self, self.incident_deg[index]))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_1_PI;

    use glam::Vec3;

    use super::*;
    use crate::bsdf::{Bsdf, DiffuseTransmission, Lambert, Phong};
    use crate::gonio::Estimate;
    use crate::math::Sampler;
    use crate::math::frame::spherical;
    use crate::math::stats::{normal_quantile, sidak};
    use crate::spectrum::{LANES, SampledSpectrum, SampledWavelengths, Spectrum};

    /// Two-sided z limit of one of `tests` tests that fail by chance once in 1000 altogether.
    fn z_limit(tests: usize) -> f64 {
        -normal_quantile(sidak(0.001, tests) / 2.0)
    }

    fn gonio(incident_deg: &[f64], rays: u64) -> Goniophotometer {
        Goniophotometer { incident_deg: incident_deg.to_vec(), rays, seed: 11, ..Default::default() }
    }

    fn run(g: &Goniophotometer, sample: &dyn Scatter) -> GonioTable {
        g.measure(sample, &|_, _| ControlFlow::Continue(())).unwrap()
    }

    fn z(e: Estimate, expected: f64) -> f64 {
        (e.value - expected).abs() / e.standard_error
    }

    /// Sends all light 12.5 degrees from the normal along the sample's x axis, more the nearer the lamp's azimuth is.
    struct Grooves;

    impl Scatter for Grooves {
        fn scatter(
            &self,
            wi: Vec3,
            _: &SampledWavelengths,
            _: &mut crate::math::Sampler,
        ) -> Option<(Vec3, SampledSpectrum)> {
            let along = (wi.x / wi.truncate().length()).powi(2);
            Some((spherical(12.5f32.to_radians(), 0.0), SampledSpectrum::splat(along)))
        }
    }

    #[test]
    fn spin_is_the_mean_over_the_lamps_azimuths() {
        let fixed = gonio(&[40.0], 20_000);
        let spun = Goniophotometer { spin: true, ..fixed.clone() };
        // The mean of cos^2 is one half; without spin the lamp stands along the grooves.
        assert!((run(&fixed, &Grooves).incidences[0].mean.reflectance.value - 1.0).abs() < 1e-6);
        let table = run(&spun, &Grooves);
        assert!((table.incidences[0].mean.reflectance.value - 0.5).abs() < 1e-3);
        // Seen from the lamp the light leaves at azimuth -p where the sample was turned by p: f(azimuth) goes like cos^2.
        let at = |phi: f64| {
            let bin = (0..table.grid.len()).find(|&b| {
                let (t, p) = table.grid.centre_deg(b);
                (t - 12.5).abs() < 3.0 && (p - phi).abs() < 1e-9
            });
            table.incidences[0].bsdf[bin.unwrap()].value
        };
        assert!(at(90.0) < 0.02 * at(0.0), "{} {}", at(90.0), at(0.0));
        assert!((at(180.0) / at(0.0) - 1.0).abs() < 0.05);
        assert!((at(60.0) / at(0.0) - 0.25).abs() < 0.03);
    }

    #[test]
    fn flat_lambert() {
        let g = gonio(&[0.0, 45.0, 80.0], 300_000);
        let table = run(&g, &Lambert::new(0.5.into()).unwrap());
        assert!(table.ledger_error() < 1e-9, "{}", table.ledger_error());
        for i in &table.incidences {
            assert!(z(i.mean.reflectance, 0.5) < 3.0, "{:?}", i.mean);
            assert!(z(i.mean.absorptance, 0.5) < 3.0);
            assert_eq!(i.mean.transmittance.value, 0.0);
            assert!(z(i.mean.retro_brdf, 0.5 * FRAC_1_PI) < 3.0, "{:?}", i.mean);
            let index = i.mean.retro_index.unwrap();
            assert!(i.incident_deg == 0.0 && index.value == 1.0 || z(index, 1.0) < 3.0, "{index:?}");
            for (bin, &e) in i.bsdf.iter().enumerate() {
                let transmission = g.exitant.centre_deg(bin).0 > 90.0;
                assert!(
                    z(e, if transmission { 0.0 } else { 0.5 * FRAC_1_PI }) < z_limit(i.bsdf.len()),
                    "{bin} {e:?}"
                );
            }
            for (bin, &e) in i.scan.iter().enumerate() {
                let transmission = g.scan.centre_deg(bin).abs() > 90.0;
                assert!(
                    z(e, if transmission { 0.0 } else { 0.5 * FRAC_1_PI }) < z_limit(i.scan.len()),
                    "{bin} {e:?}"
                );
            }
        }
    }

    /// Average of the BSDF over a bin, weighted by |cos|, by the midpoint rule.
    fn average(g: &Goniophotometer, sample: &dyn Bsdf, wi: Vec3, bin: usize) -> f64 {
        let lambda = SampledWavelengths::given([550.0; LANES]);
        let (theta, phi) = g.exitant.centre_deg(bin);
        let (mut sum, mut norm, n) = (0.0, 0.0, 24);
        for i in 0..n {
            let t = theta + g.exitant.theta_step_deg * ((f64::from(i) + 0.5) / f64::from(n) - 0.5);
            for j in 0..n {
                let p = phi + g.exitant.phi_step_deg * ((f64::from(j) + 0.5) / f64::from(n) - 0.5);
                let w = spherical(t.to_radians() as f32, p.to_radians() as f32);
                let measure = t.to_radians().sin() * f64::from(w.z.abs());
                sum += measure * f64::from(sample.eval(w, wi, &lambda)[0]);
                norm += measure;
            }
        }
        sum / norm
    }

    #[test]
    fn bins_match_the_average_of_eval() {
        let phong = Phong::new(0.2.into(), 0.5.into(), 30.0).unwrap();
        let g = gonio(&[40.0], 400_000);
        let table = run(&g, &phong);
        assert!(table.ledger_error() < 1e-9);
        let wi = spherical(40f32.to_radians(), 0.0);
        let (mut reflectance, mut chi2) = (0.0, 0.0);
        let bins = g.exitant.len() / 2;
        for bin in 0..bins {
            let expected = average(&g, &phong, wi, bin);
            let e = table.incidences[0].bsdf[bin];
            assert!(z(e, expected) < z_limit(bins), "{:?}: {e:?}, {expected}", g.exitant.centre_deg(bin));
            chi2 += z(e, expected).powi(2);
            reflectance += expected * g.exitant.projected_solid_angle_sr(bin);
        }
        // Errors are of the size they claim, or smaller by stratification.
        assert!((0.3..1.2).contains(&(chi2 / bins as f64)), "{}", chi2 / bins as f64);
        assert!(z(table.incidences[0].mean.reflectance, reflectance) < 3.0);
    }

    #[test]
    fn gloss_prefers_the_mirror() {
        let phong = Phong::new(0.2.into(), 0.5.into(), 30.0).unwrap();
        let table = run(&gonio(&[60.0], 100_000), &phong);
        let mean = &table.incidences[0].mean;
        let index = mean.retro_index.unwrap();
        assert!(index.value + 5.0 * index.standard_error < 1.0, "{index:?}");
        assert!(z(mean.retro_brdf, 0.2 * FRAC_1_PI) < 4.0, "{mean:?}");
    }

    #[test]
    fn both_sides_of_a_translucent_sheet() {
        let sheet = DiffuseTransmission::new(0.3.into(), 0.6.into(), 0.2.into()).unwrap();
        for (side, r) in [(Side::Adaxial, 0.3), (Side::Abaxial, 0.6)] {
            let g = Goniophotometer { side, ..gonio(&[30.0], 300_000) };
            let table = run(&g, &sheet);
            let i = &table.incidences[0];
            assert!(table.ledger_error() < 1e-9);
            assert!(z(i.mean.reflectance, r) < 3.0 && z(i.mean.transmittance, 0.2) < 3.0, "{:?}", i.mean);
            assert!(z(i.mean.absorptance, 0.8 - r) < 3.0);
            for (bin, &e) in i.bsdf.iter().enumerate() {
                let share = if g.exitant.centre_deg(bin).0 > 90.0 { 0.2 } else { r };
                assert!(z(e, share * FRAC_1_PI) < z_limit(i.bsdf.len()), "{bin} {e:?}");
            }
        }
    }

    #[test]
    fn same_at_any_thread_count() {
        let phong = Phong::new(0.2.into(), 0.5.into(), 30.0).unwrap();
        let g = gonio(&[0.0, 60.0], 100_001);
        let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        let tables = [1, 2, 5].map(|n| pool(n).install(|| run(&g, &phong)));
        assert_eq!(tables[0], tables[1]);
        assert_eq!(tables[0], tables[2]);
        assert_ne!(tables[0], run(&Goniophotometer { seed: 12, ..g }, &phong));
    }

    #[test]
    fn bands_are_measured_apart() {
        // More bands than lanes: two groups. The reflectance is a ramp over wavelength.
        let ramp = Spectrum::from_fn(|nm| (nm - 380.0) / 500.0);
        let bands_nm: Vec<f64> = (0..11).map(|i| 400.0 + 30.0 * f64::from(i)).collect();
        let g = Goniophotometer { bands_nm: bands_nm.clone(), ..gonio(&[20.0], 50_000) };
        let table = run(&g, &Lambert::new(ramp).unwrap());
        let i = &table.incidences[0];
        for (band, nm) in bands_nm.iter().enumerate() {
            let r = (nm - 380.0) / 500.0;
            assert!((i.bands[band].reflectance.value - r).abs() < 1e-6);
            let w = spherical(0.4, 2.0);
            let f = table.bsdf(20.0, w, band).unwrap();
            assert!((f / (r * FRAC_1_PI) - 1.0).abs() < 0.2, "{nm}: {f}");
        }
        assert!((i.mean.reflectance.value - 0.34).abs() < 1e-6);
        assert_eq!(table.bsdf(20.0, Vec3::Z, 11), None);
        let json = serde_json::to_value(table.summary()).unwrap();
        assert_eq!(json["incidences"][0]["incident_deg"], 20.0);
        assert_eq!(json["incidences"][0]["bands"][10]["wavelength_nm"], 700.0);
        assert!(json["incidences"][0]["retro_index"].is_f64());
        assert!(json["incidences"][0]["reflectance_se"].is_f64());
    }

    #[test]
    fn look_up_interpolates() {
        let sheet = DiffuseTransmission::new(0.4.into(), 0.4.into(), 0.1.into()).unwrap();
        let mut table = run(&gonio(&[0.0, 60.0], 20_000), &sheet);
        // A table with known values: theta + the lamp's angle, on the reflection side.
        let grid = table.grid;
        for i in &mut table.incidences {
            for (bin, e) in i.bsdf.iter_mut().enumerate() {
                let theta = grid.centre_deg(bin).0;
                e.value = if theta < 90.0 { theta + i.incident_deg } else { -1.0 };
            }
        }
        for (lamp, theta, phi) in [(0.0, 40.0, 0.3), (15.0, 33.0, -3.0), (60.0, 87.4, 3.1), (50.0, 2.6, 6.2)]
        {
            let w = spherical(f64::to_radians(theta) as f32, phi);
            let f = table.bsdf(lamp, w, 0).unwrap();
            assert!((f - theta - lamp).abs() < 1e-3, "{lamp} {theta}: {f}");
        }
        // Not across the horizon, and the nearest incidence outside the range.
        assert_eq!(table.bsdf(0.0, spherical(91f32.to_radians(), 0.0), 0), Some(-1.0));
        assert_eq!(table.bsdf(80.0, spherical(89.9f32.to_radians(), 0.0), 0), Some(147.5));
    }

    /// Loses a path without saying so, makes NaN, or creates energy.
    struct Faulty(Vec3, f32);

    impl Scatter for Faulty {
        fn scatter(
            &self,
            _wi: Vec3,
            _lambda: &SampledWavelengths,
            _sampler: &mut Sampler,
        ) -> Option<(Vec3, SampledSpectrum)> {
            Some((self.0, SampledSpectrum::splat(self.1)))
        }
    }

    #[test]
    fn faults_are_not_hidden() {
        let g = gonio(&[30.0], 1000);
        for (w, weight) in [(Vec3::NAN, 0.5), (Vec3::Z, f32::NAN), (Vec3::Z, f32::INFINITY), (Vec3::Z, -0.1)]
        {
            assert!(g.measure(&Faulty(w, weight), &|_, _| ControlFlow::Continue(())).is_err());
        }
        // More light out than in shows as negative absorptance, not as a corrected total.
        let table = run(&g, &Faulty(Vec3::Z, 1.5));
        assert!((table.incidences[0].mean.absorptance.value + 0.5).abs() < 1e-9);
        assert!(table.incidences[0].mean.retro_index.is_none());
        assert!(
            (table.incidences[0].bsdf[0].value * g.exitant.projected_solid_angle_sr(0) - 1.5).abs() < 1e-9
        );
    }

    #[test]
    fn stops_when_asked() {
        let g = gonio(&[0.0], 10_000_000);
        let sample = Lambert::new(0.5.into()).unwrap();
        let result = g.measure(&sample, &|done, total| {
            assert_eq!(total, 10_000_000);
            if done > 50_000 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert!(matches!(result, Err(Error::Cancelled)));
    }

    #[test]
    fn rejects_bad_input() {
        let ok = gonio(&[0.0], 1000);
        ok.validate().unwrap();
        let coarse = ExitantGrid { theta_step_deg: 7.0, phi_step_deg: 10.0 };
        let fine = ExitantGrid { theta_step_deg: 0.01, phi_step_deg: 0.01 };
        for bad in [
            Goniophotometer { incident_deg: vec![], ..ok.clone() },
            Goniophotometer { incident_deg: vec![90.0], ..ok.clone() },
            Goniophotometer { incident_deg: vec![-1.0], ..ok.clone() },
            Goniophotometer { incident_deg: vec![f64::NAN], ..ok.clone() },
            Goniophotometer { incident_deg: vec![10.0, 10.0], ..ok.clone() },
            Goniophotometer { rays: 0, ..ok.clone() },
            Goniophotometer { bands_nm: vec![], ..ok.clone() },
            Goniophotometer { bands_nm: vec![f64::INFINITY], ..ok.clone() },
            Goniophotometer { exitant: coarse, ..ok.clone() },
            Goniophotometer { exitant: fine, ..ok.clone() },
        ] {
            assert!(matches!(bad.validate(), Err(Error::Invalid { .. })), "{bad:?}");
        }
    }
}

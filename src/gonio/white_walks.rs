//! The goniophotometer on white walks: all bands from one walk.
//!
//! Model: a walk that left after the ways l_r through the regions counts in band b with the weight
//!
//! ```text
//! w_b = exp(-sum over regions of mu_br l_r)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | mu_br | `absorption_per_um[b][r]` | 1/um |
//! | l_r | [`Exit::path_um`](crate::micro::white::Exit) | um |
//!
//! Everything else is [`Goniophotometer::measure`]'s: bins, errors, totals, `spin`, the same bytes at any number of threads.
//! Walk k of an incidence draws from `Stream::new(seed, (incidence, side), k)`. A walk that was cut off has no end: it is
//! counted in [`Ledger::cut_off`](super::Ledger) and in none of the totals, so reflectance, transmittance and absorptance
//! then add up to less than one.
//!
//! Guarded by `one_walk_serves_every_band`, `agrees_with_measure`, `cut_off_walks_are_not_absorbed` and
//! `both_sides_and_spin`. Source: our reading of white Monte Carlo (see [`crate::micro::white`]).

use super::counters::{Counters, PathTotals};
use super::goniophotometer::Progress;
use super::lamp::Lamp;
use super::{GonioTable, Goniophotometer};
use crate::math::Stream;
use crate::micro::tissue::REGION_NAMES;
use crate::micro::white::{End, WhiteScatter};
use crate::micro::{REGIONS, Tissue};
use crate::{Error, Result};

impl Goniophotometer {
    /// Measures a sample whose walks serve every band: `absorption_per_um[b]` are the regions' absorption coefficients in
    /// `bands_nm[b]`.
    pub fn measure_walks(
        &self,
        sample: &dyn WhiteScatter,
        absorption_per_um: &[[f64; REGIONS]],
        progress: Progress,
    ) -> Result<GonioTable> {
        if absorption_per_um.len() != self.bands_nm.len() {
            let what =
                format!("{} bands, but absorption in {}", self.bands_nm.len(), absorption_per_um.len());
            return Err(Error::invalid("gonio.bands_nm", what));
        }
        for (mu, nm) in absorption_per_um.iter().zip(&self.bands_nm) {
            for (mu, region) in mu.iter().zip(REGION_NAMES) {
                if !(mu.is_finite() && *mu >= 0.0) {
                    let what = format!("absorption coefficient {mu} 1/um at {nm} nm");
                    return Err(Error::invalid(format!("tissue.{region}"), what));
                }
            }
        }
        self.run(&|lamp, ray, counters| lamp.follow_walk(ray, sample, absorption_per_um, counters), progress)
    }

    /// The regions' absorption coefficients of a tissue in the bands, as [`Goniophotometer::measure_walks`] takes them.
    pub fn absorption_per_um(&self, tissue: &Tissue) -> Result<Vec<[f64; REGIONS]>> {
        self.bands_nm.iter().map(|&nm| tissue.absorption_per_um(nm)).collect()
    }
}

impl Lamp<'_> {
    /// Follows one white walk and counts it in every band.
    fn follow_walk(
        &self,
        ray: u64,
        sample: &dyn WhiteScatter,
        absorption_per_um: &[[f64; REGIONS]],
        counters: &mut Counters,
    ) -> Result<()> {
        let family = u64::from(2 * self.index + self.side_index());
        let mut stream = Stream::new(self.gonio.seed, family, ray);
        let spin = self.spin(ray);
        counters.paths += 1;
        let exit = match sample.walk(self.wi(spin).as_dvec3().normalize(), &mut stream) {
            End::Left(exit) => exit,
            End::CutOff => {
                counters.cut_off += 1;
                return Ok(());
            }
        };
        if !(exit.direction.is_finite() && exit.path_um.iter().all(|l| l.is_finite() && *l >= 0.0)) {
            return Err(Error::invalid("sample", format!("a walk ended with {exit:?}")));
        }
        let place = self.place(exit.direction.as_vec3(), spin);
        let bands = absorption_per_um.len();
        let mut mean = PathTotals::default();
        for (band, mu) in absorption_per_um.iter().enumerate() {
            mean.add_scaled(&counters.count(&place, band, exit.remaining(mu)), 1.0 / bands as f64);
        }
        counters.totals[bands].add(&mean);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_1_PI;
    use std::ops::ControlFlow;

    use glam::DVec3;

    use super::*;
    use crate::bsdf::Scatter;
    use crate::geometry::Side;
    use crate::gonio::{Estimate, ExitantGrid};
    use crate::math::Sampler;
    use crate::micro::white::Exit;
    use crate::spectrum::{SampledSpectrum, SampledWavelengths};

    /// A sheet of closed form: light from above is reflected by the surface (a quarter), from below a half; the rest goes
    /// through, after an exponentially distributed way of mean 20 um in the spongy layer. All of it leaves by Lambert's law.
    struct Sheet;

    const MEAN_UM: f64 = 20.0;

    impl Sheet {
        fn lambert(u: f64, v: f64) -> DVec3 {
            let (r, a) = (u.sqrt(), v * std::f64::consts::TAU);
            DVec3::new(r * a.cos(), r * a.sin(), (1.0 - u).sqrt())
        }

        fn surface_share(above: bool) -> f64 {
            if above { 0.25 } else { 0.5 }
        }

        fn end(wi: DVec3, u: [f64; 4]) -> Exit {
            let lit = wi.z.signum();
            let out = Self::lambert(u[0], u[1]) * lit;
            if u[2] < Self::surface_share(wi.z > 0.0) {
                return Exit { direction: out, path_um: [0.0; REGIONS] };
            }
            let way = -MEAN_UM * (1.0 - u[3]).ln();
            Exit { direction: -out, path_um: [0.0, 0.0, way, 0.0] }
        }
    }

    impl WhiteScatter for Sheet {
        fn walk(&self, wi: DVec3, stream: &mut Stream) -> End {
            End::Left(Self::end(wi, std::array::from_fn(|_| stream.next())))
        }
    }

    /// The same sheet as a sample that knows its absorption, for the other instrument.
    struct Coloured(Vec<[f64; REGIONS]>);

    impl Scatter for Coloured {
        fn scatter(
            &self,
            wi: glam::Vec3,
            lambda: &SampledWavelengths,
            sampler: &mut Sampler,
        ) -> Option<(glam::Vec3, SampledSpectrum)> {
            let (a, b) = (sampler.next_2d(), sampler.next_2d());
            let exit = Sheet::end(wi.as_dvec3(), [a.x, a.y, b.x, b.y].map(f64::from));
            // Bands are 400 nm, 450 nm ...
            let band = |nm: f32| (((nm - 400.0) / 50.0) as usize).min(self.0.len() - 1);
            let weights = lambda.lambda_nm().map(|nm| exit.remaining(&self.0[band(nm)]) as f32);
            Some((exit.direction.as_vec3(), SampledSpectrum(weights)))
        }
    }

    /// 12 bands: more than the lanes of a spectral path.
    fn absorption() -> Vec<[f64; REGIONS]> {
        (0..12).map(|b| [0.0, 1.0, 0.02 * f64::from(b), 0.5]).collect()
    }

    fn gonio(side: Side) -> Goniophotometer {
        Goniophotometer {
            incident_deg: vec![0.0, 50.0],
            side,
            rays: 60_000,
            seed: 5,
            bands_nm: (0..12).map(|b| 400.0 + 50.0 * f64::from(b)).collect(),
            // Many walks in every bin, so that errors are normal.
            exitant: ExitantGrid { theta_step_deg: 30.0, phi_step_deg: 60.0 },
            ..Default::default()
        }
    }

    fn run(g: &Goniophotometer) -> GonioTable {
        g.measure_walks(&Sheet, &absorption(), &|_, _| ControlFlow::Continue(())).unwrap()
    }

    fn z(e: Estimate, expected: f64) -> f64 {
        (e.value - expected).abs() / e.standard_error.max(1e-12)
    }

    #[test]
    fn one_walk_serves_every_band() {
        for (side, surface) in [(Side::Adaxial, 0.25), (Side::Abaxial, 0.5)] {
            let table = run(&gonio(side));
            assert!(table.ledger_error() < 1e-9 && table.cut_off() == 0);
            for i in &table.incidences {
                for (b, t) in i.bands.iter().enumerate() {
                    // The mean of exp(-mu l) over exponential ways.
                    let through = (1.0 - surface) / (1.0 + 0.02 * b as f64 * MEAN_UM);
                    assert!(z(t.reflectance, surface) < 4.0, "{b}: {:?}", t.reflectance);
                    assert!(b == 0 || z(t.transmittance, through) < 4.0, "{b}: {:?}", t.transmittance);
                    let sum = t.reflectance.value + t.transmittance.value + t.absorptance.value;
                    assert!((sum - 1.0).abs() < 1e-9);
                }
                // Lambertian on both sides: the share over pi in every bin.
                let bins = table.grid.len();
                for (bin, &e) in i.bsdf[11 * bins..].iter().enumerate() {
                    let through = table.grid.centre_deg(bin).0 > 90.0;
                    let share = if through { (1.0 - surface) / 5.4 } else { surface };
                    assert!(z(e, share * FRAC_1_PI) < 4.5, "{bin}: {e:?}");
                }
            }
        }
    }

    #[test]
    fn agrees_with_measure() {
        let g =
            Goniophotometer { bands_nm: gonio(Side::Adaxial).bands_nm[..8].to_vec(), ..gonio(Side::Adaxial) };
        let mu = absorption()[..8].to_vec();
        let walks = g.measure_walks(&Sheet, &mu, &|_, _| ControlFlow::Continue(())).unwrap();
        let paths = g.measure(&Coloured(mu), &|_, _| ControlFlow::Continue(())).unwrap();
        for (a, b) in walks.incidences.iter().zip(&paths.incidences) {
            for (a, b) in a.bands.iter().zip(&b.bands).chain([(&a.mean, &b.mean)]) {
                for (a, b) in [
                    (a.reflectance, b.reflectance),
                    (a.transmittance, b.transmittance),
                    (a.absorptance, b.absorptance),
                    (a.retro_brdf, b.retro_brdf),
                ] {
                    let error = a.standard_error.hypot(b.standard_error).max(1e-6);
                    assert!((a.value - b.value).abs() < 4.0 * error, "{a:?} {b:?}");
                    assert!((a.standard_error - b.standard_error).abs() < 0.05 * a.standard_error + 1e-7);
                }
            }
            let chi2: f64 = a
                .bsdf
                .iter()
                .zip(&b.bsdf)
                .map(|(a, b)| {
                    (a.value - b.value).powi(2) / (a.standard_error.powi(2) + b.standard_error.powi(2))
                })
                .sum();
            assert!((0.3..1.7).contains(&(chi2 / a.bsdf.len() as f64)), "{}", chi2 / a.bsdf.len() as f64);
        }
    }

    /// Gives up every fourth walk.
    struct Lazy;

    impl WhiteScatter for Lazy {
        fn walk(&self, wi: DVec3, stream: &mut Stream) -> End {
            if stream.next() < 0.25 { End::CutOff } else { Sheet.walk(wi, stream) }
        }
    }

    #[test]
    fn cut_off_walks_are_not_absorbed() {
        let g = gonio(Side::Adaxial);
        let table = g.measure_walks(&Lazy, &absorption(), &|_, _| ControlFlow::Continue(())).unwrap();
        let share = table.cut_off() as f64 / (2.0 * g.rays as f64);
        assert!((share - 0.25).abs() < 0.01, "{share}");
        assert!(table.ledger_error() < 1e-9);
        for i in &table.incidences {
            let cut = i.ledgers[0].cut_off / g.rays as f64;
            // Nothing absorbs in the first band.
            assert!(i.bands[0].absorptance.value.abs() < 1e-12);
            for t in &i.bands {
                let sum = t.reflectance.value + t.transmittance.value + t.absorptance.value;
                assert!((sum + cut - 1.0).abs() < 1e-9);
            }
        }
        assert_eq!(serde_json::to_value(table.summary()).unwrap()["cut_off"], table.cut_off());
    }

    /// Sends all light along x of the sample, on the lit side.
    struct Grooves;

    impl WhiteScatter for Grooves {
        fn walk(&self, wi: DVec3, _: &mut Stream) -> End {
            let direction = DVec3::new(0.6, 0.0, 0.8 * wi.z.signum());
            End::Left(Exit { direction, path_um: [0.0; REGIONS] })
        }
    }

    #[test]
    fn both_sides_and_spin() {
        for side in [Side::Adaxial, Side::Abaxial] {
            let fixed = Goniophotometer { incident_deg: vec![30.0], rays: 20_000, ..gonio(side) };
            for (spin, lit) in [(false, 1), (true, fixed.exitant.phis())] {
                let g = Goniophotometer { spin, ..fixed.clone() };
                let table =
                    g.measure_walks(&Grooves, &absorption(), &|_, _| ControlFlow::Continue(())).unwrap();
                let bins = table.grid.len();
                let seen = table.incidences[0].bsdf[..bins].iter().filter(|e| e.value > 0.0).count();
                assert_eq!(seen, lit, "{side:?} {spin}");
                assert_eq!(table.incidences[0].mean.reflectance.value, 1.0);
            }
        }
    }

    #[test]
    fn same_at_any_thread_count() {
        let g = gonio(Side::Adaxial);
        let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        let tables = [1, 3].map(|n| pool(n).install(|| run(&g)));
        assert_eq!(tables[0], tables[1]);
        assert_ne!(tables[0], run(&Goniophotometer { seed: 6, ..g }));
    }

    /// Ends nowhere.
    struct Faulty;

    impl WhiteScatter for Faulty {
        fn walk(&self, _: DVec3, _: &mut Stream) -> End {
            End::Left(Exit { direction: DVec3::NAN, path_um: [0.0; REGIONS] })
        }
    }

    #[test]
    fn rejects_bad_input() {
        let go = |_, _| ControlFlow::Continue(());
        let g = gonio(Side::Adaxial);
        assert!(g.measure_walks(&Faulty, &absorption(), &go).is_err());
        assert!(g.measure_walks(&Sheet, &absorption()[1..], &go).is_err());
        for bad in [-1.0, f64::NAN, f64::INFINITY] {
            let mut mu = absorption();
            mu[3][2] = bad;
            let e = g.measure_walks(&Sheet, &mu, &go).unwrap_err().to_string();
            assert!(e.starts_with("tissue.spongy"), "{e}");
        }
    }
}

mod cells;

use std::ops::ControlFlow;

use super::*;
use crate::gonio::Part;
use crate::math::stats::{normal_quantile, sidak};
use crate::micro::Exit;

/// Lambertian both ways; mirrors a share that grows to grazing; ways in both epidermes and the mesophyll are [`FIXED`] of
/// `path_um` and an exponential rest, when sent back; twice that when let through.
struct Sheet {
    path_um: [f64; REGIONS],
}

/// Share of a way that is the same for all.
const FIXED: f64 = 0.7;

const DEPTH: [f64; REGIONS] = [20.0, 0.0, 150.0, 15.0];

impl Sheet {
    fn mirror(cos: f64) -> f64 {
        0.03 + 0.97 * (1.0 - cos).powi(5)
    }

    /// Of the light that enters, the share that comes back.
    const BACK: f64 = 0.6;

    /// Mean of what the ways leave.
    fn laplace(&self, mu: &[f64; REGIONS], passes: f64) -> f64 {
        let region = |r: usize| {
            let depth = mu[r] * self.path_um[r] * passes;
            (-FIXED * depth).exp() / (1.0 + (1.0 - FIXED) * depth)
        };
        (0..REGIONS).map(region).product()
    }
}

impl WhiteScatter for Sheet {
    fn walk(&self, wi: DVec3, stream: &mut Stream) -> End {
        let [u, v] = stream.next_2d().to_array();
        if u < Self::mirror(wi.z.abs()) {
            let direction = DVec3::new(-wi.x, -wi.y, wi.z);
            return End::Left(Exit { direction, path_um: [0.0; REGIONS] });
        }
        let back = v < Self::BACK;
        let passes = if back { 1.0 } else { 2.0 };
        let path_um = self.path_um.map(|l| l * passes * (FIXED + (1.0 - FIXED) * stream.exponential()));
        let u = stream.next_2d();
        // The mirror takes less of what enters at a steep angle; what leaves must be reciprocal to it.
        let mut sin2 = u.x;
        while stream.next() < Self::mirror((1.0 - sin2).sqrt()) {
            sin2 = stream.next();
        }
        let (s, c) = (TAU * u.y).sin_cos();
        let sign = if back == (wi.z > 0.0) { 1.0 } else { -1.0 };
        let direction = DVec3::new(sin2.sqrt() * c, sin2.sqrt() * s, sign * (1.0 - sin2).sqrt());
        End::Left(Exit { direction, path_um })
    }
}

/// Lambertian: sends back 0.5, lets 0.3 through, keeps 0.2.
struct Lambertian;

impl WhiteScatter for Lambertian {
    fn walk(&self, wi: DVec3, stream: &mut Stream) -> End {
        let u = stream.next();
        if u > 0.8 {
            return End::CutOff;
        }
        let sign = if u < 0.5 { wi.z.signum() } else { -wi.z.signum() };
        let d = stream.next_2d();
        let (s, c) = (TAU * d.y).sin_cos();
        let direction = DVec3::new(d.x.sqrt() * c, d.x.sqrt() * s, sign * (1.0 - d.x).sqrt());
        End::Left(Exit { direction, path_um: [10.0, 0.0, 0.0, 0.0] })
    }
}

fn go(_: u64, _: u64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn z_limit(tests: usize) -> f64 {
    -normal_quantile(sidak(0.001, tests) / 2.0)
}

const SHEET: Sheet = Sheet { path_um: [30.0, 0.0, 100.0, 12.0] };

fn small() -> WhiteMonteCarlo {
    WhiteMonteCarlo { walks: 200_000, seed: 3, ..Default::default() }
}

#[test]
fn a_lambertian_sheet_is_measured() {
    let settings = WhiteMonteCarlo { thetas: 9, interior_phis: 3, surface_phis: 4, ..small() };
    let o = settings.measure(&Lambertian, DEPTH, &go).unwrap();
    assert_eq!(o.paths_um, [[10.0, 0.0, 0.0, 0.0]; 3]);
    let walks = 2.0 * o.walks as f64;
    let z = (o.cut_off as f64 - 0.2 * walks) / (walks * 0.16).sqrt();
    assert!(z.abs() < 4.0, "{z}");
    assert!(o.surface.values.iter().all(|v| *v == 0.0));
    assert!(o.class_error < 1e-7 && o.asymmetry < 0.02, "{} {}", o.class_error, o.asymmetry);
    for t in &o.totals {
        let z = |e: Estimate, p: f64| (e.value - p) / e.standard_error;
        assert!(z(t.interior, 0.5).abs() < z_limit(36) && z(t.transmitted, 0.3).abs() < z_limit(36), "{t:?}");
    }
    // Every bin is flat within its noise.
    let mut chi2 = 0.0;
    let mut bins = 0.0;
    for (part, value) in [(Part::Adaxial, 0.5), (Part::Abaxial, 0.5), (Part::Through, 0.3)] {
        for a in 0..9 {
            for b in 0..9 {
                if part != Part::Through && b < a {
                    continue;
                }
                for phi in 0..3 {
                    let grid = o.interior.grid;
                    let f = value / std::f64::consts::PI;
                    let walks = o.walks as f64 / 9.0;
                    // Both ways' counts, or the one of the diagonal twice.
                    let one = if part != Part::Through && a == b { 2.0 } else { 1.0 };
                    let count = f * walks * (grid.bin_measure(a) + grid.bin_measure(b)) / 3.0 / one;
                    let got: f32 = o.interior.bin(part, a, b, phi).iter().sum();
                    let got = f64::from(got);
                    chi2 += (got / f - 1.0).powi(2) * count;
                    bins += 1.0;
                }
            }
        }
    }
    let z = (chi2 - bins) / (2.0f64 * bins).sqrt();
    assert!(z.abs() < 4.5, "{chi2} of {bins}");
}

#[test]
fn white_light_is_kept() {
    let o = small().measure(&SHEET, DEPTH, &go).unwrap();
    assert_eq!(o.cut_off, 0);
    for side in [Side::Adaxial, Side::Abaxial] {
        for deg in 0..=90 {
            let (r, t) = o.reflectance(side, f64::from(deg), &[0.0; REGIONS]);
            assert!(r + t <= 1.0 && r + t > 1.0 - 1e-4, "{side:?} {deg}: {r} + {t}");
        }
    }
    // The parts keep their own shares, at every node.
    for t in &o.totals {
        let shares = o.lamp_shares(t.side, t.incident_deg);
        assert!((shares.surface[0] - t.surface.value).abs() < 1e-4 * t.surface.value, "{t:?}");
        let interior: f64 = shares.interior.iter().map(|s| s[0]).sum();
        let noise = 4.0 * t.interior.standard_error;
        assert!((interior - t.interior.value).abs() < noise + 0.004, "{interior} {t:?}");
    }
    assert!(o.asymmetry < 0.02, "{}", o.asymmetry);
}

#[test]
fn recoloured_as_walked() {
    // Closed form of the sheet: the part that enters times the Laplace transform of its ways, for light of a bin.
    let o = WhiteMonteCarlo { walks: 400_000, ..small() }.measure(&SHEET, DEPTH, &go).unwrap();
    assert!(o.class_error < 0.002 && o.class_error > 0.0, "{}", o.class_error);
    let depths = [[0.3, 0.0], [2.2, 0.0], [8.7, 0.0], [0.0, 2.2], [0.5, 0.5], [2.2, 2.2], [5.0, 5.0]];
    for t in o.totals.iter().filter(|t| t.incident_deg < 70.0) {
        let walks = (o.walks / 18) as f64;
        let entered = t.interior.value + t.transmitted.value;
        for [top, bottom] in depths {
            let mu = [top / DEPTH[0], 0.0, 0.02 * top / DEPTH[2], bottom / DEPTH[3]];
            let (r, through) = o.reflectance(t.side, t.incident_deg, &mu);
            let expected_r = t.surface.value + entered * Sheet::BACK * SHEET.laplace(&mu, 1.0);
            let expected_t = entered * (1.0 - Sheet::BACK) * SHEET.laplace(&mu, 2.0);
            for (got, expected) in [(r, expected_r), (through, expected_t)] {
                let noise = 4.0 * (expected / walks).sqrt();
                assert!((got - expected).abs() < 0.002 + noise, "{t:?} {mu:?}: {got} {expected}");
            }
        }
    }
    // The put-together table has the same totals, and a spectrum is made of its wavelengths.
    let mu = [0.05, 0.0, 0.001, 0.1];
    let together = o.interior_at(&mu);
    let shares = o.lamp_shares(Side::Abaxial, 32.5);
    let reflected: f64 = together.projected(Part::Abaxial, 6, true).iter().sum();
    let whole = shares.at(&o.remaining(&mu));
    assert!((reflected + shares.surface[0] - whole.0).abs() < 1e-6);
    let spectrum = o.recolour(Side::Abaxial, 32.5, &[[0.0; REGIONS], mu]);
    assert_eq!(spectrum[1], whole);
}

#[test]
fn same_at_any_thread_count() {
    let settings = WhiteMonteCarlo { walks: 60_000, thetas: 3, ..small() };
    let measure = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| settings.measure(&SHEET, DEPTH, &go).unwrap())
    };
    let one = measure(1);
    assert_eq!(one, measure(4));
    let other = WhiteMonteCarlo { seed: 4, ..settings.clone() }.measure(&SHEET, DEPTH, &go).unwrap();
    assert_ne!(one, other);
}

#[test]
fn progress_and_cancel() {
    let settings = WhiteMonteCarlo { walks: 50_001, thetas: 2, ..small() };
    let most = AtomicU64::new(0);
    let o = settings
        .measure(&SHEET, DEPTH, &|done, total| {
            assert!(done <= total && total == 100_004);
            most.fetch_max(done, Ordering::Relaxed);
            ControlFlow::Continue(())
        })
        .unwrap();
    assert_eq!((o.walks, most.into_inner()), (50_002, 100_004));
    let stopped = settings.measure(&SHEET, DEPTH, &|_, _| ControlFlow::Break(()));
    assert!(matches!(stopped, Err(Error::Cancelled)));
}

#[test]
fn wrong_settings_and_walks_are_errors() {
    let ok = WhiteMonteCarlo::default();
    for (bad, key) in [
        (WhiteMonteCarlo { walks: 35, ..ok.clone() }, "white.walks"),
        (WhiteMonteCarlo { walks: 1 << 33, ..ok.clone() }, "white.walks"),
        (WhiteMonteCarlo { thetas: 0, ..ok.clone() }, "white.thetas"),
        (WhiteMonteCarlo { surface_phis: 1000, ..ok.clone() }, "white.surface_phis"),
        (WhiteMonteCarlo { interior_phis: 0, ..ok.clone() }, "white.interior_phis"),
        (WhiteMonteCarlo { classes: 2, ..ok.clone() }, "white.classes"),
        (WhiteMonteCarlo { thetas: 90, interior_phis: 180, ..ok.clone() }, "white.classes"),
    ] {
        let error = bad.measure(&SHEET, DEPTH, &go).unwrap_err().to_string();
        assert!(error.starts_with(key), "{error}");
    }
    assert!(ok.measure(&SHEET, [f64::NAN; REGIONS], &go).is_err());
    let path_um = [f64::NAN, 0.0, 0.0, 0.0];
    let error = small().measure(&Sheet { path_um }, DEPTH, &go).unwrap_err().to_string();
    assert!(error.starts_with("sample: a walk ended in"), "{error}");
}

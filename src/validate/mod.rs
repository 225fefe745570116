//! Checks of any arrow of the program, used by `rosarium check` and by the tests.
//!
//! Nothing here prints or panics: every check returns its statistic, its tolerance and whether it passed.
//! [`check_bsdf`] runs the conformance suite over one model, [`check_scatter`] what can be said of a thing
//! that may only be simulated, [`check_petal`] also its estimate, [`shipped()`], [`shipped_petals`] and [`shipped_tables`] list the models that the program ships. [`compare`], [`flip`] and
//! [`pictures`] weigh images, [`laws`] measures what botanists found. [`wrong`] holds models with one deliberate fault each, to show that the suite rejects them.
//!
//! | test | claim | statistic | fails |
//! |---|---|---|---|
//! | `chi_square` | `sample` draws from `pdf` | smallest p value | below Sidak's level |
//! | `pdf_integral` | `pdf` integrates to the probability of success | largest difference over (4 sigma + 1e-3) | above 1 |
//! | `sample` | a sample's f and pdf are `eval` and `pdf` of its direction | largest relative difference | above 1e-4 |
//! | `weight` | the mean of `f cos / pdf` is the albedo found by quadrature | smallest p value | below Sidak's level |
//! | `reciprocity` | f(a, b) = f(b, a), also through the sheet | largest relative difference | above 1e-3 |
//! | `energy` | albedo <= 1 at every wavelength | largest albedo | above 1 + 1e-3 |
//! | `grazing` | finite and not negative down to cos = 1e-6, f zero at 0 | bad values | above 0 |
//!
//! Each runs at every incidence of [`Settings`] on both sides. All random numbers come from fixed seeds.

mod chi_square;
mod energy;
mod estimator;
mod grazing;
mod reciprocity;
mod scatter;
mod sheet;
mod shipped;
pub mod compare;
pub mod flip;
pub mod pictures;
pub mod laws;
#[doc(hidden)]
pub mod wrong;

use glam::Vec3;

use crate::bsdf::Bsdf;
use crate::geometry::Side;
use crate::math::frame::spherical;

pub use estimator::{Estimate, check_estimator, check_petal};
pub use scatter::check_scatter;
#[doc(hidden)]
pub use sheet::sheet;
pub use shipped::{Flaw, Shipped, shipped, shipped_petals, shipped_tables};

/// How thoroughly to check. The default takes about a second of one core per model.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Angles between the normal and the viewer, on both sides. Default 0, 30, 60, 80, 88.
    pub incidences_deg: Vec<f32>,
    /// Samples per incidence and side. Default 100 000.
    pub samples: u32,
    /// Probability that a right model fails one statistical test (over all its incidences and sides).
    /// Default 1e-3.
    pub significance: f64,
    /// Bins of the polar angle on each hemisphere, and of the azimuth. Default 12, 48.
    pub bins: (usize, usize),
    /// Nodes of the quadratures per hemisphere: polar angle, azimuth. Default 64, 128.
    pub nodes: (usize, usize),
    /// Random pairs of directions per incidence and side. Default 4000.
    pub pairs: u32,
    /// Distance of the wavelengths at which the energy is checked over the visible range. Default 5 nm.
    pub wavelength_step_nm: f32,
    /// Error that the integral of the pdf over a bin may have, as a share of all samples. Default 1e-7. Tables have kinks
    /// everywhere, at which the integral converges slowly.
    pub bin_tolerance: f64,
    /// Seed of all random numbers. Default 0.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            incidences_deg: vec![0.0, 30.0, 60.0, 80.0, 88.0],
            samples: 100_000,
            significance: 1e-3,
            bins: (12, 48),
            nodes: (64, 128),
            pairs: 4000,
            wavelength_step_nm: 5.0,
            bin_tolerance: 1e-7,
            seed: 0,
        }
    }
}

impl Settings {
    /// For tables: fewer directions and samples, and integrals whose error is a hundredth of a sample.
    pub fn for_tables() -> Self {
        Self {
            incidences_deg: vec![0.0, 40.0, 86.0],
            samples: 20_000,
            bins: (6, 24),
            nodes: (48, 96),
            pairs: 1000,
            wavelength_step_nm: 20.0,
            bin_tolerance: 5e-6,
            ..Self::default()
        }
    }
}

/// A property that [`check_bsdf`] or [`check_scatter`] tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Test {
    /// `sample` draws from `pdf`.
    ChiSquare,
    /// `pdf` integrates to the probability that `sample` succeeds.
    PdfIntegral,
    /// The f and pdf that `sample` returns are those of `eval` and `pdf`.
    Sample,
    /// The mean weight is the albedo.
    Weight,
    /// f(a, b) = f(b, a).
    Reciprocity,
    /// No more light out than in.
    Energy,
    /// Finite and not negative near the horizon.
    Grazing,
}

impl Test {
    /// All, in the order of a report.
    pub const ALL: [Test; 7] = [
        Test::ChiSquare,
        Test::PdfIntegral,
        Test::Sample,
        Test::Weight,
        Test::Reciprocity,
        Test::Energy,
        Test::Grazing,
    ];

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Test::ChiSquare => "chi_square",
            Test::PdfIntegral => "pdf_integral",
            Test::Sample => "sample",
            Test::Weight => "weight",
            Test::Reciprocity => "reciprocity",
            Test::Energy => "energy",
            Test::Grazing => "grazing",
        }
    }
}

/// Outcome of one test, at its worst incidence and side.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// What was tested.
    pub test: Test,
    /// Did it hold everywhere?
    pub passed: bool,
    /// The worst statistic.
    pub statistic: f64,
    /// The bound that it is held against.
    pub tolerance: f64,
    /// Where the worst is, and what the numbers mean.
    pub detail: String,
}

/// Outcome of the suite for one model.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// The model.
    pub name: String,
    /// One row per test.
    pub rows: Vec<Row>,
}

impl Report {
    /// Did every test pass?
    pub fn passed(&self) -> bool {
        self.rows.iter().all(|r| r.passed)
    }

    /// The tests that failed.
    pub fn failed(&self) -> Vec<Test> {
        self.rows.iter().filter(|r| !r.passed).map(|r| r.test).collect()
    }

    /// The row of a test, where it was run.
    pub fn row(&self, test: Test) -> Option<&Row> {
        self.rows.iter().find(|r| r.test == test)
    }
}

/// The whole conformance suite over one model.
pub fn check_bsdf(name: &str, bsdf: &dyn Bsdf, settings: &Settings) -> Report {
    let rows = Test::ALL.into_iter().map(|test| check_property(test, bsdf, settings)).collect();
    Report { name: name.into(), rows }
}

/// One test of the suite.
pub fn check_property(test: Test, bsdf: &dyn Bsdf, settings: &Settings) -> Row {
    match test {
        Test::ChiSquare => chi_square::sample_matches_pdf(bsdf, settings),
        Test::PdfIntegral => chi_square::pdf_integrates_to_success(bsdf, settings),
        Test::Sample => energy::sample_is_consistent(bsdf, settings),
        Test::Weight => energy::mean_weight_is_albedo(bsdf, settings),
        Test::Reciprocity => reciprocity::is_reciprocal(bsdf, settings),
        Test::Energy => energy::conserves_energy(bsdf, settings),
        Test::Grazing => grazing::is_finite_at_grazing(bsdf, settings),
    }
}

/// One direction of incidence.
#[derive(Clone, Copy)]
struct Case {
    wo: Vec3,
    incidence_deg: f32,
    side: Side,
    /// Key of the case's random numbers.
    index: u32,
}

impl Case {
    /// Every incidence on both sides, at azimuths that no symmetry singles out.
    fn all(settings: &Settings) -> impl Iterator<Item = Case> + '_ {
        let sides = [Side::Adaxial, Side::Abaxial];
        settings.incidences_deg.iter().flat_map(move |&d| sides.map(|side| (d, side))).enumerate().map(
            |(i, (incidence_deg, side))| {
                let up = spherical(incidence_deg.to_radians(), 0.7 + 2.4 * i as f32);
                let wo = if side == Side::Adaxial { up } else { up.with_z(-up.z) };
                Case { wo, incidence_deg, side, index: i as u32 }
            },
        )
    }

    fn count(settings: &Settings) -> usize {
        2 * settings.incidences_deg.len()
    }

    fn describe(&self) -> String {
        let side = match self.side {
            Side::Adaxial => "adaxial",
            Side::Abaxial => "abaxial",
        };
        format!("{} deg, {side} side", self.incidence_deg)
    }
}

/// Keeps the worst of a test's statistics; NaN is worse than any number.
struct Worst {
    bound: Bound,
    value: Option<f64>,
    detail: String,
}

/// Which side of the tolerance passes.
#[derive(Clone, Copy, PartialEq)]
enum Bound {
    AtMost(f64),
    AtLeast(f64),
}

impl Worst {
    fn new(bound: Bound) -> Self {
        Self { bound, value: None, detail: String::new() }
    }

    fn see(&mut self, value: f64, detail: impl FnOnce() -> String) {
        let worse = match (self.value, self.bound) {
            (None, _) => true,
            (Some(v), _) if v.is_nan() => false,
            (Some(v), Bound::AtMost(_)) => value > v || value.is_nan(),
            (Some(v), Bound::AtLeast(_)) => value < v || value.is_nan(),
        };
        if worse {
            self.value = Some(value);
            self.detail = detail();
        }
    }

    /// A test that saw nothing has not passed.
    fn row(self, test: Test) -> Row {
        let statistic = self.value.unwrap_or(f64::NAN);
        let (passed, tolerance) = match self.bound {
            Bound::AtMost(t) => (statistic <= t, t),
            Bound::AtLeast(t) => (statistic >= t, t),
        };
        Row { test, passed, statistic, tolerance, detail: self.detail }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nan_and_nothing_do_not_pass() {
        for bound in [Bound::AtMost(1.0), Bound::AtLeast(1.0)] {
            assert!(!Worst::new(bound).row(Test::Energy).passed);
            let mut w = Worst::new(bound);
            for v in [1.0, f64::NAN, 1.0] {
                w.see(v, String::new);
            }
            assert!(!w.row(Test::Energy).passed);
        }
    }
}

//! Counters of a white Monte Carlo measurement: where the walks from one polar bin of one side left, and of which class.

use glam::DVec3;

use super::path_classes::{PathClasses, Ways, remaining};
use super::{AngleGrid, Part};
use crate::micro::{End, Exit, REGIONS};
use crate::{Error, Result};

/// Part of the tables that light from `wi` to `w` belongs to.
pub(super) fn part(wi: DVec3, w: DVec3) -> Part {
    match (wi.z > 0.0, w.z > 0.0) {
        (true, true) => Part::Adaxial,
        (false, false) => Part::Abaxial,
        _ => Part::Through,
    }
}

/// Bins of the exits of the light from one polar bin, in the order of `[through][b][phi][class]`.
#[derive(Clone, Copy, Debug)]
pub(super) struct ExitBins {
    pub(super) grid: AngleGrid,
    pub(super) classes: usize,
}

impl ExitBins {
    pub(super) fn len(&self) -> usize {
        2 * self.grid.thetas * self.grid.phis * self.classes
    }

    /// Where the classes of a bin start.
    pub(super) fn first(&self, through: bool, b: usize, phi: usize) -> usize {
        ((usize::from(through) * self.grid.thetas + b) * self.grid.phis + phi) * self.classes
    }

    fn bin(&self, wi: DVec3, w: DVec3) -> usize {
        self.first(part(wi, w) == Part::Through, self.grid.theta_bin(w), self.grid.phi_bin(wi, w))
    }
}

/// What everyone who counts must know.
#[derive(Debug)]
pub(super) struct Instrument {
    pub(super) classes: PathClasses,
    pub(super) surface: ExitBins,
    pub(super) interior: ExitBins,
    /// Absorption coefficients that the classes are calibrated for, and others at which they are checked.
    pub(super) training: Vec<Ways>,
    pub(super) checks: Vec<Ways>,
}

/// What the walks from one polar bin of one side did.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Counts {
    /// Walks per bin of [`Instrument::surface`].
    pub(super) surface: Vec<u32>,
    /// Walks per bin of [`Instrument::interior`].
    pub(super) interior: Vec<u32>,
    /// Walks that were cut off.
    pub(super) cut_off: u64,
    /// Sums of the ways of each class, um, and of their squares, um2.
    pub(super) ways_um: Vec<[Ways; 2]>,
    /// Sum over the interior walks of the share that each absorption leaves, on the lit and the other side; the training's
    /// first, then the checks'.
    pub(super) remaining: Vec<[f64; 2]>,
}

impl Counts {
    pub(super) fn new(instrument: &Instrument) -> Self {
        Self {
            surface: vec![0; instrument.surface.len()],
            interior: vec![0; instrument.interior.len()],
            cut_off: 0,
            ways_um: vec![[Ways::default(); 2]; instrument.classes.len()],
            remaining: vec![[0.0; 2]; instrument.training.len() + instrument.checks.len()],
        }
    }

    /// Counts the end of a walk from `wi`.
    pub(super) fn count(&mut self, instrument: &Instrument, wi: DVec3, end: End) -> Result<()> {
        let End::Left(exit) = end else {
            self.cut_off += 1;
            return Ok(());
        };
        check(&exit)?;
        if exit.is_surface() {
            self.surface[instrument.surface.bin(wi, exit.direction)] += 1;
            return Ok(());
        }
        let way = &exit.path_um;
        let part = part(wi, exit.direction);
        let class = instrument.classes.class(part as usize, way);
        self.interior[instrument.interior.bin(wi, exit.direction) + class] += 1;
        let [sum, squares] = &mut self.ways_um[class];
        for r in 0..REGIONS {
            sum[r] += way[r];
            squares[r] += way[r] * way[r];
        }
        let through = usize::from(part == Part::Through);
        for (sum, mu) in self.remaining.iter_mut().zip(instrument.training.iter().chain(&instrument.checks)) {
            sum[through] += remaining(mu, way);
        }
        Ok(())
    }

    /// Adds the counts of other walks.
    pub(super) fn add(&mut self, other: &Counts) {
        let bins = |ours: &mut [u32], theirs: &[u32]| ours.iter_mut().zip(theirs).for_each(|(a, b)| *a += b);
        bins(&mut self.surface, &other.surface);
        bins(&mut self.interior, &other.interior);
        self.cut_off += other.cut_off;
        for (a, b) in self.ways_um.iter_mut().zip(&other.ways_um) {
            a.as_flattened_mut().iter_mut().zip(b.as_flattened()).for_each(|(a, b)| *a += b);
        }
        for (a, b) in self.remaining.iter_mut().zip(&other.remaining) {
            (0..2).for_each(|k| a[k] += b[k]);
        }
    }
}

/// A walk must end in a direction, after a way.
pub(super) fn check(exit: &Exit) -> Result<()> {
    let unit = (exit.direction.length_squared() - 1.0).abs() < 1e-6;
    if unit && exit.path_um.iter().all(|l| l.is_finite() && *l >= 0.0) {
        return Ok(());
    }
    Err(Error::invalid("sample", format!("a walk ended in {} after {:?} um", exit.direction, exit.path_um)))
}

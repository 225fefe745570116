//! Walks through a petal, sorted and counted.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use crate::gonio::Estimate;
use crate::math::Stream;
use crate::micro::cell_walk::CellWalk;
use crate::micro::{End, Exit, REGIONS, Tissue, WhiteScatter};
use crate::scene::description::PetalDescription;
use crate::scene::petal::preset;
use crate::scene::{Override, load};
use crate::spectrum::{Observer, Spectrum, illuminant};
use crate::{Error, Result};

/// Walks that one thread does at a time. Part of what fixes the sums' order, and so their last digits.
const BATCH: u64 = 2048;

/// A petal that light walks through.
pub(super) struct Sample {
    /// The walk.
    pub(super) walk: CellWalk,
    /// The layers.
    pub(super) tissue: Arc<Tissue>,
}

impl Sample {
    /// A petal that comes with the program, with changes `key=value`.
    pub(super) fn new(name: &str, changes: &[&str]) -> Result<Self> {
        let unknown = || Error::invalid(name, "no petal of this name has a tissue");
        let text = preset(name).ok_or_else(unknown)?;
        let changes = changes.iter().map(|c| Override::parse(c)).collect::<Result<Vec<_>>>()?;
        let petal = load::<PetalDescription>(text, name, &changes)?.description;
        let tissue = Arc::new(petal.build_tissue("")?.ok_or_else(unknown)?);
        Ok(Self { walk: CellWalk::new(tissue.clone()), tissue })
    }

    /// Absorption coefficients at a wavelength, 1/um.
    pub(super) fn at(&self, wavelength_nm: f64) -> Result<[f64; REGIONS]> {
        self.tissue.absorption_per_um(wavelength_nm)
    }

    /// Absorption coefficients every 10 nm from 400 to 700, each with its weight in the luminance under D65; the weights add
    /// up to one.
    pub(super) fn luminous(&self) -> Result<Vec<([f64; REGIONS], f64)>> {
        let weight =
            |nm: f64| Observer::Cie1931.cmf(nm as f32)[1] * f64::from(illuminant::d65().at(nm as f32));
        let total: f64 = bands().map(weight).sum();
        bands().map(|nm| Ok((self.at(nm)?, weight(nm) / total))).collect()
    }

    /// Means of scores over walks: see [`tally`].
    pub(super) fn tally<const N: usize>(
        &self,
        lamp_deg: f64,
        effort: super::Effort,
        score: impl Fn(DVec3, &Exit) -> [f64; N] + Sync,
    ) -> [Estimate; N] {
        tally(&self.walk, lamp_deg, effort, score)
    }
}

/// 400 to 700 nm in steps of 10.
pub(super) fn bands() -> impl Iterator<Item = f64> {
    (40..=70).map(|n| f64::from(n) * 10.0)
}

/// Colour (XYZ under D65, CIE 1931) of reflectances at [`bands`].
pub(super) fn xyz(reflectances: &[Estimate]) -> Result<[f64; 3]> {
    let points: Vec<_> = bands().zip(reflectances.iter().map(|e| e.value)).collect();
    let lit = Spectrum::from_table(&points, "reflectance")?.zip(illuminant::d65(), |r, s| r * s);
    Ok(Observer::Cie1931.xyz_of(&lit))
}

/// Unit vector to a lamp at an angle from the adaxial normal (above 90 degrees: under the petal) and an azimuth.
pub(super) fn to_lamp(lamp_deg: f64, azimuth: f64) -> DVec3 {
    let (sin, cos) = lamp_deg.to_radians().sin_cos();
    DVec3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos)
}

/// Means, with standard errors, of the scores of walks from a lamp at a random azimuth. A score is told the direction to the
/// lamp and how the light left; walks that were cut off score nothing.
pub(super) fn tally<const N: usize>(
    petal: &dyn WhiteScatter,
    lamp_deg: f64,
    effort: super::Effort,
    score: impl Fn(DVec3, &Exit) -> [f64; N] + Sync,
) -> [Estimate; N] {
    let batch = |first: u64| {
        let mut sums = [[0.0; 2]; N];
        for k in first..(first + BATCH).min(effort.walks) {
            let mut stream = Stream::new(effort.seed, lamp_deg.to_bits(), k);
            let wi = to_lamp(lamp_deg, TAU * stream.next());
            let End::Left(exit) = petal.walk(wi, &mut stream) else { continue };
            for (sum, s) in sums.iter_mut().zip(score(wi, &exit)) {
                sum[0] += s;
                sum[1] += s * s;
            }
        }
        sums
    };
    let batches: Vec<_> =
        (0..effort.walks.div_ceil(BATCH)).into_par_iter().map(|b| batch(b * BATCH)).collect();
    let mut sums = [[0.0; 2]; N];
    for batch in batches {
        for (sum, s) in sums.iter_mut().zip(batch) {
            sum[0] += s[0];
            sum[1] += s[1];
        }
    }
    sums.map(|[s, s2]| Estimate::from_sums(s, s2, effort.walks.max(2) as f64))
}

/// Did the light leave on the lamp's side?
pub(super) fn comes_back(wi: DVec3, exit: &Exit) -> bool {
    wi.z * exit.direction.z > 0.0
}

/// One where it is true.
pub(super) fn when(condition: bool, value: f64) -> f64 {
    if condition { value } else { 0.0 }
}

/// Is `d` within `half_angle_deg` of the unit vector `axis`?
pub(super) fn near(d: DVec3, axis: DVec3, half_angle_deg: f64) -> bool {
    d.dot(axis) > half_angle_deg.to_radians().cos()
}

/// The mirror direction of a lamp.
pub(super) fn mirror(wi: DVec3) -> DVec3 {
    DVec3::new(-wi.x, -wi.y, wi.z)
}

/// `a / b`, errors added in quadrature: an upper bound where both come from the same walks and count different ones.
pub(super) fn ratio(a: Estimate, b: Estimate) -> Estimate {
    let value = a.value / b.value;
    let relative = (a.standard_error / a.value).hypot(b.standard_error / b.value);
    // Without a single count above there is no relative error.
    let standard_error = if a.value == 0.0 { a.standard_error / b.value } else { (value * relative).abs() };
    Estimate { value, standard_error }
}

/// `a - b`, of different walks.
pub(super) fn difference(a: Estimate, b: Estimate) -> Estimate {
    Estimate { value: a.value - b.value, standard_error: a.standard_error.hypot(b.standard_error) }
}

/// Mean and standard error of independent estimates.
pub(super) fn mean(values: &[f64]) -> Estimate {
    let sums = values.iter().fold((0.0, 0.0), |(s, s2), v| (s + v, s2 + v * v));
    Estimate::from_sums(sums.0, sums.1, values.len() as f64)
}

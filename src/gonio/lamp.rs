//! One incidence being measured: where the lamp stands, and where each of its paths is counted.

use std::f64::consts::TAU;

use glam::{DVec2, UVec2, Vec2, Vec3};

use super::Goniophotometer;
use super::counters::{Counters, PathTotals};
use super::retro::RetroCaps;
use crate::bsdf::Scatter;
use crate::geometry::Side;
use crate::math::Sampler;
use crate::math::frame::spherical;
use crate::spectrum::{LANES, SampledWavelengths};
use crate::{Error, Result};

/// A lamp at one angle, and the counters' geometry around it.
pub(super) struct Lamp<'a> {
    pub(super) gonio: &'a Goniophotometer,
    /// Number of the incidence.
    pub(super) index: u32,
    /// Direction to the lamp in the sample's frame.
    wi: Vec3,
    caps: RetroCaps,
    groups: Vec<SampledWavelengths>,
}

/// Where a direction is counted.
pub(super) struct Place {
    grid: usize,
    scan: Option<usize>,
    reflected: bool,
    retro: f64,
    mirror: f64,
}

impl<'a> Lamp<'a> {
    pub(super) fn new(gonio: &'a Goniophotometer, index: usize) -> Self {
        let incident_deg = gonio.incident_deg[index];
        let groups = gonio
            .bands_nm
            .chunks(LANES)
            .map(|bands| {
                // Lanes without a band repeat the last one.
                SampledWavelengths::given(std::array::from_fn(|i| bands[i.min(bands.len() - 1)] as f32))
            })
            .collect();
        Self {
            gonio,
            index: index as u32,
            wi: turn(spherical(incident_deg.to_radians() as f32, 0.0), gonio.side),
            caps: RetroCaps::new(incident_deg),
            groups,
        }
    }

    /// 0 for the adaxial side, 1 for the abaxial one.
    pub(super) fn side_index(&self) -> u32 {
        if self.gonio.side == Side::Adaxial { 0 } else { 1 }
    }

    /// How far the sample is turned about its normal for one path: a unit vector.
    pub(super) fn spin(&self, ray: u64) -> Vec2 {
        // The golden ratio's multiples fill the circle evenly, however many paths there are.
        let turn_by =
            if self.gonio.spin { (ray as f64 * 0.618_033_988_749_894_9).fract() * TAU } else { 0.0 };
        DVec2::from_angle(turn_by).as_vec2()
    }

    /// Direction to the lamp in the sample's frame.
    pub(super) fn wi(&self, spin: Vec2) -> Vec3 {
        if self.gonio.spin { turned(self.wi, spin) } else { self.wi }
    }

    /// Where light is counted that leaves in the direction `w` of the sample's frame.
    pub(super) fn place(&self, w: Vec3, spin: Vec2) -> Place {
        let w = if self.gonio.spin { turned(w, spin * Vec2::new(1.0, -1.0)) } else { w };
        let w = turn(w, self.gonio.side);
        let (retro, mirror) = self.caps.share(w);
        Place {
            grid: self.gonio.exitant.bin(w),
            scan: self.gonio.scan.bin(w),
            reflected: w.z >= 0.0,
            retro,
            mirror,
        }
    }

    /// Follows one path in every group of bands and counts it.
    pub(super) fn follow(&self, ray: u64, sample: &dyn Scatter, counters: &mut Counters) -> Result<()> {
        // The sample index has 32 bits; what lies above moves on to another sequence.
        let pixel = UVec2::new(self.index, self.side_index() + 2 * (ray >> 32) as u32);
        let bands = self.gonio.bands_nm.len();
        counters.paths += 1;
        let mut mean = PathTotals::default();
        let spin = self.spin(ray);
        let wi = self.wi(spin);
        for (g, lambda) in self.groups.iter().enumerate() {
            let first = g * LANES;
            let count = (bands - first).min(LANES);
            let mut sampler = Sampler::new(self.gonio.seed, pixel, ray as u32);
            let Some((w, weight)) = sample.scatter(wi, lambda, &mut sampler) else {
                counters.totals[first..first + count].iter_mut().for_each(|t| t.add(&PathTotals::ABSORBED));
                mean.add_scaled(&PathTotals::ABSORBED, count as f64 / bands as f64);
                continue;
            };
            let weights = &weight.0[..count];
            if !(w.is_finite() && weights.iter().all(|v| v.is_finite() && *v >= 0.0)) {
                let what = format!("scattered light from {} to {w} with weights {weights:?}", self.wi);
                return Err(Error::invalid("sample", what));
            }
            let place = self.place(w, spin);
            for (band, &weight) in (first..).zip(weights) {
                mean.add_scaled(&counters.count(&place, band, f64::from(weight)), 1.0 / bands as f64);
            }
        }
        counters.totals[bands].add(&mean);
        Ok(())
    }
}

impl Counters {
    /// Counts the light of one path in one band; what it adds to the band's totals.
    pub(super) fn count(&mut self, place: &Place, band: usize, weight: f64) -> PathTotals {
        let bands = self.totals.len() - 1;
        self.grid[place.grid * bands + band].add(weight);
        if let Some(bin) = place.scan {
            self.scan[bin * bands + band].add(weight);
        }
        let path = PathTotals::scattered(weight, place.reflected, place.retro, place.mirror);
        self.totals[band].add(&path);
        path
    }
}

/// Turns a direction about the normal.
fn turned(w: Vec3, spin: Vec2) -> Vec3 {
    spin.rotate(w.truncate()).extend(w.z)
}

/// Instrument's frame to sample's frame and back: for the abaxial side the sample is turned over about x.
fn turn(w: Vec3, side: Side) -> Vec3 {
    match side {
        Side::Adaxial => w,
        Side::Abaxial => Vec3::new(w.x, -w.y, -w.z),
    }
}

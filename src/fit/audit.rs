//! Does a fitted model keep the laws? Totals per incidence, energy, reciprocity.
//!
//! Model: the share of the light from `wi` that leaves on one side, and how far the BSDF is from its reverse.
//!
//! ```text
//! total(wi, side) = integral over the side of f(wi, wo) |cos theta_o| dwo
//! asymmetry(a, b) = |f(a, b) - f(b, a)| / max(f(a, b), f(b, a), 1e-6 / sr)
//! ```
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | theta_i | [`Totals::incident_deg`] | deg | 0, 10, ... 80 and every measured lamp |
//! | total on the lit side | [`Totals::reflectance`] | - | |
//! | total on the other side | [`Totals::transmittance`] | - | |
//! | bound of the rule's error | [`Totals::error`] | - | |
//!
//! Quadrature: the hemisphere in (theta, phi) is halved until a piece is smaller than 15 degrees and than half its
//! distance to the nearest direction where petals have lobes (mirror, lamp, straight on), down to 0.7 degrees; every piece
//! takes a product of 3-point Gauss rules. The error that is stated is the sum over the pieces of what a 2-point rule
//! would have changed, which bounds the error of the 3-point rule for all but discontinuous models. Lambertian sheets and
//! lobes down to a degree wide are integrated to better than 1e-3 (`totals_match_closed_forms`,
//! `the_stated_error_holds_for_sharp_lobes`). A lobe elsewhere that is narrower than a few degrees can be missed.
//!
//! What the readings say of the same total is the sum of reading x projected solid angle of its region, over the part of
//! the projected hemisphere that was covered, beside the model's values at the same readings summed alike
//! (`readings_are_summed_over_what_they_cover`). Energy is kept where no total exceeds 1 by more than its error
//! (`energy_is_judged`); reciprocity is looked for on 256 fixed pairs (`asymmetry_is_found`).
//!
//! Source: our reading.

use std::f64::consts::PI;

use glam::DVec3;
use serde::Serialize;

use super::{Fit, Geometry, Model};
use crate::Result;
use crate::geometry::Side;
use crate::gonio::Measurement;
use crate::gonio::measurement::{angles_deg, direction_deg, instrument_deg};
use crate::math::quadrature::GaussLegendre;

/// Incidences that are always audited.
const INCIDENT_DEG: [f64; 9] = [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0];
/// Pieces of the hemisphere are no larger and no smaller than this.
const PIECE_DEG: (f64, f64) = (15.0, 0.7);
/// Pairs of directions for reciprocity.
const PAIRS: u32 = 256;
/// Below this, 1/sr, nobody sees a difference and rounding rules.
const FLOOR_PER_SR: f64 = 1e-6;
/// Largest relative difference that still counts as reciprocal.
const RECIPROCAL: f64 = 1e-6;

/// What a fitted model does with the light.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Audit {
    /// Model's name.
    pub model: String,
    /// One per band.
    pub bands: Vec<BandAudit>,
}

/// An [`Audit`] at one band.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BandAudit {
    /// Band's name.
    pub band: String,
    /// Totals, adaxial incidences first.
    pub totals: Vec<Totals>,
    /// Incidence whose total is largest: index into `totals`.
    pub largest: usize,
    /// No total exceeds one by more than its error.
    pub conserves_energy: bool,
    /// Largest relative difference of the BSDF and its reverse.
    pub largest_asymmetry: f64,
    /// Where: `[theta_a, phi_a, theta_b, phi_b]`, degrees.
    pub asymmetry_at_deg: [f64; 4],
    /// Is that rounding only?
    pub is_reciprocal: bool,
}

/// Where the light of one lamp direction goes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Totals {
    /// The lamp's angle from the normal of the lit side, degrees.
    pub incident_deg: f64,
    /// The lit side.
    pub side: Side,
    /// Was the lamp there in the measurement?
    pub measured: bool,
    /// Directional-hemispherical reflectance.
    pub reflectance: f64,
    /// Directional-hemispherical transmittance.
    pub transmittance: f64,
    /// Bound of the quadrature's error of their sum.
    pub error: f64,
    /// What the readings on the lit side say, where there are any.
    pub reflected_readings: Option<Covered>,
    /// What the readings on the other side say, where there are any.
    pub transmitted_readings: Option<Covered>,
}

impl Totals {
    /// Reflectance and transmittance together.
    pub fn total(&self) -> f64 {
        self.reflectance + self.transmittance
    }
}

/// A total over the part of a hemisphere that readings cover.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Covered {
    /// Share of the projected hemisphere that is covered.
    pub share: f64,
    /// Readings summed over it, gains taken out.
    pub measured: f64,
    /// The model at the same readings, summed alike.
    pub modelled: f64,
}

impl Audit {
    /// Audits `fit`, which `model` was fitted to `measurement`. `projected_sr` is the projected solid angle of every
    /// reading among the readings of its lamp, series, band and side.
    pub fn new(
        model: &dyn Model,
        fit: &Fit,
        measurement: &Measurement,
        projected_sr: &[f64],
    ) -> Result<Self> {
        let lamps = lamps(measurement);
        let rule = Rule::new();
        let mut geometries: Vec<Geometry> = Vec::new();
        let mut weights: Vec<Vec<(Side, f64, f64)>> = Vec::new();
        for lamp in &lamps {
            let nodes = rule.nodes(lamp.wi);
            geometries.extend(nodes.iter().map(|n| Geometry::point(lamp.wi, n.wo)));
            weights.push(nodes.iter().map(|n| (n.side, n.weight, n.coarse)).collect());
        }
        let pairs = pairs();
        geometries.extend(pairs.iter().flat_map(|&(a, b)| [Geometry::point(a, b), Geometry::point(b, a)]));
        let prepared = model.prepare(&geometries)?;
        let mut values = vec![0.0; geometries.len()];
        let bands = measurement.bands.iter().enumerate().map(|(band, description)| {
            prepared.eval(&fit.band_values(model, band), &mut values, None);
            let mut rest = values.as_slice();
            let mut totals = Vec::new();
            for (lamp, weights) in lamps.iter().zip(&weights) {
                let (own, others) = rest.split_at(weights.len());
                rest = others;
                let readings = |side| {
                    covered(measurement, fit, projected_sr, lamp.wi, side, band).filter(|_| lamp.measured)
                };
                totals.push(totals_of(lamp, own, weights, readings));
            }
            // Rounding does not choose between equal totals: the first of them.
            let largest = (0..totals.len())
                .reduce(|a, b| if totals[b].total() > totals[a].total() + 1e-9 { b } else { a });
            let (asymmetry, worst) = asymmetry(rest);
            BandAudit {
                band: description.name.clone(),
                conserves_energy: totals.iter().all(|t| t.total() <= 1.0 + t.error + 1e-9),
                totals,
                largest: largest.unwrap_or(0),
                largest_asymmetry: asymmetry,
                asymmetry_at_deg: pairs.get(worst).map_or([0.0; 4], |&(a, b)| {
                    let ((ta, pa), (tb, pb)) = (angles_deg(a), angles_deg(b));
                    [ta, pa, tb, pb]
                }),
                is_reciprocal: asymmetry <= RECIPROCAL,
            }
        });
        Ok(Self { model: fit.model.clone(), bands: bands.collect() })
    }

    /// Does every band keep its energy?
    pub fn conserves_energy(&self) -> bool {
        self.bands.iter().all(|b| b.conserves_energy)
    }

    /// Is every band reciprocal?
    pub fn is_reciprocal(&self) -> bool {
        self.bands.iter().all(|b| b.is_reciprocal)
    }
}

/// A direction of the lamp that is audited.
struct Lamp {
    wi: DVec3,
    incident_deg: f64,
    side: Side,
    measured: bool,
}

/// The fixed incidences of each side that was lit, and the measured lamps that are not among them.
fn lamps(measurement: &Measurement) -> Vec<Lamp> {
    let measured: Vec<Lamp> = measurement
        .lamps()
        .into_iter()
        .map(|wi| {
            let (incident_deg, _, _, side) = instrument_deg(wi, wi);
            Lamp { wi, incident_deg, side, measured: true }
        })
        .collect();
    let mut lamps = Vec::new();
    for side in [Side::Adaxial, Side::Abaxial] {
        if side == Side::Abaxial && measured.iter().all(|l| l.side == Side::Adaxial) {
            continue;
        }
        for incident_deg in INCIDENT_DEG {
            let up = side == Side::Adaxial;
            let wi = direction_deg(if up { incident_deg } else { 180.0 - incident_deg }, 0.0);
            lamps.push(Lamp { wi, incident_deg, side, measured: false });
        }
    }
    for lamp in measured {
        match lamps.iter_mut().find(|l| l.wi.distance_squared(lamp.wi) < 1e-12) {
            Some(fixed) => fixed.measured = true,
            None => lamps.push(lamp),
        }
    }
    let order = |l: &Lamp| (l.side == Side::Abaxial, l.incident_deg);
    lamps.sort_by(|a, b| order(a).0.cmp(&order(b).0).then(order(a).1.total_cmp(&order(b).1)));
    lamps
}

/// A node of the quadrature; `coarse` is its weight in the 2-point rule of the same piece.
struct Node {
    wo: DVec3,
    side: Side,
    weight: f64,
    coarse: f64,
}

struct Rule {
    fine: GaussLegendre,
    coarse: GaussLegendre,
}

/// Nodes of a piece: nine of the fine rule, then four of the coarse one.
const NODES: usize = 13;

impl Rule {
    fn new() -> Self {
        Self { fine: GaussLegendre::new(3), coarse: GaussLegendre::new(2) }
    }

    /// Nodes on the lit side, then on the other.
    fn nodes(&self, wi: DVec3) -> Vec<Node> {
        // Seen through the sheet, straight on lies over the mirror direction, so both sides take the same pieces.
        let up = wi.z.abs();
        let peaks = [DVec3::new(wi.x, wi.y, up), DVec3::new(-wi.x, -wi.y, up)];
        let mut pieces = Vec::new();
        split([0.0, PI / 2.0], [0.0, 2.0 * PI], &peaks, &mut pieces);
        let lit = if wi.z >= 0.0 { 1.0 } else { -1.0 };
        let mut nodes = Vec::with_capacity(2 * NODES * pieces.len());
        for z in [lit, -lit] {
            let side = if z > 0.0 { Side::Adaxial } else { Side::Abaxial };
            for &(theta, phi) in &pieces {
                for (rule, is_fine) in [(&self.fine, true), (&self.coarse, false)] {
                    for (t, wt) in rule.on(theta[0], theta[1]) {
                        for (p, wp) in rule.on(phi[0], phi[1]) {
                            let weight = wt * wp * t.sin() * t.cos();
                            let wo = DVec3::new(t.sin() * p.cos(), t.sin() * p.sin(), z * t.cos());
                            let (weight, coarse) = if is_fine { (weight, 0.0) } else { (0.0, weight) };
                            nodes.push(Node { wo, side, weight, coarse });
                        }
                    }
                }
            }
        }
        nodes
    }
}

type Piece = ([f64; 2], [f64; 2]);

/// Halves a piece of the hemisphere along its longer side until it is small enough for where it lies.
fn split(theta: [f64; 2], phi: [f64; 2], peaks: &[DVec3], pieces: &mut Vec<Piece>) {
    let (t, p) = (0.5 * (theta[0] + theta[1]), 0.5 * (phi[0] + phi[1]));
    // Widest parallel of the piece: its rim towards the horizon.
    let (height, width) = (theta[1] - theta[0], (phi[1] - phi[0]) * theta[1].sin());
    let middle = DVec3::new(t.sin() * p.cos(), t.sin() * p.sin(), t.cos());
    let nearest = peaks.iter().map(|w| w.angle_between(middle)).fold(PI, f64::min);
    // From the nearest point of the piece, about.
    let distance = (nearest - 0.5 * height.hypot(width)).max(0.0);
    let limit = (0.5 * distance).clamp(PIECE_DEG.1.to_radians(), PIECE_DEG.0.to_radians());
    if height.max(width) <= limit {
        pieces.push((theta, phi));
    } else if height > width {
        split([theta[0], t], phi, peaks, pieces);
        split([t, theta[1]], phi, peaks, pieces);
    } else {
        split(theta, [phi[0], p], peaks, pieces);
        split(theta, [p, phi[1]], peaks, pieces);
    }
}

fn totals_of(
    lamp: &Lamp,
    values: &[f64],
    weights: &[(Side, f64, f64)],
    readings: impl Fn(Side) -> Option<Covered>,
) -> Totals {
    let (mut reflectance, mut transmittance, mut error) = (0.0, 0.0, 0.0);
    for (values, weights) in values.chunks(NODES).zip(weights.chunks(NODES)) {
        let sum = |fine: bool| -> f64 {
            values.iter().zip(weights).map(|(v, w)| v * if fine { w.1 } else { w.2 }).sum()
        };
        let fine = sum(true);
        error += (fine - sum(false)).abs();
        let reflects = weights.first().is_some_and(|w| w.0 == lamp.side);
        *(if reflects { &mut reflectance } else { &mut transmittance }) += fine;
    }
    let other = if lamp.side == Side::Adaxial { Side::Abaxial } else { Side::Adaxial };
    Totals {
        incident_deg: lamp.incident_deg,
        side: lamp.side,
        measured: lamp.measured,
        reflectance,
        transmittance,
        error,
        reflected_readings: readings(lamp.side),
        transmitted_readings: readings(other),
    }
}

/// Readings of one lamp, band and side, averaged over the series; `None` where there are none.
fn covered(
    measurement: &Measurement,
    fit: &Fit,
    projected_sr: &[f64],
    wi: DVec3,
    side: Side,
    band: usize,
) -> Option<Covered> {
    let mut sums = vec![Covered { share: 0.0, measured: 0.0, modelled: 0.0 }; measurement.series.len()];
    for (i, r) in measurement.readings.iter().enumerate() {
        let same = r.band as usize == band
            && (r.wo.z > 0.0) == (side == Side::Adaxial)
            && r.wi.distance_squared(wi) < 1e-12;
        let (Some(sum), Some(sr)) = (sums.get_mut(r.series as usize), projected_sr.get(i)) else { continue };
        if same {
            let gain = measurement.series.get(r.series as usize).map_or(1.0, |name| fit.gain(name));
            let modelled = fit.modelled.get(i).copied().unwrap_or(0.0);
            sum.share += sr / PI;
            sum.measured += sr * r.bsdf_per_sr / gain;
            sum.modelled += sr * modelled / gain;
        }
    }
    sums.retain(|s| s.share > 0.0);
    let n = sums.len() as f64;
    let mean = |part: fn(&Covered) -> f64| sums.iter().map(part).sum::<f64>() / n;
    (n > 0.0).then(|| Covered {
        share: mean(|c| c.share).min(1.0),
        measured: mean(|c| c.measured),
        modelled: mean(|c| c.modelled),
    })
}

/// Pairs that fill the sphere of either direction evenly (the R2 sequence's three-dimensional kin), so that half of them
/// go through the sheet.
fn pairs() -> Vec<(DVec3, DVec3)> {
    // Powers of the inverse of the positive root of x^5 = x + 1.
    let base: f64 = 1.0 / 1.167_303_978_261_418_7;
    let direction = |u: f64, v: f64| {
        // Directions within a degree of the horizon say nothing.
        let z = (2.0 * u - 1.0).clamp(-1.0, 1.0);
        let z = if z.abs() < 0.02 { 0.02f64.copysign(z) } else { z };
        let (s, phi) = ((1.0 - z * z).sqrt(), 2.0 * PI * v);
        DVec3::new(s * phi.cos(), s * phi.sin(), z)
    };
    let at = |i: u32, power: i32| (0.5 + f64::from(i) * base.powi(power)).fract();
    (1..=PAIRS).map(|i| (direction(at(i, 1), at(i, 2)), direction(at(i, 3), at(i, 4)))).collect()
}

/// The largest relative difference, and the pair that has it, from values there and back.
fn asymmetry(values: &[f64]) -> (f64, usize) {
    let mut worst = (0.0, 0);
    for (i, pair) in values.chunks_exact(2).enumerate() {
        let difference = (pair[0] - pair[1]).abs() / pair[0].abs().max(pair[1].abs()).max(FLOOR_PER_SR);
        if difference > worst.0 {
            worst = (difference, i);
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::toy::{self, Toy};
    use crate::gonio::{Band, Reading};

    fn audit(toy: &Toy, values: &[f64]) -> BandAudit {
        let measurement = Measurement { bands: vec![Band::nm(550.0)], ..Default::default() };
        let fit = toy::fit(toy, &measurement, values);
        Audit::new(toy, &fit, &measurement, &[]).unwrap().bands.remove(0)
    }

    #[test]
    fn totals_match_closed_forms() {
        let band = audit(&Toy::new(1.0), &[0.4, 0.0, 0.25, 1.0]);
        assert_eq!(band.totals.len(), 9);
        for t in &band.totals {
            assert!((t.reflectance - 0.4).abs() < 1e-6 && (t.transmittance - 0.25).abs() < 1e-6, "{t:?}");
            assert!(t.error < 1e-3, "{}", t.error);
        }
        assert!(band.is_reciprocal && band.conserves_energy);
    }

    #[test]
    fn the_stated_error_holds_for_sharp_lobes() {
        // At normal incidence the lobe (n + 2) / (2 pi) cos^n about the mirror has the total 1, whatever n.
        for exponent in [3.0, 30.0, 300.0, 3000.0] {
            let band = audit(&Toy::new(1.0), &[0.0, 0.7, 0.0, exponent]);
            let t = &band.totals[0];
            assert!((t.reflectance - 0.7).abs() < 1e-3, "{exponent}: {}", t.reflectance);
            assert!((t.reflectance - 0.7).abs() <= t.error && t.error < 0.05, "{exponent}: {t:?}");
            // At 40 deg against a fine rule about the mirror.
            let t = &band.totals[4];
            let exact = 0.7 * lobe_total(exponent, 40f64.to_radians());
            assert!((t.reflectance - exact).abs() <= t.error.max(1e-9), "{exponent}: {t:?} {exact}");
            assert!((t.reflectance - exact).abs() < 1e-3, "{exponent}: {t:?} {exact}");
        }
    }

    /// Total of the lobe at an incidence: polar coordinates about the mirror direction, where it is smooth.
    fn lobe_total(exponent: f64, incident: f64) -> f64 {
        let (mut sum, phis) = (0.0, 2000);
        for (a, w) in GaussLegendre::new(400).on(0.0, PI / 2.0) {
            for k in 0..phis {
                let phi = 2.0 * PI * (f64::from(k) + 0.5) / f64::from(phis);
                let cos = a.cos() * incident.cos() + a.sin() * phi.cos() * incident.sin();
                sum += w * a.sin() * a.cos().powf(exponent) * cos.max(0.0) * 2.0 * PI / f64::from(phis);
            }
        }
        sum * (exponent + 2.0) / (2.0 * PI)
    }

    #[test]
    fn energy_is_judged() {
        assert!(audit(&Toy::new(1.0), &[0.7, 0.0, 0.3, 1.0]).conserves_energy);
        let band = audit(&Toy::new(1.0), &[0.7, 0.4, 0.0, 20.0]);
        assert!(!band.conserves_energy);
        assert_eq!(band.totals[band.largest].incident_deg, 0.0);
        assert!((band.totals[band.largest].total() - 1.1).abs() < 1e-3);
    }

    #[test]
    fn asymmetry_is_found() {
        let band = audit(&Toy::new(0.9), &[0.4, 0.1, 0.25, 5.0]);
        assert!(!band.is_reciprocal && band.largest_asymmetry > 0.05, "{}", band.largest_asymmetry);
        let band = audit(&Toy::new(1.0), &[0.4, 0.1, 0.25, 5.0]);
        assert!(band.is_reciprocal, "{}", band.largest_asymmetry);
        let pairs = pairs();
        let through = pairs.iter().filter(|(a, b)| a.z * b.z < 0.0).count();
        assert!((100..156).contains(&through), "{through}");
    }

    #[test]
    fn readings_are_summed_over_what_they_cover() {
        // Readings of 0.4 / pi by equal shares of the inner half of the projected hemisphere, at two lamps, one of
        // them not among the fixed incidences.
        let mut readings = Vec::new();
        for lamp_deg in [20.0, 33.0] {
            for k in 0..20 {
                readings.push(Reading {
                    wi: direction_deg(lamp_deg, 0.0),
                    wo: direction_deg(2.0 + f64::from(k) * 2.0, 20.0 * f64::from(k)),
                    series: 0,
                    band: 0,
                    bsdf_per_sr: 0.4 / PI,
                    sigma_per_sr: None,
                });
            }
        }
        let measurement = Measurement {
            bands: vec![Band::nm(550.0)],
            series: vec!["a".into()],
            readings,
            ..Default::default()
        };
        let toy = Toy::new(1.0);
        let fit = toy::fit(&toy, &measurement, &[0.5, 0.0, 0.0, 1.0]);
        let shares = vec![PI / 2.0 / 20.0; 40];
        let band = Audit::new(&toy, &fit, &measurement, &shares).unwrap().bands.remove(0);
        assert_eq!(band.totals.len(), 10);
        for t in &band.totals {
            assert_eq!(t.measured, t.incident_deg == 20.0 || (t.incident_deg - 33.0).abs() < 1e-9);
            assert_eq!(t.reflected_readings.is_some(), t.measured);
            assert!(t.transmitted_readings.is_none());
            if let Some(c) = t.reflected_readings {
                assert!((c.share - 0.5).abs() < 1e-12 && (c.measured - 0.2).abs() < 1e-12, "{c:?}");
                assert!((c.modelled - 0.25).abs() < 1e-12, "{c:?}");
            }
        }
    }
}

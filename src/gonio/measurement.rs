//! Readings as a laboratory delivers them: any directions, any order, gaps, several series and bands.
//!
//! A [`Reading`] is one number: the BSDF (1/sr, without the cosine) from the lamp's direction to the detector's at
//! one band. Both directions are unit vectors of the **sample's** frame, away from the surface, +z the adaxial
//! (front) normal: both above is reflection, opposite sides transmission, both below reflection of the abaxial side.
//! What the instrument's azimuth 0 or its quantity was is settled when a file is read; nothing later asks.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::geometry::Side;

/// One channel of a measurement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Band {
    /// `550 nm`, `R`, `CIE-Y`, or a column's name.
    pub name: String,
    /// Where the band is one wavelength, nm.
    pub wavelength_nm: Option<f64>,
}

impl Band {
    /// A band that is one wavelength.
    pub fn nm(wavelength_nm: f64) -> Self {
        Self { name: format!("{wavelength_nm} nm"), wavelength_nm: Some(wavelength_nm) }
    }

    /// A band that only has a name.
    pub fn named(name: impl Into<String>) -> Self {
        Self { name: name.into(), wavelength_nm: None }
    }
}

/// One number that a goniometer gave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Unit vector to the lamp.
    pub wi: DVec3,
    /// Unit vector to the detector.
    pub wo: DVec3,
    /// Index into [`Measurement::series`].
    pub series: u32,
    /// Index into [`Measurement::bands`].
    pub band: u32,
    /// BSDF without the cosine, 1/sr; where the scale is unknown, in proportion to it.
    pub bsdf_per_sr: f64,
    /// One standard deviation in the same unit, where the laboratory gave it.
    pub sigma_per_sr: Option<f64>,
}

/// What is known of the readings' scale.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// Values are 1/sr.
    #[default]
    Absolute,
    /// Each series has its own unknown gain.
    RelativePerSeries,
}

/// What a laboratory measured on one sample, or on a few that share a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measurement {
    /// Name of the sample.
    pub sample: String,
    /// Channels; at least one where there are readings.
    pub bands: Vec<Band>,
    /// Names of the series (samples, lamp settings, days); at least one where there are readings.
    pub series: Vec<String>,
    /// The numbers.
    pub readings: Vec<Reading>,
    /// Half the angle that the lamp fills seen from the sample, degrees; 0 for a parallel beam.
    pub source_half_angle_deg: f64,
    /// Half the angle that the detector fills seen from the sample, degrees; 0 for a point.
    pub detector_half_angle_deg: f64,
    /// Are the values absolute?
    pub scale: Scale,
    /// Readings that the file had and that are not here, with the reason: shown to the user.
    pub notes: Vec<String>,
}

/// Unit vector from degrees, f64.
pub fn direction_deg(theta_deg: f64, phi_deg: f64) -> DVec3 {
    let ((st, ct), (sp, cp)) = (theta_deg.to_radians().sin_cos(), phi_deg.to_radians().sin_cos());
    DVec3::new(st * cp, st * sp, ct)
}

/// `(theta, phi)` of a direction, degrees; theta from +z 0 to 180, phi 0 to 360.
pub fn angles_deg(w: DVec3) -> (f64, f64) {
    let phi = w.y.atan2(w.x).to_degrees();
    (w.x.hypot(w.y).atan2(w.z).to_degrees(), if phi < 0.0 { phi + 360.0 } else { phi })
}

/// A reading in the lamp's own frame: `(lamp's angle from the normal of the lit side, exitant theta from the same
/// normal (above 90 is transmission), exitant azimuth from the lamp's, 0 to 360)`, degrees, and the lit side.
pub fn instrument_deg(wi: DVec3, wo: DVec3) -> (f64, f64, f64, Side) {
    let side = if wi.z >= 0.0 { Side::Adaxial } else { Side::Abaxial };
    // The abaxial side is lit with the sample turned over about x: (x, y, z) -> (x, -y, -z).
    let turn = |w: DVec3| if side == Side::Adaxial { w } else { DVec3::new(w.x, -w.y, -w.z) };
    let ((ti, pi), (to, po)) = (angles_deg(turn(wi)), angles_deg(turn(wo)));
    // A lamp at the normal has no azimuth of its own.
    let pi = if ti < 1e-9 { 0.0 } else { pi };
    (ti, to, (po - pi).rem_euclid(360.0), side)
}

impl Measurement {
    /// Directions of the lamp, each once (to 1e-6 rad), in the order of their first reading.
    pub fn lamps(&self) -> Vec<DVec3> {
        let mut lamps: Vec<DVec3> = Vec::new();
        for r in &self.readings {
            // Readings of one lamp follow each other, so the last is tried first.
            if !lamps.iter().rev().any(|l| l.distance_squared(r.wi) < 1e-12) {
                lamps.push(r.wi);
            }
        }
        lamps
    }

    /// The readings that `keep` wants, with the bands and series that they need.
    pub fn subset(&self, keep: impl Fn(&Reading) -> bool) -> Measurement {
        let readings: Vec<Reading> = self.readings.iter().copied().filter(keep).collect();
        let used = |count: usize, index: &dyn Fn(&Reading) -> u32| -> Vec<u32> {
            (0..count as u32).filter(|i| readings.iter().any(|r| index(r) == *i)).collect()
        };
        let bands = used(self.bands.len(), &|r| r.band);
        let series = used(self.series.len(), &|r| r.series);
        let place = |list: &[u32], old: u32| list.partition_point(|i| *i < old) as u32;
        Measurement {
            sample: self.sample.clone(),
            bands: bands.iter().filter_map(|&b| self.bands.get(b as usize)).cloned().collect(),
            series: series.iter().filter_map(|&s| self.series.get(s as usize)).cloned().collect(),
            readings: readings
                .iter()
                .map(|r| Reading { band: place(&bands, r.band), series: place(&series, r.series), ..*r })
                .collect(),
            notes: self.notes.clone(),
            ..*self
        }
    }

    /// Is any light seen on the other side of the sheet than the lamp's?
    pub fn has_transmission(&self) -> bool {
        self.readings.iter().any(|r| r.wi.z * r.wo.z < 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_and_directions_agree() {
        for (theta, phi) in [(0.0, 0.0), (30.0, 200.0), (90.0, 90.0), (150.0, 359.0)] {
            let (t, p) = angles_deg(direction_deg(theta, phi));
            assert!((t - theta).abs() < 1e-12 && (p - phi).abs() < 1e-9, "{theta} {phi}: {t} {p}");
        }
    }

    #[test]
    fn the_instrument_sees_both_sides_alike() {
        let close = |a: (f64, f64, f64, Side), b: (f64, f64, f64, Side)| {
            (a.0 - b.0).abs() < 1e-9 && (a.1 - b.1).abs() < 1e-9 && (a.2 - b.2).abs() < 1e-9 && a.3 == b.3
        };
        let above = instrument_deg(direction_deg(30.0, 40.0), direction_deg(60.0, 220.0));
        assert!(close(above, (30.0, 60.0, 180.0, Side::Adaxial)), "{above:?}");
        // Lit from below, seen below on the lamp's side: retro-reflection of the abaxial side.
        let below = instrument_deg(direction_deg(150.0, 0.0), direction_deg(140.0, 0.0));
        assert!(close(below, (30.0, 40.0, 0.0, Side::Abaxial)), "{below:?}");
        let through = instrument_deg(direction_deg(150.0, 0.0), direction_deg(40.0, 180.0));
        assert!(close(through, (30.0, 140.0, 180.0, Side::Abaxial)), "{through:?}");
    }

    #[test]
    fn a_subset_keeps_names_and_numbers_together() {
        let reading = |series, band| Reading {
            wi: direction_deg(20.0, 0.0),
            wo: direction_deg(10.0, 0.0),
            series,
            band,
            bsdf_per_sr: f64::from(10 * series + band),
            sigma_per_sr: None,
        };
        let m = Measurement {
            bands: vec![Band::nm(450.0), Band::nm(550.0), Band::nm(650.0)],
            series: ["a", "b"].map(String::from).to_vec(),
            readings: vec![reading(0, 0), reading(1, 0), reading(1, 2), reading(0, 2)],
            ..Default::default()
        };
        let part = m.subset(|r| r.series == 1 && r.band == 2);
        assert_eq!((part.series[0].as_str(), part.bands[0].name.as_str()), ("b", "650 nm"));
        assert_eq!(
            (part.readings[0].series, part.readings[0].band, part.readings[0].bsdf_per_sr),
            (0, 0, 12.0)
        );
        assert_eq!(m.subset(|_| true).readings.len(), 4);
    }

    #[test]
    fn lamps_are_listed_once() {
        let reading = |t: f64| Reading {
            wi: direction_deg(t, 0.0),
            wo: direction_deg(10.0, 0.0),
            series: 0,
            band: 0,
            bsdf_per_sr: 1.0,
            sigma_per_sr: None,
        };
        let m =
            Measurement { readings: [20.0, 20.0, 50.0, 20.0].map(reading).to_vec(), ..Default::default() };
        assert_eq!(m.lamps().len(), 2);
    }
}

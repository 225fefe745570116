//! A BSDF between scattered readings: linear in the detector's direction, linear in the lamp's angle.
//!
//! For each lamp angle theta_i and each side, readings lie in the plane (theta_o cos d, theta_o sin d) with theta_o from
//! the normal of the side that the light leaves on and d the azimuth from the lamp's; a Delaunay triangulation of it gives
//!
//! f(theta_i, wo) = (1 - t) sum_k w_k f_k + t sum_k w'_k f'_k,
//!
//! with w the barycentric weights in the triangle of each of the two lamps around theta_i, t linear in theta_i. The radius
//! is the angle, not its sine: rows of a goniometer near the horizon would fall together and cross. A regular grid is a
//! special case.
//!
//! Outside the triangles or the lamps: f(wi, wo) = f(wo, wi) where that pair is inside, else the nearest point of the
//! measured region at the nearest lamp. Transmission measured one way is known both ways, by the same law.
//!
//! Symbols: f_k -> `Sheet::values`, 1/sr; theta_i -> `Sheet::incident_rad`; corners -> `Mesh::points`, rad.
//!
//! Limits:
//! - Readings are met exactly (`readings_are_met`), linear functions of the plane too (`linear_functions_are_exact`).
//! - Curved functions are cut by chords: between azimuths a step s apart the value is that of an angle theta_o larger by
//!   up to 1 - cos(s / 2) of itself, 0.3 degrees for steps of 10 (`a_smooth_sheet_is_followed`).
//! - Half a hemisphere is mirrored about the plane of incidence (`half_a_hemisphere_is_mirrored`); readings in that plane
//!   only are held across it (`a_scan_of_the_plane_is_held_across_it`).
//! - Isotropic: only differences of azimuths count, lamps at several azimuths are averaged, and so are series.
//! - A peak that moves with the lamp appears at two places with part of its height between two lamps
//!   (`peaks_between_lamps_split`): measure lamps closer than the peak is wide.
//! - Outside by reciprocity, never zero or negative: guarded by `reciprocity_continues_the_lamps`.
//!
//! Source: our reading (linear interpolation over a Delaunay triangulation).

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::directional::{Coverage, Directional};
use super::measurement::{Band, Measurement, Scale, instrument_deg};
use super::triangles::{Mesh, Weights};
use crate::geometry::Side;
use crate::{Error, Result};

/// Directions closer than this are one, degrees.
const SAME_DEG: f64 = 1e-4;

/// Readings of one lamp angle on one side.
#[derive(Clone, Debug)]
struct Sheet {
    incident_rad: f64,
    /// Was only one half measured, so that the other is its mirror image?
    is_half: bool,
    mesh: Mesh,
    /// `values[point * bands + band]`, 1/sr.
    values: Vec<f64>,
}

impl Sheet {
    fn weights(&self, p: DVec2) -> Weights {
        self.mesh.weights(if self.is_half { DVec2::new(p.x, p.y.abs()) } else { p })
    }

    fn add(&self, weights: &Weights, factor: f64, values: &mut [f64]) {
        let bands = values.len();
        for (point, w) in weights.corners {
            let of_point = &self.values[point as usize * bands..][..bands];
            values.iter_mut().zip(of_point).for_each(|(v, f)| *v += factor * w * f);
        }
    }
}

/// A measurement that can be asked for any two directions.
#[derive(Clone, Debug)]
pub struct Interpolant {
    bands: Vec<Band>,
    /// Per part (see [`part`]) the lamps in the order of their angles.
    parts: [Vec<Sheet>; 4],
}

/// Index of a part: lit side, and whether the light leaves on it.
fn part(lit: Side, reflected: bool) -> usize {
    usize::from(lit == Side::Abaxial) * 2 + usize::from(!reflected)
}

/// Angle of the lamp, place in the plane and part of a pair of directions.
fn place(wi: DVec3, wo: DVec3) -> (f64, DVec2, usize) {
    let (ti, to, d, lit) = instrument_deg(wi, wo);
    let reflected = (wi.z >= 0.0) == (wo.z >= 0.0);
    let to = if reflected { to.min(90.0) } else { 180.0 - to.max(90.0) };
    (ti.to_radians(), DVec2::from_angle(d.to_radians()) * to.to_radians(), part(lit, reflected))
}

/// Sums of the readings of one direction, per band.
type Sums = BTreeMap<[i64; 2], (DVec2, Vec<(f64, u32)>)>;

impl Interpolant {
    /// Triangulates the readings. A lamp's side counts where every band has a reading there.
    pub fn new(m: &Measurement) -> Result<Self> {
        if m.scale == Scale::RelativePerSeries && m.series.len() > 1 {
            return Err(Error::invalid(
                "readings",
                "several series, each with its own unknown gain: interpolate one series",
            ));
        }
        let bands = m.bands.len();
        let mut lamps: [BTreeMap<i64, Sums>; 4] = Default::default();
        for r in &m.readings {
            let finite = r.wi.is_normalized() && r.wo.is_normalized() && r.bsdf_per_sr.is_finite();
            if !finite || r.band as usize >= bands {
                return Err(Error::invalid("readings", "a reading is not finite or its band does not exist"));
            }
            let (ti, p, part) = place(r.wi, r.wo);
            let cell = |v: f64| (v.to_degrees() / SAME_DEG).round() as i64;
            let sums = lamps[part].entry(cell(ti)).or_default();
            let (_, sums) = sums.entry([cell(p.x), cell(p.y)]).or_insert_with(|| (p, vec![(0.0, 0); bands]));
            let (sum, n) = &mut sums[r.band as usize];
            *sum += r.bsdf_per_sr;
            *n += 1;
        }
        let mut parts: [Vec<Sheet>; 4] = Default::default();
        for (sheets, lamps) in parts.iter_mut().zip(lamps) {
            for (cell, sums) in lamps {
                let incident_rad = (cell as f64 * SAME_DEG).to_radians();
                sheets.extend(Self::sheet(incident_rad, sums, bands)?);
            }
        }
        if parts.iter().all(Vec::is_empty) {
            return Err(Error::invalid("readings", "no lamp has readings in every band"));
        }
        Ok(Self { bands: m.bands.clone(), parts })
    }

    fn sheet(incident_rad: f64, sums: Sums, bands: usize) -> Result<Option<Sheet>> {
        let tolerance = (10.0 * SAME_DEG).to_radians();
        let is_half =
            sums.values().all(|(p, _)| p.y > -tolerance) || sums.values().all(|(p, _)| p.y < tolerance);
        let fold = |p: DVec2| if is_half { DVec2::new(p.x, p.y.abs()) } else { p };
        let points: Vec<DVec2> = sums.values().map(|(p, _)| fold(*p)).collect();
        let mut values = vec![0.0; points.len() * bands];
        for band in 0..bands {
            // A band that lacks some of the directions is first interpolated to them by itself.
            let mean = |(sum, n): (f64, u32)| (n > 0).then(|| (sum / f64::from(n)).max(0.0));
            let known: Vec<(usize, f64)> =
                sums.values().enumerate().filter_map(|(i, (_, s))| Some((i, mean(s[band])?))).collect();
            if known.is_empty() {
                return Ok(None);
            }
            known.iter().for_each(|&(i, v)| values[i * bands + band] = v);
            if known.len() < points.len() {
                let mesh = Mesh::new(known.iter().map(|k| points[k.0]).collect())?;
                for (i, _) in sums.values().enumerate().filter(|(_, (_, s))| s[band].1 == 0) {
                    let corners = mesh.weights(points[i]).corners;
                    values[i * bands + band] = corners.iter().map(|&(k, w)| w * known[k as usize].1).sum();
                }
            }
        }
        Ok(Some(Sheet { incident_rad, is_half, mesh: Mesh::new(points)?, values }))
    }

    /// Adds the value to `values` if the pair is inside the measured region, or anyway if `nearest`; true if it did.
    fn eval(&self, wi: DVec3, wo: DVec3, nearest: bool, values: &mut [f64]) -> bool {
        let (ti, p, part) = place(wi, wo);
        let sheets = &self.parts[part];
        let (Some(first), Some(last)) = (sheets.first(), sheets.last()) else { return false };
        // As wide as the cells that lamps were gathered in.
        let slack = SAME_DEG.to_radians();
        let between = ti >= first.incident_rad - slack && ti <= last.incident_rad + slack;
        if !between && !nearest {
            return false;
        }
        let above = sheets.partition_point(|s| s.incident_rad < ti).min(sheets.len() - 1);
        let b = &sheets[above];
        let a = if b.incident_rad > ti && above > 0 { &sheets[above - 1] } else { b };
        let span = b.incident_rad - a.incident_rad;
        let t = if span > 0.0 { ((ti - a.incident_rad) / span).clamp(0.0, 1.0) } else { 0.0 };
        let (wa, wb) = (a.weights(p), b.weights(p));
        let inside = (wa.inside || t == 1.0) && (wb.inside || t == 0.0);
        if !inside && !nearest {
            return false;
        }
        a.add(&wa, 1.0 - t, values);
        if t > 0.0 {
            b.add(&wb, t, values);
        }
        true
    }
}

impl Directional for Interpolant {
    fn bands(&self) -> &[Band] {
        &self.bands
    }

    fn coverage(&self) -> Coverage {
        let has = |lit, reflected| !self.parts[part(lit, reflected)].is_empty();
        let through = has(Side::Adaxial, false) || has(Side::Abaxial, false);
        Coverage {
            reflection_adaxial: has(Side::Adaxial, true),
            reflection_abaxial: has(Side::Abaxial, true),
            transmission_adaxial: through,
            transmission_abaxial: through,
        }
    }

    fn bsdf(&self, wi: DVec3, wo: DVec3, values: &mut [f64]) -> bool {
        values.fill(0.0);
        self.eval(wi, wo, false, values)
            || self.eval(wo, wi, false, values)
            || self.eval(wi, wo, true, values)
            || self.eval(wo, wi, true, values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::directional::tests::Sheet as Formula;
    use crate::gonio::measurement::direction_deg;
    use crate::gonio::{ExitantGrid, Reading, sample};
    use crate::math::sampler::hash_to_unit;

    fn grid() -> ExitantGrid {
        ExitantGrid { theta_step_deg: 10.0, phi_step_deg: 15.0 }
    }

    fn random_direction(i: u32, below: bool, most_deg: f64) -> DVec3 {
        let (u, v) = (hash_to_unit(2 * i), hash_to_unit(2 * i + 1));
        let theta = most_deg * u;
        direction_deg(if below { 180.0 - theta } else { theta }, 360.0 * v)
    }

    /// A measurement of `f(wi, wo)` with one band.
    fn measured(lamps_deg: &[f64], directions: &[DVec3], f: impl Fn(DVec3, DVec3) -> f64) -> Measurement {
        let mut readings = Vec::new();
        for &lamp in lamps_deg {
            let wi = direction_deg(lamp, 0.0);
            readings.extend(directions.iter().map(|&wo| Reading {
                wi,
                wo,
                series: 0,
                band: 0,
                bsdf_per_sr: f(wi, wo),
                sigma_per_sr: None,
            }));
        }
        Measurement { bands: vec![Band::nm(550.0)], series: vec!["s".into()], readings, ..Default::default() }
    }

    /// Direction at a signed angle in the plane of incidence.
    fn signed(deg: f64) -> [f64; 3] {
        [deg.to_radians().sin(), 0.0, deg.to_radians().cos()]
    }

    fn ask(i: &Interpolant, wi: DVec3, wo: DVec3) -> f64 {
        let mut v = [f64::NAN];
        assert!(i.bsdf(wi, wo, &mut v));
        v[0]
    }

    #[test]
    fn readings_are_met() {
        let m = sample(&Formula::new(0.4, 0.2, 0.3), &[0.0, 25.0, 60.0], &grid()).unwrap();
        let i = Interpolant::new(&m).unwrap();
        let mut v = [0.0; 2];
        for r in &m.readings {
            assert!(i.bsdf(r.wi, r.wo, &mut v));
            assert!((v[r.band as usize] - r.bsdf_per_sr).abs() < 1e-9, "{r:?} {v:?}");
        }
        let all = Coverage {
            reflection_adaxial: true,
            reflection_abaxial: true,
            transmission_adaxial: true,
            transmission_abaxial: true,
        };
        assert_eq!(i.coverage(), all);
    }

    #[test]
    fn a_smooth_sheet_is_followed() {
        let formula = Formula::new(0.4, 0.2, 0.3);
        let fine = ExitantGrid { theta_step_deg: 5.0, phi_step_deg: 10.0 };
        let lamps: Vec<f64> = (0..18).map(|i| 5.0 * f64::from(i)).collect();
        let i = Interpolant::new(&sample(&formula, &lamps, &fine).unwrap()).unwrap();
        let (mut v, mut expected) = ([0.0; 2], [0.0; 2]);
        for k in 0..2000 {
            let (wi, wo) =
                (random_direction(2 * k, k % 2 == 0, 85.0), random_direction(2 * k + 1, k % 3 == 0, 85.0));
            assert!(i.bsdf(wi, wo, &mut v) && formula.bsdf(wi, wo, &mut expected));
            // The highlight's curvature over half a step of lamp, theta and azimuth.
            assert!((v[1] - expected[1]).abs() < 0.012, "{wi} {wo}: {v:?} {expected:?}");
        }
    }

    #[test]
    fn linear_functions_are_exact() {
        let directions: Vec<DVec3> = (0..400).map(|i| random_direction(i, false, 89.0)).collect();
        let plane = |wi: DVec3, wo: DVec3| {
            let (ti, p, _) = place(wi, wo);
            2.0 + 0.3 * p.x - 0.2 * p.y + 0.4 * ti
        };
        let i = Interpolant::new(&measured(&[10.0, 30.0], &directions, plane)).unwrap();
        for k in 1000..1500 {
            let wo = direction_deg(70.0 * hash_to_unit(k), f64::from(k));
            let wi = direction_deg(10.0 + 20.0 * hash_to_unit(k + 9000), 0.0);
            assert!((ask(&i, wi, wo) - plane(wi, wo)).abs() < 1e-12, "{wi} {wo}");
        }
    }

    #[test]
    fn half_a_hemisphere_is_mirrored() {
        // The layout of a leaf goniospectrometer: azimuths 0 to 180 by 30, with a gap towards the lamp.
        let mut half = vec![DVec3::Z];
        for phi in 0..=6 {
            half.extend((1..=6).map(|t| direction_deg(10.0 * f64::from(t), 30.0 * f64::from(phi))));
        }
        let wi = direction_deg(20.0, 0.0);
        half.retain(|w| w.distance(wi) > 1e-9);
        let f = |_: DVec3, wo: DVec3| 1.0 + wo.x + wo.y.abs();
        let m = measured(&[20.0], &half, f);
        let i = Interpolant::new(&m).unwrap();
        for k in 0..200 {
            let wo = direction_deg(60.0 * hash_to_unit(k), 180.0 * hash_to_unit(k + 500));
            let there = ask(&i, wi, wo);
            assert!((there - ask(&i, wi, DVec3::new(wo.x, -wo.y, wo.z))).abs() < 1e-12);
            assert!((there - f(wi, wo)).abs() < 0.05, "{wo}: {there}");
        }
        // The other half gives the same.
        let other: Vec<DVec3> = half.iter().map(|w| DVec3::new(w.x, -w.y, w.z)).collect();
        let other = Interpolant::new(&measured(&[20.0], &other, f)).unwrap();
        let wo = direction_deg(33.0, 77.0);
        assert!((ask(&i, wi, wo) - ask(&other, wi, wo)).abs() < 1e-9);
        assert!(!i.coverage().transmission_adaxial && !i.coverage().reflection_abaxial);
        assert!(!i.bsdf(wi, -DVec3::Z, &mut [0.0]) && !i.bsdf(-wi, -DVec3::Z, &mut [0.0]));
    }

    #[test]
    fn a_scan_of_the_plane_is_held_across_it() {
        let scan: Vec<DVec3> =
            (0..=14).map(|t| DVec3::from_array(signed(f64::from(t) * 10.0 - 70.0))).collect();
        let i = Interpolant::new(&measured(&[30.0], &scan, |_, wo| 2.0 + wo.x.asin())).unwrap();
        let wi = direction_deg(30.0, 0.0);
        assert!((ask(&i, wi, direction_deg(15.0, 180.0)) - (2.0 - 15f64.to_radians())).abs() < 1e-9);
        // Out of the plane the value of its foot in the plane of angles.
        let foot = 40.0 * 60f64.to_radians().cos();
        assert!((ask(&i, wi, direction_deg(40.0, 60.0)) - (2.0 + f64::to_radians(foot))).abs() < 1e-9);
        assert!((ask(&i, wi, direction_deg(85.0, 0.0)) - (2.0 + 70f64.to_radians())).abs() < 1e-9);
        // One reading is a constant.
        let one = Interpolant::new(&measured(&[30.0], &scan[3..4], |_, _| 0.25)).unwrap();
        assert_eq!(ask(&one, wi, direction_deg(85.0, 70.0)), 0.25);
    }

    #[test]
    fn reciprocity_continues_the_lamps() {
        // Reciprocal, and far from constant.
        let f = |wi: DVec3, wo: DVec3| 0.1 + wi.z * wo.z + 0.5 * (wi + wo).z;
        let directions: Vec<DVec3> = (0..=17)
            .flat_map(|t| (0..36).map(move |p| direction_deg(5.0 * f64::from(t), 10.0 * f64::from(p))))
            .collect();
        let lamps = [0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0];
        let i = Interpolant::new(&measured(&lamps, &directions, f)).unwrap();
        for k in 0..300 {
            // The lamp beyond what was measured, the detector within the lamps.
            let wi = direction_deg(40.0 + 40.0 * hash_to_unit(k), f64::from(k));
            let wo = direction_deg(30.0 * hash_to_unit(k + 777), 3.0 * f64::from(k));
            assert!((ask(&i, wi, wo) - f(wi, wo)).abs() < 0.012, "{wi} {wo}");
            assert!((ask(&i, wi, wo) - ask(&i, wo, wi)).abs() < 1e-12);
        }
        // Neither: the last lamp is held.
        let (wi, wo) = (direction_deg(60.0, 0.0), direction_deg(70.0, 100.0));
        assert!((ask(&i, wi, wo) - f(direction_deg(30.0, 0.0), wo)).abs() < 1e-9);
        // Transmission that was measured from one side is known from both.
        let below: Vec<DVec3> = directions.iter().map(|w| DVec3::new(w.x, w.y, -w.z)).collect();
        let through = Interpolant::new(&measured(&lamps, &below, |wi, wo| f(wi, -wo))).unwrap();
        let (wi, wo) = (direction_deg(12.0, 0.0), direction_deg(130.0, 50.0));
        assert_eq!(ask(&through, wi, wo), ask(&through, wo, wi));
        assert!(through.coverage().transmission_abaxial && !through.coverage().reflection_adaxial);
    }

    #[test]
    fn peaks_between_lamps_split() {
        let peak = |wi: DVec3, wo: DVec3| {
            let mirror = DVec3::new(-wi.x, -wi.y, wi.z);
            (-(mirror.distance(wo) / 0.05).powi(2)).exp()
        };
        let directions: Vec<DVec3> = (0..=85).map(|t| direction_deg(f64::from(t), 180.0)).collect();
        let i = Interpolant::new(&measured(&[30.0, 50.0], &directions, peak)).unwrap();
        let wi = direction_deg(40.0, 0.0);
        assert!(ask(&i, wi, direction_deg(40.0, 180.0)) < 0.01);
        assert!((ask(&i, wi, direction_deg(30.0, 180.0)) - 0.5).abs() < 0.01);
    }

    #[test]
    fn bands_may_lack_directions() {
        let directions: Vec<DVec3> = (0..200).map(|i| random_direction(i, false, 89.0)).collect();
        // Positive everywhere: negative means would be held at zero.
        let f = |wi: DVec3, wo: DVec3| 3.0 + place(wi, wo).1.x;
        let mut m = measured(&[20.0], &directions, f);
        let red = m
            .readings
            .iter()
            .enumerate()
            .filter(|(i, r)| i % 3 != 0 || r.wo.z < 0.5)
            .map(|(_, r)| Reading { band: 1, ..*r });
        let red: Vec<Reading> = red.collect();
        m.readings.extend(red);
        m.bands.push(Band::nm(650.0));
        let i = Interpolant::new(&m).unwrap();
        let wi = direction_deg(20.0, 0.0);
        let mut v = [0.0; 2];
        for k in 0..100 {
            let wo = direction_deg(50.0 * hash_to_unit(k), f64::from(7 * k));
            assert!(i.bsdf(wi, wo, &mut v));
            assert!((v[0] - f(wi, wo)).abs() < 1e-9 && (v[1] - v[0]).abs() < 1e-9, "{wo}: {v:?}");
        }
        m.bands.push(Band::nm(750.0));
        assert!(Interpolant::new(&m).unwrap_err().to_string().contains("every band"));
    }

    #[test]
    fn what_cannot_be_interpolated_is_an_error() {
        assert!(Interpolant::new(&Measurement::default()).is_err());
        let mut m = measured(&[20.0], &[DVec3::Z], |_, _| f64::NAN);
        assert!(Interpolant::new(&m).is_err());
        m = measured(&[20.0], &[DVec3::Z], |_, _| 1.0);
        m.readings[0].band = 7;
        assert!(Interpolant::new(&m).is_err());
        m = Measurement { scale: Scale::RelativePerSeries, ..measured(&[20.0], &[DVec3::Z], |_, _| 1.0) };
        assert!(Interpolant::new(&m).is_ok());
        m.series.push("another".into());
        assert!(Interpolant::new(&m).unwrap_err().to_string().contains("series"));
    }
}

//! The plane of incidence of a measurement: which readings lie in it, at which signed angle.
//!
//! Model: with `up` the normal of the lit side and `t` the horizontal direction towards the lamp, a direction w has
//!
//! ```text
//! signed angle = atan2(w . t, w . up)       positive on the lamp's side, beyond +-90 deg transmission
//! elevation    = asin |w . (up x t)|        out of the plane
//! ```
//!
//! as in [`PlaneScan`](super::PlaneScan). A lamp at the normal has no plane of its own: then the one with the most readings
//! is taken, the x axis before others. Guarded by `angles_are_signed_towards_the_lamp` and
//! `a_lamp_at_the_normal_takes_the_fullest_plane`. Source: geometry.

use glam::DVec3;

use super::Measurement;

/// Least elevation up to which a reading counts as lying in the plane, degrees.
const MIN_HALF_WIDTH_DEG: f64 = 1.0;
/// Planes that are tried for a lamp at the normal.
const MAX_PLANES: usize = 64;

/// The plane through a lamp and the normal of the lit side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Unit vector to the lamp.
    pub wi: DVec3,
    up: DVec3,
    towards: DVec3,
}

impl Plane {
    /// The plane of a lamp of `measurement`.
    pub fn of(measurement: &Measurement, wi: DVec3) -> Self {
        let up = if wi.z >= 0.0 { DVec3::Z } else { -DVec3::Z };
        let horizontal = DVec3::new(wi.x, wi.y, 0.0);
        if let Some(towards) = horizontal.try_normalize().filter(|_| horizontal.length() > 1e-6) {
            return Self { wi, up, towards };
        }
        let mut planes = vec![Self { wi, up, towards: DVec3::X }];
        for r in measurement.readings.iter().filter(|r| r.wi.distance_squared(wi) < 1e-12) {
            // Any reading off the normal spans a plane; half a turn is the same plane.
            let flat = DVec3::new(r.wo.x, r.wo.y, 0.0);
            let Some(flat) = flat.try_normalize().filter(|_| flat.length() > 1e-3) else { continue };
            let towards = if flat.x < 0.0 { -flat } else { flat };
            if planes.len() < MAX_PLANES && planes.iter().all(|p| p.towards.dot(towards).abs() < 1.0 - 1e-9) {
                planes.push(Self { wi, up, towards });
            }
        }
        let mut best = (planes[0], planes[0].readings(measurement).len());
        for &plane in &planes[1..] {
            let count = plane.readings(measurement).len();
            if count > best.1 {
                best = (plane, count);
            }
        }
        best.0
    }

    /// Signed angle of a direction, degrees.
    pub fn angle_deg(&self, w: DVec3) -> f64 {
        w.dot(self.towards).atan2(w.dot(self.up)).to_degrees()
    }

    /// Angle out of the plane, degrees.
    pub fn elevation_deg(&self, w: DVec3) -> f64 {
        w.dot(self.up.cross(self.towards)).abs().min(1.0).asin().to_degrees()
    }

    /// The direction in the plane at a signed angle.
    pub fn direction(&self, angle_deg: f64) -> DVec3 {
        let (sin, cos) = angle_deg.to_radians().sin_cos();
        self.towards * sin + self.up * cos
    }

    /// The lamp's signed angle, degrees: never negative.
    pub fn lamp_deg(&self) -> f64 {
        self.angle_deg(self.wi).abs()
    }

    /// Readings of this lamp in the plane, to the detector's half angle but at least 1 degree: signed angle and index, by
    /// increasing angle.
    pub fn readings(&self, measurement: &Measurement) -> Vec<(f64, usize)> {
        let half_width_deg = measurement.detector_half_angle_deg.max(MIN_HALF_WIDTH_DEG);
        let mut found: Vec<(f64, usize)> = measurement
            .readings
            .iter()
            .enumerate()
            .filter(|(_, r)| r.wi.distance_squared(self.wi) < 1e-12)
            .filter(|(_, r)| self.elevation_deg(r.wo) <= half_width_deg)
            .map(|(i, r)| (self.angle_deg(r.wo), i))
            .collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::Reading;
    use crate::gonio::measurement::direction_deg;

    type Angles = (f64, f64);

    fn measurement(directions: &[(Angles, Angles)]) -> Measurement {
        let reading = |&(i, o): &(Angles, Angles)| Reading {
            wi: direction_deg(i.0, i.1),
            wo: direction_deg(o.0, o.1),
            series: 0,
            band: 0,
            bsdf_per_sr: 1.0,
            sigma_per_sr: None,
        };
        Measurement { readings: directions.iter().map(reading).collect(), ..Default::default() }
    }

    #[test]
    fn angles_are_signed_towards_the_lamp() {
        let lamp = (30.0, 70.0);
        let m = measurement(&[
            (lamp, (50.0, 70.0)),
            (lamp, (20.0, 250.0)),
            (lamp, (20.0, 160.0)),
            (lamp, (150.0, 250.0)),
            (lamp, (0.0, 0.0)),
        ]);
        let plane = Plane::of(&m, m.readings[0].wi);
        let found = plane.readings(&m);
        let expected = [(-150.0, 3), (-20.0, 1), (0.0, 4), (50.0, 0)];
        assert_eq!(found.len(), expected.len());
        for ((angle, i), (expected, j)) in found.iter().zip(expected) {
            assert!((angle - expected).abs() < 1e-9 && *i == j, "{found:?}");
            assert!(plane.direction(*angle).distance(m.readings[*i].wo) < 1e-12);
        }
        assert!((plane.lamp_deg() - 30.0).abs() < 1e-9);
        // Lit from below, the lamp's side stays the positive one.
        let m = measurement(&[((150.0, 0.0), (140.0, 0.0)), ((150.0, 0.0), (40.0, 180.0))]);
        let plane = Plane::of(&m, m.readings[0].wi);
        assert!(
            (plane.lamp_deg() - 30.0).abs() < 1e-9 && (plane.angle_deg(m.readings[0].wo) - 40.0).abs() < 1e-9
        );
        assert!((plane.angle_deg(m.readings[1].wo) + 140.0).abs() < 1e-9);
    }

    #[test]
    fn a_lamp_at_the_normal_takes_the_fullest_plane() {
        let up = (0.0, 0.0);
        let m = measurement(&[(up, (30.0, 45.0)), (up, (30.0, 225.0)), (up, (30.0, 0.0)), (up, up)]);
        let plane = Plane::of(&m, DVec3::Z);
        assert_eq!(plane.readings(&m).len(), 3);
        assert!((plane.angle_deg(m.readings[0].wo) - 30.0).abs() < 1e-9);
        // At a tie the x axis.
        let m = measurement(&[(up, (30.0, 45.0)), (up, (30.0, 0.0))]);
        let found = Plane::of(&m, DVec3::Z).readings(&m);
        assert!(found.len() == 1 && found[0].1 == 1, "{found:?}");
    }
}

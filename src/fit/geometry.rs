//! The directions of a reading whose lamp and detector fill cones.
//!
//! Model: the reading is the mean of the BSDF over both cones, each direction weighted by its |cos theta| (what the lamp
//! sends to the sample, what the detector receives from it).
//!
//! reading = sum_a sum_b v_a v_b f(wi_a, wo_b), v = |cos| / sum |cos|
//!
//! - half angle of the lamp's cone -> `source_half_angle_deg` -> deg -> 0
//! - half angle of the detector's -> `detector_half_angle_deg` -> deg -> 0
//!
//! A cone takes Stroud's rule S2 5-1 (the axis with weight 1/4, six directions at sqrt(2/3) of its radius with 1/8
//! each), exact for polynomials of degree 5 on the disc, mapped so that equal areas are equal solid angles; 49 pairs if
//! both are open. Directions that a cone near the horizon has beyond it are left out: the beam that misses the side.
//! Guarded by `means_over_cones` and `cones_keep_to_their_side`. Source: Stroud 1971, *Approximate Calculation of
//! Multiple Integrals*, p. 270; the weighting is our reading.

use std::f64::consts::FRAC_PI_3;

use glam::DVec3;

use super::Geometry;

impl Geometry {
    /// Directions of a reading with the half angles of the lamp's and the detector's cones.
    pub fn cones(wi: DVec3, wo: DVec3, source_half_angle_deg: f64, detector_half_angle_deg: f64) -> Self {
        let (lamp, detector) = (cone(wi, source_half_angle_deg), cone(wo, detector_half_angle_deg));
        let pairs =
            lamp.iter().flat_map(|&(i, v)| detector.iter().map(move |&(o, u)| (i, o, v * u))).collect();
        Self { pairs }
    }
}

/// Directions of a cone with weights that sum to one.
fn cone(axis: DVec3, half_angle_deg: f64) -> Vec<(DVec3, f64)> {
    if half_angle_deg.is_nan() || half_angle_deg <= 0.0 {
        return vec![(axis, 1.0)];
    }
    let (s, t) = axis.any_orthonormal_pair();
    // Lambert's map: at distance d = 2 sin(angle / 2) from the centre equal areas are equal solid angles.
    let radius = 2.0 * (half_angle_deg.min(90.0).to_radians() / 2.0).sin();
    let d = (2.0f64 / 3.0).sqrt() * radius;
    let (cos, sin) = (1.0 - d * d / 2.0, d * (1.0 - d * d / 4.0).sqrt());
    let ring = (0..6).map(|i| {
        let (b, a) = (f64::from(i) * FRAC_PI_3).sin_cos();
        ((axis * cos + (s * a + t * b) * sin).normalize(), 0.125)
    });
    let side = if axis.z >= 0.0 { 1.0 } else { -1.0 };
    let points: Vec<(DVec3, f64)> = std::iter::once((axis, 0.25))
        .chain(ring)
        .map(|(w, v)| (w, v * side * w.z))
        .filter(|(_, v)| *v > 0.0)
        .collect();
    let sum: f64 = points.iter().map(|p| p.1).sum();
    // At the horizon itself all weights may be rounding.
    if sum < 1e-12 {
        return vec![(axis, 1.0)];
    }
    points.into_iter().map(|(w, v)| (w, v / sum)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::measurement::direction_deg;

    #[test]
    fn means_over_cones() {
        let up = DVec3::Z;
        for half_deg in [1.0f64, 5.0, 15.0] {
            let g = Geometry::cones(up, up, half_deg, 0.0);
            assert_eq!(g.pairs.len(), 7);
            // Mean of cos^n over a cone about the normal, weighted by cos: closed forms.
            let c = half_deg.to_radians().cos();
            let mean = |n: i32| g.pairs.iter().map(|(wi, _, v)| v * wi.z.powi(n)).sum::<f64>();
            let exact = |n: i32| 2.0 * (1.0 - c.powi(n + 2)) / (f64::from(n + 2) * (1.0 - c * c));
            for n in [1, 2, 8] {
                assert!((mean(n) / exact(n) - 1.0).abs() < 3e-4, "{half_deg} {n}: {} {}", mean(n), exact(n));
            }
        }
        let both = Geometry::cones(direction_deg(30.0, 0.0), direction_deg(150.0, 70.0), 3.0, 2.0);
        assert_eq!(both.pairs.len(), 49);
        assert!((both.pairs.iter().map(|p| p.2).sum::<f64>() - 1.0).abs() < 1e-14);
        assert!(both.pairs.iter().all(|p| (p.0.length() - 1.0).abs() < 1e-14));
        assert_eq!(Geometry::cones(up, up, 0.0, 0.0), Geometry::point(up, up));
    }

    #[test]
    fn cones_keep_to_their_side() {
        for theta in [84.0, 88.0, 90.0, 92.0, 96.0] {
            let wi = direction_deg(theta, 20.0);
            let side = if wi.z >= 0.0 { 1.0 } else { -1.0 };
            let g = Geometry::cones(wi, DVec3::Z, 6.0, 0.0);
            assert!(g.pairs.iter().all(|p| p.0.z * side >= 0.0 && p.2 > 0.0), "{theta}");
            assert!((g.pairs.iter().map(|p| p.2).sum::<f64>() - 1.0).abs() < 1e-12, "{theta}");
        }
    }
}

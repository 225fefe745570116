//! UTIA `.bin`: an anisotropic BRDF in red, green and blue over two directions.
//!
//! Layout: no header, little-endian f64, three planes (R, G, B); in a plane 6 x 48 x 6 x 48 values in the order
//! `[theta_i][phi_i][theta_v][phi_v]` with steps of 15 deg (0 to 75) and 7.5 deg (0 to 352.5). Our reading: i is the
//! lamp, v the detector, azimuths counter-clockwise from +x, values the BRDF in 1/sr; values below zero, which noise
//! leaves in such tables, count as zero.
//!
//! Linear in all four angles, the azimuths around the circle; beyond 75 deg the value at 75 deg is held. Guarded by
//! `values_are_in_the_formats_order`, `between_nodes_it_is_linear_and_beyond_75_deg_held` and
//! `damaged_files_are_errors`.
//! Source: Filip2014.

use glam::DVec3;

use super::invalid;
use super::merl::finite_f64s;
use crate::Result;
use crate::gonio::measurement::angles_deg;
use crate::gonio::{Band, Coverage, Directional};

const THETAS: usize = 6;
const PHIS: usize = 48;
const THETA_STEP_DEG: f64 = 15.0;
const PHI_STEP_DEG: f64 = 7.5;
const PER_PLANE: usize = THETAS * PHIS * THETAS * PHIS;

/// Length of every UTIA file: three planes of doubles.
pub const BYTES: usize = 3 * PER_PLANE * 8;

/// A BRDF that was read from a UTIA file.
#[derive(Clone, Debug, PartialEq)]
pub struct UtiaBrdf {
    /// Three planes.
    values: Vec<f64>,
    bands: Vec<Band>,
}

/// Reads a file.
pub fn read(bytes: &[u8]) -> Result<UtiaBrdf> {
    if bytes.len() != BYTES {
        let what = format!("{} bytes; a UTIA file has {BYTES}: 3 x 6 x 48 x 6 x 48 values of 8", bytes.len());
        return Err(invalid("UTIA", what));
    }
    let mut values = finite_f64s(bytes, "UTIA")?;
    values.iter_mut().for_each(|v| *v = v.max(0.0));
    Ok(UtiaBrdf { values, bands: ["R", "G", "B"].map(Band::named).to_vec() })
}

/// The nodes around a direction and their weights: `(theta index * PHIS + phi index, weight)`.
fn nodes(w: DVec3) -> [(usize, f64); 4] {
    let (theta, phi) = angles_deg(w);
    let t = (theta / THETA_STEP_DEG).clamp(0.0, (THETAS - 1) as f64);
    let p = (phi / PHI_STEP_DEG).rem_euclid(PHIS as f64);
    let (t0, p0) = ((t as usize).min(THETAS - 2), p as usize % PHIS);
    let (ft, fp) = (t - t0 as f64, p.fract());
    let p1 = (p0 + 1) % PHIS;
    [
        (t0 * PHIS + p0, (1.0 - ft) * (1.0 - fp)),
        (t0 * PHIS + p1, (1.0 - ft) * fp),
        ((t0 + 1) * PHIS + p0, ft * (1.0 - fp)),
        ((t0 + 1) * PHIS + p1, ft * fp),
    ]
}

impl Directional for UtiaBrdf {
    fn bands(&self) -> &[Band] {
        &self.bands
    }

    fn coverage(&self) -> Coverage {
        Coverage { reflection_adaxial: true, ..Coverage::default() }
    }

    fn is_isotropic(&self) -> bool {
        false
    }

    fn bsdf(&self, wi: DVec3, wo: DVec3, values: &mut [f64]) -> bool {
        values.fill(0.0);
        if !(wi.z > 0.0 && wo.z > 0.0) {
            return false;
        }
        for (i, wi_weight) in nodes(wi) {
            for (o, wo_weight) in nodes(wo) {
                let at = i * THETAS * PHIS + o;
                for (plane, v) in values.iter_mut().enumerate().take(3) {
                    *v += wi_weight * wo_weight * self.values[plane * PER_PLANE + at];
                }
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::measurement::direction_deg;
    use crate::io::damage::damage;

    fn file(value: impl Fn(usize, [usize; 4]) -> f64) -> Vec<u8> {
        let mut bytes = Vec::new();
        for plane in 0..3 {
            for i in 0..PER_PLANE {
                let index = [i / (48 * 6 * 48), i / (6 * 48) % 48, i / 48 % 6, i % 48];
                bytes.extend_from_slice(&value(plane, index).to_le_bytes());
            }
        }
        bytes
    }

    #[test]
    fn values_are_in_the_formats_order() {
        let index = [3, 11, 1, 40];
        let brdf = read(&file(|plane, at| if at == index { 1.0 + plane as f64 } else { 0.0 })).unwrap();
        let (wi, wo) = (direction_deg(45.0, 11.0 * 7.5), direction_deg(15.0, 300.0));
        let mut v = [0.0; 3];
        assert!(brdf.bsdf(wi, wo, &mut v) && (v[0] - 1.0).abs() < 1e-9 && (v[2] - 3.0).abs() < 1e-9, "{v:?}");
        assert!(brdf.bsdf(wo, wi, &mut v) && v == [0.0; 3], "{v:?}");
        assert!(!brdf.bsdf(wi, -wo, &mut v) && !brdf.bsdf(-wi, wo, &mut v));
    }

    #[test]
    fn between_nodes_it_is_linear_and_beyond_75_deg_held() {
        let brdf = read(&file(|plane, [ti, _, tv, pv]| {
            let turn = if pv == 47 { 1.0 } else { 0.0 };
            if plane == 0 { ti as f64 + 10.0 * tv as f64 } else { turn - 0.5 * (1.0 - turn) }
        }))
        .unwrap();
        let mut v = [0.0; 3];
        assert!(brdf.bsdf(direction_deg(22.5, 3.0), direction_deg(40.0, 200.0), &mut v));
        assert!((v[0] - (1.5 + 10.0 * 40.0 / 15.0)).abs() < 1e-9, "{v:?}");
        // Negative readings are zero, and the last azimuth's neighbour is the first.
        assert_eq!(v[1], 0.0);
        assert!(brdf.bsdf(direction_deg(80.0, 3.0), direction_deg(89.0, 360.0 - 2.5), &mut v));
        assert!((v[0] - 55.0).abs() < 1e-9 && (v[1] - 1.0 / 3.0).abs() < 1e-9, "{v:?}");
    }

    #[test]
    fn damaged_files_are_errors() {
        let valid = file(|_, [ti, ..]| ti as f64);
        assert!(read(&valid).is_ok());
        damage(&valid[..3000], 300, read);
        for cut in [0, 8, valid.len() - 8, valid.len() - 1] {
            assert!(read(&valid[..cut]).unwrap_err().to_string().contains("1990656"));
        }
        for bad in [f64::NAN, f64::INFINITY] {
            let mut bytes = valid.clone();
            bytes[80..88].copy_from_slice(&bad.to_le_bytes());
            assert!(read(&bytes).unwrap_err().to_string().contains("value 10 is"), "{bad}");
        }
    }
}

//! A BSDF as a function of two directions, whatever table or formula stands behind it.
//!
//! What formats are converted from and plots are drawn of. Directions as in [`super::measurement`]: unit vectors of the
//! sample's frame, away from the surface, +z adaxial (front); values 1/sr, without the cosine.

use glam::DVec3;

use super::measurement::{Band, direction_deg};
use crate::geometry::Side;
use crate::math::quadrature::GaussLegendre;

/// Which of the four parts of a BSDF are known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Coverage {
    /// Lit and seen from the adaxial (front) side.
    pub reflection_adaxial: bool,
    /// Lit and seen from the abaxial (back) side.
    pub reflection_abaxial: bool,
    /// Lit from the adaxial side, seen from the abaxial one.
    pub transmission_adaxial: bool,
    /// Lit from the abaxial side, seen from the adaxial one.
    pub transmission_abaxial: bool,
}

impl Coverage {
    /// Is the part known that these directions belong to?
    pub fn has(&self, wi: DVec3, wo: DVec3) -> bool {
        match (wi.z > 0.0, wo.z > 0.0) {
            (true, true) => self.reflection_adaxial,
            (false, false) => self.reflection_abaxial,
            (true, false) => self.transmission_adaxial,
            (false, true) => self.transmission_abaxial,
        }
    }
}

/// A BSDF that can be asked for any two directions.
pub trait Directional: Send + Sync {
    /// Channels, in the order of the values.
    fn bands(&self) -> &[Band];

    /// Parts that are known.
    fn coverage(&self) -> Coverage;

    /// Does the value depend on the difference of the azimuths only?
    fn is_isotropic(&self) -> bool {
        true
    }

    /// BSDF of every band, 1/sr, into `values` (as long as [`Directional::bands`]). False, with zeros, where it is not
    /// known. Never negative, never NaN.
    fn bsdf(&self, wi: DVec3, wo: DVec3, values: &mut [f64]) -> bool;
}

/// Share of the light from `wi` that leaves on `side`, per band: the integral of the BSDF times |cos| by a product rule
/// of `thetas` Gauss points in sin^2(theta) and `phis` equal steps of azimuth.
pub fn directional_hemispherical(
    table: &dyn Directional,
    wi: DVec3,
    side: Side,
    (thetas, phis): (usize, usize),
) -> Vec<f64> {
    let bands = table.bands().len();
    let (mut sum, mut values) = (vec![0.0; bands], vec![0.0; bands]);
    let d_phi = std::f64::consts::TAU / phis as f64;
    // |cos| dw = d(sin^2 theta) / 2 d phi
    for (s2, weight) in GaussLegendre::new(thetas).on(0.0, 1.0) {
        let theta_deg = s2.sqrt().asin().to_degrees();
        for p in 0..phis {
            let phi_deg = (p as f64 + 0.5) * 360.0 / phis as f64;
            let wo =
                direction_deg(if side == Side::Adaxial { theta_deg } else { 180.0 - theta_deg }, phi_deg);
            if table.bsdf(wi, wo, &mut values) {
                sum.iter_mut().zip(&values).for_each(|(s, v)| *s += 0.5 * weight * d_phi * v);
            }
        }
    }
    sum
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A Lambertian sheet with a soft highlight, for tests of tables and formats.
    pub(crate) struct Sheet {
        pub(crate) bands: Vec<Band>,
        pub(crate) reflectance: f64,
        pub(crate) highlight: f64,
        pub(crate) transmittance: f64,
    }

    impl Sheet {
        pub(crate) fn new(reflectance: f64, highlight: f64, transmittance: f64) -> Self {
            Self { bands: vec![Band::nm(450.0), Band::nm(650.0)], reflectance, highlight, transmittance }
        }
    }

    impl Directional for Sheet {
        fn bands(&self) -> &[Band] {
            &self.bands
        }
        fn coverage(&self) -> Coverage {
            let through = self.transmittance > 0.0;
            Coverage {
                reflection_adaxial: true,
                reflection_abaxial: true,
                transmission_adaxial: through,
                transmission_abaxial: through,
            }
        }
        fn bsdf(&self, wi: DVec3, wo: DVec3, values: &mut [f64]) -> bool {
            let pi = std::f64::consts::PI;
            for (i, v) in values.iter_mut().enumerate() {
                let scale = if i == 0 { 0.5 } else { 1.0 };
                *v = scale
                    * if wi.z * wo.z > 0.0 {
                        let cos = DVec3::new(-wi.x, -wi.y, wi.z).dot(wo).max(0.0);
                        self.reflectance / pi + self.highlight * 6.0 / (2.0 * pi) * cos.powi(4)
                    } else {
                        self.transmittance / pi
                    };
            }
            true
        }
    }

    #[test]
    fn totals_of_a_sheet() {
        let sheet = Sheet::new(0.4, 0.1, 0.3);
        let up = direction_deg(0.0, 0.0);
        let r = directional_hemispherical(&sheet, up, Side::Adaxial, (16, 32));
        let t = directional_hemispherical(&sheet, direction_deg(140.0, 30.0), Side::Adaxial, (16, 32));
        assert!((r[1] - 0.5).abs() < 1e-12 && (r[0] - 0.25).abs() < 1e-12, "{r:?}");
        assert!((t[1] - 0.3).abs() < 1e-12, "{t:?}");
    }
}

//! Beckmann microfacets: facets with Gaussian slopes in V-shaped grooves, of one reflectance at every angle.
//!
//! Equation, where `wo` and `wi` leave the same side, else 0 (c = cosine, h = half vector):
//!
//! ```text
//! f = ks D G / (4 c_i c_o)     D = exp(-tan^2(theta_h) / m^2) / (pi m^2 c_h^4)
//! G = min(1, 2 c_h c_o / wo.h, 2 c_h c_i / wo.h)
//! ```
//!
//! | symbol | parameter | unit | default |
//! |---|---|---|---|
//! | ks | `ks` | share of the light that a facet reflects, 0 to 1 | starts at 0.1 |
//! | m | `m` | root mean square slope, pure number, 0.02 to 1 | starts at 0.3 |
//!
//! Limits: single scattering: the albedo is ks for a smooth surface and less for a rough one, never more at any angle
//! (Guarded by `lobes_make_no_light`, `coefficients_are_shares_at_normal_incidence`). No Fresnel effect: ks is a
//! share, so that the lobe turned back to the lamp ([`super::retro`]) can have one of its own. G does not know m,
//! which keeps all geometry out of the search. Source: Cook and Torrance, A reflectance model for computer graphics,
//! ACM Trans. Graph. 1:1, 1982.

use std::f64::consts::PI;

use glam::DVec3;

use super::term::{MAX_PARAMETERS, Term, coefficient, roughness};
use crate::fit::Parameter;

/// The lobe of Gaussian slopes.
pub struct Beckmann {
    ks: f64,
    m: f64,
}

impl Term for Beckmann {
    /// tan^2(theta_h) and `G / (4 pi c_i c_o c_h^4)`.
    type Pair = (f64, f64);

    fn parameters() -> Vec<Parameter> {
        vec![coefficient("ks", "highlight", 0.1), roughness("m", "root mean square slope")]
    }

    fn pair(wi: DVec3, wo: DVec3) -> Option<(f64, f64)> {
        let h = wi + wo;
        let sin2 = h.truncate().length_squared() / h.length_squared();
        let cos2 = 1.0 - sin2;
        // At slopes of 1e3 and more no facet stands, however rough.
        if cos2.is_nan() || cos2 < 1e-6 {
            return None;
        }
        let (cos_h, wo_h) = (cos2.sqrt(), 0.5 * h.length());
        let g = (2.0 * cos_h * wi.z.min(wo.z) / wo_h).min(1.0);
        Some((sin2 / cos2, g / (4.0 * PI * wi.z * wo.z * cos2 * cos2)))
    }

    fn new(p: &[f64]) -> Self {
        Self { ks: p[0], m: p[1] }
    }

    fn eval(&self, &(tan2, scale): &Self::Pair) -> (f64, [f64; MAX_PARAMETERS]) {
        let x = tan2 / (self.m * self.m);
        let lobe = scale * (-x).exp() / (self.m * self.m);
        (self.ks * lobe, [lobe, self.ks * lobe * 2.0 * (x - 1.0) / self.m])
    }
}

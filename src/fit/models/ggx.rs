//! GGX microfacets: a rough interface whose facets reflect by Fresnel's law.
//!
//! Equation, where `wo` and `wi` leave the same side, else 0 (c = cosine, h = half vector):
//!
//! ```text
//! f = F D G / (4 c_i c_o)      F = f0 + (1 - f0)(1 - wo.h)^5
//! D = a^2 / (pi (a^2 c_h^2 + s_h^2)^2)
//! G / (4 c_i c_o) = 1/2 / (c_o sqrt(c_i^2 + a^2 s_i^2) + c_i sqrt(c_o^2 + a^2 s_o^2))
//! ```
//!
//! | symbol | parameter | unit | default |
//! |---|---|---|---|
//! | f0 | `f0` | Fresnel reflectance at normal incidence, 0 to 1 | starts at 0.04 |
//! | a | `alpha` | roughness, pure number, 0.02 to 1 | starts at 0.3 |
//!
//! Limits: single scattering, so a rough interface with f0 = 1 loses light, and never makes any (Guarded by
//! `lobes_make_no_light`); f0 = 0 still reflects at grazing. A diffuse term beside it is not reduced by F, so the sum
//! may exceed one towards grazing. Source: Walter et al., Microfacet models for refraction through rough surfaces,
//! EGSR 2007; height-correlated masking Heitz, JCGT 3:2, 2014; F Schlick, CGF 13:3, 1994.

use std::f64::consts::PI;

use glam::DVec3;

use super::term::{MAX_PARAMETERS, Term, roughness};
use crate::fit::{Kind, Parameter};

/// The interface.
pub struct Ggx {
    f0: f64,
    alpha: f64,
}

/// Directions as GGX sees them.
#[derive(Clone, Copy, Debug)]
pub struct GgxPair {
    cos_i: f64,
    cos_o: f64,
    sin2_h: f64,
    /// (1 - wo.h)^5
    schlick: f64,
}

impl Term for Ggx {
    type Pair = GgxPair;

    fn parameters() -> Vec<Parameter> {
        let f0 = Parameter {
            name: "f0".into(),
            meaning: "Fresnel reflectance at normal incidence, a pure number".into(),
            kind: Kind::Shape,
            start: 0.04,
            min: 0.0,
            max: 1.0,
            logarithmic: false,
        };
        vec![f0, roughness("alpha", "roughness (GGX)")]
    }

    fn pair(wi: DVec3, wo: DVec3) -> Option<GgxPair> {
        let h = wi + wo;
        let sin2_h = h.truncate().length_squared() / h.length_squared();
        // |wi + wo| / 2 is the cosine of half the angle between them.
        let schlick = (1.0 - 0.5 * h.length()).max(0.0).powi(5);
        sin2_h.is_finite().then_some(GgxPair { cos_i: wi.z, cos_o: wo.z, sin2_h: sin2_h.min(1.0), schlick })
    }

    fn new(p: &[f64]) -> Self {
        Self { f0: p[0], alpha: p[1] }
    }

    fn eval(&self, g: &GgxPair) -> (f64, [f64; MAX_PARAMETERS]) {
        let a2 = self.alpha * self.alpha;
        let cos2_h = 1.0 - g.sin2_h;
        let spread = a2 * cos2_h + g.sin2_h;
        let d = a2 / (PI * spread * spread);
        let (ci2, co2) = (g.cos_i * g.cos_i, g.cos_o * g.cos_o);
        let root_i = (ci2 + a2 * (1.0 - ci2)).sqrt();
        let root_o = (co2 + a2 * (1.0 - co2)).sqrt();
        let masking = g.cos_o * root_i + g.cos_i * root_o;
        let shape = d * 0.5 / masking;
        let fresnel = self.f0 + (1.0 - self.f0) * g.schlick;
        // d ln(shape) / d a^2
        let masking_slope = 0.5 * (g.cos_o * (1.0 - ci2) / root_i + g.cos_i * (1.0 - co2) / root_o);
        let slope = 1.0 / a2 - 2.0 * cos2_h / spread - masking_slope / masking;
        let value = fresnel * shape;
        (value, [(1.0 - g.schlick) * shape, value * slope * 2.0 * self.alpha])
    }
}

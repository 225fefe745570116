//! Lambert: the same radiance in every direction of the lit side.
//!
//! Equation: `f(wo, wi) = kd / pi` where `wo` and `wi` leave the same side, else 0.
//!
//! | symbol | parameter | unit | default |
//! |---|---|---|---|
//! | kd | `kd` | share of the incident light, 0 to 1 | starts at 0.3 |
//!
//! Limits: no dependence on angle, no light through the sheet. The reflectance is kd at every incidence
//! (Guarded by `coefficients_are_shares_at_normal_incidence`); the same formula renders
//! (`fitted_formulas_are_the_rendered_ones`). Source: J. H. Lambert, Photometria, 1760.

use std::f64::consts::FRAC_1_PI;

use glam::DVec3;

use super::term::{MAX_PARAMETERS, Term, coefficient};
use crate::fit::Parameter;

/// The diffuse term.
pub struct Lambert {
    kd: f64,
}

impl Term for Lambert {
    type Pair = ();

    fn parameters() -> Vec<Parameter> {
        vec![coefficient("kd", "diffuse reflection", 0.3)]
    }

    fn pair(_: DVec3, _: DVec3) -> Option<()> {
        Some(())
    }

    fn new(p: &[f64]) -> Self {
        Self { kd: p[0] }
    }

    fn eval(&self, (): &()) -> (f64, [f64; MAX_PARAMETERS]) {
        (self.kd * FRAC_1_PI, [FRAC_1_PI, 0.0])
    }
}

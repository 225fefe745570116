//! Phong's lobe: a power of the cosine around the mirror direction, normalised and reciprocal.
//!
//! Equation: `f(wo, wi) = ks (n + 2) / (2 pi) max(0, cos alpha)^n` where `wo` and `wi` leave the same side, else 0;
//! alpha is the angle between `wo` and the mirror direction of `wi`.
//!
//! | symbol | parameter | unit | default |
//! |---|---|---|---|
//! | ks | `ks` | share of the incident light at normal incidence, 0 to 1 | starts at 0.1 |
//! | n | `n` | pure number, 0.1 to 1e4 | starts at 20 |
//!
//! Limits: no Fresnel effect, no light back to the lamp, darker towards grazing. The albedo is ks at normal incidence
//! and less elsewhere (Guarded by `coefficients_are_shares_at_normal_incidence`, `lobes_make_no_light`); the same
//! formula renders (`fitted_formulas_are_the_rendered_ones`). Source: Phong, CACM 18:6, 1975; normalisation Lafortune
//! and Willems, CW 197, 1994.

use glam::DVec3;

use super::term::{MAX_PARAMETERS, PowerCosine, Term, coefficient, exponent, mirror};
use crate::fit::Parameter;

/// The lobe around the mirror direction.
pub struct Phong(PowerCosine);

impl Term for Phong {
    /// ln cos alpha
    type Pair = f64;

    fn parameters() -> Vec<Parameter> {
        vec![coefficient("ks", "highlight", 0.1), exponent("n", "exponent of the highlight", 20.0)]
    }

    fn pair(wi: DVec3, wo: DVec3) -> Option<f64> {
        PowerCosine::ln_cos(mirror(wi), wo)
    }

    fn new(p: &[f64]) -> Self {
        Self(PowerCosine::new(p))
    }

    fn eval(&self, ln_cos: &f64) -> (f64, [f64; MAX_PARAMETERS]) {
        self.0.eval(*ln_cos)
    }
}

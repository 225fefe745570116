//! Blinn's lobe: a power of the cosine between the normal and the half vector.
//!
//! Equation: `f(wo, wi) = ks c(n) cos^n(theta_h)`, `c(n) = (n + 2)(n + 4) / (8 pi (2^(-n/2) + n))`, where `wo` and
//! `wi` leave the same side, else 0; theta_h is the angle between the normal and `wi + wo`.
//!
//! | symbol | parameter | unit | default |
//! |---|---|---|---|
//! | ks | `ks` | share of the incident light at normal incidence, 0 to 1 | starts at 0.1 |
//! | n | `n` | pure number, 0.1 to 1e4 | starts at 50 |
//!
//! c(n) makes the albedo exactly ks at normal incidence, where theta_h is half the angle of `wo`; it is less
//! elsewhere (Guarded by `coefficients_are_shares_at_normal_incidence`, `lobes_make_no_light`). Unlike Phong's, the
//! lobe is narrower across the plane of incidence than in it as the lamp goes to grazing, as on rough surfaces
//! (`half_vector_lobes_are_narrow_across_the_plane`). Limits: no Fresnel effect, darker towards grazing. Source:
//! Blinn, Models of light reflection for computer synthesized pictures, SIGGRAPH 1977; the normalisation is the
//! closed integral.

use std::f64::consts::{LN_2, PI};

use glam::DVec3;

use super::term::{MAX_PARAMETERS, Term, coefficient, exponent};
use crate::fit::Parameter;

/// The lobe around the half vector.
pub struct Blinn {
    ks: f64,
    n: f64,
    scale: f64,
    /// d ln(scale) / d n
    slope: f64,
}

impl Term for Blinn {
    /// ln cos theta_h
    type Pair = f64;

    fn parameters() -> Vec<Parameter> {
        vec![coefficient("ks", "highlight", 0.1), exponent("n", "exponent of the highlight", 50.0)]
    }

    fn pair(wi: DVec3, wo: DVec3) -> Option<f64> {
        let h = wi + wo;
        // The half vector's cosine by its sine, for sharp lobes; the floor keeps the logarithm finite.
        let sin2 = h.truncate().length_squared() / h.length_squared();
        sin2.is_finite().then(|| 0.5 * (-sin2.min(1.0)).ln_1p().max(-1000.0))
    }

    fn new(p: &[f64]) -> Self {
        let (ks, n) = (p[0], p[1]);
        let tail = (-0.5 * LN_2 * n).exp();
        let scale = (n + 2.0) * (n + 4.0) / (8.0 * PI * (tail + n));
        let slope = 1.0 / (n + 2.0) + 1.0 / (n + 4.0) - (1.0 - 0.5 * LN_2 * tail) / (tail + n);
        Self { ks, n, scale, slope }
    }

    fn eval(&self, ln_cos: &f64) -> (f64, [f64; MAX_PARAMETERS]) {
        let lobe = self.scale * (self.n * ln_cos).exp();
        (self.ks * lobe, [lobe, self.ks * lobe * (self.slope + ln_cos)])
    }
}

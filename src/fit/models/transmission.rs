//! Light through the petal: scattered by the tissue, straight through, or reflected once inside an epidermal cell.
//!
//! Equation, on opposite sides, else 0:
//!
//! ```text
//! f(wo, wi) = t / pi + td (m_d + 2) / (2 pi) cos^m_d(a_d) + ti (m_i + 2) / (2 pi) cos^m_i(a_i)
//! a_d = angle between wo and (-x, -y, -z) of wi: the way straight on
//! a_i = angle between wo and ( x,  y, -z) of wi: straight on, its horizontal part turned round
//! ```
//!
//! Each cosine counts from zero up. Domes are higher than wide, so the inner wall that faces the lamp stands upright:
//! it turns the ray's horizontal part round and leaves its depth.
//!
//! | symbol | parameter | unit | default |
//! |---|---|---|---|
//! | t | `t` | share of the incident light that leaves diffusely, 0 to 1 | starts at 0.2 |
//! | td, m_d | `td`, `m_d` | direct: share at normal incidence; exponent, 0.1 to 1e4 | start at 0.05, 20 |
//! | ti, m_i | `ti`, `m_i` | indirect: the same | start at 0.05, 10 |
//!
//! Limits: at normal incidence direct and indirect light go one way, so such readings alone cannot tell them apart.
//! Each share is exact at normal incidence, and the lobes pass less elsewhere (Guarded by
//! `coefficients_are_shares_at_normal_incidence`, `lobes_make_no_light`); [`crate::micro::transmission`] renders the
//! same formula (`fitted_transmission_is_the_rendered_one`). Source: the division into direct and once-reflected
//! light is Tachino's (master's thesis, JAIST, 2000; only its table of contents could be read); the equations are our
//! reading.

use std::f64::consts::FRAC_1_PI;

use glam::DVec3;

use super::Sum;
use super::term::{Closed, MAX_PARAMETERS, PowerCosine, Term, coefficient, exponent, mirror};
use crate::fit::{Model, Parameter};

/// All three terms, as the model `transmission`; also to be added to a model of reflection.
pub fn model() -> Box<dyn Model> {
    Box::new(Sum::new(
        "transmission",
        vec![
            Closed::<Diffuse>::boxed("diffuse"),
            Closed::<Direct>::boxed("direct"),
            Closed::<Indirect>::boxed("indirect"),
        ],
    ))
}

/// Without a preferred direction.
pub struct Diffuse {
    t: f64,
}

impl Term for Diffuse {
    type Pair = ();
    const REFLECTS: bool = false;

    fn parameters() -> Vec<Parameter> {
        vec![coefficient("t", "diffuse transmission", 0.2)]
    }

    fn pair(_: DVec3, _: DVec3) -> Option<()> {
        Some(())
    }

    fn new(p: &[f64]) -> Self {
        Self { t: p[0] }
    }

    fn eval(&self, (): &()) -> (f64, [f64; MAX_PARAMETERS]) {
        (self.t * FRAC_1_PI, [FRAC_1_PI, 0.0])
    }
}

/// Around the way straight on.
pub struct Direct(PowerCosine);

impl Term for Direct {
    /// ln cos a_d
    type Pair = f64;
    const REFLECTS: bool = false;

    fn parameters() -> Vec<Parameter> {
        vec![
            coefficient("td", "direct transmission", 0.05),
            exponent("m_d", "exponent of the direct transmission", 20.0),
        ]
    }

    fn pair(wi: DVec3, wo: DVec3) -> Option<f64> {
        PowerCosine::ln_cos(-wi, wo)
    }

    fn new(p: &[f64]) -> Self {
        Self(PowerCosine::new(p))
    }

    fn eval(&self, ln_cos: &f64) -> (f64, [f64; MAX_PARAMETERS]) {
        self.0.eval(*ln_cos)
    }
}

/// Around the way that one upright wall has turned round.
pub struct Indirect(PowerCosine);

impl Term for Indirect {
    /// ln cos a_i
    type Pair = f64;
    const REFLECTS: bool = false;

    fn parameters() -> Vec<Parameter> {
        vec![
            coefficient("ti", "indirect transmission", 0.05),
            exponent("m_i", "exponent of the indirect transmission", 10.0),
        ]
    }

    fn pair(wi: DVec3, wo: DVec3) -> Option<f64> {
        PowerCosine::ln_cos(-mirror(wi), wo)
    }

    fn new(p: &[f64]) -> Self {
        Self(PowerCosine::new(p))
    }

    fn eval(&self, ln_cos: &f64) -> (f64, [f64; MAX_PARAMETERS]) {
        self.0.eval(*ln_cos)
    }
}

//! Retro-reflection: a mirror lobe whose light has changed sides, so that it comes back to the lamp.
//!
//! Equation: `f(wo, wi) = g(wo, mirror(wi))` with g one of the lobes of the half vector, [`super::blinn`] or
//! [`super::beckmann`], and `mirror(x, y, z) = (-x, -y, z)`. The half vector of `wo` and the mirrored light, the
//! *back vector*, is the normal where the viewer stands at the lamp.
//!
//! | symbol | parameter | unit | default |
//! |---|---|---|---|
//! | kr | `kr` | share of the incident light at normal incidence, 0 to 1 | starts at 0.1 |
//! | n or m | `n_r`, `m_r` | as in g | as in g |
//!
//! Limits: at normal incidence mirror and lamp are one direction, so such readings alone cannot tell kr from ks. The
//! lobe is g turned by 180 deg about the normal, reciprocal and with g's albedo (Guarded by
//! `retro_lobes_are_mirror_lobes_turned`). Source: Belcour et al., BRDF measurements and analysis of retroreflective
//! materials, JOSA A 31:12, 2014; the form with Blinn's lobe is known from fitting programs as "retro-Blinn"; that a
//! Beckmann lobe takes its masking from the mirrored light too is our reading.

use glam::DVec3;

use super::term::{MAX_PARAMETERS, Term, mirror};
use crate::fit::Parameter;

/// The lobe `T` around the back vector.
pub struct Retro<T>(T);

impl<T: Term> Term for Retro<T> {
    type Pair = T::Pair;

    fn parameters() -> Vec<Parameter> {
        let turn = |p: Parameter| match p.name.as_str() {
            "ks" => Parameter {
                name: "kr".into(),
                meaning: p.meaning.replace("highlight", "light back to the lamp"),
                ..p
            },
            name => {
                Parameter { name: format!("{name}_r"), meaning: format!("{} (to the lamp)", p.meaning), ..p }
            }
        };
        T::parameters().into_iter().map(turn).collect()
    }

    fn pair(wi: DVec3, wo: DVec3) -> Option<T::Pair> {
        T::pair(mirror(wi), wo)
    }

    fn new(p: &[f64]) -> Self {
        Self(T::new(p))
    }

    fn eval(&self, pair: &T::Pair) -> (f64, [f64; MAX_PARAMETERS]) {
        self.0.eval(pair)
    }
}

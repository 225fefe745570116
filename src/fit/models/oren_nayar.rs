//! Oren and Nayar: Lambertian facets in V-shaped grooves, with one interreflection.
//!
//! Equation (the full fit of 1994, not its qualitative short form), where `wo` and `wi` leave the same side, else 0:
//!
//! ```text
//! f = kd/pi (C1 + cos(phi) C2 tan(b) + (1 - |cos(phi)|) C3 tan((a + b)/2))
//!   + 0.17 kd^2/pi s/(s + 0.13) (1 - cos(phi) (2 b/pi)^2)
//! a, b = larger and smaller of the two angles from the normal, phi = difference of the azimuths, s = sigma^2
//! C1 = 1 - 0.5 s/(s + 0.33)   C3 = 0.125 s/(s + 0.09) (4 a b/pi^2)^2
//! C2 = 0.45 s/(s + 0.09) (sin(a) - (2 b/pi)^3 where cos(phi) < 0)
//! ```
//!
//! | symbol | parameter | unit | default |
//! |---|---|---|---|
//! | kd | `kd` | share of the light that a facet reflects, 0 to 1 | starts at 0.3 |
//! | sigma | `sigma_deg` | standard deviation of the facets' slope angle, degrees, 0 to 60 | starts at 20 |
//!
//! kd is the facets' share, not the surface's: light that two facets exchange is partly lost, so the surface returns
//! kd (C1 + 0.17 kd s/(s + 0.13)) at normal incidence, and kd only for sigma = 0, which is Lambert (Guarded by
//! `oren_nayar_returns_what_its_formula_says`). Limits: the fit falls below zero at steep slopes where lamp and
//! viewer both graze on opposite sides; there it counts as zero (`models_are_finite_at_the_horizon_and_at_bounds`).
//! Source: Oren and Nayar, Generalization of Lambert's reflectance model, SIGGRAPH 1994.

use std::f64::consts::{FRAC_1_PI, PI};

use glam::DVec3;

use super::term::{MAX_PARAMETERS, Term, coefficient};
use crate::fit::{Kind, Parameter};

/// Rough diffuse reflection.
pub struct OrenNayar {
    kd: f64,
    /// s / (s + 0.33), s / (s + 0.09), s / (s + 0.13) and their derivatives by sigma in degrees.
    facing: (f64, f64),
    single: (f64, f64),
    double: (f64, f64),
}

impl Term for OrenNayar {
    /// Factors of `single` and `double`.
    type Pair = (f64, f64);

    fn parameters() -> Vec<Parameter> {
        let sigma = Parameter {
            name: "sigma_deg".into(),
            meaning: "standard deviation of the facets' slope angle, degrees".into(),
            kind: Kind::Shape,
            start: 20.0,
            min: 0.0,
            max: 60.0,
            logarithmic: false,
        };
        vec![coefficient("kd", "diffuse reflection of the facets", 0.3), sigma]
    }

    fn pair(wi: DVec3, wo: DVec3) -> Option<(f64, f64)> {
        let (si, so) = (wi.x.hypot(wi.y), wo.x.hypot(wo.y));
        let (ti, to) = (si.atan2(wi.z), so.atan2(wo.z));
        let (a, b) = (ti.max(to), ti.min(to));
        // At the normal no azimuth is defined, and no term needs it.
        let cos_phi = if si * so > 0.0 { (wi.x * wo.x + wi.y * wo.y) / (si * so) } else { 0.0 };
        let groove = a.sin() - if cos_phi < 0.0 { (2.0 * b / PI).powi(3) } else { 0.0 };
        let across = 0.125 * (4.0 * a * b / (PI * PI)).powi(2) * (1.0 - cos_phi.abs()).max(0.0);
        let single = 0.45 * cos_phi * groove * b.tan() + across * (0.5 * (a + b)).tan();
        Some((single, 0.17 * (1.0 - cos_phi * (2.0 * b / PI).powi(2))))
    }

    fn new(p: &[f64]) -> Self {
        let sigma = p[1].to_radians();
        let s = sigma * sigma;
        // d s / d sigma_deg
        let ds = 2.0 * sigma * 1f64.to_radians();
        let ratio = |c: f64| (s / (s + c), ds * c / ((s + c) * (s + c)));
        Self { kd: p[0], facing: ratio(0.33), single: ratio(0.09), double: ratio(0.13) }
    }

    fn eval(&self, &(single, double): &Self::Pair) -> (f64, [f64; MAX_PARAMETERS]) {
        let first = 1.0 - 0.5 * self.facing.0 + single * self.single.0;
        let second = double * self.double.0;
        let value = self.kd * (first + self.kd * second) * FRAC_1_PI;
        if value < 0.0 {
            return (0.0, [0.0; MAX_PARAMETERS]);
        }
        let slope = -0.5 * self.facing.1 + single * self.single.1 + self.kd * double * self.double.1;
        (value, [(first + 2.0 * self.kd * second) * FRAC_1_PI, self.kd * slope * FRAC_1_PI])
    }
}

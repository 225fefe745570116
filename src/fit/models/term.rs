//! One term of a model: a formula of one or two parameters for one pair of directions, made into a [`Model`].

use glam::DVec3;

use crate::fit::model::{Geometry, Kind, Model, Parameter, Prepared};
use crate::{Error, Result};

/// Most parameters that a term has.
pub const MAX_PARAMETERS: usize = 2;
/// A direction whose cosine is smaller lies in the surface, where every term is zero.
const IN_SURFACE: f64 = 1e-9;

/// A formula. `T::new(p)` does what depends on the parameters only, [`Term::pair`] what depends on the directions
/// only.
pub trait Term: Sized + Send + Sync + 'static {
    /// What the formula needs to know of two directions.
    type Pair: Copy + Send + Sync;
    /// Does the light leave on the side that it came to?
    const REFLECTS: bool = true;

    /// One or two parameters.
    fn parameters() -> Vec<Parameter>;

    /// Geometry of two unit vectors: reflection has both above (of light below the sheet turned over), transmission
    /// one on each side. `None` where the term is zero whatever its parameters.
    fn pair(wi: DVec3, wo: DVec3) -> Option<Self::Pair>;

    /// At these parameters, as many as [`Term::parameters`].
    fn new(p: &[f64]) -> Self;

    /// Value, 1/sr, and its derivative by each parameter.
    fn eval(&self, pair: &Self::Pair) -> (f64, [f64; MAX_PARAMETERS]);
}

/// A term as a model of its own.
pub struct Closed<T> {
    name: String,
    parameters: Vec<Parameter>,
    term: std::marker::PhantomData<fn() -> T>,
}

impl<T: Term> Closed<T> {
    /// With the name that it has on the command line.
    pub fn boxed(name: &str) -> Box<dyn Model> {
        Box::new(Self { name: name.into(), parameters: T::parameters(), term: std::marker::PhantomData })
    }
}

impl<T: Term> Model for Closed<T> {
    fn name(&self) -> &str {
        &self.name
    }

    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn prepare(&self, geometries: &[Geometry]) -> Result<Box<dyn Prepared>> {
        let mut pairs = Vec::new();
        each_pair(geometries, |k, wi, wo, weight| {
            if (wi.z * wo.z > 0.0) != T::REFLECTS {
                return;
            }
            let above = |w: DVec3| if T::REFLECTS { w.with_z(w.z.abs()) } else { w };
            if let Some(pair) = T::pair(above(wi), above(wo)) {
                pairs.push((k, weight, pair));
            }
        })?;
        Ok(Box::new(At::<T> { parameters: self.parameters.len(), pairs }))
    }
}

/// A term at given directions.
struct At<T: Term> {
    parameters: usize,
    /// `(geometry, weight, pair)`
    pairs: Vec<(usize, f64, T::Pair)>,
}

impl<T: Term> Prepared for At<T> {
    fn eval(&self, p: &[f64], values: &mut [f64], jacobian: Option<&mut [f64]>) {
        let term = T::new(p);
        let n = values.len();
        values.fill(0.0);
        let Some(jacobian) = jacobian else {
            for (k, weight, pair) in &self.pairs {
                values[*k] += weight * term.eval(pair).0;
            }
            return;
        };
        jacobian.fill(0.0);
        for (k, weight, pair) in &self.pairs {
            let (value, derivatives) = term.eval(pair);
            values[*k] += weight * value;
            for (j, d) in derivatives.iter().enumerate().take(self.parameters) {
                jacobian[j * n + k] += weight * d;
            }
        }
    }
}

/// Calls `on` with the number of the geometry, the directions and the weight of every pair that is not in the surface;
/// an error where a direction is none.
pub(super) fn each_pair(geometries: &[Geometry], mut on: impl FnMut(usize, DVec3, DVec3, f64)) -> Result<()> {
    for (k, geometry) in geometries.iter().enumerate() {
        for &(wi, wo, weight) in &geometry.pairs {
            let is_unit = |w: DVec3| (w.length_squared() - 1.0).abs() < 1e-6;
            if !(is_unit(wi) && is_unit(wo) && weight.is_finite()) {
                let what = format!("{wi:?} to {wo:?}, weight {weight}: needs unit vectors and a number");
                return Err(Error::invalid(format!("geometry {k}"), what));
            }
            if wi.z.abs() >= IN_SURFACE && wo.z.abs() >= IN_SURFACE {
                on(k, wi, wo, weight);
            }
        }
    }
    Ok(())
}

/// The direction of a mirror's light.
pub(super) fn mirror(w: DVec3) -> DVec3 {
    DVec3::new(-w.x, -w.y, w.z)
}

/// A share of the light.
pub(super) fn coefficient(name: &str, meaning: &str, start: f64) -> Parameter {
    let (name, meaning) = (name.into(), format!("{meaning}, share of the light"));
    Parameter { name, meaning, kind: Kind::Coefficient, start, min: 0.0, max: 1.0, logarithmic: false }
}

/// An exponent of a cosine.
pub(super) fn exponent(name: &str, meaning: &str, start: f64) -> Parameter {
    let (name, meaning) = (name.into(), format!("{meaning}, a pure number"));
    Parameter { name, meaning, kind: Kind::Shape, start, min: 0.1, max: 1e4, logarithmic: true }
}

/// A roughness: about the root mean square slope of the facets.
pub(super) fn roughness(name: &str, meaning: &str) -> Parameter {
    let (name, meaning) = (name.into(), format!("{meaning}, a pure number"));
    Parameter { name, meaning, kind: Kind::Shape, start: 0.3, min: 0.02, max: 1.0, logarithmic: true }
}

/// The lobe `k (n + 2) / (2 pi) cos^n(alpha)` and its derivatives by k and n.
#[derive(Clone, Copy, Debug)]
pub(super) struct PowerCosine {
    k: f64,
    n: f64,
}

impl PowerCosine {
    pub(super) fn new(p: &[f64]) -> Self {
        Self { k: p[0], n: p[1] }
    }

    /// `ln cos` of the angle between two unit vectors, `None` from 90 deg on. By the chord, because the vectors'
    /// product loses the digits of 1 - cos that a large exponent brings forward.
    pub(super) fn ln_cos(a: DVec3, b: DVec3) -> Option<f64> {
        let versine = 0.5 * a.distance_squared(b);
        (versine < 1.0).then(|| (-versine).ln_1p())
    }

    pub(super) fn eval(&self, ln_cos: f64) -> (f64, [f64; MAX_PARAMETERS]) {
        let power = (self.n * ln_cos).exp() / std::f64::consts::TAU;
        let lobe = (self.n + 2.0) * power;
        (self.k * lobe, [lobe, self.k * (power + lobe * ln_cos)])
    }
}

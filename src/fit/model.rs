//! What a model of reflection is to the solver: named parameters, values and derivatives.

use glam::DVec3;

use crate::Result;

/// How a parameter enters its model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A share of the light: one value per band. The model is linear in it, or nearly so near zero, where its
    /// derivatives are the basis of the non-negative start.
    Coefficient,
    /// Anything else (an exponent, a width, a height): one value for all bands.
    Shape,
}

/// One parameter of a model, with its meaning and its default bounds and start.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Short name in the field's symbols, such as `kd_E`; letters, digits, `_` and `.`.
    pub name: String,
    /// What it is, with its unit, for reports.
    pub meaning: String,
    /// How it enters.
    pub kind: Kind,
    /// Start of the search; several starts spread between the bounds around it.
    pub start: f64,
    /// Lower bound, finite.
    pub min: f64,
    /// Upper bound, finite.
    pub max: f64,
    /// Values spread over orders of magnitude (exponents): starts are drawn in the logarithm.
    pub logarithmic: bool,
}

/// The directions of one reading: pairs whose weighted mean the reading is. One pair of weight 1 for a parallel beam and
/// a small detector, several where the lamp or the detector fills a cone.
#[derive(Clone, Debug, PartialEq)]
pub struct Geometry {
    /// `(wi, wo, weight)`: unit vectors as in [`crate::gonio::Reading`]; the weights sum to one.
    pub pairs: Vec<(DVec3, DVec3, f64)>,
}

impl Geometry {
    /// A parallel beam and a point detector.
    pub fn point(wi: DVec3, wo: DVec3) -> Self {
        Self { pairs: vec![(wi, wo, 1.0)] }
    }
}

/// A model of reflection (and transmission) with named parameters.
pub trait Model: Send + Sync {
    /// Its name on the command line.
    fn name(&self) -> &str;

    /// Parameters of one band, in the order of `p` below.
    fn parameters(&self) -> &[Parameter];

    /// Does everything that depends on the directions only.
    fn prepare(&self, geometries: &[Geometry]) -> Result<Box<dyn Prepared>>;
}

/// A model at given directions.
pub trait Prepared: Send + Sync {
    /// Values of the BSDF, 1/sr, at parameters `p` within their bounds: `values[k]` for geometry k. Where `jacobian` is
    /// given, the derivatives too: `jacobian[j * values.len() + k]` = d values\[k\] / d p\[j\]. Always finite.
    fn eval(&self, p: &[f64], values: &mut [f64], jacobian: Option<&mut [f64]>);
}

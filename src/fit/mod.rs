//! From readings to parameters: models of reflection fitted to measurements by least squares, with honest errors.
//!
//! ```text
//! Measurement --geometry (cones averaged)--> Model::prepare --Problem (weights, gains, loss)--> solve --> Fit
//! ```
//!
//! A [`Model`] is a formula with named parameters; prepared for the directions of a measurement it gives values and
//! derivatives ([`Prepared`]). `fit` minimises the weighted residuals over all parameters within their bounds
//! and gives a [`Fit`]: values, standard errors, correlations, intervals, criteria for the choice between models.

pub mod model;
pub mod models;
pub mod result;
pub mod audit;
pub mod report;
#[cfg(test)]
pub(crate) mod toy;

pub use audit::Audit;
pub use model::{Geometry, Kind, Model, Parameter, Prepared};
pub use report::{DataInfo, LadderRow, Report};
pub use result::{Correlation, End, Fit, Fitted, Interval, State};

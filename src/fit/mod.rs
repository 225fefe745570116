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
pub mod options;
mod geometry;
mod loss;
mod nnls;
mod solve;
mod parameters;
mod problem;
mod weights;
mod progress;
mod search;
mod covariance;
mod interval;
mod bootstrap;
mod summary;
mod run;
pub mod audit;
pub mod report;
pub mod spectrum;
#[cfg(test)]
pub(crate) mod toy;
#[cfg(test)]
pub(crate) mod tests;

pub use audit::Audit;
pub use model::{Geometry, Kind, Model, Parameter, Prepared};
pub use options::{Action, Covariance, Loss, Options, Override, Weights};
pub use report::{DataInfo, LadderRow, Report};
pub use result::{Correlation, End, Fit, Fitted, Interval, State};
pub use run::fit;

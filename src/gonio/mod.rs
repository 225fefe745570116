//! Virtual goniophotometry: shine on a sample, count where the light goes.
//!
//! A [`Goniophotometer`] follows rays from a lamp through anything that implements
//! [`Scatter`](crate::bsdf::Scatter) (every BSDF, and walks through cells that have no closed form) and gives
//! a [`GonioTable`]: the BSDF with its standard error in every bin of an [`ExitantGrid`], a dense
//! [`PlaneScan`] of the plane of incidence, hemispherical totals with an energy ledger, and the
//! retro-reflection index.
//!
//! What laboratories deliver is a [`Measurement`], readings in any order; what can be asked for any two directions is
//! [`Directional`].
//!
//! Frame of the instrument: +z is the normal of the **lit** side, the lamp stands at azimuth 0 (+x), so
//! exitant azimuth 0 is the lamp's side and 180 the mirror's side. To light the abaxial side the sample is
//! turned over about the x axis: (x, y, z) of the instrument is (x, -y, -z) of the sample.

pub mod grid;
pub mod retro;
pub mod table;
pub mod spectra;
mod counters;
mod lamp;
pub mod goniophotometer;
pub mod white_walks;
pub mod measurement;
pub mod directional;
pub mod readings;
mod shares;
pub mod plane;
mod triangles;
pub mod interpolant;
pub mod one_sided;
pub mod cell_factors;
pub mod cell_family;
pub mod petal_optics;
pub mod angular;
mod path_classes;
mod white_counts;
mod white_tables;
mod white_calibrate;
pub mod white_monte_carlo;
pub mod recolour;
pub mod tabulated;

pub use angular::{Nodes, Place};
pub use cell_factors::{CellFactors, FactorSettings};
pub use cell_family::CellFamily;
pub use directional::{Coverage, Directional, directional_hemispherical};
pub use goniophotometer::Goniophotometer;
pub use grid::{ExitantGrid, PlaneScan};
pub use interpolant::Interpolant;
pub use measurement::{Band, Measurement, Reading, Scale};
pub use one_sided::OneSided;
pub use petal_optics::{AngleGrid, AngularTable, Part, PetalOptics, WhiteTotals};
pub use plane::Plane;
pub use readings::{merge, sample};
pub use recolour::LampShares;
pub use spectra::{HemisphericalSpectrum, PetalColors, SpectrumPoint};
pub use table::{Estimate, GonioTable, Incidence, Ledger, Totals};
pub use tabulated::{AtPigment, TabulatedBsdf};
pub use white_monte_carlo::WhiteMonteCarlo;

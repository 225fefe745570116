//! Rosarium: photoreal flowers from their cells.
//!
//! Two pipelines meet in the BSDF:
//!
//! ```text
//! measure:  CellDescription --micro--> cells --gonio--> GonioTable --fit--> petal
//! render:   SceneDescription --scene::compile--> Scene --transport--> Film --io--> .exr .png
//!               ^ flower: Rose -> organs -> Mesh              validate: checks any arrow
//! ```
//!
//! The order of the modules below is the order of dependency: a module uses only those above it
//! (`tests/layering.rs` enforces it).
//!
#![doc = include_str!("../docs/conventions.md")]

pub mod error;
pub mod math;
pub mod spectrum;
pub mod geometry;
pub mod bsdf;
pub mod micro;
pub mod gonio;
pub mod fit;
pub mod flower;
pub mod film;
pub mod io;
pub mod scene;
pub mod transport;
pub mod validate;

pub use error::{Error, Result};

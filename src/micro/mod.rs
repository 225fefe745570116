//! The petal under the microscope: a lattice of cells, a dome on each, and rays among them. Micrometres, f64.
//!
//! A petal is four layers. From the light that falls on its upper side downwards:
//!
//! ```text
//!      _--_      _--_      _--_        upper (adaxial) epidermis: one dome per cell
//!    /      \  /      \  /      \
//!   |--------||--------||--------|     z = 0, the base plane that carries the domes
//!   |  palisade: upright cells   |
//!   |  spongy: loose, airy cells |     sends much of the light back
//!   |____________________________|
//!      lower (abaxial) epidermis
//! ```
//!
//! This folder describes the surface that light meets first. Frame: right-handed, z = adaxial normal, base
//! plane z = 0, the lattice's rows along x. [`CellDescription`] says what the surface is, [`lattice`] places
//! the cells and divides the plane among them, [`dome`] gives the height over a cell, [`height_field`] finds
//! the exact first hit of a ray, [`tile_mesh`] turns a tile into triangles, [`shading`] shades it, [`transmission`] lets
//! light through.
//!
//! From the thesis: triangular grid of pitch 23 um, hexagonal base faces by Voronoi division, domes of height
//! 37 um, "cosine of the distance" from the centre. Our reading: which cosine and which base radius
//! ([`Profile`]), the disorder (Gaussian, per cell), and the tilt of an axis as a shear.

pub mod description;
pub mod lattice;
pub mod growth;
pub mod dome;
pub mod height_field;
pub mod tile_mesh;
pub mod transmission;
pub mod shading;
pub mod tissue;
pub mod wall;
pub mod rough_wall;
pub mod white;
mod henyey_greenstein;
pub mod cell_walk;

pub use cell_walk::CellWalk;
pub use description::CellDescription;
pub use dome::{Dome, Profile};
pub use height_field::{CellField, CellHit, HitKind};
pub use lattice::{Lattice, VoronoiCell, VoronoiEdge};
pub use tissue::{REGIONS, Tissue, TissueDescription};
pub use wall::Wall;
pub use white::{End, Exit, WhiteScatter};

//! What rays hit: meshes, the acceleration structure, and the point of a hit.

pub mod ray;
pub mod mesh;
pub mod lathe;
pub mod triangle;
mod wide;
pub mod crossings;
pub mod bvh;
pub mod interaction;

pub use bvh::Bvh;
pub use interaction::{Interaction, Side};
pub use mesh::Mesh;
pub use ray::Ray;

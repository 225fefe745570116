//! Pure numerics: frames, warps with their densities, the sample sequence, quadrature, equations and
//! statistics.

pub mod frame;
pub mod warp;
pub mod sampler;
pub mod quadrature;
pub mod special;
pub mod solve;
pub mod stats;

pub use frame::Frame;
pub use sampler::Sampler;

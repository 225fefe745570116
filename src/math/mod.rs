//! Pure numerics: frames, warps with their densities, random sequences, quadrature, equations and
//! statistics.

pub mod exp;
pub mod widest;
pub mod frame;
pub mod warp;
pub mod sampler;
pub mod stream;
pub mod quadrature;
pub mod special;
pub mod solve;
pub mod stats;

pub use frame::Frame;
pub use sampler::Sampler;
pub use stream::Stream;
pub use widest::widest;

//! placeholder
/// placeholder
pub struct Phong;

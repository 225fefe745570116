//! placeholder
/// placeholder
pub struct Lambert;

//! placeholder
/// placeholder
pub struct DiffuseTransmission;

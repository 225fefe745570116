//! placeholder
/// placeholder
pub struct LiteralPhong;

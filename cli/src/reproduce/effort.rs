//! How much work goes into the pictures.

use super::Args;

/// Numbers that the commands are made with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    /// Width and height of the large pictures, pixels.
    pub(super) size: u32,
    /// ... of the small ones, which stand in a row.
    pub(super) small: u32,
    /// Samples per pixel.
    pub(super) spp: u32,
    /// ... where few and many points of the cells are compared: many samples would average the points' noise away, which
    /// is what is shown.
    pub(super) few_spp: u32,
    /// Paths of light per angle of the lamp.
    pub(super) rays: u64,
    /// Walks per side of a petal of tissue.
    pub(super) walks: u64,
    /// Elements of the radiosity solution.
    pub(super) elements: u32,
    pub(super) seed: u64,
}

impl Effort {
    pub(super) fn new(args: &Args) -> Self {
        let of = |quick, full| if args.quick { quick } else { full };
        let size = args.size.unwrap_or(of(320, 480));
        let spp = args.spp.unwrap_or(of(16, 48));
        Self {
            size,
            small: (size / 2).max(8),
            spp,
            few_spp: (spp / 8).max(1),
            rays: args.rays.unwrap_or(if args.quick { 500_000 } else { 2_000_000 }),
            walks: if args.quick { 50_000 } else { 400_000 },
            elements: of(20_000, 50_000),
            seed: args.seed,
        }
    }
}

//! A walk without absorption, and what it must remember for absorption to be applied afterwards.
//!
//! Model (white Monte Carlo): where no wavelength bends the path, light of every wavelength takes the same walks; of the
//! light of one walk the share `exp(-sum over regions of mu_a,r(lambda) l_r)` is left, l_r the length of the walk in
//! region r. So one set of walks, each of weight one, serves all wavelengths and all amounts of pigment.

use glam::DVec3;

use super::tissue::REGIONS;
use crate::math::Stream;

/// How a walk ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// The light left the petal.
    Left(Exit),
    /// It was still inside after the bound on events: cut off and counted.
    CutOff,
}

/// Light that left the petal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exit {
    /// Unit vector in which it travels, in the petal's frame: z > 0 leaves the adaxial side.
    pub direction: DVec3,
    /// Way through each region, um. All zero where the light never entered the petal: surface reflection.
    pub path_um: [f64; REGIONS],
}

impl Exit {
    /// Did the light never enter the petal?
    pub fn is_surface(&self) -> bool {
        self.path_um.iter().all(|l| *l == 0.0)
    }

    /// Share that absorption coefficients (1/um) leave.
    pub fn remaining(&self, absorption_per_um: &[f64; REGIONS]) -> f64 {
        let depth: f64 = self.path_um.iter().zip(absorption_per_um).map(|(l, mu)| l * mu).sum();
        (-depth).exp()
    }
}

/// Something that light of all wavelengths walks through alike.
pub trait WhiteScatter: Send + Sync {
    /// Follows light that arrives from the local direction `wi` (unit, away from the surface; z > 0 above the adaxial
    /// side) at a random point of the petal.
    fn walk(&self, wi: DVec3, stream: &mut Stream) -> End;
}

//! A petal as a sample for the goniophotometer.

use std::sync::Arc;

use rosarium::Result;
use rosarium::gonio::goniophotometer::Progress;
use rosarium::gonio::{GonioTable, Goniophotometer};
use rosarium::micro::shading::CellPetal;
use rosarium::micro::{CellWalk, Tissue};
use rosarium::scene::DiskAssets;
use rosarium::scene::description::PetalDescription;

/// What the light is followed through.
pub(crate) enum Sample {
    /// The thesis' layers, shaded by coefficients.
    Shaded(Box<CellPetal>),
    /// Layers that light walks through.
    Walked(Arc<Tissue>, Box<CellWalk>),
}

impl Sample {
    /// Builds what the description says; errors name its keys.
    pub(crate) fn new(petal: &PetalDescription, assets: &DiskAssets) -> Result<Self> {
        if let Some(tissue) = petal.build_tissue("")? {
            let tissue = Arc::new(tissue);
            return Ok(Self::Walked(tissue.clone(), Box::new(CellWalk::new(tissue))));
        }
        Ok(Self::Shaded(Box::new(petal.compile("", assets)?)))
    }

    /// Measures it.
    pub(crate) fn measure(&self, gonio: &Goniophotometer, progress: Progress) -> Result<GonioTable> {
        match self {
            Self::Shaded(petal) => gonio.measure(&**petal, progress),
            Self::Walked(tissue, walk) => {
                gonio.measure_walks(&**walk, &gonio.absorption_per_um(tissue)?, progress)
            }
        }
    }
}

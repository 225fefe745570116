//! A measured petal at chosen wavelengths, for formats and plots, and the absorption of its pigments.
//!
//! Model: as [`super::TabulatedBsdf`], with e_k computed once per wavelength from the tissue that was measured; the
//! wavelengths may be any for which its pigments have data. Guarded by `bands_agree_with_the_bsdf`.
//! Source: our reading.

use glam::DVec3;
use serde::Deserialize;

use super::{MAX_CLASSES, TabulatedBsdf, place};
use crate::gonio::directional::{Coverage, Directional};
use crate::gonio::measurement::Band;
use crate::gonio::petal_optics::PetalOptics;
use crate::micro::{CellDescription, REGIONS, Tissue, TissueDescription};
use crate::spectrum::Spectrum;
use crate::{Error, Result};

/// The cells and the tissue in a description of what was measured ([`PetalOptics::description`], a petal file). Keys that
/// say how the petal is shown are passed over.
pub fn measured_tissue(description: &str) -> Result<(CellDescription, TissueDescription)> {
    #[derive(Deserialize)]
    struct Sample {
        #[serde(default)]
        cells: CellDescription,
        tissue: Option<TissueDescription>,
    }
    let sample: Sample =
        toml::from_str(description).map_err(|e| Error::invalid("description", e.message()))?;
    let tissue = sample.tissue.ok_or_else(|| {
        Error::invalid("description", "has no [tissue], so that nobody knows what absorbs light")
    })?;
    Ok((sample.cells, tissue))
}

/// Absorption coefficients of the regions over the visible range, 1/um.
pub(super) fn absorption_per_um(tissue: &Tissue) -> Result<[Spectrum; REGIONS]> {
    let mut failed = None;
    let spectra = std::array::from_fn(|r| {
        Spectrum::from_fn(|nm| match tissue.absorption_per_um(nm) {
            Ok(mu) => mu[r],
            Err(e) => {
                failed.get_or_insert(e);
                0.0
            }
        })
    });
    failed.map_or(Ok(spectra), Err)
}

/// A measured petal at chosen wavelengths.
#[derive(Clone, Debug)]
pub struct OpticsAtBands {
    bands: Vec<Band>,
    tables: TabulatedBsdf,
    /// e_k per band.
    remaining: Vec<Vec<f64>>,
}

impl OpticsAtBands {
    /// The petal at these wavelengths, coloured by the tissue that it describes.
    pub fn new(optics: &PetalOptics, wavelengths_nm: &[f64]) -> Result<Self> {
        if wavelengths_nm.is_empty() {
            return Err(Error::invalid("wavelengths", "at least one is needed"));
        }
        let (cells, tissue) = measured_tissue(&optics.description)?;
        let tissue = Tissue::new(&tissue, &cells, "tissue")?;
        let tables = TabulatedBsdf::new(optics, std::array::from_fn(|_| Spectrum::from(0.0)))?;
        let at = |&nm: &f64| -> Result<Vec<f64>> {
            if !(nm > 0.0 && nm.is_finite()) {
                return Err(Error::invalid("wavelengths", format!("{nm} nm is no wavelength")));
            }
            Ok(optics.remaining(&tissue.absorption_per_um(nm)?))
        };
        let remaining = wavelengths_nm.iter().map(at).collect::<Result<_>>()?;
        Ok(Self { bands: wavelengths_nm.iter().map(|&nm| Band::nm(nm)).collect(), tables, remaining })
    }
}

impl Directional for OpticsAtBands {
    fn bands(&self) -> &[Band] {
        &self.bands
    }

    fn coverage(&self) -> Coverage {
        Coverage {
            reflection_adaxial: true,
            reflection_abaxial: true,
            transmission_adaxial: true,
            transmission_abaxial: true,
        }
    }

    fn bsdf(&self, wi: DVec3, wo: DVec3, values: &mut [f64]) -> bool {
        let place = place(wo.as_vec3(), wi.as_vec3());
        let mut surface = [0.0];
        self.tables.surface.add(&place, &mut surface);
        let mut interior = [0.0; MAX_CLASSES];
        self.tables.interior.add(&place, &mut interior[..self.tables.interior.classes()]);
        for (value, remaining) in values.iter_mut().zip(&self.remaining) {
            let inner: f64 = remaining.iter().zip(interior).map(|(r, i)| r * f64::from(i)).sum();
            *value = f64::from(surface[0]) + inner;
        }
        true
    }
}

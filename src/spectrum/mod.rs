//! Light as a function of wavelength: sampled wavelengths, spectra, colour, measured illuminants.

pub mod sampled;
pub mod spectra;
pub mod illuminant;
pub mod color;
pub mod upsample;

pub use sampled::{LANES, SampledSpectrum, SampledWavelengths, VISIBLE_NM};
pub use spectra::Spectrum;

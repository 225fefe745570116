//! Light as a function of wavelength: sampled wavelengths, spectra, colour, illuminants, and spectra from
//! RGB.
//!
//! A [`Spectrum`] is what a scene holds; a [`SampledSpectrum`] is its values at the [`SampledWavelengths`]
//! of one path. The film turns the radiance of a path into XYZ by [`Observer::xyz_from_samples`] and a pixel
//! into linear sRGB by [`Observer::srgb_from_xyz`]. An [`Illuminant`] has luminance Y = 1, and so has the
//! constant spectrum 1 (which is pinkish in sRGB, whose white is D65).

pub mod sampled;
pub mod table;
pub mod spectra;
pub mod observer;
pub mod illuminant;
pub mod daylight;
pub mod band;
pub mod color;
pub mod object_color;
pub mod rgb_basis;
pub mod upsample;
pub mod pigment;
pub mod pigments;

pub use band::{Band, BandGrid};
pub use illuminant::Illuminant;
pub use observer::Observer;
pub use pigments::Pigments;
pub use rgb_basis::{RgbBasis, emission_from_rgb};
pub use sampled::{LANES, SampledSpectrum, SampledWavelengths, VISIBLE_NM};
pub use spectra::Spectrum;
pub use table::Table;
pub use upsample::{reflectance_from_rgb, reflectance_transmittance_from_rgb};

//! Pigments and scattering of a petal from its measured reflectance spectrum.
//!
//! Model: R(lambda) = gain x R_petal(mu(lambda), s), R_petal the share of the light that comes back from the petal's layers
//! by white Monte Carlo, at absorption `mu_r = (k_fixed,r + sum over pigments p of k_p(lambda) c_p w_pr) / d_r` in region r
//! (see [`crate::spectrum::Pigments`]) and scattering coefficient s of the spongy layer.
//!
//! | symbol | parameter | unit | bounds |
//! |---|---|---|---|
//! | c | `anthocyanin_ug_per_cm2`, `carotenoid_ug_per_cm2`, `chlorophyll_ug_per_cm2`: sum over the petal | ug/cm2 | 0 to 1000, 200, 200 |
//! | peak of the band | `anthocyanin_peak_nm` | nm | 500 to 560 |
//! | s | `scattering_per_mm` | 1/mm | a sixteenth to 16 times the petal's |
//! | gain | `gain` | | 0.05 to 20 |
//! | w | in which layers a pigment is: module `place` | | |
//!
//! The gain stands for what a fibre spectrometer does not know: how much of the light it collects.
//! The least-squares search is that of goniometer fits: from six starts with some of the wavelengths, the best continued with
//! all. Standard errors are those of the scaled covariance
//! times sqrt((1 + rho) / (1 - rho)), rho the correlation of neighbouring residuals (at least 0): a spectrum that
//! misses the model misses it over whole bands, so its readings are fewer than its rows (Bartlett 1946).
//!
//! Limits: geometry, refractive indices and anisotropy are the petal's; the band's form is that of leaves. Known amounts
//! come back, guarded by `known_amounts_are_recovered`; standard errors are those that repeated noise shows, guarded by
//! `standard_errors_cover`. What the errors leave out: the noise of the walks (at most 1/(2 sqrt N), the same at all
//! wavelengths). Our reading of how measured spectra become amounts.

mod paths;
mod family;
mod place;
mod search;

pub use paths::{Illumination, Setup};
pub use search::{Options, PARAMETERS, SpectrumFit, Value, fit};

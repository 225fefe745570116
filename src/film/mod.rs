//! The film: sums of samples per pixel, the reconstruction filter they are drawn from, and the curve that
//! turns scene-linear light into a picture for a screen.

#[expect(clippy::module_inception, reason = "film/film.rs holds the type that the module is named after")]
pub mod film;
pub mod filter;
pub mod tonemap;
pub mod view;
pub mod denoise;

pub use film::{Film, FilmSample, Pixel, PixelRect};
pub use filter::{Filter, FilterSample};
pub use tonemap::ToneMap;
pub use view::View;

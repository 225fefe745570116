//! Scene files to scenes.
//!
//! ```text
//! TOML text + overrides --load--> SceneDescription --compile(+ Assets)--> Scene
//! ```
//!
//! [`load()`] finds mistakes of form (syntax, unknown keys, wrong types), [`compile()`] mistakes of meaning;
//! both end as an error with file, line and key. A [`Scene`] is complete and immutable: it holds every mesh,
//! spectrum and table that a picture needs, knows no files, and is shared by all threads.

pub mod description;
pub mod locate;
pub mod load;
pub mod assets;
pub mod aperture;
pub mod camera;
pub mod environment;
pub mod sky;
pub mod emitter;
pub mod emission;
pub mod material;
pub mod pattern;
pub mod petal;
pub mod tabulated;
pub mod fitted;
pub mod fitted_spectrum;
pub mod shape;
pub mod compile;
pub mod trace;
pub mod totals;

mod atmosphere;
mod color;
mod hash;
mod key;
mod lens;
mod light;
mod sky_light;
mod sun_position;

#[cfg(test)]
mod tests;

pub use aperture::Aperture;
pub use assets::{Assets, DiskAssets, MeasureOptics, MemoryAssets};
pub use camera::{Camera, CameraRay};
pub use compile::{Scene, compile};
pub use description::{SceneDescription, schema};
pub use emitter::{Drawing, Emitter, LightSample, LightWay, Lights, MAX_EACH};
pub use load::{Loaded, Override, load};
pub use locate::Source;
pub use material::{Material, Scattering};
pub use pattern::{Pattern, PigmentFactors, TissueState};
pub use shape::Shape;
pub use tabulated::{Petal, TabulatedPetal};
pub use totals::MaterialTotals;

/// The built-in default scene: `scenes/rose.toml`.
pub const DEFAULT_SCENE: &str = include_str!("../../scenes/rose.toml");

/// The thesis' scenes by their file names: ray tracing only; with light reflected between petals; with light that also passes
/// through them.
pub const THESIS_SCENES: [(&str, &str); 3] = [
    ("thesis.toml", include_str!("../../scenes/thesis.toml")),
    ("thesis_reflection.toml", include_str!("../../scenes/thesis_reflection.toml")),
    ("thesis_transmission.toml", include_str!("../../scenes/thesis_transmission.toml")),
];

/// Name of the built-in default scene in messages.
pub const DEFAULT_SCENE_NAME: &str = "rose.toml (built in)";

//! Scenes for the tests of this folder.

use super::elements::Elements;
use super::facets::Facets;
use super::neighbours::neighbours;
use crate::scene::{MemoryAssets, Scene, SceneDescription, compile, load};

/// A scene with a grey material, lit by a white sky of radiance 1.
pub(super) fn scene(shapes: &str) -> Scene {
    compiled(&format!(
        "[materials.grey]\ntype = \"lambert\"\nreflectance = 0.5\n[lights.sky]\ntype = \"constant\"\nradiance = 1\n\
         spectrum = {{ illuminant = \"E\" }}\n{shapes}"
    ))
}

/// A whole scene.
pub(super) fn compiled(text: &str) -> Scene {
    let description: SceneDescription = load(text, "test", &[]).unwrap_or_else(|e| panic!("{e}")).description;
    compile(&description, &MemoryAssets::default()).unwrap_or_else(|e| panic!("{e}"))
}

/// About 200 elements of a square floor, and their neighbours.
pub(super) fn floor() -> (Elements, Vec<Vec<u32>>) {
    let s = scene("[shapes.f]\ntype = \"quad\"\nwidth_mm = 10\nheight_mm = 10\nmaterial = \"grey\"\n");
    let elements = Elements::new(&s, Facets::new(&s, 200), 200);
    let beside = neighbours(&elements);
    (elements, beside)
}

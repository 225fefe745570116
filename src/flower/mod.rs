//! A rose, grown organ by organ: [`grow()`] turns a [`RoseDescription`] into a [`Flower`] of meshes.
//!
//! ```text
//! RoseDescription --phyllotaxis--> azimuth, layer of each petal --bloom--> where its layer lies in space
//!                 --outline, margin, veins--> the flat petal    --petal--> one sheet --sheet--> Mesh
//! ```
//!
//! Frame: millimetres; the axis of the flower is +z, the petals are inserted at the origin, the stem hangs
//! below it. Petal 0 is the innermost. A petal, a sepal or a leaflet is one sheet of no thickness with two
//! sides: its normals point to the adaxial side (towards the axis, or up), its triangles run
//! counter-clockwise seen from there, and its texture coordinates are its flat shape, undistorted.
//!
//! How petals keep out of each other's way: they lie on a family of nested cups ([`bloom`]), each petal on
//! its own; what a petal adds to its cup (rolled rim, fold, ruffle) keeps to its share of the space to its
//! [`neighbours`]; and what still meets settles ([`mod@grow`]). Guarded by `petals_do_not_cross`.

pub mod bloom;
pub mod crossings;
mod green;
pub mod leaf;
pub mod leaflet;
pub mod grow;
pub mod margin;
pub mod neighbours;
pub mod outline;
pub mod petal;
pub mod petal_description;
pub mod petal_map;
pub mod phyllotaxis;
pub mod prickle;
pub mod room;
pub mod rose;
pub mod sepal;
pub mod sheet;
pub mod stamens;
pub mod stem;
pub mod stipule;
pub mod tube;
pub mod veins;
pub mod arrangement;

use crate::geometry::Mesh;

pub use arrangement::ArrangementDescription;
pub use grow::grow;
pub use petal_map::{PetalMap, PetalTraits};
pub use rose::RoseDescription;

/// What an organ is. Materials are given per kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum OrganKind {
    /// A petal; index 0 is the innermost.
    Petal,
    /// A green sepal under the petals.
    Sepal,
    /// The urn that carries sepals and petals, a closed solid.
    Receptacle,
    /// The stem (index 0) or the stalk of a leaf, closed tubes.
    Stem,
    /// A leaflet or the stipules of a leaf on the stem.
    Leaf,
    /// All prickles of the stem.
    Prickle,
    /// All filaments, the stalks of the stamens.
    Filament,
    /// All anthers.
    Anther,
    /// All styles.
    Style,
}

/// One mesh of a flower.
#[derive(Clone, Debug, PartialEq)]
pub struct Organ {
    /// What it is.
    pub kind: OrganKind,
    /// Counts the organs of one kind from 0.
    pub index: u32,
    /// Shape in millimetres, with normals and texture coordinates.
    pub mesh: Mesh,
    /// Millimetres per unit of each texture coordinate: (across, along).
    pub uv_scale_mm: [f32; 2],
    /// What a petal's colour may depend on beside its shape; nothing for other organs.
    pub traits: Option<PetalTraits>,
}

/// A grown flower.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Flower {
    /// All organs: petals from the innermost out, then the rest.
    pub organs: Vec<Organ>,
}

impl Flower {
    /// The organs of one kind.
    pub fn of_kind(&self, kind: OrganKind) -> impl Iterator<Item = &Organ> {
        self.organs.iter().filter(move |o| o.kind == kind)
    }

    /// Number of triangles of all organs.
    pub fn triangle_count(&self) -> usize {
        self.organs.iter().map(|o| o.mesh.triangles.len()).sum()
    }

    /// Everything as one mesh.
    pub fn merged(&self) -> Mesh {
        let mut all = Mesh::default();
        for organ in &self.organs {
            all.append(&organ.mesh);
        }
        all
    }
}

/// 0 up to `low`, 1 from `high` on, smooth between.
pub(crate) fn smooth_step(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

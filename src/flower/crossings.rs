//! Which organs of a flower pass through each other.
//!
//! ```
//! use rosarium::flower::{RoseDescription, crossings::crossings, grow};
//!
//! let rose = grow(&RoseDescription { petals: 3, detail: 0.3, ..RoseDescription::hybrid_tea() })?;
//! let report = crossings(&rose);
//! println!("{} pairs of triangles\n{report}", report.total());
//! # Ok::<(), rosarium::Error>(())
//! ```

use std::fmt;

use crate::flower::{Flower, OrganKind};
use crate::geometry::Mesh;
use crate::geometry::crossings;

/// Two organs that cross, or one that crosses itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OrganCrossing {
    /// The organs: kind and index.
    pub organs: [(OrganKind, u32); 2],
    /// Number of crossing pairs of triangles.
    pub pairs: usize,
    /// One of those pairs: a face of each organ.
    pub faces: [u32; 2],
}

/// All crossings of a flower.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CrossingReport {
    /// Pairs of organs in the flower's order; the same organ twice where it crosses itself.
    pub organs: Vec<OrganCrossing>,
}

impl CrossingReport {
    /// Crossing pairs of triangles of all organs, within organs too.
    pub fn total(&self) -> usize {
        self.organs.iter().map(|o| o.pairs).sum()
    }

    /// Crossing pairs of triangles of organs of these two kinds.
    pub fn between_kinds(&self, a: OrganKind, b: OrganKind) -> usize {
        self.organs
            .iter()
            .filter(|o| {
                let kinds = o.organs.map(|(kind, _)| kind);
                kinds == [a, b] || kinds == [b, a]
            })
            .map(|o| o.pairs)
            .sum()
    }
}

impl fmt::Display for CrossingReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for o in &self.organs {
            let [(a, i), (b, j)] = o.organs;
            writeln!(f, "{a:?} {i} x {b:?} {j}: {}", o.pairs)?;
        }
        Ok(())
    }
}

/// Counts the pairs of triangles that cross, by organ.
pub fn crossings(flower: &Flower) -> CrossingReport {
    let meshes: Vec<&Mesh> = flower.organs.iter().map(|o| &o.mesh).collect();
    let mut report = CrossingReport::default();
    let mut found = crossings::crossings(&meshes);
    found.sort_unstable_by_key(|c| (c.meshes, c.faces));
    for same in found.chunk_by(|a, b| a.meshes == b.meshes) {
        let organs = same[0].meshes.map(|m| {
            let organ = &flower.organs[m as usize];
            (organ.kind, organ.index)
        });
        report.organs.push(OrganCrossing { organs, pairs: same.len(), faces: same[0].faces });
    }
    report
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::flower::Organ;

    #[test]
    fn organs_that_cross_are_named() {
        let board = |at: Vec3| {
            let corners = [Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Z, Vec3::Z];
            Mesh {
                positions: corners.map(|p| p + at).to_vec(),
                triangles: vec![[0, 1, 2], [0, 2, 3]],
                ..Mesh::default()
            }
        };
        let mut across = board(Vec3::ZERO);
        across.positions =
            across.positions.iter().map(|p| Vec3::new(0.45, p.x - 0.4, p.z * 0.3 + 0.2)).collect();
        let organ = |kind, index, mesh| Organ { kind, index, mesh, uv_scale_mm: [1.0; 2], traits: None };
        let flower = Flower {
            organs: vec![
                organ(OrganKind::Petal, 0, board(Vec3::ZERO)),
                organ(OrganKind::Petal, 1, board(Vec3::new(0.0, 3.0, 0.0))),
                organ(OrganKind::Leaf, 0, across),
            ],
        };
        let report = crossings(&flower);
        assert_eq!(report.organs.len(), 1, "{report}");
        assert_eq!(report.organs[0].organs, [(OrganKind::Petal, 0), (OrganKind::Leaf, 0)]);
        assert_eq!(report.between_kinds(OrganKind::Leaf, OrganKind::Petal), report.total());
        assert_eq!(report.to_string(), format!("Petal 0 x Leaf 0: {}\n", report.total()));
    }
}

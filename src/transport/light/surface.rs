//! The solution at the vertices of surfaces, for what should look smooth: maps and baked colours.
//!
//! Model: the value of a vertex is the mean over the elements that meet there; triangles that the solution divides into
//! facets ([`crate::transport::radiosity::facets`]) have vertices at the facets' corners. In between it is linear. Vertices of
//! one shape with the same place and normal are one, so light runs smoothly over elements; means over organs are not
//! taken from here. Guarded by `the_view_shows_the_irradiance`, `baked_colours_are_the_light`. Source: our reading.

use std::collections::HashMap;

use glam::Vec3;

use super::Readout;
use crate::geometry::{Interaction, Mesh, Side};
use crate::transport::radiosity::Quantity;
use crate::transport::radiosity::facets::face_normal;

/// Corners closer than this share of the shape's diagonal are one, if their normals differ by less than that.
const SAME_PLACE: f32 = 1e-5;
const SAME_NORMAL: f32 = 1e-2;

/// A side of a shape.
pub(super) struct Surface {
    /// As fine as the solution.
    pub(super) mesh: Mesh,
    /// Values of each vertex at all wavelengths.
    pub(super) values: Vec<f32>,
    /// Triangles of `mesh` are facets from this one on; `None` where they are those of the shape.
    first_facet: Option<u32>,
}

impl Readout<'_> {
    /// A side of a shape with the values of its vertices.
    pub(super) fn surface(&self, shape: usize, side: Side, quantity: Quantity) -> Surface {
        let own = &self.scene.shapes[shape].mesh;
        let facets = self.radiosity.elements().facets();
        let faces = own.triangles.len() as u32;
        let parts = |face: u32| facets.of_face(shape as u32, face);
        if (0..faces).all(|f| parts(f).is_none_or(|p| p.1 == 1)) {
            let values = self.radiosity.vertices(self.scene, shape as u32, side, quantity);
            return Surface { mesh: Mesh { uvs: Vec::new(), ..own.clone() }, values, first_facet: None };
        }
        let count = self.radiosity.wavelengths_nm().len();
        let (mut mesh, mut values, mut meeting) = (Mesh::default(), Vec::new(), Vec::new());
        let mut known: HashMap<[i32; 6], u32> = HashMap::new();
        let mut first_facet = None;
        let (low, high) = own.bounds();
        let same = ((high - low).length() * SAME_PLACE).max(f32::MIN_POSITIVE);
        for (face, (first, n)) in (0..faces).filter_map(|f| Some((f, parts(f)?))) {
            let start = *first_facet.get_or_insert(first);
            if first != start + mesh.triangles.len() as u32 {
                // A copy of a triangle before.
                continue;
            }
            for facet in first..first + n {
                let (corners, weights) = facets.corners(self.scene, facet);
                let element = self.radiosity.elements().of_facet(facet);
                let normals = own.triangles[face as usize].map(|i| own.normals.get(i as usize));
                let triangle = [0, 1, 2].map(|k| {
                    let b = weights[k];
                    let normal = match normals {
                        [Some(p), Some(q), Some(r)] => (*p * b.x + *q * b.y + *r * b.z).normalize_or_zero(),
                        _ => face_normal(own, face as usize).normalize_or_zero(),
                    };
                    // Neighbours reckon their common corners with different rounding.
                    let key = [(corners[k] - low) / same, normal / SAME_NORMAL].map(|v| v.round().to_array());
                    let key: [i32; 6] = std::array::from_fn(|i| key[i / 3][i % 3] as i32);
                    let vertex = *known.entry(key).or_insert_with(|| {
                        mesh.positions.push(corners[k]);
                        mesh.normals.push(normal);
                        values.resize(mesh.positions.len() * count, 0.0f32);
                        meeting.push(0u32);
                        meeting.len() as u32 - 1
                    });
                    let at = self.radiosity.at(element, side, corners[k], quantity);
                    for (sum, v) in values[vertex as usize * count..].iter_mut().zip(at) {
                        *sum += v;
                    }
                    meeting[vertex as usize] += 1;
                    vertex
                });
                mesh.triangles.push(triangle);
            }
        }
        for (values, n) in values.chunks_mut(count).zip(meeting) {
            values.iter_mut().for_each(|v| *v /= n as f32);
        }
        Surface { mesh, values, first_facet }
    }

    /// The corners of [`Surface::mesh`] around a hit, and how much each counts there.
    pub(super) fn corners_at(&self, surface: &Surface, at: &Interaction) -> Option<([u32; 3], Vec3)> {
        let Some(first) = surface.first_facet else {
            return Some((*surface.mesh.triangles.get(at.face as usize)?, at.b));
        };
        let facets = self.radiosity.elements().facets();
        let facet = facets.at(at.shape, at.face, at.b)?;
        let corners = *surface.mesh.triangles.get(facet.checked_sub(first)? as usize)?;
        let (_, [p, q, r]) = facets.corners(self.scene, facet);
        // b = p + s (q - p) + t (r - p), in the last two coordinates.
        let (e, f, d) = (q - p, r - p, at.b - p);
        let det = e.y * f.z - e.z * f.y;
        let (s, t) = ((d.y * f.z - d.z * f.y) / det, (e.y * d.z - e.z * d.y) / det);
        Some((corners, Vec3::new(1.0 - s - t, s, t).clamp(Vec3::ZERO, Vec3::ONE)))
    }
}

//! Triangle meshes: what `flower` grows, `io` reads and writes, and `scene` traces.

use glam::{Vec2, Vec3};

use crate::{Error, Result};

/// Indexed triangles. Lengths in millimetres unless a function says otherwise (cell tiles are in um).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals, or empty for flat shading. On a petal they point to the adaxial side.
    pub normals: Vec<Vec3>,
    /// Vertex texture coordinates, or empty.
    pub uvs: Vec<Vec2>,
    /// Vertex indices, counter-clockwise seen from the normal's (adaxial) side.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Checks lengths, index range and finiteness. `at` names the mesh in errors.
    pub fn validate(&self, at: &str) -> Result<()> {
        let n = self.positions.len();
        if self.triangles.is_empty() {
            return Err(Error::invalid(at, "the mesh has no faces"));
        }
        if !self.normals.is_empty() && self.normals.len() != n {
            return Err(Error::invalid(at, format!("{} normals for {n} vertices", self.normals.len())));
        }
        if !self.uvs.is_empty() && self.uvs.len() != n {
            return Err(Error::invalid(
                at,
                format!("{} texture coordinates for {n} vertices", self.uvs.len()),
            ));
        }
        if let Some((f, t)) =
            self.triangles.iter().enumerate().find(|(_, t)| t.iter().any(|&i| i as usize >= n))
        {
            return Err(Error::invalid(
                at,
                format!("face {f} uses vertex {}, but there are {n}", t.iter().max().unwrap_or(&0)),
            ));
        }
        let finite = self.positions.iter().chain(&self.normals).all(|v| v.is_finite())
            && self.uvs.iter().all(|v| v.is_finite());
        if !finite {
            return Err(Error::invalid(at, "a vertex is not a finite number"));
        }
        Ok(())
    }

    /// The three corners of a face.
    pub fn corners(&self, face: usize) -> [Vec3; 3] {
        self.triangles[face].map(|i| self.positions[i as usize])
    }

    /// Area of a face.
    pub fn face_area(&self, face: usize) -> f32 {
        let [a, b, c] = self.corners(face);
        0.5 * (b - a).cross(c - a).length()
    }

    /// Smallest and largest corner of the bounding box.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.positions
            .iter()
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)))
    }

    /// Sets area-weighted vertex normals.
    pub fn compute_normals(&mut self) {
        let mut normals = vec![Vec3::ZERO; self.positions.len()];
        for t in &self.triangles {
            let [a, b, c] = t.map(|i| self.positions[i as usize]);
            let n = (b - a).cross(c - a);
            for &i in t {
                normals[i as usize] += n;
            }
        }
        self.normals = normals.into_iter().map(|n| n.normalize_or(Vec3::Z)).collect();
    }

    /// Adds the other mesh's faces. Both must have, or both lack, normals and uvs; what only one has is dropped.
    pub fn append(&mut self, other: &Mesh) {
        let base = self.positions.len() as u32;
        let keep_normals = self.positions.is_empty() || self.normals.len() == self.positions.len();
        let keep_uvs = self.positions.is_empty() || self.uvs.len() == self.positions.len();
        self.positions.extend_from_slice(&other.positions);
        if keep_normals && other.normals.len() == other.positions.len() {
            self.normals.extend_from_slice(&other.normals);
        } else {
            self.normals.clear();
        }
        if keep_uvs && other.uvs.len() == other.positions.len() {
            self.uvs.extend_from_slice(&other.uvs);
        } else {
            self.uvs.clear();
        }
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + base)));
    }
}

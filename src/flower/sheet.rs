//! A thin sheet as a mesh: samples one parametric mid-surface on a grid.

use glam::{DVec2, DVec3, Vec2};

use crate::geometry::Mesh;

/// A surface over the unit square: u runs across, v from the base to the rim, and d/dv x d/du points to the
/// adaxial side.
pub trait Sheet {
    /// Position in millimetres.
    fn at(&self, u: f64, v: f64) -> DVec3;
    /// Place on the flat sheet in [0, 1]^2, before it was bent.
    fn uv(&self, u: f64, v: f64) -> DVec2;
    /// Millimetres per unit of each texture coordinate.
    fn uv_scale_mm(&self) -> [f32; 2];
}

/// Mesh of `across` x `along` quadrilaterals. Rows crowd towards the rim by the power `crowding` >= 1, since
/// rims bend most.
pub fn mesh(sheet: &impl Sheet, across: usize, along: usize, crowding: f64) -> Mesh {
    let columns: Vec<f64> = (0..=across).map(|i| i as f64 / across as f64).collect();
    let rows: Vec<f64> = (0..=along).map(|j| 1.0 - (1.0 - j as f64 / along as f64).powf(crowding)).collect();
    mesh_on(sheet, &columns, &rows)
}

/// Mesh on the grid of these u and v, both rising.
pub fn mesh_on(sheet: &impl Sheet, columns: &[f64], rows: &[f64]) -> Mesh {
    let (across, along) = (columns.len() - 1, rows.len() - 1);
    let mut m = Mesh::default();
    for &v in rows {
        for &u in columns {
            m.positions.push(sheet.at(u, v).as_vec3());
            let uv = sheet.uv(u, v);
            m.uvs.push(Vec2::new(uv.x as f32, uv.y as f32));
        }
    }
    let vertex = |i: usize, j: usize| (j * (across + 1) + i) as u32;
    for j in 0..along {
        for i in 0..across {
            let [a, b] = [vertex(i, j), vertex(i + 1, j)];
            let [c, d] = [vertex(i, j + 1), vertex(i + 1, j + 1)];
            // Mirror-symmetric diagonals, so that a symmetric sheet has a symmetric mesh.
            if i < across / 2 {
                m.triangles.extend([[a, d, b], [a, c, d]]);
            } else {
                m.triangles.extend([[a, c, b], [b, c, d]]);
            }
        }
    }
    m.compute_normals();
    m
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Plane;
    impl Sheet for Plane {
        fn at(&self, u: f64, v: f64) -> DVec3 {
            DVec3::new(v * 3.0, u * 2.0, 0.0)
        }
        fn uv(&self, u: f64, v: f64) -> DVec2 {
            DVec2::new(u, v)
        }
        fn uv_scale_mm(&self) -> [f32; 2] {
            [2.0, 3.0]
        }
    }

    #[test]
    fn normals_and_winding_face_the_adaxial_side() {
        let m = mesh(&Plane, 5, 4, 1.5);
        m.validate("plane").expect("valid");
        assert_eq!(m.triangles.len(), 40);
        let area: f32 = (0..40).map(|f| m.face_area(f)).sum();
        assert!((area - 6.0).abs() < 1e-4);
        assert!(m.normals.iter().all(|n| (n.z - 1.0).abs() < 1e-6));
    }
}

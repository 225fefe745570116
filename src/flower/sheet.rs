//! A thin sheet as a mesh: samples one parametric mid-surface on a grid.

use glam::{DVec2, DVec3, Vec2};

use crate::geometry::Mesh;

/// A surface over the unit square: u runs across, v from the base to the rim, and d/dv x d/du points to the
/// adaxial side.
pub trait Sheet {
    /// Position in millimetres.
    fn at(&self, u: f64, v: f64) -> DVec3;
    /// Relief on the mid-surface, mm to the adaxial side.
    fn relief_mm(&self, _u: f64, _v: f64) -> f64 {
        0.0
    }
    /// Place on the flat sheet in [0, 1]^2, before it was bent.
    fn uv(&self, u: f64, v: f64) -> DVec2;
    /// Millimetres per unit of each texture coordinate.
    fn uv_scale_mm(&self) -> [f32; 2];
}

/// Mesh of `across` x `along` quadrilaterals. Rows crowd towards the rim by the power `crowding` >= 1, since
/// rims bend most.
pub fn mesh(sheet: &impl Sheet, across: usize, along: usize, crowding: f64) -> Mesh {
    let columns: Vec<f64> = (0..=across).map(|i| i as f64 / across as f64).collect();
    let rows: Vec<f64> = (0..=along).map(|j| row(j as f64 / along as f64, crowding)).collect();
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
    let mut flat = true;
    for (k, (v, u)) in rows.iter().flat_map(|v| columns.iter().map(move |u| (*v, *u))).enumerate() {
        let relief = sheet.relief_mm(u, v);
        if relief != 0.0 {
            flat = false;
            m.positions[k] += m.normals[k] * relief as f32;
        }
    }
    if !flat {
        m.compute_normals();
    }
    m
}

/// Where row t in [0, 1] of a mesh lies.
fn row(t: f64, crowding: f64) -> f64 {
    1.0 - (1.0 - t).powf(crowding)
}

/// A sheet whose mid-surface is interpolated between points of another, by Catmull-Rom splines: for fine meshes of
/// surfaces that are slow to compute.
pub struct Smooth<'a, S> {
    sheet: &'a S,
    points: Vec<DVec3>,
    across: usize,
    along: usize,
    crowding: f64,
}

impl<'a, S: Sheet> Smooth<'a, S> {
    /// Takes `across` x `along` quadrilaterals of the sheet, rows crowding as in [`mesh`].
    pub fn new(sheet: &'a S, across: usize, along: usize, crowding: f64) -> Self {
        let points = (0..=along)
            .flat_map(|j| (0..=across).map(move |i| (i, j)))
            .map(|(i, j)| sheet.at(i as f64 / across as f64, row(j as f64 / along as f64, crowding)))
            .collect();
        Self { sheet, points, across, along, crowding }
    }
}

impl<S: Sheet> Sheet for Smooth<'_, S> {
    fn at(&self, u: f64, v: f64) -> DVec3 {
        let t = 1.0 - (1.0 - v).max(0.0).powf(1.0 / self.crowding);
        let (i, wi) = spline(u, self.across);
        let (j, wj) = spline(t, self.along);
        // Beyond the border points go on straight.
        let point = |i: isize, j: isize| self.points[j as usize * (self.across + 1) + i as usize];
        let across = |j: isize| {
            let n = self.across as isize;
            (0..4).map(|k| wi[k as usize] * ahead(i + k - 1, n, |i| point(i, j))).sum::<DVec3>()
        };
        let n = self.along as isize;
        (0..4).map(|k| wj[k as usize] * ahead(j + k - 1, n, across)).sum()
    }

    fn relief_mm(&self, u: f64, v: f64) -> f64 {
        self.sheet.relief_mm(u, v)
    }

    fn uv(&self, u: f64, v: f64) -> DVec2 {
        self.sheet.uv(u, v)
    }

    fn uv_scale_mm(&self) -> [f32; 2] {
        self.sheet.uv_scale_mm()
    }
}

/// The point at `i`, mirrored through the ends 0 and `n` of the row.
fn ahead(i: isize, n: isize, at: impl Fn(isize) -> DVec3) -> DVec3 {
    if i < 0 {
        2.0 * at(0) - at(-i)
    } else if i > n {
        2.0 * at(n) - at(2 * n - i)
    } else {
        at(i)
    }
}

/// Interval of `n` in which t in [0, 1] lies, and the Catmull-Rom weights of the points -1 to 2 around it.
fn spline(t: f64, n: usize) -> (isize, [f64; 4]) {
    let x = t.clamp(0.0, 1.0) * n as f64;
    let i = x.floor().min(n as f64 - 1.0);
    let f = x - i;
    let (f2, f3) = (f * f, f * f * f);
    let weights = [
        0.5 * (-f + 2.0 * f2 - f3),
        0.5 * (2.0 - 5.0 * f2 + 3.0 * f3),
        0.5 * (f + 4.0 * f2 - 3.0 * f3),
        0.5 * (f3 - f2),
    ];
    (i as isize, weights)
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

    struct Dome;
    impl Sheet for Dome {
        fn at(&self, u: f64, v: f64) -> DVec3 {
            let (x, y) = (2.0 * u - 1.0, 2.0 * v - 1.0);
            DVec3::new(y, x, (2.0 * x).cos() * (1.5 * y).cos())
        }
        fn uv(&self, u: f64, v: f64) -> DVec2 {
            DVec2::new(u, v)
        }
        fn uv_scale_mm(&self) -> [f32; 2] {
            [2.0, 2.0]
        }
    }

    #[test]
    fn interpolated_sheets_follow_the_surface() {
        let smooth = Smooth::new(&Dome, 24, 30, 1.6);
        for k in 0..400 {
            let (u, v) = (f64::from(k % 20) / 19.0, f64::from(k / 20) / 19.0);
            let off = smooth.at(u, v).distance(Dome.at(u, v));
            // Steps of a twelfth: the error of cubic interpolation, larger where points are mirrored at the border.
            let edge = u.min(v).min(1.0 - u).min(1.0 - v) < 0.1;
            assert!(off < if edge { 4e-3 } else { 3e-4 }, "{u} {v}: {off}");
        }
    }
}

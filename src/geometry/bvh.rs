//! Bounding volume hierarchy over all triangles of a scene.
//!
//! Built by the `obvhs` crate (PLOC with reinsertion) as a binary tree, made wide and traversed by us (`super::wide`), with
//! our triangle test ([`super::triangle`]). The boxes of triangles are
//! widened by 1e-5 of the scene's diagonal, far more than the rounding error of the slab test for rays that
//! start within 30 diagonals, so that the hierarchy drops no hit (`closed_mesh_has_no_leaks`,
//! `agrees_with_brute_force`).

use std::time::Duration;

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::builder::build_bvh2;

use super::mesh::Mesh;
use super::ray::Ray;
use super::triangle::TriangleHit;
use super::wide::WideTree;

/// Nearest hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance, mm.
    pub t: f32,
    /// Barycentric coordinates.
    pub b: Vec3,
    /// Index of the mesh in the list that the hierarchy was built from.
    pub shape: u32,
    /// Face of that mesh.
    pub face: u32,
}

/// The hierarchy; immutable and shared by all threads.
#[derive(Default)]
pub struct Bvh {
    tree: WideTree,
    /// Shape and face of each triangle of the tree.
    faces: Vec<(u32, u32)>,
    bounds: (Vec3, Vec3),
}

impl std::fmt::Debug for Bvh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bvh").field("triangles", &self.faces.len()).finish_non_exhaustive()
    }
}

impl Bvh {
    /// Builds over valid meshes ([`Mesh::validate`]); triangles without area are left out.
    pub fn build<'a>(meshes: impl IntoIterator<Item = &'a Mesh>) -> Self {
        let mut corners = Vec::new();
        let mut faces = Vec::new();
        let mut bounds = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for (shape, mesh) in meshes.into_iter().enumerate() {
            for face in 0..mesh.triangles.len() {
                let [a, b, c] = mesh.corners(face);
                if (b - a).cross(c - a) == Vec3::ZERO {
                    continue;
                }
                for p in [a, b, c] {
                    bounds = (bounds.0.min(p), bounds.1.max(p));
                }
                corners.push([a, b, c]);
                faces.push((shape as u32, face as u32));
            }
        }
        if corners.is_empty() {
            return Self::default();
        }
        let widen = Vec3A::splat((bounds.1 - bounds.0).length() * 1e-5);
        let boxes: Vec<Aabb> = corners
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(Vec3A::from);
                Aabb::new(a.min(b).min(c) - widen, a.max(b).max(c) + widen)
            })
            .collect();
        let binary = build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut Duration::default());
        let (tree, order) = WideTree::new(&binary, |i| corners[i as usize].map(Vec3A::from));
        let faces = order.into_iter().map(|i| faces[i as usize]).collect();
        Self { tree, faces, bounds }
    }

    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.faces.len()
    }

    /// Is there nothing to hit?
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// Smallest and largest corner of everything.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.bounds
    }

    /// Nearest hit with `0 < t < ray.t_max`.
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let (i, TriangleHit { t, b }) = self.tree.nearest(ray)?;
        let (shape, face) = self.faces[i];
        Some(Hit { t, b, shape, face })
    }

    /// Is anything hit with `0 < t < ray.t_max`?
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.tree.any(ray)
    }
}

#[cfg(test)]
mod tests {
    use glam::UVec2;
    use rayon::prelude::*;

    use super::*;
    use crate::geometry::ray::offset_origin;
    use crate::geometry::triangle::ShearedRay;
    use crate::math::{Sampler, warp};

    /// Unit sphere of `2 n^2` quads, closed at the poles, deformed so that nothing is symmetric.
    fn blob(n: u32) -> Mesh {
        let mut mesh = Mesh::default();
        let (rows, columns) = (n, 2 * n);
        for i in 0..=rows {
            for j in 0..columns {
                let w = crate::math::frame::spherical(
                    std::f32::consts::PI * i as f32 / rows as f32,
                    std::f32::consts::TAU * j as f32 / columns as f32,
                );
                let pole = i == 0 || i == rows;
                let r = if pole { 1.0 } else { 1.0 + 0.2 * (3.0 * w.x + 0.3).sin() * (5.0 * w.y).cos() };
                let w = if pole { Vec3::Z * w.z.signum() } else { w };
                mesh.positions.push(w * r * 40.0 + Vec3::new(3.0, -7.0, 11.0));
            }
        }
        let at = |i: u32, j: u32| i * columns + j % columns;
        for i in 0..rows {
            for j in 0..columns {
                mesh.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        mesh
    }

    fn random_ray(i: u32, key: u32) -> Ray {
        let mut s = Sampler::new(u64::from(key), UVec2::ZERO, i);
        let d = warp::square_to_sphere(s.next_2d());
        let o = warp::square_to_sphere(s.next_2d()) * s.next_1d() * 20.0 + Vec3::new(3.0, -7.0, 11.0);
        Ray::new(o, d)
    }

    #[test]
    fn closed_mesh_has_no_leaks() {
        let mesh = blob(60);
        let bvh = Bvh::build([&mesh]);
        let leaks: u32 = (0..10_000_000u32 / 4)
            .into_par_iter()
            .map(|i| {
                // Four segments: one from inside, and three that start on the surface and go on inward, among
                // them rays aimed exactly at vertices and at edges.
                let mut ray = random_ray(i, 1);
                let target = mesh.positions[(i as usize * 7919) % mesh.positions.len()];
                if i % 3 == 0 {
                    ray.direction = (target - ray.origin).normalize();
                }
                let mut leaks = 0;
                for k in 0..4u32 {
                    let Some(hit) = bvh.intersect(&ray) else {
                        leaks += 1;
                        break;
                    };
                    let [a, b, c] = mesh.corners(hit.face as usize);
                    let ng = (b - a).cross(c - a).normalize();
                    let inward = if ng.dot(ray.direction) > 0.0 { -ng } else { ng };
                    let u = Sampler::new(9, UVec2::new(k, 0), i).next_2d();
                    let d = crate::math::Frame::from_normal(inward)
                        .to_world(warp::square_to_cosine_hemisphere(u));
                    ray = Ray::new(offset_origin(a * hit.b.x + b * hit.b.y + c * hit.b.z, ng, d), d);
                }
                leaks
            })
            .sum();
        assert_eq!(leaks, 0);
    }

    #[test]
    fn agrees_with_brute_force() {
        let mesh = blob(12);
        let bvh = Bvh::build([&mesh]);
        for i in 0..4000 {
            let ray = random_ray(i, 2);
            let sheared = ShearedRay::new(&ray);
            let brute = (0..mesh.triangles.len())
                .filter_map(|f| sheared.intersect(&mesh.corners(f).map(Vec3A::from), f32::INFINITY))
                .map(|h| h.t)
                .fold(f32::INFINITY, f32::min);
            let t = bvh.intersect(&ray).map_or(f32::INFINITY, |h| h.t);
            assert_eq!(t, brute, "ray {i}");
            let short = Ray { t_max: brute * 0.999, ..ray };
            assert!(!bvh.occluded(&short) && bvh.occluded(&Ray { t_max: brute * 1.001, ..ray }), "ray {i}");
        }
    }

    #[test]
    fn large_triangles_are_left_for_good() {
        // A floor of 20 m: rays that leave it, however flat, never meet it again.
        let s = 1e4;
        let corners = [(-s, -s), (s, -s), (s, s), (-s, s)];
        let floor = Mesh {
            positions: corners.map(|(x, y)| Vec3::new(x, y, 1.0)).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        };
        let bvh = Bvh::build([&floor]);
        for i in 0..100_000 {
            let mut sampler = Sampler::new(3, UVec2::ZERO, i);
            let at = (sampler.next_2d() * 40.0 - 20.0).extend(1.0);
            let mut d = warp::square_to_sphere(sampler.next_2d());
            d.z *= 10f32.powi(-((i % 5) as i32));
            let d = d.normalize();
            assert!(bvh.intersect(&Ray::new(offset_origin(at, Vec3::Z, d), d)).is_none(), "{at} {d}");
        }
    }

    #[test]
    fn deep_trees_are_walked_to_the_end() {
        // Triangles one behind the other, each twice as far and as large as the one before: every ray meets all boxes.
        let mut mesh = Mesh::default();
        for i in 0..60 {
            let size = 1.5f32.powi(i);
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([
                Vec3::new(-size, -size, size),
                Vec3::new(size, -size, size),
                Vec3::new(0.0, size, size),
            ]);
            mesh.triangles.push([first, first + 1, first + 2]);
        }
        let bvh = Bvh::build([&mesh]);
        let back = Ray::new(Vec3::new(0.0, 0.0, 1.5f32.powi(60)), -Vec3::Z);
        assert_eq!(bvh.intersect(&back).unwrap().face, 59);
        assert_eq!(bvh.intersect(&Ray::new(Vec3::ZERO, Vec3::Z)).unwrap().face, 0);
        let after = Ray::new(Vec3::new(0.0, 0.0, 1.2), Vec3::Z);
        assert_eq!(bvh.intersect(&after).unwrap().face, 1);
        assert!(bvh.occluded(&after) && !bvh.occluded(&Ray { t_max: 0.2, ..after }));
    }

    #[test]
    fn nothing_to_hit() {
        let bvh = Bvh::build([]);
        assert!(
            bvh.is_empty() && bvh.intersect(&random_ray(0, 0)).is_none() && !bvh.occluded(&random_ray(0, 0))
        );
    }
}

//! Facets: the smallest pieces of surface that light is carried between.
//!
//! Model: a facet is a triangle of a mesh, or one of n^2 equal triangles that a large one is divided into. Triangles
//! without area have no facet; of triangles with the same three corners the first has one, and the others are it.
//!
//! ```text
//! row j of a divided triangle has 2 (n - j) - 1 facets;  index = j (2 n - j) + 2 i + inverted
//! i = floor(n b1), j = floor(n b2), inverted where frac(n b1) + frac(n b2) > 1
//! ```
//!
//! Facets are gathered into connected pieces of surface: triangles of one shape whose corners have the same places hang
//! together. Light is smooth along a piece only. Guarded by `every_point_lies_in_its_facet`, `pieces_hang_together`,
//! `false_triangles_are_left_out`. Source: our reading.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, DefaultHasher};

use glam::Vec3;
use rayon::prelude::*;

use crate::geometry::Mesh;
use crate::scene::Scene;

/// No facet.
const NONE: u32 = u32::MAX;
/// Most facets along an edge of a divided triangle.
const MAX_DIVISIONS: u32 = 128;
/// A piece of few triangles gets about this many facets for each element that it may have.
const FACETS_PER_ELEMENT: f64 = 8.0;

/// A facet of the list.
#[derive(Clone, Copy, Debug)]
struct Facet {
    /// Of all triangles of the scene.
    triangle: u32,
    /// Which part of it.
    part: u32,
}

/// Where a triangle's facets are.
#[derive(Clone, Copy, Debug)]
struct Divided {
    first: u32,
    divisions: u32,
}

/// What was found wrong with the triangles of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flaws {
    /// Triangles without area: left out.
    pub without_area: usize,
    /// Triangles that have the same three corners as one before: left out.
    pub duplicate: usize,
}

/// All facets of a scene.
#[derive(Debug)]
pub struct Facets {
    facets: Vec<Facet>,
    triangles: Vec<Divided>,
    /// First triangle of each shape; one more at the end.
    first_triangle: Vec<u32>,
    /// Connected piece of each facet.
    piece: Vec<u32>,
    pieces: usize,
    flaws: Flaws,
}

/// The barycentric corners of a part of a triangle divided by `n`.
fn part_corners(part: u32, n: u32) -> [Vec3; 3] {
    if n == 1 {
        return [Vec3::X, Vec3::Y, Vec3::Z];
    }
    let row = |j: u32| j * (2 * n - j);
    // The root finds the row but for rounding.
    let mut j = (f64::from(n) - (f64::from(n * n - part)).sqrt()) as u32;
    while j > 0 && row(j) > part {
        j -= 1;
    }
    while j + 1 < n && row(j + 1) <= part {
        j += 1;
    }
    let k = part - row(j);
    let (i, inverted) = (k / 2, k % 2 == 1);
    let at = |i: u32, j: u32| {
        let (b1, b2) = (i as f32 / n as f32, j as f32 / n as f32);
        Vec3::new((n - i - j) as f32 / n as f32, b1, b2)
    };
    match inverted {
        false => [at(i, j), at(i + 1, j), at(i, j + 1)],
        true => [at(i + 1, j + 1), at(i, j + 1), at(i + 1, j)],
    }
}

/// The part of a triangle divided by `n` in which barycentric coordinates lie.
fn part_at(b: Vec3, n: u32) -> u32 {
    if n == 1 {
        return 0;
    }
    let scale = n as f32;
    let (u, v) = (b.y.clamp(0.0, 1.0) * scale, b.z.clamp(0.0, 1.0) * scale);
    let j = (v as u32).min(n - 1);
    let i = (u as u32).min(n - 1 - j);
    let inverted = i + j + 1 < n && (u - i as f32) + (v - j as f32) > 1.0;
    j * (2 * n - j) + 2 * i + u32::from(inverted)
}

impl Facets {
    /// Of all shapes; at most about `elements` of them will be told apart by area.
    pub fn new(scene: &Scene, elements: u32) -> Self {
        let mut first_triangle = vec![0];
        for shape in &scene.shapes {
            first_triangle.push(first_triangle[first_triangle.len() - 1] + shape.mesh.triangles.len() as u32);
        }
        let mut flaws = Flaws::default();
        let same = duplicates(scene, &first_triangle, &mut flaws);
        let piece_of = pieces(scene, &first_triangle, &same);
        let count = piece_of.iter().filter(|p| **p != NONE).max().map_or(0, |p| *p as usize + 1);
        let mut area = vec![0.0f64; count];
        let mut triangles_of = vec![0u32; count];
        for (t, p) in piece_of.iter().enumerate().filter(|(_, p)| **p != NONE) {
            area[*p as usize] += f64::from(face_area(scene, &first_triangle, t as u32));
            triangles_of[*p as usize] += 1;
        }
        let shares = shares(&area, f64::from(elements));
        let mut out = Self {
            facets: Vec::new(),
            triangles: vec![Divided { first: NONE, divisions: 1 }; piece_of.len()],
            first_triangle,
            piece: Vec::new(),
            pieces: count,
            flaws,
        };
        for t in 0..piece_of.len() {
            if same[t] != t as u32 {
                // A later copy: its light is the first one's.
                out.triangles[t] = match same[t] {
                    NONE => out.triangles[t],
                    s => Divided { first: out.triangles[s as usize].first, divisions: 1 },
                };
                continue;
            }
            let p = piece_of[t] as usize;
            let wanted = shares[p] * FACETS_PER_ELEMENT;
            let divisions = if f64::from(triangles_of[p]) < wanted {
                let part = f64::from(face_area(scene, &out.first_triangle, t as u32)) / area[p].max(1e-300);
                (((part * wanted).sqrt().ceil()) as u32).clamp(1, MAX_DIVISIONS)
            } else {
                1
            };
            out.triangles[t] = Divided { first: out.facets.len() as u32, divisions };
            for part in 0..divisions * divisions {
                out.facets.push(Facet { triangle: t as u32, part });
                out.piece.push(piece_of[t]);
            }
        }
        out
    }

    /// Number of facets.
    pub fn len(&self) -> usize {
        self.facets.len()
    }

    /// Has the scene no surface?
    pub fn is_empty(&self) -> bool {
        self.facets.is_empty()
    }

    /// What was left out.
    pub fn flaws(&self) -> Flaws {
        self.flaws
    }

    /// Number of connected pieces.
    pub fn pieces(&self) -> usize {
        self.pieces
    }

    /// Connected piece of a facet.
    pub fn piece(&self, facet: u32) -> u32 {
        self.piece[facet as usize]
    }

    /// The facets of a triangle of a shape: the first one's number and how many; `None` where it has no area.
    pub fn of_face(&self, shape: u32, face: u32) -> Option<(u32, u32)> {
        let d = self.triangles[(self.first_triangle[shape as usize] + face) as usize];
        (d.first != NONE).then_some((d.first, d.divisions * d.divisions))
    }

    /// The facet at a point of a triangle, by its barycentric coordinates.
    pub fn at(&self, shape: u32, face: u32, b: Vec3) -> Option<u32> {
        let d = self.triangles[(self.first_triangle[shape as usize] + face) as usize];
        (d.first != NONE).then(|| d.first + part_at(b, d.divisions))
    }

    /// Shape and face that a facet is of.
    pub fn face(&self, facet: u32) -> (u32, u32) {
        let t = self.facets[facet as usize].triangle;
        let shape = self.first_triangle.partition_point(|first| *first <= t) as u32 - 1;
        (shape, t - self.first_triangle[shape as usize])
    }

    /// Corners of a facet, in the triangle's order, and their barycentric coordinates.
    pub fn corners(&self, scene: &Scene, facet: u32) -> ([Vec3; 3], [Vec3; 3]) {
        let (shape, face) = self.face(facet);
        let Facet { triangle, part } = self.facets[facet as usize];
        let b = part_corners(part, self.triangles[triangle as usize].divisions);
        let corners = scene.shapes[shape as usize].mesh.corners(face as usize);
        (b.map(|b| corners[0] * b.x + corners[1] * b.y + corners[2] * b.z), b)
    }
}

/// How many of `elements` a piece of surface may have: in proportion to the fourth root of its area, so that a petal
/// before a wall is still resolved, and at least one.
pub(super) fn shares(area: &[f64], elements: f64) -> Vec<f64> {
    let total: f64 = area.iter().map(|a| a.sqrt().sqrt()).sum();
    area.iter().map(|a| (elements * a.sqrt().sqrt() / total.max(1e-300)).max(1.0)).collect()
}

fn face_area(scene: &Scene, first_triangle: &[u32], triangle: u32) -> f32 {
    let shape = first_triangle.partition_point(|first| *first <= triangle) - 1;
    scene.shapes[shape].mesh.face_area((triangle - first_triangle[shape]) as usize)
}

/// Normal of a face to the adaxial side, with twice its area as length, as a ray that hits it finds it.
pub fn face_normal(mesh: &Mesh, face: usize) -> Vec3 {
    let [a, b, c] = mesh.corners(face);
    let n = (b - a).cross(c - a);
    if mesh.normals.is_empty() {
        return n;
    }
    let shading: Vec3 = mesh.triangles[face].iter().map(|i| mesh.normals[*i as usize]).sum();
    if n.dot(shading) < 0.0 { -n } else { n }
}

fn bits(p: Vec3) -> [u32; 3] {
    // One zero.
    (p + Vec3::ZERO).to_array().map(f32::to_bits)
}

/// For each triangle the first one with the same corners (itself, where it is the first), `NONE` without area.
fn duplicates(scene: &Scene, first_triangle: &[u32], flaws: &mut Flaws) -> Vec<u32> {
    let total = first_triangle[first_triangle.len() - 1] as usize;
    let mut keys: Vec<(u64, u32)> = Vec::with_capacity(total);
    let mut same = vec![NONE; total];
    for (shape, first) in scene.shapes.iter().zip(first_triangle) {
        let mesh = &shape.mesh;
        let found: Vec<(u64, u32)> = (0..mesh.triangles.len())
            .into_par_iter()
            .filter(|f| mesh.face_area(*f) > 0.0)
            .map(|f| (corner_hash(mesh, f), first + f as u32))
            .collect();
        flaws.without_area += mesh.triangles.len() - found.len();
        keys.extend(found);
    }
    keys.par_sort_unstable();
    let sorted = |t: u32| {
        let shape = first_triangle.partition_point(|first| *first <= t) - 1;
        let mut corners = scene.shapes[shape].mesh.corners((t - first_triangle[shape]) as usize).map(bits);
        corners.sort_unstable();
        corners
    };
    let mut start = 0;
    while start < keys.len() {
        let end = start + keys[start..].iter().take_while(|k| k.0 == keys[start].0).count();
        for i in start..end {
            let t = keys[i].1;
            let first = keys[start..i].iter().map(|k| k.1).find(|s| sorted(*s) == sorted(t));
            same[t as usize] = match first {
                None => t,
                Some(s) => {
                    flaws.duplicate += 1;
                    same[s as usize]
                }
            };
        }
        start = end;
    }
    same
}

/// A hash of the corners in any order.
fn corner_hash(mesh: &Mesh, face: usize) -> u64 {
    mesh.corners(face).iter().fold(0u64, |sum, p| {
        let [x, y, z] = bits(*p).map(u64::from);
        let mut h = x.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ y.rotate_left(21) ^ z.rotate_left(42);
        h = (h ^ (h >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        sum.wrapping_add(h ^ (h >> 32))
    })
}

/// The connected piece of each triangle that has area, numbered in the order of their first triangles.
fn pieces(scene: &Scene, first_triangle: &[u32], same: &[u32]) -> Vec<u32> {
    let mut piece = vec![NONE; same.len()];
    let mut count = 0;
    for (shape, first) in scene.shapes.iter().zip(first_triangle) {
        let mesh = &shape.mesh;
        // Corners with the same place are one.
        let mut place: HashMap<[u32; 3], u32, BuildHasherDefault<DefaultHasher>> = HashMap::default();
        let welded: Vec<u32> = (mesh.positions.iter().enumerate())
            .map(|(i, p)| *place.entry(bits(*p)).or_insert(i as u32))
            .collect();
        let mut parent: Vec<u32> = (0..mesh.positions.len() as u32).collect();
        for (f, t) in mesh.triangles.iter().enumerate() {
            if same[*first as usize + f] == NONE {
                continue;
            }
            let [a, b, c] = t.map(|i| root(&mut parent, welded[i as usize]));
            let low = a.min(b).min(c);
            for i in [a, b, c] {
                parent[i as usize] = low;
            }
        }
        let mut number: HashMap<u32, u32, BuildHasherDefault<DefaultHasher>> = HashMap::default();
        for (f, t) in mesh.triangles.iter().enumerate() {
            let at = *first as usize + f;
            if same[at] == at as u32 {
                let r = root(&mut parent, welded[t[0] as usize]);
                piece[at] = *number.entry(r).or_insert_with(|| {
                    count += 1;
                    count - 1
                });
            }
        }
    }
    piece
}

fn root(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}

#[cfg(test)]
mod tests {
    use glam::UVec2;

    use super::super::testing::scene;
    use super::*;
    use crate::math::{Sampler, warp};

    #[test]
    fn every_point_lies_in_its_facet() {
        for n in [1, 2, 3, 7, 128] {
            for i in 0..2000 {
                let u = Sampler::new(1, UVec2::new(n, 0), i).next_2d();
                let b = warp::square_to_triangle(u);
                let part = part_at(b, n);
                assert!(part < n * n);
                let [p, q, r] = part_corners(part, n);
                // b = p + s (q - p) + t (r - p) with s, t >= 0, s + t <= 1.
                let (e, f, d) = (q - p, r - p, b - p);
                let det = e.y * f.z - e.z * f.y;
                let (s, t) = ((d.y * f.z - d.z * f.y) / det, (e.y * d.z - e.z * d.y) / det);
                assert!(s > -1e-3 && t > -1e-3 && s + t < 1.0 + 1e-3, "{n} {b} {part}: {s} {t}");
            }
            let area: f32 = (0..n * n)
                .map(|k| {
                    let [p, q, r] = part_corners(k, n);
                    let (e, f) = (q - p, r - p);
                    e.y * f.z - e.z * f.y
                })
                .sum();
            assert!((area - 1.0).abs() < 1e-4, "{n}: {area}");
        }
    }

    #[test]
    fn pieces_hang_together() {
        let s = scene(
            r#"
            [shapes.a]
            type = "sphere"
            radius_mm = 3
            subdivisions = 2
            material = "grey"
            [shapes.b]
            type = "quad"
            width_mm = 10
            height_mm = 10
            position_mm = [0, 0, -5]
            material = "grey"
            "#,
        );
        let facets = Facets::new(&s, 100);
        assert_eq!((facets.pieces(), facets.flaws()), (2, Flaws::default()));
        // The sphere has triangles enough or nearly so; the quad is divided.
        let (_, parts) = facets.of_face(1, 0).unwrap();
        assert!(parts >= 64, "{parts}");
        let total: f32 = (0..facets.len() as u32)
            .map(|f| {
                let ([a, b, c], _) = facets.corners(&s, f);
                0.5 * (b - a).cross(c - a).length()
            })
            .sum();
        let exact: f32 =
            s.shapes.iter().flat_map(|s| (0..s.mesh.triangles.len()).map(|f| s.mesh.face_area(f))).sum();
        assert!((total / exact - 1.0).abs() < 1e-4, "{total} {exact}");
        for f in 0..facets.len() as u32 {
            let (shape, face) = facets.face(f);
            let (_, b) = facets.corners(&s, f);
            assert_eq!(facets.at(shape, face, (b[0] + b[1] + b[2]) / 3.0), Some(f));
            assert_eq!(facets.piece(f), shape);
        }
    }

    #[test]
    fn false_triangles_are_left_out() {
        let mut s = scene("[shapes.q]\ntype = \"quad\"\nwidth_mm = 2\nheight_mm = 2\nmaterial = \"grey\"\n");
        let mesh = &mut s.shapes[0].mesh;
        // The first face again, turned over; and one without area.
        mesh.triangles.push([2, 1, 0]);
        mesh.triangles.push([0, 0, 1]);
        let facets = Facets::new(&s, 10);
        assert_eq!(facets.flaws(), Flaws { without_area: 1, duplicate: 1 });
        assert_eq!(facets.of_face(0, 3), None);
        assert_eq!(facets.of_face(0, 2).map(|f| f.0), facets.of_face(0, 0).map(|f| f.0));
    }
}

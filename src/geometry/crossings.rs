//! Where surfaces pass through each other: pairs of triangles that cross.
//!
//! Model: two triangles cross if their common points are a segment of positive length that leaves each plane
//! on both sides. Touching does not count, nor do two triangles that share a corner (bit for bit, whatever
//! its index) or lie in one plane.
//!
//! Equation (Moller 1997, "A fast triangle-triangle intersection test", J. Graphics Tools 2:2): with the planes
//! n_a . x = c_a and n_b . x = c_b, the corners of each triangle lie strictly on both sides of the other's
//! plane, and the intervals that both cut out of the planes' common line overlap. In f64: products of three
//! differences of f32 are known to 1e-15 of their size. Guarded by `agrees_with_piercing_edges`.
//!
//! Candidates come from a tree of boxes, split at the median of the longest side: n log n;
//! `fine_sheets_cross_once_tilted` has 193 600 triangles.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::mesh::Mesh;

/// Two triangles that cross, the first before the second in the list of meshes and faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Crossing {
    /// Indices of their meshes.
    pub meshes: [u32; 2],
    /// Their faces.
    pub faces: [u32; 2],
}

/// Number of crossing pairs of a triangle of `a` and one of `b`.
pub fn crossing_pairs(a: &Mesh, b: &Mesh) -> usize {
    find(&[a, b], |i, j| i != j).len()
}

/// Number of crossing pairs of triangles of one mesh.
pub fn self_crossing_pairs(mesh: &Mesh) -> usize {
    find(&[mesh], |_, _| true).len()
}

/// All crossing pairs of triangles, within the meshes and between them, in order. The meshes must be valid
/// ([`Mesh::validate`]).
pub fn crossings(meshes: &[&Mesh]) -> Vec<Crossing> {
    find(meshes, |_, _| true)
}

/// Pairs of triangles in the meshes that `wanted` takes.
fn find(meshes: &[&Mesh], wanted: impl Fn(u32, u32) -> bool + Sync) -> Vec<Crossing> {
    let mut triangles: Vec<Triangle> = meshes
        .iter()
        .zip(0..)
        .flat_map(|(mesh, id)| (0..mesh.triangles.len()).map(move |f| Triangle::new(mesh, id, f)))
        .collect();
    let mut nodes = Vec::with_capacity(triangles.len() / 2);
    let count = triangles.len();
    if count > 0 {
        build(&mut triangles, 0, &mut nodes);
    }
    let mut found: Vec<Crossing> = (0..count)
        .into_par_iter()
        .flat_map_iter(|i| {
            let (mut here, mut next) = (Vec::new(), 0);
            let t = &triangles[i];
            while next < nodes.len() {
                let node: &Node = &nodes[next];
                // Each pair is looked at from the triangle that comes first in the tree.
                if node.end as usize <= i + 1 || !overlap(t.low, t.high, node.low, node.high) {
                    next = node.skip as usize;
                    continue;
                }
                if node.skip as usize == next + 1 {
                    for other in &triangles[(i + 1).max(node.first as usize)..node.end as usize] {
                        if wanted(t.mesh, other.mesh)
                            && overlap(t.low, t.high, other.low, other.high)
                            && cross(&t.corners, &other.corners)
                        {
                            here.push(t.crossing(other));
                        }
                    }
                }
                next += 1;
            }
            here
        })
        .collect();
    found.sort_unstable();
    found
}

/// A triangle with its box.
#[derive(Clone, Copy, Debug)]
struct Triangle {
    corners: [Vec3; 3],
    low: Vec3,
    high: Vec3,
    mesh: u32,
    face: u32,
}

impl Triangle {
    fn new(mesh: &Mesh, id: u32, face: usize) -> Self {
        let corners = mesh.corners(face);
        let [a, b, c] = corners;
        Self { corners, low: a.min(b).min(c), high: a.max(b).max(c), mesh: id, face: face as u32 }
    }

    fn crossing(&self, other: &Self) -> Crossing {
        let (a, b) = ((self.mesh, self.face), (other.mesh, other.face));
        let (a, b) = if a < b { (a, b) } else { (b, a) };
        Crossing { meshes: [a.0, b.0], faces: [a.1, b.1] }
    }
}

/// A node of the tree, in depth-first order: what is in it, and the node after its last descendant.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: Vec3,
    high: Vec3,
    first: u32,
    end: u32,
    skip: u32,
}

const LEAF: usize = 4;

/// Sorts the triangles into a tree whose nodes are appended.
fn build(triangles: &mut [Triangle], first: usize, nodes: &mut Vec<Node>) {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (mut near, mut far) = (low, high);
    for t in &*triangles {
        (low, high) = (low.min(t.low), high.max(t.high));
        let middle = t.low + t.high;
        (near, far) = (near.min(middle), far.max(middle));
    }
    let (first, end) = (first as u32, (first + triangles.len()) as u32);
    let at = nodes.len();
    nodes.push(Node { low, high, first, end, skip: 0 });
    if triangles.len() > LEAF {
        let axis = (far - near).max_position();
        let half = triangles.len() / 2;
        triangles.select_nth_unstable_by(half, |a, b| {
            (a.low[axis] + a.high[axis]).total_cmp(&(b.low[axis] + b.high[axis]))
        });
        let (left, right) = triangles.split_at_mut(half);
        build(left, first as usize, nodes);
        build(right, first as usize + half, nodes);
    }
    nodes[at].skip = nodes.len() as u32;
}

fn overlap(low: Vec3, high: Vec3, other_low: Vec3, other_high: Vec3) -> bool {
    low.cmple(other_high).all() && other_low.cmple(high).all()
}

/// Do two triangles cross?
fn cross(a: &[Vec3; 3], b: &[Vec3; 3]) -> bool {
    if a.iter().any(|p| b.contains(p)) {
        return false;
    }
    let [a, b] = [a, b].map(|t| t.map(|p| p.as_dvec3()));
    let Some((normal_a, heights_b)) = heights(&a, &b) else { return false };
    let Some((normal_b, heights_a)) = heights(&b, &a) else { return false };
    let axis = normal_a.cross(normal_b).abs().max_position();
    let (from_a, to_a) = interval(&a, heights_a, axis);
    let (from_b, to_b) = interval(&b, heights_b, axis);
    from_a.max(from_b) < to_a.min(to_b)
}

/// Normal of a plane and heights of the other corners above it, if they lie strictly on both sides.
fn heights(plane: &[DVec3; 3], other: &[DVec3; 3]) -> Option<(DVec3, [f64; 3])> {
    let normal = (plane[1] - plane[0]).cross(plane[2] - plane[0]);
    let heights = other.map(|p| {
        let arm = p - plane[0];
        let height = normal.dot(arm);
        // What rounding may have made is the plane itself.
        if height.abs() <= 1e-14 * normal.length() * arm.length() { 0.0 } else { height }
    });
    let both = heights.iter().any(|h| *h > 0.0) && heights.iter().any(|h| *h < 0.0);
    both.then_some((normal, heights))
}

/// What a triangle cuts out of the common line, along an axis.
fn interval(corners: &[DVec3; 3], heights: [f64; 3], axis: usize) -> (f64, f64) {
    let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
    for i in 0..3 {
        let j = (i + 1) % 3;
        let (p, q) = (corners[i][axis], corners[j][axis]);
        let at = if heights[i] == 0.0 {
            p
        } else if heights[i] * heights[j] < 0.0 {
            p + (q - p) * heights[i] / (heights[i] - heights[j])
        } else {
            continue;
        };
        (from, to) = (from.min(at), to.max(at));
    }
    (from, to)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::{hash, hash_to_unit};

    fn soup(count: u32, seed: u32, size: f32) -> Mesh {
        let unit = |k: u32| hash_to_unit(hash(k.wrapping_mul(0x9e37_79b9) ^ hash(seed))) as f32;
        let mut m = Mesh::default();
        for f in 0..count {
            let place = Vec3::from_array([0, 1, 2].map(|c| unit(12 * f + c)));
            for corner in 0..3 {
                let p = Vec3::from_array([0, 1, 2].map(|c| unit(12 * f + 3 + 3 * corner + c)));
                m.positions.push(place + size * p);
            }
            m.triangles.push([3 * f, 3 * f + 1, 3 * f + 2]);
        }
        m
    }

    /// Triangles cross where an edge of one pierces the other: signs of volumes alone.
    fn pierced(a: [Vec3; 3], b: [Vec3; 3]) -> bool {
        let volume = |p: [Vec3; 4]| {
            let [a, b, c, d] = p.map(|p| p.as_dvec3());
            (b - a).cross(c - a).dot(d - a)
        };
        let pierces = |t: [Vec3; 3], p: Vec3, q: Vec3| {
            let side = |p| volume([t[0], t[1], t[2], p]);
            let around = [0, 1, 2].map(|i| volume([p, q, t[i], t[(i + 1) % 3]]));
            side(p) * side(q) < 0.0 && (around.iter().all(|v| *v > 0.0) || around.iter().all(|v| *v < 0.0))
        };
        (0..3).any(|i| pierces(b, a[i], a[(i + 1) % 3]) || pierces(a, b[i], b[(i + 1) % 3]))
    }

    #[test]
    fn agrees_with_piercing_edges() {
        let (a, b) = (soup(300, 1, 0.3), soup(250, 2, 0.3));
        let brute = |a: &Mesh, b: &Mesh, within: bool| {
            let pairs = |i: usize| (if within { i + 1 } else { 0 })..b.triangles.len();
            (0..a.triangles.len())
                .map(|i| pairs(i).filter(|&j| pierced(a.corners(i), b.corners(j))).count())
                .sum::<usize>()
        };
        let (between, within) = (brute(&a, &b, false), brute(&a, &a, true));
        assert!(between > 200 && within > 100, "{between} {within}");
        assert_eq!(crossing_pairs(&a, &b), between);
        assert_eq!(crossing_pairs(&b, &a), between);
        assert_eq!(self_crossing_pairs(&a), within);
        let all = crossings(&[&a, &b]);
        assert_eq!(all.iter().filter(|c| c.meshes == [0, 1]).count(), between);
        assert_eq!(all.iter().filter(|c| c.meshes == [0, 0]).count(), within);
        for c in all.iter().filter(|c| c.meshes == [0, 1]) {
            assert!(pierced(a.corners(c.faces[0] as usize), b.corners(c.faces[1] as usize)));
        }
    }

    fn triangle(corners: [[f32; 3]; 3]) -> Mesh {
        Mesh { positions: corners.map(Vec3::from).to_vec(), triangles: vec![[0, 1, 2]], ..Mesh::default() }
    }

    #[test]
    fn touching_and_sharing_do_not_count() {
        let flat = triangle([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]]);
        let cases = [
            ("through the middle", [[1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [3.0, 3.0, 0.5]], 1),
            ("beside", [[5.0, 1.0, -1.0], [5.0, 1.0, 1.0], [6.0, 3.0, 0.5]], 0),
            ("a corner on the face", [[1.0, 1.0, 0.0], [1.0, 2.0, 1.0], [2.0, 1.0, 1.0]], 0),
            ("an edge on the face", [[1.0, 1.0, 0.0], [2.0, 1.0, 0.0], [1.0, 1.0, 1.0]], 0),
            ("in the same plane", [[1.0, 1.0, 0.0], [2.0, 1.0, 0.0], [1.0, 2.0, 0.0]], 0),
            ("a shared corner", [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [1.0, 1.0, -1.0]], 0),
            ("edges that meet in a point", [[1.0, 0.0, -1.0], [1.0, 0.0, 1.0], [1.0, -2.0, 0.0]], 0),
            ("a corner in the plane, still through", [[1.0, 1.0, 0.0], [1.0, 2.0, 1.0], [1.5, 1.0, -1.0]], 1),
        ];
        for (name, corners, expected) in cases {
            let other = triangle(corners);
            assert_eq!(crossing_pairs(&flat, &other), expected, "{name}");
            assert_eq!(crossing_pairs(&other, &flat), expected, "{name}, turned");
        }
        assert_eq!(crossing_pairs(&flat, &flat), 0);
        assert_eq!(crossing_pairs(&flat, &Mesh::default()), 0);
        assert_eq!(crossings(&[]), []);
    }

    /// A wavy sheet of 2 n^2 triangles at a height.
    fn sheet(n: u32, height: f32) -> Mesh {
        let mut m = Mesh::default();
        for j in 0..=n {
            for i in 0..=n {
                let (x, y) = (i as f32 / n as f32, j as f32 / n as f32);
                m.positions.push(Vec3::new(x, y, height + 0.1 * (7.0 * x).sin() * (5.0 * y).cos()));
            }
        }
        let at = |i: u32, j: u32| j * (n + 1) + i;
        for j in 0..n {
            for i in 0..n {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
                m.triangles.extend([[a, b, d], [a, d, c]]);
            }
        }
        m
    }

    #[test]
    fn fine_sheets_cross_once_tilted() {
        let (low, high) = (sheet(220, 0.0), sheet(220, 1e-4));
        assert_eq!(crossings(&[&low, &high]), []);
        let mut tilted = high;
        for p in &mut tilted.positions {
            p.z += 0.01 * (p.x - 0.5013);
        }
        // The sheets meet along a line that runs through all rows.
        let count = crossing_pairs(&low, &tilted);
        assert!((220..2000).contains(&count), "{count}");
    }
}

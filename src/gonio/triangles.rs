//! Linear interpolation over scattered points of a plane: Delaunay triangles, found by a grid of buckets.
//!
//! Outside the hull the nearest point of the hull counts. Points on one line, or one point, are a chain of segments with
//! the same rule. Guarded by `weights_are_those_of_the_place`, `outside_is_the_nearest_point_of_the_hull`.

use glam::DVec2;
use spade::{DelaunayTriangulation, Point2, Triangulation};

use crate::{Error, Result};

/// Corners and their weights, which sum to one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weights {
    pub(super) corners: [(u32, f64); 3],
    /// Was the place inside the hull?
    pub(super) inside: bool,
}

/// The triangulation of some points.
#[derive(Clone, Debug)]
pub(super) struct Mesh {
    points: Vec<DVec2>,
    triangles: Vec<[u32; 3]>,
    /// Edges of the hull; for points on one line the segments between neighbours.
    hull: Vec<[u32; 2]>,
    min: DVec2,
    cells_per_unit: f64,
    cells: [usize; 2],
    /// Triangles that touch cell c: `bucket[starts[c]..starts[c + 1]]`.
    starts: Vec<u32>,
    bucket: Vec<u32>,
}

impl Mesh {
    /// Triangulates at least one point.
    pub(super) fn new(points: Vec<DVec2>) -> Result<Self> {
        let wrong = |what: &str| Error::invalid("readings", what);
        if points.is_empty() || points.len() > u32::MAX as usize / 8 {
            return Err(wrong("no directions, or too many to triangulate"));
        }
        let vertices = points.iter().map(|p| Point2::new(p.x, p.y)).collect();
        let delaunay = DelaunayTriangulation::<Point2<f64>>::bulk_load_stable(vertices)
            .map_err(|e| Error::invalid("readings", format!("directions cannot be triangulated: {e}")))?;
        if delaunay.num_vertices() != points.len() {
            return Err(wrong("two readings of one direction in a triangulation"));
        }
        let triangles: Vec<[u32; 3]> = delaunay
            .inner_faces()
            .map(|f| f.vertices().map(|v| v.index() as u32))
            .filter(|&t| area(&points, t) > 1e-12)
            .collect();
        let hull = if triangles.is_empty() {
            chain(&points)
        } else {
            delaunay.convex_hull().map(|e| [e.from().index() as u32, e.to().index() as u32]).collect()
        };
        let (min, max) =
            points.iter().fold((points[0], points[0]), |(low, high), p| (low.min(*p), high.max(*p)));
        // About one cell per point, and no cell without extent.
        let extent = (max - min).max(DVec2::splat(1e-6));
        let cells_per_unit =
            (points.len() as f64 / (extent.x * extent.y)).sqrt().min(1000.0 / extent.max_element());
        let cells = [extent.x, extent.y].map(|e| (e * cells_per_unit) as usize + 1);
        let mut mesh = Self {
            points,
            triangles,
            hull,
            min,
            cells_per_unit,
            cells,
            starts: Vec::new(),
            bucket: Vec::new(),
        };
        mesh.fill_buckets();
        Ok(mesh)
    }

    fn cell(&self, p: DVec2) -> [usize; 2] {
        let c = ((p - self.min) * self.cells_per_unit).to_array();
        // Places outside go to the border.
        [0, 1].map(|k| (c[k].max(0.0) as usize).min(self.cells[k] - 1))
    }

    fn fill_buckets(&mut self) {
        let of_triangle = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| self.points[i as usize]);
            let ([x0, y0], [x1, y1]) = (self.cell(a.min(b).min(c)), self.cell(a.max(b).max(c)));
            let width = self.cells[0];
            (y0..=y1).flat_map(move |y| (x0..=x1).map(move |x| y * width + x))
        };
        let mut starts = vec![0u32; self.cells[0] * self.cells[1] + 1];
        self.triangles.iter().flat_map(of_triangle).for_each(|c| starts[c + 1] += 1);
        for c in 1..starts.len() {
            starts[c] += starts[c - 1];
        }
        let mut next = starts.clone();
        let mut bucket = vec![0; starts[starts.len() - 1] as usize];
        for (i, t) in self.triangles.iter().enumerate() {
            for c in of_triangle(t) {
                bucket[next[c] as usize] = i as u32;
                next[c] += 1;
            }
        }
        (self.starts, self.bucket) = (starts, bucket);
    }

    /// Weights of the corners around `p`.
    pub(super) fn weights(&self, p: DVec2) -> Weights {
        let [x, y] = self.cell(p);
        let c = y * self.cells[0] + x;
        for &t in &self.bucket[self.starts[c] as usize..self.starts[c + 1] as usize] {
            let t = self.triangles[t as usize];
            let w = barycentric(t.map(|i| self.points[i as usize]), p);
            // Rounding: a point on an edge belongs to both of its triangles.
            if w.iter().all(|w| *w >= -1e-9) {
                return Weights { corners: [(t[0], w[0]), (t[1], w[1]), (t[2], w[2])], inside: true };
            }
        }
        let mut best = (f64::INFINITY, [0, 0], 0.0);
        for &[a, b] in &self.hull {
            let (from, to) = (self.points[a as usize], self.points[b as usize]);
            let along = to - from;
            let s = ((p - from).dot(along) / along.length_squared().max(1e-30)).clamp(0.0, 1.0);
            let d = (from + s * along).distance_squared(p);
            if d < best.0 {
                best = (d, [a, b], s);
            }
        }
        let (d, [a, b], s) = best;
        Weights { corners: [(a, 1.0 - s), (b, s), (a, 0.0)], inside: d < 1e-12 }
    }
}

/// Twice the area.
fn area(points: &[DVec2], t: [u32; 3]) -> f64 {
    let [a, b, c] = t.map(|i| points[i as usize]);
    (b - a).perp_dot(c - a).abs()
}

fn barycentric([a, b, c]: [DVec2; 3], p: DVec2) -> [f64; 3] {
    let whole = (b - a).perp_dot(c - a);
    let (u, v) = ((c - b).perp_dot(p - b) / whole, (a - c).perp_dot(p - c) / whole);
    [u, v, 1.0 - u - v]
}

/// Points on one line in their order along it, as segments; one point is a segment without length.
fn chain(points: &[DVec2]) -> Vec<[u32; 2]> {
    let far = points.iter().map(|p| *p - points[0]).max_by(|a, b| a.length().total_cmp(&b.length()));
    let along = far.unwrap_or(DVec2::X);
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    order.sort_by(|a, b| points[*a as usize].dot(along).total_cmp(&points[*b as usize].dot(along)));
    if order.len() == 1 { vec![[0, 0]] } else { order.windows(2).map(|w| [w[0], w[1]]).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::hash_to_unit;

    fn random(i: u32) -> DVec2 {
        DVec2::new(hash_to_unit(2 * i), hash_to_unit(2 * i + 1))
    }

    fn place(mesh: &Mesh, w: &Weights) -> DVec2 {
        w.corners.iter().map(|(i, w)| *w * mesh.points[*i as usize]).sum()
    }

    #[test]
    fn weights_are_those_of_the_place() {
        for n in [3, 10, 1000, 20_000] {
            let mesh = Mesh::new((0..n).map(random).collect()).unwrap();
            let mut inside = 0;
            for k in 0..2000 {
                let p = random(900_000 + k);
                let w = mesh.weights(p);
                assert!((w.corners.iter().map(|c| c.1).sum::<f64>() - 1.0).abs() < 1e-9);
                assert!(w.corners.iter().all(|c| c.1 >= -1e-9));
                if w.inside {
                    inside += 1;
                    assert!(place(&mesh, &w).distance(p) < 1e-9);
                }
            }
            assert!(n < 1000 || inside > 1950, "{n}: {inside}");
        }
    }

    #[test]
    fn outside_is_the_nearest_point_of_the_hull() {
        let mesh = Mesh::new((0..500).map(random).collect()).unwrap();
        for k in 0..200 {
            let p = 3.0 * random(5000 + k) - DVec2::ONE;
            let w = mesh.weights(p);
            if !w.inside {
                let foot = place(&mesh, &w);
                let d = foot.distance(p);
                // No point of the mesh is nearer, nor one on the way to any of them.
                let steps = (0..=20).map(|s| f64::from(s) / 20.0);
                let nearest =
                    steps.flat_map(|s| mesh.points.iter().map(move |q| foot.lerp(*q, s).distance(p)));
                assert!(nearest.fold(f64::INFINITY, f64::min) >= d - 1e-9, "{p}");
            }
        }
    }

    #[test]
    fn lines_and_single_points() {
        let line: Vec<DVec2> = [3.0, 0.0, 1.0].iter().map(|x| DVec2::new(*x, 2.0 * x)).collect();
        let mesh = Mesh::new(line).unwrap();
        let w = mesh.weights(DVec2::new(2.0, 4.0));
        assert!(w.inside && place(&mesh, &w).distance(DVec2::new(2.0, 4.0)) < 1e-12);
        let w = mesh.weights(DVec2::new(-5.0, 0.0));
        assert!(!w.inside && place(&mesh, &w).length() < 1e-12);
        let one = Mesh::new(vec![DVec2::ONE]).unwrap();
        assert_eq!(place(&one, &one.weights(DVec2::ZERO)), DVec2::ONE);
        assert!(Mesh::new(Vec::new()).is_err());
        assert!(Mesh::new(vec![DVec2::ONE, DVec2::ONE]).is_err());
        assert!(Mesh::new(vec![DVec2::NAN]).is_err());
    }
}

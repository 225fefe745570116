//! Cell centres on a triangular grid and the division of the plane among them.
//!
//! Model: centre c_ij = (p (i + (j mod 2)/2), p j sqrt(3)/2) + displacement; a cell is the set of points
//! nearer to its centre than to any other (Voronoi). The plane is paved with a rectangular tile of n x m
//! cells, n p by m p sqrt(3)/2; the regular lattice needs 1 x 2. Symbols: p = `pitch_um` (23); displacement =
//! Gaussian per axis, standard deviation `center_disorder` pitches (0), cut off at 2.7 standard deviations,
//! so at most 0.41 pitches: centres never meet and every cell stays a proper convex polygon.
//!
//! Source: the thesis (triangular grid, 23 um, Voronoi division). Our reading: the disorder. Guarded by
//! `hexagons`, `cells_pave_the_tile`, `nearest_site_owns_the_point`, `neighbours_are_mutual`.

use glam::{DVec2, IVec2};
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation};

use super::description::CellDescription;
use crate::math::sampler::{hash, hash_to_unit};
use crate::{Error, Result};

/// One side of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoronoiEdge {
    /// The cell beyond.
    pub neighbor: u32,
    /// Which copy of the tile that cell is in, counted from this cell's.
    pub tile: IVec2,
    /// From this cell's centre to that one's, um; the edge bisects it at right angles.
    pub delta_um: DVec2,
}

/// One cell's share of the plane.
#[derive(Clone, Debug, PartialEq)]
pub struct VoronoiCell {
    /// Centre, um.
    pub site_um: DVec2,
    /// Corners relative to the centre, counter-clockwise, um.
    pub corners_um: Vec<DVec2>,
    /// Sides; side k runs from corner k to corner k + 1.
    pub edges: Vec<VoronoiEdge>,
    /// Area, um^2.
    pub area_um2: f64,
    /// Distance from the centre to the nearest side, um.
    pub inner_radius_um: f64,
    /// Distance from the centre to the farthest corner, um.
    pub corner_radius_um: f64,
}

/// One periodic tile of cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Lattice {
    /// The tile repeats after this much along x and y, um.
    pub tile_um: DVec2,
    /// Columns and rows of the tile.
    pub shape: [u32; 2],
    /// Cells, row by row.
    pub cells: Vec<VoronoiCell>,
}

/// A copy of a centre, as the triangulation sees it.
struct Site {
    position: DVec2,
    cell: u32,
    tile: IVec2,
}

impl HasPosition for Site {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        Point2::new(self.position.x, self.position.y)
    }
}

impl Lattice {
    /// Places the cells and divides the plane.
    pub fn new(cells: &CellDescription) -> Result<Self> {
        let [n, m] = if cells.is_regular() { [1, 2] } else { [cells.tile_cells; 2] };
        let pitch = cells.pitch_um;
        let row = pitch * 0.75f64.sqrt();
        let tile_um = DVec2::new(f64::from(n) * pitch, f64::from(m) * row);
        let sites: Vec<DVec2> = (0..m)
            .flat_map(|j| (0..n).map(move |i| (i, j)))
            .map(|(i, j)| {
                let nominal = DVec2::new(pitch * (f64::from(i) + 0.5 * f64::from(j % 2)), row * f64::from(j));
                let shift = disorder(cells.seed, j * n + i, Channel::Center);
                nominal + shift * (cells.center_disorder * pitch)
            })
            .collect();

        let triangulation = triangulate(&sites, tile_um, pitch)?;
        let mut divided: Vec<Option<VoronoiCell>> = vec![None; sites.len()];
        for vertex in triangulation.vertices().filter(|v| v.data().tile == IVec2::ZERO) {
            let cell = vertex.data().cell as usize;
            let edges = vertex
                .out_edges()
                .map(|edge| {
                    let to = edge.to();
                    let Site { cell: neighbor, tile, .. } = *to.data();
                    // From the two centres of the tile itself, so that both cells see the same vector.
                    let delta_um = sites[neighbor as usize] - sites[cell] + tile.as_dvec2() * tile_um;
                    VoronoiEdge { neighbor, tile, delta_um }
                })
                .collect();
            divided[cell] = Some(VoronoiCell::new(sites[cell], edges));
        }
        let divided: Option<Vec<_>> = divided.into_iter().collect();
        let divided = divided.ok_or_else(|| Error::invalid("cells", "two cell centres coincide"))?;
        Ok(Self { tile_um, shape: [n, m], cells: divided })
    }
}

impl VoronoiCell {
    fn new(site_um: DVec2, mut edges: Vec<VoronoiEdge>) -> Self {
        let angle = |e: &VoronoiEdge| e.delta_um.to_angle();
        edges.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
        let n = edges.len();
        // A corner is the centre of the circle through this site and two consecutive neighbours.
        let corners_um: Vec<DVec2> = (0..n)
            .map(|k| {
                let (a, b) = (edges[(k + n - 1) % n].delta_um, edges[k].delta_um);
                let (aa, bb) = (a.length_squared(), b.length_squared());
                DVec2::new(b.y * aa - a.y * bb, a.x * bb - b.x * aa) / (2.0 * a.perp_dot(b))
            })
            .collect();
        let area_um2 = (0..n).map(|k| 0.5 * corners_um[k].perp_dot(corners_um[(k + 1) % n])).sum();
        Self {
            site_um,
            area_um2,
            inner_radius_um: edges.iter().map(|e| 0.5 * e.delta_um.length()).fold(f64::INFINITY, f64::min),
            corner_radius_um: corners_um.iter().map(|c| c.length()).fold(0.0, f64::max),
            corners_um,
            edges,
        }
    }
}

/// Delaunay triangulation of the tile's centres and of their copies up to three pitches around it: no empty
/// circle that touches a cell of the tile reaches farther than 1.8 pitches.
fn triangulate(sites: &[DVec2], tile_um: DVec2, pitch_um: f64) -> Result<DelaunayTriangulation<Site>> {
    let margin = 3.0 * pitch_um;
    let copies = (margin / tile_um).ceil().as_ivec2() + IVec2::ONE;
    let mut all = Vec::new();
    for ty in -copies.y..=copies.y {
        for tx in -copies.x..=copies.x {
            let tile = IVec2::new(tx, ty);
            for (cell, &site) in sites.iter().enumerate() {
                let position = site + tile.as_dvec2() * tile_um;
                let near = position.cmpge(DVec2::splat(-margin)) & position.cmple(tile_um + margin);
                if near.all() {
                    all.push(Site { position, cell: cell as u32, tile });
                }
            }
        }
    }
    DelaunayTriangulation::bulk_load(all)
        .map_err(|e| Error::invalid("cells", format!("the cell centres cannot be divided: {e}")))
}

/// What a random number of a cell is for.
#[derive(Clone, Copy)]
pub(crate) enum Channel {
    /// Displacement of the centre.
    Center = 0,
    /// Height; x only.
    Height = 1,
    /// Tilt of the axis.
    Tilt = 2,
}

/// A random vector of a cell: Gaussian with standard deviation 1 per axis, cut off at length 2.7.
///
/// The length of a Gaussian cut off at k = 2.5 has a closed inverse; the cut leaves the variance
/// 1 - (k^2/2) e^(-k^2/2) / (1 - e^(-k^2/2)), which the scale undoes. Guarded by `disorder_has_its_moments`.
pub(crate) fn disorder(seed: u64, cell: u32, channel: Channel) -> DVec2 {
    const HALF_CUT_SQUARED: f64 = 0.5 * 2.5 * 2.5;
    let tail = (-HALF_CUT_SQUARED).exp();
    let scale = (1.0 - HALF_CUT_SQUARED * tail / (1.0 - tail)).sqrt().recip();
    let key =
        hash(hash(hash(seed as u32 ^ 0x6c62_272e) ^ (seed >> 32) as u32) ^ cell).wrapping_add(channel as u32);
    let length = (-2.0 * (1.0 - hash_to_unit(key) * (1.0 - tail)).ln()).sqrt();
    let angle = std::f64::consts::TAU * hash_to_unit(hash(key) ^ 0x9e37_79b9);
    DVec2::from_angle(angle) * (length * scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disordered(center_disorder: f64, seed: u64) -> Lattice {
        let cells = CellDescription { center_disorder, seed, tile_cells: 12, ..Default::default() };
        Lattice::new(&cells).expect("valid")
    }

    #[test]
    fn hexagons() {
        let lattice = Lattice::new(&CellDescription::default()).expect("valid");
        assert_eq!(lattice.cells.len(), 2);
        for cell in &lattice.cells {
            assert_eq!(cell.edges.len(), 6);
            assert!((cell.area_um2 - 0.75f64.sqrt() * 23.0 * 23.0).abs() < 1e-9);
            assert!((cell.inner_radius_um - 11.5).abs() < 1e-12);
            assert!((cell.corner_radius_um - 23.0 / 3f64.sqrt()).abs() < 1e-12);
        }
    }

    #[test]
    fn cells_pave_the_tile() {
        for (disorder, seed) in [(0.02, 1), (0.08, 2), (0.15, 3), (0.15, 4)] {
            let lattice = disordered(disorder, seed);
            let sum: f64 = lattice.cells.iter().map(|c| c.area_um2).sum();
            assert!((sum / lattice.tile_um.element_product() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn nearest_site_owns_the_point() {
        let lattice = disordered(0.15, 5);
        let copies: Vec<(usize, DVec2)> = (-1..=1)
            .flat_map(|y| (-1..=1).map(move |x| IVec2::new(x, y).as_dvec2()))
            .flat_map(|t| {
                lattice.cells.iter().enumerate().map(move |(i, c)| (i, c.site_um + t * lattice.tile_um))
            })
            .collect();
        for k in 0..4000u32 {
            let p = DVec2::new(hash_to_unit(2 * k), hash_to_unit(2 * k + 1)) * lattice.tile_um;
            let nearest = copies
                .iter()
                .min_by(|a, b| p.distance_squared(a.1).total_cmp(&p.distance_squared(b.1)))
                .expect("sites");
            let q = p - nearest.1;
            let cell = &lattice.cells[nearest.0];
            // Inside every side, by neighbours and by corners.
            for (i, e) in cell.edges.iter().enumerate() {
                assert!(q.dot(e.delta_um) <= 0.5 * e.delta_um.length_squared() + 1e-9);
                let (a, b) = (cell.corners_um[i], cell.corners_um[(i + 1) % cell.edges.len()]);
                assert!((b - a).perp_dot(q - a) >= -1e-9);
            }
        }
    }

    #[test]
    fn neighbours_are_mutual() {
        for lattice in [
            Lattice::new(&CellDescription::default()).expect("valid"),
            disordered(0.1, 6),
            disordered(0.15, 7),
        ] {
            for (i, cell) in lattice.cells.iter().enumerate() {
                for e in &cell.edges {
                    let back = lattice.cells[e.neighbor as usize]
                        .edges
                        .iter()
                        .find(|b| b.neighbor as usize == i && b.tile == -e.tile)
                        .expect("the neighbour knows this cell");
                    assert!((back.delta_um + e.delta_um).length() < 1e-11);
                }
            }
        }
    }

    #[test]
    fn disorder_has_its_moments() {
        let n = 40_000;
        for channel in [Channel::Center, Channel::Height, Channel::Tilt] {
            let (mut mean, mut square) = (DVec2::ZERO, DVec2::ZERO);
            for i in 0..n {
                let v = disorder(9, i, channel);
                assert!(v.length() < 2.71);
                mean += v;
                square += v * v;
            }
            // Standard errors: 0.005 of a mean, below 0.007 of a variance.
            assert!((mean / f64::from(n)).abs().max_element() < 0.02);
            assert!((square / f64::from(n) - 1.0).abs().max_element() < 0.03);
        }
        assert_ne!(disorder(9, 0, Channel::Center), disorder(10, 0, Channel::Center));
        assert_ne!(disorder(9, 0, Channel::Center), disorder(9 << 32, 0, Channel::Center));
    }
}

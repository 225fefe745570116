//! The cell over which a point of the plane lies.
//!
//! Model: a grid of two bins per pitch names a cell near the point; from there the walk crosses the side that
//! the point violates most until it violates none, which is the Voronoi cell. Guarded by `the_field_repeats`.

use glam::DVec2;

use super::{CellField, MAX_CELLS, Place};

/// Bin of the locator: the cell that owns the bin's middle, and in which copy of the tile.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bin {
    cell: u32,
    tile: [i8; 2],
}

impl CellField {
    /// The cell that owns a point: the bin's cell, then downhill to the nearest centre.
    pub(super) fn locate(&self, xy: DVec2) -> Place {
        let tile_um = self.lattice.tile_um;
        let tile = (xy / tile_um).floor();
        let fraction = xy / tile_um - tile;
        let [nx, ny] = self.bins_shape;
        let ix = ((fraction.x * nx as f64) as usize).min(nx - 1);
        let iy = ((fraction.y * ny as f64) as usize).min(ny - 1);
        let bin = self.bins[iy * nx + ix];
        let base = (tile + DVec2::new(f64::from(bin.tile[0]), f64::from(bin.tile[1]))) * tile_um;
        self.descend(Place { cell: bin.cell, site: base + self.cells[bin.cell as usize].site }, xy)
    }

    /// Moves across the side that the point violates most until it violates none; each move is nearer.
    fn descend(&self, mut place: Place, xy: DVec2) -> Place {
        for _ in 0..MAX_CELLS {
            let q = xy - place.site;
            let mut worst = 1e-12;
            let mut next = None;
            for edge in self.edges_of(&self.cells[place.cell as usize]) {
                let beyond = q.dot(edge.delta) - edge.half;
                if beyond > worst * edge.half {
                    (worst, next) = (beyond / edge.half, Some(edge));
                }
            }
            let Some(edge) = next else { break };
            place = Place { cell: edge.neighbor, site: place.site + edge.delta };
        }
        place
    }

    /// Two bins per pitch along each axis.
    pub(super) fn fill_bins(&mut self) {
        let tile_um = self.lattice.tile_um;
        let counts = (tile_um / self.description.pitch_um * 2.0).ceil();
        let [nx, ny] = [counts.x as usize, counts.y as usize];
        let mut place = Place { cell: 0, site: self.cells[0].site };
        let mut bins = Vec::with_capacity(nx * ny);
        for iy in 0..ny {
            for ix in 0..nx {
                let middle = DVec2::new(ix as f64 + 0.5, iy as f64 + 0.5) / counts;
                place = self.descend(place, middle * tile_um);
                let tile = ((place.site - self.cells[place.cell as usize].site) / tile_um).round();
                bins.push(Bin { cell: place.cell, tile: [tile.x as i8, tile.y as i8] });
            }
        }
        self.bins = bins;
        self.bins_shape = [nx, ny];
    }
}

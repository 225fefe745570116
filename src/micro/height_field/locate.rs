//! The cell over which a point of the plane lies.
//!
//! Model: a grid of two bins per pitch names a cell near the point; from there the walk crosses the side that
//! the point violates most until it violates none, which is the Voronoi cell. Guarded by `the_field_repeats`; points
//! drawn in a cell's hexagon by `points_fill_the_hexagon`.

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

    /// Of the points that lie in a regular lattice's cells as the fraction `u` of its unit cell does, the one nearest to
    /// `middle`: for `u` uniform in the unit square, uniform in the hexagon of one cell around it. The tile holds whole
    /// unit cells, so that disordered cells repeat with them.
    pub(crate) fn like_near(&self, u: DVec2, middle: DVec2) -> DVec2 {
        let pitch = self.description.pitch_um;
        let (a, b) = (DVec2::new(pitch, 0.0), DVec2::new(0.5, 0.75f64.sqrt()) * pitch);
        let start = a * u.x + b * u.y;
        let gap = middle - start;
        // Whole steps to the corner of the rhombus that the middle lies in; the nearest point is one of its corners.
        let steps_b = (gap.y / b.y).floor();
        let steps_a = ((gap.x - steps_b * b.x) / a.x).floor();
        let corner = start + a * steps_a + b * steps_b;
        let nearer = |p: DVec2, q: DVec2| {
            if q.distance_squared(middle) < p.distance_squared(middle) { q } else { p }
        };
        [a, b, a + b].into_iter().fold(corner, |p, step| nearer(p, corner + step))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::hash_to_unit;
    use crate::micro::CellDescription;

    #[test]
    fn points_fill_the_hexagon() {
        let field = CellField::new(&CellDescription::default()).expect("valid");
        let [mut inside, mut moment] = [0.0; 2];
        for k in 0..4000u32 {
            let random = |i| hash_to_unit(6 * k + i);
            let u = DVec2::new(random(0), random(1));
            let middle = DVec2::new(random(2) - 0.5, random(3) - 0.5) * 1e4;
            let p = field.like_near(u, middle);
            // No neighbour of the lattice is nearer, and the place in a cell is that of the fraction.
            for j in 0..6 {
                let step = DVec2::from_angle(f64::from(j) * std::f64::consts::FRAC_PI_3) * 23.0;
                assert!(p.distance(middle) <= (p + step).distance(middle) + 1e-9);
            }
            let same = DVec2::new(23.0 * (u.x + 0.5 * u.y), 23.0 * 0.75f64.sqrt() * u.y);
            let offset = |at: DVec2| at - field.cell_at(at).1;
            assert!(offset(p).distance(offset(same)) < 1e-8 || offset(p).length() > 11.4);
            inside += f64::from(u8::from(p.distance(middle) < 11.5)) / 4000.0;
            moment += p.distance_squared(middle) / 4000.0;
        }
        // The inscribed disc has pi / (2 sqrt 3) of the hexagon; the mean square of its radius is 5 / 36 pitch^2.
        assert!((inside - 0.9069).abs() < 0.02, "{inside}");
        assert!((moment / (23.0 * 23.0 * 5.0 / 36.0) - 1.0).abs() < 0.04, "{moment}");
    }
}

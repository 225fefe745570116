//! The field of domes and the exact first hit of a ray with it.
//!
//! Model: the solid is the half-space z < 0 and, over each Voronoi cell with centre c,
//! { z < h(|p_xy - z s - c|) }, where s is the cell's tilt as a shear (tangent of the tilt angle, towards the
//! side the axis leans to). Cell walls are upright, so a dome that leans over its cell's side is cut there,
//! and neighbours of different height at their common side are joined by a vertical wall.
//!
//! Symbols: h, H, R = the cell's [`Dome`]; H = `height_um` (1 + `height_disorder` times a Gaussian); s from
//! `tilt_disorder_deg`; c and the polygon from [`Lattice`]. Lengths in um, directions are unit vectors.
//!
//! Method: a ray walks from cell to cell across the sides. In the cell's sheared frame it is a straight line,
//! u(t) = r^2/R^2 is a parabola, and the gap g(t) = z(t) - h(r(t)) has g'' >= -K, where K is zero for a
//! concave dome. So from any point with g > 0 no hit is nearer than the root of
//! g + g' x - K x^2/2: stepping from root to root never passes the first hit, and near it the steps become
//! Newton's. The first step starts where the ray enters a paraboloid that encloses the dome. No step length is
//! chosen, nothing is missed.
//!
//! Limits: g is solved to 1e-11 um (`agrees_with_brute_force`, `hits_lie_on_the_surface`). A ray that stays
//! among the domes for [`MAX_CELLS`] cells, as only one nearly parallel to the base can, is said to miss
//! (`horizontal_rays_end`). An origin inside the solid is a hit at t = 0. Our reading: shear, walls, disorder.

use glam::{DVec2, DVec3};

use super::description::CellDescription;
use super::dome::{Dome, Profile};
use super::lattice::{Channel, Lattice, disorder};
use crate::Result;

mod facing;
mod inside;
mod locate;

pub(crate) use inside::{Bound, Within};

/// A ray that crosses this many cells without a hit has none. With the thesis' pitch that is 9 cm.
pub const MAX_CELLS: usize = 4096;

/// The gap below which a ray touches, um.
const TOUCH_UM: f64 = 1e-11;
/// A ray that enters a cell deeper than this under its dome has hit the cell's wall, um.
const WALL_UM: f64 = 1e-9;
/// A ray may start this deep under the surface it leaves, um.
const START_UM: f64 = 1e-6;

/// What a ray hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HitKind {
    /// The curved surface of a cell.
    Dome,
    /// The plane z = 0 between domes.
    Base,
    /// The vertical step to a higher neighbour.
    Wall,
}

/// The first point of the solid on a ray.
#[derive(Clone, Copy, Debug)]
pub struct CellHit {
    /// Distance along the ray, um.
    pub t_um: f64,
    /// Point, um.
    pub p: DVec3,
    /// Unit normal out of the solid.
    pub normal: DVec3,
    /// The cell that the surface belongs to.
    pub cell: u32,
    /// Centre of that copy of the cell, um.
    pub site_um: DVec2,
    /// Which surface.
    pub kind: HitKind,
    /// The cell over which the ray arrived; another than `cell` for a wall.
    air: Place,
}

/// A copy of a cell in the plane.
#[derive(Clone, Copy, Debug)]
struct Place {
    cell: u32,
    site: DVec2,
}

/// One cell, as the ray search reads it: one cache line.
#[derive(Clone, Copy, Debug)]
struct Cell {
    site: DVec2,
    tilt: DVec2,
    height: f64,
    inv_radius_squared: f64,
    /// K over the squared length of the ray's direction in the sheared plane.
    curvature: f64,
    first_edge: u32,
    edges: u32,
}

/// One side of a cell: { q . delta = half }, q relative to the centre.
#[derive(Clone, Copy, Debug)]
struct Edge {
    delta: DVec2,
    half: f64,
    neighbor: u32,
}

/// The domes of one petal surface, ready for rays.
#[derive(Clone, Debug)]
pub struct CellField {
    description: CellDescription,
    lattice: Lattice,
    profile: Profile,
    /// Height of the enclosing paraboloid over the dome's.
    top: f64,
    cells: Vec<Cell>,
    edges: Vec<Edge>,
    bins: Vec<locate::Bin>,
    bins_shape: [usize; 2],
    max_height: f64,
}

/// What the search found, before the normal is worked out.
struct Found {
    t: f64,
    kind: HitKind,
    solid: Place,
    air: Place,
}

/// A ray within one cell.
enum InCell {
    Miss,
    Hit(f64),
    /// It enters the cell under the dome.
    Under,
}

impl CellField {
    /// Builds the field; refuses a description whose values are out of range.
    pub fn new(description: &CellDescription) -> Result<Self> {
        description.validate("cells")?;
        let lattice = Lattice::new(description)?;
        let profile = description.profile;
        let mut cells = Vec::with_capacity(lattice.cells.len());
        let mut edges = Vec::new();
        for (i, cell) in lattice.cells.iter().enumerate() {
            let random = |channel| disorder(description.seed, i as u32, channel);
            let factor = 1.0 + description.height_disorder * random(Channel::Height).x;
            let height = description.height_um * factor;
            let lean = random(Channel::Tilt) * description.tilt_disorder_deg.to_radians();
            let radius = profile.base_radius_um(cell.inner_radius_um, cell.corner_radius_um);
            cells.push(Cell {
                site: cell.site_um,
                tilt: lean.normalize_or_zero() * lean.length().tan(),
                height: if profile == Profile::Flat { 0.0 } else { height },
                inv_radius_squared: 1.0 / (radius * radius),
                curvature: profile.curvature_bound() * height / (radius * radius),
                first_edge: edges.len() as u32,
                edges: cell.edges.len() as u32,
            });
            edges.extend(cell.edges.iter().map(|e| Edge {
                delta: e.delta_um,
                half: 0.5 * e.delta_um.length_squared(),
                neighbor: e.neighbor,
            }));
        }
        let max_height = cells.iter().map(|c| c.height).fold(0.0, f64::max);
        let mut field = Self {
            description: description.clone(),
            lattice,
            profile,
            top: profile.enclosure(),
            cells,
            edges,
            bins: Vec::new(),
            bins_shape: [0; 2],
            max_height,
        };
        field.fill_bins();
        Ok(field)
    }

    /// What it was built from.
    pub fn description(&self) -> &CellDescription {
        &self.description
    }

    /// Centres and polygons of the cells.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// The field repeats after this much along x and y, um.
    pub fn tile_um(&self) -> DVec2 {
        self.lattice.tile_um
    }

    /// Height of the tallest dome, um.
    pub fn max_height_um(&self) -> f64 {
        self.max_height
    }

    /// Cells in a tile.
    pub fn cell_count(&self) -> usize {
        self.cells.len()
    }

    /// Area of a cell's polygon, um^2.
    pub fn cell_area_um2(&self, cell: u32) -> f64 {
        self.lattice.cells[cell as usize].area_um2
    }

    /// Dome of a cell.
    pub fn dome(&self, cell: u32) -> Dome {
        let polygon = &self.lattice.cells[cell as usize];
        Dome {
            profile: self.profile,
            height_um: self.cells[cell as usize].height,
            radius_um: self.profile.base_radius_um(polygon.inner_radius_um, polygon.corner_radius_um),
        }
    }

    /// How far the axis of a cell moves along x and y per um of height.
    pub fn tilt(&self, cell: u32) -> DVec2 {
        self.cells[cell as usize].tilt
    }

    /// The cell that owns a point of the plane, and the centre of that copy of it, um.
    pub fn cell_at(&self, xy_um: DVec2) -> (u32, DVec2) {
        let place = self.locate(xy_um);
        (place.cell, place.site)
    }

    /// Height of the surface over a point of the plane, seen from above, um.
    pub fn height_at_um(&self, xy_um: DVec2) -> f64 {
        let place = self.locate(xy_um);
        self.height_in_cell_um(place.cell, xy_um - place.site)
    }

    /// Height of one cell's dome, seen from above, at an offset from its centre, inside its polygon or not.
    pub fn height_in_cell_um(&self, cell: u32, offset_um: DVec2) -> f64 {
        let cell = &self.cells[cell as usize];
        let top = self.max_height;
        match self.cross_dome(cell, offset_um.extend(top), DVec3::NEG_Z, top, START_UM) {
            InCell::Hit(t) => (top - t).max(0.0),
            InCell::Miss | InCell::Under => 0.0,
        }
    }

    /// Outward normal of a cell's dome at an offset from the centre and a height on its surface.
    pub fn normal_in_cell(&self, cell: u32, offset_um: DVec2, z_um: f64) -> DVec3 {
        let cell = &self.cells[cell as usize];
        let q = offset_um - cell.tilt * z_um;
        let u = q.length_squared() * cell.inv_radius_squared;
        if u >= 1.0 + 1e-9 {
            return DVec3::Z;
        }
        // Gradient of z - h(|p_xy - z s|).
        let slope = q * (2.0 * cell.height * cell.inv_radius_squared * self.profile.at_square(u.min(1.0)).1);
        (-slope).extend(1.0 + slope.dot(cell.tilt)).normalize()
    }

    /// First hit of a ray that starts outside of the solid or on its surface. A ray that starts within 1e-6 um
    /// of a dome and moves away from it does not hit that dome at its start. For a ray that leaves a known hit
    /// use [`CellField::first_hit_from`], which is exact on walls too.
    pub fn first_hit(&self, origin: DVec3, direction: DVec3) -> Option<CellHit> {
        let (start, t0) = self.enter(origin, direction)?;
        let found = self.search(self.locate(start.truncate()), start, direction)?;
        Some(self.describe(found, start, direction, t0))
    }

    /// First hit of a ray that leaves the surface at `from`; a direction into the solid hits at t = 0.
    pub fn first_hit_from(&self, from: &CellHit, direction: DVec3) -> Option<CellHit> {
        if let Some(blocked) = Self::blocked_at_start(from, direction) {
            return Some(blocked);
        }
        let found = self.search(from.air, from.p, direction)?;
        Some(self.describe(found, from.p, direction, 0.0))
    }

    /// Is anything of the solid on the ray? Same rules as [`CellField::first_hit`].
    pub fn occluded(&self, origin: DVec3, direction: DVec3) -> bool {
        self.enter(origin, direction)
            .is_some_and(|(start, _)| self.search(self.locate(start.truncate()), start, direction).is_some())
    }

    /// Is anything of the solid on the ray that leaves the surface at `from`?
    pub fn occluded_from(&self, from: &CellHit, direction: DVec3) -> bool {
        Self::blocked_at_start(from, direction).is_some()
            || self.search(from.air, from.p, direction).is_some()
    }

    /// The point where a ray comes below the tallest dome, and its distance; `None` where it never does.
    fn enter(&self, origin: DVec3, direction: DVec3) -> Option<(DVec3, f64)> {
        let misses = origin.z > self.max_height && direction.z >= 0.0;
        if misses || !(origin + direction).is_finite() {
            return None;
        }
        if origin.z <= self.max_height {
            return Some((origin, 0.0));
        }
        let t = (self.max_height - origin.z) / direction.z;
        let p = origin + direction * t;
        p.is_finite().then_some((p.truncate().extend(self.max_height), t))
    }

    fn blocked_at_start(from: &CellHit, direction: DVec3) -> Option<CellHit> {
        (direction.dot(from.normal) <= 0.0).then_some(CellHit { t_um: 0.0, ..*from })
    }

    /// Walks the cells from `place`, which owns `origin`.
    fn search(&self, mut place: Place, origin: DVec3, direction: DVec3) -> Option<Found> {
        let found = |t, kind, solid, air| Some(Found { t, kind, solid, air });
        let d = direction.truncate();
        let mut air = place;
        let mut t_in = 0.0;
        let t_base = if direction.z < 0.0 { (-origin.z / direction.z).max(0.0) } else { f64::INFINITY };
        let rise = self.max_height - origin.z;
        let t_top = if direction.z > 0.0 { rise / direction.z } else { f64::INFINITY };
        if origin.z < -START_UM {
            return found(0.0, HitKind::Base, place, place);
        }
        let mut depth = START_UM;
        for _ in 0..MAX_CELLS {
            let cell = &self.cells[place.cell as usize];
            // From the point of entry, so that a long way here does not cost digits.
            let entry = origin + direction * t_in;
            let q = entry.truncate() - place.site;
            let (mut stay, mut exit) = (f64::INFINITY, usize::MAX);
            let edges = self.edges_of(cell);
            for (k, edge) in edges.iter().enumerate() {
                let toward = d.dot(edge.delta);
                if toward > 0.0 {
                    let t = (edge.half - q.dot(edge.delta)) / toward;
                    if t < stay {
                        (stay, exit) = (t, k);
                    }
                }
            }
            let t_out = t_in + stay.max(0.0);
            match self.cross_dome(cell, q.extend(entry.z), direction, t_out.min(t_base) - t_in, depth) {
                InCell::Miss => {}
                InCell::Hit(t) => return found(t_in + t, HitKind::Dome, place, place),
                InCell::Under => {
                    // The start itself is inside, or the ray came in through the side.
                    let kind = if air.site == place.site { HitKind::Dome } else { HitKind::Wall };
                    return found(t_in, kind, place, air);
                }
            }
            if t_base <= t_out && t_base.is_finite() {
                return found(t_base, HitKind::Base, place, place);
            }
            let edge = edges.get(exit)?;
            if t_out >= t_top {
                return None;
            }
            air = place;
            place = Place { cell: edge.neighbor, site: place.site + edge.delta };
            t_in = t_out;
            depth = WALL_UM;
        }
        None
    }

    /// First hit with one cell's dome for t in [0, t_out]; `origin` is relative to the cell's centre. At its
    /// start the ray may be as much as `depth` under the surface, if it moves out.
    #[inline]
    fn cross_dome(&self, cell: &Cell, origin: DVec3, direction: DVec3, t_out: f64, depth: f64) -> InCell {
        if cell.height <= 0.0 {
            return InCell::Miss;
        }
        // u(t) = a t^2 + 2 b t + c in the sheared frame.
        let inv = cell.inv_radius_squared;
        let q = origin.truncate() - cell.tilt * origin.z;
        let d = direction.truncate() - cell.tilt * direction.z;
        let (a, b, c) = (d.length_squared() * inv, q.dot(d) * inv, q.length_squared() * inv);
        // The part of the ray under the enclosing paraboloid z = top (1 - u), which over z = 0 has u <= 1.
        let (top, z_half) = (self.top * cell.height, 0.5 * direction.z);
        let (pa, pb, pc) = (top * a, top * b + z_half, origin.z - top * (1.0 - c));
        let discriminant = pb * pb - pa * pc;
        if discriminant < 0.0 {
            return InCell::Miss;
        }
        let root = -(pb + discriminant.sqrt().copysign(pb));
        let (one, two) = (root / pa, pc / root);
        let low = one.min(two).max(0.0);
        let high = one.max(two).min(t_out);
        if low > high {
            return InCell::Miss;
        }
        let curvature = cell.curvature * d.length_squared();
        let mut t = low;
        let mut gap = 0.0;
        for step in 0..1000 {
            let u = (a * t + 2.0 * b) * t + c;
            let (h, dh) = self.profile.at_square(u.clamp(0.0, 1.0));
            gap = origin.z + t * direction.z - cell.height * h;
            let slope = direction.z - cell.height * dh * 2.0 * (a * t + b);
            if gap <= TOUCH_UM {
                if step == 0 && gap < -depth {
                    return InCell::Under;
                }
                if slope < 0.0 {
                    return InCell::Hit(t);
                }
                gap = 0.0;
            }
            t += if curvature == 0.0 {
                if slope >= 0.0 {
                    return InCell::Miss;
                }
                gap / -slope
            } else {
                // The positive root, written without cancellation.
                let root = (slope * slope + 2.0 * curvature * gap).sqrt();
                if slope < 0.0 { 2.0 * gap / (root - slope) } else { ((slope + root) / curvature).max(1e-9) }
            };
            if t > high {
                return InCell::Miss;
            }
        }
        // Rounding keeps the gap of a far ray from settling; it stands at the surface.
        if gap < START_UM { InCell::Hit(t) } else { InCell::Miss }
    }

    fn describe(&self, found: Found, origin: DVec3, direction: DVec3, t0: f64) -> CellHit {
        let mut p = origin + direction * found.t;
        p.z = p.z.max(0.0);
        let normal = match found.kind {
            HitKind::Dome => self.normal_in_cell(found.solid.cell, p.truncate() - found.solid.site, p.z),
            HitKind::Base => {
                p.z = 0.0;
                DVec3::Z
            }
            HitKind::Wall => (found.air.site - found.solid.site).normalize_or_zero().extend(0.0),
        };
        CellHit {
            t_um: t0 + found.t,
            p,
            normal,
            cell: found.solid.cell,
            site_um: found.solid.site,
            kind: found.kind,
            air: found.air,
        }
    }

    fn edges_of(&self, cell: &Cell) -> &[Edge] {
        &self.edges[cell.first_edge as usize..(cell.first_edge + cell.edges) as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::hash_to_unit;
    use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

    fn field(profile: Profile, center: f64, height: f64, tilt_deg: f64) -> CellField {
        let description = CellDescription {
            profile,
            center_disorder: center,
            height_disorder: height,
            tilt_disorder_deg: tilt_deg,
            tile_cells: 4,
            seed: 11,
            ..Default::default()
        };
        CellField::new(&description).expect("valid")
    }

    /// Every profile, regular, disordered, and disordered with tilted axes (up to 22 degrees).
    fn fields() -> impl Iterator<Item = CellField> {
        Profile::ALL.into_iter().flat_map(|p| {
            [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.15, 0.3, 0.0), (0.1, 0.15, 8.0)]
                .map(|(c, h, t)| field(p, c, h, t))
        })
    }

    fn direction(cos: f64, phi: f64) -> DVec3 {
        (DVec2::from_angle(phi) * (1.0 - cos * cos).max(0.0).sqrt()).extend(cos)
    }

    fn random(k: &mut u32) -> f64 {
        *k += 1;
        hash_to_unit(*k)
    }

    /// The solid by its definition: the nearest of all centres, then the height equation.
    struct Brute<'a> {
        field: &'a CellField,
        sites: Vec<(u32, DVec2)>,
    }

    impl<'a> Brute<'a> {
        fn new(field: &'a CellField) -> Self {
            let tile = field.tile_um();
            let margin = 40.0;
            let sites = (-4..=4)
                .flat_map(|y| (-4..=4).map(move |x| DVec2::new(f64::from(x), f64::from(y)) * tile))
                .flat_map(|t| {
                    field.lattice().cells.iter().enumerate().map(move |(i, c)| (i as u32, c.site_um + t))
                })
                .filter(|(_, s)| (s.cmpge(DVec2::splat(-margin)) & s.cmple(tile + margin)).all())
                .collect();
            Self { field, sites }
        }

        fn gap_in(&self, cell: u32, site: DVec2, p: DVec3) -> f64 {
            let q = p.truncate() - site - self.field.tilt(cell) * p.z;
            p.z - self.field.dome(cell).height_at_um(q.length())
        }

        fn gap(&self, p: DVec3) -> f64 {
            if p.z < 0.0 {
                return p.z;
            }
            let tile = self.field.tile_um();
            let xy = p.truncate() - (p.truncate() / tile).floor() * tile;
            let nearest = self
                .sites
                .iter()
                .min_by(|a, b| xy.distance_squared(a.1).total_cmp(&xy.distance_squared(b.1)))
                .expect("sites");
            self.gap_in(nearest.0, nearest.1, xy.extend(p.z))
        }

        /// First t in [from, to] that is inside, by steps and bisection.
        fn march(&self, o: DVec3, d: DVec3, from: f64, to: f64, step: f64) -> Option<f64> {
            let inside = |t: f64| self.gap(o + d * t) < 0.0;
            let mut low = from;
            while low < to {
                let z = o.z + low * d.z;
                if d.z >= 0.0 && z > self.field.max_height_um() {
                    return None;
                }
                let mut high = low + step;
                if inside(high) {
                    for _ in 0..60 {
                        let middle = 0.5 * (low + high);
                        if inside(middle) { high = middle } else { low = middle }
                    }
                    return Some(high);
                }
                low = high;
            }
            None
        }
    }

    const REACH: f64 = 200.0;

    /// The hit must be where brute force has one, unless brute force stepped over it.
    fn check(brute: &Brute, o: DVec3, d: DVec3, from: f64, hit: Option<&CellHit>) -> Result<(), String> {
        let slow = brute.march(o, d, from, REACH, 0.05);
        let what = || format!("{:?} {o} {d}: {hit:?}, brute {slow:?}", brute.field.description());
        let fast = hit.map_or(f64::INFINITY, |h| h.t_um);
        let slow = slow.unwrap_or(f64::INFINITY);
        if (fast - slow).abs() < 1e-4 || fast.min(slow) > REACH - 0.1 || fast == slow {
            return Ok(());
        }
        if fast > slow {
            return Err(format!("missed: {}", what()));
        }
        let h = hit.ok_or_else(what)?;
        let closer = brute.march(o, d, fast - 1e-4, fast + 0.05, 1e-5);
        let touches = h.kind == HitKind::Dome && brute.gap_in(h.cell, h.site_um, h.p).abs() < 1e-9;
        if closer.is_some_and(|t| (t - fast).abs() < 1e-4) || touches {
            return Ok(());
        }
        Err(format!("not a hit: {}", what()))
    }

    #[test]
    fn agrees_with_brute_force() {
        for field in fields() {
            let brute = Brute::new(&field);
            let config = Config { cases: 60, failure_persistence: None, ..Config::default() };
            let rng = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
            let mut runner = TestRunner::new_with_rng(config, rng);
            let strategy = (-1.0..2.0, -1.0..2.0, 0.0..1.3, -1.0..1.0, 0.0..std::f64::consts::TAU);
            let outcome = runner.run(&strategy, |(x, y, z, cos, phi)| {
                let o = (DVec2::new(x, y) * field.tile_um()).extend(z * 37.0);
                let d = direction(cos, phi);
                if brute.gap(o) > 1e-3 {
                    let hit = field.first_hit(o, d);
                    check(&brute, o, d, 0.0, hit.as_ref())
                        .map_err(proptest::test_runner::TestCaseError::fail)?;
                    assert_eq!(hit.is_some(), field.occluded(o, d));
                }
                Ok(())
            });
            outcome.expect("agrees");
        }
    }

    #[test]
    fn leaves_the_surface_without_hitting_it_again() {
        let mut k = 0;
        let mut kinds = [0; 3];
        for field in fields() {
            let brute = Brute::new(&field);
            for _ in 0..60 {
                let o = (DVec2::new(random(&mut k), random(&mut k)) * field.tile_um()).extend(60.0);
                let d = direction(-random(&mut k), 6.3 * random(&mut k));
                let Some(hit) = field.first_hit(o, d) else { panic!("downward rays hit") };
                kinds[hit.kind as usize] += 1;
                assert!(hit.normal.dot(d) < 1e-9, "seen from outside");
                let out = direction(2.0 * random(&mut k) - 1.0, 6.3 * random(&mut k));
                let out = if out.dot(hit.normal) < 0.0 { -out } else { out };
                if out.dot(hit.normal) > 0.05 {
                    let next = field.first_hit_from(&hit, out);
                    check(&brute, hit.p, out, 1e-4, next.as_ref()).expect("agrees");
                    assert_eq!(next.is_some(), field.occluded_from(&hit, out));
                }
                let into = field.first_hit_from(&hit, -out).expect("blocked at once");
                assert_eq!(into.t_um, 0.0);
                assert!(field.occluded_from(&hit, -out));
            }
        }
        assert!(kinds.iter().all(|&n| n > 20), "{kinds:?}");
    }

    #[test]
    fn hits_lie_on_the_surface() {
        let mut k = 77;
        for field in fields() {
            let brute = Brute::new(&field);
            for _ in 0..300 {
                let o = (DVec2::new(random(&mut k), random(&mut k)) * field.tile_um()).extend(50.0);
                let d = direction(-random(&mut k).max(1e-3), 6.3 * random(&mut k));
                let hit = field.first_hit(o, d).expect("downward rays hit");
                assert!((hit.normal.length() - 1.0).abs() < 1e-12);
                assert!((o + d * hit.t_um - hit.p).length() < 1e-9);
                let gap = |p| brute.gap_in(hit.cell, hit.site_um, p);
                match hit.kind {
                    HitKind::Base => assert_eq!((hit.p.z, hit.normal), (0.0, DVec3::Z)),
                    HitKind::Dome => {
                        assert!(gap(hit.p).abs() < 1e-10, "{} {hit:?}", gap(hit.p));
                        let e = 1e-5;
                        let slope = |v: DVec3| (gap(hit.p + v * e) - gap(hit.p - v * e)) / (2.0 * e);
                        let numeric = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z));
                        // The tip of a cone and the rim have no gradient.
                        let q = hit.p.truncate() - hit.site_um - field.tilt(hit.cell) * hit.p.z;
                        if q.length() > 1e-2 && q.length() < field.dome(hit.cell).radius_um - 1e-3 {
                            assert!((numeric.normalize() - hit.normal).length() < 1e-5);
                        }
                    }
                    HitKind::Wall => {
                        // Halfway between two centres, under one dome and over the other.
                        let q = hit.p.truncate() - hit.site_um;
                        let (other, site) = field.cell_at(hit.p.truncate() + hit.normal.truncate() * 1e-6);
                        assert!((q.length() - (hit.p.truncate() - site).length()).abs() < 1e-9);
                        assert!(gap(hit.p) < 0.0 && brute.gap_in(other, site, hit.p) > -1e-9);
                        assert_eq!(hit.normal.z, 0.0);
                    }
                }
            }
        }
    }

    #[test]
    fn flat_is_the_plane() {
        let field = field(Profile::Flat, 0.1, 0.0, 0.0);
        assert_eq!(field.max_height_um(), 0.0);
        let (o, d) = (DVec3::new(3.0, -70.0, 10.0), DVec3::new(0.6, 0.0, -0.8));
        let hit = field.first_hit(o, d).expect("hit");
        assert_eq!((hit.kind, hit.normal), (HitKind::Base, DVec3::Z));
        assert!((hit.p - DVec3::new(10.5, -70.0, 0.0)).length() < 1e-12 && hit.p.z == 0.0);
        assert!(field.first_hit_from(&hit, DVec3::new(0.6, 0.0, 0.8)).is_none());
        assert!(field.first_hit(o, -d).is_none());
    }

    #[test]
    fn regular_cosine_domes_meet_in_valleys() {
        // No base shows and no wall stands, however the ray falls.
        let field = field(Profile::Cosine, 0.0, 0.0, 0.0);
        let mut k = 5;
        for _ in 0..20_000 {
            let o = (DVec2::new(random(&mut k), random(&mut k)) * field.tile_um()).extend(40.0);
            let hit = field.first_hit(o, direction(-random(&mut k), 6.3 * random(&mut k))).expect("hit");
            assert_eq!(hit.kind, HitKind::Dome);
        }
        // The valley's height: H cos(pi/2 sqrt(3)/2) in the middle of a side.
        let valley = 37.0 * (std::f64::consts::FRAC_PI_2 * 0.75f64.sqrt()).cos();
        assert!((field.height_at_um(DVec2::new(11.5, 0.0)) - valley).abs() < 1e-9);
        assert!((field.height_at_um(DVec2::ZERO) - 37.0).abs() < 1e-9);
    }

    #[test]
    fn the_field_repeats() {
        let field = field(Profile::RaisedCosine, 0.1, 0.1, 5.0);
        let mut k = 9;
        for _ in 0..300 {
            let xy = DVec2::new(random(&mut k), random(&mut k)) * field.tile_um();
            let d = direction(-random(&mut k), 6.3 * random(&mut k));
            let near = field.first_hit(xy.extend(40.0), d).expect("hit");
            let shift = field.tile_um() * DVec2::new(-3.0, 7.0);
            let far = field.first_hit((xy + shift).extend(40.0), d).expect("hit");
            // A grazing ray turns the rounding of its start into a longer error along it.
            assert!((near.t_um - far.t_um).abs() < 1e-6 && near.cell == far.cell);
            assert!((far.site_um - near.site_um - shift).length() < 1e-9);
        }
    }

    #[test]
    fn horizontal_rays_end() {
        let field = field(Profile::Cosine, 0.0, 0.0, 0.0);
        // Midway between two rows, above the valleys: free for ever.
        let y = 0.25 * field.tile_um().y;
        assert!(field.first_hit(DVec3::new(0.0, y, 30.0), DVec3::X).is_none());
        assert!(field.first_hit(DVec3::new(0.0, y, 30.0), DVec3::new(1.0, 0.0, 1e-9)).is_none());
        // Along a row: the next dome.
        let hit = field.first_hit(DVec3::new(11.5, 0.0, 20.0), DVec3::X).expect("hit");
        assert!((field.height_at_um(hit.p.truncate()) - 20.0).abs() < 1e-9 && hit.t_um < 11.5);
        // Along a side from corner to corner, then the dome two rows on.
        let hit = field.first_hit(DVec3::new(0.0, 13.0, 36.0), DVec3::Y).expect("hit");
        assert!((field.height_at_um(hit.p.truncate()) - 36.0).abs() < 1e-9);
        assert!((hit.p.y - field.tile_um().y).abs() < 11.5);
    }

    #[test]
    fn odd_starts() {
        let field = field(Profile::Cosine, 0.0, 0.0, 0.0);
        let inside = field.first_hit(DVec3::new(0.0, 0.0, 20.0), DVec3::X).expect("hit");
        assert_eq!(inside.t_um, 0.0);
        assert_eq!(field.first_hit(DVec3::new(0.0, 0.0, -1.0), DVec3::Z).expect("hit").t_um, 0.0);
        assert!(field.first_hit(DVec3::new(f64::NAN, 0.0, 50.0), DVec3::NEG_Z).is_none());
        assert!(field.first_hit(DVec3::new(0.0, 0.0, 50.0), DVec3::splat(f64::NAN)).is_none());
        assert!(field.first_hit(DVec3::new(0.0, 0.0, 37.0), DVec3::Z).is_none());
        let far = field.first_hit(DVec3::new(1e5, -3e5, 1e6), direction(-0.7, 1.0)).expect("hit");
        assert!((field.height_at_um(far.p.truncate()) - far.p.z).abs() < 1e-8);
    }

    #[test]
    fn refuses_bad_descriptions() {
        let bad = CellDescription { pitch_um: 0.0, ..Default::default() };
        assert!(CellField::new(&bad).is_err());
        let flat = CellDescription { height_um: 0.0, ..Default::default() };
        assert_eq!(CellField::new(&flat).expect("valid").max_height_um(), 0.0);
    }
}

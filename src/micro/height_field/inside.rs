//! Rays inside the cells: from a point of the solid to where its cell ends.
//!
//! Model: a cell is its Voronoi polygon between the floor z = -depth and its dome (the base plane where the dome does not
//! reach). A ray ends at the first of: the dome, the base plane, a side of the polygon, the floor. Over z = 0 a side is
//! an inner wall as far as the neighbour's dome reaches, and an outer wall above it.
//!
//! Method: of a concave dome the solid is convex (a tilt shears it, which keeps it so), so the gap z - h along the ray turns
//! positive once: a bracket closed by Newton's steps. For the raised cosine, which is not, the gap's second derivative is at
//! most K = H pi^2 / 2 R^2: stepping from root to root of the bounding quadratic never passes the first exit.
//! Guarded by `inside_agrees_with_brute_force`, `in_and_out_are_the_same_surface`.

use glam::{DVec2, DVec3};

use super::{Cell, CellField, CellHit, HitKind, Place, START_UM};
use crate::micro::Profile;

/// The bracket of a concave dome is closed to this, um.
const CLOSE_UM: f64 = 1e-10;

/// The cell that a ray is in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Within(Place);

/// Where a ray inside a cell ends.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Bound {
    /// The outer wall: dome, base plane, or the part of a side above the neighbour's dome. The normal points to the air.
    Outer(CellHit),
    /// An inner wall; the unit normal points into the neighbour.
    Inner {
        /// Outward normal, horizontal.
        normal: DVec3,
        /// The cell beyond.
        neighbor: Within,
    },
    /// The floor.
    Floor,
}

/// A ray's way through a cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chord {
    pub(crate) t_um: f64,
    /// End, um.
    pub(crate) p: DVec3,
    pub(crate) bound: Bound,
}

impl CellField {
    /// The cell behind a hit.
    pub(crate) fn behind(&self, hit: &CellHit) -> Within {
        Within(Place { cell: hit.cell, site: hit.site_um })
    }

    /// The cell over or under a point of the plane.
    pub(crate) fn within(&self, xy_um: DVec2) -> Within {
        Within(self.locate(xy_um))
    }

    /// Follows a ray from a point in (or on the wall of) a cell to the cell's end. The floor lies at `-depth_um`.
    pub(crate) fn chord(&self, within: Within, origin: DVec3, direction: DVec3, depth_um: f64) -> Chord {
        let place = within.0;
        let cell = &self.cells[place.cell as usize];
        let q = origin.truncate() - place.site;
        let d = direction.truncate();
        let (mut t, mut side) = (f64::INFINITY, None);
        for edge in self.edges_of(cell) {
            let toward = d.dot(edge.delta);
            if toward > 0.0 {
                let at = ((edge.half - q.dot(edge.delta)) / toward).max(0.0);
                if at < t {
                    (t, side) = (at, Some(edge));
                }
            }
        }
        if direction.z < 0.0 {
            let floor = ((-depth_um - origin.z) / direction.z).max(0.0);
            if floor < t {
                (t, side) = (floor, None);
            }
        }
        let local = q.extend(origin.z);
        if let Some((t_exit, kind)) = self.exit(cell, local, direction, t) {
            let mut p = origin + direction * t_exit;
            let normal = if kind == HitKind::Base {
                p.z = 0.0;
                DVec3::Z
            } else {
                p.z = p.z.max(0.0);
                self.normal_in_cell(place.cell, p.truncate() - place.site, p.z)
            };
            return self.outer(t_exit, p, normal, kind, place, place);
        }
        let mut p = origin + direction * t;
        let Some(edge) = side else {
            p.z = -depth_um;
            return Chord { t_um: t, p, bound: Bound::Floor };
        };
        let neighbor = Place { cell: edge.neighbor, site: place.site + edge.delta };
        let normal = edge.delta.normalize_or_zero().extend(0.0);
        if p.z > 0.0 && p.z > self.height_in_cell_um(neighbor.cell, p.truncate() - neighbor.site) + START_UM {
            return self.outer(t, p, normal, HitKind::Wall, place, neighbor);
        }
        Chord { t_um: t, p, bound: Bound::Inner { normal, neighbor: Within(neighbor) } }
    }

    fn outer(&self, t_um: f64, p: DVec3, normal: DVec3, kind: HitKind, solid: Place, air: Place) -> Chord {
        let hit = CellHit { t_um, p, normal, cell: solid.cell, site_um: solid.site, kind, air };
        Chord { t_um, p, bound: Bound::Outer(hit) }
    }

    /// Where a ray leaves the cell upwards before `t_end`; `origin` relative to the cell's centre.
    fn exit(&self, cell: &Cell, origin: DVec3, direction: DVec3, t_end: f64) -> Option<(f64, HitKind)> {
        let z = origin.z;
        // The part of the ray at z >= 0.
        let rises = z < 0.0 || (z == 0.0 && direction.z > 0.0);
        if rises && direction.z <= 0.0 {
            return None;
        }
        let low = if rises { -z / direction.z } else { 0.0 };
        if low > t_end {
            return None;
        }
        let inv = cell.inv_radius_squared;
        let q = origin.truncate() - cell.tilt * z;
        let d = direction.truncate() - cell.tilt * direction.z;
        let (a, b, c) = (d.length_squared() * inv, q.dot(d) * inv, q.length_squared() * inv);
        let u_at = |t: f64| (a * t + 2.0 * b) * t + c;
        if cell.height <= 0.0 || (rises && u_at(low) >= 1.0) {
            // Downwards from the base plane there is nothing above.
            return (direction.z > 0.0).then_some((low, HitKind::Base));
        }
        let down = if direction.z < 0.0 { -z / direction.z } else { f64::INFINITY };
        let high = t_end.min(down).max(low);
        let gap = |t: f64| {
            let u = u_at(t);
            let (h, dh) = self.profile.at_square(u.clamp(0.0, 1.0));
            let g = z + t * direction.z - cell.height * h;
            (g, direction.z - cell.height * dh * 2.0 * (a * t + b), u)
        };
        let found = if self.profile == Profile::RaisedCosine {
            let bound = 0.5 * std::f64::consts::PI.powi(2) * cell.height * d.length_squared() * inv;
            first_rise(&gap, bound, low, high)
        } else {
            only_rise(&gap, low, high)
        };
        found.map(|t| (t, HitKind::Dome))
    }
}

/// The root of a gap that turns positive once in [low, high]; `None` where it does not.
fn only_rise(gap: &impl Fn(f64) -> (f64, f64, f64), mut low: f64, mut high: f64) -> Option<f64> {
    // Outside is where the gap is positive, or beyond the dome's rim.
    let (mut g, mut slope, mut u) = gap(high);
    if g <= 0.0 && u < 1.0 {
        return None;
    }
    for _ in 0..100 {
        if high - low <= CLOSE_UM {
            break;
        }
        // From outside Newton's steps of a convex gap stay outside; beyond the rim it is not convex.
        let newton = high - g / slope;
        let t = if u < 1.0 && newton > low && newton < high { newton } else { 0.5 * (low + high) };
        let at = gap(t);
        if at.0.abs() < 1e-12 && at.2 < 1.0 && t > low + CLOSE_UM {
            return Some(t);
        }
        if at.0 > 0.0 || at.2 >= 1.0 {
            high = t;
            (g, slope, u) = at;
        } else {
            low = t;
        }
    }
    Some(high)
}

/// The first root from below of a gap whose second derivative is at most `bound`.
fn first_rise(gap: &impl Fn(f64) -> (f64, f64, f64), bound: f64, low: f64, high: f64) -> Option<f64> {
    let mut t = low;
    for _ in 0..1000 {
        let (g, slope, _) = gap(t);
        if g >= -1e-11 && slope >= 0.0 {
            return Some(t);
        }
        let g = g.min(0.0);
        let x = if bound > 0.0 {
            ((slope * slope - 2.0 * bound * g).sqrt() - slope) / bound
        } else if slope > 0.0 {
            -g / slope
        } else {
            return None;
        };
        t += x.max(1e-10);
        if t > high {
            return None;
        }
    }
    Some(t)
}

impl CellField {
    /// Is a point inside a cell's dome or below the base plane? For tests.
    #[cfg(test)]
    fn holds(&self, p: DVec3) -> bool {
        if p.z <= 0.0 {
            return true;
        }
        let place = self.locate(p.truncate());
        let cell = &self.cells[place.cell as usize];
        let q = p.truncate() - place.site - cell.tilt * p.z;
        let u = q.length_squared() * cell.inv_radius_squared;
        u < 1.0 && p.z < cell.height * self.profile.at_square(u).0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Stream;
    use crate::micro::CellDescription;

    fn fields() -> impl Iterator<Item = CellField> {
        Profile::ALL.into_iter().flat_map(|profile| {
            [(0.0, 0.0, 0.0), (0.12, 0.2, 0.0), (0.1, 0.15, 6.0)].map(|(center, height, tilt)| {
                let description = CellDescription {
                    profile,
                    center_disorder: center,
                    height_disorder: height,
                    tilt_disorder_deg: tilt,
                    tile_cells: 4,
                    seed: 5,
                    ..Default::default()
                };
                CellField::new(&description).expect("valid")
            })
        })
    }

    fn direction(stream: &mut Stream) -> DVec3 {
        let z = 2.0 * stream.next() - 1.0;
        let phi = std::f64::consts::TAU * stream.next();
        (DVec2::from_angle(phi) * (1.0 - z * z).sqrt()).extend(z)
    }

    #[test]
    fn inside_agrees_with_brute_force() {
        let depth = 12.0;
        for (f, field) in fields().enumerate() {
            let mut stream = Stream::new(1, f as u64, 0);
            let mut outer = 0;
            for _ in 0..1500 {
                let xy = stream.next_2d() * field.tile_um();
                let z = stream.next() * (field.max_height_um() + depth) - depth;
                let (p, d) = (xy.extend(z), direction(&mut stream));
                if !field.holds(p) {
                    continue;
                }
                // Chords end to end until the light is out, against small steps.
                let (mut at, mut from, mut way) = (field.within(xy), p, 0.0);
                let end = loop {
                    let chord = field.chord(at, from, d, depth);
                    way += chord.t_um;
                    match chord.bound {
                        Bound::Inner { neighbor, .. } => (at, from) = (neighbor, chord.p),
                        other => break other,
                    }
                    if way > 400.0 {
                        break Bound::Floor;
                    }
                };
                let step = 0.01;
                let mut t = 0.0;
                while t < 400.0 {
                    let q = p + d * t;
                    if q.z < -depth || !field.holds(q) {
                        break;
                    }
                    t += step;
                }
                if t >= 399.0 || way >= 399.0 {
                    continue;
                }
                // A ray that grazes a valley may leave and come back within one step.
                let missed = t > way + step && {
                    let q = p + d * (way + 1e-7);
                    !field.holds(q) || q.z < -depth
                };
                assert!(
                    (t - way).abs() <= 1.01 * step || missed,
                    "{:?} {p} {d}: {way} {t}",
                    field.description()
                );
                outer += u32::from(matches!(end, Bound::Outer(_)));
            }
            assert!(outer > 100, "{outer}");
        }
    }

    #[test]
    fn in_and_out_are_the_same_surface() {
        // A ray from outside that enters at a hit, turned round from its first exit, comes back to the hit.
        for (f, field) in fields().enumerate() {
            let mut stream = Stream::new(2, f as u64, 0);
            for _ in 0..400 {
                let xy = stream.next_2d() * field.tile_um();
                let d = direction(&mut stream);
                let d = d.truncate().extend(-d.z.abs() - 0.05).normalize();
                let Some(hit) = field.first_hit(xy.extend(field.max_height_um() + 1.0), d) else { continue };
                let chord = field.chord(field.behind(&hit), hit.p, d, 15.0);
                let (at, back) = match chord.bound {
                    Bound::Inner { .. } | Bound::Floor => (field.behind(&hit), chord),
                    Bound::Outer(out) => (field.behind(&out), chord),
                };
                if back.t_um < 1e-3 {
                    continue;
                }
                let again = field.chord(at, back.p, -d, 15.0);
                assert!(
                    (again.t_um - back.t_um).abs() < 1e-6,
                    "{:?} {hit:?} {d} {back:?} {again:?}",
                    field.description()
                );
                assert!(
                    matches!(again.bound, Bound::Outer(h) if (h.normal - hit.normal).length() < 1e-4 || h.kind != hit.kind || field.profile == Profile::Cone)
                );
            }
        }
    }
}

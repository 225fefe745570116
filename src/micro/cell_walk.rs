//! The walk of light through a petal's tissue.
//!
//! Model: geometrical optics, one photon at a time. Light meets the exact domes of an epidermis ([`super::CellField`]); at every
//! wall it is reflected with the probability R of [`Wall`] and refracted with 1 - R ([`rough_wall`] where the outer wall is
//! striated). Inside, it crosses cells along straight
//! lines, meeting inner walls (vacuole | wall | vacuole) at the sides of the columns and the floor below; light that leaves
//! a dome may meet the next one. In a turbid slab it goes an exponentially distributed way of mean 1 / mu_s and turns by
//! an angle of Henyey and Greenstein's distribution (`micro::henyey_greenstein`).
//!
//! No light is absorbed on the way (see [`super::white`]): each walk has weight one and remembers its way through each
//! region. `CellWalk::absorbing` follows light that may be absorbed instead, for comparison.
//!
//! The layers and their numbers are those of [`super::tissue`]. Frames: the adaxial epidermis in the petal's; the abaxial one
//! turned over about x; slabs by the depth below their top.
//!
//! Limits: polarisation and interference are left out; of a layer all is homogeneous but the cells; walks are cut
//! off after [`MAX_EVENTS`] events and counted, as is light that grazes for ever (`white_furnace`). Slabs without cells give
//! the published reflectances (`slab_of_van_de_hulst`, `slab_of_giovanelli`); flat cells over nothing are a plate
//! (`flat_cells_are_a_plate`). Source of the method: Wang, Jacques, Zheng 1995, "MCML", Computer Methods and Programs in
//! Biomedicine 47:131, for slabs; cells instead of slabs are our reading of the thesis' cross-section.

use std::sync::Arc;

use glam::DVec3;

use super::height_field::{Bound, CellHit, Within};
use super::henyey_greenstein::turn;
use super::tissue::{Epidermis, REGIONS, Slab, Tissue};
use super::white::{End, Exit, WhiteScatter};
use super::{rough_wall, wall::Wall};
use crate::math::Stream;

/// Events (walls met and turns in slabs) after which a walk is cut off.
pub const MAX_EVENTS: u32 = 1_000_000;

/// A petal's tissue that light walks through.
#[derive(Clone, Debug)]
pub struct CellWalk {
    tissue: Arc<Tissue>,
    layers: Vec<Layer>,
    /// Walls between layer i and layer i + 1, seen from above; the first and the last layer's outer sides are not here.
    between: Vec<Wall>,
}

/// What lies at one depth.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Layer {
    Adaxial,
    Slab(usize),
    Abaxial,
}

/// Where light is, in the frame of its layer.
#[derive(Clone, Copy, Debug)]
struct Photon {
    p: DVec3,
    d: DVec3,
}

/// How light leaves a layer.
enum Next {
    /// Through the layer's upper side, or its lower one, as seen from the adaxial side.
    Up,
    Down,
    Out(DVec3),
    Absorbed,
    CutOff,
}

/// Lengths so far, and what the walk may still do.
struct Account<'a> {
    path_um: [f64; REGIONS],
    events: u32,
    /// Optical depth that absorbs this photon; infinite without absorption.
    budget: f64,
    absorption_per_um: &'a [f64; REGIONS],
}

impl Account<'_> {
    /// Adds a way. False where the light is absorbed on it.
    fn advance(&mut self, region: usize, way_um: f64) -> bool {
        self.path_um[region] += way_um;
        self.budget -= way_um * self.absorption_per_um[region];
        self.budget >= 0.0
    }

    /// Counts an event. False where there were too many.
    fn event(&mut self) -> bool {
        self.events += 1;
        self.events < MAX_EVENTS
    }
}

impl CellWalk {
    /// A walk through the layers.
    pub fn new(tissue: Arc<Tissue>) -> Self {
        let mut layers = Vec::new();
        if tissue.adaxial.is_some() {
            layers.push(Layer::Adaxial);
        }
        layers.extend((0..tissue.slabs.len()).map(Layer::Slab));
        if tissue.abaxial.is_some() {
            layers.push(Layer::Abaxial);
        }
        let epidermis =
            |e: &Option<Epidermis>| e.as_ref().map_or((1.0, 1.0), |e| (e.vacuole_index, e.wall_index));
        // Index of a layer, and of its wall where it has one.
        let index = |layer: Layer| match layer {
            Layer::Adaxial => (epidermis(&tissue.adaxial).0, Some(epidermis(&tissue.adaxial).1)),
            Layer::Abaxial => (epidermis(&tissue.abaxial).0, Some(epidermis(&tissue.abaxial).1)),
            Layer::Slab(i) => (tissue.slabs[i].index, None),
        };
        let between = layers
            .windows(2)
            .map(|pair| {
                let ((upper, upper_wall), (lower, lower_wall)) = (index(pair[0]), index(pair[1]));
                let wall = upper_wall.or(lower_wall).unwrap_or(lower);
                Wall { outer_index: upper, wall_index: wall, inner_index: lower }
            })
            .collect();
        Self { tissue, layers, between }
    }

    /// The layers.
    pub fn tissue(&self) -> &Arc<Tissue> {
        &self.tissue
    }

    /// Follows light as [`WhiteScatter::walk`] does, and tells where and in which direction (petal's frame) it goes down
    /// through the floor of the adaxial epidermis, each time it does.
    pub fn walk_watching_floor(
        &self,
        wi: DVec3,
        stream: &mut Stream,
        floor: &mut dyn FnMut(DVec3, DVec3),
    ) -> End {
        let mut account = Account {
            path_um: [0.0; REGIONS],
            events: 0,
            budget: f64::INFINITY,
            absorption_per_um: &[0.0; REGIONS],
        };
        self.follow(wi, stream, &mut account, floor).unwrap_or(End::CutOff)
    }

    /// Follows light that is absorbed on its way with the given coefficients (1/um); `None` where it was.
    pub fn absorbing(
        &self,
        wi: DVec3,
        absorption_per_um: &[f64; REGIONS],
        stream: &mut Stream,
    ) -> Option<End> {
        let budget = stream.exponential();
        let mut account = Account { path_um: [0.0; REGIONS], events: 0, budget, absorption_per_um };
        self.follow(wi, stream, &mut account, &mut |_, _| {})
    }

    /// The walk; `None` where the light was absorbed.
    fn follow(
        &self,
        wi: DVec3,
        stream: &mut Stream,
        account: &mut Account,
        floor: &mut dyn FnMut(DVec3, DVec3),
    ) -> Option<End> {
        let from_above = wi.z > 0.0;
        let last = self.layers.len() - 1;
        let mut at = if from_above { 0 } else { last };
        let mut photon = Photon { p: DVec3::ZERO, d: -wi };
        let mut next = self.enter(at, &mut photon, from_above, stream, account);
        loop {
            next = match next {
                Next::CutOff => return Some(End::CutOff),
                Next::Absorbed => return None,
                Next::Out(direction) => {
                    return Some(End::Left(Exit { direction, path_um: account.path_um }));
                }
                Next::Down | Next::Up => {
                    let down = matches!(next, Next::Down);
                    if self.layers[at] == Layer::Adaxial && down {
                        floor(photon.p, photon.d);
                    }
                    if (down && at == last) || (!down && at == 0) {
                        // Through a plane into the air: there is no epidermis on that side.
                        let d = photon.d;
                        Next::Out(if self.layers[at] == Layer::Abaxial { turned_over(d) } else { d })
                    } else {
                        let from = self.layers[at];
                        at = if down { at + 1 } else { at - 1 };
                        self.hand_over(from, self.layers[at], down, &mut photon);
                        self.cross(at, photon, None, stream, account, &mut photon)
                    }
                }
            };
        }
    }

    /// Light from the air meets the first layer.
    fn enter(
        &self,
        at: usize,
        photon: &mut Photon,
        from_above: bool,
        stream: &mut Stream,
        account: &mut Account,
    ) -> Next {
        let u = stream.next_2d();
        match self.layers[at] {
            Layer::Slab(i) => {
                let slab = &self.tissue.slabs[i];
                let wall = plane(slab);
                let cos = photon.d.z.abs();
                let meeting = wall.meet(cos, true);
                if stream.next() < meeting.reflectance {
                    return Next::Out(photon.d.with_z(-photon.d.z));
                }
                photon.p = DVec3::new(0.0, 0.0, if from_above { 0.0 } else { slab.thickness_um });
                let forward = DVec3::Z * photon.d.z.signum();
                refract(&mut photon.d, forward, &meeting);
                self.cross(at, *photon, None, stream, account, photon)
            }
            layer => {
                let Some(epidermis) = self.epidermis(layer) else { return Next::CutOff };
                // An epidermis that light meets from the air through its floor is one whose domes look the other way: it
                // is the only layer.
                let domes_up = layer == Layer::Adaxial;
                if domes_up != from_above {
                    photon.p = (u * epidermis.cells.tile_um()).extend(-epidermis.depth_um);
                    photon.d = in_frame(layer, photon.d);
                    let wall = floor_to_air(epidermis);
                    let meeting = wall.meet(photon.d.z.abs(), false);
                    if stream.next() < meeting.reflectance {
                        return Next::Out(in_frame(layer, photon.d.with_z(-photon.d.z)));
                    }
                    refract(&mut photon.d, DVec3::Z, &meeting);
                    return self.cross(at, *photon, None, stream, account, photon);
                }
                let d = in_frame(layer, photon.d);
                // Rays through points uniform over the plane.
                let origin = (u * epidermis.cells.tile_um()).extend(epidermis.cells.max_height_um() + 1.0);
                let Some(hit) = epidermis.cells.first_hit(origin, d) else { return Next::CutOff };
                let start = Photon { p: hit.p, d };
                self.cross(at, start, Some(hit), stream, account, photon)
            }
        }
    }

    /// From the frame of one layer to that of the next.
    fn hand_over(&self, from: Layer, to: Layer, down: bool, photon: &mut Photon) {
        // In the petal's frame, but for the height.
        if from == Layer::Abaxial {
            photon.p = turned_over(photon.p);
            photon.d = turned_over(photon.d);
        }
        match to {
            Layer::Adaxial => photon.p.z = -self.tissue.adaxial.as_ref().map_or(0.0, |e| e.depth_um),
            Layer::Slab(i) => photon.p.z = if down { 0.0 } else { self.tissue.slabs[i].thickness_um },
            Layer::Abaxial => {
                photon.p = turned_over(photon.p);
                photon.d = turned_over(photon.d);
                photon.p.z = -self.tissue.abaxial.as_ref().map_or(0.0, |e| e.depth_um);
            }
        }
    }

    fn epidermis(&self, layer: Layer) -> Option<&Epidermis> {
        match layer {
            Layer::Adaxial => self.tissue.adaxial.as_ref(),
            Layer::Abaxial => self.tissue.abaxial.as_ref(),
            Layer::Slab(_) => None,
        }
    }

    /// Follows light within one layer until it leaves it; `outside` is where it meets an epidermis from the air.
    fn cross(
        &self,
        at: usize,
        start: Photon,
        outside: Option<CellHit>,
        stream: &mut Stream,
        account: &mut Account,
        end: &mut Photon,
    ) -> Next {
        *end = start;
        match self.layers[at] {
            Layer::Slab(i) => self.cross_slab(at, &self.tissue.slabs[i], end, stream, account),
            layer => match self.epidermis(layer) {
                Some(epidermis) => self.cross_epidermis(at, layer, epidermis, outside, end, stream, account),
                None => Next::CutOff,
            },
        }
    }

    /// The wall below layer `at`, or above it; the normal points up. `None` at the outside of the petal.
    fn wall_between(&self, at: usize, below: bool) -> Option<&Wall> {
        if below { self.between.get(at) } else { at.checked_sub(1).and_then(|i| self.between.get(i)) }
    }

    fn cross_slab(
        &self,
        at: usize,
        slab: &Slab,
        photon: &mut Photon,
        stream: &mut Stream,
        account: &mut Account,
    ) -> Next {
        let mu_s = slab.scattering_per_um;
        loop {
            if !account.event() {
                return Next::CutOff;
            }
            let dz = photon.d.z;
            // Depth grows downwards.
            let to_side = if dz < 0.0 {
                (photon.p.z - slab.thickness_um) / dz
            } else if dz > 0.0 {
                photon.p.z / dz
            } else {
                f64::INFINITY
            };
            let free = if mu_s > 0.0 { stream.exponential() / mu_s } else { f64::INFINITY };
            let way = free.min(to_side);
            if way == f64::INFINITY {
                return Next::CutOff;
            }
            if !account.advance(slab.region, way) {
                return Next::Absorbed;
            }
            photon.p += DVec3::new(photon.d.x, photon.d.y, -dz) * way;
            if free < to_side {
                photon.d = turn(photon.d, slab.anisotropy, stream);
                continue;
            }
            let down = dz < 0.0;
            photon.p.z = if down { slab.thickness_um } else { 0.0 };
            let meeting = match self.wall_between(at, down) {
                // The wall's outer side is up.
                Some(wall) => wall.meet(dz.abs(), down),
                None => plane(slab).meet(dz.abs(), false),
            };
            if stream.next() < meeting.reflectance {
                photon.d.z = -dz;
                continue;
            }
            refract(&mut photon.d, DVec3::Z * dz.signum(), &meeting);
            return if down { Next::Down } else { Next::Up };
        }
    }

    #[expect(
        clippy::too_many_arguments,
        reason = "the state of one walk, in pieces that live in different places"
    )]
    fn cross_epidermis(
        &self,
        at: usize,
        layer: Layer,
        epidermis: &Epidermis,
        mut outside: Option<CellHit>,
        photon: &mut Photon,
        stream: &mut Stream,
        account: &mut Account,
    ) -> Next {
        let cells = &epidermis.cells;
        let upright = layer == Layer::Adaxial;
        let region = if upright { 0 } else { REGIONS - 1 };
        let outer_wall =
            Wall { outer_index: 1.0, wall_index: epidermis.wall_index, inner_index: epidermis.vacuole_index };
        let inner_wall = Wall { outer_index: epidermis.vacuole_index, ..outer_wall };
        let mut within: Option<Within> = None;
        loop {
            if !account.event() {
                return Next::CutOff;
            }
            if let Some(hit) = outside {
                // At an outer wall, from either side of it.
                photon.d = meet_outer(&outer_wall, epidermis.roughness, hit.normal, photon.d, stream);
                photon.p = hit.p;
                if photon.d.dot(hit.normal) > 0.0 {
                    outside = cells.first_hit_from(&hit, photon.d);
                    if outside.is_some() {
                        continue;
                    }
                    // Light that stays among the domes for ever is as good as parallel to them.
                    let leaves = photon.d.z > 0.0;
                    return if leaves { Next::Out(in_frame(layer, photon.d)) } else { Next::CutOff };
                }
                within = Some(cells.behind(&hit));
                outside = None;
            }
            let here = *within.get_or_insert_with(|| cells.within(photon.p.truncate()));
            let chord = cells.chord(here, photon.p, photon.d, epidermis.depth_um);
            if !account.advance(region, chord.t_um) {
                return Next::Absorbed;
            }
            photon.p = chord.p;
            match chord.bound {
                Bound::Outer(hit) => outside = Some(hit),
                Bound::Inner { normal, neighbor } => {
                    let cos = photon.d.dot(normal).abs();
                    if stream.next() < inner_wall.meet(cos, true).reflectance {
                        photon.d -= normal * (2.0 * photon.d.dot(normal));
                    } else {
                        within = Some(neighbor);
                    }
                }
                Bound::Floor => {
                    let cos = photon.d.z.abs();
                    // In this frame the floor is below; in the petal's, of the abaxial epidermis it is above.
                    let meeting = match self.wall_between(at, upright) {
                        Some(wall) => wall.meet(cos, upright),
                        None => floor_to_air(epidermis).meet(cos, true),
                    };
                    if stream.next() < meeting.reflectance {
                        photon.d.z = -photon.d.z;
                        continue;
                    }
                    refract(&mut photon.d, DVec3::NEG_Z, &meeting);
                    return if upright { Next::Down } else { Next::Up };
                }
            }
        }
    }
}

impl WhiteScatter for CellWalk {
    fn walk(&self, wi: DVec3, stream: &mut Stream) -> End {
        self.walk_watching_floor(wi, stream, &mut |_, _| {})
    }
}

/// The side of a slab that borders on air.
fn plane(slab: &Slab) -> Wall {
    Wall { outer_index: 1.0, wall_index: slab.index, inner_index: slab.index }
}

/// The floor of an epidermis that lies on air: its outer medium is the vacuole.
fn floor_to_air(epidermis: &Epidermis) -> Wall {
    Wall { outer_index: epidermis.vacuole_index, wall_index: epidermis.wall_index, inner_index: 1.0 }
}

/// Direction after light that travels along `d` met an outer wall whose normal points to the air.
fn meet_outer(wall: &Wall, roughness: f64, normal: DVec3, mut d: DVec3, stream: &mut Stream) -> DVec3 {
    if roughness > 0.0 {
        let (a, b) = normal.any_orthonormal_pair();
        let local = DVec3::new(d.dot(a), d.dot(b), d.dot(normal));
        let out = rough_wall::scatter(local, roughness, wall, stream);
        return (a * out.x + b * out.y + normal * out.z).normalize();
    }
    let cos = d.dot(normal);
    let meeting = wall.meet(cos.abs().min(1.0), cos < 0.0);
    if stream.next() < meeting.reflectance {
        return (d - normal * (2.0 * cos)).normalize();
    }
    refract(&mut d, normal * cos.signum(), &meeting);
    d
}

/// Refraction; `forward` is the normal on the side that light goes to.
fn refract(d: &mut DVec3, forward: DVec3, meeting: &super::wall::Meeting) {
    let tangent = *d - forward * d.dot(forward);
    *d = (tangent * meeting.index_ratio + forward * meeting.cos_through).normalize();
}

/// The petal's frame to that of the abaxial epidermis and back.
fn turned_over(v: DVec3) -> DVec3 {
    DVec3::new(v.x, -v.y, -v.z)
}

fn in_frame(layer: Layer, v: DVec3) -> DVec3 {
    if layer == Layer::Abaxial { turned_over(v) } else { v }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::math::stats::Welford;
    use crate::micro::{CellDescription, TissueDescription};

    fn walk(tissue: &str, cells: &str) -> CellWalk {
        let tissue: TissueDescription = toml::from_str(tissue).expect("parses");
        let cells: CellDescription = toml::from_str(cells).expect("parses");
        CellWalk::new(Arc::new(Tissue::new(&tissue, &cells, "tissue").expect("valid")))
    }

    fn lamp(deg: f64) -> DVec3 {
        DVec3::new(deg.to_radians().sin(), 0.0, deg.to_radians().cos())
    }

    /// Reflectance and transmittance under absorption; panics on a cut-off.
    fn totals(w: &CellWalk, wi: DVec3, mu: &[f64; REGIONS], n: u64) -> [Welford; 2] {
        let mut sums = [Welford::default(), Welford::default()];
        for i in 0..n {
            let End::Left(exit) = w.walk(wi, &mut Stream::new(7, 0, i)) else { panic!("cut off") };
            let back = exit.direction.z * wi.z > 0.0;
            let left = exit.remaining(mu);
            sums[0].push(if back { left } else { 0.0 });
            sums[1].push(if back { 0.0 } else { left });
        }
        sums
    }

    fn agrees(w: &Welford, expected: f64) {
        let z = (w.mean() - expected) / w.standard_error();
        assert!(z.abs() < 3.5, "{} +- {} against {expected}", w.mean(), w.standard_error());
    }

    fn slab(index: f64, scattering_per_mm: f64, g: f64, thickness_um: f64) -> CellWalk {
        walk(
            &format!(
                "[spongy]\nindex = {index:?}\nscattering_per_mm = {scattering_per_mm:?}\nanisotropy = {g:?}\nthickness_um = {thickness_um:?}"
            ),
            "",
        )
    }

    #[test]
    fn slab_of_van_de_hulst() {
        // Absorption 10/cm, scattering 90/cm, g = 0.75, 0.02 cm, matched: van de Hulst 1980, Multiple Light Scattering.
        let [r, t] = totals(&slab(1.0, 9.0, 0.75, 200.0), DVec3::Z, &[0.0, 0.0, 1e-3, 0.0], 400_000);
        agrees(&r, 0.09739);
        agrees(&t, 0.66096);
        assert!(r.standard_error() < 6e-4);
    }

    #[test]
    fn slab_of_giovanelli() {
        // Half space, n = 1.5, absorption 10/cm, scattering 90/cm, isotropic: Giovanelli 1955.
        let [r, t] = totals(&slab(1.5, 9.0, 0.0, 20_000.0), DVec3::NEG_Z, &[0.0, 0.0, 1e-3, 0.0], 20_000);
        // Published to four digits for light from everywhere beneath 0 degrees.
        agrees(&r, 0.2600);
        assert!(t.mean() < 1e-6);
    }

    #[test]
    fn flat_cells_are_a_plate() {
        // Two walls and nothing to scatter: the incoherent sum over a plate of vacuole, in both directions.
        let w = walk("[adaxial]\ndepth_um = 30.0", "profile = 'flat'");
        for deg in [0.0f64, 60.0] {
            let wall = Wall { outer_index: 1.0, wall_index: 1.425, inner_index: 1.35 };
            let meeting = wall.meet(deg.to_radians().cos(), true);
            // Inner walls turn light round but keep its cosine: the floor and the top see the same angle.
            let r = meeting.reflectance;
            let expected = 2.0 * r / (1.0 + r);
            for side in [1.0, -1.0] {
                let [back, through] =
                    totals(&w, lamp(deg) * DVec3::new(1.0, 1.0, side), &[0.0; REGIONS], 100_000);
                agrees(&back, expected);
                agrees(&through, 1.0 - expected);
            }
        }
    }

    const PETAL: &str = "[adaxial]\n[palisade]\nscattering_per_mm = 20.0\nanisotropy = 0.8\nthickness_um = 40.0\n\
        [spongy]\nindex = 1.3\nscattering_per_mm = 60.0\nanisotropy = 0.6\nthickness_um = 120.0\n\
        [abaxial]\nroughness = 0.3\n[abaxial.cells]\npitch_um = 30.0\nheight_um = 8.0\ncenter_disorder = 0.1\nheight_disorder = 0.2\ntile_cells = 8";

    #[test]
    fn white_furnace() {
        // Every profile, regular or not; every walk ends, and its light leaves on one side or the other.
        for profile in ["cosine", "cosine_inner", "raised_cosine", "paraboloid", "cone", "papilla", "flat"] {
            for disorder in [
                "",
                "\ncenter_disorder = 0.1\nheight_disorder = 0.2\ntilt_disorder_deg = 5.0\ntile_cells = 8",
            ] {
                let w = walk(PETAL, &format!("profile = '{profile}'{disorder}"));
                let mut out = [0; 2];
                for i in 0..4000 {
                    let deg = 89.0 * (i as f64 / 4000.0);
                    let wi = lamp(deg) * DVec3::new(1.0, 1.0, if i % 2 == 0 { 1.0 } else { -1.0 });
                    match w.walk(wi, &mut Stream::new(3, 1, i)) {
                        End::Left(exit) => {
                            assert!((exit.direction.length() - 1.0).abs() < 1e-9);
                            assert!(exit.path_um.iter().all(|l| l.is_finite() && *l >= 0.0));
                            out[usize::from(exit.direction.z > 0.0)] += 1;
                        }
                        End::CutOff => panic!("{profile}{disorder}: cut off"),
                    }
                }
                assert!(out[0] > 400 && out[1] > 400, "{profile}: {out:?}");
            }
        }
    }

    #[test]
    fn absorbed_on_the_way_or_afterwards() {
        let w = walk(PETAL, "");
        let mu = [0.03, 0.002, 0.001, 0.01];
        for side in [1.0, -1.0] {
            let wi = lamp(30.0) * DVec3::new(1.0, 1.0, side);
            let n = 40_000;
            let after = totals(&w, wi, &mu, n);
            let mut on_the_way = [Welford::default(), Welford::default()];
            for i in 0..n {
                let end = w.absorbing(wi, &mu, &mut Stream::new(8, 0, i));
                let back = |e: Exit| e.direction.z * wi.z > 0.0;
                let (r, t) = match end {
                    Some(End::Left(e)) => (f64::from(back(e)), f64::from(!back(e))),
                    _ => (0.0, 0.0),
                };
                on_the_way[0].push(r);
                on_the_way[1].push(t);
            }
            for (a, b) in after.iter().zip(&on_the_way) {
                let z = (a.mean() - b.mean()) / a.standard_error().hypot(b.standard_error());
                assert!(z.abs() < 3.5, "{} {}", a.mean(), b.mean());
                assert!(a.mean() > 0.003);
            }
        }
    }

    #[test]
    fn transmission_is_reciprocal() {
        // Light spread evenly (cosine) over one side: as much comes through as in the opposite direction.
        let w = walk(PETAL, "");
        let mu = [0.02, 0.0, 0.0, 0.005];
        let through = |side: f64| {
            let mut sum = Welford::default();
            for i in 0..60_000 {
                let mut s = Stream::new(4, side.to_bits(), i);
                let u = s.next_2d();
                let r = u.x.sqrt();
                let wi = (glam::DVec2::from_angle(TAU * u.y) * r).extend(side * (1.0 - u.x).sqrt());
                let End::Left(exit) = w.walk(wi, &mut s) else { panic!("cut off") };
                sum.push(if exit.direction.z * side < 0.0 { exit.remaining(&mu) } else { 0.0 });
            }
            sum
        };
        let (down, up) = (through(1.0), through(-1.0));
        let z = (down.mean() - up.mean()) / down.standard_error().hypot(up.standard_error());
        assert!(z.abs() < 3.5 && down.mean() > 0.03, "{} {}", down.mean(), up.mean());
    }
}

//! Elements: the pieces of surface whose light is one unknown per side.
//!
//! Model: an element is a set of facets of one connected piece of surface, found by halving the piece again and again:
//! across the longest extent of its facets' centres, or of their normals, which count as far apart as the element is wide
//! times `NORMAL_WEIGHT`. So elements are compact and nearly flat, and there may be far fewer of them than triangles.
//!
//! An element has two nodes, its adaxial and its abaxial side: node = 2 element + side.
//! Guarded by `elements_cover_the_surface`, `halves_are_flatter`. Source: our reading.

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::facets::{Facets, face_normal, shares};
use crate::geometry::ray::offset_origin;
use crate::geometry::{Interaction, Ray, Side};
use crate::math::{Frame, warp};
use crate::scene::{Scene, TissueState};

/// Normals a radian apart lie as far from each other as this share of the element's width.
const NORMAL_WEIGHT: f32 = 1.0;

/// What is the same all over an element.
#[derive(Clone, Copy, Debug)]
pub struct Element {
    /// Shape of the scene.
    pub shape: u32,
    /// Connected piece of surface.
    pub piece: u32,
    /// Area, mm2.
    pub area_mm2: f32,
    /// Centre of area, mm.
    pub centre: Vec3,
    /// Mean normal, adaxial, unit length.
    pub normal: Vec3,
    /// Mean texture coordinates, zero without.
    pub uv: Vec2,
    /// What it is made of, in the mean.
    pub tissue: TissueState,
    /// Largest distance of a facet's centre from the element's, mm.
    pub radius_mm: f32,
    /// Its facets, from this place of the order on.
    first: u32,
    /// ... up to this one.
    last: u32,
}

/// A point of an element.
#[derive(Clone, Copy, Debug)]
pub(in crate::transport) struct Point {
    pub(in crate::transport) p: Vec3,
    /// Unit normal, adaxial.
    pub(in crate::transport) normal: Vec3,
}

impl Point {
    /// A ray from side 0 (adaxial) or 1 (abaxial), distributed by the cosine.
    pub(super) fn ray(&self, side: u32, u: Vec2) -> Ray {
        let normal = if side == 0 { self.normal } else { -self.normal };
        let local = warp::square_to_cosine_hemisphere(u);
        let direction = Frame::from_normal(normal).to_world(local).normalize();
        Ray::new(offset_origin(self.p, normal, direction), direction)
    }
}

/// All elements of a scene.
#[derive(Debug)]
pub struct Elements {
    list: Vec<Element>,
    facets: Facets,
    /// Facets in the order of their elements.
    order: Vec<u32>,
    /// Area of the facets up to and with this one, within its element, mm2.
    cumulative: Vec<f32>,
    /// Element of each facet.
    of_facet: Vec<u32>,
}

/// Node of an element's side.
pub(super) fn node(element: u32, side: Side) -> usize {
    2 * element as usize + side as usize
}

impl Elements {
    /// One element per connected piece, halved until there are about `elements`.
    pub(super) fn new(scene: &Scene, facets: Facets, elements: u32) -> Self {
        let mut order: Vec<u32> = (0..facets.len() as u32).collect();
        order.sort_by_key(|f| facets.piece(*f));
        let mut list = Vec::new();
        let mut first = 0;
        while first < order.len() {
            let piece = facets.piece(order[first]);
            let last = first + order[first..].partition_point(|f| facets.piece(*f) <= piece);
            let (shape, _) = facets.face(order[first]);
            let area = |f: &u32| f64::from(facet_data(scene, &facets, *f).area);
            list.push(Element {
                shape,
                piece,
                area_mm2: order[first..last].iter().map(area).sum::<f64>() as f32,
                centre: Vec3::ZERO,
                normal: Vec3::Z,
                uv: Vec2::ZERO,
                tissue: TissueState::SOUND,
                radius_mm: 0.0,
                first: first as u32,
                last: last as u32,
            });
            first = last;
        }
        let (cumulative, of_facet) = (vec![0.0; order.len()], vec![0; order.len()]);
        let mut out = Self { list, facets, order, cumulative, of_facet };
        out.halve_by_area(scene, elements);
        let all: Vec<u32> = (0..out.list.len() as u32).collect();
        out.describe(scene, &all);
        out
    }

    /// Halves whole pieces until each has its share of the elements.
    fn halve_by_area(&mut self, scene: &Scene, elements: u32) {
        let areas: Vec<f64> = self.list.iter().map(|e| f64::from(e.area_mm2)).collect();
        let shares = shares(&areas, f64::from(elements));
        loop {
            let large: Vec<u32> = (0..self.list.len() as u32)
                .filter(|e| {
                    let e = &self.list[*e as usize];
                    let piece = e.piece as usize;
                    // A halving overshoots as often as it falls short.
                    f64::from(e.area_mm2) > std::f64::consts::SQRT_2 * areas[piece] / shares[piece]
                        && e.last - e.first > 1
                })
                .collect();
            if large.is_empty() {
                return;
            }
            self.halve(scene, &large);
        }
    }

    /// Halves elements that have more than one facet; the second half becomes a new element at the end of the list. Gives
    /// the elements that changed, old and new, with their areas; the rest of them is left to [`Elements::describe`].
    pub(super) fn halve(&mut self, scene: &Scene, which: &[u32]) -> Vec<u32> {
        let facets = &self.facets;
        // Elements own disjoint parts of the order: hand each its own.
        let mut by_place: Vec<u32> = which
            .iter()
            .copied()
            .filter(|e| self.list[*e as usize].last - self.list[*e as usize].first > 1)
            .collect();
        by_place.sort_unstable_by_key(|e| self.list[*e as usize].first);
        let mut parts = Vec::with_capacity(by_place.len());
        let (mut rest, mut taken) = (&mut self.order[..], 0);
        for e in by_place {
            let Element { first, last, .. } = self.list[e as usize];
            let (_, tail) = rest.split_at_mut(first as usize - taken);
            let (part, tail) = tail.split_at_mut((last - first) as usize);
            parts.push((e, part));
            (rest, taken) = (tail, last as usize);
        }
        let cuts: Vec<(u32, Cut)> =
            parts.into_par_iter().map(|(e, part)| (e, halve_facets(scene, facets, part))).collect();
        let mut changed = Vec::with_capacity(2 * cuts.len());
        for (e, cut) in cuts {
            let whole = self.list[e as usize];
            let middle = whole.first + cut.at as u32;
            self.list[e as usize] = Element { last: middle, area_mm2: cut.areas_mm2[0], ..whole };
            changed.push(e);
            changed.push(self.list.len() as u32);
            self.list.push(Element { first: middle, area_mm2: cut.areas_mm2[1], ..whole });
        }
        changed
    }

    /// Sums elements over their facets, and numbers the facets by them.
    pub(super) fn describe(&mut self, scene: &Scene, which: &[u32]) {
        let described: Vec<(Element, Vec<f32>)> =
            which.par_iter().map(|e| self.described(scene, *e)).collect();
        for (e, (element, sums)) in which.iter().zip(described) {
            let (first, last) = (element.first as usize, element.last as usize);
            self.cumulative[first..last].copy_from_slice(&sums);
            for f in &self.order[first..last] {
                self.of_facet[*f as usize] = *e;
            }
            self.list[*e as usize] = element;
        }
    }

    fn described(&self, scene: &Scene, element: u32) -> (Element, Vec<f32>) {
        let old = self.list[element as usize];
        let data: Vec<FacetData> =
            self.facets_of(element).iter().map(|f| facet_data(scene, &self.facets, *f)).collect();
        let (mut area, mut uv, mut tissue) = (0.0f64, Vec2::ZERO, TissueState::NOTHING);
        let (mut centre, mut normal) = (DVec3::ZERO, DVec3::ZERO);
        let mut sums = Vec::with_capacity(data.len());
        for d in &data {
            let weight = f64::from(d.area);
            area += weight;
            sums.push(area as f32);
            centre += d.centre.as_dvec3() * weight;
            normal += d.normal.as_dvec3() * weight;
            uv += d.uv * d.area;
            tissue = tissue.plus(d.tissue.times(d.area));
        }
        let centre = (centre / area.max(1e-300)).as_vec3();
        let element = Element {
            area_mm2: area as f32,
            centre,
            normal: normal.as_vec3().normalize_or(Vec3::Z),
            uv: uv / (area as f32).max(1e-30),
            tissue: tissue.times(1.0 / (area as f32).max(1e-30)),
            radius_mm: data.iter().map(|d| d.centre.distance(centre)).fold(0.0, f32::max),
            ..old
        };
        (element, sums)
    }

    /// Number of elements.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// Has the scene no surface?
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Every element, by number.
    pub fn list(&self) -> &[Element] {
        &self.list
    }

    /// The facets.
    pub fn facets(&self) -> &Facets {
        &self.facets
    }

    /// The facets of an element.
    pub fn facets_of(&self, element: u32) -> &[u32] {
        let e = &self.list[element as usize];
        &self.order[e.first as usize..e.last as usize]
    }

    /// Element of a facet.
    pub fn of_facet(&self, facet: u32) -> u32 {
        self.of_facet[facet as usize]
    }

    /// Element at a point of a triangle; `None` where the triangle has no area.
    pub fn at(&self, shape: u32, face: u32, barycentric: Vec3) -> Option<u32> {
        self.facets.at(shape, face, barycentric).map(|f| self.of_facet[f as usize])
    }

    /// Element that a ray met.
    pub fn hit(&self, at: &Interaction) -> Option<u32> {
        self.at(at.shape, at.face, at.b)
    }

    /// Uniform point of a described element.
    pub(in crate::transport) fn sample(&self, scene: &Scene, element: u32, u_facet: f32, u: Vec2) -> Point {
        let e = &self.list[element as usize];
        let sums = &self.cumulative[e.first as usize..e.last as usize];
        let x = u_facet * sums.last().copied().unwrap_or(0.0);
        let k = sums.partition_point(|s| *s <= x).min(sums.len() - 1);
        let facet = self.order[e.first as usize + k];
        let ([a, b, c], _) = self.facets.corners(scene, facet);
        let w = warp::square_to_triangle(u);
        let (shape, face) = self.facets.face(facet);
        let normal = face_normal(&scene.shapes[shape as usize].mesh, face as usize).normalize_or(Vec3::Z);
        // In f64 the point stays on the triangle.
        let p = (a.as_dvec3() + (b - a).as_dvec3() * f64::from(w.y) + (c - a).as_dvec3() * f64::from(w.z))
            .as_vec3();
        Point { p, normal }
    }
}

/// What elements sum over their facets.
struct FacetData {
    area: f32,
    centre: Vec3,
    /// Unit, adaxial.
    normal: Vec3,
    uv: Vec2,
    tissue: TissueState,
}

fn facet_data(scene: &Scene, facets: &Facets, facet: u32) -> FacetData {
    let (shape, face) = facets.face(facet);
    let mesh = &scene.shapes[shape as usize].mesh;
    let ([a, b, c], weights) = facets.corners(scene, facet);
    let w = (weights[0] + weights[1] + weights[2]) / 3.0;
    let uv = if mesh.uvs.is_empty() {
        Vec2::ZERO
    } else {
        let [p, q, r] = mesh.triangles[face as usize].map(|i| mesh.uvs[i as usize]);
        p * w.x + q * w.y + r * w.z
    };
    FacetData {
        area: 0.5 * (b - a).cross(c - a).length(),
        centre: (a + b + c) / 3.0,
        normal: face_normal(mesh, face as usize).normalize_or(Vec3::Z),
        uv,
        tissue: scene.tissue(shape, uv),
    }
}

/// Where facets are divided in two.
struct Cut {
    at: usize,
    areas_mm2: [f32; 2],
}

/// Sorts facets so that the two halves, by number, are compact and flat.
fn halve_facets(scene: &Scene, facets: &Facets, part: &mut [u32]) -> Cut {
    struct Keyed {
        facet: u32,
        area: f32,
        centre: Vec3,
        normal: Vec3,
    }
    let mut keyed: Vec<Keyed> = part
        .iter()
        .map(|&facet| {
            let FacetData { area, centre, normal, .. } = facet_data(scene, facets, facet);
            Keyed { facet, area, centre, normal }
        })
        .collect();
    let extent = |of: &dyn Fn(&Keyed) -> Vec3| {
        let none = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (low, high) = keyed.iter().map(of).fold(none, |(l, h), p| (l.min(p), h.max(p)));
        high - low
    };
    let places = extent(&|k| k.centre);
    let normals = extent(&|k| k.normal) * (NORMAL_WEIGHT * places.length());
    let by_place = places.max_element() >= normals.max_element();
    let axis = if by_place { places.max_position() } else { normals.max_position() };
    let value = |k: &Keyed| if by_place { k.centre[axis] } else { k.normal[axis] };
    let at = keyed.len() / 2;
    keyed.select_nth_unstable_by(at, |a, b| value(a).total_cmp(&value(b)).then(a.facet.cmp(&b.facet)));
    for (f, k) in part.iter_mut().zip(&keyed) {
        *f = k.facet;
    }
    let area = |half: &[Keyed]| half.iter().map(|k| f64::from(k.area)).sum::<f64>() as f32;
    Cut { at, areas_mm2: [area(&keyed[..at]), area(&keyed[at..])] }
}

#[cfg(test)]
mod tests {
    use glam::UVec2;

    use super::super::testing::scene;
    use super::*;
    use crate::math::Sampler;

    fn ball_and_floor() -> Scene {
        scene(
            r#"
            [shapes.ball]
            type = "sphere"
            radius_mm = 3
            subdivisions = 5
            material = "grey"
            [shapes.floor]
            type = "quad"
            width_mm = 400
            height_mm = 100
            position_mm = [0, 0, -5]
            material = "grey"
            "#,
        )
    }

    fn elements(s: &Scene, n: u32) -> Elements {
        Elements::new(s, Facets::new(s, n), n)
    }

    #[test]
    fn elements_cover_the_surface() {
        let s = ball_and_floor();
        for n in [2, 100, 1000] {
            let e = elements(&s, n);
            assert!(e.len() as u32 <= 2 * n && e.len() as u32 >= n / 2, "{n}: {}", e.len());
            let area: f32 = e.list().iter().map(|e| e.area_mm2).sum();
            let exact: f32 =
                s.shapes.iter().flat_map(|s| (0..s.mesh.triangles.len()).map(|f| s.mesh.face_area(f))).sum();
            assert!((area / exact - 1.0).abs() < 1e-4, "{area} {exact}");
            for i in 0..500 {
                let mut u = Sampler::new(3, UVec2::new(n, 0), i);
                let k = (u.next_1d() * e.len() as f32) as u32;
                let point = e.sample(&s, k, u.next_1d(), u.next_2d());
                let of = &e.list()[k as usize];
                let reach = of.radius_mm + 2.0 * of.area_mm2.sqrt();
                assert!(
                    point.p.distance(of.centre) < reach,
                    "{k}: {} of {reach}",
                    point.p.distance(of.centre)
                );
            }
        }
    }

    #[test]
    fn halves_are_flatter() {
        let s = ball_and_floor();
        let e = elements(&s, 1500);
        // A ball of about 300 elements: normals of an element stay within about 20 degrees of its mean.
        let ball: Vec<u32> = (0..e.len() as u32).filter(|k| e.list()[*k as usize].shape == 0).collect();
        assert!(ball.len() > 150, "{}", ball.len());
        for k in ball {
            let n = e.list()[k as usize].normal;
            for f in e.facets_of(k) {
                let (shape, face) = e.facets().face(*f);
                let nf = face_normal(&s.shapes[shape as usize].mesh, face as usize).normalize();
                assert!(n.dot(nf) > 0.85, "{}", n.dot(nf));
                assert_eq!(e.of_facet(*f), k);
            }
        }
    }
}

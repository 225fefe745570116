//! Which points of the cells shade a hit.
//!
//! Model: the domes' light f_E is an integral over the domes that are seen ([`super`]). It is estimated from points of two
//! kinds, which the balance heuristic (Veach 1997) joins, so that each lit point counts once:
//!
//! ```text
//! random  where the viewing ray meets the domes,       p_r = <n.wo>+ V(wo) / (A cos_o)           per area of dome
//! aimed   where the normal is the one between wo       p_a = K 4 <n.wo> (n_E + 1) / (2 pi) cos^n_E(alpha)
//!         and a direction of the lobe about wi
//! f_E,1 = sum over both kinds of f_e <n.wo> <n.wi> V V / (A cos_o cos_i) / (N_r p_r + N_a p_a)
//! ```
//!
//! Random points alone are the thesis' method. On tall domes the normals within a highlight lie in a thousandth of the cell,
//! which few random points find, and their light is the brighter; an aimed point is always there. Light of higher orders
//! starts from random points alone.
//!
//! The random points of all samples of a pixel fill the cell evenly, though each sample's footprint lies elsewhere: the
//! stratified numbers say where in the lattice's unit cell, others which of its copies in the footprint
//! ([`CellField::like_near`](crate::micro::CellField)).
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | N_r, N_a | [`Points`] | | 1, 0 |
//! | | [`Footprint`] | um | |
//! | A | area of a cell | um^2 | |
//! | K | Gauss curvature of the dome where n is its normal | sr/um^2 | |
//!
//! Limits: aimed points need domes that are alike, upright and curved, and a footprint of a cell or more; elsewhere there are
//! none. Guarded by `aimed_points_find_the_same_light`, `aimed_points_quiet_the_highlight`,
//! `points_of_a_pixel_fill_the_cell`. Source: our reading.

use glam::{DVec2, DVec3, Vec3};

use super::{CellPetal, MAX_ORDERS};
use crate::bsdf::Bsdf;
use crate::math::warp::{square_to_disc, square_to_power_cosine};
use crate::math::{Frame, Sampler};
use crate::micro::height_field::CellHit;
use crate::spectrum::{SampledSpectrum, SampledWavelengths};

/// A footprint as wide as this many tiles sees all of the tile.
const WIDE_TILES: f64 = 8.0;
/// Squared radius, in pitches, of the disc with the second moment of a cell's hexagon; their areas differ by 0.8 %.
const HEXAGON: f64 = 5.0 / 18.0;

/// Where on the petal's plane the points are drawn: in a disc, or, where that is wider than a cell, in a hexagon of a cell's
/// size whose middle lies in a smaller disc, with the second moment of the whole disc.
#[derive(Clone, Copy, Debug)]
pub struct Footprint {
    /// Middle, um in the petal's plane.
    pub center_um: DVec2,
    /// Radius of the disc that the ray covers, um.
    pub radius_um: f64,
}

impl Footprint {
    /// So wide that single cells do not matter: points anywhere on the tile.
    pub const WIDE: Self = Self { center_um: DVec2::ZERO, radius_um: f64::INFINITY };
}

/// How many points of the cells shade a hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Points {
    /// Anywhere in the footprint; at least 1.
    pub random: u32,
    /// Where the highlight is.
    pub aimed: u32,
}

impl From<u32> for Points {
    /// Random points only.
    fn from(random: u32) -> Self {
        Self { random, aimed: 0 }
    }
}

/// A pair of directions whose light is estimated.
struct Pair<'a> {
    wo: Vec3,
    wi: Vec3,
    light: DVec3,
    lambda: &'a SampledWavelengths,
    /// N_a / N_r; 0 where there are no aimed points.
    aimed: f32,
}

impl CellPetal {
    /// f_E from all points.
    pub(super) fn estimate_all_domes(
        &self,
        wo: Vec3,
        wi: Vec3,
        lambda: &SampledWavelengths,
        footprint: Footprint,
        points: Points,
        sampler: &mut Sampler,
    ) -> SampledSpectrum {
        let random = points.random.max(1);
        let aims = points.aimed > 0
            && self.hexagon_rest_um2(footprint) > 0.0
            && self.cells.faces()
            && self.epidermis.specular().max() > 0.0;
        let aimed = if aims { points.aimed } else { 0 };
        let ratio = aimed as f32 / random as f32;
        let pair = Pair { wo, wi, light: wi.as_dvec3().normalize(), lambda, aimed: ratio };
        let mut sum = SampledSpectrum::ZERO;
        for i in 0..random {
            sum += self.by_chance(&pair, footprint, &mut sampler.fork(i, random));
        }
        sampler.end_fork();
        for i in 0..aimed {
            sum += self
                .aimed_at_the_highlight(&pair, &mut sampler.fork(i, aimed))
                .unwrap_or(SampledSpectrum::ZERO);
        }
        sampler.end_fork();
        sum * (1.0 / random as f32)
    }

    /// f_E from one random point: its share of the first order, and all further orders.
    fn by_chance(&self, pair: &Pair, footprint: Footprint, sampler: &mut Sampler) -> SampledSpectrum {
        let mut direction = -pair.wo.as_dvec3().normalize();
        let mut hit = self.first_hit(direction, footprint, sampler);
        let mut throughput = SampledSpectrum::ONE;
        let mut sum = SampledSpectrum::ZERO;
        for order in 0..MAX_ORDERS {
            let Some(at) = hit else { break };
            if let Some((f, density)) = self.lit(&at, -direction.as_vec3(), pair) {
                let weight = if order == 0 { self.balance(&at, density, pair) } else { 1.0 };
                sum += throughput * f * weight;
            }
            match self.reflect(&at, direction, order, pair.lambda, &mut throughput, sampler) {
                Some(next) => direction = next,
                None => break,
            }
            hit = self.cells.first_hit_from(&at, direction);
        }
        sum
    }

    /// f_E of the first order from one aimed point, over p_r.
    fn aimed_at_the_highlight(&self, pair: &Pair, sampler: &mut Sampler) -> Option<SampledSpectrum> {
        let lobe = square_to_power_cosine(sampler.next_2d(), self.epidermis.exponent());
        let normal = pair.wo + Frame::from_normal(pair.wi).to_world(lobe);
        let at = self.cells.facing(normal.as_dvec3().normalize_or_zero())?;
        let (f, density) = self.lit(&at, pair.wo, pair)?;
        let seen = !self.cells.occluded_from(&at, pair.wo.as_dvec3().normalize());
        seen.then(|| f * self.balance(&at, density, pair))
    }

    /// What a point sends towards `wo` of the light, `f_e <n.wi> V(wi) / cos_i`, and the density of the lobe there.
    fn lit(&self, at: &CellHit, wo: Vec3, pair: &Pair) -> Option<(SampledSpectrum, f32)> {
        let cos = at.normal.dot(pair.light);
        let frame = Frame::from_normal(at.normal.as_vec3());
        let local_wo = frame.to_local(wo);
        if cos <= 0.0 || local_wo.z <= 0.0 || self.cells.occluded_from(at, pair.light) {
            return None;
        }
        let local_wi = frame.to_local(pair.wi);
        let density =
            if pair.aimed > 0.0 { self.epidermis.pdf_rest(local_wo, local_wi, pair.lambda) } else { 0.0 };
        Some((self.epidermis.eval(local_wo, local_wi, pair.lambda) * (cos as f32 / pair.wi.z), density))
    }

    /// N_r p_r / (N_r p_r + N_a p_a), with the density of the lobe at the point.
    fn balance(&self, at: &CellHit, density: f32, pair: &Pair) -> f32 {
        if density <= 0.0 {
            return 1.0;
        }
        let curvature = self.cells.curvature_per_um2(at) * self.cells.cell_area_um2(at.cell);
        1.0 / (1.0 + pair.aimed * 4.0 * density * pair.wo.z * curvature as f32)
    }

    /// Squared radius of the disc in which a hexagon's middle is drawn, um^2; not above zero where the footprint is less than
    /// the hexagon.
    fn hexagon_rest_um2(&self, footprint: Footprint) -> f64 {
        footprint.radius_um.powi(2) - HEXAGON * self.cells.description().pitch_um.powi(2)
    }

    /// A point of the footprint.
    fn place(&self, footprint: Footprint, sampler: &mut Sampler) -> DVec2 {
        let (u, v) = (sampler.next_2d(), sampler.next_2d());
        let rest_um2 = self.hexagon_rest_um2(footprint);
        let tile = self.cells.tile_um();
        if footprint.radius_um > WIDE_TILES * tile.max_element() {
            self.cells.like_near(u.as_dvec2(), v.as_dvec2() * tile)
        } else if rest_um2 > 0.0 {
            let middle = footprint.center_um + square_to_disc(v).as_dvec2() * rest_um2.sqrt();
            self.cells.like_near(u.as_dvec2(), middle)
        } else {
            footprint.center_um + square_to_disc(u).as_dvec2() * footprint.radius_um
        }
    }

    /// The dome that a ray meets which crosses the petal's plane at a random point of the footprint.
    pub(super) fn first_hit(
        &self,
        direction: DVec3,
        footprint: Footprint,
        sampler: &mut Sampler,
    ) -> Option<CellHit> {
        let at = self.place(footprint, sampler);
        // The mesh stands for the plane half way up the domes: a footprint slides with the view around there.
        let half = 0.5 * self.cells.max_height_um();
        let rise = (half + 1.0) / -direction.z;
        let origin = (at - direction.truncate() * rise).extend(2.0 * half + 1.0);
        self.cells.first_hit(origin, direction)
    }
}

#[cfg(test)]
mod tests;

//! Walks among the domes that serve every exponent, every share of the lobe and many lamps at once.
//!
//! Model: a point of the petal's plane is seen from `wo`; the ray meets a dome at x1 and goes on from dome to dome in
//! directions drawn from a density q. At x_m every lamp `wi` adds the light of order m:
//!
//! ```text
//! T_m(s, n; wo, wi) = mean of  W_m f(s, n; x_m)  <n.wi>+ V(wi) / cos_i
//! f(s, n) = (1 - s) / pi + s (n + 2) / (2 pi) cos^n(alpha),    W_(m+1) = W_m f(s, n) <n.w> / q(w)
//! ```
//!
//! for s = 0, 1/4, 1/2, 1 and all rungs of the ladder of exponents: the walk, the normals and the shadow rays cost the
//! time, the weights W are many and cheap. Two walks leave each point:
//! - a Lambertian one, whose directions follow the cosine, so that W stays one however deep in a valley it ends;
//! - a mixed one over five orders for s > 0, whose q is half a cosine and half three lobes (n = 2, 16, 128).
//!
//! Points and the lattice's azimuth follow a Kronecker sequence, which suits periodic functions; a regular lattice needs
//! one cell and 60 degrees only. Lamps of one azimuth stand in the order of their height, and domes are a height field,
//! so the lit ones are the highest: a search along the column finds the lowest (not for tilted axes, which overhang:
//! there each lamp has its own ray).
//!
//! Each replicate shifts the sequence at random; the same numbers serve every pair of directions and, in a family of
//! shapes, every shape.

use std::f32::consts::{FRAC_1_PI, TAU};

use glam::{DVec2, DVec3, UVec2, Vec3};

use super::facets::Facets;
use super::polynomial::{EXPONENTS, FIRST, exponent};
use crate::math::sampler::{hash, hash_to_unit};
use crate::math::warp::{square_to_cosine_hemisphere, square_to_power_cosine};
use crate::math::{Frame, Sampler};
use crate::micro::{CellField, CellHit, HitKind};

/// Shares of the lobe, besides zero, for which a walk carries weights.
const SHARES: [f32; 3] = [0.25, 0.5, 1.0];
/// Sums of an order from two on: Lambertian walks, then mixed ones: the share zero, then each share at each rung. The
/// Lambertian sum of order five holds all that follow, too.
pub(super) const PER_ORDER: usize = 2 + SHARES.len() * EXPONENTS;
/// The last order of mixed walks.
const LAST: usize = 5;
/// Sums per lamp of the later orders; of order one they are the table's numbers.
const LATER_SUMS: usize = (LAST - 1) * PER_ORDER;
/// A Lambertian walk ends here, if nowhere else.
const MAX_ORDERS: usize = 1000;
/// Rungs of the lobes that directions are drawn from.
const PROPOSALS: [usize; 3] = [2, 8, 14];

type Rungs = [f32; EXPONENTS];

/// Which part of the light a walk is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// Reflected once.
    First,
    /// Reflected twice or more.
    Later,
}

impl Part {
    /// Sums per lamp.
    fn width(self) -> usize {
        match self {
            Part::First => FIRST,
            Part::Later => LATER_SUMS,
        }
    }
}

/// A viewing angle and the lamps around it.
#[derive(Clone, Debug)]
pub(super) struct View {
    /// Angle of the view, radians; the largest of all.
    pub(super) theta: f64,
    /// Angles of the lamps, rising, radians.
    pub(super) lamps: Vec<f64>,
    /// Azimuths of the lamps from the view's, radians.
    pub(super) azimuths: Vec<f64>,
    /// The light that is wanted.
    pub(super) part: Part,
}

/// Sums over the points of one replicate.
pub(super) struct Sums {
    /// Per lamp (azimuth by azimuth), [`Part::width`] each.
    means: Vec<f32>,
    /// Light between Lambertian domes of order five, and of order five and more, over all lamps.
    pub(super) tail: [f64; 2],
    width: usize,
}

impl Sums {
    /// The sums of one lamp.
    pub(super) fn at(&self, lamp: usize) -> &[f32] {
        &self.means[lamp * self.width..][..self.width]
    }
}

/// Everything that the walks of one surface share.
pub(super) struct Walker<'a> {
    field: &'a CellField,
    facets: Option<Facets<'a>>,
    /// The parallelogram that repeats, um.
    basis: [DVec2; 2],
    /// The azimuth after which the lattice repeats, radians.
    turn: f64,
    /// Do domes hide everything below the lowest visible lamp of an azimuth?
    columns: bool,
    /// (n + 2) / (2 pi) of each rung.
    norms: Rungs,
}

/// Lamps of one azimuth: their horizontal direction.
struct Column {
    cos: f64,
    sin: f64,
}

/// The lamps as they stand about one point.
struct Lamps {
    /// Sine and cosine of the angles from the normal, the same in each column.
    angles: Vec<(f64, f64)>,
    columns: Vec<Column>,
    /// Which of a column's are seen.
    lit: Vec<bool>,
}

impl<'a> Walker<'a> {
    pub(super) fn new(field: &'a CellField) -> Self {
        let cells = field.description();
        let (tile, pitch) = (field.tile_um(), cells.pitch_um);
        let regular = cells.is_regular();
        let basis = if regular {
            [DVec2::new(pitch, 0.0), DVec2::new(0.5 * pitch, 0.5 * tile.y)]
        } else {
            [DVec2::new(tile.x, 0.0), DVec2::new(0.0, tile.y)]
        };
        Self {
            field,
            facets: Facets::new(field),
            basis,
            turn: if regular { std::f64::consts::FRAC_PI_3 } else { std::f64::consts::TAU },
            columns: cells.tilt_disorder_deg == 0.0,
            norms: std::array::from_fn(|k| (exponent(k) as f32 + 2.0) / TAU),
        }
    }

    /// Walks from `points` points; for order one also looks at `facets` points that the normal finds, for each lamp.
    pub(super) fn trace(&self, view: &View, seed: u64, replicate: u32, points: u32, facets: u32) -> Sums {
        let width = view.part.width();
        let count = view.lamps.len() * view.azimuths.len();
        let mut sums = Sums { means: vec![0.0; count * width], tail: [0.0; 2], width };
        let azimuths: Vec<(f64, f64)> = view.azimuths.iter().map(|t| t.sin_cos()).collect();
        let mut lamps = Lamps {
            angles: view.lamps.iter().map(|t| t.sin_cos()).collect(),
            columns: Vec::with_capacity(azimuths.len()),
            lit: vec![false; view.lamps.len()],
        };
        let (st, ct) = view.theta.sin_cos();
        let key = hash(hash(seed as u32 ^ 0x51ed_270b) ^ hash((seed >> 32) as u32 ^ replicate));
        for i in 0..points {
            // The generalised golden ratio of three dimensions: x^4 = x + 1.
            const STEPS: [f64; 3] =
                [0.819_172_513_396_164_5, 0.671_043_606_703_789_2, 0.549_700_477_901_997_4];
            let [u, v, turn] = std::array::from_fn(|d| {
                (hash_to_unit(key.wrapping_add(d as u32)) + f64::from(i + 1) * STEPS[d]).fract()
            });
            let (sin, cos) = (turn * self.turn).sin_cos();
            // The lamps stand on either side of the view: a disordered lattice is no mirror image of itself.
            let side = if hash(key ^ hash(i ^ 0x7f4a_7c15)) & 1 == 0 { 1.0 } else { -1.0 };
            lamps.columns.clear();
            lamps.columns.extend(azimuths.iter().map(|&(s, c)| {
                let s = s * side;
                Column { cos: cos * c - sin * s, sin: sin * c + cos * s }
            }));
            let direction = -DVec3::new(st * cos, st * sin, ct);
            let start = (self.basis[0] * u + self.basis[1] * v).extend(self.field.max_height_um());
            let Some(hit) = self.field.first_hit(start, direction) else { continue };
            match view.part {
                Part::First => {
                    let rival = f64::from(facets) / f64::from(points) * ct;
                    self.first_order(&hit, direction, rival, &mut lamps, &mut sums);
                }
                Part::Later => {
                    let sampler =
                        |walk: u32| Sampler::new(seed, UVec2::new(replicate, 0x00ce_1150 + walk), i);
                    self.lambertian(hit, direction, sampler(0), &mut lamps, &mut sums);
                    self.mixed(hit, direction, sampler(1), &mut lamps, &mut sums);
                }
            }
        }
        if view.part == Part::First {
            self.sharp(view, seed, replicate, points, facets, &mut sums);
        }
        let scale = 1.0 / points as f32;
        sums.means.iter_mut().for_each(|v| *v *= scale);
        sums
    }

    /// Order one. `rival`: facets per point, times the cosine of the view.
    fn first_order(&self, at: &CellHit, direction: DVec3, rival: f64, lamps: &mut Lamps, sums: &mut Sums) {
        let Some(mirror) = mirror(at, direction) else { return };
        let view = -direction.as_vec3();
        // What a facet's density is to be multiplied with to be compared with this point's.
        let rival = rival * at.normal.z / -direction.dot(at.normal);
        let flat = at.kind == HitKind::Base;
        self.visit(at, lamps, sums, |to, wi, share| {
            to[0] += share * FRAC_1_PI;
            if flat {
                // The flat base shades as one Phong lobe, which is added in closed form.
                to[1] += share;
                return;
            }
            let other = self.facets.as_ref().map_or(0.0, |f| f.density(at, (view + wi).normalize()));
            let share = share / (1.0 + rival * other) as f32;
            let lobe = powers(mirror.dot(wi));
            for (k, to) in to[2..].iter_mut().enumerate() {
                *to += share * self.norms[k] * lobe[k];
            }
        });
    }

    /// The lobes' light of order one from points found by their normal, as sums over `points` points.
    fn sharp(&self, view: &View, seed: u64, replicate: u32, points: u32, count: u32, sums: &mut Sums) {
        let Some(facets) = &self.facets else { return };
        let width = sums.width;
        let (st, ct) = view.theta.sin_cos();
        for i in 0..count {
            let mut s = Sampler::new(seed, UVec2::new(replicate, 0x00fa_ce75), i);
            let (u, extra, cell) = (s.next_2d(), s.next_2d(), s.next_2d());
            let (sin, cos) = (f64::from(extra.y) * self.turn).sin_cos();
            let side = if cell.y < 0.5 { 1.0 } else { -1.0 };
            let wo = DVec3::new(st * cos, st * sin, ct);
            let mut to = sums.means.chunks_exact_mut(width);
            for azimuth in &view.azimuths {
                let (s, c) = (azimuth * side).sin_cos();
                let (cos_i, sin_i) = (cos * c - sin * s, sin * c + cos * s);
                for lamp in &view.lamps {
                    let Some(to) = to.next() else { return };
                    let (sl, cl) = lamp.sin_cos();
                    let wi = DVec3::new(sl * cos_i, sl * sin_i, cl);
                    let half = (wo + wi).normalize().as_vec3();
                    facets.draw(half, u, extra.x, cell.x, |facet| {
                        let (normal, hit) = (facet.hit.normal, &facet.hit);
                        let (to_view, to_lamp) = (normal.dot(wo), normal.dot(wi));
                        if to_view <= 0.0 || to_lamp <= 0.0 {
                            return;
                        }
                        if self.field.occluded_from(hit, wo) || self.field.occluded_from(hit, wi) {
                            return;
                        }
                        // The integrand over the sum of both densities, all per area of the tile.
                        let spread = to_view / (ct * normal.z);
                        let both = f64::from(points) * spread + f64::from(count) * facet.density;
                        let share = f64::from(points) * spread * to_lamp / (cl * both);
                        let lobe = powers((normal * (2.0 * to_view) - wo).dot(wi) as f32);
                        for (k, to) in to[2..].iter_mut().enumerate() {
                            *to += share as f32 * self.norms[k] * lobe[k];
                        }
                    });
                }
            }
        }
    }

    /// Orders from two on between Lambertian domes.
    fn lambertian(&self, hit: CellHit, direction: DVec3, mut s: Sampler, lamps: &mut Lamps, sums: &mut Sums) {
        let (mut at, mut direction) = (hit, direction);
        for order in 1..MAX_ORDERS {
            if mirror(&at, direction).is_none() {
                return;
            }
            if order > 1 {
                let to_order = (order.min(LAST) - 2) * PER_ORDER;
                let mut light = 0.0;
                self.visit(&at, lamps, sums, |to, _, share| {
                    to[to_order] += share * FRAC_1_PI;
                    light += f64::from(share);
                });
                if order >= LAST {
                    sums.tail[0] += if order == LAST { light } else { 0.0 };
                    sums.tail[1] += light;
                }
            }
            s.start_dimension(order as u32);
            let frame = Frame::from_normal(at.normal.as_vec3());
            direction = frame.to_world(square_to_cosine_hemisphere(s.next_2d())).as_dvec3().normalize();
            let Some(next) = self.field.first_hit_from(&at, direction) else { return };
            at = next;
        }
    }

    /// Orders two to five between domes of any share of the lobe.
    fn mixed(&self, hit: CellHit, direction: DVec3, mut s: Sampler, lamps: &mut Lamps, sums: &mut Sums) {
        let (mut at, mut direction) = (hit, direction);
        let mut weights = Weights { zero: 1.0, shares: [[1.0; EXPONENTS]; SHARES.len()] };
        for order in 1..=LAST {
            let Some(mirror) = mirror(&at, direction) else { return };
            if order > 1 {
                let to_order = (order - 2) * PER_ORDER;
                let parts = Parts::new(&weights);
                self.visit(&at, lamps, sums, |to, wi, share| {
                    let mut lobe = powers(mirror.dot(wi));
                    lobe.iter_mut().zip(&self.norms).for_each(|(v, norm)| *v *= norm * share);
                    parts.add(&mut to[to_order + 1..to_order + PER_ORDER], share * FRAC_1_PI, &lobe);
                });
            }
            s.start_dimension(2 * order as u32);
            let Some(next) = self.reflect(at.normal.as_vec3(), mirror, &mut weights, &mut s) else { return };
            direction = next;
            let Some(next) = self.field.first_hit_from(&at, direction) else { return };
            at = next;
        }
    }

    /// Calls `add` with the sums of every lamp that sees a point of the surface, the direction to it, and
    /// `<n.wi> / cos_i`.
    #[inline]
    fn visit(
        &self,
        at: &CellHit,
        lamps: &mut Lamps,
        sums: &mut Sums,
        mut add: impl FnMut(&mut [f32], Vec3, f32),
    ) {
        let Lamps { angles, columns, lit } = lamps;
        let mut count = angles.len();
        for (column, sums) in columns.iter().zip(sums.means.chunks_exact_mut(angles.len() * sums.width)) {
            count = self.lit(at, column, angles, count, lit);
            let width = sums.len() / angles.len();
            for ((&(sin, cos), &lit), to) in angles.iter().zip(&*lit).zip(sums.chunks_exact_mut(width)) {
                if lit {
                    let wi = DVec3::new(sin * column.cos, sin * column.sin, cos);
                    add(to, wi.as_vec3(), (at.normal.dot(wi) / cos) as f32);
                }
            }
        }
    }

    /// Which lamps of a column are seen from the surface, and how many; `guess` of them, perhaps.
    fn lit(
        &self,
        at: &CellHit,
        column: &Column,
        angles: &[(f64, f64)],
        guess: usize,
        lit: &mut [bool],
    ) -> usize {
        let sees = |l: usize| {
            let (sin, cos) = angles[l];
            let wi = DVec3::new(sin * column.cos, sin * column.sin, cos);
            at.normal.dot(wi) > 0.0 && !self.field.occluded_from(at, wi)
        };
        if !self.columns {
            lit.iter_mut().enumerate().for_each(|(l, v)| *v = sees(l));
            return angles.len();
        }
        // A column is much like its neighbour: look there, then farther and farther, then halve.
        let (mut low, mut high, mut step) = (0, angles.len(), 1);
        if guess > 0 && !sees(guess - 1) {
            high = guess - 1;
            while high > 0 {
                let next = high.saturating_sub(step);
                if sees(next) {
                    low = next + 1;
                    break;
                }
                high = next;
                step *= 2;
            }
        } else {
            low = guess;
            while low < high {
                let next = (low + step - 1).min(high - 1);
                if !sees(next) {
                    high = next;
                    break;
                }
                low = next + 1;
                step *= 2;
            }
        }
        while low < high {
            let middle = (low + high) / 2;
            if sees(middle) { low = middle + 1 } else { high = middle }
        }
        let count = low;
        lit.iter_mut().enumerate().for_each(|(l, v)| *v = l < count);
        count
    }

    /// Draws the next direction of a mixed walk and multiplies the weights.
    fn reflect(&self, n: Vec3, mirror: Vec3, weights: &mut Weights, s: &mut Sampler) -> Option<DVec3> {
        let choice = s.next_1d();
        let u = s.next_2d();
        let w = if choice < 0.5 {
            Frame::from_normal(n).to_world(square_to_cosine_hemisphere(u))
        } else {
            let which = (((choice - 0.5) * 2.0 * PROPOSALS.len() as f32) as usize).min(PROPOSALS.len() - 1);
            Frame::from_normal(mirror).to_world(square_to_power_cosine(u, exponent(PROPOSALS[which]) as f32))
        };
        let cos = n.dot(w);
        if cos <= 0.0 {
            return None;
        }
        let powers = powers(mirror.dot(w));
        // (n + 1) of the density from the (n + 2) of the norm.
        let lobes: f32 = PROPOSALS.iter().map(|&k| (self.norms[k] - 1.0 / TAU) * powers[k]).sum();
        let pdf = 0.5 * cos * FRAC_1_PI + 0.5 / PROPOSALS.len() as f32 * lobes;
        let diffuse = cos * FRAC_1_PI / pdf;
        weights.zero *= diffuse;
        for (share, rungs) in SHARES.iter().zip(&mut weights.shares) {
            let lobe = share * cos / pdf;
            for k in 0..EXPONENTS {
                rungs[k] *= (1.0 - share) * diffuse + lobe * self.norms[k] * powers[k];
            }
        }
        Some(w.as_dvec3().normalize())
    }
}

/// The mirror direction at a dome; `None` where the ray comes from behind.
fn mirror(at: &CellHit, direction: DVec3) -> Option<Vec3> {
    let cos = -direction.dot(at.normal);
    (cos > 0.0).then(|| (direction + at.normal * (2.0 * cos)).as_vec3())
}

/// A mixed walk's weights: at the share zero, and at each share and rung.
struct Weights {
    zero: f32,
    shares: [Rungs; SHARES.len()],
}

/// The weights times the two parts of f.
struct Parts {
    zero: f32,
    diffuse: [Rungs; SHARES.len()],
    lobe: [Rungs; SHARES.len()],
}

impl Parts {
    fn new(weights: &Weights) -> Self {
        let times = |factor: fn(f32) -> f32| {
            std::array::from_fn(|j| weights.shares[j].map(|w| w * factor(SHARES[j])))
        };
        Self { zero: weights.zero, diffuse: times(|s| 1.0 - s), lobe: times(|s| s) }
    }

    #[inline]
    fn add(&self, to: &mut [f32], diffuse: f32, lobe: &Rungs) {
        let Some((zero, rest)) = to.split_first_mut() else { return };
        *zero += self.zero * diffuse;
        for ((to, d), l) in rest.chunks_exact_mut(EXPONENTS).zip(&self.diffuse).zip(&self.lobe) {
            for k in 0..EXPONENTS {
                to[k] += d[k] * diffuse + l[k] * lobe[k];
            }
        }
    }
}

/// `max(0, c)^n` of every rung by repeated squaring.
fn powers(c: f32) -> Rungs {
    let mut out = [0.0; EXPONENTS];
    if c <= 0.0 {
        return out;
    }
    let (mut even, mut odd) = (c, c.powf(std::f32::consts::SQRT_2));
    for pair in out.chunks_exact_mut(2) {
        pair[0] = even;
        pair[1] = odd;
        // Powers below this are nothing; denormal numbers would be slow.
        even = if even > 1e-15 { even * even } else { 0.0 };
        odd = if odd > 1e-15 { odd * odd } else { 0.0 };
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_powers() {
        for c in [1.0f32, 0.999, 0.9, 0.5, 0.1, 0.0, -0.4] {
            for (k, p) in powers(c).into_iter().enumerate() {
                let exact = f64::from(c.max(0.0)).powf(exponent(k));
                assert!((f64::from(p) - exact).abs() < 2e-4 * exact + 1e-14, "{c} {k}: {p} {exact}");
            }
        }
    }
}

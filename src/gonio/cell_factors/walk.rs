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
//! time, the weights W are many and cheap. q mixes a cosine with three lobes (n = 2, 16, 128), so that no weight is
//! large. Points and the lattice's azimuth follow a Kronecker sequence, which suits periodic functions; a regular
//! lattice needs one cell and 60 degrees only. Lamps of one azimuth stand in the order of their height, and domes are a
//! height field, so the lit ones are the highest: a search along the column finds the lowest (not for tilted axes,
//! which overhang: there each lamp has its own ray).
//!
//! Each replicate shifts the sequence at random; the same numbers serve every pair of directions and, in a family of
//! shapes, every shape.

use std::f32::consts::{FRAC_1_PI, TAU};

use glam::{DVec2, DVec3, UVec2, Vec3};

use super::polynomial::{EXPONENTS, FIRST, exponent};
use crate::math::sampler::{hash, hash_to_unit};
use crate::math::warp::{square_to_cosine_hemisphere, square_to_power_cosine};
use crate::math::{Frame, Sampler};
use crate::micro::{CellField, CellHit, HitKind};

/// Shares of the lobe, besides zero, for which a walk carries weights.
const SHARES: [f32; 3] = [0.25, 0.5, 1.0];
/// Orders whose light is kept apart; one more holds all that follow.
const ORDERS: usize = 4;
/// Sums of an order from two on: the share zero, then each share at each rung.
pub(super) const PER_ORDER: usize = 1 + SHARES.len() * EXPONENTS;
/// Sums per lamp of the later orders; of order one they are the table's numbers.
pub(super) const LATER_SUMS: usize = ORDERS * PER_ORDER;
/// A walk ends here; what it carries then is far below the noise.
const MAX_ORDERS: usize = 400;
/// From this order on a walk goes on with the probability below.
const ROULETTE_ORDER: usize = 8;
const SURVIVAL: f32 = 0.9;
/// Probability of a cosine for the first two reflections, where lobes matter, and for all others: there a smaller one
/// would let the weights of Lambertian walks spread faster than walks end.
const COSINE: [f32; 3] = [0.5, 0.5, 0.85];
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
    /// Lambertian light of order five, and of order five and more, over all lamps: the series' ratio.
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
    /// The parallelogram that repeats, um.
    basis: [DVec2; 2],
    /// The azimuth after which the lattice repeats, radians.
    turn: f64,
    /// Do domes hide everything below the lowest visible lamp of an azimuth?
    columns: bool,
    /// (n + 2) / (2 pi) of each rung.
    norms: Rungs,
}

/// A lamp's column: its horizontal direction.
struct Column {
    cos: f64,
    sin: f64,
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
            basis,
            turn: if regular { std::f64::consts::FRAC_PI_3 } else { std::f64::consts::TAU },
            columns: cells.tilt_disorder_deg == 0.0,
            norms: std::array::from_fn(|k| (exponent(k) as f32 + 2.0) / TAU),
        }
    }

    /// Walks from `points` points.
    pub(super) fn trace(&self, view: &View, seed: u64, replicate: u32, points: u32) -> Sums {
        let lamps = view.lamps.len() * view.azimuths.len();
        let mut sums =
            Sums { means: vec![0.0; lamps * view.part.width()], tail: [0.0; 2], width: view.part.width() };
        let angles: Vec<(f64, f64)> = view.lamps.iter().map(|t| t.sin_cos()).collect();
        let azimuths: Vec<(f64, f64)> = view.azimuths.iter().map(|t| t.sin_cos()).collect();
        let key = hash(hash(seed as u32 ^ 0x51ed_270b) ^ hash((seed >> 32) as u32 ^ replicate));
        let mut columns: Vec<Column> = Vec::with_capacity(azimuths.len());
        let mut lit = vec![false; angles.len()];
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
            columns.clear();
            columns.extend(azimuths.iter().map(|&(s, c)| {
                let s = s * side;
                Column { cos: cos * c - sin * s, sin: sin * c + cos * s }
            }));
            let (st, ct) = view.theta.sin_cos();
            let origin = self.basis[0] * u + self.basis[1] * v;
            let wo = DVec3::new(st * cos, st * sin, ct);
            let start = origin.extend(self.field.max_height_um());
            let sampler = Sampler::new(seed, UVec2::new(replicate, 0x00ce_1150), i);
            self.walk(start, -wo, sampler, view.part, &angles, &columns, &mut lit, &mut sums);
        }
        let scale = 1.0 / points as f32;
        sums.means.iter_mut().for_each(|v| *v *= scale);
        sums
    }

    #[allow(clippy::too_many_arguments)] // one caller; the last four are buffers and tables of the loop
    fn walk(
        &self,
        start: DVec3,
        mut direction: DVec3,
        mut sampler: Sampler,
        part: Part,
        angles: &[(f64, f64)],
        columns: &[Column],
        lit: &mut [bool],
        sums: &mut Sums,
    ) {
        let mut hit = self.field.first_hit(start, direction);
        let mut plain = 1.0f32;
        let mut weights = [[1.0f32; EXPONENTS]; SHARES.len()];
        for order in 1..MAX_ORDERS {
            let Some(at) = hit else { return };
            let normal = at.normal;
            let cos_view = -direction.dot(normal);
            if cos_view <= 0.0 {
                return;
            }
            let mirror = (direction + normal * (2.0 * cos_view)).as_vec3();
            if (order == 1) == (part == Part::First) {
                self.light(&at, mirror, order, (plain, &weights), angles, columns, lit, sums);
            }
            if part == Part::First {
                return;
            }
            sampler.start_dimension(3 * order as u32);
            let cosine = COSINE[(order - 1).min(COSINE.len() - 1)];
            let Some(next) = self.reflect(normal, mirror, &mut plain, &mut weights, &mut sampler, cosine)
            else {
                return;
            };
            if order >= ROULETTE_ORDER {
                if sampler.next_1d() >= SURVIVAL {
                    return;
                }
                plain /= SURVIVAL;
                weights.iter_mut().flatten().for_each(|w| *w /= SURVIVAL);
            }
            direction = next;
            hit = self.field.first_hit_from(&at, direction);
        }
    }

    /// Adds the light of the lamps that see a point of the surface.
    #[allow(clippy::too_many_arguments)] // as above
    fn light(
        &self,
        at: &CellHit,
        mirror: Vec3,
        order: usize,
        (plain, weights): (f32, &[Rungs; SHARES.len()]),
        angles: &[(f64, f64)],
        columns: &[Column],
        lit: &mut [bool],
        sums: &mut Sums,
    ) {
        let weighted = Weighted::new(plain, weights);
        let width = if order == 1 { Part::First } else { Part::Later }.width();
        let mut count = angles.len();
        let mut lambert = 0.0;
        for (column, sums) in columns.iter().zip(sums.means.chunks_exact_mut(angles.len() * width)) {
            count = self.lit(at, column, angles, count, lit);
            for ((&(sin, cos), &lit), to) in angles.iter().zip(&*lit).zip(sums.chunks_exact_mut(width)) {
                if !lit {
                    continue;
                }
                let wi = DVec3::new(sin * column.cos, sin * column.sin, cos);
                let share = (at.normal.dot(wi) / cos) as f32;
                let lobe = self.lobes(mirror.dot(wi.as_vec3()), share);
                if order == 1 {
                    first_order(to, share * FRAC_1_PI, &lobe, at.kind == HitKind::Base);
                } else {
                    let m = (order - 2).min(ORDERS - 1);
                    weighted.add(&mut to[m * PER_ORDER..][..PER_ORDER], share * FRAC_1_PI, &lobe);
                }
                lambert += f64::from(plain * share);
            }
        }
        if order >= 5 {
            sums.tail[0] += if order == 5 { lambert } else { 0.0 };
            sums.tail[1] += lambert;
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

    /// `(n + 2) / (2 pi) cos^n(alpha)` of every rung times `share`.
    fn lobes(&self, cos_alpha: f32, share: f32) -> Rungs {
        let mut out = powers(cos_alpha);
        for (v, norm) in out.iter_mut().zip(&self.norms) {
            *v *= norm * share;
        }
        out
    }

    /// Draws the next direction and multiplies the weights.
    fn reflect(
        &self,
        normal: DVec3,
        mirror: Vec3,
        plain: &mut f32,
        weights: &mut [Rungs; SHARES.len()],
        sampler: &mut Sampler,
        cosine: f32,
    ) -> Option<DVec3> {
        let choice = sampler.next_1d();
        let u = sampler.next_2d();
        let n = normal.as_vec3();
        let w = if choice < cosine {
            Frame::from_normal(n).to_world(square_to_cosine_hemisphere(u))
        } else {
            let which = ((choice - cosine) / (1.0 - cosine) * PROPOSALS.len() as f32) as usize;
            let which = which.min(PROPOSALS.len() - 1);
            let exponent = exponent(PROPOSALS[which]) as f32;
            Frame::from_normal(mirror).to_world(square_to_power_cosine(u, exponent))
        };
        let cos = n.dot(w);
        if cos <= 0.0 {
            return None;
        }
        let powers = powers(mirror.dot(w));
        let lobes: f32 = PROPOSALS.iter().map(|&k| (exponent(k) as f32 + 1.0) / TAU * powers[k]).sum();
        let pdf = cosine * cos * FRAC_1_PI + (1.0 - cosine) / PROPOSALS.len() as f32 * lobes;
        let diffuse = cos * FRAC_1_PI / pdf;
        *plain *= diffuse;
        for (s, rungs) in SHARES.iter().zip(weights) {
            let lobe = s * cos / pdf;
            for k in 0..EXPONENTS {
                rungs[k] *= (1.0 - s) * diffuse + lobe * self.norms[k] * powers[k];
            }
        }
        Some(w.as_dvec3().normalize())
    }
}

/// A walk's weights times the two parts of f.
struct Weighted {
    plain: f32,
    diffuse: [Rungs; SHARES.len()],
    lobe: [Rungs; SHARES.len()],
}

impl Weighted {
    fn new(plain: f32, weights: &[Rungs; SHARES.len()]) -> Self {
        let times =
            |factor: fn(f32) -> f32| std::array::from_fn(|j| weights[j].map(|w| w * factor(SHARES[j])));
        Self { plain, diffuse: times(|s| 1.0 - s), lobe: times(|s| s) }
    }

    fn add(&self, to: &mut [f32], diffuse: f32, lobe: &Rungs) {
        let Some((first, rest)) = to.split_first_mut() else { return };
        *first += self.plain * diffuse;
        for ((to, d), l) in rest.chunks_exact_mut(EXPONENTS).zip(&self.diffuse).zip(&self.lobe) {
            for k in 0..EXPONENTS {
                to[k] += d[k] * diffuse + l[k] * lobe[k];
            }
        }
    }
}

fn first_order(to: &mut [f32], diffuse: f32, lobe: &Rungs, flat: bool) {
    to[0] += diffuse;
    if flat {
        // The flat base shades as one Phong lobe, which is added in closed form.
        to[1] += diffuse / FRAC_1_PI;
        return;
    }
    for (to, l) in to[2..].iter_mut().zip(lobe) {
        *to += l;
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

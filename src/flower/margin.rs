//! The rolled margin of a petal: straight facets that curl to the abaxial side and meet in pointed cusps.
//!
//! Model: mature petals of roses have a flat metric but want to bend along the radius everywhere; the two do not
//! fit together, so the rim becomes polygonal, its edges rolled about straight lines and its corners drawn out into
//! cusps (Zhang et al., Science 388:520, 2025). Here the lines are given instead of being solved for: each facet k
//! has a direction n_k in the flat petal, and what reaches beyond the line n_k . p = support(n_k) - w rolls about it.
//!
//! Equation, with o_k = max(0, n_k . p - support_k + w_k) and the excess e_k = max(0, o_k - c max over l of o_l):
//!
//! ```text
//! phi_k(x) = turn_k (x / w_k)^1.5,   forward_k = int_0^e cos phi dx,   down_k = int_0^e sin phi dx
//! p' = p + sum_k g_k n_k (forward_k - e_k),   down = sum_k g_k down_k,   g = softmax(e / sharpness)
//! ```
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | n | `direction_deg`, 0 = along the petal | deg | pairs of facets beside a cusp |
//! | w | `width_mm` | mm | by age |
//! | turn | `turn_deg` | deg | by age |
//! | sharpness: thinner petals have sharper cusps | `sharpness_mm` | mm | 1.2 |
//!
//! In the corner of two facets each gives up c = 0.35 of the other's part, or the two rolls would run into each other:
//! the cusp stays flat and stands out.
//!
//! Limits: arc length across a facet is kept (`rolling_keeps_length`); a corner is stretched, where a real petal has a fold. Where the lines lie is our
//! reading.

use glam::DVec2;

use crate::flower::outline::Outline;

/// One straight edge of the rim.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facet {
    /// Its direction in the flat petal, deg: 0 = along the petal, positive = to the left (-x).
    pub direction_deg: f64,
    /// Width of what rolls, mm.
    pub width_mm: f64,
    /// Turn of its edge to the abaxial side, deg.
    pub turn_deg: f64,
}

/// The rolled margin of one petal.
#[derive(Clone, Debug)]
pub struct Margin {
    edges: Vec<Edge>,
    sharpness_mm: f64,
}

#[derive(Clone, Copy, Debug)]
struct Edge {
    normal: DVec2,
    starts_mm: f64,
    width_mm: f64,
    turn: f64,
    depth_mm: f64,
}

/// Steps of the integral over a rolled margin.
const STEPS: u32 = 8;
/// Part of its excess that a facet gives up in the corner with another, where two rolls would run into each other.
const RELIEF: f64 = 0.35;
/// 1 - cos of the angle from which two facets have a corner between them: 40 deg.
const CORNER: f64 = 0.234;
/// What a margin keeps of its width where it has little space, before it rolls less.
const LEAST_WIDTH: f64 = 0.35;

impl Facet {
    /// The facet where it may stand off by `space_mm` only: first it gets narrower, then it turns less.
    pub fn within(self, space_mm: f64) -> Self {
        let depth_mm = |f: &Self| f.width_mm * depth(f.turn_deg.to_radians());
        let mut f = self;
        if depth_mm(&f) > space_mm {
            f.width_mm *= (space_mm / depth_mm(&f)).max(LEAST_WIDTH);
        }
        // Depth grows with the turn: halving finds the largest that fits.
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..24 {
            let part = 0.5 * (low + high);
            let fits = depth_mm(&Self { turn_deg: part * f.turn_deg, ..f }) <= space_mm;
            *if fits { &mut low } else { &mut high } = part;
        }
        f.turn_deg *= if depth_mm(&f) <= space_mm { 1.0 } else { low };
        f
    }
}

/// How far a margin of width 1 that turns by `turn` stands off.
fn depth(turn: f64) -> f64 {
    let edge = Edge { normal: DVec2::Y, starts_mm: 0.0, width_mm: 1.0, turn: turn.abs(), depth_mm: 1.0 };
    (1..=16).map(|k| edge.rolled(f64::from(k) / 16.0).1).fold(0.0, f64::max)
}

impl Margin {
    /// The margin of this petal.
    pub fn new(outline: &Outline, facets: &[Facet], sharpness_mm: f64) -> Self {
        let edges = facets
            .iter()
            .filter(|f| f.turn_deg.abs() > 1e-6 && f.width_mm > 1e-6)
            .map(|f| {
                let (sin, cos) = f.direction_deg.to_radians().sin_cos();
                let normal = DVec2::new(-sin, cos);
                Edge {
                    normal,
                    starts_mm: outline.support_mm(normal) - f.width_mm,
                    width_mm: f.width_mm,
                    turn: f.turn_deg.to_radians(),
                    depth_mm: f.width_mm * depth(f.turn_deg.to_radians()),
                }
            })
            .collect();
        Self { edges, sharpness_mm }
    }

    /// A point of the flat petal after rolling: its place over the flat petal and how far it stands off to the
    /// abaxial side, mm. `space_mm` says how far it may, at a point of the flat petal: where that is little the
    /// margin turns less, so that it does not fold under itself.
    pub fn roll(&self, p: DVec2, space_mm: impl Fn(DVec2) -> f64) -> (DVec2, f64) {
        let over = |e: &Edge| e.normal.dot(p) - e.starts_mm;
        if self.edges.iter().all(|e| over(e) <= 0.0) {
            return (p, 0.0);
        }
        // What a facet has of its excess beside the others.
        let excess = |k: usize, e: &Edge| {
            let taken = self.edges.iter().enumerate().filter(|(l, _)| *l != k).map(|(_, other)| {
                let x = over(other).max(0.0);
                let apart = (1.0 - e.normal.dot(other.normal)) / CORNER;
                RELIEF * apart.min(1.0) * x * x / (x + self.sharpness_mm)
            });
            (over(e) - taken.fold(0.0, f64::max)).max(0.0)
        };
        let most = self.edges.iter().enumerate().map(|(k, e)| excess(k, e)).fold(0.0, f64::max);
        let (mut weight, mut shift, mut down) = (0.0, DVec2::ZERO, 0.0);
        for (k, e) in self.edges.iter().enumerate() {
            let x = excess(k, e);
            let g = ((x - most) / self.sharpness_mm).exp();
            if g < 1e-4 {
                continue;
            }
            let room =
                if x > 0.0 { space_mm(p + (0.5 * e.width_mm - x) * e.normal) / e.depth_mm } else { 1.0 };
            let part = room / (1.0 + room.powi(4)).sqrt().sqrt();
            let (forward, below) = Edge { turn: part * e.turn, ..*e }.rolled(x);
            weight += g;
            shift += g * (forward - x) * e.normal;
            down += g * below;
        }
        (p + shift / weight, down / weight)
    }
}

impl Edge {
    /// (forward, down) of a margin rolled over the length `x`.
    fn rolled(&self, x: f64) -> (f64, f64) {
        let step = x / f64::from(STEPS);
        (0..STEPS).fold((0.0, 0.0), |(forward, down), k| {
            let t = (f64::from(k) + 0.5) * step / self.width_mm;
            let (sin, cos) = (self.turn * t * t.sqrt()).sin_cos();
            (forward + step * cos, down + step * sin)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outline() -> Outline {
        Outline {
            length_mm: 50.0,
            width_mm: 54.0,
            claw_width_mm: 9.0,
            widest: 0.6,
            tip_mm: 0.0,
            nicks_mm: 0.0,
            seed: 0,
        }
    }

    fn free(_: DVec2) -> f64 {
        1e3
    }

    fn facet(direction_deg: f64) -> Facet {
        Facet { direction_deg, width_mm: 10.0, turn_deg: 120.0 }
    }

    #[test]
    fn rolling_keeps_length() {
        let margin = Margin::new(&outline(), &[facet(0.0)], 1.0);
        let (mut length, mut last) = (0.0, margin.roll(DVec2::new(0.0, 38.0), free));
        for k in 1..=400 {
            let now = margin.roll(DVec2::new(0.0, 38.0 + 12.0 * f64::from(k) / 400.0), free);
            length += now.0.distance(last.0).hypot(now.1 - last.1);
            last = now;
        }
        assert!((length - 12.0).abs() < 0.05, "{length}");
        // The rim of a turn of 120 degrees has come back below the petal.
        assert!(last.1 > 3.0 && last.0.y < 48.0, "{last:?}");
    }

    #[test]
    fn a_cusp_stands_out_between_two_facets() {
        let margin = Margin::new(&outline(), &[facet(40.0), facet(-40.0)], 1.0);
        let rim = |u: f64| margin.roll(outline().at(u, 1.0), free);
        let middle_of_facet = rim(0.75);
        assert!(rim(0.5).1 < 0.6 * middle_of_facet.1, "{:?} {middle_of_facet:?}", rim(0.5));
    }
}

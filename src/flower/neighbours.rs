//! The space that a petal has between its neighbours.
//!
//! Model: every petal lies on its own layer of the [`Bloom`], t_j(azimuth) = layer_j + overlap turn_j, over the part of
//! the cup that its flat outline covers. At a place (azimuth, s) of petal i the nearest petals outside and inside are
//!
//! ```text
//! gap_out = min over j of (t_j - t_i) + far (1 - c_j)   over t_j > t_i,   gap_in likewise
//! ```
//!
//! where c_j falls from 1 to 0 over a band beyond the edge of petal j, so that gaps change smoothly, and `far` is the
//! gap where there is no neighbour. What a petal adds to its layer stays within its share of the gaps; shares of
//! neighbours add up to less than one, so petals do not meet. Guarded by `petals_do_not_cross`.
//!
//! Our reading.

use std::f64::consts::TAU;

use crate::flower::bloom::Bloom;
use crate::flower::outline::Outline;

/// Where a petal lies.
#[derive(Clone, Debug)]
pub struct Seat {
    /// Layer of its middle.
    pub layer: f64,
    /// Azimuth of its middle, radians.
    pub azimuth: f64,
    /// Its flat shape.
    pub outline: Outline,
}

/// The seats of all petals of a flower.
#[derive(Clone, Debug, Default)]
pub struct Neighbours {
    /// Petals from the innermost out.
    pub seats: Vec<Seat>,
}

/// Layers to the neighbours inside and outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaps {
    /// To the next petal inside.
    pub inside: f64,
    /// To the next petal outside.
    pub outside: f64,
}

/// Gap where there is no neighbour, layers.
const FAR: f64 = 6.0;
/// Band beyond the edge of a petal over which it stops to be a neighbour, mm.
const BAND_MM: [f64; 2] = [2.5, 9.0];

impl Neighbours {
    /// The gaps at a place of a petal: its layer there, azimuth in radians, arc length and radius of the cup in mm.
    pub fn gaps(&self, bloom: &Bloom, layer: f64, azimuth: f64, s_mm: f64, r_mm: f64) -> Gaps {
        let mut gaps = Gaps { inside: FAR, outside: FAR };
        for seat in &self.seats {
            let turn = (azimuth - seat.azimuth).rem_euclid(TAU);
            for turn in [turn - 2.0 * TAU, turn - TAU, turn, turn + TAU] {
                let gap = seat.layer + bloom.overlap() * turn - layer;
                if gap.abs() < 1e-6 || gap.abs() >= FAR {
                    continue;
                }
                let across = (turn * r_mm).abs();
                let beside = across - seat.outline.half_width_mm(s_mm / seat.outline.length_mm);
                let above = s_mm - seat.outline.rim_mm(across);
                let beyond = ((beside.max(above) - BAND_MM[0]) / (BAND_MM[1] - BAND_MM[0])).clamp(0.0, 1.0);
                let gap_is = gap.abs() + FAR * beyond * beyond * (3.0 - 2.0 * beyond);
                let side = if gap < 0.0 { &mut gaps.inside } else { &mut gaps.outside };
                *side = side.min(gap_is);
            }
        }
        gaps
    }
}

//! Where the light of each band went.
//!
//! Equation, in W (umol photons go the same way):
//!
//! ```text
//! emitted = escaped directly + absorbed (by kinds of organ and other shapes, on each side) + escaped + under way + error
//! ```
//!
//! It is the solution's ledger ([`crate::transport::radiosity::ledger`]), integrated over bands, times 1e-6 for mm2.
//! `emitted` is what the lights send into the sphere around the scene. Guarded by `groups_add_up_to_the_ledger`.

use super::{Readout, organ_of};
use crate::spectrum::Band;

/// What absorbed light, and how much.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Absorbed {
    /// Kind of organ, or the key of a shape or light that is none.
    pub what: String,
    /// Light that arrived on the adaxial and on the abaxial side, W.
    pub sides_w: [f64; 2],
}

/// The balance of one band.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Balance {
    /// The band.
    pub band: Band,
    /// What the lights send into the sphere around the scene, W.
    pub emitted_w: f64,
    /// What of it meets no surface, W.
    pub escaped_directly_w: f64,
    /// What surfaces absorb.
    pub absorbed: Vec<Absorbed>,
    /// What leaves the scene after it was scattered, W.
    pub escaped_w: f64,
    /// What was still under way when the iteration ended, W.
    pub under_way_w: f64,
    /// What is not accounted for, W.
    pub error_w: f64,
}

impl Balance {
    /// All that is absorbed, W.
    pub fn absorbed_w(&self) -> f64 {
        self.absorbed.iter().flat_map(|a| a.sides_w).sum()
    }

    /// What is not accounted for, in parts of what is emitted; 0 in the dark.
    pub fn closure(&self) -> f64 {
        if self.emitted_w > 0.0 { self.error_w / self.emitted_w } else { 0.0 }
    }
}

impl Readout<'_> {
    /// The balance of each band.
    pub fn balances(&self) -> Vec<Balance> {
        let ledger = self.radiosity.ledger();
        let error = ledger.error();
        (0..self.bands.len())
            .map(|b| {
                let watts = |values: &[f64]| 1e-6 * self.flux(b, |i| values[i])[0];
                let mut absorbed: Vec<Absorbed> = Vec::new();
                for (shape, sides) in self.scene.shapes.iter().zip(&ledger.absorbed) {
                    let what = if shape.organ.is_some() { organ_of(shape) } else { shape.key.as_str() };
                    let at = absorbed.iter().position(|a| a.what == what).unwrap_or_else(|| {
                        absorbed.push(Absorbed { what: what.to_owned(), sides_w: [0.0; 2] });
                        absorbed.len() - 1
                    });
                    for (sum, side) in absorbed[at].sides_w.iter_mut().zip(sides) {
                        *sum += watts(side);
                    }
                }
                Balance {
                    band: self.bands[b],
                    emitted_w: watts(&ledger.emitted),
                    escaped_directly_w: watts(&ledger.escaped_directly),
                    absorbed,
                    escaped_w: watts(&ledger.escaped),
                    under_way_w: watts(&ledger.under_way),
                    error_w: watts(&error),
                }
            })
            .collect()
    }
}

//! Where the light went.
//!
//! Equation, per wavelength, all in power per nm (spectral values of lights are W m-2 sr-1 nm-1, lengths mm: 1e-6 W nm-1):
//!
//! ```text
//! emitted = escaped_directly + absorbed (by every shape, on each side) + escaped + under_way + error
//! ```
//!
//! `emitted` and `escaped_directly` are counted at the lights, what arrives at the nodes at the nodes, so `error` is the
//! error of sampling direct light and of balancing the exchange: the sum is not closed by definition.
//! Guarded by `ledger_closes`. Source: conservation of energy.

/// Power per wavelength and per nm, in units of radiance times mm2 sr.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ledger {
    /// What the lights send into the sphere around the scene.
    pub emitted: Vec<f64>,
    /// What of it meets no surface.
    pub escaped_directly: Vec<f64>,
    /// What surfaces absorb: for each shape of the scene and each side (adaxial, abaxial) that the light arrived on, the
    /// values of all wavelengths.
    pub absorbed: Vec<[Vec<f64>; 2]>,
    /// What leaves the scene after it was scattered.
    pub escaped: Vec<f64>,
    /// What was still under way when the iteration ended.
    pub under_way: Vec<f64>,
}

impl Ledger {
    /// All that is absorbed, per wavelength.
    pub fn absorbed_total(&self) -> Vec<f64> {
        let mut sum = vec![0.0; self.emitted.len()];
        for side in self.absorbed.iter().flatten() {
            for (s, v) in sum.iter_mut().zip(side) {
                *s += v;
            }
        }
        sum
    }

    /// What is not accounted for, per wavelength: emitted less all the rest.
    pub fn error(&self) -> Vec<f64> {
        let absorbed = self.absorbed_total();
        (0..self.emitted.len())
            .map(|k| {
                self.emitted[k] - self.escaped_directly[k] - absorbed[k] - self.escaped[k] - self.under_way[k]
            })
            .collect()
    }
}

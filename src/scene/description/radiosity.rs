//! `[render.radiosity]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::spectrum::VISIBLE_NM;

/// `[render.radiosity]`: how the light among petals is solved for `integrator = "radiosity"` and `"hybrid"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RadiosityDescription {
    /// About how many elements at most, 1 to 5e7. Sheets that lie close together want elements as small
    /// as the gap between them. Default 100000.
    pub elements: u32,
    /// Rays from each side of an element to the others, 1 to 5e7; at least 3 are used. Default 36.
    pub rays: u32,
    /// Samples of every light for each side of an element in the mean, 1 to 5e7. Default 64.
    pub light_samples: u32,
    /// Wavelengths at which the light is solved for, evenly over 380 to 780 nm, 2 to 401. Default 32.
    pub wavelengths: u32,
    /// Orders of scattering are added until this share of the direct light is still under way, between 0 and 1.
    /// Default 1e-5.
    pub residual: f64,
    /// ... or until there are this many orders. Default 1000.
    pub max_orders: u32,
    /// `hybrid` traces through surfaces that are nearer to the last one than this many widths of an element, 0 to 1e6.
    /// Default 1.
    pub near: f64,
    /// Most memory of the solution, MiB. Default 8192.
    pub memory_mib: u64,
}

impl Default for RadiosityDescription {
    fn default() -> Self {
        Self {
            elements: 100_000,
            rays: 36,
            light_samples: 64,
            wavelengths: 32,
            residual: 1e-5,
            max_orders: 1000,
            near: 1.0,
            memory_mib: 8192,
        }
    }
}

impl RadiosityDescription {
    /// The wavelengths, nm.
    pub fn wavelengths_nm(&self) -> Vec<f32> {
        let (low, high) = VISIBLE_NM;
        let steps = self.wavelengths.max(2) - 1;
        (0..=steps).map(|i| low + (high - low) * i as f32 / steps as f32).collect()
    }
}

//! A sepal: a narrow pointed sheet under the petals, bent back when the flower is open.
//!
//! Model: half width(v) = width/2 (1 - v)^0.9 min(1.2, 0.55 + 1.9 v - 0.855 v^2), a lance with a broad base;
//! the midline starts at the receptacle's edge with the angle `start` from the axis and bends at a constant
//! rate to `end`; across, the sepal is a shallow trough.
//!
//! Sizes: five sepals, 2-4 cm long in hybrid teas (our reading).

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::flower::rose::check;
use crate::flower::sheet::Sheet;

/// The sepals.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SepalDescription {
    /// Number of sepals (default 5).
    pub count: u32,
    /// Length, mm (default 32).
    pub length_mm: f64,
    /// Width, mm (default 9).
    pub width_mm: f64,
    /// Angle from the flower's axis at the base, deg (default 95).
    pub start_deg: f64,
    /// Angle from the flower's axis at the tip, deg (default 165).
    pub end_deg: f64,
}

impl Default for SepalDescription {
    fn default() -> Self {
        Self { count: 5, length_mm: 32.0, width_mm: 9.0, start_deg: 95.0, end_deg: 165.0 }
    }
}

impl SepalDescription {
    /// Checks every key; `at` is the dotted path of this table.
    pub fn validate(&self, at: &str) -> Result<()> {
        check(at, "count", f64::from(self.count), 0.0, 20.0)?;
        check(at, "length_mm", self.length_mm, 1.0, 200.0)?;
        check(at, "width_mm", self.width_mm, 0.5, 100.0)?;
        check(at, "start_deg", self.start_deg, 0.0, 180.0)?;
        check(at, "end_deg", self.end_deg, 0.0, 180.0)
    }
}

/// The mid-surface of one sepal.
#[derive(Clone, Debug)]
pub struct SepalSurface {
    /// Sizes and angles.
    pub form: SepalDescription,
    /// Azimuth of its middle, deg.
    pub azimuth_deg: f64,
    /// Where it is attached: distance from the axis, mm.
    pub radius_mm: f64,
    /// Where it is attached: height, mm.
    pub height_mm: f64,
}

impl SepalSurface {
    /// Half width at `v`: broad at the base, drawn out into a point that ends blunt at a tenth of a millimetre.
    fn half_width_mm(&self, v: f64) -> f64 {
        let belly = (1.0 - v).powf(0.9) * (0.55 + 1.9 * v * (1.0 - 0.45 * v)).min(1.2);
        0.05 + 0.5 * self.form.width_mm * belly
    }

    fn flat(&self, u: f64, v: f64) -> DVec2 {
        DVec2::new((2.0 * u - 1.0) * self.half_width_mm(v), v * self.form.length_mm)
    }
}

impl Sheet for SepalSurface {
    fn at(&self, u: f64, v: f64) -> DVec3 {
        let p = self.flat(u, v);
        let (start, end) = (self.form.start_deg.to_radians(), self.form.end_deg.to_radians());
        let turn = (end - start) / self.form.length_mm;
        let heading = start + turn * p.y;
        // A circular arc; for a straight sepal its limit.
        let (out, up) = if turn.abs() < 1e-9 {
            (p.y * start.sin(), p.y * start.cos())
        } else {
            ((start.cos() - heading.cos()) / turn, (heading.sin() - start.sin()) / turn)
        };
        let trough = 0.35 * p.x * p.x / (0.5 * self.form.width_mm) * (PI * v).sin();
        let r = self.radius_mm + out - trough * heading.cos();
        let z = self.height_mm + up + trough * heading.sin();
        let (sin, cos) = self.azimuth_deg.to_radians().sin_cos();
        DVec3::new(r * cos - p.x * sin, r * sin + p.x * cos, z)
    }

    fn uv(&self, u: f64, v: f64) -> DVec2 {
        let p = self.flat(u, v);
        let [w, l] = self.uv_scale_mm().map(f64::from);
        DVec2::new(p.x / w + 0.5, p.y / l)
    }

    fn uv_scale_mm(&self) -> [f32; 2] {
        [1.25 * self.form.width_mm as f32, self.form.length_mm as f32]
    }
}

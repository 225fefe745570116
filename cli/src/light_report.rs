//! What `rosarium light` prints.

use std::fmt::Write;

use rosarium::io::light_table::SIDES;
use rosarium::io::sensors_csv::Reading;
use rosarium::transport::light::Balance;
use rosarium::transport::radiosity::Radiosity;
use rosarium::{Error, Result};
use serde_json::{Value, json};

use crate::progress::peak_memory;

/// What was computed, and how long it took.
pub(crate) struct Run {
    pub(crate) scene: String,
    pub(crate) unit_lx: f64,
    pub(crate) seconds: f64,
}

pub(crate) struct Report<'a> {
    pub(crate) run: Run,
    pub(crate) solution: &'a Radiosity,
    pub(crate) balances: Vec<Balance>,
    pub(crate) readings: &'a [Reading],
    pub(crate) warnings: Vec<String>,
}

impl Report<'_> {
    pub(crate) fn text(&self, json: bool) -> Result<String> {
        if !json {
            return Ok(self.lines());
        }
        let mut text =
            serde_json::to_string(&self.json()).map_err(|e| Error::invalid("--json", e.to_string()))?;
        text.push('\n');
        Ok(text)
    }

    fn lines(&self) -> String {
        let r = self.solution;
        let mut out = String::new();
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "{}: {} facets in {} elements, {} form factors, {} wavelengths",
            self.run.scene,
            r.elements().facets().len(),
            r.elements().len(),
            r.entries(),
            r.wavelengths_nm().len()
        );
        let memory = peak_memory().map_or(String::new(), |b| format!(", peak memory {} MiB", b >> 20));
        let _ = writeln!(
            out,
            "{} after {} orders, residual {:.1e}, {:.1} s{memory}",
            if r.converged() { "converged" } else { "not converged" },
            r.orders(),
            r.residual(),
            self.run.seconds
        );
        for b in &self.balances {
            self.balance(&mut out, b);
        }
        for r in self.readings {
            for (b, reading) in self.balances.iter().zip(&r.bands) {
                let [w, umol] = [0, 1].map(|u| (reading.irradiance[u], reading.standard_error[u]));
                let _ = writeln!(
                    out,
                    "sensor {}, {} nm: {:.5} \u{b1} {:.2} W/m2, {:.5} \u{b1} {:.2} umol/m2/s, {:.0} % straight from the lights",
                    r.sensor.name,
                    b.band,
                    Short(w.0),
                    Short(w.1),
                    Short(umol.0),
                    Short(umol.1),
                    100.0 * reading.direct[0] / w.0.max(1e-300)
                );
            }
        }
        out
    }

    fn balance(&self, out: &mut String, b: &Balance) {
        let _ = writeln!(out, "\n{:<42}{:>12}{:>12}", format!("{} nm", b.band), "W", "of emitted");
        let mut line = |name: &str, watts: f64| {
            let share = if b.emitted_w > 0.0 { 100.0 * watts / b.emitted_w } else { 0.0 };
            let _ = writeln!(out, "{name:<42}{:>12}{share:>10.3} %", format!("{:.5}", Short(watts)));
        };
        line("emitted into the sphere around the scene", b.emitted_w);
        line("escaped directly", b.escaped_directly_w);
        for a in &b.absorbed {
            for (side, watts) in SIDES.iter().zip(a.sides_w) {
                line(&format!("absorbed by {}, {side}", a.what), watts);
            }
        }
        line("absorbed by all", b.absorbed_w());
        line("escaped after scattering", b.escaped_w);
        line("under way", b.under_way_w);
        line("not accounted for", b.error_w);
        let _ = writeln!(out, "closure: {:.1e} of emitted", b.closure());
    }

    fn json(&self) -> Value {
        let r = self.solution;
        let bands: Vec<Value> = self
            .balances
            .iter()
            .map(|b| {
                let absorbed: Vec<Value> = b
                    .absorbed
                    .iter()
                    .map(|a| json!({ "what": a.what, "adaxial_w": a.sides_w[0], "abaxial_w": a.sides_w[1] }))
                    .collect();
                json!({
                    "low_nm": b.band.low_nm, "high_nm": b.band.high_nm, "emitted_w": b.emitted_w,
                    "escaped_directly_w": b.escaped_directly_w, "absorbed": absorbed,
                    "absorbed_w": b.absorbed_w(), "escaped_w": b.escaped_w, "under_way_w": b.under_way_w,
                    "error_w": b.error_w, "closure": b.closure(),
                })
            })
            .collect();
        let sensors: Vec<Value> = self
            .readings
            .iter()
            .map(|r| {
                let bands: Vec<Value> = r
                    .bands
                    .iter()
                    .map(|b| {
                        json!({
                            "irradiance_w_m2": b.irradiance[0], "irradiance_w_m2_se": b.standard_error[0],
                            "direct_w_m2": b.direct[0], "irradiance_umol_m2_s": b.irradiance[1],
                            "irradiance_umol_m2_s_se": b.standard_error[1], "direct_umol_m2_s": b.direct[1],
                        })
                    })
                    .collect();
                let (p, n) = (r.sensor.position_mm.to_array(), r.sensor.normal.to_array());
                json!({ "name": r.sensor.name, "position_mm": p, "normal": n, "bands": bands })
            })
            .collect();
        json!({
            "scene": self.run.scene, "unit_lx": self.run.unit_lx, "facets": r.elements().facets().len(),
            "elements": r.elements().len(), "form_factors": r.entries(), "wavelengths_nm": r.wavelengths_nm(),
            "converged": r.converged(), "orders": r.orders(), "residual": r.residual(),
            "seconds": self.run.seconds, "bands": bands, "sensors": sensors, "warnings": self.warnings,
        })
    }
}

/// A number with so many digits in all as its precision says.
struct Short(f64);

impl std::fmt::Display for Short {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let digits = f.precision().unwrap_or(3);
        if self.0 == 0.0 || !self.0.is_finite() {
            return write!(f, "{}", self.0);
        }
        let exponent = self.0.abs().log10().floor();
        if !(-4.0..9.0).contains(&exponent) {
            return write!(f, "{:.*e}", digits.saturating_sub(1), self.0);
        }
        let decimals = (digits as f64 - 1.0 - exponent).max(0.0) as usize;
        write!(f, "{:.decimals$}", self.0)
    }
}

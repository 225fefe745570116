//! What the fits found, and what is true, as tables.

use rosarium::io::figure_page::Table;
use rosarium::scene::description::PetalDescription;
use rosarium::scene::{MemoryAssets, load, petal};
use rosarium::{Error, Result};
use serde_json::Value;

use super::sections::KNOWN_PETAL;

/// A report that `fit` wrote.
pub(super) fn report(file: &str, bytes: &[u8]) -> Result<Value> {
    serde_json::from_slice(bytes).map_err(|e| Error::invalid(file, e.to_string()))
}

/// How far the models are from the readings.
pub(super) fn residuals(caption: &str, reports: &[Value]) -> Table {
    let rows = reports.iter().flat_map(|r| r["fits"].as_array().into_iter().flatten());
    let number = |fit: &Value, key: &str, digits: usize| {
        fit[key].as_f64().map_or("–".to_owned(), |v| format!("{v:.digits$}"))
    };
    Table {
        caption: caption.to_owned(),
        head: ["model", "parameters", "readings", "RMSE, 1/sr", "RMSE, cube root", "R²"]
            .map(str::to_owned)
            .to_vec(),
        rows: rows
            .map(|fit| {
                vec![
                    fit["model"].as_str().unwrap_or_default().to_owned(),
                    fit["varied"].to_string(),
                    fit["n"].to_string(),
                    number(fit, "rmse_per_sr", 6),
                    number(fit, "rmse_cube_root", 5),
                    number(fit, "r2", 4),
                ]
            })
            .collect(),
    }
}

/// Parameters of the cell model: what the table was made with, and what the fit found.
pub(super) fn parameters(report: &Value) -> Result<Table> {
    let truth = Truth::new()?;
    let bands: Vec<f64> = report["data"]["bands"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(|b| b["wavelength_nm"].as_f64())
        .collect();
    let mut rows = Vec::new();
    for p in report["fits"][0]["parameters"].as_array().into_iter().flatten() {
        let nm = p["band"].as_u64().and_then(|b| bands.get(b as usize).copied());
        let (Some(name), Some(found)) = (p["parameter"].as_str(), p["value"].as_f64()) else { continue };
        let Some(known) = truth.of(name, nm) else { continue };
        let (error, deviation) = match p["standard_error"].as_f64() {
            Some(e) if e > 0.0 => (format!("{e:.5}"), format!("{:+.1}", (found - known) / e)),
            _ if p["state"].as_str().is_some_and(|s| s.starts_with("at_")) => {
                ("at its bound".to_owned(), "–".to_owned())
            }
            _ => ("not determined".to_owned(), "–".to_owned()),
        };
        let label = p["name"].as_str().unwrap_or(name).to_owned();
        rows.push(vec![label, format!("{known:.5}"), format!("{found:.5}"), error, deviation]);
    }
    Ok(Table {
        caption: "Parameters of the cell model: those that the synthetic table was made with, and those that the fit found."
            .to_owned(),
        head: ["parameter", "known", "found", "standard error", "(found − known) / error"].map(str::to_owned).to_vec(),
        rows,
    })
}

/// The petal of the synthetic table.
struct Truth([rosarium::micro::shading::Layer; 2]);

impl Truth {
    fn new() -> Result<Self> {
        let text = petal::preset(KNOWN_PETAL).unwrap_or_default();
        let known = load::<PetalDescription>(text, KNOWN_PETAL, &[])?.description;
        Ok(Self(known.layers("", &MemoryAssets::default())?))
    }

    /// Value of a parameter of the fit, at a wavelength where it has one.
    fn of(&self, parameter: &str, nm: Option<f64>) -> Option<f64> {
        let (what, layer) = parameter.split_once('_')?;
        let layer = &self.0[usize::from(layer == "S")];
        let value = match (what, nm) {
            ("n", _) => layer.exponent,
            ("kd", Some(nm)) => layer.diffuse.at(nm as f32),
            ("ks", Some(nm)) => layer.specular.at(nm as f32),
            _ => return None,
        };
        Some(f64::from(value))
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_truth_is_the_presets() {
        let truth = Truth::new().unwrap();
        assert_eq!(truth.of("n_E", None), Some(20.0));
        assert_eq!(truth.of("n_S", None), Some(2.0));
        // The highlight is not coloured; what comes from below crosses the pigment twice, so red is left.
        assert!((truth.of("ks_E", Some(550.0)).unwrap() - 0.031).abs() < 1e-6);
        let [green, red] = [550.0, 650.0].map(|nm| truth.of("kd_S", Some(nm)).unwrap());
        assert!(green < 0.01 * red && red < 0.18, "{green} {red}");
        assert_eq!(truth.of("height_um", None), None);
    }

    #[test]
    fn found_and_known_stand_side_by_side() {
        let report = json!({
            "data": { "bands": [{ "wavelength_nm": 650.0 }] },
            "fits": [{ "model": "terado", "varied": 2, "n": 9, "rmse_per_sr": 0.5, "r2": null, "parameters": [
                { "name": "n_E", "parameter": "n_E", "band": null, "value": 21.0, "standard_error": 0.5, "state": "free" },
                { "name": "ks_S[650 nm]", "parameter": "ks_S", "band": 0, "value": 0.0, "standard_error": null, "state": "at_lower" },
            ] }],
        });
        let table = parameters(&report).unwrap();
        assert_eq!(table.rows[0], ["n_E", "20.00000", "21.00000", "0.50000", "+2.0"]);
        assert_eq!(table.rows[1][3..], ["at its bound", "–"]);
        let table = residuals("", &[report]);
        assert_eq!(table.rows, [["terado", "2", "9", "0.500000", "–", "–"]]);
        assert!(report_of_nonsense().is_err());
    }

    fn report_of_nonsense() -> Result<Value> {
        super::report("a.json", b"{")
    }
}

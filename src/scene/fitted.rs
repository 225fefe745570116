//! From a fit to a petal file: the coefficients that explain a laboratory's readings, for `render` and `measure`.
//!
//! | model | petal |
//! |---|---|
//! | `terado` | kd_E, ks_E, n_E on the domes; kd_S, ks_S, n_S on the base; no transmission |
//! | `terado+transmission` | the same with t, td, m_d, ti, m_i and rho_ab |
//! | `lambert`, `phong`, `lambert+phong` | flat cells that carry kd, ks, n |
//!
//! Fitted coefficients are what leaves the petal, its pigment included, so the file has no pigment of its own; several
//! bands become a spectrum that is linear between them and constant beyond. What was not measured is our reading: the
//! lower side is a Lambertian surface that returns what the upper one returns diffusely, as far as transmission leaves it.
//! Guarded by `the_petal_is_what_was_fitted`, `what_cannot_be_a_petal_says_why`.

use std::fmt::Write as _;

use super::MemoryAssets;
use super::description::{PetalDescription, SpectrumDescription};
use crate::fit::report::DataInfo;
use crate::fit::{Fit, State};
use crate::gonio::{Band, Measurement, Scale};
use crate::micro::{CellDescription, Profile};
use crate::{Error, Result};

/// The petal of a fit to `data`; `cells` are those that the cell model was made with. Shapes that were fitted replace
/// theirs. Errors where the model has no petal, the bands no wavelengths, or the shares more than all light.
pub fn petal(fit: &Fit, data: &Measurement, cells: &CellDescription) -> Result<PetalDescription> {
    let spectra = Spectra { fit, bands: &data.bands };
    let shape = |name: &str| fit.parameters.iter().find(|p| p.parameter == name).map(|p| p.value);
    let mut petal = PetalDescription::default();
    petal.shading.anthocyanin_ug_per_cm2 = 0.0;
    petal.shading.anthocyanin_abaxial_ug_per_cm2 = 0.0;
    petal.cells = cells.clone();
    let (e, s) = (&mut petal.shading.epidermis, &mut petal.shading.spongy);
    let exponent = |name: &str, default: f64| shape(name).unwrap_or(default);
    match fit.model.as_str() {
        "terado" | "terado+transmission" => {
            e.diffuse = spectra.of("kd_E")?;
            e.specular = spectra.of("ks_E")?;
            e.exponent = exponent("n_E", e.exponent);
            s.diffuse = spectra.of("kd_S")?;
            s.specular = spectra.of("ks_S")?;
            s.exponent = exponent("n_S", s.exponent);
            let cells = &mut petal.cells;
            cells.height_um = exponent("height_um", cells.height_um);
            cells.center_disorder = exponent("center_disorder", cells.center_disorder);
            cells.height_disorder = exponent("height_disorder", cells.height_disorder);
        }
        "lambert" | "phong" | "lambert+phong" => {
            petal.cells.profile = Profile::Flat;
            e.diffuse = spectra.of("kd")?;
            e.specular = spectra.of("ks")?;
            e.exponent = exponent("n", e.exponent);
            s.diffuse = SpectrumDescription::Constant(0.0);
            s.specular = SpectrumDescription::Constant(0.0);
        }
        other => {
            let what = format!(
                "`{other}` is no model of a petal; lambert, phong, lambert+phong, terado and terado+transmission are"
            );
            return Err(Error::invalid("--model", what));
        }
    }
    e.transmittance = SpectrumDescription::Constant(1.0);
    s.transmittance = spectra.of("t")?;
    let through = &mut petal.shading.transmission;
    through.direct = spectra.of("td")?;
    through.direct_exponent = exponent("m_d", through.direct_exponent);
    through.indirect = spectra.of("ti")?;
    through.indirect_exponent = exponent("m_i", through.indirect_exponent);
    petal.shading.abaxial = if spectra.has("rho_ab") {
        spectra.of("rho_ab")?
    } else {
        spectra.map(|value| {
            let through = value("t") + value("td") + value("ti");
            (value("kd_E") + value("kd_S") + value("kd")).min((1.0 - through).max(0.0))
        })?
    };
    petal.compile("", &MemoryAssets::default()).map_err(|e| {
        let scale = if data.scale == Scale::RelativePerSeries {
            " (the table has no scale of its own: `--fix gain[NAME]=G` sets it)"
        } else {
            ""
        };
        Error::invalid("--output", format!("the fitted coefficients are no petal{scale}: {e}"))
    })?;
    Ok(petal)
}

/// The file: where the numbers come from as comments, then the petal.
pub fn to_toml(
    petal: &PetalDescription,
    fit: &Fit,
    data: &DataInfo,
    command: Option<&str>,
) -> Result<String> {
    let mut out = String::from("# A petal fitted to measured light.\n#\n");
    // A newline in a name must not end the comment.
    let line = |text: &str| text.replace(['\n', '\r'], " ");
    let mut say = |text: String| {
        // Writing to a String cannot fail.
        let _ = writeln!(out, "# {}", line(&text));
    };
    say(format!("data    {}", data.file));
    say(format!("sha256  {}", data.sha256));
    if !data.sample.is_empty() {
        say(format!("sample  {}", data.sample));
    }
    if let Some(command) = command {
        say(format!("command {command}"));
    }
    let reduced = fit.reduced_chi2.map_or(String::new(), |v| format!(", reduced chi2 {v:.4e}"));
    say(format!("model   {}, {} readings{reduced}, RMSE {:.3e} 1/sr", fit.model, fit.n, fit.rmse_per_sr));
    for p in &fit.parameters {
        let error = match (p.state, p.standard_error) {
            (_, Some(e)) => format!(" +/- {e:.2e}"),
            (State::Fixed, _) => " (fixed)".to_owned(),
            (State::Tied, _) => format!(" (= {})", p.tie.as_deref().unwrap_or("tied")),
            (State::AtLower | State::AtUpper, _) => " (at its bound)".to_owned(),
            _ => " (not determined by the data)".to_owned(),
        };
        say(format!("        {} = {:.6}{error}", p.name, p.value));
    }
    if data.scale == Scale::RelativePerSeries {
        say("The table's scale is unknown: shares are relative to the first series' gain.".to_owned());
    }
    say("Where transmission or the lower side were not measured, see the manual: they are assumed."
        .to_owned());
    let body = toml::to_string(petal).map_err(|e| Error::Unsupported(format!("this petal as TOML: {e}")))?;
    out.push('\n');
    out.push_str(&body);
    Ok(out)
}

/// Coefficients by band.
struct Spectra<'a> {
    fit: &'a Fit,
    bands: &'a [Band],
}

impl Spectra<'_> {
    fn has(&self, name: &str) -> bool {
        self.fit.parameters.iter().any(|p| p.parameter == name)
    }

    fn value(&self, name: &str, band: usize) -> f64 {
        let own = |p: &&crate::fit::Fitted| p.parameter == name && p.band.is_none_or(|b| b == band);
        self.fit.parameters.iter().find(own).map_or(0.0, |p| p.value)
    }

    /// A coefficient; zero where the model has none of that name.
    fn of(&self, name: &str) -> Result<SpectrumDescription> {
        self.map(|value| value(name))
    }

    /// A number made of the coefficients, which are asked for by name, band by band.
    fn map(&self, f: impl Fn(&dyn Fn(&str) -> f64) -> f64) -> Result<SpectrumDescription> {
        let at = |band: usize| f(&|name| self.value(name, band));
        if self.bands.len() == 1 {
            return Ok(SpectrumDescription::Constant(at(0)));
        }
        let mut points = self
            .bands
            .iter()
            .enumerate()
            .map(|(i, b)| Some((b.wavelength_nm?, at(i))))
            .collect::<Option<Vec<_>>>()
            .ok_or_else(|| {
                let names: Vec<&str> = self.bands.iter().map(|b| b.name.as_str()).collect();
                let what =
                    format!("bands without a wavelength ({}) make no spectrum; choose one", names.join(", "));
                Error::invalid("--band", what)
            })?;
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        if points.iter().all(|p| p.1 == points[0].1) {
            return Ok(SpectrumDescription::Constant(points[0].1));
        }
        Ok(SpectrumDescription::points(&points))
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::fit::{self, Geometry, Options, models};
    use crate::gonio::Reading;
    use crate::gonio::measurement::direction_deg;
    use crate::scene::load;

    /// Readings without noise of a model, at three bands.
    fn readings(name: &str, by_band: [&[f64]; 3]) -> Measurement {
        let model = models::by_name(name).unwrap();
        let pairs: Vec<_> = [20.0, 40.0, 60.0]
            .into_iter()
            .flat_map(|ti| (0..8).map(move |i| (ti, f64::from(i))))
            .flat_map(|(ti, i)| {
                [0.0, 90.0, 180.0].map(|phi| (direction_deg(ti, 0.0), direction_deg(10.0 * i, phi)))
            })
            .collect();
        let geometries: Vec<Geometry> = pairs.iter().map(|&(a, b)| Geometry::point(a, b)).collect();
        let prepared = model.prepare(&geometries).unwrap();
        let mut all = Vec::new();
        for (band, p) in by_band.iter().enumerate() {
            let mut values = vec![0.0; pairs.len()];
            prepared.eval(p, &mut values, None);
            all.extend(pairs.iter().zip(&values).map(|(&(wi, wo), &bsdf_per_sr)| Reading {
                wi,
                wo,
                series: 0,
                band: band as u32,
                bsdf_per_sr,
                sigma_per_sr: None,
            }));
        }
        Measurement {
            sample: "synthetic".into(),
            // Not in the order of their wavelengths.
            bands: vec![Band::nm(650.0), Band::nm(450.0), Band::nm(550.0)],
            series: vec!["a".into()],
            readings: all,
            ..Default::default()
        }
    }

    fn fitted(name: &str, m: &Measurement) -> Fit {
        let model = models::by_name(name).unwrap();
        fit::fit(&*model, m, &Options::default(), &|_, _| ControlFlow::Continue(())).unwrap()
    }

    #[test]
    fn the_petal_is_what_was_fitted() {
        let m = readings("lambert+phong", [&[0.4, 0.1, 12.0], &[0.05, 0.1, 12.0], &[0.2, 0.1, 12.0]]);
        let fit = fitted("lambert+phong", &m);
        let info = DataInfo::new("t.csv", b"abc", "bsdf", &m);
        let petal = petal(&fit, &m, &CellDescription::default()).unwrap();
        let text = to_toml(&petal, &fit, &info, Some("rosarium fit\nt.csv")).unwrap();
        // SHA-256 of "abc", FIPS 180-2.
        assert!(text.contains("ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"), "{text}");
        let back: PetalDescription = load(&text, "petal.toml", &[]).unwrap().description;
        assert_eq!(back, petal);
        assert_eq!(back.cells.profile, Profile::Flat);
        let SpectrumDescription::Table(table) = &back.shading.epidermis.diffuse else { panic!("{text}") };
        assert_eq!(table.wavelengths_nm.as_deref(), Some(&[450.0, 550.0, 650.0][..]));
        for (found, wanted) in table.values.as_deref().unwrap().iter().zip([0.05, 0.2, 0.4]) {
            assert!((found - wanted).abs() < 1e-6, "{table:?}");
        }
        assert!((back.shading.epidermis.exponent - 12.0).abs() < 1e-4);
    }

    #[test]
    fn what_cannot_be_a_petal_says_why() {
        let cells = CellDescription::default();
        let m = readings("blinn", [&[0.3, 0.1, 12.0]; 3]);
        let e = petal(&fitted("blinn", &m), &m, &cells).unwrap_err().to_string();
        assert!(e.contains("`blinn` is no model of a petal"), "{e}");
        let bright = readings("lambert+phong", [&[0.8, 0.7, 12.0]; 3]);
        let e = petal(&fitted("lambert+phong", &bright), &bright, &cells).unwrap_err().to_string();
        assert!(e.contains("no petal") && e.contains("sum to 1.5"), "{e}");
        let mut named = readings("lambert+phong", [&[0.3, 0.1, 12.0], &[0.2, 0.1, 12.0], &[0.2, 0.1, 12.0]]);
        named.bands = ["R", "G", "B"].map(Band::named).to_vec();
        let e = petal(&fitted("lambert+phong", &named), &named, &cells).unwrap_err().to_string();
        assert!(e.contains("bands without a wavelength (R, G, B)"), "{e}");
    }
}

//! What `measure --spectral` adds: spectra as files, colours of both sides.

use std::fmt::Write;

use rosarium::Result;
use rosarium::geometry::Side;
use rosarium::gonio::table::Summary;
use rosarium::gonio::{GonioTable, HemisphericalSpectrum, PetalColors};
use rosarium::io::{spectra_csv, spectra_plot};
use rosarium::spectrum::object_color::ObjectColor;
use rosarium::spectrum::{Illuminant, Observer};
use serde::Serialize;

use crate::output::Output;
use crate::{Global, progress};

/// Spectra of the tables, and their colours where the bands tell them.
pub(crate) struct Spectral {
    illuminant: Illuminant,
    spectra: Vec<HemisphericalSpectrum>,
    /// Or why there are none.
    colors: Result<Vec<PetalColors>, String>,
}

/// `--json` with `--spectral`.
#[derive(Serialize)]
pub(crate) struct Report {
    illuminant: String,
    /// Colours of each side and angle; null where the bands do not cover the visible range.
    colors: Option<Vec<PetalColors>>,
    /// One per side.
    measurements: Vec<Summary>,
}

/// `adaxial` or `abaxial`.
pub(crate) fn side_name(side: Side) -> &'static str {
    match side {
        Side::Adaxial => "adaxial",
        Side::Abaxial => "abaxial",
    }
}

impl Spectral {
    pub(crate) fn new(tables: &[GonioTable], illuminant: Illuminant) -> Result<Self> {
        illuminant.spectrum()?;
        let spectra = HemisphericalSpectrum::of_tables(tables);
        let colors = spectra
            .iter()
            .map(|s| s.colors(illuminant, Observer::Cie1931))
            .collect::<Result<Vec<_>>>()
            .map_err(|e| e.to_string());
        Ok(Self { illuminant, spectra, colors })
    }

    /// Writes the spectra to each of the files.
    pub(crate) fn write(&self, outputs: &[Output], name: &str, global: Global) -> Result<()> {
        for output in outputs {
            let bytes = match output.format {
                "csv" => spectra_csv::write(&self.spectra, name)?.into_bytes(),
                "svg" => spectra_plot::of_spectra(&self.spectra, name)?.svg().into_bytes(),
                _ => spectra_plot::of_spectra(&self.spectra, name)?.png()?,
            };
            output.write(&bytes)?;
            progress::say(global, &format!("{}: spectra", output.path().display()));
        }
        Ok(())
    }

    pub(crate) fn summary(&self, tables: &[GonioTable]) -> Report {
        Report {
            illuminant: self.illuminant.to_string(),
            colors: self.colors.as_ref().ok().cloned(),
            measurements: tables.iter().map(GonioTable::summary).collect(),
        }
    }

    /// The colours as a table. Writing to a String cannot fail.
    pub(crate) fn for_people(&self) -> String {
        let mut out = String::new();
        let colors = match &self.colors {
            Ok(colors) => colors,
            Err(why) => {
                let _ = writeln!(out, "\n{why}");
                return out;
            }
        };
        let _ =
            writeln!(out, "\ncolours in {} (CIE 1931; white has Y = 100; * beyond sRGB)\n", self.illuminant);
        let _ = writeln!(
            out,
            "{:<18} {:<12} {:>6} {:>6} {:>6}   {:>6} {:>6} {:>6}   sRGB",
            "lit side, lamp", "light", "X", "Y", "Z", "L*", "a*", "b*"
        );
        for c in colors {
            let lit = format!("{} {:>2} deg", side_name(c.side), c.incident_deg);
            for (light, color) in [("reflected", &c.reflected), ("transmitted", &c.transmitted)] {
                let ObjectColor { xyz: [x, y, z], lab: [l, a, b], srgb_hex, in_srgb } = color;
                let mark = if *in_srgb { "" } else { " *" };
                let _ = writeln!(
                    out,
                    "{lit:<18} {light:<12} {x:>6.2} {y:>6.2} {z:>6.2}   {l:>6.2} {a:>6.2} {b:>6.2}   {srgb_hex}{mark}"
                );
            }
        }
        out
    }
}

//! Measured BSDFs of any format: recognised by their first bytes, read as readings or as a function.
//!
//! | bytes | format | read as |
//! |---|---|---|
//! | `rosaopti` | `petal.optics` | function of any wavelengths |
//! | `tensor_file` | RGL `.bsdf` | function |
//! | three integers 90, 90, 180 | MERL `.binary` | function |
//! | 3 x 288 x 288 doubles | UTIA `.bin` | function |
//! | `<` | Radiance/WINDOW XML | function |
//! | text with `ScatterType` or `AngleOfIncidence` | Zemax `.bsdf` | readings |
//! | text with `#format:` or `#intheta` | pab pgII | readings |
//! | text that begins with `## Rosarium goniometer table` | `measure`'s table | its bins as readings, or a function |
//! | any other text | CSV | readings |

use super::csv_options::CsvOptions;
use super::{gonio_csv, invalid, merl, petal_optics, pgii, readings_csv, rgl, utia, window_xml, zemax};
use crate::Result;
use crate::gonio::tabulated::OpticsAtBands;
use crate::gonio::{
    Directional, ExitantGrid, GonioTable, Interpolant, Measurement, OneSided, PetalOptics, readings,
};

/// Lamp angles at which a function becomes readings, degrees: what goniometers usually take.
pub const INCIDENT_DEG: [f64; 6] = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0];

/// Wavelengths of a petal for all of them, where nobody asks for others, nm.
pub const WAVELENGTHS_NM: [f64; 3] = [450.0, 550.0, 650.0];

/// What a file holds.
pub enum Measured {
    /// Numbers at given directions.
    Readings(Measurement),
    /// What the virtual goniophotometer measured, with its totals.
    Table(GonioTable),
    /// A petal for all wavelengths.
    Optics(Box<PetalOptics>),
    /// A table that is asked for any directions.
    Function(Box<dyn Directional>),
}

/// Name of the format that these bytes seem to be.
pub fn format(bytes: &[u8]) -> &'static str {
    let head = &bytes[..bytes.len().min(4096)];
    let text = String::from_utf8_lossy(head);
    let has = |word: &str| text.contains(word);
    if petal_optics::is_petal_optics(head) {
        "petal.optics"
    } else if head.starts_with(b"tensor_file\0") {
        "RGL"
    } else if head.starts_with(&[90, 0, 0, 0, 90, 0, 0, 0, 180, 0, 0, 0]) {
        "MERL"
    } else if bytes.len() == utia::BYTES {
        "UTIA"
    } else if text.trim_start_matches('\u{feff}').trim_start().starts_with('<') {
        "Radiance XML"
    } else if has("ScatterType") || has("AngleOfIncidence") {
        "Zemax"
    } else if text.trim_start_matches(['#', ' ']).starts_with("Rosarium goniometer table") {
        "goniometer table"
    } else if text.lines().any(|l| l.starts_with("#format:") || l.starts_with("#intheta")) {
        "pgII"
    } else {
        "CSV"
    }
}

/// Reads a file; `name` stands in errors. `options` are for CSV, the only format that does not say what it holds.
pub fn read(bytes: &[u8], name: &str, options: &CsvOptions) -> Result<Measured> {
    Ok(match format(bytes) {
        "petal.optics" => Measured::Optics(Box::new(petal_optics::read(bytes)?)),
        "RGL" => Measured::Function(Box::new(rgl::read(bytes)?)),
        "MERL" => Measured::Function(Box::new(merl::read(bytes)?)),
        "UTIA" => Measured::Function(Box::new(utia::read(bytes)?)),
        "Radiance XML" => Measured::Function(Box::new(window_xml::read(bytes, name)?)),
        "Zemax" => Measured::Readings(zemax::read(bytes, name)?),
        "goniometer table" => Measured::Table(gonio_csv::read(bytes, name)?),
        "pgII" => Measured::Readings(pgii::read(bytes, name)?),
        _ => Measured::Readings(readings_csv::read(bytes, name, options)?),
    })
}

impl Measured {
    /// A petal for all wavelengths as a function at the given ones, nm; anything else as it is.
    pub fn at_wavelengths(self, wavelengths_nm: &[f64]) -> Result<Self> {
        Ok(match self {
            Measured::Optics(optics) => {
                Measured::Function(Box::new(OpticsAtBands::new(&optics, wavelengths_nm)?))
            }
            other => other,
        })
    }

    /// The readings; of a function, those at the bin centres of the default grid for lamps at [`INCIDENT_DEG`].
    pub fn into_readings(self) -> Result<Measurement> {
        let measurement = match self {
            Measured::Readings(m) => m,
            Measured::Table(t) => t.to_measurement(),
            Measured::Optics(_) => return self.at_wavelengths(&WAVELENGTHS_NM)?.into_readings(),
            Measured::Function(f) => readings::sample(&*f, &INCIDENT_DEG, &ExitantGrid::default())?,
        };
        if measurement.readings.is_empty() {
            return Err(invalid("measured data", "the file has no readings"));
        }
        Ok(measurement)
    }

    /// A function of two directions; readings are interpolated.
    pub fn into_function(self) -> Result<Box<dyn Directional>> {
        Ok(match self {
            Measured::Readings(m) => Box::new(Interpolant::new(&m)?),
            Measured::Table(t) => Box::new(OneSided::new(t)),
            Measured::Optics(optics) => Box::new(OpticsAtBands::new(&optics, &WAVELENGTHS_NM)?),
            Measured::Function(f) => f,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::bsdf::Lambert;
    use crate::gonio::Goniophotometer;
    use crate::gonio::directional::tests::Sheet;
    use crate::io::window_xml_write;

    #[test]
    fn formats_are_known_by_their_bytes() {
        let sheet = Sheet::new(0.4, 0.1, 0.3);
        let gonio = Goniophotometer {
            rays: 1000,
            exitant: ExitantGrid { theta_step_deg: 30.0, phi_step_deg: 60.0 },
            ..Default::default()
        };
        let lambert = Lambert::new(0.5.into()).unwrap();
        let table = gonio.measure(&lambert, &|_, _| ControlFlow::Continue(())).unwrap();
        let readings = readings::sample(&sheet, &[20.0], &gonio.exitant).unwrap();
        let xml = window_xml_write::write(&sheet, Default::default(), &Default::default()).unwrap().text;
        let one_band = readings.subset(|r| r.band == 0 && r.wo.z > 0.0 && r.wi.z > 0.0);
        let files: [(&str, Vec<u8>); 7] = [
            ("petal.optics", petal_optics::write(&crate::validate::sheet(6, 4)).unwrap()),
            ("goniometer table", gonio_csv::write(&table).unwrap().into()),
            ("CSV", readings_csv::write(&readings).unwrap().into()),
            ("Radiance XML", xml.into()),
            ("pgII", pgii::write(&one_band, 0).unwrap()[0].1.clone().into()),
            ("RGL", rgl::write(&sheet, rgl::Resolution { lamps: 4, grid: 8 }, "x").unwrap()),
            ("UTIA", vec![0; utia::BYTES]),
        ];
        for (name, bytes) in files {
            assert_eq!(format(&bytes), name);
            let read = || read(&bytes, "file", &CsvOptions::default()).unwrap();
            assert!(!read().into_readings().unwrap().readings.is_empty(), "{name}");
            let function = read().into_function().unwrap();
            assert!(!function.bands().is_empty(), "{name}");
        }
        assert_eq!(format(b""), "CSV");
        assert!(read(b"", "file", &CsvOptions::default()).is_err());
    }
}

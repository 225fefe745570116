//! Measured data on the command line: the files, and what the user declares about them.

use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;
use rosarium::gonio::{self, Band, Coverage, Directional, Measurement};
use rosarium::io::columns::ColumnMap;
use rosarium::io::conventions::{AngleReference, AngleUnit, AzimuthZero, Quantity};
use rosarium::io::csv_options::CsvOptions;
use rosarium::io::measured::{self, Measured};
use rosarium::{Error, Result};

use crate::{input, report};

/// What a table of measured values means, where the file does not say it itself.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "What the table means")]
pub(crate) struct DataArgs {
    /// Which column of a CSV is what: incident_theta, incident_phi, theta, phi, value, sigma, series, wavelength, side.
    /// `value` may be given several times, once per band. Default: known names.
    #[arg(long, value_name = "ROLE=COLUMN,...")]
    columns: Option<String>,
    /// Column that tells series (samples, lamp settings) apart.
    #[arg(long, value_name = "COLUMN")]
    series: Option<String>,
    /// Take only this series. Repeatable.
    #[arg(long, value_name = "NAME")]
    select: Vec<String>,
    /// Take only this band: its name or its wavelength in nm. Repeatable.
    #[arg(long, value_name = "BAND")]
    band: Vec<String>,
    /// Wavelengths of a measured petal (.optics), nm: a list or LOW..HIGH:STEP. Default: 450,550,650.
    #[arg(long, value_name = "NM,...", allow_hyphen_values = true, value_parser = input::bands)]
    wavelengths: Option<input::Bands>,
    /// What a value is: bsdf (1/sr), brf (pi x BSDF), dsf (BSDF x cosine), relative or relative_dsf (the same with an
    /// unknown gain per series). Default: what the file says, else bsdf.
    #[arg(long, value_name = "WORD")]
    quantity: Option<String>,
    /// Where azimuth 0 is: lamp (its side), forward (the mirror's side), sample (its own axis). Default: what the file
    /// says, else lamp.
    #[arg(long, value_name = "WORD")]
    azimuth: Option<String>,
    /// Unit of the angles: degrees or radians. Default: what the file says, else degrees.
    #[arg(long, value_name = "WORD")]
    angle_unit: Option<String>,
    /// What exitant angles count from: normal, or specular (the mirror direction). Default: what the file says, else
    /// normal.
    #[arg(long, value_name = "WORD")]
    reference: Option<String>,
    /// Half the angle that the lamp fills seen from the sample, degrees. Default: what the file says, else 0.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    source_half_angle: Option<f64>,
    /// Half the angle that the detector fills seen from the sample, degrees. Default: what the file says, else 0.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    detector_half_angle: Option<f64>,
    /// A value that means "not measured", besides empty, NaN, NA, -9999 and the like. Repeatable.
    #[arg(long, value_name = "VALUE", allow_hyphen_values = true)]
    missing: Vec<String>,
}

/// A file as it was read.
pub(crate) struct Source {
    pub(crate) name: String,
    pub(crate) bytes: Vec<u8>,
    pub(crate) format: &'static str,
    pub(crate) measured: Measured,
}

/// All files as one measurement.
pub(crate) struct Data {
    /// Names, joined by commas.
    pub(crate) name: String,
    /// Bytes of all files, one after the other.
    pub(crate) bytes: Vec<u8>,
    /// What the numbers are, in words.
    pub(crate) quantity: String,
    /// Are the sigmas those of counts of paths? Then low readings have low sigmas.
    pub(crate) counted: bool,
    pub(crate) measurement: Measurement,
}

impl DataArgs {
    fn options(&self) -> Result<CsvOptions> {
        fn word<T: std::str::FromStr<Err = Error>>(flag: &str, word: Option<&String>) -> Result<Option<T>> {
            word.map(|w| w.parse().map_err(|e| report::at_flag(flag, e))).transpose()
        }
        let columns = self.columns.as_deref().map(ColumnMap::parse).transpose();
        let mut columns = columns.map_err(|e| report::at_flag("--columns", e))?.unwrap_or_default();
        if self.series.is_some() {
            columns.series.clone_from(&self.series);
        }
        Ok(CsvOptions {
            columns,
            quantity: word::<Quantity>("--quantity", self.quantity.as_ref())?,
            angle_unit: word::<AngleUnit>("--angle-unit", self.angle_unit.as_ref())?,
            azimuth: word::<AzimuthZero>("--azimuth", self.azimuth.as_ref())?,
            reference: word::<AngleReference>("--reference", self.reference.as_ref())?,
            side: None,
            source_half_angle_deg: half_angle("--source-half-angle", self.source_half_angle)?,
            detector_half_angle_deg: half_angle("--detector-half-angle", self.detector_half_angle)?,
            missing: self.missing.clone(),
        })
    }

    /// Reads every file.
    pub(crate) fn sources(&self, files: &[PathBuf]) -> Result<Vec<Source>> {
        let options = self.options()?;
        let read = |path: &PathBuf| {
            let bytes = fs::read(path).map_err(|e| Error::io(path, e))?;
            let name = path.display().to_string();
            let format = measured::format(&bytes);
            let mut measured = measured::read(&bytes, &name, &options).map_err(|e| in_file(&name, e))?;
            if let Some(wavelengths) = &self.wavelengths {
                measured = measured.at_wavelengths(&wavelengths.0).map_err(|e| in_file(&name, e))?;
            }
            tracing::info!(file = name, format, "read");
            Ok(Source { name, bytes, format, measured })
        };
        files.iter().map(read).collect()
    }

    /// Reads every file and makes one measurement of them, of the series and bands that were asked for.
    pub(crate) fn load(&self, files: &[PathBuf]) -> Result<Data> {
        let sources = self.sources(files)?;
        let formats: Vec<&str> = sources.iter().map(|s| s.format).collect();
        let mut data = Data {
            name: sources.iter().map(|s| s.name.as_str()).collect::<Vec<_>>().join(", "),
            bytes: sources.iter().flat_map(|s| s.bytes.iter().copied()).collect(),
            quantity: match &self.quantity {
                Some(word) => format!("{word}, from {}", formats.join(", ")),
                None => format!("as the file says, from {}", formats.join(", ")),
            },
            counted: sources.iter().any(|s| matches!(s.measured, Measured::Table(_))),
            measurement: Measurement::default(),
        };
        let readings = sources
            .into_iter()
            .map(|s| s.measured.into_readings().map_err(|e| in_file(&s.name, e)))
            .collect::<Result<Vec<_>>>()?;
        data.measurement = gonio::merge(readings)?;
        data.measurement = self.chosen(&data.measurement)?;
        Ok(data)
    }

    /// Indices of the bands that `--band` names; none means all.
    fn picks(&self, bands: &[Band]) -> Result<Vec<usize>> {
        let pick = |wanted: &String| {
            let nm = wanted.trim_end_matches("nm").trim().parse::<f64>().ok();
            let is = |b: &Band| b.name == *wanted || (nm.is_some() && b.wavelength_nm == nm);
            bands.iter().position(is).ok_or_else(|| {
                let names: Vec<&str> = bands.iter().map(|b| b.name.as_str()).collect();
                Error::invalid(format!("--band {wanted}"), format!("the bands are: {}", names.join(", ")))
            })
        };
        self.band.iter().map(pick).collect()
    }

    /// A function of the bands that `--band` names.
    pub(crate) fn chosen_bands(&self, whole: Box<dyn Directional>) -> Result<Box<dyn Directional>> {
        let picks = self.picks(whole.bands())?;
        if picks.is_empty() {
            return Ok(whole);
        }
        let bands = picks.iter().map(|&p| whole.bands()[p].clone()).collect();
        Ok(Box::new(Chosen { whole, picks, bands }))
    }

    /// The series and bands that `--select` and `--band` name.
    fn chosen(&self, m: &Measurement) -> Result<Measurement> {
        let series = self.select.iter().map(|wanted| {
            m.series.iter().position(|s| s == wanted).ok_or_else(|| {
                Error::invalid(
                    format!("--select {wanted}"),
                    format!("the series are: {}", m.series.join(", ")),
                )
            })
        });
        let series = series.collect::<Result<Vec<usize>>>()?;
        let bands = self.picks(&m.bands)?;
        Ok(m.subset(|r| {
            (series.is_empty() || series.contains(&(r.series as usize)))
                && (bands.is_empty() || bands.contains(&(r.band as usize)))
        }))
    }
}

fn half_angle(flag: &str, deg: Option<f64>) -> Result<Option<f64>> {
    match deg {
        Some(d) if !(0.0..=45.0).contains(&d) => Err(Error::invalid(flag, format!("{d} is not in 0-45 deg"))),
        d => Ok(d),
    }
}

/// Readers of binary formats name the format only: here is the file.
fn in_file(name: &str, error: Error) -> Error {
    match error {
        Error::Invalid { at, what } if !at.starts_with(name) => Error::invalid(name, format!("{at}: {what}")),
        e => e,
    }
}

/// A file's name without its extension.
pub(crate) fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Some bands of a function.
struct Chosen {
    whole: Box<dyn Directional>,
    picks: Vec<usize>,
    bands: Vec<Band>,
}

impl Directional for Chosen {
    fn bands(&self) -> &[Band] {
        &self.bands
    }

    fn coverage(&self) -> Coverage {
        self.whole.coverage()
    }

    fn is_isotropic(&self) -> bool {
        self.whole.is_isotropic()
    }

    fn bsdf(&self, wi: DVec3, wo: DVec3, values: &mut [f64]) -> bool {
        let mut all = vec![0.0; self.whole.bands().len()];
        let known = self.whole.bsdf(wi, wo, &mut all);
        values.iter_mut().zip(&self.picks).for_each(|(v, &p)| *v = all[p]);
        known
    }
}

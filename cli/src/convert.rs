//! `rosarium convert`.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use rosarium::gonio::{Band, Directional, Measurement};
use rosarium::io::klems::Klems;
use rosarium::io::measured::Measured;
use rosarium::io::window_xml_write::{self, Form, Material};
use rosarium::io::{merl, pgii, readings_csv, rgl};
use rosarium::{Error, Result};

use crate::data::{self, DataArgs, Source};
use crate::output::Output;
use crate::{Global, Outcome, progress};

/// Convert measured BSDFs between formats.
///
/// Reads CSV, `measure`'s tables and measured petals (.optics, at --wavelengths), pab pgII, MERL, UTIA, RGL, Radiance/WINDOW XML and Zemax. The extension of the last
/// file chooses what is written: .csv (readings), .dat (pgII, one file per incidence), .binary (MERL), .xml
/// (Radiance/WINDOW), .bsdf (RGL, for Mitsuba's and pbrt's `measured`). What the new format cannot hold is said.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  rosarium convert table.csv petal.bsdf
  rosarium convert petal.optics petal.bsdf --wavelengths 400..700:20
  rosarium convert upper.csv lower.csv petal.xml --form tensor-tree
  rosarium convert red-fabric.binary fabric.csv
  rosarium convert leaf.csv leaf.xml --quantity brf --azimuth lamp --series sample --select oak-3 --columns \\
      incident_theta=sza,theta=vza,phi=vaa,value=BRF_550nm")]
pub(crate) struct Args {
    /// Files to read (several are one measurement), then the file to write.
    #[arg(value_name = "IN... OUT", num_args = 2.., required = true)]
    files: Vec<PathBuf>,
    /// How an XML arranges its numbers.
    #[arg(long, value_name = "WORD", default_value = "klems-full")]
    form: FormWord,
    /// Tensor tree: boxes per axis are 2 to this. Default: 5 (isotropic), 4 (anisotropic).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=7))]
    resolution: Option<u32>,
    #[command(flatten)]
    data: DataArgs,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum FormWord {
    /// 145 patches.
    KlemsFull,
    /// 73 patches.
    KlemsHalf,
    /// 41 patches.
    KlemsQuarter,
    /// Boxes that are small where the light changes.
    TensorTree,
}

pub(crate) fn run(args: &Args, global: Global) -> Result<Outcome> {
    let Some((out, files)) = args.files.split_last() else {
        return Err(Error::invalid("convert", "needs a file to read and one to write"));
    };
    let output = Output::prepare("OUT", out, &["csv", "dat", "binary", "xml", "bsdf"])?;
    let written = |bytes: &[u8], what: &str| -> Result<()> {
        output.write(bytes)?;
        progress::say(global, &format!("{}: {what}", out.display()));
        Ok(())
    };
    match output.format {
        "csv" => written(readings_csv::write(&args.data.load(files)?.measurement)?.as_bytes(), "readings")?,
        "dat" => write_pgii(&args.data.load(files)?.measurement, out, global)?,
        format => {
            let (name, function) = function(args, files)?;
            let lose =
                |losses: &[String]| losses.iter().for_each(|l| progress::say(global, &format!("lost: {l}")));
            match format {
                "xml" => {
                    let material = Material { name: name.clone(), ..Material::default() };
                    let document = window_xml_write::write(&*function, args.form(&*function), &material)?;
                    lose(&document.losses);
                    written(document.text.as_bytes(), "Radiance/WINDOW XML")?;
                }
                "binary" => {
                    let planes = red_green_blue(function.bands());
                    let names = planes.map(|b| function.bands()[b].name.clone());
                    lose(&[format!(
                        "wavelengths ({} became red, green, blue), transmission, the lower side, anisotropy",
                        names.join(", ")
                    )]);
                    written(&merl::write(&*function, planes)?, "MERL")?;
                }
                _ => {
                    let resolution = rgl::Resolution::for_bands(function.bands().len());
                    lose(&["transmission, the lower side, anisotropy".to_owned()]);
                    let bytes = rgl::write(&*function, resolution, &format!("{name}, by rosarium convert"))?;
                    written(&bytes, "RGL")?;
                }
            }
        }
    }
    Ok(Outcome::Done)
}

impl Args {
    fn form(&self, function: &dyn Directional) -> Form {
        match self.form {
            FormWord::KlemsFull => Form::Klems(Klems::Full),
            FormWord::KlemsHalf => Form::Klems(Klems::Half),
            FormWord::KlemsQuarter => Form::Klems(Klems::Quarter),
            FormWord::TensorTree => {
                let (rank, most, default) = if function.is_isotropic() { (3, 7, 5) } else { (4, 5, 4) };
                let log2_resolution = self.resolution.unwrap_or(default).min(most);
                Form::TensorTree { rank, log2_resolution, tolerance: 0.02 }
            }
        }
    }
}

/// One file of a function as it is; readings, or several files, interpolated.
fn function(args: &Args, files: &[PathBuf]) -> Result<(String, Box<dyn Directional>)> {
    if let [file] = files {
        let mut sources = args.data.sources(files)?;
        // A function is asked as it is; a table of ours knows its own totals.
        if let Some(Source {
            measured: m @ (Measured::Function(_) | Measured::Table(_) | Measured::Optics(_)),
            ..
        }) = sources.pop()
        {
            return Ok((data::stem(file), args.data.chosen_bands(m.into_function()?)?));
        }
    }
    let m = args.data.load(files)?.measurement;
    if m.series.len() > 1 {
        let what = format!("the table has several series, choose one: {}", m.series.join(", "));
        return Err(Error::invalid("--select", what));
    }
    let name = if m.sample.is_empty() { data::stem(&files[0]) } else { m.sample.clone() };
    Ok((name, Measured::Readings(m).into_function()?))
}

/// Bands for the planes of a format of three colours: those nearest to the primaries of Rec. 2020 (630, 532, 467 nm); by
/// their order where they have no wavelengths.
fn red_green_blue(bands: &[Band]) -> [usize; 3] {
    let last = bands.len() - 1;
    let nearest = |nm: f64| {
        let distance = |b: &Band| b.wavelength_nm.map_or(f64::INFINITY, |w| (w - nm).abs());
        (0..=last).min_by(|&a, &b| distance(&bands[a]).total_cmp(&distance(&bands[b]))).unwrap_or(0)
    };
    if bands.iter().any(|b| b.wavelength_nm.is_none()) {
        return [0, last.min(1), last.min(2)];
    }
    [630.0, 532.0, 467.0].map(nearest)
}

/// One file per incidence, beside each other.
fn write_pgii(m: &Measurement, out: &Path, global: Global) -> Result<()> {
    let files = pgii::write(m, 0)?;
    let stem = data::stem(out);
    let outputs: Vec<Output> = files
        .iter()
        .map(|(end, _)| Output::prepare("OUT", &out.with_file_name(format!("{stem}{end}.dat")), &["dat"]))
        .collect::<Result<_>>()?;
    if m.bands.len() > 1 {
        progress::say(global, &format!("lost: all bands but {}; --band chooses", m.bands[0].name));
    }
    for (output, (_, text)) in outputs.iter().zip(&files) {
        output.write(text.as_bytes())?;
        progress::say(global, &format!("{}: pgII", output.path().display()));
    }
    Ok(())
}

//! `rosarium colour`.

use std::path::{Path, PathBuf};

use rosarium::fit::spectrum::{self, Illumination, PARAMETERS, Setup};
use rosarium::io::spectrum_fit;
use rosarium::scene::fitted_spectrum;
use rosarium::spectrum::table;
use rosarium::{Error, Result};
use sha2::{Digest, Sha256};

use crate::input::{self, Overrides};
use crate::output::{self, Output};
use crate::progress::Bar;
use crate::{Global, Outcome, fit, progress, shell};

/// Find the pigments of a petal from its measured colour.
///
/// Fits a reflectance spectrum by the layers of a petal: amounts of anthocyanin, carotenoid and chlorophyll, the peak of the
/// anthocyanin band, the scattering of the spongy layer, and one gain for what the spectrometer does not know; each with
/// its standard error. Cells, layers and indices are the petal's.
#[derive(Debug, clap::Args)]
#[command(after_help = input::with_presets("\
Examples:
  rosarium colour rose.csv --petal my_petal.toml -o fitted.toml --plot spectrum.svg
  rosarium colour flowers.csv --spectrum Rosa_canina --petal my_petal.toml --range 420..690
  rosarium colour rose.csv --petal my_petal.toml --fix gain=1 --illumination diffuse"))]
pub(crate) struct Args {
    /// Spectra: a table with the wavelength in nm first, then reflectances from 0 to 1.
    #[arg(value_name = "SPECTRUM")]
    table: PathBuf,
    /// Column of the table. Needed where it has several.
    #[arg(long, value_name = "COLUMN")]
    spectrum: Option<String>,
    /// Petal whose layers explain the spectrum: a preset or a petal file with a `[tissue]`.
    #[arg(long, value_name = "NAME|FILE")]
    petal: String,
    /// Wavelengths that are fitted, nm.
    #[arg(long, value_name = "LOW..HIGH", default_value = "420..690")]
    range: String,
    /// How the petal was lit: `diffuse` (integrating sphere), or an angle from the normal in degrees.
    #[arg(long, value_name = "diffuse|DEG", default_value = "diffuse", value_parser = illumination)]
    illumination: Illumination,
    /// The instrument does not see surface reflection (specular excluded).
    #[arg(long)]
    no_surface: bool,
    /// Hold a parameter: `--fix anthocyanin_peak_nm=539`. Repeatable.
    #[arg(long, value_name = "NAME=VALUE", allow_hyphen_values = true)]
    fix: Vec<String>,
    /// Walks of light per scattering coefficient.
    #[arg(long, value_name = "N", default_value = "20000", value_parser = walks)]
    walks: u32,
    /// Seed of the walks.
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    seed: u64,
    /// Petal file to write, with what was found: .toml.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Plot of measured and modelled reflectance to write: .svg or .png. Repeatable.
    #[arg(long, value_name = "FILE")]
    plot: Vec<PathBuf>,
    /// Table of measured and modelled reflectance to write: .csv.
    #[arg(long, value_name = "FILE")]
    table_out: Option<PathBuf>,
    /// Print the fit as JSON instead of text.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    overrides: Overrides,
}

fn illumination(argument: &str) -> Result<Illumination, String> {
    if argument == "diffuse" {
        return Ok(Illumination::Diffuse);
    }
    match argument.parse::<f64>() {
        Ok(deg) if (0.0..=89.0).contains(&deg) => Ok(Illumination::Direct(deg)),
        _ => Err("`diffuse`, or an angle from 0 to 89 degrees".to_owned()),
    }
}

fn walks(argument: &str) -> Result<u32, String> {
    match input::count(argument)? {
        n @ 100..=1_000_000 => Ok(n as u32),
        _ => Err("a number from 100 to 1e6".to_owned()),
    }
}

impl Args {
    fn options(&self) -> Result<spectrum::Options> {
        let range_nm = fit::range(&self.range)
            .filter(|(low, high)| low < high)
            .ok_or_else(|| Error::invalid(format!("--range {}", self.range), "not of the form LOW..HIGH"))?;
        let held = |argument: &String| {
            let parts = argument.split_once('=').and_then(|(n, v)| Some((n.trim(), v.trim().parse().ok()?)));
            match parts {
                Some((name, value)) if PARAMETERS.contains(&name) => Ok((name.to_owned(), value)),
                _ => {
                    let what = format!("not NAME=VALUE with one of {}", PARAMETERS.join(", "));
                    Err(Error::invalid(format!("--fix {argument}"), what))
                }
            }
        };
        let fixed = self.fix.iter().map(held).collect::<Result<_>>()?;
        let setup = Setup { illumination: self.illumination, surface: !self.no_surface };
        Ok(spectrum::Options { range_nm, setup, walks: self.walks, seed: self.seed, fixed })
    }
}

pub(crate) fn run(args: &Args, global: Global) -> Result<Outcome> {
    let options = args.options()?;
    let petal_out = args.output.as_deref().map(|p| Output::prepare("--output", p, &["toml"])).transpose()?;
    let table_out =
        args.table_out.as_deref().map(|p| Output::prepare("--table-out", p, &["csv"])).transpose()?;
    let plots = Output::prepare_all("--plot", &args.plot, &["svg", "png"])?;
    let input::Petal { name, loaded, .. } = input::petal(&args.petal, &args.overrides)?;
    let description = &loaded.description;
    let Some(tissue) = &description.tissue else {
        return Err(Error::invalid(
            &args.petal,
            "has no [tissue]: pigments need layers that light walks through",
        ));
    };
    let text = input::read_text(&args.table)?;
    let at = args.table.display().to_string();
    let points = table::parse(&text, &at)?.points(args.spectrum.as_deref())?;

    let fit = {
        let bar = Bar::new("colour");
        let petal = (tissue, &description.cells, "tissue");
        spectrum::fit(&points, &at, petal, &options, &|done, total| bar.step(done, total)).map_err(|e| {
            match &e {
                // The other errors are the spectrum's and the flags'.
                Error::Invalid { at, .. } if at.starts_with("tissue") || at.starts_with("cells") => {
                    loaded.source.locate(e)
                }
                _ => e,
            }
        })?
    };

    let report = spectrum_fit::text(&fit);
    let sample = args.spectrum.clone().unwrap_or_else(|| stem(&args.table));
    if let Some(output) = &petal_out {
        let sha256: String = Sha256::digest(text.as_bytes()).iter().map(|b| format!("{b:02x}")).collect();
        let lines = [
            format!("data    {at}, {sample}"),
            format!("sha256  {sha256}"),
            format!("petal   {name}"),
            format!("command {}", shell::command()),
        ];
        let petal = fitted_spectrum::petal(description, &fit);
        output.write(fitted_spectrum::to_toml(&petal, &lines, &report)?.as_bytes())?;
        progress::say(global, &format!("{}: petal", output.path().display()));
    }
    if let Some(output) = &table_out {
        output.write(spectrum_fit::csv(&fit).as_bytes())?;
        progress::say(global, &format!("{}: table", output.path().display()));
    }
    for plot in &plots {
        let picture = spectrum_fit::picture(&fit, &sample);
        let bytes = if plot.format == "svg" { picture.svg().into_bytes() } else { picture.png()? };
        plot.write(&bytes)?;
        progress::say(global, &format!("{}: plot", plot.path().display()));
    }
    if args.json {
        let mut json =
            serde_json::to_string_pretty(&fit).map_err(|e| Error::invalid("--json", e.to_string()))?;
        json.push('\n');
        return output::print(json.as_bytes());
    }
    output::print(report.as_bytes())
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

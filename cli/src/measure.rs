//! `rosarium measure`.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValuesParser, TypedValueParser};
use rosarium::geometry::Side;
use rosarium::gonio::{Estimate, GonioTable, Goniophotometer, WhiteMonteCarlo};
use rosarium::io::{gonio_csv, lobe_plot};
use rosarium::spectrum::Illuminant;
use rosarium::{Error, Result};

use crate::input::{self, Overrides};
use crate::output::{self, Output};
use crate::progress::Bar;
use crate::sample::Sample;
use crate::spectral::{self, Spectral};
use crate::{Global, Outcome, optics, progress, report};

/// Measure a petal with the virtual goniophotometer.
///
/// Shines on the petal from each angle, follows the light through its cells, and counts where it goes:
/// reflectance, transmittance and absorptance with their standard errors, the retro-reflection index (light
/// towards the lamp over light towards the mirror direction), and with -o the BSDF in every direction. With --spectral in
/// many bands and from both sides, with the colours of the light that comes back and that goes through.
#[derive(Debug, clap::Args)]
#[command(after_help = input::with_presets("\
Examples:
  rosarium measure thesis --incident 0,30,60 --rays 1e6 -o table.csv --plot lobes.svg
  rosarium measure thesis -D cells.profile=cosine -D shading.model=lambert -D shading.albedo=0.5 \\
      --incident 60 --rays 1e6 --json
  rosarium measure my_petal.toml --side abaxial --wavelengths 450,550,650
  rosarium measure rote_rose --spectral --spectra rose.csv --spectra rose.svg -o table.csv
  rosarium measure rote_rose --spectral -D age=0.3 --illuminant A --json
  rosarium measure rote_rose -o rose.optics"))]
pub(crate) struct Args {
    /// Name of a preset, or a petal file (.toml).
    #[arg(value_name = "NAME|FILE")]
    petal: String,
    /// Angles of the lamp from the normal, degrees.
    #[arg(
        long,
        value_name = "DEG,...",
        value_delimiter = ',',
        default_value = "0,30,60",
        allow_hyphen_values = true
    )]
    incident: Vec<f64>,
    /// Paths of light per angle, such as 250000 or 1e6.
    #[arg(long, value_name = "N", default_value = "1e6", allow_negative_numbers = true, value_parser = input::count)]
    rays: u64,
    /// Seed of the paths.
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    seed: u64,
    /// Which side the lamp lights. Default: adaxial; with --spectral first the one, then the other.
    #[arg(long, value_parser = PossibleValuesParser::new(["adaxial", "abaxial"]).map(side))]
    side: Option<Side>,
    /// Wavelengths, nm: a list, in which LOW..HIGH:STEP stands for many. Default: 450,550,650; with --spectral 380..780:10.
    #[arg(
        long,
        visible_alias = "bands",
        value_name = "NM,...",
        allow_hyphen_values = true,
        value_parser = input::bands
    )]
    wavelengths: Option<input::Bands>,
    /// Measure spectra: many bands, both sides, colours.
    #[arg(long)]
    spectral: bool,
    /// Spectra to write: .csv (reflectance and transmittance of each side and angle with standard errors), .svg or .png.
    /// Repeatable.
    #[arg(long, value_name = "FILE", requires = "spectral")]
    spectra: Vec<PathBuf>,
    /// Light in which colours are seen: A, D50, D65, E or a temperature such as 3000K.
    #[arg(long, value_name = "NAME", default_value = "D65", requires = "spectral")]
    illuminant: Illuminant,
    /// Turn the sample about its normal from path to path: the mean over all azimuths, as fits assume. Without it the lamp
    /// stands along the rows of cells.
    #[arg(long)]
    spin: bool,
    /// Table to write: .csv, with a header that describes it. Of two sides, table-adaxial.csv and table-abaxial.csv. Or
    /// .optics: the tissue measured once for all angles, wavelengths and amounts of pigment, with --rays walks per side.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Plot of the plane of incidence to write: .svg or .png. Repeatable.
    #[arg(long, value_name = "FILE")]
    plot: Vec<PathBuf>,
    /// Print one JSON object with the totals instead of a table.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    overrides: Overrides,
}

#[expect(clippy::needless_pass_by_value, reason = "what clap's map takes")]
fn side(name: String) -> Side {
    if name == "abaxial" { Side::Abaxial } else { Side::Adaxial }
}

pub(crate) fn run(args: &Args, global: Global) -> Result<Outcome> {
    output::print(measure(args, global)?.as_bytes())
}

/// Measures, and writes the files that were asked for; returns what is to be printed.
pub(crate) fn measure(args: &Args, global: Global) -> Result<String> {
    if let Some(path) = args.output.as_deref().filter(|p| optics::is_asked_for(p)) {
        return measure_optics(args, path, global);
    }
    let default = if args.spectral { "380..780:10" } else { "450,550,650" };
    let bands_nm = match &args.wavelengths {
        Some(bands) => bands.0.clone(),
        None => input::bands(default).map_err(|e| Error::invalid("--wavelengths", e))?.0,
    };
    let sides = match args.side {
        Some(side) => vec![side],
        None if args.spectral => vec![Side::Adaxial, Side::Abaxial],
        None => vec![Side::Adaxial],
    };
    let gonios: Vec<Goniophotometer> = sides
        .iter()
        .map(|&side| Goniophotometer {
            incident_deg: args.incident.clone(),
            side,
            rays: args.rays,
            seed: args.seed,
            bands_nm: bands_nm.clone(),
            spin: args.spin,
            ..Goniophotometer::default()
        })
        .collect();
    gonios.iter().try_for_each(Goniophotometer::validate).map_err(name_flag)?;
    let csv = args.output.as_deref().map(|p| Output::prepare("--output", p, &["csv"])).transpose()?;
    let csv = csv.map(|o| of_sides(o, &sides)).transpose()?;
    let plots = Output::prepare_all("--plot", &args.plot, &["svg", "png"])?;
    let plots = plots.into_iter().map(|o| of_sides(o, &sides)).collect::<Result<Vec<_>>>()?;
    let spectra = Output::prepare_all("--spectra", &args.spectra, &["csv", "svg", "png"])?;
    let input::Petal { name, loaded, assets } = input::petal(&args.petal, &args.overrides)?;
    let sample = Sample::new(&loaded.description, &assets).map_err(|e| loaded.source.locate(e))?;
    let name = if args.spin { format!("{name}, all azimuths") } else { name };
    let description =
        toml::to_string(&loaded.description).map_err(|e| Error::invalid(&name, e.to_string()))?;

    tracing::info!("sample ready");

    let tables = {
        let bar = Bar::new("measure");
        let n = gonios.len() as u64;
        let measure = |(k, gonio): (usize, &Goniophotometer)| {
            let progress = |done, total| bar.step(k as u64 * total + done, n * total);
            Ok(sample.measure(gonio, &progress)?.described(name.as_str(), description.as_str()))
        };
        gonios.iter().enumerate().map(measure).collect::<Result<Vec<GonioTable>>>()?
    };
    for (table, output) in tables.iter().zip(csv.iter().flatten()) {
        output.write(gonio_csv::write(table)?.as_bytes())?;
        progress::say(global, &format!("{}: table", output.path().display()));
    }
    for outputs in &plots {
        for (table, output) in tables.iter().zip(outputs) {
            let bytes = match output.format {
                "svg" => lobe_plot::svg(table, lobe_plot::LobePlot::Both, None)?.into_bytes(),
                _ => lobe_plot::png(table, lobe_plot::LobePlot::Both, None)?,
            };
            output.write(&bytes)?;
            progress::say(global, &format!("{}: plot", output.path().display()));
        }
    }
    let cut_off: u64 = tables.iter().map(GonioTable::cut_off).sum();
    if cut_off > 0 {
        progress::say(global, &format!("warning: {cut_off} walks were cut off; no total has their light"));
    }
    let spectral = args.spectral.then(|| Spectral::new(&tables, args.illuminant)).transpose()?;
    if let Some(spectral) = &spectral {
        spectral.write(&spectra, &name, global)?;
    }
    if args.json {
        let mut text = match &spectral {
            None => tables.iter().map(|t| serde_json::to_string(&t.summary())).collect(),
            Some(spectral) => serde_json::to_string(&spectral.summary(&tables)),
        }
        .map_err(|e| Error::invalid("--json", e.to_string()))?;
        text.push('\n');
        return Ok(text);
    }
    let mut text = tables.iter().map(for_people).collect::<Vec<_>>().join("\n");
    if let Some(spectral) = &spectral {
        text.push_str(&spectral.for_people());
    }
    Ok(text)
}

/// A petal for all wavelengths: what chooses some of the light has no meaning then.
fn measure_optics(args: &Args, path: &Path, global: Global) -> Result<String> {
    let some = [
        ("--side", args.side.is_some()),
        ("--wavelengths", args.wavelengths.is_some()),
        ("--spectral", args.spectral),
        ("--plot", !args.plot.is_empty()),
        ("--spin", args.spin),
    ];
    if let Some((flag, _)) = some.into_iter().find(|(_, given)| *given) {
        let what = "an .optics file has both sides, all angles and all wavelengths, and no plot";
        return Err(Error::invalid(flag, what));
    }
    let settings = WhiteMonteCarlo { walks: args.rays, seed: args.seed, ..WhiteMonteCarlo::default() };
    optics::run(&args.petal, &args.overrides, (path, &settings), args.json, global)
}

/// One output per side: the file itself where there is one side only.
fn of_sides(output: Output, sides: &[Side]) -> Result<Vec<Output>> {
    if sides.len() == 1 {
        return Ok(vec![output]);
    }
    sides.iter().map(|&side| output.beside(spectral::side_name(side))).collect()
}

/// The library's keys are this command's flags.
fn name_flag(error: Error) -> Error {
    let flag = match &error {
        Error::Invalid { at, .. } => match at.as_str() {
            "gonio.incident_deg" => "--incident",
            "gonio.rays" => "--rays",
            "gonio.bands_nm" => "--wavelengths",
            _ => return error,
        },
        _ => return error,
    };
    report::at_flag(flag, error)
}

/// The totals as a table. Writing to a String cannot fail.
fn for_people(table: &GonioTable) -> String {
    let mut out = String::new();
    let bands = match &table.bands_nm[..] {
        [first, .., last] if table.bands_nm.len() > 8 => {
            format!("{} bands from {first} to {last}", table.bands_nm.len())
        }
        few => few.iter().map(f64::to_string).collect::<Vec<_>>().join(", "),
    };
    let _ = writeln!(
        out,
        "{}: {} side, mean of {bands} nm, {} rays per angle, seed {}\n",
        table.sample,
        spectral::side_name(table.side),
        table.rays,
        table.seed
    );
    let _ = writeln!(
        out,
        "{:>8}  {:<19}  {:<19}  {:<19}  retro index",
        "lamp", "reflectance", "transmittance", "absorptance"
    );
    let number = |e: &Estimate| format!("{:.5} ± {:.5}", e.value, e.standard_error);
    for i in &table.incidences {
        let retro = i
            .mean
            .retro_index
            .as_ref()
            .map_or("undefined".to_owned(), |e| format!("{:.3} ± {:.3}", e.value, e.standard_error));
        let _ = writeln!(
            out,
            "{:>4} deg  {:<19}  {:<19}  {:<19}  {retro}",
            i.incident_deg,
            number(&i.mean.reflectance),
            number(&i.mean.transmittance),
            number(&i.mean.absorptance),
        );
    }
    out
}

//! `rosarium measure`.

use std::fmt::Write;
use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use rosarium::geometry::Side;
use rosarium::gonio::{Estimate, GonioTable, Goniophotometer};
use rosarium::io::{gonio_csv, lobe_plot};
use rosarium::{Error, Result};

use crate::input::{self, Overrides};
use crate::output::{self, Output};
use crate::progress::Bar;
use crate::{Global, Outcome, progress, report};

/// Measure a petal with the virtual goniophotometer.
///
/// Shines on the petal from each angle, follows the light through its cells, and counts where it goes:
/// reflectance, transmittance and absorptance with their standard errors, the retro-reflection index (light
/// towards the lamp over light towards the mirror direction), and with -o the BSDF in every direction.
#[derive(Debug, clap::Args)]
#[command(after_help = input::with_presets("\
Examples:
  rosarium measure thesis --incident 0,30,60 --rays 1e6 -o table.csv --plot lobes.svg
  rosarium measure thesis -D cells.profile=cosine -D shading.model=lambert -D shading.albedo=0.5 \\
      --incident 60 --rays 1e6 --json
  rosarium measure my_petal.toml --side abaxial --wavelengths 450,550,650"))]
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
    /// Which side the lamp lights.
    #[arg(long, default_value = "adaxial", value_parser = PossibleValuesParser::new(["adaxial", "abaxial"]).map(side))]
    side: Side,
    /// Wavelengths, nm.
    #[arg(
        long,
        value_name = "NM,...",
        value_delimiter = ',',
        default_value = "450,550,650",
        allow_hyphen_values = true
    )]
    wavelengths: Vec<f64>,
    /// Turn the sample about its normal from path to path: the mean over all azimuths, as fits assume. Without it the lamp
    /// stands along the rows of cells.
    #[arg(long)]
    spin: bool,
    /// Table to write: .csv, with a header that describes it.
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
    let gonio = Goniophotometer {
        incident_deg: args.incident.clone(),
        side: args.side,
        rays: args.rays,
        seed: args.seed,
        bands_nm: args.wavelengths.clone(),
        spin: args.spin,
        ..Goniophotometer::default()
    };
    gonio.validate().map_err(name_flag)?;
    let csv = args.output.as_deref().map(|p| Output::prepare("--output", p, &["csv"])).transpose()?;
    let plots = Output::prepare_all("--plot", &args.plot, &["svg", "png"])?;
    let input::Petal { name, loaded, assets } = input::petal(&args.petal, &args.overrides)?;
    let petal = loaded.description.compile("", &assets).map_err(|e| loaded.source.locate(e))?;
    let name = if args.spin { format!("{name}, all azimuths") } else { name };
    let description =
        toml::to_string(&loaded.description).map_err(|e| Error::invalid(&name, e.to_string()))?;

    tracing::info!(cells = petal.cells().cell_count(), "sample ready");

    let table = {
        let bar = Bar::new("measure");
        gonio.measure(&petal, &|done, total| bar.step(done, total))?.described(name, description)
    };
    if let Some(csv) = &csv {
        csv.write(gonio_csv::write(&table)?.as_bytes())?;
        progress::say(global, &format!("{}: table", csv.path().display()));
    }
    for plot in &plots {
        let bytes = match plot.format {
            "svg" => lobe_plot::svg(&table, lobe_plot::LobePlot::Both, None)?.into_bytes(),
            _ => lobe_plot::png(&table, lobe_plot::LobePlot::Both, None)?,
        };
        plot.write(&bytes)?;
        progress::say(global, &format!("{}: plot", plot.path().display()));
    }
    if args.json {
        let mut text =
            serde_json::to_string(&table.summary()).map_err(|e| Error::invalid("--json", e.to_string()))?;
        text.push('\n');
        return output::print(text.as_bytes());
    }
    output::print(for_people(&table).as_bytes())
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
    let bands: Vec<String> = table.bands_nm.iter().map(f64::to_string).collect();
    let side = format!("{:?}", table.side).to_lowercase();
    let _ = writeln!(
        out,
        "{}: {side} side, mean of {} nm, {} rays per angle, seed {}\n",
        table.sample,
        bands.join(", "),
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

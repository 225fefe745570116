//! `rosarium plot`.

use std::path::PathBuf;

use rosarium::Result;
use rosarium::io::lobe_plot::{self, LobePlot};

use crate::data::DataArgs;
use crate::output::Output;
use crate::{Global, Outcome, progress};

/// Plot measured light in the plane of incidence.
///
/// Reads every format that `convert` reads: the BSDF against the angle, and the intensity around the sample, one
/// colour per lamp angle.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  rosarium plot table.csv -o lobes.svg
  rosarium plot red-fabric.binary -o fabric.png
  rosarium plot leaf.csv --quantity brf --columns incident_theta=sza,theta=vza,phi=vaa,value=BRF_550nm \\
      --series sample --select oak-3 -o oak.svg")]
pub(crate) struct Args {
    /// Measured tables. Several are one measurement.
    #[arg(value_name = "TABLE", required = true)]
    tables: Vec<PathBuf>,
    /// Plot to write: .svg or .png. Repeatable.
    #[arg(short, long, value_name = "FILE", required = true)]
    output: Vec<PathBuf>,
    #[command(flatten)]
    data: DataArgs,
}

pub(crate) fn run(args: &Args, global: Global) -> Result<Outcome> {
    let outputs = Output::prepare_all("--output", &args.output, &["svg", "png"])?;
    let measurement = args.data.load(&args.tables)?.measurement;
    let picture = lobe_plot::of_measurement(&measurement, LobePlot::Both, None)?;
    for output in &outputs {
        let bytes = if output.format == "svg" { picture.svg().into_bytes() } else { picture.png()? };
        output.write(&bytes)?;
        progress::say(global, &format!("{}: plot", output.path().display()));
    }
    Ok(Outcome::Done)
}

//! `rosarium reproduce`.

use std::path::PathBuf;

use rosarium::io::line_chart;
use rosarium::validate::laws::{Effort, LAWS, page};
use rosarium::{Error, Result};

use crate::output::Output;
use crate::{Global, Outcome, input, progress};

/// Measure again what a page of the documentation says.
///
/// `laws` lets light walk through petals of cells and compares what comes out with the published laws of petal optics: a page
/// laws.md and a plot per law in plots/.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  rosarium reproduce laws -o docs
  rosarium reproduce laws --walks 2e4 -o /tmp")]
pub(crate) struct Args {
    /// What to reproduce.
    #[arg(value_name = "PAGE", value_parser = ["laws"])]
    page: String,
    /// Folder to write to. Default: the working directory.
    #[arg(short, long, value_name = "FOLDER", default_value = ".")]
    output: PathBuf,
    /// Walks of light per petal and lamp, such as 250000 or 1e6.
    #[arg(long, value_name = "N", default_value = "4e5", allow_negative_numbers = true, value_parser = input::count)]
    walks: u64,
    /// Seed of the walks.
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    seed: u64,
}

pub(crate) fn run(args: &Args, global: Global) -> Result<Outcome> {
    if !(1000..=1_000_000_000).contains(&args.walks) {
        return Err(Error::invalid("--walks", format!("{} is not within 1000 to 1e9", args.walks)));
    }
    let plots = args.output.join("plots");
    std::fs::create_dir_all(&plots).map_err(|e| Error::io(&plots, e))?;
    let target = Output::prepare("--output", &args.output.join("laws.md"), &["md"])?;
    progress::listen_for_ctrl_c();
    let effort = Effort { walks: args.walks, seed: args.seed };
    let mut laws = Vec::new();
    for (_, measure) in LAWS {
        if progress::stopped() {
            return Err(Error::Cancelled);
        }
        let law = measure(effort)?;
        let holding = law.findings.iter().filter(|f| f.holds()).count();
        let line =
            format!("law {} ({}): {holding} of {} numbers hold", law.number, law.name, law.findings.len());
        progress::say(global, &line);
        laws.push(law);
    }
    for law in &laws {
        let plot = Output::prepare("--output", &plots.join(page::plot_name(law)), &["svg"])?;
        plot.write(line_chart::draw(&law.chart).svg().as_bytes())?;
    }
    let seed = if args.seed == 0 { String::new() } else { format!(" --seed {}", args.seed) };
    let command = format!("rosarium reproduce laws --walks {}{seed} -o docs", args.walks);
    target.write(page::markdown(&laws, &command, effort).as_bytes())?;
    progress::say(global, &format!("{}: {} laws", target.path().display(), laws.len()));
    Ok(Outcome::Done)
}

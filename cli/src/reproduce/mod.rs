//! `rosarium reproduce`.

mod effort;
mod known;
mod laws;
mod report;
mod sections;
mod work;

use std::path::{Path, PathBuf};

use rosarium::{Error, Result};

use crate::{Global, Outcome, input};

/// Make the thesis' figures again, each with the command that makes it alone.
///
/// Without a PAGE: a page index.html that opens without a network, with cells, measured and fitted distributions, the rose under
/// a conventional shader and under the cell model, few and many sampling points, light among petals, cultivars and growth. The
/// pictures lie beside it too. Stopped by Ctrl-C, it keeps what is finished, and the same command goes on from there.
///
/// `laws` lets light walk through petals of cells and compares what comes out with the published laws of petal optics: a page
/// laws.md and a plot per law in plots/.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  rosarium reproduce -o report --quick
  rosarium reproduce -o report --measurement petal.csv      with a goniometer's table of your own
  rosarium reproduce --section bloom,points --size 800
  rosarium reproduce laws -o docs
  rosarium reproduce laws --walks 2e4 -o /tmp")]
pub(crate) struct Args {
    /// What to reproduce instead of the thesis' figures.
    #[arg(value_name = "PAGE", value_parser = ["laws"])]
    page: Option<String>,
    /// Folder to write to. Default: report; of `laws` the working directory.
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Seed of all random choices.
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    seed: u64,
    /// Walks of light per petal and lamp of `laws`, such as 250000 or 1e6. Default: 4e5.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = input::count, conflicts_with_all = ["quick", "measurement", "size", "spp", "rays", "section"])]
    walks: Option<u64>,
    /// Small pictures of few samples: minutes on two cores.
    #[arg(long, conflicts_with = "page")]
    quick: bool,
    /// Measured table of a real petal, of any format that `convert` reads; conventional shader and cell model are fitted to it,
    /// too. `convert` makes a table with other columns' names one that says what it holds.
    #[arg(long, value_name = "FILE", conflicts_with = "page")]
    measurement: Option<PathBuf>,
    /// Sections to make. Default: all.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', conflicts_with = "page")]
    section: Vec<sections::Name>,
    /// Width and height of the large pictures, pixels; the small ones have half of it. Default: 480, with --quick 320.
    #[arg(long, value_name = "N", conflicts_with = "page", allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(8..=4096))]
    size: Option<u32>,
    /// Samples per pixel. Default: 48, with --quick 16.
    #[arg(long, value_name = "N", conflicts_with = "page", allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    spp: Option<u32>,
    /// Paths of light of the synthetic table, per angle of the lamp, such as 250000 or 1e6. Default: 2e6, with --quick 5e5.
    #[arg(long, value_name = "N", conflicts_with = "page", allow_negative_numbers = true, value_parser = input::count)]
    rays: Option<u64>,
}

pub(crate) fn run(args: &Args, global: Global) -> Result<Outcome> {
    if args.page.is_some() {
        let folder = args.output.as_deref().unwrap_or(Path::new("."));
        return laws::run(folder, args.walks.unwrap_or(400_000), args.seed, global);
    }
    if args.walks.is_some() {
        return Err(Error::invalid("--walks", "goes with `laws`"));
    }
    report::run(args, args.output.as_deref().unwrap_or(Path::new("report")), global)
}

//! The command line of Rosarium: a thin front end, one file per command, no physics.

mod assets;
mod cell_model;
mod cells;
mod check;
mod colour;
mod compare;
mod convert;
mod data;
mod fit;
mod fit_output;
mod grow;
mod input;
mod light;
mod light_report;
mod measure;
mod oidn;
mod optics;
mod output;
mod plot;
mod progress;
mod render;
mod report;
mod reproduce;
mod sample;
mod shell;
mod spectral;
mod swatch;

use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};
use rosarium::Result;

/// Photoreal flowers from their cells.
#[derive(Debug, Parser)]
#[command(name = "rosarium", version, propagate_version = true, max_term_width = 100)]
#[command(after_help = "\
Exit codes: 0 done, 1 a check failed, 2 an error, 130 stopped (what was computed is written).

Examples:
  rosarium render                                the built-in rose to rose.png and rose.exr
  rosarium render scenes/thesis.toml -o a.exr -o a.png --spp 16
  rosarium light -o light.csv --plot light.png
  rosarium measure thesis --incident 0,30,60 --rays 1e6 -o table.csv --plot lobes.svg
  rosarium fit table.csv --model terado --report report.html -o petal.toml
  rosarium convert table.csv petal.bsdf
  rosarium cells thesis -o cells.ply --plot cells.png
  rosarium swatch -o swatch.png
  rosarium grow -o rose.glb --seed 7
  rosarium compare a.exr b.exr -o difference.png
  rosarium check")]
struct Cli {
    #[command(flatten)]
    global: Global,
    #[command(subcommand)]
    command: Command,
}

/// Flags of every command.
#[derive(Clone, Copy, Debug, clap::Args)]
#[command(next_help_heading = "Options of every command")]
struct Global {
    /// Say nothing but errors and results.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Tell what is done; twice: in detail.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
    /// Threads. Default: one per core. The results do not depend on it.
    #[arg(short, long, global = true, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=4096))]
    threads: Option<u32>,
}

#[derive(Debug, Subcommand)]
enum Command {
    Render(render::Args),
    Light(Box<light::Args>),
    Measure(measure::Args),
    Fit(Box<fit::Args>),
    Colour(colour::Args),
    Convert(convert::Args),
    Plot(plot::Args),
    Cells(cells::Args),
    Swatch(swatch::Args),
    Grow(grow::Args),
    Compare(compare::Args),
    Check(check::Args),
    Reproduce(reproduce::Args),
    /// Write the JSON schema of scene files to standard output.
    ///
    /// Editors that know it complete and check the keys of a scene file.
    #[command(after_help = "Example:\n  rosarium schema > scene.schema.json")]
    Schema,
    /// Write a completion script for a shell to standard output.
    #[command(
        after_help = "Example:\n  rosarium completions bash > ~/.local/share/bash-completion/completions/rosarium"
    )]
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
}

/// How a command ended when it did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    Done,
    CheckFailed,
    /// By Ctrl-C.
    Stopped,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    progress::start_logging(cli.global);
    match run(&cli) {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::CheckFailed) => ExitCode::from(1),
        Ok(Outcome::Stopped) => ExitCode::from(130),
        Err(rosarium::Error::Cancelled) => {
            progress::say(cli.global, "stopped; nothing was written");
            ExitCode::from(130)
        }
        Err(error) => {
            report::show(&error);
            ExitCode::from(2)
        }
    }
}

fn run(cli: &Cli) -> Result<Outcome> {
    let global = cli.global;
    if let Some(n) = global.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(n as usize)
            .build_global()
            .map_err(|e| rosarium::Error::invalid("--threads", e.to_string()))?;
    }
    match &cli.command {
        Command::Render(args) => render::run(args, global),
        Command::Light(args) => light::run(args, global),
        Command::Measure(args) => measure::run(args, global),
        Command::Fit(args) => fit::run(args, global),
        Command::Colour(args) => colour::run(args, global),
        Command::Convert(args) => convert::run(args, global),
        Command::Plot(args) => plot::run(args, global),
        Command::Cells(args) => cells::run(args, global),
        Command::Swatch(args) => swatch::run(args, global),
        Command::Grow(args) => grow::run(args, global),
        Command::Compare(args) => compare::run(args, global),
        Command::Check(args) => check::run(args, global),
        Command::Reproduce(args) => reproduce::run(args, global),
        Command::Schema => {
            let mut text = serde_json::to_string_pretty(&rosarium::scene::schema())
                .map_err(|e| rosarium::Error::invalid("schema", e.to_string()))?;
            text.push('\n');
            output::print(text.as_bytes())
        }
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut Cli::command(), "rosarium", &mut script);
            output::print(&script)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_are_consistent() {
        Cli::command().debug_assert();
    }
}

//! `rosarium reproduce laws`: the laws of petal optics, measured.

use std::path::Path;

use rosarium::io::line_chart;
use rosarium::validate::laws::{Effort, LAWS, page};
use rosarium::{Error, Result};

use crate::output::Output;
use crate::{Global, Outcome, progress};

/// Measures the laws and writes the page into a folder.
pub(super) fn run(folder: &Path, walks: u64, seed: u64, global: Global) -> Result<Outcome> {
    if !(1000..=1_000_000_000).contains(&walks) {
        return Err(Error::invalid("--walks", format!("{walks} is not within 1000 to 1e9")));
    }
    let plots = folder.join("plots");
    std::fs::create_dir_all(&plots).map_err(|e| Error::io(&plots, e))?;
    let target = Output::prepare("--output", &folder.join("laws.md"), &["md"])?;
    progress::listen_for_ctrl_c();
    let effort = Effort { walks, seed };
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
    let seed = if seed == 0 { String::new() } else { format!(" --seed {seed}") };
    let command = format!("rosarium reproduce laws --walks {walks}{seed} -o docs");
    target.write(page::markdown(&laws, &command, effort).as_bytes())?;
    progress::say(global, &format!("{}: {} laws", target.path().display(), laws.len()));
    Ok(Outcome::Done)
}

//! `rosarium measure -o petal.optics`: a petal measured once for all wavelengths and amounts of pigment.

use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use rosarium::gonio::{Estimate, PetalOptics, WhiteMonteCarlo};
use rosarium::io::petal_optics;
use rosarium::micro::CellWalk;
use rosarium::{Error, Result};
use serde::Serialize;

use crate::input::{self, Overrides};
use crate::output::Output;
use crate::progress::Bar;
use crate::{Global, progress, report};

/// Does the output's name ask for a measurement for all wavelengths?
pub(crate) fn is_asked_for(output: &Path) -> bool {
    output.extension().is_some_and(|e| e.eq_ignore_ascii_case("optics"))
}

/// What was measured, for `--json`.
#[derive(Serialize)]
struct Summary<'a> {
    sample: &'a str,
    walks_per_side: u64,
    seconds: f64,
    walks_per_second: f64,
    bytes: usize,
    classes: usize,
    class_error: f64,
    asymmetry: f64,
    cut_off: u64,
    white_totals: &'a [rosarium::gonio::WhiteTotals],
}

/// Measures a petal, writes the file and tells its totals.
pub(crate) fn run(
    argument: &str,
    overrides: &Overrides,
    (path, settings): (&Path, &WhiteMonteCarlo),
    json: bool,
    global: Global,
) -> Result<String> {
    settings.validate().map_err(name_flag)?;
    let file = Output::prepare("--output", path, &["optics"])?;
    let petal = input::petal(argument, overrides)?;
    let start = Instant::now();
    let optics = measure_optics(&petal, settings)?;
    let seconds = start.elapsed().as_secs_f64();
    let bytes = petal_optics::write(&optics)?;
    file.write(&bytes)?;
    progress::say(global, &format!("{}: measured petal", file.path().display()));
    if optics.cut_off > 0 {
        let what = format!("warning: {} walks were cut off; no total has their light", optics.cut_off);
        progress::say(global, &what);
    }
    let summary = Summary {
        sample: &optics.sample,
        walks_per_side: optics.walks,
        seconds,
        walks_per_second: 2.0 * optics.walks as f64 / seconds.max(1e-9),
        bytes: bytes.len(),
        classes: optics.paths_um.len(),
        class_error: optics.class_error,
        asymmetry: optics.asymmetry,
        cut_off: optics.cut_off,
        white_totals: &optics.totals,
    };
    if json {
        let mut text =
            serde_json::to_string(&summary).map_err(|e| Error::invalid("--json", e.to_string()))?;
        text.push('\n');
        return Ok(text);
    }
    Ok(for_people(&summary))
}

/// Measures the tissue of a petal at its age.
pub(crate) fn measure_optics(petal: &input::Petal, settings: &WhiteMonteCarlo) -> Result<PetalOptics> {
    let input::Petal { name, loaded, .. } = petal;
    let mut description = loaded.description.clone();
    let locate = |e| loaded.source.locate(e);
    let tissue = description.build_tissue("").map_err(locate)?.ok_or_else(|| {
        Error::invalid(
            name,
            "has no [tissue]: light cannot be followed through a petal that is shaded by coefficients",
        )
    })?;
    // The file describes the cells that were measured.
    description.cells = description.grown_cells("").map_err(locate)?;
    description.age = None;
    let text = toml::to_string(&description).map_err(|e| Error::invalid(name, e.to_string()))?;
    let depth_um = tissue.depth_um;
    let walk = CellWalk::new(Arc::new(tissue));
    let bar = Bar::new("measure");
    let optics = settings.measure(&walk, depth_um, &|done, total| bar.step(done, total))?;
    Ok(PetalOptics { sample: name.clone(), description: text, ..optics })
}

fn name_flag(error: Error) -> Error {
    match &error {
        Error::Invalid { at, .. } if at == "white.walks" => report::at_flag("--rays", error),
        _ => error,
    }
}

/// The totals as a table. Writing to a String cannot fail.
fn for_people(s: &Summary) -> String {
    let mut out = String::new();
    let _ = writeln!(
        out,
        "{}: {} walks per side, {:.3e} walks/s, {:.2} MB\n{} classes of walks, error {:.5}; asymmetry {:.2} %; {} cut off\n",
        s.sample,
        s.walks_per_side,
        s.walks_per_second,
        s.bytes as f64 * 1e-6,
        s.classes,
        s.class_error,
        100.0 * s.asymmetry,
        s.cut_off
    );
    let _ = writeln!(
        out,
        "white light\n{:<18}  {:<19}  {:<19}  {:<19}",
        "lit side, lamp", "surface", "from within", "through"
    );
    let number = |e: &Estimate| format!("{:.5} ± {:.5}", e.value, e.standard_error);
    for t in s.white_totals {
        let lit = format!("{} {:>4} deg", crate::spectral::side_name(t.side), t.incident_deg);
        let _ = writeln!(
            out,
            "{lit:<18}  {:<19}  {:<19}  {:<19}",
            number(&t.surface),
            number(&t.interior),
            number(&t.transmitted)
        );
    }
    out
}

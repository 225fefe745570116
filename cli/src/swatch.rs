//! `rosarium swatch`.

use std::path::PathBuf;

use rosarium::Result;
use rosarium::geometry::Side;
use rosarium::gonio::{ExitantGrid, GonioTable, Goniophotometer, PlaneScan};
use rosarium::io::swatch::{Swatch, sheet};
use rosarium::scene::description::PetalDescription;
use rosarium::scene::petal::PRESETS;
use rosarium::spectrum::Illuminant;

use crate::input::{self, Overrides};
use crate::output::Output;
use crate::progress::Bar;
use crate::sample::Sample;
use crate::{Global, Outcome, progress, report};

/// Draw a sheet of petals: what they look like from both sides, their spectra and their lobes.
///
/// Measures each petal from both sides in 41 bands and shows, in one exposure, balls of petal under parallel light: the upper
/// side, the lower side, and the upper side lit from behind; beside them the colours, the spectra of both sides, and the lobes
/// in the plane of incidence. The petals' azimuth is averaged over.
#[derive(Debug, clap::Args)]
#[command(after_help = input::with_presets("\
Examples:
  rosarium swatch -o swatch.png
  rosarium swatch rote_rose black my_petal.toml --rays 1e6 -o dark.png
  rosarium swatch rote_rose -D age=0.2 --illuminant A -o bud.svg"))]
pub(crate) struct Args {
    /// Presets or petal files (.toml). Default: all presets.
    #[arg(value_name = "NAME|FILE")]
    petals: Vec<String>,
    /// Picture to write: .png or .svg.
    #[arg(short, long, value_name = "FILE", default_value = "swatch.png")]
    output: PathBuf,
    /// Light that the petals are seen in: A, D50, D65, E or a temperature such as 3000K.
    #[arg(long, value_name = "NAME", default_value = "D65")]
    illuminant: Illuminant,
    /// Paths of light per petal, side and angle of the lamp, such as 250000 or 1e6.
    #[arg(long, value_name = "N", default_value = "2e5", allow_negative_numbers = true, value_parser = input::count)]
    rays: u64,
    /// Seed of the paths.
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    seed: u64,
    #[command(flatten)]
    overrides: Overrides,
}

/// Angles of the lamp, degrees: balls are lit at all angles.
const INCIDENT_DEG: [f64; 6] = [0.0, 20.0, 40.0, 60.0, 75.0, 85.0];

pub(crate) fn run(args: &Args, global: Global) -> Result<Outcome> {
    let output = Output::prepare("--output", &args.output, &["png", "svg"])?;
    args.illuminant.spectrum().map_err(|e| report::at_flag("--illuminant", e))?;
    let gonio = |side| Goniophotometer {
        incident_deg: INCIDENT_DEG.to_vec(),
        side,
        rays: args.rays,
        seed: args.seed,
        bands_nm: (0..=40).map(|i| 380.0 + 10.0 * f64::from(i)).collect(),
        exitant: ExitantGrid { theta_step_deg: 7.5, phi_step_deg: 15.0 },
        // Wide bins for smooth lobes.
        scan: PlaneScan { step_deg: 5.0, half_width_deg: 15.0 },
        spin: true,
    };
    gonio(Side::Adaxial).validate().map_err(|e| report::at_flag("--rays", e))?;
    let names: Vec<String> = if args.petals.is_empty() {
        PRESETS.iter().map(|p| p.0.to_owned()).collect()
    } else {
        args.petals.clone()
    };
    let mut petals = Vec::new();
    for name in &names {
        let petal = input::petal(name, &args.overrides)?;
        let description = &petal.loaded.description;
        let sample = Sample::new(description, &petal.assets).map_err(|e| petal.loaded.source.locate(e))?;
        petals.push((petal.name, about(description), sample));
    }
    let bar = Bar::new("measure");
    let parts = 2 * petals.len() as u64;
    let mut part = 0;
    let mut tables: Vec<[GonioTable; 2]> = Vec::new();
    for (name, _, sample) in &petals {
        let mut measure = |side| -> Result<GonioTable> {
            let table =
                sample.measure(&gonio(side), &|done, total| bar.step(part * total + done, parts * total))?;
            part += 1;
            if table.cut_off() > 0 {
                let line = format!("warning: {name}: {} walks were cut off", table.cut_off());
                progress::say(global, &line);
            }
            Ok(table)
        };
        tables.push([measure(Side::Adaxial)?, measure(Side::Abaxial)?]);
    }
    drop(bar);
    let swatches: Vec<Swatch> = petals
        .iter()
        .zip(&tables)
        .map(|((name, about, _), [adaxial, abaxial])| Swatch { name, about, adaxial, abaxial })
        .collect();
    let picture = sheet(&swatches, args.illuminant)?;
    let bytes = if output.format == "svg" { picture.svg().into_bytes() } else { picture.png()? };
    output.write(&bytes)?;
    progress::say(global, &format!("{}: {} petals", output.path().display(), petals.len()));
    Ok(Outcome::Done)
}

/// What a petal is, in a few words.
fn about(petal: &PetalDescription) -> String {
    let cells = petal.grown_cells("").unwrap_or_else(|_| petal.cells.clone());
    let mut words =
        vec![format!("cells {:.1} µm wide, domes {:.1} µm high", cells.pitch_um, cells.height_um)];
    if let Some(age) = petal.age {
        words.push(format!("age {age}"));
    }
    if petal.tissue.is_none() {
        words.push("shaded by coefficients".to_owned());
    }
    words.join("; ")
}

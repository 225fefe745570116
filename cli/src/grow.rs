//! `rosarium grow`.

use std::path::PathBuf;

use clap::builder::PossibleValuesParser;
use rosarium::flower::crossings::crossings;
use rosarium::flower::{self, OrganKind, RoseDescription};
use rosarium::geometry::Mesh;
use rosarium::scene::load;
use rosarium::{Error, Result, io};

use crate::input::Overrides;
use crate::output::Output;
use crate::{Global, Outcome, progress, report};

/// Grow a rose and write it as a mesh.
///
/// The mesh has one part per petal, sepal, leaflet and stalk of a leaf, and one each for the receptacle, the stem, all
/// prickles, filaments, anthers and styles, in millimetres, +z up, with normals and texture coordinates.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Keys of -D are those of a rose in a scene file: petals, irregularity, petal.length_mm, bloom.outer_deg ...
(`rosarium schema` lists them).

Examples:
  rosarium grow                                  rose.ply
  rosarium grow --preset wild -o wild.glb
  rosarium grow --openness 0.2 --detail final -o bud.ply
  rosarium grow --seed 3 --check                 does anything cross anything?
  rosarium grow -o rose.obj --seed 7 -D petals=24 -D petal.ruffle_mm=2")]
pub(crate) struct Args {
    /// File to write: .ply, .obj or .glb. Repeatable. Default: rose.ply.
    #[arg(short, long, value_name = "FILE")]
    output: Vec<PathBuf>,
    /// The rose that -D changes.
    #[arg(long, value_name = "NAME", default_value = "hybrid_tea", value_parser = PossibleValuesParser::new(RoseDescription::PRESETS))]
    preset: String,
    /// Seed of what differs between two roses of one kind.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    seed: Option<u64>,
    /// How far the flower has opened: 0 = bud, 1 = bloom, 1.3 = overblown.
    #[arg(long, value_name = "X", allow_negative_numbers = true)]
    openness: Option<f64>,
    /// Fineness of the mesh: `preview` (about 20 000 triangles), `final` (about 5 million), or a number; 1 is
    /// what scenes use, triangles grow with its square.
    #[arg(long, value_name = "NAME|X", value_parser = detail)]
    detail: Option<f64>,
    /// Count the pairs of triangles that cross each other; exit with 1 if those of petals do.
    #[arg(long)]
    check: bool,
    #[command(flatten)]
    overrides: Overrides,
}

fn detail(text: &str) -> std::result::Result<f64, String> {
    let names = RoseDescription::DETAILS;
    match names.iter().find(|(name, _)| *name == text) {
        Some((_, value)) => Ok(*value),
        None => text.parse().map_err(|_| format!("neither {}, {} nor a number", names[0].0, names[1].0)),
    }
}

pub(crate) fn run(args: &Args, global: Global) -> Result<Outcome> {
    let default = [PathBuf::from("rose.ply")];
    let paths = if args.output.is_empty() { &default[..] } else { &args.output };
    let outputs = Output::prepare_all("--output", paths, &["ply", "obj", "glb"])?;

    let preset: RoseDescription = args.preset.parse().map_err(|e| report::at_flag("--preset", e))?;
    let text = toml::to_string(&preset).map_err(|e| Error::invalid("--preset", e.to_string()))?;
    let loaded =
        load::<RoseDescription>(&text, &format!("{} (built in)", args.preset), &args.overrides.define)?;
    let mut description = loaded.description;
    if let Some(seed) = args.seed {
        description.seed = seed;
    }
    description.openness = args.openness.unwrap_or(description.openness);
    description.detail = args.detail.unwrap_or(description.detail);
    description.validate("").map_err(|e| loaded.source.locate(e))?;
    let flower = flower::grow(&description).map_err(|e| loaded.source.locate(e))?;

    let names: Vec<String> = flower
        .organs
        .iter()
        .map(|o| format!("{}_{}", format!("{:?}", o.kind).to_lowercase(), o.index))
        .collect();
    let parts: Vec<(&str, &Mesh)> =
        names.iter().map(String::as_str).zip(flower.organs.iter().map(|o| &o.mesh)).collect();
    for output in &outputs {
        let bytes = match output.format {
            "ply" => io::ply::write(&parts)?,
            "obj" => io::obj::write(&parts)?,
            _ => {
                let colors: Vec<[f32; 3]> = flower.organs.iter().map(|o| color(o.kind)).collect();
                io::gltf::write(&parts, &colors)?
            }
        };
        output.write(&bytes)?;
        let line = format!(
            "{}: {} petals, {} parts, {} triangles",
            output.path().display(),
            description.petals,
            parts.len(),
            flower.triangle_count()
        );
        progress::say(global, &line);
    }
    if args.check {
        let report = crossings(&flower);
        let petals = report.between_kinds(OrganKind::Petal, OrganKind::Petal);
        progress::say(
            global,
            &format!("{petals} crossing pairs of triangles of petals, {} in all", report.total()),
        );
        if report.total() > 0 {
            progress::say(global, &report.to_string());
            return Ok(Outcome::CheckFailed);
        }
    }
    Ok(Outcome::Done)
}

/// Base colours for viewers of .glb files, linear sRGB.
fn color(kind: OrganKind) -> [f32; 3] {
    match kind {
        OrganKind::Petal => [0.45, 0.01, 0.03],
        OrganKind::Sepal | OrganKind::Leaf => [0.05, 0.14, 0.03],
        OrganKind::Receptacle | OrganKind::Stem => [0.08, 0.18, 0.05],
        OrganKind::Prickle => [0.22, 0.10, 0.055],
        OrganKind::Filament => [0.55, 0.47, 0.16],
        OrganKind::Anther => [0.62, 0.38, 0.05],
        OrganKind::Style => [0.42, 0.45, 0.18],
    }
}

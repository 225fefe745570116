//! `rosarium cells`.

use std::path::PathBuf;

use rosarium::Result;
use rosarium::io::{self, cell_plot};
use rosarium::micro::{CellField, tile_mesh};

use crate::input::{self, Overrides};
use crate::output::Output;
use crate::{Global, Outcome, progress};

/// Write a tile of a petal's cells as a mesh, and plot it.
///
/// The tile repeats seamlessly; its mesh is in micrometres, +z up. The plot shows the cells from above and a
/// section through a row of them.
#[derive(Debug, clap::Args)]
#[command(after_help = input::with_presets("\
Examples:
  rosarium cells thesis -o cells.ply --plot cells.png
  rosarium cells thesis --plot cone.svg -D cells.profile=cone -D cells.height_um=50
  rosarium cells thesis -o wild.obj -D cells.center_disorder=0.1 -D cells.tile_cells=8 --resolution 24"))]
pub(crate) struct Args {
    /// Name of a preset, or a petal file (.toml).
    #[arg(value_name = "NAME|FILE")]
    petal: String,
    /// Mesh to write: .ply or .obj. Repeatable. Default: cells.ply, unless there is a --plot.
    #[arg(short, long, value_name = "FILE")]
    output: Vec<PathBuf>,
    /// Plot to write: .svg or .png. Repeatable.
    #[arg(long, value_name = "FILE")]
    plot: Vec<PathBuf>,
    /// Rings of triangles on each cell.
    #[arg(long, value_name = "N", default_value_t = 12, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=256))]
    resolution: u32,
    #[command(flatten)]
    overrides: Overrides,
}

pub(crate) fn run(args: &Args, global: Global) -> Result<Outcome> {
    let default = [PathBuf::from("cells.ply")];
    let paths = if args.output.is_empty() && args.plot.is_empty() { &default[..] } else { &args.output };
    let meshes = Output::prepare_all("--output", paths, &["ply", "obj"])?;
    let plots = Output::prepare_all("--plot", &args.plot, &["svg", "png"])?;

    let input::Petal { name, loaded, .. } = input::petal(&args.petal, &args.overrides)?;
    loaded.description.cells.validate("cells").map_err(|e| loaded.source.locate(e))?;
    let cells = loaded.description.grown_cells("").map_err(|e| loaded.source.locate(e))?;
    let field = CellField::new(&cells).map_err(|e| loaded.source.locate(e))?;

    if !meshes.is_empty() {
        let mesh = tile_mesh::tile_mesh(&field, [1, 1], args.resolution);
        let size = field.tile_um();
        for output in &meshes {
            let bytes = match output.format {
                "ply" => io::ply::write(&[("cells", &mesh)])?,
                _ => io::obj::write(&[("cells", &mesh)])?,
            };
            output.write(&bytes)?;
            let line = format!(
                "{}: {} cells on {:.1} x {:.1} um, {} triangles",
                output.path().display(),
                field.cell_count(),
                size.x,
                size.y,
                mesh.triangles.len()
            );
            progress::say(global, &line);
        }
    }
    for output in &plots {
        let bytes = match output.format {
            "svg" => cell_plot::svg(&field, &name)?.into_bytes(),
            _ => cell_plot::png(&field, &name)?,
        };
        output.write(&bytes)?;
        progress::say(global, &format!("{}: plot", output.path().display()));
    }
    Ok(Outcome::Done)
}

//! The cells of the cell model on the command line, and the folder that keeps their geometric factors.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rosarium::gonio::cell_factors::{CellFactors, FactorSettings};
use rosarium::gonio::cell_family::{Axis, CellFamily, ShapeParameter};
use rosarium::micro::CellDescription;
use rosarium::{Error, Result};
use sha2::{Digest, Sha256};

use crate::input::{self, Overrides};
use crate::progress::Bar;
use crate::{Global, fit, progress};

/// Tables per cell parameter that is fitted.
const NODES: usize = 5;

/// The cells of the cell model.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Cells of the cell model")]
pub(crate) struct CellArgs {
    /// Petal whose cells are taken: a preset or a petal file. `-D cells.height_um=25` changes them.
    #[arg(long, value_name = "NAME|FILE", default_value = "thesis")]
    cells: String,
    /// Fit this number of the cells too: height_um, center_disorder or height_disorder; at most two. Repeatable.
    #[arg(long, value_name = "KEY=LOW..HIGH")]
    vary: Vec<String>,
    /// Folder that keeps what is computed once per shape of cells. Default: rosarium in the user's cache folder.
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    #[command(flatten)]
    overrides: Overrides,
}

impl CellArgs {
    /// The cells, as the user described them.
    pub(crate) fn description(&self) -> Result<CellDescription> {
        let petal = input::petal(&self.cells, &self.overrides)?;
        let cells = petal.loaded.description.grown_cells("").map_err(|e| petal.loaded.source.locate(e))?;
        cells.validate("cells").map_err(|e| petal.loaded.source.locate(e))?;
        Ok(cells)
    }

    fn axes(&self) -> Result<Vec<Axis>> {
        let known =
            [ShapeParameter::HeightUm, ShapeParameter::CenterDisorder, ShapeParameter::HeightDisorder];
        let axis = |wish: &String| {
            let wrong = |what: String| Error::invalid(format!("--vary {wish}"), what);
            let (name, bounds) = wish.split_once('=').ok_or_else(|| wrong("not KEY=LOW..HIGH".into()))?;
            let name = name.trim().trim_start_matches("cells.");
            let parameter = known.into_iter().find(|p| p.name() == name).ok_or_else(|| {
                wrong(format!("`{name}` is not one of {}", known.map(ShapeParameter::name).join(", ")))
            })?;
            let (min, max) =
                fit::range(bounds).ok_or_else(|| wrong(format!("`{bounds}` is not LOW..HIGH")))?;
            Ok(Axis { parameter, min, max, nodes: NODES })
        };
        self.vary.iter().map(axis).collect()
    }

    /// Geometric factors of the cells: read from the cache, or computed and kept there.
    pub(crate) fn family(&self, global: Global) -> Result<Arc<CellFamily>> {
        let (cells, axes) = (self.description()?, self.axes()?);
        let shapes = CellFamily::shapes(&cells, &axes)?;
        let cache = self.cache.clone().or_else(default_cache);
        let bar = Bar::new("cells");
        let settings = FactorSettings::default();
        let mut members = Vec::with_capacity(shapes.len());
        for (i, shape) in shapes.iter().enumerate() {
            let file = cache.as_ref().map(|dir| dir.join(file_name(shape, &settings)));
            if let Some(found) = file.as_deref().and_then(|f| kept(f, shape, &settings)) {
                members.push(found);
                continue;
            }
            let (before, count) = (i as u64, shapes.len() as u64);
            let factors = CellFactors::compute(shape, &settings, &|done, total| {
                bar.step(before * total + done, count * total)
            })?;
            if let Some(file) = &file {
                keep(file, &factors, global);
            }
            members.push(factors);
        }
        Ok(Arc::new(CellFamily::from_members(&cells, &axes, members)?))
    }
}

/// `$XDG_CACHE_HOME/rosarium` or `~/.cache/rosarium`.
pub(crate) fn default_cache() -> Option<PathBuf> {
    let folder = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let base = folder("XDG_CACHE_HOME")
        .or_else(|| folder("LOCALAPPDATA"))
        .or_else(|| folder("HOME").map(|home| home.join(".cache")))?;
    Some(base.join("rosarium"))
}

/// A name that changes with anything that the table depends on.
fn file_name(cells: &CellDescription, settings: &FactorSettings) -> String {
    let what = format!("{} {cells:?} {settings:?}", env!("CARGO_PKG_VERSION"));
    let hash: String = Sha256::digest(what).iter().take(16).map(|b| format!("{b:02x}")).collect();
    format!("cells-{hash}.bin")
}

/// The table in a file of the cache. A damaged or foreign file is computed again, not an error.
fn kept(file: &Path, cells: &CellDescription, settings: &FactorSettings) -> Option<CellFactors> {
    let bytes = fs::read(file).ok()?;
    match CellFactors::from_bytes(&bytes, &file.display().to_string()) {
        Ok(factors) if factors.cells() == cells && factors.settings() == settings => {
            tracing::info!(file = %file.display(), "geometric factors read");
            Some(factors)
        }
        Ok(_) => None,
        Err(e) => {
            tracing::warn!("computed again: {e}");
            None
        }
    }
}

/// Keeps a table. Without a place for it the work is done, only not kept.
fn keep(file: &Path, factors: &CellFactors, global: Global) {
    if let Err(e) = write_whole(file, &factors.to_bytes()) {
        progress::say(global, &format!("{}: not kept for the next fit: {e}", file.display()));
    }
}

/// Writes a file of the cache at once, so that nobody reads half of it.
pub(crate) fn write_whole(file: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let folder = file.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)?;
    let mut temporary = tempfile::NamedTempFile::new_in(folder)?;
    std::io::Write::write_all(&mut temporary, bytes)?;
    temporary.persist(file)?;
    Ok(())
}

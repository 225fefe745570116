//! Files beside a description, and measured petals that are kept between runs.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rosarium::Result;
use rosarium::gonio::PetalOptics;
use rosarium::io::petal_optics;
use rosarium::scene::{Assets, DiskAssets, MeasureOptics};
use sha2::{Digest, Sha256};

use crate::progress::Bar;
use crate::{Global, cell_model, progress};

/// Reads beside a description; measured petals come from a folder of the cache.
pub(crate) struct CachedAssets {
    disk: DiskAssets,
    cache: Option<PathBuf>,
    global: Global,
}

impl CachedAssets {
    /// `cache`: the folder, instead of rosarium's in the user's cache folder.
    pub(crate) fn new(disk: DiskAssets, cache: Option<PathBuf>, global: Global) -> Self {
        Self { disk, cache: cache.or_else(cell_model::default_cache), global }
    }
}

impl Assets for CachedAssets {
    fn read(&self, path: &str) -> Result<Vec<u8>> {
        self.disk.read(path)
    }

    fn optics(&self, key: &str, measure: MeasureOptics) -> Result<Arc<PetalOptics>> {
        let hash: String = Sha256::digest(key).iter().take(16).map(|b| format!("{b:02x}")).collect();
        let file = self.cache.as_ref().map(|folder| folder.join(format!("petal-{hash}.optics")));
        if let Some(optics) = file.as_deref().and_then(kept) {
            return Ok(Arc::new(optics));
        }
        let bar = Bar::new("measure");
        let optics = measure(&|done, total| bar.step(done, total))?;
        drop(bar);
        if let Some(file) = &file {
            keep(file, &optics, self.global);
        }
        Ok(Arc::new(optics))
    }
}

/// A petal of the cache. A damaged file is measured again, not an error.
fn kept(file: &Path) -> Option<PetalOptics> {
    let bytes = fs::read(file).ok()?;
    match petal_optics::read(&bytes) {
        Ok(optics) => {
            tracing::info!(file = %file.display(), "measured petal read");
            Some(optics)
        }
        Err(e) => {
            tracing::warn!("{}: measured again: {e}", file.display());
            None
        }
    }
}

/// Keeps a petal. Without a place for it the work is done, only not kept.
fn keep(file: &Path, optics: &PetalOptics, global: Global) {
    let written = petal_optics::write(optics).map_err(|e| e.to_string());
    if let Err(e) = written.and_then(|bytes| cell_model::write_whole(file, &bytes).map_err(|e| e.to_string()))
    {
        progress::say(global, &format!("{}: not kept for the next run: {e}", file.display()));
    }
}

//! The only door through which a scene reaches files: tables, images, meshes.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;

use super::hash::Fnv128;
use crate::gonio::PetalOptics;
use crate::gonio::goniophotometer::Progress;
use crate::{Error, Result};

/// Measures a petal, telling of its progress.
pub type MeasureOptics<'a> = &'a dyn Fn(Progress) -> Result<PetalOptics>;

/// Gives the bytes of a file that a scene names, and what takes long to make.
pub trait Assets {
    /// Reads the whole file at `path`, as the scene writes it.
    fn read(&self, path: &str) -> Result<Vec<u8>>;

    /// The measured petal that `key` names completely. A front end may keep it, and show how far `measure` is.
    fn optics(&self, key: &str, measure: MeasureOptics) -> Result<Arc<PetalOptics>> {
        let _ = key;
        measure(&|_, _| ControlFlow::Continue(())).map(Arc::new)
    }
}

/// Files on disk, relative to the scene file's folder.
#[derive(Clone, Debug)]
pub struct DiskAssets {
    /// The folder.
    pub base: PathBuf,
}

impl Assets for DiskAssets {
    fn read(&self, path: &str) -> Result<Vec<u8>> {
        let full = self.base.join(path);
        std::fs::read(&full).map_err(|source| Error::io(full, source))
    }
}

/// Files in memory, by name: for tests, the built-in scene and front ends without a disk.
#[derive(Clone, Debug, Default)]
pub struct MemoryAssets {
    /// Bytes by path.
    pub files: BTreeMap<String, Vec<u8>>,
}

impl Assets for MemoryAssets {
    fn read(&self, path: &str) -> Result<Vec<u8>> {
        self.files.get(path).cloned().ok_or_else(|| {
            Error::io(path, std::io::Error::new(std::io::ErrorKind::NotFound, "no such file in memory"))
        })
    }
}

/// Feeds all that is read into the scene's hash.
pub(super) struct HashedAssets<'a> {
    inner: &'a dyn Assets,
    hash: RefCell<Fnv128>,
}

impl<'a> HashedAssets<'a> {
    /// Continues `hash` with every file read through the result.
    pub(super) fn new(inner: &'a dyn Assets, hash: Fnv128) -> Self {
        Self { inner, hash: RefCell::new(hash) }
    }

    /// The hash of everything so far.
    pub(super) fn finish(self) -> u128 {
        self.hash.into_inner().finish()
    }
}

impl Assets for HashedAssets<'_> {
    fn read(&self, path: &str) -> Result<Vec<u8>> {
        let bytes = self.inner.read(path)?;
        let mut hash = self.hash.borrow_mut();
        hash.write(&(bytes.len() as u64).to_le_bytes());
        hash.write(&bytes);
        Ok(bytes)
    }

    // What is measured follows from the description, which is in the hash already.
    fn optics(&self, key: &str, measure: MeasureOptics) -> Result<Arc<PetalOptics>> {
        self.inner.optics(key, measure)
    }
}

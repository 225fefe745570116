//! Steps of a fit, told to the caller, who may stop it.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::{Error, Result};

/// Told `(done, total)`; may stop the fit.
pub(crate) type Progress<'a> = &'a (dyn Fn(u64, u64) -> ControlFlow<()> + Sync);

/// Counts steps over all threads.
pub(crate) struct Steps<'a> {
    done: AtomicU64,
    total: AtomicU64,
    stopped: AtomicBool,
    tell: Progress<'a>,
}

impl<'a> Steps<'a> {
    pub(crate) fn new(tell: Progress<'a>) -> Self {
        Self { done: AtomicU64::new(0), total: AtomicU64::new(0), stopped: AtomicBool::new(false), tell }
    }

    /// More to do than was thought.
    pub(crate) fn add(&self, steps: u64) {
        self.total.fetch_add(steps, Ordering::Relaxed);
    }

    /// One step is done.
    pub(crate) fn done(&self) -> Result<()> {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        let total = self.total.load(Ordering::Relaxed).max(done);
        if self.stopped.load(Ordering::Relaxed) || (self.tell)(done, total).is_break() {
            self.stopped.store(true, Ordering::Relaxed);
            return Err(Error::Cancelled);
        }
        Ok(())
    }
}

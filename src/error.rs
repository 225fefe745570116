//! The one error type of the library. Library code never panics on input and never prints.

use std::path::PathBuf;

/// Result with the library's [`enum@Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Everything that can go wrong on valid calls with real input.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file could not be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// A value, key or file is wrong.
    #[error("{at}: {what}")]
    Invalid {
        /// Where: a dotted key (`cells.height_um`), a file, or `file:line`.
        at: String,
        /// What is wrong and what would be right.
        what: String,
    },
    /// Valid, but not something that this version can do.
    #[error("not supported: {0}")]
    Unsupported(String),
    /// An iteration ended before its goal.
    #[error("{what} did not converge: residual {residual:.3e}")]
    NotConverged {
        /// The computation.
        what: String,
        /// How far from the goal it stopped.
        residual: f64,
    },
    /// The caller asked to stop.
    #[error("cancelled")]
    Cancelled,
}

impl Error {
    /// [`Error::Invalid`] at a dotted key or file.
    pub fn invalid(at: impl Into<String>, what: impl Into<String>) -> Self {
        Error::Invalid { at: at.into(), what: what.into() }
    }

    /// [`Error::Io`] for a path.
    pub fn io(path: impl Into<PathBuf>, source: std::io::Error) -> Self {
        Error::Io { path: path.into(), source }
    }
}

//! The one error type of the library. Library code never panics on input and never prints.

use std::fmt;
use std::ops::Range;
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
    /// A mistake in a text that the user wrote, with its place.
    #[error(transparent)]
    Source(#[from] Box<SourceError>),
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

/// A mistake in a text that the user wrote: a scene file, or one argument that overrides a key of it.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceError {
    /// The file's name, or the whole argument (`-D film.width=0`).
    pub name: String,
    /// The text that `span` points into.
    pub text: String,
    /// Bytes of `text` that are wrong.
    pub span: Range<usize>,
    /// Line from 1; `None` for an argument, and for what the text lacks.
    pub line: Option<usize>,
    /// Character in the line, from 1.
    pub column: usize,
    /// Dotted key, empty where the text cannot be read at all.
    pub key: String,
    /// What is wrong and what would be right.
    pub what: String,
}

impl fmt::Display for SourceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.name)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        if !self.key.is_empty() {
            write!(f, ": {}", self.key)?;
        }
        write!(f, ": {}", self.what)
    }
}

impl std::error::Error for SourceError {}

//! Files are written whole or not at all.

use std::fs;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use rosarium::{Error, Result};
use tempfile::NamedTempFile;

use crate::Outcome;

/// A file to be written at the end of the work, checked at its beginning.
#[derive(Debug)]
pub(crate) struct Output {
    /// As the user wrote it.
    path: PathBuf,
    /// Where symbolic links lead.
    target: PathBuf,
    /// The extension in lower case, one of those that were allowed.
    pub(crate) format: &'static str,
}

impl Output {
    /// Checks that `path`, given by `flag`, has one of the extensions and can be written.
    pub(crate) fn prepare(flag: &str, path: &Path, formats: &[&'static str]) -> Result<Self> {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let Some(format) = formats.iter().copied().find(|f| *f == extension) else {
            let known: Vec<String> = formats.iter().map(|f| format!(".{f}")).collect();
            let what = format!("the format is chosen by the extension: {}", known.join(" or "));
            return Err(Error::invalid(format!("{flag} {}", path.display()), what));
        };
        let fail = |e| Error::io(path, e);
        let target = match fs::canonicalize(path) {
            Ok(target) => {
                let meta = fs::metadata(&target).map_err(fail)?;
                if !meta.is_file() {
                    return Err(fail(std::io::Error::other("cannot be replaced: it is not a file")));
                }
                if meta.permissions().readonly() {
                    return Err(fail(ErrorKind::PermissionDenied.into()));
                }
                target
            }
            // Not there yet, but its folder must be.
            Err(_) => {
                let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
                fs::canonicalize(folder).map_err(fail)?.join(path.file_name().unwrap_or_default())
            }
        };
        let output = Self { path: path.to_owned(), target, format };
        // Created and removed at once: a killed process leaves nothing behind.
        output.temporary().map_err(fail)?;
        Ok(output)
    }

    /// Several outputs of one flag.
    pub(crate) fn prepare_all(flag: &str, paths: &[PathBuf], formats: &[&'static str]) -> Result<Vec<Self>> {
        let outputs: Vec<Self> =
            paths.iter().map(|p| Self::prepare(flag, p, formats)).collect::<Result<_>>()?;
        for (i, output) in outputs.iter().enumerate() {
            if outputs[..i].iter().any(|o| o.target == output.target) {
                return Err(Error::invalid(format!("{flag} {}", output.path.display()), "given twice"));
            }
        }
        Ok(outputs)
    }

    /// Another file of the same kind: `report.html` and `oak` give `report-oak.html`.
    pub(crate) fn beside(&self, end: &str) -> Result<Self> {
        let stem = self.path.file_stem().unwrap_or_default().to_string_lossy();
        let path = self.path.with_file_name(format!("{stem}-{end}.{}", self.format));
        Self::prepare("--output", &path, &[self.format])
    }

    /// As the user wrote it.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the file: beside its place first, then moved there.
    pub(crate) fn write(&self, bytes: &[u8]) -> Result<()> {
        let write = || {
            let mut file = self.temporary()?;
            file.write_all(bytes)?;
            file.as_file().sync_all()?;
            file.persist(&self.target).map_err(|e| e.error)?;
            Ok(())
        };
        write().map_err(|e| Error::io(&self.path, e))
    }

    fn temporary(&self) -> std::io::Result<NamedTempFile> {
        let folder = self.target.parent().unwrap_or(Path::new("."));
        let mut builder = tempfile::Builder::new();
        builder.prefix(".rosarium-");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // What every program asks for; the user's mask takes away from it.
            builder.permissions(fs::Permissions::from_mode(0o666));
        }
        builder.tempfile_in(folder)
    }
}

/// Writes to standard output. A reader that has seen enough is no error.
pub(crate) fn print(bytes: &[u8]) -> Result<Outcome> {
    let mut out = std::io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Ok(()) => Ok(Outcome::Done),
        Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(Outcome::Done),
        Err(e) => Err(Error::io("standard output", e)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replaces_a_file_whole_and_leaves_nothing_else() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("a.CSV");
        fs::write(&path, "old and long").expect("written");
        let output = Output::prepare("--output", &path, &["svg", "csv"]).expect("writable");
        assert_eq!(output.format, "csv");
        assert_eq!(fs::read(&path).expect("still there"), b"old and long");
        output.write(b"new").expect("written");
        assert_eq!(fs::read(&path).expect("there"), b"new");
        assert_eq!(fs::read_dir(dir.path()).expect("readable").count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_a_link() {
        use std::os::unix::fs::PermissionsExt;
        let dir = tempfile::tempdir().expect("a folder");
        let (real, link) = (dir.path().join("real.png"), dir.path().join("link.png"));
        fs::write(&real, "old").expect("written");
        std::os::unix::fs::symlink(&real, &link).expect("linked");
        Output::prepare("--output", &link, &["png"]).and_then(|o| o.write(b"new")).expect("written");
        assert!(fs::symlink_metadata(&link).expect("there").is_symlink());
        assert_eq!(fs::read(&real).expect("there"), b"new");
        // The user's mask decides who reads it, not the temporary file's privacy.
        let other = dir.path().join("other");
        fs::write(&other, "").expect("written");
        let mode = |p: &Path| fs::metadata(p).expect("there").permissions().mode();
        assert_eq!(mode(&real), mode(&other));
    }

    #[test]
    fn two_names_of_one_file_are_refused() {
        let dir = tempfile::tempdir().expect("a folder");
        let paths = [dir.path().join("a.png"), dir.path().join(".").join("a.png")];
        assert!(Output::prepare_all("--output", &paths, &["png"]).is_err());
    }
}

//! Errors for people: the message, and the place in their file.

use std::io::{IsTerminal, Write};

use miette::{LabeledSpan, MietteDiagnostic, MietteHandlerOpts, NamedSource, Report};
use rosarium::Error;

/// Writes an error to standard error.
pub(crate) fn show(error: &Error) {
    // The only hook that this program sets, so it cannot have been set before.
    let _ = miette::set_hook(Box::new(|_| {
        let options = MietteHandlerOpts::new();
        // Lines are broken for people only: a log keeps a message on one line.
        let options = if std::io::stderr().is_terminal() { options } else { options.width(10_000) };
        Box::new(options.build())
    }));
    // Nothing is left to do where standard error is closed.
    let _ = writeln!(std::io::stderr(), "Error: {:?}", report(error));
}

fn report(error: &Error) -> Report {
    let diagnostic = MietteDiagnostic::new(error.to_string());
    match error {
        // An argument is short enough to stand in the message alone.
        Error::Source(e) if e.line.is_some() && !e.text.trim().is_empty() => {
            // A mistake at the end of the text has no bytes: the last one shows where.
            let end = e.span.end.clamp(1, e.text.len());
            let start = e.span.start.min(end - 1);
            let diagnostic = diagnostic.with_label(LabeledSpan::underline(start..end));
            Report::new(diagnostic).with_source_code(NamedSource::new(&e.name, e.text.clone()))
        }
        _ => Report::new(diagnostic),
    }
}

/// The error of a flag: the library names what it was given by its own key.
pub(crate) fn at_flag(flag: &str, error: Error) -> Error {
    match error {
        Error::Invalid { what, .. } => Error::invalid(flag, what),
        other => other,
    }
}

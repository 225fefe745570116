//! From a key to its place in the text that the user wrote.

use std::ops::Range;

use toml::de::{DeTable, DeValue};

use super::load::Override;
use crate::Error;
use crate::error::SourceError;

/// A text with the overrides that were applied to it.
#[derive(Clone, Debug, Default)]
pub struct Source {
    /// The file's name, for messages.
    pub name: String,
    /// The file's text.
    pub text: String,
    /// What was changed from outside.
    pub overrides: Vec<Override>,
}

impl Source {
    /// Gives an [`Error::Invalid`] at a dotted key its place in the text; other errors pass through.
    pub fn locate(&self, error: Error) -> Error {
        match error {
            Error::Invalid { at, what } => {
                let path: Vec<String> = at.split('.').map(str::to_owned).collect();
                self.at_key(&path, &what, false)
            }
            other => other,
        }
    }

    /// An error at a key, wherever it was set.
    pub(super) fn at_key(&self, path: &[String], what: &str, of_the_key: bool) -> Error {
        let key = path.join(".");
        let found = self.find(path, of_the_key);
        let exact = found.as_ref().is_some_and(|(_, depth)| *depth == path.len());
        // The last override of a key wins; one of a part of it explains it unless the file has it whole.
        let sets = |o: &&Override| {
            let p = o.path();
            let common = p.iter().zip(path).take_while(|(a, b)| *a == b).count();
            common == p.len() || (common == path.len() && !exact)
        };
        if let Some(o) = self.overrides.iter().rev().find(sets) {
            return self.at_override(o, &key, what);
        }
        match found {
            Some((span, _)) if exact => self.at_span(span, &key, what),
            Some((span, _)) => self.at_span(span, &key, &format!("{what} (the file does not set this key)")),
            None => Error::from(Box::new(SourceError {
                name: self.name.clone(),
                text: self.text.clone(),
                span: 0..0,
                line: None,
                column: 1,
                key,
                what: what.to_owned(),
            })),
        }
    }

    /// An error at an override.
    pub(super) fn at_override(&self, o: &Override, key: &str, what: &str) -> Error {
        let text = format!("{}={}", o.key, o.value);
        Error::from(Box::new(SourceError {
            name: format!("-D {text}"),
            span: 0..text.len(),
            text,
            line: None,
            column: 1,
            // The argument already says it.
            key: if key == o.key { String::new() } else { key.to_owned() },
            what: what.to_owned(),
        }))
    }

    /// An error at bytes of the text.
    pub(super) fn at_span(&self, span: Range<usize>, key: &str, what: &str) -> Error {
        let before = &self.text.as_bytes()[..span.start.min(self.text.len())];
        let line_start = before.iter().rposition(|&b| b == b'\n').map_or(0, |i| i + 1);
        Error::from(Box::new(SourceError {
            name: self.name.clone(),
            text: self.text.clone(),
            line: Some(before.iter().filter(|&&b| b == b'\n').count() + 1),
            column: String::from_utf8_lossy(&before[line_start..]).chars().count() + 1,
            span,
            key: key.to_owned(),
            what: what.to_owned(),
        }))
    }

    /// Bytes of the deepest part of `path` that the text sets, with its depth; `None` without even the first.
    fn find(&self, path: &[String], of_the_key: bool) -> Option<(Range<usize>, usize)> {
        let root = DeTable::parse(&self.text).ok()?;
        let mut table = root.get_ref();
        let mut found = None;
        for (i, part) in path.iter().enumerate() {
            let Some((key, value)) = table.get_key_value(part.as_str()) else { break };
            let key_only = value.get_ref().is_table() || (of_the_key && i + 1 == path.len());
            found = Some((if key_only { key.span() } else { value.span() }, i + 1));
            match value.get_ref() {
                DeValue::Table(t) => table = t,
                _ => break,
            }
        }
        found
    }
}

/// The name that serde's message "unknown field" complains about.
pub(super) fn unknown_name(message: &str) -> Option<&str> {
    message.strip_prefix("unknown field `")?.split('`').next()
}

/// The known name that is nearest to the one that serde does not know, if one is near.
pub(super) fn nearest_of_message(message: &str) -> Option<&str> {
    if !message.starts_with("unknown ") {
        return None;
    }
    // Every second piece stands between backticks: the unknown name, then the known ones.
    let mut names = message.split('`').skip(1).step_by(2);
    let wrong = names.next()?;
    nearest(wrong, names)
}

/// The candidate with the smallest edit distance, if it is at most a third of the word's length (at least 2).
pub(super) fn nearest<'a>(wrong: &str, candidates: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let limit = (wrong.chars().count() / 3).max(2);
    candidates
        .map(|c| (distance(wrong, c), c))
        .filter(|&(d, c)| d <= limit && d < c.chars().count())
        .min_by_key(|&(d, _)| d)
        .map(|(_, c)| c)
}

/// Levenshtein's distance; a pair of swapped neighbours counts as one.
fn distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let mut d = vec![vec![0usize; b.len() + 1]; a.len() + 1];
    for i in 0..=a.len() {
        for j in 0..=b.len() {
            d[i][j] = if i == 0 || j == 0 {
                i + j
            } else {
                let change = d[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
                let mut best = change.min(d[i - 1][j] + 1).min(d[i][j - 1] + 1);
                if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                    best = best.min(d[i - 2][j - 2] + 1);
                }
                best
            };
        }
    }
    d[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_names() {
        let known = ["width", "height", "filter", "filter_radius_px"];
        assert_eq!(nearest("widht", known.into_iter()), Some("width"));
        assert_eq!(nearest("filter_radius", known.into_iter()), Some("filter_radius_px"));
        assert_eq!(nearest("colour", known.into_iter()), None);
    }
}

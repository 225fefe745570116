//! TOML text and overrides to any description, with errors that name file, line and key.
//!
//! An override is merged into the parsed table before it becomes a description, so it passes the same
//! checks as the file. serde reports a mistake inside a table with a `type` key without its place (such a
//! table is buffered before its variant is known), so the place is found from outside: see [`culprit`].

use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::locate::{self, Source};
use crate::{Error, Result};

/// One `key=value` that replaces or adds a key of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Override {
    /// Dotted key, `lights.key.radiance`.
    pub key: String,
    /// A TOML value; what is not one is a string, so that `film.filter=box` needs no quotes.
    pub value: String,
}

impl Override {
    /// Splits `key=value`.
    pub fn parse(argument: &str) -> Result<Self> {
        let bad = |what: &str| Error::invalid(format!("-D {argument}"), what);
        let (key, value) = argument.split_once('=').ok_or_else(|| bad("expected KEY=VALUE"))?;
        let (key, value) = (key.trim(), value.trim());
        if key.is_empty() || key.split('.').any(|part| part.trim().is_empty()) {
            return Err(bad("expected a dotted key before `=`, such as film.width=256"));
        }
        Ok(Self { key: key.to_owned(), value: value.to_owned() })
    }

    /// The key's parts.
    pub(super) fn path(&self) -> Vec<&str> {
        self.key.split('.').map(str::trim).collect()
    }
}

/// A description with the text that it came from, which later errors point into.
#[derive(Clone, Debug)]
pub struct Loaded<T> {
    /// What the text says.
    pub description: T,
    /// Where it says it.
    pub source: Source,
}

/// Reads a description of type `T` from the TOML `text` of the file `name` and from `overrides`.
pub fn load<T: DeserializeOwned>(text: &str, name: &str, overrides: &[Override]) -> Result<Loaded<T>> {
    let source =
        Source { name: name.to_owned(), text: text.to_owned(), overrides: overrides.to_vec() };
    if text.trim().is_empty() {
        return Err(source.at_span(0..text.len(), "", "the file is empty"));
    }
    let parsed = DeTable::parse(text).map_err(|e| {
        // At the end of the text the span is empty and behind it.
        source.at_span(e.span().unwrap_or(0..0), "", sentence(e.message()))
    })?;
    let mut root = parsed.into_inner();
    for o in overrides {
        merge(&mut root, o).map_err(|what| source.at_override(o, &o.key, &what))?;
    }
    match read::<T>(root.clone()) {
        Ok(description) => Ok(Loaded { description, source }),
        Err(message) => {
            let path = culprit::<T>(&root, &message);
            let unknown = locate::unknown_name(&message);
            let path = match unknown {
                // The search ends at the table; the message knows the key.
                Some(key) if path.last().is_none_or(|last| last != key) && has(&root, &path, key) => {
                    path.into_iter().chain([key.to_owned()]).collect()
                }
                _ => path,
            };
            Err(source.at_key(&path, &explain(&message), unknown.is_some()))
        }
    }
}

/// The description, or serde's message.
fn read<T: DeserializeOwned>(root: DeTable<'_>) -> Result<T, String> {
    T::deserialize(toml::Deserializer::from(Spanned::new(0..0, root))).map_err(|e| e.message().to_owned())
}

/// Puts an override into the table, making tables on the way.
fn merge<'a>(root: &mut DeTable<'a>, o: &'a Override) -> Result<(), String> {
    let mut path = o.path();
    let last = path.pop().unwrap_or_default();
    let mut table = root;
    for part in path {
        let entry = table
            .entry(Spanned::new(0..0, part.into()))
            .or_insert_with(|| Spanned::new(0..0, DeValue::Table(DeTable::new())));
        table = match entry.get_mut() {
            DeValue::Table(t) => t,
            _ => return Err(format!("`{part}` is a value, not a table, so it has no key `{last}`")),
        };
    }
    let value = match DeValue::parse(&o.value) {
        Ok(v) => v,
        Err(_) => Spanned::new(0..0, DeValue::String(o.value.as_str().into())),
    };
    table.insert(Spanned::new(0..0, last.into()), value);
    Ok(())
}

/// Path of the key that makes deserialisation fail with `message`.
///
/// Entries are read in the table's order, so the guilty one is the last entry of the shortest beginning of
/// the table that still gives the message. `type` chooses how a table is read and therefore stays in every
/// beginning; when it alone gives the message, it is the guilty one. A missing key belongs to its table.
fn culprit<T: DeserializeOwned>(root: &DeTable<'_>, message: &str) -> Vec<String> {
    let missing = message.starts_with("missing field");
    let gives = |path: &[String], keep: &dyn Fn(&str) -> bool| {
        let mut cut = root.clone();
        if let Some(t) = table_at(&mut cut, path) {
            t.retain(|k, _| keep(k.get_ref()));
        }
        read::<T>(cut).is_err_and(|m| m == message)
    };
    let mut path: Vec<String> = Vec::new();
    loop {
        let mut copy = root.clone();
        let Some(table) = table_at(&mut copy, &path) else { return path };
        let keys: Vec<(String, bool)> = table
            .iter()
            .filter(|(k, _)| k.get_ref() != "type")
            .map(|(k, v)| (k.get_ref().to_string(), v.get_ref().is_table()))
            .collect();
        if gives(&path, &|k| k == "type") {
            if !missing && table.contains_key("type") {
                path.push("type".to_owned());
            }
            return path;
        }
        let guilty = (0..keys.len()).find(|&i| {
            gives(&path, &|k| k == "type" || keys[..=i].iter().any(|(kept, _)| kept == k))
        });
        match guilty {
            Some(i) if !missing || keys[i].1 => path.push(keys[i].0.clone()),
            _ => return path,
        }
    }
}

/// The table at a path.
fn table_at<'t, 'a>(root: &'t mut DeTable<'a>, path: &[String]) -> Option<&'t mut DeTable<'a>> {
    let mut table = root;
    for part in path {
        table = match table.get_mut(part.as_str())?.get_mut() {
            DeValue::Table(t) => t,
            _ => return None,
        };
    }
    Some(table)
}

/// Has the table at `path` the key?
fn has(root: &DeTable<'_>, path: &[String], key: &str) -> bool {
    let mut copy = root.clone();
    table_at(&mut copy, path).is_some_and(|t| t.contains_key(key))
}

/// serde's message in the words of someone who writes TOML, with the nearest known key.
fn explain(message: &str) -> String {
    let mut out = message.to_owned();
    for (rust, plain) in [
        ("missing field", "missing key"),
        ("unknown field", "unknown key"),
        ("unknown variant", "unknown name"),
        ("expected f32", "expected a number"),
        ("expected f64", "expected a number"),
        ("expected u32", "expected a whole number, zero or more"),
        ("expected u64", "expected a whole number, zero or more"),
        ("expected usize", "expected a whole number, zero or more"),
        ("invalid type: map", "invalid type: table"),
        ("expected a map", "expected a table"),
        ("expected struct", "expected a table"),
        ("expected internally tagged enum", "expected a table with a `type`"),
    ] {
        out = out.replace(rust, plain);
    }
    match locate::nearest_of_message(message) {
        Some(nearest) => format!("{out}; did you mean `{nearest}`?"),
        None => out,
    }
}

/// First line of a message.
fn sentence(message: &str) -> &str {
    message.lines().next().unwrap_or(message)
}


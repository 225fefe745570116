//! TOML text and overrides to any description, with errors that name file, line and key.
//!
//! An override is merged into the parsed table before it becomes a description, so it passes the same
//! checks as the file. serde reports a mistake inside a table with a `type` key without its place (such a
//! table is buffered before its variant is known), so the place is found from outside: see `culprit`.

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
    let source = Source { name: name.to_owned(), text: text.to_owned(), overrides: overrides.to_vec() };
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
    let gives = |root: &DeTable<'_>| read::<T>(root.clone()).is_err_and(|m| m == message);
    // What comes after the guilty entry is cut away: it may hold the same mistake again.
    let mut root = root.clone();
    let mut path: Vec<String> = Vec::new();
    loop {
        let keys: Vec<(String, bool)> = match table_at(&mut root, &path) {
            Some(t) => t.iter().map(|(k, v)| (k.get_ref().to_string(), v.get_ref().is_table())).collect(),
            None => return path,
        };
        let typed = keys.iter().any(|(k, _)| k == "type");
        let keys: Vec<(String, bool)> = keys.into_iter().filter(|(k, _)| k != "type").collect();
        let beginning = |n: usize| {
            let mut cut = root.clone();
            if let Some(t) = table_at(&mut cut, &path) {
                let kept = |k: &str| k == "type" || keys[..n].iter().any(|(key, _)| key == k);
                *t = std::mem::take(t).into_iter().filter(|(k, _)| kept(k.get_ref())).collect();
            }
            cut
        };
        let Some(n) = (0..=keys.len()).find(|&n| gives(&beginning(n))) else { return path };
        if n == 0 {
            if typed && !missing {
                path.push("type".to_owned());
            }
            return path;
        }
        let (key, is_table) = &keys[n - 1];
        if missing && !is_table {
            return path;
        }
        root = beginning(n);
        path.push(key.clone());
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::SourceError;
    use crate::scene::SceneDescription;

    fn fails(text: &str, overrides: &[&str]) -> SourceError {
        let overrides: Vec<Override> = overrides.iter().map(|o| Override::parse(o).unwrap()).collect();
        match load::<SceneDescription>(text, "a.toml", &overrides) {
            Err(Error::Source(e)) => *e,
            other => panic!("expected an error with a place, got {other:?}"),
        }
    }

    fn text_of(e: &SourceError) -> &str {
        &e.text[e.span.clone()]
    }

    #[test]
    fn shipped_scenes_load() {
        for (name, text) in [
            ("rose.toml", crate::scene::DEFAULT_SCENE),
            ("thesis.toml", include_str!("../../scenes/thesis.toml")),
        ] {
            load::<SceneDescription>(text, name, &[]).unwrap();
        }
    }

    #[test]
    fn empty_file() {
        assert_eq!(fails(" \n", &[]).to_string(), "a.toml:1: the file is empty");
    }

    #[test]
    fn syntax() {
        let e = fails("[film]\nwidth = 64 0\n", &[]);
        assert_eq!(e.line, Some(2), "{e}");
        let e = fails("[film]\nwidth = 1\n\n[film]\nheight = 2\n", &[]);
        assert_eq!((e.line, text_of(&e)), (Some(4), "film"), "{e}");
        assert_eq!(fails("[film]\nwidth =", &[]).line, Some(2));
    }

    #[test]
    fn unknown_keys() {
        let e = fails("[film]\nwidth = 1\nheigth = 2\n", &[]);
        assert_eq!((e.line, e.key.as_str(), text_of(&e)), (Some(3), "film.heigth", "heigth"));
        assert!(e.to_string().starts_with("a.toml:3: film.heigth: unknown key `heigth`"), "{e}");
        assert!(e.what.ends_with("did you mean `height`?"), "{e}");
        let e = fails("[fim]\nwidth = 1\n", &[]);
        assert_eq!((e.line, e.key.as_str()), (Some(1), "fim"), "{e}");
    }

    #[test]
    fn inside_tables_with_a_type() {
        let head = "[lights.key]\ntype = \"area\"\nposition_mm = [0, 0, 9]\n";
        let e = fails(&format!("{head}radianc = 3\n"), &[]);
        assert_eq!((e.line, e.key.as_str(), text_of(&e)), (Some(4), "lights.key.radianc", "radianc"), "{e}");
        let e = fails(&format!("{head}radiance = \"bright\"\n"), &[]);
        assert_eq!(
            (e.line, e.key.as_str(), text_of(&e)),
            (Some(4), "lights.key.radiance", "\"bright\""),
            "{e}"
        );
        assert!(e.what.contains("expected a number"), "{e}");
        let e = fails("[lights.key]\ntype = \"are\"\nposition_mm = [0, 0, 9]\n", &[]);
        assert_eq!((e.line, e.key.as_str()), (Some(2), "lights.key.type"), "{e}");
        assert!(e.what.ends_with("did you mean `area`?"), "{e}");
        let e = fails("[film]\nwidth = 3\n[lights.key]\ntype = \"area\"\nradiance = 3\n", &[]);
        assert_eq!((e.line, e.key.as_str()), (Some(3), "lights.key"), "{e}");
        assert!(e.what.contains("missing key `position_mm`"), "{e}");
        let e = fails("[lights.key]\nradiance = 3\n", &[]);
        assert_eq!((e.line, e.key.as_str()), (Some(1), "lights.key"), "{e}");
        assert!(e.what.contains("missing key `type`"), "{e}");
    }

    #[test]
    fn inside_a_roses_keys() {
        let e = fails("[shapes.r]\ntype = \"rose\"\n[shapes.r.rose.petal]\nlenth_mm = 3\n", &[]);
        assert_eq!((e.line, e.key.as_str()), (Some(4), "shapes.r.rose.petal.lenth_mm"), "{e}");
        let e = fails("[shapes.r]\ntype = \"rose\"\npreset = \"tulip\"\n", &[]);
        assert_eq!((e.line, e.key.as_str()), (Some(3), "shapes.r.preset"), "{e}");
    }

    #[test]
    fn the_first_of_two_equal_mistakes() {
        let e = fails("[film]\nwidth = \"a\"\nheight = \"a\"\n", &[]);
        // Keys are read in alphabetical order.
        assert_eq!((e.line, e.key.as_str()), (Some(3), "film.height"), "{e}");
        let light = |n: &str| format!("[lights.{n}]\ntype = \"constant\"\nradianc = 1\n");
        let e = fails(&format!("{}{}", light("a"), light("b")), &[]);
        assert_eq!((e.line, e.key.as_str()), (Some(3), "lights.a.radianc"), "{e}");
    }

    #[test]
    fn wrong_types() {
        for (text, key) in [
            ("film = 3\n", "film"),
            ("[film]\nwidth = -1\n", "film.width"),
            ("[film]\nwidth = 1.5\n", "film.width"),
            ("[camera]\nposition_mm = [0, 1]\n", "camera.position_mm"),
            ("[camera]\nposition_mm = [0, 1, \"a\"]\n", "camera.position_mm"),
            ("[camera]\ntype = \"fisheye\"\n", "camera.type"),
            ("[lights.a]\ntype = \"constant\"\nspectrum = [1, 2]\n", "lights.a.spectrum"),
            ("[lights.a]\ntype = \"constant\"\nspectrum = true\n", "lights.a.spectrum"),
            (
                "[lights.a]\ntype = \"constant\"\nspectrum = { illuminat = \"A\" }\n",
                "lights.a.spectrum.illuminat",
            ),
            ("[petal.cells]\npitch_um = \"x\"\n", "petal.cells.pitch_um"),
        ] {
            let e = fails(text, &[]);
            assert_eq!(e.key, key, "{e}");
            assert_eq!(e.line, Some(text.trim_end().lines().count()), "{e}");
        }
    }

    #[test]
    fn overrides_pass_the_same_checks() {
        let text = "[film]\nwidth = 9\n[lights.key]\ntype = \"constant\"\n";
        let load = |o: &[&str]| {
            let o: Vec<Override> = o.iter().map(|o| Override::parse(o).unwrap()).collect();
            load::<SceneDescription>(text, "a.toml", &o).map(|l| l.description)
        };
        let d = load(&["film.width=256", "film.tone_map=aces", "render.seed = 7", "lights.key.radiance=3"])
            .unwrap();
        assert_eq!((d.film.width, d.render.seed), (256, 7));
        assert_eq!(
            d.film.tone_map,
            crate::scene::description::SceneDescription {
                film: toml::from_str("tone_map = \"aces\"").unwrap(),
                ..Default::default()
            }
            .film
            .tone_map
        );
        let message = |o: &[&str]| load(o).unwrap_err().to_string();
        assert!(message(&["film.widht=256"]).starts_with("-D film.widht=256: unknown key `widht`"));
        assert!(message(&["film.width=big"]).starts_with("-D film.width=big: invalid type: string \"big\""));
        assert!(
            message(&["lights.rim.radiance=3"])
                .starts_with("-D lights.rim.radiance=3: lights.rim: missing key `type`")
        );
        assert!(message(&["film.width.x=3"]).contains("`width` is a value, not a table"));
        assert!(message(&["flim.width=3"]).starts_with("-D flim.width=3: flim: unknown key `flim`"));
        // The last one wins.
        assert_eq!(load(&["film.width=1", "film.width=2"]).unwrap().film.width, 2);
        assert!(Override::parse("film.width").is_err() && Override::parse("=3").is_err());
        assert!(Override::parse("a..b=3").is_err());
    }

    #[test]
    fn a_description_survives_a_round_trip() {
        let d = load::<SceneDescription>(crate::scene::DEFAULT_SCENE, "a.toml", &[]).unwrap().description;
        let text = toml::to_string(&d).unwrap();
        assert_eq!(load::<SceneDescription>(&text, "b.toml", &[]).unwrap().description, d, "{text}");
    }

    #[test]
    fn the_schema_knows_every_table() {
        let schema = crate::scene::schema();
        for table in ["film", "camera", "render", "petal", "materials", "lights", "shapes"] {
            assert!(schema["properties"][table].is_object(), "{table}");
        }
        assert_eq!(schema["additionalProperties"], false);
        let text = schema.to_string();
        for key in
            ["filter_radius_px", "angular_radius_deg", "reflectance_adaxial", "pitch_um", "divergence_deg"]
        {
            assert!(text.contains(key), "{key}");
        }
    }
}

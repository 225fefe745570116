//! XML as a tree of elements, for documents of unknown origin.
//!
//! What makes XML dangerous is refused or bounded: document types (and so entities of one's own) are errors, elements
//! nest at most [`MAX_DEPTH`] deep, and there are at most [`MAX_ELEMENTS`] of them; text is never longer than the file.
//! Guarded by `bombs_are_errors`.

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use crate::{Error, Result};

/// Deepest nesting that is read; BSDF files have 8 levels.
pub(super) const MAX_DEPTH: usize = 32;
/// Most elements that are read; BSDF files have a few hundred.
pub(super) const MAX_ELEMENTS: usize = 200_000;

/// An element.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Element {
    /// Without a name-space prefix.
    pub(super) name: String,
    /// Line of its start tag, from 1.
    pub(super) line: usize,
    /// Line on which `text` begins.
    pub(super) text_line: usize,
    /// The attribute `unit`; no other matters.
    pub(super) unit: String,
    /// Text directly in it.
    pub(super) text: String,
    /// Elements directly in it.
    pub(super) children: Vec<Element>,
}

impl Element {
    /// Children of this name.
    pub(super) fn all<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Element> {
        self.children.iter().filter(move |c| c.name.eq_ignore_ascii_case(name))
    }

    /// First child of this name.
    pub(super) fn child(&self, name: &str) -> Option<&Element> {
        self.children.iter().find(|c| c.name.eq_ignore_ascii_case(name))
    }

    /// Text of the first child of this name, trimmed; empty where there is none.
    pub(super) fn text_of(&self, name: &str) -> &str {
        self.child(name).map_or("", |c| c.text.trim())
    }
}

/// The document's root element; `name` is the file's in errors.
pub(super) fn parse(bytes: &[u8], name: &str) -> Result<Element> {
    // Old files hold single Latin-1 letters in names; the numbers are ASCII.
    let text = String::from_utf8_lossy(bytes);
    let mut reader = Reader::from_str(&text);
    let (mut line, mut counted) = (1, 0);
    let mut elements = 0usize;
    // The last is the innermost open element; the first holds the root.
    let mut open = vec![Element::default()];
    loop {
        let event = reader.read_event();
        let end = (reader.buffer_position() as usize).clamp(counted, text.len());
        let start_line = line;
        line += text.as_bytes()[counted..end].iter().filter(|b| **b == b'\n').count();
        counted = end;
        let fail = |what: String| Err(Error::invalid(format!("{name}:{line}"), what));
        let mut append = |s: &str| {
            if let Some(top) = open.last_mut() {
                if top.text.is_empty() {
                    top.text_line = start_line;
                }
                top.text.push_str(s);
            }
        };
        match event {
            Err(e) => return fail(format!("not well-formed XML: {e}")),
            Ok(Event::DocType(_)) => return fail("document types and entities are not read".into()),
            Ok(Event::Text(t)) => append(&t.into_inner()),
            Ok(Event::CData(t)) => append(&t.into_inner()),
            Ok(Event::GeneralRef(r)) => match r.resolve_char_ref() {
                Ok(Some(c)) => append(c.encode_utf8(&mut [0; 4])),
                Ok(None) => match r.into_inner().as_ref() {
                    "amp" => append("&"),
                    "lt" => append("<"),
                    "gt" => append(">"),
                    "quot" => append("\""),
                    "apos" => append("'"),
                    other => return fail(format!("unknown entity `{}`", excerpt(other))),
                },
                Err(e) => return fail(format!("not well-formed XML: {e}")),
            },
            Ok(Event::Start(tag)) => {
                elements += 1;
                if open.len() > MAX_DEPTH || elements > MAX_ELEMENTS {
                    return fail(format!(
                        "more than {MAX_DEPTH} elements in each other or {MAX_ELEMENTS} in all"
                    ));
                }
                open.push(element(&tag, line));
            }
            Ok(Event::Empty(tag)) => {
                elements += 1;
                if elements > MAX_ELEMENTS {
                    return fail(format!("more than {MAX_ELEMENTS} elements"));
                }
                let element = element(&tag, line);
                if let Some(top) = open.last_mut() {
                    top.children.push(element);
                }
            }
            Ok(Event::End(_)) => {
                // The reader has checked that it closes the last that was opened.
                if let Some(done) = open.pop()
                    && let Some(top) = open.last_mut()
                {
                    top.children.push(done);
                }
            }
            Ok(Event::Comment(_) | Event::Decl(_) | Event::PI(_)) => {}
            Ok(Event::Eof) => break,
        }
    }
    let at = || format!("{name}:{line}");
    if open.len() != 1 {
        return Err(Error::invalid(at(), "the file ends inside an element"));
    }
    let roots = open.pop().map(|top| top.children).unwrap_or_default();
    match <[Element; 1]>::try_from(roots) {
        Ok([root]) => Ok(root),
        Err(roots) => {
            Err(Error::invalid(at(), format!("expected one XML root element, found {}", roots.len())))
        }
    }
}

fn element(tag: &BytesStart, line: usize) -> Element {
    let local = |name: &str| name.rsplit(':').next().unwrap_or(name).to_string();
    let unit = tag
        .attributes()
        .with_checks(false)
        .flatten()
        .find(|a| local(a.key.as_ref()).eq_ignore_ascii_case("unit"));
    Element {
        name: local(tag.name().as_ref()),
        line,
        text_line: line,
        unit: unit.map_or(String::new(), |a| a.value.trim().to_string()),
        ..Element::default()
    }
}

/// At most 40 characters, for messages.
pub(super) fn excerpt(text: &str) -> String {
    text.trim().chars().take(40).collect()
}

/// Text that may stand in an element.
pub(super) fn escape(text: &str) -> String {
    // Control characters are not allowed in XML 1.0, not even escaped.
    let clean: String =
        text.chars().filter(|c| !c.is_control() && *c != '\u{fffe}' && *c != '\u{ffff}').collect();
    quick_xml::escape::escape(clean.as_str()).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_text_and_lines() {
        let text = "<?xml version=\"1.0\"?>\n<a:Root xmlns:a=\"x\">\n <!-- c --><W unit=\"Nanometer\">5&lt;6 &amp; &#65;</W>\n\
                    <E/>\n<D><![CDATA[1 2\n3]]></D></a:Root>\n";
        let root = parse(text.as_bytes(), "f").unwrap();
        assert_eq!((root.name.as_str(), root.line, root.children.len()), ("Root", 2, 3));
        let w = root.child("w").unwrap();
        assert_eq!((w.text.as_str(), w.unit.as_str(), w.line), ("5<6 & A", "Nanometer", 3));
        assert_eq!((root.text_of("D"), root.child("D").unwrap().text_line), ("1 2\n3", 5));
        assert_eq!(escape("a<b>&\"\u{1}c"), "a&lt;b&gt;&amp;&quot;c");
    }

    #[test]
    fn bombs_are_errors() {
        let laughs = "<!DOCTYPE l [<!ENTITY a \"ha\"><!ENTITY b \"&a;&a;&a;\">]>\n<r>&b;</r>";
        let message = parse(laughs.as_bytes(), "f").unwrap_err().to_string();
        assert!(message.starts_with("f:1: ") && message.contains("document types"), "{message}");
        assert!(parse(b"<r>&b;</r>", "f").unwrap_err().to_string().contains("unknown entity"));
        let deep = "<a>".repeat(100_000);
        assert!(parse(deep.as_bytes(), "f").unwrap_err().to_string().contains("more than"));
        let wide = format!("<a>{}</a>", "<b/>".repeat(MAX_ELEMENTS + 1));
        assert!(parse(wide.as_bytes(), "f").unwrap_err().to_string().contains("more than"));
        for text in
            ["", "<a>", "<a></b>", "<a/><b/>", "</a>", "a", "<a>&#xFFFFFFFF;</a>", "<a>&", "<", "\0\0"]
        {
            assert!(parse(text.as_bytes(), "f").is_err(), "{text}");
        }
    }
}

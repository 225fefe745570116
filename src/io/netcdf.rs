//! NetCDF: tables with named dimensions, for xarray, R, Julia and the like.
//!
//! Writes the classic format with 64-bit offsets (CDF-2), which every NetCDF library reads: big-endian; a header of
//! dimensions, attributes and variables, then the values of one variable after the other, each from a multiple of four
//! bytes. Texts are arrays of characters whose last dimension is their length, padded with zeros. Source: the NetCDF
//! Classic Format Specification, Unidata.

use super::invalid;
use crate::Result;

const FORMAT: &str = "NetCDF";
const DIMENSION: u32 = 0x0a;
const VARIABLE: u32 = 0x0b;
const ATTRIBUTE: u32 = 0x0c;
const CHAR: u32 = 2;
const INT: u32 = 4;
const FLOAT: u32 = 5;
const DOUBLE: u32 = 6;
/// Largest variable of this format.
const MAX_BYTES: u64 = u32::MAX as u64 - 4;

/// Values of a variable, the last dimension fastest.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Characters.
    Text(Vec<u8>),
    /// Whole numbers.
    Int(Vec<i32>),
    /// Numbers of 24 bits.
    Float(Vec<f32>),
    /// Numbers of 53 bits.
    Double(Vec<f64>),
}

impl Values {
    fn len(&self) -> usize {
        match self {
            Values::Text(v) => v.len(),
            Values::Int(v) => v.len(),
            Values::Float(v) => v.len(),
            Values::Double(v) => v.len(),
        }
    }

    fn kind(&self) -> (u32, u64) {
        match self {
            Values::Text(_) => (CHAR, 1),
            Values::Int(_) => (INT, 4),
            Values::Float(_) => (FLOAT, 4),
            Values::Double(_) => (DOUBLE, 8),
        }
    }

    fn put(&self, out: &mut Vec<u8>) {
        match self {
            Values::Text(v) => out.extend_from_slice(v),
            Values::Int(v) => v.iter().for_each(|x| out.extend(x.to_be_bytes())),
            Values::Float(v) => v.iter().for_each(|x| out.extend(x.to_be_bytes())),
            Values::Double(v) => v.iter().for_each(|x| out.extend(x.to_be_bytes())),
        }
    }
}

/// A variable of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// Its dimensions, as indices into those of the file.
    pub dimensions: Vec<usize>,
    /// Names and texts of its attributes (`units`, `long_name`).
    pub attributes: Vec<(String, String)>,
    /// Its values.
    pub values: Values,
}

/// What a file holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dataset {
    /// Names and lengths.
    pub dimensions: Vec<(String, usize)>,
    /// Names and texts of what is said about the whole.
    pub attributes: Vec<(String, String)>,
    /// The variables.
    pub variables: Vec<Variable>,
}

impl Dataset {
    /// Adds a dimension and gives its index.
    pub fn dimension(&mut self, name: &str, length: usize) -> usize {
        self.dimensions.push((name.to_owned(), length));
        self.dimensions.len() - 1
    }

    /// Adds a variable. An empty unit is left out.
    pub fn variable(
        &mut self,
        name: &str,
        dimensions: &[usize],
        (unit, about): (&str, &str),
        values: Values,
    ) {
        let attribute =
            |name: &str, text: &str| (!text.is_empty()).then(|| (name.to_owned(), text.to_owned()));
        self.variables.push(Variable {
            name: name.to_owned(),
            dimensions: dimensions.to_vec(),
            attributes: [attribute("units", unit), attribute("long_name", about)]
                .into_iter()
                .flatten()
                .collect(),
            values,
        });
    }

    /// Adds a variable of texts along a dimension, with a dimension of its own for their length.
    pub fn texts<'a>(
        &mut self,
        name: &str,
        dimension: usize,
        about: &str,
        texts: impl Iterator<Item = &'a str> + Clone,
    ) {
        let length = texts.clone().map(str::len).max().unwrap_or(0).max(1);
        let letters = self.dimension(&format!("{name}_letters"), length);
        let mut bytes = Vec::new();
        for text in texts {
            bytes.extend_from_slice(text.as_bytes());
            bytes.resize(bytes.len() + length - text.len(), 0);
        }
        self.variable(name, &[dimension, letters], ("", about), Values::Text(bytes));
    }
}

fn pad(out: &mut Vec<u8>) {
    out.resize(out.len().next_multiple_of(4), 0);
}

fn number(out: &mut Vec<u8>, n: usize) -> Result<()> {
    let n =
        i32::try_from(n).map_err(|_| invalid(FORMAT, format_args!("{n} is more than the format counts")))?;
    out.extend(n.to_be_bytes());
    Ok(())
}

fn name(out: &mut Vec<u8>, name: &str) -> Result<()> {
    let fits = |c: char| c.is_ascii_alphanumeric() || "_+-.@".contains(c);
    if !name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') || !name.chars().all(fits) {
        return Err(invalid(
            FORMAT,
            format_args!("`{name}` is no name of a dimension, variable or attribute"),
        ));
    }
    number(out, name.len())?;
    out.extend_from_slice(name.as_bytes());
    pad(out);
    Ok(())
}

/// The tag of a list and its length; an empty one has no tag.
fn list(out: &mut Vec<u8>, tag: u32, length: usize) -> Result<()> {
    out.extend(if length == 0 { 0 } else { tag }.to_be_bytes());
    number(out, length)
}

fn attributes(out: &mut Vec<u8>, attributes: &[(String, String)]) -> Result<()> {
    list(out, ATTRIBUTE, attributes.len())?;
    for (key, text) in attributes {
        name(out, key)?;
        out.extend(CHAR.to_be_bytes());
        number(out, text.len())?;
        out.extend_from_slice(text.as_bytes());
        pad(out);
    }
    Ok(())
}

/// The header with the variables' data from `begin` on; gives where the data end.
fn header(data: &Dataset, out: &mut Vec<u8>, begin: u64) -> Result<u64> {
    out.extend_from_slice(b"CDF\x02");
    // No record dimension.
    number(out, 0)?;
    list(out, DIMENSION, data.dimensions.len())?;
    for (key, length) in &data.dimensions {
        if *length == 0 {
            return Err(invalid(FORMAT, format_args!("the dimension `{key}` has no length")));
        }
        name(out, key)?;
        number(out, *length)?;
    }
    attributes(out, &data.attributes)?;
    list(out, VARIABLE, data.variables.len())?;
    let mut at = begin;
    for v in &data.variables {
        let mut expected = 1u64;
        name(out, &v.name)?;
        number(out, v.dimensions.len())?;
        for d in &v.dimensions {
            let Some((_, length)) = data.dimensions.get(*d) else {
                return Err(invalid(FORMAT, format_args!("`{}` has an unknown dimension", v.name)));
            };
            number(out, *d)?;
            expected = expected.saturating_mul(*length as u64);
        }
        if expected != v.values.len() as u64 {
            return Err(invalid(
                FORMAT,
                format_args!(
                    "`{}` has {} values where its dimensions say {expected}",
                    v.name,
                    v.values.len()
                ),
            ));
        }
        attributes(out, &v.attributes)?;
        let (kind, size) = v.values.kind();
        let bytes = expected * size;
        if bytes > MAX_BYTES {
            return Err(invalid(FORMAT, format_args!("`{}` has {bytes} bytes, more than 4 GiB", v.name)));
        }
        out.extend(kind.to_be_bytes());
        out.extend((bytes.next_multiple_of(4) as u32).to_be_bytes());
        out.extend(at.to_be_bytes());
        at += bytes.next_multiple_of(4);
    }
    Ok(at)
}

/// Writes a file.
pub fn write(data: &Dataset) -> Result<Vec<u8>> {
    let mut out = Vec::new();
    header(data, &mut out, 0)?;
    let begin = out.len() as u64;
    out.clear();
    let end = header(data, &mut out, begin)?;
    out.reserve((end - begin) as usize);
    for v in &data.variables {
        v.values.put(&mut out);
        pad(&mut out);
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> Dataset {
        let mut d = Dataset { attributes: vec![("title".into(), "five".into())], ..Dataset::default() };
        let x = d.dimension("x", 3);
        d.variable("v", &[x], ("W m-2", ""), Values::Float(vec![1.0, 2.0, -0.5]));
        d.texts("name", x, "", ["a", "bc", ""].into_iter());
        d
    }

    #[test]
    fn layout_is_that_of_the_specification() {
        let bytes = write(&small()).unwrap();
        assert!(bytes.starts_with(b"CDF\x02\0\0\0\0\0\0\0\x0a\0\0\0\x02\0\0\0\x01x\0\0\0\0\0\0\x03"));
        // Floats and six letters, padded, end the file.
        let mut end: Vec<u8> = [1.0f32, 2.0, -0.5].iter().flat_map(|v| v.to_be_bytes()).collect();
        end.extend(b"a\0bc\0\0\0\0");
        assert!(bytes.ends_with(&end));
        // Each variable begins where its header says: the offset follows type and size.
        let begin = (bytes.len() - end.len()) as u64;
        let float_at = |at: u64| {
            [FLOAT.to_be_bytes(), 12u32.to_be_bytes()]
                .concat()
                .into_iter()
                .chain(at.to_be_bytes())
                .collect::<Vec<_>>()
        };
        assert!(bytes.windows(16).any(|w| w == float_at(begin)));
        let text_at: Vec<u8> = [CHAR.to_be_bytes(), 8u32.to_be_bytes()]
            .concat()
            .into_iter()
            .chain((begin + 12).to_be_bytes())
            .collect();
        assert!(bytes.windows(16).any(|w| w == text_at));
    }

    #[test]
    fn what_does_not_fit_is_an_error() {
        let mut wrong = small();
        wrong.variables[0].values = Values::Double(vec![1.0]);
        assert!(write(&wrong).is_err());
        let mut wrong = small();
        wrong.variables[0].name = "a b".into();
        assert!(write(&wrong).is_err());
        let mut wrong = small();
        wrong.dimensions[0].1 = 0;
        assert!(write(&wrong).is_err());
        let mut wrong = small();
        wrong.variables[0].dimensions = vec![7];
        assert!(write(&wrong).is_err());
    }
}

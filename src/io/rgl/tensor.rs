//! The tensor container: named arrays of numbers in one file.
//!
//! Layout, little-endian: `tensor_file` and a zero byte, version 1 and 0 (two bytes), number of fields (u32); per field
//! the length of its name (u16), the name, number of dimensions (u16), type (u8), offset of its data from the start of
//! the file (u64), its dimensions (u64 each), the last one running fastest. Types: 1 u8, 2 i8, 3 u16, 4 i16, 5 u32,
//! 6 i32, 7 u64, 8 i64, 9 f16, 10 f32, 11 f64. Data start at multiples of eight bytes when written here.

use std::borrow::Cow;
use std::collections::BTreeMap;

use super::FORMAT;
use crate::Result;
use crate::io::invalid;

const MAGIC: &[u8] = b"tensor_file\0\x01\0";
/// Type of u8.
pub(super) const U8: u8 = 1;
/// Type of f32.
pub(super) const F32: u8 = 10;
/// Bytes per value, by type.
const SIZES: [usize; 12] = [0, 1, 1, 2, 2, 4, 4, 8, 8, 2, 4, 8];

/// One array.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Field<'a> {
    pub(super) dtype: u8,
    pub(super) shape: Vec<usize>,
    pub(super) bytes: Cow<'a, [u8]>,
}

impl Field<'static> {
    /// An array of f32.
    pub(super) fn f32s(shape: &[usize], values: &[f32]) -> Self {
        debug_assert_eq!(shape.iter().product::<usize>(), values.len());
        let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>();
        Self { dtype: F32, shape: shape.to_vec(), bytes: bytes.into() }
    }

    /// A list of bytes.
    pub(super) fn u8s(values: &[u8]) -> Self {
        Self { dtype: U8, shape: vec![values.len()], bytes: values.to_vec().into() }
    }
}

/// The next `n` bytes.
fn take<'a>(rest: &mut &'a [u8], n: usize, what: &str) -> Result<&'a [u8]> {
    let (head, tail) =
        rest.split_at_checked(n).ok_or_else(|| invalid(FORMAT, format_args!("truncated in {what}")))?;
    *rest = tail;
    Ok(head)
}

/// A little-endian number of at most eight bytes.
fn number(rest: &mut &[u8], bytes: usize, what: &str) -> Result<u64> {
    Ok(take(rest, bytes, what)?.iter().rev().fold(0, |n, b| n << 8 | u64::from(*b)))
}

/// Lists the fields; their data stay where they are in the file.
pub(super) fn read(bytes: &[u8]) -> Result<BTreeMap<String, Field<'_>>> {
    let mut rest = bytes
        .strip_prefix(MAGIC)
        .ok_or_else(|| invalid(FORMAT, "this is not a tensor file of version 1.0"))?;
    let count = number(&mut rest, 4, "the number of fields")?;
    let mut fields = BTreeMap::new();
    for i in 0..count {
        let header = format!("the header of field {i} of {count}");
        let length = number(&mut rest, 2, &header)? as usize;
        let name = std::str::from_utf8(take(&mut rest, length, &header)?)
            .map_err(|_| invalid(FORMAT, format_args!("the name of field {i} is not UTF-8")))?;
        let dimensions = number(&mut rest, 2, &header)?;
        let dtype = number(&mut rest, 1, &header)? as u8;
        let offset = number(&mut rest, 8, &header)?;
        let size = SIZES.get(usize::from(dtype)).copied().filter(|s| *s > 0);
        let size =
            size.ok_or_else(|| invalid(FORMAT, format_args!("{name}: there is no type {dtype}")))? as u64;
        let (mut shape, mut length) = (Vec::new(), Some(size));
        for _ in 0..dimensions {
            let n = number(&mut rest, 8, &header)?;
            length = length.and_then(|l| l.checked_mul(n));
            shape.push(usize::try_from(n).unwrap_or(usize::MAX));
        }
        let data = length
            .and_then(|l| Some(usize::try_from(offset).ok()?..usize::try_from(offset.checked_add(l)?).ok()?))
            .and_then(|range| bytes.get(range))
            .ok_or_else(|| {
                let what = format!(
                    "{name}: {shape:?} values of {size} bytes from byte {offset}, but the file has {} bytes",
                    bytes.len()
                );
                invalid(FORMAT, what)
            })?;
        let field = Field { dtype, shape, bytes: Cow::Borrowed(data) };
        if fields.insert(name.to_string(), field).is_some() {
            return Err(invalid(FORMAT, format_args!("{name} is there twice")));
        }
    }
    Ok(fields)
}

/// Writes fields in their order.
pub(super) fn write(fields: &[(&str, Field<'_>)]) -> Vec<u8> {
    let header: usize = fields.iter().map(|(name, f)| 2 + name.len() + 2 + 1 + 8 + 8 * f.shape.len()).sum();
    let mut offset = (MAGIC.len() + 4 + header).next_multiple_of(8);
    let mut bytes = MAGIC.to_vec();
    bytes.extend_from_slice(&(fields.len() as u32).to_le_bytes());
    for (name, field) in fields {
        bytes.extend_from_slice(&(name.len() as u16).to_le_bytes());
        bytes.extend_from_slice(name.as_bytes());
        bytes.extend_from_slice(&(field.shape.len() as u16).to_le_bytes());
        bytes.push(field.dtype);
        bytes.extend_from_slice(&(offset as u64).to_le_bytes());
        for n in &field.shape {
            bytes.extend_from_slice(&(*n as u64).to_le_bytes());
        }
        offset = (offset + field.bytes.len()).next_multiple_of(8);
    }
    for (_, field) in fields {
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes.extend_from_slice(&field.bytes);
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::damage::damage;

    fn valid() -> Vec<u8> {
        let a = Field::f32s(&[2, 3], &[1.0, -2.0, 3.5, 0.0, 5.0, 6.0]);
        write(&[("name", Field::u8s(b"petal")), ("a", a), ("empty", Field::u8s(&[]))])
    }

    #[test]
    fn fields_are_read_back() {
        let bytes = valid();
        let fields = read(&bytes).unwrap();
        assert_eq!(fields.len(), 3);
        assert_eq!((&fields["a"].shape[..], fields["a"].dtype), (&[2, 3][..], F32));
        assert_eq!(fields["a"].bytes[4..8], (-2f32).to_le_bytes());
        assert_eq!(&fields["name"].bytes[..], b"petal");
        assert!(fields["empty"].bytes.is_empty());
        let offset = |f: &Field<'_>| f.bytes.as_ptr() as usize - bytes.as_ptr() as usize;
        assert!(fields.values().all(|f| offset(f).is_multiple_of(8)));
    }

    #[test]
    fn damaged_files_are_errors() {
        let valid = valid();
        damage(&valid, 500, |b| read(b).is_ok());
        let fails = |bytes: &[u8], word: &str| {
            let e = read(bytes).unwrap_err().to_string();
            assert!(e.contains(word), "{e}");
        };
        fails(&valid[..13], "not a tensor file");
        fails(&valid[..30], "truncated");
        fails(&valid[..valid.len() - 9], "but the file has");
        let mut many = valid.clone();
        many[14..18].fill(0xff);
        fails(&many, "there is no type 0");
        // The first field: its only dimension is at 18 + 2 + 4 + 2 + 1 + 8.
        for (at, byte) in [(35, 0x7f), (42, 0xff), (34, 0xff), (27, 0xff)] {
            let mut b = valid.clone();
            b[at] = byte;
            fails(&b, "but the file has");
        }
        let mut typed = valid.clone();
        typed[26] = 12;
        fails(&typed, "there is no type 12");
        // A product of dimensions that overflows.
        let mut wide = write(&[("a", Field::f32s(&[2, 2, 1], &[0.0; 4]))]);
        for dimension in 0..3 {
            let at = 18 + 2 + 1 + 2 + 1 + 8 + 8 * dimension;
            wide[at..at + 8].copy_from_slice(&(1u64 << 31).to_le_bytes());
        }
        fails(&wide, "but the file has");
        let twice = write(&[("a", Field::u8s(b"1")), ("a", Field::u8s(b"2"))]);
        fails(&twice, "twice");
    }
}

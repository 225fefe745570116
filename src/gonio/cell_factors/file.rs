//! The tables as bytes, to keep them from one run to the next.
//!
//! Layout, little-endian: `rosacell`, version u32; the cells: pitch, height, centre disorder, height disorder, tilt
//! disorder f64, profile u8 (its place in the list of profiles), seed u64, tile u32; the settings: points u32, facets u32, seed
//! u64, nodes of order one and of the later orders 3 x u32 each; the series' ratio f64; interpolation errors f64 each; the
//! numbers and errors of order one, then those of the later orders, f32 each; SHA-256 of all that precedes.
//!
//! Nothing is allocated before the length is found to be the one that the nodes ask for. Guarded by
//! `tables_come_back_from_bytes`, `damaged_tables_are_errors`.

use sha2::{Digest, Sha256};

use super::table::{ERRORS, Table};
use super::{AngleNodes, CellFactors, FactorSettings, InterpolationError};
use crate::micro::{CellDescription, Profile};
use crate::{Error, Result};

const MAGIC: &[u8; 8] = b"rosacell";
/// Changes with the layout and with what the numbers mean.
const VERSION: u32 = 2;
const CHECKSUM: usize = 32;

impl CellFactors {
    /// The tables as bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        // All fields by name: a new one must find its place here, and a new version.
        let CellDescription {
            pitch_um,
            height_um,
            profile,
            center_disorder,
            height_disorder,
            tilt_disorder_deg,
            seed,
            tile_cells,
        } = &self.cells;
        let mut out = MAGIC.to_vec();
        out.extend(VERSION.to_le_bytes());
        for v in [pitch_um, height_um, center_disorder, height_disorder, tilt_disorder_deg] {
            out.extend(v.to_le_bytes());
        }
        out.push(Profile::ALL.iter().position(|p| p == profile).unwrap_or(Profile::ALL.len()) as u8);
        out.extend(seed.to_le_bytes());
        out.extend(tile_cells.to_le_bytes());
        out.extend(self.settings.points.to_le_bytes());
        out.extend(self.settings.facets.to_le_bytes());
        out.extend(self.settings.seed.to_le_bytes());
        for nodes in [self.settings.first, self.settings.later] {
            for n in [nodes.thetas, nodes.ratios, nodes.azimuths] {
                out.extend((n as u32).to_le_bytes());
            }
        }
        out.extend(self.tail_ratio.to_le_bytes());
        out.extend(self.interpolation.diffuse.to_le_bytes());
        self.interpolation.specular.iter().for_each(|v| out.extend(v.to_le_bytes()));
        for part in [&self.first.numbers, &self.first.errors, &self.later.numbers, &self.later.errors] {
            part.iter().for_each(|v| out.extend(v.to_le_bytes()));
        }
        let checksum = Sha256::digest(&out);
        out.extend(checksum);
        out
    }

    /// Reads what [`CellFactors::to_bytes`] wrote. Errors begin with `name`.
    pub fn from_bytes(bytes: &[u8], name: &str) -> Result<Self> {
        let wrong = |what: &str| Error::invalid(name, what);
        let mut reader = Reader { rest: bytes, name };
        if &reader.take::<8>()? != MAGIC {
            return Err(wrong("no table of cell factors"));
        }
        let version = reader.u32()?;
        if version != VERSION {
            return Err(wrong(&format!("version {version} of the table; this program knows {VERSION}")));
        }
        let (body, checksum) =
            bytes.split_last_chunk::<CHECKSUM>().ok_or_else(|| wrong("the file ends too early"))?;
        if Sha256::digest(body).as_slice() != checksum {
            return Err(wrong("the checksum does not match: the file is damaged"));
        }
        let [pitch_um, height_um, center_disorder, height_disorder, tilt_disorder_deg] = reader.f64s()?;
        let [profile] = reader.take::<1>()?;
        let profile = *Profile::ALL.get(usize::from(profile)).ok_or_else(|| wrong("unknown profile"))?;
        let cells = CellDescription {
            pitch_um,
            height_um,
            profile,
            center_disorder,
            height_disorder,
            tilt_disorder_deg,
            seed: u64::from_le_bytes(reader.take()?),
            tile_cells: reader.u32()?,
        };
        cells.validate(name)?;
        let (points, facets, seed) = (reader.u32()?, reader.u32()?, u64::from_le_bytes(reader.take()?));
        let settings =
            FactorSettings { points, facets, seed, first: reader.nodes()?, later: reader.nodes()? };
        settings.validate()?;
        let [tail_ratio, diffuse] = reader.f64s()?;
        let specular = reader.f64s::<{ ERRORS - 1 }>()?.to_vec();
        if !(0.0..1.0).contains(&tail_ratio) || !specular.iter().chain([&diffuse]).all(|v| *v >= 0.0) {
            return Err(wrong("a ratio or an error is out of range"));
        }
        let interpolation = InterpolationError { diffuse, specular };
        let table = Self {
            cells,
            settings,
            tail_ratio,
            interpolation,
            first: reader.table(settings.first)?,
            later: reader.table(settings.later)?,
        };
        if reader.rest.len() != CHECKSUM {
            return Err(wrong("the file is longer than its nodes ask for"));
        }
        Ok(table)
    }
}

struct Reader<'a> {
    rest: &'a [u8],
    name: &'a str,
}

impl Reader<'_> {
    fn early(&self) -> Error {
        Error::invalid(self.name, "the file ends too early")
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N]> {
        let (head, rest) = self.rest.split_first_chunk::<N>().ok_or_else(|| self.early())?;
        self.rest = rest;
        Ok(*head)
    }

    fn u32(&mut self) -> Result<u32> {
        Ok(u32::from_le_bytes(self.take()?))
    }

    fn f64s<const N: usize>(&mut self) -> Result<[f64; N]> {
        let mut out = [0.0; N];
        for v in &mut out {
            *v = f64::from_le_bytes(self.take()?);
        }
        Ok(out)
    }

    fn nodes(&mut self) -> Result<AngleNodes> {
        let mut next = || Ok::<_, Error>(self.u32()? as usize);
        Ok(AngleNodes { thetas: next()?, ratios: next()?, azimuths: next()? })
    }

    /// The nodes' counts are checked before, so their product is small.
    fn table<const W: usize>(&mut self, nodes: AngleNodes) -> Result<Table<W>> {
        let numbers = self.f32s(nodes.pairs() * W)?;
        let errors = self.f32s(nodes.pairs() * ERRORS)?;
        Ok(Table { nodes, numbers, errors })
    }

    fn f32s(&mut self, count: usize) -> Result<Vec<f32>> {
        let (head, rest) = self.rest.split_at_checked(4 * count).ok_or_else(|| self.early())?;
        self.rest = rest;
        let values: Vec<f32> = head.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
        if !values.iter().all(|v| v.is_finite()) {
            return Err(Error::invalid(self.name, "a number of the table is not finite"));
        }
        Ok(values)
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::io::damage::damage;

    fn compute(cells: &CellDescription) -> CellFactors {
        let nodes = AngleNodes { thetas: 4, ratios: 5, azimuths: 6 };
        let settings = FactorSettings { points: 64, facets: 8, seed: u64::MAX, first: nodes, later: nodes };
        CellFactors::compute(cells, &settings, &|_, _| ControlFlow::Continue(())).unwrap()
    }

    #[test]
    fn tables_come_back_from_bytes() {
        let cells = CellDescription { height_um: 0.1 + 0.2, seed: u64::MAX, ..Default::default() };
        let table = compute(&cells);
        let bytes = table.to_bytes();
        assert_eq!(CellFactors::from_bytes(&bytes, "x").unwrap(), table);
        let longer: Vec<u8> = bytes.iter().copied().chain([0]).collect();
        for bad in [&longer[..], &bytes[..bytes.len() - 1], &bytes[..20], b"", b"rosacell"] {
            let error = CellFactors::from_bytes(bad, "x.cells").expect_err("damaged").to_string();
            assert!(error.starts_with("x.cells: "), "{error}");
        }
    }

    #[test]
    fn damaged_tables_are_errors() {
        let bytes = compute(&CellDescription::default()).to_bytes();
        damage(&bytes, 60, |b| assert!(b == bytes || CellFactors::from_bytes(b, "x").is_err()));
        // With a checksum that fits, the fields themselves are checked.
        let body = &bytes[..bytes.len() - 32];
        for at in 8..160 {
            for value in [0u8, 0x7f, 0xff] {
                let mut body = body.to_vec();
                body[at] = value;
                let checksum = Sha256::digest(&body);
                body.extend(checksum);
                let _ = CellFactors::from_bytes(&body, "x");
            }
        }
        let mut body = body.to_vec();
        let end = body.len();
        body[end - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
        let checksum = Sha256::digest(&body);
        body.extend(checksum);
        assert!(CellFactors::from_bytes(&body, "x").is_err());
    }
}

//! `petal.optics`: a measured petal, for all wavelengths and amounts of pigment.
//!
//! Layout, little-endian; the header is JSON so that other programs can read what they know:
//!
//! | bytes | what |
//! |---|---|
//! | 8 | `rosaopti` |
//! | 4 | version, u32: [`VERSION`] |
//! | 4 | length of the header, u32 |
//! | | header: JSON, UTF-8: everything but the tables, and their sizes |
//! | 4 x 4 K | mean ways l_kr, f32 um, region by region within a class |
//! | 4 x 4 K | their standard deviations, f32 um |
//! | 4 x values | surface table, f32 1/sr, in the order of [`AngularTable`] |
//! | 4 x values | interior table, the same |
//! | 32 | SHA-256 of all that precedes |
//!
//! Limits: at most [`MAX_BYTES`]. What is read is physically possible: not negative, reciprocal, and no lamp gives more
//! light than it gets (`wrong_contents_are_errors`). Guarded by `round_trip` and `damaged_files_are_errors`.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::invalid;
use crate::gonio::{AngleGrid, AngularTable, PetalOptics, WhiteTotals};
use crate::micro::REGIONS;
use crate::{Error, Result};

const FORMAT: &str = "petal.optics";
const MAGIC: &[u8; 8] = b"rosaopti";
/// Changes with the layout and with what the numbers mean.
pub const VERSION: u32 = 1;
/// Largest file that is written or read.
pub const MAX_BYTES: usize = 32_000_000;
const CHECKSUM: usize = 32;

/// Bytes before the header.
const PREFIX: usize = 16;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    sample: String,
    description: String,
    program_version: String,
    walks_per_side: u64,
    seed: u64,
    cut_off: u64,
    asymmetry: f64,
    class_error: f64,
    classes: usize,
    surface: AngleGrid,
    interior: AngleGrid,
    totals: Vec<WhiteTotals>,
}

/// Is this the beginning of such a file?
pub fn is_petal_optics(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// The file of a petal.
pub fn write(petal: &PetalOptics) -> Result<Vec<u8>> {
    petal.validate(FORMAT)?;
    // All fields by name: a new one must find its place here, and a new version.
    let PetalOptics {
        sample,
        description,
        version,
        walks,
        seed,
        cut_off,
        asymmetry,
        class_error,
        paths_um,
        spreads_um,
        surface,
        interior,
        totals,
    } = petal;
    let header = Header {
        sample: sample.clone(),
        description: description.clone(),
        program_version: version.clone(),
        walks_per_side: *walks,
        seed: *seed,
        cut_off: *cut_off,
        asymmetry: *asymmetry,
        class_error: *class_error,
        classes: paths_um.len(),
        surface: surface.grid,
        interior: interior.grid,
        totals: totals.clone(),
    };
    let header = serde_json::to_vec(&header).map_err(|e| invalid(FORMAT, e))?;
    let length = u32::try_from(header.len()).map_err(|_| invalid(FORMAT, "the header is too long"))?;
    let mut out = MAGIC.to_vec();
    out.extend(VERSION.to_le_bytes());
    out.extend(length.to_le_bytes());
    out.extend(header);
    let codes = [paths_um, spreads_um].map(|c| c.as_flattened());
    for values in codes.into_iter().chain([surface.values.as_slice(), &interior.values]) {
        values.iter().for_each(|v| out.extend(v.to_le_bytes()));
    }
    let checksum = Sha256::digest(&out);
    out.extend(checksum);
    if out.len() > MAX_BYTES {
        return Err(invalid(FORMAT, format_args!("{} bytes; at most {MAX_BYTES}", out.len())));
    }
    Ok(out)
}

/// Reads what [`write()`] wrote.
pub fn read(bytes: &[u8]) -> Result<PetalOptics> {
    let wrong = |what: String| -> Error { invalid(FORMAT, what) };
    let early = || wrong("the file ends too early".into());
    if !is_petal_optics(bytes) {
        return Err(wrong("not a measured petal: it does not begin with `rosaopti`".into()));
    }
    if bytes.len() > MAX_BYTES {
        return Err(wrong(format!("{} bytes; at most {MAX_BYTES} are read", bytes.len())));
    }
    let number = |at: usize| {
        let four = bytes.get(at..).and_then(|b| b.first_chunk::<4>()).ok_or_else(early)?;
        Ok::<u32, Error>(u32::from_le_bytes(*four))
    };
    let version = number(MAGIC.len())?;
    if version != VERSION {
        let help = if version > VERSION { "written by a newer program" } else { "measure the petal again" };
        return Err(wrong(format!("version {version} of the file; this program knows {VERSION}: {help}")));
    }
    let header_end = PREFIX + number(MAGIC.len() + 4)? as usize;
    let (body, checksum) = bytes.split_last_chunk::<CHECKSUM>().ok_or_else(early)?;
    if Sha256::digest(body).as_slice() != checksum {
        return Err(wrong("the checksum does not match: the file is damaged or cut".into()));
    }
    let header = body.get(PREFIX..header_end).ok_or_else(early)?;
    let h: Header = serde_json::from_slice(header).map_err(|e| wrong(format!("the header: {e}")))?;
    let values =
        |grid: &AngleGrid, classes| AngularTable::values_of(grid, classes).map_err(|e| wrong(e.to_string()));
    let (surface, interior) = (values(&h.surface, 1)?, values(&h.interior, h.classes)?);
    let counts = [h.classes * REGIONS, h.classes * REGIONS, surface, interior];
    let mut rest = body.get(header_end..).ok_or_else(early)?;
    let wanted: usize = counts.iter().sum();
    if rest.len() != 4 * wanted {
        let what = format!("{} bytes of tables; the header asks for {}", rest.len(), 4 * wanted);
        return Err(wrong(what));
    }
    let mut next = |count: usize| -> Vec<f32> {
        let (head, tail) = rest.split_at(4 * count);
        rest = tail;
        head.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
    };
    let codes = |flat: Vec<f32>| flat.as_chunks::<REGIONS>().0.to_vec();
    let petal = PetalOptics {
        sample: h.sample,
        description: h.description,
        version: h.program_version,
        walks: h.walks_per_side,
        seed: h.seed,
        cut_off: h.cut_off,
        asymmetry: h.asymmetry,
        class_error: h.class_error,
        paths_um: codes(next(counts[0])),
        spreads_um: codes(next(counts[1])),
        surface: AngularTable { grid: h.surface, classes: 1, values: next(counts[2]) },
        interior: AngularTable { grid: h.interior, classes: h.classes, values: next(counts[3]) },
        totals: h.totals,
    };
    petal.validate(FORMAT)?;
    Ok(petal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Side;
    use crate::gonio::Estimate;
    use crate::io::damage::damage;

    /// Lambertian, 0.3 within and 0.1 from the surface, 0.4 through.
    fn petal() -> PetalOptics {
        let (surface, interior) = (AngleGrid { thetas: 4, phis: 3 }, AngleGrid { thetas: 2, phis: 2 });
        let mut s = AngularTable::zeros(surface, 1);
        s.values[..2 * surface.len()].fill(0.1 / std::f32::consts::PI);
        let mut i = AngularTable::zeros(interior, 2);
        let one_way = interior.len() * 2;
        i.values[..2 * one_way].fill(0.15 / std::f32::consts::PI);
        i.values[2 * one_way..].fill(0.2 / std::f32::consts::PI);
        let e = |value| Estimate { value, standard_error: 0.001 };
        let totals = (0..8).map(|k| WhiteTotals {
            side: if k < 4 { Side::Adaxial } else { Side::Abaxial },
            incident_deg: surface.theta_deg(k % 4),
            surface: e(0.1),
            interior: e(0.3),
            transmitted: e(0.4),
        });
        PetalOptics {
            sample: "a \"petal\"\n".into(),
            description: "[tissue]\n".into(),
            version: "0.1.0".into(),
            walks: 1000,
            seed: u64::MAX,
            cut_off: 400,
            asymmetry: 1.0 / 3.0,
            class_error: 1e-4,
            paths_um: vec![[10.0, 0.0, 100.0, 5.5], [30.0, 0.0, 1e4, 0.0]],
            spreads_um: vec![[1.0, 0.0, 20.0, 5.5], [0.0, 0.0, 1e3, 0.0]],
            surface: s,
            interior: i,
            totals: totals.collect(),
        }
    }

    #[test]
    fn round_trip() {
        let petal = petal();
        let bytes = write(&petal).unwrap();
        assert_eq!(read(&bytes).unwrap(), petal);
        assert!(is_petal_optics(&bytes) && !is_petal_optics(b"rosacell"));
    }

    #[test]
    fn wrong_contents_are_errors() {
        type Change = fn(&mut PetalOptics);
        let changes: [(Change, &str); 10] = [
            (|p| p.interior.values[3] = f32::NAN, "interior"),
            (|p| p.interior.values[3] = -1e-3, "interior"),
            (|p| p.surface.values[1] = f32::INFINITY, "surface"),
            (|p| p.surface.values[3] *= 1.5, "reciprocal"),
            (|p| p.surface.values.iter_mut().for_each(|v| *v *= 4.0), "more light"),
            (|p| p.interior.values.truncate(5), "interior"),
            (|p| p.paths_um[1][2] = -1.0, "paths_um"),
            (|p| p.spreads_um[0][0] = f32::NAN, "spreads_um"),
            (|p| p.totals.truncate(3), "totals"),
            (|p| p.paths_um.truncate(1), "classes"),
        ];
        for (change, key) in changes {
            let mut p = petal();
            change(&mut p);
            let error = write(&p).unwrap_err().to_string();
            assert!(error.starts_with("petal.optics") && error.contains(key), "{key}: {error}");
        }
    }

    /// A file whose checksum is right whatever its header says.
    fn forged(change: impl Fn(&mut serde_json::Value)) -> Vec<u8> {
        let bytes = write(&petal()).unwrap();
        let length = u32::from_le_bytes(*bytes[12..].first_chunk().unwrap()) as usize;
        let mut header: serde_json::Value = serde_json::from_slice(&bytes[16..16 + length]).unwrap();
        change(&mut header);
        let header = header.to_string().into_bytes();
        let mut out = bytes[..12].to_vec();
        out.extend((header.len() as u32).to_le_bytes());
        out.extend(header);
        out.extend(&bytes[16 + length..bytes.len() - CHECKSUM]);
        let sum = Sha256::digest(&out);
        out.extend(sum);
        out
    }

    #[test]
    fn damaged_files_are_errors() {
        let valid = write(&petal()).unwrap();
        damage(&valid, 2000, read);
        let message = |bytes: &[u8]| read(bytes).expect_err("damaged").to_string();
        assert!(message(b"rosaopti").contains("ends too early"));
        for cut in [9, 15, 40, valid.len() - 1] {
            assert!(message(&valid[..cut]).contains(if cut < 16 { "early" } else { "checksum" }), "{cut}");
        }
        let mut changed = valid.clone();
        changed[200] ^= 1;
        assert!(message(&changed).contains("checksum"));
        for (version, help) in [(0u8, "measure the petal again"), (2, "newer program")] {
            let mut other = valid.clone();
            other[8] = version;
            assert!(message(&other).contains(help));
        }
        assert!(read(&forged(|_| {})).is_ok());
        for absurd in [0u64, 1 << 20, u64::MAX] {
            for key in ["/classes", "/surface/thetas", "/interior/phis"] {
                let file = forged(|h| *h.pointer_mut(key).unwrap() = absurd.into());
                assert!(message(&file).starts_with("petal.optics: "), "{key} {absurd}");
            }
        }
        let file = forged(|h| *h.pointer_mut("/interior/thetas").unwrap() = 3.into());
        assert!(message(&file).contains("the header asks for"));
        let file = forged(|h| *h.pointer_mut("/walks_per_side").unwrap() = (-1).into());
        assert!(message(&file).contains("the header: "));
    }
}

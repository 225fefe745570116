//! Sensors: places and normals in as CSV, and what they read out as CSV.
//!
//! In: columns `x_mm,y_mm,z_mm,nx,ny,nz` and perhaps `name`, in that order, or in any order under a header with these
//! names. Lines that begin with `#` are comments. Out: one row per sensor and band, irradiance on the side that the normal
//! points to, with one standard error; `direct` is what comes straight from the lights.

use std::fmt::Write as _;

use glam::DVec3;

use super::invalid;
use super::light_table::digits;
use crate::spectrum::Band;
use crate::{Error, Result};

const COLUMNS: [&str; 7] = ["x_mm", "y_mm", "z_mm", "nx", "ny", "nz", "name"];
/// Most sensors of a file.
pub const MAX_SENSORS: usize = 1_000_000;

/// A small flat receiver with a cosine's response.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// What it is called.
    pub name: String,
    /// Where it is.
    pub position_mm: DVec3,
    /// Unit normal.
    pub normal: DVec3,
}

impl Sensor {
    /// From `x, y, z, nx, ny, nz`; `at` names it in errors.
    pub fn new(name: String, numbers: [f64; 6], at: &str) -> Result<Self> {
        let [x, y, z, nx, ny, nz] = numbers;
        // What rays can be traced with.
        if !numbers.iter().all(|v| v.abs() <= 1e30) {
            return Err(Error::invalid(at, "a number of the sensor is not finite, or larger than 1e30"));
        }
        let normal = DVec3::new(nx, ny, nz)
            .try_normalize()
            .ok_or_else(|| Error::invalid(at, "the normal (nx, ny, nz) has no direction"))?;
        Ok(Self { name, position_mm: DVec3::new(x, y, z), normal })
    }
}

/// Reads sensors. `at` names the file in errors.
pub fn read(bytes: &[u8], at: &str) -> Result<Vec<Sensor>> {
    let mut rows = csv::ReaderBuilder::new()
        .has_headers(false)
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .flexible(true)
        .from_reader(bytes);
    let mut order: Vec<usize> = (0..7).collect();
    let mut sensors = Vec::new();
    for (k, row) in rows.byte_records().enumerate() {
        let row = row.map_err(|e| Error::invalid(at, e.to_string()))?;
        let line = format!("{at}:{}", row.position().map_or(0, csv::Position::line));
        let cells: Vec<&str> = row
            .iter()
            .map(std::str::from_utf8)
            .collect::<Result<_, _>>()
            .map_err(|_| Error::invalid(&line, "not a text file: this is not UTF-8"))?;
        if k == 0 && cells.iter().any(|c| COLUMNS.contains(c)) {
            order = header(&cells, &line)?;
            continue;
        }
        if sensors.len() == MAX_SENSORS {
            return Err(Error::invalid(line, format!("more than {MAX_SENSORS} sensors")));
        }
        let mut numbers = [0.0; 6];
        for (n, column) in numbers.iter_mut().zip(COLUMNS) {
            let place = order.iter().position(|o| COLUMNS[*o] == column);
            let cell = place.and_then(|p| cells.get(p)).copied().unwrap_or("");
            *n = cell.parse().map_err(|_| {
                Error::invalid(&line, format!("{column}: `{}` is not a number", shorten(cell)))
            })?;
        }
        if cells.len() > order.len() {
            return Err(Error::invalid(
                line,
                format!("{} cells; expected {}", cells.len(), COLUMNS.join(",")),
            ));
        }
        let name = order.iter().position(|o| *o == 6).and_then(|p| cells.get(p)).copied().unwrap_or("");
        let name = if name.is_empty() { format!("{}", sensors.len() + 1) } else { name.to_owned() };
        sensors.push(Sensor::new(name, numbers, &line)?);
    }
    if sensors.is_empty() {
        return Err(Error::invalid(at, format!("there is no sensor; expected rows {}", COLUMNS.join(","))));
    }
    Ok(sensors)
}

fn shorten(cell: &str) -> String {
    cell.chars().take(40).collect()
}

/// Which column each cell is.
fn header(cells: &[&str], line: &str) -> Result<Vec<usize>> {
    let mut order = Vec::new();
    for cell in cells {
        let Some(column) = COLUMNS.iter().position(|c| c == cell) else {
            let what = format!("`{}` is no column; expected {}", shorten(cell), COLUMNS.join(","));
            return Err(Error::invalid(line, what));
        };
        if order.contains(&column) {
            return Err(Error::invalid(line, format!("the column {cell} stands there twice")));
        }
        order.push(column);
    }
    if let Some(missing) = COLUMNS[..6].iter().enumerate().find(|(k, _)| !order.contains(k)) {
        return Err(Error::invalid(line, format!("the column {} is missing", missing.1)));
    }
    Ok(order)
}

/// What a sensor reads in one band: W m-2 and umol m-2 s-1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BandReading {
    /// All light.
    pub irradiance: [f64; 2],
    /// Its standard error.
    pub standard_error: [f64; 2],
    /// What comes straight from the lights.
    pub direct: [f64; 2],
}

/// What a sensor reads.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// The sensor.
    pub sensor: Sensor,
    /// Its light by band.
    pub bands: Vec<BandReading>,
}

/// Writes readings as CSV under the lines `about`.
pub fn write(readings: &[Reading], bands: &[Band], about: &[String]) -> Result<String> {
    const FORMAT: &str = "sensors";
    if readings.is_empty() || readings.iter().any(|r| r.bands.len() != bands.len()) {
        return Err(invalid(FORMAT, "there is nothing to write, or bands are missing"));
    }
    let mut out = String::new();
    for line in about {
        // Writing to a String cannot fail.
        let _ = writeln!(out, "# {}", line.replace(['\n', '\r'], " "));
    }
    let fail = |e: csv::Error| invalid(FORMAT, e);
    let mut rows = csv::Writer::from_writer(Vec::new());
    let units = ["w_m2", "umol_m2_s"]
        .map(|u| [format!("irradiance_{u}"), format!("irradiance_{u}_se"), format!("direct_{u}")]);
    let names = ["name", "x_mm", "y_mm", "z_mm", "nx", "ny", "nz", "band_low_nm", "band_high_nm"];
    rows.write_record(names.into_iter().chain(units.as_flattened().iter().map(String::as_str)))
        .map_err(fail)?;
    for r in readings {
        for (band, values) in bands.iter().zip(&r.bands) {
            let mut row = vec![r.sensor.name.clone()];
            row.extend(r.sensor.position_mm.to_array().map(digits));
            row.extend(r.sensor.normal.to_array().map(digits));
            row.extend([band.low_nm.to_string(), band.high_nm.to_string()]);
            for u in 0..2 {
                row.extend([values.irradiance[u], values.standard_error[u], values.direct[u]].map(digits));
            }
            rows.write_record(&row).map_err(fail)?;
        }
    }
    let rows = rows.into_inner().map_err(|e| invalid(FORMAT, e))?;
    out.push_str(&String::from_utf8_lossy(&rows));
    Ok(out)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::io::damage::damage;

    const FILE: &str = "# two\nnx,ny,nz,name,x_mm,y_mm,z_mm\n0,0,2,\"over, all\",1,2.5,-3e1\n 1,0,0,,0,0,0\n";

    pub(in crate::io) fn readings(bands: usize) -> Vec<Reading> {
        let band = BandReading { irradiance: [2.0, 9.0], standard_error: [0.1, 0.4], direct: [1.0, 4.5] };
        read(FILE.as_bytes(), "s.csv")
            .unwrap()
            .into_iter()
            .map(|sensor| Reading { sensor, bands: vec![band; bands] })
            .collect()
    }

    #[test]
    fn columns_are_found() {
        let sensors = read(FILE.as_bytes(), "s.csv").unwrap();
        assert_eq!(sensors[0].name, "over, all");
        assert_eq!(sensors[0].position_mm, DVec3::new(1.0, 2.5, -30.0));
        assert_eq!((sensors[0].normal, sensors[1].normal), (DVec3::Z, DVec3::X));
        assert_eq!(sensors[1].name, "2");
        assert_eq!(read(b"1,2.5,-30,0,0,1,\"over, all\"\n", "s.csv").unwrap()[0], sensors[0]);
        assert_eq!(read(b"0,0,0,1,0,0", "s.csv").unwrap()[0].name, "1");
        let text = write(&readings(1), &[Band::PAR], &["about".into()]).unwrap();
        assert!(text.starts_with("# about\nname,x_mm,"), "{text}");
        assert!(
            text.contains("\"over, all\",1.0,2.5,-30.0,0.0,0.0,1.0,400,700,2.0,0.1,1.0,9.0,0.4,4.5\n"),
            "{text}"
        );
        assert!(write(&[], &[Band::PAR], &[]).is_err());
    }

    #[test]
    fn hostile_sensors_name_the_line() {
        for (text, words) in [
            ("", "no sensor"),
            ("x_mm,y_mm,z_mm,nx,ny,nz\n", "no sensor"),
            ("1,2,3,0,0,1\n1,2,3,0,0\n", "s.csv:2: nz"),
            ("1,2,3,0,0,0\n", "s.csv:1: the normal"),
            ("1,2,nan,0,0,1\n", "not finite"),
            ("1,2,inf,0,0,1\n", "not finite"),
            ("1,2,1e39,0,0,1\n", "larger"),
            ("1,2,three,0,0,1\n", "z_mm: `three`"),
            ("1,2,3,0,0,1,a,b\n", "8 cells"),
            ("x_mm,y_mm,z_mm,nx,ny\n", "nz is missing"),
            ("x_mm,y_mm,z_mm,nx,ny,x_mm\n", "twice"),
            ("x_mm,y_mm,z_mm,nx,ny,nz,colour\n", "no column"),
        ] {
            let error = read(text.as_bytes(), "s.csv").unwrap_err().to_string();
            assert!(error.contains("s.csv") && error.contains(words), "{text:?}: {error}");
        }
        assert!(read(b"1,2,\xff,0,0,1\n", "s.csv").is_err());
    }

    #[test]
    fn damaged_files_are_errors() {
        damage(FILE.as_bytes(), 2000, |bytes| read(bytes, "s.csv").is_ok());
    }
}

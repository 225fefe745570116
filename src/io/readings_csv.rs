//! Readings as CSV: any laboratory's table by a column map and declared conventions, and our own that declares itself.
//!
//! Lines that begin with `#` are comments; those of the form `# key: value` with a key of [`CsvOptions`] declare the
//! file's conventions, and options given by the caller win over them. Then a line of column names and one row per
//! direction (one column per band) or per direction and band (a column of wavelengths or band names). The delimiter is the
//! comma, or the semicolon (with decimal commas) or tab where the names have more of those. Tables of
//! [`gonio_csv`] are read too.
//!
//! A value that is missing is skipped and counted in the notes; anything else that is not a finite number, a negative
//! value, an angle out of range is an error with its line (`malformed_files_name_the_line`). What was written is read
//! unchanged (`round_trip`) if angles have at most 10 decimals of a degree.

use std::borrow::Cow;
use std::collections::HashMap;
use std::fmt::Write as _;

use super::columns::{Columns, Source, wavelength_nm};
use super::conventions::{
    AngleReference, AngleUnit, AzimuthZero, Conventions, Quantity, RowAngles, side, side_name,
};
pub use super::csv_options::CsvOptions;
use super::csv_options::{Header, read_header, text};
use super::gonio_csv;
use crate::geometry::Side;
use crate::gonio::measurement::{angles_deg, instrument_deg};
use crate::gonio::{Band, Measurement, Reading, Scale};
use crate::{Error, Result};

/// Values that always mean that there is none; letters in any case.
const MISSING: [&str; 8] = ["", "nan", "na", "n/a", "null", "none", "-", "-9999"];

/// Reads a table; `name` (the file's) stands in errors as `name:line`.
pub fn read(bytes: &[u8], name: &str, options: &CsvOptions) -> Result<Measurement> {
    let text = text(bytes, name)?;
    if text.lines().find(|l| !l.starts_with('#')) == Some(gonio_csv::COLUMNS) && text.starts_with('#') {
        return own_table(bytes, name, options);
    }
    let header = read_header(text, name)?;
    let Some((names_at, names_line)) =
        text.lines().enumerate().find(|(_, l)| !l.starts_with('#') && !l.trim().is_empty())
    else {
        return Err(Error::invalid(format!("{name}:1"), "no line of column names"));
    };
    let delimiter =
        [b'\t', b';', b','].into_iter().max_by_key(|d| names_line.bytes().filter(|b| b == d).count());
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(delimiter.unwrap_or(b','))
        .comment(Some(b'#'))
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let at = |line: usize, what: String| Error::invalid(format!("{name}:{line}"), what);
    let names: Vec<String> =
        reader.headers().map_err(|e| at(names_at + 1, e.to_string()))?.iter().map(String::from).collect();
    let columns = Columns::find(&options.columns, &names).map_err(|what| at(names_at + 1, what))?;
    let mut table = Table::new(options, header, columns, names, delimiter != Some(b','))?;
    let mut line = LineCounter { text, byte: 0, line: 1 };
    let mut record = csv::StringRecord::new();
    loop {
        let start = reader.position().byte() as usize;
        if !reader.read_record(&mut record).map_err(|e| at(line.of_record(start), e.to_string()))? {
            break;
        }
        table.row(&record).map_err(|what| at(line.of_record(start), what))?;
    }
    table.finish(name)
}

/// The line on which a record starts: the csv reader counts from before the comments that precede it.
struct LineCounter<'a> {
    text: &'a str,
    byte: usize,
    line: usize,
}

impl LineCounter<'_> {
    fn of_record(&mut self, start: usize) -> usize {
        let bytes = self.text.as_bytes();
        let start = start.min(bytes.len());
        if start > self.byte {
            self.line += bytes[self.byte..start].iter().filter(|&&b| b == b'\n').count();
            self.byte = start;
        }
        let skipped = bytes[start..]
            .split(|&b| b == b'\n')
            .take_while(|l| l.starts_with(b"#") || l.iter().all(|b| *b == b'\r'))
            .count();
        self.line + skipped
    }
}

/// Rows on their way to a measurement.
struct Table<'a> {
    options: CsvOptions,
    conventions: Conventions,
    azimuth_declared: bool,
    columns: Columns,
    names: Vec<String>,
    decimal_comma: bool,
    missing: Vec<Cow<'a, str>>,
    series: HashMap<String, u32>,
    bands: HashMap<(String, u64), u32>,
    found: Measurement,
    missing_values: usize,
    at_horizon: usize,
    zero_sigmas: usize,
}

impl<'a> Table<'a> {
    fn new(
        given: &'a CsvOptions,
        header: Header,
        columns: Columns,
        names: Vec<String>,
        decimal_comma: bool,
    ) -> Result<Self> {
        let declared = header.options;
        let mut notes = header.notes;
        let quantity = given.quantity.or(declared.quantity).unwrap_or_else(|| {
            let column = columns.value.first().map_or("", |&c| names[c].as_str());
            let start = column.split(|c: char| !c.is_ascii_alphabetic()).next().unwrap_or("");
            let by_name = start.parse::<Quantity>().ok();
            let why = if by_name.is_some() {
                format!("from the column's name `{column}`")
            } else {
                "by default".into()
            };
            let quantity = by_name.unwrap_or_default();
            notes.push(format!("quantity was not declared: {quantity:?} {why}"));
            quantity
        });
        let angle_unit = given.angle_unit.or(declared.angle_unit).unwrap_or_else(|| match columns.theta {
            Source::Column(c) if names[c].to_ascii_lowercase().ends_with("_rad") => AngleUnit::Radians,
            _ => AngleUnit::Degrees,
        });
        let azimuth = given.azimuth.or(declared.azimuth);
        if azimuth.is_none() {
            notes.push("azimuth was not declared: 0 taken as the lamp's side".into());
        }
        let conventions = Conventions {
            quantity,
            angle_unit,
            azimuth: azimuth.unwrap_or_default(),
            reference: given.reference.or(declared.reference).unwrap_or_default(),
        };
        let half_angle = |key: &str, v: Option<f64>| match v.unwrap_or(0.0) {
            deg if (0.0..=45.0).contains(&deg) => Ok(deg),
            deg => Err(Error::invalid(key, format!("{deg} is not in 0-45 deg"))),
        };
        let found = Measurement {
            sample: header.sample.unwrap_or_default(),
            scale: conventions.scale(),
            source_half_angle_deg: half_angle(
                "source_half_angle_deg",
                given.source_half_angle_deg.or(declared.source_half_angle_deg),
            )?,
            detector_half_angle_deg: half_angle(
                "detector_half_angle_deg",
                given.detector_half_angle_deg.or(declared.detector_half_angle_deg),
            )?,
            notes,
            ..Default::default()
        };
        let missing = MISSING.map(Cow::from).into_iter();
        let more = given.missing.iter().map(|m| Cow::from(m.trim().to_ascii_lowercase()));
        let side = given.side.or(declared.side);
        Ok(Self {
            options: CsvOptions { side, ..given.clone() },
            conventions,
            azimuth_declared: azimuth.is_some(),
            columns,
            names,
            decimal_comma,
            missing: missing.chain(more).collect(),
            series: HashMap::new(),
            bands: HashMap::new(),
            found,
            missing_values: 0,
            at_horizon: 0,
            zero_sigmas: 0,
        })
    }

    fn field<'r>(&self, record: &'r csv::StringRecord, column: usize) -> Result<&'r str, String> {
        record.get(column).ok_or_else(|| {
            format!(
                "{} is missing: the row has {} of {} columns",
                self.names[column],
                record.len(),
                self.names.len()
            )
        })
    }

    fn parse(&self, column: usize, field: &str) -> Result<f64, String> {
        let number = if self.decimal_comma { Cow::from(field.replace(',', ".")) } else { Cow::from(field) };
        let v: f64 =
            number.parse().map_err(|_| format!("{}: `{field}` is not a number", self.names[column]))?;
        if v.is_finite() { Ok(v) } else { Err(format!("{}: `{field}` is not finite", self.names[column])) }
    }

    fn number(&self, record: &csv::StringRecord, source: Source) -> Result<f64, String> {
        match source {
            Source::Constant(v) => Ok(v),
            Source::Column(c) => self.parse(c, self.field(record, c)?),
        }
    }

    /// A number that may be missing.
    fn optional(&self, record: &csv::StringRecord, column: usize) -> Result<Option<f64>, String> {
        let field = self.field(record, column)?;
        let same = |m: &Cow<str>| {
            field.eq_ignore_ascii_case(m)
                || matches!((field.parse::<f64>(), m.parse::<f64>()), (Ok(a), Ok(b)) if a == b)
        };
        if self.missing.iter().any(same) { Ok(None) } else { self.parse(column, field).map(Some) }
    }

    fn row(&mut self, record: &csv::StringRecord) -> Result<(), String> {
        if record.len() > self.names.len() {
            return Err(format!("{} columns, but {} names", record.len(), self.names.len()));
        }
        let lit = match self.columns.side {
            Some(c) => side(self.field(record, c)?).map_err(|e| e.to_string())?,
            None => self.options.side.unwrap_or(Side::Adaxial),
        };
        let angles = RowAngles {
            incident_theta: self.number(record, self.columns.incident_theta)?,
            incident_phi: self.number(record, self.columns.incident_phi)?,
            theta: self.number(record, self.columns.theta)?,
            phi: self.number(record, self.columns.phi)?,
            side: lit,
        };
        if !self.azimuth_declared && angles.incident_phi != 0.0 {
            return Err(format!(
                "the lamp's azimuth is {}: declare whether azimuths are counted from the lamp, the forward side or the \
                 sample (azimuth lamp, forward, sample)",
                angles.incident_phi
            ));
        }
        let (wi, wo) = self.conventions.directions(angles)?;
        let series = match self.columns.series {
            Some(c) => self.field(record, c)?.to_string(),
            None => self.found.sample.clone(),
        };
        let series = match self.series.get(&series) {
            Some(&i) => i,
            None => {
                let i = self.found.series.len() as u32;
                self.found.series.push(series.clone());
                self.series.insert(series, i);
                i
            }
        };
        let value_per_bsdf = self.conventions.value_per_bsdf(wo);
        for k in 0..self.columns.value.len() {
            let column = self.columns.value[k];
            let band = self.band(record, column)?;
            let (Some(value), Some(per)) = (self.optional(record, column)?, value_per_bsdf) else {
                *(if value_per_bsdf.is_some() { &mut self.missing_values } else { &mut self.at_horizon }) +=
                    1;
                continue;
            };
            if value < 0.0 {
                return Err(format!(
                    "{}: {value} is negative; if it marks a missing value, declare it so",
                    self.names[column]
                ));
            }
            let sigma = match self.columns.sigma.get(if self.columns.sigma.len() == 1 { 0 } else { k }) {
                Some(&c) => match self.optional(record, c)? {
                    Some(s) if s < 0.0 => return Err(format!("{}: {s} is negative", self.names[c])),
                    Some(0.0) => {
                        self.zero_sigmas += 1;
                        None
                    }
                    s => s,
                },
                None => None,
            };
            let bsdf_per_sr = self.conventions.bsdf(value, per);
            let sigma_per_sr = sigma.map(|s| self.conventions.bsdf(s, per));
            if !(bsdf_per_sr.is_finite() && sigma_per_sr.is_none_or(f64::is_finite)) {
                return Err(format!("{}: {value} is too large", self.names[column]));
            }
            self.found.readings.push(Reading { wi, wo, series, band, bsdf_per_sr, sigma_per_sr });
        }
        Ok(())
    }

    /// Index of the band of a row's value.
    fn band(&mut self, record: &csv::StringRecord, column: usize) -> Result<u32, String> {
        let nm = match self.columns.wavelength {
            Some(Source::Column(c)) => self.optional(record, c)?,
            Some(Source::Constant(nm)) => Some(nm),
            None => None,
        };
        if let Some(nm) = nm.filter(|nm| !(nm.is_finite() && *nm > 0.0)) {
            return Err(format!("wavelength: {nm} nm is not a wavelength"));
        }
        let band = match (self.columns.band, nm) {
            (Some(c), wavelength_nm) => Band { name: self.field(record, c)?.to_string(), wavelength_nm },
            (None, Some(nm)) => Band::nm(nm),
            (None, None) => match wavelength_nm(&self.names[column]) {
                Some(nm) => Band::nm(nm),
                None => Band::named(self.names[column].clone()),
            },
        };
        let key = (band.name.clone(), band.wavelength_nm.map_or(0, f64::to_bits));
        let next = self.found.bands.len() as u32;
        Ok(*self.bands.entry(key).or_insert_with(|| {
            self.found.bands.push(band);
            next
        }))
    }

    fn finish(mut self, name: &str) -> Result<Measurement> {
        let m = &mut self.found;
        if m.readings.is_empty() {
            let what = match self.missing_values + self.at_horizon {
                0 => "the table has no rows".into(),
                n => format!("all {n} values are missing or at the horizon"),
            };
            return Err(Error::invalid(name, what));
        }
        let mut note = |n: usize, what: &str| {
            if n > 0 {
                m.notes.push(format!("{n} {what}"));
            }
        };
        note(self.missing_values, "values are missing");
        note(self.at_horizon, "values at the horizon left out: a DSF there says nothing of the BSDF");
        note(self.zero_sigmas, "standard deviations of zero taken as not known");
        Ok(self.found)
    }
}

/// A table of the virtual goniophotometer. It declares itself; options that contradict it are a mistake.
fn own_table(bytes: &[u8], name: &str, options: &CsvOptions) -> Result<Measurement> {
    let table = gonio_csv::read(bytes, name)?;
    let contradicts = |yes: bool, what: &str| {
        if yes {
            Err(Error::invalid(name, format!("a Rosarium goniometer table declares itself: its {what}")))
        } else {
            Ok(())
        }
    };
    contradicts(options.quantity.is_some_and(|q| q != Quantity::Bsdf), "quantity is bsdf")?;
    contradicts(options.angle_unit.is_some_and(|u| u != AngleUnit::Degrees), "angle unit is degrees")?;
    contradicts(options.azimuth.is_some_and(|a| a == AzimuthZero::Forward), "azimuth 0 is the lamp's side")?;
    contradicts(
        options.reference.is_some_and(|r| r != AngleReference::Normal),
        "angles are from the normal",
    )?;
    contradicts(
        options.side.is_some_and(|s| s != table.side),
        &format!("lit side is {}", side_name(table.side)),
    )?;
    let mut m = table.to_measurement();
    m.source_half_angle_deg = options.source_half_angle_deg.unwrap_or(0.0);
    m.detector_half_angle_deg = options.detector_half_angle_deg.unwrap_or(0.0);
    Ok(m)
}

/// Writes readings as a table that declares itself: one row per reading, the lamp's frame of the lit side, azimuths from
/// the sample's axis. Angles are rounded to 1e-10 degrees, values have all their digits. Bands and series without
/// readings are not part of the file, and those that are stand in the order of their first reading when it is read.
pub fn write(m: &Measurement) -> Result<String> {
    let one_line = |s: &str| s.replace(['\n', '\r'], " ");
    let mut out = String::from(
        "# Rosarium readings: one row per direction of lamp and detector and band.\n\
         # Angles from the normal of the lit side, azimuths from the sample's axis; theta above 90 is transmission.\n",
    );
    let quantity = if m.scale == Scale::Absolute { "bsdf" } else { "relative" };
    // Writing to a String cannot fail.
    let _ = write!(
        out,
        "# sample: {}\n# quantity: {quantity}\n# angle_unit: degrees\n# azimuth: sample\n# reference: normal\n\
         # source_half_angle_deg: {:?}\n# detector_half_angle_deg: {:?}\n",
        one_line(&m.sample),
        m.source_half_angle_deg,
        m.detector_half_angle_deg
    );
    for note in &m.notes {
        let _ = writeln!(out, "# note: {}", one_line(note));
    }
    let wrong = |e: &dyn std::fmt::Display| Error::invalid("readings", e.to_string());
    let mut rows = csv::Writer::from_writer(Vec::new());
    let names = [
        "incident_theta_deg",
        "incident_phi_deg",
        "theta_deg",
        "phi_deg",
        "side",
        "series",
        "band",
        "wavelength_nm",
        if m.scale == Scale::Absolute { "bsdf_per_sr" } else { "relative" },
        "sigma",
    ];
    rows.write_record(names).map_err(|e| wrong(&e))?;
    for (i, r) in m.readings.iter().enumerate() {
        let (Some(band), Some(series)) = (m.bands.get(r.band as usize), m.series.get(r.series as usize))
        else {
            return Err(wrong(&format_args!("reading {i} names a band or series that does not exist")));
        };
        let lit = instrument_deg(r.wi, r.wo).3;
        let angles = |w| {
            let (theta, phi) = angles_deg(super::conventions::turned(w, lit));
            (rounded(theta), rounded(phi) % 360.0)
        };
        let ((ti, pi), (to, po)) = (angles(r.wi), angles(r.wo));
        let shortest = |v: Option<f64>| v.map_or(String::new(), |v| format!("{v:?}"));
        rows.write_record([
            format!("{ti:?}").as_str(),
            &format!("{pi:?}"),
            &format!("{to:?}"),
            &format!("{po:?}"),
            side_name(lit),
            series.trim(),
            band.name.trim(),
            &shortest(band.wavelength_nm),
            &format!("{:?}", r.bsdf_per_sr),
            &shortest(r.sigma_per_sr),
        ])
        .map_err(|e| wrong(&e))?;
    }
    let rows = rows.into_inner().map_err(|e| wrong(&e))?;
    out.push_str(&String::from_utf8(rows).map_err(|e| wrong(&e))?);
    Ok(out)
}

/// To 1e-10: angles that were whole numbers are so again.
fn rounded(deg: f64) -> f64 {
    (deg * 1e10).round() / 1e10
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::gonio::measurement::direction_deg;
    use crate::io::columns::ColumnMap;
    use crate::io::damage::damage;

    /// The layout of a leaf goniospectrometer, with made-up numbers.
    const LEAF: &str = "\
# Reflectance factors, azimuth 0 = the lamp's side: made up.
sample,species,source_zenith_deg,source_azimuth_deg,view_zenith_deg,view_azimuth_deg,BRF_450nm,BRF_550nm
a-1,\"Rosa, rugosa\",20,0,0,0,0.05,0.11

# a comment between
a-1,\"Rosa, rugosa\",20,0,60,180,0.09,0.15
b-2,Rosa canina,20,0,20,0,,-9999
b-2,Rosa canina,20,0,30,90,0.04,NaN
";

    fn leaf_options() -> CsvOptions {
        let columns =
            "incident_theta=source_zenith_deg,theta=view_zenith_deg,phi=view_azimuth_deg,value=BRF_550nm";
        CsvOptions {
            columns: ColumnMap { series: Some("sample".into()), ..ColumnMap::parse(columns).unwrap() },
            quantity: Some(Quantity::Brf),
            azimuth: Some(AzimuthZero::Lamp),
            ..Default::default()
        }
    }

    fn readings() -> Measurement {
        let reading = |i: u32| {
            let f = f64::from(i);
            // Two lamps above, one below; directions all around.
            let lamp = [(20.0, 0.0), (45.5, 130.0), (150.0, 10.0)][(i % 3) as usize];
            Reading {
                wi: direction_deg(lamp.0, lamp.1),
                wo: direction_deg((7.5 * f) % 180.0, (33.3 * f) % 360.0),
                series: u32::from(i > 10),
                band: i % 2,
                bsdf_per_sr: 0.1 / (f + 3.0),
                sigma_per_sr: (!i.is_multiple_of(4)).then_some(1e-3 / (f + 7.0)),
            }
        };
        Measurement {
            sample: "a \"sheet\"".into(),
            bands: vec![Band::nm(550.5), Band { name: "red, broad".into(), wavelength_nm: None }],
            series: vec!["#1".into(), "day 2, lamp 3".into()],
            readings: (0..40).map(reading).collect(),
            source_half_angle_deg: 0.25,
            detector_half_angle_deg: 1.5,
            scale: Scale::Absolute,
            notes: vec!["3 values are missing".into()],
        }
    }

    #[test]
    fn round_trip() {
        for scale in [Scale::Absolute, Scale::RelativePerSeries] {
            let m = Measurement { scale, ..readings() };
            let text = write(&m).unwrap();
            let back = read(text.as_bytes(), "t.csv", &CsvOptions::default()).unwrap();
            assert_eq!((&back.sample, &back.bands, &back.series), (&m.sample, &m.bands, &m.series));
            assert_eq!((back.scale, &back.notes), (m.scale, &m.notes));
            assert_eq!((back.source_half_angle_deg, back.detector_half_angle_deg), (0.25, 1.5));
            assert_eq!(back.readings.len(), m.readings.len());
            for (a, b) in back.readings.iter().zip(&m.readings) {
                assert!(a.wi.distance(b.wi) < 1e-11 && a.wo.distance(b.wo) < 1e-11, "{a:?} {b:?}");
                let numbers = |r: &Reading| (r.series, r.band, r.bsdf_per_sr, r.sigma_per_sr);
                assert_eq!(numbers(a), numbers(b));
            }
            // What was read is written to the same bytes, and reads to the same bits.
            assert_eq!(write(&back).unwrap(), text);
            assert_eq!(
                read(text.replace('\n', "\r\n").as_bytes(), "t", &CsvOptions::default()).unwrap(),
                back
            );
        }
    }

    #[test]
    fn a_leaf_goniospectrometer() {
        let m = read(LEAF.as_bytes(), "leaf.csv", &leaf_options()).unwrap();
        assert_eq!(m.series, ["a-1", "b-2"]);
        assert_eq!(m.bands, [Band::nm(550.0)]);
        assert_eq!(m.readings.len(), 2);
        assert_eq!(m.notes, ["2 values are missing"]);
        let r = m.readings[1];
        assert!((r.bsdf_per_sr - 0.15 / PI).abs() < 1e-16);
        assert!(
            r.wi.distance(direction_deg(20.0, 0.0)) < 1e-15
                && r.wo.distance(direction_deg(60.0, 180.0)) < 1e-15
        );
        // Without a map: columns by their names, one band per wavelength, what was assumed in the notes.
        let m = read(LEAF.as_bytes(), "leaf.csv", &CsvOptions::default()).unwrap();
        assert_eq!(m.bands, [Band::nm(450.0), Band::nm(550.0)]);
        assert_eq!((m.readings.len(), m.series.len()), (5, 1));
        assert!((m.readings[0].bsdf_per_sr - 0.05 / PI).abs() < 1e-16);
        assert!(
            m.notes[0].contains("Brf from the column's name") && m.notes[1].contains("lamp's side"),
            "{:?}",
            m.notes
        );
    }

    #[test]
    fn one_measurement_under_every_declaration() {
        let lambert = "theta_i,theta,phi,value\n30,50,180,0.25\n30,30,0,0.5\n";
        let expected = read(lambert.as_bytes(), "t", &CsvOptions::default()).unwrap();
        let cos = |d: f64| d.to_radians().cos();
        let rad = |d: f64| d.to_radians();
        for text in [
            "# quantity: bsdf\n# azimuth: forward\ntheta_i,theta,phi,value\n30,50,0,0.25\n30,30,180,0.5\n"
                .into(),
            "# reference: specular\ntheta_i,theta,phi,value\n30,20,180,0.25\n30,60,0,0.5\n".into(),
            "# azimuth: sample\ntheta_i\tphi_i\ttheta\tphi\tvalue\n30\t0\t50\t180\t0.25\n30\t0\t30\t0\t0.5\n"
                .into(),
            "theta_i;theta;phi;value\n30,0;50;180;0,25\n30;30;0,0;0,5\n".into(),
            "theta_i,theta,value\n30,-50,0.25\n30,30,0.5\n".to_string(),
            format!("theta_i,theta,phi,dsf\n30,50,180,{}\n30,30,0,{}\n", 0.25 * cos(50.0), 0.5 * cos(30.0)),
            format!("theta_i,theta,phi,brf\n30,50,180,{}\n30,30,0,{}\n", 0.25 * PI, 0.5 * PI),
            format!(
                "theta_i_rad,theta_rad,phi_rad,value\n{},{},{PI},0.25\n{},{},0,0.5\n",
                rad(30.0),
                rad(50.0),
                rad(30.0),
                rad(30.0)
            ),
            "\u{feff}theta_i,theta,phi,wavelength_nm,value\n30,50,180,550,0.25\n30,30,0,550,0.5\n".into(),
        ] {
            let got =
                read(text.as_bytes(), "t", &CsvOptions::default()).unwrap_or_else(|e| panic!("{e}: {text}"));
            assert_eq!(got.readings.len(), 2, "{text}");
            for (a, b) in got.readings.iter().zip(&expected.readings) {
                let same = a.wi.distance(b.wi) < 1e-12 && a.wo.distance(b.wo) < 1e-12;
                assert!(same && (a.bsdf_per_sr - b.bsdf_per_sr).abs() < 1e-14, "{text}: {a:?} {b:?}");
            }
        }
        // Options win over the header.
        let options = CsvOptions { quantity: Some(Quantity::Brf), ..Default::default() };
        let got = read(b"# quantity: bsdf\naoi,theta,phi,value\n30,50,180,0.25\n", "t", &options).unwrap();
        assert!((got.readings[0].bsdf_per_sr - 0.25 / PI).abs() < 1e-15);
        let relative =
            read(b"# quantity: relative\naoi,theta,phi,value\n30,50,180,7\n", "t", &options).unwrap();
        assert_eq!(relative.scale, Scale::Absolute);
    }

    #[test]
    fn malformed_files_name_the_line() {
        let read = |text: &str, columns: &str| {
            let options = CsvOptions { columns: ColumnMap::parse(columns).unwrap(), ..Default::default() };
            read(text.as_bytes(), "t.csv", &options).unwrap_err().to_string()
        };
        let head = "# a comment\n\ntheta_i,theta,phi,value\n10,20,0,0.1\n\n# another\n";
        for (row, part) in [
            ("10,200,0,0.1", "theta: 200 deg is above 180"),
            ("90,20,0,0.1", "below 90"),
            ("95,20,0,0.1", "incident theta: 95 deg is above 90"),
            ("10,20,0,-0.1", "negative"),
            ("10,20,0,bright", "`bright` is not a number"),
            ("10,20,0,inf", "not finite"),
            ("10,,0,0.1", "theta: `` is not a number"),
            ("10,20,1e300,0.1", "phi"),
            ("10,20,0", "value is missing"),
            ("10,20,0,0.1,5", "5 columns, but 4 names"),
            ("10,20,0,1e400", "not finite"),
        ] {
            let message = read(&format!("{head}{row}\n10,20,0,0.1\n"), "");
            assert!(message.starts_with("t.csv:7: ") && message.contains(part), "{row}: {message}");
        }
        for (text, columns, start) in [
            ("", "", "t.csv:1: no line of column names"),
            ("# x\n", "", "t.csv:1: no line"),
            ("# x\na,b\n1,2\n", "", "t.csv:2: no column for value"),
            ("theta_i,theta,phi,value\n", "", "t.csv: the table has no rows"),
            ("theta_i,theta,phi,value\n1,1,1,\n1,2,1,nan\n", "", "t.csv: all 2 values are missing"),
            (
                "theta_i,theta,phi,value\n1,1,1,1\n",
                "value=BRF",
                "t.csv:1: no column `BRF` for value; columns are theta_i",
            ),
            (
                "# quantity: percent\ntheta_i,theta,phi,value\n1,1,1,1\n",
                "",
                "t.csv:1: quantity: `percent` is not one of bsdf",
            ),
            ("\n# azimuth: sun\ntheta_i,theta,phi,value\n1,1,1,1\n", "", "t.csv:2: azimuth: `sun`"),
            (
                "# source_half_angle_deg: 90\ntheta_i,theta,phi,value\n1,1,1,1\n",
                "",
                "source_half_angle_deg: 90",
            ),
            (
                "# source_half_angle_deg: wide\ntheta_i,theta,phi,value\n1,1,1,1\n",
                "",
                "t.csv:1: source_half_angle_deg",
            ),
            ("theta_i,theta,phi,value,sigma\n1,1,1,1,-1\n", "", "t.csv:2: sigma: -1 is negative"),
            ("theta_i,phi_i,theta,phi,value\n1,30,1,1,1\n", "", "t.csv:2: the lamp's azimuth is 30: declare"),
            (
                "theta_i,theta,phi,value,side\n1,1,1,1,left\n",
                "",
                "t.csv:2: side: `left` is not one of adaxial",
            ),
            ("theta_i,theta,phi,value,nm\n1,1,1,1,-5\n", "", "t.csv:2: wavelength"),
        ] {
            let message = read(text, columns);
            assert!(message.starts_with(start), "{text}: {message}");
        }
        let latin = super::read(b"theta_i,theta\n1,\xb0\n", "t.csv", &CsvOptions::default()).unwrap_err();
        assert!(latin.to_string().starts_with("t.csv:2: not UTF-8"), "{latin}");
    }

    #[test]
    fn sigmas_and_gaps() {
        let text = "theta_i,theta,phi,value,sigma\n1,2,0,0.1,0.01\n1,3,0,0.1,\n1,4,0,0.1,0\n1,5,0,-1,0.1\n";
        let options = CsvOptions {
            missing: vec!["-1.0".into()],
            azimuth: Some(AzimuthZero::Lamp),
            quantity: Some(Quantity::Brf),
            ..Default::default()
        };
        let m = read(text.as_bytes(), "t", &options).unwrap();
        let sigmas: Vec<Option<f64>> = m.readings.iter().map(|r| r.sigma_per_sr).collect();
        assert_eq!(sigmas, [Some(0.01 * std::f64::consts::FRAC_1_PI), None, None]);
        assert_eq!(m.notes, ["1 values are missing", "1 standard deviations of zero taken as not known"]);
    }

    #[test]
    fn tables_of_the_goniophotometer_are_read() {
        use crate::gonio::{ExitantGrid, Goniophotometer};
        let gonio = Goniophotometer {
            incident_deg: vec![30.0],
            side: Side::Abaxial,
            rays: 2_000,
            bands_nm: vec![550.0],
            exitant: ExitantGrid { theta_step_deg: 30.0, phi_step_deg: 90.0 },
            ..Default::default()
        };
        let sheet = crate::bsdf::DiffuseTransmission::new(0.3.into(), 0.2.into(), 0.1.into()).unwrap();
        let table = gonio.measure(&sheet, &|_, _| std::ops::ControlFlow::Continue(())).unwrap();
        let text = gonio_csv::write(&table).unwrap();
        let m = read(text.as_bytes(), "t.csv", &CsvOptions::default()).unwrap();
        assert_eq!(m, table.to_measurement());
        assert!(m.readings.iter().all(|r| r.wi.z < 0.0));
        let options = CsvOptions { quantity: Some(Quantity::Brf), ..Default::default() };
        assert!(
            read(text.as_bytes(), "t.csv", &options).unwrap_err().to_string().contains("declares itself")
        );
    }

    #[test]
    fn damaged_files_are_errors() {
        let text = write(&readings()).unwrap();
        damage(text.as_bytes(), 300, |bytes| read(bytes, "t.csv", &CsvOptions::default()));
        damage(LEAF.as_bytes(), 300, |bytes| read(bytes, "t.csv", &leaf_options()));
    }
}

//! pab pgII text (`.dat`): the scattered light of one incidence per file.
//!
//! Lines that begin with `#` are the header; of it are read `sample_name "x"`, `colorimetry: CIE-Y` (one value) or
//! `CIE-XYZ` (three), `format: theta phi Q` with Q one of BSDF, BRDF, BTDF (1/sr) and DSF (BSDF x |cos theta|),
//! `intheta` and `inphi` or `incident_angle`, and `upphi`. Then rows of numbers, degrees: theta 0 to 180 from the front's
//! normal, azimuths from the sample's axis, for lamp and detector. Where `upphi` is given, azimuths are turned so that
//! this direction is +y.
//!
//! Negative values are errors with their line. Lost when written: wavelengths and names of the bands (one band is called
//! CIE-Y), series, sigma, half angles. Guarded by `round_trip`, `malformed_files_name_the_line`. Source: the reader of
//! Radiance's `pabopto2bsdf`.

use std::fmt::Write as _;

use super::csv_options::text;
use crate::gonio::measurement::{angles_deg, direction_deg};
use crate::gonio::{Band, Measurement, Reading, Scale, merge};
use crate::{Error, Result};

const XYZ: [&str; 3] = ["CIE-X", "CIE-Y", "CIE-Z"];

/// What a column of the rows is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Column {
    Theta,
    Phi,
    Value,
}

#[derive(Default)]
struct Header {
    sample: String,
    bands: Option<Vec<Band>>,
    columns: Vec<Column>,
    is_dsf: bool,
    incident_theta_deg: Option<f64>,
    incident_phi_deg: Option<f64>,
    up_phi_deg: Option<f64>,
}

impl Header {
    /// One line without its `#`. Unknown keys are comments.
    fn line(&mut self, line: &str) -> Result<(), String> {
        let (key, rest) = line.split_once([' ', '\t']).unwrap_or((line, ""));
        let rest = rest.trim();
        let angle = |text: Option<&str>| {
            let text = text.unwrap_or("");
            let v = text.parse::<f64>().ok().filter(|v| v.is_finite() && v.abs() <= 3600.0);
            v.map(Some).ok_or(format!("{key}: `{text}` is not an angle in degrees"))
        };
        match key.trim_end_matches(':') {
            "sample_name" => self.sample = rest.trim_matches('"').into(),
            "colorimetry" => {
                self.bands = Some(match rest.to_ascii_uppercase().as_str() {
                    "CIE-Y" => vec![Band::named("CIE-Y")],
                    "CIE-XYZ" => XYZ.map(Band::named).to_vec(),
                    _ => return Err(format!("colorimetry: `{rest}` is not one of CIE-Y, CIE-XYZ")),
                });
            }
            "format" => self.format(rest)?,
            "intheta" => self.incident_theta_deg = angle(Some(rest))?,
            "inphi" => self.incident_phi_deg = angle(Some(rest))?,
            "incident_angle" => {
                let mut words = rest.split_ascii_whitespace();
                self.incident_theta_deg = angle(words.next())?;
                self.incident_phi_deg = angle(words.next())?;
            }
            "upphi" => self.up_phi_deg = angle(Some(rest))?,
            _ => {}
        }
        Ok(())
    }

    fn format(&mut self, rest: &str) -> Result<(), String> {
        self.columns.clear();
        for word in rest.split_ascii_whitespace() {
            let column = match word.to_ascii_lowercase().as_str() {
                "theta" => Column::Theta,
                "phi" => Column::Phi,
                "bsdf" | "brdf" | "btdf" | "dsf" => {
                    self.is_dsf = word.eq_ignore_ascii_case("dsf");
                    Column::Value
                }
                _ => return Err(format!("format: `{word}` is not one of theta, phi, BSDF, BRDF, BTDF, DSF")),
            };
            if self.columns.contains(&column) {
                return Err(format!("format: `{word}` is given twice"));
            }
            self.columns.push(column);
        }
        if self.columns.len() == 3 { Ok(()) } else { Err("format: needs theta, phi and a quantity".into()) }
    }
}

/// Reads the file of one incidence; `name` (the file's) stands in errors as `name:line`.
pub fn read(bytes: &[u8], name: &str) -> Result<Measurement> {
    let text = text(bytes, name)?;
    let at = |line: usize, what: String| Error::invalid(format!("{name}:{line}"), what);
    let mut header = Header::default();
    let mut rows = Vec::new();
    for (number, line) in text.lines().enumerate() {
        if let Some(line) = line.strip_prefix('#') {
            header.line(line.trim()).map_err(|what| at(number + 1, what))?;
        } else if !line.trim().is_empty() {
            rows.push((number + 1, line));
        }
    }
    let header_end = rows.first().map_or(text.lines().count().max(1), |r| r.0);
    let missing = |key: &str| at(header_end, format!("the header has no `#{key}`"));
    if header.columns.is_empty() {
        return Err(missing("format: theta phi BSDF"));
    }
    let theta_i = header.incident_theta_deg.ok_or_else(|| missing("intheta"))?;
    let phi_i = header.incident_phi_deg.ok_or_else(|| missing("inphi"))?;
    if !(0.0..=180.0).contains(&theta_i) || (theta_i - 90.0).abs() < 1e-9 {
        return Err(at(
            header_end,
            format!("intheta: {theta_i} deg is not in 0-180, without the horizon (90)"),
        ));
    }
    let turn_deg = header.up_phi_deg.map_or(0.0, |up| 90.0 - up);
    let bands = header.bands.clone().unwrap_or_else(|| vec![Band::named("measured")]);
    let wi = direction_deg(theta_i, (phi_i + turn_deg).rem_euclid(360.0));
    let mut m = Measurement {
        series: vec![header.sample.clone()],
        sample: header.sample.clone(),
        scale: Scale::Absolute,
        ..Default::default()
    };
    let mut at_horizon = 0;
    for (line, row) in rows {
        let (theta, phi, values) =
            read_row(row, &header.columns, bands.len()).map_err(|what| at(line, what))?;
        let wo = direction_deg(theta, (phi + turn_deg).rem_euclid(360.0));
        let per = if header.is_dsf { wo.z.abs() } else { 1.0 };
        if per < 1e-6 {
            at_horizon += 1;
            continue;
        }
        m.readings.extend(values[..bands.len()].iter().enumerate().map(|(band, v)| Reading {
            wi,
            wo,
            series: 0,
            band: band as u32,
            bsdf_per_sr: v / per,
            sigma_per_sr: None,
        }));
    }
    m.bands = bands;
    if m.readings.is_empty() {
        return Err(at(header_end, "the file has no rows of readings".into()));
    }
    if at_horizon > 0 {
        m.notes
            .push(format!("{at_horizon} rows at the horizon left out: a DSF there says nothing of the BSDF"));
    }
    Ok(m)
}

/// Reads the files `(bytes, name)` of all incidences of a sample.
pub fn read_all(files: &[(&[u8], &str)]) -> Result<Measurement> {
    merge(files.iter().map(|(bytes, name)| read(bytes, name)).collect::<Result<Vec<_>>>()?)
}

fn read_row(row: &str, columns: &[Column], bands: usize) -> Result<(f64, f64, [f64; 3]), String> {
    let (mut theta, mut phi, mut values) = (0.0, 0.0, [0.0; 3]);
    let mut words = row.split_ascii_whitespace();
    let mut number = || {
        let word = words.next().ok_or_else(|| format!("the row ends; it has {} numbers", bands + 2))?;
        let v = word.parse::<f64>().map_err(|_| format!("`{word}` is not a number"))?;
        if v.is_finite() { Ok(v) } else { Err(format!("`{word}` is not finite")) }
    };
    for column in columns {
        match column {
            Column::Theta => theta = number()?,
            Column::Phi => phi = number()?,
            Column::Value => {
                for v in &mut values[..bands] {
                    *v = number()?;
                    // A value that a cosine may divide must stay finite.
                    if !(0.0..1e200).contains(v) {
                        return Err(format!("{v} is negative or too large for a BSDF"));
                    }
                }
            }
        }
    }
    if let Some(word) = words.next() {
        return Err(format!("`{word}`: the row has more than {} numbers", bands + 2));
    }
    if !(0.0..=180.0).contains(&theta) {
        return Err(format!("theta: {theta} deg is not in 0-180"));
    }
    if phi.abs() > 3600.0 {
        return Err(format!("phi: {phi} is not an angle in degrees"));
    }
    Ok((theta, phi, values))
}

/// Writes one file per incidence: `(end of its name, text)`. Three bands that are called CIE-X, CIE-Y and CIE-Z are written
/// together; of others the one of index `band`.
pub fn write(m: &Measurement, band: usize) -> Result<Vec<(String, String)>> {
    let wrong = |what: &str| Error::invalid("pgII", what);
    if m.scale != Scale::Absolute {
        return Err(wrong("relative readings have no BSDF to write"));
    }
    if m.series.len() > 1 {
        return Err(wrong("several series; select one"));
    }
    if m.readings.is_empty() {
        return Err(wrong("there are no readings"));
    }
    let xyz = m.bands.len() == 3 && m.bands.iter().zip(XYZ).all(|(b, name)| b.name == name);
    if band >= m.bands.len() {
        return Err(wrong("there is no band of this index"));
    }
    let mut files = Vec::new();
    for wi in m.lamps() {
        let (ti, pi) = degrees(wi);
        let mut text = format!(
            "#sample_name \"{}\"\n#colorimetry: CIE-{}\n#format: theta phi BSDF\n#intheta {ti}\n#inphi {pi}\n#upphi 90\n",
            m.sample.replace(['"', '\n', '\r'], " "),
            if xyz { "XYZ" } else { "Y" }
        );
        let mut of_lamp = m.readings.iter().filter(|r| r.wi.distance_squared(wi) < 1e-12);
        let mut rows = 0;
        while let Some(r) = of_lamp.next() {
            let (theta, phi) = degrees(r.wo);
            // Writing to a String cannot fail.
            if !xyz {
                if r.band as usize == band {
                    rows += 1;
                    let _ = writeln!(text, "{theta} {phi} {:e}", r.bsdf_per_sr);
                }
                continue;
            }
            let (Some(y), Some(z)) = (of_lamp.next(), of_lamp.next()) else {
                return Err(wrong("a direction lacks one of X, Y and Z"));
            };
            if [r.band, y.band, z.band] != [0, 1, 2] || y.wo != r.wo || z.wo != r.wo {
                return Err(wrong("X, Y and Z of a direction must follow each other"));
            }
            rows += 1;
            let _ =
                writeln!(text, "{theta} {phi} {:e} {:e} {:e}", r.bsdf_per_sr, y.bsdf_per_sr, z.bsdf_per_sr);
        }
        if rows > 0 {
            files.push((format!("_{ti}_{pi}"), text));
        }
    }
    if files.is_empty() { Err(wrong("there are no readings in this band")) } else { Ok(files) }
}

/// Angles to 1e-10 degrees: those that were whole numbers are so again.
fn degrees(w: glam::DVec3) -> (f64, f64) {
    let (theta, phi) = angles_deg(w);
    let rounded = |deg: f64| (deg * 1e10).round() / 1e10;
    (rounded(theta), rounded(phi) % 360.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::directional::tests::Sheet;
    use crate::gonio::{ExitantGrid, sample};
    use crate::io::damage::damage;

    fn measured(bands: &[Band]) -> Measurement {
        let mut sheet = Sheet::new(0.4, 0.1, 0.3);
        sheet.bands = bands.to_vec();
        let grid = ExitantGrid { theta_step_deg: 15.0, phi_step_deg: 15.0 };
        let mut m = sample(&sheet, &[0.0, 30.0, 55.0], &grid).unwrap();
        m.sample = "sheet".into();
        m.series = vec!["sheet".into()];
        m
    }

    fn read_back(files: &[(String, String)]) -> Measurement {
        let files: Vec<(&[u8], &str)> = files.iter().map(|(n, t)| (t.as_bytes(), n.as_str())).collect();
        read_all(&files).unwrap()
    }

    #[test]
    fn round_trip() {
        for bands in [vec![Band::named("CIE-Y")], XYZ.map(Band::named).to_vec()] {
            let m = measured(&bands);
            let files = write(&m, 0).unwrap();
            assert_eq!(files.len(), 6);
            assert_eq!(files[1].0, "_30_0");
            let back = read_back(&files);
            assert_eq!((&back.sample, &back.bands, &back.series), (&m.sample, &m.bands, &m.series));
            assert_eq!(back.readings.len(), m.readings.len());
            for (a, b) in back.readings.iter().zip(&m.readings) {
                assert!(a.wi.distance(b.wi) < 1e-11 && a.wo.distance(b.wo) < 1e-11, "{a:?} {b:?}");
                assert_eq!((a.band, a.bsdf_per_sr), (b.band, b.bsdf_per_sr));
            }
        }
    }

    #[test]
    fn variants_of_the_header_are_one_measurement() {
        let plain = "#sample_name \"a b\"\n#colorimetry: CIE-Y\n#format: theta phi BSDF\n#intheta 30\n#inphi 0\n60 180 0.5\n120 90 0.25\n";
        let expected = read(plain.as_bytes(), "t").unwrap();
        assert_eq!(expected.sample, "a b");
        assert!(expected.readings[1].wo.distance(direction_deg(120.0, 90.0)) < 1e-15);
        for (from, to) in [
            ("#intheta 30\n#inphi 0", "#incident_angle 30 0"),
            ("BSDF", "BRDF"),
            ("BSDF", "btdf"),
            ("#inphi 0", "#inphi 0\n#upphi 90"),
            ("#colorimetry", "#colour of the lamp: white\n#colorimetry"),
            (
                "BSDF\n#intheta 30\n#inphi 0\n60 180 0.5\n120 90 0.25",
                "DSF\n#intheta 30\n#inphi 0\n60 180 0.25\n120 90 0.125\n90 0 1",
            ),
            (
                "theta phi BSDF\n#intheta 30\n#inphi 0\n60 180 0.5\n120 90 0.25",
                "phi theta BSDF\n#intheta 30\n#inphi 0\n180 60 0.5\n90 120 0.25",
            ),
            ("#inphi 0\n60 180 0.5\n120 90 0.25", "#inphi 30\n#upphi 120\n60 210 0.5\n\n120 -240 0.25"),
        ] {
            let text = plain.replace(from, to);
            assert_ne!(text, plain);
            let got = read(text.as_bytes(), "t").unwrap();
            assert_eq!(got.readings.len(), 2, "{text}");
            for (a, b) in got.readings.iter().zip(&expected.readings) {
                let same = a.wi.distance(b.wi) < 1e-12 && a.wo.distance(b.wo) < 1e-12;
                assert!(same && (a.bsdf_per_sr - b.bsdf_per_sr).abs() < 1e-14, "{text}: {a:?} {b:?}");
            }
        }
    }

    #[test]
    fn malformed_files_name_the_line() {
        let head = "#colorimetry: CIE-Y\n#format: theta phi BSDF\n#intheta 30\n#inphi 0\n";
        for (text, start) in [
            ("".to_string(), "t.dat:1: the header has no `#format"),
            ("1 2 3\n".into(), "t.dat:1: the header has no `#format"),
            (head.replace("#inphi 0\n", "1 2 3\n"), "t.dat:4: the header has no `#inphi`"),
            (head.replace("CIE-Y", "RGB"), "t.dat:1: colorimetry: `RGB`"),
            (head.replace("BSDF", "counts"), "t.dat:2: format: `counts`"),
            (head.replace("theta phi BSDF", "theta BSDF"), "t.dat:2: format: needs"),
            (head.replace("30", "NaN"), "t.dat:3: intheta: `NaN`"),
            (head.replace("30", "90") + "1 2 3\n", "t.dat:5: intheta: 90"),
            (head.to_string(), "t.dat:4: the file has no rows"),
            (format!("{head}1 2 3\n4 5\n"), "t.dat:6: the row ends"),
            (format!("{head}1 2 3 4\n"), "t.dat:5: `4`: the row has more"),
            (format!("{head}1 2 bright\n"), "t.dat:5: `bright`"),
            (format!("{head}1 2 -0.1\n"), "t.dat:5: -0.1 is negative"),
            (format!("{head}1 2 inf\n"), "t.dat:5: `inf` is not finite"),
            (format!("{head}181 2 1\n"), "t.dat:5: theta: 181"),
            (format!("{head}1 1e9 1\n"), "t.dat:5: phi"),
        ] {
            let message = read(text.as_bytes(), "t.dat").unwrap_err().to_string();
            assert!(message.starts_with(start), "{text}: {message}");
        }
        let m = measured(&[Band::nm(450.0), Band::nm(650.0)]);
        assert_eq!(write(&m, 1).unwrap().len(), 6);
        assert!(write(&m, 2).is_err());
        assert!(write(&Measurement { scale: Scale::RelativePerSeries, ..m.clone() }, 0).is_err());
        assert!(write(&Measurement::default(), 0).is_err());
        assert!(write(&Measurement { series: vec!["a".into(), "b".into()], ..m }, 0).is_err());
    }

    #[test]
    fn damaged_files_are_errors() {
        let files = write(&measured(&[Band::named("CIE-Y")]), 0).unwrap();
        damage(files[1].1.as_bytes(), 300, |bytes| read(bytes, "t.dat"));
    }
}

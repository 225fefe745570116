//! Tabulated spectra: text to columns, and linear interpolation.
//!
//! Model: a table gives values at increasing wavelengths; in between they are linear, beyond the ends the
//! end values hold. Its range is free: tissue data reach 400-2500 nm, pictures use 380-780 nm.
//!
//! Text: one row per wavelength, wavelength (nm) first, then one or more values; separated by commas,
//! semicolons, tabs or spaces. Lines that start with `#` and blank lines are skipped. The first other line
//! may name the columns. Guarded by `reads_what_laboratories_write`, `rejects_with_the_line`.

use super::spectra::Spectrum;
use crate::{Error, Result};

/// Columns over wavelength, as read from text.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    at: String,
    names: Vec<String>,
    wavelengths_nm: Vec<f64>,
    columns: Vec<Vec<f64>>,
}

impl Table {
    /// The wavelengths, nm, strictly increasing.
    pub fn wavelengths_nm(&self) -> &[f64] {
        &self.wavelengths_nm
    }

    /// Names of the value columns: of the header, or `1`, `2` ... without one.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Values of a column.
    pub fn column(&self, name: &str) -> Result<&[f64]> {
        match self.names.iter().position(|n| n == name) {
            Some(i) => Ok(&self.columns[i]),
            None => Err(Error::invalid(
                &self.at,
                format!("has no column `{name}`; its columns are {}", self.names.join(", ")),
            )),
        }
    }

    /// `(wavelength_nm, value)` of a column; the only one where `name` is `None`.
    pub fn points(&self, name: Option<&str>) -> Result<Vec<(f64, f64)>> {
        let values = match name {
            Some(name) => self.column(name)?,
            None if self.columns.len() == 1 => &self.columns[0],
            None => {
                return Err(Error::invalid(
                    &self.at,
                    format!("has several columns, choose one of {}", self.names.join(", ")),
                ));
            }
        };
        Ok(self.wavelengths_nm.iter().copied().zip(values.iter().copied()).collect())
    }

    /// A column over the visible range.
    pub fn spectrum(&self, name: Option<&str>) -> Result<Spectrum> {
        Spectrum::from_table(&self.points(name)?, &self.at)
    }
}

/// Reads a table; `at` names the text in errors (`file:line`).
pub fn parse(text: &str, at: &str) -> Result<Table> {
    let mut names: Option<Vec<String>> = None;
    let mut wavelengths_nm: Vec<f64> = Vec::new();
    let mut columns: Vec<Vec<f64>> = Vec::new();
    for (i, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let fail = |what: String| Err(Error::invalid(format!("{at}:{}", i + 1), what));
        let fields = split(line);
        if fields.len() < 2 {
            return fail("expected a wavelength in nm and at least one value".into());
        }
        if wavelengths_nm.is_empty() && names.is_none() && fields[0].parse::<f64>().is_err() {
            let header: Vec<String> = fields[1..].iter().map(|f| f.trim_matches('"').to_string()).collect();
            if let Some(name) =
                header.iter().enumerate().find_map(|(k, n)| header[..k].contains(n).then_some(n))
            {
                return fail(format!("two columns are called `{name}`"));
            }
            columns = vec![Vec::new(); header.len()];
            names = Some(header);
            continue;
        }
        if columns.is_empty() {
            columns = vec![Vec::new(); fields.len() - 1];
        }
        if fields.len() != columns.len() + 1 {
            return fail(format!("{} fields, expected {}", fields.len(), columns.len() + 1));
        }
        let mut row = Vec::with_capacity(fields.len());
        for field in &fields {
            match field.parse::<f64>() {
                Ok(v) if v.is_finite() => row.push(v),
                _ => return fail(format!("`{field}` is not a finite number")),
            }
        }
        if row[0] <= 0.0 {
            return fail(format!("wavelength {} nm is not positive", row[0]));
        }
        if let Some(&last) = wavelengths_nm.last()
            && row[0] <= last
        {
            return fail(format!("wavelength {} nm after {last} nm: they must increase", row[0]));
        }
        wavelengths_nm.push(row[0]);
        for (column, v) in columns.iter_mut().zip(&row[1..]) {
            column.push(*v);
        }
    }
    if wavelengths_nm.is_empty() {
        return Err(Error::invalid(at, "has no row of numbers: expected `wavelength_nm, value` rows"));
    }
    let names = names.unwrap_or_else(|| (1..=columns.len()).map(|i| i.to_string()).collect());
    Ok(Table { at: at.into(), names, wavelengths_nm, columns })
}

/// Fields of a line: at commas, else at semicolons, else at blanks.
fn split(line: &str) -> Vec<&str> {
    for separator in [',', ';'] {
        if line.contains(separator) {
            return line.split(separator).map(str::trim).collect();
        }
    }
    line.split_whitespace().collect()
}

/// Linear interpolation in `(x, y)` points with increasing x, the end values outside.
///
/// `points` must not be empty.
pub(super) fn interpolate(points: &[(f64, f64)], x: f64) -> f64 {
    let k = points.partition_point(|p| p.0 <= x);
    if k == 0 {
        return points[0].1;
    }
    if k == points.len() {
        return points[k - 1].1;
    }
    let ((x0, y0), (x1, y1)) = (points[k - 1], points[k]);
    y0 + (y1 - y0) * (x - x0) / (x1 - x0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_what_laboratories_write() {
        let comma = "\u{feff}# a rose\r\nwavelength_nm, R, T\r\n400, 0.1, 0.2\r\n\r\n500, 0.3, 0.1\r\n";
        let table = parse(comma, "rose.csv").unwrap();
        assert_eq!(table.names(), ["R", "T"]);
        assert_eq!(table.wavelengths_nm(), [400.0, 500.0]);
        assert_eq!(table.column("T").unwrap(), [0.2, 0.1]);
        assert!((table.spectrum(Some("R")).unwrap().at(450.0) - 0.2).abs() < 1e-6);
        for text in ["400\t0.5\n2500\t0.6", "400;0.5\n2500;0.6", "400  5e-1\n2500 0.6"] {
            let table = parse(text, "t").unwrap();
            assert_eq!(table.names(), ["1"]);
            assert_eq!(table.points(None).unwrap(), [(400.0, 0.5), (2500.0, 0.6)]);
        }
    }

    #[test]
    fn rejects_with_the_line() {
        for (text, line, why) in [
            ("400,0.1\n500,NaN", "t:2", "finite"),
            ("400,0.1\n500,inf", "t:2", "finite"),
            ("400,0.1\n500,", "t:2", "finite"),
            ("# c\n400,0.1\n500,red", "t:3", "finite"),
            ("400,0.1\n300,0.1", "t:2", "increase"),
            ("400,0.1\n400,0.2", "t:2", "increase"),
            ("-400,0.1", "t:1", "positive"),
            ("0,0.1", "t:1", "positive"),
            ("400,0.1\n500,0.1,0.2", "t:2", "3 fields"),
            ("400", "t:1", "at least one"),
            ("nm,a,a\n400,1,2", "t:1", "two columns"),
            ("", "t", "no row"),
            ("# only a comment\n", "t", "no row"),
            ("wavelength_nm,R\n", "t", "no row"),
        ] {
            let message = parse(text, "t").unwrap_err().to_string();
            assert!(
                message.starts_with(&format!("{line}: ")) && message.contains(why),
                "{text:?}: {message}"
            );
        }
        let two = parse("nm,a,b\n400,1,2", "t").unwrap();
        assert!(two.column("c").unwrap_err().to_string().contains("a, b"));
        assert!(two.points(None).unwrap_err().to_string().contains("choose"));
    }

    #[test]
    fn interpolates_and_holds_the_ends() {
        let points = [(400.0, 1.0), (500.0, 3.0), (510.0, 0.0)];
        for (x, y) in [(300.0, 1.0), (400.0, 1.0), (450.0, 2.0), (500.0, 3.0), (505.0, 1.5), (900.0, 0.0)] {
            assert_eq!(interpolate(&points, x), y);
        }
    }
}

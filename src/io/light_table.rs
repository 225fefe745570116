//! The light of organs, petals, shapes, triangles or elements as a table, and its CSV.
//!
//! Lines that begin with `#` tell what was computed and in which units. One row per group of surface, side and band:
//!
//! | column | what |
//! |---|---|
//! | `shape`, `organ`, `organ_id`, `petal_id` | key in the scene file, kind of organ, numbers from 1 (0: none) |
//! | `triangle` or `element` | number within the shape, or of the solution; only where rows are those |
//! | `area_mm2`, `x_mm`, `y_mm`, `z_mm` | area of one side, its centre |
//! | `side`, `band_low_nm`, `band_high_nm` | the side that the light arrives on |
//! | `incident_w_m2`, `absorbed_w_m2`, `transmitted_w_m2` | light that arrives on this side; what of it is absorbed, and let through |
//! | `.._umol_m2_s` | the same in photons |
//! | `absorbed_w` | absorbed power of the whole group, W |

use std::fmt::Write as _;
use std::sync::Arc;

use super::invalid;
use crate::Result;
use crate::spectrum::Band;

const FORMAT: &str = "light table";

/// Names of the sides, in the order of [`crate::geometry::Side`].
pub const SIDES: [&str; 2] = ["adaxial", "abaxial"];

/// A piece of surface that a row is about.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Dotted key of its shape or light in the scene.
    pub shape: Arc<str>,
    /// Kind of organ, empty where it is none or several.
    pub organ: &'static str,
    /// Organ, from 1; 0 for none or several.
    pub organ_id: u32,
    /// Petal, from 1; 0 for none or several.
    pub petal_id: u32,
    /// Number of the triangle or element.
    pub index: u32,
    /// Area of one side.
    pub area_mm2: f64,
    /// Centre of the area.
    pub centre_mm: [f64; 3],
}

/// Light on one side in one band: W m-2 and umol m-2 s-1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Flux {
    /// Irradiance.
    pub incident: [f64; 2],
    /// What of it is absorbed.
    pub absorbed: [f64; 2],
    /// What of it leaves from the other side.
    pub transmitted: [f64; 2],
}

/// Light by group, side and band.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightTable {
    /// What was computed: lines of the header.
    pub about: Vec<String>,
    /// What the numbers of the groups count (`triangle`, `element`), if anything.
    pub index_name: Option<&'static str>,
    /// The bands.
    pub bands: Vec<Band>,
    /// The pieces of surface.
    pub groups: Vec<Group>,
    /// Light: for each group, for each side, the bands.
    pub light: Vec<Flux>,
}

impl LightTable {
    /// Light of a group on a side in a band.
    pub fn at(&self, group: usize, side: usize, band: usize) -> &Flux {
        &self.light[(group * 2 + side) * self.bands.len() + band]
    }

    /// Fails where the parts do not fit together.
    pub(super) fn check(&self) -> Result<()> {
        if self.groups.is_empty() || self.bands.is_empty() {
            return Err(invalid(FORMAT, "there is nothing to write"));
        }
        if self.light.len() != self.groups.len() * 2 * self.bands.len() {
            return Err(invalid(FORMAT, "the values do not fit the groups, sides and bands"));
        }
        Ok(())
    }
}

/// A number with the digits of f32, which is more than the light is known to.
pub(super) fn digits(value: f64) -> String {
    format!("{:?}", value as f32)
}

/// Writes the table as CSV.
pub fn csv(table: &LightTable) -> Result<String> {
    table.check()?;
    let mut out = String::new();
    for line in &table.about {
        // Writing to a String cannot fail.
        let _ = writeln!(out, "# {}", line.replace(['\n', '\r'], " "));
    }
    let mut rows = csv::Writer::from_writer(Vec::new());
    let fail = |e: csv::Error| invalid(FORMAT, e);
    let mut names = vec!["shape", "organ", "organ_id", "petal_id"];
    names.extend(table.index_name);
    names.extend(["area_mm2", "x_mm", "y_mm", "z_mm", "side", "band_low_nm", "band_high_nm"]);
    names.extend(["incident_w_m2", "absorbed_w_m2", "transmitted_w_m2"]);
    names.extend(["incident_umol_m2_s", "absorbed_umol_m2_s", "transmitted_umol_m2_s", "absorbed_w"]);
    rows.write_record(&names).map_err(fail)?;
    for (k, g) in table.groups.iter().enumerate() {
        for (s, side) in SIDES.into_iter().enumerate() {
            for (b, band) in table.bands.iter().enumerate() {
                let f = table.at(k, s, b);
                let mut row = vec![
                    g.shape.to_string(),
                    g.organ.to_owned(),
                    g.organ_id.to_string(),
                    g.petal_id.to_string(),
                ];
                row.extend(table.index_name.map(|_| g.index.to_string()));
                row.push(digits(g.area_mm2));
                row.extend(g.centre_mm.map(digits));
                row.extend([side.to_owned(), band.low_nm.to_string(), band.high_nm.to_string()]);
                row.extend((0..2).flat_map(|u| [f.incident[u], f.absorbed[u], f.transmitted[u]].map(digits)));
                row.push(digits(f.absorbed[0] * g.area_mm2 * 1e-6));
                rows.write_record(&row).map_err(fail)?;
            }
        }
    }
    let rows = rows.into_inner().map_err(|e| invalid(FORMAT, e))?;
    out.push_str(&String::from_utf8_lossy(&rows));
    Ok(out)
}

/// A table of two groups.
#[cfg(test)]
pub(super) fn example() -> LightTable {
    let group = |shape: &str, organ, k: u32| Group {
        shape: shape.into(),
        organ,
        organ_id: k,
        petal_id: k,
        index: 10 + k,
        area_mm2: 200.0,
        centre_mm: [1.0, -2.5, 0.0],
    };
    let bands = vec![Band::PAR, Band { low_nm: 400.0, high_nm: 500.0 }];
    let light = (0..8).map(f64::from);
    let flux =
        |v: f64| Flux { incident: [v, 4.0 * v], absorbed: [0.5 * v, 2.0 * v], transmitted: [0.25 * v, v] };
    LightTable {
        about: vec!["two groups".into(), "no\nbreak".into()],
        index_name: Some("triangle"),
        bands,
        groups: vec![group("shapes.rose", "petal", 1), group("shapes.\"a,b\"", "", 0)],
        light: light.map(flux).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_groups_sides_and_bands() {
        let table = example();
        let text = csv(&table).unwrap();
        assert!(text.starts_with("# two groups\n# no break\nshape,organ,"), "{text}");
        let mut read = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes());
        let header = read.headers().unwrap().clone();
        let rows: Vec<csv::StringRecord> = read.records().map(Result::unwrap).collect();
        assert_eq!(rows.len(), 8);
        let at =
            |row: usize, name: &str| rows[row][header.iter().position(|h| h == name).unwrap()].to_owned();
        assert_eq!((at(3, "side"), at(3, "band_high_nm")), ("abaxial".into(), "500".into()));
        assert_eq!((at(4, "shape"), at(4, "triangle")), ("shapes.\"a,b\"".into(), "10".into()));
        assert_eq!((at(3, "incident_w_m2"), at(3, "absorbed_umol_m2_s")), ("3.0".into(), "6.0".into()));
        // 1.5 W/m2 on 200 mm2.
        assert_eq!(at(3, "absorbed_w").parse::<f32>().unwrap(), 3e-4);
        let mut wrong = example();
        wrong.light.pop();
        assert!(csv(&wrong).is_err() && csv(&LightTable::default()).is_err());
    }
}

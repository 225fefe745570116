//! Goniometer tables as CSV with a self-describing header.
//!
//! Lines that begin with `#` come first; without that mark they are a TOML document: the conventions as
//! comments, then the settings, the totals of every incidence, and the description of the sample. The rows
//! have the columns of [`COLUMNS`], one row per incidence, band and bin of the exitant grid. The dense scan
//! of the plane of incidence is not part of the file.
//!
//! Numbers are written with as many digits as it takes to read them back unchanged (`round_trip`). A file
//! that is cut, doubled or edited out of shape is an error with its line (`malformed_files_name_the_line`).

use std::fmt::Write as _;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::geometry::Side;
use crate::gonio::{
    Estimate, ExitantGrid, GonioTable, Goniophotometer, Incidence, Ledger, PlaneScan, Totals,
};
use crate::{Error, Result};

/// Names of the columns, in their order.
pub const COLUMNS: &str = "incident_theta_deg,incident_phi_deg,theta_deg,phi_deg,solid_angle_sr,wavelength_nm,\
                           bsdf_per_sr,standard_error";

const FORMAT: u32 = 1;

const CONVENTIONS: &str = "\
# Rosarium goniometer table.
# Quantity: BSDF in 1/sr, without the cosine, averaged over each bin; standard_error is one sigma, 1/sr.
# Angles: degrees from the normal of the lit side; theta_deg above 90 is transmission.
# Azimuth: phi_deg 0 is the lamp's side (retro-reflection), 180 the mirror's side; bins are given by their centre.
# Totals: [value, standard error] as shares of the light that arrives; ledger is [in, reflected, transmitted,
# absorbed] in paths, cut_off the paths that were given up (0 where it is missing); totals without wavelength_nm are means over the bands.
";

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    format: u32,
    version: String,
    sample: String,
    side: Side,
    rays: u64,
    /// As text: TOML integers end at 2^63 - 1.
    seed: String,
    incident_deg: Vec<f64>,
    bands_nm: Vec<f64>,
    #[serde(default)]
    description: String,
    grid: ExitantGrid,
    scan: PlaneScan,
    totals: Vec<TotalsRow>,
}

#[derive(Serialize, Deserialize)]
struct TotalsRow {
    incident_deg: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    wavelength_nm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ledger: Option<[f64; 4]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    cut_off: Option<f64>,
    #[serde(flatten)]
    totals: Totals,
}

/// Writes a table.
pub fn write(table: &GonioTable) -> Result<String> {
    let totals = table.incidences.iter().flat_map(|i| {
        let row = |wavelength_nm, ledger: Option<&Ledger>, totals: &Totals| TotalsRow {
            incident_deg: i.incident_deg,
            wavelength_nm,
            ledger: ledger.map(|l| [l.incoming, l.reflected, l.transmitted, l.absorbed]),
            cut_off: ledger.map(|l| l.cut_off).filter(|c| *c != 0.0),
            totals: *totals,
        };
        let bands = table.bands_nm.iter().zip(&i.bands).zip(&i.ledgers);
        std::iter::once(row(None, None, &i.mean))
            .chain(bands.map(move |((&nm, t), l)| row(Some(nm), Some(l), t)))
    });
    let header = Header {
        format: FORMAT,
        version: table.version.clone(),
        sample: table.sample.clone(),
        side: table.side,
        rays: table.rays,
        seed: table.seed.to_string(),
        incident_deg: table.incidences.iter().map(|i| i.incident_deg).collect(),
        bands_nm: table.bands_nm.clone(),
        description: table.description.clone(),
        grid: table.grid,
        scan: table.scan,
        totals: totals.collect(),
    };
    let header = toml::to_string(&header)
        .map_err(|e| Error::Unsupported(format!("a goniometer table with this header: {e}")))?;

    let mut out = String::new();
    for line in CONVENTIONS.split_inclusive('\n').chain(header.split_inclusive('\n')) {
        out.push('#');
        if !line.starts_with(['#', '\n']) {
            out.push(' ');
        }
        out.push_str(line);
    }
    out.push_str(COLUMNS);
    out.push('\n');
    for incidence in &table.incidences {
        for (band, nm) in table.bands_nm.iter().enumerate() {
            for bin in 0..table.grid.len() {
                let (theta, phi) = table.grid.centre_deg(bin);
                let e = &incidence.bsdf[band * table.grid.len() + bin];
                // Writing to a String cannot fail.
                let _ = writeln!(
                    out,
                    "{:?},0.0,{theta:?},{phi:?},{:?},{nm:?},{:?},{:?}",
                    incidence.incident_deg,
                    table.grid.solid_angle_sr(bin),
                    e.value,
                    e.standard_error
                );
            }
        }
    }
    Ok(out)
}

/// Reads a table; `name` (the file's) stands in errors as `name:line`.
pub fn read(bytes: &[u8], name: &str) -> Result<GonioTable> {
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let line = bytes[..e.valid_up_to()].iter().filter(|&&b| b == b'\n').count() + 1;
        Error::invalid(format!("{name}:{line}"), "not UTF-8 text")
    })?;
    let fail = |line: usize, what: String| Error::invalid(format!("{name}:{line}"), what);
    let header_lines = text.lines().take_while(|l| l.starts_with('#')).count();
    if header_lines == 0 {
        return Err(fail(1, "not a goniometer table: those begin with '#' lines".into()));
    }
    let header = read_header(text, header_lines, name)?;
    let gonio = instrument(&header).map_err(|e| fail(header_lines, format!("header: {e}")))?;

    let mut lines = text.lines().enumerate().skip(header_lines).map(|(i, l)| (i + 1, l.trim()));
    match lines.next() {
        Some((_, columns)) if columns == COLUMNS => {}
        Some((line, columns)) => {
            return Err(fail(line, format!("columns are `{columns}`, expected `{COLUMNS}`")));
        }
        None => return Err(fail(header_lines, "the file ends after its header".into())),
    }
    let rows: Vec<(usize, &str)> = lines.filter(|(_, l)| !l.is_empty()).collect();
    let (incidences, bands, bins) = (header.incident_deg.len(), header.bands_nm.len(), header.grid.len());
    let expected = incidences * bands * bins;
    if rows.len() != expected {
        let last = rows.last().map_or(header_lines + 1, |r| r.0);
        let what = format!(
            "{} rows, expected {expected} ({incidences} incidences x {bands} bands x {bins} bins)",
            rows.len()
        );
        return Err(fail(last, what));
    }
    let mut bsdf: Vec<Option<Estimate>> = vec![None; expected];
    for (line, row) in rows {
        let (index, estimate) = read_row(row, &header).map_err(|what| fail(line, what))?;
        if bsdf[index].replace(estimate).is_some() {
            return Err(fail(line, "this bin has a row already".into()));
        }
    }
    // As many rows as bins and none twice: every bin has its row.
    let bsdf: Vec<Estimate> = bsdf.into_iter().flatten().collect();

    let incidences = header
        .incident_deg
        .iter()
        .zip(bsdf.chunks(bands * bins))
        .map(|(&incident_deg, bsdf)| incidence(&header, incident_deg, bsdf))
        .collect::<Result<Vec<_>, String>>()
        .map_err(|what| fail(header_lines, what))?;
    Ok(GonioTable {
        sample: header.sample,
        description: header.description,
        version: header.version,
        side: gonio.side,
        rays: gonio.rays,
        seed: gonio.seed,
        bands_nm: gonio.bands_nm,
        grid: gonio.exitant,
        scan: gonio.scan,
        incidences,
    })
}

fn read_header(text: &str, header_lines: usize, name: &str) -> Result<Header> {
    let mut document = String::new();
    for line in text.lines().take(header_lines) {
        document.push_str(line.strip_prefix("# ").or_else(|| line.strip_prefix('#')).unwrap_or(line));
        document.push('\n');
    }
    let header: Header = toml::from_str(&document).map_err(|e| {
        let Range { start, .. } = e.span().unwrap_or(0..0);
        let line = document.bytes().take(start).filter(|&b| b == b'\n').count() + 1;
        Error::invalid(format!("{name}:{line}"), e.message())
    })?;
    if header.format != FORMAT {
        let what = format!("goniometer table format {}; this version reads {FORMAT}", header.format);
        return Err(Error::Unsupported(what));
    }
    Ok(header)
}

/// The instrument that the header describes, with its own checks of every setting.
fn instrument(header: &Header) -> Result<Goniophotometer> {
    let seed = header
        .seed
        .parse()
        .map_err(|_| Error::invalid("seed", format!("`{}` is not a whole number below 2^64", header.seed)))?;
    let gonio = Goniophotometer {
        incident_deg: header.incident_deg.clone(),
        side: header.side,
        rays: header.rays,
        seed,
        bands_nm: header.bands_nm.clone(),
        exitant: header.grid,
        scan: header.scan,
        // Of the measurement, not of the table: the sample's name says it.
        spin: false,
    };
    gonio.validate()?;
    Ok(gonio)
}

/// Index of a row's bin, and its value.
fn read_row(row: &str, header: &Header) -> Result<(usize, Estimate), String> {
    let mut values = [0.0; 8];
    let mut fields = row.split(',');
    for (value, name) in values.iter_mut().zip(COLUMNS.split(',')) {
        let field = fields.next().ok_or(format!("{name} is missing"))?.trim();
        *value = field.parse::<f64>().map_err(|_| format!("{name}: `{field}` is not a number"))?;
        if !value.is_finite() {
            return Err(format!("{name}: `{field}` is not finite"));
        }
    }
    if fields.next().is_some() {
        return Err("more than 8 columns".into());
    }
    let [incident, incident_phi, theta, phi, solid_angle, nm, value, standard_error] = values;
    if incident_phi != 0.0 {
        return Err(format!("incident_phi_deg: {incident_phi}; the lamp stands at azimuth 0"));
    }
    let position = |list: &[f64], v: f64| list.iter().position(|x| (x - v).abs() < 1e-6);
    let i = position(&header.incident_deg, incident)
        .ok_or(format!("incident_theta_deg: {incident} is not in the header"))?;
    let band = position(&header.bands_nm, nm).ok_or(format!("wavelength_nm: {nm} is not in the header"))?;
    let grid = &header.grid;
    let (r, c) = (theta / grid.theta_step_deg - 0.5, phi / grid.phi_step_deg);
    let off_centre = (r - r.round()).abs() > 1e-6 || (c - c.round()).abs() > 1e-6;
    let inside =
        (0.0..grid.thetas() as f64).contains(&r.round()) && (0.0..grid.phis() as f64).contains(&c.round());
    if off_centre || !inside {
        return Err(format!("theta_deg, phi_deg: ({theta}, {phi}) is not a bin's centre"));
    }
    let bin = r.round() as usize * grid.phis() + c.round() as usize;
    if (solid_angle / grid.solid_angle_sr(bin) - 1.0).abs() > 1e-4 {
        return Err(format!("solid_angle_sr: {solid_angle}, expected {}", grid.solid_angle_sr(bin)));
    }
    if value < 0.0 || standard_error < 0.0 {
        return Err("bsdf_per_sr and standard_error are not negative".into());
    }
    Ok(((i * header.bands_nm.len() + band) * grid.len() + bin, Estimate { value, standard_error }))
}

fn incidence(header: &Header, incident_deg: f64, bsdf: &[Estimate]) -> Result<Incidence, String> {
    let find = |nm: Option<f64>| {
        header.totals.iter().find(|t| t.incident_deg == incident_deg && t.wavelength_nm == nm).ok_or_else(
            || {
                format!(
                    "header: no totals for {incident_deg} deg, {}",
                    nm.map_or("mean".into(), |nm| format!("{nm} nm"))
                )
            },
        )
    };
    let rows = header.bands_nm.iter().map(|&nm| find(Some(nm))).collect::<Result<Vec<_>, _>>()?;
    let ledgers = rows.iter().map(|r| {
        let [incoming, reflected, transmitted, absorbed] =
            r.ledger.ok_or(format!("header: totals for {incident_deg} deg without a ledger"))?;
        let cut_off = r.cut_off.unwrap_or(0.0);
        if !(0.0..=incoming).contains(&cut_off) {
            return Err(format!("header: {cut_off} of {incoming} paths cut off"));
        }
        Ok(Ledger { incoming, reflected, transmitted, absorbed, cut_off })
    });
    let mean = find(None)?;
    let numbers = rows.iter().chain([&mean]).flat_map(|r| {
        let t = &r.totals;
        [t.reflectance, t.transmittance, t.absorptance, t.retro_brdf, t.mirror_brdf]
            .into_iter()
            .chain(t.retro_index)
            .flat_map(<[f64; 2]>::from)
            .chain(r.ledger.into_iter().flatten())
    });
    if numbers.into_iter().any(|v| !v.is_finite()) {
        return Err(format!("header: totals for {incident_deg} deg are not finite"));
    }
    Ok(Incidence {
        incident_deg,
        mean: mean.totals,
        ledgers: ledgers.collect::<Result<_, String>>()?,
        bands: rows.iter().map(|r| r.totals).collect(),
        bsdf: bsdf.to_vec(),
        scan: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::bsdf::DiffuseTransmission;
    use crate::io::damage::damage;

    fn table() -> GonioTable {
        let gonio = Goniophotometer {
            incident_deg: vec![0.0, 33.3],
            side: Side::Abaxial,
            rays: 20_000,
            seed: u64::MAX,
            bands_nm: vec![450.0, 611.5],
            exitant: ExitantGrid { theta_step_deg: 15.0, phi_step_deg: 30.0 },
            ..Default::default()
        };
        let sheet = DiffuseTransmission::new(0.3.into(), 0.2.into(), 0.1.into()).unwrap();
        gonio
            .measure(&sheet, &|_, _| ControlFlow::Continue(()))
            .unwrap()
            .described("a \"sheet\"\nof two lines", "# comment\n[cells]\npitch_um = 23.0\n\nname = '''x'''\n")
    }

    #[test]
    fn round_trip() {
        let mut table = table();
        assert!(!write(&table).unwrap().contains("cut_off ="));
        table.incidences[1].ledgers.iter_mut().for_each(|l| l.cut_off = 3.0);
        let text = write(&table).unwrap();
        let back = read(text.as_bytes(), "t.csv").unwrap();
        table.incidences.iter_mut().for_each(|i| i.scan.clear());
        assert_eq!(back, table);
        assert_eq!(read(text.replace('\n', "\r\n").as_bytes(), "t.csv").unwrap(), table);
        // Without a scan the plane comes from the grid, and its two azimuths.
        let plane = back.in_plane(&back.incidences[1], 0);
        assert_eq!(plane.len(), 24);
        assert_eq!((plane[0].0, plane[23].0), (-172.5, 172.5));
        // A program that knows nothing of the header finds columns and rows.
        let rows: Vec<&str> = text.lines().filter(|l| !l.starts_with('#')).collect();
        assert_eq!(rows[0], COLUMNS);
        assert_eq!(rows.len(), 1 + 2 * 2 * 12 * 12);
        assert!(rows.iter().all(|r| r.split(',').count() == 8));
    }

    #[test]
    fn malformed_files_name_the_line() {
        let text = write(&table()).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        let columns = lines.iter().position(|l| *l == COLUMNS).unwrap();
        let edit = |line: usize, new: &str| {
            let mut lines = lines.clone();
            lines[line] = new;
            lines.join("\n")
        };
        let find = |part: &str| lines.iter().position(|l| l.contains(part)).unwrap();
        let row = columns + 3;
        let fields: Vec<&str> = lines[row].split(',').collect();
        let with = |column: usize, value: &str| {
            let mut fields = fields.clone();
            fields[column] = value;
            edit(row, &fields.join(","))
        };
        let (rays, side) = (find("# rays = "), find("# side = "));
        let cases = [
            (String::new(), 1, "goniometer"),
            ("theta,phi\n1,2\n".into(), 1, "goniometer"),
            (edit(rays, "# rays = many"), rays + 1, ""),
            (edit(side, "# side = \"upper\""), side + 1, ""),
            (edit(side, "# colour = 1"), side + 1, "colour"),
            (edit(rays, "# rays = 1"), columns, "rays"),
            (edit(columns, "theta,phi"), columns + 1, "columns"),
            (lines[..columns].join("\n"), columns, "ends"),
            (lines[..row].join("\n"), row, "rows"),
            (edit(row, lines[row + 1]), row + 2, "already"),
            (edit(row, "1,2,3"), row + 1, "phi_deg is missing"),
            (format!("{text}{}\n", lines[row]), lines.len() + 1, "rows"),
            (edit(row, &format!("{},1", lines[row])), row + 1, "columns"),
            (with(0, "12"), row + 1, "incident_theta_deg"),
            (with(1, "90"), row + 1, "incident_phi_deg"),
            (with(2, "8"), row + 1, "centre"),
            (with(2, "1e300"), row + 1, "centre"),
            (with(3, "-30"), row + 1, "centre"),
            (with(4, "1"), row + 1, "solid_angle_sr"),
            (with(5, "550"), row + 1, "wavelength_nm"),
            (with(6, "bright"), row + 1, "bright"),
            (with(6, "NaN"), row + 1, "finite"),
            (with(6, "-0.1"), row + 1, "negative"),
        ];
        for (text, line, part) in cases {
            let message = read(text.as_bytes(), "t.csv").unwrap_err().to_string();
            assert!(message.starts_with(&format!("t.csv:{line}: ")), "line {line}: {message}");
            assert!(message.contains(part), "{part}: {message}");
        }
        let huge = edit(find("# theta_step_deg"), "# theta_step_deg = 0.0025");
        assert!(read(huge.as_bytes(), "t.csv").is_err());
        let future = edit(find("# format"), "# format = 2");
        assert!(matches!(read(future.as_bytes(), "t.csv"), Err(Error::Unsupported(_))));
    }
    #[test]
    fn damaged_files_are_errors() {
        damage(write(&table()).unwrap().as_bytes(), 300, |bytes| read(bytes, "t.csv"));
    }
}

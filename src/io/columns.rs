//! Which column of a table is what: given by the user, or known by its name.

use crate::{Error, Result};

/// What a column can be: keys of [`ColumnMap::parse`], and the names by which it is known without a map (without a
/// unit at their end).
const KNOWN: [(&str, &[&str]); 10] = [
    (
        "incident_theta",
        &[
            "incident_theta",
            "theta_i",
            "thetai",
            "theta_in",
            "intheta",
            "source_zenith",
            "sza",
            "angle_of_incidence",
            "aoi",
        ],
    ),
    ("incident_phi", &["incident_phi", "phi_i", "phii", "phi_in", "inphi", "source_azimuth", "saa"]),
    (
        "theta",
        &[
            "theta",
            "theta_o",
            "theta_r",
            "theta_s",
            "theta_v",
            "theta_out",
            "view_zenith",
            "vza",
            "scatter_theta",
        ],
    ),
    ("phi", &["phi", "phi_o", "phi_r", "phi_s", "phi_v", "phi_out", "view_azimuth", "vaa", "scatter_phi"]),
    (
        "value",
        &[
            "bsdf_per_sr",
            "bsdf",
            "brdf",
            "btdf",
            "brf",
            "dsf",
            "value",
            "intensity",
            "relative",
            "relative_dsf",
        ],
    ),
    (
        "sigma",
        &["sigma", "sigma_per_sr", "standard_error", "standard_deviation", "std", "stdev", "uncertainty"],
    ),
    ("series", &["series"]),
    ("wavelength", &["wavelength", "wavelength_nm", "lambda_nm", "nm"]),
    ("band", &["band", "channel"]),
    ("side", &["side", "lit_side"]),
];

/// Columns by name. What is not given is known by its name, or has a default: azimuths 0, one series, one band, the
/// adaxial side. A number instead of a name is the same for all rows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ColumnMap {
    /// Lamp's angle from the normal of the lit side.
    pub incident_theta: Option<String>,
    /// Lamp's azimuth.
    pub incident_phi: Option<String>,
    /// Detector's polar angle.
    pub theta: Option<String>,
    /// Detector's azimuth.
    pub phi: Option<String>,
    /// Values; one column per band. A name may end with `*`: all columns that begin so.
    pub value: Vec<String>,
    /// Standard deviations in the unit of the values: none, one, or one per value.
    pub sigma: Option<Vec<String>>,
    /// Names of samples or settings.
    pub series: Option<String>,
    /// Wavelength of the row, nm (long form: one row per band).
    pub wavelength: Option<String>,
    /// Name of the row's band (long form).
    pub band: Option<String>,
    /// Lit side of the row: `adaxial` or `abaxial`.
    pub side: Option<String>,
}

impl ColumnMap {
    /// From `incident_theta=source_zenith_deg,theta=view_zenith_deg,value=BRF_450nm,value=BRF_550nm`. An empty name
    /// (`sigma=`) means that there is no such column, whatever the names suggest.
    pub fn parse(text: &str) -> Result<Self> {
        let wrong = |what: String| Error::invalid("columns", what);
        let keys = || KNOWN.map(|k| k.0).join(", ");
        let mut map = Self::default();
        for pair in text.split(',').map(str::trim).filter(|p| !p.is_empty()) {
            let (key, name) = pair
                .split_once('=')
                .ok_or_else(|| wrong(format!("`{pair}` is not `key=column`; keys are {}", keys())))?;
            let name = name.trim().to_string();
            let twice = || wrong(format!("`{key}` is given twice"));
            let slot = match key.trim() {
                "incident_theta" => &mut map.incident_theta,
                "incident_phi" => &mut map.incident_phi,
                "theta" => &mut map.theta,
                "phi" => &mut map.phi,
                "series" => &mut map.series,
                "wavelength" => &mut map.wavelength,
                "band" => &mut map.band,
                "side" => &mut map.side,
                "value" => {
                    if !name.is_empty() {
                        map.value.push(name);
                    }
                    continue;
                }
                "sigma" => {
                    let list = map.sigma.get_or_insert_default();
                    if !name.is_empty() {
                        list.push(name);
                    }
                    continue;
                }
                _ => return Err(wrong(format!("`{key}` is not one of {}", keys()))),
            };
            if slot.replace(name).is_some() {
                return Err(twice());
            }
        }
        Ok(map)
    }
}

/// Where a number comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Source {
    Column(usize),
    Constant(f64),
}

/// A [`ColumnMap`] in one file.
#[derive(Debug, PartialEq)]
pub(super) struct Columns {
    pub(super) incident_theta: Source,
    pub(super) incident_phi: Source,
    pub(super) theta: Source,
    pub(super) phi: Source,
    pub(super) value: Vec<usize>,
    pub(super) sigma: Vec<usize>,
    pub(super) series: Option<usize>,
    pub(super) wavelength: Option<Source>,
    pub(super) band: Option<usize>,
    pub(super) side: Option<usize>,
}

impl Columns {
    /// Finds the columns among the `names` of a file.
    pub(super) fn find(map: &ColumnMap, names: &[String]) -> Result<Self, String> {
        let column = |key: &str, given: Option<&str>| -> Result<Option<usize>, String> {
            match given {
                Some("") => Ok(None),
                Some(name) => exact(names, name).map(Some).ok_or_else(|| absent(key, name, names)),
                None => Ok(guess(key, names)),
            }
        };
        let number = |key: &str, given: Option<&str>| -> Result<Option<Source>, String> {
            match given.map(|g| (exact(names, g), g.parse::<f64>())) {
                Some((None, Ok(constant))) => Ok(Some(Source::Constant(constant))),
                _ => Ok(column(key, given)?.map(Source::Column)),
            }
        };
        let required = |key: &str, given: Option<&str>| {
            number(key, given)?.ok_or_else(|| {
                format!("no column for {key}: say {key}=NAME (or a number); columns are {}", names.join(", "))
            })
        };
        let zero = Source::Constant(0.0);
        let value = values(&map.value, names)?;
        let sigma = match &map.sigma {
            Some(list) => list
                .iter()
                .map(|n| exact(names, n).ok_or_else(|| absent("sigma", n, names)))
                .collect::<Result<_, _>>()?,
            None => guess("sigma", names).into_iter().filter(|_| value.len() == 1).collect::<Vec<_>>(),
        };
        if sigma.len() > 1 && sigma.len() != value.len() {
            return Err(format!(
                "{} sigma columns for {} values: give none, one, or one per value",
                sigma.len(),
                value.len()
            ));
        }
        let columns = Self {
            incident_theta: required("incident_theta", map.incident_theta.as_deref())?,
            incident_phi: number("incident_phi", map.incident_phi.as_deref())?.unwrap_or(zero),
            theta: required("theta", map.theta.as_deref())?,
            phi: number("phi", map.phi.as_deref())?.unwrap_or(zero),
            value,
            sigma,
            series: column("series", map.series.as_deref())?,
            wavelength: number("wavelength", map.wavelength.as_deref())?,
            band: column("band", map.band.as_deref())?,
            side: column("side", map.side.as_deref())?,
        };
        if columns.value.len() > 1 && (columns.wavelength.is_some() || columns.band.is_some()) {
            return Err("several value columns and a wavelength or band of the row: one of the two".into());
        }
        Ok(columns)
    }
}

/// Columns of the values: the given ones, one that is known by its name, or all whose name has a wavelength.
fn values(given: &[String], names: &[String]) -> Result<Vec<usize>, String> {
    let mut value = Vec::new();
    for name in given {
        let before = value.len();
        if let Some(start) = name.strip_suffix('*') {
            value.extend((0..names.len()).filter(|&i| names[i].starts_with(start)));
        } else {
            value.extend(exact(names, name));
        }
        if value.len() == before {
            return Err(absent("value", name, names));
        }
    }
    if given.is_empty() {
        value = match guess("value", names) {
            Some(column) => vec![column],
            None => (0..names.len()).filter(|&i| wavelength_nm(&names[i]).is_some()).collect(),
        };
    }
    let mut seen = value.clone();
    seen.sort_unstable();
    seen.dedup();
    if seen.len() != value.len() {
        return Err("a column of values is given twice".into());
    }
    if value.is_empty() {
        return Err(format!("no column for value: say value=NAME; columns are {}", names.join(", ")));
    }
    Ok(value)
}

fn exact(names: &[String], name: &str) -> Option<usize> {
    names.iter().position(|n| n == name)
}

fn absent(key: &str, name: &str, names: &[String]) -> String {
    format!("no column `{name}` for {key}; columns are {}", names.join(", "))
}

/// The column that is known by its name; names earlier in the list of [`KNOWN`] win.
fn guess(key: &str, names: &[String]) -> Option<usize> {
    let (_, known) = KNOWN.iter().find(|k| k.0 == key)?;
    let plain: Vec<String> = names.iter().map(|n| without_unit(n)).collect();
    known.iter().find_map(|k| plain.iter().position(|n| n == k))
}

/// Lower case, without an angle's unit at the end.
fn without_unit(name: &str) -> String {
    let mut name = name.trim().to_ascii_lowercase().replace(' ', "_");
    for unit in ["_deg", "_degrees", "_rad", "_radians", "_(deg)", "_[deg]", "(deg)", "[deg]"] {
        if let Some(plain) = name.strip_suffix(unit) {
            name = plain.to_string();
            break;
        }
    }
    name
}

/// The wavelength that a column's name gives: `BRF_550nm`, `550nm`, `550.5 nm`, `R550`, `550`.
pub(super) fn wavelength_nm(name: &str) -> Option<f64> {
    let lower = name.trim().to_ascii_lowercase();
    let (body, has_unit) = match lower.strip_suffix("nm") {
        Some(body) => (body.trim_end_matches([' ', '_', '-', '[', '(']), true),
        None => (lower.as_str(), false),
    };
    let digits = body.len() - body.bytes().rev().take_while(|b| b.is_ascii_digit() || *b == b'.').count();
    let (start, number) = body.split_at(digits);
    // Without `nm` only a letter before the number: `phi_180` is no wavelength.
    let plausible = has_unit || start.is_empty() || matches!(start, "r" | "t" | "l" | "x" | "w");
    let nm: f64 = number.parse().ok()?;
    (plausible && (100.0..=100_000.0).contains(&nm)).then_some(nm)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> Vec<String> {
        text.split(',').map(String::from).collect()
    }

    #[test]
    fn names_that_laboratories_use_are_known() {
        let own = names(
            "incident_theta_deg,incident_phi_deg,theta_deg,phi_deg,wavelength_nm,bsdf_per_sr,standard_error",
        );
        let c = Columns::find(&ColumnMap::default(), &own).unwrap();
        assert_eq!((c.incident_theta, c.phi), (Source::Column(0), Source::Column(3)));
        assert_eq!((c.value.as_slice(), c.sigma.as_slice()), ([5].as_slice(), [6].as_slice()));
        assert_eq!((c.wavelength, c.series), (Some(Source::Column(4)), None));

        let leaf = names(
            "sample,source_zenith_deg,source_azimuth_deg,view_zenith_deg,view_azimuth_deg,BRF_420nm,BRF_550nm",
        );
        let c = Columns::find(&ColumnMap::default(), &leaf).unwrap();
        assert_eq!((c.incident_theta, c.incident_phi), (Source::Column(1), Source::Column(2)));
        assert_eq!(c.value, [5, 6]);
        let map = ColumnMap::parse("value=BRF_*,incident_theta=30,source=").unwrap_err();
        assert!(map.to_string().contains("`source` is not one of incident_theta"), "{map}");
        let map = ColumnMap::parse("value=BRF_*,incident_theta=30,incident_phi=").unwrap();
        let c = Columns::find(&map, &leaf).unwrap();
        assert_eq!((c.incident_theta, c.incident_phi), (Source::Constant(30.0), Source::Constant(0.0)));
        assert_eq!(c.value, [5, 6]);
    }

    #[test]
    fn wrong_maps_say_what_there_is() {
        let file = names("theta_i,theta,phi,brdf,sigma");
        for (map, part) in [
            ("value=BRDF", "columns are theta_i, theta"),
            ("value=x*", "no column `x*`"),
            ("incident_theta=lamp", "no column `lamp` for incident_theta"),
            ("value=brdf,value=phi,sigma=sigma,sigma=theta,sigma=phi", "3 sigma columns for 2"),
            ("value=brdf,value=brdf", "twice"),
            ("value=brdf,value=phi,wavelength=550", "one of the two"),
        ] {
            let e = Columns::find(&ColumnMap::parse(map).unwrap(), &file).unwrap_err();
            assert!(e.contains(part), "{map}: {e}");
        }
        assert!(Columns::find(&ColumnMap::default(), &names("a,b")).unwrap_err().contains("value"));
        for map in ["theta", "theta=a,theta=b", "=a"] {
            assert!(ColumnMap::parse(map).is_err(), "{map}");
        }
    }

    #[test]
    fn wavelengths_in_names() {
        for (name, nm) in
            [("BRF_550nm", 550.0), ("550nm", 550.0), ("550.5 nm", 550.5), ("R550", 550.0), ("450", 450.0)]
        {
            assert_eq!(wavelength_nm(name), Some(nm), "{name}");
        }
        for name in ["phi_180", "value", "R5", "nm", "", "BRF_nm", "1e9nm", "."] {
            assert_eq!(wavelength_nm(name), None, "{name}");
        }
    }
}

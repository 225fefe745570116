//! What is declared of a table of readings: by the caller, or by the file in comments of the form `# key: value`.

use super::columns::ColumnMap;
use super::conventions::{AngleReference, AngleUnit, AzimuthZero, Quantity, side};
use crate::geometry::Side;
use crate::{Error, Result};

/// What the caller declares. `None`: what the file's header says, or the default, which the notes then name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CsvOptions {
    /// Which column is what.
    pub columns: ColumnMap,
    /// What a value is; default BSDF.
    pub quantity: Option<Quantity>,
    /// Unit of all angles; default degrees.
    pub angle_unit: Option<AngleUnit>,
    /// Where the detector's azimuth is counted from; default the lamp's side.
    pub azimuth: Option<AzimuthZero>,
    /// Which direction has theta 0; default the normal.
    pub reference: Option<AngleReference>,
    /// The lit side of a file without a column for it; default adaxial.
    pub side: Option<Side>,
    /// Half the angle that the lamp fills, degrees; default 0.
    pub source_half_angle_deg: Option<f64>,
    /// Half the angle that the detector fills, degrees; default 0.
    pub detector_half_angle_deg: Option<f64>,
    /// More values that mean missing, besides empty, `NaN`, `NA`, `null`, `none`, `-` and `-9999`.
    pub missing: Vec<String>,
}

/// What the header's comments say.
#[derive(Default)]
pub(super) struct Header {
    pub(super) options: CsvOptions,
    pub(super) sample: Option<String>,
    pub(super) notes: Vec<String>,
}

/// Text of a file without a byte order mark, or the line that is not UTF-8.
pub(super) fn text<'a>(bytes: &'a [u8], name: &str) -> Result<&'a str> {
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let line = bytes[..e.valid_up_to()].iter().filter(|&&b| b == b'\n').count() + 1;
        Error::invalid(format!("{name}:{line}"), "not UTF-8 text")
    })?;
    Ok(text.strip_prefix('\u{feff}').unwrap_or(text))
}

/// Conventions that a file declares of itself. Comments that are not `key: value` with a known key are only comments.
pub(super) fn read_header(text: &str, name: &str) -> Result<Header> {
    let mut header = Header::default();
    let comments = text.lines().enumerate().take_while(|(_, l)| l.starts_with('#') || l.trim().is_empty());
    for (number, line) in comments {
        let Some((key, value)) = line.trim_start_matches('#').split_once(':') else { continue };
        let value = value.trim();
        let at = |e: Error| match e {
            Error::Invalid { at, what } => {
                Error::invalid(format!("{name}:{}", number + 1), format!("{at}: {what}"))
            }
            e => e,
        };
        let degrees = || {
            let wrong = |_| Error::invalid(key.trim(), format!("`{value}` is not a number"));
            value.parse::<f64>().map(Some).map_err(wrong).map_err(at)
        };
        let o = &mut header.options;
        match key.trim() {
            "sample" => header.sample = Some(value.into()),
            "note" => header.notes.push(value.into()),
            "quantity" => o.quantity = Some(value.parse().map_err(at)?),
            "angle_unit" => o.angle_unit = Some(value.parse().map_err(at)?),
            "azimuth" => o.azimuth = Some(value.parse().map_err(at)?),
            "reference" => o.reference = Some(value.parse().map_err(at)?),
            "side" => o.side = Some(side(value).map_err(at)?),
            "source_half_angle_deg" => o.source_half_angle_deg = degrees()?,
            "detector_half_angle_deg" => o.detector_half_angle_deg = degrees()?,
            _ => {}
        }
    }
    Ok(header)
}

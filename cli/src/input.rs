//! What users give: files, names, overrides, numbers.

use std::fs;
use std::path::Path;

use rosarium::scene::description::PetalDescription;
use rosarium::scene::{DiskAssets, Loaded, Override, load, petal};
use rosarium::{Error, Result};

/// Overrides of keys, for every command that reads a description.
#[derive(Clone, Debug, Default, clap::Args)]
pub(crate) struct Overrides {
    /// Set a key, whatever the file says: `-D lights.key.radiance=3`. Repeatable; the last one wins.
    #[arg(short = 'D', value_name = "KEY=VALUE", value_parser = parse_override)]
    pub(crate) define: Vec<Override>,
}

fn parse_override(argument: &str) -> Result<Override, String> {
    Override::parse(argument).map_err(|e| match e {
        Error::Invalid { what, .. } => what,
        other => other.to_string(),
    })
}

/// Text of a file.
pub(crate) fn read_text(path: &Path) -> Result<String> {
    let bytes = fs::read(path).map_err(|e| Error::io(path, e))?;
    String::from_utf8(bytes).map_err(|e| {
        let line = 1 + e.as_bytes()[..e.utf8_error().valid_up_to()].iter().filter(|b| **b == b'\n').count();
        Error::invalid(format!("{}:{line}", path.display()), "not a text file: this is not UTF-8")
    })
}

/// Files that a description names are relative to its own folder.
pub(crate) fn assets_beside(path: Option<&Path>) -> DiskAssets {
    DiskAssets { base: path.and_then(Path::parent).map(Path::to_owned).unwrap_or_default() }
}

/// Names of the petals that come with the program.
fn preset_names() -> String {
    petal::PRESETS.iter().map(|p| p.0).collect::<Vec<_>>().join(", ")
}

/// The end of a help text of a command that takes a petal.
pub(crate) fn with_presets(examples: &str) -> String {
    format!("Presets: {}.\n\n{examples}", preset_names())
}

/// A petal by the name of a preset or by its file.
pub(crate) struct Petal {
    /// The preset's name, or the file's without its extension.
    pub(crate) name: String,
    pub(crate) loaded: Loaded<PetalDescription>,
    pub(crate) assets: DiskAssets,
}

/// Reads the petal that an argument names.
pub(crate) fn petal(argument: &str, overrides: &Overrides) -> Result<Petal> {
    if let Some(text) = petal::preset(argument) {
        let loaded = load(text, &format!("{argument} (built in)"), &overrides.define)?;
        return Ok(Petal { name: argument.to_owned(), loaded, assets: assets_beside(None) });
    }
    let path = Path::new(argument);
    let is_path = path.extension().is_some() || path.components().count() > 1 || path.exists();
    if !is_path {
        let what = format!("neither a file nor a preset; the presets are {}", preset_names());
        return Err(Error::invalid(argument, what));
    }
    let loaded = load(&read_text(path)?, argument, &overrides.define)?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Petal { name, loaded, assets: assets_beside(Some(path)) })
}

/// Wavelengths, nm.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Bands(pub(crate) Vec<f64>);

/// More bands than any instrument has.
const MAX_BANDS: usize = 10_000;

/// A list of wavelengths, in which `LOW..HIGH:STEP` stands for many.
pub(crate) fn bands(argument: &str) -> Result<Bands, String> {
    let mut bands = Vec::new();
    for part in argument.split(',') {
        let number = |text: &str| {
            let v = text.trim().parse::<f64>().ok().filter(|v| v.is_finite());
            v.ok_or_else(|| format!("`{part}` is neither a number nor LOW..HIGH:STEP"))
        };
        let Some((low, rest)) = part.split_once("..") else {
            bands.push(number(part)?);
            continue;
        };
        let (high, step) = rest.split_once(':').unwrap_or((rest, "10"));
        let (low, high, step) = (number(low)?, number(high)?, number(step)?);
        let count = ((high - low) / step + 1e-9).floor();
        if !(step > 0.0 && (0.0..MAX_BANDS as f64).contains(&count)) {
            return Err(format!("`{part}`: LOW..HIGH:STEP rises in at most {MAX_BANDS} steps"));
        }
        bands.extend((0..=count as u32).map(|i| low + f64::from(i) * step));
    }
    Ok(Bands(bands))
}

/// A count that may be written as `1e6`.
pub(crate) fn count(argument: &str) -> Result<u64, String> {
    if let Ok(n) = argument.replace('_', "").parse::<u64>() {
        return Ok(n);
    }
    // Above 2^53 not every whole number is an f64.
    match argument.parse::<f64>() {
        Ok(v) if v >= 0.0 && v.fract() == 0.0 && v <= 9_007_199_254_740_992.0 => Ok(v as u64),
        _ => Err("not a whole number, such as 250000 or 1e6".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_and_ranges_of_bands() {
        assert_eq!(bands("450, 550,650").unwrap().0, [450.0, 550.0, 650.0]);
        let default = bands("380..780:10").unwrap().0;
        assert_eq!((default.len(), default[0], default[40]), (41, 380.0, 780.0));
        assert_eq!(bands("400..410:2.5,700").unwrap().0, [400.0, 402.5, 405.0, 407.5, 410.0, 700.0]);
        assert_eq!(bands("400..430").unwrap().0.len(), 4);
        for text in
            ["", "a", "400..", "400..300:10", "400..500:0", "400..500:-1", "400..500:1e-9", "nan", "1..inf:1"]
        {
            assert!(bands(text).is_err(), "{text}");
        }
    }

    #[test]
    fn counts() {
        for (text, n) in [("1e6", 1_000_000), ("0", 0), ("2.5e3", 2500), ("12", 12), ("1_000", 1000)] {
            assert_eq!(count(text), Ok(n), "{text}");
        }
        for text in ["", "1.5", "-1", "nan", "inf", "1e60", "ten"] {
            assert!(count(text).is_err(), "{text}");
        }
    }
}

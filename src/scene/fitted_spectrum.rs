//! From a fitted reflectance spectrum to a petal file: the layers with the pigments and the scattering that were found.
//!
//! The gain is not part of the petal: it belongs to the spectrometer. Guarded by `the_file_is_the_fit`.

use std::fmt::Write as _;

use super::description::PetalDescription;
use crate::fit::spectrum::SpectrumFit;
use crate::{Error, Result};

/// The petal with what was found.
pub fn petal(base: &PetalDescription, fit: &SpectrumFit) -> PetalDescription {
    PetalDescription { tissue: Some(fit.tissue.clone()), ..base.clone() }
}

/// The petal file; `lines` say as comments where its numbers come from, `report` is the fit in words.
pub fn to_toml(petal: &PetalDescription, lines: &[String], report: &str) -> Result<String> {
    let mut out =
        String::from("# A petal whose pigments were fitted to a measured reflectance spectrum.\n#\n");
    // A newline in a name must not end the comment.
    for line in lines.iter().map(|l| l.replace(['\n', '\r'], " ")) {
        let _ = writeln!(out, "# {line}");
    }
    out.push_str("#\n");
    for line in report.lines() {
        let _ = writeln!(out, "# {line}");
    }
    let body = toml::to_string(petal).map_err(|e| Error::Unsupported(format!("this petal as TOML: {e}")))?;
    out.push('\n');
    out.push_str(&body);
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::spectrum::SpectrumFit;
    use crate::scene::load;

    #[test]
    fn the_file_is_the_fit() {
        let text = "[adaxial]\n[adaxial.pigments]\nanthocyanin_ug_per_cm2 = 31.5\nanthocyanin_peak_nm = 541.25\n\
                    [spongy]\nthickness_um = 150.0\nscattering_per_mm = 47.3\nanisotropy = 0.8";
        let fit = SpectrumFit {
            parameters: Vec::new(),
            wavelengths_nm: Vec::new(),
            measured: Vec::new(),
            modelled: Vec::new(),
            rmse: 0.01,
            neighbour_correlation: 0.0,
            converged: true,
            evaluations: 100,
            agreeing_starts: (6, 6),
            cut_off: 0.0,
            tissue: toml::from_str(text).unwrap(),
        };
        let base = PetalDescription { samples: 7, ..PetalDescription::default() };
        let lines = ["data a\n[cells]".to_owned()];
        let file = to_toml(&petal(&base, &fit), &lines, "one\ntwo\n").unwrap();
        let read = load::<PetalDescription>(&file, "petal.toml", &[]).unwrap().description;
        assert_eq!(read, petal(&base, &fit), "{file}");
        assert!(file.contains("# data a [cells]\n#\n# one\n# two\n"), "{file}");
        read.build_tissue("").unwrap();
    }
}

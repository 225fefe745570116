//! Spectra of a petal as CSV: one row per wavelength.
//!
//! Lines that begin with `#` tell what was measured. The columns are `wavelength_nm` and, for each lit side and angle of the
//! lamp, `adaxial_30deg_reflectance`, `.._reflectance_se`, `.._transmittance`, `.._transmittance_se`: shares of the light that
//! arrives and one standard error. The file is a table of spectra ([`crate::spectrum::table`]), so a scene can use its columns.

use std::fmt::Write;

use crate::gonio::spectra::HemisphericalSpectrum;
use crate::{Error, Result};

/// Writes spectra that have their wavelengths in common. `about` stands in the first line.
pub fn write(spectra: &[HemisphericalSpectrum], about: &str) -> Result<String> {
    let Some(first) = spectra.first() else {
        return Err(Error::invalid("spectra", "there is nothing to write"));
    };
    let same = |s: &HemisphericalSpectrum| {
        s.points.len() == first.points.len()
            && s.points.iter().zip(&first.points).all(|(a, b)| a.wavelength_nm == b.wavelength_nm)
    };
    if !spectra.iter().all(same) {
        return Err(Error::invalid("spectra", "they do not have the same wavelengths"));
    }
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = writeln!(out, "# {}", about.replace(['\n', '\r'], " "));
    let _ = writeln!(
        out,
        "# Shares of the light that arrives from one direction, over the whole hemisphere; _se: one"
    );
    let _ = writeln!(out, "# standard error. Degrees: the lamp's angle from the normal of the lit side.");
    out.push_str("wavelength_nm");
    for s in spectra {
        let name = format!("{}_{}deg", format!("{:?}", s.side).to_lowercase(), s.incident_deg);
        for quantity in ["reflectance", "transmittance"] {
            let _ = write!(out, ",{name}_{quantity},{name}_{quantity}_se");
        }
    }
    out.push('\n');
    for (i, p) in first.points.iter().enumerate() {
        let _ = write!(out, "{:?}", p.wavelength_nm);
        for s in spectra {
            for e in [s.points[i].reflectance, s.points[i].transmittance] {
                let _ = write!(out, ",{:?},{:?}", e.value, e.standard_error);
            }
        }
        out.push('\n');
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::DiffuseTransmission;
    use crate::geometry::Side;
    use crate::gonio::Goniophotometer;
    use crate::spectrum::table;
    use std::ops::ControlFlow;

    #[test]
    fn spectra_read_back_as_a_table() {
        let sheet = DiffuseTransmission::new(0.4.into(), 0.4.into(), 0.3.into()).unwrap();
        let gonio = Goniophotometer {
            incident_deg: vec![0.0, 22.5],
            side: Side::Abaxial,
            rays: 2000,
            bands_nm: vec![700.0, 500.0, 400.0],
            ..Default::default()
        };
        let table = gonio.measure(&sheet, &|_, _| ControlFlow::Continue(())).unwrap();
        let spectra = HemisphericalSpectrum::of_tables([&table]);
        let text = write(&spectra, "a\nsheet").unwrap();
        let read = table::parse(&text, "spectra.csv").unwrap();
        for s in &spectra {
            let at = format!("abaxial_{}deg", s.incident_deg);
            for (quantity, of) in [
                (
                    "reflectance",
                    (|p| p.reflectance.value) as fn(&crate::gonio::spectra::SpectrumPoint) -> f64,
                ),
                ("reflectance_se", |p| p.reflectance.standard_error),
                ("transmittance", |p| p.transmittance.value),
                ("transmittance_se", |p| p.transmittance.standard_error),
            ] {
                let expected: Vec<_> = s.points.iter().map(|p| (p.wavelength_nm, of(p))).collect();
                assert_eq!(read.points(Some(&format!("{at}_{quantity}"))).unwrap(), expected);
            }
        }
        assert!(write(&[], "").is_err());
        let mut uneven = spectra;
        uneven[1].points.pop();
        assert!(write(&uneven, "").is_err());
    }
}

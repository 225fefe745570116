//! Spectra of a petal from its goniometer tables: directional-hemispherical reflectance and transmittance of either side
//! against the wavelength, with standard errors, and their colours.

use serde::Serialize;

use super::{Estimate, GonioTable, Incidence};
use crate::Result;
use crate::geometry::Side;
use crate::spectrum::object_color::{ObjectColor, spectrum_of_bands};
use crate::spectrum::{Illuminant, Observer};

/// One band of a [`HemisphericalSpectrum`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpectrumPoint {
    /// Wavelength, nm.
    pub wavelength_nm: f64,
    /// Share that leaves on the lit side.
    pub reflectance: Estimate,
    /// Share that leaves on the other side.
    pub transmittance: Estimate,
}

/// What one side does with the light of one direction.
#[derive(Clone, Debug, PartialEq)]
pub struct HemisphericalSpectrum {
    /// The lit side.
    pub side: Side,
    /// The lamp's angle from its normal, degrees.
    pub incident_deg: f64,
    /// By increasing wavelength.
    pub points: Vec<SpectrumPoint>,
}

/// Colours of a [`HemisphericalSpectrum`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PetalColors {
    /// The lit side.
    pub side: Side,
    /// The lamp's angle from its normal, degrees.
    pub incident_deg: f64,
    /// All light that comes back.
    pub reflected: ObjectColor,
    /// All light that goes through.
    pub transmitted: ObjectColor,
}

impl HemisphericalSpectrum {
    /// The spectra of all incidences of tables, in their order.
    pub fn of_tables<'a>(tables: impl IntoIterator<Item = &'a GonioTable>) -> Vec<Self> {
        let spectra = |t: &'a GonioTable| t.incidences.iter().map(move |i| Self::of_incidence(t, i));
        tables.into_iter().flat_map(spectra).collect()
    }

    fn of_incidence(table: &GonioTable, incidence: &Incidence) -> Self {
        let mut points: Vec<SpectrumPoint> = table
            .bands_nm
            .iter()
            .zip(&incidence.bands)
            .map(|(&wavelength_nm, t)| SpectrumPoint {
                wavelength_nm,
                reflectance: t.reflectance,
                transmittance: t.transmittance,
            })
            .collect();
        points.sort_by(|a, b| a.wavelength_nm.total_cmp(&b.wavelength_nm));
        Self { side: table.side, incident_deg: incidence.incident_deg, points }
    }

    /// Colours under a light. An error where the bands do not cover the visible range.
    pub fn colors(&self, illuminant: Illuminant, observer: Observer) -> Result<PetalColors> {
        let color = |of: fn(&SpectrumPoint) -> Estimate| {
            let bands: Vec<_> = self.points.iter().map(|p| (p.wavelength_nm, of(p).value)).collect();
            ObjectColor::new(&spectrum_of_bands(&bands, "bands_nm")?, illuminant, observer)
        };
        Ok(PetalColors {
            side: self.side,
            incident_deg: self.incident_deg,
            reflected: color(|p| p.reflectance)?,
            transmitted: color(|p| p.transmittance)?,
        })
    }

    /// Means of reflectance and transmittance over the bands within `range_nm`; `None` where there are none. The bands share
    /// their paths: errors add up without cancelling.
    pub fn mean(&self, range_nm: (f64, f64)) -> Option<(Estimate, Estimate)> {
        let inside = |p: &&SpectrumPoint| (range_nm.0..=range_nm.1).contains(&p.wavelength_nm);
        let n = self.points.iter().filter(inside).count() as f64;
        let mean = |of: fn(&SpectrumPoint) -> Estimate| {
            let sum = self.points.iter().filter(inside).map(of).fold(Estimate::default(), |a, e| Estimate {
                value: a.value + e.value,
                standard_error: a.standard_error + e.standard_error,
            });
            sum.scaled(1.0 / n)
        };
        (n > 0.0).then(|| (mean(|p| p.reflectance), mean(|p| p.transmittance)))
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::bsdf::DiffuseTransmission;
    use crate::gonio::Goniophotometer;
    use crate::spectrum::Spectrum;

    /// Both sides of a sheet that reflects and transmits red; bands fall.
    pub(crate) fn tables() -> Vec<GonioTable> {
        let red = |low: f64, high: f64| Spectrum::from_fn(move |l| if l > 600.0 { high } else { low });
        let sheet = DiffuseTransmission::new(red(0.05, 0.4), red(0.1, 0.5), red(0.0, 0.3)).unwrap();
        [Side::Adaxial, Side::Abaxial]
            .map(|side| {
                let gonio = Goniophotometer {
                    incident_deg: vec![0.0, 60.0],
                    side,
                    rays: 4000,
                    bands_nm: (0..=10).map(|i| 780.0 - 40.0 * f64::from(i)).collect(),
                    ..Default::default()
                };
                gonio.measure(&sheet, &|_, _| ControlFlow::Continue(())).unwrap().described("red sheet", "")
            })
            .into()
    }

    #[test]
    fn spectra_have_sides_angles_and_colours() {
        let tables = tables();
        let spectra = HemisphericalSpectrum::of_tables(&tables);
        let keys: Vec<_> = spectra.iter().map(|s| (s.side, s.incident_deg)).collect();
        assert_eq!(
            keys,
            [(Side::Adaxial, 0.0), (Side::Adaxial, 60.0), (Side::Abaxial, 0.0), (Side::Abaxial, 60.0)]
        );
        for s in &spectra {
            assert!(s.points.windows(2).all(|p| p[0].wavelength_nm < p[1].wavelength_nm));
            let (r, t) = s.mean((640.0, 700.0)).unwrap();
            let expected = if s.side == Side::Adaxial { 0.4 } else { 0.5 };
            assert!((r.value - expected).abs() < 4.0 * r.standard_error, "{r:?}");
            assert!((t.value - 0.3).abs() < 4.0 * t.standard_error, "{t:?}");
            assert!(s.mean((800.0, 900.0)).is_none());
            let c = s.colors(Illuminant::D65, Observer::Cie1931).unwrap();
            assert!(c.reflected.lab[1] > 30.0 && c.transmitted.lab[1] > c.reflected.lab[1], "{c:?}");
        }
        let mut few = spectra[0].clone();
        few.points.truncate(3);
        assert!(few.colors(Illuminant::D65, Observer::Cie1931).is_err());
    }
}

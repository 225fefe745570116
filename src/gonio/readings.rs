//! Tables and functions as readings: what a laboratory would have delivered of them.
//!
//! A bin of a [`GonioTable`] becomes the reading at the bin's centre, sigma its standard error; bins that no path
//! reached in a band without light have no sigma. What is lost: the bin's width (a reading is a point), totals and the
//! dense scan. Guarded by `a_table_becomes_readings_of_its_own_side`.

use super::directional::Directional;
use super::measurement::{Band, Measurement, Reading, Scale, direction_deg};
use super::{ExitantGrid, GonioTable};
use crate::geometry::Side;
use crate::{Error, Result};

impl GonioTable {
    /// The bins as readings in the sample's frame: where the abaxial side was lit, the lamp stands below.
    pub fn to_measurement(&self) -> Measurement {
        let turn = |w: glam::DVec3| match self.side {
            Side::Adaxial => w,
            Side::Abaxial => glam::DVec3::new(w.x, -w.y, -w.z),
        };
        let mut readings = Vec::new();
        for incidence in &self.incidences {
            let wi = turn(direction_deg(incidence.incident_deg, 0.0));
            for bin in 0..self.grid.len() {
                let (theta_deg, phi_deg) = self.grid.centre_deg(bin);
                let wo = turn(direction_deg(theta_deg, phi_deg));
                for band in 0..self.bands_nm.len() {
                    let Some(e) = incidence.bsdf.get(band * self.grid.len() + bin) else { continue };
                    readings.push(Reading {
                        wi,
                        wo,
                        series: 0,
                        band: band as u32,
                        bsdf_per_sr: e.value,
                        sigma_per_sr: (e.standard_error > 0.0).then_some(e.standard_error),
                    });
                }
            }
        }
        Measurement {
            sample: self.sample.clone(),
            bands: self.bands_nm.iter().map(|&nm| Band::nm(nm)).collect(),
            series: vec![self.sample.clone()],
            readings,
            scale: Scale::Absolute,
            ..Default::default()
        }
    }
}

/// Several measurements as one: the two sides of a sample, one file per incidence. Equal bands are one band, series of
/// one name one series.
pub fn merge(parts: impl IntoIterator<Item = Measurement>) -> Result<Measurement> {
    let mut parts = parts.into_iter();
    let Some(mut all) = parts.next() else {
        return Err(Error::invalid("measurements", "there are none to merge"));
    };
    for part in parts {
        let differs = |what: &str| {
            Error::invalid(
                "measurements",
                format!("`{}` and `{}` differ in {what}: not one instrument's", all.sample, part.sample),
            )
        };
        if part.scale != all.scale {
            return Err(differs("their scale (absolute or relative)"));
        }
        if part.source_half_angle_deg != all.source_half_angle_deg
            || part.detector_half_angle_deg != all.detector_half_angle_deg
        {
            return Err(differs("the half angles of lamp or detector"));
        }
        fn index<T: PartialEq + Clone>(list: &mut Vec<T>, item: &T) -> u32 {
            let i = list.iter().position(|x| x == item).unwrap_or_else(|| {
                list.push(item.clone());
                list.len() - 1
            });
            i as u32
        }
        let bands: Vec<u32> = part.bands.iter().map(|b| index(&mut all.bands, b)).collect();
        let series: Vec<u32> = part.series.iter().map(|s| index(&mut all.series, s)).collect();
        for r in part.readings {
            let (Some(&band), Some(&series)) = (bands.get(r.band as usize), series.get(r.series as usize))
            else {
                return Err(Error::invalid(
                    "measurements",
                    "a reading names a band or series that does not exist",
                ));
            };
            all.readings.push(Reading { band, series, ..r });
        }
        all.notes.extend(part.notes);
    }
    Ok(all)
}

/// Readings of any function at the bin centres of `grid`: lamps at `incident_deg` from the normal and azimuth 0, on each
/// side that the function knows.
pub fn sample(table: &dyn Directional, incident_deg: &[f64], grid: &ExitantGrid) -> Result<Measurement> {
    grid.validate()?;
    if let Some(deg) = incident_deg.iter().find(|d| !(0.0..90.0).contains(*d)) {
        return Err(Error::invalid("incident_deg", format!("{deg} is not in 0-90 deg")));
    }
    let bands = table.bands();
    let mut values = vec![0.0; bands.len()];
    let mut readings = Vec::new();
    for side in [Side::Adaxial, Side::Abaxial] {
        let turn = |w: glam::DVec3| match side {
            Side::Adaxial => w,
            Side::Abaxial => glam::DVec3::new(w.x, -w.y, -w.z),
        };
        for &deg in incident_deg {
            let wi = turn(direction_deg(deg, 0.0));
            for bin in 0..grid.len() {
                let (theta_deg, phi_deg) = grid.centre_deg(bin);
                let wo = turn(direction_deg(theta_deg, phi_deg));
                if !table.bsdf(wi, wo, &mut values) {
                    continue;
                }
                readings.extend(values.iter().enumerate().map(|(band, &bsdf_per_sr)| Reading {
                    wi,
                    wo,
                    series: 0,
                    band: band as u32,
                    bsdf_per_sr,
                    sigma_per_sr: None,
                }));
            }
        }
    }
    Ok(Measurement {
        bands: bands.to_vec(),
        series: vec!["sampled".into()],
        readings,
        scale: Scale::Absolute,
        ..Default::default()
    })
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::bsdf::DiffuseTransmission;
    use crate::gonio::Goniophotometer;
    use crate::gonio::directional::tests::Sheet;
    use crate::gonio::measurement::instrument_deg;

    #[test]
    fn a_table_becomes_readings_of_its_own_side() {
        let gonio = Goniophotometer {
            incident_deg: vec![0.0, 40.0],
            side: Side::Abaxial,
            rays: 5_000,
            bands_nm: vec![450.0, 650.0],
            exitant: ExitantGrid { theta_step_deg: 30.0, phi_step_deg: 30.0 },
            ..Default::default()
        };
        let sheet = DiffuseTransmission::new(0.3.into(), 0.2.into(), 0.1.into()).unwrap();
        let table = gonio.measure(&sheet, &|_, _| ControlFlow::Continue(())).unwrap();
        let m = table.to_measurement();
        assert_eq!(m.readings.len(), 2 * 2 * table.grid.len());
        for r in &m.readings {
            let (ti, to, phi, side) = instrument_deg(r.wi, r.wo);
            assert_eq!(side, Side::Abaxial);
            let i = table.incidences.iter().find(|i| (i.incident_deg - ti).abs() < 1e-9).unwrap();
            let bin = (0..table.grid.len())
                .find(|&b| {
                    let (t, p) = table.grid.centre_deg(b);
                    (t - to).abs() < 1e-9 && ((p - phi + 180.0).rem_euclid(360.0) - 180.0).abs() < 1e-9
                })
                .unwrap();
            assert_eq!(r.bsdf_per_sr, i.bsdf[r.band as usize * table.grid.len() + bin].value);
        }
    }

    #[test]
    fn a_function_is_sampled_on_its_known_sides() {
        let grid = ExitantGrid { theta_step_deg: 15.0, phi_step_deg: 30.0 };
        let m = sample(&Sheet::new(0.4, 0.1, 0.3), &[10.0, 50.0], &grid).unwrap();
        assert_eq!(m.readings.len(), 2 * 2 * 2 * grid.len());
        assert_eq!(m.lamps().len(), 4);
        assert!(sample(&Sheet::new(0.4, 0.1, 0.3), &[90.0], &grid).is_err());
        assert!(sample(&Sheet::new(0.4, 0.1, 0.3), &[f64::NAN], &grid).is_err());
    }

    #[test]
    fn measurements_of_one_instrument_merge() {
        let grid = ExitantGrid { theta_step_deg: 30.0, phi_step_deg: 60.0 };
        let m = sample(&Sheet::new(0.4, 0.1, 0.3), &[10.0, 50.0], &grid).unwrap();
        let (above, below): (Vec<Reading>, Vec<Reading>) = m.readings.iter().partition(|r| r.wi.z > 0.0);
        let part = |readings| Measurement { readings, ..m.clone() };
        assert_eq!(merge([part(above.clone()), part(below.clone())]).unwrap(), m);
        let other = Measurement { bands: vec![Band::named("R"), Band::nm(450.0)], ..part(below.clone()) };
        let merged = merge([part(above.clone()), other]).unwrap();
        assert_eq!(merged.bands, [Band::nm(450.0), Band::nm(650.0), Band::named("R")]);
        assert_eq!(merged.readings[above.len()].band, 2);
        let cone = Measurement { detector_half_angle_deg: 1.0, ..part(below.clone()) };
        assert!(merge([part(above.clone()), cone]).unwrap_err().to_string().contains("half angles"));
        let relative = Measurement { scale: Scale::RelativePerSeries, ..part(below) };
        assert!(merge([part(above), relative]).is_err());
        assert!(merge([]).is_err());
    }
}

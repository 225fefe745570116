//! A goniometer table as a BSDF of any two directions: bilinear between bins, with the table's own totals.
//!
//! f = s(theta_i) B(theta_i, wo), with B the table's bilinear look-up ([`GonioTable::bsdf`]) and, per incidence, side and
//! band,
//!
//! s = R / integral of B |cos theta_o| dwo,
//!
//! the measured total R over that of the interpolation (linear between incidences), so that interpolation neither makes nor
//! loses light. Beyond the measured incidences f(wi, wo) = f(wo, wi) where theta_o is among them, else the last
//! incidence is held.
//!
//! Symbols: s -> `scale`, pure, near 1; theta_i -> [`Incidence::incident_deg`](super::Incidence), deg.
//!
//! Limits: the side that was not lit has transmission only, by reciprocity (`the_other_side_knows_transmission`); a lobe
//! narrower than a bin is as wide as a bin. Totals are guarded by `totals_are_the_tables_own`, reciprocity by
//! `reciprocity_continues_the_incidences`. Source: our reading.

use glam::DVec3;

use super::GonioTable;
use super::directional::{Coverage, Directional};
use super::measurement::{Band, instrument_deg};
use crate::geometry::Side;
use crate::math::quadrature::GaussLegendre;

/// A table of one lit side that can be asked for any two directions.
#[derive(Clone, Debug)]
pub struct OneSided {
    table: GonioTable,
    bands: Vec<Band>,
    /// `(incident_deg, s)` in the order of the angles; s is `[reflection, transmission]` per band.
    scale: Vec<(f64, Vec<[f64; 2]>)>,
}

impl OneSided {
    /// Takes a table.
    pub fn new(table: GonioTable) -> Self {
        let weights = row_weights(&table);
        let (thetas, phis, bins) = (table.grid.thetas(), table.grid.phis(), table.grid.len());
        let mut scale: Vec<(f64, Vec<[f64; 2]>)> = table
            .incidences
            .iter()
            .map(|incidence| {
                let of_band = |band: usize| {
                    let total = |rows: std::ops::Range<usize>| -> f64 {
                        let row = |r: usize| {
                            let start = band * bins + r * phis;
                            let row = incidence.bsdf.get(start..start + phis).unwrap_or(&[]);
                            weights[r] * row.iter().map(|e| e.value).sum::<f64>()
                        };
                        rows.map(row).sum()
                    };
                    let Some(t) = incidence.bands.get(band) else { return [1.0; 2] };
                    let ratio = |measured: f64, interpolated: f64| {
                        if measured > 0.0 && interpolated > 0.0 { measured / interpolated } else { 1.0 }
                    };
                    [
                        ratio(t.reflectance.value, total(0..thetas / 2)),
                        ratio(t.transmittance.value, total(thetas / 2..thetas)),
                    ]
                };
                (incidence.incident_deg, (0..table.bands_nm.len()).map(of_band).collect())
            })
            .collect();
        scale.sort_by(|a, b| a.0.total_cmp(&b.0));
        let bands = table.bands_nm.iter().map(|&nm| Band::nm(nm)).collect();
        Self { table, bands, scale }
    }

    /// The table.
    pub fn table(&self) -> &GonioTable {
        &self.table
    }

    fn is_measured(&self, incident_deg: f64) -> bool {
        let slack = 1e-9;
        self.scale.first().is_some_and(|s| incident_deg >= s.0 - slack)
            && self.scale.last().is_some_and(|s| incident_deg <= s.0 + slack)
    }

    /// Value for a lamp on the lit side.
    fn eval(&self, wi: DVec3, wo: DVec3, values: &mut [f64]) -> bool {
        let (ti, to, d, _) = instrument_deg(wi, wo);
        let reflected = (wi.z > 0.0) == (wo.z > 0.0);
        // Rounding must not carry a direction through the horizon.
        let to = if reflected { to.min(90.0) } else { to.max(90.0 + 1e-4) };
        let w = super::measurement::direction_deg(to, d).as_vec3();
        let above = self.scale.partition_point(|s| s.0 < ti).min(self.scale.len().saturating_sub(1));
        let Some(b) = self.scale.get(above) else { return false };
        let a = if b.0 > ti && above > 0 { &self.scale[above - 1] } else { b };
        let t = if b.0 > a.0 { ((ti - a.0) / (b.0 - a.0)).clamp(0.0, 1.0) } else { 0.0 };
        let k = usize::from(!reflected);
        for (band, v) in values.iter_mut().enumerate() {
            let Some(f) = self.table.bsdf(ti, w, band) else { return false };
            *v = f * (a.1[band][k] * (1.0 - t) + b.1[band][k] * t);
        }
        true
    }
}

/// Integral of each row's hat function times |cos|, per column: the weight of its bins in the integral of the bilinear
/// interpolation, sr.
fn row_weights(table: &GonioTable) -> Vec<f64> {
    let (thetas, step_deg) = (table.grid.thetas(), table.grid.theta_step_deg);
    let rule = GaussLegendre::new(8);
    // Over a length of theta, with the value at its two ends.
    let piece = |from_deg: f64, to_deg: f64, at_from: f64, at_to: f64| -> f64 {
        rule.on(from_deg.to_radians(), to_deg.to_radians())
            .map(|(theta, weight)| {
                let t = (theta.to_degrees() - from_deg) / (to_deg - from_deg);
                weight * (at_from + (at_to - at_from) * t) * (2.0 * theta).sin().abs() / 2.0
            })
            .sum()
    };
    (0..thetas)
        .map(|r| {
            let centre = (r as f64 + 0.5) * step_deg;
            // Held between the horizon or a pole and the row next to it.
            let below = if r == 0 || r == thetas / 2 {
                piece(centre - step_deg / 2.0, centre, 1.0, 1.0)
            } else {
                piece(centre - step_deg, centre, 0.0, 1.0)
            };
            let above = if r + 1 == thetas || r + 1 == thetas / 2 {
                piece(centre, centre + step_deg / 2.0, 1.0, 1.0)
            } else {
                piece(centre, centre + step_deg, 1.0, 0.0)
            };
            (below + above) * table.grid.phi_step_deg.to_radians()
        })
        .collect()
}

impl Directional for OneSided {
    fn bands(&self) -> &[Band] {
        &self.bands
    }

    fn coverage(&self) -> Coverage {
        Coverage {
            reflection_adaxial: self.table.side == Side::Adaxial,
            reflection_abaxial: self.table.side == Side::Abaxial,
            transmission_adaxial: true,
            transmission_abaxial: true,
        }
    }

    fn bsdf(&self, wi: DVec3, wo: DVec3, values: &mut [f64]) -> bool {
        values.fill(0.0);
        let is_lit = |w: DVec3| (w.z > 0.0) == (self.table.side == Side::Adaxial);
        match (is_lit(wi), is_lit(wo)) {
            (true, true) => {
                let theta = |w: DVec3| w.x.hypot(w.y).atan2(w.z.abs()).to_degrees();
                let swap = !self.is_measured(theta(wi)) && self.is_measured(theta(wo));
                if swap { self.eval(wo, wi, values) } else { self.eval(wi, wo, values) }
            }
            (true, false) => self.eval(wi, wo, values),
            (false, true) => self.eval(wo, wi, values),
            (false, false) => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::bsdf::DiffuseTransmission;
    use crate::gonio::directional::directional_hemispherical;
    use crate::gonio::directional::tests::Sheet;
    use crate::gonio::measurement::direction_deg;
    use crate::gonio::{Estimate, Goniophotometer, sample};

    /// A table of a sheet with a highlight, with totals that are the sums of its bins.
    fn table(side: Side) -> GonioTable {
        let gonio = Goniophotometer {
            incident_deg: vec![40.0, 0.0, 20.0],
            side,
            rays: 1_000,
            bands_nm: vec![450.0, 650.0],
            ..Default::default()
        };
        let white = DiffuseTransmission::new(0.3.into(), 0.2.into(), 0.1.into()).unwrap();
        let mut t = gonio.measure(&white, &|_, _| ControlFlow::Continue(())).unwrap();
        let exact = |value| Estimate { value, standard_error: 1e-3 };
        for incidence in &mut t.incidences {
            let m = sample(&Sheet::new(0.4, 0.3, 0.2), &[incidence.incident_deg], &t.grid).unwrap();
            let n = t.grid.len();
            for (k, r) in m.readings.iter().take(2 * n).enumerate() {
                incidence.bsdf[r.band as usize * n + k / 2] = exact(r.bsdf_per_sr);
            }
            for band in 0..2 {
                let sum = |bins: std::ops::Range<usize>| -> f64 {
                    bins.map(|b| incidence.bsdf[band * n + b].value * t.grid.projected_solid_angle_sr(b))
                        .sum()
                };
                incidence.bands[band].reflectance = exact(sum(0..n / 2));
                incidence.bands[band].transmittance = exact(sum(n / 2..n));
            }
        }
        t
    }

    #[test]
    fn totals_are_the_tables_own() {
        for side in [Side::Adaxial, Side::Abaxial] {
            let table = table(side);
            let other = if side == Side::Adaxial { Side::Abaxial } else { Side::Adaxial };
            let f = OneSided::new(table.clone());
            for incidence in &table.incidences {
                let theta = incidence.incident_deg;
                let wi = direction_deg(if side == Side::Adaxial { theta } else { 180.0 - theta }, 0.0);
                let r = directional_hemispherical(&f, wi, side, (400, 72));
                let t = directional_hemispherical(&f, wi, other, (400, 72));
                for band in 0..2 {
                    let own = &incidence.bands[band];
                    assert!((r[band] / own.reflectance.value - 1.0).abs() < 1e-4, "{r:?} {own:?}");
                    assert!((t[band] / own.transmittance.value - 1.0).abs() < 1e-4, "{t:?} {own:?}");
                }
            }
            // The correction is small: the interpolation is close by itself.
            assert!(f.scale.iter().flat_map(|s| s.1.iter().flatten()).all(|s| (s - 1.0).abs() < 0.01));
        }
    }

    #[test]
    fn values_are_the_sheets() {
        let f = OneSided::new(table(Side::Adaxial));
        let (mut v, mut expected) = ([0.0; 2], [0.0; 2]);
        let sheet = Sheet::new(0.4, 0.3, 0.2);
        for (ti, to, d) in [(0.0, 30.0, 10.0), (20.0, 22.5, 180.0), (40.0, 140.0, 77.0), (30.0, 60.0, 90.0)] {
            let (wi, wo) = (direction_deg(ti, 25.0), direction_deg(to, 25.0 + d));
            assert!(f.bsdf(wi, wo, &mut v) && sheet.bsdf(wi, wo, &mut expected));
            assert!((v[1] - expected[1]).abs() < 0.02 * expected[1], "{ti} {to} {d}: {v:?} {expected:?}");
        }
    }

    #[test]
    fn reciprocity_continues_the_incidences() {
        let f = OneSided::new(table(Side::Adaxial));
        let (mut a, mut b) = ([0.0; 2], [0.0; 2]);
        // The lamp beyond 40 degrees, the detector within.
        let (wi, wo) = (direction_deg(70.0, 10.0), direction_deg(25.0, 150.0));
        assert!(f.bsdf(wi, wo, &mut a) && f.bsdf(wo, wi, &mut b));
        assert_eq!(a, b);
        let mut expected = [0.0; 2];
        Sheet::new(0.4, 0.3, 0.2).bsdf(wi, wo, &mut expected);
        assert!((a[1] / expected[1] - 1.0).abs() < 0.02, "{a:?} {expected:?}");
        // Both beyond: the last incidence is held.
        let wo = direction_deg(75.0, 150.0);
        assert!(f.bsdf(wi, wo, &mut a) && f.bsdf(direction_deg(40.0, 10.0), wo, &mut b));
        assert_eq!(a, b);
    }

    #[test]
    fn the_other_side_knows_transmission() {
        let f = OneSided::new(table(Side::Abaxial));
        assert!(!f.coverage().reflection_adaxial && f.coverage().transmission_adaxial);
        let mut v = [0.0; 2];
        assert!(!f.bsdf(DVec3::Z, direction_deg(30.0, 0.0), &mut v) && v == [0.0; 2]);
        assert!(f.bsdf(direction_deg(20.0, 0.0), direction_deg(150.0, 30.0), &mut v));
        let mut back = [0.0; 2];
        assert!(f.bsdf(direction_deg(150.0, 30.0), direction_deg(20.0, 0.0), &mut back));
        assert!(v == back && (v[1] - 0.2 / std::f64::consts::PI).abs() < 1e-3, "{v:?}");
    }
}

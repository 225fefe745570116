//! Small models and measurements that the tests of the solver share.

use std::f64::consts::PI;
use std::ops::ControlFlow;

use glam::DVec3;

use super::*;
use crate::Result;
use crate::gonio::measurement::direction_deg;
use crate::gonio::{Band, Measurement, Reading};

/// Never stops.
pub(crate) fn on(_: u64, _: u64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

pub(crate) type Formula = fn(wi: DVec3, wo: DVec3, p: &[f64]) -> (f64, Vec<f64>);

/// A model given by a function of the directions and parameters: value and derivatives.
pub(crate) struct Simple {
    pub(crate) parameters: Vec<Parameter>,
    pub(crate) formula: Formula,
}

struct SimpleAt(Vec<Geometry>, Formula);

pub(crate) fn parameter(name: &str, kind: Kind, start: f64, min: f64, max: f64) -> Parameter {
    let logarithmic = kind == Kind::Shape;
    Parameter { name: name.into(), meaning: name.into(), kind, start, min, max, logarithmic }
}

impl Model for Simple {
    fn name(&self) -> &str {
        "simple"
    }
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }
    fn prepare(&self, geometries: &[Geometry]) -> Result<Box<dyn Prepared>> {
        Ok(Box::new(SimpleAt(geometries.to_vec(), self.formula)))
    }
}

impl Prepared for SimpleAt {
    fn eval(&self, p: &[f64], values: &mut [f64], mut jacobian: Option<&mut [f64]>) {
        let n = values.len();
        values.fill(0.0);
        if let Some(j) = jacobian.as_deref_mut() {
            j.fill(0.0);
        }
        for (k, g) in self.0.iter().enumerate() {
            for &(wi, wo, weight) in &g.pairs {
                let (v, d) = self.1(wi, wo, p);
                values[k] += weight * v;
                if let Some(j) = jacobian.as_deref_mut() {
                    d.iter().enumerate().for_each(|(q, d)| j[q * n + k] += weight * d);
                }
            }
        }
    }
}

fn mirror_cosine(wi: DVec3, wo: DVec3) -> f64 {
    DVec3::new(-wi.x, -wi.y, wi.z).dot(wo).max(0.0)
}

/// `kd / pi + ks c^n`, c the cosine from the mirror's direction.
pub(crate) fn lobe() -> Simple {
    Simple {
        parameters: vec![
            parameter("kd", Kind::Coefficient, 0.2, 0.0, 1.0),
            parameter("ks", Kind::Coefficient, 0.1, 0.0, 1.0),
            parameter("n", Kind::Shape, 10.0, 1.0, 1000.0),
        ],
        formula: |wi, wo, p| {
            let c = mirror_cosine(wi, wo);
            let power = c.powf(p[2]);
            let by_n = if c > 0.0 { p[1] * power * c.ln() } else { 0.0 };
            (p[0] / PI + p[1] * power, vec![1.0 / PI, power, by_n])
        },
    }
}

/// `a + b cos theta_o`: linear, without bounds that matter.
pub(crate) fn line() -> Simple {
    Simple {
        parameters: vec![
            parameter("a", Kind::Coefficient, 0.0, -10.0, 10.0),
            parameter("b", Kind::Coefficient, 0.0, -10.0, 10.0),
        ],
        formula: |_, wo, p| (p[0] + p[1] * wo.z, vec![1.0, wo.z]),
    }
}

/// Lamps at 20 and 50 deg, views of theta 0-60 and phi 0-180: 72 readings of one band and series.
pub(crate) fn measured(value: impl Fn(DVec3, DVec3, usize, usize) -> f64) -> Measurement {
    measured_in(1, 1, value)
}

/// The same for several bands and series; `value(wi, wo, band, series)`.
pub(crate) fn measured_in(
    bands: usize,
    series: usize,
    value: impl Fn(DVec3, DVec3, usize, usize) -> f64,
) -> Measurement {
    let mut readings = Vec::new();
    for series in 0..series {
        for lamp in [20.0, 50.0] {
            let wi = direction_deg(lamp, 0.0);
            let mut views = vec![(0.0, 0.0)];
            for theta in 1..=6 {
                views.extend(
                    (0..=6)
                        .filter(|p| p % 2 == theta % 2 || theta > 2)
                        .map(|p| (10 * theta, 30 * p))
                        .map(|(t, p)| (f64::from(t), f64::from(p))),
                );
            }
            for (theta, phi) in views {
                let wo = direction_deg(theta, phi);
                for band in 0..bands {
                    readings.push(Reading {
                        wi,
                        wo,
                        series: series as u32,
                        band: band as u32,
                        bsdf_per_sr: value(wi, wo, band, series),
                        sigma_per_sr: None,
                    });
                }
            }
        }
    }
    Measurement {
        sample: "synthetic".into(),
        bands: (0..bands).map(|b| Band::nm(450.0 + 100.0 * b as f64)).collect(),
        series: (0..series).map(|s| format!("s{s}")).collect(),
        readings,
        ..Default::default()
    }
}

/// Errors between -1 and 1 that no formula of the tests can follow: sin(12.9898 i^2), i the number of a reading.
pub(crate) fn wiggle(i: usize) -> f64 {
    (12.9898 * (i * i) as f64).sin()
}

/// The parameter of that name.
pub(crate) fn of<'a>(fit: &'a Fit, name: &str) -> &'a Fitted {
    fit.parameters.iter().find(|p| p.name == name).unwrap_or_else(|| panic!("{name}: {:?}", fit.parameters))
}

/// A lobe with 2 % errors.
pub(crate) fn noisy_lobe() -> Measurement {
    let model = lobe();
    let mut m = measured(|wi, wo, _, _| (model.formula)(wi, wo, &[0.3, 0.2, 25.0]).0);
    for (i, r) in m.readings.iter_mut().enumerate() {
        r.bsdf_per_sr *= 1.0 + 0.02 * wiggle(i);
    }
    m
}

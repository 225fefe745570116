//! A small model and fits that were never solved, for tests of what is made of a fit.

use std::f64::consts::PI;

use glam::DVec3;

use super::{Correlation, End, Fit, Fitted, Geometry, Interval, Kind, Model, Parameter, Prepared, State};
use crate::Result;
use crate::gonio::Measurement;
use crate::gonio::measurement::direction_deg;
use crate::gonio::{Band, Reading};

/// `kd / pi + ks (n + 2) / (2 pi) cos^n` about the mirror above, `kt / pi` below; parameters `kd`, `ks`, `kt`, `n`.
pub(crate) struct Toy {
    parameters: Vec<Parameter>,
    /// Factor on light that arrives from nearer the normal than it leaves: 1 is reciprocal.
    asymmetry: f64,
}

impl Toy {
    pub(crate) fn new(asymmetry: f64) -> Self {
        let parameter = |name: &str, meaning: &str, kind, start, max| Parameter {
            name: name.into(),
            meaning: meaning.into(),
            kind,
            start,
            min: 0.0,
            max,
            logarithmic: false,
        };
        let parameters = vec![
            parameter("kd", "diffuse reflectance", Kind::Coefficient, 0.2, 2.0),
            parameter("ks", "reflectance of the highlight", Kind::Coefficient, 0.1, 2.0),
            parameter("kt", "diffuse transmittance", Kind::Coefficient, 0.1, 2.0),
            parameter("n", "exponent of the highlight", Kind::Shape, 10.0, 5000.0),
        ];
        Self { parameters, asymmetry }
    }

    fn value(&self, wi: DVec3, wo: DVec3, p: &[f64]) -> f64 {
        let factor = if wi.z.abs() > wo.z.abs() { self.asymmetry } else { 1.0 };
        factor
            * if wi.z * wo.z > 0.0 {
                let cos = DVec3::new(-wi.x, -wi.y, wi.z).dot(wo).max(0.0);
                p[0] / PI + p[1] * (p[3] + 2.0) / (2.0 * PI) * cos.powf(p[3])
            } else {
                p[2] / PI
            }
    }
}

struct PreparedToy {
    toy: Toy,
    geometries: Vec<Geometry>,
}

impl Model for Toy {
    fn name(&self) -> &str {
        "toy"
    }
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }
    fn prepare(&self, geometries: &[Geometry]) -> Result<Box<dyn Prepared>> {
        Ok(Box::new(PreparedToy { toy: Toy::new(self.asymmetry), geometries: geometries.to_vec() }))
    }
}

impl Prepared for PreparedToy {
    fn eval(&self, p: &[f64], values: &mut [f64], _: Option<&mut [f64]>) {
        for (v, g) in values.iter_mut().zip(&self.geometries) {
            *v = g.pairs.iter().map(|&(wi, wo, w)| w * self.toy.value(wi, wo, p)).sum();
        }
    }
}

/// A fit of one band's `values` (the toy's order) to every band of the measurement, as if they had been found.
pub(crate) fn fit(model: &Toy, measurement: &Measurement, values: &[f64]) -> Fit {
    let fitted = |p: &Parameter, band: Option<usize>, name: String, value: f64| Fitted {
        name,
        parameter: p.name.clone(),
        meaning: p.meaning.clone(),
        band,
        value,
        standard_error: Some(0.01 * value).filter(|s| *s > 0.0),
        start: p.start,
        min: p.min,
        max: p.max,
        state: if value > p.min { State::Free } else { State::AtLower },
        tie: None,
        interval: Some(Interval {
            level: 0.95,
            low: if value > p.min { End::Limit(0.98 * value) } else { End::Bound(p.min) },
            high: End::Limit(1.021 * value + 0.001),
        }),
        bootstrap: None,
    };
    let shape = model.parameters.len() - 1;
    let mut parameters = vec![fitted(&model.parameters[shape], None, "n".into(), values[shape])];
    for (b, band) in measurement.bands.iter().enumerate() {
        for (p, &value) in model.parameters[..shape].iter().zip(values) {
            parameters.push(fitted(p, Some(b), format!("{}[{}]", p.name, band.name), value));
        }
    }
    let modelled: Vec<f64> = measurement.readings.iter().map(|r| model.value(r.wi, r.wo, values)).collect();
    let residuals: Vec<f64> =
        measurement.readings.iter().zip(&modelled).map(|(r, m)| (m - r.bsdf_per_sr) / 0.01).collect();
    let chi2: f64 = residuals.iter().map(|r| r * r).sum();
    let (n, varied) = (residuals.len(), parameters.iter().filter(|p| p.standard_error.is_some()).count());
    let criterion =
        |factor: f64| (chi2 > 0.0).then(|| n as f64 * (chi2 / n as f64).ln() + factor * varied as f64);
    let correlations = (0..parameters.len())
        .flat_map(|a| (a + 1..parameters.len()).map(move |b| (a, b)))
        .filter(|&(a, b)| parameters[a].standard_error.is_some() && parameters[b].standard_error.is_some())
        .map(|(a, b)| Correlation { a, b, correlation: (1.3 * a as f64 - 2.1 * b as f64).sin() })
        .collect();
    Fit {
        model: model.name().into(),
        method: "bounded Levenberg-Marquardt".into(),
        weighting: "uniform".into(),
        converged: true,
        messages: Vec::new(),
        evaluations: 124,
        starts: 8,
        agreeing_starts: 7,
        n,
        varied,
        chi2,
        reduced_chi2: (n > varied).then(|| chi2 / (n - varied) as f64),
        aic: criterion(2.0),
        bic: criterion((n as f64).ln()),
        r2: (n > 1).then_some(0.987),
        rmse_per_sr: (chi2 / n.max(1) as f64).sqrt() * 0.01,
        rmse_cube_root: (chi2 / n.max(1) as f64).sqrt() * 0.02,
        parameters,
        correlations,
        modelled,
        residuals,
    }
}

/// Readings of the toy with a wiggle on top, on a grid of directions like a field goniometer's, every 10 deg of theta to
/// 70 and every 30 deg of azimuth.
pub(crate) fn measurement(
    model: &Toy,
    values: &[f64],
    lamps_deg: &[f64],
    bands: &[f64],
    series: &[&str],
) -> Measurement {
    let mut readings = Vec::new();
    for &lamp in lamps_deg {
        for s in 0..series.len() {
            for b in 0..bands.len() {
                for t in 0..8 {
                    for p in 0..if t == 0 { 1 } else { 12 } {
                        let (wi, wo) = (
                            direction_deg(lamp, 0.0),
                            direction_deg(f64::from(t) * 10.0, f64::from(p) * 30.0),
                        );
                        let k = readings.len() as f64;
                        let exact = model.value(wi, wo, values);
                        // Incommensurate waves: reproducible, and as good as noise for a picture.
                        let noise = 0.012 * ((k * 1.7).sin() + (k * 0.61 + 1.0).sin());
                        // The model does not know that petals send light back.
                        let retro = 0.06 * wi.dot(wo).max(0.0).powi(12);
                        readings.push(Reading {
                            wi,
                            wo,
                            series: s as u32,
                            band: b as u32,
                            bsdf_per_sr: (exact + noise + retro).max(0.0),
                            sigma_per_sr: Some(0.012),
                        });
                    }
                }
            }
        }
    }
    Measurement {
        sample: "rose petal, adaxial".into(),
        bands: bands.iter().map(|&nm| Band::nm(nm)).collect(),
        series: series.iter().map(|s| (*s).to_owned()).collect(),
        readings,
        ..Default::default()
    }
}

//! The thesis' petal: domes over a dull base, fitted without tracing rays.
//!
//! Equation, both directions above (the symbols are those of [`crate::micro::shading`]):
//!
//! ```text
//! f = f_E(kd_E, ks_E, n_E) + kd_S / pi + ks_S (n_S + 2) / (2 pi) cos^n_S(alpha)
//! ```
//!
//! f_E with all its reflections between domes comes from a table ([`crate::gonio::cell_factors`]), interpolated once per
//! reading. `terado+transmission` adds rho_ab / pi where both directions lie below, and on opposite sides the light of
//! [`super::transmission`]; `terado` alone is zero there.
//!
//! | symbol | parameter | unit | default |
//! |---|---|---|---|
//! | kd_E, ks_E | `kd_E`, `ks_E` | shares of the incident light, 0 to 1 | start at 0.2, 0.1 |
//! | n_E | `n_E` | exponent, 1 to 200 | starts at 20 |
//! | kd_S, ks_S | `kd_S`, `ks_S` | shares, 0 to 1 | start at 0.1, 0.05 |
//! | n_S | `n_S` | exponent, 0.5 to 10: without a visible highlight | starts at 2 |
//! | rho_ab | `rho_ab` | share, 0 to 1 | starts at 0.3 |
//! | shape | `height_um`, ... | those of the family of tables, within its range | start in the middle |
//!
//! Limits: those of the table. Azimuths count as differences only. kd_E + ks_E above 1, which makes light, gives finite
//! values and no more (see [`crate::gonio::cell_factors::polynomial`]). Guarded by `fitted_cells_are_the_rendered_ones`,
//! `derivatives_are_exact_for_cells`, `reciprocal_on_both_sides`. Source: the two layers are the thesis'; see
//! [`crate::micro::shading`].

use std::f64::consts::{FRAC_1_PI, TAU};
use std::sync::Arc;

use glam::DVec3;

use super::term::{PowerCosine, coefficient, each_pair, exponent, mirror};
use super::{Sum, transmission};
use crate::Result;
use crate::fit::model::{Geometry, Kind, Model, Parameter, Prepared};
use crate::gonio::cell_factors::Factors;
use crate::gonio::cell_family::CellFamily;

/// kd_E, ks_E, n_E, kd_S, ks_S, n_S.
const OWN: usize = 6;

/// The model over a family of cell shapes; a single table is a family of one.
pub struct Terado {
    family: Arc<CellFamily>,
    parameters: Vec<Parameter>,
}

impl Terado {
    /// `terado`.
    pub fn new(family: impl Into<Arc<CellFamily>>) -> Self {
        let family = family.into();
        let within = |p: Parameter, min, max| Parameter { min, max, ..p };
        let mut parameters = vec![
            coefficient("kd_E", "diffuse reflection of the domes", 0.2),
            coefficient("ks_E", "specular reflection of the domes", 0.1),
            within(exponent("n_E", "exponent of the domes' highlight", 20.0), 1.0, 200.0),
            coefficient("kd_S", "diffuse reflection of the spongy layer", 0.1),
            coefficient("ks_S", "dull reflection of the spongy layer", 0.05),
            within(exponent("n_S", "exponent of the spongy layer's lobe", 2.0), 0.5, 10.0),
        ];
        parameters.extend(family.axes().iter().map(|axis| Parameter {
            name: axis.parameter.name().into(),
            meaning: axis.parameter.meaning().into(),
            kind: Kind::Shape,
            start: 0.5 * (axis.min + axis.max),
            min: axis.min,
            max: axis.max,
            logarithmic: false,
        }));
        Self { family, parameters }
    }

    /// `terado+transmission`.
    pub fn with_transmission(family: impl Into<Arc<CellFamily>>) -> Box<dyn Model> {
        let parameters = vec![coefficient("rho_ab", "diffuse reflection of the abaxial side", 0.3)];
        let parts: Vec<Box<dyn Model>> =
            vec![Box::new(Self::new(family)), Box::new(Abaxial { parameters }), transmission::model()];
        Box::new(Sum::new("terado+transmission", parts))
    }
}

impl Model for Terado {
    fn name(&self) -> &str {
        "terado"
    }

    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn prepare(&self, geometries: &[Geometry]) -> Result<Box<dyn Prepared>> {
        let mut pairs: Vec<Vec<(DVec3, DVec3, f64)>> = vec![Vec::new(); geometries.len()];
        each_pair(geometries, |k, wi, wo, weight| {
            if wi.z > 0.0 && wo.z > 0.0 {
                pairs[k].push((wi, wo, weight));
            }
        })?;
        let readings = pairs
            .iter()
            .map(|pairs| Reading {
                domes: if pairs.is_empty() { Vec::new() } else { self.family.factors(pairs) },
                weight: pairs.iter().map(|p| p.2).sum(),
                lobe: pairs
                    .iter()
                    .filter_map(|&(wi, wo, w)| Some((w, PowerCosine::ln_cos(mirror(wi), wo)?)))
                    .collect(),
            })
            .collect();
        Ok(Box::new(At { family: self.family.clone(), readings }))
    }
}

struct Reading {
    /// Factors of every member of the family; none where the reading is not of the adaxial side.
    domes: Vec<Factors>,
    /// Share of the reading's pairs on the adaxial side.
    weight: f64,
    /// `(weight, ln cos alpha)` about the base's normal.
    lobe: Vec<(f64, f64)>,
}

struct At {
    family: Arc<CellFamily>,
    readings: Vec<Reading>,
}

impl Prepared for At {
    fn eval(&self, p: &[f64], values: &mut [f64], mut jacobian: Option<&mut [f64]>) {
        let &[kd, ks, n, kd_s, ks_s, n_s, ref shape @ ..] = p else {
            values.fill(0.0);
            return;
        };
        let members = self.family.weights(shape);
        let count = values.len();
        for (k, (reading, value)) in self.readings.iter().zip(values.iter_mut()).enumerate() {
            let mut slopes = [0.0; OWN + 2];
            let mut f = 0.0;
            for (factors, (w, dw)) in reading.domes.iter().zip(&members) {
                let domes = factors.eval(kd, ks, n);
                f += w * domes.f;
                slopes[0] += w * domes.d_kd;
                slopes[1] += w * domes.d_ks;
                slopes[2] += w * domes.d_n;
                slopes[OWN] += dw[0] * domes.f;
                slopes[OWN + 1] += dw[1] * domes.f;
            }
            slopes[3] = reading.weight * FRAC_1_PI;
            for (w, ln_cos) in &reading.lobe {
                let power = w * (n_s * ln_cos).exp() / TAU;
                slopes[4] += (n_s + 2.0) * power;
                slopes[5] += ks_s * power * (1.0 + (n_s + 2.0) * ln_cos);
            }
            *value = f + kd_s * slopes[3] + ks_s * slopes[4];
            if let Some(jacobian) = jacobian.as_deref_mut() {
                slopes.iter().take(p.len()).enumerate().for_each(|(j, s)| jacobian[j * count + k] = *s);
            }
        }
    }
}

/// rho_ab / pi below.
struct Abaxial {
    parameters: Vec<Parameter>,
}

impl Model for Abaxial {
    fn name(&self) -> &str {
        "abaxial"
    }

    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn prepare(&self, geometries: &[Geometry]) -> Result<Box<dyn Prepared>> {
        let mut shares = vec![0.0; geometries.len()];
        each_pair(geometries, |k, wi, wo, weight| {
            if wi.z < 0.0 && wo.z < 0.0 {
                shares[k] += weight * FRAC_1_PI;
            }
        })?;
        Ok(Box::new(Shares(shares)))
    }
}

/// Proportional to one coefficient.
struct Shares(Vec<f64>);

impl Prepared for Shares {
    fn eval(&self, p: &[f64], values: &mut [f64], jacobian: Option<&mut [f64]>) {
        values.iter_mut().zip(&self.0).for_each(|(v, s)| *v = p[0] * s);
        if let Some(jacobian) = jacobian {
            jacobian.copy_from_slice(&self.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::gonio::cell_factors::{AngleNodes, CellFactors, FactorSettings};
    use crate::gonio::cell_family::{Axis, ShapeParameter};
    use crate::gonio::measurement::direction_deg;
    use crate::math::Sampler;
    use crate::micro::shading::{CellPetal, Footprint, Layer};
    use crate::micro::{CellDescription, CellField};
    use crate::spectrum::SampledWavelengths;

    fn family(axes: &[Axis], points: u32) -> Arc<CellFamily> {
        let nodes = AngleNodes { thetas: 8, ratios: 6, azimuths: 7 };
        let settings = FactorSettings { points, facets: points / 32, seed: 5, first: nodes, later: nodes };
        let go = |_, _| ControlFlow::Continue(());
        Arc::new(CellFamily::compute(&CellDescription::default(), axes, &settings, &go).unwrap())
    }

    fn geometries() -> Vec<Geometry> {
        let d = direction_deg;
        let mut list: Vec<Geometry> =
            [(30.0, 10.0, 20.0), (60.0, 60.0, 0.0), (50.0, 55.0, 170.0), (10.0, 70.0, 90.0)]
                .map(|(i, o, phi)| Geometry::point(d(i, 0.0), d(o, phi)))
                .to_vec();
        // A cone that reaches over the horizon, transmission, and the abaxial side.
        list.push(Geometry {
            pairs: vec![(d(40.0, 0.0), d(86.0, 10.0), 0.4), (d(40.0, 0.0), d(91.0, 10.0), 0.6)],
        });
        list.push(Geometry::point(d(30.0, 0.0), d(150.0, 180.0)));
        list.push(Geometry::point(d(150.0, 0.0), d(120.0, 30.0)));
        list
    }

    #[test]
    fn derivatives_are_exact_for_cells() {
        let height = Axis { parameter: ShapeParameter::HeightUm, min: 20.0, max: 45.0, nodes: 3 };
        let disorder = Axis { parameter: ShapeParameter::HeightDisorder, min: 0.05, max: 0.2, nodes: 2 };
        for family in [family(&[], 256), family(&[height, disorder], 64)] {
            for model in [
                Box::new(Terado::new(family.clone())) as Box<dyn Model>,
                Terado::with_transmission(family.clone()),
            ] {
                let geometries = geometries();
                let (n, parameters) = (geometries.len(), model.parameters());
                let prepared = model.prepare(&geometries).unwrap();
                for round in 0..6 {
                    let u = |j: usize| (0.31 + 0.618 * (j + 7 * round) as f64).fract();
                    let p: Vec<f64> = parameters
                        .iter()
                        .enumerate()
                        .map(|(j, q)| {
                            if q.logarithmic {
                                q.min * (q.max / q.min).powf(0.9 * u(j) + 0.05)
                            } else {
                                q.min + (q.max - q.min) * (0.9 * u(j) + 0.05)
                            }
                        })
                        .collect();
                    let (mut values, mut jacobian) = (vec![0.0; n], vec![f64::NAN; n * p.len()]);
                    prepared.eval(&p, &mut values, Some(&mut jacobian));
                    for j in 0..p.len() {
                        let h = 1e-5 * p[j].max(1e-2);
                        let at = |x: f64| {
                            let (mut q, mut v) = (p.clone(), vec![0.0; n]);
                            q[j] = x;
                            prepared.eval(&q, &mut v, None);
                            v
                        };
                        let (low, high) = (at(p[j] - h), at(p[j] + h));
                        for k in 0..n {
                            let slope = (high[k] - low[k]) / (2.0 * h);
                            let exact = jacobian[j * n + k];
                            assert!(
                                (slope - exact).abs() < 1e-5 * (exact.abs() + 1e-3),
                                "{} {k}: {exact} {slope}",
                                parameters[j].name
                            );
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn reciprocal_on_both_sides() {
        let model = Terado::with_transmission(family(&[], 64));
        let p: Vec<f64> = model.parameters().iter().map(|q| q.start).collect();
        let swapped: Vec<Geometry> = geometries()
            .into_iter()
            .map(|g| Geometry { pairs: g.pairs.into_iter().map(|(i, o, w)| (o, i, w)).collect() })
            .collect();
        let [a, b] = [geometries(), swapped].map(|g| {
            let mut values = vec![0.0; g.len()];
            model.prepare(&g).unwrap().eval(&p, &mut values, None);
            values
        });
        for (a, b) in a.iter().zip(&b) {
            assert!((a - b).abs() <= 1e-14 * a.abs() && *a > 0.0, "{a} {b}");
        }
        assert!((a[6] - 0.3 * FRAC_1_PI).abs() < 1e-15);
    }

    /// The formula that is fitted is the petal that is rendered: both layers, all orders.
    #[test]
    fn fitted_cells_are_the_rendered_ones() {
        let cells = CellDescription::default();
        let nodes = AngleNodes { thetas: 16, ratios: 8, azimuths: 10 };
        let later = AngleNodes { thetas: 8, ratios: 5, azimuths: 6 };
        let settings = FactorSettings { points: 4096, facets: 64, seed: 5, first: nodes, later };
        let factors = CellFactors::compute(&cells, &settings, &|_, _| ControlFlow::Continue(())).unwrap();
        let model = Terado::new(CellFamily::from(factors));
        let p = [0.4, 0.1, 8.0, 0.15, 0.1, 1.5];
        let layer = |kd: f64, ks: f64, n: f64| Layer {
            diffuse: (kd as f32).into(),
            specular: (ks as f32).into(),
            exponent: n as f32,
            transmittance: 0.0.into(),
        };
        let field = Arc::new(CellField::new(&cells).unwrap());
        let petal =
            CellPetal::new(field, &layer(p[0], p[1], p[2]), &layer(p[3], p[4], p[5]), 0.0.into()).unwrap();
        let lambda = SampledWavelengths::visible(0.5);
        for (i, o, phi) in [(30.0, 10.0, 20.0), (60.0, 60.0, 0.0), (50.0, 55.0, 170.0)] {
            let geometry = Geometry::point(direction_deg(i, 0.0), direction_deg(o, phi));
            let mut value = [0.0];
            model.prepare(&[geometry]).unwrap().eval(&p, &mut value, None);
            let (turns, points) = (64, 512);
            let mean: f64 = (0..turns)
                .map(|t| {
                    let turn = 60.0 * (f64::from(t) + 0.5) / f64::from(turns);
                    let [wi, wo] = [(i, turn), (o, phi + turn)].map(|(t, p)| direction_deg(t, p).as_vec3());
                    let mut sampler = Sampler::new(9, glam::UVec2::ZERO, t);
                    f64::from(petal.estimate(wo, wi, &lambda, Footprint::WIDE, points, &mut sampler)[0])
                })
                .sum::<f64>()
                / f64::from(turns);
            assert!((value[0] / mean - 1.0).abs() < 0.03, "{i} {o} {phi}: {} {mean}", value[0]);
        }
    }
}

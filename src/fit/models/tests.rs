//! What every model in closed form must keep.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::*;
use crate::bsdf::Bsdf;
use crate::fit::{Geometry, Kind, Prepared};
use crate::gonio::measurement::direction_deg;
use crate::math::quadrature::GaussLegendre;
use crate::spectrum::SampledWavelengths;

fn all() -> Vec<Box<dyn Model>> {
    CLOSED_FORM.iter().chain(CLOSED_FORM_TRANSMITTING).map(|n| by_name(n).expect(n)).collect()
}

/// Parameters at a share of the way between their bounds; exponents and roughness in the logarithm.
fn between(model: &dyn Model, share: impl Fn(usize) -> f64) -> Vec<f64> {
    let value = |(j, p): (usize, &crate::fit::Parameter)| {
        if p.logarithmic {
            p.min * (p.max / p.min).powf(share(j))
        } else {
            p.min + (p.max - p.min) * share(j)
        }
    };
    model.parameters().iter().enumerate().map(value).collect()
}

fn value(model: &dyn Model, wi: DVec3, wo: DVec3, p: &[f64]) -> f64 {
    let mut v = [0.0];
    model.prepare(&[Geometry::point(wi, wo)]).unwrap().eval(p, &mut v, None);
    v[0]
}

/// Directions all over the sphere, some on special places.
fn directions() -> Vec<DVec3> {
    let mut all: Vec<DVec3> = (0..40)
        .map(|i| {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 40.0;
            direction_deg(z.acos().to_degrees(), 137.5 * f64::from(i))
        })
        .collect();
    all.extend(
        [(0.0, 0.0), (180.0, 0.0), (45.0, 0.0), (45.0, 180.0), (135.0, 0.0)]
            .map(|(t, p)| direction_deg(t, p)),
    );
    all
}

fn everywhere() -> Vec<Geometry> {
    let d = directions();
    d.iter().flat_map(|&a| d.iter().map(move |&b| Geometry::point(a, b))).collect()
}

/// Share of the light from `wi` that leaves, on both sides.
fn albedo(model: &dyn Model, wi: DVec3, p: &[f64], (thetas, phis): (usize, usize)) -> f64 {
    let rule = GaussLegendre::new(thetas);
    let mut geometry = Geometry { pairs: Vec::new() };
    for (s2, weight) in rule.on(0.0, 1.0) {
        let (s, c) = (s2.sqrt(), (1.0 - s2).sqrt());
        for k in 0..phis {
            let (sin, cos) = (TAU * (k as f64 + 0.5) / phis as f64).sin_cos();
            for z in [c, -c] {
                geometry.pairs.push((wi, DVec3::new(s * cos, s * sin, z), PI * weight / phis as f64));
            }
        }
    }
    let mut v = [0.0];
    model.prepare(&[geometry]).unwrap().eval(p, &mut v, None);
    v[0]
}

#[test]
fn names_are_found_and_parameters_are_sound() {
    assert!(by_name("lambert + phong").is_none());
    for model in all() {
        let p = model.parameters();
        for (j, a) in p.iter().enumerate() {
            assert!(p[..j].iter().all(|b| a.name != b.name), "{}: {}", model.name(), a.name);
            assert!(a.min < a.start && a.start < a.max, "{}: {a:?}", model.name());
            assert!(a.kind == Kind::Shape || (a.min, a.max) == (0.0, 1.0), "{}: {a:?}", model.name());
            assert!(!a.logarithmic || a.min > 0.0, "{}: {a:?}", model.name());
        }
    }
    let names = |m: &str| -> Vec<String> {
        by_name(m).unwrap().parameters().iter().map(|p| p.name.clone()).collect()
    };
    assert_eq!(names("retro"), ["kd", "ks", "n", "kr", "n_r"]);
    assert_eq!(names("retro_beckmann"), ["kd", "ks", "m", "kr", "m_r"]);
    assert_eq!(names("lambert+transmission"), ["kd", "t", "td", "m_d", "ti", "m_i"]);
}

#[test]
fn derivatives_are_exact() {
    let geometries = everywhere();
    let n = geometries.len();
    for model in all() {
        let prepared = model.prepare(&geometries).unwrap();
        for share in [0.15, 0.4, 0.75] {
            let p = between(&*model, |j| (share + 0.07 * j as f64) % 1.0);
            let (mut v, mut jacobian) = (vec![0.0; n], vec![0.0; n * p.len()]);
            prepared.eval(&p, &mut v, Some(&mut jacobian));
            for j in 0..p.len() {
                let at = |h: f64| {
                    let (mut q, mut v) = (p.clone(), vec![0.0; n]);
                    q[j] += h;
                    prepared.eval(&q, &mut v, None);
                    v
                };
                let h = 1e-5 * p[j];
                let (above, below) = (at(h), at(-h));
                for k in 0..n {
                    // A clamp has no derivative at its kink.
                    if above[k].min(below[k]) == 0.0 {
                        continue;
                    }
                    let numeric = (above[k] - below[k]) / (2.0 * h);
                    let d = jacobian[j * n + k];
                    let error = (d - numeric).abs();
                    let scale = d.abs() + 1e-4 * v[k] / p[j];
                    assert!(
                        error <= 1e-5 * scale + 1e-12,
                        "{} d/d {} at {p:?}, {:?}: {d} {numeric}",
                        model.name(),
                        model.parameters()[j].name,
                        geometries[k]
                    );
                }
            }
        }
    }
}

#[test]
fn models_are_reciprocal() {
    let d = directions();
    for model in all() {
        let p = between(&*model, |j| 0.3 + 0.08 * j as f64);
        for &a in &d {
            for &b in &d {
                let (there, back) = (value(&*model, a, b, &p), value(&*model, b, a, &p));
                assert!(there >= 0.0 && (there - back).abs() <= 1e-11 * there, "{}: {a} {b}", model.name());
            }
        }
    }
}

#[test]
fn both_sides_of_the_sheet_are_alike() {
    let d = directions();
    for model in all() {
        let p = between(&*model, |j| 0.6 - 0.08 * j as f64);
        for &a in &d {
            for &b in &d {
                let under = |w: DVec3| w.with_z(-w.z);
                let (f, g) = (value(&*model, a, b, &p), value(&*model, under(a), under(b), &p));
                assert!((f - g).abs() <= 1e-11 * f, "{}: {a} {b}: {f} {g}", model.name());
            }
        }
    }
}

#[test]
fn models_are_finite_at_the_horizon_and_at_bounds() {
    let mut edge = directions();
    for cos in [1e-3, 1e-6, 1e-9, 6e-17, 0.0] {
        for (x, y, side) in [(1.0, 0.0, 1.0), (-1.0, 0.0, 1.0), (0.0, 1.0, -1.0), (1.0, 0.0, -1.0)] {
            edge.push(DVec3::new(x, y, side * cos).normalize());
        }
    }
    let geometries: Vec<Geometry> =
        edge.iter().flat_map(|&a| edge.iter().map(move |&b| Geometry::point(a, b))).collect();
    let n = geometries.len();
    for model in all() {
        let prepared = model.prepare(&geometries).unwrap();
        let parameters = model.parameters().len();
        for corner in 0..1usize << parameters {
            let p = between(&*model, |j| ((corner >> j) & 1) as f64);
            let (mut v, mut jacobian) = (vec![f64::NAN; n], vec![f64::NAN; n * parameters]);
            prepared.eval(&p, &mut v, Some(&mut jacobian));
            let bad = v.iter().position(|v| !(v.is_finite() && *v >= 0.0));
            assert!(bad.is_none(), "{} {p:?} {:?}", model.name(), bad.map(|k| &geometries[k]));
            let bad = jacobian.iter().position(|d| !d.is_finite());
            assert!(bad.is_none(), "{} {p:?} {:?}", model.name(), bad.map(|k| &geometries[k % n]));
        }
    }
}

#[test]
fn coefficients_are_shares_at_normal_incidence() {
    let near = |name: &str, p: &[f64], expected: f64, tolerance: f64| {
        for wi in [DVec3::Z, -DVec3::Z] {
            let a = albedo(&*by_name(name).unwrap(), wi, p, (400, 4));
            assert!((a - expected).abs() < tolerance, "{name} {p:?}: {a}");
        }
    };
    near("lambert", &[0.37], 0.37, 1e-12);
    for n in [0.1, 1.0, 7.5, 40.0, 900.0] {
        near("phong", &[0.4, n], 0.4, 1e-4);
        near("blinn", &[0.2, 0.4, n], 0.6, 1e-4);
        near("retro", &[0.2, 0.4, n, 0.1, 2.0 * n], 0.7, 1e-4);
        near("lambert+transmission", &[0.3, 0.1, 0.2, n, 0.15, 3.0 * n], 0.75, 1e-4);
    }
    near("retro_beckmann", &[0.2, 0.4, 0.05, 0.1, 0.05], 0.7, 2e-3);
}

#[test]
fn lobes_make_no_light() {
    for (name, coefficients) in [
        ("phong", &[0][..]),
        ("blinn", &[1]),
        ("ggx+lambert", &[1]),
        ("retro", &[1]),
        ("retro", &[3]),
        ("retro_beckmann", &[1]),
        ("retro_beckmann", &[3]),
        ("transmission", &[1]),
        ("transmission", &[3]),
    ] {
        let model = by_name(name).unwrap();
        for share in [0.0, 0.15, 0.3, 0.45, 0.6, 1.0] {
            let mut p = between(&*model, |_| share);
            for (p, parameter) in p.iter_mut().zip(model.parameters()) {
                // The smoothest lobes that this quadrature resolves.
                *p = match (parameter.kind, parameter.logarithmic) {
                    (Kind::Coefficient, _) | (Kind::Shape, false) => 0.0,
                    (Kind::Shape, true) => p.clamp(if parameter.max > 1.0 { 0.0 } else { 0.08 }, 400.0),
                };
            }
            coefficients.iter().for_each(|&c| p[c] = 1.0);
            let normal = albedo(&*model, DVec3::Z, &p, (96, 192));
            for theta_deg in [0.0, 20.0, 50.0, 70.0, 85.0] {
                let a = albedo(&*model, direction_deg(theta_deg, 11.0), &p, (96, 192));
                assert!(a <= 1.0 + 2e-3, "{name} {p:?} at {theta_deg} deg: {a}");
                let is_power = ["phong", "blinn", "retro", "transmission"].contains(&name);
                assert!(!is_power || a <= normal + 2e-3, "{name} {p:?} at {theta_deg} deg: {a} {normal}");
            }
        }
    }
}

#[test]
fn oren_nayar_returns_what_its_formula_says() {
    let model = by_name("oren_nayar").unwrap();
    for (kd, sigma_deg) in [(0.3, 0.0), (0.9, 20.0), (1.0, 45.0), (1.0, 60.0)] {
        let s = f64::to_radians(sigma_deg).powi(2);
        let expected = kd * (1.0 - 0.5 * s / (s + 0.33) + 0.17 * kd * s / (s + 0.13));
        let a = albedo(&*model, DVec3::Z, &[kd, sigma_deg], (32, 64));
        assert!((a - expected).abs() < 1e-9, "{kd} {sigma_deg}: {a} {expected}");
    }
    let lambert = by_name("lambert").unwrap();
    let (a, b) = (direction_deg(60.0, 0.0), direction_deg(70.0, 100.0));
    assert!((value(&*model, a, b, &[0.4, 0.0]) - value(&*lambert, a, b, &[0.4])).abs() < 1e-15);
    // Rough and diffuse: more light back to the lamp than on.
    let back = value(&*model, a, direction_deg(60.0, 0.0), &[0.4, 30.0]);
    let on = value(&*model, a, direction_deg(60.0, 180.0), &[0.4, 30.0]);
    assert!(back > 1.5 * on, "{back} {on}");
    // Published formula by hand, all terms alive: a = 60 deg, b = 40 deg, phi = 120 deg, sigma = 30 deg, kd = 0.5.
    let f = value(&*model, direction_deg(60.0, 0.0), direction_deg(40.0, 120.0), &[0.5, 30.0]);
    let s = (PI / 6.0).powi(2);
    let (a, b) = (PI / 3.0, 2.0 * PI / 9.0);
    let c2 = 0.45 * s / (s + 0.09) * (a.sin() - (2.0 * b / PI).powi(3));
    let c3 = 0.125 * s / (s + 0.09) * (4.0 * a * b / (PI * PI)).powi(2);
    let l1 = 1.0 - 0.5 * s / (s + 0.33) - 0.5 * c2 * b.tan() + 0.5 * c3 * ((a + b) / 2.0).tan();
    let l2 = 0.17 * s / (s + 0.13) * (1.0 + 0.5 * (2.0 * b / PI).powi(2));
    assert!((f - (0.5 * l1 + 0.25 * l2) / PI).abs() < 1e-14, "{f}");
}

#[test]
fn half_vector_lobes_are_narrow_across_the_plane() {
    let (phong, blinn) = (by_name("phong").unwrap(), by_name("blinn").unwrap());
    let wi = direction_deg(75.0, 0.0);
    // A quarter of the exponent makes both lobes alike at normal incidence.
    let ratio = |across: f64, along: f64, f: &dyn Fn(DVec3) -> f64| {
        f(direction_deg(75.0, 180.0 + across)) / f(direction_deg(75.0 - along, 180.0))
    };
    let angle = 10f64;
    // The azimuth that turns a direction at 75 deg by ten degrees.
    let across = 2.0 * ((angle / 2.0).to_radians().sin() / 75f64.to_radians().sin()).asin().to_degrees();
    let p = ratio(across, angle, &|wo| value(&*phong, wi, wo, &[0.5, 40.0]));
    let b = ratio(across, angle, &|wo| value(&*blinn, wi, wo, &[0.0, 0.5, 160.0]));
    assert!((p - 1.0).abs() < 1e-9 && b < 0.05, "{p} {b}");
}

#[test]
fn retro_lobes_are_mirror_lobes_turned() {
    let turned = |w: DVec3| DVec3::new(-w.x, -w.y, w.z);
    for (name, shape) in [("retro", 30.0), ("retro_beckmann", 0.2)] {
        let model = by_name(name).unwrap();
        for &a in &directions() {
            for &b in &directions() {
                let retro = value(&*model, a, b, &[0.0, 0.0, shape, 0.3, shape]);
                let mirror = value(&*model, turned(a), b, &[0.0, 0.3, shape, 0.0, shape]);
                assert!((retro - mirror).abs() <= 1e-12 * mirror, "{name} {a} {b}");
            }
        }
        let lamp = direction_deg(50.0, 20.0);
        let p = [0.0, 0.0, shape, 0.3, shape];
        let back = value(&*model, lamp, lamp, &p);
        assert!(back > 100.0 * value(&*model, lamp, direction_deg(50.0, 200.0), &p), "{name}");
    }
}

#[test]
fn fitted_formulas_are_the_rendered_ones() {
    let lambda = SampledWavelengths::visible(0.5);
    let model = by_name("lambert+phong").unwrap();
    for (kd, ks, n) in [(0.3, 0.5, 2.0), (0.1, 0.2, 40.0), (0.0, 1.0, 700.0)] {
        let phong = crate::bsdf::Phong::new((kd as f32).into(), (ks as f32).into(), n as f32).unwrap();
        let lambert = crate::bsdf::Lambert::new((kd as f32).into()).unwrap();
        for &a in &directions() {
            for &b in &directions() {
                let rendered = |m: &dyn Bsdf| f64::from(m.eval(a.as_vec3(), b.as_vec3(), &lambda)[0]);
                let f = value(&*model, a, b, &[kd, ks, n]);
                let (r, d) = (rendered(&phong), rendered(&lambert));
                assert!((f - r).abs() < 2e-4 * f.max(1e-2), "{a} {b}: {f} {r}");
                let f = value(&*by_name("lambert").unwrap(), a, b, &[kd]);
                assert!((f - d).abs() < 1e-6, "{a} {b}: {f} {d}");
            }
        }
    }
}

#[test]
fn fitted_transmission_is_the_rendered_one() {
    use crate::micro::transmission::{TransmissionLobe, Way};
    let lambda = SampledWavelengths::visible(0.5);
    let model = by_name("transmission").unwrap();
    for (td, m_d, ti, m_i) in [(0.3, 2.0, 0.0, 1.0), (0.0, 1.0, 0.2, 9.0), (0.1, 200.0, 0.4, 0.5)] {
        let direct = TransmissionLobe::new(Way::Direct, (td as f32).into(), m_d as f32).unwrap();
        let indirect = TransmissionLobe::new(Way::Indirect, (ti as f32).into(), m_i as f32).unwrap();
        for &a in &directions() {
            for &b in &directions() {
                let (wi, wo) = (a.as_vec3(), b.as_vec3());
                let r = f64::from((direct.eval(wo, wi, &lambda) + indirect.eval(wo, wi, &lambda))[0]);
                let f = value(&*model, a, b, &[0.0, td, m_d, ti, m_i]);
                assert!((f - r).abs() < 2e-4 * f.max(1e-2), "{a} {b}: {f} {r}");
            }
        }
    }
}

#[test]
fn a_cone_is_the_weighted_mean_of_its_directions() {
    let (wi, a, b) = (direction_deg(30.0, 0.0), direction_deg(25.0, 170.0), direction_deg(40.0, 190.0));
    let cone = Geometry { pairs: vec![(wi, a, 0.25), (wi, b, 0.75)] };
    for model in all() {
        let p = between(&*model, |_| 0.4);
        let mut v = [0.0];
        model.prepare(std::slice::from_ref(&cone)).unwrap().eval(&p, &mut v, None);
        let expected = 0.25 * value(&*model, wi, a, &p) + 0.75 * value(&*model, wi, b, &p);
        assert!((v[0] - expected).abs() < 1e-14, "{}", model.name());
    }
}

#[test]
fn directions_that_are_none_are_errors() {
    for model in all() {
        for bad in [DVec3::ZERO, DVec3::splat(1.0), DVec3::new(f64::NAN, 0.0, 1.0), DVec3::X * f64::INFINITY]
        {
            let prepared: crate::Result<Box<dyn Prepared>> = model.prepare(&[Geometry::point(DVec3::Z, bad)]);
            assert!(prepared.is_err(), "{}: {bad}", model.name());
        }
    }
}

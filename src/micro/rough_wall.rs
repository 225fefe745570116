//! A rough cell wall: light at the striations of a cuticle, with nothing lost.
//!
//! Model: a random walk on a microsurface of facets with Gaussian slopes (Beckmann) and Smith's masking, whose facets are
//! [`Wall`]s; light is followed from facet to facet, above and below the surface, until it escapes:
//!
//! ```text
//! P(slopes p, q)  = exp(-(p^2 + q^2) / alpha^2) / (pi alpha^2)
//! Lambda(w)       = (exp(-a^2) / (a sqrt(pi)) - erfc(a)) / 2,  a = 1 / (alpha tan theta);   Lambda(-w) = -1 - Lambda(w)
//! P(w escapes)    = c^Lambda(w)                  c: share of the microsurface that is lower than the light, 0 to 1
//! c' at a facet   = c (1 - U)^(-1 / Lambda(w))   U uniform; c' > 1: it escaped
//! P_w(facet m)    = max(w.m, 0) P(m) / projected area of all facets that w sees
//! ```
//!
//! Written in c in place of heights, the distribution of heights drops out. Below the surface the same walk runs with
//! the surface turned over (c becomes 1 - c). Each facet reflects or refracts by chance, so the walk's weight
//! stays 1: R + T = 1 whatever the roughness.
//!
//! | symbol | argument | unit | default |
//! |---|---|---|---|
//! | alpha | `alpha` (root mean square slope times sqrt 2) | | 0: smooth |
//! | d | `local_d`, z the normal on the outer side | | |
//!
//! Limits: striations wider than the wavelength (no diffraction); isotropic; a facet's neighbours are independent of it (Smith);
//! walks of more than [`MAX_FACETS`] facets leave as they then travel, turned to the side of the surface they are on
//! (`few_walks_are_long`). Guarded by `single_reflection_is_the_microfacet_brdf`,
//! `single_refraction_is_the_microfacet_btdf`, `rough_walls_are_reciprocal`, `vanishing_roughness_is_smooth`.
//! Source: Heitz, Hanika, d'Eon, Dachsbacher 2016, "Multiple-scattering microfacet BSDFs with the Smith model", SIGGRAPH;
//! the drawing of visible slopes is our own.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use super::wall::Wall;
use crate::math::Stream;

/// Facets that a walk meets at most.
pub const MAX_FACETS: u32 = 64;

/// Light at a rough wall. `local_d` is the direction of travel (unit) in a frame whose z is the wall's normal on the outer
/// side: z < 0 comes from outside. Returns the new direction of travel: z > 0 leaves outward.
pub fn scatter(local_d: DVec3, alpha: f64, wall: &Wall, stream: &mut Stream) -> DVec3 {
    walk(local_d, alpha, wall, stream).0
}

/// [`scatter`], and how many facets the light met.
fn walk(local_d: DVec3, alpha: f64, wall: &Wall, stream: &mut Stream) -> (DVec3, u32) {
    // The frame follows the light: +z is the side on which it is.
    let mut outside = local_d.z < 0.0;
    let mut d = if outside { local_d } else { turn(local_d) };
    if alpha <= 0.0 {
        let (on, crossed) = at_facet(d, DVec3::Z, wall, outside, stream);
        return (if outside { on } else { turn(on) }, 1 + u32::from(crossed));
    }
    let mut c = 1.0;
    for facets in 0..MAX_FACETS {
        match next_facet(d, alpha, c, stream) {
            None => return (if outside { d } else { turn(d) }, facets),
            Some(next) => c = next,
        }
        let facet = visible_facet(-d, alpha, stream);
        let (on, crossed) = at_facet(d, facet, wall, outside, stream);
        d = on;
        if crossed {
            outside = !outside;
            d = turn(d);
            c = 1.0 - c;
        }
    }
    d.z = d.z.abs();
    (if outside { d } else { turn(d) }, MAX_FACETS)
}

/// Turns the surface over.
fn turn(d: DVec3) -> DVec3 {
    -d
}

/// Light along `d` meets a facet whose unit normal is on its side: its new direction, and whether it crossed the wall.
fn at_facet(d: DVec3, normal: DVec3, wall: &Wall, outside: bool, stream: &mut Stream) -> (DVec3, bool) {
    let cos = -d.dot(normal);
    let meeting = wall.meet(cos.min(1.0), outside);
    if stream.next() < meeting.reflectance {
        return ((d + normal * (2.0 * cos)).normalize(), false);
    }
    let along = d + normal * cos;
    ((along * meeting.index_ratio - normal * meeting.cos_through).normalize(), true)
}

/// Where light that travels along `d` from level `c` meets the next facet; None where it escapes.
fn next_facet(d: DVec3, alpha: f64, c: f64, stream: &mut Stream) -> Option<f64> {
    let u = 1.0 - stream.next();
    // d rises: masked with a chance; it falls: hits for sure, Lambda(d) = -1 - Lambda(-d).
    let smith = lambda(cot_over_alpha(d.z.abs(), d, alpha));
    if d.z > 0.0 {
        let next = c / u.powf(1.0 / smith);
        (next < 1.0).then_some(next)
    } else {
        Some(c * u.powf(1.0 / (1.0 + smith)))
    }
}

/// `cos / (alpha sin)`.
fn cot_over_alpha(cos: f64, d: DVec3, alpha: f64) -> f64 {
    cos / (alpha * d.x.hypot(d.y))
}

/// Smith's Lambda of a direction above the surface; a may be infinite.
fn lambda(a: f64) -> f64 {
    if a > 6.0 {
        return 0.0;
    }
    // erfc(a) exp(a^2) of Abramowitz and Stegun 7.1.26, absolute error of erfc below 1.5e-7.
    let t = 1.0 / (1.0 + 0.327_591_1 * a);
    let scaled = t
        * (0.254_829_592
            + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    (0.5 * (-a * a).exp() * (1.0 / (a * PI.sqrt()) - scaled)).max(0.0)
}

/// Draws the unit normal of a facet that the direction `w` sees, in proportion to the area that it sees of it.
fn visible_facet(w: DVec3, alpha: f64, stream: &mut Stream) -> DVec3 {
    let sin = w.x.hypot(w.y);
    let along = if sin > 0.0 { DVec2::new(w.x, w.y) / sin } else { DVec2::X };
    // Slopes in units of alpha. Across w they are Gaussian of variance 1/2.
    let p = visible_slope(cot_over_alpha(w.z, w, alpha), stream);
    let q = gaussian(stream);
    let slope = (along * p + along.perp() * q) * alpha;
    DVec3::new(-slope.x, -slope.y, 1.0).normalize()
}

/// Gaussian of variance 1/2 (Box and Muller).
fn gaussian(stream: &mut Stream) -> f64 {
    stream.exponential().sqrt() * (TAU * stream.next()).cos()
}

/// A slope p of density proportional to `max(t - p, 0) exp(-p^2)`, by rejection; t may be infinite.
fn visible_slope(t: f64, stream: &mut Stream) -> f64 {
    if t >= 0.0 {
        // t exp(-p^2) of all p, of which those above zero are kept with probability 1 - p/t, and -p exp(-p^2) of p < 0.
        let whole = t * PI.sqrt();
        loop {
            if t.is_finite() && stream.next() * (whole + 0.5) >= whole {
                return -stream.exponential().sqrt();
            }
            let p = gaussian(stream);
            if p <= 0.0 || stream.next() * t < t - p || t.is_infinite() {
                return p;
            }
        }
    }
    // (y - s) exp(-y^2) of y = -p > s = -t.
    let s = -t;
    if s < 1.0 {
        loop {
            // y exp(-y^2) beyond s, kept with 1 - s/y.
            let y = (s * s + stream.exponential()).sqrt();
            if stream.next() * y < y - s {
                return -y;
            }
        }
    }
    loop {
        // With z = y - s: z exp(-2 s z) exp(-z^2), a gamma variate kept with the last factor.
        let z = (stream.exponential() + stream.exponential()) / (2.0 * s);
        if stream.next() < (-z * z).exp() {
            return -(s + z);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::special::{erfc, ln_gamma};
    use crate::math::stats::chi_square_test;

    const PETAL: Wall = Wall { outer_index: 1.0, wall_index: 1.425, inner_index: 1.35 };
    /// One face, strong refraction.
    const GLASS: Wall = Wall { outer_index: 1.0, wall_index: 1.5, inner_index: 1.5 };

    fn towards(theta_deg: f64) -> DVec3 {
        let t = theta_deg.to_radians();
        DVec3::new(t.sin(), 0.0, -t.cos())
    }

    fn smith(w: DVec3, alpha: f64) -> f64 {
        let a = w.z.abs() / (alpha * w.x.hypot(w.y));
        0.5 * ((-a * a).exp() / (a * PI.sqrt()) - erfc(a))
    }

    fn facets_density(h: DVec3, alpha: f64) -> f64 {
        let slope2 = (h.x * h.x + h.y * h.y) / (h.z * h.z);
        (-slope2 / (alpha * alpha)).exp() / (PI * alpha * alpha * h.z.powi(4))
    }

    /// Counts directions of one hemisphere in bins equal in cos and azimuth, and integrates a density over them.
    fn compare(drawn: &[DVec3], walks: usize, sign: f64, density: impl Fn(DVec3) -> f64) -> f64 {
        let (rows, columns, fine) = (24, 12, 10);
        let mut observed = vec![0.0; rows * columns + 1];
        let mut expected = vec![0.0; rows * columns + 1];
        for w in drawn {
            let row = ((w.z * sign * rows as f64) as usize).min(rows - 1);
            let column = ((w.y.atan2(w.x).abs() / PI * columns as f64) as usize).min(columns - 1);
            observed[row * columns + column] += 1.0;
        }
        for i in 0..rows * fine {
            for j in 0..columns * fine {
                let z = (i as f64 + 0.5) / (rows * fine) as f64;
                let phi = (j as f64 + 0.5) / (columns * fine) as f64 * PI;
                let sin = (1.0 - z * z).sqrt();
                let w = DVec3::new(sin * phi.cos(), sin * phi.sin(), z * sign);
                // Both halves of the azimuth.
                let solid_angle = TAU / (rows * columns * fine * fine) as f64;
                expected[i / fine * columns + j / fine] += walks as f64 * density(w) * solid_angle;
            }
        }
        let (last, n) = (rows * columns, walks as f64);
        observed[last] = n - observed.iter().sum::<f64>();
        expected[last] = n - expected.iter().sum::<f64>();
        chi_square_test(&observed, &expected, 10.0).p_value
    }

    fn once(wall: &Wall, alpha: f64, d: DVec3, walks: usize, seed: u64) -> [Vec<DVec3>; 2] {
        let mut of = [Vec::new(), Vec::new()];
        let mut stream = Stream::new(seed, 7, 0);
        for _ in 0..walks {
            let (w, facets) = walk(d, alpha, wall, &mut stream);
            if facets == 1 {
                of[usize::from(w.z < 0.0)].push(w);
            }
        }
        of
    }

    #[test]
    fn single_reflection_is_the_microfacet_brdf() {
        let walks = 400_000;
        for (alpha, theta, seed) in [(0.2, 30.0, 1), (0.4, 60.0, 2), (0.7, 75.0, 3)] {
            let d = towards(theta);
            let [up, _] = once(&PETAL, alpha, d, walks, seed);
            let p = compare(&up, walks, 1.0, |o| {
                let i = -d;
                let h = (i + o).normalize();
                let masking = 1.0 / (1.0 + smith(i, alpha) + smith(o, alpha));
                PETAL.meet(i.dot(h), true).reflectance * facets_density(h, alpha) * masking / (4.0 * i.z)
            });
            assert!(p > 1e-3, "alpha {alpha} at {theta}: p {p:.1e}");
        }
    }

    #[test]
    fn single_refraction_is_the_microfacet_btdf() {
        let walks = 400_000;
        for (alpha, theta, seed) in [(0.2, 30.0, 1), (0.4, 60.0, 2), (0.7, 75.0, 3)] {
            let d = towards(theta);
            let [_, down] = once(&GLASS, alpha, d, walks, seed);
            let p = compare(&down, walks, -1.0, |o| {
                let i = -d;
                let h = -(i + o * GLASS.inner_index).normalize();
                let (ih, oh) = (i.dot(h), o.dot(h));
                if ih <= 0.0 || oh >= 0.0 || h.z <= 0.0 {
                    return 0.0;
                }
                // Beta(1 + Lambda_i, 1 + Lambda_o).
                let (a, b) = (1.0 + smith(i, alpha), 1.0 + smith(o, alpha));
                let masking = (ln_gamma(a) + ln_gamma(b) - ln_gamma(a + b)).exp();
                let jacobian = GLASS.inner_index.powi(2) * oh.abs() / (ih + GLASS.inner_index * oh).powi(2);
                (1.0 - GLASS.meet(ih, true).reflectance) * facets_density(h, alpha) * masking * ih * jacobian
                    / i.z
            });
            assert!(p > 1e-3, "alpha {alpha} at {theta}: p {p:.1e}");
        }
    }

    const BINS: usize = 5;
    const AZIMUTHS: usize = 3;

    /// Lambertian light on one side: counts per (bin in, bin out, azimuth between) of what it does.
    fn lambertian(wall: &Wall, alpha: f64, inside: bool, walks: u32) -> [Vec<f64>; 2] {
        let mut stream = Stream::new(11, u64::from(inside), 0);
        let mut counts = [vec![0.0; BINS * BINS * AZIMUTHS], vec![0.0; BINS * BINS * AZIMUTHS]];
        // Bins equal in sin^2, so Lambertian light fills them evenly.
        let bin = |z: f64| (((1.0 - z * z) * BINS as f64) as usize).min(BINS - 1);
        for _ in 0..walks {
            let sin2 = stream.next();
            let z = (1.0 - sin2).sqrt();
            let d = DVec3::new(sin2.sqrt(), 0.0, if inside { z } else { -z });
            let o = scatter(d, alpha, wall, &mut stream);
            assert!((o.length() - 1.0).abs() < 1e-9 && o.z != 0.0, "{o}");
            let azimuth = ((o.y.atan2(o.x).abs() / PI * AZIMUTHS as f64) as usize).min(AZIMUTHS - 1);
            let through = usize::from((o.z < 0.0) != inside);
            counts[through][(bin(z) * BINS + bin(o.z)) * AZIMUTHS + azimuth] += 1.0;
        }
        counts
    }

    fn p_value_of_transposed(a: &[f64], b: &[f64], half: bool) -> f64 {
        let (mut statistic, mut freedom) = (0.0, 0.0);
        for i in 0..BINS {
            for j in if half { i + 1 } else { 0 }..BINS {
                for k in 0..AZIMUTHS {
                    let (x, y) = (a[(i * BINS + j) * AZIMUTHS + k], b[(j * BINS + i) * AZIMUTHS + k]);
                    if x + y > 10.0 {
                        statistic += (x - y) * (x - y) / (x + y);
                        freedom += 1.0;
                    }
                }
            }
        }
        assert!(freedom > 12.0, "{freedom}");
        crate::math::special::gamma_q(freedom / 2.0, statistic / 2.0)
    }

    #[test]
    fn rough_walls_are_reciprocal() {
        for alpha in [0.3, 1.0] {
            let walks = 300_000;
            let [reflected, down] = lambertian(&GLASS, alpha, false, walks);
            // n^2: as bright a light from within carries more of it.
            let more = (f64::from(walks) * GLASS.inner_index.powi(2)).round() as u32;
            let [within, up] = lambertian(&GLASS, alpha, true, more);
            for (what, p) in [
                ("reflection outside", p_value_of_transposed(&reflected, &reflected, true)),
                ("reflection within", p_value_of_transposed(&within, &within, true)),
                ("transmission", p_value_of_transposed(&down, &up, false)),
            ] {
                assert!(p > 1e-3, "alpha {alpha}, {what}: p {p:.1e}");
            }
        }
    }

    #[test]
    fn vanishing_roughness_is_smooth() {
        for theta in [0.0, 40.0, 75.0, 140.0, 170.0] {
            let (d, walks) = (towards(theta), 40_000);
            let meeting = PETAL.meet(d.z.abs(), d.z < 0.0);
            let mut stream = Stream::new(3, 0, 0);
            for alpha in [0.0, 1e-4] {
                let mut reflected = 0.0;
                for _ in 0..walks {
                    let o = scatter(d, alpha, &PETAL, &mut stream);
                    let through = o.z * d.z > 0.0;
                    reflected += f64::from(u8::from(!through));
                    let ideal = if through {
                        DVec3::new(d.x * meeting.index_ratio, 0.0, meeting.cos_through * d.z.signum())
                    } else {
                        d.with_z(-d.z)
                    };
                    assert!((o - ideal).length() < 0.01, "{o} {ideal}");
                }
                let (share, expected) = (reflected / f64::from(walks), meeting.reflectance);
                let sigma = (expected * (1.0 - expected) / f64::from(walks)).sqrt();
                assert!((share - expected).abs() < 4.0 * sigma + 1e-4, "{theta}: {share} {expected}");
            }
        }
    }

    #[test]
    fn few_walks_are_long() {
        let mut stream = Stream::new(5, 0, 0);
        let walks = 200_000;
        for (theta, bound) in [(0.0, 1e-4), (60.0, 1e-4), (89.0, 1e-4), (100.0, 1e-3), (150.0, 1e-4)] {
            let mut long = 0.0;
            for _ in 0..walks {
                let (d, facets) = walk(towards(theta), 1.0, &PETAL, &mut stream);
                assert!((d.length() - 1.0).abs() < 1e-9);
                long += f64::from(u8::from(facets == MAX_FACETS));
            }
            assert!(long / f64::from(walks) < bound, "{theta}: {long}");
        }
    }
}

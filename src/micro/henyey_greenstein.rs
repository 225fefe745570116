//! The angle by which a turbid medium turns light.
//!
//! Model: p(cos) = (1 - g^2) / (2 (1 + g^2 - 2 g cos)^(3/2)), all azimuths alike; g = mean cosine, -1 to 1. Drawn by its
//! inverse. Guarded by `mean_cosines_are_legendre`. Source: Henyey and Greenstein 1941, Astrophysical Journal 93:70.

use std::f64::consts::TAU;

use glam::DVec3;

use crate::math::Stream;

/// A direction after light that travels along `d` turned once; `g` within -1 to 1.
pub(super) fn turn(d: DVec3, g: f64, stream: &mut Stream) -> DVec3 {
    let u = stream.next();
    let cos = if g.abs() < 1e-3 {
        // To first order in g, where the inverse loses its digits.
        2.0 * u - 1.0 + 6.0 * g * u * (1.0 - u)
    } else {
        let s = (1.0 - g * g) / (1.0 - g + 2.0 * g * u);
        (1.0 + g * g - s * s) / (2.0 * g)
    };
    let cos = cos.clamp(-1.0, 1.0);
    let sin = (1.0 - cos * cos).sqrt();
    let (s, c) = (TAU * stream.next()).sin_cos();
    let (a, b) = d.any_orthonormal_pair();
    (a * (sin * c) + b * (sin * s) + d * cos).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_cosines_are_legendre() {
        // The moments of Henyey and Greenstein's distribution over Legendre's polynomials are g and g^2.
        for g in [-0.7, 0.0, 5e-4, 0.3, 0.9] {
            let d = DVec3::new(0.6, 0.0, -0.8);
            let n = 200_000;
            let (mut first, mut second) = (0.0, 0.0);
            for i in 0..n {
                let c = turn(d, g, &mut Stream::new(1, 0, i)).dot(d);
                first += c / n as f64;
                second += (1.5 * c * c - 0.5) / n as f64;
            }
            let limit = 4.0 / (n as f64).sqrt();
            assert!((first - g).abs() < limit && (second - g * g).abs() < limit, "{g}: {first} {second}");
        }
    }
}

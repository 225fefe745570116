//! Warps from the unit square to discs, hemispheres, cones and triangles, each with its density and inverse.
//!
//! Densities are per solid angle (1/sr) on directions, per area on discs and triangles. Each warp is area
//! preserving and continuous almost everywhere, so that stratification survives. Guarded by
//! `warps_invert` and `densities_integrate_to_one`.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, FRAC_PI_4, PI, TAU};

use glam::{Vec2, Vec3};

/// Unit square to unit disc: Shirley and Chiu's concentric map.
pub fn square_to_disc(u: Vec2) -> Vec2 {
    let o = 2.0 * u - Vec2::ONE;
    if o == Vec2::ZERO {
        return Vec2::ZERO;
    }
    let (r, theta) = if o.x.abs() > o.y.abs() {
        (o.x, FRAC_PI_4 * (o.y / o.x))
    } else {
        (o.y, FRAC_PI_2 - FRAC_PI_4 * (o.x / o.y))
    };
    r * Vec2::from_angle(theta)
}

/// Inverse of [`square_to_disc`].
pub fn disc_to_square(p: Vec2) -> Vec2 {
    let r = p.length();
    let mut phi = p.y.atan2(p.x);
    if phi < -FRAC_PI_4 {
        phi += TAU;
    }
    let (a, b) = match phi {
        p if p < FRAC_PI_4 => (r, phi * r / FRAC_PI_4),
        p if p < 3.0 * FRAC_PI_4 => (-(phi - FRAC_PI_2) * r / FRAC_PI_4, r),
        p if p < 5.0 * FRAC_PI_4 => (-r, -(phi - PI) * r / FRAC_PI_4),
        _ => ((phi - 3.0 * FRAC_PI_2) * r / FRAC_PI_4, -r),
    };
    Vec2::new((a + 1.0) / 2.0, (b + 1.0) / 2.0)
}

/// Density of [`square_to_disc`], per area of the unit disc.
pub const DISC_PDF: f32 = FRAC_1_PI;

/// Cosine-weighted hemisphere around +z.
pub fn square_to_cosine_hemisphere(u: Vec2) -> Vec3 {
    let d = square_to_disc(u);
    // z from the disc; at the rim rounding must not give a direction below the surface or NaN.
    d.extend((1.0 - d.length_squared()).max(1e-12).sqrt())
}

/// Inverse of [`square_to_cosine_hemisphere`].
pub fn cosine_hemisphere_to_square(w: Vec3) -> Vec2 {
    disc_to_square(w.truncate())
}

/// `cos(theta) / pi`, 1/sr; zero below the surface.
pub fn cosine_hemisphere_pdf(w: Vec3) -> f32 {
    w.z.max(0.0) * FRAC_1_PI
}

/// Cone of half angle `acos(cos_max)` around +z, uniform in solid angle.
///
/// `one_minus_cos_max` is given instead of `cos_max`, because for the sun (0.27 deg) the difference would
/// lose its digits in f32.
pub fn square_to_cone(u: Vec2, one_minus_cos_max: f32) -> Vec3 {
    let d = square_to_disc(u);
    let h = d.length_squared() * one_minus_cos_max;
    // |d|^2 (1 - cos_max) = 1 - cos(theta); sin(theta)^2 = h (2 - h).
    (d * (one_minus_cos_max * (2.0 - h)).max(0.0).sqrt()).extend(1.0 - h)
}

/// Inverse of [`square_to_cone`].
pub fn cone_to_square(w: Vec3, one_minus_cos_max: f32) -> Vec2 {
    let h = w.truncate().length_squared() / (1.0 + w.z);
    let scale = (one_minus_cos_max * (2.0 - h)).sqrt();
    disc_to_square(w.truncate() / scale)
}

/// Density of [`square_to_cone`], 1/sr.
pub fn cone_pdf(one_minus_cos_max: f32) -> f32 {
    1.0 / (TAU * one_minus_cos_max)
}

/// Lobe `(n + 1) / (2 pi) cos^n(theta)` around +z (Phong sampling); `n >= 0`, 0 is the uniform hemisphere.
pub fn square_to_power_cosine(u: Vec2, exponent: f32) -> Vec3 {
    let d = square_to_disc(u);
    let r2 = d.length_squared().min(1.0);
    let z = (1.0 - r2).powf(1.0 / (exponent + 1.0));
    let scale =
        if r2 > 1e-12 { ((1.0 - z * z).max(0.0) / r2).sqrt() } else { (2.0 / (exponent + 1.0)).sqrt() };
    (d * scale).extend(z)
}

/// Inverse of [`square_to_power_cosine`].
pub fn power_cosine_to_square(w: Vec3, exponent: f32) -> Vec2 {
    let r = (1.0 - w.z.max(0.0).powf(exponent + 1.0)).max(0.0).sqrt();
    let xy = w.truncate();
    disc_to_square(xy.normalize_or_zero() * r)
}

/// Density of [`square_to_power_cosine`], 1/sr; zero below.
pub fn power_cosine_pdf(cos_theta: f32, exponent: f32) -> f32 {
    if cos_theta <= 0.0 { 0.0 } else { (exponent + 1.0) / TAU * cos_theta.powf(exponent) }
}

/// Uniform unit sphere.
pub fn square_to_sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let r = (1.0 - z * z).max(0.0).sqrt();
    (r * Vec2::from_angle(TAU * u.y)).extend(z)
}

/// Inverse of [`square_to_sphere`].
pub fn sphere_to_square(w: Vec3) -> Vec2 {
    Vec2::new((1.0 - w.z) / 2.0, (w.y.atan2(w.x) / TAU).rem_euclid(1.0))
}

/// Density of [`square_to_sphere`], 1/sr.
pub const SPHERE_PDF: f32 = FRAC_1_PI / 4.0;

/// Barycentric coordinates `(b0, b1, b2)` uniform over a triangle (Heitz 2019, low distortion).
pub fn square_to_triangle(u: Vec2) -> Vec3 {
    let (b0, b1) = if u.x < u.y {
        let b0 = u.x / 2.0;
        (b0, u.y - b0)
    } else {
        let b1 = u.y / 2.0;
        (u.x - b1, b1)
    };
    Vec3::new(b0, b1, 1.0 - b0 - b1)
}

/// Inverse of [`square_to_triangle`].
pub fn triangle_to_square(b: Vec3) -> Vec2 {
    if b.x > b.y { Vec2::new(b.x + b.y, 2.0 * b.y) } else { Vec2::new(2.0 * b.x, b.y + b.x) }
}

/// Triangular density on `[-radius, radius]` from a uniform number (the tent filter).
pub fn uniform_to_tent(u: f32, radius: f32) -> f32 {
    if u < 0.5 {
        radius * ((2.0 * u).sqrt() - 1.0)
    } else {
        radius * (1.0 - (2.0 * (1.0 - u)).max(0.0).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> impl Iterator<Item = Vec2> {
        (0..101).flat_map(|i| {
            (0..101).map(move |j| Vec2::new((i as f32 + 0.37) / 101.0, (j as f32 + 0.61) / 101.0))
        })
    }

    #[test]
    fn warps_invert() {
        for u in grid() {
            let close = |v: Vec2, what: &str| assert!((v - u).length() < 2e-3, "{what}: {u} -> {v}");
            close(disc_to_square(square_to_disc(u)), "disc");
            close(cosine_hemisphere_to_square(square_to_cosine_hemisphere(u)), "cosine");
            close(cone_to_square(square_to_cone(u, 1e-5), 1e-5), "sun cone");
            close(cone_to_square(square_to_cone(u, 0.7), 0.7), "wide cone");
            close(power_cosine_to_square(square_to_power_cosine(u, 20.0), 20.0), "power cosine");
            close(sphere_to_square(square_to_sphere(u)), "sphere");
            close(triangle_to_square(square_to_triangle(u)), "triangle");
        }
    }

    #[test]
    fn densities_integrate_to_one() {
        // Mean of 1/pdf under the warp is the measure of the domain: 2 pi for the open hemisphere, with
        // f = cos to keep the integrand bounded: integral of cos over the hemisphere is pi.
        for exponent in [0.0, 1.0, 5.0, 40.0] {
            let mean: f64 = grid()
                .map(|u| {
                    let w = square_to_power_cosine(u, exponent);
                    assert!((w.length() - 1.0).abs() < 1e-5);
                    f64::from(w.z.powf(exponent + 1.0) / power_cosine_pdf(w.z, exponent))
                })
                .sum::<f64>()
                / 10201.0;
            let exact = f64::from(TAU / (exponent + 2.0));
            assert!((mean / exact - 1.0).abs() < 2e-3, "{exponent}: {mean} {exact}");
        }
        let cone: f64 =
            grid().map(|u| f64::from(square_to_cone(u, 0.5).z / cone_pdf(0.5))).sum::<f64>() / 10201.0;
        assert!((cone / f64::from(PI * 0.75) - 1.0).abs() < 1e-3, "{cone}");
    }
}

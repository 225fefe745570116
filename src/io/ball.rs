//! A petal bent to a ball, seen from the front: what a table of its BSDF looks like.
//!
//! Model: a unit ball without shadows and without light from part to part, under parallel light of irradiance pi, seen along
//! its axis; each point sends L = pi f(wi, wo) cos(theta_i), so a white Lambertian one that faces the light is 1. The ball
//! ends where its normal is 75 degrees from the view: beyond that a table's bins are too wide.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::gonio::GonioTable;

/// Steepest normal of the ball, degrees from the view.
const EDGE_DEG: f64 = 75.0;
/// Points per side of a pixel.
const SAMPLES: usize = 2;

/// Which side the light comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lit {
    /// The viewer's: from the upper right, 45 degrees from the view.
    Front,
    /// The other side: from behind, upper left, 30 degrees from the view's axis.
    Behind,
}

/// Linear light of `size` x `size` pixels, row by row from the top, on a ground of that colour. The bands of `rgb` are linear
/// red, green and blue; its lit side is the one that `lit` says.
pub(super) fn ball(rgb: &GonioTable, lit: Lit, size: usize, ground: DVec3) -> Vec<DVec3> {
    let rgb = &without_azimuth(rgb.clone());
    let pixel = |i: usize| {
        let corner = DVec2::new((i % size) as f64, (i / size) as f64);
        let mut sum = DVec3::ZERO;
        for s in 0..SAMPLES * SAMPLES {
            let offset = DVec2::new((s % SAMPLES) as f64 + 0.5, (s / SAMPLES) as f64 + 0.5) / SAMPLES as f64;
            let p = (corner + offset) / size as f64 * 2.0 - 1.0;
            sum += if p.length() < 1.0 { radiance(rgb, lit, normal(DVec2::new(p.x, -p.y))) } else { ground };
        }
        sum / (SAMPLES * SAMPLES) as f64
    };
    (0..size * size).into_par_iter().map(pixel).collect()
}

/// What the noise of bins would break: both turns of azimuth are one; around the normal, and where the lamp stands there, all
/// azimuths are one.
fn without_azimuth(mut rgb: GonioTable) -> GonioTable {
    let (thetas, phis) = (rgb.grid.thetas(), rgb.grid.phis());
    for i in &mut rgb.incidences {
        for (r, row) in i.bsdf.chunks_mut(phis).enumerate() {
            let pole = r % thetas == 0 || r % thetas == thetas - 1;
            let mean = row.iter().map(|e| e.value).sum::<f64>() / phis as f64;
            let turned: Vec<f64> = (0..phis).map(|c| row[(phis - c) % phis].value).collect();
            for (e, turned) in row.iter_mut().zip(turned) {
                e.value = if pole || i.incident_deg == 0.0 { mean } else { (e.value + turned) / 2.0 };
            }
        }
    }
    rgb
}

/// Normal towards the viewer at a point of the unit disc, y upwards.
fn normal(p: DVec2) -> DVec3 {
    let xy = p * EDGE_DEG.to_radians().sin();
    xy.extend((1.0 - xy.length_squared()).max(0.0).sqrt())
}

/// Light towards the viewer (+z).
fn radiance(rgb: &GonioTable, lit: Lit, towards_viewer: DVec3) -> DVec3 {
    let (lit_normal, light) = match lit {
        Lit::Front => (towards_viewer, DVec3::new(0.5, 0.5, std::f64::consts::FRAC_1_SQRT_2)),
        Lit::Behind => (-towards_viewer, DVec3::new(-0.353_553, 0.353_553, -0.866_025)),
    };
    let cos = lit_normal.dot(light);
    if cos <= 0.0 {
        return DVec3::ZERO;
    }
    // The instrument's frame: the lamp at azimuth 0.
    let x = (light - lit_normal * cos).normalize_or(lit_normal.any_orthonormal_vector());
    let y = lit_normal.cross(x);
    let view = DVec3::new(x.z, y.z, lit_normal.z).as_vec3();
    let at = |band| rgb.bsdf(cos.min(1.0).acos().to_degrees(), view, band).unwrap_or(0.0);
    DVec3::new(at(0), at(1), at(2)) * cos * std::f64::consts::PI
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::bsdf::DiffuseTransmission;
    use crate::geometry::Side;
    use crate::gonio::{ExitantGrid, Goniophotometer};

    #[test]
    fn a_lambertian_ball_follows_the_cosine() {
        let sheet = DiffuseTransmission::new(0.5.into(), 0.2.into(), 0.3.into()).unwrap();
        for (side, lit, share) in [(Side::Adaxial, Lit::Front, 0.5), (Side::Abaxial, Lit::Behind, 0.3)] {
            let gonio = Goniophotometer {
                incident_deg: vec![0.0, 40.0, 75.0],
                side,
                rays: 40_000,
                exitant: ExitantGrid { theta_step_deg: 15.0, phi_step_deg: 30.0 },
                ..Default::default()
            };
            let table = gonio.measure(&sheet, &|_, _| ControlFlow::Continue(())).unwrap();
            // Bands of one measurement as red, nothing as green, half of it as blue.
            let rgb = table.combined(&[[1.0, 0.0, 0.5]]);
            let pixels = ball(&rgb, lit, 41, DVec3::splat(0.25));
            assert_eq!(pixels[0], DVec3::splat(0.25));
            let light = if lit == Lit::Front {
                DVec3::new(0.5, 0.5, std::f64::consts::FRAC_1_SQRT_2)
            } else {
                DVec3::new(0.3536, -0.3536, 0.866)
            };
            for (x, y) in [(20, 20), (26, 14), (14, 26), (30, 20)] {
                let p = (DVec2::new(f64::from(x), f64::from(y)) + 0.5) / 41.0 * 2.0 - 1.0;
                let expected = share * normal(DVec2::new(p.x, -p.y)).dot(light).max(0.0);
                let got = pixels[(y * 41 + x) as usize];
                assert!(
                    (got.x - expected).abs() < 0.03 + 0.05 * expected,
                    "{lit:?} {x} {y}: {got} {expected}"
                );
                assert!(got.y == 0.0 && (got.z - got.x / 2.0).abs() < 1e-9);
            }
        }
    }
}

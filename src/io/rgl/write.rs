//! Writing an isotropic spectral RGL file from any table.
//!
//! Model: the format leaves its writer to choose normals and warp. Here
//! - normals are those of a hemisphere: ndf = 1 / pi, sigma = (1 + cos theta_i) / 2. They are never zero, so the stored
//!   spectra(s) = f cos(theta_o) 4 sigma / ndf is as smooth as the BRDF;
//! - the warp is p(u_m) = (0.3 + 1.4 x) (0.5 + 2 exp(-(phi / 40 deg)^2)), normalised, for every lamp angle alike: columns
//!   are even in theta_m, rows dense about the plane of incidence on the lamp's side, where the half vectors of mirror
//!   and retro lobes are. Since it does not move, half vectors stay at their nodes from one lamp angle to the next;
//! - luminance is the mean over the bands, turned into a density per unit square of s.
//!
//! Below the horizon f cos is continued with the BRDF at the horizon and the cosine's sign: a table that stopped at zero
//! would be too bright next to it. Readers ask above the horizon only.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | lamp angles, even from 0 to 90 deg (the last one 89.5) | `lamps` | 1 | 37, 31, 19: the most within 10 MB |
//! | nodes along each side of the square | `grid` | 1 | 64 |
//!
//! Limits: lobes narrower than about 5 deg lose height. Guarded by `a_written_sheet_is_read_back`,
//! `the_total_reflectance_survives` and `luminance_is_the_density_of_the_light`. Source: [Dupuy2018]; the choices are ours.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DQuat, DVec3};
use rayon::prelude::*;

use super::table::{Lamp, Table, Warp};
use super::tensor::{self, Field};
use super::{FORMAT, place};
use crate::gonio::Directional;
use crate::io::invalid;
use crate::{Error, Result};

/// Nodes of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resolution {
    /// Angles of the lamp, 2 to 361.
    pub lamps: usize,
    /// Nodes along each side of the square of half vectors, 8 to 1024.
    pub grid: usize,
}

impl Resolution {
    /// 64 x 64 half vectors, and as many lamp angles (37, 31 or 19) as keep the file below 10 MB.
    pub fn for_bands(bands: usize) -> Self {
        let grid = 64;
        let fits = |lamps: &usize| lamps * (bands + 1) * grid * grid * 4 < 10_000_000;
        Self { lamps: [37, 31].into_iter().find(fits).unwrap_or(19), grid }
    }
}

/// Angle of the last lamp: at 90 deg itself nothing arrives.
const LAST_LAMP_DEG: f64 = 89.5;
/// Azimuths over which an anisotropic table is averaged.
const AZIMUTHS: usize = 12;

/// Writes the reflection of the adaxial side. Every band needs a wavelength.
///
/// Lost: transmission, the abaxial side, anisotropy (the mean over 12 azimuths of the lamp is written), f64 (values are
/// f32). Directions that the table does not know become black.
pub fn write(table: &dyn Directional, resolution: Resolution, description: &str) -> Result<Vec<u8>> {
    let Resolution { lamps, grid } = resolution;
    if !((2..=361).contains(&lamps) && (8..=1024).contains(&grid)) {
        let what = format!("{lamps} lamps, grid of {grid}: 2 to 361 lamps and 8 to 1024 nodes are written");
        return Err(Error::invalid(FORMAT, what));
    }
    if !table.coverage().reflection_adaxial {
        return Err(invalid(FORMAT, "the table has no reflection of the adaxial (front) side"));
    }
    let (order, wavelengths) = bands_by_wavelength(table)?;
    let thetas: Vec<f64> =
        (0..lamps).map(|i| (90.0 * i as f64 / (lamps - 1) as f64).min(LAST_LAMP_DEG).to_radians()).collect();
    let density = warp_density();
    let warp = Warp::new(density.clone(), "vndf")?;
    let sigma = sigma();
    let nodes = half_vectors(&warp, grid);
    let slices: Vec<Slice> = thetas
        .par_iter()
        .map(|&theta| {
            let (x, y) = place(theta, 0.0);
            slice(table, &order, &nodes, theta, 4.0 * PI * sigma.eval([(0, 1.0)], x, y))
        })
        .collect();

    let luminance: Vec<f32> = slices.iter().flat_map(|s| s.luminance.iter().copied()).collect();
    let spectra: Vec<f32> = slices.iter().flat_map(|s| s.spectra.iter().copied()).collect();
    if spectra.iter().any(|v| !v.is_finite()) {
        return Err(invalid(FORMAT, "the table has values that f32 cannot hold"));
    }
    let f32s = |values: &[f64]| values.iter().map(|v| *v as f32).collect::<Vec<f32>>();
    let vndf = density.values.repeat(lamps);
    Ok(tensor::write(&[
        ("description", Field::u8s(description.as_bytes())),
        ("phi_i", Field::f32s(&[1], &[0.0])),
        ("theta_i", Field::f32s(&[lamps], &f32s(&thetas))),
        ("wavelengths", Field::f32s(&[wavelengths.len()], &f32s(&wavelengths))),
        ("ndf", Field::f32s(&[2, 2], &[(1.0 / PI) as f32; 4])),
        ("sigma", Field::f32s(&[sigma.rows, sigma.columns], &sigma.values)),
        ("vndf", Field::f32s(&[1, lamps, density.rows, density.columns], &vndf)),
        ("luminance", Field::f32s(&[1, lamps, grid, grid], &luminance)),
        ("spectra", Field::f32s(&[1, lamps, wavelengths.len(), grid, grid], &spectra)),
        ("jacobian", Field::u8s(&[1])),
    ]))
}

/// Indices of the bands in the order of their wavelengths, and these.
fn bands_by_wavelength(table: &dyn Directional) -> Result<(Vec<usize>, Vec<f64>)> {
    let mut bands = Vec::new();
    for (i, band) in table.bands().iter().enumerate() {
        match band.wavelength_nm {
            Some(nm) if nm > 0.0 && nm.is_finite() => bands.push((nm, i)),
            _ => {
                let what = format!("band {} has no wavelength; the format is spectral", band.name);
                return Err(invalid(FORMAT, what));
            }
        }
    }
    bands.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let Some(pair) = bands.windows(2).find(|p| p[0].0 as f32 >= p[1].0 as f32) {
        return Err(invalid(FORMAT, format_args!("two bands at {} nm", pair[0].0)));
    }
    if bands.is_empty() {
        return Err(invalid(FORMAT, "the table has no band"));
    }
    Ok(bands.into_iter().map(|(nm, i)| (i, nm)).unzip())
}

/// The warp's density over the square; linear in x, so two columns say it all.
fn warp_density() -> Table {
    let rows = 65;
    let values = (0..rows).flat_map(|row| {
        let phi_deg = 360.0 * row as f64 / (rows - 1) as f64 - 180.0;
        let along = 0.5 + 2.0 * (-(phi_deg / 40.0).powi(2)).exp();
        [0.3 * along, 1.7 * along].map(|v| v as f32)
    });
    Table { columns: 2, rows, values: values.collect() }
}

/// Projected area of a hemisphere's normals.
fn sigma() -> Table {
    let columns = 256;
    let row = (0..columns).map(|c| {
        let theta = FRAC_PI_2 * (c as f64 / (columns - 1) as f64).powi(2);
        (0.5 * (1.0 + theta.cos())) as f32
    });
    let row: Vec<f32> = row.collect();
    Table { columns, rows: 2, values: row.repeat(2) }
}

/// A node of the square of s: its half vector (lamp at azimuth 0), and the solid angle of half vectors per unit of s.
struct Node {
    m: DVec3,
    solid_angle_sr: f64,
}

fn half_vectors(warp: &Warp, grid: usize) -> Vec<Node> {
    let lamp: Lamp = [(0, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)];
    let step = 1.0 / (grid - 1) as f64;
    let node = |i: usize| {
        let (row, column) = (i / grid, i % grid);
        let (x, y) = warp.forward(&lamp, column as f64 * step, row as f64 * step);
        let (theta, phi) = (x * x * FRAC_PI_2, (2.0 * y - 1.0) * PI);
        let m = DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
        Node { m, solid_angle_sr: TAU * PI * x * theta.sin() / warp.density(&lamp, x, y) }
    };
    (0..grid * grid).map(node).collect()
}

/// All that one lamp angle contributes.
struct Slice {
    luminance: Vec<f32>,
    /// Band after band.
    spectra: Vec<f32>,
}

fn slice(table: &dyn Directional, order: &[usize], nodes: &[Node], theta: f64, scale: f64) -> Slice {
    let wi = DVec3::new(theta.sin(), 0.0, theta.cos());
    let azimuths = if table.is_isotropic() { 1 } else { AZIMUTHS };
    let turns: Vec<DQuat> =
        (0..azimuths).map(|i| DQuat::from_rotation_z(TAU * i as f64 / azimuths as f64)).collect();
    let mut values = vec![0.0; table.bands().len()];
    let mut luminance = vec![0.0; nodes.len()];
    let mut spectra = vec![0.0; nodes.len() * order.len()];
    for (i, node) in nodes.iter().enumerate() {
        let across = wi.dot(node.m);
        let wo = 2.0 * across * node.m - wi;
        let mut mean = vec![0.0; order.len()];
        for turn in &turns {
            // Unknown directions leave zeros.
            table.bsdf(*turn * wi, *turn * above_horizon(wo), &mut values);
            for (sum, band) in mean.iter_mut().zip(order) {
                *sum += values[*band] * wo.z / azimuths as f64;
            }
        }
        for (band, f_cos) in mean.iter().enumerate() {
            spectra[band * nodes.len() + i] = (f_cos * scale) as f32;
        }
        // Solid angle of exitant directions per unit of s: that of half vectors times 4 cos.
        let light = mean.iter().sum::<f64>().max(0.0) / mean.len() as f64;
        luminance[i] = light * 4.0 * across.max(0.0) * node.solid_angle_sr;
    }
    // A black row would have no density to draw from.
    let floor = 1e-4 * luminance.iter().sum::<f64>() / nodes.len() as f64;
    let floor = if floor > 0.0 { floor } else { 1.0 };
    Slice { luminance: luminance.iter().map(|v| (v + floor) as f32).collect(), spectra }
}

/// The direction itself, or the nearest one that is seen just above the horizon.
fn above_horizon(w: DVec3) -> DVec3 {
    let low = 1e-3;
    if w.z >= low {
        return w;
    }
    let (x, y) = if w.x == 0.0 && w.y == 0.0 { (1.0, 0.0) } else { (w.x, w.y) };
    let flat = DVec3::new(x, y, 0.0).normalize_or(DVec3::X);
    flat * (1.0 - low * low).sqrt() + DVec3::Z * low
}

#[cfg(test)]
mod tests;

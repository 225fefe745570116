//! MERL `.binary`: an isotropic BRDF in red, green and blue over half and difference angles.
//!
//! Layout, little-endian: three i32 (cells of theta_h, theta_d, phi_d; 90 90 180 in all published files), then f64
//! values, one plane each for red, green and blue, `(theta_h * n_d + theta_d) * n_p + phi_d` inside a plane. The BRDF
//! in 1/sr is the value times 1/1500, 1.15/1500 or 1.66/1500; a negative value marks a cell without a measurement.
//!
//! Cells: `k_h = n_h sqrt(theta_h / 90 deg)`, `k_d = n_d theta_d / 90 deg`, `k_p = n_p phi_d / 180 deg`. Half vector
//! h = (wi + wo) normalised; theta_d and phi_d are the angles of wi in the frame whose pole is h. Exchanging the
//! two directions turns phi_d by 180 deg, so half a turn is stored and the BRDF is reciprocal.
//!
//! Reading is linear between the middles of the cells (our reading; the format does not say), held outside them.
//! Writing evaluates at the middle of each cell, the mean of the two orders of the directions; a cell that the
//! horizon cuts takes the mean over its corners above it. Guarded by `cells_are_where_the_format_says`,
//! `written_values_are_read_back` and `damaged_files_are_errors`.
//! Source: Matusik2003.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use rayon::prelude::*;

use super::invalid;
use crate::gonio::{Band, Coverage, Directional};
use crate::{Error, Result};

/// Cells of theta_h, theta_d and phi_d in a published file.
const CELLS: [usize; 3] = [90, 90, 180];
/// 1/sr per stored unit: red, green, blue.
const SCALES: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];
/// Three dimensions of four bytes.
const HEADER_BYTES: usize = 12;

/// A BRDF that was read from a MERL file.
#[derive(Clone, Debug, PartialEq)]
pub struct MerlBrdf {
    cells: [usize; 3],
    /// As stored, before the scale; three planes.
    values: Vec<f64>,
    bands: Vec<Band>,
}

/// Reads a file.
pub fn read(bytes: &[u8]) -> Result<MerlBrdf> {
    let (header, body) = bytes
        .split_at_checked(HEADER_BYTES)
        .ok_or_else(|| invalid("MERL", format_args!("{} bytes: no room for a header", bytes.len())))?;
    let mut cells = [0; 3];
    for ((cell, word), name) in
        cells.iter_mut().zip(header.as_chunks::<4>().0).zip(["theta_h", "theta_d", "phi_d"])
    {
        let n = i32::from_le_bytes(*word);
        *cell = usize::try_from(n)
            .ok()
            .filter(|n| *n > 0)
            .ok_or_else(|| invalid("MERL", format_args!("{n} cells of {name}")))?;
    }
    let promised = cells.iter().try_fold(3 * 8usize, |product, n| product.checked_mul(*n));
    if promised != Some(body.len()) {
        let [h, d, p] = cells;
        let what = format!(
            "the header says 3 x {h} x {d} x {p} values of 8 bytes, {} bytes follow it: {} or not a MERL file",
            body.len(),
            if promised.is_none_or(|n| n > body.len()) { "truncated" } else { "too long" },
        );
        return Err(invalid("MERL", what));
    }
    let values = finite_f64s(body, "MERL")?;
    Ok(MerlBrdf { cells, values, bands: ["R", "G", "B"].map(Band::named).to_vec() })
}

/// Writes the reflection of the adaxial side, bands `red`, `green` and `blue` of `table` as the three planes.
///
/// Lost: wavelengths (a plane is only "red"), anisotropy, transmission, the abaxial side, and all that is finer than a
/// cell. Cells whose directions the table does not know are marked as not measured.
pub fn write(table: &dyn Directional, [red, green, blue]: [usize; 3]) -> Result<Vec<u8>> {
    write_cells(table, [red, green, blue], CELLS)
}

fn write_cells(table: &dyn Directional, planes: [usize; 3], cells: [usize; 3]) -> Result<Vec<u8>> {
    let bands = table.bands().len();
    for (plane, band) in ["red", "green", "blue"].iter().zip(planes) {
        if band >= bands {
            return Err(Error::invalid(
                "MERL",
                format!("{plane} is band {band}, but there are {bands} bands"),
            ));
        }
    }
    if !table.coverage().reflection_adaxial {
        return Err(invalid("MERL", "the table has no reflection of the adaxial (front) side"));
    }
    let [n_h, n_d, n_p] = cells;
    let rows: Vec<[f64; 3]> = (0..n_h * n_d)
        .into_par_iter()
        .flat_map_iter(|row| {
            let mut buffers = (vec![0.0; bands], vec![0.0; bands]);
            let (h, d) = (row / n_d, row % n_d);
            (0..n_p)
                .map(move |p| cell_value(table, planes, cells, [h, d, p], &mut buffers))
                .collect::<Vec<_>>()
        })
        .collect();
    let mut bytes = Vec::with_capacity(HEADER_BYTES + rows.len() * 3 * 8);
    for n in cells {
        bytes.extend_from_slice(&(n as i32).to_le_bytes());
    }
    for plane in 0..3 {
        for row in &rows {
            bytes.extend_from_slice(&row[plane].to_le_bytes());
        }
    }
    Ok(bytes)
}

/// Stored values of one cell; -1 where nothing is known.
fn cell_value(
    table: &dyn Directional,
    planes: [usize; 3],
    cells: [usize; 3],
    cell: [usize; 3],
    (forth, back): &mut (Vec<f64>, Vec<f64>),
) -> [f64; 3] {
    let mut at = |offset: [f64; 3]| {
        let k = [0, 1, 2].map(|i| cell[i] as f64 + offset[i]);
        let (wi, wo) = directions(k, cells);
        // A corner in the horizon itself is not above it, whatever the rounding says.
        let above = wi.z > 1e-9 && wo.z > 1e-9;
        (above && table.bsdf(wi, wo, forth) && table.bsdf(wo, wi, back))
            .then(|| [0, 1, 2].map(|c| 0.5 * (forth[planes[c]] + back[planes[c]]) / SCALES[c]))
    };
    if let Some(middle) = at([0.5; 3]) {
        return middle;
    }
    let corners: Vec<[f64; 3]> =
        (0..8).filter_map(|c| at([c & 1, c >> 1 & 1, c >> 2].map(f64::from))).collect();
    if corners.is_empty() {
        return [-1.0; 3];
    }
    [0, 1, 2].map(|i| corners.iter().map(|c| c[i]).sum::<f64>() / corners.len() as f64)
}

/// Directions at cell coordinates (whole numbers are the borders of cells), half vector at azimuth 0.
fn directions(k: [f64; 3], cells: [usize; 3]) -> (DVec3, DVec3) {
    let [h, d, p] = [0, 1, 2].map(|i| k[i] / cells[i] as f64);
    let ((sh, ch), (sd, cd), (sp, cp)) =
        ((h * h * FRAC_PI_2).sin_cos(), (d * FRAC_PI_2).sin_cos(), (p * PI).sin_cos());
    let across = sd * cp * DVec3::new(ch, 0.0, -sh) + sd * sp * DVec3::Y;
    let along = cd * DVec3::new(sh, 0.0, ch);
    (along + across, along - across)
}

/// Cell coordinates of two directions above the horizon.
fn coordinates(wi: DVec3, wo: DVec3, cells: [usize; 3]) -> [f64; 3] {
    let h = (wi + wo).normalize_or_zero();
    let across = h.x.hypot(h.y);
    let theta_h = across.atan2(h.z);
    let (cos_phi, sin_phi) = if across > 0.0 { (h.x / across, h.y / across) } else { (1.0, 0.0) };
    let x = DVec3::new(h.z * cos_phi, h.z * sin_phi, -across);
    let y = DVec3::new(-sin_phi, cos_phi, 0.0);
    let (dx, dy) = (wi.dot(x), wi.dot(y));
    let theta_d = dx.hypot(dy).atan2(wi.dot(h));
    let phi_d = dy.atan2(dx).rem_euclid(PI);
    let turns = [(theta_h / FRAC_PI_2).sqrt(), theta_d / FRAC_PI_2, phi_d / PI];
    [0, 1, 2].map(|i| turns[i] * cells[i] as f64)
}

impl Directional for MerlBrdf {
    fn bands(&self) -> &[Band] {
        &self.bands
    }

    fn coverage(&self) -> Coverage {
        Coverage { reflection_adaxial: true, ..Coverage::default() }
    }

    fn bsdf(&self, wi: DVec3, wo: DVec3, values: &mut [f64]) -> bool {
        values.fill(0.0);
        if !(wi.z > 0.0 && wo.z > 0.0) {
            return false;
        }
        let k = coordinates(wi, wo, self.cells);
        let [n_h, n_d, n_p] = self.cells;
        let held = |x: f64, n: usize| {
            let x = (x - 0.5).clamp(0.0, (n - 1) as f64);
            (x as usize, (x as usize + 1).min(n - 1), x.fract())
        };
        let (h, d) = (held(k[0], n_h), held(k[1], n_d));
        let turn = (k[2] - 0.5).rem_euclid(n_p as f64);
        let p = (turn as usize % n_p, (turn as usize + 1) % n_p, turn.fract());
        // Cells without a measurement take no part, but the one that the directions lie in must have one.
        let (mut sum, mut total, mut nearest) = ([0.0; 3], 0.0, (-1.0, false));
        for corner in 0..8 {
            let pick = |(low, high, t): (usize, usize, f64), bit: usize| {
                if corner >> bit & 1 == 0 { (low, 1.0 - t) } else { (high, t) }
            };
            let ((i, wh), (j, wd), (l, wp)) = (pick(h, 0), pick(d, 1), pick(p, 2));
            let weight: f64 = wh * wd * wp;
            let at = (i * n_d + j) * n_p + l;
            let stored = [0, 1, 2].map(|c| self.values[c * n_h * n_d * n_p + at]);
            let known = stored.iter().all(|v| *v >= 0.0);
            if weight > nearest.0 {
                nearest = (weight, known);
            }
            if known {
                total += weight;
                sum.iter_mut().zip(stored).for_each(|(s, v)| *s += weight * v);
            }
        }
        if !nearest.1 {
            return false;
        }
        for (c, v) in values.iter_mut().enumerate().take(3) {
            *v = sum[c] / total * SCALES[c];
        }
        true
    }
}

/// Little-endian numbers, all finite; the length is a multiple of eight.
pub(super) fn finite_f64s(bytes: &[u8], format: &str) -> Result<Vec<f64>> {
    let values: Vec<f64> = bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
    match values.iter().position(|v| !v.is_finite()) {
        Some(at) => Err(invalid(format, format_args!("value {at} is {}", values[at]))),
        None => Ok(values),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::directional::tests::Sheet;
    use crate::gonio::measurement::direction_deg;
    use crate::io::damage::damage;

    const SMALL: [usize; 3] = [6, 5, 8];

    #[test]
    fn cells_are_where_the_format_says() {
        // Middle and corners of cells: to directions and back.
        for k in [[0.5, 0.5, 0.5], [10.5, 44.5, 90.5], [89.0, 1.0, 179.0], [40.0, 30.0, 0.25]] {
            let (wi, wo) = directions(k, CELLS);
            assert!((wi.length() - 1.0).abs() < 1e-12 && (wo.length() - 1.0).abs() < 1e-12);
            let turn = glam::DQuat::from_rotation_z(1.2);
            for (a, b) in [(wi, wo), (wo, wi), (turn * wi, turn * wo)] {
                let back = coordinates(a, b, CELLS);
                assert!(k.iter().zip(back).all(|(k, b)| (k - b).abs() < 1e-6), "{k:?} {back:?}");
            }
        }
        // By hand: a mirror pair at 30 deg has theta_h = 0, theta_d = 30 deg; retro at 40 deg theta_h = 40, theta_d = 0.
        let mirror = coordinates(direction_deg(30.0, 0.0), direction_deg(30.0, 180.0), CELLS);
        assert!(mirror[0] < 1e-6 && (mirror[1] - 30.0).abs() < 1e-9, "{mirror:?}");
        let retro = coordinates(direction_deg(40.0, 70.0), direction_deg(40.0, 70.0), CELLS);
        assert!((retro[0] - 60.0).abs() < 1e-9 && retro[1] < 1e-6, "{retro:?}");
        // Order of the values: only the green value of cell (h, d, p) = (2, 1, 3) is lit.
        let mut values = vec![0.0; 3 * 6 * 5 * 8];
        values[6 * 5 * 8 + (2 * 5 + 1) * 8 + 3] = 1500.0;
        let brdf = MerlBrdf { cells: SMALL, values, bands: ["R", "G", "B"].map(Band::named).to_vec() };
        let (wi, wo) = directions([2.5, 1.5, 3.5], SMALL);
        let mut v = [0.0; 3];
        assert!(
            brdf.bsdf(wi, wo, &mut v) && v[0] == 0.0 && (v[1] - 1.15).abs() < 1e-9 && v[2] == 0.0,
            "{v:?}"
        );
    }

    #[test]
    fn written_values_are_read_back() {
        let sheet = Sheet::new(0.4, 0.1, 0.3);
        let bytes = write(&sheet, [1, 0, 0]).unwrap();
        assert_eq!(bytes.len(), 12 + 3 * 8 * 90 * 90 * 180);
        let brdf = read(&bytes).unwrap();
        let (mut ours, mut theirs) = ([0.0; 2], [0.0; 3]);
        for (ti, to, phi) in [
            (0.0, 0.0, 0.0),
            (30.0, 30.0, 180.0),
            (60.0, 55.0, 10.0),
            (20.0, 70.0, 100.0),
            (85.0, 85.0, 200.0),
        ] {
            let (wi, wo) = (direction_deg(ti, 33.0), direction_deg(to, phi + 33.0));
            assert!(sheet.bsdf(wi, wo, &mut ours) && brdf.bsdf(wi, wo, &mut theirs), "{ti} {to} {phi}");
            assert!((theirs[0] / ours[1] - 1.0).abs() < 1e-3 && (theirs[1] / ours[0] - 1.0).abs() < 1e-3);
            assert!((theirs[1] / theirs[2] - 1.0).abs() < 1e-12);
        }
        // Exact at the middle of a cell.
        let (wi, wo) = directions([30.5, 20.5, 77.5], CELLS);
        assert!(sheet.bsdf(wi, wo, &mut ours) && brdf.bsdf(wi, wo, &mut theirs));
        assert!((theirs[0] / ours[1] - 1.0).abs() < 1e-9, "{theirs:?} {ours:?}");
        // A plate of constant BRDF stays one up to the horizon.
        let flat = read(&write_cells(&Sheet::new(0.5, 0.0, 0.0), [1, 1, 1], [30, 30, 60]).unwrap()).unwrap();
        for t in [0.0, 45.0, 80.0, 89.0] {
            for phi in [0.0, 60.0, 120.0, 180.0] {
                assert!(flat.bsdf(direction_deg(t, 0.0), direction_deg(88.0, phi), &mut theirs), "{t} {phi}");
                assert!((theirs[2] - 0.5 / PI).abs() < 1e-9, "{theirs:?}");
            }
        }
        assert!(!brdf.bsdf(direction_deg(20.0, 0.0), direction_deg(120.0, 0.0), &mut theirs));
        assert_eq!(theirs, [0.0; 3]);
    }

    #[test]
    fn cells_without_a_measurement_are_not_known() {
        let mut bytes = write_cells(&Sheet::new(0.4, 0.0, 0.0), [0, 1, 1], SMALL).unwrap();
        let at = 12 + 8 * ((2 * 5 + 1) * 8 + 3);
        bytes[at..at + 8].copy_from_slice(&(-0.1f64).to_le_bytes());
        let brdf = read(&bytes).unwrap();
        let mut v = [1.0; 3];
        let (wi, wo) = directions([2.6, 1.5, 3.4], SMALL);
        assert!(!brdf.bsdf(wi, wo, &mut v) && v == [0.0; 3]);
        // Its neighbours are, and it does not darken them.
        let (wi, wo) = directions([2.9, 1.9, 4.1], SMALL);
        assert!(brdf.bsdf(wi, wo, &mut v) && (v[2] - 0.4 / PI).abs() < 1e-12, "{v:?}");
    }

    #[test]
    fn damaged_files_are_errors() {
        let sheet = Sheet::new(0.4, 0.1, 0.0);
        let valid = write_cells(&sheet, [0, 1, 1], SMALL).unwrap();
        damage(&valid, 300, |b| {
            if let Ok(brdf) = read(b) {
                let mut v = [0.0; 3];
                brdf.bsdf(direction_deg(30.0, 0.0), direction_deg(40.0, 50.0), &mut v);
                assert!(v.iter().all(|v| *v >= 0.0 && v.is_finite()));
            }
        });
        let fails = |bytes: &[u8], word: &str| {
            let e = read(bytes).unwrap_err().to_string();
            assert!(e.contains(word), "{e}");
        };
        fails(&valid[..5], "header");
        fails(&valid[..valid.len() - 1], "truncated");
        let header = |dims: [i32; 3]| {
            let mut b = valid.clone();
            dims.iter().enumerate().for_each(|(i, d)| b[4 * i..4 * i + 4].copy_from_slice(&d.to_le_bytes()));
            b
        };
        fails(&header([i32::MAX; 3]), "truncated");
        fails(&header([100_000, 10_000, 1000]), "truncated");
        fails(&header([-90, 90, 180]), "-90 cells of theta_h");
        fails(&header([6, 0, 8]), "0 cells of theta_d");
        fails(&header([1, 5, 8]), "too long");
        let mut nan = valid.clone();
        nan[20..28].copy_from_slice(&f64::NAN.to_le_bytes());
        fails(&nan, "value 1 is NaN");
        assert!(write(&sheet, [0, 1, 2]).unwrap_err().to_string().contains("blue is band 2"));
    }
}

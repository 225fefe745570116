//! Files: bytes to types and back, one file per format.
//!
//! Every function is pure: it takes or returns bytes and never opens a path. Readers trust nothing: sizes that a
//! header promises are checked against the length of the bytes before memory is taken for them, and whatever the
//! bytes are the answer is a value or an [`Error`], never a panic (each file's test `damaged_files_are_errors`).

pub mod exr;
pub mod png;
pub mod image;
pub mod ply;
pub mod obj;
pub mod gltf;
mod gltf_write;
mod base64;
pub mod gonio_csv;
pub mod petal_optics;
pub mod merl;
pub mod utia;
pub mod conventions;
pub mod columns;
pub mod csv_options;
pub mod readings_csv;
pub mod rgl;
mod xml;
pub mod klems;
pub mod tensor_tree;
pub mod window_xml;
mod patch_average;
pub mod window_xml_write;
pub mod picture;
pub mod false_color;
pub mod pgii;
pub mod zemax;
pub mod measured;
pub mod line_chart;
pub mod lobe_plot;
pub mod spectra_csv;
pub mod spectra_plot;
mod ball;
pub mod swatch;
pub mod fit_text;
pub mod fit_series;
pub mod fit_plot;
pub mod residual_map;
mod html;
pub mod fit_html;
pub mod figure_page;
mod fit_parts;
pub mod spectrum_fit;
pub mod cell_plot;
pub mod light_table;
pub mod netcdf;
pub mod sensors_csv;
pub mod light_netcdf;

pub use image::Image;

use crate::geometry::Mesh;
use crate::{Error, Result};

#[cfg(test)]
pub(crate) mod damage;

/// Error for bytes that are not a valid file of `format`.
fn invalid(format: &str, what: impl std::fmt::Display) -> Error {
    Error::invalid(format, what.to_string())
}

/// Checks the number of pixels that a header promises: at most `max_pixels`, and no more than the file can
/// hold. `pixels_per_byte` is the most that the format's compression reaches.
fn check_pixels(
    format: &str,
    (width, height): (u64, u64),
    max_pixels: u64,
    (bytes, pixels_per_byte): (usize, u64),
) -> Result<()> {
    let count = width.saturating_mul(height);
    if count == 0 {
        return Err(invalid(format, format_args!("{width} x {height} pixels: the picture is empty")));
    }
    if count > max_pixels {
        return Err(invalid(
            format,
            format_args!("{width} x {height} pixels; at most {max_pixels} are read"),
        ));
    }
    if count > (bytes as u64).saturating_mul(pixels_per_byte) {
        return Err(invalid(
            format,
            format_args!("the header says {width} x {height} pixels, but there are only {bytes} bytes"),
        ));
    }
    Ok(())
}

/// Reads a mesh; the format is known by its first bytes (PLY, GLB, glTF; else OBJ).
pub fn read_mesh(bytes: &[u8]) -> Result<Mesh> {
    match bytes {
        [b'p', b'l', b'y', b'\n' | b'\r', ..] => ply::read(bytes),
        [b'g', b'l', b'T', b'F', ..] => gltf::read(bytes),
        _ if bytes.trim_ascii_start().starts_with(b"{") => gltf::read(bytes),
        _ => obj::read(bytes),
    }
}

/// Adds a polygon as a fan around its first corner; the number of corners if it has fewer than three.
fn push_fan(triangles: &mut Vec<[u32; 3]>, corners: &[u32]) -> Result<(), usize> {
    let [first, rest @ ..] = corners else { return Err(0) };
    if rest.len() < 2 {
        return Err(corners.len());
    }
    triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
    Ok(())
}

/// Checks a mesh that was read, and makes its normals unit vectors; where the file has none (length zero), the
/// mean of the faces' normals.
fn finish(mut mesh: Mesh, format: &str) -> Result<Mesh> {
    mesh.validate(format)?;
    if !mesh.normals.is_empty() {
        let mut normals = std::mem::take(&mut mesh.normals);
        if normals.iter().any(|n| n.try_normalize().is_none()) {
            mesh.compute_normals();
            for (n, computed) in normals.iter_mut().zip(&mesh.normals) {
                *n = n.try_normalize().unwrap_or(*computed);
            }
        }
        // Not touching what is a unit vector keeps round trips exact.
        normals.iter_mut().filter(|n| !n.is_normalized()).for_each(|n| *n = n.normalize());
        mesh.normals = normals;
    }
    Ok(mesh)
}

/// Checks parts before writing; total vertices and faces.
fn check_parts(parts: &[(&str, &Mesh)], format: &str) -> Result<(usize, usize)> {
    if parts.is_empty() {
        return Err(invalid(format, "there is nothing to write"));
    }
    for (name, mesh) in parts {
        mesh.validate(name)?;
    }
    let vertices = parts.iter().map(|(_, m)| m.positions.len()).sum();
    let faces = parts.iter().map(|(_, m)| m.triangles.len()).sum();
    if i32::try_from(vertices).is_err() || i32::try_from(faces).is_err() {
        return Err(invalid(format, "more than 2^31 vertices or faces"));
    }
    Ok((vertices, faces))
}

//! The light that leaves every surface as colours of its vertices, for viewers that compute no light.
//!
//! Model: each side of each sheet is a part of its own, 0.05 mm out from the sheet, so that two colours do not fight for
//! one place, its triangles counter-clockwise seen from that side. The colour of a vertex is that of the light which
//! leaves its side,
//!
//! ```text
//! L = B / pi (+ what the surface glows with),   XYZ = sum over wavelengths of L (x, y, z) dl / integral of y dl
//! ```
//!
//! in linear sRGB, through the scene's exposure and tone curve, as in the PNG of a render; so viewers should show it as it
//! is. Triangles that the solution divides are divided here too. Limits: diffuse light only, highlights are spread over all
//! directions; light beyond the screen's range is cut off. Guarded by `baked_colours_are_the_light`. Source: our reading.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::surface::Surface;
use super::{Readout, SIDES, lanes};
use crate::film::ToneMap;
use crate::geometry::{Mesh, Side};
use crate::io::light_table::SIDES as SIDE_NAMES;
use crate::scene::Shape;
use crate::spectrum::color::srgb_decode;
use crate::spectrum::{Band, BandGrid, Observer};
use crate::transport::radiosity::Quantity;
use crate::transport::radiosity::facets::face_normal;
use crate::{Error, Result};

/// How far a side lies out from its sheet.
const OUT_MM: f32 = 0.05;

/// A mesh with colours.
#[derive(Clone, Debug, PartialEq)]
pub struct BakedPart {
    /// Key of the shape, number of the organ, side.
    pub name: String,
    /// The side's surface.
    pub mesh: Mesh,
    /// Linear sRGB of each vertex, 0 to 1.
    pub colors: Vec<[f32; 3]>,
}

/// Values by wavelength of the solution.
type Spectral<'a> = &'a dyn Fn(usize) -> f64;

impl Readout<'_> {
    /// Every side of every shape, light's own bodies excepted. The solution must hold the wavelengths of
    /// [`Band::VISIBLE`] at this step.
    pub fn bake(&self, step_nm: f64, exposure_ev: f32, tone_map: ToneMap) -> Result<Vec<BakedPart>> {
        let wavelengths = self.radiosity.wavelengths_nm();
        let grid = BandGrid::new(&[Band::VISIBLE], step_nm)?.on(wavelengths)?;
        let width = Observer::Cie1931.y_integral_nm();
        let to_rgb = Observer::Cie1931.srgb_from_xyz();
        let weights: Vec<(usize, DVec3)> = grid
            .cells(0)
            .iter()
            .map(|&(i, dl)| (i, to_rgb * DVec3::from(Observer::Cie1931.cmf(wavelengths[i])) * (dl / width)))
            .collect();
        let color = |radiance: Spectral| {
            let rgb = weights.iter().fold(DVec3::ZERO, |sum, (i, w)| sum + *w * radiance(*i));
            tone_map.encode(rgb.as_vec3().to_array(), exposure_ev).map(srgb_decode)
        };
        let shapes: Vec<usize> = (0..self.scene.shapes.len()).filter(|s| !self.is_body(*s)).collect();
        let parts: Vec<BakedPart> = shapes
            .into_par_iter()
            .flat_map_iter(|shape| SIDES.into_iter().map(move |side| (shape, side)))
            .map(|(shape, side)| self.side(shape, side, &color))
            .collect();
        if parts.is_empty() {
            return Err(Error::invalid("bake", "the scene has nothing but lights"));
        }
        Ok(parts)
    }

    /// Is the shape the black body of a light?
    fn is_body(&self, shape: usize) -> bool {
        self.scene.shapes[shape].key.starts_with("lights.")
    }

    fn side(&self, shape: usize, side: Side, color: &dyn Fn(Spectral) -> [f32; 3]) -> BakedPart {
        let s = &self.scene.shapes[shape];
        let glow = self.glow(s, side);
        let count = self.radiosity.wavelengths_nm().len();
        let Surface { mut mesh, values, .. } = self.surface(shape, side, Quantity::Leaving);
        turn(&mut mesh, side);
        let radiance = |v: &[f32]| color(&|i| f64::from(v[i]) / PI + glow[i]);
        let colors = values.chunks(count).map(radiance).collect();
        let organ = if s.organ_id > 0 { format!("_{}", s.organ_id) } else { String::new() };
        BakedPart { name: format!("{}{organ}_{}", s.key, SIDE_NAMES[side as usize]), mesh, colors }
    }

    /// Radiance that the side of a shape glows with.
    fn glow(&self, shape: &Shape, side: Side) -> Vec<f64> {
        let wavelengths = self.radiosity.wavelengths_nm();
        let wo = if side == Side::Adaxial { Vec3::Z } else { -Vec3::Z };
        let Some(emitter) = shape.emitter else { return vec![0.0; wavelengths.len()] };
        let of = |l| self.scene.lights.emitted(emitter, Vec3::Z, wo, &l).0;
        lanes(wavelengths).into_iter().flat_map(of).map(f64::from).take(wavelengths.len()).collect()
    }
}

/// Lets a mesh face one side, and moves it there.
fn turn(mesh: &mut Mesh, side: Side) {
    let up = if side == Side::Adaxial { 1.0 } else { -1.0 };
    for face in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(face);
        let winding = (b - a).cross(c - a).dot(face_normal(mesh, face)) * up;
        if winding < 0.0 {
            mesh.triangles[face].swap(1, 2);
        }
    }
    if mesh.normals.is_empty() {
        mesh.compute_normals();
    } else {
        mesh.normals.iter_mut().for_each(|n| *n *= up);
    }
    for (p, n) in mesh.positions.iter_mut().zip(&mesh.normals) {
        *p += *n * OUT_MM;
    }
}

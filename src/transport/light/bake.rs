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

use std::collections::HashMap;
use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

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
        let color = |radiance: &dyn Fn(usize) -> f64| {
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

    fn side(&self, shape: usize, side: Side, color: &dyn Fn(&dyn Fn(usize) -> f64) -> [f32; 3]) -> BakedPart {
        let s = &self.scene.shapes[shape];
        let glow = self.glow(s, side);
        let count = self.radiosity.wavelengths_nm().len();
        let (mut mesh, values) = self.surface(shape, side);
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

    /// A mesh as fine as the solution, and the radiosity of its vertices at all wavelengths.
    fn surface(&self, shape: usize, side: Side) -> (Mesh, Vec<f32>) {
        let own = &self.scene.shapes[shape].mesh;
        let facets = self.radiosity.elements().facets();
        let parts = |face: u32| facets.of_face(shape as u32, face);
        let faces = own.triangles.len() as u32;
        if (0..faces).all(|f| parts(f).is_none_or(|p| p.1 == 1)) {
            let values = self.radiosity.vertices(self.scene, shape as u32, side, Quantity::Leaving);
            return (Mesh { uvs: Vec::new(), ..own.clone() }, values);
        }
        let count = self.radiosity.wavelengths_nm().len();
        let (mut mesh, mut values, mut meeting) = (Mesh::default(), Vec::new(), Vec::new());
        let mut known: HashMap<[u32; 6], u32> = HashMap::new();
        for (face, (first, n)) in (0..faces).filter_map(|f| Some((f, parts(f)?))) {
            for facet in first..first + n {
                let (corners, weights) = facets.corners(self.scene, facet);
                let element = self.radiosity.elements().of_facet(facet);
                let normals = own.triangles[face as usize].map(|i| own.normals.get(i as usize));
                let triangle = [0, 1, 2].map(|k| {
                    let b = weights[k];
                    let normal = match normals {
                        [Some(p), Some(q), Some(r)] => (*p * b.x + *q * b.y + *r * b.z).normalize_or_zero(),
                        _ => face_normal(own, face as usize).normalize_or_zero(),
                    };
                    let key = [corners[k], normal].map(|v| (v + Vec3::ZERO).to_array().map(f32::to_bits));
                    let key: [u32; 6] = std::array::from_fn(|i| key[i / 3][i % 3]);
                    let vertex = *known.entry(key).or_insert_with(|| {
                        mesh.positions.push(corners[k]);
                        mesh.normals.push(normal);
                        values.resize(mesh.positions.len() * count, 0.0f32);
                        meeting.push(0u32);
                        meeting.len() as u32 - 1
                    });
                    let at = self.radiosity.at(element, side, corners[k], Quantity::Leaving);
                    for (sum, v) in values[vertex as usize * count..].iter_mut().zip(at) {
                        *sum += v;
                    }
                    meeting[vertex as usize] += 1;
                    vertex
                });
                mesh.triangles.push(triangle);
            }
        }
        for (values, n) in values.chunks_mut(count).zip(meeting) {
            values.iter_mut().for_each(|v| *v /= n as f32);
        }
        (mesh, values)
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

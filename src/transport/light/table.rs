//! Light per organ, petal, shape, triangle or element.
//!
//! Model: sums over the elements of a group,
//!
//! ```text
//! E = sum over elements of A_e E_e / sum of A_e       absorbed, transmitted: the same;   absorbed power = A (absorbed)
//! ```
//!
//! for each side, integrated over each band, so that the absorbed power of the groups adds up to the ledger's
//! (`groups_add_up_to_the_ledger`). Triangles: the mean of the solution over the triangle,
//! linear within elements, whose sum is that of the elements. Source: our reading.

use std::collections::HashMap;
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::{Readout, SIDES, organ_of};
use crate::io::light_table::{Flux, Group, LightTable};
use crate::scene::Scene;
use crate::transport::radiosity::Quantity;
use crate::{Error, Result};

/// What a row of the table is about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Per {
    /// Each organ of a flower, and each shape that is none.
    #[default]
    Organ,
    /// Each petal; nothing else.
    Petal,
    /// Each shape of the scene file.
    Shape,
    /// Each triangle of the meshes.
    Triangle,
    /// Each element of the solution.
    Element,
}

impl Per {
    /// Has the scene what the rows are about? Worth asking before the light is computed.
    pub fn check(self, scene: &Scene) -> Result<()> {
        if self == Per::Petal && scene.shapes.iter().all(|s| s.petal_id == 0) {
            let what = "the scene has no petal: choose organ, shape, triangle or element";
            return Err(Error::invalid("per", what));
        }
        Ok(())
    }
}

const QUANTITIES: [Quantity; 3] = [Quantity::Incident, Quantity::Absorbed, Quantity::Transmitted];

impl Readout<'_> {
    /// The table. `about` heads it.
    pub fn table(&self, per: Per, about: Vec<String>) -> Result<LightTable> {
        let mut table = LightTable { about, bands: self.bands.clone(), ..LightTable::default() };
        match per {
            Per::Triangle => self.triangles(&mut table),
            Per::Element => self.elements(&mut table),
            Per::Organ | Per::Petal | Per::Shape => self.sums(per, &mut table),
        }
        per.check(self.scene)?;
        Ok(table)
    }

    fn group(&self, shape: usize, keys: &[Arc<str>]) -> Group {
        let s = &self.scene.shapes[shape];
        Group {
            shape: keys[shape].clone(),
            organ: organ_of(s),
            organ_id: s.organ_id,
            petal_id: s.petal_id,
            index: 0,
            area_mm2: 0.0,
            centre_mm: [0.0; 3],
        }
    }

    /// Keys of the shapes, shared by all rows.
    fn keys(&self) -> Vec<Arc<str>> {
        self.scene.shapes.iter().map(|s| s.key.as_str().into()).collect()
    }

    /// Light of an element: side by side, band by band.
    fn of_element(&self, element: u32) -> Vec<Flux> {
        SIDES
            .into_iter()
            .flat_map(|side| {
                let values = QUANTITIES.map(|q| self.radiosity.element(element, side, q));
                (0..self.bands.len()).map(move |b| {
                    let [incident, absorbed, transmitted] =
                        [0, 1, 2].map(|q| self.flux(b, |i| f64::from(values[q][i])));
                    Flux { incident, absorbed, transmitted }
                })
            })
            .collect()
    }

    fn elements(&self, table: &mut LightTable) {
        let keys = self.keys();
        table.index_name = Some("element");
        let list = self.radiosity.elements().list();
        table.groups = list
            .iter()
            .enumerate()
            .map(|(k, e)| Group {
                index: k as u32,
                area_mm2: f64::from(e.area_mm2),
                centre_mm: e.centre.as_dvec3().to_array(),
                ..self.group(e.shape as usize, &keys)
            })
            .collect();
        let light: Vec<Vec<Flux>> =
            (0..list.len() as u32).into_par_iter().with_min_len(64).map(|e| self.of_element(e)).collect();
        table.light = light.concat();
    }

    fn sums(&self, per: Per, table: &mut LightTable) {
        let keys = self.keys();
        // Group of each shape.
        let mut by_key: HashMap<Arc<str>, usize> = HashMap::new();
        let of_shape: Vec<Option<usize>> = (0..keys.len())
            .map(|s| {
                if per == Per::Petal && self.scene.shapes[s].petal_id == 0 {
                    return None;
                }
                if per == Per::Shape
                    && let Some(found) = by_key.get(&keys[s])
                {
                    return Some(*found);
                }
                let mut group = self.group(s, &keys);
                if per == Per::Shape {
                    by_key.insert(keys[s].clone(), table.groups.len());
                    // Several organs are one shape of the file.
                    (group.organ, group.organ_id, group.petal_id) = ("", 0, 0);
                }
                table.groups.push(group);
                Some(table.groups.len() - 1)
            })
            .collect();
        let per_group = 2 * self.bands.len();
        table.light = vec![Flux::default(); table.groups.len() * per_group];
        let mut centres = vec![DVec3::ZERO; table.groups.len()];
        let list = self.radiosity.elements().list();
        let light: Vec<Vec<Flux>> =
            (0..list.len() as u32).into_par_iter().with_min_len(64).map(|e| self.of_element(e)).collect();
        for (e, values) in list.iter().zip(light) {
            let Some(group) = of_shape[e.shape as usize] else { continue };
            let area = f64::from(e.area_mm2);
            table.groups[group].area_mm2 += area;
            centres[group] += area * e.centre.as_dvec3();
            for (sum, v) in table.light[group * per_group..].iter_mut().zip(values) {
                for u in 0..2 {
                    sum.incident[u] += area * v.incident[u];
                    sum.absorbed[u] += area * v.absorbed[u];
                    sum.transmitted[u] += area * v.transmitted[u];
                }
            }
        }
        for (k, group) in table.groups.iter_mut().enumerate() {
            // A shape whose triangles have no area gets zeros.
            let mean = if group.area_mm2 > 0.0 { 1.0 / group.area_mm2 } else { 0.0 };
            group.centre_mm = (centres[k] * mean).to_array();
            for f in &mut table.light[k * per_group..(k + 1) * per_group] {
                for part in [&mut f.incident, &mut f.absorbed, &mut f.transmitted] {
                    *part = part.map(|v| v * mean);
                }
            }
        }
    }

    fn triangles(&self, table: &mut LightTable) {
        let keys = self.keys();
        table.index_name = Some("triangle");
        let count = self.radiosity.wavelengths_nm().len();
        let of_shape: Vec<Vec<Flux>> = (0..keys.len())
            .into_par_iter()
            .map(|shape| {
                let faces = self.scene.shapes[shape].mesh.triangles.len();
                let bands = self.bands.len();
                let mut light = vec![Flux::default(); faces * 2 * bands];
                for (s, side) in SIDES.into_iter().enumerate() {
                    for quantity in QUANTITIES {
                        let values = self.radiosity.faces(self.scene, shape as u32, side, quantity);
                        for (face, values) in values.chunks(count).enumerate() {
                            for b in 0..bands {
                                let flux = &mut light[(face * 2 + s) * bands + b];
                                let part = match quantity {
                                    Quantity::Absorbed => &mut flux.absorbed,
                                    Quantity::Transmitted => &mut flux.transmitted,
                                    _ => &mut flux.incident,
                                };
                                *part = self.flux(b, |i| f64::from(values[i]));
                            }
                        }
                    }
                }
                light
            })
            .collect();
        for (shape, light) in of_shape.into_iter().enumerate() {
            let mesh = &self.scene.shapes[shape].mesh;
            let group = self.group(shape, &keys);
            table.groups.extend((0..mesh.triangles.len()).map(|face| {
                let [a, b, c] = mesh.corners(face);
                Group {
                    index: face as u32,
                    area_mm2: f64::from(mesh.face_area(face)),
                    centre_mm: ((a + b + c) / 3.0).as_dvec3().to_array(),
                    ..group.clone()
                }
            }));
            table.light.extend(light);
        }
    }
}

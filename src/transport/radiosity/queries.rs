//! What can be asked of a solution: light of elements, at points, of triangles and vertices, and along a path.
//!
//! Model: irradiance runs linearly within an element; what is reflected, transmitted and absorbed of it is the same
//! share all over the element. Between wavelengths light is linear relative to the spectrum of all lights together.
//! Source: our reading.

use glam::Vec3;

use super::elements::{Elements, node};
use super::ledger::Ledger;
use super::solve::total;
use super::{Quantity, Radiosity};
use crate::geometry::{Interaction, Side};
use crate::scene::Scene;
use crate::spectrum::{LANES, SampledSpectrum, SampledWavelengths, VISIBLE_NM};

impl Radiosity {
    /// The wavelengths, nm.
    pub fn wavelengths_nm(&self) -> &[f32] {
        &self.wavelengths_nm
    }

    /// The elements.
    pub fn elements(&self) -> &Elements {
        &self.elements
    }

    /// Where the light went.
    pub fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// Did the iteration reach its goal?
    pub fn converged(&self) -> bool {
        self.converged
    }

    /// Largest share of the direct light, over the wavelengths, that was still under way at the end.
    pub fn residual(&self) -> f64 {
        self.residual
    }

    /// Orders of scattering.
    pub fn orders(&self) -> u32 {
        self.orders
    }

    /// Number of form factors.
    pub fn entries(&self) -> usize {
        self.entries
    }

    /// The largest share by which the light of an order had to be corrected so that none is lost or made.
    pub fn imbalance(&self) -> f64 {
        self.imbalance
    }

    /// Values of an element's side at all wavelengths.
    pub fn element(&self, element: u32, side: Side, quantity: Quantity) -> Vec<f32> {
        self.spread(|c| self.quantity(element, side, c, quantity, |n| self.direct[n] + self.indirect[n]))
    }

    /// Power per nm that lights bring to all surfaces at wavelength `k`, in the ledger's unit.
    pub fn arrived(&self, k: usize) -> f64 {
        let (chunk, lane) = (k / LANES, k % LANES);
        let node = |n: usize| {
            f64::from(self.direct[n * self.chunks + chunk][lane])
                * f64::from(self.elements.list()[n / 2].area_mm2)
        };
        (0..2 * self.elements.len()).map(node).sum()
    }

    /// Values at a point of an element, at all wavelengths: irradiance as it runs within the element, the other quantities
    /// as the same shares of it as in the whole element.
    pub fn at(&self, element: u32, side: Side, p: Vec3, quantity: Quantity) -> Vec<f32> {
        self.spread(|c| self.quantity(element, side, c, quantity, |n| self.incident_at(n, p)))
    }

    /// Mean over each triangle of a shape: values of all wavelengths, triangle by triangle. Triangles without area get zeros.
    pub fn faces(&self, scene: &Scene, shape: u32, side: Side, quantity: Quantity) -> Vec<f32> {
        let faces = scene.shapes[shape as usize].mesh.triangles.len() as u32;
        let count = self.wavelengths_nm.len();
        let mut out = Vec::with_capacity(faces as usize * count);
        for face in 0..faces {
            let mut sum = vec![0.0f32; count];
            if let Some((first, facets)) = self.elements.facets().of_face(shape, face) {
                // The facets of a triangle are alike in area.
                for f in first..first + facets {
                    let ([a, b, c], _) = self.elements.facets().corners(scene, f);
                    let values = self.at(self.elements.of_facet(f), side, (a + b + c) / 3.0, quantity);
                    for (s, v) in sum.iter_mut().zip(values) {
                        *s += v / facets as f32;
                    }
                }
            }
            out.extend(sum);
        }
        out
    }

    /// Values at each vertex of a shape: the mean over the elements that meet there, all wavelengths vertex by vertex.
    pub fn vertices(&self, scene: &Scene, shape: u32, side: Side, quantity: Quantity) -> Vec<f32> {
        let mesh = &scene.shapes[shape as usize].mesh;
        let count = self.wavelengths_nm.len();
        let mut out = vec![0.0f32; mesh.positions.len() * count];
        let mut meeting: Vec<Vec<u32>> = vec![Vec::new(); mesh.positions.len()];
        for (face, corners) in mesh.triangles.iter().enumerate() {
            for (k, vertex) in corners.iter().enumerate() {
                let mut b = Vec3::splat(1e-4);
                b[k] = 1.0 - 2e-4;
                if let Some(e) = self.elements.at(shape, face as u32, b) {
                    let meeting = &mut meeting[*vertex as usize];
                    if !meeting.contains(&e) {
                        meeting.push(e);
                    }
                }
            }
        }
        for (vertex, elements) in meeting.iter().enumerate() {
            let sum = &mut out[vertex * count..(vertex + 1) * count];
            for e in elements {
                let values = self.at(*e, side, mesh.positions[vertex], quantity);
                for (s, v) in sum.iter_mut().zip(values) {
                    *s += v / elements.len() as f32;
                }
            }
        }
        out
    }

    /// Irradiance from other surfaces at a hit, at the wavelengths of a path: linear between those of the solution,
    /// relative to the spectrum of the lights.
    pub fn indirect(&self, at: &Interaction, side: Side, lambda: &SampledWavelengths) -> SampledSpectrum {
        self.between(at, lambda, |n, e| self.indirect_at(n, e, at.p), side)
    }

    /// The same for the light that leaves a side: radiosity.
    pub fn leaving(&self, at: &Interaction, side: Side, lambda: &SampledWavelengths) -> SampledSpectrum {
        self.between(
            at,
            lambda,
            |n, e| {
                let (own, c) = (n / self.chunks, n % self.chunks);
                let side = if own.is_multiple_of(2) { Side::Adaxial } else { Side::Abaxial };
                self.quantity(e, side, c, Quantity::Leaving, |n| self.incident_at(n, at.p))
            },
            side,
        )
    }

    fn between(
        &self,
        at: &Interaction,
        lambda: &SampledWavelengths,
        value: impl Fn(usize, u32) -> SampledSpectrum,
        side: Side,
    ) -> SampledSpectrum {
        let Some(e) = self.elements.hit(at) else { return SampledSpectrum::ZERO };
        let first = node(e, side) * self.chunks;
        let nm = &self.wavelengths_nm;
        // Chunks are asked for as the wavelengths, which rise, come to need them.
        let mut held: Option<(usize, SampledSpectrum)> = None;
        let mut relative = |k: usize| {
            let chunk = k / LANES;
            let values = match held {
                Some((c, values)) if c == chunk => values,
                _ => value(first + chunk, e),
            };
            held = Some((chunk, values));
            let light = self.light.0[k];
            if light > 0.0 { values[k % LANES] / light } else { 0.0 }
        };
        SampledSpectrum::from_fn(|lane| {
            let l = lambda.lambda_nm()[lane];
            let high = nm.partition_point(|n| *n < l).min(nm.len() - 1);
            let low = high.saturating_sub(1);
            let t = if high > low { ((l - nm[low]) / (nm[high] - nm[low])).clamp(0.0, 1.0) } else { 0.0 };
            let value = relative(low) * (1.0 - t) + if t > 0.0 { relative(high) * t } else { 0.0 };
            value * self.light_at(l)
        })
    }

    /// Spectrum of all lights together.
    fn light_at(&self, nm: f32) -> f32 {
        let x = (nm - VISIBLE_NM.0).clamp(0.0, (self.light.1.len() - 1) as f32);
        let low = (x as usize).min(self.light.1.len() - 2);
        let t = x - low as f32;
        self.light.1[low] * (1.0 - t) + self.light.1[low + 1] * t
    }

    fn element_of(&self, i: usize) -> u32 {
        (i / self.chunks / 2) as u32
    }

    fn indirect_at(&self, i: usize, element: u32, p: Vec3) -> SampledSpectrum {
        let e = &self.elements.list()[element as usize];
        self.slopes_indirect.at(e, i / self.chunks, i % self.chunks, p, self.indirect[i])
    }

    fn incident_at(&self, i: usize, p: Vec3) -> SampledSpectrum {
        let element = self.element_of(i);
        let e = &self.elements.list()[element as usize];
        let direct = self.slopes_direct.at(e, i / self.chunks, i % self.chunks, p, self.direct[i]);
        direct + self.indirect_at(i, element, p)
    }

    /// A quantity of a node at a chunk, from the irradiance `incident` of this node and of the element's other one.
    fn quantity(
        &self,
        element: u32,
        side: Side,
        chunk: usize,
        quantity: Quantity,
        incident: impl Fn(usize) -> SampledSpectrum,
    ) -> SampledSpectrum {
        let own = node(element, side) * self.chunks + chunk;
        let other = (node(element, side) ^ 1) * self.chunks + chunk;
        let part = |i: usize, of: &dyn Fn(usize) -> SampledSpectrum| {
            let (light, whole, part) = (incident(i), self.direct[i] + self.indirect[i], of(i));
            SampledSpectrum::from_fn(|l| if whole[l] > 0.0 { light[l] * part[l] / whole[l] } else { 0.0 })
        };
        match quantity {
            Quantity::Incident => incident(own),
            Quantity::Absorbed => part(own, &|i| {
                let whole = self.direct[i] + self.indirect[i];
                (whole - self.reflected[i] - self.transmitted[i]).map(|v| v.max(0.0))
            }),
            Quantity::Transmitted => part(own, &|i| self.transmitted[i]),
            Quantity::Leaving => part(own, &|i| self.reflected[i]) + part(other, &|i| self.transmitted[i]),
        }
    }

    fn spread(&self, chunk: impl Fn(usize) -> SampledSpectrum) -> Vec<f32> {
        (0..self.chunks).flat_map(|c| chunk(c).0).take(self.wavelengths_nm.len()).collect()
    }

    pub(super) fn lanes(&self, chunks: &[[f64; LANES]]) -> Vec<f64> {
        chunks.iter().flatten().copied().take(self.wavelengths_nm.len()).collect()
    }

    pub(super) fn absorbed_by_shape(&self, scene: &Scene) -> Vec<[Vec<f64>; 2]> {
        let areas: Vec<f32> = self.elements.list().iter().map(|e| e.area_mm2).collect();
        let of = |shape: usize, side: usize| {
            self.lanes(&total(self.chunks, &areas, |i| {
                let (element, node) = (self.element_of(i), i / self.chunks);
                if self.elements.list()[element as usize].shape as usize != shape || node % 2 != side {
                    return SampledSpectrum::ZERO;
                }
                self.direct[i] + self.indirect[i] - self.reflected[i] - self.transmitted[i]
            }))
        };
        (0..scene.shapes.len()).map(|s| [of(s, 0), of(s, 1)]).collect()
    }
}

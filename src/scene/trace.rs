//! Rays in a scene: the nearest surface, whether a light is seen, and how much of it comes through petals.

use glam::{Vec2, Vec3};

use super::compile::Scene;
use super::material::Material;
use super::pattern::TissueState;
use super::tabulated::Petal;
use crate::geometry::ray::offset_origin;
use crate::geometry::{Interaction, Ray};
use crate::math::Frame;
use crate::spectrum::{SampledSpectrum, SampledWavelengths};

/// A shadow ray stops this share of its length before the light, so that it does not meet the light itself.
const SHADOW_END: f32 = 1.0 - 1e-4;
/// More sheets than this between a point and a light leave it dark.
const MAX_SHEETS: u32 = 64;

/// Point of a triangle. In f64, so that rounding of the coordinates moves the point along the triangle but not off
/// it: what is left is smaller than the step of [`offset_origin`], whatever the size of the triangle.
fn point_on(corners: [Vec3; 3], barycentric: Vec3) -> Vec3 {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    (a + (b - a) * f64::from(barycentric.y) + (c - a) * f64::from(barycentric.z)).as_vec3()
}

impl Scene {
    /// The nearest surface on a ray. The shading frame's normal and `ng` are adaxial; where the interpolated
    /// normal would put the viewer on the wrong side of the sheet, the frame is that of `ng`.
    pub fn intersect(&self, ray: &Ray) -> Option<Interaction> {
        let hit = self.bvh.intersect(ray)?;
        let shape = &self.shapes[hit.shape as usize];
        let mesh = &shape.mesh;
        let corners = mesh.corners(hit.face as usize);
        let [a, b, c] = corners;
        let index = mesh.triangles[hit.face as usize].map(|i| i as usize);
        let weigh3 = |v: [Vec3; 3]| v[0] * hit.b.x + v[1] * hit.b.y + v[2] * hit.b.z;
        let p = point_on(corners, hit.b);
        let ng = (b - a).cross(c - a).normalize_or(Vec3::Z);
        let ns = match mesh.normals.is_empty() {
            true => ng,
            false => weigh3(index.map(|i| mesh.normals[i])).normalize_or(ng),
        };
        // The mesh's winding may be unknown (a file's); its normals then say which side is adaxial.
        let ng = if ng.dot(ns) < 0.0 { -ng } else { ng };
        let wo = -ray.direction;
        let ns = if ns.dot(wo) * ng.dot(wo) > 0.0 { ns } else { ng };
        let (uv, tangent, uv_scale_mm) = if mesh.uvs.is_empty() {
            (Vec2::ZERO, None, Vec2::ZERO)
        } else {
            let [ua, ub, uc] = index.map(|i| mesh.uvs[i]);
            let uv = ua * hit.b.x + ub * hit.b.y + uc * hit.b.z;
            let (e1, e2) = (ub - ua, uc - ua);
            // dp/du solves e1 = (du1, dv1), e2 = (du2, dv2) for the two edges.
            let det = e1.perp_dot(e2);
            let tangent = (det != 0.0).then(|| ((b - a) * e2.y - (c - a) * e1.y) / det);
            // The frame is right-handed; where u, v and the normal are not, v runs against its second tangent.
            let winding = (b - a).cross(c - a).dot(ng);
            let scale = if det * winding < 0.0 {
                shape.uv_scale_mm * Vec2::new(1.0, -1.0)
            } else {
                shape.uv_scale_mm
            };
            (uv, tangent, scale)
        };
        let frame = match tangent {
            Some(t) => Frame::from_normal_tangent(ns, t),
            None => Frame::from_normal(ns),
        };
        Some(Interaction {
            p,
            ng,
            frame,
            uv,
            uv_scale_mm,
            t: hit.t,
            shape: hit.shape,
            face: hit.face,
            b: hit.b,
        })
    }

    /// What a shape's petal is made of at texture coordinates; sound for all materials that do not vary.
    pub fn tissue(&self, shape: u32, uv: Vec2) -> TissueState {
        let shape = &self.shapes[shape as usize];
        match &self.materials[shape.material as usize] {
            Material::Petal(petal) => match &**petal {
                Petal::Tabulated(petal) => petal.state(uv, shape.petal.as_deref()),
                Petal::Cells(_) => TissueState::SOUND,
            },
            _ => TissueState::SOUND,
        }
    }

    /// The ray that leaves `at` in `direction`.
    pub fn leave(at: &Interaction, direction: Vec3) -> Ray {
        Ray::new(offset_origin(at.p, at.ng, direction), direction)
    }

    /// Is the way from `at` along `wi` free for `distance_mm`?
    pub fn unoccluded(&self, at: &Interaction, wi: Vec3, distance_mm: f32) -> bool {
        let ray = Ray { t_max: distance_mm * SHADOW_END, ..Self::leave(at, wi) };
        !self.bvh.occluded(&ray)
    }

    /// Share of light that comes straight through the sheets between `at` and a light at `distance_mm`: the
    /// product of their transmittances, zero behind anything opaque. The thesis' shadows; a sheet really
    /// scatters what it lets through, which `path` follows and this does not.
    pub fn transmitted(
        &self,
        at: &Interaction,
        wi: Vec3,
        distance_mm: f32,
        lambda: &SampledWavelengths,
    ) -> SampledSpectrum {
        let mut ray = Ray { t_max: distance_mm * SHADOW_END, ..Self::leave(at, wi) };
        let mut share = SampledSpectrum::ONE;
        for _ in 0..MAX_SHEETS {
            let Some(sheet) = self.intersect(&ray) else { return share };
            let material = &self.materials[self.shapes[sheet.shape as usize].material as usize];
            let towards_light = sheet.frame.to_local(ray.direction);
            share *= material.transmittance(towards_light, self.tissue(sheet.shape, sheet.uv), lambda);
            if share.max() < 1e-4 {
                break;
            }
            ray = Ray { t_max: ray.t_max - sheet.t, ..Self::leave(&sheet, ray.direction) };
        }
        SampledSpectrum::ZERO
    }
}

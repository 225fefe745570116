//! The point where a ray meets a surface.

use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::math::Frame;

/// Side of a sheet. A petal is one sheet with two sides; the adaxial (upper, inner) one has the normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Upper, inner side: local z > 0.
    Adaxial,
    /// Lower, outer side: local z < 0.
    Abaxial,
}

impl Side {
    /// The side that a local direction leaves from.
    pub fn of(w: Vec3) -> Self {
        if w.z >= 0.0 { Side::Adaxial } else { Side::Abaxial }
    }

    /// The other one.
    pub fn other(self) -> Self {
        match self {
            Side::Adaxial => Side::Abaxial,
            Side::Abaxial => Side::Adaxial,
        }
    }
}

/// A hit. Normals point to the adaxial side, whichever side the ray came from.
#[derive(Clone, Copy, Debug)]
pub struct Interaction {
    /// Point, mm.
    pub p: Vec3,
    /// Geometric normal, adaxial.
    pub ng: Vec3,
    /// Shading frame; `frame.n` is the interpolated adaxial normal, `frame.s` follows increasing u.
    pub frame: Frame,
    /// Texture coordinates, zero without.
    pub uv: Vec2,
    /// Millimetres per unit of u and of v at the hit; zero without texture coordinates. Negative for v where
    /// (u, v, normal) is left-handed: `uv * uv_scale_mm` grows along `frame.s` and `frame.t`.
    pub uv_scale_mm: Vec2,
    /// Distance along the ray, mm.
    pub t: f32,
    /// Shape of the scene that was hit.
    pub shape: u32,
    /// Face of that shape.
    pub face: u32,
    /// Barycentric coordinates in that face.
    pub b: Vec3,
}

//! Orthonormal frames and directions in the shading frame, where +z is the normal.
//!
//! A local direction is a unit `Vec3` in the frame's coordinates; `cos_theta(w) = w.z`.

use glam::Vec3;

/// Right-handed orthonormal frame `s x t = n`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// First tangent.
    pub s: Vec3,
    /// Second tangent.
    pub t: Vec3,
    /// Normal, the local +z.
    pub n: Vec3,
}

impl Frame {
    /// Frame around a unit normal; the tangents are arbitrary but depend on `n` only.
    ///
    /// Duff et al. 2017, "Building an orthonormal basis, revisited": no branch, exact to rounding.
    pub fn from_normal(n: Vec3) -> Self {
        let sign = 1.0f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            s: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// Frame around a unit normal whose first tangent lies as near to `tangent` as the normal lets it;
    /// where they are parallel, [`Frame::from_normal`].
    pub fn from_normal_tangent(n: Vec3, tangent: Vec3) -> Self {
        let s = tangent - n * n.dot(tangent);
        let length_squared = s.length_squared();
        if length_squared.is_nan() || length_squared <= 1e-12 * tangent.length_squared() {
            return Self::from_normal(n);
        }
        let s = s / length_squared.sqrt();
        Self { s, t: n.cross(s), n }
    }

    /// World direction to local.
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    /// Local direction to world.
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}

/// Unit vector at polar angle `theta` from +z and azimuth `phi` from +x, radians.
pub fn spherical(theta: f32, phi: f32) -> Vec3 {
    let (sin_theta, cos_theta) = theta.sin_cos();
    let (sin_phi, cos_phi) = phi.sin_cos();
    Vec3::new(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta)
}

/// Do both directions leave the same side of the surface?
pub fn same_side(a: Vec3, b: Vec3) -> bool {
    a.z * b.z > 0.0
}

/// Mirror direction of `w` about +z: both point away from the surface.
pub fn mirror(w: Vec3) -> Vec3 {
    Vec3::new(-w.x, -w.y, w.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_and_invert() {
        for i in 0..1000 {
            let n = spherical(i as f32 * 0.003_141_5, i as f32 * 2.399_963);
            for f in [Frame::from_normal(n), Frame::from_normal_tangent(n, Vec3::new(0.3, -0.2, 0.7))] {
                assert!((f.s.cross(f.t) - f.n).length() < 1e-5);
                let v = spherical(1.0, i as f32);
                assert!((f.to_world(f.to_local(v)) - v).length() < 1e-5);
            }
        }
    }
}

//! A smooth cell wall: a thin plate between two media, at which light is reflected or refracted.
//!
//! Model: plane parallel plate without interference. Per polarisation, with Fresnel's reflectances of its two faces,
//! all orders of reflection inside it add up:
//!
//! ```text
//! R = (R1 + R2 - 2 R1 R2) / (1 - R1 R2),   n_o sin(theta_o) = n_w sin(theta_w) = n_i sin(theta_i)
//! ```
//!
//! and the mean of both polarisations counts; where one face reflects totally R = 1. The plate shifts no ray: light goes on
//! by Snell's law between the two media.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | n_o | `outer_index` | | |
//! | n_w | `wall_index` | | |
//! | n_i | `inner_index` | | |
//!
//! Limits: polarisation is forgotten at each wall; walls are thicker than light is coherent for and thinner than they shift
//! rays (our reading: cell walls of 0.3 to 3 um whose thickness varies). Guarded by `plate_agrees_with_its_faces`,
//! `both_ways_alike`. Source: Born and Wolf, Principles of Optics, 1.5.2 (Fresnel) and 1.6.4 (plate).

use glam::DVec3;

/// A plate of index `wall_index` between an outer and an inner medium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// Index of the outer medium.
    pub outer_index: f64,
    /// Index of the plate.
    pub wall_index: f64,
    /// Index of the inner medium.
    pub inner_index: f64,
}

impl Wall {
    /// The same wall seen from within: the media change places.
    pub fn turned(&self) -> Self {
        Self { outer_index: self.inner_index, wall_index: self.wall_index, inner_index: self.outer_index }
    }

    /// Share of unpolarised light from the outer medium that is reflected. `cos` is that of its angle to the normal, 0 to 1.
    pub fn reflectance(&self, cos: f64) -> f64 {
        let outer = self.outer_index * cos;
        // (n cos)^2 = n^2 - (n sin)^2 in each medium, the last term common to all.
        let sin2 = self.outer_index * self.outer_index - outer * outer;
        let normal = |index: f64| index * index - sin2;
        let (wall2, inner2) = (normal(self.wall_index), normal(self.inner_index));
        if wall2 <= 0.0 || inner2 <= 0.0 || cos <= 0.0 {
            return 1.0;
        }
        let (wall, inner) = (wall2.sqrt(), inner2.sqrt());
        let (no2, nw2, ni2) = (
            self.outer_index * self.outer_index,
            self.wall_index * self.wall_index,
            self.inner_index * self.inner_index,
        );
        let face = |a: f64, b: f64| ((a - b) / (a + b)).powi(2);
        let plate = |r1: f64, r2: f64| (r1 + r2 - 2.0 * r1 * r2) / (1.0 - r1 * r2);
        let s = plate(face(outer, wall), face(wall, inner));
        // Parallel: n2 cos1 and n1 cos2, times n1 n2 each, are n2^2 (n1 cos1) and n1^2 (n2 cos2).
        let p = plate(face(nw2 * outer, no2 * wall), face(ni2 * wall, nw2 * inner));
        0.5 * (s + p)
    }

    /// Direction in the inner medium of light of unit direction `d` in the outer one; `normal` is the unit normal on d's side
    /// (`d.normal < 0`). None where it is totally reflected.
    pub fn refract(&self, d: DVec3, normal: DVec3) -> Option<DVec3> {
        let eta = self.outer_index / self.inner_index;
        let cos = -d.dot(normal);
        let cos2 = 1.0 - eta * eta * (1.0 - cos * cos);
        (cos2 > 0.0).then(|| (d * eta + normal * (eta * cos - cos2.sqrt())).normalize())
    }

    /// Sends light of unit direction `d` from the outer medium on: its new direction, and whether it crossed the wall. `u` is
    /// uniform in [0, 1); `normal` as in [`Wall::refract`].
    pub fn meet(&self, d: DVec3, normal: DVec3, u: f64) -> (DVec3, bool) {
        let cos = -d.dot(normal);
        if u >= self.reflectance(cos) {
            if let Some(through) = self.refract(d, normal) {
                return (through, true);
            }
        }
        ((d + normal * (2.0 * cos)).normalize(), false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fresnel's reflectances of one face from angles: s and p.
    fn fresnel(n1: f64, n2: f64, t1: f64) -> (f64, f64) {
        let s = n1 * t1.sin() / n2;
        if s >= 1.0 {
            return (1.0, 1.0);
        }
        let t2 = s.asin();
        if t1 == 0.0 {
            let r = ((n1 - n2) / (n1 + n2)).powi(2);
            return (r, r);
        }
        (((t1 - t2).sin() / (t1 + t2).sin()).powi(2), ((t1 - t2).tan() / (t1 + t2).tan()).powi(2))
    }

    #[test]
    fn plate_agrees_with_its_faces() {
        for (no, nw, ni) in [(1.0, 1.425, 1.35), (1.35, 1.425, 1.0), (1.0, 1.5, 1.5), (1.5, 1.0, 1.5)] {
            let wall = Wall { outer_index: no, wall_index: nw, inner_index: ni };
            for i in 0..90 {
                let theta = f64::from(i).to_radians();
                let (s1, p1) = fresnel(no, nw, theta);
                let (s2, p2) = fresnel(nw, ni, (no * theta.sin() / nw).clamp(0.0, 1.0).asin());
                // Orders inside the plate, added one by one.
                let orders = |r1: f64, r2: f64| {
                    let (mut total, mut inside) = (r1, 1.0 - r1);
                    for _ in 0..100_000 {
                        inside *= r2;
                        total += inside * (1.0 - r1);
                        inside *= r1;
                    }
                    total
                };
                let expected =
                    if s1 == 1.0 || s2 == 1.0 { 1.0 } else { 0.5 * (orders(s1, s2) + orders(p1, p2)) };
                let got = wall.reflectance(theta.cos());
                assert!((got - expected).abs() < 1e-9, "{no} {nw} {ni} at {i}: {got} {expected}");
            }
        }
        // A plate of an outer index is one face: 0.04 for glass.
        let glass = Wall { outer_index: 1.0, wall_index: 1.0, inner_index: 1.5 };
        assert!((glass.reflectance(1.0) - 0.04).abs() < 1e-12);
        assert_eq!(glass.reflectance(0.0), 1.0);
    }

    #[test]
    fn both_ways_alike() {
        let wall = Wall { outer_index: 1.0, wall_index: 1.425, inner_index: 1.35 };
        let normal = DVec3::Z;
        for i in 0..90 {
            let t = (f64::from(i) + 0.5).to_radians();
            let d = DVec3::new(t.sin(), 0.0, -t.cos());
            let through = wall.refract(d, normal).expect("denser");
            assert!((through.x - d.x / 1.35).abs() < 1e-12 && through.z < 0.0);
            let back = wall.turned().refract(-through, -normal).expect("less than the critical angle");
            assert!((back + d).length() < 1e-9);
            assert!((wall.reflectance(t.cos()) - wall.turned().reflectance(-through.z)).abs() < 1e-9);
        }
        // Beyond the critical angle of 47.8 degrees nothing leaves.
        let steep = DVec3::new(0.75, 0.0, (1.0f64 - 0.75 * 0.75).sqrt());
        assert_eq!(wall.turned().refract(steep, -normal), None);
        let (reflected, crossed) = wall.turned().meet(steep, -normal, 0.999_999);
        assert!(!crossed && (reflected - DVec3::new(steep.x, 0.0, -steep.z)).length() < 1e-12);
    }
}

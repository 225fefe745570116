//! The point of a dome that faces a direction, and how sharply the dome bends there.
//!
//! Model: on an upright dome z = H g(r/R) the normal leans from the axis by the slope s = -h'(r), away from it, so where s
//! is monotone in r each direction up to the steepest has one point. Normals cover solid angle K per area, with K the
//! Gauss curvature of the surface of revolution:
//!
//! ```text
//! n = (s e_r, 1) / sqrt(1 + s^2),    K = (s / r) s'(r) / (1 + s^2)^2
//! ```
//!
//! | symbol | where from | unit |
//! |---|---|---|
//! | H, R, g | [`Dome`](super::Dome) | um, um, 1 |
//! | K | [`CellField::curvature_per_um2`] | sr/um^2 |
//!
//! Limits: regular cells only, which stand upright and are alike; the inner half of `raised_cosine`, and no point of a cone
//! or of the base. Guarded by `points_face_their_direction` and `curvature_is_solid_angle_per_area`. Source: differential
//! geometry of surfaces of revolution.

use glam::{DVec2, DVec3};

use super::{CellField, CellHit, HitKind, Place};
use crate::micro::dome::Profile;

use std::f64::consts::{FRAC_PI_2, PI};

impl Profile {
    /// -g'(x) and -g''(x) at x = r/R, where the slope grows outwards.
    fn steepening(self, x: f64) -> Option<(f64, f64)> {
        let rises = match self {
            Profile::RaisedCosine => x < 0.5,
            _ => x < 1.0,
        };
        if !rises {
            return None;
        }
        match self {
            Profile::Cosine | Profile::CosineInner => {
                let (sin, cos) = (FRAC_PI_2 * x).sin_cos();
                Some((FRAC_PI_2 * sin, FRAC_PI_2 * FRAC_PI_2 * cos))
            }
            Profile::RaisedCosine => {
                let (sin, cos) = (PI * x).sin_cos();
                Some((FRAC_PI_2 * sin, 0.5 * PI * PI * cos))
            }
            Profile::Paraboloid => Some((2.0 * x, 2.0)),
            Profile::Papilla => Some((4.0 * x * x * x, 12.0 * x * x)),
            Profile::Cone | Profile::Flat => None,
        }
    }

    /// x = r/R where -g'(x) = `slope`.
    fn at_slope(self, slope: f64) -> Option<f64> {
        let arc = || (slope <= FRAC_PI_2).then(|| (slope / FRAC_PI_2).asin());
        match self {
            Profile::Cosine | Profile::CosineInner => arc().map(|a| a / FRAC_PI_2),
            Profile::RaisedCosine => arc().map(|a| a / PI),
            Profile::Paraboloid => Some(0.5 * slope),
            Profile::Papilla => Some((0.25 * slope).cbrt()),
            Profile::Cone | Profile::Flat => None,
        }
    }
}

impl CellField {
    /// Can points be found by the direction that they face?
    pub(crate) fn faces(&self) -> bool {
        self.description.is_regular()
            && self.max_height > 0.0
            && !matches!(self.profile, Profile::Cone | Profile::Flat)
    }

    /// The point of a cell whose normal is `normal`; where [`CellField::faces`] says that there are any.
    pub(crate) fn facing(&self, normal: DVec3) -> Option<CellHit> {
        let cell = self.cells.first()?;
        let flat = normal.truncate();
        let lean = flat.length();
        let radius = cell.inv_radius_squared.sqrt().recip();
        if normal.z <= 0.0 {
            return None;
        }
        let x = self.profile.at_slope(lean / normal.z * radius / cell.height)?;
        self.profile.steepening(x)?;
        let q = if lean > 0.0 { flat * (x * radius / lean) } else { DVec2::ZERO };
        if self.edges_of(cell).iter().any(|e| q.dot(e.delta) > e.half) {
            return None;
        }
        let z = cell.height * self.profile.at_square(x * x).0;
        let place = Place { cell: 0, site: cell.site };
        Some(CellHit {
            t_um: 0.0,
            p: (cell.site + q).extend(z.max(0.0)),
            normal,
            cell: 0,
            site_um: cell.site,
            kind: HitKind::Dome,
            air: place,
        })
    }

    /// Solid angle of normals per area of the surface, where [`CellField::facing`] may find it; else 0.
    pub(crate) fn curvature_per_um2(&self, at: &CellHit) -> f64 {
        if at.kind != HitKind::Dome {
            return 0.0;
        }
        let cell = &self.cells[at.cell as usize];
        let inv = cell.inv_radius_squared;
        // Not nearer to the axis than where s / r is still a quotient of numbers.
        let x = ((at.p.truncate() - at.site_um).length_squared() * inv).sqrt().max(1e-9);
        let Some((slope, bend)) = self.profile.steepening(x) else { return 0.0 };
        let ratio = cell.height * cell.height * inv;
        ratio * inv * (slope / x) * bend / (1.0 + ratio * slope * slope).powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::hash_to_unit;
    use crate::micro::CellDescription;

    fn fields() -> impl Iterator<Item = CellField> {
        Profile::ALL.into_iter().map(|profile| {
            CellField::new(&CellDescription { profile, ..CellDescription::default() }).expect("valid")
        })
    }

    #[test]
    fn points_face_their_direction() {
        for field in fields() {
            let mut found = 0;
            for k in 0..4000 {
                // Hits of upright rays: their normals lead back to the same place of the dome.
                let xy = DVec2::new(hash_to_unit(2 * k), hash_to_unit(2 * k + 1)) * field.tile_um();
                let hit = field.first_hit(xy.extend(40.0), DVec3::NEG_Z).expect("hit");
                if field.curvature_per_um2(&hit) <= 0.0 {
                    continue;
                }
                let again = field.facing(hit.normal).expect("a curved point is found");
                let offset = |h: &CellHit| h.p - h.site_um.extend(0.0);
                assert!((offset(&again) - offset(&hit)).length() < 1e-5, "{hit:?} {again:?}");
                let (a, b) = (field.curvature_per_um2(&again), field.curvature_per_um2(&hit));
                assert!((a - b).abs() < 1e-5 * b.max(1e-3), "{a} {b}");
                found += 1;
            }
            assert_eq!(found > 500, field.faces(), "{:?}: {found}", field.description().profile);
            for far in [DVec3::X, DVec3::NEG_Z, DVec3::ZERO, DVec3::new(0.999_999, 0.0, 1e-3)] {
                assert!(field.facing(far).is_none());
            }
        }
    }

    #[test]
    fn curvature_is_solid_angle_per_area() {
        // The solid angle of three normals over the area of the triangle of their points.
        for field in fields().filter(CellField::faces) {
            for k in 0..200 {
                let (theta, phi) = (0.1 + hash_to_unit(3 * k), 6.3 * hash_to_unit(3 * k + 1));
                let n = |dt: f64, dp: f64| {
                    let (sin, cos) = (theta + dt).sin_cos();
                    (DVec2::from_angle(phi + dp) * sin).extend(cos)
                };
                let e = 1e-5;
                let normals = [n(0.0, 0.0), n(e, 0.0), n(0.0, e)];
                let Some(points) = normals.map(|n| field.facing(n)).into_iter().collect::<Option<Vec<_>>>()
                else {
                    continue;
                };
                let area = |a: DVec3, b: DVec3, c: DVec3| 0.5 * (b - a).cross(c - a).length();
                let [a, b, c] = normals;
                let exact = area(a, b, c) / area(points[0].p, points[1].p, points[2].p);
                let got = field.curvature_per_um2(&points[0]);
                assert!((got / exact - 1.0).abs() < 1e-3, "{:?} {got} {exact}", field.description().profile);
            }
        }
    }
}

//! Points of the domes found by their normal: where a sharp lobe gets its light from.
//!
//! Model: a lobe of exponent n lights, for a view and a lamp, only domes' points whose normal is within about
//! 1 / (2 sqrt(n)) of the half vector h: a few of a million points spread over the petal. So, beside those, points are
//! drawn with a normal N of density
//!
//! ```text
//! p(N) = mean over m of (m + 1) / (2 pi) (N.h)^m,   m = 32, 256, 1024  (about 4 n)
//! ```
//!
//! on a random cell. On a dome z = h(r) the normal's angle theta from the axis tells r: tan(theta) = -h'(r). Per area of
//! the plane their density is p(N) / (J C), with C cells and
//!
//! ```text
//! J = dA / dw = r / (sin(theta) cos^2(theta) |h''(r)|)
//! ```
//!
//! Both kinds of points are weighted by the balance heuristic: each counts as the sum of the densities with which any of
//! them could have found it, so nothing is counted twice and no weight is large.
//!
//! Limits: none for flat cells, cones (one normal for all r) and tilted axes, where the points spread over the petal do
//! all the work. Guarded by `normals_tell_the_radius` and `both_kinds_of_points_agree`.
//! Source: our reading; Veach, Robust Monte Carlo methods, 1997, for the heuristic.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec2, Vec3};

use crate::math::Frame;
use crate::math::warp::square_to_power_cosine;
use crate::micro::{CellField, CellHit, HitKind, Profile};

/// Doublings of the exponents m, beginning with 32.
const DOUBLINGS: [u32; 3] = [0, 3, 5];
const FIRST_EXPONENT: f32 = 32.0;

/// A surface whose domes' points can be found.
pub(super) struct Facets<'a> {
    field: &'a CellField,
    profile: Profile,
    /// Area of the tile, um^2.
    area: f64,
}

/// A point with its density.
pub(super) struct Facet {
    /// The point.
    pub(super) hit: CellHit,
    /// [`Facets::density`] of it.
    pub(super) density: f64,
}

impl<'a> Facets<'a> {
    /// `None` where the normal does not tell the place.
    pub(super) fn new(field: &'a CellField) -> Option<Self> {
        let cells = field.description();
        let tells = !matches!(cells.profile, Profile::Cone | Profile::Flat)
            && cells.height_um > 0.0
            && cells.tilt_disorder_deg == 0.0;
        let area = field.tile_um().element_product();
        tells.then_some(Self { field, profile: cells.profile, area })
    }

    /// Calls `on` with the points whose normal is the one that the random numbers draw, for the half vector `half`.
    pub(super) fn draw(&self, half: Vec3, u: Vec2, which: f32, cell: f32, mut on: impl FnMut(&Facet)) {
        let lobe = ((which * DOUBLINGS.len() as f32) as usize).min(DOUBLINGS.len() - 1);
        let m = FIRST_EXPONENT * (1u32 << DOUBLINGS[lobe]) as f32;
        let normal = Frame::from_normal(half).to_world(square_to_power_cosine(u, m)).as_dvec3();
        if normal.z <= 0.0 {
            return;
        }
        let count = self.field.cell_count();
        let cell = ((f64::from(cell) * count as f64) as usize).min(count - 1) as u32;
        let dome = self.field.dome(cell);
        let site = self.field.lattice().cells[cell as usize].site_um;
        let (side, steepness) =
            (normal.truncate().normalize_or_zero(), normal.truncate().length() / normal.z);
        for rho in radii(self.profile, steepness * dome.radius_um / dome.height_um).into_iter().flatten() {
            let above = (site + side * (rho * dome.radius_um)).extend(self.field.max_height_um());
            let Some(hit) = self.field.first_hit(above, DVec3::NEG_Z) else { continue };
            // Beyond the cell's side another dome stands there.
            if hit.kind == HitKind::Dome && hit.cell == cell {
                on(&Facet { density: self.density(&hit, half), hit });
            }
        }
    }

    /// Probability per area of the plane, times the tile's area, of drawing this point.
    pub(super) fn density(&self, hit: &CellHit, half: Vec3) -> f64 {
        if hit.kind != HitKind::Dome {
            return 0.0;
        }
        let dome = self.field.dome(hit.cell);
        let rho = (hit.p.truncate() - hit.site_um).length() / dome.radius_um;
        let (steepness, bend) = shape(self.profile, rho);
        // J / R^2 = rho / (sin cos^2 (H/R) bend), with rho / sin taken together: both vanish at the top.
        let ratio = dome.height_um / dome.radius_um;
        let (cos, scale) = (hit.normal.z, dome.radius_um * dome.radius_um);
        let rho_by_sin = if rho > 1e-7 { rho / (ratio * steepness * cos) } else { 1.0 / (ratio * bend) };
        let jacobian = scale * rho_by_sin / (cos * cos * ratio * bend.abs());
        let density = lobes(half.dot(hit.normal.as_vec3())) / jacobian;
        if density.is_finite() { density * self.area / self.field.cell_count() as f64 } else { 0.0 }
    }
}

/// p(N) from N.h.
fn lobes(cos: f32) -> f64 {
    if cos <= 0.0 {
        return 0.0;
    }
    // cos^32, then squared on.
    let mut power = (0..5).fold(cos, |c, _| c * c);
    let mut sum = 0.0;
    for doubling in 0..=DOUBLINGS[DOUBLINGS.len() - 1] {
        if DOUBLINGS.contains(&doubling) {
            sum += f64::from(FIRST_EXPONENT * (1u32 << doubling) as f32 + 1.0) * f64::from(power);
        }
        power = if power > 1e-15 { power * power } else { 0.0 };
    }
    sum / (TAU * DOUBLINGS.len() as f64)
}

/// -R/H h'(r) and -R^2/H h''(r) at r = rho R.
fn shape(profile: Profile, rho: f64) -> (f64, f64) {
    let half = 0.5 * PI;
    match profile {
        Profile::Cosine | Profile::CosineInner => {
            (half * (half * rho).sin(), half * half * (half * rho).cos())
        }
        Profile::RaisedCosine => (half * (PI * rho).sin(), PI * half * (PI * rho).cos()),
        Profile::Paraboloid => (2.0 * rho, 2.0),
        Profile::Papilla => (4.0 * rho.powi(3), 12.0 * rho * rho),
        Profile::Cone => (1.0, 0.0),
        Profile::Flat => (0.0, 0.0),
    }
}

/// Every rho up to 1 with this -R/H h'(r).
fn radii(profile: Profile, steepness: f64) -> [Option<f64>; 2] {
    let half = 0.5 * PI;
    let within = |rho: f64| (rho <= 1.0).then_some(rho);
    match profile {
        Profile::Cosine | Profile::CosineInner if steepness <= half => {
            [within((steepness / half).asin() / half), None]
        }
        Profile::RaisedCosine if steepness <= half => {
            let low = (steepness / half).asin() / PI;
            [Some(low), Some(1.0 - low)]
        }
        Profile::Paraboloid => [within(0.5 * steepness), None],
        Profile::Papilla => [within((0.25 * steepness).cbrt()), None],
        _ => [None, None],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Sampler;
    use crate::micro::CellDescription;

    const SMOOTH: [Profile; 5] =
        [Profile::Cosine, Profile::CosineInner, Profile::RaisedCosine, Profile::Paraboloid, Profile::Papilla];

    #[test]
    fn normals_tell_the_radius() {
        for profile in SMOOTH {
            let dome = crate::micro::Dome { profile, height_um: 1.0, radius_um: 1.0 };
            for i in 1..50 {
                let rho = f64::from(i) / 50.0;
                let (steepness, bend) = shape(profile, rho);
                assert!((steepness + dome.slope_at(rho)).abs() < 1e-9, "{profile:?} {rho}");
                let h = 1e-5;
                let slope = (dome.slope_at(rho - h) - dome.slope_at(rho + h)) / (2.0 * h);
                assert!((bend - slope).abs() < 1e-6, "{profile:?} {rho}: {bend} {slope}");
                let found = radii(profile, steepness);
                assert!(
                    found.iter().flatten().any(|r| (r - rho).abs() < 1e-7),
                    "{profile:?} {rho} {found:?}"
                );
            }
        }
    }

    /// Area of the domes seen from above, weighted by a function of the normal: by points spread over the petal, and by
    /// points found by their normal.
    #[test]
    fn both_kinds_of_points_agree() {
        for profile in SMOOTH {
            let cells = CellDescription {
                profile,
                center_disorder: 0.05,
                height_disorder: 0.1,
                tile_cells: 4,
                ..Default::default()
            };
            let field = CellField::new(&cells).unwrap();
            let facets = Facets::new(&field).unwrap();
            let half = Vec3::new(0.6, 0.0, 0.8);
            let weight = |normal: DVec3| f64::from(half.dot(normal.as_vec3())).max(0.0).powi(40);
            let (mut spread, mut found) = (0.0, 0.0);
            let n = 1 << 17;
            for i in 0..n {
                let mut s = Sampler::new(4, glam::UVec2::ZERO, i);
                let at = (s.next_2d().as_dvec2() * field.tile_um()).extend(field.max_height_um());
                if let Some(hit) = field.first_hit(at, DVec3::NEG_Z).filter(|h| h.kind == HitKind::Dome) {
                    spread += weight(hit.normal) / f64::from(n);
                }
                let (u, which, cell) = (s.next_2d(), s.next_1d(), s.next_1d());
                facets.draw(half, u, which, cell, |facet| {
                    found += weight(facet.hit.normal) / facet.density / f64::from(n);
                });
            }
            assert!((spread / found - 1.0).abs() < 0.05, "{profile:?}: {spread} {found}");
        }
    }

    #[test]
    fn cones_and_tilted_axes_have_none() {
        for cells in [
            CellDescription { profile: Profile::Cone, ..Default::default() },
            CellDescription { profile: Profile::Flat, ..Default::default() },
            CellDescription { height_um: 0.0, ..Default::default() },
            CellDescription { tilt_disorder_deg: 2.0, tile_cells: 4, ..Default::default() },
        ] {
            assert!(Facets::new(&CellField::new(&cells).unwrap()).is_none(), "{cells:?}");
        }
    }
}

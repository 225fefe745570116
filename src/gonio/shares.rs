//! How much of the hemisphere a reading stands for: its share of the projected solid angle.
//!
//! Model: Voronoi regions of the readings' directions on the sphere, measured by |cos theta| dw.
//!
//! share_i = integral over the hemisphere of \[reading i is the nearest, and the direction is covered\] |cos theta| dw, sr
//!
//! The hemisphere is cut into cells of known projected solid angle, about a ninth of the readings' distance wide; each is
//! given to the reading nearest to its middle among those of one lamp direction, series, band and side. Readings of one half of the azimuth stand for both: they are mirrored at the plane of incidence.
//! Readings of one direction share its region. With h the median distance of nearest neighbours, a direction is
//! covered where a reading lies within h / 2, or where it lies *between* two readings (seen from it more than 90 deg
//! apart) of which the nearest is within 3 h / 2. What lies beyond the outermost readings so carries no weight. Our
//! reading.
//!
//! Limits: regular grids within a few per cent, guarded by `a_regular_grid_has_its_exact_shares`; nothing beyond what
//! was measured, guarded by `uncovered_directions_carry_no_weight`; a reading alone counts as one of a 10 deg grid,
//! and none less than 1/1000 of the mean, guarded by `every_reading_has_a_share`.

use std::collections::HashMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;
use rayon::prelude::*;

use super::measurement::Measurement;

/// Distance of the neighbours that a reading alone stands for, degrees.
const LONE_SPACING_DEG: f64 = 10.0;
/// Directions closer than this are one.
const SAME: f64 = 1e-6;
/// Width of the cells that are given to the readings, of the distance of the readings.
const CELLS_PER_SPACING: f64 = 9.0;
/// Cells around the normal: grids in theta and phi are dense there.
const LEAST_CELLS: f64 = 90.0;
/// The golden ratio's fraction.
const GOLDEN: f64 = 0.618_033_988_749_895;
/// Least share of a reading, of the mean of its set.
const LEAST: f64 = 1e-3;

impl Measurement {
    /// Projected solid angle (solid angle x |cos theta_o|) that each reading stands for among the readings of the same
    /// lamp direction, series, band and side, sr. Always positive.
    pub fn projected_solid_angles_sr(&self) -> Vec<f64> {
        // Sets are told apart by the lamp's direction to 1e-6.
        let grid = |w: DVec3| w.to_array().map(|c| (c / SAME).round() as i64);
        let mut sets: HashMap<([i64; 3], u32, u32, bool), usize> = HashMap::new();
        let mut members: Vec<Vec<usize>> = Vec::new();
        for (i, r) in self.readings.iter().enumerate() {
            let set = *sets.entry((grid(r.wi), r.series, r.band, r.wo.z >= 0.0)).or_insert(members.len());
            if set == members.len() {
                members.push(Vec::new());
            }
            members[set].push(i);
        }
        let shares: Vec<Vec<f64>> = members
            .par_iter()
            .map(|m| {
                let wo: Vec<DVec3> = m.iter().map(|&i| self.readings[i].wo).collect();
                shares(self.readings[m[0]].wi, &wo)
            })
            .collect();
        let mut all = vec![0.0; self.readings.len()];
        for (m, s) in members.iter().zip(&shares) {
            m.iter().zip(s).for_each(|(&i, &share)| all[i] = share);
        }
        all
    }
}

/// A direction of a set, its mirror image or itself.
struct Site {
    w: DVec3,
    theta: f64,
    /// Index of the unmirrored direction.
    owner: usize,
}

/// Shares of directions that belong to one set.
fn shares(wi: DVec3, wo: &[DVec3]) -> Vec<f64> {
    // The lamp's frame, the side turned up: y is the distance from the plane of incidence.
    let r = wi.x.hypot(wi.y);
    let (c, s) = if r < SAME { (1.0, 0.0) } else { (wi.x / r, wi.y / r) };
    let local = |w: DVec3| DVec3::new(c * w.x + s * w.y, c * w.y - s * w.x, w.z.abs());
    // Each direction once, with the number of its readings.
    let mut directions: Vec<(DVec3, f64)> = Vec::new();
    let mut seen: HashMap<[i64; 3], usize> = HashMap::new();
    let owner: Vec<usize> = wo
        .iter()
        .map(|&w| {
            let w = local(w);
            let key = w.to_array().map(|c| (c / SAME).round() as i64);
            let at = *seen.entry(key).or_insert(directions.len());
            if at == directions.len() {
                directions.push((w, 0.0));
            }
            directions[at].1 += 1.0;
            at
        })
        .collect();
    let (sites, mirrored) = sites(&directions);
    let h = spacing(&sites);
    let mut area = vec![0.0; directions.len()];
    // Rings of equal width, cut into cells about as wide as high; half of each where the other half mirrors it.
    let rings = (FRAC_PI_2 * CELLS_PER_SPACING / h).clamp(45.0, 180.0).ceil();
    let width = FRAC_PI_2 / rings;
    for ring in 0..rings as usize {
        let theta = (ring as f64 + 0.5) * width;
        let (sin, cos) = theta.sin_cos();
        let belt = near(theta, &sites, 2.0 * h);
        let (turn, times) = if mirrored { (PI, 2.0) } else { (TAU, 1.0) };
        let cells = (turn * sin / width).max(LEAST_CELLS * turn / TAU).ceil();
        // sin^2 t1 - sin^2 t0 = sin(t0 + t1) sin(t1 - t0).
        let cell = times * turn / cells * 0.5 * (2.0 * theta).sin() * width.sin();
        // Rings are turned against each other, or cells and readings fall into step.
        let offset = (0.5 + ring as f64 * GOLDEN).fract();
        for i in 0..cells as usize {
            let (y, x) = ((i as f64 + offset) * turn / cells).sin_cos();
            if let Some(owner) = owner_of(DVec3::new(sin * x, sin * y, cos), belt, h) {
                area[owner] += cell;
            }
        }
    }
    // Lone directions may be missed by all cells.
    let mean = (area.iter().sum::<f64>() / wo.len() as f64).max(width * width / wo.len() as f64);
    owner.iter().map(|&d| (area[d] / directions[d].1).max(LEAST * mean)).collect()
}

/// The directions by rising theta, mirrored where they lie on one side of the plane of incidence only; were they?
fn sites(directions: &[(DVec3, f64)]) -> (Vec<Site>, bool) {
    let site = |w: DVec3, owner| Site { w, theta: w.x.hypot(w.y).atan2(w.z), owner };
    let mut sites: Vec<Site> = directions.iter().enumerate().map(|(i, d)| site(d.0, i)).collect();
    let one_side = [1.0, -1.0].iter().any(|side| directions.iter().all(|(w, _)| w.y * side > -1e-4));
    if one_side {
        let mirrored = directions.iter().enumerate().filter(|(_, (w, _))| w.y.abs() > 1e-4);
        sites.extend(mirrored.map(|(i, (w, _))| site(DVec3::new(w.x, -w.y, w.z), i)));
    }
    sites.sort_by(|a, b| a.theta.total_cmp(&b.theta));
    (sites, one_side)
}

/// Sites whose theta differs from `theta` by at most `limit` radians: all that are nearer than it are among them.
fn near(theta: f64, sites: &[Site], limit: f64) -> &[Site] {
    let first = sites.partition_point(|s| s.theta < theta - limit);
    let last = sites.partition_point(|s| s.theta <= theta + limit);
    &sites[first..last]
}

/// Median distance of nearest neighbours, radians.
fn spacing(sites: &[Site]) -> f64 {
    let nearest_to = |site: &Site| {
        // Ever wider belts of theta until the nearest in it is nearer than its edge.
        let mut limit = 0.02;
        loop {
            let belt = near(site.theta, sites, limit);
            let chords = belt.iter().map(|o| site.w.distance(o.w)).filter(|d| *d > SAME);
            let chord = chords.fold(f64::INFINITY, f64::min);
            let best = if chord.is_finite() { 2.0 * (0.5 * chord).min(1.0).asin() } else { f64::INFINITY };
            if best <= limit {
                return best;
            }
            if limit > PI {
                return f64::INFINITY;
            }
            limit *= 2.0;
        }
    };
    let mut nearest: Vec<f64> = sites.iter().map(nearest_to).filter(|d| d.is_finite()).collect();
    nearest.sort_by(f64::total_cmp);
    nearest.get(nearest.len() / 2).copied().unwrap_or(LONE_SPACING_DEG.to_radians())
}

/// The direction that a point of the hemisphere belongs to, if it is covered; `belt` has all within 2 h. Angles are compared by their cosines.
fn owner_of(w: DVec3, belt: &[Site], h: f64) -> Option<usize> {
    let (mut cosine, mut nearest) = (f64::NEG_INFINITY, None);
    for site in belt {
        let c = w.dot(site.w);
        if c > cosine {
            (cosine, nearest) = (c, Some(site));
        }
    }
    let a = nearest.filter(|_| cosine >= (1.5 * h).min(PI).cos())?;
    let farthest = (2.0 * h).min(PI).cos();
    // The tangents at w towards a and b are more than 90 deg apart.
    let between = |b: &Site| {
        let c = w.dot(b.w);
        c >= farthest && a.w.dot(b.w) < cosine * c
    };
    (cosine >= (0.5 * h).min(PI).cos() || belt.iter().any(between)).then_some(a.owner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::ExitantGrid;
    use crate::gonio::measurement::{Reading, direction_deg};

    fn measurement(directions: impl IntoIterator<Item = (f64, f64)>) -> Measurement {
        let reading = |(theta, phi): (f64, f64)| Reading {
            wi: direction_deg(40.0, 25.0),
            wo: direction_deg(theta, phi + 25.0),
            series: 0,
            band: 0,
            bsdf_per_sr: 1.0,
            sigma_per_sr: None,
        };
        Measurement { readings: directions.into_iter().map(reading).collect(), ..Default::default() }
    }

    #[test]
    fn a_regular_grid_has_its_exact_shares() {
        let grid = ExitantGrid::new(10.0, 15.0).unwrap();
        let all = measurement((0..grid.len()).map(|i| grid.centre_deg(i)));
        let shares = all.projected_solid_angles_sr();
        for (i, share) in shares.iter().enumerate() {
            let exact = grid.projected_solid_angle_sr(i);
            assert!((share / exact - 1.0).abs() < 0.12, "{:?}: {share} {exact}", grid.centre_deg(i));
        }
        // Both hemispheres, each pi.
        let total: f64 = shares.iter().sum();
        assert!((total / (2.0 * PI) - 1.0).abs() < 0.01, "{total}");
        // Half of the azimuths stands for all: the plane of incidence keeps its share, the others double it.
        let half: Vec<usize> = (0..grid.len()).filter(|&i| grid.centre_deg(i).1 <= 180.0).collect();
        let shares = measurement(half.iter().map(|&i| grid.centre_deg(i))).projected_solid_angles_sr();
        for (&i, share) in half.iter().zip(&shares) {
            let (theta, phi) = grid.centre_deg(i);
            let times = if phi == 0.0 || phi == 180.0 { 1.0 } else { 2.0 };
            let exact = times * grid.projected_solid_angle_sr(i);
            assert!((share / exact - 1.0).abs() < 0.12, "{theta} {phi}: {share} {exact}");
        }
    }

    #[test]
    fn uncovered_directions_carry_no_weight() {
        // Views to 60 deg, 30 deg apart in azimuth: regions end near 65 deg.
        let mut views = vec![(0.0, 0.0)];
        for theta in 1..=6 {
            views.extend((0..=6).map(|phi| (10.0 * f64::from(theta), 30.0 * f64::from(phi))));
        }
        // The lamp hides one view; its neighbours stand for it.
        views.retain(|v| *v != (40.0, 0.0));
        let total: f64 = measurement(views).projected_solid_angles_sr().iter().sum();
        let (least, most) = (PI * 60f64.to_radians().sin().powi(2), PI * 69f64.to_radians().sin().powi(2));
        assert!(total > least && total < most, "{least} {total} {most}");
        // One plane is a strip, not the hemisphere.
        let plane =
            measurement((-16..=16).map(|i| (5.0 * f64::from(i).abs(), if i < 0 { 180.0 } else { 0.0 })));
        let total: f64 = plane.projected_solid_angles_sr().iter().sum();
        assert!(total > 0.08 && total < 0.3, "{total}");
    }

    #[test]
    fn every_reading_has_a_share() {
        let one = measurement([(30.0, 10.0)]).projected_solid_angles_sr();
        let exact = PI * 5f64.to_radians().sin().powi(2) * 30f64.to_radians().cos();
        assert!(one.len() == 1 && (one[0] / (2.0 * exact) - 1.0).abs() < 0.2, "{one:?} {exact}");
        // At the horizon, twice the same, almost the same: positive and finite.
        let odd = [(90.0, 0.0), (90.0, 0.0), (89.9999, 0.0), (0.0, 0.0), (0.001, 3.0), (180.0, 0.0)];
        let shares = measurement(odd).projected_solid_angles_sr();
        assert!(shares.iter().all(|s| *s > 0.0 && s.is_finite()), "{shares:?}");
        assert_eq!(shares[0], shares[1]);
        assert!(Measurement::default().projected_solid_angles_sr().is_empty());
    }
}

//! How much of the hemisphere a reading stands for: its share of the projected solid angle.
//!
//! Model: Voronoi regions of the readings' directions on the sphere, measured by |cos theta| dw.
//!
//! share_i = integral over the hemisphere of \[reading i is the nearest, and the direction is covered\] |cos theta| dw, sr
//!
//! |cos theta| dw is the area of the direction's projection on the sample, so equal squares of the unit disc are
//! directions of equal weight; each is given to the nearest reading among those of one lamp direction, series,
//! band and side. Readings of one half of the azimuth stand for both: they are mirrored at the plane of incidence.
//! Readings of one direction share its region. With h the median distance of nearest neighbours, a direction is
//! covered where a reading lies within h / 2, or where it lies *between* two readings (seen from it more than 90 deg
//! apart) of which the nearest is within 3 h / 2. What lies beyond the outermost readings so carries no weight. Our
//! reading.
//!
//! Limits: regular grids within a few per cent, guarded by `a_regular_grid_has_its_exact_shares`; nothing beyond what
//! was measured, guarded by `uncovered_directions_carry_no_weight`; a reading alone counts as one of a 10 deg grid,
//! and none less than 1/1000 of the mean, guarded by `every_reading_has_a_share`.

use std::collections::HashMap;
use std::f64::consts::PI;

use glam::DVec3;
use rayon::prelude::*;

use super::measurement::Measurement;

/// Distance of the neighbours that a reading alone stands for, degrees.
const LONE_SPACING_DEG: f64 = 10.0;
/// Directions closer than this are one.
const SAME: f64 = 1e-6;
/// Squares across the disc.
const SQUARES: i32 = 160;
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
    let sites = sites(&directions);
    let h = spacing(&sites);
    let mut area = vec![0.0; directions.len()];
    let step = 2.0 / f64::from(SQUARES);
    for i in 0..SQUARES {
        for j in 0..SQUARES {
            let (x, y) = ((f64::from(i) + 0.5) * step - 1.0, (f64::from(j) + 0.5) * step - 1.0);
            let z2 = 1.0 - x * x - y * y;
            if z2 > 0.0
                && let Some(owner) = owner_of(DVec3::new(x, y, z2.sqrt()), &sites, h)
            {
                area[owner] += step * step;
            }
        }
    }
    // A lone direction's region may be smaller than a square.
    let mean = (area.iter().sum::<f64>() / wo.len() as f64).max(step * step / wo.len() as f64);
    owner.iter().map(|&d| (area[d] / directions[d].1).max(LEAST * mean)).collect()
}

/// The directions, mirrored where they lie on one side of the plane of incidence only, by rising theta.
fn sites(directions: &[(DVec3, f64)]) -> Vec<Site> {
    let site = |w: DVec3, owner| Site { w, theta: w.x.hypot(w.y).atan2(w.z), owner };
    let mut sites: Vec<Site> = directions.iter().enumerate().map(|(i, d)| site(d.0, i)).collect();
    let one_side = [1.0, -1.0].iter().any(|side| directions.iter().all(|(w, _)| w.y * side > -1e-4));
    if one_side {
        let mirrored = directions.iter().enumerate().filter(|(_, (w, _))| w.y.abs() > 1e-4);
        sites.extend(mirrored.map(|(i, (w, _))| site(DVec3::new(w.x, -w.y, w.z), i)));
    }
    sites.sort_by(|a, b| a.theta.total_cmp(&b.theta));
    sites
}

/// Sites whose theta differs from `theta` by at most `limit` radians: all that are nearer than it are among them.
fn near(theta: f64, sites: &[Site], limit: f64) -> &[Site] {
    let first = sites.partition_point(|s| s.theta < theta - limit);
    let last = sites.partition_point(|s| s.theta <= theta + limit);
    &sites[first..last]
}

/// Angle between unit vectors, radians.
fn angle(a: DVec3, b: DVec3) -> f64 {
    2.0 * (0.5 * a.distance(b)).min(1.0).asin()
}

/// Median distance of nearest neighbours, radians.
fn spacing(sites: &[Site]) -> f64 {
    let nearest_to = |site: &Site| {
        // Ever wider belts of theta until the nearest in it is nearer than its edge.
        let mut limit = 0.02;
        loop {
            let belt = near(site.theta, sites, limit);
            let distances = belt.iter().map(|o| angle(site.w, o.w)).filter(|d| *d > SAME);
            let best = distances.fold(f64::INFINITY, f64::min);
            if best <= limit || limit > PI {
                return best;
            }
            limit *= 2.0;
        }
    };
    let mut nearest: Vec<f64> = sites.iter().map(nearest_to).filter(|d| d.is_finite()).collect();
    nearest.sort_by(f64::total_cmp);
    nearest.get(nearest.len() / 2).copied().unwrap_or(LONE_SPACING_DEG.to_radians())
}

/// The direction that a point of the hemisphere belongs to, if it is covered.
fn owner_of(w: DVec3, sites: &[Site], h: f64) -> Option<usize> {
    let belt = near(w.x.hypot(w.y).atan2(w.z), sites, 2.0 * h);
    let nearest = belt.iter().map(|s| (angle(w, s.w), s)).min_by(|a, b| a.0.total_cmp(&b.0));
    let (distance, a) = nearest.filter(|n| n.0 <= 1.5 * h)?;
    // Tangents from w towards the sites.
    let along = |v: DVec3| v - w * w.dot(v);
    let between = || belt.iter().any(|b| angle(w, b.w) <= 2.0 * h && along(b.w).dot(along(a.w)) < 0.0);
    (distance <= 0.5 * h || between()).then_some(a.owner)
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

//! Surfaces of revolution: vases, pots, plates.
//!
//! Model: a curve of (radius r, height z) turns about +z. Through its points runs a centripetal Catmull-Rom spline
//! (Barry and Goldman's form), which neither loops nor overshoots as the uniform one does; a point given twice in a row is
//! a corner, where the spline ends and another begins.
//!
//! Equation: position(u, v) = (r(v) cos 2 pi u, r(v) sin 2 pi u, z(v)), normal = (dz, -dr) / |(dr, dz)| in the plane of the
//! curve, that is to its right. If the volume on its left is negative the whole surface is turned round, so that normals
//! point out of the solid whichever end the profile starts from.
//!
//! Limits: only the ends may lie on the axis; there the surface closes in a fan without empty faces, at a right angle to the
//! axis if it is smooth. Guarded by `a_lathe_turns_known_solids`, `normals_point_out_whichever_way_the_profile_runs` and
//! `poles_are_closed_without_empty_faces`.
//!
//! Our reading.

use std::f64::consts::TAU;

use glam::{DVec2, Vec2, Vec3};

use crate::geometry::Mesh;
use crate::{Error, Result};

/// Most points of a profile.
pub const MOST_POINTS: usize = 512;
/// Most sides of a surface of revolution.
pub const MOST_SEGMENTS: u32 = 2048;
/// Pieces of the spline between two points.
const STEPS: u32 = 12;
/// Nearest that a spline comes to the axis between its ends, of the largest radius.
const NECK: f64 = 1e-4;

/// A point of the profile: place and normal in its plane.
#[derive(Clone, Copy, Debug)]
struct Node {
    at: DVec2,
    normal: DVec2,
}

/// Turns a profile of (radius, height) about +z, with `segments` sides; smooth, or of straight pieces. Texture coordinates: u runs
/// around, v along the profile.
pub fn lathe(profile_mm: &[[f64; 2]], segments: u32, smooth: bool) -> Result<Mesh> {
    check(profile_mm, segments)?;
    let points: Vec<DVec2> = profile_mm.iter().copied().map(DVec2::from).collect();
    let mut strips: Vec<Vec<Node>> = if smooth {
        runs(&points).iter().map(|run| spline(run)).collect()
    } else {
        points.windows(2).filter(|p| p[0] != p[1]).map(|p| straight(p[0], p[1])).collect()
    };
    if strips.is_empty() {
        return Err(Error::invalid("profile_mm", "all points are the same"));
    }
    let widest = profile_mm.iter().map(|p| p[0]).fold(0.0, f64::max);
    let ends = [strips[0][0].at, strips.last().and_then(|s| s.last()).map_or(DVec2::ZERO, |n| n.at)];
    for node in strips.iter_mut().flatten().filter(|n| !ends.contains(&n.at)) {
        node.at.x = node.at.x.max(NECK * widest);
    }
    if volume(&strips) < 0.0 {
        strips.reverse();
        for strip in &mut strips {
            strip.reverse();
            strip.iter_mut().for_each(|n| n.normal = -n.normal);
        }
    }
    Ok(turn(&strips, segments))
}

fn check(profile_mm: &[[f64; 2]], segments: u32) -> Result<()> {
    let wrong = |what: String| Err(Error::invalid("profile_mm", what));
    let count = profile_mm.len();
    if !(2..=MOST_POINTS).contains(&count) {
        return wrong(format!("{count} points; a profile has 2 to {MOST_POINTS}"));
    }
    if !(3..=MOST_SEGMENTS).contains(&segments) {
        return Err(Error::invalid("segments", format!("{segments} is not within 3 to {MOST_SEGMENTS}")));
    }
    for (k, &[radius, height]) in profile_mm.iter().enumerate() {
        if !(0.0..=1e6).contains(&radius) || height.is_nan() || height.abs() > 1e6 {
            return wrong(format!(
                "point {k} is [{radius}, {height}]; radii are 0 to 1e6, heights -1e6 to 1e6"
            ));
        }
        let inside = k > 0 && k + 1 < count;
        if radius == 0.0 && inside && profile_mm[k - 1] != profile_mm[k] && profile_mm[k + 1] != profile_mm[k]
        {
            return wrong(format!("point {k} lies on the axis; only the first and the last may"));
        }
    }
    if profile_mm.iter().all(|p| p[0] == 0.0) {
        return wrong("all points lie on the axis".to_owned());
    }
    Ok(())
}

/// The pieces between corners, which are points given twice.
fn runs(points: &[DVec2]) -> Vec<Vec<DVec2>> {
    let mut runs = vec![vec![points[0]]];
    for pair in points.windows(2) {
        match runs.last_mut() {
            Some(run) if pair[0] != pair[1] => run.push(pair[1]),
            _ => runs.push(vec![pair[1]]),
        }
    }
    runs.retain(|r| r.len() > 1);
    runs
}

fn straight(a: DVec2, b: DVec2) -> Vec<Node> {
    let normal = right_of(b - a);
    vec![Node { at: a, normal }, Node { at: b, normal }]
}

fn right_of(along: DVec2) -> DVec2 {
    DVec2::new(along.y, -along.x).normalize_or(DVec2::X)
}

/// The centripetal Catmull-Rom spline through at least two points.
fn spline(points: &[DVec2]) -> Vec<Node> {
    if let [a, b] = *points {
        // Between two points alone the spline is their chord, also where it meets the axis.
        return straight(a, b);
    }
    let n = points.len();
    // Before and after the ends: their mirror image, in the axis where the curve starts on it.
    let beyond = |end: DVec2, next: DVec2| {
        if end.x == 0.0 { DVec2::new(-next.x, next.y) } else { 2.0 * end - next }
    };
    let at = |k: isize| match k {
        -1 => beyond(points[0], points[1]),
        k if k as usize == n => beyond(points[n - 1], points[n - 2]),
        k => points[k as usize],
    };
    let mut nodes = Vec::with_capacity((n - 1) * STEPS as usize + 1);
    for k in 0..n as isize - 1 {
        let four = [at(k - 1), at(k), at(k + 1), at(k + 2)];
        // The last piece has its end, the others leave it to the next.
        let count = if k as usize + 2 == n { STEPS + 1 } else { STEPS };
        nodes.extend((0..count).map(|i| piece(&four, f64::from(i) / f64::from(STEPS))));
    }
    nodes
}

/// The spline between the second and the third of four points.
fn piece(p: &[DVec2; 4], part: f64) -> Node {
    let knot = |k: usize| (p[k + 1] - p[k]).length().sqrt().max(1e-9);
    let t = [0.0, knot(0), knot(0) + knot(1), knot(0) + knot(1) + knot(2)];
    let value = |x: f64| {
        let mix = |a: DVec2, b: DVec2, i: usize, j: usize| (a * (t[j] - x) + b * (x - t[i])) / (t[j] - t[i]);
        let a = [mix(p[0], p[1], 0, 1), mix(p[1], p[2], 1, 2), mix(p[2], p[3], 2, 3)];
        let b = [mix(a[0], a[1], 0, 2), mix(a[1], a[2], 1, 3)];
        mix(b[0], b[1], 1, 2)
    };
    let x = t[1] + (t[2] - t[1]) * part;
    let step = 1e-4 * (t[2] - t[1]);
    let at = match part {
        0.0 => p[1],
        1.0 => p[2],
        _ => value(x),
    };
    Node { at, normal: right_of(value(x + step) - value(x - step)) }
}

/// The signed volume between the curve and the axis, over pi.
fn volume(strips: &[Vec<Node>]) -> f64 {
    strips
        .iter()
        .flat_map(|s| s.windows(2))
        .map(|w| {
            let (a, b) = (w[0].at, w[1].at);
            (b.y - a.y) * (a.x * a.x + a.x * b.x + b.x * b.x) / 3.0
        })
        .sum()
}

fn turn(strips: &[Vec<Node>], segments: u32) -> Mesh {
    let length: f64 =
        strips.iter().flat_map(|s| s.windows(2)).map(|w| w[0].at.distance(w[1].at)).sum::<f64>().max(1e-12);
    let mut mesh = Mesh::default();
    let mut along = 0.0;
    for strip in strips {
        let first = mesh.positions.len() as u32;
        for (k, node) in strip.iter().enumerate() {
            if k > 0 {
                along += node.at.distance(strip[k - 1].at);
            }
            for i in 0..=segments {
                // The seam has the same places twice, bit for bit.
                let turn = DVec2::from_angle(TAU * f64::from(i % segments) / f64::from(segments));
                mesh.positions.push((turn * node.at.x).extend(node.at.y).as_vec3());
                mesh.normals.push((turn * node.normal.x).extend(node.normal.y).as_vec3());
                mesh.uvs.push(Vec2::new(i as f32 / segments as f32, (along / length) as f32));
            }
        }
        for (k, w) in (0u32..).zip(strip.windows(2)) {
            let low = first + k * (segments + 1);
            let high = low + segments + 1;
            for i in 0..segments {
                // On the axis one side of the quadrilateral is a point.
                if w[0].at.x > 0.0 {
                    mesh.triangles.push([low + i, low + i + 1, high + i + 1]);
                }
                if w[1].at.x > 0.0 {
                    mesh.triangles.push([low + i, high + i + 1, high + i]);
                }
            }
        }
    }
    drop_empty(&mut mesh);
    mesh
}

/// Faces that rounding to f32 has made empty.
fn drop_empty(mesh: &mut Mesh) {
    let positions = std::mem::take(&mut mesh.positions);
    let corner = |k: u32| -> Vec3 { positions[k as usize] };
    mesh.triangles.retain(|t| {
        let [a, b, c] = t.map(corner);
        (b - a).cross(c - a).length_squared() > 0.0
    });
    mesh.positions = positions;
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    fn area_and_volume(m: &Mesh) -> (f64, f64) {
        (0..m.triangles.len()).fold((0.0, 0.0), |(area, volume), f| {
            let [a, b, c] = m.corners(f).map(|p| p.as_dvec3());
            (area + (b - a).cross(c - a).length() / 2.0, volume + a.dot(b.cross(c)) / 6.0)
        })
    }

    #[test]
    fn a_lathe_turns_known_solids() {
        // A cylinder with its lids, of straight pieces, and a cone.
        let cylinder = lathe(&[[0.0, 0.0], [10.0, 0.0], [10.0, 30.0], [0.0, 30.0]], 512, false).unwrap();
        let (area, volume) = area_and_volume(&cylinder);
        assert!((area / (2.0 * PI * 10.0 * 40.0) - 1.0).abs() < 1e-4, "{area}");
        assert!((volume / (PI * 3000.0) - 1.0).abs() < 1e-4, "{volume}");
        let cone = lathe(&[[0.0, 0.0], [10.0, 0.0], [0.0, 30.0]], 512, false).unwrap();
        assert!((area_and_volume(&cone).1 / (PI * 1000.0) - 1.0).abs() < 1e-4);
        // A sphere through 17 points of its meridian.
        let meridian: Vec<[f64; 2]> = (0..=16)
            .map(|k| {
                let (sin, cos) = (PI * f64::from(k) / 16.0).sin_cos();
                [if k % 16 == 0 { 0.0 } else { 10.0 * sin }, -10.0 * cos]
            })
            .collect();
        let ball = lathe(&meridian, 256, true).unwrap();
        for (p, n) in ball.positions.iter().zip(&ball.normals) {
            assert!((p.length() - 10.0).abs() < 0.01, "{p}");
            assert!(n.dot(p.normalize()) > 0.9995, "{p} {n}");
        }
        assert!(ball.normals[0].z < -0.9999, "a smooth pole");
    }

    #[test]
    fn normals_point_out_whichever_way_the_profile_runs() {
        // A vase with a wall: up outside, down inside; and the other way round.
        let wall =
            [[0.0, 0.0], [20.0, 0.0], [30.0, 40.0], [15.0, 80.0], [13.0, 80.0], [27.0, 40.0], [0.0, 5.0]];
        for smooth in [false, true] {
            let up = lathe(&wall, 48, smooth).unwrap();
            let mut reversed = wall;
            reversed.reverse();
            for m in [up, lathe(&reversed, 48, smooth).unwrap()] {
                m.validate("vase").unwrap();
                assert!(area_and_volume(&m).1 > 0.0);
                assert_eq!(m.normals.len(), m.positions.len());
                for (f, t) in m.triangles.iter().enumerate() {
                    let [a, b, c] = m.corners(f);
                    let face = (b - a).cross(c - a).normalize();
                    for k in t {
                        assert!(face.dot(m.normals[*k as usize]) > 0.2, "{smooth} face {f}");
                    }
                }
            }
        }
    }

    #[test]
    fn poles_are_closed_without_empty_faces() {
        let m = lathe(&[[0.0, 0.0], [9.0, 1.0], [4.0, 8.0], [0.0, 9.0]], 24, true).unwrap();
        let key = |i: u32| m.positions[i as usize].to_array().map(|x| (x + 0.0).to_bits());
        let mut edges = std::collections::HashMap::new();
        for (f, t) in m.triangles.iter().enumerate() {
            assert!(m.face_area(f) > 0.0);
            for e in 0..3 {
                let (a, b) = (key(t[e]), key(t[(e + 1) % 3]));
                *edges.entry(if a < b { (a, b) } else { (b, a) }).or_insert(0) += if a < b { 1 } else { -1 };
            }
        }
        assert!(edges.values().all(|&n| n == 0), "every edge is walked once in each direction");
        assert!(m.uvs.iter().all(|t| t.min_element() >= 0.0 && t.max_element() <= 1.0));
    }

    #[test]
    fn a_point_given_twice_is_a_corner() {
        let round = lathe(&[[10.0, 0.0], [10.0, 10.0], [0.0, 10.0]], 16, true).unwrap();
        let sharp = lathe(&[[10.0, 0.0], [10.0, 10.0], [10.0, 10.0], [0.0, 10.0]], 16, true).unwrap();
        let slanted = |m: &Mesh| m.normals.iter().filter(|n| n.z > 0.1 && n.z < 0.9).count();
        assert!(slanted(&round) > 0);
        assert_eq!(slanted(&sharp), 0);
    }

    #[test]
    fn wrong_profiles_are_refused() {
        let wrong: [(&[[f64; 2]], u32, &str); 9] = [
            (&[], 8, "profile_mm"),
            (&[[1.0, 0.0]], 8, "profile_mm"),
            (&[[1.0, 0.0], [f64::NAN, 1.0]], 8, "profile_mm"),
            (&[[1.0, 0.0], [1.0, f64::INFINITY]], 8, "profile_mm"),
            (&[[1.0, 0.0], [-1.0, 1.0]], 8, "profile_mm"),
            (&[[1.0, 0.0], [0.0, 1.0], [1.0, 2.0]], 8, "profile_mm"),
            (&[[0.0, 0.0], [0.0, 1.0]], 8, "profile_mm"),
            (&[[1.0, 0.0], [1.0, 0.0]], 8, "profile_mm"),
            (&[[1.0, 0.0], [1.0, 1.0]], 2, "segments"),
        ];
        for (profile, segments, key) in wrong {
            for smooth in [false, true] {
                let e = lathe(profile, segments, smooth).expect_err("wrong");
                assert!(e.to_string().starts_with(key), "{e}");
            }
        }
        assert!(lathe(&[[1.0, 0.0]; 600], 8, true).is_err());
        assert!(lathe(&[[1.0, 0.0], [1.0, 1.0]], 1 << 20, true).is_err());
    }
}

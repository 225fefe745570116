//! Described shapes to meshes in the world.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DQuat, DVec3, Vec2, Vec3};

use super::assets::Assets;
use super::description::{Placement, ShapeDescription};
use super::key::Key;
use crate::Result;
use crate::flower::{self, OrganKind, PetalMap, PetalTraits};
use crate::geometry::Mesh;
use crate::geometry::lathe::lathe;
use crate::io;

/// A mesh of the scene with what it is.
#[derive(Clone, Debug)]
pub struct Shape {
    /// Its key (`shapes.NAME` or `lights.NAME`).
    pub key: String,
    /// Triangles in world space, mm.
    pub mesh: Mesh,
    /// Index of its material.
    pub material: u32,
    /// What part of a flower it is.
    pub organ: Option<OrganKind>,
    /// Counts the organs of the scene from 1; 0 is no organ.
    pub organ_id: u32,
    /// Counts the petals of the scene from 1, the innermost of a flower first; 0 is no petal.
    pub petal_id: u32,
    /// Index of its light, if it glows.
    pub emitter: Option<u32>,
    /// Its places, if it is a grown petal whose pigment has a pattern.
    pub petal: Option<Arc<PetalMap>>,
    /// Millimetres per unit of u and of v; zero without texture coordinates.
    pub uv_scale_mm: Vec2,
}

/// One mesh of a described shape.
pub(super) struct Part {
    pub(super) mesh: Mesh,
    pub(super) organ: Option<OrganKind>,
    pub(super) traits: Option<PetalTraits>,
    pub(super) uv_scale_mm: Vec2,
}

/// Grows, reads or makes the meshes of a shape and puts them into the world.
pub(super) fn parts(d: &ShapeDescription, key: &Key, assets: &dyn Assets) -> Result<Vec<Part>> {
    let Placement { position_mm, rotation_deg, scale } = d.placement();
    let position = key.at("position_mm").vector(position_mm)?;
    let angles = key.at("rotation_deg").vector(rotation_deg)?.map(f64::to_radians);
    let scale = key.at("scale").positive(scale)?;
    let rotation = DQuat::from_rotation_z(angles.z)
        * DQuat::from_rotation_y(angles.y)
        * DQuat::from_rotation_x(angles.x);
    let single = |mesh: Mesh, uv_scale_mm: Vec2| vec![Part { mesh, organ: None, traits: None, uv_scale_mm }];
    let length = |value: f64, name: &str| key.at(name).positive(value);
    let parts = match d {
        ShapeDescription::Rose(s) => {
            let key = key.at("rose");
            s.rose.validate(&key.to_string())?;
            let flower = key.says(flower::grow(&s.rose))?;
            flower.organs.into_iter().map(organ).collect()
        }
        ShapeDescription::Arrangement(s) => {
            let rose = s.rose().map_err(|what| key.at("rose").invalid(what))?;
            rose.validate(&key.at("rose").to_string())?;
            let arrangement = s.arrangement();
            arrangement.validate(&key.to_string())?;
            let flowers = key.name(arrangement.grow(&rose))?;
            flowers.into_iter().flat_map(|f| f.organs).map(organ).collect()
        }
        ShapeDescription::Mesh(s) => {
            let key = key.at("file");
            let mesh = key.says(assets.read(&s.file).and_then(|b| io::read_mesh(&b)))?;
            key.says(mesh.validate(&s.file))?;
            // How long a unit of u is differs over the mesh: only flowers have cells by their uv.
            single(mesh, Vec2::ZERO)
        }
        ShapeDescription::Quad(s) => {
            let (width, height) = (length(s.width_mm, "width_mm")?, length(s.height_mm, "height_mm")?);
            single(quad(width, height), Vec2::new(width as f32, height as f32))
        }
        ShapeDescription::Disc(s) => {
            let radius = length(s.radius_mm, "radius_mm")?;
            single(disc(radius), Vec2::splat(2.0 * radius as f32))
        }
        ShapeDescription::Lathe(s) => {
            // Its radius differs along the profile, and with it how long a unit of u is.
            single(key.under(lathe(&s.profile_mm, s.segments, s.smooth))?, Vec2::ZERO)
        }
        ShapeDescription::Sphere(s) => {
            let subdivisions = key.at("subdivisions").within(s.subdivisions, 0..=7, "within 0 to 7")?;
            single(sphere(length(s.radius_mm, "radius_mm")?, subdivisions), Vec2::ZERO)
        }
    };
    let point = |p: Vec3| (rotation * (p.as_dvec3() * scale) + position).as_vec3();
    let vector = |v: Vec3| (rotation * v.as_dvec3()).as_vec3();
    Ok(parts
        .into_iter()
        .map(|p| Part { mesh: place(p.mesh, point, vector), uv_scale_mm: p.uv_scale_mm * scale as f32, ..p })
        .collect())
}

fn organ(o: flower::Organ) -> Part {
    let uv_scale_mm = Vec2::from(o.uv_scale_mm);
    Part { mesh: o.mesh, organ: Some(o.kind), traits: o.traits, uv_scale_mm }
}

/// Moves a mesh; `vector` turns its normals.
pub(super) fn place(mut mesh: Mesh, point: impl Fn(Vec3) -> Vec3, vector: impl Fn(Vec3) -> Vec3) -> Mesh {
    mesh.positions.iter_mut().for_each(|p| *p = point(*p));
    mesh.normals.iter_mut().for_each(|n| *n = vector(*n));
    mesh
}

/// Rectangle in the xy plane around the origin, normal +z, uv from 0 to 1.
pub(super) fn quad(width_mm: f64, height_mm: f64) -> Mesh {
    let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
    let position =
        |(u, v): (f64, f64)| DVec3::new((u - 0.5) * width_mm, (v - 0.5) * height_mm, 0.0).as_vec3();
    Mesh {
        positions: corners.map(position).to_vec(),
        normals: Vec::new(),
        uvs: corners.map(|(u, v)| Vec2::new(u as f32, v as f32)).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    }
}

/// Disc in the xy plane around the origin, normal +z: a polygon of the same area, uv as in its square.
pub(super) fn disc(radius_mm: f64) -> Mesh {
    const SIDES: u32 = 128;
    let step = std::f64::consts::TAU / f64::from(SIDES);
    let reach = radius_mm * (step / step.sin()).sqrt();
    let mut mesh = Mesh { positions: vec![Vec3::ZERO], uvs: vec![Vec2::splat(0.5)], ..Mesh::default() };
    for i in 0..SIDES {
        let p = glam::DVec2::from_angle(step * f64::from(i)) * reach;
        mesh.positions.push(p.as_vec2().extend(0.0));
        mesh.uvs.push((p / (2.0 * radius_mm)).as_vec2() + 0.5);
        mesh.triangles.push([0, 1 + i, 1 + (i + 1) % SIDES]);
    }
    mesh
}

/// Icosahedron with each face divided in four `subdivisions` times, on a sphere around the origin.
pub(super) fn sphere(radius_mm: f64, subdivisions: u32) -> Mesh {
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    let mut points: Vec<DVec3> = Vec::new();
    for (a, b) in [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)] {
        points.push(DVec3::new(a, b, 0.0));
        points.push(DVec3::new(0.0, a, b));
        points.push(DVec3::new(b, 0.0, a));
    }
    points.iter_mut().for_each(|p| *p = p.normalize());
    let mut triangles = icosahedron_faces(&points);
    for _ in 0..subdivisions {
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    Mesh {
        positions: points.iter().map(|p| (*p * radius_mm).as_vec3()).collect(),
        normals: points.iter().map(|p| p.as_vec3()).collect(),
        uvs: Vec::new(),
        triangles,
    }
}

/// The faces are the triples of mutual neighbours; counter-clockwise seen from outside.
fn icosahedron_faces(points: &[DVec3]) -> Vec<[u32; 3]> {
    // Neighbours are 63.4 degrees apart, the next ones 116.6.
    let near = |a: usize, b: usize| points[a].dot(points[b]) > 0.0;
    let mut faces = Vec::with_capacity(20);
    for a in 0..points.len() {
        for b in a + 1..points.len() {
            for c in b + 1..points.len() {
                if near(a, b) && near(b, c) && near(a, c) {
                    let outwards = points[a].dot(points[b].cross(points[c])) > 0.0;
                    let (b, c) = if outwards { (b, c) } else { (c, b) };
                    faces.push([a as u32, b as u32, c as u32]);
                }
            }
        }
    }
    faces
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn area(mesh: &Mesh) -> f64 {
        (0..mesh.triangles.len()).map(|f| f64::from(mesh.face_area(f))).sum()
    }

    #[test]
    fn primitives_have_their_areas_and_normals() {
        for mesh in [quad(3.0, 2.0), disc(2.0), sphere(2.0, 5)] {
            mesh.validate("primitive").unwrap();
        }
        assert!((area(&quad(3.0, 2.0)) - 6.0).abs() < 1e-5);
        assert!((area(&disc(2.0)) - 4.0 * PI).abs() < 1e-4);
        let ball = sphere(2.0, 5);
        assert_eq!(ball.triangles.len(), 20 * 4usize.pow(5));
        assert!((area(&ball) / (16.0 * PI) - 1.0).abs() < 2e-3);
        for mesh in [quad(3.0, 2.0), disc(2.0)] {
            let [a, b, c] = mesh.corners(0);
            assert!((b - a).cross(c - a).z > 0.0);
        }
        for f in 0..ball.triangles.len() {
            let [a, b, c] = ball.corners(f);
            assert!((b - a).cross(c - a).dot(a + b + c) > 0.0);
        }
    }

    #[test]
    fn turns_about_x_then_y_then_z() {
        let d: ShapeDescription = toml::from_str(
            r#"type = "quad"
            width_mm = 2
            height_mm = 4
            material = "m"
            position_mm = [0, 0, 5]
            rotation_deg = [90, 0, 90]"#,
        )
        .unwrap();
        let parts = parts(&d, &Key::new("shapes.q"), &super::super::assets::MemoryAssets::default()).unwrap();
        let [a, b, c] = parts[0].mesh.corners(0);
        // The normal +z goes to -y about x, then to +x about z.
        let n = (b - a).cross(c - a).normalize();
        assert!((n - Vec3::X).length() < 1e-6, "{n}");
        assert!(parts[0].mesh.positions.iter().all(|p| (p.z - 5.0).abs() < 2.0 + 1e-5));
        assert_eq!(parts[0].uv_scale_mm, Vec2::new(2.0, 4.0));
    }

    fn made(text: &str) -> Result<Vec<Part>> {
        let d: ShapeDescription = toml::from_str(text).unwrap();
        parts(&d, &Key::new("shapes.s"), &super::super::assets::MemoryAssets::default())
    }

    #[test]
    fn a_lathe_stands_in_its_place() {
        let text = r#"type = "lathe"
            profile_mm = [[0, 0], [20, 0], [30, 50]]
            material = "m"
            position_mm = [0, 0, 7]"#;
        let (low, high) = made(text).unwrap()[0].mesh.bounds();
        assert!((low.z - 7.0).abs() < 3.0 && (high.z - 57.0).abs() < 1e-4, "{low} {high}");
        for (old, new, key) in
            [("30, 50", "-30, 50", "profile_mm"), ("\"m\"", "\"m\"\nsegments = 1", "segments")]
        {
            let e = made(&text.replace(old, new)).err().expect("refused");
            assert!(e.to_string().starts_with(&format!("shapes.s.{key}:")), "{e}");
        }
    }

    #[test]
    fn an_arrangement_becomes_organs_of_several_roses() {
        let text = r#"type = "arrangement"
            count = 2
            openness = [0.4, 0.8]
            rose = { detail = 0.2, petals = 5, leaves = { count = 1 } }
            scale = 2"#;
        let parts = made(text).unwrap();
        let count = |kind| parts.iter().filter(|p| p.organ == Some(kind)).count();
        assert_eq!(count(flower::OrganKind::Petal), 10);
        assert_eq!(count(flower::OrganKind::Receptacle), 2);
        let foot = parts.iter().map(|p| p.mesh.bounds().0.z).fold(f32::INFINITY, f32::min);
        assert!(foot > 0.0 && foot < 40.0, "{foot}");
        for (old, new, key) in [
            ("0.4", "nan", "openness"),
            ("petals = 5", "petals = 0", "rose.petals"),
            ("petals = 5", "petal = 5", "rose"),
            ("count = 2", "count = 0", "count"),
        ] {
            let e = made(&text.replacen(old, new, 1)).err().expect("refused");
            assert!(e.to_string().starts_with(&format!("shapes.s.{key}")), "{e}");
        }
    }
}

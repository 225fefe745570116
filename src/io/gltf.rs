//! glTF 2.0: triangle meshes in, a binary `.glb` out.
//!
//! glTF measures in metres with +y up and counts v downwards; we measure in millimetres with +z up and count v
//! upwards: `(x, y, z)_gltf = 0.001 (x, z, -y)`, `v_gltf = 1 - v`. The written root node holds the first, so vertices
//! are stored in millimetres. Read: all triangles of the default scene (or the first, or all root nodes), with the
//! transforms of their nodes; buffers in the file or in data URIs. Textures, materials, skins and morph targets are
//! not read; sparse accessors, compressed meshes and buffers in other files are errors.

use glam::{DMat4, DQuat, DVec3, Vec2, Vec3};
use serde::Deserialize;
use serde_json::Value;

pub use super::gltf_write::{write, write_unlit};
use super::{base64, finish, invalid};
use crate::geometry::Mesh;
use crate::{Error, Result};

pub(super) const FORMAT: &str = "glTF";

/// Instances repeat triangles that the file holds once; more than this many are not read.
const MAX_TRIANGLES: usize = 1 << 26;

/// What is read of a file's JSON. Indices are checked where they are used.
#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
struct Root {
    scene: Option<usize>,
    scenes: Vec<Scene>,
    nodes: Vec<Node>,
    meshes: Vec<MeshEntry>,
    accessors: Vec<Accessor>,
    buffer_views: Vec<View>,
    buffers: Vec<Buffer>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Scene {
    nodes: Vec<usize>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Node {
    mesh: Option<usize>,
    children: Vec<usize>,
    matrix: Option<[f64; 16]>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
}

#[derive(Deserialize)]
struct MeshEntry {
    primitives: Vec<Primitive>,
}

#[derive(Deserialize)]
struct Primitive {
    attributes: Attributes,
    indices: Option<usize>,
    mode: Option<u32>,
}

#[derive(Deserialize)]
#[serde(rename_all = "UPPERCASE")]
struct Attributes {
    position: Option<usize>,
    normal: Option<usize>,
    texcoord_0: Option<usize>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: usize,
    component_type: u32,
    #[serde(default)]
    normalized: bool,
    count: usize,
    #[serde(rename = "type")]
    shape: String,
    sparse: Option<Value>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct View {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: Option<usize>,
}

#[derive(Deserialize)]
struct Buffer {
    uri: Option<String>,
}

/// Component types of accessors.
const U8: u32 = 5121;
const U16: u32 = 5123;
pub(super) const U32: u32 = 5125;
pub(super) const F32: u32 = 5126;

/// Reads all meshes of the scene as one, in millimetres.
pub fn read(bytes: &[u8]) -> Result<Mesh> {
    let (json, binary) = if bytes.starts_with(b"glTF") { split_glb(bytes)? } else { (bytes, None) };
    let root: Root = serde_json::from_slice(json).map_err(|e| invalid(FORMAT, e))?;
    let file = File { buffers: load_buffers(&root, binary)?, root };
    let nodes = &file.root.nodes;

    let roots: Vec<usize> = match file.root.scenes.get(file.root.scene.unwrap_or(0)) {
        Some(scene) => scene.nodes.clone(),
        None => {
            let mut is_child = vec![false; nodes.len()];
            nodes.iter().flat_map(|n| &n.children).for_each(|&c| {
                if let Some(flag) = is_child.get_mut(c) {
                    *flag = true;
                }
            });
            (0..nodes.len()).filter(|&k| !is_child[k]).collect()
        }
    };
    let mut stack: Vec<(usize, DMat4)> = roots.iter().rev().map(|&k| (k, from_gltf())).collect();
    let mut visited = vec![false; nodes.len()];
    let mut whole = Mesh::default();
    while let Some((k, parent)) = stack.pop() {
        let node = get(nodes, k, "node")?;
        if std::mem::replace(&mut visited[k], true) {
            return Err(invalid(FORMAT, format_args!("node {k} has two parents")));
        }
        let world = parent * node.transform();
        if let Some(mesh) = node.mesh {
            for primitive in &get(&file.root.meshes, mesh, "mesh")?.primitives {
                let part = file.primitive(primitive, &world)?;
                if whole.triangles.len() + part.triangles.len() > MAX_TRIANGLES {
                    return Err(invalid(FORMAT, format_args!("more than {MAX_TRIANGLES} triangles")));
                }
                if !part.triangles.is_empty() {
                    whole.append(&part);
                }
            }
        }
        stack.extend(node.children.iter().rev().map(|&c| (c, world)));
    }
    finish(whole, FORMAT)
}

/// The JSON and the binary chunk of a `.glb`.
fn split_glb(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>)> {
    let cut = || invalid(FORMAT, "the file is cut or its chunk lengths are wrong");
    let number = |at: usize| {
        let four = bytes.get(at..).and_then(|b| b.first_chunk::<4>());
        four.map(|b| u32::from_le_bytes(*b)).ok_or_else(cut)
    };
    let chunk = |at: usize, kind: &[u8; 4]| {
        let length = number(at)? as usize;
        let found = bytes.get(at + 4..at + 8).ok_or_else(cut)? == kind;
        Ok::<_, Error>((found, bytes.get(at + 8..at + 8 + length).ok_or_else(cut)?))
    };
    if number(4)? != 2 {
        return Err(Error::Unsupported(format!("glTF version {}", number(4)?)));
    }
    if (number(8)? as usize) > bytes.len() {
        return Err(cut());
    }
    let (true, json) = chunk(12, b"JSON")? else {
        return Err(invalid(FORMAT, "the first chunk is not JSON"));
    };
    let next = 20 + json.len();
    if next + 8 > bytes.len() {
        return Ok((json, None));
    }
    let (is_binary, binary) = chunk(next, b"BIN\0")?;
    Ok((json, is_binary.then_some(binary)))
}

fn load_buffers(root: &Root, binary: Option<&[u8]>) -> Result<Vec<Vec<u8>>> {
    let load = |(k, buffer): (usize, &Buffer)| match &buffer.uri {
        None if k == 0 => {
            binary.map(<[u8]>::to_vec).ok_or_else(|| invalid(FORMAT, "there is no binary chunk for buffer 0"))
        }
        None => Err(invalid(FORMAT, format_args!("buffer {k} has no data"))),
        Some(uri) => match uri.strip_prefix("data:").map(|u| u.split_once(";base64,")) {
            Some(Some((_, text))) => base64::decode(text)
                .ok_or_else(|| invalid(FORMAT, format_args!("buffer {k} is not valid base64"))),
            Some(None) => Err(invalid(FORMAT, format_args!("buffer {k} is not base64"))),
            None => {
                Err(Error::Unsupported(format!("glTF with a buffer in another file (`{uri}`); use .glb")))
            }
        },
    };
    root.buffers.iter().enumerate().map(load).collect()
}

/// Metres with +y up to millimetres with +z up.
fn from_gltf() -> DMat4 {
    let mm = 1000.0;
    DMat4::from_cols(
        (DVec3::X * mm).extend(0.0),
        (DVec3::Z * mm).extend(0.0),
        (DVec3::NEG_Y * mm).extend(0.0),
        DVec3::ZERO.extend(1.0),
    )
}

fn get<'a, T>(items: &'a [T], index: usize, kind: &str) -> Result<&'a T> {
    items
        .get(index)
        .ok_or_else(|| invalid(FORMAT, format_args!("{kind} {index} is used, but there are {}", items.len())))
}

impl Node {
    fn transform(&self) -> DMat4 {
        match self.matrix {
            Some(matrix) => DMat4::from_cols_array(&matrix),
            None => DMat4::from_scale_rotation_translation(
                self.scale.map_or(DVec3::ONE, DVec3::from),
                self.rotation.map_or(DQuat::IDENTITY, |q| DQuat::from_array(q).normalize()),
                self.translation.map_or(DVec3::ZERO, DVec3::from),
            ),
        }
    }
}

struct File {
    root: Root,
    buffers: Vec<Vec<u8>>,
}

impl File {
    /// Triangles of one primitive in world coordinates; none if it is made of points or lines.
    fn primitive(&self, primitive: &Primitive, world: &DMat4) -> Result<Mesh> {
        let mode = primitive.mode.unwrap_or(4);
        if !(4..=6).contains(&mode) {
            return Ok(Mesh::default());
        }
        let attributes = &primitive.attributes;
        let positions = attributes
            .position
            .ok_or_else(|| invalid(FORMAT, "a mesh has no positions; compressed meshes are not supported"))?;
        let positions: Vec<[f32; 3]> = self.floats(positions, "VEC3")?;
        let normals: Vec<[f32; 3]> = attributes.normal.map_or(Ok(Vec::new()), |k| self.floats(k, "VEC3"))?;
        let uvs: Vec<[f32; 2]> = attributes.texcoord_0.map_or(Ok(Vec::new()), |k| self.floats(k, "VEC2"))?;
        let indices = match primitive.indices {
            Some(k) => self.indices(k)?,
            None => (0..positions.len() as u32).collect(),
        };
        let mirrored = world.determinant() < 0.0;
        let turn = |[a, b, c]: [u32; 3]| if mirrored { [a, c, b] } else { [a, b, c] };
        let triangles = match (mode, indices.as_slice()) {
            // A strip: every second triangle runs the other way round.
            (5, indices) => indices
                .windows(3)
                .enumerate()
                .map(|(k, w)| turn([w[0], w[1 + k % 2], w[2 - k % 2]]))
                .collect(),
            (6, [first, rest @ ..]) => rest.windows(2).map(|w| turn([*first, w[0], w[1]])).collect(),
            (_, indices) => indices.as_chunks::<3>().0.iter().map(|&t| turn(t)).collect(),
        };
        let point = |p: [f32; 3]| world.transform_point3(Vec3::from(p).as_dvec3()).as_vec3();
        let normal_matrix = world.inverse().transpose();
        let direction = |n: [f32; 3]| {
            normal_matrix.transform_vector3(Vec3::from(n).as_dvec3()).normalize_or_zero().as_vec3()
        };
        let mesh = Mesh {
            positions: positions.into_iter().map(point).collect(),
            normals: normals.into_iter().map(direction).collect(),
            uvs: uvs.into_iter().map(|[u, v]| Vec2::new(u, 1.0 - v)).collect(),
            triangles,
        };
        if !mesh.triangles.is_empty() {
            mesh.validate(FORMAT)?;
        }
        Ok(mesh)
    }

    /// Bytes of each element of an accessor, after checking that they lie in the buffer.
    fn elements(&self, k: usize, size: usize) -> Result<impl Iterator<Item = &[u8]>> {
        let accessor = get(&self.root.accessors, k, "accessor")?;
        if accessor.sparse.is_some() {
            return Err(Error::Unsupported("glTF with sparse accessors".into()));
        }
        let view = accessor.buffer_view.ok_or_else(|| {
            Error::Unsupported(format!("glTF accessor {k} without data (a compressed mesh?)"))
        })?;
        let view = get(&self.root.buffer_views, view, "buffer view")?;
        let stride = view.byte_stride.unwrap_or(size);
        let slice = || {
            let data = self.buffers.get(view.buffer)?;
            let data = data.get(view.byte_offset..view.byte_offset.checked_add(view.byte_length)?)?;
            let length = stride.checked_mul(accessor.count.checked_sub(1)?)?.checked_add(size)?;
            data.get(accessor.byte_offset..accessor.byte_offset.checked_add(length)?)
        };
        match slice() {
            Some(slice) if stride >= size => Ok(slice.chunks(stride).map(move |c| &c[..size])),
            _ => Err(invalid(
                FORMAT,
                format_args!("accessor {k} ({} elements) does not fit its buffer", accessor.count),
            )),
        }
    }

    /// Vectors of N floats, or of integers that stand for [0, 1].
    fn floats<const N: usize>(&self, k: usize, shape: &str) -> Result<Vec<[f32; N]>> {
        let accessor = get(&self.root.accessors, k, "accessor")?;
        let (size, scale) = match (accessor.component_type, accessor.normalized) {
            (F32, _) => (4, 1.0),
            (U16, true) => (2, 1.0 / 65535.0),
            (U8, true) => (1, 1.0 / 255.0),
            _ => (0, 0.0),
        };
        if size == 0 || accessor.shape != shape {
            return Err(invalid(FORMAT, format_args!("accessor {k} does not hold {shape} of floats")));
        }
        let value = |b: &[u8]| match *b {
            [v] => f32::from(v) * scale,
            [a, b] => f32::from(u16::from_le_bytes([a, b])) * scale,
            [a, b, c, d] => f32::from_le_bytes([a, b, c, d]),
            _ => f32::NAN,
        };
        let vectors = self.elements(k, N * size)?;
        Ok(vectors.map(|v| std::array::from_fn(|i| value(&v[i * size..(i + 1) * size]))).collect())
    }

    fn indices(&self, k: usize) -> Result<Vec<u32>> {
        let accessor = get(&self.root.accessors, k, "accessor")?;
        let size = match accessor.component_type {
            U8 => 1,
            U16 => 2,
            U32 => 4,
            _ => 0,
        };
        if size == 0 || accessor.shape != "SCALAR" {
            return Err(invalid(FORMAT, format_args!("accessor {k} does not hold indices")));
        }
        let value = |bytes: &[u8]| bytes.iter().rev().fold(0, |v, &b| v << 8 | u32::from(b));
        Ok(self.elements(k, size)?.map(value).collect())
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::io::damage::{damage, two_parts};

    fn near(a: &Mesh, b: &Mesh) {
        assert_eq!(a.triangles, b.triangles);
        assert_eq!((a.normals.len(), a.uvs.len()), (b.normals.len(), b.uvs.len()));
        let close = |a: &[Vec3], b: &[Vec3]| {
            a.iter().zip(b).all(|(a, b)| (a - b).length() < 1e-6 * (1.0 + b.length()))
        };
        assert!(close(&a.positions, &b.positions) && close(&a.normals, &b.normals), "{a:?}\n{b:?}");
        assert!(a.uvs.iter().zip(&b.uvs).all(|(a, b)| (a - b).length() < 1e-6));
    }

    #[test]
    fn light_is_in_the_colours() {
        let [(a, mesh_a), (b, mesh_b)] = two_parts();
        let colors: Vec<Vec<[f32; 3]>> =
            [&mesh_a, &mesh_b].map(|m| vec![[0.25, 7.0, f32::NAN]; m.positions.len()]).to_vec();
        let parts = [(a, &mesh_a), (b, &mesh_b)];
        let bytes = write_unlit(&parts, &colors).unwrap();
        let has = |name: &[u8]| bytes.windows(name.len()).any(|w| w == name);
        assert!(has(b"KHR_materials_unlit") && has(b"COLOR_0") && !has(b"doubleSided"));
        // Colours are within 0 to 1.
        let color: Vec<u8> = [0.25f32, 1.0, 0.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert!(has(&color));
        let mut whole = mesh_a.clone();
        whole.append(&mesh_b);
        assert_eq!(read(&bytes).unwrap().triangles, whole.triangles);
        assert!(write_unlit(&parts, &colors[..1]).is_err());
    }

    #[test]
    fn round_trip() {
        let [(a, mesh_a), (b, mesh_b)] = two_parts();
        let bytes = write(&[(a, &mesh_a), (b, &mesh_b)], &[[0.8, 0.1, 0.2]]).unwrap();
        let mut whole = mesh_a.clone();
        whole.append(&mesh_b);
        near(&read(&bytes).unwrap(), &whole);
        let bare = Mesh { normals: Vec::new(), uvs: Vec::new(), ..mesh_a };
        near(&read(&write(&[(a, &bare)], &[]).unwrap()).unwrap(), &bare);
    }

    /// A file as other tools write it: text, a data URI, 16-bit indices, nested nodes.
    fn text(nodes: Value, mode: u32) -> String {
        // Four corners of a unit square, then indices 0 1 2 3.
        let mut data = Vec::new();
        for v in [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]].as_flattened() {
            data.extend(v.to_le_bytes());
        }
        data.extend([0, 0, 1, 0, 2, 0, 3, 0]);
        let base64 = base64::encode(&data);
        json!({
            "asset": { "version": "2.0" },
            "nodes": nodes,
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1, "mode": mode }] }],
            "accessors": [
                { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] },
                { "bufferView": 1, "componentType": 5123, "count": 4, "type": "SCALAR" },
            ],
            "bufferViews": [
                { "buffer": 0, "byteLength": 48 },
                { "buffer": 0, "byteOffset": 48, "byteLength": 8 },
            ],
            "buffers": [{ "byteLength": 56, "uri": format!("data:application/octet-stream;base64,{base64}") }],
        })
        .to_string()
    }

    #[test]
    fn node_transforms_apply_and_mirrors_turn_triangles() {
        let nodes = json!([
            { "translation": [0, 2, 0], "children": [1, 2] },
            { "mesh": 0, "scale": [3, 1, 1] },
            { "mesh": 0, "scale": [-1, 1, 1] },
        ]);
        let mesh = read(text(nodes, 5).as_bytes()).unwrap();
        // (x, y, z) = (3, 1 + 2, 0) m, +y up, is (3000, 0, 3000) mm, +z up.
        assert!((mesh.positions[3] - Vec3::new(3000.0, 0.0, 3000.0)).length() < 1e-2);
        assert!((mesh.positions[5] - Vec3::new(-1000.0, 0.0, 2000.0)).length() < 1e-2);
        assert_eq!(mesh.triangles, [[0, 1, 2], [1, 3, 2], [4, 6, 5], [5, 6, 7]]);
        // The square faced +z, which is -y of ours, and still does, mirrored or not.
        for f in 0..4 {
            let [a, b, c] = mesh.corners(f);
            assert!((b - a).cross(c - a).y < 0.0, "face {f}");
        }
        assert_eq!(
            read(text(json!([{ "mesh": 0 }]), 6).as_bytes()).unwrap().triangles,
            [[0, 1, 2], [0, 2, 3]]
        );
    }

    #[test]
    fn bad_files_are_errors() {
        let error = |text: String| read(text.as_bytes()).unwrap_err().to_string();
        let good = || text(json!([{ "mesh": 0 }]), 4);
        assert_eq!(read(good().as_bytes()).unwrap().triangles, [[0, 1, 2]]);
        assert!(error(text(json!([{ "mesh": 0, "children": [0] }]), 4)).contains("no faces"));
        let two_parents = json!([{ "children": [2] }, { "children": [2] }, { "mesh": 0 }]);
        assert!(error(text(two_parents, 4)).contains("two parents"));
        assert!(error(text(json!([{ "mesh": 0 }]), 1)).contains("no faces"));
        assert!(error(good().replace("\"count\":4", "\"count\":4000000000")).contains("does not fit"));
        assert!(error(good().replace("\"count\":4", "\"count\":0")).contains("does not fit"));
        assert!(
            error(good().replace("\"byteLength\":48", "\"byteLength\":18446744073709551615"))
                .contains("does not fit")
        );
        assert!(error(good().replace("5123", "5126")).contains("indices"));
        assert!(error(good().replace("data:", "file:")).contains("another file"));
        assert!(error(good().replace("AAAAAAAAAAA", "AAAAAAAAAA!")).contains(FORMAT));
        assert!(read(b"glTF").is_err() && read(b"{}").is_err());
        assert!(read(b"glTF\x02\0\0\0\x04\0\0\0abcdefghijkl").is_err());
    }

    #[test]
    fn damaged_files_are_errors() {
        let [(a, mesh_a), (b, mesh_b)] = two_parts();
        let bytes = write(&[(a, &mesh_a), (b, &mesh_b)], &[]).unwrap();
        for n in [3, 13, 21, 500, bytes.len() - 1] {
            assert!(read(&bytes[..n]).is_err(), "{n}");
        }
        damage(&bytes, 3000, read);
        damage(text(json!([{ "mesh": 0 }]), 4).as_bytes(), 3000, read);
    }
}

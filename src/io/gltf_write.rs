//! The writing half of [`super::gltf`].

use glam::Vec3;
use serde_json::{Value, json};

use super::gltf::{F32, FORMAT, U32};
use super::{check_parts, invalid};
use crate::Result;
use crate::geometry::Mesh;

/// Writes a `.glb` with one node, mesh and two-sided material per part. `base_colors` (linear sRGB) are in the
/// order of the parts; parts without one are light grey.
pub fn write(parts: &[(&str, &Mesh)], base_colors: &[[f32; 3]]) -> Result<Vec<u8>> {
    let material = |k: usize| {
        let [r, g, b] = base_colors.get(k).copied().unwrap_or([0.8; 3]).map(share);
        json!({
            "doubleSided": true,
            "pbrMetallicRoughness": {
                "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.7,
            },
        })
    };
    assemble(parts, &material, &[], &[])
}

/// Writes a `.glb` whose light is in its colours: linear sRGB per vertex of each part, shown as they are
/// (`KHR_materials_unlit`) from the side that the triangles run counter-clockwise on.
pub fn write_unlit(parts: &[(&str, &Mesh)], colors: &[Vec<[f32; 3]>]) -> Result<Vec<u8>> {
    if colors.len() != parts.len() || parts.iter().zip(colors).any(|((_, m), c)| m.positions.len() != c.len())
    {
        return Err(invalid(FORMAT, "each vertex needs a colour"));
    }
    let material = |_| json!({ "extensions": { "KHR_materials_unlit": {} } });
    assemble(parts, &material, colors, &["KHR_materials_unlit"])
}

/// The format allows 0 to 1; NaN becomes 0.
fn share(v: f32) -> f32 {
    if v > 0.0 { v.min(1.0) } else { 0.0 }
}

fn assemble(
    parts: &[(&str, &Mesh)],
    material: &dyn Fn(usize) -> Value,
    colors: &[Vec<[f32; 3]>],
    extensions: &[&str],
) -> Result<Vec<u8>> {
    check_parts(parts, FORMAT)?;
    let mut out = Output::default();
    let (mut meshes, mut materials) = (Vec::new(), Vec::new());
    // The root turns and scales; the parts are its children.
    let mut nodes = vec![json!({
        "name": "rosarium",
        "matrix": [0.001, 0, 0, 0, 0, 0, -0.001, 0, 0, 0.001, 0, 0, 0, 0, 0, 1],
        "children": (1..=parts.len()).collect::<Vec<_>>(),
    })];
    for (k, (name, mesh)) in parts.iter().enumerate() {
        let (low, high) = mesh.bounds();
        let positions = mesh.positions.iter().flat_map(|p| p.to_array());
        let mut attributes = json!({ "POSITION": out.floats(positions, 3, Some((low, high))) });
        if !mesh.normals.is_empty() {
            let normals = mesh.normals.iter().flat_map(|n| n.normalize_or(Vec3::Z).to_array());
            attributes["NORMAL"] = out.floats(normals, 3, None).into();
        }
        if !mesh.uvs.is_empty() {
            let uvs = mesh.uvs.iter().flat_map(|t| [t.x, 1.0 - t.y]);
            attributes["TEXCOORD_0"] = out.floats(uvs, 2, None).into();
        }
        if let Some(colors) = colors.get(k) {
            attributes["COLOR_0"] = out.floats(colors.iter().flatten().copied().map(share), 3, None).into();
        }
        let indices = out.indices(mesh.triangles.iter().flatten().copied());
        meshes.push(json!({
            "name": name,
            "primitives": [{ "attributes": attributes, "indices": indices, "material": k }],
        }));
        let mut material = material(k);
        material["name"] = (*name).into();
        materials.push(material);
        nodes.push(json!({ "name": name, "mesh": k }));
    }
    let mut root = json!({
        "asset": { "version": "2.0", "generator": concat!("rosarium ", env!("CARGO_PKG_VERSION")) },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": nodes,
        "meshes": meshes,
        "materials": materials,
        "accessors": out.accessors,
        "bufferViews": out.views,
        "buffers": [{ "byteLength": out.bytes.len() }],
    });
    if !extensions.is_empty() {
        root["extensionsUsed"] = json!(extensions);
    }
    let mut json = serde_json::to_vec(&root).map_err(|e| invalid(FORMAT, e))?;
    json.resize(json.len().next_multiple_of(4), b' ');
    // The binary chunk holds 4-byte values only: it needs no padding.
    let length = 28 + json.len() + out.bytes.len();
    if u32::try_from(length).is_err() {
        return Err(invalid(FORMAT, "the meshes are larger than 4 GiB, the limit of .glb"));
    }
    let number = |n: usize| (n as u32).to_le_bytes();
    let mut bytes = Vec::with_capacity(length);
    bytes.extend_from_slice(b"glTF");
    bytes.extend([number(2), number(length), number(json.len()), *b"JSON"].as_flattened());
    bytes.append(&mut json);
    bytes.extend([number(out.bytes.len()), *b"BIN\0"].as_flattened());
    bytes.append(&mut out.bytes);
    Ok(bytes)
}

/// The binary chunk and what describes it.
#[derive(Default)]
struct Output {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Output {
    /// Index of a new accessor of vectors with N floats.
    fn floats(&mut self, values: impl Iterator<Item = f32>, n: usize, bounds: Option<(Vec3, Vec3)>) -> usize {
        let count = self.view(34_962, values.map(f32::to_le_bytes)) / n;
        let mut accessor = json!({
            "bufferView": self.views.len() - 1, "componentType": F32, "count": count, "type": format!("VEC{n}"),
        });
        if let Some((low, high)) = bounds {
            accessor["min"] = json!(low.to_array());
            accessor["max"] = json!(high.to_array());
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Index of a new accessor of 32-bit indices.
    fn indices(&mut self, values: impl Iterator<Item = u32>) -> usize {
        let count = self.view(34_963, values.map(u32::to_le_bytes));
        self.accessors.push(json!({
            "bufferView": self.views.len() - 1, "componentType": U32, "count": count, "type": "SCALAR",
        }));
        self.accessors.len() - 1
    }

    /// Adds a buffer view for vertices or indices; the number of 4-byte values.
    fn view(&mut self, target: u32, values: impl Iterator<Item = [u8; 4]>) -> usize {
        let offset = self.bytes.len();
        self.bytes.extend(values.flatten());
        let length = self.bytes.len() - offset;
        self.views.push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": length, "target": target }));
        length / 4
    }
}

//! PLY: triangle meshes, ASCII and binary in, binary little-endian out.
//!
//! Read: element `vertex` with `x y z`, optional `nx ny nz` and texture coordinates (`u v`, `s t` or
//! `texture_u texture_v`); element `face` with the list `vertex_indices` or `vertex_index`. Polygons become fans
//! of triangles, which is right for convex ones. Other elements and properties are skipped.
//! Written: several named parts are one vertex list; `comment part K NAME` names them and the face property
//! `part` holds K.

use std::io::Write;

use glam::{Vec2, Vec3};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::ScalarType;
use ply_rs_bw::ply::{
    BeginList, ElementDef, Encoding, Header, PropertyAccess, PropertyAccessResult, PropertyType,
};

use super::{check_parts, finish, invalid, push_fan};
use crate::Result;
use crate::geometry::Mesh;
use crate::spectrum::color::srgb_encode;

const FORMAT: &str = "PLY";

/// Reads a mesh.
pub fn read(bytes: &[u8]) -> Result<Mesh> {
    let fail = |e| invalid(FORMAT, e);
    let mut reader = Reader::new(bytes);
    let header = Parser::<Skip>::new().read_header(&mut reader).map_err(fail)?;
    check_header(&header, reader.get_ref().len())?;
    let mut vertices: Vec<Vertex> = Vec::new();
    let mut faces: Vec<Face> = Vec::new();
    for (name, element) in &header.elements {
        match name.as_str() {
            "vertex" => {
                vertices =
                    Parser::new().read_payload_for_element(&mut reader, element, &header).map_err(fail)?;
            }
            "face" => {
                faces =
                    Parser::new().read_payload_for_element(&mut reader, element, &header).map_err(fail)?;
            }
            _ => {
                Parser::<Skip>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(fail)?;
            }
        }
    }
    let seen = vertices.first().map_or(0, |v| v.seen);
    let has = |properties: u8| seen & properties == properties;
    if !has(0b0000_0111) {
        return Err(invalid(FORMAT, "there are no vertices with x, y and z"));
    }
    let mut mesh = Mesh {
        positions: vertices.iter().map(|v| Vec3::new(v.values[0], v.values[1], v.values[2])).collect(),
        ..Mesh::default()
    };
    if has(0b0011_1000) {
        mesh.normals = vertices.iter().map(|v| Vec3::new(v.values[3], v.values[4], v.values[5])).collect();
    }
    if has(0b1100_0000) {
        mesh.uvs = vertices.iter().map(|v| Vec2::new(v.values[6], v.values[7])).collect();
    }
    for (f, face) in faces.iter().enumerate() {
        push_fan(&mut mesh.triangles, &face.corners)
            .map_err(|n| invalid(FORMAT, format_args!("face {f} has {n} corners")))?;
    }
    finish(mesh, FORMAT)
}

/// Refuses headers that promise more elements than the rest of the file can hold.
fn check_header(header: &Header, rest: usize) -> Result<()> {
    let ascii = header.encoding == Encoding::Ascii;
    let size = |scalar: &ScalarType| match scalar {
        // A digit and what separates it from the next.
        _ if ascii => 2,
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    };
    let bytes = |element: &ElementDef| {
        let least: u64 = element
            .properties
            .values()
            .map(|p| match &p.data_type {
                PropertyType::Scalar(t) | PropertyType::List(t, _) => size(t),
            })
            .sum();
        (element.count as u64).saturating_mul(least)
    };
    for (name, element) in &header.elements {
        if element.properties.is_empty() && element.count > 0 {
            return Err(invalid(FORMAT, format_args!("element `{name}` has no properties")));
        }
    }
    let promised = header.elements.values().map(bytes).fold(0, u64::saturating_add);
    // The last line of a text file may lack its end.
    if promised > rest as u64 + u64::from(ascii) {
        return Err(invalid(
            FORMAT,
            format_args!("the header promises at least {promised} bytes of data, but {rest} follow"),
        ));
    }
    Ok(())
}

/// Makes the numeric setters of [`PropertyAccess`] one method.
macro_rules! scalars {
    ($($method:ident: $type:ty),*) => {
        $(fn $method(&mut self, name: &str, value: $type) -> PropertyAccessResult {
            self.set(name, value as f32);
            PropertyAccessResult::Set
        })*
    };
}

/// Makes the setters of integer lists one method.
macro_rules! lists {
    ($($method:ident: $type:ty),*) => {
        $(fn $method(&mut self, name: &str, values: Vec<$type>) -> PropertyAccessResult {
            if matches!(name, "vertex_indices" | "vertex_index") {
                // A negative index becomes one that no mesh has.
                self.corners = values.into_iter().map(|v| u32::try_from(v).unwrap_or(u32::MAX)).collect();
            }
            PropertyAccessResult::Set
        })*
    };
}

/// x y z nx ny nz u v, and which of them were there.
struct Vertex {
    values: [f32; 8],
    seen: u8,
}

impl Vertex {
    fn set(&mut self, name: &str, value: f32) {
        let slot = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            "nx" => 3,
            "ny" => 4,
            "nz" => 5,
            "u" | "s" | "texture_u" => 6,
            "v" | "t" | "texture_v" => 7,
            _ => return,
        };
        self.values[slot] = value;
        self.seen |= 1 << slot;
    }
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self { values: [0.0; 8], seen: 0 }
    }
    scalars!(set_char: i8, set_uchar: u8, set_short: i16, set_ushort: u16, set_int: i32, set_uint: u32);
    scalars!(set_float: f32, set_double: f64);
}

struct Face {
    corners: Vec<u32>,
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self { corners: Vec::new() }
    }
    fn begin_list_uint(&mut self, name: &str, _len: usize) -> BeginList<'_, u32> {
        if matches!(name, "vertex_indices" | "vertex_index") {
            BeginList::Fill(&mut self.corners)
        } else {
            BeginList::UseSetter
        }
    }
    lists!(set_list_char: i8, set_list_uchar: u8, set_list_short: i16, set_list_ushort: u16);
    lists!(set_list_int: i32, set_list_uint: u32);
}

/// An element that is read past.
struct Skip;

impl PropertyAccess for Skip {
    fn new() -> Self {
        Self
    }
}

/// Writes named parts. Normals and texture coordinates are written if all parts have them.
pub fn write(parts: &[(&str, &Mesh)]) -> Result<Vec<u8>> {
    write_parts(parts, None)
}

/// Writes named parts with a colour per vertex, linear sRGB: `red green blue` are levels of sRGB, as viewers take them.
pub fn write_colored(parts: &[(&str, &Mesh)], colors: &[Vec<[f32; 3]>]) -> Result<Vec<u8>> {
    if colors.len() != parts.len() || parts.iter().zip(colors).any(|((_, m), c)| m.positions.len() != c.len())
    {
        return Err(invalid(FORMAT, "each vertex needs a colour"));
    }
    write_parts(parts, Some(colors))
}

fn write_parts(parts: &[(&str, &Mesh)], colors: Option<&[Vec<[f32; 3]>]>) -> Result<Vec<u8>> {
    let (vertices, faces) = check_parts(parts, FORMAT)?;
    let normals = parts.iter().all(|(_, m)| !m.normals.is_empty());
    let uvs = parts.iter().all(|(_, m)| !m.uvs.is_empty());
    let several = parts.len() > 1;

    let mut header = String::from("ply\nformat binary_little_endian 1.0\n");
    for (k, (name, _)) in parts.iter().enumerate() {
        header += &format!("comment part {k} {}\n", name.replace(|c: char| c.is_control(), " "));
    }
    header += &format!("element vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n");
    if normals {
        header += "property float nx\nproperty float ny\nproperty float nz\n";
    }
    if uvs {
        header += "property float u\nproperty float v\n";
    }
    if colors.is_some() {
        header += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    }
    header += &format!("element face {faces}\nproperty list uchar int vertex_indices\n");
    if several {
        header += "property int part\n";
    }
    header += "end_header\n";

    let mut bytes = header.into_bytes();
    bytes.reserve(vertices * 32 + faces * 17);
    // Writing to a `Vec` cannot fail; the error is passed on all the same.
    let mut body = || -> std::io::Result<()> {
        for (k, (_, mesh)) in parts.iter().enumerate() {
            for (i, p) in mesh.positions.iter().enumerate() {
                p.to_array().iter().try_for_each(|v| bytes.write_all(&v.to_le_bytes()))?;
                if normals {
                    mesh.normals[i].to_array().iter().try_for_each(|v| bytes.write_all(&v.to_le_bytes()))?;
                }
                if uvs {
                    mesh.uvs[i].to_array().iter().try_for_each(|v| bytes.write_all(&v.to_le_bytes()))?;
                }
                if let Some(colors) = colors {
                    bytes.write_all(&colors[k][i].map(level))?;
                }
            }
        }
        let mut base = 0;
        for (k, (_, mesh)) in parts.iter().enumerate() {
            for triangle in &mesh.triangles {
                bytes.write_all(&[3])?;
                triangle.iter().try_for_each(|&i| bytes.write_all(&(base + i).to_le_bytes()))?;
                if several {
                    bytes.write_all(&(k as u32).to_le_bytes())?;
                }
            }
            base += mesh.positions.len() as u32;
        }
        Ok(())
    };
    body().map_err(|e| invalid(FORMAT, e))?;
    Ok(bytes)
}

/// Level of a linear value.
fn level(linear: f32) -> u8 {
    // NaN is black.
    (srgb_encode(linear.clamp(0.0, 1.0)) * 255.0 + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::damage::{damage, two_parts};

    const ASCII: &str = "ply\nformat ascii 1.0\ncomment a cube's corner\nelement vertex 4\nproperty double x\n\
        property float y\nproperty float z\nproperty uchar red\nelement face 1\n\
        property list uchar int vertex_index\nelement edge 1\nproperty int a\nend_header\n\
        0 0 0 255\n1 0 0 255\n1 1e0 0 0\n0 1 0.5 0\n4 0 1 2 3\n7\n";

    #[test]
    fn round_trip() {
        let [(a, mesh_a), (b, mesh_b)] = two_parts();
        let mut whole = mesh_a.clone();
        whole.append(&mesh_b);
        assert_eq!(read(&write(&[(a, &mesh_a), (b, &mesh_b)]).unwrap()).unwrap(), whole);
        let bare = Mesh { normals: Vec::new(), uvs: Vec::new(), ..mesh_a.clone() };
        assert_eq!(read(&write(&[(a, &bare)]).unwrap()).unwrap(), bare);
        let mixed = read(&write(&[(a, &mesh_a), (b, &bare)]).unwrap()).unwrap();
        assert!(mixed.normals.is_empty() && mixed.uvs.is_empty());
    }

    #[test]
    fn colours_are_levels_of_srgb() {
        let [(a, mesh), _] = two_parts();
        let colors = vec![vec![[0.215_86, 2.0, f32::NAN]; mesh.positions.len()]];
        let bytes = write_colored(&[(a, &mesh)], &colors).unwrap();
        assert_eq!(bytes.windows(3).filter(|w| w == &[128, 255, 0]).count(), mesh.positions.len());
        assert_eq!(read(&bytes).unwrap(), mesh);
        assert!(write_colored(&[(a, &mesh)], &[]).is_err());
    }

    #[test]
    fn text_polygons_and_other_elements() {
        let mesh = read(ASCII.as_bytes()).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(mesh.positions[3], Vec3::new(0.0, 1.0, 0.5));
        assert!(mesh.normals.is_empty());
    }

    #[test]
    fn big_endian() {
        let mut bytes =
            b"ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
            property float z\nelement face 1\nproperty list uchar ushort vertex_indices\nend_header\n"
                .to_vec();
        for v in [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
            bytes.extend(v.to_be_bytes());
        }
        bytes.extend([3, 0, 0, 0, 1, 0, 2]);
        let mesh = read(&bytes).unwrap();
        assert_eq!((mesh.triangles[0], mesh.positions[2]), ([0, 1, 2], Vec3::Y));
    }

    #[test]
    fn bad_meshes_are_errors() {
        let swap = |from: &str, to: &str| read(ASCII.replace(from, to).as_bytes()).unwrap_err().to_string();
        assert!(swap("4 0 1 2 3", "4 0 1 2 9").contains("vertex 9"));
        assert!(swap("4 0 1 2 3", "4 0 1 2 -1").contains("vertex"));
        assert!(swap("4 0 1 2 3", "2 0 1").contains("2 corners"));
        assert!(swap("vertex 4", "vertex 4000000000000").contains("promises"));
        assert!(swap("face 1", "face 18446744073709551615").contains("promises"));
        assert!(swap("property int a", "comment").contains("no properties"));
        assert!(swap("property float z", "property float w").contains("x, y and z"));
        assert!(swap("element face 1", "element facet 1").contains("no faces"));
        assert!(read(b"").is_err() && read(b"ply\n").is_err());
        let mut mesh = two_parts()[0].1.clone();
        mesh.positions[0].x = f32::NAN;
        assert!(write(&[("nan", &mesh)]).is_err() && write(&[]).is_err());
        assert!(write(&[("empty", &Mesh::default())]).is_err());
    }

    #[test]
    fn lists_of_huge_length_are_errors() {
        let mut bytes =
            b"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
            property float z\nelement face 1\nproperty list uint uint vertex_indices\nend_header\n"
                .to_vec();
        bytes.extend([0; 12]);
        bytes.extend(u32::MAX.to_le_bytes());
        bytes.extend([0; 40]);
        assert!(read(&bytes).is_err());
    }

    #[test]
    fn damaged_files_are_errors() {
        let [(a, mesh_a), (b, mesh_b)] = two_parts();
        let bytes = write(&[(a, &mesh_a), (b, &mesh_b)]).unwrap();
        assert!(read(&bytes[..bytes.len() - 1]).is_err());
        damage(&bytes, 3000, read);
        damage(ASCII.as_bytes(), 3000, read);
    }
}

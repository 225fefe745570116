//! Wavefront OBJ: triangle meshes in and out.
//!
//! Read: `v`, `vt`, `vn` and `f` with absolute or relative indices; polygons become fans of triangles. Groups,
//! objects, materials, lines and points are skipped. Normals and texture coordinates are kept if every corner
//! has them. Errors name the line.

use std::collections::HashMap;
use std::fmt::Write;

use glam::{Vec2, Vec3};

use super::{check_parts, finish, invalid, push_fan};
use crate::geometry::Mesh;
use crate::{Error, Result};

const FORMAT: &str = "OBJ";

/// Position, texture coordinates and normal of a corner, as indices from 0.
type Corner = (usize, Option<usize>, Option<usize>);

/// Reads a mesh.
pub fn read(bytes: &[u8]) -> Result<Mesh> {
    let (mut positions, mut uvs, mut normals) = (Vec::<Vec3>::new(), Vec::<Vec2>::new(), Vec::<Vec3>::new());
    let mut vertices: Vec<Corner> = Vec::new();
    let mut index_of: HashMap<Corner, u32> = HashMap::new();
    let mut mesh = Mesh::default();
    let mut corners = Vec::new();
    for (number, line) in bytes.split(|&b| b == b'\n').enumerate() {
        let wrong = |what: String| Error::invalid(format!("{FORMAT}:{}", number + 1), what);
        let line = String::from_utf8_lossy(line);
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => positions.push(Vec3::from(floats(words).map_err(wrong)?)),
            Some("vn") => normals.push(Vec3::from(floats(words).map_err(wrong)?)),
            Some("vt") => {
                // One-dimensional coordinates exist.
                let [u, v] = floats(words.chain(["0"])).map_err(wrong)?;
                uvs.push(Vec2::new(u, v));
            }
            Some("f") => {
                corners.clear();
                for word in words {
                    let corner =
                        parse_corner(word, [positions.len(), uvs.len(), normals.len()]).map_err(wrong)?;
                    let next = vertices.len();
                    let index = *index_of.entry(corner).or_insert_with(|| {
                        vertices.push(corner);
                        next as u32
                    });
                    corners.push(index);
                }
                push_fan(&mut mesh.triangles, &corners)
                    .map_err(|n| wrong(format!("a face needs 3 corners or more, not {n}")))?;
            }
            _ => {}
        }
    }
    if u32::try_from(vertices.len()).is_err() {
        return Err(invalid(FORMAT, "more than 2^32 vertices"));
    }
    mesh.positions = vertices.iter().map(|&(v, ..)| positions[v]).collect();
    mesh.uvs =
        vertices.iter().map(|&(_, vt, _)| vt.map(|i| uvs[i])).collect::<Option<_>>().unwrap_or_default();
    mesh.normals =
        vertices.iter().map(|&(.., vn)| vn.map(|i| normals[i])).collect::<Option<_>>().unwrap_or_default();
    finish(mesh, FORMAT)
}

/// The first N words as numbers.
fn floats<'a, const N: usize>(mut words: impl Iterator<Item = &'a str>) -> Result<[f32; N], String> {
    let mut values = [0.0; N];
    for value in &mut values {
        let word = words.next().ok_or_else(|| format!("{N} numbers are needed"))?;
        *value = word.parse().map_err(|_| format!("`{word}` is not a number"))?;
    }
    Ok(values)
}

/// `v`, `v/vt`, `v//vn` or `v/vt/vn`; `counts` of each so far.
fn parse_corner(word: &str, counts: [usize; 3]) -> Result<Corner, String> {
    const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];
    let mut found = [None; 3];
    for (k, field) in word.split('/').enumerate() {
        if field.is_empty() && k > 0 {
            continue;
        }
        let (Some(slot), Ok(i)) = (found.get_mut(k), field.parse::<i64>()) else {
            return Err(format!("`{word}` is not a corner of a face"));
        };
        let index = if i > 0 { i.checked_sub(1) } else { i.checked_add(counts[k] as i64).filter(|_| i < 0) };
        let index = index.and_then(|i| usize::try_from(i).ok()).filter(|&i| i < counts[k]);
        *slot =
            Some(index.ok_or_else(|| {
                format!("a face uses {} {i}, but there are {} so far", KINDS[k], counts[k])
            })?);
    }
    let [Some(v), vt, vn] = found else { return Err(format!("`{word}` is not a corner of a face")) };
    Ok((v, vt, vn))
}

/// Writes named parts as objects. Numbers have all their digits.
pub fn write(parts: &[(&str, &Mesh)]) -> Result<Vec<u8>> {
    check_parts(parts, FORMAT)?;
    let mut out = String::new();
    let mut put = || -> std::fmt::Result {
        let (mut base, mut base_uv, mut base_normal) = (1u64, 1u64, 1u64);
        for (name, mesh) in parts {
            writeln!(out, "o {}", name.replace(|c: char| c.is_whitespace() || c.is_control(), "_"))?;
            for p in &mesh.positions {
                writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
            }
            for t in &mesh.uvs {
                writeln!(out, "vt {} {}", t.x, t.y)?;
            }
            for n in &mesh.normals {
                writeln!(out, "vn {} {} {}", n.x, n.y, n.z)?;
            }
            for triangle in &mesh.triangles {
                out.push('f');
                for i in triangle.map(u64::from) {
                    match (mesh.uvs.is_empty(), mesh.normals.is_empty()) {
                        (true, true) => write!(out, " {}", base + i)?,
                        (false, true) => write!(out, " {}/{}", base + i, base_uv + i)?,
                        (true, false) => write!(out, " {}//{}", base + i, base_normal + i)?,
                        (false, false) => write!(out, " {}/{}/{}", base + i, base_uv + i, base_normal + i)?,
                    }
                }
                out.push('\n');
            }
            base += mesh.positions.len() as u64;
            base_uv += mesh.uvs.len() as u64;
            base_normal += mesh.normals.len() as u64;
        }
        Ok(())
    };
    put().map_err(|e| invalid(FORMAT, e))?;
    Ok(out.into_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::damage::{damage, two_parts};

    #[test]
    fn round_trip() {
        let [(a, mesh_a), (b, mesh_b)] = two_parts();
        let bare = Mesh { normals: Vec::new(), uvs: Vec::new(), ..mesh_b.clone() };
        let flat = Mesh { normals: Vec::new(), ..mesh_a.clone() };
        for parts in [vec![(a, &mesh_a), (b, &mesh_b)], vec![(b, &bare)], vec![(a, &flat)]] {
            let mut whole = Mesh::default();
            parts.iter().for_each(|(_, m)| whole.append(m));
            let back = read(&write(&parts).unwrap()).unwrap();
            // Vertices come in the order of their first use.
            let corners =
                |m: &Mesh| -> Vec<Vec3> { (0..m.triangles.len()).flat_map(|f| m.corners(f)).collect() };
            assert_eq!(corners(&back), corners(&whole));
            let pick = |m: &Mesh, of: &[Vec2]| -> Vec<Vec2> {
                m.triangles.iter().flatten().filter_map(|&i| of.get(i as usize).copied()).collect()
            };
            assert_eq!(pick(&back, &back.uvs), pick(&whole, &whole.uvs));
            assert_eq!(back.normals.is_empty(), whole.normals.is_empty());
        }
    }

    #[test]
    fn polygons_relative_indices_and_shared_vertices() {
        let text = "# a house\nmtllib none.mtl\nv 0 0 0\nv 1 0 0 1 0 0\nv 1 1 0\r\nv 0 1 0\nv .5 2 0\n\
            g wall\nusemtl x\nf 1 2 3 4\nf -1 4/ 3\nl 1 2\n";
        let mesh = read(text.as_bytes()).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [4, 3, 2]]);
        assert_eq!(mesh.positions[4], Vec3::new(0.5, 2.0, 0.0));
        // A corner without texture coordinates drops them all.
        let mesh = read(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 1\nf 1/1 2/1 3").unwrap();
        assert!(mesh.uvs.is_empty());
        let mesh = read(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 1\nf 1/1 2/1 3/-1").unwrap();
        assert_eq!(mesh.uvs[2], Vec2::X);
    }

    #[test]
    fn bad_meshes_are_errors() {
        let error = |text: &str| read(text.as_bytes()).unwrap_err().to_string();
        let v = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
        assert!(error(&format!("{v}f 1 2 4")).starts_with("OBJ:4: a face uses vertex 4"));
        assert!(error(&format!("{v}f 1 2 -4")).contains("vertex -4"));
        assert!(error(&format!("{v}f 0 1 2")).contains("vertex 0"));
        assert!(error(&format!("{v}f 1/1 2/1 3/1")).contains("texture coordinate 1"));
        assert!(error(&format!("{v}f 1/-9223372036854775808 2 3")).contains("texture"));
        assert!(error(&format!("{v}f 1 2")).contains("not 2"));
        assert!(error(&format!("{v}f 1 2 x")).contains("`x`"));
        assert!(error(&format!("{v}f 1///1 2 3")).contains("corner"));
        assert!(error("v 0 0").contains("3 numbers"));
        assert!(error("v 0 0 zero").contains("`zero`"));
        assert!(error("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3").contains("finite"));
        assert!(error(v).contains("no faces") && error("").contains("no faces"));
    }

    #[test]
    fn damaged_files_are_errors() {
        let [(a, mesh_a), (b, mesh_b)] = two_parts();
        damage(&write(&[(a, &mesh_a), (b, &mesh_b)]).unwrap(), 3000, read);
    }
}

//! Test helpers: damaged copies of a valid file for the readers, and meshes for the round trips.

use glam::{Vec2, Vec3};

use crate::geometry::Mesh;
use crate::math::sampler::hash;

/// Calls `read` with truncated copies of `valid`, with copies whose bytes are changed (most near the start, where
/// headers are), and with runs of equal or random bytes. `read` must return; what it returns does not matter.
pub(crate) fn damage<T>(valid: &[u8], rounds: u32, read: impl Fn(&[u8]) -> T) {
    let length = valid.len();
    for i in 0..rounds {
        let draw = |k: u32| hash(i.wrapping_mul(31).wrapping_add(k)) as usize;
        let cut = if i % 2 == 0 { draw(0) % (length + 1) } else { (draw(0) % 400).min(length) };
        read(&valid[..cut]);
        let mut mutated = valid.to_vec();
        for k in 0..=draw(1) % 4 {
            let span = if i % 3 == 0 { length } else { length.min(400) };
            let at = draw(2 + k as u32) % span.max(1);
            // Values that headers choke on, or any.
            let byte =
                [0, 1, 0x7f, 0x80, 0xff, b'-', b'9', draw(20 + k as u32) as u8][draw(10 + k as u32) % 8];
            if let Some(b) = mutated.get_mut(at) {
                *b = byte;
            }
        }
        read(&mutated);
        mutated.rotate_left(draw(3) % length.max(1));
        read(&mutated);
        let noise: Vec<u8> = (0..draw(4) as u32 % 300).map(|k| hash(i ^ (k << 16)) as u8).collect();
        read(&noise);
        let start = valid.iter().copied().take(draw(5) % 200).chain(noise).collect::<Vec<_>>();
        read(&start);
    }
}

/// Two small named meshes with normals and texture coordinates.
pub(super) fn two_parts() -> [(&'static str, Mesh); 2] {
    let mut petal = Mesh {
        positions: (0..9)
            .map(|i| Vec3::new((i % 3) as f32 * 0.1, (i / 3) as f32 / 3.0, (i * i) as f32))
            .collect(),
        uvs: (0..9).map(|i| Vec2::new((i % 3) as f32 / 2.0, (i / 3) as f32 / 2.0)).collect(),
        triangles: vec![
            [0, 1, 4],
            [0, 4, 3],
            [1, 2, 5],
            [1, 5, 4],
            [3, 4, 7],
            [3, 7, 6],
            [4, 5, 8],
            [4, 8, 7],
        ],
        ..Mesh::default()
    };
    petal.compute_normals();
    let mut sepal = Mesh {
        positions: vec![Vec3::new(-1.0, 1e-3, 5.0), Vec3::new(2.0, 0.0, -7.25), Vec3::new(0.0, 123.456, 0.0)],
        uvs: vec![Vec2::ZERO, Vec2::X, Vec2::new(0.3, 0.7)],
        triangles: vec![[2, 0, 1]],
        ..Mesh::default()
    };
    sepal.compute_normals();
    [("petal 1", petal), ("sepal", sepal)]
}

//! A rose, grown petal by petal, as a mesh for other programs.
//!
//! Run it: `cargo run --example 4_rose` (it writes rose.glb in metres, +y up, and rose.ply in millimetres, +z up).

#![allow(clippy::print_stdout, reason = "an example says what it finds")]

use rosarium::flower::{OrganKind, RoseDescription, grow};
use rosarium::geometry::Mesh;
use rosarium::io;

fn main() -> rosarium::Result<()> {
    // The florist's rose, with fewer petals and another seed: another flower of the same kind.
    let description = RoseDescription { petals: 24, seed: 7, ..RoseDescription::hybrid_tea() };
    let rose = grow(&description)?;

    let (low, high) = rose.merged().bounds();
    println!("{} organs, {} triangles", rose.organs.len(), rose.triangle_count());
    println!("from {low:.1} to {high:.1} mm");
    for kind in [OrganKind::Petal, OrganKind::Sepal, OrganKind::Receptacle, OrganKind::Stem] {
        let area: f32 = rose
            .of_kind(kind)
            .map(|o| (0..o.mesh.triangles.len()).map(|f| o.mesh.face_area(f)).sum::<f32>())
            .sum();
        println!("{kind:?}: {} parts, {:.1} cm2", rose.of_kind(kind).count(), area / 100.0);
    }

    let names: Vec<String> = rose.organs.iter().map(|o| format!("{:?} {}", o.kind, o.index)).collect();
    let parts: Vec<(&str, &Mesh)> =
        names.iter().map(String::as_str).zip(rose.organs.iter().map(|o| &o.mesh)).collect();
    // Base colours are for viewers only; a scene gives the petals their cells.
    let colors: Vec<[f32; 3]> = rose
        .organs
        .iter()
        .map(|o| if o.kind == OrganKind::Petal { [0.45, 0.01, 0.03] } else { [0.06, 0.15, 0.04] })
        .collect();
    let files = [("rose.glb", io::gltf::write(&parts, &colors)?), ("rose.ply", io::ply::write(&parts)?)];
    for (name, bytes) in files {
        println!("{name}: {} bytes", bytes.len());
        // What was written reads back with every triangle.
        assert_eq!(io::read_mesh(&bytes)?.triangles.len(), rose.triangle_count());
        std::fs::write(name, bytes).map_err(|e| rosarium::Error::io(name, e))?;
    }
    Ok(())
}

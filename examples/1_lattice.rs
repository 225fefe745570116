//! A piece of petal: cell centres on a triangular grid, Voronoi cells, domes; then disorder, then a file.
//!
//! Run it: `cargo run --example 1_lattice` (it writes cells.ply, in micrometres, and cells.svg).

#![allow(clippy::print_stdout, reason = "an example says what it finds")]

use rosarium::io;
use rosarium::math::stats::Welford;
use rosarium::micro::tile_mesh::tile_mesh;
use rosarium::micro::{CellDescription, CellField};

fn describe(name: &str, cells: &CellDescription) -> rosarium::Result<CellField> {
    let field = CellField::new(cells)?;
    let (mut area, mut height, mut corners) = (Welford::default(), Welford::default(), Welford::default());
    for (cell, i) in field.lattice().cells.iter().zip(0..) {
        area.push(cell.area_um2);
        height.push(field.dome(i).height_um);
        corners.push(cell.corners_um.len() as f64);
    }
    println!("{name}: {} cells repeat every {:.1} um", field.cell_count(), field.tile_um());
    println!("  corners per cell {:.2}", corners.mean());
    println!("  area   {:7.2} +- {:5.2} um2", area.mean(), area.variance().sqrt());
    println!("  height {:7.2} +- {:5.2} um", height.mean(), height.variance().sqrt());
    Ok(field)
}

fn main() -> rosarium::Result<()> {
    let regular = CellDescription::default();
    let field = describe("as in the thesis", &regular)?;
    // A hexagon of pitch p has the area sqrt(3)/2 p^2.
    let hexagon = 0.75f64.sqrt() * regular.pitch_um.powi(2);
    assert!((field.cell_area_um2(0) - hexagon).abs() < 1e-9);

    let disordered = CellDescription {
        center_disorder: 0.1,
        height_disorder: 0.1,
        tilt_disorder_deg: 3.0,
        tile_cells: 8,
        ..regular
    };
    let field = describe("with disorder", &disordered)?;

    // The library makes bytes; where they go is the caller's business.
    let mesh = tile_mesh(&field, [1, 1], 8);
    let ply = io::ply::write(&[("cells", &mesh)])?;
    let svg = io::cell_plot::svg(&field, "disordered cells")?;
    for (name, bytes) in [("cells.ply", ply), ("cells.svg", svg.into_bytes())] {
        println!("{name}: {} bytes", bytes.len());
        std::fs::write(name, bytes).map_err(|e| rosarium::Error::io(name, e))?;
    }
    println!("{} triangles", mesh.triangles.len());
    Ok(())
}

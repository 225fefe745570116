//! One cell of a petal, and one ray.
//!
//! A cell's dome is a cosine of the distance r from its axis: h(r) = H cos(pi r / 2R), here with the height
//! and pitch of the thesis. The ray's first hit is exact: it has no step length that one could choose badly.
//!
//! Run it: `cargo run --example 0_one_cell`

#![allow(clippy::print_stdout, reason = "an example says what it finds")]

use std::f64::consts::PI;

use glam::DVec3;
use rosarium::micro::{CellDescription, CellField};

fn main() -> rosarium::Result<()> {
    let field = CellField::new(&CellDescription::default())?;
    let dome = field.dome(0);
    println!("dome: height {} um over a base of radius {:.3} um", dome.height_um, dome.radius_um);

    // The centre of a cell, and a ray that comes down beside it at 60 degrees from the normal.
    let (_, centre) = field.cell_at(glam::DVec2::ZERO);
    let angle = 60f64.to_radians();
    let direction = DVec3::new(angle.sin(), 0.0, -angle.cos());
    let origin = centre.extend(0.0) + DVec3::new(-60.0, 3.0, 60.0);

    let Some(hit) = field.first_hit(origin, direction) else {
        println!("the ray passes over the petal");
        return Ok(());
    };
    println!("first hit after {:.6} um at {:.6}: {:?}", hit.t_um, hit.p, hit.kind);
    println!("normal {:.4}", hit.normal);

    // The hit lies on the ray and on the dome's equation.
    let r = (hit.p.truncate() - hit.site_um).length();
    let on_dome = dome.height_um * (0.5 * PI * r / dome.radius_um).cos();
    println!("height by the equation {on_dome:.9} um, of the hit {:.9} um", hit.p.z);
    assert!((on_dome - hit.p.z).abs() < 1e-9);
    assert!((origin + direction * hit.t_um).abs_diff_eq(hit.p, 1e-9));

    // Nothing is nearer: walk along the ray in small steps and look at the height below it.
    let clear = (0..10_000).map(|i| hit.t_um * f64::from(i) / 10_000.0).all(|t| {
        let p = origin + direction * t;
        p.z > field.height_at_um(p.truncate()) - 1e-9
    });
    println!("10000 points before it are all above the surface: {clear}");
    assert!(clear);
    Ok(())
}

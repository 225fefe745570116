//! A tile of cells as triangles, and the cells' outlines, for pictures and for other programs.
//!
//! Model: the surface as seen from above, z(x, y). Each polygon is a fan around its centre: every side is cut
//! into `rings` parts, every spoke into `rings` parts up to the dome's rim, the base beyond it gets one more
//! strip. Neighbours share the points of their common side, and where their heights differ there the
//! vertical wall is filled in, so the sheet has no gap. Frame and unit of [`super::height_field`]: z up, um.
//!
//! Limits: a dome that leans so far that it overhangs is filled down to the base; corners of the mesh lie on
//! the exact surface (`corners_lie_on_the_surface`), and projected and closed it covers the tile once
//! (`covers_the_tile`).

use glam::{DVec2, DVec3};

use super::height_field::CellField;
use super::lattice::VoronoiEdge;
use crate::geometry::Mesh;

/// Heights closer than this are one, um.
const SAME_UM: f64 = 1e-9;

/// Triangles of `tiles` copies of the tile along x and y, at least one each; positions in um. `rings` from 1 to
/// 256 sets the fineness: about 2 `rings`^2 triangles per side of a cell.
pub fn tile_mesh(field: &CellField, tiles: [u32; 2], rings: u32) -> Mesh {
    let rings = rings.clamp(1, 256);
    let mut mesh = Mesh::default();
    for shift in shifts(field, tiles) {
        for cell in 0..field.cell_count() as u32 {
            add_cell(&mut mesh, field, cell, shift, rings);
        }
    }
    mesh
}

/// Corners of every cell of `tiles` copies of the tile, counter-clockwise, um.
pub fn voronoi_outlines(field: &CellField, tiles: [u32; 2]) -> Vec<Vec<DVec2>> {
    shifts(field, tiles)
        .flat_map(|shift| {
            field
                .lattice()
                .cells
                .iter()
                .map(move |c| c.corners_um.iter().map(|&corner| corner + c.site_um + shift).collect())
        })
        .collect()
}

fn shifts(field: &CellField, tiles: [u32; 2]) -> impl Iterator<Item = DVec2> + use<> {
    let tile_um = field.tile_um();
    let [nx, ny] = tiles.map(|n| n.max(1));
    (0..ny).flat_map(move |y| (0..nx).map(move |x| DVec2::new(f64::from(x), f64::from(y)) * tile_um))
}

fn push(mesh: &mut Mesh, p: DVec3, normal: DVec3) -> u32 {
    mesh.positions.push(p.as_vec3());
    mesh.normals.push(normal.as_vec3());
    mesh.positions.len() as u32 - 1
}

/// Two triangles; one, where two of the corners are the same point.
fn quad(mesh: &mut Mesh, [a, b, c, d]: [u32; 4]) {
    for t in [[a, b, c], [a, c, d]] {
        let [p, q, r] = t.map(|i| mesh.positions[i as usize]);
        if p != q && q != r && r != p {
            mesh.triangles.push(t);
        }
    }
}

fn add_cell(mesh: &mut Mesh, field: &CellField, cell: u32, shift: DVec2, rings: u32) {
    let polygon = &field.lattice().cells[cell as usize];
    let site = polygon.site_um + shift;
    let dome = field.dome(cell);
    let sides = polygon.edges.len();
    let sides_points: Vec<Vec<DVec2>> = (0..sides).map(|k| side_points(field, cell, k, rings)).collect();
    let outline: Vec<DVec2> = sides_points.iter().flatten().copied().collect();
    // A leaning dome has no round rim in the plane: its spokes run to the outline.
    let upright = field.tilt(cell) == DVec2::ZERO;
    let rim = |p: DVec2| if upright { (dome.radius_um / p.length()).min(1.0) } else { 1.0 };

    let vertex = |mesh: &mut Mesh, offset: DVec2| {
        let z = field.height_in_cell_um(cell, offset);
        push(mesh, (site + offset).extend(z), field.normal_in_cell(cell, offset, z))
    };
    let center = vertex(mesh, DVec2::ZERO);
    let spokes: Vec<Vec<u32>> = outline
        .iter()
        .map(|&p| {
            let end = rim(p) / f64::from(rings);
            (1..=rings).map(|i| vertex(mesh, p * (end * f64::from(i)))).collect()
        })
        .collect();
    let base: Vec<Option<[u32; 2]>> = outline
        .iter()
        .map(|&p| {
            let r = rim(p);
            (r < 1.0).then(|| {
                let at = |mesh: &mut Mesh, p: DVec2| push(mesh, (site + p).extend(0.0), DVec3::Z);
                [at(mesh, p * r), at(mesh, p)]
            })
        })
        .collect();
    let n = outline.len();
    for j in 0..n {
        let next = (j + 1) % n;
        let (a, b) = (&spokes[j], &spokes[next]);
        mesh.triangles.push([center, a[0], b[0]]);
        for i in 1..rings as usize {
            quad(mesh, [a[i - 1], a[i], b[i], b[i - 1]]);
        }
        // Where the rim meets the outline on one spoke only, the strip ends in a triangle.
        let last = rings as usize - 1;
        match (base[j], base[next]) {
            (Some([a0, a1]), Some([b0, b1])) => quad(mesh, [a0, a1, b1, b0]),
            (Some([a0, a1]), None) => mesh.triangles.push([a0, a1, b[last]]),
            (None, Some([b0, b1])) => mesh.triangles.push([a[last], b1, b0]),
            (None, None) => {}
        }
    }
    for (k, edge) in polygon.edges.iter().enumerate() {
        let normal = edge.delta_um.normalize_or_zero().extend(0.0);
        let points = sides_points[k].iter().copied().chain([sides_points[(k + 1) % sides][0]]);
        let steps: Vec<Step> = points.map(|p| step_at(field, cell, edge, p)).collect();
        for pair in steps.windows(2) {
            add_wall(mesh, site, pair[0], pair[1], normal);
        }
    }
}

/// The step at a point of a cell's side: offset from the centre, the cell's height and the neighbour's.
#[derive(Clone, Copy)]
struct Step {
    offset: DVec2,
    own: f64,
    other: f64,
}

fn step_at(field: &CellField, cell: u32, edge: &VoronoiEdge, offset: DVec2) -> Step {
    let own = field.height_in_cell_um(cell, offset);
    let other = field.height_in_cell_um(edge.neighbor, offset - edge.delta_um);
    Step { offset, own, other: if (own - other).abs() < SAME_UM { own } else { other } }
}

/// `rings` equal parts of side k from its first corner on, and in between the points where the wall changes
/// hands, so that each wall belongs to one cell from point to point.
fn side_points(field: &CellField, cell: u32, k: usize, rings: u32) -> Vec<DVec2> {
    let polygon = &field.lattice().cells[cell as usize];
    let (a, b) = (polygon.corners_um[k], polygon.corners_um[(k + 1) % polygon.edges.len()]);
    let at = |f: f64| a.lerp(b, f);
    let rise = |f: f64| {
        let step = step_at(field, cell, &polygon.edges[k], at(f));
        step.own - step.other
    };
    let mut points = Vec::with_capacity(rings as usize + 1);
    for j in 0..rings {
        let (mut low, mut high) = (f64::from(j) / f64::from(rings), f64::from(j + 1) / f64::from(rings));
        points.push(at(low));
        let start = rise(low);
        if start * rise(high) < 0.0 {
            for _ in 0..50 {
                let middle = 0.5 * (low + high);
                if rise(middle) * start > 0.0 { low = middle } else { high = middle }
            }
            points.push(at(high));
        }
    }
    points
}

/// The part of a wall that belongs to the higher cell, from one point of its side to the next.
fn add_wall(mesh: &mut Mesh, site: DVec2, a: Step, b: Step, normal: DVec3) {
    if a.own <= a.other && b.own <= b.other {
        return;
    }
    let corners = [(a, a.own), (a, a.other.min(a.own)), (b, b.other.min(b.own)), (b, b.own)];
    let corners = corners.map(|(step, z)| push(mesh, (site + step.offset).extend(z), normal));
    quad(mesh, corners);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::micro::{CellDescription, Profile};
    use std::collections::HashMap;

    fn fields(tilt_deg: f64) -> Vec<CellField> {
        let mut fields = Vec::new();
        for profile in Profile::ALL {
            for (center_disorder, height_disorder, tilt_disorder_deg) in
                [(0.0, 0.0, 0.0), (0.1, 0.2, 0.0), (0.1, 0.1, tilt_deg)]
            {
                let cells = CellDescription {
                    profile,
                    center_disorder,
                    height_disorder,
                    tilt_disorder_deg,
                    tile_cells: 4,
                    ..Default::default()
                };
                fields.push(CellField::new(&cells).expect("valid"));
            }
        }
        fields
    }

    #[test]
    fn covers_the_tile() {
        for field in fields(0.5) {
            let mesh = tile_mesh(&field, [2, 1], 5);
            mesh.validate("tile").expect("valid");
            let mut sum = DVec3::ZERO;
            for f in 0..mesh.triangles.len() {
                let [a, b, c] = mesh.corners(f).map(|p| p.as_dvec3());
                let area = 0.5 * (b - a).cross(c - a);
                // A height field faces up, its walls sideways; f32 corners bound how well.
                assert!(area.z >= -1e-4, "{area}");
                sum += area;
            }
            // Vector areas: what a wall lacks shows in x and y.
            let tile = 2.0 * field.tile_um().element_product();
            assert!((sum.z / tile - 1.0).abs() < 1e-5, "{sum} {tile}");
            assert!(sum.truncate().length() < 1e-5 * tile, "{sum} {:?}", field.description());
        }
    }

    #[test]
    fn corners_lie_on_the_surface() {
        for field in fields(0.5) {
            let mesh = tile_mesh(&field, [1, 1], 4);
            for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
                assert!((n.length() - 1.0).abs() < 1e-5 && n.z >= -1e-6);
                let p = p.as_dvec3();
                // On a side either cell's height will do, and a wall lies between them.
                let around: Vec<f64> = (0..8)
                    .map(|k| {
                        field
                            .height_at_um(p.truncate() + DVec2::from_angle(0.3 + 0.785 * f64::from(k)) * 5e-5)
                    })
                    .chain([field.height_at_um(p.truncate())])
                    .collect();
                let low = around.iter().copied().fold(f64::INFINITY, f64::min);
                let high = around.iter().copied().fold(0.0, f64::max);
                assert!(
                    p.z > low - 2e-3 && p.z < high + 2e-3,
                    "{p} {n} {low} {high} {:?}",
                    field.description()
                );
            }
        }
    }

    #[test]
    fn regular_sheets_have_no_gap() {
        for profile in Profile::ALL {
            let field = CellField::new(&CellDescription { profile, ..Default::default() }).expect("valid");
            let mesh = tile_mesh(&field, [1, 1], 6);
            // Glue by position; every edge then has two triangles, but for the outline of the sheet.
            let key = |i: u32| {
                let p = (mesh.positions[i as usize] * 1000.0).round();
                (p.x as i64, p.y as i64, p.z as i64)
            };
            let mut edges = HashMap::new();
            for t in &mesh.triangles {
                for k in 0..3 {
                    *edges.entry((key(t[k]), key(t[(k + 1) % 3]))).or_insert(0) += 1;
                }
            }
            assert!(edges.values().all(|&n| n == 1), "no edge twice in one sense");
            let open = edges.keys().filter(|(a, b)| !edges.contains_key(&(*b, *a))).count();
            // Two hexagons that share one side have 10 outer sides of 6 parts.
            assert_eq!(open, 60, "{profile:?}");
        }
    }

    #[test]
    fn outlines_are_the_polygons() {
        let field = CellField::new(&CellDescription::default()).expect("valid");
        let outlines = voronoi_outlines(&field, [3, 2]);
        assert_eq!(outlines.len(), 12);
        assert!(outlines.iter().all(|o| o.len() == 6));
    }
}

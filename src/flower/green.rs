//! Everything of the flower but its petals: heart, sepals, receptacle, stem, prickles and leaves.
//!
//! They grow after the petals and take the room that these leave ([`crate::flower::room`]). Guarded by
//! `green_parts_do_not_cross`.

use crate::flower::leaf::Growth;
use crate::flower::room::Room;
use crate::flower::stamens::StamenRoom;
use crate::flower::{Flower, Organ, OrganKind, RoseDescription};
use crate::geometry::Mesh;

/// Part of the receptacle's radius that the disc of the stamens takes at most.
const DISC: f64 = 0.62;

/// Grows all organs but the petals into a flower that has its petals.
pub(crate) fn grow(flower: &mut Flower, d: &RoseDescription, openness: f64) {
    let growth = Growth { seed: d.seed, irregularity: d.irregularity, detail: d.detail };
    let petals: Vec<&Mesh> = flower.of_kind(OrganKind::Petal).map(|o| &o.mesh).collect();
    let room = Room::new(petals.iter().copied());
    let claws = Room::near(petals.iter().copied(), 2.0 * d.stem.receptacle_radius_mm);
    let mut add = |kind, index, mesh: Mesh, uv_scale_mm| {
        if !mesh.triangles.is_empty() {
            flower.organs.push(Organ { kind, index, mesh, uv_scale_mm, traits: None });
        }
    };
    heart(d, &room, &growth, &mut add);
    // Rims that hang below the flower are no obstacle: sepals bend back under them.
    let outer = |z: f64| if z > 0.0 { room.outer_mm(z) } else { claws.outer_mm(z) };
    for index in 0..d.sepals.count {
        let (mesh, scale) = d.sepals.grow(index, openness, &d.stem, &outer, &growth);
        add(OrganKind::Sepal, index, mesh, scale);
    }
    let (receptacle, scale) = d.stem.receptacle(growth.around(32.0));
    add(OrganKind::Receptacle, 0, receptacle, scale);
    let nodes = d.leaves.nodes_mm(d.stem.length_mm);
    let axis = d.stem.axis(&nodes);
    let along = growth.around(24.0).max(16);
    let (stem, scale) = axis.mesh(growth.around(24.0), along);
    add(OrganKind::Stem, 0, stem, scale);
    let mut places = Vec::new();
    let mut leaflets = 0;
    for (index, &depth) in (0..).zip(&nodes) {
        let leaf = d.leaves.grow(index, depth, &axis, &growth);
        add(OrganKind::Stem, index + 1, leaf.stalk.0, leaf.stalk.1);
        for (mesh, scale) in leaf.leaflets {
            add(OrganKind::Leaf, leaflets, mesh, scale);
            leaflets += 1;
        }
        add(OrganKind::Leaf, leaflets, leaf.stipules, [5.0, 18.0]);
        leaflets += 1;
        places.push((depth, d.leaves.spiral(d.seed, d.irregularity).azimuth_deg(index)));
    }
    let (prickles, scale) = d.prickles.grow(&axis, &places, &growth);
    add(OrganKind::Prickle, 0, prickles, scale);
}

/// Stamens and styles on the dome of the receptacle.
fn heart(
    d: &RoseDescription,
    room: &Room,
    growth: &Growth,
    add: &mut impl FnMut(OrganKind, u32, Mesh, [f32; 2]),
) {
    let dome = d.stem.dome_mm();
    let disc = |r: f64| {
        // What stands on a slope stands on its upper side.
        let r = r - 1.2 * d.stamens.filament_radius_mm;
        let after = dome.iter().position(|p| p.0 <= r).unwrap_or(dome.len());
        if after == 0 {
            dome[0].1
        } else if after == dome.len() {
            dome[after - 1].1
        } else {
            let ((r0, z0), (r1, z1)) = (dome[after - 1], dome[after]);
            z0 + (z1 - z0) * (r - r0) / (r1 - r0)
        }
    };
    let widest = DISC * d.stem.receptacle_radius_mm;
    let rim_mm = widest.min(0.86 * room.inner_mm(disc(widest)));
    let inner = |z: f64| room.inner_mm(z);
    let place = StamenRoom { disc_mm: &disc, rim_mm, inner_radius_mm: &inner };
    let heart = d.stamens.grow(&place, growth);
    let scale = |length: f64| [(std::f64::consts::TAU * d.stamens.filament_radius_mm) as f32, length as f32];
    add(OrganKind::Filament, 0, heart.filaments, scale(d.stamens.filament_mm));
    let anther = d.stamens.anther_mm as f32;
    add(OrganKind::Anther, 0, heart.anthers, [1.1 * anther, anther]);
    add(OrganKind::Style, 0, heart.styles, scale(d.stamens.style_mm));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flower::crossings::crossings;
    use crate::flower::grow;

    #[test]
    fn green_parts_do_not_cross() {
        // `tests/flowers.rs` has 20 seeds and six stages.
        for name in RoseDescription::PRESETS {
            for (seed, detail) in [(0, 1.0), (1, 0.5)] {
                let d = RoseDescription { seed, detail, ..name.parse().expect("a preset") };
                let report = crossings(&grow(&d).expect("grows"));
                for o in &report.organs {
                    // How petals cross each other is counted beside them.
                    let petals = o.organs.iter().all(|(kind, _)| *kind == OrganKind::Petal);
                    assert!(petals, "{name} seed {seed}:\n{report}");
                }
            }
        }
    }

    #[test]
    fn wild_roses_show_stamens_and_closed_ones_none() {
        let count = |name: &str, kind| {
            let d: RoseDescription = name.parse().expect("a preset");
            grow(&d).expect("grows").of_kind(kind).map(|o| o.mesh.triangles.len()).sum::<usize>()
        };
        for kind in [OrganKind::Filament, OrganKind::Anther, OrganKind::Style] {
            assert!(count("wild", kind) > 500, "{kind:?}");
        }
        assert!(count("hybrid_tea", OrganKind::Prickle) > 500);
        assert!(count("hybrid_tea", OrganKind::Anther) < count("wild", OrganKind::Anther) / 4);
    }
}

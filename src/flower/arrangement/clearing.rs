//! Takes off the leaves of an arrangement that run into a neighbour, as a gardener does.
//!
//! A leaflet goes if it meets a petal, sepal, stem or prickle of another rose; of two leaflets that meet, the one of the later rose
//! goes. A leaf whose stalk meets anything goes whole. Leaves are counted on the meshes that are returned.

use std::collections::BTreeSet;

use crate::flower::{Flower, Organ, OrganKind};
use crate::geometry::Mesh;
use crate::geometry::crossings::crossings;

/// An organ by its rose and its place among that rose's organs.
type Name = (usize, usize);

/// Takes the leaves off.
pub(super) fn clear(flowers: &mut [Flower]) {
    let near = near_leaves(flowers);
    let meshes: Vec<&Mesh> = near.iter().map(|&(rose, organ)| &flowers[rose].organs[organ].mesh).collect();
    let mut met: Vec<[Name; 2]> = crossings(&meshes)
        .iter()
        .map(|c| c.meshes.map(|m| near[m as usize]))
        .filter(|[a, b]| a.0 != b.0)
        .map(|[a, b]| if a < b { [a, b] } else { [b, a] })
        .collect();
    met.sort_unstable();
    met.dedup();
    let organ = |(rose, organ): Name| &flowers[rose].organs[organ];
    let mut gone: BTreeSet<Name> = BTreeSet::new();
    // First what meets the parts that stay: it makes room for other leaves.
    for both in [false, true] {
        for &[a, b] in &met {
            let leafy = [is_of_leaf(organ(a)), is_of_leaf(organ(b))];
            if gone.contains(&a) || gone.contains(&b) || (leafy == [true, true]) != both {
                continue;
            }
            match leafy {
                [_, true] => take(flowers, b, &mut gone),
                [true, false] => take(flowers, a, &mut gone),
                [false, false] => {}
            }
        }
    }
    for (rose, flower) in flowers.iter_mut().enumerate() {
        let mut k = 0;
        flower.organs.retain(|_| {
            k += 1;
            !gone.contains(&(rose, k - 1))
        });
    }
}

/// Takes off a leaflet, or a stalk with all that it carries: what follows it up to the next organ of another kind.
fn take(flowers: &[Flower], name: Name, gone: &mut BTreeSet<Name>) {
    gone.insert(name);
    let organs = &flowers[name.0].organs;
    if organs[name.1].kind == OrganKind::Stem {
        let carried = organs[name.1 + 1..].iter().take_while(|o| o.kind == OrganKind::Leaf).count();
        gone.extend((1..=carried).map(|k| (name.0, name.1 + k)));
    }
}

/// A leaflet, stipules, or the stalk of a leaf.
fn is_of_leaf(organ: &Organ) -> bool {
    organ.kind == OrganKind::Leaf || (organ.kind == OrganKind::Stem && organ.index > 0)
}

/// Leaves whose boxes meet those of organs of other roses, and these.
fn near_leaves(flowers: &[Flower]) -> Vec<Name> {
    let mut boxes: Vec<(Name, bool, glam::Vec3, glam::Vec3)> = Vec::new();
    for (rose, flower) in flowers.iter().enumerate() {
        for (k, organ) in flower.organs.iter().enumerate() {
            let (low, high) = organ.mesh.bounds();
            boxes.push(((rose, k), is_of_leaf(organ), low, high));
        }
    }
    let mut near = vec![false; boxes.len()];
    for i in 0..boxes.len() {
        for j in i + 1..boxes.len() {
            let ((a, b), leafy) = ((&boxes[i], &boxes[j]), boxes[i].1 || boxes[j].1);
            if leafy && a.0.0 != b.0.0 && a.2.cmple(b.3).all() && b.2.cmple(a.3).all() {
                near[i] = true;
                near[j] = true;
            }
        }
    }
    boxes.iter().zip(near).filter(|(_, near)| *near).map(|(b, _)| b.0).collect()
}

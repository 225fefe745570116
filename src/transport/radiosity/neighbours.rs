//! The nearest elements of the same piece of surface.
//!
//! Model: of the elements of a connected piece, the `COUNT` nearest by the distance of their centres that lie beside and not
//! above each other: their normals differ by less than 60 degrees, and the way to them rises by less than 30 degrees from
//! the surface. Sheets that merely touch are different pieces, so no light is smoothed from one to the other; a sheet that is
//! rolled onto itself is told apart by the rise. Guarded by `neighbours_are_the_nearest`. Source: our reading.

use glam::Vec3;
use rayon::prelude::*;

use super::elements::Elements;

/// Neighbours of an element.
pub(super) const COUNT: usize = 8;
/// Candidates that are looked at for each.
const CANDIDATES: usize = 24;

/// Up to `COUNT` neighbours per element, nearest first.
pub(super) fn neighbours(elements: &Elements) -> Vec<Vec<u32>> {
    let list = elements.list();
    let mut by_piece: Vec<u32> = (0..list.len() as u32).collect();
    by_piece.sort_by_key(|e| (list[*e as usize].piece, *e));
    let mut trees: Vec<&mut [u32]> = Vec::new();
    let mut rest = &mut by_piece[..];
    while let Some(first) = rest.first() {
        let piece = list[*first as usize].piece;
        let end = rest.partition_point(|e| list[*e as usize].piece <= piece);
        let (tree, tail) = rest.split_at_mut(end);
        trees.push(tree);
        rest = tail;
    }
    let place = |e: u32| list[e as usize].centre;
    let found: Vec<Vec<(u32, Vec<u32>)>> = trees
        .into_par_iter()
        .map(|tree| {
            build(tree, &place);
            let tree = &*tree;
            tree.par_iter()
                .map(|&e| {
                    let mut nearest = Nearest { at: place(e), found: Vec::with_capacity(CANDIDATES + 1) };
                    nearest.search(tree, &place);
                    let own = &list[e as usize];
                    let beside = nearest
                        .found
                        .iter()
                        .map(|f| f.1)
                        .filter(|o| {
                            let other = &list[*o as usize];
                            let way = other.centre - own.centre;
                            *o != e
                                && own.normal.dot(other.normal) > 0.5
                                && own.normal.dot(way).abs() < 0.5 * way.length()
                        })
                        .take(COUNT)
                        .collect();
                    (e, beside)
                })
                .collect()
        })
        .collect();
    let mut out = vec![Vec::new(); list.len()];
    for (e, beside) in found.into_iter().flatten() {
        out[e as usize] = beside;
    }
    out
}

/// Axis of a level of the tree: the longest extent of its points.
fn axis(tree: &[u32], place: &impl Fn(u32) -> Vec3) -> usize {
    let none = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (low, high) = tree.iter().fold(none, |(l, h), e| (l.min(place(*e)), h.max(place(*e))));
    (high - low).max_position()
}

/// Sorts points into a balanced k-d tree: the middle one divides those before it from those after it.
fn build(tree: &mut [u32], place: &impl Fn(u32) -> Vec3) {
    if tree.len() < 2 {
        return;
    }
    let axis = axis(tree, place);
    let middle = tree.len() / 2;
    tree.select_nth_unstable_by(middle, |a, b| place(*a)[axis].total_cmp(&place(*b)[axis]).then(a.cmp(b)));
    let (low, high) = tree.split_at_mut(middle);
    build(low, place);
    build(&mut high[1..], place);
}

struct Nearest {
    at: Vec3,
    /// Squared distance and element, nearest first.
    found: Vec<(f32, u32)>,
}

impl Nearest {
    fn search(&mut self, tree: &[u32], place: &impl Fn(u32) -> Vec3) {
        let Some(&e) = tree.get(tree.len() / 2) else { return };
        let d2 = place(e).distance_squared(self.at);
        let before = |f: &(f32, u32)| (f.0, f.1) < (d2, e);
        let i = self.found.partition_point(before);
        if i < CANDIDATES {
            self.found.insert(i, (d2, e));
            self.found.truncate(CANDIDATES);
        }
        if tree.len() == 1 {
            return;
        }
        let axis = axis(tree, place);
        let (low, high) = tree.split_at(tree.len() / 2);
        let high = &high[1..];
        let offset = self.at[axis] - place(e)[axis];
        let (near, far) = if offset < 0.0 { (low, high) } else { (high, low) };
        self.search(near, place);
        let reach = self.found.last().map_or(f32::INFINITY, |f| f.0);
        if self.found.len() < CANDIDATES || offset * offset < reach {
            self.search(far, place);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::facets::Facets;
    use super::super::testing::scene;
    use super::*;

    #[test]
    fn neighbours_are_the_nearest() {
        let s = scene(
            "[shapes.ball]\ntype = \"sphere\"\nradius_mm = 3\nsubdivisions = 4\nmaterial = \"grey\"\n\
             [shapes.floor]\ntype = \"quad\"\nwidth_mm = 9\nheight_mm = 9\nposition_mm = [0, 0, -3]\nmaterial = \"grey\"\n",
        );
        let elements = Elements::new(&s, Facets::new(&s, 600), 600);
        let list = elements.list();
        let found = neighbours(&elements);
        for (i, beside) in found.iter().enumerate() {
            let own = &list[i];
            assert!(beside.len() >= 3, "{i}: {beside:?}");
            let far =
                beside.iter().map(|o| list[*o as usize].centre.distance(own.centre)).fold(0.0, f32::max);
            for (j, other) in list.iter().enumerate() {
                let way = other.centre - own.centre;
                let beside_it = own.normal.dot(other.normal) > 0.5
                    && own.normal.dot(way).abs() < 0.5 * way.length()
                    && other.piece == own.piece;
                if beside.contains(&(j as u32)) {
                    assert!(beside_it && j != i);
                } else if beside_it && j != i && beside.len() == COUNT {
                    assert!(way.length() >= far * (1.0 - 1e-5), "{i} {j}");
                }
            }
        }
    }
}

//! A binary hierarchy made wide, and rays through it: eight boxes at a time.
//!
//! Model: a node takes up to eight descendants of a binary node, found by opening the one with the largest surface again and again; a
//! subtree of at most eight triangles is a leaf, tested as one packet. A ray meets a box between the distances
//!
//! ```text
//! near = max over axes of (entry - o) / d,    far = min over axes of (exit - o) / d,    near <= far
//! ```
//!
//! and goes into the nearest first. A ray along a wall of a box (0 / 0) is not stopped by that wall. Same hits at any width of the machine's
//! registers: every lane is computed by itself.
//!
//! Memory: 224 bytes per node, 288 and the triangles' numbers per packet; about 70 bytes per triangle.
//! Guarded by `agrees_with_brute_force`, `closed_mesh_has_no_leaks`, `deep_trees_are_walked_to_the_end`. Source: Wald, Benthin, Boulos 2008, Getting rid of packets;
//! Dammertz, Hanika, Keller 2008, Shallow bounding volume hierarchies.

use glam::Vec3A;
use obvhs::bvh2::Bvh2;

use super::ray::Ray;
use super::triangle::{Packet, ShearedRay, TriangleHit, WIDTH};
use crate::math::widest;

/// Marks children that are packets.
const LEAF: u32 = 1 << 31;
/// Nodes that are left for later, at most, without allocation.
const STACK: usize = 96;

/// Boxes side by side.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
struct Node {
    /// `[axis][low, high][child]`; turned inside out where there is no child, so that no ray meets it.
    bounds: [[[f32; WIDTH]; 2]; 3],
    /// Node, or packet with [`LEAF`].
    children: [u32; WIDTH],
}

const EMPTY: Node =
    Node { bounds: [[[f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]]; 3], children: [u32::MAX; WIDTH] };

/// A node that a ray may go into, and from where on.
#[derive(Clone, Copy, Debug)]
struct Entry {
    child: u32,
    near: f32,
}

/// Wide nodes over packets of triangles.
#[derive(Debug, Default)]
pub(super) struct WideTree {
    nodes: Vec<Node>,
    packets: Vec<Packet>,
    /// First of the triangles of each packet, in [`WideTree::order`].
    first: Vec<u32>,
    /// Most nodes that are left for later at a time.
    deepest: usize,
}

impl WideTree {
    /// From a binary tree over triangles; also gives the order in which the tree numbers them.
    pub(super) fn new(tree: &Bvh2, corners: impl Fn(u32) -> [Vec3A; 3]) -> (Self, Vec<u32>) {
        let mut out = Self::default();
        let mut order = Vec::with_capacity(tree.primitive_indices.len());
        if tree.primitive_indices.is_empty() {
            return (out, order);
        }
        let counts = counts(tree);
        // Binary node, the wide node that it becomes, and how many are above it.
        let mut open = vec![(0, 0, 1)];
        out.nodes.push(EMPTY);
        while let Some((binary, wide, depth)) = open.pop() {
            out.deepest = out.deepest.max(depth * (WIDTH - 1) + 1);
            for (lane, child) in descendants(tree, &counts, binary).into_iter().enumerate() {
                let aabb = tree.nodes[child].aabb();
                for axis in 0..3 {
                    out.nodes[wide].bounds[axis][0][lane] = aabb.min[axis];
                    out.nodes[wide].bounds[axis][1][lane] = aabb.max[axis];
                }
                out.nodes[wide].children[lane] = if counts[child] as usize <= WIDTH {
                    let first = order.len();
                    leaves(tree, child, &mut order);
                    out.packets.push(Packet::new(order[first..].iter().map(|i| corners(*i))));
                    out.first.push(first as u32);
                    (out.packets.len() - 1) as u32 | LEAF
                } else {
                    out.nodes.push(EMPTY);
                    open.push((child, out.nodes.len() - 1, depth + 1));
                    (out.nodes.len() - 1) as u32
                };
            }
        }
        (out, order)
    }

    /// Nearest hit with `0 < t < ray.t_max`, and the number of its triangle.
    pub(super) fn nearest(&self, ray: &Ray) -> Option<(usize, TriangleHit)> {
        self.walk::<false>(ray)
    }

    /// Is there a hit with `0 < t < ray.t_max`?
    pub(super) fn any(&self, ray: &Ray) -> bool {
        self.walk::<true>(ray).is_some()
    }

    fn walk<const ANY: bool>(&self, ray: &Ray) -> Option<(usize, TriangleHit)> {
        if self.nodes.is_empty() {
            return None;
        }
        const NONE: Entry = Entry { child: 0, near: 0.0 };
        if self.deepest <= STACK {
            widest(
                #[inline(always)]
                || self.walk_with::<ANY>(ray, &mut [NONE; STACK]),
            )
        } else {
            self.walk_with::<ANY>(ray, &mut vec![NONE; self.deepest])
        }
    }

    #[inline(always)]
    fn walk_with<const ANY: bool>(&self, ray: &Ray, stack: &mut [Entry]) -> Option<(usize, TriangleHit)> {
        let sheared = ShearedRay::new(ray);
        let origin = ray.origin.to_array();
        let inverse = ray.direction.to_array().map(|d| 1.0 / d);
        let backwards = inverse.map(|i| usize::from(i.is_sign_negative()));
        let mut t_max = ray.t_max;
        let mut found = None;
        let mut left = 1;
        stack[0] = Entry { child: 0, near: 0.0 };
        while left > 0 {
            left -= 1;
            let Entry { child, near } = stack[left];
            if near > t_max {
                continue;
            }
            if child & LEAF != 0 {
                let packet = (child & !LEAF) as usize;
                if let Some((lane, hit)) = sheared.intersect_packet(&self.packets[packet], t_max) {
                    t_max = hit.t;
                    found = Some((self.first[packet] as usize + lane, hit));
                    if ANY {
                        return found;
                    }
                }
                continue;
            }
            let node = &self.nodes[child as usize];
            let mut near = [0.0f32; WIDTH];
            let mut far = [t_max; WIDTH];
            for axis in 0..3 {
                let (o, inverse) = (origin[axis], inverse[axis]);
                let entry = &node.bounds[axis][backwards[axis]];
                let exit = &node.bounds[axis][1 - backwards[axis]];
                for lane in 0..WIDTH {
                    let (t0, t1) = ((entry[lane] - o) * inverse, (exit[lane] - o) * inverse);
                    // What is not a number changes nothing.
                    near[lane] = if t0 > near[lane] { t0 } else { near[lane] };
                    far[lane] = if t1 < far[lane] { t1 } else { far[lane] };
                }
            }
            let mut hits = 0u32;
            for lane in 0..WIDTH {
                hits |= u32::from(near[lane] <= far[lane]) << lane;
            }
            let base = left;
            while hits != 0 {
                let lane = hits.trailing_zeros() as usize;
                hits &= hits - 1;
                let entry = Entry { child: node.children[lane], near: near[lane] };
                let mut at = left;
                // The nearest on top.
                while at > base && stack[at - 1].near < entry.near {
                    stack[at] = stack[at - 1];
                    at -= 1;
                }
                stack[at] = entry;
                left += 1;
            }
        }
        found
    }
}

/// Triangles below every binary node.
fn counts(tree: &Bvh2) -> Vec<u32> {
    let mut order = Vec::with_capacity(tree.nodes.len());
    let mut open = vec![0];
    while let Some(n) = open.pop() {
        order.push(n);
        let node = &tree.nodes[n];
        if !node.is_leaf() {
            open.extend([node.first_index as usize, node.first_index as usize + 1]);
        }
    }
    let mut counts = vec![0; tree.nodes.len()];
    for n in order.into_iter().rev() {
        let node = &tree.nodes[n];
        let first = node.first_index as usize;
        counts[n] = if node.is_leaf() { node.prim_count } else { counts[first] + counts[first + 1] };
    }
    counts
}

/// Up to eight descendants that stand for a binary node: itself where it fits into a packet.
fn descendants(tree: &Bvh2, counts: &[u32], node: usize) -> Vec<usize> {
    let mut out = vec![node];
    while out.len() < WIDTH {
        let opens = |n: usize| counts[n] as usize > WIDTH && !tree.nodes[n].is_leaf();
        let largest = (0..out.len()).filter(|i| opens(out[*i])).max_by(|a, b| {
            let area = |i: usize| tree.nodes[out[i]].aabb().half_area();
            area(*a).total_cmp(&area(*b))
        });
        let Some(largest) = largest else { break };
        let first = tree.nodes[out[largest]].first_index as usize;
        out[largest] = first;
        out.push(first + 1);
    }
    out
}

/// The triangles below a binary node.
fn leaves(tree: &Bvh2, node: usize, out: &mut Vec<u32>) {
    let mut open = vec![node];
    while let Some(n) = open.pop() {
        let node = &tree.nodes[n];
        let first = node.first_index as usize;
        if node.is_leaf() {
            out.extend_from_slice(&tree.primitive_indices[first..first + node.prim_count as usize]);
        } else {
            open.extend([first + 1, first]);
        }
    }
}

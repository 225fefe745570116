//! Tensor trees: a BSDF as constants on boxes of the unit cube, finer where it varies.
//!
//! Model: f(wi, wo) = value of the box around the point u(wi, wo). A direction's projection (x, y) onto the disk goes to the
//! unit square by Shirley and Chiu's map q, which keeps areas, so equal squares are equal projected solid angles.
//!
//! - rank 4 (any BSDF): u = (q(-wi), q(wo)); minus wi is the direction in which light travels
//! - rank 3 (isotropic): u = ((1 - sin theta_i) / 2, q(wo turned so that light travels along +x)); the half u0 >= 1/2 is
//!   unused, the mirror's direction has u1 > 1/2
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | rank | [`TensorTree::rank`] | - |
//! | boxes | [`Node`] | 1/sr |
//!
//! Text: `{v}` is one box; `{v v ...}` with 2^(rank k) numbers is a grid, u0 slowest; `{{..}{..}...}` are the 2^rank halves of
//! a box, bit i of the child's number is the upper half of u_i, so there u0 is **fastest**.
//!
//! Limits: at most [`MAX_DEPTH`] halvings (`wrong_trees_are_errors`). The map and its inverse agree and keep areas
//! (`the_map_keeps_areas`). Guarded by `trees_survive_their_text`. Source: Radiance's `bsdf_t.c`; the map is that of
//! Shirley and Chiu 1997.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
use std::fmt::Write as _;

use glam::DVec3;

/// Most halvings of an axis: squares of 1/65536, as fine as the format's own reader goes.
pub const MAX_DEPTH: u32 = 16;

/// Boxes in a box.
#[derive(Clone, Debug, PartialEq)]
pub enum Node {
    /// 2^`log2` equal boxes along each axis, u0 slowest; with `log2` = 0 one value.
    Grid {
        /// Halvings.
        log2: u32,
        /// 1/sr.
        values_per_sr: Vec<f32>,
    },
    /// The 2^rank halves, u0 fastest.
    Branch(Vec<Node>),
}

/// One part of a BSDF at one band.
#[derive(Clone, Debug, PartialEq)]
pub struct TensorTree {
    /// 3 or 4.
    pub rank: usize,
    /// The unit cube.
    pub root: Node,
}

/// From the unit disk to the unit square.
pub fn square_from_disk(x: f64, y: f64) -> [f64; 2] {
    let r = x.hypot(y).min(1.0);
    let phi = y.atan2(x);
    // The four triangles of the square, from the one around +x counter-clockwise.
    let (a, b) = if phi.abs() <= FRAC_PI_4 {
        (r, phi * r / FRAC_PI_4)
    } else if phi.abs() >= 3.0 * FRAC_PI_4 {
        (-r, (if phi > 0.0 { PI } else { -PI } - phi) * r / FRAC_PI_4)
    } else if phi > 0.0 {
        ((FRAC_PI_2 - phi) * r / FRAC_PI_4, r)
    } else {
        ((phi + FRAC_PI_2) * r / FRAC_PI_4, -r)
    };
    [0.5 * (a + 1.0), 0.5 * (b + 1.0)]
}

/// From the unit square to the unit disk.
pub fn disk_from_square([u, v]: [f64; 2]) -> (f64, f64) {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let (r, phi) = if a == 0.0 && b == 0.0 {
        (0.0, 0.0)
    } else if a.abs() >= b.abs() {
        (a, FRAC_PI_4 * b / a)
    } else {
        (b, FRAC_PI_2 - FRAC_PI_4 * a / b)
    };
    (r * phi.cos(), r * phi.sin())
}

impl TensorTree {
    /// The value for two directions of the right sides.
    pub fn at(&self, wi: DVec3, wo: DVec3) -> f64 {
        let sin = wi.x.hypot(wi.y);
        let mut position = [0.0; 4];
        if self.rank == 3 {
            let (c, s) = if sin > 1e-9 { (-wi.x / sin, -wi.y / sin) } else { (1.0, 0.0) };
            position[0] = 0.5 - 0.5 * sin.clamp(1e-6, 1.0);
            position[1..3].copy_from_slice(&square_from_disk(c * wo.x + s * wo.y, c * wo.y - s * wo.x));
        } else {
            position[..2].copy_from_slice(&square_from_disk(-wi.x, -wi.y));
            position[2..].copy_from_slice(&square_from_disk(wo.x, wo.y));
        }
        let mut node = &self.root;
        loop {
            match node {
                Node::Branch(children) => {
                    let mut child = 0;
                    for (i, p) in position[..self.rank].iter_mut().enumerate() {
                        *p *= 2.0;
                        if *p >= 1.0 {
                            child |= 1 << i;
                            *p -= 1.0;
                        }
                    }
                    let Some(next) = children.get(child) else { return 0.0 };
                    node = next;
                }
                Node::Grid { log2, values_per_sr } => {
                    let n = 1usize << log2;
                    let index = position[..self.rank]
                        .iter()
                        .fold(0, |index, p| index * n + ((p * n as f64).max(0.0) as usize).min(n - 1));
                    return values_per_sr.get(index).copied().map_or(0.0, f64::from);
                }
            }
        }
    }

    /// The tree of values on a grid of 2^`log2` boxes per axis, u0 slowest (rank 3: of the used half u0 < 1/2, so half as
    /// many along u0); boxes are joined into their mean where all of them agree within `tolerance` of it.
    pub fn from_grid(rank: usize, log2: u32, values_per_sr: &[f32], tolerance: f64) -> Self {
        let grid = FullGrid { rank, n: 1 << log2, values_per_sr, tolerance };
        Self { rank, root: grid.join([0; 4], 1 << log2).0 }
    }

    /// Numbers in the tree.
    pub fn len(&self) -> usize {
        fn count(node: &Node) -> usize {
            match node {
                Node::Grid { values_per_sr, .. } => values_per_sr.len(),
                Node::Branch(children) => children.iter().map(count).sum(),
            }
        }
        count(&self.root)
    }

    /// Never true for a tree that was read or built.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The text of `ScatteringData`.
    pub fn text(&self) -> String {
        fn write(node: &Node, out: &mut String) {
            out.push('{');
            match node {
                Node::Grid { values_per_sr, .. } => {
                    for (i, v) in values_per_sr.iter().enumerate() {
                        // Writing to a String cannot fail.
                        let _ = write!(out, "{}{v:e}", if i == 0 { "" } else { " " });
                    }
                }
                Node::Branch(children) => {
                    for child in children {
                        out.push('\n');
                        write(child, out);
                    }
                }
            }
            out.push('}');
        }
        let mut out = String::new();
        write(&self.root, &mut out);
        out
    }

    /// Reads the text of `ScatteringData`; an error has the offset of the mistake in the text.
    pub fn parse(rank: usize, text: &str) -> Result<Self, (usize, String)> {
        let mut parser = Parser { rank, text, at: 0 };
        let root = parser.node(0)?;
        parser.skip();
        match parser.rest().chars().next() {
            Some(_) => parser.fail("text after the tree"),
            None => Ok(Self { rank, root }),
        }
    }
}

/// What [`TensorTree::from_grid`] joins.
struct FullGrid<'a> {
    rank: usize,
    n: usize,
    values_per_sr: &'a [f32],
    tolerance: f64,
}

impl FullGrid<'_> {
    /// The box of `size` at `low`: node, least, largest and mean value; mean `None` in the unused half.
    fn join(&self, low: [usize; 4], size: usize) -> (Node, f32, f32, Option<f64>) {
        let leaf = |v: f32| Node::Grid { log2: 0, values_per_sr: vec![v] };
        if self.rank == 3 && low[0] >= self.n / 2 {
            return (leaf(0.0), 0.0, 0.0, None);
        }
        if size == 1 {
            let index = low[..self.rank].iter().fold(0, |index, &i| index * self.n + i);
            let v = self.values_per_sr.get(index).copied().unwrap_or(0.0);
            return (leaf(v), v, v, Some(f64::from(v)));
        }
        let half = size / 2;
        let children: Vec<_> = (0..1usize << self.rank)
            .map(|child| {
                let corner = std::array::from_fn(|i| low[i] + half * (child >> i & 1));
                self.join(corner, half)
            })
            .collect();
        let used = || children.iter().filter_map(|c| Some((c.1, c.2, c.3?)));
        let min = used().fold(f32::INFINITY, |m, c| m.min(c.0));
        let max = used().fold(0.0f32, |m, c| m.max(c.1));
        let mean = used().map(|c| c.2).sum::<f64>() / used().count().max(1) as f64;
        let node = if f64::from(max - min) <= self.tolerance * mean {
            leaf(mean as f32)
        } else if children.iter().all(|c| matches!(c.0, Node::Grid { log2: 0, .. })) {
            // The same values as a grid, where u0 is slowest: the child's bits reversed.
            let value = |k: usize| {
                let child = (0..self.rank).fold(0, |c, i| c | (k >> i & 1) << (self.rank - 1 - i));
                match &children[child].0 {
                    Node::Grid { values_per_sr, .. } => values_per_sr[0],
                    Node::Branch(_) => 0.0,
                }
            };
            Node::Grid { log2: 1, values_per_sr: (0..1 << self.rank).map(value).collect() }
        } else {
            Node::Branch(children.into_iter().map(|c| c.0).collect())
        };
        (node, min, max, Some(mean))
    }
}

/// Where reading stands.
struct Parser<'a> {
    rank: usize,
    text: &'a str,
    at: usize,
}

impl<'a> Parser<'a> {
    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    fn fail<T>(&self, what: impl Into<String>) -> Result<T, (usize, String)> {
        Err((self.at, what.into()))
    }

    /// Past white space and commas.
    fn skip(&mut self) {
        let rest = self.rest();
        self.at += rest.len() - rest.trim_start_matches(|c: char| c.is_ascii_whitespace() || c == ',').len();
    }

    fn eat(&mut self, c: char) -> bool {
        self.skip();
        let found = self.rest().starts_with(c);
        self.at += usize::from(found);
        found
    }

    fn node(&mut self, depth: u32) -> Result<Node, (usize, String)> {
        if !self.eat('{') {
            return self.fail("expected `{`");
        }
        self.skip();
        let node = if self.rest().starts_with('{') {
            if depth >= MAX_DEPTH {
                return self.fail(format!("more than {MAX_DEPTH} halvings"));
            }
            let children = (0..1 << self.rank).map(|_| self.node(depth + 1)).collect::<Result<_, _>>()?;
            Node::Branch(children)
        } else {
            self.grid(depth)?
        };
        if !self.eat('}') {
            return self.fail("expected `}`");
        }
        Ok(node)
    }

    fn grid(&mut self, depth: u32) -> Result<Node, (usize, String)> {
        let mut values_per_sr = Vec::new();
        loop {
            self.skip();
            let rest = self.rest();
            let end = rest.find(|c: char| c.is_ascii_whitespace() || ",{}".contains(c)).unwrap_or(rest.len());
            if end == 0 {
                break;
            }
            match super::window_xml::value_per_sr(&rest[..end]) {
                Ok(v) => values_per_sr.push(v),
                Err(what) => return self.fail(what),
            }
            self.at += end;
        }
        let log2 = values_per_sr.len().checked_ilog2().unwrap_or(0) / self.rank as u32;
        if values_per_sr.len() != 1 << (log2 * self.rank as u32) || log2 + depth > MAX_DEPTH {
            return self.fail(format!("{} numbers in a grid of rank {}", values_per_sr.len(), self.rank));
        }
        Ok(Node::Grid { log2, values_per_sr })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::measurement::direction_deg;

    #[test]
    fn the_map_keeps_areas() {
        let (mut sum, mut sum_x2, n) = (0.0, 0.0, 200);
        for i in 0..n {
            for j in 0..n {
                let square = [(f64::from(i) + 0.5) / f64::from(n), (f64::from(j) + 0.5) / f64::from(n)];
                let (x, y) = disk_from_square(square);
                let back = square_from_disk(x, y);
                assert!((back[0] - square[0]).hypot(back[1] - square[1]) < 1e-12, "{square:?} {back:?}");
                sum += x.hypot(y);
                sum_x2 += x * x;
            }
        }
        // Means over the disk: r 2/3, x^2 1/4.
        let count = f64::from(n * n);
        assert!((sum / count - 2.0 / 3.0).abs() < 1e-4 && (sum_x2 / count - 0.25).abs() < 1e-4);
        let close = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-12;
        assert!(
            close(square_from_disk(1.0, 0.0), [1.0, 0.5]) && close(square_from_disk(0.0, -1.0), [0.5, 0.0])
        );
        assert!(
            close(square_from_disk(-0.5, 0.0), [0.25, 0.5]) && close(square_from_disk(0.0, 0.0), [0.5, 0.5])
        );
    }

    #[test]
    fn grids_and_branches_have_opposite_orders() {
        // The same eight boxes as a grid (u0 slowest) and as a branch (u0 fastest).
        let grid = TensorTree::parse(3, "{0 1 2 3 4 5 6 7}").unwrap();
        let branch = TensorTree::parse(3, "{{0}{4},{2}{6}\n{1}{5}{3}{7}}").unwrap();
        let wi = direction_deg(50.0, 70.0);
        for phi in [0.0, 100.0, 190.0, 280.0] {
            let wo = direction_deg(40.0, phi);
            assert_eq!(grid.at(wi, wo), branch.at(wi, wo), "{phi}");
        }
        // Light travels towards azimuth 250; the mirror's direction has u1 > 1/2, bit 1 of the used half.
        assert!(
            grid.at(wi, direction_deg(50.0, 255.0)) == 3.0,
            "{}",
            grid.at(wi, direction_deg(50.0, 255.0))
        );
        assert!(grid.at(wi, direction_deg(50.0, 245.0)) == 2.0);
        assert!(grid.at(wi, direction_deg(50.0, 75.0)) == 0.0);
    }

    #[test]
    fn trees_survive_their_text() {
        for rank in [3usize, 4] {
            let (log2, n) = (2u32, 4usize);
            let count = if rank == 3 { n * n * n / 2 } else { n.pow(4) };
            let values: Vec<f32> =
                (0..count).map(|i| if i / n % n < 2 { 0.25 } else { i as f32 * 0.1 }).collect();
            let tree = TensorTree::from_grid(rank, log2, &values, 0.01);
            assert!(tree.len() < count, "nothing was joined");
            assert_eq!(TensorTree::parse(rank, &tree.text()).unwrap(), tree);
            // Every box gives its own value, wherever it went.
            let full = TensorTree { rank: 4, root: Node::Grid { log2, values_per_sr: values.clone() } };
            for t in [5.0, 35.0, 60.0, 85.0] {
                for p in [10.0, 130.0, 200.0, 290.0] {
                    let (wi, wo) = (direction_deg(t, p), direction_deg(85.0 - 0.7 * t, 2.0 * p + 7.0));
                    if rank == 4 {
                        assert_eq!(tree.at(wi, wo), full.at(wi, wo));
                    } else {
                        assert!(values.iter().any(|v| f64::from(*v) == tree.at(wi, wo)));
                    }
                }
            }
        }
        let even = TensorTree::from_grid(3, 4, &[0.3; 8 * 16 * 16], 0.01);
        assert_eq!(even.text(), "{3e-1}");
    }

    #[test]
    fn wrong_trees_are_errors() {
        let deep = "{".repeat(1_000_000);
        for (text, why) in [
            ("", "expected `{`"),
            ("{}", "0 numbers"),
            ("{1 2}", "2 numbers"),
            ("{1", "expected `}`"),
            ("{{1}{2}}", "expected `{`"),
            ("{1}{2}", "text after"),
            ("{-1}", "negative"),
            ("{nan}", "number"),
            ("{1e99}", "number"),
            ("{x}", "number"),
            (deep.as_str(), "halvings"),
        ] {
            let (_, what) = TensorTree::parse(3, text).unwrap_err();
            assert!(what.contains(why), "{}: {what}", &text[..text.len().min(20)]);
        }
    }
}

//! Classes of like walks: which ways through the petal are absorbed alike.
//!
//! Model: walks back to the adaxial side, back to the abaxial side and through the petal are different in kind (a part of the
//! tables each); in each part, a k-d tree over the ways l_r through the regions. What a leaf would lose by standing for all its
//! walks with their mean way alone is, for one set of absorption coefficients,
//!
//! ```text
//! D(mu) = sum over its walks of exp(-mu . l)  -  n exp(-mu . mean l)  >= 0   (exp is convex)
//! ```
//!
//! Leaves are split one by one: for the part and the set of [`training`] coefficients whose sum of D over the part's leaves is
//! largest, the leaf with the largest D, in the region where exp(-mu_r l_r) varies most, at the way that has its mean. The
//! tree ends at the wanted number of leaves, or where the largest sum of D is below [`GOOD`] of all walks. A class also keeps
//! the variance of its ways (see `petal_optics`), so that its error is much smaller than D.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | mu_r d_r, d_r the region's depth | [`training`], [`checks`] | | 0.1 to 9: anthocyanin of 120 ug/cm2 at its peak has 8.7 |
//! | leaves | `classes` of the measurement | | at most 96 |
//!
//! Limits: at least one class per part, also without walks (`degenerate_walks_make_one_class`); the loss falls with the number of
//! classes (`more_classes_lose_less`). Source: our reading (a vector quantiser of least loss instead of least squares).

use super::petal_optics::PARTS;
use crate::micro::REGIONS;

/// Share of all walks that mean ways alone may lose at the worst coefficients before the tree stops growing.
const GOOD: f64 = 5e-4;

/// Ways of a walk through the regions, um.
pub(super) type Ways = [f64; REGIONS];

/// Tree of the classes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PathClasses {
    nodes: Vec<Node>,
    leaves: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Node {
    Leaf {
        class: usize,
    },
    /// Ways of at most `at_um` go to the first of two children that stand together.
    Split {
        region: usize,
        at_um: f64,
        children: usize,
    },
}

impl PathClasses {
    /// Divides the ways of pilot walks, one list per part, into at most `classes` classes.
    pub(super) fn new(ways: &[Vec<Ways>; PARTS], depth_um: &Ways, classes: usize) -> Self {
        let references = training(depth_um);
        let leaf = |node, part: usize, walks| Leaf::new((node, part), walks, &ways[part], &references);
        let mut nodes = vec![Node::Leaf { class: 0 }; PARTS];
        let mut leaves: Vec<Leaf> = (0..PARTS).map(|p| leaf(p, p, (0..ways[p].len()).collect())).collect();
        let enough = GOOD * ways.iter().map(Vec::len).sum::<usize>() as f64;
        while leaves.len() < classes {
            let loss = |part: usize, m: usize| {
                leaves.iter().filter(|l| l.part == part).map(|l| l.losses[m]).sum::<f64>()
            };
            let worst = (0..PARTS * references.len())
                .map(|i| (i % PARTS, i / PARTS))
                .map(|(part, m)| (part, m, loss(part, m)))
                .max_by(|a, b| a.2.total_cmp(&b.2));
            let Some((part, m, _)) = worst.filter(|w| w.2 > enough) else { break };
            let best = leaves
                .iter()
                .enumerate()
                .filter(|(_, leaf)| leaf.part == part)
                .filter_map(|(i, leaf)| Some((i, leaf.losses[m], leaf.split(&ways[part], &references[m])?)))
                .max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((i, _, (region, at_um))) = best else { break };
            let old = leaves.swap_remove(i);
            let children = nodes.len();
            nodes[old.node] = Node::Split { region, at_um, children };
            let (low, high): (Vec<usize>, Vec<usize>) =
                old.walks.into_iter().partition(|w| ways[part][*w][region] <= at_um);
            for (k, walks) in [low, high].into_iter().enumerate() {
                nodes.push(Node::Leaf { class: 0 });
                leaves.push(leaf(children + k, part, walks));
            }
        }
        let mut count = 0;
        for node in &mut nodes {
            if let Node::Leaf { class } = node {
                *class = count;
                count += 1;
            }
        }
        Self { nodes, leaves: count }
    }

    /// Number of classes.
    pub(super) fn len(&self) -> usize {
        self.leaves
    }

    /// Class of a way of a part.
    #[inline]
    pub(super) fn class(&self, part: usize, way: &Ways) -> usize {
        let mut at = part;
        loop {
            match self.nodes[at] {
                Node::Leaf { class } => return class,
                Node::Split { region, at_um, children } => {
                    at = children + usize::from(way[region] > at_um);
                }
            }
        }
    }
}

/// A leaf that may still be split.
struct Leaf {
    node: usize,
    part: usize,
    walks: Vec<usize>,
    /// D per set of coefficients.
    losses: Vec<f64>,
}

impl Leaf {
    fn new((node, part): (usize, usize), walks: Vec<usize>, ways: &[Ways], references: &[Ways]) -> Self {
        let n = walks.len() as f64;
        let mut mean = Ways::default();
        for w in &walks {
            (0..REGIONS).for_each(|r| mean[r] += ways[*w][r] / n);
        }
        let losses = references
            .iter()
            .map(|mu| {
                let each: f64 = walks.iter().map(|w| remaining(mu, &ways[*w])).sum();
                if walks.is_empty() { 0.0 } else { each - n * remaining(mu, &mean) }
            })
            .collect();
        Self { node, part, walks, losses }
    }

    /// Region and way to split at; `None` where all walks are alike.
    fn split(&self, ways: &[Ways], mu: &Ways) -> Option<(usize, f64)> {
        let n = self.walks.len() as f64;
        let mut best = (0.0, 0, 0.0);
        for r in (0..REGIONS).filter(|r| mu[*r] > 0.0) {
            let (mut sum, mut squares) = (0.0, 0.0);
            let (mut low, mut high) = (f64::INFINITY, 0.0f64);
            for w in &self.walks {
                let way = ways[*w][r];
                let e = (-mu[r] * way).exp();
                (sum, squares) = (sum + e, squares + e * e);
                (low, high) = (low.min(way), high.max(way));
            }
            let variance = squares / n - (sum / n).powi(2);
            let at_um = -(sum / n).ln() / mu[r];
            // Rounding may find a variance where all ways are equal.
            if variance > best.0 && low <= at_um && at_um < high {
                best = (variance, r, at_um);
            }
        }
        (best.0 > 0.0).then_some((best.1, best.2))
    }
}

/// Share of light that is left after a way.
#[inline]
pub(super) fn remaining(mu: &Ways, way: &Ways) -> f64 {
    (-mu.iter().zip(way).map(|(m, l)| m * l).sum::<f64>()).exp()
}

/// Absorption coefficients, 1/um, that have the optical depth `depth` straight through each of the given regions;
/// `None` where none of them exists.
fn coefficients(depth_um: &Ways, regions: &[usize], depth: f64) -> Option<Ways> {
    let mut mu = Ways::default();
    for r in regions.iter().copied().filter(|r| depth_um[*r] > 0.0) {
        mu[r] = depth / depth_um[r];
    }
    mu.iter().any(|m| *m > 0.0).then_some(mu)
}

fn sets(depth_um: &Ways, wanted: &[(&[usize], &[f64])]) -> Vec<Ways> {
    let mut sets: Vec<Ways> = Vec::new();
    for (regions, depths) in wanted {
        for mu in depths.iter().filter_map(|d| coefficients(depth_um, regions, *d)) {
            if !sets.contains(&mu) {
                sets.push(mu);
            }
        }
    }
    sets
}

/// Coefficients that the classes are made for: each epidermis alone, both, the mesophyll, everything.
pub(super) fn training(depth_um: &Ways) -> Vec<Ways> {
    sets(
        depth_um,
        &[
            (&[0], &[0.3, 1.0, 3.0, 9.0]),
            (&[3], &[0.3, 1.0, 3.0, 9.0]),
            (&[0, 3], &[0.3, 1.0, 3.0, 9.0]),
            (&[1], &[0.1, 0.5, 2.0]),
            (&[2], &[0.1, 0.5, 2.0]),
            (&[1, 2], &[0.1, 0.5, 2.0]),
            (&[0, 1, 2, 3], &[0.1, 0.4, 1.5]),
        ],
    )
}

/// Other coefficients, at which the error of the classes is measured.
pub(super) fn checks(depth_um: &Ways) -> Vec<Ways> {
    sets(
        depth_um,
        &[
            (&[0], &[0.6, 2.2, 8.7]),
            (&[3], &[0.6, 2.2]),
            (&[0, 3], &[0.6, 2.2, 8.7]),
            (&[1, 2], &[0.3, 1.2]),
            (&[0, 1, 2, 3], &[0.8]),
        ],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::recolour::class_remaining;
    use crate::math::Stream;
    use crate::math::stats::Welford;

    /// Ways of a random kind of walk: a few passes of the epidermis, long ones in the mesophyll.
    fn ways(n: u64) -> Vec<Ways> {
        (0..n)
            .map(|i| {
                let mut s = Stream::new(5, 0, i);
                let passes = (1.0 + 2.0 * s.exponential()).floor();
                let way = |s: &mut Stream, depth: f64, k: f64| {
                    (0..k as u32).map(|_| depth * (0.7 + s.exponential())).sum()
                };
                let top = way(&mut s, 20.0, passes);
                let middle = 150.0 * s.exponential() * 2.0;
                [top, 0.0, middle, if s.next() < 0.5 { way(&mut s, 15.0, passes) } else { 0.0 }]
            })
            .collect()
    }

    const DEPTH: Ways = [20.0, 0.0, 150.0, 15.0];

    /// All of one part.
    fn through(ways: Vec<Ways>) -> [Vec<Ways>; PARTS] {
        [Vec::new(), Vec::new(), ways]
    }

    /// Largest error over the check's coefficients, as a share of the walks.
    fn error(tree: &PathClasses, ways: &[Ways]) -> f64 {
        let mut classes = vec![[Welford::default(); REGIONS]; tree.len()];
        for way in ways {
            (0..REGIONS).for_each(|r| classes[tree.class(2, way)][r].push(way[r]));
        }
        let of = |mu: &Ways| {
            let each: f64 = ways.iter().map(|w| remaining(mu, w)).sum();
            let left = |c: &[Welford; REGIONS]| {
                let n = c[0].count() as f64;
                let spread = c.map(|w| if n > 1.0 { w.variance().sqrt() as f32 } else { 0.0 });
                n * class_remaining(&c.map(|w| w.mean() as f32), &spread, mu)
            };
            (each - classes.iter().map(left).sum::<f64>()).abs() / ways.len() as f64
        };
        checks(&DEPTH).iter().map(of).fold(0.0, f64::max)
    }

    #[test]
    fn more_classes_lose_less() {
        let (pilot, others) = (ways(40_000), ways(80_000).split_off(40_000));
        let errors = [3, 10, 66].map(|k| {
            let tree = PathClasses::new(&through(pilot.clone()), &DEPTH, k);
            assert!(tree.len() <= k);
            error(&tree, &others)
        });
        assert!(errors.windows(2).all(|w| w[1] < 0.25 * w[0]), "{errors:?}");
        assert!(errors[2] < 0.002, "{errors:?}");
    }

    #[test]
    fn degenerate_walks_make_one_class() {
        for ways in [vec![], vec![[3.0, 0.0, 0.1, 7.0]; 50], vec![[0.0; REGIONS]; 3]] {
            let tree = PathClasses::new(&through(ways), &DEPTH, 64);
            assert_eq!((tree.len(), tree.class(1, &[1e9, 0.0, 0.0, 1e-9])), (3, 1));
        }
        // Two kinds of walk need two classes, and keep them.
        let two: Vec<Ways> = (0..100).map(|i| [f64::from(i % 2) * 30.0, 0.0, 0.0, 0.0]).collect();
        let tree = PathClasses::new(&through(two.clone()), &DEPTH, 64);
        assert_eq!(tree.len(), 4);
        assert!(error(&tree, &two) < 1e-6);
    }
}

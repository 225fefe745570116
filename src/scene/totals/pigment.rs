//! The amounts of pigment at which a petal's totals are computed, and the weights between them.
//!
//! Factors of each epidermis stand in equal steps of their square root. Where both epidermes have the same factor
//! everywhere one row of nodes is enough; else there is a node for each pair.

use crate::scene::material::Material;
use crate::scene::pattern::PigmentFactors;
use crate::scene::tabulated::Petal;

/// Intervals of one factor where both sides share it.
const TIED_STEPS: usize = 32;
/// Intervals of each factor where they do not.
const STEPS: usize = 24;

/// How the pigment of a material varies.
#[derive(Clone, Debug)]
pub(super) enum Variation {
    /// The same everywhere.
    None(PigmentFactors),
    /// The same factor on both sides.
    Tied(Axis),
    /// A factor for each.
    Sides(Axis, Axis),
}

/// A node below a factor, how far the next one is, and its weight.
#[derive(Clone, Copy)]
pub(super) struct Between {
    pub(super) node: usize,
    pub(super) step: usize,
    pub(super) weight: f32,
}

/// Nodes of one factor.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    /// Square roots of the least and the largest factor.
    low: f32,
    high: f32,
    /// Intervals between nodes; none where the factor does not vary.
    steps: usize,
}

impl Axis {
    fn new((low, high): (f32, f32), steps: usize) -> Self {
        let (low, high) = (low.max(0.0).sqrt(), high.max(0.0).sqrt());
        Self { low, high, steps: if high > low { steps } else { 0 } }
    }

    fn factor(&self, node: usize) -> f32 {
        (self.low + (self.high - self.low) * node as f32 / self.steps.max(1) as f32).powi(2)
    }

    fn place(&self, factor: f32) -> (usize, f32) {
        if self.steps == 0 {
            return (0, 0.0);
        }
        let x = (factor.max(0.0).sqrt() - self.low) / (self.high - self.low) * self.steps as f32;
        let node = (x.max(0.0) as usize).min(self.steps - 1);
        let (low, high) = (self.factor(node), self.factor(node + 1));
        (node, ((factor - low) / (high - low)).clamp(0.0, 1.0))
    }
}

impl Variation {
    /// Of each tissue that a material has.
    pub(super) fn of_tissues(material: &Material) -> [Option<Self>; 3] {
        let own = Self::of(material);
        let Material::Petal(petal) = material else { return [Some(own), None, None] };
        let Petal::Tabulated(petal) = &**petal else { return [Some(own), None, None] };
        let [_, thin, withered] = petal.tissues();
        // What is dead has no pattern.
        let dead = withered.then_some(Self::None(PigmentFactors::ONE));
        [Some(own.clone()), thin.then_some(own), dead]
    }

    fn of(material: &Material) -> Self {
        let Material::Petal(petal) = material else { return Self::None(PigmentFactors::ONE) };
        let Petal::Tabulated(petal) = &**petal else { return Self::None(PigmentFactors::ONE) };
        let [adaxial, abaxial] = petal.pigment_ranges();
        if adaxial.0 >= adaxial.1 && abaxial.0 >= abaxial.1 {
            return Self::None(PigmentFactors { adaxial: adaxial.0, abaxial: abaxial.0 });
        }
        match petal.pattern() {
            None => Self::Tied(Axis::new(adaxial, TIED_STEPS)),
            Some(_) => Self::Sides(Axis::new(adaxial, STEPS), Axis::new(abaxial, STEPS)),
        }
    }

    /// Number of nodes.
    pub(super) fn nodes(&self) -> usize {
        match self {
            Self::None(_) => 1,
            Self::Tied(axis) => axis.steps + 1,
            Self::Sides(a, b) => (a.steps + 1) * (b.steps + 1),
        }
    }

    /// Factors at a node.
    pub(super) fn factors(&self, node: usize) -> PigmentFactors {
        match self {
            Self::None(factors) => *factors,
            Self::Tied(axis) => PigmentFactors::both(axis.factor(node)),
            Self::Sides(a, b) => PigmentFactors {
                adaxial: a.factor(node / (b.steps + 1)),
                abaxial: b.factor(node % (b.steps + 1)),
            },
        }
    }

    /// The nodes around these factors: those of the upper side's factor, and from each of them those of the lower side's.
    pub(super) fn place(&self, pigment: PigmentFactors) -> [Between; 2] {
        let still = Between { node: 0, step: 0, weight: 0.0 };
        match self {
            Self::None(_) => [still; 2],
            Self::Tied(axis) => {
                let (node, weight) = axis.place(pigment.adaxial);
                [Between { node, step: 1, weight }, still]
            }
            Self::Sides(a, b) => {
                let row = b.steps + 1;
                let (i, along) = a.place(pigment.adaxial);
                let (j, across) = b.place(pigment.abaxial);
                [
                    Between { node: i * row, step: if a.steps > 0 { row } else { 0 }, weight: along },
                    Between { node: j, step: usize::from(b.steps > 0), weight: across },
                ]
            }
        }
    }
}

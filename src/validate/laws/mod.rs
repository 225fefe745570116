//! The laws of petal optics: what botanists found in petals, measured on the petals of cells that light walks through.
//!
//! Each law is one file: it lets light walk through petals that differ in one thing and compares numbers that the law is
//! about. Nothing is fitted. A [`Finding`] holds where its number passes its bound by three of its standard errors; where a law
//! does not come out of the physics the finding says so. [`page::markdown`] writes the page `docs/laws.md`,
//! `tests/laws.rs` holds each law to its bounds.
//!
//! | law | measures | source |
//! |---|---|---|
//! | 1 | [`retro`]: light back to the lamp | Terado 1999 |
//! | 2 | [`gloss`]: light that never enters | van der Kooi 2014, Whitney 2012, Stavenga 2020 |
//! | 3 | [`velvet`]: dark pigment, bright outlines | Hayashi 2015 |
//! | 4 | [`black`]: the same pigment in taller, narrower cells | Yasuda 1967 |
//! | 5 | [`interior`]: light from within | Stavenga 2020, Biran 1974 |
//! | 6 | [`sides`]: upper and lower side | Biran 1974, Zarkovic 2021 |
//! | 7 | [`dust`]: domes as lenses | Hayashi 2001 |
//! | 8 | [`disorder`]: irregular cells | Fritz 2017 |
//! | 10 | [`growth`]: cells rise with age | Tachino 2000 |
//!
//! (Law 9, that close up a petal is discrete and far away its BSDF, is the estimator's:
//! `estimate_converges_to_the_table` in `tests/thesis.rs`.)

pub mod black;
pub mod disorder;
pub mod dust;
pub mod gloss;
pub mod growth;
pub mod interior;
pub mod page;
pub mod retro;
pub mod sides;
pub mod velvet;
mod walks;

use crate::Result;
use crate::gonio::Estimate;
use crate::io::line_chart::Chart;

/// How long to measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Effort {
    /// Walks per petal and lamp.
    pub walks: u64,
    /// Seed of the walks.
    pub seed: u64,
}

/// Where a law wants a number to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wanted {
    /// Above this.
    Above(f64),
    /// Below this.
    Below(f64),
    /// Between these.
    Between(f64, f64),
}

/// One number of a law.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// What it is.
    pub what: String,
    /// The number.
    pub value: Estimate,
    /// Where the law wants it.
    pub wanted: Wanted,
}

impl Finding {
    fn new(what: impl Into<String>, value: Estimate, wanted: Wanted) -> Self {
        Self { what: what.into(), value, wanted }
    }

    /// Is the number where it is wanted, by three standard errors?
    pub fn holds(&self) -> bool {
        let Estimate { value, standard_error } = self.value;
        let above = |bound: f64| value - 3.0 * standard_error > bound;
        let below = |bound: f64| value + 3.0 * standard_error < bound;
        match self.wanted {
            Wanted::Above(bound) => above(bound),
            Wanted::Below(bound) => below(bound),
            Wanted::Between(low, high) => above(low) && below(high),
        }
    }
}

/// A law and what was measured of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Law {
    /// Number.
    pub number: u32,
    /// Name, a word or two.
    pub name: &'static str,
    /// What was found in petals.
    pub claim: &'static str,
    /// By whom.
    pub source: &'static str,
    /// What is measured here, and how.
    pub method: &'static str,
    /// The numbers.
    pub findings: Vec<Finding>,
    /// What the numbers do not say.
    pub remark: &'static str,
    /// The plot.
    pub chart: Chart,
}

impl Law {
    /// Do all findings hold?
    pub fn holds(&self) -> bool {
        self.findings.iter().all(Finding::holds)
    }
}

/// Measures one law.
pub type Measure = fn(Effort) -> Result<Law>;

/// All laws, by their numbers.
pub const LAWS: [(u32, Measure); 9] = [
    (1, retro::measure),
    (2, gloss::measure),
    (3, velvet::measure),
    (4, black::measure),
    (5, interior::measure),
    (6, sides::measure),
    (7, dust::measure),
    (8, disorder::measure),
    (10, growth::measure),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finding_holds_by_three_errors() {
        let holds =
            |value, wanted| Finding::new("x", Estimate { value, standard_error: 0.1 }, wanted).holds();
        assert!(holds(1.31, Wanted::Above(1.0)) && !holds(1.29, Wanted::Above(1.0)));
        assert!(holds(0.69, Wanted::Below(1.0)) && !holds(0.71, Wanted::Below(1.0)));
        assert!(holds(1.0, Wanted::Between(0.6, 1.4)) && !holds(1.0, Wanted::Between(0.8, 2.0)));
        assert!(!holds(f64::NAN, Wanted::Above(0.0)));
    }
}

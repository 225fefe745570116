//! The models that the program ships, with representative parameters: what `rosarium check` checks.

use super::sheet::sheet;
use std::ops::ControlFlow;
use std::sync::Arc;

use super::{Report, Test};
use crate::Result;
use crate::bsdf::{Bsdf, DiffuseTransmission, Lambert, LiteralPhong, Phong};
use crate::gonio::{TabulatedBsdf, WhiteMonteCarlo};
use crate::micro::CellWalk;
use crate::micro::shading::CellPetal;
use crate::scene::description::{PetalDescription, SpectrumDescription, TransmissionDescription};
use crate::scene::petal::PRESETS;
use crate::scene::{MemoryAssets, load};
use crate::spectrum::Spectrum;

/// A model to be checked.
pub struct Shipped {
    /// Name in reports.
    pub name: &'static str,
    /// The model.
    pub bsdf: Box<dyn Bsdf>,
    /// A known flaw: the model is kept to show it, and the suite must find it.
    pub expected_to_fail: Option<Flaw>,
}

impl Shipped {
    /// Is the outcome the expected one: no failure, or the known flaw found?
    pub fn is_as_expected(&self, report: &Report) -> bool {
        match self.expected_to_fail {
            None => report.passed(),
            Some(flaw) => report.failed().contains(&flaw.test),
        }
    }
}

/// What is wrong with a model on purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Flaw {
    /// The test that finds it.
    pub test: Test,
    /// What it is.
    pub reason: &'static str,
}

/// Every shipped model: grey and coloured, one- and two-sided, dull and sharp.
pub fn shipped() -> Result<Vec<Shipped>> {
    // A red petal's colour: absorbs below 600 nm. Smooth, because only its variation matters here.
    let red = |low: f64, high: f64| {
        Spectrum::from_fn(move |nm| low + (high - low) / (1.0 + (-(nm - 600.0) / 15.0).exp()))
    };
    let models: Vec<(&'static str, Box<dyn Bsdf>)> = vec![
        ("lambert", Box::new(Lambert::new(0.5.into())?)),
        ("lambert white", Box::new(Lambert::new(1.0.into())?)),
        ("lambert two-sided", Box::new(Lambert::two_sided(red(0.03, 0.6), red(0.2, 0.5))?)),
        ("diffuse transmission", Box::new(DiffuseTransmission::new(0.5.into(), 0.4.into(), 0.4.into())?)),
        (
            "diffuse transmission red",
            Box::new(DiffuseTransmission::new(red(0.02, 0.55), red(0.1, 0.5), red(0.01, 0.45))?),
        ),
        ("phong dull", Box::new(Phong::new(red(0.05, 0.6), 0.3.into(), 3.0)?)),
        ("phong glossy", Box::new(Phong::new(0.3.into(), 0.7.into(), 60.0)?)),
        ("phong sharp", Box::new(Phong::new(0.0.into(), 1.0.into(), 600.0)?)),
    ];
    let mut all: Vec<Shipped> =
        models.into_iter().map(|(name, bsdf)| Shipped { name, bsdf, expected_to_fail: None }).collect();
    all.push(Shipped {
        name: "literal phong",
        bsdf: Box::new(LiteralPhong::new(red(0.05, 0.5), 0.4.into(), 20.0)?),
        expected_to_fail: Some(Flaw {
            test: Test::Reciprocity,
            reason: "the textbook formula divides by the light's cosine only",
        }),
    });
    Ok(all)
}

/// Every petal of cells that comes with the program, and one whose transmitted light keeps directions, for
/// [`super::check_petal`].
pub fn shipped_petals() -> Result<Vec<(&'static str, CellPetal)>> {
    let mut all = Vec::new();
    for &(name, text) in PRESETS {
        let description = load::<PetalDescription>(text, name, &[])?.description;
        // Where there is a tissue, the coefficients that are tested here do not shade the petal.
        if description.tissue.is_none() {
            all.push((name, description.compile("", &MemoryAssets::default())?));
        }
    }
    let mut lobes = PetalDescription::default();
    lobes.shading.transmission = TransmissionDescription {
        direct: SpectrumDescription::Constant(0.06),
        direct_exponent: 30.0,
        indirect: SpectrumDescription::Constant(0.04),
        indirect_exponent: 6.0,
    };
    all.push(("transmission lobes", lobes.compile("", &MemoryAssets::default())?));
    Ok(all)
}

/// A sheet that exists as tables only, and every petal with a tissue that comes with the program, coarsely measured, for
/// [`super::check_bsdf`] with [`super::Settings::for_tables`]: what is checked does not depend on the number of walks or bins.
pub fn shipped_tables() -> Result<Vec<(&'static str, TabulatedBsdf)>> {
    let instrument = WhiteMonteCarlo {
        walks: 6000,
        thetas: 6,
        surface_phis: 6,
        interior_phis: 4,
        classes: 8,
        ..WhiteMonteCarlo::default()
    };
    // Absorption of pigment, 1/um, from a strong band in the green to none in the red.
    let pigment =
        |strength: f64| Spectrum::from_fn(move |nm| strength * (-((nm - 540.0) / 50.0).powi(2)).exp());
    let tabulated = TabulatedBsdf::new(&sheet(6, 4), [pigment(0.05), 0.0.into(), 0.0.into(), pigment(0.02)])?;
    let mut all = vec![("sheet", tabulated)];
    for &(name, text) in PRESETS {
        let description = load::<PetalDescription>(text, name, &[])?.description;
        if let Some(tissue) = description.build_tissue("")? {
            let tissue = Arc::new(tissue);
            let walk = CellWalk::new(tissue.clone());
            let optics = instrument.measure(&walk, tissue.depth_um, &|_, _| ControlFlow::Continue(()))?;
            all.push((name, TabulatedBsdf::of_tissue(&optics, &tissue)?));
        }
    }
    Ok(all)
}

//! The petal's light against measured reflectance spectra of petals, where the user has them.
//!
//! The data (FReD, the Floral Reflectance Database, as shipped with dreye) have no stated licence and are not part of the
//! project: `../shared/data/fred_flowers_reflectance.csv` beside it.

use std::ops::ControlFlow;

use rosarium::fit::spectrum::{self, Options};
use rosarium::scene::description::PetalDescription;
use rosarium::scene::{load, petal};
use rosarium::spectrum::table;

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/fred_flowers_reflectance.csv");

#[test]
#[expect(clippy::print_stderr, reason = "what was measured, or why nothing was")]
fn measured_flowers_are_met() {
    let Ok(text) = std::fs::read_to_string(FILE) else {
        eprintln!("not run: {FILE} is not there");
        return;
    };
    let flowers = table::parse(&text, FILE).expect("a table");
    let pink = petal::preset("pink").expect("a preset");
    let pink = load::<PetalDescription>(pink, "pink", &[]).expect("a petal").description;
    let mut tissue = pink.tissue.expect("it has layers");
    // The flavonol of these flowers is not known.
    for epidermis in [&mut tissue.adaxial, &mut tissue.abaxial].into_iter().flatten() {
        epidermis.pigments.flavonol_mol_per_l = 0.0;
    }
    let options = Options { walks: 2000, ..Options::default() };
    // R. pendulina misses the 0.03 that the others meet: docs/fit.md says how.
    for (column, bound) in [
        ("Rosa_Pendulina_546", 0.032),
        ("Rosa_Canina_64", 0.03),
        ("Papaver_Rhoeas_1154", 0.03),
        ("Hibiscus_Rosa-sinensis_1068", 0.03),
    ] {
        let points = flowers.points(Some(column)).expect("a column");
        let fit = spectrum::fit(&points, FILE, (&tissue, &pink.cells, "tissue"), &options, &|_, _| {
            ControlFlow::Continue(())
        })
        .expect("a fit");
        eprintln!("{column}: RMSE {:.4}", fit.rmse);
        assert!(fit.rmse <= bound && fit.converged, "{column}: {:.4} {:?}", fit.rmse, fit.parameters);
    }
}

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
fn measured_flowers_are_met() {
    let Ok(text) = std::fs::read_to_string(FILE) else {
        eprintln!("not run: {FILE} is not there");
        return;
    };
    let flowers = table::parse(&text, FILE).expect("a table");
    let pink = petal::preset("pink").expect("a preset");
    let pink = load::<PetalDescription>(pink, "pink", &[]).expect("a petal").description;
    let tissue = pink.tissue.expect("it has layers");
    let options = Options { walks: 2000, ..Options::default() };
    // A pigment's peak at a bound means that the band's form is not that of leaves; the amounts still explain the colour.
    for column in
        ["Rosa_Pendulina_546", "Rosa_Canina_64", "Papaver_Rhoeas_1154", "Hibiscus_Rosa-sinensis_1068"]
    {
        let points = flowers.points(Some(column)).expect("a column");
        let fit = spectrum::fit(&points, FILE, (&tissue, &pink.cells, "tissue"), &options, &|_, _| {
            ControlFlow::Continue(())
        })
        .expect("a fit");
        eprintln!("{column}: RMSE {:.4}", fit.rmse);
        assert!(fit.rmse <= bound && fit.converged, "{column}: {:.4} {:?}", fit.rmse, fit.parameters);
    }
}

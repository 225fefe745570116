//! What the thesis found: a petal sends light back to the lamp, and a flat surface does not.
//!
//! The virtual goniophotometer shines on a sample from a given angle, follows every path through the cells, and
//! counts where the light goes. The retro index compares the directions around the lamp with those around the
//! mirror direction.
//!
//! Run it: `cargo run --example 2_goniophotometer` (it writes lobes.svg).

#![allow(clippy::print_stdout, reason = "an example says what it finds")]

use std::ops::ControlFlow;

use rosarium::gonio::{GonioTable, Goniophotometer};
use rosarium::io::lobe_plot::{self, LobePlot};
use rosarium::micro::Profile;
use rosarium::scene::MemoryAssets;
use rosarium::scene::description::PetalDescription;

fn measure(petal: &PetalDescription) -> rosarium::Result<GonioTable> {
    let instrument = Goniophotometer {
        incident_deg: vec![30.0, 60.0, 75.0],
        rays: 200_000,
        bands_nm: vec![620.0],
        ..Goniophotometer::default()
    };
    let sample = petal.compile("", &MemoryAssets::default())?;
    instrument.measure(&sample, &|_done, _of| ControlFlow::Continue(()))
}

fn main() -> rosarium::Result<()> {
    // Every default is the thesis' petal or, where it is silent, our reading: see data/petals/thesis.toml.
    let thesis = PetalDescription::default();
    let mut flat = thesis.clone();
    flat.cells.profile = Profile::Flat;

    let tables =
        [measure(&thesis)?.described("thesis petal", ""), measure(&flat)?.described("flat petal", "")];
    for table in &tables {
        println!("{}", table.sample);
        for i in &table.incidences {
            let Some(index) = i.mean.retro_index else { continue };
            println!(
                "  lamp at {:2} deg: retro index {:.3} +- {:.3}, reflectance {:.4}",
                i.incident_deg, index.value, index.standard_error, i.mean.reflectance.value
            );
        }
        // Every path is accounted for: reflected, transmitted or absorbed.
        assert!(table.ledger_error() < 1e-9);
    }
    let svg = lobe_plot::svg(&tables[0], LobePlot::Both, None)?;
    std::fs::write("lobes.svg", svg).map_err(|e| rosarium::Error::io("lobes.svg", e))
}

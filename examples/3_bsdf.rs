//! The contract of a BSDF, and a judge that knows it.
//!
//! `eval` is f in 1/sr without the cosine, `sample` draws a direction to the light, `pdf` is the density of
//! that draw. Whatever keeps the contract passes the suite; the Phong of the textbooks does not.
//!
//! Run it: `cargo run --example 3_bsdf`

#![allow(clippy::print_stdout, reason = "an example says what it finds")]

use glam::{UVec2, Vec3};
use rosarium::bsdf::{Bsdf, Lambert, LiteralPhong, Phong};
use rosarium::math::Sampler;
use rosarium::math::stats::Welford;
use rosarium::spectrum::{LANES, SampledWavelengths};
use rosarium::validate::{Settings, check_bsdf};

fn main() -> rosarium::Result<()> {
    let lambert = Lambert::new(0.5.into())?;
    let phong = Phong::new(0.3.into(), 0.5.into(), 40.0)?;
    let textbook = LiteralPhong::new(0.3.into(), 0.5.into(), 40.0)?;

    // f cos / pdf, averaged over samples, is the albedo: the share of the light that comes back.
    let lambda = SampledWavelengths::given([550.0; LANES]);
    let wo = Vec3::new(0.6, 0.0, 0.8);
    let mut albedo = Welford::default();
    for i in 0..20_000 {
        let mut sampler = Sampler::new(1, UVec2::ZERO, i);
        let u_lobe = sampler.next_1d();
        let weight = phong.sample(wo, &lambda, u_lobe, sampler.next_2d()).map_or(0.0, |s| s.weight()[0]);
        albedo.push(f64::from(weight));
    }
    println!("Phong returns {:.4} +- {:.4} of the light\n", albedo.mean(), albedo.standard_error());

    let settings = Settings { samples: 20_000, ..Settings::default() };
    let models: [(&str, &dyn Bsdf); 3] =
        [("lambert", &lambert), ("phong", &phong), ("literal phong", &textbook)];
    for (name, model) in models {
        let report = check_bsdf(name, model, &settings);
        println!("{name}");
        for row in &report.rows {
            let mark = if row.passed { "ok " } else { "BAD" };
            println!("  {mark} {:13} {:9.2e} against {:.2e}", row.test.name(), row.statistic, row.tolerance);
        }
        assert_eq!(report.passed(), name != "literal phong");
    }
    Ok(())
}

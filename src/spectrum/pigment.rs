//! Absorption of light by pigment in a layer of cells.
//!
//! Model: Beer-Lambert, `transmittance = exp(-passes k(lambda) c)`, k the specific absorption coefficient
//! (natural logarithm, cm2/ug), c the amount of pigment per area of tissue (ug/cm2), passes how often light
//! crosses the layer.
//!
//! k is that of anthocyanin in living leaves (peak 535 nm), from the constants of PROSPECT-D
//! (`data/anthocyanin_prospect.csv`); below 400 nm it is held at its value there. In fresh red rose petals
//! the peak lies at 539 nm. Light crosses the layer straight: scattering within it is left out.
//! Guarded by `pigment_follows_beer_lambert`.

use std::sync::OnceLock;

use super::{Spectrum, table};

/// Largest amount that published petals have, ug/cm2 (Yasuda 1967, black roses).
pub const MAX_UG_PER_CM2: f64 = 1000.0;

/// Specific absorption of anthocyanin, cm2/ug.
pub fn anthocyanin_cm2_per_ug() -> &'static Spectrum {
    static K: OnceLock<Spectrum> = OnceLock::new();
    K.get_or_init(|| {
        const DATA: &str = include_str!("../../data/anthocyanin_prospect.csv");
        table::parse(DATA, "data/anthocyanin_prospect.csv")
            .and_then(|t| t.spectrum(None))
            .expect("the built-in table is tested")
    })
}

/// Share of light that `passes` crossings of a layer with `amount_ug_per_cm2` of anthocyanin leave.
pub fn anthocyanin_transmittance(amount_ug_per_cm2: f64, passes: f64) -> Spectrum {
    if amount_ug_per_cm2 == 0.0 {
        return Spectrum::Constant(1.0);
    }
    let k = anthocyanin_cm2_per_ug();
    Spectrum::from_fn(|l| (-passes * amount_ug_per_cm2 * f64::from(k.at(l as f32))).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pigment_follows_beer_lambert() {
        let k = anthocyanin_cm2_per_ug();
        // The published constants: peak at 535 nm, 0.0725 cm2/ug within rounding.
        let peak = (400..780).max_by(|a, b| k.at(*a as f32).total_cmp(&k.at(*b as f32))).unwrap();
        assert!((525..=540).contains(&peak), "{peak}");
        assert!((k.at(535.0) - 0.0725).abs() < 0.002, "{}", k.at(535.0));
        let (once, twice) = (anthocyanin_transmittance(30.0, 1.0), anthocyanin_transmittance(30.0, 2.0));
        for l in [400.0, 450.0, 535.0, 600.0, 700.0] {
            assert!((once.at(l) - (-30.0 * k.at(l)).exp()).abs() < 1e-5);
            assert!((twice.at(l) - once.at(l).powi(2)).abs() < 1e-5);
        }
        assert_eq!(anthocyanin_transmittance(0.0, 2.0), Spectrum::Constant(1.0));
    }
}

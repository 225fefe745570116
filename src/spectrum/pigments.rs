//! The pigments of one layer of tissue, and the water in it.
//!
//! Model: Beer-Lambert along a path of length l: `exp(-mu_a l)`,
//!
//! ```text
//! mu_a = (sum over pigments of k(lambda) c + k_brown(lambda) b + k_water(lambda) w) / d
//! c = 0.1 M C d   where a concentration C is given: mol/L x g/mol = 1e3 ug/cm3, times d in um = 1e-4 cm
//! ```
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | c | `anthocyanin_ug_per_cm2`, `carotenoid_...`, `chlorophyll_...`, `flavonol_...` | ug per cm2 of petal | 0 |
//! | C | `anthocyanin_mol_per_l`, `carotenoid_...`, `chlorophyll_...`, `flavonol_...` | mol per L of the layer | 0 |
//! | peak of the band | `anthocyanin_peak_nm` | nm | 535 |
//! | b | `brown`: products of dead cells | PROSPECT's arbitrary unit | 0 |
//! | w | `water_um`: equivalent thickness of water | um | 0 |
//! | d | volume of the layer per area of petal | um | |
//! | k, M | [`Pigment`]: specific absorption, molar mass | cm2/ug, g/mol | |
//!
//! Limits: one unit per pigment, guarded by `contradictory_amounts_are_named`; wavelengths with data for the pigments that
//! are there, guarded by `only_pigments_that_are_there_need_data`. A layer is a uniform solution: pigment in grains (plastids)
//! absorbs less (sieve effect, left out). Guarded by `both_units_say_the_same`.
//!
//! Source of k and M: [`super::pigment`].

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::pigment::{
    ANTHOCYANIN_PEAK_NM, MAX_UG_PER_CM2, Pigment, anthocyanin_moved_cm2_per_ug, brown_per_unit, water_per_cm,
};
use crate::{Error, Result};

/// Largest concentration of a pigment, mol/L: more than any of them dissolves.
const MAX_MOL_PER_L: f64 = 1.0;
/// Peaks that the anthocyanin band may have, nm.
const PEAKS_NM: (f64, f64) = (490.0, 580.0);
/// Most brown products; PROSPECT's leaves have up to about 1.
const MAX_BROWN: f64 = 100.0;
/// Thickest water, um.
const MAX_WATER_UM: f64 = 1e5;

/// Amounts of the pigments of one layer: each in ug per cm2 of petal or in mol per litre of the layer's cells.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Pigments {
    /// Anthocyanin, ug/cm2 of petal, 0 to 1000. Default 0.
    pub anthocyanin_ug_per_cm2: f64,
    /// Anthocyanin, mol per litre of the layer, 0 to 1, counted as cyanin. Default 0.
    #[serde(skip_serializing_if = "is_zero")]
    pub anthocyanin_mol_per_l: f64,
    /// Where the anthocyanin band peaks, nm, 490 to 580. Default 535: leaves; fresh red roses 539, pelargonin less.
    pub anthocyanin_peak_nm: f64,
    /// Carotenoid, ug/cm2 of petal, 0 to 1000. Default 0.
    #[serde(skip_serializing_if = "is_zero")]
    pub carotenoid_ug_per_cm2: f64,
    /// Carotenoid, mol per litre of the layer, 0 to 1, counted as violaxanthin. Default 0.
    #[serde(skip_serializing_if = "is_zero")]
    pub carotenoid_mol_per_l: f64,
    /// Chlorophyll, ug/cm2 of petal, 0 to 1000. Default 0.
    #[serde(skip_serializing_if = "is_zero")]
    pub chlorophyll_ug_per_cm2: f64,
    /// Chlorophyll, mol per litre of the layer, 0 to 1, counted as chlorophyll a. Default 0.
    #[serde(skip_serializing_if = "is_zero")]
    pub chlorophyll_mol_per_l: f64,
    /// Flavonol (absorbs below 420 nm), ug/cm2 of petal, 0 to 1000. Default 0.
    #[serde(skip_serializing_if = "is_zero")]
    pub flavonol_ug_per_cm2: f64,
    /// Flavonol, mol per litre of the layer, 0 to 1, counted as quercitrin. Default 0.
    #[serde(skip_serializing_if = "is_zero")]
    pub flavonol_mol_per_l: f64,
    /// Brown products of dead cells, per area of petal, in the arbitrary unit of PROSPECT: 1 makes a leaf brown, 0 to 100.
    /// Default 0.
    #[serde(skip_serializing_if = "is_zero")]
    pub brown: f64,
    /// Water in the layer as the thickness of a film, um, 0 to 1e5; absorbs beyond 900 nm. Default 0.
    #[serde(skip_serializing_if = "is_zero")]
    pub water_um: f64,
}

fn is_zero(v: &f64) -> bool {
    *v == 0.0
}

impl Default for Pigments {
    fn default() -> Self {
        Self {
            anthocyanin_ug_per_cm2: 0.0,
            anthocyanin_mol_per_l: 0.0,
            anthocyanin_peak_nm: ANTHOCYANIN_PEAK_NM,
            carotenoid_ug_per_cm2: 0.0,
            carotenoid_mol_per_l: 0.0,
            chlorophyll_ug_per_cm2: 0.0,
            chlorophyll_mol_per_l: 0.0,
            flavonol_ug_per_cm2: 0.0,
            flavonol_mol_per_l: 0.0,
            brown: 0.0,
            water_um: 0.0,
        }
    }
}

impl Pigments {
    /// Amounts as given: pigment, ug/cm2, mol/L.
    fn given(&self) -> [(Pigment, f64, f64); 4] {
        [
            (Pigment::Anthocyanin, self.anthocyanin_ug_per_cm2, self.anthocyanin_mol_per_l),
            (Pigment::Carotenoid, self.carotenoid_ug_per_cm2, self.carotenoid_mol_per_l),
            (Pigment::Chlorophyll, self.chlorophyll_ug_per_cm2, self.chlorophyll_mol_per_l),
            (Pigment::Flavonol, self.flavonol_ug_per_cm2, self.flavonol_mol_per_l),
        ]
    }

    /// Checks the amounts. `at` is the key of this table in its file.
    pub fn validate(&self, at: &str) -> Result<()> {
        let within = |key: &str, value: f64, low: f64, high: f64, unit: &str| {
            if (low..=high).contains(&value) {
                return Ok(());
            }
            Err(Error::invalid(
                format!("{at}.{key}"),
                format!("{value} is not within {low} to {high} {unit}"),
            ))
        };
        for (pigment, ug_per_cm2, mol_per_l) in self.given() {
            let name = pigment.name();
            within(&format!("{name}_ug_per_cm2"), ug_per_cm2, 0.0, MAX_UG_PER_CM2, "ug/cm2")?;
            within(&format!("{name}_mol_per_l"), mol_per_l, 0.0, MAX_MOL_PER_L, "mol/L")?;
            if ug_per_cm2 > 0.0 && mol_per_l > 0.0 {
                let what = format!(
                    "contradictory: {mol_per_l} mol/L and {name}_ug_per_cm2 = {ug_per_cm2} are two amounts of one pigment; \
                     give one of them"
                );
                return Err(Error::invalid(format!("{at}.{name}_mol_per_l"), what));
            }
        }
        within("anthocyanin_peak_nm", self.anthocyanin_peak_nm, PEAKS_NM.0, PEAKS_NM.1, "nm")?;
        within("brown", self.brown, 0.0, MAX_BROWN, "units")?;
        within("water_um", self.water_um, 0.0, MAX_WATER_UM, "um")
    }

    /// Does the layer absorb nothing?
    pub fn is_empty(&self) -> bool {
        self.water_um == 0.0
            && self.brown == 0.0
            && self.given().iter().all(|(_, a, b)| *a == 0.0 && *b == 0.0)
    }

    /// The same layer with every amount of pigment times `factor`; the water stays.
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            anthocyanin_ug_per_cm2: self.anthocyanin_ug_per_cm2 * factor,
            anthocyanin_mol_per_l: self.anthocyanin_mol_per_l * factor,
            anthocyanin_peak_nm: self.anthocyanin_peak_nm,
            carotenoid_ug_per_cm2: self.carotenoid_ug_per_cm2 * factor,
            carotenoid_mol_per_l: self.carotenoid_mol_per_l * factor,
            chlorophyll_ug_per_cm2: self.chlorophyll_ug_per_cm2 * factor,
            chlorophyll_mol_per_l: self.chlorophyll_mol_per_l * factor,
            flavonol_ug_per_cm2: self.flavonol_ug_per_cm2 * factor,
            flavonol_mol_per_l: self.flavonol_mol_per_l * factor,
            brown: self.brown * factor,
            water_um: self.water_um,
        }
    }

    /// What a layer holds that is `factor` times as thick and made of the same stuff.
    pub fn in_thickness(&self, factor: f64) -> Self {
        Self {
            anthocyanin_ug_per_cm2: self.anthocyanin_ug_per_cm2 * factor,
            carotenoid_ug_per_cm2: self.carotenoid_ug_per_cm2 * factor,
            chlorophyll_ug_per_cm2: self.chlorophyll_ug_per_cm2 * factor,
            flavonol_ug_per_cm2: self.flavonol_ug_per_cm2 * factor,
            brown: self.brown * factor,
            water_um: self.water_um * factor,
            ..self.clone()
        }
    }

    /// Amount of a pigment per area of petal, ug/cm2, in a layer of `depth_um` (volume per area).
    pub fn amount_ug_per_cm2(&self, pigment: Pigment, depth_um: f64) -> f64 {
        let given = self.given().into_iter().find(|g| g.0 == pigment);
        given.map_or(0.0, |(p, ug_per_cm2, mol_per_l)| {
            ug_per_cm2 + 0.1 * p.molar_mass_g_per_mol() * mol_per_l * depth_um
        })
    }

    /// Absorption coefficient at one wavelength, 1/um, in a layer of `depth_um` (volume per area). An error at
    /// `wavelength` where a pigment that is there has no data.
    pub fn absorption_per_um(&self, depth_um: f64, wavelength_nm: f64) -> Result<f64> {
        let mut depth = 0.0;
        for pigment in Pigment::ALL {
            let amount = self.amount_ug_per_cm2(pigment, depth_um);
            if amount > 0.0 {
                depth += amount
                    * match pigment {
                        Pigment::Anthocyanin => {
                            anthocyanin_moved_cm2_per_ug(self.anthocyanin_peak_nm, wavelength_nm)?
                        }
                        _ => pigment.cm2_per_ug(wavelength_nm)?,
                    };
            }
        }
        if self.brown > 0.0 {
            depth += brown_per_unit(wavelength_nm)? * self.brown;
        }
        if self.water_um > 0.0 {
            depth += water_per_cm(wavelength_nm)? * self.water_um * 1e-4;
        }
        Ok(if depth > 0.0 { depth / depth_um } else { 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Pigments> {
        let p: Pigments = toml::from_str(text).map_err(|e| Error::invalid("toml", e.message()))?;
        p.validate("tissue.adaxial.pigments")?;
        Ok(p)
    }

    #[test]
    fn both_units_say_the_same() {
        // By hand: 0.024 mol/L x 611.53 g/mol = 14.677 g/L = 14,677 ug/cm3; through 20 um = 0.002 cm: 29.35 ug/cm2.
        let molar = read("anthocyanin_mol_per_l = 0.024").expect("valid");
        let amount = molar.amount_ug_per_cm2(Pigment::Anthocyanin, 20.0);
        assert!((amount - 29.353).abs() < 1e-3, "{amount}");
        // By hand: 29.353 ug/cm2 x 0.0725289 cm2/ug = 2.129 over 20 um.
        let mu = molar.absorption_per_um(20.0, 535.0).expect("known");
        assert!((mu * 20.0 - 2.129).abs() < 1e-3, "{mu}");
        for pigment in Pigment::ALL {
            let name = pigment.name();
            let molar = read(&format!("{name}_mol_per_l = 0.01")).expect("valid");
            let amount = molar.amount_ug_per_cm2(pigment, 35.0);
            let areal = read(&format!("{name}_ug_per_cm2 = {amount}")).expect("valid");
            for l in [380.0, 436.0, 500.0, 676.0, 900.0] {
                let (a, b) = (molar.absorption_per_um(35.0, l), areal.absorption_per_um(35.0, l));
                let (a, b) = (a.expect("known"), b.expect("known"));
                assert!((a - b).abs() <= 1e-12 * a, "{name} {l}: {a} {b}");
            }
        }
        // Brown: 0.3511 per unit at 550 nm.
        let brown = read("brown = 2.0").expect("valid");
        let mu = brown.absorption_per_um(50.0, 550.0).expect("known");
        assert!((mu * 50.0 - 0.7022).abs() < 1e-9, "{mu}");
        // Of the same stuff: the same coefficient in any thickness.
        let layer =
            read("anthocyanin_mol_per_l = 0.01\ncarotenoid_ug_per_cm2 = 2.0\nbrown = 1.0\nwater_um = 30.0")
                .expect("valid");
        for l in [450.0, 1000.0] {
            let mu = layer.absorption_per_um(40.0, l).expect("known");
            let half = layer.in_thickness(0.5).absorption_per_um(20.0, l).expect("known");
            assert!((mu - half).abs() < 1e-12 * mu, "{l}: {mu} {half}");
        }
        // Water: 30.54 1/cm at 1450 nm, 150 um of it in a layer of 200 um.
        let wet = read("water_um = 150.0").expect("valid");
        let mu = wet.absorption_per_um(200.0, 1450.0).expect("known");
        assert!((mu * 200.0 / (30.54 * 150e-4) - 1.0).abs() < 0.006, "{mu}");
    }

    #[test]
    fn layers_add_and_scale() {
        let all = read(
            "anthocyanin_ug_per_cm2 = 20.0\nanthocyanin_peak_nm = 541.0\ncarotenoid_ug_per_cm2 = 5.0\n\
             chlorophyll_mol_per_l = 0.001\nflavonol_ug_per_cm2 = 100.0\nwater_um = 50.0",
        )
        .expect("valid");
        let sum: f64 = [
            "anthocyanin_ug_per_cm2 = 20.0\nanthocyanin_peak_nm = 541.0",
            "carotenoid_ug_per_cm2 = 5.0",
            "chlorophyll_mol_per_l = 0.001",
            "flavonol_ug_per_cm2 = 100.0",
            "water_um = 50.0",
        ]
        .iter()
        .map(|t| read(t).expect("valid").absorption_per_um(30.0, 410.0).expect("known"))
        .sum();
        let mu = |p: &Pigments| p.absorption_per_um(30.0, 410.0).expect("known");
        assert!((mu(&all) - sum).abs() < 1e-12);
        let wet = read("water_um = 50.0").expect("valid");
        assert!((mu(&all.scaled(2.5)) - mu(&wet) - 2.5 * (mu(&all) - mu(&wet))).abs() < 1e-12);
        assert!(Pigments::default().is_empty() && !wet.is_empty() && !all.is_empty());
        assert_eq!(
            all.scaled(0.0),
            Pigments { anthocyanin_peak_nm: 541.0, water_um: 50.0, ..Default::default() }
        );
        let text = toml::to_string(&all).expect("serialises");
        assert_eq!(read(&text).expect("its own"), all, "{text}");
    }

    #[test]
    fn contradictory_amounts_are_named() {
        for (text, key) in [
            (
                "anthocyanin_ug_per_cm2 = 10.0\nanthocyanin_mol_per_l = 0.01",
                "anthocyanin_mol_per_l: contradictory",
            ),
            ("flavonol_ug_per_cm2 = 10.0\nflavonol_mol_per_l = 0.01", "flavonol_mol_per_l: contradictory"),
            ("anthocyanin_ug_per_cm2 = -1.0", "anthocyanin_ug_per_cm2: -1"),
            ("carotenoid_ug_per_cm2 = 1001.0", "carotenoid_ug_per_cm2: 1001"),
            ("chlorophyll_mol_per_l = nan", "chlorophyll_mol_per_l: NaN"),
            ("flavonol_mol_per_l = 1.5", "flavonol_mol_per_l: 1.5"),
            ("anthocyanin_peak_nm = 450.0", "anthocyanin_peak_nm: 450"),
            ("brown = -0.5", "brown: -0.5"),
            ("water_um = inf", "water_um: inf"),
        ] {
            let e = read(text).expect_err(text).to_string();
            assert!(e.starts_with(&format!("tissue.adaxial.pigments.{key}")), "{text}: {e}");
        }
        let e = read("betalain_ug_per_cm2 = 3.0").expect_err("unknown").to_string();
        assert!(e.contains("betalain_ug_per_cm2") && e.contains("carotenoid_ug_per_cm2"), "{e}");
    }

    #[test]
    fn only_pigments_that_are_there_need_data() {
        let uv = read("flavonol_mol_per_l = 0.1").expect("valid");
        assert!(uv.absorption_per_um(20.0, 350.0).expect("known") > 0.0);
        let green = read("flavonol_mol_per_l = 0.1\nchlorophyll_ug_per_cm2 = 1.0").expect("valid");
        let e = green.absorption_per_um(20.0, 350.0).expect_err("none").to_string();
        assert!(e.starts_with("wavelength: no data for chlorophyll at 350 nm"), "{e}");
        assert_eq!(Pigments::default().absorption_per_um(20.0, 100.0).expect("nothing there"), 0.0);
        assert!(uv.absorption_per_um(20.0, 2501.0).is_err());
    }
}

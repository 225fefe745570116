//! How strongly pigments and water absorb light.
//!
//! Model: Beer-Lambert, `transmittance = exp(-k(lambda) c)`, k the specific absorption coefficient (natural logarithm, cm2/ug)
//! of a [`Pigment`], c its amount per area of tissue that the light crosses (ug/cm2). For water k is 1/cm and c the length
//! of the way in water (cm).
//!
//! | pigment | k | data |
//! |---|---|---|
//! | anthocyanin, carotenoid, chlorophyll, water | in living leaves, 400-2500 nm (Feret2017) | `data/pigments_prospect.csv` |
//! | brown products of dead cells | in withered leaves, per arbitrary unit; nothing beyond 1100 nm (Feret2017) | the same |
//! | flavonol | two Gaussian bands in wavenumber | below |
//!
//! - From 400 down to 380 nm k is held at its value at 400 nm (our reading). Below 380 nm only flavonol has data, to 240 nm.
//!   Above 2500 nm nothing has. Guarded by `no_value_without_data`.
//! - The anthocyanin band peaks at 535 nm in leaves. For another peak (490 to 580 nm; cyanin in fresh petals of roses 539 nm,
//!   in old ones 543 nm: Asen1971) the whole band keeps its form over wavenumber and its height, that is, all its transition
//!   energies change by one amount (our reading). Guarded by `a_moved_band_keeps_its_form`.
//! - Flavonol: bands at 350 and 256 nm, where flavonol glycosides absorb in methanol (Mabry1970); peaks of 16,000 and 20,000
//!   L/(mol cm) and standard deviations of 1700 and 1500 1/cm, so that 2 % of the peak are left at 420 nm, are our reading; flat
//!   peaks and shoulders are left out. Guarded by `flavonol_absorbs_ultraviolet`.
//!
//! Molar masses (g/mol; from the atomic masses, guarded by `molar_masses_are_those_of_the_formulae`): anthocyanin as cyanin
//! (cyanidin 3,5-diglucoside), C27H31O16+; carotenoid as violaxanthin, C40H56O4, the main one of roses; chlorophyll a,
//! C55H72MgN4O5; flavonol as quercitrin, C21H20O11.
//!
//! Coefficients of living leaves hold for petals as far as the pigments' surroundings are alike: our reading.
//! Guarded by `pigment_follows_beer_lambert`.

use std::sync::OnceLock;

use super::{Spectrum, table};
use crate::{Error, Result};

/// Largest amount that published petals have, ug/cm2 (Yasuda 1967, black roses).
pub const MAX_UG_PER_CM2: f64 = 1000.0;
/// Where the anthocyanin of leaves peaks, nm.
pub const ANTHOCYANIN_PEAK_NM: f64 = 535.0;
/// Shortest wavelength to which the measured coefficients are continued, nm.
const FIRST_NM: f64 = 380.0;
/// Shortest wavelength of the flavonol bands, nm.
const FLAVONOL_FIRST_NM: f64 = 240.0;
/// Longest wavelength of the data, nm.
const LAST_NM: f64 = 2500.0;
/// Natural logarithm of ten times 1000: from L/(mol cm) to cm2/mol, natural.
const DECADIC_LITRES: f64 = std::f64::consts::LN_10 * 1000.0;
/// Flavonol's bands: peak (nm), molar absorptivity (L/(mol cm), decadic), standard deviation (1/cm).
const FLAVONOL_BANDS: [(f64, f64, f64); 2] = [(350.0, 16_000.0, 1700.0), (256.0, 20_000.0, 1500.0)];

/// A substance that colours petals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pigment {
    /// Red to blue, in the vacuoles.
    Anthocyanin,
    /// Yellow, in plastids.
    Carotenoid,
    /// Green, in plastids.
    Chlorophyll,
    /// Colourless; absorbs ultraviolet light. In the vacuoles.
    Flavonol,
}

impl Pigment {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Anthocyanin, Self::Carotenoid, Self::Chlorophyll, Self::Flavonol];

    /// Its name, as keys have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Anthocyanin => "anthocyanin",
            Self::Carotenoid => "carotenoid",
            Self::Chlorophyll => "chlorophyll",
            Self::Flavonol => "flavonol",
        }
    }

    /// Molar mass, g/mol, of the substance that stands for it.
    pub fn molar_mass_g_per_mol(self) -> f64 {
        match self {
            Self::Anthocyanin => 611.53,
            Self::Carotenoid => 600.88,
            Self::Chlorophyll => 893.51,
            Self::Flavonol => 448.38,
        }
    }

    /// Specific absorption coefficient, cm2/ug.
    pub fn cm2_per_ug(self, wavelength_nm: f64) -> Result<f64> {
        let column = match self {
            Self::Flavonol => {
                within(self.name(), wavelength_nm, FLAVONOL_FIRST_NM)?;
                return Ok(flavonol_cm2_per_ug(wavelength_nm));
            }
            Self::Anthocyanin => &data().anthocyanin,
            Self::Carotenoid => &data().carotenoid,
            Self::Chlorophyll => &data().chlorophyll,
        };
        within(self.name(), wavelength_nm, FIRST_NM)?;
        Ok(table::interpolate(column, wavelength_nm))
    }
}

/// Specific absorption coefficient of anthocyanin whose band peaks at `peak_nm`, cm2/ug.
pub fn anthocyanin_moved_cm2_per_ug(peak_nm: f64, wavelength_nm: f64) -> Result<f64> {
    within(Pigment::Anthocyanin.name(), wavelength_nm, FIRST_NM)?;
    // Wavenumbers in 1/nm. Far in the infrared the band that lies there may have none: no light is absorbed.
    let moved = 1.0 / wavelength_nm - 1.0 / peak_nm + 1.0 / ANTHOCYANIN_PEAK_NM;
    Ok(if moved > 0.0 { smooth(&data().anthocyanin, 1.0 / moved) } else { 0.0 })
}

/// Catmull-Rom interpolation, never below zero: a band that moves must have a slope everywhere. Through the points; the
/// end values outside. Where rows are not equally far apart the band is zero.
fn smooth(points: &[(f64, f64)], x: f64) -> f64 {
    let k = points.partition_point(|p| p.0 <= x);
    if k == 0 || k == points.len() {
        return table::interpolate(points, x);
    }
    let (a, b) = (points[k - 1], points[k]);
    let before = if k > 1 { points[k - 2].1 } else { a.1 };
    let after = points.get(k + 1).map_or(b.1, |p| p.1);
    let t = (x - a.0) / (b.0 - a.0);
    let (da, db) = (0.5 * (b.1 - before), 0.5 * (after - a.1));
    let (t2, t3) = (t * t, t * t * t);
    let value = a.1 * (2.0 * t3 - 3.0 * t2 + 1.0)
        + b.1 * (3.0 * t2 - 2.0 * t3)
        + da * (t3 - 2.0 * t2 + t)
        + db * (t3 - t2);
    value.max(0.0)
}

/// Absorption coefficient of water, 1/cm.
pub fn water_per_cm(wavelength_nm: f64) -> Result<f64> {
    within("water", wavelength_nm, FIRST_NM)?;
    Ok(table::interpolate(&data().water, wavelength_nm))
}

/// Absorption of the brown products of dead cells, per unit of PROSPECT.
pub fn brown_per_unit(wavelength_nm: f64) -> Result<f64> {
    within("brown", wavelength_nm, FIRST_NM)?;
    Ok(table::interpolate(&data().brown, wavelength_nm))
}

/// Are there data for a substance at a wavelength?
fn within(name: &str, wavelength_nm: f64, first_nm: f64) -> Result<()> {
    if (first_nm..=LAST_NM).contains(&wavelength_nm) {
        return Ok(());
    }
    let what =
        format!("no data for {name} at {wavelength_nm} nm; they reach from {first_nm} to {LAST_NM} nm");
    Err(Error::invalid("wavelength", what))
}

fn flavonol_cm2_per_ug(wavelength_nm: f64) -> f64 {
    let sum: f64 = FLAVONOL_BANDS
        .iter()
        .map(|(peak_nm, absorptivity, width)| {
            let x = (1e7 / wavelength_nm - 1e7 / peak_nm) / width;
            absorptivity * (-0.5 * x * x).exp()
        })
        .sum();
    sum * DECADIC_LITRES / (Pigment::Flavonol.molar_mass_g_per_mol() * 1e6)
}

/// Columns of the file as `(wavelength_nm, value)`.
struct Data {
    anthocyanin: Vec<(f64, f64)>,
    carotenoid: Vec<(f64, f64)>,
    chlorophyll: Vec<(f64, f64)>,
    water: Vec<(f64, f64)>,
    brown: Vec<(f64, f64)>,
}

fn data() -> &'static Data {
    static DATA: OnceLock<Data> = OnceLock::new();
    DATA.get_or_init(|| {
        const TEXT: &str = include_str!("../../data/pigments_prospect.csv");
        let read = || {
            let t = table::parse(TEXT, "data/pigments_prospect.csv")?;
            Ok::<_, Error>(Data {
                anthocyanin: t.points(Some("anthocyanin_cm2_per_ug"))?,
                carotenoid: t.points(Some("carotenoid_cm2_per_ug"))?,
                chlorophyll: t.points(Some("chlorophyll_cm2_per_ug"))?,
                water: t.points(Some("water_per_cm"))?,
                brown: t.points(Some("brown_per_unit"))?,
            })
        };
        read().expect("the built-in table is tested")
    })
}

/// Share of light that `passes` crossings of a layer with `amount_ug_per_cm2` of anthocyanin leave.
pub fn anthocyanin_transmittance(amount_ug_per_cm2: f64, passes: f64) -> Spectrum {
    if amount_ug_per_cm2 == 0.0 {
        return Spectrum::Constant(1.0);
    }
    let k = &data().anthocyanin;
    Spectrum::from_fn(|l| (-passes * amount_ug_per_cm2 * table::interpolate(k, l)).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn peak_nm(k: impl Fn(f64) -> f64, range: std::ops::Range<u32>) -> f64 {
        let peak = range.map(f64::from).max_by(|a, b| k(*a).total_cmp(&k(*b)));
        peak.expect("not empty")
    }

    #[test]
    fn pigment_follows_beer_lambert() {
        let k = |l: f32| Pigment::Anthocyanin.cm2_per_ug(f64::from(l)).expect("known") as f32;
        let (once, twice) = (anthocyanin_transmittance(30.0, 1.0), anthocyanin_transmittance(30.0, 2.0));
        for l in [380.0, 400.0, 450.0, 535.0, 600.0, 700.0] {
            assert!((once.at(l) - (-30.0 * k(l)).exp()).abs() < 1e-5);
            assert!((twice.at(l) - once.at(l).powi(2)).abs() < 1e-5);
        }
        assert_eq!(anthocyanin_transmittance(0.0, 2.0), Spectrum::Constant(1.0));
    }

    #[test]
    fn published_values_and_peaks() {
        let at = |p: Pigment, l: f64| p.cm2_per_ug(l).expect("known");
        // Rows of the publication, also ones between the rows kept here.
        for (pigment, l, published) in [
            (Pigment::Anthocyanin, 400.0, 0.066_674_7),
            (Pigment::Anthocyanin, 535.0, 0.072_528_9),
            (Pigment::Anthocyanin, 680.0, 0.000_201_097),
            (Pigment::Carotenoid, 450.0, 0.167_441),
            (Pigment::Carotenoid, 600.0, 0.0),
            (Pigment::Chlorophyll, 436.0, 0.074_691_1),
            (Pigment::Chlorophyll, 680.0, 0.068_920_6),
            (Pigment::Chlorophyll, 900.0, 0.0),
        ] {
            assert!((at(pigment, l) - published).abs() < 1e-9, "{pigment:?} {l}: {}", at(pigment, l));
        }
        for (l, published) in [
            (500.0, 2.38e-4),
            (1000.0, 0.4072),
            (1101.0, 0.1929),
            (1450.0, 30.54),
            (1940.0, 125.6),
            (2500.0, 95.3),
        ] {
            let k = water_per_cm(l).expect("known");
            assert!((k / published - 1.0).abs() < 0.006, "{l}: {k}");
        }
        for (l, published) in [(400.0, 0.5272), (550.0, 0.3511), (650.0, 0.189), (1200.0, 0.0)] {
            assert_eq!(brown_per_unit(l).expect("known"), published);
        }
        assert_eq!(peak_nm(|l| at(Pigment::Anthocyanin, l), 420..780), ANTHOCYANIN_PEAK_NM);
        assert_eq!(peak_nm(|l| at(Pigment::Carotenoid, l), 400..780), 444.0);
        assert_eq!(peak_nm(|l| at(Pigment::Chlorophyll, l), 600..780), 676.0);
    }

    #[test]
    fn a_moved_band_keeps_its_form() {
        let k = |peak: f64, l: f64| anthocyanin_moved_cm2_per_ug(peak, l).expect("known");
        for l in [380.0, 444.4, 535.0, 612.3, 2500.0] {
            assert!(
                (k(ANTHOCYANIN_PEAK_NM, l) - Pigment::Anthocyanin.cm2_per_ug(l).expect("known")).abs() < 1e-4
            );
        }
        for peak in [490.0, 515.0, 541.0, 580.0] {
            assert!((peak_nm(|l| k(peak, l), 450..700) - peak).abs() <= 1.0);
            assert!((k(peak, peak) - 0.072_528_9).abs() < 1e-9);
            // Half heights: as far from the peak in wavenumber as those of the measured band.
            let half = |peak: f64| {
                let l =
                    (0..20_000).map(|i| peak + 0.01 * f64::from(i)).find(|l| k(peak, *l) < 0.5 * 0.072_528_9);
                1e7 / peak - 1e7 / l.expect("it falls")
            };
            assert!((half(peak) - half(ANTHOCYANIN_PEAK_NM)).abs() < 1.0, "{peak}");
            assert_eq!(k(peak, 2500.0), 0.0);
        }
    }

    #[test]
    fn flavonol_absorbs_ultraviolet() {
        let k = |l: f64| Pigment::Flavonol.cm2_per_ug(l).expect("known");
        assert!((peak_nm(k, 300..420) - 350.0).abs() <= 1.0);
        assert!((peak_nm(k, 240..300) - 256.0).abs() <= 1.0);
        // 16,000 L/(mol cm): 1 mol/L through 1 cm leaves 10^-16000; 448.38 g/L are 448,380 ug/cm3.
        let natural = 16_000.0 * 10f64.ln() / 448_380.0;
        assert!((k(350.0) / natural - 1.0).abs() < 1e-6, "{} {natural}", k(350.0));
        assert!(k(420.0) < 0.025 * k(350.0) && k(440.0) < 5e-3 * k(350.0));
    }

    #[test]
    fn molar_masses_are_those_of_the_formulae() {
        // C, H, O, N, Mg; IUPAC's conventional atomic masses.
        let mass = |c: f64, h: f64, o: f64, n: f64, mg: f64| {
            c * 12.011 + h * 1.008 + o * 15.999 + n * 14.007 + mg * 24.305
        };
        for (pigment, formula) in [
            (Pigment::Anthocyanin, mass(27.0, 31.0, 16.0, 0.0, 0.0)),
            (Pigment::Carotenoid, mass(40.0, 56.0, 4.0, 0.0, 0.0)),
            (Pigment::Chlorophyll, mass(55.0, 72.0, 5.0, 4.0, 1.0)),
            (Pigment::Flavonol, mass(21.0, 20.0, 11.0, 0.0, 0.0)),
        ] {
            assert!((pigment.molar_mass_g_per_mol() - formula).abs() < 0.02, "{pigment:?} {formula}");
        }
    }

    #[test]
    fn no_value_without_data() {
        for pigment in Pigment::ALL {
            let first = if pigment == Pigment::Flavonol { 240.0 } else { 380.0 };
            for l in [first, 2500.0] {
                assert!(pigment.cm2_per_ug(l).is_ok());
            }
            for l in [first - 1.0, 2501.0, 0.0, f64::NAN, f64::INFINITY] {
                let e = pigment.cm2_per_ug(l).expect_err("no data").to_string();
                assert!(
                    e.starts_with(&format!("wavelength: no data for {} at {l} nm", pigment.name())),
                    "{e}"
                );
            }
            assert!(anthocyanin_moved_cm2_per_ug(540.0, 379.0).is_err() && water_per_cm(379.0).is_err());
        }
        let held = |l: f64| Pigment::Carotenoid.cm2_per_ug(l).expect("continued");
        assert_eq!(held(380.0), held(400.0));
    }
}

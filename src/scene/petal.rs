//! Petal files to petals: cells, layers and pigment become a [`CellPetal`].
//!
//! Model of the pigment (our reading): the layers' coefficients are those of colourless tissue, and light on
//! its way through an epidermis loses by Beer-Lambert ([`crate::spectrum::pigment`]): the epidermis' own diffuse
//! light crosses the upper one once, the spongy layer's light twice, transmitted light both epidermes once (with or without a direction),
//! light from the lower side the lower one twice; the epidermis' highlight comes from its outer wall, uncoloured.

use std::sync::Arc;

use super::assets::Assets;
use super::color::reflectance;
use super::description::{LayerDescription, PetalDescription, ShadingModel};
use super::key::Key;
use crate::Result;
use crate::micro::shading::{CellPetal, Layer};
use crate::micro::transmission::{TransmissionLobe, Way};
use crate::micro::{CellDescription, CellField, Tissue, growth};
use crate::spectrum::Spectrum;
use crate::spectrum::pigment::{MAX_UG_PER_CM2, anthocyanin_transmittance};

/// Petals that come with the program: name and TOML text of a [`PetalDescription`].
pub const PRESETS: &[(&str, &str)] = &[
    ("thesis", include_str!("../../data/petals/thesis.toml")),
    ("rote_rose", include_str!("../../data/petals/rote_rose.toml")),
    ("black", include_str!("../../data/petals/black.toml")),
    ("pink", include_str!("../../data/petals/pink.toml")),
    ("white", include_str!("../../data/petals/white.toml")),
    ("yellow", include_str!("../../data/petals/yellow.toml")),
    ("baccara", include_str!("../../data/petals/baccara.toml")),
];

/// Green tissues that come with the program, in the same form.
pub const GREEN: &[(&str, &str)] = &[("leaf", include_str!("../../data/petals/leaf.toml"))];

/// The TOML text of a petal or a green tissue that comes with the program.
pub fn preset(name: &str) -> Option<&'static str> {
    PRESETS.iter().chain(GREEN).find(|(n, _)| *n == name).map(|(_, text)| *text)
}

impl PetalDescription {
    /// The cells at the petal's age. `at` as in [`PetalDescription::compile`].
    pub fn grown_cells(&self, at: &str) -> Result<CellDescription> {
        let key = if at.is_empty() { Key::new("age") } else { Key::new(at).at("age") };
        self.age
            .map_or_else(|| Ok(self.cells.clone()), |age| growth::grown(&self.cells, age, &key.to_string()))
    }

    /// The layers, checked and built; `None` where the petal is shaded by coefficients. `at` as in
    /// [`PetalDescription::compile`].
    pub fn build_tissue(&self, at: &str) -> Result<Option<Tissue>> {
        let key = if at.is_empty() { Key::new("tissue") } else { Key::new(at).at("tissue") };
        let Some(tissue) = &self.tissue else { return Ok(None) };
        Tissue::new(tissue, &self.grown_cells(at)?, &key.to_string()).map(Some)
    }

    /// Checks and builds the petal. Errors name the key below `at` (empty for a petal file, `petal` in a scene).
    pub fn compile(&self, at: &str, assets: &dyn Assets) -> Result<CellPetal> {
        let root = |name: &str| if at.is_empty() { Key::new(name) } else { Key::new(at).at(name) };
        root("samples").within(self.samples, 1..=1_000_000, "within 1 to 1000000")?;
        let cells_key = root("cells");
        self.cells.validate(&cells_key.to_string())?;
        let cells = Arc::new(CellField::new(&self.grown_cells(at)?)?);
        let key = root("shading");
        let shading = &self.shading;
        if shading.model == ShadingModel::Lambert {
            let albedo = reflectance(&shading.albedo, &key.at("albedo"), assets)?;
            return key.at("albedo").name(CellPetal::lambert(cells, albedo));
        }
        let [epidermis, spongy] = self.layers(at, assets)?;
        let lower = pigment(shading.anthocyanin_abaxial_ug_per_cm2, &key, "anthocyanin_abaxial_ug_per_cm2")?;
        let once = anthocyanin_transmittance(shading.anthocyanin_ug_per_cm2, 1.0);
        let through_lower = anthocyanin_transmittance(lower, 1.0);
        let abaxial = reflectance(&shading.abaxial, &key.at("abaxial"), assets)?;
        let abaxial = colour(&abaxial, &anthocyanin_transmittance(lower, 2.0));
        let through = colour(&once, &through_lower);
        let t = &shading.transmission;
        let mut lobes = Vec::new();
        for (way, share, name, exponent) in [
            (Way::Direct, &t.direct, "direct", t.direct_exponent),
            (Way::Indirect, &t.indirect, "indirect", t.indirect_exponent),
        ] {
            let key = key.at("transmission");
            let share = colour(&reflectance(share, &key.at(name), assets)?, &through);
            let lobe = key.under(TransmissionLobe::new(way, share, exponent as f32))?;
            // A lobe without light would only cost time.
            if lobe.share().max() > 0.0 {
                lobes.push(lobe);
            }
        }
        key.under(CellPetal::with_lobes(cells, &epidermis, &spongy, abaxial, lobes))
    }

    /// The epidermis and the spongy layer as they shade, in this order: what the pigment leaves of their coefficients. `at` as
    /// in [`PetalDescription::compile`].
    pub fn layers(&self, at: &str, assets: &dyn Assets) -> Result<[Layer; 2]> {
        let key = if at.is_empty() { Key::new("shading") } else { Key::new(at).at("shading") };
        let shading = &self.shading;
        let upper = pigment(shading.anthocyanin_ug_per_cm2, &key, "anthocyanin_ug_per_cm2")?;
        let lower = pigment(shading.anthocyanin_abaxial_ug_per_cm2, &key, "anthocyanin_abaxial_ug_per_cm2")?;
        let (once, twice) = (anthocyanin_transmittance(upper, 1.0), anthocyanin_transmittance(upper, 2.0));
        let through_lower = anthocyanin_transmittance(lower, 1.0);
        let layer = |d: &LayerDescription, name: &str| -> Result<Layer> {
            let key = key.at(name);
            let share = |d, name: &str| reflectance(d, &key.at(name), assets);
            Ok(Layer {
                diffuse: share(&d.diffuse, "diffuse")?,
                specular: share(&d.specular, "specular")?,
                exponent: key.at("exponent").within(d.exponent, 0.0..=1e5, "within 0 to 1e5")? as f32,
                transmittance: share(&d.transmittance, "transmittance")?,
            })
        };
        let mut epidermis = layer(&shading.epidermis, "epidermis")?;
        let mut spongy = layer(&shading.spongy, "spongy")?;
        epidermis.diffuse = colour(&epidermis.diffuse, &once);
        epidermis.transmittance = colour(&epidermis.transmittance, &once);
        spongy.diffuse = colour(&spongy.diffuse, &twice);
        spongy.specular = colour(&spongy.specular, &twice);
        spongy.transmittance = colour(&spongy.transmittance, &through_lower);
        Ok([epidermis, spongy])
    }
}

/// An amount of pigment, ug/cm2, checked.
fn pigment(value: f64, key: &Key, name: &str) -> Result<f64> {
    key.at(name).within(value, 0.0..=MAX_UG_PER_CM2, "within 0 to 1000 ug/cm2")
}

/// What a filter leaves of a spectrum.
fn colour(spectrum: &Spectrum, by: &Spectrum) -> Spectrum {
    spectrum.zip(by, |a, b| a * b)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::super::description::{SpectrumDescription, TransmissionDescription};
    use super::*;
    use crate::scene::assets::MemoryAssets;
    use crate::scene::tabulated::Petal;
    use crate::scene::{PigmentFactors, load};
    use crate::spectrum::SampledWavelengths;

    #[test]
    fn thesis_preset_is_the_default() {
        let d: PetalDescription = load(preset("thesis").unwrap(), "thesis", &[]).unwrap().description;
        assert_eq!(d, PetalDescription::default());
        assert!(preset("thesys").is_none());
    }

    #[test]
    fn presets_compile() {
        for (name, text) in PRESETS {
            let d: PetalDescription = load(text, name, &[]).unwrap().description;
            d.compile("", &MemoryAssets::default()).unwrap();
            let tissue = d.build_tissue("").unwrap();
            assert_eq!(tissue.is_some(), *name != "thesis", "{name}");
            if let Some(t) = tissue {
                // 150 to 300 um thick, as petals are.
                assert!((150.0..300.0).contains(&t.depth_um.iter().sum::<f64>()), "{name}: {:?}", t.depth_um);
            }
        }
    }

    /// PROSPECT-D, an independent model with the same pigments that reproduces measured leaves [Feret2017]: structure
    /// 1.6, chlorophyll 52, carotenoid 10 ug/cm2, water 0.012 cm, dry matter 0.006 g/cm2.
    #[test]
    fn a_leaf_reflects_and_transmits_as_leaves_do() {
        const PROSPECT: [(f32, f32, f32); 5] = [
            (450.0, 0.041, 0.000),
            (550.0, 0.132, 0.112),
            (670.0, 0.036, 0.002),
            (700.0, 0.109, 0.097),
            (780.0, 0.472, 0.471),
        ];
        let d: PetalDescription = load(preset("leaf").unwrap(), "leaf", &[]).unwrap().description;
        let d = PetalDescription { walks: Some(40_000), ..d };
        let Petal::Tabulated(leaf) = d.build("", &MemoryAssets::default()).unwrap() else { panic!("tissue") };
        let lambda = SampledWavelengths::given([450.0, 550.0, 670.0, 700.0, 780.0, 500.0, 600.0, 650.0]);
        let (sin, cos) = 8f32.to_radians().sin_cos();
        let [r, t] = leaf.at(PigmentFactors::ONE, &lambda).albedo(Vec3::new(sin, 0.0, cos));
        for (lane, (nm, reflectance, transmittance)) in PROSPECT.into_iter().enumerate() {
            assert!((r[lane] - reflectance).abs() < 0.03, "{nm} nm: R {} {reflectance}", r[lane]);
            assert!((t[lane] - transmittance).abs() < 0.035, "{nm} nm: T {} {transmittance}", t[lane]);
        }
        // The lower side is paler.
        let [below, _] = leaf.at(PigmentFactors::ONE, &lambda).albedo(Vec3::new(sin, 0.0, -cos));
        assert!(below[1] > 1.5 * r[1], "{} {}", below[1], r[1]);
    }

    #[test]
    fn age_scales_the_cells() {
        let of = |age: Option<f64>| {
            let d: PetalDescription =
                load(preset("rote_rose").unwrap(), "rote_rose", &[]).unwrap().description;
            let d = PetalDescription { age, ..d };
            let cells = d.compile("", &MemoryAssets::default()).unwrap().cells().description().clone();
            let tissue = d.build_tissue("").unwrap().unwrap();
            assert_eq!(tissue.adaxial.as_ref().unwrap().cells.description(), &cells);
            (cells, tissue.depth_um[0])
        };
        let (open, depth) = of(None);
        assert_eq!(of(Some(1.0)).0.height_um, open.height_um);
        let (bud, bud_depth) = of(Some(0.0));
        assert!(bud.height_um < 0.2 * open.height_um && bud.pitch_um < open.pitch_um && bud_depth < depth);
        let d = PetalDescription { age: Some(2.0), ..PetalDescription::default() };
        let e = d.compile("petal", &MemoryAssets::default()).unwrap_err().to_string();
        assert!(e.starts_with("petal.age: "), "{e}");
        assert!(d.build_tissue("").is_ok_and(|t| t.is_none()));
    }

    #[test]
    fn transmission_lobes_are_checked_by_key_and_coloured() {
        let mut d = PetalDescription::default();
        d.shading.transmission.direct = SpectrumDescription::Constant(0.05);
        d.shading.transmission.indirect = SpectrumDescription::Constant(0.04);
        let plain = PetalDescription::default().compile("", &MemoryAssets::default()).unwrap();
        let petal = d.compile("", &MemoryAssets::default()).unwrap();
        let lambda = SampledWavelengths::given([400.0, 450.0, 500.0, 535.0, 550.0, 600.0, 650.0, 700.0]);
        let more = petal.transmittance(&lambda) - plain.transmittance(&lambda);
        // Red light passes the pigment, green hardly.
        assert!(more[7] > 0.08 && more[7] <= 0.0901 && more[3] < 0.02, "{more:?}");
        for (key, change) in [
            (
                "direct",
                (|t| t.direct = SpectrumDescription::Constant(1.5)) as fn(&mut TransmissionDescription),
            ),
            ("indirect", |t| t.indirect = SpectrumDescription::Constant(f64::NAN)),
            ("direct_exponent", |t| t.direct_exponent = -1.0),
            ("indirect_exponent", |t| t.indirect_exponent = f64::INFINITY),
        ] {
            let mut d = d.clone();
            change(&mut d.shading.transmission);
            let e = d.compile("petal", &MemoryAssets::default()).unwrap_err().to_string();
            assert!(e.starts_with(&format!("petal.shading.transmission.{key}: ")), "{e}");
        }
        d.shading.transmission.direct = SpectrumDescription::Constant(0.5);
        let e = d.compile("petal", &MemoryAssets::default()).unwrap_err().to_string();
        assert!(e.starts_with("petal.shading.epidermis"), "{e}");
    }

    #[test]
    fn energy_and_ranges_are_checked_by_key() {
        let mut d = PetalDescription::default();
        d.shading.spongy.diffuse = SpectrumDescription::Constant(0.9);
        // Red light passes the pigment: there the sum exceeds one.
        let e = d.compile("petal", &MemoryAssets::default()).unwrap_err().to_string();
        assert!(e.starts_with("petal.shading.epidermis"), "{e}");
        let mut d = PetalDescription::default();
        d.shading.anthocyanin_ug_per_cm2 = -1.0;
        let e = d.compile("", &MemoryAssets::default()).unwrap_err().to_string();
        assert!(e.starts_with("shading.anthocyanin_ug_per_cm2"), "{e}");
    }
}

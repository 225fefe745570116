//! The tissue of a petal: what lies between its two surfaces.
//!
//! Model: from the adaxial side down, each layer may be missing:
//!
//! ```text
//!  air
//!  adaxial epidermis   domes (CellField) on columns of depth d, one per cell; wall n_w, thin; vacuole n_v, pigment
//!  palisade            turbid slab: n, mu_s, g, pigment
//!  spongy              turbid slab: n, mu_s, g, pigment
//!  abaxial epidermis   as the adaxial one, turned over
//!  air
//! ```
//!
//! The four layers are the four [`REGIONS`] in which light can be absorbed. The depth of a region is its volume per
//! area of petal: `d` plus the mean height of the domes, or the slab's thickness; an amount per area over that
//! depth is a concentration.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | d | `depth_um` | um | 20 |
//! | n_w | `wall_index` | | 1.425 (mean of four leaf genera, Applied Optics 13:109, 1974) |
//! | n_v | `vacuole_index` | | 1.35 (vacuoles and cytoplasm 1.34 to 1.36; our reading) |
//! | alpha | `roughness` | | 0 |
//! | thickness | `thickness_um` | um | |
//! | n | `index` | | 1.35 (cells touch the epidermis without air; our reading) |
//! | mu_s | `scattering_per_mm` | 1/mm | |
//! | g | `anisotropy` | | |
//! | mu_0 | `absorption_per_mm` | 1/mm | 0: the pigments absorb alone |
//!
//! Absorption of a region is `mu_0` (of all wavelengths alike: a made slab, a grey filter) plus that of its pigments.
//!
//! Limits: indices 1 to 3, at least one layer (`contradictions_are_named`).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{CellDescription, CellField};
use crate::spectrum::Pigments;
use crate::{Error, Result};

/// Number of regions in which light can be absorbed: adaxial epidermis, palisade, spongy, abaxial epidermis.
pub const REGIONS: usize = 4;
/// Names of the regions, as the file's keys have them.
pub const REGION_NAMES: [&str; REGIONS] = ["adaxial", "palisade", "spongy", "abaxial"];
/// Reduced scattering optical depth `mu_s (1 - g) thickness` that a slab may have: light in a thicker one would hardly
/// leave.
const MAX_REDUCED_DEPTH: f64 = 1e4;

/// `[tissue]`: the layers of a petal. A layer that is not given does not exist.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TissueDescription {
    /// Upper epidermis; its domes are the petal's `[cells]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adaxial: Option<EpidermisDescription>,
    /// Upright cells below it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub palisade: Option<SlabDescription>,
    /// Loose cells with air between them: sends much of the light back.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spongy: Option<SlabDescription>,
    /// Lower epidermis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub abaxial: Option<EpidermisDescription>,
}

/// One epidermis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EpidermisDescription {
    /// Cells of the lower epidermis (`tissue.abaxial.cells`). Default: flat cells of the petal's pitch. Not allowed
    /// in `tissue.adaxial`, whose cells are the petal's `[cells]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells: Option<CellDescription>,
    /// Depth of the cells below the plane that carries the domes, um, 0.1 to 1000. Default 20.
    pub depth_um: f64,
    /// Refractive index of the cell wall, 1 to 3. Default 1.425.
    pub wall_index: f64,
    /// Refractive index of what fills the cell, 1 to 3. Default 1.35.
    pub vacuole_index: f64,
    /// Striations of the outer wall: Beckmann's alpha (root mean square slope times sqrt 2) of a microfacet surface,
    /// 0 to 1. Default 0: smooth.
    pub roughness: f64,
    /// Absorption coefficient of all wavelengths alike, beside the pigments', 1/mm, 0 to 1e5. Default 0.
    pub absorption_per_mm: f64,
    /// Pigments in the vacuoles.
    pub pigments: Pigments,
}

impl Default for EpidermisDescription {
    fn default() -> Self {
        Self {
            cells: None,
            depth_um: 20.0,
            wall_index: 1.425,
            vacuole_index: 1.35,
            roughness: 0.0,
            absorption_per_mm: 0.0,
            pigments: Pigments::default(),
        }
    }
}

/// One turbid layer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SlabDescription {
    /// Thickness, um, more than 0, at most 1e6.
    pub thickness_um: f64,
    /// Effective refractive index, 1 to 3. Default 1.35.
    #[serde(default = "default_index")]
    pub index: f64,
    /// Scattering coefficient, 1/mm, 0 to 1e5.
    pub scattering_per_mm: f64,
    /// Mean cosine of the scattering angle (Henyey-Greenstein), -0.99 to 0.99.
    pub anisotropy: f64,
    /// Absorption coefficient of all wavelengths alike, beside the pigments', 1/mm, 0 to 1e5. Default 0.
    #[serde(default)]
    pub absorption_per_mm: f64,
    /// Pigments in the layer. Default none.
    #[serde(default)]
    pub pigments: Pigments,
}

fn default_index() -> f64 {
    1.35
}

/// An epidermis, ready for light.
#[derive(Clone, Debug)]
pub struct Epidermis {
    /// Domes and columns; +z away from the petal's middle.
    pub cells: CellField,
    /// See [`EpidermisDescription`].
    pub depth_um: f64,
    /// See [`EpidermisDescription`].
    pub wall_index: f64,
    /// See [`EpidermisDescription`].
    pub vacuole_index: f64,
    /// See [`EpidermisDescription`].
    pub roughness: f64,
}

/// A turbid slab, ready for light.
#[derive(Clone, Debug)]
pub struct Slab {
    /// Region of [`REGION_NAMES`].
    pub region: usize,
    /// Thickness, um.
    pub thickness_um: f64,
    /// Refractive index.
    pub index: f64,
    /// Scattering coefficient, 1/um.
    pub scattering_per_um: f64,
    /// Mean cosine g.
    pub anisotropy: f64,
}

/// The layers of a petal, checked and built.
#[derive(Clone, Debug)]
pub struct Tissue {
    /// Upper epidermis.
    pub adaxial: Option<Epidermis>,
    /// Turbid slabs from the top down; none, palisade, spongy, or both.
    pub slabs: Vec<Slab>,
    /// Lower epidermis; its frame is turned over about the x axis.
    pub abaxial: Option<Epidermis>,
    /// Volume per area of each region, um; zero where it does not exist.
    pub depth_um: [f64; REGIONS],
    /// Absorption coefficient of each region beside its pigments', 1/um.
    pub grey_per_um: [f64; REGIONS],
    /// Pigments of each region.
    pub pigments: [Pigments; REGIONS],
}

impl Tissue {
    /// Checks and builds the layers. Errors name the key below `at` (`tissue`) or `cells`.
    pub fn new(description: &TissueDescription, cells: &CellDescription, at: &str) -> Result<Self> {
        let d = description;
        if d.adaxial.is_none() && d.palisade.is_none() && d.spongy.is_none() && d.abaxial.is_none() {
            return Err(Error::invalid(
                at,
                "has no layer: give at least one of adaxial, palisade, spongy, abaxial",
            ));
        }
        let adaxial = match &d.adaxial {
            None => None,
            Some(e) if e.cells.is_some() => {
                let what =
                    format!("the upper epidermis' cells are the petal's [cells], not {at}.adaxial.cells");
                return Err(Error::invalid(format!("{at}.adaxial.cells"), what));
            }
            Some(e) => Some(Epidermis::new(e, cells, "cells", &format!("{at}.adaxial"))?),
        };
        let key = format!("{at}.abaxial");
        let abaxial = match &d.abaxial {
            None => None,
            Some(e) => {
                let flat = CellDescription { profile: super::Profile::Flat, height_um: 0.0, ..cells.clone() };
                let cells = e.cells.as_ref().unwrap_or(&flat);
                Some(Epidermis::new(e, cells, &format!("{key}.cells"), &key)?)
            }
        };
        let mut slabs = Vec::new();
        for (region, slab) in [(1, &d.palisade), (2, &d.spongy)] {
            if let Some(slab) = slab {
                slabs.push(Slab::new(slab, region, &format!("{at}.{}", REGION_NAMES[region]))?);
            }
        }
        let mut depth_um = [0.0; REGIONS];
        for slab in &slabs {
            depth_um[slab.region] = slab.thickness_um;
        }
        for (region, epidermis) in [(0, &adaxial), (3, &abaxial)] {
            depth_um[region] = epidermis.as_ref().map_or(0.0, Epidermis::volume_per_area_um);
        }
        let none = Pigments::default();
        let of = |e: &Option<EpidermisDescription>| e.as_ref().map_or(none.clone(), |e| e.pigments.clone());
        let slab = |s: &Option<SlabDescription>| s.as_ref().map_or(none.clone(), |s| s.pigments.clone());
        let pigments = [of(&d.adaxial), slab(&d.palisade), slab(&d.spongy), of(&d.abaxial)];
        for (p, name) in pigments.iter().zip(REGION_NAMES) {
            p.validate(&format!("{at}.{name}.pigments"))?;
        }
        let of = |e: &Option<EpidermisDescription>| e.as_ref().map_or(0.0, |e| e.absorption_per_mm);
        let slab = |s: &Option<SlabDescription>| s.as_ref().map_or(0.0, |s| s.absorption_per_mm);
        let grey_per_mm = [of(&d.adaxial), slab(&d.palisade), slab(&d.spongy), of(&d.abaxial)];
        for (mu, name) in grey_per_mm.iter().zip(REGION_NAMES) {
            within(&format!("{at}.{name}"), "absorption_per_mm", *mu, 0.0, 1e5, " 1/mm")?;
        }
        let grey_per_um = grey_per_mm.map(|mu| mu * 1e-3);
        Ok(Self { adaxial, slabs, abaxial, depth_um, grey_per_um, pigments })
    }

    /// Absorption coefficients of the regions at one wavelength, 1/um. Errors where a pigment has no data there.
    pub fn absorption_per_um(&self, wavelength_nm: f64) -> Result<[f64; REGIONS]> {
        let mut mu = self.grey_per_um;
        for (r, mu) in mu.iter_mut().enumerate() {
            if self.depth_um[r] > 0.0 {
                *mu += self.pigments[r].absorption_per_um(self.depth_um[r], wavelength_nm)?;
            }
        }
        Ok(mu)
    }
}

fn within(at: &str, key: &str, value: f64, low: f64, high: f64, unit: &str) -> Result<()> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(Error::invalid(format!("{at}.{key}"), format!("{value} is not within {low} to {high}{unit}")))
}

impl Epidermis {
    fn new(d: &EpidermisDescription, cells: &CellDescription, cells_at: &str, at: &str) -> Result<Self> {
        within(at, "depth_um", d.depth_um, 0.1, 1000.0, " um")?;
        within(at, "wall_index", d.wall_index, 1.0, 3.0, "")?;
        within(at, "vacuole_index", d.vacuole_index, 1.0, 3.0, "")?;
        within(at, "roughness", d.roughness, 0.0, 1.0, "")?;
        cells.validate(cells_at)?;
        Ok(Self {
            cells: CellField::new(cells)?,
            depth_um: d.depth_um,
            wall_index: d.wall_index,
            vacuole_index: d.vacuole_index,
            roughness: d.roughness,
        })
    }

    /// Mean over the tile of the height over the base plane, plus the depth, um. The mean of the domes is found on a
    /// grid of 64 x 64 points per cell.
    fn volume_per_area_um(&self) -> f64 {
        let tile = self.cells.tile_um();
        let pitch = self.cells.description().pitch_um;
        let n = (tile / pitch * 64.0).ceil().as_uvec2().min(glam::UVec2::splat(1024));
        let mut sum = 0.0;
        for j in 0..n.y {
            for i in 0..n.x {
                let u = glam::DVec2::new(f64::from(i) + 0.5, f64::from(j) + 0.5) / n.as_dvec2();
                sum += self.cells.height_at_um(u * tile);
            }
        }
        self.depth_um + sum / f64::from(n.x * n.y)
    }
}

impl Slab {
    fn new(d: &SlabDescription, region: usize, at: &str) -> Result<Self> {
        if !(d.thickness_um > 0.0 && d.thickness_um <= 1e6) {
            let what = format!(
                "{} um: a layer is thicker than 0 and at most 1e6 um; leave it out if it does not exist",
                d.thickness_um
            );
            return Err(Error::invalid(format!("{at}.thickness_um"), what));
        }
        within(at, "index", d.index, 1.0, 3.0, "")?;
        within(at, "scattering_per_mm", d.scattering_per_mm, 0.0, 1e5, " 1/mm")?;
        within(at, "anisotropy", d.anisotropy, -0.99, 0.99, "")?;
        let depth = d.scattering_per_mm * 1e-3 * d.thickness_um * (1.0 - d.anisotropy);
        if depth > MAX_REDUCED_DEPTH {
            let what = format!(
                "scattering_per_mm, anisotropy and thickness_um make {depth:.3e} transport mean free paths; at most {MAX_REDUCED_DEPTH:e}, \
                 or light would hardly leave"
            );
            return Err(Error::invalid(at, what));
        }
        Ok(Self {
            region,
            thickness_um: d.thickness_um,
            index: d.index,
            scattering_per_um: d.scattering_per_mm * 1e-3,
            anisotropy: d.anisotropy,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn build(text: &str) -> Result<Tissue> {
        let d: TissueDescription = toml::from_str(text).expect("parses");
        Tissue::new(&d, &CellDescription::default(), "tissue")
    }

    #[test]
    fn contradictions_are_named() {
        for (text, key) in [
            ("", "tissue: has no layer"),
            (
                "[spongy]\nthickness_um = 0.0\nscattering_per_mm = 10.0\nanisotropy = 0.5",
                "tissue.spongy.thickness_um",
            ),
            (
                "[spongy]\nthickness_um = inf\nscattering_per_mm = 10.0\nanisotropy = 0.5",
                "tissue.spongy.thickness_um",
            ),
            (
                "[spongy]\nthickness_um = 100.0\nindex = 0.9\nscattering_per_mm = 10.0\nanisotropy = 0.5",
                "tissue.spongy.index",
            ),
            (
                "[palisade]\nthickness_um = 1e6\nscattering_per_mm = 1e5\nanisotropy = 0.0",
                "tissue.palisade: ",
            ),
            (
                "[palisade]\nthickness_um = 10.0\nscattering_per_mm = nan\nanisotropy = 0.0",
                "tissue.palisade.scattering_per_mm",
            ),
            ("[adaxial]\nwall_index = 0.5", "tissue.adaxial.wall_index"),
            ("[adaxial]\ndepth_um = 0.0", "tissue.adaxial.depth_um"),
            ("[adaxial.cells]\npitch_um = 23.0", "tissue.adaxial.cells"),
            ("[abaxial.cells]\npitch_um = -1.0", "tissue.abaxial.cells.pitch_um"),
            ("[abaxial]\nroughness = 2.0", "tissue.abaxial.roughness"),
            ("[abaxial]\nabsorption_per_mm = -1.0", "tissue.abaxial.absorption_per_mm"),
            (
                "[spongy]\nthickness_um = 9.0\nscattering_per_mm = 1.0\nanisotropy = 0.0\nabsorption_per_mm = nan",
                "tissue.spongy.absorption_per_mm",
            ),
            (
                "[abaxial.pigments]\nanthocyanin_ug_per_cm2 = -3.0",
                "tissue.abaxial.pigments.anthocyanin_ug_per_cm2",
            ),
        ] {
            let error = build(text).expect_err(text).to_string();
            assert!(error.starts_with(key), "{text}: {error}");
        }
    }

    #[test]
    fn depth_is_volume_per_area() {
        // Cosine dome over a hexagon: integrate h over the cell by polar quadrature of a fine raster of our own.
        let t = build("[adaxial]\ndepth_um = 12.0\n[abaxial]\ndepth_um = 9.0").expect("valid");
        let (r, pitch) = (23.0 / 3f64.sqrt(), 23.0);
        let n = 800;
        let (mut sum, mut count) = (0.0, 0.0);
        for i in 0..n {
            for j in 0..n {
                let p = glam::DVec2::new(
                    (f64::from(i) + 0.5) / f64::from(n) - 0.5,
                    (f64::from(j) + 0.5) / f64::from(n) - 0.5,
                ) * 2.0
                    * r;
                let inside = (0..3).all(|k| {
                    let a = f64::from(k) * std::f64::consts::FRAC_PI_3;
                    p.dot(glam::DVec2::from_angle(a)).abs() <= pitch / 2.0
                });
                if inside {
                    count += 1.0;
                    sum += 37.0 * (std::f64::consts::FRAC_PI_2 * (p.length() / r).min(1.0)).cos();
                }
            }
        }
        assert!((t.depth_um[0] - 12.0 - sum / count).abs() < 0.05, "{} {}", t.depth_um[0], sum / count);
        assert_eq!((t.depth_um[1], t.depth_um[2], t.depth_um[3]), (0.0, 0.0, 9.0));
        let mu = t.absorption_per_um(550.0).expect("known");
        assert_eq!(mu, [0.0; REGIONS]);
    }

    #[test]
    fn grey_absorption_adds_to_the_pigments() {
        let slab = "[spongy]\nthickness_um = 100.0\nscattering_per_mm = 1.0\nanisotropy = 0.0\n";
        let mu = |text: &str| build(text).and_then(|t| t.absorption_per_um(540.0)).expect("known");
        let pigment = "[adaxial]\npigments = { anthocyanin_ug_per_cm2 = 5.0 }\n";
        let without = mu(&format!("{pigment}{slab}"));
        let with =
            mu(&format!("{pigment}absorption_per_mm = 3.0\n{slab}absorption_per_mm = 7.0\n[abaxial]\n"));
        assert!(without[0] > 0.0 && without[2] == 0.0);
        assert!((with[0] - without[0] - 0.003).abs() < 1e-12, "{with:?} {without:?}");
        assert_eq!(with[1..], [0.0, 0.007, 0.0]);
    }
}

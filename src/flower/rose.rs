//! The description of a rose and the rose that grows from it.
//!
//! | | value | published | source |
//! |---|---|---|---|
//! | petals, hybrid tea and cupped | 35, 45 | full 26-40, very full 41 and more | classes of the American Rose Society |
//! | petals, wild | 5, 25 mm long | 5, 15-30 mm long | *R. canina*: Gleason and Cronquist, Manual of Vascular Plants, 1991 |
//! | width, wild | 30-60 mm | 30-60 mm | *R. canina*: Flora of the Burren |
//! | width, hybrid tea | 80-130 mm | 75-135 mm | growers' descriptions |
//! | divergence, many petals; five | 137.5; 144 deg | the golden angle; 2/5 of a turn | [`crate::flower::phyllotaxis`] |
//!
//! Thickness lies in the tissue (`data/petals`: 0.17 mm) and its pattern ([`crate::scene::Pattern`]). Sizes of a hybrid tea's single
//! petals are our reading. Guarded by `sizes_are_those_of_garden_roses`, `petals_are_as_many_and_as_long_as_published`.

use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::flower::bloom::{BloomDescription, OVERBLOWN};
use crate::flower::leaf::LeafDescription;
use crate::flower::petal_description::PetalDescription;
use crate::flower::phyllotaxis::GOLDEN_ANGLE_DEG;
use crate::flower::prickle::PrickleDescription;
use crate::flower::sepal::SepalDescription;
use crate::flower::stamens::StamenDescription;
use crate::flower::stem::StemDescription;
use crate::{Error, Result};

/// A rose. Every key has a default: the preset `hybrid_tea`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RoseDescription {
    /// Seed of all that differs between two flowers of one kind (default 1).
    pub seed: u64,
    /// Number of petals (default 35).
    pub petals: u32,
    /// Angle from one petal to the next, deg (default 137.50776, the golden angle).
    pub divergence_deg: f64,
    /// How far the flower has opened: 0 = bud, 1 = bloom, 1.3 = overblown (default 1).
    pub openness: f64,
    /// Size of the seeded differences between petals: 0 = none, 1 = natural (default 1).
    pub irregularity: f64,
    /// Fineness of the meshes: 1 = about 100 000 triangles; triangles grow with its square (default 1).
    pub detail: f64,
    /// Shape of the petals.
    pub petal: PetalDescription,
    /// How the petals open.
    pub bloom: BloomDescription,
    /// Sepals.
    pub sepals: SepalDescription,
    /// Stamens and styles.
    pub stamens: StamenDescription,
    /// Leaves.
    pub leaves: LeafDescription,
    /// Prickles.
    pub prickles: PrickleDescription,
    /// Receptacle and stem.
    pub stem: StemDescription,
}

impl Default for RoseDescription {
    fn default() -> Self {
        Self::hybrid_tea()
    }
}

impl RoseDescription {
    /// Names of the presets, for help texts and schemas.
    pub const PRESETS: [&str; 3] = ["hybrid_tea", "cupped", "wild"];

    /// The florist's rose in bloom: a high closed centre, outer petals that open and roll back.
    pub fn hybrid_tea() -> Self {
        Self {
            seed: 1,
            petals: 35,
            divergence_deg: GOLDEN_ANGLE_DEG,
            openness: 1.0,
            irregularity: 1.0,
            detail: 1.0,
            petal: PetalDescription::default(),
            bloom: BloomDescription::default(),
            sepals: SepalDescription::default(),
            stamens: StamenDescription::default(),
            leaves: LeafDescription::default(),
            prickles: PrickleDescription::default(),
            stem: StemDescription::default(),
        }
    }

    /// An old garden rose: a deep cup, many petals, round rims.
    pub fn cupped() -> Self {
        let mut d = Self::hybrid_tea();
        d.petals = 45;
        d.petal.inner_length_mm = 34.0;
        d.petal.length_mm = 44.0;
        d.petal.tip_mm = -1.5;
        d.petal.roll_outer_deg = 60.0;
        d.petal.facets = 1.0;
        d.petal.cup_outer_mm = 2.0;
        d.petal.ruffle_mm = 2.0;
        d.bloom.inner_deg = -8.0;
        d.bloom.outer_deg = 52.0;
        d.bloom.power = 1.4;
        d.bloom.bud_deg = -3.0;
        d.bloom.bud_base_deg = 56.0;
        d.bloom.reflex_inner_deg = 10.0;
        d.bloom.reflex_outer_deg = 14.0;
        d
    }

    /// A wild rose: five notched petals, wide open.
    pub fn wild() -> Self {
        let mut d = Self::hybrid_tea();
        d.petals = 5;
        d.divergence_deg = 144.0;
        d.petal.inner_length_mm = 25.0;
        d.petal.length_mm = 25.0;
        d.petal.inner_width_mm = 27.0;
        d.petal.width_mm = 27.0;
        d.petal.claw_width_mm = 6.0;
        d.petal.widest = 0.7;
        d.petal.tip_mm = -5.0;
        d.petal.facets = 1.0;
        d.petal.cup_outer_mm = 2.5;
        d.petal.roll_inner_deg = 20.0;
        d.petal.roll_outer_deg = 20.0;
        d.petal.roll_width_mm = 6.0;
        d.bloom.inner_deg = 72.0;
        d.bloom.outer_deg = 76.0;
        d.bloom.base_inner_deg = 60.0;
        d.bloom.base_outer_deg = 64.0;
        d.bloom.reflex_inner_deg = 0.0;
        d.bloom.bud_deg = -4.0;
        d.bloom.bud_base_deg = 62.0;
        d.bloom.reflex_outer_deg = 10.0;
        d.stem.receptacle_radius_mm = 3.4;
        d.stem.receptacle_height_mm = 9.0;
        d.stem.radius_mm = 1.5;
        d.sepals.length_mm = 22.0;
        d.sepals.width_mm = 6.0;
        d.sepals.lobe_mm = 7.0;
        d.leaves.leaflets = 7;
        d.leaves.length_mm = 30.0;
        d.leaves.width_mm = 19.0;
        d.leaves.petiole_mm = 18.0;
        d.leaves.spacing_mm = 17.5;
        d.leaves.first_mm = 35.0;
        d.prickles.length_mm = 5.0;
        d.prickles.base_mm = 5.5;
        d.prickles.base_width_mm = 1.8;
        d
    }

    /// Names of fineness: for looking at a flower, and for a finished picture.
    pub const DETAILS: [(&str, f64); 2] = [("preview", 0.5), ("final", 8.0)];

    /// Checks every key; `at` is the dotted path of this table ("rose", or "").
    pub fn validate(&self, at: &str) -> Result<()> {
        check(at, "petals", f64::from(self.petals), 1.0, 400.0)?;
        check(at, "divergence_deg", self.divergence_deg, -360.0, 360.0)?;
        check(at, "openness", self.openness, 0.0, OVERBLOWN)?;
        check(at, "irregularity", self.irregularity, 0.0, 3.0)?;
        check(at, "detail", self.detail, 0.1, 20.0)?;
        let sub = |key: &str| if at.is_empty() { key.to_owned() } else { format!("{at}.{key}") };
        self.petal.validate(&sub("petal"))?;
        self.bloom.validate(&sub("bloom"))?;
        self.sepals.validate(&sub("sepals"))?;
        self.stamens.validate(&sub("stamens"))?;
        self.leaves.validate(&sub("leaves"))?;
        self.prickles.validate(&sub("prickles"))?;
        self.stem.validate(&sub("stem"))
    }
}

impl FromStr for RoseDescription {
    type Err = Error;

    /// The preset of that name.
    fn from_str(name: &str) -> Result<Self> {
        match name {
            "hybrid_tea" => Ok(Self::hybrid_tea()),
            "cupped" => Ok(Self::cupped()),
            "wild" => Ok(Self::wild()),
            _ => Err(Error::invalid(
                "preset",
                format!("no rose is called `{name}`; presets are {}", Self::PRESETS.join(", ")),
            )),
        }
    }
}

/// Checks that a value is a number from `low` to `high`.
pub(crate) fn check(at: &str, key: &str, value: f64, low: f64, high: f64) -> Result<()> {
    if value >= low && value <= high {
        return Ok(());
    }
    let at = if at.is_empty() { key.to_owned() } else { format!("{at}.{key}") };
    Err(Error::invalid(at, format!("{value} is not between {low} and {high}")))
}

/// Checks that a value is a part of the whole, neither nothing nor all.
pub(crate) fn check_unit_open(at: &str, key: &str, value: f64) -> Result<()> {
    check(at, key, value, 0.01, 0.99)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::flower::crossings::crossings;
    use crate::flower::{Flower, Organ, OrganKind, grow};

    fn preset(name: &str) -> RoseDescription {
        name.parse().expect("a preset")
    }

    /// Largest extent of the petals across the axis, mm.
    fn diameter_mm(f: &Flower) -> f32 {
        2.0 * f
            .of_kind(OrganKind::Petal)
            .flat_map(|o| &o.mesh.positions)
            .map(|p| p.truncate().length())
            .fold(0.0, f32::max)
    }

    #[test]
    fn same_description_same_rose() {
        let d = RoseDescription { detail: 0.4, ..Default::default() };
        let again = RoseDescription { seed: 2, ..d.clone() };
        assert_eq!(grow(&d).expect("grows"), grow(&d).expect("grows"));
        assert_ne!(grow(&d).expect("grows"), grow(&again).expect("grows"));
    }

    #[test]
    fn presets_grow_sound_meshes() {
        for name in RoseDescription::PRESETS {
            let d = preset(name);
            let flower = grow(&d).expect("grows");
            assert_eq!(flower.of_kind(OrganKind::Petal).count(), d.petals as usize);
            assert_eq!(flower.of_kind(OrganKind::Sepal).count(), 5);
            for o in &flower.organs {
                let at = format!("{name} {:?} {}", o.kind, o.index);
                o.mesh.validate(&at).expect("valid");
                assert_eq!(o.mesh.normals.len(), o.mesh.positions.len(), "{at}");
                assert!(o.mesh.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-4), "{at}");
                assert!(
                    o.mesh.uvs.iter().all(|t| t.min_element() >= -1e-4 && t.max_element() <= 1.0001),
                    "{at}"
                );
                for f in 0..o.mesh.triangles.len() {
                    assert!(o.mesh.face_area(f) > 1e-5, "{at}: face {f} has area {}", o.mesh.face_area(f));
                }
            }
        }
        let triangles = grow(&preset("hybrid_tea")).expect("grows").triangle_count();
        assert!((20_000..=140_000).contains(&triangles), "{triangles}");
    }

    #[test]
    fn sizes_are_those_of_garden_roses() {
        for seed in 0..4 {
            let d = RoseDescription { seed, detail: 0.5, ..preset("hybrid_tea") };
            let mm = diameter_mm(&grow(&d).expect("grows"));
            assert!((80.0..=130.0).contains(&mm), "hybrid tea {seed}: {mm} mm");
            let mm = diameter_mm(&grow(&RoseDescription { seed, ..preset("wild") }).expect("grows"));
            assert!((30.0..=60.0).contains(&mm), "wild rose {seed}: {mm} mm");
        }
    }

    #[test]
    fn petals_are_as_many_and_as_long_as_published() {
        let petals = |name: &str| preset(name).petals;
        assert!((26..=50).contains(&petals("hybrid_tea")) && (26..=150).contains(&petals("cupped")));
        assert_eq!(petals("wild"), 5);
        let wild = preset("wild").petal;
        for mm in [wild.inner_length_mm, wild.length_mm] {
            assert!((15.0..=30.0).contains(&mm), "{mm}");
        }
        // Five petals stand two fifths of a turn apart.
        for (name, deg) in [("hybrid_tea", GOLDEN_ANGLE_DEG), ("cupped", GOLDEN_ANGLE_DEG), ("wild", 144.0)] {
            assert!((preset(name).divergence_deg - deg).abs() < 0.01, "{name}");
        }
    }

    #[test]
    fn petals_stand_at_the_divergence_angle() {
        let d = RoseDescription { irregularity: 0.0, detail: 0.5, ..preset("hybrid_tea") };
        let flower = grow(&d).expect("grows");
        let azimuth = |o: &Organ| {
            // The middle of the rim.
            let tip = o
                .mesh
                .uvs
                .iter()
                .zip(&o.mesh.positions)
                .filter(|(t, _)| (t.x - 0.5).abs() < 1e-4)
                .map(|(_, p)| *p)
                .next_back()
                .unwrap_or(Vec3::ZERO);
            f64::from(tip.y.atan2(tip.x)).to_degrees()
        };
        let petals: Vec<_> = flower.of_kind(OrganKind::Petal).map(azimuth).collect();
        for pair in petals[8..].windows(2) {
            let turn = (pair[1] - pair[0]).rem_euclid(360.0);
            assert!((turn - GOLDEN_ANGLE_DEG).abs() < 2.0, "{turn}");
        }
    }

    #[test]
    fn normals_point_to_the_axis_and_up() {
        for name in RoseDescription::PRESETS {
            for o in grow(&preset(name)).expect("grows").of_kind(OrganKind::Petal) {
                let mean: f32 = o
                    .mesh
                    .positions
                    .iter()
                    .zip(&o.mesh.normals)
                    .map(|(p, n)| n.dot(Vec3::new(-p.x, -p.y, 0.0).normalize_or_zero() + Vec3::Z))
                    .sum::<f32>()
                    / o.mesh.positions.len() as f32;
                assert!(mean > 0.2, "{name} petal {}: {mean}", o.index);
            }
        }
    }

    #[test]
    fn petals_do_not_cross() {
        // `tests/flowers.rs` has all presets, 20 seeds and six stages.
        for (name, openness, seed) in
            [("hybrid_tea", 0.0, 1), ("hybrid_tea", 1.0, 2), ("cupped", 0.5, 3), ("wild", 1.3, 4)]
        {
            let mut flower =
                grow(&RoseDescription { openness, seed, detail: 0.6, ..preset(name) }).expect("grows");
            flower.organs.retain(|o| o.kind == OrganKind::Petal);
            let report = crossings(&flower);
            assert_eq!(report.total(), 0, "{name} {openness} {seed}: {report}");
        }
    }

    #[test]
    fn bad_descriptions_are_refused() {
        type Spoil = fn(&mut RoseDescription);
        let bad: [(&str, Spoil); 10] = [
            ("rose.openness", |d| d.openness = 1.4),
            ("rose.petal.facets", |d| d.petal.facets = 0.0),
            ("rose.petals", |d| d.petals = 0),
            ("rose.detail", |d| d.detail = 0.0),
            ("rose.divergence_deg", |d| d.divergence_deg = f64::INFINITY),
            ("rose.petal.length_mm", |d| d.petal.length_mm = -4.0),
            ("rose.petal.widest", |d| d.petal.widest = f64::NAN),
            ("rose.bloom.outer_deg", |d| d.bloom.outer_deg = -80.0),
            ("rose.sepals.width_mm", |d| d.sepals.width_mm = 0.0),
            ("rose.stem.radius_mm", |d| d.stem.radius_mm = f64::NAN),
        ];
        for (key, spoil) in bad {
            let mut d = RoseDescription::default();
            spoil(&mut d);
            let error = grow(&d).expect_err(key).to_string();
            assert!(error.starts_with(&format!("{key}: ")), "{error}");
        }
        assert!("peony".parse::<RoseDescription>().is_err());
    }

    #[test]
    fn text_round_trip_and_unknown_keys() {
        let d = preset("cupped");
        let text = toml::to_string(&d).expect("writes");
        assert_eq!(toml::from_str::<RoseDescription>(&text).expect("reads"), d);
        assert_eq!(toml::from_str::<RoseDescription>("").expect("reads"), RoseDescription::default());
        assert!(toml::from_str::<RoseDescription>("petal.lenght_mm = 3").is_err());
    }
}

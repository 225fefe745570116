//! The space in which petals lie: a family of nested cups, one layer per petal, that opens.
//!
//! Model: layer t (0 innermost, larger is further out, any real number) is a surface of revolution. Its
//! meridian is a curve of arc length s from the receptacle, given by its heading: the angle from the axis,
//! 0 = straight up, positive = outwards, more than 90 = down. Each part of the heading goes from its value in the
//! bud to its value in bloom, in outer layers first, and on to the overblown flower.
//!
//! Equation, with age a = t / layers, sigma = s / length(a), openness o:
//! heading = opening + (base - opening) max(0, 1 - sigma / claw)^2 + reflex max(0, (sigma - hinge) / (1 - hinge))^1.5
//! opening = closed + (open - closed) S, closed = bud sqrt(a), open = inner + (outer - inner) a^p;
//! base and reflex likewise with their own ends and powers;
//! S(a, o) = smooth step from 0 to 1 of o - lag (1 - a) (1 - o), lag = 0.6;
//! beyond o = 1 the ends of `open` and `reflex` grow in proportion to o - 1;
//! r(s) = r0 + int sin(heading) ds, z(s) = z0 + int cos(heading) ds.
//!
//! Of two layers the outer has the larger heading at every s and starts further out, so the vector between
//! them always turns to the outside and the cups do not meet. Guarded by `cups_are_nested`.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | opening | `inner_deg`, `outer_deg`, `power` | deg, deg, - | see [`BloomDescription`] |
//! | base | `base_inner_deg`, `base_outer_deg` | deg | |
//! | reflex, hinge | `reflex_inner_deg`, `reflex_outer_deg`, `hinge` | deg, deg, - | |
//! | claw | `claw` | - | |
//! | bud | `bud_deg`, `bud_base_deg` | deg | |
//!
//! Our reading of photographs of hybrid tea roses; no measured petal attitudes are published.

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::flower::phyllotaxis::vary;
use crate::flower::rose::{check, check_unit_open};

/// How the petals open from the centre out. Angles are from the axis of the flower.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BloomDescription {
    /// Attitude of the innermost petals, deg; negative leans over the centre (default -14).
    pub inner_deg: f64,
    /// Attitude of the outermost petals, deg (default 80).
    pub outer_deg: f64,
    /// How late the flower opens on the way out: 1 = evenly, larger = a larger closed centre (default 2.4).
    pub power: f64,
    /// Attitude at the base of the innermost petals, deg (default 22).
    pub base_inner_deg: f64,
    /// Attitude at the base of the outermost petals, deg (default 88).
    pub base_outer_deg: f64,
    /// Part of the length over which the attitude at the base turns into the one of the blade (default 0.6).
    pub claw: f64,
    /// Bending back of the innermost rims, deg (default 6).
    pub reflex_inner_deg: f64,
    /// Bending back of the outermost rims, deg (default 78).
    pub reflex_outer_deg: f64,
    /// Part of the length where the bending back starts (default 0.54).
    pub hinge: f64,
    /// Attitude of the outermost petals in the bud, deg; negative leans over the centre (default -10). The
    /// innermost stand upright.
    pub bud_deg: f64,
    /// Attitude at the base of the outermost petals in the bud, deg (default 52).
    pub bud_base_deg: f64,
    /// Radius of the roll that the innermost petal forms, mm (default 1.6).
    pub heart_radius_mm: f64,
    /// Layers that a petal climbs per radian of its width, so that one margin lies inside its neighbour and
    /// the other outside (default 0.16).
    pub overlap: f64,
}

impl Default for BloomDescription {
    fn default() -> Self {
        Self {
            inner_deg: -14.0,
            outer_deg: 80.0,
            power: 2.4,
            base_inner_deg: 22.0,
            base_outer_deg: 88.0,
            claw: 0.6,
            reflex_inner_deg: 6.0,
            reflex_outer_deg: 78.0,
            hinge: 0.54,
            bud_deg: -10.0,
            bud_base_deg: 52.0,
            heart_radius_mm: 1.6,
            overlap: 0.16,
        }
    }
}

impl BloomDescription {
    /// Checks every key; `at` is the dotted path of this table.
    pub fn validate(&self, at: &str) -> Result<()> {
        check(at, "inner_deg", self.inner_deg, -45.0, 120.0)?;
        check(at, "outer_deg", self.outer_deg, self.inner_deg, 150.0)?;
        check(at, "power", self.power, 0.2, 10.0)?;
        check(at, "base_inner_deg", self.base_inner_deg, -45.0, 120.0)?;
        check(at, "base_outer_deg", self.base_outer_deg, self.base_inner_deg, 150.0)?;
        check_unit_open(at, "claw", self.claw)?;
        check(at, "reflex_inner_deg", self.reflex_inner_deg, -90.0, 180.0)?;
        check(at, "reflex_outer_deg", self.reflex_outer_deg, self.reflex_inner_deg, 180.0)?;
        check_unit_open(at, "hinge", self.hinge)?;
        check(at, "bud_deg", self.bud_deg, -45.0, 45.0)?;
        check(at, "bud_base_deg", self.bud_base_deg, 0.0, 90.0)?;
        check(at, "heart_radius_mm", self.heart_radius_mm, 0.2, 50.0)?;
        check(at, "overlap", self.overlap, 0.0, 0.4)
    }
}

/// A point of a meridian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meridian {
    /// Distance from the axis, mm.
    pub r_mm: f64,
    /// Height, mm.
    pub z_mm: f64,
    /// Angle of the curve from the axis, radians.
    pub heading: f64,
}

/// The nested cups of one flower.
#[derive(Clone, Debug)]
pub struct Bloom {
    form: BloomDescription,
    openness: f64,
    layers: f64,
    inner_length_mm: f64,
    length_mm: f64,
    receptacle_radius_mm: f64,
    warp: Vec<Wave>,
}

/// One wave of the smooth map that makes a flower a little irregular: `size_mm sin(k . x + phase)`.
#[derive(Clone, Copy, Debug)]
struct Wave {
    k_per_mm: DVec3,
    size_mm: DVec3,
    phase: f64,
}

/// Petals reach their full length at this age: the centre of a rose is shorter than its middle.
const FULL_LENGTH_AGE: f64 = 0.5;
/// How far the centre is behind the outermost petals when these start to open.
const LAG: f64 = 0.6;
/// Length of petals in the bud, as a part of their length in bloom.
const BUD_SIZE: f64 = 0.68;
/// Openness of an overblown flower.
pub const OVERBLOWN: f64 = 1.3;
/// Waves of the map, and the height over the receptacle at which it has most of its size, mm.
const WAVES: u32 = 6;
const WARP_REACH_MM: f64 = 22.0;

impl Bloom {
    /// Cups for petals of the given lengths in bloom on a receptacle. `openness`: 0 bud, 1 bloom, 1.3 overblown.
    pub fn new(
        form: &BloomDescription,
        petals: u32,
        inner_length_mm: f64,
        length_mm: f64,
        receptacle_radius_mm: f64,
        openness: f64,
    ) -> Self {
        let over = overblown(openness);
        let size = BUD_SIZE + (1.0 - BUD_SIZE) * smooth_step(openness) + 0.03 * over;
        Self {
            form: form.clone(),
            openness,
            // The innermost petal lies on layer 2, so that its inner margin finds layers inside.
            layers: f64::from(petals.max(1)) + 1.0,
            inner_length_mm: size * inner_length_mm,
            length_mm: size * length_mm,
            receptacle_radius_mm,
            warp: Vec::new(),
        }
    }

    /// Makes the cups irregular, all together: a smooth one-to-one map of space (its displacement changes by
    /// less than one mm per mm), under which cups that do not meet still do not meet. `size` 1 is natural.
    /// Guarded by `the_warp_is_one_to_one`.
    pub fn sway(mut self, seed: u64, size: f64) -> Self {
        let v = |k: u32, trait_id: u32| vary(seed, u32::MAX - k, trait_id);
        self.warp = (0..WAVES)
            .map(|k| {
                let direction = DVec3::new(v(k, 0), v(k, 1), 0.6 * v(k, 2)).normalize_or(DVec3::X);
                let wavelength_mm = (75.0 + 30.0 * v(k, 3)) * self.length_mm / 50.0;
                let along = DVec3::new(v(k, 4), v(k, 5), v(k, 6)).normalize_or(DVec3::Z);
                Wave {
                    k_per_mm: direction * (std::f64::consts::TAU / wavelength_mm),
                    // Six waves of this steepness displace by at most 0.13 x 6 mm per mm.
                    size_mm: along * (0.13 * size.min(1.2) * wavelength_mm / std::f64::consts::TAU),
                    phase: std::f64::consts::PI * v(k, 7),
                }
            })
            .collect();
        self
    }

    /// The point of space at cylindrical coordinates of the cups: radius and height in mm, azimuth in radians.
    pub fn place(&self, r_mm: f64, azimuth: f64, z_mm: f64) -> DVec3 {
        let (sin, cos) = azimuth.sin_cos();
        let p = DVec3::new(r_mm * cos, r_mm * sin, z_mm);
        // The receptacle stays where it is.
        let rest = (-p.length_squared() / (WARP_REACH_MM * WARP_REACH_MM)).exp();
        let offset: DVec3 = self.warp.iter().map(|w| w.size_mm * (w.k_per_mm.dot(p) + w.phase).sin()).sum();
        p + (1.0 - rest) * offset
    }

    /// Openness of the flower.
    pub fn openness(&self) -> f64 {
        self.openness
    }

    /// Age of a layer: 0 at the axis, 1 at the outermost petal.
    pub fn age(&self, layer: f64) -> f64 {
        (layer / self.layers).clamp(0.0, 1.2)
    }

    /// How far a layer has opened: S.
    pub fn opened(&self, age: f64) -> f64 {
        smooth_step(self.openness - LAG * (1.0 - age.min(1.0)) * (1.0 - self.openness).max(0.0))
    }

    /// Length of a petal of that age, mm.
    pub fn length_mm(&self, age: f64) -> f64 {
        let x = (age / FULL_LENGTH_AGE).min(1.0);
        self.inner_length_mm + (self.length_mm - self.inner_length_mm) * x * (2.0 - x)
    }

    /// Layers climbed per radian.
    pub fn overlap(&self) -> f64 {
        self.form.overlap
    }

    /// What of the heading depends on the layer only.
    fn attitude(&self, age: f64) -> Attitude {
        let f = &self.form;
        let over = overblown(self.openness);
        let opened = self.opened(age);
        let mix = |bud: f64, bloom: f64| bud + (bloom - bud) * opened;
        let late = age.powf(f.power * (1.0 - 0.3 * over));
        let early = age.powf(0.55);
        let inner = f.inner_deg + over * 26f64.min(0.5 * (f.outer_deg - f.inner_deg));
        let open = inner + (f.outer_deg + 10.0 * over - inner) * late;
        // The cups of the bud are copies of the outermost one at the scale of their radius at the base.
        let start = start(age);
        Attitude {
            opening: mix(f.bud_deg * start, open).to_radians(),
            base: mix(
                f.bud_base_deg * start,
                f.base_inner_deg + (f.base_outer_deg - f.base_inner_deg) * early,
            )
            .to_radians(),
            reflex: (opened
                * opened
                * (f.reflex_inner_deg + (f.reflex_outer_deg + 20.0 * over - f.reflex_inner_deg) * early))
                .to_radians(),
            length_mm: self.length_mm(age),
        }
    }

    /// The point at arc length `s_mm` of a layer.
    pub fn meridian(&self, layer: f64, s_mm: f64) -> Meridian {
        let age = self.age(layer);
        let attitude = self.attitude(age);
        let heading = |s: f64| attitude.heading(s, &self.form);
        let (mut dr, mut dz) = (0.0, 0.0);
        for (x, w) in GAUSS_8 {
            for side in [-1.0, 1.0] {
                let (sin, cos) = heading(0.5 * s_mm * (1.0 + side * x)).sin_cos();
                dr += 0.5 * w * s_mm * sin;
                dz += 0.5 * w * s_mm * cos;
            }
        }
        let start = start(age);
        let r = self.receptacle_radius_mm * start + dr;
        // A smooth floor keeps leaning centre petals off the axis, in order.
        let floor = self.form.heart_radius_mm * (1.6 - 0.9 * (-layer.max(0.0) / 6.0).exp());
        Meridian {
            r_mm: 0.5 * (r + r.hypot(2.0 * floor)),
            z_mm: 0.5 * self.receptacle_radius_mm * (1.0 - start * start) + dz,
            heading: heading(s_mm),
        }
    }

    /// Distance from the cup of `layer` to that of `other`, along the normal at `s_mm`, mm.
    pub fn apart_mm(&self, layer: f64, other: f64, s_mm: f64) -> f64 {
        let (a, b) = (self.meridian(layer, s_mm), self.meridian(other, s_mm));
        let (sin, cos) = a.heading.sin_cos();
        ((b.r_mm - a.r_mm) * cos - (b.z_mm - a.z_mm) * sin).abs()
    }
}

/// The parts of a layer's heading, radians.
struct Attitude {
    opening: f64,
    base: f64,
    reflex: f64,
    length_mm: f64,
}

impl Attitude {
    fn heading(&self, s_mm: f64, form: &BloomDescription) -> f64 {
        let sigma = s_mm / self.length_mm;
        let cup = (1.0 - sigma / form.claw).max(0.0);
        let back = ((sigma - form.hinge) / (1.0 - form.hinge)).max(0.0);
        self.opening + (self.base - self.opening) * cup * cup + self.reflex * back * back.sqrt()
    }
}

/// Radius at which a layer leaves the receptacle, as a part of the receptacle's.
fn start(age: f64) -> f64 {
    age.min(1.0).sqrt()
}

/// 0 up to bloom, 1 at [`OVERBLOWN`], without a kink.
fn overblown(openness: f64) -> f64 {
    let x = ((openness - 1.0) / (OVERBLOWN - 1.0)).max(0.0);
    x * x * (2.0 - x)
}

/// 0 below 0, 1 above 1.
fn smooth_step(x: f64) -> f64 {
    let t = x.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Nodes and weights of 8-point Gauss-Legendre quadrature on [-1, 1], positive half.
const GAUSS_8: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flower::RoseDescription;

    const OPENNESS: [f64; 6] = [0.0, 0.25, 0.5, 0.75, 1.0, OVERBLOWN];

    fn bloom(name: &str) -> ([Bloom; 6], u32) {
        let d: RoseDescription = name.parse().expect("a preset");
        let p = &d.petal;
        let b = |openness| {
            Bloom::new(
                &d.bloom,
                d.petals,
                p.inner_length_mm,
                p.length_mm,
                d.stem.receptacle_radius_mm,
                openness,
            )
        };
        (OPENNESS.map(b), d.petals)
    }

    #[test]
    fn cups_are_nested() {
        for name in RoseDescription::PRESETS {
            let (blooms, petals) = bloom(name);
            for (b, k) in blooms.iter().flat_map(|b| (0..2 * petals).map(move |k| (b, k))) {
                let layer = 0.5 * f64::from(k);
                let points = |layer: f64| {
                    let length = b.length_mm(b.age(layer));
                    (0..=40).map(|j| b.meridian(layer, length * f64::from(j) / 40.0)).collect::<Vec<_>>()
                };
                let (inner, outer) = (points(layer), points(layer + 0.5));
                let side = |a: Meridian, b: Meridian, p: Meridian| {
                    (b.r_mm - a.r_mm) * (p.z_mm - a.z_mm) - (b.z_mm - a.z_mm) * (p.r_mm - a.r_mm)
                };
                for a in inner.windows(2) {
                    for c in outer.windows(2) {
                        let crosses = side(a[0], a[1], c[0]) * side(a[0], a[1], c[1]) < 0.0
                            && side(c[0], c[1], a[0]) * side(c[0], c[1], a[1]) < 0.0;
                        assert!(
                            !crosses,
                            "{name} {}: layers {layer} and {} meet at {a:?}",
                            b.openness(),
                            layer + 0.5
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn meridians_keep_arc_length() {
        // Away from the axis the curve is parametrised by its length, but for the trace of the floor.
        let ([_, _, _, _, b, _], _) = bloom("hybrid_tea");
        let (mut length, mut last) = (0.0, b.meridian(30.0, 0.0));
        for j in 1..=2000 {
            let m = b.meridian(30.0, 40.0 * f64::from(j) / 2000.0);
            length += (m.r_mm - last.r_mm).hypot(m.z_mm - last.z_mm);
            last = m;
        }
        assert!((length - 40.0).abs() < 1.0, "{length}");
    }

    #[test]
    fn the_warp_is_one_to_one() {
        for seed in 0..20 {
            let ([.., b, _], _) = bloom("hybrid_tea");
            let b = b.sway(seed, 3.0);
            for k in 0..200 {
                let v = |t| vary(99, k, t);
                let (r, azimuth, z) = (30.0 + 29.0 * v(0), 3.0 * v(1), 20.0 + 30.0 * v(2));
                let p = |dr: f64, dz: f64, da: f64| b.place(r + dr, azimuth + da / r, z + dz);
                let h = 1e-4;
                let d = [p(h, 0.0, 0.0), p(0.0, h, 0.0), p(0.0, 0.0, h)].map(|q| (q - p(0.0, 0.0, 0.0)) / h);
                let volume = d[0].dot(d[2].cross(d[1])).abs();
                assert!(volume > 0.02, "seed {seed}: {volume} at {r} {azimuth} {z}");
            }
        }
    }

    #[test]
    fn opening_is_steady() {
        // No jump from one openness to the next, and petals go outwards.
        let d = RoseDescription::hybrid_tea();
        let rim = |openness: f64| {
            let b = Bloom::new(&d.bloom, d.petals, 44.0, 50.0, 6.0, openness);
            [5.0, 20.0, 34.0].map(|layer| b.meridian(layer, b.length_mm(b.age(layer))))
        };
        let mut last = rim(0.0);
        for k in 1..=130 {
            let now = rim(0.01 * f64::from(k));
            for (a, b) in last.iter().zip(&now) {
                assert!((a.r_mm - b.r_mm).hypot(a.z_mm - b.z_mm) < 2.0, "{k}: {a:?} {b:?}");
            }
            last = now;
        }
        assert!(last[2].r_mm > 2.0 * rim(0.0)[2].r_mm);
    }
}

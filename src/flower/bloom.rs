//! The form of the open flower: a family of nested cups, one layer per petal.
//!
//! Model: layer t (0 innermost, larger is further out, any real number) is a surface of revolution. Its
//! meridian is a curve of arc length s from the receptacle, given by its heading: the angle from the axis,
//! 0 = straight up, positive = outwards, more than 90 = down.
//!
//! Equation, with age a = t / layers and sigma = s / length(a):
//! heading = opening + (base - opening) max(0, 1 - sigma / claw)^2 + reflex max(0, (sigma - hinge) / (1 - hinge))^1.6
//! opening = inner + (outer - inner) a^p, base and reflex likewise with their own ends and powers;
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
    layers: f64,
    inner_length_mm: f64,
    length_mm: f64,
    receptacle_radius_mm: f64,
    sway: [f64; 4],
}

/// Petals reach their full length at this age: the centre of a rose is shorter than its middle.
const FULL_LENGTH_AGE: f64 = 0.5;

impl Bloom {
    /// Cups for petals of the given lengths on a receptacle.
    pub fn new(
        form: &BloomDescription,
        petals: u32,
        inner_length_mm: f64,
        length_mm: f64,
        receptacle_radius_mm: f64,
    ) -> Self {
        Self {
            form: form.clone(),
            // The innermost petal lies on layer 2, so that its inner margin finds layers inside.
            layers: f64::from(petals.max(1)) + 1.0,
            inner_length_mm,
            length_mm,
            receptacle_radius_mm,
            sway: [0.0; 4],
        }
    }

    /// Makes the cups a little out of round and leaning, all together: a smooth one-to-one map of space, under
    /// which cups that do not meet still do not meet. `size` 1 is natural.
    pub fn sway(mut self, seed: u64, size: f64) -> Self {
        self.sway = [0, 1, 2, 3].map(|k| size * vary(seed, u32::MAX, k));
        self
    }

    /// The point of space at cylindrical coordinates of the cups: radius and height in mm, azimuth in radians.
    pub fn place(&self, r_mm: f64, azimuth: f64, z_mm: f64) -> DVec3 {
        let [a, b, c, d] = self.sway;
        let up = z_mm / self.length_mm;
        let (sin2, cos2) = (2.0 * azimuth).sin_cos();
        let r = r_mm * (1.0 + up * 0.05 * (a * cos2 + b * sin2));
        let lean_mm = 0.07 * self.length_mm * up * up.abs();
        DVec3::new(r * azimuth.cos() + c * lean_mm, r * azimuth.sin() + d * lean_mm, z_mm)
    }

    /// Age of a layer: 0 at the axis, 1 at the outermost petal.
    pub fn age(&self, layer: f64) -> f64 {
        (layer / self.layers).clamp(0.0, 1.2)
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

    /// Heading at the arc length s, radians.
    fn heading(&self, age: f64, s_mm: f64) -> f64 {
        let f = &self.form;
        let ramp = |inner: f64, outer: f64, power: f64| inner + (outer - inner) * age.powf(power);
        let sigma = s_mm / self.length_mm(age);
        let opening = ramp(f.inner_deg, f.outer_deg, f.power);
        let base = ramp(f.base_inner_deg, f.base_outer_deg, 0.55);
        let reflex = ramp(f.reflex_inner_deg, f.reflex_outer_deg, 0.55);
        let cup = (1.0 - sigma / f.claw).max(0.0);
        let back = ((sigma - f.hinge) / (1.0 - f.hinge)).max(0.0);
        (opening + (base - opening) * cup * cup + reflex * back.powf(1.6)).to_radians()
    }

    /// The point at arc length `s_mm` of a layer.
    pub fn meridian(&self, layer: f64, s_mm: f64) -> Meridian {
        let age = self.age(layer);
        let (mut dr, mut dz) = (0.0, 0.0);
        for (x, w) in GAUSS_8 {
            for side in [-1.0, 1.0] {
                let (sin, cos) = self.heading(age, 0.5 * s_mm * (1.0 + side * x)).sin_cos();
                dr += 0.5 * w * s_mm * sin;
                dz += 0.5 * w * s_mm * cos;
            }
        }
        let start = age.min(1.0).sqrt();
        let r = self.receptacle_radius_mm * start + dr;
        // A smooth floor keeps leaning centre petals off the axis, in order.
        let floor = self.form.heart_radius_mm * (1.6 - 0.9 * (-layer.max(0.0) / 6.0).exp());
        Meridian {
            r_mm: 0.5 * (r + r.hypot(2.0 * floor)),
            z_mm: 0.5 * self.receptacle_radius_mm * (1.0 - start * start) + dz,
            heading: self.heading(age, s_mm),
        }
    }
}

impl Bloom {
    /// Free distance outside a petal's rim before the next petal at the same azimuth, mm.
    ///
    /// With the golden angle the petals that can overlap a petal of full angular width w stand 137.5 (next
    /// petal), 85 (second) and 52.5 deg (third) away: the wider a petal, the nearer the layer that it meets.
    pub fn clearance_mm(&self, layer: f64, s_mm: f64, width_mm: f64) -> f64 {
        let m = self.meridian(layer, s_mm);
        // Neighbours may be wider by a tenth and stand nearer by twice the usual jitter.
        let width_deg = 1.1 * (width_mm / m.r_mm).to_degrees() + 8.0;
        let steps = if width_deg > 137.5 {
            0.6
        } else if width_deg > 85.0 {
            0.6 + 1.2 * (137.5 - width_deg) / 52.5
        } else {
            (1.8 + (85.0 - width_deg) / 32.5).min(2.8)
        };
        let out = self.meridian(layer + steps, s_mm);
        let (sin, cos) = m.heading.sin_cos();
        ((out.r_mm - m.r_mm) * cos - (out.z_mm - m.z_mm) * sin).max(0.0)
    }
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

    fn bloom(name: &str) -> (Bloom, u32) {
        let d: RoseDescription = name.parse().expect("a preset");
        let p = &d.petal;
        let b = Bloom::new(&d.bloom, d.petals, p.inner_length_mm, p.length_mm, d.stem.receptacle_radius_mm);
        (b, d.petals)
    }

    #[test]
    fn cups_are_nested() {
        for name in RoseDescription::PRESETS {
            let (b, petals) = bloom(name);
            for k in 0..4 * petals {
                let layer = 0.25 * f64::from(k);
                let points = |layer: f64| {
                    let length = b.length_mm(b.age(layer));
                    (0..=60).map(|j| b.meridian(layer, length * f64::from(j) / 60.0)).collect::<Vec<_>>()
                };
                let (inner, outer) = (points(layer), points(layer + 0.25));
                let side = |a: Meridian, b: Meridian, p: Meridian| {
                    (b.r_mm - a.r_mm) * (p.z_mm - a.z_mm) - (b.z_mm - a.z_mm) * (p.r_mm - a.r_mm)
                };
                for a in inner.windows(2) {
                    for c in outer.windows(2) {
                        let crosses = side(a[0], a[1], c[0]) * side(a[0], a[1], c[1]) < 0.0
                            && side(c[0], c[1], a[0]) * side(c[0], c[1], a[1]) < 0.0;
                        assert!(!crosses, "{name}: layers {layer} and {} meet at {a:?}", layer + 0.25);
                    }
                }
            }
        }
    }

    #[test]
    fn meridians_keep_arc_length() {
        // Away from the axis the curve is parametrised by its length, but for the trace of the floor.
        let (b, _) = bloom("hybrid_tea");
        let (mut length, mut last) = (0.0, b.meridian(30.0, 0.0));
        for j in 1..=2000 {
            let m = b.meridian(30.0, 40.0 * f64::from(j) / 2000.0);
            length += (m.r_mm - last.r_mm).hypot(m.z_mm - last.z_mm);
            last = m;
        }
        assert!((length - 40.0).abs() < 1.0, "{length}");
    }
}

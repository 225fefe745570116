//! Dome: the height of one cell over its base plane, a function of the distance from its axis.
//!
//! Model: z = h(r) for r < R, z = 0 beyond. Symbols: r = distance from the axis, um; H = height
//! (`height_um`, 37); R = base radius, um, from the cell's own Voronoi polygon: the distance to its farthest
//! corner (13.28 for the regular lattice) or, for `cosine_inner`, to its nearest edge (11.5).
//!
//! | profile | h(r) | steepest slope | remark |
//! |---|---|---|---|
//! | `cosine`, `cosine_inner` | H cos(pi r / 2R) | pi H / 2R, at the rim | concave |
//! | `raised_cosine` | H/2 (1 + cos(pi r / R)) | pi H / 2R, at R/2 | smooth at the rim; convex beyond R/2 |
//! | `paraboloid` | H (1 - (r/R)^2) | 2 H / R, at the rim | concave |
//! | `cone` | H (1 - r/R) | H / R | concave; the tip has no normal, we say +z |
//! | `papilla` | H (1 - (r/R)^4) | 4 H / R, at the rim | concave, blunt |
//! | `flat` | 0 | 0 | the base plane alone |
//!
//! Source: "the height is a cosine of the distance from the centre" (the thesis' abstract). Our reading: the
//! zero of the cosine lies at the cell's corner, so that domes meet in valleys and no base plane shows; the
//! other profiles are our reading of published cell shapes (`papilla` of "blunt"). Limits: every profile
//! falls monotonically (`monotone_and_zero_at_the_rim`); the convexity that the ray search relies on is
//! guarded by `curvature_bound_holds` and `enclosures_enclose`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Shape of a dome; the equations are in the [module's documentation](self).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Profile {
    /// H cos(pi r / 2R), R = distance to the cell's farthest corner.
    Cosine,
    /// H cos(pi r / 2R), R = distance to the cell's nearest edge: flat base shows between the domes.
    CosineInner,
    /// H/2 (1 + cos(pi r / R)), R = distance to the cell's farthest corner.
    RaisedCosine,
    /// H (1 - (r/R)^2), R = distance to the cell's farthest corner.
    Paraboloid,
    /// H (1 - r/R), R = distance to the cell's farthest corner.
    Cone,
    /// H (1 - (r/R)^4), R = distance to the cell's farthest corner.
    Papilla,
    /// No dome.
    Flat,
}

impl Profile {
    /// Every profile, in the order of the table.
    pub const ALL: [Profile; 7] = [
        Profile::Cosine,
        Profile::CosineInner,
        Profile::RaisedCosine,
        Profile::Paraboloid,
        Profile::Cone,
        Profile::Papilla,
        Profile::Flat,
    ];

    /// R for a cell whose polygon has these radii.
    pub fn base_radius_um(self, inner_radius_um: f64, corner_radius_um: f64) -> f64 {
        match self {
            Profile::CosineInner => inner_radius_um,
            _ => corner_radius_um,
        }
    }

    /// h/H and its derivative, both as functions of u = (r/R)^2 in [0, 1]. Every profile but the cone is
    /// smooth in u, so that a ray needs no square root; for the cone the derivative at the tip is set to 0,
    /// which lies between its two one-sided values along any line.
    #[inline]
    pub(crate) fn at_square(self, u: f64) -> (f64, f64) {
        match self {
            Profile::Cosine | Profile::CosineInner => cosine_of_square(u),
            Profile::RaisedCosine => {
                // (1 + cos 2x) / 2 = cos^2 x
                let (c, dc) = cosine_of_square(u);
                (c * c, 2.0 * c * dc)
            }
            Profile::Paraboloid => (1.0 - u, -1.0),
            Profile::Cone => {
                let s = u.sqrt();
                (1.0 - s, if s > 1e-12 { -0.5 / s } else { 0.0 })
            }
            Profile::Papilla => (1.0 - u * u, -2.0 * u),
            Profile::Flat => (0.0, 0.0),
        }
    }

    /// A factor k with h/H <= k (1 - u) for every u in [0, 1]: the paraboloid that encloses the dome.
    pub(crate) fn enclosure(self) -> f64 {
        match self {
            Profile::Papilla => 2.0,
            _ => 1.0,
        }
    }

    /// Largest positive second derivative of h(r)/H over r/R in [0, 1]: 0 for a concave dome.
    pub(crate) fn curvature_bound(self) -> f64 {
        match self {
            Profile::RaisedCosine => 0.5 * std::f64::consts::PI * std::f64::consts::PI,
            _ => 0.0,
        }
    }
}

/// cos(pi/2 sqrt(u)) and its derivative in u, for u in [0, 1]: the cosine is even, so in u it is entire and a
/// polynomial of degree 8 (best approximation on the interval) is within 4e-18 of it.
#[inline]
fn cosine_of_square(u: f64) -> (f64, f64) {
    const C: [f64; 9] = [
        1.0,
        -1.233_700_550_136_169,
        0.253_669_507_901_031_04,
        -2.086_348_076_317_886e-2,
        9.192_602_739_434_877e-4,
        -2.520_203_978_222_871_3e-5,
        4.710_830_743_363_557_7e-7,
        -6.382_235_924_529_259e-9,
        6.331_732_717_807_9e-11,
    ];
    // Even and odd powers apart: four short chains that the processor runs side by side.
    let v = u * u;
    let even = C[0] + v * (C[2] + v * (C[4] + v * (C[6] + v * C[8])));
    let odd = C[1] + v * (C[3] + v * (C[5] + v * C[7]));
    let even_slope = 2.0 * C[2] + v * (4.0 * C[4] + v * (6.0 * C[6] + v * (8.0 * C[8])));
    let odd_slope = C[1] + v * (3.0 * C[3] + v * (5.0 * C[5] + v * (7.0 * C[7])));
    (even + u * odd, odd_slope + u * even_slope)
}

/// One cell's dome: a profile with its two lengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dome {
    /// Shape.
    pub profile: Profile,
    /// Height H, um.
    pub height_um: f64,
    /// Base radius R, um.
    pub radius_um: f64,
}

impl Dome {
    /// h(r), um.
    pub fn height_at_um(&self, r_um: f64) -> f64 {
        let u = self.square(r_um);
        if u < 1.0 { self.height_um * self.profile.at_square(u).0.max(0.0) } else { 0.0 }
    }

    /// dh/dr at r, dimensionless, never positive.
    pub fn slope_at(&self, r_um: f64) -> f64 {
        let u = self.square(r_um);
        if u < 1.0 {
            self.height_um * self.profile.at_square(u).1 * 2.0 * r_um / (self.radius_um * self.radius_um)
        } else {
            0.0
        }
    }

    fn square(&self, r_um: f64) -> f64 {
        (r_um / self.radius_um).powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn domes() -> impl Iterator<Item = Dome> {
        Profile::ALL.into_iter().map(|profile| Dome { profile, height_um: 37.0, radius_um: 13.3 })
    }

    #[test]
    fn equations() {
        let (h, r0) = (37.0, 13.3);
        for i in 0..1000 {
            let r = r0 * f64::from(i) / 1000.0;
            let x = r / r0;
            for dome in domes() {
                let expected = match dome.profile {
                    Profile::Cosine | Profile::CosineInner => h * (0.5 * PI * x).cos(),
                    Profile::RaisedCosine => 0.5 * h * (1.0 + (PI * x).cos()),
                    Profile::Paraboloid => h * (1.0 - x * x),
                    Profile::Cone => h * (1.0 - x),
                    Profile::Papilla => h * (1.0 - x.powi(4)),
                    Profile::Flat => 0.0,
                };
                assert!((dome.height_at_um(r) - expected).abs() < 1e-13 * h, "{dome:?} at {r}");
            }
        }
    }

    #[test]
    fn slope_is_the_derivative() {
        for dome in domes() {
            for i in 1..100 {
                let r = dome.radius_um * f64::from(i) / 100.0;
                let e = 1e-5;
                let numeric = (dome.height_at_um(r + e) - dome.height_at_um(r - e)) / (2.0 * e);
                // At the rim the profile has a kink; the last r stays inside it.
                assert!((numeric - dome.slope_at(r)).abs() < 1e-7, "{dome:?} at {r}");
            }
        }
    }

    #[test]
    fn monotone_and_zero_at_the_rim() {
        for dome in domes() {
            let peak = if dome.profile == Profile::Flat { 0.0 } else { dome.height_um };
            assert_eq!(dome.height_at_um(0.0), peak);
            assert!(dome.height_at_um(dome.radius_um * (1.0 - 1e-15)).abs() < 1e-11);
            assert_eq!(dome.height_at_um(dome.radius_um), 0.0);
            for i in 0..1000 {
                let r = dome.radius_um * f64::from(i) / 1000.0;
                assert!(dome.height_at_um(r + 0.01) <= dome.height_at_um(r));
                assert!(dome.slope_at(r) <= 0.0);
            }
        }
    }

    #[test]
    fn enclosures_enclose() {
        for profile in Profile::ALL {
            for i in 0..=10_000 {
                let u = f64::from(i) / 10_000.0;
                assert!(profile.at_square(u).0 <= profile.enclosure() * (1.0 - u) + 1e-15, "{profile:?} {u}");
            }
        }
    }

    #[test]
    fn curvature_bound_holds() {
        for dome in domes() {
            let bound = dome.profile.curvature_bound() * dome.height_um / (dome.radius_um * dome.radius_um);
            let mut largest = f64::NEG_INFINITY;
            for i in 1..2000 {
                let r = dome.radius_um * f64::from(i) / 2000.0;
                let e = 1e-6;
                if r + e < dome.radius_um {
                    largest = largest.max((dome.slope_at(r + e) - dome.slope_at(r - e)) / (2.0 * e));
                }
            }
            assert!(largest <= bound + 1e-6, "{dome:?}: {largest} > {bound}");
            if dome.profile == Profile::RaisedCosine {
                assert!(largest > 0.99 * bound, "the bound is tight");
            }
        }
    }
}

//! What a laboratory's numbers mean: quantity, angles and azimuth, and the way from them to a [`Reading`].
//!
//! - BSDF f, 1/sr: value
//! - reflectance factor BRF = pi f
//! - differential scattering function DSF = f |cos(theta_o)|
//! - relative values: the same with an unknown gain per series
//! - angles from the specular direction (radial r, azimuth a): the direction (r, a) of a frame that is turned about
//!   the plane of incidence until its pole is the mirror direction; azimuth 0 leans to the lamp's side
//!
//! Symbols: theta_o -> `theta`, from the normal of the lit side. Angles of a row are in the instrument's frame (see
//! [`crate::gonio`]): an incidence is always below 90 degrees, `side` says which side is lit.
//!
//! Limits: angles out of range and negative values are errors (`angles_and_values_out_of_range`); at theta_o = 90 a DSF
//! says nothing of the BSDF (`the_horizon_has_no_bsdf_of_a_dsf`). One lobe under every convention is one
//! measurement: guarded by `one_lobe_under_every_convention`. Source: definitions of ASTM E2387.
//!
//! [`Reading`]: crate::gonio::Reading

use std::f64::consts::{FRAC_1_PI, PI};
use std::str::FromStr;

use glam::DVec3;

use crate::geometry::Side;
use crate::gonio::Scale;
use crate::gonio::measurement::direction_deg;
use crate::{Error, Result};

/// Looks a word up; the error lists the words that are known.
fn one_of<T: Copy>(what: &str, word: &str, known: &[(&str, T)]) -> Result<T> {
    let key = word.trim().to_ascii_lowercase().replace('-', "_");
    known.iter().find(|(name, _)| *name == key).map(|k| k.1).ok_or_else(|| {
        let names: Vec<&str> = known.iter().map(|k| k.0).collect();
        Error::invalid(what, format!("`{word}` is not one of {}", names.join(", ")))
    })
}

/// What a value is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quantity {
    /// BSDF, 1/sr, without the cosine.
    #[default]
    Bsdf,
    /// Reflectance factor: pi x BSDF.
    Brf,
    /// Differential scattering function: BSDF x |cos(theta_o)|, 1/sr.
    Dsf,
    /// In proportion to the BSDF, with an unknown gain per series (radiance of the sample).
    Relative,
    /// In proportion to the DSF, with an unknown gain per series (intensity that leaves the sample).
    RelativeDsf,
}

impl FromStr for Quantity {
    type Err = Error;

    fn from_str(word: &str) -> Result<Self> {
        let known = [
            ("bsdf", Self::Bsdf),
            ("brdf", Self::Bsdf),
            ("btdf", Self::Bsdf),
            ("brf", Self::Brf),
            ("dsf", Self::Dsf),
            ("relative", Self::Relative),
            ("relative_dsf", Self::RelativeDsf),
        ];
        one_of("quantity", word, &known)
    }
}

/// Unit of all angles of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AngleUnit {
    /// 360 to the turn.
    #[default]
    Degrees,
    /// 2 pi to the turn.
    Radians,
}

impl FromStr for AngleUnit {
    type Err = Error;

    fn from_str(word: &str) -> Result<Self> {
        let known = [
            ("degrees", Self::Degrees),
            ("deg", Self::Degrees),
            ("radians", Self::Radians),
            ("rad", Self::Radians),
        ];
        one_of("angle unit", word, &known)
    }
}

/// Where the detector's azimuth is counted from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AzimuthZero {
    /// From the lamp's azimuth: 0 is the lamp's side (retro-reflection), 180 the mirror's.
    #[default]
    Lamp,
    /// From the mirror's azimuth: 0 is the forward (specular) side, 180 the lamp's.
    Forward,
    /// From the sample's own axis, as the lamp's azimuth is.
    Sample,
}

impl FromStr for AzimuthZero {
    type Err = Error;

    fn from_str(word: &str) -> Result<Self> {
        let known = [("lamp", Self::Lamp), ("forward", Self::Forward), ("sample", Self::Sample)];
        one_of("azimuth", word, &known)
    }
}

/// Which direction has theta 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AngleReference {
    /// The normal of the lit side.
    #[default]
    Normal,
    /// The mirror direction: theta and phi are radial angle and azimuth about it.
    Specular,
}

impl FromStr for AngleReference {
    type Err = Error;

    fn from_str(word: &str) -> Result<Self> {
        one_of("angle reference", word, &[("normal", Self::Normal), ("specular", Self::Specular)])
    }
}

/// The lit side from its name.
pub(super) fn side(word: &str) -> Result<Side> {
    let known = [
        ("adaxial", Side::Adaxial),
        ("abaxial", Side::Abaxial),
        ("front", Side::Adaxial),
        ("back", Side::Abaxial),
    ];
    one_of("side", word, &known)
}

/// Name of a side in files.
pub(super) fn side_name(side: Side) -> &'static str {
    if side == Side::Adaxial { "adaxial" } else { "abaxial" }
}

/// The sample turned over about x: between the frames of sample and instrument where the abaxial side is lit.
pub(super) fn turned(w: DVec3, lit: Side) -> DVec3 {
    if lit == Side::Adaxial { w } else { DVec3::new(w.x, -w.y, -w.z) }
}

/// Everything that must be declared before a row has a meaning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Conventions {
    /// What a value is.
    pub quantity: Quantity,
    /// Unit of the angles.
    pub angle_unit: AngleUnit,
    /// Where the detector's azimuth is counted from.
    pub azimuth: AzimuthZero,
    /// Which direction has theta 0.
    pub reference: AngleReference,
}

/// Angles of one row, in the file's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RowAngles {
    pub(super) incident_theta: f64,
    pub(super) incident_phi: f64,
    pub(super) theta: f64,
    pub(super) phi: f64,
    pub(super) side: Side,
}

impl Conventions {
    /// What is known of the scale.
    pub fn scale(&self) -> Scale {
        match self.quantity {
            Quantity::Relative | Quantity::RelativeDsf => Scale::RelativePerSeries,
            _ => Scale::Absolute,
        }
    }

    /// `(wi, wo)` in the sample's frame. Negative polar angles are the other side of the azimuth.
    pub(super) fn directions(&self, row: RowAngles) -> Result<(DVec3, DVec3), String> {
        let in_degrees = |name: &str, v: f64| {
            let deg = if self.angle_unit == AngleUnit::Radians { v.to_degrees() } else { v };
            // Azimuths wrap; beyond some turns a number is a mistake, and its direction is rounding.
            if deg.is_finite() && deg.abs() <= 3600.0 {
                Ok(deg)
            } else {
                Err(format!("{name}: {v} is not an angle"))
            }
        };
        let polar = |name: &str, v: f64, most_deg: f64| {
            let deg = in_degrees(name, v)?;
            // pi in a few digits is 180 degrees too.
            let slack = if self.angle_unit == AngleUnit::Radians { 1e-3 } else { 0.0 };
            if deg.abs() > most_deg + slack {
                return Err(format!("{name}: {deg} deg is above {most_deg}"));
            }
            Ok(deg.clamp(-most_deg, most_deg))
        };
        let theta_i = polar("incident theta", row.incident_theta, 90.0)?;
        if theta_i.abs() >= 90.0 - 1e-9 {
            return Err(format!(
                "incident theta: {theta_i} deg; the lamp must stand above the surface (below 90)"
            ));
        }
        let phi_i = in_degrees("incident phi", row.incident_phi)?;
        let theta = polar("theta", row.theta, 180.0)?;
        let phi = in_degrees("phi", row.phi)?;
        let from_lamp = match self.azimuth {
            AzimuthZero::Lamp => phi,
            AzimuthZero::Forward => phi + 180.0,
            AzimuthZero::Sample => phi - phi_i,
        };
        let wo = match self.reference {
            // One sum, so that whole degrees stay whole.
            AngleReference::Normal => direction(theta, phi_i + from_lamp),
            AngleReference::Specular => {
                let w = about_pole(theta_i, direction(theta, from_lamp));
                let (s, c) = phi_i.to_radians().sin_cos();
                DVec3::new(w.x * c - w.y * s, w.x * s + w.y * c, w.z)
            }
        };
        Ok((turned(direction(theta_i, phi_i), row.side), turned(wo, row.side)))
    }

    /// Value over BSDF for a detector in direction `wo`; `None` where the value says nothing of the BSDF.
    pub(super) fn value_per_bsdf(&self, wo: DVec3) -> Option<f64> {
        match self.quantity {
            Quantity::Bsdf | Quantity::Relative => Some(1.0),
            Quantity::Brf => Some(PI),
            Quantity::Dsf | Quantity::RelativeDsf => (wo.z.abs() > 1e-6).then_some(wo.z.abs()),
        }
    }

    /// BSDF of a value, 1/sr.
    pub(super) fn bsdf(&self, value: f64, value_per_bsdf: f64) -> f64 {
        if self.quantity == Quantity::Brf { value * FRAC_1_PI } else { value / value_per_bsdf }
    }
}

/// Direction from degrees with the azimuth brought to [0, 360) first: equal angles give equal bits.
fn direction(theta_deg: f64, phi_deg: f64) -> DVec3 {
    let (theta, phi) = if theta_deg < 0.0 { (-theta_deg, phi_deg + 180.0) } else { (theta_deg, phi_deg) };
    direction_deg(theta, phi.rem_euclid(360.0))
}

/// A direction of the frame whose pole is the mirror direction of a lamp at `(theta_i_deg, 0)`, in the lamp's frame.
pub(super) fn about_pole(theta_i_deg: f64, w: DVec3) -> DVec3 {
    // The turn about y that takes +z to (-sin, 0, cos); +x (azimuth 0) leans to the lamp's side.
    let (s, c) = theta_i_deg.to_radians().sin_cos();
    DVec3::new(w.x * c - w.z * s, w.y, w.x * s + w.z * c)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROW: RowAngles =
        RowAngles { incident_theta: 30.0, incident_phi: 0.0, theta: 50.0, phi: 0.0, side: Side::Adaxial };

    fn close(a: (DVec3, DVec3), b: (DVec3, DVec3)) -> bool {
        a.0.distance(b.0) < 1e-12 && a.1.distance(b.1) < 1e-12
    }

    #[test]
    fn one_lobe_under_every_convention() {
        let lamp = Conventions::default();
        let forward = Conventions { azimuth: AzimuthZero::Forward, ..lamp };
        let sample = Conventions { azimuth: AzimuthZero::Sample, ..lamp };
        let radians = Conventions { angle_unit: AngleUnit::Radians, ..lamp };
        let specular = Conventions { reference: AngleReference::Specular, ..lamp };
        let specular_forward = Conventions { azimuth: AzimuthZero::Forward, ..specular };
        // Detector 20 degrees beyond the mirror direction, lamp at azimuth 40.
        let expected = (direction_deg(30.0, 40.0), direction_deg(50.0, 220.0));
        let cases = [
            (lamp, RowAngles { incident_phi: 40.0, phi: 180.0, ..ROW }),
            (lamp, RowAngles { incident_phi: 40.0, theta: -50.0, ..ROW }),
            // Signed angles in one plane: lamp and detector on its two sides.
            (lamp, RowAngles { incident_theta: -30.0, incident_phi: 220.0, phi: 0.0, ..ROW }),
            (forward, RowAngles { incident_phi: 40.0, phi: 0.0, ..ROW }),
            (sample, RowAngles { incident_phi: 40.0, phi: 220.0, ..ROW }),
            (specular, RowAngles { incident_phi: 40.0, theta: 20.0, phi: 180.0, ..ROW }),
            (specular_forward, RowAngles { incident_phi: 40.0, theta: 20.0, phi: 0.0, ..ROW }),
            (
                radians,
                RowAngles {
                    incident_theta: 30f64.to_radians(),
                    incident_phi: 40f64.to_radians(),
                    theta: 50f64.to_radians(),
                    phi: PI,
                    ..ROW
                },
            ),
        ];
        for (i, (c, row)) in cases.into_iter().enumerate() {
            let got = c.directions(row).unwrap();
            assert!(close(got, expected), "case {i}: {got:?}");
        }
        // Out of the plane: radial 90 at azimuth 90 is the normal of the plane of incidence, which the turn keeps.
        let side = specular.directions(RowAngles { theta: 90.0, phi: 90.0, ..ROW }).unwrap();
        assert!(side.1.distance(DVec3::Y) < 1e-12);
        // Radial 30 leans from the mirror direction to the normal, 60 to the lamp.
        let normal = specular.directions(RowAngles { theta: 30.0, ..ROW }).unwrap();
        assert!(normal.1.distance(DVec3::Z) < 1e-12);
        let retro = specular.directions(RowAngles { theta: 60.0, ..ROW }).unwrap();
        assert!(retro.1.distance(retro.0) < 1e-12);
        // The same from below.
        let below = lamp.directions(RowAngles { side: Side::Abaxial, ..ROW }).unwrap();
        assert!(
            below.0.z < 0.0
                && below.1.z < 0.0
                && close(below, (direction_deg(150.0, 0.0), direction_deg(130.0, 0.0)))
        );
    }

    #[test]
    fn quantities_give_one_bsdf() {
        let wo = direction_deg(60.0, 10.0);
        for (quantity, value) in [
            (Quantity::Bsdf, 0.2),
            (Quantity::Brf, 0.2 * PI),
            (Quantity::Dsf, 0.1),
            (Quantity::Relative, 0.2),
            (Quantity::RelativeDsf, 0.1),
        ] {
            let c = Conventions { quantity, ..Default::default() };
            let per = c.value_per_bsdf(wo).unwrap();
            assert!((c.bsdf(value, per) - 0.2).abs() < 1e-15, "{quantity:?}");
        }
    }

    #[test]
    fn the_horizon_has_no_bsdf_of_a_dsf() {
        let c = Conventions { quantity: Quantity::Dsf, ..Default::default() };
        assert!(c.value_per_bsdf(direction_deg(90.0, 0.0)).is_none());
        assert!(c.value_per_bsdf(direction_deg(89.0, 0.0)).is_some());
    }

    #[test]
    fn angles_and_values_out_of_range() {
        let c = Conventions::default();
        for row in [
            RowAngles { incident_theta: 90.0, ..ROW },
            RowAngles { incident_theta: 120.0, ..ROW },
            RowAngles { theta: 180.5, ..ROW },
            RowAngles { theta: f64::NAN, ..ROW },
            RowAngles { phi: f64::INFINITY, ..ROW },
            RowAngles { phi: 1e9, ..ROW },
        ] {
            assert!(c.directions(row).is_err(), "{row:?}");
        }
        let radians = Conventions { angle_unit: AngleUnit::Radians, ..c };
        assert!(radians.directions(ROW).is_err());
        assert!(radians.directions(RowAngles { incident_theta: 0.5, theta: 3.14159266, ..ROW }).is_ok());
    }

    #[test]
    fn unknown_words_list_the_known() {
        let message = "percent".parse::<Quantity>().unwrap_err().to_string();
        assert!(message.contains("brf") && message.contains("relative_dsf"), "{message}");
        assert!("Relative-DSF".parse::<Quantity>().is_ok());
        assert!("grad".parse::<AngleUnit>().unwrap_err().to_string().contains("radians"));
        assert!("sun".parse::<AzimuthZero>().unwrap_err().to_string().contains("forward"));
        assert!("mirror".parse::<AngleReference>().unwrap_err().to_string().contains("specular"));
    }
}

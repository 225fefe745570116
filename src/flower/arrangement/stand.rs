//! Where the stems of an arrangement stand, and which places are free.

use std::f64::consts::TAU;

use glam::{DQuat, DVec2, DVec3};

use super::{ArrangementDescription, ArrangementKind, CANDIDATES, PlacedRose, Sphere};
use crate::flower::phyllotaxis::vary;
use crate::flower::rose::RoseDescription;
use crate::flower::stem::StemAxis;

/// Space between two flowers, a flower and a stem, two stems, mm. Between stems is room for prickles.
const FLOWERS_APART_MM: f64 = 5.0;
const STEM_FROM_FLOWER_MM: f64 = 6.0;
const STEMS_APART_MM: f64 = 3.0;
/// Points of a stem where its distances are taken.
const SAMPLES: u32 = 28;
/// Feet and crossing points in a vase, in parts of the opening's radius, and the angle from one to the other about the axis.
const FOOT: f64 = 0.6;
const MOUTH: f64 = 0.62;
const TWIST_DEG: f64 = 115.0;
/// The foot of a stem above that of the vase, mm.
const FOOT_MM: f64 = 14.0;
/// Radius of the ground from which the canes of a bush rise, mm.
const GROUND_MM: [f64; 2] = [14.0, 48.0];
/// Largest angle between a stem's foot and its chord, deg: beyond 19.4 no parabola is its own.
const MOST_BENT_DEG: f64 = 17.0;
/// Lowest leaves above the opening and above the ground, mm.
const LEAVES_FROM_MM: [f64; 2] = [30.0, 70.0];

/// An arrangement that is being filled.
pub(super) struct Stand<'a> {
    pub(super) arrangement: &'a ArrangementDescription,
    pub(super) roses: &'a [RoseDescription],
    pub(super) flowers: &'a [Sphere],
    pub(super) spread_deg: f64,
}

/// A rose that has its place.
struct Seated {
    rose: PlacedRose,
    centre_mm: DVec3,
    radius_mm: f64,
    /// The middle of its stem, from the neck down.
    stem_mm: Vec<DVec3>,
    stem_radius_mm: f64,
}

impl Stand<'_> {
    /// Places all roses, if each finds a free place.
    pub(super) fn fill(&self) -> Option<Vec<PlacedRose>> {
        let mut seated: Vec<Seated> = Vec::new();
        for k in 0..self.roses.len() as u32 {
            let mut best: Option<(f64, Seated)> = None;
            for i in 0..CANDIDATES {
                let Some(candidate) = self.candidate(k, i) else { continue };
                let apart = candidate.clearance_mm(&seated);
                let better = best.as_ref().is_none_or(|(found, _)| apart > *found);
                if apart >= 0.0 && better && candidate.is_free(&seated) {
                    best = Some((apart, candidate));
                }
            }
            seated.push(best?.1);
        }
        Some(seated.into_iter().map(|s| s.rose).collect())
    }

    /// Place `i` of rose `k`, unless it cannot be.
    fn candidate(&self, k: u32, i: u32) -> Option<Seated> {
        let a = self.arrangement;
        // Additive recurrence of the plastic number's relatives: even in three dimensions.
        let u =
            |j: u32, step: f64| (0.5 + vary(a.seed, k, 10 + j) / 2.0 + f64::from(i) * step).rem_euclid(1.0);
        let (u0, u1, u2) = (u(0, 0.819_172_513_4), u(1, 0.671_043_606_7), u(2, 0.549_700_477_9));
        let radial = |angle: f64| DVec2::from_angle(angle).extend(0.0);
        let azimuth = TAU * u0;
        let out = radial(azimuth);
        let height_mm = a.height_mm() * (0.72 + 0.28 * u2);
        let (foot, leaves, chord) = match a.kind {
            ArrangementKind::Vase => {
                let r = a.opening_radius_mm;
                let foot = radial(azimuth + TWIST_DEG.to_radians()) * (FOOT * r) + DVec3::Z * FOOT_MM;
                let bend = (self.spread_deg * u1.sqrt()).clamp(0.5, MOST_BENT_DEG);
                // What the stem bends outwards below the opening.
                let (below, all) = (a.opening_height_mm - foot.z, a.opening_height_mm + height_mm - foot.z);
                let aside = bend.to_radians().tan() * below * below / all;
                let mouth = out * (MOUTH * r - aside) + DVec3::Z * a.opening_height_mm;
                let leaves = (mouth - foot).normalize();
                let chord = towards(leaves, out, bend);
                (foot, leaves, chord * ((a.opening_height_mm + height_mm - foot.z) / chord.z))
            }
            ArrangementKind::Bush => {
                let foot = out * (GROUND_MM[0] + (GROUND_MM[1] - GROUND_MM[0]) * u1);
                let lean = (self.spread_deg * u1.sqrt()).clamp(1.0, 70.0);
                let bend = (3.0 + 0.3 * lean).min(MOST_BENT_DEG - 1.0).min(lean);
                (foot, towards(DVec3::Z, out, lean - bend), towards(DVec3::Z, out, lean) * height_mm)
            }
        };
        self.seat(k, foot, leaves, foot + chord)
    }

    /// Rose `k` on a stem with that foot, direction at the foot and neck.
    fn seat(&self, k: u32, foot: DVec3, leaves: DVec3, neck: DVec3) -> Option<Seated> {
        let a = self.arrangement;
        let mut rose = self.roses[k as usize].clone();
        let chord = neck - foot;
        let (m, q) = (chord.length_squared(), leaves.dot(chord));
        let root = 9.0 * q * q - 8.0 * m;
        if root < 0.0 || q <= 0.0 {
            return None;
        }
        let control = foot + leaves * ((3.0 * q - root.sqrt()) / 4.0);
        let axis = (neck - control).try_normalize()?;
        let rotation = DQuat::from_rotation_arc(DVec3::Z, axis) * DQuat::from_rotation_z(a.turn(k));
        let aside = rotation.inverse() * (foot - neck);
        rose.stem.length_mm = -aside.z;
        rose.stem.bend_mm = aside.truncate().length();
        rose.stem.bend_azimuth_deg = aside.y.atan2(aside.x).to_degrees();
        rose.stem.validate("rose.stem").ok()?;
        let position_mm = neck + axis * rose.stem.receptacle_height_mm;
        let sphere = self.flowers[k as usize];
        let stem = rose.stem.axis(&[]);
        let at = |depth: f64| rotation * stem.centre_mm(depth) + position_mm;
        let length = rose.stem.length_mm;
        let stem_mm: Vec<DVec3> =
            (0..=SAMPLES).map(|i| at(length * f64::from(i) / f64::from(SAMPLES))).collect();
        let stem_radius_mm = stem.radius_mm(length);
        let free = match a.kind {
            ArrangementKind::Vase => {
                let room = a.opening_radius_mm - stem_radius_mm - 1.0;
                // Down to the point where the stem passes the opening, then all the way.
                stem_mm.windows(2).all(|w| {
                    let part = ((a.opening_height_mm - w[1].z) / (w[0].z - w[1].z).max(1e-9)).clamp(0.0, 1.0);
                    w[1].z > a.opening_height_mm
                        || w.iter().all(|p| p.truncate().length() <= room || p.z > a.opening_height_mm)
                            && w[1].lerp(w[0], part).truncate().length() <= room
                })
            }
            ArrangementKind::Bush => true,
        };
        let centre_mm = position_mm + axis * sphere.height_mm;
        if !free || centre_mm.z < sphere.radius_mm {
            return None;
        }
        rose.leaves.count = self.leaves(&rose, &stem, |depth| at(depth).z);
        let radius_mm = sphere.radius_mm;
        let rose = PlacedRose { rose, position_mm, rotation };
        Some(Seated { rose, centre_mm, radius_mm, stem_mm, stem_radius_mm })
    }

    /// Number of leaves: along the whole cane; in a vase no more than described, and none below the opening.
    fn leaves(&self, rose: &RoseDescription, stem: &StemAxis, height_mm: impl Fn(f64) -> f64) -> u32 {
        let a = self.arrangement;
        let (most, lowest) = match a.kind {
            ArrangementKind::Vase => (rose.leaves.count, a.opening_height_mm + LEAVES_FROM_MM[0]),
            ArrangementKind::Bush if rose.leaves.count == 0 => (0, 0.0),
            ArrangementKind::Bush => (100, LEAVES_FROM_MM[1]),
        };
        let depth = |k: u32| rose.leaves.first_mm + f64::from(k) * rose.leaves.internode_mm;
        (0..most).take_while(|&k| depth(k) < stem.length_mm() && height_mm(depth(k)) > lowest).count() as u32
    }
}

/// `from` turned by an angle towards `to`.
fn towards(from: DVec3, to: DVec3, angle_deg: f64) -> DVec3 {
    let axis = from.cross(to).normalize_or(DVec3::X);
    DQuat::from_axis_angle(axis, angle_deg.to_radians()) * from
}

impl Seated {
    /// Distance to the nearest flower, mm; no flower is far.
    fn clearance_mm(&self, seated: &[Seated]) -> f64 {
        seated
            .iter()
            .map(|s| self.centre_mm.distance(s.centre_mm) - self.radius_mm - s.radius_mm - FLOWERS_APART_MM)
            .fold(1e9, f64::min)
    }

    /// Are stems clear of flowers and of each other?
    fn is_free(&self, seated: &[Seated]) -> bool {
        seated.iter().all(|s| {
            let stems = self.stem_radius_mm + s.stem_radius_mm + STEMS_APART_MM;
            self.is_beside(s) && s.is_beside(self) && lines_apart(&self.stem_mm, &s.stem_mm) >= stems
        })
    }

    /// Is this flower clear of the other's stem?
    fn is_beside(&self, other: &Seated) -> bool {
        let room = self.radius_mm + other.stem_radius_mm + STEM_FROM_FLOWER_MM;
        from_line(self.centre_mm, &other.stem_mm) >= room
    }
}

/// Distance of a point from a line of straight pieces.
fn from_line(p: DVec3, line: &[DVec3]) -> f64 {
    line.windows(2)
        .map(|w| {
            let along = w[1] - w[0];
            let t = ((p - w[0]).dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
            p.distance(w[0] + along * t)
        })
        .fold(f64::INFINITY, f64::min)
}

/// Least distance of two lines, at the ends of their pieces.
fn lines_apart(a: &[DVec3], b: &[DVec3]) -> f64 {
    let one = |a: &[DVec3], b: &[DVec3]| a.iter().map(|p| from_line(*p, b)).fold(f64::INFINITY, f64::min);
    one(a, b).min(one(b, a))
}

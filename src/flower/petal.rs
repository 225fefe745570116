//! One petal: a sheet without thickness, two-sided, given by one mid-surface function of (u, v).
//!
//! Model, in three maps:
//! 1. [`PetalSurface::blade`]: (u, v) -> the flat petal, x across and s along in mm: a narrow claw, a broad
//!    obovate blade, a rim that is round, pointed or notched;
//! 2. [`PetalSurface::wrap`]: the flat petal -> its cup of the [`Bloom`]. The cup is treated as the cone that
//!    touches it in the middle of the blade, on which the flat petal is rolled without stretching:
//!    s' = |(x, s + s0)| - s0, arc = (s' + s0) atan(x / (s + s0)), azimuth = arc / r(s'). Then cup and ruffle
//!    displace it along its normal, within the petal's share of the space to its neighbours;
//! 3. `PetalSurface::roll`: a margin within `width` of the rim bends back about the rim's direction by
//!    phi(q) = roll (1 - q / width)^2, q the distance to the rim, arc length kept; it stands off the cup by at
//!    most the space before the next petal.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | length, width, claw width | `length_mm`, `width_mm`, `claw_width_mm` | mm | by age, see [`crate::flower::rose`] |
//! | roll, its width | `roll_deg`, `roll_width_mm` | deg, mm | |
//! | cup, ruffle | `cup_mm`, `ruffle_mm` | mm | |
//!
//! Limits: without cup, ruffle and roll the middle of the petal lies on its cup
//! (`a_plain_petal_lies_on_its_cup`); wrapping keeps its area within 15 %, rolling within 12 %
//! (`bending_nearly_keeps_area`). Our reading: no measured shape of a hybrid tea's petal is used.

use std::f64::consts::FRAC_PI_2;

use glam::{DVec2, DVec3};

use crate::flower::bloom::Bloom;
use crate::flower::sheet::Sheet;

/// The traits of one petal.
#[derive(Clone, Debug, PartialEq)]
pub struct PetalForm {
    /// Layer of the bloom on which its middle lies.
    pub layer: f64,
    /// Azimuth of its middle, deg.
    pub azimuth_deg: f64,
    /// Claw to rim along the middle, mm.
    pub length_mm: f64,
    /// Largest width, mm.
    pub width_mm: f64,
    /// Width at the receptacle, mm.
    pub claw_width_mm: f64,
    /// Where it is widest, as a part of the length.
    pub widest: f64,
    /// Point (positive) or notch (negative) at the middle of the rim, mm.
    pub tip_mm: f64,
    /// How far the margins stand towards the adaxial side of the middle, mm.
    pub cup_mm: f64,
    /// Total turn of the rolled margin to the abaxial side, deg: left shoulder, tip, right shoulder.
    pub roll_deg: [f64; 3],
    /// Width of the rolled margin, mm.
    pub roll_width_mm: f64,
    /// Amplitude of the waves of the rim, mm.
    pub ruffle_mm: f64,
    /// Number of waves along the rim.
    pub ruffle_waves: f64,
    /// Phase of the waves, radians.
    pub ruffle_phase: f64,
}

/// A point of the flat outline with its outward normal and the turn of the margin there.
#[derive(Clone, Copy, Debug)]
struct RimPoint {
    at: DVec2,
    normal: DVec2,
    roll: f64,
}

/// The mid-surface of a petal.
#[derive(Clone, Debug)]
pub struct PetalSurface<'a> {
    form: PetalForm,
    bloom: &'a Bloom,
    apex_mm: f64,
    rim: Vec<RimPoint>,
}

/// The rim ends a little short of tangent to the sides, so that the grid has no empty corner.
const RIM_SPAN: f64 = 0.95 * FRAC_PI_2;
/// Arc steps of a rolled margin.
const ROLL_STEPS: usize = 8;
/// Parts of the space between two petals that the inner one may use outwards and the outer one inwards.
pub(crate) const SPACE_OUTSIDE: f64 = 0.7;
const SPACE_INSIDE: f64 = 0.2;

impl<'a> PetalSurface<'a> {
    /// A petal with these traits in this flower.
    pub fn new(form: PetalForm, bloom: &'a Bloom) -> Self {
        // The touching cone: at the middle of the blade the apex is r / sin(heading) away.
        let middle_mm = 0.6 * form.length_mm;
        let m = bloom.meridian(form.layer, middle_mm);
        let apex_mm = (m.r_mm / m.heading.sin().max(1e-3) - middle_mm).max(1.0);
        let mut petal = Self { form, bloom, apex_mm, rim: Vec::new() };
        petal.rim = petal.outline(96);
        petal
    }

    /// Outline from the left end of the claw over the rim to the right end.
    fn outline(&self, n: usize) -> Vec<RimPoint> {
        // t in [0, 3]: left side, rim, right side.
        let point = |t: f64| {
            if t < 1.0 {
                self.blade(0.0, t.max(0.0))
            } else if t < 2.0 {
                self.blade(t - 1.0, 1.0)
            } else {
                self.blade(1.0, (3.0 - t).max(0.0))
            }
        };
        let [left, tip, right] = self.form.roll_deg.map(f64::to_radians);
        let roll = |t: f64| {
            let along = smooth_step(0.45, 1.0, t.min(3.0 - t));
            let across = (t - 1.5).clamp(-0.5, 0.5) * 2.0;
            let shoulder = if across < 0.0 { left } else { right };
            along * (shoulder + (tip - shoulder) * (-(across / 0.3).powi(2)).exp())
        };
        (0..=n)
            .map(|i| {
                let t = 3.0 * i as f64 / n as f64;
                let d = point((t + 0.01).min(3.0)) - point((t - 0.01).max(0.0));
                RimPoint { at: point(t), normal: DVec2::new(-d.y, d.x).normalize_or(DVec2::Y), roll: roll(t) }
            })
            .collect()
    }

    /// Map 1: the flat petal, (across, along) in mm.
    pub fn blade(&self, u: f64, v: f64) -> DVec2 {
        let f = &self.form;
        let across = 2.0 * u - 1.0;
        let (sin, cos) = (across * RIM_SPAN).sin_cos();
        let end = RIM_SPAN.cos();
        let half =
            0.5 * (f.claw_width_mm + (f.width_mm - f.claw_width_mm) * (FRAC_PI_2 * v.powf(0.85)).sin());
        let rim = f.widest + (1.0 - f.widest) * (cos - end) / (1.0 - end);
        let tip = f.tip_mm * (-(across / 0.22).powi(2)).exp() * v * v * v;
        DVec2::new(half * sin / RIM_SPAN.sin(), v * f.length_mm * rim + tip)
    }

    /// Map 2: the flat petal on its cup.
    pub fn wrap(&self, p: DVec2) -> DVec3 {
        self.wrap_off(p, 0.0)
    }

    /// Map 2 with a distance `off_mm` to the abaxial side. What stands off the cup is limited softly to the
    /// petal's share of the space there.
    fn wrap_off(&self, p: DVec2, off_mm: f64) -> DVec3 {
        let f = &self.form;
        let from_apex = DVec2::new(p.x, p.y + self.apex_mm);
        let s = from_apex.length() - self.apex_mm;
        let arc = from_apex.length() * from_apex.x.atan2(from_apex.y);
        // The width of the petal is wound on its own spiral: first the radius at its middle, then the
        // layer that the resulting angle climbs to.
        let radius = self.bloom.meridian(f.layer, s).r_mm;
        let turn = arc / radius;
        let layer = f.layer + self.bloom.overlap() * turn;
        let m = self.bloom.meridian(layer, s);
        let out = 2.0 * p.x / f.width_mm;
        let along = (p.y / f.length_mm).clamp(0.0, 1.2);
        let wave = (f.ruffle_waves * std::f64::consts::PI * out + f.ruffle_phase).sin();
        let lift = f.cup_mm * out * out * (FRAC_PI_2 * along).sin()
            + f.ruffle_mm * wave * smooth_step(0.3, 1.0, along.max(out.abs() * 0.8))
            - off_mm;
        let space = self.bloom.clearance_mm(layer, s, f.width_mm) + 1e-6;
        let lift = soft_limit(lift, space * if lift < 0.0 { SPACE_OUTSIDE } else { SPACE_INSIDE });
        let (sin, cos) = m.heading.sin_cos();
        let r = m.r_mm - lift * cos;
        self.bloom.place(r, f.azimuth_deg.to_radians() + turn, m.z_mm + lift * sin)
    }

    /// Map 3: the margin rolled back.
    fn roll(&self, p: DVec2) -> DVec3 {
        let (q, normal, roll) = self.to_rim(p);
        let width = self.form.roll_width_mm;
        if q >= width || roll.abs() < 1e-9 {
            return self.wrap(p);
        }
        let travel = width - q;
        let (mut forward, mut down) = (0.0, 0.0);
        for k in 0..ROLL_STEPS {
            let x = travel * (k as f64 + 0.5) / ROLL_STEPS as f64;
            let phi = roll * (x / width).powi(2);
            forward += phi.cos();
            down += phi.sin();
        }
        let step = travel / ROLL_STEPS as f64;
        self.wrap_off(p + normal * (forward * step - travel), down * step)
    }

    /// Smooth distance to the rim, its outward normal and turn nearby.
    fn to_rim(&self, p: DVec2) -> (f64, DVec2, f64) {
        let nearest = self.rim.iter().map(|r| r.at.distance_squared(p)).fold(f64::INFINITY, f64::min).sqrt();
        let softness = 0.6 + 0.25 * nearest;
        let (mut weight, mut q, mut normal, mut roll) = (0.0, 0.0, DVec2::ZERO, 0.0);
        for r in &self.rim {
            let w = (-(r.at.distance(p) - nearest) / softness).exp();
            weight += w;
            q += w * (r.at - p).dot(r.normal);
            normal += w * r.normal;
            roll += w * r.roll;
        }
        ((q / weight).max(0.0), normal.normalize_or(DVec2::Y), roll / weight)
    }
}

impl Sheet for PetalSurface<'_> {
    fn at(&self, u: f64, v: f64) -> DVec3 {
        self.roll(self.blade(u, v))
    }

    fn uv(&self, u: f64, v: f64) -> DVec2 {
        let p = self.blade(u, v);
        let [w, l] = self.uv_scale_mm().map(f64::from);
        DVec2::new(p.x / w + 0.5, p.y / l)
    }

    fn uv_scale_mm(&self) -> [f32; 2] {
        [self.form.width_mm as f32, (self.form.length_mm + self.form.tip_mm.max(0.0)) as f32]
    }
}

/// `x` for small values, at most `limit` in size.
fn soft_limit(x: f64, limit: f64) -> f64 {
    x / (1.0 + (x / limit).powi(4)).powf(0.25)
}

fn smooth_step(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flower::RoseDescription;
    use crate::flower::sheet::mesh;

    fn bloom() -> Bloom {
        let d = RoseDescription::hybrid_tea();
        Bloom::new(&d.bloom, 36, 40.0, 46.0, 6.0)
    }

    fn plain() -> PetalForm {
        PetalForm {
            layer: 26.0,
            azimuth_deg: 0.0,
            length_mm: 46.0,
            width_mm: 48.0,
            claw_width_mm: 9.0,
            widest: 0.6,
            tip_mm: 0.0,
            cup_mm: 0.0,
            roll_deg: [0.0; 3],
            roll_width_mm: 10.0,
            ruffle_mm: 0.0,
            ruffle_waves: 2.0,
            ruffle_phase: 0.0,
        }
    }

    fn area(form: PetalForm, bloom: &Bloom) -> f32 {
        let m = mesh(&PetalSurface::new(form, bloom), 60, 80, 1.5);
        (0..m.triangles.len()).map(|f| m.face_area(f)).sum()
    }

    #[test]
    fn a_plain_petal_lies_on_its_cup() {
        let bloom = bloom();
        let petal = PetalSurface::new(plain(), &bloom);
        for v in [0.0, 0.2, 0.5, 0.8, 1.0] {
            let p = petal.at(0.5, v);
            let m = bloom.meridian(26.0, 46.0 * v);
            assert!((p.truncate().length() - m.r_mm).abs() < 1e-6 && (p.z - m.z_mm).abs() < 1e-6);
        }
    }

    #[test]
    fn bending_nearly_keeps_area() {
        let bloom = bloom();
        let petal = PetalSurface::new(plain(), &bloom);
        let n = 400;
        let flat: f64 = (0..n)
            .flat_map(|i| (0..n).map(move |j| (i, j)))
            .map(|(i, j)| {
                let p = |a: usize, b: usize| petal.blade(a as f64 / n as f64, b as f64 / n as f64);
                (p(i + 1, j) - p(i, j)).perp_dot(p(i, j + 1) - p(i, j))
            })
            .sum();
        let wrapped = f64::from(area(plain(), &bloom));
        let rolled = f64::from(area(PetalForm { roll_deg: [100.0, 60.0, 100.0], ..plain() }, &bloom));
        // A doubly curved cup must stretch a flat petal; living petals grow to it.
        assert!((wrapped / flat - 1.0).abs() < 0.15, "{wrapped} {flat}");
        // Where the next petal stops the roll, its margin is pressed flat and loses some length.
        assert!((rolled / wrapped - 1.0).abs() < 0.12, "{rolled} {wrapped}");
    }

    #[test]
    fn the_rim_rolls_to_the_abaxial_side() {
        let bloom = bloom();
        let still = PetalSurface::new(plain(), &bloom);
        let rolled = PetalSurface::new(PetalForm { roll_deg: [90.0; 3], ..plain() }, &bloom);
        let heading = bloom.meridian(26.0, 46.0).heading;
        let adaxial = DVec3::new(-heading.cos(), 0.0, heading.sin());
        assert!((rolled.at(0.5, 1.0) - still.at(0.5, 1.0)).dot(adaxial) < -1.0);
        assert!((rolled.at(0.5, 0.5) - still.at(0.5, 0.5)).length() < 1e-9);
    }

    #[test]
    fn texture_coordinates_are_the_flat_petal() {
        let bloom = bloom();
        let petal = PetalSurface::new(PetalForm { tip_mm: 2.0, ..plain() }, &bloom);
        let [w, l] = petal.uv_scale_mm().map(f64::from);
        for (u, v) in [(0.0, 0.0), (0.3, 0.7), (0.5, 1.0), (1.0, 1.0)] {
            let t = petal.uv(u, v);
            assert!(t.min_element() >= -1e-9 && t.max_element() <= 1.0 + 1e-9, "{t}");
            assert!((DVec2::new((t.x - 0.5) * w, t.y * l) - petal.blade(u, v)).length() < 1e-6);
        }
    }
}

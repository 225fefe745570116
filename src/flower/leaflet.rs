//! One leaflet: an ovate blade with a saw edge, folded along the midrib and raised between its veins.
//!
//! Model, with x across and y along the flat blade, h its half width, v = y / length:
//! 1. outline: h(v) = width/2 (v / p)^(p q) ((1 - v) / (1 - p))^((1 - p) q), widest at p, q = 1.7;
//! 2. teeth: the margin moves outwards and towards the tip by depth saw(n y / length), a tooth that rises over four
//!    fifths of its pitch and falls over the last;
//! 3. the midline bends down by `arch` along the leaflet; across it the halves rise by `fold`, level off towards
//!    the margin and wave;
//! 4. veins: side veins leave the midrib towards the tip, alternating, at distances length / (veins + 1) and an angle
//!    of 50 deg, and bend forward; between them the blade is raised by `relief` (1 - exp(-(distance / 0.14 pitch)^2)),
//!    between the ties of the net by a quarter of it; along the midrib runs a groove of 1.4 `relief`.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | length, width | `length_mm`, `width_mm` | mm | see [`crate::flower::leaf`] |
//! | p | `widest` | - | 0.42 |
//! | n, depth | `teeth`, `tooth_mm` | -, mm | 22, 0.9 |
//! | arch, fold | `arch_deg`, `fold_deg` | deg | 28, 12 |
//! | veins, relief | `veins`, `relief_mm` | -, mm | 9, 0.3 |
//! | wave | `wave_mm` | mm | 0.9 |
//!
//! Limits: the flat blade has the length and width asked for: `a_leaflet_has_its_size_and_teeth`. The net of small
//! veins needs a mesh finer than its pitch and is left out of coarser ones. Our reading of living leaves.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use crate::flower::phyllotaxis::vary;
use crate::flower::sheet::{Sheet, mesh_on};
use crate::flower::smooth_step;
use crate::geometry::Mesh;

/// The traits of one leaflet.
#[derive(Clone, Debug, PartialEq)]
pub struct LeafletForm {
    /// Stalk to tip, mm.
    pub length_mm: f64,
    /// Largest width without teeth, mm.
    pub width_mm: f64,
    /// Where it is widest, as a part of its length.
    pub widest: f64,
    /// Teeth of each margin.
    pub teeth: u32,
    /// Height of a tooth, mm.
    pub tooth_mm: f64,
    /// Turn of the midline, downwards from stalk to tip, deg.
    pub arch_deg: f64,
    /// Rise of each half from the midrib, deg.
    pub fold_deg: f64,
    /// Amplitude of the waves of the margin, mm.
    pub wave_mm: f64,
    /// Side veins of each half.
    pub veins: u32,
    /// Height of the blade between its side veins, mm.
    pub relief_mm: f64,
    /// Seed of its irregularities.
    pub seed: u64,
    /// Size of its irregularities: 0 = none, 1 = natural.
    pub irregularity: f64,
}

/// Where a leaflet stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeafletPlace {
    /// Where the blade begins, mm.
    pub base_mm: DVec3,
    /// Unit direction of the midrib there.
    pub along: DVec3,
    /// Unit normal of the adaxial side there.
    pub up: DVec3,
}

/// The mid-surface of a leaflet.
#[derive(Clone, Debug)]
pub struct LeafletSurface {
    form: LeafletForm,
    place: LeafletPlace,
    detail: f64,
    /// Width of a cell of the mesh, mm: what is finer is left out.
    pitch_mm: f64,
}

/// Part of the length along which the margin has teeth.
const TOOTHED: (f64, f64) = (0.10, 0.975);
/// Part of a tooth along which it rises.
const RISE: f64 = 0.8;
/// Half width where the blade begins and at its tip, mm.
const ENDS_MM: (f64, f64) = (0.35, 0.04);
/// Cotangent of the angle of the side veins, and how they bend forward.
const VEIN: (f64, f64) = (0.84, 0.32);

impl LeafletSurface {
    /// A leaflet for a mesh of that fineness.
    pub fn new(form: LeafletForm, place: LeafletPlace, detail: f64) -> Self {
        let along = place.along.normalize_or(DVec3::X);
        let up = (place.up - along * place.up.dot(along)).normalize_or(along.any_orthonormal_vector());
        let pitch_mm = form.length_mm / (42.0 * detail);
        Self { form, place: LeafletPlace { along, up, ..place }, detail, pitch_mm }
    }

    /// Meshes it. Detail 1 gives each tooth a tip and a notch.
    pub fn mesh(&self) -> Mesh {
        let detail = self.detail;
        let half = ((5.0 * detail).round() as usize).max(2);
        // Columns crowd at the midrib and at the margin.
        let side = |i: usize| {
            let t = i as f64 / half as f64;
            0.5 * (t - 0.09 * (TAU * t).sin())
        };
        let columns: Vec<f64> = (0..=2 * half)
            .map(|i| if i < half { 0.5 - side(half - i) } else { 0.5 + side(i - half) })
            .collect();
        mesh_on(self, &columns, &self.rows())
    }

    /// Rows on the tips and notches of teeth, more of them in fine meshes; no teeth in very coarse ones.
    fn rows(&self) -> Vec<f64> {
        let detail = self.detail;
        let teeth = self.form.teeth as f64;
        let ends = |n: f64| ((n * detail).ceil() as usize).max(2);
        let mut rows: Vec<f64> =
            (0..ends(4.0)).map(|j| TOOTHED.0 * (j as f64 / ends(4.0) as f64).powf(1.6)).collect();
        if self.form.teeth == 0 || self.coarse() {
            let n = ends(14.0);
            rows.extend((0..n).map(|j| TOOTHED.0 + (TOOTHED.1 - TOOTHED.0) * j as f64 / n as f64));
        } else {
            let rising = (detail.round() as usize).max(1);
            for tooth in 0..self.form.teeth {
                let at = |part: f64| TOOTHED.0 + (TOOTHED.1 - TOOTHED.0) * (f64::from(tooth) + part) / teeth;
                rows.extend((0..rising).map(|k| at(RISE * k as f64 / rising as f64)));
                rows.push(at(RISE));
            }
        }
        let n = ends(2.0);
        rows.extend((0..=n).map(|j| TOOTHED.1 + (1.0 - TOOTHED.1) * j as f64 / n as f64));
        rows
    }

    fn coarse(&self) -> bool {
        self.form.teeth > 0
            && self.pitch_mm
                > 1.2 * self.form.length_mm * (TOOTHED.1 - TOOTHED.0) / f64::from(self.form.teeth)
    }

    /// Half width of the blade without its teeth, mm.
    pub fn half_width_mm(&self, v: f64) -> f64 {
        let (f, p, q) = (&self.form, self.form.widest, 1.7);
        let v = v.clamp(0.0, 1.0);
        let blade = (v / p).powf(p * q) * ((1.0 - v) / (1.0 - p)).powf((1.0 - p) * q);
        let foot = ENDS_MM.0 * (1.0 - v / 0.2).max(0.0);
        ENDS_MM.1 + (0.5 * f.width_mm * blade).hypot(foot)
    }

    /// The flat blade, (across, along) in mm.
    fn flat(&self, u: f64, v: f64) -> DVec2 {
        let f = &self.form;
        let across = 2.0 * u - 1.0;
        let half = self.half_width_mm(v);
        let mut p = DVec2::new(across * half, v * f.length_mm);
        if f.teeth > 0 && !self.coarse() {
            let phase = f64::from(f.teeth) * (v - TOOTHED.0) / (TOOTHED.1 - TOOTHED.0);
            if phase > 0.0 && v < TOOTHED.1 {
                let (tooth, part) = (phase.floor() as u32, phase.fract());
                // The rows of the mesh lie exactly on tips and notches.
                let part = if part > 1.0 - 1e-9 { 0.0 } else { part };
                let saw = if part <= RISE { part / RISE } else { (1.0 - part) / (1.0 - RISE) };
                let side = if across < 0.0 { 0 } else { 1 };
                let natural = 1.0 + 0.3 * f.irregularity * vary(f.seed, tooth, 20 + side);
                let size = f.tooth_mm * natural * (half / (0.3 * f.width_mm)).min(1.0) * across.abs().powi(6);
                // A tip reaches forward, but not over the next notch.
                let pitch = f.length_mm * (TOOTHED.1 - TOOTHED.0) / f64::from(f.teeth);
                let forward = (0.75 * size).min(0.8 * (1.0 - RISE) * pitch);
                p += DVec2::new(across.signum() * size, forward) * saw;
            }
            // The two margins do not mirror each other tooth by tooth.
            let pitch = f.length_mm * (TOOTHED.1 - TOOTHED.0) / f64::from(f.teeth);
            p.y += 0.22 * pitch * across * (PI * v).sin();
        }
        p
    }

    /// Height of the blade above its midline, along the normal, mm.
    fn height_mm(&self, p: DVec2) -> f64 {
        let f = &self.form;
        let v = (p.y / f.length_mm).clamp(0.0, 1.0);
        let half = self.half_width_mm(v);
        let out = (p.x.abs() / half).min(1.2);
        let soft = 0.06 * f.width_mm;
        let fold = f.fold_deg.to_radians().tan() * (p.x.hypot(soft) - soft);
        let level = -0.016 * f.fold_deg.to_radians().tan() * p.x * p.x;
        let side = if p.x < 0.0 { 0 } else { 1 };
        let wave = f.wave_mm
            * f.irregularity.min(1.5)
            * out
            * out
            * (half / (0.5 * f.width_mm))
            * ((1.6 + 0.5 * vary(f.seed, side, 30)) * TAU * v + PI * vary(f.seed, side, 31)).sin();
        fold + level + wave + self.relief_mm(p, out)
    }

    /// Height that the veins make, mm; `out` is the part of the half width.
    fn relief_mm(&self, p: DVec2, out: f64) -> f64 {
        let f = &self.form;
        let x = p.x.abs();
        let v = (p.y / f.length_mm).clamp(0.0, 1.0);
        let groove = -1.4 * f.relief_mm * (-(x / 0.7).powi(2)).exp() * (1.0 - v);
        if f.veins == 0 {
            return groove;
        }
        let pitch = f.length_mm / f64::from(f.veins + 1);
        let side = if p.x < 0.0 { 0.0 } else { 0.5 };
        // Follow the vein back to the midrib.
        let bend = VEIN.1 * x * x / (0.5 * f.width_mm);
        let start = (p.y - VEIN.0 * x - bend) / pitch + side;
        let number = start.round();
        let natural = 0.12 * f.irregularity * vary(f.seed, number as i64 as u32, 40 + 2 * side as u32);
        let distance = (start - number - natural).abs() * pitch * 0.77;
        let between = 1.0 - (-(distance / (0.14 * pitch)).powi(2)).exp();
        let fade = 1.0 - smooth_step(0.75, 1.0, out);
        let mut height = f.relief_mm * between * smooth_step(0.0, 0.12, out) * (0.25 + 0.75 * fade);
        // Ties from vein to vein and the meshes between them.
        let net_mm = 0.28 * pitch;
        let fine = 1.0 - smooth_step(0.2, 0.45, self.pitch_mm / net_mm);
        if fine > 0.0 {
            let along = (x.hypot(VEIN.0 * x) + 0.35 * (distance * 9.0 / pitch).sin()) / net_mm;
            let row = number + (distance / net_mm).floor();
            let tie = (along + 0.5 * vary(f.seed, row as i64 as u32, 50)).fract();
            let off = tie.min(1.0 - tie);
            let other = (distance / net_mm).fract();
            let off = off.min(other.min(1.0 - other));
            height -= 0.28 * f.relief_mm * fine * fade * between * (-(off / 0.16).powi(2)).exp();
        }
        height + groove
    }
}

impl Sheet for LeafletSurface {
    fn at(&self, u: f64, v: f64) -> DVec3 {
        let p = self.flat(u, v);
        let LeafletPlace { base_mm, along, up } = self.place;
        let side = up.cross(along);
        // The midline is an arc that starts a little raised.
        let turn = -self.form.arch_deg.to_radians() / self.form.length_mm;
        let start = 0.35 * self.form.arch_deg.to_radians();
        let angle = start + turn * p.y;
        let (forward, rise) = if turn.abs() < 1e-9 {
            (p.y * start.cos(), p.y * start.sin())
        } else {
            ((angle.sin() - start.sin()) / turn, (start.cos() - angle.cos()) / turn)
        };
        let normal = up * angle.cos() - along * angle.sin();
        let height = self.height_mm(p);
        // What rises has less room to the side.
        let flat = 1.0 / (1.0 + self.form.fold_deg.to_radians().tan().powi(2)).sqrt();
        base_mm + along * forward + up * rise + side * (p.x * flat) + normal * height
    }

    fn uv(&self, u: f64, v: f64) -> DVec2 {
        let p = self.flat(u, v);
        let [w, l] = self.uv_scale_mm().map(f64::from);
        DVec2::new(p.x / w + 0.5, (p.y / l + 0.02).clamp(0.0, 1.0))
    }

    fn uv_scale_mm(&self) -> [f32; 2] {
        let f = &self.form;
        [(f.width_mm + 3.0 * f.tooth_mm + 0.2) as f32, (1.06 * f.length_mm + 1.5 * f.tooth_mm) as f32]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_leaflet_has_its_size_and_teeth() {
        let form = LeafletForm {
            length_mm: 50.0,
            width_mm: 32.0,
            widest: 0.42,
            teeth: 20,
            tooth_mm: 1.0,
            arch_deg: 0.0,
            fold_deg: 0.0,
            wave_mm: 0.0,
            veins: 0,
            relief_mm: 0.0,
            seed: 1,
            irregularity: 0.0,
        };
        let place = LeafletPlace { base_mm: DVec3::ZERO, along: DVec3::Y, up: DVec3::Z };
        let leaflet = LeafletSurface::new(form.clone(), place, 1.0);
        let m = leaflet.mesh();
        m.validate("leaflet").expect("valid");
        let (low, high) = m.bounds();
        assert!((high.y - low.y - 50.0).abs() < 0.1 && low.y.abs() < 0.1, "{low} {high}");
        assert!((high.x - low.x - 32.0).abs() < 2.2 && high.x - low.x > 32.0, "{low} {high}");
        assert!(high.z.abs() < 1e-5 && m.normals.iter().all(|n| n.z > 0.999));
        // Each tooth is a local maximum of the distance from the midrib along the right margin.
        let columns = 11;
        let margin: Vec<f64> = m
            .positions
            .iter()
            .skip(columns - 1)
            .step_by(columns)
            .map(|p| f64::from(p.x.abs()) - leaflet.half_width_mm(f64::from(p.y) / 50.0))
            .collect();
        let tips = margin.windows(3).filter(|w| w[1] > w[0] && w[1] > w[2]).count();
        assert_eq!(tips, 20, "{margin:?}");
        // A coarse mesh has none of them.
        let coarse = LeafletSurface::new(form, place, 0.2).mesh();
        assert!(coarse.triangles.len() < 80, "{}", coarse.triangles.len());
    }
}

//! One leaflet: an ovate blade with a saw edge, folded along the midrib and raised between its veins.
//!
//! Model, with x across and y along the flat blade, h its half width, t the part of the length where a row of the blade
//! meets the margin:
//! 1. outline: h(t) = width/2 (t / p)^(p q) ((1 - t) / (1 - p))^((1 - p) q), widest at p, q = 1.7; rows run as side veins
//!    do, from the midrib at t - 0.75 t (1 - t) forward to the margin;
//! 2. teeth: the margin moves outwards and towards the tip by depth saw(n t), a tooth that rises over four fifths of its
//!    pitch and falls over the last;
//! 3. the midline bends down by `arch` along the leaflet; across it the halves rise by `fold`, level off towards
//!    the margin and wave;
//! 4. veins: side veins end in notches, every second or third one, on the two sides in turn; between them the blade is raised
//!    by `relief` (1 - exp(-(distance / 0.2 pitch)^2)), between the ties of the net by a third of it; along the midrib runs a
//!    groove of 1.4 `relief`.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | length, width | `length_mm`, `width_mm` | mm | see [`crate::flower::leaf`] |
//! | p | `widest` | - | 0.42 |
//! | n, depth | `teeth`, `tooth_mm` | -, mm | 22, 0.9 |
//! | arch, fold | `arch_deg`, `fold_deg` | deg | 28, 12 |
//! | veins, relief | `veins`, `relief_mm` | -, mm | 9, 0.12 |
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
const TOOTHED: (f64, f64) = (0.07, 0.975);
/// Part of a tooth along which it rises.
const RISE: f64 = 0.8;
/// Half width where the blade begins and at its tip, mm.
const ENDS_MM: (f64, f64) = (0.35, 0.04);
/// How far a row's end at the margin lies ahead of its start at the midrib: this times t (1 - t) of the length.
const SWEEP: f64 = 0.75;

/// A point of the flat blade.
struct Flat {
    /// Across and along, mm.
    at: DVec2,
    /// Part of the half width, -1 to 1.
    across: f64,
    /// Where its row, or side vein, meets the margin, as a part of the length.
    row: f64,
}

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
        let ends = |n: f64| ((n * self.detail).ceil() as usize).max(2);
        let spread =
            |from: f64, to: f64, n: usize| (0..n).map(move |j| from + (to - from) * j as f64 / n as f64);
        let mut rows: Vec<f64> = spread(0.0, 1.0, ends(5.0)).map(|part| TOOTHED.0 * part.powf(1.6)).collect();
        let teeth = if self.coarse() { 0 } else { self.form.teeth as usize };
        let per_tooth = 2 * (self.detail.round() as usize).max(1);
        rows.extend(spread(TOOTHED.0, TOOTHED.1, if teeth == 0 { ends(14.0) } else { teeth * per_tooth }));
        rows.extend(spread(TOOTHED.1, 1.0, ends(3.0)));
        rows.push(1.0);
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

    /// Map 1 and 2: the flat blade.
    fn flat(&self, u: f64, v: f64) -> Flat {
        let f = &self.form;
        let across = 2.0 * u - 1.0;
        let out = across.abs();
        let mut row = v;
        let (mut saw, mut tooth) = (0.0, 0);
        let pitch = (TOOTHED.1 - TOOTHED.0) / f64::from(f.teeth.max(1));
        if f.teeth > 0 && !self.coarse() && v > TOOTHED.0 && v < TOOTHED.1 {
            let phase = (v - TOOTHED.0) / pitch;
            // The rows of the mesh lie exactly on tips and notches.
            let nearest = (2.0 * phase).round() / 2.0;
            let phase = if (phase - nearest).abs() < 1e-9 { nearest } else { phase };
            tooth = phase as u32;
            // Rows are even at the midrib; at the margin the tip comes after most of the tooth.
            let part = phase.fract();
            let warped =
                if part < 0.5 { 2.0 * RISE * part } else { RISE + (2.0 * part - 1.0) * (1.0 - RISE) };
            saw = if part < 0.5 { 2.0 * part } else { 2.0 - 2.0 * part };
            row += pitch * (warped - part) * out.powi(4);
        }
        let half = self.half_width_mm(row);
        let start = row - SWEEP * row * (1.0 - row);
        let along = start + (row - start) * (0.72 * out + 0.28 * out * out);
        let mut at = DVec2::new(across * half, along * f.length_mm);
        if saw > 0.0 {
            let side = if across < 0.0 { 0 } else { 1 };
            let natural = 1.0 + 0.3 * f.irregularity * vary(f.seed, tooth, 20 + side);
            let size = f.tooth_mm * natural * (half / (0.3 * f.width_mm)).min(1.0) * out.powi(6);
            // A tip reaches forward, but not over the next notch.
            let forward = (0.75 * size).min(0.8 * (1.0 - RISE) * pitch * f.length_mm);
            at += DVec2::new(across.signum() * size, forward) * saw;
        }
        Flat { at, across, row }
    }

    /// Height of the blade above its midline, along the normal, mm.
    fn height_mm(&self, p: &Flat) -> f64 {
        let f = &self.form;
        let (x, out) = (p.at.x, p.across.abs());
        let half = self.half_width_mm(p.row);
        let soft = 0.06 * f.width_mm;
        let slope = f.fold_deg.to_radians().tan();
        let fold = slope * (x.hypot(soft) - soft) - 0.016 * slope * x * x;
        let side = if x < 0.0 { 0 } else { 1 };
        let phase = (1.6 + 0.5 * vary(f.seed, side, 30)) * TAU * p.row + PI * vary(f.seed, side, 31);
        let wave =
            f.wave_mm * f.irregularity.min(1.5) * out * out * (half / (0.5 * f.width_mm)) * phase.sin();
        fold + wave + self.relief_mm(p)
    }

    /// Map 4: height that the veins make, mm.
    fn relief_mm(&self, p: &Flat) -> f64 {
        let f = &self.form;
        let out = p.across.abs();
        let groove = -1.4 * f.relief_mm * (-(p.at.x / 0.7).powi(2)).exp() * (1.0 - p.row);
        if f.veins == 0 {
            return groove;
        }
        // A vein ends in every second or third notch, on the two sides in turn.
        // A margin without teeth has a vein wherever one is due.
        let teeth = f64::from(if f.teeth == 0 { f.veins } else { f.teeth });
        let step = (teeth / f64::from(f.veins)).round().max(1.0);
        let side = if p.across < 0.0 { 0.0 } else { (0.5 * step).floor() / step };
        let vein = teeth * (p.row - TOOTHED.0) / (TOOTHED.1 - TOOTHED.0) / step + side;
        let off = (vein - vein.round()).abs();
        let pitch_mm = 0.75 * step * f.length_mm * (TOOTHED.1 - TOOTHED.0) / teeth;
        let between = 1.0 - (-(off / 0.2).powi(2)).exp();
        let fade = 1.0 - smooth_step(0.8, 1.0, out);
        let rise = smooth_step(0.0, 0.15, out) * (0.3 + 0.7 * fade);
        let mut height = f.relief_mm * between * rise;
        // Ties between two veins, and the meshes between ties.
        let net_mm = 0.3 * pitch_mm;
        let fine = 1.0 - smooth_step(0.25, 0.5, self.pitch_mm / net_mm);
        if fine > 0.0 {
            let along = 1.25 * p.at.x.abs() / net_mm;
            let across = 2.0 * vein + 0.18 * (2.3 * along).sin() * (7.1 * vein).cos();
            let along = along + vary(f.seed, across.floor() as i64 as u32, 50);
            let tie = (along.fract() - 0.5).abs();
            let line = (across.fract() - 0.5).abs();
            let edge = 0.5 - tie.max(line);
            height -= 0.35 * f.relief_mm * fine * rise * (-(edge / 0.14).powi(2)).exp();
        }
        height + groove
    }
}

impl Sheet for LeafletSurface {
    fn at(&self, u: f64, v: f64) -> DVec3 {
        let flat = self.flat(u, v);
        let p = flat.at;
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
        let height = self.height_mm(&flat);
        // What rises has less room to the side.
        let flat = 1.0 / (1.0 + self.form.fold_deg.to_radians().tan().powi(2)).sqrt();
        base_mm + along * forward + up * rise + side * (p.x * flat) + normal * height
    }

    fn uv(&self, u: f64, v: f64) -> DVec2 {
        let p = self.flat(u, v).at;
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
        let tips = margin.windows(3).filter(|w| w[1] > w[0] + 0.1 && w[1] > w[2] + 0.1).count();
        assert_eq!(tips, 20, "{margin:?}");
        // A coarse mesh has none of them.
        let coarse = LeafletSurface::new(form, place, 0.2).mesh();
        assert!(coarse.triangles.len() < 80, "{}", coarse.triangles.len());
    }
}

//! Grows a rose: where each petal stands, what its age makes of it, and the meshes of all organs.
//!
//! Petals whose meshes still meet a neighbour or themselves lose some of their roll and unevenness, again and again
//! until none meets, and some of their width if that does not help: `steps` says how often,
//!
//! ```text
//! ease = 0.8^steps        width = 0.96^max(0, steps - 4) width of the outline
//! ```
//!
//! Stages 0.05 of openness apart are settled in whole steps. In between, steps run linearly from stage to stage and petals that
//! still meet take small steps more, so that a flower that opens does not twitch. Guarded by `petals_do_not_cross`,
//! `petals_do_not_pop_as_they_open`.

use rayon::prelude::*;

use crate::Result;
use crate::flower::bloom::{Bloom, OVERBLOWN};
use crate::flower::green;
use crate::flower::margin::Facet;
use crate::flower::neighbours::Neighbours;
use crate::flower::outline::Outline;
use crate::flower::petal::{PetalForm, PetalSurface};
use crate::flower::petal_map::PetalTraits;
use crate::flower::phyllotaxis::{Spiral, vary};
use crate::flower::rose::RoseDescription;
use crate::flower::sheet::{Sheet, Smooth, mesh};
use crate::flower::veins::Veins;
use crate::flower::{Flower, Organ, OrganKind};
use crate::geometry::Mesh;
use crate::geometry::crossings::crossings;

/// Grows the rose.
pub fn grow(description: &RoseDescription) -> Result<Flower> {
    description.validate("rose")?;
    let d = description;
    let Petals { bloom, forms, neighbours } = placed(d);
    let petals: Vec<Organ> = forms
        .par_iter()
        .zip(0..d.petals)
        .map(|(form, index)| {
            let petal = PetalSurface::new(form, &bloom, &neighbours);
            let mesh = petal_mesh(&petal, form, &bloom, d.detail);
            let traits = PetalTraits {
                outline: form.outline.clone(),
                veins: form.veins,
                age: bloom.age(form.layer).min(1.0),
                seed: form.seed,
            };
            let uv_scale_mm = petal.uv_scale_mm();
            Organ { kind: OrganKind::Petal, index, mesh, uv_scale_mm, traits: Some(traits) }
        })
        .collect();
    let mut flower = Flower { organs: petals };
    green::grow(&mut flower, d, d.openness);
    Ok(flower)
}

/// The petals of a flower in their places.
struct Petals {
    bloom: Bloom,
    forms: Vec<PetalForm>,
    neighbours: Neighbours,
}

impl Petals {
    /// Petals at that openness that took these steps of settling.
    fn new(d: &RoseDescription, openness: f64, steps: &[f64]) -> Self {
        let p = &d.petal;
        let radius_mm = d.stem.receptacle_radius_mm;
        let bloom = Bloom::new(&d.bloom, d.petals, p.inner_length_mm, p.length_mm, radius_mm, openness)
            .sway(d.seed, d.irregularity);
        let mut forms: Vec<PetalForm> = (0..d.petals).map(|index| petal_form(d, &bloom, index)).collect();
        let neighbours = Neighbours { seats: forms.iter().map(PetalForm::seat).collect() };
        for (form, steps) in forms.iter_mut().zip(steps) {
            take_steps(form, *steps);
        }
        Self { bloom, forms, neighbours }
    }

    fn grown(&self, form: &PetalForm, detail: f64) -> Mesh {
        petal_mesh(&PetalSurface::new(form, &self.bloom, &self.neighbours), form, &self.bloom, detail)
    }

    /// Settles petals until none meets another as a mesh of this detail, each time by the next of `sizes`; the steps of each.
    fn settle(&mut self, detail: f64, sizes: impl Iterator<Item = f64>) -> Vec<f64> {
        let mut steps = vec![0.0; self.forms.len()];
        let mut meshes: Vec<Mesh> = self.forms.par_iter().map(|f| self.grown(f, detail)).collect();
        for size in sizes {
            let mut meets = vec![false; meshes.len()];
            for c in crossings(&meshes.iter().collect::<Vec<_>>()) {
                c.meshes.iter().for_each(|&k| meets[k as usize] = true);
            }
            let met: Vec<usize> = (0..meets.len()).filter(|k| meets[*k]).collect();
            if met.is_empty() {
                break;
            }
            for k in &met {
                take_steps(&mut self.forms[*k], size);
                steps[*k] += size;
            }
            let again: Vec<Mesh> = met.par_iter().map(|k| self.grown(&self.forms[*k], detail)).collect();
            met.into_iter().zip(again).for_each(|(k, mesh)| meshes[k] = mesh);
        }
        steps
    }
}

/// The petals of the flower, none meeting another.
fn placed(d: &RoseDescription) -> Petals {
    let stage = |k: f64| {
        let mut petals = Petals::new(d, (STAGE * k).min(OVERBLOWN), &[]);
        petals.settle(d.detail.min(STAGE_DETAIL), std::iter::repeat_n(1.0, STAGE_STEPS))
    };
    let at = d.openness / STAGE;
    let (near, below) = (at.round(), at.floor());
    let steps = if (at - near).abs() < 1e-6 {
        stage(near)
    } else {
        stage(below).iter().zip(stage(below + 1.0)).map(|(a, b)| a + (b - a) * (at - below)).collect()
    };
    let mut petals = Petals::new(d, d.openness, &steps);
    petals.settle(
        d.detail.min(SETTLED_DETAIL),
        (0..SMALL_STEPS).map(|k| SMALL_STEP * SMALL_STEP_GROWTH.powi(k)),
    );
    petals
}

/// A petal takes so many steps more: it loses roll and unevenness, then width.
fn take_steps(form: &mut PetalForm, steps: f64) {
    // What meets without roll does so at its flanks.
    let narrower = |steps: f64| NARROWER.powf((steps - FIRST_NARROWED).max(0.0));
    let before = form.ease.ln() / EASE.ln();
    form.ease = EASE.powf(before + steps);
    form.outline.width_mm *= narrower(before + steps) / narrower(before);
}

fn petal_mesh(petal: &PetalSurface, form: &PetalForm, bloom: &Bloom, detail: f64) -> Mesh {
    // A petal wound tightly about the axis needs short chords.
    // ... but no more of them than for a few turns.
    let turn = form.outline.width_mm / bloom.meridian(form.layer, 0.9 * form.outline.length_mm).r_mm;
    let turn = turn.min(MOST_TURNS);
    let across = (ACROSS * detail).max(turn / LONGEST_CHORD * detail.max(1.0));
    let along = ALONG * detail;
    if detail <= MODELLED_DETAIL {
        return mesh(petal, count(across), count(along), CROWDING);
    }
    let part = MODELLED_DETAIL / detail;
    let modelled = Smooth::new(petal, count(part * across), count(part * along), CROWDING);
    mesh(&modelled, count(across), count(along), CROWDING)
}

/// The nearest even number, so that petals have vertices along their middle.
fn count(n: f64) -> usize {
    2 * ((0.5 * n).round() as usize).max(2)
}

/// Columns and rows of a petal of detail 1, and how they crowd towards the rim.
const ACROSS: f64 = 28.0;
const ALONG: f64 = 28.0;
const CROWDING: f64 = 1.6;
/// Beyond this detail the mid-surface is interpolated: its smallest waves are 5 mm long.
const MODELLED_DETAIL: f64 = 4.0;
/// What a petal keeps of its roll and unevenness in a step of settling.
const EASE: f64 = 0.8;
/// What it keeps of its width in each step after the first of them.
const NARROWER: f64 = 0.96;
const FIRST_NARROWED: f64 = 4.0;
/// Openness between two stages, the finest meshes of stages and their most steps.
const STAGE: f64 = 0.05;
const STAGE_DETAIL: f64 = 0.6;
const STAGE_STEPS: usize = 16;
/// Between stages: the first step, how much larger each next one is, and the most of them.
const SMALL_STEP: f64 = 0.1;
const SMALL_STEP_GROWTH: f64 = 1.4;
const SMALL_STEPS: i32 = 14;
/// Finest meshes that are settled: finer ones follow the same surfaces.
const SETTLED_DETAIL: f64 = 2.5;

/// The traits of petal `index`.
fn petal_form(d: &RoseDescription, bloom: &Bloom, index: u32) -> PetalForm {
    let p = &d.petal;
    let v = |k| d.irregularity * vary(d.seed, index, k);
    let spiral = Spiral { divergence_deg: d.divergence_deg, jitter_deg: 4.0 * d.irregularity, seed: d.seed };
    // Outer petals have room to stand out of order.
    let loose = f64::from(index) / f64::from(d.petals);
    let layer = f64::from(index) + 2.0 + (0.06 + 0.3 * loose.powi(4)) * v(1);
    let age = bloom.age(layer);
    let opened = bloom.opened(age);
    let lerp = |a: f64, b: f64, t: f64| a + (b - a) * t.clamp(0.0, 1.0);
    let grown = (2.0 * age).min(1.0) * (2.0 - (2.0 * age).min(1.0));
    // What the petal has of its size in bloom.
    let size = bloom.length_mm(age) / lerp(p.inner_length_mm, p.length_mm, grown);
    let length_mm = bloom.length_mm(age) * (1.0 + 0.04 * v(2));
    let width_mm =
        size * lerp(0.8, 1.0, opened) * lerp(p.inner_width_mm, p.width_mm, grown) * (1.0 + 0.06 * v(3));
    let outline = Outline {
        length_mm,
        width_mm,
        claw_width_mm: size * p.claw_width_mm * lerp(0.5, 1.0, age),
        widest: p.widest,
        tip_mm: size * p.tip_mm * age * (1.0 + 0.5 * v(4)),
        nicks_mm: size * p.nicks_mm * age * d.irregularity,
        seed: d.seed ^ (u64::from(index) << 32),
    };
    let roll_deg = lerp(p.roll_inner_deg, p.roll_outer_deg, age.powf(1.2)) * lerp(0.25, 1.0, opened);
    let roll_width_mm = size * p.roll_width_mm * lerp(0.35, 1.0, 1.3 * age);
    PetalForm {
        layer,
        azimuth_deg: spiral.azimuth_deg(index),
        facets: facets(p.facets, age, roll_deg, roll_width_mm, &v),
        outline,
        sharpness_mm: p.cusp_mm,
        cup_mm: lerp(p.cup_inner_mm, p.cup_outer_mm, age * opened) * (1.0 + 0.5 * v(5)),
        fold_mm: p.fold_mm * age * (1.0 + 0.8 * v(6)),
        ruffle_mm: p.ruffle_mm * age * lerp(0.3, 1.0, opened),
        ruffle_waves: p.ruffle_waves * (1.0 + 0.3 * v(9)),
        crumple_mm: p.crumple_mm * lerp(0.3, 1.0, age),
        // Between the petals of a bud there is no space for relief.
        vein_relief_mm: p.vein_relief_mm * lerp(0.05, 1.0, 1.5 * age * opened),
        veins: Veins { seed: d.seed ^ (u64::from(index) << 32), ..Veins::default() },
        ease: 1.0,
        seed: d.seed ^ (u64::from(index) << 32),
    }
}

/// Longest chord of a mesh about the axis, radians: between the petals of a bud are tenths of a millimetre.
const LONGEST_CHORD: f64 = 0.09;
/// Widths of a petal beyond this angle about its axis, radians, do not make it finer: two turns.
const MOST_TURNS: f64 = 12.6;
/// A rim that turned further would come back to its own petal.
const MOST_ROLLED_DEG: f64 = 160.0;

/// The straight edges of a rim: `most` of them in front of the outermost petals, evenly over 150 degrees, one in the
/// youngest; and one on each flank.
fn facets(most: f64, age: f64, roll_deg: f64, width_mm: f64, v: &dyn Fn(u32) -> f64) -> Vec<Facet> {
    // The number differs from petal to petal, as with real ones.
    let count = (1.0 + (most - 1.0) * (1.6 * age).min(1.0) + 0.6 * v(11)).round().max(1.0) as u32;
    let span = 150.0;
    let front = (0..count).map(|k| {
        let at = (f64::from(k) + 0.5) / f64::from(count) - 0.5;
        Facet {
            direction_deg: span * at + (0.22 * span / f64::from(count)) * v(12 + k),
            width_mm: width_mm * (1.0 + 0.3 * v(20 + k)),
            turn_deg: (roll_deg * (1.0 + 0.35 * v(28 + k))).min(MOST_ROLLED_DEG),
        }
    });
    let flanks = [-1.0, 1.0].map(|side| {
        let k = 36 + (side > 0.0) as u32;
        Facet {
            direction_deg: side * (98.0 + 8.0 * v(k)),
            width_mm: 0.7 * width_mm * (1.0 + 0.4 * v(k + 2)),
            turn_deg: (0.5 * roll_deg * (1.0 + 0.4 * v(k + 4))).min(MOST_ROLLED_DEG),
        }
    });
    front.chain(flanks).collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// Points of all petals: four across, four along.
    fn points(d: &RoseDescription, openness: f64) -> Vec<DVec3> {
        let d = RoseDescription { openness, ..d.clone() };
        let Petals { bloom, forms, neighbours } = placed(&d);
        let at = [0.05, 0.35, 0.65, 0.95];
        forms
            .par_iter()
            .flat_map_iter(|form| {
                let petal = PetalSurface::new(form, &bloom, &neighbours);
                at.into_iter()
                    .flat_map(|u| at.map(|v| (u, v)))
                    .map(|(u, v)| petal.at(u, v))
                    .collect::<Vec<_>>()
            })
            .collect()
    }

    #[test]
    fn petals_do_not_pop_as_they_open() {
        let moved_mm =
            |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(p, q)| (*p - *q).length()).fold(0.0, f64::max);
        // Here petals make room for each other.
        let d = RoseDescription { detail: 0.6, ..RoseDescription::hybrid_tea() };
        let stages: Vec<(f64, Vec<DVec3>)> =
            (0..=8).map(|k| 0.85 + 0.0125 * f64::from(k)).map(|o| (o, points(&d, o))).collect();
        for pair in stages.windows(2) {
            // Into the half in which petals move more, again and again: a jump stays as large as it is.
            let (mut low, mut high) = (pair[0].clone(), pair[1].clone());
            for _ in 0..4 {
                let openness = 0.5 * (low.0 + high.0);
                let middle = (openness, points(&d, openness));
                if moved_mm(&low.1, &middle.1) > moved_mm(&middle.1, &high.1) {
                    high = middle;
                } else {
                    low = middle;
                }
            }
            let mm = moved_mm(&low.1, &high.1);
            assert!(mm < 0.3, "openness {}: a jump of {mm:.2} mm", low.0);
        }
    }
}

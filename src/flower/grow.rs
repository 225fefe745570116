//! Grows a rose: where each petal stands, what its age makes of it, and the meshes of all organs.
//!
//! Petals whose meshes still meet a neighbour or themselves lose a fifth of their roll and unevenness, again and again
//! until none meets, and some of their width if that does not help. Guarded by `petals_do_not_cross`.

use rayon::prelude::*;

use crate::Result;
use crate::flower::bloom::Bloom;
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
    let bloom = Bloom::new(
        &d.bloom,
        d.petals,
        d.petal.inner_length_mm,
        d.petal.length_mm,
        d.stem.receptacle_radius_mm,
        d.openness,
    )
    .sway(d.seed, d.irregularity);
    let mut forms: Vec<PetalForm> = (0..d.petals).map(|index| petal_form(d, &bloom, index)).collect();
    let neighbours = Neighbours { seats: forms.iter().map(PetalForm::seat).collect() };
    settle(&mut forms, &bloom, &neighbours, d.detail.min(SETTLED_DETAIL));
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

/// Petals that meet another or themselves, as meshes of this detail, get less roll and unevenness until none do.
fn settle(forms: &mut [PetalForm], bloom: &Bloom, neighbours: &Neighbours, detail: f64) {
    let grown =
        |form: &PetalForm| petal_mesh(&PetalSurface::new(form, bloom, neighbours), form, bloom, detail);
    let mut meshes: Vec<Mesh> = forms.par_iter().map(grown).collect();
    for step in 0..SETTLE_STEPS {
        let mut meets = vec![false; forms.len()];
        for c in crossings(&meshes.iter().collect::<Vec<_>>()) {
            c.meshes.iter().for_each(|&k| meets[k as usize] = true);
        }
        if !meets.contains(&true) {
            return;
        }
        forms.par_iter_mut().zip(&mut meshes).zip(&meets).filter(|(_, meets)| **meets).for_each(
            |((form, mesh), _)| {
                form.ease *= EASE;
                // What meets without roll does so at its flanks.
                if step >= SETTLE_STEPS / 3 {
                    form.outline.width_mm *= NARROWER;
                }
                *mesh = grown(form);
            },
        );
    }
}

/// Columns and rows of a petal of detail 1, and how they crowd towards the rim.
const ACROSS: f64 = 28.0;
const ALONG: f64 = 28.0;
const CROWDING: f64 = 1.6;
/// Beyond this detail the mid-surface is interpolated: its smallest waves are 5 mm long.
const MODELLED_DETAIL: f64 = 4.0;
/// Steps of settling, and what a petal keeps of its roll and unevenness in each.
const SETTLE_STEPS: u32 = 12;
const EASE: f64 = 0.8;
/// What a petal that still meets another keeps of its width in each of the later steps.
const NARROWER: f64 = 0.96;
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

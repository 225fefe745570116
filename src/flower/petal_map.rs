//! Places of a grown petal by its texture coordinates: where on the fan of its veins, how far from its margin, on a vein
//! or beside it. What varies over a petal (pigment, thickness) is a function of these, the same at any fineness of mesh.
//!
//! Model: texture coordinates are the flat petal, p = ((s - 1/2) width, t length) in mm, so
//!
//! ```text
//! (u, v) = outline^-1(p),   d = distance of p from the sides and the rim, negative outside,   n = vein(u, v)
//! ```
//!
//! u across / half width, v and d are kept at the nodes of a grid over the flat petal and linear between them; n in a
//! picture over (u, v), in which a vein narrower than a column is as wide as that and as much paler.
//!
//! | symbol | field | unit | range |
//! |---|---|---|---|
//! | u | [`Place::across`] | | 0 to 1 |
//! | v | [`Place::along`] | | 0 at the claw, 1 all along the rim |
//! | d | [`Place::margin_mm`] | mm | |
//! | n | [`Place::vein`] | | 0 to 1 |
//!
//! Limits: tears of the rim count as petal. Places come back as they went in within 0.3 mm, 0.6 mm at the sides
//! (`places_of_the_petal_are_found`); veins are those of the relief (`veins_are_those_of_the_relief`).
//! 50 kB a petal, 115 kB with veins. Source: our reading.

use glam::{DVec2, Vec2};

use crate::flower::outline::Outline;
use crate::flower::veins::Veins;

/// What a petal's colour may depend on beside its shape.
#[derive(Clone, Debug, PartialEq)]
pub struct PetalTraits {
    /// Its flat shape.
    pub outline: Outline,
    /// Its veins.
    pub veins: Veins,
    /// 0 the innermost, 1 the outermost petal of the flower.
    pub age: f64,
    /// Seed of its irregularities.
    pub seed: u64,
}

/// A place of a petal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Which line of the fan, 0 to 1.
    pub across: f32,
    /// Share of the way along it, 0 at the claw, 1 at the rim.
    pub along: f32,
    /// Distance from the sides and the rim in the flat petal, mm; 0 outside.
    pub margin_mm: f32,
    /// How much of it is vein, 0 to 1.
    pub vein: f32,
    /// Point of the flat petal, mm.
    pub flat_mm: Vec2,
}

/// The places of one petal.
#[derive(Clone, Debug)]
pub struct PetalMap {
    size_mm: Vec2,
    nodes: Vec<Node>,
    /// Share of vein in 1/255, row by row from the claw; empty without veins.
    veins: Vec<u8>,
    /// 0 the innermost, 1 the outermost petal.
    pub age: f32,
    /// Seed of its irregularities.
    pub seed: u32,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    /// Across from -1 to 1, in parts of the half width at its height: linear in x.
    part: f32,
    along: f32,
    margin_mm: f32,
}

/// Intervals of the grid over the flat petal.
const STEPS: usize = 64;
/// Size of the picture of the veins: veins run along, so columns are finer than rows.
const COLUMNS: usize = 512;
const ROWS: usize = 128;
/// Chords of each side and of the rim.
const CHORDS: u32 = 64;

impl PetalMap {
    /// The map of a petal; `veins` as they are to be seen, if they are.
    pub fn new(traits: &PetalTraits, veins: Option<&Veins>) -> Self {
        let outline = Outline { nicks_mm: 0.0, ..traits.outline.clone() };
        // As the texture coordinates of the petal's mesh.
        let size = DVec2::new(outline.width_mm, outline.length_mm + outline.tip_mm.max(0.0));
        let border = border(&outline);
        let node = |k: usize| {
            let t = DVec2::new((k % (STEPS + 1)) as f64, (k / (STEPS + 1)) as f64) / STEPS as f64;
            let p = DVec2::new((t.x - 0.5) * size.x, t.y * size.y);
            let along = outline.inverse(p).y;
            Node {
                part: (p.x / outline.half_width_mm(along)) as f32,
                along: along as f32,
                margin_mm: distance_mm(&border, p) as f32,
            }
        };
        Self {
            size_mm: size.as_vec2(),
            nodes: (0..(STEPS + 1) * (STEPS + 1)).map(node).collect(),
            veins: veins.map_or_else(Vec::new, |veins| picture(veins, &outline)),
            age: traits.age as f32,
            seed: (traits.seed ^ (traits.seed >> 32).wrapping_mul(0x9e37_79b9)) as u32,
        }
    }

    /// The place at texture coordinates.
    pub fn at(&self, uv: Vec2) -> Place {
        let uv = uv.clamp(Vec2::ZERO, Vec2::ONE);
        let ((i, x), (j, y)) = (interval(uv.x, STEPS), interval(uv.y, STEPS));
        let first = j * (STEPS + 1) + i;
        let [a, b] = [self.nodes[first], self.nodes[first + 1]];
        let [c, d] = [self.nodes[first + STEPS + 1], self.nodes[first + STEPS + 2]];
        let mix = |f: fn(&Node) -> f32| {
            let (low, high) = (f(&a) + (f(&b) - f(&a)) * x, f(&c) + (f(&d) - f(&c)) * x);
            low + (high - low) * y
        };
        let (across, along) = (Outline::across(mix(|n| n.part)), mix(|n| n.along));
        Place {
            across,
            along,
            margin_mm: mix(|n| n.margin_mm).max(0.0),
            vein: self.vein(across, along),
            flat_mm: Vec2::new((uv.x - 0.5) * self.size_mm.x, uv.y * self.size_mm.y),
        }
    }

    fn vein(&self, across: f32, along: f32) -> f32 {
        if self.veins.is_empty() {
            return 0.0;
        }
        let x = (across * COLUMNS as f32 - 0.5).clamp(0.0, (COLUMNS - 1) as f32);
        let (i, x) = ((x as usize).min(COLUMNS - 2), x);
        let x = x - i as f32;
        let (j, y) = interval(along, ROWS);
        let row = |j: usize| {
            let at = |i: usize| f32::from(self.veins[j * COLUMNS + i]);
            at(i) + (at(i + 1) - at(i)) * x
        };
        (row(j) + (row(j + 1) - row(j)) * y) * (1.0 / 255.0)
    }
}

/// Interval of `n` in which `t` in [0, 1] lies, and where in it.
fn interval(t: f32, n: usize) -> (usize, f32) {
    let x = t * n as f32;
    let i = (x as usize).min(n - 1);
    (i, x - i as f32)
}

/// Corners of the border from the right of the claw over the rim to its left.
fn border(outline: &Outline) -> Vec<DVec2> {
    let t = |k: u32| f64::from(k) / f64::from(CHORDS);
    let right = (0..CHORDS).map(|k| outline.at(1.0, t(k)));
    // The rim has a point or a notch.
    let rim = (0..3 * CHORDS).map(|k| outline.at(1.0 - t(k) / 3.0, 1.0));
    let left = (0..=CHORDS).map(|k| outline.at(0.0, 1.0 - t(k)));
    right.chain(rim).chain(left).collect()
}

/// Distance of `p` from the border, negative outside.
fn distance_mm(border: &[DVec2], p: DVec2) -> f64 {
    let (mut nearest, mut inside) = (f64::INFINITY, false);
    for pair in border.windows(2) {
        let (a, e) = (pair[0], pair[1] - pair[0]);
        let t = ((p - a).dot(e) / e.length_squared().max(1e-30)).clamp(0.0, 1.0);
        nearest = nearest.min((a + t * e).distance_squared(p));
        inside ^= crosses(a, pair[1], p);
    }
    if let [first, .., last] = border {
        // The claw closes the border, and is none itself.
        inside ^= crosses(*last, *first, p);
    }
    if inside { nearest.sqrt() } else { -nearest.sqrt() }
}

/// Does a ray from `p` to +x meet the chord?
fn crosses(a: DVec2, b: DVec2, p: DVec2) -> bool {
    (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x)
}

fn picture(veins: &Veins, outline: &Outline) -> Vec<u8> {
    let mut picture = vec![0u8; COLUMNS * (ROWS + 1)];
    for (j, row) in picture.chunks_exact_mut(COLUMNS).enumerate() {
        for (at, half) in veins.across(outline, j as f64 / ROWS as f64) {
            let (centre, half) = (at * COLUMNS as f64 - 0.5, half * COLUMNS as f64);
            let wide = half.max(0.6);
            let reach = 2.5 * wide;
            let columns = (centre - reach).ceil().max(0.0) as usize
                ..((centre + reach).floor().max(-1.0) + 1.0).min(COLUMNS as f64) as usize;
            for i in columns {
                let d = (i as f64 - centre) / wide;
                let share = (-d * d).exp() * half / wide;
                row[i] = row[i].max((255.0 * share).round() as u8);
            }
        }
    }
    picture
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flower::{OrganKind, RoseDescription, grow};

    fn traits() -> PetalTraits {
        let outline = Outline {
            length_mm: 50.0,
            width_mm: 54.0,
            claw_width_mm: 9.0,
            widest: 0.6,
            tip_mm: 2.0,
            nicks_mm: 0.0,
            seed: 3,
        };
        PetalTraits { outline, veins: Veins { seed: 5, ..Veins::default() }, age: 0.5, seed: 5 }
    }

    fn uv(o: &Outline, u: f64, v: f64) -> Vec2 {
        let p = o.at(u, v);
        DVec2::new(p.x / o.width_mm + 0.5, p.y / (o.length_mm + o.tip_mm.max(0.0))).as_vec2()
    }

    #[test]
    fn places_of_the_petal_are_found() {
        let t = traits();
        let map = PetalMap::new(&t, None);
        // Where the sides end in the rim the fan is steep.
        let (mut off_mm, mut off_at_sides_mm, mut off_margin_mm) = (0.0f64, 0.0f64, 0.0f64);
        for k in 0..900 {
            let (u, v) = (0.02 + 0.96 * f64::from(k % 30) / 29.0, 0.04 + 0.96 * f64::from(k / 30) / 29.0);
            let p = t.outline.at(u, v);
            let place = map.at(uv(&t.outline, u, v));
            let off = p.distance(t.outline.at(f64::from(place.across), f64::from(place.along)));
            let most = if (u - 0.5).abs() < 0.4 { &mut off_mm } else { &mut off_at_sides_mm };
            *most = most.max(off);
            let real = distance_mm(&border(&t.outline), p);
            off_margin_mm = off_margin_mm.max((f64::from(place.margin_mm) - real).abs());
        }
        assert!(off_mm < 0.3 && off_at_sides_mm < 0.6, "{off_mm} {off_at_sides_mm} mm");
        assert!(off_margin_mm < 0.25, "{off_margin_mm} mm");
        assert!(map.at(uv(&t.outline, 0.5, 0.0)).margin_mm > 4.0, "the claw is no margin");
        assert_eq!(map.at(Vec2::new(0.0, 0.0)).margin_mm, 0.0);
    }

    #[test]
    fn veins_are_those_of_the_relief() {
        let t = traits();
        // Wide enough to be resolved.
        let veins = Veins { width_mm: 1.6, generations: 2, ..t.veins };
        let map = PetalMap::new(&t, Some(&veins));
        let mut most = 0.0f64;
        for k in 0..3000 {
            let (u, v) = (0.1 + 0.8 * f64::from(k % 75) / 74.0, 0.1 + 0.85 * f64::from(k / 75) / 39.0);
            let wanted = veins.at(&t.outline, u, v);
            let found = f64::from(map.at(uv(&t.outline, u, v)).vein);
            assert!((found - wanted).abs() < 0.25, "{u} {v}: {found} {wanted}");
            most = most.max(wanted);
        }
        assert!(most > 0.95);
    }

    #[test]
    fn petals_have_the_same_traits_at_any_detail() {
        let of = |detail: f64| {
            let d = RoseDescription { detail, ..RoseDescription::wild() };
            let flower = grow(&d).expect("grows");
            let of_petals: Vec<_> = flower.of_kind(OrganKind::Petal).map(|o| o.traits.clone()).collect();
            assert!(flower.organs.iter().all(|o| o.traits.is_some() == (o.kind == OrganKind::Petal)));
            of_petals
        };
        let coarse = of(0.5);
        assert_eq!(coarse, of(2.0));
        let ages: Vec<f64> = coarse.iter().flatten().map(|t| t.age).collect();
        assert!(ages.is_sorted() && ages[0] > 0.0 && ages[4] > 0.9, "{ages:?}");
    }
}

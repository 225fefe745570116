//! One petal: a sheet without thickness, two-sided, given by one mid-surface function of the flat petal.
//!
//! Model, in four maps:
//! 1. [`Outline`]: (u, v) -> the flat petal, x across and y along in mm;
//! 2. [`Margin`]: the rim rolls back about straight facets;
//! 3. [`PetalSurface::at_flat`]: the flat petal -> its cup of the [`Bloom`]. The cup is treated as the cone that
//!    touches it in the middle of the blade, on which the flat petal is rolled without stretching:
//!    s' = |(x, y + s0)| - s0, arc = (s' + s0) atan(x / (y + s0)), azimuth = arc / r(s');
//! 4. cup, fold, ruffle and crumple displace it along its normal, with the rolled margin, within the petal's share of
//!    the space to its [`Neighbours`]; the relief of the veins is added by the mesh.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | cup, fold | `cup_mm`, `fold_mm` | mm | by age, see [`crate::flower::rose`] |
//! | ruffle | `ruffle_mm`, `ruffle_waves` | mm, - | |
//! | crumple | `crumple_mm` | mm | |
//! | relief of the veins | `vein_relief_mm` | mm | |
//!
//! Limits: without what displaces it the middle of the petal lies on its cup (`a_plain_petal_lies_on_its_cup`);
//! bending keeps its area within 15 % (`bending_nearly_keeps_area`). [`PetalSurface::at_flat`] is the one function that
//! a solved shape would replace. Our reading: no measured shape of a hybrid tea's petal is used.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec2, DVec3};

use crate::flower::bloom::Bloom;
use crate::flower::margin::{Facet, Margin};
use crate::flower::neighbours::{Gaps, Neighbours, Seat};
use crate::flower::outline::Outline;
use crate::flower::phyllotaxis::vary;
use crate::flower::sheet::Sheet;
use crate::flower::smooth_step;
use crate::flower::veins::Veins;

/// The traits of one petal.
#[derive(Clone, Debug, PartialEq)]
pub struct PetalForm {
    /// Layer of the bloom on which its middle lies.
    pub layer: f64,
    /// Azimuth of its middle, deg.
    pub azimuth_deg: f64,
    /// Its flat shape.
    pub outline: Outline,
    /// Edges of its rolled margin.
    pub facets: Vec<Facet>,
    /// Sharpness of the cusps between them, mm.
    pub sharpness_mm: f64,
    /// How far the margins stand towards the adaxial side of the middle, mm; negative: to the abaxial side.
    pub cup_mm: f64,
    /// Depth of the fold along the midrib, mm.
    pub fold_mm: f64,
    /// Amplitude of the waves of the rim, mm.
    pub ruffle_mm: f64,
    /// Number of waves along the rim.
    pub ruffle_waves: f64,
    /// Amplitude of the unevenness of the blade, mm.
    pub crumple_mm: f64,
    /// Height of the veins' relief, mm.
    pub vein_relief_mm: f64,
    /// Its veins.
    pub veins: Veins,
    /// What it has of its roll and unevenness: less than 1 where it would meet a neighbour.
    pub ease: f64,
    /// Seed of its irregularities.
    pub seed: u64,
}

impl PetalForm {
    /// Where it lies among the others.
    pub fn seat(&self) -> Seat {
        Seat { layer: self.layer, azimuth: self.azimuth_deg.to_radians(), outline: self.outline.clone() }
    }
}

/// The mid-surface of a petal.
#[derive(Clone, Debug)]
pub struct PetalSurface<'a> {
    form: &'a PetalForm,
    bloom: &'a Bloom,
    neighbours: &'a Neighbours,
    margin: Margin,
    apex_mm: f64,
    waves: Vec<FlatWave>,
}

/// A place on the cups.
struct OnCups {
    layer: f64,
    azimuth: f64,
    s_mm: f64,
    gaps: Gaps,
}

/// A wave over the flat petal.
#[derive(Clone, Copy, Debug)]
struct FlatWave {
    k_per_mm: DVec2,
    phase: f64,
}

/// Parts of the space between two petals that the inner one may use outwards and the outer one inwards.
const SPACE_OUTSIDE: f64 = 0.62;
const SPACE_INSIDE: f64 = 0.2;
/// Waves of the crumple.
const CRUMPLE_WAVES: u32 = 7;

impl<'a> PetalSurface<'a> {
    /// A petal with these traits in this flower.
    pub fn new(form: &'a PetalForm, bloom: &'a Bloom, neighbours: &'a Neighbours) -> Self {
        // The touching cone: at the middle of the blade the apex is r / sin(heading) away.
        let middle_mm = 0.6 * form.outline.length_mm;
        let m = bloom.meridian(form.layer, middle_mm);
        let apex_mm = (m.r_mm / m.heading.sin().max(1e-3) - middle_mm).max(1.0);
        let waves = (0..CRUMPLE_WAVES)
            .map(|k| {
                let v = |trait_id: u32| vary(form.seed, k, 60 + trait_id);
                // Crests run along the petal more than across it, as folds left from the bud do.
                let (sin, cos) = (0.9 * v(0)).sin_cos();
                let wavelength_mm = 0.1 * form.outline.width_mm * (2.4 + 1.4 * v(1));
                FlatWave { k_per_mm: DVec2::new(cos, sin) * (TAU / wavelength_mm), phase: PI * v(2) }
            })
            .collect();
        let margin = Margin::new(&form.outline, &[], form.sharpness_mm);
        let mut petal = Self { form, bloom, neighbours, margin, apex_mm, waves };
        let facets: Vec<Facet> = form
            .facets
            .iter()
            .map(|f| Facet { turn_deg: form.ease * f.turn_deg, ..*f })
            .map(|f| f.within(petal.space_mm(&f)))
            .collect();
        petal.margin = Margin::new(&form.outline, &facets, form.sharpness_mm);
        petal
    }

    /// Where a point of the flat petal comes to lie on the cups.
    fn on_cups(&self, p: DVec2) -> OnCups {
        let from_apex = DVec2::new(p.x, p.y + self.apex_mm);
        let s_mm = from_apex.length() - self.apex_mm;
        let arc = from_apex.length() * from_apex.x.atan2(from_apex.y);
        // The width of the petal is wound on its own spiral: first the radius at its middle, then the
        // layer that the resulting angle climbs to.
        let radius_mm = self.bloom.meridian(self.form.layer, s_mm).r_mm;
        let turn = arc / radius_mm;
        let layer = self.form.layer + self.bloom.overlap() * turn;
        let azimuth = self.form.azimuth_deg.to_radians() + turn;
        let gaps = self.neighbours.gaps(self.bloom, layer, azimuth, s_mm, radius_mm);
        OnCups { layer, azimuth, s_mm, gaps }
    }

    /// The space outside a facet, mm: the least at three places of it.
    fn space_mm(&self, facet: &Facet) -> f64 {
        let (sin, cos) = facet.direction_deg.to_radians().sin_cos();
        let normal = DVec2::new(-sin, cos);
        let outline = &self.form.outline;
        let out_mm = outline.support_mm(normal) - 0.5 * facet.width_mm;
        let centre = DVec2::new(0.0, outline.widest * outline.length_mm);
        let middle = centre + (out_mm - centre.dot(normal)) * normal;
        [-0.15, 0.0, 0.15]
            .map(|k| self.space_outside_mm(&self.on_cups(middle + k * outline.width_mm * normal.perp())))
            .into_iter()
            .fold(f64::INFINITY, f64::min)
    }

    /// How far the petal may stand off to its abaxial side, mm.
    fn space_outside_mm(&self, at: &OnCups) -> f64 {
        SPACE_OUTSIDE * self.bloom.apart_mm(at.layer, at.layer + at.gaps.outside, at.s_mm)
    }

    /// The mid-surface: a point of the flat petal in space.
    pub fn at_flat(&self, flat: DVec2) -> DVec3 {
        let (p, rolled_mm) = self.margin.roll(flat, |p| self.space_outside_mm(&self.on_cups(p)));
        let at = self.on_cups(p);
        let lift = self.uneven(flat) - rolled_mm;
        let lift = if lift < 0.0 {
            -soft_limit(-lift, self.space_outside_mm(&at) + 1e-6)
        } else {
            let space = self.bloom.apart_mm(at.layer, at.layer - at.gaps.inside, at.s_mm);
            soft_limit(lift, SPACE_INSIDE * space + 1e-6)
        };
        let m = self.bloom.meridian(at.layer, at.s_mm);
        let (sin, cos) = m.heading.sin_cos();
        self.bloom.place(m.r_mm - lift * cos, at.azimuth, m.z_mm + lift * sin)
    }

    /// Cup, fold, ruffle and crumple of the blade: distance to the adaxial side, mm.
    fn uneven(&self, p: DVec2) -> f64 {
        let f = self.form;
        let out = 2.0 * p.x / f.outline.width_mm;
        let along = (p.y / f.outline.length_mm).clamp(0.0, 1.2);
        let belly = (FRAC_PI_2 * along).sin();
        let cup = f.cup_mm * out * out * belly;
        let fold = -f.fold_mm * (-(out / 0.16).powi(2)).exp() * belly;
        let near_rim = smooth_step(0.35, 1.0, along.max(0.85 * out.abs()));
        let phase = |trait_id: u32| PI * vary(f.seed, 0, 50 + trait_id);
        let ruffle = f.ruffle_mm
            * near_rim
            * ((f.ruffle_waves * PI * out + phase(0)).sin()
                + 0.5 * (2.3 * f.ruffle_waves * PI * out + phase(1)).sin());
        let crumple = f.crumple_mm
            * (0.25 + 0.75 * near_rim)
            * smooth_step(0.0, 0.3, along)
            * self.waves.iter().map(|w| (w.k_per_mm.dot(p) + w.phase).sin()).sum::<f64>()
            / f64::from(CRUMPLE_WAVES).sqrt();
        f.ease * (cup + fold + ruffle + crumple)
    }
}

impl Sheet for PetalSurface<'_> {
    fn at(&self, u: f64, v: f64) -> DVec3 {
        self.at_flat(self.form.outline.at(u, v))
    }

    fn relief_mm(&self, u: f64, v: f64) -> f64 {
        // The veins stand out on the abaxial side and are grooves on the adaxial one; they end before the flanks.
        let inside = smooth_step(0.0, 0.06, u.min(1.0 - u));
        -self.form.vein_relief_mm * inside * self.form.veins.at(&self.form.outline, u, v)
    }

    fn uv(&self, u: f64, v: f64) -> DVec2 {
        let p = self.form.outline.at(u, v);
        let [w, l] = self.uv_scale_mm().map(f64::from);
        DVec2::new(p.x / w + 0.5, p.y.max(0.0) / l)
    }

    fn uv_scale_mm(&self) -> [f32; 2] {
        let o = &self.form.outline;
        [o.width_mm as f32, (o.length_mm + o.tip_mm.max(0.0)) as f32]
    }
}

/// `x` >= 0 for small values, at most `limit`.
fn soft_limit(x: f64, limit: f64) -> f64 {
    x / (1.0 + (x / limit).powi(3)).cbrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flower::RoseDescription;
    use crate::flower::sheet::mesh;

    fn bloom() -> Bloom {
        let d = RoseDescription::hybrid_tea();
        Bloom::new(&d.bloom, 36, 40.0, 46.0, 6.0, 1.0)
    }

    fn plain() -> PetalForm {
        let outline = Outline {
            length_mm: 46.0,
            width_mm: 48.0,
            claw_width_mm: 9.0,
            widest: 0.6,
            tip_mm: 0.0,
            nicks_mm: 0.0,
            seed: 0,
        };
        PetalForm {
            layer: 26.0,
            azimuth_deg: 0.0,
            outline,
            facets: Vec::new(),
            sharpness_mm: 1.0,
            cup_mm: 0.0,
            fold_mm: 0.0,
            ruffle_mm: 0.0,
            ruffle_waves: 2.0,
            crumple_mm: 0.0,
            vein_relief_mm: 0.0,
            veins: Veins::default(),
            ease: 1.0,
            seed: 0,
        }
    }

    /// Two edges that roll right up, a cusp between them.
    fn rolled() -> PetalForm {
        let facet = |direction_deg| Facet { direction_deg, width_mm: 10.0, turn_deg: 100.0 };
        PetalForm { facets: vec![facet(-40.0), facet(40.0)], ..plain() }
    }

    fn area(form: PetalForm, bloom: &Bloom) -> f32 {
        let m = mesh(&PetalSurface::new(&form, bloom, &Neighbours::default()), 60, 80, 1.5);
        (0..m.triangles.len()).map(|f| m.face_area(f)).sum()
    }

    #[test]
    fn a_plain_petal_lies_on_its_cup() {
        let (bloom, alone, form) = (bloom(), Neighbours::default(), plain());
        let petal = PetalSurface::new(&form, &bloom, &alone);
        for v in [0.0, 0.2, 0.5, 0.8, 1.0] {
            let p = petal.at(0.5, v);
            let m = bloom.meridian(26.0, 46.0 * v);
            assert!((p.truncate().length() - m.r_mm).abs() < 1e-6 && (p.z - m.z_mm).abs() < 1e-6);
        }
    }

    #[test]
    fn bending_nearly_keeps_area() {
        let bloom = bloom();
        let outline = plain().outline;
        let n = 400;
        let flat: f64 = (0..n)
            .flat_map(|i| (0..n).map(move |j| (i, j)))
            .map(|(i, j)| {
                let p = |a: usize, b: usize| outline.at(a as f64 / n as f64, b as f64 / n as f64);
                (p(i + 1, j) - p(i, j)).perp_dot(p(i, j + 1) - p(i, j))
            })
            .sum();
        let wrapped = f64::from(area(plain(), &bloom));
        let rolled = f64::from(area(rolled(), &bloom));
        // A doubly curved cup must stretch a flat petal; living petals grow to it.
        assert!((wrapped / flat - 1.0).abs() < 0.15, "{wrapped} {flat}");
        assert!((rolled / wrapped - 1.0).abs() < 0.12, "{rolled} {wrapped}");
    }

    #[test]
    fn the_rim_rolls_to_the_abaxial_side() {
        let (bloom, alone, still, rolled) = (bloom(), Neighbours::default(), plain(), rolled());
        let still = PetalSurface::new(&still, &bloom, &alone);
        let rolled = PetalSurface::new(&rolled, &bloom, &alone);
        let heading = bloom.meridian(26.0, 46.0).heading;
        let adaxial = DVec3::new(-heading.cos(), 0.0, heading.sin());
        let off = |u: f64| (rolled.at(u, 1.0) - still.at(u, 1.0)).dot(adaxial);
        // The edges roll back, the cusp between them hardly.
        assert!(off(0.25) < -2.5 && off(0.75) < -2.5, "{} {}", off(0.25), off(0.75));
        assert!(off(0.5) < -0.1 && off(0.5) > 0.3 * off(0.25), "{}", off(0.5));
        assert!((rolled.at(0.5, 0.5) - still.at(0.5, 0.5)).length() < 1e-9);
    }

    #[test]
    fn texture_coordinates_are_the_flat_petal() {
        let (bloom, alone, mut form) = (bloom(), Neighbours::default(), plain());
        form.outline.tip_mm = 2.0;
        let petal = PetalSurface::new(&form, &bloom, &alone);
        let [w, l] = petal.uv_scale_mm().map(f64::from);
        for (u, v) in [(0.0, 0.0), (0.3, 0.7), (0.5, 1.0), (1.0, 1.0)] {
            let t = petal.uv(u, v);
            assert!(t.min_element() >= -1e-9 && t.max_element() <= 1.0 + 1e-9, "{t}");
            assert!((DVec2::new((t.x - 0.5) * w, t.y * l) - form.outline.at(u, v)).length() < 1e-6);
        }
    }
}

use glam::Vec3;

use super::*;
use crate::bsdf::Bsdf;
use crate::flower::{OrganKind, RoseDescription, grow};
use crate::scene::description::PetalDescription;
use crate::scene::{MemoryAssets, Petal, Scene, TabulatedPetal, compile, load};
use crate::spectrum::{SampledSpectrum, SampledWavelengths};
use crate::validate::sheet;

const ALL: &str = "
    adaxial = { claw = 0.3, middle = 1.0, rim = 1.6 }
    abaxial = { claw = 0.1, middle = 0.2, rim = 0.5 }
    claw_spot = { factor = 0.05, extent = 0.3 }
    veins = { adaxial = 1.5, abaxial = -0.6 }
    margin = { factor = 3.0, width_mm = 3.0 }
    age = { inner = 0.5, outer = 1.4 }
    blotches = { amplitude = 0.4, scale_mm = 4.0 }
    withered = { extent = 0.5 }
";

fn pattern(text: &str) -> Pattern {
    Pattern::new(&toml::from_str(text).unwrap(), &Key::new("pattern")).unwrap()
}

fn files() -> MemoryAssets {
    let mut assets = MemoryAssets::default();
    assets.files.insert("sheet.optics".into(), crate::io::petal_optics::write(&sheet(12, 6)).unwrap());
    assets
}

/// A thin tissue with the same pigment in both epidermes, measured by few walks.
fn petal(pattern: &str) -> TabulatedPetal {
    let side = "\npigments = { anthocyanin_ug_per_cm2 = 10.0 }\n";
    let text = format!(
        "walks = 10000\n[pattern]\n{pattern}\n[tissue.adaxial]{side}[tissue.abaxial]{side}[tissue.spongy]\nthickness_um = 100.0\nscattering_per_mm = 100.0\nanisotropy = 0.5"
    );
    let d: PetalDescription = load(&text, "petal.toml", &[]).unwrap().description;
    match d.build("petal", &MemoryAssets::default()).unwrap() {
        Petal::Tabulated(petal) => petal,
        Petal::Cells(_) => panic!("a tissue was given"),
    }
}

fn maps(pattern: &Pattern) -> Vec<PetalMap> {
    let flower = grow(&RoseDescription { detail: 0.4, ..RoseDescription::wild() }).unwrap();
    flower.of_kind(OrganKind::Petal).filter_map(|o| o.traits.as_ref()).map(|t| pattern.map(t)).collect()
}

fn grid(n: u32) -> impl Iterator<Item = Vec2> {
    (0..n * n).map(move |k| Vec2::new((k % n) as f32, (k / n) as f32) / (n - 1) as f32)
}

#[test]
fn factors_keep_their_range() {
    let all = pattern(ALL);
    let ranges = all.ranges();
    let mut seen = [(f32::INFINITY, 0.0f32); 2];
    for map in maps(&all).iter().map(Some).chain([None]) {
        for uv in grid(60).chain([Vec2::splat(-3.0), Vec2::splat(7.0)]) {
            let f = all.state(uv, map).pigment;
            for (value, (range, seen)) in
                [f.adaxial, f.abaxial].into_iter().zip(ranges.into_iter().zip(&mut seen))
            {
                assert!(value >= range.0 && value <= range.1, "{uv}: {value} {range:?}");
                *seen = (seen.0.min(value), seen.1.max(value));
            }
        }
    }
    // They are used, too.
    assert!(seen[0].0 < 0.02 && seen[0].1 > 0.5 * ranges[0].1, "{seen:?} {ranges:?}");
    assert_eq!(pattern("").state(Vec2::splat(0.3), None), TissueState::SOUND);
    assert_eq!(pattern("").ranges(), [(1.0, 1.0); 2]);
}

#[test]
fn patterns_lie_where_they_should() {
    let spot = pattern("claw_spot = { factor = 0.1, extent = 0.3, irregularity = 0 }");
    let band = pattern("margin = { factor = 4, width_mm = 2, irregularity = 0 }");
    let veins = pattern("veins = { adaxial = 2, abaxial = 0, width_mm = 0.6 }");
    let age = pattern("age = { inner = 0, outer = 2 }");
    let map = &maps(&veins)[2];
    for uv in grid(50) {
        let at = map.at(uv);
        let of = |p: &Pattern| p.state(uv, Some(map)).pigment.adaxial;
        if at.along < 0.16 || at.along > 0.3 {
            assert_eq!(of(&spot) < 0.2, at.along < 0.3, "{uv}");
        }
        if at.margin_mm < 1.0 || at.margin_mm > 2.0 {
            assert_eq!(of(&band) > 2.0, at.margin_mm < 2.0, "{uv}");
        }
        assert!((of(&veins) - 1.0 - 2.0 * at.vein).abs() < 1e-6);
        assert_eq!(veins.state(uv, Some(map)).pigment.abaxial, 1.0);
        assert!((of(&age) - 2.0 * map.age).abs() < 1e-6);
    }
    let ages: Vec<f32> =
        maps(&age).iter().map(|m| age.state(Vec2::splat(0.5), Some(m)).pigment.adaxial).collect();
    assert!(ages.is_sorted() && ages[4] > 1.2 + ages[0], "{ages:?}");
    // Patches have no mean of their own and differ from petal to petal.
    let blotches = pattern("blotches = { amplitude = 0.5, scale_mm = 2 }");
    let of: Vec<Vec<f32>> = maps(&blotches)
        .iter()
        .map(|m| grid(80).map(|uv| blotches.state(uv, Some(m)).pigment.adaxial).collect())
        .collect();
    let mean = |v: &[f32]| v.iter().sum::<f32>() / v.len() as f32;
    let all: Vec<f32> = of.iter().flatten().copied().collect();
    let spread = (all.iter().map(|x| (x - 1.0).powi(2)).sum::<f32>() / all.len() as f32).sqrt();
    assert!((mean(&all) - 1.0).abs() < 0.03 && (0.08..0.3).contains(&spread), "{} {spread}", mean(&all));
    let product: Vec<f32> = of[0].iter().zip(&of[1]).map(|(a, b)| (a - 1.0) * (b - 1.0)).collect();
    assert!(mean(&product).abs() < 0.3 * spread * spread, "{}", mean(&product));
}

#[test]
fn sides_differ_as_asked() {
    let lambda = SampledWavelengths::given([500.0, 520.0, 530.0, 540.0, 550.0, 560.0, 580.0, 700.0]);
    let petal =
        petal("abaxial = { claw = 0, middle = 0, rim = 0 }\nadaxial = { claw = 3, middle = 3, rim = 3 }");
    let at = petal.at(petal.state(Vec2::splat(0.5), None).pigment, &lambda);
    let (w, down) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.6, 0.0, -0.8));
    let wanted = petal.bsdf().at([3.0, 1.0, 1.0, 0.0], &lambda);
    assert_eq!(at.eval(w, Vec3::Z, &lambda), wanted.eval(w, Vec3::Z, &lambda));
    // Green light that comes back from the coloured and from the pale side, and red light.
    let [green, red] = [3, 7].map(|lane| at.albedo(down)[0][lane] / at.albedo(w)[0][lane]);
    assert!(green > 1.5 * red, "{green} {red}");
    // What passes meets both, so that it is the same either way.
    let through = |from: Vec3, to: Vec3| at.eval(from, to, &lambda);
    assert_eq!(through(w, down), through(down, w));
}

#[test]
fn extreme_pigment_keeps_the_laws() {
    let lambda = SampledWavelengths::given([400.0, 450.0, 500.0, 540.0, 580.0, 620.0, 680.0, 740.0]);
    let petal = petal(ALL);
    for (adaxial, abaxial) in [(0.0, 0.0), (0.0, 100.0), (100.0, 0.0), (2100.0, 2100.0), (0.03, 7.0)] {
        let at = petal.at(PigmentFactors { adaxial, abaxial }, &lambda);
        for k in 0..40 {
            let t = k as f32 * 0.39;
            let wo = Vec3::new(t.cos(), 0.0, t.sin());
            let wi = Vec3::new(0.3 * (2.0 * t).sin(), 0.5, (1.7 * t).cos()).normalize();
            assert_eq!(at.eval(wo, wi, &lambda), at.eval(wi, wo, &lambda));
            let [r, t] = at.albedo(wo);
            for lane in 0..8 {
                assert!(r[lane] >= 0.0 && t[lane] >= 0.0 && r[lane] + t[lane] <= 1.0 + 1e-5);
            }
        }
    }
}

#[test]
fn margins_are_thin_and_old_ones_wither() {
    let thin = pattern("thickness = { margin = 0.4, width_mm = 5, veins = 0 }");
    let veined = pattern("thickness = { margin = 0.4, width_mm = 5, veins = 0.5 }");
    let dead = pattern("withered = { extent = 0.4, width_mm = 2 }");
    assert_eq!(thin.thicknesses(), Some((0.4, 1.0)));
    assert_eq!(pattern("thickness = { margin = 1, veins = 0 }").thicknesses(), None);
    let mut brown = Vec::new();
    for map in &maps(&veined) {
        let mut sum = 0.0;
        for uv in grid(60) {
            let (at, of) = (map.at(uv), |p: &Pattern| p.state(uv, Some(map)));
            let thickness = 1.0 - 0.6 * of(&thin).thin;
            assert!(at.margin_mm < 5.0 || thickness == 1.0, "{uv}");
            assert!(at.margin_mm > 0.0 || (thickness - 0.4).abs() < 1e-6, "{uv}");
            assert!((1.5 - 1.1 * of(&veined).thin - thickness - 0.5 * at.vein).abs() < 1e-5, "{uv}");
            let state = of(&dead);
            assert!((0.0..=1.0).contains(&state.withered));
            assert!(at.margin_mm < 2.0 || state.withered == 0.0, "{uv}");
            assert!((state.shares().iter().sum::<f32>() - 1.0).abs() < 1e-6);
            sum += state.withered;
        }
        brown.push(sum);
    }
    assert!(brown[4] > 20.0 && brown[0] < 0.2 * brown[4], "{brown:?}");
}

#[test]
fn places_mix_what_they_are_made_of() {
    let lambda = SampledWavelengths::given([450.0, 500.0, 540.0, 580.0, 620.0, 660.0, 700.0, 740.0]);
    let petal = petal("thickness = { margin = 0.5, veins = 0.5 }\nwithered = { brown = 8 }");
    let wo = Vec3::new(0.6, 0.0, 0.8);
    let of = |thin: f32, withered: f32| TissueState { thin, withered, ..TissueState::SOUND };
    let f = |state: TissueState, u: f32| petal.pick(state, &lambda, u).albedo(wo)[1];
    let [thick, thin, dead] = [f(of(0.0, 0.0), 0.3), f(of(1.0, 0.0), 0.3), f(of(0.3, 1.0), 0.3)];
    // A thin petal lets more through, a dead one is brown: less of blue than of red.
    for lane in 0..8 {
        assert!(thin[lane] > 1.1 * thick[lane], "{thin:?} {thick:?}");
    }
    assert!(dead[0] / thick[0] < 0.6 * dead[6] / thick[6], "{dead:?} {thick:?}");
    // Each is picked as often as there is of it, and totals know the mean.
    let state = of(0.25, 0.2);
    let n = 400;
    let (mut sum, mut brown) = (SampledSpectrum::ZERO, 0);
    for k in 0..n {
        let picked = f(state, (k as f32 + 0.5) / n as f32);
        sum += picked * (1.0 / n as f32);
        brown += usize::from(picked == dead);
    }
    assert_eq!(brown, n / 5);
    for lane in 0..8 {
        let wanted = 0.6 * thick[lane] + 0.2 * thin[lane] + 0.2 * dead[lane];
        assert!((sum[lane] / wanted - 1.0).abs() < 1e-4, "{} {wanted}", sum[lane]);
        assert!((petal.albedo(wo, state, &lambda)[1][lane] / wanted - 1.0).abs() < 1e-4);
    }
}

/// Between the two measured thicknesses the BSDF is linear; the real petal is not quite.
#[test]
fn thickness_is_nearly_linear() {
    let lambda = SampledWavelengths::given([450.0, 500.0, 540.0, 580.0, 620.0, 660.0, 700.0, 740.0]);
    let of = |factor: f64| {
        let text = format!(
            "walks = 100000\n[tissue.adaxial]\n[tissue.abaxial]\n[tissue.spongy]\nthickness_um = {}\nscattering_per_mm = 100.0\nanisotropy = 0.5",
            100.0 * factor
        );
        let d: PetalDescription = load(&text, "petal.toml", &[]).unwrap().description;
        match d.build("petal", &MemoryAssets::default()).unwrap() {
            Petal::Tabulated(petal) => petal.at(PigmentFactors::ONE, &lambda).albedo(Vec3::Z).map(|a| a[0]),
            Petal::Cells(_) => panic!("a tissue was given"),
        }
    };
    let (thin, middle, thick) = (of(0.5), of(0.75), of(1.0));
    for way in 0..2 {
        let mixed = 0.5 * (thin[way] + thick[way]);
        assert!((mixed - middle[way]).abs() < 0.03, "{way}: {thin:?} {middle:?} {thick:?}");
        assert!((thin[way] - thick[way]).abs() > 0.08, "{way}: {thin:?} {thick:?}");
    }
}

fn scene(detail: f64) -> Scene {
    let text = format!(
        "[petal]\noptics = \"sheet.optics\"\n[petal.pattern]\n{ALL}\n[materials.petal]\ntype = \"petal\"\n\
         [lights.sky]\ntype = \"constant\"\nradiance = 1\n\
         [shapes.rose]\ntype = \"rose\"\npreset = \"wild\"\nrose = {{ detail = {detail:?} }}"
    );
    compile(&load(&text, "scene.toml", &[]).unwrap().description, &files()).unwrap()
}

#[test]
fn colour_is_the_same_at_any_detail() {
    let (coarse, fine) = (scene(0.6), scene(1.5));
    let petals = |s: &Scene| -> Vec<u32> {
        (0..s.shapes.len() as u32).filter(|i| s.shapes[*i as usize].petal_id > 0).collect()
    };
    assert_eq!(petals(&coarse).len(), 5);
    for (a, b) in petals(&coarse).into_iter().zip(petals(&fine)) {
        for uv in grid(40) {
            assert_eq!(coarse.tissue(a, uv), fine.tissue(b, uv));
        }
    }
    // Sepals have no pattern of petals, other materials no pigment.
    for (i, shape) in fine.shapes.iter().enumerate() {
        assert_eq!(shape.petal.is_some(), shape.petal_id > 0);
        if shape.petal_id == 0 {
            assert_eq!(fine.tissue(i as u32, Vec2::splat(0.5)), TissueState::SOUND);
        }
    }
}

#[test]
fn wrong_numbers_are_named() {
    for (text, start) in [
        ("adaxial.rim = -1", "pattern.adaxial.rim: -1 is not within 0 to 100"),
        ("abaxial.middle = nan", "pattern.abaxial.middle: NaN"),
        ("claw_spot.irregularity = 2", "pattern.claw_spot.irregularity: 2 is not within 0 to 1"),
        ("veins.abaxial = -2", "pattern.veins.abaxial: -2 is not within -1 to 20"),
        ("veins.width_mm = 0", "pattern.veins.width_mm: 0 is not"),
        ("margin.width_mm = inf", "pattern.margin.width_mm: inf is not"),
        ("margin.factor = 101", "pattern.margin.factor: 101 is not"),
        ("age.outer = -0.5", "pattern.age.outer: -0.5 is not"),
        ("blotches.amplitude = 1.5", "pattern.blotches.amplitude: 1.5 is not"),
        ("blotches.scale_mm = 0", "pattern.blotches.scale_mm: 0 is not"),
        ("thickness.margin = 0.1", "pattern.thickness.margin: 0.1 is not within 0.2 to 1"),
        ("thickness.veins = -0.1", "pattern.thickness.veins: -0.1 is not"),
        ("withered.extent = 1.2", "pattern.withered.extent: 1.2 is not within 0 to 1"),
        ("withered.brown = nan", "pattern.withered.brown: NaN is not"),
    ] {
        let e = Pattern::new(&toml::from_str(text).unwrap(), &Key::new("pattern")).unwrap_err().to_string();
        assert!(e.starts_with(start), "{e}");
    }
    assert!(toml::from_str::<PatternDescription>("adaxial.tip = 3").is_err());
}

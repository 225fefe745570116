use glam::{UVec2, Vec3};

use super::*;
use crate::geometry::Ray;
use crate::math::stats::Welford;
use crate::math::warp::{square_to_cosine_hemisphere, square_to_disc};
use crate::scene::{MemoryAssets, SceneDescription, compile, load};
use crate::transport::Path;
use crate::validate::sheet;

const PATH: Path = Path { max_depth: 24, min_depth: 3, guide: None };

/// A glossy floor and wall, a petal of cells from above and from below, a translucent sheet, a tabulated petal or not:
/// flat, and near enough to each other that much light is indirect.
pub(in crate::transport) fn still_life(petal: &str) -> Scene {
    let mut assets = MemoryAssets::default();
    assets.files.insert("sheet.optics".into(), crate::io::petal_optics::write(&sheet(12, 6)).unwrap());
    let quad = |name: &str, material: &str, width: u32, place: &str, turn: &str| {
        format!(
            "[shapes.{name}]\ntype = \"quad\"\nwidth_mm = {width}\nheight_mm = {width}\nmaterial = \"{material}\"\n\
             position_mm = [{place}]\nrotation_deg = [{turn}]\n"
        )
    };
    let text = [
        petal,
        "[materials.petal]\ntype = \"petal\"\n",
        "[materials.glossy]\ntype = \"phong\"\ndiffuse = 0.3\nspecular = 0.5\nexponent = 15\n",
        "[materials.sheet]\ntype = \"diffuse\"\nreflectance_adaxial = 0.4\nreflectance_abaxial = 0.3\ntransmittance = 0.4\n",
        &quad("floor", "glossy", 160, "0, 0, 0", "0, 0, 0"),
        &quad("wall", "sheet", 160, "0, 60, 60", "90, 0, 0"),
        &quad("petal", "petal", 60, "-32, 0, 25", "10, 20, 0"),
        &quad("turned", "petal", 60, "32, 0, 25", "170, 20, 0"),
        &quad("sheet", "sheet", 60, "0, 10, 70", "-15, 5, 0"),
        "[lights.sky]\ntype = \"constant\"\nradiance = 0.3\n",
        "[lights.box]\ntype = \"area\"\nposition_mm = [80, -60, 120]\ntarget_mm = [0, 0, 20]\nwidth_mm = 100\nradiance = 4\n",
        "[lights.lamp]\ntype = \"area\"\nposition_mm = [60, 40, 40]\ntarget_mm = [0, 20, 20]\nwidth_mm = 25\nradiance = 3\n",
        "[lights.sun]\ntype = \"distant\"\ndirection = [-0.5, -0.4, 1]\nirradiance = 1\n",
    ]
    .concat();
    let description: SceneDescription =
        load(&text, "test", &[]).unwrap_or_else(|e| panic!("{e}")).description;
    compile(&description, &assets).unwrap_or_else(|e| panic!("{e}"))
}

const EYE: Vec3 = Vec3::new(0.0, -150.0, 170.0);
pub(in crate::transport) const THINGS: [(&str, Vec3, f32); 4] = [
    ("petal", Vec3::new(-32.0, 0.0, 25.0), 15.0),
    ("petal from below", Vec3::new(32.0, 0.0, 25.0), 15.0),
    ("sheet", Vec3::new(0.0, 10.0, 70.0), 15.0),
    ("floor", Vec3::new(0.0, 0.0, 0.0), 12.0),
];

pub(in crate::transport) fn light(
    scene: &Scene,
    by: &dyn Integrator,
    n: u32,
    (_, to, radius): (&str, Vec3, f32),
) -> Welford {
    (0..n)
        .map(|i| {
            let mut sampler = Sampler::new(23, UVec2::ZERO, i);
            let lambda = SampledWavelengths::visible(sampler.next_1d());
            let place = square_to_disc(Sampler::new(5, UVec2::new(1, 0), i).next_2d()) * radius;
            let ray = Ray::new(EYE, (to + place.extend(0.0) - EYE).normalize());
            let got = by.li(scene, &PixelRay { ray, spread: 1e-3 }, &lambda, &mut sampler);
            f64::from((got.direct + got.indirect).mean())
        })
        .collect()
}

/// Light from other surfaces by one traced ray: no error but its noise.
struct Traced<'a> {
    scene: &'a Scene,
    /// Count the light that comes straight from lights, too?
    direct: bool,
}

impl IndirectLight for Traced<'_> {
    fn indirect(&self, at: &Interaction, side: Side, lambda: &SampledWavelengths) -> SampledSpectrum {
        let [x, y, z] = at.p.to_array().map(f32::to_bits);
        let mut sampler = Sampler::new(u64::from(z) << 8 | side as u64, UVec2::new(x, y), 0);
        let mut w = square_to_cosine_hemisphere(sampler.next_2d());
        if side == Side::Abaxial {
            w.z = -w.z;
        }
        let ray = Scene::leave(at, at.frame.to_world(w).normalize());
        let pixel = PixelRay { ray, spread: 1e3 };
        let all = PATH.li(self.scene, &pixel, lambda, &mut sampler);
        let (emitted, _) = meet(self.scene, &ray, Came::Camera, Drawing::One, lambda);
        let surfaces = all.direct + all.indirect - emitted;
        let mut irradiance = surfaces * std::f32::consts::PI;
        if self.direct {
            irradiance += emitted * std::f32::consts::PI;
        }
        irradiance
    }

    fn resolution_mm(&self, _at: &Interaction) -> f32 {
        20.0
    }
}

#[track_caller]
fn assert_same(what: &str, a: &Welford, b: &Welford, precision: f64) {
    let error = a.standard_error().hypot(b.standard_error());
    assert!((a.mean() - b.mean()).abs() < 3.0 * error, "{what}: {} and {} +- {error}", a.mean(), b.mean());
    assert!(error < precision * b.mean(), "{what}: +- {error} of {} shows nothing", b.mean());
}

#[test]
fn hybrid_with_exact_irradiance_is_path() {
    let tabulated = "[petal]\noptics = \"sheet.optics\"\n";
    let lobes = "[petal.shading.transmission]\ndirect = 0.06\nindirect = 0.03\n";
    for (petal, near) in [(lobes, 0.0), (lobes, 1.5), (tabulated, 0.0)] {
        let scene = still_life(petal);
        let hybrid = Hybrid::new(&scene, Traced { scene: &scene, direct: false }, 24, near);
        // Where some surfaces are near, one thing tells.
        let things = if near > 0.0 { &THINGS[2..3] } else { &THINGS[..] };
        for &thing in things {
            let what = format!("{}, near {near}", thing.0);
            let (a, b) = (light(&scene, &hybrid, 16_000, thing), light(&scene, &PATH, 16_000, thing));
            assert_same(&what, &a, &b, 0.015);
        }
    }
}

#[test]
fn counting_direct_light_twice_is_found() {
    // The naive sum of ray tracing and radiosity: whole irradiance where only the indirect part belongs.
    let scene = still_life("");
    let naive = Hybrid::new(&scene, Traced { scene: &scene, direct: true }, 24, 0.0);
    for thing in THINGS {
        let (a, b) = (light(&scene, &naive, 8_000, thing), light(&scene, &PATH, 8_000, thing));
        let error = a.standard_error().hypot(b.standard_error());
        assert!(a.mean() - b.mean() > 5.0 * error, "{}: {} {} +- {error}", thing.0, a.mean(), b.mean());
    }
}

/// The same irradiance everywhere.
struct Even(f32);

impl IndirectLight for Even {
    fn indirect(&self, _at: &Interaction, _side: Side, _lambda: &SampledWavelengths) -> SampledSpectrum {
        SampledSpectrum::splat(self.0)
    }

    fn resolution_mm(&self, _at: &Interaction) -> f32 {
        1.0
    }
}

#[test]
fn lines_of_the_grammar() {
    let n = 12_000;
    let scene = still_life("");
    let in_scene = |scene: &Scene, max_depth, near, value| Hybrid::new(scene, Even(value), max_depth, near);
    let hybrid = |max_depth, near, value| in_scene(&scene, max_depth, near, value);
    let path = |max_depth| Path { max_depth, min_depth: 3, guide: None };
    for thing in THINGS {
        let by = |integrator: &dyn Integrator| light(&scene, integrator, n, thing);
        // E L and E X L: what `path` finds with one scattering, to the bit.
        assert_eq!(by(&hybrid(1, 0.0, 1.0)).mean(), by(&path(1)).mean(), "{}", thing.0);
        // ... and E X X L without light in the solution.
        assert_same(thing.0, &by(&hybrid(2, 0.0, 0.0)), &by(&path(2)), 0.015);
        // E X N* X L: where every surface is near, nothing is taken from the solution.
        assert_same(thing.0, &by(&hybrid(24, 1e9, 1.0)), &by(&PATH), 0.015);
    }
    // Without S there is no third surface: a sheet that gathers from sheets.
    let text = "[materials.sheet]\ntype = \"diffuse\"\nreflectance_adaxial = 0.4\nreflectance_abaxial = 0.3\ntransmittance = 0.4\n\
        [shapes.a]\ntype = \"quad\"\nwidth_mm = 9000\nheight_mm = 9000\nmaterial = \"sheet\"\n\
        [shapes.b]\ntype = \"quad\"\nwidth_mm = 9000\nheight_mm = 9000\nmaterial = \"sheet\"\nposition_mm = [0, 0, 50]\n\
        [lights.sky]\ntype = \"constant\"\nradiance = 0.3\n";
    let description: SceneDescription = load(text, "test", &[]).unwrap().description;
    let scene = compile(&description, &MemoryAssets::default()).unwrap();
    let thing = ("sheets", Vec3::new(0.0, 0.0, 50.0), 10.0);
    let by = |integrator: &dyn Integrator| light(&scene, integrator, 40_000, thing);
    let hybrid = |max_depth, near, value| in_scene(&scene, max_depth, near, value);
    assert_same("E X X L", &by(&hybrid(24, 0.0, 0.0)), &by(&path(2)), 0.005);
    // E X D [E_ind]: from above, the other sheet is met through the first (0.4), and sends light back from both its
    // sides' irradiances: 0.4 (0.4 + 0.4) E / pi.
    let lit = by(&hybrid(24, 0.0, 1.0)).mean() - by(&hybrid(24, 0.0, 0.0)).mean();
    let exact = 0.4 * 0.8 / std::f64::consts::PI;
    assert!((lit / exact - 1.0).abs() < 0.01, "{lit} {exact}");
}

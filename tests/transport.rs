//! Is the light transport unbiased? The same light is estimated in ways that share as little as possible.

mod support;

use std::ops::ControlFlow;

use glam::{UVec2, Vec2, Vec3};
use rosarium::bsdf::{Bsdf, Scatter};
use rosarium::geometry::{Ray, Side};
use rosarium::gonio::Goniophotometer;
use rosarium::math::frame::spherical;
use rosarium::math::stats::Welford;
use rosarium::math::{Sampler, warp};
use rosarium::scene::description::PetalDescription;
use rosarium::scene::{MemoryAssets, Petal, Scattering, Scene};
use rosarium::spectrum::{LANES, SampledSpectrum, SampledWavelengths};
use rosarium::transport::{Incident, Integrator, Path, PixelRay, Raytrace};

const PATH: Path = Path { max_depth: 12, min_depth: 2, guide: None };

fn scene(text: &str) -> Scene {
    support::scene_with(text, &[], &support::sky())
}

/// Light found by chance only: no light is sampled, nothing is weighed, no path is cut short by roulette. Shares
/// with `Path` the scene and the materials' own sampling, and nothing of `transport`.
struct Walks {
    max_depth: u32,
}

impl Integrator for Walks {
    fn li(&self, scene: &Scene, pixel: &PixelRay, lambda: &SampledWavelengths, s: &mut Sampler) -> Incident {
        let mut sum = SampledSpectrum::ZERO;
        let (mut ray, mut throughput) = (pixel.ray, SampledSpectrum::ONE);
        for depth in 0..=self.max_depth {
            let wo = -ray.direction;
            let Some(at) = scene.intersect(&ray) else {
                sum += throughput * scene.lights.environment(ray.direction, lambda);
                break;
            };
            let shape = &scene.shapes[at.shape as usize];
            if let Some(emitter) = shape.emitter {
                sum += throughput * scene.lights.emitted(emitter, at.ng, wo, lambda);
            }
            let material = &scene.materials[shape.material as usize];
            let local = at.frame.to_local(wo);
            s.start_dimension(10_000 + 8 * depth);
            let draw = |bsdf: &dyn Bsdf, s: &mut Sampler| {
                let u_lobe = s.next_1d();
                bsdf.sample(local, lambda, u_lobe, s.next_2d()).map(|b| (b.wi, b.weight()))
            };
            let step = match material.scattering() {
                Scattering::Bsdf(bsdf) => draw(bsdf, s),
                Scattering::Petal(Petal::Tabulated(petal)) => {
                    draw(&petal.at(scene.tissue(at.shape, at.uv).pigment, lambda), s)
                }
                Scattering::Petal(Petal::Cells(petal)) => Scatter::scatter(petal, local, lambda, s),
            };
            let Some((wi, weight)) = step else { break };
            let next = at.frame.to_world(wi).normalize();
            // A smooth normal lets no light through an opaque sheet.
            if at.ng.dot(next) * at.ng.dot(wo) * wi.z * local.z <= 0.0 {
                break;
            }
            throughput *= weight;
            ray = Scene::leave(&at, next);
        }
        Incident { direct: sum, ..Incident::default() }
    }
}

/// Light along `ray(i)`, in grey or by the mean of the lanes.
fn light(scene: &Scene, by: &dyn Integrator, n: u32, spread: f32, ray: impl Fn(u32) -> Ray) -> Welford {
    (0..n)
        .map(|i| {
            let mut sampler = Sampler::new(23, UVec2::ZERO, i);
            let lambda = SampledWavelengths::visible(sampler.next_1d());
            let got = by.li(scene, &PixelRay { ray: ray(i), spread }, &lambda, &mut sampler);
            f64::from((got.direct + got.indirect).mean())
        })
        .collect()
}

/// Rays from `eye` to points spread over a disc around `to`.
fn towards(eye: Vec3, to: Vec3, radius: f32) -> impl Fn(u32) -> Ray {
    move |i| {
        let u = warp::square_to_disc(Sampler::new(5, UVec2::new(1, 0), i).next_2d()) * radius;
        Ray::new(eye, (to + u.extend(0.0) - eye).normalize())
    }
}

#[track_caller]
fn assert_same(what: &str, a: &Welford, b: &Welford, precision: f64) {
    let error = a.standard_error().hypot(b.standard_error());
    assert!((a.mean() - b.mean()).abs() < 3.0 * error, "{what}: {} and {} +- {error}", a.mean(), b.mean());
    assert!(error < precision * b.mean(), "{what}: +- {error} of {} shows nothing", b.mean());
}

/// A petal of cells, a glossy floor, a translucent sheet and a ball. `lights` is what lights them.
fn still_life(lights: &str) -> Scene {
    scene(&format!(
        r##"
        [materials.petal]
        type = "petal"
        [materials.glossy]
        type = "phong"
        diffuse = 0.3
        specular = 0.5
        exponent = 40
        [materials.sheet]
        type = "diffuse"
        reflectance_adaxial = 0.4
        reflectance_abaxial = 0.2
        transmittance = 0.4
        [shapes.floor]
        type = "quad"
        material = "glossy"
        width_mm = 400
        height_mm = 400
        [shapes.petal]
        type = "quad"
        material = "petal"
        width_mm = 40
        height_mm = 40
        position_mm = [-30, 0, 15]
        rotation_deg = [20, 10, 0]
        [shapes.turned_petal]
        type = "quad"
        material = "petal"
        width_mm = 40
        height_mm = 40
        position_mm = [30, 0, 15]
        rotation_deg = [160, 10, 0]
        [shapes.sheet]
        type = "quad"
        material = "sheet"
        width_mm = 30
        height_mm = 30
        position_mm = [0, 40, 20]
        rotation_deg = [-50, 0, 0]
        [shapes.ball]
        type = "sphere"
        radius_mm = 12
        material = "glossy"
        position_mm = [0, -35, 12]
        {lights}
        "##
    ))
}

const CONSTANT: &str = "[lights.sky]\ntype = \"constant\"\nradiance = 0.5\n";
const BOX: &str = "[lights.box]\ntype = \"area\"\nposition_mm = [80, -60, 120]\ntarget_mm = [0, 0, 0]\nwidth_mm = 150\nradiance = 4\n";
const EYE: Vec3 = Vec3::new(0.0, -150.0, 170.0);
const THINGS: [(&str, Vec3, f32); 5] = [
    ("petal", Vec3::new(-30.0, 0.0, 15.0), 10.0),
    ("petal from below", Vec3::new(30.0, 0.0, 15.0), 10.0),
    ("sheet", Vec3::new(0.0, 40.0, 20.0), 8.0),
    ("ball", Vec3::new(0.0, -35.0, 12.0), 9.0),
    ("floor", Vec3::new(0.0, 0.0, 0.0), 12.0),
];

#[test]
fn sampled_light_is_the_light_that_walks_find() {
    let scene = still_life(&format!("{CONSTANT}{BOX}"));
    let walks = Walks { max_depth: PATH.max_depth };
    for (what, to, radius) in THINGS {
        let a = light(&scene, &PATH, 12_000, 1e-3, towards(EYE, to, radius));
        let b = light(&scene, &walks, 50_000, 1e-3, towards(EYE, to, radius));
        assert_same(what, &a, &b, 0.012);
    }
}

#[test]
fn lights_add_up() {
    // Alone, a light is all that is found; together the lights at infinity overlap and each light has its share of
    // the samples. The bodies of the area lights stay: they cast shadows.
    let lights = [
        CONSTANT,
        BOX,
        "[lights.image]\ntype = \"image\"\nfile = \"sky.exr\"\nrotation_deg = 30\nscale = 0.7\n",
        "[lights.sun]\ntype = \"distant\"\ndirection = [0.5, -0.4, 1]\nirradiance = 1.5\n",
        "[lights.wide]\ntype = \"distant\"\ndirection = [-0.5, -0.4, 1]\nirradiance = 1\nangular_radius_deg = 20\n",
        "[lights.parallel]\ntype = \"distant\"\ndirection = [0, 0.4, 1]\nirradiance = 0.5\nangular_radius_deg = 0\n",
        "[lights.bulb]\ntype = \"point\"\nposition_mm = [10, -20, 90]\nintensity = 4000\n",
        "[lights.disc]\ntype = \"area\"\nshape = \"disc\"\nradius_mm = 4\nposition_mm = [-40, -40, 60]\nnormal = [0.3, 0.4, -1]\ntwo_sided = true\nradiance = 40\n",
    ];
    let area = [BOX, lights[lights.len() - 1]];
    for (what, to, radius) in THINGS {
        let rays = towards(EYE, to, radius);
        let all = light(&still_life(&lights.concat()), &PATH, 40_000, 1e-3, &rays);
        let (mut sum, mut variance) = (0.0, 0.0);
        for l in lights {
            let bodies: String = area
                .iter()
                .filter(|a| **a != l)
                .map(|a| a.replace("radiance = ", "radiance = 0.0 # "))
                .collect();
            let alone = light(&still_life(&format!("{l}{bodies}")), &PATH, 8_000, 1e-3, &rays);
            sum += alone.mean();
            variance += alone.standard_error().powi(2);
        }
        let error = all.standard_error().hypot(variance.sqrt());
        assert!((all.mean() - sum).abs() < 3.0 * error, "{what}: {} {sum} +- {error}", all.mean());
        assert!(error < 0.02 * sum, "{what}: +- {error} of {sum}");
    }
}

#[test]
fn a_constant_light_is_a_glowing_sphere_around_everything() {
    let open = still_life(CONSTANT);
    let closed = still_life(
        r#"[materials.black]
        type = "lambert"
        reflectance = 0
        [shapes.world]
        type = "sphere"
        radius_mm = 2000
        subdivisions = 3
        material = "black"
        emission = { radiance = 0.5, two_sided = true }
        "#,
    );
    for (what, to, radius) in THINGS {
        let a = light(&open, &PATH, 16_000, 1e-3, towards(EYE, to, radius));
        let b = light(&closed, &PATH, 30_000, 1e-3, towards(EYE, to, radius));
        assert_same(what, &b, &a, 0.015);
    }
}

#[test]
fn a_light_in_unequal_pieces_is_the_whole_light() {
    // One quad of 100 mm, and the same cut at x = 48: the pieces are picked 49 to 1.
    let whole = BOX_ABOVE.replace("WIDTH", "100").replace("X", "0").replace("NAME", "a");
    let pieces = [("98", "-1", "a"), ("2", "49", "b")]
        .map(|(w, x, n)| BOX_ABOVE.replace("WIDTH", w).replace("X", x).replace("NAME", n))
        .concat();
    let (whole, pieces) = (still_life(&whole), still_life(&pieces));
    for (what, to, radius) in THINGS {
        let a = light(&whole, &PATH, 30_000, 1e-3, towards(EYE, to, radius));
        let b = light(&pieces, &PATH, 30_000, 1e-3, towards(EYE, to, radius));
        assert_same(what, &a, &b, 0.02);
    }
}

const BOX_ABOVE: &str = "[lights.NAME]\ntype = \"area\"\nposition_mm = [X, 0, 130]\nnormal = [0, 0, -1]\nwidth_mm = WIDTH\nheight_mm = 100\nradiance = 5\n";

/// A petal in the xy plane.
fn flat_petal(lights: &str) -> Scene {
    scene(&format!(
        "[materials.petal]\ntype = \"petal\"\n[shapes.petal]\ntype = \"quad\"\nmaterial = \"petal\"\n\
         width_mm = 200\nheight_mm = 200\n{lights}"
    ))
}

#[test]
fn a_petal_under_a_white_sky_is_its_albedo() {
    let scene = flat_petal("[lights.sky]\ntype = \"constant\"\nspectrum = { illuminant = \"E\" }\n");
    let petal = PetalDescription::default().compile("", &MemoryAssets::default()).unwrap();
    let incident_deg = [0.0, 50.0, 80.0];
    for (side, sign) in [(Side::Adaxial, 1.0), (Side::Abaxial, -1.0)] {
        let instrument = Goniophotometer {
            incident_deg: incident_deg.to_vec(),
            side,
            rays: 100_000,
            bands_nm: vec![620.0],
            ..Default::default()
        };
        let table = instrument.measure(&petal, &|_, _| ControlFlow::Continue(())).unwrap();
        for (incidence, angle) in table.incidences.iter().zip(incident_deg) {
            let lambda = SampledWavelengths::given([620.0; LANES]);
            // At the lamp's azimuth: seen along another row of the lattice the albedo differs by up to 5 %.
            let to_viewer = spherical((angle as f32).to_radians(), 0.0) * Vec3::new(1.0, 1.0, sign);
            let ray = Ray::new(to_viewer * 50.0, -to_viewer);
            let seen: Welford = (0..40_000)
                .map(|i| {
                    let mut s = Sampler::new(3, UVec2::ZERO, i);
                    let got = PATH.li(&scene, &PixelRay { ray, spread: 1.0 }, &lambda, &mut s);
                    f64::from((got.direct + got.indirect)[0])
                })
                .collect();
            let (r, t) = (incidence.mean.reflectance, incidence.mean.transmittance);
            let error = seen.standard_error().hypot(r.standard_error).hypot(t.standard_error);
            let (seen, measured) = (seen.mean(), r.value + t.value);
            assert!((seen - measured).abs() < 3.0 * error, "{side:?} {angle}: {seen} {measured} +- {error}");
            assert!(error < 0.01 * measured);
        }
    }
}

#[test]
fn close_up_cells_average_to_the_far_petal() {
    let scene = flat_petal("[lights.sun]\ntype = \"distant\"\ndirection = [0.6, 0.3, 0.7]\n");
    let lambda = SampledWavelengths::given([620.0; LANES]);
    let direction = Vec3::new(-0.2, 0.5, -1.0).normalize();
    // Each pixel somewhere else on the petal, `radius_um` wide, from 64 samples.
    let pixels = |radius_um: f32| -> Welford {
        (0..4096)
            .map(|p| {
                let at = (Sampler::new(2, UVec2::ZERO, p).next_2d() - Vec2::splat(0.5)) * 20.0;
                let ray = Ray::new(at.extend(0.0) - direction * 100.0, direction);
                let spread = radius_um * 1e-3 / 100.0 * (-direction.z).sqrt();
                let sum: f64 = (0..64)
                    .map(|i| {
                        let mut s = Sampler::new(4, UVec2::new(p, 0), i);
                        let got = PATH.li(&scene, &PixelRay { ray, spread }, &lambda, &mut s);
                        f64::from(got.direct[0])
                    })
                    .sum();
                sum / 64.0
            })
            .collect()
    };
    let (close, far) = (pixels(2.0), pixels(2000.0));
    assert_same("close and far", &close, &far, 0.02);
    // Pixels of 0.1 of a cell see the highlight or do not; far away all are alike.
    let spread = |w: &Welford| w.variance().sqrt() / w.mean();
    assert!(spread(&close) > 3.0 * spread(&far), "{} {}", spread(&close), spread(&far));
}

/// The cells stand in the world where the texture coordinates put them, also where u, v and the normal are
/// left-handed, as on a grown petal: a dome's lit side is the side that faces the sun.
#[test]
fn domes_are_lit_from_the_suns_side_by_any_texture_coordinates() {
    let sun = "[lights.sun]\ntype = \"distant\"\ndirection = [0, 1, 0.6]\n";
    let right = flat_petal(sun);
    let mut left = flat_petal(sun);
    // Mirrored in y; the regular lattice is its own mirror image, so every dome stays where it is.
    left.shapes[0].mesh.uvs.iter_mut().for_each(|uv| uv.y = -uv.y);
    // Centre of the middle cell of the quad: uv = 0 is a centre at the corner.
    let pitch = 0.023;
    let row = pitch * 0.75f32.sqrt();
    let corner = Vec2::splat(-100.0);
    let cell = corner + Vec2::new(pitch * 4000.0, row * 4000.0);
    let brightness = |scene: &Scene, y_um: f32| {
        let at = cell + Vec2::new(0.0, y_um * 1e-3);
        let ray = Ray::new(at.extend(50.0), -Vec3::Z);
        light(scene, &PATH, 2000, 1e-3 / 50.0, move |_| ray).mean()
    };
    let (sunny, shady) = (brightness(&right, 7.0), brightness(&right, -7.0));
    assert!(sunny > 1.5 * shady, "{sunny} {shady}");
    let (sunny_left, shady_left) = (brightness(&left, 7.0), brightness(&left, -7.0));
    assert!((sunny_left / sunny - 1.0).abs() < 0.1, "{sunny_left} {sunny}");
    assert!((shady_left / shady - 1.0).abs() < 0.1, "{shady_left} {shady}");
}

#[test]
fn no_sheet_shadows_itself() {
    for (size, turn) in [(100.0, "33, 0, 0"), (3000.0, "30, 10, 0"), (20_000.0, "37, 10, 5")] {
        let scene = scene(&format!(
            "[materials.m]\ntype = \"lambert\"\n[shapes.sheet]\ntype = \"quad\"\nmaterial = \"m\"\n\
             width_mm = {size}\nheight_mm = {size}\nrotation_deg = [{turn}]\n{CONSTANT}"
        ));
        let mut seen = 0;
        for i in 0..100_000 {
            let mut s = Sampler::new(1, UVec2::ZERO, i);
            let eye = Vec3::new(10.0, 20.0, 300.0);
            let to = ((s.next_2d() - Vec2::splat(0.5)) * 60.0).extend(0.0);
            let Some(at) = scene.intersect(&Ray::new(eye, (to - eye).normalize())) else { continue };
            let up = at.frame.to_world(warp::square_to_cosine_hemisphere(s.next_2d()));
            seen += 1;
            for direction in [up, -up] {
                assert!(
                    scene.unoccluded(&at, direction, f32::INFINITY),
                    "{size} mm at {} to {direction}",
                    at.p
                );
            }
        }
        assert!(seen > 90_000, "{seen}");
    }
}

#[test]
fn each_sheet_between_a_point_and_a_light_is_counted_once() {
    // Sheets through the origin, where coordinates are small and the way there is long.
    for (floor, turn) in [(-100.0, 0), (-400.0, 0), (-400.0, 35)] {
        let scene = scene(&format!(
            "[materials.m]\ntype = \"diffuse\"\ntransmittance = 0.5\nreflectance_adaxial = 0.4\n\
             [shapes.sheet]\ntype = \"quad\"\nmaterial = \"m\"\nwidth_mm = 300\nheight_mm = 300\n\
             rotation_deg = [{turn}, 0, 0]\n\
             [shapes.floor]\ntype = \"quad\"\nmaterial = \"m\"\nwidth_mm = 5000\nheight_mm = 5000\n\
             position_mm = [0, 0, {floor}]\n{CONSTANT}"
        ));
        let lambda = SampledWavelengths::visible(0.5);
        for i in 0..50_000 {
            let mut s = Sampler::new(1, UVec2::ZERO, i);
            let mut around = |size: f32| ((s.next_2d() - Vec2::splat(0.5)) * size).extend(0.0);
            let (below, through) = (around(60.0), around(100.0));
            let eye = below + Vec3::new(0.0, 0.0, floor as f32 + 20.0);
            let at = scene.intersect(&Ray::new(eye, -Vec3::Z)).unwrap();
            let direction = (through - at.p).normalize();
            let share = scene.transmitted(&at, direction, f32::INFINITY, &lambda)[0];
            assert!((share - 0.5).abs() < 1e-3, "{share} through {through} from {}", at.p);
        }
    }
}

#[test]
fn a_light_from_a_file_glows_where_its_normals_point() {
    // A lamp whose faces are wound against its normals: sampling the light and meeting it must agree.
    let obj =
        "v -30 -30 50\nv 30 -30 50\nv 30 30 50\nv -30 30 50\nvn 0 0 -1\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\n";
    let mut assets = MemoryAssets::default();
    assets.files.insert("lamp.obj".to_owned(), obj.as_bytes().to_vec());
    let text = "[materials.m]\ntype = \"lambert\"\nreflectance = 0.8\n[materials.black]\ntype = \"lambert\"\nreflectance = 0\n\
                [shapes.floor]\ntype = \"quad\"\nmaterial = \"m\"\nwidth_mm = 100\nheight_mm = 100\n\
                [shapes.lamp]\ntype = \"mesh\"\nfile = \"lamp.obj\"\nmaterial = \"black\"\nemission = { radiance = 3 }\n";
    let scene = support::scene_with(text, &[], &assets);
    let rays = towards(Vec3::new(0.0, 0.0, 40.0), Vec3::ZERO, 10.0);
    let a = light(&scene, &PATH, 4000, 1e-3, &rays);
    let b = light(&scene, &Walks { max_depth: 12 }, 40_000, 1e-3, &rays);
    assert_same("floor", &a, &b, 0.01);
    assert_same("raytrace", &light(&scene, &Raytrace, 4000, 1e-3, &rays), &a, 0.01);
}

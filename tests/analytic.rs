//! Scenes whose light has a closed form, rendered by the path tracer.

use std::sync::Arc;

use glam::{UVec2, Vec2, Vec3};
use rosarium::math::Sampler;
use rosarium::math::stats::Welford;
use rosarium::scene::{MemoryAssets, Scene, SceneDescription, compile, load};
use rosarium::spectrum::SampledWavelengths;
use rosarium::transport::radiosity::{Radiosity, RadiositySettings, solve};
use rosarium::transport::{
    Guide, GuideSettings, Hybrid, Integrator, NoProgress, Path, PixelRay, RadiosityView, Raytrace,
};

const PATH: Path = Path { max_depth: 10_000, min_depth: 4, guide: None };

fn scene(text: &str) -> Scene {
    let description: SceneDescription = load(text, "test", &[]).unwrap_or_else(|e| panic!("{e}")).description;
    compile(&description, &MemoryAssets::default()).unwrap_or_else(|e| panic!("{e}"))
}

/// Mean and standard error of the light along rays from a point; grey scenes, so all lanes are alike.
fn light(
    scene: &Scene,
    integrator: &dyn Integrator,
    eye: Vec3,
    ray: impl Fn(u32) -> Vec3,
    n: u32,
) -> Welford {
    let mut mean = Welford::default();
    for i in 0..n {
        let mut sampler = Sampler::new(11, UVec2::ZERO, i);
        let lambda = SampledWavelengths::visible(sampler.next_1d());
        let ray = PixelRay { ray: rosarium::geometry::Ray::new(eye, ray(i)), spread: 1e-3 };
        let got = integrator.li(scene, &ray, &lambda, &mut sampler);
        mean.push(f64::from((got.direct + got.indirect).mean()));
    }
    mean
}

fn around(i: u32) -> Vec3 {
    let u = Sampler::new(5, UVec2::new(1, 0), i).next_2d();
    rosarium::math::warp::square_to_sphere(u)
}

#[track_caller]
fn assert_near(got: &Welford, exact: f64, bias: f64) {
    let (mean, se) = (got.mean(), got.standard_error());
    assert!((mean - exact).abs() <= 3.0 * se + bias * exact, "{mean} +- {se}, exact {exact}");
    assert!(se < 0.01 * exact, "the standard error {se} is too large to test {exact}");
}

/// A closed room whose walls glow with radiance 1 and reflect `albedo`. Flat walls, a little wider than the room:
/// no light is lost to smooth normals or at the edges.
fn furnace(albedo: f64, more: &str) -> Scene {
    let walls = ["0, 0, 0", "180, 0, 0", "90, 0, 0", "-90, 0, 0", "0, 90, 0", "0, -90, 0"];
    let places = ["0, 0, -50", "0, 0, 50", "0, 50, 0", "0, -50, 0", "-50, 0, 0", "50, 0, 0"];
    let walls: String = walls
        .iter()
        .zip(places)
        .enumerate()
        .map(|(k, (rotation, place))| {
            format!(
                "[shapes.wall{k}]\ntype = \"quad\"\nwidth_mm = 100.01\nheight_mm = 100.01\nmaterial = \"wall\"\n\
                 position_mm = [{place}]\nrotation_deg = [{rotation}]\n\
                 emission = {{ radiance = 1, two_sided = true, spectrum = {{ illuminant = \"E\" }} }}\n"
            )
        })
        .collect();
    scene(&format!("[materials.wall]\ntype = \"lambert\"\nreflectance = {albedo}\n{walls}{more}"))
}

#[test]
fn closed_furnace() {
    for albedo in [0.2, 0.5, 0.8] {
        let got = light(&furnace(albedo, ""), &PATH, Vec3::new(3.0, -4.0, 5.0), around, 20_000);
        assert_near(&got, 1.0 / (1.0 - albedo), 0.0);
    }
}

/// `path`, guided by a small solution.
fn guided(scene: &Scene) -> Path {
    let settings = GuideSettings { elements: 200, ..GuideSettings::default() };
    let guide = Guide::new(scene, &settings, &mut Vec::new(), &NoProgress).unwrap_or_else(|e| panic!("{e}"));
    Path { guide: Some(Arc::new(guide)), ..PATH }
}

/// Glowing walls that reflect `albedo`, with white sheets between that let light through, and nothing of it is lost.
#[test]
fn guided_furnace() {
    for albedo in [0.3, 0.7] {
        let sheets: String = (0..4)
            .map(|k| {
                format!(
                    "[shapes.sheet{k}]\ntype = \"quad\"\nwidth_mm = 40\nheight_mm = 30\nmaterial = \"sheet\"\n\
                     position_mm = [{}, 4, {}]\nrotation_deg = [{}, 25, 0]\n",
                    5 * k - 9,
                    9 * k - 16,
                    17 * k
                )
            })
            .collect();
        let sheets = format!(
            "[materials.sheet]\ntype = \"diffuse\"\nreflectance_adaxial = 0.6\ntransmittance = 0.4\n{sheets}"
        );
        let scene = furnace(albedo, &sheets);
        let got = light(&scene, &guided(&scene), Vec3::new(3.0, -24.0, 25.0), around, 20_000);
        assert_near(&got, 1.0 / (1.0 - albedo), 0.0);
    }
}

/// Sheets in constant surroundings of two lights: what they reflect and let through is what stands behind them.
#[test]
fn guided_sheets_vanish_in_constant_light() {
    let sheets: String = (0..5)
        .map(|k| {
            format!(
                "[shapes.sheet{k}]\ntype = \"quad\"\nwidth_mm = 60\nheight_mm = 60\nmaterial = \"sheet\"\n\
                 position_mm = [0, 0, {}]\nrotation_deg = [{}, {}, 0]\n",
                8 * k,
                7 * k,
                25 - 11 * k
            )
        })
        .collect();
    let of = |radiance: f32| {
        format!("type = \"constant\"\nradiance = {radiance}\nspectrum = {{ illuminant = \"E\" }}\n")
    };
    let scene = scene(&format!(
        "[materials.sheet]\ntype = \"diffuse\"\nreflectance_adaxial = 0.55\ntransmittance = 0.45\n{sheets}\
         [lights.a]\n{}[lights.b]\n{}",
        of(0.3),
        of(0.7)
    ));
    let down = |i: u32| {
        let u = Sampler::new(5, UVec2::new(2, 0), i).next_2d();
        (Vec3::new(40.0 * u.x - 20.0, 40.0 * u.y - 20.0, 16.0) - Vec3::new(0.0, 0.0, 200.0)).normalize()
    };
    let got = light(&scene, &guided(&scene), Vec3::new(0.0, 0.0, 200.0), down, 20_000);
    assert_near(&got, 1.0, 0.0);
}

/// `hybrid` and `radiosity` from one small solution.
fn solved(scene: &Scene, elements: u32) -> (Hybrid<Arc<Radiosity>>, RadiosityView) {
    let settings = RadiositySettings { elements, ..RadiositySettings::default() };
    let solution = Arc::new(solve(scene, &[450.0, 650.0], &settings, &mut Vec::new(), &NoProgress).unwrap());
    assert!(solution.converged(), "{}", solution.residual());
    let hybrid = Hybrid::new(scene, solution.clone(), 10_000, 1.0);
    (hybrid, RadiosityView { solution })
}

/// A closed room with six tilted translucent sheets in it; all glow with radiance 1.
fn sheets_in_a_furnace(r: f64, t: f64) -> Scene {
    let glow = r#"emission = { radiance = 1, two_sided = true, spectrum = { illuminant = "E" } }"#;
    let sheets: String = (0..6)
        .map(|k| {
            format!(
                "[shapes.sheet{k}]\ntype = \"quad\"\nwidth_mm = 40\nheight_mm = 30\nmaterial = \"sheet\"\n\
                 position_mm = [{}, {}, {}]\nrotation_deg = [{}, {}, 0]\n{glow}\n",
                3 * k - 9,
                5 - 2 * k,
                6 * k - 16,
                17 * k,
                31 * k
            )
        })
        .collect();
    let material = format!(
        "[materials.sheet]\ntype = \"diffuse\"\nreflectance_adaxial = {r}\ntransmittance = {t}\n{sheets}"
    );
    furnace(r + t, &material)
}

#[test]
fn view_of_a_furnace() {
    for (r, t) in [(0.1, 0.1), (0.5, 0.3)] {
        let scene = sheets_in_a_furnace(r, t);
        let (hybrid, view) = solved(&scene, 1000);
        let exact = 1.0 / (1.0 - r - t);
        let eye = Vec3::new(3.0, -4.0, 25.0);
        assert_near(&light(&scene, &hybrid, eye, around, 10_000), exact, 2e-3);
        assert_near(&light(&scene, &view, eye, around, 2_000), exact, 2e-3);
    }
}

#[test]
fn closed_furnace_with_translucent_sheets() {
    for (r, t) in [(0.1, 0.1), (0.2, 0.3), (0.5, 0.3)] {
        let albedo = r + t;
        let scene = sheets_in_a_furnace(r, t);
        let got = light(&scene, &PATH, Vec3::new(3.0, -4.0, 25.0), around, 20_000);
        assert_near(&got, 1.0 / (1.0 - albedo), 0.0);
    }
}

#[test]
fn two_parallel_translucent_sheets() {
    // Wide sheets 1 mm apart under a white sky. Radiance up from the lower sheet
    //   u = (t2 + r2 t1) / (1 - r1 r2), and what leaves the upper sheet upwards is r1 + t1 u.
    let (r1, t1, r2, t2) = (0.3, 0.5, 0.4, 0.35);
    let sheet = |name: &str, r: f64, t: f64, z: f64| {
        format!(
            "[materials.{name}]\ntype = \"diffuse\"\nreflectance_adaxial = {r}\ntransmittance = {t}\n\
             [shapes.{name}]\ntype = \"quad\"\nwidth_mm = 20000\nheight_mm = 20000\nmaterial = \"{name}\"\n\
             position_mm = [0, 0, {z}]\n"
        )
    };
    let text = format!(
        "{}{}[lights.sky]\ntype = \"constant\"\nradiance = 1\nspectrum = {{ illuminant = \"E\" }}\n",
        sheet("upper", r1, t1, 1.0),
        sheet("lower", r2, t2, 0.0)
    );
    let scene = scene(&text);
    let u = (t2 + r2 * t1) / (1.0 - r1 * r2);
    let down = |_| Vec3::new(0.3, 0.1, -1.0).normalize();
    let got = light(&scene, &PATH, Vec3::new(1.0, 2.0, 10.0), down, 100_000);
    // The rim is 1e4 gaps away: light that enters there is below 1e-3 of the sum.
    assert_near(&got, r1 + t1 * u, 1e-3);
    // From between the sheets, looking down.
    let got = light(&scene, &PATH, Vec3::new(1.0, 2.0, 0.5), down, 100_000);
    assert_near(&got, u, 1e-3);
    // The same by radiosity. Its elements are far wider than the gap: the hybrid must not trace through all of them.
    let (mut hybrid, view) = solved(&scene, 200);
    hybrid.near = 0.0;
    for (eye, exact) in [(Vec3::new(1.0, 2.0, 10.0), r1 + t1 * u), (Vec3::new(1.0, 2.0, 0.5), u)] {
        assert_near(&light(&scene, &hybrid, eye, down, 50_000), exact, 2e-3);
        assert_near(&light(&scene, &view, eye, down, 10), exact, 2e-2);
    }
}

#[test]
fn sphere_with_a_point_light() {
    // Everywhere on the inside E = I / R^2, and each order of reflection is the last times the albedo:
    // L = a I / (pi R^2) / (1 - a). The mesh of 20 * 4^5 faces is a sphere to 1e-3.
    let (albedo, intensity, radius) = (0.5, 3000.0, 20.0);
    let scene = scene(&format!(
        r#"
        [materials.wall]
        type = "lambert"
        reflectance = {albedo}
        [shapes.room]
        type = "sphere"
        radius_mm = {radius}
        subdivisions = 5
        material = "wall"
        [lights.lamp]
        type = "point"
        position_mm = [0, 0, 0]
        intensity = {intensity}
        spectrum = {{ illuminant = "E" }}
        "#
    ));
    let exact = albedo * intensity / (std::f64::consts::PI * radius * radius) / (1.0 - albedo);
    let got = light(&scene, &PATH, Vec3::new(5.0, 6.0, -7.0), around, 20_000);
    assert_near(&got, exact, 2e-3);
}

#[test]
fn glossy_surfaces_weigh_light_and_bsdf_samples() {
    // A Phong plane under a white sky returns its albedo; every sample could come from either side.
    let text = r#"
        [materials.floor]
        type = "phong"
        diffuse = 0.3
        specular = 0.6
        exponent = 60
        [shapes.floor]
        type = "quad"
        width_mm = 100
        height_mm = 100
        material = "floor"
        [lights.sky]
        type = "constant"
        radiance = 1
        spectrum = { illuminant = "E" }
    "#;
    let down = |_| Vec3::new(0.0, 0.05, -1.0).normalize();
    let got = light(&scene(text), &PATH, Vec3::new(0.0, 0.0, 50.0), down, 50_000);
    // Near normal incidence the whole lobe lies above the surface.
    assert_near(&got, 0.9, 1e-3);
}

#[test]
fn raytrace_is_the_direct_light_of_path() {
    let scene = scene(
        r#"
        [materials.floor]
        type = "lambert"
        reflectance = 0.7
        [shapes.floor]
        type = "quad"
        width_mm = 100
        height_mm = 100
        material = "floor"
        [shapes.ball]
        type = "sphere"
        radius_mm = 10
        position_mm = [0, 0, 12]
        material = "floor"
        [lights.sky]
        type = "constant"
        radiance = 0.4
        spectrum = { illuminant = "E" }
        [lights.sun]
        type = "distant"
        direction = [0.4, 0.2, 1]
        irradiance = 2
        spectrum = { illuminant = "E" }
        "#,
    );
    let at = |i: u32| {
        let u = Sampler::new(2, UVec2::ZERO, i).next_2d() - Vec2::splat(0.5);
        Vec3::new(u.x, u.y, -1.0).normalize()
    };
    let eye = Vec3::new(5.0, 3.0, 60.0);
    let direct = Path { max_depth: 1, min_depth: 4, guide: None };
    let path = light(&scene, &direct, eye, at, 40_000);
    let traced = light(&scene, &Raytrace, eye, at, 40_000);
    let error = path.standard_error().hypot(traced.standard_error());
    assert!(
        (path.mean() - traced.mean()).abs() < 3.0 * error,
        "{} {} +- {error}",
        path.mean(),
        traced.mean()
    );
}

#[test]
fn a_petal_attenuates_its_shadow_in_raytrace() {
    // Sun through one sheet of transmittance 0.3 onto a white floor: 0.3 of the open floor's light.
    let floor = |sheet: &str| {
        scene(&format!(
            r#"
            [materials.floor]
            type = "lambert"
            reflectance = 0.8
            [materials.sheet]
            type = "diffuse"
            reflectance_adaxial = 0.4
            transmittance = 0.3
            [shapes.floor]
            type = "quad"
            width_mm = 400
            height_mm = 400
            material = "floor"
            {sheet}
            [lights.sun]
            type = "distant"
            direction = [0, 0, 1]
            irradiance = 2
            spectrum = {{ illuminant = "E" }}
            "#
        ))
    };
    let sheet = "[shapes.sheet]\ntype = \"quad\"\nwidth_mm = 50\nheight_mm = 50\nmaterial = \"sheet\"\nposition_mm = [0, 0, 90]";
    let down = |_| -Vec3::Z;
    let open = light(&floor(""), &Raytrace, Vec3::new(3.0, 3.0, 50.0), down, 16).mean();
    let shaded = light(&floor(sheet), &Raytrace, Vec3::new(3.0, 3.0, 50.0), down, 16).mean();
    assert!((open - 0.8 * 2.0 / std::f64::consts::PI).abs() < 1e-4, "{open}");
    assert!((shaded / open - 0.3).abs() < 1e-4, "{shaded} {open}");
}

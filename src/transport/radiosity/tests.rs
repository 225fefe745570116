//! Scenes whose light is known.

use glam::Vec3;

use super::testing::{compiled, scene};
use super::*;
use crate::math::Sampler;
use crate::transport::NoProgress;

fn settings(elements: u32, rays: u32, light_samples: u32) -> RadiositySettings {
    let residual = 1e-7;
    RadiositySettings {
        elements,
        rays,
        light_samples,
        light_rays: 1 << 12,
        residual,
        ..RadiositySettings::default()
    }
}

fn solved(scene: &Scene, settings: &RadiositySettings) -> Radiosity {
    let mut warnings = Vec::new();
    let out = super::solve(scene, &[450.0, 550.0, 650.0], settings, &mut warnings, &NoProgress).unwrap();
    assert_eq!(warnings, Vec::<String>::new());
    out
}

#[test]
fn sky_and_sun_on_a_floor() {
    let floor = "[shapes.floor]\ntype = \"quad\"\nwidth_mm = 20\nheight_mm = 20\nmaterial = \"grey\"\n";
    let s = scene(&format!(
        "{floor}[lights.sun]\ntype = \"distant\"\nelevation_deg = 30\nirradiance = 4\nspectrum = {{ illuminant = \"E\" }}\n"
    ));
    let r = solved(&s, &settings(64, 16, 256));
    for e in 0..r.elements().len() as u32 {
        let (above, below) = (
            r.element(e, Side::Adaxial, Quantity::Incident),
            r.element(e, Side::Abaxial, Quantity::Incident),
        );
        let pi = std::f32::consts::PI;
        assert!((above[1] / (pi + 2.0) - 1.0).abs() < 5e-3, "{above:?}");
        assert!((below[1] / pi - 1.0).abs() < 5e-3, "{below:?}");
        assert_eq!(r.element(e, Side::Adaxial, Quantity::Transmitted)[0], 0.0);
        assert!((r.element(e, Side::Adaxial, Quantity::Leaving)[2] / (0.5 * above[2]) - 1.0).abs() < 1e-4);
    }
}

#[test]
fn light_of_few_wavelengths_is_not_lost() {
    // Dark at the first eight wavelengths.
    let red = "spectrum = { wavelengths_nm = [600, 601], values = [0, 1] }";
    let s = compiled(&format!(
        "[materials.grey]\ntype = \"lambert\"\nreflectance = 0.5\n\
         [shapes.floor]\ntype = \"quad\"\nwidth_mm = 20\nheight_mm = 20\nmaterial = \"grey\"\n\
         [lights.sun]\ntype = \"distant\"\nelevation_deg = 30\nirradiance = 4\n{red}\n\
         [lights.disc]\ntype = \"area\"\nshape = \"disc\"\nradius_mm = 5\nposition_mm = [0, 0, 500]\nnormal = [0, 0, -1]\n\
         radiance = 1000\n{red}\n"
    ));
    let nm: Vec<f32> = (0..16).map(|i| 400.0 + 20.0 * i as f32).collect();
    let at = |nm: &[f32]| {
        let r = super::solve(&s, nm, &settings(64, 6, 64), &mut Vec::new(), &NoProgress).unwrap();
        let last = nm.len() - 1;
        (r.element(0, Side::Adaxial, Quantity::Leaving), r.ledger().error()[last] / r.ledger().emitted[last])
    };
    let ((many, error), (one, _)) = (at(&nm), at(&nm[12..13]));
    assert_eq!(many[9], 0.0);
    assert!(one[0] > 0.1 && (many[12] / one[0] - 1.0).abs() < 1e-4, "{many:?} {one:?}");
    assert!(error.abs() < 2e-3, "{error}");
}

#[test]
fn a_sky_beside_an_even_one_is_counted_once() {
    let floor = "[materials.grey]\ntype = \"lambert\"\nreflectance = 0.5\n\
                 [shapes.floor]\ntype = \"quad\"\nwidth_mm = 20\nheight_mm = 20\nmaterial = \"grey\"\n";
    let even = "[lights.even]\ntype = \"constant\"\nradiance = 0.1\n";
    let sky = "[lights.sky]\ntype = \"sky\"\nelevation_deg = 40\nsun = false\n";
    let above = |lights: &str| {
        let r = solved(&compiled(&format!("{floor}{lights}")), &settings(64, 6, 512));
        f64::from(r.element(3, Side::Adaxial, Quantity::Incident)[1])
    };
    let (one, other, both) = (above(even), above(sky), above(&format!("{even}{sky}")));
    assert!(other > 0.1 * one && one > 0.1 * other, "{one} {other}");
    assert!((both / (one + other) - 1.0).abs() < 0.01, "{one} {other} {both}");
}

/// A closed shell that reflects r and transmits t inside a larger opaque one, both glowing with radiance 1 on both sides.
#[test]
fn furnace_of_translucent_sheets() {
    for (r, t) in [(0.3, 0.2), (0.5, 0.3), (0.45, 0.5)] {
        let a: f64 = r + t;
        let glow = "emission = { radiance = 1, two_sided = true, spectrum = { illuminant = \"E\" } }";
        let s = compiled(&format!(
            r#"
            [materials.wall]
            type = "lambert"
            reflectance = {a}
            [materials.sheet]
            type = "diffuse"
            reflectance_adaxial = {r}
            transmittance = {t}
            [shapes.inner]
            type = "sphere"
            radius_mm = 20
            position_mm = [5, 0, 0]
            subdivisions = 3
            material = "sheet"
            {glow}
            [shapes.outer]
            type = "sphere"
            radius_mm = 30
            subdivisions = 3
            material = "wall"
            {glow}
            "#
        ));
        let r = solved(&s, &settings(600, 64, 1));
        assert!(r.converged() && r.imbalance() < 1e-4, "{} {}", r.residual(), r.imbalance());
        // What is sent on is a of what comes: radiance 1 / (1 - a) everywhere inside.
        let pi = std::f32::consts::PI;
        let exact = pi / (1.0 - a) as f32;
        let mut worst = 0.0f32;
        for e in 0..r.elements().len() as u32 {
            let outer = s.shapes[r.elements().list()[e as usize].shape as usize].key.contains("outer");
            let sides = [Side::Abaxial, Side::Adaxial];
            for side in if outer { &sides[..1] } else { &sides[..] } {
                let b = r.element(e, *side, Quantity::Leaving)[1] + pi;
                worst = worst.max((b / exact - 1.0).abs());
            }
        }
        assert!(worst < 1e-3, "a = {a}: {worst}");
    }
}

/// Wide sheets 1 mm apart under a white sky of radiance 1: from between them
/// up = (t2 + r2 t1) / (1 - r1 r2), and r1 + t1 up leaves the upper one upwards.
#[test]
fn parallel_sheets_match_the_series() {
    let (r1, t1, r2, t2) = (0.3, 0.5, 0.4, 0.35);
    let sheet = |name: &str, r: f64, t: f64, z: f64| {
        format!(
            "[materials.{name}]\ntype = \"diffuse\"\nreflectance_adaxial = {r}\ntransmittance = {t}\n\
             [shapes.{name}]\ntype = \"quad\"\nwidth_mm = 4000\nheight_mm = 4000\nmaterial = \"{name}\"\n\
             position_mm = [0, 0, {z}]\n"
        )
    };
    let s = scene(&(sheet("upper", r1, t1, 1.0) + &sheet("lower", r2, t2, 0.0)));
    let r = solved(&s, &settings(400, 256, 256));
    let up = (t2 + r2 * t1) / (1.0 - r1 * r2);
    // The element in the middle: light that comes in at the rim stays there.
    let middle = |z: f32| {
        let list = r.elements().list();
        let near = |e: &u32| {
            let c = list[*e as usize].centre;
            c.distance(Vec3::new(0.0, 0.0, z)) + 1e6 * f32::from(u8::from((c.z - z).abs() > 0.1))
        };
        (0..list.len() as u32).min_by(|a, b| near(a).total_cmp(&near(b))).unwrap()
    };
    let leaving = |z: f32, side: Side| {
        f64::from(r.element(middle(z), side, Quantity::Leaving)[0]) / std::f64::consts::PI
    };
    for (found, exact) in [
        (leaving(1.0, Side::Adaxial), r1 + t1 * up),
        (leaving(0.0, Side::Adaxial), up),
        (leaving(1.0, Side::Abaxial), t1 + r1 * up),
    ] {
        assert!((found / exact - 1.0).abs() < 5e-3, "{found} {exact}");
    }
}

/// A small scene with everything: sheets, a ball, sun, sky, a lamp.
fn still_life() -> Scene {
    scene(
        r#"
        [materials.sheet]
        type = "diffuse"
        reflectance_adaxial = 0.4
        reflectance_abaxial = 0.2
        transmittance = 0.35
        [shapes.floor]
        type = "quad"
        width_mm = 60
        height_mm = 60
        material = "grey"
        [shapes.ball]
        type = "sphere"
        radius_mm = 6
        position_mm = [6, 0, 7]
        material = "sheet"
        [shapes.roof]
        type = "quad"
        width_mm = 25
        height_mm = 30
        position_mm = [-3, 0, 16]
        rotation_deg = [10, 25, 0]
        material = "sheet"
        [lights.sun]
        type = "distant"
        direction = [0.5, 0.2, 1]
        irradiance = 3
        [lights.lamp]
        type = "area"
        position_mm = [-40, 10, 20]
        target_mm = [0, 0, 5]
        width_mm = 15
        radiance = 6
        [lights.spark]
        type = "point"
        position_mm = [10, -30, 30]
        intensity = 900
        "#,
    )
}

#[test]
fn power_arrives_or_escapes() {
    let s = still_life();
    let r = solved(&s, &RadiositySettings { light_rays: 1 << 20, ..settings(2000, 4, 128) });
    let ledger = r.ledger();
    for k in 0..3 {
        // All that arrives was emitted and did not escape.
        let arrived = r.arrived(k);
        let left = ledger.emitted[k] - ledger.escaped_directly[k];
        assert!((arrived / left - 1.0).abs() < 2e-3, "{arrived} {left} of {}", ledger.emitted[k]);
    }
}

#[test]
fn ledger_closes() {
    let s = still_life();
    let r = solved(&s, &RadiositySettings { light_rays: 1 << 20, ..settings(3000, 64, 64) });
    let ledger = r.ledger();
    for (k, error) in ledger.error().iter().enumerate() {
        assert!(error.abs() < 3e-4 * ledger.emitted[k], "{error} of {}", ledger.emitted[k]);
    }
    // What arrives at the nodes is absorbed, escapes or is under way, to rounding.
    for k in 0..3 {
        let arrived = r.arrived(k);
        let gone = ledger.absorbed_total()[k] + ledger.escaped[k] + ledger.under_way[k];
        assert!((arrived / gone - 1.0).abs() < 1e-5, "{arrived} {gone}");
    }
}

#[test]
fn same_bytes_at_any_thread_count() {
    let s = still_life();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let r = pool.install(|| solved(&s, &settings(500, 16, 8)));
        (0..r.elements().len() as u32)
            .flat_map(|e| r.element(e, Side::Adaxial, Quantity::Leaving))
            .map(f32::to_bits)
            .collect::<Vec<u32>>()
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn too_much_memory_is_refused_beforehand() {
    let s = still_life();
    let settings = RadiositySettings { memory_bytes: 1 << 20, ..RadiositySettings::default() };
    let e = super::solve(&s, &[550.0], &settings, &mut Vec::new(), &NoProgress).unwrap_err().to_string();
    assert!(e.starts_with("memory: ") && e.contains("elements would fit"), "{e}");
    let settings = RadiositySettings { memory_bytes: 10, ..settings };
    let e = super::solve(&s, &[550.0], &settings, &mut Vec::new(), &NoProgress).unwrap_err().to_string();
    assert!(e.contains("whatever the elements are"), "{e}");
}

#[test]
fn an_early_end_is_told() {
    let s = still_life();
    let r = solved(&s, &RadiositySettings { max_orders: 2, ..settings(300, 16, 8) });
    assert!(!r.converged() && r.orders() == 2 && r.residual() > 1e-3, "{} {}", r.orders(), r.residual());
    assert!(r.ledger().under_way.iter().all(|u| *u > 0.0));
}

#[test]
fn false_triangles_warn_and_change_nothing() {
    let clean = still_life();
    let mut s = still_life();
    let ball = s.shapes.iter().position(|s| s.key.ends_with("ball")).unwrap();
    let mesh = &mut s.shapes[ball].mesh;
    let [a, b, c] = mesh.triangles[7];
    mesh.triangles.extend([[a, b, c], [c, b, a], [a, a, b]]);
    s.bvh = crate::geometry::Bvh::build(s.shapes.iter().map(|s| &s.mesh));
    let mut warnings = Vec::new();
    let run = |s: &Scene, w: &mut Vec<String>| {
        super::solve(s, &[550.0], &settings(800, 64, 32), w, &NoProgress).unwrap()
    };
    let damaged = run(&s, &mut warnings);
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    let whole = run(&clean, &mut Vec::new());
    let sum = |r: &Radiosity| r.ledger().absorbed_total()[0];
    assert!((sum(&damaged) / sum(&whole) - 1.0).abs() < 1e-3, "{} {}", sum(&damaged), sum(&whole));
}

#[test]
fn elements_follow_a_shadow() {
    // A small roof over a floor under a narrow sun: elements at the shadow's edge are smaller than far from it.
    let s = compiled(
        r#"
        [materials.grey]
        type = "lambert"
        reflectance = 0.5
        [shapes.floor]
        type = "quad"
        width_mm = 100
        height_mm = 100
        material = "grey"
        [shapes.roof]
        type = "quad"
        width_mm = 30
        height_mm = 30
        position_mm = [0, 0, 10]
        material = "grey"
        [lights.sun]
        type = "distant"
        elevation_deg = 90
        irradiance = 1
        "#,
    );
    let r = solved(&s, &settings(1000, 4, 16));
    let (mut near, mut far) = ((0.0, 0), (0.0, 0));
    for e in r.elements().list().iter().filter(|e| s.shapes[e.shape as usize].key.contains("floor")) {
        let c = e.centre.abs();
        let edge = (c.x.max(c.y) - 15.0).abs();
        let sum = if edge < 2.0 { &mut near } else { &mut far };
        *sum = (sum.0 + e.area_mm2, sum.1 + 1);
    }
    let (near, far) = (near.0 / near.1 as f32, far.0 / far.1 as f32);
    assert!(near < 0.7 * far, "{near} {far}");
}

/// What a wide floor's few rays miss of a small shell is the floor's own noise: the shell gets what its rays bring.
#[test]
fn a_wide_floor_does_not_dim_what_stands_on_it() {
    let s = compiled(
        r#"
        [materials.sheet]
        type = "diffuse"
        reflectance_adaxial = 0.45
        transmittance = 0.45
        [materials.grey]
        type = "lambert"
        reflectance = 0.6
        [shapes.shell]
        type = "sphere"
        radius_mm = 10
        subdivisions = 3
        material = "sheet"
        [shapes.floor]
        type = "quad"
        width_mm = 4000
        height_mm = 4000
        position_mm = [0, 0, -30]
        material = "grey"
        [lights.sun]
        type = "distant"
        elevation_deg = 50
        irradiance = 4
        "#,
    );
    for seed in 0..3 {
        let r = solved(&s, &RadiositySettings { seed, ..settings(2000, 192, 64) });
        let (mut found, mut brought) = (0.0f64, 0.0f64);
        for (k, e) in r.elements().list().iter().enumerate() {
            if !s.shapes[e.shape as usize].key.contains("shell") {
                continue;
            }
            for number in 0..2 {
                let n = 2 * k + number as usize;
                found += f64::from(r.indirect[n][1] * e.area_mm2);
                const RAYS: u32 = 256;
                for i in 0..RAYS {
                    let mut u = Sampler::new(77, glam::UVec2::new(n as u32, 3), i);
                    let u_facet = u.next_1d();
                    let start = r.elements().sample(&s, k as u32, u_facet, u.next_2d());
                    let Some(hit) = s.intersect(&start.ray(number, u.next_2d())) else { continue };
                    let seen = if hit.ng.dot(hit.p - start.p) < 0.0 { Side::Adaxial } else { Side::Abaxial };
                    let from = r.elements().hit(&hit).unwrap();
                    let light = r.at(from, seen, hit.p, Quantity::Leaving)[1];
                    brought += f64::from(light * e.area_mm2) / f64::from(RAYS);
                }
            }
        }
        assert!((found / brought - 1.0).abs() < 0.025, "{seed}: {found} {brought}");
    }
}

//! One pattern of pigment for every way of carrying light: the elements of radiosity and the surfaces of paths.

mod support;

use glam::Vec2;
use rosarium::geometry::Side;
use rosarium::io::petal_optics;
use rosarium::scene::{MemoryAssets, Scene};
use rosarium::transport::radiosity::{Quantity, RadiositySettings, solve};
use rosarium::transport::{NoProgress, render};
use rosarium::validate::sheet;

/// A wild rose in white surroundings whose outer petals have more pigment on their upper sides.
fn rose(pattern: &str, overrides: &[&str]) -> Scene {
    let mut assets = MemoryAssets::default();
    assets.files.insert("sheet.optics".into(), petal_optics::write(&sheet(8, 6)).unwrap());
    support::scene_with(
        &format!(
            r#"
        [film]
        width = 12
        height = 12
        [camera]
        position_mm = [0, -120, 160]
        target_mm = [0, 0, 8]
        fov_deg = 14
        [render]
        spp = 16
        denoise = false
        [render.radiosity]
        elements = 1500
        wavelengths = 8
        [petal]
        optics = "sheet.optics"
        [petal.pattern]
        {pattern}
        [petal.tissue.adaxial]
        pigments = {{ anthocyanin_ug_per_cm2 = 20.0 }}
        [petal.tissue.abaxial]
        pigments = {{ anthocyanin_ug_per_cm2 = 20.0 }}
        [materials.petal]
        type = "petal"
        [shapes.rose]
        type = "rose"
        preset = "wild"
        rose = {{ detail = 0.5, stem = {{ length_mm = 30 }} }}
        [lights.sky]
        type = "constant"
        radiance = 1
        spectrum = {{ illuminant = "E" }}
        "#
        ),
        overrides,
        &assets,
    )
}

#[test]
fn radiosity_sees_the_pigment_of_every_petal() {
    let scene = rose("age = { inner = 0, outer = 3 }\nveins = { adaxial = 1, abaxial = 0 }", &[]);
    let settings = RadiositySettings { elements: 2000, rays: 16, ..RadiositySettings::default() };
    let solution = solve(&scene, &[545.0, 690.0], &settings, &mut Vec::new(), &NoProgress).unwrap();
    let elements = solution.elements().list();
    let mut kept = Vec::new();
    for (i, shape) in scene.shapes.iter().enumerate().filter(|(_, s)| s.petal_id > 0) {
        // The mean pigment of its elements is that of its triangles.
        let (mut area, mut factor) = (0.0f64, 0.0f64);
        for (face, t) in shape.mesh.triangles.iter().enumerate() {
            let uv: Vec2 = t.iter().map(|v| shape.mesh.uvs[*v as usize]).sum::<Vec2>() / 3.0;
            let a = f64::from(shape.mesh.face_area(face));
            area += a;
            factor += a * f64::from(scene.tissue(i as u32, uv).pigment.adaxial);
        }
        let of_petal = || elements.iter().zip(0u32..).filter(|(e, _)| e.shape as usize == i);
        let of_elements: f64 =
            of_petal().map(|(e, _)| f64::from(e.area_mm2) * f64::from(e.tissue.pigment.adaxial)).sum();
        assert!((of_elements / factor - 1.0).abs() < 0.02, "{i}: {} {}", of_elements / area, factor / area);
        // Green light is absorbed as the pigment says, red light hardly.
        let shares = [0, 1].map(|band| {
            let sum = |q: Quantity| -> f64 {
                of_petal()
                    .map(|(e, k)| {
                        f64::from(e.area_mm2) * f64::from(solution.element(k, Side::Adaxial, q)[band])
                    })
                    .sum()
            };
            sum(Quantity::Absorbed) / sum(Quantity::Incident)
        });
        kept.push((factor / area, shares[0] - shares[1]));
    }
    assert_eq!(kept.len(), 5);
    assert!(kept.is_sorted_by(|a, b| a.0 < b.0 && a.1 < b.1), "{kept:?}");
    assert!(kept[4].1 > 1.2 * kept[0].1, "{kept:?}");
}

#[test]
fn paths_and_hybrid_see_the_same_pattern() {
    let of = |pattern: &str, integrator: &str| {
        let scene = rose(pattern, &[&format!("render.integrator={integrator}")]);
        let integrator = support::integrator(&scene);
        let done = render(&scene, integrator.as_ref(), &support::whole(&scene), &NoProgress).unwrap();
        let pixels = done.film.beauty();
        [0, 1, 2].map(|c| pixels.iter().map(|rgb| f64::from(rgb[c])).sum::<f64>())
    };
    let dark = "age = { inner = 4, outer = 12 }\nmargin = { factor = 3 }";
    let (path, hybrid, plain) = (of(dark, "path"), of(dark, "hybrid"), of("", "path"));
    for c in 0..3 {
        assert!((hybrid[c] / path[c] - 1.0).abs() < 0.04, "{c}: {hybrid:?} {path:?}");
    }
    assert!(path[1] < 0.95 * plain[1], "{path:?} {plain:?}");
}

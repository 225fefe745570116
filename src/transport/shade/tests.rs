use glam::{UVec2, Vec3};

use super::*;
use crate::geometry::Ray;
use crate::math::stats::Welford;
use crate::math::warp::{SPHERE_PDF, square_to_cosine_hemisphere, square_to_sphere};
use crate::scene::{MemoryAssets, SceneDescription, compile, load};
use crate::validate::sheet;

const KINDS: [(&str, &str); 6] = [
    ("lambert", "type = \"lambert\"\nreflectance = 0.6"),
    (
        "diffuse",
        "type = \"diffuse\"\nreflectance_adaxial = 0.4\nreflectance_abaxial = 0.3\ntransmittance = 0.35",
    ),
    ("phong", "type = \"phong\"\ndiffuse = 0.3\nspecular = 0.5\nexponent = 9"),
    ("literal", "type = \"literal_phong\"\ndiffuse = 0.3\nspecular = 0.4\nexponent = 9"),
    ("cells", "type = \"petal\""),
    ("tables", "type = \"petal\""),
];

/// A sheet of each kind, seen from above and from below.
fn each_kind(test: impl Fn(&str, &Shading, &SampledWavelengths)) {
    let lambda = SampledWavelengths::visible(0.4);
    for (kind, material) in KINDS {
        let petal = match kind {
            "tables" => "[petal]\noptics = \"sheet.optics\"",
            _ => "[petal.shading.transmission]\ndirect = 0.06\nindirect = 0.03\ndirect_exponent = 5",
        };
        let text = format!(
            "{petal}\n[materials.m]\n{material}\n[shapes.a]\ntype = \"quad\"\nwidth_mm = 100\nheight_mm = 100\nmaterial = \"m\"\n\
             [lights.sky]\ntype = \"constant\"\nradiance = 1"
        );
        let mut assets = MemoryAssets::default();
        assets.files.insert("sheet.optics".into(), crate::io::petal_optics::write(&sheet(12, 6)).unwrap());
        let description: SceneDescription =
            load(&text, "test", &[]).unwrap_or_else(|e| panic!("{e}")).description;
        let scene = compile(&description, &assets).unwrap_or_else(|e| panic!("{e}"));
        for eye in [Vec3::new(30.0, 8.0, 40.0), Vec3::new(-20.0, 10.0, -30.0)] {
            let ray = Ray::new(eye, (Vec3::new(2.0, 3.0, 0.0) - eye).normalize());
            let at = scene.intersect(&ray).unwrap();
            let shading = Shading::new(&scene, at, -ray.direction, &lambda, None, 1.into());
            test(&format!("{kind} from z = {}", eye.z), &shading, &lambda);
        }
    }
}

#[test]
fn diffuse_and_rest_are_the_petal() {
    each_kind(|what, shading, lambda| {
        let mut lit = 0;
        for i in 0..400 {
            let mut sampler = Sampler::new(4, UVec2::new(9, 9), i);
            let wi = square_to_sphere(sampler.next_2d());
            let (whole, _) = shading.eval(wi, lambda, &mut sampler.clone());
            let (rest, _) = shading.eval_rest(wi, lambda, &mut sampler);
            let sum = rest + shading.eval_diffuse(wi, lambda);
            for lane in 0..8 {
                let d = (sum[lane] - whole[lane]).abs();
                assert!(d <= 1e-5 * whole[lane] + 1e-7, "{what}, {wi}: {} {}", sum[lane], whole[lane]);
            }
            lit += u32::from(!whole.is_zero());
        }
        assert!(lit > 150, "{what}: only {lit} directions are lit");
    });
}

/// Functions of a direction, to be integrated: each side's total, and two that tell directions apart.
fn integrands(w: Vec3) -> [f64; 4] {
    let toward = f64::from(w.dot(Vec3::new(0.6, 0.0, 0.8)).max(0.0)).powi(2);
    let up = if w.z > 0.0 { 1.0 } else { 0.0 };
    [up, 1.0 - up, toward, f64::from(w.x * w.z + w.y).powi(2)]
}

#[test]
fn rest_is_drawn_as_it_is_estimated() {
    each_kind(|what, shading, lambda| {
        let mut whole = [Welford::default(); 4];
        let mut split = [Welford::default(); 4];
        let mut density = [Welford::default(); 4];
        let mut drawn = [Welford::default(); 4];
        let mean = |f: SampledSpectrum| f64::from(f.mean());
        let wo_up = shading.side() == Side::Adaxial;
        let [reflected, transmitted] = shading.diffuse(lambda).map(mean);
        for i in 0..30_000 {
            let mut sampler = Sampler::new(4, UVec2::new(1, 2), i);
            let mut terms = [0.0; 4];
            if let Some(next) = shading.sample(lambda, &mut sampler) {
                terms = integrands(next.direction).map(|g| g * mean(next.weight));
            }
            whole.iter_mut().zip(terms).for_each(|(w, t)| w.push(t));
            // D in closed form: shares of cosine-weighted directions above and below.
            let w = square_to_cosine_hemisphere(sampler.next_2d());
            let (up, down) = if wo_up { (reflected, transmitted) } else { (transmitted, reflected) };
            let (above, below) = (integrands(w), integrands(Vec3::new(w.x, w.y, -w.z)));
            let mut terms: [f64; 4] = std::array::from_fn(|k| up * above[k] + down * below[k]);
            let mut found = [0.0; 4];
            if let Some(next) = shading.sample_rest(lambda, &mut sampler) {
                let g = integrands(next.direction);
                terms.iter_mut().zip(g).for_each(|(t, g)| *t += g * mean(next.weight));
                found = g;
            }
            split.iter_mut().zip(terms).for_each(|(w, t)| w.push(t));
            drawn.iter_mut().zip(found).for_each(|(w, t)| w.push(t));
            let wi = square_to_sphere(sampler.next_2d());
            if let (_, Some(pdf)) = shading.eval_rest(wi, lambda, &mut sampler) {
                let g = integrands(wi).map(|g| g * f64::from(pdf / SPHERE_PDF));
                density.iter_mut().zip(g).for_each(|(w, t)| w.push(t));
            }
        }
        let same = |name: &str, a: &Welford, b: &Welford| {
            let error = a.standard_error().hypot(b.standard_error());
            let d = a.mean() - b.mean();
            assert!(d.abs() < 3.7 * error + 1e-6, "{what}, {name}: {} {} +- {error}", a.mean(), b.mean());
        };
        for k in 0..4 {
            same(&format!("integral {k} of f and of D + S"), &whole[k], &split[k]);
            if !shading.is_walk() {
                same(&format!("integral {k} of the density"), &density[k], &drawn[k]);
            }
        }
    });
}

use glam::Vec2;

use super::*;
use crate::bsdf::{Bsdf, LiteralPhong, Phong, Scatter};
use crate::math::quadrature::sphere_rule;
use crate::scene::{MemoryAssets, SceneDescription, compile, load};
use crate::validate::sheet;

fn up(cos: f32, side: Side) -> Vec3 {
    let z = if side == Side::Adaxial { cos } else { -cos };
    Vec3::new((1.0 - cos * cos).sqrt(), 0.0, z)
}

fn chunk(u: f32) -> SampledWavelengths {
    SampledWavelengths::given(*SampledWavelengths::visible(u).lambda_nm())
}

fn compiled(text: &str) -> Scene {
    let mut assets = MemoryAssets::default();
    assets.files.insert("sheet.optics".into(), crate::io::petal_optics::write(&sheet(12, 6)).unwrap());
    let shape = "[lights.sky]\ntype = \"constant\"\nradiance = 1\n[shapes.a]\ntype = \"quad\"\nwidth_mm = 1\nheight_mm = 1\nmaterial = \"m\"\n";
    let description: SceneDescription = load(&format!("{text}\n{shape}"), "test", &[]).unwrap().description;
    compile(&description, &assets).unwrap()
}

#[test]
fn totals_are_the_integrals() {
    let lambda = [chunk(0.1), chunk(0.7)];
    let rule = sphere_rule(200, 200);
    let scene = compiled(
        "[materials.m]\ntype = \"phong\"\ndiffuse = [0.2, 0.1, 0.05]\nspecular = 0.4\nexponent = 12\n\
         [materials.d]\ntype = \"diffuse\"\nreflectance_adaxial = [0.4, 0.3, 0.2]\nreflectance_abaxial = 0.2\ntransmittance = 0.3\n\
         [shapes.b]\ntype = \"quad\"\nwidth_mm = 1\nheight_mm = 1\nmaterial = \"d\"",
    );
    let totals = MaterialTotals::of_scene(&scene, &lambda).unwrap();
    for (material, totals) in scene.materials.iter().zip(&totals) {
        let bsdf: &dyn Bsdf = match material {
            Material::Phong(m) => m,
            Material::Diffuse(m) => m,
            other => panic!("{other:?}"),
        };
        for side in [Side::Adaxial, Side::Abaxial] {
            for cos in [0.97, 0.6, 0.33, 0.09] {
                let wi = up(cos, side);
                let mut sums = [SampledSpectrum::ZERO; 2];
                for &(wo, sr) in &rule {
                    sums[usize::from(wo.z * wi.z < 0.0)] +=
                        bsdf.eval(wo, wi, &lambda[1]) * (wo.z.abs() * sr as f32);
                }
                let (r, t) = totals.at(TissueState::SOUND, cos, side, 1);
                for lane in 0..LANES {
                    let (dr, dt) = (r[lane] - sums[0][lane], t[lane] - sums[1][lane]);
                    assert!(dr.abs() < 1e-3 && dt.abs() < 5e-5, "{cos} {side:?}: {dr} {dt}");
                }
            }
            // The mean is that of the integrals.
            let steps = 500;
            let mut sum = 0.0;
            for i in 0..steps {
                let cos = (i as f32 + 0.5) / steps as f32;
                sum += 2.0 * cos / steps as f32 * totals.at(TissueState::SOUND, cos, side, 0).0[2];
            }
            let (r, _) = totals.mean(TissueState::SOUND, side, 0);
            assert!((r[2] - sum).abs() < 1e-4, "{} {sum}", r[2]);
        }
    }
    // The textbook's lobe: what a viewer gets from white surroundings.
    let literal = LiteralPhong::new(0.3.into(), 0.4.into(), 10.0).unwrap();
    let totals = MaterialTotals::new("m", &Material::LiteralPhong(literal.clone()), &lambda).unwrap();
    for cos in [1.0, 0.5] {
        let wo = up(cos, Side::Adaxial);
        let seen: f32 =
            rule.iter().map(|&(wi, sr)| literal.eval(wo, wi, &lambda[0])[0] * wi.z.abs() * sr as f32).sum();
        let (r, t) = totals.at(TissueState::SOUND, cos, Side::Adaxial, 0);
        assert!((r[0] - seen).abs() < 2e-3 && t.is_zero(), "{} {seen}", r[0]);
    }
}

#[test]
fn totals_of_cells_are_what_they_scatter() {
    let lambda = [chunk(0.2)];
    let scene = compiled("[materials.m]\ntype = \"petal\"");
    let totals = &MaterialTotals::of_scene(&scene, &lambda).unwrap()[0];
    let Material::Petal(petal) = &scene.materials[0] else { panic!("a petal was given") };
    let Petal::Cells(cells) = &**petal else { panic!("cells were given") };
    assert!(totals.standard_error() > 0.0 && totals.standard_error() < 4e-3, "{}", totals.standard_error());
    for side in [Side::Adaxial, Side::Abaxial] {
        for cos in [0.98, 0.66, 0.34, 0.16] {
            let mut stats = vec![crate::math::stats::Welford::default(); 2 * LANES];
            for i in 0..20_000 {
                let mut sampler = Sampler::new(77, UVec2::new(3, 1), i);
                let turn = std::f32::consts::TAU * sampler.next_1d();
                let wi = up(cos, side);
                let wi = Vec3::new(wi.x * turn.cos(), wi.x * turn.sin(), wi.z);
                let out = cells.scatter(wi, &lambda[0], &mut sampler);
                for lane in 0..LANES {
                    let share = |way: bool| match out {
                        Some((wo, weight)) if (wo.z * wi.z > 0.0) == way => f64::from(weight[lane]),
                        _ => 0.0,
                    };
                    stats[lane].push(share(true));
                    stats[LANES + lane].push(share(false));
                }
            }
            let (r, t) = totals.at(TissueState::SOUND, cos, side, 0);
            for lane in 0..LANES {
                for (found, s) in [(r, &stats[lane]), (t, &stats[LANES + lane])] {
                    let error = 3.5 * s.standard_error().hypot(f64::from(totals.standard_error())) + 1e-3;
                    let d = f64::from(found[lane]) - s.mean();
                    assert!(
                        d.abs() < error,
                        "{side:?} {cos} lane {lane}: {} {} +- {error}",
                        found[lane],
                        s.mean()
                    );
                }
            }
        }
    }
}

#[test]
fn totals_follow_the_pigment() {
    let lambda = [chunk(0.4)];
    let scene = compiled(
        "[petal]\noptics = \"sheet.optics\"\ngradient = { claw = 0.1, rim = 4.0 }\n[materials.m]\ntype = \"petal\"",
    );
    let totals = &MaterialTotals::of_scene(&scene, &lambda).unwrap()[0];
    let Material::Petal(petal) = &scene.materials[0] else { panic!("a petal was given") };
    let Petal::Tabulated(petal) = &**petal else { panic!("tables were given") };
    let mut range = (f32::INFINITY, 0.0f32);
    for v in [0.0, 0.13, 0.4, 0.55, 0.8, 1.0] {
        let state = petal.state(Vec2::new(0.5, v), None);
        for side in [Side::Adaxial, Side::Abaxial] {
            for cos in [0.95, 0.5, 0.2] {
                let [r, t] = petal.albedo(up(cos, side), state, &lambda[0]);
                let found = totals.at(state, cos, side, 0);
                for lane in 0..LANES {
                    assert!(
                        (found.0[lane] / r[lane] - 1.0).abs() < 0.01,
                        "{v}: {} {}",
                        found.0[lane],
                        r[lane]
                    );
                    assert!(
                        (found.1[lane] / t[lane] - 1.0).abs() < 0.01,
                        "{v}: {} {}",
                        found.1[lane],
                        t[lane]
                    );
                }
                range = (range.0.min(r[3]), range.1.max(r[3]));
            }
        }
    }
    assert!(range.1 > 1.5 * range.0, "the pigment changes nothing: {range:?}");
}

#[test]
fn totals_follow_both_sides() {
    let lambda = [chunk(0.4)];
    let scene = compiled(
        "[petal]\noptics = \"sheet.optics\"\npattern = { adaxial = { claw = 0.2, rim = 3.0 }, abaxial = { rim = 0.0 } }\n\
         [petal.tissue.adaxial]\npigments = { anthocyanin_ug_per_cm2 = 20.0 }\n\
         [petal.tissue.abaxial]\npigments = { anthocyanin_ug_per_cm2 = 20.0 }\n[materials.m]\ntype = \"petal\"",
    );
    let totals = &MaterialTotals::of_scene(&scene, &lambda).unwrap()[0];
    let Material::Petal(petal) = &scene.materials[0] else { panic!("a petal was given") };
    let Petal::Tabulated(petal) = &**petal else { panic!("tables were given") };
    for v in [0.0, 0.2, 0.4, 0.55, 0.8, 1.0] {
        let state = scene.tissue(0, Vec2::new(0.5, v));
        for side in [Side::Adaxial, Side::Abaxial] {
            for cos in [0.95, 0.5, 0.2] {
                let [r, t] = petal.albedo(up(cos, side), state, &lambda[0]);
                let found = totals.at(state, cos, side, 0);
                for lane in 0..LANES {
                    let (of_r, of_t) = (found.0[lane] / r[lane] - 1.0, found.1[lane] / t[lane] - 1.0);
                    assert!(of_r.abs() < 0.02 && of_t.abs() < 0.02, "{v} {side:?} {cos}: {of_r} {of_t}");
                }
            }
        }
    }
    // At the rim the upper side is full of pigment, the lower one has none.
    let rim = scene.tissue(0, Vec2::new(0.5, 1.0)).pigment;
    assert_eq!((rim.adaxial, rim.abaxial), (3.0, 0.0));
}

#[test]
fn totals_follow_the_tissues_of_a_place() {
    let lambda = [chunk(0.4)];
    let scene = compiled(
        "[petal]\nwalks = 10000\npattern = { thickness = { margin = 0.5 }, withered = {}, adaxial = { claw = 0.5 } }\n\
         [petal.tissue.adaxial]\npigments = { anthocyanin_ug_per_cm2 = 20.0 }\n\
         [petal.tissue.spongy]\nthickness_um = 100.0\nscattering_per_mm = 100.0\nanisotropy = 0.5\n[materials.m]\ntype = \"petal\"",
    );
    let totals = &MaterialTotals::of_scene(&scene, &lambda).unwrap()[0];
    let Material::Petal(petal) = &scene.materials[0] else { panic!("a petal was given") };
    let Petal::Tabulated(petal) = &**petal else { panic!("tables were given") };
    for (thin, withered) in [(0.0, 0.0), (1.0, 0.0), (0.3, 0.4), (0.8, 1.0)] {
        let state = TissueState { thin, withered, ..petal.state(Vec2::new(0.5, 0.2), None) };
        for side in [Side::Adaxial, Side::Abaxial] {
            // Cosines of the tables: those of few walks are rough between them.
            for cos in [30.0 / 32.0, 12.0 / 32.0] {
                let [r, t] = petal.albedo(up(cos, side), state, &lambda[0]);
                let found = totals.at(state, cos, side, 0);
                for lane in 0..LANES {
                    for (found, wanted) in [(found.0[lane], r[lane]), (found.1[lane], t[lane])] {
                        let error = (found - wanted).abs();
                        assert!(error < 0.02 * wanted, "{state:?} {side:?} {cos}: {found} {wanted}");
                    }
                }
            }
        }
    }
}

#[test]
fn more_light_than_arrives_is_an_error() {
    // A broad lobe of the textbook's Phong: 2 pi / (n + 1) of ks.
    let scene = compiled(
        "[materials.m]\ntype = \"literal_phong\"\ndiffuse = 0.5\nspecular = 0.9\nexponent = 2\n\
         [materials.unused]\ntype = \"literal_phong\"\ndiffuse = 0.5\nspecular = 0.9\nexponent = 1",
    );
    let e = MaterialTotals::of_scene(&scene, &[chunk(0.3)]).unwrap_err().to_string();
    assert!(e.starts_with("materials.m: ") && e.contains(" nm "), "{e}");
    let white = Phong::new(0.5.into(), 0.5.into(), 4.0).unwrap();
    assert!(MaterialTotals::new("white", &Material::Phong(white), &[chunk(0.3)]).is_ok());
}

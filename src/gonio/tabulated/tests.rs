use super::*;
use crate::gonio::petal_optics::{AngleGrid, AngularTable};
use crate::gonio::{Directional, WhiteMonteCarlo};
use crate::math::Sampler;
use crate::math::quadrature::sphere_rule;
use crate::math::warp::square_to_sphere;
use crate::validate::sheet;

fn coloured() -> TabulatedBsdf {
    let bump = |nm: f64| Spectrum::from_fn(move |l| 0.05 * (-((l - nm) / 40.0).powi(2)).exp());
    TabulatedBsdf::new(&sheet(18, 9), [bump(540.0), 0.0.into(), bump(450.0), bump(520.0)]).expect("valid")
}

fn directions(n: u32) -> impl Iterator<Item = (Vec3, Vec3)> {
    (0..n).map(|k| {
        let mut s = Sampler::new(3, glam::UVec2::new(k, 1), 0);
        (square_to_sphere(s.next_2d()), square_to_sphere(s.next_2d()))
    })
}

#[test]
fn reciprocal_to_the_last_bit() {
    let bsdf = coloured();
    let lambda = SampledWavelengths::visible(0.4);
    for (a, b) in directions(20_000) {
        assert_eq!(bsdf.eval(a, b, &lambda), bsdf.eval(b, a, &lambda), "{a} {b}");
    }
}

#[test]
fn nodes_are_the_table() {
    let (optics, bsdf) = (sheet(18, 9), coloured());
    let lambda = SampledWavelengths::given([700.0; LANES]);
    let up = |theta_deg: f64, phi_deg: f64| {
        crate::math::frame::spherical(theta_deg.to_radians() as f32, phi_deg.to_radians() as f32)
    };
    // 45 deg and 75 deg are nodes of 9 bins, half way between nodes of 18; 70 deg of azimuth is a node of 9 bins.
    let (wo, wi) = (up(45.0, 10.0), up(75.0, 80.0));
    let s = |a: usize, b: usize, p: usize| f64::from(optics.surface.bin(Part::Adaxial, a, b, p)[0]);
    let corners = [(8, 14), (8, 15), (9, 14), (9, 15)];
    let surface: f64 = corners.iter().map(|&(a, b)| (s(a, b, 6) + s(a, b, 7)) / 8.0).sum();
    let interior: f64 = optics.interior.bin(Part::Adaxial, 4, 7, 3).iter().map(|v| f64::from(*v)).sum();
    let found = f64::from(bsdf.eval(wo, wi, &lambda)[0]);
    assert!((found / (surface + interior) - 1.0).abs() < 1e-5, "{found} {surface} {interior}");
}

#[test]
fn albedo_is_the_integral() {
    let bsdf = coloured();
    let lambda = SampledWavelengths::visible(0.7);
    let at = bsdf.at([1.3, 1.0, 0.5, 2.0], &lambda);
    let rule = sphere_rule(128, 256);
    for wo in [Vec3::Z, -Vec3::Z, Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.3, 0.9, -0.2).normalize()] {
        let mut sums = [SampledSpectrum::ZERO; 2];
        for &(wi, sr) in &rule {
            sums[usize::from(!same_side(wo, wi))] += at.eval(wo, wi, &lambda) * (wi.z.abs() * sr as f32);
        }
        for (sum, albedo) in sums.iter().zip(at.albedo(wo)) {
            for lane in 0..LANES {
                assert!(
                    (sum[lane] / albedo[lane] - 1.0).abs() < 2e-3,
                    "{wo}: {} {}",
                    sum[lane],
                    albedo[lane]
                );
            }
        }
    }
}

#[test]
fn pigment_scales_are_beer_lambert() {
    let bsdf = coloured();
    let nm = [400.0, 450.0, 500.0, 520.0, 540.0, 560.0, 600.0, 700.0];
    let lambda = SampledWavelengths::given(nm);
    let scale = [0.3, 5.0, 2.0, 0.0];
    for (lane, &nm) in nm.iter().enumerate() {
        // Colour the table itself, and leave the pigment out.
        let mu = |centre: f32| 0.05 * (-((nm - centre) / 40.0).powi(2)).exp();
        let mut optics = sheet(18, 9);
        let left = optics.remaining(&[0.3 * mu(540.0), 0.0, 2.0 * mu(450.0), 0.0].map(f64::from));
        for values in optics.interior.values.chunks_exact_mut(3) {
            values.iter_mut().zip(&left).for_each(|(v, left)| *v *= *left as f32);
        }
        let plain = TabulatedBsdf::new(&optics, std::array::from_fn(|_| 0.0.into())).expect("valid");
        for (wo, wi) in directions(200) {
            let found = bsdf.at(scale, &lambda).eval(wo, wi, &lambda)[lane];
            let wanted = plain.eval(wo, wi, &lambda)[lane];
            assert!((found / wanted - 1.0).abs() < 1e-4, "{nm}: {found} {wanted}");
        }
    }
}

#[test]
fn samples_are_the_mixture() {
    // The weight of a sample is the albedo but for its colour: its mean over the wavelengths has no variance at all.
    let bsdf = coloured();
    let lambda = SampledWavelengths::visible(0.2);
    let mut lobes = [0; 3];
    for (k, (wo, _)) in directions(5000).enumerate() {
        let mut s = Sampler::new(9, glam::UVec2::new(k as u32, 0), 0);
        let Some(sample) = bsdf.sample(wo, &lambda, s.next_1d(), s.next_2d()) else { panic!("{wo}: none") };
        let [r, t] = bsdf.at([1.0; REGIONS], &lambda).albedo(wo);
        let wanted = (r + t).mean();
        assert!((sample.weight().mean() / wanted - 1.0).abs() < 1e-4, "{} {wanted}", sample.weight().mean());
        assert_eq!(same_side(wo, sample.wi), sample.lobe != Lobe::DiffuseTransmission);
        lobes[match sample.lobe {
            Lobe::DiffuseReflection => 0,
            Lobe::GlossyReflection => 1,
            Lobe::DiffuseTransmission => 2,
        }] += 1;
    }
    assert!(lobes.iter().all(|n| *n > 200), "{lobes:?}");
}

#[test]
fn bands_agree_with_the_bsdf() {
    let optics = sheet(18, 9);
    let (cells, tissue) = measured_tissue(&optics.description).expect("a tissue");
    let tissue = crate::micro::Tissue::new(&tissue, &cells, "tissue").expect("valid");
    let bsdf = TabulatedBsdf::of_tissue(&optics, &tissue).expect("valid");
    let nm = [420.0, 500.0, 540.0, 700.0];
    let at = OpticsAtBands::new(&optics, &nm).expect("valid");
    assert_eq!(at.bands()[2].wavelength_nm, Some(540.0));
    let lambda = SampledWavelengths::given(std::array::from_fn(|i| nm[i % 4] as f32));
    let mut coloured = 0.0f64;
    for (wo, wi) in directions(500) {
        let mut values = [0.0; 4];
        assert!(at.bsdf(wi.as_dvec3(), wo.as_dvec3(), &mut values));
        let f = bsdf.eval(wo, wi, &lambda);
        for i in 0..4 {
            assert!((f64::from(f[i]) / values[i] - 1.0).abs() < 1e-4, "{} {}", f[i], values[i]);
        }
        coloured = coloured.max(values[3] / values[2]);
    }
    assert!(coloured > 1.5, "{coloured}");
    assert!(OpticsAtBands::new(&optics, &[]).is_err() && OpticsAtBands::new(&optics, &[f64::NAN]).is_err());
}

#[test]
fn memory_is_bounded() {
    let mut optics = sheet(18, 9);
    let classes = WhiteMonteCarlo::default().classes;
    optics.interior = AngularTable::zeros(AngleGrid { thetas: 18, phis: 9 }, classes);
    optics.paths_um = vec![[0.0; REGIONS]; classes];
    optics.spreads_um = optics.paths_um.clone();
    let none = || std::array::from_fn(|_| Spectrum::from(0.0));
    let bytes = TabulatedBsdf::new(&optics, none()).expect("valid").bytes();
    assert!(bytes < 9 << 20, "{bytes}");
    optics.interior = AngularTable::zeros(AngleGrid { thetas: 36, phis: 18 }, classes);
    let e = TabulatedBsdf::new(&optics, none()).expect_err("too large").to_string();
    assert!(e.starts_with("optics: its tables would take"), "{e}");
}

#[test]
fn nonsense_is_named() {
    let none = || std::array::from_fn(|_| Spectrum::from(0.0));
    let fails = |change: &dyn Fn(&mut PetalOptics), start: &str| {
        let mut optics = sheet(4, 3);
        change(&mut optics);
        let e = TabulatedBsdf::new(&optics, none()).expect_err(start).to_string();
        assert!(e.starts_with(start), "{e}");
    };
    fails(&|o| o.surface.values[5] = f32::NAN, "optics: surface");
    fails(&|o| o.interior.values[10] += 0.3, "optics: interior");
    fails(&|o| o.interior.values.iter_mut().for_each(|v| *v *= 3.0), "optics: adaxial");
    fails(&|o| o.paths_um.truncate(2), "optics: classes");
    let many = |o: &mut PetalOptics| {
        o.interior = AngularTable::zeros(o.interior.grid, MAX_CLASSES + 1);
        o.paths_um = vec![[0.0; REGIONS]; MAX_CLASSES + 1];
        o.spreads_um = o.paths_um.clone();
    };
    fails(&many, "optics: interior: classes: 129 is not within 1 to 128");
    let e = TabulatedBsdf::new(&sheet(4, 3), std::array::from_fn(|_| (-0.1).into())).err();
    let e = e.expect("negative").to_string();
    assert!(e.starts_with("absorption: "), "{e}");
    for text in ["", "[cells]\n", "tissue = 3"] {
        assert!(measured_tissue(text).is_err(), "{text}");
    }
}

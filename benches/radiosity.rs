//! Time, memory and error of radiosity on the default rose, by the number of its triangles:
//! `cargo bench --bench radiosity`; `-- 2.7` for one `detail` of the rose only, `-- cost` for time and memory without errors,
//! `-- patches=1260` for errors of that many patches (1/36 of a petal each) instead of 12000.
//!
//! Error: irradiance of patches of both sides of all petals, at 640 nm, where petals are bright, and 540 nm, where they are
//! nearly black. A patch is a compact set of triangles of one petal, found by halving: 64 triangles (43 to 86) where the rose has
//! 8e5, and as large a part of the petals at any number. The truth, of patches drawn at random: points all over
//! the patch, each with a sample of every lamp and a ray that gathers the light of a solution of twice the elements, until its
//! standard error is 0.4 % or its samples are used up; what is left of it is told. At every size the whole error is told by number of
//! patches, by their light and by quarters of the patches from dark to bright, and those of direct and indirect light apart, all as shares
//! of the whole light.

#![expect(clippy::print_stdout, reason = "a bench tells what it measures")]

use std::f32::consts::PI;
use std::time::Instant;

use glam::{UVec2, Vec3};
use rayon::prelude::*;
use rosarium::geometry::ray::offset_origin;
use rosarium::geometry::{Interaction, Ray, Side};
use rosarium::math::{Frame, Sampler, warp};
use rosarium::scene::{
    DEFAULT_SCENE, Drawing, Emitter, MemoryAssets, Override, Scene, SceneDescription, compile, load,
};
use rosarium::spectrum::SampledWavelengths;
use rosarium::transport::NoProgress;
use rosarium::transport::radiosity::facets::face_normal;
use rosarium::transport::radiosity::{Quantity, Radiosity, RadiositySettings, solve};

/// Settings of `shapes.rose.rose.detail`; 0 stands for the coarsest wild rose without leaves and stamens, 1800 triangles.
const DETAILS: [f64; 7] = [0.0, 0.1, 0.43, 1.36, 2.7, 3.05, 6.1];
/// Patches of all petals together, as many as 797790 triangles have patches of 64.
const PATCHES: usize = 12_000;
/// Patches whose truth is computed.
const DRAWN: usize = 1500;
const SIDES: [Side; 2] = [Side::Adaxial, Side::Abaxial];
/// Wavelengths of the truth.
const TRUTH_NM: [f32; 8] = [500.0, 520.0, 540.0, 560.0, 580.0, 600.0, 620.0, 640.0];
/// ... of them those that are told.
const TOLD: [usize; 2] = [7, 2];

/// A set of triangles of a shape.
struct Patch {
    shape: u32,
    faces: Vec<u32>,
}

fn halve(scene: &Scene, shape: u32, faces: &mut [u32], most: usize, out: &mut Vec<Patch>) {
    if 2 * faces.len() <= 3 * most {
        out.push(Patch { shape, faces: faces.to_vec() });
        return;
    }
    let mesh = &scene.shapes[shape as usize].mesh;
    let centre = |f: u32| mesh.corners(f as usize).iter().sum::<Vec3>();
    let none = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (low, high) = faces.iter().fold(none, |(l, h), f| (l.min(centre(*f)), h.max(centre(*f))));
    let axis = (high - low).max_position();
    let middle = faces.len() / 2;
    faces.select_nth_unstable_by(middle, |a, b| centre(*a)[axis].total_cmp(&centre(*b)[axis]).then(a.cmp(b)));
    let (a, b) = faces.split_at_mut(middle);
    halve(scene, shape, a, most, out);
    halve(scene, shape, b, most, out);
}

fn patches(scene: &Scene, most: usize) -> Vec<Patch> {
    let mut out = Vec::new();
    for (k, shape) in scene.shapes.iter().enumerate().filter(|(_, s)| s.petal_id > 0) {
        let mut faces: Vec<u32> = (0..shape.mesh.triangles.len() as u32).collect();
        halve(scene, k as u32, &mut faces, most, &mut out);
    }
    out
}

/// Irradiance from lights, from surfaces, and the standard error of both together.
#[derive(Clone, Copy, Default, Debug)]
struct Truth {
    direct: [f64; 8],
    indirect: [f64; 8],
    error: [f64; 8],
}

/// Points per replicate and round, replicates, rounds.
const POINTS: u32 = 64;
const REPLICATES: usize = 16;
const ROUNDS: u32 = 12;

fn truth(scene: &Scene, solution: &Radiosity, patch: &Patch, side: Side, number: u32) -> Truth {
    let mesh = &scene.shapes[patch.shape as usize].mesh;
    let mut areas = Vec::with_capacity(patch.faces.len());
    let mut area = 0.0f64;
    for f in &patch.faces {
        area += f64::from(mesh.face_area(*f as usize));
        areas.push(area);
    }
    let lambda = SampledWavelengths::given(TRUTH_NM);
    let up = if side == Side::Adaxial { 1.0 } else { -1.0 };
    let lights = &scene.lights;
    let lamps: Vec<usize> =
        (0..lights.emitters().len()).filter(|k| matches!(lights.emitters()[*k], Emitter::Area(_))).collect();
    let mut sums = [([0.0f64; 8], [0.0f64; 8]); REPLICATES];
    let mut out = Truth::default();
    for round in 0..ROUNDS {
        for (k, (direct, indirect)) in sums.iter_mut().enumerate() {
            for i in 0..POINTS {
                let mut s = Sampler::new(99 + k as u64, UVec2::new(number, 0x7ab1e), round * POINTS + i);
                let x = f64::from(s.next_1d()) * area;
                let at = areas.partition_point(|a| *a <= x).min(areas.len() - 1);
                let face = patch.faces[at] as usize;
                let [a, b, c] = mesh.corners(face);
                let w = warp::square_to_triangle(s.next_2d());
                // In f64 the point stays on the triangle.
                let along = (b - a).as_dvec3() * f64::from(w.y) + (c - a).as_dvec3() * f64::from(w.z);
                let p = (a.as_dvec3() + along).as_vec3();
                let n = face_normal(mesh, face).normalize_or(Vec3::Z) * up;
                for lamp in &lamps {
                    let u = s.next_2d();
                    let Some(l) = lights.sample_light(*lamp, Drawing::Each, p, u, &lambda) else { continue };
                    let cos = l.wi.dot(n);
                    let t_max = l.distance_mm * (1.0 - 1e-4);
                    let ray = Ray { t_max, ..Ray::new(offset_origin(p, n, l.wi), l.wi) };
                    if cos > 0.0 && !scene.bvh.occluded(&ray) {
                        for (d, r) in direct.iter_mut().zip(l.radiance.0) {
                            *d += f64::from(r * cos / l.pdf_per_sr);
                        }
                    }
                }
                let wi = Frame::from_normal(n).to_world(warp::square_to_cosine_hemisphere(s.next_2d()));
                match scene.intersect(&Ray::new(offset_origin(p, n, wi), wi)) {
                    None => {
                        for (d, r) in direct.iter_mut().zip(lights.environment(wi, &lambda).0) {
                            *d += f64::from(r * PI);
                        }
                    }
                    Some(hit) => {
                        let side = if hit.ng.dot(wi) < 0.0 { Side::Adaxial } else { Side::Abaxial };
                        if let Some(e) = solution.elements().hit(&hit) {
                            let leaving = solution.at(e, side, hit.p, Quantity::Leaving);
                            for (d, r) in indirect.iter_mut().zip(leaving) {
                                *d += f64::from(r);
                            }
                        }
                    }
                }
            }
        }
        let n = f64::from((round + 1) * POINTS);
        let r = REPLICATES as f64;
        for l in 0..8 {
            out.direct[l] = sums.iter().map(|s| s.0[l]).sum::<f64>() / n / r;
            out.indirect[l] = sums.iter().map(|s| s.1[l]).sum::<f64>() / n / r;
            let mean = out.direct[l] + out.indirect[l];
            let square: f64 = sums.iter().map(|s| ((s.0[l] + s.1[l]) / n - mean).powi(2)).sum();
            out.error[l] = (square / (r * (r - 1.0))).sqrt();
        }
        let good = |l: usize| out.error[l] <= 0.004 * (out.direct[l] + out.indirect[l]);
        if TOLD.iter().all(|l| good(*l)) {
            break;
        }
    }
    out
}

fn median(mut values: Vec<(f64, f64)>) -> f64 {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = values.iter().map(|v| v.1).sum::<f64>() / 2.0;
    let mut sum = 0.0;
    for (value, weight) in &values {
        sum += weight;
        if sum >= half {
            return *value;
        }
    }
    0.0
}

/// CPU seconds of this process (Linux; elsewhere nothing).
fn cpu_s() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let ticks = text.rsplit(')').next().map(|rest| rest.split_whitespace().skip(11).take(2));
    ticks.map_or(0.0, |t| t.filter_map(|t| t.parse::<f64>().ok()).sum::<f64>() / 100.0)
}

fn peak_mib() -> f64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find(|l| l.starts_with("VmHWM:"));
    line.and_then(|l| l.split_whitespace().nth(1)?.parse::<f64>().ok()).unwrap_or(0.0) / 1024.0
}

fn scene(detail: f64) -> Scene {
    let rose = |set: &str| Override::parse(&format!("shapes.rose.{set}")).expect("a key and a value");
    let wild = ["preset=\"wild\"", "rose.leaves.count=0", "rose.stamens.count=0", "rose.stamens.styles=0"];
    let mut set = vec![rose(&format!("rose.detail={}", detail.max(0.1)))];
    if detail == 0.0 {
        set.extend(wild.map(rose));
    }
    let loaded = load::<SceneDescription>(DEFAULT_SCENE, "default", &set).expect("the built-in scene loads");
    compile(&loaded.description, &MemoryAssets::default()).expect("the built-in scene compiles")
}

/// Value and weight of a patch's direct and indirect light beside its truth.
type Weighed<'a> = &'a dyn Fn(&[f64; 2], &Truth) -> (f64, f64);

/// Error of a set of patches' irradiance.
fn tell(
    scene: &Scene,
    solution: &Radiosity,
    patches: &[Patch],
    drawn: &[(usize, Side)],
    truths: &[Truth],
    nm: &[f32],
) {
    let lambdas: Vec<SampledWavelengths> = nm
        .chunks(8)
        .map(|c| SampledWavelengths::given(std::array::from_fn(|l| c[l.min(c.len() - 1)])))
        .collect();
    let found: Vec<[[f64; 2]; 2]> = drawn
        .par_iter()
        .map(|(k, side)| {
            let patch = &patches[*k];
            let mesh = &scene.shapes[patch.shape as usize].mesh;
            let mut sum = [[0.0f64; 2]; 2];
            let mut area = 0.0f64;
            for f in &patch.faces {
                let [a, b, c] = mesh.corners(*f as usize);
                let p = (a + b + c) / 3.0;
                let Some(e) = solution.elements().at(patch.shape, *f, Vec3::splat(1.0 / 3.0)) else {
                    continue;
                };
                let weight = f64::from(mesh.face_area(*f as usize));
                area += weight;
                let all = solution.at(e, *side, p, Quantity::Incident);
                let at = Interaction {
                    p,
                    ng: Vec3::Z,
                    frame: Frame::from_normal(Vec3::Z),
                    uv: glam::Vec2::ZERO,
                    uv_scale_mm: glam::Vec2::ZERO,
                    t: 0.0,
                    b: Vec3::splat(1.0 / 3.0),
                    shape: patch.shape,
                    face: *f,
                };
                for (t, told) in TOLD.iter().enumerate() {
                    let i =
                        nm.iter().position(|n| *n == TRUTH_NM[*told]).expect("a wavelength of the solution");
                    let indirect = f64::from(solution.indirect(&at, *side, &lambdas[i / 8])[i % 8]);
                    sum[t][0] += weight * (f64::from(all[i]) - indirect);
                    sum[t][1] += weight * indirect;
                }
            }
            sum.map(|s| s.map(|v| v / area))
        })
        .collect();
    for (t, told) in TOLD.iter().enumerate() {
        let of =
            |what: Weighed| median(found.iter().zip(truths).map(|(f, truth)| what(&f[t], truth)).collect());
        let total = |x: &Truth| (x.direct[*told] + x.indirect[*told]).max(1e-30);
        println!(
            "  {} nm: median error {:.2} % by number, {:.2} % by light; of direct light {:.2} %, of indirect {:.2} %; noise of truth {:.2} %; direct share {:.2}",
            TRUTH_NM[*told],
            100.0 * of(&|f, x| (((f[0] + f[1]) / total(x) - 1.0).abs(), 1.0)),
            100.0 * of(&|f, x| (((f[0] + f[1]) / total(x) - 1.0).abs(), total(x))),
            100.0 * of(&|f, x| ((f[0] - x.direct[*told]).abs() / total(x), 1.0)),
            100.0 * of(&|f, x| ((f[1] - x.indirect[*told]).abs() / total(x), 1.0)),
            100.0 * of(&|_, x| (x.error[*told] / total(x), 1.0)),
            of(&|_, x| (x.direct[*told] / total(x), 1.0)),
        );
        let sum = |what: &dyn Fn(&[f64; 2], &Truth) -> f64| -> f64 {
            found.iter().zip(truths).map(|(f, x)| what(&f[t], x)).sum()
        };
        println!(
            "    all patches together: direct {:+.2} %, indirect {:+.2} % of their light",
            100.0 * sum(&|f, x| f[0] - x.direct[*told]) / sum(&|_, x| total(x)),
            100.0 * sum(&|f, x| f[1] - x.indirect[*told]) / sum(&|_, x| total(x)),
        );
        let mut order: Vec<usize> = (0..truths.len()).collect();
        order.sort_by(|a, b| total(&truths[*a]).total_cmp(&total(&truths[*b])));
        for (q, part) in order.chunks(truths.len().div_ceil(4)).enumerate() {
            let of = |what: &dyn Fn(&[f64; 2], &Truth) -> f64| {
                100.0 * median(part.iter().map(|k| (what(&found[*k][t], &truths[*k]), 1.0)).collect())
            };
            println!(
                "    quarter {}, E up to {:.3}: median error {:.1} %, of direct light {:.1} %, of indirect {:.1} % (signed {:+.1} %)",
                q + 1,
                part.last().map_or(0.0, |k| total(&truths[*k])),
                of(&|f, x| ((f[0] + f[1]) / total(x) - 1.0).abs()),
                of(&|f, x| (f[0] - x.direct[*told]).abs() / total(x)),
                of(&|f, x| (f[1] - x.indirect[*told]).abs() / total(x)),
                of(&|f, x| (f[1] - x.indirect[*told]) / total(x)),
            );
        }
    }
}

fn measure(detail: f64, settings: &RadiositySettings, patches_wanted: Option<usize>) {
    // The most memory of what came before is not this size's (Linux).
    let _ = std::fs::write("/proc/self/clear_refs", "5");
    let scene = scene(detail);
    let triangles: usize = scene.shapes.iter().map(|s| s.mesh.triangles.len()).sum();
    let nm: Vec<f32> = (0..16).map(|i| 400.0 + 20.0 * i as f32).collect();
    let (started, before) = (Instant::now(), cpu_s());
    let solution =
        solve(&scene, &nm, settings, &mut Vec::new(), &NoProgress).expect("the default scene is solved");
    let (wall, cpu) = (started.elapsed().as_secs_f64(), cpu_s() - before);
    let ledger = solution.ledger();
    let closure =
        (ledger.error().iter().zip(&ledger.emitted)).map(|(e, all)| (e / all).abs()).fold(0.0, f64::max);
    println!(
        "{triangles} triangles, {} elements, {} factors: {wall:.1} s wall, {cpu:.1} CPU s, {:.0} MiB, ledger {closure:.1e}, orders {}",
        solution.elements().len(),
        solution.entries(),
        peak_mib(),
        solution.orders()
    );
    let Some(wanted) = patches_wanted else { return };
    let petal_triangles: usize =
        scene.shapes.iter().filter(|s| s.petal_id > 0).map(|s| s.mesh.triangles.len()).sum();
    let patches = patches(&scene, petal_triangles.div_ceil(wanted).max(1));
    let drawn: Vec<(usize, Side)> = (0..DRAWN)
        .map(|i| {
            let mut s = Sampler::new(5, UVec2::ZERO, i as u32);
            let u = s.next_2d();
            ((u.x * patches.len() as f32) as usize, SIDES[usize::from(u.y < 0.5)])
        })
        .collect();
    let fine = RadiositySettings { elements: 2 * settings.elements, seed: 1234, ..*settings };
    let fine =
        solve(&scene, &TRUTH_NM, &fine, &mut Vec::new(), &NoProgress).expect("the default scene is solved");
    let truths: Vec<Truth> = drawn
        .par_iter()
        .enumerate()
        .map(|(i, (k, side))| truth(&scene, &fine, &patches[*k], *side, i as u32))
        .collect();
    println!(
        "  {} patches of up to {} triangles",
        patches.len(),
        patches.iter().map(|p| p.faces.len()).max().unwrap_or(0)
    );
    tell(&scene, &solution, &patches, &drawn, &truths, &nm);
}

fn main() {
    let wanted = std::env::args().skip(1).find_map(|a| a.parse::<f64>().ok());
    if wanted.is_some_and(|w| !DETAILS.contains(&w)) {
        println!("details are {DETAILS:?}");
        return;
    }
    let patches = std::env::args().find_map(|a| a.strip_prefix("patches=")?.parse().ok()).unwrap_or(PATCHES);
    let patches = (!std::env::args().any(|a| a == "cost")).then_some(patches);
    for detail in DETAILS.into_iter().filter(|d| wanted.is_none_or(|w| w == *d)) {
        measure(detail, &RadiositySettings::default(), patches);
    }
}

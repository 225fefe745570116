//! Radiosity with transmission: diffuse light through and between petals, to any order.
//!
//! Model: every piece of surface sends back, and lets through, light without a preferred direction:
//!
//! ```text
//! B_n = R_n E_n + T_n' E_n' (+ what direct light leaves, by its own incidence),   E_n = E_direct + sum_m F_nm B_m
//! ```
//!
//! for the two sides n, n' of each element ([`elements`]). Four parts, each near linear in the number of triangles or of
//! elements: elements are halved from whole pieces of surface, twice as finely where direct light changes; direct light is
//! sampled at them; rays find the form factors, balanced so that no light is lost; Jacobi
//! iteration adds the orders. In between elements the light is linear.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | R, T | totals of the materials ([`crate::scene::MaterialTotals`]) | share | the scene's |
//! | E, B | [`Radiosity`] | W m-2 nm-1, where a light's radiance is W m-2 sr-1 nm-1 | |
//! | elements, rays, samples | [`RadiositySettings`] | | 50000, 32, 32 |
//!
//! Limits: light is the same all over an element when it leaves, so sheets closer to each other than an element is wide pass on
//! too much light sideways: 5 % too much in a rose of 33 elements per petal, 0.9 % of 130, 0.2 % of 500. What surfaces send on is diffuse, with the right total; highlights between petals are spread out. R and T of
//! light from other surfaces are those of diffuse light. Geometric normals. Memory: [`RadiositySettings::bytes`].
//! Guarded by `furnace_of_translucent_sheets`, `parallel_sheets_match_the_series`, `ledger_closes`,
//! `agrees_with_walks_of_light` (`tests/radiosity.rs`). Source: Goral et al. 1984; Rushmeier and Torrance, ACM Trans. Graph. 9:1, 1990.

mod direct;
pub mod elements;
mod exchange;
pub mod facets;
mod glow;
pub mod ledger;
mod neighbours;
mod power;
mod smooth;
mod solve;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

use std::sync::atomic::{AtomicU64, Ordering};

use glam::Vec3;

pub use elements::{Element, Elements};
pub use ledger::Ledger;

use super::Progress;
use crate::geometry::{Interaction, Side};
use crate::scene::{MaterialTotals, Scene};
use crate::spectrum::{LANES, SampledSpectrum, SampledWavelengths, VISIBLE_NM};
use crate::{Error, Result};
use direct::{DirectLight, Lighting};
use elements::node;
use exchange::Exchange;
use facets::Facets;
use smooth::Slopes;
use solve::{Shares, total};

/// Rounds of halving where direct light changes.
const ROUNDS: u32 = 4;
/// Elements are halved where direct light differs from a neighbour's by more than this share of the two and of the mean.
const CHANGE: f32 = 0.1;

/// Most times the samples of an element that gets much light.
const MAX_TIMES: u32 = 32;

/// How finely light is carried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadiositySettings {
    /// About how many elements at most; every connected piece of surface is at least one. Sheets that lie close
    /// together want elements as small as the gap between them. Default 50000.
    pub elements: u32,
    /// Rays from each side of an element. Many elements with few rays are better than few with many. Default 32.
    pub rays: u32,
    /// Samples of every light for each side of an element; elements that get much light get more. Default 32.
    pub light_samples: u32,
    /// Rays from every light that tell how much of its power meets nothing, for the ledger. Default 2^20.
    pub light_rays: u32,
    /// The iteration ends when this share of the direct light is still under way. Default 1e-5.
    pub residual: f64,
    /// ... or after this many orders of scattering. Default 1000.
    pub max_orders: u32,
    /// Seed of all samples. Default 0.
    pub seed: u64,
    /// Most memory, bytes. Default 8 GiB.
    pub memory_bytes: u64,
}

impl Default for RadiositySettings {
    fn default() -> Self {
        Self {
            elements: 50_000,
            rays: 32,
            light_samples: 32,
            light_rays: 1 << 20,
            residual: 1e-5,
            max_orders: 1000,
            seed: 0,
            memory_bytes: 8 << 30,
        }
    }
}

impl RadiositySettings {
    /// Bound on the memory that a solution takes while it is computed, for so many triangles, connected pieces of surface
    /// and wavelengths.
    pub fn bytes(&self, triangles: u64, pieces: u64, wavelengths: u64) -> u64 {
        // Halving may overshoot by half.
        let nodes = 2 * (u64::from(self.elements) * 3 / 2 + pieces);
        let per_value = 8 * size_of::<SampledSpectrum>() as u64;
        let values = nodes * wavelengths.div_ceil(LANES as u64);
        // Facets, their order and places, and what halving sorts.
        let facets = triangles + 12 * u64::from(self.elements);
        exchange::bytes(nodes, self.rays.into()) + values * per_value + facets * 80
    }

    fn validate(&self) -> Result<()> {
        for (name, value) in [
            ("elements", self.elements),
            ("rays", self.rays),
            ("light_samples", self.light_samples),
            ("light_rays", self.light_rays),
        ] {
            if !(1..=50_000_000).contains(&value) {
                return Err(Error::invalid(name, format!("{value} is not within 1 to 5e7")));
            }
        }
        if !(self.residual > 0.0 && self.residual < 1.0) {
            return Err(Error::invalid("residual", format!("{} is not between 0 and 1", self.residual)));
        }
        Ok(())
    }
}

/// What of the light at a surface is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Irradiance of a side.
    Incident,
    /// What of that the sheet absorbs.
    Absorbed,
    /// What of that leaves from the other side.
    Transmitted,
    /// All that leaves from a side: radiosity.
    Leaving,
}

/// The light of every element at every wavelength.
#[derive(Debug)]
pub struct Radiosity {
    wavelengths_nm: Vec<f32>,
    chunks: usize,
    elements: Elements,
    /// Irradiance straight from lights, `chunks` values per node.
    direct: Vec<SampledSpectrum>,
    /// Irradiance from other surfaces.
    indirect: Vec<SampledSpectrum>,
    /// Light sent back by the node.
    reflected: Vec<SampledSpectrum>,
    /// Light of the node that leaves from the other side.
    transmitted: Vec<SampledSpectrum>,
    slopes_direct: Slopes,
    slopes_indirect: Slopes,
    /// Spectrum of all lights together at the wavelengths of the solution, and by nm.
    light: (Vec<f32>, Vec<f32>),
    ledger: Ledger,
    entries: usize,
    imbalance: f64,
    orders: u32,
    residual: f64,
    converged: bool,
}

/// Wavelengths in chunks; the last one is filled up with its last.
fn chunks_of(wavelengths_nm: &[f32]) -> Vec<SampledWavelengths> {
    let chunk = |c: &[f32]| SampledWavelengths::given(std::array::from_fn(|l| c[l.min(c.len() - 1)]));
    wavelengths_nm.chunks(LANES).map(chunk).collect()
}

/// Counts the steps of several computations as one.
struct Steps<'a> {
    progress: &'a dyn Progress,
    done: AtomicU64,
    total: u64,
}

impl Steps<'_> {
    fn add(&self, n: u64) {
        let done = self.done.fetch_add(n, Ordering::Relaxed) + n;
        self.progress.advance(done.min(self.total), self.total);
    }
}

/// Tracing is about this many times the work of the direct light of an element, orders a small part.
const TRACE_STEPS: u64 = 2;

struct TraceSteps<'a> {
    steps: &'a Steps<'a>,
    /// Nodes per step.
    seen: AtomicU64,
}

impl Progress for TraceSteps<'_> {
    fn advance(&self, done: u64, _total: u64) {
        // Two nodes are an element.
        let steps = done * TRACE_STEPS / 2;
        let before = self.seen.fetch_max(steps, Ordering::Relaxed);
        self.steps.add(steps.saturating_sub(before));
    }
    fn cancelled(&self) -> bool {
        self.steps.progress.cancelled()
    }
}

/// Solves for the light of a scene at these wavelengths, nm. `warnings` gets what is wrong with the scene but does not
/// stop the work. Stopped by `progress`, it gives [`Error::Cancelled`], or the light so far, not converged.
pub fn solve(
    scene: &Scene,
    wavelengths_nm: &[f32],
    settings: &RadiositySettings,
    warnings: &mut Vec<String>,
    progress: &dyn Progress,
) -> Result<Radiosity> {
    settings.validate()?;
    let bad = |nm: &&f32| !(VISIBLE_NM.0..=VISIBLE_NM.1).contains(*nm);
    if wavelengths_nm.is_empty() {
        return Err(Error::invalid("wavelengths", "there are none"));
    }
    if let Some(nm) = wavelengths_nm.iter().find(bad) {
        return Err(Error::invalid("wavelengths", format!("{nm} nm is not within 380 to 780 nm")));
    }
    let triangles = scene.shapes.iter().map(|s| s.mesh.triangles.len() as u64).sum();
    check_memory(settings, triangles, 0, wavelengths_nm.len())?;
    let chunks = chunks_of(wavelengths_nm);
    let totals = MaterialTotals::of_scene(scene, &chunks)?;

    let facets = Facets::new(scene, settings.elements);
    warn(&facets, warnings);
    if facets.is_empty() {
        return Err(Error::invalid("shapes", "no triangle of the scene has an area"));
    }
    check_memory(settings, triangles, facets.pieces() as u64, wavelengths_nm.len())?;
    let steps = Steps {
        progress,
        done: AtomicU64::new(0),
        total: u64::from(settings.elements.max(facets.pieces() as u32)) * (1 + TRACE_STEPS),
    };
    let lighting = Lighting {
        scene,
        totals: &totals,
        chunks: &chunks,
        samples: settings.light_samples,
        seed: settings.seed,
        without_glow: glow::is_large(scene),
    };
    let (elements, beside, mut direct) = refine(scene, facets, &lighting, settings.elements, &steps)?;

    let exchange = Exchange::trace(
        scene,
        &elements,
        settings.rays,
        settings.seed,
        &TraceSteps { steps: &steps, seen: AtomicU64::new(0) },
    )?;
    let shares: Vec<Shares> = elements
        .list()
        .iter()
        .flat_map(|e| {
            let totals = &totals[scene.shapes[e.shape as usize].material as usize];
            let count = chunks.len();
            [Side::Adaxial, Side::Abaxial]
                .into_iter()
                .flat_map(move |side| (0..count).map(move |c| totals.mean(e.uv, side, c)))
        })
        .collect();
    let areas: Vec<f32> = elements.list().iter().map(|e| e.area_mm2).collect();
    let escaped_glow = match lighting.without_glow {
        true => glow::add(scene, &elements, &exchange, &shares, &chunks, &mut direct),
        false => Vec::new(),
    };
    let goal = (settings.residual, settings.max_orders);
    let solution = solve::solve(&exchange, &direct, &shares, &areas, goal, &Orders(progress));
    let mut power = power::power(scene, &chunks, (settings.light_rays, settings.seed), lighting.without_glow);
    for (sum, glow) in power.escaped.iter_mut().zip(&escaped_glow) {
        sum.iter_mut().zip(glow).for_each(|(s, g)| *s += g);
    }

    let indirect = smooth::even_out(&elements, &beside, solution.indirect, chunks.len());
    let reflected: Vec<SampledSpectrum> =
        (0..direct.len()).map(|i| direct[i].reflected + indirect[i] * shares[i].0).collect();
    let transmitted: Vec<SampledSpectrum> =
        (0..direct.len()).map(|i| direct[i].transmitted + indirect[i] * shares[i].1).collect();
    let incident: Vec<SampledSpectrum> = direct.iter().map(|d| d.incident).collect();
    let slopes_direct = Slopes::new(&elements, &beside, &incident, chunks.len());
    let slopes_indirect = Slopes::new(&elements, &beside, &indirect, chunks.len());
    let mut out = Radiosity {
        wavelengths_nm: wavelengths_nm.to_vec(),
        chunks: chunks.len(),
        elements,
        direct: incident,
        indirect,
        reflected,
        transmitted,
        slopes_direct,
        slopes_indirect,
        light: light_spectrum(scene, &chunks, wavelengths_nm.len()),
        ledger: Ledger::default(),
        entries: exchange.entries(),
        imbalance: exchange.imbalance(),
        orders: solution.orders,
        residual: solution.residual,
        converged: solution.residual <= settings.residual,
    };
    out.ledger = Ledger {
        emitted: out.lanes(&power.emitted),
        escaped_directly: out.lanes(&power.escaped),
        absorbed: out.absorbed_by_shape(scene),
        escaped: out.lanes(&solution.escaped),
        under_way: out.lanes(&solution.under_way),
    };
    Ok(out)
}

/// The iteration's own progress.
struct Orders<'a>(&'a dyn Progress);

impl Progress for Orders<'_> {
    fn advance(&self, _done: u64, _total: u64) {}
    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

fn check_memory(settings: &RadiositySettings, triangles: u64, pieces: u64, wavelengths: usize) -> Result<()> {
    let needed = settings.bytes(triangles, pieces, wavelengths as u64);
    if needed <= settings.memory_bytes {
        return Ok(());
    }
    let fits = |elements: u32| {
        RadiositySettings { elements, ..*settings }.bytes(triangles, pieces, wavelengths as u64)
            <= settings.memory_bytes
    };
    let mut elements = settings.elements;
    while elements > 0 && !fits(elements) {
        elements /= 2;
    }
    let mib = |bytes: u64| bytes.div_ceil(1 << 20);
    let what = match elements {
        0 => format!(
            "{triangles} triangles in {pieces} pieces need {} MiB whatever the elements are",
            mib(RadiositySettings { elements: 1, ..*settings }.bytes(triangles, pieces, wavelengths as u64))
        ),
        n => format!("{n} elements would fit, or fewer rays or wavelengths"),
    };
    Err(Error::invalid(
        "memory",
        format!(
            "{} elements of {} rays at {wavelengths} wavelengths need {} MiB, more than the {} MiB allowed; {what}",
            settings.elements,
            settings.rays,
            mib(needed),
            mib(settings.memory_bytes)
        ),
    ))
}

fn warn(facets: &Facets, warnings: &mut Vec<String>) {
    let flaws = facets.flaws();
    for (count, what) in [
        (flaws.without_area, "have no area and are left out"),
        (flaws.duplicate, "lie where another one lies and are left out"),
    ] {
        if count > 0 {
            warnings.push(format!("{count} triangles {what}"));
        }
    }
}

/// Elements, their neighbours and direct light: half of the elements by area, the others where direct light changes.
fn refine(
    scene: &Scene,
    facets: Facets,
    lighting: &Lighting,
    wanted: u32,
    steps: &Steps,
) -> Result<(Elements, Vec<Vec<u32>>, Vec<DirectLight>)> {
    let chunks = lighting.chunks.len();
    let mut elements = Elements::new(scene, facets, wanted.div_ceil(2));
    let once = |which: &[u32]| which.iter().map(|e| (*e, 1)).collect::<Vec<_>>();
    let all: Vec<u32> = (0..elements.len() as u32).collect();
    let heard = |n: u64| steps.add(n);
    let mut light = lighting.on(&elements, &once(&all), &heard);
    let put = |light: &mut Vec<DirectLight>, which: &[(u32, u32)], found: &[DirectLight]| {
        for ((e, _), values) in which.iter().zip(found.chunks(2 * chunks)) {
            let first = *e as usize * 2 * chunks;
            light[first..first + 2 * chunks].copy_from_slice(values);
        }
    };
    let mut beside = neighbours::neighbours(&elements);
    let mut looked_at = all;
    for _ in 0..ROUNDS {
        let room = (wanted as usize).saturating_sub(elements.len());
        if room == 0 || steps.progress.cancelled() {
            break;
        }
        let mut changing = changing(&elements, &beside, &light, chunks, &looked_at);
        changing.truncate(room);
        if changing.is_empty() {
            break;
        }
        let changing: Vec<u32> = changing.into_iter().map(|c| c.1).collect();
        let new = elements.halve(scene, &changing);
        elements.describe(scene, &new);
        let found = lighting.on(&elements, &once(&new), &heard);
        light.resize(elements.len() * 2 * chunks, DirectLight::default());
        put(&mut light, &once(&new), &found);
        beside = neighbours::neighbours(&elements);
        looked_at = new;
    }
    let strong = strong(&elements, &light, chunks);
    let found = lighting.on(&elements, &strong, &|_| ());
    put(&mut light, &strong, &found);
    if steps.progress.cancelled() {
        return Err(Error::Cancelled);
    }
    Ok((elements, beside, light))
}

/// Elements that get more of the direct light than the mean one, with how many times as much (at most `MAX_TIMES`): as
/// many times the samples go there, so that the sum of all light is known better than that of one element.
fn strong(elements: &Elements, light: &[DirectLight], chunks: usize) -> Vec<(u32, u32)> {
    let power: Vec<f64> = light
        .chunks(2 * chunks)
        .zip(elements.list())
        .map(|(l, e)| l.iter().map(|d| f64::from(d.incident.mean())).sum::<f64>() * f64::from(e.area_mm2))
        .collect();
    let mean = power.iter().sum::<f64>() / power.len().max(1) as f64;
    (0u32..)
        .zip(&power)
        .map(|(e, p)| (e, (p / mean.max(1e-300)).min(f64::from(MAX_TIMES)) as u32))
        .filter(|(_, times)| *times > 1)
        .collect()
}

/// Elements where direct light changes to a neighbour, the most first: change and element.
fn changing(
    elements: &Elements,
    beside: &[Vec<u32>],
    light: &[DirectLight],
    chunks: usize,
    which: &[u32],
) -> Vec<(f32, u32)> {
    let brightness = |n: usize| {
        light[n * chunks..(n + 1) * chunks].iter().map(|d| d.incident.mean()).sum::<f32>() / chunks as f32
    };
    let area: f64 = elements.list().iter().map(|e| f64::from(e.area_mm2)).sum();
    let mean = (0..2 * elements.len())
        .map(|n| f64::from(brightness(n)) * f64::from(elements.list()[n / 2].area_mm2))
        .sum::<f64>()
        / (2.0 * area.max(1e-300));
    let floor = mean as f32;
    let mut out: Vec<(f32, u32)> = which
        .iter()
        .filter(|e| elements.facets_of(**e).len() > 1)
        .filter_map(|e| {
            let change = (0..2)
                .flat_map(|side| {
                    let here = brightness(2 * *e as usize + side);
                    beside[*e as usize].iter().take(4).map(move |n| {
                        let there = brightness(2 * *n as usize + side);
                        (here - there).abs() / (0.5 * (here + there) + floor).max(1e-30)
                    })
                })
                .fold(0.0, f32::max);
            (change > CHANGE).then_some((change, *e))
        })
        .collect();
    out.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    out
}

/// Spectrum of all lights together, at the solution's wavelengths and at every nm.
fn light_spectrum(scene: &Scene, chunks: &[SampledWavelengths], count: usize) -> (Vec<f32>, Vec<f32>) {
    let radius = ((scene.bounds.1 - scene.bounds.0).length() / 2.0).max(1e-6);
    let at = |lambda: &SampledWavelengths| {
        (0..scene.lights.emitters().len())
            .fold(SampledSpectrum::ZERO, |sum, i| sum + scene.lights.power(i, radius, lambda))
    };
    let spread = |lambda: &[SampledWavelengths], n: usize| -> Vec<f32> {
        lambda.iter().flat_map(|l| at(l).0).take(n).collect()
    };
    let every: Vec<f32> = (VISIBLE_NM.0 as u32..=VISIBLE_NM.1 as u32).map(|nm| nm as f32).collect();
    (spread(chunks, count), spread(&chunks_of(&every), every.len()))
}

impl Radiosity {
    /// The wavelengths, nm.
    pub fn wavelengths_nm(&self) -> &[f32] {
        &self.wavelengths_nm
    }

    /// The elements.
    pub fn elements(&self) -> &Elements {
        &self.elements
    }

    /// Where the light went.
    pub fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// Did the iteration reach its goal?
    pub fn converged(&self) -> bool {
        self.converged
    }

    /// Largest share of the direct light, over the wavelengths, that was still under way at the end.
    pub fn residual(&self) -> f64 {
        self.residual
    }

    /// Orders of scattering.
    pub fn orders(&self) -> u32 {
        self.orders
    }

    /// Number of form factors.
    pub fn entries(&self) -> usize {
        self.entries
    }

    /// Largest relative error of a row of form factors after balancing.
    pub fn imbalance(&self) -> f64 {
        self.imbalance
    }

    /// Values of an element's side at all wavelengths.
    pub fn element(&self, element: u32, side: Side, quantity: Quantity) -> Vec<f32> {
        self.spread(|c| self.quantity(element, side, c, quantity, |n| self.direct[n] + self.indirect[n]))
    }

    /// Power per nm that lights bring to all surfaces at wavelength `k`, in the ledger's unit.
    pub fn arrived(&self, k: usize) -> f64 {
        let (chunk, lane) = (k / LANES, k % LANES);
        let node = |n: usize| {
            f64::from(self.direct[n * self.chunks + chunk][lane])
                * f64::from(self.elements.list()[n / 2].area_mm2)
        };
        (0..2 * self.elements.len()).map(node).sum()
    }

    /// Irradiance of an element's side straight from the lights, at all wavelengths.
    pub fn element_direct(&self, element: u32, side: Side) -> Vec<f32> {
        self.spread(|c| self.direct[node(element, side) * self.chunks + c])
    }

    /// Values at a point of an element, at all wavelengths: irradiance as it runs within the element, the other quantities
    /// as the same shares of it as in the whole element.
    pub fn at(&self, element: u32, side: Side, p: Vec3, quantity: Quantity) -> Vec<f32> {
        self.spread(|c| self.quantity(element, side, c, quantity, |n| self.incident_at(n, p)))
    }

    /// Mean over each triangle of a shape: values of all wavelengths, triangle by triangle. Triangles without area get zeros.
    pub fn faces(&self, scene: &Scene, shape: u32, side: Side, quantity: Quantity) -> Vec<f32> {
        let faces = scene.shapes[shape as usize].mesh.triangles.len() as u32;
        let count = self.wavelengths_nm.len();
        let mut out = Vec::with_capacity(faces as usize * count);
        for face in 0..faces {
            let mut sum = vec![0.0f32; count];
            if let Some((first, facets)) = self.elements.facets().of_face(shape, face) {
                // The facets of a triangle are alike in area.
                for f in first..first + facets {
                    let ([a, b, c], _) = self.elements.facets().corners(scene, f);
                    let values = self.at(self.elements.of_facet(f), side, (a + b + c) / 3.0, quantity);
                    for (s, v) in sum.iter_mut().zip(values) {
                        *s += v / facets as f32;
                    }
                }
            }
            out.extend(sum);
        }
        out
    }

    /// Values at each vertex of a shape: the mean over the elements that meet there, all wavelengths vertex by vertex.
    pub fn vertices(&self, scene: &Scene, shape: u32, side: Side, quantity: Quantity) -> Vec<f32> {
        let mesh = &scene.shapes[shape as usize].mesh;
        let count = self.wavelengths_nm.len();
        let mut out = vec![0.0f32; mesh.positions.len() * count];
        let mut meeting: Vec<Vec<u32>> = vec![Vec::new(); mesh.positions.len()];
        for (face, corners) in mesh.triangles.iter().enumerate() {
            for (k, vertex) in corners.iter().enumerate() {
                let mut b = Vec3::splat(1e-4);
                b[k] = 1.0 - 2e-4;
                if let Some(e) = self.elements.at(shape, face as u32, b) {
                    let meeting = &mut meeting[*vertex as usize];
                    if !meeting.contains(&e) {
                        meeting.push(e);
                    }
                }
            }
        }
        for (vertex, elements) in meeting.iter().enumerate() {
            let sum = &mut out[vertex * count..(vertex + 1) * count];
            for e in elements {
                let values = self.at(*e, side, mesh.positions[vertex], quantity);
                for (s, v) in sum.iter_mut().zip(values) {
                    *s += v / elements.len() as f32;
                }
            }
        }
        out
    }

    /// Irradiance from other surfaces at a hit, at the wavelengths of a path: linear between those of the solution,
    /// relative to the spectrum of the lights.
    pub fn indirect(&self, at: &Interaction, side: Side, lambda: &SampledWavelengths) -> SampledSpectrum {
        self.between(at, lambda, |n, e| self.indirect_at(n, e, at.p), side)
    }

    /// The same for the light that leaves a side: radiosity.
    pub fn leaving(&self, at: &Interaction, side: Side, lambda: &SampledWavelengths) -> SampledSpectrum {
        self.between(
            at,
            lambda,
            |n, e| {
                let (own, c) = (n / self.chunks, n % self.chunks);
                let side = if own.is_multiple_of(2) { Side::Adaxial } else { Side::Abaxial };
                self.quantity(e, side, c, Quantity::Leaving, |n| self.incident_at(n, at.p))
            },
            side,
        )
    }

    fn between(
        &self,
        at: &Interaction,
        lambda: &SampledWavelengths,
        value: impl Fn(usize, u32) -> SampledSpectrum,
        side: Side,
    ) -> SampledSpectrum {
        let Some(e) = self.elements.hit(at) else { return SampledSpectrum::ZERO };
        let first = node(e, side) * self.chunks;
        let nm = &self.wavelengths_nm;
        // Chunks are asked for as the wavelengths, which rise, come to need them.
        let mut held: Option<(usize, SampledSpectrum)> = None;
        let mut relative = |k: usize| {
            let chunk = k / LANES;
            let values = match held {
                Some((c, values)) if c == chunk => values,
                _ => value(first + chunk, e),
            };
            held = Some((chunk, values));
            let light = self.light.0[k];
            if light > 0.0 { values[k % LANES] / light } else { 0.0 }
        };
        SampledSpectrum::from_fn(|lane| {
            let l = lambda.lambda_nm()[lane];
            let high = nm.partition_point(|n| *n < l).min(nm.len() - 1);
            let low = high.saturating_sub(1);
            let t = if high > low { ((l - nm[low]) / (nm[high] - nm[low])).clamp(0.0, 1.0) } else { 0.0 };
            let value = relative(low) * (1.0 - t) + if t > 0.0 { relative(high) * t } else { 0.0 };
            value * self.light_at(l)
        })
    }

    /// Spectrum of all lights together.
    fn light_at(&self, nm: f32) -> f32 {
        let x = (nm - VISIBLE_NM.0).clamp(0.0, (self.light.1.len() - 1) as f32);
        let low = (x as usize).min(self.light.1.len() - 2);
        let t = x - low as f32;
        self.light.1[low] * (1.0 - t) + self.light.1[low + 1] * t
    }

    fn element_of(&self, i: usize) -> u32 {
        (i / self.chunks / 2) as u32
    }

    fn indirect_at(&self, i: usize, element: u32, p: Vec3) -> SampledSpectrum {
        let e = &self.elements.list()[element as usize];
        self.slopes_indirect.at(e, i / self.chunks, i % self.chunks, p, self.indirect[i])
    }

    fn incident_at(&self, i: usize, p: Vec3) -> SampledSpectrum {
        let element = self.element_of(i);
        let e = &self.elements.list()[element as usize];
        let direct = self.slopes_direct.at(e, i / self.chunks, i % self.chunks, p, self.direct[i]);
        direct + self.indirect_at(i, element, p)
    }

    /// A quantity of a node at a chunk, from the irradiance `incident` of this node and of the element's other one.
    fn quantity(
        &self,
        element: u32,
        side: Side,
        chunk: usize,
        quantity: Quantity,
        incident: impl Fn(usize) -> SampledSpectrum,
    ) -> SampledSpectrum {
        let own = node(element, side) * self.chunks + chunk;
        let other = (node(element, side) ^ 1) * self.chunks + chunk;
        let part = |i: usize, of: &dyn Fn(usize) -> SampledSpectrum| {
            let (light, whole, part) = (incident(i), self.direct[i] + self.indirect[i], of(i));
            SampledSpectrum::from_fn(|l| if whole[l] > 0.0 { light[l] * part[l] / whole[l] } else { 0.0 })
        };
        match quantity {
            Quantity::Incident => incident(own),
            Quantity::Absorbed => part(own, &|i| {
                let whole = self.direct[i] + self.indirect[i];
                (whole - self.reflected[i] - self.transmitted[i]).map(|v| v.max(0.0))
            }),
            Quantity::Transmitted => part(own, &|i| self.transmitted[i]),
            Quantity::Leaving => part(own, &|i| self.reflected[i]) + part(other, &|i| self.transmitted[i]),
        }
    }

    fn spread(&self, chunk: impl Fn(usize) -> SampledSpectrum) -> Vec<f32> {
        (0..self.chunks).flat_map(|c| chunk(c).0).take(self.wavelengths_nm.len()).collect()
    }

    fn lanes(&self, chunks: &[[f64; LANES]]) -> Vec<f64> {
        chunks.iter().flatten().copied().take(self.wavelengths_nm.len()).collect()
    }

    fn absorbed_by_shape(&self, scene: &Scene) -> Vec<[Vec<f64>; 2]> {
        let areas: Vec<f32> = self.elements.list().iter().map(|e| e.area_mm2).collect();
        let of = |shape: usize, side: usize| {
            self.lanes(&total(self.chunks, &areas, |i| {
                let (element, node) = (self.element_of(i), i / self.chunks);
                if self.elements.list()[element as usize].shape as usize != shape || node % 2 != side {
                    return SampledSpectrum::ZERO;
                }
                self.direct[i] + self.indirect[i] - self.reflected[i] - self.transmitted[i]
            }))
        };
        (0..scene.shapes.len()).map(|s| [of(s, 0), of(s, 1)]).collect()
    }
}

//! Radiosity with transmission: diffuse light through and between petals, to any order.
//!
//! Model: every piece of surface sends back, and lets through, light without a preferred direction:
//!
//! ```text
//! B_n = R_n E_n + T_n' E_n' (+ what direct light leaves, by its own incidence),   E_n = E_direct + sum_m F_nm B_m
//! ```
//!
//! for the two sides n, n' of each element ([`elements`]). Four parts, each near linear in the number of triangles or of
//! elements: elements are halved from whole pieces of surface, more finely where light would be sent from the wrong place; direct light is
//! sampled at them; rays find the form factors, another set of them order by order, and no light is lost; Jacobi
//! iteration adds the orders. Light runs linearly within elements, where it leaves as where it is asked for.
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | R, T | totals of the materials ([`crate::scene::MaterialTotals`]) | share | the scene's |
//! | E, B | [`Radiosity`] | W m-2 nm-1, where a light's radiance is W m-2 sr-1 nm-1 | |
//! | elements, rays, samples | [`RadiositySettings`] | | 100000, 36, 64 |
//!
//! Limits: edges of light within an element are smoothed out, so sheets closer to each other than an element is wide pass on
//! too much light sideways; the error falls with the number of elements: 0.1 % of the light of a rose's petals stays too much at the default,
//! but a fifth in the tenth of a petal next to its claw, where hardly any light comes. What surfaces send on is diffuse, with the right total; highlights between petals are spread out. R and T of
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
mod queries;
mod refine;
mod slopes;
mod smooth;
mod solve;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

use std::sync::atomic::{AtomicU64, Ordering};

pub use elements::{Element, Elements};
pub use ledger::Ledger;

use super::Progress;
use crate::geometry::Side;
use crate::scene::{MaterialTotals, Scene};
use crate::spectrum::{LANES, SampledSpectrum, SampledWavelengths, VISIBLE_NM};
use crate::{Error, Result};
use direct::Lighting;
use exchange::Exchange;
use facets::Facets;
use refine::refine;
use slopes::{Range, Slopes, Stencils};
use solve::Shares;

/// How finely light is carried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadiositySettings {
    /// About how many elements at most; every connected piece of surface is at least one. Sheets that lie close
    /// together want elements as small as the gap between them. Default 100000.
    pub elements: u32,
    /// Rays from each side of an element. Many elements with few rays are better than few with many; at least 3 are
    /// used. Default 36.
    pub rays: u32,
    /// Samples of every light for each side of an element, in the mean, and more where there is much light. Noisy
    /// light gets more of them than light that is even. Default 64.
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
            elements: 100_000,
            rays: 36,
            light_samples: 64,
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
        // Direct light, shares, light of the orders with its slopes, what is kept of it.
        let per_value = 16 * size_of::<SampledSpectrum>() as u64;
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
    let lighting = Lighting::new(scene, &totals, &chunks, (settings.light_samples, settings.seed));
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
                .flat_map(move |side| (0..count).map(move |c| totals.mean(e.tissue, side, c)))
        })
        .collect();
    let areas: Vec<f32> = elements.list().iter().map(|e| e.area_mm2).collect();
    let escaped_glow = match lighting.without_glow {
        true => glow::add(scene, &elements, &exchange, &shares, &chunks, &mut direct),
        false => Vec::new(),
    };
    let goal = (settings.residual, settings.max_orders);
    let stencils = Stencils::new(&elements, &beside);
    let solution = solve::solve(&exchange, &stencils, &direct, &shares, &areas, goal, &Orders(progress));
    let mut power = power::power(scene, &chunks, (settings.light_rays, settings.seed), lighting.without_glow);
    for (sum, glow) in power.escaped.iter_mut().zip(&escaped_glow) {
        sum.iter_mut().zip(glow).for_each(|(s, g)| *s += g);
    }

    let indirect = smooth::even_out(&elements, &beside, solution.indirect, chunks.len(), &solution.variance);
    let reflected: Vec<SampledSpectrum> =
        (0..direct.len()).map(|i| direct[i].reflected + indirect[i] * shares[i].0).collect();
    let transmitted: Vec<SampledSpectrum> =
        (0..direct.len()).map(|i| direct[i].transmitted + indirect[i] * shares[i].1).collect();
    let incident: Vec<SampledSpectrum> = direct.iter().map(|d| d.incident).collect();
    let slopes_direct = stencils.slopes(&incident, chunks.len(), Range::Neighbours);
    let slopes_indirect = stencils.slopes(&indirect, chunks.len(), Range::Neighbours);
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
        imbalance: solution.imbalance,
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

//! `rosarium render`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use glam::UVec2;
use rosarium::film::denoise::{Noisy, denoise};
use rosarium::film::{Film, PixelRect, ToneMap};
use rosarium::scene::description::{IntegratorName, PetalDescription};
use rosarium::scene::{
    self, DEFAULT_SCENE, DEFAULT_SCENE_NAME, Loaded, Override, Scene, SceneDescription, load,
};
use rosarium::transport::{self, Prepared, RenderSettings};
use rosarium::{Error, Result, io};

use crate::assets::CachedAssets;
use crate::input::{self, Overrides};
use crate::oidn::{self, Oidn};
use crate::output::Output;
use crate::progress::{Bar, peak_memory};
use crate::{Global, Outcome, progress, report, shell};

/// Render a scene to EXR and PNG.
///
/// The EXR holds linear light and layers (direct, indirect, variance, albedo, N, Z, uv, petal_id, organ_id,
/// samples); the PNG is the picture for a screen. Ctrl-C writes what is there.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  rosarium render                                     the built-in rose to rose.png and rose.exr
  rosarium render -D film.width=256 -D film.height=256 --spp 4 -o quick.png
  rosarium render scenes/thesis.toml -o a.exr -o a.png --integrator raytrace -D petal.samples=64
  rosarium render --denoise --spp 16 -o smooth.png
  rosarium render --petal petal.toml -o fitted.png
  rosarium render --petal pink -D petal.gradient.claw=0.2 -o pink.png
  rosarium render scenes/rose.toml -o part.exr --crop 0.25,0.75,0.25,0.75 --seed 3
`rosarium schema` lists every key of a scene file.")]
pub(crate) struct Args {
    /// Scene file. Default: the built-in rose.
    scene: Option<PathBuf>,
    /// Picture to write: .exr or .png. Repeatable. Default: NAME.png and NAME.exr in this folder.
    #[arg(short, long, value_name = "FILE")]
    output: Vec<PathBuf>,
    /// Petal for every petal of the scene, instead of the scene's: a preset, or a petal file such as `fit` writes.
    #[arg(long, value_name = "NAME|FILE")]
    petal: Option<String>,
    /// Samples per pixel, instead of the scene's.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..))]
    spp: Option<u32>,
    /// Seed of all random choices of the light, instead of the scene's.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    seed: Option<u64>,
    /// Part of the picture, as fractions of its width and height from the top left.
    #[arg(long, value_name = "X0,X1,Y0,Y1", allow_hyphen_values = true, value_parser = parse_crop)]
    crop: Option<Crop>,
    /// How light is transported: all of it, without bias (path); direct light only, as in the thesis (raytrace); diffuse
    /// light among petals only (radiosity); rays joined to radiosity (hybrid).
    #[arg(long, value_name = "NAME", value_parser = named::<IntegratorName>(&["path", "raytrace", "radiosity", "hybrid"]))]
    integrator: Option<IntegratorName>,
    /// Guide paths by a coarse radiosity solution (`path` only): the same picture with less noise for the time.
    #[arg(long, overrides_with = "no_guide")]
    guide: bool,
    /// Do not guide paths, whatever the scene says.
    #[arg(long)]
    no_guide: bool,
    /// Filter the noise from the finished picture; the EXR keeps the noisy light beside it.
    #[arg(long, overrides_with = "no_denoise")]
    denoise: bool,
    /// Do not filter the noise, whatever the scene says.
    #[arg(long)]
    no_denoise: bool,
    /// Open Image Denoise for --denoise: its library, or the folder that holds it. Default: $OIDN_LIBRARY_PATH, then the
    /// system's; without any, a filter of our own.
    #[arg(long, value_name = "PATH")]
    oidn: Option<PathBuf>,
    /// Exposure of the PNG in stops, instead of the scene's.
    #[arg(long, value_name = "EV", allow_negative_numbers = true, value_parser = parse_exposure)]
    exposure: Option<f64>,
    /// Tone curve of the PNG, instead of the scene's.
    #[arg(long, value_name = "NAME", value_parser = named::<ToneMap>(&["agx", "agx_punchy", "aces", "linear"]))]
    tone_map: Option<ToneMap>,
    /// Folder that keeps petals that were measured. Default: rosarium in the user's cache folder.
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    #[command(flatten)]
    overrides: Overrides,
}

/// Fractions of the width and of the height.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crop {
    pub(crate) x: (f64, f64),
    pub(crate) y: (f64, f64),
}

pub(crate) fn parse_crop(argument: &str) -> Result<Crop, String> {
    let numbers: Vec<f64> = argument
        .split(',')
        .map(|n| n.trim().parse().map_err(|_| format!("`{n}` is not a number")))
        .collect::<Result<_, _>>()?;
    let &[x0, x1, y0, y1] = &numbers[..] else {
        return Err("expected four numbers X0,X1,Y0,Y1".to_owned());
    };
    for (low, high, axis) in [(x0, x1, "X"), (y0, y1, "Y")] {
        if !(0.0 <= low && low < high && high <= 1.0) {
            return Err(format!("expected 0 <= {axis}0 < {axis}1 <= 1, but they are {low} and {high}"));
        }
    }
    Ok(Crop { x: (x0, x1), y: (y0, y1) })
}

pub(crate) fn parse_exposure(argument: &str) -> Result<f64, String> {
    match argument.parse::<f64>() {
        Ok(ev) if (-50.0..=50.0).contains(&ev) => Ok(ev),
        _ => Err("not a number of stops within -50 to 50".to_owned()),
    }
}

/// Parses a name as a scene file does.
fn named<T>(names: &'static [&'static str]) -> impl TypedValueParser<Value = T>
where
    T: serde::de::DeserializeOwned + Clone + Send + Sync + 'static,
{
    PossibleValuesParser::new(names.iter().copied()).try_map(|name| toml::Value::String(name).try_into::<T>())
}

pub(crate) fn run(args: &Args, global: Global) -> Result<Outcome> {
    render(args, global, &shell::command())
}

/// Renders and writes; `command` is the one that the picture names as its own.
pub(crate) fn render(args: &Args, global: Global, command: &str) -> Result<Outcome> {
    let outputs = Output::prepare_all("--output", &paths(args), &["exr", "png"])?;
    let started = Instant::now();
    let scene = read_scene(args, global)?;
    tracing::info!(
        shapes = scene.shapes.len(),
        triangles = scene.shapes.iter().map(|s| s.mesh.triangles.len()).sum::<usize>(),
        lights = scene.lights.emitters().len(),
        seconds = started.elapsed().as_secs_f32(),
        "scene ready"
    );
    let resolution = UVec2::new(scene.film.width, scene.film.height);
    let crop = match args.crop {
        Some(c) => {
            PixelRect::from_fractions(resolution, c.x, c.y).map_err(|e| report::at_flag("--crop", e))?
        }
        None => PixelRect::full(resolution),
    };
    let denoiser = Denoiser::new(args, &scene, global)?;
    let settings = RenderSettings { spp: scene.render.spp, seed: scene.render.seed, crop };

    let prepared = prepare(&scene)?;
    let started = Instant::now();
    let rendered = {
        let bar = Bar::new("render");
        transport::render(&scene, prepared.integrator.as_ref(), &settings, &bar)?
    };
    let seconds = started.elapsed().as_secs_f64();

    let metadata = io::exr::Metadata {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        command_line: command.to_owned(),
        seed: settings.seed,
        spp: settings.spp,
        scene_hash: format!("{:032x}", scene.scene_hash),
        render_time_s: seconds as f32,
        denoiser: denoiser.name().to_owned(),
    };
    let denoised = denoiser.run(&rendered.film)?;
    for output in &outputs {
        output.write(&encode(output.format, &rendered.film, denoised.as_deref(), &scene, &metadata)?)?;
    }

    if rendered.film.rejected() > 0 {
        tracing::warn!("{} samples were not finite and are left out", rendered.film.rejected());
    }
    let names: Vec<String> = outputs.iter().map(|o| o.path().display().to_string()).collect();
    let memory = peak_memory().map_or(String::new(), |b| format!(", peak memory {} MiB", b >> 20));
    let summary = format!(
        "{}: {} x {} pixels, {} spp, {seconds:.1} s, {:.3} Msamples/s{memory}",
        names.join(", "),
        crop.width(),
        crop.height(),
        settings.spp,
        rendered.samples as f64 / seconds.max(1e-9) / 1e6,
    );
    progress::say(global, &summary);
    if rendered.complete {
        let converged = prepared.solution.is_none_or(|s| s.converged());
        return Ok(if converged { Outcome::Done } else { Outcome::CheckFailed });
    }
    let pixels = u64::from(crop.width()) * u64::from(crop.height());
    let mean = rendered.samples as f64 / pixels as f64;
    progress::say(
        global,
        &format!("stopped at {mean:.1} of {} samples per pixel; that is what was written", settings.spp),
    );
    Ok(Outcome::Stopped)
}

/// Where to write.
fn paths(args: &Args) -> Vec<PathBuf> {
    if !args.output.is_empty() {
        return args.output.clone();
    }
    let stem = args.scene.as_deref().and_then(Path::file_stem).unwrap_or("rose".as_ref());
    ["png", "exr"].map(|e| PathBuf::from(stem).with_added_extension(e)).to_vec()
}

fn read_scene(args: &Args, global: Global) -> Result<Scene> {
    let change = |SceneDescription { render, film, .. }: &mut SceneDescription| {
        render.spp = args.spp.unwrap_or(render.spp);
        render.seed = args.seed.unwrap_or(render.seed);
        render.integrator = args.integrator.unwrap_or(render.integrator);
        render.guide = (render.guide || args.guide) && !args.no_guide;
        render.denoise = (render.denoise || args.denoise) && !args.no_denoise;
        film.exposure_ev = args.exposure.unwrap_or(film.exposure_ev);
        film.tone_map = args.tone_map.unwrap_or(film.tone_map);
    };
    let petal = args.petal.as_deref();
    compiled(args.scene.as_deref(), petal, &args.overrides, args.cache.clone(), global, change)
}

/// A scene (the built-in one without a path), with another petal if one is given, changed, compiled.
pub(crate) fn compiled(
    path: Option<&Path>,
    petal: Option<&str>,
    overrides: &Overrides,
    cache: Option<PathBuf>,
    global: Global,
    change: impl FnOnce(&mut SceneDescription),
) -> Result<Scene> {
    let define = &overrides.define;
    let Loaded { mut description, source } = match path {
        Some(path) => {
            load::<SceneDescription>(&input::read_text(path)?, &path.display().to_string(), define)?
        }
        None => load::<SceneDescription>(DEFAULT_SCENE, DEFAULT_SCENE_NAME, define)?,
    };
    if let Some(petal) = petal {
        description.petal = read_petal(petal, define)?;
    }
    change(&mut description);
    let assets = CachedAssets::new(input::assets_beside(path), cache, global);
    scene::compile(&description, &assets).map_err(|e| source.locate(e))
}

/// The petal of `--petal`, with the scene's overrides of `petal.` keys. Its mistakes are found here, where its own file is
/// known.
fn read_petal(argument: &str, define: &[Override]) -> Result<PetalDescription> {
    let own = define.iter().filter_map(|o| {
        let key = o.key.strip_prefix("petal.")?.to_owned();
        Some(Override { key, value: o.value.clone() })
    });
    let input::Petal { loaded, assets, .. } = input::petal(argument, &Overrides { define: own.collect() })?;
    let mut petal = loaded.description;
    if !petal.is_tabulated() {
        petal.compile("", &assets).map_err(|e| loaded.source.locate(e))?;
        return Ok(petal);
    }
    petal.validate_tabulated("").map_err(|e| loaded.source.locate(e))?;
    // The scene reads them, from wherever it is.
    for file in [&mut petal.optics, &mut petal.texture].into_iter().flatten() {
        let path = std::path::absolute(assets.base.join(&*file)).map_err(|e| Error::io(&*file, e))?;
        *file = path.display().to_string();
    }
    Ok(petal)
}

/// The scene's integrator, with the light among petals where that is asked for.
fn prepare(scene: &Scene) -> Result<Prepared> {
    let started = Instant::now();
    let mut warnings = Vec::new();
    let prepared = {
        let bar = Bar::new("light");
        transport::prepare(scene, &mut warnings, &bar)?
    };
    for warning in warnings {
        tracing::warn!("{warning}");
    }
    if let Some(solution) = &prepared.solution {
        tracing::info!(
            elements = solution.elements().len(),
            orders = solution.orders(),
            residual = solution.residual(),
            seconds = started.elapsed().as_secs_f32(),
            "light among petals"
        );
    }
    Ok(prepared)
}

/// What filters the noise.
enum Denoiser {
    Off,
    Oidn(Oidn),
    Filter,
}

impl Denoiser {
    /// Chosen before the render, so that a wrong path costs no time.
    fn new(args: &Args, scene: &Scene, global: Global) -> Result<Self> {
        if !scene.render.denoise {
            return match &args.oidn {
                Some(_) => Err(Error::invalid("--oidn", "goes with --denoise, or `render.denoise = true`")),
                None => Ok(Self::Off),
            };
        }
        Ok(match Oidn::find(args.oidn.as_deref())? {
            Some(oidn) => Self::Oidn(oidn),
            None => {
                let how = oidn::HOW_TO_GET;
                progress::say(
                    global,
                    &format!("Open Image Denoise is not there ({how}); a plain filter is used"),
                );
                Self::Filter
            }
        })
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Off => "",
            Self::Oidn(_) => "Open Image Denoise",
            Self::Filter => "non-local means",
        }
    }

    fn run(&self, film: &Film) -> Result<Option<Vec<[f32; 3]>>> {
        let started = Instant::now();
        let light = match self {
            Self::Off => return Ok(None),
            Self::Oidn(oidn) => oidn.denoise(&Noisy::new(film))?,
            Self::Filter => denoise(&Noisy::new(film)),
        };
        tracing::info!(by = self.name(), seconds = started.elapsed().as_secs_f32(), "denoised");
        Ok(Some(light))
    }
}

fn encode(
    format: &str,
    film: &Film,
    denoised: Option<&[[f32; 3]]>,
    scene: &Scene,
    metadata: &io::exr::Metadata,
) -> Result<Vec<u8>> {
    if format == "exr" {
        return match denoised {
            Some(light) => io::exr::write_denoised(film, light, metadata),
            None => io::exr::write(film, metadata),
        };
    }
    let screen = match denoised {
        Some(light) => scene.view.develop(film, light),
        None => scene.view.develop(film, &film.beauty()),
    };
    io::png::write_screen((film.width(), film.height()), &screen, io::png::Depth::Eight)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crops() {
        let crop = parse_crop("0.25, 0.75,0,1").expect("valid");
        assert_eq!((crop.x, crop.y), ((0.25, 0.75), (0.0, 1.0)));
        for bad in [
            "",
            "0,1",
            "0,1,0,2",
            "-0.1,1,0,1",
            "0.5,0.2,0,1",
            "0,0,0,1",
            "nan,1,0,1",
            "0,1,0,1,1",
            "a,b,c,d",
        ] {
            assert!(parse_crop(bad).is_err(), "{bad}");
        }
    }
}

//! `rosarium light`.

use std::path::PathBuf;
use std::time::Instant;

use clap::ValueEnum;
use rosarium::geometry::Mesh;
use rosarium::io::sensors_csv::{self, Reading, Sensor};
use rosarium::io::{self, light_netcdf, light_table};
use rosarium::scene::Scene;
use rosarium::spectrum::band::lux_of_one;
use rosarium::spectrum::{Band, BandGrid};
use rosarium::transport::light::view::ViewSettings;
use rosarium::transport::light::{Per, Readout};
use rosarium::transport::radiosity::{self, Quantity, RadiositySettings};
use rosarium::{Error, Result};

use crate::input::Overrides;
use crate::light_report::{Report, Run};
use crate::output::{self, Output};
use crate::progress::Bar;
use crate::render::{compiled, parse_exposure};
use crate::{Global, Outcome, progress};

/// Compute the light that each organ receives, absorbs and lets through.
///
/// Radiosity with transmission: diffuse light through and between petals, of any order, in bands of wavelengths. Prints where
/// the light of each band went, and writes tables in W/m2 and in umol photons/m2/s, maps, readings of sensors, and meshes
/// with the light in their colours.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Lights' spectral values are W m-2 nm-1 (radiance: per sr): an irradiance of 1 in the scene stands for 73.0 klx, the ground
in full daylight. --unit-lx says otherwise.

Exit code 1 if the light did not converge; what was computed is written all the same.

Examples:
  rosarium light -o light.csv                                        the built-in rose, PAR, a row per organ and side
  rosarium light scenes/rose.toml -o light.csv --bands 400-500,500-600,600-700 --plot light.png
  rosarium light scenes/rose.toml -o light.nc --per triangle --unit-lx 20000
  rosarium light --sensor 0,0,80,0,0,1 --sensors places.csv -o light.csv   also writes light-sensors.csv
  rosarium light --bake rose.glb --json")]
pub(crate) struct Args {
    /// Scene file. Default: the built-in rose.
    scene: Option<PathBuf>,
    /// Table to write: .csv or .nc (NetCDF). Repeatable.
    #[arg(short, long, value_name = "FILE")]
    output: Vec<PathBuf>,
    /// What a row of the table is about.
    #[arg(long, value_enum, default_value = "organ")]
    per: PerName,
    /// Bands LOW-HIGH within 380 to 780 nm, each with its own rows. Repeatable.
    #[arg(
        long,
        value_name = "NM-NM,...",
        value_delimiter = ',',
        default_value = "400-700",
        allow_hyphen_values = true
    )]
    bands: Vec<String>,
    /// Each band is cut into equal cells of at most this width; light is computed at their middles.
    #[arg(long, value_name = "NM", default_value_t = 10.0, allow_negative_numbers = true)]
    step_nm: f64,
    /// Illuminance that an irradiance of 1 in the scene stands for. Default: 72983 lx, 1 W m-2 nm-1 in the mean that the eye
    /// takes.
    #[arg(long, value_name = "LX", allow_negative_numbers = true)]
    unit_lx: Option<f64>,
    /// Picture of the light on what the camera sees, in false colours: .png.
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// What --plot shows, of the first band.
    #[arg(long, value_enum, default_value = "incident", requires = "plot")]
    quantity: QuantityName,
    /// Show photons in --plot, umol/m2/s instead of W/m2.
    #[arg(long, requires = "plot")]
    photons: bool,
    /// Value of the brightest colour of --plot. Default: a round number.
    #[arg(long, value_name = "X", requires = "plot", allow_negative_numbers = true, value_parser = positive)]
    plot_max: Option<f64>,
    /// Mesh with the light that leaves each side as colours of its vertices: .glb (unlit) or .ply. Repeatable.
    #[arg(long, value_name = "FILE")]
    bake: Vec<PathBuf>,
    /// Exposure of --bake in stops, instead of the scene's.
    #[arg(long, value_name = "EV", requires = "bake", allow_negative_numbers = true, value_parser = parse_exposure)]
    exposure: Option<f64>,
    /// Sensors: CSV with the columns x_mm,y_mm,z_mm,nx,ny,nz and perhaps name.
    #[arg(long, value_name = "FILE")]
    sensors: Option<PathBuf>,
    /// A sensor: place, mm, and normal. Repeatable.
    #[arg(long, value_name = "X,Y,Z,NX,NY,NZ", allow_hyphen_values = true)]
    sensor: Vec<String>,
    /// Directions per sensor, of each of two kinds.
    #[arg(long, value_name = "N", default_value_t = 4096, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    sensor_samples: u32,
    /// Print one JSON object instead of lines.
    #[arg(long)]
    json: bool,
    /// Petal for every petal of the scene, instead of the scene's: a preset, or a petal file such as `fit` writes.
    #[arg(long, value_name = "NAME|FILE")]
    petal: Option<String>,
    /// About how many elements light is exchanged between, instead of the scene's (render.radiosity.elements).
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    elements: Option<u32>,
    /// Rays from each side of an element, instead of the scene's.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    rays: Option<u32>,
    /// Samples of every light for each side of an element, instead of the scene's.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    light_samples: Option<u32>,
    /// End when this share of the direct light is still under way, instead of the scene's.
    #[arg(long, value_name = "X", allow_negative_numbers = true)]
    residual: Option<f64>,
    /// ... or after this many orders of scattering, not converged, instead of the scene's.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    max_orders: Option<u32>,
    /// Seed of all samples, instead of the scene's.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    seed: Option<u64>,
    /// Most memory of the solution, such as 2GiB or 500MiB, instead of the scene's; what needs more is refused beforehand.
    #[arg(long, value_name = "SIZE", allow_negative_numbers = true, value_parser = memory)]
    memory: Option<u64>,
    /// Folder that keeps petals that were measured. Default: rosarium in the user's cache folder.
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    #[command(flatten)]
    overrides: Overrides,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PerName {
    /// Each organ, and each shape that is none.
    Organ,
    /// Each petal.
    Petal,
    /// Each shape of the scene file.
    Shape,
    /// Each triangle.
    Triangle,
    /// Each element of the solution.
    Element,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum QuantityName {
    /// Light that arrives.
    Incident,
    /// What of it is absorbed.
    Absorbed,
    /// What of it leaves from the other side.
    Transmitted,
}

fn positive(argument: &str) -> Result<f64, String> {
    let value = argument.parse::<f64>().ok();
    value.filter(|v| (1e-30..=1e30).contains(v)).ok_or_else(|| "not a positive number".to_owned())
}

/// Bytes, with a unit.
fn memory(argument: &str) -> Result<u64, String> {
    let text = argument.trim();
    let units = [("KiB", 10), ("MiB", 20), ("GiB", 30), ("TiB", 40)];
    let (number, shift) =
        units.iter().find_map(|(unit, shift)| Some((text.strip_suffix(unit)?, *shift))).unwrap_or((text, 0));
    match number.trim().parse::<f64>() {
        Ok(v) if v > 0.0 && v * 2f64.powi(shift) < 2f64.powi(60) => Ok((v * 2f64.powi(shift)) as u64),
        _ => Err("expected a size such as 500MiB or 2GiB".to_owned()),
    }
}

/// The flag of what the library names by its own key.
fn at_flag(error: Error) -> Error {
    match error {
        Error::Invalid { at, what } => match at.as_str() {
            "bands" | "step_nm" | "unit_lx" | "elements" | "rays" | "light_samples" | "residual"
            | "memory" | "per" => Error::invalid(format!("--{}", at.replace('_', "-")), what),
            _ => Error::Invalid { at, what },
        },
        other => other,
    }
}

fn bands(args: &Args) -> Result<Vec<Band>> {
    let parse = |text: &String| {
        text.parse::<Band>().map_err(|e| match e {
            Error::Invalid { at, what } => Error::invalid(format!("--bands {at}"), what),
            other => other,
        })
    };
    args.bands.iter().map(parse).collect()
}

fn sensors(args: &Args) -> Result<Vec<Sensor>> {
    let mut sensors = match &args.sensors {
        Some(path) => {
            let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
            sensors_csv::read(&bytes, &path.display().to_string())?
        }
        None => Vec::new(),
    };
    for text in &args.sensor {
        let at = format!("--sensor {text}");
        let numbers: Result<Vec<f64>, _> = text.split(',').map(|n| n.trim().parse()).collect();
        let numbers = numbers.ok().and_then(|n| <[f64; 6]>::try_from(n).ok());
        let numbers = numbers.ok_or_else(|| Error::invalid(&at, "expected six numbers X,Y,Z,NX,NY,NZ"))?;
        sensors.push(Sensor::new((sensors.len() + 1).to_string(), numbers, &at)?);
    }
    Ok(sensors)
}

pub(crate) fn run(args: &Args, global: Global) -> Result<Outcome> {
    let outputs = Output::prepare_all("--output", &args.output, &["csv", "nc"])?;
    let bake = Output::prepare_all("--bake", &args.bake, &["glb", "ply"])?;
    let plot = args.plot.as_ref().map(|p| Output::prepare("--plot", p, &["png"])).transpose()?;
    let bands = bands(args)?;
    let grid = BandGrid::new(&bands, args.step_nm).map_err(at_flag)?;
    let unit_lx = args.unit_lx.unwrap_or_else(lux_of_one);
    if !(unit_lx > 0.0 && unit_lx.is_finite()) {
        return Err(Error::invalid("--unit-lx", format!("{unit_lx} lx: expected a positive number")));
    }
    let sensors = sensors(args)?;
    let beside = match outputs.iter().find(|o| o.format == "csv") {
        Some(csv) if !sensors.is_empty() => Some(csv.beside("sensors")?),
        _ => None,
    };
    let scene = compiled(
        args.scene.as_deref(),
        args.petal.as_deref(),
        &args.overrides,
        args.cache.clone(),
        global,
        |_| {},
    )?;
    if !outputs.is_empty() {
        args.per.per().check(&scene).map_err(at_flag)?;
    }
    let of_scene = RadiositySettings::of(&scene.render);
    let settings = RadiositySettings {
        elements: args.elements.unwrap_or(of_scene.elements),
        rays: args.rays.unwrap_or(of_scene.rays),
        light_samples: args.light_samples.unwrap_or(of_scene.light_samples),
        residual: args.residual.unwrap_or(of_scene.residual),
        max_orders: args.max_orders.unwrap_or(of_scene.max_orders),
        seed: args.seed.unwrap_or(of_scene.seed),
        memory_bytes: args.memory.unwrap_or(of_scene.memory_bytes),
        ..of_scene
    };
    // Colours need all that is visible.
    let all = if bake.is_empty() { bands.clone() } else { [&bands[..], &[Band::VISIBLE]].concat() };
    let all = BandGrid::new(&all, args.step_nm).map_err(at_flag)?;

    let started = Instant::now();
    let mut warnings = Vec::new();
    let solution = {
        let bar = Bar::new("light");
        radiosity::solve(&scene, all.wavelengths_nm(), &settings, &mut warnings, &bar).map_err(at_flag)?
    };
    let seconds = started.elapsed().as_secs_f64();
    // Stopped while the orders were added up: what is there is told and written.
    let stopped = progress::stopped();
    warnings.iter().for_each(|w| tracing::warn!("{w}"));
    let readout = Readout::new(&scene, &solution, &grid, unit_lx).map_err(at_flag)?;
    let run = Run { scene: name(args), unit_lx, seconds };
    let about = about(args, &run, &scene, &settings);

    let readings: Vec<Reading> = match stopped || sensors.is_empty() {
        true => Vec::new(),
        false => readout.sensors(&sensors, args.sensor_samples, settings.seed, &Bar::new("sensors"))?,
    };
    if !outputs.is_empty() {
        let table = readout.table(args.per.per(), about.clone()).map_err(at_flag)?;
        for output in &outputs {
            let bytes = match output.format {
                "csv" => light_table::csv(&table)?.into_bytes(),
                _ => light_netcdf::write(&table, &readings)?,
            };
            output.write(&bytes)?;
        }
    }
    if let Some(output) = beside.filter(|_| !readings.is_empty()) {
        output.write(sensors_csv::write(&readings, &bands, &about)?.as_bytes())?;
    }
    if let Some(output) = plot.filter(|_| !stopped) {
        let settings = ViewSettings {
            quantity: args.quantity.quantity(),
            band: 0,
            photons: args.photons,
            max: args.plot_max,
            samples: 8,
        };
        output.write(&readout.map(&settings, &Bar::new("plot"))?)?;
    }
    if !bake.is_empty() {
        write_baked(&bake, &readout, args, &scene)?;
    }
    let report =
        Report { run, solution: &solution, balances: readout.balances(), readings: &readings, warnings };
    output::print(report.text(args.json)?.as_bytes())?;
    if stopped {
        progress::say(global, "stopped before the light converged; that is what was written");
        return Ok(Outcome::Stopped);
    }
    if !solution.converged() {
        progress::say(
            global,
            &format!(
                "not converged: after {} orders {:.1e} of the direct light is still under way, more than --residual {:e}",
                solution.orders(),
                solution.residual(),
                settings.residual
            ),
        );
        return Ok(Outcome::CheckFailed);
    }
    Ok(Outcome::Done)
}

impl PerName {
    fn per(self) -> Per {
        match self {
            PerName::Organ => Per::Organ,
            PerName::Petal => Per::Petal,
            PerName::Shape => Per::Shape,
            PerName::Triangle => Per::Triangle,
            PerName::Element => Per::Element,
        }
    }
}

impl QuantityName {
    fn quantity(self) -> Quantity {
        match self {
            QuantityName::Incident => Quantity::Incident,
            QuantityName::Absorbed => Quantity::Absorbed,
            QuantityName::Transmitted => Quantity::Transmitted,
        }
    }
}

fn name(args: &Args) -> String {
    args.scene
        .as_ref()
        .map_or_else(|| rosarium::scene::DEFAULT_SCENE_NAME.to_owned(), |p| p.display().to_string())
}

/// Header of the tables. What repeats: no time, no place.
fn about(args: &Args, run: &Run, scene: &Scene, settings: &RadiositySettings) -> Vec<String> {
    vec![
        format!("Rosarium {} light of {}, scene {:032x}.", env!("CARGO_PKG_VERSION"), run.scene, scene.scene_hash),
        "Radiosity with transmission: diffuse light of all orders. Values are means over a side of the surface.".into(),
        "w_m2: W/m2 of surface; umol_m2_s: umol photons/m2/s; incident on, absorbed of, transmitted of the light".into(),
        "that arrives on this side, in the band; absorbed_w: W of the whole group.".into(),
        format!(
            "An irradiance of 1 in the scene stands for {} lx; cells of {} nm; {} elements, {} rays, {} light samples, seed {}.",
            run.unit_lx,
            args.step_nm,
            settings.elements,
            settings.rays,
            settings.light_samples,
            settings.seed
        ),
    ]
}

fn write_baked(outputs: &[Output], readout: &Readout, args: &Args, scene: &Scene) -> Result<()> {
    let exposure_ev = args.exposure.unwrap_or(scene.film.exposure_ev) as f32;
    let baked = readout.bake(args.step_nm, exposure_ev, scene.film.tone_map)?;
    let parts: Vec<(&str, &Mesh)> = baked.iter().map(|p| (p.name.as_str(), &p.mesh)).collect();
    let colors: Vec<Vec<[f32; 3]>> = baked.iter().map(|p| p.colors.clone()).collect();
    for output in outputs {
        let bytes = match output.format {
            "ply" => io::ply::write_colored(&parts, &colors)?,
            _ => io::gltf::write_unlit(&parts, &colors)?,
        };
        output.write(&bytes)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_of_memory() {
        assert_eq!(
            (memory("2GiB"), memory("500 MiB"), memory("1e6")),
            (Ok(2 << 30), Ok(500 << 20), Ok(1_000_000))
        );
        for bad in ["", "GiB", "0", "-1GiB", "nan", "inf", "1e30TiB", "2GB"] {
            assert!(memory(bad).is_err(), "{bad}");
        }
    }
}

//! `rosarium compare`.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use glam::UVec2;
use rosarium::film::PixelRect;
use rosarium::io::{false_color, image};
use rosarium::validate::flip::{PIXELS_PER_DEGREE, PIXELS_PER_DEGREE_RANGE};
use rosarium::validate::pictures::{
    Difference, NoiseTest, Picture, Settings, difference, round_limit, signed_map,
};
use rosarium::{Error, Result};
use serde_json::{Value, json};

use crate::output::{self, Output};
use crate::render::{Crop, parse_crop};
use crate::{Global, Outcome, progress, report};

/// Compare a picture with a reference: how far apart, and does noise explain it.
///
/// Prints RMSE, relMSE, the difference of the means, FLIP (what an eye sees), and z tests where the EXR of
/// `rosarium render` brings the variance of each pixel. Numbers are of linear light; PNG and JPEG are decoded first.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Measures (--metric), over pixels and channels, x of A and r of B:
  flip    mean of FLIP, 0 to 1: HDR-FLIP if both are EXR or HDR, else LDR-FLIP of the clipped pictures
  relmse  mean of (x - r)^2 / (r^2 + epsilon)
  rmse    root of the mean of (x - r)^2
  mean    largest |mean x / mean r - 1| of red, green, blue and luminance
  z       probability that noise makes such differences: worst pixel and mean, corrected for their number; it fails
          below the tolerance. With less than some hundred samples per pixel the worst pixel of right pictures may fail
  z-mean  the same of the means alone, which few samples do not harm

Exit code 1 if the measure is beyond --tolerance, or a pixel is not a finite number.

Examples:
  rosarium compare a.exr b.exr
  rosarium compare a.png b.png --tolerance 0.05                 FLIP
  rosarium compare a.exr b.exr --metric mean --tolerance 0.003
  rosarium compare a.exr b.exr --metric z --tolerance 1e-3
  rosarium compare a.exr b.exr --plot signed -o difference.png
  rosarium compare a.exr b.exr --layer indirect --json")]
pub(crate) struct Args {
    /// Picture: .exr, .png, .hdr or .jpg.
    #[arg(value_name = "A")]
    image: PathBuf,
    /// Reference, of the same size.
    #[arg(value_name = "B")]
    reference: PathBuf,
    /// Exit with code 1 where the measure is larger than this (z, z-mean: smaller).
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = tolerance)]
    tolerance: Option<f64>,
    /// Measure that --tolerance is for. Default: flip, which has one scale for all pictures.
    #[arg(long, value_name = "NAME", requires = "tolerance")]
    metric: Option<Metric>,
    /// Picture of the differences to write: .png.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// What --output shows: FLIP, or the luminance's (x - r) / sqrt(r^2 + epsilon), red where A is brighter.
    #[arg(long, value_name = "NAME", default_value = "flip", requires = "output")]
    plot: Plot,
    /// Value of the colours' end. Default: 1 for flip; for signed, a round number that 1 % of the pixels exceed.
    #[arg(long, value_name = "X", requires = "output", allow_negative_numbers = true, value_parser = positive)]
    range: Option<f64>,
    /// Layer of both EXR: direct, indirect, albedo, or another with channels NAME.R, NAME.G, NAME.B.
    #[arg(long, value_name = "NAME", default_value = "beauty")]
    layer: String,
    /// Part of the pictures, as fractions of their width and height from the top left.
    #[arg(long, value_name = "X0,X1,Y0,Y1", allow_hyphen_values = true, value_parser = parse_crop)]
    crop: Option<Crop>,
    /// Added to the squared reference in relMSE, so that dark pixels do not count too much.
    #[arg(long, value_name = "X", default_value_t = 1e-2, allow_negative_numbers = true, value_parser = positive)]
    epsilon: f64,
    /// Pixels per degree of the viewer's eye, for FLIP. Default: a 0.7 m wide screen of 3840 pixels, seen from 0.7 m.
    #[arg(long, value_name = "N", default_value_t = PIXELS_PER_DEGREE, hide_default_value = true, allow_negative_numbers = true, value_parser = pixels_per_degree)]
    pixels_per_degree: f32,
    /// Print one JSON object instead of lines.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
enum Metric {
    #[default]
    Flip,
    Relmse,
    Rmse,
    Mean,
    Z,
    ZMean,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Plot {
    Flip,
    Signed,
}

/// Level at which the z tests are judged when they are only printed.
const SIGNIFICANCE: f64 = 1e-3;
const CHANNELS: [&str; 4] = ["R", "G", "B", "luminance"];

fn number(argument: &str, allowed: impl Fn(f64) -> bool, what: &str) -> Result<f64, String> {
    argument.parse::<f64>().ok().filter(|v| v.is_finite() && allowed(*v)).ok_or_else(|| what.to_owned())
}

fn tolerance(argument: &str) -> Result<f64, String> {
    number(argument, |v| v >= 0.0, "not a number of at least 0")
}

fn positive(argument: &str) -> Result<f64, String> {
    // Also after rounding to 32 bits.
    number(argument, |v| (1e-30..=1e30).contains(&v), "not a positive number")
}

fn pixels_per_degree(argument: &str) -> Result<f32, String> {
    let (low, high) = PIXELS_PER_DEGREE_RANGE;
    let inside = |v: f64| (f64::from(low)..=f64::from(high)).contains(&v);
    number(argument, inside, &format!("not a number within {low} to {high}")).map(|v| v as f32)
}

/// What the measure of `--metric` came to.
struct Verdict {
    name: &'static str,
    value: f64,
    tolerance: f64,
    passed: bool,
}

pub(crate) fn run(args: &Args, global: Global) -> Result<Outcome> {
    let (text, outcome) = compare(args, global)?;
    output::print(text.as_bytes())?;
    Ok(outcome)
}

/// Compares, and writes the picture that was asked for; returns what is to be printed.
pub(crate) fn compare(args: &Args, global: Global) -> Result<(String, Outcome)> {
    let output = args.output.as_deref().map(|p| Output::prepare("--output", p, &["png"])).transpose()?;
    let image = read(args, &args.image)?;
    let reference = read(args, &args.reference)?;
    if (image.width, image.height) != (reference.width, reference.height) {
        let what = format!(
            "{} x {} pixels, but {} has {} x {}",
            image.width,
            image.height,
            args.reference.display(),
            reference.width,
            reference.height
        );
        return Err(Error::invalid(args.image.display().to_string(), what));
    }
    if image.origin != reference.origin {
        tracing::warn!(
            "these are different parts: one begins at {:?}, the other at {:?}",
            image.origin,
            reference.origin
        );
    }
    let (image, reference) = (cropped(args, image)?, cropped(args, reference)?);
    if image.is_light != reference.is_light {
        tracing::warn!(
            "one picture is of light, the other of a screen: FLIP clips both to 0 to 1, without a tone curve"
        );
    }
    if let Some(text) = refuse_bad_pixels(args, &image, &reference, global) {
        return Ok((text, Outcome::CheckFailed));
    }
    let settings = Settings { epsilon: args.epsilon, pixels_per_degree: args.pixels_per_degree };
    let difference = difference(&image, &reference, &settings)?;
    let verdict = verdict(args, &difference)?;
    if let Some(output) = &output {
        output.write(&plot(args, &image, &reference, &difference)?)?;
    }
    let text = if args.json {
        format!("{}\n", for_programs(args, &image, &difference, verdict.as_ref()))
    } else {
        for_people(args, &image, &difference)
    };
    match verdict {
        Some(v) if !v.passed => {
            let beyond = format!("{}: {:.4e} is beyond the tolerance {:e}", v.name, v.value, v.tolerance);
            progress::say(global, &beyond);
            Ok((text, Outcome::CheckFailed))
        }
        _ => Ok((text, Outcome::Done)),
    }
}

fn read(args: &Args, path: &Path) -> Result<Picture> {
    let bytes = fs::read(path).map_err(|e| Error::io(path, e))?;
    let layer = if args.layer == "beauty" { "" } else { &args.layer };
    Picture::read(&bytes, layer, image::MAX_PIXELS).map_err(|e| match e {
        Error::Invalid { at, what } => Error::invalid(path.display().to_string(), format!("{at}: {what}")),
        Error::Unsupported(what) => Error::Unsupported(format!("{}: {what}", path.display())),
        other => other,
    })
}

fn cropped(args: &Args, picture: Picture) -> Result<Picture> {
    let Some(crop) = args.crop else { return Ok(picture) };
    let size = UVec2::new(picture.width as u32, picture.height as u32);
    let part = PixelRect::from_fractions(size, crop.x, crop.y).map_err(|e| report::at_flag("--crop", e))?;
    picture.crop(part)
}

/// Measures of NaN are NaN: where there are any, that is the result, and this what is to be printed.
fn refuse_bad_pixels(args: &Args, image: &Picture, reference: &Picture, global: Global) -> Option<String> {
    let pictures = [(&args.image, image.not_finite()), (&args.reference, reference.not_finite())];
    if pictures.iter().all(|(_, bad)| bad.is_none()) {
        return None;
    }
    let mut text = String::new();
    if args.json {
        let counts = pictures.iter().map(|(_, bad)| bad.map_or(0, |b| b.0)).collect::<Vec<_>>();
        let object = json!({
            "a": args.image.display().to_string(),
            "b": args.reference.display().to_string(),
            "not_finite": counts,
            "passed": false,
        });
        text = format!("{object}\n");
    }
    for (path, bad) in pictures {
        if let Some((count, (x, y))) = bad {
            let line = format!(
                "{}: {count} pixels are not finite numbers, the first in column {x} of row {y}; nothing is compared",
                path.display()
            );
            progress::say(global, &line);
        }
    }
    Some(text)
}

fn verdict(args: &Args, difference: &Difference) -> Result<Option<Verdict>> {
    let Some(tolerance) = args.tolerance else { return Ok(None) };
    let noise = |name: &str| {
        difference.noise.as_ref().ok_or_else(|| {
            let what = "it needs two pictures of light, one of them with channels variance.R, .G, .B that are not all zero";
            Error::invalid(format!("--metric {name}"), what)
        })
    };
    let (name, value) = match args.metric.unwrap_or_default() {
        Metric::Flip => ("flip", difference.flip.mean),
        Metric::Relmse => ("relmse", difference.relmse),
        Metric::Rmse => ("rmse", difference.rmse),
        Metric::Mean => ("mean", difference.largest_mean()),
        Metric::Z => ("z", noise("z")?.p()),
        Metric::ZMean => ("z-mean", noise("z-mean")?.p_mean),
    };
    let passed = if name.starts_with('z') { value >= tolerance } else { value <= tolerance };
    Ok(Some(Verdict { name, value, tolerance, passed }))
}

fn plot(args: &Args, image: &Picture, reference: &Picture, difference: &Difference) -> Result<Vec<u8>> {
    let range = args.range.map(|v| v as f32);
    match args.plot {
        Plot::Flip => {
            let scale = false_color::Scale::Magma { max: range.unwrap_or(1.0) };
            let caption = format!("FLIP, mean {:.4}", difference.flip.mean);
            false_color::write(&difference.flip_map, image.width, scale, &caption)
        }
        Plot::Signed => {
            let map = signed_map(image, reference, args.epsilon);
            let scale = false_color::Scale::Signed { limit: range.unwrap_or_else(|| round_limit(&map)) };
            let caption = format!("Luminance: (A − B) / √(B² + {})", args.epsilon);
            false_color::write(&map, image.width, scale, &caption)
        }
    }
}

fn percent(difference: &Difference, channel: usize) -> f64 {
    100.0 * difference.means[channel].relative()
}

/// One line per measure. Writing to a String cannot fail.
fn for_people(args: &Args, image: &Picture, difference: &Difference) -> String {
    let mut out = String::new();
    let d = difference;
    let _ = writeln!(
        out,
        "{} against {}: {} x {} pixels",
        args.image.display(),
        args.reference.display(),
        image.width,
        image.height
    );
    let _ = writeln!(out, "rmse    {:.6}", d.rmse);
    let _ = writeln!(out, "relmse  {:.6}, epsilon {}", d.relmse, args.epsilon);
    let means: Vec<String> =
        CHANNELS.iter().enumerate().map(|(c, name)| format!("{name} {:+.3} %", percent(d, c))).collect();
    let _ = writeln!(out, "mean    {}", means.join(", "));
    let kind = match d.exposures {
        Some(e) => {
            format!("HDR-FLIP, {} exposures from {:+.1} to {:+.1} EV", e.count, e.start_ev, e.stop_ev)
        }
        None => "LDR-FLIP".to_owned(),
    };
    let _ = writeln!(
        out,
        "flip    {:.6}, weighted median {:.4}, largest {:.4}; {kind}",
        d.flip.mean, d.flip.weighted_median, d.flip.max
    );
    if let Some(noise) = &d.noise {
        let _ = writeln!(out, "z       {}", noise_line(noise, image.width));
    }
    out
}

fn probability(p: f64) -> String {
    if p < 1e-300 {
        "p < 1e-300".to_owned()
    } else if p < 1e-3 {
        format!("p {p:.0e}")
    } else {
        format!("p {p:.3}")
    }
}

fn noise_line(noise: &NoiseTest, width: usize) -> String {
    let verdict = |p: f64| if p >= SIGNIFICANCE { "noise" } else { "more than noise" };
    let means: Vec<String> =
        noise.channels.iter().zip(CHANNELS).map(|(t, name)| format!("{name} {:+.2}", t.mean_z)).collect();
    let (c, worst) = noise.worst();
    format!(
        "mean {}: {}, {}; worst pixel {} {:+.2} at ({}, {}): {}, {}; {:.3} % of the pixels are explained",
        means.join(", "),
        probability(noise.p_mean),
        verdict(noise.p_mean),
        CHANNELS[c],
        worst.largest_z,
        worst.pixel % width,
        worst.pixel / width,
        probability(noise.p_largest),
        verdict(noise.p_largest),
        100.0 * noise.explained
    )
}

fn for_programs(args: &Args, image: &Picture, difference: &Difference, verdict: Option<&Verdict>) -> Value {
    let d = difference;
    let means: serde_json::Map<String, Value> = CHANNELS
        .iter()
        .zip(&d.means)
        .map(|(name, m)| {
            ((*name).to_owned(), json!({ "a": m.image, "b": m.reference, "relative": m.relative() }))
        })
        .collect();
    let noise = d.noise.as_ref().map(|n| {
        let channels: Vec<Value> = n
            .channels
            .iter()
            .zip(CHANNELS)
            .map(|(t, name)| {
                json!({
                    "channel": name,
                    "mean_z": t.mean_z,
                    "p_mean": t.p_mean,
                    "worst_z": t.largest_z,
                    "worst_pixel": [t.pixel % image.width, t.pixel / image.width],
                    "p_worst": t.p_largest,
                })
            })
            .collect();
        json!({
            "p": n.p(), "p_mean": n.p_mean, "p_worst": n.p_largest, "explained": n.explained, "channels": channels,
        })
    });
    json!({
        "a": args.image.display().to_string(),
        "b": args.reference.display().to_string(),
        "layer": args.layer,
        "width": image.width,
        "height": image.height,
        "not_finite": [0, 0],
        "rmse": d.rmse,
        "relmse": d.relmse,
        "epsilon": args.epsilon,
        "mean": means,
        "flip": {
            "kind": if d.exposures.is_some() { "hdr" } else { "ldr" },
            "pixels_per_degree": args.pixels_per_degree,
            "mean": d.flip.mean,
            "weighted_median": d.flip.weighted_median,
            "max": d.flip.max,
            "exposures": d.exposures.map(|e| {
                json!({ "start_ev": e.start_ev, "stop_ev": e.stop_ev, "count": e.count })
            }),
        },
        "z": noise,
        "metric": verdict.map(|v| v.name),
        "value": verdict.map(|v| v.value),
        "tolerance": verdict.map(|v| v.tolerance),
        "passed": verdict.is_none_or(|v| v.passed),
    })
}

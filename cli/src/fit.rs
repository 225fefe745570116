//! `rosarium fit`.

use std::path::PathBuf;
use std::time::Instant;

use clap::ValueEnum;
use rosarium::fit::models::terado::Terado;
use rosarium::fit::options::{Action, Covariance, Loss, Override, Weights};
use rosarium::fit::report::{DataInfo, Report};
use rosarium::fit::{self, Audit, Model, Options, models};
use rosarium::gonio::{Measurement, Scale};
use rosarium::{Error, Result};

use crate::cell_model::CellArgs;
use crate::data::DataArgs;
use crate::output::{self, Output};
use crate::progress::Bar;
use crate::{Global, Outcome, fit_output, shell};

/// Fit models of reflection to a goniometer's table.
///
/// Finds the parameters of the cell model, and of the usual shaders, that come closest to what was measured: by
/// least squares within bounds, from several starts, with standard errors, correlations and profile-likelihood
/// intervals. `--model all` compares every model in one table.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  rosarium fit table.csv --model terado --report report.html -o petal.toml
  rosarium fit table.csv --model all
  rosarium fit table.csv --model lambert+phong,terado --plot fits.svg --residuals residuals.svg
  rosarium fit table.csv --model terado --vary height_um=20..50 --bounds n_E=2..100 --fix ks_S=0
  rosarium fit leaf.csv --columns incident_theta=sza,theta=vza,phi=vaa,value=BRF_550nm \\
      --quantity brf --azimuth lamp --series sample --model lambert,lambert+phong,terado")]
pub(crate) struct Args {
    /// Measured tables: CSV, pab pgII, MERL, UTIA, RGL, Radiance XML, Zemax. Several are one measurement.
    #[arg(value_name = "TABLE", required = true)]
    tables: Vec<PathBuf>,
    /// Models, or `all` for every one of them.
    #[arg(short, long, value_name = "NAME,...", value_delimiter = ',', default_value = "terado")]
    model: Vec<String>,
    /// Petal file (.toml) to write for `render` and `measure`. Needs one model and one series.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Report to write: .html (with plots), .json or .txt. Repeatable.
    #[arg(long, value_name = "FILE")]
    report: Vec<PathBuf>,
    /// Plot of readings and models in the planes of incidence to write: .svg or .png. Repeatable. Needs one series.
    #[arg(long, value_name = "FILE")]
    plot: Vec<PathBuf>,
    /// Plot of the best model's residuals over the hemisphere to write: .svg or .png. Repeatable. Needs one series.
    #[arg(long, value_name = "FILE")]
    residuals: Vec<PathBuf>,
    /// Print the report as JSON instead of text.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    search: SearchArgs,
    #[command(flatten)]
    cells: CellArgs,
}

/// How the parameters are searched, and their errors found.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "The fit")]
struct SearchArgs {
    /// Hold a parameter: `--fix n_S=2`. Repeatable.
    #[arg(long, value_name = "NAME=VALUE", allow_hyphen_values = true)]
    fix: Vec<String>,
    /// Bounds of a parameter: `--bounds n_E=2..100`. Repeatable.
    #[arg(long, value_name = "NAME=LOW..HIGH", allow_hyphen_values = true)]
    bounds: Vec<String>,
    /// First start of a parameter. Repeatable.
    #[arg(long, value_name = "NAME=VALUE", allow_hyphen_values = true)]
    start: Vec<String>,
    /// Make a parameter a multiple of another: `--tie ks_S=0.5*ks_E`. Repeatable.
    #[arg(long, value_name = "NAME=[FACTOR*]NAME", allow_hyphen_values = true)]
    tie: Vec<String>,
    /// One set of parameters for all series. Default: each series is a sample of its own, unless the quantity is
    /// relative; then series are readings of one sample with unknown gains.
    #[arg(long)]
    pool: bool,
    /// Weights of the residuals. Tables of `measure` are weighted by cosine unless `sigma` is asked for.
    #[arg(long, value_name = "WORD", default_value = "auto")]
    weights: WeightsWord,
    /// Error of the instrument as a share of the value, such as 3% or 0.03, where the table has no sigma.
    #[arg(long, value_name = "SHARE", value_parser = share)]
    sigma: Option<f64>,
    /// Loss of a weighted residual, as SciPy defines them.
    #[arg(long, value_name = "WORD", default_value = "linear")]
    loss: LossWord,
    /// Weighted residual at which a robust loss bends. Default: 1 with sigmas, else from the scatter.
    #[arg(long, value_name = "X")]
    loss_scale: Option<f64>,
    /// Searches, from different starts.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    starts: u32,
    /// Seed of the starts and of the bootstrap.
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Confidence of the profile-likelihood intervals; 0 leaves them out.
    #[arg(long, value_name = "LEVEL", default_value_t = 0.95)]
    intervals: f64,
    /// Bootstrap intervals from N resamples.
    #[arg(long, value_name = "N")]
    bootstrap: Option<u32>,
    /// Where standard errors come from.
    #[arg(long, value_name = "WORD", default_value = "scaled")]
    covariance: CovarianceWord,
    /// Smallest correlation that the text shows.
    #[arg(long, value_name = "R", default_value_t = 0.1)]
    correlations: f64,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum WeightsWord {
    /// 1/sigma where every reading has one, else cosine.
    Auto,
    /// 1/sigma of each reading.
    Sigma,
    /// Projected solid angle that each reading stands for.
    Cosine,
    /// All alike.
    Uniform,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
#[value(rename_all = "snake_case")]
enum LossWord {
    Linear,
    SoftL1,
    Huber,
    Cauchy,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum CovarianceWord {
    /// By the scatter of the residuals.
    Scaled,
    /// The sigmas are true.
    Absolute,
    /// For residuals whose scatter the weights do not describe.
    Sandwich,
}

/// A share of the value: `0.03` or `3%`.
fn share(argument: &str) -> Result<f64, String> {
    let (number, unit) = argument.strip_suffix('%').map_or((argument, 1.0), |n| (n, 0.01));
    match number.trim().parse::<f64>() {
        Ok(v) if v > 0.0 && v * unit <= 10.0 => Ok(v * unit),
        _ => Err("a positive share such as 0.03 or 3%".to_owned()),
    }
}

impl SearchArgs {
    fn options(&self, gains: bool) -> Result<Options> {
        let mut parameters = Vec::new();
        let mut wishes =
            |flag: &str, list: &[String], action: &dyn Fn(&str) -> Option<Action>, form: &str| {
                for argument in list {
                    let wish = argument.rsplit_once('=').and_then(|(n, v)| Some((n, action(v)?)));
                    let Some((name, action)) = wish else {
                        return Err(Error::invalid(
                            format!("{flag} {argument}"),
                            format!("not of the form {form}"),
                        ));
                    };
                    parameters.push(Override { name: name.trim().to_owned(), action });
                }
                Ok(())
            };
        wishes("--fix", &self.fix, &|v| number(v).map(Action::Fix), "NAME=VALUE")?;
        wishes("--start", &self.start, &|v| number(v).map(Action::Start), "NAME=VALUE")?;
        let bounds = |v: &str| range(v).map(|(low, high)| Action::Bounds(low, high));
        wishes("--bounds", &self.bounds, &bounds, "NAME=LOW..HIGH")?;
        wishes("--tie", &self.tie, &tie, "NAME=OTHER or NAME=FACTOR*OTHER")?;
        if !(0.0..1.0).contains(&self.intervals) {
            return Err(Error::invalid("--intervals", "the level lies between 0 (none) and 1, such as 0.95"));
        }
        Ok(Options {
            weights: match self.weights {
                WeightsWord::Auto => Weights::Auto,
                WeightsWord::Sigma => Weights::Sigma,
                WeightsWord::Cosine => Weights::Cosine,
                WeightsWord::Uniform => Weights::Uniform,
            },
            relative_sigma: self.sigma,
            loss: match self.loss {
                LossWord::Linear => Loss::Linear,
                LossWord::SoftL1 => Loss::SoftL1,
                LossWord::Huber => Loss::Huber,
                LossWord::Cauchy => Loss::Cauchy,
            },
            loss_scale: self.loss_scale,
            parameters,
            gains,
            starts: self.starts as usize,
            seed: self.seed,
            level: (self.intervals > 0.0).then_some(self.intervals),
            bootstrap: self.bootstrap,
            covariance: match self.covariance {
                CovarianceWord::Scaled => Covariance::Scaled,
                CovarianceWord::Absolute => Covariance::Absolute,
                CovarianceWord::Sandwich => Covariance::Sandwich,
            },
        })
    }
}

fn number(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|v: &f64| v.is_finite())
}

/// `LOW..HIGH`.
pub(crate) fn range(text: &str) -> Option<(f64, f64)> {
    let (low, high) = text.split_once("..")?;
    Some((number(low)?, number(high)?))
}

/// `OTHER` or `FACTOR*OTHER`.
fn tie(text: &str) -> Option<Action> {
    let (factor, to) = text.split_once('*').map_or((Some(1.0), text), |(f, to)| (number(f), to));
    let to = to.trim();
    (!to.is_empty()).then_some(Action::Tie { to: to.to_owned(), factor: factor? })
}

pub(crate) fn run(args: &Args, global: Global) -> Result<Outcome> {
    output::print(fit(args, global, &shell::command())?.as_bytes())
}

/// Fits, and writes the files that were asked for; returns what is to be printed. `command` is the one that makes the same
/// fit again.
pub(crate) fn fit(args: &Args, global: Global, command: &str) -> Result<String> {
    let petal = args.output.as_deref().map(|p| Output::prepare("--output", p, &["toml"])).transpose()?;
    let reports = Output::prepare_all("--report", &args.report, &["html", "json", "txt"])?;
    let plots = Output::prepare_all("--plot", &args.plot, &["svg", "png"])?;
    let residuals = Output::prepare_all("--residuals", &args.residuals, &["svg", "png"])?;
    let data = args.data.load(&args.tables)?;
    let relative = data.measurement.scale == Scale::RelativePerSeries;
    let mut options = args.search.options(relative)?;
    if data.counted && options.weights == Weights::Auto && options.relative_sigma.is_none() {
        // A bin that a few paths more had reached would have a larger sigma: 1 / sigma pulls the fit down.
        options.weights = Weights::Cosine;
    }
    let names = model_names(&args.model, &data.measurement)?;
    let measurement = seen_by(&names, &data.measurement);
    let models = build(&names, &args.cells, global)?;
    let parts = parts(&measurement, args.search.pool || relative);
    if petal.is_some() && (models.len() > 1 || parts.len() > 1) {
        let what = format!(
            "a petal comes from one fit; here are {} models x {} series: choose by --model, --select or --pool",
            models.len(),
            parts.len()
        );
        return Err(Error::invalid("--output", what));
    }
    if parts.len() > 1 && !(plots.is_empty() && residuals.is_empty()) {
        let what = format!("a plot shows one series; here are {}: choose by --select or --pool", parts.len());
        return Err(Error::invalid(if plots.is_empty() { "--residuals" } else { "--plot" }, what));
    }

    let bar = Bar::new("fit");
    let (step, steps) = (1_000_000, 1_000_000 * (models.len() * parts.len()) as u64);
    let mut fitted = Vec::new();
    for (p, part) in parts.iter().enumerate() {
        let projected_sr = part.projected_solid_angles_sr();
        let (mut fits, mut audits) = (Vec::new(), Vec::new());
        for (m, model) in models.iter().enumerate() {
            let before = step * (p * models.len() + m) as u64;
            let advance = |done: u64, total: u64| bar.step(before + done * step / total.max(1), steps);
            let began = Instant::now();
            let fit = fit::fit(&**model, part, &own(&options, &**model, models.len()), &advance)?;
            tracing::info!(model = model.name(), ms = began.elapsed().as_secs_f64() * 1e3, "fitted");
            audits.push(Audit::new(&**model, &fit, part, &projected_sr)?);
            fits.push(fit);
        }
        let info = DataInfo::new(&data.name, &data.bytes, &data.quantity, part);
        fitted.push(Report::new(Some(command.to_owned()), info, fits, audits));
    }
    drop(bar);

    for output in &reports {
        fit_output::write_report(output, &fitted, &parts, &models, args.search.correlations, global)?;
    }
    if let (Some(output), [report], [part]) = (&petal, fitted.as_slice(), parts.as_slice()) {
        fit_output::write_petal(output, report, part, &args.cells, global)?;
    }
    if let ([report], [part]) = (fitted.as_slice(), parts.as_slice()) {
        if !plots.is_empty() {
            fit_output::write_pictures(&plots, &fit_output::plot(report, part, &models)?, global)?;
        }
        if !residuals.is_empty() {
            fit_output::write_pictures(&residuals, &fit_output::residuals(report, part)?, global)?;
        }
    }
    if args.json {
        return fit_output::json(&fitted);
    }
    let compare = args.model.iter().any(|m| m == "all");
    Ok(fit_output::text(&fitted, compare, args.search.correlations))
}

/// Names of the models to fit; `all` are those that can explain the readings.
fn model_names(asked: &[String], measurement: &Measurement) -> Result<Vec<String>> {
    let transmits = measurement.has_transmission();
    let reflecting = || models::CLOSED_FORM.iter().copied().chain(["terado"]);
    let transmitting = || models::CLOSED_FORM_TRANSMITTING.iter().copied().chain(["terado+transmission"]);
    let mut names: Vec<String> = Vec::new();
    for name in asked.iter().map(|n| n.trim()) {
        let known = reflecting().chain(transmitting()).any(|k| k == name);
        let reflects = measurement.readings.iter().any(|r| r.wi.z * r.wo.z > 0.0);
        match name {
            "all" if reflects => names.extend(reflecting().map(String::from)),
            "all" => names.extend(transmitting().map(String::from)),
            _ if known => names.push(name.to_owned()),
            _ => {
                let known: Vec<&str> = reflecting().chain(transmitting()).chain(["all"]).collect();
                let what = format!("`{name}` is no model; the models are {}", known.join(", "));
                return Err(Error::invalid("--model", what));
            }
        }
        if name.ends_with("transmission") && !transmits {
            let what =
                format!("`{name}` needs readings of transmitted light (theta above 90 deg); there are none");
            return Err(Error::invalid("--model", what));
        }
    }
    let mut seen = std::collections::BTreeSet::new();
    names.retain(|n| seen.insert(n.clone()));
    Ok(names)
}

/// The readings that the models speak of: without a model of transmission, those of reflected light; of both sides of
/// the sheet the upper one, where it was measured.
fn seen_by(names: &[String], measurement: &Measurement) -> Measurement {
    if names.iter().any(|n| n.ends_with("transmission")) {
        return measurement.subset(|_| true);
    }
    let above = measurement.readings.iter().any(|r| r.wi.z > 0.0 && r.wo.z > 0.0);
    let mut seen = measurement.subset(|r| r.wi.z * r.wo.z > 0.0 && (r.wi.z > 0.0) == above);
    let left = measurement.readings.len() - seen.readings.len();
    if left > 0 {
        let side = if above { "upper" } else { "lower" };
        seen.notes.push(format!(
            "{left} readings of transmitted light or of the other side are left out: the models speak of reflection from \
             the {side} side"
        ));
    }
    seen
}

/// One measurement per series, or one of all of them.
fn parts(measurement: &Measurement, pooled: bool) -> Vec<Measurement> {
    if pooled || measurement.series.len() < 2 {
        let mut whole = measurement.clone();
        if let ([only], true) = (measurement.series.as_slice(), whole.sample.is_empty()) {
            whole.sample.clone_from(only);
        }
        return vec![whole];
    }
    let part = |s: u32| {
        let mut part = measurement.subset(|r| r.series == s);
        part.sample = part.series.first().cloned().unwrap_or_default();
        part
    };
    (0..measurement.series.len() as u32).map(part).collect()
}

/// The models, in the order of their names. The cells' table is computed once, where a model needs it.
fn build(names: &[String], cells: &CellArgs, global: Global) -> Result<Vec<Box<dyn Model>>> {
    let of_cells = |name: &String| name.starts_with("terado");
    let family = names.iter().any(of_cells).then(|| cells.family(global)).transpose()?;
    let model = |name: &String| -> Option<Box<dyn Model>> {
        match (name.as_str(), &family) {
            ("terado", Some(family)) => Some(Box::new(Terado::new(family.clone()))),
            ("terado+transmission", Some(family)) => Some(Terado::with_transmission(family.clone())),
            _ => models::by_name(name),
        }
    };
    names
        .iter()
        .map(|n| model(n).ok_or_else(|| Error::invalid("--model", format!("`{n}` is no model"))))
        .collect()
}

/// The options for one of several models: wishes for parameters that only others have are not its business.
fn own(options: &Options, model: &dyn Model, models: usize) -> Options {
    let mut own = options.clone();
    if models > 1 {
        let base = |name: &str| name.split('[').next().unwrap_or(name).to_owned();
        let has =
            |name: &str| base(name) == "gain" || model.parameters().iter().any(|p| p.name == base(name));
        own.parameters.retain(|wish| {
            has(&wish.name) && if let Action::Tie { to, .. } = &wish.action { has(to) } else { true }
        });
    }
    own
}

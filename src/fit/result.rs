//! What a fit found. Plain numbers, ready for reports; never NaN: what cannot be given is `None`.

use serde::Serialize;

/// What became of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// Found inside its bounds.
    Free,
    /// Held at the user's value.
    Fixed,
    /// A multiple of another parameter.
    Tied,
    /// Found at its lower bound: no standard error, a one-sided interval.
    AtLower,
    /// Found at its upper bound: no standard error, a one-sided interval.
    AtUpper,
    /// The data do not determine it: the value is one of many that fit as well.
    Undetermined,
}

/// One end of an interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "kind", content = "value")]
pub enum End {
    /// Beyond this value the fit is worse than the level allows.
    Limit(f64),
    /// The parameter's bound was reached before.
    Bound(f64),
}

impl End {
    /// The number.
    pub fn value(self) -> f64 {
        match self {
            End::Limit(v) | End::Bound(v) => v,
        }
    }
}

/// A profile-likelihood interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// Its confidence, such as 0.95.
    pub level: f64,
    /// Lower end.
    pub low: End,
    /// Upper end.
    pub high: End,
}

/// One parameter of a fit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fitted {
    /// Name; coefficients of several bands as `kd[550 nm]`, gains as `gain[series]`.
    pub name: String,
    /// Name in the model, without the band.
    pub parameter: String,
    /// What it is, with its unit.
    pub meaning: String,
    /// Band, where it belongs to one.
    pub band: Option<usize>,
    /// Best value.
    pub value: f64,
    /// One standard deviation; `None` where it was not varied, is at a bound, or is not determined. Errors and
    /// intervals of a tied parameter are those of what it is tied to, times the factor.
    pub standard_error: Option<f64>,
    /// Where the winning search started.
    pub start: f64,
    /// Lower bound.
    pub min: f64,
    /// Upper bound.
    pub max: f64,
    /// What became of it.
    pub state: State,
    /// For a tied parameter: `kd_S * 0.5`.
    pub tie: Option<String>,
    /// Profile-likelihood interval, where asked for.
    pub interval: Option<Interval>,
    /// Percentile interval of the bootstrap, where asked for.
    pub bootstrap: Option<[f64; 2]>,
}

/// Correlation of two varied parameters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Correlation {
    /// Index into [`Fit::parameters`].
    pub a: usize,
    /// Index into [`Fit::parameters`], larger.
    pub b: usize,
    /// From -1 to 1.
    pub correlation: f64,
}

/// A finished fit. Criteria follow lmfit: `chi2 = sum of squared weighted residuals`, reduced by `N - varied`,
/// `AIC = N ln(chi2 / N) + 2 varied`, `BIC = N ln(chi2 / N) + ln(N) varied`, `R2 = 1 - chi2 / sum (w (y - mean))^2`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fit {
    /// Model's name.
    pub model: String,
    /// Solver and settings in words.
    pub method: String,
    /// How residuals were weighted, in words.
    pub weighting: String,
    /// Did the search end at a minimum?
    pub converged: bool,
    /// First why it ended, then everything that the user should know (what the data cannot determine, ...).
    pub messages: Vec<String>,
    /// Evaluations of the model over all starts.
    pub evaluations: usize,
    /// Searches that were started, and how many of them ended at the best minimum.
    pub starts: usize,
    /// Starts that ended within 1e-6 (relative) of the best chi2.
    pub agreeing_starts: usize,
    /// Number of readings.
    pub n: usize,
    /// Number of varied parameters.
    pub varied: usize,
    /// Sum of squared weighted residuals.
    pub chi2: f64,
    /// `chi2 / (n - varied)`; `None` where no freedom is left.
    pub reduced_chi2: Option<f64>,
    /// Akaike's criterion; `None` for an exact fit.
    pub aic: Option<f64>,
    /// Bayes' criterion; `None` for an exact fit.
    pub bic: Option<f64>,
    /// Share of the variance that is explained; `None` for constant data.
    pub r2: Option<f64>,
    /// Root of the mean squared residual, weighted by solid angle x cosine, 1/sr.
    pub rmse_per_sr: f64,
    /// The same of cube roots of BSDF x cosine (closer to what eyes see), (1/sr)^(1/3).
    pub rmse_cube_root: f64,
    /// Parameters: shapes first, then coefficients band by band, then gains.
    pub parameters: Vec<Fitted>,
    /// Correlations of all pairs that were varied.
    pub correlations: Vec<Correlation>,
    /// Model at every reading, 1/sr, on the readings' scale (gains applied).
    #[serde(skip)]
    pub modelled: Vec<f64>,
    /// Weighted residual of every reading, (model - reading) x weight.
    #[serde(skip)]
    pub residuals: Vec<f64>,
}

impl Fit {
    /// Gain of a series; 1 where it was not fitted.
    pub fn gain(&self, series: &str) -> f64 {
        let name = format!("gain[{series}]");
        self.parameters.iter().find(|p| p.name == name).map_or(1.0, |p| p.value)
    }

    /// Values of the model's parameters for one band, in the model's order.
    pub fn band_values(&self, model: &dyn super::Model, band: usize) -> Vec<f64> {
        model
            .parameters()
            .iter()
            .map(|p| {
                self.parameters
                    .iter()
                    .find(|f| f.parameter == p.name && f.band.is_none_or(|b| b == band))
                    .map_or(p.start, |f| f.value)
            })
            .collect()
    }
}

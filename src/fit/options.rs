//! How to fit: weights, loss, what is held or tied, how many starts, which intervals.

pub use super::loss::Loss;
use crate::{Error, Result};

/// How residuals are weighted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Weights {
    /// 1 / sigma where every reading has one, else as `Cosine`.
    #[default]
    Auto,
    /// 1 / sigma of each reading.
    Sigma,
    /// Root of the projected solid angle that a reading stands for, scaled to mean square 1.
    Cosine,
    /// All alike.
    Uniform,
}

/// Where standard errors come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Covariance {
    /// From the scatter of the residuals: the inverse Hessian times the reduced chi2. With a robust loss outliers still
    /// count in that chi2, as in lmfit: `Sandwich` is sharper there.
    #[default]
    Scaled,
    /// Sigmas are true: the inverse Hessian itself.
    Absolute,
    /// Right also where the weights are not 1 / sigma^2: White's estimate with N / (N - varied).
    Sandwich,
}

/// What is asked of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Held at a value.
    Fix(f64),
    /// Lower and upper bound, within the model's own.
    Bounds(f64, f64),
    /// Where the first search starts.
    Start(f64),
    /// `factor` times another parameter. The name means the same band's, where it belongs to bands.
    Tie {
        /// The other parameter.
        to: String,
        /// The multiple.
        factor: f64,
    },
}

/// A wish for one parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Override {
    /// `kd` (in every band), `kd[550 nm]` (in one; goes before `kd`), or `gain[sample]`.
    pub name: String,
    /// The wish.
    pub action: Action,
}

/// Settings of a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// How residuals are weighted.
    pub weights: Weights,
    /// Known error of the instrument as a share of the value: sigma is this share of the **model's** value (and the
    /// reading's own sigma, in quadrature, where it has one), iterated until it stays. Values below 1 % of the mean
    /// count as 1 % of it. Goes with weights `Auto` or `Sigma`.
    pub relative_sigma: Option<f64>,
    /// How a weighted residual is counted.
    pub loss: Loss,
    /// Weighted residual where a robust loss bends; `None`: 1 where sigmas are known, else 1.4826 times the median size
    /// of the residuals of the fit with the linear loss.
    pub loss_scale: Option<f64>,
    /// Wishes for parameters.
    pub parameters: Vec<Override>,
    /// A free gain for every series but the first: the readings are gain x model.
    pub gains: bool,
    /// Searches: the default start, and points spread over the bounds of the shape parameters. One where there are none.
    pub starts: usize,
    /// Of the points and the bootstrap.
    pub seed: u64,
    /// Confidence of profile-likelihood intervals, such as 0.95; none without.
    pub level: Option<f64>,
    /// Replicates of the bootstrap; its percentile intervals have `level`, or 0.95.
    pub bootstrap: Option<u32>,
    /// Where standard errors come from.
    pub covariance: Covariance,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            weights: Weights::Auto,
            relative_sigma: None,
            loss: Loss::Linear,
            loss_scale: None,
            parameters: Vec::new(),
            gains: false,
            starts: 8,
            seed: 0,
            level: None,
            bootstrap: None,
            covariance: Covariance::Scaled,
        }
    }
}

impl Options {
    /// Checks what needs neither model nor readings.
    pub(crate) fn check(&self) -> Result<()> {
        let positive = |v: f64| v > 0.0 && v.is_finite();
        if let Some(s) = self.relative_sigma {
            if !(positive(s) && s <= 10.0) {
                return Err(Error::invalid("relative_sigma", format!("{s} is not between 0 and 10")));
            }
            if matches!(self.weights, Weights::Cosine | Weights::Uniform) {
                let what = "gives the weights by itself: leave `weights` at auto or sigma";
                return Err(Error::invalid("relative_sigma", what));
            }
        }
        if let Some(s) = self.loss_scale
            && !positive(s)
        {
            return Err(Error::invalid("loss_scale", format!("{s} is not a positive number")));
        }
        if let Some(l) = self.level
            && !(l > 0.0 && l < 1.0)
        {
            return Err(Error::invalid("level", format!("{l} is not between 0 and 1")));
        }
        if !(1..=10_000).contains(&self.starts) {
            return Err(Error::invalid("starts", format!("{} is not in 1-10000", self.starts)));
        }
        if let Some(b) = self.bootstrap
            && !(20..=100_000).contains(&b)
        {
            return Err(Error::invalid("bootstrap", format!("{b} is not in 20-100000 replicates")));
        }
        Ok(())
    }
}

//! All parameters of a fit: which are free, held or tied, and where the model finds them.
//!
//! A *slot* is one number of the fit: a shape, a coefficient of one band, or a gain of one series. The solver sees
//! the free slots only; `values` gives all of them.

use std::collections::HashMap;

use super::options::{Action, Options, Override};
use super::{Kind, Model, Parameter};
use crate::gonio::Measurement;
use crate::{Error, Result};

/// Gains are found between these.
const GAIN_BOUNDS: (f64, f64) = (1e-6, 1e6);

/// Why a slot has its value.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Role {
    Free,
    Fixed,
    /// A multiple of another slot.
    Tied {
        to: usize,
        factor: f64,
    },
}

/// One number of a fit.
#[derive(Clone, Debug)]
pub(crate) struct Slot {
    pub(crate) name: String,
    pub(crate) parameter: Parameter,
    pub(crate) band: Option<usize>,
    pub(crate) role: Role,
    /// Did the user give the start?
    pub(crate) start_is_given: bool,
    pub(crate) is_gain: bool,
}

/// All slots: shapes, then coefficients band by band, then gains.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    pub(crate) slots: Vec<Slot>,
    /// Slots that the solver moves.
    pub(crate) free: Vec<usize>,
    /// For each slot the free variable that it is a multiple of, and the factor.
    pub(crate) root: Vec<Option<(usize, f64)>>,
    /// For each band the slots of the model's parameters, in the model's order; empty where it has no readings.
    pub(crate) of_band: Vec<Vec<usize>>,
    /// For each series its gain's slot.
    pub(crate) gain: Vec<Option<usize>>,
}

impl Layout {
    pub(crate) fn new(model: &dyn Model, measurement: &Measurement, options: &Options) -> Result<Self> {
        let parameters = model.parameters();
        let (bands, series) = (measurement.bands.len(), measurement.series.len());
        let has_band = |b: usize| measurement.readings.iter().any(|r| r.band as usize == b);
        let has_series = |s: usize| measurement.readings.iter().any(|r| r.series as usize == s);
        let mut slots = Vec::new();
        let slot = |name: String, parameter: &Parameter, band| Slot {
            name,
            parameter: parameter.clone(),
            band,
            role: Role::Free,
            start_is_given: false,
            is_gain: false,
        };
        let mut shape_at = HashMap::new();
        for (i, p) in parameters.iter().enumerate().filter(|(_, p)| p.kind == Kind::Shape) {
            shape_at.insert(i, slots.len());
            slots.push(slot(p.name.clone(), p, None));
        }
        let used: Vec<usize> = (0..bands).filter(|&b| has_band(b)).collect();
        let mut of_band = vec![Vec::new(); bands];
        for &b in &used {
            for (i, p) in parameters.iter().enumerate() {
                of_band[b].push(shape_at.get(&i).copied().unwrap_or(slots.len()));
                if p.kind == Kind::Coefficient {
                    let one = used.len() == 1;
                    let name = if one {
                        p.name.clone()
                    } else {
                        format!("{}[{}]", p.name, measurement.bands[b].name)
                    };
                    slots.push(slot(name, p, Some(b)));
                }
            }
        }
        let mut gain = vec![None; series];
        if options.gains {
            let used = (0..series).filter(|&s| has_series(s));
            for (i, s) in used.enumerate() {
                let parameter = Parameter {
                    name: "gain".into(),
                    meaning: format!("readings of {} per unit of BSDF", measurement.series[s]),
                    kind: Kind::Shape,
                    start: 1.0,
                    min: GAIN_BOUNDS.0,
                    max: GAIN_BOUNDS.1,
                    logarithmic: true,
                };
                gain[s] = Some(slots.len());
                let mut slot = slot(format!("gain[{}]", measurement.series[s]), &parameter, None);
                slot.is_gain = true;
                // Only ratios of gains can be told from the coefficients.
                slot.role = if i == 0 { Role::Fixed } else { Role::Free };
                slots.push(slot);
            }
        }
        let mut layout = Self { slots, free: Vec::new(), root: Vec::new(), of_band, gain };
        layout.apply(measurement, &options.parameters)?;
        layout.resolve()?;
        Ok(layout)
    }

    /// Slots that a name means, and whether it means one band only.
    fn matching(&self, measurement: &Measurement, name: &str) -> (Vec<usize>, bool) {
        let full = |s: &Slot| match s.band {
            Some(b) => {
                s.name == name || format!("{}[{}]", s.parameter.name, measurement.bands[b].name) == name
            }
            None => s.name == name,
        };
        let general: Vec<usize> = (0..self.slots.len())
            .filter(|&i| self.slots[i].parameter.name == name && !self.slots[i].is_gain)
            .collect();
        if !general.is_empty() {
            return (general, false);
        }
        ((0..self.slots.len()).filter(|&i| full(&self.slots[i])).collect(), true)
    }

    /// Carries out the user's wishes, general ones before those for one band.
    fn apply(&mut self, measurement: &Measurement, wishes: &[Override]) -> Result<()> {
        let model_bounds: Vec<(f64, f64)> =
            self.slots.iter().map(|s| (s.parameter.min, s.parameter.max)).collect();
        let mut found = Vec::new();
        for wish in wishes {
            let (slots, specific) = self.matching(measurement, &wish.name);
            if slots.is_empty() {
                let known: Vec<&str> = self.slots.iter().map(|s| s.name.as_str()).collect();
                let what = format!("no such parameter; this fit has {}", known.join(", "));
                return Err(Error::invalid(&wish.name, what));
            }
            found.push((wish, slots, specific));
        }
        for pass in [false, true] {
            // (slot, group of actions that exclude each other)
            let mut seen: Vec<(usize, u8)> = Vec::new();
            for (wish, slots, _) in found.iter().filter(|f| f.2 == pass) {
                for &i in slots {
                    let group = match wish.action {
                        Action::Fix(_) | Action::Tie { .. } => 0,
                        Action::Bounds(..) => 1,
                        Action::Start(_) => 2,
                    };
                    if seen.contains(&(i, group)) {
                        return Err(Error::invalid(&wish.name, "is given twice"));
                    }
                    seen.push((i, group));
                    self.carry_out(measurement, i, wish, model_bounds[i])?;
                }
            }
        }
        for slot in &mut self.slots {
            let p = &mut slot.parameter;
            let inside = p.start >= p.min && p.start <= p.max;
            if !inside && slot.start_is_given {
                let what = format!("start {} is not in its bounds {} to {}", p.start, p.min, p.max);
                return Err(Error::invalid(&slot.name, what));
            }
            if slot.role != Role::Fixed {
                p.start = p.start.clamp(p.min, p.max);
            }
        }
        Ok(())
    }

    fn carry_out(
        &mut self,
        measurement: &Measurement,
        i: usize,
        wish: &Override,
        own: (f64, f64),
    ) -> Result<()> {
        let invalid = |what: String| Err(Error::invalid(&wish.name, what));
        match &wish.action {
            &Action::Fix(v) => {
                if !(v >= own.0 && v <= own.1) {
                    return invalid(format!("{v} is not in the model's range {} to {}", own.0, own.1));
                }
                self.slots[i].parameter.start = v;
                self.slots[i].role = Role::Fixed;
            }
            &Action::Bounds(low, high) => {
                if low.is_nan() || high.is_nan() || low >= high {
                    return invalid(format!("lower bound {low} is not below upper bound {high}"));
                }
                if low < own.0 || high > own.1 {
                    return invalid(format!(
                        "bounds {low} to {high} reach outside the model's range {} to {}",
                        own.0, own.1
                    ));
                }
                (self.slots[i].parameter.min, self.slots[i].parameter.max) = (low, high);
            }
            &Action::Start(v) => {
                if !v.is_finite() {
                    return invalid(format!("start {v} is not a number"));
                }
                if self.slots[i].role != Role::Fixed {
                    self.slots[i].parameter.start = v;
                    self.slots[i].start_is_given = true;
                }
            }
            Action::Tie { to, factor } => {
                if !factor.is_finite() || *factor == 0.0 {
                    return invalid(format!("factor {factor} of a tie is not a number other than 0"));
                }
                let (mut targets, _) = self.matching(measurement, to);
                if targets.is_empty() {
                    return invalid(format!("is tied to `{to}`, which is no parameter of this fit"));
                }
                if targets.len() > 1 {
                    targets.retain(|&t| self.slots[t].band == self.slots[i].band);
                }
                let &[target] = targets.as_slice() else {
                    return invalid(format!("is tied to `{to}`, which has a value in each band: name one"));
                };
                self.slots[i].role = Role::Tied { to: target, factor: *factor };
            }
        }
        Ok(())
    }

    /// Finds the free variables and what hangs on them; bounds of tied slots become bounds of their roots.
    fn resolve(&mut self) -> Result<()> {
        self.free = (0..self.slots.len()).filter(|&i| self.slots[i].role == Role::Free).collect();
        self.root = vec![None; self.slots.len()];
        for i in 0..self.slots.len() {
            let (mut at, mut product) = (i, 1.0);
            for hops in 0.. {
                let Role::Tied { to, factor } = self.slots[at].role else { break };
                if hops > self.slots.len() {
                    return Err(Error::invalid(&self.slots[i].name, "is tied in a circle"));
                }
                (at, product) = (to, product * factor);
            }
            self.root[i] = self.free.iter().position(|&f| f == at).map(|f| (f, product));
            if at == i {
                continue;
            }
            let p = &self.slots[i].parameter;
            let (a, b) = (p.min / product, p.max / product);
            let (low, high) = (a.min(b), a.max(b));
            let (name, root) = (self.slots[i].name.clone(), self.slots[at].name.clone());
            let is_free = self.slots[at].role == Role::Free;
            let target = &mut self.slots[at].parameter;
            if is_free {
                (target.min, target.max) = (target.min.max(low), target.max.min(high));
                if target.min >= target.max {
                    return Err(Error::invalid(name, format!("its bounds leave no room for `{root}`")));
                }
                target.start = target.start.clamp(target.min, target.max);
            } else if target.start < low || target.start > high {
                return Err(Error::invalid(name, format!("is out of its bounds with `{root}` held")));
            } else {
                self.slots[i].parameter.start = target.start * product;
            }
        }
        Ok(())
    }

    /// All values from the free ones.
    pub(crate) fn values(&self, x: &[f64]) -> Vec<f64> {
        let mut values: Vec<f64> = self.slots.iter().map(|s| s.parameter.start).collect();
        for (i, value) in values.iter_mut().enumerate() {
            if let Some((f, factor)) = self.root[i] {
                let p = &self.slots[i].parameter;
                // Bounds of the root already hold; rounding must not leave the model's range.
                *value = (x[f] * factor).clamp(p.min, p.max);
            }
        }
        values
    }

    /// Bounds of the free variables.
    pub(crate) fn bounds(&self) -> (Vec<f64>, Vec<f64>) {
        self.free.iter().map(|&i| (self.slots[i].parameter.min, self.slots[i].parameter.max)).unzip()
    }

    /// The parameter behind a free variable.
    pub(crate) fn free_slot(&self, variable: usize) -> &Slot {
        &self.slots[self.free[variable]]
    }

    /// Is a free variable a coefficient, that NNLS can find?
    pub(crate) fn is_coefficient(&self, variable: usize) -> bool {
        self.free_slot(variable).parameter.kind == Kind::Coefficient
    }
}

//! A dotted key, for errors that name it, and the checks on numbers that many keys share.

use std::fmt::Display;

use glam::DVec3;

use crate::{Error, Result};

/// Dotted key of a scene file.
#[derive(Clone, Debug)]
pub(super) struct Key(String);

impl Key {
    /// From a dotted key.
    pub(super) fn new(key: impl Into<String>) -> Self {
        Self(key.into())
    }

    /// A key of this table.
    pub(super) fn at(&self, key: &str) -> Self {
        Self(format!("{}.{key}", self.0))
    }

    /// The error that this key is wrong.
    pub(super) fn invalid(&self, what: impl Into<String>) -> Error {
        Error::invalid(&self.0, what)
    }

    /// `value`, if it lies in the range; `expected` says which range that is.
    pub(super) fn within<T: PartialOrd + Display + Copy>(
        &self,
        value: T,
        range: impl std::ops::RangeBounds<T>,
        expected: &str,
    ) -> Result<T> {
        // NaN lies in no range.
        if range.contains(&value) {
            Ok(value)
        } else {
            Err(self.invalid(format!("{value} is not {expected}")))
        }
    }

    /// A finite number.
    pub(super) fn finite(&self, value: f64) -> Result<f64> {
        self.within(value, f64::MIN..=f64::MAX, "a finite number")
    }

    /// A length above zero that f32 holds.
    pub(super) fn positive(&self, value: f64) -> Result<f64> {
        self.within(value, 1e-9..=1e9, "a number above 0 (1e-9 to 1e9)")
    }

    /// Zero or more, at most what f32 holds with room to spare.
    pub(super) fn not_negative(&self, value: f64) -> Result<f64> {
        self.within(value, 0.0..=1e18, "zero or more (at most 1e18)")
    }

    /// A point or vector of finite numbers.
    pub(super) fn vector(&self, value: [f64; 3]) -> Result<DVec3> {
        if value.iter().all(|v| v.abs() <= 1e9) {
            Ok(DVec3::from(value))
        } else {
            Err(self.invalid(format!("{value:?} is not three finite numbers (at most 1e9)")))
        }
    }

    /// A direction of any length but zero.
    pub(super) fn direction(&self, value: [f64; 3]) -> Result<DVec3> {
        self.vector(value)?
            .try_normalize()
            .ok_or_else(|| self.invalid("the vector has no length, so it points nowhere"))
    }

    /// Gives a result's error to this key: what it says about itself becomes part of the message.
    pub(super) fn says<T>(&self, result: Result<T>) -> Result<T> {
        result.map_err(|e| match e {
            Error::Cancelled => Error::Cancelled,
            other => self.invalid(other.to_string()),
        })
    }

    /// Gives a result's error to this key: where it happened inside is dropped, what happened is kept.
    pub(super) fn name<T>(&self, result: Result<T>) -> Result<T> {
        result.map_err(|e| match e {
            Error::Invalid { what, .. } => self.invalid(what),
            other => self.invalid(other.to_string()),
        })
    }

    /// Puts this key before the key of a result's error.
    pub(super) fn under<T>(&self, result: Result<T>) -> Result<T> {
        result.map_err(|e| match e {
            Error::Invalid { at, what } => self.at(&at).invalid(what),
            other => other,
        })
    }
}

impl Display for Key {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

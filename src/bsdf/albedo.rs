//! Energy checks on the spectra that models are made of.

use crate::spectrum::spectra::DENSE_SAMPLES;
use crate::spectrum::{Spectrum, VISIBLE_NM};
use crate::{Error, Result};

/// Sums of reflectances that are one in decimal may exceed it by this in f32.
const ROUNDING: f32 = 1e-5;

/// Checks that a share of the light is a number in [0, 1] at every nm of the visible range.
pub(super) fn check_share(at: &str, share: &Spectrum) -> Result<()> {
    check_each_nm(at, |nm| {
        let v = share.at(nm);
        (!(0.0..=1.0 + ROUNDING).contains(&v))
            .then(|| format!("{v} at {nm} nm; a share of the light lies between 0 and 1"))
    })
}

/// Checks that two shares of the light that falls on one side sum to at most 1 at every nm. `what` says
/// which shares and which side, for the error.
pub(super) fn check_sum(at: &str, what: &str, a: &Spectrum, b: &Spectrum) -> Result<()> {
    check_each_nm(at, |nm| {
        let sum = a.at(nm) + b.at(nm);
        (sum > 1.0 + ROUNDING).then(|| format!("{what} is {sum} at {nm} nm; at most 1 keeps the energy"))
    })
}

/// First complaint over the samples of a dense spectrum. Spectra are linear in between, so that what holds
/// at the samples holds everywhere.
fn check_each_nm(at: &str, mut complaint: impl FnMut(f32) -> Option<String>) -> Result<()> {
    match (0..DENSE_SAMPLES).find_map(|i| complaint(VISIBLE_NM.0 + i as f32)) {
        Some(what) => Err(Error::invalid(at, what)),
        None => Ok(()),
    }
}

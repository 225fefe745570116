//! Models in closed form: sums of terms, each with its equation in a file of its own.
//!
//! | name | terms | parameters |
//! |---|---|---|
//! | `lambert` | [`lambert`] | kd |
//! | `phong` | [`phong`] | ks, n |
//! | `oren_nayar` | [`oren_nayar`] | kd, sigma_deg |
//! | `lambert+phong` | [`lambert`], [`phong`] | kd, ks, n |
//! | `blinn` | [`lambert`], [`blinn`] | kd, ks, n |
//! | `ggx+lambert` | [`lambert`], [`ggx`] | kd, f0, alpha |
//! | `retro` | [`lambert`], [`blinn`], [`retro`] of it | kd, ks, n, kr, n_r |
//! | `retro_beckmann` | [`lambert`], [`beckmann`], [`retro`] of it | kd, ks, m, kr, m_r |
//! | `transmission` | [`transmission`] | t, td, m_d, ti, m_i |
//! | `lambert+transmission` | [`lambert`], [`transmission`] | kd, t, td, m_d, ti, m_i |
//!
//! [`Terado`], the cells' model, needs a table of its cells; it is the only one that is not in closed form.
//!
//! All are reciprocal (`models_are_reciprocal`), finite and not negative at the horizon and at their bounds
//! (`models_are_finite_at_the_horizon_and_at_bounds`), the same from below as from above
//! (`both_sides_of_the_sheet_are_alike`), and their derivatives are exact (`derivatives_are_exact`). A term is zero
//! where its light does not go: reflection across the sheet, transmission on the lamp's side. Nothing bounds the sum
//! of several coefficients: what a fit reflects in total is for its audit to say.

mod sum;
mod term;
pub mod lambert;
pub mod phong;
pub mod blinn;
pub mod oren_nayar;
pub mod ggx;
pub mod beckmann;
pub mod retro;
pub mod transmission;
pub mod terado;

pub use sum::Sum;
pub use terado::Terado;
pub use term::{Closed, MAX_PARAMETERS, Term};

use super::Model;
use beckmann::Beckmann;
use blinn::Blinn;
use ggx::Ggx;
use lambert::Lambert;
use oren_nayar::OrenNayar;
use phong::Phong;
use retro::Retro;

/// Names of the models of reflection, from the simplest to the richest.
pub const CLOSED_FORM: &[&str] =
    &["lambert", "phong", "oren_nayar", "lambert+phong", "blinn", "ggx+lambert", "retro", "retro_beckmann"];

/// Names of the models that also let light through, for readings on both sides of the sheet.
pub const CLOSED_FORM_TRANSMITTING: &[&str] = &["transmission", "lambert+transmission"];

/// The model in closed form of this name.
pub fn by_name(name: &str) -> Option<Box<dyn Model>> {
    let lambert = || Closed::<Lambert>::boxed("lambert");
    let sum = |name: &str, parts| -> Box<dyn Model> { Box::new(Sum::new(name, parts)) };
    Some(match name {
        "lambert" => lambert(),
        "phong" => Closed::<Phong>::boxed(name),
        "oren_nayar" => Closed::<OrenNayar>::boxed(name),
        "lambert+phong" => sum(name, vec![lambert(), Closed::<Phong>::boxed("phong")]),
        "blinn" => sum(name, vec![lambert(), Closed::<Blinn>::boxed("lobe")]),
        "ggx+lambert" => sum(name, vec![lambert(), Closed::<Ggx>::boxed("ggx")]),
        "retro" => {
            sum(name, vec![lambert(), Closed::<Blinn>::boxed("lobe"), Closed::<Retro<Blinn>>::boxed("retro")])
        }
        "retro_beckmann" => sum(
            name,
            vec![lambert(), Closed::<Beckmann>::boxed("lobe"), Closed::<Retro<Beckmann>>::boxed("retro")],
        ),
        "transmission" => transmission::model(),
        "lambert+transmission" => sum(name, vec![lambert(), transmission::model()]),
        _ => return None,
    })
}

#[cfg(test)]
mod tests;

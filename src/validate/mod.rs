//! Checks of any arrow of the program, used by `rosarium check` and by the tests.
//!
//! Nothing here prints or panics: every check returns its statistic, its tolerance and whether it passed.
//! [`check_bsdf`] runs the conformance suite over one model, [`check_scatter`] what can be said of a thing
//! [`laws`] measures what botanists found.

//! Runs the commands of the page, in this process, and remembers which are done.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::time::{Instant, UNIX_EPOCH};

use clap::Parser;
use rosarium::{Error, Result};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::cell_model::write_whole;
use crate::{Cli, Command, Global, Outcome, cells, compare, fit, measure, render, shell};

/// The record of a run that has not come to its end.
const RECORD: &str = "unfinished.json";

/// Flags that files are written by.
const WRITES: [&str; 5] = ["-o", "--output", "--plot", "--report", "--residuals"];

/// Files that a command writes.
pub(super) fn written(command: &str) -> Vec<&str> {
    let words: Vec<&str> = command.split_whitespace().collect();
    // The `--plot` of `compare` names a kind of plot.
    words.windows(2).filter(|w| WRITES.contains(&w[0]) && w[1].contains('.')).map(|w| w[1]).collect()
}

/// A command after those that write what it reads, in the order of `all`.
pub(super) fn with_needed<'a>(command: &'a str, all: &[&'a str]) -> Vec<&'a str> {
    let mut needed = BTreeSet::from([command]);
    let mut open = vec![command];
    while let Some(next) = open.pop() {
        let own = written(next);
        let reads: Vec<&str> = next.split_whitespace().filter(|w| !own.contains(w)).collect();
        for before in all {
            if written(before).iter().any(|file| reads.contains(file)) && needed.insert(before) {
                open.push(before);
            }
        }
    }
    let mut seen = BTreeSet::new();
    all.iter().copied().filter(|c| needed.contains(c) && seen.insert(*c)).collect()
}

/// The command as a shell takes it.
pub(super) fn line(command: &str) -> String {
    shell::line(command.split_whitespace().map(str::to_owned))
}

/// The command, understood.
pub(super) fn parse(command: &str) -> Result<Command> {
    let words = std::iter::once("rosarium").chain(command.split_whitespace());
    Cli::try_parse_from(words)
        .map(|cli| cli.command)
        .map_err(|e| Error::invalid(line(command), e.to_string()))
}

/// Runs a command, in silence.
fn execute(command: &str) -> Result<Outcome> {
    let global = Global { quiet: true, verbose: 0, threads: None };
    match parse(command)? {
        Command::Cells(args) => cells::run(&args, global),
        Command::Measure(args) => measure::measure(&args, global).map(|_| Outcome::Done),
        Command::Fit(args) => fit::fit(&args, global, &line(command)).map(|_| Outcome::Done),
        Command::Render(args) => render::render(&args, global, &line(command)),
        Command::Compare(args) => compare::compare(&args, global).map(|(_, outcome)| outcome),
        _ => Err(Error::Unsupported(format!("`{}` makes no picture", line(command)))),
    }
}

/// Commands that are done, with the time that each took, s.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Done {
    /// What the pictures depend on besides their commands.
    inputs: String,
    seconds: BTreeMap<String, f64>,
    /// Commands whose result is not what it should be.
    doubtful: BTreeSet<String>,
}

impl Done {
    /// What an earlier run with the same inputs has left in this folder: the program and `data` are the inputs.
    pub(super) fn resume(data: &[u8]) -> Self {
        let program = std::env::current_exe().and_then(std::fs::metadata).ok();
        let changed = program.as_ref().and_then(|m| m.modified().ok()?.duration_since(UNIX_EPOCH).ok());
        let mut hash = Sha256::new();
        hash.update(format!("{} {changed:?} {:?}\n", env!("CARGO_PKG_VERSION"), program.map(|m| m.len())));
        hash.update(data);
        let inputs: String = hash.finalize().iter().take(16).map(|b| format!("{b:02x}")).collect();
        let kept = std::fs::read(RECORD).ok().and_then(|bytes| serde_json::from_slice::<Self>(&bytes).ok());
        match kept.filter(|k| k.inputs == inputs) {
            Some(mut kept) => {
                kept.seconds.retain(|command, _| written(command).iter().all(|f| Path::new(f).is_file()));
                kept
            }
            None => Self { inputs, ..Self::default() },
        }
    }

    pub(super) fn has(&self, command: &str) -> bool {
        self.seconds.contains_key(command)
    }

    /// Time that a command took, s.
    pub(super) fn seconds(&self, command: &str) -> f64 {
        self.seconds.get(command).copied().unwrap_or(0.0)
    }

    pub(super) fn doubtful(&self) -> &BTreeSet<String> {
        &self.doubtful
    }

    /// Runs a command and remembers that. A stopped or failed one leaves no files.
    pub(super) fn run(&mut self, command: &str) -> Result<Outcome> {
        let started = Instant::now();
        let outcome = execute(command);
        if !matches!(outcome, Ok(Outcome::Done | Outcome::CheckFailed)) {
            for file in written(command) {
                // What was not there cannot be removed.
                let _ = std::fs::remove_file(file);
            }
            return outcome;
        }
        self.seconds.insert(command.to_owned(), started.elapsed().as_secs_f64());
        self.doubtful.remove(command);
        if matches!(outcome, Ok(Outcome::CheckFailed)) {
            self.doubtful.insert(command.to_owned());
        }
        let text = serde_json::to_vec_pretty(self).map_err(|e| Error::invalid(RECORD, e.to_string()))?;
        write_whole(Path::new(RECORD), &text).map_err(|e| Error::io(RECORD, e))?;
        outcome
    }

    /// The page is there: the next run begins anew.
    pub(super) fn finish() {
        // It is not there where nothing was to be done.
        let _ = std::fs::remove_file(RECORD);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_needs_those_that_write_what_it_reads() {
        let all = [
            "measure x -o t.csv",
            "fit t.csv -o p.toml",
            "cells x --plot c.png",
            "render --petal p.toml -o r.exr -o r.png",
            "compare r.exr r.exr --plot signed -o d.png",
        ];
        assert_eq!(written(all[3]), ["r.exr", "r.png"]);
        assert_eq!(written(all[4]), ["d.png"]);
        assert_eq!(with_needed(all[2], &all), [all[2]]);
        assert_eq!(with_needed(all[4], &all), [all[0], all[1], all[3], all[4]]);
        assert_eq!(with_needed(all[1], &[all[0], all[1], all[1]]), [all[0], all[1]]);
    }
}

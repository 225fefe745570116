//! `rosarium reproduce`: the pictures, and the page that shows them.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::time::Instant;

use rosarium::io::figure_page::{self, FigurePage};
use rosarium::scene::THESIS_SCENES;
use rosarium::{Error, Result};

use super::effort::Effort;
use super::sections::{self, FITS, MEASURED_FITS, Name, Section, Table};
use super::work::{self, Done};
use super::{Args, known};
use crate::cell_model::write_whole;
use crate::data::DataArgs;
use crate::output::Output;
use crate::progress::Bar;
use crate::{Global, Outcome, progress, shell};

/// The user's table, read.
struct Measured {
    bytes: Vec<u8>,
    table: Table,
}

pub(super) fn run(args: &Args, folder: &Path, global: Global) -> Result<Outcome> {
    let effort = Effort::new(args);
    if !(2..=1_000_000_000).contains(&effort.rays) {
        return Err(Error::invalid("--rays", format!("{} is not within 2 to 1e9", effort.rays)));
    }
    let measured = args.measurement.as_deref().map(read_table).transpose()?;
    fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    Output::prepare("--output", &folder.join("index.html"), &["html"])?;
    // Commands are shown as they run: in the page's folder.
    std::env::set_current_dir(folder).map_err(|e| Error::io(folder, e))?;
    let index = Output::prepare("--output", Path::new("index.html"), &["html"])?;
    write_inputs(measured.as_ref())?;

    let all = sections::sections(&effort, measured.as_ref().map(|m| &m.table));
    let commands: Vec<&str> = all.iter().flat_map(|s| &s.figures).map(|f| f.command.as_str()).collect();
    commands.iter().try_for_each(|c| work::parse(c).map(|_| ()))?;
    let chosen = |s: &&Section| args.section.is_empty() || args.section.contains(&s.name);
    let sections: Vec<&Section> = all.iter().filter(chosen).collect();
    let mut done = Done::resume(measured.as_ref().map_or(&[], |m| &m.bytes));

    let started = Instant::now();
    let outcome = make(&sections, &commands, &mut done, global)?;
    if outcome == Outcome::Stopped {
        progress::say(
            global,
            &format!(
                "stopped; what is finished stays in {}, and the same command goes on from it",
                folder.display()
            ),
        );
        return Ok(outcome);
    }
    let page = page(&sections, &commands, &done, measured.is_some())?;
    let bytes = figure_page::write(&page).into_bytes();
    index.write(&bytes)?;
    Done::finish();
    let pictures: usize = sections.iter().map(|s| s.figures.len()).sum();
    let line = format!(
        "{}: {} sections, {pictures} pictures, {:.1} MB, {:.0} s",
        folder.join("index.html").display(),
        sections.len(),
        bytes.len() as f64 / 1e6,
        started.elapsed().as_secs_f64()
    );
    progress::say(global, &line);
    Ok(outcome)
}

/// Reads the table, so that a bad one is found at once.
fn read_table(path: &Path) -> Result<Measured> {
    let data = DataArgs::default().load(&[path.to_owned()])?;
    let measurement = &data.measurement;
    if !measurement.readings.iter().any(|r| r.wi.z * r.wo.z > 0.0) {
        return Err(Error::invalid(path.display().to_string(), "there are no readings of reflected light"));
    }
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    let plain = !extension.is_empty() && extension.chars().all(|c| c.is_ascii_alphanumeric());
    let table = Table {
        file: format!("measurement.{}", if plain { extension } else { "csv" }),
        name: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        series: measurement.series.len(),
    };
    Ok(Measured { bytes: data.bytes, table })
}

/// The files that the commands read, beside the page.
fn write_inputs(measured: Option<&Measured>) -> Result<()> {
    let write = |path: &Path, bytes: &[u8]| write_whole(path, bytes).map_err(|e| Error::io(path, e));
    for (name, text) in THESIS_SCENES {
        write(&Path::new("scenes").join(name), text.as_bytes())?;
    }
    measured.map_or(Ok(()), |m| write(Path::new(&m.table.file), &m.bytes))
}

/// Runs what is not done yet.
fn make(sections: &[&Section], commands: &[&str], done: &mut Done, global: Global) -> Result<Outcome> {
    let wanted: Vec<(Name, &str)> = {
        let mut seen = BTreeSet::new();
        let needed = sections.iter().flat_map(|s| s.figures.iter().map(move |f| (s.name, f)));
        needed
            .flat_map(|(name, f)| work::with_needed(&f.command, commands).into_iter().map(move |c| (name, c)))
            .filter(|(_, c)| seen.insert(*c))
            .collect()
    };
    let count = wanted.len();
    let bar = Bar::new("report");
    let mut outcome = Outcome::Done;
    for (k, (name, command)) in wanted.into_iter().enumerate() {
        bar.show(k as u64, count as u64);
        if done.has(command) {
            continue;
        }
        if progress::stopped() {
            return Ok(Outcome::Stopped);
        }
        match done.run(command) {
            Ok(Outcome::Stopped) | Err(Error::Cancelled) => return Ok(Outcome::Stopped),
            Ok(Outcome::CheckFailed) => {
                progress::say(global, &format!("warning: no convergence: {}", work::line(command)));
                outcome = Outcome::CheckFailed;
            }
            Ok(Outcome::Done) => {}
            Err(e) => return Err(e),
        }
        let files = work::written(command).join(", ");
        let line = format!("{} of {count}, {}: {files} ({:.1} s)", k + 1, name.word(), done.seconds(command));
        progress::say(global, &line);
    }
    Ok(outcome)
}

/// The page, of the files that the commands have written.
fn page(sections: &[&Section], commands: &[&str], done: &Done, measured: bool) -> Result<FigurePage> {
    let read = |file: &str| fs::read(file).map_err(|e| Error::io(file, e));
    let mut page = FigurePage {
        title: "A rose from its cells".to_owned(),
        lead: "The figures of Ikuo Terado's thesis on photorealistic images of roses (JAIST, 1999), made again by Rosarium."
            .to_owned(),
        command: shell::command(),
        note: "Under each picture is the command that makes it alone: run in the folder that this page was written to (or in \
               Rosarium's sources, whose scenes it has), it gives the same bytes."
            .to_owned(),
        sections: Vec::new(),
        made_by: ("Rosarium".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
    };
    for section in sections {
        let mut figures = Vec::new();
        let mut own = BTreeSet::new();
        for f in &section.figures {
            own.insert(f.command.as_str());
            let doubt = if done.doubtful().contains(&f.command) {
                " The light among petals has not converged."
            } else {
                ""
            };
            figures.push(figure_page::Figure {
                alt: f.alt.clone(),
                caption: format!("{}{doubt}", f.caption),
                picture: read(&f.picture)?,
                commands: work::with_needed(&f.command, commands).into_iter().map(work::line).collect(),
                seconds: done.seconds(&f.command),
            });
        }
        let tables = if section.name == Name::Distribution { tables(&read, measured)? } else { Vec::new() };
        page.sections.push(figure_page::Section {
            id: section.name.word(),
            title: section.title.to_owned(),
            text: section.text.clone(),
            notice: section.notice.clone(),
            figures,
            columns: section.columns,
            tables,
            seconds: own.iter().map(|c| done.seconds(c)).sum(),
        });
    }
    Ok(page)
}

/// The numbers of the fits.
fn tables(read: &dyn Fn(&str) -> Result<Vec<u8>>, measured: bool) -> Result<Vec<figure_page::Table>> {
    let reports =
        FITS.map(|file| known::report(file, &read(file)?)).into_iter().collect::<Result<Vec<_>>>()?;
    let mut tables = vec![known::residuals("How far the models are from the synthetic table.", &reports)];
    tables.extend(reports.last().map(known::parameters).transpose()?);
    if measured {
        let report = known::report(MEASURED_FITS, &read(MEASURED_FITS)?)?;
        tables.push(known::residuals("How far the models are from your measurement.", &[report]));
    }
    Ok(tables)
}

//! The page that shows the laws: Markdown, with one plot each.

use std::fmt::Write;

use super::{Effort, Finding, Law, Wanted};
use crate::gonio::Estimate;

/// File name of a law's plot, in the folder `plots` beside the page.
pub fn plot_name(law: &Law) -> String {
    format!("law_{}_{}.svg", law.number, law.name.to_lowercase().replace(' ', "_"))
}

/// The page. `command` made it, of walks as in `effort`.
pub fn markdown(laws: &[Law], command: &str, effort: Effort) -> String {
    let mut page = String::new();
    // Writing to a string does not fail.
    let _ = write!(
        page,
        "# The laws of petal optics, measured\n\n\
         What botanists and Terado found in petals, against light that walks through petals of cells (`micro::cell_walk`, geometrical \
         optics, nothing fitted). Made by\n`{command}`\n({} walks per petal and lamp, seed {}). Numbers are ± one standard error; a number \
         holds where it passes its bound by three of them. `tests/laws.rs` holds each law to these bounds.\n\n\
         | law | | numbers that hold |\n|---|---|---|\n",
        effort.walks, effort.seed
    );
    for law in laws {
        let holding = law.findings.iter().filter(|f| f.holds()).count();
        let _ = writeln!(page, "| {} | {} | {holding} of {} |", law.number, law.name, law.findings.len());
    }
    page.push_str(
        "\nLaw 9 (close up the surface is discrete, far away it is its BSDF, with one mean) is tested in `tests/thesis.rs` \
         (`few_points_are_duller`, `estimate_converges_to_the_table`).\n",
    );
    for law in laws {
        let _ = write!(
            page,
            "\n## {}. {}\n\n{} ({}.)\n\n{}\n\n| number | measured | law | holds |\n|---|---|---|---|\n",
            law.number, law.name, law.claim, law.source, law.method
        );
        for f in &law.findings {
            let holds = if f.holds() { "yes" } else { "**no**" };
            let _ = writeln!(page, "| {} | {} | {} | {holds} |", f.what, number(f.value), wanted(f));
        }
        let _ = write!(page, "\n![{}](plots/{})\n", law.chart.title, plot_name(law));
        if !law.remark.is_empty() {
            let _ = write!(page, "\n{}\n", law.remark);
        }
    }
    page
}

fn wanted(finding: &Finding) -> String {
    match finding.wanted {
        Wanted::Above(bound) => format!("> {bound}"),
        Wanted::Below(bound) => format!("< {bound}"),
        Wanted::Between(low, high) => format!("{low} to {high}"),
    }
}

/// A number with as many digits as its error allows: two of the error.
fn number(e: Estimate) -> String {
    let digits = if e.standard_error > 0.0 { 1 - e.standard_error.log10().floor() as i32 } else { 4 };
    let digits = digits.clamp(0, 6) as usize;
    format!("{:.digits$} ± {:.digits$}", e.value, e.standard_error)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::line_chart::Chart;

    #[test]
    fn the_page_says_what_holds() {
        let finding =
            |value| Finding::new("a ratio", Estimate { value, standard_error: 0.0123 }, Wanted::Above(1.5));
        let law = Law {
            number: 4,
            name: "Black rose",
            claim: "Darker.",
            source: "Yasuda 1967",
            method: "Two petals.",
            findings: vec![finding(2.0), finding(1.51)],
            remark: "No more.",
            chart: Chart { title: "Law 4".into(), ..Chart::default() },
        };
        let page = markdown(&[law], "rosarium reproduce laws", Effort { walks: 1000, seed: 3 });
        for part in [
            "| 4 | Black rose | 1 of 2 |",
            "| a ratio | 2.000 ± 0.012 | > 1.5 | yes |",
            "| a ratio | 1.510 ± 0.012 | > 1.5 | **no** |",
            "![Law 4](plots/law_4_black_rose.svg)",
            "(Yasuda 1967.)",
            "1000 walks",
            "\nNo more.\n",
        ] {
            assert!(page.contains(part), "{part}: {page}");
        }
    }
}

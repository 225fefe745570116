//! Law 10, growth: the highlight changes as cells rise with the age of the petal.
//!
//! Model: `rote_rose` at ages from bud (0) to open flower (1) ([`crate::micro::growth`]); highlight is the light that never entered,
//! within 15 deg of the mirror direction, lamp at 60 deg. Guarded by `law_10_growth`. Source: Tachino 2000 (the change; its
//! size is not published).

use super::walks::{Sample, mirror, near, ratio, when};
use super::{Effort, Finding, Law, Wanted};
use crate::Result;
use crate::io::line_chart::{Chart, Series};

const AGES: [f64; 6] = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0];
const CAP_DEG: f64 = 15.0;

/// Measures the law.
pub fn measure(effort: Effort) -> Result<Law> {
    let (mut highlight, mut exterior) = (Vec::new(), Vec::new());
    for age in AGES {
        let petal = Sample::new("rote_rose", &[&format!("age={age:.1}")])?;
        let [all, mirrored] = petal.tally(60.0, effort, |wi, exit| {
            let surface = exit.is_surface();
            [when(surface, 1.0), when(surface && near(exit.direction, mirror(wi), CAP_DEG), 1.0)]
        });
        exterior.push((age, all));
        highlight.push((age, mirrored));
    }
    let last = AGES.len() - 1;
    let findings = vec![
        Finding::new(
            "highlight of the open flower over that of the bud",
            ratio(highlight[last].1, highlight[0].1),
            Wanted::Below(0.3),
        ),
        Finding::new(
            "exterior light of the open flower over that of the bud",
            ratio(exterior[last].1, exterior[0].1),
            Wanted::Below(0.7),
        ),
    ];
    Ok(Law {
        number: 10,
        name: "Growth",
        claim: "The highlight changes as cells rise with the age of the petal.",
        source: "Tachino 2000",
        method: "`rote_rose` with `-D age=0` (bud) to `-D age=1` (open), lamp at 60 deg: exterior light, and its part within 15 deg of the mirror \
                 direction.",
        findings,
        remark: "The course of the cells' growth is our reading (see `micro::growth`).",
        chart: Chart {
            title: "Law 10: the highlight of a growing petal, lamp at 60 deg".into(),
            x_label: "age (0 bud, 1 open)".into(),
            y_label: "share of the light".into(),
            log_y: true,
            series: vec![Series::new("exterior light", exterior), Series::new("highlight", highlight)],
        },
    })
}

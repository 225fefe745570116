//! Law 2, order of gloss: the light that a petal's surface returns falls from flat cells over domes and papillae to cones.
//!
//! Model: exterior light is light that never entered the petal; its part within 5 deg of the mirror direction is the gloss that a
//! gloss meter sees. Shapes (Kay et al. 1981 name them; sizes are our reading): flat; lenticular dome, cosine, height 0.3
//! pitches; papilla, cosine, 1 pitch; cone, 1.6 pitches (the thesis' height). Guarded by `law_2_gloss`. Sources: van der Kooi et
//! al. 2014, Whitney et al. 2012, Stavenga et al. 2020.

use super::walks::{Sample, mirror, near, ratio, when};
use super::{Effort, Finding, Law, Wanted};
use crate::Result;
use crate::io::line_chart::{Chart, Series};

const SHAPES: [(&str, [&str; 2]); 5] = [
    ("flat", ["cells.profile=flat", "cells.height_um=0"]),
    ("lenticular dome, 0.3", ["cells.profile=cosine", "cells.height_um=6.9"]),
    ("papilla, 1.0", ["cells.profile=cosine", "cells.height_um=23"]),
    ("cone, 1.6", ["cells.profile=cone", "cells.height_um=37"]),
    ("dome of the thesis, 1.6", ["cells.profile=cosine", "cells.height_um=37"]),
];
const LAMPS_DEG: [f64; 4] = [0.0, 30.0, 60.0, 75.0];
const GLOSS_DEG: f64 = 5.0;

/// Measures the law.
pub fn measure(effort: Effort) -> Result<Law> {
    let mut series = Vec::new();
    let mut at_60 = Vec::new();
    for (name, changes) in SHAPES {
        let petal = Sample::new("rote_rose", &changes)?;
        let mut points = Vec::new();
        for deg in LAMPS_DEG {
            let light = petal.tally(deg, effort, |wi, exit| {
                let exterior = exit.is_surface();
                [when(exterior, 1.0), when(exterior && near(exit.direction, mirror(wi), GLOSS_DEG), 1.0)]
            });
            points.push((deg, light[0]));
            if deg == 60.0 {
                at_60.push(light);
            }
        }
        series.push(Series::new(name, points));
    }
    let total = |a: usize, b: usize| ratio(at_60[a][0], at_60[b][0]);
    Ok(Law {
        number: 2,
        name: "Order of gloss",
        claim: "Surface reflection falls from flat over dome and papilla to cone; domes cut the flat gloss by 5 times or more.",
        source: "van der Kooi et al. 2014, Whitney et al. 2012, Stavenga et al. 2020",
        method: "`rote_rose` with other cells (heights in pitches). Exterior light is what never entered the petal; gloss is its part \
                 within 5 deg of the mirror direction.",
        findings: vec![
            Finding::new(
                "exterior light at 60 deg, flat over lenticular dome",
                total(0, 1),
                Wanted::Above(1.0),
            ),
            Finding::new("... lenticular dome over papilla", total(1, 2), Wanted::Above(1.2)),
            Finding::new("... papilla over cone", total(2, 3), Wanted::Above(1.1)),
            Finding::new(
                "gloss at 60 deg, lenticular dome over flat",
                ratio(at_60[1][1], at_60[0][1]),
                Wanted::Below(0.2),
            ),
            Finding::new(
                "... the thesis' dome over flat",
                ratio(at_60[4][1], at_60[0][1]),
                Wanted::Below(0.2),
            ),
        ],
        remark: "Sizes of the shapes are our reading. At equal height a pointed cone returns least and a blunt shape more: the order is one of \
                 slopes. A smooth flat wall is a mirror, so what domes leave of its gloss is far below a fifth.",
        chart: Chart {
            title: "Law 2: light that never entered the petal".into(),
            x_label: "lamp's angle from the normal, deg".into(),
            y_label: "exterior reflectance".into(),
            log_y: true,
            series,
        },
    })
}

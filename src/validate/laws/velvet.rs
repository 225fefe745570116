//! Law 3, velvet: in a dark petal the surface's light counts, and it grows towards grazing angles.
//!
//! Model: by reciprocity a petal's directional-hemispherical reflectance R(theta) is also its brightness seen from theta under a
//! uniform sky; R(80 deg) > R(0) is an outline brighter than the centre ("reverse shading"). Guarded by `law_3_velvet`. Source:
//! Hayashi and others 2015 (30 cultivars, 19 species: domed cells and dark pigment).

use super::walks::{Sample, comes_back, ratio, when};
use super::{Effort, Finding, Law, Wanted};
use crate::Result;
use crate::io::line_chart::{Chart, Series};

const ANGLES_DEG: [f64; 7] = [0.0, 20.0, 40.0, 55.0, 65.0, 75.0, 82.0];

/// Measures the law.
pub fn measure(effort: Effort) -> Result<Law> {
    let petal = Sample::new("rote_rose", &[])?;
    let (dark, light) = (petal.at(540.0)?, petal.at(680.0)?);
    let mut lines = [const { Vec::new() }; 3];
    for deg in ANGLES_DEG {
        let found = petal.tally(deg, effort, |wi, exit| {
            let back = comes_back(wi, exit);
            [
                when(back, exit.remaining(&dark)),
                when(back, exit.remaining(&light)),
                when(back && exit.is_surface(), 1.0),
            ]
        });
        for (line, e) in lines.iter_mut().zip(found) {
            line.push((deg, e));
        }
    }
    let upright = |k: usize| ratio(lines[k][0].1, lines[k][6].1);
    let share = ratio(lines[2][6].1, lines[0][6].1);
    let findings = vec![
        Finding::new("exterior light, 0 deg over 82 deg", upright(2), Wanted::Below(0.2)),
        Finding::new("all light at 540 nm, 0 deg over 82 deg", upright(0), Wanted::Below(0.2)),
        Finding::new("all light at 680 nm, 0 deg over 82 deg", upright(1), Wanted::Between(0.8, 1.2)),
        Finding::new("exterior share of the light at 540 nm and 82 deg", share, Wanted::Above(0.5)),
    ];
    let [dark, light, exterior] = lines;
    Ok(Law {
        number: 3,
        name: "Velvet",
        claim: "With dark pigment, exterior light grows as view or light go to grazing, so outlines are brighter than centres.",
        source: "Hayashi and others 2015",
        method: "`rote_rose`: reflectance against the angle, at 540 nm (dark) and 680 nm (light), and its exterior part. By reciprocity \
                 it is the brightness seen from that angle under a uniform sky.",
        findings,
        remark: "At 540 nm nearly all light that comes back never entered the petal: the outline is that of the surface. Where the pigment is \
                 clear the petal looks almost the same from all angles.",
        chart: Chart {
            title: "Law 3: reverse shading of a dark petal".into(),
            x_label: "angle from the normal, deg".into(),
            y_label: "reflectance".into(),
            log_y: true,
            series: vec![
                Series::new("680 nm", light),
                Series::new("540 nm", dark),
                Series::new("exterior light", exterior),
            ],
        },
    })
}

//! Tables of one fit for the HTML page: statistics, parameters with their intervals drawn, correlations, audit.

use super::fit_text::{general, round};
use super::picture::escape;
use crate::fit::audit::{BandAudit, Covered};
use crate::fit::{Audit, End, Fit, Fitted, State};

/// Parameters beyond this make a square that does not fit a page: then the largest correlations are listed.
const MAX_SQUARE: usize = 16;
const MAX_LISTED: usize = 24;
/// Bands beyond this are counted, not shown.
const MAX_BANDS: usize = 6;

/// What the solver says.
pub(super) fn statistics(out: &mut String, fit: &Fit) {
    let shown = |x: Option<f64>| match x.filter(|x| x.is_finite()) {
        Some(x) => general(x, 6),
        None => "not defined".into(),
    };
    let searches = format!("{}, of which {} ended at the same minimum", fit.starts, fit.agreeing_starts);
    let rows = [
        ("Method", escape(&fit.method)),
        ("Weights", escape(&fit.weighting)),
        ("Search", fit.messages.first().map_or("not described".into(), |m| escape(m))),
        ("Starts", searches),
        ("Evaluations", fit.evaluations.to_string()),
        ("Readings, varied parameters", format!("{}, {}", fit.n, fit.varied)),
        ("χ², reduced χ²", format!("{}, {}", shown(Some(fit.chi2)), shown(fit.reduced_chi2))),
        ("AIC, BIC", format!("{}, {}", shown(fit.aic), shown(fit.bic))),
        ("R²", shown(fit.r2)),
        (
            "RMSE",
            format!("{} 1/sr; cube root {}", general(fit.rmse_per_sr, 4), general(fit.rmse_cube_root, 4)),
        ),
    ];
    out.push_str("<dl>\n");
    for (name, value) in rows {
        out.push_str(&format!("<dt>{name}</dt><dd>{value}</dd>\n"));
    }
    out.push_str("</dl>\n");
}

/// `0.3000 ± 0.0030`: two digits of the error, and the value to the same place.
fn with_error(value: f64, error: Option<f64>) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let Some(error) = error.filter(|e| e.is_finite() && *e > 0.0) else { return general(value, 5) };
    let place = 1 - error.log10().floor() as i32;
    if (0..=8).contains(&place) && value.abs() < 1e8 {
        format!("{value:.0$} ± {error:.0$}", place as usize)
    } else {
        format!("{} ± {}", general(value, 6), general(error, 2))
    }
}

/// Ends of the interval that is drawn, relative to the parameter's size: profile, else bootstrap, else two standard errors.
struct Drawn {
    low: f64,
    high: f64,
    bounds: [bool; 2],
}

fn drawn(p: &Fitted) -> Option<Drawn> {
    let is_bound = |e: End| matches!(e, End::Bound(_));
    let (low, high, bounds) = match (p.interval, p.bootstrap, p.standard_error) {
        (Some(i), _, _) => (i.low.value(), i.high.value(), [is_bound(i.low), is_bound(i.high)]),
        (_, Some([low, high]), _) => (low, high, [false; 2]),
        (_, _, Some(s)) => (p.value - 2.0 * s, p.value + 2.0 * s, [false; 2]),
        _ => return None,
    };
    // At zero a share of the value means nothing: the start says how large the parameter usually is.
    let size = p.value.abs().max(if p.value == 0.0 { p.start.abs() } else { 0.0 });
    let drawn = Drawn { low: (low - p.value) / size, high: (high - p.value) / size, bounds };
    (drawn.low.is_finite() && drawn.high.is_finite()).then_some(drawn)
}

/// The parameters, with their intervals drawn as shares of their values on one scale.
pub(super) fn parameters(out: &mut String, fit: &Fit) {
    if fit.parameters.is_empty() {
        return;
    }
    let widest = fit
        .parameters
        .iter()
        .filter_map(drawn)
        .map(|d| d.high.max(-d.low))
        .filter(|w| *w > 0.0)
        .fold(0.0, f64::max);
    // A round share; what is wider than the value itself runs out of the picture.
    let scale = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5].into_iter().find(|s| *s >= widest).unwrap_or(1.0);
    let level = fit.parameters.iter().find_map(|p| p.interval).map(|i| general(100.0 * i.level, 4));
    let interval = level.map_or("interval".to_owned(), |l| format!("{l} % interval"));
    let bootstrap = fit.parameters.iter().any(|p| p.bootstrap.is_some());
    out.push_str(&format!(
        "<div class=\"scroll\"><table>\n<caption>Parameters. Bars: interval as a share of the value, from −{0:.0} % to \
         +{0:.0} %; a tall end is a bound, an arrow runs on.</caption>\n<thead><tr><th>parameter</th>\
         <th>value ± standard error</th><th>{interval}</th><th></th>{1}<th>start</th><th>bounds</th>\
         <th class=\"text\">state</th></tr></thead>\n<tbody>\n",
        100.0 * scale,
        if bootstrap { "<th>bootstrap</th>" } else { "" }
    ));
    for p in &fit.parameters {
        let end = |e: End, sign: char| match e {
            End::Limit(v) => format!("{sign}{}", general((v - p.value).abs(), 3)),
            End::Bound(_) => "bound".to_owned(),
        };
        let ends = p.interval.map_or(String::new(), |i| format!("{} {}", end(i.low, '−'), end(i.high, '+')));
        let state = match p.state {
            State::Free => String::new(),
            State::Fixed => "fixed".into(),
            State::Tied => format!("= {}", escape(p.tie.as_deref().unwrap_or("tied"))),
            State::AtLower => "at its lower bound".into(),
            State::AtUpper => "at its upper bound".into(),
            State::Undetermined => "<strong>not determined by the data</strong>".into(),
        };
        let sampled = match p.bootstrap {
            _ if !bootstrap => String::new(),
            Some([low, high]) => format!("<td>{} to {}</td>", general(low, 4), general(high, 4)),
            None => "<td></td>".into(),
        };
        out.push_str(&format!(
            "<tr><td>{}<span class=\"meaning\">{}</span></td><td>{}</td><td>{ends}</td><td>{}</td>{sampled}<td>{}</td>\
             <td>{} to {}</td><td class=\"text\">{state}</td></tr>\n",
            escape(&p.name),
            escape(&p.meaning),
            with_error(p.value, p.standard_error),
            drawn(p).map_or(String::new(), |d| bar(&d, scale)),
            general(p.start, 4),
            general(p.min, 4),
            general(p.max, 4),
        ));
    }
    out.push_str("</tbody></table></div>\n");
}

/// A small error bar around a dot.
fn bar(d: &Drawn, scale: f64) -> String {
    const WIDTH: f64 = 150.0;
    let at = |share: f64| WIDTH / 2.0 + (WIDTH / 2.0 - 6.0) * (share / scale).clamp(-1.0, 1.0);
    let (low, high) = (at(d.low), at(d.high));
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"interval\" viewBox=\"0 0 150 16\" role=\"img\">\
         <title>interval</title><path d=\"M75 1V15\" stroke=\"var(--rule)\" stroke-width=\"1\" />\
         <path d=\"M{low:.1} 8H{high:.1}\" stroke=\"currentColor\" stroke-width=\"1.4\" />"
    );
    for (x, share, is_bound, outward) in [(low, d.low, d.bounds[0], -4.0), (high, d.high, d.bounds[1], 4.0)] {
        let path = if share.abs() > scale {
            format!("M{x:.1} 4.5l{outward} 3.5l{} 3.5", -outward)
        } else if is_bound {
            format!("M{x:.1} 1V15")
        } else {
            format!("M{x:.1} 5V11")
        };
        let width = if is_bound { 2.4 } else { 1.4 };
        svg.push_str(&format!(
            "<path d=\"{path}\" stroke=\"currentColor\" stroke-width=\"{width}\" fill=\"none\" />"
        ));
    }
    svg.push_str("<circle cx=\"75\" cy=\"8\" r=\"3\" fill=\"var(--accent)\" /></svg>");
    svg
}

/// Correlations as a square of colours, or the largest ones where there are many parameters.
pub(super) fn correlations(out: &mut String, fit: &Fit) {
    let known = |c: &&crate::fit::Correlation| {
        c.correlation.is_finite() && c.a.max(c.b) < fit.parameters.len() && c.a != c.b
    };
    let mut shown: Vec<_> = fit.correlations.iter().filter(known).collect();
    let mut varied: Vec<usize> = shown.iter().flat_map(|c| [c.a, c.b]).collect();
    varied.sort_unstable();
    varied.dedup();
    let name = |i: usize| escape(&fit.parameters[i].name);
    let color = |c: f64| {
        let rgb = if c < 0.0 { "36, 104, 184" } else { "190, 52, 44" };
        format!("background: rgba({rgb}, {:.2})", 0.75 * c.abs().min(1.0))
    };
    if shown.is_empty() {
        return;
    }
    if varied.len() > MAX_SQUARE {
        shown.sort_by(|a, b| b.correlation.abs().total_cmp(&a.correlation.abs()));
        shown.truncate(MAX_LISTED);
        out.push_str(&format!(
            "<table>\n<caption>The {} largest correlations.</caption>\n<thead><tr><th>between</th><th class=\"text\">and</th>\
             <th>correlation</th></tr></thead>\n<tbody>\n",
            shown.len()
        ));
        for c in shown {
            out.push_str(&format!(
                "<tr><td>{}</td><td class=\"text\">{}</td><td style=\"{}\">{:+.3}</td></tr>\n",
                name(c.a),
                name(c.b),
                color(c.correlation),
                c.correlation
            ));
        }
        out.push_str("</tbody></table>\n");
        return;
    }
    out.push_str("<div class=\"scroll\"><table class=\"heat\">\n<caption>Correlations of the varied parameters.</caption>\n");
    out.push_str("<thead><tr><th></th>");
    varied[..varied.len() - 1].iter().for_each(|&i| out.push_str(&format!("<th>{}</th>", name(i))));
    out.push_str("</tr></thead>\n<tbody>\n");
    for (row, &i) in varied.iter().enumerate().skip(1) {
        out.push_str(&format!("<tr><th>{}</th>", name(i)));
        for (column, &j) in varied[..varied.len() - 1].iter().enumerate() {
            let pair = |c: &&&crate::fit::Correlation| (c.a, c.b) == (j, i) || (c.a, c.b) == (i, j);
            match shown.iter().find(pair).filter(|_| column < row) {
                Some(c) => out.push_str(&format!(
                    "<td style=\"{}\">{:+.2}</td>",
                    color(c.correlation),
                    c.correlation
                )),
                None => out.push_str("<td class=\"none\"></td>"),
            }
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody></table></div>\n");
}

/// The audit: a verdict in words, and a table per band.
pub(super) fn audit(out: &mut String, audit: &Audit) {
    out.push_str("<h3>Audit: energy and reciprocity</h3>\n");
    for band in audit.bands.iter().take(MAX_BANDS) {
        out.push_str(&format!("<p>{}</p>\n", verdict(band)));
    }
    if audit.bands.len() > MAX_BANDS {
        let rest = &audit.bands[MAX_BANDS..];
        let broken = rest.iter().filter(|b| !b.conserves_energy || !b.is_reciprocal).count();
        out.push_str(&format!("<p>{} more bands, {broken} of them break a law.</p>\n", rest.len()));
    }
    out.push_str("<div class=\"side\">\n");
    for band in audit.bands.iter().take(MAX_BANDS) {
        let readings = band.totals.iter().any(|t| t.reflected_readings.or(t.transmitted_readings).is_some());
        out.push_str(&format!(
            "<table>\n<caption>Share of the light that leaves, {}. ●: the lamp was there.{}</caption>\n<thead><tr><th>lamp</th>\
             <th>reflected</th><th>transmitted</th><th>together</th><th>error</th>{}</tr></thead>\n<tbody>\n",
            escape(&band.band),
            if readings { " Right: over the part of the hemisphere that readings cover." } else { "" },
            if readings { "<th>covered</th><th>readings</th><th>model</th>" } else { "" }
        ));
        for t in &band.totals {
            let part = |f: fn(&Covered) -> String| {
                let parts: Vec<String> =
                    [t.reflected_readings, t.transmitted_readings].iter().flatten().map(f).collect();
                format!("<td>{}</td>", parts.join(" / "))
            };
            let covered = if readings {
                part(|c| format!("{:.0} %", 100.0 * c.share))
                    + &part(|c| format!("{:.4}", c.measured))
                    + &part(|c| format!("{:.4}", c.modelled))
            } else {
                String::new()
            };
            let abaxial = if t.side == crate::geometry::Side::Abaxial { " abaxial" } else { "" };
            out.push_str(&format!(
                "<tr{}><td>{}°{abaxial}</td><td>{:.4}</td><td>{:.4}</td><td>{:.4}</td><td>{}</td>{covered}</tr>\n",
                if t.measured { " class=\"lamp\"" } else { "" },
                round(t.incident_deg),
                t.reflectance,
                t.transmittance,
                t.total(),
                general(t.error, 1)
            ));
        }
        out.push_str("</tbody></table>\n");
    }
    out.push_str("</div>\n");
}

fn verdict(band: &BandAudit) -> String {
    let energy = band.totals.get(band.largest).map_or(String::new(), |t| {
        let place = format!("{:.4} at {}°", t.total(), round(t.incident_deg));
        if band.conserves_energy {
            format!("energy is conserved (largest total {place})")
        } else {
            format!("<strong>energy is not conserved</strong>: {place}, {:.4} too much", t.total() - 1.0)
        }
    });
    let [ta, pa, tb, pb] = band.asymmetry_at_deg.map(|a| a.round());
    let difference = general(100.0 * band.largest_asymmetry, 2);
    let reciprocity = if band.is_reciprocal {
        format!("the BSDF is reciprocal (largest difference {difference} %)")
    } else {
        format!(
            "<strong>the BSDF is not reciprocal</strong>: {difference} % between ({ta}°, {pa}°) and ({tb}°, {pb}°)"
        )
    };
    format!("{}: {energy}; {reciprocity}.", escape(&band.band))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::toy::{self, Toy};
    use crate::gonio::Band;

    #[test]
    fn values_end_where_their_errors_do() {
        assert_eq!(with_error(0.3, Some(0.003)), "0.3000 ± 0.0030");
        assert_eq!(with_error(18.5, Some(2.34)), "18.5 ± 2.3");
        assert_eq!(with_error(1234.5, Some(120.0)), "1234.5 ± 120");
        assert_eq!(with_error(0.25, None), "0.25");
        assert_eq!(with_error(f64::NAN, Some(1.0)), "–");
    }

    #[test]
    fn many_parameters_are_listed_by_correlation() {
        let toy = Toy::new(1.0);
        let fit = |bands: u32| {
            let m = crate::gonio::Measurement {
                bands: (0..bands).map(|b| Band::nm(400.0 + f64::from(b))).collect(),
                ..Default::default()
            };
            toy::fit(&toy, &m, &[0.3, 0.1, 0.05, 20.0])
        };
        let (mut few, mut many) = (String::new(), String::new());
        correlations(&mut few, &fit(1));
        correlations(&mut many, &fit(20));
        assert!(few.contains("class=\"heat\"") && many.contains("24 largest"));
    }
}

//! A report on fits as one HTML page: no scripts, no fonts, no pictures from elsewhere; it can be mailed and printed.
//!
//! The page is well-formed XML, so that programs can read it too. Every text that came from a file or a command is
//! escaped. Warnings come first, then data, the comparison, the best fit, the other fits folded.

use super::fit_parts::{audit, correlations, parameters, statistics};
use super::fit_plot::{self, FittedModel};
use super::fit_text::{general, round};
use super::html;
use super::picture::{Picture, escape, spread};
use super::residual_map::residual_map;
use crate::fit::{LadderRow, Model, Report};
use crate::gonio::{Measurement, Scale};
use crate::{Error, Result};

/// Models in one picture of curves.
const MAX_COMPARED: usize = 5;

/// The page. `models` are those of `report.fits`, in their order.
pub fn page(report: &Report, measurement: &Measurement, models: &[&dyn Model]) -> Result<String> {
    if models.len() != report.fits.len() {
        return Err(Error::invalid("models", format!("{} for {} fits", models.len(), report.fits.len())));
    }
    let fitted: Vec<FittedModel> =
        models.iter().zip(&report.fits).map(|(&model, fit)| FittedModel { model, fit }).collect();
    let data = &report.data;
    let title = if data.sample.trim().is_empty() { &data.file } else { &data.sample };
    let mut out = String::new();
    head(&mut out, report, title);
    warnings(&mut out, report);
    data_table(&mut out, report);
    if report.fits.len() > 1 {
        comparison(&mut out, report, measurement, &fitted)?;
    }
    let best = report.ladder.iter().position(|r| r.best).unwrap_or(0);
    let order = (0..fitted.len()).filter(|&i| i == best).chain((0..fitted.len()).filter(|&i| i != best));
    for i in order {
        let folded = i != best;
        if folded {
            out.push_str(&format!("<details><summary>{}</summary>\n", escape(&fitted[i].fit.model)));
        }
        one_fit(&mut out, report, measurement, fitted[i])?;
        if folded {
            out.push_str("</details>\n");
        }
    }
    out.push_str(HOW_TO_READ);
    out.push_str(&html::footer(&report.tool, &report.version));
    Ok(html::document(&format!("{title} – fit report"), &out))
}

fn head(out: &mut String, report: &Report, title: &str) {
    let data = &report.data;
    let models: Vec<String> = report.fits.iter().map(|f| escape(&f.model)).collect();
    let names = match models.as_slice() {
        [] => "no model".to_owned(),
        [only] => only.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    };
    out.push_str(&format!(
        "<header>\n<p class=\"kicker\">Fit report</p>\n<h1>{}</h1>\n<p class=\"lead\">{} readings, fitted by {names}.</p>\n",
        escape(title),
        data.readings
    ));
    if let Some(command) = &report.command {
        out.push_str(&format!("<pre>{}</pre>\n", escape(command)));
    }
    out.push_str("</header>\n");
}

fn warnings(out: &mut String, report: &Report) {
    let warnings = report.warnings();
    if warnings.is_empty() {
        out.push_str("<p>No warnings: every search ended at a minimum, and the fitted models keep energy and reciprocity \
                      wherever they were audited.</p>\n");
        return;
    }
    out.push_str("<section class=\"notice\">\n<h2>Read this first</h2>\n<ul>\n");
    for (about, what) in warnings {
        out.push_str(&format!("<li><strong>{}</strong>: {}</li>\n", escape(&about), escape(&what)));
    }
    out.push_str("</ul>\n</section>\n");
}

fn data_table(out: &mut String, report: &Report) {
    let data = &report.data;
    let list = |names: Vec<String>| match names.len() {
        0 => "none".to_owned(),
        n if n <= 12 => names.join(", "),
        n => format!("{}, … {} ({n})", names[..8].join(", "), names[n - 1]),
    };
    let lamps = data.lamps.iter().map(|l| format!("{}°", round(l.incident_deg))).collect();
    let unit = match data.scale {
        Scale::Absolute => "1/sr",
        Scale::RelativePerSeries => "unknown unit, one gain per series",
    };
    let cones = match (data.source_half_angle_deg, data.detector_half_angle_deg) {
        (0.0, 0.0) => "parallel beam, point detector".to_owned(),
        (source, detector) => format!("half angles {source}° (source), {detector}° (detector)"),
    };
    let [least, most] = data.range_per_sr.map(|v| general(v, 4));
    let rows = [
        ("File", data.file.clone()),
        ("SHA-256", data.sha256.clone()),
        ("Quantity", data.quantity.clone()),
        ("Readings", format!("{}, from {least} to {most} ({unit})", data.readings)),
        (
            "Standard deviations",
            if data.has_sigma { "given for every reading" } else { "not given" }.to_owned(),
        ),
        ("Bands", list(data.bands.iter().map(|b| b.name.clone()).collect())),
        ("Series", list(data.series.clone())),
        ("Lamp at", list(lamps)),
        ("Instrument", cones),
    ];
    out.push_str("<h2>Data</h2>\n<dl>\n");
    for (name, value) in rows {
        let value = escape(&value);
        let value = if name == "SHA-256" { format!("<code>{value}</code>") } else { value };
        out.push_str(&format!("<dt>{name}</dt><dd>{value}</dd>\n"));
    }
    out.push_str("</dl>\n");
}

fn comparison(
    out: &mut String,
    report: &Report,
    measurement: &Measurement,
    fitted: &[FittedModel],
) -> Result<()> {
    out.push_str("<h2>Comparison of models</h2>\n<div class=\"scroll\"><table>\n");
    out.push_str(
        "<caption>Lower is better in every column from RMSE on; the lowest AIC is in colour.</caption>\n\
         <thead><tr><th>model</th><th>parameters</th><th>N</th><th>RMSE, 1/sr</th><th>RMSE, cube root</th>\
         <th>reduced χ²</th><th>AIC</th><th>BIC</th><th>ΔAIC</th></tr></thead>\n<tbody>\n",
    );
    for row in &report.ladder {
        out.push_str(&ladder_row(row));
    }
    out.push_str("</tbody></table></div>\n");
    figure(out, &fit_plot::ladder(&report.ladder), "Comparison of models", "Misfit of the models.");
    // The best, the worst, and some between.
    let mut by_misfit: Vec<&FittedModel> = fitted.iter().collect();
    by_misfit.sort_by(|a, b| a.fit.rmse_per_sr.total_cmp(&b.fit.rmse_per_sr));
    let shown: Vec<FittedModel> =
        spread(by_misfit.len(), MAX_COMPARED).into_iter().map(|i| *by_misfit[i]).collect();
    let band = measurement.bands.len() / 2;
    if let Some(name) = measurement.bands.get(band).map(|b| escape(&b.name))
        && let Some(picture) = fit_plot::compare(measurement, &shown, band)?
    {
        let caption = format!("Measured, and fitted models, in the planes of incidence ({name}).");
        figure(out, &picture, "Models in the plane of incidence", &caption);
    }
    Ok(())
}

fn ladder_row(row: &LadderRow) -> String {
    let decimal = |x: Option<f64>| x.map_or("–".to_owned(), |x| format!("{x:.1}"));
    format!(
        "<tr{}><td>{}{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
        if row.best { " class=\"best\"" } else { "" },
        escape(&row.model),
        if row.converged { "" } else { " (not converged)" },
        row.parameters,
        row.n,
        general(row.rmse_per_sr, 4),
        general(row.rmse_cube_root, 4),
        row.reduced_chi2.map_or("–".into(), |x| general(x, 4)),
        decimal(row.aic),
        decimal(row.bic),
        decimal(row.delta_aic),
    )
}

fn one_fit(out: &mut String, report: &Report, measurement: &Measurement, fitted: FittedModel) -> Result<()> {
    let fit = fitted.fit;
    let name = escape(&fit.model);
    out.push_str(&format!("<h2>{name}</h2>\n"));
    statistics(out, fit);
    parameters(out, fit);
    if let Some(picture) = fit_plot::in_plane(measurement, fitted)? {
        let caption = "Readings (points; bars: one standard deviation, where it is known) and model (lines) in the planes \
                       of incidence.";
        figure(out, &picture, "Readings and model in the plane of incidence", caption);
    }
    if let Some(picture) = residual_map(measurement, fit) {
        let caption = "Standardised residuals over the hemisphere, seen from above; equal areas are equal projected solid \
                       angles. Ring: lamp; cross: mirror direction. Blue: the model is too dark, red: too bright.";
        figure(out, &picture, "Residuals over the hemisphere", caption);
    }
    let caption = "Standardised residuals, with the normal distribution.";
    figure(out, &fit_plot::histogram(fit), "Histogram of residuals", caption);
    correlations(out, fit);
    if let Some(found) = report.audit(&fit.model) {
        audit(out, found);
    }
    Ok(())
}

/// `caption` is HTML.
fn figure(out: &mut String, picture: &Picture, title: &str, caption: &str) {
    let svg = picture.inline_svg(out.matches("<figure>").count(), title);
    out.push_str(&format!("<figure>\n{svg}\n<figcaption>{caption}</figcaption>\n</figure>\n"));
}

const HOW_TO_READ: &str = "<section>\n<h2>How to read this</h2>\n\
<p><strong>χ²</strong> is the sum of the squared weighted residuals, <strong>reduced χ²</strong> the same over readings less \
varied parameters: near 1 where the model is right and the standard deviations are true. <strong>AIC</strong> = N ln(χ²/N) + \
2P and <strong>BIC</strong> = N ln(χ²/N) + P ln N weigh misfit against the number P of parameters; lower is better, and only \
differences between fits of the same readings with the same weights mean something.</p>\n\
<p>The <strong>standard error</strong> is one standard deviation from the curvature at the minimum. The \
<strong>profile interval</strong> holds all values for which the best fit of the other parameters is not much worse; it need \
not be symmetric, and ends at a <em>bound</em> where the data do not exclude it. A parameter that the data do not determine \
must not be quoted.</p>\n\
<p><strong>RMSE, 1/sr</strong> weighs readings by solid angle times cosine; <strong>RMSE, cube root</strong> compares cube \
roots, which is closer to what eyes see. <strong>Standardised residuals</strong> are (model − reading) × weight over the root \
of the reduced χ²; patterns in the maps are light that the model does not know of.</p>\n\
<p>The <strong>audit</strong> integrates the fitted model: reflectance and transmittance for a lamp at every angle may not \
exceed 1 together, and exchanging lamp and detector may change nothing.</p>\n</section>\n";

#[cfg(test)]
mod tests {
    use quick_xml::Reader;
    use quick_xml::events::Event;

    use super::*;
    use crate::fit::toy::{self, Toy};
    use crate::fit::{Audit, DataInfo, Fit};

    const VALUES: [f64; 4] = [0.3, 0.0, 0.05, 20.0];

    fn report(m: &Measurement, fits: Vec<Fit>) -> String {
        let toy = Toy::new(1.0);
        let audits = fits.iter().map(|f| Audit::new(&toy, f, m, &[]).unwrap()).collect();
        let data = DataInfo::new("<script>alert(1)</script>.csv", b"", "BRF & more", m);
        let models: Vec<&dyn Model> = fits.iter().map(|_| &toy as &dyn Model).collect();
        let command = Some("rosarium fit \"<x>\" --model all".to_owned());
        page(&Report::new(command, data, fits, audits), m, &models).unwrap()
    }

    /// Reads the page as XML; every attribute and text must unescape.
    fn check(page: &str) {
        let mut reader = Reader::from_str(page);
        let mut open = Vec::new();
        loop {
            match reader.read_event() {
                Ok(Event::Start(e)) => {
                    e.attributes().for_each(|a| {
                        let a = a.unwrap();
                        assert!(!matches!(a.key.as_ref(), "src" | "href" | "xlink:href"), "{a:?}");
                    });
                    open.push(e.name().as_ref().to_owned());
                }
                Ok(Event::End(e)) => assert_eq!(open.pop().unwrap(), e.name().as_ref()),
                Ok(Event::Empty(e)) => e.attributes().for_each(|a| drop(a.unwrap())),
                Ok(Event::Eof) => break,
                Ok(_) => {}
                Err(e) => panic!("{e} at {}", reader.buffer_position()),
            }
        }
        assert!(open.is_empty());
        for forbidden in ["<script", "@import", "NaN", ">inf<"] {
            assert!(!page.contains(forbidden), "{forbidden}");
        }
        // A clip is used from where it is defined, in this page, once.
        for (at, used) in page.match_indices("url(") {
            let id = page[at + used.len()..].strip_prefix('#').and_then(|s| s.split(')').next()).unwrap();
            assert_eq!(page.matches(&format!("id=\"{id}\"")).count(), 1, "{id}");
        }
        // Names of namespaces are the only addresses.
        let addresses = page.matches("://").count();
        assert_eq!(addresses, page.matches("xmlns=\"http://www.w3.org/").count());
    }

    #[test]
    fn the_page_is_well_formed_and_stands_alone() {
        let toy = Toy::new(1.0);
        let mut m = toy::measurement(&toy, &VALUES, &[0.0, 30.0], &[450.0, 650.0], &["a", "<b>"]);
        m.sample = "<script>x</script> \u{1} & rose".into();
        m.notes = vec!["3 readings < 0 left out".into()];
        let good = toy::fit(&toy, &m, &VALUES);
        let mut other = toy::fit(&toy, &m, &[0.5, 0.2, 0.0, 1.0]);
        other.model = "<i>other</i>".into();
        other.messages = vec!["ended at a minimum".into(), "a & b".into()];
        let page = report(&m, vec![other.clone(), good.clone()]);
        assert_eq!(page, report(&m, vec![other, good]), "the same report gives the same bytes");
        check(&page);
        for part in [
            "&lt;script&gt;x&lt;/script&gt; \u{fffd} &amp; rose",
            "rosarium fit &quot;&lt;x&gt;&quot; --model all",
            "3 readings &lt; 0 left out",
            "Read this first",
            "a &amp; b",
            "class=\"best\"",
            "BRF &amp; more",
            "<details>",
        ] {
            assert!(page.contains(part), "{part}");
        }
    }

    #[test]
    fn degenerate_fits_have_a_page() {
        let toy = Toy::new(1.0);
        let mut m = toy::measurement(&toy, &VALUES, &[30.0], &[550.0], &["a"]);
        m.readings.truncate(1);
        let mut fit = toy::fit(&toy, &m, &VALUES);
        (fit.aic, fit.bic, fit.r2, fit.reduced_chi2) = (None, None, None, Some(f64::NAN));
        fit.correlations.clear();
        for p in &mut fit.parameters {
            (p.standard_error, p.interval) = (None, None);
        }
        check(&report(&m, vec![fit.clone()]));
        m.readings.clear();
        (fit.modelled, fit.residuals, fit.n) = (Vec::new(), Vec::new(), 0);
        fit.parameters.iter_mut().for_each(|p| p.value = f64::NAN);
        fit.parameters.clear();
        check(&report(&m, vec![fit.clone()]));
        check(&report(&m, Vec::new()));
        assert!(
            page(&Report::new(None, DataInfo::new("", b"", "", &m), vec![fit], Vec::new()), &m, &[]).is_err()
        );
    }
}

//! What all plots share: a drawn picture as SVG or PNG, colours, marks of the lamp and of the mirror.

use kuva::plot::LegendShape;
use kuva::prelude::{LegendEntry, LinePlot, LineStyle, Plot};
use kuva::render::render::Scene;

use crate::{Error, Result};

/// Colours that stay apart for most eyes (Okabe and Ito 2008), without their yellow.
pub(super) const COLORS: [&str; 7] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#777777"];
pub(super) const GREY: &str = "#777777";
pub(super) const MIRROR_DASH: &str = "3 5";

/// A picture that was drawn and not yet written.
pub struct Picture {
    scene: Scene,
}

impl Picture {
    pub(super) fn new(scene: Scene) -> Self {
        Self { scene }
    }

    /// As an SVG document.
    pub fn svg(&self) -> String {
        self.named("clip-")
    }

    /// The document, with its clips named from `prefix`: the plotting library numbers them over the whole process, and the
    /// same picture should give the same bytes.
    fn named(&self, prefix: &str) -> String {
        const NAMES: [(&str, &str); 2] = [("<clipPath id=\"kuva-clip-", "\""), ("url(#kuva-clip-", ")")];
        let mut svg = kuva::backend::svg::SvgBackend::default().render_scene(&self.scene);
        let definition = NAMES[0].0;
        let numbers: Vec<String> = svg
            .match_indices(definition)
            .filter_map(|(at, _)| svg[at + definition.len()..].split('"').next())
            .map(str::to_owned)
            .collect();
        for (k, number) in numbers.iter().enumerate() {
            for (before, after) in NAMES {
                let name = before.replace("kuva-clip-", prefix);
                svg = svg.replace(&format!("{before}{number}{after}"), &format!("{name}{k}{after}"));
            }
        }
        svg
    }

    /// As PNG bytes, at twice the size of the SVG.
    pub fn png(&self) -> Result<Vec<u8>> {
        kuva::backend::png::PngBackend::new()
            .render_scene(&self.scene)
            .map_err(|e| Error::Unsupported(format!("PNG of this plot: {e}")))
    }

    /// As an SVG element for a page: it scales with the page and takes its colours of ink and paper from there
    /// (`currentColor`, `--paper`, `--rule`). `id` keeps its names apart from those of other pictures, `title` is what a screen
    /// reader says.
    pub(super) fn inline_svg(&self, id: usize, title: &str) -> String {
        let svg = self.named(&format!("picture-{id}-"));
        let body = svg.split_once('>').map_or("", |(_, body)| body);
        // Quotes are escaped in texts, so these can only be attributes.
        let body = body
            .replace("<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\" />", "")
            .replace("<rect width=\"100%\" height=\"100%\" fill=\"white\" />", "")
            .replace("=\"#000000\"", "=\"currentColor\"")
            .replace("=\"black\"", "=\"currentColor\"")
            .replace("=\"#ffffff\"", "=\"var(--paper)\"")
            .replace("=\"white\"", "=\"var(--paper)\"")
            .replace("=\"#cccccc\"", "=\"var(--rule)\"")
            .replace("=\"#ccc\"", "=\"var(--rule)\"");
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" viewBox=\"0 0 {:.0} {:.0}\" \
             style=\"max-width:{:.0}px\" fill=\"currentColor\"><title>{}</title>{body}",
            self.scene.width,
            self.scene.height,
            self.scene.width,
            escape(title)
        )
    }
}

/// Text for XML, in elements and attributes. Characters that XML does not allow become U+FFFD.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(allowed(c)),
        }
    }
    out
}

/// A character that XML allows.
fn allowed(c: char) -> char {
    match c {
        '\t' | '\n' => c,
        c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => '\u{fffd}',
        c => c,
    }
}

/// A text from a file as a label: what XML allows, of at most `limit` characters, without the marks of formulas.
pub(super) fn label(text: &str, limit: usize) -> String {
    let plain: Vec<char> = text.chars().filter(|c| !matches!(c, '$' | '\\')).map(allowed).collect();
    if plain.len() <= limit {
        return plain.into_iter().collect();
    }
    plain[..limit.saturating_sub(1)].iter().chain(&['…']).collect()
}

/// Lines from the axis up to `top`: solid at the lamp's angle, dotted at the mirror's.
pub(super) fn lamp_and_mirror(lamp_deg: f64, top: f64, color: &str) -> [Plot; 2] {
    [(lamp_deg, LineStyle::Solid), (-lamp_deg, LineStyle::Custom(MIRROR_DASH.into()))].map(
        |(angle, style)| {
            Plot::Line(
                LinePlot::new()
                    .with_data([(angle, 0.0), (angle, top)])
                    .with_color(color)
                    .with_stroke_width(0.8)
                    .with_line_style(style),
            )
        },
    )
}

/// A line in a legend.
pub(super) fn line_entry(label: impl Into<String>, color: &str, dash: Option<&str>) -> LegendEntry {
    LegendEntry {
        label: label.into(),
        color: color.to_owned(),
        shape: LegendShape::Line,
        dasharray: dash.map(str::to_owned),
    }
}

/// A point in a legend.
pub(super) fn point_entry(label: impl Into<String>, color: &str) -> LegendEntry {
    LegendEntry { label: label.into(), color: color.to_owned(), shape: LegendShape::Circle, dasharray: None }
}

/// Reflection, transmission on the mirror's side and on the lamp's, of points by increasing signed angle: no line may
/// cross the horizon.
pub(super) fn stretches<T>(points: &[(f64, T)]) -> [&[(f64, T)]; 3] {
    let low = points.partition_point(|p| p.0 < -90.0);
    let high = points.partition_point(|p| p.0 <= 90.0);
    [&points[low..high], &points[..low], &points[high..]]
}

/// At most `limit` of `n` things, evenly spread, the first and the last among them.
pub(super) fn spread(n: usize, limit: usize) -> Vec<usize> {
    if n <= limit {
        return (0..n).collect();
    }
    (0..limit).map(|k| k * (n - 1) / (limit.max(2) - 1)).collect()
}

/// An integer in superscript digits.
pub(super) fn superscript(n: i32) -> String {
    let raise = |c| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32('⁰' as u32 + (digit as u32 - '0' as u32)).unwrap_or(digit),
    };
    n.to_string().chars().map(raise).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_made_harmless() {
        assert_eq!(escape("a<b & 'c'\u{1}"), "a&lt;b &amp; &#39;c&#39;\u{fffd}");
        assert_eq!(label("$x$ long name", 6), "x lon…");
        assert_eq!(superscript(-12), "⁻¹²");
    }

    #[test]
    fn a_spread_has_both_ends() {
        assert_eq!(spread(3, 5), [0, 1, 2]);
        assert_eq!(spread(11, 3), [0, 5, 10]);
        assert_eq!(spread(100, 1), [0]);
        assert!(spread(0, 4).is_empty());
    }

    #[test]
    fn no_line_crosses_the_horizon() {
        let points = [-170.0, -91.0, -90.0, 0.0, 90.0, 120.0].map(|a| (a, ()));
        let [reflection, mirror_side, lamp_side] = stretches(&points);
        assert_eq!((reflection.len(), mirror_side.len(), lamp_side.len()), (3, 2, 1));
    }
}

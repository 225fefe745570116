//! Pictures with the commands that make them as one HTML page: no scripts, no fonts, nothing from elsewhere, so it can be
//! mailed, printed and opened without a network. The pictures are inside (data URIs).
//!
//! The page is well-formed XML. All texts are plain and are escaped here.

use super::base64;
use super::html::{self, escape};

/// The page.
#[derive(Clone, Debug, Default)]
pub struct FigurePage {
    /// Headline and title of the window.
    pub title: String,
    /// What the page is, in a sentence or two.
    pub lead: String,
    /// Command that makes the whole page.
    pub command: String,
    /// How the commands below are used.
    pub note: String,
    /// The sections in their order.
    pub sections: Vec<Section>,
    /// Program and version.
    pub made_by: (String, String),
}

/// One subject.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// Name for links, of letters and digits.
    pub id: String,
    /// Headline.
    pub title: String,
    /// Paragraphs.
    pub text: Vec<String>,
    /// Something that the reader has to know before the pictures.
    pub notice: Option<String>,
    /// Pictures.
    pub figures: Vec<Figure>,
    /// Pictures beside each other, where there is room for them.
    pub columns: usize,
    /// Tables.
    pub tables: Vec<Table>,
    /// How long the section took, s.
    pub seconds: f64,
}

/// A picture.
#[derive(Clone, Debug, Default)]
pub struct Figure {
    /// What it shows, for those who do not see it.
    pub alt: String,
    /// What it says.
    pub caption: String,
    /// PNG or SVG.
    pub picture: Vec<u8>,
    /// The commands that make it, the last one of which writes it.
    pub commands: Vec<String>,
    /// How long the last command took, s.
    pub seconds: f64,
}

/// Numbers.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// What they are.
    pub caption: String,
    /// Names of the columns.
    pub head: Vec<String>,
    /// As many entries per row as there are columns.
    pub rows: Vec<Vec<String>>,
}

/// Writes the page.
pub fn write(page: &FigurePage) -> String {
    let mut out = format!(
        "<header>\n<h1>{}</h1>\n<p class=\"lead\">{}</p>\n<pre>{}</pre>\n<p>{}</p>\n</header>\n",
        escape(&page.title),
        escape(&page.lead),
        escape(&page.command),
        escape(&page.note)
    );
    out.push_str("<nav>\n<ol>\n");
    for section in &page.sections {
        out.push_str(&format!(
            "<li><a href=\"#{}\">{}</a></li>\n",
            escape(&section.id),
            escape(&section.title)
        ));
    }
    out.push_str("</ol>\n</nav>\n");
    for section in &page.sections {
        write_section(&mut out, section);
    }
    let (tool, version) = &page.made_by;
    out.push_str(&html::footer(tool, version));
    html::document(&page.title, &out)
}

fn write_section(out: &mut String, section: &Section) {
    out.push_str(&format!("<section id=\"{}\">\n<h2>{}</h2>\n", escape(&section.id), escape(&section.title)));
    for paragraph in &section.text {
        out.push_str(&format!("<p>{}</p>\n", escape(paragraph)));
    }
    if let Some(notice) = &section.notice {
        out.push_str(&format!("<div class=\"notice\"><p>{}</p></div>\n", escape(notice)));
    }
    let columns = section.columns.clamp(1, 6);
    // Small pictures stay in their row on a phone, too.
    let least_rem = if columns > 3 { 9 } else { 18 };
    out.push_str(&format!(
        "<div class=\"pictures\" style=\"--columns: {columns}; --least: {least_rem}rem\">\n"
    ));
    for figure in &section.figures {
        write_figure(out, figure);
    }
    out.push_str("</div>\n");
    for table in &section.tables {
        write_table(out, table);
    }
    out.push_str(&format!("<p class=\"time\">Made in {}.</p>\n</section>\n", duration(section.seconds)));
}

fn write_figure(out: &mut String, figure: &Figure) {
    // Pixels fill the frame; a drawing keeps the size of its letters.
    let (kind, class) = if figure.picture.starts_with(b"\x89PNG") {
        ("image/png", " class=\"photo\"")
    } else {
        ("image/svg+xml", "")
    };
    let commands: Vec<String> = figure.commands.iter().map(|c| escape(c)).collect();
    out.push_str(&format!(
        "<figure>\n<img{class} src=\"data:{kind};base64,{}\" alt=\"{}\" />\n<figcaption>{} ({})</figcaption>\n\
         <details class=\"command\"><summary>The command</summary><pre>{}</pre></details>\n</figure>\n",
        base64::encode(&figure.picture),
        escape(&figure.alt),
        escape(&figure.caption),
        duration(figure.seconds),
        commands.join("\n")
    ));
}

fn write_table(out: &mut String, table: &Table) {
    let row = |cells: &[String], tag: &str| -> String {
        cells.iter().map(|c| format!("<{tag}>{}</{tag}>", escape(c))).collect()
    };
    out.push_str(&format!(
        "<div class=\"scroll\"><table>\n<caption>{}</caption>\n<thead><tr>{}</tr></thead>\n<tbody>\n",
        escape(&table.caption),
        row(&table.head, "th")
    ));
    for cells in &table.rows {
        out.push_str(&format!("<tr>{}</tr>\n", row(cells, "td")));
    }
    out.push_str("</tbody>\n</table></div>\n");
}

/// A time in the unit that fits.
fn duration(seconds: f64) -> String {
    if seconds < 90.0 {
        return format!("{seconds:.1} s");
    }
    let whole = seconds.round() as u64;
    format!("{} min {} s", whole / 60, whole % 60)
}

#[cfg(test)]
mod tests {
    use quick_xml::Reader;
    use quick_xml::events::Event;

    use super::*;

    fn page() -> FigurePage {
        let evil = "<script>x</script> & \"y\" \u{1}".to_owned();
        let figure = Figure {
            alt: evil.clone(),
            caption: evil.clone(),
            picture: b"\x89PNG and more".to_vec(),
            commands: vec!["rosarium a".to_owned(), "rosarium b > c".to_owned()],
            seconds: 1.26,
        };
        let table = Table {
            caption: evil.clone(),
            head: vec!["a".to_owned(), evil.clone()],
            rows: vec![vec![evil.clone(), "1".to_owned()]],
        };
        let section = Section {
            id: "one".to_owned(),
            title: evil.clone(),
            text: vec![evil.clone()],
            notice: Some(evil.clone()),
            figures: vec![figure.clone(), Figure { picture: b"<svg/>".to_vec(), ..figure }],
            columns: 2,
            tables: vec![table],
            seconds: 754.0,
        };
        FigurePage {
            title: evil.clone(),
            lead: evil.clone(),
            command: evil.clone(),
            note: evil.clone(),
            sections: vec![section],
            made_by: (evil, "1".to_owned()),
        }
    }

    #[test]
    fn the_page_is_well_formed_and_stands_alone() {
        let text = write(&page());
        let mut reader = Reader::from_str(&text);
        let (mut open, mut pictures) = (Vec::new(), 0);
        loop {
            match reader.read_event().expect("XML") {
                Event::Start(e) => open.push(e.name().as_ref().to_owned()),
                Event::End(e) => assert_eq!(open.pop().as_deref(), Some(e.name().as_ref())),
                Event::Empty(e) => {
                    let of = |name: &str| e.attributes().flatten().find(|a| a.key.as_ref() == name);
                    if e.name().as_ref() == "img" {
                        assert!(of("src").expect("a picture").value.as_ref().starts_with("data:image/"));
                        assert!(!of("alt").expect("a text").value.is_empty());
                        pictures += 1;
                    }
                }
                Event::Eof => break,
                _ => {}
            }
        }
        assert!(open.is_empty() && pictures == 2);
        for forbidden in ["<script", "@import", "http://", "https://"] {
            let allowed = usize::from(forbidden == "http://");
            assert_eq!(text.matches(forbidden).count(), allowed, "{forbidden}");
        }
        for part in
            ["rosarium a\nrosarium b &gt; c", "12 min 34 s", "(1.3 s)", "href=\"#one\"", "image/svg+xml"]
        {
            assert!(text.contains(part), "{part}");
        }
        assert_eq!(text, write(&page()), "the same page gives the same bytes");
    }

    #[test]
    fn an_empty_page_is_a_page() {
        assert!(write(&FigurePage::default()).contains("<main>"));
    }
}

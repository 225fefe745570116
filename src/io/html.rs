//! What all HTML pages share: the document around the body, its style, its last line. A page stands alone (no scripts, no
//! fonts, no pictures from elsewhere) and is well-formed XML, so that programs can read it too.

pub(super) use super::picture::escape;

/// A whole page. `title` is plain text, `body` is HTML.
pub(super) fn document(title: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n\
         <html xmlns=\"http://www.w3.org/1999/xhtml\" lang=\"en\">\n<head>\n<meta charset=\"utf-8\" />\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\" />\n\
         <title>{}</title>\n<style>\n{}</style>\n</head>\n<body>\n<main>\n{body}</main>\n</body>\n</html>\n",
        escape(title),
        include_str!("page.css")
    )
}

/// The last line: which program made the page.
pub(super) fn footer(tool: &str, version: &str) -> String {
    format!("<footer>Made by {} {}.</footer>\n", escape(tool), escape(version))
}

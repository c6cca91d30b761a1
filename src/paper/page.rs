//! The page round the figures: its head and style, headings, tables, numbers with their errors.

use std::fmt::Write;

const STYLE: &str = "
:root { --ink: #222; --soft: #666; --rule: #d5d5d5; --claim: #b23a2e; }
* { box-sizing: border-box; }
body { font: 15px/1.5 Georgia, 'Times New Roman', serif; color: var(--ink); max-width: 900px; margin: 2.2em auto; padding: 0 1.2em; }
h1 { font-size: 1.55em; font-weight: normal; margin: 0 0 .1em; }
h2 { font-size: 1.1em; margin: 2em 0 .5em; border-bottom: 1px solid var(--rule); padding-bottom: .2em; }
p { margin: .5em 0; max-width: 48em; }
.under { color: var(--soft); margin: 0 0 1.2em; }
.sentence { font-size: 1.15em; border-left: 4px solid var(--claim); padding: .3em 0 .3em .9em; margin: 1em 0; max-width: 44em; }
.consistent .sentence { border-color: #4a7c59; }
table { border-collapse: collapse; margin: .6em 0 1em; font: 13.5px/1.45 Helvetica, Arial, sans-serif; font-variant-numeric: tabular-nums; }
caption { text-align: left; color: var(--soft); padding-bottom: .3em; }
th { text-align: left; font-weight: bold; border-bottom: 1.5px solid var(--ink); padding: .2em 1.2em .2em 0; vertical-align: bottom; }
td { border-bottom: 1px solid var(--rule); padding: .22em 1.2em .22em 0; vertical-align: top; }
td.n, th.n { text-align: right; }
td.t, th.t { white-space: nowrap; }
figure { margin: 1em 0 1.4em; page-break-inside: avoid; break-inside: avoid; }
figure svg { width: 100%; height: auto; display: block; }
figcaption { color: var(--soft); font-size: .9em; max-width: 52em; }
.columns { columns: 2; column-gap: 3em; } .columns table { width: 100%; break-inside: auto; margin-top: 0; }
footer { margin-top: 3em; border-top: 1px solid var(--rule); color: var(--soft); font-size: .85em; }
@page { size: A4; margin: 16mm 15mm; }
@media print {
  body { font-size: 10.5pt; max-width: none; margin: 0; padding: 0; }
  h2 { break-after: avoid; } table, .sentence { break-inside: avoid; } tr { break-inside: avoid; }
  table { font-size: 9pt; }
}
";

/// Begins a page: its title, its first heading, style beside the common one, and the class of its body.
pub fn open(title: &str, heading: &str, more_style: &str, class: &str) -> String {
    let (title, heading) = (escaped(title), escaped(heading));
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <title>{title}</title><style>{STYLE}{more_style}</style></head>\n<body class=\"{class}\">\n<h1>{heading}</h1>\n"
    )
}

/// Ends it; the footer is HTML, and may be empty.
pub fn close(page: &mut String, footer: &str) {
    if !footer.is_empty() {
        let _ = writeln!(page, "<footer><p>{footer}</p></footer>");
    }
    page.push_str("</body></html>\n");
}

/// Text inside HTML.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// An id in words.
pub fn words(id: &str) -> String {
    id.replace('_', " ")
}

/// The figure of that name with its caption; nothing where there is none.
pub fn figure(page: &mut String, figures: &[(String, String)], name: &str, caption: &str) {
    let Some((_, svg)) = figures.iter().find(|(n, _)| n == name) else { return };
    // plotters writes width and height; the page scales by a view box.
    let svg = with_view_box(svg);
    let _ = writeln!(page, "<figure>{svg}<figcaption>{}</figcaption></figure>", escaped(caption));
}

fn with_view_box(svg: &str) -> String {
    let has_box = svg.get(..svg.find('>').unwrap_or(0)).is_some_and(|tag| tag.contains("viewBox"));
    if has_box {
        return svg.to_string();
    }
    let number =
        |key: &str| svg.split_once(&format!("{key}=\"")).and_then(|(_, rest)| rest.split_once('"')).map(|(n, _)| n);
    match (number("width"), number("height")) {
        (Some(w), Some(h)) => svg.replacen("<svg ", &format!("<svg viewBox=\"0 0 {w} {h}\" "), 1),
        _ => svg.to_string(),
    }
}

/// A heading that begins with `#` stands over numbers, one with `~` over words that stay on one line.
fn class(heading: Option<&&str>) -> &'static str {
    match heading.and_then(|heading| heading.chars().next()) {
        Some('#') => " class=\"n\"",
        Some('~') => " class=\"t\"",
        _ => "",
    }
}

/// A table; its caption may be empty, and a heading may begin with `#` (numbers) or `~` (words on one line).
pub fn table(page: &mut String, caption: &str, head: &[&str], rows: impl IntoIterator<Item = Vec<String>>) {
    page.push_str("<table>");
    if !caption.is_empty() {
        let _ = write!(page, "<caption>{}</caption>", escaped(caption));
    }
    page.push_str("<thead><tr>");
    for (k, cell) in head.iter().enumerate() {
        let _ = write!(page, "<th{}>{}</th>", class(head.get(k)), escaped(cell.trim_start_matches(['#', '~'])));
    }
    page.push_str("</tr></thead><tbody>");
    for row in rows {
        page.push_str("<tr>");
        for (k, cell) in row.iter().enumerate() {
            let _ = write!(page, "<td{}>{}</td>", class(head.get(k)), escaped(cell));
        }
        page.push_str("</tr>");
    }
    page.push_str("</tbody></table>\n");
}

/// Value and error, both to the error's second digit; the error is empty where there is none.
pub fn with_error(value: f64, sigma: f64) -> (String, String) {
    if !(sigma > 0.0 && sigma.is_finite()) {
        let short = format!("{value:.3}");
        return (short.trim_end_matches('0').trim_end_matches('.').to_string(), String::new());
    }
    let digits = (1.0 - sigma.log10().floor()).max(0.0) as usize;
    if digits > 7 || sigma >= 1e6 {
        return (format!("{value:.3e}"), format!("{sigma:.1e}"));
    }
    (format!("{value:.digits$}"), format!("{sigma:.digits$}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_have_two_digits_and_values_as_many() {
        let both = |value, sigma| {
            let (value, error) = with_error(value, sigma);
            [value, error]
        };
        assert_eq!(both(-2241.73, 3.264), ["-2241.7", "3.3"]);
        assert_eq!(both(1.07213, 0.00041), ["1.07213", "0.00041"]);
        assert_eq!(both(1.0, 0.0), ["1", ""]);
        assert_eq!(both(9.59e-8, 8e-10), ["9.590e-8", "8.0e-10"]);
    }

    #[test]
    fn cells_are_escaped_and_headings_tell_their_columns() {
        let mut page = String::new();
        table(&mut page, "", &["#n", "~a"], [vec!["1".into(), "x < y".into()]]);
        assert!(page.contains("<th class=\"n\">n</th><th class=\"t\">a</th>"), "{page}");
        assert!(page.contains("<td class=\"n\">1</td><td class=\"t\">x &lt; y</td>"), "{page}");
    }
}

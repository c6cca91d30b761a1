//! What every report on paper shares: its figures, its page and its tables. A page is one self-contained file, no script, nothing
//! fetched, made to be printed; a figure is an SVG text, inside the page and beside it, there as a bitmap too.
//!
//! Texts in, texts out, and octets of a bitmap. Not here: what a report says, and who writes the files.

pub mod bitmap;
pub mod drawing;
pub mod page;

/// A figure as SVG text, empty where there is nothing to show; or why it could not be drawn.
pub type Drawn = Result<String, String>;

/// A report: the page, and its figures by file name.
#[derive(Debug, Clone)]
pub struct Report {
    /// `index.html`.
    pub html: String,
    /// Name and SVG text of each figure.
    pub figures: Vec<(String, String)>,
}

/// The figures of a report.
#[derive(Debug, Clone, Default)]
pub struct Figures {
    /// Those that show something, by file name.
    pub shown: Vec<(String, String)>,
    /// File name and reason of those that could not be drawn.
    pub missing: Vec<String>,
}

impl Figures {
    /// Sorts what was drawn.
    pub fn of<N: Into<String>>(drawn: impl IntoIterator<Item = (N, Drawn)>) -> Self {
        let mut figures = Self::default();
        for (name, svg) in drawn {
            let name = name.into();
            match svg {
                Ok(svg) if !svg.is_empty() => figures.shown.push((name, svg)),
                Ok(_) => {}
                Err(reason) => figures.missing.push(format!("{name}: {reason}")),
            }
        }
        figures
    }
}

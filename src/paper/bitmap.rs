//! A figure as PNG, for what takes no SVG: LaTeX, slides. Its letters are in the program, so that a figure is the same on every machine.

use std::sync::{Arc, LazyLock};

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb};

/// Pixels of the bitmap for one of the figure: 400 dpi where it is as wide as the text of A4 paper.
const SCALE: f32 = 3.0;
/// The family of the letters: condensed, they are about as wide as those that a figure asks for.
const FAMILY: &str = "DejaVu Sans";

static LETTERS: LazyLock<Arc<fontdb::Database>> = LazyLock::new(|| {
    let mut letters = fontdb::Database::new();
    letters.load_font_data(dejavu::sans_condensed::regular().to_vec());
    letters.set_sans_serif_family(FAMILY);
    Arc::new(letters)
});

/// The octets of a PNG file that shows an SVG text.
///
/// # Errors
/// Why the text is no figure: XML that is none, or a sheet without an area.
pub fn png(svg: &str) -> Result<Vec<u8>, String> {
    let options = Options { fontdb: Arc::clone(&LETTERS), font_family: FAMILY.into(), ..Options::default() };
    let figure = Tree::from_str(svg, &options).map_err(|error| error.to_string())?;
    let pixels = |length: f32| (length * SCALE).ceil() as u32;
    let (width, height) = (pixels(figure.size().width()), pixels(figure.size().height()));
    let mut sheet = Pixmap::new(width, height).ok_or_else(|| format!("no sheet has {width} by {height} pixels"))?;
    resvg::render(&figure, Transform::from_scale(SCALE, SCALE), &mut sheet.as_mut());
    sheet.encode_png().map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use plotters::prelude::*;

    use super::super::drawing::{WIDTH, on_canvas, said, text};
    use super::*;

    fn dark_pixels(png: &[u8]) -> (u32, u32, usize) {
        let sheet = Pixmap::decode_png(png).unwrap();
        (sheet.width(), sheet.height(), sheet.pixels().iter().filter(|p| p.red() < 128).count())
    }

    #[test]
    fn a_bitmap_has_the_lines_and_the_letters_of_its_figure() {
        let figure = |words: &str| {
            on_canvas(100, |canvas| {
                canvas.draw(&Rectangle::new([(10, 10), (110, 60)], BLACK.filled())).map_err(said)?;
                canvas.draw(&Text::new(words, (200, 40), text(20))).map_err(said)
            })
        };
        let (width, height, filled) = dark_pixels(&png(&figure("").unwrap()).unwrap());
        assert_eq!((width, height), (3 * WIDTH, 300));
        assert!((45_000..=45_000 + 3 * 450).contains(&filled), "{filled} pixels of a rectangle of 100 by 50");
        let (_, _, with_letters) = dark_pixels(&png(&figure("acceleration, ng").unwrap()).unwrap());
        assert!(with_letters > filled + 3_000, "{} pixels of letters", with_letters - filled);
    }

    #[test]
    fn what_is_no_figure_is_told() {
        assert!(png("<svg").is_err());
        assert!(png("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"0\" height=\"0\"/>").is_err());
    }
}

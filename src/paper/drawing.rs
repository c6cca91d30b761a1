//! The sheet, the colours, the letters and the mesh of a figure. Colours differ in grey as well.

use plotters::chart::MeshStyle;
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use super::Drawn;

/// What is drawn on.
pub type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// A panel with axes.
pub type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Width of every figure. On A4 paper a pixel of this is two thirds of a point: the smallest letters are then 7 pt high.
pub const WIDTH: u32 = 760;
/// The drawing library makes letters smaller by this than what they are ordered as.
const LETTERS: f64 = 1.24;

/// What was there before.
pub const GREY: RGBColor = RGBColor(140, 140, 140);
/// Words and logs.
pub const INK: RGBColor = RGBColor(40, 40, 40);
/// What is fitted, or left after it.
pub const BLUE: RGBColor = RGBColor(38, 84, 124);
/// What is claimed, or does not fit.
pub const RED: RGBColor = RGBColor(178, 58, 46);

/// Letters of a size in pixels.
pub fn text(size: u32) -> TextStyle<'static> {
    TextStyle::from(("Helvetica, Arial, sans-serif", LETTERS * f64::from(size)).into_font()).color(&INK)
}

/// Draws on a white sheet of [`WIDTH`].
///
/// # Errors
/// What `draw` or the drawing library says.
pub fn on_canvas(height: u32, draw: impl FnOnce(&Canvas) -> Result<(), String>) -> Drawn {
    let mut svg = String::new();
    {
        let canvas = SVGBackend::with_string(&mut svg, (WIDTH, height)).into_drawing_area();
        canvas.fill(&WHITE).map_err(said)?;
        draw(&canvas)?;
        canvas.present().map_err(said)?;
    }
    Ok(svg)
}

/// An error of the drawing library in its words.
pub fn said(error: impl std::fmt::Display) -> String {
    error.to_string()
}

/// A quiet mesh: thin lines at the labels only, to be told its labels, and drawn.
pub fn mesh<'a, 'm, 'b>(
    chart: &'m mut Chart<'a, 'b>,
) -> MeshStyle<'a, 'm, RangedCoordf64, RangedCoordf64, SVGBackend<'b>> {
    let mut mesh = chart.configure_mesh();
    mesh.light_line_style(TRANSPARENT)
        .bold_line_style(GREY.mix(0.25))
        .axis_style(GREY)
        .axis_desc_style(text(12))
        .label_style(text(12));
    mesh
}

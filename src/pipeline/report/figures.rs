//! The figures, as SVG texts: grey for what was measured, one colour for what is fitted, bands for two standard errors.

use plotters::prelude::*;

use super::plates::{Biases, Dot, History, Plates};
use crate::paper::Drawn;
use crate::paper::drawing::{BLUE, Canvas, Chart, GREY, INK, RED, WIDTH, mesh, on_canvas, said};
use crate::telemetry::{Axis, Range};

/// Digits so that five labels over a span differ.
fn digits(span: f64) -> usize {
    (1.0 - (span / 5.0).log10().floor()).clamp(0.0, 6.0) as usize
}

/// What a panel is drawn with.
struct Panel<'p> {
    x: [f64; 2],
    y: [f64; 2],
    name: &'p str,
    time_below: bool,
}

fn chart<'a, 'b>(area: &'a Canvas<'b>, panel: &Panel<'_>) -> Result<Chart<'a, 'b>, String> {
    let [low, high] = panel.y;
    let mut chart = ChartBuilder::on(area)
        .margin_top(8)
        .margin_right(14)
        .x_label_area_size(if panel.time_below { 38 } else { 10 })
        .y_label_area_size(72)
        .build_cartesian_2d(panel.x[0]..panel.x[1], low..high)
        .map_err(said)?;
    let decimals = digits(high - low).saturating_sub(1);
    // Rounding leaves no negative zero.
    let label = move |y: &f64| format!("{:.decimals$}", if y.abs() < 1e-9 { 0.0 } else { *y });
    let mut mesh = mesh(&mut chart);
    mesh.disable_x_mesh()
        .x_labels(if panel.time_below { 8 } else { 0 })
        .y_labels(5)
        .y_desc(panel.name)
        .y_label_formatter(&label);
    if panel.time_below {
        mesh.x_desc("hours since lift-off").x_label_formatter(&|x| format!("{x:.0}"));
    }
    mesh.draw().map_err(said)?;
    Ok(chart)
}

/// A value so many times less sure than the surest does not set the scale.
const UNSURE: f64 = 6.0;

/// The span of values that are used and not unsure, with some room; `symmetric` around zero.
fn span<'d>(dots: impl Iterator<Item = &'d Dot> + Clone, symmetric: bool) -> [f64; 2] {
    let surest = dots.clone().filter(|dot| dot.used).map(|dot| dot.sigma).fold(f64::INFINITY, f64::min);
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for dot in dots.filter(|dot| dot.used && dot.sigma < UNSURE * surest) {
        low = low.min(dot.value - 2.0 * dot.sigma);
        high = high.max(dot.value + 2.0 * dot.sigma);
    }
    if !(low < high) {
        return [-1.0, 1.0];
    }
    if symmetric {
        let most = low.abs().max(high.abs());
        return [-1.1 * most, 1.1 * most];
    }
    let room = 0.06 * (high - low);
    [low - room, high + room]
}

fn widest(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

fn dots<'d>(chart: &mut Chart<'_, '_>, all: impl Iterator<Item = &'d Dot> + Clone, y: [f64; 2]) -> Result<(), String> {
    let inside = |dot: &&Dot| dot.value > y[0] && dot.value < y[1];
    let bars = all.clone().filter(inside).filter(|d| d.used).map(|d| {
        PathElement::new(
            [(d.met_h, (d.value - d.sigma).max(y[0])), (d.met_h, (d.value + d.sigma).min(y[1]))],
            GREY.mix(0.7),
        )
    });
    chart.draw_series(bars).map_err(said)?;
    let used = all.clone().filter(inside).filter(|d| d.used).map(|d| Circle::new((d.met_h, d.value), 2, INK.filled()));
    chart.draw_series(used).map_err(said)?;
    // What is not used and lies off the scale is drawn at its edge.
    let edge = 0.02 * (y[1] - y[0]);
    let not_used = all
        .filter(|d| !d.used)
        .map(|d| Cross::new((d.met_h, d.value.clamp(y[0] + edge, y[1] - edge)), 4, RED.stroke_width(2)));
    chart.draw_series(not_used).map_err(said)?;
    Ok(())
}

/// Measured and fitted bias, and what is left, of the three axes in one range.
pub fn bias(plates: &Plates, biases: &Biases) -> Drawn {
    if biases.axes.iter().all(|plate| plate.measured.is_empty()) {
        return Ok(String::new());
    }
    on_canvas(600, |canvas| {
        for (row, area) in canvas.split_evenly((3, 1)).iter().enumerate() {
            let plate = &biases.axes[row];
            let letter = Axis::ALL[row].letter().to_uppercase();
            let (wide, narrow) = area.split_horizontally(WIDTH * 4 / 7);
            let y = widest(span(plate.measured.iter(), false), span(plate.fitted.iter(), false));
            let name = format!("{letter}, counts");
            let mut drawn = chart(&wide, &Panel { x: plates.span_h, y, name: &name, time_below: row == 2 })?;
            let band: Vec<(f64, f64)> = plate
                .fitted
                .iter()
                .map(|d| (d.met_h, (d.value + 2.0 * d.sigma).clamp(y[0], y[1])))
                .chain(plate.fitted.iter().rev().map(|d| (d.met_h, (d.value - 2.0 * d.sigma).clamp(y[0], y[1]))))
                .collect();
            drawn.draw_series([Polygon::new(band, BLUE.mix(0.18))]).map_err(said)?;
            let line = plate.fitted.iter().map(|d| (d.met_h, d.value.clamp(y[0], y[1])));
            drawn.draw_series(LineSeries::new(line, BLUE.stroke_width(1))).map_err(said)?;
            dots(&mut drawn, plate.measured.iter(), y)?;
            let y = span(plate.left.iter(), true);
            let panel = Panel { x: plates.span_h, y, name: "measured - fitted", time_below: row == 2 };
            let mut drawn = chart(&narrow, &panel)?;
            let zero = [(plates.span_h[0], 0.0), (plates.span_h[1], 0.0)];
            drawn.draw_series(LineSeries::new(zero, BLUE.stroke_width(1))).map_err(said)?;
            dots(&mut drawn, plate.left.iter(), y)?;
        }
        Ok(())
    })
}

/// Scale corrections measured, and their mean, by axis and range.
pub fn scale(plates: &Plates) -> Drawn {
    let Some(combined) = plates.combined else { return Ok(String::new()) };
    if plates.scales.as_flattened().iter().all(Vec::is_empty) {
        return Ok(String::new());
    }
    on_canvas(560, |canvas| {
        for (n, area) in canvas.split_evenly((3, 3)).iter().enumerate() {
            let (axis, range) = (n / 3, [2, 1, 0][n % 3]);
            let found = &plates.scales[axis][range];
            let [mean, sigma] = combined[axis][range];
            let mut y = span(found.iter(), false);
            if found.is_empty() {
                y = [mean - 4.0 * sigma, mean + 4.0 * sigma];
            }
            let letters = [Axis::ALL[axis].letter().to_uppercase(), Range::ALL[range].letter().to_string()];
            let name = format!("{} range {}", letters[0], letters[1]);
            let mut drawn = chart(area, &Panel { x: plates.span_h, y, name: &name, time_below: n >= 6 })?;
            let at = |value: f64| value.clamp(y[0], y[1]);
            let band = Rectangle::new(
                [(plates.span_h[0], at(mean - 2.0 * sigma)), (plates.span_h[1], at(mean + 2.0 * sigma))],
                BLUE.mix(0.18).filled(),
            );
            drawn.draw_series([band]).map_err(said)?;
            let line = [(plates.span_h[0], at(mean)), (plates.span_h[1], at(mean))];
            drawn.draw_series(LineSeries::new(line, BLUE.stroke_width(1))).map_err(said)?;
            dots(&mut drawn, found.iter(), y)?;
        }
        Ok(())
    })
}

/// Acceleration in body axes and the sensor's temperature over a stretch of the mission.
pub fn history(history: &History) -> Drawn {
    on_canvas(600, |canvas| {
        let (body, below) = canvas.split_vertically(480);
        for (axis, area) in body.split_evenly((3, 1)).iter().enumerate() {
            let y = history.shown_ng[axis];
            let name = format!("body {}, ng", ["X", "Y", "Z"][axis]);
            let mut drawn = chart(area, &Panel { x: history.span_h, y, name: &name, time_below: false })?;
            let at = |value: f64| value.clamp(y[0], y[1]);
            for run in &history.runs[axis] {
                let mut outline: Vec<(f64, f64)> = run.iter().map(|p| (p[0], at(p[3]))).collect();
                outline.extend(run.iter().rev().map(|p| (p[0], at(p[1]))));
                drawn.draw_series([Polygon::new(outline, GREY.mix(0.35))]).map_err(said)?;
                let line = run.iter().map(|p| (p[0], at(p[2])));
                drawn.draw_series(LineSeries::new(line, BLUE.stroke_width(1))).map_err(said)?;
            }
        }
        let of = history.temperature.iter().map(|p| p.1);
        let (low, high) = of.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), t| (low.min(t), high.max(t)));
        if low < high {
            let room = 0.1 * (high - low);
            let y = [low - room, high + room];
            let mut drawn = chart(&below, &Panel { x: history.span_h, y, name: "sensor, C", time_below: true })?;
            let line = history.temperature.iter().copied();
            drawn.draw_series(LineSeries::new(line, INK.stroke_width(1))).map_err(said)?;
        }
        Ok(())
    })
}

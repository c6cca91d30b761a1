//! The figures of these cases as SVG texts: grey for what was, blue for what is left, red for what cannot be explained.

use std::ops::Range;

use plotters::prelude::*;

use super::plates::{OrbitPlate, Plates, PosesPlate, SeriesPlate};
use super::spread::median;
use crate::paper::Drawn;
use crate::paper::drawing::{BLUE, Canvas, Chart, GREY, INK, RED, mesh, on_canvas, said, text};
use crate::paper::page::words;

/// File name, caption and drawing of each figure of a case; what has nothing to show is left out.
pub fn all(plates: &Plates) -> Vec<(&'static str, &'static str, Drawn)> {
    match plates {
        Plates::Series(axes) => vec![(
            "series.svg",
            "Recording less simulation, block means: before (grey) and with what is named taken away (blue). Controls, in which \
             nothing is expected, stand last.",
            series(axes),
        )],
        Plates::Orbit(plate) => vec![
            (
                "ladder.svg",
                "3-D residual of every arc, level by level: each line a satellite, the median in blue; above the dashed line \
                 an arc is called unexplained.",
                ladder(plate),
            ),
            (
                "arcs.svg",
                "3-D residual of each satellite as the simulation stands (grey) and with everything named (blue; red where it \
                 stays unexplained, above the dashed line).",
                arcs(plate),
            ),
        ],
        Plates::Poses(plate) => vec![(
            "poses.svg",
            "Size of |a| - g in every pose: by the ideal triad (grey), with everything named (blue).",
            poses(plate),
        )],
    }
}

fn series(axes: &[SeriesPlate]) -> Drawn {
    const PANEL: u32 = 120;
    on_canvas(PANEL * axes.len() as u32 + 26, |canvas| {
        let panels = canvas.split_evenly((axes.len(), 1));
        for (k, (axis, panel)) in axes.iter().zip(&panels).enumerate() {
            let high = axis.before.iter().chain(&axis.after).map(|v| v.abs()).fold(1e-300, f64::max) * 1.1;
            let hours = |t: f64| t / 3600.0;
            let (first, last) = (hours(axis.t_s[0]), hours(axis.t_s[axis.t_s.len() - 1]));
            // Units of a power of ten that keeps labels short.
            let power = (high.log10().floor() as i32).div_euclid(3) * 3;
            let scale = 10f64.powi(-power);
            let name = if power == 0 { axis.unit.clone() } else { format!("1e{power} {}", axis.unit) };
            let mut chart = ChartBuilder::on(panel)
                .margin_top(8)
                .margin_right(14)
                .x_label_area_size(if k + 1 == axes.len() { 34 } else { 6 })
                .y_label_area_size(74)
                .build_cartesian_2d(first..last, -high * scale..high * scale)
                .map_err(said)?;
            let mut mesh = mesh(&mut chart);
            mesh.disable_x_mesh().y_labels(3).label_style(text(11)).y_desc(name);
            mesh.x_labels(if k + 1 == axes.len() { 10 } else { 0 });
            if k + 1 == axes.len() {
                mesh.x_desc("hours after the first row");
            }
            mesh.draw().map_err(said)?;
            let points = |y: &[f64]| -> Vec<(f64, f64)> {
                axis.t_s.iter().zip(y).map(|(t, y)| (hours(*t), y * scale)).collect()
            };
            let dots =
                |y: &[f64], colour: RGBColor| points(y).into_iter().map(move |p| Circle::new(p, 1, colour.filled()));
            chart.draw_series(dots(&axis.before, GREY)).map_err(said)?;
            if axis.after != axis.before {
                chart.draw_series(dots(&axis.after, BLUE)).map_err(said)?;
            }
            let control = if axis.control { " (control)" } else { "" };
            panel.draw(&Text::new(format!("{}{control}", axis.name), (84, 10), text(13))).map_err(said)?;
        }
        Ok(())
    })
}

/// The powers of ten that hold all positive values.
fn decades(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values
        .into_iter()
        .filter(|v| *v > 0.0 && v.is_finite())
        .fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
    if high > 0.0 { (low.log10().floor(), high.log10().ceil().max(low.log10().floor() + 1.0)) } else { (-3.0, 0.0) }
}

fn power_of_ten(power: f64) -> String {
    match power.round() as i32 {
        p if (power - power.round()).abs() > 0.01 || p > 4 => String::new(),
        p if p >= 0 => format!("{:.0}", 10f64.powi(p)),
        p => format!("{:.*}", p.unsigned_abs() as usize, 10f64.powi(p)),
    }
}

/// An axis along a panel: its labels, how many at most, what it is, and the height they take.
struct Along<'p> {
    span: Range<f64>,
    labels: usize,
    label: &'p dyn Fn(&f64) -> String,
    name: &'static str,
    height: u32,
}

/// A panel over powers of ten.
fn log_panel<'a, 'b>(
    canvas: &'a Canvas<'b>,
    along: Along,
    (low, high): (f64, f64),
    name: &str,
    width: u32,
) -> Result<Chart<'a, 'b>, String> {
    let mut chart = ChartBuilder::on(canvas)
        .margin(10)
        .x_label_area_size(along.height)
        .y_label_area_size(width)
        .build_cartesian_2d(along.span, low..high)
        .map_err(said)?;
    let mut mesh = mesh(&mut chart);
    mesh.disable_x_mesh()
        .x_labels(along.labels)
        .y_labels((high - low) as usize + 1)
        .y_desc(name)
        .axis_desc_style(text(14))
        .x_label_formatter(along.label)
        .y_label_formatter(&|y| power_of_ten(*y));
    if !along.name.is_empty() {
        mesh.x_desc(along.name);
    }
    mesh.draw().map_err(said)?;
    Ok(chart)
}

/// What a level added, in few words.
fn brief(id: &str) -> String {
    words(&id.replace("solar_radiation_pressure", "solar radiation"))
}

fn ladder(plate: &OrbitPlate) -> Drawn {
    on_canvas(360, |canvas| {
        let (low, high) = decades(plate.rms_m.iter().flatten().copied().chain([plate.rms_max_m]));
        let levels = plate.rms_m.len();
        let label = |x: &f64| match plate.added.get(x.round() as usize) {
            Some(added) if (x - x.round()).abs() < 1e-6 && *x > -0.01 => brief(added),
            _ => String::new(),
        };
        let span = -0.25..levels as f64 - 0.75;
        let along = Along { span, labels: levels * 4, label: &label, name: "", height: 34 };
        let mut chart = log_panel(canvas, along, (low, high), "3-D rms, m", 70)?;
        for arc in 0..plate.arcs.len() {
            let odd = plate.rms_m[levels - 1][arc] > plate.rms_max_m;
            let line = (0..levels).map(|k| (k as f64, plate.rms_m[k][arc].max(1e-6).log10()));
            let colour = if odd { RED.stroke_width(2) } else { GREY.mix(0.5).stroke_width(1) };
            chart.draw_series(LineSeries::new(line, colour)).map_err(said)?;
            if odd {
                let end = (levels as f64 - 0.97, plate.rms_m[levels - 1][arc].log10());
                chart.draw_series([Text::new(plate.arcs[arc].clone(), end, text(12).color(&RED))]).map_err(said)?;
            }
        }
        let middle = |k: usize| median(plate.rms_m[k].iter().copied()).max(1e-6).log10();
        chart
            .draw_series(LineSeries::new((0..levels).map(|k| (k as f64, middle(k))), BLUE.stroke_width(3)))
            .map_err(said)?;
        let limit = plate.rms_max_m.log10();
        let dashes = DashedLineSeries::new([(-0.25, limit), (levels as f64 - 0.75, limit)], 6, 5, INK.into());
        chart.draw_series(dashes).map_err(said)?;
        Ok(())
    })
}

/// Names of satellites that fit below a panel side by side.
const NAMES_IN_A_ROW: usize = 20;

fn arcs(plate: &OrbitPlate) -> Drawn {
    let (Some(first), Some(last)) = (plate.rms_m.first(), plate.rms_m.last()) else { return Ok(String::new()) };
    on_canvas(300, |canvas| {
        let (low, high) = decades(first.iter().chain(last).copied().chain([plate.rms_max_m]));
        let n = plate.arcs.len();
        let every = n.div_ceil(34).max(1);
        // Many names stand in two rows.
        let rows = if n > NAMES_IN_A_ROW { 2 } else { 1 };
        let height = 14 + 13 * rows as u32;
        let along = Along { span: -1.0..n as f64, labels: 0, label: &|_| String::new(), name: "", height };
        let mut chart = log_panel(canvas, along, (low, high), "3-D rms, m", 70)?;
        for k in 0..n {
            let x = k as f64;
            let (was, is) = (first[k].max(1e-6).log10(), last[k].max(1e-6).log10());
            let colour = if last[k] > plate.rms_max_m { RED } else { BLUE };
            chart.draw_series(LineSeries::new([(x, was), (x, is)], GREY.mix(0.4).stroke_width(1))).map_err(said)?;
            chart.draw_series([Circle::new((x, was), 3, GREY.filled())]).map_err(said)?;
            chart.draw_series([Circle::new((x, is), 4, colour.filled())]).map_err(said)?;
            if k % every == 0 {
                let (px, py) = chart.backend_coord(&(x, low));
                let place = (px - 11, py + 7 + 13 * (k / every % rows) as i32);
                canvas.draw(&Text::new(plate.arcs[k].clone(), place, text(11))).map_err(said)?;
            }
        }
        let limit = plate.rms_max_m.log10();
        let dashes = DashedLineSeries::new([(-1.0, limit), (n as f64, limit)], 6, 5, INK.into());
        chart.draw_series(dashes).map_err(said)?;
        Ok(())
    })
}

fn poses(plate: &PosesPlate) -> Drawn {
    let (Some(first), Some(last)) = (plate.residuals.first(), plate.residuals.last()) else { return Ok(String::new()) };
    on_canvas(280, |canvas| {
        let (low, high) = decades(first.iter().chain(last).map(|r| r.abs()));
        let low = low.max(high - 6.0);
        let span = 0.0..first.len() as f64 + 1.0;
        let along = Along { span, labels: 11, label: &|x| format!("{x:.0}"), name: "pose", height: 34 };
        let mut chart = log_panel(canvas, along, (low, high), "| |a| - g |, m/s²", 76)?;
        for (values, colour) in [(first, GREY), (last, BLUE)] {
            let at = values.iter().enumerate().map(|(i, r)| ((i + 1) as f64, r.abs().log10().max(low)));
            chart.draw_series(at.map(|p| Circle::new(p, 4, colour.filled()))).map_err(said)?;
        }
        Ok(())
    })
}

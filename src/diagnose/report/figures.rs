//! The figures, as SVG texts: grey for what was, one colour for what is claimed, bands for the shadow, ticks for the log.

use plotters::prelude::*;

use super::Plates;
use super::reduce::{Bin, amplitudes, binned, range, runs, spans};
use crate::math::rms::rms;
use crate::paper::Drawn;
use crate::paper::drawing::{BLUE, Canvas, GREY, INK, RED, mesh, on_canvas, said, text};

const AXES: [&str; 3] = ["x", "y", "z"];
const SHADOW: RGBAColor = RGBAColor(70, 90, 130, 0.10);
/// Mean that a point of a time line stands for, s.
const LINE_S: f64 = 600.0;
/// Letters for which there is room beside the ladder's bars.
const LADDER_LETTERS: usize = 54;

fn hours(plates: &Plates, clock_s: f64) -> f64 {
    (clock_s - plates.liftoff_clock_s) / 3600.0
}

/// Recording less simulation with the claimed part over it, shadow and log.
pub fn residual(plates: &Plates) -> Drawn {
    timelines(plates, |axis| {
        let mut lines = vec![(GREY, 1, plates.before_ng[axis].as_slice(), "recording less simulation")];
        if plates.model_ng[axis].iter().any(|m| *m != 0.0) {
            lines.push((RED, 2, plates.model_ng[axis].as_slice(), "what is fitted"));
        }
        lines
    })
}

/// What is left when the claimed part is taken away, on the same scale; empty where nothing is claimed.
pub fn after(plates: &Plates) -> Drawn {
    if plates.model_ng.iter().all(|axis| axis.iter().all(|m| *m == 0.0)) {
        return Ok(String::new());
    }
    let left = left(plates);
    timelines(plates, |axis| vec![(BLUE, 1, left[axis].as_slice(), "left after the fitted part")])
}

fn left(plates: &Plates) -> [Vec<f64>; 3] {
    std::array::from_fn(|axis| plates.before_ng[axis].iter().zip(&plates.model_ng[axis]).map(|(b, m)| b - m).collect())
}

type Line<'a> = (RGBColor, u32, &'a [f64], &'static str);

fn timelines<'p>(plates: &'p Plates, lines: impl Fn(usize) -> Vec<Line<'p>>) -> Drawn {
    let (first, last) = range(plates.clock_s.iter().map(|t| hours(plates, *t)));
    let left = left(plates);
    on_canvas(560, |canvas| {
        let (panels, log) = canvas.split_vertically(470);
        for (axis, panel) in panels.split_evenly((3, 1)).iter().enumerate() {
            let lines = lines(axis);
            // One scale for a figure and its sequel: that of the residual before or after, whichever is the larger.
            let smooth = |y: &[f64]| runs(&plates.clock_s, y, LINE_S);
            let peak = |y: &[f64]| smooth(y).iter().flatten().map(|p| p.1.abs()).fold(1.0, f64::max);
            let high = peak(&plates.before_ng[axis]).max(peak(&left[axis])) * 1.15;
            let mut chart = ChartBuilder::on(panel)
                .margin_top(8)
                .margin_right(14)
                .x_label_area_size(6)
                .y_label_area_size(64)
                .build_cartesian_2d(first..last, -high..high)
                .map_err(said)?;
            let dark = spans(&plates.clock_s, |k| plates.sunlit.get(k).is_some_and(|s| *s < 0.5));
            let bands = dark
                .iter()
                .map(|(a, b)| Rectangle::new([(hours(plates, *a), -high), (hours(plates, *b), high)], SHADOW.filled()));
            chart.draw_series(bands).map_err(said)?;
            mesh(&mut chart)
                .disable_x_mesh()
                .x_labels(0)
                .y_labels(5)
                .y_desc(format!("{}, ng", AXES[axis]))
                .y_label_formatter(&|y| format!("{y:.0}"))
                .draw()
                .map_err(said)?;
            for (colour, width, y, _) in &lines {
                for run in smooth(y) {
                    let points = run.into_iter().map(|(t, y)| (hours(plates, t), y));
                    chart.draw_series(LineSeries::new(points, colour.stroke_width(*width))).map_err(said)?;
                }
            }
            if axis == 0 {
                legend(panel, &lines)?;
            }
        }
        log_strip(plates, &log, first..last)
    })
}

fn legend(panel: &Canvas, lines: &[Line]) -> Result<(), String> {
    for (k, (colour, width, _, words)) in lines.iter().enumerate() {
        let x = 76 + 225 * k as i32;
        panel.draw(&PathElement::new([(x, 18), (x + 24, 18)], colour.stroke_width(*width + 1))).map_err(said)?;
        panel.draw(&Text::new(*words, (x + 30, 11), text(12))).map_err(said)?;
    }
    let x = 76 + 225 * lines.len() as i32;
    panel.draw(&Rectangle::new([(x, 11), (x + 24, 25)], SHADOW.filled())).map_err(said)?;
    panel.draw(&Text::new("in the Earth's shadow", (x + 30, 11), text(12))).map_err(said)
}

/// The log as one row per kind, over the axis of time.
fn log_strip(plates: &Plates, area: &Canvas, time: std::ops::Range<f64>) -> Result<(), String> {
    let mut kinds: Vec<&str> = plates.events.iter().map(|e| e.2.as_str()).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let rows = kinds.len().max(1) as f64;
    // Twelve ticks of a short record are less than an hour apart.
    let decimals = usize::from(time.end - time.start < 12.0);
    let mut chart = ChartBuilder::on(area)
        .margin_right(14)
        .x_label_area_size(36)
        .y_label_area_size(64)
        .build_cartesian_2d(time.clone(), 0.0..rows)
        .map_err(said)?;
    mesh(&mut chart)
        .disable_mesh()
        .y_labels(0)
        .x_labels(12)
        .x_desc("hours since lift-off")
        .x_label_formatter(&|x| format!("{x:.decimals$}"))
        .draw()
        .map_err(said)?;
    for (from, to, kind) in &plates.events {
        let row = kinds.iter().position(|k| k == kind).unwrap_or(0) as f64;
        let from_h = hours(plates, *from).clamp(time.start, time.end);
        let to_h = hours(plates, *to).clamp(time.start, time.end).max(from_h + (time.end - time.start) / 1500.0);
        let bar = Rectangle::new([(from_h, row + 0.2), (to_h, row + 0.8)], INK.mix(0.55).filled());
        chart.draw_series([bar]).map_err(said)?;
    }
    let high = area.dim_in_pixel().1.saturating_sub(36) as f64;
    for (row, kind) in kinds.iter().enumerate() {
        let y = high * (1.0 - (row as f64 + 0.5) / rows) - 6.0;
        let name = kind.replace('_', " ");
        area.draw(&Text::new(name, (2, y as i32), text(10))).map_err(said)?;
    }
    Ok(())
}

/// The residual against each covariate, before and after, on the axis that carries most of what is claimed (or is loudest).
pub fn covariates(plates: &Plates) -> Drawn {
    let shown: Vec<_> = plates.covariates.iter().filter(|c| c.values.len() == plates.clock_s.len()).take(12).collect();
    if shown.is_empty() {
        return Ok(String::new());
    }
    let left = left(plates);
    let claimed = |axis: &usize| rms(&plates.model_ng[*axis]);
    let swing = |axis: &usize| {
        runs(&plates.clock_s, &plates.before_ng[*axis], LINE_S).iter().flatten().map(|p| p.1 * p.1).sum()
    };
    let by = |size: &dyn Fn(&usize) -> f64| (0..3).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(0);
    let axis = if (0..3).any(|a| claimed(&a) > 0.0) { by(&claimed) } else { by(&swing) };
    let columns = if shown.len() > 4 { 3 } else { 2 };
    let rows = shown.len().div_ceil(columns);
    on_canvas(40 + 210 * rows as u32, |canvas| {
        let title = format!("Residual on {} against what it may follow: before (pale), after (dark)", AXES[axis]);
        let canvas = canvas.titled(&title, text(12)).map_err(said)?;
        for (panel, covariate) in canvas.split_evenly((rows, columns)).iter().zip(&shown) {
            let before = binned(&covariate.values, &plates.before_ng[axis], 24);
            let after = binned(&covariate.values, &left[axis], 24);
            let unit = if covariate.unit.is_empty() { String::new() } else { format!(", {}", covariate.unit) };
            panel_of_bins(panel, &format!("{}{unit}", covariate.name), &before, &after)?;
        }
        Ok(())
    })
}

fn panel_of_bins(panel: &Canvas, name: &str, before: &[Bin], after: &[Bin]) -> Result<(), String> {
    let both = || before.iter().chain(after);
    let (low, high) = range(both().map(|b| b.x));
    let size = both().map(|b| b.mean.abs() + b.error).fold(1.0, f64::max) * 1.1;
    let digits = if high - low > 20.0 {
        0
    } else if high - low > 1.0 {
        1
    } else {
        2
    };
    let mut chart = ChartBuilder::on(panel)
        .margin(6)
        .margin_right(12)
        .x_label_area_size(34)
        .y_label_area_size(44)
        .build_cartesian_2d(low..high, -size..size)
        .map_err(said)?;
    mesh(&mut chart)
        .disable_x_mesh()
        .x_labels(4)
        .y_labels(5)
        .x_desc(name)
        .y_desc("ng")
        .label_style(text(11))
        .x_label_formatter(&|x| format!("{x:.digits$}"))
        .y_label_formatter(&|y| format!("{y:.0}"))
        .draw()
        .map_err(said)?;
    for (bins, colour) in [(before, GREY), (after, BLUE)] {
        let bars = bins
            .iter()
            .map(|b| PathElement::new([(b.x, b.mean - b.error), (b.x, b.mean + b.error)], colour.stroke_width(1)));
        chart.draw_series(bars).map_err(said)?;
        chart.draw_series(bins.iter().map(|b| Circle::new((b.x, b.mean), 2, colour.filled()))).map_err(said)?;
    }
    Ok(())
}

/// Amplitude by cycles per orbit, before and after.
pub fn spectrum(plates: &Plates) -> Drawn {
    if plates.clock_s.len() < 8 || plates.period_s.is_nan() || plates.period_s <= 0.0 {
        return Ok(String::new());
    }
    let cycles: Vec<f64> = (1..=300).map(|k| 0.02 * f64::from(k)).collect();
    let left = left(plates);
    let claimed = plates.model_ng.iter().any(|axis| axis.iter().any(|m| *m != 0.0));
    on_canvas(470, |canvas| {
        for (axis, panel) in canvas.split_evenly((3, 1)).iter().enumerate() {
            let of = |y: &[f64]| amplitudes(&plates.clock_s, y, plates.period_s, &cycles);
            let before = of(&plates.before_ng[axis]);
            let after = claimed.then(|| of(&left[axis]));
            let high = before.iter().chain(after.iter().flatten()).copied().fold(1.0, f64::max) * 1.1;
            let bottom = axis == 2;
            let mut chart = ChartBuilder::on(panel)
                .margin_top(8)
                .margin_right(14)
                .x_label_area_size(if bottom { 36 } else { 6 })
                .y_label_area_size(64)
                .build_cartesian_2d(0.0..6.0, 0.0..high)
                .map_err(said)?;
            let mut mesh = mesh(&mut chart);
            mesh.x_labels(if bottom { 7 } else { 0 }).y_labels(4).y_desc(format!("{}, ng", AXES[axis]));
            if bottom {
                mesh.x_desc("cycles per orbit").x_label_formatter(&|x| format!("{x:.0}"));
            }
            mesh.y_label_formatter(&|y| format!("{y:.0}")).draw().map_err(said)?;
            let line = |y: &[f64]| cycles.iter().copied().zip(y.iter().copied()).collect::<Vec<_>>();
            chart.draw_series(LineSeries::new(line(&before), GREY.stroke_width(1))).map_err(said)?;
            if let Some(after) = after {
                chart.draw_series(LineSeries::new(line(&after), BLUE.stroke_width(2))).map_err(said)?;
            }
        }
        Ok(())
    })
}

/// A name as far as there is room for it beside the bars.
fn shortened(name: &str) -> String {
    match name.char_indices().nth(LADDER_LETTERS) {
        Some((end, _)) => format!("{}…", name[..end].trim_end()),
        None => name.to_string(),
    }
}

/// Log evidence of the sets against nothing, as bars.
pub fn ladder(plates: &Plates) -> Drawn {
    if plates.ladder.is_empty() {
        return Ok(String::new());
    }
    let shown: Vec<_> = plates.ladder.iter().take(12).collect();
    let (low, high) = range(shown.iter().map(|(_, e)| *e).chain([0.0]));
    let pad = 0.06 * (high - low);
    let rows = shown.len();
    on_canvas(44 + 26 * rows as u32, |canvas| {
        let mut chart = ChartBuilder::on(canvas)
            .margin_right(70)
            .margin_top(4)
            .x_label_area_size(40)
            .y_label_area_size(330)
            .build_cartesian_2d((low - pad).min(0.0)..high + pad, 0.0..rows as f64)
            .map_err(said)?;
        mesh(&mut chart)
            .disable_y_mesh()
            .y_labels(0)
            .x_desc("log evidence against nothing")
            .x_label_formatter(&|x| format!("{x:.0}"))
            .draw()
            .map_err(said)?;
        for (k, (name, evidence)) in shown.iter().enumerate() {
            let row = (rows - 1 - k) as f64;
            let colour = if k == 0 { RED.mix(0.85) } else { GREY.mix(0.6) };
            let bar = Rectangle::new([(0.0, row + 0.25), (*evidence, row + 0.75)], colour.filled());
            chart.draw_series([bar]).map_err(said)?;
            let y = 4 + (26.0 * k as f64 + 6.0) as i32;
            canvas.draw(&Text::new(shortened(&name.replace('_', " ")), (4, y), text(11))).map_err(said)?;
            let x = chart.backend_coord(&(evidence.max(0.0), row)).0;
            canvas.draw(&Text::new(format!("{evidence:.1}"), (x + 6, y), text(12))).map_err(said)?;
        }
        Ok(())
    })
}

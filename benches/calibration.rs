//! Re-deriving a mission after a new calibration, and the bias fit beside SciPy's `curve_fit` on the same measurements.
//!
//! `cargo bench --bench calibration`; SciPy's figure needs `pip install -r benches/peers/requirements.txt`.

use std::hint::black_box;
use std::io::Write;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use oare_ground::pipeline::archive::Archive;
use oare_ground::pipeline::calibration::bias_law::{Expectation, Point, fit};
use oare_ground::pipeline::calibration::{self, Derived};
use oare_ground::pipeline::window::{Window, Windows, windows};
use oare_ground::pipeline::{Product, Settings, derive};
use oare_ground::simulate::{Mission, MissionConfig};
use oare_ground::telemetry::{Axis, Range};

/// Hours of the mission.
const HOURS: f64 = 354.0;
/// Times that a figure is taken; the middle one counts.
const ROUNDS: usize = 9;

struct Flown {
    archive: Archive,
    windows: Windows,
}

impl Flown {
    fn refresh(&mut self, cells: impl IntoIterator<Item = i64>, settings: &Settings) {
        let held = &mut self.windows;
        windows(&self.archive, cells, &settings.window, |cell, window| {
            if let Some(window) = window {
                held.insert(cell, Box::new(window));
            }
        });
    }

    fn products(&self, derived: &Derived, settings: &Settings) -> Vec<Product> {
        let windows: Vec<&Window> = self.windows.values().map(Box::as_ref).collect();
        derive::products(&windows, derived.current(), &derived.range_corrections, &settings.window)
    }
}

fn median(mut times: Vec<Duration>) -> Duration {
    times.sort_unstable();
    times[times.len() / 2]
}

/// Everything but the last calibration is known; it comes, and every product is derived again.
fn rederive(settings: &Settings) -> Derived {
    let mission = Mission::new(MissionConfig::sts65(1, HOURS)).unwrap_or_else(|problems| panic!("{problems:?}"));
    let mut flown = Flown { archive: Archive::default(), windows: Windows::new() };
    let last_s = {
        let flight = mission.fly();
        let segments = &flight.schedule().segments;
        let id = segments.last().map(|segment| segment.calibration_id);
        segments.iter().find(|segment| Some(segment.calibration_id) == id).map_or(0, |first| first.from_s) - 60
    };
    let mut late = Vec::new();
    let mut sequence = 0u16;
    for second in mission.fly() {
        for sent in second.sent {
            sequence = (sequence + 1) & 0x3fff;
            if second.clock_s < last_s {
                flown.archive.add(sent.record, sequence);
            } else {
                late.push((sent.record, sequence));
            }
        }
    }
    let cells: Vec<i64> = flown.archive.cells().collect();
    let first_late = cells[cells.len() - 1] - 1;
    flown.refresh(cells, settings);
    let before = calibration::derive(&flown.archive, &flown.windows, settings, None, None);
    let old = flown.products(&before, settings);
    for (record, sequence) in late {
        flown.archive.add(record, sequence);
    }
    let cells: Vec<i64> = flown.archive.cells().filter(|cell| *cell >= first_late).collect();
    flown.refresh(cells, settings);
    let mut derived = before.clone();
    let (mut calibrating, mut applying) = (Vec::new(), Vec::new());
    let mut changed = 0;
    for _ in 0..ROUNDS {
        let start = Instant::now();
        derived = calibration::derive(&flown.archive, &flown.windows, settings, None, Some(&before));
        calibrating.push(start.elapsed());
        let start = Instant::now();
        let new = black_box(flown.products(&derived, settings));
        applying.push(start.elapsed());
        changed = old.iter().zip(&new).filter(|(a, b)| a.revision != b.revision).count();
    }
    assert!(derived.timeline.len() > before.timeline.len(), "a new version");
    let (a, b) = (median(calibrating), median(applying));
    println!(
        "a new calibration in {HOURS} h: laws, factors and checks {:.1} ms, {} products {:.1} ms, together {:.1} ms; {changed} revisions \
         changed (aim: below 100 ms)",
        a.as_secs_f64() * 1e3,
        flown.windows.len(),
        b.as_secs_f64() * 1e3,
        (a + b).as_secs_f64() * 1e3
    );
    derived
}

/// The nine laws of the mission by this fit, and the one of X in range C by SciPy.
fn bias_fit(derived: &Derived, settings: &Settings) {
    let points = |axis: Axis, range: Range| -> Vec<Point> {
        let of_law = derived.measurements.iter().filter(|m| m.axis == axis && m.range == range);
        of_law
            .map(|m| Point {
                met_h: settings.time.met_h(m.clock_s),
                temperature_c: m.temperature_c,
                counts: m.counts,
                sigma_counts: m.sigma_counts,
            })
            .collect()
    };
    let of_x = points(Axis::X, Range::C);
    let times = (0..51).map(|_| {
        let start = Instant::now();
        black_box(fit(&of_x, &Expectation::published(0, 2)));
        start.elapsed()
    });
    let ours = median(times.collect());
    println!("bias fit of X in range C, {} measurements: {:.3} ms", of_x.len(), ours.as_secs_f64() * 1e3);
    let child = Command::new("python3")
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/benches/peers/curve_fit.py"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn();
    let Ok(mut child) = child else { return println!("no python3: SciPy's figure is left out") };
    if let Some(mut input) = child.stdin.take() {
        for p in &of_x {
            let _ = writeln!(input, "{} {} {} {}", p.met_h, p.temperature_c, p.counts, p.sigma_counts);
        }
    }
    match child.wait_with_output() {
        Ok(output) if output.status.success() => print!("{}", String::from_utf8_lossy(&output.stdout)),
        _ => println!("no SciPy: its figure is left out"),
    }
}

fn main() {
    let settings = Settings::sts65();
    let derived = rederive(&settings);
    bias_fit(&derived, &settings);
}

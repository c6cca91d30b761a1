//! Where the mismatch is: axes, frame and direction, times, covariates, lines of the orbit. Said even when nothing can be named.

use nalgebra::SymmetricEigen;

use crate::math::shared_work;
use crate::physics::{Mat3, Vec3};

use super::answer::{Covariate, Interval, Located, OrbitLine};
use super::case::HALF_WINDOW_S;
use super::design::{Chosen, Frame};
use super::scene::{Axes, Scene};

/// Share of the signal's energy an axis needs to be named.
const AXIS_SHARE: f64 = 0.05;
/// Intervals named at most.
const INTERVALS_MAX: usize = 12;
/// Log posterior odds of a covariate from which on it is told: the prior odds of all of them are four tenths together, so that noise
/// has one above this in at most one record in twenty (Markov's inequality).
pub const TOLD: f64 = 2.1;
/// An interval that begins this near to an onset begins with it, s.
const NEAR_S: f64 = 600.0;

/// Size that a line has beforehand, ng.
const LINE_NG: f64 = 30.0;

/// Axes, frame and times of a signal the best hypothesis puts into the residual, which has these onsets.
pub fn of_signal(scene: &Scene, signal: &Axes, onsets_s: &[f64]) -> Located {
    let clock = scene.clock_s();
    let n = clock.len();
    let mean: [f64; 3] = std::array::from_fn(|k| signal[k].iter().sum::<f64>() / n as f64);
    let energy: [f64; 3] = std::array::from_fn(|k| signal[k].iter().map(|x| (x - mean[k]).powi(2)).sum());
    let total: f64 = energy.iter().sum();
    let axes = ["x", "y", "z"]
        .iter()
        .zip(energy)
        .filter(|(_, e)| *e > AXIS_SHARE * total && total > 0.0)
        .map(|(a, _)| a.to_string())
        .collect();
    let (frame, direction) = direction(scene, signal);
    let size: Vec<f64> = (0..n).map(|i| (0..3).map(|k| signal[k][i].powi(2)).sum::<f64>().sqrt()).collect();
    Located {
        axes,
        frame,
        direction,
        intervals: intervals(clock, &size, onsets_s),
        covariates: Vec::new(),
        per_orbit_lines: Vec::new(),
    }
}

/// The frame in which the signal keeps most to one line, and that line if it carries nine tenths of it; it points the way of the largest
/// values, and where those go both ways it is an axis.
fn direction(scene: &Scene, signal: &Axes) -> (String, Option<[f64; 3]>) {
    let rotations: [(&str, &dyn Fn(usize) -> Mat3); 4] = [
        ("body", &|_| Mat3::identity()),
        ("lvlh", &|g| lvlh(scene, g) * scene.body[g].transpose()),
        ("inertial", &|g| scene.body[g].transpose()),
        ("sun", &|g| sun_frame(scene, g) * scene.body[g].transpose()),
    ];
    let turned = |rotation: &&dyn Fn(usize) -> Mat3, i: usize| {
        let t = scene.clock_s()[i];
        let g = scene.grid_s.partition_point(|x| *x < t).min(scene.grid_s.len() - 1);
        rotation(g) * Vec3::new(signal[0][i], signal[1][i], signal[2][i])
    };
    let mut best = (rotations[0], 0.0, Vec3::zeros());
    for (name, rotation) in rotations {
        let mut outer = Mat3::zeros();
        for i in 0..scene.clock_s().len() {
            let v = turned(&rotation, i);
            outer += v * v.transpose();
        }
        let trace = outer.trace();
        if trace <= 0.0 {
            continue;
        }
        let eigen = SymmetricEigen::new(outer);
        let top = eigen.eigenvalues.imax();
        let share = eigen.eigenvalues[top] / trace;
        // Another frame must be clearly steadier than the body's.
        if share > best.1 + 0.02 {
            best = ((name, rotation), share, eigen.eigenvectors.column(top).into_owned());
        }
    }
    // Of the two ways along the line the one that the largest of it goes.
    let ((name, rotation), share, line) = best;
    let way: f64 = (0..scene.clock_s().len()).map(|i| line.dot(&turned(&rotation, i)).powi(3)).sum();
    let line = if way < 0.0 { -line } else { line };
    (name.to_string(), (share > 0.9).then(|| [line.x, line.y, line.z]))
}

fn lvlh(scene: &Scene, g: usize) -> Mat3 {
    let down = -scene.r_m[g].normalize();
    let right = -scene.r_m[g].cross(&scene.v_m_s[g]).normalize();
    Mat3::from_rows(&[right.cross(&down).transpose(), right.transpose(), down.transpose()])
}

fn sun_frame(scene: &Scene, g: usize) -> Mat3 {
    let x = scene.sun[g];
    let z = Vec3::z() - x * x.z;
    let z = z.normalize();
    Mat3::from_rows(&[x.transpose(), z.cross(&x).transpose(), z.transpose()])
}

/// Spans in which the signal is more than a quarter of its largest, nearby ones joined.
fn intervals(clock: &[f64], size: &[f64], onsets_s: &[f64]) -> Vec<Interval> {
    let why = |start_s: f64| {
        let is_onset = onsets_s.iter().any(|onset_s| (onset_s - start_s).abs() < NEAR_S);
        if is_onset { "onset" } else { "largest part of the mismatch" }.to_string()
    };
    let largest = size.iter().copied().fold(0.0, f64::max);
    if largest <= 0.0 {
        return Vec::new();
    }
    let span = clock[clock.len() - 1] - clock[0];
    let mut join_s = 300.0;
    loop {
        let mut out: Vec<Interval> = Vec::new();
        for (t, s) in clock.iter().zip(size) {
            if *s < 0.25 * largest {
                continue;
            }
            match out.last_mut() {
                Some(last) if t - last.end_s < join_s => last.end_s = *t + HALF_WINDOW_S,
                _ => out.push(Interval { start_s: t - HALF_WINDOW_S, end_s: t + HALF_WINDOW_S, why: why(*t) }),
            }
        }
        if out.len() <= INTERVALS_MAX || join_s > span {
            return out;
        }
        join_s *= 2.0;
    }
}

/// Covariates by the evidence of following them, best first, those above what noise has.
pub fn covariates(scores: impl Iterator<Item = (String, f64)>) -> Vec<Covariate> {
    let mut best: Vec<Covariate> = Vec::new();
    for (name, score) in scores {
        match best.iter_mut().find(|c| c.name == name) {
            Some(c) => c.score = c.score.max(score),
            None => best.push(Covariate { name, score }),
        }
    }
    best.retain(|c| c.score > TOLD);
    best.sort_by(|a, b| b.score.total_cmp(&a.score));
    best.truncate(6);
    best
}

/// The line of one frequency on each axis that it is on, with the evidence for it.
fn line_at(scene: &Scene, frame: &Frame, empty: &Chosen, cycles_per_orbit: f64) -> Vec<(f64, OrbitLine)> {
    let rate = std::f64::consts::TAU * cycles_per_orbit / scene.period_s;
    let [sin, cos]: [Vec<f64>; 2] = [
        scene.clock_s().iter().map(|t| (rate * t).sin()).collect(),
        scene.clock_s().iter().map(|t| (rate * t).cos()).collect(),
    ];
    let on = |axis: usize| {
        let columns = [frame.scalar(axis, &sin, LINE_NG), frame.scalar(axis, &cos, LINE_NG)];
        let gain = empty.gain(&columns);
        let (mean, _) = Chosen::new(frame, columns.iter().collect(), &[]).posterior();
        let amplitude_ng = LINE_NG * mean[0].hypot(mean[1]);
        (gain, OrbitLine { cycles_per_orbit, axis: ["x", "y", "z"][axis].into(), amplitude_ng })
    };
    (0..3).map(on).filter(|(gain, _)| *gain > 0.0).collect()
}

/// The line of a period of its own: to three digits, as it may be between those of [`lines`].
pub fn line_of_period(scene: &Scene, frame: &Frame, period_s: f64) -> Vec<OrbitLine> {
    let empty = Chosen::new(frame, Vec::new(), &[]);
    let cycles = (1000.0 * scene.period_s / period_s).round() / 1000.0;
    line_at(scene, frame, &empty, cycles).into_iter().map(|(_, line)| line).collect()
}

/// Lines of the residual in cycles per orbit that stand out of the whole search for lines.
pub fn lines(scene: &Scene, frame: &Frame) -> Vec<OrbitLine> {
    let empty = Chosen::new(frame, Vec::new(), &[]);
    let cycles: Vec<f64> = (1..=60).map(|i| 0.1 * i as f64).collect();
    let charge = ((cycles.len() * 3) as f64).ln() + 4.0;
    let lines = |c: &f64| line_at(scene, frame, &empty, (c * 10.0).round() / 10.0);
    let mut found: Vec<(f64, OrbitLine)> = shared_work::map(&cycles, lines).into_iter().flatten().collect();
    found.retain(|(gain, _)| *gain > charge);
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    // The side lobes of a stronger line are not lines.
    let mut kept: Vec<OrbitLine> = Vec::new();
    for (_, line) in found {
        if kept.iter().all(|k| k.axis != line.axis || (k.cycles_per_orbit - line.cycles_per_orbit).abs() > 0.15) {
            kept.push(line);
        }
    }
    kept.truncate(6);
    kept
}

//! Stretches in which a triad was held still, found from the scatter of its own readings.

use nalgebra::Vector3;

use crate::diagnose::measured::MeasuredError;

/// Length of the window whose scatter is looked at, s.
const WINDOW_S: f64 = 1.0;
/// A pose lasts at least this, s.
const POSE_S_MIN: f64 = 1.5;
/// Cut from both ends of a pose, s: the hand lets go and takes hold.
const MARGIN_S: f64 = 0.3;
/// A window this many times noisier than the quiet ones is not still. Scatter of a hundred readings varies by 10 %.
const QUIET_FACTOR: f64 = 2.0;

/// A pose that was knocked is still again within this, s, with its mean where it was to so many scatters of one reading.
const KNOCK_S: f64 = 2.0;
const KNOCK_SCATTERS: f64 = 1.5;

/// One reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Time, s.
    pub t_s: f64,
    /// Counts of the three axes.
    pub counts: Vector3<f64>,
}

/// One static pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// From, s.
    pub start_s: f64,
    /// To, s.
    pub end_s: f64,
    /// Mean counts.
    pub mean: Vector3<f64>,
    /// Scatter of one reading about the mean, one axis, counts.
    pub scatter: f64,
    /// Error of the mean, one axis, counts: half of what its two halves differ by, which has what is slow as well.
    pub error: f64,
}

/// Read columns of numbers separated by blanks or commas; `columns` names them: a time and three axes, such as
/// `t_s, x_counts, y_counts, z_counts` (what follows the first letter is the unit).
pub fn read(file: &str, text: &str, columns: Option<&[String]>) -> Result<Vec<Row>, MeasuredError> {
    let place = |letter: &str, default: usize| match columns {
        None => Some(default),
        Some(names) => names.iter().position(|n| n == letter || n.starts_with(&format!("{letter}_"))),
    };
    let places = [place("t", 0), place("x", 1), place("y", 2), place("z", 3)];
    let [Some(t), Some(x), Some(y), Some(z)] = places else {
        return Err(MeasuredError::Key {
            key: "recording.columns".to_owned(),
            expected: "a time and three axes among them, such as t_s, x_counts, y_counts and z_counts",
            found: format!("{:?}", columns.unwrap_or_default()),
        });
    };
    let to_s = match columns.and_then(|names| names[t].strip_prefix("t_")) {
        Some("ms") => 1e-3,
        Some("us") => 1e-6,
        Some("ns") => 1e-9,
        _ => 1.0,
    };
    let mut rows = Vec::new();
    for (i, line) in text.lines().enumerate() {
        if line.trim().is_empty() || line.starts_with(['#', '%']) {
            continue;
        }
        let commas = line.contains(',');
        let fields: Vec<Option<f64>> = line
            .split(|c: char| if commas { c == ',' } else { c.is_whitespace() })
            .map(str::trim)
            .filter(|f| commas || !f.is_empty())
            .map(|f| f.parse().ok())
            .collect();
        let at = |k: usize| fields.get(k).copied().flatten().filter(|v| v.is_finite());
        match (at(t), at(x), at(y), at(z)) {
            (Some(time), Some(x), Some(y), Some(z)) => {
                rows.push(Row { t_s: time * to_s, counts: Vector3::new(x, y, z) })
            }
            // A first line of names is allowed.
            _ if i == 0 => {}
            _ => {
                let expected = "a time and three counts".to_owned();
                return Err(MeasuredError::Line {
                    file: file.to_owned(),
                    line: i + 1,
                    expected,
                    found: line.to_owned(),
                });
            }
        }
    }
    Ok(rows)
}

/// Find the static poses.
pub fn find_poses(rows: &[Row]) -> Vec<Pose> {
    if rows.len() < 100 {
        return Vec::new();
    }
    let step_s = (rows[rows.len() - 1].t_s - rows[0].t_s) / (rows.len() - 1) as f64;
    if step_s <= 0.0 {
        return Vec::new();
    }
    let window = ((WINDOW_S / step_s).round() as usize).clamp(8, rows.len());
    let scatters = rolling_scatter(rows, window);
    let mut sorted = scatters.clone();
    sorted.sort_by(f64::total_cmp);
    // Much of such a recording is still; its quietest tenth says what still means.
    let quiet = sorted[sorted.len() / 10] * QUIET_FACTOR;
    let margin = (MARGIN_S / step_s).round() as usize;
    let least = (POSE_S_MIN / step_s).round() as usize;
    let mut stretches: Vec<(usize, usize)> = Vec::new();
    let mut start: Option<usize> = None;
    for i in 0..=scatters.len() {
        let still = scatters.get(i).is_some_and(|s| *s <= quiet);
        match (still, start) {
            (true, None) => start = Some(i),
            (false, Some(from)) => {
                let end = i - 1 + window;
                if end - from >= least + 2 * margin {
                    stretches.push((from + margin, end - margin));
                }
                start = None;
            }
            _ => {}
        }
    }
    joined(rows, stretches)
}

/// Stretches to poses. Two that follow each other closely with the same mean are one pose that was knocked.
fn joined(rows: &[Row], stretches: Vec<(usize, usize)>) -> Vec<Pose> {
    let mut poses: Vec<(Vec<Row>, Pose)> = Vec::new();
    for (from, to) in stretches {
        let own = pose(&rows[from..to]);
        if let Some((members, last)) = poses.last_mut() {
            let near = own.start_s - last.end_s < KNOCK_S;
            let moved = (own.mean - last.mean).amax();
            if near && moved < KNOCK_SCATTERS * 0.5 * (own.scatter + last.scatter) {
                let after = rows[from..to].iter().filter(|row| row.t_s > last.end_s);
                members.extend(after);
                *last = pose(members);
                continue;
            }
        }
        poses.push((rows[from..to].to_vec(), own));
    }
    poses.into_iter().map(|(_, pose)| pose).collect()
}

/// Scatter (one axis, counts) of each window of readings.
fn rolling_scatter(rows: &[Row], window: usize) -> Vec<f64> {
    let origin = rows[0].counts;
    let (mut sum, mut squares) = (Vector3::zeros(), 0.0);
    let mut out = Vec::with_capacity(rows.len());
    let n = window as f64;
    for (i, row) in rows.iter().enumerate() {
        let x = row.counts - origin;
        sum += x;
        squares += x.norm_squared();
        if i >= window {
            let old = rows[i - window].counts - origin;
            sum -= old;
            squares -= old.norm_squared();
        }
        if i + 1 >= window {
            out.push(((squares / n - (sum / n).norm_squared()) / 3.0).max(0.0).sqrt());
        }
    }
    out
}

fn pose(rows: &[Row]) -> Pose {
    let n = rows.len() as f64;
    let mean = rows.iter().map(|r| r.counts).sum::<Vector3<f64>>() / n;
    let scatter = (rows.iter().map(|r| (r.counts - mean).norm_squared()).sum::<f64>() / (3.0 * n)).sqrt();
    let mean_of = |rows: &[Row]| rows.iter().map(|r| r.counts).sum::<Vector3<f64>>() / rows.len() as f64;
    let (first, second) = rows.split_at(rows.len() / 2);
    let error = (0.25 * (mean_of(first) - mean_of(second)).norm_squared() / 3.0).sqrt();
    Pose { start_s: rows[0].t_s, end_s: rows[rows.len() - 1].t_s, mean, scatter, error }
}

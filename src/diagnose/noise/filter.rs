//! The whitening filter of an axis: linear, the same for data and for every regressor. Several series are whitened side by side.

use multiversion::multiversion;

use super::kalman::{LogSum, Memory, Riccati, Row};
use super::{AxisNoise, Loudness, Schedule, Stretch};

/// Windows between two looks at whether all of them are over.
const CHUNK: usize = 64;

/// Whitened innovations of the next values of several series, all by one filter, each in a lane of its own.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx+avx2", "x86_64+avx+avx2"))]
fn whiten_chunk<const L: usize, const R: usize>(
    memory: &mut Memory<L, R>,
    rows: &[Row<1, R>],
    values: [&[f64]; L],
    innovations: &mut [[f32; CHUNK]; L],
) {
    let n = rows.len().min(CHUNK);
    let values = values.map(|lane| &lane[..n]);
    for i in 0..n {
        let whitened = memory.whiten_alike(&rows[i], std::array::from_fn(|l| values[l][i]));
        for l in 0..L {
            innovations[l][i] = whitened[l] as f32;
        }
    }
}

/// Largest magnitude; what is no number is passed over.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx+avx2", "x86_64+avx+avx2"))]
fn largest(values: &[f32]) -> f32 {
    let greater = |a: f32, b: f32| if b > a { b } else { a };
    let (chunks, mut lanes) = (values.chunks_exact(8), [0.0_f32; 8]);
    let rest = chunks.remainder().iter().fold(0.0, |m, w| greater(m, w.abs()));
    for chunk in chunks {
        (0..8).for_each(|j| lanes[j] = greater(lanes[j], chunk[j].abs()));
    }
    lanes.into_iter().fold(rest, greater)
}

/// Where what a filter remembers of a series is negligible.
struct Tail {
    last: usize,
    largest: f32,
    quiet: usize,
    end: Option<usize>,
}

impl Tail {
    fn new(series: Stretch) -> Self {
        // Of a series of zeros nothing is remembered.
        Self { last: series.end(), largest: 0.0, quiet: 0, end: series.values.is_empty().then_some(series.first) }
    }

    /// Goes on over innovations, the first of which is that of window `at`.
    fn follow(&mut self, innovations: &[f32], at: usize) {
        let inside = self.last.saturating_sub(at).min(innovations.len());
        self.largest = largest(&innovations[..inside]).max(self.largest);
        for (i, w) in innovations.iter().enumerate().skip(inside) {
            if self.end.is_some() {
                return;
            }
            self.quiet = if w.abs() < 1e-5 * self.largest { self.quiet + 1 } else { 0 };
            self.end = (self.quiet > 8).then_some(at + i + 1);
        }
    }
}

/// The whitening filter of one axis: linear, the same for data and for every regressor.
#[derive(Debug, Clone)]
pub struct Whitener {
    rows: Rows,
    log_det: f64,
}

/// Rows of a filter without a resonance, and with one.
#[derive(Debug, Clone)]
enum Rows {
    Plain(Vec<Row<1, 0>>),
    Resonant(Vec<Row<1, 1>>),
}

/// Rows of a filter, and the log determinant of the covariance.
fn rows<const R: usize>(noise: &AxisNoise, schedule: &Schedule, loudness: &Loudness) -> (Vec<Row<1, R>>, f64) {
    let mut riccati = Riccati::new(&[*noise], schedule);
    let mut log_det = LogSum::new();
    let rows = (0..schedule.len())
        .map(|i| {
            let (row, variance) = riccati.row(i, [loudness.activity[i]], [loudness.burst[i]], [loudness.alone[i]]);
            log_det.add(variance);
            row
        })
        .collect();
    let [log_det] = log_det.total();
    (rows, log_det)
}

impl Whitener {
    /// From the noise, the windows and how loud each is.
    pub fn new(noise: &AxisNoise, schedule: &Schedule, loudness: &Loudness) -> Self {
        if noise.resonance.is_none() {
            let (rows, log_det) = rows(noise, schedule, loudness);
            return Self { rows: Rows::Plain(rows), log_det };
        }
        let (rows, log_det) = rows(noise, schedule, loudness);
        Self { rows: Rows::Resonant(rows), log_det }
    }

    /// Log determinant of the covariance.
    pub fn log_det(&self) -> f64 {
        self.log_det
    }

    /// Share of the variance of the innovation of window `i` that its new samples have as long as they are ordinary.
    pub fn new_share(&self, i: usize, noise: &AxisNoise, schedule: &Schedule, loudness: &Loudness) -> f64 {
        let [per_sd] = match &self.rows {
            Rows::Plain(rows) => rows[i].per_sd,
            Rows::Resonant(rows) => rows[i].per_sd,
        };
        (loudness.activity[i] * schedule.overlap[i][0] * noise.white_ng * per_sd).powi(2)
    }

    /// Whitened innovations of a series at the windows.
    pub fn whiten(&self, series: &[f64]) -> Vec<f64> {
        match &self.rows {
            Rows::Plain(rows) => whiten(rows, series),
            Rows::Resonant(rows) => whiten(rows, series),
        }
    }

    /// Whitened innovations of several series, in single precision. Each answer starts at the first window of its stretch and ends
    /// where what the filter remembers of it is negligible; outside it, it is zero. Side by side they take little longer than one
    /// for itself: every step of a filter needs the one before.
    pub fn whiten_stretches<const L: usize>(&self, series: [Stretch; L]) -> [Vec<f32>; L] {
        match &self.rows {
            Rows::Plain(rows) => whiten_stretches(rows, series),
            Rows::Resonant(rows) => whiten_stretches(rows, series),
        }
    }

    /// Three whole series, each with a filter of its own, in one pass where they are alike; in single precision.
    pub fn whiten_three(filters: &[Whitener; 3], series: [&[f64]; 3]) -> [Vec<f32>; 3] {
        if let [Rows::Plain(x), Rows::Plain(y), Rows::Plain(z)] = filters.each_ref().map(|filter| &filter.rows) {
            return whiten_three([x, y, z], series);
        }
        std::array::from_fn(|k| filters[k].whiten(series[k]).into_iter().map(|w| w as f32).collect())
    }
}

fn whiten<const R: usize>(rows: &[Row<1, R>], series: &[f64]) -> Vec<f64> {
    let mut memory = Memory::new();
    rows.iter().zip(series).flat_map(|(row, x)| memory.whiten(row, [*x])).collect()
}

fn whiten_stretches<const L: usize, const R: usize>(rows: &[Row<1, R>], series: [Stretch; L]) -> [Vec<f32>; L] {
    let n = rows.len();
    debug_assert!(series.iter().all(|s| s.end() <= n), "a value for no more than every window");
    let begin = series.iter().map(|s| s.first).min().unwrap_or(0).min(n);
    let rest = series.iter().map(Stretch::end).max().unwrap_or(n);
    let mut memory = Memory::new();
    let mut out: [Vec<f32>; L] = std::array::from_fn(|_| Vec::with_capacity(n - begin));
    let mut tails = series.map(Tail::new);
    let (mut partly, mut innovations) = ([[0.0; CHUNK]; L], [[0.0; CHUNK]; L]);
    for chunk in (begin..n).step_by(CHUNK) {
        let end = (chunk + CHUNK).min(n);
        let mut lanes: [&[f64]; L] = [&[]; L];
        for ((lane, partly), series) in lanes.iter_mut().zip(&mut partly).zip(&series) {
            let (from, to) = (series.first.max(chunk), series.end().min(end));
            if (from, to) == (chunk, end) {
                *lane = &series.values[from - series.first..to - series.first];
                continue;
            }
            partly.fill(0.0);
            if from < to {
                partly[from - chunk..to - chunk]
                    .copy_from_slice(&series.values[from - series.first..to - series.first]);
            }
            *lane = &partly[..end - chunk];
        }
        whiten_chunk(&mut memory, &rows[chunk..end], lanes, &mut innovations);
        for ((out, tail), innovations) in out.iter_mut().zip(&mut tails).zip(&innovations) {
            let innovations = &innovations[..end - chunk];
            out.extend_from_slice(innovations);
            if tail.last < n {
                tail.follow(innovations, chunk);
            }
        }
        if end > rest && tails.iter().all(|tail| tail.end.is_some()) {
            break;
        }
    }
    for (l, out) in out.iter_mut().enumerate() {
        out.truncate(tails[l].end.unwrap_or(n).max(begin) - begin);
        out.drain(..(series[l].first.min(n) - begin).min(out.len()));
        out.shrink_to_fit();
    }
    out
}

fn whiten_three(rows: [&Vec<Row<1, 0>>; 3], series: [&[f64]; 3]) -> [Vec<f32>; 3] {
    let n = rows[0].len();
    let rows = rows.map(|rows| &rows[..n]);
    let series = series.map(|s| &s[..n]);
    let mut memory = [Memory::new(); 3];
    let mut out: [Vec<f32>; 3] = std::array::from_fn(|_| Vec::with_capacity(n));
    for i in 0..n {
        for k in 0..3 {
            let [w] = memory[k].whiten(&rows[k][i], [series[k][i]]);
            out[k].push(w as f32);
        }
    }
    out
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::diagnose::noise::simulate;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// Noise of all kinds but a resonance.
    pub const NOISE: AxisNoise = AxisNoise {
        white_ng: 100.0,
        short_ng: 30.0,
        short_tau_s: 120.0,
        slow_ng: 25.0,
        slow_tau_s: 3600.0,
        resonance: None,
    };

    /// Windows with gaps, levels and a burst, and that noise in them.
    pub fn record(seed: u64) -> (Schedule, Loudness, Vec<f64>) {
        let clock: Vec<f64> = (0..2000).filter(|i| i % 190 > 3).map(|i| 25.0 * f64::from(i)).collect();
        let schedule = Schedule::new(&clock);
        let mut loudness = Loudness::even((0..schedule.len()).map(|i| if i > 700 { 0.6 } else { 1.2 }).collect());
        loudness.burst[400] = 20.0;
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let x = simulate(&NOISE, &schedule, &loudness, || StandardNormal.sample(&mut rng));
        (schedule, loudness, x)
    }

    #[test]
    fn series_side_by_side_come_out_as_each_alone() {
        let (schedule, loudness, x) = record(1);
        let whitener = Whitener::new(&NOISE, &schedule, &loudness);
        let n = schedule.len();
        // The whole record, a stretch of it, its end, and nothing at all.
        let stretches = [[0, n], [300, 420], [n - 30, n], [n, n]];
        let series = stretches.map(|[first, last]| {
            (0..n).map(|i| if (first..last).contains(&i) { x[i] } else { 0.0 }).collect::<Vec<f64>>()
        });
        let together = whitener.whiten_stretches(series.each_ref().map(|s| Stretch::of(s)));
        for ((series, [first, _]), whitened) in series.iter().zip(stretches).zip(&together) {
            let alone: Vec<f32> = whitener.whiten(series).into_iter().map(|w| w as f32).collect();
            assert_eq!(whitened[..], alone[first..first + whitened.len()]);
            let largest = alone.iter().fold(0.0_f32, |m, w| m.max(w.abs()));
            assert!(alone[first + whitened.len()..].iter().all(|w| w.abs() <= 2e-5 * largest));
        }
        assert!(together[1].len() < n - 300 && together[3].is_empty());
    }
}

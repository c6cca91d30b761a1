//! The whitening filter: a Kalman filter of three states, and of two more where there is a resonance; linear, the same for data and for
//! every regressor.
//!
//! Every step of a filter needs the one before, so that one series after another waits for itself; several are taken side by side.

use multiversion::multiversion;
use nalgebra::{DMatrix, DVector};

use super::{AxisNoise, Loudness, Resonance, Schedule, Stretch};

/// Gains of whitening filters side by side, one row a window; with `R` resonances, none or one, each of two states.
#[derive(Debug, Clone, Copy)]
struct Row<const L: usize, const R: usize> {
    h: [[f64; L]; 2],
    per_sd: [f64; L],
    gain: [[f64; L]; 3],
    decay: [[f64; L]; 2],
    resonance_gain: [[[f64; L]; 2]; R],
    resonance_h: [[f64; L]; R],
    transition: [[[[f64; L]; 2]; 2]; R],
}

/// The Riccati recursion of several noises side by side: covariance of (previous sample noise, short, slow) before a window, then of
/// those with the two states of each resonance, and of these among themselves.
struct Riccati<'a, const L: usize, const R: usize> {
    variance: [[f64; L]; 3],
    tau_s: [[f64; L]; 2],
    resonance: [[Resonance; L]; R],
    schedule: &'a Schedule,
    p: [[f64; L]; 6],
    with_resonance: [[[[f64; L]; 2]; 3]; R],
    of_resonance: [[[f64; L]; 3]; R],
    decay: [[f64; L]; 2],
    transition: [[[[f64; L]; 2]; 2]; R],
    step_before: f64,
}

impl<'a, const L: usize, const R: usize> Riccati<'a, L, R> {
    fn new(noise: &[AxisNoise; L], schedule: &'a Schedule) -> Self {
        let of = |f: fn(&AxisNoise) -> f64| std::array::from_fn(|l| f(&noise[l]));
        let variance = [of(|n| n.white_ng.powi(2)), of(|n| n.short_ng.powi(2)), of(|n| n.slow_ng.powi(2))];
        let none = [0.0; L];
        let resonance = [noise.map(|n| n.resonance.unwrap_or(Resonance::NONE)); R];
        Self {
            variance,
            tau_s: [of(|n| n.short_tau_s), of(|n| n.slow_tau_s)],
            resonance,
            schedule,
            p: [variance[0], none, none, variance[1], none, variance[2]],
            with_resonance: [[[none; 2]; 3]; R],
            of_resonance: resonance.map(|of| [of.map(|r| r.rms_ng.powi(2)), none, of.map(|r| r.rms_ng.powi(2))]),
            decay: [none; 2],
            transition: [[[none; 2]; 2]; R],
            step_before: f64::NAN,
        }
    }

    /// The row of window `i` at activities `s` and bursts, and the variances of its innovations; windows in order.
    #[inline(always)]
    fn row(&mut self, i: usize, s: [f64; L], burst: [f64; L]) -> (Row<L, R>, [f64; L]) {
        let [own, previous] = self.schedule.overlap[i];
        let step = self.schedule.step_s[i];
        if step != self.step_before {
            self.decay = self.tau_s.map(|tau| tau.map(|tau| (-step / tau).exp()));
            self.transition = self.resonance.map(|of| {
                let all = of.map(|r| r.transition(step));
                std::array::from_fn(|i| std::array::from_fn(|j| all.map(|transition| transition[i][j])))
            });
            self.step_before = step;
        }
        let mut row = Row {
            h: [[0.0; L]; 2],
            per_sd: [0.0; L],
            gain: [[0.0; L]; 3],
            decay: self.decay,
            resonance_gain: [[[0.0; L]; 2]; R],
            resonance_h: [[0.0; L]; R],
            transition: self.transition,
        };
        let mut variance = [0.0; L];
        for l in 0..L {
            let [vw, v1, v2] = [self.variance[0][l] * burst[l], self.variance[1][l], self.variance[2][l]];
            let [f1, f2] = [self.decay[0][l], self.decay[1][l]];
            let (p00, p01, p02) = (self.p[0][l], self.p[1][l] * f1, self.p[2][l] * f2);
            let p11 = f1 * f1 * (self.p[3][l] - v1) + v1;
            let p12 = self.p[4][l] * f1 * f2;
            let p22 = f2 * f2 * (self.p[5][l] - v2) + v2;
            let (h0, h1) = (s[l] * previous, s[l]);
            let [mut c0, mut c1, mut c2] =
                [h0 * p00 + h1 * p01 + p02, h0 * p01 + h1 * p11 + p12, h0 * p02 + h1 * p12 + p22];
            let ce = s[l] * own * vw;
            // Covariances of what is seen with each resonance.
            let mut cr = [[0.0; 2]; R];
            let mut seen = 0.0;
            for r in 0..R {
                self.step_resonance(r, l);
                let (with, of) = (&self.with_resonance[r], &self.of_resonance[r]);
                let hr = self.resonance[r][l].loudness(s[l]);
                cr[r] =
                    std::array::from_fn(|j| h0 * with[0][j][l] + h1 * with[1][j][l] + with[2][j][l] + hr * of[j][l]);
                c0 += hr * with[0][0][l];
                c1 += hr * with[1][0][l];
                c2 += hr * with[2][0][l];
                seen += hr * cr[r][0];
                row.resonance_h[r][l] = hr;
            }
            variance[l] = h0 * c0 + h1 * c1 + c2 + seen + s[l] * own * ce;
            let inverse = 1.0 / variance[l];
            let gain = [ce * inverse, c1 * inverse, c2 * inverse];
            self.p[0][l] = vw - ce * gain[0];
            self.p[1][l] = -ce * gain[1];
            self.p[2][l] = -ce * gain[2];
            self.p[3][l] = p11 - c1 * gain[1];
            self.p[4][l] = p12 - c1 * gain[2];
            self.p[5][l] = p22 - c2 * gain[2];
            for r in 0..R {
                let [a, b] = cr[r].map(|c| c * inverse);
                let (with, of) = (&mut self.with_resonance[r], &mut self.of_resonance[r]);
                for (j, gain) in [a, b].into_iter().enumerate() {
                    with[0][j][l] = -ce * gain;
                    with[1][j][l] -= c1 * gain;
                    with[2][j][l] -= c2 * gain;
                    row.resonance_gain[r][j][l] = gain;
                }
                of[0][l] -= cr[r][0] * a;
                of[1][l] -= cr[r][0] * b;
                of[2][l] -= cr[r][1] * b;
            }
            (row.h[0][l], row.h[1][l], row.per_sd[l]) = (h0, h1, inverse.sqrt());
            (row.gain[0][l], row.gain[1][l], row.gain[2][l]) = (gain[0], gain[1], gain[2]);
        }
        (row, variance)
    }

    /// Takes the covariances of a resonance from the window before to this one.
    #[inline(always)]
    fn step_resonance(&mut self, r: usize, l: usize) {
        let [a, b] = self.transition[r].map(|row| [row[0][l], row[1][l]]);
        let step = |[x, v]: [f64; 2]| [a[0] * x + a[1] * v, b[0] * x + b[1] * v];
        for (with, decay) in self.with_resonance[r].iter_mut().zip([1.0, self.decay[0][l], self.decay[1][l]]) {
            let [x, v] = step([with[0][l], with[1][l]]);
            (with[0][l], with[1][l]) = (decay * x, decay * v);
        }
        // Displacement and velocity are independent and as large in the long run: they go back to that.
        let variance = self.resonance[r][l].rms_ng.powi(2);
        let of = &mut self.of_resonance[r];
        let columns = [step([of[0][l] - variance, of[1][l]]), step([of[1][l], of[2][l] - variance])];
        let [first, second] = [0, 1].map(|row| step([columns[0][row], columns[1][row]]));
        (of[0][l], of[1][l], of[2][l]) = (first[0] + variance, first[1], second[1] + variance);
    }
}

/// Sums of logarithms, taken eight factors at a time.
struct LogSum<const L: usize> {
    sum: [f64; L],
    product: [f64; L],
    count: usize,
}

impl<const L: usize> LogSum<L> {
    fn new() -> Self {
        Self { sum: [0.0; L], product: [1.0; L], count: 0 }
    }

    fn add(&mut self, x: [f64; L]) {
        self.product.iter_mut().zip(x).for_each(|(product, x)| *product *= x);
        self.count += 1;
        if self.count.is_multiple_of(8) {
            self.sum.iter_mut().zip(self.product).for_each(|(sum, product)| *sum += product.ln());
            self.product = [1.0; L];
        }
    }

    fn total(self) -> [f64; L] {
        std::array::from_fn(|l| self.sum[l] + self.product[l].ln())
    }
}

/// What filters remember of their series.
#[derive(Clone, Copy)]
struct Memory<const L: usize, const R: usize>([[f64; L]; 3], [[[f64; L]; 2]; R]);

impl<const L: usize, const R: usize> Memory<L, R> {
    fn new() -> Self {
        Self([[0.0; L]; 3], [[[0.0; L]; 2]; R])
    }

    /// The whitened innovations of the next values, each filter with the row of its own.
    #[inline(always)]
    fn whiten(&mut self, row: &Row<L, R>, x: [f64; L]) -> [f64; L] {
        self.whiten_by(row, x, |l| l)
    }

    /// The same with one filter for all of them.
    #[inline(always)]
    fn whiten_alike(&mut self, row: &Row<1, R>, x: [f64; L]) -> [f64; L] {
        self.whiten_by(row, x, |_| 0)
    }

    /// The same, each with the filter at a place of the row.
    #[inline(always)]
    fn whiten_by<const F: usize>(&mut self, row: &Row<F, R>, x: [f64; L], of: impl Fn(usize) -> usize) -> [f64; L] {
        let Self([z0, z1, z2], resonances) = self;
        let mut out = [0.0; L];
        for l in 0..L {
            let f = of(l);
            let (one, two) = (z1[l] * row.decay[0][f], z2[l] * row.decay[1][f]);
            let mut innovation = x[l] - row.h[0][f] * z0[l] - row.h[1][f] * one - two;
            for ((states, [a, b]), h) in resonances.iter_mut().zip(&row.transition).zip(&row.resonance_h) {
                let [x, v] = [states[0][l], states[1][l]];
                states[0][l] = a[0][f] * x + a[1][f] * v;
                states[1][l] = b[0][f] * x + b[1][f] * v;
                innovation -= h[f] * states[0][l];
            }
            z0[l] = row.gain[0][f] * innovation;
            z1[l] = one + row.gain[1][f] * innovation;
            z2[l] = two + row.gain[2][f] * innovation;
            for (states, gain) in resonances.iter_mut().zip(&row.resonance_gain) {
                states[0][l] += gain[0][f] * innovation;
                states[1][l] += gain[1][f] * innovation;
            }
            out[l] = innovation * row.per_sd[f];
        }
        out
    }
}

/// Windows between two looks at whether all of them are over.
const CHUNK: usize = 64;

/// Values become their whitened innovations, all by one filter.
#[multiversion(targets("x86_64+avx+avx2"))]
fn whiten_chunk<const L: usize, const R: usize>(
    memory: &mut Memory<L, R>,
    rows: &[Row<1, R>],
    values: &mut [[f64; L]],
) {
    for (value, row) in values.iter_mut().zip(rows) {
        *value = memory.whiten_alike(row, *value);
    }
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
        for w in &innovations[..inside] {
            let w = w.abs();
            self.largest = if w > self.largest { w } else { self.largest };
        }
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
            let (row, variance) = riccati.row(i, [loudness.activity[i]], [loudness.burst[i]]);
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
    for chunk in (begin..n).step_by(CHUNK) {
        let end = (chunk + CHUNK).min(n);
        let mut values = [[0.0; L]; CHUNK];
        for (l, series) in series.iter().enumerate() {
            let (from, to) = (series.first.max(chunk), series.end().min(end));
            if from < to {
                let inside = &series.values[from - series.first..to - series.first];
                values[from - chunk..].iter_mut().zip(inside).for_each(|(value, x)| value[l] = *x);
            }
        }
        whiten_chunk(&mut memory, &rows[chunk..end], &mut values);
        for (l, out) in out.iter_mut().enumerate() {
            out.extend(values[..end - chunk].iter().map(|value| value[l] as f32));
        }
        for (tail, out) in tails.iter_mut().zip(&out).filter(|(tail, _)| tail.last < n) {
            tail.follow(&out[chunk - begin..], chunk);
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

/// A series with what is nuisance in it: a constant, and errors that all windows share.
#[derive(Debug, Clone, Copy)]
pub(super) struct Series<'a> {
    /// The series at the windows.
    pub data: &'a [f64],
    /// Series whose true sizes are independent and standard normal.
    pub shared: &'a [Vec<f64>],
}

/// Products of a whitened series, of the whitened constant and of the whitened shared errors, with each other.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Products {
    /// Log determinant of the covariance.
    pub(super) log_det: f64,
    /// Number of values.
    pub(super) count: f64,
    /// Of the series with itself.
    pub(super) energy: f64,
    /// Of what is nuisance with the series, the constant first.
    pub(super) along: DVector<f64>,
    /// Of what is nuisance with itself.
    pub(super) nuisance: DMatrix<f64>,
}

impl Products {
    /// Restricted log likelihood, but for its constant, of a noise `scale2` times as strong.
    pub fn log_likelihood(&self, scale2: f64) -> f64 {
        let (left, ln_det) = self.left(scale2);
        -0.5 * (self.log_det + (self.count - 1.0) * scale2.ln() + left / scale2 + ln_det)
    }

    /// How much stronger the noise is likeliest to be.
    pub fn likeliest_scale2(&self) -> f64 {
        // Without shared errors the first round is exact; a noise that is stronger has them decided less.
        let rounds = if self.along.len() > 1 { 3 } else { 1 };
        (0..rounds).fold(1.0, |scale2, _| self.left(scale2).0 / (self.count - 1.0))
    }

    /// What the nuisance leaves of the energy at a noise `scale2` times as strong, and the log determinant it adds, but for what a
    /// constant adds at any strength.
    fn left(&self, scale2: f64) -> (f64, f64) {
        let (along, one) = (&self.along, self.nuisance[(0, 0)]);
        if along.len() == 1 {
            return (self.energy - along[0] * along[0] / one, one.ln());
        }
        let mut normal = self.nuisance.clone();
        (1..along.len()).for_each(|j| normal[(j, j)] += scale2);
        let Some(cholesky) = normal.cholesky() else {
            return (self.energy - along[0] * along[0] / one, one.ln());
        };
        let ln_det = 2.0 * cholesky.l_dirty().diagonal().map(f64::ln).sum();
        (self.energy - cholesky.solve(along).dot(along), ln_det - (along.len() - 1) as f64 * scale2.ln())
    }
}

/// Products of several series in one pass, each with noise and loudness of its own.
pub(super) fn products<const L: usize>(
    noise: &[AxisNoise; L],
    schedule: &Schedule,
    loudness: [&Loudness; L],
    series: [Series; L],
) -> [Products; L] {
    if noise.iter().all(|n| n.resonance.is_none()) {
        products_with::<L, 0>(noise, schedule, loudness, series)
    } else {
        products_with::<L, 1>(noise, schedule, loudness, series)
    }
}

/// The same with so many resonances.
#[multiversion(targets("x86_64+avx+avx2"))]
fn products_with<const L: usize, const R: usize>(
    noise: &[AxisNoise; L],
    schedule: &Schedule,
    loudness: [&Loudness; L],
    series: [Series; L],
) -> [Products; L] {
    let n = schedule.len();
    let (activity, burst) = (loudness.map(|a| &a.activity[..n]), loudness.map(|a| &a.burst[..n]));
    let data = series.map(|s| &s.data[..n]);
    let errors = series.iter().map(|s| s.shared.len()).max().unwrap_or(0);
    // A series that shares fewer errors than another has some that are nothing.
    let nothing = vec![0.0; if errors > 0 { n } else { 0 }];
    let shared: Vec<[&[f64]; L]> =
        (0..errors).map(|j| series.map(|s| s.shared.get(j).map_or(&nothing[..], |e| &e[..n]))).collect();
    let mut riccati = Riccati::<L, R>::new(noise, schedule);
    let mut log_det = LogSum::new();
    let mut memory = [Memory::<L, R>::new(); 2];
    let mut sums = [[0.0; L]; 3];
    let mut of_errors = vec![(Memory::<L, R>::new(), [0.0; L]); errors];
    // Of every error with the series, with the constant, and with the errors up to itself.
    let mut error_sums = vec![[0.0; L]; errors * (errors + 5) / 2];
    for i in 0..n {
        let (row, variance) = riccati.row(i, activity.map(|a| a[i]), burst.map(|b| b[i]));
        log_det.add(variance);
        let d = memory[0].whiten(&row, std::array::from_fn(|l| data[l][i]));
        let c = memory[1].whiten(&row, [1.0; L]);
        for l in 0..L {
            sums[0][l] += d[l] * d[l];
            sums[1][l] += d[l] * c[l];
            sums[2][l] += c[l] * c[l];
        }
        let mut place = 0;
        for j in 0..errors {
            let (memory, now) = &mut of_errors[j];
            *now = memory.whiten(&row, std::array::from_fn(|l| shared[j][l][i]));
            let now = *now;
            let others = [d, c].into_iter().chain(of_errors[..=j].iter().map(|(_, other)| *other));
            for (sum, other) in error_sums[place..].iter_mut().zip(others) {
                (0..L).for_each(|l| sum[l] += now[l] * other[l]);
            }
            place += j + 3;
        }
    }
    let log_det = log_det.total();
    std::array::from_fn(|l| {
        let m = series[l].shared.len();
        let of_error = |j: usize, other: usize| error_sums[j * (j + 5) / 2 + other][l];
        Products {
            log_det: log_det[l],
            count: n as f64,
            energy: sums[0][l],
            along: DVector::from_fn(m + 1, |j, _| if j == 0 { sums[1][l] } else { of_error(j - 1, 0) }),
            nuisance: DMatrix::from_fn(m + 1, m + 1, |a, b| match (a.max(b), a.min(b)) {
                (0, _) => sums[2][l],
                (j, 0) => of_error(j - 1, 1),
                (j, other) => of_error(j - 1, other + 1),
            }),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::noise::simulate;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const NOISE: AxisNoise = AxisNoise {
        white_ng: 100.0,
        short_ng: 30.0,
        short_tau_s: 120.0,
        slow_ng: 25.0,
        slow_tau_s: 3600.0,
        resonance: None,
    };

    fn record(seed: u64) -> (Schedule, Loudness, Vec<f64>) {
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

    #[test]
    fn products_of_several_noises_are_those_of_each() {
        let (schedule, loudness, x) = record(2);
        let louder = AxisNoise { slow_ng: 60.0, slow_tau_s: 900.0, ..NOISE };
        let y: Vec<f64> = x.iter().map(|x| x + 40.0).collect();
        let errors = [vec![(0..x.len()).map(|i| 0.01 * i as f64).collect(), vec![3.0; x.len()]], vec![y.clone()]];
        let [a, b] = [Series { data: &x, shared: &errors[0] }, Series { data: &y, shared: &errors[1] }];
        let both = products(&[NOISE, louder], &schedule, [&loudness; 2], [a, b]);
        assert_eq!(both[0], products(&[NOISE], &schedule, [&loudness], [a])[0]);
        assert_eq!(both[1], products(&[louder], &schedule, [&loudness], [b])[0]);
        let whitener = Whitener::new(&NOISE, &schedule, &loudness);
        let w = whitener.whiten(&x);
        let energy: f64 = w.iter().map(|w| w * w).sum();
        assert!((both[0].energy / energy - 1.0).abs() < 1e-12 && (both[0].log_det - whitener.log_det()).abs() < 1e-6);
    }

    /// A few windows, their covariance written out: shared errors are noise of rank one each, a constant is one without bounds.
    #[test]
    fn the_likelihood_is_that_of_the_covariance_with_the_shared_errors_in_it() {
        let schedule = Schedule::new(&[0.0, 25.0, 50.0, 400.0, 425.0, 900.0, 2000.0]);
        let loudness = Loudness::even(vec![1.0, 0.7, 0.7, 1.0, 1.0, 1.2, 1.0]);
        let data = [30.0, -80.0, 120.0, 60.0, -20.0, 200.0, 90.0];
        let shared = vec![vec![10.0, 12.0, 14.0, 30.0, 32.0, 60.0, 120.0], vec![5.0, -5.0, 4.0, -4.0, 3.0, -3.0, 8.0]];
        let n = data.len();
        let whitener = Whitener::new(&NOISE, &schedule, &loudness);
        // Rows of the whitening matrix, so that its covariance is (W'W)^-1.
        let unit = |j: usize| (0..n).map(|i| f64::from(u8::from(i == j))).collect::<Vec<f64>>();
        let whitening =
            DMatrix::from_columns(&(0..n).map(|j| whitener.whiten(&unit(j)).into()).collect::<Vec<DVector<f64>>>());
        let quick = (whitening.transpose() * &whitening).try_inverse().unwrap();
        let [found] = products(&[NOISE], &schedule, [&loudness], [Series { data: &data, shared: &shared }]);
        for scale2 in [1.0, 2.5] {
            let errors = shared.iter().map(|e| DVector::from_column_slice(e));
            let covariance = errors.fold(&quick * scale2, |sum, e| sum + &e * e.transpose());
            let inverse = covariance.clone().try_inverse().unwrap();
            let (one, d) = (DVector::from_element(n, 1.0), DVector::from_column_slice(&data));
            let (cc, dc, dd) = (one.dot(&(&inverse * &one)), one.dot(&(&inverse * &d)), d.dot(&(&inverse * &d)));
            let direct = -0.5 * (covariance.determinant().ln() + dd - dc * dc / cc + cc.ln());
            assert!((found.log_likelihood(scale2) - direct).abs() < 1e-8, "{} {direct}", found.log_likelihood(scale2));
        }
        let best = found.likeliest_scale2();
        let at = |x: f64| found.log_likelihood(best * x);
        assert!(at(1.0) > at(1.3) && at(1.0) > at(0.7), "{} {} {}", at(0.7), at(1.0), at(1.3));
    }

    /// Every part written out as a covariance, a resonance as that of a driven damped oscillator: likelihood, whitening, and three filters side by side.
    #[test]
    fn the_filter_is_that_of_the_covariance_with_a_resonance_and_without() {
        let resonance = Resonance { rms_ng: 40.0, period_s: 330.0, tau_s: 410.0, follows_crew: false };
        let clock: Vec<f64> = (0..60).filter(|i| i % 17 > 2).map(|i| 25.0 * f64::from(i)).collect();
        let schedule = Schedule::new(&clock);
        let n = clock.len();
        let loudness = Loudness::even((0..n).map(|i| 0.6 + 0.01 * i as f64).collect());
        let data: Vec<f64> = (0..n).map(|i| 100.0 * (i as f64 * 1.3).sin() + 3.0 * i as f64).collect();
        let loud_awake = Resonance { follows_crew: true, ..resonance };
        let noises = [None, Some(resonance), Some(loud_awake)].map(|resonance| AxisNoise { resonance, ..NOISE });
        let whiteners = noises.map(|noise| Whitener::new(&noise, &schedule, &loudness));
        let series = [Series { data: &data, shared: &[] }; 3];
        let found = products(&noises, &schedule, [&loudness; 3], series);
        for ((noise, whitener), found) in noises.iter().zip(&whiteners).zip(&found) {
            let covariance = DMatrix::from_fn(n, n, |i, j| {
                let apart = (clock[i] - clock[j]).abs();
                let white = NOISE.white_ng.powi(2) * (1.0 - apart / 50.0).max(0.0);
                let short = NOISE.short_ng.powi(2) * (-apart / NOISE.short_tau_s).exp();
                let slow = NOISE.slow_ng.powi(2) * (-apart / NOISE.slow_tau_s).exp();
                let oscillating = noise.resonance.map_or(0.0, |r| {
                    let damped = std::f64::consts::TAU / r.period_s;
                    let oscillation = (damped * apart).cos() + (damped * apart).sin() / (damped * r.tau_s);
                    r.rms_ng.powi(2) * (-apart / r.tau_s).exp() * oscillation
                });
                let activities = loudness.activity[i] * loudness.activity[j];
                let follows = noise.resonance.is_some_and(|r| r.follows_crew);
                activities * (white + short) + if follows { activities } else { 1.0 } * oscillating + slow
            });
            let inverse = covariance.clone().try_inverse().unwrap();
            let (one, d) = (DVector::from_element(n, 1.0), DVector::from_column_slice(&data));
            let (cc, dc, dd) = (one.dot(&(&inverse * &one)), one.dot(&(&inverse * &d)), d.dot(&(&inverse * &d)));
            let log_det = covariance.cholesky().unwrap().l().diagonal().map(f64::ln).sum() * 2.0;
            assert!((whitener.log_det() - log_det).abs() < 1e-8, "{} {log_det}", whitener.log_det());
            let direct = -0.5 * (log_det + dd - dc * dc / cc + cc.ln());
            assert!((found.log_likelihood(1.0) - direct).abs() < 1e-8, "{} {direct}", found.log_likelihood(1.0));
            let energy: f64 = whitener.whiten(&data).iter().map(|w| w * w).sum();
            assert!((energy / dd - 1.0).abs() < 1e-10, "{energy} {dd}");
        }
        let together = Whitener::whiten_three(&whiteners, [&data; 3]);
        for (whitened, whitener) in together.iter().zip(&whiteners) {
            let alone: Vec<f32> = whitener.whiten(&data).into_iter().map(|w| w as f32).collect();
            assert_eq!(*whitened, alone);
            let [stretch] = whitener.whiten_stretches([Stretch::of(&data[..])]);
            assert_eq!(stretch[..], alone[alone.len() - stretch.len()..]);
        }
    }
}

//! The Kalman filter: its gains, window by window, and what it remembers of a series. Three states, and two more where there is a
//! resonance; several noises or series side by side, since every step needs the one before.
//!
//! Where a window sees the mean of the slow part (see [`SlowSeen`]), the state of that is its value in the latter half of the window,
//! and the window sees the mean of it and of the value in the former half, which is the latter half of the window before where both
//! overlap.

use super::{AxisNoise, Resonance, Schedule, SlowSeen};

/// Gains of whitening filters side by side, one row a window; with `R` resonances, none or one, each of two states.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row<const L: usize, const R: usize> {
    h: [[f64; L]; 3],
    pub(super) per_sd: [f64; L],
    gain: [[f64; L]; 3],
    decay: [[f64; L]; 2],
    resonance_gain: [[[f64; L]; 2]; R],
    resonance_h: [[f64; L]; R],
    transition: [[[[f64; L]; 2]; 2]; R],
}

/// The Riccati recursion of several noises side by side: covariance of (previous sample noise, short, slow) before a window, then of
/// those with the two states of each resonance, and of these among themselves.
pub(super) struct Riccati<'a, const L: usize, const R: usize> {
    variance: [[f64; L]; 3],
    tau_s: [[f64; L]; 2],
    resonance: [[Resonance; L]; R],
    schedule: &'a Schedule,
    p: [[f64; L]; 6],
    with_resonance: [[[[f64; L]; 2]; 3]; R],
    of_resonance: [[[f64; L]; 3]; R],
    decay: [[f64; L]; 2],
    slow: [Halves; L],
    transition: [[[[f64; L]; 2]; 2]; R],
    step_before: f64,
}

/// How the slow part comes to a window, from its value in the latter half of the window before; both halves are one where a window sees
/// the slow part at its middle.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Halves {
    /// What the window sees of the latter half as foretold.
    seen: f64,
    /// Variance of what is new in the latter half, of what is new in what the window sees, and their covariance; of a variance of one.
    new: f64,
    new_seen: f64,
    of_both: f64,
}

impl Halves {
    /// Of an autoregression of this correlation time after a step.
    fn new(step_s: f64, tau_s: f64, seen: SlowSeen) -> Self {
        let between = seen.between_halves_s(step_s);
        let [to_former, to_latter] = [step_s - between, between].map(|s| (-s / tau_s).exp());
        let mean = 0.5 * (1.0 + to_latter);
        let [in_former, in_latter] = [to_former, to_latter].map(|kept| 1.0 - kept * kept);
        Self {
            seen: mean / to_latter,
            new: to_latter * to_latter * in_former + in_latter,
            new_seen: mean * mean * in_former + 0.25 * in_latter,
            of_both: to_latter * mean * in_former + 0.5 * in_latter,
        }
    }
}

impl<'a, const L: usize, const R: usize> Riccati<'a, L, R> {
    pub(super) fn new(noise: &[AxisNoise; L], schedule: &'a Schedule) -> Self {
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
            slow: [Halves::default(); L],
            transition: [[[none; 2]; 2]; R],
            step_before: f64::NAN,
        }
    }

    /// The row of window `i` at activities `s`, bursts and what it has for itself, and the variances of its innovations; windows in order.
    #[inline(always)]
    pub(super) fn row(&mut self, i: usize, s: [f64; L], burst: [f64; L], alone: [f64; L]) -> (Row<L, R>, [f64; L]) {
        let [own, previous] = self.schedule.overlap[i];
        let step = self.schedule.step_s[i];
        if step != self.step_before {
            self.decay = self.tau_s.map(|tau| tau.map(|tau| (-step / tau).exp()));
            self.slow = self.tau_s[1].map(|tau| Halves::new(step, tau, self.schedule.slow_seen));
            self.transition = self.resonance.map(|of| {
                let all = of.map(|r| r.transition(step));
                std::array::from_fn(|i| std::array::from_fn(|j| all.map(|transition| transition[i][j])))
            });
            self.step_before = step;
        }
        let mut row = Row {
            h: [[0.0; L]; 3],
            per_sd: [0.0; L],
            gain: [[0.0; L]; 3],
            decay: self.decay,
            resonance_gain: [[[0.0; L]; 2]; R],
            resonance_h: [[0.0; L]; R],
            transition: self.transition,
        };
        let mut variance = [0.0; L];
        for l in 0..L {
            // The samples that are new are as loud as this window; those before keep the level they had.
            let [vw, v1, v2] = [self.variance[0][l] * burst[l] * s[l] * s[l], self.variance[1][l], self.variance[2][l]];
            let [f1, f2] = [self.decay[0][l], self.decay[1][l]];
            let (p00, p01, p02) = (self.p[0][l], self.p[1][l] * f1, self.p[2][l] * f2);
            let p11 = f1 * f1 * (self.p[3][l] - v1) + v1;
            let p12 = self.p[4][l] * f1 * f2;
            let p22 = f2 * f2 * self.p[5][l];
            let slow = self.slow[l];
            let (h0, h1, h2) = (previous, s[l], slow.seen);
            let [mut c0, mut c1, mut c2] =
                [h0 * p00 + h1 * p01 + h2 * p02, h0 * p01 + h1 * p11 + h2 * p12, h0 * p02 + h1 * p12 + h2 * p22];
            let ce = own * vw;
            // Covariances of what is seen with each resonance.
            let mut cr = [[0.0; 2]; R];
            let mut seen = 0.0;
            for r in 0..R {
                self.step_resonance(r, l);
                let (with, of) = (&self.with_resonance[r], &self.of_resonance[r]);
                let hr = self.resonance[r][l].loudness(s[l]);
                cr[r] = std::array::from_fn(|j| {
                    h0 * with[0][j][l] + h1 * with[1][j][l] + h2 * with[2][j][l] + hr * of[j][l]
                });
                c0 += hr * with[0][0][l];
                c1 += hr * with[1][0][l];
                c2 += hr * with[2][0][l];
                seen += hr * cr[r][0];
                row.resonance_h[r][l] = hr;
            }
            let of_itself = self.variance[0][l] * s[l] * s[l] * alone[l];
            variance[l] = h0 * c0 + h1 * c1 + h2 * c2 + v2 * slow.new_seen + seen + own * ce + of_itself;
            c2 += v2 * slow.of_both;
            let inverse = 1.0 / variance[l];
            let gain = [ce * inverse, c1 * inverse, c2 * inverse];
            self.p[0][l] = vw - ce * gain[0];
            self.p[1][l] = -ce * gain[1];
            self.p[2][l] = -ce * gain[2];
            self.p[3][l] = p11 - c1 * gain[1];
            self.p[4][l] = p12 - c1 * gain[2];
            self.p[5][l] = p22 + v2 * slow.new - c2 * gain[2];
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
            (row.h[0][l], row.h[1][l], row.h[2][l], row.per_sd[l]) = (h0, h1, h2, inverse.sqrt());
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
pub(super) struct LogSum<const L: usize> {
    sum: [f64; L],
    product: [f64; L],
    count: usize,
}

impl<const L: usize> LogSum<L> {
    pub(super) fn new() -> Self {
        Self { sum: [0.0; L], product: [1.0; L], count: 0 }
    }

    pub(super) fn add(&mut self, x: [f64; L]) {
        self.product.iter_mut().zip(x).for_each(|(product, x)| *product *= x);
        self.count += 1;
        if self.count.is_multiple_of(8) {
            self.sum.iter_mut().zip(self.product).for_each(|(sum, product)| *sum += product.ln());
            self.product = [1.0; L];
        }
    }

    pub(super) fn total(self) -> [f64; L] {
        std::array::from_fn(|l| self.sum[l] + self.product[l].ln())
    }
}

/// What filters remember of their series.
#[derive(Clone, Copy)]
pub(super) struct Memory<const L: usize, const R: usize>([[f64; L]; 3], [[[f64; L]; 2]; R]);

impl<const L: usize, const R: usize> Memory<L, R> {
    pub(super) fn new() -> Self {
        Self([[0.0; L]; 3], [[[0.0; L]; 2]; R])
    }

    /// The whitened innovations of the next values, each filter with the row of its own.
    #[inline(always)]
    pub(super) fn whiten(&mut self, row: &Row<L, R>, x: [f64; L]) -> [f64; L] {
        self.whiten_by(row, x, |l| l)
    }

    /// The same with one filter for all of them.
    #[inline(always)]
    pub(super) fn whiten_alike(&mut self, row: &Row<1, R>, x: [f64; L]) -> [f64; L] {
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
            let mut innovation = x[l] - row.h[0][f] * z0[l] - row.h[1][f] * one - row.h[2][f] * two;
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

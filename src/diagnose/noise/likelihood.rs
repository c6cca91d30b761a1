//! How likely a noise makes a series, in which a constant and errors that all windows share are nuisance.

use multiversion::multiversion;
use nalgebra::{DMatrix, DVector};

use super::kalman::{LogSum, Memory, Riccati};
use super::{AxisNoise, Loudness, Schedule};

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
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx+avx2", "x86_64+avx+avx2"))]
fn products_with<const L: usize, const R: usize>(
    noise: &[AxisNoise; L],
    schedule: &Schedule,
    loudness: [&Loudness; L],
    series: [Series; L],
) -> [Products; L] {
    let n = schedule.len();
    let (activity, burst) = (loudness.map(|a| &a.activity[..n]), loudness.map(|a| &a.burst[..n]));
    let alone = loudness.map(|a| &a.alone[..n]);
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
        let (row, variance) = riccati.row(i, activity.map(|a| a[i]), burst.map(|b| b[i]), alone.map(|a| a[i]));
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
    use super::super::filter::tests::{NOISE, record};
    use super::super::{Resonance, SlowSeen, Stretch, Whitener};
    use super::*;

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
        [SlowSeen::AtMiddle, SlowSeen::Mean].into_iter().for_each(compare_with_covariance);
    }

    fn compare_with_covariance(slow_seen: SlowSeen) {
        let resonance = Resonance { rms_ng: 40.0, period_s: 330.0, tau_s: 410.0, follows_crew: false };
        let clock: Vec<f64> = (0..60).filter(|i| i % 17 > 2).map(|i| 25.0 * f64::from(i)).collect();
        let schedule = Schedule { slow_seen, ..Schedule::new(&clock) };
        let n = clock.len();
        let loudness = Loudness::even((0..n).map(|i| 0.6 + 0.01 * i as f64).collect());
        let data: Vec<f64> = (0..n).map(|i| 100.0 * (i as f64 * 1.3).sin() + 3.0 * i as f64).collect();
        let loud_awake = Resonance { follows_crew: true, ..resonance };
        let noises = [None, Some(resonance), Some(loud_awake)].map(|resonance| AxisNoise { resonance, ..NOISE });
        let whiteners = noises.map(|noise| Whitener::new(&noise, &schedule, &loudness));
        let series = [Series { data: &data, shared: &[] }; 3];
        let found = products(&noises, &schedule, [&loudness; 3], series);
        // Windows are sums of samples of their own and of those of the window before, which are as loud as that is.
        let new = |i: usize| (NOISE.white_ng * loudness.activity[i]).powi(2);
        let white = |i: usize, j: usize| match (schedule.overlap[i], schedule.overlap[j]) {
            ([own, previous], _) if i == j => own * own * new(i) + previous * previous * new(i.max(1) - 1),
            ([own, _], [_, previous]) if j == i + 1 => own * previous * new(i),
            _ => 0.0,
        };
        for ((noise, whitener), found) in noises.iter().zip(&whiteners).zip(&found) {
            let covariance = DMatrix::from_fn(n, n, |i, j| {
                let apart = (clock[i] - clock[j]).abs();
                let short = NOISE.short_ng.powi(2) * (-apart / NOISE.short_tau_s).exp();
                // Of the mean of two halves with that of two others.
                let kept = |apart_s: f64| (-apart_s.abs() / NOISE.slow_tau_s).exp();
                let between = schedule.slow_seen.between_halves_s(25.0);
                let of_halves = 0.25 * (2.0 * kept(apart) + kept(apart - between) + kept(apart + between));
                let slow = NOISE.slow_ng.powi(2) * of_halves;
                let oscillating = noise.resonance.map_or(0.0, |r| {
                    let damped = std::f64::consts::TAU / r.period_s;
                    let oscillation = (damped * apart).cos() + (damped * apart).sin() / (damped * r.tau_s);
                    r.rms_ng.powi(2) * (-apart / r.tau_s).exp() * oscillation
                });
                let activities = loudness.activity[i] * loudness.activity[j];
                let follows = noise.resonance.is_some_and(|r| r.follows_crew);
                white(i.min(j), i.max(j))
                    + activities * short
                    + if follows { activities } else { 1.0 } * oscillating
                    + slow
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

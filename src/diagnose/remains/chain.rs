//! A hidden Markov chain of two states, its levels and rates fitted by expectation and maximisation (Baum et al. 1970).

use crate::diagnose::noise::Binned;

/// Probability per bin to leave a state: it lasts two bins to a hundred.
const LEAVES: [f64; 2] = [0.01, 0.5];

/// A chain of two states that several series share.
#[derive(Debug, Clone)]
pub(super) struct Chain {
    /// Probability of being up, per bin.
    pub up: Vec<f64>,
    /// Levels down and up of each series, ng.
    pub levels: Vec<[f64; 2]>,
    /// Probability per bin to leave down, and to leave up.
    pub leaves: [f64; 2],
    /// Log likelihood, but for its constant, at the levels and at the rates before they were fitted a last time.
    pub log_likelihood: f64,
    /// Switches between bins that were seen.
    pub switches: usize,
}

impl Chain {
    /// Up where the smoothed series is above its mean.
    pub fn first_guess(series: &Binned, smooth: usize) -> Option<Vec<f64>> {
        let weight: Vec<f64> = series.variance_ng2.iter().map(|v| 1.0 / v).collect();
        let mean_of = |range: std::ops::Range<usize>| {
            let (sum, all) = range.fold((0.0, 0.0), |(s, w), i| (s + weight[i] * series.mean_ng[i], w + weight[i]));
            if all > 0.0 { sum / all } else { f64::NAN }
        };
        let n = weight.len();
        let middle = mean_of(0..n);
        let up: Vec<f64> = (0..n)
            .map(|i| match mean_of(i.saturating_sub(smooth)..(i + smooth + 1).min(n)) {
                x if x.is_nan() => 0.5,
                x => f64::from(x > middle),
            })
            .collect();
        middle.is_finite().then_some(up)
    }

    /// Levels and rates, by expectation and maximisation from a first guess of when it is up.
    pub fn fitted(series: &[&Binned], up: Vec<f64>, rounds: usize) -> Option<Self> {
        let mut chain = Self { up, levels: Vec::new(), leaves: [0.1; 2], log_likelihood: 0.0, switches: 0 };
        for _ in 0..rounds {
            chain.levels = series.iter().map(|s| levels(s, &chain.up)).collect::<Option<Vec<[f64; 2]>>>()?;
            chain.expect(series);
        }
        let seen = (0..chain.up.len()).filter(|i| series.iter().any(|s| s.variance_ng2[*i].is_finite()));
        let states: Vec<bool> = seen.map(|i| chain.up[i] > 0.5).collect();
        chain.switches = states.windows(2).filter(|w| w[0] != w[1]).count();
        chain.log_likelihood.is_finite().then_some(chain)
    }

    /// Where it is at these levels and rates, its likelihood, and the rates that this makes likeliest.
    fn expect(&mut self, series: &[&Binned]) {
        let rates = Rates::new(self.leaves);
        let seen = forward(series, &self.levels, &rates);
        let (mut stayed, mut left) = ([0.0; 2], [0.0; 2]);
        // Density of all that follows a bin, given the state in it; its scale is arbitrary.
        let mut follows = [1.0; 2];
        for (i, now) in seen.bins.iter().enumerate().rev() {
            let both = [now.state[0] * follows[0], now.state[1] * follows[1]];
            self.up[i] = both[1] / (both[0] + both[1]);
            let Some(before) = i.checked_sub(1).map(|i| &seen.bins[i]) else { break };
            let ahead = [now.density[0] * follows[0], now.density[1] * follows[1]];
            let moves: [[f64; 2]; 2] =
                std::array::from_fn(|a| std::array::from_fn(|b| before.state[a] * rates.to[a][b] * ahead[b]));
            let all: f64 = moves.iter().flatten().sum();
            for state in 0..2 {
                stayed[state] += moves[state][state] / all;
                left[state] += moves[state][1 - state] / all;
            }
            follows = std::array::from_fn(|a| rates.to[a][0] * ahead[0] + rates.to[a][1] * ahead[1]);
            let scale = follows[0] + follows[1];
            follows = follows.map(|x| x / scale);
        }
        self.leaves = std::array::from_fn(|state| {
            (left[state] / (left[state] + stayed[state]).max(f64::MIN_POSITIVE)).clamp(LEAVES[0], LEAVES[1])
        });
        self.log_likelihood = seen.log_likelihood;
    }
}

/// What a chain does from one bin to the next.
struct Rates {
    /// Probability of each state long after.
    at_rest: [f64; 2],
    /// Probability to go from a state to a state.
    to: [[f64; 2]; 2],
}

impl Rates {
    fn new([down, up]: [f64; 2]) -> Self {
        Self { at_rest: [up / (up + down), down / (up + down)], to: [[1.0 - down, down], [up, 1.0 - up]] }
    }
}

/// A bin seen from the bins before.
struct Seen {
    /// Probability of each state, this bin seen.
    state: [f64; 2],
    /// Density of this bin in each state; its scale is arbitrary.
    density: [f64; 2],
}

struct Forward {
    bins: Vec<Seen>,
    log_likelihood: f64,
}

/// From the first bin to the last.
fn forward(series: &[&Binned], levels: &[[f64; 2]], rates: &Rates) -> Forward {
    let log_density = |i: usize, state: usize| -> f64 {
        let means = series.iter().zip(levels).filter(|(s, _)| s.variance_ng2[i].is_finite());
        means.map(|(s, l)| -0.5 * (s.mean_ng[i] - l[state]).powi(2) / s.variance_ng2[i]).sum()
    };
    let log_variances = |s: &&Binned| s.variance_ng2.iter().filter(|v| v.is_finite()).map(|v| v.ln()).sum::<f64>();
    let n = series.first().map_or(0, |s| s.mean_ng.len());
    let mut seen =
        Forward { bins: Vec::with_capacity(n), log_likelihood: -0.5 * series.iter().map(log_variances).sum::<f64>() };
    let mut expected = rates.at_rest;
    for i in 0..n {
        let logs = [log_density(i, 0), log_density(i, 1)];
        let top = logs[0].max(logs[1]);
        let density = logs.map(|l| (l - top).exp());
        let joint = [expected[0] * density[0], expected[1] * density[1]];
        let sum = joint[0] + joint[1];
        seen.log_likelihood += top + sum.ln();
        let state = joint.map(|x| x / sum);
        expected = std::array::from_fn(|b| state[0] * rates.to[0][b] + state[1] * rates.to[1][b]);
        seen.bins.push(Seen { state, density });
    }
    seen
}

/// Levels down and up that make a series likeliest, `None` where it is only ever one of them.
fn levels(series: &Binned, up: &[f64]) -> Option<[f64; 2]> {
    let mut sums = [[0.0; 2]; 2];
    for ((mean, variance), up) in series.mean_ng.iter().zip(&series.variance_ng2).zip(up) {
        for (sum, share) in sums.iter_mut().zip([1.0 - up, *up]) {
            sum[0] += share * mean / variance;
            sum[1] += share / variance;
        }
    }
    sums.iter().all(|s| s[1] > 0.0).then(|| sums.map(|[x, w]| x / w))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The likelihood against the sum over all ways through a few bins.
    #[test]
    fn the_likelihood_is_that_of_all_ways_together() {
        let series = Binned {
            mean_ng: vec![1.0, 7.0, 0.0, 8.0, 9.5, 2.0],
            variance_ng2: vec![4.0, 9.0, f64::INFINITY, 4.0, 5.0, 3.0],
        };
        let (levels, rates) = ([[1.5, 8.0]], Rates::new([0.2, 0.3]));
        let found = forward(&[&series], &levels, &rates).log_likelihood;
        let way = |states: u32| {
            let state = |i: usize| ((states >> i) & 1) as usize;
            let moved: f64 = (1..6).map(|i| rates.to[state(i - 1)][state(i)]).product();
            let density = |i: usize| match series.variance_ng2[i] {
                v if v.is_finite() => (-0.5 * (series.mean_ng[i] - levels[0][state(i)]).powi(2) / v).exp() / v.sqrt(),
                _ => 1.0,
            };
            rates.at_rest[state(0)] * moved * (0..6).map(density).product::<f64>()
        };
        let all: f64 = (0..64).map(way).sum();
        assert!((found - all.ln()).abs() < 1e-12, "{found} {}", all.ln());
    }

    #[test]
    fn each_round_makes_it_likelier() {
        let mean_ng: Vec<f64> = (0..60).map(|i| if (i / 7) % 2 == 0 { 2.0 } else { 9.0 } + f64::from(i % 3)).collect();
        let series = Binned { variance_ng2: vec![4.0; mean_ng.len()], mean_ng };
        let of =
            |rounds| Chain::fitted(&[&series], Chain::first_guess(&series, 1).unwrap(), rounds).unwrap().log_likelihood;
        let rounds: Vec<f64> = (1..12).map(of).collect();
        // But for the first bin: where a chain begins follows from its rates and is no part of their fit.
        assert!(rounds.windows(2).all(|w| w[1] > w[0] - 1e-3) && rounds[10] > rounds[0] + 0.1, "{rounds:?}");
    }
}

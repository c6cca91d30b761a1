//! The order of the quick noise: one autoregression of the first order beside the white samples, or one of the second, a resonance,
//! beside both, where a criterion asks for it.

use super::fit::{BOUNDS, from_logarithms, is_outside, log_prior, logarithms};
use super::likelihood::{Series, products};
use super::{AxisNoise, Loudness, Resonance, Schedule};
use crate::diagnose::optimise::nelder_mead;
use crate::math::shared_work;

/// Periods of a resonance, s: what is quicker than two windows is white, and what is slower than this is an orbit's.
pub const PERIODS_S: [f64; 2] = [100.0, 2400.0];
/// Times in which its phase is forgotten, in periods. What keeps its phase for longer is a signal: it could be said when it pushes.
const FORGOTTEN: [f64; 2] = [0.25, 4.0];
/// Longest time in which it is forgotten, s.
pub const FORGOTTEN_S: f64 = FORGOTTEN[1] * PERIODS_S[1];
/// Where a fit of it begins: its share of the white noise, and times in periods.
const SHARE: f64 = 0.3;
const BEGINS: [f64; 3] = [0.5, 1.0, 2.5];
/// Evaluations of a fit of seven numbers.
const EVALUATIONS: usize = 300;
/// The numbers that a resonance has.
const NUMBERS: f64 = 3.0;

/// The noise of a residual with a resonance on each axis on which it pays, about the period at which the axis is louder than its noise; and
/// what they cost in log likelihood, by the Bayesian information criterion (Schwarz 1978). None where none pays.
pub fn with_resonances(
    noise: &[AxisNoise; 3],
    residual_ng: &[Vec<f64>; 3],
    schedule: &Schedule,
    loudness: &[Loudness; 3],
    about_s: [Option<f64>; 3],
) -> Option<([AxisNoise; 3], f64)> {
    let price = 0.5 * NUMBERS * (schedule.len() as f64).ln();
    let resonant = shared_work::map(&[0, 1, 2], |k| {
        let axis = Axis {
            series: Series { data: &residual_ng[*k], shared: &schedule.shared_ng[*k] },
            schedule,
            loudness: &loudness[*k],
        };
        let (resonant, gain) = axis.with_resonance(&noise[*k], about_s[*k]?);
        (gain > price).then_some(resonant)
    });
    let cost = resonant.iter().flatten().count() as f64 * price;
    (cost > 0.0).then(|| (std::array::from_fn(|k| resonant[k].unwrap_or(noise[k])), cost))
}

/// A residual of one axis.
struct Axis<'a> {
    series: Series<'a>,
    schedule: &'a Schedule,
    loudness: &'a Loudness,
}

impl Axis<'_> {
    /// A noise at its likeliest scale, and its log likelihood, the prior of its other numbers included.
    fn scaled(&self, noise: &AxisNoise) -> (AxisNoise, f64) {
        let [found] = products(&[*noise], self.schedule, [self.loudness], [self.series]);
        let scale2 = found.likeliest_scale2();
        let scale = scale2.sqrt();
        let scaled = AxisNoise {
            white_ng: scale * noise.white_ng,
            short_ng: scale * noise.short_ng,
            slow_ng: scale * noise.slow_ng,
            resonance: noise.resonance.map(|r| Resonance { rms_ng: scale * r.rms_ng, ..r }),
            ..*noise
        };
        (scaled, found.log_likelihood(scale2) + log_prior(&scaled))
    }

    /// The likeliest noise with a resonance about a period, and the log likelihood gained.
    fn with_resonance(&self, noise: &AxisNoise, about_s: f64) -> (AxisNoise, f64) {
        let of = |p: &[f64], follows_crew: bool| {
            let plain = from_logarithms(p, noise.white_ng);
            let [rms_ng, period_s] = [plain.white_ng * p[4].exp(), p[5].exp()];
            let resonance = Resonance { rms_ng, period_s, tau_s: period_s * p[6].exp(), follows_crew };
            AxisNoise { resonance: Some(resonance), ..plain }
        };
        let inside = |x: f64, [low, high]: [f64; 2]| (low..=high).contains(&x.exp());
        let value = |p: &[f64], follows_crew: bool| {
            let allowed =
                !is_outside(&p[..4]) && p[4] <= BOUNDS[0][1] && inside(p[5], PERIODS_S) && inside(p[6], FORGOTTEN);
            if allowed { -self.scaled(&of(p, follows_crew)).1 } else { f64::INFINITY }
        };
        let [a, b, c, d] = logarithms(noise);
        let begins = BEGINS.map(|periods| [a, b, c, d, SHARE.ln(), about_s.ln(), f64::ln(periods)]);
        let likeliest = |follows_crew: bool| {
            let value = |p: &[f64]| value(p, follows_crew);
            let begin = begins.iter().min_by(|p, q| value(&p[..]).total_cmp(&value(&q[..]))).unwrap_or(&begins[0]);
            let best = nelder_mead(begin, &[0.3, 0.3, 0.4, 0.4, 0.5, 0.15, 0.4], EVALUATIONS, value);
            self.scaled(&of(&best, follows_crew))
        };
        let [follows, steady] = [true, false].map(likeliest);
        let (resonant, likelihood) = if steady.1 > follows.1 { steady } else { follows };
        (resonant, likelihood - self.scaled(noise).1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::noise::simulate;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const PLAIN: AxisNoise = AxisNoise {
        white_ng: 80.0,
        short_ng: 15.0,
        short_tau_s: 100.0,
        slow_ng: 8.0,
        slow_tau_s: 4000.0,
        resonance: None,
    };

    /// A day and a half of noise on three axes with a quiet night, and what it is found to be when asked about a period.
    fn found(seed: u64, noise: &AxisNoise, about_s: f64) -> Option<([AxisNoise; 3], f64)> {
        let clock: Vec<f64> = (0..5200).filter(|i| i % 170 > 4).map(|i| 25.0 * f64::from(i)).collect();
        let schedule = Schedule::new(&clock);
        let loudness = std::array::from_fn(|_| {
            Loudness::even((0..clock.len()).map(|i| if (1500..3000).contains(&i) { 0.6 } else { 1.0 }).collect())
        });
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let residual: [Vec<f64>; 3] =
            std::array::from_fn(|k| simulate(noise, &schedule, &loudness[k], || StandardNormal.sample(&mut rng)));
        with_resonances(&[PLAIN; 3], &residual, &schedule, &loudness, [Some(about_s); 3])
    }

    #[test]
    fn a_resonance_is_found_as_it_is_and_nowhere_else() {
        for (seed, period_s, tau_s, follows_crew) in
            [(1, 300.0, 500.0, true), (2, 900.0, 900.0, false), (3, 1700.0, 4000.0, false), (4, 600.0, 900.0, true)]
        {
            let resonance = Some(Resonance { rms_ng: 35.0, period_s, tau_s, follows_crew });
            let (noise, price) = found(seed, &AxisNoise { resonance, ..PLAIN }, 0.85 * period_s).unwrap();
            assert!((price - 3.0 * 1.5 * 5045f64.ln()).abs() < 0.1, "{price}");
            for noise in noise {
                let r = noise.resonance.unwrap();
                // It is some tens to hundreds of times as wide as a line of the spectrum: bounds of three standard errors and more.
                assert!((r.period_s / period_s).ln().abs() < 0.1, "{period_s}: {r:?}");
                assert!((r.tau_s / tau_s).ln().abs() < 0.7, "{tau_s}: {r:?}");
                assert!((r.rms_ng / 35.0).ln().abs() < 0.3, "{r:?}");
                assert_eq!(r.follows_crew, follows_crew, "{r:?}");
                assert!((noise.white_ng / PLAIN.white_ng).ln().abs() < 0.1, "{noise:?}");
            }
            assert_eq!(found(seed, &PLAIN, period_s), None, "{period_s}");
        }
    }
}

//! Whether structure remains when the best hypothesis has been taken away, even of a form that no dictionary has.
//!
//! Six questions to the whitened residual, which is white and independent from axis to axis where the hypothesis is whole:
//! do the axes move together in some band of periods (a push along one direction of the body at whatever instants does that),
//! is there a line, of constant or of steadily drifting period, does something oscillate for a while, does something ring after
//! what recurs, or come the same time after it, or at even distances of its own? And one to the residual itself: does it switch between two levels, where slow noise would wander? Not here: what it
//! could be.
//!
//! Slow noise that is no autoregression is not white behind the filter of one: what is left is louder in some band than the noise
//! fitted. Lines, and findings, are measured by how loud it is where they are.

mod band;
mod chain;
mod epochs;
mod grid;
mod line;
mod parts;
mod passing;
mod ringing;
mod stack;
mod switching;
mod together;

pub use self::band::loud_about_s;
use self::grid::Grid;
use self::parts::Beside;
use super::answer::Interval;
use super::instants::Recurring;
use super::noise::{AxisNoise, Binned, Loudness, Schedule, Whitener};
use super::scene::Axes;
use super::search::Left;

/// Structure that remains.
#[derive(Debug, Clone, PartialEq)]
pub struct Remains {
    /// Probability that noise leaves as much, all questions counted.
    pub probability: f64,
    /// Its whitened energy, or twice its log evidence: about the square of its signal-to-noise ratio.
    pub energy: f64,
    /// In words: its form.
    pub form: String,
    /// In words: its axis or direction, body axes.
    pub axis: String,
    /// Axes with a share in it.
    pub axes: Vec<String>,
    /// In words: where it lives.
    pub location: String,
    /// When, where it is not always there, and what is there then.
    pub intervals: Vec<Interval>,
    /// Its period, where it has one: the middle one if it drifts.
    pub period_s: Option<f64>,
}

/// What remains of what a hypothesis leaves, at its noise. The least probable of all that was asked.
pub fn strongest(
    left: &Left,
    noise: &[AxisNoise; 3],
    schedule: &Schedule,
    loudness: &[Loudness; 3],
    recurring: &[Recurring],
) -> Option<Remains> {
    // Too few windows have no bands, too few bins no levels; too many are of another kind of record.
    let grid = Grid::new(&schedule.clock_s, &left.whitened)?;
    let scale_ng = noise.map(|n| n.rms_ng());
    let binned = std::array::from_fn(|k| Binned::new(&left.residual_ng[k], &noise[k], schedule, &loudness[k]));
    let [passing, ringing] = not_all_the_time(left, noise, schedule, loudness, recurring);
    let asked = [
        together::together(&grid, scale_ng),
        line::line(&grid, scale_ng),
        passing,
        ringing,
        epochs::delayed(&grid, scale_ng, schedule.clock_s[0], recurring),
        epochs::evenly(&grid, scale_ng, schedule.clock_s[0]),
        switching::switching(&binned, noise, schedule.clock_s[0]),
    ];
    let questions = asked.len() as f64;
    asked
        .into_iter()
        .flatten()
        .min_by(|a, b| a.probability.total_cmp(&b.probability))
        .map(|r| Remains { probability: (questions * r.probability).min(1.0), ..r })
}

/// What oscillates for a while, and what rings. A filter of noise that resonates takes what rings for the noise it expects, so that what is asked
/// is whitened as if it did not.
fn not_all_the_time(
    left: &Left,
    noise: &[AxisNoise; 3],
    schedule: &Schedule,
    loudness: &[Loudness; 3],
    recurring: &[Recurring],
) -> [Option<Remains>; 2] {
    let without = noise.map(|n| AxisNoise { resonance: None, ..n });
    let whitened = std::array::from_fn(|k| match noise[k].resonance {
        None => left.whitened[k].clone(),
        Some(_) => Whitener::new(&without[k], schedule, &loudness[k]).whiten(&left.residual_ng[k]),
    });
    let Some(grid) = Grid::new(&schedule.clock_s, &whitened) else { return [None, None] };
    let beside = Beside::Usual { memory_s: noise.map(|n| n.resonance.map_or(0.0, |r| r.tau_s)) };
    let (scale_ng, first_s) = (without.map(|n| n.rms_ng()), schedule.clock_s[0]);
    let parts = parts::of_all_decays(&grid);
    [
        passing::passing(&parts, scale_ng, beside, first_s),
        ringing::ringing(&parts, scale_ng, beside, first_s, recurring),
    ]
}

/// Probability of the loudest oscillation in what a hypothesis leaves, all the time or for a while, if that is white but for it: how well one
/// would explain what is left.
pub fn probability_of_an_oscillation(
    left: &Left,
    noise: &[AxisNoise; 3],
    schedule: &Schedule,
    recurring: &[Recurring],
) -> f64 {
    let Some(grid) = Grid::new(&schedule.clock_s, &left.whitened) else { return 1.0 };
    let scale_ng = noise.map(|n| n.rms_ng());
    let parts = parts::of_all_decays(&grid);
    let asked = [
        line::line_beside_white(&grid, scale_ng),
        passing::passing(&parts, scale_ng, Beside::White, schedule.clock_s[0]),
        ringing::ringing(&parts, scale_ng, Beside::White, schedule.clock_s[0], recurring),
    ];
    asked.into_iter().flatten().map(|found| found.probability).fold(1.0, f64::min)
}

/// How loud what a hypothesis leaves is, beside the noise fitted to it, at the periods at which a whitened signal lives.
pub fn loudness_under(left: &Left, schedule: &Schedule, signal: &Axes) -> f64 {
    Grid::new(&schedule.clock_s, &left.whitened).map_or(1.0, |grid| grid.loudness_under(&schedule.clock_s, signal))
}

/// The axis with the largest share in it.
fn mostly(amplitude: [f64; 3]) -> String {
    let named = ["x", "y", "z"].iter().zip(amplitude);
    format!("mostly {}", named.max_by(|a, b| a.1.total_cmp(&b.1)).map_or("", |(name, _)| *name))
}

/// Axes that carry at least a twentieth of the energy.
pub fn sharing(amplitude: [f64; 3]) -> Vec<String> {
    let total: f64 = amplitude.iter().map(|a| a * a).sum();
    let named = ["x", "y", "z"].iter().zip(amplitude);
    named.filter(|(_, a)| a * a > 0.05 * total).map(|(name, _)| (*name).to_string()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::noise::simulate;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn noise_alone_leaves_nothing() {
        let noise = AxisNoise {
            white_ng: 80.0,
            short_ng: 15.0,
            short_tau_s: 100.0,
            slow_ng: 12.0,
            slow_tau_s: 4000.0,
            resonance: None,
        };
        let clock_s: Vec<f64> = (0..5000).filter(|i| i % 170 > 4).map(|i| 25.0 * f64::from(i)).collect();
        let schedule = Schedule::new(&clock_s);
        let loudness: [Loudness; 3] = std::array::from_fn(|_| Loudness::even(vec![1.0; clock_s.len()]));
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(6);
        // A hundred records: a probability below a thousandth has one chance in ten among them.
        for _ in 0..100 {
            let residual_ng: Axes =
                std::array::from_fn(|k| simulate(&noise, &schedule, &loudness[k], || StandardNormal.sample(&mut rng)));
            let whitened =
                std::array::from_fn(|k| Whitener::new(&noise, &schedule, &loudness[k]).whiten(&residual_ng[k]));
            let now_and_then = [5_000.0, 31_000.0, 58_500.0, 90_000.0].to_vec();
            let recurring = [Recurring { what: "change".into(), at_s: now_and_then }];
            let found = strongest(&Left { residual_ng, whitened }, &[noise; 3], &schedule, &loudness, &recurring);
            assert!(found.is_none_or(|r| r.probability > 1e-3));
        }
    }
}

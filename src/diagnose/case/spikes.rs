//! Windows that stand alone, far out of what is before and after them: a value of another kind, and a single one would hide an axis.

use super::{Recording, take};
use crate::math::robust::{MAD_TO_SIGMA, median};

/// Standard deviations of the step from one window to the next beyond which a window that stands alone is a spike.
pub const SPIKE: f64 = 30.0;
/// Windows on either side that a window is compared with, after the one that shares samples with it.
const SIDE: usize = 3;

/// The recording without windows that are a spike on any axis.
pub fn without(recording: &Recording) -> Recording {
    let spikes = recording.a_ng.each_ref().map(|series| spikes(series));
    let keep: Vec<usize> = (0..recording.clock_s.len()).filter(|i| spikes.iter().all(|axis| !axis[*i])).collect();
    take(recording, &keep)
}

fn spikes(series: &[f64]) -> Vec<bool> {
    let mut steps: Vec<f64> = series.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    // Counts so coarse that most windows have the same are no measure of the noise.
    let Some(step) = median(&mut steps).filter(|step| *step > 0.0) else { return vec![false; series.len()] };
    let most = SPIKE * MAD_TO_SIGMA * step;
    (0..series.len()).map(|i| away_from_both_sides(series, i) > most).collect()
}

/// How far a value is from the middle of those before it and of those after it, whichever is nearer; nothing where it lies between.
fn away_from_both_sides(series: &[f64], i: usize) -> f64 {
    let middle = |from: usize, to: usize| median(&mut series[from.min(to)..to].to_vec());
    let (n, x) = (series.len(), series[i]);
    let before = middle(i.saturating_sub(1 + SIDE), i.saturating_sub(1));
    let after = middle((i + 2).min(n), (i + 2 + SIDE).min(n));
    match (before.or(after), after.or(before)) {
        (Some(before), Some(after)) if (x - before) * (x - after) > 0.0 => (x - before).abs().min((x - after).abs()),
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spike_is_one_and_a_step_is_none() {
        let wave: Vec<f64> = (0..400).map(|i| (f64::from(i) * 1.7).sin() + (f64::from(i) * 0.61).cos()).collect();
        let found = |series: &[f64]| (0..series.len()).filter(|i| spikes(series)[*i]).collect::<Vec<usize>>();
        let mut spiky = wave.clone();
        (spiky[200], spiky[300], spiky[301], spiky[399]) = (-1e6, 500.0, 900.0, 1e4);
        assert_eq!(found(&spiky), [200, 300, 301, 399]);
        let step: Vec<f64> = wave.iter().enumerate().map(|(i, x)| if i < 200 { *x } else { x + 1e6 }).collect();
        assert!(found(&wave).is_empty() && found(&step).is_empty());
        assert!(found(&[7.0; 300]).is_empty() && found(&[]).is_empty());
    }
}

//! Windows that repeat the one before: a mean of five hundred samples of a living sensor does not, to the last digit. A channel that
//! hangs does, and so does a value that stands for none.

use super::{Recording, take};

/// Windows in a row with the same value from which on an axis hangs, and the same of all three together: of independent windows three in
/// ten of which repeat the one before, the most that is not coarse, a run begins with a chance of 0.3^39 and 0.3^33.
const HANGS: usize = 40;
const ALL_HANG: usize = 12;
/// An axis that repeats itself more often than this beside its long runs is in coarse steps, and hangs by no run.
const COARSE: f64 = 0.3;

/// The recording without windows in which an axis hangs.
pub fn without(recording: &Recording) -> Recording {
    let n = recording.clock_s.len();
    let repeats: Vec<Vec<bool>> = recording.a_ng.iter().map(|series| repeats(series)).collect();
    let all: Vec<bool> = (0..n).map(|i| repeats.iter().all(|axis| axis[i])).collect();
    let mut hangs = runs(&all, ALL_HANG);
    for axis in &repeats {
        hangs.iter_mut().zip(runs(axis, HANGS)).for_each(|(hangs, run)| *hangs |= run);
    }
    take(recording, &(0..n).filter(|i| !hangs[*i]).collect::<Vec<usize>>())
}

/// Whether each value is that before; of a coarse axis, none.
fn repeats(series: &[f64]) -> Vec<bool> {
    let repeats: Vec<bool> = (0..series.len()).map(|i| i > 0 && series[i] == series[i - 1]).collect();
    // What hangs for long repeats itself there alone: outside runs a fine axis hardly ever does.
    let hanging = runs(&repeats, ALL_HANG);
    let by_chance = repeats.iter().zip(&hanging).filter(|(repeats, hanging)| **repeats && !**hanging).count();
    let outside = hanging.iter().filter(|hanging| !**hanging).count();
    if by_chance as f64 > COARSE * outside as f64 { vec![false; series.len()] } else { repeats }
}

/// Places in runs of so many or more, with the first of each, of which the rest are repetitions.
fn runs(repeats: &[bool], least: usize) -> Vec<bool> {
    let mut inside = vec![false; repeats.len()];
    let mut first = 0;
    for i in 1..=repeats.len() {
        if i < repeats.len() && repeats[i] {
            continue;
        }
        if i - first >= least {
            inside[first..i].fill(true);
        }
        first = i;
    }
    inside
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recording(of: impl Fn(usize, usize) -> f64) -> Recording {
        let clock_s: Vec<f64> = (0..400).map(|i| 25.0 * i as f64).collect();
        let axis = |k: usize| (0..400).map(|i| of(k, i)).collect::<Vec<f64>>();
        Recording {
            a_ng: std::array::from_fn(axis),
            dev_ng: std::array::from_fn(|_| vec![1.0; 400]),
            bias_errors_ng: [const { Vec::new() }; 3],
            scale_errors: [const { Vec::new() }; 3],
            bias_laws: [const { Vec::new() }; 3],
            faults: Vec::new(),
            not_come: None,
            clock_s,
        }
    }

    fn wave(k: usize, i: usize) -> f64 {
        ((i + 100 * k) as f64 * 1.7).sin()
    }

    #[test]
    fn windows_of_an_axis_that_hangs_are_left_out_and_no_others() {
        let left = |of: &dyn Fn(usize, usize) -> f64| 400 - without(&recording(of)).clock_s.len();
        assert_eq!(left(&wave), 0);
        // All three for twenty windows; one for fifty, for thirty.
        assert_eq!(left(&|k, i| if (100..120).contains(&i) { -99_999.0 } else { wave(k, i) }), 20);
        assert_eq!(left(&|k, i| if k == 1 && (100..150).contains(&i) { 7.0 } else { wave(k, i) }), 50);
        assert_eq!(left(&|k, i| if k == 1 && (100..130).contains(&i) { 7.0 } else { wave(k, i) }), 0);
        // Counts so coarse that most windows have the same.
        assert_eq!(left(&|k, i| (0.6 * wave(k, i / 3)).round()), 0);
    }
}

//! Cells of a table that are no measurement: numbers that stand for one that is missing, and lone spikes. Not here: rows that the rest of
//! their block contradicts (see `read`).

use crate::diagnose::measured::spread::{median, scatter};

/// Cells to either side that tell what one should be about.
const REACH: usize = 8;
/// Scatters of these beyond which a cell is a spike, and steps of its column where most cells are the same.
const SPIKE_SCATTERS: f64 = 12.0;
const SPIKE_STEPS: f64 = 100.0;
/// Spikes in a row up to which they are any: what lasts longer may be an event.
const SPIKES_IN_A_ROW: usize = 2;
/// Ranges of all other cells by which a stand-in is away from them.
const AWAY: f64 = 3.0;
/// Different stand-ins in a column at most.
const STAND_INS: usize = 3;
/// No measurement is as large.
const LARGEST: f64 = 1e15;

/// Takes the cells that are no measurement out of a column, in order of time; a cell without a number has none (`NaN`). Which they were.
pub fn taken_out(column: &mut [f64]) -> Vec<usize> {
    let mut out = stand_ins(column);
    let spikes = spikes(column);
    spikes.iter().for_each(|i| column[*i] = f64::NAN);
    out.extend(spikes);
    out
}

/// Whether makers of files write such a number where they have none: nothing but nines, the ends of an integer of two octets, or more than
/// there is.
fn stands_for_none(value: f64) -> bool {
    let size = value.abs();
    let digits = format!("{size}").replace('.', "");
    let digits = digits.trim_end_matches('0');
    size >= LARGEST
        || matches!(size, 32_767.0 | 32_768.0 | 65_535.0)
        || (digits.len() >= 3 && digits.bytes().all(|c| c == b'9'))
}

/// Takes out the cells that have such a number, where it is far from all others. Which they were.
fn stand_ins(column: &mut [f64]) -> Vec<usize> {
    let mut out = Vec::new();
    for _ in 0..STAND_INS {
        let ends = ends(column.iter().copied());
        let is_one = |end: &f64| {
            let [low, high] = self::ends(column.iter().copied().filter(|x| x != end));
            stands_for_none(*end) && high >= low && (end - low).abs().min((end - high).abs()) > AWAY * (high - low)
        };
        let Some(end) = ends.into_iter().find(is_one) else { break };
        for (i, x) in column.iter_mut().enumerate().filter(|(_, x)| **x == end) {
            *x = f64::NAN;
            out.push(i);
        }
    }
    out
}

/// The lowest and the highest of the numbers among values.
fn ends(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let numbers = values.filter(|x| x.is_finite());
    numbers.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}

/// Cells that are far from those about them, one or two in a row (Hampel 1974).
fn spikes(column: &[f64]) -> Vec<usize> {
    let read: Vec<usize> = (0..column.len()).filter(|i| column[*i].is_finite()).collect();
    let values: Vec<f64> = read.iter().map(|i| column[*i]).collect();
    let steps: Vec<f64> = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let usual = median(steps.iter().copied());
    let least = steps.iter().copied().filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min);
    let is_far = |i: usize| {
        let about = &values[i.saturating_sub(REACH)..(i + REACH + 1).min(values.len())];
        let away = (values[i] - median(about.iter().copied())).abs();
        let width = scatter(about).max(usual);
        away > if width > 0.0 { SPIKE_SCATTERS * width.max(least) } else { SPIKE_STEPS * least }
    };
    let far: Vec<usize> = (0..values.len()).filter(|i| is_far(*i)).collect();
    far.chunk_by(|a, b| b - a == 1).filter(|run| run.len() <= SPIKES_IN_A_ROW).flatten().map(|i| read[*i]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Something that scatters without chance.
    fn noise(i: usize) -> f64 {
        (7.3 * i as f64).sin() + (3.1 * i as f64).cos()
    }

    #[test]
    fn stand_ins_and_spikes_are_taken_out_and_events_are_not() {
        let mut column: Vec<f64> = (0..400).map(|i| 0.1 * noise(i) + 20.0 * (i as f64 / 60.0).sin()).collect();
        (50..70).for_each(|i| column[i] = -9999.0);
        (200..203).for_each(|i| column[i] = 9.96921e36);
        column[120] += 40.0;
        [300, 301].into_iter().for_each(|i| column[i] -= 15.0);
        // A push that lasts, and a step.
        (150..160).for_each(|i| column[i] += 30.0);
        (350..400).for_each(|i| column[i] += 30.0);
        let mut out = taken_out(&mut column);
        out.sort_unstable();
        assert_eq!(out, (50..70).chain([120]).chain(200..203).chain([300, 301]).collect::<Vec<usize>>());
        assert_eq!(column.iter().filter(|x| x.is_nan()).count(), out.len());
    }

    /// Flags, powers that are on or off, counts so coarse that most are the same, and a number of nines that is one of many.
    #[test]
    fn what_a_column_has_of_its_own_stays() {
        let flag: Vec<f64> = (0..300).map(|i| f64::from(u8::from(i % 40 == 7))).collect();
        let power: Vec<f64> = (0..300).map(|i| if i % 50 < 30 { 100.0 + 0.1 * noise(i) } else { 0.0 }).collect();
        let coarse: Vec<f64> = (0..300).map(|i| (3.0 * (i as f64 / 40.0).sin()).round()).collect();
        let counts: Vec<f64> = (0..300).map(|i| 999.0 + (20.0 * noise(i)).round()).collect();
        for column in [flag, power, coarse, counts] {
            assert!(taken_out(&mut column.clone()).is_empty(), "{column:?}");
        }
        // What a thermometer says when it is switched on.
        let mut temperature: Vec<f64> = (0..300).map(|i| 0.1 * f64::from(i / 60) + 21.5).collect();
        temperature[200] = 85.0;
        assert_eq!(taken_out(&mut temperature), [200]);
    }
}

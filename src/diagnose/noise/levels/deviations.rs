//! Levels of stretches that the deviations inside the windows set apart, whatever the crew does.

use super::changes::changes;
use super::{Contradicted, Shown, bends, median};
use crate::diagnose::noise::{Loudness, Schedule};
use crate::math::robust;

/// Standard deviation of the logarithm of how loud a stretch is about what its deviations say.
const OF_DEVIATIONS: f64 = 0.15;

/// Logarithms of the deviations of an axis; a window that has none has that of the last before it that has one, and where most have none
/// there are none.
fn logarithms(dev_ng: &[f64]) -> Option<Vec<f64>> {
    let known = || dev_ng.iter().filter(|dev| **dev > 0.0);
    if 2 * known().count() <= dev_ng.len() {
        return None;
    }
    let mut last = *known().next()?;
    let or_last = |dev: &f64| {
        last = if *dev > 0.0 { *dev } else { last };
        last.ln()
    };
    Some(dev_ng.iter().map(or_last).collect())
}

/// Stretches that are louder or quieter by their deviations than the crew's sleep says, the same for all axes.
pub(super) struct Stretches {
    /// First window of each.
    begins: Vec<usize>,
    /// Logarithms of the deviations of every axis.
    logarithms: [Vec<f64>; 3],
}

/// Where the deviations set stretches apart; `None` where there are no deviations, or no more than one stretch.
pub(super) fn stretches(dev_ng: [&[f64]; 3], sleeps: &[bool]) -> Option<Stretches> {
    let [x, y, z] = dev_ng.map(logarithms);
    let logarithms = [x?, y?, z?];
    let all: Vec<f64> = (0..sleeps.len()).map(|i| logarithms.iter().map(|axis| axis[i]).sum::<f64>() / 3.0).collect();
    let middles = [false, true].map(|state| {
        let of_state = all.iter().zip(sleeps).filter(|(_, sleeps)| **sleeps == state).map(|(x, _)| *x);
        robust::median(&mut of_state.collect::<Vec<f64>>()).unwrap_or(0.0)
    });
    let beyond: Vec<f64> = all.iter().zip(sleeps).map(|(x, sleeps)| x - middles[usize::from(*sleeps)]).collect();
    let begins = changes(&beyond);
    (begins.len() > 1).then_some(Stretches { begins, logarithms })
}

/// Levels of such stretches beside what is said: what their deviations say, moved towards what their windows show by the errors of
/// both. Windows at an edge are as loud as the louder side.
pub(super) fn by_deviations(
    Stretches { begins, logarithms }: &Stretches,
    axis: usize,
    residual_ng: &[f64],
    schedule: &Schedule,
    said: &Loudness,
) -> Shown {
    let n = schedule.len();
    let stretch = |i: usize| begins.partition_point(|begin| *begin <= i) - 1;
    let mut bends_of: Vec<Vec<f64>> = vec![Vec::new(); begins.len()];
    bends(residual_ng, schedule, said).into_iter().for_each(|(i, bend)| bends_of[stretch(i)].push(bend));
    let shown: Vec<Option<(f64, f64)>> =
        bends_of.into_iter().map(|bends| median(bends.into_iter()).map(|(size, error)| (size.ln(), error))).collect();
    let ends = begins[1..].iter().copied().chain([n]);
    let mean = |(begin, end): (&usize, usize)| {
        (*begin..end).map(|i| logarithms[axis][i] - said.activity[i].ln()).sum::<f64>() / (end - begin) as f64
    };
    let of_dev: Vec<f64> = begins.iter().zip(ends).map(mean).collect();
    // How much more a bend is than a deviation: the mean over the stretches, each by its error.
    let (mut sum, mut weights) = (0.0, 0.0);
    for (dev, (size, error)) in of_dev.iter().zip(&shown).filter_map(|(dev, shown)| Some((dev, shown.as_ref()?))) {
        let weight = (error * error + OF_DEVIATIONS * OF_DEVIATIONS).recip();
        sum += weight * (size - dev);
        weights += weight;
    }
    let more = if weights > 0.0 { sum / weights } else { 0.0 };
    let both = |(dev, shown): (&f64, &Option<(f64, f64)>)| match shown {
        Some((size, error)) => {
            let [of_dev, of_windows] = [OF_DEVIATIONS, *error].map(|error| (error * error).recip());
            ((dev + more) * of_dev + size * of_windows) / (of_dev + of_windows)
        }
        None => dev + more,
    };
    let levels: Vec<f64> = of_dev.iter().zip(&shown).map(both).collect();
    let near = |i: usize| [i.saturating_sub(1), i, (i + 1).min(n - 1)].map(|i| levels[stretch(i)]);
    let louder = |i: usize| near(i).into_iter().fold(f64::NEG_INFINITY, f64::max).exp();
    let raw: Vec<f64> = (0..n).map(|i| said.activity[i] * louder(i)).collect();
    let mut sorted = levels.clone();
    sorted.sort_by(f64::total_cmp);
    let [quietest, loudest] = [0, sorted.len() - 1].map(|i| (sorted[i] - sorted[sorted.len() / 2]).exp());
    // Where the stretches are the windows did not choose, and of how loud they are they chose a part.
    (Loudness::of_levels(&raw), Contradicted::Deviations { quietest, loudest }, begins.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// Two hours three times as loud, and some windows without a deviation.
    #[test]
    fn windows_without_a_deviation_hide_no_stretch() {
        let dev_ng = |missing: usize| -> Vec<f64> {
            let loud = |i: usize| if (2000..2288).contains(&i) { 300.0 } else { 100.0 };
            let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
            let mut scatter = || -> f64 { StandardNormal.sample(&mut rng) };
            let of = |i: usize| if i % 100 < missing { 0.0 } else { loud(i) * (0.3 * scatter()).exp() };
            (0..4000).map(of).collect()
        };
        let begins = |missing: usize| {
            let dev_ng = dev_ng(missing);
            stretches([&dev_ng; 3], &[false; 4000]).map(|found| found.begins)
        };
        for missing in [0, 3] {
            let begins = begins(missing).unwrap();
            assert!(begins.len() == 3 && begins[1].abs_diff(2000) < 6 && begins[2].abs_diff(2288) < 6, "{begins:?}");
        }
        assert!(begins(60).is_none());
    }
}

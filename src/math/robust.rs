//! Hogg's adaptive trimmed mean on ranked counts, in exact integer sums until the last division.

use super::ranked::{Border, Pair, Ranked};

/// The law from the tail statistic Q to the trim fraction per end.
///
/// Hogg's Q = (U(0.2) - L(0.2)) / (U(0.5) - L(0.5)), U(f) and L(f) the means of the largest and smallest fraction f. The trim is
/// constant up to the lower knee, grows linearly to the upper one, and is constant beyond. The name is in Rice 1996, the
/// knees are convention and therefore configuration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrimLaw {
    /// Trim per end at and below the lower knee.
    pub fraction_min: f64,
    /// Trim per end above the upper knee.
    pub fraction_max: f64,
    /// Lower knee of Q.
    pub q_lower: f64,
    /// Upper knee of Q.
    pub q_upper: f64,
}

impl Default for TrimLaw {
    fn default() -> Self {
        Self { fraction_min: 0.05, fraction_max: 0.40, q_lower: 1.75, q_upper: 2.0 }
    }
}

impl TrimLaw {
    /// Trim fraction per end; without Q (all points equal) the smallest.
    pub fn fraction(&self, q: Option<f64>) -> f64 {
        match q {
            Some(q) if q > self.q_upper => self.fraction_max,
            Some(q) if q > self.q_lower => {
                let slope = (self.fraction_max - self.fraction_min) / (self.q_upper - self.q_lower);
                self.fraction_min + slope * (q - self.q_lower)
            }
            _ => self.fraction_min,
        }
    }
}

/// Standard deviation of a normal distribution over its median absolute deviation.
pub const MAD_TO_SIGMA: f64 = 1.4826;

/// Points that a fraction of `points` stands for: floor of the product + 1e-9, so that an exact product is not lost.
pub fn points_of_fraction(fraction: f64, points: usize) -> usize {
    (fraction * points as f64 + 1e-9).floor() as usize
}

/// One axis of one window, in counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrimmedMean {
    /// Points given.
    pub points: usize,
    /// Tail statistic; None when all points are equal.
    pub q: Option<f64>,
    /// Trim fraction per end (the law's value, not the fraction of points actually dropped).
    pub trim: f64,
    /// Points kept.
    pub kept: usize,
    /// Mean of the points kept.
    pub mean: f64,
    /// Average absolute deviation of the points kept from `mean`.
    pub deviation: f64,
    /// Mean of all points.
    pub plain_mean: f64,
    /// Standard deviation of all points with the trimmed ones moved to the nearest kept one (Winsorised).
    pub winsorised_sd: f64,
}

impl TrimmedMean {
    /// Standard error of `mean` if the points were independent (Tukey and McLaughlin 1963): s_w / ((1 - 2 k/N) sqrt N).
    pub fn independent_standard_error(&self) -> f64 {
        let kept_fraction = self.kept as f64 / self.points as f64;
        self.winsorised_sd / (kept_fraction * (self.points as f64).sqrt())
    }
}

impl TrimmedMean {
    /// As [`Self::independent_standard_error`], of counts spread by [`spread_counts`] and without the scatter that rounding and
    /// spreading make: a filter that correlates the samples does not correlate that.
    pub fn independent_standard_error_of_spread(&self) -> f64 {
        let share = (1.0 - SPREAD_VARIANCE / self.winsorised_sd.powi(2)).max(0.0).sqrt();
        share * self.independent_standard_error()
    }
}

/// Variance that rounding to whole counts and spreading them again add, 1/12 each (Sheppard).
const SPREAD_VARIANCE: f64 = 1.0 / 6.0;

/// Q of counts; None when the inner half-means are equal.
pub fn tail_statistic(counts: Pair<'_>) -> Option<f64> {
    let all = counts.len();
    let total = counts.sums(counts.border(all)).counts;
    let spread = |fraction: f64| {
        let points = points_of_fraction(fraction, all).max(1);
        let smallest = counts.sums(counts.border(points)).counts;
        let largest = total - counts.sums(counts.border(all - points)).counts;
        (largest - smallest) as f64 / points as f64
    };
    let inner = spread(0.5);
    (inner > 0.0).then(|| spread(0.2) / inner)
}

/// The adaptive trimmed mean of two runs of counts taken together; None of none.
pub fn trimmed_mean(counts: Pair<'_>, law: &TrimLaw) -> Option<TrimmedMean> {
    if counts.is_empty() {
        return None;
    }
    let points = counts.len();
    let q = tail_statistic(counts);
    let trim = law.fraction(q);
    let dropped = points_of_fraction(trim, points).min((points - 1) / 2);
    let (from, to) = (counts.border(dropped), counts.border(points - dropped));
    let (mean, deviation) = mean_and_deviation(counts, from, to);
    Some(TrimmedMean {
        points,
        q,
        trim,
        kept: points - 2 * dropped,
        mean,
        deviation,
        plain_mean: counts.sums(counts.border(points)).counts as f64 / points as f64,
        winsorised_sd: winsorised_sd(counts, from, to, dropped),
    })
}

/// Spreads counts in ascending order evenly over the width of their count: what a quantiser with this reading may have seen.
///
/// Trimming whole counts shifts the mean of a window that holds only a few different ones; trimming values spread like this
/// shifts it by a third of that at scatters of half a count to one and a half. Where the scatter is many counts both agree.
pub fn spread_counts(sorted: &[i16]) -> Vec<f64> {
    let mut values = Vec::with_capacity(sorted.len());
    for equal in sorted.chunk_by(|a, b| a == b) {
        let width = equal.len() as f64;
        values.extend((0..equal.len()).map(|n| f64::from(equal[0]) - 0.5 + (n as f64 + 0.5) / width));
    }
    values
}

/// The adaptive trimmed mean of values in ascending order, by the same law; None of none.
pub fn trimmed_mean_of_values(sorted: &[f64], law: &TrimLaw) -> Option<TrimmedMean> {
    let points = sorted.len();
    if points == 0 {
        return None;
    }
    let mean_of = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let spread = |fraction: f64| {
        let ends = points_of_fraction(fraction, points).max(1);
        mean_of(&sorted[points - ends..]) - mean_of(&sorted[..ends])
    };
    let inner = spread(0.5);
    let q = (inner > 0.0).then(|| spread(0.2) / inner);
    let trim = law.fraction(q);
    let dropped = points_of_fraction(trim, points).min((points - 1) / 2);
    let kept = &sorted[dropped..points - dropped];
    let mean = mean_of(kept);
    let (low, high) = (kept[0], kept[kept.len() - 1]);
    let winsorised = || sorted.iter().map(|value| value.clamp(low, high));
    let centre = winsorised().sum::<f64>() / points as f64;
    let scatter = winsorised().map(|value| (value - centre).powi(2)).sum::<f64>() / (points as f64 - 1.0).max(1.0);
    Some(TrimmedMean {
        points,
        q,
        trim,
        kept: kept.len(),
        mean,
        deviation: kept.iter().map(|value| (value - mean).abs()).sum::<f64>() / kept.len() as f64,
        plain_mean: mean_of(sorted),
        winsorised_sd: scatter.sqrt(),
    })
}

/// Error that rounding to whole counts leaves in the mean of values spread by [`spread_counts`]: with a scatter of s counts the
/// reading's ripple, sqrt(1/12) exp(-2 pi^2 s^2); a twelfth is the variance of one count without scatter.
pub fn rounding_error_spread(winsorised_sd: f64) -> f64 {
    let scatter = (winsorised_sd.powi(2) - SPREAD_VARIANCE).max(0.0);
    (1.0f64 / 12.0).sqrt() * (-2.0 * std::f64::consts::PI.powi(2) * scatter).exp()
}

/// Error that rounding to whole counts adds to a trimmed mean of whole counts: it falls with the scatter as exp(-2.1 s), by
/// simulation of filtered normal noise of 0.3 to 2 counts with every offset.
pub fn rounding_error_trimmed(winsorised_sd: f64) -> f64 {
    (1.0f64 / 12.0).sqrt() * (-2.1 * winsorised_sd).exp()
}

/// The adaptive trimmed mean of counts in any order; None of none.
pub fn trimmed_mean_of(counts: Vec<i16>, law: &TrimLaw) -> Option<TrimmedMean> {
    trimmed_mean(Pair([&Ranked::of(counts), &Ranked::default()]), law)
}

/// The estimator that flew: it drops one point more at the high end of counts. Mean, average deviation and points kept.
pub fn flight_trimmed_mean(counts: Pair<'_>, law: &TrimLaw) -> Option<(f64, f64, usize)> {
    let dropped = points_of_fraction(law.fraction(tail_statistic(counts)), counts.len());
    let end = counts.len().checked_sub(dropped + 1).filter(|end| *end > dropped)?;
    let (mean, deviation) = mean_and_deviation(counts, counts.border(dropped), counts.border(end));
    Some((mean, deviation, end - dropped))
}

/// Mean and average absolute deviation from it, of the counts between two borders.
fn mean_and_deviation(counts: Pair<'_>, from: Border, to: Border) -> (f64, f64) {
    let before = counts.sums(from).counts;
    let total = counts.sums(to).counts - before;
    let points = (to.points() - from.points()) as f64;
    let mean = total as f64 / points;
    let middle = counts.border_at(mean, from, to);
    let total_below = counts.sums(middle).counts - before;
    let points_below = (middle.points() - from.points()) as f64;
    let points_above = points - points_below;
    let absolute = mean * points_below - total_below as f64 + (total - total_below) as f64 - mean * points_above;
    (mean, absolute / points)
}

/// Standard deviation with the `dropped` points beyond either border moved to the nearest kept one.
fn winsorised_sd(counts: Pair<'_>, from: Border, to: Border, dropped: usize) -> f64 {
    let points = (to.points() - from.points() + 2 * dropped) as i64;
    let Some(ends) = counts.ends(from, to).filter(|_| points > 1) else { return 0.0 };
    let of_ends = |power: u32| dropped as i64 * (i64::from(ends[0]).pow(power) + i64::from(ends[1]).pow(power));
    let kept = counts.sums(to) - counts.sums(from);
    let (total, squares) = (kept.counts + of_ends(1), kept.squares + of_ends(2));
    let scatter = i128::from(points) * i128::from(squares) - i128::from(total) * i128::from(total);
    (scatter as f64 / (points as f64 * (points - 1) as f64)).sqrt()
}

/// Median of a slice, which is reordered; None of none. For an even number the mean of the two inner points.
pub fn median(values: &mut [f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let (half, odd) = (values.len() / 2, values.len() % 2 == 1);
    let (below, upper, _) = values.select_nth_unstable_by(half, f64::total_cmp);
    let lower = if odd { None } else { below.iter().copied().max_by(f64::total_cmp) };
    Some(lower.map_or(*upper, |lower| 0.5 * (lower + *upper)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use statrs::distribution::{ContinuousCDF, Normal};

    proptest! {
        #[test]
        fn the_median_is_the_middle_of_what_is_sorted(values in proptest::collection::vec(-1e3..1e3, 1..60)) {
            let mut sorted = values.clone();
            sorted.sort_by(f64::total_cmp);
            let half = sorted.len() / 2;
            let middle = if sorted.len() % 2 == 1 { sorted[half] } else { 0.5 * (sorted[half - 1] + sorted[half]) };
            prop_assert_eq!(median(&mut values.clone()), Some(middle));
        }
    }

    fn q_of(counts: Vec<i16>) -> Option<f64> {
        tail_statistic(Pair([&Ranked::of(counts), &Ranked::default()]))
    }

    fn naive(sorted: &[i16], law: &TrimLaw) -> (f64, f64) {
        let n = sorted.len();
        let k = (law.fraction(q_of(sorted.to_vec())) * n as f64 + 1e-9).floor() as usize;
        let kept: Vec<f64> = sorted[k..n - k].iter().map(|c| f64::from(*c)).collect();
        let mean = kept.iter().sum::<f64>() / kept.len() as f64;
        (mean, kept.iter().map(|x| (x - mean).abs()).sum::<f64>() / kept.len() as f64)
    }

    #[test]
    fn a_normal_sample_has_q_1_754_and_a_laplace_sample_1_916() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut q_drawn = |draw: &dyn Fn(f64, f64) -> f64| {
            q_of((0..400_000).map(|_| draw(rng.random(), rng.random()).round() as i16).collect()).unwrap()
        };
        let normal = q_drawn(&|u, v| 1000.0 * (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos());
        let laplace = q_drawn(&|u, v| 1000.0 * (1.0 - u).ln() * if v < 0.5 { 1.0 } else { -1.0 });
        // Four standard errors at 400,000 points are below 0.006.
        assert!((normal - 1.754).abs() < 0.006, "{normal}");
        assert!((laplace - 1.916).abs() < 0.006, "{laplace}");
    }

    #[test]
    fn the_trim_law_has_its_knees() {
        let law = TrimLaw::default();
        assert_eq!(law.fraction(None), 0.05);
        assert_eq!(law.fraction(Some(1.75)), 0.05);
        assert!((law.fraction(Some(1.875)) - 0.225).abs() < 1e-12);
        assert_eq!(law.fraction(Some(2.5)), 0.40);
    }

    #[test]
    fn a_constant_window_has_no_q_and_the_smallest_trim() {
        let mean = trimmed_mean_of(vec![7; 500], &TrimLaw::default()).unwrap();
        assert_eq!((mean.q, mean.trim, mean.kept), (None, 0.05, 450));
        assert_eq!((mean.mean, mean.deviation, mean.winsorised_sd), (7.0, 0.0, 0.0));
    }

    #[test]
    fn the_flight_estimator_is_lower_by_the_derived_amount() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        let mut counts: Vec<i16> = (0..500).map(|_| rng.random_range(-3000..3000)).collect();
        counts.sort_unstable();
        let right = trimmed_mean_of(counts.clone(), &TrimLaw::default()).unwrap();
        let ranked = Ranked::of(counts.clone());
        let pair = Pair([&ranked, &Ranked::default()]);
        let (flight, _, kept) = flight_trimmed_mean(pair, &TrimLaw::default()).unwrap();
        let dropped = (500 - right.kept) / 2;
        let highest_kept = f64::from(counts[500 - dropped - 1]);
        assert_eq!(kept, right.kept - 1);
        // Rice 1996, derived: lower by (X(N-k) - T)/(M - 1).
        assert!((right.mean - flight - (highest_kept - right.mean) / (right.kept as f64 - 1.0)).abs() < 1e-9);
    }

    /// 500 counts of normal values around a level, each as often as it is expected.
    fn quantised(scatter: f64, level: f64) -> Vec<i16> {
        let normal = Normal::new(level, scatter).unwrap();
        let up_to = |count: i16| (500.0 * normal.cdf(f64::from(count) + 0.5)).round() as usize;
        (-9..=10).flat_map(|count| vec![count; up_to(count) - up_to(count - 1)]).collect()
    }

    #[test]
    fn counts_spread_over_their_width_are_trimmed_with_less_of_a_shift() {
        let law = TrimLaw { fraction_max: 0.05, ..TrimLaw::default() };
        let (mut whole, mut spread) = (0.0, 0.0);
        for scatter in [0.5, 0.6, 0.8, 1.0, 1.5] {
            for level in (0..20).map(|n| f64::from(n) / 20.0) {
                let counts = quantised(scatter, level);
                whole += (trimmed_mean_of(counts.clone(), &law).unwrap().mean - level).powi(2);
                spread += (trimmed_mean_of_values(&spread_counts(&counts), &law).unwrap().mean - level).powi(2);
            }
        }
        assert!(spread.sqrt() < 0.5 * whole.sqrt(), "{spread} against {whole}");
    }

    proptest! {
        #[test]
        fn values_of_whole_counts_give_the_same_mean(mut counts in prop::collection::vec(-32767i16..=32767, 1..600)) {
            counts.sort_unstable();
            let law = TrimLaw::default();
            let values: Vec<f64> = counts.iter().map(|count| f64::from(*count)).collect();
            let (a, b) = (trimmed_mean_of(counts.clone(), &law).unwrap(), trimmed_mean_of_values(&values, &law).unwrap());
            prop_assert_eq!((a.points, a.kept), (b.points, b.kept));
            prop_assert!((a.mean - b.mean).abs() < 1e-6);
            prop_assert!((a.winsorised_sd - b.winsorised_sd).abs() < 1e-6 * (1.0 + a.winsorised_sd));
        }

        #[test]
        fn sums_by_parts_equal_the_naive_ones(mut counts in prop::collection::vec(-32767i16..=32767, 1..600), cut in 0usize..600) {
            let law = TrimLaw::default();
            let (first, second) = counts.split_at(cut.min(counts.len()));
            let halves = [Ranked::of(first.to_vec()), Ranked::of(second.to_vec())];
            let mean = trimmed_mean(Pair([&halves[0], &halves[1]]), &law).unwrap();
            prop_assert_eq!(Some(mean), trimmed_mean_of(counts.clone(), &law), "however they are cut in two");
            counts.sort_unstable();
            let (expected, deviation) = naive(&counts, &law);
            prop_assert!((mean.mean - expected).abs() < 1e-6);
            prop_assert!((mean.deviation - deviation).abs() < 1e-6);
        }
    }
}

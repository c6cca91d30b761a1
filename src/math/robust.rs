//! Hogg's adaptive trimmed mean on sorted counts, in exact integer sums until the last division.

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

/// Sum of a slice of counts. Within a chunk it fits 32 bits, in which the machine adds many at a time.
fn sum(counts: &[i16]) -> i64 {
    counts.chunks(1 << 15).map(|chunk| i64::from(chunk.iter().map(|count| i32::from(*count)).sum::<i32>())).sum()
}

/// Sum of squares of a slice of counts; four of them fit 32 unsigned bits.
fn sum_of_squares(counts: &[i16]) -> i64 {
    let square = |count: &i16| i32::from(*count).unsigned_abs().pow(2);
    counts.chunks(4).map(|chunk| i64::from(chunk.iter().map(square).sum::<u32>())).sum()
}

/// Q of sorted counts; None when the inner half-means are equal.
pub fn tail_statistic(sorted: &[i16]) -> Option<f64> {
    let spread = |fraction: f64| {
        let points = points_of_fraction(fraction, sorted.len()).max(1);
        let (smallest, largest) = (&sorted[..points], &sorted[sorted.len() - points..]);
        (sum(largest) - sum(smallest)) as f64 / points as f64
    };
    let inner = spread(0.5);
    (inner > 0.0).then(|| spread(0.2) / inner)
}

/// The adaptive trimmed mean of counts in ascending order; None of none.
pub fn trimmed_mean(sorted: &[i16], law: &TrimLaw) -> Option<TrimmedMean> {
    let points = sorted.len();
    if points == 0 {
        return None;
    }
    let q = tail_statistic(sorted);
    let trim = law.fraction(q);
    let dropped = points_of_fraction(trim, points).min((points - 1) / 2);
    let kept = &sorted[dropped..points - dropped];
    let (mean, deviation) = mean_and_deviation(kept);
    Some(TrimmedMean {
        points,
        q,
        trim,
        kept: kept.len(),
        mean,
        deviation,
        plain_mean: sum(sorted) as f64 / points as f64,
        winsorised_sd: winsorised_sd(kept, dropped),
    })
}

/// Spreads counts in ascending order evenly over the width of their count: what a quantiser with this reading may have seen.
///
/// Trimming whole counts shifts the mean of a window that holds only a few different ones; trimming values spread like this
/// does so far less, and changes nothing where the scatter is many counts.
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

/// The estimator that flew: it drops one point more at the high end of counts. Mean, average deviation and points kept.
pub fn flight_trimmed_mean(sorted: &[i16], law: &TrimLaw) -> Option<(f64, f64, usize)> {
    let dropped = points_of_fraction(law.fraction(tail_statistic(sorted)), sorted.len());
    let kept = sorted.get(dropped..sorted.len().checked_sub(dropped + 1)?)?;
    let (mean, deviation) = mean_and_deviation(kept);
    (!kept.is_empty()).then_some((mean, deviation, kept.len()))
}

/// Mean and average absolute deviation from it, of counts in ascending order.
fn mean_and_deviation(sorted: &[i16]) -> (f64, f64) {
    let (points, total) = (sorted.len() as f64, sum(sorted));
    let mean = total as f64 / points;
    let below = sorted.partition_point(|count| f64::from(*count) < mean);
    let total_below = sum(&sorted[..below]);
    let (points_below, points_above) = (below as f64, points - below as f64);
    let absolute = mean * points_below - total_below as f64 + (total - total_below) as f64 - mean * points_above;
    (mean, absolute / points)
}

/// Standard deviation with `dropped` points at either end moved to the nearest kept one.
fn winsorised_sd(kept: &[i16], dropped: usize) -> f64 {
    let points = (kept.len() + 2 * dropped) as i64;
    if points < 2 {
        return 0.0;
    }
    let ends = [i64::from(kept[0]), i64::from(kept[kept.len() - 1])];
    let of_ends = |power: u32| dropped as i64 * (ends[0].pow(power) + ends[1].pow(power));
    let total = sum(kept) + of_ends(1);
    let squares = sum_of_squares(kept) + of_ends(2);
    let scatter = i128::from(points) * i128::from(squares) - i128::from(total) * i128::from(total);
    (scatter as f64 / (points as f64 * (points - 1) as f64)).sqrt()
}

/// Merges two ascending slices.
pub fn merge(left: &[i16], right: &[i16], merged: &mut Vec<i16>) {
    merged.clear();
    merged.resize(left.len() + right.len(), 0);
    let (mut i, mut j) = (0, 0);
    let mut places = merged.iter_mut();
    // Whose count comes next is a coin toss: no branch may depend on it.
    while i < left.len() && j < right.len() {
        let (a, b) = (left[i], right[j]);
        let Some(place) = places.next() else { return };
        *place = a.min(b);
        let take_left = usize::from(a <= b);
        i += take_left;
        j += 1 - take_left;
    }
    places.zip(left[i..].iter().chain(&right[j..])).for_each(|(place, count)| *place = *count);
}

/// Most counts that one radix sort takes; more are left to the standard sort.
const RADIX_COUNTS_MAX: usize = 256;

/// Sorts counts in ascending order: a radix sort of two passes of eight bits, a pass left out when its digit is the same
/// throughout.
pub fn sort_counts(counts: &mut [i16]) {
    let points = counts.len();
    if !(2..=RADIX_COUNTS_MAX).contains(&points) {
        return counts.sort_unstable();
    }
    let mut keys = [0u16; RADIX_COUNTS_MAX];
    let mut sorted = [0u16; RADIX_COUNTS_MAX];
    let mut places = [[0u16; 256]; 2];
    for (key, count) in keys.iter_mut().zip(counts.iter()) {
        *key = (*count as u16) ^ 0x8000;
        let [low, high] = key.to_le_bytes();
        places[0][usize::from(low)] += 1;
        places[1][usize::from(high)] += 1;
    }
    for (digit, places) in places.iter_mut().enumerate() {
        let digit_of = |key: u16| usize::from((key >> (8 * digit)) as u8);
        if usize::from(places[digit_of(keys[0])]) == points {
            continue;
        }
        let mut next = 0;
        for place in places.iter_mut() {
            next += std::mem::replace(place, next);
        }
        for key in &keys[..points] {
            let place = &mut places[digit_of(*key)];
            // Places never exceed the number of points: the mask only spares the check.
            sorted[usize::from(*place) % RADIX_COUNTS_MAX] = *key;
            *place += 1;
        }
        std::mem::swap(&mut keys, &mut sorted);
    }
    counts.iter_mut().zip(keys).for_each(|(count, key)| *count = (key ^ 0x8000) as i16);
}

/// Median of a slice, which is reordered; None of none. For an even number the mean of the two inner points.
pub fn median(values: &mut [f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    values.sort_unstable_by(f64::total_cmp);
    let half = values.len() / 2;
    Some(if values.len() % 2 == 1 { values[half] } else { 0.5 * (values[half - 1] + values[half]) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};

    fn naive(sorted: &[i16], law: &TrimLaw) -> (f64, f64) {
        let n = sorted.len();
        let k = (law.fraction(tail_statistic(sorted)) * n as f64 + 1e-9).floor() as usize;
        let kept: Vec<f64> = sorted[k..n - k].iter().map(|c| f64::from(*c)).collect();
        let mean = kept.iter().sum::<f64>() / kept.len() as f64;
        (mean, kept.iter().map(|x| (x - mean).abs()).sum::<f64>() / kept.len() as f64)
    }

    #[test]
    fn a_normal_sample_has_q_1_754_and_a_laplace_sample_1_916() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut q_of = |draw: &dyn Fn(f64, f64) -> f64| {
            let mut counts: Vec<i16> = (0..400_000).map(|_| draw(rng.random(), rng.random()).round() as i16).collect();
            counts.sort_unstable();
            tail_statistic(&counts).unwrap()
        };
        let normal = q_of(&|u, v| 1000.0 * (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos());
        let laplace = q_of(&|u, v| 1000.0 * (1.0 - u).ln() * if v < 0.5 { 1.0 } else { -1.0 });
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
        let mean = trimmed_mean(&[7; 500], &TrimLaw::default()).unwrap();
        assert_eq!((mean.q, mean.trim, mean.kept), (None, 0.05, 450));
        assert_eq!((mean.mean, mean.deviation, mean.winsorised_sd), (7.0, 0.0, 0.0));
    }

    #[test]
    fn the_flight_estimator_is_lower_by_the_derived_amount() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        let mut counts: Vec<i16> = (0..500).map(|_| rng.random_range(-3000..3000)).collect();
        counts.sort_unstable();
        let right = trimmed_mean(&counts, &TrimLaw::default()).unwrap();
        let (flight, _, kept) = flight_trimmed_mean(&counts, &TrimLaw::default()).unwrap();
        let dropped = (500 - right.kept) / 2;
        let highest_kept = f64::from(counts[500 - dropped - 1]);
        assert_eq!(kept, right.kept - 1);
        // Rice 1996, derived: lower by (X(N-k) - T)/(M - 1).
        assert!((right.mean - flight - (highest_kept - right.mean) / (right.kept as f64 - 1.0)).abs() < 1e-9);
    }

    #[test]
    fn counts_spread_over_their_width_are_trimmed_without_a_shift() {
        // Two counts, one in four the higher: the value lies a quarter above the lower one, trimmed or not.
        let mut counts = vec![7i16; 375];
        counts.resize(500, 8);
        let law = TrimLaw { fraction_max: 0.05, ..TrimLaw::default() };
        let whole = trimmed_mean(&counts, &law).unwrap().mean;
        let spread = trimmed_mean_of_values(&spread_counts(&counts), &law).unwrap().mean;
        assert!((whole - 7.25).abs() > 0.02, "{whole}");
        assert!((spread - 7.25).abs() < 0.02, "{spread}");
    }

    proptest! {
        #[test]
        fn values_of_whole_counts_give_the_same_mean(mut counts in prop::collection::vec(-32767i16..=32767, 1..600)) {
            counts.sort_unstable();
            let law = TrimLaw::default();
            let values: Vec<f64> = counts.iter().map(|count| f64::from(*count)).collect();
            let (a, b) = (trimmed_mean(&counts, &law).unwrap(), trimmed_mean_of_values(&values, &law).unwrap());
            prop_assert_eq!((a.points, a.kept), (b.points, b.kept));
            prop_assert!((a.mean - b.mean).abs() < 1e-6);
            prop_assert!((a.winsorised_sd - b.winsorised_sd).abs() < 1e-6 * (1.0 + a.winsorised_sd));
        }

        #[test]
        fn sums_by_parts_equal_the_naive_ones(mut counts in prop::collection::vec(-32767i16..=32767, 1..600)) {
            counts.sort_unstable();
            let law = TrimLaw::default();
            let mean = trimmed_mean(&counts, &law).unwrap();
            let (expected, deviation) = naive(&counts, &law);
            prop_assert!((mean.mean - expected).abs() < 1e-6);
            prop_assert!((mean.deviation - deviation).abs() < 1e-6);
        }

        #[test]
        fn a_radix_sort_sorts(mut counts in prop::collection::vec(any::<i16>(), 0..400), narrow in any::<bool>()) {
            if narrow {
                counts.iter_mut().for_each(|count| *count = *count % 100 - 50);
            }
            let mut expected = counts.clone();
            expected.sort_unstable();
            sort_counts(&mut counts);
            prop_assert_eq!(counts, expected);
        }

        #[test]
        fn a_merge_is_the_sort_of_both(mut a in prop::collection::vec(any::<i16>(), 0..300), mut b in prop::collection::vec(any::<i16>(), 0..300)) {
            a.sort_unstable();
            b.sort_unstable();
            let mut merged = Vec::new();
            merge(&a, &b, &mut merged);
            let mut both = [a, b].concat();
            both.sort_unstable();
            prop_assert_eq!(merged, both);
        }
    }
}

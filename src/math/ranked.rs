//! Counts in ascending order with their running sums; two such runs are taken as one without being merged.
//!
//! Whatever an estimate needs of the k smallest of two runs together, their sums and the counts at the border, is found by one binary
//! search: which counts of either run they are. All sums are exact.

/// Counts in ascending order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Ranked {
    counts: Vec<i16>,
    /// Of the first k counts, for every k from 1.
    sums: Vec<Sums>,
}

/// Sum and sum of squares of some counts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Sums {
    /// Of the counts.
    pub counts: i64,
    /// Of their squares.
    pub squares: i64,
}

impl std::ops::Add for Sums {
    type Output = Sums;

    fn add(self, other: Sums) -> Sums {
        Sums { counts: self.counts + other.counts, squares: self.squares + other.squares }
    }
}

impl std::ops::Sub for Sums {
    type Output = Sums;

    fn sub(self, other: Sums) -> Sums {
        Sums { counts: self.counts - other.counts, squares: self.squares - other.squares }
    }
}

impl Ranked {
    /// Sorts counts.
    pub fn of(mut counts: Vec<i16>) -> Self {
        sort_counts(&mut counts);
        let mut running = Sums::default();
        let sums = counts.iter().map(|count| {
            let count = i64::from(*count);
            running = running + Sums { counts: count, squares: count * count };
            running
        });
        let sums = sums.collect();
        Self { counts, sums }
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.counts.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.counts.is_empty()
    }

    /// Sums of the first `points`.
    fn sums(&self, points: usize) -> Sums {
        points.checked_sub(1).map_or_else(Sums::default, |last| self.sums[last])
    }
}

/// Two runs taken as one.
#[derive(Debug, Clone, Copy)]
pub struct Pair<'a>(pub [&'a Ranked; 2]);

/// A border in a pair of runs: so many of the first and of the second lie below it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Border([usize; 2]);

impl Pair<'_> {
    /// How many.
    pub fn len(&self) -> usize {
        self.0[0].len() + self.0[1].len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The border above the `points` smallest.
    pub fn border(&self, points: usize) -> Border {
        let [a, b] = self.0.map(|run| run.counts.as_slice());
        let (mut least, mut most) = (points.saturating_sub(b.len()), points.min(a.len()));
        while least < most {
            let middle = (least + most) / 2;
            let more = a[middle] < b[points - middle - 1];
            least = if more { middle + 1 } else { least };
            most = if more { most } else { middle };
        }
        Border([least, points - least])
    }

    /// The border below the counts from a value on, no lower than one border and no higher than another.
    pub fn border_at(&self, value: f64, from: Border, to: Border) -> Border {
        // A count is below the value when it is below the value rounded up.
        let value = value.ceil();
        let below = |run: &Ranked| run.counts.partition_point(|count| f64::from(*count) < value);
        Border([0, 1].map(|n| below(self.0[n]).clamp(from.0[n], to.0[n])))
    }

    /// Sums of everything below a border.
    pub fn sums(&self, border: Border) -> Sums {
        self.0[0].sums(border.0[0]) + self.0[1].sums(border.0[1])
    }

    /// The smallest and the largest count between two borders.
    pub fn ends(&self, from: Border, to: Border) -> Option<[i16; 2]> {
        let between = |n: usize| self.0[n].counts.get(from.0[n]..to.0[n]).filter(|counts| !counts.is_empty());
        let ends = |counts: &[i16]| [counts[0], counts[counts.len() - 1]];
        match [between(0), between(1)].map(|counts| counts.map(ends)) {
            [Some(a), Some(b)] => Some([a[0].min(b[0]), a[1].max(b[1])]),
            [one, other] => one.or(other),
        }
    }
}

impl Border {
    /// Counts below it.
    pub fn points(self) -> usize {
        self.0[0] + self.0[1]
    }
}

/// Most counts that one radix sort takes; more are left to the standard sort.
const RADIX_COUNTS_MAX: usize = 256;
/// Bits of one digit at most: two digits are enough for counts that spread over 4096.
const DIGIT_BITS_MAX: u32 = 6;

/// Sorts counts in ascending order: a radix sort of as few passes as their spread needs.
pub fn sort_counts(counts: &mut [i16]) {
    let points = counts.len();
    if !(2..=RADIX_COUNTS_MAX).contains(&points) {
        return counts.sort_unstable();
    }
    let least = counts.iter().copied().min().unwrap_or(0);
    let most = counts.iter().copied().max().unwrap_or(0);
    let bits = u32::BITS - (i32::from(most) - i32::from(least)).unsigned_abs().leading_zeros();
    let passes = bits.div_ceil(DIGIT_BITS_MAX);
    if passes == 0 {
        return;
    }
    let digit_bits = bits.div_ceil(passes);
    let mut keys = [0u16; RADIX_COUNTS_MAX];
    let mut sorted = [0u16; RADIX_COUNTS_MAX];
    keys.iter_mut().zip(counts.iter()).for_each(|(key, count)| *key = count.wrapping_sub(least) as u16);
    for pass in 0..passes {
        radix_pass(&keys[..points], &mut sorted, pass * digit_bits, digit_bits);
        std::mem::swap(&mut keys, &mut sorted);
    }
    counts.iter_mut().zip(keys).for_each(|(count, key)| *count = (key as i16).wrapping_add(least));
}

/// One stable pass by one digit.
fn radix_pass(keys: &[u16], sorted: &mut [u16; RADIX_COUNTS_MAX], shift: u32, bits: u32) {
    const DIGITS: usize = 1 << DIGIT_BITS_MAX;
    let mask = (1u16 << bits) - 1;
    // The last mask only spares the check of the index.
    let digit = |key: u16| usize::from(key >> shift & mask) % DIGITS;
    let mut places = [0u16; DIGITS];
    keys.iter().for_each(|key| places[digit(*key)] += 1);
    let mut next = 0;
    for place in &mut places[..1 << bits] {
        next += std::mem::replace(place, next);
    }
    for key in keys {
        let place = &mut places[digit(*key)];
        sorted[usize::from(*place) % RADIX_COUNTS_MAX] = *key;
        *place += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_radix_sort_sorts(mut counts in prop::collection::vec(any::<i16>(), 0..400), modulus in 1i16..2000, narrow in any::<bool>()) {
            if narrow {
                counts.iter_mut().for_each(|count| *count = *count % modulus - 50);
            }
            let mut expected = counts.clone();
            expected.sort_unstable();
            sort_counts(&mut counts);
            prop_assert_eq!(counts, expected);
        }

        #[test]
        fn two_runs_taken_as_one_are_their_merger(a in prop::collection::vec(-99i16..99, 0..60), b in prop::collection::vec(any::<i16>(), 0..60), at in 0usize..121, value in -120.0..120.0f64) {
            let mut both = [a.clone(), b.clone()].concat();
            both.sort_unstable();
            let (a, b) = (Ranked::of(a), Ranked::of(b));
            let pair = Pair([&a, &b]);
            let at = at.min(both.len());
            let border = pair.border(at);
            let sum = |counts: &[i16]| counts.iter().map(|c| i64::from(*c)).sum::<i64>();
            let squares = |counts: &[i16]| counts.iter().map(|c| i64::from(*c).pow(2)).sum::<i64>();
            prop_assert_eq!(border.points(), at);
            prop_assert_eq!(pair.sums(border), Sums { counts: sum(&both[..at]), squares: squares(&both[..at]) });
            let (none, all) = (pair.border(0), pair.border(both.len()));
            prop_assert_eq!(pair.ends(none, border), (at > 0).then(|| [both[0], both[at.max(1) - 1]]));
            prop_assert_eq!(pair.ends(border, all), both.get(at).map(|first| [*first, both[both.len() - 1]]));
            let below = both.partition_point(|count| f64::from(*count) < value);
            prop_assert_eq!(pair.border_at(value, none, all).points(), below);
        }
    }
}

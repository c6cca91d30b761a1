//! The quality of a window: a set of named reasons for care. Empty is good.

use std::fmt;
use std::ops::BitOr;

/// A set of reasons for care; the empty set is `good`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Quality(u16);

/// Names in the order in which they are written, bit by bit.
const NAMES: [&str; 9] = [
    "partial",
    "gap",
    "saturated",
    "range_mixed",
    "range_corrected",
    "table_moving",
    "uncalibrated",
    "noisy",
    "extrapolated",
];

impl Quality {
    /// Nothing to say against it.
    pub const GOOD: Quality = Quality(0);
    /// Fewer samples than the window holds entered the estimate.
    pub const PARTIAL: Quality = Quality(1);
    /// Telemetry is missing inside the window.
    pub const GAP: Quality = Quality(1 << 1);
    /// A sample at the rail was left out.
    pub const SATURATED: Quality = Quality(1 << 2);
    /// Samples of more than one range; only those of the most frequent one were used.
    pub const RANGE_MIXED: Quality = Quality(1 << 3);
    /// The records named a wrong range; the true one was used.
    pub const RANGE_CORRECTED: Quality = Quality(1 << 4);
    /// The table was not in its normal position during part of the window; that part was left out.
    pub const TABLE_MOVING: Quality = Quality(1 << 5);
    /// No calibration to apply: no acceleration is given.
    pub const UNCALIBRATED: Quality = Quality(1 << 6);
    /// The samples scatter far beyond what the window's neighbours show.
    pub const NOISY: Quality = Quality(1 << 7);
    /// The bias is extrapolated beyond the calibrations that support it.
    pub const EXTRAPOLATED: Quality = Quality(1 << 8);

    /// Whether every reason of `other` is here.
    pub const fn contains(self, other: Quality) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether there is nothing to say against it.
    pub const fn is_good(self) -> bool {
        self.0 == 0
    }

    /// Whether there is nothing to say against it but these.
    pub const fn is_good_but_for(self, others: Quality) -> bool {
        self.0 & !others.0 == 0
    }

    /// This set, with `other` when `condition` holds.
    pub const fn with_if(self, other: Quality, condition: bool) -> Quality {
        if condition { Quality(self.0 | other.0) } else { self }
    }

    /// The number of reasons: the order of `worst`.
    pub const fn reasons(self) -> u32 {
        self.0.count_ones()
    }
}

impl BitOr for Quality {
    type Output = Quality;

    fn bitor(self, other: Quality) -> Quality {
        Quality(self.0 | other.0)
    }
}

impl fmt::Display for Quality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_good() {
            return f.write_str("good");
        }
        let mut first = true;
        for (bit, name) in NAMES.iter().enumerate() {
            if self.0 & (1 << bit) != 0 {
                if !first {
                    f.write_str("+")?;
                }
                f.write_str(name)?;
                first = false;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_are_joined_in_a_fixed_order() {
        let quality = Quality::SATURATED | Quality::PARTIAL;
        assert_eq!(quality.to_string(), "partial+saturated");
        assert_eq!(Quality::GOOD.to_string(), "good");
    }
}

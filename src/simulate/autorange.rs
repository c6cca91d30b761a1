//! The ranges of the three axes in normal mode: coarser within 5 s of reaching a rail, finer after a minute's calm.

use crate::telemetry::Range;

/// Clock multiples at which the instrument looks, s.
const LOOK_S: u32 = 5;
/// How long an axis stays in a coarser range after it was last needed, s.
const HOLD_S: f64 = 60.0;

/// Ranges of the three axes, and when each coarser one was last needed.
#[derive(Debug, Clone)]
pub struct Autorange {
    ranges: [Range; 3],
    /// Last clock at which range C, and B, was too small; by axis.
    outgrown_s: [[f64; 2]; 3],
}

impl Autorange {
    /// All axes in range C.
    pub fn new() -> Self {
        Self { ranges: [Range::C; 3], outgrown_s: [[f64::NEG_INFINITY; 2]; 3] }
    }

    /// Present ranges.
    pub fn ranges(&self) -> [Range; 3] {
        self.ranges
    }

    /// Tells what an axis felt, as a share of the full scale of range C and of B.
    pub fn feel(&mut self, axis: usize, clock_s: f64, share_of_c: f64, share_of_b: f64) {
        if share_of_c.abs() >= 1.0 {
            self.outgrown_s[axis][0] = clock_s;
        }
        if share_of_b.abs() >= 1.0 {
            self.outgrown_s[axis][1] = clock_s;
        }
    }

    /// Looks, if it is time (or if told to); the axes whose range changed, with their new ranges.
    pub fn look(&mut self, clock_s: u32, now: bool) -> Vec<(usize, Range)> {
        if !now && !clock_s.is_multiple_of(LOOK_S) {
            return Vec::new();
        }
        let mut changed = Vec::new();
        for axis in 0..3 {
            let recent = |last_s: f64| f64::from(clock_s) - last_s < HOLD_S;
            let [c, b] = self.outgrown_s[axis];
            let wanted = match (recent(b), recent(c)) {
                (true, _) => Range::A,
                (false, true) => Range::B,
                (false, false) => Range::C,
            };
            if wanted != self.ranges[axis] {
                self.ranges[axis] = wanted;
                changed.push((axis, wanted));
            }
        }
        changed
    }

    /// Puts all axes into a range, as calibrations do.
    pub fn force(&mut self, range: Range) {
        self.ranges = [range; 3];
    }
}

impl Default for Autorange {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rail_is_answered_within_five_seconds_and_forgotten_after_sixty() {
        let mut autorange = Autorange::new();
        autorange.feel(0, 1001.3, 1.2, 0.1);
        assert!(autorange.look(1002, false).is_empty());
        assert_eq!(autorange.look(1005, false), [(0, Range::B)]);
        assert!(autorange.look(1060, false).is_empty());
        assert_eq!(autorange.look(1065, false), [(0, Range::C)]);
    }

    #[test]
    fn what_outgrows_b_too_goes_straight_to_a() {
        let mut autorange = Autorange::new();
        autorange.feel(2, 10.0, 30.0, -1.5);
        assert_eq!(autorange.look(10, true), [(2, Range::A)]);
    }
}

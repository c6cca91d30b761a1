//! What can be made to go wrong: the faults of STS-65, each to be planted at will.
//!
//! Settling and the one-sided estimator are properties of the instrument (`Instrument::settling_counts`,
//! `MissionConfig::one_sided_on_board`), on by default as in the samples; everything else is planted here.

/// A fault planted in a mission. Clocks are the instrument's, s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// Records say range C while the sensor sits in A, until a saturation of X half a second before the end forces a range change.
    RangeMisreport {
        /// First second misreported; a mission that aborts a scale calibration may leave it at 0 for the moment of the abort.
        from_clock_s: u32,
        /// Seconds it lasts.
        seconds: u32,
    },
    /// Reentry is asserted during a scale calibration and cancelled in the rate step of this sequence (1 to 9), which ends there.
    ScaleAborted {
        /// Number of the calibration.
        calibration_id: u16,
        /// Sequence.
        sequence: u8,
    },
    /// The electronic level of Z shifts in the post step of every scale calibration of Z in range C.
    ElectronicShift {
        /// Counts added to Z.
        z_counts: f64,
    },
    /// The table's rate is unsteady during the scale calibration of Z in range C.
    TableJitter {
        /// Number of the calibration, 0 for every one.
        calibration_id: u16,
        /// Standard deviation of the rate over the rate itself.
        share: f64,
    },
    /// Table packets of a scale calibration's rate step are cut short, and one science record in it carries nonsense.
    MalformedScaleRecord {
        /// Number of the calibration.
        calibration_id: u16,
        /// Sequence, 1 to 9.
        sequence: u8,
    },
    /// The Orbiter's clock jumps.
    ClockJump {
        /// When.
        at_clock_s: u32,
        /// By how much, s, forward positive.
        jump_s: f64,
    },
    /// An axis is driven to its rail in every range.
    Saturation {
        /// Axis 0, 1, 2.
        axis: usize,
        /// When it begins.
        from_clock_s: f64,
        /// How long it lasts, s.
        seconds: f64,
    },
    /// The instrument shuts down after reentry: Y saturated for two minutes in reentry mode, then no more data.
    Shutdown {
        /// When reentry mode begins.
        at_clock_s: u32,
    },
    /// One bias calibration is disturbed: a push during its positions in range C.
    BiasOutlier {
        /// Number of the calibration.
        calibration_id: u16,
        /// Counts added in range C, both positions.
        counts: [f64; 3],
    },
    /// The bias of an axis steps, in every range alike, and stays there: the table does not turn it, so that calibrations see it.
    BiasStep {
        /// Axis 0, 1, 2.
        axis: usize,
        /// When.
        at_clock_s: u32,
        /// By how much, ng.
        ng: f64,
    },
}

/// Seconds in reentry mode with Y at the rail before the shutdown.
pub const SHUTDOWN_S: u32 = 120;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shutdown_is_the_two_minutes_of_the_report() {
        assert_eq!(SHUTDOWN_S, 2 * 60);
    }
}

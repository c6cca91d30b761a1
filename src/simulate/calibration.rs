//! The calibration sequences: what the table does, second by second.
//!
//! Bias, every 251 minutes, for target 1 then 2, in ranges C, B, A: 50 s normal position, 25 s moving by 180 degrees, 50 s opposite,
//! 25 s back. Scale, with every third bias and right after it: targets 1, 2, 3, ranges C, B, A: 50 s pre-rate, 10 s moving to
//! -delta, the rate until +delta, 10 s back, 50 s post-rate.

use std::f64::consts::PI;

use crate::telemetry::{EventCode, Mode, Range, Step};

use super::faults::Fault;

/// Ranges in the order of a sequence.
const RANGES: [Range; 3] = [Range::C, Range::B, Range::A];
/// Seconds at rest in one position.
const POSITION_S: u32 = 50;
/// Seconds of a bias calibration's move by 180 degrees.
const TURN_S: u32 = 25;
/// Seconds of a scale calibration's move to or from an end of its travel.
const REACH_S: u32 = 10;
/// Seconds of a whole bias calibration.
pub const BIAS_S: u32 = 2 * 3 * 2 * (POSITION_S + TURN_S);

/// When and how the instrument calibrates.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationPlan {
    /// Seconds from the start of the mission to the first.
    pub first_after_s: u32,
    /// Seconds between the starts of two; 251 minutes.
    pub interval_s: u32,
    /// Number of the first.
    pub first_id: u16,
    /// A scale calibration follows every so many, the first included; 0 for none.
    pub scale_every: u16,
    /// Rate of the table by range A, B, C, rad/s.
    pub rate_rad_s: [f64; 3],
    /// Seconds at that rate, by range A, B, C.
    pub rate_s: [u32; 3],
}

impl Default for CalibrationPlan {
    fn default() -> Self {
        Self {
            first_after_s: 600,
            interval_s: 251 * 60,
            first_id: 1,
            scale_every: 3,
            rate_rad_s: [0.70, 0.22, 0.07],
            rate_s: [5, 16, 50],
        }
    }
}

/// One step of a sequence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// Instrument clock of its first second.
    pub from_s: u32,
    /// Instrument clock after its last.
    pub until_s: u32,
    /// Bias or scale.
    pub mode: Mode,
    /// Step.
    pub step: Step,
    /// Target.
    pub target: u8,
    /// Range of all axes.
    pub range: Range,
    /// Number of the calibration.
    pub calibration_id: u16,
    /// Number of the sequence within it, from 1.
    pub sequence: u8,
    /// Table angle at its beginning, rad.
    pub angle_rad: f64,
    /// Table rate during it, rad/s.
    pub rate_rad_s: f64,
}

impl Segment {
    /// Table angle at an instant, rad.
    pub fn angle_rad(&self, clock_s: f64) -> f64 {
        self.angle_rad + self.rate_rad_s * (clock_s - f64::from(self.from_s))
    }

    /// Axis that feels the turn's centripetal acceleration: 0, 1, 2.
    pub fn target_axis(&self) -> usize {
        match self.target {
            1 => 0,
            2 => 1,
            _ => 2,
        }
    }
}

/// An event on the schedule.
pub type ScheduledEvent = (u32, EventCode, u32, &'static str);

/// The whole mission's calibrations.
#[derive(Debug, Clone, Default)]
pub struct Schedule {
    /// Steps in order of time.
    pub segments: Vec<Segment>,
    /// Events in order of time.
    pub events: Vec<ScheduledEvent>,
}

impl Schedule {
    /// Lays out every calibration that begins and ends its bias part between two clocks, with the aborts among the faults.
    pub fn new(plan: &CalibrationPlan, start_s: u32, end_s: u32, faults: &[Fault]) -> Self {
        let mut schedule = Self::default();
        let mut at_s = start_s + plan.first_after_s;
        let mut id = plan.first_id;
        while at_s + BIAS_S <= end_s {
            schedule.add_bias(at_s, id);
            let scale_due = plan.scale_every > 0 && (id + plan.scale_every - 1).is_multiple_of(plan.scale_every);
            if scale_due {
                schedule.add_scale(plan, at_s + BIAS_S, end_s, id, abort_of(faults, id));
            }
            id += 1;
            at_s += plan.interval_s;
        }
        schedule
    }

    fn add_bias(&mut self, start_s: u32, id: u16) {
        self.events.push((start_s, EventCode::BiasStart, u32::from(id), ""));
        let turn = PI / f64::from(TURN_S);
        let mut at_s = start_s;
        let mut sequence = 0;
        for target in [1, 2] {
            for range in RANGES {
                sequence += 1;
                for (step, seconds, angle_rad, rate_rad_s) in [
                    (Step::Normal, POSITION_S, 0.0, 0.0),
                    (Step::Moving, TURN_S, 0.0, turn),
                    (Step::Opposite, POSITION_S, PI, 0.0),
                    (Step::Moving, TURN_S, PI, -turn),
                ] {
                    let until_s = at_s + seconds;
                    let mode = Mode::Bias;
                    let calibration_id = id;
                    let from_s = at_s;
                    self.segments.push(Segment {
                        from_s,
                        until_s,
                        mode,
                        step,
                        target,
                        range,
                        calibration_id,
                        sequence,
                        angle_rad,
                        rate_rad_s,
                    });
                    at_s = until_s;
                }
            }
        }
        self.events.push((at_s, EventCode::BiasEnd, u32::from(id), ""));
    }

    fn add_scale(&mut self, plan: &CalibrationPlan, start_s: u32, end_s: u32, id: u16, abort: Option<Abort>) {
        let mut segments = Vec::new();
        let mut at_s = start_s;
        let mut sequence = 0;
        for target in [1, 2, 3] {
            for range in RANGES {
                sequence += 1;
                let (rate, seconds) = (plan.rate_rad_s[range.index()], plan.rate_s[range.index()]);
                let delta = rate * f64::from(seconds) / 2.0;
                let reach = delta / f64::from(REACH_S);
                for (step, seconds, angle_rad, rate_rad_s) in [
                    (Step::PreRate, POSITION_S, 0.0, 0.0),
                    (Step::Moving, REACH_S, 0.0, -reach),
                    (Step::Rate, seconds, -delta, rate),
                    (Step::Moving, REACH_S, delta, -reach),
                    (Step::PostRate, POSITION_S, 0.0, 0.0),
                ] {
                    let until_s = at_s + seconds;
                    segments.push(Segment {
                        from_s: at_s,
                        until_s,
                        mode: Mode::Scale,
                        step,
                        target,
                        range,
                        calibration_id: id,
                        sequence,
                        angle_rad,
                        rate_rad_s,
                    });
                    at_s = until_s;
                }
            }
        }
        if at_s > end_s {
            return;
        }
        self.events.push((start_s, EventCode::ScaleStart, u32::from(id), ""));
        match abort {
            None => self.events.push((at_s, EventCode::ScaleEnd, u32::from(id), "")),
            Some(abort) => self.cut(&mut segments, start_s, abort),
        }
        self.segments.extend(segments);
    }

    /// Ends a scale calibration 20 s into the rate step of the sequence at which reentry was cancelled.
    fn cut(&mut self, segments: &mut Vec<Segment>, start_s: u32, abort: Abort) {
        let in_rate = |s: &&Segment| s.sequence == abort.sequence && s.step == Step::Rate;
        let Some(rate) = segments.iter().find(in_rate) else { return };
        let cut_s = rate.from_s + 20.min(rate.until_s - rate.from_s);
        segments.retain(|s| s.from_s < cut_s);
        if let Some(last) = segments.last_mut() {
            last.until_s = last.until_s.min(cut_s);
        }
        let asserted_s = cut_s.saturating_sub(abort.asserted_before_s).max(start_s);
        self.events.push((asserted_s, EventCode::ReentryAsserted, 0, ""));
        self.events.push((cut_s, EventCode::ReentryCancelled, 0, "reenter discrete dropped"));
        self.events.push((cut_s, EventCode::ScaleAborted, u32::from(abort.sequence), ""));
    }

    /// Where the scale calibration with this number was cut off, if it was.
    pub fn aborted_at_s(&self, id: u16) -> Option<u32> {
        let last = self.segments.iter().rfind(|s| s.calibration_id == id && s.mode == Mode::Scale)?;
        (last.step == Step::Rate).then_some(last.until_s)
    }
}

#[derive(Clone, Copy)]
struct Abort {
    sequence: u8,
    asserted_before_s: u32,
}

fn abort_of(faults: &[Fault], id: u16) -> Option<Abort> {
    faults.iter().find_map(|fault| match fault {
        Fault::ScaleAborted { calibration_id, sequence } if *calibration_id == id => {
            Some(Abort { sequence: *sequence, asserted_before_s: 400 })
        }
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schedule(hours: u32, faults: &[Fault]) -> Schedule {
        Schedule::new(&CalibrationPlan::default(), 0, hours * 3600, faults)
    }

    #[test]
    fn a_mission_of_fourteen_and_three_quarter_days_has_eighty_four() {
        // "84 bias calibrations, every 251 min" [Rice 1996]; this one ends 14.75 days after its start.
        let bias_ends = schedule(354, &[]).events.iter().filter(|e| e.1 == EventCode::BiasEnd).count();
        assert!((84..=85).contains(&bias_ends), "{bias_ends}");
    }

    #[test]
    fn steps_follow_each_other_without_a_gap_or_a_jump_of_the_table() {
        let schedule = schedule(12, &[]);
        for pair in schedule.segments.windows(2) {
            if pair[0].calibration_id == pair[1].calibration_id {
                assert_eq!(pair[0].until_s, pair[1].from_s);
                let end = pair[0].angle_rad(f64::from(pair[0].until_s));
                assert!((end - pair[1].angle_rad).abs() < 1e-12, "{pair:?}");
            }
        }
    }

    #[test]
    fn timings_are_those_of_the_samples() {
        // defects-24h: bias 32 starts at 491920 and ends at 492820; scale 34 runs from 522940 to 524233.
        let schedule = schedule(24, &[]);
        let at = |code: EventCode| schedule.events.iter().find(|e| e.1 == code).unwrap().0;
        assert_eq!((at(EventCode::BiasStart), at(EventCode::BiasEnd)), (600, 1500));
        assert_eq!(at(EventCode::ScaleEnd) - at(EventCode::ScaleStart), 1293);
        let with_scale: Vec<u32> =
            schedule.events.iter().filter(|e| e.1 == EventCode::ScaleStart).map(|e| e.2).collect();
        assert_eq!(with_scale, [1, 4]);
    }

    #[test]
    fn an_abort_ends_in_the_rate_step_of_its_sequence() {
        let schedule = schedule(12, &[Fault::ScaleAborted { calibration_id: 1, sequence: 4 }]);
        let aborted = schedule.events.iter().find(|e| e.1 == EventCode::ScaleAborted).unwrap();
        assert_eq!(aborted.2, 4);
        assert_eq!(schedule.aborted_at_s(1), Some(aborted.0));
        assert_eq!(schedule.aborted_at_s(4), None);
        assert!(!schedule.events.iter().any(|e| e.1 == EventCode::ScaleEnd && e.2 == 1));
    }
}

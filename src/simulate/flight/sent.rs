//! What the instrument makes of a second: the records on their way down, and what they suffer.

use rand::RngExt;

use crate::ingest::wire::Record;
use crate::telemetry::{AccRecord, Housekeeping, Mode, Range, SAMPLES_PER_RECORD, Step, TableReport};
use crate::units::Clock;

use super::{Flight, Now};
use crate::simulate::calibration::Segment;
use crate::simulate::faults::Fault;

/// What the electronics are warmer than the sensor, C.
const ELECTRONICS_ABOVE_C: f64 = 3.3;
/// Bus voltage, V, and its scatter.
const BUS_V: (f64, f64) = (28.0, 0.03);

/// What a record suffers before it is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Damage {
    /// Its data are cut short.
    CutShort,
    /// Its BCD time is no time.
    NoTime,
}

/// One record on its way down.
#[derive(Debug, Clone, PartialEq)]
pub struct Sent {
    /// The record as it was meant.
    pub record: Record,
    /// What became of it.
    pub damage: Option<Damage>,
}

impl Flight<'_> {
    pub(super) fn science_record(
        &mut self,
        now: &Now,
        mode: Mode,
        ranges: [Range; 3],
        counts: [[i16; 3]; SAMPLES_PER_RECORD],
        temperature_c: f64,
    ) -> AccRecord {
        let sequence = self.counters.records;
        self.counters.records = (sequence + 1) & 0x3fff;
        let quiet = self.config.quiet.iter().any(|(from_s, to_s)| (*from_s..*to_s).contains(&now.clock_s));
        AccRecord {
            clock: Clock::from_tenths(i64::from(now.clock_s) * 10),
            sequence,
            orbiter_unix_ms: self.orbiter_unix_ms(),
            counts,
            temperature_c: as_sent_c(temperature_c),
            mode,
            quiet,
            table_moving: now.segment.is_some_and(|s| s.step == Step::Moving),
            at_rail: counts.as_flattened().iter().any(|count| AccRecord::is_at_rail(*count)),
            ranges,
            target: now.segment.map_or(0, |s| s.target),
            step: now.segment.map_or(Step::None, |s| s.step),
        }
    }

    pub(super) fn housekeeping(&mut self, acc: &AccRecord, temperature_c: f64) -> Housekeeping {
        let (level_v, scatter_v) = BUS_V;
        let bus_v = level_v + scatter_v * self.clocks.random_range(-1.7..1.7);
        // As the fields hold them, so that what is sent and what is read are one.
        let hundredths = |c: f64| (c * 100.0).round() * 0.01;
        Housekeeping {
            clock: acc.clock,
            sensor_temperature_c: hundredths(temperature_c),
            electronics_temperature_c: hundredths(temperature_c + ELECTRONICS_ABOVE_C),
            bus_v: (bus_v * 1000.0).round() * 0.001,
            data_status: crate::ingest::wire::record::data_status(acc),
            ranges: acc.ranges,
            bias_calibrations: self.counters.bias_done,
            scale_calibrations: self.counters.scale_done,
        }
    }

    pub(super) fn damage(&self, segment: Option<Segment>, science: bool) -> Option<Damage> {
        let segment = segment.filter(|s| s.mode == Mode::Scale && s.step == Step::Rate)?;
        let hit = self.config.faults.iter().any(|fault| match fault {
            Fault::MalformedScaleRecord { calibration_id, sequence } => {
                *calibration_id == segment.calibration_id && *sequence == segment.sequence
            }
            _ => false,
        });
        match (hit, science) {
            (true, false) => Some(Damage::CutShort),
            (true, true) if self.clock_s == segment.from_s + 2 => Some(Damage::NoTime),
            _ => None,
        }
    }
}

/// The temperature as the record's field can hold it.
fn as_sent_c(temperature_c: f64) -> f32 {
    let raw = crate::ingest::wire::record::raw_from_temperature(temperature_c);
    ((32_768.0 - f64::from(raw)) * 20.0 / 65_536.0 * 20.0 - 17.8) as f32
}

pub(super) fn table_report(acc: &AccRecord, segment: &Segment, angle_rad: f64, rate_rad_s: f64) -> TableReport {
    TableReport {
        clock: acc.clock,
        mode: segment.mode,
        step: segment.step,
        target: segment.target,
        ranges: acc.ranges,
        calibration_id: segment.calibration_id,
        angle_rad,
        rate_rad_s,
    }
}

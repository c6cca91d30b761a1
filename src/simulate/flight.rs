//! The mission flown, second by second: what the instrument feels, what it makes of it, what it sends.

mod sent;

pub use sent::{Damage, Sent};

use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::ingest::wire::Record;
use crate::physics::Vec3;
use crate::telemetry::{AccRecord, Axis, Event, EventCode, Mode, Range, SAMPLES_PER_RECORD, Step};
use crate::units::{Clock, NANO_G_M_S2};

use super::autorange::Autorange;
use super::calibration::{Schedule, ScheduledEvent, Segment};
use super::faults::{Fault, SHUTDOWN_S};
use super::forces::QuasiSteady;
use super::instrument::Temperature;
use super::mission::MissionConfig;
use super::noise::Vibration;
use super::onboard::OnBoard;
use super::{Purpose, generator};

/// A push that drives any axis to its rail in any range, ng.
const RAIL_PUSH_NG: f64 = 4.0e7;

/// A second of the mission.
#[derive(Debug, Clone)]
pub struct Second {
    /// Instrument clock at its start.
    pub clock_s: u32,
    /// What was sent, in this order.
    pub sent: Vec<Sent>,
    /// Mean quasi-steady acceleration at the sensor over its ten samples, body axes, ng: free of vibration and faults.
    pub quasi_steady_ng: Vec3,
    /// Sensor temperature, C.
    pub temperature_c: f64,
    /// Whether the whole second was in normal mode.
    pub normal: bool,
    /// The ranges the sensor truly had.
    pub true_ranges: [Range; 3],
}

/// An iterator over the seconds of a mission.
pub struct Flight<'a> {
    config: &'a MissionConfig,
    forces: &'a dyn QuasiSteady,
    schedule: Schedule,
    events: Vec<ScheduledEvent>,
    next_event: usize,
    next_segment: usize,
    clock_s: u32,
    end_s: u32,
    vibration: [Vibration; 3],
    temperature: Temperature,
    autorange: Autorange,
    onboard: OnBoard,
    jitter: Jitter,
    clocks: ChaCha8Rng,
    misreport: Option<(u32, u32)>,
    counters: Counters,
    was_calibrating: bool,
}

#[derive(Default)]
struct Counters {
    records: u16,
    bias_done: u16,
    scale_done: u16,
}

/// What is the same for all ten samples of a second.
struct Now {
    clock_s: u32,
    segment: Option<Segment>,
    ranges: [Range; 3],
    /// Bias in counts by axis and range.
    bias: [[f64; 3]; 3],
    asleep: bool,
}

impl<'a> Flight<'a> {
    /// An instrument in whatever acts on it; of the plan, orbit, attitudes and forces are not asked.
    pub fn new(config: &'a MissionConfig, forces: &'a dyn QuasiSteady) -> Self {
        let (start_s, end_s) = (config.start_clock_s, config.end_clock_s());
        let schedule = Schedule::new(&config.calibration, start_s, end_s, &config.faults);
        let misreport = misreport(&config.faults, &schedule);
        let mut events = schedule.events.clone();
        events.extend(plan_events(config));
        events.sort_by_key(|event| event.0);
        let next_event = events.partition_point(|event| event.0 < start_s);
        let first = config.calibration.first_id.saturating_sub(1);
        let every = config.calibration.scale_every.max(1);
        Self {
            vibration: std::array::from_fn(|axis| Vibration::new(&config.noise, config.seed, axis)),
            temperature: Temperature::new(config.temperature, config.seed, f64::from(start_s)),
            autorange: Autorange::new(),
            onboard: OnBoard::new(config.one_sided_on_board, start_s),
            jitter: Jitter { random: generator(config.seed, Purpose::Jitter), value: 0.0 },
            clocks: generator(config.seed, Purpose::Housekeeping),
            counters: Counters { records: 0, bias_done: first, scale_done: first.div_ceil(every) },
            was_calibrating: false,
            clock_s: start_s,
            next_segment: 0,
            config,
            forces,
            schedule,
            events,
            next_event,
            end_s,
            misreport,
        }
    }

    /// When the records misreport their range, if they do: instrument clock from, to.
    pub fn misreported(&self) -> Option<(u32, u32)> {
        self.misreport
    }

    /// The calibrations.
    pub fn schedule(&self) -> &Schedule {
        &self.schedule
    }

    fn segment(&mut self) -> Option<Segment> {
        let segments = &self.schedule.segments;
        while segments.get(self.next_segment).is_some_and(|s| s.until_s <= self.clock_s) {
            self.next_segment += 1;
        }
        segments.get(self.next_segment).copied().filter(|s| s.from_s <= self.clock_s)
    }

    fn shutdown_begun_s(&self) -> Option<u32> {
        self.config.faults.iter().find_map(|fault| match fault {
            Fault::Shutdown { at_clock_s } if *at_clock_s <= self.clock_s => Some(*at_clock_s),
            _ => None,
        })
    }

    fn misreporting(&self) -> bool {
        self.misreport.is_some_and(|(from_s, to_s)| (from_s..to_s).contains(&self.clock_s))
    }

    /// Ranges of this second as the sensor has them; autoranging's changes are told as events.
    fn ranges(&mut self, segment: Option<Segment>, changes: &mut Vec<(usize, Range)>) -> [Range; 3] {
        if let Some(segment) = segment {
            self.autorange.force(segment.range);
            self.was_calibrating = true;
            return [segment.range; 3];
        }
        if self.misreporting() {
            self.was_calibrating = false;
            self.autorange.force(Range::C);
            return [Range::A; 3];
        }
        let just_ended = std::mem::take(&mut self.was_calibrating);
        changes.extend(self.autorange.look(self.clock_s, just_ended));
        self.autorange.ranges()
    }

    /// The ten samples: counts, the true angle and rate of the table at their start, and the mean quasi-steady acceleration.
    fn samples(&mut self, now: &Now) -> ([[i16; 3]; SAMPLES_PER_RECORD], f64, f64, Vec3) {
        let mut counts = [[0i16; 3]; SAMPLES_PER_RECORD];
        let mut mean_ng = Vec3::zeros();
        let (mut angle_rad, mut rate_rad_s) = (0.0, 0.0);
        for (i, sample) in counts.iter_mut().enumerate() {
            let clock_s = f64::from(now.clock_s) + i as f64 * 0.1;
            let quasi_ng = self.forces.quasi_steady_ng(clock_s);
            mean_ng += quasi_ng;
            // a_body = (a_X, a_Z, -a_Y).
            let mut felt_ng = [quasi_ng.x, -quasi_ng.z, quasi_ng.y];
            for (felt, vibration) in felt_ng.iter_mut().zip(&mut self.vibration) {
                *felt += vibration.step(now.asleep);
            }
            if let Some(segment) = &now.segment {
                let rate = segment.rate_rad_s * (1.0 + self.jitter_share(segment));
                let angle = segment.angle_rad(clock_s);
                felt_ng = self.on_the_table(segment, angle, rate, felt_ng);
                if i == 0 {
                    (angle_rad, rate_rad_s) = (angle, rate);
                }
            }
            self.push_to_rails(clock_s, now, &mut felt_ng);
            *sample = self.counts(now, clock_s, &felt_ng);
        }
        (counts, angle_rad, rate_rad_s, mean_ng / SAMPLES_PER_RECORD as f64)
    }

    /// What the axes feel when the table has turned: the rotated vector, and the turn's own acceleration on the target axis.
    fn on_the_table(&self, segment: &Segment, angle_rad: f64, rate_rad_s: f64, felt_ng: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = felt_ng;
        let (sin, cos) = angle_rad.sin_cos();
        let mut turned = if segment.target == 1 {
            [x * cos + y * sin, -x * sin + y * cos, z]
        } else {
            [x, y * cos + z * sin, -y * sin + z * cos]
        };
        let axis = segment.target_axis();
        turned[axis] += self.config.instrument.radius_m[axis] * rate_rad_s * rate_rad_s / NANO_G_M_S2;
        turned
    }

    fn jitter_share(&mut self, segment: &Segment) -> f64 {
        let here = segment.mode == Mode::Scale
            && segment.step == Step::Rate
            && segment.target == 3
            && segment.range == Range::C;
        if !here {
            return 0.0;
        }
        let share = self.config.faults.iter().find_map(|fault| match fault {
            Fault::TableJitter { calibration_id, share }
                if *calibration_id == 0 || *calibration_id == segment.calibration_id =>
            {
                Some(*share)
            }
            _ => None,
        });
        share.map_or(0.0, |share| share * self.jitter.step())
    }

    fn push_to_rails(&self, clock_s: f64, now: &Now, felt_ng: &mut [f64; 3]) {
        for fault in &self.config.faults {
            if let Fault::Saturation { axis, from_clock_s, seconds } = fault
                && (*from_clock_s..from_clock_s + seconds).contains(&clock_s)
            {
                felt_ng[axis % 3] += RAIL_PUSH_NG;
            }
        }
        if let Some((_, to_s)) = self.misreport
            && (f64::from(to_s) - 1.0..f64::from(to_s) + 0.5).contains(&clock_s)
        {
            felt_ng[0] += RAIL_PUSH_NG;
        }
        if self.shutdown_begun_s().is_some_and(|begun_s| begun_s <= now.clock_s) {
            felt_ng[1] += RAIL_PUSH_NG;
        }
    }

    /// Counts in the present ranges, quantised and held at the rails; the autoranger is told what was felt.
    fn counts(&mut self, now: &Now, clock_s: f64, felt_ng: &[f64; 3]) -> [i16; 3] {
        let rail = f64::from(AccRecord::RAIL_COUNTS);
        let instrument = &self.config.instrument;
        std::array::from_fn(|axis| {
            let name = Axis::ALL[axis];
            let in_range =
                |range: Range| felt_ng[axis] / instrument.ng_per_count(name, range) + now.bias[axis][range.index()];
            self.autorange.feel(axis, clock_s, in_range(Range::C) / rail, in_range(Range::B) / rail);
            let range = now.ranges[axis];
            let extra = now.segment.map_or(0.0, |segment| self.extra_counts(&segment, clock_s, axis));
            (in_range(range) + extra).round().clamp(-rail, rail) as i16
        })
    }

    /// What calibrations add to the counts: settling, the electronic shift, a disturbed calibration.
    fn extra_counts(&self, segment: &Segment, clock_s: f64, axis: usize) -> f64 {
        let config = self.config;
        if segment.range != Range::C {
            return 0.0;
        }
        let mut extra = 0.0;
        if segment.mode == Mode::Bias && segment.target == 2 && segment.step == Step::Opposite {
            let since_s = clock_s - f64::from(segment.from_s);
            extra += config.instrument.settling_counts[axis] * (-since_s / config.instrument.settling_tau_s).exp();
        }
        for fault in &config.faults {
            match fault {
                Fault::ElectronicShift { z_counts }
                    if axis == 2
                        && segment.mode == Mode::Scale
                        && segment.target == 3
                        && segment.step == Step::PostRate =>
                {
                    extra += z_counts;
                }
                Fault::BiasOutlier { calibration_id, counts }
                    if *calibration_id == segment.calibration_id
                        && segment.mode == Mode::Bias
                        && (segment.target == 1) == (axis == 0) =>
                {
                    extra += counts[axis];
                }
                _ => {}
            }
        }
        extra
    }

    /// What steps of the bias of an axis have come to by this second, ng.
    fn stepped_ng(&self, axis: usize) -> f64 {
        let step = |fault: &Fault| match fault {
            Fault::BiasStep { axis: at, at_clock_s, ng } if *at % 3 == axis && *at_clock_s <= self.clock_s => *ng,
            _ => 0.0,
        };
        self.config.faults.iter().map(step).sum()
    }

    /// The Orbiter's clock at this second, as the record states it, ms since 1970.
    fn orbiter_unix_ms(&mut self) -> i64 {
        let config = self.config;
        let clock_s = f64::from(self.clock_s);
        let jumped_s: f64 = config
            .faults
            .iter()
            .filter_map(|fault| match fault {
                Fault::ClockJump { at_clock_s, jump_s } if *at_clock_s <= self.clock_s => Some(*jump_s),
                _ => None,
            })
            .sum();
        let normal: f64 = StandardNormal.sample(&mut self.clocks);
        let ahead_s = clock_s * config.clock_drift_ppm * 1e-6 + jumped_s + normal * config.clock_jitter_s;
        config.time.epoch_utc.as_millisecond() + ((clock_s + ahead_s) * 1000.0).round() as i64
    }

    /// Events of this second: those on the schedule, then the range changes.
    fn events(&mut self, changes: &[(usize, Range)]) -> Vec<Event> {
        let clock = Clock::from_tenths(i64::from(self.clock_s) * 10);
        let mut events = Vec::new();
        while let Some(&(at_s, code, argument, text)) = self.events.get(self.next_event).filter(|e| e.0 <= self.clock_s)
        {
            self.next_event += 1;
            match code {
                EventCode::BiasEnd => self.counters.bias_done += 1,
                EventCode::ScaleEnd => self.counters.scale_done += 1,
                _ => {}
            }
            if at_s == self.clock_s {
                events.push(Event { clock, code, argument, text: text.into() });
            }
        }
        events.extend(changes.iter().map(|(axis, range)| Event {
            clock,
            code: EventCode::RangeChange,
            argument: (axis * 256 + range.index()) as u32,
            text: String::new(),
        }));
        events
    }
}

impl Iterator for Flight<'_> {
    type Item = Second;

    fn next(&mut self) -> Option<Second> {
        let shutdown = self.shutdown_begun_s();
        if self.clock_s >= self.end_s || shutdown.is_some_and(|begun_s| self.clock_s > begun_s + SHUTDOWN_S) {
            return None;
        }
        let config = self.config;
        let (clock_s, met_h) = (self.clock_s, config.time.met_h(f64::from(self.clock_s)));
        let temperature_c = self.temperature.at(f64::from(clock_s), met_h);
        let segment = if shutdown.is_some() { None } else { self.segment() };
        let mode = match (&segment, shutdown) {
            (_, Some(_)) => Mode::Reentry,
            (Some(segment), _) => segment.mode,
            (None, None) => Mode::Normal,
        };
        let mut changes = Vec::new();
        let ranges = self.ranges(segment, &mut changes);
        let bias = std::array::from_fn(|axis| {
            std::array::from_fn(|range| {
                let (name, range) = (Axis::ALL[axis], Range::ALL[range]);
                let law = config.instrument.bias_counts(name, range, met_h, temperature_c);
                law + self.stepped_ng(axis) / config.instrument.ng_per_count(name, range)
            })
        });
        let now = Now { clock_s, segment, ranges, bias, asleep: config.noise.asleep(met_h) };
        let (counts, angle_rad, rate_rad_s, quasi_steady_ng) = self.samples(&now);
        let reported = if self.misreporting() && segment.is_none() { [Range::C; 3] } else { ranges };
        let acc = self.science_record(&now, mode, reported, counts, temperature_c);
        let events = self.events(&changes);
        let mut sent = vec![Sent { damage: self.damage(segment, true), record: Record::Acc(acc) }];
        let whole = |record| Sent { record, damage: None };
        if clock_s.is_multiple_of(10) {
            sent.push(whole(Record::Hsk(self.housekeeping(&acc, temperature_c))));
        }
        sent.extend(events.into_iter().map(|event| whole(Record::Evt(event))));
        if let Some(segment) = segment {
            let report = sent::table_report(&acc, &segment, angle_rad, rate_rad_s);
            sent.push(Sent { damage: self.damage(Some(segment), false), record: Record::Tbl(report) });
        }
        if mode == Mode::Normal {
            sent.extend(self.onboard.take(clock_s, &counts, reported).map(|e| whole(Record::Prc(e))));
        } else {
            self.onboard.interrupt();
        }
        self.clock_s += 1;
        Some(Second {
            clock_s,
            sent,
            quasi_steady_ng,
            temperature_c,
            normal: mode == Mode::Normal,
            true_ranges: ranges,
        })
    }
}

/// First-order wander of the table's rate, unit variance, half a second of memory.
struct Jitter {
    random: ChaCha8Rng,
    value: f64,
}

impl Jitter {
    fn step(&mut self) -> f64 {
        const KEEP: f64 = 0.818_730_753_077_981_9;
        let normal: f64 = StandardNormal.sample(&mut self.random);
        self.value = KEEP * self.value + (1.0 - KEEP * KEEP).sqrt() * normal;
        self.value
    }
}

/// Events of the plan that are no calibration's.
fn plan_events(config: &MissionConfig) -> Vec<ScheduledEvent> {
    let mut events =
        vec![(0, EventCode::PowerOn, 0, ""), (config.time.liftoff_clock_s as u32, EventCode::LiftOff, 0, "")];
    for (from_s, to_s) in &config.quiet {
        events.push((*from_s, EventCode::QuietOn, 0, ""));
        events.push((*to_s, EventCode::QuietOff, 0, ""));
    }
    for fault in &config.faults {
        if let Fault::Shutdown { at_clock_s } = fault {
            events.push((*at_clock_s, EventCode::ReentryAsserted, 4, ""));
            events.push((at_clock_s + SHUTDOWN_S, EventCode::Shutdown, 0, "re-capture duration error"));
        }
    }
    events
}

/// The misreported span: as planted, or from the first aborted scale calibration on.
fn misreport(faults: &[Fault], schedule: &Schedule) -> Option<(u32, u32)> {
    faults.iter().find_map(|fault| match fault {
        Fault::RangeMisreport { from_clock_s, seconds } => {
            let aborted = schedule.events.iter().find(|e| e.1 == EventCode::ScaleAborted).map(|e| e.0);
            let from_s = if *from_clock_s == 0 { aborted? } else { *from_clock_s };
            Some((from_s, from_s + seconds))
        }
        _ => None,
    })
}

//! The products as JSON: the border between the nouns of the pipeline and everybody's programs.
//!
//! The names are those of `windows.csv`; accelerations in ng with three decimals, an unknown value is `null`.

use std::borrow::Cow;

use serde::Serialize;
use utoipa::ToSchema;

use super::message::{Body, Message, Topic};
use super::told::Told;
use crate::pipeline::calibration::{Anomaly, Calibration};
use crate::pipeline::files::version_json;
use crate::pipeline::product::{BodyAcceleration, Component, Product};
use crate::telemetry::{AccRecord, Event, Range};
use crate::units::{Clock, MissionTime};

/// A clock in the three ways people read it.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Time {
    /// Instrument clock, s since power-on.
    pub clock_s: f64,
    /// Mission elapsed time, s since lift-off.
    pub met_s: f64,
    /// UTC by the nominal epoch of the mission, RFC 3339: the drift and the jumps of the clock that the dates in the records show stand in
    /// `calibration.json` (`time_correlation`), and are not in here.
    pub utc: String,
}

impl Time {
    /// A clock of a mission.
    pub fn new(mission: &MissionTime, clock: Clock) -> Self {
        let clock_s = clock.seconds();
        Self { clock_s, met_s: decimals(mission.met_s(clock_s), 1), utc: utc(mission, clock) }
    }
}

/// A span in the three ways people read a clock.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Span {
    /// Instrument clock at its beginning, s.
    pub from_clock_s: f64,
    /// Instrument clock at its end, s.
    pub to_clock_s: f64,
    /// Mission elapsed time at its beginning, s.
    pub from_met_s: f64,
    /// Mission elapsed time at its end, s.
    pub to_met_s: f64,
    /// UTC at its beginning.
    pub from_utc: String,
    /// UTC at its end.
    pub to_utc: String,
}

impl Span {
    /// A span of a mission.
    pub fn new(mission: &MissionTime, from: Clock, to: Clock) -> Self {
        let (from, to) = (Time::new(mission, from), Time::new(mission, to));
        Self {
            from_clock_s: from.clock_s,
            to_clock_s: to.clock_s,
            from_met_s: from.met_s,
            to_met_s: to.met_s,
            from_utc: from.utc,
            to_utc: to.utc,
        }
    }
}

/// RFC 3339 with milliseconds.
pub fn utc(mission: &MissionTime, clock: Clock) -> String {
    format!("{:.3}", mission.utc(clock.seconds()))
}

fn decimals(value: f64, decimals: i32) -> f64 {
    let scale = 10f64.powi(decimals);
    // Adding zero turns the negative zero into zero.
    (value * scale).round() / scale + 0.0
}

/// A body-axis acceleration, ng with three decimals; +X tail to nose, +Y to starboard, +Z down through the belly. `null`: unknown.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct BodyAxes {
    /// Quasi-steady acceleration from the adaptive trimmed mean, ng.
    pub ax_ng: Option<f64>,
    /// As `ax_ng`.
    pub ay_ng: Option<f64>,
    /// As `ax_ng`.
    pub az_ng: Option<f64>,
    /// One statistical standard error of `ax_ng`, ng.
    pub sigma_ax_ng: Option<f64>,
    /// Of `ay_ng`.
    pub sigma_ay_ng: Option<f64>,
    /// Of `az_ng`.
    pub sigma_az_ng: Option<f64>,
    /// The systematic part, to be added in quadrature, ng.
    pub sigma_sys_ax_ng: Option<f64>,
    /// Of `ay_ng`.
    pub sigma_sys_ay_ng: Option<f64>,
    /// Of `az_ng`.
    pub sigma_sys_az_ng: Option<f64>,
    /// From the plain mean of the window, ng.
    pub mean_ax_ng: Option<f64>,
    /// As `mean_ax_ng`.
    pub mean_ay_ng: Option<f64>,
    /// As `mean_ax_ng`.
    pub mean_az_ng: Option<f64>,
}

impl BodyAxes {
    /// The wire form of a product's acceleration.
    pub fn new(acceleration: &BodyAcceleration) -> Self {
        let of = |figure: fn(&Component) -> f64| acceleration.each(|axis| decimals(figure(axis), 3));
        let [ax_ng, ay_ng, az_ng] = of(|axis| axis.trimmed_ng);
        let [sigma_ax_ng, sigma_ay_ng, sigma_az_ng] = of(|axis| axis.sigma_ng);
        let [sigma_sys_ax_ng, sigma_sys_ay_ng, sigma_sys_az_ng] = of(|axis| axis.sigma_sys_ng);
        let [mean_ax_ng, mean_ay_ng, mean_az_ng] = of(|axis| axis.mean_ng);
        Self {
            ax_ng,
            ay_ng,
            az_ng,
            sigma_ax_ng,
            sigma_ay_ng,
            sigma_az_ng,
            sigma_sys_ax_ng,
            sigma_sys_ay_ng,
            sigma_sys_az_ng,
            mean_ax_ng,
            mean_ay_ng,
            mean_az_ng,
        }
    }
}

/// One window of 50 s, with the names of `windows.csv`. Times are those of its beginning; `a*`, `sigma*` and `mean*` are on body axes, `q_*`,
/// `trim_*` and `range_*` on those of the sensor, so that `range_z` belongs to `ay_ng` and `range_y` to `az_ng`.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Window {
    /// Instrument clock at its beginning, s.
    pub window_start_clock_s: f64,
    /// Mission elapsed time at its beginning, s.
    pub met_s: f64,
    /// UTC at its beginning, by the nominal epoch.
    pub utc: String,
    /// On body axes.
    #[serde(flatten)]
    pub acceleration: BodyAxes,
    /// Q of the adaptive trimmed mean, sensor axis X: how heavy the tails of the samples are.
    pub q_x: Option<f64>,
    /// As `q_x`.
    pub q_y: Option<f64>,
    /// As `q_x`.
    pub q_z: Option<f64>,
    /// Share of the samples trimmed at each end, sensor axis X.
    pub trim_x: Option<f64>,
    /// As `trim_x`.
    pub trim_y: Option<f64>,
    /// As `trim_x`.
    pub trim_z: Option<f64>,
    /// Range of sensor axis X, as corrected.
    pub range_x: Option<&'static str>,
    /// As `range_x`.
    pub range_y: Option<&'static str>,
    /// As `range_x`.
    pub range_z: Option<&'static str>,
    /// Samples that came down; 500 are whole. What is at the rail, of another range or taken while the table was away is among them, and
    /// in no value.
    pub samples: u16,
    /// Mean sensor temperature, C.
    pub temperature_c: Option<f64>,
    /// What the instrument was doing.
    pub mode: &'static str,
    /// `good`, or the reasons for care with `+` between: partial (fewer samples used than the window holds), gap (telemetry missing in it),
    /// saturated (samples at the rail left out), range_mixed (those of the most frequent range used), range_corrected (the records named a
    /// wrong one), table_moving (the table was away for a part of it, which was left out), uncalibrated (an axis without a calibration has no value), noisy (far more scatter
    /// than its neighbours), extrapolated (beyond the calibrations that support the bias).
    pub quality: String,
    /// Version of the calibration it is made with; 0 is none.
    pub calibration: u32,
    /// Hash of what it was made from and of its figures.
    pub revision: String,
    /// Instrument clock since which it can be known: of its last record, or of its calibration where that is later.
    pub known_since_clock_s: f64,
}

impl Window {
    /// The wire form of a product.
    pub fn new(mission: &MissionTime, product: &Product) -> Self {
        let [q_x, q_y, q_z] = product.q.map(|q| q.map(|q| decimals(q, 4)));
        let [trim_x, trim_y, trim_z] = product.trim.map(|trim| trim.map(|trim| decimals(trim, 4)));
        let [range_x, range_y, range_z] = product.range.map(|range| range.map(Range::letter));
        let Time { clock_s, met_s, utc } = Time::new(mission, product.start);
        Self {
            window_start_clock_s: clock_s,
            met_s,
            utc,
            acceleration: BodyAxes::new(&product.acceleration),
            q_x,
            q_y,
            q_z,
            trim_x,
            trim_y,
            trim_z,
            range_x,
            range_y,
            range_z,
            samples: product.samples,
            temperature_c: product.temperature_c.map(|c| decimals(c, 3)),
            mode: product.mode.word(),
            quality: product.quality.to_string(),
            calibration: product.calibration,
            revision: product.revision.to_string(),
            known_since_clock_s: product.known_since.seconds(),
        }
    }
}

/// One second of raw samples.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct RawSecond {
    /// Time of the first sample.
    #[serde(flatten)]
    pub time: Time,
    /// What the instrument was doing.
    pub mode: &'static str,
    /// Quiet asserted.
    pub quiet: bool,
    /// The table was moving.
    pub table_moving: bool,
    /// A sample is at the rail.
    pub at_rail: bool,
    /// Range of X, Y, Z (OARE axes) as reported.
    pub ranges: [&'static str; 3],
    /// Sensor temperature, C.
    pub temperature_c: f64,
    /// Ten samples of X, Y, Z (OARE axes), 0.1 s apart, counts.
    pub counts: [[i16; 3]; 10],
}

impl RawSecond {
    /// The wire form of a record.
    pub fn new(mission: &MissionTime, record: &AccRecord) -> Self {
        Self {
            time: Time::new(mission, record.clock),
            mode: record.mode.word(),
            quiet: record.quiet,
            table_moving: record.table_moving,
            at_rail: record.at_rail,
            ranges: record.ranges.map(Range::letter),
            temperature_c: decimals(f64::from(record.temperature_c), 3),
            counts: record.counts,
        }
    }
}

/// An event of the instrument.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct EventWire {
    /// When.
    #[serde(flatten)]
    pub time: Time,
    /// Code on the wire.
    pub code: u16,
    /// Its name; `other` for a code without one.
    pub event: &'static str,
    /// Its argument.
    pub argument: u32,
    /// Its text.
    pub text: String,
}

impl EventWire {
    /// The wire form of an event.
    pub fn new(mission: &MissionTime, event: &Event) -> Self {
        const NAMES: [&str; 14] = [
            "other",
            "power_on",
            "lift_off",
            "quiet_on",
            "quiet_off",
            "reentry_asserted",
            "reentry_cancelled",
            "bias_start",
            "bias_end",
            "scale_start",
            "scale_end",
            "scale_aborted",
            "range_change",
            "shutdown",
        ];
        let code = event.code.code();
        let name = NAMES.get(usize::from(code)).copied().unwrap_or(NAMES[0]);
        let time = Time::new(mission, event.clock);
        Self { time, code, event: name, argument: event.argument, text: event.text.clone() }
    }
}

/// A span that is not covered.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Gap {
    /// From the first second missing to the first that is there again.
    #[serde(flatten)]
    pub span: Span,
}

impl Gap {
    /// The wire form of a gap.
    pub fn new(mission: &MissionTime, from: Clock, to: Clock) -> Self {
        Self { span: Span::new(mission, from, to) }
    }
}

/// An anomaly, as in `anomalies.json`.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct AnomalyWire {
    /// Kind, as in `anomalies.json`.
    pub kind: &'static str,
    /// From when until when.
    #[serde(flatten)]
    pub span: Span,
    /// OARE axes concerned.
    pub axes: Vec<&'static str>,
    /// Size, in `unit`.
    pub value: f64,
    /// Its standard error.
    pub sigma: f64,
    /// Unit of both.
    pub unit: &'static str,
    /// One sentence for an operator.
    pub sentence: String,
}

impl AnomalyWire {
    /// The wire form of an anomaly.
    pub fn new(mission: &MissionTime, anomaly: &Anomaly) -> Self {
        Self {
            kind: anomaly.kind.word(),
            span: Span::new(mission, anomaly.from, anomaly.to),
            axes: anomaly.axes.iter().map(|axis| axis.letter()).collect(),
            value: anomaly.value,
            sigma: anomaly.sigma,
            unit: anomaly.unit,
            sentence: anomaly.sentence.clone(),
        }
    }
}

/// What is told whole of an event.
pub fn told_event(mission: &MissionTime, event: &Event) -> Body {
    Body::Told { topic: Topic::Event, clock: event.clock, json: members("event", &EventWire::new(mission, event)) }
}

/// What is told whole of an anomaly.
pub fn told_anomaly(mission: &MissionTime, anomaly: &Anomaly) -> Body {
    let json = members("anomaly", &AnomalyWire::new(mission, anomaly));
    Body::Told { topic: Topic::Anomaly, clock: anomaly.from, json }
}

/// How the members begin that tell of an anomaly.
const ANOMALY: &str = r#""type":"anomaly","#;
/// How those begin that take one back: the rest of them is the same.
const ANOMALY_WITHDRAWN: &str = r#""type":"anomaly_withdrawn","#;

/// What takes back an anomaly that was told.
pub fn withdrawn(told: Body) -> Body {
    match told {
        Body::Told { topic, clock, json } => {
            Body::Told { topic, clock, json: json.replacen(ANOMALY, ANOMALY_WITHDRAWN, 1) }
        }
        other => other,
    }
}

/// The JSON members of the anomaly that these take back, where they take back one.
pub fn withdrawn_by(members: &str) -> Option<String> {
    members.strip_prefix(ANOMALY_WITHDRAWN).map(|rest| format!("{ANOMALY}{rest}"))
}

/// A window that there is no longer.
#[derive(Serialize)]
struct WindowWithdrawn {
    window_start_clock_s: f64,
    met_s: f64,
    utc: String,
    revision: String,
}

/// What takes back a window that was told.
pub fn window_withdrawn(mission: &MissionTime, told: &Told) -> Body {
    let Time { clock_s, met_s, utc } = Time::new(mission, told.start);
    let gone = WindowWithdrawn { window_start_clock_s: clock_s, met_s, utc, revision: told.revision.to_string() };
    Body::Withdrawn { start: told.start, json: members("window_withdrawn", &gone) }
}

/// What is told whole of a version of the calibration.
pub fn told_calibration(version: &Calibration) -> Body {
    let json = members("calibration", &version_json(version));
    Body::Told { topic: Topic::Calibration, clock: version.known_since, json }
}

/// The JSON members of a message, its type first, without the braces.
pub fn members(kind: &str, value: &impl Serialize) -> String {
    let json = serde_json::to_string(value).expect("a wire type has text keys and no failing parts");
    let inside = json.trim_start_matches('{').strip_suffix('}').unwrap_or(&json);
    match inside {
        "" => format!("\"type\":\"{kind}\""),
        inside => format!("\"type\":\"{kind}\",{inside}"),
    }
}

/// The JSON members of a message, made once and shared by all who read it.
pub fn message_members<'a>(mission: &MissionTime, message: &'a Message) -> &'a [u8] {
    message.text.get_or_init(|| made_members(mission, message).into())
}

/// The JSON members of a message for one reader alone: made by another reader, or made and not kept.
pub fn passing_members<'a>(mission: &MissionTime, message: &'a Message) -> Cow<'a, [u8]> {
    match message.text.get() {
        Some(text) => Cow::Borrowed(text),
        None => Cow::Owned(made_members(mission, message).into_bytes()),
    }
}

fn made_members(mission: &MissionTime, message: &Message) -> String {
    match &message.body {
        Body::Window(product) => members("window", &Window::new(mission, product)),
        Body::Supersede(product, supersedes) => {
            let window = members("supersede", &Window::new(mission, product));
            match supersedes {
                Some(revision) => format!("{window},\"supersedes\":\"{revision}\""),
                None => window,
            }
        }
        Body::Second(record) => members("raw", &RawSecond::new(mission, record)),
        Body::Withdrawn { json, .. } | Body::Told { json, .. } => json.clone(),
    }
}

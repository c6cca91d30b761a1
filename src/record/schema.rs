//! JSON Schemas of the topics of a recording.

use serde_json::{Map, Value, json};

/// Members and their types: `number?` may be null.
type Members = &'static [(&'static str, &'static str)];

/// A window, with the names of `windows.csv`.
const WINDOW: Members = &[
    ("type", "string"),
    ("window_start_clock_s", "number"),
    ("met_s", "number"),
    ("utc", "string"),
    ("ax_ng", "number?"),
    ("ay_ng", "number?"),
    ("az_ng", "number?"),
    ("sigma_ax_ng", "number?"),
    ("sigma_ay_ng", "number?"),
    ("sigma_az_ng", "number?"),
    ("sigma_sys_ax_ng", "number?"),
    ("sigma_sys_ay_ng", "number?"),
    ("sigma_sys_az_ng", "number?"),
    ("mean_ax_ng", "number?"),
    ("mean_ay_ng", "number?"),
    ("mean_az_ng", "number?"),
    ("q_x", "number?"),
    ("q_y", "number?"),
    ("q_z", "number?"),
    ("trim_x", "number?"),
    ("trim_y", "number?"),
    ("trim_z", "number?"),
    ("range_x", "string?"),
    ("range_y", "string?"),
    ("range_z", "string?"),
    ("samples", "integer"),
    ("temperature_c", "number?"),
    ("mode", "string"),
    ("quality", "string"),
    ("calibration", "integer"),
    ("revision", "string"),
    ("known_since_clock_s", "number"),
];

const EVENT: Members = &[
    ("type", "string"),
    ("clock_s", "number"),
    ("met_s", "number"),
    ("utc", "string"),
    ("code", "integer"),
    ("event", "string"),
    ("argument", "integer"),
    ("text", "string"),
];

const ANOMALY: Members = &[
    ("type", "string"),
    ("kind", "string"),
    ("from_clock_s", "number"),
    ("to_clock_s", "number"),
    ("from_met_s", "number"),
    ("to_met_s", "number"),
    ("from_utc", "string"),
    ("to_utc", "string"),
    ("axes", "array"),
    ("value", "number"),
    ("sigma", "number"),
    ("unit", "string"),
    ("sentence", "string"),
];

const CALIBRATION: Members =
    &[("type", "string"), ("version", "integer"), ("known_since_clock_s", "number"), ("axes", "object")];

const DIAGNOSIS: Members = &[("type", "string")];

const FRAME: Members = &[
    ("playback", "integer"),
    ("direction", "string"),
    ("polarity", "string"),
    ("first_bit", "integer"),
    ("verdict", "string"),
    ("channel", "integer?"),
    ("count", "integer?"),
    ("clock_s", "number?"),
    ("octets", "base64"),
];

/// Every topic, with the name of its schema.
pub const TOPICS: [(&str, &str, Members); 6] = [
    (super::mcap_file::FRAME_TOPIC, "oare.Frame", FRAME),
    ("/accel/window", "oare.Window", WINDOW),
    ("/accel/calibration", "oare.Calibration", CALIBRATION),
    ("/accel/event", "oare.Event", EVENT),
    ("/accel/anomaly", "oare.Anomaly", ANOMALY),
    ("/accel/diagnosis", "oare.Diagnosis", DIAGNOSIS),
];

/// The JSON Schema of some members.
pub fn json_schema(title: &str, members: Members) -> Vec<u8> {
    let properties: Map<String, Value> = members.iter().map(|(name, kind)| ((*name).into(), property(kind))).collect();
    let schema = json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": title,
        "type": "object",
        "properties": properties,
    });
    schema.to_string().into_bytes()
}

fn property(kind: &str) -> Value {
    match (kind, kind.strip_suffix('?')) {
        ("base64", _) => json!({"type": "string", "contentEncoding": "base64"}),
        (_, Some(kind)) => json!({"type": [kind, "null"]}),
        _ => json!({"type": kind}),
    }
}

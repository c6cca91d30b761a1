//! What must be known of what was given: windows left out, a log of another clock or spelling, deviations that do not hold. Not here: what was
//! found in it.

use crate::diagnose::bursts::OUT;
use crate::diagnose::case::{Event, KINDS_TRIED, SPIKE, unresolved};
use crate::diagnose::catalogue::LOGGED_KINDS;
use crate::diagnose::noise::Contradicted;
use crate::diagnose::scene::Scene;

/// A log all of whose entries are farther from the recording may be of another clock, s.
const LOG_AWAY_S: f64 = 2.0 * 86_400.0;

/// Share of the swing of the body rates that must be missed between rows for it to be told.
const UNRESOLVED: f64 = 0.02;

/// All of it, in sentences.
pub fn of_inputs(scene: &Scene) -> Vec<String> {
    let mut notes: Vec<String> = scene.case.recording.not_come.iter().cloned().collect();
    notes.extend(of_windows(scene));
    notes.extend(of_the_motion(scene));
    notes.extend(of_the_log(scene));
    notes.extend(of_the_noise(scene));
    notes
}

/// Windows that are not compared.
fn of_windows(scene: &Scene) -> Vec<String> {
    let case = scene.case;
    let spikes =
        |they| format!("left out: {they} alone, more than {SPIKE} standard deviations from those before and after");
    let told = [
        (
            case.windows_beyond,
            ["window of the span is", "windows of the span are"],
            "not compared: before or after what simulation and ancillary data have".to_owned(),
        ),
        (case.windows_in_holes, WINDOWS, "left out: simulation or ancillary data have a hole there".to_owned()),
        (
            case.windows_too_rough,
            WINDOWS,
            "left out: the simulation changes too fast there for its own grid".to_owned(),
        ),
        (case.windows_frozen, WINDOWS, "left out: an axis repeats the same value there, or all three do".to_owned()),
        (case.windows_of_spikes, WINDOWS, spikes(if case.windows_of_spikes == 1 { "it stands" } else { "they stand" })),
    ];
    let some = told.iter().filter(|(count, ..)| *count > 0);
    some.map(|(count, [one, many], why)| format!("{count} {} {why}", if *count == 1 { one } else { many })).collect()
}

/// A window, and more than one.
const WINDOWS: [&str; 2] = ["window is", "windows are"];

/// Rows of ancillary data that are too few for the motion.
fn of_the_motion(scene: &Scene) -> Option<String> {
    let share = unresolved(&scene.case.ancillary);
    (share > UNRESOLVED).then(|| {
        format!(
            "the vehicle's rates change faster than the rows of the ancillary data tell: what comes of their changes (rotation, an offset of the \
             sensor) is known to some {:.0} % alone, whatever its error says",
            100.0 * share
        )
    })
}

/// A log of more kinds than are tried, of another spelling, or of another clock.
fn of_the_log(scene: &Scene) -> Vec<String> {
    let kinds = scene.case.kinds();
    let mut notes: Vec<String> = kinds.iter().filter_map(|kind| misspelt(kind)).collect();
    if kinds.len() > KINDS_TRIED {
        notes.push(format!(
            "the log has {} kinds of entries: formulas are made of the {KINDS_TRIED} with most entries alone",
            kinds.len()
        ));
    }
    let [start_s, end_s] = scene.span_s();
    let events = &scene.case.events;
    let far = |e: &Event| e.clock_s > end_s + LOG_AWAY_S || e.clock_s + e.duration_s < start_s - LOG_AWAY_S;
    if !events.is_empty() && events.iter().all(far) {
        notes.push(format!(
            "none of the {} entries of the log is within {} days of the recording: it may be of another clock",
            events.len(),
            LOG_AWAY_S / 86_400.0
        ));
    }
    let moments = events.iter().filter(|e| e.duration_s == 0.0 && LOGGED_KINDS.contains(&e.kind.as_str())).count();
    if moments > 0 {
        notes.push(format!(
            "{} of the log {} no time at all: whatever goes on for as long has no windows",
            if moments == 1 { "an entry".to_owned() } else { format!("{moments} entries") },
            if moments == 1 { "lasts" } else { "last" }
        ));
    }
    notes
}

/// A kind that is one of the catalogue's but for how it is written.
fn misspelt(kind: &str) -> Option<String> {
    let plain = kind.trim().to_lowercase().replace([' ', '-'], "_");
    let listed = LOGGED_KINDS.iter().find(|listed| **listed == plain && **listed != kind)?;
    Some(format!(
        "the log's \"{kind}\" is no kind that the catalogue goes by, and a kind of its own here: is it {listed}?"
    ))
}

/// Deviations and a log that the windows contradict, and values out of the ordinary.
fn of_the_noise(scene: &Scene) -> Vec<String> {
    let axes = || ["x", "y", "z"].iter().zip(scene.contradicted);
    let mut notes = Vec::new();
    for (axis, contradicted) in axes() {
        if let Some(Contradicted::Crew { said, shown }) = contradicted {
            notes.push(format!(
                "the noise of axis {axis} is taken as {shown:.2} times as loud with the crew awake as asleep, which its windows show: \
                 their deviations say {said:.2}"
            ));
        }
    }
    let listed = |of: fn(Contradicted) -> Option<[f64; 2]>| {
        let one = |(axis, contradicted): (&&str, Option<Contradicted>)| {
            let [quietest, loudest] = of(contradicted?)?;
            Some(format!("{axis} {quietest:.2} to {loudest:.2}"))
        };
        let all: Vec<String> = axes().filter_map(one).collect();
        (!all.is_empty()).then(|| all.join(", "))
    };
    notes.extend(listed(Contradicted::of_deviations).map(|levels| {
        format!(
            "the noise changes by more than the crew's sleep says: the deviations show when, the windows agree, and it is taken as so many \
             times as loud as in the middle stretch: {levels}"
        )
    }));
    notes.extend(listed(Contradicted::of_half_hours).map(|levels| {
        format!(
            "the noise is louder in some half hours than the crew's sleep and the deviations say, as the windows show, and is taken so, \
             so many times as loud as in the middle one: {levels}"
        )
    }));
    let bursts: usize =
        scene.loudness.iter().map(|axis| (0..axis.burst.len()).filter(|i| axis.is_odd(*i)).count()).sum();
    if bursts > 0 {
        notes.push(format!(
            "{bursts} {} less: more than {OUT} standard deviations of the noise",
            if bursts == 1 { "value out of the ordinary weighs" } else { "values out of the ordinary weigh" }
        ));
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_written_otherwise_is_asked_about() {
        assert!(misspelt("Water Dump").unwrap().ends_with("is it water_dump?"));
        assert!(misspelt("water_dump").is_none() && misspelt("treadmill").is_none());
    }
}

//! Faults of the instrument that the calibration found in a dump: told all of them, and named where the catalogue lists them and the
//! instrument did not answer them as it is meant to.
//!
//! They are no matter of evidence against noise: the records themselves, their ranges and rails, say so, and the calibration has a
//! bound of its own for false ones.

use crate::diagnose::answer::{Diagnosis, EffectAnswer, Interval, ParameterAnswer, Source, Verdict};
use crate::diagnose::case::{Fault, HALF_WINDOW_S};
use crate::diagnose::scene::Scene;
use crate::pipeline::calibration::{AnomalyKind, FALSE_PER_MISSION};

/// Records are a second apart.
const RECORD_S: f64 = 1.0;

/// Tells the faults within the windows, and names what the case format lists; of several of a kind the longest. One that goes on after a
/// stretch without windows, as the table's calibrations are, is one fault.
pub fn tell(answer: &mut Diagnosis, scene: &Scene) {
    let [start_s, end_s] = scene.span_s();
    let here = |fault: &&Fault| fault.span_s[0] < end_s && fault.span_s[1] > start_s && !is_usual(fault.kind);
    let faults: Vec<&Fault> = scene.case.recording.faults.iter().filter(here).collect();
    answer.notes.extend(faults.iter().map(|fault| fault.sentence.clone()));
    if answer.verdict == Verdict::Unexplained {
        return;
    }
    for (kind, name) in NAMED {
        let is_one = |fault: &&&Fault| fault.kind == kind && !fault.answered && !ends_another(fault, &faults);
        let joined = joined(faults.iter().filter(is_one).copied(), scene.clock_s());
        let Some((longest, [from_s, to_s])) =
            joined.into_iter().max_by(|(_, a), (_, b)| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))
        else {
            continue;
        };
        let parameter = |name: &str, value: f64| {
            let sigma = RECORD_S.max(without_windows_s(scene.clock_s(), value) / 12f64.sqrt());
            ParameterAnswer { name: name.into(), value, sigma, unit: "s".into() }
        };
        answer.effects.push(EffectAnswer {
            id: kind.word().into(),
            name: name.into(),
            posterior: 1.0 - FALSE_PER_MISSION,
            parameters: vec![parameter("from_clock_s", from_s), parameter("to_clock_s", to_s)],
            axis: None,
            why: longest.sentence.clone(),
            rms_ng: None,
        });
        answer.located.intervals.push(Interval { start_s: from_s, end_s: to_s, why: "fault of the instrument".into() });
        answer.effects.sort_by(|a, b| b.posterior.total_cmp(&a.posterior));
        if FALSE_PER_MISSION < answer.false_alarm_probability {
            answer.false_alarm_probability = FALSE_PER_MISSION;
            answer.false_alarm_from = Some(Source::Calibration);
        }
        if answer.verdict == Verdict::Consistent {
            // What came nearest to a claim beside noise is no other explanation of the fault.
            answer.alternatives.clear();
            answer.verdict = Verdict::Explained;
        }
    }
}

/// Faults in order of time, those that no window parts joined to one: the longest of them, and the span of all.
fn joined<'a>(faults: impl Iterator<Item = &'a Fault>, clock_s: &[f64]) -> Vec<(&'a Fault, [f64; 2])> {
    let length_s = |fault: &Fault| fault.span_s[1] - fault.span_s[0];
    let mut joined: Vec<(&Fault, [f64; 2])> = Vec::new();
    for fault in faults {
        let parts = |to_s: f64, t: f64| to_s + HALF_WINDOW_S <= t && t <= fault.span_s[0] - HALF_WINDOW_S;
        match joined.last_mut() {
            Some((longest, [_, to_s])) if !clock_s.iter().any(|t| parts(*to_s, *t)) => {
                *to_s = to_s.max(fault.span_s[1]);
                *longest = if length_s(fault) > length_s(longest) { fault } else { longest };
            }
            _ => joined.push((fault, fault.span_s)),
        }
    }
    joined
}

/// How long nothing is recorded about the end of a span: what ends in there, or begins, cannot be seen to. Zero where windows follow on
/// each other.
fn without_windows_s(clock_s: &[f64], end_s: f64) -> f64 {
    let after = clock_s.partition_point(|t| *t < end_s);
    let (Some(before), Some(after)) = (after.checked_sub(1).map(|i| clock_s[i]), clock_s.get(after)) else {
        return 0.0;
    };
    let hole_s = after - before - 2.0 * HALF_WINDOW_S;
    if hole_s > 2.0 * HALF_WINDOW_S { hole_s } else { 0.0 }
}

/// Those that are effects of the catalogue, and their names for people.
const NAMED: [(AnomalyKind, &str); 2] = [
    (AnomalyKind::RangeMisreport, "Records that name a wrong range"),
    (AnomalyKind::Saturation, "A channel at its rail"),
];

/// A rail within or at the end of a span of wrong ranges is a part of that fault: it is what makes the instrument look at its range.
fn ends_another(fault: &Fault, all: &[&Fault]) -> bool {
    let begins_s = fault.span_s[0];
    let holds = |[from_s, to_s]: [f64; 2]| from_s <= begins_s + RECORD_S && begins_s <= to_s + RECORD_S;
    fault.kind == AnomalyKind::Saturation
        && all.iter().any(|other| other.kind == AnomalyKind::RangeMisreport && holds(other.span_s))
}

/// What every flight has, and what no window keeps: the calibration takes them away.
fn is_usual(kind: AnomalyKind) -> bool {
    matches!(kind, AnomalyKind::SettlingTransient | AnomalyKind::OneSidedTrim)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(from_s: f64, to_s: f64) -> Fault {
        Fault { kind: AnomalyKind::RangeMisreport, span_s: [from_s, to_s], sentence: String::new(), answered: false }
    }

    #[test]
    fn a_fault_that_a_calibration_cuts_is_one_and_one_that_a_window_parts_is_two() {
        // Windows every 25 s but for a calibration from 5120 to 6020 s.
        let clock_s: Vec<f64> = (0..400).map(|i| 25.0 * f64::from(i)).filter(|t| *t < 5095.0 || *t > 6045.0).collect();
        let faults = [fault(1000.0, 1200.0), fault(4000.0, 5120.0), fault(6020.0, 7200.0), fault(7300.0, 7400.0)];
        let joined = joined(faults.iter(), &clock_s);
        let spans: Vec<[f64; 2]> = joined.iter().map(|(_, span)| *span).collect();
        assert_eq!(spans, [[1000.0, 1200.0], [4000.0, 7200.0], [7300.0, 7400.0]]);
        assert_eq!(joined[1].0.span_s, [6020.0, 7200.0], "the longest speaks for it");
        // An end that a calibration hides is known to that; any other to a record.
        assert_eq!(without_windows_s(&clock_s, 5120.0), 925.0);
        assert_eq!(without_windows_s(&clock_s, 7200.0), 0.0);
    }
}

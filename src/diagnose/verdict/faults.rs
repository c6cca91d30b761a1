//! Faults of the instrument that the calibration found in a dump: told all of them, and named where the catalogue lists them and the
//! instrument did not answer them as it is meant to.
//!
//! They are no matter of evidence against noise: the records themselves, their ranges and rails, say so, and the calibration has a
//! bound of its own for false ones.

use crate::diagnose::answer::{Diagnosis, EffectAnswer, Interval, ParameterAnswer, Source, Verdict};
use crate::diagnose::case::Fault;
use crate::diagnose::scene::Scene;
use crate::pipeline::calibration::{AnomalyKind, FALSE_PER_MISSION};

/// Records are a second apart.
const RECORD_S: f64 = 1.0;

/// Tells the faults within the windows, and names what the case format lists; of several of a kind the longest.
pub fn tell(answer: &mut Diagnosis, scene: &Scene) {
    let [start_s, end_s] = scene.span_s();
    let here = |fault: &&Fault| fault.span_s[0] < end_s && fault.span_s[1] > start_s && !is_usual(fault.kind);
    let faults: Vec<&Fault> = scene.case.recording.faults.iter().filter(here).collect();
    answer.notes.extend(faults.iter().map(|fault| fault.sentence.clone()));
    if answer.verdict == Verdict::Unexplained {
        return;
    }
    for (kind, name) in NAMED {
        let length_s = |fault: &Fault| fault.span_s[1] - fault.span_s[0];
        let is_one = |fault: &&&Fault| fault.kind == kind && !fault.answered && !ends_another(fault, &faults);
        let of_kind = faults.iter().filter(is_one);
        let Some(longest) = of_kind.max_by(|a, b| length_s(a).total_cmp(&length_s(b))) else { continue };
        let [from_s, to_s] = longest.span_s;
        let parameter =
            |name: &str, value: f64| ParameterAnswer { name: name.into(), value, sigma: RECORD_S, unit: "s".into() };
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

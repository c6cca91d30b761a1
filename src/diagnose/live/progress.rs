//! How far the running diagnosis is, and what it tells: the members of `diagnosis.json` and its progress.

use serde::{Deserialize, Serialize, Serializer};
use utoipa::ToSchema;

use crate::diagnose::answer::{Diagnosis, Located, Verdict};
use crate::diagnose::case::WINDOWS_MIN;
use crate::diagnose::recorder::Seen;

/// Looks kept for readers.
const LOOKS_MAX: usize = 100;

/// What was seen at one look.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Look {
    /// Windows looked at.
    pub windows: usize,
    /// Centre of the last of them, instrument clock.
    pub last_clock_s: f64,
    /// The verdict.
    pub verdict: Verdict,
    /// The effects named.
    pub named: Vec<String>,
    /// Log posterior odds of the best hypothesis against nothing.
    pub log_odds: f64,
}

/// When something was found, as far as it stands. Lasts over restarts.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Milestones {
    /// Looks taken; the same windows looked at again are one look.
    pub searches: u64,
    /// Last window of the first look of the alarm that stands.
    pub alarm_clock_s: Option<f64>,
    /// Last window of the first look that gave the name that stands.
    pub name_clock_s: Option<f64>,
    /// The name that stands; empty where there is none.
    pub name: Vec<String>,
    /// The windows of the look that raised the alarm came down at once, more than a search waits for, or after later ones: the time to
    /// detect is the playback's.
    #[serde(default)]
    pub alarm_came_at_once: bool,
    /// The same of the look that gave the name.
    #[serde(default)]
    pub name_came_at_once: bool,
    /// Alarms that a later look took back.
    pub alarms_withdrawn: u64,
    /// Looks that failed, by a defect of the program.
    #[serde(default)]
    pub searches_failed: u64,
}

impl Milestones {
    /// Takes what a look found.
    pub(super) fn take(&mut self, found: Found<'_>) {
        let Found { verdict, named, last_clock_s, is_another, came_at_once } = found;
        self.searches += u64::from(is_another);
        if verdict == Verdict::Consistent {
            self.alarms_withdrawn += u64::from(self.alarm_clock_s.is_some());
            self.alarm_clock_s = None;
            self.alarm_came_at_once = false;
        } else if self.alarm_clock_s.is_none() {
            self.alarm_clock_s = Some(last_clock_s);
            self.alarm_came_at_once = came_at_once;
        }
        // One name is one set, told without a rival.
        let mut name = if verdict == Verdict::Explained { named.to_vec() } else { Vec::new() };
        name.sort_unstable();
        if name != self.name {
            self.name_clock_s = (!name.is_empty()).then_some(last_clock_s);
            self.name_came_at_once = came_at_once && !name.is_empty();
            self.name = name;
        }
    }
}

/// What a look found, and of which windows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Found<'a> {
    pub(super) verdict: Verdict,
    pub(super) named: &'a [String],
    pub(super) last_clock_s: f64,
    /// Not the windows of the look before once more.
    pub(super) is_another: bool,
    /// More windows were new than a search waits for, or they came after later ones.
    pub(super) came_at_once: bool,
}

/// Where the running diagnosis is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = DiagnosisState)]
pub enum State {
    /// Too few windows for any answer.
    Collecting,
    /// A search is under way, or the first since the start is to come.
    Searching,
    /// The answer holds for all windows but the newest few.
    Current,
    /// The windows so far cannot be compared with the simulation; the sentence says why, and there is no answer.
    Refused,
    /// The last search failed, by a defect of the program: the answer is that of the look before.
    Failed,
}

impl State {
    /// Every state.
    pub const ALL: [Self; 5] = [Self::Collecting, Self::Searching, Self::Current, Self::Refused, Self::Failed];

    /// The word that stands for it in every answer.
    pub fn word(self) -> &'static str {
        match self {
            Self::Collecting => "collecting",
            Self::Searching => "searching",
            Self::Current => "current",
            Self::Refused => "refused",
            Self::Failed => "failed",
        }
    }
}

/// What times are counted from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum CountedFrom {
    /// The onset of the earliest effect named, where each has a beginning: its own or in the log.
    Onset,
    /// The start in the log of the earliest, where each has a beginning.
    LoggedStart,
    /// The first window.
    FirstData,
}

/// How far it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Progress {
    /// Where it is.
    pub state: State,
    /// One or two sentences for an operator.
    pub sentence: String,
    /// Usable windows known.
    pub windows_seen: usize,
    /// Of those, windows beyond simulation, ancillary data or the span of the case: they are not compared.
    #[serde(default)]
    pub windows_beyond: usize,
    /// Of the others, windows the answer rests on.
    pub windows_searched: usize,
    /// Centre of the first window the answer rests on.
    pub first_clock_s: Option<f64>,
    /// Centre of the last one: the answer is as of here.
    pub last_clock_s: Option<f64>,
    /// Digest of the revisions of the products it rests on.
    pub revision: String,
    /// Version of the calibration they were made with.
    pub calibration: u32,
    /// Digest of what the windows are compared with: simulation, ancillary data, log, case and claim.
    pub inputs: String,
    /// Whether the answer rests on every window seen that can be compared, and on nothing else: it is then that of `oare diagnose`, whatever
    /// came before. So it is as soon as nothing more comes.
    pub at_rest: bool,
    /// Recording seconds from the effect's onset, its logged start or the first data to the last window of the look that raised the alarm.
    pub time_to_detect_s: Option<f64>,
    /// To the look that gave the name that stands; of several effects from the beginning of the last, before which there was no such set.
    pub time_to_name_s: Option<f64>,
    /// What the time to detect is counted from.
    pub counted_from: CountedFrom,
    /// Instrument clock it is counted from.
    pub counted_from_clock_s: Option<f64>,
    /// Instrument clock that the time to name is counted from.
    #[serde(default)]
    pub name_counted_from_clock_s: Option<f64>,
    /// When something was found.
    #[serde(flatten)]
    pub milestones: Milestones,
    /// The last looks, oldest first; of a message, the last one alone.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub looks: Vec<Look>,
}

/// The answer so far and how far it is: the members of `diagnosis.json`, and `progress`.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// The case's id.
    pub case: String,
    /// The answer; none before the first search, nor where the windows cannot be compared. Its verdict is then null.
    pub answer: Option<Diagnosis>,
    /// How far it is.
    pub progress: Progress,
}

impl Report {
    /// No answer yet.
    pub fn waiting(case: &str, inputs: u64) -> Self {
        Self::without_answer(case, inputs, State::Collecting, waiting_sentence(0))
    }

    /// No answer will come.
    pub fn refused(case: &str, inputs: u64, why: String) -> Self {
        Self::without_answer(case, inputs, State::Refused, why)
    }

    fn without_answer(case: &str, inputs: u64, state: State, sentence: String) -> Self {
        let progress = Progress {
            state,
            sentence,
            windows_seen: 0,
            windows_beyond: 0,
            windows_searched: 0,
            first_clock_s: None,
            last_clock_s: None,
            revision: digits(0),
            calibration: 0,
            inputs: digits(inputs),
            at_rest: false,
            time_to_detect_s: None,
            time_to_name_s: None,
            counted_from: CountedFrom::FirstData,
            counted_from_clock_s: None,
            name_counted_from_clock_s: None,
            milestones: Milestones::default(),
            looks: Vec::new(),
        };
        Self { case: case.into(), answer: None, progress }
    }

    /// What earlier runs told of the same inputs, out of the JSON of all that any told, in order: the last of it, with the looks of all.
    pub fn kept(case: &str, inputs: u64, told: impl IntoIterator<Item = impl AsRef<str>>) -> Option<Self> {
        let of_inputs = |json| {
            let kept: Kept = serde_json::from_str(AsRef::as_ref(&json)).ok()?;
            (kept.progress.inputs == digits(inputs)).then_some(kept)
        };
        let mut last: Option<Kept> = None;
        for mut next in told.into_iter().filter_map(of_inputs) {
            if let Some(before) = last {
                let newest = std::mem::replace(&mut next.progress.looks, before.progress.looks);
                let is_another = next.progress.milestones.searches != before.progress.milestones.searches;
                newest.into_iter().for_each(|look| add(&mut next.progress.looks, look, is_another));
            }
            last = Some(next);
        }
        last.map(|Kept { answer, progress }| Self { case: case.into(), answer, progress })
    }

    /// What an earlier run told, as it stands before the first search of this one.
    pub fn taken_up(&self) -> Self {
        let mut report = self.clone();
        let progress = &mut report.progress;
        progress.at_rest = false;
        (progress.state, progress.sentence) = match (&self.answer, progress.state) {
            (None, _) => (State::Collecting, waiting_sentence(0)),
            (Some(_), State::Failed) => (State::Searching, "All windows are searched again.".into()),
            (Some(_), _) => (
                State::Searching,
                format!("{} So it was before the start; all windows are searched again.", progress.sentence),
            ),
        };
        report
    }

    /// Whether readers who know another report learn something of this one.
    pub fn is_news_after(&self, told: Option<&Self>) -> bool {
        let said = |report: &Self| {
            let progress = &report.progress;
            (progress.state, progress.revision.clone(), progress.windows_beyond > 0)
        };
        told.is_none_or(|told| said(told) != said(self) || told.answer != self.answer)
    }
}

/// What is read of a report that was told.
#[derive(Deserialize)]
struct Kept {
    #[serde(flatten)]
    answer: Option<Diagnosis>,
    progress: Progress,
}

/// Adds a look to those before; one at the same windows as the last takes its place.
pub(super) fn add(looks: &mut Vec<Look>, look: Look, is_another: bool) {
    if !is_another {
        looks.pop();
    }
    looks.push(look);
    if looks.len() > LOOKS_MAX {
        looks.remove(0);
    }
}

/// A digest as it is told.
pub(super) fn digits(digest: u64) -> String {
    format!("{digest:016x}")
}

pub(super) fn waiting_sentence(windows: usize) -> String {
    match windows < WINDOWS_MIN {
        true => format!("{windows} usable windows so far; {WINDOWS_MIN} are needed before anything can be said."),
        false => format!("{windows} usable windows so far, and nothing can be said before the first search."),
    }
}

/// What a report says beside all else where some windows are not compared.
pub(super) fn beyond_sentence(seen: &Seen, [first_s, last_s]: [f64; 2]) -> String {
    let Seen { windows, beyond, .. } = seen;
    format!(
        " {beyond} of {} usable windows are not compared: simulation, ancillary data and case have clock {first_s:.0} to {last_s:.0} s in \
         common, and these are beyond.",
        windows + beyond
    )
}

impl Serialize for Report {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let answer = match &self.answer {
            Some(diagnosis) => Members::Answer(diagnosis),
            None => Members::None(Unanswered::of(&self.case)),
        };
        Told { answer, progress: &self.progress }.serialize(serializer)
    }
}

#[derive(Serialize)]
struct Told<'a> {
    #[serde(flatten)]
    answer: Members<'a>,
    progress: &'a Progress,
}

#[derive(Serialize)]
#[serde(untagged)]
enum Members<'a> {
    Answer(&'a Diagnosis),
    None(Unanswered<'a>),
}

/// The members that every [`Diagnosis`] has, where there is none.
#[derive(Serialize)]
struct Unanswered<'a> {
    schema: &'static str,
    case: &'a str,
    verdict: Option<Verdict>,
    false_alarm_probability: Option<f64>,
    located: Located,
    effects: [(); 0],
    alternatives: [(); 0],
    hypothesis: (),
    upper_limits: [(); 0],
    separating_observation: (),
    cannot_tell_apart: [(); 0],
    arcs: [(); 0],
}

impl<'a> Unanswered<'a> {
    fn of(case: &'a str) -> Self {
        Self {
            schema: "oare.diagnosis/1",
            case,
            verdict: None,
            false_alarm_probability: None,
            located: Located { frame: "body".into(), ..Located::default() },
            effects: [],
            alternatives: [],
            hypothesis: (),
            upper_limits: [],
            separating_observation: (),
            cannot_tell_apart: [],
            arcs: [],
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in crate::diagnose::live) fn named(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| name.to_string()).collect()
    }

    pub(in crate::diagnose::live) fn take(
        m: &mut Milestones,
        verdict: Verdict,
        names: &[&str],
        last_clock_s: f64,
        is_another: bool,
    ) {
        m.take(Found { verdict, named: &named(names), last_clock_s, is_another, came_at_once: false });
    }

    #[test]
    fn what_came_at_once_is_marked_as_long_as_it_stands() {
        let mut m = Milestones::default();
        let found = |verdict, last_clock_s, came_at_once| Found {
            verdict,
            named: &[],
            last_clock_s,
            is_another: true,
            came_at_once,
        };
        m.take(found(Verdict::Unexplained, 100.0, true));
        m.take(found(Verdict::Unexplained, 200.0, false));
        assert!(m.alarm_came_at_once && !m.name_came_at_once);
        m.take(found(Verdict::Consistent, 300.0, true));
        assert!(!m.alarm_came_at_once);
    }

    #[test]
    fn an_alarm_and_a_name_count_from_the_first_look_of_an_unbroken_run() {
        let mut m = Milestones::default();
        take(&mut m, Verdict::Consistent, &[], 100.0, true);
        take(&mut m, Verdict::Unexplained, &[], 200.0, true);
        take(&mut m, Verdict::Explained, &["vent_leak"], 300.0, true);
        take(&mut m, Verdict::Explained, &["vent_leak"], 400.0, true);
        take(&mut m, Verdict::Explained, &["vent_leak"], 400.0, false);
        assert_eq!((m.alarm_clock_s, m.name_clock_s, m.alarms_withdrawn), (Some(200.0), Some(300.0), 0));
        take(&mut m, Verdict::Ambiguous, &["vent_leak"], 500.0, true);
        assert_eq!((m.alarm_clock_s, m.name_clock_s), (Some(200.0), None), "a set with a rival is no name");
        take(&mut m, Verdict::Explained, &["water_dump", "vent_leak"], 600.0, true);
        take(&mut m, Verdict::Explained, &["vent_leak", "water_dump"], 700.0, true);
        assert_eq!(m.name_clock_s, Some(600.0), "the order of names is no difference");
        take(&mut m, Verdict::Consistent, &[], 800.0, true);
        assert_eq!((m.alarm_clock_s, m.name_clock_s, m.alarms_withdrawn, m.searches), (None, None, 1, 8));
    }

    /// A report as it is told after look `n`, of windows up to a clock.
    pub(in crate::diagnose::live) fn told(inputs: u64, n: u64, verdict: Verdict, clock_s: f64) -> Report {
        let mut report = Report::waiting("leak", inputs);
        let diagnosis = Diagnosis { verdict, ..Diagnosis::nothing("leak", 0.1 + 0.2) };
        let progress = &mut report.progress;
        (progress.state, progress.last_clock_s) = (State::Current, Some(clock_s));
        progress.milestones.searches = n - 1;
        take(&mut progress.milestones, verdict, &[], clock_s, true);
        let windows = 200 + n as usize;
        progress.looks = vec![Look { windows, last_clock_s: clock_s, verdict, named: vec![], log_odds: 1.0 }];
        Report { answer: Some(diagnosis), ..report }
    }

    #[test]
    fn without_an_answer_there_is_no_verdict_and_every_other_member() {
        let json = serde_json::to_value(Report::waiting("leak", 1)).unwrap();
        assert_eq!((&json["verdict"], &json["false_alarm_probability"]), (&serde_json::Value::Null, &json["verdict"]));
        let answered = serde_json::to_value(told(1, 1, Verdict::Consistent, 1.0)).unwrap();
        for (name, value) in answered.as_object().unwrap() {
            assert!(json.get(name).is_some(), "{name} is missing");
            assert!(value.is_null() || json[name].is_null() || json[name].is_array() == value.is_array(), "{name}");
        }
        assert_eq!(json["progress"]["state"], "collecting");
    }

    #[test]
    fn what_was_told_is_kept_with_its_looks_for_the_same_inputs_alone() {
        let reports = [
            told(7, 1, Verdict::Consistent, 100.0),
            told(8, 1, Verdict::Unexplained, 150.0),
            told(7, 2, Verdict::Unexplained, 200.0),
            // The same windows again.
            told(7, 2, Verdict::Explained, 200.0),
        ];
        let texts = reports.clone().map(|report| serde_json::to_string(&report).unwrap());
        let kept = Report::kept("leak", 7, &texts).unwrap();
        assert_eq!(kept.answer, reports[3].answer);
        let taken_up = kept.taken_up();
        assert_eq!(
            (taken_up.progress.state, &taken_up.answer),
            (State::Searching, &kept.answer),
            "all is searched again"
        );
        assert_eq!(kept.progress.milestones, reports[3].progress.milestones);
        let looks: Vec<_> = kept.progress.looks.iter().map(|look| (look.last_clock_s, look.verdict)).collect();
        assert_eq!(looks, [(100.0, Verdict::Consistent), (200.0, Verdict::Explained)]);
        assert!(Report::kept("leak", 9, &texts).is_none(), "of other inputs nothing");
        assert!(Report::kept("leak", 7, ["{\"verdict\":\"consistent\",\"progress\":{\"searches\":3}}"]).is_none());
    }

    #[test]
    fn a_report_is_news_when_its_state_its_windows_or_its_answer_is_another() {
        let before = told(7, 2, Verdict::Unexplained, 200.0);
        assert!(before.is_news_after(None));
        assert!(!before.is_news_after(Some(&before)));
        let mut refused = Report { answer: None, ..before.clone() };
        refused.progress.state = State::Refused;
        assert!(refused.is_news_after(Some(&before)));
        let mut later = refused.clone();
        later.progress.sentence = "The same with other numbers.".into();
        assert!(!later.is_news_after(Some(&refused)), "one refusal is told once");
        let mut beyond = before.clone();
        beyond.progress.windows_beyond = 1;
        assert!(beyond.is_news_after(Some(&before)));
        beyond.progress.windows_beyond = 2;
        assert!(!beyond.is_news_after(Some(&Report {
            progress: Progress { windows_beyond: 1, ..beyond.progress.clone() },
            ..before
        })));
    }
}

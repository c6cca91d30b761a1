//! The running diagnosis: what the windows so far say, looked at again as they come.
//!
//! The physics along the ancillary data is laid out once; every look measures only what the windows are, starts its noise from
//! the look before and searches the whole catalogue. A look is taken when enough windows are new, so the answer is a function of
//! the windows so far and of where the looks fell, and at rest it is that of `oare diagnose` on the same windows, but for the
//! level of proof: many looks are many chances, so an alarm needs posterior odds that no number of looks reaches by chance
//! oftener than is allowed (Ville 1939: an evidence ratio of 1/p is met with probability p at most, however long one waits), and
//! what remains beside it is charged for the looks before.
//!
//! Not here: threads, clocks, who brings the windows and who is told.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::answer::{Diagnosis, Source, Verdict};
use super::case::{Case, Expectation, WINDOW_STRIDE_S, WINDOWS_MIN};
use super::error::CaseError;
use super::noise::AxisNoise;
use super::null_table;
use super::order::solve_at_its_order;
use super::recorder::Usable;
use super::report;
use super::scene::{Scene, Surroundings};
use super::solve::{Library, Stop, null_noise};
use super::verdict::{self, Proof};
use crate::math::shared_work;

/// Looks kept for readers.
const LOOKS_MAX: usize = 100;
/// What times are counted from.
const ONSET: &str = "onset";
const FIRST_DATA: &str = "first_data";

/// When and how to look.
#[derive(Debug, Clone, PartialEq)]
pub struct Policy {
    /// Recording seconds of new windows after which the search is made again.
    pub search_every_s: f64,
    /// Probability of ever raising an alarm on a recording that lacks nothing.
    pub claim_probability: f64,
    /// Catalogue effects to leave out.
    pub without: Vec<String>,
}

impl Default for Policy {
    fn default() -> Self {
        Self { search_every_s: 3600.0, claim_probability: 0.002, without: Vec::new() }
    }
}

/// What was seen at one look.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Milestones {
    /// Looks taken.
    pub searches: u64,
    /// Last window of the first look of the alarm that stands.
    pub alarm_clock_s: Option<f64>,
    /// Last window of the first look that gave the name that stands.
    pub name_clock_s: Option<f64>,
    /// The name that stands; empty where there is none.
    pub name: Vec<String>,
    /// Alarms that a later look took back.
    pub alarms_withdrawn: u64,
    /// Looks that failed, by a defect of the program.
    #[serde(default)]
    pub searches_failed: u64,
}

/// Where the running diagnosis is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// Too few windows for any answer.
    Collecting,
    /// A search is under way.
    Searching,
    /// The answer holds for all windows but the newest few.
    Current,
    /// The windows so far cannot be compared with the simulation; the sentence says why.
    Refused,
    /// The last search failed, by a defect of the program: the answer is that of the look before.
    Failed,
}

/// How far it is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Progress {
    /// Where it is.
    pub state: State,
    /// One or two sentences for an operator.
    pub sentence: String,
    /// Usable windows known.
    pub windows_seen: usize,
    /// Of those, windows the answer rests on.
    pub windows_searched: usize,
    /// Centre of the first window the answer rests on.
    pub first_clock_s: Option<f64>,
    /// Centre of the last one: the answer is as of here.
    pub last_clock_s: Option<f64>,
    /// Digest of the revisions of the products it rests on.
    pub revision: String,
    /// Version of the calibration they were made with.
    pub calibration: u32,
    /// Recording seconds from the effect's onset (or the first data) to the last window of the look that raised the alarm.
    pub time_to_detect_s: Option<f64>,
    /// The same to the look that gave the name that stands.
    pub time_to_name_s: Option<f64>,
    /// What these are counted from: `onset` or `first_data`.
    pub counted_from: &'static str,
    /// Instrument clock they are counted from.
    pub counted_from_clock_s: Option<f64>,
    /// When something was found.
    #[serde(flatten)]
    pub milestones: Milestones,
    /// The last looks, oldest first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub looks: Vec<Look>,
}

/// The answer so far: `diagnosis.json` and how far it is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// The answer; `consistent` with probability 1 while there is none.
    #[serde(flatten)]
    pub diagnosis: Diagnosis,
    /// How far it is.
    pub progress: Progress,
}

/// A running diagnosis.
pub struct Live {
    expected: Arc<Expectation>,
    surroundings: Arc<Surroundings>,
    policy: Policy,
    noise: Option<[AxisNoise; 3]>,
    milestones: Milestones,
    looks: Vec<Look>,
    diagnosis: Diagnosis,
    /// What the last look rested on: windows before it, digest, calibration, and the span of the windows used.
    seen: Seen,
    used: Option<[f64; 2]>,
    windows_searched: usize,
    state: State,
    sentence: String,
}

/// What there is to look at.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Seen {
    /// Usable windows.
    pub windows: usize,
    /// Digest of their revisions.
    pub digest: u64,
    /// Version of their calibration.
    pub calibration: u32,
}

impl From<&Usable> for Seen {
    fn from(usable: &Usable) -> Self {
        Self { windows: usable.recording.clock_s.len(), digest: usable.digest, calibration: usable.calibration }
    }
}

impl Live {
    /// Lays out the physics along the ancillary data; nothing is seen yet.
    ///
    /// # Errors
    /// Where an attitude or an instant defeats the physics.
    pub fn new(expected: Expectation, policy: Policy, milestones: Milestones) -> Result<Self, CaseError> {
        let surroundings = Arc::new(Surroundings::new(&expected)?);
        let diagnosis = Diagnosis::nothing(&expected.header.id, 1.0);
        Ok(Self {
            expected: Arc::new(expected),
            surroundings,
            policy,
            noise: None,
            milestones,
            looks: Vec::new(),
            diagnosis,
            seen: Seen::default(),
            used: None,
            windows_searched: 0,
            state: State::Collecting,
            sentence: String::new(),
        })
    }

    /// Whether a look is due: enough windows are new, or the old ones have another calibration; or, when nothing more `is_coming`
    /// for now, any difference at all.
    pub fn is_due(&self, seen: &Seen, is_coming: bool) -> bool {
        if seen.windows < WINDOWS_MIN || seen.digest == self.seen.digest {
            return false;
        }
        let fresh_s = seen.windows.saturating_sub(self.seen.windows) as f64 * WINDOW_STRIDE_S;
        self.seen.windows == 0
            || !is_coming
            || fresh_s >= self.policy.search_every_s
            || seen.calibration != self.seen.calibration
    }

    /// Looks at the windows so far; whether it did: not when `stop` said so in between.
    pub fn look(&mut self, usable: Usable, stop: Stop) -> bool {
        let seen = Seen::from(&usable);
        let case = match Case::meet(self.expected.clone(), usable.recording) {
            Ok(case) => case,
            Err(error) => {
                self.seen = seen;
                self.state = State::Refused;
                self.sentence = format!("The windows so far cannot be compared with the simulation: {error}");
                return true;
            }
        };
        let mut scene = Scene::within(&case, self.surroundings.clone());
        let (library, noise) = shared_work::both(
            || Library::new(&scene, &self.policy.without),
            || null_noise(&scene, self.noise.as_ref()),
        );
        let Some(solution) = solve_at_its_order(&mut scene, &library, noise, stop) else { return false };
        // The order is chosen anew at every look.
        self.noise = Some(solution.null.noise.map(|noise| AxisNoise { resonance: None, ..noise }));
        let log_odds = solution.proven(&scene, &library.entries);
        let clock_s = scene.clock_s();
        let proof = Proof {
            statistic: log_odds,
            probability: anytime_probability(log_odds),
            source: Source::Looks,
            claim: self.policy.claim_probability,
            chances: chances_at(self.milestones.searches + 1),
        };
        let (diagnosis, _, _) = verdict::conclude(&scene, &library, &solution, proof);
        self.used = Some([clock_s[0], clock_s[clock_s.len() - 1]]);
        self.windows_searched = clock_s.len();
        self.seen = seen;
        self.state = State::Current;
        self.sentence = report::sentence(&diagnosis);
        self.note(&diagnosis, log_odds);
        self.diagnosis = diagnosis;
        true
    }

    /// Notes that the look at `seen` failed, by a defect of the program: the answer stays that of the look before, and when more windows
    /// come they are looked at with all others.
    pub fn failed(&mut self, seen: Seen) {
        self.seen = seen;
        self.state = State::Failed;
        self.milestones.searches_failed += 1;
        self.sentence = format!(
            "The search over the {} windows so far failed, by a defect of the program that its log tells; the answer is that of the {} \
             windows searched before. The next windows are searched with all others.",
            seen.windows, self.windows_searched
        );
    }

    fn note(&mut self, diagnosis: &Diagnosis, log_odds: f64) {
        let Some([_, last_clock_s]) = self.used else { return };
        let named: Vec<String> = diagnosis.effects.iter().map(|e| e.id.clone()).collect();
        self.milestones.take(diagnosis.verdict, &named, last_clock_s);
        let windows = self.windows_searched;
        self.looks.push(Look { windows, last_clock_s, verdict: diagnosis.verdict, named, log_odds });
        if self.looks.len() > LOOKS_MAX {
            self.looks.remove(0);
        }
    }

    /// The answer so far, with so many usable windows known by now, and whether a search is under way.
    pub fn report(&self, windows_seen: usize, is_searching: bool) -> Report {
        let onsets: Vec<f64> = self.diagnosis.effects.iter().filter_map(|e| e.parameter("onset_s")).collect();
        let by_onset = !onsets.is_empty() && onsets.len() == self.diagnosis.effects.len();
        let first = self.used.map(|used| used[0]);
        let from = if by_onset { onsets.into_iter().reduce(f64::min) } else { first };
        let since = |clock_s: Option<f64>| Some((clock_s? - from?).max(0.0));
        let sentence = match self.state {
            State::Collecting => waiting_sentence(windows_seen),
            _ => self.sentence.clone(),
        };
        let progress = Progress {
            state: if is_searching { State::Searching } else { self.state },
            sentence,
            windows_seen,
            windows_searched: self.windows_searched,
            first_clock_s: first,
            last_clock_s: self.used.map(|used| used[1]),
            revision: format!("{:016x}", self.seen.digest),
            calibration: self.seen.calibration,
            time_to_detect_s: since(self.milestones.alarm_clock_s),
            time_to_name_s: since(self.milestones.name_clock_s),
            counted_from: if by_onset { ONSET } else { FIRST_DATA },
            counted_from_clock_s: from,
            milestones: self.milestones.clone(),
            looks: self.looks.clone(),
        };
        Report { diagnosis: self.diagnosis.clone(), progress }
    }
}

impl Report {
    /// No answer yet.
    pub fn waiting(case: &str) -> Self {
        Self::without_answer(case, State::Collecting, waiting_sentence(0))
    }

    /// No answer will come.
    pub fn refused(case: &str, error: &CaseError) -> Self {
        Self::without_answer(case, State::Refused, error.to_string())
    }

    fn without_answer(case: &str, state: State, sentence: String) -> Self {
        let progress = Progress {
            state,
            sentence,
            windows_seen: 0,
            windows_searched: 0,
            first_clock_s: None,
            last_clock_s: None,
            revision: format!("{:016x}", 0),
            calibration: 0,
            time_to_detect_s: None,
            time_to_name_s: None,
            counted_from: FIRST_DATA,
            counted_from_clock_s: None,
            milestones: Milestones::default(),
            looks: Vec::new(),
        };
        Self { diagnosis: Diagnosis::nothing(case, 1.0), progress }
    }
}

fn waiting_sentence(windows: usize) -> String {
    format!("{windows} usable windows so far; {WINDOWS_MIN} are needed before anything can be said.")
}

impl Milestones {
    /// Takes the verdict of one more look.
    fn take(&mut self, verdict: Verdict, named: &[String], last_clock_s: f64) {
        self.searches += 1;
        if verdict == Verdict::Consistent {
            self.alarms_withdrawn += u64::from(self.alarm_clock_s.is_some());
            self.alarm_clock_s = None;
        } else {
            self.alarm_clock_s.get_or_insert(last_clock_s);
        }
        // One name is one set, told without a rival.
        let mut name = if verdict == Verdict::Explained { named.to_vec() } else { Vec::new() };
        name.sort_unstable();
        if name != self.name {
            self.name_clock_s = (!name.is_empty()).then_some(last_clock_s);
            self.name = name;
        }
    }
}

/// Probability that a recording which lacks nothing reaches these log posterior odds at any look, ever.
fn anytime_probability(log_odds: f64) -> f64 {
    null_table::false_alarm_probability(log_odds, f64::INFINITY).max((-log_odds).exp()).min(1.0)
}

/// By what the probability of a single look counts more at look number `look`, from 1, so that all looks together are chanced no
/// oftener: the first may take 6/pi^2 of what is allowed, number n the n^2th part of that.
fn chances_at(look: u64) -> f64 {
    std::f64::consts::PI.powi(2) / 6.0 * (look as f64).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| name.to_string()).collect()
    }

    #[test]
    fn an_alarm_and_a_name_count_from_the_first_look_of_an_unbroken_run() {
        let mut m = Milestones::default();
        m.take(Verdict::Consistent, &[], 100.0);
        m.take(Verdict::Unexplained, &[], 200.0);
        m.take(Verdict::Explained, &named(&["vent_leak"]), 300.0);
        m.take(Verdict::Explained, &named(&["vent_leak"]), 400.0);
        assert_eq!((m.alarm_clock_s, m.name_clock_s, m.alarms_withdrawn), (Some(200.0), Some(300.0), 0));
        m.take(Verdict::Ambiguous, &named(&["vent_leak"]), 500.0);
        assert_eq!((m.alarm_clock_s, m.name_clock_s), (Some(200.0), None), "a set with a rival is no name");
        m.take(Verdict::Explained, &named(&["water_dump", "vent_leak"]), 600.0);
        m.take(Verdict::Explained, &named(&["vent_leak", "water_dump"]), 700.0);
        assert_eq!(m.name_clock_s, Some(600.0), "the order of names is no difference");
        m.take(Verdict::Consistent, &[], 800.0);
        assert_eq!((m.alarm_clock_s, m.name_clock_s, m.alarms_withdrawn, m.searches), (None, None, 1, 8));
    }

    #[test]
    fn milestones_last_over_a_restart() {
        let m =
            Milestones { searches: 7, alarm_clock_s: Some(1.5), name: named(&["vent_leak"]), ..Milestones::default() };
        let json = serde_json::to_value(&m).unwrap();
        assert_eq!(serde_json::from_value::<Milestones>(json).unwrap(), m);
    }

    #[test]
    fn what_remains_may_be_chanced_at_any_of_many_looks_no_oftener_than_once() {
        let spent: f64 = (1..100_000).map(|look| chances_at(look).recip()).sum();
        assert!(spent <= 1.0 && spent > 0.99, "{spent}");
    }

    #[test]
    fn many_looks_need_more_than_one_look() {
        let claim = Policy::default().claim_probability;
        let once = (-100..200)
            .map(|t| 0.1 * f64::from(t))
            .find(|t| null_table::false_alarm_probability(*t, f64::INFINITY) <= claim);
        let ever = (-100..200).map(|t| 0.1 * f64::from(t)).find(|t| anytime_probability(*t) <= claim);
        assert!(ever > once, "{ever:?} {once:?}");
        // Odds of 500 to 1.
        assert!((ever.unwrap() - 500.0_f64.ln()).abs() < 0.1, "{ever:?}");
    }
}

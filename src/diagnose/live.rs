//! The running diagnosis: what the windows so far say, looked at again as they come.
//!
//! The physics along the ancillary data is laid out once; every look measures only what the windows are and searches the whole
//! catalogue. While more windows come it starts its noise from the look before, so that where the looks fell shows in the last digits;
//! at rest it does not, and the answer is that of `oare diagnose` on the same windows, but for the level of proof: many looks are many
//! chances, so an alarm needs posterior odds that no number of looks reaches by chance oftener than is allowed (Ville 1939: an evidence
//! ratio of 1/p is met with probability p at most, however long one waits), and what remains beside it is charged for the looks before.
//!
//! Not here: threads, clocks, who brings the windows and who is told.

mod inputs;
mod news;
mod progress;

use std::sync::Arc;

pub use inputs::digest;
pub use news::{News, news};
pub use progress::{CountedFrom, Look, Milestones, Progress, Report, State};
use progress::{Found, add, beyond_sentence, digits, waiting_sentence};

use super::answer::{Diagnosis, EffectAnswer, Source};
use super::case::{Case, Expectation, HALF_WINDOW_S, Recording, WINDOW_STRIDE_S, WINDOWS_MIN};
use super::catalogue;
use super::error::CaseError;
use super::noise::AxisNoise;
use super::null_table;
use super::order::solve_at_its_order;
use super::recorder::ALL_TIME;
pub use super::recorder::Seen;
use super::report;
use super::scene::{Scene, Surroundings};
use super::solve::{Library, Stop, null_noise};
use super::verdict::{self, Proof};
use crate::math::shared_work;

/// Windows that are so many times what is needed for a search came at once: how late a finding is, is then no matter of searches.
const AT_ONCE: f64 = 1.5;

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

/// A running diagnosis.
pub struct Live {
    expected: Arc<Expectation>,
    surroundings: Arc<Surroundings>,
    policy: Policy,
    inputs: u64,
    noise: Option<[AxisNoise; 3]>,
    milestones: Milestones,
    looks: Vec<Look>,
    answer: Option<Answer>,
    /// What was looked at last, whatever came of it.
    seen: Seen,
    state: State,
    sentence: String,
}

/// An answer and what it rests on.
#[derive(Clone)]
struct Answer {
    diagnosis: Diagnosis,
    windows: usize,
    span_s: [f64; 2],
    revision: String,
    calibration: u32,
    /// No noise of a look before was its beginning.
    from_scratch: bool,
}

impl Live {
    /// Lays out the physics along the ancillary data; nothing is seen yet but what an `earlier` run told of the same inputs.
    ///
    /// # Errors
    /// Where an attitude or an instant defeats the physics.
    pub fn new(expected: Expectation, policy: Policy, earlier: Option<Report>) -> Result<Self, CaseError> {
        let surroundings = Arc::new(Surroundings::new(&expected)?);
        let inputs = digest(&expected, &policy);
        let earlier = earlier.unwrap_or_else(|| Report::waiting(&expected.header.id, inputs));
        let Report { answer, progress, .. } = earlier;
        let answer = answer.zip(progress.first_clock_s.zip(progress.last_clock_s));
        let answer = answer.map(|(diagnosis, (first_s, last_s))| Answer {
            diagnosis,
            windows: progress.windows_searched,
            span_s: [first_s, last_s],
            revision: progress.revision,
            calibration: progress.calibration,
            from_scratch: progress.at_rest,
        });
        Ok(Self {
            expected: Arc::new(expected),
            surroundings,
            policy,
            inputs,
            noise: None,
            milestones: progress.milestones,
            looks: progress.looks,
            answer,
            seen: Seen::default(),
            state: progress.state,
            sentence: progress.sentence,
        })
    }

    /// The span that windows are compared in: of the case, and where simulation and ancillary data hold all of a window.
    pub fn span_s(&self) -> [f64; 2] {
        let within = |grid: &[f64]| [grid[0] + HALF_WINDOW_S, grid[grid.len() - 1] - HALF_WINDOW_S];
        let spans = [within(&self.expected.simulation.clock_s), within(&self.expected.ancillary.clock_s)];
        let asked = self.expected.header.span_s;
        spans.iter().fold(asked, |span, other| [span[0].max(other[0]), span[1].min(other[1])])
    }

    /// The span of the windows that a look takes: where too few can be compared it takes all, and says of all why not.
    pub fn span_to_take_s(&self, seen: &Seen) -> [f64; 2] {
        if seen.windows < WINDOWS_MIN { ALL_TIME } else { self.span_s() }
    }

    /// Whether a look is due: enough windows are new, or the old ones have another calibration; or, when nothing more `is_coming`
    /// for now, any difference at all, and where there is none an answer that began at the noise of a look before.
    pub fn is_due(&self, seen: &Seen, is_coming: bool) -> bool {
        if seen.windows < WINDOWS_MIN {
            // Nothing can be compared, and that is said; later in other words, when nothing more comes.
            let are_too_few = seen.windows + seen.beyond >= WINDOWS_MIN;
            return are_too_few && (self.state != State::Refused || (!is_coming && *seen != self.seen));
        }
        if seen.digest == self.seen.digest {
            let has_a_past = self.answer.as_ref().is_some_and(|answer| !answer.from_scratch);
            return !is_coming && has_a_past && self.state == State::Current;
        }
        let fresh_s = seen.windows.saturating_sub(self.seen.windows) as f64 * WINDOW_STRIDE_S;
        self.seen.windows == 0
            || !is_coming
            || fresh_s >= self.policy.search_every_s
            || seen.calibration != self.seen.calibration
    }

    /// Looks at the windows so far; whether it did: not when `stop` said so in between. When nothing more `is_coming` it looks as if
    /// for the first time, so that where the looks before fell leaves no trace in what is said at rest.
    pub fn look(&mut self, seen: Seen, recording: Recording, is_coming: bool, stop: Stop) -> bool {
        let case = match Case::meet(self.expected.clone(), recording) {
            Ok(case) => case,
            Err(error) => {
                self.seen = seen;
                self.state = State::Refused;
                self.answer = None;
                self.sentence = format!("The windows so far cannot be compared with the simulation: {error}");
                return true;
            }
        };
        let before = self.noise.as_ref().filter(|_| is_coming);
        let from_scratch = before.is_none();
        let mut scene = Scene::within(&case, self.surroundings.clone());
        let (library, noise) =
            shared_work::both(|| Library::new(&scene, &self.policy.without), || null_noise(&scene, before));
        let Some(solution) = solve_at_its_order(&mut scene, &library, noise, stop) else { return false };
        // The order is chosen anew at every look.
        self.noise = Some(solution.null.noise.map(|noise| AxisNoise { resonance: None, ..noise }));
        let log_odds = solution.proven(&scene, &library.entries);
        let revision = digits(seen.digest);
        // The same windows once more are no further chance.
        let is_another = self.answer.as_ref().is_none_or(|answer| answer.revision != revision);
        let proof = Proof {
            statistic: log_odds,
            probability: anytime_probability(log_odds),
            source: Source::Looks,
            claim: self.policy.claim_probability,
            chances: chances_at((self.milestones.searches + u64::from(is_another)).max(1)),
        };
        let (diagnosis, _, _) = verdict::conclude(&scene, &library, &solution, proof);
        let clock_s = scene.clock_s();
        let (windows, span_s) = (clock_s.len(), [clock_s[0], clock_s[clock_s.len() - 1]]);
        self.seen = seen;
        self.state = State::Current;
        self.sentence = report::sentence(&diagnosis);
        let (verdict, last_clock_s) = (diagnosis.verdict, span_s[1]);
        let named: Vec<String> = diagnosis.effects.iter().map(|e| e.id.clone()).collect();
        let known = self.answer.as_ref().map(|answer| (answer.windows, answer.span_s[1]));
        let came_at_once = came_at_once(known, (windows, last_clock_s), self.policy.search_every_s);
        self.milestones.take(Found { verdict, named: &named, last_clock_s, is_another, came_at_once });
        add(&mut self.looks, Look { windows, last_clock_s, verdict, named, log_odds }, is_another);
        self.answer =
            Some(Answer { diagnosis, windows, span_s, revision, calibration: seen.calibration, from_scratch });
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
            seen.windows,
            self.answer.as_ref().map_or(0, |answer| answer.windows)
        );
    }

    /// The answer so far, with the usable windows known by now, and whether a search is under way.
    pub fn report(&self, seen: &Seen, is_searching: bool) -> Report {
        let windows_seen = seen.windows + seen.beyond;
        let answer = self.answer.as_ref();
        let began = answer.map(|answer| began(&self.expected, &answer.diagnosis.effects, answer.span_s[0]));
        let [from, name_from] = [began.map(|began| began.first_s), began.map(|began| began.last_s)];
        let since = |clock_s: Option<f64>, from: Option<f64>| Some((clock_s? - from?).max(0.0));
        let mut sentence = match self.state {
            State::Collecting => waiting_sentence(seen.windows),
            _ => self.sentence.clone(),
        };
        if seen.beyond > 0 && self.state != State::Refused {
            sentence.push_str(&beyond_sentence(seen, self.span_s()));
        }
        let is_whole = |answer: &Answer| answer.from_scratch && answer.revision == digits(seen.digest);
        let at_rest = !is_searching && self.state == State::Current && answer.is_some_and(is_whole);
        let progress = Progress {
            state: if is_searching { State::Searching } else { self.state },
            sentence,
            windows_seen,
            windows_beyond: seen.beyond,
            windows_searched: answer.map_or(0, |answer| answer.windows),
            first_clock_s: answer.map(|answer| answer.span_s[0]),
            last_clock_s: answer.map(|answer| answer.span_s[1]),
            revision: answer.map_or(digits(0), |answer| answer.revision.clone()),
            calibration: answer.map_or(0, |answer| answer.calibration),
            inputs: digits(self.inputs),
            at_rest,
            time_to_detect_s: since(self.milestones.alarm_clock_s, from),
            time_to_name_s: since(self.milestones.name_clock_s, name_from),
            counted_from: began.map_or(CountedFrom::FirstData, |began| began.by),
            counted_from_clock_s: from,
            name_counted_from_clock_s: name_from,
            milestones: self.milestones.clone(),
            looks: self.looks.clone(),
        };
        let case = self.expected.header.id.clone();
        Report { case, answer: answer.map(|answer| answer.diagnosis.clone()), progress }
    }
}

/// Whether more windows are new than a look waits for, or most of them lie before the last one that was known: windows, and the centre of
/// the last, at the look before (none before the first) and now.
fn came_at_once(known: Option<(usize, f64)>, now: (usize, f64), search_every_s: f64) -> bool {
    let first_s = WINDOWS_MIN as f64 * WINDOW_STRIDE_S;
    let (before, due_s, forward_s) = match known {
        None => (0, search_every_s.max(first_s), f64::INFINITY),
        Some((windows, last_s)) => (windows, search_every_s, now.1 - last_s),
    };
    let fresh_s = now.0.saturating_sub(before) as f64 * WINDOW_STRIDE_S;
    fresh_s > AT_ONCE * due_s || fresh_s > 2.0 * forward_s
}

/// Since when what an answer names was there to be found.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Began {
    /// What says when the first of it began.
    by: CountedFrom,
    /// When that was.
    first_s: f64,
    /// When the last of it began.
    last_s: f64,
}

/// Since when what an answer names was there to be found, the record beginning at `first_s`.
fn began(expected: &Expectation, effects: &[EffectAnswer], first_s: f64) -> Began {
    let onset = |e: &EffectAnswer| e.parameter("onset_s").map(|at| (CountedFrom::Onset, at));
    let logged = |e: &EffectAnswer| {
        let spans = expected.spans(catalogue::logged_kind(&e.id)?);
        let starts = spans.iter().filter(|span| span[1] >= first_s).map(|span| span[0].max(first_s));
        starts.reduce(f64::min).map(|at| (CountedFrom::LoggedStart, at))
    };
    let began: Vec<_> = effects.iter().filter_map(|e| onset(e).or_else(|| logged(e))).collect();
    let last_s = began.iter().map(|(_, at)| *at).fold(first_s, f64::max);
    match began.iter().min_by(|a, b| a.1.total_cmp(&b.1)) {
        Some((by, at)) if began.len() == effects.len() => Began { by: *by, first_s: *at, last_s },
        // One of them was always there.
        _ => Began { by: CountedFrom::FirstData, first_s, last_s },
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
    use crate::diagnose::answer::ParameterAnswer;
    use crate::diagnose::case::Event;

    #[test]
    fn times_count_from_an_onset_or_a_start_in_the_log_where_every_effect_has_one() {
        let expected = inputs::tests::expected(|e| {
            let dump = |clock_s| Event { clock_s, duration_s: 100.0, kind: "water_dump".into(), detail: String::new() };
            e.events = [50.0, 950.0, 5000.0].map(dump).into();
        });
        let effect = |id: &str, onset_s: Option<f64>| EffectAnswer {
            id: id.into(),
            name: id.into(),
            posterior: 1.0,
            parameters: onset_s
                .map(|value| ParameterAnswer { name: "onset_s".into(), value, sigma: 1.0, unit: "s".into() })
                .into_iter()
                .collect(),
            axis: None,
            why: String::new(),
            rms_ng: None,
        };
        let (dump, leak, offset) =
            (effect("water_dump", None), effect("vent_leak", Some(3000.0)), effect("cg_offset", None));
        let of = |effects: &[&EffectAnswer], first_s| {
            began(&expected, &effects.iter().copied().cloned().collect::<Vec<_>>(), first_s)
        };
        let (logged, onset) = (CountedFrom::LoggedStart, CountedFrom::Onset);
        let began = |by, first_s, last_s| Began { by, first_s, last_s };
        assert_eq!(of(&[&dump], 200.0), began(logged, 950.0, 950.0), "the first that is recorded");
        assert_eq!(of(&[&dump], 1000.0), began(logged, 1000.0, 1000.0), "one under way, from the first window");
        assert_eq!(of(&[&leak], 0.0), began(onset, 3000.0, 3000.0));
        assert_eq!(of(&[&leak, &dump], 200.0), began(logged, 950.0, 3000.0), "no such set before the leak");
        assert_eq!(of(&[&leak, &dump], 2000.0).first_s, 3000.0);
        let always = CountedFrom::FirstData;
        assert_eq!(of(&[&dump, &offset], 200.0), began(always, 200.0, 950.0), "one of them was always there");
        assert_eq!(of(&[], 200.0), began(always, 200.0, 200.0));
    }

    #[test]
    fn what_comes_at_once_or_after_later_windows_is_a_playback() {
        let at_once = |known, now| came_at_once(known, now, 3600.0);
        assert!(!at_once(None, (200, 5000.0)), "as soon as there are enough");
        assert!(at_once(None, (800, 20_000.0)));
        let known = Some((800, 100_000.0));
        assert!(!at_once(known, (944, 103_600.0)), "an hour later");
        assert!(!at_once(known, (964, 103_600.0)), "and a late piece of the hours before");
        assert!(at_once(known, (944, 100_000.0)), "an hour before");
        assert!(at_once(known, (1150, 108_750.0)), "more than a search waits for");
        assert!(!at_once(known, (800, 100_000.0)), "the same windows once more");
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

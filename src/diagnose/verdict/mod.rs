//! From weighed hypotheses to what is said: consistent, explained, ambiguous or unexplained, with its figures. It decides; what
//! it says of a decision is in the files beside it.

mod again;
mod another_course;
mod another_lag;
mod claims;
mod credible;
mod faults;
mod fit;
mod imitators;
mod inputs;
mod judge;
mod limits;
mod log_clock;
mod named;
mod nearest;
mod proportion;
mod stands;
mod unnamed;

use self::again::again;
use self::another_course::{AnotherCourse, another_course};
use self::another_lag::of_another_lag;
use self::claims::{of_claims, of_unknown_claims, of_unknown_keys};
use self::credible::credible;
use self::fit::fit;
use self::inputs::of_inputs;
use self::judge::{Failure, Judged, judge};
use self::limits::upper_limits;
use self::log_clock::of_another_clock;
use self::named::name;
use self::nearest::nearest;
use self::proportion::{of_proportion, of_the_simulation};
use self::stands::tried;
use self::unnamed::{hypothesis, of_failure, of_remains};
use super::answer::{Diagnosis, LEAST_PROBABILITY, Located, Source, Verdict};
use super::axes;
use super::catalogue::Effect;
use super::design::Frame;
use super::instants::recurring;
use super::joint;
use super::locate;
use super::model::{self, MemberFit};
use super::noise::{AxisNoise, Resonance};
use super::remains::{self, Remains};
use super::scene::{Axes, Scene};
use super::search::{Entry, Family, Member, Set, Weighed};
use super::solve::{Library, Solution};
use super::trial::Tried;
use super::whiteness::widening;
use crate::math::shared_work;

/// Share of the allowed false alarms that goes to the evidence; the rest goes to what remains after it.
const EVIDENCE_SHARE: f64 = 0.8;

/// False-alarm probability that the evidence alone must not exceed, of the one that a claim may have in all.
pub fn asked(claim: f64) -> f64 {
    EVIDENCE_SHARE * claim
}

/// What remains overturns an explanation when it has more than this share of the energy explained, and noise leaves as much so many
/// times more rarely than is asked where nothing was explained: odds of twenty, as of any second effect. A name that holds is not
/// taken back for what one record in a thousand has.
const REMAINS_SHARE: f64 = 0.03;
const REMAINS_BESIDE: f64 = 0.05;

/// Shares of what remains after the evidence that go to laws of several variables, and to one push more.
const JOINT_SHARE: f64 = 0.2;
const AGAIN_SHARE: f64 = 0.1;

/// Prior sizes are for weighing hypotheses. In what is told of a size they are so many times the usual, or they would draw one that is
/// several times the usual towards it by a standard error; and bound only what the record cannot say at all.
const TOLD: f64 = 3.0;

/// Where what remains is to what is fitted.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Place {
    Beside,
    InsteadOfALeak,
}

impl Place {
    fn said(self) -> &'static str {
        match self {
            Self::Beside => "It remains beside",
            Self::InsteadOfALeak => "It takes the place of the leak in",
        }
    }
}

/// Log evidence lost to noise that is not white, from which on it is told: so much, and such a share of all.
const TOLD_OF_COLOUR: f64 = 1.0;
const TOLD_SHARE_OF_COLOUR: f64 = 0.05;
/// What is left of the evidence is proof enough from here on, whatever was lost.
const BEYOND_COLOUR: f64 = 30.0;

/// What proof there is, and what is asked for.
#[derive(Debug, Clone, Copy)]
pub struct Proof {
    /// Log posterior odds against nothing, as far as they are proof.
    pub statistic: f64,
    /// Probability that noise reaches the evidence of this record.
    pub probability: f64,
    /// What says so.
    pub source: Source,
    /// Probability of a false alarm at or below which something is claimed.
    pub claim: f64,
    /// What the probability of what remains is multiplied by: 1 for a single look, more where there were looks before.
    pub chances: f64,
}

/// What the answer rests on.
struct Best<'a> {
    weighed: &'a Weighed,
    frame: Frame,
    set: Set,
    fits: Vec<MemberFit>,
    contributions: Vec<Axes>,
}

/// Names of a set, for people and for `cannot_tell_apart`.
fn ids(library: &Library, set: &Set) -> Vec<String> {
    set.members
        .iter()
        .map(|m| match library.entries[m.entry].family {
            Family::Listed(effect) => effect.id.to_string(),
            Family::Open(i) => library.forms[i].formulas[m.theta[0] as usize].clone(),
        })
        .collect()
}

fn effect_of(entries: &[Entry], set: &Set, i: usize) -> Option<&'static Effect> {
    match entries[set.members[i].entry].family {
        Family::Listed(effect) => Some(effect),
        Family::Open(_) => None,
    }
}

/// The answer, the claimed series at the windows, and the ladder of evidence.
pub fn conclude(
    scene: &Scene,
    library: &Library,
    solution: &Solution,
    proof: Proof,
) -> (Diagnosis, Axes, Vec<(String, f64)>) {
    let (mut answer, signal, ladder) = of_the_mismatch(scene, library, solution, proof);
    faults::tell(&mut answer, scene);
    (answer, signal, ladder)
}

/// The same without the faults of the instrument.
fn of_the_mismatch(
    scene: &Scene,
    library: &Library,
    solution: &Solution,
    proof: Proof,
) -> (Diagnosis, Axes, Vec<(String, f64)>) {
    let mut notes = of_inputs(scene);
    notes.extend(of_unknown_keys(scene));
    notes.extend(of_unknown_claims(scene));
    notes.extend(of_proportion(scene));
    notes.extend(of_the_simulation(scene));
    notes.extend(of_resonances(scene, &solution.null));
    notes.extend(of_colour(solution.statistic(), proof.statistic));
    let (listed, refusals) = credible(scene, library, &solution.listed);
    notes.extend(refusals);
    let judged = judge(scene, library, solution, &listed, proof);
    let Judged { open_wins, failure, .. } = judged;
    let chosen = judged.on_trial.as_ref().map(|(weighed, _)| *weighed);
    if judged.verdict != Verdict::Unexplained || chosen.is_none() {
        notes.extend(failure.as_ref().map(|Failure { set, why }| format!("{set}: a finding is refused: {why}")));
    }
    let overturned = with_remains(scene, library, solution, (judged.verdict, chosen), proof);
    let Overturned { verdict, probability: least, remains, doubt } = overturned;
    notes.extend(doubt);
    let tried = judged.on_trial.map_or_else(|| tried(scene, library, &solution.null), |(_, tried)| tried);
    let (of_evidence, by_remains) = (proof.probability / EVIDENCE_SHARE, least / (1.0 - EVIDENCE_SHARE));
    let overall = of_evidence.min(by_remains).clamp(LEAST_PROBABILITY, 1.0);
    let mut answer = Diagnosis {
        verdict,
        false_alarm_from: Some(if by_remains < of_evidence { Source::Remains } else { proof.source }),
        statistic: Some(proof.statistic),
        slow_evidence: Some(solution.null.slow_evidence),
        notes,
        ..Diagnosis::nothing(&scene.case.header.id, overall)
    };
    answer.located.covariates =
        locate::covariates(solution.singles.iter().map(|(i, score)| (covariate(library, *i), *score)));
    let findings = Findings { scene, library, solution, listed, open_wins, failure, remains, tried };
    let (answer, signal) = match chosen {
        None => findings.of_nothing(answer),
        Some(weighed) => findings.of_a_set(answer, weighed),
    };
    (answer, signal, ladder(library, solution))
}

/// What was found, before it is told.
struct Findings<'a> {
    scene: &'a Scene<'a>,
    library: &'a Library,
    solution: &'a Solution,
    /// Listed sets whose sizes can be believed.
    listed: Vec<&'a Weighed>,
    open_wins: bool,
    failure: Option<Failure>,
    /// And what it is to the best set.
    remains: Option<(Remains, Place)>,
    tried: Tried,
}

impl Findings<'_> {
    /// Of no set: where the strongest single one is, what remains, and how small everything must be.
    fn of_nothing(self, mut answer: Diagnosis) -> (Diagnosis, Axes) {
        let Self { scene, library, solution, .. } = self;
        let frame = solution.null.frame(scene);
        answer.located = unclaimed(scene, library, &frame, solution, answer.located);
        if let Some((r, _)) = self.remains {
            answer.located = of_what_remains(scene, &frame, &r, answer.located);
            answer.hypothesis = Some(of_remains(&r, ""));
        }
        if answer.verdict == Verdict::Consistent && self.failure.is_none() {
            answer.alternatives = nearest(library, &solution.null, &self.listed);
        }
        let nothing = Set::default();
        answer.notes.extend(of_another_clock(scene, library, &frame, &nothing));
        answer.upper_limits = upper_limits(library, &frame, &nothing);
        answer.fit = Some(fit(scene, library, &frame, &solution.null, &nothing, self.tried, &mut answer.notes).0);
        (answer, axes::nothing(scene.schedule.len()))
    }

    /// Of a set that is claimed, or that comes nearest to what cannot be named.
    fn of_a_set(self, mut answer: Diagnosis, weighed: &Weighed) -> (Diagnosis, Axes) {
        let Self { scene, library, .. } = self;
        let (frame, set) = weighed.framed(scene, &library.entries);
        let (fit, inflation) = fit(scene, library, &frame, weighed, &set, self.tried, &mut answer.notes);
        let told = set.with_prior_sizes(TOLD);
        let fits = model::parameters(scene, &frame, &library.entries, &told, inflation);
        let contributions = told.contributions(scene, &frame, &library.entries);
        let best = Best { weighed, frame, set, fits, contributions };
        answer.fit = Some(fit);
        let signal = sum(scene, &best.contributions);
        answer.located = Located {
            covariates: answer.located.covariates,
            per_orbit_lines: locate::lines(scene, &best.frame),
            ..locate::of_signal(scene, &signal, &onsets_s(&best.fits))
        };
        answer.upper_limits = upper_limits(library, &best.frame, &best.set);
        if answer.verdict == Verdict::Unexplained || !onsets_s(&best.fits).is_empty() {
            answer.notes.extend(of_another_clock(scene, library, &best.frame, &best.set));
        }
        if answer.verdict == Verdict::Unexplained {
            let best_ids = ids(library, &best.set).join(" + ");
            let failed = self.failure.is_some();
            answer.notes.extend(self.failure.as_ref().map(of_failure));
            match self.remains {
                Some((r, place)) if !failed || place == Place::InsteadOfALeak => {
                    answer.located = of_what_remains(scene, &best.frame, &r, answer.located);
                    answer.hypothesis = Some(of_remains(&r, &format!(" {} {best_ids}.", place.said())));
                }
                _ if failed => {}
                _ => {
                    answer.hypothesis = Some(hypothesis(library, &best, &self.listed));
                    if !self.open_wins {
                        answer.notes.push("No set of listed effects can be believed.".into());
                    }
                }
            }
        } else {
            answer.notes.extend(of_assumptions(scene, library, &best.set));
            answer.notes.extend(of_another_lag(scene, library, &best.frame, &best.set));
            name(&mut answer, scene, library, &best, &self.listed, &self.solution.open);
            // A limit is beside the first set: of what another set has in its place it says nothing.
            let Diagnosis { upper_limits, cannot_tell_apart, .. } = &mut answer;
            upper_limits.retain(|limit| !cannot_tell_apart.iter().flatten().any(|id| *id == limit.id));
            answer.notes.extend(of_claims(scene, &answer.effects, answer.verdict));
        }
        (answer, signal)
    }
}

/// Log posterior odds of every hypothesis against nothing, best first.
fn ladder(library: &Library, solution: &Solution) -> Vec<(String, f64)> {
    let rung = |w: &Weighed| (ids(library, &w.set).join(" + "), w.log_posterior - solution.null.log_posterior);
    let mut ladder: Vec<(String, f64)> = solution.listed.iter().chain(&solution.open).map(rung).collect();
    ladder.push(("nothing".into(), 0.0));
    ladder.sort_by(|a, b| b.1.total_cmp(&a.1));
    ladder
}

/// Says which axes are taken to have noise of the second order.
fn of_resonances(scene: &Scene, null: &Weighed) -> Vec<String> {
    let has_crew = !scene.case.spans("crew_sleep").is_empty();
    let told = |(axis, noise): (&str, &AxisNoise)| {
        let Resonance { rms_ng, period_s, tau_s, follows_crew } = noise.resonance?;
        let when = match (has_crew, follows_crew) {
            (false, _) => "",
            (true, true) => ", louder when the crew is awake",
            (true, false) => ", whatever the crew does",
        };
        let decimals = (1.0 - rms_ng.log10().floor()).clamp(0.0, 6.0) as usize;
        Some(format!(
            "the noise of axis {axis} is taken to resonate, {rms_ng:.decimals$} ng about a period of {period_s:.0} s, its phase forgotten in \
             {tau_s:.0} s{when}: the windows make that likelier than a line or none, at the price of its three numbers"
        ))
    };
    ["x", "y", "z"].into_iter().zip(&null.noise).filter_map(told).collect()
}

/// Says by how much evidence was lessened, where that may matter.
fn of_colour(statistic: f64, proven: f64) -> Option<String> {
    let lessened = statistic - proven;
    (lessened > TOLD_OF_COLOUR.max(TOLD_SHARE_OF_COLOUR * statistic) && proven < BEYOND_COLOUR).then(|| {
        format!(
            "what remains is louder than the noise fitted at the periods of the best hypothesis, or not white: {lessened:.1} of its \
             {statistic:.1} in log evidence (natural logarithm of odds) is no proof"
        )
    })
}

/// What the series of a set take for granted.
fn of_assumptions(scene: &Scene, library: &Library, set: &Set) -> Vec<String> {
    let assumed = |(i, m): (usize, &Member)| {
        let effect = effect_of(&library.entries, set, i)?;
        Some(format!("{}: {}", effect.id, (effect.assumes?)(scene, &m.theta)?))
    };
    set.members.iter().enumerate().filter_map(assumed).collect()
}

/// A verdict when what remains was asked.
struct Overturned {
    verdict: Verdict,
    /// How probable what remains is.
    probability: f64,
    /// What remains where that is what is to be told, beside a formula where it is more than that explains; and what it is to the best set.
    remains: Option<(Remains, Place)>,
    /// What is not enough to overturn an explanation, as a note.
    doubt: Option<String>,
}

/// Asks what remains, and lets it overturn the verdict: what an explanation leaves must be small beside what it explains.
fn with_remains(
    scene: &Scene,
    library: &Library,
    solution: &Solution,
    (verdict, chosen): (Verdict, Option<&Weighed>),
    proof: Proof,
) -> Overturned {
    let weighed = chosen.unwrap_or(&solution.null);
    let left = weighed.left(scene, &library.entries);
    let chances =
        |share: f64| move |r: Remains| Remains { probability: (proof.chances * r.probability / share).min(1.0), ..r };
    // Evidence counts for less where what is left is not white.
    let wider = widening(&left.whitened).powi(2);
    let lessened =
        |r: Remains| Remains { probability: r.probability.powf(wider.recip()), energy: r.energy / wider, ..r };
    let named = verdict == Verdict::Explained;
    let (asked, (joint, again)) = shared_work::both(
        || remains::strongest(&left, &weighed.noise, &scene.schedule, &scene.loudness, &recurring(scene)),
        || (joint::strongest(scene, &weighed.noise, &left), again(scene, library, solution, weighed)),
    );
    let asked = [
        asked.map(chances(1.0 - JOINT_SHARE - AGAIN_SHARE)),
        joint.map(lessened).map(chances(JOINT_SHARE)),
        again.map(lessened).map(chances(AGAIN_SHARE)),
    ];
    let remains = asked.into_iter().flatten().min_by(|a, b| a.probability.total_cmp(&b.probability));
    let (instead, doubt) = match chosen.and_then(|weighed| another_course(scene, library, weighed)) {
        Some(AnotherCourse::Instead(told)) => (Some((told, Place::InsteadOfALeak)), None),
        Some(AnotherCourse::Maybe(note)) => (None, Some(note)),
        None => (None, None),
    };
    let explained = 2.0 * (weighed.log_posterior - solution.null.log_posterior);
    let rarer = if named { REMAINS_BESIDE } else { 1.0 };
    let allowed = rarer * (1.0 - EVIDENCE_SHARE) * proof.claim;
    let share = if verdict == Verdict::Unexplained { 1.0 } else { REMAINS_SHARE };
    let probability = remains.as_ref().map_or(1.0, |r| r.probability);
    let told = |verdict, probability, remains| Overturned { verdict, probability, remains, doubt: None };
    // What remains beside a leak that is none is what that leaves of another course.
    if instead.is_some() {
        return told(Verdict::Unexplained, 1.0, instead);
    }
    match remains.filter(|r| r.probability <= allowed && r.energy > share * explained) {
        Some(remains) => told(Verdict::Unexplained, probability, Some((remains, Place::Beside))),
        // What is too little to overturn an explanation says nothing against it.
        None if named => Overturned { doubt, ..told(verdict, 1.0, None) },
        None => told(verdict, probability, None),
    }
}

/// Where the strongest single hypothesis is, named or not, if it stands out of all of them.
fn unclaimed(scene: &Scene, library: &Library, frame: &Frame, solution: &Solution, located: Located) -> Located {
    let strongest = &solution.strongest;
    let per_orbit_lines = locate::lines(scene, frame);
    if strongest.score <= locate::TOLD {
        return Located { per_orbit_lines, ..located };
    }
    let signal = sum(scene, &strongest.contributions(scene, frame, &library.entries));
    let fits = model::parameters(scene, frame, &library.entries, strongest, 1.0);
    let covariates = located.covariates;
    Located { covariates, per_orbit_lines, ..locate::of_signal(scene, &signal, &onsets_s(&fits)) }
}

/// Where what remains is.
fn of_what_remains(scene: &Scene, frame: &Frame, remains: &Remains, located: Located) -> Located {
    let mut per_orbit_lines = located.per_orbit_lines;
    if let Some(period_s) = remains.period_s {
        per_orbit_lines.splice(0..0, locate::line_of_period(scene, frame, period_s));
    }
    let intervals = if remains.intervals.is_empty() { located.intervals } else { remains.intervals.clone() };
    Located { axes: remains.axes.clone(), intervals, per_orbit_lines, ..located }
}

fn onsets_s(fits: &[MemberFit]) -> Vec<f64> {
    fits.iter().flat_map(|fit| &fit.parameters).filter(|p| p.name == "onset_s").map(|p| p.value).collect()
}

fn covariate(library: &Library, entry: usize) -> String {
    match library.entries[entry].family {
        Family::Listed(effect) => effect.covariate.to_string(),
        Family::Open(i) => library.forms[i].covariate.to_string(),
    }
}

fn sum(scene: &Scene, parts: &[Axes]) -> Axes {
    let mut total = axes::nothing(scene.schedule.len());
    parts.iter().for_each(|part| axes::add(&mut total, part, 1.0));
    total
}

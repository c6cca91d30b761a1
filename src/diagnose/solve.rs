//! From a scene to weighed hypotheses: nothing, listed sets, and sets with an open form. It still decides nothing.

mod lessen;

use self::lessen::{lessen, merge};
use super::catalogue::{self, Effect, Seldom};
use super::design::Frame;
use super::noise::AxisNoise;
use super::open_form::{self, Said};
use super::remains;
use super::scene::{Axes, Scene};
use super::search::{self, Bank, Entry, SET_MAX, Seen, Set, Weighed};
use super::seldom;
use super::whiteness::louder_under;
use crate::math::shared_work;

/// Log prior odds of the open forms together; they share it.
const OPEN_LOG_PRIOR: f64 = -4.0;
/// Log score a set must reach at the noise of the null for its own noise to be tried.
const WORTH_A_REFIT: f64 = -6.0;
/// Sets weighed with their own noise, listed and open.
const OWN_NOISE: [usize; 2] = [6, 4];

/// The same of those found as if there were no slow noise.
const OWN_NOISE_QUIET: [usize; 2] = [3, 2];
/// Slow noise in that search, as a share of a window's white noise, and its correlation time, s.
const QUIET_SHARE: f64 = 0.04;
const QUIET_TAU_S: f64 = 3000.0;

/// Log score of an effect alone, a signal-to-noise ratio of some seventeen, from which what it misses half way between its starting points
/// (an onset by 450 s, a wind by half a right angle) outweighs what another effect costs; and how many are refined at once.
const SHARP: f64 = 150.0;
const SHARP_MAX: usize = 3;
/// Sets refined of those that grow from nothing and from the plain ones, and of those that come of the best by exchange.
const POLISHED: usize = 8;
const EXCHANGED: usize = 4;

/// Log score below the best at one noise up to which a set is weighed whatever the next noise makes of it, several times the one by which
/// a leak and a step were apart that needed it; and how many such sets, each as dear as any that is weighed.
pub const ALONG: f64 = 6.0;
const ALONG_MAX: usize = 3;

/// Log posterior by which a null's noise must be improved upon for the search to begin again from there, and searches at most.
const MISSED: f64 = 3.0;
const SEARCHES_MAX: usize = 4;

/// Windows, three days of them, up to which the search and the one as if there were no slow noise go on side by side: each has a bank of its
/// own, which grows with the square of the record, and a longer record has work enough for all processors in either.
const SIDE_BY_SIDE_MAX: usize = 10_000;

/// Log odds (of twenty) within which another set is as good, and the smaller of two nested sets is preferred.
pub const EQUAL: f64 = 3.0;

/// What a search needs beside the scene, made once a case.
pub struct Library {
    /// Listed entries, then open ones, then those that are rarer and a push for a while, without starting points.
    pub entries: Vec<Entry>,
    /// How many are listed.
    pub listed: usize,
    /// How many are listed or open.
    searched: usize,
    /// What is said of the open forms.
    pub forms: Vec<Said>,
    /// Those that are rarer, in their order.
    seldom: Vec<&'static Seldom>,
    /// Ids of effects that are not to be thought of.
    without: Vec<String>,
}

fn is_allowed(effect: &Effect, without: &[String]) -> bool {
    !without.iter().any(|id| id == effect.id)
}

impl Library {
    /// The whole catalogue but the ids of `without`, and the dictionary.
    pub fn new(scene: &Scene, without: &[String]) -> Self {
        let is_allowed = |effect: &Effect| is_allowed(effect, without);
        let allowed: Vec<&'static Effect> =
            catalogue::ALL.iter().filter(|effect| is_allowed(effect)).copied().collect();
        let (entries, dictionary) = shared_work::both(
            || shared_work::map(&allowed, |effect| Entry::listed(scene, effect)),
            || open_form::dictionary(scene),
        );
        let mut entries: Vec<Entry> = entries.into_iter().flatten().collect();
        let listed = entries.len();
        let share = OPEN_LOG_PRIOR - (dictionary.len().max(1) as f64).ln();
        let mut forms = Vec::with_capacity(dictionary.len());
        for (i, atom) in dictionary.into_iter().enumerate() {
            entries.push(Entry::open(i, atom.shapes, share));
            forms.push(atom.said);
        }
        let searched = entries.len();
        let mut seldom: Vec<&'static Seldom> = catalogue::SELDOM.iter().collect();
        seldom.retain(|s| is_allowed(s.effect));
        entries.extend(seldom.iter().map(|s| Entry::without_points(s.effect, s.log_odds)));
        entries.push(Entry::without_points(&open_form::PUSH, 0.0));
        Self { entries, listed, searched, forms, seldom, without: without.to_vec() }
    }

    /// Whether an effect may be thought of.
    pub fn allows(&self, effect: &Effect) -> bool {
        is_allowed(effect, &self.without)
    }

    /// The entries that are searched, at all their starting points.
    pub fn searched(&self) -> &[Entry] {
        &self.entries[..self.searched]
    }

    /// Those that are rarer, each at its place.
    pub fn seldom(&self) -> impl Iterator<Item = (usize, &'static Seldom)> {
        (self.searched..).zip(self.seldom.iter().copied())
    }

    /// The place of a push for a while.
    pub fn push(&self) -> usize {
        self.entries.len() - 1
    }

    /// The rarer one at this place, with its starting points.
    pub fn seldom_at(&self, scene: &Scene, index: usize) -> Option<Entry> {
        let (_, seldom) = self.seldom().find(|(place, _)| *place == index)?;
        Entry::seldom(scene, seldom)
    }

    /// Whether a set holds an open form.
    pub fn is_open(&self, set: &Set) -> bool {
        set.members.iter().any(|m| self.entries[m.entry].effect().is_none())
    }
}

/// Whether to stop: asked every second or so of work.
pub type Stop<'a> = &'a (dyn Fn() -> bool + Sync);

/// Weighed hypotheses, each kind best first.
pub struct Solution {
    /// No effect.
    pub null: Weighed,
    /// Listed sets, at least one member each.
    pub listed: Vec<Weighed>,
    /// Sets with an open form.
    pub open: Vec<Weighed>,
    /// Score of every entry alone, at the noise of the null.
    pub singles: Vec<(usize, f64)>,
    /// The best of them.
    pub strongest: Set,
}

impl Solution {
    /// The best hypothesis of all, nothing among them.
    pub fn best(&self) -> &Weighed {
        let better = |a: &'_ Weighed, b: &'_ Weighed| b.log_posterior > a.log_posterior;
        self.listed.iter().chain(&self.open).fold(&self.null, |a, b| if better(a, b) { b } else { a })
    }

    /// Log posterior odds of the best hypothesis against nothing, by the windows: flips of the table choose between hypotheses, and a
    /// bias that leaves its law in them alone is no mismatch of what was recorded.
    pub fn statistic(&self) -> f64 {
        let by_windows = |w: &Weighed| w.log_posterior - w.of_flips;
        let best = self.listed.iter().chain(&self.open).map(by_windows).fold(f64::NEG_INFINITY, f64::max);
        best - self.null.log_posterior
    }

    /// The same as far as it is proof: where what the best hypothesis leaves is louder than the noise fitted to it, at the periods at
    /// which the hypothesis lives, or is not white on its axes, its gain in likelihood is worth less by that factor.
    pub fn proven(&self, scene: &Scene, entries: &[Entry]) -> f64 {
        let (best, statistic) = (self.best(), self.statistic());
        if best.set.members.is_empty() {
            return statistic;
        }
        let frame = best.frame(scene);
        let left = best.left(scene, entries);
        let signal: Axes = std::array::from_fn(|k| {
            let before = frame.data.projected(k, &frame);
            before.iter().zip(&left.whitened[k]).map(|(before, left)| before - left).collect()
        });
        let energy: f64 = signal.iter().flatten().map(|x| x * x).sum();
        // What the set pays for its sizes, shapes and prior comes off the likelihood it gains, and stays as it is.
        let paid = (0.5 * energy - (best.set.score - best.of_flips)).max(0.0);
        let louder =
            remains::loudness_under(&left, &scene.schedule, &signal).max(louder_under(&left.whitened, &signal));
        statistic - (1.0 - louder.recip()) * (statistic + paid)
    }
}

/// The noise when nothing is left out; `start` is a first guess, when one is at hand.
pub fn null_noise(scene: &Scene, start: Option<&[AxisNoise; 3]>) -> [AxisNoise; 3] {
    search::fit_noise(scene, &scene.residual_ng, start, if start.is_some() { 50 } else { 110 })
}

/// Search and weigh, from the noise when nothing is left out.
pub fn solve(scene: &Scene, library: &Library, noise_null: [AxisNoise; 3]) -> Solution {
    match solve_unless(scene, library, noise_null, &|| false) {
        Some(solution) => solution,
        None => unreachable!("nobody asked to stop"),
    }
}

/// As [`solve`], and `None` as soon as `stop` says so: it is asked every second or so of work.
pub fn solve_unless(scene: &Scene, library: &Library, noise_null: [AxisNoise; 3], stop: Stop) -> Option<Solution> {
    let mut noise_null = noise_null;
    for _ in 1..SEARCHES_MAX {
        let solution = solve_from(scene, library, noise_null, stop)?;
        // Evidence is against the likeliest noise: where the fit of the null missed it, the noise of the best hypothesis leads there.
        let best = solution.best();
        if best.set.members.is_empty() {
            return Some(solution);
        }
        let again = search::weigh_with_own_noise(scene, &library.entries, &Set::default(), &best.noise, 1, 80);
        if again.log_posterior < solution.null.log_posterior + MISSED {
            return Some(solution);
        }
        noise_null = again.noise;
    }
    solve_from(scene, library, noise_null, stop)
}

fn solve_from(scene: &Scene, library: &Library, noise_null: [AxisNoise; 3], stop: Stop) -> Option<Solution> {
    let entries = &library.entries;
    let null = search::weigh_with_own_noise(scene, entries, &Set::default(), &noise_null, 0, 0);
    let at_its_noise = || {
        let (pool, singles) = converged(scene, library, &noise_null, stop)?;
        Some((pool.weigh(scene, entries, OWN_NOISE, stop)?, singles))
    };
    let as_if_quiet = || quietly(scene, library, &noise_null, stop);
    let (found, more) = if scene.schedule.len() > SIDE_BY_SIDE_MAX {
        (at_its_noise(), as_if_quiet())
    } else {
        shared_work::both(at_its_noise, as_if_quiet)
    };
    let ((mut listed, mut open), Alone { singles, strongest }) = found?;
    let (more_listed, more_open) = more?;
    merge(&mut listed, more_listed);
    merge(&mut open, more_open);
    let is_anything = |w: &Weighed| w.log_posterior > null.log_posterior;
    if listed.iter().chain(&open).any(is_anything) && !stop() {
        let seldom = seldom::found(scene, library, &listed);
        merge(&mut listed, seldom);
    }
    lessen(scene, entries, &mut listed, (|_| true, 0.0), stop)?;
    if open.first().is_some_and(|open| listed.first().is_none_or(|listed| open.log_posterior > listed.log_posterior)) {
        lessen(scene, entries, &mut open, (|set| library.is_open(set), EQUAL), stop)?;
    }
    Some(Solution { listed, open, null, singles, strongest })
}

/// The noise with hardly any slow part, `None` where it has hardly any.
pub fn quiet(noise: &[AxisNoise; 3]) -> Option<[AxisNoise; 3]> {
    let level = |n: &AxisNoise| QUIET_SHARE * n.white_ng;
    noise
        .iter()
        .any(|n| n.slow_ng > 2.0 * level(n))
        .then(|| noise.map(|n| AxisNoise { slow_ng: n.slow_ng.min(level(&n)), slow_tau_s: QUIET_TAU_S, ..n }))
}

/// What the null takes for slow noise may be a slow effect: listed and open sets found as if there were no slow noise, each then
/// weighed with the noise of its own residual as all are.
fn quietly(scene: &Scene, library: &Library, noise_null: &[AxisNoise; 3], stop: Stop) -> Option<Kinds> {
    let Some(quiet) = quiet(noise_null) else { return Some(Kinds::default()) };
    let frame = Frame::new(&quiet, &scene.schedule, &scene.loudness, &scene.residual_ng);
    let bank = Bank::new(&frame, library.searched());
    let pool = Pool::found(scene, library, &frame, &bank.before(&frame.data), quiet, stop)?;
    pool.weigh(scene, &library.entries, OWN_NOISE_QUIET, stop)
}

/// Weighed hypotheses, listed and open, each kind best first.
type Kinds = (Vec<Weighed>, Vec<Weighed>);

/// Sets found at one noise, each kind best first.
struct Pool {
    noise: [AxisNoise; 3],
    listed: Vec<Set>,
    opens: Vec<Set>,
    /// Listed sets that were among the best at a noise before: what is next to the best there may be the best with a noise of its own, and
    /// out of reach from that of another.
    before: Vec<Set>,
}

impl Pool {
    fn found(
        scene: &Scene,
        library: &Library,
        frame: &Frame,
        seen: &Seen,
        noise: [AxisNoise; 3],
        stop: Stop,
    ) -> Option<Self> {
        if stop() {
            return None;
        }
        let entries = &library.entries;
        let listed_ids: Vec<usize> = (0..library.listed).collect();
        let open_ids: Vec<usize> = (library.listed..library.searched).collect();
        let mut listed = search::grow(frame, seen, &listed_ids, vec![Set::default()], SET_MAX);
        let sharp = sharp(scene, frame, entries, seen, &listed_ids);
        if !sharp.is_empty() {
            listed.extend(search::grow(frame, seen, &listed_ids, sharp, SET_MAX));
            search::distinct(&mut listed);
        }
        listed.retain(|s| !s.members.is_empty());
        if stop() {
            return None;
        }
        polish(scene, frame, entries, &mut listed, POLISHED);
        let mut exchanged = exchanged(frame, entries, seen, &listed_ids, &listed);
        if !exchanged.is_empty() {
            polish(scene, frame, entries, &mut exchanged, EXCHANGED);
            listed.extend(exchanged);
            search::distinct(&mut listed);
        }
        if stop() {
            return None;
        }
        let mut seeds = vec![Set::default()];
        seeds.extend(listed.iter().take(2).cloned());
        let mut opens: Vec<Set> = Vec::new();
        for seed in seeds {
            let size = seed.members.len() + 1;
            let mut grown = search::grow(frame, seen, &open_ids, vec![seed], size);
            grown.retain(|s| library.is_open(s));
            grown.truncate(3);
            opens.extend(grown);
        }
        opens.sort_by(|a, b| b.score.total_cmp(&a.score));
        // An open form with what the catalogue adds to it.
        let mut joined = search::grow(frame, seen, &listed_ids, opens.iter().take(2).cloned().collect(), 2);
        joined.retain(|s| library.is_open(s));
        opens.extend(joined.into_iter().take(4));
        search::distinct(&mut opens);
        Some(Self { noise, listed, opens, before: Vec::new() })
    }

    fn top(&self) -> Option<&Set> {
        [self.listed.first(), self.opens.first()].into_iter().flatten().max_by(|a, b| a.score.total_cmp(&b.score))
    }

    /// Listed sets that go along to the next noise.
    fn near_the_best(&self) -> Vec<Set> {
        let top = self.listed.first().map_or(0.0, |s| s.score);
        self.listed.iter().filter(|s| s.score > top - ALONG).take(ALONG_MAX).cloned().collect()
    }

    /// The best of each kind, each weighed with its own noise, best first.
    fn weigh(self, scene: &Scene, entries: &[Entry], count: [usize; 2], stop: Stop) -> Option<Kinds> {
        let weigh = |sets: Vec<Set>, count: usize, before: &[Set]| -> Option<Vec<Weighed>> {
            let top = sets.first().map_or(0.0, |s| s.score);
            let worth = top > WORTH_A_REFIT;
            let near = sets.into_iter().filter(|s| s.score > top - 14.0).collect();
            let mut keep = varied(near, if worth { count } else { 1 });
            keep.extend(before.iter().cloned());
            search::retain_first(&mut keep, Set::key);
            let rounds = if worth { 2 } else { 1 };
            let mut weighed = shared_work::map(&keep, |s| {
                (!stop()).then(|| search::weigh_with_own_noise(scene, entries, s, &self.noise, rounds, 40))
            })
            .into_iter()
            .collect::<Option<Vec<Weighed>>>()?;
            weighed.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
            Some(weighed)
        };
        let (listed, open) =
            shared_work::both(|| weigh(self.listed, count[0], &self.before), || weigh(self.opens, count[1], &[]));
        Some((listed?, open?))
    }
}

/// The best set with one of its members given up for others, two at most, where it is so plain that its near relations keep those out of
/// what grows: what one term of three coefficients explains may be two terms that have one each.
fn exchanged(frame: &Frame, entries: &[Entry], seen: &Seen, listed_ids: &[usize], found: &[Set]) -> Vec<Set> {
    let Some(best) = found.first().filter(|set| set.score > SHARP && (2..SET_MAX).contains(&set.members.len())) else {
        return Vec::new();
    };
    let size = best.members.len();
    let given_up = |i: usize| {
        let mut rest = best.without(i);
        rest.weigh(frame, entries);
        let others: Vec<usize> = listed_ids.iter().filter(|id| **id != best.members[i].entry).copied().collect();
        search::grow(frame, seen, &others, vec![rest], size + 1)
    };
    let mut others: Vec<Set> = (0..size).flat_map(given_up).collect();
    others.retain(|set| set.members.len() >= size && !found.iter().any(|other| other.key() == set.key()));
    search::distinct(&mut others);
    others
}

/// Single effects so plain that what their starting points miss them by is taken for others: refined before they grow.
fn sharp(scene: &Scene, frame: &Frame, entries: &[Entry], seen: &Seen, listed_ids: &[usize]) -> Vec<Set> {
    let nothing = Set::default();
    let chosen = nothing.chosen(frame);
    let refines = |i: &&usize| {
        entries[**i].effect().is_some_and(|e| e.exact_at.is_some() || e.nonlinear.iter().any(|p| p.step > 0.0))
    };
    let ids: Vec<usize> = listed_ids.iter().filter(refines).copied().collect();
    let alone = shared_work::map(&ids, |i| search::best_of_entry(seen, *i, &chosen));
    let mut sharp: Vec<Set> = alone
        .into_iter()
        .map(|(score, member)| Set { members: vec![member], score })
        .filter(|s| s.score > SHARP)
        .collect();
    search::distinct(&mut sharp);
    sharp.truncate(SHARP_MAX);
    shared_work::map(&sharp, |set| {
        let mut set = set.clone();
        search::refine(scene, frame, entries, &mut set);
        set
    })
}

/// Every entry alone, at the noise of the null.
#[derive(Default)]
struct Alone {
    singles: Vec<(usize, f64)>,
    strongest: Set,
}

/// Sets found at the noise of the best of them, from the null's noise on; and the score of every entry alone at the latter.
fn converged(scene: &Scene, library: &Library, noise_null: &[AxisNoise; 3], stop: Stop) -> Option<(Pool, Alone)> {
    let entries = &library.entries;
    let mut noise = *noise_null;
    let mut best_key = Vec::new();
    let mut alone = Alone::default();
    let mut before: Vec<Set> = Vec::new();
    for round in 0.. {
        let frame = Frame::new(&noise, &scene.schedule, &scene.loudness, &scene.residual_ng);
        let bank = Bank::new(&frame, library.searched());
        let seen = bank.before(&frame.data);
        if round == 0 {
            let nothing = Set::default();
            let chosen = nothing.chosen(&frame);
            let ids: Vec<usize> = (0..library.searched).collect();
            let singles = shared_work::map(&ids, |i| (*i, search::best_of_entry(&seen, *i, &chosen).0));
            let best = singles.iter().copied().reduce(|a, b| if b.1 > a.1 { b } else { a });
            let strongest = best.map_or_else(Set::default, |(i, _)| {
                let (score, member) = search::best_of_entry(&seen, i, &chosen);
                Set { members: vec![member], score }
            });
            alone = Alone { singles, strongest };
        }
        let pool = Pool::found(scene, library, &frame, &seen, noise, stop)?;
        let again = pool.top().filter(|top| top.score >= WORTH_A_REFIT && round < 2 && top.key() != best_key);
        let Some(top) = again else { return Some((Pool { before, ..pool }, alone)) };
        best_key = top.key();
        before.extend(pool.near_the_best());
        noise = search::weigh_with_own_noise(scene, entries, top, &noise, 2, 50).noise;
    }
    unreachable!("the rounds end by their number")
}

/// The best so many of sets in order, and for each entry that all of these have the best set behind them that does without: whatever joins
/// one effect must not keep its rivals out.
fn varied(mut sets: Vec<Set>, count: usize) -> Vec<Set> {
    let rest = sets.split_off(count.min(sets.len()));
    let Some(first) = sets.first() else { return sets };
    let common: Vec<usize> = first.key().into_iter().filter(|e| sets.iter().all(|s| s.key().contains(e))).collect();
    for entry in common {
        let without = rest.iter().find(|s| !s.key().contains(&entry));
        if let Some(set) = without.filter(|set| !sets.iter().any(|s| s.key() == set.key())) {
            sets.push(set.clone());
        }
    }
    sets
}

/// Refine the best sets at one noise, and sort again.
fn polish(scene: &Scene, frame: &Frame, entries: &[Entry], sets: &mut Vec<Set>, count: usize) {
    let top = sets.first().map_or(0.0, |s| s.score);
    sets.retain(|s| s.score > top - 16.0);
    *sets = varied(std::mem::take(sets), count);
    if top > WORTH_A_REFIT {
        *sets = shared_work::map(sets, |set| {
            let mut set = set.clone();
            search::refine(scene, frame, entries, &mut set);
            set
        });
    }
    sets.sort_by(|a, b| b.score.total_cmp(&a.score));
}

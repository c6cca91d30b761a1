//! From a scene to weighed hypotheses: nothing, listed sets, and sets with an open form. It still decides nothing.

use super::catalogue;
use super::design::Frame;
use super::noise::AxisNoise;
use super::open_form::{self, Atom};
use super::scene::Scene;
use super::search::{self, Bank, Entry, SET_MAX, Set, Weighed};

/// Log prior odds of the open forms together; they share it.
const OPEN_LOG_PRIOR: f64 = -4.0;
/// Log score a set must reach at the noise of the null for its own noise to be tried.
const WORTH_A_REFIT: f64 = -6.0;
/// Sets weighed with their own noise, listed and open.
const OWN_NOISE: [usize; 2] = [6, 4];

/// What a search needs beside the scene, made once a case.
pub struct Library {
    /// Listed entries, then open ones.
    pub entries: Vec<Entry>,
    /// How many are listed.
    pub listed: usize,
    /// The dictionary of open forms.
    pub atoms: Vec<Atom>,
}

impl Library {
    /// The whole catalogue but the ids of `without`, and the dictionary.
    pub fn new(scene: &Scene, without: &[String]) -> Self {
        let mut entries: Vec<Entry> = catalogue::ALL
            .iter()
            .filter(|e| !without.iter().any(|id| id == e.id))
            .filter_map(|e| Entry::listed(scene, e))
            .collect();
        let listed = entries.len();
        let atoms = open_form::dictionary(scene);
        let share = OPEN_LOG_PRIOR - (atoms.len().max(1) as f64).ln();
        entries.extend(atoms.iter().enumerate().map(|(i, atom)| Entry::open(i, atom, share)));
        Self { entries, listed, atoms }
    }

    /// Whether a set holds an open form.
    pub fn is_open(&self, set: &Set) -> bool {
        set.members.iter().any(|m| m.entry >= self.listed)
    }
}

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
}

impl Solution {
    /// Log posterior odds of the best hypothesis against nothing.
    pub fn statistic(&self) -> f64 {
        let best = self.listed.iter().chain(&self.open).map(|w| w.log_posterior).fold(f64::NEG_INFINITY, f64::max);
        best - self.null.log_posterior
    }

    /// Log posterior odds of the best open hypothesis against the best listed one (or nothing, if that is better).
    pub fn open_advantage(&self) -> f64 {
        let top = |sets: &[Weighed]| sets.first().map_or(f64::NEG_INFINITY, |w| w.log_posterior);
        top(&self.open) - top(&self.listed).max(self.null.log_posterior)
    }
}

/// Search and weigh. `start` is a first guess of the noise, when one is at hand.
pub fn solve(scene: &Scene, library: &Library, start: Option<&[AxisNoise; 3]>) -> Solution {
    match solve_unless(scene, library, start, &|| false) {
        Some(solution) => solution,
        None => unreachable!("nobody asked to stop"),
    }
}

/// As [`solve`], and `None` as soon as `stop` says so: it is asked every second or so of work.
pub fn solve_unless(
    scene: &Scene,
    library: &Library,
    start: Option<&[AxisNoise; 3]>,
    stop: &dyn Fn() -> bool,
) -> Option<Solution> {
    let entries = &library.entries;
    let noise_null = search::fit_noise(scene, &scene.residual_ng, start, if start.is_some() { 50 } else { 110 });
    let null = search::weigh_with_own_noise(scene, entries, &Set::default(), &noise_null, 0, 0);
    let listed_ids: Vec<usize> = (0..library.listed).collect();
    let open_ids: Vec<usize> = (library.listed..entries.len()).collect();
    let mut noise = noise_null;
    let mut best_key = Vec::new();
    let mut round = 0;
    let mut singles: Vec<(usize, f64)> = Vec::new();
    let (listed, opens) = loop {
        if stop() {
            return None;
        }
        let frame = Frame::new(&noise, &scene.schedule, &scene.activity, &scene.residual_ng);
        let bank = Bank::new(&frame, entries);
        if round == 0 {
            let nothing = Set::default();
            let chosen = nothing.chosen(&frame);
            singles = (0..entries.len()).map(|i| (i, search::best_of_entry(&bank, i, &chosen).0)).collect();
        }
        let mut listed = search::grow(&frame, &bank, &listed_ids, vec![Set::default()], SET_MAX);
        listed.retain(|s| !s.members.is_empty());
        if stop() {
            return None;
        }
        polish(scene, &frame, entries, &mut listed, 8);
        let mut seeds = vec![Set::default()];
        seeds.extend(listed.iter().take(2).cloned());
        let mut opens: Vec<Set> = Vec::new();
        for seed in seeds {
            let size = seed.members.len() + 1;
            let mut grown = search::grow(&frame, &bank, &open_ids, vec![seed], size);
            grown.retain(|s| library.is_open(s));
            grown.truncate(3);
            opens.extend(grown);
        }
        opens.sort_by(|a, b| b.score.total_cmp(&a.score));
        // An open form with what the catalogue adds to it.
        let mut joined = search::grow(&frame, &bank, &listed_ids, opens.iter().take(2).cloned().collect(), 2);
        joined.retain(|s| library.is_open(s));
        opens.extend(joined.into_iter().take(4));
        distinct(&mut opens);
        round += 1;
        let top = [listed.first(), opens.first()].into_iter().flatten().max_by(|a, b| a.score.total_cmp(&b.score));
        let Some(top) = top else { break (listed, opens) };
        if top.score < WORTH_A_REFIT || round == 3 || top.key() == best_key {
            break (listed, opens);
        }
        best_key = top.key();
        noise = search::weigh_with_own_noise(scene, entries, top, &noise, 2, 50).noise;
    };
    let weigh = |sets: Vec<Set>, count: usize| -> Option<Vec<Weighed>> {
        let top = sets.first().map_or(0.0, |s| s.score);
        let worth = top > WORTH_A_REFIT;
        let keep = sets.into_iter().filter(|s| s.score > top - 14.0).take(if worth { count } else { 1 });
        let rounds = if worth { 2 } else { 1 };
        let mut weighed = keep
            .map(|s| (!stop()).then(|| search::weigh_with_own_noise(scene, entries, &s, &noise, rounds, 40)))
            .collect::<Option<Vec<Weighed>>>()?;
        weighed.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
        Some(weighed)
    };
    Some(Solution { listed: weigh(listed, OWN_NOISE[0])?, open: weigh(opens, OWN_NOISE[1])?, null, singles })
}

/// Refine the best sets at one noise, and sort again.
fn polish(scene: &Scene, frame: &Frame, entries: &[Entry], sets: &mut Vec<Set>, count: usize) {
    let top = sets.first().map_or(0.0, |s| s.score);
    sets.retain(|s| s.score > top - 16.0);
    sets.truncate(count);
    if top > WORTH_A_REFIT {
        for set in sets.iter_mut() {
            search::refine(scene, frame, entries, set);
        }
    }
    sets.sort_by(|a, b| b.score.total_cmp(&a.score));
}

fn distinct(sets: &mut Vec<Set>) {
    sets.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut keys: Vec<Vec<usize>> = Vec::new();
    sets.retain(|s| {
        let key = s.key();
        let new = !keys.contains(&key);
        keys.push(key);
        new
    });
}

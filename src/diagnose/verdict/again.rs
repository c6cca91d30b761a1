//! Is there one push more that no log has: what is named once more, or one for a while? The catalogue's leaks, steps and shifts begin once and a
//! leak dies away; a valve that opens twice, or is shut again, is outside it, and hides in the slow noise fitted to what remains.

use std::slice::from_ref;

use crate::diagnose::answer::Interval;
use crate::diagnose::design::Frame;
use crate::diagnose::noise::AxisNoise;
use crate::diagnose::open_form::PUSH;
use crate::diagnose::remains::{self, Remains};
use crate::diagnose::scene::Scene;
use crate::diagnose::search::{self, Bank, Entry, Set, Weighed};
use crate::diagnose::solve::{Library, Solution, quiet};
use crate::math::rms::rms_about_mean;

/// Log score of one push more, at the noise with or without a slow part, from which on it is weighed with its own noise: as likely as none.
const WORTH_WEIGHING: f64 = 0.0;
/// Times its noise is fitted, and evaluations each: the noise it is found at is far from its own.
const ROUNDS: usize = 3;
const EVALUATIONS: usize = 60;

/// What is named once more, or a push for a while beside it, whichever is likelier, as what remains. Where nothing is named it must be likelier than
/// every set that the catalogue has, too.
pub fn again(scene: &Scene, library: &Library, solution: &Solution, weighed: &Weighed) -> Option<Remains> {
    let own = Some(weighed.noise);
    let found = if weighed.set.members.is_empty() {
        // Beside nothing what hides in slow noise is seen without it.
        found_at(scene, library, weighed, &quiet(&weighed.noise).or(own)?)
    } else {
        [own, quiet(&weighed.noise)]
            .iter()
            .flatten()
            .flat_map(|noise| found_at(scene, library, weighed, noise))
            .collect()
    };
    let best = found.into_iter().max_by(|a, b| a.log_posterior.total_cmp(&b.log_posterior))?;
    let listed = solution.listed.iter().map(|listed| listed.log_posterior);
    let without = listed.fold(weighed.log_posterior, f64::max);
    told(scene, library, &best, best.log_posterior - without)
}

/// One push more of every kind, as it is found at some noise and weighed with its own.
fn found_at(scene: &Scene, library: &Library, weighed: &Weighed, noise: &[AxisNoise; 3]) -> Vec<Weighed> {
    let frame = Frame::new(noise, &scene.schedule, &scene.loudness, &scene.residual_ng);
    let mut set = weighed.set.clone();
    set.rewhiten(scene, &frame, &library.entries);
    let chosen = set.chosen(&frame);
    let one_more = |index: usize, entry: &Entry| {
        let bank = Bank::new(&frame, from_ref(entry));
        let (gain, mut second) = search::best_of_entry(&bank.before(&frame.data), 0, &chosen);
        (gain > WORTH_WEIGHING).then(|| {
            let mut both = set.clone();
            second.entry = index;
            both.members.push(second);
            search::weigh_with_own_noise(scene, &library.entries, &both, noise, ROUNDS, EVALUATIONS)
        })
    };
    let named = set.members.iter().map(|member| member.entry).filter(|index| begins(library, *index));
    let once_more = named.filter_map(|index| {
        let seldom = library.seldom_at(scene, index);
        one_more(index, seldom.as_ref().unwrap_or(&library.entries[index]))
    });
    let for_a_while = Entry::listed(scene, &PUSH).and_then(|entry| one_more(library.push(), &entry));
    once_more.chain(for_a_while).collect()
}

/// The last member of a set, as what remains beside the others.
fn told(scene: &Scene, library: &Library, both: &Weighed, log_odds: f64) -> Option<Remains> {
    let (frame, set) = both.framed(scene, &library.entries);
    let second = set.members.last()?;
    let name = library.entries[second.entry].effect()?.id;
    let onset_s = second.theta[0];
    let series = set.contributions(scene, &frame, &library.entries).pop()?;
    let axes = remains::sharing(series.each_ref().map(|axis| rms_about_mean(axis)));
    // Noise has a factor of evidence of K in one record of K at most: prior odds come off, and every kind of push is a chance.
    let log_factor = log_odds - library.entries[second.entry].log_prior - kinds(library, &set).ln();
    let remains = |form, location, end_s, why| Remains {
        probability: (-log_factor).exp().min(1.0),
        energy: 2.0 * log_odds.max(0.0),
        form,
        axis: axes.join(", "),
        axes: axes.clone(),
        location,
        intervals: vec![Interval { start_s: onset_s, end_s, why }],
        period_s: None,
    };
    if second.entry != library.push() {
        let form = format!("the form of {name} once more, from {onset_s:.0} s on");
        let location = format!("it begins twice: the second time has log odds of {log_odds:.1} against none");
        let end_s = scene.clock_s().last().copied().unwrap_or(onset_s);
        return Some(remains(form, location, end_s, format!("{name} once more")));
    }
    let end_s = onset_s + second.theta[1].exp();
    let when = format!("from {onset_s:.0} s to {end_s:.0} s");
    let peak = |axis: &Vec<f64>| axis.iter().copied().fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
    let [x, y, z] = series.each_ref().map(peak);
    let form = format!("[{x:.0}, {y:.0}, {z:.0}] ng x (1 {when}, else 0)");
    let location =
        format!("{when}: a push that ends has log odds of {log_odds:.1} against slow noise and what the catalogue has");
    Some(remains(form, location, end_s, "a push for a while".to_string()))
}

/// Whether an entry begins at an instant of its own.
fn begins(library: &Library, index: usize) -> bool {
    let effect = library.entries[index].effect();
    effect.is_some_and(|effect| effect.nonlinear.iter().any(|parameter| parameter.name == "onset_s"))
}

/// How many kinds of push are asked for beside what is named, when a set has one more than that.
fn kinds(library: &Library, with_one_more: &Set) -> f64 {
    let named = with_one_more.members.len() - 1;
    (1 + with_one_more.members[..named].iter().filter(|member| begins(library, member.entry)).count()) as f64
}

//! Does what is named begin once more? The catalogue's leaks, steps and shifts begin once; a valve that opens twice is outside it, and a
//! second time that is left alone hides in the slow noise fitted to what remains.

use std::slice::from_ref;

use crate::diagnose::answer::Interval;
use crate::diagnose::design::Frame;
use crate::diagnose::noise::AxisNoise;
use crate::diagnose::remains::{self, Remains};
use crate::diagnose::scene::Scene;
use crate::diagnose::search::{self, Bank, Weighed};
use crate::diagnose::solve::{Library, quiet};
use crate::math::rms::rms_about_mean;

/// Log score of a second time, at the noise with or without a slow part, from which on it is weighed with its own noise: as likely as none.
const WORTH_WEIGHING: f64 = 0.0;

/// The best second time of any member with an onset, as what remains.
pub fn again(scene: &Scene, library: &Library, weighed: &Weighed) -> Option<Remains> {
    let noises = [Some(weighed.noise), quiet(&weighed.noise)];
    let twice = noises.iter().flatten().flat_map(|noise| found_at(scene, library, weighed, noise));
    let best = twice.max_by(|a, b| a.log_posterior.total_cmp(&b.log_posterior))?;
    told(scene, library, &best, best.log_posterior - weighed.log_posterior)
}

/// A second time of every member with an onset, as it is found at some noise and weighed with its own.
fn found_at(scene: &Scene, library: &Library, weighed: &Weighed, noise: &[AxisNoise; 3]) -> Vec<Weighed> {
    let frame = Frame::new(noise, &scene.schedule, &scene.loudness, &scene.residual_ng);
    let mut set = weighed.set.clone();
    set.rewhiten(scene, &frame, &library.entries);
    let chosen = set.chosen(&frame);
    let begins = |index: &usize| {
        let effect = library.entries[*index].effect();
        effect.is_some_and(|effect| effect.nonlinear.iter().any(|parameter| parameter.name == "onset_s"))
    };
    let twice = |index: usize| {
        let seldom = library.seldom_at(scene, index);
        let bank = Bank::new(&frame, from_ref(seldom.as_ref().unwrap_or(&library.entries[index])));
        let (gain, mut second) = search::best_of_entry(&bank.before(&frame.data), 0, &chosen);
        (gain > WORTH_WEIGHING).then(|| {
            let mut both = set.clone();
            second.entry = index;
            both.members.push(second);
            search::weigh_with_own_noise(scene, &library.entries, &both, &weighed.noise, 2, 40)
        })
    };
    set.members.iter().map(|member| member.entry).filter(begins).filter_map(twice).collect()
}

/// The last member of a set, as what remains beside the others.
fn told(scene: &Scene, library: &Library, both: &Weighed, log_odds: f64) -> Option<Remains> {
    let (frame, set) = both.framed(scene, &library.entries);
    let second = set.members.last()?;
    let name = library.entries[second.entry].effect()?.id;
    let onset_s = second.theta[0];
    let series = set.contributions(scene, &frame, &library.entries).pop()?;
    let axes = remains::sharing(series.each_ref().map(|axis| rms_about_mean(axis)));
    let clock_s = scene.clock_s();
    let ends_s = clock_s.last().copied().unwrap_or(onset_s);
    Some(Remains {
        probability: (-log_odds).exp().min(1.0),
        energy: 2.0 * log_odds.max(0.0),
        form: format!("the form of {name} once more, from {onset_s:.0} s on"),
        axis: axes.join(", "),
        axes,
        location: format!("it begins twice: the second time has log odds of {log_odds:.1} against none"),
        intervals: vec![Interval { start_s: onset_s, end_s: ends_s, why: format!("{name} once more") }],
        period_s: None,
    })
}

//! Is the lag of a temperature bias the only one? Where the temperature swings with the orbit alone, one that is a turn longer or shorter
//! gives nearly the same series, and its error is that of one of them.

use crate::diagnose::catalogue::{Theta, temperature_bias};
use crate::diagnose::design::Frame;
use crate::diagnose::scene::Scene;
use crate::diagnose::search::Set;
use crate::diagnose::solve::Library;
use crate::math::shared_work;

/// Standard errors from the lag found from which on another is another, and at least a quarter of an orbit, s: nearer is the same peak.
const APART: f64 = 3.0;
const APART_S: f64 = 1500.0;
/// Log odds, of twenty, by which another lag must be the less likely to go without a word.
const ODDS: f64 = 3.0;

/// Another lag that fits as well.
pub fn of_another_lag(scene: &Scene, library: &Library, frame: &Frame, set: &Set) -> Option<String> {
    let is_it = |entry: usize| library.entries[entry].effect().is_some_and(|e| e.id == temperature_bias::EFFECT.id);
    let i = set.members.iter().position(|member| is_it(member.entry))?;
    let member = &set.members[i];
    let far_s = APART_S.max(APART * member.theta_sigma[0]);
    let points = library.entries[member.entry].points.iter().map(|(theta, _)| *theta);
    let others: Vec<Theta> = points.filter(|theta| (theta[0] - member.theta[0]).abs() > far_s).collect();
    let evidence = |theta: &Theta| {
        let mut other = set.clone();
        other.members[i].theta = *theta;
        other.rewhiten(scene, frame, &library.entries);
        (theta[0], other.chosen(frame).log_evidence)
    };
    let tried = shared_work::map(&others, evidence);
    let (lag_s, likeliest) = tried.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let less = set.chosen(frame).log_evidence - likeliest;
    (less < ODDS).then(|| {
        format!(
            "temperature_bias: a lag of some {lag_s:.0} s fits as well (log odds of {:.1} against it), and the error of lag_s is that of the \
             one named alone",
            less.max(0.0)
        )
    })
}

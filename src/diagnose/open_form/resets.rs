//! Forms that begin anew: counted from the last change of attitude, and from the last gap of the recording, which a calibration or lost
//! data leave.

use super::Collector;
use super::history::{PAUSE_TAUS_S, since};
use crate::diagnose::case::{HALF_WINDOW_S, WINDOW_STRIDE_S};
use crate::diagnose::instants::changes_of_attitude;
use crate::diagnose::scene::Scene;

/// Windows that are missing in what counts as a gap: fewer are lost on the way, and nothing happens in them.
const GAP_WINDOWS: f64 = 4.0;

/// Where the gaps of a recording end.
fn gap_ends(clock_s: &[f64]) -> Vec<f64> {
    let gap = |w: &[f64]| w[1] - w[0] > (GAP_WINDOWS + 0.5) * WINDOW_STRIDE_S;
    clock_s.windows(2).filter(|w| gap(w)).map(|w| w[1] - HALF_WINDOW_S).collect()
}

/// Time at each window since the last of the instants, s; before the first, since the record began, or none at all.
fn elapsed(clock_s: &[f64], instants: &[f64], from_the_beginning: bool) -> Vec<f64> {
    let since = |t: &f64| match instants.partition_point(|at| at <= t) {
        0 if from_the_beginning => t - clock_s[0],
        0 => 0.0,
        n => t - instants[n - 1],
    };
    clock_s.iter().map(since).collect()
}

/// What grows with the time since the last instant, and is set back by the next.
fn growing(s: &Scene, what: &str, instants: &[f64]) -> Vec<(String, Vec<f64>)> {
    type Growth = fn(f64) -> f64;
    let shapes: [(&str, Growth); 4] = [
        ("u", |u| u),
        ("u^(1/2)", f64::sqrt),
        ("log(1 + u/200 s)", |u| (u / 200.0).ln_1p()),
        ("log(1 + u/2000 s)", |u| (u / 2000.0).ln_1p()),
    ];
    let mut members = Vec::new();
    for (from_the_beginning, words) in [(true, "the beginning or "), (false, "")] {
        let elapsed = elapsed(s.clock_s(), instants, from_the_beginning);
        for (said, shape) in shapes {
            let formula = format!("{said}, u the time since {words}the last {what}");
            members.push((formula, elapsed.iter().map(|u| shape(*u)).collect()));
        }
    }
    members
}

pub(super) fn resets(c: &mut Collector) {
    let s = c.scene;
    let [start, end] = s.span_s();
    let inside = |instants: Vec<f64>| instants.into_iter().filter(|t| (start..end).contains(t)).collect::<Vec<f64>>();
    let [changes, _] = changes_of_attitude(s).map(inside);
    let gaps = gap_ends(s.clock_s());
    for (what, covariate, place, instants) in [
        ("change of attitude", "time_since_manoeuvre", "between changes of attitude", &changes),
        ("gap", "time_since_gap", "between gaps of the recording", &gaps),
    ] {
        // What is set back once is the catalogue's own step or drift.
        if instants.len() > 1 {
            c.family(covariate, place, growing(s, what, instants));
        }
    }
    if gaps.len() > 1 {
        let instants: Vec<(f64, f64)> = gaps.iter().map(|t| (*t, 1.0)).collect();
        let dying = |tau: f64| (format!("exp(-(time since a gap)/{tau:.0} s)"), since(s, &instants, tau));
        c.family("time_since_gap", "after gaps of the recording", PAUSE_TAUS_S.map(dying));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_is_counted_from_the_end_of_the_last_gap() {
        let clock_s: Vec<f64> =
            (0..40).filter(|i| !(10..20).contains(i) && *i != 30).map(|i| 25.0 * f64::from(i)).collect();
        let gaps = gap_ends(&clock_s);
        assert_eq!(gaps, [475.0]);
        let at =
            |clock: f64, from: bool| elapsed(&clock_s, &gaps, from)[clock_s.iter().position(|t| *t == clock).unwrap()];
        assert_eq!((at(100.0, true), at(100.0, false), at(500.0, true), at(975.0, false)), (100.0, 0.0, 25.0, 500.0));
    }
}

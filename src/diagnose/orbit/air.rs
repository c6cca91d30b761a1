//! How thin the air becomes with height, where drag is what is lacking: the assumed scale height is that of 300 to 400 km under a mean Sun,
//! and what another makes of an orbit's own heights would be named as a push of something else.

use super::arc::{Arc, ArcFit};
use super::compare;
use super::forces::{Air, Term};
use super::search::{Problem, SCORE_MIN, Search, with};
use crate::diagnose::measured::spread::median;
use crate::diagnose::optimise::nelder_mead;

/// Scale heights that are tried, m: of a quiet Sun at 300 km to those above 800 km.
const TRIED_M: [f64; 6] = [35e3, 45e3, 80e3, 110e3, 160e3, 250e3];
/// The best of them is refined from a first step of this much of its logarithm.
const FIRST_STEP: f64 = 0.1;
const EVALUATIONS: usize = 18;

/// The search again in air that explains more, if drag was found and there is such.
pub fn settled(problem: &mut Problem, search: Search) -> Search {
    let last = search.last();
    if !last.accepted.iter().any(|(term, _)| *term == Term::Drag) {
        return search;
    }
    // Drag alone beside what is known, so that no other push bends to its shape.
    let known = last.accepted.iter().map(|(term, _)| *term).filter(|term| term.is_known_size());
    let model = known.chain([Term::Drag]).fold(problem.baseline.clone(), |model, term| with(&model, term));
    let height_m = median(problem.arcs.iter().map(|arc| arc.height_median_m()));
    let mean = problem.environment.air;
    let mut fits = |air: Air| -> Vec<ArcFit> {
        problem.environment.air = air;
        let one =
            |(arc, from): (&Arc, &ArcFit)| arc.fit(&problem.environment, &model, &model.estimated, &[], Some(from));
        problem.arcs.iter().zip(&last.fits).map(one).collect()
    };
    let left = |fits: &[ArcFit]| -> f64 {
        problem.arcs.iter().zip(fits).map(|(arc, fit)| fit.rms_m(0..arc.fitted).ln()).sum()
    };
    let usual = fits(mean);
    let mut tried = |scale_height_m: f64| left(&fits(Air::about(height_m, scale_height_m)));
    let coarse = TRIED_M.map(|scale_height_m| (scale_height_m, tried(scale_height_m)));
    let best = coarse.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)).map(|(scale_height_m, _)| scale_height_m);
    let (widest, least) = (2.0 * TRIED_M[TRIED_M.len() - 1], 0.5 * TRIED_M[0]);
    let worse = |at: &[f64]| match at[0].exp() {
        outside if outside < least || outside > widest => f64::INFINITY,
        scale_height_m => tried(scale_height_m),
    };
    let start = best.map_or(mean.scale_height_m, |best| best).ln();
    let air = Air::about(height_m, nelder_mead(&[start], &[FIRST_STEP], EVALUATIONS, worse)[0].exp());
    let refined = fits(air);
    problem.environment.air = mean;
    if compare::evidence_over(problem, &refined, &usual) <= SCORE_MIN {
        return search;
    }
    problem.environment.air = air;
    let other = problem.search(&mut |_| ());
    if compare::evidence_over(problem, &other.end().fits, &search.end().fits) > 0.0 {
        return other;
    }
    problem.environment.air = mean;
    search
}

//! Does what a hypothesis leaves follow several variables together? Polynomials of them, all terms at once, against nothing.
//!
//! A dictionary has the forms that someone thought of. A law of two conditions or of a direction may have any form, and its polynomials
//! take a share of most. As everywhere, the evidence is that of the windows with all coefficients marginalised, here with a prior of one
//! of several sizes, and with the noise fitted to what the polynomial leaves: what the fit of nothing takes for slow noise may follow
//! something. By chance, odds against the truth exceed x once in x at most: that bounds the probability.

mod questions;

use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, DVector};

use self::questions::{Question, questions};
use super::axes;
use super::design::{Column, Frame, OnAxis};
use super::noise::{AxisNoise, Stretch};
use super::remains::{self, Remains};
use super::scene::{Axes, Scene};
use super::search::{self, Left};
use super::solve::quiet;
use crate::math::rms::rms_about_mean;
use crate::math::shared_work;

/// Prior sizes of a coefficient, ng, all as likely.
const SIZES_NG: [f64; 4] = [0.5, 1.5, 5.0, 15.0];
/// Kinds of polynomials of a question: of all terms up to a level, and of a single term.
const KINDS: usize = 2;
/// Axes a law may act on, with the log of their prior.
const AXES: [(&[usize], f64); 4] = [(&[0, 1, 2], -0.693), (&[0], -1.792), (&[1], -1.792), (&[2], -1.792)];
/// Log score from which a polynomial is weighed with its own noise, and how many of those found at one noise.
const WORTH_A_REFIT: f64 = 0.0;
const REFITS: usize = 3;
/// Fits of the noise of each, and evaluations of a fit.
const ROUNDS: usize = 2;
const EVALUATIONS: usize = 40;
/// Terms that are told, and what the log evidence of each must be beside those before it, prior sizes apart.
const TOLD: usize = 3;
const TOLD_GAIN: f64 = 8.0;

/// A polynomial.
#[derive(Clone)]
struct Polynomial<'a> {
    question: &'a Question,
    /// Its terms: all up to a level, or a single one.
    terms: Range<usize>,
    size_ng: f64,
    axes: &'static [usize],
    /// Log of its share of the prior.
    log_prior: f64,
    /// Log evidence and prior at the noise it was found at.
    score: f64,
}

/// Normal equations of terms on an axis.
struct Equations {
    products: DMatrix<f64>,
    right: DVector<f64>,
}

impl Equations {
    fn new(frame: &Frame, series: &[Vec<f64>], axis: usize) -> Self {
        let on_axis = series.iter().map(|series| vec![OnAxis { axis, series: Stretch::of(series), size: 1.0 }]);
        let columns: Vec<Column> = frame.columns(&on_axis.collect::<Vec<Vec<OnAxis>>>());
        let mut products = DMatrix::zeros(columns.len(), columns.len());
        for (i, column) in columns.iter().enumerate() {
            for (j, other) in columns[..=i].iter().enumerate() {
                let product = column.dot(other);
                products[(i, j)] = product;
                products[(j, i)] = product;
            }
        }
        Self { products, right: DVector::from_iterator(columns.len(), columns.iter().map(|c| c.dot(&frame.data))) }
    }

    /// Log evidence of some terms against none, with coefficients of a prior size, and their posterior means, ng.
    fn evidence(&self, terms: &Range<usize>, size_ng: f64) -> Option<(f64, DVector<f64>)> {
        let (first, count) = (terms.start, terms.len());
        let products = self.products.view((first, first), (count, count));
        let normal = Cholesky::new(products * size_ng.powi(2) + DMatrix::identity(count, count))?;
        let right = self.right.rows(first, count).into_owned();
        let means = normal.solve(&right) * size_ng.powi(2);
        let log_det: f64 = normal.l_dirty().diagonal().iter().map(|root| root.ln()).sum();
        Some((0.5 * right.dot(&means) - log_det, means))
    }

    /// Reduction of half the chi square by the least squares of some terms, their coefficients, and the covariance of those.
    fn fitted(&self, terms: &[usize]) -> Option<(f64, DVector<f64>, DMatrix<f64>)> {
        let n = terms.len();
        let right = DVector::from_fn(n, |i, _| self.right[terms[i]]);
        let covariance = Cholesky::new(DMatrix::from_fn(n, n, |i, j| self.products[(terms[i], terms[j])]))?.inverse();
        let coefficients = &covariance * &right;
        Some((0.5 * right.dot(&coefficients), coefficients, covariance))
    }
}

/// A polynomial weighed with the noise of what it leaves.
struct Weighed {
    /// Log posterior, but for its prior.
    log_posterior: f64,
    noise: [AxisNoise; 3],
    /// What it takes away, ng.
    signal_ng: Axes,
}

/// What is left follows, most probably; its probability is an upper bound.
pub fn strongest(scene: &Scene, noise: &[AxisNoise; 3], left: &Left) -> Option<Remains> {
    let left_ng = &left.residual_ng;
    let questions = questions(scene);
    let frame_of = |noise: &[AxisNoise; 3]| Frame::new(noise, &scene.schedule, &scene.loudness, left_ng);
    let found_at = |noise: [AxisNoise; 3]| {
        let mut found = best_of_each(&frame_of(&noise), &questions);
        found.retain(|p| p.score > WORTH_A_REFIT);
        found.truncate(REFITS);
        found.into_iter().map(|p| (noise, p)).collect::<Vec<([AxisNoise; 3], Polynomial)>>()
    };
    let mut found = found_at(*noise);
    found.extend(quiet(noise).into_iter().flat_map(found_at));
    let weighed = shared_work::map(&found, |(noise, p)| Some((p, weigh(scene, left_ng, p, noise)?)));
    let height = |(p, weighed): &(&Polynomial, Weighed)| weighed.log_posterior + p.log_prior;
    let (best, weighed) = weighed.into_iter().flatten().max_by(|a, b| height(a).total_cmp(&height(b)))?;
    let nothing = search::height(scene, &frame_of(noise), noise, left_ng).0;
    told(scene, best, &weighed, left_ng, nothing)
}

/// The best polynomials of each question at the noise of a frame, of all terms up to a level and of one term: the best of all first.
fn best_of_each<'a>(frame: &Frame, questions: &'a [Question]) -> Vec<Polynomial<'a>> {
    let best = |question: &'a Question| {
        let equations = [0, 1, 2].map(|axis| Equations::new(frame, &question.series, axis));
        let best_of = |kinds: Vec<Range<usize>>| {
            let share = -((KINDS * questions.len() * kinds.len() * SIZES_NG.len()) as f64).ln();
            let mut best: Option<Polynomial> = None;
            for (terms, size_ng) in kinds.iter().flat_map(|terms| SIZES_NG.map(|size| (terms, size))) {
                let alone = equations.each_ref().map(|e| e.evidence(terms, size_ng).map_or(f64::NEG_INFINITY, |e| e.0));
                for (axes, prior) in AXES {
                    let log_prior = share + prior;
                    let score = axes.iter().map(|k| alone[*k]).sum::<f64>() + log_prior;
                    if best.as_ref().is_none_or(|best| score > best.score) {
                        best = Some(Polynomial { question, terms: terms.clone(), size_ng, axes, log_prior, score });
                    }
                }
            }
            best
        };
        let levels = question.until.iter().map(|count| 0..*count).collect();
        let single = (0..question.series.len()).map(|i| i..i + 1).collect();
        [best_of(levels), best_of(single)]
    };
    let mut all: Vec<Polynomial> = shared_work::map(questions, best).into_iter().flatten().flatten().collect();
    all.sort_by(|a, b| b.score.total_cmp(&a.score));
    all
}

/// Weighs a polynomial, alternately fitted and the noise of what it leaves.
fn weigh(scene: &Scene, left_ng: &Axes, p: &Polynomial, start: &[AxisNoise; 3]) -> Option<Weighed> {
    let series = &p.question.series[p.terms.clone()];
    let mut noise = *start;
    for round in 0.. {
        let frame = Frame::new(&noise, &scene.schedule, &scene.loudness, left_ng);
        let mut signal_ng = axes::nothing(scene.schedule.len());
        let mut evidence = 0.0;
        for k in p.axes {
            let (of_axis, means) = Equations::new(&frame, series, *k).evidence(&(0..p.terms.len()), p.size_ng)?;
            evidence += of_axis;
            for (coefficient, term) in means.iter().zip(series) {
                signal_ng[*k].iter_mut().zip(term).for_each(|(x, term)| *x += coefficient * term);
            }
        }
        let mut beside_ng = left_ng.clone();
        axes::add(&mut beside_ng, &signal_ng, -1.0);
        if round == ROUNDS {
            let height = search::height(scene, &frame, &noise, &beside_ng).0;
            return Some(Weighed { log_posterior: height + evidence, noise, signal_ng });
        }
        noise = search::fit_noise(scene, &beside_ng, Some(&noise), EVALUATIONS);
    }
    None
}

/// As what remains, beside a log posterior of nothing.
fn told(scene: &Scene, p: &Polynomial, weighed: &Weighed, left_ng: &Axes, nothing: f64) -> Option<Remains> {
    let frame = Frame::new(&weighed.noise, &scene.schedule, &scene.loudness, left_ng);
    let equations: Vec<(usize, Equations)> =
        p.axes.iter().map(|k| (*k, Equations::new(&frame, &p.question.series[p.terms.clone()], *k))).collect();
    let terms = main_terms(p.terms.len(), &equations);
    let mut formula = Vec::new();
    for (i, term) in terms.iter().enumerate() {
        let of_axis = |(_, e): &(usize, Equations)| {
            let (_, coefficients, covariance) = e.fitted(&terms)?;
            Some(format!("{:.2}({:.2})", coefficients[i], covariance[(i, i)].sqrt()))
        };
        let coefficients: Vec<String> = equations.iter().map(of_axis).collect::<Option<_>>()?;
        formula.push(format!("[{}] ng x {}", coefficients.join(", "), p.question.said[p.terms.start + *term]));
    }
    let log_odds = weighed.log_posterior + p.log_prior - nothing;
    let amplitude = weighed.signal_ng.each_ref().map(|series| rms_about_mean(series));
    Some(Remains {
        probability: (-log_odds).exp().min(1.0),
        energy: 2.0 * (log_odds - p.log_prior).max(0.0),
        form: formula.join(" + "),
        axis: p.axes.iter().map(|k| ["x", "y", "z"][*k]).collect::<Vec<_>>().join(", "),
        axes: remains::sharing(amplitude),
        location: format!(
            "it follows {}: {} log odds of {log_odds:.1} against nothing{}",
            p.question.what,
            match p.terms.len() {
                1 => "one term has".to_string(),
                n => format!("{n} terms together have"),
            },
            if p.terms.len() == 1 { "" } else { ", and those told say most" }
        ),
        intervals: Vec::new(),
        period_s: None,
    })
}

/// The terms that say most, each the best beside those before it.
fn main_terms(count: usize, equations: &[(usize, Equations)]) -> Vec<usize> {
    let gain = |terms: &[usize]| -> f64 {
        equations.iter().map(|(_, e)| e.fitted(terms).map_or(f64::NEG_INFINITY, |fit| fit.0)).sum()
    };
    let mut terms = Vec::new();
    let mut so_far = 0.0;
    while terms.len() < TOLD {
        let with = |i: usize| [&terms[..], &[i]].concat();
        let more = (0..count).filter(|i| !terms.contains(i)).map(|i| (gain(&with(i)), i));
        let Some((best, i)) = more.max_by(|a, b| a.0.total_cmp(&b.0)) else { break };
        if !terms.is_empty() && best < so_far + TOLD_GAIN {
            break;
        }
        so_far = best;
        terms.push(i);
    }
    terms
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::diagnose::catalogue::made;
    use crate::diagnose::noise::simulate;

    const NOISE: AxisNoise = AxisNoise {
        white_ng: 50.0,
        short_ng: 10.0,
        short_tau_s: 100.0,
        slow_ng: 8.0,
        slow_tau_s: 3000.0,
        resonance: None,
    };

    /// What is found in noise of a seed.
    fn found(scene: &Scene, seed: u64) -> Option<Remains> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let residual_ng: Axes = std::array::from_fn(|k| {
            simulate(&NOISE, &scene.schedule, &scene.loudness[k], || StandardNormal.sample(&mut rng))
        });
        let noise = search::fit_noise(scene, &residual_ng, None, 110);
        strongest(scene, &noise, &Left { whitened: residual_ng.clone(), residual_ng })
    }

    /// Fifty records: a probability below a thousandth, which is a bound, has less than one chance in twenty among them.
    #[test]
    fn noise_follows_nothing() {
        let case = made::case();
        let scene = Scene::new(&case).unwrap();
        for seed in 0..50 {
            let found = found(&scene, seed);
            assert!(found.as_ref().is_none_or(|r| r.probability > 1e-3), "{seed}: {found:?}");
        }
    }

    /// The evidence of one term is that of a number measured with an error, its prior a normal one about nothing.
    #[test]
    fn the_evidence_of_a_term_is_that_of_a_number_with_an_error() {
        let equations = Equations { products: DMatrix::from_element(1, 1, 4.0), right: DVector::from_element(1, 6.0) };
        // 1.5 +- 0.5, beside 0 +- root(0.25 + 9) and 0 +- 0.5.
        let log_normal = |variance: f64| -0.5 * (1.5_f64.powi(2) / variance + variance.ln());
        let (evidence, mean) = equations.evidence(&(0..1), 3.0).unwrap();
        assert!((evidence - (log_normal(9.25) - log_normal(0.25))).abs() < 1e-12, "{evidence}");
        assert!((mean[0] - 1.5 * 9.0 / 9.25).abs() < 1e-12);
    }
}

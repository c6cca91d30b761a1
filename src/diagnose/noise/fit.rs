//! The likeliest noise of three axes, with its prior.

use super::likelihood::{Series, products};
use super::{AxisNoise, Loudness, Resonance, Schedule};
use crate::diagnose::optimise::Simplex;

/// Evaluations of fits from no beginning that are compared.
pub(super) const EVALUATIONS: usize = 110;

/// Amplitude at which the prior of the slow part turns down, ng.
const SLOW_PRIOR_NG: f64 = 10.0;
/// Longest and shortest correlation time of the slow part, s.
const SLOW_TAU_S: [f64; 2] = [300.0, 10_800.0];

/// Log prior of the noise (densities in the logarithms of its parameters).
pub(super) fn log_prior(noise: &AxisNoise) -> f64 {
    let slow = noise.slow_ng / SLOW_PRIOR_NG;
    let tau = noise.slow_tau_s.ln();
    let wall = |x: f64| if x > 0.0 { 0.0 } else { -0.5 * (x / 0.15).powi(2) };
    log_prior_but_slow(noise)
        + (slow / (1.0 + slow * slow)).ln()
        + wall(tau - SLOW_TAU_S[0].ln())
        + wall(SLOW_TAU_S[1].ln() - tau)
}

/// The same without that of the slow part.
pub fn log_prior_but_slow(noise: &AxisNoise) -> f64 {
    let lognormal = |x: f64, centre: f64, width: f64| -0.5 * ((x / centre).ln() / width).powi(2);
    lognormal(noise.short_ng / noise.white_ng, 0.2, 0.6) + lognormal(noise.short_tau_s, 100.0, 0.6)
}

/// The axes in the lanes of a register: the first goes along twice, which is faster than a lane left empty.
const AXIS_OF_LANE: [usize; 4] = [0, 1, 2, 0];

/// Fit the noise of the axes side by side, each to its residual, in which a constant and `shared_ng` are nuisance; from `start`
/// if there is one.
pub fn fit(
    residual_ng: [&[f64]; 3],
    shared_ng: [&[Vec<f64>]; 3],
    schedule: &Schedule,
    loudness: [&Loudness; 3],
    start: Option<[&AxisNoise; 3]>,
    evaluations: usize,
) -> [AxisNoise; 3] {
    fit_and_likelihoods(residual_ng, shared_ng, schedule, loudness, start, evaluations).map(|(noise, _)| noise)
}

/// The same, each with the log likelihood of its noise, the prior of that included.
pub(super) fn fit_and_likelihoods(
    residual_ng: [&[f64]; 3],
    shared_ng: [&[Vec<f64>]; 3],
    schedule: &Schedule,
    loudness: [&Loudness; 3],
    start: Option<[&AxisNoise; 3]>,
    evaluations: usize,
) -> [(AxisNoise, f64); 3] {
    let n = schedule.len() as f64;
    let rms_ng = residual_ng.map(|residual| {
        let mean = residual.iter().sum::<f64>() / n;
        (residual.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt().max(1e-6)
    });
    // A resonance stays as it began, beside the white noise.
    let beside = |k: usize| start.and_then(|start| Some((start[k].resonance?, start[k].white_ng)));
    let noise_of = |k: usize, p: &[f64], scale_ng: f64| AxisNoise {
        resonance: beside(k).map(|(r, white_ng)| Resonance { rms_ng: r.rms_ng * scale_ng / white_ng, ..r }),
        ..from_logarithms(p, scale_ng)
    };
    let series = AXIS_OF_LANE.map(|k| Series { data: residual_ng[k], shared: shared_ng[k] });
    let loudness = AXIS_OF_LANE.map(|k| loudness[k]);
    // The overall scale is profiled: one rescaling step is exact up to the prior of the slow amplitude.
    let evaluate = |points: [&[f64]; 3]| {
        let unit = AXIS_OF_LANE.map(|k| noise_of(k, points[k], rms_ng[k]));
        let found = products(&unit, schedule, loudness, series);
        std::array::from_fn::<(AxisNoise, f64), 3, _>(|k| {
            let scale2 = found[k].likeliest_scale2();
            let noise = noise_of(k, points[k], rms_ng[k] * (0.5 * scale2.ln()).exp());
            (noise, found[k].log_likelihood(scale2) + log_prior(&noise))
        })
    };
    let width = if start.is_some() { [0.25, 0.25, 0.4, 0.4] } else { [0.5, 0.5, 0.8, 0.8] };
    let usual = match start {
        Some(_) => [BEGINS[0]; 3],
        None => {
            let values = BEGINS.map(|begin| evaluate([&begin; 3]).map(|(_, value)| value));
            std::array::from_fn(|k| {
                let best = (0..BEGINS.len()).max_by(|a, b| values[*a][k].total_cmp(&values[*b][k])).unwrap_or(0);
                BEGINS[if values[best][k] > values[0][k] + FAR_BETTER { best } else { 0 }]
            })
        }
    };
    let mut simplexes = std::array::from_fn::<Simplex, 3, _>(|k| {
        let begin = start.map_or(usual[k], |start| logarithms(start[k]));
        Simplex::new(&begin, &width, evaluations)
    });
    loop {
        for simplex in &mut simplexes {
            while simplex.asks().is_some_and(is_outside) {
                simplex.hears(f64::INFINITY);
            }
        }
        if simplexes.iter().all(|simplex| simplex.asks().is_none()) {
            break;
        }
        // A simplex that is done goes along at the middle of its bounds.
        let values = evaluate(simplexes.each_ref().map(|simplex| simplex.asks().unwrap_or(&MIDDLE)));
        for (simplex, (_, value)) in simplexes.iter_mut().zip(values) {
            if simplex.asks().is_some() {
                simplex.hears(-value);
            }
        }
    }
    let best = simplexes.map(Simplex::best);
    evaluate(best.each_ref().map(|p| &p[..]))
}

/// The numbers of a noise that are fitted: logarithms of the short part's share of the white noise and of its time, s, and of the slow
/// part's.
pub(super) fn logarithms(noise: &AxisNoise) -> [f64; 4] {
    [
        (noise.short_ng / noise.white_ng).ln(),
        noise.short_tau_s.ln(),
        (noise.slow_ng / noise.white_ng).ln(),
        noise.slow_tau_s.ln(),
    ]
}

/// The noise of such numbers and of so much white noise.
pub(super) fn from_logarithms(p: &[f64], white_ng: f64) -> AxisNoise {
    AxisNoise {
        white_ng,
        short_ng: white_ng * p[0].exp(),
        short_tau_s: p[1].exp(),
        slow_ng: white_ng * p[2].exp(),
        slow_tau_s: p[3].exp(),
        resonance: None,
    }
}

/// Whether such numbers are beyond their bounds.
pub(super) fn is_outside(p: &[f64]) -> bool {
    p.iter().zip(BOUNDS).any(|(x, [low, high])| *x < low || *x > high)
}

/// Where a fit begins: the logarithms of 0.2, 100 s, 0.1 and 3000 s; and, where the noise is one with a memory and hardly white at
/// all, with as much of the short part and four and ten
/// times as much, of 25 s, 70 s and 200 s; and, where it is all but slow, with four and sixteen times as much of that, of 1000 s and
/// 6000 s.
const BEGINS: [[f64; 4]; 13] = [
    [-1.609_437_912_434_100_3, 4.605_170_185_988_092, -2.302_585_092_994_045_5, 8.006_367_567_650_246],
    [0.0, 3.2, -2.30, 8.01],
    [0.0, 4.25, -2.30, 8.01],
    [0.0, 5.3, -2.30, 8.01],
    [1.4, 3.2, -2.30, 8.01],
    [1.4, 4.25, -2.30, 8.01],
    [1.4, 5.3, -2.30, 8.01],
    [2.3, 4.25, -2.30, 8.01],
    [2.3, 5.3, -2.30, 8.01],
    [-1.61, 4.61, 1.4, 6.9],
    [-1.61, 4.61, 1.4, 8.7],
    [-1.61, 4.61, 2.8, 6.9],
    [-1.61, 4.61, 2.8, 8.7],
];
/// Log likelihood by which another beginning must be better than the usual one.
const FAR_BETTER: f64 = 20.0;

/// Bounds of a fit.
pub(super) const BOUNDS: [[f64; 2]; 4] = [[-6.0, 3.0], [2.0, 7.0], [-9.0, 4.0], [5.0, 10.5]];
const MIDDLE: [f64; 4] = [-2.0, 4.5, -2.5, 7.5];

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use rayon::prelude::*;

use super::follow::{Follows, equation};
use super::form::Form;
use super::read::{Axis, CovariateSeries, Series};
use super::search::{AxisFound, regress, search};
use crate::math::rms::rms_about_mean;

const BLOCKS: usize = 200;
/// Memories of the noise tried in turn, in samples: from white to longer than the series.
const MEMORIES: [f64; 5] = [0.3, 3.0, 20.0, 100.0, 1_000.0];

/// A daily temperature over two and a half days that also wanders.
fn series(rng: &mut ChaCha12Rng) -> Series {
    let t_s: Vec<f64> = (0..BLOCKS).map(|i| 1_000.0 * i as f64).collect();
    let wander = red(rng, 60.0, 0.0);
    let values = t_s.iter().zip(wander).map(|(t, w)| 25.0 + 2.0 * (t / 13_751.0).sin() + 0.5 * w).collect();
    let covariates = vec![covariate("temperature", "C", values)];
    Series { t_s, span: vec![0; BLOCKS], spans: 1, axes: Vec::new(), covariates, unread: Vec::new(), masked: 0 }
}

fn covariate(name: &str, unit: &str, values: Vec<f64>) -> CovariateSeries {
    CovariateSeries { name: name.into(), unit: unit.into(), values }
}

fn axis(values: Vec<f64>) -> Axis {
    Axis { column: "a".into(), name: "x".into(), unit: "g".into(), control: false, values, reference: None }
}

fn normal(rng: &mut ChaCha12Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

fn red(rng: &mut ChaCha12Rng, memory: f64, white: f64) -> Vec<f64> {
    let rho = (-1.0 / memory).exp();
    let mut x = normal(rng);
    let mut next = || {
        x = rho * x + (1.0 - rho * rho).sqrt() * normal(rng);
        x + white * normal(rng)
    };
    (0..BLOCKS).map(|_| next()).collect()
}

/// Wanders of every memory, as much of each.
fn flicker(rng: &mut ChaCha12Rng, white: f64) -> Vec<f64> {
    let mut sum = red(rng, 0.3, white);
    for memory in [1.0, 4.0, 16.0, 64.0, 256.0] {
        sum.iter_mut().zip(red(rng, memory, 0.0)).for_each(|(sum, x)| *sum += x);
    }
    sum
}

/// The first effect found with its coefficient and inner number.
fn first(series: &Series, axis: &Axis) -> Option<(Follows, (f64, f64), AxisFound)> {
    let found = search(series, axis, &[]);
    let (follows, _) = *found.effects.first()?;
    Some((follows, found.last().coefficients[0], found))
}

#[test]
fn red_noise_follows_nothing() {
    alarms_in_red_noise(50);
}

#[test]
#[cfg_attr(not(feature = "slow"), ignore = "slow")]
fn red_noise_follows_nothing_over_many_seeds() {
    alarms_in_red_noise(1_000);
}

fn alarms_in_red_noise(seeds: u64) {
    let alarm = |seed: u64| {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let mut series = series(&mut rng);
        let white = [0.0, 0.3][seed as usize / 5 % 2];
        let memory = MEMORIES.get(seed as usize % 6).copied();
        let values = match memory {
            Some(memory) => red(&mut rng, memory, white),
            None => flicker(&mut rng, white),
        };
        for (name, unit, memory) in [("humidity", "%", 40.0), ("pressure", "hPa", 150.0), ("mag_x", "uT", 5.0)] {
            series.covariates.push(covariate(name, unit, red(&mut rng, memory, 0.1)));
        }
        let found = search(&series, &axis(values), &[]);
        (!found.effects.is_empty() || found.form.is_some())
            .then(|| format!("{seed}, memory {memory:?}: {:?} {:?}", found.effects, found.form))
    };
    let alarms: Vec<String> = (0..seeds).into_par_iter().filter_map(alarm).collect();
    println!("{} false alarms in {seeds}: {alarms:?}", alarms.len());
    assert!(alarms.len() as u64 <= seeds / 100, "{alarms:?}");
}

#[test]
fn a_slope_under_red_noise_is_found() {
    let mut named = 0;
    for seed in 0..20 {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let series = series(&mut rng);
        let noise = red(&mut rng, 60.0, 0.1);
        let values: Vec<f64> = noise.iter().zip(&series.covariates[0].values).map(|(n, t)| 0.5 * n + 1.0 * t).collect();
        let found = search(&series, &axis(values), &[]);
        named += usize::from(found.effects.first().is_some_and(|(f, _)| f.id() == "temperature_bias"));
    }
    assert!(named >= 19, "{named} of 20");
}

#[test]
fn the_error_of_a_slope_holds_whatever_the_memory() {
    errors_of_slopes(200);
}

#[test]
#[cfg_attr(not(feature = "slow"), ignore = "slow")]
fn the_error_of_a_slope_holds_whatever_the_memory_over_many_seeds() {
    errors_of_slopes(1_000);
}

fn errors_of_slopes(seeds: u64) {
    for (k, memory) in MEMORIES.into_iter().enumerate() {
        let mut within = 0;
        for seed in 0..seeds {
            let mut rng = ChaCha12Rng::seed_from_u64(10_000 * (k as u64 + 1) + seed);
            let series = series(&mut rng);
            let noise = red(&mut rng, memory, 0.1);
            let values = noise.iter().zip(&series.covariates[0].values).map(|(n, t)| n + 0.7 * t).collect();
            let (slope, sigma) = regress(&series, &axis(values), &[Follows::Temperature(0, 0.0)]).coefficients[0];
            within += usize::from((slope - 0.7).abs() < 2.0 * sigma);
        }
        let share = within as f64 / seeds as f64;
        println!("memory {memory}: {within} of {seeds} within two standard errors");
        // 95.4 % of a normal law; 200 seeds scatter by 1.5 %.
        assert!((0.90..=0.99).contains(&share), "memory {memory}: {share}");
    }
}

#[test]
fn a_step_is_dated_and_sized() {
    steps(20);
}

#[test]
#[cfg_attr(not(feature = "slow"), ignore = "slow")]
fn a_step_is_dated_and_sized_over_many_seeds() {
    steps(200);
}

fn steps(seeds: u64) {
    let (mut named, mut dated, mut sized) = (0, 0, 0);
    for seed in 0..seeds {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let series = series(&mut rng);
        let at = 20 + 8 * (seed as usize % 20);
        let noise = red(&mut rng, 5.0, 0.5);
        let values = noise.iter().enumerate().map(|(i, n)| 0.2 * n + if i > at { 1.5 } else { 0.0 }).collect();
        let Some((Follows::Step(found), (size, sigma), _)) = first(&series, &axis(values)) else { continue };
        named += 1;
        dated += u64::from((found - (at as f64 + 0.5) * 1_000.0).abs() <= 1_500.0);
        sized += u64::from((size - 1.5).abs() < 2.0 * sigma);
    }
    println!("of {seeds} steps: {named} named, {dated} dated to a block, {sized} sized within two standard errors");
    assert!(10 * dated >= 9 * seeds && 10 * sized >= 9 * seeds, "{named} named, {dated} dated, {sized} sized");
}

#[test]
fn a_decay_gives_its_time_constant() {
    let (mut named, mut within) = (0, 0);
    for seed in 0..10 {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let series = series(&mut rng);
        let decay = series.t_s.iter().map(|t| 5.0 * (-t / 30_000.0).exp());
        let values = red(&mut rng, 5.0, 0.5).iter().zip(decay).map(|(n, d)| 0.2 * n + d).collect();
        let Some((Follows::Drift(tau), _, found)) = first(&series, &axis(values)) else { continue };
        named += 1;
        within += usize::from((tau - 30_000.0).abs() < 2.0 * found.inner_sigma[0]);
    }
    assert!(named == 10 && within >= 8, "{named} named, {within} within");
}

#[test]
fn a_late_response_gives_its_lag() {
    let (mut named, mut within) = (0, 0);
    for seed in 0..10 {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let series = series(&mut rng);
        // The truth is integrated finely, between samples along straight lines.
        let (mut state, mut late) = (series.covariates[0].values[0], Vec::new());
        for pair in series.covariates[0].values.windows(2) {
            late.push(state);
            for i in 0..100 {
                let input = pair[0] + (pair[1] - pair[0]) * (f64::from(i) + 0.5) / 100.0;
                state += (input - state) * 10.0 / 6_000.0;
            }
        }
        late.push(state);
        let values = red(&mut rng, 10.0, 0.2).iter().zip(late).map(|(n, x)| 0.1 * n + 1.2 * x).collect();
        let Some((Follows::Temperature(0, lag), (slope, sigma), found)) = first(&series, &axis(values)) else {
            continue;
        };
        named += 1;
        within += usize::from((lag - 6_000.0).abs() < 2.0 * found.inner_sigma[0] && (slope - 1.2).abs() < 2.0 * sigma);
    }
    assert!(named == 10 && within >= 8, "{named} named, {within} within");
}

/// A temperature that changes from hour to hour, and what follows it as it was an hour and a half before.
#[test]
fn a_delayed_response_gives_its_delay() {
    const DELAY: usize = 9;
    let (mut named, mut within) = (0, 0);
    for seed in 0..10 {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let mut series = series(&mut rng);
        series.covariates[0].values = red(&mut rng, 4.0, 0.0);
        let was = |i: usize| series.covariates[0].values[i.saturating_sub(DELAY)];
        let values = red(&mut rng, 10.0, 0.2).iter().enumerate().map(|(i, n)| 0.3 * n + 1.2 * was(i)).collect();
        let Some((Follows::Delayed(0, lag), (slope, sigma), found)) = first(&series, &axis(values)) else { continue };
        named += 1;
        let apart_s = (lag - 1_000.0 * DELAY as f64).abs();
        within += usize::from(apart_s < 2.0 * found.inner_sigma[0].max(30.0) && (slope - 1.2).abs() < 2.0 * sigma);
    }
    assert!(named == 10 && within >= 8, "{named} named, {within} within");
}

/// Two components of a field that a sensor feels are one effect, with a coefficient each, beside a temperature that it feels too.
#[test]
fn a_sensor_that_feels_the_field_has_a_coefficient_for_each_component() {
    let (mut named, mut within) = (0, 0);
    for seed in 0..10 {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let mut series = series(&mut rng);
        for name in ["mag_x", "mag_y", "mag_z"] {
            series.covariates.push(covariate(name, "uT", red(&mut rng, 6.0, 0.1)));
        }
        let of = |k: usize, i: usize| series.covariates[k].values[i];
        let noise = red(&mut rng, 10.0, 0.3);
        let values: Vec<f64> =
            noise.iter().enumerate().map(|(i, n)| 0.3 * n + 0.9 * of(1, i) - 0.7 * of(3, i) + 0.6 * of(0, i)).collect();
        let found = search(&series, &axis(values), &[]);
        let coefficient = |wanted: Follows| {
            let place = found.effects.iter().position(|(follows, _)| *follows == wanted)?;
            Some(found.last().coefficients[place])
        };
        let [Some(x), Some(z), None] = [1, 3, 2].map(|k| coefficient(Follows::Field(k))) else { continue };
        named += usize::from(found.effects.iter().any(|(f, _)| f.id() == "temperature_bias") && found.form.is_none());
        within += usize::from((x.0 - 0.9).abs() < 2.0 * x.1) + usize::from((z.0 + 0.7).abs() < 2.0 * z.1);
    }
    assert!(named >= 9 && within >= 16, "{named} named, {within} within");
}

/// What a temperature does it does within hours.
#[test]
fn no_lag_of_days_is_a_bias_that_follows_temperature() {
    for seed in 0..5 {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let series = series(&mut rng);
        let late = equation(&series, &axis(vec![0.0; BLOCKS]), &[Follows::Temperature(0, 90_000.0)]);
        let values = red(&mut rng, 5.0, 0.2).iter().zip(&late.columns[0]).map(|(n, x)| 0.02 * n + 3.0 * x).collect();
        let found = search(&series, &axis(values), &[]);
        let lags = found.effects.iter().filter(|(f, _)| f.id() == "temperature_bias").filter_map(|(f, _)| f.inner());
        assert!(lags.into_iter().all(|lag_s| lag_s <= 28_800.0), "{:?}", found.effects);
    }
}

/// What is in no catalogue is no effect of temperature, though temperature is among the covariates and not far from it.
#[test]
fn a_sensor_that_follows_something_else_has_a_formula_and_no_name() {
    let forms = Form::ALL.map(|form| Follows::Form(form, 1, 0.0));
    for truth in forms.into_iter().chain([Follows::Product(0, 1)]) {
        let mut right = 0;
        for seed in 0..10 {
            let mut rng = ChaCha12Rng::seed_from_u64(seed);
            let mut series = series(&mut rng);
            let own = red(&mut rng, 20.0, 0.1);
            let humidity = series.covariates[0].values.iter().zip(own).map(|(t, own)| 0.5 * (t - 25.0) + own).collect();
            series.covariates.push(covariate("humidity", "%", humidity));
            let noise = red(&mut rng, 10.0, 0.3);
            let column = equation(&series, &axis(vec![0.0; BLOCKS]), &[truth]).columns.swap_remove(0);
            let size = 1.5 / rms_about_mean(&column);
            let values = column.iter().zip(noise).map(|(x, n)| size * x + 0.3 * n).collect();
            let found = search(&series, &axis(values), &[]);
            // The same law of another slack, bound or memory is the same hypothesis.
            let is = |found: Follows| match (found, truth) {
                (Follows::Form(found, k, _), Follows::Form(truth, j, _)) => {
                    k == j && std::mem::discriminant(&found) == std::mem::discriminant(&truth)
                }
                _ => found == truth,
            };
            right += usize::from(found.effects.is_empty() && found.form.is_some_and(|(follows, ..)| is(follows)));
        }
        println!("{truth:?}: {right} of 10");
        assert!(right >= 9, "{truth:?}: {right} of 10");
    }
}

/// A push for a while is no step, and an oscillation no noise.
#[test]
fn a_push_for_a_while_and_an_oscillation_have_a_formula() {
    let (mut pushes, mut lines) = (0, 0);
    for seed in 0..10 {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let series = series(&mut rng);
        let noise = red(&mut rng, 5.0, 0.5);
        let with = |truth: Follows, size: f64| {
            let column = equation(&series, &axis(vec![0.0; BLOCKS]), &[truth]).columns.swap_remove(0);
            let values = column.iter().zip(&noise).map(|(x, n)| size * x + 0.3 * n).collect();
            search(&series, &axis(values), &[])
        };
        let found = with(Follows::Pulse(60_500.0, 40_000.0), 1.5);
        let near =
            |from_s: f64, length_s: f64| (from_s - 60_500.0).abs() < 6000.0 && (length_s / 40_000.0 - 1.0).abs() < 0.25;
        pushes +=
            usize::from(matches!(found.form, Some((Follows::Pulse(from_s, length_s), ..)) if near(from_s, length_s)));
        let found = with(Follows::Line(9_300.0, 1.0), 0.4);
        lines += usize::from(
            matches!(found.form, Some((Follows::Line(period_s, _), ..)) if (period_s / 9300.0 - 1.0).abs() < 0.05),
        );
    }
    assert!(pushes >= 8 && lines >= 8, "{pushes} pushes, {lines} lines");
}

/// A sensor beside a reference: what the reference shows is smooth over a few samples and wanders for long.
fn beside_reference(rng: &mut ChaCha12Rng) -> (Series, Vec<f64>) {
    let series = series(rng);
    let wander = red(rng, 80.0, 0.0);
    let phase = 6.0 * rng.random::<f64>();
    let reference = series.t_s.iter().zip(wander).map(|(t, w)| 10.0 * (t / 9_000.0 + phase).sin() + 0.3 * w).collect();
    (series, reference)
}

#[test]
fn a_scale_error_against_the_reference_is_found() {
    scale_errors(40);
}

#[test]
#[cfg_attr(not(feature = "slow"), ignore = "slow")]
fn a_scale_error_against_the_reference_is_found_over_many_seeds() {
    scale_errors(200);
}

fn scale_errors(seeds: u64) {
    let (mut named, mut within) = (0, 0);
    for seed in 0..seeds {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let (series, reference) = beside_reference(&mut rng);
        let values = red(&mut rng, 5.0, 0.5).iter().zip(&reference).map(|(n, r)| 0.2 * n - 0.1 * r).collect();
        let axis = Axis { reference: Some(reference), ..axis(values) };
        let Some((Follows::Scale, (fraction, sigma), _)) = first(&series, &axis) else { continue };
        named += 1;
        within += u64::from((fraction + 0.1).abs() < 2.0 * sigma);
    }
    println!("of {seeds} scale factors: {named} named, {within} within two standard errors");
    // 95 % of 40, less two standard deviations.
    assert!(10 * named >= 9 * seeds && 20 * within >= 17 * seeds, "{named} named, {within} within");
}

#[test]
fn an_offset_of_the_clock_is_found_with_its_sign() {
    let (mut named, mut within) = (0, 0);
    for seed in 0..10 {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let series = series(&mut rng);
        let offset = [-3_400.0, -350.0, 400.0, 700.0, 5_300.0][seed as usize % 5];
        let truth = |t: f64| 10.0 * (t / 9_000.0).sin() + 4.0 * (t / 5_500.0 + 1.0).cos();
        let reference: Vec<f64> = series.t_s.iter().map(|t| truth(*t)).collect();
        // What happened at t is labelled t + offset.
        let noise = red(&mut rng, 5.0, 0.5);
        let recorded = series.t_s.iter().zip(noise).map(|(t, n)| truth(t - offset) + 0.1 * n);
        let values = recorded.zip(&reference).map(|(v, r)| v - r).collect();
        let axis = Axis { reference: Some(reference), ..axis(values) };
        let Some((Follows::Offset(_), (found, sigma), _)) = first(&series, &axis) else { continue };
        named += 1;
        within += usize::from((found - offset).abs() < 2.0 * sigma);
    }
    assert!(named == 10 && within >= 9, "{named} named, {within} within");
}

#[test]
fn spans_of_their_own_level_share_one_slope() {
    let mut rng = ChaCha12Rng::seed_from_u64(7);
    let mut series = series(&mut rng);
    series.spans = 3;
    series.span = (0..BLOCKS).map(|i| [0, 0, 0, 0, 0, 0, 1, 1, 2, 2][i / 20]).collect();
    let noise = red(&mut rng, 5.0, 0.3);
    let of = |(i, n): (usize, &f64)| 0.3 * n + 0.8 * series.covariates[0].values[i] + 9.0 * series.span[i] as f64;
    let values = noise.iter().enumerate().map(of).collect();
    let (follows, (slope, sigma), _) = first(&series, &axis(values)).expect("an effect");
    assert_eq!(follows.id(), "temperature_bias");
    assert!((slope - 0.8).abs() < 2.0 * sigma, "{slope} {sigma}");
}

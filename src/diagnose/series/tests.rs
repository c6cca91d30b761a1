use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

use super::read::{CovariateSeries, Series};
use super::search;

const BLOCKS: usize = 200;

/// A daily temperature over two and a half days that also wanders.
fn series(rng: &mut ChaCha12Rng) -> Series {
    let t_s: Vec<f64> = (0..BLOCKS).map(|i| 1_000.0 * i as f64).collect();
    let wander = red(rng, 60.0, 0.0);
    let values = t_s.iter().zip(wander).map(|(t, w)| 25.0 + 2.0 * (t / 13_751.0).sin() + 0.5 * w).collect();
    let covariates = vec![CovariateSeries { name: "temperature".into(), unit: "C".into(), values }];
    Series { t_s, span: vec![0; BLOCKS], spans: 1, axes: Vec::new(), covariates, masked: 0 }
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

#[test]
fn red_noise_follows_nothing() {
    let seeds = if cfg!(feature = "slow") { 1_000 } else { 100 };
    let mut alarms = Vec::new();
    for seed in 0..seeds {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let series = series(&mut rng);
        let memory = [0.3, 3.0, 20.0, 100.0, 1_000.0][seed as usize % 5];
        let values = red(&mut rng, memory, [0.0, 0.3][seed as usize / 5 % 2]);
        let found = search(&series, &values, &[]);
        alarms.extend(found.effects.into_iter().map(|(effect, score)| (seed, memory, effect, score)));
    }
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
        let found = search(&series, &values, &[]);
        named += usize::from(found.effects.first().is_some_and(|(f, _)| f.id() == "temperature_bias"));
    }
    assert!(named >= 19, "{named} of 20");
}

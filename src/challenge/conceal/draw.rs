//! Numbers from a seed. Nothing else.

use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::{Distribution, StandardNormal};

/// Uniform in `low..high`.
pub fn between(rng: &mut ChaCha12Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

/// Uniform in the logarithm; both ends positive.
pub fn log_between(rng: &mut ChaCha12Rng, low: f64, high: f64) -> f64 {
    between(rng, low.ln(), high.ln()).exp()
}

/// Normal, mean 0 and variance 1.
pub fn normal(rng: &mut ChaCha12Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// One of a list that is not empty.
pub fn pick<'a, T>(rng: &mut ChaCha12Rng, list: &'a [T]) -> &'a T {
    &list[rng.random_range(0..list.len())]
}

/// A direction, uniform on the sphere.
pub fn direction(rng: &mut ChaCha12Rng) -> nalgebra::Vector3<f64> {
    loop {
        let v = nalgebra::Vector3::from_fn(|_, _| normal(rng));
        if v.norm() > 0.1 {
            return v.normalize();
        }
    }
}

//! What the vehicle's life adds to the quasi-steady acceleration: white vibration through the instrument's 1 Hz Bessel filter,
//! bursts, louder when the crew is awake.
//!
//! Levels are those of the sample recordings' look: about 0.83, 0.49 and 0.39 ug (X, Y, Z of the instrument) in sleep, 1.7 times
//! that awake; bursts on one axis at a time, of tenths of a second to seconds, tails up to the rail. One value per 0.1 s.

use std::f64::consts::PI;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::{Purpose, generator};

/// Samples per second.
const RATE_HZ: f64 = 10.0;
/// Poles of the fourth-order Bessel filter with the asymptote of a unit-frequency Butterworth (the upper half plane's).
const BESSEL4_POLES: [(f64, f64); 2] =
    [(-0.657_211_171_671_882_9, 0.830_161_435_004_873_4), (-0.904_758_796_788_245, 0.270_918_733_003_874_7)];

/// Vibration.
#[derive(Debug, Clone, PartialEq)]
pub struct NoisePlan {
    /// Standard deviation after the filter while the crew sleeps, OARE axes, ng.
    pub asleep_ng: [f64; 3],
    /// How much louder it is when the crew is awake.
    pub awake_factor: f64,
    /// Hours of sleep in every 24.
    pub sleep_h: f64,
    /// Mission elapsed time at which the first sleep begins, h.
    pub sleep_begins_met_h: f64,
    /// Bursts per hour and axis while asleep.
    pub bursts_asleep_per_h: f64,
    /// Bursts per hour and axis while awake.
    pub bursts_awake_per_h: f64,
    /// Largest burst, ng. Below 85,000 none reaches a rail of range C.
    pub burst_ng_max: f64,
    /// Corner of the filter, Hz.
    pub filter_hz: f64,
}

impl NoisePlan {
    /// As on STS-65.
    pub fn sts65() -> Self {
        Self {
            asleep_ng: [830.0, 490.0, 390.0],
            awake_factor: 1.7,
            sleep_h: 8.0,
            sleep_begins_met_h: 10.0,
            bursts_asleep_per_h: 8.0,
            bursts_awake_per_h: 22.0,
            burst_ng_max: 120_000.0,
            filter_hz: 1.0,
        }
    }

    /// As in the quiet periods of STS-62: no crew stirs, a third of the noise.
    pub fn quiet() -> Self {
        let loud = Self::sts65();
        Self {
            asleep_ng: loud.asleep_ng.map(|ng| ng / 3.0),
            awake_factor: 1.0,
            bursts_asleep_per_h: 2.0,
            bursts_awake_per_h: 2.0,
            burst_ng_max: 20_000.0,
            ..loud
        }
    }

    /// Nothing but the white noise, and no rail ever reached.
    pub fn without_bursts(self) -> Self {
        Self { bursts_asleep_per_h: 0.0, bursts_awake_per_h: 0.0, ..self }
    }

    /// Whether the crew sleeps at a mission elapsed time.
    pub fn asleep(&self, met_h: f64) -> bool {
        (met_h - self.sleep_begins_met_h).rem_euclid(24.0) < self.sleep_h
    }
}

/// A fourth-order Bessel low-pass, bilinear transform, as two sections of second order.
#[derive(Debug, Clone)]
pub struct Bessel {
    sections: [Section; 2],
}

#[derive(Debug, Clone, Copy)]
struct Section {
    b: f64,
    a1: f64,
    a2: f64,
    z1: f64,
    z2: f64,
}

impl Section {
    /// Direct form II transposed, b0 = b2 = b, b1 = 2 b.
    fn step(&mut self, x: f64) -> f64 {
        let y = self.b * x + self.z1;
        self.z1 = 2.0 * self.b * x - self.a1 * y + self.z2;
        self.z2 = self.b * x - self.a2 * y;
        y
    }
}

impl Bessel {
    /// With this corner at ten samples a second. Gain one at rest.
    pub fn new(corner_hz: f64) -> Self {
        let warped = 2.0 * RATE_HZ * (PI * corner_hz / RATE_HZ).tan();
        let sections = BESSEL4_POLES.map(|(re, im)| {
            // s^2 + 2 p s + m2, s = k (z-1)/(z+1).
            let (p, m2, k) = (-re * warped, (re * re + im * im) * warped * warped, 2.0 * RATE_HZ);
            let a0 = k * k + 2.0 * p * k + m2;
            Section { b: m2 / a0, a1: 2.0 * (m2 - k * k) / a0, a2: (k * k - 2.0 * p * k + m2) / a0, z1: 0.0, z2: 0.0 }
        });
        Self { sections }
    }

    /// The next output.
    pub fn step(&mut self, input: f64) -> f64 {
        let middle = self.sections[0].step(input);
        self.sections[1].step(middle)
    }

    /// Standard deviation of the output for unit white noise.
    pub fn white_gain(&self) -> f64 {
        let mut fresh = self.clone();
        for section in &mut fresh.sections {
            (section.z1, section.z2) = (0.0, 0.0);
        }
        (0..400).map(|k| fresh.step(f64::from(u8::from(k == 0))).powi(2)).sum::<f64>().sqrt()
    }
}

/// The vibration of one axis, sample after sample.
pub struct Vibration {
    plan: NoisePlan,
    asleep_input_ng: f64,
    filter: Bessel,
    white: ChaCha8Rng,
    bursts: ChaCha8Rng,
    /// Present burst: samples left and its height.
    burst: (u32, f64),
    /// Samples until the next burst may begin.
    pause: u64,
    level_ng: f64,
}

impl Vibration {
    /// Of the axis with this index.
    pub fn new(plan: &NoisePlan, seed: u64, axis: usize) -> Self {
        use rand::SeedableRng;
        let stream = |purpose: Purpose| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            random.set_stream(purpose as u64 + axis as u64);
            random
        };
        let filter = Bessel::new(plan.filter_hz);
        let mut vibration = Self {
            asleep_input_ng: plan.asleep_ng[axis] / filter.white_gain(),
            level_ng: plan.asleep_ng[axis],
            plan: plan.clone(),
            filter,
            white: stream(Purpose::White),
            bursts: stream(Purpose::Bursts),
            burst: (0, 0.0),
            pause: 0,
        };
        vibration.pause = vibration.next_pause(false);
        // The filter forgets its start within seconds.
        for _ in 0..100 {
            vibration.step(true);
        }
        vibration
    }

    /// The next 0.1 s, ng.
    pub fn step(&mut self, asleep: bool) -> f64 {
        let loudness = if asleep { 1.0 } else { self.plan.awake_factor };
        let white: f64 = StandardNormal.sample(&mut self.white);
        let burst = self.burst(asleep);
        self.filter.step(white * self.asleep_input_ng * loudness + burst)
    }

    fn burst(&mut self, asleep: bool) -> f64 {
        if self.burst.0 > 0 {
            self.burst.0 -= 1;
            return self.burst.1;
        }
        if self.pause > 0 {
            self.pause -= 1;
            return 0.0;
        }
        self.pause = self.next_pause(asleep);
        // Pareto heights of exponent 1.3 from four standard deviations on; 0.2 to 3 s long.
        let height = self.level_ng * 4.0 * self.bursts.random_range(1e-6..1.0_f64).powf(-1.0 / 1.3);
        let sign = if self.bursts.random_bool(0.5) { 1.0 } else { -1.0 };
        self.burst = (self.bursts.random_range(2..30), sign * height.min(self.plan.burst_ng_max));
        0.0
    }

    /// Exponential waiting time, in samples; for ever when there are no bursts.
    fn next_pause(&mut self, asleep: bool) -> u64 {
        let per_h = if asleep { self.plan.bursts_asleep_per_h } else { self.plan.bursts_awake_per_h };
        if per_h <= 0.0 {
            return u64::MAX;
        }
        (-self.bursts.random_range(1e-12..1.0_f64).ln() * 3600.0 * RATE_HZ / per_h) as u64
    }
}

/// Slow Gaussian noise with a correlation time: the temperature's wandering.
pub struct Wander {
    value: f64,
    keep: f64,
    kick: f64,
    random: ChaCha8Rng,
}

impl Wander {
    /// Standard deviation, correlation time, and the time between steps.
    pub(crate) fn new(sigma: f64, tau_s: f64, step_s: f64, seed: u64, purpose: Purpose) -> Self {
        let keep = (-step_s / tau_s).exp();
        let mut random = generator(seed, purpose);
        let start: f64 = StandardNormal.sample(&mut random);
        Self { value: start * sigma, keep, kick: sigma * (1.0 - keep * keep).sqrt(), random }
    }

    /// The next value.
    pub fn step(&mut self) -> f64 {
        let normal: f64 = StandardNormal.sample(&mut self.random);
        self.value = self.value * self.keep + self.kick * normal;
        self.value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(plan: &NoisePlan, n: usize) -> Vec<f64> {
        let mut vibration = Vibration::new(plan, 11, 0);
        (0..n).map(|_| vibration.step(true)).collect()
    }

    #[test]
    fn the_filter_is_a_bessel_low_pass() {
        let filter = Bessel::new(1.0);
        let gain = |hz: f64| {
            let (mut re, mut im) = (0.0, 0.0);
            let mut f = filter.clone();
            for k in 0..400 {
                let h = f.step(f64::from(u8::from(k == 0)));
                let (s, c) = (2.0 * PI * hz * f64::from(k) / 10.0).sin_cos();
                re += h * c;
                im -= h * s;
            }
            f64::hypot(re, im)
        };
        assert!((gain(0.0) - 1.0).abs() < 1e-12);
        // |H| of the fourth-order analogue with this normalisation at its corner: -7.58 dB; the bilinear transform
        // keeps that frequency. 105 / |s^4 + 10 s^3 + 45 s^2 + 105 s + 105| at s = i 105^(1/4).
        let w: f64 = 105_f64.powf(0.25);
        let expected = 105.0 / f64::hypot(w.powi(4) - 45.0 * w * w + 105.0, -10.0 * w.powi(3) + 105.0 * w);
        assert!((gain(1.0) - expected).abs() < 1e-9, "{} {expected}", gain(1.0));
        assert!(gain(2.0) < 0.04);
    }

    #[test]
    fn white_noise_has_the_asked_level_and_the_filter_s_memory() {
        let x = series(&NoisePlan::sts65().without_bursts(), 400_000);
        let n = x.len() as f64;
        let variance = x.iter().map(|v| v * v).sum::<f64>() / n;
        // 400,000 samples of which some 60,000 are independent: 0.6 % of the deviation, at three sigma.
        assert!((variance.sqrt() / 830.0 - 1.0).abs() < 0.01, "{}", variance.sqrt());
        let lag = |k: usize| x.windows(k + 1).map(|w| w[0] * w[k]).sum::<f64>() / n / variance;
        assert!((0.9..0.99).contains(&lag(1)) && lag(10).abs() < 0.05, "{} {}", lag(1), lag(10));
    }

    #[test]
    fn bursts_make_tails_and_stay_below_their_bound() {
        let plan = NoisePlan { burst_ng_max: 50_000.0, ..NoisePlan::sts65() };
        let x = series(&plan, 2_000_000);
        let beyond = x.iter().filter(|v| v.abs() > 5.0 * 830.0).count();
        assert!(beyond > 100 && beyond < 20_000, "{beyond}");
        assert!(x.iter().all(|v| v.abs() < 60_000.0));
    }

    #[test]
    fn the_crew_sleeps_eight_hours_in_every_day() {
        let plan = NoisePlan::sts65();
        let asleep = (0..2400).filter(|k| plan.asleep(f64::from(*k) * 0.1)).count();
        assert!((799..=801).contains(&asleep), "{asleep}");
    }
}

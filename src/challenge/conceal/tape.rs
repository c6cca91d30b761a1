//! The recording of a concealed case as a recorder dump: what the sensor feels goes through the simulator's instrument, with its
//! bias, its temperature, its calibrations and the vibration of a crew aboard.

use nalgebra::Vector3;
use rand_chacha::ChaCha12Rng;

use super::flight::{Flight, STEP_S};
use super::noise::Noise;
use super::record::{Recording, activity, centres_s, kept_of};
use super::{Question, effect};
use crate::diagnose::case::{HALF_WINDOW_S, WINDOW_STRIDE_S};
use crate::ingest::wire::LinkConfig;
use crate::math::rms::rms;
use crate::simulate::calibration::Schedule;
use crate::simulate::forces::QuasiSteady;
use crate::simulate::instrument::{Instrument, Temperature};
use crate::simulate::noise::{Bessel, NoisePlan};
use crate::simulate::recorder::frames;
use crate::simulate::{self, MissionConfig, RecorderConfig, playbacks};

/// Samples of a window.
const SAMPLES: f64 = 500.0;

/// An instrument aboard, and the recorder behind it.
pub struct Tape {
    config: MissionConfig,
}

/// What the sensor feels, between the points of the generator's grid.
struct Felt<'a> {
    first_s: f64,
    ng: &'a [Vector3<f64>],
}

impl QuasiSteady for Felt<'_> {
    fn quasi_steady_ng(&self, clock_s: f64) -> Vector3<f64> {
        effect::at_vector(self.ng, (clock_s - self.first_s) / STEP_S)
    }
}

impl Tape {
    /// An instrument of its own on a flight. Its vibration is as loud in a window as the noise says; of that noise, the part that is
    /// red goes: the instrument's filter has none.
    pub fn new(seed: u64, flight: &Flight, noise: &mut Noise) -> Self {
        noise.red_share = 0.0;
        let mut config = MissionConfig::sts65(seed, flight.length_s / 3600.0);
        config.start_clock_s = flight.start_s as u32;
        config.time = Flight::mission();
        config.instrument = Instrument::sts65().varied(seed);
        let sleeps = flight.events.iter().find(|e| e.kind == "crew_sleep");
        // The filter passes a constant whole: what it makes quieter from sample to sample it does not in the mean of a window.
        let standard = NoisePlan::sts65();
        let sample_per_window = Bessel::new(standard.filter_hz).white_gain() * SAMPLES.sqrt();
        let [x, y, z] = noise.awake_ng.map(|awake_ng| awake_ng * noise.asleep * sample_per_window);
        config.noise = NoisePlan {
            // Instrument axes X, Y, Z are along body x, z, y.
            asleep_ng: [x, z, y],
            awake_factor: 1.0 / noise.asleep,
            sleep_h: sleeps.map_or(0.0, |e| e.duration_s / 3600.0),
            sleep_begins_met_h: sleeps.map_or(0.0, |e| config.time.met_h(e.clock_s)),
            ..standard
        };
        Self { config }
    }

    /// The instrument's temperature at instants in order, C.
    pub fn temperature_c(&self, times_s: &[f64]) -> Vec<f64> {
        let MissionConfig { temperature, seed, start_clock_s, time, .. } = &self.config;
        let mut plan = Temperature::new(*temperature, *seed, f64::from(*start_clock_s));
        let first_s = f64::from(*start_clock_s);
        times_s.iter().map(|t| plan.at(t.max(first_s), time.met_h(*t))).collect()
    }

    /// Which windows of the grid no calibration touches.
    pub fn kept(&self, flight: &Flight) -> Vec<bool> {
        let config = &self.config;
        let schedule = Schedule::new(&config.calibration, config.start_clock_s, config.end_clock_s(), &[]);
        let busy = |t: f64| {
            let mut segments = schedule.segments.iter();
            segments.any(|s| t + HALF_WINDOW_S > f64::from(s.from_s) && t - HALF_WINDOW_S < f64::from(s.until_s))
        };
        centres_s(flight).into_iter().map(|t| !busy(t)).collect()
    }

    /// The dump of a question's flight.
    pub fn recording(&self, rng: &mut ChaCha12Rng, question: &Question) -> Recording {
        let Question { flight, felt, noise, kept, .. } = question;
        let windows = (flight.times_s.len() as f64 * STEP_S / WINDOW_STRIDE_S) as usize + 2;
        let slow: [Vec<f64>; 3] = std::array::from_fn(|axis| noise.slow_series(rng, axis, windows));
        let slow_at =
            |k: usize| Vector3::from_fn(|axis, _| effect::at(&slow[axis], k as f64 * STEP_S / WINDOW_STRIDE_S));
        let ng: Vec<Vector3<f64>> = felt.iter().enumerate().map(|(k, a)| a + slow_at(k)).collect();
        let felt = Felt { first_s: flight.times_s[0], ng: &ng };
        let link = LinkConfig::default();
        let frames = frames(simulate::Flight::new(&self.config, &felt), link);
        let passes = playbacks(&frames, &link, &RecorderConfig::clean(), self.config.seed);
        let activity = activity(flight, noise);
        let level = |axis: usize| -> Vec<f64> { activity.iter().map(|now| noise.level_ng(axis, *now)).collect() };
        Recording {
            kind: "recorder_dump",
            file: "recording.dump",
            octets: passes.into_iter().flat_map(|pass| pass.octets).collect(),
            noise_ng: std::array::from_fn(|axis| rms(&kept_of(&level(axis), kept)).hypot(noise.slow_ng[axis])),
        }
    }
}

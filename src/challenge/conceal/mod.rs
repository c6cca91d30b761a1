//! The generator of concealed cases: a flight, what its simulation lacks, its noise, and the files an analyser gets.
//!
//! [`draw`] is a pure function of kind and seed. The equations are written here a second time, apart from the analyser's
//! regressors; only the Sun, the shadow and the geomagnetic field are shared with `physics`. With `other_physics` the
//! flight has winds, density waves and unequal panels that the analyser's regressors do not have.

mod draw;
pub mod effect;
pub mod flight;
mod force;
pub mod law;
mod matched;
mod noise;
mod record;
mod tape;
mod temperature;
mod truth;

use std::collections::BTreeMap;

use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha12Rng;

use crate::math::rms::rms_about_mean;
use draw::{log_between, pick};
use effect::{Drawn, Signal};
use flight::{Event, Flight};
use force::Series;
use matched::{CONFUSABLE_SNR, Matched};
use noise::Noise;
use tape::Tape;
pub use truth::Truth;

/// What kind of question a case is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, clap::ValueEnum)]
pub enum Kind {
    /// Nothing is missing.
    Clean,
    /// Nothing is missing, and slow noise up to 30 ng is in the record.
    Slow,
    /// One effect of the catalogue.
    One,
    /// Two of them.
    Two,
    /// A law that no catalogue lists.
    Unknown,
    /// One attitude, and an effect that others imitate.
    Single,
    /// One effect, which is deleted from the analyser's catalogue.
    Deleted,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Clean, Self::Slow, Self::One, Self::Two, Self::Unknown, Self::Single, Self::Deleted];

    /// Its word, in ids and truths.
    pub fn word(self) -> &'static str {
        match self {
            Self::Clean => "clean",
            Self::Slow => "slow",
            Self::One => "one",
            Self::Two => "two",
            Self::Unknown => "unknown",
            Self::Single => "single",
            Self::Deleted => "deleted",
        }
    }
}

/// What to draw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Order {
    /// The kind.
    pub kind: Kind,
    /// The seed.
    pub seed: u64,
    /// This effect or law instead of a drawn one.
    pub only: Option<&'static str>,
    /// In what manner.
    pub manner: Manner,
}

/// Of what kind slow noise is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wander {
    /// An autoregression.
    Autoregression,
    /// An autoregression seen through three lags of its own memory: its spectrum falls as the eighth power of frequency where that of
    /// an autoregression falls as the square.
    Smooth,
    /// Flicker noise: as many autoregressions of equal power as there are octaves from five minutes to three days.
    Flicker,
    /// An autoregression of the second order: it oscillates about a period of 200 s to 2000 s, each axis about its own, and forgets its phase
    /// in half a period to three.
    Resonant,
}

/// What a flight has that the analyser is not told of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Manner {
    /// Length of the recording, hours.
    pub hours: u32,
    /// Winds, density waves and panels of its own.
    pub other_physics: bool,
    /// Of what kind slow noise is, where there is some.
    pub wander: Wander,
    /// Bursts in the noise, which the SNR does not know of.
    pub bursts: bool,
    /// Hours in which the noise is louder, which no log has: only the deviations.
    pub storms: bool,
    /// Noise with a memory is averaged over the windows, as what the samples have is; the SNR takes it at their middle.
    pub averaged: bool,
    /// The recording is a dump of the payload recorder: the simulator's instrument feels what the flight has, calibrates itself, and
    /// every calibration is to be worked out from what it sends.
    pub dump: bool,
}

impl Default for Manner {
    /// As the open cases are.
    fn default() -> Self {
        Self {
            hours: 36,
            other_physics: false,
            wander: Wander::Autoregression,
            bursts: false,
            storms: false,
            averaged: false,
            dump: false,
        }
    }
}

/// A case and its truth.
#[derive(Debug, Clone)]
pub struct Concealed {
    /// Identity: kind and seed.
    pub id: String,
    /// Name and octets of each file.
    pub files: Vec<(String, Vec<u8>)>,
    /// What was left out.
    pub truth: Truth,
}

/// Draws a case of a kind from a seed.
pub fn draw(kind: Kind, seed: u64) -> Concealed {
    draw_order(&Order { kind, seed, only: None, manner: Manner::default() })
}

/// Flights tried until the drawn effect has a fair size on one.
const ATTEMPTS: u64 = 12;
/// Least SNR of a question that is asked.
const SNR_MIN: f64 = 5.0;
/// An unlisted law keeps at least this SNR against the nearest effect of the catalogue.
const UNLISTED_SNR: f64 = 5.0;

/// Draws a case to order.
pub fn draw_order(order: &Order) -> Concealed {
    let mut last = None;
    for attempt in 0..ATTEMPTS {
        let stream = order.seed.wrapping_mul(7).wrapping_add(order.kind as u64);
        let mut rng = ChaCha12Rng::seed_from_u64(stream);
        rng.set_stream(attempt);
        // A weak effect gets a quieter record after a few refusals.
        let question = Question::draw(&mut rng, order, attempt as f64 / ATTEMPTS as f64);
        let fair = question.is_fair(order.kind);
        last = Some((question, rng));
        if fair {
            break;
        }
    }
    let (question, mut rng) = last.unwrap_or_else(|| unreachable!("at least one attempt is made"));
    question.written(&mut rng, order)
}

/// A flight with what is missing on it, before its files are written.
struct Question {
    flight: Flight,
    noise: Noise,
    /// When the recording is a dump.
    tape: Option<Tape>,
    kept: Vec<bool>,
    signal: Signal,
    felt: Series,
    parts: Vec<(String, BTreeMap<String, serde_json::Value>, Series)>,
    snr: Vec<f64>,
    apart: f64,
    left: Vec<(&'static str, f64)>,
}

impl Question {
    fn draw(rng: &mut ChaCha12Rng, order: &Order, quieter: f64) -> Self {
        let mut flight = Flight::draw(rng, order.kind, order.manner);
        let ids = ids(rng, order);
        for id in &ids {
            require(rng, &mut flight, id);
        }
        let mut noise = Noise::draw(rng, order.kind == Kind::Slow, order.manner);
        let floor = 55.0 / noise.awake_ng[0];
        let factor = (1.0 - quieter).max(floor).min(1.0);
        noise.awake_ng = noise.awake_ng.map(|level| level * factor);
        let tape = order.manner.dump.then(|| Tape::new(order.seed, &flight, &mut noise));
        if let Some(tape) = &tape {
            flight.temperature_c = tape.temperature_c(&flight.times_s);
        }
        let kept = match &tape {
            Some(tape) => tape.kept(&flight),
            None => record::kept(rng, &flight),
        };
        let target = |rng: &mut ChaCha12Rng| log_between(rng, if order.kind == Kind::One { 5.0 } else { 8.0 }, 40.0);
        let mut drawn: Vec<Drawn> =
            ids.iter().filter(|id| effect::IDS.contains(id)).map(|id| Drawn::draw(rng, id, &flight)).collect();
        drawn.sort_by_key(Drawn::is_instrumental);
        let signal = Signal::without(&flight, &drawn);
        let matched = Matched::new(&flight, &noise, &kept);
        let mut felt = signal.simulated.clone();
        let (mut parts, mut snr, mut whites) = (Vec::new(), Vec::new(), Vec::new());
        for effect in &drawn {
            let target = target(rng);
            let sized = sized(effect, target, &flight, &signal, &felt, &matched);
            let series = sized.signature(&flight, &signal, &felt);
            whites.push(matched.white(&series));
            parts.push((sized.id.to_string(), parameters(&sized), series));
        }
        if order.kind == Kind::Unknown {
            let (name, law) = law::all().find(|(name, _)| ids.contains(name)).unwrap_or(law::LAWS[0]);
            let mut series = law::signature(rng, name, &flight, &felt);
            let factor = target(rng) / Matched::snr(&matched.white(&series)).max(1e-9);
            series.iter_mut().for_each(|a| *a *= factor);
            whites.push(matched.white(&series));
            parts.push((name.to_string(), BTreeMap::from([("law".to_string(), law.into())]), series));
        }
        for (_, _, series) in &parts {
            felt = force::plus(&felt, series);
        }
        snr.extend(whites.iter().map(Matched::snr));
        // What any effect leaves of one, and what the effects of a pair leave of each other; of a question that will not be
        // asked anyway, nothing is worked out.
        let asked = snr.iter().all(|snr| *snr >= SNR_MIN);
        let left = match whites.as_slice() {
            [only] if asked => matched.left(only, &signal, &felt),
            _ => Vec::new(),
        };
        let apart = match whites.as_slice() {
            [a, b] if asked => {
                let share = |white, of: usize| matched.left_by(&parts[1 - of].0, white, &signal, &felt) / snr[of];
                f64::min(share(a, 0), share(b, 1))
            }
            _ => 1.0,
        };
        drop(matched);
        Self { flight, noise, tape, kept, signal, felt, parts, snr, apart, left }
    }

    /// Whether the question can be asked: loud enough, of a possible size, and hard in the way its kind says.
    fn is_fair(&self, kind: Kind) -> bool {
        let loud = self.snr.iter().all(|snr| *snr >= SNR_MIN && *snr < 400.0);
        let rms_ng =
            |series: &Series| (series.iter().map(Vector3::norm_squared).sum::<f64>() / series.len() as f64).sqrt();
        let possible = self.parts.iter().all(|(_, _, series)| rms_ng(series) < 800.0);
        loud && possible
            && match kind {
                Kind::Two => self.apart > 0.5,
                Kind::Single => self.snr.iter().all(|snr| *snr >= 8.0) && !self.confusable().is_empty(),
                // A law that one effect of the catalogue nearly imitates is no unlisted law.
                Kind::Unknown | Kind::Deleted => self.nearest() > f64::max(UNLISTED_SNR, 0.5 * self.snr[0]),
                _ => true,
            }
    }

    /// SNR that the nearest effect of the catalogue leaves, the true one aside.
    fn nearest(&self) -> f64 {
        let others = self.left.iter().filter(|(id, _)| *id != self.parts[0].0);
        others.map(|(_, left)| *left).fold(f64::INFINITY, f64::min)
    }

    fn confusable(&self) -> Vec<&'static str> {
        let own = |id: &str| self.parts.iter().any(|(part, _, _)| part == id);
        self.left.iter().filter(|(id, left)| *left < CONFUSABLE_SNR && !own(id)).map(|(id, _)| *id).collect()
    }

    fn written(self, rng: &mut ChaCha12Rng, order: &Order) -> Concealed {
        let mut suffix = String::new();
        suffix += if order.manner.other_physics { "-other" } else { "" };
        suffix += match order.manner.wander {
            Wander::Autoregression => "",
            Wander::Smooth => "-smooth",
            Wander::Flicker => "-flicker",
            Wander::Resonant => "-resonant",
        };
        suffix += if order.manner.bursts { "-bursts" } else { "" };
        suffix += if order.manner.storms { "-storms" } else { "" };
        suffix += if order.manner.averaged { "-averaged" } else { "" };
        suffix += if order.manner.dump { "-dump" } else { "" };
        let id = format!("{}-{:06}{suffix}", order.kind.word(), order.seed);
        let lacks_bulge = self.parts.iter().any(|(id, _, _)| id == "diurnal_bulge");
        let density_kg_m3 = record::simulated_density(&self.flight, lacks_bulge);
        let recording = match &self.tape {
            Some(tape) => tape.recording(rng, &self),
            None => record::windows(rng, &self),
        };
        let noise_ng = recording.noise_ng;
        let files = record::files(&id, &self.flight, recording, &self.signal.simulated, &density_kg_m3);
        let names = || self.parts.iter().map(|(id, _, _)| id.clone());
        let truth = Truth {
            case: id.clone(),
            kind: order.kind.word().to_string(),
            effects: self.parts.iter().map(|(id, parameters, _)| (id.clone(), parameters.clone())).collect(),
            snr: names().zip(self.snr.iter().copied()).collect(),
            snr_left: self.left.iter().map(|(id, left)| ((*id).to_string(), *left)).collect(),
            confusable: self.confusable().into_iter().map(str::to_string).collect(),
            part_rms_ng: self.parts.iter().map(|(id, _, series)| (id.clone(), self.rms_ng(series))).collect(),
            noise_ng,
            slow_noise: (order.kind == Kind::Slow).then_some((self.noise.slow_ng, self.noise.slow_s)),
            deleted: (order.kind == Kind::Deleted).then(|| self.parts[0].0.clone()),
            seed: Some(order.seed),
        };
        Concealed { id, files, truth }
    }

    /// RMS about the mean over the kept windows, ng.
    fn rms_ng(&self, series: &Series) -> [f64; 3] {
        record::window_means(&self.flight, series).map(|axis| rms_about_mean(&record::kept_of(&axis, &self.kept)))
    }
}

/// Effects that others imitate when there is one attitude only.
const IMITATED: [&str; 5] = ["aerodynamic_drag", "scale_factor", "mass_shift", "atmosphere_corotation", "misalignment"];

fn ids(rng: &mut ChaCha12Rng, order: &Order) -> Vec<&'static str> {
    let count = match order.kind {
        Kind::Clean | Kind::Slow => return Vec::new(),
        Kind::Unknown => {
            let asked = order.only.filter(|id| law::all().any(|(name, _)| name == *id));
            return vec![asked.unwrap_or_else(|| pick(rng, &law::LAWS).0)];
        }
        Kind::Two => 2,
        Kind::One | Kind::Single | Kind::Deleted => 1,
    };
    let all = if order.kind == Kind::Single { &IMITATED[..] } else { &effect::IDS[..] };
    // A calibration is there to take an instrument's own errors away: what a dump conceals is an acceleration.
    let list: Vec<&'static str> =
        all.iter().copied().filter(|id| !order.manner.dump || effect::is_acceleration(id)).collect();
    let mut ids: Vec<&'static str> = order.only.into_iter().filter(|id| effect::IDS.contains(id)).collect();
    while ids.len() < count {
        let id = *pick(rng, &list);
        if !ids.contains(&id) {
            ids.push(id);
        }
    }
    ids
}

/// Puts the event an effect needs into the log, when the drawn log has none.
fn require(rng: &mut ChaCha12Rng, flight: &mut Flight, id: &str) {
    let Some(kind) = effect::event_needed(id) else { return };
    if flight.events.iter().any(|e| e.kind == kind) {
        return;
    }
    let (count, length_s) = match kind {
        "mass_change" => (1, 0.0),
        "water_dump" => (2, 2400.0),
        "evaporator" => (40, 330.0),
        _ => (180, 80.0),
    };
    for _ in 0..count {
        let clock_s = flight.start_s + draw::between(rng, 0.2, 0.8) * flight.length_s;
        flight.events.push(Event { clock_s: (clock_s * 10.0).round() / 10.0, duration_s: length_s, kind });
    }
    flight.events.sort_by(|a, b| a.clock_s.total_cmp(&b.clock_s));
}

/// The effect at the size that has the wanted SNR, or the largest size it can have.
fn sized(
    effect: &Drawn,
    snr: f64,
    flight: &Flight,
    signal: &Signal,
    felt: &[Vector3<f64>],
    matched: &Matched,
) -> Drawn {
    let mut sized = effect.clone();
    if !effect.has_size() {
        return sized;
    }
    // Two steps: a clock offset and a wind are not quite linear in their size.
    for _ in 0..2 {
        let now = Matched::snr(&matched.white(&sized.signature(flight, signal, felt)));
        sized = sized.resized((snr / now.max(1e-9)).min(sized.factor_max()));
    }
    sized
}

fn parameters(effect: &Drawn) -> BTreeMap<String, serde_json::Value> {
    let numbers = effect.parameters.iter().map(|(name, x)| (name.clone(), (*x).into()));
    numbers.chain(effect.axis.map(|axis| ("axis".to_string(), axis.into()))).collect()
}

#[cfg(test)]
mod tests;

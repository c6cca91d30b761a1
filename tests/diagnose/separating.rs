//! The observation said to separate two sets does: flown by the mission simulator, not by the analyser's own.

use nalgebra::{DMatrix, DVector};
use oare_ground::diagnose::answer::{SeparatingObservation, Verdict};
use oare_ground::diagnose::case::{Case, Header, Texts};
use oare_ground::diagnose::{Diagnosis, Settings, diagnose};
use oare_ground::physics::Vec3;
use oare_ground::simulate::expected::case_files;
use oare_ground::simulate::forces::QuasiSteady;
use oare_ground::simulate::trajectory::{AttitudeHold, Hold};
use oare_ground::simulate::{Mission, MissionConfig};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// Hours known when the question comes up.
const KNOWN_H: f64 = 12.0;
/// Instrument clock of the logged change of mass.
const ONSET_S: f64 = 36_000.0;
/// How far the centre of gravity then moves, m.
const SHIFT_M: [f64; 3] = [0.10, 0.05, -0.15];
/// Noise of a window, ng.
const NOISE_NG: f64 = 40.0;
/// The attitude held all along: nose to the Earth.
const HELD_DEG: [f64; 3] = [0.0, -90.0, 0.0];

/// By how much the drag is wrong, and the scale factor of the axis along the track.
const FRACTION: f64 = 0.2;
/// The axis along the track, nose to the Earth.
const ALONG_TRACK: usize = 2;

#[derive(Clone, Copy, PartialEq, Debug)]
enum Truth {
    MassShift,
    BiasStep,
    Drag,
    ScaleFactor,
}

impl Truth {
    fn id(self) -> &'static str {
        match self {
            Truth::MassShift => "mass_shift",
            Truth::BiasStep => "bias_step",
            Truth::Drag => "aerodynamic_drag",
            Truth::ScaleFactor => "scale_factor",
        }
    }
}

/// What is done after the hours known.
#[derive(Clone, Copy)]
struct Plan {
    hours: f64,
    turn_to: Option<(Hold, [f64; 3])>,
}

impl Plan {
    fn wait(hours: f64) -> Self {
        Self { hours, turn_to: None }
    }
}

/// A mission whose sensor is so far from where it is thought to be, and whose drag is so many times what is expected.
fn mission(plan: Plan, shift_m: Vec3, drag: f64) -> Mission {
    let mut config = MissionConfig::sts65(5, KNOWN_H + plan.hours);
    let start_s = f64::from(config.start_clock_s);
    let held = |from_clock_s: f64, hold: Hold, deg: [f64; 3]| AttitudeHold {
        from_clock_s,
        hold,
        euler_rad: Vec3::from(deg.map(f64::to_radians)),
    };
    config.attitudes = vec![held(start_s, Hold::LocalVertical, HELD_DEG)];
    config.attitudes.extend(plan.turn_to.map(|(hold, deg)| held(start_s + KNOWN_H * 3600.0, hold, deg)));
    config.wobble_rad = 3e-4;
    config.vehicle.sensor_offset_m += shift_m;
    config.vehicle.drag_coefficient *= drag;
    Mission::new(config).unwrap()
}

/// Means over 50 s about the instants, ng.
fn windows(mission: &Mission, clock_s: &[f64]) -> Vec<Vec3> {
    let mean =
        |t: &f64| (-2..=2).map(|k| mission.forces().quasi_steady_ng(t + 10.0 * f64::from(k))).sum::<Vec3>() / 5.0;
    clock_s.iter().map(mean).collect()
}

/// What a plan brings: windows every 25 s, what the simulation expects there, what the shift and the drag add, and the noise.
struct Flown {
    clock_s: Vec<f64>,
    expected: Vec<Vec3>,
    shift: Vec<Vec3>,
    drag: Vec<Vec3>,
    noise: Vec<Vec3>,
    mission: Mission,
}

impl Flown {
    fn new(plan: Plan) -> Self {
        let mission = mission(plan, Vec3::zeros(), 1.0);
        let (start, end) = (f64::from(mission.config().start_clock_s), f64::from(mission.config().end_clock_s()));
        let clock_s: Vec<f64> =
            (0..).map(|i| start + 100.0 + 25.0 * f64::from(i)).take_while(|t| *t < end - 100.0).collect();
        let expected = windows(&mission, &clock_s);
        let moved = windows(&self::mission(plan, Vec3::from(SHIFT_M), 1.0), &clock_s);
        let braked = windows(&self::mission(plan, Vec3::zeros(), 1.0 + FRACTION), &clock_s);
        let after = |t: f64, a: Vec3| if t >= ONSET_S { a } else { Vec3::zeros() };
        let shift = (0..clock_s.len()).map(|i| after(clock_s[i], moved[i] - expected[i])).collect();
        let drag = braked.iter().zip(&expected).map(|(a, b)| a - b).collect();
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut halves = || Vec3::from_fn(|_, _| NOISE_NG * Distribution::<f64>::sample(&StandardNormal, &mut rng));
        let halves: Vec<Vec3> = (0..=clock_s.len()).map(|_| halves()).collect();
        let noise = halves.windows(2).map(|two| (two[0] + two[1]) / 2.0_f64.sqrt()).collect();
        Self { clock_s, expected, shift, drag, noise, mission }
    }

    /// The step that looks like the shift in the attitude held.
    fn step(&self, i: usize) -> Vec3 {
        let known_until = self.clock_s[0] + KNOWN_H * 3600.0 - 600.0;
        let alike: Vec<&Vec3> = (0..self.clock_s.len())
            .filter(|j| (ONSET_S..known_until).contains(&self.clock_s[*j]))
            .map(|j| &self.shift[j])
            .collect();
        if self.clock_s[i] >= ONSET_S {
            alike.iter().copied().sum::<Vec3>() / alike.len() as f64
        } else {
            Vec3::zeros()
        }
    }

    fn effect(&self, truth: Truth, i: usize) -> Vec3 {
        match truth {
            Truth::MassShift => self.shift[i],
            Truth::BiasStep => self.step(i),
            Truth::Drag => self.drag[i],
            Truth::ScaleFactor => Vec3::ith(ALONG_TRACK, FRACTION * self.expected[i][ALONG_TRACK]),
        }
    }

    fn diagnosed(&self, truth: Truth) -> Diagnosis {
        let mut recording = String::from("clock_s,ax_ng,ay_ng,az_ng,dev_x_ng,dev_y_ng,dev_z_ng\n");
        for (i, t) in self.clock_s.iter().enumerate() {
            let a = self.expected[i] + self.effect(truth, i) + self.noise[i];
            recording += &format!("{t:.1},{:.3},{:.3},{:.3},300,300,300\n", a.x, a.y, a.z);
        }
        let files = case_files(&self.mission, "separating", "recording.csv").unwrap();
        let text = |name: &str| files.iter().find(|(n, _)| *n == name).unwrap().1.clone();
        let header = Header::parse(&text("case.toml"), &["recording.kind=\"acceleration_csv\"".to_string()]).unwrap();
        let texts = Texts {
            recording: Some(recording),
            simulation: Some(text("simulation.csv")),
            ancillary: Some(text("ancillary.csv")),
            events: Some(text("events.csv") + &format!("{ONSET_S:.1},0.0,mass_change,\n")),
        };
        diagnose(&Case::from_texts(header, &texts).unwrap(), &Settings::default()).unwrap()
    }

    /// Log likelihood of the best shift less that of the best step, as the sensor sees them when its table is turned from
    /// `turned_from_s` on: least squares over windows that do not overlap, a constant per axis free, white noise.
    fn shift_against_step(&self, truth: Truth, turned_from_s: f64) -> f64 {
        let rows: Vec<usize> = (0..self.clock_s.len()).step_by(2).collect();
        let sign = |i: usize| if self.clock_s[i] >= turned_from_s { -1.0 } else { 1.0 };
        let left = |fitted: Truth| {
            (0..3)
                .map(|k| {
                    let seen = |effect: Truth, i: usize| match effect {
                        Truth::BiasStep => self.step(i)[k],
                        moves => sign(i) * self.effect(moves, i)[k],
                    };
                    let y =
                        DVector::from_iterator(rows.len(), rows.iter().map(|i| seen(truth, *i) + self.noise[*i][k]));
                    let x = DMatrix::from_fn(rows.len(), 2, |r, c| if c == 0 { 1.0 } else { seen(fitted, rows[r]) });
                    let best = x.clone().svd(true, true).solve(&y, 1e-9).unwrap();
                    (y - x * best).norm_squared() / (2.0 * NOISE_NG * NOISE_NG)
                })
                .sum::<f64>()
        };
        left(Truth::BiasStep) - left(Truth::MassShift)
    }
}

/// Numbers that come after these words.
fn numbers_after(text: &str, words: &[&str]) -> Option<Vec<f64>> {
    let number = |word: &&str| {
        let rest = &text[text.find(word)? + word.len()..];
        rest.trim_start().split([' ', ',', ')']).next()?.parse().ok()
    };
    words.iter().map(number).collect()
}

/// What is told to part two truths, of a record of one of them that has both among what it cannot tell apart.
fn asked(known: &Flown, truth: Truth, other: Truth) -> SeparatingObservation {
    let asked = known.diagnosed(truth);
    assert_eq!(asked.verdict, Verdict::Ambiguous, "{asked:#?}");
    for id in [truth.id(), other.id()] {
        assert!(asked.cannot_tell_apart.iter().any(|set| set == &[id]), "{id}: {:?}", asked.cannot_tell_apart);
    }
    let told = asked.separating_observation.unwrap();
    eprintln!("{}: {}", told.kind, told.text);
    assert!(told.gain.unwrap() >= 3.0, "{told:?}");
    told
}

/// How long it is to last, h.
fn hours(told: &SeparatingObservation) -> f64 {
    let words = ["degrees) for", "as it is, for", "to the stars for"];
    words.iter().find_map(|word| numbers_after(&told.text, &[word])).unwrap()[0]
}

/// The attitude told, flown.
fn turned(told: &SeparatingObservation) -> Flown {
    let turn_to = match numbers_after(&told.text, &["roll", "pitch", "yaw"]) {
        Some(deg) => (Hold::LocalVertical, [deg[0], deg[1], deg[2]]),
        None => (Hold::Inertial, HELD_DEG),
    };
    Flown::new(Plan { hours: hours(told) + 0.25, turn_to: Some(turn_to) })
}

#[test]
fn a_mass_shift_and_a_bias_step_are_decided_by_the_turn_of_the_table_told_and_not_by_waiting() {
    let known = Flown::new(Plan::wait(0.0));
    let told = asked(&known, Truth::MassShift, Truth::BiasStep);
    assert_eq!(told.kind, "table_flip", "{told:?}");

    // As long in the attitude held: nothing is decided.
    let waiting = Flown::new(Plan::wait(hours(&told) + 0.25));
    for truth in [Truth::MassShift, Truth::BiasStep] {
        assert_eq!(waiting.diagnosed(truth).verdict, Verdict::Ambiguous, "{truth:?} after waiting");
    }
    let from_s = known.clock_s[known.clock_s.len() - 1] + 600.0;
    let [shift, step] = [Truth::MassShift, Truth::BiasStep].map(|truth| waiting.shift_against_step(truth, from_s));
    let [no_shift, no_step] =
        [Truth::MassShift, Truth::BiasStep].map(|truth| waiting.shift_against_step(truth, f64::INFINITY));
    eprintln!("turned: {shift:.1} {step:.1}; not turned: {no_shift:.1} {no_step:.1}");
    assert!(shift > 3.0 && step < -3.0, "{shift} {step}");
    assert!(no_shift.abs() < 3.0 && no_step.abs() < 3.0, "{no_shift} {no_step}");
}

#[test]
fn a_wrong_drag_and_a_scale_factor_are_decided_by_the_attitude_told_and_not_by_waiting() {
    let known = Flown::new(Plan::wait(0.0));
    let told = asked(&known, Truth::Drag, Truth::ScaleFactor);
    assert_eq!(told.kind, "attitude", "{told:?}");
    let (waiting, turned) = (Flown::new(Plan::wait(hours(&told) + 0.25)), turned(&told));
    for truth in [Truth::Drag, Truth::ScaleFactor] {
        assert_eq!(waiting.diagnosed(truth).verdict, Verdict::Ambiguous, "{truth:?} after waiting");
        let decided = turned.diagnosed(truth);
        eprintln!("{truth:?}: {:?} {:?}", decided.verdict, decided.effects);
        let first = decided.effects.first().map(|effect| effect.id.as_str());
        assert_eq!(first, Some(truth.id()), "{decided:#?}");
    }
}

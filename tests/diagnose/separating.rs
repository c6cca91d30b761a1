//! The observation said to separate two sets does: flown by the mission simulator, not by the analyser's own.

use nalgebra::{DMatrix, DVector};
use oare_ground::diagnose::answer::Verdict;
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

#[derive(Clone, Copy, PartialEq, Debug)]
enum Truth {
    MassShift,
    BiasStep,
}

/// What is done after the hours known.
#[derive(Clone, Copy)]
struct Plan {
    hours: f64,
    turn_to_deg: Option<[f64; 3]>,
}

fn mission(plan: Plan, shift_m: Vec3) -> Mission {
    let mut config = MissionConfig::sts65(5, KNOWN_H + plan.hours);
    let start_s = f64::from(config.start_clock_s);
    let hold = |from_clock_s: f64, deg: [f64; 3]| AttitudeHold {
        from_clock_s,
        hold: Hold::LocalVertical,
        euler_rad: Vec3::from(deg.map(f64::to_radians)),
    };
    config.attitudes = vec![hold(start_s, HELD_DEG)];
    config.attitudes.extend(plan.turn_to_deg.map(|deg| hold(start_s + KNOWN_H * 3600.0, deg)));
    config.wobble_rad = 3e-4;
    config.vehicle.sensor_offset_m += shift_m;
    Mission::new(config).unwrap()
}

/// Means over 50 s about the instants, ng.
fn windows(mission: &Mission, clock_s: &[f64]) -> Vec<Vec3> {
    let mean =
        |t: &f64| (-2..=2).map(|k| mission.forces().quasi_steady_ng(t + 10.0 * f64::from(k))).sum::<Vec3>() / 5.0;
    clock_s.iter().map(mean).collect()
}

/// What a plan brings: windows every 25 s, what the simulation expects there, what the shift adds, and the noise.
struct Flown {
    clock_s: Vec<f64>,
    expected: Vec<Vec3>,
    shift: Vec<Vec3>,
    noise: Vec<Vec3>,
    mission: Mission,
}

impl Flown {
    fn new(plan: Plan) -> Self {
        let mission = mission(plan, Vec3::zeros());
        let (start, end) = (f64::from(mission.config().start_clock_s), f64::from(mission.config().end_clock_s()));
        let clock_s: Vec<f64> =
            (0..).map(|i| start + 100.0 + 25.0 * f64::from(i)).take_while(|t| *t < end - 100.0).collect();
        let expected = windows(&mission, &clock_s);
        let moved = windows(&self::mission(plan, Vec3::from(SHIFT_M)), &clock_s);
        let after = |t: f64, a: Vec3| if t >= ONSET_S { a } else { Vec3::zeros() };
        let shift = (0..clock_s.len()).map(|i| after(clock_s[i], moved[i] - expected[i])).collect();
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut halves = || Vec3::from_fn(|_, _| NOISE_NG * Distribution::<f64>::sample(&StandardNormal, &mut rng));
        let halves: Vec<Vec3> = (0..=clock_s.len()).map(|_| halves()).collect();
        let noise = halves.windows(2).map(|two| (two[0] + two[1]) / 2.0_f64.sqrt()).collect();
        Self { clock_s, expected, shift, noise, mission }
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
                        Truth::MassShift => sign(i) * self.shift[i][k],
                        Truth::BiasStep => self.step(i)[k],
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

fn numbers_after(text: &str, words: &[&str]) -> Option<Vec<f64>> {
    let number = |word: &&str| {
        let rest = &text[text.find(word)? + word.len()..];
        rest.trim_start().split([' ', ',', ')']).next()?.parse().ok()
    };
    words.iter().map(number).collect()
}

#[test]
fn a_mass_shift_and_a_bias_step_are_decided_by_the_observation_told_and_not_by_waiting() {
    let known = Flown::new(Plan { hours: 0.0, turn_to_deg: None });
    let asked = known.diagnosed(Truth::MassShift);
    assert_eq!(asked.verdict, Verdict::Ambiguous, "{asked:#?}");
    for id in ["mass_shift", "bias_step"] {
        assert!(asked.cannot_tell_apart.iter().any(|set| set == &[id]), "{id}: {:?}", asked.cannot_tell_apart);
    }
    let told = asked.separating_observation.unwrap();
    let gain = told.gain.unwrap();
    eprintln!("{}: {} ({gain})", told.kind, told.text);
    assert!(gain >= 3.0, "{told:?}");
    let hours = numbers_after(&told.text, &["degrees) for", "as it is, for"])
        .map_or_else(|| numbers_after(&told.text, &[" for"]).unwrap()[0], |hours| hours[0]);

    // As long in the attitude held: nothing is decided.
    let waiting = Flown::new(Plan { hours: hours + 0.25, turn_to_deg: None });
    for truth in [Truth::MassShift, Truth::BiasStep] {
        assert_eq!(waiting.diagnosed(truth).verdict, Verdict::Ambiguous, "{truth:?} after waiting");
    }
    match told.kind.as_str() {
        "table_flip" => {
            let from_s = known.clock_s[known.clock_s.len() - 1] + 600.0;
            let (shift, step) = (
                waiting.shift_against_step(Truth::MassShift, from_s),
                waiting.shift_against_step(Truth::BiasStep, from_s),
            );
            let (no_shift, no_step) = (
                waiting.shift_against_step(Truth::MassShift, f64::INFINITY),
                waiting.shift_against_step(Truth::BiasStep, f64::INFINITY),
            );
            eprintln!("turned: {shift:.1} {step:.1}; not turned: {no_shift:.1} {no_step:.1}");
            assert!(shift > 3.0 && step < -3.0, "{shift} {step}");
            assert!(no_shift.abs() < 3.0 && no_step.abs() < 3.0, "{no_shift} {no_step}");
        }
        "attitude" => {
            let deg = numbers_after(&told.text, &["roll", "pitch", "yaw"]).unwrap();
            let turned = Flown::new(Plan { hours: hours + 0.25, turn_to_deg: Some([deg[0], deg[1], deg[2]]) });
            for (truth, id) in [(Truth::MassShift, "mass_shift"), (Truth::BiasStep, "bias_step")] {
                let decided = turned.diagnosed(truth);
                let named: Vec<&str> = decided.effects.iter().map(|e| e.id.as_str()).collect();
                assert_eq!((decided.verdict, named), (Verdict::Explained, vec![id]), "{truth:?}");
            }
        }
        other => panic!("{other} is no observation that can be flown"),
    }
}

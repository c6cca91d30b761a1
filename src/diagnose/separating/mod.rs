//! The cheapest observation that would decide between sets the recording cannot tell apart.
//!
//! Every candidate is flown: the orbit goes on from the last window, the vehicle holds another attitude or the sensor's table is
//! turned, and each set predicts the recording from then on with the numbers it was fitted with. What a candidate is worth is
//! the evidence it is expected to add, for whichever set is true, against the rival that comes nearest to it after a new fit:
//! half the squared matched-filter SNR that the rival cannot absorb, over old and new windows together, less the same over the
//! old ones (the Kullback-Leibler divergence of two Gaussian records of equal covariance). Noise as fitted, the unknown
//! constant per axis fixed in the sensor.
//!
//! Where no flight decides, an act that the log has is flown again without the others, and a warmer sensor. Not simulated: other events to
//! come (none are assumed), and whether a log is complete, for which a share stands.

mod outcome;

use std::sync::Arc;

use crate::math::{robust, shared_work};
use crate::physics::attitude::{self, Attitude};
use crate::physics::orbit::{self, State};
use crate::physics::{J2, Vec3, drag, gravity_gradient, rotation};
use crate::units::NANO_G_M_S2;

use self::outcome::{ACT_EVERY_S, Action, Candidate, Outcome, Pair, WARMER_C, round};
use super::answer::SeparatingObservation;
use super::axes;
use super::case::{Ancillary, Case, Event, Expectation, Simulation, WINDOW_STRIDE_S};
use super::catalogue::{Effect, LOGGED_PUSHES, Shape, Theta};
use super::design::{Chosen, Column, Frame, Raw};
use super::noise::AxisNoise;
use super::scene::{Axes, Scene, Surroundings};

/// Grid of what is to come, s.
const GRID_S: f64 = 30.0;
/// A turn takes this long, and nothing is compared meanwhile, s.
const TURN_S: f64 = 600.0;
/// What a candidate may last, h.
const HOURS: [f64; 4] = [1.5, 3.0, 6.0, 12.0];
/// An attitude this near to the one held is none to turn to, rad.
const NEAR_RAD: f64 = 0.5;
/// Share of real leaks that a pressure or valve log shows, and of records without one that seem to.
const LOG_SHOWS: [f64; 2] = [0.95, 0.02];
/// Width of the prior of a nonlinear parameter about its fitted value, in steps of its refinement.
const THETA_STEPS: f64 = 10.0;
/// Effects that are born in the sensor and turn with it.
const SENSOR_BORN: [&str; 3] = ["bias_step", "bias_drift", "temperature_bias"];
/// An act of the log begins so long after the turn, s.
const ACT_AFTER_S: f64 = 1800.0;
/// Attitudes to the local vertical (x forward, y opposite the orbit normal, z down): roll, pitch, yaw in degrees, and in words.
const ATTITUDES: [([f64; 3], &str); 6] = [
    ([0.0, 0.0, 0.0], "nose forward, belly to the Earth"),
    ([0.0, 90.0, 0.0], "nose to the sky"),
    ([0.0, -90.0, 0.0], "nose to the Earth"),
    ([180.0, 0.0, 180.0], "tail forward, belly to the sky"),
    ([0.0, 0.0, 90.0], "nose across the flight, belly to the Earth"),
    ([90.0, 0.0, 90.0], "belly across the flight"),
];

/// A member of a set: an effect at its nonlinear parameters.
#[derive(Clone)]
pub struct Part {
    /// The effect.
    pub effect: &'static Effect,
    /// Its nonlinear parameters.
    pub theta: Theta,
}

/// A set that may be the true one.
pub type Rival = Vec<Part>;

/// The cheapest observation that is expected to decide between the rivals, or the best there is; `None` where nothing can be flown.
pub fn cheapest(scene: &Scene, noise: &[AxisNoise; 3], rivals: &[Rival]) -> Option<SeparatingObservation> {
    if let Some(log) = consult_log(scene, rivals) {
        return Some(log);
    }
    let sets: Vec<Fitted> = rivals.iter().map(|rival| Fitted::new(scene, noise, rival)).collect::<Option<_>>()?;
    let now = Contest::new(scene, noise, &sets, None)?;
    let mut candidates: Vec<Candidate> =
        actions(scene).into_iter().flat_map(|action| HOURS.map(|hours| Candidate { action, hours })).collect();
    candidates.sort_by(|a, b| a.cost_h().total_cmp(&b.cost_h()));
    let mut best: Option<Outcome> = None;
    // One that parts as many beats whatever costs more; one that parts all ends the search.
    for equal in candidates.chunk_by(|a, b| a.cost_h() == b.cost_h()) {
        let flown = shared_work::map(equal, |candidate| fly(scene, noise, &sets, &now, *candidate));
        let better = |a: Outcome, b: Outcome| if b.beats(&a) { b } else { a };
        best = best.into_iter().chain(flown.into_iter().flatten()).reduce(better);
        if best.as_ref().is_some_and(|best| best.parted() == best.pairs.len()) {
            break;
        }
    }
    if best.as_ref().is_none_or(|best| best.parted() == 0) {
        let acts = acts(scene, rivals).into_iter().flat_map(|action| HOURS.map(|hours| Candidate { action, hours }));
        let acts: Vec<Candidate> = acts.collect();
        let tried = shared_work::map(&acts, |candidate| fly(scene, noise, &sets, &now, *candidate));
        // The one that parts most, and of those that part as many the shortest: they are by action and by hours.
        let better = |a: Outcome, b: Outcome| {
            let [parts, hours] = [b.parted().cmp(&a.parted()), a.candidate.hours.total_cmp(&b.candidate.hours)];
            if parts.then(hours).is_gt() { b } else { a }
        };
        best = tried.into_iter().flatten().filter(|outcome| outcome.parted() > 0).reduce(better).or(best);
    }
    best.map(|outcome| outcome.told(rivals))
}

/// Acts of the log that some rivals have and others have not, and a warmer sensor where some go by its temperature.
fn acts(scene: &Scene, rivals: &[Rival]) -> Vec<Action> {
    let some = |id: &str| {
        let has = rivals.iter().filter(|rival| rival.iter().any(|part| part.effect.id == id)).count();
        0 < has && has < rivals.len()
    };
    let logged = LOGGED_PUSHES.into_iter().filter(|(id, _)| some(id)).filter_map(|(_, kind)| {
        let events = scene.case.events.iter().filter(|event| event.kind == kind && event.duration_s > 0.0);
        let mut durations_s: Vec<f64> = events.map(|event| event.duration_s).collect();
        Some(Action::Again(kind, robust::median(&mut durations_s)?))
    });
    logged.chain(some("temperature_bias").then_some(Action::Warm)).collect()
}

/// Where every pair of rivals differs by a leak, a log of pressures and valves decides without any flying.
fn consult_log(scene: &Scene, rivals: &[Rival]) -> Option<SeparatingObservation> {
    let leak = |rival: &Rival| rival.iter().find(|part| part.effect.id == "vent_leak").map(|part| part.theta[0]);
    let leaks: Vec<Option<f64>> = rivals.iter().map(leak).collect();
    let onset_s = leaks.iter().flatten().copied().next()?;
    if rivals.len() != 2 || leaks.iter().all(Option::is_some) {
        return None;
    }
    let [seen, mistaken] = LOG_SHOWS;
    let divergence = |p: f64, q: f64| p * (p / q).ln() + (1.0 - p) * ((1.0 - p) / (1.0 - q)).ln();
    let gain = divergence(seen, mistaken).min(divergence(mistaken, seen));
    let met_h = (onset_s - scene.case.header.liftoff_clock_s) / 3600.0;
    Some(SeparatingObservation {
        kind: "log".into(),
        text: format!(
            "Consult the logs of valves, cabin and tank pressures about clock {onset_s:.0} s (MET {met_h:.2} h): a leak that pushes the \
             vehicle costs gas, the other set costs none. Where {:.0} % of leaks leave a trace there, the true set gains {gain:.1} in log \
             evidence.",
            100.0 * seen
        ),
        gain: Some(round(gain)),
    })
}

/// Everything but the attitudes that are held already.
fn actions(scene: &Scene) -> Vec<Action> {
    let last = scene.grid_s.partition_point(|t| *t <= scene.span_s()[1]).clamp(1, scene.grid_s.len()) - 1;
    let state = State { r_m: scene.r_m[last], v_m_s: scene.v_m_s[last] };
    let held = attitude_on_grid(scene, last);
    let differs = |euler_deg: &[f64; 3]| {
        held.is_none_or(|held| attitude::hold_lvlh(&state, &rad(euler_deg)).angle_to(&held) > NEAR_RAD)
    };
    let mut actions = vec![Action::Turn];
    actions.extend(ATTITUDES.iter().filter(|(e, _)| differs(e)).map(|(e, words)| Action::Hold(*e, words)));
    actions.push(Action::Freeze);
    actions
}

fn rad(euler_deg: &[f64; 3]) -> Vec3 {
    Vec3::from(euler_deg.map(f64::to_radians))
}

fn attitude_on_grid(scene: &Scene, i: usize) -> Option<Attitude> {
    let [w, x, y, z] = *scene.case.ancillary.q.get(i)?;
    attitude::from_scalar_first(w, x, y, z)
}

/// A set with the numbers it was fitted with.
struct Fitted<'a> {
    rival: &'a Rival,
    coefficients: Vec<Vec<f64>>,
}

impl<'a> Fitted<'a> {
    fn new(scene: &Scene, noise: &[AxisNoise; 3], rival: &'a Rival) -> Option<Self> {
        let frame = Frame::new(noise, &scene.schedule, &scene.loudness, &scene.residual_ng);
        let mut linear: Vec<Column> = Vec::new();
        let mut fixed: Vec<Column> = Vec::new();
        for part in rival {
            let shape = (part.effect.signature)(scene, &part.theta)?;
            let columns = shape.columns();
            match shape {
                Shape::Fixed(_) => fixed.push(frame.column(&columns[0], 1.0)),
                _ => linear.extend(columns.iter().zip(part.effect.linear).map(|(raw, l)| frame.column(raw, l.size))),
            }
        }
        let chosen = Chosen::new(&frame, linear.iter().collect(), &fixed.iter().collect::<Vec<_>>());
        let (mean, _) = chosen.posterior();
        let mut next = mean.iter();
        let coefficients = rival
            .iter()
            .map(|part| part.effect.linear.iter().map(|l| l.size * next.next().copied().unwrap_or(0.0)).collect())
            .collect();
        Some(Self { rival, coefficients })
    }
}

/// Windows from here on were taken with the table turned.
type Turned = Option<usize>;

/// In the frame of the sensor: what the table's turn does to a contribution that is not born in the sensor.
fn seen_by_sensor(mut raw: Raw, effect: &Effect, turned: Turned) -> Raw {
    if let Some(first) = turned
        && !SENSOR_BORN.contains(&effect.id)
    {
        raw.iter_mut().flatten().for_each(|series| series[first..].iter_mut().for_each(|x| *x = -*x));
    }
    raw
}

/// Every set's prediction of a record, and what each is free to fit to it.
struct Contest {
    /// Prediction of each set at the windows, sensor frame.
    predicted: Vec<Axes>,
    /// Half the squared SNR of one set's prediction that another cannot absorb, by true and by fitted set.
    left: Vec<Vec<f64>>,
}

impl Contest {
    fn new(scene: &Scene, noise: &[AxisNoise; 3], sets: &[Fitted], turned: Turned) -> Option<Self> {
        let zero: Axes = std::array::from_fn(|_| vec![0.0; scene.schedule.len()]);
        let frame = Frame::new(noise, &scene.schedule, &scene.loudness, &zero);
        let mut predicted = Vec::new();
        let mut free: Vec<Vec<Column>> = Vec::new();
        for set in sets {
            let mut sum = zero.clone();
            let mut columns = Vec::new();
            for (part, coefficients) in set.rival.iter().zip(&set.coefficients) {
                let here = contribution(scene, part, &part.theta, coefficients, turned)?;
                for (j, raw) in here.columns.iter().enumerate().filter(|_| !here.is_fixed) {
                    columns.push(frame.column(raw, part.effect.linear[j].size));
                }
                for (j, p) in part.effect.nonlinear.iter().enumerate().filter(|(_, p)| p.step > 0.0) {
                    let slope = slope(scene, part, coefficients, j, p.step, turned, &here.sum);
                    columns.extend(slope.map(|raw| frame.column(&raw, THETA_STEPS * p.step)));
                }
                axes::add_regressor_and_flips(&mut sum, &here.sum.map(Some), 1.0);
            }
            predicted.push(sum);
            free.push(columns);
        }
        let whitened: Vec<Column> = predicted.iter().map(|p| frame.column(&p.clone().map(Some), 1.0)).collect();
        let left = (0..sets.len())
            .map(|a| {
                let against = |b: usize| {
                    let chosen = Chosen::new(&frame, free[b].iter().collect(), &[]);
                    if a == b { 0.0 } else { 0.5 * chosen.left_in(&whitened[a]).0 }
                };
                (0..sets.len()).map(against).collect()
            })
            .collect();
        Some(Self { predicted, left })
    }

    /// What this record adds to another one for a true set against a rival.
    fn adds_to(&self, now: &Contest, truth: usize, rival: usize) -> f64 {
        self.left[truth][rival] - now.left[truth][rival]
    }
}

struct Contribution {
    columns: Vec<Raw>,
    is_fixed: bool,
    sum: Axes,
}

fn contribution(
    scene: &Scene,
    part: &Part,
    theta: &Theta,
    coefficients: &[f64],
    turned: Turned,
) -> Option<Contribution> {
    let shape = (part.effect.signature)(scene, theta)?;
    let is_fixed = matches!(shape, Shape::Fixed(_));
    let columns: Vec<Raw> = shape.columns().into_iter().map(|raw| seen_by_sensor(raw, part.effect, turned)).collect();
    let mut sum = axes::nothing(scene.schedule.len());
    for (j, raw) in columns.iter().enumerate() {
        axes::add_regressor_and_flips(&mut sum, raw, if is_fixed { 1.0 } else { coefficients[j] });
    }
    Some(Contribution { columns, is_fixed, sum })
}

/// Derivative of a contribution by nonlinear parameter `j`.
fn slope(
    scene: &Scene,
    part: &Part,
    coefficients: &[f64],
    j: usize,
    step: f64,
    turned: Turned,
    here: &Axes,
) -> Option<Raw> {
    let h = 0.1 * step;
    let at = |sign: f64| {
        let mut theta = part.theta;
        theta[j] += sign * h;
        contribution(scene, part, &theta, coefficients, turned).map(|c| c.sum)
    };
    let (high, low) = (at(1.0), at(-1.0));
    let span = h * f64::from(u8::from(high.is_some()) + u8::from(low.is_some()));
    let (high, low) = (high.unwrap_or_else(|| here.clone()), low.unwrap_or_else(|| here.clone()));
    (span > 0.0)
        .then(|| std::array::from_fn(|k| Some(high[k].iter().zip(&low[k]).map(|(a, b)| (a - b) / span).collect())))
}

/// Flies a candidate and has the sets compete on it.
fn fly(scene: &Scene, noise: &[AxisNoise; 3], sets: &[Fitted], now: &Contest, candidate: Candidate) -> Option<Outcome> {
    let Candidate { action, hours } = candidate;
    let (case, surroundings) = to_come(scene, action, hours)?;
    let ahead = scene.gone_on(&case, Arc::new(surroundings));
    let first = scene.schedule.len();
    let turned = matches!(action, Action::Turn).then_some(first);
    let then = Contest::new(&ahead, noise, sets, turned)?;
    let differ_ng = |a: usize, b: usize| {
        std::array::from_fn(|k| {
            let series: Vec<f64> = then.predicted[a][k].iter().zip(&then.predicted[b][k]).map(|(x, y)| x - y).collect();
            let before = series[..first].iter().sum::<f64>() / first as f64;
            let new = &series[first..ahead.schedule.len()];
            (new.iter().map(|d| (d - before).powi(2)).sum::<f64>() / new.len().max(1) as f64).sqrt()
        })
    };
    let pairs = (0..sets.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
    let pair = |(a, b): (usize, usize)| Pair {
        sets: [a, b],
        gain: then.adds_to(now, a, b).min(then.adds_to(now, b, a)),
        differ_ng: differ_ng(a, b),
    };
    Some(Outcome { candidate, pairs: pairs.map(pair).collect() })
}

/// The case with what is to come behind it: windows, simulation, orbit and environment.
fn to_come(scene: &Scene, action: Action, hours: f64) -> Option<(Case, Surroundings)> {
    let known_until = scene.grid_s.partition_point(|t| *t <= scene.span_s()[1]).clamp(2, scene.grid_s.len());
    let from_s = scene.grid_s[known_until - 1];
    let points = ((TURN_S + hours * 3600.0) / GRID_S).ceil() as usize + 2;
    let more = ahead_of(scene, known_until - 1, action, points)?;
    let surroundings = scene.surroundings().until(known_until).then(&Surroundings::new(&more).ok()?);

    let mut expected = Expectation::clone(&scene.case.expected);
    let cut = expected.simulation.clock_s.partition_point(|t| *t <= from_s);
    expected.simulation.clock_s.truncate(cut);
    expected.simulation.clock_s.extend(&more.simulation.clock_s);
    for (series, new) in expected.simulation.a_ng.iter_mut().zip(&more.simulation.a_ng) {
        series.truncate(cut);
        series.extend(new);
    }
    if let Action::Again(kind, duration_s) = action {
        let act = |n: usize| Event {
            clock_s: from_s + TURN_S + ACT_AFTER_S + n as f64 * ACT_EVERY_S,
            duration_s,
            kind: kind.to_owned(),
            detail: String::new(),
        };
        expected.events.extend((0..Candidate { action, hours }.acts()).map(act));
    }
    let mut recording = scene.case.recording.clone();
    let first_s = from_s + TURN_S;
    let windows = (hours * 3600.0 / WINDOW_STRIDE_S) as usize;
    recording.clock_s.extend((1..=windows).map(|n| first_s + n as f64 * WINDOW_STRIDE_S));
    for k in 0..3 {
        let (a, dev) = (&mut recording.a_ng[k], &mut recording.dev_ng[k]);
        a.resize(a.len() + windows, 0.0);
        let usual = dev.last().copied().unwrap_or(1.0);
        dev.resize(dev.len() + windows, usual);
        // What the calibration leaves open now it leaves open then.
        for error in recording.bias_errors_ng[k].iter_mut().chain(&mut recording.scale_errors[k]) {
            let now = error.last().copied().unwrap_or(0.0);
            error.resize(error.len() + windows, now);
        }
        recording.bias_laws[k].iter_mut().for_each(|law| law.go_on(windows));
    }
    Some((
        Case {
            expected: Arc::new(expected),
            recording,
            windows_beyond: 0,
            windows_in_holes: 0,
            windows_too_rough: 0,
            windows_of_spikes: 0,
            windows_frozen: 0,
        },
        surroundings,
    ))
}

/// Orbit, attitude, environment and simulation after grid point `last`. Density and temperature are those of the same place on
/// an earlier revolution.
fn ahead_of(scene: &Scene, last: usize, action: Action, points: usize) -> Option<Expectation> {
    let start_s = scene.grid_s[last];
    let begin = State { r_m: scene.r_m[last], v_m_s: scene.v_m_s[last] };
    let held = attitude_on_grid(scene, last)?;
    let to_lvlh = held * attitude::lvlh_from_inertial(&begin).inverse();
    // The table turns and the vehicle goes on as it did: by the stars where its last minute was, by the vertical else.
    let keeps_stars = scene.w_rad_s[last].norm() < 0.3 * std::f64::consts::TAU / scene.period_s;
    let pointing = |state: &State| match action {
        Action::Hold(euler_deg, _) => attitude::hold_lvlh(state, &rad(&euler_deg)),
        Action::Freeze => held,
        _ if keeps_stars => held,
        Action::Turn | Action::Again(..) | Action::Warm => to_lvlh * attitude::lvlh_from_inertial(state),
    };
    let mut ancillary = Ancillary::default();
    let mut simulation = Simulation::default();
    let mut state = begin;
    for n in 1..=points {
        state = orbit::step(&orbit::step(&state, GRID_S / 2.0, J2), GRID_S / 2.0, J2);
        let later = orbit::step(&state, 1.0, J2);
        let clock_s = start_s + n as f64 * GRID_S;
        let q = pointing(&state);
        let rate = attitude::rate_rad_s(&q, &pointing(&later), 1.0);
        let like = like(scene, clock_s, last);
        let density = scene.density_kg_m3[like];
        ancillary.clock_s.push(clock_s);
        ancillary.r_m.push(state.r_m.into());
        ancillary.v_m_s.push(state.v_m_s.into());
        ancillary.q.push(attitude::to_scalar_first(&q));
        ancillary.w_rad_s.push(rate.into());
        ancillary.density_kg_m3.push(density);
        ancillary
            .temperature_c
            .push(scene.temperature_c[like] + if matches!(action, Action::Warm) { WARMER_C } else { 0.0 });
        simulation.clock_s.push(clock_s);
        let c = attitude::body_from_inertial(&q);
        let offset = scene.vehicle.sensor_offset_m;
        let wind = c * drag::relative_velocity_m_s(&state.r_m, &state.v_m_s, 1.0, &Vec3::zeros());
        let a = gravity_gradient::specific_force_m_s2(&(c * state.r_m), &offset)
            + rotation::specific_force_m_s2(&rate, &Vec3::zeros(), &offset)
            + drag::acceleration_m_s2(&scene.vehicle, density, &wind);
        (0..3).for_each(|k| simulation.a_ng[k].push(a[k] / NANO_G_M_S2));
    }
    Some(Expectation { header: scene.case.header.clone(), simulation, ancillary, events: Vec::new() })
}

/// The grid point at the same place some whole revolutions earlier.
fn like(scene: &Scene, clock_s: f64, last: usize) -> usize {
    let back = ((clock_s - scene.grid_s[last]) / scene.period_s).ceil().max(1.0);
    scene.grid_s.partition_point(|t| *t < clock_s - back * scene.period_s).min(last)
}

//! Where the vehicle is and which way it points, at any instant of the mission.

use nalgebra::UnitQuaternion;
use rand::RngExt;

use crate::physics::attitude::{Attitude, from_euler, hold_lvlh, lvlh_from_inertial, rate_rad_s, smooth_fraction};
use crate::physics::orbit::{STEP_S_MAX, State, gravity_m_s2, step};
use crate::physics::{J2, PhysicsError, Vec3};

use super::mission::MissionConfig;
use super::{Purpose, generator};

/// What an attitude is held to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hold {
    /// The local vertical.
    LocalVertical,
    /// The stars: the Euler angles are those to the local vertical at the moment the hold begins.
    Inertial,
}

/// An attitude from an instant on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeHold {
    /// Instrument clock at which the manoeuvre to it begins, s.
    pub from_clock_s: f64,
    /// What it is held to.
    pub hold: Hold,
    /// Roll, pitch, yaw, rad.
    pub euler_rad: Vec3,
}

/// Seconds of trajectory kept before the start and after the end, for differences.
const MARGIN_S: f64 = 60.0;
/// Half the span over which rates are differenced, s.
const RATE_SPAN_S: f64 = 2.0;
/// Periods between which the attitude control swings, s.
const WOBBLE_PERIOD_S: std::ops::Range<f64> = 500.0..2500.0;

/// The trajectory of a mission.
pub struct Trajectory {
    first_clock_s: f64,
    states: Vec<State>,
    legs: Vec<Leg>,
    manoeuvre_s: f64,
    wobble: [[Swing; 3]; 3],
}

#[derive(Clone, Copy)]
struct Swing {
    amplitude_rad: f64,
    rate_rad_s: f64,
    phase_rad: f64,
}

struct Leg {
    hold: AttitudeHold,
    /// Attitude at the beginning, for an inertial hold.
    inertial: Attitude,
    /// The turn from the hold before, at the beginning: angle times axis.
    turn_rad: Vec3,
}

/// Where the vehicle is, how it points and turns.
#[derive(Debug, Clone, Copy)]
pub struct Situation {
    /// Position and velocity, inertial.
    pub state: State,
    /// Body from inertial.
    pub attitude: Attitude,
    /// Inertial rate, body axes, rad/s.
    pub rate_rad_s: Vec3,
    /// Its derivative, rad/s^2.
    pub acceleration_rad_s2: Vec3,
}

impl Trajectory {
    /// Propagates the orbit of a plan and lays its attitudes along it.
    ///
    /// # Errors
    /// When the elements describe no closed orbit.
    pub fn new(config: &MissionConfig) -> Result<Self, PhysicsError> {
        let first_clock_s = f64::from(config.start_clock_s) - MARGIN_S;
        let start = config.orbit.state()?;
        let back = crate::physics::orbit::propagate(&start, -MARGIN_S, STEP_S_MAX, J2)?;
        let span_s = f64::from(config.end_clock_s() - config.start_clock_s) + 2.0 * MARGIN_S;
        let steps = (span_s / STEP_S_MAX).ceil() as usize;
        let mut states = Vec::with_capacity(steps + 1);
        states.push(back);
        for k in 0..steps {
            states.push(step(&states[k], STEP_S_MAX, J2));
        }
        let mut trajectory =
            Self { first_clock_s, states, legs: Vec::new(), manoeuvre_s: config.manoeuvre_s, wobble: wobble(config) };
        for hold in &config.attitudes {
            let state = trajectory.state(hold.from_clock_s.max(first_clock_s));
            let e = hold.euler_rad;
            let inertial = from_euler(e.x, e.y, e.z) * lvlh_from_inertial(&state);
            let mut leg = Leg { hold: *hold, inertial, turn_rad: Vec3::zeros() };
            if let Some(before) = trajectory.legs.last() {
                leg.turn_rad = (held(&leg, &state) * held(before, &state).inverse()).scaled_axis();
            }
            trajectory.legs.push(leg);
        }
        Ok(trajectory)
    }

    /// Position and velocity: quintic Hermite between the steps of the propagation (sub-millimetre over 10 s).
    pub fn state(&self, clock_s: f64) -> State {
        let position = (clock_s - self.first_clock_s) / STEP_S_MAX;
        let k = (position.floor().max(0.0) as usize).min(self.states.len() - 2);
        let (a, b) = (&self.states[k], &self.states[k + 1]);
        let h = STEP_S_MAX;
        let s = position - k as f64;
        let (ga, gb) = (gravity_m_s2(&a.r_m, J2), gravity_m_s2(&b.r_m, J2));
        let (s2, s3) = (s * s, s * s * s);
        let (s4, s5) = (s3 * s, s3 * s2);
        let r_m = a.r_m * (1.0 - 10.0 * s3 + 15.0 * s4 - 6.0 * s5)
            + a.v_m_s * (h * (s - 6.0 * s3 + 8.0 * s4 - 3.0 * s5))
            + ga * (h * h * (0.5 * s2 - 1.5 * s3 + 1.5 * s4 - 0.5 * s5))
            + b.r_m * (10.0 * s3 - 15.0 * s4 + 6.0 * s5)
            + b.v_m_s * (h * (-4.0 * s3 + 7.0 * s4 - 3.0 * s5))
            + gb * (h * h * (0.5 * s3 - s4 + 0.5 * s5));
        let v_m_s = a.r_m * ((-30.0 * s2 + 60.0 * s3 - 30.0 * s4) / h)
            + a.v_m_s * (1.0 - 18.0 * s2 + 32.0 * s3 - 15.0 * s4)
            + ga * (h * (s - 4.5 * s2 + 6.0 * s3 - 2.5 * s4))
            + b.r_m * ((30.0 * s2 - 60.0 * s3 + 30.0 * s4) / h)
            + b.v_m_s * (-12.0 * s2 + 28.0 * s3 - 15.0 * s4)
            + gb * (h * (1.5 * s2 - 4.0 * s3 + 2.5 * s4));
        State { r_m, v_m_s }
    }

    /// Body from inertial.
    pub fn attitude(&self, clock_s: f64) -> Attitude {
        self.attitude_at(clock_s, &self.state(clock_s))
    }

    fn attitude_at(&self, clock_s: f64, state: &State) -> Attitude {
        let leg = self.legs.partition_point(|leg| leg.hold.from_clock_s <= clock_s).max(1) - 1;
        let mut attitude = held(&self.legs[leg], state);
        let since_s = clock_s - self.legs[leg].hold.from_clock_s;
        if leg > 0 && since_s < self.manoeuvre_s {
            let before = held(&self.legs[leg - 1], state);
            let turn = turn_near(&before, &attitude, &self.legs[leg].turn_rad);
            attitude = UnitQuaternion::from_scaled_axis(turn * smooth_fraction(since_s / self.manoeuvre_s)) * before;
        }
        let tilt = self.wobble.map(|swings| {
            swings.iter().map(|s| s.amplitude_rad * (s.rate_rad_s * clock_s + s.phase_rad).sin()).sum::<f64>()
        });
        UnitQuaternion::from_scaled_axis(Vec3::from(tilt)) * attitude
    }

    /// Everything at an instant; rates by differences over 2 s each way.
    pub fn situation(&self, clock_s: f64) -> Situation {
        let state = self.state(clock_s);
        let attitude = self.attitude_at(clock_s, &state);
        let h = RATE_SPAN_S;
        let early = rate_rad_s(&self.attitude(clock_s - h), &attitude, h);
        let late = rate_rad_s(&attitude, &self.attitude(clock_s + h), h);
        Situation { state, attitude, rate_rad_s: (early + late) / 2.0, acceleration_rad_s2: (late - early) / h }
    }
}

/// The turn from one attitude to the other, the way round that is nearer to a known turn. Both holds move while the vehicle turns
/// from one to the other; the shorter way may become the longer one, and no vehicle changes its mind half way.
fn turn_near(from: &Attitude, to: &Attitude, known_rad: &Vec3) -> Vec3 {
    let turn = (to * from.inverse()).scaled_axis();
    let angle = turn.norm();
    if angle < 1e-9 {
        return turn;
    }
    let other = turn * (1.0 - std::f64::consts::TAU / angle);
    if (other - known_rad).norm_squared() < (turn - known_rad).norm_squared() { other } else { turn }
}

fn held(leg: &Leg, state: &State) -> Attitude {
    match leg.hold.hold {
        Hold::LocalVertical => hold_lvlh(state, &leg.hold.euler_rad),
        Hold::Inertial => leg.inertial,
    }
}

/// Three swings per axis, of periods and phases of their own: the dead band of the attitude control, smoothed.
fn wobble(config: &MissionConfig) -> [[Swing; 3]; 3] {
    let mut random = generator(config.seed, Purpose::Wobble);
    std::array::from_fn(|_| {
        std::array::from_fn(|_| Swing {
            amplitude_rad: config.wobble_rad * random.random_range(0.2..0.6),
            rate_rad_s: std::f64::consts::TAU / random.random_range(WOBBLE_PERIOD_S),
            phase_rad: random.random_range(0.0..std::f64::consts::TAU),
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::orbit::propagate;

    fn trajectory() -> (MissionConfig, Trajectory) {
        let config = MissionConfig::sts65(7, 24.0);
        let trajectory = Trajectory::new(&config).unwrap();
        (config, trajectory)
    }

    #[test]
    fn between_steps_it_is_the_propagated_orbit() {
        let (config, trajectory) = trajectory();
        let start = config.orbit.state().unwrap();
        for seconds in [3.7, 1234.5, 20_004.1] {
            let expected = propagate(&start, seconds, 1.0, J2).unwrap();
            let found = trajectory.state(f64::from(config.start_clock_s) + seconds);
            // The propagations themselves part by centimetres an orbit for their steps of 1 and 10 s.
            assert!((found.r_m - expected.r_m).norm() < 0.2, "{}", (found.r_m - expected.r_m).norm());
            assert!((found.v_m_s - expected.v_m_s).norm() < 3e-4);
        }
    }

    #[test]
    fn the_attitude_has_no_jump_anywhere() {
        let (config, trajectory) = trajectory();
        let start = f64::from(config.start_clock_s);
        for k in 0..8640 {
            let t = start + f64::from(k) * 10.0;
            let turned = trajectory.attitude(t).angle_to(&trajectory.attitude(t + 1.0));
            assert!(turned < 0.012, "{turned} rad in a second at {t}");
        }
    }

    #[test]
    fn a_manoeuvre_goes_on_the_way_it_began() {
        // In 14.75 days the holds pass through half a turn from each other during a manoeuvre.
        let config = MissionConfig::sts65(7, 354.0);
        let trajectory = Trajectory::new(&config).unwrap();
        for hold in &config.attitudes {
            for k in 0..120 {
                let t = hold.from_clock_s + f64::from(k) * 5.0;
                let turned = trajectory.attitude(t).angle_to(&trajectory.attitude(t + 1.0));
                assert!(turned < 0.025, "{turned} rad in a second at {t}");
            }
        }
    }

    #[test]
    fn held_to_the_vertical_it_turns_with_the_orbit() {
        let (config, trajectory) = trajectory();
        let situation = trajectory.situation(f64::from(config.start_clock_s) + 5000.0);
        let n = std::f64::consts::TAU / crate::physics::orbit::period_s(&situation.state);
        assert!((situation.rate_rad_s.norm() - n).abs() < 5e-5, "{}", situation.rate_rad_s);
        assert!(situation.acceleration_rad_s2.norm() < 1e-6);
    }
}

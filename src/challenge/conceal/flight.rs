//! One day and a half of an Orbiter's flight, drawn from a seed: orbit, attitude, atmosphere, temperature and log.
//!
//! The orbit is integrated here on a 5 s grid with J2 (its first figures: about 300 km, 28.5 deg); the analyser only ever sees the
//! 20 s ancillary file made from it. Not here: what the sensor feels (see `force`), what the simulation lacks (see `effect`).

use nalgebra::{Matrix3, Rotation3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha12Rng;

use super::draw::{between, log_between, pick};
use super::effect::at;
use super::temperature::Temperature;
use super::{Kind, Manner};
use crate::units::MissionTime;

/// Step of the generator's own grid, s. The 20 s files take every fourth point of it.
pub const STEP_S: f64 = 5.0;
/// Points of the generator's grid in one step of the files.
pub const FILE_STRIDE: usize = 4;
/// The files begin this long before the recording and end this long after it, s.
pub const MARGIN_S: f64 = 600.0;
/// Earth's gravitational parameter of the case format, m^3/s^2.
pub const MU_M3_S2: f64 = 3.986_004_418e14;
/// Rotation of the atmosphere in the case format, rad/s.
pub const EARTH_RATE_RAD_S: f64 = 7.292_115_9e-5;
/// Least time between two slews, s; the longest takes 1700 s.
const APART_S: f64 = 2000.0;
const EARTH_RADIUS_M: f64 = 6_378_137.0;
const J2: f64 = 1.082_626_68e-3;

/// What the body is held fixed to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hold {
    /// The local vertical, local horizontal frame: x forward, y against the orbit normal, z down.
    Lvlh,
    /// The stars: the LVLH frame of the case's first instant, frozen.
    Inertial,
}

/// One commanded attitude: from when, held to what, turned by which roll, pitch and yaw (applied yaw first), deg.
#[derive(Debug, Clone, Copy)]
pub struct Attitude {
    /// Begin of the slew into it, s.
    pub from_s: f64,
    /// The frame.
    pub hold: Hold,
    /// Roll, pitch, yaw, deg.
    pub euler_deg: [f64; 3],
}

/// One line of the mission log.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// Begin, s.
    pub clock_s: f64,
    /// Length, s.
    pub duration_s: f64,
    /// The log's word for it.
    pub kind: &'static str,
}

/// The vehicle of `case.toml`, and what the true one may have beside it.
#[derive(Debug, Clone)]
pub struct Vehicle {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Drag coefficient.
    pub drag_coefficient: f64,
    /// Projected area along body X, Y, Z, m^2.
    pub area_m2: Vector3<f64>,
    /// The true area seen by wind on the positive and on the negative face, relative to the published one.
    pub face_scale: [Vector3<f64>; 2],
    /// Sensor from the centre of gravity, body axes, m.
    pub sensor_offset_m: Vector3<f64>,
}

/// The flight on the 5 s grid.
#[derive(Debug, Clone)]
pub struct Flight {
    /// First instant of the recording, s.
    pub start_s: f64,
    /// Its length, s.
    pub length_s: f64,
    /// Times, s; they begin `MARGIN_S` before `start_s`.
    pub times_s: Vec<f64>,
    /// Inertial position, m.
    pub position_m: Vec<Vector3<f64>>,
    /// Inertial velocity, m/s.
    pub velocity_m_s: Vec<Vector3<f64>>,
    /// Body from inertial.
    pub body: Vec<Rotation3<f64>>,
    /// Inertial rate in body axes, rad/s.
    pub rate_rad_s: Vec<Vector3<f64>>,
    /// Its derivative, rad/s^2.
    pub rate_change_rad_s2: Vec<Vector3<f64>>,
    /// Density without the day-night bulge, kg/m^3.
    pub density_flat_kg_m3: Vec<f64>,
    /// Sensor temperature, deg C.
    pub temperature_c: Vec<f64>,
    /// What makes it, and made it before.
    temperature: Temperature,
    /// Day-night amplitude of the density.
    pub bulge: f64,
    /// Wind beside co-rotation that both the vehicle and its simulation know, east and north, m/s, at each point.
    pub wind_m_s: Vec<Vector3<f64>>,
    /// Commanded attitudes.
    pub attitudes: Vec<Attitude>,
    /// The log, in order of time.
    pub events: Vec<Event>,
    /// The vehicle.
    pub vehicle: Vehicle,
}

/// The attitudes seen on the open cases, and four more of the same kind.
const LVLH_DEG: [[f64; 3]; 9] = [
    [0.0, 0.0, 0.0],
    [0.0, 90.0, 0.0],
    [0.0, -90.0, 0.0],
    [180.0, 0.0, 180.0],
    [90.0, 0.0, 90.0],
    [0.0, 0.0, 90.0],
    [-90.0, 0.0, 0.0],
    [0.0, 180.0, 0.0],
    [0.0, 20.0, 0.0],
];
const INERTIAL_DEG: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [30.0, 40.0, 0.0], [-60.0, 10.0, 75.0], [90.0, -35.0, 20.0]];

impl Flight {
    /// Draws one for a kind of question, asked in a manner.
    pub fn draw(rng: &mut ChaCha12Rng, kind: Kind, manner: Manner) -> Self {
        let length_s = 3600.0 * f64::from(manner.hours);
        let (is_single, other_physics) = (kind == Kind::Single, manner.other_physics);
        let start_s = 13_800.0 + (between(rng, 48.0, 145.0) * 360.0).round() * 10.0;
        let points = ((length_s + 2.0 * MARGIN_S) / STEP_S) as usize + 1;
        let times_s: Vec<f64> = (0..points).map(|k| start_s - MARGIN_S + STEP_S * k as f64).collect();
        let (position_m, velocity_m_s) = orbit(rng, points);
        let events = log(rng, start_s, length_s);
        let attitudes = plan(rng, start_s, length_s, is_single);
        let body = attitude(rng, &times_s, &position_m, &velocity_m_s, &attitudes, is_single);
        let rate_rad_s = rates(&body);
        let rate_change_rad_s2 = derivative(&rate_rad_s);
        let (density_flat_kg_m3, bulge) = density(rng, &times_s, &position_m, other_physics);
        let temperature = Temperature::draw(rng, &position_m[0]);
        let temperature_c = times_s.iter().map(|t| temperature.at_c(*t)).collect();
        let wind_m_s = wind(rng, &times_s, &position_m, other_physics);
        let vehicle = vehicle(rng, other_physics);
        Self {
            start_s,
            length_s,
            times_s,
            position_m,
            velocity_m_s,
            body,
            rate_rad_s,
            rate_change_rad_s2,
            density_flat_kg_m3,
            temperature_c,
            temperature,
            bulge,
            wind_m_s,
            attitudes,
            events,
            vehicle,
        }
    }

    /// Sensor temperature at a place of the grid, deg C; before the first as it was.
    pub fn temperature_at(&self, place: f64) -> f64 {
        if place < 0.0 {
            self.temperature.at_c(self.times_s[0] + place * STEP_S)
        } else {
            at(&self.temperature_c, place)
        }
    }

    /// Last instant of the recording, s.
    pub fn end_s(&self) -> f64 {
        self.start_s + self.length_s
    }

    /// UTC at a clock of the flight.
    pub fn mission() -> MissionTime {
        MissionTime::sts65()
    }
}

fn vehicle(rng: &mut ChaCha12Rng, other_physics: bool) -> Vehicle {
    let mut face = || Vector3::from_fn(|_, _| if other_physics { between(rng, 0.94, 1.06) } else { 1.0 });
    let face_scale = [face(), face()];
    let sensor_offset_m = Vector3::new(
        -1.5 + 0.1 * super::draw::normal(rng),
        0.08 * super::draw::normal(rng),
        1.45 + 0.12 * super::draw::normal(rng),
    );
    Vehicle {
        mass_kg: 104_000.0,
        drag_coefficient: 2.2,
        area_m2: Vector3::new(64.1, 255.0, 367.0),
        face_scale,
        sensor_offset_m: sensor_offset_m.map(|x| (x * 1e4).round() / 1e4),
    }
}

/// Point mass, J2 and a little drag, fourth-order Runge-Kutta.
fn orbit(rng: &mut ChaCha12Rng, points: usize) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
    let radius_m = EARTH_RADIUS_M + between(rng, 288e3, 318e3);
    let inclination = between(rng, 28.40, 28.52_f64).to_radians();
    let node = between(rng, 0.0, std::f64::consts::TAU);
    let latitude = between(rng, 0.0, std::f64::consts::TAU);
    let plane = Rotation3::from_euler_angles(0.0, 0.0, node) * Rotation3::from_euler_angles(inclination, 0.0, 0.0);
    let speed_m_s = (MU_M3_S2 / radius_m).sqrt() * (1.0 + between(rng, -3e-4, 3e-4));
    let mut r = plane * (Vector3::new(latitude.cos(), latitude.sin(), 0.0) * radius_m);
    let mut v = plane * (Vector3::new(-latitude.sin(), latitude.cos(), 0.0) * speed_m_s);
    let (mut positions, mut velocities) = (Vec::with_capacity(points), Vec::with_capacity(points));
    for _ in 0..points {
        positions.push(r);
        velocities.push(v);
        let h = STEP_S;
        let (k1v, k1r) = (pull(&r, &v), v);
        let (k2v, k2r) = (pull(&(r + k1r * (h / 2.0)), &(v + k1v * (h / 2.0))), v + k1v * (h / 2.0));
        let (k3v, k3r) = (pull(&(r + k2r * (h / 2.0)), &(v + k2v * (h / 2.0))), v + k2v * (h / 2.0));
        let (k4v, k4r) = (pull(&(r + k3r * h), &(v + k3v * h)), v + k3v * h);
        r += (k1r + 2.0 * k2r + 2.0 * k3r + k4r) * (h / 6.0);
        v += (k1v + 2.0 * k2v + 2.0 * k3v + k4v) * (h / 6.0);
    }
    (positions, velocities)
}

fn pull(r: &Vector3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
    let radius = r.norm();
    let factor = 1.5 * J2 * MU_M3_S2 * EARTH_RADIUS_M * EARTH_RADIUS_M / radius.powi(5);
    let z = 5.0 * (r.z / radius).powi(2);
    -r * (MU_M3_S2 / radius.powi(3))
        - Vector3::new(r.x * (1.0 - z), r.y * (1.0 - z), r.z * (3.0 - z)) * factor
        - v * (1.0e-6 / v.norm())
}

/// Local vertical, local horizontal from inertial: x forward, y against the orbit normal, z down.
pub fn lvlh(r: &Vector3<f64>, v: &Vector3<f64>) -> Rotation3<f64> {
    let z = -r.normalize();
    let y = -r.cross(v).normalize();
    let x = y.cross(&z);
    Rotation3::from_matrix_unchecked(Matrix3::from_rows(&[x.transpose(), y.transpose(), z.transpose()]))
}

/// Frame rotation yaw, then pitch, then roll.
fn euler(angles_deg: [f64; 3]) -> Rotation3<f64> {
    let [roll, pitch, yaw] = angles_deg.map(f64::to_radians);
    let axis = |axis: Vector3<f64>, angle: f64| Rotation3::new(axis * -angle);
    axis(Vector3::x(), roll) * axis(Vector3::y(), pitch) * axis(Vector3::z(), yaw)
}

fn plan(rng: &mut ChaCha12Rng, start_s: f64, length_s: f64, is_single: bool) -> Vec<Attitude> {
    let mut from_s = vec![start_s - MARGIN_S];
    if !is_single {
        let more = *pick(rng, &[1, 1, 1, 2, 2, 3]);
        let mut cuts: Vec<f64> = (0..more).map(|_| start_s + length_s * between(rng, 0.1, 0.9)).collect();
        cuts.sort_by(f64::total_cmp);
        // A slew is over before the next begins.
        cuts.dedup_by(|next, before| *next - *before < APART_S);
        from_s.extend(cuts);
    }
    let mut plan: Vec<Attitude> = Vec::new();
    for from_s in from_s {
        loop {
            let inertial = !is_single && rng.random_bool(0.3);
            let (hold, list) = if inertial { (Hold::Inertial, &INERTIAL_DEG[..]) } else { (Hold::Lvlh, &LVLH_DEG[..]) };
            let next = Attitude { from_s, hold, euler_deg: *pick(rng, list) };
            if plan.last().is_none_or(|last| last.hold != next.hold || last.euler_deg != next.euler_deg) {
                plan.push(next);
                break;
            }
        }
    }
    plan
}

fn attitude(
    rng: &mut ChaCha12Rng,
    times_s: &[f64],
    r: &[Vector3<f64>],
    v: &[Vector3<f64>],
    plan: &[Attitude],
    is_single: bool,
) -> Vec<Rotation3<f64>> {
    let half_width: f64 =
        if is_single { log_between(rng, 0.02, 0.1) } else { log_between(rng, 0.12, 0.8) }.to_radians();
    let wave: Vec<(f64, f64, f64)> = (0..3)
        .map(|_| {
            (half_width * between(rng, 0.5, 1.0), between(rng, 700.0, 1700.0), between(rng, 0.0, std::f64::consts::TAU))
        })
        .collect();
    let drift: Vec<(f64, f64)> =
        (0..3).map(|_| (between(rng, 5e3, 2e4), between(rng, 0.0, std::f64::consts::TAU))).collect();
    let slew_s = between(rng, 1000.0, 1700.0);
    let frozen = lvlh(&r[0], &v[0]);
    let target = |hold: &Attitude, k: usize| {
        euler(hold.euler_deg) * if hold.hold == Hold::Lvlh { lvlh(&r[k], &v[k]) } else { frozen }
    };
    let mut current = 0;
    let mut turned: Option<Vector3<f64>> = None;
    (0..times_s.len())
        .map(|k| {
            let t = times_s[k] - times_s[0];
            while current + 1 < plan.len() && times_s[k] >= plan[current + 1].from_s {
                current += 1;
            }
            let new = target(&plan[current], k);
            let progress = if current == 0 { 1.0 } else { ((times_s[k] - plan[current].from_s) / slew_s).min(1.0) };
            let held = if progress < 1.0 {
                let old = target(&plan[current - 1], k);
                let turn = nearest_turn(turn_vector(&(new * old.inverse())), turned);
                turned = Some(turn);
                let smooth = progress.powi(3) * (10.0 - 15.0 * progress + 6.0 * progress * progress);
                Rotation3::new(turn * smooth) * old
            } else {
                turned = None;
                new
            };
            // A limit cycle, its amplitude breathing slowly; smooth enough for the files' 20 s grid to carry its acceleration.
            let wobble = Vector3::from_fn(|i, _| {
                let phase = std::f64::consts::TAU * t / wave[i].1 + wave[i].2;
                let breath = 1.0 + 0.15 * (std::f64::consts::TAU * t / drift[i].0 + drift[i].1).sin();
                wave[i].0 * breath * phase.sin()
            });
            Rotation3::new(-wobble) * held
        })
        .collect()
}

/// Axis times angle. By the quaternion: from the matrix both are lost near half a turn and near none.
fn turn_vector(turn: &Rotation3<f64>) -> Vector3<f64> {
    nalgebra::UnitQuaternion::from_rotation_matrix(turn).scaled_axis()
}

/// The same turn the way round that is nearer to the turn a moment before: near half a turn the shorter way changes sides.
fn nearest_turn(turn: Vector3<f64>, before: Option<Vector3<f64>>) -> Vector3<f64> {
    let Some(before) = before else { return turn };
    let angle = turn.norm().max(1e-12);
    let other = turn * (1.0 - std::f64::consts::TAU / angle);
    if (other - before).norm() < (turn - before).norm() { other } else { turn }
}

/// w in body axes from C(t): dC/dt = -[w x] C, by central difference over two steps.
fn rates(body: &[Rotation3<f64>]) -> Vec<Vector3<f64>> {
    let last = body.len() - 1;
    (0..body.len())
        .map(|k| {
            let (a, b) = (k.saturating_sub(1), (k + 1).min(last));
            let turn = body[b] * body[a].inverse();
            -turn_vector(&turn) / (STEP_S * (b - a) as f64)
        })
        .collect()
}

fn derivative(series: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let last = series.len() - 1;
    (0..series.len())
        .map(|k| {
            let (a, b) = (k.saturating_sub(1), (k + 1).min(last));
            (series[b] - series[a]) / (STEP_S * (b - a) as f64)
        })
        .collect()
}

/// Exponential in height above the equatorial radius; with other physics, waves and a latitude term beside it.
fn density(rng: &mut ChaCha12Rng, times_s: &[f64], r: &[Vector3<f64>], other_physics: bool) -> (Vec<f64>, f64) {
    let at_300_km = log_between(rng, 6e-12, 1.5e-11);
    let (scale_m, structure) =
        if other_physics { (between(rng, 40e3, 55e3), between(rng, 0.02, 0.08)) } else { (45e3, 0.0) };
    let lat = between(rng, -0.1, 0.1) * if other_physics { 1.0 } else { 0.0 };
    let waves: Vec<(f64, f64)> =
        (0..4).map(|_| (log_between(rng, 900.0, 40e3), between(rng, 0.0, std::f64::consts::TAU))).collect();
    let density = r
        .iter()
        .zip(times_s)
        .map(|(r, t)| {
            let radius = r.norm();
            let wave: f64 =
                waves.iter().map(|(period, phase)| (std::f64::consts::TAU * t / period + phase).sin()).sum();
            let shape = 1.0 + 0.5 * structure * wave + lat * (3.0 * (r.z / radius).powi(2) * 4.0 - 1.0);
            at_300_km * (-(radius - EARTH_RADIUS_M - 300e3) / scale_m).exp() * shape
        })
        .collect();
    (density, between(rng, 0.3, 0.45))
}

/// A wind over local time and latitude that the simulation knows too (inertial axes), zero unless the physics is its own.
fn wind(rng: &mut ChaCha12Rng, times_s: &[f64], r: &[Vector3<f64>], other_physics: bool) -> Vec<Vector3<f64>> {
    let size_m_s = if other_physics { between(rng, 50.0, 180.0) } else { 0.0 };
    let phase = between(rng, 0.0, std::f64::consts::TAU);
    r.iter()
        .zip(times_s)
        .map(|(r, _)| {
            let east = Vector3::z().cross(r).normalize();
            let north = r.normalize().cross(&east);
            let longitude = r.y.atan2(r.x);
            east * (size_m_s * (longitude + phase).sin()) + north * (0.5 * size_m_s * (2.0 * longitude + phase).cos())
        })
        .collect()
}

/// The log as the open cases have it: a night a day, some of jets, evaporator cycles, dumps and a change of mass.
fn log(rng: &mut ChaCha12Rng, start_s: f64, length_s: f64) -> Vec<Event> {
    let tenth = |t: f64| (t * 10.0).round() / 10.0;
    let mut events = Vec::new();
    for day_s in (0..).map(|day| 86_400.0 * f64::from(day)).take_while(|day_s| *day_s < length_s) {
        let clock_s = start_s + day_s + between(rng, 0.0, 3600.0);
        events.push(Event { clock_s, duration_s: 28_800.0, kind: "crew_sleep" });
    }
    if rng.random_bool(0.45) {
        let mean_s = between(rng, 300.0, 800.0);
        let mut t = start_s;
        loop {
            t += -mean_s * (1.0 - rng.random::<f64>()).ln();
            if t >= start_s + length_s {
                break;
            }
            events.push(Event { clock_s: t, duration_s: 80.0, kind: "thruster" });
        }
    }
    if rng.random_bool(0.6) {
        for _ in 0..*pick(rng, &[2, 3, 4, 5]) {
            let mut t = start_s + between(rng, 0.0, 0.9) * length_s;
            for _ in 0..*pick(rng, &[8, 12, 16, 24]) {
                events.push(Event { clock_s: t, duration_s: between(rng, 240.0, 420.0), kind: "evaporator" });
                t += between(rng, 550.0, 970.0);
            }
        }
    }
    if rng.random_bool(0.5) {
        for _ in 0..*pick(rng, &[1, 2, 2, 3]) {
            let clock_s = start_s + between(rng, 0.05, 0.93) * length_s;
            events.push(Event { clock_s, duration_s: between(rng, 1500.0, 3600.0), kind: "water_dump" });
        }
    }
    if rng.random_bool(0.5) {
        let clock_s = start_s + between(rng, 0.25, 0.75) * length_s;
        events.push(Event { clock_s, duration_s: 0.0, kind: "mass_change" });
    }
    for event in &mut events {
        event.clock_s = tenth(event.clock_s);
        event.duration_s = tenth(event.duration_s);
    }
    events.retain(|event| event.clock_s < start_s + length_s);
    events.sort_by(|a, b| a.clock_s.total_cmp(&b.clock_s));
    events
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn the_attitude_of_the_case_format_turns_yaw_then_pitch_then_roll() {
        // Mean attitudes found in the open cases: [0,90,0] and [90,0,90] from LVLH.
        let m = euler([0.0, 90.0, 0.0]).into_inner();
        assert!((m - Matrix3::new(0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0)).norm() < 1e-12);
        let m = euler([90.0, 0.0, 90.0]).into_inner();
        assert!((m - Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0)).norm() < 1e-12);
    }

    #[test]
    fn no_slew_jumps() {
        for seed in 0..40 {
            let flight = Flight::draw(&mut ChaCha12Rng::seed_from_u64(seed), Kind::One, Manner::default());
            let fastest = flight.rate_rad_s.iter().map(|w| w.norm()).fold(0.0, f64::max).to_degrees();
            // 360 deg in 1000 s by the quintic is 0.68 deg/s, less the orbit's own 0.066.
            assert!(fastest < 0.8, "seed {seed}: {fastest} deg/s");
        }
    }

    #[test]
    fn a_held_lvlh_attitude_turns_once_an_orbit_backwards_about_the_cross_track_axis() {
        let mut rng = ChaCha12Rng::seed_from_u64(3);
        let flight = Flight::draw(&mut rng, Kind::Single, Manner::default());
        let k = flight.times_s.len() / 2;
        let l = lvlh(&flight.position_m[k], &flight.velocity_m_s[k]);
        let in_lvlh = l * (flight.body[k].inverse() * flight.rate_rad_s[k]);
        let n = (MU_M3_S2 / flight.position_m[k].norm().powi(3)).sqrt();
        assert!((in_lvlh.y + n).abs() < 0.02 * n + 4e-5, "{in_lvlh:?} against {n}");
    }
}

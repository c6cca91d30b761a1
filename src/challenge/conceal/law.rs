//! Laws that no catalogue lists. A sound analyser says `unexplained`, locates them, and gives none of them a physical name.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use rand_chacha::ChaCha12Rng;

use super::draw::{between, direction, log_between, pick};
use super::flight::{Flight, STEP_S};
use super::force::{self, Series};
use crate::math::rms::rms_about_mean;

/// Name and plain statement of every law that is drawn.
pub const LAWS: [(&str, &str); 16] = [
    ("unknown_eclipse_snap", "exp decay after every terminator crossing"),
    ("unknown_quadratic_rate", "wx*wz"),
    ("unknown_cubic", "cubic of the signal on one axis"),
    ("unknown_local_time", "a bump at one local time"),
    ("unknown_root_density", "square root of density, fixed in the body"),
    ("unknown_field_squared", "magnetic field magnitude squared, fixed in the body"),
    ("unknown_hysteresis", "temperature with hysteresis"),
    ("unknown_clipping", "one axis saturates softly"),
    ("unknown_echo", "a decaying push some time after every logged event"),
    ("unknown_altitude_gate", "a push while above one height"),
    ("unknown_region", "a push over one region of the Earth"),
    ("unknown_rectified_rate", "magnitude of the deadband's angular acceleration"),
    ("unknown_chirp", "an oscillation of drifting period"),
    ("unknown_telegraph", "switching between two levels at irregular times"),
    ("unknown_density_temperature", "density times temperature, fixed in the body"),
    ("unknown_sawtooth", "a ramp that starts again at every waking"),
];

/// Laws that are there by name only: what is drawn stays what it was.
const LAWS_BY_NAME: [(&str, &str); 8] = [
    ("unknown_ringing", "a damped oscillation after every change of attitude"),
    ("unknown_packet", "an oscillation that swells and fades once"),
    ("unknown_slow_chirp", "a slow oscillation of drifting period"),
    ("unknown_delayed", "a push of minutes some time after every logged event"),
    ("unknown_clock", "a ramp that starts again at even distances of its own"),
    ("unknown_push", "one push that ends"),
    ("unknown_slack", "the temperature, followed with a slack"),
    ("unknown_spot", "a push over one spot of the Earth"),
];

/// Name and plain statement of every law.
pub fn all() -> impl Iterator<Item = (&'static str, &'static str)> {
    LAWS.into_iter().chain(LAWS_BY_NAME)
}

/// The law's signature, of arbitrary size, ng, and where it acts.
pub fn signature(rng: &mut ChaCha12Rng, name: &str, flight: &Flight, total: &[Vector3<f64>]) -> Series {
    let one_axis = Vector3::ith(*pick(rng, &[0, 1, 2]), 1.0);
    let fixed = if between(rng, 0.0, 1.0) < 0.3 { one_axis } else { direction(rng) };
    let n = flight.times_s.len();
    let along = |shape: Vec<f64>, d: Vector3<f64>| -> Series { shape.into_iter().map(|x| d * x).collect() };
    let axis = one_axis.imax();
    match name {
        "unknown_eclipse_snap" => along(snap(rng, &force::sunlit(flight)), fixed),
        "unknown_quadratic_rate" => {
            let [i, j] = *pick(rng, &[[0, 2], [0, 1], [1, 2]]);
            along(flight.rate_rad_s.iter().map(|w| 1e9 * w[i] * w[j]).collect(), one_axis)
        }
        "unknown_cubic" => along(total.iter().map(|a| (a[axis] / 200.0).powi(3)).collect(), one_axis),
        "unknown_local_time" => {
            let (hour, width) = (between(rng, 0.0, 24.0), between(rng, 0.5, 1.5));
            along((0..n).map(|k| bump(local_hour(flight, k), hour, width)).collect(), fixed)
        }
        "unknown_root_density" => {
            along(force::density(flight, force::WHOLE_AIR).iter().map(|d| d.sqrt() * 1e6).collect(), fixed)
        }
        "unknown_field_squared" => {
            along(force::field_t(flight).iter().map(|b| b.norm_squared() * 1e9).collect(), fixed)
        }
        "unknown_hysteresis" => along(play(&flight.temperature_c, between(rng, 0.3, 0.8)), fixed),
        "unknown_clipping" => {
            let mut sorted: Vec<f64> = total.iter().map(|a| a[axis]).collect();
            sorted.sort_by(f64::total_cmp);
            let level = sorted[n * 3 / 4];
            along(total.iter().map(|a| -(a[axis] - level).max(0.0) / 10.0).collect(), one_axis)
        }
        "unknown_echo" => along(echo(rng, flight), fixed),
        "unknown_altitude_gate" => {
            let radius: Vec<f64> = flight.position_m.iter().map(Vector3::norm).collect();
            let mut sorted = radius.clone();
            sorted.sort_by(f64::total_cmp);
            let gate = sorted[n * 7 / 10];
            along(radius.iter().map(|r| f64::from(u8::from(*r > gate))).collect(), fixed)
        }
        "unknown_region" => {
            let (longitude, width) = (between(rng, -180.0, 180.0), between(rng, 25.0, 45.0));
            along((0..n).map(|k| region(flight, k, longitude, width)).collect(), fixed)
        }
        "unknown_spot" => along(spot(rng, flight), fixed),
        "unknown_rectified_rate" => {
            along(flight.rate_change_rad_s2.iter().map(|w| (w[axis].abs() * 1e7).min(30.0)).collect(), fixed)
        }
        "unknown_chirp" => along(chirp(rng, flight, [500.0, 4000.0]), fixed),
        "unknown_slow_chirp" => along(chirp(rng, flight, [4000.0, 20_000.0]), fixed),
        "unknown_ringing" => along(ringing(rng, flight), fixed),
        "unknown_packet" => along(packet(rng, flight), fixed),
        "unknown_delayed" => along(delayed(rng, flight), fixed),
        "unknown_clock" => along(clock(rng, flight), fixed),
        "unknown_push" => along(one_push(rng, flight), fixed),
        "unknown_slack" => {
            let slack_c = between(rng, 0.5, 2.0) * rms_about_mean(&flight.temperature_c);
            along(followed(&flight.temperature_c, slack_c), fixed)
        }
        "unknown_telegraph" => along(telegraph(rng, n), fixed),
        "unknown_density_temperature" => {
            let density = force::density(flight, force::WHOLE_AIR);
            along((0..n).map(|k| density[k] * 1e11 * (flight.temperature_c[k] - 4.0)).collect(), fixed)
        }
        _ => along(sawtooth(flight), fixed),
    }
}

fn snap(rng: &mut ChaCha12Rng, lit: &[f64]) -> Vec<f64> {
    let keep = (-STEP_S / between(rng, 200.0, 700.0)).exp();
    let mut state: f64 = 0.0;
    let mut before = lit[0] > 0.5;
    lit.iter()
        .map(|lit| {
            let now = *lit > 0.5;
            state = if now == before {
                state * keep
            } else if now {
                1.0
            } else {
                -0.6
            };
            before = now;
            state
        })
        .collect()
}

fn local_hour(flight: &Flight, k: usize) -> f64 {
    let (r, s) = (flight.position_m[k], force::sun_unit(flight.times_s[k]));
    (12.0 + (r.y.atan2(r.x) - s.y.atan2(s.x)).to_degrees() / 15.0).rem_euclid(24.0)
}

fn bump(hour: f64, centre: f64, width: f64) -> f64 {
    let away = (hour - centre + 36.0).rem_euclid(24.0) - 12.0;
    (-0.5 * (away / width).powi(2)).exp()
}

/// Longitude below the vehicle from that of some meridian, deg.
fn longitude_deg(flight: &Flight, k: usize) -> f64 {
    let r = flight.position_m[k];
    (r.y.atan2(r.x) - super::flight::EARTH_RATE_RAD_S * (flight.times_s[k] - flight.start_s)).to_degrees()
}

/// Within some ten or twenty degrees of a point of the ground track.
fn spot(rng: &mut ChaCha12Rng, flight: &Flight) -> Vec<f64> {
    let (at, radius_deg) = (between(rng, 0.0, flight.times_s.len() as f64) as usize, between(rng, 10.0, 25.0));
    let below = |k: usize| {
        let r = flight.position_m[k].normalize();
        let (sin, cos) = longitude_deg(flight, k).to_radians().sin_cos();
        let out = r.x.hypot(r.y);
        Vector3::new(out * cos, out * sin, r.z)
    };
    let (centre, least) = (below(at), radius_deg.to_radians().cos());
    (0..flight.times_s.len()).map(|k| f64::from(u8::from(below(k).dot(&centre) > least))).collect()
}

fn region(flight: &Flight, k: usize, longitude_deg: f64, width_deg: f64) -> f64 {
    let r = flight.position_m[k];
    let turned = self::longitude_deg(flight, k);
    let away = (turned - longitude_deg + 540.0).rem_euclid(360.0) - 180.0;
    f64::from(u8::from(away.abs() < width_deg && r.z < 0.0))
}

/// A play operator: follows the temperature only beyond a slack.
fn followed(temperature_c: &[f64], slack_c: f64) -> Vec<f64> {
    let mut state = temperature_c[0];
    let follow = |t: &f64| {
        state = state.clamp(t - slack_c / 2.0, t + slack_c / 2.0);
        state
    };
    temperature_c.iter().map(follow).collect()
}

/// What remains beside the temperature itself is the hysteresis; a tenth of the linear part stays in it.
fn play(temperature_c: &[f64], slack_c: f64) -> Vec<f64> {
    followed(temperature_c, slack_c).iter().zip(temperature_c).map(|(s, t)| (s - t) + 0.1 * t).collect()
}

fn echo(rng: &mut ChaCha12Rng, flight: &Flight) -> Vec<f64> {
    let (delay, tau) = (between(rng, 900.0, 4500.0), between(rng, 400.0, 2500.0));
    // What follows a single event of its kind is a leak like any other; the nights are always two.
    let kinds: Vec<&str> = ["water_dump", "evaporator", "crew_sleep"]
        .into_iter()
        .filter(|k| flight.events.iter().filter(|e| e.kind == *k).count() > 1)
        .collect();
    let kind = *pick(rng, &kinds);
    let mut shape = vec![0.0; flight.times_s.len()];
    for event in flight.events.iter().filter(|e| e.kind == kind) {
        let from = event.clock_s + event.duration_s + delay;
        for (x, t) in shape.iter_mut().zip(&flight.times_s).filter(|(_, t)| **t >= from) {
            *x += (-(t - from) / tau).exp();
        }
    }
    shape
}

/// As long as the event, but as a window sees at least and seven minutes at most. Not every flight has firings and dumps; the nights are
/// always two.
fn delayed(rng: &mut ChaCha12Rng, flight: &Flight) -> Vec<f64> {
    let delay = between(rng, 500.0, 6000.0);
    let of = |kind: &str| flight.events.iter().filter(|e| e.kind == kind).collect::<Vec<_>>();
    let all = ["thruster", "evaporator", "water_dump", "crew_sleep"].map(of);
    let kinds: Vec<_> = all.into_iter().filter(|events| events.len() > 1).collect();
    let mut shape = vec![0.0; flight.times_s.len()];
    for event in pick(rng, &kinds) {
        let from = event.clock_s + delay;
        let until = from + event.duration_s.clamp(80.0, 420.0);
        for (x, _) in shape.iter_mut().zip(&flight.times_s).filter(|(_, t)| (from..until).contains(*t)) {
            *x = 1.0;
        }
    }
    shape
}

/// For minutes to hours: all at once, in a ramp up or down, or with its rise and its fall a fifth of its length each.
fn one_push(rng: &mut ChaCha12Rng, flight: &Flight) -> Vec<f64> {
    let length = log_between(rng, 300.0, 15_000.0);
    let from = flight.start_s + (flight.length_s - length) * between(rng, 0.1, 0.9);
    let courses: [fn(f64) -> f64; 4] = [|_| 1.0, |x| x, |x| 1.0 - x, |x| (5.0 * x.min(1.0 - x)).min(1.0)];
    let course = pick(rng, &courses);
    let at = |t: &f64| (t - from) / length;
    flight.times_s.iter().map(at).map(|x| if (0.0..1.0).contains(&x) { course(x) } else { 0.0 }).collect()
}

/// Four times in the record at least.
fn clock(rng: &mut ChaCha12Rng, flight: &Flight) -> Vec<f64> {
    let (period, phase) = (log_between(rng, 3000.0, flight.length_s / 4.0), between(rng, 0.0, 1.0));
    flight.times_s.iter().map(|t| ((t - flight.start_s) / period + phase).fract()).collect()
}

/// Its period at first between two, and shorter at last.
fn chirp(rng: &mut ChaCha12Rng, flight: &Flight, [shortest_s, longest_s]: [f64; 2]) -> Vec<f64> {
    let (period, drift) = (log_between(rng, shortest_s, longest_s), between(rng, 0.3, 0.8));
    let phase = |k: usize| {
        let x = k as f64 * STEP_S / flight.length_s;
        TAU * flight.length_s / period * (x + 0.5 * drift * x * x)
    };
    (0..flight.times_s.len()).map(|k| phase(k).sin()).collect()
}

/// Sets in with each commanded attitude, in phase with it.
fn ringing(rng: &mut ChaCha12Rng, flight: &Flight) -> Vec<f64> {
    let (period, tau) = (log_between(rng, 200.0, 3000.0), log_between(rng, 1000.0, 8000.0));
    let after =
        |from: f64, t: f64| if t < from { 0.0 } else { (-(t - from) / tau).exp() * (TAU * (t - from) / period).sin() };
    let shape = |t: &f64| flight.attitudes.iter().map(|a| after(a.from_s, *t)).sum();
    flight.times_s.iter().map(shape).collect()
}

fn packet(rng: &mut ChaCha12Rng, flight: &Flight) -> Vec<f64> {
    let (period, width) = (log_between(rng, 200.0, 3000.0), log_between(rng, 1500.0, 8000.0));
    let middle = flight.start_s + flight.length_s * between(rng, 0.1, 0.9);
    let shape = |t: &f64| (-0.5 * ((t - middle) / width).powi(2)).exp() * (TAU * (t - middle) / period).sin();
    flight.times_s.iter().map(shape).collect()
}

fn telegraph(rng: &mut ChaCha12Rng, n: usize) -> Vec<f64> {
    let mean_steps = between(rng, 1200.0, 9000.0) / STEP_S;
    let (mut up, mut left) = (false, 0.0);
    (0..n)
        .map(|_| {
            left -= 1.0;
            if left <= 0.0 {
                up = !up;
                left = mean_steps * between(rng, 0.3, 1.7);
            }
            f64::from(u8::from(up))
        })
        .collect()
}

fn sawtooth(flight: &Flight) -> Vec<f64> {
    let wake: Vec<f64> =
        flight.events.iter().filter(|e| e.kind == "crew_sleep").map(|e| e.clock_s + e.duration_s).collect();
    let ramp = |t: &f64| {
        let last = wake.iter().filter(|w| **w <= *t).fold(flight.start_s - 40_000.0, |a, b| a.max(*b));
        ((t - last) / 57_600.0).min(1.5)
    };
    flight.times_s.iter().map(ramp).collect()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::super::{Kind, Manner};
    use super::*;

    /// In flights without firings or dumps too.
    #[test]
    fn every_law_acts_on_every_flight() {
        for seed in 0..30 {
            let mut rng = ChaCha12Rng::seed_from_u64(seed);
            let flight = Flight::draw(&mut rng, Kind::Unknown, Manner::default());
            let total: Vec<Vector3<f64>> = force::field_t(&flight).iter().map(|b| b * 1e7).collect();
            for (name, _) in all() {
                let push = signature(&mut rng, name, &flight, &total);
                let acts = push.iter().any(|a| a.norm() > 0.0) && push.iter().all(|a| a.norm().is_finite());
                assert!(acts && push.len() == flight.times_s.len(), "{seed}: {name}");
            }
        }
    }
}

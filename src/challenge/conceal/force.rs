//! What the sensor feels on a drawn flight, term by term, on the 5 s grid, ng in body axes.
//!
//! T r with T = -G + [w x][w x] + [dw/dt x], and drag on a turning atmosphere: the equations of the open cases' simulations.

use nalgebra::Vector3;

use super::flight::{EARTH_RATE_RAD_S, Flight, MU_M3_S2};
use crate::physics::{magnetic, shadow, sun};
use crate::units::NANO_G_M_S2;

/// A series of vectors on the flight's grid.
pub type Series = Vec<Vector3<f64>>;

/// The Sun's pressure at 1 au, N/m^2, as fixed by the case format.
const SUN_PRESSURE_N_M2: f64 = 4.56e-6;
/// The bulge follows the Sun by this much, turned eastward, rad.
const BULGE_LAG_RAD: f64 = std::f64::consts::PI / 6.0;

/// -G r, ng.
pub fn gravity_gradient(flight: &Flight, r: &Vector3<f64>) -> Series {
    (0..flight.times_s.len())
        .map(|k| {
            let position = flight.position_m[k];
            let radius = position.norm();
            let e = flight.body[k] * (position / radius);
            (r - e * (3.0 * e.dot(r))) * (MU_M3_S2 / radius.powi(3) / NANO_G_M_S2)
        })
        .collect()
}

/// w x (w x r) + dw/dt x r, ng.
pub fn rotation(flight: &Flight, r: &Vector3<f64>) -> Series {
    (0..flight.times_s.len())
        .map(|k| {
            let w = flight.rate_rad_s[k];
            (w.cross(&w.cross(r)) + flight.rate_change_rad_s2[k].cross(r)) / NANO_G_M_S2
        })
        .collect()
}

/// Which atmosphere the vehicle moves through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Air {
    /// Part of the Earth's rotation it shares.
    pub corotation: f64,
    /// Part of the day-night amplitude it has.
    pub bulge: f64,
    /// Wind along the orbit's velocity (in the plane) and along its normal, beside everything else, m/s.
    pub wind_m_s: [f64; 2],
}

/// The air of a simulation that lacks nothing.
pub const WHOLE_AIR: Air = Air { corotation: 1.0, bulge: 1.0, wind_m_s: [0.0, 0.0] };

/// Density at every point, kg/m^3.
pub fn density(flight: &Flight, air: Air) -> Vec<f64> {
    let cos_psi = bulge_cosine(flight);
    (0..flight.times_s.len())
        .map(|k| flight.density_flat_kg_m3[k] * (1.0 + air.bulge * flight.bulge * cos_psi[k]))
        .collect()
}

/// Cosine of the angle from the bulge's apex.
pub fn bulge_cosine(flight: &Flight) -> Vec<f64> {
    let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), BULGE_LAG_RAD);
    flight.times_s.iter().zip(&flight.position_m).map(|(t, r)| r.normalize().dot(&(turn * sun_unit(*t)))).collect()
}

/// Drag, ng.
pub fn drag(flight: &Flight, air: Air) -> Series {
    let vehicle = &flight.vehicle;
    let density = density(flight, air);
    (0..flight.times_s.len())
        .map(|k| {
            let (r, v) = (flight.position_m[k], flight.velocity_m_s[k]);
            let along = v.normalize();
            let cross = r.cross(&v).normalize();
            let moving = Vector3::z().cross(&r) * (EARTH_RATE_RAD_S * air.corotation)
                + flight.wind_m_s[k]
                + along * air.wind_m_s[0]
                + cross * air.wind_m_s[1];
            let wind = flight.body[k] * (v - moving);
            let speed = wind.norm();
            let u = wind / speed;
            let area: f64 =
                (0..3).map(|i| u[i].abs() * vehicle.area_m2[i] * vehicle.face_scale[usize::from(u[i] < 0.0)][i]).sum();
            let size = 0.5 * density[k] * vehicle.drag_coefficient * area / vehicle.mass_kg * speed * speed;
            u * (-size / NANO_G_M_S2)
        })
        .collect()
}

/// Light pressure at coefficient 1, ng.
pub fn solar_radiation(flight: &Flight) -> Series {
    let vehicle = &flight.vehicle;
    (0..flight.times_s.len())
        .map(|k| {
            let sun = sun_unit(flight.times_s[k]);
            let s = flight.body[k] * sun;
            let area: f64 = (0..3).map(|i| s[i].abs() * vehicle.area_m2[i]).sum();
            let lit = shadow::sunlit_fraction(&flight.position_m[k], &sun);
            s * (-lit * SUN_PRESSURE_N_M2 * area / vehicle.mass_kg / NANO_G_M_S2)
        })
        .collect()
}

/// Part of the Sun seen at every point.
pub fn sunlit(flight: &Flight) -> Vec<f64> {
    let pairs = flight.times_s.iter().zip(&flight.position_m);
    pairs.map(|(t, r)| shadow::sunlit_fraction(r, &sun_unit(*t))).collect()
}

/// The geomagnetic field in body axes, tesla, every 60 s and linear between in inertial axes, where it turns slowly.
pub fn field_t(flight: &Flight) -> Series {
    const STRIDE: usize = 12;
    let last = flight.times_s.len() - 1;
    let knots: Vec<Vector3<f64>> = (0..=last.div_ceil(STRIDE))
        .map(|j| {
            let k = (j * STRIDE).min(last);
            // Outside the model's years there is no field to be sensitive to.
            magnetic::geomagnetic_field_t(unix_s(flight.times_s[k]), &flight.position_m[k]).unwrap_or_default()
        })
        .collect();
    (0..=last)
        .map(|k| {
            let (j, part) = (k / STRIDE, (k % STRIDE) as f64 / STRIDE as f64);
            let inertial = knots[j] * (1.0 - part) + knots[(j + 1).min(knots.len() - 1)] * part;
            flight.body[k] * inertial
        })
        .collect()
}

/// 1 while an event of the kind lasts, the covered part of the step at its edges. Firings that overlap add up; of anything
/// else, overlapping lines of the log are the same event.
pub fn during(flight: &Flight, kind: &str) -> Vec<f64> {
    let mut on = vec![0.0; flight.times_s.len()];
    let half = super::flight::STEP_S / 2.0;
    for event in flight.events.iter().filter(|event| event.kind == kind) {
        let (from, to) = (event.clock_s, event.clock_s + event.duration_s);
        for (on, t) in on.iter_mut().zip(&flight.times_s) {
            let covered = (to.min(t + half) - from.max(t - half)).max(0.0) / (2.0 * half);
            *on = if kind == "thruster" { *on + covered } else { f64::max(*on, covered) };
        }
    }
    on
}

/// Direction to the Sun, inertial.
pub fn sun_unit(clock_s: f64) -> Vector3<f64> {
    sun::direction(unix_s(clock_s))
}

fn unix_s(clock_s: f64) -> f64 {
    Flight::mission().epoch_utc.as_second() as f64 + clock_s
}

/// Sum of two series.
pub fn plus(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> Series {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}

/// Difference of two series.
pub fn minus(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> Series {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

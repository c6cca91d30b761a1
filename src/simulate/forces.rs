//! The quasi-steady acceleration at the sensor, body axes, from the physics.
//!
//! Everything that acts can be taken away, weakened or added to, so that a recording can hold what a simulation lacks.

use crate::physics::attitude::body_from_inertial;
use crate::physics::density::Atmosphere;
use crate::physics::vehicle::Vehicle;
use crate::physics::{
    Mat3, PhysicsError, Vec3, bulge, drag, gravity_gradient, magnetic, rotation, shadow, solar_radiation, sun,
};
use crate::units::NANO_G_M_S2;

use super::mission::MissionConfig;
use super::trajectory::{Situation, Trajectory};

/// Grid of density and field, s; between its points they are interpolated.
const AIR_STEP_S: f64 = 30.0;
/// Grid of the smooth forces, s.
const FORCE_STEP_S: f64 = 5.0;

/// A push fixed in the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Push {
    /// Instrument clock of its beginning, s.
    pub from_clock_s: f64,
    /// Instrument clock of its end, s; infinite for one that never ends.
    pub until_clock_s: f64,
    /// Decay time, s; `None` for a push that lasts.
    pub tau_s: Option<f64>,
    /// Acceleration at the beginning, body axes, ng.
    pub body_ng: Vec3,
}

impl Push {
    fn at(&self, clock_s: f64) -> Vec3 {
        if !(self.from_clock_s..self.until_clock_s).contains(&clock_s) {
            return Vec3::zeros();
        }
        let fade = self.tau_s.map_or(1.0, |tau_s| (-(clock_s - self.from_clock_s) / tau_s).exp());
        self.body_ng * fade
    }
}

/// Which forces act, and how strongly: 1 is nature's own measure.
#[derive(Debug, Clone)]
pub struct ForceModel {
    /// Gravity gradient.
    pub gravity_gradient: f64,
    /// Centripetal and Euler terms.
    pub rotation: f64,
    /// Drag.
    pub drag: f64,
    /// Share of the Earth's rotation the atmosphere takes part in.
    pub corotation: f64,
    /// Bulge beside that of the density model: drag x (1 + amplitude cos psi).
    pub bulge_amplitude: f64,
    /// Wind along the flight and towards the orbit normal, m/s.
    pub wind_m_s: (f64, f64),
    /// Solar radiation pressure.
    pub solar_radiation: f64,
    /// Sensitivity to the geomagnetic field, body axes, ng/T.
    pub magnetic_ng_per_t: Mat3,
    /// Steps of the centre of gravity: instrument clock, and the change of the sensor's offset, body axes, m.
    pub offset_steps_m: Vec<(f64, Vec3)>,
    /// Pushes.
    pub pushes: Vec<Push>,
}

impl Default for ForceModel {
    fn default() -> Self {
        Self {
            gravity_gradient: 1.0,
            rotation: 1.0,
            drag: 1.0,
            corotation: 1.0,
            bulge_amplitude: 0.0,
            wind_m_s: (0.0, 0.0),
            solar_radiation: 1.0,
            magnetic_ng_per_t: Mat3::zeros(),
            offset_steps_m: Vec::new(),
            pushes: Vec::new(),
        }
    }
}

/// What acts on the sensor, whoever works it out.
pub trait QuasiSteady {
    /// Quasi-steady acceleration at the sensor, body axes, ng.
    fn quasi_steady_ng(&self, clock_s: f64) -> Vec3;
}

/// The forces along a trajectory.
pub struct Forces {
    model: ForceModel,
    vehicle: Vehicle,
    trajectory: Trajectory,
    epoch_unix_s: f64,
    air_first_s: f64,
    /// Natural logarithm of the density, and the geomagnetic field (zero when nothing feels it), on the grid.
    air: Vec<(f64, Vec3)>,
    smooth_first_s: f64,
    /// Smooth part on its grid, ng.
    smooth_ng: Vec<Vec3>,
}

impl QuasiSteady for Forces {
    /// Interpolated smooth forces, and the pushes.
    fn quasi_steady_ng(&self, clock_s: f64) -> Vec3 {
        let position = (clock_s - self.smooth_first_s) / FORCE_STEP_S;
        let k = (position as usize).min(self.smooth_ng.len() - 2);
        let (a, b) = (&self.smooth_ng[k], &self.smooth_ng[k + 1]);
        let smooth = a + (b - a) * (position - k as f64);
        self.model.pushes.iter().fold(smooth, |sum, push| sum + push.at(clock_s))
    }
}

impl Forces {
    /// Lays density and smooth forces on their grids along the trajectory.
    ///
    /// # Errors
    /// When density or field have no answer for the mission's time.
    pub fn new(config: &MissionConfig, trajectory: Trajectory) -> Result<Self, PhysicsError> {
        let (start_s, end_s) = (f64::from(config.start_clock_s), f64::from(config.end_clock_s()));
        let epoch_unix_s = config.time.epoch_utc.as_millisecond() as f64 / 1000.0;
        let atmosphere = Atmosphere::default();
        let air_first_s = start_s - AIR_STEP_S;
        let feels_field = config.forces.magnetic_ng_per_t != Mat3::zeros();
        let air = (0..grid_points(air_first_s, end_s, AIR_STEP_S))
            .map(|k| {
                let clock_s = air_first_s + k as f64 * AIR_STEP_S;
                let (unix_s, r_m) = (epoch_unix_s + clock_s, trajectory.state(clock_s).r_m);
                let density = atmosphere.density_kg_m3(unix_s, &r_m, &config.activity)?;
                let field = if feels_field { magnetic::geomagnetic_field_t(unix_s, &r_m)? } else { Vec3::zeros() };
                Ok((density.ln(), field))
            })
            .collect::<Result<Vec<_>, PhysicsError>>()?;
        let mut forces = Self {
            model: config.forces.clone(),
            vehicle: config.vehicle.clone(),
            trajectory,
            epoch_unix_s,
            air_first_s,
            air,
            smooth_first_s: start_s - FORCE_STEP_S,
            smooth_ng: Vec::new(),
        };
        let points = grid_points(forces.smooth_first_s, end_s, FORCE_STEP_S);
        forces.smooth_ng = (0..points)
            .map(|k| forces.smooth_m_s2(forces.smooth_first_s + k as f64 * FORCE_STEP_S) / NANO_G_M_S2)
            .collect();
        Ok(forces)
    }

    /// The trajectory.
    pub fn trajectory(&self) -> &Trajectory {
        &self.trajectory
    }

    /// Density at the vehicle, kg/m^3, as the forces take it.
    pub fn density_kg_m3(&self, clock_s: f64) -> f64 {
        self.air(clock_s).0.exp()
    }

    /// Smooth part at an instant, m/s^2, body axes, computed there and then.
    pub fn smooth_m_s2(&self, clock_s: f64) -> Vec3 {
        let model = &self.model;
        let now = self.trajectory.situation(clock_s);
        let (ln_density, field_t) = self.air(clock_s);
        let c = body_from_inertial(&now.attitude);
        let unix_s = self.epoch_unix_s + clock_s;
        let sun_unit = sun::direction(unix_s);
        let offset_m = self.offset_m(clock_s);

        let gradient = gravity_gradient::specific_force_m_s2(&(c * now.state.r_m), &offset_m);
        let turning = rotation::specific_force_m_s2(&now.rate_rad_s, &now.acceleration_rad_s2, &offset_m);
        let light = solar_radiation::acceleration_m_s2(
            &self.vehicle,
            shadow::sunlit_fraction(&now.state.r_m, &sun_unit),
            &(c * sun_unit),
        );
        let magnetic = model.magnetic_ng_per_t * (c * field_t) * NANO_G_M_S2;
        gradient * model.gravity_gradient
            + turning * model.rotation
            + self.drag_m_s2(&now, &c, ln_density.exp(), &sun_unit) * model.drag
            + light * model.solar_radiation
            + magnetic
    }

    fn drag_m_s2(&self, now: &Situation, c: &Mat3, density_kg_m3: f64, sun_unit: &Vec3) -> Vec3 {
        let (r, v) = (&now.state.r_m, &now.state.v_m_s);
        let (along, cross) = self.model.wind_m_s;
        let wind = drag::wind_m_s(r, v, along, cross);
        let relative = c * drag::relative_velocity_m_s(r, v, self.model.corotation, &wind);
        let bulge = 1.0 + self.model.bulge_amplitude * bulge::cos_psi(r, sun_unit);
        drag::acceleration_m_s2(&self.vehicle, density_kg_m3, &relative) * bulge
    }

    /// The sensor's offset from the centre of gravity, body axes, m.
    fn offset_m(&self, clock_s: f64) -> Vec3 {
        let steps = self.model.offset_steps_m.iter().filter(|(from_s, _)| *from_s <= clock_s);
        steps.fold(self.vehicle.sensor_offset_m, |offset, (_, step)| offset + step)
    }

    fn air(&self, clock_s: f64) -> (f64, Vec3) {
        let position = (clock_s - self.air_first_s) / AIR_STEP_S;
        let k = (position.max(0.0) as usize).min(self.air.len() - 2);
        let (a, b) = (&self.air[k], &self.air[k + 1]);
        let s = position - k as f64;
        (a.0 + (b.0 - a.0) * s, a.1 + (b.1 - a.1) * s)
    }
}

/// Points of a grid from `first_s` that reaches a step beyond `end_s`.
fn grid_points(first_s: f64, end_s: f64, step_s: f64) -> usize {
    ((end_s - first_s) / step_s).ceil() as usize + 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::orbit;
    use crate::simulate::mission::Mission;

    #[test]
    fn interpolated_forces_are_the_forces_computed_independently() {
        let mut config = MissionConfig::sts65(3, 8.0);
        config.forces.pushes.push(Push {
            from_clock_s: 20_000.0,
            until_clock_s: f64::INFINITY,
            tau_s: Some(5000.0),
            body_ng: Vec3::new(100.0, -50.0, 20.0),
        });
        let mission = Mission::new(config.clone()).unwrap();
        let vehicle = &config.vehicle;
        for k in 0..40 {
            let clock_s = 14_460.0 + f64::from(k) * 700.3;
            // Every term anew: own propagation, own rates over another span, the density not interpolated.
            let start = config.orbit.state().unwrap();
            let state = orbit::propagate(&start, clock_s - 14_400.0, 5.0, crate::physics::J2).unwrap();
            let attitude = |s: f64| mission.forces().trajectory().attitude(s);
            let rate = |s: f64| crate::physics::attitude::rate_rad_s(&attitude(s - 0.5), &attitude(s + 0.5), 1.0);
            let (w, dw) = (rate(clock_s), (rate(clock_s + 5.0) - rate(clock_s - 5.0)) / 10.0);
            let c = body_from_inertial(&attitude(clock_s));
            let unix_s = 773_671_981.0 + clock_s;
            let density = Atmosphere::default().density_kg_m3(unix_s, &state.r_m, &config.activity).unwrap();
            let rb = c * state.r_m;
            let e = rb.normalize();
            let offset = vehicle.sensor_offset_m;
            let tide = (3.0 * e * e.dot(&offset) - offset) * (crate::physics::MU_M3_S2 / rb.norm().powi(3));
            let air = c * (state.v_m_s - Vec3::new(0.0, 0.0, 7.292_115_9e-5).cross(&state.r_m));
            let area = air.normalize().abs().dot(&vehicle.area_m2);
            let drag = -0.5 * density * vehicle.drag_coefficient * area / vehicle.mass_kg * air.norm() * air;
            let s = sun::direction(unix_s);
            let nu = shadow::sunlit_fraction(&state.r_m, &s);
            let sb = c * s;
            let light = -nu * 1.3 * 4.56e-6 * sb.abs().dot(&vehicle.area_m2) / vehicle.mass_kg * sb;
            let mut expected = (w.cross(&w.cross(&offset)) + dw.cross(&offset) - tide + drag + light) / NANO_G_M_S2;
            if clock_s >= 20_000.0 {
                expected += Vec3::new(100.0, -50.0, 20.0) * (-(clock_s - 20_000.0) / 5000.0).exp();
            }
            let found = mission.forces().quasi_steady_ng(clock_s);
            // Interpolation over 5 s and of the density over 30 s: parts in ten thousand of 400 ng.
            assert!((found - expected).norm() < 0.3, "{found} against {expected} at {clock_s}");
        }
    }
}

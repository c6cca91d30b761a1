//! What the analyst of a mission would have beside its recording: the simulation by nature's own measure, the ancillary data and
//! the log, as the files of a case.
//!
//! The simulation takes every force as `ForceModel::default()` has it: what the mission flew with otherwise (a push, a step of
//! the centre of gravity, another strength of a force) is what it lacks. A lasting push stands in the log as a water dump, a
//! decaying one does not.

use std::fmt::Write as _;

use crate::physics::attitude::to_scalar_first;

use super::SimulateError;
use super::forces::{ForceModel, QuasiSteady};
use super::instrument::Temperature;
use super::mission::{Mission, MissionConfig};

/// Grid of simulation and ancillary data, s.
const GRID_S: u32 = 20;

/// Names of the files of a case.
pub const CASE_FILES: [&str; 4] = ["case.toml", "simulation.csv", "ancillary.csv", "events.csv"];

/// The files of a case whose recording is the mission's dump: names and texts.
///
/// # Errors
/// As [`Mission::new`].
pub fn case_files(mission: &Mission, id: &str, dump: &str) -> Result<Vec<(&'static str, String)>, Vec<SimulateError>> {
    let config = mission.config();
    let believed = Mission::new(MissionConfig { forces: ForceModel::default(), ..config.clone() })?;
    let texts = [case_toml(config, id, dump), simulation_csv(&believed), ancillary_csv(&believed), events_csv(config)];
    Ok(CASE_FILES.into_iter().zip(texts).collect())
}

fn grid(config: &MissionConfig) -> impl Iterator<Item = f64> {
    (config.start_clock_s..=config.end_clock_s()).step_by(GRID_S as usize).map(f64::from)
}

fn case_toml(config: &MissionConfig, id: &str, dump: &str) -> String {
    let vehicle = &config.vehicle;
    let three = |v: &crate::physics::Vec3| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
    format!(
        "[case]\nid = {id:?}\nepoch_utc = \"{}\"\nliftoff_clock_s = {:?}\nstart_s = {:?}\nend_s = {:?}\n\n\
         [vehicle]\nmass_kg = {:?}\ndrag_coefficient = {:?}\narea_m2 = {}\nsensor_offset_m = {}\nsrp_coefficient = {:?}\n\n\
         [simulation]\nfile = \"simulation.csv\"\n\
         includes = [\"gravity_gradient\", \"rotation\", \"aerodynamic_drag\", \"solar_radiation_pressure\"]\n\n\
         [recording]\nfile = {dump:?}\nkind = \"recorder_dump\"\n\n\
         [ancillary]\nfile = \"ancillary.csv\"\nevents = \"events.csv\"\n",
        config.time.epoch_utc,
        config.time.liftoff_clock_s,
        f64::from(config.start_clock_s),
        f64::from(config.end_clock_s()),
        vehicle.mass_kg,
        vehicle.drag_coefficient,
        three(&vehicle.area_m2),
        three(&vehicle.sensor_offset_m),
        vehicle.srp_coefficient,
    )
}

fn simulation_csv(believed: &Mission) -> String {
    let mut csv = String::from("clock_s,ax_ng,ay_ng,az_ng\n");
    for clock_s in grid(believed.config()) {
        let a = believed.forces().quasi_steady_ng(clock_s);
        let _ = writeln!(csv, "{clock_s:.1},{:.3},{:.3},{:.3}", a.x, a.y, a.z);
    }
    csv
}

fn ancillary_csv(believed: &Mission) -> String {
    let config = believed.config();
    let forces = believed.forces();
    let mut temperature = Temperature::new(config.temperature, config.seed, f64::from(config.start_clock_s));
    let mut csv = String::from(
        "clock_s,rx_m,ry_m,rz_m,vx_m_s,vy_m_s,vz_m_s,qw,qx,qy,qz,wx_rad_s,wy_rad_s,wz_rad_s,density_kg_m3,temperature_c\n",
    );
    for clock_s in grid(config) {
        let now = forces.trajectory().situation(clock_s);
        let (r, v, w) = (now.state.r_m, now.state.v_m_s, now.rate_rad_s);
        let [qw, qx, qy, qz] = to_scalar_first(&now.attitude);
        let warm_c = temperature.at(clock_s, config.time.met_h(clock_s));
        let _ = writeln!(
            csv,
            "{clock_s:.1},{:.2},{:.2},{:.2},{:.5},{:.5},{:.5},{qw:.9},{qx:.9},{qy:.9},{qz:.9},{:.9e},{:.9e},{:.9e},{:.5e},{warm_c:.3}",
            r.x,
            r.y,
            r.z,
            v.x,
            v.y,
            v.z,
            w.x,
            w.y,
            w.z,
            forces.density_kg_m3(clock_s),
        );
    }
    csv
}

/// The log: the crew's sleep and the pushes that last.
fn events_csv(config: &MissionConfig) -> String {
    let (start_s, end_s) = (f64::from(config.start_clock_s), f64::from(config.end_clock_s()));
    let mut events: Vec<(f64, f64, &str)> = Vec::new();
    let first_sleep_s = config.time.liftoff_clock_s + config.noise.sleep_begins_met_h * 3600.0;
    let lasts_s = config.noise.sleep_h * 3600.0;
    let first_day = ((start_s - lasts_s - first_sleep_s) / 86_400.0).ceil();
    let sleeps = (0..).map(|day| first_sleep_s + (first_day + f64::from(day)) * 86_400.0);
    events.extend(sleeps.take_while(|from_s| *from_s < end_s).map(|from_s| (from_s, lasts_s, "crew_sleep")));
    for push in config.forces.pushes.iter().filter(|push| push.tau_s.is_none() && push.until_clock_s.is_finite()) {
        events.push((push.from_clock_s, push.until_clock_s - push.from_clock_s, "water_dump"));
    }
    events.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut csv = String::from("clock_s,duration_s,kind,detail\n");
    for (clock_s, duration_s, kind) in events {
        let _ = writeln!(csv, "{clock_s:.1},{duration_s:.1},{kind},");
    }
    csv
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::Vec3;
    use crate::simulate::forces::Push;

    #[test]
    fn the_simulation_lacks_what_the_mission_was_given_and_nothing_else() {
        let mut config = MissionConfig::sts65(4, 2.0);
        config.forces.pushes.push(Push {
            from_clock_s: 15_000.0,
            until_clock_s: 16_000.0,
            tau_s: None,
            body_ng: Vec3::new(100.0, 0.0, 0.0),
        });
        let mission = Mission::new(config).unwrap();
        let files = case_files(&mission, "sim", "recording.dump").unwrap();
        let simulation = &files[1].1;
        for line in simulation.lines().skip(1).step_by(17) {
            let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
            let flown = mission.forces().quasi_steady_ng(cells[0]);
            let push_ng = if (15_000.0..16_000.0).contains(&cells[0]) { 100.0 } else { 0.0 };
            assert!((flown.x - cells[1] - push_ng).abs() < 1e-3 && (flown.z - cells[3]).abs() < 1e-3, "{line}");
        }
        assert!(files[3].1.contains("15000.0,1000.0,water_dump"), "{}", files[3].1);
        assert_eq!(files[2].1.lines().count(), 2 + 7200 / 20);
    }
}

//! Whether the numbers of a case can be in the units they should be in: by the size of the middle one.

use super::{Ancillary, Recording, Simulation, Vehicle, WINDOWS_MIN, motion};
use crate::diagnose::error::CaseError;
use crate::physics::Vec3;
use crate::physics::drag::acceleration_m_s2;
use crate::units::NANO_G_M_S2;

/// Nothing on a vehicle in orbit is accelerated by more, ng.
const A_MAX_NG: f64 = 1e9;
/// Drag at which a low orbit would sink by 150 km a day, ng.
const DRAG_MAX_NG: f64 = 1e5;
/// Columns of accelerations.
const ACCELERATION: [&str; 3] = ["ax_ng", "ay_ng", "az_ng"];
/// Columns of average deviations.
const DEVIATION: [&str; 3] = ["dev_x_ng", "dev_y_ng", "dev_z_ng"];

/// A recording: long enough, and in nano-g.
pub fn recording(file: &str, recording: &Recording) -> Result<(), CaseError> {
    if recording.clock_s.len() < WINDOWS_MIN {
        return Err(CaseError::TooFew { file: file.into(), found: recording.clock_s.len(), needed: WINDOWS_MIN });
    }
    for k in 0..3 {
        changes(file, ACCELERATION[k], &recording.a_ng[k])?;
        typical(file, ACCELERATION[k], &recording.a_ng[k], "ng", 1e-2, 1e7)?;
        each(file, ACCELERATION[k], &recording.a_ng[k], "ng", [-A_MAX_NG, A_MAX_NG])?;
        typical(file, DEVIATION[k], &recording.dev_ng[k], "ng", 1e-3, 1e7)?;
        each(file, DEVIATION[k], &recording.dev_ng[k], "ng", [0.0, A_MAX_NG])?;
    }
    Ok(())
}

/// A simulation: in nano-g.
pub fn simulation(file: &str, simulation: &Simulation) -> Result<(), CaseError> {
    (0..3).try_for_each(|k| {
        // A simulation may have nothing on an axis, but not next to nothing.
        let low = if simulation.a_ng[k].iter().all(|x| *x == 0.0) { 0.0 } else { 1e-6 };
        typical(file, ACCELERATION[k], &simulation.a_ng[k], "ng", low, 1e7)?;
        each(file, ACCELERATION[k], &simulation.a_ng[k], "ng", [-A_MAX_NG, A_MAX_NG])
    })
}

/// Orbit, attitude and environment: SI, degrees Celsius, unit quaternions.
pub fn ancillary(file: &str, ancillary: &Ancillary) -> Result<(), CaseError> {
    let norm = |v: &[[f64; 3]]| v.iter().map(|x| x.iter().map(|c| c * c).sum::<f64>().sqrt()).collect::<Vec<f64>>();
    typical(file, "rx_m, ry_m, rz_m", &norm(&ancillary.r_m), "m", 6.4e6, 5e7)?;
    typical(file, "vx_m_s, vy_m_s, vz_m_s", &norm(&ancillary.v_m_s), "m/s", 5e2, 1.2e4)?;
    typical(file, "wx_rad_s, wy_rad_s, wz_rad_s", &norm(&ancillary.w_rad_s), "rad/s", 0.0, 1.0)?;
    typical(file, "density_kg_m3", &ancillary.density_kg_m3, "kg/m3", 0.0, 1e-6)?;
    typical(file, "temperature_c", &ancillary.temperature_c, "C", 0.0, 500.0)?;
    let q: Vec<f64> = ancillary.q.iter().map(|q| q.iter().map(|c| c * c).sum::<f64>().sqrt()).collect();
    typical(file, "qw, qx, qy, qz (norm)", &q, "a norm", 0.99, 1.01)?;
    each(file, "qw, qx, qy, qz (norm)", &q, "a norm", [0.9, 1.1])?;
    each(file, "rx_m, ry_m, rz_m (norm)", &norm(&ancillary.r_m), "m", [6.3e6, 1e8])?;
    each(file, "vx_m_s, vy_m_s, vz_m_s (norm)", &norm(&ancillary.v_m_s), "m/s", [1e2, 2e4])?;
    each(file, "wx_rad_s, wy_rad_s, wz_rad_s (norm)", &norm(&ancillary.w_rad_s), "rad/s", [0.0, 10.0])?;
    each(file, "density_kg_m3", &ancillary.density_kg_m3, "kg/m3", [0.0, 1e-6])?;
    each(file, "temperature_c", &ancillary.temperature_c, "C", [-273.15, 2000.0])?;
    motion::agree(file, ancillary)
}

/// The drag that density, mass and area make, the largest side ahead: a vehicle that is braked by more does not stay in orbit.
pub fn drag(file: &str, vehicle: &Vehicle, ancillary: &Ancillary) -> Result<(), CaseError> {
    let vehicle = vehicle.for_physics();
    let largest = vehicle.area_m2.imax();
    let drag_ng = |(density, v): (&f64, &[f64; 3])| {
        let ahead = Vec3::ith(largest, Vec3::from(*v).norm());
        acceleration_m_s2(&vehicle, *density, &ahead).norm() / NANO_G_M_S2
    };
    let drag_ng: Vec<f64> = ancillary.density_kg_m3.iter().zip(&ancillary.v_m_s).map(drag_ng).collect();
    let column = "drag by density_kg_m3 and case.toml's mass_kg, area_m2 and drag_coefficient";
    typical(file, column, &drag_ng, "ng", 0.0, DRAG_MAX_NG)
}

/// Every value within what there is.
fn each(file: &str, column: &str, values: &[f64], unit: &'static str, [low, high]: [f64; 2]) -> Result<(), CaseError> {
    match values.iter().position(|x| !(low..=high).contains(x)) {
        Some(i) => Err(CaseError::Beyond {
            file: file.into(),
            line: i + 2,
            column: column.into(),
            found: values[i],
            unit,
            low,
            high,
        }),
        None => Ok(()),
    }
}

/// Not one value throughout.
fn changes(file: &str, column: &str, values: &[f64]) -> Result<(), CaseError> {
    if values.iter().all(|x| *x == values[0]) {
        let (value, rows) = (values[0], values.len());
        return Err(CaseError::Frozen { file: file.into(), column: column.into(), value, rows });
    }
    Ok(())
}

fn typical(file: &str, column: &str, values: &[f64], unit: &'static str, low: f64, high: f64) -> Result<(), CaseError> {
    let mut sizes: Vec<f64> = values.iter().map(|v| v.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let found = sizes[sizes.len() / 2];
    // A coarse count is mostly zero and not too small for that.
    let many = sizes[sizes.len() * 9 / 10];
    if many < low || found > high {
        return Err(CaseError::Unit { file: file.into(), column: column.into(), found, unit, low, high });
    }
    Ok(())
}

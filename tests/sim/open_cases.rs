//! The physics against the simulations of the open cases: same formulas, written by others.

use std::path::Path;

use oare_ground::physics::attitude::{body_from_inertial, from_scalar_first};
use oare_ground::physics::vehicle::Vehicle;
use oare_ground::physics::{Vec3, drag, gravity_gradient, rotation};
use oare_ground::units::NANO_G_M_S2;

fn rows(path: &Path) -> Vec<Vec<f64>> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    reader.records().map(|row| row.unwrap().iter().map(|field| field.parse().unwrap()).collect()).collect()
}

fn vehicle(case: &Path) -> Vehicle {
    let case: toml::Table = std::fs::read_to_string(case.join("case.toml")).unwrap().parse().unwrap();
    let vehicle = &case["vehicle"];
    let number = |key: &str| vehicle[key].as_float().unwrap();
    let vector = |key: &str| Vec3::from_fn(|i, _| vehicle[key][i].as_float().unwrap());
    Vehicle {
        mass_kg: number("mass_kg"),
        drag_coefficient: number("drag_coefficient"),
        area_m2: vector("area_m2"),
        sensor_offset_m: vector("sensor_offset_m"),
        srp_coefficient: number("srp_coefficient"),
    }
}

#[test]
fn the_simulations_of_the_clean_open_cases_follow_from_the_physics() {
    // Those four simulate what their `includes` say: gravity gradient, rotation, drag.
    for name in ["open-01", "open-02", "open-03", "open-04"] {
        let Some(case) = super::shared_data(&format!("cases/{name}")) else { return };
        let (ancillary, simulation) = (rows(&case.join("ancillary.csv")), rows(&case.join("simulation.csv")));
        let vehicle = vehicle(&case);
        let vector = |row: &[f64], at: usize| Vec3::new(row[at], row[at + 1], row[at + 2]);
        let mut sum2 = Vec3::zeros();
        let mut count = 0.0;
        for k in 1..ancillary.len() - 1 {
            let [before, row, after] = [&ancillary[k - 1], &ancillary[k], &ancillary[k + 1]];
            assert_eq!(row[0], simulation[k][0]);
            let c = body_from_inertial(&from_scalar_first(row[7], row[8], row[9], row[10]).unwrap());
            let (r, v, w) = (vector(row, 1), vector(row, 4), vector(row, 11));
            let acceleration = (vector(after, 11) - vector(before, 11)) / (after[0] - before[0]);
            let air = c * drag::relative_velocity_m_s(&r, &v, 1.0, &Vec3::zeros());
            let force = gravity_gradient::specific_force_m_s2(&(c * r), &vehicle.sensor_offset_m)
                + rotation::specific_force_m_s2(&w, &acceleration, &vehicle.sensor_offset_m)
                + drag::acceleration_m_s2(&vehicle, row[14], &air);
            let difference = force / NANO_G_M_S2 - vector(&simulation[k], 1);
            sum2 += difference.component_mul(&difference);
            count += 1.0;
        }
        let rms = (sum2 / count).map(f64::sqrt);
        // 0.4 ng from differencing the body rates over 40 s where the attitude wobbles, of 100 to 500 ng.
        assert!(rms.max() < 0.6, "{name}: {rms}");
    }
}

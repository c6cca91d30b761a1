//! Whether recording and simulation can be in one unit, and the simulation in that of what its vehicle feels.

use crate::diagnose::scene::Scene;
use crate::math::rms::rms_about_mean;
use crate::physics::Vec3;
use crate::units::NANO_G_M_S2;

/// How many times the simulation's changes the recording's must be for another unit to be a likelier reason than anything left out.
const TIMES: f64 = 300.0;
/// Standard errors by which it must be above nothing, the windows taken for independent.
const SURE: f64 = 20.0;

/// Times by which a simulation must be smaller or larger than this project's own gravity gradient, rotation and drag for that to be
/// told: less than micro- to nano-g, and more than any vehicle data are off. How large the larger then is, ng: below that an offset of a few
/// centimetres in a steady attitude leaves too little to compare.
const OTHER_SIZE: f64 = 100.0;
const OWN_SIZE_NG: f64 = 20.0;

/// Says how many times as much as the simulation the recording changes, where that is out of all proportion.
pub fn of_proportion(scene: &Scene) -> Option<String> {
    let (mut simulated2, mut along, mut recorded2) = (0.0, 0.0, 0.0);
    for (simulated, residual) in scene.simulated_ng.iter().zip(&scene.residual_ng) {
        let count = simulated.len() as f64;
        let mean = |series: &[f64]| series.iter().sum::<f64>() / count;
        let [simulated_mean, residual_mean] = [mean(simulated), mean(residual)];
        for (s, r) in simulated.iter().zip(residual) {
            let (s, r) = (s - simulated_mean, r - residual_mean);
            simulated2 += s * s;
            along += s * (s + r);
            recorded2 += (s + r) * (s + r);
        }
    }
    let times = along / simulated2;
    let windows = 3.0 * scene.schedule.len() as f64;
    let sigma = ((recorded2 - times * along).max(0.0) / (windows * simulated2)).sqrt();
    (times.abs() > TIMES.max(SURE * sigma)).then(|| {
        format!("the recording changes {times:.0} times as much as the simulation beside it: is one of the two in another unit?")
    })
}

/// A simulation of another size than anything that its vehicle feels: of another unit, or without it all.
pub fn of_the_simulation(scene: &Scene) -> Option<String> {
    let offset_m = scene.vehicle.sensor_offset_m;
    let felt = |i: usize| scene.tensor_s2(i) * offset_m / NANO_G_M_S2 + scene.drag_ng[i];
    let own: Vec<Vec3> = (0..scene.grid_s.len()).map(felt).collect();
    let of_axes = |axis: &dyn Fn(usize) -> f64| (0..3).map(|k| axis(k).powi(2)).sum::<f64>().sqrt();
    let own_ng = of_axes(&|k| rms_about_mean(&own.iter().map(|a| a[k]).collect::<Vec<f64>>()));
    let simulated_ng = of_axes(&|k| rms_about_mean(&scene.case.simulation.a_ng[k]));
    let apart = simulated_ng * OTHER_SIZE < own_ng || simulated_ng > own_ng * OTHER_SIZE;
    (apart && own_ng.max(simulated_ng) > OWN_SIZE_NG).then(|| {
        format!(
            "the simulation varies by {simulated_ng:.3} ng rms, gravity gradient, rotation and drag of this vehicle by {own_ng:.1} ng: it \
             may be of another unit, or lack them"
        )
    })
}

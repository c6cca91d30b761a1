//! Whether recording and simulation can be in one unit.

use crate::diagnose::scene::Scene;

/// How many times the simulation's changes the recording's must be for another unit to be a likelier reason than anything left out.
const TIMES: f64 = 300.0;
/// Standard errors by which it must be above nothing, the windows taken for independent.
const SURE: f64 = 20.0;

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

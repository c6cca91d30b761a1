//! Whole terms that are missing together, each plainly: what one of three coefficients explains in their place is none of them.

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::scene::Scene;
use oare_ground::diagnose::{Settings, diagnose};
use oare_ground::units::NANO_G_M_S2;

#[test]
fn drag_gradient_and_rotation_missing_together_are_no_offset_of_the_sensor() {
    for seed in 1_450_000..1_450_004 {
        let concealed = draw_order(&Order { kind: Kind::Clean, seed, only: None, manner: Manner::default() });
        let case = super::case(&concealed.files);
        let scene = Scene::new(&case).unwrap();
        let of_vehicle = |i: usize| scene.tensor_s2(i) * scene.vehicle.sensor_offset_m / NANO_G_M_S2 + scene.drag_ng[i];
        let [felt_ng, simulated_ng] = [scene.measure(of_vehicle), scene.simulated_ng.clone()];
        let mut case = case.clone();
        // An instrument of a fifth of the noise, and all three terms once more: nothing is known as plainly.
        for (k, recorded) in case.recording.a_ng.iter_mut().enumerate() {
            let instants = recorded.iter_mut().zip(simulated_ng[k].iter().zip(&felt_ng[k]));
            instants.for_each(|(a, (simulated, felt))| *a = (*a - simulated) / 5.0 + simulated + felt);
        }
        let found = diagnose(&case, &Settings::default()).unwrap();
        let ids = super::ids(&found);
        assert_ne!(found.verdict, Verdict::Unexplained, "{seed}: {:?}", found.notes);
        let missing = ["aerodynamic_drag", "gravity_gradient", "rotation"];
        assert!(missing.iter().all(|id| ids.contains(id)), "{seed}: {ids:?} {:?} {:?}", found.verdict, found.notes);
    }
}

//! Winds too strong for a derivative: a vehicle that flies nose first shows more area to a cross wind whichever way it blows.

use nalgebra::Vector3;
use oare_ground::challenge::conceal::{Concealed, Kind, Manner, Order, draw_order};
use oare_ground::diagnose::catalogue::{Shape, thermospheric_wind};
use oare_ground::diagnose::scene::Scene;
use oare_ground::diagnose::{Settings, diagnose};
use oare_ground::physics::drag;
use oare_ground::units::NANO_G_M_S2;

use super::case;

fn concealed(seed: u64) -> Concealed {
    draw_order(&Order { kind: Kind::One, seed, only: Some("thermospheric_wind"), manner: Manner::default() })
}

#[test]
fn the_columns_about_a_wind_are_the_drag_in_it_less_the_drag_in_none() {
    let case = case(&concealed(920_307).files);
    let scene = Scene::new(&case).unwrap();
    for wind in [[0.0, 500.0], [-350.0, -420.0], [150.0, 3.0]] {
        let Some(Shape::Columns(columns)) = (thermospheric_wind::EFFECT.signature)(&scene, &wind) else { panic!() };
        let drag_ng = |i: usize, [along, cross]: [f64; 2]| {
            let (r, v) = (&scene.r_m[i], &scene.v_m_s[i]);
            let relative = drag::relative_velocity_m_s(r, v, 1.0, &drag::wind_m_s(r, v, along, cross));
            let drag = drag::acceleration_m_s2(&scene.vehicle, scene.density_kg_m3[i], &(scene.body[i] * relative));
            drag / NANO_G_M_S2
        };
        let expected = scene.measure(|i| -> Vector3<f64> { drag_ng(i, wind) - drag_ng(i, [0.0; 2]) });
        for (axis, expected) in expected.iter().enumerate() {
            let [along, cross] = [0, 1].map(|column: usize| columns[column][axis].as_ref().unwrap());
            for (i, expected) in expected.iter().enumerate() {
                let found = wind[0] * along[i] + wind[1] * cross[i];
                assert!((found - expected).abs() < 1e-9, "{wind:?} axis {axis} window {i}: {found}, not {expected}");
            }
        }
    }
}

#[test]
fn a_strong_cross_wind_is_found_at_its_speed_within_its_error() {
    for seed in [920_307, 920_355] {
        let concealed = concealed(seed);
        let truth = concealed.truth.effects["thermospheric_wind"]["cross_m_s"].as_f64().unwrap();
        assert!(truth > 500.0, "{truth}");
        let found = diagnose(&case(&concealed.files), &Settings::default()).unwrap();
        let ids: Vec<&str> = found.effects.iter().map(|e| e.id.as_str()).collect();
        assert_eq!(ids, ["thermospheric_wind"], "{found:?}");
        let cross = &found.effects[0].parameters[1];
        assert!((cross.value - truth).abs() < 3.0 * cross.sigma && cross.sigma < 0.2 * truth, "{truth}: {cross:?}");
    }
}

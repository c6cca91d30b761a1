//! Lags of hours: every period of the orbit the temperature comes round again, and its log does not say all that was felt.

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::diagnose::{Settings, diagnose};

#[test]
fn a_lag_of_hours_is_found_within_its_error_and_not_a_period_away() {
    for seed in [1_170_013, 1_170_066, 1_170_074] {
        let order = Order { kind: Kind::One, seed, only: Some("temperature_bias"), manner: Manner::default() };
        let concealed = draw_order(&order);
        let truth = concealed.truth.effects["temperature_bias"]["lag_s"].as_f64().unwrap();
        assert!(truth > 7200.0, "{truth}");
        let found = diagnose(&super::case(&concealed.files), &Settings::default()).unwrap();
        let ids: Vec<&str> = found.effects.iter().map(|e| e.id.as_str()).collect();
        assert_eq!(ids, ["temperature_bias"], "{found:?}");
        let lag = &found.effects[0].parameters[0];
        assert_eq!(lag.name, "lag_s");
        assert!((lag.value - truth).abs() < 3.0 * lag.sigma && lag.sigma < 1500.0, "{truth}: {lag:?}");
        let told = |note: &&String| note.starts_with("temperature_bias: ") && note.contains("from before its log");
        assert_eq!(found.notes.iter().filter(told).count(), 1, "{:?}", found.notes);
    }
}

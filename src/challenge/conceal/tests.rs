//! The generator's own claims, without an analyser.

use super::*;
use crate::diagnose::case::Header;
use crate::diagnose::recorder::recorded;
use crate::math::rms::rms;

fn column(text: &str, name: &str) -> Vec<f64> {
    let mut lines = text.lines();
    let place = lines.next().unwrap().split(',').position(|h| h == name).unwrap();
    lines.map(|line| line.split(',').nth(place).unwrap().parse().unwrap()).collect()
}

fn file<'a>(case: &'a Concealed, name: &str) -> &'a str {
    std::str::from_utf8(&case.files.iter().find(|(n, _)| n == name).unwrap().1).unwrap()
}

#[test]
fn the_same_seed_draws_the_same_case_and_another_seed_another() {
    let (a, b, c) = (draw(Kind::One, 5), draw(Kind::One, 5), draw(Kind::One, 6));
    assert_eq!(a.files, b.files);
    assert_eq!(a.truth, b.truth);
    assert_ne!(a.files, c.files);
}

#[test]
fn a_clean_record_differs_from_its_simulation_by_the_noise_and_a_constant() {
    for seed in 0..8 {
        differs_by_noise(&draw(Kind::Clean, seed));
    }
}

fn differs_by_noise(case: &Concealed) {
    let (clock, grid) =
        (column(file(case, "recording.csv"), "clock_s"), column(file(case, "simulation.csv"), "clock_s"));
    for (axis, name) in ["ax_ng", "ay_ng", "az_ng"].into_iter().enumerate() {
        let (recorded, simulated) =
            (column(file(case, "recording.csv"), name), column(file(case, "simulation.csv"), name));
        let mut left: Vec<f64> = clock
            .iter()
            .zip(&recorded)
            .map(|(t, a)| {
                let mean = |t: f64| effect::at(&simulated, (t - grid[0]) / 20.0);
                a - (0..=10).map(|j| mean(t - 25.0 + 5.0 * f64::from(j))).sum::<f64>() / 11.0
            })
            .collect();
        let mean = left.iter().sum::<f64>() / left.len() as f64;
        left.iter_mut().for_each(|x| *x -= mean);
        let rms = (left.iter().map(|x| x * x).sum::<f64>() / left.len() as f64).sqrt();
        // The 20 s grid and the eleven points cost less than 1 % of the noise.
        assert!((rms / case.truth.noise_ng[axis] - 1.0).abs() < 0.01, "{rms} against {}", case.truth.noise_ng[axis]);
    }
}

#[test]
fn drawn_effects_have_a_fair_snr_and_are_not_confused_with_themselves() {
    for (seed, id) in effect::IDS.iter().enumerate().step_by(3) {
        let order = Order {
            kind: Kind::One,
            seed: seed as u64,
            only: Some(id),
            manner: Manner { other_physics: seed % 2 == 0, ..Manner::default() },
        };
        let case = draw_order(&order);
        let snr = case.truth.snr[*id];
        assert!(snr > 3.0 && snr < 400.0, "{id}: {snr}");
        let left = case.truth.snr_left[*id];
        // Continuous onsets and lags leave something against the grid's; a third at most.
        assert!(left < 0.4 * snr, "{id}: {left} left of {snr}");
    }
}

#[test]
fn a_single_attitude_question_has_more_than_one_answer() {
    let case = draw(Kind::Single, 2);
    assert!(!case.truth.confusable.is_empty(), "{:?}", case.truth);
}

#[test]
fn the_twenty_second_files_carry_the_signal() {
    for seed in 0..12 {
        let flight = Flight::draw(&mut ChaCha12Rng::seed_from_u64(seed), Kind::One, Manner::default());
        let fine = Signal::without(&flight, &[]).simulated;
        let coarse: Series = (0..fine.len())
            .map(|k| {
                let (from, part) = (k / 4 * 4, (k % 4) as f64 / 4.0);
                fine[from] * (1.0 - part) + fine[(from + 4).min(fine.len() - 1)] * part
            })
            .collect();
        for (a, b) in record::window_means(&flight, &fine).iter().zip(&record::window_means(&flight, &coarse)) {
            let rms = (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt();
            // A thirtieth of the quietest noise: no finding on a clean record can come from the grid.
            assert!(rms < 1.0, "seed {seed}: {rms} ng");
        }
    }
}

#[test]
fn a_dump_holds_what_the_sensor_felt_at_the_loudness_its_truth_says() {
    let manner = Manner { dump: true, ..Manner::default() };
    let case = draw_order(&Order { kind: Kind::Clean, seed: 3, only: None, manner });
    assert!(file(&case, "case.toml").contains("kind = \"recorder_dump\""));
    let header = Header::parse(file(&case, "case.toml"), &[]).unwrap();
    let dump = &case.files.iter().find(|(n, _)| n == "recording.dump").unwrap().1;
    let recording = recorded(dump, &header);
    // Calibrated from the dump alone; a window differs from the next by its noise, of which they share half the samples.
    for (axis, name) in ["ax_ng", "ay_ng", "az_ng"].into_iter().enumerate() {
        let (clock, a) = (&recording.clock_s, &recording.a_ng[axis]);
        assert!(clock.len() > 4000, "{}", clock.len());
        let grid = column(file(&case, "simulation.csv"), "clock_s");
        let simulated = column(file(&case, "simulation.csv"), name);
        let left: Vec<f64> =
            clock.iter().zip(a).map(|(t, a)| a - effect::at(&simulated, (t - grid[0]) / 20.0)).collect();
        let steps: Vec<f64> = left.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let (found, told) = (rms(&steps), case.truth.noise_ng[axis]);
        // A trimmed mean of normal samples scatters a few parts in a hundred more than a mean; bursts add to it.
        assert!((0.97..1.15).contains(&(found / told)), "{name}: {found} ng, and {told} ng told");
    }
}

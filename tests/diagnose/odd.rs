//! Odd files: what is no measurement is left out, and hides nothing that is there.

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::diagnose::{Settings, diagnose};

use super::drag_case::{Files, drag, files, read, with_cell, with_key, with_lines};

#[test]
fn a_single_wild_value_hides_nothing() {
    let (value, sigma, notes) = drag(&files());
    assert!(!notes.iter().any(|note| note.contains("stand alone")), "{notes:?}");
    for axis in ["ax_ng", "ay_ng", "az_ng"] {
        let (beside, its_sigma, notes) = drag(&with_cell("recording.csv", Some(1500), axis, "-1e6"));
        assert!((beside - value).abs() < 0.3 * sigma && its_sigma < 1.1 * sigma, "{axis}: {beside} {its_sigma}");
        assert!(notes.iter().any(|note| note.starts_with("1 window is left out: it stands alone")), "{notes:?}");
    }
}

/// Twenty minutes of a hung recorder, or of a value that stands for none.
#[test]
fn windows_that_repeat_themselves_hide_nothing() {
    let (value, sigma, notes) = drag(&files());
    assert!(!notes.iter().any(|note| note.contains("repeats")), "{notes:?}");
    for fill in [None, Some("-99999")] {
        let hung = with_lines("recording.csv", |lines| {
            let cells_of = |line: &str| line.split(',').map(str::to_string).collect::<Vec<String>>();
            let last = cells_of(&lines[1500]);
            for line in &mut lines[1501..1549] {
                let mut cells = cells_of(line);
                (1..cells.len()).for_each(|k| cells[k] = fill.map_or_else(|| last[k].clone(), str::to_string));
                // Deviations are no accelerations.
                (4..cells.len()).for_each(|k| cells[k].clone_from(&last[k]));
                *line = cells.join(",");
            }
        });
        let (beside, its_sigma, notes) = drag(&hung);
        assert!((beside - value).abs() < 0.5 * sigma && its_sigma < 1.1 * sigma, "{fill:?}: {beside} {its_sigma}");
        let told = |note: &String| note.contains("windows are left out: an axis repeats the same value");
        assert!(notes.iter().any(told), "{notes:?}");
    }
}

#[test]
fn a_simulation_without_anything_in_it_is_told() {
    let none = with_lines("simulation.csv", |lines| {
        for line in &mut lines[1..] {
            *line = format!("{},0,0,0", line.split(',').next().unwrap());
        }
    });
    let notes = diagnose(&read(&none).unwrap(), &Settings::default()).unwrap().notes;
    assert!(notes.iter().any(|note| note.contains("the simulation varies by 0.000 ng rms")), "{notes:?}");
}

#[test]
fn where_simulation_or_ancillary_data_have_a_hole_nothing_is_compared() {
    let (value, sigma, _) = drag(&files());
    for file in ["simulation.csv", "ancillary.csv"] {
        let (beside, its_sigma, notes) = drag(&with_lines(file, |lines| {
            let third = lines.len() / 3;
            lines.drain(third..third + third / 2);
        }));
        assert!((beside - value).abs() < 2.0 * sigma && its_sigma < 1.6 * sigma, "{file}: {beside} {its_sigma}");
        assert!(notes.iter().any(|note| note.contains("have a hole there")), "{notes:?}");
    }
}

/// A temperature that is what it was is no series: nothing can be said of what follows it, and nothing of what is left out either.
#[test]
fn an_effect_of_what_does_not_change_has_no_limit() {
    for value in ["21.3", "0.1"] {
        let still = with_cell("ancillary.csv", None, "temperature_c", value);
        let found = diagnose(&read(&still).unwrap(), &Settings::default()).unwrap();
        assert!(!found.upper_limits.iter().any(|limit| limit.id == "temperature_bias"), "{:?}", found.upper_limits);
        assert!(found.upper_limits.iter().any(|limit| limit.id == "bias_drift"), "{:?}", found.upper_limits);
    }
}

/// Few windows, in which little changes: what is asked of them has an end.
#[test]
fn every_length_of_record_has_an_answer_without_absurd_limits() {
    for windows in [205, 210, 250, 320] {
        let short = with_lines("recording.csv", |lines| lines.truncate(windows + 1));
        let found = diagnose(&read(&short).unwrap(), &Settings::default()).unwrap();
        assert!(!found.upper_limits.is_empty(), "{windows}: {found:?}");
        for limit in &found.upper_limits {
            assert!(limit.limit_ng > 0.0 && limit.limit_ng < 1e5, "{windows}: {limit:?}");
        }
    }
}

/// The geomagnetic field of years beyond its table is that of its last.
#[test]
fn a_mission_of_today_is_diagnosed() {
    let (value, sigma, _) = drag(&files());
    // As an instant of TOML's own.
    let (now, ..) = drag(&with_key("epoch_utc", "2026-11-20T00:00:00Z"));
    assert!((now - value).abs() < 2.0 * sigma, "{now} for {value}");
}

#[test]
fn a_mistyped_key_is_told_and_blanks_at_the_end_are_nothing() {
    let (value, _, notes) = drag(&files());
    assert!(!notes.iter().any(|note| note.contains("is no key")), "{notes:?}");
    let (beside, _, notes) = drag(&with_lines("case.toml", |lines| {
        for line in lines.iter_mut().filter(|line| line.starts_with("srp_coefficient")) {
            *line = line.replacen("srp", "spr", 1);
        }
    }));
    assert!(
        notes.contains(&"case.toml: `vehicle.spr_coefficient` is no key of a case, and is not read".into()),
        "{notes:?}"
    );
    assert_eq!(beside, value);
    for file in ["recording.csv", "simulation.csv", "ancillary.csv", "events.csv"] {
        let (beside, ..) = drag(&with_lines(file, |lines| lines.push("   \n ".into())));
        assert_eq!(beside, value, "{file}");
    }
}

#[test]
fn a_recording_in_another_unit_is_told() {
    let times = |factor: f64| {
        with_lines("recording.csv", |lines| {
            for line in &mut lines[1..] {
                let (clock_s, rest) = line.split_once(',').unwrap();
                let cells = rest.split(',').map(|cell| format!("{:.6}", cell.parse::<f64>().unwrap() * factor));
                *line = format!("{clock_s},{}", cells.collect::<Vec<String>>().join(","));
            }
        })
    };
    let said = read(&times(1e-3)).err().unwrap_or_default();
    assert!(said.starts_with("simulation.csv: ") && said.ends_with("or one of the two in another unit?"), "{said}");
    let notes = |factor| diagnose(&read(&times(factor)).unwrap(), &Settings::default()).unwrap().notes;
    let tells = |notes: &[String]| notes.iter().any(|note| note.ends_with("is one of the two in another unit?"));
    let [ours, far] = [1.0, 1e3].map(notes);
    assert!(!tells(&ours) && tells(&far), "{ours:?} {far:?}");
}

/// A push of 400 ng in one row of the simulation out of so many, as a firing that others fall between the rows of.
fn kicked(every: usize, times: usize) -> Files {
    with_lines("simulation.csv", |lines| {
        for line in lines[1..].iter_mut().skip(every).step_by(every).take(times) {
            let mut cells: Vec<String> = line.split(',').map(str::to_string).collect();
            cells[1] = (cells[1].parse::<f64>().unwrap() + 400.0).to_string();
            *line = cells.join(",");
        }
    })
}

#[test]
fn a_simulation_that_is_too_coarse_here_and_there_is_compared_elsewhere_and_one_that_is_everywhere_is_refused() {
    let here_and_there = read(&kicked(300, 10)).unwrap();
    assert!((10..200).contains(&here_and_there.windows_too_rough), "{}", here_and_there.windows_too_rough);
    let said = read(&kicked(30, 1000)).unwrap_err();
    assert!(
        said.starts_with("simulation.csv: it changes too fast from row to row") && said.contains("its grid too coarse"),
        "{said}"
    );
}

#[test]
fn an_axis_in_coarse_counts_is_taken_as_it_is() {
    let (value, sigma, _) = drag(&files());
    let coarse = with_lines("recording.csv", |lines| {
        let place = lines[0].split(',').position(|name| name == "ay_ng").unwrap();
        for line in &mut lines[1..] {
            let mut cells: Vec<String> = line.split(',').map(str::to_string).collect();
            cells[place] = (100.0 * (cells[place].parse::<f64>().unwrap() / 100.0).round()).to_string();
            *line = cells.join(",");
        }
    });
    let (beside, ..) = drag(&coarse);
    assert!((beside - value).abs() < 2.0 * sigma, "{beside} for {value}");
}

/// A simulation that ends before the recording does is compared as far as it goes, and that is told.
#[test]
fn windows_that_nothing_is_simulated_for_are_told() {
    let half = with_lines("simulation.csv", |lines| lines.truncate(lines.len() / 2));
    let case = read(&half).unwrap();
    assert!(case.windows_beyond > 1000 && case.recording.clock_s.len() > 1000, "{}", case.windows_beyond);
    let told = format!("{} windows of the span are not compared: ", case.windows_beyond);
    let found = diagnose(&case, &Settings::default()).unwrap();
    assert!(found.notes.iter().any(|note| note.starts_with(&told)), "{:?}", found.notes);
}

/// Where the mismatch is does not hang on where a thermometer has its zero.
#[test]
fn kelvin_or_celsius_the_answer_is_the_same() {
    let order = Order { kind: Kind::One, seed: 1_170_013, only: Some("temperature_bias"), manner: Manner::default() };
    let celsius = draw_order(&order).files;
    let mut warmer = celsius.clone();
    let (_, octets) = warmer.iter_mut().find(|(name, _)| name == "ancillary.csv").unwrap();
    let text = String::from_utf8(octets.clone()).unwrap();
    let place = text.lines().next().unwrap().split(',').position(|name| name == "temperature_c").unwrap();
    let line = |(i, line): (usize, &str)| {
        let mut cells: Vec<String> = line.split(',').map(str::to_string).collect();
        if i > 0 {
            cells[place] = (cells[place].parse::<f64>().unwrap() + 20.0).to_string();
        }
        cells.join(",") + "\n"
    };
    *octets = text.lines().enumerate().map(line).collect::<String>().into_bytes();
    let [a, b] = [celsius, warmer].map(|files| diagnose(&read(&files).unwrap(), &Settings::default()).unwrap());
    assert_eq!((a.located.axes, a.located.frame), (b.located.axes, b.located.frame));
    assert_eq!(
        a.located.intervals.len(),
        b.located.intervals.len(),
        "{:?} {:?}",
        a.located.intervals,
        b.located.intervals
    );
    let covered: f64 = a.located.intervals.iter().map(|i| i.end_s - i.start_s).sum();
    assert!(covered < 0.9 * 36.0 * 3600.0, "the largest part of the mismatch is no whole record: {covered} s");
}

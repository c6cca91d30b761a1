//! Odd files: what is no measurement is left out or refused with its place, and hides nothing that is there.

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::challenge::engine;
use oare_ground::challenge::run::Material;
use oare_ground::diagnose::case::Case;
use oare_ground::diagnose::{Settings, diagnose};

type Files = Vec<(String, Vec<u8>)>;

/// A concealed case of strong drag.
fn files() -> Files {
    let order = Order { kind: Kind::One, seed: 1_191_000, only: Some("aerodynamic_drag"), manner: Manner::default() };
    draw_order(&order).files
}

/// The same with the lines of one file changed.
fn with_lines(file: &str, change: impl Fn(&mut Vec<String>)) -> Files {
    let mut files = files();
    let (_, octets) = files.iter_mut().find(|(name, _)| name == file).unwrap();
    let mut lines: Vec<String> = String::from_utf8_lossy(octets).lines().map(str::to_string).collect();
    change(&mut lines);
    *octets = (lines.join("\n") + "\n").into_bytes();
    files
}

/// The same with one cell changed, on a line or on all of them.
fn with_cell(file: &str, line: Option<usize>, column: &str, value: &str) -> Files {
    with_lines(file, |lines| {
        let place = lines[0].split(',').position(|name| name == column).unwrap();
        let all = 1..lines.len();
        for i in line.map_or(all, |line| line..line + 1) {
            let mut cells: Vec<&str> = lines[i].split(',').collect();
            cells[place] = value;
            lines[i] = cells.join(",");
        }
    })
}

fn read(files: &Files) -> Result<Case, String> {
    engine::read(&Material::Files(files))
}

/// The same with another value of a key of `case.toml`.
fn with_key(key: &str, value: &str) -> Files {
    with_lines("case.toml", |lines| {
        for line in lines.iter_mut().filter(|line| line.starts_with(&format!("{key} ="))) {
            *line = format!("{key} = {value}");
        }
    })
}

/// The same with a column of the ancillary data, and the two after it, put through a function.
fn turned(first: &str, how: impl Fn(f64) -> f64) -> Files {
    with_lines("ancillary.csv", |lines| {
        let place = lines[0].split(',').position(|name| name == first).unwrap();
        for line in &mut lines[1..] {
            let mut cells: Vec<String> = line.split(',').map(str::to_string).collect();
            for cell in &mut cells[place..place + 3] {
                *cell = how(cell.parse().unwrap()).to_string();
            }
            *line = cells.join(",");
        }
    })
}

/// Whether drag is named, its fraction, and the notes.
fn drag(files: &Files) -> (f64, f64, Vec<String>) {
    let found = diagnose(&read(files).unwrap(), &Settings::default()).unwrap();
    assert_eq!(super::ids(&found), ["aerodynamic_drag"], "{found:?}");
    let fraction = &found.effects[0].parameters[0];
    (fraction.value, fraction.sigma, found.notes)
}

#[test]
fn a_single_wild_value_hides_nothing() {
    let (value, sigma, notes) = drag(&files());
    assert!(!notes.iter().any(|note| note.contains("stand alone")), "{notes:?}");
    for axis in ["ax_ng", "ay_ng", "az_ng"] {
        let (beside, its_sigma, notes) = drag(&with_cell("recording.csv", Some(1500), axis, "-1e6"));
        assert!((beside - value).abs() < 0.3 * sigma && its_sigma < 1.1 * sigma, "{axis}: {beside} {its_sigma}");
        assert!(notes.iter().any(|note| note.starts_with("1 windows") && note.contains("stand alone")), "{notes:?}");
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

/// An answer never goes over what it was made from.
#[test]
fn no_file_of_the_case_is_written_over() {
    let folder = tempfile::tempdir().unwrap();
    for (name, octets) in files() {
        std::fs::write(folder.path().join(name), octets).unwrap();
    }
    let recording = folder.path().join("recording.csv");
    let before = std::fs::read(&recording).unwrap();
    let run_of = |case: &std::path::Path, option: &str, to: &std::path::Path| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_oare"));
        let output = command.arg("diagnose").arg(case).arg(option).arg(to).output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let run = |option: &str, to: &std::path::Path| run_of(folder.path(), option, to);
    let refused = |option: &str, to: &std::path::Path, why: &str| {
        let (code, said) = run(option, to);
        assert!(code == Some(2) && said.contains(why), "{option} {}: {code:?} {said}", to.display());
    };
    refused("--out", &recording, "a file of the case");
    refused("--out", folder.path(), "found a folder");
    refused("--report", folder.path(), "the case itself");
    assert_eq!(std::fs::read(&recording).unwrap(), before);
    // An earlier answer is, and nothing else that is JSON.
    let (answer, other) = (folder.path().join("answer.json"), folder.path().join("other.json"));
    std::fs::write(&other, "{}").unwrap();
    refused("--out", &other, "a file of the case");
    assert_eq!([run("--out", &answer).0, run("--out", &answer).0], [Some(0); 2]);
    // A case is its directory, or the file in it that makes it one.
    let (answered, case) = (std::fs::read(&answer).unwrap(), folder.path().join("case.toml"));
    assert_eq!(run_of(&case, "--out", &answer).0, Some(0));
    assert_eq!(std::fs::read(&answer).unwrap(), answered);
    assert!(run_of(&case, "--out", &recording).1.contains("a file of the case"));
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

#[test]
fn what_nothing_can_be_is_refused_with_its_place() {
    for (files, sentence) in [
        (with_cell("recording.csv", None, "az_ng", "100"), "recording.csv: `az_ng` is 100 in all "),
        (with_cell("recording.csv", Some(7), "ay_ng", "1e300"), "recording.csv, line 8: `ay_ng` is 1.000e300, and ng"),
        (with_cell("simulation.csv", Some(9), "ax_ng", "-1e300"), "simulation.csv, line 10: `ax_ng` is -1.000e300"),
        (with_cell("ancillary.csv", Some(4), "density_kg_m3", "1e-5"), "ancillary.csv, line 5: `density_kg_m3`"),
        (with_cell("ancillary.csv", Some(4), "density_kg_m3", "-1e-12"), "ancillary.csv, line 5: `density_kg_m3`"),
        (with_cell("ancillary.csv", Some(4), "wz_rad_s", "1e3"), "ancillary.csv, line 5: `wx_rad_s, wy_rad_s"),
        (with_cell("ancillary.csv", Some(4), "qw", "5"), "ancillary.csv, line 5: `qw, qx, qy, qz (norm)`"),
        (
            with_lines("simulation.csv", |lines| {
                let mut line = 0;
                lines.retain(|_| {
                    line += 1;
                    line % 30 == 1
                });
            }),
            "simulation.csv: its grid is too coarse: 0 windows",
        ),
        (with_cell("simulation.csv", None, "ax_ng", "4e-7"), "simulation.csv: `ax_ng` has a typical size of 4.000e-7"),
        (
            with_lines("case.toml", |lines| lines.retain(|line| !line.starts_with("sensor_offset_m"))),
            "case.toml: `vehicle.sensor_offset_m` must be three finite numbers, found nothing",
        ),
        (
            with_lines("case.toml", |lines| {
                for line in lines.iter_mut().filter(|line| line.starts_with("end_s")) {
                    *line = "end_s = 10.0".into();
                }
            }),
            "case.toml: `case.end_s` (10 s) must be after `case.start_s` (",
        ),
        (
            with_lines("events.csv", |lines| lines.push("400000,-80,crew_sleep,".into())),
            ": `duration_s` is -8.000e1, and s between 0e0 and 3e9 is expected",
        ),
        (
            with_lines("simulation.csv", |lines| lines.iter_mut().for_each(|line| *line += ",0"))
                .into_iter()
                .map(|(name, octets)| match name.as_str() {
                    "simulation.csv" => (
                        name,
                        [
                            b"clock_s,ax_ng,ay_ng,az_ng,ax_ng\n",
                            &octets[octets.iter().position(|o| *o == b'\n').unwrap() + 1..],
                        ]
                        .concat(),
                    ),
                    _ => (name, octets),
                })
                .collect(),
            "simulation.csv: the header has the column `ax_ng` 2 times",
        ),
        (
            with_lines("simulation.csv", |lines| lines[7] += ",1"),
            "simulation.csv: line 8: 5 cells, and the header has 4",
        ),
        (
            with_lines("simulation.csv", |lines| lines.iter_mut().for_each(|line| *line = line.replace(',', ";"))),
            "(commas are expected between the cells)",
        ),
        (with_key("mass_kg", "104.0"), "ancillary.csv: `drag by density_kg_m3 and case.toml's mass_kg, area_m2"),
        (
            with_cell("ancillary.csv", None, "density_kg_m3", "2e-14"),
            "ancillary.csv: `density_kg_m3 (at this height)` has a typical size of 2.000e-14, and kg/m3 between ",
        ),
        (with_key("events", "5"), "case.toml: `ancillary.events` must be a text, found 5"),
        (with_key("includes", "[1]"), "case.toml: `simulation.includes` must be a list of texts, found [1]"),
        (
            with_key("epoch_utc", "\"2050-01-01T00:00:00Z\""),
            "case.toml: `case.epoch_utc` or a position is out of range",
        ),
        (
            with_cell("recording.csv", Some(7), "dev_y_ng", "-3"),
            "recording.csv, line 8: `dev_y_ng` is -3.000e0, and ng",
        ),
        // Empty lines count.
        (
            with_lines("recording.csv", |lines| {
                lines[40] = lines[40].replacen(',', ",NaN", 1);
                lines.insert(20, String::new());
                lines.insert(20, String::new());
            }),
            "recording.csv, line 43: `ax_ng` must be a finite number",
        ),
        (
            with_lines("ancillary.csv", |lines| {
                lines.swap(30, 31);
                lines.insert(20, String::new());
            }),
            "ancillary.csv, line 33: clock_s must increase",
        ),
        (turned("wx_rad_s", |rate| 57.3 * rate), "ancillary.csv: `wx_rad_s, wy_rad_s, wz_rad_s` is not how qw, qx, qy"),
        (turned("qx", |q| -q), "ancillary.csv: `wx_rad_s, wy_rad_s, wz_rad_s` is not how qw, qx, qy, qz change"),
        (turned("vx_m_s", |v| 0.6 * v), "ancillary.csv: `vx_m_s, vy_m_s, vz_m_s` is not how rx_m, ry_m, rz_m change"),
    ] {
        let whole = |case: Case| diagnose(&case, &Settings::default()).map_err(|error| error.to_string());
        let said = read(&files).and_then(whole).err().unwrap_or_else(|| panic!("not refused: {sentence}"));
        assert!(said.contains(sentence), "{said}");
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
fn what_cannot_be_read_is_not_missing() {
    let folder = tempfile::tempdir().unwrap();
    for (name, octets) in files() {
        std::fs::write(folder.path().join(name), octets).unwrap();
    }
    let read = || engine::read(&Material::Directory(folder.path())).map(|_| ()).unwrap_err();
    let simulation = folder.path().join("simulation.csv");
    std::fs::remove_file(&simulation).unwrap();
    assert_eq!(read(), "simulation.csv: the case names this file, but it is not there");
    std::fs::create_dir(&simulation).unwrap();
    assert_eq!(read(), "simulation.csv: it is there and cannot be read: it is not a regular file");
    std::fs::remove_dir(&simulation).unwrap();
    std::fs::write(&simulation, b"clock_s,ax_ng\n\xff").unwrap();
    assert_eq!(read(), "simulation.csv: it is there and cannot be read: octet 15 is no UTF-8 text");
    std::fs::write(&simulation, b"\x1f\x8b\x08\x00").unwrap();
    assert_eq!(read(), "simulation.csv: it is there and cannot be read: it is packed by gzip");
    std::fs::remove_file(folder.path().join("case.toml")).unwrap();
    assert!(read().starts_with("case.toml: there is none in "), "{}", read());
    let file = folder.path().join("events.csv");
    let of_a_file = engine::read(&Material::Directory(&file)).map(|_| ()).unwrap_err();
    assert!(
        of_a_file.contains("a case is a directory, and ") && of_a_file.ends_with("events.csv is none"),
        "{of_a_file}"
    );
}

#[test]
fn a_dump_without_a_window_says_so() {
    let order =
        Order { kind: Kind::Clean, seed: 1_191_001, only: None, manner: Manner { dump: true, ..Manner::default() } };
    let mut files = draw_order(&order).files;
    let (_, dump) = files.iter_mut().find(|(name, _)| name == "recording.dump").unwrap();
    dump.clear();
    assert!(
        read(&files).err().unwrap_or_default().starts_with("recording.dump: no calibrated window is in its 0 octets")
    );
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
fn a_log_of_another_clock_and_a_claim_that_does_not_hold_are_told() {
    let (.., notes) = drag(&with_lines("case.toml", |lines| {
        for line in lines.iter_mut().filter(|line| line.starts_with("includes")) {
            *line = "includes = [\"rotation\", \"aerodynamic_drag\"]".into();
        }
    }));
    let of = |word: &str, notes: &[String]| notes.iter().filter(|note| note.contains(word)).count();
    let (.., of_no_effect) = drag(&with_key("includes", "[\"rotation\", \"gravity_gradiant\"]"));
    assert_eq!(of("includes gravity_gradiant: that is none", &of_no_effect), 1, "{of_no_effect:?}");
    assert_eq!(of("includes aerodynamic_drag: the recording shows", &notes), 1, "{notes:?}");
    assert_eq!((of("includes rotation", &notes), of("another clock", &notes)), (0, 0), "{notes:?}");
    let (.., notes) = drag(&with_lines("events.csv", |lines| {
        for line in &mut lines[1..] {
            let (clock_s, rest) = line.split_once(',').unwrap();
            *line = format!("{},{rest}", 1e9 + clock_s.parse::<f64>().unwrap());
        }
    }));
    assert_eq!(of("another clock", &notes), 1, "{notes:?}");
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

#[test]
fn an_axis_that_stands_still_in_the_span_asked_for_is_refused() {
    let still = with_lines("recording.csv", |lines| {
        let place = lines[0].split(',').position(|name| name == "ay_ng").unwrap();
        for line in &mut lines[40..] {
            let mut cells: Vec<&str> = line.split(',').collect();
            cells[place] = "5";
            *line = cells.join(",");
        }
    });
    let (_, recording) = still.iter().find(|(name, _)| name == "recording.csv").unwrap();
    let from_s = String::from_utf8_lossy(recording).lines().nth(60).unwrap().split(',').next().unwrap().to_string();
    let mut still = still.clone();
    let (_, toml) = still.iter_mut().find(|(name, _)| name == "case.toml").unwrap();
    let text = String::from_utf8_lossy(toml).to_string();
    let lines = text.lines().map(|line| match line.starts_with("start_s") {
        true => format!("start_s = {from_s}"),
        false => line.to_string(),
    });
    *toml = lines.collect::<Vec<String>>().join("\n").into_bytes();
    let said = read(&still).err().unwrap_or_default();
    assert!(said.starts_with("recording.csv: `ay_ng` is 5 in all "), "{said}");
}

/// A kind to every entry: each would be another chance for noise, and all of them minutes of work.
#[test]
fn a_log_of_very_many_kinds_is_tried_in_part_and_told() {
    let (value, sigma, notes) = drag(&files());
    assert!(!notes.iter().any(|note| note.contains("kinds of entries")), "{notes:?}");
    let (beside, _, notes) = drag(&with_lines("events.csv", |lines| {
        let first = lines[1].clone();
        let at: f64 = first.split(',').next().unwrap().parse().unwrap();
        for kind in 0..2000 {
            for entry in 0..3 {
                let at = at + 41.0 * f64::from(kind) + 9000.0 * f64::from(entry);
                lines.push(format!("{at:.1},60.0,kind_{kind},"));
            }
        }
    }));
    assert!(notes.iter().any(|note| note.contains("kinds of entries: formulas are made of the 32")), "{notes:?}");
    assert!((beside - value).abs() < 0.5 * sigma, "{beside} for {value}");
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

/// An entry that is in the log twice, as from two shifts, is one night.
#[test]
fn sleep_that_is_logged_twice_is_no_more_sleep() {
    let twice = with_lines("events.csv", |lines| {
        let sleep: Vec<String> = lines.iter().filter(|line| line.contains("crew_sleep")).cloned().collect();
        assert!(!sleep.is_empty());
        lines.extend(sleep);
    });
    let [once, twice] = [files(), twice].map(|files| drag(&files));
    assert_eq!(once, twice);
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

//! What is no case, or no part of one, is refused with its place.

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::challenge::engine;
use oare_ground::challenge::run::Material;
use oare_ground::diagnose::case::Case;
use oare_ground::diagnose::{Settings, diagnose};

use super::drag_case::{files, read, turned, with_cell, with_key, with_lines};

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
        read(&files).err().unwrap_or_default().starts_with("recording.dump: no window of its 0 octets is calibrated")
    );
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
